"""An off-screen plotter, its letters, and its image as numbers or as a PNG file."""

from __future__ import annotations

import ctypes
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slideviz.color_scheme import ColorScheme
from slideviz.errors import SlidevizError
from slideviz.scene.color_legend import set_letters

SMALLEST, LARGEST = 64, 8192
"""Pixels that a picture may be wide or high; graphics drivers draw no larger ones."""
TITLE = 16
"""Height of the title's letters in pixels, at normal size."""
_NORMAL_HEIGHT = 620
"""A picture this high has letters of normal size."""
CAPTION_AT = 0.02
"""Where in the width the words above a picture or a film begin."""
LETTERS = 1.25
"""Letters of pictures and films over those of the view: they are often shown small."""


@contextmanager
def offscreen(size: tuple[int, int]) -> Iterator[Any]:
    """Give an off-screen plotter of ``size`` pixels that works without a screen, too.

    Raises
    ------
    SlidevizError
        The size is not one that can be drawn.
    """
    import pyvista as pv

    check_size(size)
    if sys.platform.startswith("linux") and not x_answers():
        # VTK would first try X, and complain, before it turns to EGL.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.set_background("white")  # type: ignore[arg-type]  # the decorator loses self
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        yield plotter
    finally:
        plotter.close()


def check_size(size: tuple[int, int]) -> None:
    """Raise SlidevizError when a picture cannot have this width and height in pixels."""
    if not all(SMALLEST <= length <= LARGEST for length in size):
        raise SlidevizError(
            f"a picture of {size[0]}x{size[1]} pixels cannot be drawn; width and height are "
            f"{SMALLEST} to {LARGEST}"
        )


def font_scale(size: tuple[int, int]) -> float:
    """Return how much larger than normal the letters of a picture are."""
    return max(size[1] / _NORMAL_HEIGHT, 0.6)


def write_title(plotter: Any, words: str, scheme: ColorScheme, letters: float, room: float) -> None:
    """Write a line or two along the upper edge, in the middle of so many pixels of height.

    They begin at the left, so that those of a film do not tremble when a digit more comes, and
    pictures have them where films do. ``letters`` is their height in pixels.
    """
    import pyvista as pv

    title = pv.Text(words)
    set_letters(title.prop, scheme, letters)
    title.prop.SetLineSpacing(1.25)
    # The mesh of a view that was zoomed into may lie behind.
    title.prop.SetBackgroundColor(*pv.Color(scheme.background_top).float_rgb)
    title.prop.SetBackgroundOpacity(0.7)
    title.prop.SetVerticalJustificationToCentered()
    title.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    high = 1.0 - 0.5 * room / plotter.window_size[1]
    title.GetPositionCoordinate().SetValue(CAPTION_AT, high)
    plotter.add_actor(title, name="title", reset_camera=False, render=False)


def resize(plotter: Any, size: tuple[int, int]) -> None:
    """Give the next image of a plotter another size; pyvista's way would draw one at once."""
    plotter.render_window.SetSize(*size)


def image_of(plotter: Any, transparent: bool = False) -> NDArray[np.uint8]:
    """Return the image of the plotter, (height, width, 3), or 4 when ``transparent``."""
    plotter.render()
    image = plotter.screenshot(return_img=True, transparent_background=transparent)
    return np.ascontiguousarray(image, dtype=np.uint8)


def png_bytes(image: NDArray[np.uint8]) -> bytes:
    """Return an image (height, width, 3 or 4) as a PNG file."""
    from PIL import Image

    data = BytesIO()
    Image.fromarray(image).save(data, format="PNG", optimize=False)
    return data.getvalue()


def check_png(file: Path) -> None:
    """Raise SlidevizError when the name of a picture does not end with .png."""
    if file.suffix.lower() != ".png":
        raise SlidevizError(f"{file}: pictures are PNG; end the name with .png")


def x_answers() -> bool:
    """Tell whether the X server that ``DISPLAY`` names is there and lets us in."""
    if not os.environ.get("DISPLAY"):
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
    except OSError:
        return True  # nobody to ask
    library.XOpenDisplay.restype = ctypes.c_void_p
    library.XOpenDisplay.argtypes = [ctypes.c_char_p]
    library.XCloseDisplay.argtypes = [ctypes.c_void_p]
    server = library.XOpenDisplay(None)
    if server:
        library.XCloseDisplay(server)
    return bool(server)


def wayland_answers() -> bool:
    """Tell whether the compositor that ``WAYLAND_DISPLAY`` names is there."""
    name = os.environ.get("WAYLAND_DISPLAY")
    if not name:
        return False
    place = Path(os.environ.get("XDG_RUNTIME_DIR", "/"), name)
    try:
        with closing(socket.socket(socket.AF_UNIX)) as line:
            line.connect(str(place))
    except OSError:
        return False
    return True


def missing_screen() -> str:
    """Return the reason, in words, why no window can be shown, or nothing."""
    if x_answers() or wayland_answers():
        return ""
    named = [
        f"{name}={os.environ[name]}"
        for name in ("DISPLAY", "WAYLAND_DISPLAY")
        if os.environ.get(name)
    ]
    if not named:
        return "neither DISPLAY nor WAYLAND_DISPLAY is set"
    return f"{' and '.join(named)}: no server answers there, or it does not let you in"
