"""The sections panel, the handle in the view, and the flat view, by mouse and keyboard."""

import gc
import re
import weakref

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QPoint, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QPushButton

from slideviz.case.motions.span import SpanMotion
from slideviz.gui.viewport.flat_views import (
    Ruler,
    arrangement_for,
    is_larger_stacked,
    nice_ticks,
    tick_text,
)
from slideviz.gui.widgets import questions
from slideviz.samples.table import write_sample
from slideviz.scene import handle
from slideviz.scene.handle import RING_PX
from slideviz.scene.pick import Projection, to_display
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.changes import selection_after

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture(autouse=True)
def sections_may_be_lost(monkeypatch):
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")


@pytest.fixture
def panel(window, driver, sample_folder):
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    window.dock_manager.bring_to_front("sections")
    QApplication.processEvents()
    return window.dock_manager.panels["sections"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder, size=5000)
    return folder / "stator.cfg"


def sections(window):
    return window.store.session.view.sections


def drag(slider, to):
    """Drag a slider to a share of its way, through all between."""
    style_room = 10
    width = slider.width() - 2 * style_room
    at = style_room + slider.value() / slider.maximum() * width
    y = slider.height() // 2
    QTest.mousePress(slider, Qt.MouseButton.LeftButton, pos=QPoint(round(at), y))
    for x in np.linspace(at, style_room + to * width, 5)[1:]:
        QTest.mouseMove(slider, QPoint(round(x), y))
        QApplication.processEvents()
    assert slider.isSliderDown()
    QTest.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=QPoint(round(x), y))
    QApplication.processEvents()


