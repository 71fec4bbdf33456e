"""Derivatives of the smooth minimum and of the mean quality: differences, laws, inverted cells."""

from __future__ import annotations

import numpy as np
import pytest

from slideviz.errors import CaseError, MeshError
from slideviz.formats.files import read
from slideviz.mesh import jacobian_slopes, quality_derivative
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import INVERTED, quality
from slideviz.mesh.skew import EXPONENTS, SKEW_METRICS
from slideviz.system import threads
from tests.builders import grid, halo_text
from tests.oracles import quality as oracle

TYPES = (5, 9, 10, 12, 13, 14)
CASES = [(vtk, "knupp") for vtk in TYPES] + [(12, "rbf-slide")]


def soup(vtk, cells):
    """Mesh of cells that share no node, from coordinates (m, n, d)."""
    cells = np.asarray(cells, float)
    m, n, d = cells.shape
    nodes = np.arange(m * n).reshape(m, n)
    return Mesh(cells.reshape(-1, d), Cells.from_blocks([(vtk, nodes)]), name="soup")


def shaken(vtk, m, amount, seed=0):
    rng = np.random.default_rng(seed)
    ideal = np.array(oracle.IDEAL[vtk])
    return ideal + rng.uniform(-amount, amount, (m, *ideal.shape))


def slope_of(mesh, reference=None, **options):
    return quality(mesh, reference, derivative=True, **options).derivative


def smooth(values, p):
    return (np.asarray(values, float) ** -p).sum() ** (-1 / p)


def shaken_mesh(kind, dim, amount=0.12, seed=0):
    """Return a mesh whose cells share nodes, moved at random, and the unmoved one."""
    mesh = grid((4, 4) if dim == 2 else (3, 3, 3), kind=kind)
    rng = np.random.default_rng(seed)
    step = 1 / 4 if dim == 2 else 1 / 3
    return mesh.with_points(
        mesh.points + rng.uniform(-1, 1, mesh.points.shape) * amount * step
    ), mesh


@pytest.mark.parametrize("compared", [True, False], ids=["size", "skew"])
@pytest.mark.parametrize(("vtk", "metric"), CASES)
def test_each_type_agrees_with_differences_of_the_literal_formulas(vtk, metric, compared):
    p, h, count = 6.0, 1e-6, 3
    cells, before = shaken(vtk, count, 0.12), shaken(vtk, count, 0.1, seed=1)
    before[1] *= 0.7  # some cells larger than before, some smaller
    before[2] *= 1.3
    reference = soup(vtk, before) if compared else None
    found = slope_of(soup(vtk, cells), reference, metric=metric, p=p)

    def literal(moved):
        part = 0 if compared else 2
        return [
            oracle.size_skew(vtk, now, old, metric)[part]
            for now, old in zip(moved, before, strict=True)
        ]

    assert found.minimum == pytest.approx(smooth(literal(cells), p), rel=1e-12)
    assert found.mean == pytest.approx(np.mean(literal(cells)), rel=1e-12)
    wanted = np.empty((2, *cells.shape))
    for place in np.ndindex(cells.shape):
        pair = []
        for sign in (1, -1):
            moved = cells.copy()
            moved[place] += sign * h
            values = literal(moved)
            pair.append((smooth(values, p), np.mean(values)))
        wanted[(slice(None), *place)] = np.subtract(*pair) / (2 * h)
    for mine, expected in zip((found.of_minimum, found.of_mean), wanted, strict=True):
        flat = expected.reshape(mine.shape)
        assert np.abs(flat).max() > 1e-3
        np.testing.assert_allclose(mine, flat, rtol=0, atol=1e-8 * np.abs(flat).max() + 1e-9)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kind", ["plain", "simplex", "prism", "mixed"])
def test_meshes_agree_with_differences_along_a_direction(kind, dim):
    moved, mesh = shaken_mesh(kind, dim)
    found = slope_of(moved, mesh)
    direction = np.random.default_rng(5).normal(size=mesh.points.shape)
    h = 1e-6
    ends = [quality(moved.with_points(moved.points + s * h * direction), mesh) for s in (1, -1)]
    assert found.mean == quality(moved, mesh).mean
    for mine, of in (
        (found.of_mean, lambda q: q.mean),
        (found.of_minimum, lambda q: smooth(q.values, 50)),
    ):
        difference = (of(ends[0]) - of(ends[1])) / (2 * h)
        assert (mine * direction).sum() == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize("vtk", TYPES)
