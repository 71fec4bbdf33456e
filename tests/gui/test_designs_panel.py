"""The panel of designs: filled, run beside the window, drawn, and shown at a click."""

import csv
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest

import slideviz as sv
from slideviz.design.sweeps import sweep as sweeping
from slideviz.design.sweeps.table import DesignRow
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.widgets import plot_canvas
from slideviz.gui.widgets.plot_canvas import AxesPlace, PlotFormat, picture
from slideviz.plots.style import PRINT
from slideviz.samples.table import write_sample
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def in_a_thread(monkeypatch):
    """A thread of this process in place of others, which take seconds to start."""
    made = staticmethod(lambda _cls, *_: ThreadPoolExecutor(1))
    monkeypatch.setattr(sweeping, "Processes", type("Thread", (), {"__new__": made}))


@pytest.fixture
def passage(window, driver, tmp_path, monkeypatch):
    monkeypatch.setattr(plot_canvas, "REST_MS", 0)
    write_sample("passage", tmp_path, 12)
    driver.open(tmp_path / "passage.cfg")
    window.actions_table.by_name["designs"].trigger()
    return window.dock_manager.panel(DesignsPanel)


def fill(panel, column, values):
    panel.rows.column.setCurrentIndex(panel.rows.column.findData(column))
    panel.rows.values.setText(values)
    QTest.mouseClick(panel.rows.add, LEFT)


def run(panel, qtbot):
    QTest.mouseClick(panel.run, LEFT)
    assert panel.runner.busy
    qtbot.waitUntil(lambda: not panel.runner.busy)


def test_designs_are_run_drawn_and_shown(window, passage, qtbot, in_a_thread, driver):
    panel = passage
    assert window.docks["designs"].isVisible()
    fill(panel, "airfoil.rotate.angle_deg", "-6 to 0 in 3")
    fill(panel, "STEPS", "2")
    assert panel.rows.model.rowCount() == 3
    assert panel.run.text() == "Run 3 designs"
    run(panel, qtbot)
    assert panel.status.label.text().startswith("3 designs done")
    assert set(panel.table.results) == {1, 2, 3}
    columns = [panel.rows.model.headerData(k, Qt.Orientation.Horizontal) for k in range(4)]
    assert columns == ["airfoil.rotate\nangle_deg", "STEPS", "min", "mean"]
    row = panel.table.results[3]
    assert panel.rows.model.index(2, 2).data() == format(row.min, ".4f")
    # A click on the point of the second design in the plot.
    qtbot.waitUntil(lambda: not panel.plot.canvas.busy and bool(panel.plot.canvas.figure.axes))
    axes, canvas = panel.plot.canvas.figure.axes[0], panel.plot.canvas
    second = panel.table.results[2]
    x, y = axes.transData.transform((-3.0, second.min))
    wide, high = canvas._scale
    at = QPoint(round(x / wide), round(canvas.height() - y / high))
    QTest.mouseClick(canvas, LEFT, Qt.KeyboardModifier.NoModifier, at)
    driver.settle()
    assert panel.shown == 2
    shown = window.store.session.run_shown
    assert shown.name == "design 2"
    assert shown.last.quality.min == second.min
    motions = (sv.Rotate("airfoil", -3.0), *window.store.session.case.motions[1:])
    *_, last = sv.deform(
        window.store.session.case.change(motions=motions, steps=2), window.store.session.mesh
    )
    assert np.array_equal(shown.last.mesh.points, last.mesh.points)
    # A click on a row; and once more on the first, whose run is there already.
    for number in (3, 2):
        where = panel.rows.view.visualRect(panel.rows.model.index(number - 1, 0)).center()
        QTest.mouseClick(panel.rows.view.viewport(), LEFT, Qt.KeyboardModifier.NoModifier, where)
        driver.settle()
        assert window.store.session.run_shown.name == f"design {number}"
    assert len(window.store.session.runs) == 2
    # Nothing was changed by looking at them.
    assert window.windowTitle() == "passage.cfg – slideviz"
    panel.show_design(1)
    driver.settle()
    text = window.run_panel.text
    assert text.text().startswith("The panels differ from design 1. <a ")
    window.store.change(changes.set_case, steps=4)
    assert "Settings changed since the last run." in text.text()
    text.linkActivated.emit("settings")
    assert "he motion could go " in text.text()


