"""The session, all that the window shows, as a frozen value: mesh, case, guesses, runs, view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.case.check import effective
from slideviz.case.model import Case
from slideviz.errors import Message
from slideviz.mesh.model import Mesh, Skin
from slideviz.mesh.periodic import Pair
from slideviz.session.results import CheckedLimits, Run, StepFrame, cell_displacement
from slideviz.terms import RATED, SHOWN, WALL_VALUES, ColorBy, PointsShown, Role, Shown

if TYPE_CHECKING:
    from slideviz.case.limits import LimitResult
    from slideviz.sections.model import Section


@dataclass(frozen=True)
class ViewState:
    """The view of a session: colors, threshold, sections, step, things drawn."""

    color_by: ColorBy = "role"  # the quantity that cells are colored by
    color_range: tuple[float, float] | None = None
    """(float, float) or None: values at the ends of the color bar; None: 0 to 1 for quality, and 0
    to a round number above the largest of all runs for the displacement."""
    color_map: str = "viridis"  # one of `slideviz.terms.COLOR_MAPS`
    threshold: tuple[float, float] | None = None
    """(float, float) or None: draw only the cells whose value is in this range; None draws all."""
    points: PointsShown = "none"  # which nodes are drawn as points
    drawn: frozenset[Shown] = frozenset(name for name, term in SHOWN.items() if term.at_first)
    """Which things are drawn of those that the user can switch off."""
    sections: tuple[Section, ...] = ()  # the sections of the mesh
    passages: int = 0  # passages drawn on each side of a periodic mesh; -1 draws all there are
    hidden: frozenset[str] = frozenset()  # boundaries that are not drawn
    selected: tuple[str, ...] = ()  # boundaries that are highlighted
    frame: int = 0  # the number of the frame that is shown; 0 is the undeformed mesh
    marked_cell: int | None = None
    """The number of the cell that is marked, as of ``StepFrame.place_of``."""
    marked_in: int | None = None  # the run that was shown when it was marked; None for none
    beside: int | None = None
    """The number of a run shown in a second view beside the first; 0 is the undeformed mesh."""
    swapped: bool = False  # whether the second view is to the left of the first
    ranges: tuple[tuple[ColorBy, tuple[float, float]], ...] = ()
    """tuple of (str, (float, float)): the color ranges of other quantities that the view was
    colored by before."""
    section_index: int | None = None  # the place in ``sections`` of the one that is selected
    handle: bool = False  # whether the selected section has its handle drawn

    @property
    def flat_index(self) -> int | None:
        """Return the place of the section that has a flat view and is drawn, or None."""
        flat = (index for index, one in enumerate(self.sections) if one.flat and one.shown)
        return next(flat, None)

    @property
    def style(self) -> ViewState:
        """Return the view with defaults for step, selection, marked cell and second view."""
        return ViewState().in_style(self)

    def in_style(self, style: ViewState) -> ViewState:
        """Return ``style`` with step, selection, marked cell and second view of this view."""
        kept = ("selected", "frame", "marked_cell", "marked_in", "beside", "swapped")
        return replace(style, **{name: getattr(self, name) for name in kept})

    def with_drawn(self, drawn: Mapping[Shown, bool]) -> ViewState:
        """Return the view with things drawn (True) or not (False), by name."""
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
    "result_settings",
    "round_up",
]


IN_FILE = (
    "Not available for this mesh, which stays in its file: only its boundary, its worst cells and "
    "the cells of sections are in memory."
)
"""The message where something cannot be done with a mesh too large for memory."""

PanelPlace = Literal["open", "boundaries", "motion", "method", "curves"]
"""The panel where a requirement of a run is met, or that has more about its end; "open" is the
dialog that opens a file."""


@dataclass(frozen=True)
class Guess:
    """A guessed role, and its reason in words: the boundary's name, or a match."""

    role: Role
    reason: str


