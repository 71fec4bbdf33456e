"""The display panel, driven by mouse and keyboard."""

from dataclasses import replace

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.gui.panels.display import MOST_PASSAGES, NOT_PERIODIC, ROLES_ONLY, SHOWN, PassagesBox
from slideviz.samples.table import write_sample
from slideviz.scene.mesh import PassageLayer
from slideviz.scene.pick import to_display
from slideviz.session import changes, jobs
from tests.builders import stage

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def shown(driver, sample_folder):
    """The case of the passage, with the panel in front."""
    driver.open(sample_folder / "passage" / "passage.cfg")
    driver.window.docks["display"].raise_()
    driver.qtbot.waitUntil(panel(driver).isVisible)
    return driver


def panel(driver):
    return driver.window.dock_manager.panels["display"]


def view(driver):
    return driver.session.view


def test_colors_map_and_points_are_chosen_and_undone(shown):
    shown.choose(panel(shown).color_by, "skew")
    assert view(shown).color_by == "skew"
    assert shown.window.actions_table.bar.color.currentData() == "skew"
    shown.choose(panel(shown).map, "cividis")
    assert view(shown).color_map == "cividis"
    assert shown.window.scene.stage.table.cmap.name == "cividis"
    shown.window.actions_table.by_name["undo"].trigger()
    assert view(shown).color_map == "viridis"
    assert panel(shown).map.currentData() == "viridis"
    shown.choose(panel(shown).points, "types")
    assert view(shown).points == "types"
    assert shown.window.view.actors["points:nodes"].visibility
    shown.choose(panel(shown).points, "none")
    assert "points:nodes" not in shown.window.view.actors
    session = shown.session
    lonely = changes.set_role(session, session.case.markers_with("periodic"), "fixed")
    shown.window.store.put(replace(lonely, pairs=()))
    assert not panel(shown).passages.isEnabled()
    assert NOT_PERIODIC in panel(shown).passages.toolTip()


def test_the_range_is_typed_checked_reset_and_fits_the_values_of_the_step(shown):
    box = panel(shown)
    assert not box.range.isEnabled(), "roles have no range"
    assert box.range.low.toolTip() == box.map.toolTip() == ROLES_ONLY
    shown.window.store.change(changes.set_view, color_by="size-skew")
    assert box.range.isEnabled()
    assert (box.range.low.text(), box.range.high.text()) == ("0", "1")
    assert not box.reset_range.isEnabled()
    shown.type(box.range.low, "0.4")
    assert view(shown).color_range == (0.4, 1.0)
    assert tuple(shown.window.scene.stage.table.scalar_range) == (0.4, 1.0)
    box.range.high.setFocus()
    box.range.high.selectAll()
    QTest.keyClicks(box.range.high, "0.3")
    assert box.range.high.property("bad")
    assert box.range.high.toolTip() == "0.4 must be less than 0.3"
    assert view(shown).color_range == (0.4, 1.0)
    shown.click(box.reset_range)
    assert view(shown).color_range is None
    assert (box.range.low.value, box.range.high.value) == (0.0, 1.0)
    shown.window.store.change(changes.set_view, color_by="skew")
    shown.click(panel(shown).fit_range)
    low, high = view(shown).color_range
    values = shown.session.frame.quality.skew
    assert low == pytest.approx(values.min(), rel=1e-2)
    assert high == pytest.approx(values.max(), rel=1e-2)
    assert low <= values.min() < values.max() <= high
    shown.click(panel(shown).reset_range)
    assert view(shown).color_range is None


def test_only_cells_of_a_range_are_chosen_and_steps_and_selection_leave_the_panel_alone(
    shown, monkeypatch
):
    box = panel(shown)
    assert not box.threshold.isEnabled()
    QTest.mouseClick(box.only, Qt.MouseButton.LeftButton, pos=QPoint(8, 8))
    assert view(shown).threshold == (0.0, 0.5)
    for what in ("non-orthogonality", "size-skew"):  # of this the high values are the worse ones
        shown.window.store.change(changes.set_view, color_by=what)
        half = (45.0, 90.0) if what == "non-orthogonality" else (0.0, 0.5)
        assert (box.threshold.low.value, box.threshold.high.value) == half
        assert not box.threshold.low.fault
        assert not box.threshold.high.fault
    shown.window.store.change(changes.set_view, threshold=(0.0, 0.5))
    shown.type(box.threshold.high, "0.7")
    assert view(shown).threshold == (0.0, 0.7)
    shown.type(box.threshold.low, "0.9")
    assert view(shown).threshold == (0.0, 0.7), "0.9 to 0.7 is no range"
    assert "0.9 must be less than 0.7" in box.threshold.low.toolTip()
    shown.type(box.threshold.high, "0.95")
    assert view(shown).threshold == (0.9, 0.95)
    assert not box.threshold.low.fault
    shown.type(box.threshold.high, "0.7")
    shown.type(box.threshold.low, "0")
    QTest.mouseClick(box.only, Qt.MouseButton.LeftButton, pos=QPoint(8, 8))
    assert view(shown).threshold is None
    synced = []
    monkeypatch.setattr(panel(shown), "_sync", lambda session: synced.append(session))
    shown.window.store.change(changes.select, ("airfoil",))
    shown.window.store.change(changes.mark_cell, 3)
    shown.window.store.change(changes.start_run)
    assert not synced
    shown.window.store.change(changes.set_view, edges=False)
    assert len(synced) == 1


@pytest.fixture(scope="module")
def stator(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder, size=5000)
    return folder / "stator.cfg"


