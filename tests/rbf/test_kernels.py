"""The fourteen radial functions: definitions, compiled loops, polynomials, whole runs."""

import re

import numpy as np
import pytest
from scipy.sparse.linalg import onenormest

import slideviz as sv
from slideviz import terms
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate
from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.field import linear_terms
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.solve import _norm, condition, saddle_condition, solve_saddle
from slideviz.samples.table import sample, write_sample
from tests import builders
from tests.oracles.kernels import KERNELS
from tests.slow import one_of_each_fast

COMPACT = [name for name, kernel in KERNELS.items() if kernel.compact]
TAILED = [name for name, kernel in KERNELS.items() if kernel.polynomial]
USABLE = [name for name in KERNELS if name not in ("quadric", "gaussian", "inverse-quadric")]


def test_there_are_fourteen():
    assert len(KERNELS) == 14
    assert list(KERNELS) == list(terms.KERNELS)
    assert set(TAILED) == {"thin-plate", "multiquadric", "quadric"}


@pytest.mark.parametrize("name", COMPACT)
def test_compact_ones_fall_from_one_to_zero(name):
    kernel = KERNELS[name]
    assert kernel(np.array([0.0])) == pytest.approx(1.0)
    assert kernel.function(np.array([1.0])) == pytest.approx(0.0, abs=1e-14)
    assert np.all(kernel(np.array([1.0, 1.5, 9.0])) == 0)
    inside = kernel(np.linspace(0.0, 1.0, 200))
    assert np.all(np.diff(inside) <= 1e-12)


def test_cp_c4_has_no_kink():
    """With 36/3 instead of 35/3, as the thesis prints, the second difference would jump at 0."""
    h = 1e-3
    value = KERNELS["wendland-c4"](np.array([0.0, h, 2 * h]))
    slope = np.diff(value) / h
    assert abs(slope[0]) < 0.05
    assert KERNELS["wendland-c4"](np.array([0.5])) == pytest.approx(0.5**6 * (35 / 12 + 3 + 1))


@pytest.mark.parametrize("name", list(KERNELS))
@pytest.mark.parametrize("period", [0.0, 0.6])
def test_compiled_loops_are_the_definition(name, period):
    rng = np.random.default_rng(3)
    if period:

        def features(n):
            half = np.pi / period * rng.uniform(-0.3, 0.3, n)
            return np.stack([rng.uniform(0.5, 1, n), np.sin(half), np.cos(half), rng.random(n)])
    else:

        def features(n):
            return rng.random((3, n))

    x, c = features(40), features(300)
    w = rng.standard_normal((300, 3))
    if period:
        g = period / np.pi * (x[1][:, None] * c[2] - x[2][:, None] * c[1])
        r, rc = x[0][:, None], c[0][None]
        squared = r**2 + rc**2 - 2 * r * rc * np.cos(g) + (x[3][:, None] - c[3]) ** 2
    else:
        squared = ((x[:, :, None] - c[:, None]) ** 2).sum(axis=0)
    expected = KERNELS[name](np.sqrt(np.maximum(squared, 0)) / 0.9)
    basis = Basis(0.9, period, name)
    np.testing.assert_allclose(matrix(basis, (x, None), (c, None)), expected, atol=1e-10)
    np.testing.assert_allclose(evaluate(basis, x, c, w), expected @ w, atol=1e-9)


@pytest.mark.parametrize("name", [n for n in USABLE if n not in TAILED])
def test_positive_definite_ones_are_so(name):
    x = np.random.default_rng(0).random((3, 120))
    assert np.linalg.eigvalsh(matrix(Basis(0.8, 0.0, name), (x, None)))[0] > 0


@pytest.mark.parametrize("name", ["thin-plate", "multiquadric"])
def test_a_linear_displacement_is_reproduced_everywhere(name):
    """What the polynomial is for."""
    rng = np.random.default_rng(1)
    x, y = rng.random((3, 60)), rng.random((3, 30)) * 2
    a, b = rng.standard_normal((3, 3)), rng.standard_normal(3)
    basis = Basis(0.8, 0.0, name)
    found = solve_saddle(matrix(basis, (x, None)), linear_terms(basis, x), x.T @ a + b)
    s = evaluate(basis, y, x, found.weights) + linear_terms(basis, y) @ found.tail
    assert not found.rank_deficient
    np.testing.assert_allclose(s, y.T @ a + b, atol=1e-8)


