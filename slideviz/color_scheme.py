"""Color schemes of light and dark views and of paper, and colors that are the same in all."""

from __future__ import annotations

from dataclasses import dataclass

from slideviz.terms import COLOR_MAPS

COLOR_MAP = next(iter(COLOR_MAPS))
"""The default color map: perceptually uniform, and readable for color-blind people."""

INVERTED_COLOR = "#e8112d"
SELECTED_COLOR = "#ffb000"
VALUE_EDGE = "#000000"
"""Edges of cells that are colored by values or roles: it differs from all colors of maps."""
INTERSECTION_COLOR = "#e8112d"  # the motion ghost of a boundary that crosses another one


@dataclass(frozen=True)
class ColorScheme:
    """A color scheme: colors of a view that belong together."""

    name: str
    background: str
    background_top: str
    """`background`, `background_top`: colors of the bottom and the top of the background, as
    ``#rrggbb``."""
    text: str
    edge: str
    cell: str
    ghost: str
    """`text`, `edge`, `cell`, `ghost`: colors of letters, of edges of cells, of faces without a
    value, of undeformed boundaries."""


LIGHT = ColorScheme("light", "#ffffff", "#e9edf2", "#20262e", "#5b6672", "#e3e8ee", "#4a5562")
DARK = ColorScheme("dark", "#1b1e23", "#2c323a", "#e6eaf0", "#8b96a3", "#3c444e", "#aab4c0")
PAPER = ColorScheme("paper", "#ffffff", "#ffffff", "#000000", "#3a3a3a", "#e3e8ee", "#777777")
