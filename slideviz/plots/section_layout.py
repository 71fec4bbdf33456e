"""Where the parts of a section's picture go: the axes, equal in scale, and the colour bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray

Box = tuple[float, float, float, float]

LEFT, RIGHT, BOTTOM, TOP = 0.85, 0.25, 0.6, 0.68
_EDGE = 0.25
BAR, BESIDE, BELOW = 0.16, 1.05, 0.75
"""Thickness of the colour bar, and the room that it needs beside or below the axes, in inches."""

_THIN = 25.0
"""Sections longer than so many times their height get air around them."""

_MARGIN = 0.02
LOWEST = 1.5
"""Inches that a picture is high at least."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Places in a figure.

    Attributes
    ----------
    low, high : (2,) float64
        What the axes show, in the mesh's length unit.
    axes, bar : (float, float, float, float)
        Left, bottom, width and height as parts of the figure.
    inches : (float, float)
        Size of the axes.
    upright_bar : bool
        The colour bar is beside the axes, else below.
    """

    low: FloatArray
    high: FloatArray
    axes: Box
    bar: Box
    inches: tuple[float, float]
    upright_bar: bool

    @property
    def top(self) -> float:
        """Return the upper end of axes and bar as a part of the figure."""
        return max(box[1] + box[3] for box in (self.axes, self.bar))

    @property
    def points_per_length(self) -> float:
        """Return the scale: typographic points for the mesh's unit of length."""
        return 72.0 * self.inches[0] / float(self.high[0] - self.low[0])


def inches_of(size: tuple[int, int], wanted: float | None = None) -> tuple[float, float, float]:
    """Return width and height in inches, and pixels per inch, of a picture in pixels.

    Where none are wanted, small pictures are printed small and large ones in full width, so that
    letters of 8 points can be read in both.
    """
    if wanted is not None:
        return size[0] / wanted, size[1] / wanted, wanted
    width = float(np.clip(size[0] / 200.0, 5.0, 10.0))
    dpi = size[0] / width
    return width, size[1] / dpi, dpi


def lay_out(
    box: tuple[FloatArray, FloatArray], inches: tuple[float, float], bare: bool = False
) -> Layout:
    """Return the layout that shows a box largest.

    Parameters
    ----------
    box : (2,), (2,) float64
        Lowest and highest coordinates.
    inches : (float, float)
        Size of the figure.
    bare : bool
        The axes have no ticks and labels.
    """
    low, high = aired(*box)
    width, height = inches
    left, bottom = (_EDGE, _EDGE) if bare else (LEFT, BOTTOM)
    free = {
        True: (width - left - BESIDE, height - bottom - TOP),
        False: (width - left - RIGHT, height - bottom - TOP - BELOW),
    }
    scale = {
        upright: max(min(room[0] / (high[0] - low[0]), room[1] / (high[1] - low[1])), 0.0)
        for upright, room in free.items()
    }
    upright = scale[True] >= scale[False]
    room = free[upright]
    size = np.maximum((high - low) * scale[upright], 0.1)
    x = left + max(room[0] - size[0], 0.0) / 2.0
    if upright:
        y = bottom + max(room[1] - size[1], 0.0) / 2.0
        long = min(max(size[1], 1.8), height - bottom - TOP)
        bar = (x + size[0] + 0.15, y + (size[1] - long) / 2.0, BAR, long)
    else:
        y = bottom + BELOW + max(room[1] - size[1], 0.0) / 2.0
        long = min(max(0.6 * size[0], 2.5), width - 1.8)
        bar = (x + (size[0] - long) / 2.0, y - bottom - 0.3, long, BAR)
    return Layout(
        low,
        high,
        parts((x, y, float(size[0]), float(size[1])), inches),
        parts(bar, inches),
        (float(size[0]), float(size[1])),
        upright,
    )


def height_for(
    box: tuple[FloatArray, FloatArray], inches: tuple[float, float], bare: bool = False
) -> float:
    """Return the height of a figure that shows a box as large as `lay_out`, and nothing empty.

    Parameters
    ----------
    box, inches, bare
        As for `lay_out`.

    Returns
    -------
    float
        Inches, not more than the given height.
    """
    layout, height = lay_out(box, inches, bare), inches[1]
    bottom = (_EDGE if bare else BOTTOM) + (0.0 if layout.upright_bar else BELOW)
    inside = layout.inches[1]
    if layout.upright_bar:
        inside = max(inside, layout.bar[3] * height)
    return float(min(max(bottom + inside + TOP, LOWEST), height))


def room_ratio(inches: tuple[float, float]) -> float:
    """Return width by height of what is left for axes beside an upright colour bar."""
    width, height = inches
    return max(width - LEFT - BESIDE, 0.1) / max(height - BOTTOM - TOP, 0.1)


def plot_layout(inches: tuple[float, float]) -> Layout:
    """Return the layout of a plot, whose axes have no common scale, without a colour bar."""
    width, height = inches
    size = (max(width - LEFT - 2 * RIGHT, 0.1), max(height - BOTTOM - TOP, 0.1))
    box = parts((LEFT, BOTTOM, *size), inches)
    return Layout(np.zeros(2), np.ones(2), box, box, size, upright_bar=True)


def aired(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the box with a margin, and not thinner than one part in ``_THIN``."""
    size = high - low
    longest = float(size.max()) or 1.0
    wanted = np.maximum(size + 2 * _MARGIN * longest, longest / _THIN)
    extra = (wanted - size) / 2.0
    return low - extra, high + extra


def parts(box: Box, inches: tuple[float, float]) -> Box:
    """Return a box in inches as parts of a figure of so many."""
    x, y, wide, high = box
    return x / inches[0], y / inches[1], wide / inches[0], high / inches[1]
