"""The data of the plots of a session: curves of steps, span and sections, histogram of a step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Literal

import matplotlib as mpl
import numpy as np

from slideviz.case.motion_words import deformation
from slideviz.design.blade_gaps import gaps
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import FINE, Quality
from slideviz.plots.draw import GreedyRun, StepRun
from slideviz.plots.gap_curves import Measured
from slideviz.plots.histogram import Bars, Distribution, Outline, draw_distribution
from slideviz.plots.meridional import draw_meridional, meridional_bins
from slideviz.plots.section_curve import CurveRow, curve_of
from slideviz.plots.section_paint import shown_paint
from slideviz.plots.spanwise import Profile, along, in_layers
from slideviz.plots.style import Style
from slideviz.plots.ticks import rounded_out
from slideviz.sections.model import Section
from slideviz.sections.span import ConstantSpan, SpanWalls, between_walls, find_walls
from slideviz.session.changes import set_view, show_frame
from slideviz.session.colors import with_drawable_colors
from slideviz.session.passages import find_periods
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import Run, Session, StepFrame
from slideviz.system.weak_cache import WeakCache, weak_cache
from slideviz.terms import (
    COLOR_BY,
    DIFFERENCES,
    RANKED,
    SIZE_SKEW,
    WALL_VALUES,
    ColorBy,
    Range,
    quantity_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Coordinate = Literal["r", "x", "y", "z", "span"]

UNDEFORMED = 4  # series number of the undeformed mesh, which no run has


def series_of(run: Run) -> int:
    """Return the series number of a run, the same in all plots (see `Style.series`)."""
    number = run.number - 1
    return number if number < UNDEFORMED else number + 1


def step_runs(session: Session) -> list[StepRun]:
    """Return minimum and mean quality of each run with steps, from the undeformed mesh on.

    They are in the order of their numbers: the solid line of the first is drawn below dashed ones,
    so that it shows where lines coincide.
    """
    runs = []
    first = session.first
    for run in sorted(session.runs, key=lambda run: run.number):
        if first is None or not run.frames:
            continue
        frames = (first, *run.frames)
        runs.append(
            StepRun(
                run.label,
                np.arange(len(frames)),
                np.array([frame.quality.min for frame in frames]),
                np.array([frame.quality.mean for frame in frames]),
                series_of(run),
            )
        )
    return runs


def greedy_run(session: Session) -> GreedyRun | None:
    """Return the convergence of the greedy selection in the shown step; None if it had none."""
    frame = session.frame
    run = session.run_shown
    if frame is None or run is None or frame.step is None or not frame.step.history:
        return None
    cycles = frame.step.history
    return GreedyRun(
        f"{run.label}, step {frame.step.index}",
        np.array([cycle.control_nodes for cycle in cycles]),
        np.array([cycle.error for cycle in cycles]),
        np.array([cycle.level for cycle in cycles]),
        frame.step.tolerance,
        series_of(run),
    )


_PROFILES = WeakCache()


def profiles(session: Session, coordinate: Coordinate) -> list[Profile]:
    """Return profiles of the shown step, other runs' last steps, and the undeformed mesh; cached.

    Raises SlidevizError if the mesh has no extent along the coordinate.
    """
    shown = session.frame
    run_shown = session.run_shown
    asked: list[tuple[StepFrame | None, Run | None]] = []
    if run_shown is not None and shown is not session.first:
        asked.append((shown, run_shown))
    asked += [(run.last, run) for run in session.runs if run is not run_shown]
    asked.append((session.first, None))
    return [_profile(session, frame, coordinate, run) for frame, run in asked if frame is not None]


def _profile(
    session: Session, frame: StepFrame, coordinate: Coordinate, run: Run | None
) -> Profile:
    case = session.case
    label = "undeformed" if run is None else run.label

    def made() -> Profile:
        mesh = session.opened_mesh
        # In layers of the undeformed mesh, so that layers of cells stay together.
        values = frame.quality.values
        if coordinate == "span":
            section = between_walls(ConstantSpan("span", span=0.5), walls_in(session))
            span = section.positions(mesh.points)
            profile = in_layers(mesh, values, span, coordinate, label=label)
        else:
            profile = along(mesh, values, coordinate, case.axis, case.origin, label=label)
        return replace(profile, series=UNDEFORMED if run is None else series_of(run))

    key = coordinate, case.around_span, label
    return _PROFILES.of(frame, key, made)


def coordinates(session: Session) -> dict[Coordinate, str]:
    """Return in words the coordinates that curves along the span can have; no z in 2D."""
    if session.mesh is None or session.mesh.dim == 2:
        return {"y": "along y", "x": "along x", "r": "along the radius"}
    words: dict[Coordinate, str] = {"r": "along the radius", "span": "over the span"}
    return words | {"z": "along z", "y": "along y", "x": "along x"}


def usual_coordinate(session: Session) -> Coordinate:
    """Return the default coordinate along the span.

    It is the radius if the mesh repeats by rotation; else y in 2D, or the axis of largest extent.
    """
    if session.mesh is None or any(pair.kind == "rotational" for pair in session.pairs):
        return "r"
    extent = np.ptp(session.mesh.points, axis=0)
    return "y" if session.mesh.dim == 2 else ("x", "y", "z")[int(extent.argmax())]


def walls_in(session: Session) -> SpanWalls:
    """Return hub and shroud of a session; CaseError or MeshError if there are none."""
    mesh = session.opened_mesh
    case = session.case
    return find_walls(mesh, case, find_periods(mesh, case, session.pairs))


_GAPS = WeakCache()


def draw_meridional_view(session: Session, figure: Figure, style: Style) -> None:
    """Draw the mean of the quantity of the colors by meridional place, in the view's colors.

    Raises CaseError or MeshError if there is no hub and shroud.
    """
    mesh = session.opened_mesh
    walls = walls_in(session)
    draw_meridional(figure, meridional_bins(mesh, walls), shown_paint(session), style)


def gaps_of(session: Session) -> list[Measured]:
    """Return throat and gaps of the undeformed mesh and of the shown step; cached with these.

    Raises CaseError or MeshError if they cannot be measured.
    """
    case = session.case
    run = session.run_shown
    key = case.around_span
    measured: list[Measured] = []
    for frame in dict.fromkeys((session.first, session.frame)):
        if frame is None:
            continue
        of_frame = _GAPS.of(frame, key, partial(gaps, case, frame.mesh, reference=session.mesh))
        first = frame is session.first or run is None
        label, series = (
            ("undeformed", UNDEFORMED) if first or run is None else (run.label, series_of(run))
        )
        measured.append((label, series, of_frame))
    return measured


class SectionCurveMaker:
    """Makes the curves of sessions, and caches the undeformed mesh's cuts."""

    def __init__(self) -> None:
        self._first = Cuts()

    def of(self, shown: Sequence[tuple[Session, Cuts]], section: Section) -> tuple[CurveRow, ...]:
        """Return the curve of the undeformed mesh, then one per session, the first session's last.

        Meshes that the section does not cut are left out, and so is the undeformed mesh if
        displacements are drawn. Differences have one curve, that of the first view. ``shown``: the
        session of each view, the first view first, with the view's cached cuts.
        """
        line = _line(section)
        first = shown[0][0]
        what = first.view.color_by
        shown = shown[:1] if what in DIFFERENCES else shown
        states = [(session, cuts) for session, cuts in reversed(shown) if session.view.frame]
        if first.first is not None and what not in ("displacement", *DIFFERENCES):
            states.insert(0, (show_frame(first, 0), self._first))
        curves = (self._row(session, cuts, line) for session, cuts in states)
        return tuple(row for row in curves if row is not None)

    def _row(self, session: Session, cuts: Cuts, line: Section) -> CurveRow | None:
        frame = session.shown_frame
        run = session.run_shown
        lines = cuts.of(frame.mesh, line)
        if not len(lines):
            return None
        curve = curve_of(lines, line, shown_paint(session))
        if run is None or session.view.frame == 0:
            return CurveRow("undeformed", curve, UNDEFORMED)
        return CurveRow(run.label, curve, series_of(run))


