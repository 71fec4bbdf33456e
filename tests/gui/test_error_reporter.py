"""What nobody expected: told, counted, copied; the window goes on."""

import logging
import os
import subprocess
import sys
import threading

import pytest
from qtpy.QtCore import QTimer, qWarning
from qtpy.QtWidgets import QApplication

from slideviz.errors import CaseError
from slideviz.gui.widgets import error_reporter, questions
from slideviz.session import changes, jobs
from slideviz.session.store import Store, notify

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def caught(window):
    """A window in an application that catches what nobody does, as `launch` makes it."""
    with error_reporter.caught(window.error_reporter):
        yield window
    window.error_reporter.count = 0


def boom(*_, **_named):
    raise ZeroDivisionError("strange")


def text(window):
    return window.banner.text.text()


# The store --------------------------------------------------------------------------------


def test_a_listener_that_raises_keeps_no_other_from_hearing():
    store, heard = Store(), []
    store.listen(boom)
    store.listen(lambda old, new: heard.append("edges" in new.view.drawn))
    with pytest.raises(ZeroDivisionError, match="strange"):
        store.change(changes.set_view, edges=False)
    assert heard == [False]
    assert "edges" not in store.session.view.drawn


def test_what_a_listener_changes_is_heard_although_another_raises():
    store, heard = Store(), []

    def follow(old, new):
        if "edges" in new.view.drawn ^ old.view.drawn:
            store.change(changes.set_view, legend=False)

    store.listen(boom)
    store.listen(follow)
    store.listen(lambda old, new: heard.append([n in new.view.drawn for n in ("edges", "legend")]))
    failed = []
    store.failed = failed.append
    store.change(changes.set_view, edges=False)
    assert heard == [[False, True], [False, False]]
    assert [str(error) for error in failed] == ["strange"] * 2


def test_of_several_errors_the_first_is_raised_when_all_were_called():
    called = []

    def first(value):
        raise CaseError(f"first {value}")

    with pytest.raises(CaseError, match="first 3"):
        notify((first, boom, called.append), 3)
    assert called == [3]


# The window -------------------------------------------------------------------------------


def test_errors_in_slots_and_threads_are_told_expected_ones_in_their_own_words_others_with_details(
    caught, qtbot
):
    QTimer.singleShot(0, boom)
    qtbot.waitUntil(lambda: caught.error_reporter.count == 1)
    assert caught.banner.isVisible()
    assert "ZeroDivisionError" in text(caught)
    assert "Traceback" not in text(caught)
    caught.banner.copy.click()
    copied = QApplication.clipboard().text()
    for part in ("Traceback", "in boom", "Python 3", "numpy", "vtk", "PySide6"):
        assert part in copied
    caught.error_reporter.count = 0

    def wrong():
        raise CaseError("case.cfg:3: STEPS= -1 is negative; write a positive number")

    QTimer.singleShot(0, wrong)
    qtbot.waitUntil(lambda: caught.error_reporter.count == 1)
    assert text(caught).startswith("case.cfg:3: STEPS= -1 is negative")
    assert not caught.banner.copy.isVisible()
    caught.banner.show_error(MemoryError("Unable to allocate 3 GiB"))
    assert text(caught).startswith("out of memory; use a coarser mesh")
    assert not caught.banner.copy.isVisible()
    caught.error_reporter.count = 0
    thread = threading.Thread(target=lambda: int("word"))
    thread.start()
    thread.join()
    qtbot.waitUntil(lambda: caught.error_reporter.count == 1)
    assert "ValueError" in text(caught)


@pytest.mark.window("own")
def test_the_same_error_again_and_again_is_counted_and_logged_once(caught, qtbot, caplog):
    timer = QTimer()
    timer.setInterval(2)
    timer.timeout.connect(boom)
    timer.start()
    qtbot.waitUntil(lambda: caught.error_reporter.count > 40)
    timer.stop()
    qtbot.waitUntil(lambda: "times" in text(caught))
    qtbot.waitUntil(lambda: f"({caught.error_reporter.count} times)" in text(caught))
    assert sum(record.message == "unexpected" for record in caplog.records) == 1


def test_two_errors_that_alternate_are_told_once_each_and_a_line_that_repeats_is_counted(
    window, monkeypatch, qtbot
):
    told, now = [], [0.0]
    made = error_reporter.ErrorReporter(window.banner, clock=lambda: now[0])
    monkeypatch.setattr(window.banner, "show_error", lambda error: told.append(str(error)))
    for _ in range(5):
        made.show(CaseError("one"))
        made.show(CaseError("two"))
    assert told == ["one", "two"]
    now[0] = error_reporter.REST_S + 1.0
    made.show(CaseError("one"))
    assert told == ["one", "two", "one"]
    for _ in range(30):
        logging.getLogger("slideviz.vtk").warning("no texture")
    logging.getLogger("slideviz").warning("something else")
    qtbot.waitUntil(lambda: "something else" in log_text(window))
    assert log_text(window).count("no texture") == 1
    assert "29 times more" in log_text(window)
    before = sys.excepthook, threading.excepthook, sys.unraisablehook
    with error_reporter.caught(window.error_reporter):
        assert sys.excepthook is not before[0]
    assert (sys.excepthook, threading.excepthook, sys.unraisablehook) == before