def test_the_exponents_are_those_of_the_formulas(vtk):
    rng = np.random.default_rng(0)
    corners = len(ELEMENTS[vtk].corners)
    spread, alpha = rng.uniform(1, 3, (2, corners, 5))
    for metric, rows in SKEW_METRICS.items():
        a, b = EXPONENTS[metric][vtk]
        ideal = rows[vtk](np.ones((corners, 1)), np.ones((corners, 1))) * corners
        literal = ideal / (spread**a / alpha**b).sum(axis=0)
        np.testing.assert_allclose(rows[vtk](spread, alpha), literal, rtol=1e-13)
    assert EXPONENTS.keys() == SKEW_METRICS.keys()


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("vtk", TYPES)
def test_moving_and_turning_all_points_changes_nothing(vtk, folded):
    cells = shaken(vtk, 20, 0.6 if folded else 0.1)
    mesh, before = soup(vtk, cells), soup(vtk, shaken(vtk, 20, 0.05, seed=1))
    assert bool(quality(mesh, before).inverted) == folded
    found = slope_of(mesh, before)
    for slope in (found.of_minimum, found.of_mean):
        size = np.abs(slope).sum()
        assert size > 0
        np.testing.assert_allclose(slope.sum(axis=0), 0, atol=1e-13 * size)
        torque = mesh.points.T @ slope
        np.testing.assert_allclose(torque, torque.T, atol=1e-12 * size)


@pytest.mark.parametrize("vtk", TYPES)
def test_skew_alone_does_not_feel_a_change_of_scale(vtk):
    mesh = soup(vtk, shaken(vtk, 20, 0.1))
    found = slope_of(mesh)
    for slope in (found.of_minimum, found.of_mean):
        assert (slope * mesh.points).sum() == pytest.approx(0, abs=1e-12 * np.abs(slope).sum())


@pytest.mark.parametrize("vtk", TYPES)
def test_the_undeformed_mesh_is_at_the_kink_of_size_and_takes_the_mean_of_both_sides(vtk):
    mesh = soup(vtk, shaken(vtk, 20, 0.1))
    same, alone = slope_of(mesh, mesh), slope_of(mesh)
    np.testing.assert_array_equal(same.of_minimum, alone.of_minimum)
    np.testing.assert_array_equal(same.of_mean, alone.of_mean)
    # √size falls on either side, as fast: the mean of both is 0.
    for factor, sign in ((1 + 1e-9, -1), (1 - 1e-9, 1)):
        moved = mesh.with_points(mesh.points * factor)
        change = (slope_of(moved, mesh).of_mean * mesh.points).sum()
        assert change == pytest.approx(sign * mesh.dim / 2 * same.mean, rel=1e-6)


@pytest.mark.parametrize("p", [1.0, 8.0, 50.0, 300.0])
def test_the_smooth_minimum_is_a_lower_bound_that_p_makes_tight(p):
    moved, mesh = shaken_mesh("plain", 2, 0.3)
    found = quality(moved, mesh, derivative=True, p=p)
    assert found.inverted == 0
    slope = found.derivative
    assert slope.p == p
    assert slope.minimum == pytest.approx(smooth(found.values, p), rel=1e-12)
    assert len(found) ** (-1 / p) * found.min <= slope.minimum <= found.min


def test_an_undeformed_square_has_the_bound_of_its_cells_and_no_slope():
    mesh = grid((4, 4))
    slope = slope_of(mesh, mesh)
    assert slope.minimum == pytest.approx(16 ** (-1 / 50), rel=1e-12)
    np.testing.assert_allclose(slope.of_minimum, 0, atol=1e-12)
    np.testing.assert_allclose(slope.of_mean, 0, atol=1e-12)


# Inverted cells ------------------------------------------------------------------------------


@pytest.mark.parametrize("p", [1.0, 2.0, 50.0])
@pytest.mark.parametrize("vtk", TYPES)
def test_inverted_cells_have_the_literal_depth_and_its_slope(vtk, p):
    cells, before = shaken(vtk, 12, 0.6), shaken(vtk, 12, 0.05, seed=1)
    mesh, reference = soup(vtk, cells), soup(vtk, before)
    status = quality(mesh, reference).status

    def literal(cells):
        depths = []
        for now, old in zip(cells, before, strict=True):
            scale = np.mean(oracle.jacobians(vtk, old))
            found = np.array(oracle.jacobians(vtk, now)) / scale
            depths.extend(-found[found <= 0])
        return -((np.array(depths) ** p).sum() ** (1 / p))

    outer = [min(oracle.jacobians(vtk, now)) <= 0 for now in cells]
    inner = (status == INVERTED) & ~np.array(outer)
    cells, before = cells[~inner], before[~inner]  # folded between corners: below
    mesh, reference = soup(vtk, cells), soup(vtk, before)
    found = slope_of(mesh, reference, p=p)
    assert found.minimum < 0
    assert found.minimum == pytest.approx(literal(cells), rel=1e-12)
    h, direction = 1e-7, np.random.default_rng(2).normal(size=cells.shape)
    difference = (literal(cells + h * direction) - literal(cells - h * direction)) / (2 * h)
    got = (found.of_minimum * direction.reshape(-1, mesh.dim)).sum()
    assert got == pytest.approx(difference, rel=2e-6)