def test_nodes_in_a_plane_leave_a_term_out():
    rng = np.random.default_rng(2)
    x = np.concatenate([rng.random((2, 50)), np.full((1, 50), 0.7)])
    basis, right = Basis(1.0, 0.0, "thin-plate"), rng.standard_normal((50, 2))
    found = solve_saddle(matrix(basis, (x, None)), linear_terms(basis, x), right)
    s = evaluate(basis, x, x, found.weights) + linear_terms(basis, x) @ found.tail
    np.testing.assert_allclose(s, right, atol=1e-9)
    assert np.count_nonzero(found.tail[:, 0]) == 3


def test_the_quadric_is_told_to_be_singular():
    rng = np.random.default_rng(4)
    x = rng.random((2, 30))
    basis = Basis(1.0, 0.0, "quadric")
    found = solve_saddle(
        matrix(basis, (x, None)), linear_terms(basis, x), rng.standard_normal((30, 2))
    )
    assert found.rank_deficient


def test_a_run_counts_the_nodes_that_carry_a_weight():
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "fixed") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=(Rotate("BLOCK", 3.0),))
    (step,) = sv.deform(case.change(kernel="gaussian", influence_factor=20.0), mesh)
    assert len(step.control) == step.control_nodes < step.candidates
    left_out = step.candidates - step.control_nodes
    assert any(f"{left_out} boundary nodes are left out" in text for text in step.warnings)
    (step,) = sv.deform(case.change(kernel="quadric"), mesh)
    assert step.control_nodes == step.candidates
    said = "singular for RBF_KERNEL= quadric, so the .* control nodes are fitted by least squares"
    assert any(re.search(said, text) for text in step.warnings)


@pytest.mark.parametrize("seed", range(4))
def test_the_norm_is_that_of_scipy(seed):
    whole = np.random.default_rng(seed).standard_normal((40, 40))
    whole += whole.T
    assert _norm(lambda x: whole @ x, 40) == onenormest(whole, t=1)


def test_condition_is_that_of_numpy():
    x = np.random.default_rng(5).random((2, 80))
    system = matrix(Basis(1.0), (x, None))
    expected = np.linalg.cond(system, 1)
    assert condition(np.linalg.cholesky(system)) == pytest.approx(expected, rel=0.5)
    small = system[:3, :3]
    assert condition(np.linalg.cholesky(small)) == pytest.approx(np.linalg.cond(small, 1))
    terms = linear_terms(Basis(1.0), x)
    assert saddle_condition(system, terms) >= expected * 1e-3


@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-4)])
@pytest.mark.parametrize(("name", "sliding"), one_of_each_fast(USABLE, ["none", "ps", "ds"]))
def test_every_function_moves_the_block(tmp_path, name, sliding, reduction):
    write_sample("square", tmp_path, 9)
    mesh = sv.read(tmp_path / "mesh.su2")
    factor = 2.5 if KERNELS[name].compact else 0.5
    case = sv.Case.read(tmp_path / "square.cfg").change(
        kernel=name,
        sliding=sliding,
        reduction=reduction,
        steps=1,
        periodic="periodic",
        influence_factor=factor,
    )
    (step,) = sv.deform(case, mesh)
    found = sample("square", 9).displacement
    moved = step.mesh.points[found.nodes] - mesh.points[found.nodes]
    np.testing.assert_allclose(moved, found.vectors, atol=1e-12)
    left = mesh.marker("LEFT").nodes
    np.testing.assert_allclose(step.mesh.points[left, 0], 0.0, atol=1e-12)
    assert step.max_error <= (1e-9 if reduction is None else 1e-4)
    assert np.isfinite(step.condition)
    assert step.condition >= 1
