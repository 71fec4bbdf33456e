"""The handle of a cylinder through a 3D mesh: where it stands, and what the mouse does with it."""

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.gui.viewport.point_handle import AxisHandle
from slideviz.gui.viewport.section_views import PlaneHandle
from slideviz.samples.table import write_sample
from slideviz.scene.pick import to_display
from slideviz.session import changes

pytestmark = pytest.mark.window("shared")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder, size=5000)
    return folder / "stator.cfg"


@pytest.fixture
def panel(window, driver, wheel):
    driver.open(wheel)
    window.dock_manager.bring_to_front("sections")
    QApplication.processEvents()
    panel = window.dock_manager.panels["sections"]
    driver.click(panel.add["cylinder"])
    panel.handle.click()
    window.view.snapshot()
    return panel


def sections(window):
    return window.store.session.view.sections


def ball(window, view=None):
    """Where the ball is, in space."""
    handle = window.section_views.handles.of(view or window.view)
    (point,) = handle.section.surface(np.array([handle.place]), handle.section.size)
    return point


def pixel(view, point):
    x, y = to_display(view, np.asarray(point)[None])[0] / view.devicePixelRatioF()
    return np.array([x, view.height() - 1 - y])


def drag(view, start, end):
    """Drag from one pixel of the widget to another, through one between."""
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(*start.round().astype(int)))
    for share in (0.5, 1.0):
        where = QPoint(*(start + share * (end - start)).round().astype(int))
        QTest.mouseMove(view, where)
        QApplication.processEvents()
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=where)
    QApplication.processEvents()


def pull(window, radius, view=None):
    """Drag the ball to where that of another radius would be."""
    view = view or window.view
    point, (section, *_) = ball(window, view), sections(window)
    out = section.frame(point[None])[0] * (1.0, 1.0, 0.0) @ section.basis
    there = point + (radius - section.radius) * out / np.linalg.norm(out)
    drag(view, pixel(view, point), pixel(view, there))


def marks(view):
    return {name for name in view.actors if name.startswith("handle:")}


def blue(view):
    """Pixels of the ball's color, (k, 2) from the lower left."""
    image = view.snapshot().astype(int)
    found = np.argwhere(np.abs(image - (0x2F, 0x6F, 0xB5)).max(axis=2) < 12)
    return np.column_stack([found[:, 1], len(image) - 1 - found[:, 0]])


@pytest.mark.parametrize("side", ["iso", pytest.param("-x", marks=pytest.mark.slow), "+z"])
def test_the_ball_is_seen_on_the_cut_in_front_of_all(window, panel, side):
    window.viewing.look_from(side)
    drawn = blue(window.view)
    assert len(drawn) > 30
    at = to_display(window.view, ball(window)[None])[0]
    assert np.abs(np.median(drawn, axis=0) - at).max() < 2.0
    cut = window.scene.sections.drawn["section:0"].polygons.points
    # Not at the other side of the machine.
    assert np.linalg.norm(cut - ball(window), axis=1).min() < 0.1 * np.ptp(cut, axis=0).max()


def test_it_is_pulled_to_another_radius_and_undone_as_one(window, panel):
    for perspective in (False, True):
        window.store.change(changes.set_view, perspective=perspective)
        window.viewing.look_from("iso")
        window.view.snapshot()
        (first,), camera = sections(window), window.scene.camera.place
        low, high = panel.editor._span
        wanted = high - 0.2 * (high - low)
        pull(window, wanted)
        (pulled,) = sections(window)
        assert pulled.radius == pytest.approx(wanted, abs=0.02 * (high - low))
        assert (pulled.origin, pulled.direction) == (first.origin, first.direction)
        assert len(str(pulled.radius)) <= 8
        assert panel.editor.number.value == pytest.approx(pulled.radius)
        assert window.scene.camera.place[:9] == pytest.approx(camera[:9])
        pull(window, low + 0.2 * (high - low))
        assert sections(window)[0].radius < first.radius
        window.store.undo()
        assert sections(window) == (pulled,)
        window.store.undo()
        assert sections(window) == (first,)


def test_that_of_a_cone_is_pulled_to_another_half_angle(window, driver, panel):
    driver.click(panel.add["cone"])
    window.viewing.look_from("iso")
    window.view.snapshot()
    first, point = sections(window)[1], ball(window)
    assert np.abs(first.distance(point[None])).max() < 1e-12
    assert len(blue(window.view)) > 30
    low, high = panel.editor._span
    handle = window.section_views.handles.of(window.view)
    for wanted in (high - 0.2 * (high - low), low + 0.2 * (high - low)):
        section, point = sections(window)[1], ball(window)
        (there,) = section.surface(np.array([handle.place]), wanted)
        drag(window.view, pixel(window.view, point), pixel(window.view, there))
        pulled = sections(window)[1]
        assert pulled.half_angle_deg == pytest.approx(wanted, abs=0.03 * (high - low))
        assert (pulled.origin, pulled.direction) == (first.origin, first.direction)
        assert panel.editor.number.value == pytest.approx(pulled.half_angle_deg)
    window.store.undo()
    window.store.undo()
    assert sections(window)[1] == first
    driver.click(panel.look)
    window.view.snapshot()
    start = pixel(window.view, ball(window))
    drag(window.view, start, start - np.array([0.0, 30.0]))
    assert sections(window)[1].half_angle_deg > first.half_angle_deg


