"""The histogram of a session: of the shown step, and of other runs to compare."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.motion_words import deformation
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.plots.curves import series_of
from slideviz.plots.histogram import draw_distribution
from slideviz.plots.series import Bars, Distribution, Outline
from slideviz.plots.style import Style
from slideviz.plots.ticks import rounded_out
from slideviz.session.state import Run, Session, StepFrame
from slideviz.session.whole import FINE, PartQuality
from slideviz.terms import QUANTITIES, ColorBy, Quantity, quantity_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LEAST_SPREAD = 0.05
"""Least range of qualities that the axis shows."""

MOST = 4
"""Most runs that are compared with the shown one, so that lines can be told apart."""

Range = tuple[float, float]


class FrameCounts:
    """A cache of the frames' distributions, kept as long as their frames exist."""

    def __init__(self) -> None:
        self._kept: WeakKeyDictionary[StepFrame, dict[object, Distribution]] = WeakKeyDictionary()
        self._spreads: WeakKeyDictionary[StepFrame, dict[ColorBy, Range | None]] = (
            WeakKeyDictionary()
        )

    def limits(self, session: Session, whole: bool) -> Range:
        """Return the limits of the axis: round numbers around the cells' values.

        They are the same for all steps of the shown run, so that bars can be compared during play.
        ``whole``: all values that are possible (of the displacement, from 0).
        """
        what = shown_measure(session)
        shown = [*session.frames, *(run.last for run in session.runs if run.last is not None)]
        for frame in shown:
            kept = self._spreads.setdefault(frame, {})
            if what not in kept:
                kept[what] = spread(frame, what, session.mesh)
        found = [ends for frame in shown if (ends := self._spreads[frame][what]) is not None]
        low, high = min((e[0] for e in found), default=0.0), max((e[1] for e in found), default=1.0)
        if what != "displacement":
            # A smaller range would enlarge meaningless differences.
            return (0.0, 1.0) if whole else rounded_out(min(low, high - LEAST_SPREAD), high)
        return rounded_out(0.0 if whole else low, high)

    def of(self, session: Session, frame: StepFrame, limits: Range) -> Distribution:
        """Return the distribution of a frame's values between limits."""
        what = shown_measure(session)
        kept = self._kept.setdefault(frame, {})
        if (what, limits) not in kept:
            kept[what, limits] = distribution(frame, what, limits, session.mesh)
        return kept[what, limits]


def draw_histogram(
    counts: FrameCounts, session: Session, figure: Figure, style: Style, *, log: bool, whole: bool
) -> None:
    """Draw the histogram of a session into a figure; nothing without a mesh.

    Parameters
    ----------
    counts : FrameCounts
    session : Session
    figure : Figure
    style : Style
    log : bool
        Whether the axis of the counts is logarithmic.
    whole : bool
        Whether the other axis shows all possible values, not only those of the cells.
    """
    if session.frame is None:
        return
    what = shown_measure(session)
    limits = counts.limits(session, whole)
    shown, run = counts.of(session, session.frame, limits), session.run_shown
    label = "undeformed" if session.view.frame == 0 or run is None else run.label
    term = QUANTITIES[what]
    metric = term.axis if term.unit else f"{term.label} quality [-]"
    runs, left_out = compared(session)
    outlines = [
        Outline(other.label, counts.of(session, other.last, limits), series_of(other))
        for other in runs
        if other.last is not None
    ]
    # The undeformed mesh has no displacement.
    if session.first is not None and session.view.frame > 0 and what != "displacement":
        outlines.append(Outline("undeformed", counts.of(session, session.first, limits), None))
    axes = figure.add_subplot()
    bars = Bars(label, shown, _colors(session, shown))
    draw_distribution(axes, bars, outlines, metric, log, style)
    legend = axes.get_legend()
    if left_out and legend is not None:
        legend.set_title(f"without {left_out} other run{'s' if left_out > 1 else ''}")
        legend.get_title().set_fontsize(style.size)
        legend.get_title().set_color(style.scheme.text)


def compared(session: Session) -> tuple[list[Run], int]:
    """Return at most `MOST` runs to compare with the shown one, and the number of those left out.

    Preferred are the run shown beside it, then those with the same motion, then newer ones. The
    result is in the order of their numbers.
    """
    shown = session.run_shown
    others = [run for run in session.runs if run.last is not None and run is not shown]

    def rank(run: Run) -> tuple[bool, bool, int]:
        alike = shown is not None and deformation(run.case) == deformation(shown.case)
        return run.number != session.view.beside, not alike, -run.number

    first = sorted(others, key=rank)[:MOST]
    return sorted(first, key=lambda run: run.number), len(others) - len(first)


def first_value(axes: Axes) -> float:
    """Return the lowest value of a drawn histogram: where its bars begin."""
    bars = [patch for patch in axes.patches if patch.get_gid() == "shown"]
    return min(float(bar.get_x()) for bar in bars)  # type: ignore[attr-defined]


def shown_measure(session: Session) -> Quantity:
    """Return the quantity of the histogram: that of the view's colors.

    For a mesh that stays in its file it is size-skew, the only one known of all cells.
    """
    return quantity_of("size-skew" if session.in_file else session.view.color_by)


def _colors(session: Session, shown: Distribution) -> list[tuple[float, ...]]:
    """Return the color of each bar: that of its middle value in the view."""
    import matplotlib as mpl

    low, high = session.color_range
    middle = (shown.edges[1:] + shown.edges[:-1]) / 2.0
    part = np.clip((middle - low) / max(high - low, 1e-300), 0.0, 1.0)
    return [tuple(rgba) for rgba in mpl.colormaps[session.view.color_map](part)]


_MIDDLES = (np.arange(FINE) + 0.5) / FINE
"""Middles of the fine intervals (`FINE`) of a totals of qualities."""

BINS = 25
"""Number of intervals: few enough that an outline's steps show its dashes in a narrow panel."""


def distribution(
    frame: StepFrame,
    what: ColorBy,
    limits: tuple[float, float] = (0.0, 1.0),
    undeformed: Mesh | None = None,
) -> Distribution:
    """Return the distribution of a frame's values ``what`` in `BINS` equal intervals of limits.

    ``undeformed`` is needed for displacements.
    """
    edges = np.linspace(*limits, BINS + 1)
    if isinstance(frame.quality, PartQuality):
        totals = frame.quality.all
        places = np.clip(np.searchsorted(edges, _MIDDLES, "right") - 1, 0, BINS - 1)
        counts = np.bincount(places, totals.counts, BINS).astype(np.int64)
        return Distribution(counts, edges, totals.inverted)
    return Distribution.of(_values(frame, what, undeformed), edges)


def spread(
    frame: StepFrame, what: ColorBy, undeformed: Mesh | None = None
) -> tuple[float, float] | None:
    """Return the lowest and the highest value of the cells of a frame; None if all are inverted."""
    if isinstance(frame.quality, PartQuality):
        there = _MIDDLES[np.flatnonzero(frame.quality.all.counts)]
        return (float(there[0]), float(there[-1])) if len(there) else None
    values = _values(frame, what, undeformed)
    right = values[np.isfinite(values)]
    return (float(right.min()), float(right.max())) if len(right) else None


def _values(frame: StepFrame, what: ColorBy, undeformed: Mesh | None) -> FloatArray:
    """Return the values of a frame's counted cells (those of a halo are not); NaN if inverted."""
    return np.asarray(frame.shown_values(what, undeformed)[frame.quality.counted])
