"""Reading elements of an SU2 binary mesh, block by block; errors name the byte of a mistake.

A file has a *list*, one array with type, nodes and index of each element one after the other, and
the offset of each element in it. A *place* is the number of an element in the file, which is not
its index if the file has another order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slideviz.formats.su2b.layout import BinaryFile, ElementTable, ZonePlace
from slideviz.mesh.elements import DIMS, ELEMENTS, SIZES
from slideviz.mesh.model import IntArray

BLOCK = 1 << 18
"""Most elements or points that are read at a time."""


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Consecutive elements of a file."""

    first: int
    """Place of the first element."""
    types: NDArray[np.uint8]
    """(k,): VTK identifiers."""
    nodes: IntArray
    """(n,): nodes of all elements, one after the other."""
    ids: IntArray
    """(k,): index of each element; empty where elements have none (in markers)."""


def element_blocks(
    source: BinaryFile, place: ZonePlace, table: ElementTable, dim: int, size: int = BLOCK
) -> Iterator[ElementBlock]:
    """Yield the elements of a table, of dimension ``dim``, in blocks of at most ``size``.

    Raises MeshError as `element_block` does.
    """
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
    width, count = source.width, min(size, table.count - first)
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

    Parameters
    ----------
    first, begin : int
        Place of the first element, and the byte where the part begins.
    numbers : (n,)
        The part of the list.
    offsets : (k + 1,)
        Where each element begins in ``numbers``, and the end.
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
    """Raise MeshError if a block has an element whose dimension is not ``dim``."""
    wrong = DIMS[block.types] != dim
    if wrong.any():
        k = int(np.argmax(wrong))
        row = ELEMENTS[int(block.types[k])]
        raise source.error(
            begin + int(offsets[k]) * source.width,
            f"element {block.first + k} is a {row.name} (type {row.vtk}, dimension {row.dim}), but "
            f"dimension {dim} is needed here; correct the element or the dimension of its zone",
        )
