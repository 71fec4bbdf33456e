"""While the mouse turns a large mesh, boundaries have fewer facets; at rest all of them."""

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.gui.viewport import viewing as view_mouse
from slideviz.mesh import surfaces
from slideviz.mesh.surfaces import padded
from slideviz.samples.table import write_sample
from slideviz.scene.actors import VALUES
from slideviz.scene.pick import to_display
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.measure import HINT
from tests.windows import come_to_rest

pytestmark = pytest.mark.window("shared")


@pytest.fixture(scope="module")
def stator_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder, 6000)
    return folder / "stator.cfg"


@pytest.fixture
def stator(driver, stator_file, monkeypatch, qtbot):
    monkeypatch.setattr(surfaces, "LEAST", 0)
    monkeypatch.setattr(surfaces, "CUBES", 10)
    monkeypatch.setattr(view_mouse, "SLOW_FRAME_S", -1.0)
    driver.open(stator_file)
    qtbot.waitUntil(lambda: not driver.window.view.veiled)
    return driver


def shown(scene):
    """Return the boundaries drawn with all facets, and those with fewer."""
    every = scene.plotter.renderer.actors.items()
    names = [name for name, actor in every if actor.GetVisibility()]
    return [{n[7:] for n in names if n.startswith(kind)} for kind in ("marker:", "coarse:")]


def press_and_move(view):
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(150, 150))
    for k in range(1, 4):
        QTest.mouseMove(view, QPoint(150 + 20 * k, 150))


def test_turning_draws_fewer_facets_until_the_button_is_up(stator):
    view, scene = stator.window.view, stator.window.scene
    names = set(stator.session.mesh.marker_names)
    whole = view.snapshot()
    assert shown(scene) == [names, set()]
    press_and_move(view)
    assert scene.coarse
    assert shown(scene) == [set(), names]
    moving = view.snapshot()
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(210, 150))
    assert shown(scene) == [names, set()]
    after = view.snapshot()
    assert np.abs(after.astype(int) - whole).mean() > 1.0  # it was turned
    # Without holes and without a jump: nearly the same picture, but for the edges of the cells.
    assert np.abs(after.astype(int) - moving).mean() < 25.0


def test_a_mouse_that_rests_shows_all_facets_and_a_quick_picture_is_never_made_coarse(
    stator, qtbot, monkeypatch
):
    scene = stator.window.scene
    press_and_move(stator.window.view)
    assert scene.coarse
    qtbot.waitUntil(lambda: not scene.coarse)
    QTest.mouseRelease(stator.window.view, Qt.MouseButton.LeftButton, pos=QPoint(210, 150))
    monkeypatch.setattr(view_mouse, "SLOW_FRAME_S", 1e9)
    press_and_move(stator.window.view)
    assert not stator.window.scene.coarse
    QTest.mouseRelease(stator.window.view, Qt.MouseButton.LeftButton, pos=QPoint(210, 150))


def test_a_movement_of_the_mouse_is_drawn_once(stator, qtbot):
    view = stator.window.view
    come_to_rest()
    drawn = []
    tag = view.renderer.AddObserver("EndEvent", lambda *_: drawn.append(1))
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(150, 150))
    come_to_rest()
    counts = []
    for x in (180, 210, 240):
        qtbot.waitUntil(lambda: not view._repaints._timer.isActive())
        come_to_rest()
        drawn.clear()
        QTest.mouseMove(view, QPoint(x, 150))
        assert not drawn
        qtbot.waitUntil(lambda: bool(drawn))
        qtbot.wait(30)
        counts.append(len(drawn))
    # On a busy machine something else may be drawn late, between two movements.
    assert min(counts) == 1
    view.renderer.RemoveObserver(tag)
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(240, 150))


