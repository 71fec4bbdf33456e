"""The runs panel and two views side by side, driven by mouse and keyboard."""

import csv
import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from qtpy.QtCore import QCoreApplication, QEvent, QPoint, QPointF, Qt, QTimer
from qtpy.QtGui import QContextMenuEvent, QWheelEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QLineEdit

from slideviz.color_scheme import DARK
from slideviz.gui.panels.runs import INVERTED, MEAN, MIN, NUMBER, RUN, WORDS
from slideviz.scene.pick import to_display
from slideviz.session import changes
from slideviz.session.panes import run_title

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def ran(driver, with_runs):
    """Two runs of the passage: pseudo sliding in its steps, direct sliding in three."""
    with_runs({"sliding": "ps", "steps": 2}, {"sliding": "ds", "steps": 3})
    window = driver.window
    window.docks["runs"].raise_()
    driver.qtbot.waitUntil(lambda: window.dock_manager.panels["runs"].tree.isVisible())
    return driver


def panel(driver):
    return driver.window.dock_manager.panels["runs"]


def row(driver, number):
    tree = panel(driver).tree
    items = [tree.topLevelItem(place) for place in range(tree.topLevelItemCount())]
    return next(item for item in items if item.data(RUN, NUMBER) == number)


def place(driver, number):
    return panel(driver).tree.visualItemRect(row(driver, number)).center()


def click(driver, number, double=False, keys=Qt.KeyboardModifier.NoModifier):
    tree = panel(driver).tree
    where = place(driver, number)
    button = Qt.MouseButton.LeftButton
    QTest.mouseClick(tree.viewport(), button, keys, where)
    if double:
        QTest.mouseDClick(tree.viewport(), button, pos=where)


def actions(driver, number):
    return {act.text(): act for act in panel(driver).menu(number).actions() if act.text()}


# The panel --------------------------------------------------------------------------------


def test_a_run_that_failed_in_its_first_step_can_be_selected_and_removed(ran):
    store = ran.window.store
    store.change(lambda session: changes.end_run(changes.start_run(session), "failed"))
    for _ in range(2):
        assert panel(ran).tree.number == 3
        assert panel(ran).buttons["remove"].isEnabled()
        click(ran, 1)
        assert panel(ran).tree.number == 1
        click(ran, 3)
    QTest.mouseClick(panel(ran).buttons["remove"], Qt.MouseButton.LeftButton)
    assert [run.number for run in ran.session.runs] == [1, 2]


def test_without_runs_the_panel_says_what_will_be_there(driver, passage_file):
    driver.open(passage_file)
    driver.window.docks["runs"].raise_()
    assert "Nothing was computed yet" in panel(driver).empty.text()
    assert not panel(driver).tree.isVisibleTo(panel(driver))
    assert not any(button.isEnabled() for button in panel(driver).buttons.values())


def test_each_run_has_a_row_with_its_quality_that_playing_leaves_and_the_best_is_bold(
    ran, monkeypatch
):
    runs = ran.session.runs
    best = max(runs, key=lambda run: run.last.quality.min).number
    for run in runs:
        item, quality = row(ran, run.number), run.last.quality
        assert item.text(MIN) == f"{quality.min:.4f}"
        assert item.text(MEAN) == f"{quality.mean:.4f}"
        assert item.text(INVERTED) == str(quality.inverted)
        assert item.font(MIN).bold() == (run.number == best)
        assert f"{run.last.step.control_nodes:,} nodes" in item.data(RUN, WORDS)
        assert f"steps: {len(run.frames)}" in item.toolTip(RUN)
    assert row(ran, 1).text(RUN) == "1  pseudo sliding"
    assert row(ran, 2).text(RUN) == "2  direct sliding"
    assert panel(ran).tree.currentItem() is row(ran, 2)
    filled = []
    monkeypatch.setattr(panel(ran), "_fill", lambda session: filled.append(session))
    for frame in (0, 1, 2, 3):
        ran.window.store.change(changes.show_frame, frame)
    assert not filled


