"""The application: starts Qt and the window, and keeps going when something unexpected happens."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

from qtpy.QtCore import QCoreApplication, Qt, QTimer
from qtpy.QtWidgets import QApplication

from slideviz.gui.icons import logo
from slideviz.gui.window import MainWindow

log = logging.getLogger("slideviz")


def launch(path: Path | None = None) -> int:
    """Show the window, open a mesh or case in it, and return the exit code when it is closed."""
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    app = QApplication.instance() or QApplication(sys.argv[:1])
    app.setApplicationName("slideviz")
    app.setWindowIcon(logo())
    window = MainWindow()
    previous = sys.excepthook
    sys.excepthook = lambda kind, error, trace: _unexpected(window, kind, error, trace)
    window.show()
    if path is not None:
        QTimer.singleShot(0, lambda: window.files.open_path(path))
    try:
        return int(app.exec())
    finally:
        sys.excepthook = previous


def _unexpected(window: MainWindow, kind, error, trace) -> None:
    """Tell of an error that nobody caught; the window goes on."""
    if issubclass(kind, KeyboardInterrupt):
        QApplication.quit()
        return
    log.error("unexpected", exc_info=(kind, error, trace))
    window.banner.tell_error(error.with_traceback(trace))
