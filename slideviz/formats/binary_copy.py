"""The binary form of an SU2 text mesh: an SU2 binary mesh, written piece by piece.

The place of a number in a text is known only after reading all before it; in a binary it is
computed. So parts of a text mesh are read from its binary form. Only the boundary is ever in memory
as a whole, and every mistake of the text is found, as by its reader.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from slideviz.formats.su2.lines import Piece, number_of
from slideviz.formats.su2.numbers import (
    fill_cells,
    fill_points,
    parse_cells,
    require_all_coordinates,
)
from slideviz.formats.su2.text import Text
from slideviz.formats.su2b.layout import NAME_BYTES
from slideviz.formats.su2b.write import LARGEST_4, SORTED, marker_table, padded, rows_of, write_at
from slideviz.mesh.check import LARGEST, too_large, within
from slideviz.mesh.elements import SIZES
from slideviz.mesh.model import Cells, IntArray
from slideviz.system.cleanup import open_temporary
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, equal_shares, ordered_map

HEAD = 8  # bytes before the first zone
PIECES = 16  # pieces of a text, each about a megabyte, in one task
_Task = tuple[str, int, int]
"""``cells`` or ``points``, index of the first piece, and of the one after the last."""


@dataclass(frozen=True, eq=False)
class BinaryLayout:
    """The layout of the binary form (`su2b.layout`) of a text mesh: where each part begins."""

    text: Text  # the text mesh
    before: IntArray
    """(p + 1, t): number of elements of each type before each of the p pieces, and in the last row
    of all. Types are in the order of ``SORTED``."""
    named: bool  # whether the file gets the names of the markers; else numbers, which always fit
    width: int = 8  # bytes of a count or an index, 4 or 8
    begin: int = HEAD  # first byte of its zone
    number: int = 1  # number of its zone

    @property
    def conn(self) -> np.dtype:
        """Return the data type of counts and indices."""
        return np.dtype(f"<u{self.width}")

    @property
    def point(self) -> np.dtype:
        """Return the data type of a point: its coordinates and its index."""
        return np.dtype([("x", "<f8", (self.text.zone.dim,)), ("i", self.conn)])

    @property
    def offsets(self) -> int:
        """Return the first byte of the offsets of the elements."""
        return self.begin + 8 + self.width

    @property
    def entries(self) -> int:
        """Return the first byte of the list of the elements (type, nodes, index of each)."""
        return self.offsets + self.width * (self.text.n_cells + 1)

    @property
    def length(self) -> int:
        """Return how many numbers the list of the elements has."""
        return int(self.before[-1] @ _WIDTHS)

    @property
    def points(self) -> int:
        """Return the first byte of the points."""
        return self.entries + self.width * (self.length + 1)

    @property
    def markers(self) -> int:
        """Return the offset of the first byte of the markers."""
        return self.points + self.text.n_points * self.point.itemsize

    @property
    def end(self) -> int:
        """Return the end of the zone, which is the size of the file if it is the last."""
        sizes = (
            NAME_BYTES + self.width * (2 + 2 * piece_rows + nodes)
            for piece_rows, nodes in (
                (number_of(m.rows), sum(piece.nodes for piece in m.rows))
                for m in self.text.zone.markers
            )
        )
        return self.markers + 4 + sum(sizes)

    def names(self) -> list[bytes]:
        """Return the names of the markers as bytes of the file, filled up to ``NAME_BYTES``."""
        markers = self.text.zone.markers
        return [padded((m.name if self.named else str(k)).encode()) for k, m in enumerate(markers)]


_WIDTHS = SIZES[list(SORTED)] + 2
"""How many numbers an element has in the list, by type in the order of ``SORTED``."""


def binary_layouts(texts: Sequence[Text], *, is_result: bool) -> list[BinaryLayout]:
    """Return the layouts of the binary form of a text mesh, one for each of its zones.

    ``is_result``: whether the binary is made for users, as by `slideviz.convert`: with the markers'
    names and 8 bytes for each index. If not, markers have numbers, and indices 4 bytes where they
    fit.
    """
    layouts: list[BinaryLayout] = []
    for text in texts:
        before = np.zeros((len(text.zone.elements) + 1, len(SORTED)), np.int64)
        np.cumsum(_counted(text), axis=0, out=before[1:])
        layouts.append(BinaryLayout(text, before, is_result))
    largest = max(max(one.length, one.text.n_points) for one in layouts)
    width, begin = 4 if not is_result and largest <= LARGEST_4 else 8, HEAD
    for k, one in enumerate(layouts):
        layouts[k] = replace(one, width=width, begin=begin, number=k + 1)
        begin = layouts[k].end
    return layouts


def _counted(text: Text) -> IntArray:
    """Return the number (p, t) of elements of each type (as ``SORTED``) in each piece."""
    from slideviz.formats.su2.loops import count_types

    pieces, rows = text.zone.elements, text.n_cells
    out = np.zeros((len(pieces), len(SORTED)), np.int64)
    # The types with fewest and most nodes: if all elements are one of these, the total tells it.
    for vtk in (5, 9) if text.zone.dim == 2 else (10, 12):
        if sum(piece.nodes for piece in pieces) == rows * SIZES[vtk]:
            out[:, SORTED.index(vtk)] = [piece.rows for piece in pieces]
            return out

    def count(piece: Piece) -> IntArray:
        counts = np.zeros(257, np.int64)
        count_types(np.frombuffer(text.lines.text(piece), np.uint8), counts)
        return counts[list(SORTED)]

    out[:] = list(ordered_map(count, pieces))
    return out


def write_layouts(
    layouts: Sequence[BinaryLayout], path: Path, progress: Tick, ranks: SerialPool = SERIAL
) -> bytes:
    """Write the binary form of a text into an existing file of its size, but for the file's head.

    Returns the head (``HEAD`` bytes), which the caller writes. Raises MeshError if the text has a
    mistake; the message has its line.
    """
    for layout, share in zip(layouts, equal_shares(progress, len(layouts)), strict=True):
        _write_layout(layout, path, share, ranks)
    return np.array([layouts[0].width, len(layouts)], "<i4").tobytes()


def _write_layout(layout: BinaryLayout, path: Path, progress: Tick, ranks: SerialPool) -> None:
    text, conn = layout.text, layout.conn
    zone, lines = text.zone, text.lines
    tasks: list[_Task] = [
        (kind, first, min(first + PIECES, len(pieces)))
        for kind, pieces in (("cells", zone.elements), ("points", zone.points))
        for first in range(0, len(pieces), PIECES)
    ]
    missing: list[IntArray] = []
    with ranks.sharing(_layout_tasks, layout, path, ranks.size > 1) as do:
        for k, (task, lost) in enumerate(zip(tasks, do(tasks), strict=True)):
            if task[0] == "points":
                missing.append(lost)
            progress((k + 1) / len(tasks))
    require_all_coordinates(lines, zone.points, zone.dim, np.concatenate(missing))
    facets = (
        parse_cells(lines, m.rows, zone.dim - 1, text.n_points, lambda _: None)
        for m in zone.markers
    )
    names = layout.names()
    markers = [name + marker_table(c, conn) for name, c in zip(names, facets, strict=True)]
    lines.raw.require_same()
    with open_temporary(path) as file:
        for at, content in (
            (layout.begin, np.array([layout.number, zone.dim], "<i4").tobytes()),
            (layout.begin + 8, np.array(text.n_cells, conn).tobytes()),
            (layout.entries - layout.width, np.array(layout.length, conn).tobytes()),
            (layout.points - layout.width, np.array(text.n_points, conn).tobytes()),
            (layout.markers, np.array(len(markers), "<i4").tobytes() + b"".join(markers)),
        ):
            file.seek(at)
            file.write(content)


@contextmanager
def _layout_tasks(
    layout: BinaryLayout, path: Path, synced: bool
) -> Iterator[Callable[[_Task], IntArray]]:
    """Context with a function that writes the pieces of a task and returns their results.

    These are the results of `_write_cells` or `_write_points`, (k, ...). ``synced`` is whether the
    bytes are on the disk when the function returns.
    """
    out = os.open(path, os.O_WRONLY | os.O_NOFOLLOW)

    def work(task: _Task) -> IntArray:
        kind, first, end = task
        put = _write_cells if kind == "cells" else _write_points
        written = list(ordered_map(partial(put, layout, out), range(first, end)))
        if synced:
            os.fsync(out)
        return np.array(written)

    try:
        yield work
    finally:
        os.close(out)


def _write_cells(layout: BinaryLayout, out: int, k: int) -> int:
    """Write the elements of piece ``k``, sorted by type, to file descriptor ``out``; return 0."""
    text = layout.text
    piece = text.zone.elements[k]
    types, nodes = np.empty(piece.rows, np.uint8), np.empty(piece.nodes, np.int64)
    fill_cells(text.lines, piece, types, nodes, dim=text.zone.dim, n_points=text.n_points)
    cells = Cells.from_types(types, nodes)
    totals = layout.before[-1]
    for column, (vtk, width) in enumerate(zip(SORTED, _WIDTHS.tolist(), strict=True)):
        mine = np.flatnonzero(types == vtk)
        if not len(mine):
            continue
        before = int(layout.before[k, column])
        row = int(totals[:column].sum()) + before
        start = int(totals[:column] @ _WIDTHS[:column]) + before * width
        some = cells if len(mine) == len(types) else cells.take(mine)
        table = rows_of(some.types, some.connectivity, piece.row + mine)
        offsets = start + width * np.arange(len(mine))
        write_at(out, layout.offsets + row * layout.width, offsets.astype(layout.conn))
        write_at(out, layout.entries + start * layout.width, table.astype(layout.conn))
    return 0


def _write_points(layout: BinaryLayout, out: int, k: int) -> IntArray:
    """Write the points of piece ``k`` to the file descriptor ``out``; return as `fill_points`.

    Raises MeshError if a coordinate is too large.
    """
    text = layout.text
    piece = text.zone.points[k]
    points = np.empty((piece.rows, text.zone.dim))
    filled = fill_points(text.lines, piece, points)
    if not within(points, LARGEST):
        at = int(np.argmax((np.abs(points) > LARGEST).any(axis=1)))
        raise too_large(text.lines.name, piece.row + at, points[at])
    block = np.empty(piece.rows, layout.point)
    block["x"], block["i"] = points, np.arange(piece.row, piece.row + piece.rows)
    write_at(out, layout.points + piece.row * layout.point.itemsize, block)
    return filled
