"""Plots of runs, drawn onto axes that are given: no window, no global state.

Each function draws onto empty matplotlib ``Axes``. Series differ by color, line and marker, so
that they can be told apart in grey and by color-blind people. Qualities are size-skew, without
a unit, 0 to 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.ticker import NullLocator

from slideviz.argument_types import frozen, record
from slideviz.mesh.model import FloatArray, IntArray, run_begins
from slideviz.plots.style import PRINT, Style, add_dots, add_legend, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@record
class StepRun:
    """Quality after each step of a run."""

    label: str
    steps: IntArray  # (k,): numbers of the steps; 0 is the undeformed mesh
    minimum: FloatArray  # (k,)
    mean: FloatArray  # (k,)
    series: int = 0  # series number (see `slideviz.plots.style.Style.series`)


@record
class GreedyRun:
    """The convergence of a greedy selection, cycle by cycle."""

    label: str
    control_nodes: IntArray  # (c,)
    error: FloatArray
    """(c,): largest error of the boundary after each cycle, in the mesh's length unit."""
    level: IntArray  # (c,): number of the level of each cycle
    tolerance: float | None = None
    series: int = 0  # series number (see `slideviz.plots.style.Style.series`)


@frozen
class Outcome:
    """The outcome of one run."""

    label: str  # the combination of methods; runs of one label are joined by a line
    steps: int
    minimum: float
    mean: float
    inverted: int = 0  # inverted cells
    seconds: float = float("nan")  # processor time of the deformation
    series: int = 0  # series number of its label


What = Literal["minimum", "mean", "seconds"]

LABELS: dict[What, str] = {
    "minimum": "minimum quality [-]",
    "mean": "mean quality [-]",
    "seconds": "processor time [s]",
}
_LABEL_GAP = 0.1  # least distance of two labels of numbers of steps, relative to the axis
_CROWDED = 300  # number of cycles of a greedy selection above which its line is thin


def quality_by_step(axes: Axes, runs: Sequence[StepRun], style: Style = PRINT) -> None:
    """Draw minimum (filled markers) and mean quality (hollow ones) against the step."""
    style_axes(axes, style, "step [-]", "quality [-]")
    for index, run in enumerate(runs):
        look = style.line(run.series)
        # Some markers are enough for many steps; those of each run are at other steps.
        every = max(1, len(run.steps) // 6)
        last = len(run.steps) - 1
        look["markevery"] = sorted({*range(index % every, last, every), last})
        hollow = {**look, "markerfacecolor": style.scheme.background}
        axes.plot(run.steps, run.minimum, label=run.label, gid=f"minimum:{run.label}", **look)
        axes.plot(run.steps, run.mean, gid=f"mean:{run.label}", **hollow)
    add_dots(axes, style)
    _quality_limits(axes, [v for run in runs for v in (*run.minimum, *run.mean)])
    axes.locator_params(axis="x", integer=True)
    add_legend(axes, style)


def convergence(axes: Axes, runs: Sequence[GreedyRun], style: Style = PRINT) -> None:
    """Draw the error of greedy selections against control nodes, on a logarithmic axis.

    Each tolerance is a thin line; markers show where levels begin (about ten if there are many).
    """
    style_axes(axes, style, "control nodes [-]", "largest error [mesh units]")
    axes.set_yscale("log")
    tolerances: set[float] = set()
    for run in runs:
        shown = run.error > 0
        first = run_begins(run.level)
        line = style.line(run.series)
        begins = np.flatnonzero(first[shown])
        line["markevery"] = begins[:: max(1, len(begins) // 10)].tolist()
        line["markersize"] = 3.5
        if len(run.error) > _CROWDED:
            line["linewidth"] = 0.5 * style.width
        axes.plot(run.control_nodes[shown], run.error[shown], label=run.label, **line)
        if run.tolerance and run.tolerance not in tolerances:
            tolerances.add(run.tolerance)
            axes.axhline(
                run.tolerance, color=style.scheme.text, linewidth=0.9, linestyle=(0, (4, 3))
            )
            axes.annotate(
                f"tolerance {run.tolerance:g}",
                (0.0, run.tolerance),
                xycoords=axes.get_yaxis_transform(),
                xytext=(3, -2),
                textcoords="offset points",
                ha="left",
                va="top",
                **style.letters,
            )
    axes.set_xlim(left=0)
    if tolerances:  # room for the words below the lowest line
        axes.set_ylim(bottom=min(axes.get_ylim()[0], 0.3 * min(tolerances)))
    add_legend(axes, style)


def against_steps(
    axes: Axes, rows: Sequence[Outcome], what: What = "minimum", style: Style = PRINT
) -> None:
    """Draw results of runs against their number of steps, a line for each label.

    ``rows``: in any order. Qualities of runs with inverted cells are crosses, not joined by the
    line.
    """
    style_axes(axes, style, "deformation steps [-]", LABELS[what])
    for label in dict.fromkeys(row.label for row in rows):
        mine = sorted((row for row in rows if row.label == label), key=lambda row: row.steps)
        steps = np.array([row.steps for row in mine])
        values = np.array([float(getattr(row, what)) for row in mine])
        bad = np.array([row.inverted > 0 for row in mine]) & (what in ("minimum", "mean"))
        line = style.line(mine[0].series)
        axes.plot(steps, np.where(bad, np.nan, values), label=label, **line)
        if bad.any():  # an empty line that is not clipped would spoil the layout
            cross = {"color": line["color"], "linestyle": "", "marker": "x", "markersize": 6}
            axes.plot(steps[bad], values[bad], clip_on=False, gid=f"inverted:{label}", **cross)
    every = [float(getattr(row, what)) for row in rows]
    if what in ("minimum", "mean"):
        _quality_limits(axes, every)
    elif _ratio(every) > 30:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
    _step_ticks(axes, sorted({row.steps for row in rows}))
    add_legend(axes, style)


def _ratio(values: Sequence[float]) -> float:
    """Return the ratio of the largest to the smallest positive value; 1 if there is none."""
    good = [value for value in values if np.isfinite(value) and value > 0]
    return max(good) / min(good) if good else 1.0


def _quality_limits(axes: Axes, values: Sequence[float]) -> None:
    """Set the vertical limits: from 0 to about 1, or to less if all values are below 0.75."""
    good = [value for value in values if np.isfinite(value)]
    top = max(good, default=1.0)
    axes.set_ylim(0.0, 1.02 if top > 0.75 else max(1.12 * top, 0.1))


def _step_ticks(axes: Axes, steps: Sequence[int]) -> None:
    """Set ticks at the numbers of steps; from a ratio of 8 on, the axis is logarithmic."""
    places = np.array(steps, np.float64)
    if steps and steps[-1] >= 8 * steps[0] > 0:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        places = np.log(places)
    shown = [steps[k] for k in _spaced_indices(places)]
    axes.set_xticks(shown, [str(step) for step in shown])
    if len(steps) == 1:
        axes.set_xlim(steps[0] - 1, steps[0] + 1)


def _spaced_indices(places: np.ndarray) -> list[int]:
    """Return indices of ascending numbers (n,) to label: the ends, and those with enough room."""
    last = len(places) - 1
    if last < 1:
        return list(range(last + 1))
    least = _LABEL_GAP * (places[last] - places[0])
    chosen = [0]
    for k in range(1, last):
        if min(places[k] - places[chosen[-1]], places[last] - places[k]) >= least:
            chosen.append(k)
    return [*chosen, last]
