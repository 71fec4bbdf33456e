"""Plots of runs, drawn onto axes that are given: no window, no global state.

Each function draws onto empty matplotlib ``Axes``. Series differ by colour, line and marker, so
that they can be told apart in grey and by colour-blind people. Qualities are size-skew, without
a unit, 0 to 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.view.plots_style import ON_DARK, ON_LIGHT, PRINT, Style, add_legend, dress, place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = [
    "ON_DARK",
    "ON_LIGHT",
    "PRINT",
    "GreedyRun",
    "Outcome",
    "QualityRun",
    "StepRun",
    "Style",
    "against_steps",
    "convergence",
    "histogram",
    "quality_by_step",
]

What = Literal["minimum", "mean", "seconds", "control_nodes", "max_error"]

LABELS: dict[What, str] = {
    "minimum": "minimum quality [-]",
    "mean": "mean quality [-]",
    "seconds": "processor time [s]",
    "control_nodes": "control nodes [-]",
    "max_error": "largest error [mesh unit]",
}
_BAND, _STEMS = 0.13, 0.07
"""Width of the strip left of 0 where inverted cells are counted, and of the part for counts."""

_CROWDED = 300
"""Selections of more cycles than this get a thin line."""


@dataclass(frozen=True, eq=False)
class QualityRun:
    """Qualities of the cells of one mesh.

    Attributes
    ----------
    label : str
    values : (m,) float64
        0 to 1.
    inverted : (m,) bool, optional
        Cells to count apart instead of at 0.
    series : int, optional
        Number of its look; its place in the sequence when left out.
    """

    label: str
    values: FloatArray
    inverted: NDArray[np.bool_] | None = None
    series: int | None = None


@dataclass(frozen=True, eq=False)
class StepRun:
    """Quality after each step of a run.

    Attributes
    ----------
    label : str
    steps : (k,) int64
        Numbers of the steps; 0 is the undeformed mesh.
    minimum, mean : (k,) float64
    series : int, optional
        Number of its look; its place in the sequence when left out.
    """

    label: str
    steps: IntArray
    minimum: FloatArray
    mean: FloatArray
    series: int | None = None


@dataclass(frozen=True, eq=False)
class GreedyRun:
    """Convergence of a greedy selection.

    Attributes
    ----------
    label : str
    control_nodes : (c,) int64
    error : (c,) float64
        Largest error of the boundary after each cycle, in the mesh's length unit.
    level : (c,) int64
        Number of the level of each cycle.
    tolerance : float or None
    series : int, optional
        Number of its look; its place in the sequence when left out.
    """

    label: str
    control_nodes: IntArray
    error: FloatArray
    level: IntArray
    tolerance: float | None = None
    series: int | None = None


@dataclass(frozen=True)
class Outcome:
    """What one run came to.

    Attributes
    ----------
    label : str
        The combination of methods; runs of one label are joined by a line.
    steps : int
    minimum, mean : float
    inverted : int
        Inverted cells.
    seconds : float
        Processor time of the deformation.
    control_nodes : int
    max_error : float
        In the mesh's length unit.
    series : int, optional
        Number of the look of its label; the place of the label among all when left out.
    """

    label: str
    steps: int
    minimum: float
    mean: float
    inverted: int = 0
    seconds: float = float("nan")
    control_nodes: int = 0
    max_error: float = float("nan")
    series: int | None = None


def histogram(
    axes: Axes,
    runs: Sequence[QualityRun],
    metric: str = "size-skew",
    bins: int = 50,
    log: bool = False,
    style: Style = PRINT,
) -> None:
    """Draw outlines of how many cells have which quality; inverted cells are left of 0.

    Parameters
    ----------
    axes : Axes
    runs : sequence of QualityRun
    metric : str
        Name of the value, for the axis.
    bins : int
        Equal intervals of 0 to 1.
    log : bool
        Whether the count is on a logarithmic axis, which shows a few bad cells among many.
    style : Style
    """
    dress(axes, style, f"{metric} quality [-]", "cells [-]")
    folded = [_inverted(run) for run in runs]
    for index, (run, bad) in enumerate(zip(runs, folded, strict=True)):
        look = style.series(place(run.series, index))
        counts, edges = np.histogram(run.values[~bad], bins, range=(0.0, 1.0))
        number = int(bad.sum())
        # A legend elsewhere serves several axes, with other numbers of inverted cells.
        told = number > 0 and style.legend
        label = f"{run.label} ({number} inverted)" if told else run.label
        axes.stairs(
            counts,
            edges,
            color=look.colour,
            linestyle=look.dash,
            linewidth=style.width,
            label=label,
            baseline=None if len(runs) > 1 else 0,
            fill=False,
        )
        if number:
            at = -_STEMS * (index + 1) / (len(runs) + 1)
            axes.plot(
                [at, at],
                [0.5 if log else 0.0, number],
                color=look.colour,
                linestyle=look.dash,
                linewidth=style.width,
                marker=look.marker,
                markevery=[1],
                markersize=4,
            )
    if log:
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5)
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, 1.0)
    left = 0.0
    if any(bad.any() for bad in folded):
        _inverted_band(axes, style)
        left = _BAND / (1.0 + _BAND)
    add_legend(axes, style, loc="best", bbox_to_anchor=(left, 0.0, 1.0 - left, 1.0))


def _inverted(run: QualityRun) -> NDArray[np.bool_]:
    if run.inverted is None:
        return np.zeros(len(run.values), bool)
    return np.asarray(run.inverted, bool)


def _inverted_band(axes: Axes, style: Style) -> None:
    """Mark the strip left of 0 where inverted cells are counted."""
    axes.set_xlim(-_BAND, 1.0)
    axes.axvspan(-_BAND, 0.0, color=style.alarm, alpha=0.13, linewidth=0)
    axes.text(
        -(_BAND + _STEMS) / 2,
        0.97,
        "inverted",
        transform=axes.get_xaxis_transform(),
        rotation="vertical",
        ha="center",
        va="top",
        fontsize=style.size,
        color=style.alarm,
    )
    axes.set_xticks(np.linspace(0.0, 1.0, 6))


def quality_by_step(axes: Axes, runs: Sequence[StepRun], style: Style = PRINT) -> None:
    """Draw minimum (filled markers) and mean quality (hollow ones) against the step."""
    dress(axes, style, "step [-]", "quality [-]")
    for index, run in enumerate(runs):
        look = _line(style, place(run.series, index))
        # Of many steps some markers do, those of each run at other steps.
        every = max(1, len(run.steps) // 6)
        look["markevery"] = (index % every, every)
        hollow = {**look, "markerfacecolor": style.look.background}
        axes.plot(run.steps, run.minimum, label=run.label, gid=f"minimum:{run.label}", **look)
        axes.plot(run.steps, run.mean, gid=f"mean:{run.label}", **hollow)
    for what, face in (("minimum", style.look.text), ("mean", style.look.background)):
        dot: dict[str, Any] = {
            "marker": "o",
            "markersize": 5,
            "linestyle": "",
            "color": style.look.text,
        }
        axes.plot([], [], label=what, markerfacecolor=face, **dot)
    _quality_limits(axes, [v for run in runs for v in (*run.minimum, *run.mean)])
    _whole_ticks(axes)
    add_legend(axes, style)


def convergence(
    axes: Axes, runs: Sequence[GreedyRun], unit: str = "mesh unit", style: Style = PRINT
) -> None:
    """Draw the error of greedy selections against control nodes, on a logarithmic axis.

    Each tolerance is a thin line; markers show where levels begin, about ten of many.
    """
    dress(axes, style, "control nodes [-]", f"largest error [{unit}]")
    axes.set_yscale("log")
    told: set[float] = set()
    for index, run in enumerate(runs):
        shown = run.error > 0
        first = np.r_[True, run.level[1:] != run.level[:-1]] if len(run.level) else run.level > 0
        line = _line(style, place(run.series, index))
        begins = np.flatnonzero(first[shown])
        line["markevery"] = begins[:: max(1, len(begins) // 10)].tolist()
        line["markersize"] = 3.5
        if len(run.error) > _CROWDED:
            line["linewidth"] = 0.5 * style.width
        axes.plot(run.control_nodes[shown], run.error[shown], label=run.label, **line)
        if run.tolerance and run.tolerance not in told:
            told.add(run.tolerance)
            axes.axhline(run.tolerance, color=style.look.text, linewidth=0.9, linestyle=(0, (4, 3)))
            axes.annotate(
                f"tolerance {run.tolerance:g}",
                (0.0, run.tolerance),
                xycoords=axes.get_yaxis_transform(),
                xytext=(3, -2),
                textcoords="offset points",
                ha="left",
                va="top",
                fontsize=style.size,
                color=style.look.text,
            )
    axes.set_xlim(left=0)
    if told:  # room for the words below the lowest line
        axes.set_ylim(bottom=min(axes.get_ylim()[0], 0.3 * min(told)))
    add_legend(axes, style)


def against_steps(
    axes: Axes,
    rows: Sequence[Outcome],
    what: What = "minimum",
    style: Style = PRINT,
) -> None:
    """Draw what runs came to against their number of steps, a line for each label.

    Parameters
    ----------
    axes : Axes
    rows : sequence of Outcome
        In any order. Runs with inverted cells are crosses that no line joins.
    what : {"minimum", "mean", "seconds", "control_nodes", "max_error"}
    style : Style
    """
    dress(axes, style, "deformation steps [-]", LABELS[what])
    labels = list(dict.fromkeys(row.label for row in rows))
    for index, label in enumerate(labels):
        mine = sorted((row for row in rows if row.label == label), key=lambda row: row.steps)
        steps = np.array([row.steps for row in mine])
        values = np.array([float(getattr(row, what)) for row in mine])
        bad = np.array([row.inverted > 0 for row in mine]) & (what in ("minimum", "mean"))
        line = _line(style, place(mine[0].series, index))
        axes.plot(steps, np.where(bad, np.nan, values), label=label, **line)
        if bad.any():  # an empty line that is not clipped would spoil the layout
            cross = {"color": line["color"], "linestyle": "", "marker": "x", "markersize": 6}
            axes.plot(steps[bad], values[bad], clip_on=False, gid=f"inverted:{label}", **cross)
    every = [float(getattr(row, what)) for row in rows]
    if what in ("minimum", "mean"):
        _quality_limits(axes, every)
    elif _ratio(every) > 30 or what == "max_error":
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
    _step_ticks(axes, sorted({row.steps for row in rows}))
    add_legend(axes, style)


def _line(style: Style, index: int) -> dict[str, Any]:
    """Return the arguments of ``Axes.plot`` of a series."""
    look = style.series(index)
    return {
        "color": look.colour,
        "linestyle": look.dash,
        "linewidth": style.width,
        "marker": look.marker,
        "markersize": 4.5,
        "markerfacecolor": look.colour,
        "markeredgewidth": 1.0,
    }


def _ratio(values: Sequence[float]) -> float:
    """Return how many times the smallest positive value the largest one is."""
    good = [value for value in values if np.isfinite(value) and value > 0]
    return max(good) / min(good) if good else 1.0


def _quality_limits(axes: Axes, values: Sequence[float]) -> None:
    """Show 0 to 1, or less where the values leave much of it empty, but always from 0."""
    good = [value for value in values if np.isfinite(value)]
    top = max(good, default=1.0)
    axes.set_ylim(0.0, 1.02 if top > 0.75 else max(1.12 * top, 0.1))


def _whole_ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _step_ticks(axes: Axes, steps: Sequence[int]) -> None:
    """Put ticks at the numbers of steps; on a logarithmic axis where they span a decade."""
    from matplotlib.ticker import NullLocator

    if steps and steps[-1] >= 8 * steps[0] > 0:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticks(steps, [str(step) for step in steps])
    if len(steps) == 1:
        axes.set_xlim(steps[0] - 1, steps[0] + 1)