def test_the_first_row_is_the_undeformed_mesh(ran):
    first, tree = row(ran, changes.UNDEFORMED), panel(ran).tree
    assert first is tree.topLevelItem(0)
    assert first.text(RUN) == "Undeformed"
    assert first.text(MIN) == f"{ran.session.first.quality.min:.4f}"
    click(ran, changes.UNDEFORMED)
    assert (ran.session.shown, ran.session.view.frame) == (2, 0)
    assert tree.currentItem() is first
    enabled = {name for name, button in panel(ran).buttons.items() if button.isEnabled()}
    assert enabled == {"compare", "copy", "export"}
    QTest.keyClick(tree, Qt.Key.Key_F2)
    assert editor(ran) is None
    assert not actions(ran, changes.UNDEFORMED)["Rename\tF2"].isEnabled()
    assert not actions(ran, changes.UNDEFORMED)["Remove"].isEnabled()
    QTest.keyClick(tree, Qt.Key.Key_Down)
    assert (ran.session.shown, ran.session.view.frame) == (1, 2)
    click(ran, changes.UNDEFORMED, keys=Qt.KeyboardModifier.ControlModifier)
    assert ran.session.view.beside == changes.UNDEFORMED
    assert first.data(RUN, WORDS).startswith("beside · ")


def test_runs_of_other_motions_say_which_and_none_is_best(ran):
    (motion, *_), window = ran.session.case.motions, ran.window
    window.store.change(changes.set_case, motions=(replace(motion, angle_deg=-2.5),), steps=1)
    window.start_run()
    ran.settle()
    assert row(ran, 3).data(RUN, WORDS).startswith("rotate -2.5° · ")
    assert row(ran, 1).data(RUN, WORDS).startswith("rotate -8° + translate y +0.12 · ")
    assert "rotate by -2.5° about its centroid" in row(ran, 3).toolTip(RUN)
    assert not row(ran, 3).font(MIN).bold(), "there is nothing to compare it with"
    assert [row(ran, number).font(MIN).bold() for number in (1, 2)].count(True) == 1


def editor(driver):
    return panel(driver).tree.findChild(QLineEdit)


def test_f2_gives_a_run_a_name(ran, qtbot):
    tree = panel(ran).tree
    click(ran, 1)
    QTest.keyClick(tree, Qt.Key.Key_F2)
    assert editor(ran).text() == ""
    QTest.keyClicks(editor(ran), "stiff blade")
    QTest.keyClick(editor(ran), Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: row(ran, 1).text(RUN) == "1  stiff blade")
    assert row(ran, 1).data(RUN, WORDS).startswith("pseudo sliding · ")
    assert "name: stiff blade" in row(ran, 1).toolTip(RUN)
    actions(ran, 2)["Rename\tF2"].trigger()
    qtbot.waitUntil(lambda: editor(ran) is not None and editor(ran).isVisible())
    QTest.keyClicks(editor(ran), "soft")
    # A step that comes meanwhile leaves what is being typed.
    ran.window.store.change(changes.show_beside, 2)
    ran.window.store.change(changes.rename_run, 2, "other")
    assert editor(ran).text() == "soft"
    QTest.keyClick(editor(ran), Qt.Key.Key_Escape)
    assert [run.name for run in ran.session.runs] == ["stiff blade", "other"]
    assert ran.window.viewing.titles[1].text.startswith("Run 2: other · direct sliding")
    ran.window.docks["histogram"].raise_()
    canvas = ran.window.dock_manager.panels["histogram"].canvas
    qtbot.waitUntil(lambda: "run 1: stiff blade" in legend_of(canvas))


def legend_of(canvas):
    """Return the words of the legend of a plot, if it has one yet."""
    legend = canvas.figure.axes[0].get_legend() if canvas.figure.axes else None
    return [text.get_text() for text in legend.get_texts()] if legend is not None else []


def test_a_click_and_the_arrow_keys_show_a_run_with_ctrl_or_twice_one_beside(ran):
    click(ran, 1)
    assert ran.session.shown == 1
    assert ran.session.view.frame == 2
    QTest.keyClick(panel(ran).tree, Qt.Key.Key_Down)
    assert ran.session.shown == 2
    assert ran.session.view.frame == 3
    ran.window.store.change(changes.show_frame, 1)
    click(ran, 1, double=True)
    session = ran.session
    assert (session.shown, session.view.beside, session.view.frame) == (2, 1, 1)
    assert ran.window.viewing.second is not None
    assert "beside" in row(ran, 1).data(RUN, WORDS)
    click(ran, 1, double=True)
    assert (ran.session.shown, ran.session.view.beside) == (2, None)
    assert ran.window.viewing.second is None
    ctrl = Qt.KeyboardModifier.ControlModifier
    ran.window.store.change(changes.show_frame, 2)
    click(ran, 1, keys=ctrl)
    session = ran.session
    assert (session.shown, session.view.beside, session.view.frame) == (2, 1, 2)
    assert panel(ran).tree.currentItem() is row(ran, 2)
    click(ran, 2, keys=ctrl)
    assert (ran.session.shown, ran.session.view.beside) == (2, 1), "no run beside itself"
    click(ran, 1, keys=ctrl)
    assert (ran.session.shown, ran.session.view.beside) == (2, None)


