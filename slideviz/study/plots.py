"""Figures of a comparison: against steps, step by step, histogram, span, convergence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.spans import periodic_pairs
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.model import BoolArray, FloatArray, Mesh
from slideviz.mesh.quality import INVERTED
from slideviz.plots.draw import (
    GreedyRun,
    Outcome,
    StepRun,
    What,
    against_steps,
    convergence,
    quality_by_step,
)
from slideviz.plots.figure_io import empty_figure, write_figure
from slideviz.plots.histogram import QualityRun, histogram
from slideviz.plots.spanwise import Profile, along, spanwise
from slideviz.plots.style import PRINT
from slideviz.plots.ticks import rounded_out
from slideviz.study.combinations import COMPARED_METHODS, MODES, CombinationRow, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Span = Literal["r", "x", "y", "z"]


@record
class FacetLine:
    """A line in a facet: its name, its number ``series`` (which sets its look), and its result."""

    label: str
    series: int
    result: Result


@record
class Facet:
    """Lines that are drawn in one plot; ``title`` is empty where there is one facet only."""

    title: str
    lines: tuple[FacetLine, ...]


def facets(rows: Sequence[CombinationRow]) -> tuple[Facet, ...]:
    """Return facets of the rows that have a result; lines of one name look alike in all facets."""
    asked = [list(dict.fromkeys(_titles(row)[axis] for row in rows)) for axis in (0, 1)]
    done = [(_titles(row), row.result) for row in rows if row.result is not None]
    methods = len({titles[0] for titles, _ in done})
    modes = len({titles[1] for titles, _ in done})
    # 0: each method is a line, each mode a facet; 1: the other way round.
    lined = 0 if modes == 1 or modes < methods else 1
    other = 1 - lined
    lines_of: dict[str, list[FacetLine]] = {title: [] for title in asked[other]}
    for titles, result in done:
        line = FacetLine(titles[lined], asked[lined].index(titles[lined]), result)
        lines_of[titles[other]].append(line)
    several = len(lines_of) > 1
    made = [Facet(title if several else "", tuple(lines)) for title, lines in lines_of.items()]
    return tuple(facet for facet in made if facet.lines)


def _titles(row: CombinationRow) -> tuple[str, str]:
    return COMPARED_METHODS[row.combination.method][0], MODES[row.combination.periodic]


Profiler = Callable[[FacetLine], Profile]  # returns the profile of a line's quality along the span


def profiler(case: Case, mesh: Mesh, span: Span | None = None) -> Profiler | None:
    """Return the function that makes profiles along the span; None without a span.

    ``mesh``: the undeformed mesh. Cells are assigned to places along the span by it, so that a
    layer of cells stays together when it bends.
    ``span``: when left out: the radius of a 3D mesh that repeats by rotation, z of another 3D mesh,
    no span for a 2D mesh.
    """
    axis = case.axis
    origin = case.origin
    turns = False
    if span in (None, "r"):
        with suppress(MeshError, CaseError):  # the rows say it
            for first in periodic_pairs(case, mesh)[:1]:
                turns = first.kind == "rotational"
                axis, origin = (first.axis, first.origin) if turns else (axis, origin)
    if span is None and mesh.dim == 2:
        return None
    where = span or ("r" if turns else "z")

    def profile(line: FacetLine) -> Profile:
        values = line.result.quality.values
        made = along(mesh, values, where, axis, origin, label=line.label)
        return replace(made, series=line.series)

    return profile


WIDTH = 7.0
"""Width of figures, in inches: that of a page's text, so that letters are at least 8 points."""

_BINS = 25  # number of intervals of a histogram, each wide enough to show the dashes of its lines
_WIDE = 8.0  # ratio of the largest to the smallest time from which their axis is logarithmic
_LAST = ("minimum", "mean")  # names that come last in the legend: of markers, not of lines
_QUIET = replace(PRINT, legend=False)


def figures(rows: Sequence[CombinationRow], span: Profiler | None) -> Iterator[tuple[str, Figure]]:
    """Yield the names and figures of a comparison.

    ``rows``: rows without a result are left out.
    ``span``: returns the profile of a row along the span, as `slideviz.study.plots.profiler` makes
    it; None: no figures along the span.
    """
    numbers = list(dict.fromkeys(row.combination.steps for row in rows))
    if len({row.result.steps for row in rows if row.result}) > 1:
        yield "steps", _grid(facets(rows), (_against("minimum"), _against("mean"), _SECONDS))
    for number in numbers:
        group = facets([row for row in rows if row.combination.steps == number])
        lines = [line for facet in group for line in facet.lines]
        if not lines:
            continue
        name = steps_name(number)
        yield f"histogram_{name}", _grid(group, (_histogram(lines),), across=True)
        if any(len(line.result.minimum) > 1 for line in lines):
            yield f"by_step_{name}", _grid(group, (_by_step,), across=True)
        if any(line.result.history for line in lines):
            yield f"convergence_{name}", _grid(group, (_convergence,), across=True)
        if span is not None:
            yield f"spanwise_{name}", _grid(group, (_span(span, "minimum"), _span(span, "mean")))


def steps_name(number: int) -> str:
    """Return the end of the names of files about a number of steps."""
    return f"{number:02d}_steps" if number else "auto_steps"


def save_figure(
    figure: Figure,
    folder: Path,
    name: str,
    dpi: int = 200,
    suffixes: Sequence[str] = (".png", ".svg"),
) -> list[Path]:
    """Write a figure as PNG and SVG, each whole; return the paths, or raise CaseError."""
    paths = [folder / f"{name}{suffix}" for suffix in suffixes]
    for path in paths:
        write_figure(figure, path, dpi)
    return paths