def test_a_plane_is_added_moved_shown_whole_and_removed_and_each_drag_undone_as_one(
    window, driver, panel
):
    driver.click(panel.add["plane"])
    (plane,) = sections(window)
    assert plane.kind == "plane"
    assert panel.list.item(0).text() == plane.describe()
    before = window.scene.sections.drawn["section:0"].polygons.cell_ids
    drag(panel.editor.slider, 0.9)
    (moved,) = sections(window)
    low, high = panel.editor._span
    share = (np.dot(moved.origin, moved.direction) - low) / (high - low)
    assert share == pytest.approx(0.9, abs=0.05)
    assert panel.editor.number.value == pytest.approx(np.dot(moved.origin, moved.direction))
    assert set(window.scene.sections.drawn["section:0"].polygons.cell_ids) != set(before)
    QTest.mouseClick(
        panel.editor.whole,
        Qt.MouseButton.LeftButton,
        pos=QPoint(8, panel.editor.whole.height() // 2),
    )
    assert sections(window)[0].whole_cells
    driver.click(panel.remove)
    assert sections(window) == ()
    assert "section:0" not in window.scene.plotter.actors
    assert panel.hint.isVisible()
    driver.click(panel.add["plane"])
    first = sections(window)
    drag(panel.editor.slider, 0.2)
    second = sections(window)
    drag(panel.editor.slider, 0.3)
    assert sections(window) not in (first, second)
    assert window.store.can_undo == "section"
    window.store.undo()
    assert sections(window) == second
    window.store.undo()
    assert sections(window) == first
    window.store.undo()
    assert sections(window) == ()
    assert window.section_views.section is None
    window.store.redo()
    assert sections(window) == first
    assert window.section_views.section == first[0]


def test_numbers_are_typed_also_of_a_free_normal(window, driver, panel):
    driver.click(panel.add["cylinder"])
    (cylinder,) = sections(window)
    assert cylinder.kind == "cylinder"
    driver.type(panel.editor.number, "0.4")
    assert sections(window)[0].radius == 0.4
    driver.type(panel.editor.number, "-1")
    assert sections(window)[0].radius == 0.4
    driver.type(panel.editor.centre.fields[0], "0.5")
    assert sections(window)[0].origin == (0.5, 0.0, 0.0)
    driver.choose(panel.editor.axis, "x")
    assert sections(window)[0].direction == (1.0, 0.0, 0.0)
    driver.click(panel.remove)
    driver.click(panel.add["plane"])
    assert not panel.editor.direction.isVisible()
    driver.choose(panel.editor.axis, "free")
    assert panel.editor.direction.isVisible()
    driver.type(panel.editor.direction.fields[1], "1")
    (plane,) = sections(window)
    assert plane.direction[1] == 1.0
    low, high = panel.editor._span
    assert low < panel.editor.number.value < high
    assert panel.list.item(0).text() == plane.brief()
    assert plane.describe() in panel.list.item(0).toolTip()
    driver.choose(panel.editor.axis, "y")
    assert sections(window)[0].direction == (0.0, 1.0, 0.0)
    assert not panel.editor.direction.isVisible()


def test_sections_are_added_by_keys_removed_by_delete_and_looked_at_along_their_normal(
    window, driver, panel
):
    window.dock_manager.bring_to_front("boundaries")
    QTest.keyClick(window, Qt.Key.Key_C)
    QTest.keyClick(window, Qt.Key.Key_C, Qt.KeyboardModifier.ShiftModifier)
    assert [section.kind for section in sections(window)] == ["plane", "cylinder"]
    assert panel.isVisible()
    panel.list.setFocus()
    QTest.keyClick(panel.list, Qt.Key.Key_Delete)
    assert [section.kind for section in sections(window)] == ["plane"]
    driver.click(panel.add["plane"])
    driver.choose(panel.editor.axis, "x")
    driver.click(panel.look)
    assert abs(np.array(window.view.camera.direction)[0]) == pytest.approx(1.0)


def test_in_2d_the_menu_offers_a_line_and_a_circle_whose_curve_is_saved(
    window, driver, flat_panel, answers, tmp_path
):
    actions = window.actions_table.by_name
    assert actions["add_plane"].text().replace("&", "") == "Cut by a line"
    assert actions["add_cylinder"].text().replace("&", "") == "Cut by a circle"
    QTest.keyClick(window, Qt.Key.Key_C, Qt.KeyboardModifier.ShiftModifier)
    assert [section.kind for section in sections(window)] == ["cylinder"]
    driver.click(flat_panel.add["cylinder"])
    flat_panel.flat.click()
    answers("ask_save", tmp_path / "along.svg")
    driver.click(window.section_views.flat.save_button)
    assert b"<svg" in (tmp_path / "along.svg").read_bytes()


@pytest.mark.usefixtures("painted")
def test_a_hidden_section_has_no_handle_no_flat_view_and_its_box_in_a_case(
    window, driver, panel, passage_file, tmp_path
):
    driver.click(panel.add["cylinder"])
    panel.flat.click()
    panel.handle.click()
    assert has_handle(window.view)
    panel.list.item(0).setCheckState(Qt.CheckState.Unchecked)
    assert window.section_views.flat is None
    assert not panel.flat.isEnabled()
    assert panel.flat.isChecked()
    assert not has_handle(window.view)
    assert not panel.handle.isEnabled()
    panel.list.item(0).setCheckState(Qt.CheckState.Checked)
    assert window.section_views.flat.scene.section.kind == "cylinder"
    assert panel.flat.isEnabled()
    driver.click(panel.remove)
    driver.click(panel.add["plane"])
    panel.list.item(0).setCheckState(Qt.CheckState.Unchecked)
    assert not sections(window)[0].shown
    hidden = window.store.session.view.sections
    driver.open(passage_file)
    assert panel.list.count() == 0
    window.store.change(changes.set_view, sections=hidden)
    box = panel.list.item(0).data(Qt.ItemDataRole.CheckStateRole)
    assert Qt.CheckState(box) == Qt.CheckState.Unchecked
    panel.list.item(0).setCheckState(Qt.CheckState.Checked)
    assert sections(window)[0].shown


def test_several_are_listed_hidden_and_chosen(window, driver, panel):
    driver.click(panel.add["plane"])
    driver.click(panel.add["cylinder"])
    assert [panel.list.item(row).text() for row in (0, 1)] == [
        section.describe() for section in sections(window)
    ]
    assert window.store.session.view.section_index == 1
    panel.list.item(1).setCheckState(Qt.CheckState.Unchecked)
    assert [section.shown for section in sections(window)] == [True, False]
    assert set(window.scene.sections.drawn) == {"section:0"}
    panel.list.setCurrentRow(0)
    assert window.section_views.section.kind == "plane"
    tip = panel.handle.toolTip()
    panel.list.setCurrentRow(1)
    assert panel.handle.toolTip() not in (tip, "")
    driver.click(panel.remove)
    assert [section.kind for section in sections(window)] == ["plane"]
    assert window.store.session.view.section_index == 0


def test_an_unrolled_cylinder_follows_radius_and_step_and_goes(window, driver, wheel):
    driver.open(wheel)
    window.dock_manager.bring_to_front("sections")
    panel = window.dock_manager.panels["sections"]
    driver.click(panel.add["cylinder"])
    assert panel.flat.text() == "Unrolled"
    panel.flat.click()
    flat = window.section_views.flat
    driver.qtbot.waitUntil(lambda: flat.view.isVisible() and flat.across.high > 0.01)
    QApplication.processEvents()
    before = flat.scene.polygons
    low, high = flat.scene.bounds()
    assert flat.across.low < low[0] < high[0] < flat.across.high
    assert flat.upright.low < low[1] < high[1] < flat.upright.high
    assert flat.across.name == "z"
    assert "cells cut" in flat.facts.text()
    drag(panel.editor.slider, 0.95)
    assert flat.scene.polygons is not before
    low, high = flat.scene.bounds()
    assert flat.across.low < low[0] < high[0] < flat.across.high
    assert flat.upright.low < low[1] < high[1] < flat.upright.high
    flat.view.signals.zoomed.emit(flat.view.rect().center(), 2.0)
    zoomed = flat.scene.ranges()
    assert np.ptp(zoomed[0]) == pytest.approx(flat.across.high - flat.across.low)
    drag(panel.editor.slider, 0.5)
    assert flat.scene.ranges() == zoomed
    assert f"{sections(window)[0].radius:.6g}" in flat.title.text
    driver.click(flat.title.close_button)
    assert window.section_views.flat is None
    assert not panel.flat.isChecked()


def test_a_section_of_constant_span_goes_to_10_50_and_90_percent(window, driver, wheel):
    driver.open(wheel)
    window.dock_manager.bring_to_front("sections")
    panel = window.dock_manager.panels["sections"]
    driver.click(panel.add["span"])
    assert sections(window)[0].walls.channels[0].hub == "HUB"
    assert not panel.editor.axis.isVisible()
    low, half, high = panel.editor.picks["span"].findChildren(QPushButton)
    assert [button.text() for button in (low, half, high)] == ["10 %", "50 %", "90 %"]
    driver.click(high)
    assert sections(window)[0].span == 0.9
    assert panel.editor.number.text() == "0.9"
    driver.click(low)
    assert sections(window)[0].span == 0.1
    drag(panel.editor.slider, 0.3)
    assert sections(window)[0].span == pytest.approx(0.3, abs=0.01)
    driver.click(panel.add["cylinder"])
    assert not panel.editor.picks["span"].isVisible()
    assert not panel.walls.isVisible()


def test_hub_and_shroud_are_chosen_beside_sections_and_motions_over_the_span(window, driver, wheel):
    driver.open(wheel)
    window.dock_manager.bring_to_front("sections")
    panel = window.dock_manager.panels["sections"]
    driver.click(panel.add["span"])
    hub, shroud = panel.walls.ends
    assert (hub.currentData(), shroud.currentData()) == ("HUB", "SHROUD"), "by their names"
    driver.choose(hub, "INFLOW")
    assert window.store.session.case.span == ("INFLOW", "SHROUD")
    assert sections(window)[0].walls is None
    assert "needs hub and shroud" in panel.list.item(0).text()
    assert not panel.editor.isVisible()
    assert panel.walls.isVisible()
    driver.add_motion(SpanMotion)
    assert "do not face each other" in window.run_panel.text.toolTip()
    # The same two fields, in the form of the motion.
    driver.choose(window.motions.editor.walls.ends[0], "HUB")
    assert window.store.session.case.span is None
    assert (hub.currentData(), sections(window)[0].walls.channels[0].hub) == ("HUB", "HUB")
    window.store.undo()
    assert window.store.session.case.span == ("INFLOW", "SHROUD")


def test_a_section_of_constant_span_waits_until_hub_and_shroud_are_chosen(window, driver, panel):
    driver.click(panel.add["span"])
    assert sections(window)[0].walls is None
    assert "do not say between which the span goes" in window.banner.text.text()
    hub, shroud = panel.walls.ends
    assert (hub.shown, shroud.shown) == ("Hub…", "Shroud…")
    low, high = window.store.session.mesh.marker_names[:2]
    driver.choose(hub, low)
    assert window.store.session.case.span is None, "only one is chosen"
    driver.choose(shroud, high)
    assert window.store.session.case.span == (low, high)


def test_the_flat_view_comes_back_from_the_case_file(window, driver, panel, tmp_path, answers):
    driver.click(panel.add["plane"])
    driver.click(panel.add["cylinder"])
    panel.flat.click()
    assert window.section_views.flat.scene.section.kind == "cylinder"
    answers("ask_save", tmp_path / "again.cfg")
    window.actions_table.by_name["save_case"].trigger()
    assert "cut, unrolled)" in (tmp_path / "again.cfg").read_text()
    window.store.undo()
    assert window.section_views.flat is None
    driver.open(tmp_path / "again.cfg")
    assert window.section_views.flat.scene.section.kind == "cylinder"
    assert window.store.session.view.section_index == 1
    assert panel.flat.isChecked()


@pytest.mark.usefixtures("painted")
def test_a_cone_is_added_slid_typed_unrolled_and_kept(window, driver, wheel, tmp_path, answers):
    driver.open(wheel)
    window.dock_manager.bring_to_front("sections")
    panel = window.dock_manager.panels["sections"]
    window.actions_table.by_name["add_cone"].trigger()
    (cone,) = sections(window)
    assert panel.list.item(0).toolTip() == cone.describe()
    editor = panel.editor
    assert (editor.axis_name.text(), editor.place_name.text()) == ("Axis", "Half angle")
    assert editor.centre_name.text() == "Apex"
    assert editor.axis.currentData() == "z"
    drawn = window.scene.sections.drawn["section:0"]
    before = drawn.polygons
    drag(editor.slider, 0.8)
    assert sections(window)[0].half_angle_deg != cone.half_angle_deg
    assert sections(window)[0].origin == cone.origin
    assert drawn.polygons is not before
    slid = sections(window)[0].half_angle_deg
    assert "not below 90" in editor._allowed(90.0)
    driver.type(editor.number, "90")
    assert sections(window)[0].half_angle_deg == pytest.approx(slid, rel=1e-5), "no cone is so flat"
    driver.type(editor.number, "9.5")
    driver.type(editor.centre.fields[2], "-1.6")
    assert sections(window)[0].describe() == "cone 9.5° about z from apex (0, 0, -1.6)"
    window.store.change(changes.set_view, passages=1)
    panel.flat.click()
    flat = window.section_views.flat
    driver.qtbot.waitUntil(lambda: flat.view.isVisible() and flat.across.high > 0.01)
    assert flat.title.text == sections(window)[0].describe()
    assert flat.across.name == "s cos(θ sin α)"
    low, high = flat.scene.bounds()
    assert low[1] == pytest.approx(-high[1], rel=0.1), "level, with a passage on each side"
    assert len(flat.scene._instances.drawn) == 2
    answers("ask_save", tmp_path / "again.cfg")
    window.actions_table.by_name["save_case"].trigger()
    text = (tmp_path / "again.cfg").read_text()
    assert "(cone, 9.5, 0.0, 0.0, 1.0, 0.0, 0.0, -1.6, cut, unrolled)" in text
    kept = sections(window)
    driver.open(tmp_path / "again.cfg")
    assert sections(window) == kept
    assert window.section_views.flat.scene.section == kept[0]


def test_a_cone_that_opens_backwards_has_no_axis_of_the_list_and_a_2d_mesh_offers_none(
    window, driver, panel, passage_file
):
    driver.click(panel.add["cone"])
    editor = panel.editor
    editor.axis.setCurrentIndex(editor.axis.findData("free"))
    editor.axis.activated.emit(editor.axis.currentIndex())
    driver.type(editor.direction.fields[2], "-1")
    panel.list.setCurrentRow(-1)
    driver.click(panel.add["plane"])
    panel.list.setCurrentRow(0)
    assert editor.axis.currentData() == "free"
    assert "about -z" in panel.list.item(0).toolTip()
    assert panel.add["cone"].isVisible()
    driver.open(passage_file)
    assert not panel.add["cone"].isVisible()
    action = window.actions_table.by_name["add_cone"]
    assert not action.isVisible()
    assert not action.isEnabled()


def test_what_is_chosen_and_its_handle_are_undone(window, driver, panel):
    driver.click(panel.add["plane"])
    driver.click(panel.add["cylinder"])
    panel.list.setCurrentRow(0)
    panel.handle.click()
    view = window.view
    assert has_handle(view)
    undo, redo = window.store.undo, window.store.redo
    assert window.store.can_undo == "handle shown or hidden"
    undo()
    assert not has_handle(view)
    assert not panel.handle.isChecked()
    undo()
    assert panel.list.currentRow() == 1
    assert window.section_views.section.kind == "cylinder"
    undo()
    assert window.store.session.view.section_index is None
    assert sections(window) == ()
    for _ in range(3):
        redo()
    assert panel.list.currentRow() == 0
    assert panel.handle.isChecked()
    assert has_handle(view)


@pytest.mark.usefixtures("painted")
def test_a_cell_of_the_flat_view_is_marked_and_it_shows_the_step(window, driver, panel):
    driver.click(panel.add["plane"])
    panel.flat.click()
    flat = window.section_views.flat
    driver.qtbot.waitUntil(flat.view.isVisible)
    QApplication.processEvents()
    flat.fit()
    flat.view.snapshot()
    polygons = flat.scene.polygons
    corner = polygons.points[polygons.take(np.array([3])).connectivity].mean(axis=0)
    (left, right), (below, above) = flat.scene.ranges()
    x = (corner[0] - left) / (right - left) * flat.view.width()
    y = (above - corner[1]) / (above - below) * flat.view.height()
    QTest.mouseDClick(flat.view, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))
    assert window.store.session.view.marked_cell == polygons.cells[3]
    panel.flat.click()
    driver.click(panel.remove)
    driver.click(panel.add["plane"])
    panel.flat.click()
    flat = window.section_views.flat
    window.start_run()
    driver.settle()
    assert len(window.store.session.frames) > 1
    assert flat.scene.session.frame is window.store.session.frame
    after = flat.facts.text()
    window.store.change(changes.show_frame, 0)
    assert flat.scene.session.frame is window.store.session.first
    assert flat.facts.text() != after


