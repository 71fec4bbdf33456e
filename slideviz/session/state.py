"""The session as frozen values: mesh, case, guesses, frames of the runs, view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.case.check import effective
from slideviz.case.model import Case
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import Pair
from slideviz.session.results import Run, StepFrame, cell_displacement
from slideviz.terms import SHOWN, ColourBy, PointsShown, Role, Shown

if TYPE_CHECKING:
    from slideviz.sections.model import Section


@dataclass(frozen=True)
class ViewState:
    """The view of a session: colours, threshold, sections, step, things drawn.

    Attributes
    ----------
    colour_by : ColourBy
        What the colours say.
    colour_range : (float, float) or None
        Values at the ends of the colour bar; None: 0 to 1 for quality, and 0 to a round number
        above the largest of all runs for the displacement.
    colour_map : str
        One of `slideviz.terms.COLOUR_MAPS`.
    threshold : (float, float) or None
        Draw only the cells whose value is in this range; None draws all.
    points : PointsShown
        Nodes drawn as points.
    drawn : frozenset of Shown
        What is drawn of that which can be left out.
    sections : tuple of Section
        What cuts the mesh.
    passages : int
        Passages drawn on each side of a periodic mesh; -1 draws all there are.
    hidden : frozenset of str
        Boundaries that are not drawn.
    selected : tuple of str
        Boundaries that are highlighted.
    frame : int
        Which frame is shown, 0 is the undeformed mesh.
    marked_cell : int or None
        The cell that is marked, by its number in the mesh.
    beside : int or None
        The number of a run shown in a second view beside the first; 0 is the undeformed mesh.
    swapped : bool
        Whether the second view stands to the left of the first.
    ranges : tuple of (str, (float, float))
        The colour ranges of what else the view was coloured by.
    section_index : int or None
        The place of the section that is selected, to be worked on.
    handle : bool
        Whether it shows its handle, to be dragged.
    """

    colour_by: ColourBy = "role"
    colour_range: tuple[float, float] | None = None
    colour_map: str = "viridis"
    threshold: tuple[float, float] | None = None
    points: PointsShown = "none"
    drawn: frozenset[Shown] = frozenset(name for name, term in SHOWN.items() if term.at_first)
    sections: tuple[Section, ...] = ()
    passages: int = 0
    hidden: frozenset[str] = frozenset()
    selected: tuple[str, ...] = ()
    frame: int = 0
    marked_cell: int | None = None
    beside: int | None = None
    swapped: bool = False
    ranges: tuple[tuple[ColourBy, tuple[float, float]], ...] = ()
    section_index: int | None = None
    handle: bool = False

    @property
    def style(self) -> ViewState:
        """Return the view without what passes: step, selections, second view."""
        return ViewState().in_style(self)

    def in_style(self, style: ViewState) -> ViewState:
        """Return another view with what passes of this one: step, selections, second view."""
        return replace(
            style,
            selected=self.selected,
            frame=self.frame,
            marked_cell=self.marked_cell,
            beside=self.beside,
            swapped=self.swapped,
        )

    def with_drawn(self, drawn: Mapping[Shown, bool]) -> ViewState:
        """Return the view with some things drawn, or not."""
        on = frozenset(name for name, wanted in drawn.items() if wanted)
        return replace(self, drawn=self.drawn - drawn.keys() | on)

    @property
    def section(self) -> Section | None:
        """Return the selected section, or None."""
        if self.section_index is None or self.section_index >= len(self.sections):
            return None
        return self.sections[self.section_index]


__all__ = [
    "Guess",
    "PanelPlace",
    "Run",
    "Session",
    "StepFrame",
    "ViewState",
    "cell_displacement",
    "essence",
    "round_above",
]


IN_FILE = (
    "Not for this mesh, which stays in its file: in memory are only its boundary, its worst cells "
    "and those of sections."
)
"""Why something cannot be done with a large mesh."""

PanelPlace = Literal["open", "boundaries", "motion", "method"]
"""Where something is put right before a run: a panel, or the choice of a file."""


@dataclass(frozen=True)
class Guess:
    """A guessed role, and the reason: the boundary's name, or a match."""

    role: Role
    reason: str


