"""The handle of what is chosen, by mouse and keys: motions of boundaries in 3D and 2D."""

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QPoint, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.case.motion_words import describe
from slideviz.case.motions.box import Ffd
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.samples.table import write_sample
from slideviz.scene import handle
from slideviz.scene.ghosts import CHOSEN
from slideviz.scene.pick import to_display
from slideviz.session import changes
from slideviz.session.motions import lattices

pytestmark = pytest.mark.window("shared")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder, size=5000)
    return folder / "stator.cfg"


@pytest.fixture
def blade(window, driver, wheel):
    """A blade without motions, selected by a click on its row."""
    driver.open(wheel)
    window.store.change(changes.remove_motion, 0)
    driver.click_row("BLADE")
    window.view.snapshot()
    window.view.setFocus()
    return window.viewing.handles[window.view]


def motions(window):
    return window.store.session.case.motions


def where(view, pixel):
    x, y = np.asarray(pixel) / view.devicePixelRatioF()
    return QPoint(round(x), round(view.height() - 1 - y))


def place_of(mouse, grip):
    """The pixel where the mouse takes a part of the handle."""
    mouse.view.snapshot()
    part = next(part for part in mouse.parts if part.grip == grip)
    return part.line[len(part.line) // 2] if len(part.line) > 2 else part.line.mean(axis=0)


def drag(mouse, grip, by, modifier=Qt.KeyboardModifier.NoModifier, release=True):
    """Drag a part of the handle by some pixels, as the mouse does."""
    view, start = mouse.view, place_of(mouse, grip)
    QTest.mousePress(view, Qt.MouseButton.LeftButton, modifier, where(view, start))
    for share in (0.3, 1.0):
        move(mouse, start + share * np.array(by), modifier)
    if release:
        end = where(view, start + np.array(by))
        QTest.mouseRelease(view, Qt.MouseButton.LeftButton, modifier, end)
        QApplication.processEvents()
    return start


def move(mouse, pixel, _modifier=None):
    QTest.mouseMove(mouse.view, where(mouse.view, pixel))
    QApplication.processEvents()


def keys(window, text, end=Qt.Key.Key_Return):
    for letter in text:
        QTest.keyClicks(window.view, letter)
    QTest.keyClick(window.view, end)
    QApplication.processEvents()


@pytest.mark.parametrize("perspective", [False, True])
def test_what_is_dragged_stays_under_the_mouse_and_is_undone_as_one(window, blade, perspective):
    window.store.change(changes.set_view, perspective=perspective)
    origin = blade.placed().origin
    camera = window.scene.camera.place
    drag(blade, ("move", ()), (60, -35))
    (motion,) = motions(window)
    before, after = to_display(window.view, np.stack([origin, origin + np.array(motion.vector)]))
    assert after - before == pytest.approx((60, -35), abs=1.0)
    assert blade.placed().origin == pytest.approx(origin + np.array(motion.vector))
    assert window.motions.editor.vector.value == motion.vector
    assert window.scene.camera.place[:9] == pytest.approx(camera[:9])
    drag(blade, ("move", ()), (-20, 10))
    assert len(motions(window)) == 1
    (last,) = motions(window)
    assert window.store.can_undo == f"drag ({describe(last, 3)})", "which motion, and its values"
    window.store.undo()
    assert motions(window) == (motion,)
    window.store.undo()
    assert motions(window) == ()


def test_arrows_rings_and_boxes_make_a_motion_of_each_kind(window, blade):
    drag(blade, ("move", (2,)), (0, 30))
    drag(blade, ("turn", (0,)), (10, 30))
    drag(blade, ("grow", (1,)), (15, 5))
    moved, turned, grown = motions(window)
    assert isinstance(moved, Translate)
    assert moved.vector[:2] == (0.0, 0.0) != moved.vector[1:]
    assert isinstance(turned, Rotate)
    assert turned.axis == (1.0, 0.0, 0.0)
    assert isinstance(grown, Scale)
    assert grown.factors[::2] == (1.0, 1.0)
    assert window.motions.list.currentRow() == 2
    # A row that is chosen has its handle; another one that nothing places has none.
    window.motions.list.setCurrentRow(0)
    assert window.store.session.motion_index == 0
    drag(blade, ("move", (2,)), (0, 10))
    assert len(motions(window)) == 3
    assert motions(window)[1:] == (turned, grown)


def test_a_click_on_the_current_motion_brings_its_handle_back(window, blade):
    drag(blade, ("move", (2,)), (0, 30))
    QTest.keyClick(window.view, Qt.Key.Key_Escape)
    assert blade.placed() is None
    row = window.motions.list
    assert row.currentRow() == 0
    place = row.visualItemRect(row.item(0)).center()
    QTest.mouseClick(row.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert window.store.session.view.handle == "motion"
    assert blade.placed() is not None


def test_escape_gives_back_what_was(window, blade):
    drag(blade, ("move", (0,)), (30, -20), release=False)
    assert len(motions(window)) == 1
    QTest.keyClick(window.view, Qt.Key.Key_Escape)
    QApplication.processEvents()
    assert motions(window) == ()
    assert "drag" not in window.store.can_undo
    QTest.mouseRelease(window.view, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    keys(window, "gx3", Qt.Key.Key_Escape)
    assert motions(window) == ()
    assert not window.store.dragging
    assert window.store.session.view.handle == "boundary"


def test_a_number_is_typed_and_stands_in_the_status_line_and_the_case(window, blade):
    move(blade, place_of(blade, ("move", ())) + 100.0)
    for letter in "gx0.0125":
        QTest.keyClicks(window.view, letter)
    QApplication.processEvents()
    assert window.statusBar().currentMessage().startswith("Move x: 0.0125 ")
    QTest.keyClick(window.view, Qt.Key.Key_Return)
    assert motions(window)[0].vector == (0.0125, 0.0, 0.0)
    keys(window, "gy-0.01")
    assert motions(window)[0].vector == (0.0125, -0.01, 0.0)
    keys(window, "s1.1")
    assert motions(window)[1].factors == pytest.approx((1.1, 1.1, 1.1))
    # The machine turns about its axis, unless another one is chosen.
    keys(window, "r5")
    assert (motions(window)[2].angle_deg, motions(window)[2].axis) == (5.0, (0.0, 0.0, 1.0))
    assert motions(window)[2].point == (0.0, 0.0, 0.0)
    window.store.undo()
    assert len(motions(window)) == 2


def test_in_a_machine_there_are_axial_radial_and_tangential(window, blade):
    origin = blade.placed().origin
    arm = origin[:2] / np.linalg.norm(origin[:2])
    for key, way in (
        ("a", (0.0, 0.0, 1.0)),
        ("r", (*arm, 0.0)),
        ("t", (-arm[1], arm[0], 0.0)),
    ):
        keys(window, f"g{key}0.004")
        assert motions(window)[0].vector == pytest.approx(0.004 * np.array(way), abs=1e-12)
        window.store.undo()
    assert motions(window) == ()


def test_control_snaps_and_shift_is_fine(window, blade):
    start = place_of(blade, ("move", (0,)))
    view = window.view
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=where(view, start))
    move(blade, start + np.array([50, -30]))
    whole = motions(window)[0].vector[0]
    QTest.keyPress(view, Qt.Key.Key_Control, Qt.KeyboardModifier.ControlModifier)
    QApplication.processEvents()
    snapped = motions(window)[0].vector[0]
    assert len(f"{snapped:.12g}".lstrip("-0.")) == 1
    assert snapped == pytest.approx(whole, rel=0.6)
    QTest.keyRelease(view, Qt.Key.Key_Control)
    QApplication.processEvents()
    assert motions(window)[0].vector[0] == whole
    end = where(view, start + np.array([50, -30]))
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=end)


def test_the_keys_are_the_views_while_nothing_has_a_handle(window, driver, blade):
    ghost = "motion_ghost" in window.store.session.view.drawn
    window.store.change(changes.select, ())
    QTest.keyClicks(window.view, "g")
    QApplication.processEvents()
    assert ("motion_ghost" in window.store.session.view.drawn) != ghost
    assert motions(window) == ()
    driver.click_row("BLADE")
    window.view.setFocus()
    keys(window, "gz0.01")
    assert ("motion_ghost" in window.store.session.view.drawn) != ghost
    assert len(motions(window)) == 1
    # In a field, a letter is a letter, and the handle waits.
    window.motions.editor.vector.fields[0].setFocus()
    QTest.keyClicks(window.motions.editor.vector.fields[0], "g")
    assert window.viewing.handles[window.view].drag is None


def test_keys_are_the_handles_where_the_mouse_is_though_a_panel_has_the_focus(
    window, driver, blade, qtbot
):
    ghost = "motion_ghost" in window.store.session.view.drawn
    driver.activate()
    move(blade, (200, 200))
    qtbot.waitUntil(window.view.underMouse)
    driver.click_row("BLADE")
    table = window.focusWidget()
    assert not window.view.hasFocus()
    move(blade, (210, 200))
    for letter in "gz0.01\r":
        QTest.keyClick(window.windowHandle(), letter)
    QApplication.processEvents()
    assert motions(window)[0].vector == (0.0, 0.0, 0.01)
    assert window.statusBar().currentMessage() == "Move z: 0.01", "what keys do next is past"
    # Outside the view, they are those of the window.
    table.setFocus()
    QApplication.sendEvent(window.view, QEvent(QEvent.Type.Leave))
    QTest.keyClick(window.windowHandle(), "g")
    QApplication.processEvents()
    assert ("motion_ghost" in window.store.session.view.drawn) != ghost
    assert window.viewing.handles[window.view].drag is None


def test_it_comes_and_goes_with_what_is_chosen(window, driver, blade):
    assert handle.NAME in window.view.actors
    driver.click_row("HUB")
    window.view.snapshot()
    assert handle.NAME not in window.view.actors
    driver.click_row("BLADE")
    window.view.snapshot()
    assert handle.NAME in window.view.actors
    window.store.change(changes.set_role, ("BLADE",), "fixed")
    window.view.snapshot()
    assert handle.NAME not in window.view.actors


def test_a_click_beside_it_gives_the_view_its_keys_and_escape_puts_it_away(window, blade):
    window.motions._add(Translate)
    press(window, (5.0, 5.0))
    assert window.view.hasFocus()
    assert window.store.session.view.handle == "motion"
    keys(window, "gz0.01")
    assert motions(window)[0].vector == (0.0, 0.0, 0.01)
    QTest.keyClick(window.view, Qt.Key.Key_Escape)
    QApplication.processEvents()
    assert window.store.session.view.handle == ""
    window.view.snapshot()
    assert handle.NAME not in window.view.actors


def test_another_field_ends_what_a_key_began(window, blade):
    for letter in "gz0.01":
        QTest.keyClicks(window.view, letter)
    QApplication.processEvents()
    window.motions.editor.vector.fields[0].setFocus()
    QApplication.processEvents()
    assert blade.drag is None
    assert not window.store.dragging
    assert motions(window)[0].vector == (0.0, 0.0, 0.01)


def test_what_is_dragged_beside_it_turns_the_view(window, blade):
    camera = window.scene.camera.place
    start = place_of(blade, ("move", ())) + np.array([0, 160.0])
    view = window.view
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=where(view, start))
    for share in (0.5, 1.0):
        move(blade, start + 40.0 * share)
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=where(view, start + 40.0))
    QApplication.processEvents()
    assert window.scene.camera.place != camera
    assert motions(window) == ()