@pytest.mark.usefixtures("painted")
def test_the_handle_moves_the_plane_and_leaves_nothing(window, driver, panel):
    driver.click(panel.add["plane"])
    (plane,) = sections(window)
    panel.handle.click()
    pull(window, ("move", (3,)), plane.basis[2] * 0.1)
    (moved,) = sections(window)
    assert moved.position == pytest.approx(plane.position + 0.1, abs=0.005)
    assert moved.direction == plane.direction
    assert panel.editor.number.value == pytest.approx(moved.position)
    # And the other way round.
    driver.type(panel.editor.number, "0.3")
    window.view.snapshot()
    assert window.viewing.handles[window.view].placed().origin @ plane.basis[2] == pytest.approx(
        0.3
    )
    panel.handle.click()
    assert not has_handle(window.view)


@pytest.mark.usefixtures("painted")
def test_the_ball_of_the_handle_moves_the_plane_along_its_normal_and_a_tilt_is_undone(
    window, driver, panel
):
    editor = panel.editor
    driver.click(panel.add["plane"])
    driver.choose(editor.axis, "z")
    (before,) = sections(window)
    panel.handle.click()
    pull(window, ("move", ()), (0.0, 0.0, 0.1))
    (pushed,) = sections(window)
    assert pushed.origin[:2] == before.origin[:2]
    assert pushed.origin[2] == pytest.approx(before.origin[2] + 0.1, abs=0.005)
    QTest.keyClicks(window.view, "r")
    QTest.keyClicks(window.view, "17")
    QTest.keyClick(window.view, Qt.Key.Key_Return)
    QApplication.processEvents()
    assert sections(window)[0].direction[2] == pytest.approx(np.cos(np.radians(17.0)), abs=1e-4)
    assert editor.axis.currentData() == "free"
    assert editor.direction.isVisible()
    window.store.undo()
    assert sections(window)[0].direction == (0.0, 0.0, 1.0)
    assert editor.axis.currentData() == "z"
    assert not editor.direction.isVisible()
    window.store.redo()
    assert editor.axis.currentData() == "free"
    # Who types numbers keeps their fields, though for a moment they are those of an axis.
    driver.type(editor.direction.fields[0], "0")
    driver.type(editor.direction.fields[1], "0")
    assert editor.axis.currentData() == "free"
    assert editor.direction.isVisible()
    driver.click(panel.add["plane"])
    assert editor.axis.currentData() != "free"
    panel.list.setCurrentRow(0)
    assert editor.axis.currentData() == "z"


