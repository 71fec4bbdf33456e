"""What the window shows, as frozen values: mesh, case, guesses, computed frames, view settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.case.model import Case, Role
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import Quality

if TYPE_CHECKING:
    from slideviz.staircase import Step
    from slideviz.view.section import Section

ColourBy = Literal["role", "size_skew", "size", "skew", "displacement"]
PointsShown = Literal["none", "types", "control"]

COLOUR_BY: dict[ColourBy, str] = {
    "role": "role",
    "size_skew": "size-skew",
    "size": "size",
    "skew": "skew",
    "displacement": "displacement",
}
"""What the view can be coloured by, and the words for it."""

POINTS: dict[PointsShown, str] = {
    "none": "none",
    "types": "boundary nodes by type",
    "control": "control nodes",
}
"""Which nodes the view can draw as points, and the words for it."""


@dataclass(frozen=True)
class Guess:
    """A role that was not chosen but read from the name or from a match, and why."""

    role: Role
    reason: str


@dataclass(frozen=True, eq=False)
class Frame:
    """The mesh after a step, with its quality; the first frame is the undeformed mesh."""

    mesh: Mesh
    quality: Quality
    step: Step | None = None

    def values(self, what: ColourBy, undeformed: Mesh | None = None) -> FloatArray:
        """Return the number of every cell, (m,), that ``what`` stands for.

        Quality is in 0 to 1. The displacement of a cell is the mean distance of its nodes from
        where they are in ``undeformed``, in the mesh's length unit.
        """
        if what == "displacement":
            return cell_displacement(self.mesh, undeformed or self.mesh)
        if what == "size":
            return self.quality.size
        return self.quality.skew if what == "skew" else self.quality.values


@dataclass(frozen=True, eq=False)
class Run:
    """One deformation that was computed, and what it was computed with.

    Attributes
    ----------
    number : int
        From 1, in the order of the starts; never used twice in a session.
    case : Case
        The settings.
    frames : tuple of Frame
        The steps, without the undeformed mesh.
    end : {"", "done", "cancelled", "failed"}
        How it ended; empty while it goes on.
    saved : bool
        Whether the mesh of its last step was written.
    """

    number: int
    case: Case
    frames: tuple[Frame, ...] = ()
    end: Literal["", "done", "cancelled", "failed"] = ""
    saved: bool = False

    @property
    def last(self) -> Frame | None:
        """Return the frame of its last step."""
        return self.frames[-1] if self.frames else None

    @property
    def seconds(self) -> float:
        """Return the seconds that its steps took, without reading and drawing."""
        return sum(sum(f.step.seconds.values()) for f in self.frames if f.step is not None)


@dataclass(frozen=True)
class ViewState:
    """How it is looked at.

    Attributes
    ----------
    colour_by : {"role", "size_skew", "size", "skew", "displacement"}
        What the colours say.
    colour_range : (float, float) or None
        Values at the ends of the colour bar; None: 0 to 1 for quality, and 0 to a round number
        above the largest of all runs for the displacement.
    colour_map : str
        A key of `slideviz.view.look.COLOUR_MAPS`.
    threshold : (float, float) or None
        Draw only the cells whose value is in this range; None draws all.
    points : {"none", "types", "control"}
        Nodes drawn as points.
    edges : bool
        Draw the edges of the cells.
    undeformed : bool
        Draw the undeformed boundaries as a ghost.
    motion_ghost : bool
        Draw where the motions take the moving boundaries.
    legend : bool
        Draw the legend or the colour bar.
    triad : bool
        Draw the directions of the axes in a corner.
    perspective : bool
        Perspective instead of parallel projection (3D only).
    sections : tuple of Section
        Planes and cylinders that cut the mesh.
    copies : int
        Passages drawn on each side of a periodic mesh; -1 draws all there are.
    hidden : frozenset of str
        Boundaries that are not drawn.
    selected : tuple of str
        Boundaries that are highlighted.
    frame : int
        Which frame is shown, 0 is the undeformed mesh.
    marked : int or None
        The cell that is marked, by its number in the mesh.
    beside : int or None
        The number of a run shown in a second view beside the first; 0 is the undeformed mesh.
    swapped : bool
        Whether the second view stands to the left of the first.
    ranges : tuple of (str, (float, float))
        The colour ranges of what else the view was coloured by.
    """

    colour_by: ColourBy = "role"
    colour_range: tuple[float, float] | None = None
    colour_map: str = "viridis"
    threshold: tuple[float, float] | None = None
    points: PointsShown = "none"
    edges: bool = True
    undeformed: bool = False
    motion_ghost: bool = True
    legend: bool = True
    triad: bool = True
    perspective: bool = False
    sections: tuple[Section, ...] = ()
    copies: int = 0
    hidden: frozenset[str] = frozenset()
    selected: tuple[str, ...] = ()
    frame: int = 0
    marked: int | None = None
    beside: int | None = None
    swapped: bool = False
    ranges: tuple[tuple[ColourBy, tuple[float, float]], ...] = ()

    @property
    def style(self) -> ViewState:
        """Return it without what passes: the step, what is selected or marked, the second view."""
        return replace(self, selected=(), frame=0, marked=None, beside=None, swapped=False)


@dataclass(frozen=True, eq=False)
class Session:
    """All that is open: what was read, what is asked, what came out, how it is looked at.

    Attributes
    ----------
    mesh : Mesh or None
        The undeformed mesh; None before anything is open.
    path : Path or None
        The mesh file.
    case : Case
        What is asked, guesses included.
    guesses : mapping of str to Guess
        The boundaries whose role nobody has confirmed yet.
    pairs : tuple of Pair
        Boundaries that match each other.
    first : Frame or None
        The undeformed mesh with its quality.
    runs : tuple of Run
        What was computed, in the order of the starts.
    shown : int or None
        The number of the run whose steps are shown.
    saved : Case or None
        What is on disk, or what was there at the start.
    reduction_guess : str
        Why data reduction was switched on without being asked for; empty when it was not.
    clash : str
        What the motions put through what, in a sentence; empty as far as is known.
    """

    mesh: Mesh | None = None
    path: Path | None = None
    case: Case = field(default_factory=Case)
    guesses: Mapping[str, Guess] = field(default_factory=dict)
    pairs: tuple[Pair, ...] = ()
    first: Frame | None = None
    runs: tuple[Run, ...] = ()
    shown: int | None = None
    saved: Case | None = None
    view: ViewState = field(default_factory=ViewState)
    reduction_guess: str = ""
    clash: str = ""

    def run(self, number: int | None) -> Run | None:
        """Return the run of that number, if it is still there."""
        return next((run for run in self.runs if run.number == number), None)

    @property
    def run_shown(self) -> Run | None:
        """Return the run whose steps are shown."""
        return self.run(self.shown)

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Return the undeformed mesh and every step of the run that is shown."""
        run = self.run_shown
        first = (self.first,) if self.first is not None else ()
        return first + (run.frames if run is not None else ())

    @property
    def ran(self) -> Case | None:
        """Return what the steps shown were computed with."""
        run = self.run_shown
        return run.case if run is not None else None

    @property
    def frame(self) -> Frame | None:
        """Return the frame that is shown."""
        frames = self.frames
        return frames[min(self.view.frame, len(frames) - 1)] if frames else None

    @property
    def deformed(self) -> Frame | None:
        """Return the last step of the run that is shown."""
        run = self.run_shown
        return run.last if run is not None else None

    @property
    def unsaved_mesh(self) -> bool:
        """Tell whether steps are shown whose mesh has not been written."""
        run = self.run_shown
        return run is not None and bool(run.frames) and not run.saved

    @property
    def unsaved_case(self) -> bool:
        """Tell whether the case differs from what was saved or opened."""
        return self.mesh is not None and self.saved is not None and self.case != self.saved

    @property
    def outdated(self) -> bool:
        """Tell whether the steps shown were computed with other settings than now."""
        run = self.run_shown
        return run is not None and bool(run.frames) and essence(run.case) != essence(self.case)

    @property
    def colour_range(self) -> tuple[float, float]:
        """Return the values at the ends of the colour bar."""
        if self.view.colour_range is not None:
            return self.view.colour_range
        if self.view.colour_by != "displacement":
            return 0.0, 1.0
        return 0.0, round_above(self.largest_displacement) or 1.0

    @cached_property
    def largest_displacement(self) -> float:
        """Return the largest displacement of a node in the last steps of all runs."""
        if self.mesh is None:
            return 0.0
        lasts = [run.last.mesh.points for run in self.runs if run.last is not None]
        shifts = (np.linalg.norm(points - self.mesh.points, axis=1).max() for points in lasts)
        return max((float(shift) for shift in shifts), default=0.0)

    def role(self, marker: str) -> Role:
        """Return the role of a boundary; those nobody named are fixed."""
        return self.case.roles.get(marker, "fixed")


def round_above(value: float) -> float:
    """Return a number of few digits that is at least ``value``, also after division by five."""
    if not value > 0:
        return 0.0
    power = float(10.0 ** np.floor(np.log10(value)))
    fit = (
        digits
        for digits in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
        if digits * power >= value
    )
    return float(f"{next(fit, 10.0) * power:.3g}")


def essence(case: Case) -> Case:
    """Return the case without what does not change the result: file names, order of roles."""
    roles = {name: role for name, role in sorted(case.roles.items()) if role != "fixed"}
    return replace(case, roles=roles, mesh_out=None, source=None, warnings=(), view={})


def cell_displacement(mesh: Mesh, undeformed: Mesh) -> FloatArray:
    """Return the mean distance of the nodes of each cell from where they were, (m,)."""
    moved = mesh.points - undeformed.points
    shift = np.sqrt(np.einsum("nd,nd->n", moved, moved))
    offsets = mesh.cells.offsets
    total = np.add.reduceat(shift[mesh.cells.connectivity], offsets[:-1])
    return np.asarray(total / np.diff(offsets))