_Draw = Callable[["Axes", Sequence[FacetLine]], None]


def _against(what: What) -> _Draw:
    def draw(axes: Axes, lines: Sequence[FacetLine]) -> None:
        outcomes = []
        for line in lines:
            result = line.result
            found = line.result.quality
            numbers = found.min, found.mean, found.inverted, result.processor_seconds
            outcomes.append(Outcome(line.label, result.steps, *numbers, line.series))
        against_steps(axes, outcomes, what, _QUIET)

    return draw


_SECONDS = _against("seconds")


def _histogram(every: Sequence[FacetLine]) -> _Draw:
    good = [_values(line)[~_inverted(line)] for line in every]
    values = np.concatenate([*good, [1.0]])
    edges = np.linspace(*rounded_out(float(values.min()), float(values.max())), _BINS + 1)

    def draw(axes: Axes, lines: Sequence[FacetLine]) -> None:
        runs = [
            QualityRun(line.label, _values(line), _inverted(line), line.series) for line in lines
        ]
        # Logarithmic: few bad cells matter among many good ones.
        histogram(axes, runs, edges=edges, log=True, style=_QUIET)

    return draw


def _inverted(line: FacetLine) -> BoolArray:
    measured = line.result.quality
    return measured.status[measured.counted] == INVERTED


def _values(line: FacetLine) -> FloatArray:
    measured = line.result.quality
    return measured.values[measured.counted]


def _by_step(axes: Axes, lines: Sequence[FacetLine]) -> None:
    runs = []
    for line in lines:
        result = line.result
        numbers = np.arange(1, result.steps + 1)
        runs.append(StepRun(line.label, numbers, result.minimum, result.mean, line.series))
    quality_by_step(axes, runs, _QUIET)


def _convergence(axes: Axes, lines: Sequence[FacetLine]) -> None:
    runs = []
    for line in lines:
        if not line.result.history:
            continue
        cycles = [cycle for step, cycle in line.result.history if step == 1]
        runs.append(
            GreedyRun(
                line.label,
                np.array([cycle.control_nodes for cycle in cycles]),
                np.array([cycle.error for cycle in cycles]),
                np.array([cycle.level for cycle in cycles]),
                line.result.tolerance,
                line.series,
            )
        )
    convergence(axes, runs, style=_QUIET)


def _span(make: Profiler, what: Literal["minimum", "mean"]) -> _Draw:
    def draw(axes: Axes, lines: Sequence[FacetLine]) -> None:
        spanwise(axes, [make(line) for line in lines], what, style=_QUIET)

    return draw


def _grid(group: Sequence[Facet], draws: Sequence[_Draw], across: bool = False) -> Figure:
    """Return a figure with a row for each facet, or a column if ``across``, and one legend.

    A row has a plot for each function of ``draws``; with ``across`` there is one function.
    """
    count = len(group)
    shape = (1, count) if across else (count, len(draws))
    figure = empty_figure((WIDTH, 0.9 + shape[0] * (3.0 if across else 2.1)), 100.0, "constrained")
    axes = figure.subplots(*shape, squeeze=False)
    for number, facet in enumerate(group):
        for column, draw in enumerate(draws):
            here = axes[0, number] if across else axes[number, column]
            draw(here, facet.lines)
            if facet.title and column == 0:
                here.set_title(facet.title, fontsize=PRINT.size + 1, loc="left")
            if across and number:
                here.set_ylabel("")
            if not across and number < count - 1:
                here.set_xlabel("")
    for together in [axes[0]] if across else axes.T:
        _same_height(together)
    if _SECONDS in draws:
        _readable_seconds(list(axes[:, list(draws).index(_SECONDS)]))
    for inner in axes[0, 1:] if across else ():
        inner.tick_params(labelleft=False)
    _one_legend(figure)
    return figure


def _one_legend(figure: Figure) -> None:
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    labels = [name for name in handles if name not in _LAST]
    labels += [name for name in _LAST if name in handles]
    crosses = [
        line
        for axes in figure.axes
        for line in axes.lines
        if str(line.get_gid()).startswith("inverted:")  # at meshes with inverted cells
    ]
    if crosses:
        labels.append("has inverted cells")
        handles[labels[-1]] = crosses[0]
    if labels:
        figure.legend(
            [handles[name] for name in labels],
            labels,
            loc="outside lower center",
            ncols=len(labels) if len(labels) < 5 else 3,
            fontsize=PRINT.size,
            handlelength=3.2,
            frameon=False,
        )


def _same_height(together: Sequence[Axes]) -> None:
    scales = {axes.get_yscale() for axes in together}
    log = "log" in scales
    for axes in together:
        axes.set_yscale("log" if log else "linear")
        axes.relim()
        axes.autoscale_view()
    limits = [axes.get_ylim() for axes in together if axes.lines or axes.patches]
    low = min((low for low, _ in limits if low > 0.0 or not log), default=None)
    high = max((high for _, high in limits), default=None)
    for axes in together:
        axes.set_ylim(low, high)


def _readable_seconds(together: Sequence[Axes]) -> None:
    """Give axes of times that differ much (`_WIDE`) a logarithmic scale with plain numbers."""
    values = np.concatenate([line.get_ydata() for axes in together for line in axes.lines])
    values = values[values > 0.0]
    if not len(values) or values.max() < _WIDE * values.min():
        return
    low = values.min() / 1.5
    high = values.max() * 1.5
    # Three numbers a decade, and of many decades one.
    parts = (1.0, 2.0, 5.0) if high < 200.0 * low else (1.0,)
    for axes in together:
        axes.set_yscale("log")
        axes.set_ylim(low, high)
        axes.yaxis.set_major_locator(LogLocator(subs=parts))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