def test_two_strips_lie_one_above_the_other_where_they_are_larger_so():
    assert is_larger_stacked((0.35, 0.01), (600, 400))
    assert not is_larger_stacked((0.35, 0.3), (600, 400))
    assert not is_larger_stacked((0.35, 0.01), (600, 200)), "no room for two titles"


@pytest.mark.usefixtures("painted")
@pytest.mark.window("own")
def test_another_mesh_and_a_closed_window_have_no_handle_and_no_flat_view(
    window, driver, panel, passage_file, sample_folder, answers, monkeypatch
):
    driver.click(panel.add["plane"])
    panel.handle.click()
    panel.flat.click()
    driver.open(passage_file)
    assert not has_handle(window.view)
    assert window.section_views.flat is None
    assert sections(window) == ()
    assert panel.add["plane"].text() == "Line"
    assert panel.add["cylinder"].text() == "Circle"
    driver.click(panel.add["plane"])
    assert sections(window)[0].whole_cells
    assert panel.list.item(0).text() == sections(window)[0].describe(2)
    assert window.scene.sections.drawn["section:0"].shown.shape.n_cells > 0
    answers("ask_unsaved", "discard")
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    driver.click(panel.add["plane"])
    panel.handle.click()
    panel.flat.click()
    QApplication.processEvents()
    section_views = window.section_views
    assert has_handle(window.view)
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
    window.close()
    assert section_views.flat is None
    QApplication.processEvents()


