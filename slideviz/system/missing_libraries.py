"""Libraries of the system that Qt and VTK load, which pip does not install."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterable
from pathlib import Path

from slideviz.system.platform import needs_server

WINDOW = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11-xcb.so.1": "libx11-xcb1",
    "libdbus-1.so.3": "libdbus-1-3",
    "libfontconfig.so.1": "libfontconfig1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-image.so.0": "libxcb-image0",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-randr.so.0": "libxcb-randr0",
    "libxcb-render-util.so.0": "libxcb-render-util0",
    "libxcb-shape.so.0": "libxcb-shape0",
    "libxcb-xfixes.so.0": "libxcb-xfixes0",
    "libxcb-xkb.so.1": "libxcb-xkb1",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
}
"""Libraries without which Qt ends the program, each with Debian's package of it."""
OPENGL = ("libegl1", "libgl1", "libgl1-mesa-dri")
"""Debian's packages that draw, if need be in software."""


def missing_for_window() -> list[str]:
    """Return Debian's packages of the libraries of `WINDOW` that cannot be loaded."""
    if not needs_server():
        return []
    return [package for name, package in WINDOW.items() if not is_loadable((name,))]


def is_loadable(names: Iterable[str]) -> bool:
    """Return whether the system's loader finds one of these libraries, or PyInstaller's folder."""
    folder = getattr(sys, "_MEIPASS", None)
    for name in names:
        if folder is not None and Path(folder, name).exists():
            return True
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


def apt_install(packages: Iterable[str]) -> str:
    """Return the command that installs packages on Debian and Ubuntu."""
    return f"sudo apt-get install {' '.join(packages)}"