def test_what_the_mouse_would_take_is_shown(window, blade, qtbot):
    move(blade, place_of(blade, ("move", (0,))))
    qtbot.waitUntil(lambda: window.view.cursor().shape() == Qt.CursorShape.SizeAllCursor)
    move(blade, (5, 5))
    qtbot.waitUntil(lambda: window.view.cursor().shape() == Qt.CursorShape.ArrowCursor)


def test_in_2d_it_moves_in_the_plane(window, driver, passage_file):
    driver.open(passage_file)
    name = next(iter(window.store.session.mesh.marker_names))
    window.store.change(changes.set_role, (name,), "moving")
    window.store.change(changes.select, (name,))
    window.view.snapshot()
    mouse = window.viewing.handles[window.view]
    grips = {part.grip for part in mouse.parts}
    assert ("move", (2,)) not in grips
    assert {("move", ()), ("move", (0,)), ("turn", (2,)), ("grow", (1,))} <= grips
    count = len(motions(window))
    drag(mouse, ("move", ()), (30, 20))
    assert len(motions(window)) == count + 1
    assert len(motions(window)[-1].vector) == 2
    window.view.setFocus()
    keys(window, "r-3.5")
    assert motions(window)[-1].angle_deg == -3.5
    # Nothing leaves the plane.
    keys(window, "rx4")
    assert motions(window)[-1].angle_deg == 4.0
    assert motions(window)[-1].axis == (0.0, 0.0, 1.0)
    for letter in "gy0.02":
        QTest.keyClicks(window.view, letter)
    keys(window, "z")
    moved = next(one for one in motions(window)[::-1] if isinstance(one, Translate))
    assert moved.vector[1] == 0.02
    drag(mouse, ("move", ()), (10, 0), release=False)
    shown = window.statusBar().currentMessage().split(")")[0].split("(")[1]
    moved = next(one for one in motions(window)[::-1] if isinstance(one, Translate))
    assert tuple(map(float, shown.split(","))) == moved.vector
    QTest.keyClick(window.view, Qt.Key.Key_Escape)