def facts_of(session: Session, cuts: Cuts, section: Section) -> str:
    """Return a sentence on the cut cells: number, minimum and mean quality, inverted cells."""
    frame = session.shown_frame
    lines = cuts.of(frame.mesh, _line(section))
    return shown_paint(session).sentence(lines.cell_ids) if len(lines) else "it cuts no cell"


def _line(section: Section) -> Section:
    return replace(section, whole_cells=False)


LEAST_SPREAD = 0.05  # least range of qualities that the axis shows
MOST_COMPARED = 4  # most runs that are compared with the shown one, so that lines can be told apart


def histogram_limits(session: Session, full_range: bool) -> Range:
    """Return the limits of a histogram's axis: round numbers around the cells' values.

    They are the same for all steps of the shown run, so that bars can be compared during play.
    ``full_range``: all values that are possible (of the displacement, from 0).
    """
    what = shown_measure(session)
    if what in DIFFERENCES:
        whole = whole_range(what)
        usual = set_view(session, color_range=None).color_range
        return whole if full_range and whole[1] < np.inf else usual
    shown = [*session.frames, *(run.last for run in session.runs if run.last is not None)]
    spreads = [ends for frame in shown if (ends := spread(frame, what, session.mesh)) is not None]
    low = min((e[0] for e in spreads), default=0.0)
    high = max((e[1] for e in spreads), default=1.0)
    if what in WALL_VALUES:
        return rounded_out(low, high)
    if what != "displacement":
        # A smaller range would enlarge meaningless differences.
        ends = whole_range(what) if full_range else (low, high)
        low = min(low, ends[0])
        high = max(high, ends[1]) if ends[1] < np.inf else high
        return rounded_out(min(low, high - LEAST_SPREAD), high)
    return rounded_out(0.0 if full_range else low, high)


