"""Sections of a mesh too large for memory: only the cells that a section cuts (a slab) are read.

The cells are divided into groups in the order of the file. When the first section is cut, the whole
file is read to find a bounding ball of each group. After that, only the groups are read whose balls
the section meets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.formats.su2b.elements import element_blocks, elements_between
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.sections.cut import sides_of
from slideviz.sections.model import ON_SECTION, Section
from slideviz.session.results import StepFrame
from slideviz.session.whole import measured_part, open_points
from slideviz.streaming.measuring import PointFiles
from slideviz.system.threads import Tick
from slideviz.terms import Metric

GROUP = 4096
"""Number of cells of a group."""
MOST = 1 << 18
"""Most cells that are read at a time."""
KEPT = 8
"""Most slabs of a frame that are cached."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Bounding balls of groups of `GROUP` cells, in the order of the file."""

    centres: FloatArray
    """(g, 3)."""
    radii: FloatArray
    """(g,)."""
    scale: float
    """The diagonal of the mesh's bounding box."""

    @classmethod
    def of(cls, files: PointFiles, tick: Tick) -> Groups:
        """Return the balls of a deformed mesh; the whole file is read."""
        lows, highs = [], []
        place = files.place
        for block in element_blocks(files.before, place, place.cells, place.dim, MOST):
            mesh = files.cells_of(block)[1]
            at, starts = mesh.points[mesh.cells.connectivity], mesh.cells.offsets[:-1:GROUP]
            lows.append(np.minimum.reduceat(at, starts))
            highs.append(np.maximum.reduceat(at, starts))
            tick((block.first + len(block.types)) / place.cells.count)
        low, high = np.concatenate(lows), np.concatenate(highs)
        scale = float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
        return cls((low + high) / 2.0, np.linalg.norm(high - low, axis=1) / 2.0, scale)

    def met_by(self, section: Section) -> IntArray:
        """Return the numbers (k,) of the groups that a section may cut."""
        # The distance from the section changes at most as much as one moves.
        reach = self.radii * (1.0 + 1e-9) + ON_SECTION * self.scale
        return np.flatnonzero(np.abs(section.distance(self.centres)) <= reach)


@dataclass(frozen=True, eq=False)
class FramePlace:
    """The files of a frame of a large mesh: that of its cells, with the zone, and of its points."""

    path: Path
    zone: int | None
    moved: Path

    @classmethod
    def of(cls, frame: StepFrame) -> FramePlace:
        """Return the files of a frame."""
        assert frame.mesh.source is not None
        return cls(frame.mesh.source, frame.mesh.zone, frame.file or frame.mesh.source)


_GROUPS: WeakKeyDictionary[Mesh, Groups] = WeakKeyDictionary()
_SLABS: WeakKeyDictionary[Mesh, dict[Section, StepFrame]] = WeakKeyDictionary()


def plain(section: Section) -> Section:
    """Return a section with defaults for all that does not change which cells it cuts."""
    return replace(section, name="", shown=True, flat=False, whole=False)


def slab_of(mesh: Mesh, section: Section) -> StepFrame | None:
    """Return the slab of cells of a large mesh that a section cuts; None until it was read."""
    return _SLABS.get(mesh, {}).get(plain(section))


def keep_slab(mesh: Mesh, section: Section, slab: StepFrame) -> None:
    """Cache the slab of cells that a section cuts, for `slab_of`."""
    kept = _SLABS.setdefault(mesh, {})
    while len(kept) >= KEPT:
        kept.pop(next(iter(kept)))
    kept[plain(section)] = slab


def read_slab(
    frame: StepFrame, section: Section, report: Tick, going_on: Callable[[], object]
) -> StepFrame:
    """Return the slab of cells that a section cuts: a frame of its own, with their quality.

    Raises
    ------
    MeshError
        A file has changed, and has mistakes.
    OSError
        It cannot be read.
    """
    place, metric = FramePlace.of(frame), frame.quality.metric
    with ExitStack() as stack:
        files = open_points(stack, place.path, place.zone, place.moved)
        groups = _GROUPS.get(frame.mesh)
        if groups is None:

            def tick(part: float) -> None:
                going_on()
                report(0.8 * part)

            groups = _GROUPS[frame.mesh] = Groups.of(files, tick)
        found = _cut_cells(files, groups, section, going_on, 1.0)
        if found is None:
            # The section is at the rim of the mesh, with all cells on its positive side.
            found = _cut_cells(files, groups, section, going_on, -1.0)
        if found is None:
            return _nothing(files, metric)
        return measured_part(*found, files, metric)


def _cut_cells(
    files: PointFiles,
    groups: Groups,
    section: Section,
    going_on: Callable[[], object],
    sign: float,
) -> tuple[Mesh, Mesh, IntArray, IntArray] | None:
    """Return the cells that a section cuts, or None if there are none.

    As a mesh before and after the deformation, with the numbers of its nodes and of its cells in
    the whole mesh. Cut are cells with nodes at negative distances and others; ``sign`` -1 turns the
    sign of distances round.
    """
    types, flat, ids, points = [], [], [], []
    near = ON_SECTION * groups.scale
    for first, count in _runs(groups.met_by(section), files.place.cells.count):
        going_on()
        place = files.place
        block = elements_between(files.before, place, place.cells, place.dim, first, count)
        base, now = files.cells_of(block)[:2]
        level = sign * section.distance(now.points)
        level[np.abs(level) <= near] = 0.0
        chosen = np.flatnonzero(sides_of(now.cells, level))
        local = now.cells.take(chosen)
        types.append(local.types)
        flat.append(Cells.from_types(block.types, block.nodes).take(chosen).connectivity)
        ids.append(block.ids[chosen])
        both = np.stack([base.points, now.points])[:, local.connectivity]
        points.append(both)
    if not sum(map(len, ids)):
        return None
    nodes, at, local_of = np.unique(np.concatenate(flat), return_index=True, return_inverse=True)
    before, after = np.concatenate(points, axis=1)[:, at]
    number = np.concatenate(ids)
    order = np.argsort(number, kind="stable")
    cells = Cells.from_types(np.concatenate(types), local_of).take(order)
    base = Mesh(before, cells, name=files.before.name)
    return base, base.with_points(after), nodes, number[order]


def _runs(groups: IntArray, cells: int) -> Iterator[tuple[int, int]]:
    """Yield first cell and number of cells of each run of consecutive groups, of `MOST` cells."""
    most = MOST // GROUP
    breaks = np.flatnonzero(np.diff(groups) != 1) + 1
    for run in np.split(groups, breaks):
        for k in range(0, len(run), most):
            part = run[k : k + most]
            first = int(part[0]) * GROUP
            yield first, min(first + len(part) * GROUP, cells) - first


def _nothing(files: PointFiles, metric: Metric) -> StepFrame:
    """Return the slab of a section that cuts no cell."""
    from slideviz.mesh.quality import Quality

    none, dim = np.empty(0), files.place.dim
    mesh = Mesh(np.empty((0, dim)), Cells.from_types([], []), name=files.before.name)
    codes = np.empty(0, np.uint8)
    found = Quality(none, none, none, codes, np.empty(0, np.int8), metric)
    return StepFrame(mesh, found, base=mesh)
