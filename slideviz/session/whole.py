"""Counts and qualities of all cells of a mesh too large for memory, and its worst cells."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.formats.su2b.elements import ElementBlock, element_at, element_blocks
from slideviz.formats.su2b.layout import BinaryFile, find_zone
from slideviz.mesh.elements import SIZES
from slideviz.mesh.model import FloatArray, IntArray, Mesh, Part, frozen_array
from slideviz.mesh.quality import INVERTED, UNPROVEN, Quality, quality
from slideviz.session.inspect import WORST
from slideviz.session.results import StepFrame
from slideviz.streaming.measuring import PointFiles
from slideviz.system.threads import Tick
from slideviz.terms import Metric

FINE = 10_000
"""Intervals of 0 to 1 in which cells are counted by quality; bars of a histogram join some."""


@dataclass(frozen=True, eq=False)
class QualityTotals:
    """Counts and size-skew qualities of all cells of a mesh, summed up."""

    cells: int
    """`cells`, `inverted`, `unproven`: the number of all cells, and of those with these
    statuses."""
    min: float
    mean: float
    """`min`, `mean`: lowest and mean quality."""
    inverted: int
    unproven: int
    counts: IntArray
    """(FINE,): the number of cells, without inverted ones, in equal intervals of their quality from
    0 to 1."""
    worst: IntArray
    """(k,): the numbers in the file of the cells of lowest value, worst first."""


@dataclass(frozen=True, eq=False)
class PartQuality(Quality):
    """A quality with arrays of the cells in memory, but counts, minimum and mean of all cells."""

    totals: QualityTotals | None = None
    """The counts and qualities of all cells of the mesh."""

    @classmethod
    def of(cls, found: Quality, totals: QualityTotals) -> PartQuality:
        """Return the quality ``found`` of the cells in memory, with the totals of all cells."""
        own = (found.values, found.size, found.skew, found.status, found.signs, found.metric)
        return cls(*own, totals=totals)

    @property
    def all(self) -> QualityTotals:
        """Return the totals of all cells."""
        assert self.totals is not None
        return self.totals

    @cached_property
    def cells(self) -> int:
        """Return the number of cells of the whole mesh."""
        return self.all.cells

    @cached_property
    def min(self) -> float:
        """Return the lowest value of all cells."""
        return self.all.min

    @cached_property
    def mean(self) -> float:
        """Return the arithmetic mean of the values of all cells."""
        return self.all.mean

    def _with(self, status: int) -> int:
        bad, open_ = self.all.inverted, self.all.unproven
        return {INVERTED: bad, UNPROVEN: open_}.get(status, self.all.cells - bad - open_)

    def histogram(self, bins: int = 20) -> tuple[IntArray, FloatArray]:
        """Return the counts (bins,) of all cells and the edges (bins + 1,) of equal bins."""
        middles = (np.arange(FINE) + 0.5) / FINE
        counts, edges = np.histogram(middles, bins, (0.0, 1.0), weights=self.all.counts)
        counts[0] += self.all.inverted
        return counts.astype(np.int64), edges


class QualityAccumulator:
    """Makes a `QualityTotals` of cells that are added block by block, in any order."""

    def __init__(self) -> None:
        self._counts = np.zeros(FINE, np.int64)
        self._cells = self._inverted = self._unproven = 0
        self._sums: list[float] = []
        self._worst = np.empty(0, np.int64), np.empty(0)

    def add(self, ids: IntArray, values: FloatArray, status: NDArray[np.uint8]) -> None:
        """Add cells by their numbers, size-skew qualities and statuses, (k,) each."""
        right = values[status != INVERTED]
        places = np.minimum((right * FINE).astype(np.int64), FINE - 1)
        self._counts += np.bincount(places, minlength=FINE)
        self._cells += len(ids)
        self._inverted += len(ids) - len(right)
        self._unproven += int(np.count_nonzero(status == UNPROVEN))
        self._sums.append(float(values.sum()))
        if len(values) > WORST:
            limit = np.partition(values, WORST - 1)[WORST - 1]
            near = np.flatnonzero(values <= limit)
            ids, values = ids[near], values[near]
        old_ids, old = self._worst
        ids, values = np.concatenate([old_ids, ids]), np.concatenate([old, values])
        order = np.lexsort((ids, values))[:WORST]
        self._worst = ids[order], values[order]

    def totals(self) -> QualityTotals:
        """Return the totals of all cells that were added; there must be one at least."""
        ids, values = self._worst
        return QualityTotals(
            self._cells,
            float(values[0]),
            math.fsum(self._sums) / self._cells,
            self._inverted,
            self._unproven,
            self._counts,
            ids,
        )


def totals_of(found: Quality) -> QualityTotals:
    """Return the totals of a quality, block by block: its arrays may not fit into memory."""
    made, step = QualityAccumulator(), 1 << 20
    for first in range(0, len(found.values), step):
        part = slice(first, first + step)
        values, status = np.array(found.values[part]), np.array(found.status[part])
        made.add(np.arange(first, first + len(values)), values, status)
    return made.totals()


def measure_all(path: Path, zone: int | None, metric: Metric, tick: Tick) -> QualityTotals:
    """Return the totals of an undeformed mesh, whose cells are read and measured block by block.

    Raises
    ------
    MeshError
        The file has a mistake.
    OSError
        It cannot be read.
    """
    made = QualityAccumulator()
    with ExitStack() as stack:
        files = open_points(stack, path, zone, path)
        place = files.place
        for block in element_blocks(files.before, place, place.cells, place.dim):
            found = quality(files.cells_of(block)[0], metric=metric)
            made.add(block.ids, found.values, found.status)
            tick((block.first + len(block.types)) / place.cells.count)
    return made.totals()


def open_points(stack: ExitStack, path: Path, zone: int | None, moved: Path) -> PointFiles:
    """Return the points in the files of a mesh and of the deformed one; ``stack`` closes both."""
    before, after = (BinaryFile(one, stack.enter_context(one.open("rb"))) for one in (path, moved))
    return PointFiles(before, after, find_zone(before, zone))


def worst_frame(
    path: Path, zone: int | None, moved: Path, ids: IntArray, metric: Metric
) -> StepFrame:
    """Return the cells ``ids`` (k,) of a mesh in files as a frame of their own, in that order."""
    with ExitStack() as stack:
        files = open_points(stack, path, zone, moved)
        rows = _elements(files, ids)
        types = np.array([vtk for vtk, _ in rows], np.uint8)
        nodes = np.concatenate([nodes for _, nodes in rows])
        base, now, numbers = files.cells_of(ElementBlock(0, types, nodes, ids))
    return measured_part(base, now, numbers, ids, files, metric)


def measured_part(
    base: Mesh, now: Mesh, nodes: IntArray, ids: IntArray, files: PointFiles, metric: Metric
) -> StepFrame:
    """Return some cells of a mesh in files as a frame, with their quality.

    Parameters
    ----------
    base, now : Mesh
        The cells, undeformed and deformed.
    nodes, ids : (n,), (k,)
        Numbers of their nodes and of the cells in the whole mesh.
    files : PointFiles
        The files of the whole mesh.
    """
    place = files.place
    part = Part(
        frozen_array(nodes, np.int64), frozen_array(ids, np.int64), place.n_points, len(ids)
    )
    mesh = Mesh(now.points, now.cells, name=base.name, part=part)
    return StepFrame(mesh, quality(now, base, metric), base=base)


def _elements(files: PointFiles, ids: IntArray) -> list[tuple[int, IntArray]]:
    """Return VTK type and nodes of each of the cells with the numbers ``ids`` (k,)."""
    source, place = files.before, files.place
    found = [element_at(source, place, place.cells, int(cell)) for cell in ids]
    if all(at == cell for (_, _, at), cell in zip(found, ids, strict=True)):
        return [(vtk, nodes) for vtk, nodes, _ in found]
    # Cells are not in order in the file: read all of it.
    kept: dict[int, tuple[int, IntArray]] = {}
    for block in element_blocks(source, place, place.cells, place.dim):
        ends = np.concatenate([[0], np.cumsum(SIZES[block.types])])
        for k in np.flatnonzero(np.isin(block.ids, ids)).tolist():
            nodes = block.nodes[ends[k] : ends[k + 1]].copy()
            kept[int(block.ids[k])] = int(block.types[k]), nodes
    return [kept[int(cell)] for cell in ids]
