"""Compiled loops over the text of SU2 files, which find lines, read numbers and write rows.

They read plain rows only. A row with anything else (a sign before a node, a wrong type, a word that
is not a number, a number that is not finite) is *left*: only listed, so that `su2.numbers` reads it
in Python.

``text`` is an array of bytes, (b,) uint8, that ends with a line break; ``offset`` is an index into
it.
"""

from __future__ import annotations

import numpy as np

from slideviz.formats.su2 import KEYWORD, ROWS, TEXT
from slideviz.formats.su2.decimal import U10, U48, decimal, ends
from slideviz.mesh.elements import ELEMENTS
from slideviz.system.jit_cache import njit

SIZES = np.zeros(257, np.int64)
"""Number of nodes by element type, 0 for no type; the last entry is for all numbers above 255."""
DIMS = np.full(257, -1)  # dimension by element type, likewise; -1 for no type
for _row in ELEMENTS.values():
    SIZES[_row.vtk] = _row.n_nodes
    DIMS[_row.vtk] = _row.dim


@njit(inline="always")
def _print_whole(value, out, offset):  # type: ignore[no-untyped-def]
    stop = offset + 1
    quotient = value
    while quotient >= 10:
        quotient //= 10
        stop += 1
    quotient = np.uint64(value)
    for k in range(stop - 1, offset - 1, -1):
        out[k] = np.uint8(quotient % U10 + U48)
        quotient //= U10
    return stop


@njit
def print_cells(types, nodes, first, out):  # type: ignore[no-untyped-def]
    """Write a row for each element, type, nodes and index, into ``out``; return its length.

    ``types`` (m,), ``nodes`` (k,): those of all elements, one after the other.
    ``first``: the index of the first element; if negative, rows get no index.
    ``out`` (b,) uint8: receives the text.
    """
    offset = 0
    k = 0
    for row in range(len(types)):
        offset = _print_whole(np.int64(types[row]), out, offset)
        for _ in range(SIZES[types[row]]):
            out[offset] = 32
            offset = _print_whole(nodes[k], out, offset + 1)
            k += 1
        if first >= 0:
            out[offset] = 32
            offset = _print_whole(first + row, out, offset + 1)
        out[offset] = 10
        offset += 1
    return offset


@njit(inline="always")
def _copy_number(numbers, j, out, offset):  # type: ignore[no-untyped-def]
    """Copy orjson's number at ``numbers[j]`` to ``out[at]``; return where each goes on."""
    while numbers[j] != 44 and numbers[j] != 93:
        out[offset] = numbers[j]
        j += 1
        offset += 1
    while j < len(numbers) and (numbers[j] == 44 or numbers[j] == 91 or numbers[j] == 93):
        j += 1
    return j, offset


@njit
def print_points(numbers, dim, first, out):  # type: ignore[no-untyped-def]
    """Write a row for each point, coordinates and index, into ``out``; return its length.

    ``numbers`` (c,) uint8: the coordinates, ``dim`` of each point, as orjson writes them.
    ``first``: index of the first point.
    ``out`` (b,) uint8: receives the text.
    """
    j = 2
    offset = 0
    row = first
    while j < len(numbers):
        for _ in range(dim):
            j, offset = _copy_number(numbers, j, out, offset)
            out[offset] = 32
            offset += 1
        offset = _print_whole(row, out, offset)
        out[offset] = 10
        offset += 1
        row += 1
    return offset


@njit
def print_changed(text, numbers, changed, out):  # type: ignore[no-untyped-def]
    """Copy ``text`` to ``out`` with the coordinates that changed replaced.

    Returns the number of points in the text (if it is not m, the file was changed; -1: more than m)
    and the number of bytes in ``out``.
    ``text`` (b,) uint8: whole lines; those that begin with a number are points.
    ``numbers`` (c,) uint8: all m x d coordinates of the points, as orjson writes them.
    ``changed`` (m, d) bool: the coordinates to replace.
    ``out`` (b + c,) uint8: receives the text.
    """
    i = 0
    j = 2
    offset = 0
    row = 0
    while i < len(text):
        while text[i] <= 32 and text[i] != 10:
            out[offset] = text[i]
            i += 1
            offset += 1
        if is_numeric(text[i]):
            if row == len(changed):
                return -1, offset
            for axis in range(changed.shape[1]):
                while text[i] <= 32 and text[i] != 10:
                    out[offset] = text[i]
                    i += 1
                    offset += 1
                j, stop = _copy_number(numbers, j, out, offset)
                while not ends(text[i]):
                    if not changed[row, axis]:
                        out[offset] = text[i]
                        offset += 1
                    i += 1
                if changed[row, axis]:
                    offset = stop
            row += 1
        while text[i] != 10:
            out[offset] = text[i]
            i += 1
            offset += 1
        out[offset] = 10
        i += 1
        offset += 1
    return row, offset


