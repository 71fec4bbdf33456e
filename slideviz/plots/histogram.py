"""The histogram of values of cells, drawn onto given axes, with inverted cells counted apart.

One distribution may be drawn as bars; all others are outlines in steps, which differ by color and
dashes, so that they can be told apart over the bars, over each other, and in grey.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.legend_handler import HandlerBase
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import NullLocator

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.plots.style import PRINT, Style, add_legend, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND = 0.12
_STEMS = 0.62
"""Width of the strip of inverted cells, left of the values, relative to the range of values; and
the part of the strip for the counts, beside its label."""
_PALER = 0.45  # part of the background's color mixed into bars, so that lines over them stand out
_SWATCH = 5  # number of colors that represent the bars in a legend


@record
class QualityRun:
    """Qualities of the cells of one mesh."""

    label: str
    values: FloatArray  # (m,): 0 to 1
    inverted: np.ndarray | None = None  # (m,): cells to count apart, whatever their value
    series: int = 0  # series number (see `slideviz.plots.style.Style.series`)


@record
class Distribution:
    """The number of cells of one mesh in intervals of a value."""

    counts: IntArray  # (k,)
    edges: FloatArray
    """(k + 1,): limits of the intervals; values outside are counted in the first or the last."""
    inverted: int  # number of inverted cells, which are in no interval

    @classmethod
    def of(cls, values: FloatArray, edges: FloatArray) -> Distribution:
        """Return the distribution of values (m,) in equal intervals; NaN is an inverted cell."""
        right = values[np.isfinite(values)]
        low = edges[0]
        high = edges[-1]
        count = len(edges) - 1
        places = np.clip((right - low) * (count / (high - low)), 0, count - 1).astype(np.int64)
        return cls(np.bincount(places, minlength=count), edges, len(values) - len(right))


@record
class Bars:
    """A distribution drawn as bars: its label, and a color per bar (or a list of one for all)."""

    label: str
    distribution: Distribution
    colors: Sequence[Any] | None = None


@record
class Outline:
    """A distribution drawn as an outline, with its label and series number.

    ``series`` None is the undeformed mesh, drawn as a thin dotted line.
    """

    label: str
    distribution: Distribution
    series: int | None


def histogram(
    axes: Axes,
    runs: Sequence[QualityRun],
    edges: FloatArray | None = None,
    log: bool = False,
    style: Style = PRINT,
) -> None:
    """Draw the number of cells against their size-skew, an outline for each run.

    ``edges`` (k + 1,) float64, optional: limits of
    equal intervals; by default 25 intervals from 0 to 1. ``log``: whether the counts' axis is
    logarithmic, which shows a few bad cells among many.
    """
    edges = np.linspace(0.0, 1.0, 26) if edges is None else edges
    outlines = []
    for run in runs:
        values = run.values if run.inverted is None else np.where(run.inverted, np.nan, run.values)
        counts = Distribution.of(values, edges)
        # A legend outside the axes is common to several, with other numbers of inverted cells.
        counted = counts.inverted > 0 and style.legend
        label = f"{run.label} ({counts.inverted} inverted)" if counted else run.label
        outlines.append(Outline(label, counts, run.series))
    draw_distribution(axes, None, outlines, "size-skew quality [-]", log, style)


def draw_distribution(
    axes: Axes,
    bars: Bars | None,
    outlines: Sequence[Outline],
    metric: str,
    log: bool = False,
    style: Style = PRINT,
) -> None:
    """Draw the number of cells: one distribution as bars, if given, and others as outlines.

    ``outlines``: all have the same intervals as the bars. ``metric``: label of the values' axis.
    ``log``: whether the counts' axis is logarithmic, which shows a few bad cells among many.
    """
    style_axes(axes, style, metric, "cells [-]")
    foot = 0.5 if log else 0.0
    # The dotted line of the undeformed mesh alone is visible on bars of any color.
    paler = any(outline.series is not None for outline in outlines)
    if bars is not None:
        _fill(axes, bars, paler, foot, style)
    for outline in outlines:
        counts = outline.distribution.counts
        edges = outline.distribution.edges
        look = _look(outline, style)
        axes.stairs(counts, edges, baseline=None, label=outline.label, **look)
    every = [outline.distribution for outline in outlines]
    every += [bars.distribution] if bars is not None else []
    if not every:
        return
    low = every[0].edges[0]
    high = every[0].edges[-1]
    left = low
    if any(one.inverted for one in every):
        left = low - BAND * (high - low)
        _strip(axes, bars, outlines, (left, low), foot, style)
    axes.set_xlim(left, high)
    if high - left < max(0.1 * max(abs(left), abs(high)), 1e-3):
        axes.locator_params(axis="x", nbins=4)  # numbers at ticks are long
    _counts_axis(axes, bars, outlines, log)
    inset = (low - left) / (high - left)
    box = (inset, 0.0, 1.0 - inset, 1.0)
    add_legend(axes, style, **_entries(axes, bars, paler, style), loc="best", bbox_to_anchor=box)


def _look(outline: Outline, style: Style) -> dict[str, Any]:
    if outline.series is None:
        return {"color": style.scheme.ghost, "linestyle": (0, (1, 2.2)), "linewidth": 1.2}
    look = style.series(outline.series)
    return {"color": look.color, "linestyle": look.dash, "linewidth": style.width}


def _fill(axes: Axes, bars: Bars, paler: bool, foot: float, style: Style) -> None:
    """Draw bars from ``foot`` up, with an outline wider than the lines that may cover it.

    ``paler``: in colors mixed with the background.
    """
    one = bars.distribution
    axes.bar(
        one.edges[:-1],
        np.maximum(one.counts - foot, 0.0),
        np.diff(one.edges),
        bottom=foot,
        align="edge",
        color=_colors(bars, paler, style),
        linewidth=0,
        gid="shown",
    )
    width = 0.8 + style.width if paler else 0.6
    axes.stairs(
        one.counts,
        one.edges,
        baseline=None,
        color=style.scheme.text,
        linewidth=width,
        gid="outline",
    )


def _colors(bars: Bars, paler: bool, style: Style) -> list[tuple[float, ...]]:
    """Return the color (red, green, blue) of each bar."""
    chosen = bars.colors if bars.colors is not None else [style.series(0).color]
    rgbs = np.array([to_rgb(color) for color in chosen])
    if paler:
        rgbs += _PALER * (np.array(to_rgb(style.scheme.background)) - rgbs)
    count = len(bars.distribution.counts)
    return [tuple(rgb) for rgb in np.broadcast_to(rgbs, (count, 3))]


def _counts_axis(axes: Axes, bars: Bars | None, outlines: Sequence[Outline], log: bool) -> None:
    """Set scale and limits of the counts' axis; the undeformed mesh does not affect the limits."""
    if log:
        axes.set_yscale("log")
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(bottom=0.5)
        return
    # Cells of the undeformed mesh may all be alike: its count would dwarf the others.
    compared = [outline.distribution for outline in outlines if outline.series is not None]
    compared += [bars.distribution] if bars is not None else []
    highest = max((max(one.counts.max(), one.inverted) for one in compared), default=1)
    axes.set_ylim(0.0, 1.05 * max(highest, 1))