def whole_range(what: ColorBy) -> Range:
    """Return the ends of all possible values of a quantity that are of interest."""
    if what == "displacement" or what in WALL_VALUES:
        return 0.0, np.inf
    return RANKED[what].colors or RANKED[what].range


def draw_histogram(
    session: Session,
    figure: Figure,
    style: Style,
    *,
    log: bool,
    full_range: bool,
) -> None:
    """Draw the histogram of a session into a figure; nothing without a mesh.

    ``log``: whether the axis of the counts is logarithmic. ``full_range``: whether the other axis
    shows all possible values, not only those of the cells.
    """
    session = with_drawable_colors(session)
    if session.frame is None:
        return
    what = shown_measure(session)
    limits = histogram_limits(session, full_range)
    counts = partial(distribution, what=what, limits=limits, reference=session.reference)
    shown = counts(session.frame)
    run = session.run_shown
    label = "undeformed" if session.view.frame == 0 or run is None else run.label
    label = "preview" if session.preview else label
    term = COLOR_BY[what]
    metric = f"{term.label} quality [-]" if what in SIZE_SKEW else term.axis
    runs, left_out = compared(session)
    outlines = [
        Outline(other.label, counts(other.last), series_of(other))
        for other in runs
        if other.last is not None and what not in DIFFERENCES
    ]
    # The undeformed mesh has no displacement.
    alone = what in ("displacement", *DIFFERENCES)
    if session.first is not None and session.view.frame > 0 and not alone:
        outlines.append(Outline("undeformed", counts(session.first), None))
    axes = figure.add_subplot()
    bars = Bars(label, shown, _colors(session, shown))
    draw_distribution(axes, bars, outlines, metric, log, style)
    legend = axes.get_legend()
    if left_out and legend is not None:
        legend.set_title(f"without {left_out} other run{'s' if left_out > 1 else ''}")
        legend.get_title().set_fontsize(style.size)
        legend.get_title().set_color(style.scheme.text)


