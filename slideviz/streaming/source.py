"""The cells of a mesh with their points, block by block: of a mesh in memory, or of one in a file.

A mesh in memory is one block. The quality of the cells and the cells that a section cuts are found
block by block, by the same functions for both sources.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace, open_zones
from slideviz.formats.su2b.read import ElementBlock, element_block, element_blocks
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh, Skin, frozen_array
from slideviz.mesh.quality import Quality
from slideviz.sections.cut import crossed_cells
from slideviz.sections.model import Section
from slideviz.system.atomic import reason_of
from slideviz.system.cleanup import draft, open_temporary
from slideviz.system.platform import allocate, release_pages, write_at
from slideviz.system.threads import Tick

CELLS = 1 << 17  # cells of a block of a file: one block is in memory at a time
READ = 1 << 20  # points that are read from a file at a time, at most
RUN = 64  # nodes whose numbers are at most so far apart are written in one piece
SPARSE = 8
"""All points between the lowest and highest node of a block of cells are read, used or not, where
they are at most so many times as many as its cells."""
Zone = tuple[Path, int | None]  # a file and the number of a zone in it, all where it is None


@record
class CellBlock:
    """Some cells of a mesh with their points."""

    ids: IntArray  # (k,): the numbers of the cells in the whole mesh
    nodes: IntArray  # (n,): the numbers of the block's points in the whole mesh, ascending
    mesh: Mesh  # these points and cells; of a mesh in a file, without boundaries
    base: Mesh | None = None
    """The same cells in the undeformed mesh; None where there is no reference."""
    quality: Quality | None = None  # the quality of the cells, where it was measured

    def take(self, which: IntArray) -> CellBlock:
        """Return the cells at the places ``which`` (k,), with their points alone."""
        cells = self.mesh.cells.take(which)
        flat = np.searchsorted(cells.nodes, cells.connectivity)
        mesh = Mesh(
            self.mesh.points[cells.nodes], Cells.from_types(cells.types, flat), name=self.mesh.name
        )
        return CellBlock(
            self.ids[which],
            self.nodes[cells.nodes],
            mesh,
            None if self.base is None else mesh.with_points(self.base.points[cells.nodes]),
            None if self.quality is None else self.quality.take(which),
        )

    def part_of(self, whole: Mesh) -> CellBlock:
        """Return the block with the name and the zone of the mesh that it is a part of."""
        part = replace(
            whole.numbering,
            points=frozen_array(self.nodes),
            cells=frozen_array(self.ids),
        )
        mesh = Skin(
            self.mesh.points,
            self.mesh.cells,
            name=whole.name,
            zone=whole.zone,
            zones=whole.zones,
            part=part,
        )
        base = None if self.base is None else mesh.with_points(self.base.points)
        return replace(self, mesh=mesh, base=base)


_EMPTY = (
    np.empty(0, np.int64),
    np.empty(0, np.int64),
    Mesh(np.empty((0, 3)), Cells.from_types([], [])),
)


def join_blocks(blocks: Iterable[CellBlock]) -> CellBlock:
    """Return the cells of some blocks as one, by ascending number."""
    every = list(blocks) or [CellBlock(*_EMPTY)]
    one = every[0]
    meshes = [block.mesh for block in every]
    ids = np.concatenate([block.ids for block in every])
    order = np.argsort(ids, kind="stable")
    nodes, first = np.unique(np.concatenate([block.nodes for block in every]), return_index=True)
    flat = [block.nodes[block.mesh.cells.connectivity] for block in every]
    types = np.concatenate([mesh.cells.types for mesh in meshes])
    cells = Cells.from_types(types, np.searchsorted(nodes, np.concatenate(flat))).take(order)
    mesh = Mesh(np.concatenate([mesh.points for mesh in meshes])[first], cells, name=one.mesh.name)
    bases = [block.base.points for block in every if block.base is not None]
    qualities = [block.quality for block in every if block.quality is not None]
    return CellBlock(
        ids[order],
        nodes,
        mesh,
        mesh.with_points(np.concatenate(bases)[first]) if bases else None,
        Quality.joined(qualities).take(order) if qualities else None,
    )


def cut_cells(
    blocks: Iterable[CellBlock],
    section: Section,
    matrices: Iterable[FloatArray] = (np.eye(4),),
    near: float = 0.0,
) -> CellBlock:
    """Return the cells of some blocks that a section can cut, after any transformation.

    Returns the cells with nodes on both sides of the section, or on it; perhaps none.
    ``matrices``: the transformations of the points.
    ``near``: nodes at most so far from the section are on it.
    """
    transformations = list(matrices)
    return join_blocks(
        block.take(np.flatnonzero(crossed_cells(block.mesh, section, transformations, near)))
        for block in blocks
    )


@record
class MemorySource:
    """A mesh in memory: one block."""

    mesh: Mesh
    base: Mesh | None = None

    @property
    def n_cells(self) -> int:
        """Return the number of its cells."""
        return len(self.mesh.cells)

    @property
    def n_points(self) -> int:
        """Return the number of its points."""
        return len(self.mesh.points)

    def blocks(self, tick: Tick = lambda _: None) -> Iterator[CellBlock]:
        """Yield the mesh as one block."""
        numbers = np.arange(max(self.n_cells, self.n_points))
        ids = numbers[: self.n_cells]
        nodes = numbers[: self.n_points]
        yield CellBlock(ids, nodes, self.mesh, self.base)
        tick(1.0)

    def types(self, ids: IntArray) -> NDArray[np.uint8]:
        """Return the VTK types (k,) of the cells ``ids`` (k,)."""
        return self.mesh.file_types[self.mesh.file_cells(ids)]


@record
class PointTable:
    """The points of a zone of an SU2 binary mesh, or of a file with the same layout."""

    file: BinaryFile
    place: ZonePlace

    def byte(self, node: int) -> int:
        """Return the place of the point with the number ``node`` in the file, in bytes."""
        return self.place.points + node * self.file.point(self.place.dim).itemsize

    def rows(self, first: int, count: int) -> NDArray:
        """Return points as they are in the file: coordinates ``x`` (count, d) and more."""
        kind = self.file.point(self.place.dim)
        return self.file.array(self.byte(first), count, kind, "the points")

    def coordinates(self, rows: slice) -> FloatArray:
        """Return the points (m, d) of consecutive nodes."""
        return np.ascontiguousarray(self.rows(rows.start, rows.stop - rows.start)["x"], float)

    def at(self, nodes: IntArray) -> FloatArray:
        """Return the points (k, d) of ascending nodes (k,); neighbours are read in one piece."""
        out = np.empty((len(nodes), self.place.dim))
        a = 0
        while a < len(nodes):
            first = int(nodes[a])
            b = int(np.searchsorted(nodes, first + READ))
            count = int(nodes[b - 1]) + 1 - first
            rows = self.rows(first, count)
            out[a:b] = rows["x"] if b - a == count else rows["x"][nodes[a:b] - first]
            a = b
        return out

    def write(self, file: int, nodes: IntArray, points: FloatArray) -> None:
        """Write the points (k, d) of ascending nodes (k,) to a descriptor of the table's file.

        They are on the disk when it returns.
        """
        for part in np.split(np.arange(len(nodes)), np.flatnonzero(np.diff(nodes) > RUN) + 1):
            if not len(part):
                continue
            first = int(nodes[part[0]])
            rows = np.array(self.rows(first, int(nodes[part[-1]]) + 1 - first))
            rows["x"][nodes[part] - first] = points[part]
            write_at(file, rows, self.byte(first))
        os.fsync(file)


@record
class ZoneSource:
    """A zone of a mesh in an SU2 binary file, of which one block is in memory at a time."""

    file: BinaryFile
    place: ZonePlace  # `file`, `place`: its cells
    points: PointTable
    base: PointTable | None
    """`points`, `base`: its points, and the undeformed ones if there is a reference."""
    undeformed: tuple[Path, int]
    """The file with its undeformed points, or else its points, and the number of the zone there."""
    first_cell: int = 0
    first_point: int = 0
    """`first_cell`, `first_point`: the numbers that its first cell and point have in blocks."""

    @property
    def n_cells(self) -> int:
        """Return the number of its cells."""
        return self.place.cells.count

    @property
    def n_points(self) -> int:
        """Return the number of its points."""
        return self.place.n_points

    def elements(self, size: int | None = None) -> Iterator[ElementBlock]:
        """Yield all cells in the order of the file, without points, ``size`` or `CELLS` a block."""
        place = self.place
        return element_blocks(self.file, place, place.cells, place.dim, size or CELLS)

    def elements_at(self, first: int, count: int) -> ElementBlock:
        """Return ``count`` cells from the place ``first`` in the zone on, without points."""
        place = self.place
        return element_block(self.file, place, place.cells, place.dim, first, count)

    def between(self, first: int, count: int) -> CellBlock:
        """Return ``count`` cells from the place ``first`` in the zone on."""
        return self.with_points(self.elements_at(first, count))

    def with_points(self, block: ElementBlock) -> CellBlock:
        """Return cells of the zone with their points.

        Where their nodes lie close to each other, the points between are among them (`SPARSE`).
        """
        low = int(block.nodes.min())
        high = int(block.nodes.max()) + 1
        if high - low <= SPARSE * len(block.types):
            nodes = np.arange(low, high)
            flat = block.nodes - low
        else:
            nodes, flat = np.unique(block.nodes, return_inverse=True)
        cells = Cells.from_types(block.types, flat)
        mesh = Mesh(self.points.at(nodes), cells, name=self.file.name)
        base = None if self.base is None else mesh.with_points(self.base.at(nodes))
        return CellBlock(block.ids + self.first_cell, nodes + self.first_point, mesh, base)

    def cells(self, ids: IntArray) -> Iterator[CellBlock]:
        """Yield blocks with the cells ``ids`` (k,) of the zone, in any order."""
        blocks: Iterable[ElementBlock] = [self.elements_at(cell, 1) for cell in ids.tolist()]
        if any(one.ids[0] != cell for one, cell in zip(blocks, ids, strict=True)):
            blocks = self.elements()  # cells are not in order in the file: read all of it
        for block in blocks:
            which = np.flatnonzero(np.isin(block.ids, ids))
            if len(which):
                yield self.with_points(block).take(which)


@record
class FileSource:
    """A mesh in an SU2 binary file: one zone, or all of them as one mesh."""

    zones: tuple[ZoneSource, ...]
    skin: Mesh | None = None

    @classmethod
    def open(
        cls,
        stack: ExitStack,
        zone: Zone,
        reference: Zone | None = None,
        moved: Path | None = None,
        skin: Mesh | None = None,
    ) -> FileSource:
        """Return the mesh in a file, which ``stack`` closes.

        ``reference``: the undeformed mesh, which has the same cells (see `has_cells_of`).
        ``moved``: a file with the points, as ``zone`` has the undeformed ones; in place of
        ``reference``.
        """
        source, places = stack.enter_context(open_zones(*zone))
        tables = [PointTable(source, place) for place in places]
        bases: Sequence[PointTable | None] = [None] * len(places)
        undeformed = [(zone[0], place.number) for place in places]
        if moved is not None:
            other = source.of(stack.enter_context(moved.open("rb")))
            bases = tables
            tables = [PointTable(other, place) for place in places]
        elif reference is not None:
            there, others = stack.enter_context(open_zones(*reference))
            bases = [PointTable(there, place) for place in others]
            undeformed = [(reference[0], place.number) for place in others]
        cells = accumulate((place.cells.count for place in places), initial=0)
        points = accumulate((place.n_points for place in places), initial=0)
        each = zip(places, tables, bases, undeformed, cells, points, strict=False)
        return cls(tuple(ZoneSource(source, *of_zone) for of_zone in each), skin)

    @property
    def mesh(self) -> Mesh:
        """Return the boundary of the mesh and the cells at it."""
        assert self.skin is not None
        return self.skin

    @property
    def n_cells(self) -> int:
        """Return the number of its cells."""
        return sum(zone.n_cells for zone in self.zones)

    @property
    def n_points(self) -> int:
        """Return the number of its points."""
        return sum(zone.n_points for zone in self.zones)

    def blocks(self, tick: Tick = lambda _: None, size: int | None = None) -> Iterator[CellBlock]:
        """Yield all cells in the order of the file, at most ``size`` at a time (`CELLS`)."""
        for zone in self.zones:
            if not zone.n_cells:
                raise MeshError(f"{zone.file.name} has no cells; a quality needs at least one")
            for block in zone.elements(size):
                yield zone.with_points(block)
                tick((zone.first_cell + block.first + len(block.types)) / self.n_cells)

    def types(self, ids: IntArray) -> NDArray[np.uint8]:
        """Return the VTK types (k,) of the cells ``ids`` (k,)."""
        return self.cells(ids).mesh.cells.types

    def cells(self, ids: IntArray) -> CellBlock:
        """Return the cells ``ids`` (k,), in that order."""
        shifted = [(zone, ids - zone.first_cell) for zone in self.zones]
        mine = [(zone, some[(some >= 0) & (some < zone.n_cells)]) for zone, some in shifted]
        block = join_blocks(part for zone, some in mine for part in zone.cells(some))
        return block.take(np.searchsorted(block.ids, ids))


MeshSource = MemorySource | FileSource


def has_cells_of(mesh: Zone, other: Zone) -> bool:
    """Return whether two SU2 binary meshes have the same cells, by types and nodes.

    Raises MeshError if their cells are in different orders in the files, so they cannot be
    compared.
    """
    with ExitStack() as stack:
        one = FileSource.open(stack, mesh).zones
        two = FileSource.open(stack, other).zones
        return len(one) == len(two) and all(map(_has_cells_of, one, two))


def _has_cells_of(zone: ZoneSource, other: ZoneSource) -> bool:
    sizes = ((each.place.dim, each.n_points, each.n_cells) for each in (zone, other))
    if len(set(sizes)) > 1:
        return False
    for first, second in zip(zone.elements(), other.elements(), strict=True):
        if not np.array_equal(first.ids, second.ids):
            raise MeshError(
                f"{other.file.name} has its cells in another order than {zone.file.name}, so they "
                "cannot be compared block by block; run it without --stream"
            )
        if not (
            np.array_equal(first.types, second.types) and np.array_equal(first.nodes, second.nodes)
        ):
            return False
    return True


class Scratch:
    """An array (count,) in a temporary file, which is removed when ``stack`` closes.

    Raises MeshError if the file cannot be made in ``folder``: the disk may be full.
    """

    def __init__(self, stack: ExitStack, folder: Path, count: int, kind: type) -> None:
        path = stack.enter_context(draft(folder))
        size = max(count * np.dtype(kind).itemsize, 1)
        try:
            with open_temporary(path, new=True, brief=True) as file:
                allocate(file.fileno(), size)
                self._map = mmap.mmap(file.fileno(), 0)
        except OSError as problem:
            raise MeshError(
                f"{folder}: a temporary file of {size / 1e6:,.0f} MB cannot be written there: "
                f"{reason_of(problem)}"
            ) from problem
        self.array: NDArray = np.frombuffer(self._map, kind, count)

    def release(self) -> None:
        """Give the memory of the array back to the system; its values stay in the file."""
        release_pages(self._map)
