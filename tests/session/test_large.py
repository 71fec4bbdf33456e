"""Numbers of a mesh read block by block are those of the mesh in memory."""

from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh import quality as quality_module
from slideviz.mesh.quality import FINE, INVERTED, lowest, pairwise_sum, quality, quality_totals
from slideviz.samples.table import sample
from slideviz.session.inspect import WORST, cell_info, worst_cells
from slideviz.session.large import first_frame, frame_of
from slideviz.session.state import StepFrame
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


def totals_of(found):
    return quality_totals(found.values, found.status, worst=WORST)


def test_numbers_of_all_cells(folded):
    mesh, moved, _ = folded
    found = quality(moved, mesh)
    assert found.inverted > 3
    part = replace(quality(mesh), of_mesh=totals_of(found))
    for name in ("cells", "inverted", "unproven", "valid", "min", "mean"):
        assert getattr(part, name) == getattr(found, name), name
    np.testing.assert_array_equal(part.totals.worst, found.worst(WORST))
    fine = np.histogram(found.values[found.status != INVERTED], FINE, (0.0, 1.0))[0]
    np.testing.assert_array_equal(part.totals.fine_counts, fine)


@pytest.mark.parametrize("size", [17, 100, 1000])
def test_pieces_of_any_size_give_the_same(folded, monkeypatch, size):
    mesh, moved, _ = folded
    found = quality(moved, mesh)
    wanted = totals_of(found)
    monkeypatch.setattr(quality_module, "PIECE", size)
    made = totals_of(found)
    assert (made.cells, made.min, made.mean) == (wanted.cells, wanted.min, wanted.mean)
    assert (made.inverted, made.unproven) == (wanted.inverted, wanted.unproven)
    np.testing.assert_array_equal(made.worst, np.argsort(found.values, kind="stable")[:WORST])
    np.testing.assert_array_equal(made.fine_counts, wanted.fine_counts)
    some = np.random.default_rng(size).random(len(found)) < 0.3
    ids = np.flatnonzero(some)
    order = ids[np.argsort(found.values[ids], kind="stable")]
    np.testing.assert_array_equal(lowest(found.values, 7, some), order[:7])
    np.testing.assert_array_equal(lowest(found.values, len(found), some), order)
    assert not len(lowest(found.values, 0))


@pytest.mark.parametrize("count", [0, 7, 129, 1000, 99_991])
def test_a_sum_by_pieces_has_the_bits_of_one(monkeypatch, count):
    monkeypatch.setattr(quality_module, "PIECE", 500)
    values, seen = np.random.default_rng(count).random(count), np.zeros(count, int)

    def visit(part):
        seen[part] += 1

    assert pairwise_sum(values, visit) == values.sum()
    assert (seen == 1).all()


def test_an_undeformed_mesh_is_measured_in_its_file(folded):
    mesh, _, folder = folded
    told = []
    skin = read_skin(folder / "mesh.su2b", None)
    found, totals = quality(mesh), first_frame(skin, "knupp", told.append).quality.totals
    assert (totals.cells, totals.min, totals.mean) == (found.cells, found.min, found.mean)
    np.testing.assert_array_equal(totals.worst, found.worst(WORST))
    assert told[-1] == 1.0


def test_the_worst_cells_are_those_of_the_mesh_in_memory(folded):
    mesh, moved, folder = folded
    found = quality(moved, mesh)
    skin = read_skin(folder / "mesh.su2b", None)
    now = skin.with_points(moved.points[skin.numbering.points])
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
