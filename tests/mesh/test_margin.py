"""Margins: no cell is folded before its margin, and those of exact types are right behind it."""

from __future__ import annotations

import numpy as np
import pytest

from slideviz.mesh.jacobians import VALID, coefficients
from slideviz.mesh.margin import BOUNDED, GAP, _write_bounds, first_root, least_margin, margins
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import INVERTED, quality
from slideviz.system.threads import PART, core_limit
from tests.mesh.test_jacobians import (
    HEX_NEGATIVE_INSIDE,
    HEX_TOO_CLOSE,
    HEX_VALID_WITH_NEGATIVE_COEFFICIENT,
    PRISM_NEGATIVE_INSIDE,
    PRISM_VALID_WITH_NEGATIVE_COEFFICIENT,
)
from tests.oracles import quality as oracle

CAP = 10.0
EXACT = (5, 9, 10, 14)


def random_cells(vtk, m, seed=0, flat=1.0, offset=0.0):
    """Ideal mesh, points and displacement of ``m`` separate cells, shaken, with random motions."""
    rng = np.random.default_rng(seed)
    ideal = np.array(oracle.IDEAL[vtk], float)
    squeeze = np.where(np.arange(ideal.shape[1]) == ideal.shape[1] - 1, flat, 1.0)
    shape = m, *ideal.shape
    points = (ideal + rng.uniform(-0.15, 0.15, shape)) * squeeze
    motion = rng.uniform(-1, 1, shape) * squeeze * rng.choice([0.01, 0.1, 1.0, 10.0], (m, 1, 1))
    motion += rng.uniform(-1, 1, (m, 1, ideal.shape[1]))  # as a whole
    points += rng.uniform(-offset, offset, (m, 1, ideal.shape[1]))
    nodes = np.arange(m * len(ideal)).reshape(m, -1)
    mesh = Mesh(np.tile(ideal, (m, 1)), Cells.from_blocks([(vtk, nodes)]))
    return mesh, points.reshape(len(mesh.points), -1), motion.reshape(len(mesh.points), -1)


def status_at(cells, points, motion, s):
    """Statuses (m,) of the cells of a mesh of separate cells, each at its own s (m,)."""
    moved = points + np.repeat(s, np.diff(cells.cells.offsets))[:, None] * motion
    return quality(cells.with_points(moved), cells).status


def require_right(vtk, m, **how):
    """Require that no cell is folded below its margin, and those of exact types are just above."""
    mesh, points, motion = random_cells(vtk, m, **how)
    found = margins(points, motion, mesh.cells, CAP)
    some = (found > 0) & (found < CAP)
    assert some.mean() > 0.2
    for part in (*np.linspace(0, 1, 12, endpoint=False), 1 - 1e-6, 1 - 1e-12):
        below = status_at(mesh, points, motion, found * part)
        assert (below[found > 0] == VALID).all(), part
    above = status_at(mesh, points, motion, found * (1 + 1e-4 if vtk in EXACT else 1 + 2 * GAP))
    assert (above[some] == INVERTED).mean() > (0.999 if vtk in EXACT else 0.99)


@pytest.mark.parametrize("vtk", oracle.IDEAL)
def test_no_cell_is_folded_below_its_margin_but_right_above(vtk):
    require_right(vtk, 2000)


@pytest.mark.parametrize("vtk", oracle.IDEAL)
def test_rounding_of_thin_cells_far_from_the_origin_makes_no_margin_too_large(vtk):
    require_right(vtk, 500, seed=1, flat=1e-4, offset=1e3)


@pytest.mark.slow
@pytest.mark.parametrize("vtk", oracle.IDEAL)
def test_margins_of_a_million_cells_by_brute_force(vtk):
    require_right(vtk, 170_000, seed=2)


def test_margin_of_a_triangle_is_that_of_the_formula():
    cells = Cells.from_blocks([(5, [[0, 1, 2]])])
    points, up = np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0.0, 0], [0, 0], [0, -0.4]])
    assert margins(points, up, cells, CAP) == pytest.approx([2.5], rel=1e-12)
    assert margins(points, -up, cells, CAP) == [CAP]
    assert margins(points, up, cells, 1.0) == [1.0]
    assert margins(points, 0 * up, cells, CAP) == [CAP]


def test_a_cell_that_is_not_valid_or_no_number_has_margin_zero():
    cells = Cells.from_blocks([(5, [[0, 2, 1]])])
    points, motion = np.array([[0.0, 0], [1, 0], [0, 1]]), np.ones((3, 2))
    assert margins(points, motion, cells, CAP) == [0.0]
    assert margins(points, motion, cells, CAP, np.array([-1], np.int8)) == [CAP]
    for wrong in (np.nan, np.inf):
        assert margins(points, np.where(points > 0, wrong, 0), cells, CAP) == [0.0]


