"""The panel of the curves, by itself."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from qtpy.QtCore import QEvent, QPoint, QPointF, Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.color_scheme import DARK
from slideviz.gui.panels.curves import CurvesPanel
from slideviz.mesh.quality import quality
from slideviz.session import changes, jobs
from slideviz.session.opening import open_mesh
from slideviz.session.state import Session, StepFrame
from tests.builders import passage
from tests.gui.test_worst import session_with_runs


@pytest.fixture
def panel(plot_panel):
    return plot_panel(CurvesPanel)


@pytest.fixture
def full(panel, qtbot):
    with qtbot.waitSignal(panel.canvas.drawn):
        panel.store.put(session_with_runs())
    return panel


def choose(panel, kind):
    panel.kind.setCurrentIndex(panel.kind.findData(kind))
    panel.kind.activated.emit(panel.kind.currentIndex())


def lines(panel):
    axes = panel.canvas.figure.axes[0]
    return {line.get_gid() or line.get_label(): line for line in axes.lines}


@pytest.mark.parametrize("kind", ["steps", "reach", "greedy", "span", "meridional", "gaps"])
def test_without_a_mesh_it_says_what_to_do(panel, kind):
    choose(panel, kind)
    assert panel.area.shows_text
    assert "Open a mesh first" in panel.area.words.text()
    assert not panel.save.isEnabled()


def test_without_a_run_it_says_what_is_to_be_seen(panel):
    session = session_with_runs()
    panel.store.put(replace(session, runs=(), shown=None))
    assert "Run the case to see minimum and mean" in panel.area.words.text()
    choose(panel, "greedy")
    assert "Run the case with data reduction" in panel.area.words.text()


def test_minimum_and_mean_by_step_of_each_run(full):
    session = full.store.session
    drawn = lines(full)
    for run in session.runs:
        wanted = [session.first.quality.min, *(frame.quality.min for frame in run.frames)]
        assert list(drawn[f"minimum:run {run.number}"].get_ydata()) == wanted
        assert f"mean:run {run.number}" in drawn
    assert list(drawn["shown"].get_xdata()) == [2, 2]


def test_the_mark_follows_the_step(full, qtbot):
    with qtbot.waitSignal(full.canvas.drawn):
        full.store.change(changes.show_frame, 1)
    assert list(lines(full)["shown"].get_xdata()) == [1, 1]


def test_a_click_in_the_plot_goes_to_that_step(full):
    axes = full.canvas.figure.axes[0]
    for step in (0, 1):
        x = axes.transData.transform((step + 0.2, 0))[0] / full.canvas.devicePixelRatioF()
        where = QPoint(round(x), full.canvas.height() // 2)
        QTest.mouseClick(full.canvas, Qt.MouseButton.LeftButton, pos=where)
        assert full.store.session.view.frame == step


@pytest.fixture
def safe(full, qtbot):
    """The panel with the curve of a run of the sample square whose case has a motion to scale."""
    session = full.store.session
    moves = {"roles": {"BLOCK": "moving"}, "motions": (Translate("BLOCK", (0.0, 0.2)),)}
    session = changes.set_case(session, **moves, steps=1, relax="no")
    found = []
    jobs.compute(session.case, session.mesh, jobs.Job(found.append))
    frames = [one for one in found if isinstance(one, StepFrame)]
    session = changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")
    full.store.put(session)
    with qtbot.waitSignal(full.canvas.drawn):
        choose(full, "reach")
    qtbot.waitUntil(lambda: not full.canvas.busy)
    return full


def test_how_far_the_motion_may_go_and_a_drag_scales_it(safe, qtbot):
    found = safe.store.session.run_shown.safe
    drawn = lines(safe)
    assert list(drawn["proved"].get_xdata()) == [100 * found.fraction] * 2
    assert drawn["q"].get_ydata()[0] == pytest.approx(1.0)
    canvas, y = safe.canvas, safe.canvas.height() // 2
    start, end = (QPoint(round(canvas.to_pixel(at)), y) for at in (100 * found.fraction, 50))
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=end)
    assert safe.store.session.case.motions[0].vector == (0.0, 0.2)  # a click scales nothing
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=start)
    drag(canvas, end)
    with qtbot.waitSignal(canvas.drawn):
        QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=end)
    assert safe.store.session.case.motions[0].vector[1] == pytest.approx(0.1, abs=4e-3)
    qtbot.waitUntil(lambda: not canvas.busy)
    assert lines(safe)["typed"].get_xdata()[0] == pytest.approx(50, abs=2)
    safe.store.undo()
    assert safe.store.session.case.motions[0].vector == (0.0, 0.2)


def drag(widget, to):
    """Move the mouse with its left button held: `QTest.mouseMove` holds none."""
    buttons = Qt.MouseButton.NoButton, Qt.MouseButton.LeftButton
    where = QPointF(to), QPointF(widget.mapToGlobal(to))
    kind, keys = QEvent.Type.MouseMove, Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(widget, QMouseEvent(kind, *where, *buttons, keys))
    widget.grab()


def test_without_a_number_there_is_no_curve_of_how_far(full):
    choose(full, "reach")
    assert "Run the case to see how far its motion may go" in full.area.words.text()


def test_a_click_in_another_plot_goes_nowhere(full, qtbot):
    with qtbot.waitSignal(full.canvas.drawn):
        choose(full, "span")
    QTest.mouseClick(full.canvas, Qt.MouseButton.LeftButton, pos=QPoint(100, 100))
    assert full.store.session.view.frame == 2


def test_convergence_of_the_shown_step_or_why_there_is_none(full, qtbot):
    choose(full, "greedy")
    assert "used all boundary nodes" in full.area.words.text()
    session = full.store.session
    cycles = tuple(
        SimpleNamespace(control_nodes=4 * k, error=0.1 / k, level=1) for k in range(1, 6)
    )
    run = session.runs[1]
    step = SimpleNamespace(index=2, history=cycles, seconds={}, tolerance=0.02)
    frames = (run.frames[0], replace(run.frames[1], step=step))
    with qtbot.waitSignal(full.canvas.drawn):
        full.store.put(replace(session, runs=(session.runs[0], replace(run, frames=frames))))
    assert not full.area.shows_text
    assert list(lines(full)["run 2, step 2"].get_xdata()) == [4, 8, 12, 16, 20]
    full.store.change(changes.show_frame, 0)
    assert "The undeformed mesh is shown" in full.area.words.text()


def test_along_the_span_the_shown_step_others_and_the_undeformed_mesh(full, qtbot):
    with qtbot.waitSignal(full.canvas.drawn):
        choose(full, "span")
    assert full.span_row.isVisible()
    axes = full.canvas.figure.axes[0]
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert names == ["run 2", "run 1", "undeformed"]
    assert axes.get_ylabel().startswith("y ")
    with qtbot.waitSignal(full.canvas.drawn):
        full.coordinate.setCurrentIndex(full.coordinate.findData("x"))
        full.coordinate.activated.emit(full.coordinate.currentIndex())
    assert full.canvas.figure.axes[0].get_ylabel().startswith("x ")
    with qtbot.waitSignal(full.canvas.drawn):
        full.what.setCurrentIndex(full.what.findData("mean"))
        full.what.activated.emit(full.what.currentIndex())
    assert full.canvas.figure.axes[0].get_xlabel().startswith("mean")


def test_a_coordinate_that_the_mesh_does_not_have_is_told_in_the_plot(full, qtbot, monkeypatch):
    from slideviz.errors import SlidevizError
    from slideviz.gui.panels import curves

    def refuse(*_):
        raise SlidevizError("the mesh has no extent along r; choose another")

    monkeypatch.setattr(curves.curves, "profiles", refuse)
    with qtbot.waitSignal(full.canvas.drawn):
        choose(full, "span")
    texts = [text.get_text() for text in full.canvas.figure.texts]
    assert texts == ["the mesh has no extent along r; choose another"]


def drawn_kind(panel, kind, qtbot):
    """Choose a plot, wait until it is drawn, and return its figure."""
    with qtbot.waitSignal(panel.canvas.drawn):
        choose(panel, kind)
    qtbot.waitUntil(lambda: not panel.canvas.busy)
    return panel.canvas.figure


def test_of_a_machine_the_meridional_view_throat_and_span_are_drawn(panel, qtbot):
    mesh = passage((2, 6, 6), 40.0)
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    case = Case(roles=roles, periodic_type="rotational")
    with qtbot.waitSignal(panel.canvas.drawn):
        panel.kind.show_value("meridional")
        panel.store.put(open_mesh(StepFrame(mesh, quality(mesh)), None, (), case))
    view, bar = drawn_kind(panel, "meridional", qtbot).axes
    assert (view.get_xlabel(), bar.get_ylabel()) == ("z [mesh units]", "mean size-skew [-]")
    assert not panel.whole.isVisible()
    [throat] = drawn_kind(panel, "gaps", qtbot).axes
    assert throat.get_xlabel() == "throat [mesh units]"
    [line, dot] = throat.lines
    assert (line.get_gid(), len(line.get_xdata())) == ("undeformed", 25)
    assert dot.get_ydata() == pytest.approx([0.0], abs=1e-9)
    drawn_kind(panel, "span", qtbot)
    panel.coordinate.show_value("span")
    [axes] = drawn_kind(panel, "span", qtbot).axes
    assert axes.get_ylabel() == "span before deformation [-]"
    assert axes.get_ylim() == pytest.approx((0.0, 1.0))


def test_what_is_no_machine_is_told_in_the_plot(full, qtbot):
    [text] = drawn_kind(full, "meridional", qtbot).texts
    assert "needs a mesh in 3D" in text.get_text() or "do not say" in text.get_text()
    [text] = drawn_kind(full, "gaps", qtbot).texts
    assert "no blade" in text.get_text() or "one blade" in text.get_text()


def test_another_mesh_is_begun_with(full):
    full.store.put(Session())
    assert full.area.shows_text
    assert full.coordinate.count() > 0


def test_it_is_dark_in_the_dark(full, qtbot):
    with qtbot.waitSignal(full.canvas.drawn):
        full.take_theme(DARK)
    assert full.canvas.grab().toImage().pixelColor(3, 3).name() == DARK.background


def test_the_plot_is_saved(full, tmp_path, answers):
    asked = answers("ask_save", tmp_path / "steps.svg")
    QTest.mouseClick(full.save, Qt.MouseButton.LeftButton)
    assert asked[0][1].name == "quality_by_step.png"
    assert b"<svg" in (tmp_path / "steps.svg").read_bytes()


def test_another_plot_does_not_show_the_one_before_meanwhile(full, qtbot):
    canvas, row_activated = full.canvas, []
    before = full.grab().toImage()
    with qtbot.waitSignal(canvas.drawn):
        choose(full, "span")
        assert canvas.wiped
        canvas.picked = row_activated.append
        QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=QPoint(150, 100))
        assert not row_activated, "its axes are no longer there"
        shown, ground = canvas.grab().toImage(), canvas.scheme.background
        corners = {shown.pixelColor(x, y).name() for x in (3, 290) for y in range(20, 90, 7)}
        assert corners <= {ground, canvas.scheme.background_top}, "nothing of the old plot"
        assert full.grab().toImage() != before
    qtbot.waitUntil(lambda: not canvas.wiped)
    (axes,) = canvas.figure.axes
    assert axes.get_ylabel().endswith("before deformation [mesh units]")
