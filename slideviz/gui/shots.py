"""Make the pictures in ``screenshots/``: the window in typical states, by ``slideviz shots``.

They are grabbed from the screen: a window rendered into a picture by Qt would have tab bars that
are not visible.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.errors import SlidevizError
from slideviz.gui.shots_states import settle
from slideviz.system.cleanup import draft, ended

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

SIZE = (1280, 800)
"""Width and height of the window in pixels."""

APART, MANY, EXACT = 192, 40, 24
"""Numbers of colors in a picture's palette: mutually distant; of large areas; most frequent."""


def shots(folder: Path) -> list[Path]:
    """Write all pictures, and the film, into a folder, and return their paths.

    Raises
    ------
    SlidevizError
        The folder cannot be written to, there is no screen, or the window does not get ready.
    """
    from slideviz.gui.shots_states import STATES, film_of_passage

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise SlidevizError(f"{folder}: cannot be made a folder ({problem.strerror})") from None
    with draft(Path(tempfile.gettempdir()), is_folder=True) as place, display():
        made = []
        for state in STATES:
            with open_window(place) as window:
                state.bring(window, place)
                made.append(photograph(window, folder / f"{state.name}.png"))
        return [*made, film_of_passage(folder / "passage.gif")]


@contextmanager
def display() -> Iterator[None]:
    """Provide a display within the context: an Xvfb of its own; without Xvfb the present one.

    Raises
    ------
    SlidevizError
        There is no screen and no Xvfb to make one.
    """
    from qtpy.QtWidgets import QApplication

    program = shutil.which("Xvfb")
    names = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    before = {name: os.environ[name] for name in names if name in os.environ}
    there = before.get("DISPLAY") or before.get("WAYLAND_DISPLAY")
    if QApplication.instance() is not None or (program is None and there):
        yield
        return
    if program is None:
        raise SlidevizError("there is no display and no Xvfb; install Debian's package xvfb")
    read, write = os.pipe()
    call = [program, "-displayfd", str(write), "-screen", "0", "1920x1080x24", "-nolisten", "tcp"]
    server = subprocess.Popen(call, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with ended(server):
        try:
            with os.fdopen(read) as number:
                os.environ["DISPLAY"] = f":{number.readline().strip()}"
            os.environ.pop("WAYLAND_DISPLAY", None)
            os.environ["QT_QPA_PLATFORM"] = "xcb"
            yield
        finally:
            for name in names:
                os.environ.pop(name, None)
            os.environ.update(before)
            server.terminate()
            server.wait()


@contextmanager
def open_window(place: Path) -> Iterator[MainWindow]:
    """Provide a window of `SIZE`, with settings of its own in a folder instead of the user's."""
    from qtpy.QtCore import QSettings
    from qtpy.QtWidgets import QApplication

    from slideviz.gui.widgets import questions
    from slideviz.gui.window import MainWindow

    app = QApplication.instance() or QApplication(["slideviz"])
    settings = QSettings(str(place / "settings.ini"), QSettings.Format.IniFormat)
    settings.clear()
    window = MainWindow(settings)
    window.resize(*SIZE)
    window.move(0, 0)
    window.show()
    questions.ask_unsaved, asked = (lambda *_: "discard"), questions.ask_unsaved
    try:
        yield window
    finally:
        window.close()
        questions.ask_unsaved = asked
        app.processEvents()


def photograph(window: MainWindow, path: Path) -> Path:
    """Write a picture of the part of the screen where the window is, and return its path.

    Raises
    ------
    SlidevizError
        The file cannot be written.
    """
    settle(window)
    window.view.snapshot()
    window.viewing.render()
    settle(window)
    frame = window.geometry()
    shown = window.screen().grabWindow(0, frame.x(), frame.y(), frame.width(), frame.height())
    if not shown.save(str(path)):
        raise SlidevizError(f"{path}: the picture cannot be written; choose another folder")
    shrink(path)
    return path


def shrink(path: Path) -> None:
    """Reduce a PNG picture to a palette of 256 colors: a third of its size, hardly visible."""
    import numpy as np
    from PIL import Image
    from scipy.spatial import KDTree

    with Image.open(path) as image:
        drawn = image.convert("RGB")
    # A red cell keeps its red, a shaded background has no bands, and white stays white.
    apart = drawn.quantize(APART, Image.Quantize.MAXCOVERAGE, kmeans=1).getpalette() or []
    many = drawn.quantize(MANY, Image.Quantize.MEDIANCUT).getpalette() or []
    counted = sorted(drawn.getcolors(drawn.width * drawn.height) or [], reverse=True)
    exact = np.ravel([color for _, color in counted[:EXACT]]).tolist()
    palette = apart[: 3 * APART] + many[: 3 * MANY] + exact
    # Pillow's own search for the nearest color is coarse: it maps 255 to 250.
    tree = KDTree(np.reshape(palette, (-1, 3)))
    colors, where = np.unique(np.asarray(drawn).reshape(-1, 3), axis=0, return_inverse=True)
    nearest = np.asarray(tree.query(colors)[1], np.uint8)[where.ravel()]
    fewer = Image.fromarray(nearest.reshape(drawn.height, drawn.width), "P")
    fewer.putpalette(palette)
    fewer.save(path, optimize=True)
