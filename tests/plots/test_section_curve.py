"""The curve along a line or circle, its plot, and the picture of cells with what is around them."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from slideviz.color_scheme import COLOR_MAP
from slideviz.mesh.quality import quality
from slideviz.plots import cells as plot_cells
from slideviz.plots.cells import surroundings, window
from slideviz.plots.section_curve import (
    Curve,
    CurveRow,
    curve_of,
    draw_curves,
    labels_of,
    steps,
)
from slideviz.plots.section_paint import Paint, paint, shown_paint
from slideviz.plots.section_picture import SectionInRun, SectionStyle, draw_section
from slideviz.plots.session_plots import (
    UNDEFORMED,
    SectionCurveMaker,
    facts_of,
    series_of,
)
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import StepFrame, second_view
from tests.builders import cube, square

EYE = {0: np.eye(4)}
PAINT = Paint("size-skew", np.zeros(0), np.zeros(0, bool), (0.0, 1.0))
LINE = Section("plane", (0.0, 0.45, 0.0), (0.0, 1.0, 0.0))
RING = Section("cylinder", (0.5, 0.5, 0.0), radius=0.4)


@pytest.fixture(scope="module")
def mesh():
    """A square of 8 by 8 cells with a hole in the middle, skewed so that cells differ."""
    base = square(8)
    push = 0.05 * np.prod(np.sin(np.pi * base.points), axis=1)
    return base.with_points(base.points + np.array([1.0, 0.0]) * push[:, None])


def curve(mesh, section):
    found = quality(mesh)
    lines = Cutter(mesh).cut(mesh.points, section)
    return curve_of(lines, section, paint(mesh, found, "size-skew"))


def row(ends, values, inverted=None):
    values = np.array(values, float)
    folded = np.zeros(len(values), bool) if inverted is None else np.array(inverted)
    return Curve(np.array(ends, float), values, folded, np.arange(len(values)) + 10)


def axes_of(rows, **options):
    axes = Figure().add_subplot()
    draw_curves(axes, rows, ("x", "q"), **options)
    return axes


# The curve --------------------------------------------------------------------------------


def test_a_curve_has_every_cell_of_the_line_where_it_is_cut(mesh):
    found = curve(mesh, LINE)
    assert found.cells.tolist() != sorted(found.cells.tolist()) or len(found.cells) > 5
    assert (np.diff(found.ends[:, 0]) >= 0).all()
    assert (found.ends[:, 1] > found.ends[:, 0]).all()
    values = quality(mesh).values
    assert np.array_equal(found.values, values[found.cells])
    nodes = mesh.cells.by_type[9][1]
    for (low, high), cell in zip(found.ends, found.cells, strict=True):
        x = mesh.points[nodes[cell], 0]
        assert x.min() - 1e-12 <= low < high <= x.max() + 1e-12
    assert found.ends.min() == pytest.approx(0.0)
    assert found.ends.max() == pytest.approx(1.0)


def test_positions_along_a_slope_are_lengths():
    mesh = square(4, block=False)
    found = curve(mesh, Section("plane", (0.1, 0.0, 0.0), (1.0, -1.0, 0.0)))
    assert (found.ends[:, 1] - found.ends[:, 0]).sum() == pytest.approx(0.9 * np.sqrt(2.0))
    assert labels_of(Section("plane", direction=(1.0, -1.0, 0.0)), PAINT)[0] == (
        "along (0.707, 0.707, 0)"
    )
    assert labels_of(LINE, PAINT)[0] == "x"


def test_positions_on_a_circle_are_angles_with_the_same_seam_always():
    mesh = square(9, block=False)
    found = curve(mesh, RING)
    middle = found.ends.mean(axis=1)
    assert (middle >= -180.0).all()
    assert (middle < 180.0).all()
    lengths = found.ends[:, 1] - found.ends[:, 0]
    assert (lengths < 30.0).all()
    assert lengths.sum() == pytest.approx(360.0)
    assert labels_of(RING, PAINT)[0] == "angle [°]"


def test_a_curve_breaks_where_there_is_no_cell():
    x, y = steps(row([(0, 1), (1, 2), (3, 4)], (0.5, 0.6, 0.7)))
    assert np.array_equal(x, [0, 1, 1, 2, np.nan, 3, 4], equal_nan=True)
    assert np.array_equal(y, [0.5, 0.5, 0.6, 0.6, np.nan, 0.7, 0.7], equal_nan=True)


def test_a_position_tells_its_cell():
    one = row([(0, 1), (0.5, 2), (3, 4)], (0.5, 0.0, 0.7), (False, True, False))
    assert one.cell_at(0.2) == 10
    assert one.cell_at(0.7) == 11  # overlaps the first, and is inverted
    assert one.cell_at(3.5) == 12
    assert one.cell_at(2.5) is None


# Its plot ---------------------------------------------------------------------------------


def test_the_areas_below_a_curve_have_the_colors_of_the_view():
    values = (0.4, 0.9)
    limits = (0.2, 1.0)
    one = CurveRow("run 1", row([(0, 1), (1, 2)], values), 0)
    axes = axes_of([one], colors=replace(PAINT, color_map="plasma", limits=limits))
    (areas,) = axes.collections
    areas.update_scalarmappable()
    wanted = mpl.colormaps["plasma"]((np.array(values) - 0.2) / 0.8)[:, :3]
    assert areas.get_facecolor()[:, :3] == pytest.approx(wanted)
    assert [path.vertices[:, 1].max() for path in areas.get_paths()] == pytest.approx(values)
    assert not axes_of([one]).collections


def test_inverted_cells_are_marked_over_the_whole_height():
    one = CurveRow("run 1", row([(0, 1), (1, 2)], (0.0, 0.9), (True, False)), 0)
    axes = axes_of([one])
    (marks,) = axes.collections
    (path,) = marks.get_paths()
    assert path.vertices[:, 0].tolist() == [0, 1, 1, 0, 0]
    assert (path.vertices[:, 1].min(), path.vertices[:, 1].max()) == axes.get_ylim()
    assert "inverted" in [text.get_text() for text in axes.get_legend().get_texts()]


def test_what_is_looked_at_is_solid_and_the_limits_hold_all():
    rows = [
        CurveRow("undeformed", row([(0, 5)], (0.99,)), UNDEFORMED),
        CurveRow("run 1", row([(1, 2)], (0.42,)), 0),
    ]
    axes = axes_of(rows)
    assert [line.get_linestyle() for line in axes.get_lines()][-1] == "-"
    assert axes.get_lines()[0].get_linestyle() != "-"
    low, high = axes.get_ylim()
    assert low < 0.42 < 0.99 < high
    left, right = axes.get_xlim()
    assert left < 0 < 5 < right


# Of a session -----------------------------------------------------------------------------


@pytest.fixture
def session(mesh):
    base = square(8)
    session = open_mesh(StepFrame(base, quality(base)), None)
    frames = [StepFrame(mesh, quality(mesh, base))]
    return changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")


def test_a_session_has_the_curve_of_its_run_above_that_of_the_undeformed_mesh(session):
    made = SectionCurveMaker()
    rows = made.of([(session, Cuts())], LINE)
    assert [one.label for one in rows] == ["undeformed", "run 1"]
    assert [one.series for one in rows] == [UNDEFORMED, series_of(session.runs[0])]
    assert np.array_equal(rows[1].curve.values, session.frame.quality.values[rows[1].curve.cells])
    assert rows[0].curve.values == pytest.approx(1.0)
    first = changes.show_frame(session, 0)
    assert [one.label for one in made.of([(first, Cuts())], LINE)] == ["undeformed"]
    away = Section("plane", (0.0, 9.0, 0.0), (0.0, 1.0, 0.0))
    assert made.of([(session, Cuts())], away) == ()


def test_of_two_runs_that_are_compared_both_have_a_curve(session):
    frames = session.runs[0].frames
    session = changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")
    session = changes.show_beside(session, 1)
    shown = [(session, Cuts()), (second_view(session), Cuts())]
    rows = SectionCurveMaker().of(shown, LINE)
    assert [one.label for one in rows] == ["undeformed", "run 1", "run 2"]


def test_the_curve_is_of_what_the_colors_say(session):
    moved = changes.set_view(session, color_by="displacement")
    (only,) = SectionCurveMaker().of([(moved, Cuts())], LINE)
    assert only.curve.values.max() > 0.02
    assert labels_of(LINE, shown_paint(moved)) == ("x", "displacement [mesh units]")
    assert shown_paint(moved).limits == moved.color_range
    role = changes.set_view(session, color_by="role")
    drawn = shown_paint(role)
    assert labels_of(RING, drawn) == ("angle [°]", "size-skew [-]")
    assert (drawn.color_map, drawn.limits) == (COLOR_MAP, (0.0, 1.0))


def test_the_facts_are_those_of_the_cut_cells(session):
    cells = Cutter(session.mesh).which_cells(session.frame.mesh.points, LINE)
    values = session.frame.quality.values[cells]
    assert facts_of(session, Cuts(), LINE) == (
        f"size-skew: min {values.min():.4f}, mean {values.mean():.4f}; {len(cells)} cells cut"
    )
    away = Section("plane", (0.0, 9.0, 0.0), (0.0, 1.0, 0.0))
    assert facts_of(session, Cuts(), away) == "it cuts no cell"


# Pictures ---------------------------------------------------------------------------------


def picture(mesh, section, **style):
    cutter = Cutter(mesh)
    painted = paint(mesh, quality(mesh), "size-skew")
    pieces = {0: cutter.show(mesh.points, section)}
    around = surroundings(cutter, mesh.points, EYE)
    return draw_section([SectionInRun(pieces, painted, around)], section, SectionStyle(**style))


def test_the_picture_of_a_cut_is_the_curve(mesh):
    figure = picture(mesh, LINE)
    (axes,) = figure.axes
    x, y = steps(curve(mesh, LINE))
    assert np.array_equal(axes.get_lines()[0].get_xdata(), x, equal_nan=True)
    assert np.array_equal(axes.get_lines()[0].get_ydata(), y, equal_nan=True)
    assert figure.get_suptitle().split("\n")[0] == "line y = 0.45"
    assert axes.get_xlabel() == "x"
    assert axes.get_ylabel() == "size-skew [-]"


def test_the_picture_of_whole_cells_has_the_others_faintly_around_them(mesh):
    whole = Section("plane", (0.0, 0.45, 0.0), (0.0, 1.0, 0.0), whole_cells=True)
    figure = picture(mesh, whole)
    axes = figure.axes[0]
    faint, line, cells = axes.collections
    assert isinstance(line, LineCollection)
    assert np.concatenate([path.vertices for path in line.get_paths()])[:, 1] == pytest.approx(0.45)
    own = Cutter(mesh).which_cells(mesh.points, whole)
    assert len(cells.get_paths()) == len(own)
    assert len(faint.get_paths()) > len(own)
    assert faint.get_zorder() < cells.get_zorder() < line.get_zorder()
    # As high as there is room, not a strip.
    low, high = axes.get_ylim()
    assert high - low > 0.5


def test_a_picture_of_a_3d_section_has_nothing_around_it():
    mesh = cube(3, block=False)
    assert surroundings(Cutter(mesh), mesh.points, EYE) is None
    figure = picture(mesh, Section("plane", (0.0, 0.0, 0.4)))
    (shapes,) = figure.axes[0].collections
    assert isinstance(shapes, PolyCollection)
    assert figure.get_suptitle().split("\n")[0] == "plane z = 0.4"


def test_what_is_shown_around_a_cut_stays_on_the_mesh():
    mesh = square(4, block=False)
    around = surroundings(Cutter(mesh), mesh.points * (4.0, 1.0), EYE)
    # A strip at the left end: the room beside it shows what is to the right.
    low, high = window((np.array([0.0, 0.0]), np.array([0.2, 1.0])), around, 2.0)
    assert (low.tolist(), high.tolist()) == ([0.0, 0.0], [2.0, 1.0])
    # One in the middle has as much on both sides.
    low, high = window((np.array([1.9, 0.0]), np.array([2.1, 1.0])), around, 2.0)
    assert (low.tolist(), high.tolist()) == ([1.0, 0.0], [3.0, 1.0])
    # Never more than the mesh.
    low, high = window((np.array([0.0, 0.2]), np.array([4.0, 0.4])), around, 2.0)
    assert (low.tolist(), high.tolist()) == ([0.0, 0.0], [4.0, 1.0])


def test_very_many_cells_are_an_area_without_lines(mesh, monkeypatch):
    monkeypatch.setattr(plot_cells, "MOST_EDGED", 10)
    whole = Section("plane", (0.0, 0.45, 0.0), (0.0, 1.0, 0.0), whole_cells=True)
    faint = picture(mesh, whole).axes[0].collections[0]
    assert faint.get_rasterized()
    assert np.allclose(faint.get_edgecolor(), faint.get_facecolor())