@pytest.mark.parametrize("vtk", [12, 13])
def test_a_cell_folded_between_its_corners_has_a_way_out_too(vtk):
    tried = shaken(vtk, 20000, 0.5, seed=4)
    reference = soup(vtk, [oracle.IDEAL[vtk]])
    status = quality(soup(vtk, tried), soup(vtk, np.repeat([oracle.IDEAL[vtk]], 20000, 0))).status
    inverted = tried[status == INVERTED]
    cells = [cell for cell in inverted if min(oracle.jacobians(vtk, cell)) > 0][:3]
    assert len(cells) == 3
    for cell in cells:
        found = slope_of(soup(vtk, [cell]), reference)
        assert found.minimum < 0
        steep = (found.of_minimum**2).sum()
        h = 1e-7
        ends = [
            slope_of(soup(vtk, [cell + s * h * found.of_minimum]), reference).minimum
            for s in (1, -1)
        ]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(steep, rel=1e-5)


@pytest.mark.parametrize(
    ("kind", "dim"), [("plain", 2), ("simplex", 2), ("mixed", 3), ("simplex", 3)]
)
def test_climbing_the_slope_unfolds_a_mesh(kind, dim):
    moved, mesh = shaken_mesh(kind, dim, 1.0 if dim == 2 else 0.6)
    before = quality(moved, mesh)
    assert before.inverted >= 5
    points = moved.points
    for _ in range(2000):
        found = quality(moved.with_points(points), mesh, derivative=True)
        if not found.inverted:
            break
        slope = found.derivative
        assert slope.minimum <= 0
        steep = (slope.of_minimum**2).sum()
        assert steep > 0
        points = points - (slope.minimum - 0.05) / steep * slope.of_minimum
    assert found.inverted == 0
    assert found.derivative.minimum > 0


@pytest.mark.parametrize("vtk", [5, pytest.param(9, marks=pytest.mark.slow), 10, 14])
def test_the_minimum_passes_zero_without_a_jump_where_a_corner_folds(vtk):
    cell = np.array(oracle.IDEAL[vtk], float)
    top = cell[-1].copy()
    near = np.array(oracle.IDEAL[vtk], float)[:-1].mean(axis=0)
    reference = soup(vtk, [cell])
    found = []
    for t in np.linspace(0, 1.4, 561):
        cell[-1] = top + t * (near - top)
        slope = slope_of(soup(vtk, [cell]), reference)
        assert np.isfinite(slope.of_minimum).all()
        found.append(slope.minimum)
    assert found[0] > 0 > found[-1]
    assert np.abs(np.diff(found)).max() < 0.02


@pytest.mark.parametrize("vtk", TYPES)
def test_a_flat_cell_is_at_zero_and_is_told_where_it_rises(vtk):
    cell = np.array(oracle.IDEAL[vtk], float)
    flat = cell * ([1] * (cell.shape[1] - 1) + [0])
    found = slope_of(soup(vtk, [flat]), soup(vtk, [cell]))
    assert found.minimum == 0
    slope = found.of_minimum
    assert np.isfinite(slope).all()
    after = slope_of(soup(vtk, [flat + 1e-3 * slope]), soup(vtk, [cell]))
    assert after.minimum > 0


def test_inverted_cells_count_as_zero_in_the_mean_and_have_no_slope_there():
    square = np.array(oracle.IDEAL[9], float)
    bent = square + np.array([[0, 0], [0, 0], [0.3, 0.1], [0, 0]])
    folded = square * [-1, 1]
    found = slope_of(soup(9, [bent, folded]), soup(9, [square, square]))
    alone = slope_of(soup(9, [bent]), soup(9, [square]))
    assert found.mean == alone.mean / 2
    np.testing.assert_allclose(found.of_mean[:4], alone.of_mean / 2, rtol=1e-14)
    np.testing.assert_array_equal(found.of_mean[4:], 0)


def test_without_a_reference_depths_are_in_units_of_the_mesh():
    square = np.array(oracle.IDEAL[9], float)
    folded = square + np.array([[0, 0], [0, 0], [-0.6, -0.6], [0, 0]])
    for scale in (1.0, 10.0):
        found = slope_of(soup(9, scale * folded[None]))
        assert found.minimum == pytest.approx(-0.2 * scale**2)


# Numbers and errors --------------------------------------------------------------------------