def test_neighbours_of_a_row_and_of_a_wheel(shown, stator):
    box = panel(shown)
    assert box.passages.isEnabled()
    assert box.passages.text() == "0"
    assert box.passages.maximum() == MOST_PASSAGES
    QTest.keyClick(box.passages, Qt.Key.Key_Up)
    assert view(shown).passages == 1
    assert box.passages.text() == "1 on each side"
    scene = shown.window.scene
    passages = next(layer for layer in scene.layers if isinstance(layer, PassageLayer))
    seen = to_display(scene.plotter, np.concatenate([one.points for one in passages.shapes()]))
    assert seen.min() >= 0, "the view fits them"
    assert (seen.max(axis=0) <= scene.plotter.window_size).all()
    shown.open(stator)
    assert box.passages.text() == "0"
    assert "41" not in box.passages.toolTip()
    assert "8.78049° about z" in box.passages.toolTip()
    box.passages.setValue(box.passages.maximum())
    assert box.passages.text() == "all 41 around"
    assert view(shown).passages == -1
    assert len([n for n in shown.window.view.actors if n.startswith("copy:")]) == 40 * 7
    shown.window.actions_table.by_name["undo"].trigger()
    assert view(shown).passages == 0
    assert box.passages.value() == 0


def test_neighbours_of_zones_with_a_period_each(driver, tmp_path):
    opened = jobs.prepare(stage(), tmp_path / "stage.su2", None, jobs.Job())
    driver.window.show_opened(opened)
    box = panel(driver)
    assert box.passages.isEnabled()
    assert "1:per1 and 1:per2 repeat by 40° about z; 2:per1" in box.passages.toolTip()
    box.passages.setValue(box.passages.maximum())
    assert box.passages.text() == "all 9 and 12 around"
    assert view(driver).passages == -1
    assert len([n for n in driver.window.view.actors if n.startswith("copy:")]) == (8 + 11) * 7
    box.passages.lineEdit().setText("all 9 and 12 around")
    assert not box.passages.fault


def test_a_number_of_neighbours_can_be_typed(qtbot):
    box = PassagesBox()
    qtbot.addWidget(box)
    box.set_around((41,))
    assert box.maximum() == 20
    for text, wanted in (
        ("3", 3),
        ("7 on each side", 7),
        ("all 41 around", 20),
        ("0", 0),
    ):
        box.lineEdit().setText(text)
        box.interpretText()
        assert box.value() == wanted, text
    box.set_around(())
    assert box.value() <= MOST_PASSAGES
    box.set_around((2,))
    box.setValue(1)
    assert box.text() == "all 2 around"


def test_what_is_drawn_is_switched_agrees_with_the_menu_and_perspective_is_for_solid_meshes(
    shown, sample_folder
):
    for name in [name for name, term in SHOWN.items() if not term.why_not]:
        box, before = panel(shown).shown[name], name in view(shown).drawn
        # Beside its word a check box is deaf.
        QTest.mouseClick(box, Qt.MouseButton.LeftButton, pos=QPoint(8, box.height() // 2))
        assert (name in view(shown).drawn) != before, name
        action = shown.window.actions_table.by_name[name]
        assert action.isChecked() != before, name
        action.trigger()
        assert box.isChecked() == before == (name in view(shown).drawn), name
    box = panel(shown).shown["perspective"]
    assert not box.isEnabled()
    assert "2D" in box.toolTip()
    shown.open(sample_folder / "hexahedron" / "mesh.su2")
    assert box.isEnabled()
    QTest.mouseClick(box, Qt.MouseButton.LeftButton, pos=QPoint(8, box.height() // 2))
    assert not shown.window.view.camera.parallel_projection


def test_the_panel_fits_its_dock_and_is_off_without_a_mesh(driver, passage_file):
    assert not panel(driver).isEnabled()
    driver.open(passage_file)
    assert panel(driver).isEnabled()
    driver.window.docks["display"].raise_()
    QApplication.processEvents()
    box = panel(driver)
    for widget in (box.color_by, box.threshold, box.passages, *box.shown.values()):
        right = widget.mapTo(box, widget.rect().topRight()).x()
        assert right < box.width(), widget.objectName()
        assert widget.width() >= widget.minimumSizeHint().width(), widget.objectName()


def test_colors_fit_a_step_or_all_or_both_views_of_a_comparison_and_are_as_ever_again(shown):
    window, acts = shown.window, shown.window.actions_table.by_name
    one, every, usual = (acts[f"{n}_colors"] for n in ("fit", "fit_all", "usual"))
    assert not one.isEnabled(), "roles have no range"
    assert not window.actions_table.bar.range.isEnabled()
    shown.window.store.change(changes.set_view, color_by="size-skew")
    window.start_run()
    shown.settle()
    assert not usual.isEnabled()
    values = shown.session.frame.quality.values
    one.trigger()
    assert view(shown).color_range == pytest.approx((values.min(), values.max()), abs=0.02)
    assert shown.window.store.can_undo == "color range"
    high = view(shown).color_range[1]
    every.trigger()
    assert view(shown).color_range[1] > high, "the undeformed mesh is better"
    usual.trigger()
    assert view(shown).color_range is None
    shown.window.store.change(changes.show_frame, 0)
    shown.window.store.change(changes.set_view, color_by="size")
    one.trigger()
    assert view(shown).color_range is None, "all cells have the size they had"
    shown.window.store.change(changes.show_frame, len(shown.session.frames) - 1)
    shown.window.store.change(changes.set_view, color_by="size-skew")
    shown.window.store.change(changes.show_beside, changes.UNDEFORMED)
    shown.click(panel(shown).fit_range)
    values = shown.session.frame.quality.values
    assert view(shown).color_range == pytest.approx((values.min(), 1.0), rel=1e-2)
    assert values.max() < 0.999, "the best cells are those of the other view"