def test_a_click_with_the_right_button_shows_no_other_run(ran):
    ran.window.store.change(changes.show_frame, 1)
    tree, where = panel(ran).tree, place(ran, 1)
    QTest.mousePress(tree.viewport(), Qt.MouseButton.RightButton, pos=where)
    QTest.mouseRelease(tree.viewport(), Qt.MouseButton.RightButton, pos=where)
    spot = tree.viewport().mapToGlobal(where)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, where, spot)
    QApplication.sendEvent(tree.viewport(), event)
    menu = QApplication.activePopupWidget()
    assert (ran.session.shown, ran.session.view.frame) == (2, 1)
    assert tree.currentItem() is row(ran, 2)
    choose(ran, menu, "Show beside run 2")
    assert (ran.session.shown, ran.session.view.beside) == (2, 1)


def choose(driver, menu, text):
    """Click on a line of a menu that is open."""
    driver.qtbot.waitUntil(menu.isVisible)
    act = next(act for act in menu.actions() if act.text() == text)
    where = menu.actionGeometry(act).center()
    QTest.mouseMove(menu, where)
    QTest.mouseClick(menu, Qt.MouseButton.LeftButton, pos=where)
    driver.qtbot.waitUntil(lambda: QApplication.activePopupWidget() is None)


def open_and_choose(driver, button, text):
    """Press a button that opens a menu, and click on one of its lines.

    Qt comes back from the press when the menu is closed: what is done meanwhile has a timer.
    """
    failed = []

    def go():
        if (menu := QApplication.activePopupWidget()) is None:
            QTimer.singleShot(50, go)
            return
        try:
            choose(driver, menu, text)
        except BaseException as error:
            failed.append(error)
            menu.close()

    QTimer.singleShot(50, go)
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert not failed, failed


def title(driver, number):
    return run_title(driver.session.run(number), driver.session.runs)


def test_the_button_compares_with_the_undeformed_mesh_or_a_run(ran):
    button = panel(ran).buttons["compare"]
    open_and_choose(ran, button, "Undeformed mesh")
    assert ran.session.view.beside == changes.UNDEFORMED
    open_and_choose(ran, button, title(ran, 1))
    assert (ran.session.shown, ran.session.view.beside) == (2, 1)
    texts = [act.text() for act in button.menu().actions()]
    assert title(ran, 2) not in texts, "a run is not compared with itself"
    open_and_choose(ran, button, "End the comparison")
    assert ran.session.view.beside is None
    compare = ran.window.actions_table.menus["compare"]
    assert compare.isEnabled()
    compare.aboutToShow.emit()
    assert [act.text() for act in compare.actions()] == texts


@pytest.mark.usefixtures("painted")
def test_each_title_chooses_what_its_view_shows(ran):
    viewing = compare(ran)
    left, right = viewing.titles
    open_and_choose(ran, right.label, "Undeformed mesh")
    assert (ran.session.shown, ran.session.view.beside) == (2, changes.UNDEFORMED)
    open_and_choose(ran, left.label, title(ran, 1))
    assert (left.text, right.text) == (title(ran, 1), "Undeformed mesh")
    open_and_choose(ran, left.label, "Undeformed mesh")
    assert (left.text, right.text) == ("Undeformed mesh", title(ran, 1))
    QApplication.processEvents()
    assert viewing.second.x() < viewing.view.x()
    assert [one.stage.has_legend for one in viewing._scenes()] == [True, False], "to the right"
    seen = np.asarray(viewing.second_scene.drawn["airfoil"].shape.points)[:, :2]
    nodes = viewing.scene.drawn["airfoil"].surface.nodes
    assert np.allclose(seen, ran.session.mesh.points[nodes])
    open_and_choose(ran, left.label, title(ran, 2))
    assert (left.text, right.text) == (title(ran, 2), title(ran, 1))
    QApplication.processEvents()
    assert viewing.view.x() < viewing.second.x()
    ran.click(left.close_button)
    assert (ran.session.shown, ran.session.view.beside) == (1, None)
    assert viewing.view.width() > 0.9 * viewing.width()


