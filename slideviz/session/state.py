"""The session, all that the window shows, as a frozen value: mesh, case, runs, view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.check import effective
from slideviz.case.limits import Limit, LimitResult
from slideviz.case.model import Case
from slideviz.errors import MeshError, Message
from slideviz.mesh.margin import SafeFraction
from slideviz.mesh.metrics import is_known, metric
from slideviz.mesh.model import FloatArray, IntArray, Mesh, Skin, row_norms
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.mesh.walls import Walls, walls
from slideviz.solver.steps import Step, safe_fraction_of
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import WeakCache, weak_cache
from slideviz.terms import (
    COLOR_BY,
    DIFFERENCES,
    METRICS,
    RANKED,
    SHOWN,
    SIZE_SKEW,
    WALL_VALUES,
    ColorBy,
    PointsShown,
    Range,
    Role,
    Shown,
    field_of,
)

if TYPE_CHECKING:
    from slideviz.sections.model import Section
    from slideviz.session.measure import Pick


Handle = Literal["", "section", "motion", "boundary"]
"""What has a handle: the selected section, the chosen motion, the selected boundaries; "" nothing.
"""

UNDEFORMED = 0
"""The number of the undeformed mesh where a run's number is asked for; those begin with 1."""
LABEL = 20  # most characters of a run's name in a plot


@record
class StepFrame:
    """The mesh after a step, with its quality; the first frame is the undeformed mesh."""

    mesh: Mesh
    """The mesh, or the skin of one that is larger than memory (see `slideviz.streaming.skin`)."""
    quality: Quality
    step: Step | None = None  # the step; None for the undeformed mesh
    extra: StepFrame | None = None
    """The worst cells of a mesh of which only the skin is in memory, worst first. As numbers of
    cells of this frame, they follow those of the skin (see `place_of`)."""
    base: Mesh | None = None
    """The undeformed mesh of this frame, where it is not that of the session."""
    file: Path | None = None  # the file of the whole mesh, if only the skin is in memory
    limits: tuple[LimitResult, ...] = ()
    """Of the last step of a run: the limits of its case, as far as they could be checked."""
    walls: Walls | None = None
    """The layers at boundaries, compared with those of the undeformed mesh; None where only the
    skin is in memory. Colors show those of its ``markers``."""
    label: str = ""
    """What it is called in a film, as a time; empty: by its number."""

    def has(self, cell: int | None) -> bool:
        """Return whether the frame has a cell of that number, its own or of ``extra``."""
        more = 0 if self.extra is None else len(self.extra.mesh.cells)
        return cell is not None and 0 <= cell < len(self.mesh.cells) + more

    def place_of(self, cell: int) -> tuple[StepFrame, int]:
        """Return the frame that a cell belongs to, this one or ``extra``, and its number there."""
        n_cells = len(self.mesh.cells)
        return (
            (self, cell) if self.extra is None or cell < n_cells else (self.extra, cell - n_cells)
        )

    def values(
        self, what: ColorBy, reference: Mesh | Quality | None = None, cells: IntArray | None = None
    ) -> FloatArray:
        """Return the values of a quantity ``what`` in all cells (m,), or in ``cells`` (k,).

        A metric of nodes has the worst of each cell's nodes, one that compares neighbouring cells
        is NaN where only the skin is in memory. The displacement of a cell is the mean
        distance of its nodes from where they are in ``reference``, in the mesh's length unit. A
        number of walls is NaN in cells that are not at a wall. ``reference``: see
        `Session.reference`.
        """
        if isinstance(reference, Quality):
            every = self.quality.values - reference.values
            return every if cells is None else every[cells]
        if what in ("displacement", "run-distance"):
            return cell_displacement(self.mesh, self.base or reference or self.mesh, cells)
        if what in WALL_VALUES:
            every = self._at_walls(field_of(what), self.base or reference or self.mesh)
            return every if cells is None else every[cells]
        names = {"size": self.quality.size, "skew": self.quality.skew}
        if what in METRICS and what not in SIZE_SKEW:
            every = (
                metric(self.mesh, what, self.base or reference).of_cells
                if is_known(self.mesh, what)
                else np.full(len(self.mesh.cells), np.nan)
            )
        else:
            every = names.get(what, self.quality.values)
        return every if cells is None else every[cells]

    def shown_values(
        self, what: ColorBy, reference: Mesh | Quality | None = None, cells: IntArray | None = None
    ) -> FloatArray:
        """Return `values` for colors: nan where a cell is inverted, inf where it is at no wall."""
        status = self.quality.status if cells is None else self.quality.status[cells]
        values = self.values(what, reference, cells)
        if what in WALL_VALUES:
            values = np.where(np.isnan(values), np.inf, values)
        return np.where(status == INVERTED, np.nan, values)

    def _at_walls(self, name: str, undeformed: Mesh) -> FloatArray:
        """Return a number of the walls in all cells (m,), cached: nan where it has none."""
        known = _AT_WALLS.setdefault(self, {})
        if name not in known:
            try:
                layers = self.walls or walls(self.mesh, undeformed)
            except MeshError:
                layers = None
            known.clear()  # one is enough, as they are large
            none = np.full(len(self.mesh.cells), np.nan)
            known[name] = none if layers is None else layers.with_layers().at_cells(name)
        return known[name]

    def ends(self, what: ColorBy, reference: Mesh | Quality | None) -> Range | None:
        """Return the smallest and largest finite value of a quantity; None where there is none."""
        values = self.values(what, reference)
        values = values[np.isfinite(values)]
        return (float(values.min()), float(values.max())) if len(values) else None

    @weak_cache
    def largest(self, what: ColorBy, undeformed: Mesh) -> float:
        """Return the largest finite value of a quantity in all cells, 0 where there is none."""
        values = self.values(what, undeformed)
        return float(values[np.isfinite(values)].max(initial=0.0))

    def largest_displacement(self, undeformed: Mesh) -> float:
        """Return the largest displacement of a node, in the mesh's length unit."""
        now = self.mesh.points
        before = undeformed.points
        if now is before or not len(now):
            return 0.0
        lengths: list[float] = []

        def of_part(part: slice) -> None:
            shifts = now[part] - before[part]
            lengths.append(float(np.einsum("nd,nd->n", shifts, shifts).max()))

        in_parts(of_part, len(now))
        return float(np.sqrt(max(lengths)))


