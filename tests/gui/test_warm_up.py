"""Compilation beside the window."""

import gc
import os
import subprocess
import sys
from threading import Event, current_thread, main_thread

import numba
import pytest

from slideviz.session import jit_warmup
from slideviz.session.jobs import JobProgress

pytestmark = pytest.mark.usefixtures("unpainted")


@pytest.fixture
def work(monkeypatch):
    """A warm-up that compiles when told to, and goes on until told to end."""

    class Work:
        compile, end, stopped = Event(), Event(), None

        def __call__(self, compiling, job):
            self.stopped, self.thread = job.stopped, current_thread()
            assert self.compile.wait(100)
            compiling()
            compiling()
            assert self.end.wait(100)

    made = Work()
    made.compile, made.end = Event(), Event()
    monkeypatch.setattr(jit_warmup, "warm_up", made)
    yield made
    made.compile.set()
    made.end.set()


def test_a_window_does_not_warm_up_by_itself(window):
    assert window.warmup.thread_ is None
    assert not window.preparing.isVisible()


def test_preparing_is_told_only_while_something_is_compiled(window, qtbot, work):
    window.warmup.start()
    qtbot.wait(50)
    assert not window.preparing.isVisible()
    work.compile.set()
    qtbot.waitUntil(window.preparing.isVisible)
    assert work.thread is not main_thread()
    assert work.thread.daemon
    gc.unfreeze()
    work.end.set()
    qtbot.waitUntil(lambda: not window.preparing.isVisible())
    assert gc.get_freeze_count() > 1000, "what was imported is not searched for garbage"
    gc.unfreeze()
    first = window.warmup.thread_
    window.warmup.start()
    assert window.warmup.thread_ is first


def test_a_job_that_waits_for_compilation_says_so(window, qtbot, work):
    text, end = window.run_panel.text, Event()
    window.running.start_job("Reading a.su2", lambda _: None, lambda *_: end.wait(100))
    window.warmup.start()
    assert text.text() == "Reading a.su2"
    work.compile.set()
    qtbot.waitUntil(lambda: text.text() == "Reading a.su2 (compiling, once)")
    window.run_panel.show_progress(JobProgress("Measuring the cells", 0.5))
    assert text.text() == "Measuring the cells (compiling, once)"
    work.end.set()
    qtbot.waitUntil(lambda: text.text() == "Measuring the cells")
    end.set()
    qtbot.waitUntil(lambda: not window.runner.busy)
    gc.unfreeze()


def test_what_a_job_compiles_before_the_warm_up_is_told(window, qtbot, work):
    window.warmup.watch()
    numba.njit(lambda x: x + 1)(2)
    qtbot.waitUntil(window.preparing.isVisible)
    assert "once" in window.preparing.text()
    window.warmup.start()
    work.compile.set()
    work.end.set()
    qtbot.waitUntil(lambda: not window.preparing.isVisible())
    numba.njit(lambda x: x + 2)(2)
    qtbot.wait(50)
    assert not window.preparing.isVisible(), "nothing would end it"
    gc.unfreeze()


def test_closing_does_not_wait_for_it(window, work):
    window.warmup.start()
    assert window.close()
    assert window.warmup.thread_.is_alive()
    assert work.stopped()


@pytest.mark.slow
def test_the_program_ends_while_it_compiles(tmp_path):
    code = (
        "import sys\n"
        "from qtpy.QtCore import QCoreApplication, QSettings, QTimer\n"
        "from qtpy.QtWidgets import QApplication\n"
        "QSettings.setPath(QSettings.defaultFormat(), QSettings.Scope.UserScope, sys.argv[1])\n"
        "from slideviz.gui import app\n"
        "app.WARM_UP_MS = 0\n"
        "def end():\n"
        "    tops = QApplication.topLevelWidgets()\n"
        "    window = [top for top in tops if top.objectName() == 'slideviz'][0]\n"
        "    if not window.preparing.isVisible():\n"
        "        return QTimer.singleShot(20, end)\n"
        "    window.close()\n"
        "QTimer.singleShot(0, end)\n"
        "code = app.launch()\n"
        "sys.exit(code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
