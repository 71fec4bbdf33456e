"""Elements and points from the rows of an SU2 file; errors name the line of a mistake.

`su2.loops` reads plain rows; those that it leaves are read here, or are the mistakes.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.formats.su2.lines import Lines, Piece, Rows, number_of, show
from slideviz.formats.su2.loops import cell_block, point_block
from slideviz.mesh.check import first_fault, no_node
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, FloatArray, IntArray
from slideviz.system.threads import Result, Tick, ordered_map

_SUPPORTED = ", ".join(str(vtk) for vtk, row in ELEMENTS.items() if row.dim > 0)
"""The element types, for messages."""
# VTK's quadratic and higher-order elements, and SU2's own identifiers: 100 more per degree.
_HIGH_ORDER = (*range(21, 38), *range(60, 82))
_LONE_SIGN = re.compile(rb"[+-](?![0-9])")
_DIGITS = 18  # most digits of a whole number that surely fits into 64 bits
_EXTRA_POINT_WORDS = 2
"""Most numbers after the coordinates: the index, and in partitioned files the global index."""


def parse_cells(lines: Lines, rows: Rows, dim: int, n_points: int, progress: Tick) -> Cells:
    """Parse elements, one per row: type, nodes, and an optional index, which is ignored.

    Raises MeshError if an element has a wrong type, dimension or nodes; the message has its line.
    ``rows``: the rows, with one element each.
    ``dim``: the dimension that the elements must have.
    ``n_points``: node indices must be below this.
    ``progress``: called with the fraction done after each block; may raise to stop.
    """
    types = np.empty(number_of(rows), np.uint8)
    nodes = np.empty(rows[-1].node + rows[-1].nodes if rows else 0, np.int64)

    def parsed(piece: Piece) -> None:
        mine = types[piece.row : piece.row + piece.rows]
        flat = nodes[piece.node : piece.node + piece.nodes]
        fill_cells(lines, piece, mine, flat, dim=dim, n_points=n_points)

    _each(parsed, rows, progress)
    nodes.flags.writeable = False
    return Cells.from_types(types, nodes)


def fill_cells(
    lines: Lines,
    piece: Piece,
    types: NDArray[np.uint8],
    nodes: IntArray,
    *,
    dim: int,
    n_points: int,
) -> None:
    """Write the m elements of a piece into ``types`` (m,) and ``nodes`` (k,).

    Raises MeshError if an element has a wrong type, dimension or nodes; the message has its line.
    """
    text = lines.text(piece)
    odd = np.empty((piece.rows, 3), np.int64)
    found, n_odd = cell_block(np.frombuffer(text, np.uint8), dim, n_points, types, nodes, odd)
    if found != piece.rows:
        raise lines.raw.changed()
    for row, begin, node in odd[:n_odd].tolist():
        vtk, its = _element(*_line_at(lines, piece, text, begin), dim, n_points)
        types[row] = vtk
        nodes[node : node + len(its)] = its


def _each(work: Callable[[Piece], Result], rows: Rows, progress: Tick) -> list[Result]:
    results = []
    for piece, result in zip(rows, ordered_map(work, rows), strict=True):
        results.append(result)
        progress((piece.row + piece.rows) / number_of(rows))
    return results


def _line_at(lines: Lines, piece: Piece, text: bytes, begin: int) -> tuple[Lines, int, bytes]:
    """Return ``lines``, and number and text without comment of the line from byte ``begin`` on.

    ``text`` is the text of the piece, and ``begin`` counted in it.
    """
    stop = text.index(b"\n", begin)
    return lines, piece.line + text.count(b"\n", 0, begin), text[begin:stop].partition(b"%")[0]


def _element(lines: Lines, index: int, row: bytes, dim: int, n_points: int) -> tuple[int, IntArray]:
    """Return type and nodes of the element on a row; ``index`` is the number of its line.

    Raises MeshError if it has a wrong type, dimension or nodes, or a word that is not an integer.
    """
    numbers = _numbers(lines, index, row, np.int64)
    words = row.split()
    vtk = int(numbers[0])
    n_numbers = len(numbers) - 1
    if vtk not in ELEMENTS or ELEMENTS[vtk].dim != dim:
        raise _wrong_type(lines, index, vtk, dim, show(words[0]))
    kind = ELEMENTS[vtk]
    if n_numbers not in (kind.n_nodes, kind.n_nodes + 1):
        raise lines.error(
            index,
            f"a {kind.name} (type {vtk}) has {kind.n_nodes} nodes and perhaps an index, but "
            f"{n_numbers} numbers follow the type; correct the type or the nodes",
        )
    nodes = numbers[1 : 1 + kind.n_nodes]
    fault = first_fault(Cells.from_types([vtk], nodes), n_points)
    if fault:
        # A word with more digits may have been read as another number: the message has the word.
        large = (word for word in words[1 : 1 + kind.n_nodes] if len(word.lstrip(b"+-0")) > _DIGITS)
        word = next(large, None)
        raise lines.error(index, fault[1] if word is None else no_node(show(word), n_points))
    return vtk, nodes


def _wrong_type(lines: Lines, index: int, vtk: int, dim: int, word: str) -> MeshError:
    if vtk in ELEMENTS:
        allowed = ", ".join(f"{t} ({e.name})" for t, e in ELEMENTS.items() if e.dim == dim)
        return lines.error(
            index,
            f"element type {vtk} ({ELEMENTS[vtk].name}) has dimension {ELEMENTS[vtk].dim}, but "
            f"dimension {dim} is needed here: {allowed}; correct the element or NDIME",
        )
    message = f"element type {word} is not supported (supported: {_SUPPORTED})"
    if vtk in _HIGH_ORDER or vtk > 100:
        message += "; it is a high-order element and slideviz needs linear elements, so export the"
        message += " mesh with linear elements"
    else:
        message += "; export the mesh with these"
    return lines.error(index, message)


def _numbers(lines: Lines, index: int, row: bytes, kind: type) -> NDArray:
    """Return the numbers (w,) of a row, int64 or float64; MeshError for any other word."""
    words = row.split()
    numbers = []
    for word in words:
        number = _parse(word, kind)
        if number is None or len(number) != 1:
            what = "a whole number" if kind is np.int64 else "a number"
            raise lines.error(index, f"expected {what}, found '{show(word)}'; correct it")
        numbers.append(number)
    return np.concatenate(numbers)


def _parse(text: bytes, kind: type) -> NDArray | None:
    """Return the numbers (w,) of a text, correctly rounded, or None if a word is not a number."""
    # NumPy takes a lone sign for 0, or joins it to the next word.
    if kind is np.int64 and (b"-" in text or b"+" in text) and _LONE_SIGN.search(text):
        return None
    try:
        return np.fromstring(text, kind, sep=" ")
    except ValueError:
        return None


def parse_points(lines: Lines, rows: Rows, dim: int, progress: Tick) -> FloatArray:
    """Return the coordinates (n, dim) of the points on rows, read-only.

    Raises MeshError if a row has too few or many numbers, or one that is not finite; the message
    has its line.
    """
    points = np.empty((number_of(rows), dim))

    def parsed(piece: Piece) -> IntArray:
        return fill_points(lines, piece, points[piece.row : piece.row + piece.rows])

    require_all_coordinates(lines, rows, dim, np.array(_each(parsed, rows, progress)))
    points.flags.writeable = False
    return points


def fill_points(lines: Lines, piece: Piece, points: FloatArray) -> IntArray:
    """Write the coordinates of the m points of a piece into ``points`` (m, d).

    Returns (2,) int64: the largest count of numbers on a row, and the number of the first row that
    may lack a coordinate (``extra`` of `loops.point_block`), the largest int64 if there is none.
    Raises MeshError if a row has too few or many numbers, or one that is not finite.
    """
    text = lines.text(piece)
    dim = points.shape[1]
    odd = np.empty((piece.rows, 2), np.int64)
    extra = np.array([0, np.iinfo(np.int64).max])
    n_rows, n_odd = point_block(
        np.frombuffer(text, np.uint8), piece.row, points.view(np.uint64), extra, odd
    )
    if n_rows != piece.rows:
        raise lines.raw.changed()
    for row, begin in odd[:n_odd].tolist():
        numbers = _point(*_line_at(lines, piece, text, begin), dim)
        points[row] = numbers[:dim]
        extra[0] = max(extra[0], len(numbers))
        if len(numbers) == dim and numbers[-1] == piece.row + row:
            extra[1] = min(extra[1], piece.row + row)
    return extra


def require_all_coordinates(lines: Lines, rows: Rows, dim: int, found: IntArray) -> None:
    """Raise if a point lacks a coordinate, by the results (p, 2) of `fill_points` for p pieces.

    If some rows have an index after their coordinates, a row with only ``dim`` numbers lacks a
    coordinate: its last number is the index. Raises MeshError if a point lacks a coordinate; the
    message has its line.
    """
    lost = int(found[:, 1].min())
    if found[:, 0].max() > dim and lost < number_of(rows):
        raise _wrong_count(lines, lines.row(rows, lost), dim, dim)


def _point(lines: Lines, index: int, row: bytes, dim: int) -> FloatArray:
    """Return the numbers of a row with a point, coordinates first; ``index`` is that of its line.

    Raises MeshError if it has too few or many numbers, or a coordinate that is not finite.
    """
    numbers = _numbers(lines, index, row, np.float64)
    if not dim <= len(numbers) <= dim + _EXTRA_POINT_WORDS:
        raise _wrong_count(lines, index, len(numbers), dim)
    for word, number in zip(row.split()[:dim], numbers, strict=False):
        if not np.isfinite(number):
            raise lines.error(
                index, f"the coordinate {show(word)} is not finite; correct it or mesh again"
            )
    return numbers


def _wrong_count(lines: Lines, index: int, count: int, dim: int) -> MeshError:
    return lines.error(
        index,
        f"a point has {dim} coordinates (NDIME= {dim}) and perhaps an index, but this line has "
        f"{count} numbers; correct the line or NDIME",
    )