def test_a_section_that_is_dragged_goes_with_fewer_facets_and_what_changes_meanwhile_is_drawn(
    stator, qtbot
):
    window, scene = stator.window, stator.window.scene
    place = tuple(stator.session.mesh.points.mean(axis=0).tolist())
    window.store.change(changes.add_section, Section("plane", place, (0, 0, 1)))
    assert not scene.coarse
    section = scene.sections.drawn["section:0"].actor.prop
    assert section.show_edges
    window.store.set_dragging(True)
    other = Section("plane", (*place[:2], place[2] + 0.001), (0, 0, 1))
    window.store.change(changes.replace_section, 0, other)
    assert scene.coarse
    assert not section.show_edges
    window.store.set_dragging(False)
    qtbot.waitUntil(lambda: not scene.coarse)
    assert section.show_edges
    window, scene = stator.window, stator.window.scene
    press_and_move(window.view)
    name = stator.session.mesh.marker_names[0]
    window.store.change(changes.set_view, color_by="size-skew")
    window.store.change(changes.show_boundaries, (name,), shown=False)
    every, some = shown(scene)
    assert not every
    assert name not in some
    one = next(iter(scene._coarse.drawn.values()))
    values = stator.session.frame.quality.values[one.surface.owner]
    np.testing.assert_array_equal(one.shape.cell_data[VALUES], values)
    QTest.mouseRelease(window.view, Qt.MouseButton.LeftButton, pos=QPoint(210, 150))
    every, some = shown(scene)
    assert not some
    assert name not in every


def click(window, node, view=None):
    """Click where a node is seen, as a user does: the mouse has to be there."""
    view = view or window.view
    view.snapshot()
    place = padded(window.store.session.frame.mesh.points[[node]])
    x, y = to_display(view, place)[0] / view.devicePixelRatioF()
    where = QPoint(round(x), round(view.height() - 1 - y))
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, pos=where)


def picks(window):
    return [pick.nodes for pick in window.store.session.view.picks]


def test_points_are_measured_by_clicks_copied_and_taken_back_by_esc(driver, with_runs):
    with_runs({"sliding": "ps", "steps": 1})
    window = driver.window
    acts = window.actions_table.by_name
    assert not acts["copy_measure"].isEnabled()
    assert "Pick points first" in acts["copy_measure"].toolTip()
    window.view.setFocus()
    QTest.keyClick(window.view, Qt.Key.Key_D, Qt.KeyboardModifier.ShiftModifier)
    assert acts["measure"].isChecked()
    assert window.statusBar().currentMessage() == HINT
    assert window.view.cursor().shape() == Qt.CursorShape.CrossCursor
    mesh = driver.session.frame.mesh
    corners = [int((mesh.points @ np.array(way)).argmin()) for way in ((1, 1), (-1, 1), (1, -1))]
    selected = driver.session.view.selected
    click(window, corners[0])
    assert picks(window) == [(corners[0],)]
    assert "the nearest other boundary" in window.statusBar().currentMessage()
    click(window, corners[1])
    length = np.linalg.norm(np.diff(mesh.points[corners[:2]], axis=0))
    assert window.statusBar().currentMessage().startswith(f"Distance {length:.6g}: Δx ")
    QTest.keyClick(
        window.view,
        Qt.Key.Key_D,
        Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.ControlModifier,
    )
    assert QApplication.clipboard().text().startswith(f"Distance {length:.6g}: Δx ")
    assert window.statusBar().currentMessage().startswith("Copied: Distance")
    click(window, corners[2])
    assert picks(window) == [(corner,) for corner in corners]
    assert window.statusBar().currentMessage().startswith("Angle ")
    assert driver.session.view.selected == selected, "a click selects no boundary meanwhile"
    window.store.change(changes.show_beside, changes.UNDEFORMED)
    driver.qtbot.waitUntil(lambda: window.viewing.second.isVisible())
    assert "in the other view" in window.statusBar().currentMessage()
    window.viewing.second_scene.fit()
    click(window, corners[1], window.viewing.view)
    assert picks(window) == [(corners[1],)], "the fourth is a first one"
    window.store.change(changes.show_beside, None)
    QTest.keyClick(window.view, Qt.Key.Key_Escape)
    assert picks(window) == []
    assert window.statusBar().currentMessage() == HINT
    QTest.keyClick(window.view, Qt.Key.Key_Escape)
    assert driver.session.view.picks is None
    assert window.statusBar().currentMessage() == ""
    assert window.view.cursor().shape() != Qt.CursorShape.CrossCursor
    names = ("airfoil", "inflow")
    window.store.change(changes.select, names)
    acts["measure"].trigger()
    assert len(picks(window)) == 2
    assert window.statusBar().currentMessage().startswith("Distance ")
    acts["measure"].trigger()
    click(window, int(mesh.marker("inflow").nodes[3]))
    assert driver.session.view.selected == ("inflow",), "clicks select again"
