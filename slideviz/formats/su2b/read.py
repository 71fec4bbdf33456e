"""Reading SU2 binary meshes (``.su2b``), block by block.

With the mesh is kept what is needed to write the file again. A *place* is the number of an element
in the file, which is not its index if the file has another order. Errors name the byte of a
mistake.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError, printable
from slideviz.formats.su2b.layout import MAGIC, BinaryFile, ElementTable, ZonePlace, find_zones
from slideviz.mesh.check import first_fault
from slideviz.mesh.elements import DIMS, ELEMENTS, SIZES
from slideviz.mesh.interfaces import find_interfaces, points_of_nodes
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, Origin, frozen_array
from slideviz.mesh.zones import join_zones
from slideviz.system.threads import Tick, equal_shares

BLOCK = 1 << 18  # most elements or points that are read at a time


@record
class ElementBlock:
    """Consecutive elements of a file."""

    first: int  # place of the first element
    types: NDArray[np.uint8]  # (k,): VTK identifiers
    nodes: IntArray  # (n,): nodes of all elements, one after the other
    ids: IntArray  # (k,): index of each element; empty where elements have none (in markers)


def element_blocks(
    source: BinaryFile, place: ZonePlace, table: ElementTable, dim: int, size: int = BLOCK
) -> Iterator[ElementBlock]:
    """Yield a table's elements, of dimension ``dim``, in blocks; MeshError as `element_block`."""
    for first in range(0, table.count, size):
        yield element_block(source, place, table, dim, first, size)
    if not table.count:
        require_used(source, table, 0)


def element_block(
    source: BinaryFile, place: ZonePlace, table: ElementTable, dim: int, first: int, size: int
) -> ElementBlock:
    """Return at most ``size`` elements of a table, of dimension ``dim``, from place ``first`` on.

    Raises MeshError if an element has a wrong offset, type, dimension or node; the message has the
    byte.
    """
    width = source.width
    count = min(size, table.count - first)
    at = table.offsets + first * width
    offsets = _whole_numbers(source.array(at, count + 1, source.conn, "the offsets"))
    start = int(offsets[0]) if first else 0
    steps = np.diff(offsets)
    wrong = (steps <= 0) | (offsets[1:] > table.length) | (offsets[:-1] < start)
    if wrong.any() or int(offsets[0]) != start or start < 0:
        k = 0 if int(offsets[0]) != start or start < 0 else int(np.argmax(wrong)) + 1
        raise source.error(
            at + k * width,
            f"the offset of element {first + k} is {int(offsets[k]) % 2**64}, which must be "
            f"{'0' if first + k == 0 else 'above the one before it'} and at most "
            f"{table.length}, the last; the file is damaged, so write the mesh again",
        )
    begin = table.entries + start * width
    numbers = source.array(begin, int(offsets[-1]) - start, source.conn, "the elements")
    block = _split_list(source, table, first, begin, _whole_numbers(numbers), offsets - start)
    _check_nodes(source, place, block, begin, offsets - start)
    _check_dim(source, block, dim, begin, offsets - start)
    if first + count == table.count:
        require_used(source, table, int(offsets[-1]))
    return block


def require_used(source: BinaryFile, table: ElementTable, used: int) -> None:
    """Raise MeshError if the list of a table has not as many numbers as its elements use."""
    if used != table.length:
        raise source.error(
            table.entries + used * source.width,
            f"the list of elements has {table.length} numbers, of which the elements use {used}; "
            "the file is damaged, so write the mesh again",
        )


def _whole_numbers(values: NDArray) -> IntArray:
    """Return unsigned counts (k,) as int64; those that are too large for it become negative."""
    return np.asarray(values.astype(np.uint64, copy=False).view(np.int64))


def _split_list(
    source: BinaryFile,
    table: ElementTable,
    first: int,
    begin: int,
    numbers: IntArray,
    offsets: IntArray,
) -> ElementBlock:
    """Return the elements in a part of a list; raise MeshError for a wrong type or length.

    ``first`` and ``begin``: place of the first element, and the byte where the part begins.
    ``numbers`` (n,): the part of the list. ``offsets`` (k + 1,): where each element begins in
    ``numbers``, and the end.
    """
    types = numbers[offsets[:-1]]
    known = (types > 0) & (types < 256)
    sizes = np.where(known, SIZES[np.where(known, types, 0)], 0)
    steps = np.diff(offsets)
    wrong = (sizes == 0) | (steps != sizes + 1 + table.numbered)
    if wrong.any():
        k = int(np.argmax(wrong))
        at = begin + int(offsets[k]) * source.width
        if not sizes[k]:
            allowed = ", ".join(f"{t} ({e.name})" for t, e in ELEMENTS.items() if e.dim)
            raise source.error(
                at,
                f"element {first + k} has the type {int(types[k]) % 2**64}, which is not supported "
                f"(supported: {allowed}); export the mesh with these",
            )
        row = ELEMENTS[int(types[k])]
        raise source.error(
            at,
            f"element {first + k} has {steps[k]} numbers, but a {row.name} has {row.n_nodes} "
            f"nodes and {2 if table.numbered else 1} more; write the mesh again",
        )
    ids = numbers[offsets[1:] - 1] if table.numbered else numbers[:0]
    if (steps == steps[0]).all():
        nodes = numbers.reshape(len(types), -1)[:, 1 : 1 + int(sizes[0])].ravel()
    else:
        keep = np.ones(len(numbers), bool)
        keep[offsets[:-1]] = False
        if table.numbered:
            keep[offsets[1:] - 1] = False
        nodes = numbers[keep]
    return ElementBlock(first, types.astype(np.uint8), nodes, ids)