RUN_COLUMNS = 5
"""Columns of a table of runs: first byte, first line, kind, rows, nodes (see `Lines`)."""


@njit(inline="always")
def _is_blank(code):  # type: ignore[no-untyped-def]
    return code == 32 or code == 9 or 11 <= code <= 13


@njit(inline="always")
def is_numeric(code):  # type: ignore[no-untyped-def]
    """Return whether a number may begin with this byte: a digit, a sign or a point."""
    return 48 <= code <= 57 or code == 43 or code == 45 or code == 46


@njit(inline="always")
def _next_line(text, offset):  # type: ignore[no-untyped-def]
    while text[offset] != 10:
        offset += 1
    return offset + 1


@njit(inline="always")
def _first_word(text, offset):  # type: ignore[no-untyped-def]
    """Return where the first word, or comment, of the line from ``offset`` begins, or its end."""
    # Control characters stand before words like blanks, but not between numbers.
    while text[offset] <= 32 and text[offset] != 10:
        offset += 1
    return offset


@njit(inline="always")
def _next_word(text, offset):  # type: ignore[no-untyped-def]
    """Return where the next word begins: ``offset``, or behind the blanks there."""
    while _is_blank(text[offset]):
        offset += 1
    return offset


@njit(inline="always")
def _type_of(text, offset):  # type: ignore[no-untyped-def]
    """Return the number that a row begins with: 0 without digits, 256 if it is not a type."""
    offset += text[offset] == 43
    value = np.int64(0)
    while 48 <= text[offset] <= 57:
        value = value * 10 + np.int64(text[offset]) - 48
        value = np.int64(256) if value > 256 else value
        offset += 1
    return value


@njit
def scan_block(text, runs):  # type: ignore[no-untyped-def]
    """Write the runs (see `Lines`) of a block into ``runs``; return the numbers of runs and lines.

    ``text`` (b,) uint8: the lines.
    ``runs`` (l, 5) int64: receives the runs, columns as in ``RUN_COLUMNS``, with bytes and lines
    counted from the start of the block; l is the number of lines. The first run may have no text.
    """
    offset = 0
    line = 0
    n = 0
    while offset < len(text):
        begin = offset
        offset = _first_word(text, offset)
        code = text[offset]
        empty = code == 10 or code == 37
        if not empty and not is_numeric(code):
            runs[n, 0] = begin
            runs[n, 1] = line
            runs[n, 2] = TEXT
            runs[n, 3] = 0
            runs[n, 4] = 0
            n += 1
            while text[offset] != 10 and text[offset] != 37:
                if text[offset] == 61:
                    runs[n - 1, 2] = KEYWORD
                offset += 1
        else:
            if n == 0:
                runs[n, 0] = 0
                runs[n, 1] = 0
                runs[n, 2] = ROWS
                runs[n, 3] = 0
                runs[n, 4] = 0
                n += 1
            if not empty:
                runs[n - 1, 3] += 1
                runs[n - 1, 4] += SIZES[_type_of(text, offset)]
        offset = _next_line(text, offset)
        line += 1
    return n, line


@njit
def count_types(text, counts):  # type: ignore[no-untyped-def]
    """Add to ``counts`` (257,) the number of rows of each element type; the last is for others."""
    offset = 0
    while offset < len(text):
        offset = _first_word(text, offset)
        if is_numeric(text[offset]):
            counts[_type_of(text, offset)] += 1
        offset = _next_line(text, offset)


@njit(inline="always")
def _whole_number(text, offset):  # type: ignore[no-untyped-def]
    """Return the whole number from ``offset`` on, of plain digits, and where it ends.

    The number is -1 if there are no digits or more than 18.
    """
    first = offset
    value = np.int64(0)
    digit = np.uint64(text[offset]) - U48
    while digit < U10:
        value = value * 10 + np.int64(digit)
        offset += 1
        digit = np.uint64(text[offset]) - U48
    return -1 if offset == first or offset > first + 18 else value, offset