@pytest.mark.usefixtures("painted")
def test_two_runs_have_two_flat_views_that_show_the_same(window, driver, panel):
    driver.click(panel.add["plane"])
    panel.flat.click()
    window.start_run()
    driver.settle()
    flats = window.section_views.flats
    assert flats.second is None
    window.store.change(changes.show_beside, changes.UNDEFORMED)
    driver.qtbot.waitUntil(lambda: flats.second is not None and flats.second.view.isVisible())
    QApplication.processEvents()
    first, second = flats.first, flats.second
    assert first.scene.session.frame is window.store.session.frame
    assert second.scene.session.frame is window.store.session.first
    assert first.title.text.startswith("Run 1: plane")
    assert second.title.text.startswith("Undeformed: plane")
    assert first.scene.stage.table.scalar_range == second.scene.stage.table.scalar_range
    for _ in range(5):
        QApplication.processEvents()
    # Both are seen whole, at one scale; what moves one camera moves the other.
    for flat in (first, second):
        low, high = flat.scene.bounds()
        across, upright = flat.scene.ranges()
        assert across[0] < low[0] < high[0] < across[1]
        assert upright[0] < low[1] < high[1] < upright[1]
    assert first.scene.camera.looks_like(second.scene.camera)
    second.view.signals.zoomed.emit(QPoint(30, 30), 2.0)
    assert first.scene.camera.looks_like(second.scene.camera)
    zoomed = first.scene.ranges()
    drag(panel.editor.slider, 0.4)
    assert first.scene.ranges() == second.scene.ranges() == zoomed
    first.fit()
    assert first.scene.camera.looks_like(second.scene.camera)
    # Where the views change places, so do these.
    assert first.x() < second.x()
    window.store.change(changes.set_view, swapped=True)
    driver.qtbot.waitUntil(lambda: second.x() < first.x())
    window.store.change(changes.show_beside, None)
    assert flats.second is None
    assert first.title.text.startswith("plane")