def _check_nodes(
    source: BinaryFile, place: ZonePlace, block: ElementBlock, begin: int, offsets: IntArray
) -> None:
    """Raise MeshError if a block has a node that does not exist; arguments as in `_split_list`."""
    wrong = block.nodes.view(np.uint64) >= place.n_points
    if not wrong.any():
        return
    at = int(np.argmax(wrong))
    ends = np.cumsum(SIZES[block.types])
    k = int(np.searchsorted(ends, at, "right"))
    column = at - int(ends[k]) + int(SIZES[block.types[k]])
    raise source.error(
        begin + (int(offsets[k]) + 1 + column) * source.width,
        f"element {block.first + k} has the node {int(block.nodes[at]) % 2**64}, but the "
        f"{place.n_points} points are numbered from 0 to {place.n_points - 1}; correct the element "
        "or the points",
    )


def _check_dim(
    source: BinaryFile, block: ElementBlock, dim: int, begin: int, offsets: IntArray
) -> None:
    wrong = DIMS[block.types] != dim
    if wrong.any():
        k = int(np.argmax(wrong))
        row = ELEMENTS[int(block.types[k])]
        raise source.error(
            begin + int(offsets[k]) * source.width,
            f"element {block.first + k} is a {row.name} (type {row.vtk}, dimension {row.dim}), but "
            f"dimension {dim} is needed here; correct the element or the dimension of its zone",
        )


@record
class BinaryForm(Origin):
    """The form of the ``.su2b`` file that a mesh was read from, to write it the same way."""

    ending = ".su2b"
    width: int  # bytes of an index, 4 or 8
    byte_order: Literal["<", ">"]  # little or big endian
    before: bytes
    after: bytes
    """`before`, `after`: the file before and after the zone: its head and the other zones; empty
    where all zones were read."""
    order: IntArray | None
    """(m,): index of the cell at each place of the file; None where each is at its place."""
    names: tuple[bytes, ...]  # names of the markers with the bytes that pad them
    cells: Cells  # the cells as read


def read_su2b(path: Path, zone: int | None, progress: Tick) -> Mesh:
    """Return one zone of an SU2 binary mesh, or all of them as one mesh.

    Raises MeshError if the file has a mistake; the message has its byte; and OSError if it cannot
    be read. ``zone``: the zone, from 1; None for all. ``progress``: called with the fraction done;
    may raise to stop.
    """
    with path.open("rb") as file:
        source = BinaryFile(path, file)
        places = find_zones(source, zone)
        alone = len(places) == 1
        meshes = [
            _read_zone(source, place, path, share, alone=alone)
            for place, share in zip(places, equal_shares(progress, len(places)), strict=True)
        ]
    return join_zones(meshes)


def _read_zone(
    source: BinaryFile, place: ZonePlace, path: Path, progress: Tick, *, alone: bool
) -> Mesh:
    """Return a zone; ``alone``: with its interfaces to the other zones, and these themselves."""
    whole = place.cells.count + place.n_points + sum(m.elements.count for m in place.markers)
    done = 0

    def tick(count: int) -> None:
        nonlocal done
        done += count
        progress(min(1.0, done / max(whole, 1)))

    cells, order = read_elements(source, place, place.cells, place.dim, tick)
    points = np.empty((place.n_points, place.dim))
    for first, block in point_blocks(source, place):
        points[first : first + len(block)] = block
        tick(len(block))
    markers = read_markers(source, place, tick)
    form = BinaryForm(
        source.width,
        source.order,
        source.bytes(0, place.begin) if alone else b"",
        source.bytes(place.end, source.size) if alone else b"",
        order,
        tuple(marker.raw for marker in place.markers),
        cells,
    )
    points.flags.writeable = False
    mesh = Mesh(
        points=points,
        cells=cells,
        markers=markers,
        name=printable(path.name),
        zone=place.number,
        zones=source.zones,
        source=path.resolve(),
        origin=form,
    )
    others = list(boundaries_elsewhere(source, place)) if alone else []
    return replace(mesh, interfaces=find_interfaces(mesh, others))