@dataclass(frozen=True, eq=False)
class Session:
    """The open mesh, its case, its runs, and the view of them."""

    mesh: Mesh | None = None  # the undeformed mesh; None before anything is open
    path: Path | None = None  # the mesh file
    case: Case = field(default_factory=Case)  # the case in the panels, with guessed roles
    guesses: Mapping[str, Guess] = field(default_factory=dict)
    """Guesses that the user has not confirmed, by boundary."""
    pairs: tuple[Pair, ...] = ()  # boundaries that match each other
    first: StepFrame | None = None  # the undeformed mesh with its quality
    runs: tuple[Run, ...] = ()  # the runs, in the order of their starts
    shown: int | None = None  # the number of the run whose steps are shown
    saved: Case | None = None  # the case as it was saved or opened last, without its view
    saved_sections: tuple[Section, ...] = ()  # the sections in the view of that case
    view: ViewState = field(default_factory=ViewState)
    checked: CheckedLimits | None = None
    """The limits as they were checked last (`slideviz.session.limits`)."""
    limit: int | None = None
    """The place in its results of the one whose failing cells are marked with rings."""
    intersection: str = ""
    """A sentence on boundaries that the motions put through each other, which keeps a run from
    starting; empty if none are known."""
    folding: Message | None = None
    """On moving boundaries that cross themselves, or a motion that hardly does what is meant, with
    which a run can start."""
    laid: tuple[object, ...] = ()
    """What ghosts wait for and is computed: the motions onto surfaces, and for which roles rims
    stay on their walls."""
    invalid: tuple[tuple[PanelPlace, str], ...] = ()
    """tuple of (PanelPlace, str): fields whose text is not valid, so that the case still has the
    value before: the panel, and a sentence. No run starts meanwhile."""
    removed: tuple[Run, ...] = ()  # the last runs removed from ``runs``, which undo can bring back
    newest: int = 0  # the highest number that a run had so far, removed ones too

    @property
    def lacks_cells(self) -> str:
        """Return why nothing can be done that needs all cells in memory; "" if they are there."""
        return IN_FILE if isinstance(self.mesh, Skin) else ""

    def inputs(self) -> dict[Path, str]:
        """Return the files that the session was read from, with words for what each is."""
        inputs = self.case.inputs()
        return inputs if self.path is None else inputs | {self.path: "the mesh that is open"}

    def run(self, number: int | None) -> Run | None:
        """Return the run with a number, or None."""
        return next((run for run in self.runs if run.number == number), None)

    @property
    def run_shown(self) -> Run | None:
        """Return the run whose steps are shown, or None."""
        return self.run(self.shown)

    @property
    def frames(self) -> tuple[StepFrame, ...]:
        """Return the frames that can be shown: the undeformed mesh, the steps of the run shown."""
        run = self.run_shown
        first = (run and run.undeformed) or self.first
        return (() if first is None else (first,)) + (() if run is None else run.frames)

    @property
    def planned(self) -> int:
        """Return the number of steps of the run that is shown, with those that it never made."""
        run = self.run_shown
        return 0 if run is None else run.planned

    @property
    def frame(self) -> StepFrame | None:
        """Return the frame that is shown; None before a mesh is open."""
        frames = self.frames
        return frames[min(self.view.frame, len(frames) - 1)] if frames else None

    @property
    def deformed(self) -> StepFrame | None:
        """Return the last step of the run that is shown, or None."""
        run = self.run_shown
        return run.last if run is not None else None

    @property
    def marked_here(self) -> bool:
        """Return whether the marked cell was marked in a run that is shown now."""
        view = self.view
        return view.marked_cell is not None and view.marked_in in (self.shown, view.beside)

    @property
    def unsaved_mesh(self) -> bool:
        """Return whether the run that is shown has steps, and its last mesh was not written."""
        run = self.run_shown
        return run is not None and bool(run.frames) and not run.saved

    @property
    def unsaved_case(self) -> bool:
        """Return whether the case differs from the one that was saved or opened last."""
        return self.mesh is not None and self.saved is not None and self.case != self.saved

    @property
    def repeatable(self) -> bool:
        """Return whether running the case file on disk would repeat the run that is shown."""
        run = self.run_shown
        saved = self.case.source is not None and not self.unsaved_case
        return saved and run is not None and run.end == "done" and not self.outdated

    @property
    def outdated(self) -> bool:
        """Return whether the case would give another result than the run that is shown."""
        run = self.run_shown
        return (
            run is not None
            and bool(run.frames)
            and result_settings(run.case) != result_settings(self.case)
        )

    @property
    def limit_results(self) -> tuple[LimitResult, ...] | None:
        """Return the limits of the case on the frame that is shown; None before they are known."""
        if not self.case.limits:
            return ()
        now = self.checked
        known = now is not None and now.frame is self.frame and now.limits == self.case.limits
        return now.results if known and now is not None else None

    @property
    def limit_chosen(self) -> LimitResult | None:
        """Return the limit whose failing cells are marked, or None."""
        results = self.limit_results or ()
        there = self.limit is not None and self.limit < len(results)
        return results[self.limit] if there and self.limit is not None else None

    @property
    def color_range(self) -> tuple[float, float]:
        """Return the values at the ends of the color bar."""
        what = self.view.color_by
        if what == "role":
            return 0.0, 1.0
        if self.view.color_range is not None:
            return self.view.color_range
        if what == "displacement":
            return 0.0, round_up(self.largest_displacement) or 1.0
        if what in WALL_VALUES:
            return self._wall_range
        low, high = RATED[what].colors or RATED[what].range
        if high == np.inf and self.mesh is not None:
            ends = {self.frames[0], self.frames[-1]}
            high = round_up(max(frame.largest(what, self.mesh) for frame in ends))
        return low, high if low < high < np.inf else low + 1.0

    @cached_property
    def _wall_range(self) -> tuple[float, float]:
        """Return round numbers around the values at walls of the first and the last frame."""
        ends = [
            pair
            for frame in ({self.frames[0], self.frames[-1]} if self.frames else ())
            if self.mesh is not None
            and (pair := frame.ends(self.view.color_by, self.mesh)) is not None
        ]
        low = min((a for a, _ in ends), default=0.0)
        high = max((b for _, b in ends), default=1.0)
        if self.view.color_by == "first-height" and low >= 0:
            return 0.0, round_up(high)  # numbers with many digits have no room at the bar
        if low < high:
            return outwards(low, high)
        return (0.0, 2.0 * low) if low > 0 else (low, low + 1.0)

    @cached_property
    def largest_displacement(self) -> float:
        """Return the largest displacement of a node after all runs, in the mesh's length unit."""
        if self.mesh is None:
            return 0.0
        lasts = (run.last for run in self.runs if run.last is not None)
        return max((last.largest_displacement(self.mesh) for last in lasts), default=0.0)

    def role(self, marker: str) -> Role:
        """Return the role of a boundary; boundaries without one are fixed."""
        return self.case.roles.get(marker, "fixed")

    def with_chosen_roles(self, case: Case) -> Case:
        """Return a case without the guesses that boundaries are fixed, as they are by default."""
        guessed = {name for name in self.guesses if case.roles.get(name) == "fixed"}
        return case.change(roles={n: role for n, role in case.roles.items() if n not in guessed})


def round_up(value: float) -> float:
    """Return a round number that is at least ``value``, for a color bar; 0 for no positive value.

    Its fifths, at which the bar has labels, have few digits, too.
    """
    if not value > 0:
        return 0.0
    power = float(10.0 ** np.floor(np.log10(value)))
    fit = (n for n in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0) if n * power >= value)
    return float(f"{next(fit, 10.0) * power:.3g}")


_PARTS = 100.0
"""A color range is rounded outwards to a power of ten, about its length over this number."""


def outwards(low: float, high: float) -> tuple[float, float]:
    """Return two numbers rounded to few digits, the lower one down and the upper one up."""
    unit = float(10.0 ** np.floor(np.log10((high - low) / _PARTS)))
    first = np.floor(low / unit + 1e-6) * unit
    last = np.ceil(high / unit - 1e-6) * unit
    digits = max(0, round(-np.log10(unit))) + 1
    return round(float(first), digits), round(float(last), digits)


def result_settings(case: Case) -> Case:
    """Return the case with defaults for all that does not change the result, and sorted roles."""
    roles = {name: role for name, role in sorted(case.roles.items()) if role != "fixed"}
    return replace(
        effective(case), roles=roles, mesh_out=None, source=None, warnings=(), view={}, limits=()
    )
