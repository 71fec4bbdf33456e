"""The binary form of an SU2 text mesh: an SU2 binary mesh, written piece by piece.

The place of a number in a text is known only after reading all before it; in a binary it is
computed. So parts of a text mesh are read from its binary form. Only the boundary is ever in memory
as a whole, and every mistake of the text is found, as by its reader.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from slideviz.argument_types import record
from slideviz.formats.su2.lines import Piece
from slideviz.formats.su2.loops import count_types
from slideviz.formats.su2.numbers import (
    fill_cells,
    fill_points,
    parse_cells,
    require_all_coordinates,
)
from slideviz.formats.su2.text import Text
from slideviz.formats.su2b.layout import NAME_BYTES, ElementTable, ZonePlace
from slideviz.formats.su2b.write import LARGEST_4, SORTED, marker_table, padded, rows_of
from slideviz.mesh.check import LARGEST, too_large, within
from slideviz.mesh.elements import SIZES
from slideviz.mesh.model import Cells, IntArray
from slideviz.system.cleanup import open_temporary
from slideviz.system.platform import open_unlinked, write_at
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, cuts, equal_shares, ordered_map

HEAD = 8  # bytes before the first zone
PIECES = 16  # pieces of a text, each about a megabyte, in one task
_Task = tuple[str, int, int]
"""``cells`` or ``points``, index of the first piece, and of the one after the last."""


@record
class BinaryLayout:
    """The layout of the binary form (`su2b.layout`) of a text mesh: where each part begins."""

    text: Text  # the text mesh
    before: IntArray
    """(p + 1, t): number of elements of each type before each of the p pieces, and in the last row
    of all. Types are in the order of ``SORTED``."""
    named: bool  # whether the file gets the names of the markers; else numbers, which always fit
    conn: np.dtype  # of counts and indices
    point: np.dtype  # of a point: its coordinates and its index
    place: ZonePlace  # where each part of the zone begins, without its markers
    markers: int  # first byte of the markers


_WIDTHS = SIZES[list(SORTED)] + 2
"""How many numbers an element has in the list, by type in the order of ``SORTED``."""


def binary_layouts(texts: Sequence[Text], *, is_result: bool) -> list[BinaryLayout]:
    """Return the layouts of the binary form of a text mesh, one for each of its zones.

    ``is_result``: whether the binary is made for users, as by `slideviz.convert`: with the markers'
    names and 8 bytes for each index. If not, markers have numbers, and indices 4 bytes where they
    fit.
    """
    tables = [_counted(text) for text in texts]
    lengths = [int(before[-1] @ _WIDTHS) for before in tables]
    short = max(*lengths, *(text.n_points for text in texts)) <= LARGEST_4 and not is_result
    width = 4 if short else 8
    begin = HEAD
    layouts: list[BinaryLayout] = []
    for number, (text, before, length) in enumerate(zip(texts, tables, lengths, strict=True), 1):
        dim = text.zone.dim
        conn = np.dtype(f"<u{width}")
        point = np.dtype([("x", "<f8", (dim,)), ("i", conn)])
        offsets = begin + 8 + width
        entries = offsets + width * (text.n_cells + 1)
        points = entries + width * (length + 1)
        markers = points + text.n_points * point.itemsize
        sizes = (
            NAME_BYTES + width * (2 + sum(2 * piece.rows + piece.nodes for piece in marker.rows))
            for marker in text.zone.markers
        )
        table = ElementTable(text.n_cells, offsets, entries, length, numbered=True)
        end = markers + 4 + sum(sizes)
        place = ZonePlace(number, begin, end, dim, table, text.n_points, points, ())
        layouts.append(BinaryLayout(text, before, is_result, conn, point, place, markers))
        begin = end
    return layouts


def _counted(text: Text) -> IntArray:
    """Return how many elements of each type are before each piece (`BinaryLayout.before`)."""
    pieces = text.zone.elements
    rows = text.n_cells
    before = np.zeros((len(pieces) + 1, len(SORTED)), np.int64)
    out = before[1:]
    # The types with fewest and most nodes: if all elements are one of these, the total tells it.
    for vtk in (5, 9) if text.zone.dim == 2 else (10, 12):
        if sum(piece.nodes for piece in pieces) == rows * SIZES[vtk]:
            out[:, SORTED.index(vtk)] = np.cumsum([piece.rows for piece in pieces])
            return before

    def count(piece: Piece) -> IntArray:
        counts = np.zeros(257, np.int64)
        count_types(np.frombuffer(text.lines.text(piece), np.uint8), counts)
        return counts[list(SORTED)]

    np.cumsum(list(ordered_map(count, pieces)), axis=0, out=out)
    return before


def write_layouts(
    layouts: Sequence[BinaryLayout], path: Path, progress: Tick, ranks: SerialPool = SERIAL
) -> None:
    """Write the binary form of a text into a temporary file, which is made if there is none.

    Its head comes last. Raises MeshError if the text has a mistake; the message has its line.
    """
    with open_temporary(path, new=True) as file:
        file.truncate(layouts[-1].place.end)
        for layout, share in zip(layouts, equal_shares(progress, len(layouts)), strict=True):
            _write_layout(layout, path, share, ranks)
        file.write(np.array([layouts[0].conn.itemsize, len(layouts)], "<i4").tobytes())


def _write_layout(layout: BinaryLayout, path: Path, progress: Tick, ranks: SerialPool) -> None:
    text = layout.text
    conn = layout.conn
    place = layout.place
    zone = text.zone
    lines = text.lines
    tasks: list[_Task] = [
        (kind, first, end)
        for kind, pieces in (("cells", zone.elements), ("points", zone.points))
        for first, end in cuts(0, len(pieces), PIECES)
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
    names = (m.name if layout.named else str(k) for k, m in enumerate(zone.markers))
    markers = [
        padded(name.encode()) + marker_table(cells, conn)
        for name, cells in zip(names, facets, strict=True)
    ]
    lines.raw.require_same()
    with open_temporary(path) as file:
        for at, content in (
            (place.begin, np.array([place.number, zone.dim], "<i4").tobytes()),
            (place.begin + 8, np.array(text.n_cells, conn).tobytes()),
            (place.cells.entries - conn.itemsize, np.array(place.cells.length, conn).tobytes()),
            (place.points - conn.itemsize, np.array(text.n_points, conn).tobytes()),
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
    out = open_unlinked(path, os.O_WRONLY)

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
    table = layout.place.cells
    size = layout.conn.itemsize
    piece = text.zone.elements[k]
    types = np.empty(piece.rows, np.uint8)
    nodes = np.empty(piece.nodes, np.int64)
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
        rows = rows_of(some.types, some.connectivity, piece.row + mine)
        offsets = start + width * np.arange(len(mine))
        write_at(out, offsets.astype(layout.conn), table.offsets + row * size)
        write_at(out, rows.astype(layout.conn), table.entries + start * size)
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
    block["x"] = points
    block["i"] = np.arange(piece.row, piece.row + piece.rows)
    write_at(out, block, layout.place.points + piece.row * layout.point.itemsize)
    return filled
