"""The quality of a mesh larger than memory, measured block by block, from its files."""

from __future__ import annotations

import mmap
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.formats.su2b.elements import ElementBlock
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.mesh.quality import INVERTED, Quality, quality
from slideviz.solver.deform import folded_at
from slideviz.solver.growth import Farthest, farthest_node
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.skin import Index, index_of
from slideviz.system.cleanup import draft, open_temporary
from slideviz.terms import Metric

READ = 1 << 20
"""Points that are read from a file at a time, at most."""
PIECE = 1 << 22
"""Values of cells that are summed up at a time, at most."""
SPARSE = 8
"""All points between the lowest and highest node of a block of cells are read, used or not, where
they are at most so many times as many as its cells."""


@dataclass(frozen=True, eq=False)
class PointFiles:
    """The undeformed and the deformed points of a mesh, in two files with the same layout."""

    before: BinaryFile
    after: BinaryFile
    place: ZonePlace

    def cells_of(self, block: ElementBlock) -> tuple[Mesh, Mesh, IntArray]:
        """Return the cells of a block as two meshes, undeformed and deformed.

        And the numbers (n,) of their points in the whole mesh.
        """
        nodes, flat = nodes_of(block)
        cells = Cells.from_types(block.types, flat)
        base = Mesh(self.points(self.before, nodes), cells, name=self.before.name)
        return base, base.with_points(self.points(self.after, nodes)), nodes

    def points(self, source: BinaryFile, nodes: IntArray) -> FloatArray:
        """Return the points (k, d) of ascending nodes (k,); neighbours are read in one piece."""
        kind = source.point(self.place.dim)
        out = np.empty((len(nodes), self.place.dim))
        a = 0
        while a < len(nodes):
            first = int(nodes[a])
            b = int(np.searchsorted(nodes, first + READ))
            count = int(nodes[b - 1]) + 1 - first
            rows = source.array(
                self.place.points + first * kind.itemsize, count, kind, "the points"
            )
            out[a:b] = rows["x"] if b - a == count else rows["x"][nodes[a:b] - first]
            a = b
        return out


def nodes_of(block: ElementBlock) -> tuple[IntArray, IntArray]:
    """Return ascending node numbers (k,), with all that a block has, and its nodes as places there.

    Where they lie close to each other, the numbers between are among them (`SPARSE`).
    """
    low, high = int(block.nodes.min()), int(block.nodes.max()) + 1
    if high - low <= SPARSE * len(block.types):
        return np.arange(low, high), block.nodes - low
    nodes, flat = np.unique(block.nodes, return_inverse=True)
    return nodes, flat


