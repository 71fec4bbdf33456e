"""Points of a curve over the span are moved, added and removed, by mouse and by keys."""

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QPointF, Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtTest import QTest

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate
from slideviz.case.motions.span import SpanMotion
from slideviz.gui.widgets.span_curve import SpanCurveField
from slideviz.machine.blade import curve_at
from slideviz.session import jobs
from tests.builders import passage

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

KEYS = Qt.Key


@pytest.fixture
def field(qtbot):
    made = SpanCurveField()
    made.show_motion(SpanMotion("blade", "twist", (0.0, 0.5, 1.0), (0.0, 1.5, 4.0)))
    made.resize(300, 240)
    qtbot.addWidget(made)
    with qtbot.waitExposed(made):
        made.show()
    made.setFocus()
    return made


@pytest.fixture
def heard(field):
    made = []
    field.changed.connect(
        lambda motion: made.append(tuple(zip(motion.spans, motion.values, strict=True)))
    )
    field.dragging.connect(made.append)
    return made


def drag(qtbot, field, start, end, release=True):
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    at, to = field.place(*start), field.place(*end)
    QTest.mousePress(field, left, none, at.toPoint())
    for part in (0.5, 1.0):
        place = at + part * (to - at)
        event = QMouseEvent(
            QEvent.Type.MouseMove, place, field.mapToGlobal(place), left, left, none
        )
        field.mouseMoveEvent(event)
        qtbot.wait(5)
    if release:
        QTest.mouseRelease(field, left, none, to.toPoint())


def test_a_point_follows_the_mouse_and_each_move_is_told(field, heard, qtbot):
    drag(qtbot, field, (1.0, 4.0), (1.0, 2.0))
    assert heard[0] is True
    assert heard[-1] is False
    told = [points[2] for points in heard if not isinstance(points, bool)]
    assert len(told) >= 2
    assert told[-1] == field.value[2]
    assert field.value[2][0] == 1.0
    assert field.value[2][1] == pytest.approx(2.0, abs=0.1)
    assert field.value[:2] == ((0.0, 0.0), (0.5, 1.5))


def test_a_point_stays_between_its_neighbours_and_within_the_walls(field, qtbot):
    drag(qtbot, field, (0.5, 1.5), (1.3, 1.5))
    assert field.value[1][0] == pytest.approx(0.99)
    drag(qtbot, field, (0.0, 0.0), (-0.2, 0.0))
    assert field.value[0] == (0.0, pytest.approx(0.0, abs=0.1))


def test_escape_takes_a_drag_back(field, heard, qtbot):
    before = field.value
    drag(qtbot, field, (0.5, 1.5), (0.7, 3.0), release=False)
    assert field.value != before
    field.show_motion(SpanMotion("blade", "twist", (0.0,), (9.0,)))  # does not take the point
    QTest.keyClick(field, KEYS.Key_Escape)
    assert field.value == before
    assert heard[-2:] == [before, False]


def test_a_double_click_adds_a_point_and_delete_removes_it(field, qtbot, heard):
    QTest.mouseDClick(field, Qt.MouseButton.LeftButton, pos=field.place(0.25, 3.0).toPoint())
    assert [span for span, _ in field.value] == [0.0, pytest.approx(0.25, abs=0.02), 0.5, 1.0]
    assert field.value[1][1] == pytest.approx(3.0, abs=0.1)
    QTest.mouseRelease(field, Qt.MouseButton.LeftButton)
    QTest.keyClick(field, KEYS.Key_Delete)
    assert field.value == ((0.0, 0.0), (0.5, 1.5), (1.0, 4.0))
    qtbot.waitUntil(lambda: heard[-1:] == [field.value])
    for _ in range(4):
        QTest.keyClick(field, KEYS.Key_Delete)
    assert len(field.value) == 1


