"""Whether there is a screen: asked of the server, for Qt ends the program where it is not there."""

from __future__ import annotations

import ctypes
import os
import socket
from contextlib import closing
from pathlib import Path


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
    """Return why no window can be shown, in words, or nothing."""
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
