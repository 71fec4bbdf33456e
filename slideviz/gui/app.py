"""Start the application: Qt, the window, and the handling of unexpected errors."""

from __future__ import annotations

import logging
import os
import sys
import tempfile
from pathlib import Path

from qtpy.QtCore import QCoreApplication, QSettings, QStandardPaths, Qt, QTimer
from qtpy.QtGui import QSurfaceFormat
from qtpy.QtWidgets import QApplication

from slideviz.gui.responsiveness.threads import import_numerics, prepare_drawing, tune_interpreter
from slideviz.gui.responsiveness.timers import READ_MS, WARM_UP_MS
from slideviz.gui.widgets.error_reporter import caught, crash_log
from slideviz.gui.widgets.theme import logo
from slideviz.gui.window import MainWindow
from slideviz.system.cleanup import private_file, private_folder

log = logging.getLogger("slideviz")


def launch(path: Path | None = None, run: bool = False) -> int:
    """Show the window, open a mesh or case in it, and return the exit code when it is closed.

    ``path``: the mesh or case to open. ``run``: whether to deform it at once.
    """
    import_numerics()
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    QSurfaceFormat.setDefaultFormat(_graphics())
    app = QApplication.instance()
    if not isinstance(app, QApplication):
        app = QApplication(sys.argv[:1])
    app.setApplicationName("slideviz")
    app.setDesktopFileName("slideviz")
    app.setWindowIcon(logo())
    places = QStandardPaths.StandardLocation
    kept = _folder(places.AppDataLocation)
    cache = _folder(places.CacheLocation)
    crashes = cache / "crashes"
    _keep_private(kept, cache)
    with crash_log(crashes):
        window = MainWindow(kept=kept / "sessions")
        with caught(window.error_reporter):
            tune_interpreter()
            window.show()
            window.recovery.start(crashes)
            QTimer.singleShot(0, lambda: prepare_drawing(window.view, window.scene.stage))
            window.live.switch(bool(window.settings.value("live", True, type=bool)))
            window.sync_actions()
            window.warmup.watch()
            QTimer.singleShot(WARM_UP_MS, window.warmup.start)
            if path is not None:
                QTimer.singleShot(0, lambda: window.files.open_path(path))
                if run:
                    QTimer.singleShot(READ_MS, lambda: _run_when_read(window))
            code = int(app.exec())
    if window.left_behind:
        # A library still computes in a thread that cannot be stopped: a normal exit would free
        # what it uses.
        logging.shutdown()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def _graphics() -> QSurfaceFormat:
    """Return the OpenGL format that VTK needs, to be Qt's default for all widgets.

    pyvistaqt sets the same, but after the application is made, about which Qt warns.
    """
    graphics = QSurfaceFormat.defaultFormat()
    graphics.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    graphics.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    graphics.setVersion(3, 2)
    return graphics


def _folder(place: QStandardPaths.StandardLocation) -> Path:
    return Path(QStandardPaths.writableLocation(place) or tempfile.gettempdir())


def _keep_private(*folders: Path) -> None:
    """Make settings and folders (sessions, crashes, samples) readable for the user only."""
    settings = Path(QSettings("slideviz", "slideviz").fileName())
    try:
        for folder in (*folders, settings.parent):
            if folder.name == "slideviz":  # not /tmp, the fallback
                private_folder(folder)
        private_file(settings)
    except OSError as problem:
        log.warning("others may read the saved session: %s", problem)


def _run_when_read(window: MainWindow) -> None:
    """Start the run as soon as the file is read, if all its requirements are met."""
    if window.runner.busy:
        QTimer.singleShot(READ_MS, lambda: _run_when_read(window))
    elif window.run_panel.run.isEnabled():
        window.start_run()
