"""Where the parts of a picture of two sections go: equal axes, and one colour bar for both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.plots.section_layout import (
    BAR,
    BELOW,
    BESIDE,
    BOTTOM,
    LEFT,
    LOWEST,
    RIGHT,
    TOP,
    Box,
    Layout,
    aired,
    parts,
)

_HEAD = 0.32
"""Inches at the top for what both have in common."""
_GAP = 0.3
"""Inches between two that are beside each other, and above the title of one below another."""
_HIGHER = {True: 1.4, False: 2.0}
"""The picture of two may be so many times as high as that of one, where they are beside or above
each other."""
_TITLE = 2.7, 2.2
"""Inches from one to the next beside it that their titles need, and the least that will do."""
_LONG = 1.2
"""Inches that an upright colour bar is long at least."""


@dataclass(frozen=True, eq=False)
class PairLayout:
    """Places in a figure of two sections.

    Attributes
    ----------
    panes : (Layout, Layout)
        Each of one section, without a colour bar; left and right, or above and below.
    bar : Layout
        That of the colour bar.
    height : float
        Inches of the figure.
    beside : bool
        They are beside each other, else one above the other.
    """

    panes: tuple[Layout, Layout]
    bar: Layout
    height: float
    beside: bool


def lay_out_pair(box: tuple[FloatArray, FloatArray], inches: tuple[float, float]) -> PairLayout:
    """Return the layout that shows a box largest twice: one beside the other, or above it.

    Parameters
    ----------
    box : (2,), (2,) float64
        Lowest and highest coordinates of both.
    inches : (float, float)
        Width, and most height of the picture of one; that of two may be higher.
    """
    low, high = aired(*box)
    size, (width, most) = high - low, inches
    # Above each other they have the bar below: beside them it would cross the titles.
    free = {
        True: ((width - LEFT - BESIDE - _GAP) / 2, _HIGHER[True] * most - _fixed(True)),
        False: (width - LEFT - RIGHT, (_HIGHER[False] * most - _fixed(False)) / 2),
    }
    scale = {beside: float((np.array(room) / size).min()) for beside, room in free.items()}
    beside = scale[True] >= scale[False] and free[True][0] + _GAP >= _TITLE[1]
    wide, tall = np.maximum(size * max(scale[beside], 0.0), 0.1).tolist()
    if beside:
        return _beside((low, high), width, (wide, tall))
    return _above((low, high), width, (wide, tall))


def _fixed(beside: bool) -> float:
    """Return the inches of the height that are not of the axes."""
    return _HEAD + TOP + BOTTOM + (0.0 if beside else TOP + _GAP + BELOW)


def _beside(
    box: tuple[FloatArray, FloatArray], width: float, size: tuple[float, float]
) -> PairLayout:
    """Return the layout of axes of a size in inches that are beside each other."""
    wide, tall = size
    room = width - LEFT - BESIDE
    step = max(wide + _GAP, min(_TITLE[0], room / 2.0))
    height = max(_fixed(True) + max(tall, _LONG - 0.4), LOWEST)
    left = LEFT + max(room - step - wide, 0.0) / 2.0
    bottom = height - _HEAD - TOP - tall
    long = max(tall, _LONG)
    bar = (left + step + wide + 0.15, bottom + tall - long, BAR, long)
    starts = (left, bottom), (left + step, bottom)
    return _placed(box, (width, height), starts, size, bar)


def _above(
    box: tuple[FloatArray, FloatArray], width: float, size: tuple[float, float]
) -> PairLayout:
    """Return the layout of axes of a size in inches that are above each other."""
    wide, tall = size
    height = _fixed(False) + 2 * tall
    left = LEFT + max(width - LEFT - RIGHT - wide, 0.0) / 2.0
    bottom = BOTTOM + BELOW
    long = min(max(0.6 * wide, 2.5), width - 1.8)
    middle = min(max(left + wide / 2.0, long / 2.0 + 0.3), width - long / 2.0 - 0.3)
    bar = (middle - long / 2.0, BELOW - 0.3, long, BAR)
    starts = (left, bottom + tall + TOP + _GAP), (left, bottom)
    return _placed(box, (width, height), starts, size, bar)


def _placed(
    box: tuple[FloatArray, FloatArray],
    inches: tuple[float, float],
    starts: tuple[tuple[float, float], tuple[float, float]],
    size: tuple[float, float],
    bar: Box,
) -> PairLayout:
    """Return the layout of a figure of so many inches, with axes that start there."""
    beside = starts[0][1] == starts[1][1]
    first, second = (
        Layout(*box, place, place, size, beside)
        for place in (parts((*start, *size), inches) for start in starts)
    )
    place = parts(bar, inches)
    return PairLayout((first, second), Layout(*box, place, place, size, beside), inches[1], beside)