_AT_WALLS: WeakKeyDictionary[StepFrame, dict[str, FloatArray]] = WeakKeyDictionary()
"""The number of walls that was asked for last, in the cells of frames."""
_ENDS = WeakCache()  # of frames and quantities: the ends of differences from what lives elsewhere


@record
class Preview:
    """The mesh that live fields give for a case, until its run is there."""

    case: Case
    frame: StepFrame
    safe: SafeFraction  # how far the motion may go, straight on

    def off(self, last: StepFrame, undeformed: Mesh) -> tuple[float, float]:
        """Return ``Run.preview_off`` for the last step of the run of the same case."""
        apart = row_norms(self.frame.mesh.points - last.mesh.points)
        largest = last.largest_displacement(undeformed) or 1.0
        return float(apart.max()) / largest, self.frame.quality.min - last.quality.min


@record
class CheckedLimits:
    """The limits of a case, checked on a frame."""

    frame: StepFrame
    limits: tuple[Limit, ...]
    results: tuple[LimitResult, ...]
    """Of those of ``limits`` that could be checked, in their order. Their cells are numbers of
    cells of the frame."""
    problem: str = ""  # why others could not


def planned_steps(frames: Sequence[StepFrame]) -> int:
    """Return the number of steps of a run, with those after the last of its ``frames``.

    ``frames`` are without the undeformed mesh.
    """
    step = frames[-1].step if frames else None
    return len(frames) + (0 if step is None else step.total - step.index)


@record
class Run:
    """A deformation that was computed: its case and its steps."""

    number: int  # from 1, in the order of the starts; never used twice in a session
    case: Case  # the settings
    frames: tuple[StepFrame, ...] = ()  # the steps, without the undeformed mesh
    end: Literal["", "done", "cancelled", "failed"] = ""  # how it ended; empty while it goes on
    saved: bool = False  # whether the mesh of its last step was written to a file
    name: str = ""  # the user's name for it, or ""
    undeformed: StepFrame | None = None
    """The undeformed mesh with its quality, where this run has another metric than the session."""
    panels: Case | None = None  # for the run of a design: the session's case when it was asked for
    preview_off: tuple[float, float] | None = None
    """How far the preview was off that was shown before: the largest distance of a node as a part
    of the largest displacement, and the lowest quality; None where there was none."""
    live: bool = False  # whether it began because the hand rested; the next such run replaces it

    @property
    def label(self) -> str:
        """Return the name of the run in plots: its number, and the beginning of ``name``."""
        if not self.name:
            return f"run {self.number}"
        short = self.name if len(self.name) <= LABEL else f"{self.name[: LABEL - 1].rstrip()}…"
        return f"run {self.number}: {short}"

    @property
    def last(self) -> StepFrame | None:
        """Return the frame of the last step, or None."""
        return self.frames[-1] if self.frames else None

    @property
    def planned(self) -> int:
        """Return the number of its steps, with those that it has not made, or never made."""
        return planned_steps(self.frames)

    @property
    def incomplete(self) -> bool:
        """Return whether it ended with a part of its motion, as a cancelled run does."""
        return bool(self.end) and len(self.frames) < self.planned

    @property
    def progress_words(self) -> str:
        """Return how far it came, as ``step 3 of 5``."""
        return f"step {len(self.frames)} of {self.planned}"

    @cached_property
    def safe(self) -> SafeFraction | None:
        """Return how far the motion may go, as the steps say; None where they do not."""
        return safe_fraction_of(frame.step for frame in self.frames if frame.step is not None)

    @property
    def last_step(self) -> Step | None:
        """Return the last step, or None."""
        return None if self.last is None else self.last.step

    @property
    def seconds(self) -> float:
        """Return the seconds that the steps took, without reading and drawing."""
        return sum(sum(f.step.seconds.values()) for f in self.frames if f.step is not None)


