"""Meshes of turbine rows: thesis Table 4.7, good cells at every size, files of the sample."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import CaseError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.periodic import pair_up
from slideviz.samples import turbine_row
from tools.study.vane import camber, pitch, vane_layers
from tools.study.vane_mesh import (
    NEAREST,
    SIZES,
    Sizing,
    find_sizing,
    front_points,
    inside,
    relax,
    row_mesh,
    triangulate,
    write_files,
)

TRIANGLE, QUADRILATERAL = 5, 9
made = cache(row_mesh)


def edge_counts(mesh: sv.Mesh) -> Counter:
    """Return how many cells have each edge, its nodes sorted."""
    count: Counter = Counter()
    for vtk, (_, nodes) in mesh.cells.by_type.items():
        for local in ELEMENTS[vtk].facets:
            count.update(map(tuple, np.sort(nodes[:, local], axis=1).tolist()))
    return count


def unit_square(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the 4 n nodes around the unit square, counter-clockwise, and their edges."""
    way = np.arange(n) / n
    sides = [(way, 0 * way), (1 + 0 * way, way), (1 - way, 1 + 0 * way), (0 * way, 1 - way)]
    points = np.concatenate([np.column_stack(side) for side in sides])
    loop = np.arange(4 * n)
    return points, np.column_stack([loop, np.roll(loop, -1)])


def even(length: float) -> Sizing:
    return Sizing(np.zeros(2), np.full(2, 0.1), np.full((11, 11), length))


