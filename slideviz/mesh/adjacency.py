"""Adjacency: the cell on the other side of each side of a cell, and the cells around each node.

Sides of cells are numbered cell by cell, in the order of `ElementType.facets`: the side ``k`` of
cell ``c`` has the number ``first[c] + k``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, IntArray, offsets_of, sealed
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import weak_cache

NONE = -1
SEVERAL = -2
"""In place of a neighbour: there is no other cell, or more than one (a non-manifold mesh)."""

SIDES = np.zeros(256, np.int64)  # number of sides of an element type, by VTK identifier
SIDE_NODES = np.full((256, 6, 4), -1)
"""Local nodes of each side, filled up with -1, by VTK identifier."""
for _row in ELEMENTS.values():
    SIDES[_row.vtk] = len(_row.facets)
    for _k, _local in enumerate(_row.facets):
        SIDE_NODES[_row.vtk, _k, : len(_local)] = _local


@record
class Sides:
    """The sides of all cells."""

    first: IntArray  # (m + 1,): number of the first side of each cell
    neighbour: NDArray[np.int32]
    """(s,) int32: the cell that shares the side, or `NONE` or `SEVERAL`."""


@record
class CellsAround:
    """The cells that each node belongs to, in ascending order."""

    offsets: IntArray  # (n + 1,): the entries of node i are offsets[i] to offsets[i + 1]
    cells: NDArray[np.int32]  # (k,) int32: the cell of each entry
    local: NDArray[np.int8]  # (k,) int8: the local number of the node in that cell


@weak_cache
def sides_of(cells: Cells) -> Sides:
    """Return the sides of cells with their neighbours, cached as long as the cells live."""
    first = offsets_of(SIDES[cells.types])
    n_nodes = int(cells.connectivity.max(initial=-1)) + 1
    owner = np.repeat(np.arange(len(cells)), np.diff(first))
    table = cells.types, cells.offsets, cells.connectivity, SIDE_NODES, first, owner
    least = np.empty(first[-1], np.int64)
    in_parts(lambda part: _write_least(*table, part.start, part.stop, least), len(least))
    begins = np.zeros(n_nodes + 1, np.int64)
    order = np.empty(first[-1], np.int64)
    _sort(least, begins, order)
    neighbour = np.full(first[-1], NONE, np.int32)
    in_parts(lambda part: _match(*table, begins, order, part.start, part.stop, neighbour), n_nodes)
    return Sides(sealed(first), sealed(neighbour))


def cells_around(cells: Cells, n_points: int) -> CellsAround:
    """Return the cells of each of ``n_points`` nodes; not cached, for it takes much memory."""
    offsets = np.zeros(n_points + 1, np.int64)
    count = len(cells.connectivity)
    owner = np.empty(count, np.int32)
    local = np.empty(count, np.int8)
    _write_around(cells.connectivity, cells.offsets, offsets, owner, local)
    return CellsAround(sealed(offsets), sealed(owner), sealed(local))


@njit
def _count(keys, ends):  # type: ignore[no-untyped-def]
    """Write where each of the integers ``keys`` (k,) begins in their order, to ``ends`` (n + 1,).

    It is one place further on: `_place` moves each to its end, which is where the next begins.
    """
    for key in keys:
        if key + 2 < len(ends):
            ends[key + 2] += 1
    for key in range(2, len(ends)):
        ends[key] += ends[key - 1]


@njit(inline="always")
def _place(key, ends):  # type: ignore[no-untyped-def]
    """Return the next place of a key in the order."""
    at = ends[key + 1]
    ends[key + 1] = at + 1
    return at


@njit
def _sort(keys, begins, order):  # type: ignore[no-untyped-def]
    """Write the stable order (k,) of integers ``keys`` (k,), and where each begins, (n + 1,)."""
    _count(keys, begins)
    for k in range(len(keys)):
        order[_place(keys[k], begins)] = k


@njit
def _write_around(connectivity, offsets, begins, owner, local):  # type: ignore[no-untyped-def]
    """Write the arrays of `CellsAround`; ``begins`` are its offsets."""
    _count(connectivity, begins)
    for cell in range(len(offsets) - 1):
        for k in range(offsets[cell], offsets[cell + 1]):
            at = _place(connectivity[k], begins)
            owner[at] = cell
            local[at] = k - offsets[cell]


@njit(inline="always")
def _nodes_of(types, offsets, connectivity, locals_, first, owner, side):  # type: ignore[no-untyped-def]
    """Return the nodes of a side, ascending; before those of a line or a triangle are -1."""
    cell = owner[side]
    row = locals_[types[cell], side - first[cell]]
    begin = offsets[cell]
    a = connectivity[begin + row[0]]
    b = connectivity[begin + row[1]]
    c = connectivity[begin + row[2]] if row[2] >= 0 else -1
    d = connectivity[begin + row[3]] if row[3] >= 0 else -1
    a, b = min(a, b), max(a, b)
    c, d = min(c, d), max(c, d)
    a, c = min(a, c), max(a, c)
    b, d = min(b, d), max(b, d)
    return a, min(b, c), max(b, c), d


@njit
def _write_least(types, offsets, connectivity, locals_, first, owner, begin, end, least):  # type: ignore[no-untyped-def]
    """Write the least node of each side from ``begin`` to ``end`` into ``least`` (s,)."""
    for side in range(begin, end):
        a, b, c, _ = _nodes_of(types, offsets, connectivity, locals_, first, owner, side)
        if a < 0:
            a = b if b >= 0 else c
        least[side] = a


@njit
def _match(types, offsets, connectivity, locals_, first, owner, begins, order, begin, end, found):  # type: ignore[no-untyped-def]
    """Write the neighbours ``found`` (s,) of all sides whose least node is in a range."""
    most = 0
    for node in range(begin, end):
        most = max(most, begins[node + 1] - begins[node])
    keys = np.empty((most, 4), np.int64)
    for node in range(begin, end):
        start = begins[node]
        count = begins[node + 1] - start
        for i in range(count):
            keys[i] = _nodes_of(
                types, offsets, connectivity, locals_, first, owner, order[start + i]
            )
        for i in range(count):
            for j in range(count):
                same = i != j and keys[i, 0] == keys[j, 0] and keys[i, 1] == keys[j, 1]
                if same and keys[i, 2] == keys[j, 2] and keys[i, 3] == keys[j, 3]:
                    side = order[start + i]
                    other = owner[order[start + j]]
                    found[side] = other if found[side] == NONE else SEVERAL