@pytest.mark.parametrize(
    ("vtk", "cell", "valid"),
    [
        (12, HEX_NEGATIVE_INSIDE, False),
        (12, HEX_TOO_CLOSE, False),
        (12, HEX_VALID_WITH_NEGATIVE_COEFFICIENT, True),
        (13, PRISM_NEGATIVE_INSIDE, False),
        (13, PRISM_VALID_WITH_NEGATIVE_COEFFICIENT, True),
    ],
)
def test_cells_are_cut_where_the_coefficients_do_not_decide(vtk, cell, valid):
    points = np.array(oracle.IDEAL[vtk], float)
    cells = Cells.from_blocks([(vtk, [np.arange(len(points))])])
    found = margins(points, np.array(cell) / 20 - points, cells, CAP)
    assert (found > 1) == valid
    assert 0.2 < found[0] < CAP


def test_coefficients_alone_would_give_smaller_margins():
    mesh, points, motion = random_cells(12, 2000)
    found = margins(points, motion, mesh.cells, CAP)
    moved = points + np.repeat(found, 8)[:, None] * motion
    least = coefficients(12, moved.reshape(-1, 8, 3).T).min(axis=0)
    assert ((least < -1e-3) & (found < CAP)).sum() > 100


def test_the_bits_depend_neither_on_threads_nor_on_other_cells():
    mesh, points, motion = random_cells(13, PART + 70)
    found = margins(points, motion, mesh.cells, CAP)
    with core_limit(1):
        assert np.array_equal(margins(points, motion, mesh.cells, CAP), found)
    ids = np.arange(5, PART + 70, 3)
    assert np.array_equal(margins(points, motion, mesh.cells.take(ids), CAP), found[ids])


@pytest.mark.parametrize("vtk", oracle.IDEAL)
@pytest.mark.parametrize("scale", [1e-3, 0.1, 1.0])
@pytest.mark.parametrize(("flat", "offset"), [(1.0, 0.0), (1e-4, 1e3)])
def test_the_least_margin_is_that_of_all_cells_to_the_bit(vtk, scale, flat, offset):
    mesh, points, motion = random_cells(vtk, 500, seed=3, flat=flat, offset=offset)
    before = mesh.with_points(points)
    after = mesh.with_points(points + scale * motion)
    signs = np.ones(500, np.int8)
    for some in (np.arange(500), np.arange(0, 500, 50), np.arange(7)):
        cells = mesh.cells.take(some)
        one, other = (Mesh(each.points, cells) for each in (before, after))
        found = margins(before.points, after.points - before.points, cells, CAP, signs[some])
        valid = found > 0
        for keep in (slice(None), valid):
            left = found[keep]
            if not len(left):
                continue
            part = [
                Mesh(each.points, cells.take(np.arange(len(some))[keep])) for each in (one, other)
            ]
            expected = (left.min(), left.argmin()) if left.min() < CAP else (CAP, 0)
            assert least_margin(*part, CAP, signs[some][keep]) == expected


def test_a_bound_never_exceeds_the_margin_of_a_cell():
    mesh, points, motion = random_cells(12, 20_000, seed=4)
    after, levels = points + 0.02 * motion, np.empty(20_000, np.int8)
    nodes, turn = mesh.cells.by_type[12][1], np.ones(20_000, np.int8)
    far = np.array([np.abs(points).max(), np.abs(after - points).max()])
    _write_bounds(points, after, nodes, turn, far, CAP * BOUNDED, levels)
    found = margins(points, after - points, mesh.cells, CAP)
    assert (found >= np.append(0.0, CAP * BOUNDED)[levels]).all()
    assert (np.bincount(levels, minlength=5) > 100).all()  # neither all nor none are bounded


@pytest.mark.parametrize(
    ("coefficients", "root"),
    [
        ((1.0, -1.0, 0.0, 0.0), 1.0),
        ((1.0, 0.0, -4.0, 0.0), 0.5),
        ((1.0, 0.0, 0.0, -8.0), 0.5),
        ((6.0, -11.0, 6.0, -1.0), 1.0),  # roots 1, 2, 3
        ((1.0, -2.0, 0.999999, 0.0), 0.999001),  # two roots that are close together
        ((1.0, -2.0, 1.000001, 0.0), 10.0),  # none, by little
        ((1.0, 1.0, 1.0, 1.0), 10.0),
        ((0.0, 1.0, 0.0, 0.0), 0.0),
        ((1.0, 1e-300, -1e-320, 1e-320), 10.0),
    ],
)
def test_the_first_root_is_found_from_below(coefficients, root):
    found = first_root(*coefficients, 10.0)
    assert found == pytest.approx(root, rel=1e-6)
    assert root == 0 or np.polynomial.polynomial.polyval(found, coefficients) > 0