@dataclass(frozen=True, eq=False)
class Session:
    """The open mesh, its case, its runs, and the view of them.

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
    first : StepFrame or None
        The undeformed mesh with its quality.
    runs : tuple of Run
        What was computed, in the order of the starts.
    shown : int or None
        The number of the run whose steps are shown.
    removed : tuple of Run
        Those taken out of ``runs`` last, which undo brings back.
    newest : int
        The highest number that a run was given, removed ones too.
    saved : Case or None
        What is on disk, or what was there at the start, without its view.
    saved_sections : tuple of Section
        Those of that view.
    intersection : str
        What the motions put through what, in a sentence; empty as far as is known.
    folding : str
        What the motions put through itself; a run can start all the same.
    invalid : tuple of (Place, str)
        The fields that show something else than the case has, because it is not valid: the panel,
        and a sentence. No run starts meanwhile.
    """

    mesh: Mesh | None = None
    path: Path | None = None
    case: Case = field(default_factory=Case)
    guesses: Mapping[str, Guess] = field(default_factory=dict)
    pairs: tuple[Pair, ...] = ()
    first: StepFrame | None = None
    runs: tuple[Run, ...] = ()
    shown: int | None = None
    saved: Case | None = None
    saved_sections: tuple[Section, ...] = ()
    view: ViewState = field(default_factory=ViewState)
    intersection: str = ""
    folding: str = ""
    invalid: tuple[tuple[PanelPlace, str], ...] = ()
    removed: tuple[Run, ...] = ()
    newest: int = 0

    @property
    def in_file(self) -> bool:
        """Tell whether only the boundary of the mesh is in memory, and its cells in their file."""
        return self.mesh is not None and self.mesh.part is not None

    def inputs(self) -> dict[Path, str]:
        """Return the files that the session was read from, and their roles in words."""
        found = self.case.inputs()
        return found if self.path is None else found | {self.path: "the mesh that is open"}

    def run(self, number: int | None) -> Run | None:
        """Return the run of that number, or None."""
        return next((run for run in self.runs if run.number == number), None)

    @property
    def run_shown(self) -> Run | None:
        """Return the run whose steps are shown."""
        return self.run(self.shown)

    @property
    def frames(self) -> tuple[StepFrame, ...]:
        """Return the undeformed mesh and every step of the run that is shown."""
        run = self.run_shown
        first = (run and run.undeformed) or self.first
        return (() if first is None else (first,)) + (() if run is None else run.frames)

    @property
    def frame(self) -> StepFrame | None:
        """Return the frame that is shown."""
        frames = self.frames
        return frames[min(self.view.frame, len(frames) - 1)] if frames else None

    @property
    def deformed(self) -> StepFrame | None:
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
    def repeatable(self) -> bool:
        """Tell whether the case file on disk gives the run that is shown once more."""
        run = self.run_shown
        kept = self.case.source is not None and not self.unsaved_case
        return kept and run is not None and run.end == "done" and not self.outdated

    @property
    def outdated(self) -> bool:
        """Tell whether the case differs from that of the run shown, for its result."""
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
        lasts = (run.last for run in self.runs if run.last is not None)
        return max((last.furthest(self.mesh) for last in lasts), default=0.0)

    def role(self, marker: str) -> Role:
        """Return the role of a boundary; boundaries without one are fixed."""
        return self.case.roles.get(marker, "fixed")


def round_above(value: float) -> float:
    """Return a number of few digits that is at least ``value``, also after division by five."""
    if not value > 0:
        return 0.0
    power = float(10.0 ** np.floor(np.log10(value)))
    fit = (n for n in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0) if n * power >= value)
    return float(f"{next(fit, 10.0) * power:.3g}")


def essence(case: Case) -> Case:
    """Return the case with only what changes the result: no file names, no order of roles."""
    roles = {name: role for name, role in sorted(case.roles.items()) if role != "fixed"}
    return replace(effective(case), roles=roles, mesh_out=None, source=None, warnings=(), view={})