def test_the_last_of_several_clicks_counts(window, passage, qtbot, in_a_thread, driver):
    panel = passage
    fill(panel, "STEPS", "12, 13, 14")
    run(panel, qtbot)
    for number in (1, 2, 3):
        panel.show_design(number)
    driver.settle()
    qtbot.waitUntil(lambda: window.store.session.run_shown.name == "design 3")
    driver.settle()
    assert len(window.store.session.run_shown.frames) == 14
    # Another job is not given up for it.
    window.start_run()
    assert window.runner.busy
    panel.show_design(1)
    assert panel.status.label.text().startswith("Another job runs")
    assert panel.shown == 3
    driver.settle()


def test_a_design_is_shown_only_when_it_is_whole_and_computed_once(window, passage, driver, qtbot):
    panel, status = passage, passage.status.label
    fill(panel, "STEPS", "3, 400")
    panel.show_design(1)
    assert status.text() == "Design 1 is being computed."
    driver.settle()
    assert status.text() == "Design 1 is shown."
    panel.show_design(2)
    qtbot.waitUntil(lambda: len(window.store.session.frames) > 2)
    # A second click, as of a double click, does not begin it anew.
    panel.show_design(2)
    assert len(window.store.session.frames) > 2
    assert status.text() == "Design 2 is being computed."
    # Meanwhile another one is looked at, which is not computed again.
    panel.show_design(1)
    assert status.text() == "Design 1 is shown."
    assert window.runner.busy
    panel.show_design(2)
    window.running.cancel()
    driver.settle()
    made = len(window.store.session.frames) - 1
    assert 0 < made < 400
    said = f"Design 2 was cancelled after step {made} of 400: the mesh has"
    assert status.text().startswith(said)
    assert driver.told.startswith(said)
    assert window.player.step_text.text() == f"Step {made} of 400"
    assert len(window.store.session.runs) == 2
    # It has another number where a row before it is removed; and a name of the user's.
    panel.rows.view.selectRow(1)
    QTest.mouseClick(panel.remove, LEFT)
    window.store.change(changes.rename_run, 1, "mine")
    panel.show_design(1)
    driver.settle()
    assert len(window.store.session.runs) == 2
    assert status.text() == "Design 1 is shown."


def test_all_designs_are_the_steps_of_a_run_to_film_and_to_save(
    window, passage, driver, qtbot, answers, tmp_path
):
    fill(passage, "airfoil.rotate.angle_deg", "-3, -1, 1")
    passage.every.click()
    driver.settle()
    session = driver.session
    run = session.run_shown
    assert (run.name, run.end, len(run.frames), run.planned) == ("designs", "done", 3, 3)
    assert [frame.label for frame in run.frames] == [f"design {k} of 3" for k in (1, 2, 3)]
    assert window.statusBar().currentMessage() == "The steps of run 1 are the designs"
    # Each is the mesh of its design, as a click on it shows.
    passage.show_design(2)
    driver.settle()
    shown = driver.session.run_shown
    assert shown.name == "design 2"
    assert (shown.last.mesh.points == run.frames[1].mesh.points).all()
    window.store.change(changes.show_run, 1)
    assert window.actions_table.by_name["export_film"].isEnabled()
    answers("ask_numbered", tmp_path / "design.su2")
    window.actions_table.by_name["export_steps"].trigger()
    driver.settle()
    assert [path.name for path in sorted(tmp_path.glob("design_*.su2"))] == [
        f"design_{k}.su2" for k in (1, 2, 3)
    ]
    # With another case than the panel, a repair would not know what it mends.
    assert not window.actions_table.by_name["repair"].isEnabled()
    # It stays in a session.
    answers("ask_session", (tmp_path / "a.slideviz", False))
    window.files.save_session()
    driver.settle()
    again = driver.open(tmp_path / "a.slideviz").run_shown
    assert [frame.label for frame in again.frames] == [frame.label for frame in run.frames]


def test_a_design_that_fails_is_named_when_all_are_shown(window, passage, driver):
    fill(passage, "SLIDING_MODE", "ps, none")
    passage.every.click()
    driver.settle()
    assert "design 2: " in window.banner.text.text()
    assert [frame.label for frame in driver.session.run_shown.frames] == ["design 1 of 2"]