def test_errors_in_a_job_and_in_a_file_dialog_are_told_and_the_next_job_runs(
    driver, caught, monkeypatch, passage_file
):
    with monkeypatch.context() as patch:
        patch.setattr(jobs, "open_file", boom)
        driver.open(passage_file)
    assert "ZeroDivisionError" in text(caught)
    assert driver.open(passage_file).mesh is not None
    assert not caught.banner.isVisible()
    caught.error_reporter.count = 0

    def broken(*_):
        raise OSError("the portal does not answer")

    monkeypatch.setattr(questions, "ask_open", broken)
    caught.actions_table.by_name["open"].trigger()
    driver.qtbot.waitUntil(lambda: caught.error_reporter.count == 1)
    assert "the portal does not answer" in text(caught)
    assert driver.open(passage_file).mesh is not None


@pytest.mark.window("own")
def test_a_layer_that_cannot_draw_leaves_the_others_and_the_state(
    driver, caught, monkeypatch, passage_file
):
    driver.open(passage_file)
    legend = driver.window.view.renderer.actors.copy()
    monkeypatch.setattr(driver.window.scene.layers[0], "update", boom)
    caught.store.change(changes.set_view, legend=False)
    # The banner takes some of the view's room, so that the layer fails once more.
    assert caught.error_reporter.count >= 1
    assert "ZeroDivisionError" in text(caught)
    assert "legend" not in caught.store.session.view.drawn
    shown = driver.window.view.renderer.actors
    assert any(
        name.startswith("legend") and (name not in shown or not shown[name].GetVisibility())
        for name in legend
    ), "the layers after it are up to date"
    assert not caught.actions_table.by_name["legend"].isChecked()


def test_control_c_ends_the_application(caught, monkeypatch):
    quitted = []
    monkeypatch.setattr(QApplication, "quit", lambda: quitted.append(1))
    sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert quitted == [1]
    assert caught.error_reporter.count == 0


# The log ----------------------------------------------------------------------------------


def log_text(window):
    return window.dock_manager.panels["log"].toPlainText()


@pytest.mark.filterwarnings("default:old option")
def test_what_qt_and_vtk_and_python_complain_of_stands_in_the_log(caught, qtbot):
    import warnings

    from vtkmodules.vtkCommonCore import vtkOutputWindow

    qWarning("a timer of another thread")
    vtkOutputWindow.GetInstance().DisplayErrorText("ERROR: In vtkX.cxx, line 3\nno input")
    warnings.warn("old option", stacklevel=1)
    qtbot.waitUntil(lambda: "old option" in log_text(caught))
    assert "Qt: a timer of another thread" in log_text(caught)
    assert "VTK: ERROR: In vtkX.cxx, line 3 no input" in log_text(caught)


def test_what_vtk_logs_by_itself_is_not_on_the_terminal(caught, capfd):
    """As the four lines about the sizes of buffers, on Wayland."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.Log(vtkLogger.VERBOSITY_WARNING, "vtkX.cxx", 3, "no red")
    assert caught.banner is not None
    assert capfd.readouterr().err == ""


# Crashes ----------------------------------------------------------------------------------

CRASH = """
import faulthandler, sys
from pathlib import Path
from slideviz.gui.widgets.error_reporter import crash_log
with crash_log(Path(sys.argv[1])):
    {}
"""


def python(code, folder):
    return subprocess.run(
        [sys.executable, "-c", CRASH.format(code), str(folder)], capture_output=True, timeout=120
    )


def test_a_crash_leaves_where_it_was_and_is_told_once(tmp_path):
    folder = tmp_path / "crashes"
    assert python("faulthandler._sigsegv()", folder).returncode < 0
    (trace,) = error_reporter.old_crashes(folder)
    assert "Segmentation fault" in trace.read_text()
    assert trace.name.startswith("crash-2")
    assert error_reporter.old_crashes(folder) == []
    assert trace.exists()


def test_a_proper_end_and_a_kill_leave_nothing(tmp_path):
    folder = tmp_path / "crashes"
    assert python("pass", folder).returncode == 0
    assert list(folder.iterdir()) == []
    python("import os; os.kill(os.getpid(), 9)", folder)
    assert len(list(folder.iterdir())) == 1
    assert error_reporter.old_crashes(folder) == []
    assert list(folder.iterdir()) == []


def test_the_log_of_a_program_that_runs_is_left_alone(tmp_path):
    (tmp_path / f"crash-{os.getpid()}.log").write_text("so far")
    assert error_reporter.old_crashes(tmp_path) == []


def test_a_folder_that_cannot_be_made_is_no_reason_not_to_start(tmp_path, caplog):
    (tmp_path / "file").write_text("")
    with error_reporter.crash_log(tmp_path / "file" / "crashes"):
        pass
    assert "would leave no trace" in caplog.text


@pytest.mark.parametrize("pid", ["", "word", "-", str(2**22 + 5), "9" * 30])
def test_what_is_no_process_is_not_alive(pid):
    assert not error_reporter.is_alive(pid)


def test_this_process_is_alive():
    assert error_reporter.is_alive(str(os.getpid()))