def test_a_row_grows_while_its_run_goes_on(ran):
    session = ran.session
    running = changes.add_frames(changes.start_run(session), session.runs[1].frames[:1])
    ran.window.store.put(running)
    assert "running · " in row(ran, 3).data(RUN, WORDS)
    assert "1 of 3 steps" in row(ran, 3).data(RUN, WORDS)
    assert not panel(ran).buttons["remove"].isEnabled()
    ran.window.store.change(changes.add_frames, session.runs[1].frames[1:])
    ran.window.store.change(changes.end_run, "done")
    assert row(ran, 3).data(RUN, WORDS).split(" · ")[:2] == ["3 steps", "moving vertices"]
    assert panel(ran).buttons["remove"].isEnabled()


def test_settings_are_put_back_and_undo_does_that_and_removing_a_run_again(ran):
    assert ran.session.case.sliding == "ds"
    click(ran, 1)
    ran.click(panel(ran).buttons["settings"])
    assert (ran.session.case.sliding, ran.session.case.steps) == ("ps", 2)
    assert ran.window.method.sliding.currentData() == "ps"
    ran.window.actions_table.by_name["undo"].trigger()
    assert (ran.session.case.sliding, ran.session.case.steps) == ("ds", 3)
    click(ran, 2)
    frames = ran.session.run(2).frames
    ran.click(panel(ran).buttons["remove"])
    assert [run.number for run in ran.session.runs] == [1]
    said = ran.window.statusBar().currentMessage()
    assert said == "Run 2 removed (Ctrl+Z brings it back)"
    assert "removing a run" in ran.window.actions_table.by_name["undo"].text()
    ran.window.actions_table.by_name["undo"].trigger()
    assert ran.session.run(2).frames is frames
    assert ran.session.shown == 2
    assert panel(ran).tree.topLevelItemCount() == 3


def test_the_menu_removes_shows_beside_and_saves(ran, answers, tmp_path):
    assert not actions(ran, 2)["Show beside run 2"].isEnabled()
    actions(ran, 1)["Show beside run 2"].trigger()
    assert ran.session.view.beside == 1
    actions(ran, 1)["End the comparison"].trigger()
    assert ran.session.view.beside is None
    answers("ask_save", tmp_path / "one.su2")
    actions(ran, 1)["Save its mesh…"].trigger()
    ran.settle()
    assert (tmp_path / "one.su2").exists()
    assert ran.session.run(1).saved
    assert not ran.session.run(2).saved
    actions(ran, 1)["Remove"].trigger()
    assert [run.number for run in ran.session.runs] == [2]
    assert ran.session.shown == 2
    assert panel(ran).tree.topLevelItemCount() == 2


def test_the_table_is_exported_and_copied_or_it_is_told_why_not(ran, answers, tmp_path):
    answers("ask_save", tmp_path / "runs.csv")
    ran.click(panel(ran).buttons["export"])
    with (tmp_path / "runs.csv").open() as file:
        found = list(csv.DictReader(file))
    assert ran.window.statusBar().currentMessage() == f"Saved {tmp_path / 'runs.csv'}"
    assert [line["method"] for line in found] == ["pseudo sliding", "direct sliding"]
    ran.click(panel(ran).buttons["copy"])
    lines = QApplication.clipboard().text().splitlines()
    assert len(lines) == 3
    assert "pseudo sliding" in lines[1].split("\t")
    answers("ask_save", tmp_path / "nowhere" / "runs.csv")
    ran.click(panel(ran).buttons["export"])
    assert "the folder does not exist" in ran.window.banner.text.text()
    answers("ask_save", None)
    ran.click(panel(ran).buttons["export"])


# Side by side -----------------------------------------------------------------------------


def compare(driver, number=1):
    driver.window.store.change(changes.show_beside, number)
    viewing = driver.window.viewing
    driver.qtbot.waitUntil(lambda: viewing.second.isVisible())
    return viewing


