"""Windows that are closed leave nothing: no session, no mesh, no scene, no thread, no memory."""

import gc
import os
import threading
import weakref
from pathlib import Path

import pytest
from qtpy.QtCore import QCoreApplication, QEvent
from qtpy.QtWidgets import QApplication

from slideviz.gui.widgets.plot_canvas import THREAD
from slideviz.gui.window import MainWindow
from slideviz.session import changes

PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def memory_mb():
    path = Path("/proc/self/statm")
    if not path.exists():
        pytest.skip("no /proc")
    return int(path.read_text().split()[1]) * PAGE_MB


def cycle(qtbot, settings, path):
    """Open, run, close; return weak references to what must be gone."""
    window = MainWindow(settings, multi_samples=0)
    with qtbot.waitExposed(window):
        window.show()
    window.files.open_path(path)
    qtbot.waitUntil(lambda: window.store.session.mesh is not None and not window.runner.busy)
    window.store.change(changes.set_case, steps=2)
    window.start_run()
    qtbot.waitUntil(lambda: not window.runner.busy)
    session = window.store.session
    assert len(session.frames) == 3
    gone = [
        weakref.ref(thing)
        for thing in (window.store, session.mesh, session.frames[-1], session.case, window.scene)
    ]
    window.close()
    assert window.runner.close(), "its thread has ended"
    window.deleteLater()
    return gone


def settle():
    for thread in threading.enumerate():
        if thread.name == THREAD:
            thread.join()  # a plot that was on its way
    for _ in range(3):
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QCoreApplication.processEvents()
        gc.collect()


def windows(qtbot, settings, path, monkeypatch, count):
    from slideviz.gui.widgets import questions

    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
    memory = []
    for _ in range(count):
        gone = cycle(qtbot, settings, path)
        settle()
        left = [type(ref()).__name__ for ref in gone if ref() is not None]
        assert left == []
        memory.append(memory_mb())
    return memory


@pytest.fixture
def case_file(sample_folder):
    return next((sample_folder / "hexahedron").glob("*.cfg"))


@pytest.mark.parametrize("count", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_windows_leave_nothing(qtbot, settings, case_file, monkeypatch, count):
    threads, widgets = threading.active_count(), set(QApplication.allWidgets())
    windows(qtbot, settings, case_file, monkeypatch, count)
    assert threading.active_count() <= threads
    assert set(QApplication.allWidgets()) <= widgets


@pytest.mark.slow
def test_fifty_windows_do_not_grow(qtbot, settings, case_file, monkeypatch):
    memory = windows(qtbot, settings, case_file, monkeypatch, 50)
    # The first ones fill caches; from then on less than a window's worth in forty.
    assert memory[-1] - memory[9] < 40.0, [round(mb) for mb in memory]
