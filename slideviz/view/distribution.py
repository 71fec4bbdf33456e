"""How many cells have which value: counted for a frame, drawn as bars and outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.view.actors import shown_values
from slideviz.view.plots_style import PRINT, Style, add_legend, dress
from slideviz.view.state import ColourBy, Frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BINS = 50
BAND = 0.1
"""Width of the strip left of the values where inverted cells are counted, as part of the range."""


@dataclass(frozen=True, eq=False)
class Distribution:
    """Counts of the cells of one frame.

    Attributes
    ----------
    counts : (k,) int64
    edges : (k + 1,) float64
        Of the intervals; what is outside is in the first or the last.
    inverted : int
        Cells that are inverted and in no interval.
    """

    counts: IntArray
    edges: FloatArray
    inverted: int


@dataclass(frozen=True, eq=False)
class Outline:
    """A distribution to compare with: its words, and the number of its look.

    ``series`` None is the undeformed mesh, in a thin line of its own.
    """

    label: str
    distribution: Distribution
    series: int | None


def distribution(
    frame: Frame,
    what: ColourBy,
    limits: tuple[float, float] = (0.0, 1.0),
    undeformed: Mesh | None = None,
) -> Distribution:
    """Return the counts of the cells of a frame in `BINS` equal intervals between limits."""
    low, high = limits
    values = shown_values(frame, what, undeformed)
    right = values[np.isfinite(values)]
    scale = BINS / (high - low)
    places = np.clip((right - low) * scale, 0, BINS - 1).astype(np.int64)
    counts = np.bincount(places, minlength=BINS)
    return Distribution(counts, np.linspace(low, high, BINS + 1), len(values) - len(right))


def spread(
    frame: Frame, what: ColourBy, undeformed: Mesh | None = None
) -> tuple[float, float] | None:
    """Return the lowest and the highest value of the cells of a frame; None if all are inverted."""
    values = shown_values(frame, what, undeformed)
    right = values[np.isfinite(values)]
    return (float(right.min()), float(right.max())) if len(right) else None


def draw_distribution(
    axes: Axes,
    shown: Distribution,
    outlines: Sequence[Outline],
    words: tuple[str, str],
    colours: Sequence[str] | None = None,
    log: bool = False,
    style: Style = PRINT,
) -> None:
    """Draw the counts of the frame that is shown as bars, and others as outlines over them.

    Parameters
    ----------
    axes : Axes
    shown : Distribution
    outlines : sequence of Outline
    words : (str, str)
        What the bars are, for the legend, and the label of the values.
    colours : sequence of str, optional
        Of the bars, one for each.
    log : bool
        Whether counts are on a logarithmic axis, which shows a few bad cells among many.
    style : Style
    """
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import NullLocator

    label, metric = words
    dress(axes, style, metric, "cells [-]")
    low, width = shown.edges[0], shown.edges[-1] - shown.edges[0]
    foot = 0.5 if log else 0.0
    face = colours if colours is not None else style.series(0).colour
    axes.bar(
        shown.edges[:-1],
        np.maximum(shown.counts - foot, 0.0),
        np.diff(shown.edges),
        bottom=foot,
        align="edge",
        color=face,
        linewidth=0,
        gid="shown",
    )
    # The colour of one bar would say that all are its value.
    key = face if isinstance(face, str) else "none"
    edge = face if isinstance(face, str) else style.look.text
    axes.plot([], [], "s", markerfacecolor=key, markeredgecolor=edge, markersize=6, label=label)
    axes.stairs(shown.counts, shown.edges, color=style.look.text, linewidth=0.6)
    for other in outlines:
        thin = other.series is None
        look = style.series(other.series or 0)
        seam = (0.9 if thin else style.width) + 1.4
        axes.stairs(
            other.distribution.counts,
            other.distribution.edges,
            color=style.look.ghost if thin else look.colour,
            linestyle="solid" if thin else look.dash,
            linewidth=0.9 if thin else style.width,
            label=other.label,
            # A seam, for bars can have any colour, that of the line too.
            path_effects=[withStroke(linewidth=seam, foreground=style.look.background)],
        )
    left = low
    if shown.inverted or any(other.distribution.inverted for other in outlines):
        left = low - BAND * width
        _strip(axes, shown, outlines, left, style)
    axes.set_xlim(left, low + width)
    if log:
        axes.set_yscale("log")
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(bottom=foot)
    else:
        axes.set_ylim(bottom=0.0)
    inset = (low - left) / (low + width - left)
    add_legend(
        axes,
        style,
        **_in_order(axes),
        loc="best",
        bbox_to_anchor=(inset, 0.0, 1.0 - inset, 1.0),
    )


def _in_order(axes: Axes) -> dict[str, list[Any]]:
    """Return handles and labels of a legend: the undeformed mesh, then runs by their numbers."""
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(
        range(len(labels)),
        key=lambda i: (labels[i] != "undeformed", len(labels[i]), labels[i]),
    )
    return {"handles": [handles[i] for i in order], "labels": [labels[i] for i in order]}


def _strip(
    axes: Axes, shown: Distribution, outlines: Sequence[Outline], left: float, style: Style
) -> None:
    """Count inverted cells in a strip of their own, left of all values."""
    low = shown.edges[0]
    axes.axvspan(left, low, color=style.alarm, alpha=0.13, linewidth=0)
    if shown.inverted:
        axes.bar(left, shown.inverted, 0.6 * (low - left), align="edge", color=style.alarm)
    for other in outlines:
        if other.distribution.inverted:
            thin = other.series is None
            colour = style.look.ghost if thin else style.series(other.series or 0).colour
            axes.hlines(other.distribution.inverted, left, low, colors=colour, linewidth=1.2)
    axes.text(
        low - 0.2 * (low - left),
        0.97,
        "inverted",
        transform=axes.get_xaxis_transform(),
        rotation="vertical",
        ha="center",
        va="top",
        fontsize=style.size,
        color=style.alarm,
    )
