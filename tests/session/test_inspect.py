"""What is told of cells, judged by slow literal formulas on small meshes."""

import csv

import numpy as np
import pytest

from slideviz.errors import MeshError, SlidevizError
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import quality
from slideviz.sections.polygons import ONLY_INVERTED, cells_in_range
from slideviz.session import inspect
from slideviz.session.state import StepFrame
from slideviz.system.csv_table import write_csv
from slideviz.terms import RATED
from tests.builders import layered


def frame_of(mesh, move):
    points = mesh.points.copy()
    for node, shift in move.items():
        points[node] += shift
    moved = mesh.with_points(points)
    return StepFrame(moved, quality(moved, mesh))


@pytest.fixture(scope="module")
def frames(square):
    """Node 12, the middle of the square, goes there and half way back; at last node 6 folds."""
    shifts = ({}, {12: 0.2}, {12: 0.4}, {12: 0.2}, {12: 0.2, 6: 1.6})
    return [frame_of(square, move) for move in shifts]


def test_a_range_chooses_its_ends_and_what_is_between():
    values = np.array([0.2, 0.5, 0.8, 0.1])
    assert cells_in_range(values, (0.2, 0.5)).tolist() == [0, 1]


def test_inverted_cells_are_chosen_from_0_alone(frames):
    frame = frames[-1]
    values = frame.shown_values("size-skew")
    inverted = np.flatnonzero(np.isnan(values))
    assert len(inverted) == frame.quality.inverted > 0
    assert set(inverted) <= set(cells_in_range(values, (0.0, 0.3)))
    assert not set(inverted) & set(cells_in_range(values, (1e-9, 1.0)))
    assert cells_in_range(values, ONLY_INVERTED).tolist() == inverted.tolist()


@pytest.mark.parametrize("what", ["size-skew", "size", "skew"])
def test_the_worst_cells_are_those_of_a_full_sort(frames, what):
    found = inspect.worst_cells(frames, 2, what, 5)
    values = frames[2].values(what)
    wanted = sorted(range(16), key=lambda cell: (values[cell], cell))[:5]
    assert found.cells.tolist() == wanted
    assert found.values.tolist() == [values[cell] for cell in wanted]
    assert found.kinds == ("quadrilateral",) * 5
    assert not found.inverted.any()


@pytest.mark.parametrize("what", ["aspect-ratio", "orthogonality", "expansion", "scaled-jacobian"])
def test_the_worst_cells_are_those_of_the_metric_that_is_colored_by(frames, what):
    values = frames[2].values(what)
    high = RATED[what].best == "high"
    wanted = sorted(range(16), key=lambda cell: (values[cell] if high else -values[cell], cell))
    found = inspect.worst_cells(frames, 2, what, 5)
    assert found.cells.tolist() == wanted[:5]
    assert found.measure == what
    assert (found.steps == -1).all()  # only the quality is followed through the steps
    assert inspect.table_rows(found)[1][-1] == ""
    folded = inspect.worst_cells(frames, 4, what, 16)  # inverted cells come first
    assert folded.inverted[: frames[4].quality.inverted].all()


def test_the_worst_cells_by_a_number_of_walls_are_those_at_walls():
    mesh = layered(8, 0.001)
    points = mesh.points.copy()
    points[np.isclose(points[:, 1], np.unique(points[:, 1])[1]), 1] *= 1.1
    points[12, 1] *= 0.8
    moved = mesh.with_points(points)
    frames = [StepFrame(mesh, quality(mesh)), StepFrame(moved, quality(moved, mesh))]
    values = frames[1].values("height-ratio", mesh)
    found = inspect.worst_cells(frames, 1, "height-ratio")
    assert set(found.cells.tolist()) == set(np.flatnonzero(~np.isnan(values)).tolist())
    far = np.abs(np.log(found.values))
    assert (np.diff(far) <= 1e-15).all()
    assert far[0] > 0.09


def test_equal_cells_are_listed_by_number(frames):
    assert inspect.worst_cells(frames, 0, "size-skew", 4).cells.tolist() == [0, 1, 2, 3]
    assert len(inspect.worst_cells(frames, 0, "size-skew")) == 16


def test_each_worst_cell_tells_the_first_step_at_which_it_was_worst(frames):
    found = inspect.worst_cells(frames, len(frames) - 1, "size-skew", 16)
    for cell, step in zip(found.cells, found.steps, strict=True):
        history = [frame.quality.values[cell] for frame in frames]
        assert step == history.index(min(history))
    # The cells about node 12 were worst half way, cells far from all of it never changed.
    steps = dict(zip(found.cells.tolist(), found.steps.tolist(), strict=True))
    assert steps[10] == 2
    assert steps[15] == 0
    assert found.inverted[0]
    assert steps[int(found.cells[0])] == 4


