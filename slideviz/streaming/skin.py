"""The skin of a mesh: its boundary and the cells at it, read without keeping the rest in memory.

Roles, periodic pairs, classification, the choice of control nodes and their weights depend on
the boundary alone. So they are found by the skin: an ordinary mesh with fewer nodes and cells, in
the order of the whole one. It also has the nodes of lowest and highest coordinates, so that its
extent is that of the whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError, printable
from slideviz.formats.su2.lines import boxes_elsewhere
from slideviz.formats.su2.text import Text
from slideviz.formats.su2.text import boundaries_elsewhere as text_boundaries_elsewhere
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace, open_zones
from slideviz.formats.su2b.read import (
    BLOCK,
    ElementBlock,
    boundaries_elsewhere,
    element_block,
    point_block,
    read_markers,
    require_used,
)
from slideviz.mesh.check import LARGEST, first_fault
from slideviz.mesh.interfaces import find_interfaces
from slideviz.mesh.model import (
    Assembly,
    Cells,
    FloatArray,
    Index,
    IntArray,
    Marker,
    Mesh,
    Origin,
    Part,
    Skin,
    mask_of,
    sealed,
)
from slideviz.mesh.zones import join_zones
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, equal_shares, progress_share


@contextmanager
def naming_text(text: Text, path: Path) -> Iterator[None]:
    """Context in which a `MeshError` on the binary file ``path`` names the text it was made of."""
    try:
        yield
    except MeshError as problem:
        names = {printable(path): text.lines.name}
        raise MeshError(
            *(
                replace(message, place=tuple(names.get(str(part), part) for part in message.place))
                for message in problem.messages
            )
        ) from problem


T = TypeVar("T")


def read_skin(
    path: Path,
    zone: int | None,
    progress: Tick = lambda _: None,
    ranks: SerialPool = SERIAL,
    texts: Sequence[Text] = (),
) -> Mesh:
    """Return the skin of one zone of an SU2 binary mesh, or of all as one mesh.

    The whole file is read and checked. Raises MeshError if it has a mistake; the message has its
    byte; and OSError if it cannot be read.
    ``zone``: the zone, from 1; None for all.
    ``texts``: of the zones of a text mesh, where ``path`` is its binary copy: names, zones and
    source are then those of the text.
    """
    with open_zones(path, zone) as (source, places):
        shares = equal_shares(progress, len(places))
        skins: list[Mesh] = [
            _skin_of_zone(source, place, path, share, ranks)
            for place, share in zip(places, shares, strict=True)
        ]
        others = [] if len(places) > 1 or texts else list(boundaries_elsewhere(source, places[0]))
    if texts:
        skins = [_of_text(skin, text) for skin, text in zip(skins, texts, strict=True)]
        others = list(text_boundaries_elsewhere(texts[0], progress)) if len(texts) == 1 else []
    return join_zones([replace(one, interfaces=find_interfaces(one, others)) for one in skins])


def _of_text(skin: Mesh, text: Text) -> Mesh:
    """Return the skin of a zone with names, zone and source of the text that it is a copy of."""
    zone = text.zone
    markers = zip(skin.markers, zone.markers, strict=True)
    return replace(
        skin,
        markers=tuple(replace(marker, name=original.name) for marker, original in markers),
        name=printable(text.path.name),
        zone=zone.bounds.number,
        zones=zone.bounds.zones,
        source=text.path.resolve(),
        remarks=zone.remarks,
        origin=Origin(
            ffd=text.boxes(),
            ffd_at=zone.ffd_at,
            ffd_elsewhere=boxes_elsewhere(text.sections, zone.bounds),
        ),
    )


def _skin_of_zone(
    source: BinaryFile, place: ZonePlace, path: Path, progress: Tick, ranks: SerialPool
) -> Skin:
    markers = read_markers(source, place)
    used = np.zeros(place.n_points, bool)
    for marker in markers:
        used[marker.nodes] = True
    nodes = np.flatnonzero(used)
    with ranks.sharing(_boundary_cell_reader, path, place.number, nodes) as do:
        tasks = range(0, place.cells.count, BLOCK)
        blocks = _ticking(do(tasks), progress_share(progress, 0.0, 0.6), len(tasks))
        cells, ids = _join_boundary_cells(source, place, blocks)
    used[cells.connectivity] = True
    numbers = np.flatnonzero(used)
    with ranks.sharing(_point_reader, path, place.number) as do:
        starts = range(0, place.n_points, BLOCK)
        ends = np.searchsorted(numbers, [*starts, place.n_points])
        parts = [
            (first, numbers[a:b]) for first, a, b in zip(starts, ends[:-1], ends[1:], strict=True)
        ]
        found = _ticking(do(parts), progress_share(progress, 0.6), len(parts))
        numbers, points = _join_points(source, place, numbers, found)
    return Skin(
        points,
        _renumbered(cells, numbers),
        tuple(Marker(m.name, _renumbered(m.cells, numbers)) for m in markers),
        name=printable(path.name),
        zone=place.number,
        zones=source.zones,
        source=path.resolve(),
        part=Part(sealed(numbers), sealed(ids), place.n_points, place.cells.count),
    )


def without_cells(skin: Mesh) -> Mesh:
    """Return a skin without its cells and the elements of its boundaries, to save memory."""
    none = Cells.from_blocks([])
    markers = tuple(replace(marker, cells=none) for marker in skin.markers)
    bare = replace(skin, cells=none, markers=markers)
    if not isinstance(bare, Assembly):
        return bare
    parts = tuple(replace(one, mesh=without_cells(one.mesh)) for one in bare.parts)
    return replace(bare, parts=parts)


def _ticking(results: Iterator[T], tick: Tick, count: int) -> Iterator[T]:
    """Yield ``count`` results, and tick after each."""
    for k, result in enumerate(results, 1):
        tick(k / count)
        yield result


@record
class _BoundaryCells:
    """Cells of a block of the file that may have a side on the boundary."""

    first: int  # place in the file of the block's first cell
    cells: Cells  # the k cells that may have a side on the boundary
    ids: IntArray  # (k,): their numbers
    all_ids: Index  # slice or (b,): the numbers of all cells of the block


@contextmanager
def _boundary_cell_reader(
    path: Path, zone: int, boundary: IntArray
) -> Iterator[Callable[[int], _BoundaryCells]]:
    """Context with a function that reads one block of cells and returns those near the boundary.

    ``boundary`` (k,) are the boundary's nodes; the function's argument is the place of the block's
    first cell.
    """
    with open_zones(path, zone) as (source, (place,)):
        on_boundary = mask_of(place.n_points, boundary)

        def read(first: int) -> _BoundaryCells:
            block = element_block(source, place, place.cells, place.dim, first, BLOCK)
            cells = Cells.from_types(block.types, block.nodes)
            _check_block(source, place, block, cells)
            near = np.add.reduceat(on_boundary[block.nodes], cells.offsets[:-1], dtype=np.int64)
            chosen = np.flatnonzero(near >= place.dim)
            return _BoundaryCells(first, cells.take(chosen), block.ids[chosen], index_of(block.ids))

        yield read


def index_of(ids: IntArray) -> Index:
    """Return ids (k,) as a slice if they are consecutive, which indexes faster; else as given."""
    first = int(ids[0])
    if np.array_equal(ids, np.arange(first, first + len(ids))):
        return slice(first, first + len(ids))
    return ids


def _join_boundary_cells(
    source: BinaryFile, place: ZonePlace, found: Iterator[_BoundaryCells]
) -> tuple[Cells, IntArray]:
    """Return the cells that may have a side on the boundary, ordered by their numbers, and these.

    Raises MeshError if two blocks have a cell of the same number.
    """
    blocks: list[_BoundaryCells] = []
    seen = np.zeros(place.cells.count, bool)
    for near in found:
        if seen[near.all_ids].any():
            k = int(np.argmax(seen[near.all_ids]))
            ids = near.all_ids
            index = ids.start + k if isinstance(ids, slice) else int(ids[k])
            raise _repeated_index_error(source, place, near.first + k, index)
        seen[near.all_ids] = True
        blocks.append(near)
    if not blocks:
        require_used(source, place.cells, 0)
        return Cells.from_blocks([]), np.empty(0, np.int64)
    numbers = np.concatenate([near.ids for near in blocks])
    order = np.argsort(numbers, kind="stable")
    return Cells.joined([near.cells for near in blocks]).take(order), numbers[order]


def _check_block(source: BinaryFile, place: ZonePlace, block: ElementBlock, cells: Cells) -> None:
    """Raise MeshError if a cell of a block has wrong nodes, or an index out of range or used twice.

    ``cells`` are those of ``block``.
    """
    if not np.array_equal(block.ids, np.arange(block.first, block.first + len(block.ids))):
        wrong = block.ids.view(np.uint64) >= place.cells.count
        _, first, count = np.unique(block.ids, return_index=True, return_counts=True)
        if wrong.any() or (count > 1).any():
            k = int(np.argmax(wrong)) if wrong.any() else int(first[np.argmax(count)])
            raise _repeated_index_error(source, place, block.first + k, int(block.ids[k]))
    fault = first_fault(cells, place.n_points)
    if fault is not None:
        raise _cell_error(source, place, block.first + fault[0], fault[1])


def _repeated_index_error(
    source: BinaryFile, place: ZonePlace, element: int, index: int
) -> MeshError:
    return _cell_error(
        source,
        place,
        element,
        f"its index {index % 2**64} is not below the number of elements, {place.cells.count}, or "
        f"occurs twice; write the mesh again",
    )


def _cell_error(source: BinaryFile, place: ZonePlace, element: int, message: str) -> MeshError:
    at = source.count(place.cells.offsets + element * source.width, "an offset")
    return source.error(place.cells.entries + at * source.width, f"element {element}: {message}")


PointBlock = tuple[FloatArray, IntArray, FloatArray]
"""Points (k, d) of a block of the file; numbers (o,), ascending, and points (o, d) of those of the
block with the lowest and highest coordinates."""


@contextmanager
def _point_reader(path: Path, zone: int) -> Iterator[Callable[[tuple[int, IntArray]], PointBlock]]:
    """Context with a function that reads one block of points.

    Its argument is the number of the block's first point, and ascending nodes (k,) in the block.
    """
    with open_zones(path, zone) as (source, (place,)):

        def read(task: tuple[int, IntArray]) -> PointBlock:
            first, nodes = task
            block = point_block(source, place, first, BLOCK)
            outer = np.unique([block.argmin(axis=0), block.argmax(axis=0)])
            return block[nodes - first], first + outer, block[outer]

        yield read


def _join_points(
    source: BinaryFile, place: ZonePlace, numbers: IntArray, found: Iterator[PointBlock]
) -> tuple[IntArray, FloatArray]:
    """Return ``numbers`` with those of the outermost points of all, sorted, and the points (k, d).

    ``found`` are the results of `_point_reader` for the blocks in order.
    """
    if not place.n_points:
        return numbers, np.empty((0, place.dim))
    points, nodes, places = map(np.concatenate, zip(*found, strict=True))
    # Of several at one place the first, as in a block.
    outermost = np.stack([places.argmin(axis=0), places.argmax(axis=0)], axis=1)
    for (axis, _), k in np.ndenumerate(outermost):
        if abs(places[k, axis]) > LARGEST:
            raise source.error(
                place.points + int(nodes[k]) * source.point(place.dim).itemsize + 8 * axis,
                f"point {nodes[k]} is at {tuple(places[k].tolist())}; nothing can be computed with "
                f"coordinates larger than {LARGEST:g}, so correct it or scale the mesh",
            )
    few = np.unique(outermost)
    few = few[~np.isin(nodes[few], numbers)]
    every = np.concatenate([numbers, nodes[few]])
    order = np.argsort(every, kind="stable")  # nearly in order already
    return every[order], np.concatenate([points, places[few]])[order]


def _renumbered(cells: Cells, numbers: IntArray) -> Cells:
    """Return cells whose nodes are replaced by their indices in ``numbers`` (k,), ascending."""
    return Cells.from_types(cells.types, np.searchsorted(numbers, cells.connectivity))