def _strip(
    axes: Axes,
    bars: Bars | None,
    outlines: Sequence[Outline],
    ends: tuple[float, float],
    foot: float,
    style: Style,
) -> None:
    """Draw the numbers of inverted cells in a strip of their own, left of all values.

    ``ends`` are the horizontal ends of the strip; counts begin at ``foot``.
    """
    left, low = ends
    axes.axvspan(left, low, color=style.alarm, alpha=0.13, linewidth=0)
    width = _STEMS * (low - left)
    if bars is not None and bars.distribution.inverted:
        height = bars.distribution.inverted - foot
        axes.bar(left, height, width, bottom=foot, align="edge", color=style.alarm)
    for index, outline in enumerate(outlines):
        number = outline.distribution.inverted
        if number:
            look = _look(outline, style)
            apart = width / (len(outlines) + 1)
            at = left + apart * (index + 1)
            axes.plot([at, at], [foot, number], **look)
            across = [at - 0.35 * apart, at + 0.35 * apart]
            axes.plot(across, [number, number], **(look | {"linestyle": "solid"}))
    axes.text(
        low - 0.5 * ((low - left) - width),
        0.97,
        "inverted",
        transform=axes.get_xaxis_transform(),
        rotation="vertical",
        ha="center",
        va="top",
        fontsize=style.size,
        color=style.alarm,
    )


def _entries(axes: Axes, bars: Bars | None, paler: bool, style: Style) -> dict[str, Any]:
    """Return the legend's arguments for its entries: the bars first, then the outlines."""
    handles, labels = axes.get_legend_handles_labels()
    if bars is None:
        return {"handles": handles, "labels": labels}
    key = Patch(edgecolor=style.scheme.text)
    colors = _colors(bars, paler, style)
    there = np.flatnonzero(bars.distribution.counts)
    first, last = (there[0], there[-1]) if len(there) else (0, len(colors) - 1)
    some = [colors[at] for at in np.linspace(first, last, _SWATCH).astype(int)]
    return {
        "handles": [key, *handles],
        "labels": [bars.label, *labels],
        "handler_map": {key: _swatch(some, style.scheme.text)},
    }


def _swatch(colors: Sequence[Any], edge: str) -> Any:
    """Return a legend handler that draws a box with several colors side by side."""

    class Swatch(HandlerBase):
        def create_artists(
            self, _legend: Any, _handle: Any, x: float, y: float, *rest: Any
        ) -> list[Any]:
            width, height, _, transform = rest
            part = width / len(colors)
            boxes = [
                Rectangle((part * i - x, -y), part, height, facecolor=color, linewidth=0)
                for i, color in enumerate(colors)
            ]
            boxes.append(Rectangle((-x, -y), width, height, fill=False, edgecolor=edge))
            for box in boxes:
                box.set_transform(transform)
            return boxes

    return Swatch()
