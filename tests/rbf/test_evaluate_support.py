"""Sums of compact radial functions where few of the targets are in a support, and small systems."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import DeformError
from slideviz.rbf import evaluate as module
from slideviz.rbf.evaluate import Basis, connected, evaluate, reached
from slideviz.rbf.problem import Problem
from slideviz.solver import deform as solver
from slideviz.solver.deform import _systems
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from tests.builders import airfoil, far_field, sphere_in_box
from tests.oracles.kernels import KERNELS

COMPACT = [name for name, kernel in KERNELS.items() if kernel.compact]


def features(rng, count, rows, period):
    """Return random features in a region ten supports wide."""
    x = rng.uniform(0.0, 10.0, (rows, count))
    if period:
        phase = rng.uniform(-np.pi / 2, np.pi / 2, count)
        x[1], x[2] = np.sin(phase), np.cos(phase)
    return x


@pytest.mark.parametrize(("rows", "period"), [(2, 0.0), (3, 0.0), (4, 0.0), (4, 0.5)])
@pytest.mark.parametrize("kernel", COMPACT)
def test_targets_outside_all_supports_cost_nothing_and_change_no_bit(
    kernel, rows, period, monkeypatch
):
    rng = np.random.default_rng(3)
    basis = Basis(1.0, period, kernel)
    targets, controls = features(rng, 4000, rows, period), features(rng, 7, rows, period)
    weights = rng.normal(size=(7, 2))
    near = reached(basis, targets, controls, weights)
    assert 0 < len(near) < 3000
    sparse = evaluate(basis, targets, controls, weights)
    monkeypatch.setattr(module, "reached", lambda *_: None)
    dense = evaluate(basis, targets, controls, weights)
    assert sparse.tobytes() == dense.tobytes()
    assert not dense[np.setdiff1d(np.arange(4000), near)].any()


def test_controls_without_weight_reach_nothing():
    rng = np.random.default_rng(1)
    basis, x, c = Basis(1.0), rng.uniform(0, 10, (2, 900)), np.array([[2.0, 8.0], [2.0, 8.0]])
    weights = np.array([[1.0, 0.0], [0.0, 0.0]])
    near = reached(basis, x, c, weights)
    assert (np.linalg.norm(x[:, near].T - 2.0, axis=1) < 1.0 + 1e-6).all()
    assert np.isin(np.flatnonzero(np.linalg.norm(x.T - 2.0, axis=1) < 1.0), near).all()


def test_connected_parts_are_those_of_a_graph_of_all_pairs():
    rng = np.random.default_rng(2)
    x = np.concatenate([c + rng.uniform(0, 2, (2, 30)) for c in (0.0, 3.4, 9.0)], axis=1)
    label = connected(Basis(1.0), x)
    gap = np.linalg.norm(x[:, :, None] - x[:, None], axis=0)
    assert (label[:, None] == label)[gap < 1.0].all()
    assert label[0] != label[-1]
    assert len(np.unique(connected(Basis(100.0), x))) == 1
    assert not connected(Basis(0.1, kernel="gaussian"), x).any()


def all_together(problem):
    """Return labels of boundary nodes as if one support connected all."""
    return np.zeros(problem.features.shape[1], np.int64), np.ones(1, bool)


def turned(mesh, marker, **values):
    """Return the case that turns a body by 20 degrees, and its last step."""
    case = sv.Case(roles={marker: "moving"}, motions=(sv.Rotate(marker, 20.0),), **values)
    *_, last = sv.deform(case, mesh)
    return case, last


@pytest.mark.parametrize("kernel", ["wendland-c2", "ctps-c1"])
@pytest.mark.parametrize("sliding", ["none", "ps", "ds"])
def test_a_far_field_out_of_reach_is_in_no_system_and_keeps_its_bits(sliding, kernel, monkeypatch):
    mesh = far_field(60.0)
    case, _ = turned(mesh, "body", kernel=kernel)
    case = case.change(sliding=sliding, roles={"body": "moving", "far": "sliding"})
    *_, last = sv.deform(case, mesh)
    body, far = mesh.marker("body").nodes, mesh.marker("far").nodes
    assert set(last.control) == set(body)
    gap = np.linalg.norm(mesh.points[:, None] - mesh.points[body], axis=2).min(axis=1)
    outside = gap > last.support_radius
    assert 20 < outside.sum() < len(gap) - len(body)
    assert last.mesh.points[outside].tobytes() == mesh.points[outside].tobytes()
    assert last.mesh.points[far].tobytes() == mesh.points[far].tobytes()
    assert (last.mesh.points[~outside] != mesh.points[~outside]).any(axis=1).mean() > 0.9
    # The memory that a run may take is that of the body's system; a deformer keeps all rows.
    setup = make_setup(prepare(case, mesh))
    assert max(_systems(setup, case, lasting=False)) == len(body)
    monkeypatch.setattr(solver, "free_memory", lambda: 30.0 * len(body) ** 2)
    with pytest.raises(DeformError, match="GB are free"):
        sv.Deformer(mesh, case)
    monkeypatch.setattr(solver, "free_memory", lambda: np.inf)
    # With the far field in the system the result is the same.
    monkeypatch.setattr(Problem, "reach", property(all_together))
    *_, whole = sv.deform(case, mesh)
    np.testing.assert_allclose(whole.mesh.points, last.mesh.points, atol=1e-12)
    assert len(whole.control) > len(body)


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_a_round_far_field_that_slides_keeps_its_bits(sliding):
    mesh = airfoil()
    case = sv.Case(
        roles={"airfoil": "moving", "far": "sliding"},
        motions=(sv.Rotate("airfoil", 5.0),),
        sliding=sliding,
        steps=2,
        support_radius=1.2,
    )
    *_, last = sv.deform(case, mesh)
    far = mesh.marker("far").nodes
    assert last.mesh.points[far].tobytes() == mesh.points[far].tobytes()
    assert set(last.control) == set(mesh.marker("airfoil").nodes)


def test_a_sphere_far_from_its_box_keeps_the_nodes_between():
    mesh = sphere_in_box(4, 6)
    far = mesh.with_points(mesh.points * np.where(np.abs(mesh.points) > 0.99, 30.0, 1.0))
    _, last = turned(far, "sphere")
    assert last.support_radius == 15 * np.ptp(far.points[far.marker("sphere").nodes][:, 0])
    assert last.control_nodes == len(far.marker("sphere").nodes)


def test_a_deformer_moves_a_body_that_stays_at_its_reference():
    """All boundary nodes are in its systems, though supports connect them with nothing there."""
    mesh = far_field(60.0, bodies=2)
    far = np.abs(mesh.points[:, 0] - 4.0) > 20
    roles = {"body": "moving", "other": "moving"}
    one = sv.Case(
        roles=roles,
        motions=(sv.Rotate("body", 5.0), sv.Translate("other", (0.0, 0.0))),
        support_radius=1.5,
    )
    two = one.change(motions=(sv.Rotate("body", -3.0), sv.Translate("other", (0.02, 0.1))))
    deformer = sv.Deformer(mesh, one)
    assert deformer.as_run().tobytes() == list(sv.deform(one, mesh))[-1].mesh.points.tobytes()
    np.testing.assert_allclose(deformer.deform(), deformer.as_run(), atol=1e-13)
    moved = sv.Deformer(mesh, two).displacement
    expected = list(sv.deform(two, mesh))[-1].mesh.points
    np.testing.assert_allclose(deformer.deform(moved), expected, atol=1e-12)
    both = deformer.deform(np.stack([deformer.displacement, moved]))
    np.testing.assert_allclose(both[1], expected, atol=1e-12)
    assert both[1][far].tobytes() == mesh.points[far].tobytes()
    # Exact derivatives, with the support radius of the reference.
    way = np.random.default_rng(0).normal(size=moved.shape)
    step = 1e-6
    slope = (deformer.deform(moved + step * way) - deformer.deform(moved - step * way)) / 2 / step
    np.testing.assert_allclose(deformer.jvp(moved, way), slope, atol=1e-8)
    weights = np.random.default_rng(1).normal(size=mesh.points.shape)
    along = (weights * deformer.jvp(moved, way)).sum()
    assert (way * deformer.vjp(moved, weights)).sum() == pytest.approx(along, rel=1e-12)


def test_a_motion_below_the_tolerance_needs_no_control_node_whatever_the_kernel():
    for kernel in ("thin-plate", "wendland-c2"):
        mesh, least = far_field(60.0), sv.Reduction(tolerance=1.0)
        case = sv.Case(
            roles={"body": "moving"},
            motions=(sv.Translate("body", (0.01, 0.0)),),
            kernel=kernel,
            reduction=least,
        )
        *_, last = sv.deform(case, mesh)
        assert (last.control_nodes, last.condition) == (0, 1.0)