def compared(session: Session) -> tuple[list[Run], int]:
    """Return the runs to compare with the shown one, and the number of those left out.

    Preferred are the run shown beside it, then those with the same motion, then newer ones. The
    result is in the order of their numbers.
    """
    shown = session.run_shown
    others = [run for run in session.runs if run.last is not None and run is not shown]

    def rank(run: Run) -> tuple[bool, bool, int]:
        alike = shown is not None and deformation(run.case) == deformation(shown.case)
        return run.number != session.view.beside, not alike, -run.number

    first = sorted(others, key=rank)[:MOST_COMPARED]
    return sorted(first, key=lambda run: run.number), len(others) - len(first)


def first_value(axes: Axes) -> float:
    """Return the lowest value of a drawn histogram: where its bars begin."""
    bars = [patch for patch in axes.patches if patch.get_gid() == "shown"]
    return min(float(bar.get_x()) for bar in bars)  # type: ignore[attr-defined]


def shown_measure(session: Session) -> ColorBy:
    """Return the quantity of the histogram: that of the view's colors.

    For a mesh that stays in its file it is size-skew, the only one known of all cells.
    """
    known = with_drawable_colors(session).view.color_by
    return quantity_of("role" if session.lacks_cells else known)


def _colors(session: Session, shown: Distribution) -> list[tuple[float, ...]]:
    low, high = session.color_range
    middle = (shown.edges[1:] + shown.edges[:-1]) / 2.0
    part = np.clip((middle - low) / max(high - low, 1e-300), 0.0, 1.0)
    return [tuple(rgba) for rgba in mpl.colormaps[session.color_map](part)]


_MIDDLES = (np.arange(FINE) + 0.5) / FINE
"""Middles of the fine intervals (`FINE`) of a totals of qualities."""

BINS = 25
"""Number of intervals: few enough that an outline's steps show its dashes in a narrow panel."""


@weak_cache
def distribution(
    frame: StepFrame,
    what: ColorBy,
    limits: Range = (0.0, 1.0),
    reference: Mesh | Quality | None = None,
) -> Distribution:
    """Return the distribution of a frame's values ``what`` in `BINS` equal intervals of limits.

    ``reference``: see `Session.reference`.
    """
    edges = np.linspace(*limits, BINS + 1)
    totals = frame.quality.of_mesh
    if totals is not None:
        places = np.clip(np.searchsorted(edges, _MIDDLES, "right") - 1, 0, BINS - 1)
        counts = np.bincount(places, totals.fine_counts, BINS).astype(np.int64)
        return Distribution(counts, edges, totals.inverted)
    return Distribution.of(_values(frame, what, reference), edges)


@weak_cache
def spread(frame: StepFrame, what: ColorBy, undeformed: Mesh | None = None) -> Range | None:
    """Return the lowest and the highest value of the cells of a frame; None if all are inverted."""
    totals = frame.quality.of_mesh
    if totals is not None:
        there = _MIDDLES[np.flatnonzero(totals.fine_counts)]
        return (float(there[0]), float(there[-1])) if len(there) else None
    values = _values(frame, what, undeformed)
    right = values[np.isfinite(values)]
    return (float(right.min()), float(right.max())) if len(right) else None


def _values(frame: StepFrame, what: ColorBy, reference: Mesh | Quality | None) -> FloatArray:
    """Return the values of a frame's counted cells (those of a halo are not); NaN if inverted.

    Of numbers of walls only those of cells at walls.
    """
    values = frame.shown_values(what, reference)[frame.quality.counted]
    return values[~np.isinf(values)] if what in WALL_VALUES else values