def test_displacements_and_roles_have_the_worst_of_size_skew(frames):
    assert inspect.measure("role") == inspect.measure("displacement") == "size-skew"
    a, b = (inspect.worst_cells(frames, 2, what, 3) for what in ("displacement", "size-skew"))
    assert a.cells.tolist() == b.cells.tolist()


def test_a_cell_tells_its_qualities_and_corner_jacobians(frames):
    frame = frames[2]
    info = inspect.cell_info(frame, 10)
    assert (info.cell, info.kind, info.state) == (10, "quadrilateral", "valid")
    assert info.size_skew == frame.quality.values[10] == np.sqrt(info.size) * info.skew
    # Corners (2.4, 2.4), (3, 2), (3, 3), (2, 3): cross products of the sides by hand.
    assert info.jacobians == pytest.approx([0.6 * 0.6 - 0.4 * 0.4, 0.6, 1.0, 0.6])
    assert info.position == pytest.approx([(2.4 + 3 + 3 + 2) / 4, (2.4 + 2 + 3 + 3) / 4])


def test_the_jacobians_of_a_cell_numbered_the_other_way_round_are_positive(square):
    nodes = square.cells.connectivity.reshape(-1, 4)[:, ::-1]
    other = Mesh(square.points, Cells.from_blocks([(9, nodes)]))
    info = inspect.cell_info(StepFrame(other, quality(other)), 3)
    assert info.jacobians == pytest.approx([1.0] * 4)


def test_an_inverted_cell_says_so(frames):
    frame = frames[-1]
    cell = int(np.flatnonzero(frame.quality.status == inspect.INVERTED)[0])
    info = inspect.cell_info(frame, cell)
    assert info.state == "inverted"
    assert info.jacobians.min() <= 0


@pytest.mark.parametrize("cell", [-1, 16])
def test_a_cell_that_is_not_there_is_refused(frames, cell):
    with pytest.raises(MeshError, match=f"no cell {cell}"):
        inspect.cell_info(frames[0], cell)


def test_a_point_is_in_the_cell_around_it(frames):
    mesh, values = frames[2].mesh, frames[2].quality.values
    for cell in range(16):
        x, y = mesh.points[inspect.nodes_of(mesh, cell)].mean(axis=0)
        assert inspect.cell_at(mesh, x, y, values) == cell
    # In the bounding box of cell 10 too, but in cell 5, whose corner node 12 is.
    assert inspect.cell_at(mesh, 2.2, 2.1, values) == 5
    assert inspect.cell_at(mesh, -0.1, 2.0, values) is None
    assert inspect.cell_at(mesh, 4.01, 4.01, values) is None


def test_of_cells_that_overlap_the_worst_is_told_and_nan_is_passed_by(square):
    nodes = square.cells.connectivity.reshape(-1, 4)[[0, 0]]
    twice = Mesh(square.points, Cells.from_blocks([(9, nodes)]))
    assert inspect.cell_at(twice, 0.5, 0.5, np.array([0.7, -np.inf])) == 1
    assert inspect.cell_at(twice, 0.5, 0.5, np.array([0.7, np.nan])) == 0


def test_the_surroundings_of_a_cell_are_its_middle_and_diagonal(square):
    middle, size = inspect.surroundings(square, 5)
    assert middle.tolist() == [1.5, 1.5, 0.0]
    assert size == pytest.approx(np.sqrt(2.0))


def test_the_table_keeps_every_digit(frames, tmp_path):
    worst = inspect.worst_cells(frames, len(frames) - 1, "skew", 6)
    write_csv(tmp_path / "worst.csv", inspect.table_rows(worst))
    with (tmp_path / "worst.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["cell", "type", "skew", "inverted", "x", "y", "worst_at_step"]
    assert [int(row["cell"]) for row in rows] == worst.cells.tolist()
    assert [float(row["skew"]) for row in rows] == worst.values.tolist()
    assert [float(row["y"]) for row in rows] == worst.positions[:, 1].tolist()
    assert [int(row["worst_at_step"]) for row in rows] == worst.steps.tolist()
    assert [row["inverted"] == "yes" for row in rows] == worst.inverted.tolist()


def test_a_table_that_cannot_be_written_says_why(frames, tmp_path):
    worst = inspect.worst_cells(frames, 1, "size", 2)
    with pytest.raises(SlidevizError, match="the folder does not exist"):
        write_csv(tmp_path / "none" / "worst.csv", inspect.table_rows(worst))