@pytest.mark.parametrize("size", [5_000, 7_777, pytest.param(20_000, marks=pytest.mark.slow)])
def test_size_is_the_number_of_cells_and_all_are_good(size):
    mesh = made(size)
    assert len(mesh.cells) == pytest.approx(size, rel=0.05)
    found = sv.quality(mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert set(found.signs.tolist()) == {1}
    assert found.min > 0.6
    assert found.mean > 0.97


@pytest.mark.slow
def test_default_size_has_the_numbers_of_the_thesis():
    """Thesis Table 4.7, and the 1315 nodes of the vane of Table 4.8."""
    mesh = row_mesh(224_180)
    assert len(mesh.cells) == pytest.approx(224_180, rel=0.02)
    assert len(mesh.points) == pytest.approx(129_883, rel=0.02)
    assert len(mesh.marker("BLADE").nodes) == 1315
    assert len(mesh.cells.by_type[QUADRILATERAL][0]) == 1315 * 25
    assert sv.quality(mesh).min > 0.6


@pytest.mark.parametrize("size", [5_000, 20_000])
def test_extent_is_that_of_the_thesis(size):
    np.testing.assert_allclose(np.ptp(made(size).points, axis=0), [0.058275, 0.097982], rtol=1e-9)


def test_markers_are_the_sides_and_every_node_is_used():
    mesh = made(5_000)
    assert mesh.marker_names == ("BLADE", "INFLOW", "OUTFLOW", "PER1", "PER2")
    count = edge_counts(mesh)
    assert set(count.values()) == {1, 2}
    sides = [
        tuple(sorted(edge))
        for marker in mesh.markers
        for edge in marker.cells.by_type[3][1].tolist()
    ]
    assert len(sides) == len(set(sides))
    assert set(sides) == {edge for edge, cells in count.items() if cells == 1}
    assert len(mesh.cells.nodes) == len(mesh.points)
    for name, x in (("INFLOW", mesh.points[:, 0].min()), ("OUTFLOW", mesh.points[:, 0].max())):
        np.testing.assert_array_equal(mesh.points[mesh.marker(name).nodes, 0], x)


@pytest.mark.parametrize("size", [5_000, 20_000])
def test_second_periodic_side_is_the_first_one_shifted(size):
    mesh = made(size)
    (pair,) = pair_up(mesh, ("PER1", "PER2"), "translational", (0, 0, 1), (0, 0, 0))
    np.testing.assert_allclose(pair.vector, [0, pitch()], rtol=0, atol=1e-12)
    assert pair.mismatch < 1e-15
    assert len(pair.nodes) == len(mesh.marker("PER1").nodes)


def test_quadrilaterals_lie_at_the_vane_and_pass_smoothly_to_triangles():
    mesh = made(20_000)
    quads, triangles = (mesh.cells.by_type[kind][1] for kind in (QUADRILATERAL, TRIANGLE))
    assert np.isin(mesh.marker("BLADE").nodes, quads).all()
    assert not np.isin(mesh.marker("BLADE").nodes, triangles).any()
    rim = np.intersect1d(quads, triangles)
    assert len(rim) == len(mesh.marker("BLADE").nodes)

    def area(nodes):
        x, y = np.moveaxis(mesh.points[nodes], 2, 0)
        return 0.5 * np.sum(x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y, axis=1)

    last = area(quads[np.isin(quads, rim).any(axis=1)])
    next_ones = area(triangles[np.isin(triangles, rim).sum(axis=1) == 2])
    # As long on one side and as high, a triangle has half the area of a quadrilateral; these
    # begin to grow.
    assert 0.5 < np.median(next_ones) / np.median(last) < 0.68
    assert next_ones.min() > 0.25 * np.median(last)
    assert next_ones.max() < np.median(last)


def test_triangles_grow_away_from_the_vane_without_jumps():
    mesh = made(20_000)
    nodes = mesh.cells.by_type[TRIANGLE][1]
    a, b, c = np.moveaxis(mesh.points[nodes], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert np.quantile(area, 0.99) > 3 * np.quantile(area, 0.01)
    at = {}
    jump = []
    for cell, corners in enumerate(nodes.tolist()):
        for k in range(3):
            edge = tuple(sorted((corners[k], corners[k - 1])))
            if edge in at:
                jump.append(area[at[edge]] / area[cell])
            at[edge] = cell
    jump = np.array(jump)
    assert np.quantile(np.maximum(jump, 1 / jump), 0.99) < 1.7


def test_layer_is_orthogonal_to_the_vane_and_grows_evenly():
    rings = vane_layers(300, 6)
    assert rings.shape == (7, 300, 2)
    heights = np.linalg.norm(np.diff(rings, axis=0), axis=2)
    np.testing.assert_allclose(heights, np.broadcast_to(heights[:, :1], heights.shape), 1e-3)
    np.testing.assert_allclose(heights[1:] / heights[:-1], 1.2, 1e-9)
    width = np.linalg.norm(rings[-1] - np.roll(rings[-1], 1, axis=0), axis=1)
    assert np.ptp(width) < 0.03 * width.mean()
    assert heights[-1, 0] == pytest.approx(0.85 * width.mean(), rel=0.01)
    along = np.roll(rings[0], -1, axis=0) - np.roll(rings[0], 1, axis=0)
    out = rings[-1] - rings[0]
    cosine = np.sum(along * out, axis=1) / np.linalg.norm(along, axis=1)
    assert np.abs(cosine / np.linalg.norm(out, axis=1)).max() < 0.15
    assert inside(
        rings[0], rings[-1], np.column_stack([np.arange(300), np.arange(1, 301) % 300])
    ).all()


def test_sizing_repeats_with_the_pitch_and_is_least_at_the_layer():
    rim = vane_layers(400, 6)[-1]
    sizing = find_sizing(rim, 20_000.0)
    x = np.linspace(-0.01, 0.04, 40)
    below = np.column_stack([x, camber(x) - pitch() / 2])
    above = below + np.array([0, pitch()])
    # The table is only as fine as its grid, across which the camber line is steep.
    np.testing.assert_allclose(sizing.at(below), sizing.at(above), rtol=0.05)
    assert sizing.at(rim).mean() < 0.65 * sizing.at(below).mean()
    assert find_sizing(rim, 10_000.0).table.max() > sizing.table.max()


def test_front_fills_a_square_with_nearly_equilateral_triangles():
    points, edges = unit_square(10)
    found = front_points(points, edges, even(0.1), 2 / (np.sqrt(3) / 2 * 0.01))
    assert len(found) == pytest.approx(1 / (np.sqrt(3) / 2 * 0.01) - 20, rel=0.12)
    assert found.min() > 0
    assert found.max() < 1
    every = np.concatenate([points, found])
    apart = np.linalg.norm(every[:, None] - every, axis=2) + np.eye(len(every))
    assert apart.min() >= NEAREST * 0.1 * (1 - 1e-12)
    relaxed, triangles = relax(every, len(points), edges)
    np.testing.assert_array_equal(relaxed[: len(points)], points)
    mesh = sv.Mesh(relaxed, sv.Cells.from_blocks([(TRIANGLE, triangles)]))
    assert sv.quality(mesh).min > 0.6
    assert len(triangles) == 2 * len(found) + len(points) - 2


def test_triangulation_leaves_out_holes_and_bays():
    outer, loop = unit_square(8)
    bay = np.array([[0.5, 0.3]])
    # The node in the middle of the lower side is drawn in, and a square hole is cut above.
    outer[4] = bay
    hole = 0.5 + 0.2 * (outer[::4][::-1] - 0.5) + [0, 0.25]
    hole[np.abs(hole[:, 1] - 0.65) < 0.02, 1] = 0.65
    ring = len(outer) + np.arange(len(hole))
    edges = np.concatenate([loop, np.column_stack([ring, np.roll(ring, -1)])])
    points = np.concatenate([outer, hole])
    found = triangulate(points, edges)
    a, b, c = np.moveaxis(points[found], 1, 0)
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert area.min() > 0

    def shoelace(xy):
        x, y = xy.T
        return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)

    assert shoelace(hole) < 0
    assert area.sum() == pytest.approx(shoelace(outer) + shoelace(hole))


@pytest.mark.parametrize("size", [4_999, 5_000_001, 0, -3])
def test_size_out_of_range_is_told(size):
    with pytest.raises(CaseError, match=rf"size {size} is out of range; .* has {SIZES[0]} to"):
        row_mesh(size)


def test_files_of_the_sample_are_such_meshes(tmp_path, monkeypatch):
    """Not node by node: which point the front accepts can turn on the last digit of a cosine."""
    kept = turbine_row.row_mesh(5_000)
    monkeypatch.setattr(turbine_row, "__file__", str(tmp_path / "turbine_row.py"))
    monkeypatch.setattr(turbine_row, "SIZES", (5_000,))
    write_files()
    fresh = turbine_row.row_mesh(5_000)
    assert len(kept.cells) == pytest.approx(len(fresh.cells), rel=0.02)
    assert kept.marker_names == fresh.marker_names
    for one, other in zip(kept.markers, fresh.markers, strict=True):
        ours, theirs = kept.points[one.nodes], fresh.points[other.nodes]
        np.testing.assert_allclose(np.sort(ours, 0), np.sort(theirs, 0), rtol=0, atol=1e-9)