def test_who_looks_along_the_radius_pulls_upwards(window, driver, panel):
    driver.click(panel.look)
    window.view.snapshot()
    eye = np.array(window.view.camera.position) - np.array(window.view.camera.focal_point)
    (before,) = sections(window)
    local = before.frame(np.stack([ball(window), ball(window) + eye]))
    out = np.hypot(*local[:, :2].T)
    assert out[1] - out[0] == pytest.approx(np.linalg.norm(eye), rel=0.05), "seen from outside"
    start = pixel(window.view, ball(window))
    drag(window.view, start, start - np.array([0.0, 30.0]))
    assert sections(window)[0].radius > before.radius
    start = pixel(window.view, ball(window))
    drag(window.view, start, start + np.array([0.0, 60.0]))
    assert sections(window)[0].radius < before.radius


def test_what_is_dragged_beside_it_turns_the_view(window, panel):
    camera, before = window.scene.camera.place, sections(window)
    start = pixel(window.view, ball(window)) + np.array([0.0, 60.0])
    drag(window.view, start, start + 40.0)
    assert window.scene.camera.place != camera
    assert sections(window) == before


def test_what_the_mouse_would_take_is_shown(window, panel, qtbot):
    at = QPoint(*pixel(window.view, ball(window)).round().astype(int))
    shapes = Qt.CursorShape
    QTest.mouseMove(window.view, at)
    qtbot.waitUntil(lambda: window.view.cursor().shape() == shapes.SizeAllCursor)
    assert len(blue(window.view)) < 10
    # It goes from below the mouse by itself.
    window.viewing.look_from("+z")
    window.scene.camera.aim(ball(window) + 0.01, 0.05, 1.0)
    window.view.snapshot()
    assert window.view.cursor().shape() == shapes.ArrowCursor
    assert len(blue(window.view)) > 30


def test_in_a_detail_it_is_in_reach_and_it_leaves_nothing(window, panel, driver):
    cut = window.scene.sections.drawn["section:0"].polygons.points
    corner = cut[np.argmax(np.linalg.norm(cut - ball(window), axis=1))]
    window.scene.camera.aim(corner, 0.1 * float(np.ptp(cut, axis=0).max()), 1.0)
    window.view.snapshot()
    x, y = pixel(window.view, ball(window))
    assert 0 < x < window.view.width()
    assert 0 < y < window.view.height()
    driver.click(panel.add["plane"])
    assert not marks(window.view)
    assert isinstance(window.section_views.handles.of(window.view), PlaneHandle)
    panel.list.setCurrentRow(0)
    assert isinstance(window.section_views.handles.of(window.view), AxisHandle)
    assert marks(window.view)
    assert marks(window.view)
    frame = window.view.actors["handle:frame"].mapper.dataset
    assert (frame.n_verts, frame.n_lines) == (0, 4)
    panel.handle.click()
    assert not marks(window.view)
    assert len(blue(window.view)) < 10
    panel.handle.click()
    assert marks(window.view)
    panel.list.item(0).setCheckState(Qt.CheckState.Unchecked)
    assert not marks(window.view)
    assert not panel.handle.isEnabled()


def test_beside_the_mesh_it_can_be_pulled_back(window, driver, panel):
    driver.type(panel.editor.number, "0.5")
    window.viewing.look_from("iso")
    window.view.snapshot()
    assert len(window.scene.sections.drawn["section:0"].polygons) == 0
    points = window.store.session.mesh.points
    assert np.linalg.norm(points - ball(window), axis=1).min() < 0.3
    handle = window.section_views.handles.of(window.view)
    start = pixel(window.view, ball(window))
    x, y = start
    if not (0 < x < window.view.width() and 0 < y < window.view.height()):
        window.scene.camera.aim(ball(window), 0.5, 1.0)
        window.view.snapshot()
    pull(window, 0.3)
    assert sections(window)[0].radius == pytest.approx(0.3, abs=0.02)
    assert handle is window.section_views.handles.of(window.view)


def test_of_two_views_each_has_one(window, driver, panel):
    window.start_run()
    driver.settle()
    window.store.change(changes.show_beside, changes.UNDEFORMED)
    driver.qtbot.waitUntil(lambda: window.viewing.second.isVisible())
    QApplication.processEvents()
    second = window.viewing.second
    for view in (window.view, second):
        view.snapshot()
        assert marks(view)
    low, high = panel.editor._span
    wanted = low + 0.8 * (high - low)
    pull(window, wanted, second)
    assert sections(window)[0].radius == pytest.approx(wanted, abs=0.02 * (high - low))
    handles = window.section_views.handles
    assert handles.of(window.view).section == handles.of(second).section == sections(window)[0]
    window.store.change(changes.show_beside, None)
    assert handles.of(second) is None
    assert marks(window.view)
