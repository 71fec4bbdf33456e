"""The window, driven by mouse and keyboard under a virtual screen."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from qtpy.QtCore import QMimeData, QPoint, QPointF, Qt, QTimerEvent, QUrl
from qtpy.QtGui import QDragEnterEvent, QDropEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QMenu, QToolButton

from slideviz import Case, read
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.errors import Doubt, Message, note
from slideviz.export.picture_options import PictureOptions, headings
from slideviz.gui.panels.worst import CELL
from slideviz.gui.viewport import player as player_module
from slideviz.gui.viewport.player import plain, result_parts, step_ms
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.fields import NumberField
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.rbf.reduction import AUTO, Reduction
from slideviz.session import changes, jobs
from slideviz.session.inspect import worst_cells
from slideviz.session.run_messages import end_parts
from slideviz.session.runs_words import describe_run
from tests.windows import come_to_rest

pytestmark = pytest.mark.window("shared")
DONE = "he motion could go "


@pytest.fixture
def opened(driver, passage_file):
    driver.open(passage_file)
    return driver


@pytest.fixture
def ready(driver, sample_folder):
    """The case of the passage, which can run."""
    driver.open(sample_folder / "passage" / "passage.cfg")
    return driver


@pytest.fixture
def ran(with_runs):
    """The case of the passage with a run of three steps."""
    return with_runs({"steps": 3})


def colors(window):
    picture = window.view.snapshot().astype(int)
    return {tuple(rgb) for rgb in picture[::3, ::3].reshape(-1, 3)}


# Opening ----------------------------------------------------------------------------------


@pytest.mark.window("own")
def test_it_starts_with_a_page_that_offers_to_open_and_the_samples(window):
    assert window.start.isVisible()
    assert set(window.start.sample_buttons) == set(window.files.samples)
    assert not window.run_panel.run.isEnabled()
    assert "Open a mesh" in window.run_panel.text.text()


@pytest.mark.usefixtures("painted")
def test_a_mesh_opens_with_rows_roles_and_guesses_that_keep_all_confirms(opened):
    window, session = opened.window, opened.session
    table = window.boundaries.table
    assert [table.item(row, 0).text() for row in range(5)] == list(session.mesh.marker_names)
    choice = table.cellWidget(opened.row("airfoil"), 2)
    assert choice.currentText() == "moving ?"
    assert choice.font().italic()
    assert "guess" in choice.toolTip()
    assert not window.start.isVisible()
    assert window.windowTitle() == "passage.su2 – slideviz"
    assert len(colors(window)) > 20
    opened.click(opened.window.boundaries.keep)
    choice = opened.window.boundaries.table.cellWidget(0, 2)
    assert not opened.session.guesses
    assert "?" not in choice.currentText()
    assert not choice.font().italic()
    assert not opened.window.boundaries.keep.isVisible()


def test_a_case_opens_with_mesh_roles_motions_and_settings(ready):
    case = ready.session.case
    assert case.motions
    assert ready.window.motions.list.count() == len(case.motions)
    assert ready.window.method.sliding.currentData() == case.sliding
    assert ready.window.method.steps.value() == case.steps
    assert not ready.session.guesses
    assert ready.window.run_panel.run.isEnabled()


def test_files_are_remembered_and_the_newest_is_first(opened, sample_folder):
    second = sample_folder / "hexahedron" / "mesh.su2"
    opened.open(second)
    recent = opened.window.files.recent()
    assert recent[0] == second
    assert len(recent) == 2
    opened.open(opened.window.files.recent()[1])
    assert len(opened.window.files.recent()) == 2


def test_dropping_a_file_opens_it_and_so_does_the_menu(driver, passage_file, answers):
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(passage_file))])
    buttons, keys = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    action = Qt.DropAction.CopyAction
    enter = QDragEnterEvent(QPoint(500, 300), action, data, buttons, keys)
    QApplication.sendEvent(driver.window, enter)
    assert enter.isAccepted()
    QApplication.sendEvent(
        driver.window, QDropEvent(QPointF(500, 300), action, data, buttons, keys)
    )
    driver.qtbot.waitUntil(lambda: driver.session.mesh is not None)
    assert driver.session.path == Path(passage_file)
    assert not driver.window.view.acceptDrops(), "the view would read the file in its own way"
    other = Path(passage_file).rename(Path(passage_file).with_name("other.su2"))
    answers("ask_open", other)
    driver.window.actions_table.by_name["open"].trigger()
    driver.settle()
    assert driver.session.path == other


def test_a_broken_file_and_an_unexpected_error_are_told_and_the_window_goes_on(
    opened, tmp_path, monkeypatch
):
    before = opened.session.mesh
    bad = tmp_path / "bad.su2"
    bad.write_text("NDIME= 2\nNELEM= 1\n5 0 1 oops\n")
    opened.open(bad)
    banner = opened.window.banner
    assert banner.isVisible()
    assert "bad.su2:3" in banner.text.text()
    assert opened.session.mesh is before
    opened.open(opened.session.path)
    assert not banner.isVisible()

    def broken(*_, **_named):
        raise ZeroDivisionError("strange")

    monkeypatch.setattr(jobs, "open_file", broken)
    opened.open(opened.session.path)
    banner = opened.window.banner
    assert "ZeroDivisionError" in banner.text.text()
    opened.click(banner.details)
    assert "def broken" not in banner.text.text()
    opened.click(banner.dialog.copy)
    assert "Traceback" in QApplication.clipboard().text()
    assert "strange" in QApplication.clipboard().text()
    banner.dialog.close()


def test_zones_can_be_chosen(driver, tmp_path, passage_file):
    one = Path(passage_file).read_text()
    both = tmp_path / "two.su2"
    two = one.replace("airfoil", "vane")
    both.write_text(f"NZONE= 2\nIZONE= 1\n{one}\nIZONE= 2\n{two}\n")
    driver.open(both)
    bar, table = driver.window.actions_table.bar, driver.window.boundaries.table
    assert bar.zone_shown.isVisible()
    assert bar.zone.currentText() == "all 2"
    names = driver.session.mesh.marker_names
    assert {"airfoil", "vane", "1:inflow", "2:inflow"} <= set(names)
    half = len(names) // 2
    heads = [table.item(row, 0).text() for row in (0, half + 1)]
    assert heads == ["Zone 1", "Zone 2"]
    assert table.item(half + 2, 0).text() == names[half]
    table.item(half + 1, 0).setCheckState(Qt.CheckState.Unchecked)
    assert driver.session.view.hidden == frozenset(names[half:])
    assert table.item(half + 2, 0).checkState() == Qt.CheckState.Unchecked
    table.role_wanted.emit(0)  # a zone has no role
    driver.choose(bar.zone, 2)
    driver.settle()
    assert "vane" in driver.session.mesh.marker_names
    assert "airfoil" not in driver.session.mesh.marker_names
    assert table.item(0, 0).text() == driver.session.mesh.marker_names[0]
    driver.choose(bar.zone, 0)
    driver.settle()
    assert driver.session.mesh.zone is None
    driver.open(passage_file)
    assert not bar.zone_shown.isVisible()


# Boundaries -------------------------------------------------------------------------------


def test_a_role_is_chosen_in_the_table_also_for_all_selected_rows_and_shown_in_the_view(opened):
    opened.role("inflow", "internal")
    assert opened.session.role("inflow") == "internal"
    assert (0xCC, 0x79, 0xA7) in colors(opened.window)
    opened.click_row("inflow")
    opened.click_row("outflow", Qt.KeyboardModifier.ControlModifier)
    assert set(opened.session.view.selected) == {"inflow", "outflow"}
    opened.role("outflow", "fixed")
    assert opened.session.role("inflow") == opened.session.role("outflow") == "fixed"
    assert opened.session.role("airfoil") == "moving"
    item = opened.window.boundaries.table.item(opened.row("airfoil"), 0)
    item.setCheckState(Qt.CheckState.Unchecked)
    assert opened.session.view.hidden == {"airfoil"}
    assert not opened.window.scene.drawn["airfoil"].actor.visibility


def test_a_click_in_the_view_selects_and_the_right_button_assigns_a_role_and_isolates(opened):
    window, mesh = opened.window, opened.session.mesh
    nodes = mesh.marker("outflow").cells.connectivity.reshape(-1, 2)
    opened.click_view(mesh.points[nodes[len(nodes) // 2]].mean(axis=0))
    assert opened.session.view.selected == ("outflow",)
    assert window.boundaries.selected() == ("outflow",)
    airfoil = mesh.points[mesh.marker("airfoil").nodes[0]]
    opened.click_view(airfoil, modifier=Qt.KeyboardModifier.ControlModifier)
    assert set(window.boundaries.selected()) == {"outflow", "airfoil"}
    view = window.view
    QTest.mousePress(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(9, 9))
    QTest.mouseMove(view, QPoint(90, 60))
    QTest.mouseRelease(
        view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(90, 60)
    )
    assert set(window.boundaries.selected()) == {"outflow", "airfoil"}
    QTest.mouseClick(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, QPoint(4, 4))
    assert window.boundaries.selected() == ()
    nodes = mesh.marker("inflow").cells.connectivity.reshape(-1, 2)
    middle = mesh.points[nodes[len(nodes) // 2]].mean(axis=0)

    def menu():
        return next(m for m in window.findChildren(QMenu) if m.isVisible())

    def trigger(text):
        opened.click_view(middle, button=Qt.MouseButton.RightButton)
        opened.qtbot.waitUntil(lambda: any(m.isVisible() for m in window.findChildren(QMenu)))
        found = menu()
        acts = [act for act in found.actions() if act.text() and not act.isSeparator()]
        letters = [act.text().partition("&")[2][:1].lower() for act in acts]
        assert all(letters)
        assert len({*letters}) == len(letters)
        (letter,) = (
            one
            for one, act in zip(letters, acts, strict=True)
            if act.text().replace("&", "") == text
        )
        QTest.keyClick(found, letter)

    trigger("Fixed")
    assert opened.session.role("inflow") == "fixed"
    assert opened.session.view.selected == ("inflow",)
    trigger("Show only this")
    assert opened.session.view.hidden == set(mesh.marker_names) - {"inflow"}
    window.actions_table.by_name["show_all"].trigger()
    assert not opened.session.view.hidden
    trigger("Fit to boundary")
    x = opened.window.scene.camera.place[3]
    assert x == pytest.approx(np.mean(mesh.points[mesh.marker("inflow").nodes, 0]), abs=1e-6)
    opened.window.viewing.fit()
    trigger("Hide")
    assert opened.session.view.hidden == {"inflow"}


def test_a_click_in_a_3d_view_selects_the_face_in_front_and_a_3d_rotation_has_an_axis(
    driver, sample_folder
):
    driver.open(sample_folder / "hexahedron" / "mesh.su2")
    driver.window.viewing.look_from("+x")
    driver.click_view((1.0, 0.5, 0.5))
    assert driver.window.boundaries.selected() == ("RIGHT",)
    driver.role("BLOCK", "moving")
    driver.add_motion(Rotate)
    editor = driver.window.motions.editor
    assert editor.axis.isVisible()
    driver.type(editor.angle, "10")
    driver.type(editor.axis.fields[0], "1")
    driver.type(editor.axis.fields[2], "0")
    assert driver.session.case.motions == (Rotate("BLOCK", 10.0, "centroid", (1.0, 0.0, 0.0)),)
    driver.type(editor.axis.fields[0], "0")
    assert driver.session.case.motions[0].axis == (1.0, 0.0, 0.0), "an axis has a direction"


# Motions ----------------------------------------------------------------------------------


def ghost(driver):
    return driver.window.scene.motion_ghosts["airfoil"]


def test_a_translation_and_a_scaling_are_typed_and_the_ghost_moves_at_once(opened):
    opened.add_motion(Translate)
    editor = opened.window.motions.editor
    opened.type(editor.vector.fields[0], "0.1")
    opened.type(editor.vector.fields[1], "-2e-2")
    assert opened.session.case.motions == (Translate("airfoil", (0.1, -0.02)),)
    nodes = opened.session.mesh.marker("airfoil").nodes
    assert np.allclose(ghost(opened), opened.session.mesh.points[nodes] + [0.1, -0.02])
    opened.window.store.change(changes.set_case, motions=())
    opened.add_motion(Scale)
    editor = opened.window.motions.editor
    opened.type(editor.factors.fields[0], "1.5")
    assert opened.session.case.motions == (Scale("airfoil", (1.5, 1.0)),)
    field = editor.factors.fields[1]
    field.selectAll()
    QTest.keyClicks(field, "0")
    assert field.property("bad")
    assert "flatten" in field.toolTip()
    assert opened.session.case.motions == (Scale("airfoil", (1.5, 1.0)),)


def test_a_rotation_is_typed_and_an_intersection_is_told_meanwhile_of_the_last_motion_only(
    opened, monkeypatch
):
    from slideviz.color_scheme import INTERSECTION_COLOR
    from slideviz.session import jobs
    from slideviz.terms import ROLES

    opened.add_motion(Rotate)
    editor = opened.window.motions.editor
    opened.type(editor.angle, "90")
    assert opened.session.case.motions[0] == Rotate("airfoil", 90.0)
    nodes = opened.session.mesh.marker("airfoil").nodes
    start = opened.session.mesh.points[nodes]
    assert np.allclose(ghost(opened).mean(axis=0), start.mean(axis=0))
    opened.choose(editor.about, "point")
    assert np.allclose(opened.session.case.motions[0].point, start.mean(axis=0))
    opened.type(editor.point.fields[0], "0")
    opened.type(editor.point.fields[1], "0")
    assert opened.session.case.motions[0].point == (0.0, 0.0)
    assert np.allclose(ghost(opened), np.stack([-start[:, 1], start[:, 0]], 1))
    assert not editor.axis.isVisible(), "a 2D mesh has but one axis"
    opened.window.store.change(changes.set_case, motions=())
    window, panel = opened.window, opened.window.run_panel
    # Periodic sides that move along may be passed; others may not.
    window.store.change(changes.set_case, periodic="periodic")
    opened.add_motion(Translate)
    field = window.motions.editor.vector.fields[1]
    opened.type(field, "0.01")
    opened.qtbot.waitUntil(lambda: not window.intersection_check.busy)
    assert panel.run.isEnabled()
    drawn = window.scene.plotter.actors["motion:airfoil"]
    assert drawn.prop.color == ROLES["moving"].color
    opened.type(field, "-0.4")
    opened.qtbot.waitUntil(lambda: not panel.run.isEnabled())
    assert "puts airfoil through periodic_1" in panel.text.text()
    assert "move airfoil less" in panel.text.toolTip()
    assert drawn.prop.color == INTERSECTION_COLOR
    assert "href='motion'" in panel.text.text()
    # The number that was typed just before F5 counts, not what is known of the one before.
    opened.click(field)
    field.selectAll()
    QTest.keyClicks(field, "0.02")
    QTest.keyClick(field, Qt.Key.Key_F5)
    assert opened.session.runs[-1].case.motions[0].vector == (0.0, 0.02)
    opened.settle()
    assert opened.session.run_shown.end == "done"
    assert drawn.prop.color == ROLES["moving"].color
    opened.window.store.change(changes.set_case, motions=())
    asked = []

    def listening(case, mesh, job):
        asked.append(case.motions[0].vector[1])
        return "", ""

    opened.qtbot.waitUntil(lambda: not window.intersection_check.busy)
    monkeypatch.setattr(jobs, "find_intersection", listening)
    opened.add_motion(Translate)
    field = window.motions.editor.vector.fields[1]
    opened.click(field)
    field.selectAll()
    QTest.keyClicks(field, "0.123456")
    opened.qtbot.waitUntil(lambda: not window.intersection_check.busy)
    assert asked[-1] == 0.123456
    assert len(asked) <= 2


def test_a_displacement_file_and_what_is_typed_are_checked_at_once(opened, tmp_path):
    node = int(opened.session.mesh.marker("airfoil").nodes[0])
    file = tmp_path / "d.txt"
    file.write_text(f"{node} 0.5 0.25\n")
    opened.add_motion(FromFile)
    opened.type(opened.window.motions.editor.path, str(file))
    assert opened.session.case.motions == (FromFile(file, "airfoil"),)
    assert np.allclose(ghost(opened)[0] - opened.session.mesh.points[node], [0.5, 0.25])
    opened.type(opened.window.motions.editor.path, str(file) + "x")
    assert "does not exist" in opened.window.run_panel.text.text()
    opened.window.store.change(changes.set_case, motions=())
    opened.add_motion(Translate)
    field = opened.window.motions.editor.vector.fields[0]
    opened.click(field)
    field.selectAll()
    QTest.keyClicks(field, "1.5e")
    assert field.property("bad")
    assert "not a number" in field.toolTip()
    assert opened.session.case.motions[0].vector == (0.0, 0.0), "a valid beginning is withdrawn"
    QTest.keyClick(field, Qt.Key.Key_Tab)
    assert opened.session.case.motions[0].vector == (0.0, 0.0), "what was there before"
    assert field.text() == "1.5e", "what was typed stays, marked"
    assert field.property("bad")
    opened.window.store.change(changes.set_case, motions=())
    opened.add_motion(Translate)
    field = next(f for f in opened.window.motions.findChildren(NumberField) if f.isVisible())
    before = field.text()
    opened.type(field, "1..5")
    said = opened.window.statusBar().currentMessage()
    assert said == f"Invalid: “1..5” is not a number; the value is still {before}."
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert field.text() == before
    assert not opened.window.statusBar().currentMessage()


def test_motions_are_reordered_changed_and_removed_and_need_a_moving_boundary(opened):
    panel = opened.window.motions
    opened.add_motion(Translate)
    opened.add_motion(Rotate)
    assert panel.list.currentRow() == 1
    opened.click(panel.findChild(QToolButton, "motion_up"))
    assert [type(motion) for motion in opened.session.case.motions] == [Rotate, Translate]
    assert panel.list.currentRow() == 0
    opened.choose(panel.editor.kind, Scale)
    assert [type(motion) for motion in opened.session.case.motions] == [Scale, Translate]
    opened.click(panel.findChild(QToolButton, "motion_remove"))
    assert [type(motion) for motion in opened.session.case.motions] == [Translate]
    opened.click(panel.findChild(QToolButton, "motion_remove"))
    assert not opened.session.case.motions
    assert not panel.editor.isVisible()
    opened.role("airfoil", "fixed")
    assert not panel.add.isEnabled()
    assert "moving" in panel.hint.text()
    assert "moving" in panel.add.toolTip()


# Method -----------------------------------------------------------------------------------


def test_settings_reach_the_case_and_impossible_numbers_do_not(opened):
    method = opened.window.method
    opened.choose(method.sliding, "ds")
    opened.choose(method.periodic, "moving")
    opened.choose(method.periodic_type, "translational")
    method.steps.selectAll()
    QTest.keyClicks(method.steps, "12")
    opened.window.docks["method"].raise_()
    opened.click(method.more.button)
    more = method.more
    opened.choose(more.kernel, "wendland-c4")
    opened.choose(more.quality_metric, "rbf-slide")
    opened.type(more.influence_factor, "3.5")
    opened.type(more.feature_angle_deg, "35")
    case = opened.session.case
    assert (case.sliding, case.periodic, case.periodic_type) == ("ds", "moving", "translational")
    assert (case.steps, case.influence_factor, case.feature_angle_deg) == (12, 3.5, 35.0)
    assert (case.quality_metric, case.kernel) == ("rbf-slide", "wendland-c4")
    assert "λ =" in method.period_hint.text()
    field = more.influence_factor
    opened.window.store.change(changes.set_case, influence_factor=2.5)
    field.selectAll()
    QTest.keyClicks(field, "-1")
    assert field.property("bad")
    assert "-1 is out of range; expected a number above 1e-06" in field.toolTip()
    assert opened.session.case.influence_factor == 2.5
    opened.type(field, "auto")
    assert opened.session.case.influence_factor == 0
    assert field.text() == "automatic"
    assert more.radius.isHidden()  # nothing moves
    kernel = more.kernel
    assert kernel.count() == 14
    assert {kernel.itemData(row) for row in range(14)} >= {"wendland-c2", "gaussian"}


def test_what_is_not_available_says_why(opened):
    method = opened.window.method
    for name in ("periodic_1", "periodic_2", "inflow", "outflow"):
        opened.role(name, "fixed")
    assert not method.periodic.isEnabled()
    assert "no boundary has the role" in method.periodic.toolTip()
    assert not method.sliding.isEnabled()
    assert "Periodicity: no boundary" in method.idle_reasons.text()
    opened.role("periodic_1", "periodic")
    assert method.periodic.isEnabled()
    assert "Whether" not in method.periodic.toolTip()


def test_data_reduction_has_a_tolerance_in_length_and_keeps_its_settings(opened):
    method, more = opened.window.method, opened.window.method.more
    opened.window.docks["method"].raise_()
    opened.click(more.button)
    assert opened.session.case.reduction == AUTO
    assert method.reduction.currentText() == "automatic"
    assert not method.tolerance.isVisible()
    assert more.selection.isEnabled()
    opened.choose(method.reduction, "NO")
    assert opened.session.case.reduction is None
    assert "data reduction is off" in more.selection.toolTip()
    opened.choose(method.reduction, "YES")
    assert method.tolerance.isVisible()
    given = opened.session.case.reduction
    extent = opened.session.mesh.extent
    assert given.tolerance == pytest.approx(1e-5 * extent, rel=0.05)
    assert "of the extent" in method.tolerance_hint.text()
    opened.type(method.tolerance, "0.002")
    opened.choose(more.selection, "double")
    opened.choose(more.levels, "tol")
    opened.type(more.level_end, "2")
    assert opened.session.case.reduction.level_tolerance == 0.5, "2 is no part"
    opened.type(more.level_end, "0.25")
    opened.type(more.gamma, "30")
    wanted = Reduction(0.002, True, "tol", 0.25, selection="double", gamma=30.0)
    assert opened.session.case.reduction == wanted
    opened.choose(method.reduction, "NO")
    assert opened.session.case.reduction is None
    opened.choose(method.reduction, "YES")
    assert opened.session.case.reduction == wanted
    given = Reduction(relative=1e-4, gamma=20.0)
    opened.window.store.change(changes.set_case, reduction=given)
    assert method.tolerance.value == pytest.approx(1e-4 * extent, rel=1e-5)
    opened.type(method.tolerance, "0.25")
    assert opened.session.case.reduction == Reduction(0.25, gamma=20.0)


# Running ----------------------------------------------------------------------------------


def test_what_is_missing_leads_to_its_panel_and_what_does_nothing_is_said(opened):
    panel = opened.window.run_panel
    assert "airfoil” has no motion" in panel.text.text()
    assert not panel.run.isEnabled()
    opened.window.docks["method"].raise_()
    motions = opened.window.motions
    opened.qtbot.waitUntil(lambda: motions.visibleRegion().isEmpty())
    panel.text.linkActivated.emit("motion")
    opened.qtbot.waitUntil(lambda: not motions.visibleRegion().isEmpty())
    said = opened.window.boundaries.idle_text
    assert not said.isVisible()
    opened.window.store.change(changes.set_case, sliding="none", periodic="none")
    assert said.text().splitlines() == [
        "Periodicity is “none”: periodic_1 and periodic_2 will not stay periodic.",
        "Sliding is “none”: inflow and outflow will not slide.",
    ]
    opened.window.store.change(changes.set_view, color_by="displacement")
    assert "no displacement yet" in opened.window.statusBar().currentMessage()


def run(driver, steps=3):
    driver.window.store.change(changes.set_case, steps=steps)
    driver.click(driver.window.run_panel.run)
    driver.settle()


def test_an_automatic_run_says_how_many_steps_it_took(ready):
    window = ready.window
    window.docks["method"].raise_()
    window.method.steps.setValue(0)
    assert window.method.steps.text() == "automatic"
    ready.click(window.run_panel.run)
    ready.settle()
    frames = ready.session.frames
    count = len(frames) - 1
    assert count == frames[-1].step.total >= 1
    assert [frame.step.index for frame in frames[1:]] == list(range(1, count + 1))
    assert window.player.step_text.text() == f"Step {count} of {count}"
    assert f"Done: {count} step" in window.statusBar().currentMessage()
    assert len(frames[-1].step.tried) >= 2


def test_the_slider_the_buttons_and_the_keys_show_steps_and_playing_in_a_loop_begins_again(
    ran, monkeypatch
):
    player, window = ran.window.player, ran.window
    shown = window.scene.drawn["airfoil"].shape
    nodes = ran.session.mesh.marker("airfoil").nodes
    for step, go in (
        (1, lambda: player.slider.setValue(1)),
        (2, lambda: ran.click(player.buttons["next"])),
        (0, lambda: ran.click(player.buttons["first"])),
        (3, lambda: ran.click(player.buttons["last"])),
        (2, lambda: ran.click(player.buttons["previous"])),
        (0, lambda: QTest.keyClick(window, Qt.Key.Key_Home)),
    ):
        go()
        assert ran.session.view.frame == step
        wanted = ran.session.frames[step].mesh.points[nodes]
        assert np.allclose(np.asarray(shown.points)[:, :2], wanted)
        assert player.slider.value() == step
    player.go(3)
    monkeypatch.setattr(player_module, "TICK_MS", 10**8)  # by itself it does not tick
    player._clock = OneStepEachTick(player)
    told = []
    ran.window.store.listen(lambda _old, new: told.append(new.view.frame))

    def tick():
        QApplication.sendEvent(player._timer, QTimerEvent(player._timer.timerId()))

    ran.click(player.buttons["loop"])
    ran.click(player.buttons["play"])
    for _ in range(5):
        tick()
    assert told == [0, 1, 2, 3, 0, 1]
    assert player.playing
    ran.click(player.buttons["loop"])
    tick()
    assert player.playing
    tick()
    assert not player.playing
    assert told[-2:] == [2, 3]


class OneStepEachTick:
    """A clock by which every tick of a player comes when the next step is due."""

    def __init__(self, player):
        self.player = player

    def start(self):
        pass

    def restart(self):
        return step_ms(len(self.player.store.session.frames) - 1, self.player.speed)


@pytest.mark.parametrize(
    ("steps", "speed", "ms"), [(5, 1, 500), (5, 2, 250), (20, 1, 150), (20, 0.5, 300), (500, 1, 50)]
)
def test_few_steps_are_played_slowly_and_a_film_takes_three_seconds(steps, speed, ms):
    assert step_ms(steps, speed) == ms


def test_playing_ends_at_the_last_step_and_its_speed_is_chosen_also_meanwhile(ran):
    player = ran.window.player
    ran.click(player.buttons["play"])
    assert player._timer.interval() == 500
    player.speed_button.menu().actions()[0].trigger()
    assert (player.speed_button.text(), player._timer.interval()) == ("0.5×", 1000)
    player.stop()
    player.go(3)
    player.set_speed(4.0)
    ran.click(player.buttons["play"])
    assert ran.session.view.frame == 0
    ran.qtbot.waitUntil(lambda: ran.session.view.frame == 3)
    ran.qtbot.waitUntil(lambda: not player.playing)


def test_where_drawing_takes_long_steps_are_left_out(ran, monkeypatch):
    player = ran.window.player
    player.set_speed(4.0)
    told = []
    ran.window.store.listen(lambda _old, new: told.append(new.view.frame))
    ran.click(player.buttons["play"])
    monkeypatch.setattr(player, "_clock", SimpleNamespace(restart=lambda: 265))
    ran.qtbot.waitUntil(lambda: not player.playing)
    assert told == [0, 2, 3]


@pytest.mark.usefixtures("painted")
@pytest.mark.window("own")
def test_a_run_shows_its_steps_and_the_quality_and_no_size_changes_with_the_numbers(ready):
    window, player = ready.window, ready.window.player
    parts = (window.view, player.slider, window.docks["boundaries"], window.docks["runs"])
    QApplication.processEvents()
    widths = [part.width() for part in parts]
    run(ready)
    for step in (3, 0, 2, 1):
        player.go(step)
        QApplication.processEvents()
        assert [part.width() for part in parts] == widths
    player.go(3)
    session = ready.session
    assert len(session.frames) == 4
    assert session.view.frame == 3
    assert session.view.color_by == "size-skew"
    assert window.player.step_text.text() == "Step 3 of 3"
    quality = session.deformed.quality
    window.resize(1920, 1080)
    ready.qtbot.waitUntil(lambda: f"{quality.mean:.4f}" in window.player.result.text())
    text = window.player.result.text()
    assert f"{quality.min:.4f}" in text
    assert "<b>0</b> inverted" in text
    assert window.windowTitle().startswith("*")
    assert list(window.scene.plotter.scalar_bars.keys()) == ["size-skew"]


@pytest.mark.window("own")
def test_numbers_without_room_are_shorter_and_a_narrow_player_leaves_out_speed_before_them(ran):
    ran.window.resize(1280, 800)
    QApplication.processEvents()
    shown = plain(ran.window.player.result.text())
    for word in ("inv", f"min {ran.session.frame.quality.min:.4f}", "mean"):
        assert word in shown
    player = ran.window.player
    ran.window.resize(900, 620)
    ran.qtbot.waitUntil(lambda: not player.speed_button.isVisible())
    assert player.step_text.text() == "3/3"
    ran.qtbot.waitUntil(lambda: player.step_text.x() > player.slider.geometry().right())
    ran.qtbot.waitUntil(lambda: "inv" in plain(player.result.text()))
    # Whatever was there before: a label without words would keep no room for any.
    player.result.resize(0, player.result.height())
    ran.window.resize(901, 620)
    ran.qtbot.waitUntil(lambda: "inv" in plain(player.result.text()))
    ran.window.resize(1280, 800)
    ran.qtbot.waitUntil(player.speed_button.isVisible)
    assert player.step_text.text() == "Step 3 of 3"
    result = player.result
    full, *short = [[plain(part) for part in form] for form in result_parts(ran.session)]
    result.resize(5000, 20)
    assert [part.strip() for part in plain(result.text()).split("·")] == full
    assert not result.toolTip()
    seen = set()
    for width in range(40, 600, 10):
        result.resize(width, 20)
        text = plain(result.text())
        shown = [part.strip() for part in text.split("·")] if text else []
        assert shown in (full, *short) or shown == short[-1][: len(shown)]
        assert not text or result.minimumSizeHint().width() <= width
        seen.add(tuple(shown))
    assert {tuple(form) for form in (full, *short)} <= seen
    result.resize(120, 20)
    assert full[1] in plain(result.toolTip())
    # A number keeps its digits, or is left out: 0.38 for 0.3839 looks cut off.
    assert all(form[1:3] == full[1:3] for form in short)


def test_cancel_keeps_the_steps_that_are_done(ready, answers, tmp_path):
    window = ready.window
    window.store.change(changes.set_case, steps=2000)
    ready.click(window.run_panel.run)
    ready.qtbot.waitUntil(lambda: len(ready.session.frames) > 3)
    assert window.run_panel.cancel.isVisible()
    assert not window.run_panel.run.isVisible()
    ready.click(window.run_panel.cancel)
    ready.settle()
    count = len(ready.session.frames)
    assert 3 < count < 2000
    assert ready.session.deformed.step.index == count - 1
    assert window.run_panel.run.isVisible()
    assert ready.session.unsaved_mesh
    # What it shows is a part of the motion, and everything says so.
    words = f"step {count - 1} of 2000"
    told = f"Run 1 was cancelled after {words}: the mesh has {100 * (count - 1) / 2000:.3g} % of"
    assert window.statusBar().currentMessage().startswith(told)
    assert ready.told.startswith(told)
    assert window.player.step_text.text().lower() == words
    assert window.windowTitle() == f"*passage.cfg – {words} – slideviz"
    assert window.run_panel.text.text().startswith(f"Stopped after {words}")
    options = PictureOptions((1600, 1000), title=True)
    assert f", {words}:" in headings([ready.session], options)[0][0]
    asked = answers("ask_save", tmp_path / "part.su2")
    window.files.save_mesh()
    ready.settle()
    assert asked[0][0] == f"Save mesh: {words}"
    assert asked[0][1].name == f"passage_step{count - 1}of2000.su2"
    assert told in window.banner.text.text()
    # Another step is saved as before, by its number.
    window.player.go(2)
    window.files.save_mesh()
    ready.settle()
    assert asked[1][1].name == "passage_step2.su2"


def test_a_run_that_fails_says_why_and_leaves_the_window_usable(ready, monkeypatch):
    from slideviz.errors import DeformError

    def broken(*_):
        raise DeformError("the system is singular; use another radius")

    with monkeypatch.context() as patch:
        patch.setattr(jobs, "compute", broken)
        ready.click(ready.window.run_panel.run)
        ready.settle()
    assert "singular" in ready.window.banner.text.text()
    assert ready.window.run_panel.run.isEnabled()
    run(ready, 1)
    assert len(ready.session.frames) == 2


@pytest.mark.window("own")
def test_what_is_typed_into_the_limits_counts_at_f5(ready):
    window = ready.window
    window.dock_manager.bring_to_front("limits")
    field = window.dock_manager.panels["limits"].field
    field.setFocus()
    QTest.keyClicks(field, "min > 0.1")
    QTest.keyClick(field, Qt.Key.Key_F5)
    ready.settle()
    assert [str(limit) for limit in ready.session.run_shown.case.limits] == ["min > 0.1"]
    assert ready.session.run_shown.last.limits[0].passed


def test_changed_settings_are_told(ready):
    run(ready, 1)
    assert DONE in ready.window.run_panel.text.text()
    ready.window.store.change(changes.set_case, steps=4)
    assert "changed" in ready.window.run_panel.text.text()
    run(ready, 4)
    ready.window.store.change(changes.show_run, 1)
    text = ready.window.run_panel.text
    assert "The panels differ from run 1." in text.text()
    width = text.sizeHint().width()
    assert width > 0
    text.linkActivated.emit("settings")
    assert ready.session.case.steps == 1
    assert DONE in text.text()


def ended_badly(driver, texts=(), inverted=38):
    """Let a run end with warnings and inverted cells, without computing one."""
    run(driver, 1)
    session = driver.session
    last = session.runs[-1].last
    status = last.quality.status.copy()
    status[:inverted] = INVERTED
    bad = replace(last.quality, status=status)
    frame = replace(last, quality=bad, step=replace(last.step, messages=tuple(texts)))
    ended = replace(session.runs[-1], frames=(frame,))
    driver.window.store.put(replace(session, runs=(*session.runs[:-1], ended)))
    driver.window.running._run_done(None)
    return ended


def test_large_numbers_have_separators_in_the_status_bar(ready, monkeypatch):
    monkeypatch.setattr(Quality, "inverted", 1911)
    ended_badly(ready)
    assert "1,911 inverted" in ready.window.statusBar().currentMessage()


def test_the_strip_says_nothing_twice(ready):
    from slideviz.session.jobs import intersection_key, set_intersection

    doubt = Doubt("airfoil goes through itself near (0, 0)", "move it less")
    window = ready.window
    ended_badly(ready, (doubt, "another warning"))
    key = intersection_key(ready.session)
    window.store.change(set_intersection, ("", doubt), key)
    window.running._run_done(None)
    told = ready.told
    assert told.startswith("38 inverted cells. airfoil goes through itself")
    assert told.count("goes through itself") == 1
    assert told.count("another warning") == 1


def test_inverted_cells_are_told_in_red_with_what_would_help(ready):
    run_ = ended_badly(ready)
    panel, banner = ready.window.run_panel, ready.window.run_panel.strip.rows[0]
    assert "Done: 38 inverted cells" in panel.text.text()
    assert panel.text.property("bad")
    assert "more steps" in banner.text.text()
    assert panel.strip.count.text() == "1 error ▴"
    assert banner.isVisible()
    assert banner.property("calm") is False
    assert "38 inverted cells. What may help: " in banner.text.text()
    assert "inverted" in "".join(end_parts(run_))
    # From step 0, and from an order of one's own, too.
    session, table = ready.session, ready.window.dock_manager.panels["worst"].table
    table.sortByColumn(CELL, Qt.SortOrder.DescendingOrder)
    ready.window.store.change(changes.show_frame, 0)
    banner.answers["Show the worst"].click()
    worst = worst_cells(session.frames, 1, "size-skew").cells[0]
    assert ready.session.view.marked_cell == worst
    assert ready.session.frame is session.frames[-1]
    assert not table.visibleRegion().isEmpty()
    run(ready, 1)
    assert DONE in panel.text.text()
    assert not panel.text.property("bad")
    assert not panel.strip.rows
    assert not panel.strip.count.isVisible()
    banner = ready.window.banner
    banner.ask("a question", {"Yes": lambda: None})
    banner.show_message("something else")
    assert not banner.answers


def test_the_strip_is_not_about_a_run_that_is_no_longer_shown(ready):
    run(ready, 1)
    ended_badly(ready)
    window = ready.window
    first, last = (one.number for one in ready.session.runs)
    window.store.change(changes.set_view, frame=0)
    assert "38 inverted cells" in ready.told
    window.store.change(changes.show_run, first)
    assert not ready.told
    # What the banner says of other things stays.
    window.store.change(changes.show_run, last)
    window.banner.show_message("something else")
    window.store.change(changes.show_run, first)
    assert window.banner.isVisible()


def test_what_is_harmless_is_counted_and_listed_when_asked_for(ready, caplog):
    caplog.set_level("INFO")
    said = note("24 nodes are not control nodes, so this does no harm")
    ended_badly(ready, [said], inverted=0)
    strip = ready.window.run_panel.strip
    assert not strip.rows[0].isVisible()
    assert [r.levelname for r in caplog.records if "no harm" in r.message] == ["INFO"]
    assert "24 nodes are not control nodes" in describe_run(ready.session.runs[-1])
    assert DONE in strip.text.text()
    assert strip.text.text().endswith(" times as far.</a>")
    assert strip.count.text() == "1 note ▾"
    ready.click(strip.count)
    assert strip.rows[0].isVisible()
    assert ready.told == f"Note: {said}"
    ended_badly(ready, [said, "the solver stopped early"], inverted=0)
    assert strip.count.text() == "1 warning, 1 note ▾"
    assert all(row.property("calm") for row in strip.rows)
    assert ready.told == f"the solver stopped early\nNote: {said}"


def test_buttons_of_messages_make_the_settings_that_they_advise(ready):
    off = Message("node 3 has left HUB", "RIMS= SLIDE keeps such nodes on it")
    ended_badly(ready, [off])
    store = ready.window.store
    ready.answer("Nodes on walls “stay on walls”")
    assert ready.session.case.rims == "slide"
    assert store.can_undo == "settings"
    assert not any("stay on walls" in text for row in strip_rows(ready) for text in row.answers)
    store.undo()
    assert ready.session.case.rims == "free"
    store.change(changes.set_case, relax="yes", method="idw")
    (task,) = strip_rows(ready)[:1]
    assert set(task.answers) == {
        "Relaxation “automatic”",
        "Method “RBF interpolation”",
        "Show the boundaries",
    }


def strip_rows(driver):
    return driver.window.run_panel.strip.rows


def test_what_is_no_file_is_told_without_a_question_about_unsaved_work(ran, tmp_path):
    for path, words in ((tmp_path, "this is a folder"), (tmp_path / "no.su2", "no such file")):
        ran.window.files.open_path(path)
        assert words in ran.window.banner.text.text()
        assert not ran.window.runner.busy


def test_opening_while_running_cancels_the_run(ready, passage_file, answers):
    answers("ask_unsaved", "discard")
    ready.window.store.change(changes.set_case, steps=2000)
    ready.click(ready.window.run_panel.run)
    ready.qtbot.waitUntil(lambda: len(ready.session.frames) > 1)
    ready.window.files.open_path(Path(passage_file))
    ready.qtbot.waitUntil(lambda: ready.session.path == Path(passage_file))
    ready.settle()
    assert len(ready.session.frames) == 1


@pytest.mark.window("own")
def test_closing_while_running_ends_the_run(ready, answers):
    asked = answers("ask_unsaved", "discard")
    ready.window.store.change(changes.set_case, steps=2000)
    ready.click(ready.window.run_panel.run)
    ready.qtbot.waitUntil(lambda: len(ready.session.frames) > 1)
    assert ready.window.close()
    assert len(asked) == 1
    assert not ready.window.isVisible()
    assert not ready.window.runner.alive


@pytest.mark.window("own")
def test_closing_while_running_stops_the_run_and_asks_for_its_mesh(ready, monkeypatch, answers):
    window = ready.window
    window.store.change(changes.set_case, steps=2000)
    ready.click(window.run_panel.run)
    ready.qtbot.waitUntil(lambda: len(ready.session.frames) > 2)
    replies, asked = iter(["cancel", "again", "run", "cancel", "discard"]), []

    def reply(_parent, question, can_save, now):
        asked.append((question.splitlines()[0], can_save, now()))
        return next(replies)

    monkeypatch.setattr(questions, "ask_unsaved", reply)
    assert not window.close()
    assert window.runner.busy
    # Where the question has become another one, it is asked anew.
    assert not window.close()
    ready.qtbot.waitUntil(lambda: len(asked) == 4)
    count = len(ready.session.runs[-1].frames)
    assert all(can_save == ["run"] for _, can_save, _ in asked[:3])
    assert asked[0][0].startswith("Run 1 is still running. Stop it and keep its ")
    case, mesh = "the changes to passage.cfg", f"the deformed mesh of run 1 (step {count} of 2000)"
    assert asked[3][:2] == (
        f"Save {case} and {mesh} before closing?",
        ["session", "case", "mesh"],
    )
    assert window.isVisible()
    assert ready.session.run_shown.end == "cancelled"
    assert f"cancelled after step {count} of 2000" in ready.told
    assert f"cancelled after step {count} of 2000" in window.statusBar().currentMessage()
    assert window.close()


# Saving -----------------------------------------------------------------------------------


def test_the_mesh_is_saved_as_it_is_at_the_step_that_is_shown(ran, answers, tmp_path):
    ran.window.player.go(1)
    asked = answers("ask_save", tmp_path / "out.vtu")
    ran.window.actions_table.by_name["save_mesh"].trigger()
    ran.settle()
    assert asked[0][1].name == "passage_step1.su2"
    assert (tmp_path / "out.vtu").stat().st_size > 1000
    assert ran.session.unsaved_mesh, "the last step is not on disk"
    ran.window.player.go(3)
    asked = answers("ask_save", tmp_path / "out.su2")
    ran.window.actions_table.by_name["save_mesh"].trigger()
    ran.settle()
    assert asked[0][1].name == "passage_deformed.su2"
    saved = read(tmp_path / "out.su2")
    assert np.array_equal(saved.points, ran.session.deformed.mesh.points)
    assert not ran.session.unsaved_mesh


def test_the_input_is_replaced_only_when_confirmed(opened, answers, passage_file):
    before = Path(passage_file).read_bytes()
    opened.add_motion(Translate)
    opened.type(opened.window.motions.editor.vector.fields[0], "0.01")
    run(opened, 1)
    answers("ask_save", Path(passage_file))
    for sure in (False, True):
        asked = answers("ask_overwrite_input", sure)
        opened.window.actions_table.by_name["save_mesh"].trigger()
        opened.settle()
        assert len(asked) == 1
        assert (Path(passage_file).read_bytes() != before) == sure


def test_a_case_is_saved_and_means_the_same(opened, answers, tmp_path):
    opened.add_motion(Rotate)
    opened.type(opened.window.motions.editor.angle, "4")
    opened.choose(opened.window.method.sliding, "ps")
    assert opened.window.windowTitle().startswith("*")
    answers("ask_save", tmp_path / "a.cfg")
    opened.window.actions_table.by_name["save_case"].trigger()
    assert opened.window.windowTitle() == "a.cfg – slideviz"
    case = Case.read(tmp_path / "a.cfg")
    assert case.motions == (Rotate("airfoil", 4.0),)
    assert case.sliding == "ps"
    assert case.periodic == "moving"
    opened.open(tmp_path / "a.cfg")
    assert opened.session.case.motions == case.motions
    assert not opened.session.unsaved_case


@pytest.mark.window("own")
def test_a_saved_view_is_shown_again_after_it_was_opened_in_a_narrower_window(
    opened, answers, tmp_path
):
    window, camera = opened.window, opened.window.scene.camera
    size = window.size()
    camera.zoom_at(200, 200, 2.0)
    saved = camera.place
    answers("ask_save", tmp_path / "a.cfg")
    window.actions_table.by_name["save_case"].trigger()
    window.resize(900, size.height())
    come_to_rest()
    opened.open(tmp_path / "a.cfg")
    assert camera.place[9] > 1.2 * saved[9], "all its width is seen"
    window.resize(size)
    come_to_rest()
    assert camera.place == pytest.approx(saved, abs=1e-9)


@pytest.mark.window("own")
def test_nothing_is_asked_when_nothing_changed_or_a_case_cannot_be_written(
    opened, answers, tmp_path
):
    answers("ask_save", tmp_path / "no" / "a.cfg")
    opened.window.actions_table.by_name["save_case"].trigger()
    assert "a.cfg" in opened.window.banner.text.text()
    assert opened.window.close()


def test_a_picture_is_saved_at_the_size_asked_for(opened, answers, tmp_path, monkeypatch):
    from PIL import Image

    from slideviz.gui.dialogs.pictures import PictureDialog

    def accept(dialog):
        dialog.width_px.setValue(1280)
        dialog.height_px.setValue(800)
        dialog.background.show_value("transparent")
        dialog.accept()
        return dialog.DialogCode.Accepted

    monkeypatch.setattr(PictureDialog, "exec", accept)
    answers("ask_save", tmp_path / "a.png")
    opened.window.actions_table.by_name["save_picture"].trigger()
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (1280, 800)
        assert image.mode == "RGBA"
        assert image.getpixel((1, 1))[3] == 0
        orange = sum(n for n, c in image.getcolors(2**24) if c[:3] == (0xD5, 0x5E, 0))
    assert orange > 500
    before = opened.window.view.snapshot()
    assert before.std() > 5, "the view still works"


@pytest.mark.parametrize("given", [("cancel", "case"), ("discard",)])
@pytest.mark.window("own")
def test_unsaved_changes_are_asked_about_on_close(opened, answers, tmp_path, given):
    opened.role("airfoil", "fixed")
    for answer in given:
        asked = answers("ask_unsaved", answer)
        answers("ask_save", tmp_path / "a.cfg")
        closed = opened.window.close()
        assert closed == (answer != "cancel")
        assert asked[0][0] == "Save roles, motions and method as a case before closing?"
        assert (tmp_path / "a.cfg").exists() == (answer == "case")


@pytest.mark.window("own")
def test_the_question_names_other_runs_whose_mesh_would_be_lost(ready, answers):
    asked = answers("ask_unsaved", "cancel")
    run(ready, 1)
    run(ready, 2)
    ready.window.close()
    assert asked[-1][0].endswith("The mesh of run 1 is not saved either.")
    ready.window.store.change(changes.show_run, 1)
    ready.window.store.change(changes.saved_mesh)
    ready.window.store.change(changes.show_run, 2)
    ready.window.close()
    assert "either" not in asked[-1][0]


@pytest.mark.window("own")
def test_the_question_promises_the_same_result_only_where_that_is_true(ready, answers):
    asked = answers("ask_unsaved", "cancel")
    ready.window.store.change(changes.set_case, sliding="ds")
    run(ready, 1)
    ready.window.close()
    assert "repeats run 1 exactly" in asked[-1][0]
    only = ready.session.runs[0]
    stopped = replace(only, end="cancelled")
    ready.window.store.change(lambda session: replace(session, runs=(stopped,)))
    ready.window.close()
    assert "repeats" not in asked[-1][0]
    ready.window.store.change(lambda session: replace(session, runs=(only,)))
    ready.window.store.change(changes.saved_mesh)
    ready.window.close()
    question = "Save the changes to passage.cfg before closing?"
    assert asked[-1][:2] == (
        f"{question}\nThe case repeats run 1 exactly.",
        ["session", "case"],
    )
    ready.window.store.change(changes.set_case, steps=7)
    ready.window.close()
    assert asked[-1][:2] == (question, ["session", "case"])


# View -------------------------------------------------------------------------------------


def test_a_long_message_loses_its_middle_and_the_tip_has_it(opened):
    """As after a live run: numbers are at both ends."""
    window = opened.window
    words = f"Done: min 0.8218, {'mean 0.9302, 0 inverted, ' * 12}the preview was off by 0.0013"
    window.show_status(words)
    come_to_rest()
    assert window.said.shown.startswith("Done: min 0.8218, mean")
    assert "…" in window.said.shown[20:-20]
    assert window.said.shown.endswith("off by 0.0013")
    assert "the preview was off by 0.0013" in window.said.toolTip()
    assert words.count("mean") == window.said.toolTip().count("mean")
    assert window.said.geometry().right() <= window.mesh_text.geometry().left()
    window.show_status("Saved")
    assert window.said.shown == window.said.toolTip() == "Saved"
    window.show_status("")
    assert window.said.shown == window.said.toolTip() == ""


@pytest.mark.usefixtures("painted")
def test_colors_edges_and_ghosts_are_switched_from_the_tool_bar_and_undo_says_what_it_undid(
    opened,
):
    window, said = opened.window, opened.window.statusBar().currentMessage
    undo, redo = (window.actions_table.by_name[name] for name in ("undo", "redo"))
    window.store.change(changes.set_view, edges=False)
    undo.trigger()
    assert said() == "Undone: mesh edges"
    redo.trigger()
    assert said() == "Redone: mesh edges"
    keys = {keys.toString() for keys in redo.shortcuts()}
    assert {"Ctrl+Shift+Z", "Ctrl+Y"} <= keys
    bar = opened.window.actions_table
    opened.choose(bar.bar.color, "skew")
    assert opened.session.view.color_by == "skew"
    for name in ("edges", "undeformed", "motion_ghost", "legend"):
        before = name in opened.session.view.drawn
        bar.by_name[name].trigger()
        assert (name in opened.session.view.drawn) is not before
    assert not bar.by_name["perspective"].isEnabled(), "2D has none"


@pytest.mark.usefixtures("painted")
@pytest.mark.window("own")
def test_what_moves_fills_the_view_or_what_is_selected_and_the_wheel_zooms_about_the_mouse(opened):
    window = opened.window
    scale = window.view.camera.parallel_scale
    window.view.signals.zoomed.emit(QPoint(100, 100), 1.5)
    assert window.view.camera.parallel_scale == pytest.approx(scale / 1.5)
    QTest.keyClick(window, Qt.Key.Key_F)
    assert window.view.camera.parallel_scale == pytest.approx(scale)
    before = opened.window.view.snapshot()
    for key in (Qt.Key.Key_W, Qt.Key.Key_S, Qt.Key.Key_R):
        QTest.keyClick(opened.window.view, key)
    assert np.array_equal(opened.window.view.snapshot(), before)
    window, fit = opened.window, opened.window.actions_table.by_name["fit_boundary"]
    whole = window.view.camera.parallel_scale
    QTest.keyClick(window, Qt.Key.Key_F, Qt.KeyboardModifier.ShiftModifier)
    moving = window.view.camera.parallel_scale
    assert moving < whole
    opened.click_row("inflow")
    fit.trigger()
    assert window.view.camera.parallel_scale != moving
    window.store.change(changes.select, ())
    opened.role("airfoil", "fixed")
    assert not fit.isEnabled()


@pytest.mark.window("own")
def test_themes_change_the_view_and_are_remembered(opened, settings):
    opened.window.set_theme("light")
    light = opened.window.view.snapshot()[-5, 5].mean()
    opened.window.actions_table.by_name["theme_dark"].trigger()
    assert opened.window.view.snapshot()[-5, 5].mean() < light - 100
    assert settings.value("theme") == "dark"


@pytest.mark.window("own")
def test_all_panels_fit_1280_x_800_and_links_lead_to_them(ready):
    window = ready.window
    window.resize(1280, 800)
    come_to_rest()
    assert (window.width(), window.height()) == (1280, 800)
    for name in ("motion", "method"):
        window.docks[name].raise_()
        panel = window.dock_manager.panels[name]
        ready.qtbot.waitUntil(lambda panel=panel: not panel.visibleRegion().isEmpty())
        assert panel.height() >= panel.minimumSizeHint().height()
        assert panel.width() >= panel.minimumSizeHint().width()
    bottom = window.run_panel.mapTo(window, window.run_panel.rect().bottomLeft()).y()
    assert bottom < 800
    # Its button stays where it is, however many lines stand beside it.
    places, before = set(), window.run_panel.text.text()
    for lines in (1, 2, 3, 5, 8):
        window.run_panel.text.setText("<br>".join(["A line."] * lines))
        come_to_rest()
        places.add(window.run_panel.run.mapTo(window, QPoint(0, 0)).y())
    assert len(places) == 1
    window.run_panel.text.setText(before)
    assert window.run_panel.run.isVisible()
    from slideviz.session.jobs import intersection_key, set_intersection

    window = ready.window
    ready.qtbot.waitUntil(lambda: not window.intersection_check.busy)
    folding = Message("airfoil goes through itself near (0, 0)", "cells will overlap there")
    key = intersection_key(ready.session)
    window.store.change(set_intersection, ("", folding), key)
    panel = window.run_panel
    assert panel.text.text() == f"<a href='motion'>{folding}.</a>"
    assert panel.run.isEnabled()
    window.docks["method"].raise_()
    panel.text.linkActivated.emit("motion")
    ready.qtbot.waitUntil(lambda: not window.motions.visibleRegion().isEmpty())
    window.store.change(set_intersection, ("", None), key)
    assert panel.text.text() == "Ready."


def test_a_change_is_drawn_in_a_turn_of_its_own(opened, monkeypatch):
    view, drawn = opened.window.view, []
    checks = (opened.window.intersection_check, opened.window.limit_check)
    opened.qtbot.waitUntil(lambda: not any(check.busy for check in checks))
    opened.qtbot.waitUntil(lambda: not view._repaints._timer.isActive())
    monkeypatch.setattr(view, "update", lambda: drawn.append(1))
    for name in ("inflow", "outflow", "inflow"):
        opened.window.store.change(changes.select, (name,))
    assert not drawn
    opened.qtbot.waitUntil(lambda: bool(drawn))
    opened.qtbot.wait(20)
    assert len(drawn) == 1