def test_both_meshes_have_the_same_room_beside_one_legend_and_a_title(ran):
    viewing = compare(ran)
    QApplication.processEvents()
    ratio = viewing.second.devicePixelRatioF()
    strip = viewing.second_scene.stage.strip() / ratio
    assert abs(viewing.view.width() - (viewing.second.width() - strip)) <= 2
    assert viewing.titles[0].text.startswith("Run 2: direct sliding")
    assert viewing.titles[1].text.startswith("Run 1: pseudo sliding")
    assert viewing.titles[1].isVisible()
    ran.click(viewing.titles[1].close_button)
    assert ran.session.view.beside is None
    assert viewing.second is None
    assert not viewing.titles[0].isVisible()
    viewing = compare(ran)
    ran.window.store.change(changes.set_view, color_by="displacement")
    assert not viewing.view.scalar_bars.keys()
    assert list(viewing.second.scalar_bars.keys()) == ["displacement"]
    ranges = [tuple(scene.stage.table.scalar_range) for scene in viewing._scenes()]
    assert ranges[0] == ranges[1] == ran.session.color_range
    ran.window.store.change(changes.show_beside, None)
    assert list(viewing.view.scalar_bars.keys()) == ["displacement"]


def test_the_whole_mesh_is_seen_in_both_and_a_detail_stays_one(ran):
    viewing = compare(ran)
    for view, scene in ((viewing.view, viewing.scene), (viewing.second, viewing.second_scene)):
        points = np.concatenate([one.shape.points for one in scene.drawn.values()])
        seen = to_display(view, points)
        assert seen.min() >= 0
        assert (seen.max(axis=0) <= view.window_size).all()
    rooms = [view.width() for view in (viewing.view, viewing.second)]
    assert seen[:, 0].max() - seen[:, 0].min() > 0.8 * min(rooms), "both are well filled"
    ran.window.store.change(changes.show_beside, None)
    viewing.scene.camera.zoom_at(200, 200, 5.0)
    scale = viewing.view.camera.parallel_scale
    compare(ran)
    assert viewing.second.camera.parallel_scale == viewing.view.camera.parallel_scale == scale


def test_entering_the_comparison_shows_all_of_both_unless_a_detail_is_looked_at(ran):
    store, viewing = ran.window.store, ran.window.viewing
    # Far to the side, as after a drag: nothing was looked at in detail.
    viewing.scene.camera.aim((9.0, 0.0, 0.0), viewing.view.camera.parallel_scale)
    compare(ran, changes.UNDEFORMED)
    for view, scene in ((viewing.view, viewing.scene), (viewing.second, viewing.second_scene)):
        seen = to_display(view, np.concatenate([one.shape.points for one in scene.drawn.values()]))
        assert seen.min() >= 0
        assert (seen.max(axis=0) <= view.window_size).all()
    store.change(changes.show_beside, None)
    ran.window.viewing.fly_to(3)
    place = viewing.scene.camera.place
    compare(ran, changes.UNDEFORMED)
    assert viewing.scene.camera.place == place