@njit(inline="always")
def _nodes(text, offset, size, n_points, nodes, k):  # type: ignore[no-untyped-def]
    """Write the ``size`` nodes of an element to ``nodes[k:]``; return where they end in the text.

    The result is -1 if one is not a whole number below ``n_points``, or is there twice.
    """
    for j in range(k, k + size):
        node, offset = _whole_number(text, _next_word(text, offset))
        if node < 0 or node >= n_points:
            return -1
        for i in range(k, j):
            if nodes[i] == node:
                return -1
        nodes[j] = node
    return offset


@njit
def cell_block(text, dim, n_points, types, nodes, odd):  # type: ignore[no-untyped-def]
    """Read the rows of elements (type, nodes, perhaps an index, ignored) into types and nodes.

    Returns the number of rows (-1 if more than m; if it is not m, the file was changed), and of
    rows left. ``text`` (b,) uint8: whole lines; those that are not rows are skipped.
    ``dim``, ``n_points``: dimension that elements must have; number that nodes must be below.
    ``types`` (m,) uint8, ``nodes`` (k,) int64: receive types and nodes.
    ``odd`` (m, 3) int64: receives for each row left its number, the first byte of its line, and the
    index of its first node in ``nodes``.
    """
    offset = 0
    row = 0
    k = 0
    n = 0
    while offset < len(text):
        line = offset
        begin = _first_word(text, offset)
        if is_numeric(text[begin]):
            kind = _type_of(text, begin)
            size = SIZES[kind]
            if row == len(types) or k + size > len(nodes):
                return -1, n
            types[row] = np.uint8(kind)
            offset = -1
            if DIMS[kind] == dim and _next_word(text, line) == begin:
                offset = _whole_number(text, begin)[1]
                offset = _nodes(text, offset, size, n_points, nodes, k)
            if offset < 0 or not _ends_row(text, offset):
                odd[n, 0] = row
                odd[n, 1] = line
                odd[n, 2] = k
                n += 1
            row += 1
            k += size
        offset = _next_line(text, max(offset, begin))
    return row, n


@njit(inline="always")
def _ends_row(text, offset):  # type: ignore[no-untyped-def]
    """Return whether a row of whole numbers ends at ``offset``, or after one more number."""
    offset = _next_word(text, offset)
    if text[offset] == 10 or text[offset] == 37:
        return True
    index, offset = _whole_number(text, offset)
    offset = _next_word(text, offset)
    return index >= 0 and (text[offset] == 10 or text[offset] == 37)


@njit
def point_block(text, first, points, extra, odd):  # type: ignore[no-untyped-def]
    """Read the rows of points (coordinates, perhaps one or two indices) into ``points``.

    Returns as `cell_block`. ``text`` (b,) uint8: whole lines; those that are not rows are skipped.
    ``first``: number of the first row among all points.
    ``points`` (m, d) uint64: receives the bits of the coordinates.
    ``extra`` (2,) int64: updated by the rows that are not left: ``[0]`` becomes the largest count
    of numbers on a row, ``[1]`` the smallest number of a row that has only d numbers, the last of
    which is that number: perhaps its index, and a coordinate is missing.
    ``odd`` (m, 2) int64: receives for each row left its number and the first byte of its line.
    """
    offset = 0
    row = 0
    n = 0
    dim = points.shape[1]
    bits = np.zeros(1, np.uint64)
    value = bits.view(np.float64)
    while offset < len(text):
        line = offset
        begin = _first_word(text, offset)
        if is_numeric(text[begin]):
            if row == len(points):
                return -1, n
            offset = begin if _next_word(text, line) == begin else -1
            words = 0
            while offset >= 0 and text[offset] != 10 and text[offset] != 37:
                offset = decimal(text, offset, bits, 0) if words < dim + 2 else -1
                if words < dim:
                    points[row, words] = bits[0]
                words += 1
                offset = _next_word(text, offset) if offset >= 0 else -1
            if offset < 0 or words < dim:
                odd[n, 0] = row
                odd[n, 1] = line
                n += 1
            else:
                extra[0] = max(extra[0], words)
                if words == dim and value[0] == first + row:
                    extra[1] = min(extra[1], first + row)
            row += 1
        offset = _next_line(text, max(offset, begin))
    return row, n