def cell_displacement(mesh: Mesh, undeformed: Mesh, cells: IntArray | None = None) -> FloatArray:
    """Return the mean displacement (k,) of the nodes of each of ``cells`` (k,); None: of all.

    In the mesh's length unit. Only these cells take time and memory.
    """
    every = mesh.cells
    count = len(mesh.cells) if cells is None else len(cells)
    values = np.zeros(count)
    if mesh.points is undeformed.points:
        return values

    def of_part(part: slice) -> None:
        ids = np.arange(part.start, part.stop) if cells is None else cells[part]
        here = mesh.points, undeformed.points, every.connectivity, every.offsets
        _mean_distances(*here, ids, values[part])

    in_parts(of_part, count)
    return values


@njit
def _mean_distances(now, before, nodes, offsets, cells, found):  # type: ignore[no-untyped-def]
    """Write to ``found`` (k,) the mean distances of cells' nodes between two states (n, d)."""
    for i in range(len(cells)):
        begin = offsets[cells[i]]
        end = offsets[cells[i] + 1]
        total = 0.0
        for at in range(begin, end):
            square = 0.0
            for axis in range(now.shape[1]):
                square += (now[nodes[at], axis] - before[nodes[at], axis]) ** 2
            total += np.sqrt(square)
        found[i] = total / (end - begin)


@frozen
class ViewState:
    """The view of a session: colors, threshold, sections, step, things drawn."""

    color_by: ColorBy = "role"  # the quantity that cells are colored by
    color_range: Range | None = None
    """(float, float) or None: values at the ends of the color bar; None: 0 to 1 for quality, and 0
    to a round number above the largest of all runs for the displacement."""
    color_map: str = "viridis"  # one of `slideviz.terms.COLOR_MAPS`
    threshold: Range | None = None
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
    ranges: tuple[tuple[ColorBy, Range], ...] = ()
    """tuple of (str, (float, float)): the color ranges of other quantities that the view was
    colored by before."""
    section_index: int | None = None  # the place in ``sections`` of the one that is selected
    handle: Handle = ""  # what has a handle
    motion_index: int = 0  # the place of the motion that is chosen
    picks: tuple[Pick, ...] | None = None
    """The points that are measured; None while clicks pick none."""

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
        marked = ("marked_cell", "marked_in")
        kept = ("selected", "frame", *marked, "beside", "swapped", "motion_index", "picks")
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


IN_FILE = (
    "Not available for this mesh, which stays in its file: only its boundary, its worst cells and "
    "the cells of sections are in memory."
)
"""The message where something cannot be done with a mesh too large for memory."""

PanelPlace = Literal["open", "boundaries", "motion", "method", "curves", "worst", "limits"]
"""The panel where a requirement of a run is met, or that has more about its end; "open" is the
dialog that opens a file."""


@frozen
class Guess:
    """A guessed role, and its reason in words: the boundary's name, or a match."""

    role: Role
    reason: str


