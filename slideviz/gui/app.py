"""The application: starts Qt and the window, and keeps going when something unexpected happens."""

from __future__ import annotations

import gc
import logging
import os
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from qtpy.QtCore import QCoreApplication, QStandardPaths, Qt, QTimer
from qtpy.QtWidgets import QApplication

from slideviz.gui.faults import caught, crash_log
from slideviz.gui.icons import logo
from slideviz.gui.warm import prepare_drawing
from slideviz.gui.window import MainWindow

WARM_UP_MS = 300
"""The window is drawn first: compilation slows everything down a little."""

SWITCH_S = 0.001
"""How long a thread may keep the interpreter to itself when another wants it."""


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
    places = QStandardPaths.StandardLocation
    crashes = _folder(places.CacheLocation) / "crashes"
    with crash_log(crashes):
        window = MainWindow(kept=_folder(places.AppDataLocation) / "sessions")
        with caught(window.faults):
            be_quick()
            window.show()
            window.restore.look(crashes)
            QTimer.singleShot(0, lambda: prepare_drawing(window.view, window.scene.stage))
            QTimer.singleShot(WARM_UP_MS, window.warm_up.start)
            if path is not None:
                QTimer.singleShot(0, lambda: window.files.open_path(path))
                if run:
                    QTimer.singleShot(100, lambda: _run_when_read(window))
            code = int(app.exec())
    if window.left_behind:
        # A library still computes in a thread that cannot be stopped: no tidying up under it.
        logging.shutdown()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def be_quick() -> None:
    """Set Python up for a window that must answer while other threads compute."""
    # The modules live as long as the window, and need not be searched for garbage.
    gc.collect()
    gc.freeze()
    # A picture asks for the interpreter a dozen times; 5 ms each would be seen.
    sys.setswitchinterval(SWITCH_S)


def _folder(place: QStandardPaths.StandardLocation) -> Path:
    return Path(QStandardPaths.writableLocation(place) or tempfile.gettempdir())


def _run_when_read(window: MainWindow) -> None:
    """Start the run as soon as the file is read, if nothing is missing for it."""
    if window.runner.busy:
        QTimer.singleShot(100, lambda: _run_when_read(window))
    elif window.run_panel.run.isEnabled():
        window.start_run()
