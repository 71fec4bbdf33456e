"""The versions of the libraries in use, and the platform."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib import metadata

PACKAGES = (
    "slideviz",
    "numpy",
    "scipy",
    "numba",
    "vtk",
    "pyvista",
    "pyvistaqt",
    "PySide6_Essentials",
)
"""Distributions whose versions belong into reports."""


def versions(*more: str) -> str:
    """Return Python's version, ``more`` ones, those of libraries and the platform, as lines."""
    lines = [f"Python {platform.python_version()}", *more]
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            lines.append(f"{name} {metadata.version(name)}")
    return "\n".join([*lines, platform.platform()])