@pytest.mark.parametrize("vtk", TYPES)
def test_numbering_the_cells_the_other_way_round_changes_nothing(vtk):
    for amount in (0.1, 0.6):
        cells, before = shaken(vtk, 10, amount), shaken(vtk, 10, 0.05, seed=1)
        turned = list(oracle.MIRRORS[vtk])
        one = slope_of(soup(vtk, cells), soup(vtk, before))
        other = slope_of(soup(vtk, cells[:, turned]), soup(vtk, before[:, turned]))
        shape = cells.shape
        np.testing.assert_allclose(
            other.of_minimum.reshape(shape), one.of_minimum.reshape(shape)[:, turned], atol=1e-12
        )
        assert other.minimum == pytest.approx(one.minimum, rel=1e-12)


def test_bits_depend_neither_on_parts_nor_on_threads(monkeypatch):
    moved, mesh = shaken_mesh("mixed", 3)
    whole = slope_of(moved, mesh)
    monkeypatch.setattr(threads, "PART", 7)
    monkeypatch.setattr(quality_derivative, "PART", 5)
    for count in (1, 2, 3):
        monkeypatch.setattr(quality_derivative, "cores", lambda count=count: count)
        parts = slope_of(moved, mesh)
        np.testing.assert_array_equal(parts.of_minimum, whole.of_minimum)
        np.testing.assert_array_equal(parts.of_mean, whole.of_mean)


def test_lanes_share_out_all_points():
    nodes = np.arange(1000, dtype=np.int64).reshape(-1, 4)
    slopes, weights = np.ones((250, 4, 2)), np.ones((1, 250))
    out = np.zeros((1, 1000, 2))
    for lane in range(3):
        jacobian_slopes.add_to_points(nodes, weights, slopes, lane, 3, out)
    np.testing.assert_array_equal(out, 1)


def test_many_inverted_cells_are_worked_on_in_parts(monkeypatch):
    mesh, before = soup(12, shaken(12, 40, 0.7)), soup(12, shaken(12, 40, 0.05, seed=1))
    whole = slope_of(mesh, before)
    monkeypatch.setattr(quality_derivative, "FOLDED_AT_ONCE", 3)
    parts = slope_of(mesh, before)
    assert parts.minimum == pytest.approx(whole.minimum, rel=1e-14)
    np.testing.assert_allclose(parts.of_minimum, whole.of_minimum, rtol=1e-12, atol=1e-14)


def test_the_rest_of_the_quality_keeps_its_bits():
    moved, mesh = shaken_mesh("mixed", 3)
    plain, other = quality(moved, mesh), quality(moved, mesh, derivative=True)
    assert plain.derivative is None
    for name in ("values", "size", "skew", "status", "signs"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(other, name))
    assert plain.summary() == other.summary()
    for array in (other.derivative.of_minimum, other.derivative.of_mean):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_cells_of_the_halo_have_no_part_in_it(tmp_path):
    plain = grid((4, 4))
    path = tmp_path / "halo.su2"
    path.write_text(halo_text(plain, "y_m", "y_p", np.array([[0, 0, 0], [0, 0, 0], [0, -1.0, 0]])))
    mesh = read(path)
    assert mesh.halo is not None
    rng = np.random.default_rng(0)
    points = mesh.points + rng.uniform(-1e-3, 1e-3, mesh.points.shape)
    n = len(plain.points)
    found = slope_of(mesh.with_points(points), mesh)
    alone = slope_of(plain.with_points(points[:n]), plain)
    np.testing.assert_allclose(found.of_minimum[:n], alone.of_minimum, atol=1e-12)
    np.testing.assert_array_equal(found.of_minimum[n:], 0)
    np.testing.assert_allclose(found.of_mean[:n], alone.of_mean, atol=1e-12)


def test_the_work_can_be_stopped():
    calls = []

    def stop():
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        quality(grid((2, 2)), going_on=stop, derivative=True)


@pytest.mark.parametrize("p", [0.5, 0.0, -3.0, np.inf, np.nan])
def test_the_exponent_must_be_one_or_more(p):
    with pytest.raises(CaseError, match=r"exponent of the smooth minimum is p = .* p >= 1"):
        quality(grid((2, 2)), derivative=True, p=p)


def test_a_point_that_is_no_number_has_no_derivative():
    mesh = grid((2, 2))
    points = mesh.points.copy()
    points[3, 1] = np.nan
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(MeshError, match=r"point 3 of plain 2D is \[.*nan\]; .* needs numbers"),
    ):
        slope_of(mesh.with_points(points), mesh)


def test_an_undeformed_cell_must_have_a_volume():
    square = np.array(oracle.IDEAL[9], float)
    with pytest.raises(MeshError, match="cell 1 of the undeformed mesh has no positive volume"):
        slope_of(soup(9, [square, square]), soup(9, [square, 0 * square]))


def test_a_cell_flat_to_rounding_is_an_error():
    cell = np.array(oracle.IDEAL[9], float)
    cell[2:, 1] = 5e-324
    with pytest.raises(MeshError, match="derivative of the quality of soup is too large"):
        slope_of(soup(9, [cell]))
