"""The application: starts Qt and the window, and keeps going when something unexpected happens."""

from __future__ import annotations

import gc
import logging
import sys
from importlib import import_module
from pathlib import Path

from qtpy.QtCore import QCoreApplication, Qt, QTimer
from qtpy.QtWidgets import QApplication

from slideviz.gui.icons import logo
from slideviz.gui.window import MainWindow

WARM_UP_MS = 300
"""The window is drawn first: compilation slows everything down a little."""

log = logging.getLogger("slideviz")


def launch(path: Path | None = None, run: bool = False) -> int:
    """Show the window, open a mesh or case in it, and return the exit code when it is closed.

    Parameters
    ----------
    path : Path, optional
        The mesh or case to open.
    run : bool
        Whether to deform it at once.
    """
    # Here, once: two threads that import Numba at the same time (the warm-up and a run) find it
    # half-made.
    import_module("slideviz.staircase")
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    app = QApplication.instance() or QApplication(sys.argv[:1])
    app.setApplicationName("slideviz")
    app.setWindowIcon(logo())
    window = MainWindow()
    previous = sys.excepthook
    sys.excepthook = lambda kind, error, trace: _unexpected(window, kind, error, trace)
    # The modules live as long as the window, and need not be searched for garbage.
    gc.collect()
    gc.freeze()
    window.show()
    QTimer.singleShot(WARM_UP_MS, window.warm_up.start)
    if path is not None:
        QTimer.singleShot(0, lambda: window.files.open_path(path))
        if run:
            QTimer.singleShot(100, lambda: _run_when_read(window))
    try:
        return int(app.exec())
    finally:
        sys.excepthook = previous


def _run_when_read(window: MainWindow) -> None:
    """Start the run as soon as the file is read, if nothing is missing for it."""
    if window.runner.busy:
        QTimer.singleShot(100, lambda: _run_when_read(window))
    elif window.run_panel.run.isEnabled():
        window.start_run()


def _unexpected(window: MainWindow, kind, error, trace) -> None:
    """Tell of an error that nobody caught; the window goes on."""
    if issubclass(kind, KeyboardInterrupt):
        QApplication.quit()
        return
    log.error("unexpected", exc_info=(kind, error, trace))
    window.banner.tell_error(error.with_traceback(trace))