def test_the_curve_of_a_line_follows_step_run_and_line(window, driver, flat_panel):
    driver.click(flat_panel.add["plane"])
    assert flat_panel.flat.text() == "Curve"
    flat_panel.flat.click()
    view = window.section_views.flat
    assert [row.label for row in view.rows] == ["undeformed"]
    before = view.facts.text()
    assert "cells cut" in before
    window.start_run()
    driver.settle()
    assert [row.label for row in view.rows] == ["undeformed", "run 1"]
    assert view.facts.text() != before
    driver.qtbot.waitUntil(lambda: not view.area.canvas.busy)
    drawn = {line.get_gid() for line in view.area.canvas.figure.axes[0].get_lines()}
    assert drawn == {"along:undeformed", "along:run 1"}
    cell = int(view.rows[-1].curve.cells[3])
    view.area.canvas.picked(float(view.rows[-1].curve.ends[3].mean()))
    assert window.store.session.view.marked_cell == cell
    drag(flat_panel.editor.slider, 0.1)
    assert cell not in view.rows[-1].curve.cells
    driver.type(flat_panel.editor.number, "77")
    assert view.rows == ()
    assert view.area.shows_text
    assert view.facts.text() == "it cuts no cell"
    driver.click(view.title.close_button)
    assert window.section_views.flat is None
    assert not flat_panel.flat.isChecked()


def test_a_flat_view_of_a_3d_mesh_becomes_a_curve_with_a_2d_one(
    window, driver, panel, passage_file, tmp_path, answers
):
    driver.click(panel.add["plane"])
    panel.flat.click()
    driver.open(passage_file)
    driver.click(panel.add["plane"])
    panel.flat.click()
    answers("ask_save", tmp_path / "again.cfg")
    window.actions_table.by_name["save_case"].trigger()
    assert window.section_views.flat.objectName() == "curve_view"
    driver.open(tmp_path / "again.cfg")
    assert window.section_views.flat.objectName() == "curve_view"
    assert window.section_views.flat.rows


@pytest.fixture
def flat_panel(window, driver, sample_folder):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window.dock_manager.bring_to_front("sections")
    QApplication.processEvents()
    return window.dock_manager.panels["sections"]


def has_handle(view):
    view.snapshot()
    return handle.NAME in view.actors


def pull(window, grip, shift, view=None):
    """Drag a part of the handle by a shift (3,) in space."""
    view = view or window.view
    view.snapshot()
    part = next(one for one in window.viewing.handles[view].parts if one.grip == grip)
    start = part.line.mean(axis=0)
    point = part.point
    by = np.diff(to_display(view, np.stack([point, point + shift])), axis=0)[0]
    for event, share in ((QTest.mousePress, 0.0), (QTest.mouseMove, 0.5), (QTest.mouseMove, 1.0)):
        x, y = (start + share * by) / view.devicePixelRatioF()
        where = QPoint(round(x), round(view.height() - 1 - y))
        if event is QTest.mouseMove:
            event(view, where)
        else:
            event(view, Qt.MouseButton.LeftButton, pos=where)
        QApplication.processEvents()
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=where)
    QApplication.processEvents()


def drag_in_view(view, start, end):
    """Drag from one place of the mesh to another, through one between."""
    for event, share in ((QTest.mousePress, 0.0), (QTest.mouseMove, 0.5), (QTest.mouseMove, 1.0)):
        at = start + share * (end - start)
        x, y = to_display(view, np.array([[*at, 0.0]]))[0] / view.devicePixelRatioF()
        where = QPoint(round(x), round(view.height() - 1 - y))
        if event is QTest.mouseMove:
            event(view, where)
            QApplication.processEvents()
        else:
            event(view, Qt.MouseButton.LeftButton, pos=where)
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=where)
    QApplication.processEvents()


@pytest.mark.usefixtures("painted")
def test_a_line_is_dragged_by_its_middle_turned_by_its_ring_and_its_handle_leaves_nothing(
    window, driver, flat_panel
):
    driver.click(flat_panel.add["plane"])
    flat_panel.handle.click()
    window.view.snapshot()
    camera = window.scene.camera.place
    (line,) = sections(window)
    start, shift = np.array(line.origin[:2]), np.array([0.1, 0.05])
    drag_in_view(window.view, start, start + shift)
    (moved,) = sections(window)
    assert moved.origin[:2] == pytest.approx(tuple(start + shift), abs=0.01)
    assert moved.direction == line.direction
    middle = np.array(moved.origin[:2])
    window.view.snapshot()
    unit = Projection.of(window.view).pixel_length(np.array(moved.origin))
    ring = np.array([np.cos(0.7), np.sin(0.7)])
    end = np.array([-ring[1], ring[0]])
    drag_in_view(window.view, middle + RING_PX * unit * ring, middle + 2.0 * RING_PX * unit * end)
    (turned,) = sections(window)
    assert abs(np.dot(turned.direction, moved.direction)) < 0.03, "by a quarter of a turn"
    assert turned.origin == pytest.approx(moved.origin, abs=1e-3)
    # The view stayed where it was, and each drag is undone by itself.
    assert window.scene.camera.place[:6] == pytest.approx(camera[:6])
    window.store.undo()
    assert sections(window) == (moved,)
    window.store.undo()
    assert sections(window) == (line,)
    flat_panel.handle.click()
    driver.click(flat_panel.remove)
    driver.click(flat_panel.add["plane"])
    flat_panel.handle.click()
    assert has_handle(window.view)
    # What is dragged beside it moves the view, as ever.
    camera = window.scene.camera.place
    (x, y, _) = sections(window)[0].origin
    drag_in_view(window.view, np.array([x, y]) + 0.3, np.array([x, y]) + 0.4)
    assert window.scene.camera.place != camera
    # Wherever one looks, it is in reach.
    half = 0.02
    window.scene.camera.aim((x, y + 0.3, 0.0), half, 1.0)
    window.view.snapshot()
    assert abs(window.viewing.handles[window.view].placed().origin[1] - y - 0.3) < half
    flat_panel.handle.click()
    assert not has_handle(window.view)