def test_designs_that_fail_say_why_and_what_is_done_is_not_run_again(
    passage, qtbot, in_a_thread, window, tmp_path
):
    panel = passage
    fill(panel, "SLIDING_MODE", "ps, none")
    assert panel.rows.model.headerData(0, Qt.Orientation.Horizontal) == "SLIDING_\nMODE"
    run(panel, qtbot)
    assert panel.status.label.text().startswith(
        "1 design done; 1 failed\nDesign 2: PERIODIC_MODE= moving needs"
    )
    assert [panel.rows.model.index(k, 1).data() for k in (0, 1)][1] == "failed"
    panel.show_design(2)
    assert panel.status.label.text().startswith("Design 2: PERIODIC_MODE= moving needs")
    assert panel.shown is None
    assert panel.table.results[2].problem
    assert panel.run.text() == "Run 1 design"
    panel.rows.view.selectRow(1)
    QTest.mouseClick(panel.remove, LEFT)
    assert not panel.run.isEnabled()
    assert "are done" in panel.run.toolTip()
    # Where the case is saved to changes no result.
    case = window.store.session.case.change(source=tmp_path / "other.cfg")
    window.store.change(changes.saved_case, case)
    assert not panel.run.isEnabled()
    assert not panel.status.label.text().startswith("The settings")
    window.store.change(changes.set_case, steps=3)
    assert panel.run.text() == "Run 1 design"


@pytest.mark.window("own")
def test_what_is_said_can_be_read_to_its_end(window, passage, qtbot):
    panel = passage
    window.resize(1280, 800)
    fill(panel, "STEPS", "1, 2, 3")
    why = f"the cells around the tip of the blade turn over in step 1. {'Make more steps. ' * 8}"
    name = window.store.session.mesh.name
    panel.mesh = window.store.session.mesh
    panel.table = panel.table.with_results([DesignRow(1, problem=f"{name}: {why}")])
    panel.show_design(1)
    assert panel.status.label.text() == f"Design 1: {name}: {why}"
    bar, high = panel.status.verticalScrollBar(), panel.fontMetrics().height()
    qtbot.waitUntil(lambda: panel.status.height() > 1.9 * high)
    assert panel.status.width() > 0.9 * panel.width()
    assert not bar.maximum()
    assert panel.status.height() >= panel.status.label.heightForWidth(
        panel.status.viewport().width()
    )
    # Of many lines, three are seen, and the others scrolled to.
    more = [DesignRow(2, inverted=3), DesignRow(3, problem=f"{name}: another reason")]
    panel.table = panel.table.with_results(more)
    panel._ended("", wrong=False)
    assert panel.status.label.text().splitlines() == [
        "1 design done; 2 failed; 1 with inverted cells",
        f"Design 1: {name}: {why}",
        f"Design 3: {name}: another reason",
    ]
    qtbot.waitUntil(lambda: bar.maximum() > 0)
    assert panel.status.height() < 4 * high
    panel._show_status("")
    assert not panel.status.isVisible()


def test_where_all_failed_there_is_no_plot(passage):
    panel = passage
    fill(panel, "STEPS", "1, 2")
    panel.put(panel.table.with_results([DesignRow(1, problem="no")]))
    assert "failed" in panel.plot.area.words.text()
    assert not panel.plot.save.isEnabled()
    panel.put(panel.table.with_results([DesignRow(2, min=0.5, mean=0.6)]))
    assert panel.plot.save.isEnabled()


@pytest.mark.window("own")
def test_the_number_that_varies_is_read_whole(window, passage, qtbot):
    window.resize(1280, 800)
    column = passage.rows.column
    column.setCurrentIndex(column.findData("airfoil.rotate.angle_deg"))
    qtbot.waitUntil(lambda: column.width() > 200)
    assert column.shown == column.currentText()


