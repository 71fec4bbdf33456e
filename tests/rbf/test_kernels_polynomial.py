"""A linear polynomial with kernels that need none: POLYNOMIAL= YES."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.check import contradictions
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.motions.rigid import Translate
from slideviz.rbf.reduction import Reduction
from tests import builders
from tests.oracles.kernels import KERNELS

DEFINITE = [name for name, kernel in KERNELS.items() if not kernel.polynomial]
SADDLES = [name for name, kernel in KERNELS.items() if kernel.polynomial]
REDUCED = Reduction(tolerance=1e-7)
PER_LEVEL = Reduction(tolerance=1e-7, multilevel=True, criterion="size", level_size=3)


def moved_by(mesh, field, **settings):
    """The displacement of all nodes where all boundary nodes have that of a field of points."""
    nodes = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    roles = dict.fromkeys(mesh.marker_names, "moving")
    case = Case(roles=roles, motions=(Prescribed(nodes, field(mesh.points[nodes])),), **settings)
    *_, last = sv.deform(case, mesh)
    return last.mesh.points - mesh.points, last


@settings(max_examples=30, deadline=None)
@given(
    kernel=st.sampled_from(DEFINITE),
    kind=st.sampled_from([(2, "plain"), (2, "mixed"), (3, "plain")]),
    reduction=st.sampled_from([None, REDUCED, PER_LEVEL]),
    steps=st.integers(1, 2),
    radius=st.floats(0.05, 3.0),
    seed=st.integers(0, 99),
    offset=st.sampled_from([0.0, 100.0]),
)
def test_linear_motions_are_exact(kernel, kind, reduction, steps, radius, seed, offset):
    dim, cells = kind
    mesh = builders.square(6, cells) if dim == 2 else builders.cube(4, cells)
    rng = np.random.default_rng(seed)
    mesh = mesh.with_points(mesh.points + offset)
    a, b = 0.2 * rng.standard_normal((dim, dim)), rng.standard_normal(dim)

    def field(points):
        return (points - offset) @ a + b

    settings_ = {"kernel": kernel, "support_radius": radius, "reduction": reduction, "steps": steps}
    moved, last = moved_by(mesh, field, polynomial="yes", **settings_)
    assert not [text for text in last.warnings if "singular" in text]
    np.testing.assert_allclose(moved, field(mesh.points), rtol=0, atol=1e-12 * (10 + offset))


def test_without_it_they_are_not():
    mesh = builders.square(6)
    moved, _ = moved_by(mesh, lambda x: 0.2 * x, support_radius=0.4)
    assert np.abs(moved - 0.2 * mesh.points).max() > 1e-3


def pygem_points(x, controls, deformed, radius):
    """Points (n, 3) moved as PyGeM's ``RBF`` moves them: Gaussian, r = ``radius``, polynomial."""

    def phi(y):
        gap = np.array([[np.linalg.norm(p - c) for c in controls] for p in y])
        return np.exp(-((gap / radius) ** 2))

    def along(y):
        return np.c_[np.ones(len(y)), y]

    n = len(controls)
    system = np.zeros((n + 4, n + 4))
    system[:n, :n], system[:n, n:] = phi(controls), along(controls)
    system[n:, :n] = along(controls).T
    weights = np.linalg.solve(system, np.r_[deformed, np.zeros((4, 3))])
    return np.c_[phi(x), along(x)] @ weights


def test_a_cube_moves_as_in_pygem():
    """A Gaussian of r = 0.5 with polynomial, as in its ``parameters_rbf_cube.prm``."""
    mesh = builders.cube(5)
    nodes = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    shift = 0.03 * np.random.default_rng(3).standard_normal((len(nodes), 3))
    goal = mesh.points[nodes] + shift
    expected = pygem_points(mesh.points, mesh.points[nodes], goal, 0.5)
    roles = dict.fromkeys(mesh.marker_names, "moving")
    case = Case(roles=roles, motions=(Prescribed(nodes, shift),), kernel="gaussian")
    (last,) = sv.deform(case.change(support_radius=0.5, polynomial="yes"), mesh)
    np.testing.assert_allclose(last.mesh.points, expected, rtol=0, atol=1e-6)
    (without,) = sv.deform(case.change(support_radius=0.5), mesh)
    assert np.abs(without.mesh.points - expected).max() > 1e-3


def test_pygem_itself_agrees():
    pygem = pytest.importorskip("pygem")
    if not hasattr(pygem, "RBF"):
        pytest.skip("the package pygem here is another one, a model of glaciers")
    rng = np.random.default_rng(5)
    controls, x = rng.random((8, 3)), rng.random((40, 3))
    goal = controls + 0.1 * rng.standard_normal((8, 3))
    theirs = pygem.RBF(controls, goal, func="gaussian_spline", radius=0.5)
    np.testing.assert_allclose(theirs(x), pygem_points(x, controls, goal, 0.5), atol=1e-10)


@pytest.mark.parametrize("name", SADDLES)
def test_kernels_that_need_it_have_it_and_cannot_be_without(name):
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=(Translate("BLOCK", (0.03, 0.02)),), kernel=name)
    (auto,), (yes,) = (sv.deform(case.change(polynomial=p), mesh) for p in ("auto", "yes"))
    assert auto.mesh.points.tobytes() == yes.mesh.points.tobytes()
    (message,) = contradictions(case.change(polynomial="no"))
    assert message.keys == ("POLYNOMIAL", "RBF_KERNEL")
    assert f"RBF_KERNEL= {name} needs the linear polynomial" in str(message)
    assert not contradictions(case.change(polynomial="no", kernel="gaussian"))


@pytest.mark.parametrize("reduction", [None, REDUCED])
@pytest.mark.parametrize("sliding", ["none", "ps", "ds"])
def test_nodes_beyond_all_supports_move(sliding, reduction):
    """Supports leave nodes between body and walls where they are; the polynomial moves them."""
    mesh = builders.square(12)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=(Translate("BLOCK", (0.03, 0.0)),), sliding=sliding)
    case = case.change(support_radius=0.12, reduction=reduction)
    (still,), (moving,) = (sv.deform(case.change(polynomial=p), mesh) for p in ("no", "yes"))
    inner = np.setdiff1d(
        np.arange(len(mesh.points)), np.concatenate([m.nodes for m in mesh.markers])
    )
    stays = inner[(still.mesh.points == mesh.points)[inner].all(axis=1)]
    assert len(stays)
    assert (moving.mesh.points[stays] != mesh.points[stays]).any(axis=1).all()
    block = mesh.marker("BLOCK").nodes
    np.testing.assert_allclose(moving.mesh.points[block, 0], mesh.points[block, 0] + 0.03)
