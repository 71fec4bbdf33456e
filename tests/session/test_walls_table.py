"""The table of walls: what the window and its CSV say about the layers of a step."""

import csv
import io

import numpy as np
import pytest

from slideviz.mesh.quality import quality
from slideviz.mesh.walls import walls
from slideviz.plots.session_plots import distribution
from slideviz.sections.polygons import ONLY_INVERTED, cells_in_range
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.runs_words import COLUMNS
from slideviz.session.state import StepFrame
from slideviz.session.walls_table import table_rows, wall_rows
from slideviz.system.csv_table import csv_text
from tests.builders import grid


def sheared_session(roles):
    """A run on a channel with layers at y_m, whose first height is halved, and edges at 45°."""
    y = np.array([0, 0.1, 0.2, 0.35, 0.6, 1.0])
    mesh = grid((2, 5), place=lambda p: np.stack([p[:, 0] / 2, y[p[:, 1].astype(int)]], axis=1))
    points = mesh.points.copy()
    points[points[:, 1] == 0.1] += [0.05, -0.05]
    moved = mesh.with_points(points)
    frames = [StepFrame(one, quality(one, mesh), walls=walls(one, mesh)) for one in (mesh, moved)]
    session = changes.set_case(open_mesh(frames[0], None), roles=roles)
    return changes.add_frames(changes.start_run(session), frames[1:])


def test_rows_have_the_worst_before_and_after_layers_first():
    rows = wall_rows(sheared_session({"x_m": "internal", "x_p": "fixed"}))
    assert [row.name for row in rows] == ["y_m", "x_p", "y_p"]
    low = rows[0]
    assert low.layered
    assert low.before == ("0.1", "1.667", "2", "90.0°")
    assert low.after[0] == "0.05"
    assert low.after[2:] == ("1", "45.0°")
    assert low.change == ("0.500", "", "", "45.0°")
    assert "First height after: min 0.05, mean 0.05, max 0.05" in low.tip


def test_the_csv_has_every_number():
    session = sheared_session({"x_m": "internal"})
    rows = list(csv.DictReader(io.StringIO(csv_text(table_rows(session)))))
    low = next(row for row in rows if row["boundary"] == "y_m")
    assert float(low["first_height.ratio.mean"]) == pytest.approx(0.5)
    assert float(low["equal_layers.before.max"]) == 2
    assert float(low["angle.change.min"]) == pytest.approx(45)
    assert len(low) == 2 + 4 * 3 * 2 + 2 * 3


def test_runs_have_heights_of_walls_with_layers_only():
    run = sheared_session({}).runs[0]
    texts = {column.title: column.text(run) for column in COLUMNS}
    assert texts["lowest first height, ratio"] == texts["highest first height, ratio"] == "0.500"
    assert texts["largest change of a wall angle"] == "45°"


def test_colors_show_the_numbers_at_walls_with_layers_only():
    session = changes.set_view(sheared_session({}), color_by="height-ratio", frame=1)
    frame, low = session.frame, [0, 5]  # the cells at y_m
    values = frame.values("height-ratio", session.mesh)
    assert values[low] == pytest.approx(0.5)
    assert np.isnan(np.delete(values, low)).all()
    assert np.isinf(np.delete(frame.shown_values("height-ratio", session.mesh), low)).all()
    assert session.color_range == (0.5, 1.0)
    turned = changes.set_view(session, color_by="wall-angle")
    assert turned.frame.values("wall-angle", session.mesh)[low] == pytest.approx(45)
    assert turned.color_range == (45.0, 90.0)
    assert changes.set_view(session, color_by="first-height").color_range == (0.0, 0.1)


def test_thresholds_and_histograms_leave_out_cells_at_no_wall():
    session = changes.set_view(sheared_session({}), color_by="height-ratio", frame=1)
    values = session.frame.shown_values("height-ratio", session.mesh)
    assert cells_in_range(values, (0.0, 2.0)).tolist() == [0, 5]
    assert len(cells_in_range(values, ONLY_INVERTED)) == 0
    counts = distribution(session.frame, "height-ratio", (0.0, 1.0), session.mesh)
    assert (counts.counts.sum(), counts.inverted) == (2, 0)
    kept = changes.set_view(session, threshold=(0.5, 1.0))
    assert changes.set_view(kept, color_by="growth").view.threshold is None