def test_mistakes_are_told_and_change_nothing_and_the_design_shown_is_none_of_another_table(
    passage, answers, tmp_path
):
    panel = passage
    fill(panel, "STEPS", "1, many")
    assert "whole number" in panel.status.label.text()
    fill(panel, "airfoil.translate.y", "0 to 1 in")
    assert panel.rows.model.rowCount() == 0
    fill(panel, "STEPS", "1, 2")
    panel.rows.model.setData(panel.rows.model.index(0, 0), "x")
    assert panel.table.rows == (("1",), ("2",))
    panel.rows.model.setData(panel.rows.model.index(0, 0), "3")
    assert panel.table.rows == (("3",), ("2",))
    panel.rows.model.setData(panel.rows.model.index(0, 0), "1")
    panel = passage
    fill(panel, "STEPS", "1, 2, 3")
    panel.shown = 2
    panel.rows.model.setData(panel.rows.model.index(2, 0), "4")
    assert panel.shown == 2
    file = tmp_path / "designs.csv"
    file.write_text("STEPS\n1\n5\n")
    answers("ask_table", file)
    QTest.mouseClick(panel.load, LEFT)
    assert panel.shown is None
    panel.shown = 1
    fill(panel, "airfoil.rotate.angle_deg", "-1, -2")
    assert panel.shown is None


def test_tables_are_loaded_and_saved_and_all_mistakes_are_told_with_their_rows(
    passage, answers, tmp_path, window
):
    panel = passage
    file = tmp_path / "designs.csv"
    file.write_text("airfoil.translate.y\n0.05\n0.1\n")
    answers("ask_table", file)
    QTest.mouseClick(panel.load, LEFT)
    assert panel.table.rows == (("0.05",), ("0.1",))
    panel.rows.view.selectRow(0)
    QTest.mouseClick(panel.remove, LEFT)
    assert panel.table.rows == (("0.1",),)
    answers("ask_save", tmp_path / "out.csv")
    QTest.mouseClick(panel.save, LEFT)
    assert "0.1" in (tmp_path / "out.csv").read_text()
    file.write_text("nothing\n1\n")
    answers("ask_table", file)
    QTest.mouseClick(panel.load, LEFT)
    assert "no such number of a motion" in panel.status.label.text()
    file = tmp_path / "designs.csv"
    file.write_text("STEPS\n1\nmany\n0.5\nx\ny\nz\n")
    answers("ask_table", file)
    QTest.mouseClick(passage.load, LEFT)
    assert "(and 4 more)" in passage.status.label.text()
    assert window.banner.isVisible()
    window.banner.details.click()
    told = window.banner.dialog.text.toPlainText()
    assert all(f"designs.csv:{line}: " in told for line in (3, 4, 5, 6, 7))
    window.banner.dialog.close()
    # They go with a file that has none; what else is told there stays.
    file.write_text("STEPS\n1\n")
    QTest.mouseClick(passage.load, LEFT)
    assert not window.banner.isVisible()
    window.banner.show_message("Something else.")
    QTest.mouseClick(passage.load, LEFT)
    assert window.banner.isVisible()


def test_changes_of_the_table_are_undone_with_its_results(
    window, passage, qtbot, in_a_thread, answers
):
    answers("ask_unsaved", "discard")
    panel, undo = passage, window.actions_table.by_name["undo"]
    redo = window.actions_table.by_name["redo"]
    assert not undo.isEnabled()
    fill(panel, "airfoil.rotate.angle_deg", "-2, 0")
    assert undo.text() == "Undo designs"
    fill(panel, "STEPS", "1, 2")
    assert len(panel.table.rows) == 4
    undo.trigger()
    assert panel.table.rows == (("-2",), ("0",))
    redo.trigger()
    assert len(panel.table.rows) == 4
    undo.trigger()
    run(panel, qtbot)
    done = panel.table
    assert set(done.results) == {1, 2}
    panel.rows.view.selectRow(0)
    QTest.mouseClick(panel.remove, LEFT)
    assert len(panel.table.rows) == 1
    undo.trigger()
    assert panel.table.rows == done.rows
    assert set(panel.table.results) == {1, 2}
    # Results for other settings do not come back with a design.
    panel.rows.view.selectRow(0)
    QTest.mouseClick(panel.remove, LEFT)
    window.store.change(changes.set_case, sliding="none")
    run(panel, qtbot)
    undo.trigger()  # the change of the settings
    undo.trigger()
    assert panel.table.rows == done.rows
    assert set(panel.table.results) == {2}
    # While designs are run, their table stays.
    QTest.mouseClick(panel.run, LEFT)
    undo.trigger()
    assert panel.table.rows == done.rows
    assert "stop that first" in panel.status.label.text()
    assert undo.text() == "Undo designs"
    panel.runner.cancel()
    qtbot.waitUntil(lambda: not panel.runner.busy)
    undo.trigger()  # which was not lost
    assert panel.table.rows == ()


