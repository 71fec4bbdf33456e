"""Elements and points from the lines of an SU2 file, with the place of every mistake."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.check import first_fault
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.io.su2_scan import BLOCK_BYTES, Lines, Progress, show, word_bounds
from slideviz.mesh.model import Cells, FloatArray, IntArray

_SIZES = np.zeros(256, np.int64)
_DIMS = np.zeros(256, np.int64)
for _row in ELEMENTS.values():
    _SIZES[_row.vtk], _DIMS[_row.vtk] = _row.n_nodes, _row.dim

_SUPPORTED = ", ".join(str(vtk) for vtk, row in ELEMENTS.items() if row.dim > 0)
# VTK's quadratic and higher-order elements, and SU2's own identifiers: 100 more per degree.
_HIGH_ORDER = (*range(21, 38), *range(60, 82))
_LONE_SIGN = re.compile(rb"[+-](?![0-9])")
_EXTRA_POINT_WORDS = 2
"""After the coordinates: the index, and in partitioned files the global index."""


def _parse(text: bytes, kind: type) -> NDArray | None:
    """Return the numbers in the text, or None when some word is no number.

    The conversion of floats is that of Python: correctly rounded.
    """
    # NumPy takes a lone sign for 0, or joins it to the next word.
    if kind is np.int64 and (b"-" in text or b"+" in text) and _LONE_SIGN.search(text):
        return None
    try:
        return np.fromstring(text, kind, sep=" ")
    except ValueError:
        return None


def _row_blocks(lines: Lines, rows: IntArray) -> Iterator[tuple[int, int, int, int]]:
    """Yield ``(i, j, begin, end)``: the rows ``i:j`` lie in the bytes ``begin:end``."""
    begins, ends = lines.starts[rows], lines.starts[rows + 1]
    i = 0
    while i < len(rows):
        j = max(i + 1, int(np.searchsorted(begins, begins[i] + BLOCK_BYTES)))
        yield i, j, int(begins[i]), int(ends[j - 1])
        i = j


def parse_rows(lines: Lines, rows: IntArray, kind: type, progress: Progress) -> NDArray:
    """Return all numbers of the rows, (w,) of dtype ``kind``.

    Parameters
    ----------
    rows : (r,) int64
        Line numbers; the lines between them are blank or comments.
    kind : type
        ``np.int64`` or ``np.float64``.
    progress : callable
        Called with the fraction done after each block; may raise to stop.

    Raises
    ------
    MeshError
        A word is not such a number.
    """
    bounds = np.concatenate(([0], np.cumsum(lines.words[rows])))
    values = np.empty(bounds[-1], kind)
    for i, j, begin, end in _row_blocks(lines, rows):
        found = _parse(lines.clean[begin:end], kind)
        if found is None or len(found) != bounds[j] - bounds[i]:
            _blame_word(lines, rows[i:j], kind)
        values[bounds[i] : bounds[j]] = found
        progress(j / len(rows))
    return values


def _blame_word(lines: Lines, rows: IntArray, kind: type) -> None:
    """Raise for the first word of the rows that is not one number."""
    what = "a whole number" if kind is np.int64 else "a number"
    for row in rows.tolist():
        for word in lines.line(row).split():
            found = _parse(word, kind)
            if found is None or len(found) != 1:
                raise lines.error(row, f"'{show(word)}' stands where {what} should be; correct it")


def parse_cells(lines: Lines, rows: IntArray, dim: int, n_points: int, progress: Progress) -> Cells:
    """Return the elements of the rows: type, nodes, and perhaps an index that is ignored.

    Parameters
    ----------
    rows : (r,) int64
        Line numbers, one element each.
    dim : int
        The dimension that the elements must have.
    n_points : int
        Node indices must be below this.

    Raises
    ------
    MeshError
        An element is not what it should be; the message has its line.
    """
    flat = parse_rows(lines, rows, np.int64, progress)
    words = lines.words[rows]
    first = np.cumsum(words) - words
    types = flat[first]
    _check_types(lines, rows, types, dim)
    sizes = _SIZES[types]
    extra = words - 1 - sizes
    wrong = (extra < 0) | (extra > 1)
    if wrong.any():
        k = int(np.argmax(wrong))
        row = ELEMENTS[int(types[k])]
        raise lines.error(
            rows[k],
            f"a {row.name} (type {row.vtk}) has {row.n_nodes} nodes and perhaps an index, but "
            f"{words[k] - 1} numbers follow the type; correct the type or the nodes",
        )
    keep = np.repeat(first + 1 - (np.cumsum(sizes) - sizes), sizes)
    keep += np.arange(len(keep))
    cells = Cells.from_types(types, flat[keep])
    fault = first_fault(cells, n_points)
    if fault:
        raise lines.error(rows[fault[0]], fault[1])
    return cells


def _check_types(lines: Lines, rows: IntArray, types: IntArray, dim: int) -> None:
    """Raise for the first element that has an unknown type or the wrong dimension."""
    inside = np.clip(types, 0, 255)
    wrong = (inside != types) | (_SIZES[inside] == 0) | (_DIMS[inside] != dim)
    if not wrong.any():
        return
    k = int(np.argmax(wrong))
    vtk = int(types[k])
    if vtk in ELEMENTS:
        allowed = ", ".join(f"{t} ({e.name})" for t, e in ELEMENTS.items() if e.dim == dim)
        raise lines.error(
            rows[k],
            f"element type {vtk} ({ELEMENTS[vtk].name}) has dimension {ELEMENTS[vtk].dim}, but "
            f"dimension {dim} is needed here: {allowed}; correct the element or NDIME",
        )
    message = f"element type {vtk} is not supported (supported: {_SUPPORTED})"
    if vtk in _HIGH_ORDER or vtk > 100:
        message += "; it is a high-order element and slideviz needs linear elements, so export the"
        message += " mesh with linear elements"
    else:
        message += "; export the mesh with these"
    raise lines.error(rows[k], message)


def parse_points(
    lines: Lines, rows: IntArray, dim: int, progress: Progress
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the coordinates (n, dim), and the first byte and end of each, (n, dim) both.

    Raises
    ------
    MeshError
        A point is not what it should be; the message has its line.
    """
    flat = parse_rows(lines, rows, np.float64, progress)
    words = lines.words[rows]
    wrong = (words < dim) | (words > dim + _EXTRA_POINT_WORDS)
    column = np.cumsum(words) - words
    # Where other lines end with an index, a line that has just enough numbers and also ends with
    # its index has lost a coordinate.
    if len(words) and words.max() > dim:
        ends_with_index = flat[column + words - 1] == np.arange(len(rows))
        wrong |= (words == dim) & ends_with_index
    if wrong.any():
        k = int(np.argmax(wrong))
        raise lines.error(
            rows[k],
            f"a point has {dim} coordinates (NDIME= {dim}) and perhaps an index, but "
            f"{words[k]} numbers stand here; correct the line or NDIME",
        )
    column = column[:, None] + np.arange(dim)
    points = flat[column]
    if not np.isfinite(points).all():
        k, axis = np.argwhere(~np.isfinite(points))[0].tolist()
        word = lines.line(rows[k]).split()[axis]
        raise lines.error(
            rows[k], f"the coordinate {show(word)} is not finite; correct it or mesh again"
        )
    begins, ends = np.empty_like(column), np.empty_like(column)
    base = 0
    for i, j, begin, end in _row_blocks(lines, rows):
        bounds = word_bounds(np.frombuffer(lines.clean[begin:end], np.uint8))
        begins[i:j] = begin + bounds[0][column[i:j] - base]
        ends[i:j] = begin + bounds[1][column[i:j] - base]
        base += len(bounds[0])
    return points, begins, ends
