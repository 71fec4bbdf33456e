"""The results of runs, as frozen values: steps, each with its quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.limits import Limit, LimitResult
from slideviz.case.model import Case
from slideviz.errors import MeshError
from slideviz.mesh.margin import SafeFraction
from slideviz.mesh.metrics import is_known, metric
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.mesh.walls import Walls, walls
from slideviz.solver.steps import safe_fraction_of
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import weak_cache
from slideviz.terms import METRICS, SIZE_SKEW, WALL_VALUES, ColorBy, field_of

if TYPE_CHECKING:
    from slideviz.solver.deform import Step


LABEL = 20  # most characters of a run's name in a plot


@dataclass(frozen=True, eq=False)
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
        self, what: ColorBy, undeformed: Mesh | None = None, cells: IntArray | None = None
    ) -> FloatArray:
        """Return the values of a quantity ``what`` in all cells (m,), or in ``cells`` (k,).

        A metric of nodes has the worst of each cell's nodes, one that compares neighbouring cells
        is NaN where only the skin is in memory. The displacement of a cell is the mean
        distance of its nodes from where they are in ``undeformed``, in the mesh's length unit. A
        number of walls is NaN in cells that are not at a wall.
        """
        if what == "displacement":
            return cell_displacement(self.mesh, self.base or undeformed or self.mesh, cells)
        if what in WALL_VALUES:
            every = self._at_walls(field_of(what), self.base or undeformed or self.mesh)
            return every if cells is None else every[cells]
        names = {"size": self.quality.size, "skew": self.quality.skew}
        if what in METRICS and what not in SIZE_SKEW:
            every = (
                metric(self.mesh, what, self.base or undeformed).of_cells
                if is_known(self.mesh, what)
                else np.full(len(self.mesh.cells), np.nan)
            )
        else:
            every = names.get(what, self.quality.values)
        return every if cells is None else every[cells]

    def shown_values(
        self, what: ColorBy, undeformed: Mesh | None = None, cells: IntArray | None = None
    ) -> FloatArray:
        """Return `values` for colors: nan where a cell is inverted, inf where it is at no wall."""
        status = self.quality.status if cells is None else self.quality.status[cells]
        values = self.values(what, undeformed, cells)
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

    def ends(self, what: ColorBy, undeformed: Mesh) -> tuple[float, float] | None:
        """Return the smallest and largest finite value of a quantity; None where there is none."""
        values = self.values(what, undeformed)
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


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
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


@njit(nogil=True, cache=True, error_model="numpy")
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