def test_other_settings_make_results_old(window, passage, qtbot, in_a_thread, answers):
    panel = passage
    fill(panel, "STEPS", "1, 2")
    run(panel, qtbot)
    before = dict(panel.table.results)
    window.store.change(changes.set_case, sliding="ds")
    assert "settings have changed" in panel.status.label.text()
    answers("ask_unsaved", "discard")
    run(panel, qtbot)
    assert panel.table.results[1].seconds != before[1].seconds
    assert panel.case.sliding == "ds"


def test_the_first_motion_is_offered_where_none_was_there_before(window, passage):
    motions = window.store.session.case.motions
    window.store.change(changes.set_case, motions=())
    assert passage.rows.column.currentData() == "MARKER_MOVING"
    window.store.change(changes.set_case, motions=motions)
    assert passage.rows.column.currentIndex() == 0
    assert passage.rows.column.currentData().startswith("airfoil.")


def test_another_mesh_has_other_designs(window, passage, driver, passage_file, tmp_path):
    fill(passage, "STEPS", "1, 2")
    window.store.change(changes.set_case, sliding="ds")
    assert passage.rows.column.currentData() == "STEPS"
    window.store.change(changes.set_case, sliding=window.store.session.saved.sliding)
    driver.open(tmp_path / "passage.cfg")
    assert passage.rows.column.currentData() == "airfoil.rotate.angle_deg"
    assert not passage.rows.values.text()
    fill(passage, "STEPS", "1, 2")
    driver.open(passage_file)
    assert passage.rows.model.rowCount() == 0
    assert passage.rows.column.findData("airfoil.rotate.angle_deg") < 0


def test_a_stop_keeps_what_is_there(passage, qtbot, in_a_thread):
    panel = passage
    fill(panel, "airfoil.rotate.angle_deg", "-6 to 0 in 500")
    QTest.mouseClick(panel.run, LEFT)
    qtbot.waitUntil(lambda: len(panel.table.results) > 1)
    QTest.mouseClick(panel.stop, LEFT)
    qtbot.waitUntil(lambda: not panel.runner.busy)
    assert panel.status.label.text() == "Stopped; the results are kept."
    assert 1 < len(panel.table.results) < 500


@pytest.mark.window("own")
def test_results_are_not_lost_without_a_question(
    window, passage, qtbot, in_a_thread, answers, tmp_path
):
    panel = passage
    fill(panel, "STEPS", "1, 2")
    assert not panel.unsaved
    run(panel, qtbot)
    file = tmp_path / "designs.csv"
    file.write_text("STEPS\n2\n3\n")
    answers("ask_table", file)
    asked = answers("ask_unsaved", "cancel")
    QTest.mouseClick(panel.load, LEFT)
    lost = "The next step removes the result of a design. Ctrl+Z brings that back."
    assert asked == [(f"Save the table of designs first?\n{lost}", ["table"])]
    assert panel.table.rows == (("1",), ("2",))
    answers("ask_unsaved", "discard")
    QTest.mouseClick(panel.load, LEFT)
    assert panel.table.rows == (("2",), ("3",))
    assert {k: row.steps for k, row in panel.table.results.items()} == {1: 2}
    # The window does not close over them either, until they are saved.
    asked = answers("ask_unsaved", "cancel")
    assert not window.close()
    assert "table of designs, 1 with results, is not saved" in asked[0][0]
    assert asked[0][1] == ["session", "table"]
    answers("ask_unsaved", "table")
    answers("ask_save", None)
    assert not window.close()
    answers("ask_save", tmp_path / "out.csv")
    assert window.close()
    assert not panel.unsaved
    assert (tmp_path / "out.csv").read_text().count("\n") == 3


def test_more_values_of_a_number_come_below_and_results_stay(passage, qtbot, in_a_thread):
    fill(passage, "STEPS", "1, 2")
    run(passage, qtbot)
    fill(passage, "STEPS", "2, 3")  # without a question
    assert passage.table.rows == (("1",), ("2",), ("3",))
    assert set(passage.table.results) == {1, 2}
    assert passage.run.text() == "Run 1 design"


