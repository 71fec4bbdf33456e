"""The data of a session's curves: quality by step, greedy selection, quality along the span."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.plots.draw import GreedyRun, StepRun
from slideviz.plots.spanwise import Profile, along, along_radius
from slideviz.session.state import Run, Session, StepFrame

Coordinate = Literal["r", "x", "y", "z"]

UNDEFORMED = 4
"""Series number of the undeformed mesh, which no run has."""


def series_of(run: Run) -> int:
    """Return the series number of a run, the same in all plots (see `Style.series`)."""
    number = run.number - 1
    return number if number < UNDEFORMED else number + 1


def step_runs(session: Session) -> list[StepRun]:
    """Return minimum and mean quality of each run with steps, from the undeformed mesh on.

    They are in the order of their numbers: the solid line of the first is drawn below dashed ones,
    so that it shows where lines coincide.
    """
    found = []
    first = session.first
    for run in sorted(session.runs, key=lambda run: run.number):
        if first is None or not run.frames:
            continue
        frames = (first, *run.frames)
        found.append(
            StepRun(
                run.label,
                np.arange(len(frames)),
                np.array([frame.quality.min for frame in frames]),
                np.array([frame.quality.mean for frame in frames]),
                series_of(run),
            )
        )
    return found


def greedy_run(session: Session) -> GreedyRun | None:
    """Return the convergence of the greedy selection in the shown step; None if it had none."""
    frame, run = session.frame, session.run_shown
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


class Profiles:
    """A cache of profiles of the quality along the span, kept as long as their frames exist."""

    def __init__(self) -> None:
        self._made: WeakKeyDictionary[StepFrame, dict[object, Profile]] = WeakKeyDictionary()

    def of(self, session: Session, coordinate: Coordinate) -> list[Profile]:
        """Return the profiles of the shown step, other runs' last steps, and the undeformed mesh.

        Raises
        ------
        SlidevizError
            The mesh has no extent along the coordinate.
        """
        found = []
        shown, run_shown = session.frame, session.run_shown
        if shown is not None and run_shown is not None and shown is not session.first:
            found.append(self._one(session, shown, coordinate, run_shown))
        others = [run for run in session.runs if run is not run_shown]
        found += [self._one(session, r.last, coordinate, r) for r in others if r.last is not None]
        if session.first is not None:
            found.append(self._one(session, session.first, coordinate, None))
        return found

    def _one(
        self, session: Session, frame: StepFrame, coordinate: Coordinate, run: Run | None
    ) -> Profile:
        case, mesh = session.case, session.mesh
        assert mesh is not None
        label = "undeformed" if run is None else run.label
        key = coordinate, case.axis, case.origin, label
        kept = self._made.setdefault(frame, {})
        if key not in kept:
            # In layers of the undeformed mesh, so that layers of cells stay together.
            values = frame.quality.values
            if coordinate == "r":
                made = along_radius(mesh, values, case.axis, case.origin, label=label)
            else:
                made = along(mesh, values, coordinate, label=label)
            kept[key] = replace(made, series=UNDEFORMED if run is None else series_of(run))
        return kept[key]


def coordinates(session: Session) -> dict[Coordinate, str]:
    """Return in words the coordinates that curves along the span can have; no z in 2D."""
    if session.mesh is None or session.mesh.dim == 2:
        return {"y": "along y", "x": "along x", "r": "along the radius"}
    return {"r": "along the radius", "z": "along z", "y": "along y", "x": "along x"}


def usual_coordinate(session: Session) -> Coordinate:
    """Return the default coordinate along the span.

    It is the radius if the mesh repeats by rotation; else y in 2D, or the axis of largest extent.
    """
    if session.mesh is None or any(pair.kind == "rotational" for pair in session.pairs):
        return "r"
    extent = np.ptp(session.mesh.points, axis=0)
    return "y" if session.mesh.dim == 2 else ("x", "y", "z")[int(extent.argmax())]