@pytest.fixture
def boxed(window, driver, blade):
    """A box around the blade, of which nothing is moved yet."""
    window.motions._add(Ffd)
    driver.click(window.motions.editor.new_box)
    window.view.snapshot()
    return blade


def control(window, *index):
    """The pixel of a control point."""
    session = window.store.session
    boxes, moved = lattices(session.case, session.mesh)
    window.view.snapshot()
    return to_display(window.view, (boxes | moved)["BOX"].points[index][None])[0]


def press(window, pixel, modifier=Qt.KeyboardModifier.NoModifier):
    QTest.mouseClick(window.view, Qt.MouseButton.LeftButton, modifier, where(window.view, pixel))
    QApplication.processEvents()


def test_a_control_point_is_chosen_by_a_click_marked_at_zero_and_dragged(window, driver, boxed):
    form = window.motions.editor
    assert form.degree.isVisible()
    for field, text in zip(form.degree.fields, "212", strict=True):
        driver.type(field, text)
    assert window.store.session.case.ffd_degrees == ((2, 1, 2),)
    selected = window.store.session.view.selected
    press(window, control(window, 2, 1, 2))
    (motion,) = motions(window)
    assert (motion.index, motion.vector) == ((2, 1, 2), (0.0, 0.0, 0.0))
    assert window.store.session.view.selected == selected
    window.view.snapshot()
    assert CHOSEN in window.view.actors
    start = control(window, 2, 1, 2)
    drag(boxed, ("move", ()), (25, 15))
    assert control(window, 2, 1, 2) - start == pytest.approx((25, 15), abs=1.0)
    (motion,) = motions(window)
    assert form.vector.value == motion.vector
    assert any(
        np.abs(
            points
            - window.store.session.mesh.points[window.store.session.mesh.marker("BLADE").nodes]
        ).max()
        > 1e-6
        for points in window.scene.motion_ghosts.values()
    )
    # Another point has a motion of its own, and the first one its own again.
    press(window, control(window, 0, 0, 0))
    assert [one.index for one in motions(window)] == [(2, 1, 2), (0, 0, 0)]
    press(window, control(window, 2, 1, 2))
    assert len(motions(window)) == 2
    assert window.motions.list.currentRow() == 0
    keys(window, "gz0.002")
    assert motions(window)[0].vector[2] == 0.002


def test_alt_takes_a_row_and_again_a_plane(window, driver, boxed):
    alt = Qt.KeyboardModifier.AltModifier
    ends = control(window, 0, 0, 0), control(window, 0, 0, 1)
    middle = 0.5 * (ends[0] + ends[1])
    seen = []
    for _ in range(2):
        press(window, middle, alt)
        seen.append(motions(window)[0].index)
    assert sum(index == -1 for index in seen[0]) == 1
    assert sum(index == -1 for index in seen[1]) == 2
    assert len(motions(window)) == 1
    assert window.store.session.view.marked_cell is None
    assert window.store.can_undo.startswith("control point")
