"""The pictures in ``screenshots/``: the window in typical states, drawn by ``slideviz shots``."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.case.samples import write_sample
from slideviz.errors import SlidevizError

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

PATIENCE = 300.0
SIZE = (1280, 800)


@contextmanager
def display() -> Iterator[None]:
    """Offer a screen: the present one, or a virtual one for as long as it is needed.

    Raises
    ------
    SlidevizError
        There is no screen and no Xvfb to make one.
    """
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        yield
        return
    program = shutil.which("Xvfb")
    if program is None:
        raise SlidevizError("there is no display and no Xvfb; install Debian's package xvfb")
    read, write = os.pipe()
    call = [program, "-displayfd", str(write), "-screen", "0", "1920x1080x24", "-nolisten", "tcp"]
    server = subprocess.Popen(call, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            os.environ["DISPLAY"] = f":{number.readline().strip()}"
        yield
    finally:
        os.environ.pop("DISPLAY", None)
        server.terminate()
        server.wait()


def shots(folder: Path) -> list[Path]:
    """Draw all pictures into a folder and return them.

    Raises
    ------
    SlidevizError
        The folder cannot be written to, there is no screen, or the window does not get ready.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise SlidevizError(f"{folder}: cannot be made a folder ({problem.strerror})") from None
    with display(), tempfile.TemporaryDirectory() as place:
        for name in ("passage", "hexahedron"):
            # As motions: a displacement file would show a folder that is gone tomorrow.
            write_sample(name, Path(place) / name, variant="motion")
        return list(_states(Path(place), folder))


def _states(place: Path, folder: Path) -> Iterator[Path]:
    """Bring the window into each state and grab it."""
    from qtpy.QtCore import QSettings
    from qtpy.QtWidgets import QApplication

    from slideviz.gui import dialogs
    from slideviz.gui.window import MainWindow

    app = QApplication.instance() or QApplication(["slideviz"])
    settings = QSettings(str(place / "settings.ini"), QSettings.Format.IniFormat)
    window = MainWindow(settings)
    window.resize(*SIZE)
    window.show()
    dialogs.ask_unsaved, asked = (lambda *_: "discard"), dialogs.ask_unsaved
    try:
        yield _grab(window, folder / "start.png")
        _open(window, place / "passage" / "mesh.su2")
        yield _grab(window, folder / "boundaries.png")
        _open(window, place / "passage" / "passage.cfg")
        yield _grab(window, folder / "motion.png")
        _run(window)
        yield _grab(window, folder / "quality.png")
        _open(window, place / "hexahedron" / "hexahedron.cfg")
        window.set_theme("dark")
        yield _grab(window, folder / "three-dimensional-dark.png")
    finally:
        window.close()
        dialogs.ask_unsaved = asked
        app.processEvents()


def _wait(until: Callable[[], bool]) -> None:
    """Let the window work until a condition holds."""
    from qtpy.QtWidgets import QApplication

    end = time.monotonic() + PATIENCE
    while not until():
        if time.monotonic() > end:
            raise SlidevizError(f"the window did not get ready within {PATIENCE:.0f} s")
        QApplication.processEvents()
        time.sleep(0.01)


def _settle(window: MainWindow) -> None:
    _wait(lambda: not window.runner.busy)
    end = time.monotonic() + 0.5
    _wait(lambda: time.monotonic() > end)


def _open(window: MainWindow, path: Path) -> None:
    window.files.open_path(path)
    _settle(window)


def _run(window: MainWindow) -> None:
    window.start_run()
    _settle(window)


def _grab(window: MainWindow, path: Path) -> Path:
    _settle(window)
    window.view.snapshot()
    if not window.grab().save(str(path)):
        raise SlidevizError(f"{path}: the picture cannot be written; choose another folder")
    return path