@pytest.mark.usefixtures("painted")
@pytest.mark.parametrize("leads", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_moving_one_camera_moves_the_other_and_both_are_drawn(ran, leads):
    viewing = compare(ran)
    views = (viewing.view, viewing.second)
    QApplication.processEvents()
    painted = []
    views[1 - leads].signals.resized.disconnect()
    views[1 - leads]._repaints._timer.timeout.connect(lambda: painted.append(1))
    where = QPointF(60, 90)
    none = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    wheel = QWheelEvent(where, where, QPoint(), QPoint(0, 120), *none, False)
    before = viewing.scene.camera.place
    QApplication.sendEvent(views[leads], wheel)
    assert viewing.scene.camera.place != before
    assert viewing.second_scene.camera.looks_like(viewing.scene.camera)
    ran.qtbot.waitUntil(lambda: bool(painted))
    before = viewing.scene.camera.place
    left = Qt.MouseButton.LeftButton
    QTest.mousePress(views[leads], left, pos=QPoint(80, 80))
    for step in range(1, 6):
        QTest.mouseMove(views[leads], QPoint(80 + 8 * step, 80 + 4 * step))
    QTest.mouseRelease(views[leads], left, pos=QPoint(120, 100))
    assert viewing.second_scene.camera.looks_like(viewing.scene.camera)
    ran.window.actions_table.by_name["fit"].trigger()
    assert viewing.second_scene.camera.looks_like(viewing.scene.camera)


@pytest.mark.parametrize("two", [False, True])
@pytest.mark.window("own")
def test_what_fills_the_view_does_so_at_another_size_unless_the_camera_was_moved(ran, two):
    viewing = compare(ran) if two else ran.window.viewing
    ran.window.viewing.fit()
    lead = viewing._scenes()[-1]
    before = lead.camera.place
    ran.window.docks["runs"].hide()
    ran.window.docks["histogram"].hide()
    ran.window.resize(1100, 640)
    ran.qtbot.waitUntil(lambda: lead.camera.place != before)
    QApplication.processEvents()
    place = lead.camera.place
    assert lead.camera.fitted
    ran.window.viewing.fit()
    assert lead.camera.place == pytest.approx(place)
    lead.camera.zoom_at(100, 100, 1.5)
    place = lead.camera.place
    ran.window.resize(1280, 800)
    QApplication.processEvents()
    assert lead.camera.place == place


@pytest.mark.usefixtures("painted")
def test_linked_views_come_to_rest(ran, qtbot):
    viewing = compare(ran)
    drawn = []
    for view in (viewing.view, viewing.second):
        view._repaints._timer.timeout.connect(lambda: drawn.append(1))
    viewing.scene.camera.zoom_at(50, 50, 1.1)
    qtbot.waitUntil(lambda: bool(drawn))
    for _ in range(40):
        QApplication.processEvents()
    assert len(drawn) < 8


def test_look_from_and_rotation_of_a_solid_mesh_are_shared(driver, sample_folder):
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    driver.window.start_run()
    driver.settle()
    viewing = compare(driver, changes.UNDEFORMED)
    assert viewing.titles[1].text == "Undeformed mesh"
    for side in ("+x", "-y", "iso"):
        driver.window.actions_table.by_name[f"side{side}"].trigger()
        assert viewing.second_scene.camera.looks_like(viewing.scene.camera)
    driver.window.store.change(changes.set_view, perspective=True)
    assert not viewing.second.camera.parallel_projection
    viewing.second.camera.Azimuth(20)
    assert viewing.second_scene.camera.looks_like(viewing.scene.camera)
    block = {
        name: scene.drawn["BLOCK"].shape.points
        for name, scene in zip("ab", viewing._scenes(), strict=True)
    }
    assert np.allclose(
        block["b"], driver.session.mesh.points[viewing.scene.drawn["BLOCK"].surface.nodes]
    )
    assert not np.allclose(block["a"], block["b"])


def test_steps_hiding_selection_and_clicks_act_on_both(ran):
    viewing = compare(ran)
    store = ran.window.store
    shown = {step: (0, 1, 1, 2)[step] for step in range(4)}
    for step, other in shown.items():
        store.change(changes.show_frame, step)
        frame = ran.session.run(1).frames[other - 1] if other else ran.session.first
        nodes = viewing.scene.drawn["airfoil"].surface.nodes
        seen = np.asarray(viewing.second_scene.drawn["airfoil"].shape.points)[:, :2]
        assert np.allclose(seen, frame.mesh.points[nodes]), step
    store.change(changes.show_boundaries, ("airfoil",), False)
    store.change(changes.select, ("inlet",) if "inlet" in ran.session.case.roles else ("airfoil",))
    for scene in viewing._scenes():
        assert not scene.drawn["airfoil"].actor.visibility
    store.change(changes.show_boundaries, ("airfoil",))
    for scene in viewing._scenes():
        assert scene.drawn["airfoil"].actor.visibility
    store.change(changes.select, ())
    viewing = compare(ran)
    scene = viewing.second_scene
    viewing.second.snapshot()
    points = np.asarray(scene.drawn["airfoil"].shape.points)
    x, y = to_display(viewing.second, points[:1])[0] / viewing.second.devicePixelRatioF()
    where = QPoint(round(x), round(viewing.second.height() - 1 - y))
    QTest.mouseClick(viewing.second, Qt.MouseButton.LeftButton, pos=where)
    assert ran.session.view.selected == ("airfoil",)
    for one in viewing._scenes():
        assert one.plotter.actors["selected:airfoil"].visibility


@pytest.mark.window("own")
def test_the_theme_reaches_both(ran):
    viewing = compare(ran)
    ran.window.set_theme("dark")
    assert [scene.scheme for scene in viewing._scenes()] == [DARK, DARK]
    assert viewing.second.snapshot()[-3, 3].max() < 60


@pytest.mark.usefixtures("painted")
def test_comparing_ten_times_leaves_nothing_behind(ran):
    viewing, gone = ran.window.viewing, []
    observed = viewing.view.camera.HasObserver
    for turn in range(10):
        compare(ran, turn % 2)
        gone += [weakref.ref(viewing.second), weakref.ref(viewing.second_scene)]
        ran.window.store.change(changes.show_beside, None)
        QApplication.processEvents()
    assert not observed("ModifiedEvent")
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    assert [one() for one in gone if one() is not None] == []


def test_another_mesh_ends_the_comparison(ran, passage_file, answers):
    viewing = compare(ran)
    answers("ask_unsaved", "discard")
    ran.open(passage_file)
    assert viewing.second is None
    assert not any(title.isVisible() for title in viewing.titles)
    assert ran.session.view.beside is None


@pytest.mark.usefixtures("painted")
@pytest.mark.window("own")
def test_the_window_closes_during_a_comparison(ran, answers):
    compare(ran)
    answers("ask_unsaved", "discard")
    ran.window.close()
    assert not ran.window.isVisible()


def test_the_camera_moves_after_a_run_only_if_some_of_the_mesh_has_left_the_view(ran):
    window, eye = ran.window, ran.window.scene.camera
    window.viewing.fit()
    before = eye.place
    assert eye.fitted
    shapes = [np.asarray(shape.points) for shape in window.scene._shapes()]
    for points in shapes:
        points[:, 0] *= 0.98
    window.running.ended.emit()
    assert eye.place == before, "a camera that moves looks like a mesh that does"
    for points in shapes:
        points[:, 0] += 0.5 * np.ptp(points[:, 0])
    window.running.ended.emit()
    assert eye.place != before
    assert not eye.loses_some()


def test_the_support_radius_is_said_and_follows_the_settings_or_a_compared_run(ran):
    window = ran.window
    bar, scene = window.statusBar(), window.viewing.scene

    def radius():
        points = scene.plotter.actors["support:circles"].mapper.dataset.points
        return np.ptp(points, axis=0).max() / 2.0

    window.actions_table.by_name["support"].trigger()
    assert "larger than the whole mesh" in bar.currentMessage()
    own = radius()
    extent = window.store.session.mesh.extent
    window.store.change(changes.set_case, influence_factor=0.1)
    assert radius() == pytest.approx(0.1 * extent, rel=1e-3)
    said = f"Support radius of the settings: {0.1 * extent:.4g}, a circle around what moves; F"
    assert bar.currentMessage().startswith(said)
    window.store.change(changes.show_beside, 1)
    assert radius() == pytest.approx(own)
    assert f"Support radius of run {window.store.session.shown}: " in bar.currentMessage()
    window.store.change(changes.show_beside, None)
    window.store.change(changes.set_case, method="idw")
    assert "no support radius" in bar.currentMessage()


def test_the_difference_of_two_runs_is_chosen_while_they_are_compared(ran):
    window = ran.window
    click(ran, 1, keys=Qt.KeyboardModifier.ControlModifier)
    ran.qtbot.waitUntil(lambda: window.viewing.second.isVisible())
    color = window.actions_table.bar.color
    ran.choose(color, "quality-gain")
    scenes = window.viewing._scenes()
    mine, other = (scene.session.frame.quality.values for scene in scenes)
    for scene, wanted in zip(scenes, (mine - other, other - mine), strict=True):
        np.testing.assert_allclose(scene.stage.values(scene.session), wanted)
        assert scene.stage.table.cmap.name == "PuOr"
        assert tuple(scene.stage.table.scalar_range) == ran.session.color_range
    drawn = np.asarray(window.scene._cells.shape.cell_data["values"])
    np.testing.assert_allclose(np.sort(drawn), np.sort(mine - other))
    display = window.dock_manager.panels["display"]
    assert not display.map.isEnabled()
    assert "purple" in display.map.toolTip()
    worst = window.dock_manager.panels["worst"]
    window.docks["worst"].raise_()
    ran.qtbot.waitUntil(lambda: worst.model.worst is not None)
    ran.qtbot.waitUntil(lambda: worst.model.worst.measure == "quality-gain")
    assert worst.model.worst.values[0] == (mine - other).min()
    assert worst.model.headers[1].startswith("Quality\ngain")
    window.store.change(changes.show_frame, 1)
    mine, other = (scene.session.frame.quality.values for scene in scenes)
    np.testing.assert_allclose(scenes[0].stage.values(scenes[0].session), mine - other)
    ran.click(window.viewing.titles[1].close_button)
    assert "There is no second run" in window.statusBar().currentMessage()
    assert window.scene.session.view.color_by == "role"
