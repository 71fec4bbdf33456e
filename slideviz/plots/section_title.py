"""The two lines above the picture of a section."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from slideviz.plots.section_layout import Layout

TITLE, LETTERS = 10.0, 9.0
"""Points of the letters of the first line, and of all others."""


def write_title(
    figure: Any,
    layout: Layout,
    first: tuple[str, str],
    second: str,
    across: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Write two lines above the axes; the name at the head of the first makes way for the rest.

    ``across`` is from where to where in the width they may reach.
    """
    height = figure.get_size_inches()[1]
    top = min(layout.top + 0.16 / height, 1.0 - 0.46 / height)
    write_line(figure, first, top + 0.22 / height, TITLE, across)
    write_line(figure, ("", second), top, LETTERS, across)


def write_line(
    figure: Any,
    said: tuple[str, str],
    at: float,
    size: float,
    across: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Write a name and words at a height, smaller where both are too long for the width."""
    name, words = said
    room = ((across[1] - across[0]) * figure.get_size_inches()[0] - 0.2) * figure.dpi
    renderer = figure.canvas.get_renderer()
    text = figure.text(sum(across) / 2.0, at, "", fontsize=size, ha="center", va="center")
    for shown in _shorter(name):
        text.set_text(f"{shown}: {words}" if shown else words)
        wide = text.get_window_extent(renderer).width / room
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