def read_markers(
    source: BinaryFile, place: ZonePlace, tick: Callable[[int], None] = lambda _: None
) -> tuple[Marker, ...]:
    """Return the markers of a zone; ``tick`` is called with the number of elements of a block."""
    return tuple(
        Marker(m.name, read_elements(source, place, m.elements, place.dim - 1, tick)[0])
        for m in place.markers
    )


def boundaries_elsewhere(
    source: BinaryFile, place: ZonePlace
) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield zone, name and nodes (k, d) of each boundary of other zones, as far as readable."""
    for zone in find_zones(source):
        if zone.number == place.number:
            continue
        try:
            markers = read_markers(source, zone) if zone.dim == place.dim else ()
            nodes = {marker.name: marker.nodes for marker in markers if len(marker.cells)}
            points = points_of_nodes(point_blocks(source, zone) if nodes else (), nodes)
        except MeshError:  # the zone that is asked for can be right all the same
            continue
        for name, some in points.items():
            yield zone.number, name, some


def point_blocks(source: BinaryFile, place: ZonePlace) -> Iterator[tuple[int, FloatArray]]:
    """Yield the points of a zone in blocks: number of the first point, and coordinates (k, d).

    Raises MeshError if a coordinate is not finite, or a point has another index than its place.
    """
    for first in range(0, place.n_points, BLOCK):
        yield first, point_block(source, place, first, BLOCK)


def point_block(source: BinaryFile, place: ZonePlace, first: int, size: int) -> FloatArray:
    """Return the coordinates (k, d) of the points from number ``first`` on, at most ``size``.

    Raises MeshError if a coordinate is not finite, or a point has another index than its place.
    """
    kind = source.point(place.dim)
    count = min(size, place.n_points - first)
    at = place.points + first * kind.itemsize
    block = source.array(at, count, kind, "the points")
    wrong = block["i"] != np.arange(first, first + count, dtype=np.uint64)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise source.error(
            at + k * kind.itemsize + 8 * place.dim,
            f"point {first + k} has the index {block['i'][k]}; points are numbered from 0 in "
            "the order of the file, so write the mesh again",
        )
    points = block["x"].astype(np.float64)
    bad = ~np.isfinite(points)
    if bad.any():
        k, axis = np.argwhere(bad)[0].tolist()
        raise source.error(
            at + k * kind.itemsize + 8 * axis,
            f"point {first + k} has the coordinate {points[k, axis]}, which is not finite; "
            "correct it or mesh again",
        )
    return points


def read_elements(
    source: BinaryFile, place: ZonePlace, table: ElementTable, dim: int, tick: Callable[[int], None]
) -> tuple[Cells, IntArray | None]:
    """Return the elements of a table in the order of their indices, and the order of the file.

    That is the index (m,) of the element at each place, or None where each is at its place. Raises
    MeshError as `element_block`, or if indices are not each number below m once. ``tick`` is called
    with the number of elements of each block.
    """
    # Filled block by block, so that they are in memory only once.
    types = np.empty(table.count, np.uint8)
    flat = np.empty(table.length - (1 + table.numbered) * table.count, np.int64)
    order = np.empty(table.count if table.numbered else 0, np.int64)
    filled = 0
    for block in element_blocks(source, place, table, dim):
        part = slice(block.first, block.first + len(block.types))
        types[part] = block.types
        flat[filled : filled + len(block.nodes)] = block.nodes
        order[part] = block.ids
        filled += len(block.nodes)
        tick(len(block.types))
    types.flags.writeable = flat.flags.writeable = False
    cells = Cells.from_types(types, flat)
    fault = first_fault(cells, place.n_points)
    if fault:
        at = table.entries + (int(cells.offsets[fault[0]]) + fault[0] * (1 + table.numbered)) * (
            source.width
        )
        raise source.error(at, f"element {fault[0]}: {fault[1]}")
    if not table.numbered or np.array_equal(order, np.arange(table.count)):
        return cells, None
    _check_order(source, table, cells, order)
    return sorted_back(cells, order), frozen_array(order, np.int64)


def _check_order(source: BinaryFile, table: ElementTable, cells: Cells, order: IntArray) -> None:
    inside = order.view(np.uint64) < len(order)
    first = np.full(len(order), len(order))
    np.minimum.at(first, order[inside], np.flatnonzero(inside))
    wrong = ~inside
    wrong[inside] = first[order[inside]] != np.flatnonzero(inside)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise source.error(
            table.entries + (int(cells.offsets[k + 1]) + 2 * k + 1) * source.width,
            f"element {k} has the index {int(order[k]) % 2**64}, which is not below the number of "
            f"elements, {len(order)}, or occurs twice; write the mesh again",
        )


def sorted_back(cells: Cells, order: IntArray) -> Cells:
    """Return cells in the order of their indices, ``order`` (m,) being the index of each."""
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    return cells.take(place)


def is_su2b(path: Path) -> bool:
    """Return whether a file begins as an SU2 binary mesh does; or raise OSError."""
    with path.open("rb") as file:
        return file.read(4) in MAGIC
