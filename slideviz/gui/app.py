"""The application: starts Qt and the window, and keeps going when something unexpected happens."""

from __future__ import annotations

import gc
import logging
import os
import sys
import tempfile
from importlib import import_module
from pathlib import Path

from qtpy.QtCore import QCoreApplication, QSettings, QStandardPaths, Qt, QTimer
from qtpy.QtGui import QSurfaceFormat
from qtpy.QtWidgets import QApplication
from threadpoolctl import ThreadpoolController

from slideviz.gui.responsiveness.garbage import Tidy
from slideviz.gui.responsiveness.jit_warmup import prepare_drawing
from slideviz.gui.responsiveness.worker import hold_libraries_back
from slideviz.gui.widgets.faults import caught, crash_log
from slideviz.gui.widgets.icons import logo
from slideviz.gui.window import MainWindow
from slideviz.mesh.io.private import private_file, private_folder

log = logging.getLogger("slideviz")
WARM_UP_MS = 300
"""The window is drawn first: compilation slows everything down a little."""

SWITCH_S = 0.00005
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
    ready_numerics()
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    QSurfaceFormat.setDefaultFormat(_graphics())
    app = QApplication.instance() or QApplication(sys.argv[:1])
    app.setApplicationName("slideviz")
    app.setWindowIcon(logo())
    places = QStandardPaths.StandardLocation
    kept, cache = _folder(places.AppDataLocation), _folder(places.CacheLocation)
    crashes = cache / "crashes"
    _keep_private(kept, cache)
    with crash_log(crashes):
        window = MainWindow(kept=kept / "sessions")
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


def _graphics() -> QSurfaceFormat:
    """Return what VTK draws with, for all that Qt shares with it.

    pyvistaqt asks for the same, but for Qt too late: it warns that it may not be had.
    """
    graphics = QSurfaceFormat.defaultFormat()
    graphics.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    graphics.setProfile(QSurfaceFormat.OpenGLContextProfile.CoreProfile)
    graphics.setVersion(3, 2)
    return graphics


def ready_numerics() -> None:
    """Import what computes, before there is any other thread, and let the window go before it."""
    # Here, once: two threads that import Numba at the same time (the warm-up and a run) find it
    # half-made.
    import_module("slideviz.deformation.solver")
    hold_libraries_back()
    _leave_products_alone()


def _leave_products_alone() -> None:
    """Let NumPy multiply in the thread that asks for it, where SciPy has a BLAS of its own.

    The window multiplies, too, and on a busy machine the threads of BLAS wait for each other:
    0.14 s instead of 3 ms for the points of a large mesh. Large systems are SciPy's.
    """
    blas = ThreadpoolController().select(user_api="blas").lib_controllers
    numpys = [one for one in blas if "numpy.libs" in one.filepath]
    if len(numpys) < len(blas):
        for one in numpys:
            one.set_num_threads(1)


def be_quick() -> Tidy:
    """Set Python up for a window that must answer while other threads compute.

    Returns
    -------
    Tidy
        Looks for garbage from now on; it belongs to the application.
    """
    # The modules live as long as the window, and need not be searched for garbage.
    gc.collect()
    gc.freeze()
    # A picture asks for the interpreter a hundred times: at Python's 5 ms each, or even at one,
    # that would be seen while another thread draws a plot.
    sys.setswitchinterval(SWITCH_S)
    tidy = Tidy(QCoreApplication.instance())
    tidy.start()
    return tidy


def _folder(place: QStandardPaths.StandardLocation) -> Path:
    return Path(QStandardPaths.writableLocation(place) or tempfile.gettempdir())


def _keep_private(*folders: Path) -> None:
    """Let nobody else read settings, sessions and crashes, nor the samples."""
    settings = Path(QSettings("slideviz", "slideviz").fileName())
    try:
        for folder in (*folders, settings.parent):
            if folder.name == "slideviz":  # not /tmp, where there is no place of its own
                private_folder(folder)
        private_file(settings)
    except OSError as problem:
        log.warning("others may read what is kept: %s", problem)


def _run_when_read(window: MainWindow) -> None:
    """Start the run as soon as the file is read, if nothing is missing for it."""
    if window.runner.busy:
        QTimer.singleShot(100, lambda: _run_when_read(window))
    elif window.run_panel.run.isEnabled():
        window.start_run()
