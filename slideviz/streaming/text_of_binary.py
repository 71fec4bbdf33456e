"""The SU2 text of an SU2 binary mesh with other points, made without the whole mesh in memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from slideviz.formats.su2.write import text_of_parts
from slideviz.formats.su2b.elements import element_blocks, elements_between
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace
from slideviz.formats.su2b.read import read_elements
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker
from slideviz.streaming.measuring import Scratch
from slideviz.streaming.skin import index_of

NEAR = 256
"""Elements with at most so many others between them are read in one piece."""


def text_of_binary(
    source: BinaryFile, place: ZonePlace, after: BinaryFile, folder: Path
) -> Iterator[bytes]:
    """Yield one zone of an SU2 binary mesh as an SU2 text, with the points in ``after``.

    Parameters
    ----------
    source, place
        The binary mesh, and the zone in it.
    after : BinaryFile
        A file with the new points where ``source`` has the old ones.
    folder : Path
        Where a scratch file is made if the cells are not in order in the binary file.
    """
    kind = source.point(place.dim)

    def points(i: int, j: int) -> FloatArray:
        rows = after.array(place.points + i * kind.itemsize, j - i, kind, "the points")
        return np.ascontiguousarray(rows["x"], np.float64)

    with ExitStack() as stack:
        where = _places(stack, source, place, folder)

        def cells(i: int, j: int) -> Cells:
            if where is None:
                block = elements_between(source, place, place.cells, place.dim, i, j - i)
                return Cells.from_types(block.types, block.nodes)
            return _gathered(source, place, where[i:j])

        markers = tuple(
            Marker(
                m.name, read_elements(source, place, m.elements, place.dim - 1, lambda _: None)[0]
            )
            for m in place.markers
        )
        yield from text_of_parts(
            place.dim, (place.cells.count, cells), (place.n_points, points), markers
        )


def _places(
    stack: ExitStack, source: BinaryFile, place: ZonePlace, folder: Path
) -> IntArray | None:
    """Return the place of each cell among the elements of a file (m,); None where all are in order.

    They are in a scratch file in ``folder``, removed when ``stack`` closes.
    """
    scratch: Scratch | None = None
    for block in element_blocks(source, place, place.cells, place.dim):
        here = slice(block.first, block.first + len(block.ids))
        ids = index_of(block.ids)
        if scratch is None and not (isinstance(ids, slice) and ids == here):
            scratch = Scratch(stack, folder, place.cells.count, np.int64)
            scratch.array[: block.first] = np.arange(block.first)
        if scratch is not None:
            scratch.array[ids] = np.arange(here.start, here.stop)
            scratch.release()
    return None if scratch is None else scratch.array


def _gathered(source: BinaryFile, place: ZonePlace, where: IntArray) -> Cells:
    """Return the elements at the places ``where`` (k,), in that order."""
    ordered = np.sort(where)
    cuts = np.flatnonzero(np.diff(ordered) > NEAR) + 1
    types, flats = [], []
    for part in np.split(ordered, cuts):
        first, count = int(part[0]), int(part[-1] - part[0]) + 1
        block = elements_between(source, place, place.cells, place.dim, first, count)
        some = Cells.from_types(block.types, block.nodes).take(part - first)
        types.append(some.types)
        flats.append(some.connectivity)
    found = Cells.from_types(np.concatenate(types), np.concatenate(flats))
    return found.take(np.searchsorted(ordered, where))
