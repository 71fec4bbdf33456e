"""Color schemes of light and dark views and of paper, and colours that are alike in all."""

from __future__ import annotations

from dataclasses import dataclass

from slideviz.terms import COLOUR_MAPS

COLOUR_MAP = next(iter(COLOUR_MAPS))
"""Perceptually even, and the same for colour-blind people and on paper."""

INVERTED_COLOUR = "#e8112d"
SELECTED_COLOUR = "#ffb000"
VALUE_EDGE = "#000000"
"""Lines between cells in the colours of values or roles: what all maps are seen best under."""
INTERSECTION_COLOUR = "#e8112d"
"""The motion ghost where it runs into another boundary."""


@dataclass(frozen=True)
class ColorScheme:
    """A color scheme: colours of a view that belong together.

    Attributes
    ----------
    name : str
    background, background_top : str
        Bottom and top of the background.
    text, edge, cell, ghost : str
        Letters, edges of cells, faces without a value, undeformed boundaries.
    """

    name: str
    background: str
    background_top: str
    text: str
    edge: str
    cell: str
    ghost: str


LIGHT = ColorScheme("light", "#ffffff", "#e9edf2", "#20262e", "#5b6672", "#e3e8ee", "#4a5562")
DARK = ColorScheme("dark", "#1b1e23", "#2c323a", "#e6eaf0", "#8b96a3", "#3c444e", "#aab4c0")
PAPER = ColorScheme("paper", "#ffffff", "#ffffff", "#000000", "#3a3a3a", "#e3e8ee", "#777777")