def test_a_circle_is_dragged_to_another_radius(window, driver, flat_panel):
    driver.click(flat_panel.add["cylinder"])
    (circle,) = sections(window)
    assert circle.direction == (0.0, 0.0, 1.0)
    assert not flat_panel.editor.axis.isVisible()
    assert flat_panel.editor.centre.value == pytest.approx(circle.origin[:2])
    flat_panel.handle.click()
    window.view.snapshot()
    centre = np.array(circle.origin[:2])
    edge = window.viewing.handles[window.view].placed().edge[:2]
    drag_in_view(window.view, edge, centre + 0.2 * np.sqrt(0.5))
    assert sections(window)[0].radius == pytest.approx(0.2, abs=0.01)
    assert sections(window)[0].origin == circle.origin
    driver.type(flat_panel.editor.centre.fields[1], "0.05")
    assert sections(window)[0].origin[1:] == (0.05, 0.0)


@pytest.mark.usefixtures("painted")
def test_a_closed_flat_view_is_freed(window, driver, panel):
    driver.click(panel.add["plane"])
    panel.flat.click()
    QApplication.processEvents()
    view, scene = (
        weakref.ref(window.section_views.flat),
        weakref.ref(window.section_views.flat.scene),
    )
    panel.flat.click()
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    QApplication.processEvents()
    gc.collect()
    assert view() is None
    assert scene() is None


def compare(window, driver):
    window.start_run()
    driver.settle()
    window.store.change(changes.show_beside, changes.UNDEFORMED)
    driver.qtbot.waitUntil(lambda: window.viewing.second.isVisible())
    QApplication.processEvents()
    return window.viewing.second


@pytest.mark.usefixtures("painted")
def test_of_two_views_each_has_a_handle(window, driver, panel):
    driver.click(panel.add["plane"])
    panel.handle.click()
    second = compare(window, driver)
    (plane,) = sections(window)
    pull(window, ("move", (3,)), 0.1 * plane.basis[2], second)
    (moved,) = sections(window)
    assert moved.position == pytest.approx(plane.position + 0.1, abs=0.01)
    for view in (window.view, second):
        assert has_handle(view)
        assert window.viewing.handles[view].placed().section == moved, "the other follows"
    window.store.change(changes.show_beside, None)
    assert second not in window.viewing.handles
    assert has_handle(window.view)


def test_a_line_is_dragged_in_the_second_view(window, driver, flat_panel):
    second_view = compare(window, driver)
    driver.click(flat_panel.add["plane"])
    flat_panel.handle.click()
    second_view.snapshot()
    (line,) = sections(window)
    start, shift = np.array(line.origin[:2]), np.array([0.1, 0.05])
    drag_in_view(second_view, start, start + shift)
    assert sections(window)[0].origin[:2] == pytest.approx(tuple(start + shift), abs=0.02)
    flat_panel.handle.click()
    for view in (window.view, second_view):
        assert not has_handle(view)


def test_a_picture_of_the_section_is_saved_or_it_is_told_why_not(
    window, driver, panel, answers, tmp_path
):
    driver.click(panel.add["plane"])
    asked = answers("ask_save", tmp_path / "cut.svg")
    assert panel.picture.menu() is panel.sizes
    panel.sizes.actions()[0].trigger()
    driver.settle()
    assert asked
    assert b"<svg" in (tmp_path / "cut.svg").read_bytes()
    # 8.5 cm are 241 points.
    assert b'width="240.9' in (tmp_path / "cut.svg").read_bytes()
    driver.click(panel.add["plane"])
    answers("ask_save", tmp_path / "cut.bmp")
    panel.sizes.actions()[3].trigger()
    driver.settle()
    assert window.banner.isVisible()
    assert not (tmp_path / "cut.bmp").exists()