def test_results_can_be_saved_before_a_number_is_added_or_all_is_run_again(
    window, passage, qtbot, in_a_thread, answers, tmp_path
):
    panel = passage
    fill(panel, "STEPS", "1, 2")
    run(panel, qtbot)
    before = panel.table
    asked = answers("ask_unsaved", "table")
    answers("ask_save", None)
    fill(panel, "airfoil.rotate.angle_deg", "-1, -2")
    assert panel.table is before
    assert "the results of 2 designs" in asked[0][0]
    window.store.change(changes.set_case, sliding="ds")
    answers("ask_unsaved", "cancel")
    QTest.mouseClick(panel.run, LEFT)
    assert panel.table is before
    assert not panel.runner.busy
    answers("ask_unsaved", "table")
    answers("ask_save", tmp_path / "out.csv")
    fill(panel, "airfoil.rotate.angle_deg", "-1, -2")
    assert len(panel.table.rows) == 4
    assert not panel.table.results
    with (tmp_path / "out.csv").open() as file:
        assert [row["steps"] for row in csv.DictReader(file)] == ["1", "2"]


@pytest.mark.window("own")
def test_closing_asks_about_designs_that_go_on(
    window, passage, qtbot, in_a_thread, answers, tmp_path
):
    fill(passage, "airfoil.rotate.angle_deg", "-6 to 0 in 500")
    QTest.mouseClick(passage.run, LEFT)
    asked = answers("ask_unsaved", "cancel")
    assert not window.close()
    assert "The sweep still runs (0 of 500 designs done) and will be stopped." in asked[0][0]
    # The question counts on while it is there.
    now = asked[0][2]
    passage._results_arrived([DesignRow(1, min=0.5)])
    assert "(1 of 500 designs done)" in now()
    assert passage.runner.busy
    # What is done can be saved before it is stopped.
    qtbot.waitUntil(lambda: len(passage.table.results) > 1)
    asked = answers("ask_unsaved", "table")
    answers("ask_save", tmp_path / "out.csv")
    assert window.close()
    assert asked[0][1] == ["session", "table"]
    with (tmp_path / "out.csv").open() as file:
        done = [row for row in csv.DictReader(file) if row["min"]]
    assert 1 < len(done) < 500


@pytest.mark.window("own")
def test_its_key_shows_and_hides_the_panel(window, passage, qtbot):
    assert window.docks["designs"].isVisible()
    QTest.keyClick(window, Qt.Key.Key_F6)
    assert not window.docks["designs"].isVisible()
    QTest.keyClick(window, Qt.Key.Key_F6)
    assert window.docks["designs"].isVisible()
    # Behind another tab it is brought to the front, not hidden.
    window.tabifyDockWidget(window.docks["designs"], window.docks["log"])
    window.docks["log"].show()
    window.docks["log"].raise_()
    qtbot.waitUntil(lambda: passage.visibleRegion().isEmpty())
    QTest.keyClick(window, Qt.Key.Key_F6)
    qtbot.waitUntil(lambda: not passage.visibleRegion().isEmpty())


def test_a_design_is_shown_whole_and_without_the_ghost_of_the_motion_panel(
    window, passage, qtbot, in_a_thread, driver
):
    def ghosts():
        return [
            actor.visibility
            for name, actor in window.scene.plotter.actors.items()
            if name == "motion:airfoil"
        ]

    assert ghosts() == [True]
    fill(passage, "airfoil.rotate.angle_deg", "0, -1")
    passage.show_design(1)
    driver.settle()
    assert window.store.session.run_shown.name == "design 1"
    assert ghosts() == [False]
    # Where the mesh is outside of the view, it comes back with a design that was run already.
    window.scene.camera.aim((99.0, 99.0, 0.0), 0.1)
    passage.show_design(1)
    assert window.scene.camera.sees_all()
    # A motion that is typed now is seen again.
    motion = window.store.session.case.motions[0]
    window.store.change(changes.replace_motion, 0, sv.Rotate(motion.marker, 20.0))
    assert ghosts() == [True]


def test_a_legend_that_grows_takes_room_from_the_axes():
    drawn = []
    place = AxesPlace()
    for words in (["1", "2"], ["1", "2", "many words of a design"]):

        def draw(figure, _style, words=words):
            axes = figure.add_subplot()
            for word in words:
                axes.plot([0, 1], [0, 1], label=word)
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))

        made = picture(draw, PlotFormat(420, 260, 1.0, PRINT), place)
        place = made.place
        box = made.figure.axes[0].get_legend().get_window_extent()
        drawn.append(box.x1 <= made.figure.bbox.x1)
    assert drawn == [True, True]
