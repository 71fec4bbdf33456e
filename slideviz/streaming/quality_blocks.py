"""The cells of a mesh file larger than memory with their quality, block by block."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.errors import MeshError
from slideviz.formats.su2b.elements import ElementBlock, element_blocks
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace, find_zone
from slideviz.mesh.model import Cells, IntArray, Mesh
from slideviz.mesh.quality import Quality, quality
from slideviz.streaming.measuring import PointFiles, Scratch, nodes_of, orientations_of
from slideviz.streaming.orientation import facet_sums, require_consistent_orientation
from slideviz.streaming.skin import index_of
from slideviz.system.ranks import SERIAL
from slideviz.system.threads import Tick
from slideviz.terms import Metric

CELLS = 1 << 17
"""Cells of a block: one block is in memory at a time."""
Zone = tuple[Path, int | None]
"""A file and the number of a zone in it, the first where it is None."""


@dataclass(frozen=True, eq=False)
class QualityBlock:
    """A block of cells of a mesh, with their quality."""

    ids: IntArray
    """(k,): the numbers of the cells in the whole mesh."""
    nodes: IntArray
    """(n,): the numbers of the block's points in the whole mesh, ascending."""
    mesh: Mesh
    """These points and cells, without boundaries."""
    base: Mesh | None
    """The same cells in the undeformed mesh; None where there is no reference."""
    quality: Quality


def quality_blocks(
    mesh: Zone, reference: Zone | None, metric: Metric, tick: Tick = lambda _: None
) -> Iterator[QualityBlock]:
    """Yield all cells of an SU2 binary mesh with their quality, in the order of the file.

    Parameters
    ----------
    reference : file and zone, optional
        The undeformed mesh, which has the same cells (see `has_cells_of`).

    Raises
    ------
    MeshError
        A file has a mistake, or cells are numbered in both directions and some are folded.
    """
    with ExitStack() as stack:
        source, place = _opened(stack, mesh)
        if not place.cells.count:
            raise MeshError(f"{source.name} has no cells; a quality needs at least one")
        files, before = PointFiles(source, source, place), None
        if reference:
            old, where = _opened(stack, reference)
            before = PointFiles(old, old, where)
        signs = np.zeros(0, np.int8)
        for block in element_blocks(source, place, place.cells, place.dim, CELLS):
            nodes, flat = nodes_of(block)
            cells = Cells.from_types(block.types, flat)
            now = Mesh(files.points(source, nodes), cells, name=source.name)
            base = now.with_points(before.points(before.before, nodes)) if before else None
            found = quality(now, base, metric)
            known, signs = len(signs), orientations_of(np.concatenate([signs, found.signs]))
            if known < 2 == len(signs):
                _require_right(reference or mesh, source.name, place.cells.count, before is None)
            yield QualityBlock(block.ids, nodes, now, base, found)
            tick((block.first + len(block.types)) / place.cells.count)


def _require_right(mesh: Zone, name: str, count: int, alone: bool) -> None:
    """Raise where cells of a mesh with volumes of both signs may be folded.

    Parameters
    ----------
    name : str
        The mesh, for the message.
    count : int
        Its cells.
    alone : bool
        Whether there is no undeformed mesh to compare it with.
    """
    also = "rate a deformed mesh with --reference UNDEFORMED, " if alone else ""
    parts = [(first, min(first + CELLS, count)) for first in range(0, count, CELLS)]
    with SERIAL.sharing(facet_sums, *mesh) as do:
        require_consistent_orientation(do(parts), name, also)


def has_cells_of(mesh: Zone, other: Zone) -> bool:
    """Return whether two SU2 binary meshes have the same cells, by types and nodes.

    Raises
    ------
    MeshError
        Their cells are in different orders in the files, so they cannot be compared.
    """
    with ExitStack() as stack:
        (one, place), (two, there) = _opened(stack, mesh), _opened(stack, other)
        same = place.dim == there.dim and place.n_points == there.n_points
        if not same or place.cells.count != there.cells.count:
            return False
        both = zip(_blocks(one, place), _blocks(two, there), strict=True)
        for first, second in both:
            if not np.array_equal(first.ids, second.ids):
                raise MeshError(
                    f"{two.name} has its cells in another order than {one.name}, so they cannot "
                    "be compared block by block; run it without --stream"
                )
            if not (
                np.array_equal(first.types, second.types)
                and np.array_equal(first.nodes, second.nodes)
            ):
                return False
    return True


@dataclass(frozen=True, eq=False)
class MeshQuality:
    """The quality and the counts of all cells of a mesh."""

    quality: Quality
    """Without size and skew; its arrays are in scratch files."""
    worst: list[tuple[int, int]]
    """list of (int, int): numbers and VTK types of the cells of lowest quality, worst first, ties
    by number."""
    types: dict[int, int]
    """The number of cells of each VTK type."""
    points: int
    unused: int
    """`points`, `unused`: the number of points, and of those that no cell uses."""


def measure_mesh(
    stack: ExitStack,
    folder: Path,
    mesh: Zone,
    reference: Zone | None = None,
    *,
    metric: Metric = "knupp",
    listed: int = 10,
    tick: Tick = lambda _: None,
) -> MeshQuality:
    """Return the quality and the counts of all cells of an SU2 binary mesh.

    Parameters
    ----------
    stack : ExitStack
        Removes the scratch files of the quality when it closes.
    folder : Path
        Where these files are made: 9 bytes for each cell.
    reference : file and zone, optional
        The undeformed mesh, as for `quality_blocks`.
    listed : int
        How many of the worst cells are wanted.

    Raises
    ------
    MeshError
        As by `quality_blocks`.
    """
    with ExitStack() as here:
        place = _opened(here, mesh)[1]
    files = [Scratch(stack, folder, place.cells.count, kind) for kind in (float, np.uint8)]
    values, status = (file.array for file in files)
    used = np.zeros(place.n_points, bool)
    counts = np.zeros(256, np.int64)
    worst: list[tuple[float, int, int]] = []
    signs = np.zeros(0, np.int8)
    for part in quality_blocks(mesh, reference, metric, tick):
        at, found = index_of(part.ids), part.quality
        values[at], status[at], signs = found.values, found.status, found.signs[:1]
        used[part.nodes[part.mesh.cells.connectivity]] = True
        counts += np.bincount(part.mesh.cells.types, minlength=256)
        low = np.lexsort((part.ids, found.values))[:listed]
        rows = zip(found.values[low], part.ids[low], part.mesh.cells.types[low], strict=True)
        worst = sorted([*worst, *((float(v), int(i), int(t)) for v, i, t in rows)])[:listed]
        for file in files:
            file.release()
    none = np.empty(0)
    return MeshQuality(
        Quality(values, none, none, status, signs, metric),
        [(i, t) for _, i, t in worst],
        {vtk: int(counts[vtk]) for vtk in np.flatnonzero(counts).tolist()},
        place.n_points,
        int(np.count_nonzero(~used)),
    )


def _opened(stack: ExitStack, zone: Zone) -> tuple[BinaryFile, ZonePlace]:
    source = BinaryFile(zone[0], stack.enter_context(zone[0].open("rb")))
    return source, find_zone(source, zone[1])


def _blocks(source: BinaryFile, place: ZonePlace) -> Iterator[ElementBlock]:
    return element_blocks(source, place, place.cells, place.dim, CELLS)