@record
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
    """The limits as they were checked last (`slideviz.session.jobs`)."""
    preview: Preview | None = None  # what is shown instead of the steps of a run, or None
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
    compared: StepFrame | None = None
    """What a second view or an image of a film is compared with: the frame of the other view."""
    removed: tuple[Run, ...] = ()  # the last runs removed from ``runs``, which undo can bring back
    newest: int = 0  # the highest number that a run had so far, removed ones too

    @property
    def lacks_cells(self) -> str:
        """Return why nothing can be done that needs all cells in memory; "" if they are there."""
        return IN_FILE if isinstance(self.mesh, Skin) else ""

    @property
    def case_file(self) -> Path | None:
        """Return the case file that was opened or saved last; None, too, for a session file."""
        source = self.case.source
        return source if source is not None and source.suffix.lower() == ".cfg" else None

    def inputs(self) -> dict[Path, str]:
        """Return the files that the session was read from, with words for what each is."""
        inputs = self.case.inputs()
        return inputs if self.path is None else inputs | {self.path: "the mesh that is open"}

    def run(self, number: int | None) -> Run | None:
        """Return the run with a number, or None."""
        return next((run for run in self.runs if run.number == number), None)

    @property
    def last_number(self) -> int:
        """Return the highest number that a run had so far."""
        return max((self.newest, *(run.number for run in self.runs)))

    @property
    def run_shown(self) -> Run | None:
        """Return the run whose steps are shown, or None."""
        return self.run(self.shown)

    @property
    def frames(self) -> tuple[StepFrame, ...]:
        """Return the frames that can be shown: the undeformed mesh, the steps of the run shown.

        Of a preview that is its only step.
        """
        run = self.run_shown
        first = (run and run.undeformed) or self.first
        if self.preview is not None and first is not None:
            return first, self.preview.frame
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
    def opened_mesh(self) -> Mesh:
        """Return the undeformed mesh, where a mesh is known to be open."""
        assert self.mesh is not None
        return self.mesh

    @property
    def shown_frame(self) -> StepFrame:
        """Return the frame that is shown, where a mesh is known to be open."""
        assert self.frame is not None
        return self.frame

    @property
    def frame_beside(self) -> StepFrame | None:
        """Return the frame of the other view, or None."""
        other = second_view(self)
        return self.compared if other is self else other.frame

    @property
    def reference(self) -> Mesh | Quality | None:
        """Return what the values of the view compare with: the undeformed mesh.

        For differences it is the mesh or the quality in the other view; None where there is none.
        """
        what = self.view.color_by
        if what not in DIFFERENCES:
            return self.mesh
        frame = self.frame_beside
        if frame is None or self.lacks_cells:
            return None
        return frame.mesh if what == "run-distance" else frame.quality

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
    def motion_index(self) -> int | None:
        """Return the place of the chosen motion; None where there are no motions."""
        last = len(self.case.motions) - 1
        return min(self.view.motion_index, last) if last >= 0 else None

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
    def color_map(self) -> str:
        """Return the color map of the view, or that which the quantity always has."""
        return COLOR_BY[self.view.color_by].color_map or self.view.color_map

    @property
    def color_range(self) -> Range:
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
        if what in DIFFERENCES:
            return self._difference_range
        low, high = RANKED[what].colors or RANKED[what].range
        if high == np.inf and self.mesh is not None:
            ends = {self.frames[0], self.frames[-1]}
            high = round_up(max(frame.largest(what, self.mesh) for frame in ends))
        return low, high if low < high < np.inf else low + 1.0

    @cached_property
    def _wall_range(self) -> Range:
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
    def _difference_range(self) -> Range:
        """Return round numbers around the differences at the last step, with 0 in their middle."""
        what = self.view.color_by
        # With a color range: `second_view` would ask for this one.
        view = replace(self.view, frame=len(self.frames) - 1, color_range=(0.0, 1.0))
        last = replace(self, view=view)
        frame = last.frame
        reference = last.reference
        low = high = 0.0
        if frame is not None and reference is not None:
            known = _ENDS.of(frame, what, WeakCache)
            ends = known.of(reference, None, lambda: frame.ends(what, reference))
            low, high = ends or (low, high)
        most = round_up(max(-low, high)) or 1.0
        return (-most if COLOR_BY[what].color_map else 0.0), most

    @cached_property
    def largest_displacement(self) -> float:
        """Return the largest displacement of a node after all runs, in the mesh's length unit."""
        if self.mesh is None:
            return 0.0
        lasts = [run.last for run in self.runs if run.last is not None]
        lasts += [self.preview.frame] if self.preview is not None else []
        return max((last.largest_displacement(self.mesh) for last in lasts), default=0.0)

    def role(self, marker: str) -> Role:
        """Return the role of a boundary; boundaries without one are fixed."""
        return self.case.roles.get(marker, "fixed")

    def with_chosen_roles(self, case: Case) -> Case:
        """Return a case without the guesses that boundaries are fixed, as they are by default."""
        guessed = {name for name in self.guesses if case.roles.get(name) == "fixed"}
        return case.change(roles={n: role for n, role in case.roles.items() if n not in guessed})


def second_view(session: Session) -> Session:
    """Return the session that the second view shows: the other run, at the matching step.

    It has the same colors. Unchanged where there is no second view.
    """
    beside = session.view.beside
    other = session.run(beside)
    if session.compared is not None or (other is None and beside != UNDEFORMED):
        return session
    frame = 0
    if other is not None:
        run = session.run_shown
        planned = run.planned if run is not None else 0
        at = session.view.frame
        # The step at about the same part of the displacement, where numbers of steps differ.
        frame = round(at * other.planned / planned) if planned else 0
        frame = min(max(frame, 1) if at else frame, len(other.frames))
    return replace(
        session,
        preview=None,
        compared=session.frame,
        shown=session.shown if other is None else other.number,
        view=replace(session.view, frame=frame, color_range=session.color_range),
    )


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


def outwards(low: float, high: float) -> Range:
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