def orientations_of(signs: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return which of -1 and 1 occur in ``signs`` (k,): (1,), or both, (2,)."""
    return np.unique([signs.min(), signs.max()])


@dataclass(frozen=True, eq=False)
class MeasuredBlock:
    """The quality of a block of cells, undeformed and deformed."""

    ids: Index
    """(k,) int64 or slice: the numbers of the cells."""
    values: FloatArray
    before: FloatArray
    """`values`, `before` (k,): quality of the deformed and of the undeformed cells."""
    status: NDArray[np.uint8]
    old: NDArray[np.uint8]
    """`status`, `old` (k,): status (``Quality.status``) of the deformed and of the undeformed
    cells."""
    signs: NDArray[np.int8]
    """(1,) or (2,) int8: orientations that occur: 1, -1 (numbered the other way round), or both."""
    inverted: dict[int, tuple[int, IntArray]]
    """dict of int to (int, (n,) int64): VTK type and nodes of inverted cells, by their number:
    those with the lowest numbers."""
    farthest: Farthest
    """The node that went farthest."""


def measured(
    block: ElementBlock, base: Mesh, moved: Mesh, numbers: IntArray, metric: Metric, listed: int
) -> MeasuredBlock:
    """Return the quality of a block, given as meshes ``base`` (undeformed) and ``moved``.

    ``numbers`` (n,) are those of their points in the whole mesh.

    At most ``listed`` inverted cells are in it, those with the lowest numbers.
    """
    one, other = quality(base, metric=metric), quality(moved, base, metric)
    ends, inverted = moved.cells.offsets, np.flatnonzero(other.status == INVERTED)
    lowest = inverted[np.argsort(block.ids[inverted])][:listed].tolist()
    return MeasuredBlock(
        index_of(block.ids),
        other.values,
        one.values,
        other.status,
        one.status,
        orientations_of(one.signs),
        {
            int(block.ids[k]): (int(block.types[k]), block.nodes[ends[k] : ends[k + 1]].copy())
            for k in lowest
        },
        farthest_node(base.points, moved.points, numbers),
    )


class QualityCollector:
    """The quality of all cells before and after, added block by block.

    It is kept in scratch files in ``folder``, which are removed when ``stack`` closes.

    Attributes
    ----------
    inverted : dict of int to (int, (n,) int64)
        VTK type and nodes of inverted cells, by their number: those with the lowest numbers.
    farthest : Farthest
        The node that went farthest.
    """

    def __init__(self, stack: ExitStack, folder: Path, count: int, metric: Metric) -> None:
        self._metric = metric
        kinds = (float, float, np.uint8, np.uint8)
        self._files = [Scratch(stack, folder, count, kind) for kind in kinds]
        self._values, self._before, self._status, self._old = (f.array for f in self._files)
        self._signs = np.zeros(0, np.int8)
        self.reset()

    def reset(self) -> None:
        """Forget the blocks that were added, before others are."""
        self.inverted: dict[int, tuple[int, IntArray]] = {}
        self.farthest = Farthest(-1.0, 0, np.empty(0))

    def add(self, found: MeasuredBlock, listed: int) -> None:
        """Add a block; the ``listed`` inverted cells with the lowest numbers so far are kept."""
        self._signs = orientations_of(np.concatenate([self._signs, found.signs]))
        self.farthest = self.farthest.further(found.farthest)
        ids = found.ids
        self._values[ids], self._status[ids] = found.values, found.status
        self._before[ids], self._old[ids] = found.before, found.old
        self.inverted = dict(sorted((self.inverted | found.inverted).items())[:listed])
        self._release()

    @property
    def has_both_orientations(self) -> bool:
        """Return whether both orientations occur: cells numbered in both directions, or folded."""
        return len(self._signs) > 1

    def quality(self) -> Quality:
        """Return the quality of the deformed cells, without size and skew."""
        return self._of(self._values, self._status)

    def undeformed(self) -> Quality:
        """Return the quality of the undeformed cells, without size and skew."""
        return self._of(self._before, self._old)

    def _of(self, values: FloatArray, status: NDArray[np.uint8]) -> Quality:
        none = np.empty(0)
        found = Quality(values, none, none, status, self._signs, self._metric)
        lowest, inverted = np.inf, 0

        def look(part: slice) -> None:
            nonlocal lowest, inverted
            lowest = min(lowest, float(values[part].min()))
            inverted += int(np.count_nonzero(status[part] == INVERTED))
            self._release()

        mean = summed(values, look) / len(values)
        # Found already: all numbers at once would be in memory.
        vars(found).update(min=lowest, mean=mean, inverted=inverted)
        return found

    def _release(self) -> None:
        for file in self._files:
            file.release()


def summed(
    values: FloatArray, look: Callable[[slice], object], first: int = 0, last: int | None = None
) -> float:
    """Return the sum of ``values[first:last]``, piece by piece, with the bits of ``numpy.sum``.

    NumPy sums up halves of halves, the first of each a multiple of 8 long, and so does this.
    ``look`` is called with the slice of each piece after it was read.
    """
    last = len(values) if last is None else last
    half = (last - first) // 2 // 8 * 8
    if last - first > PIECE:
        middle = first + half
        return summed(values, look, first, middle) + summed(values, look, middle, last)
    found = float(values[first:last].sum())
    look(slice(first, last))
    return found


class Scratch:
    """An array (count,) in a temporary file, which is removed when ``stack`` closes."""

    def __init__(self, stack: ExitStack, folder: Path, count: int, kind: type) -> None:
        path = stack.enter_context(draft(folder))
        with open_temporary(path, new=True) as file:
            size = max(count * np.dtype(kind).itemsize, 1)
            file.truncate(size)
            if hasattr(os, "posix_fallocate"):  # else a full disk would end the process
                os.posix_fallocate(file.fileno(), 0, size)
            self._map = mmap.mmap(file.fileno(), 0)
        self.array: NDArray = np.frombuffer(self._map, kind, count)

    def release(self) -> None:
        """Give the memory of the array back to the system; its values stay in the file."""
        if hasattr(mmap, "MADV_DONTNEED"):  # other systems than Linux do it in their own time
            self._map.madvise(mmap.MADV_DONTNEED)


def folded_steps(
    displacer: InteriorDisplacer, files: PointFiles, cells: Mapping[int, tuple[int, IntArray]]
) -> dict[int, tuple[int, int]]:
    """Return VTK type and first step with an inverted cell, by cell number.

    Parameters
    ----------
    cells : mapping of int to (int, (n,) int64)
        VTK type and nodes of each cell to follow, by its number.
    """
    if not cells:
        return {}
    types = [vtk for vtk, _ in cells.values()]
    nodes, flat = np.unique(
        np.concatenate([nodes for _, nodes in cells.values()]), return_inverse=True
    )
    points = files.points(files.before, nodes)
    part = Mesh(points, Cells.from_types(types, flat))
    moved = displacer.after_steps(nodes, points)
    steps = [
        replace(step, mesh=part.with_points(now))
        for step, now in zip(displacer.steps, moved, strict=True)
    ]
    when = folded_at(steps, part, np.arange(len(cells)))
    return dict(zip(cells, zip(types, when.tolist(), strict=True), strict=True))
