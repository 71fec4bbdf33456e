"""Numbers of a mesh read block by block are those of the mesh in memory."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.session.inspect import WORST, cell_info, worst_cells
from slideviz.session.large import frame_of
from slideviz.session.results import StepFrame
from slideviz.session.whole import PartQuality, QualityAccumulator, measure_all, totals_of
from slideviz.streaming.skin import read_skin


@pytest.fixture(scope="module")
def folded(tmp_path_factory):
    """Return a mesh, the same with folded cells, and the files of both."""
    folder = tmp_path_factory.mktemp("folded")
    mesh = sample("hexahedron", size=9).mesh
    points = mesh.points.copy()
    rng = np.random.default_rng(5)
    points += 0.05 * rng.normal(size=points.shape) * mesh.extent
    moved = mesh.with_points(points)
    sv.write(folder / "mesh.su2b", mesh)
    sv.write(folder / "moved.su2b", moved)
    return mesh, moved, folder


def test_numbers_of_all_cells(folded):
    mesh, moved, _ = folded
    found = quality(moved, mesh)
    assert found.inverted > 3
    part = PartQuality.of(quality(mesh), totals_of(found))
    for name in ("cells", "inverted", "unproven", "valid", "min"):
        assert getattr(part, name) == getattr(found, name), name
    assert part.mean == pytest.approx(found.mean, rel=1e-14)
    for bins in (10, 20, 25):
        np.testing.assert_array_equal(part.histogram(bins)[0], found.histogram(bins)[0])
    np.testing.assert_array_equal(part.all.worst, found.worst(WORST))


@pytest.mark.parametrize("size", [1, 17, 100, 1000])
def test_blocks_in_any_order_give_the_same(folded, size):
    mesh, moved, _ = folded
    found = quality(moved, mesh)
    made = QualityAccumulator()
    starts = list(range(0, len(found), size))
    for first in np.random.default_rng(2).permutation(starts):
        part = slice(first, first + size)
        made.add(np.arange(len(found))[part], found.values[part], found.status[part])
    np.testing.assert_array_equal(made.totals().worst, found.worst(WORST))
    assert made.totals().mean == pytest.approx(found.mean, rel=1e-13)
    np.testing.assert_array_equal(made.totals().counts, totals_of(found).counts)


def test_an_undeformed_mesh_is_measured_in_its_file(folded):
    mesh, _, folder = folded
    told = []
    found, totals = quality(mesh), measure_all(folder / "mesh.su2b", None, "knupp", told.append)
    assert (totals.cells, totals.min) == (found.cells, found.min)
    assert told[-1] == 1.0


def test_the_worst_cells_are_those_of_the_mesh_in_memory(folded):
    mesh, moved, folder = folded
    found = quality(moved, mesh)
    skin = read_skin(folder / "mesh.su2b", None)
    now = skin.with_points(moved.points[skin.part.points])
    first = frame_of(skin, skin, folder / "mesh.su2b", totals_of(quality(mesh)), "knupp")
    frame = frame_of(now, skin, folder / "moved.su2b", totals_of(found), "knupp")
    there = worst_cells([StepFrame(mesh, quality(mesh)), StepFrame(moved, found)], 1, "size-skew")
    here = worst_cells([first, frame], 1, "skew")
    np.testing.assert_array_equal(here.known_as, there.cells)
    np.testing.assert_array_equal(here.values, there.values)
    np.testing.assert_array_equal(here.inverted, there.inverted)
    np.testing.assert_array_equal(here.steps, there.steps)
    np.testing.assert_allclose(here.positions, there.positions, rtol=1e-14)
    assert here.kinds == there.kinds
    assert here.measure == "size-skew"
    for at, cell in zip(here.cells, there.cells, strict=True):
        assert frame.has(int(at))
        one, other = cell_info(frame, int(at)), cell_info(StepFrame(moved, found), int(cell))
        assert one.cell == other.cell
        assert one.state == other.state
        assert one.size_skew == other.size_skew
        np.testing.assert_allclose(one.jacobians, other.jacobians, rtol=1e-12)
    assert not frame.has(None)
    assert not frame.has(len(skin.cells) + WORST)
