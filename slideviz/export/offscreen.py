"""An off-screen plotter, its title, and its image as an array or as a PNG file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  # whose windows vtkRenderWindow makes
from numpy.typing import NDArray
from PIL import Image
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkRenderingCore import vtkRenderWindow

from slideviz.color_scheme import ColorScheme
from slideviz.errors import SlidevizError
from slideviz.scene.legend import set_letters
from slideviz.system.missing_libraries import OPENGL, apt_install, is_loadable
from slideviz.system.platform import has_wayland, has_x_server, needs_server

SMALLEST = 64
LARGEST = 8192
"""Least and largest width or height of a picture in pixels; drivers draw no larger ones."""
TITLE = 16  # height of the title's letters in pixels, at normal size
_NORMAL_HEIGHT = 620  # height in pixels of a picture with letters of normal size
CAPTION_AT = 0.02  # left end of the title of a picture or film, relative to the width
LETTERS = 1.25
"""Size of the letters of pictures and films relative to the view's; they are often shown small."""
_OSMESA = ("libOSMesa.so", "libOSMesa.so.8", "libOSMesa.so.6")


@contextmanager
def offscreen(size: tuple[int, int]) -> Iterator[Any]:
    """Yield an off-screen plotter of ``size`` pixels, which works without a display too.

    Raises SlidevizError if the size cannot be drawn, or nothing can.
    """
    check_drawable(size)
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.set_background("white")  # type: ignore[arg-type]  # the decorator loses self
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        yield plotter
    finally:
        plotter.close()


def check_drawable(size: tuple[int, int]) -> None:
    """Raise SlidevizError if a picture of this width and height in pixels cannot be drawn."""
    if not all(SMALLEST <= length <= LARGEST for length in size):
        raise SlidevizError(
            f"a picture of {size[0]}x{size[1]} pixels cannot be drawn; width and height are "
            f"{SMALLEST} to {LARGEST}"
        )
    if not has_opengl():
        raise SlidevizError(
            "pictures need OpenGL, which this system does not have; on Debian or Ubuntu use "
            f"`{apt_install(OPENGL)}`"
        )


@cache
def has_opengl() -> bool:
    """Return whether VTK finds a library to draw with; without one it would crash."""
    if not needs_server():
        return True
    if has_x_server():
        return is_loadable(("libGLX.so.0", "libGL.so.1"))
    # VTK would try X first, and log errors, before it uses EGL.
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    shown = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    kind = vtkRenderWindow().GetClassName()
    vtkLogger.SetStderrVerbosity(shown)
    # VTK's last resort, which it takes without a look whether its library is there.
    return kind != "vtkOSOpenGLRenderWindow" or is_loadable(_OSMESA)


def font_scale(size: tuple[int, int]) -> float:
    """Return the size of the letters, relative to normal, of a picture of a size in pixels."""
    return max(size[1] / _NORMAL_HEIGHT, 0.6)


def write_title(
    plotter: Any, words: str, scheme: ColorScheme, letters: float, height: float
) -> None:
    """Draw a title of one line or two at the left of the upper edge.

    It is left-aligned so that a film's title does not move when its number of digits changes.
    ``letters``: size of the letters. ``height``: height in pixels of the strip in which the title
    is vertically centred.
    """
    title = text_on_plate(words, scheme, letters)
    title.prop.SetLineSpacing(1.25)
    title.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    high = 1.0 - 0.5 * height / plotter.window_size[1]
    title.GetPositionCoordinate().SetValue(CAPTION_AT, high)
    plotter.add_actor(title, name="title", reset_camera=False, render=False)


def text_on_plate(words: str, scheme: ColorScheme, letters: float) -> Any:
    """Return an actor of words, vertically centred, which a mesh may be behind."""
    text = pv.Text(words)
    set_letters(text.prop, scheme, letters)
    text.prop.SetBackgroundColor(*pv.Color(scheme.background_top).float_rgb)
    text.prop.SetBackgroundOpacity(0.7)
    text.prop.SetVerticalJustificationToCentered()
    return text


def resize(plotter: Any, size: tuple[int, int]) -> None:
    """Set the size of a plotter's next image; unlike pyvista's setter, it draws nothing now."""
    plotter.render_window.SetSize(*size)


def image_of(plotter: Any, transparent: bool = False) -> NDArray[np.uint8]:
    """Draw the plotter, and return its image (height, width, 3), or 4 if ``transparent``."""
    plotter.render()
    image = plotter.screenshot(return_img=True, transparent_background=transparent)
    return np.ascontiguousarray(image, dtype=np.uint8)


def png_bytes(image: NDArray[np.uint8], **known: Any) -> bytes:
    """Return the content of a PNG file with an image (height, width, 3 or 4), and what is known."""
    data = BytesIO()
    Image.fromarray(image).save(data, format="PNG", **known)
    return data.getvalue()


WEB_PAGE = ".html"
"""The ending of a picture that can be turned in a browser."""


def check_picture(file: Path) -> None:
    """Raise SlidevizError if the name of a picture does not end with .png or .html."""
    if file.suffix.lower() not in (".png", WEB_PAGE):
        raise SlidevizError(
            f"{file}: pictures are PNG, or web pages that can be turned; end the name with .png "
            f"or {WEB_PAGE}"
        )


def display_fault() -> str:
    """Return why no window can be shown, in words; empty if a display is available."""
    if not needs_server() or has_x_server() or has_wayland():
        return ""
    named = [
        f"{name}={os.environ[name]}"
        for name in ("DISPLAY", "WAYLAND_DISPLAY")
        if os.environ.get(name)
    ]
    if not named:
        return "neither DISPLAY nor WAYLAND_DISPLAY is set"
    return f"{' and '.join(named)}: no server answers there, or it refuses the connection"