def test_keys_choose_move_and_add_points(field, qtbot, heard):
    QTest.keyClick(field, KEYS.Key_PageDown)
    QTest.keyClick(field, KEYS.Key_Right)
    (_, (span, value), _) = field.value
    assert (span, value) == (0.5, 1.6)
    QTest.keyClick(field, KEYS.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert field.value[1][1] < 1.5
    QTest.keyClick(field, KEYS.Key_Up)
    assert field.value[1][0] == pytest.approx(0.51)
    assert field.accessibleDescription().startswith("51 %: ")
    QTest.keyClick(field, KEYS.Key_Insert)
    spans = [span for span, _ in field.value]
    assert spans == pytest.approx([0.0, 0.51, 0.76, 1.0], abs=0.011)
    # The new one is on the curve, and is the chosen one.
    before = (0.0, spans[1], 1.0), (0.0, field.value[1][1], 4.0)
    assert field.value[2][1] == pytest.approx(curve_at(*before, np.array([0.76]))[0][0], abs=0.1)
    QTest.keyClick(field, KEYS.Key_Delete)
    qtbot.waitUntil(lambda: heard[-1:] == [field.value])
    assert [span for span, _ in field.value] == [0.0, pytest.approx(0.51), 1.0]


def test_points_from_outside_are_shown(field, heard):
    field.show_motion(SpanMotion("blade", "twist", (0.2,), (30.0,)))
    assert field.value == ((0.2, 30.0),)
    assert field._axes().contains(field.place(0.2, 30.0))
    assert field._axes().contains(field.place(0.0, 0.0))
    assert field.accessibleDescription() == "20 %: 30°"
    assert not heard
    assert not field.grab().isNull()
    assert isinstance(field.place(0.2, 30.0), QPointF)


@pytest.fixture
def editor(driver, tmp_path):
    """The editor of a motion over the span that was just added to a blade between two walls."""
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    case = Case(roles=roles, periodic_type="rotational")
    made = passage((4, 6, 8), 30.0), tmp_path / "ring.su2", case
    driver.window.show_opened(jobs.prepare(*made, jobs.Job()))
    driver.add_motion(SpanMotion)
    return driver.window.motions.editor


def test_a_motion_over_the_span_is_dragged_typed_and_undone(editor, driver, qtbot):
    store, drawn = driver.window.store, editor.drawn

    def motion():
        (found,) = driver.session.case.motions
        return found

    assert motion() == SpanMotion("blade", "twist", (0.0, 1.0), (0.0, 0.0))
    drawn.setFocus()
    QTest.keyClick(drawn, KEYS.Key_Right)
    qtbot.waitUntil(lambda: motion().values[1] > 0.0)
    driver.type(editor.curve, "0:0, 1:3")
    assert drawn.value == ((0.0, 0.0), (1.0, 3.0))
    before = driver.window.scene.motion_ghosts["blade"]
    drag(qtbot, drawn, (1.0, 3.0), (1.0, 1.0), release=False)
    assert store.dragging
    assert motion().values[1] == pytest.approx(1.0, abs=0.1)
    assert not np.allclose(driver.window.scene.motion_ghosts["blade"], before)
    QTest.mouseRelease(drawn, Qt.MouseButton.LeftButton)
    assert not store.dragging
    assert editor.curve.text() == f"0:0, 1:{motion().values[1]:g}"
    store.undo()
    assert motion().values == (0.0, 3.0)
    assert drawn.value == ((0.0, 0.0), (1.0, 3.0))
    driver.choose(editor.change, "stagger")
    QTest.keyClick(drawn, KEYS.Key_Insert)  # one angle for the whole span
    assert len(drawn.value) == 1
    driver.choose(editor.change, "chord")
    drag(qtbot, drawn, (1.0, 1.0), (1.0, -2.0))
    assert motion().values == (1.0, 0.01), "as small as a chord can be drawn"
    driver.choose(editor.kind, Rotate)
    assert not drawn.isVisibleTo(editor)


@pytest.mark.parametrize(
    ("typed", "rule"),
    [
        ("0:0, 2:3", "the spans 0, 2 do not ascend from 0 to 1; sort"),
        ("0:0, 1:x", "'x' is not a number"),
        ("abc", "'abc' is not a number"),
        ("0:0, 1", "'0:0, 1' is not a curve over the span; write span:value"),
    ],
)
def test_an_invalid_curve_keeps_runs_from_starting(editor, driver, typed, rule):
    window, field = driver.window, editor.curve
    run, status = window.run_panel.run, window.statusBar()
    driver.type(field, "0:0, 1:3")
    QTest.keyClick(field, KEYS.Key_Return)
    assert run.isEnabled()
    driver.type(field, typed)
    assert field.property("bad")
    ((place, said),) = driver.session.invalid
    assert (place, said.startswith(f"Over span: {rule}")) == ("motion", True)
    assert not run.isEnabled()
    QTest.keyClick(field, KEYS.Key_F5)
    window.start_run()
    assert not driver.session.runs
    QTest.keyClick(field, KEYS.Key_Tab)
    assert status.currentMessage().startswith(f"Invalid: {rule}")
    assert field.text() == typed
    assert not run.isEnabled()
    driver.click(field)
    QTest.keyClick(field, KEYS.Key_Escape)
    assert (field.text(), driver.session.invalid) == ("0:0, 1:3", ())
    assert not status.currentMessage()
    assert run.isEnabled()


def test_another_motion_takes_an_invalid_curve_and_its_message_away(editor, driver):
    window, field = driver.window, editor.curve
    driver.type(field, "0:0, 1:3")
    driver.add_motion(SpanMotion)
    driver.type(field, "abc")
    QTest.keyClick(field, KEYS.Key_Tab)
    assert window.statusBar().currentMessage().startswith("Invalid: 'abc'")
    window.motions.list.setCurrentRow(0)
    assert (field.text(), driver.session.invalid) == ("0:0, 1:3", ())
    assert not window.statusBar().currentMessage()
    assert window.run_panel.run.isEnabled()
    window.motions.list.setCurrentRow(1)
    assert field.text() == "0:0, 1:0"
    assert not field.property("bad")


def test_a_curve_that_moves_nothing_is_not_ready(editor, driver):
    panel = driver.window.run_panel
    for kind, moves in (("twist", "0:0, 1:3"), ("chord", "0:1, 1:1.1")):
        driver.choose(editor.change, kind)
        assert "Nothing moves yet" in panel.text.text()
        assert not panel.run.isEnabled()
        driver.type(editor.curve, moves)
        assert panel.run.isEnabled()
