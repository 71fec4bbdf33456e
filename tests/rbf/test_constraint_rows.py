"""Systems that fall apart into blocks, and factors that grow: the same results with less work."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.rbf import exact, level
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.evaluate import Basis, matrix
from slideviz.rbf.exact import ExactFit
from slideviz.rbf.greedy import GreedyFit
from slideviz.rbf.level import GrowingFactor, newton
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.solve import NOTHING, extend, factorise
from slideviz.samples.table import write_sample
from tests import builders
from tests.slow import one_of_each_fast


def rows_along(*normals):
    normals = np.array(normals, float)
    return ConstraintRows(np.arange(len(normals)), normals, np.zeros((len(normals), 1)))


def test_rows_along_axes_are_in_blocks_of_their_own():
    found = blocks(rows_along([1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]))
    assert found[0] == found[3] != found[1] == found[4]
    assert len(set(found)) == 3


def test_a_wall_aslant_ties_its_two_axes_together():
    found = blocks(rows_along([1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]))
    assert found[0] == found[1] == found[3] != found[2]


def test_an_edge_of_slanted_walls_ties_all_axes():
    found = blocks(rows_along([1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0], [0, 0.6, 0.8]))
    assert set(found) == {0}


def test_rounding_ties_nothing():
    found = blocks(rows_along([1, 0], [0, 1], [1, 1e-14]))
    assert found[0] == found[2] != found[1]
    assert len(set(blocks(rows_along([1, 0], [0, 1], [1, 1e-6])))) == 1


def test_rows_without_directions_are_one_block():
    assert set(blocks(ConstraintRows(np.arange(4), None, np.zeros((4, 3))))) == {0}


def counted(monkeypatch, together):
    """Record the numbers of blocks; ``together`` keeps all rows in one."""
    seen = []

    def instead(rows):
        found = blocks(rows)
        seen.append(len(set(found)))
        return np.zeros_like(found) if together else found

    monkeypatch.setattr(level, "blocks", instead)
    monkeypatch.setattr(exact, "blocks", instead)
    return seen


@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-4)])
@pytest.mark.parametrize(
    ("name", "periodic"),
    one_of_each_fast(
        ["square", "polar", "hexahedron", "cylindrical"], ["none", "periodic", "fixed", "moving"]
    ),
)
def test_blocks_change_no_result(tmp_path, monkeypatch, name, periodic, reduction):
    write_sample(name, tmp_path, 12 if name in ("square", "polar") else 9)
    mesh = sv.read(tmp_path / "mesh.su2")
    case = Case.read(tmp_path / f"{name}.cfg").change(
        sliding="ds", periodic=periodic, steps=2, reduction=reduction
    )
    seen = counted(monkeypatch, together=False)
    apart = list(sv.deform(case, mesh))
    assert mesh.dim in seen
    counted(monkeypatch, together=True)
    for one, other in zip(apart, sv.deform(case, mesh), strict=True):
        np.testing.assert_allclose(one.mesh.points, other.mesh.points, atol=1e-12)
        assert one.control_nodes == other.control_nodes
        # An estimate from below, with random vectors: better for the smaller systems.
        assert 0.5 < one.condition / other.condition < 5


@pytest.mark.parametrize("kernel", ["wendland-c2", "thin-plate"])
@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-3)], ids=["exact", "reduced"])
@pytest.mark.parametrize("angle_deg", [0.0, 20.0], ids=["blocks", "slanted"])
def test_the_condition_number_is_that_of_the_dense_system(
    monkeypatch, angle_deg, reduction, kernel
):
    """With all rows of direct sliding, and the polynomial; an estimate is a lower bound."""
    mesh = builders.square(6)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    mesh = mesh.with_points(mesh.points @ np.array([[c, s], [-s, c]]))
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    motion = (Translate("BLOCK", (0.05, 0.02)),)
    case = Case(roles=roles, motions=motion, sliding="ds", reduction=reduction, kernel=kernel)
    dense: list[float] = []

    def seen(fit):
        problem, rows = fit._problem, fit._rows if reduction is None else fit._among.rows
        chosen = slice(None) if reduction is None else fit._level.chosen
        features, normals = problem.features[:, rows.nodes[chosen]], rows.normals[chosen]
        system = matrix(problem.basis, (features, normals))
        if kernel == "thin-plate":
            terms = [[1.0, *x] for x in features[:2].T]
            tail = np.stack([np.outer(t, n).ravel() for t, n in zip(terms, normals, strict=True)])
            system = np.block([[system, tail], [tail.T, np.zeros((6, 6))]])
        dense.append(np.linalg.cond(system, 1))
        return ask(fit)

    fit = ExactFit if reduction is None else GreedyFit
    ask = fit.condition
    monkeypatch.setattr(fit, "condition", seen)
    (step,) = sv.deform(case, mesh)
    assert dense
    assert 0.7 * dense[-1] < step.condition < 1.001 * dense[-1]


def test_slanted_walls_are_solved_together(tmp_path, monkeypatch):
    """The square turned by 30 degrees gives the turned result, in one block."""
    write_sample("square", tmp_path, 12, "motion")
    mesh = sv.read(tmp_path / "mesh.su2")
    case = Case.read(tmp_path / "square.cfg").change(
        sliding="ds", periodic="none", steps=1, reduction=Reduction(tolerance=1e-5), motions=()
    )
    turn = np.array([[np.sqrt(0.75), 0.5], [-0.5, np.sqrt(0.75)]])
    turned = mesh.with_points(mesh.points @ turn)
    shift = np.array([-0.05, 0.03])
    case = case.change(influence_factor=2.5)
    plain = case.change(motions=(Translate("BLOCK", tuple(shift)),))
    aslant = case.change(
        motions=(Translate("BLOCK", tuple(shift @ turn)),),
        influence_factor=2.5 * mesh.extent / turned.extent,
    )
    seen = counted(monkeypatch, together=False)
    *_, one = sv.deform(plain, mesh)
    assert seen == [2]
    seen = counted(monkeypatch, together=False)
    *_, other = sv.deform(aslant, turned)
    assert seen == [1]
    np.testing.assert_allclose(other.mesh.points, one.mesh.points @ turn, atol=3e-5)


@settings(max_examples=30, deadline=None)
@given(
    n=st.integers(0, 30),
    m=st.integers(1, 30),
    coincident_pairs=st.integers(0, 3),
    seed=st.integers(0, 5),
)
def test_a_factor_that_grows_is_the_factor_of_all(n, m, coincident_pairs, seed):
    x = np.random.default_rng(seed).uniform(size=(n + m, 3))
    if n > coincident_pairs:
        x[n : n + coincident_pairs] = x[:coincident_pairs][: len(x[n : n + coincident_pairs])]
    full = matrix(Basis(2.5), (np.ascontiguousarray(x.T), None))
    first = extend(NOTHING, full[:n, :n])
    grown, whole = extend(first, full[n:]), factorise(full)
    np.testing.assert_array_equal(grown.retained, whole.retained)
    np.testing.assert_array_equal(grown.dropped, whole.dropped)
    np.testing.assert_allclose(grown.lower, whole.lower, atol=1e-9)
    np.testing.assert_array_equal(np.triu(grown.lower, 1), 0.0)


def test_rows_left_out_before_stay_out():
    x = np.random.default_rng(3).uniform(size=(12, 3))
    x[4], x[9] = x[1], x[2]
    full = matrix(Basis(2.5), (np.ascontiguousarray(x.T), None))
    grown = extend(extend(NOTHING, full[:6, :6]), full[6:])
    np.testing.assert_array_equal(grown.dropped, [4, 9])
    np.testing.assert_array_equal(grown.retained, [0, 1, 2, 3, 5, 6, 7, 8, 10, 11])
    part = full[np.ix_(grown.retained, grown.retained)]
    np.testing.assert_allclose(grown.lower @ grown.lower.T, part, atol=1e-12)


def test_the_newton_greedy_factorises_what_it_picks():
    rng = np.random.default_rng(1)
    x = rng.uniform(size=(2, 3, 9))
    systems = [matrix(Basis(2.5), (block, None)) for block in x]
    residual = rng.normal(size=(18, 1))
    candidate = np.tile(np.arange(9), 2)
    picked, bases = newton(
        systems, residual, nodes=candidate, factor=np.ones(len(candidate)), count=4, floor=0.0
    )
    assert len(picked) == 8
    assert sorted(candidate[picked[:2]]) == [candidate[picked[0]]] * 2
    errors = np.hypot(*residual.reshape(2, 9))
    assert candidate[picked[0]] == np.argmax(errors)
    for k, (system, basis) in enumerate(zip(systems, bases, strict=True)):
        mine = picked[(picked >= 9 * k) & (picked < 9 * k + 9)] - 9 * k
        factor = GrowingFactor(1)
        factor.append(mine, np.arange(4), beside=np.empty((4, 0)), corner=basis[mine])
        factor.follow(residual[9 * k : 9 * k + 9])
        part = system[np.ix_(mine, mine)]
        np.testing.assert_allclose(factor.lower @ factor.lower.T, part, atol=1e-12)
        np.testing.assert_allclose(
            part @ factor.weights(), residual[9 * k : 9 * k + 9][mine], atol=1e-9
        )
