"""The skin of a mesh: its boundary and the cells at it, read from a file without the rest.

Roles, periodic pairs, classification, the choice of control nodes and their weights are found by
the boundary alone. So the skin is an ordinary mesh, with fewer nodes and cells, whose order is
that of the whole. It has the outermost nodes too, by which the extent is the same.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from slideviz.mesh.check import LARGEST, first_fault, printable
from slideviz.mesh.io.su2b import chosen_zone, point_blocks, read_elements
from slideviz.mesh.io.su2b_elements import Block, element_blocks, taken
from slideviz.mesh.io.su2b_layout import Source, ZonePlace, find_zones
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, Part, frozen_array

Tick = Callable[[float], object]


def read_skin(path: Path, zone: int | None, progress: Tick = lambda _: None) -> Mesh:
    """Return the skin of a zone of an SU2 binary mesh; the whole of it is read and checked.

    Raises
    ------
    MeshError
        The file has a mistake; the message has its byte.
    OSError
        It cannot be read.
    """
    with path.open("rb") as file:
        source = Source(path, file)
        zones = find_zones(source)
        place = chosen_zone(path, zones, zone)
        markers = [
            Marker(
                m.name, read_elements(source, place, m.elements, place.dim - 1, lambda _: None)[0]
            )
            for m in place.markers
        ]
        used = np.zeros(place.n_points, bool)
        for marker in markers:
            used[marker.nodes] = True
        cells, ids = _cells_at(source, place, used, lambda done: progress(0.6 * done))
        used[cells.connectivity] = True
        numbers, points = _points_of(
            source, place, np.flatnonzero(used), lambda done: progress(0.6 + 0.4 * done)
        )
    return Mesh(
        points,
        _renumbered(cells, numbers),
        tuple(Marker(m.name, _renumbered(m.cells, numbers)) for m in markers),
        name=printable(path.name),
        zone=place.number,
        zones=len(zones),
        source=path.resolve(),
        part=Part(
            frozen_array(numbers, np.int64),
            frozen_array(ids, np.int64),
            place.n_points,
            place.cells.count,
        ),
    )


def _cells_at(
    source: Source, place: ZonePlace, on: np.ndarray, tick: Tick
) -> tuple[Cells, IntArray]:
    """Return the cells that may have a side on the boundary ``on`` (n,) bool, and their numbers."""
    kept: list[tuple[Cells, IntArray]] = []
    seen = np.zeros(place.cells.count, bool)
    for block in element_blocks(source, place, place.cells, place.dim):
        cells = Cells.from_types(block.types, block.nodes)
        _check_block(source, place, block, cells, seen)
        near = np.add.reduceat(on[block.nodes], cells.offsets[:-1], dtype=np.int64)
        chosen = np.flatnonzero(near >= place.dim)
        kept.append((taken(cells, chosen), block.ids[chosen]))
        tick((block.first + len(block.types)) / place.cells.count)
    if not kept:
        return Cells.from_blocks([]), np.empty(0, np.int64)
    types = np.concatenate([cells.types for cells, _ in kept])
    nodes = np.concatenate([cells.connectivity for cells, _ in kept])
    ids = np.concatenate([part for _, part in kept])
    order = np.argsort(ids, kind="stable")
    return taken(Cells.from_types(types, nodes), order), ids[order]


def _check_block(
    source: Source, place: ZonePlace, block: Block, cells: Cells, seen: np.ndarray
) -> None:
    """Raise where a cell of a block has a node or an index twice; note the indices ``seen``."""
    fault = first_fault(cells, place.n_points)
    k = -1 if fault is None else fault[0]
    message = "" if fault is None else fault[1]
    inside = block.ids.view(np.uint64) < len(seen)
    seen_before = np.zeros(len(inside), bool)
    seen_before[inside] = seen[block.ids[inside]]
    _, first, count = np.unique(block.ids, return_index=True, return_counts=True)
    wrong = ~inside | seen_before
    if wrong.any() or (count > 1).any():
        k = int(np.argmax(wrong)) if wrong.any() else int(first[np.argmax(count)])
        message = (
            f"its index {int(block.ids[k]) % 2**64} is not below the number of elements, "
            f"{len(seen)}, or stands twice; write the mesh again"
        )
    if k >= 0:
        at = source.count(place.cells.offsets + (block.first + k) * source.width, "an offset")
        raise source.error(
            place.cells.entries + at * source.width, f"element {block.first + k}: {message}"
        )
    seen[block.ids] = True


def _points_of(
    source: Source, place: ZonePlace, numbers: IntArray, tick: Tick
) -> tuple[IntArray, FloatArray]:
    """Return the numbers of nodes with the outermost ones among them, and their points (k, d)."""
    found = np.empty((len(numbers), place.dim))
    outer: dict[tuple[int, str], tuple[int, FloatArray]] = {}
    for first, block in point_blocks(source, place):
        a, b = np.searchsorted(numbers, [first, first + len(block)])
        found[a:b] = block[numbers[a:b] - first]
        for axis in range(place.dim):
            for side, at in (("low", block[:, axis].argmin()), ("high", block[:, axis].argmax())):
                old = outer.get((axis, side))
                sign = -1.0 if side == "low" else 1.0
                if old is None or sign * block[at, axis] > sign * old[1][axis]:
                    outer[axis, side] = first + int(at), block[at].copy()
        tick((first + len(block)) / max(place.n_points, 1))
    for (axis, _), (node, point) in outer.items():
        if abs(point[axis]) > LARGEST:
            raise source.error(
                place.points + node * source.point(place.dim).itemsize + 8 * axis,
                f"point {node} is at {tuple(point.tolist())}; nothing can be computed with "
                f"coordinates larger than {LARGEST:g}, so correct it or scale the mesh",
            )
    more = dict(outer.values())
    extra = np.setdiff1d(np.array(list(more), np.int64), numbers)
    every = np.concatenate([numbers, extra])
    points = np.concatenate([found, np.array([more[n] for n in extra]).reshape(-1, place.dim)])
    order = np.argsort(every)
    return every[order], points[order]


def _renumbered(cells: Cells, numbers: IntArray) -> Cells:
    """Return cells with the places of their nodes in ``numbers`` (k,)."""
    return Cells.from_types(cells.types, np.searchsorted(numbers, cells.connectivity))