@pytest.mark.slow
def test_size_title_and_axes_of_the_picture_of_a_section_can_be_chosen(
    window, driver, panel, answers, tmp_path
):
    driver.click(panel.add["plane"])
    answers("ask_save", tmp_path / "cut.svg")
    asked = answers("ask_paper", (10.0, 4.0))
    (other,) = [one for one in panel.sizes.actions() if one.text() == "Other size…"]
    for parts in ((), (panel.titled, panel.with_axes)):
        for part in parts:
            part.trigger()
        other.trigger()
        driver.settle()
        text = (tmp_path / "cut.svg").read_text()
        # 10 and 4 cm are 283 and 113 points.
        assert 'width="283.' in text
        height = float(re.search(r'height="([\d.]+)pt"', text)[1])
        assert height <= 113.5
        assert (": undeformed, plane " in text) == (not parts)
        assert ("<!-- z -->" in text or "<!-- y -->" in text) == (not parts)
    assert len(asked) == 2
    asked = answers("ask_paper", None)
    (tmp_path / "cut.svg").unlink()
    other.trigger()
    driver.settle()
    assert asked
    assert not (tmp_path / "cut.svg").exists()


def test_the_panel_fits_its_dock(window, panel, driver):
    driver.click(panel.add["cylinder"])
    driver.choose(panel.editor.axis, "free")
    QApplication.processEvents()
    assert panel.minimumSizeHint().width() <= 300
    assert panel.minimumSizeHint().height() <= 270


A, B, C = (Section("plane", (x, 0.0, 0.0), (1.0, 0.0, 0.0)) for x in (0.0, 1.0, 2.0))


@pytest.mark.parametrize(
    ("index", "old", "new", "wanted"),
    [
        (None, (), (A,), 0),
        (0, (A,), (A, B), 1),
        (1, (A, B), (C, B), 1),
        (2, (A, B, C), (A, C), 1),
        (1, (A, B, C), (A, C), 1),
        (0, (A, B), (A,), 0),
        (1, (A, B), (A,), 0),
        (0, (A,), (), None),
    ],
)
def test_the_chosen_section_stays_chosen(index, old, new, wanted):
    assert selection_after(index, old, new) == wanted


@pytest.mark.parametrize(
    ("extent", "room", "wide"),
    [
        ((0.35, 0.015), (1170, 980), False),
        ((0.015, 0.35), (1170, 980), True),
        ((0.3, 0.3), (1170, 980), True),
        ((0.3, 0.3), (900, 980), False),
    ],
)
def test_a_long_strip_lies_below_the_view_and_is_larger_there(extent, room, wide):
    found, share = arrangement_for(extent, room)
    assert found == wide
    thin = extent[1] < 0.1 * extent[0]
    assert (share < 0.35) == thin, "what a strip does not need is left to the view"


def test_rulers_have_round_numbers():
    assert nice_ticks(-0.012, 0.031, 4) == pytest.approx([0.0, 0.02])
    assert nice_ticks(0.0, 1.0, 4) == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])
    assert nice_ticks(1.0, 1.0, 4) == []
    assert [tick_text(value, 0.25) for value in (0.25, 0.5)] == ["0.25", "0.50"]
    assert tick_text(1e-17, 0.1) == "0"
    assert tick_text(30.0, 10.0) == "30"
    assert tick_text(3e-6, 1e-6) == "3e-06"


@pytest.mark.parametrize("upright", [False, True])
def test_a_short_ruler_has_two_numbers_at_least(qtbot, upright):
    ruler = Ruler(upright=upright)
    qtbot.addWidget(ruler)
    ruler.resize(*((58, 60) if upright else (200, 34)))
    for low, high in ((-0.009, 0.009), (0.448, 0.464), (0.41, 0.49), (0.0011, 0.0187)):
        ruler.show_range(low, high, "")
        at = np.array(ruler.ticks())
        assert len(at) >= 2
        assert low <= at[0] < at[-1] <= high
        assert np.diff(at).min() / (high - low) * (60 if upright else 200) >= (11, 40)[not upright]


def test_a_ruler_writes_its_numbers(qtbot):
    ruler = Ruler(upright=False)
    qtbot.addWidget(ruler)
    ruler.resize(400, 34)
    ruler.show_range(0.0, 1.0, "z")
    empty = ruler.grab().toImage()
    ruler.show_range(0.1, 1.1, "z")
    assert ruler.grab().toImage() != empty


def test_a_tick_at_the_end_of_a_ruler_has_its_number(qtbot):
    for upright, ends in (
        (False, (slice(6, 17), slice(-30, None))),
        (True, (slice(0, 14), slice(10, -6))),
    ):
        ruler = Ruler(upright=upright)
        qtbot.addWidget(ruler)
        ruler.resize(*((58, 400) if upright else (400, 34)))
        ruler.show_range(0.0, 0.2, "")
        image = ruler.grab().toImage()
        grey = np.array(
            [
                [image.pixelColor(x, y).lightness() for x in range(image.width())]
                for y in range(image.height())
            ]
        )
        assert np.ptp(grey[ends]) > 60, "0.20 stands at the end of the ruler"
