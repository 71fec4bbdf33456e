"""The two lines above the picture of a section."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from slideviz.view.sections.layout import Layout

TITLE, LETTERS = 10.0, 9.0
"""Points of the letters of the first line, and of all others."""


def write_title(figure: Any, layout: Layout, first: tuple[str, str], second: str) -> None:
    """Write two lines above the axes; the name at the head of the first makes way for the rest."""
    width, height = figure.get_size_inches()
    renderer = figure.canvas.get_renderer()
    top = min(layout.top + 0.16 / height, 1.0 - 0.46 / height)
    for (name, words), above, size in ((first, 0.22, TITLE), (("", second), 0.0, LETTERS)):
        text = figure.text(0.5, top + above / height, "", fontsize=size, ha="center", va="center")
        for shown in _shorter(name):
            text.set_text(f"{shown}: {words}" if shown else words)
            wide = text.get_window_extent(renderer).width / ((width - 0.2) * figure.dpi)
            if wide <= 1.0:
                break
        else:
            text.set_fontsize(0.95 * size / wide)  # small letters are a little wider than that


def _shorter(name: str) -> Iterator[str]:
    """Yield a name with more and more of its middle left out, at last nothing."""
    yield name
    for kept in range(len(name) // 2 - 1, 3, -1):
        yield f"{name[:kept]}…{name[-kept:]}"
    yield ""
