"""Compiled loops over the text of SU2 files, which find lines, read numbers and write rows.

They read plain rows only. A row with anything else (a sign before a node, a wrong type, a word that
is not a number, a number that is not finite) is *left*: only listed, so that `su2.numbers` reads it
in Python.

``text`` is an array of bytes, (b,) uint8, that ends with a line break; ``at`` is an index into it.
"""

from __future__ import annotations

import numpy as np

from slideviz.formats.su2 import KEYWORD, ROWS, TEXT
from slideviz.formats.su2.decimal import U10, U48, decimal, ends
from slideviz.mesh.elements import ELEMENTS
from slideviz.system.jit_cache import OPTIONS, njit


@njit(inline="always", **OPTIONS)
def _print_whole(value, out, at):  # type: ignore[no-untyped-def]
    stop = at + 1
    quotient = value
    while quotient >= 10:
        quotient //= 10
        stop += 1
    quotient = np.uint64(value)
    for k in range(stop - 1, at - 1, -1):
        out[k] = np.uint8(quotient % U10 + U48)
        quotient //= U10
    return stop


@njit(**OPTIONS)
def print_cells(types, offsets, nodes, first, out):  # type: ignore[no-untyped-def]
    """Write a row for each element, type, nodes and index, into ``out``; return its length.

    ``types`` (m,), ``offsets`` (m + 1,), ``nodes`` (k,): of the offsets only differences are used.
    ``first``: the index of the first element; if negative, rows get no index.
    ``out`` (b,) uint8: receives the text.
    """
    at = 0
    k = 0
    for row in range(len(types)):
        at = _print_whole(np.int64(types[row]), out, at)
        for _ in range(offsets[row + 1] - offsets[row]):
            out[at] = 32
            at = _print_whole(nodes[k], out, at + 1)
            k += 1
        if first >= 0:
            out[at] = 32
            at = _print_whole(first + row, out, at + 1)
        out[at] = 10
        at += 1
    return at


@njit(inline="always", **OPTIONS)
def _copy_number(numbers, j, out, at):  # type: ignore[no-untyped-def]
    """Copy orjson's number at ``numbers[j]`` to ``out[at]``; return where each goes on."""
    while numbers[j] != 44 and numbers[j] != 93:
        out[at] = numbers[j]
        j += 1
        at += 1
    while j < len(numbers) and (numbers[j] == 44 or numbers[j] == 91 or numbers[j] == 93):
        j += 1
    return j, at


@njit(**OPTIONS)
def print_points(numbers, dim, first, out):  # type: ignore[no-untyped-def]
    """Write a row for each point, coordinates and index, into ``out``; return its length.

    ``numbers`` (c,) uint8: the coordinates, ``dim`` of each point, as orjson writes them.
    ``first``: index of the first point.
    ``out`` (b,) uint8: receives the text.
    """
    j = 2
    at = 0
    row = first
    while j < len(numbers):
        for _ in range(dim):
            j, at = _copy_number(numbers, j, out, at)
            out[at] = 32
            at += 1
        at = _print_whole(row, out, at)
        out[at] = 10
        at += 1
        row += 1
    return at


@njit(**OPTIONS)
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
    at = 0
    row = 0
    while i < len(text):
        while text[i] <= 32 and text[i] != 10:
            out[at] = text[i]
            i += 1
            at += 1
        if is_numeric(text[i]):
            if row == len(changed):
                return -1, at
            for axis in range(changed.shape[1]):
                while text[i] <= 32 and text[i] != 10:
                    out[at] = text[i]
                    i += 1
                    at += 1
                j, stop = _copy_number(numbers, j, out, at)
                while not ends(text[i]):
                    if not changed[row, axis]:
                        out[at] = text[i]
                        at += 1
                    i += 1
                if changed[row, axis]:
                    at = stop
            row += 1
        while text[i] != 10:
            out[at] = text[i]
            i += 1
            at += 1
        out[at] = 10
        i += 1
        at += 1
    return row, at


SIZES = np.zeros(257, np.int64)
"""Number of nodes by element type, 0 for no type; the last entry is for all numbers above 255."""
DIMS = np.full(257, -1)  # dimension by element type, likewise; -1 for no type
for _row in ELEMENTS.values():
    SIZES[_row.vtk] = _row.n_nodes
    DIMS[_row.vtk] = _row.dim

RUN_COLUMNS = 5
"""Columns of a table of runs: first byte, first line, kind, rows, nodes (see `Lines`)."""


@njit(inline="always", **OPTIONS)
def _is_blank(code):  # type: ignore[no-untyped-def]
    return code == 32 or code == 9 or 11 <= code <= 13


@njit(inline="always", **OPTIONS)
def is_numeric(code):  # type: ignore[no-untyped-def]
    """Return whether a number may begin with this byte: a digit, a sign or a point."""
    return 48 <= code <= 57 or code == 43 or code == 45 or code == 46


@njit(inline="always", **OPTIONS)
def _next_line(text, at):  # type: ignore[no-untyped-def]
    while text[at] != 10:
        at += 1
    return at + 1


@njit(inline="always", **OPTIONS)
def _first_word(text, at):  # type: ignore[no-untyped-def]
    """Return where the first word, or comment, of the line from ``at`` on begins, or its end."""
    # Control characters stand before words like blanks, but not between numbers.
    while text[at] <= 32 and text[at] != 10:
        at += 1
    return at


@njit(inline="always", **OPTIONS)
def _next_word(text, at):  # type: ignore[no-untyped-def]
    """Return where the next word begins: ``at``, or behind the blanks there."""
    while _is_blank(text[at]):
        at += 1
    return at


@njit(inline="always", **OPTIONS)
def _type_of(text, at):  # type: ignore[no-untyped-def]
    """Return the number that a row begins with: 0 without digits, 256 if it is not a type."""
    at += text[at] == 43
    value = np.int64(0)
    while 48 <= text[at] <= 57:
        value = value * 10 + np.int64(text[at]) - 48
        value = np.int64(256) if value > 256 else value
        at += 1
    return value


@njit(**OPTIONS)
def scan_block(text, runs):  # type: ignore[no-untyped-def]
    """Write the runs (see `Lines`) of a block into ``runs``; return the numbers of runs and lines.

    ``text`` (b,) uint8: the lines.
    ``runs`` (l, 5) int64: receives the runs, columns as in ``RUN_COLUMNS``, with bytes and lines
    counted from the start of the block; l is the number of lines. The first run may have no text.
    """
    at = 0
    line = 0
    n = 0
    while at < len(text):
        begin = at
        at = _first_word(text, at)
        code = text[at]
        empty = code == 10 or code == 37
        if not empty and not is_numeric(code):
            runs[n, 0] = begin
            runs[n, 1] = line
            runs[n, 2] = TEXT
            runs[n, 3] = 0
            runs[n, 4] = 0
            n += 1
            while text[at] != 10 and text[at] != 37:
                if text[at] == 61:
                    runs[n - 1, 2] = KEYWORD
                at += 1
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
                runs[n - 1, 4] += SIZES[_type_of(text, at)]
        at = _next_line(text, at)
        line += 1
    return n, line


@njit(**OPTIONS)
def count_types(text, counts):  # type: ignore[no-untyped-def]
    """Add to ``counts`` (257,) the number of rows of each element type; the last is for others."""
    at = 0
    while at < len(text):
        at = _first_word(text, at)
        if is_numeric(text[at]):
            counts[_type_of(text, at)] += 1
        at = _next_line(text, at)


@njit(inline="always", **OPTIONS)
def _whole_number(text, at):  # type: ignore[no-untyped-def]
    """Return the whole number from ``at`` on, of plain digits, and where it ends.

    The number is -1 if there are no digits or more than 18.
    """
    first = at
    value = np.int64(0)
    digit = np.uint64(text[at]) - U48
    while digit < U10:
        value = value * 10 + np.int64(digit)
        at += 1
        digit = np.uint64(text[at]) - U48
    return -1 if at == first or at > first + 18 else value, at


@njit(inline="always", **OPTIONS)
def _nodes(text, at, size, n_points, nodes, k):  # type: ignore[no-untyped-def]
    """Write the ``size`` nodes of an element to ``nodes[k:]``; return where they end in the text.

    The result is -1 if one is not a whole number below ``n_points``, or is there twice.
    """
    for j in range(k, k + size):
        node, at = _whole_number(text, _next_word(text, at))
        if node < 0 or node >= n_points:
            return -1
        for i in range(k, j):
            if nodes[i] == node:
                return -1
        nodes[j] = node
    return at


@njit(**OPTIONS)
def cell_block(text, dim, n_points, types, nodes, odd):  # type: ignore[no-untyped-def]
    """Read the rows of elements (type, nodes, perhaps an index, ignored) into types and nodes.

    Returns the number of rows (-1 if more than m; if it is not m, the file was changed), and of
    rows left. ``text`` (b,) uint8: whole lines; those that are not rows are skipped.
    ``dim``, ``n_points``: dimension that elements must have; number that nodes must be below.
    ``types`` (m,) uint8, ``nodes`` (k,) int64: receive types and nodes.
    ``odd`` (m, 3) int64: receives for each row left its number, the first byte of its line, and the
    index of its first node in ``nodes``.
    """
    at = 0
    row = 0
    k = 0
    n = 0
    while at < len(text):
        line = at
        begin = _first_word(text, at)
        if is_numeric(text[begin]):
            kind = _type_of(text, begin)
            size = SIZES[kind]
            if row == len(types) or k + size > len(nodes):
                return -1, n
            types[row] = np.uint8(kind)
            at = -1
            if DIMS[kind] == dim and _next_word(text, line) == begin:
                at = _whole_number(text, begin)[1]
                at = _nodes(text, at, size, n_points, nodes, k)
            if at < 0 or not _ends_row(text, at):
                odd[n, 0] = row
                odd[n, 1] = line
                odd[n, 2] = k
                n += 1
            row += 1
            k += size
        at = _next_line(text, max(at, begin))
    return row, n


@njit(inline="always", **OPTIONS)
def _ends_row(text, at):  # type: ignore[no-untyped-def]
    """Return whether a row of whole numbers ends at ``at``, or after one more number."""
    at = _next_word(text, at)
    if text[at] == 10 or text[at] == 37:
        return True
    index, at = _whole_number(text, at)
    at = _next_word(text, at)
    return index >= 0 and (text[at] == 10 or text[at] == 37)


@njit(**OPTIONS)
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
    at = 0
    row = 0
    n = 0
    dim = points.shape[1]
    bits = np.zeros(1, np.uint64)
    value = bits.view(np.float64)
    while at < len(text):
        line = at
        begin = _first_word(text, at)
        if is_numeric(text[begin]):
            if row == len(points):
                return -1, n
            at = begin if _next_word(text, line) == begin else -1
            words = 0
            while at >= 0 and text[at] != 10 and text[at] != 37:
                at = decimal(text, at, bits, 0) if words < dim + 2 else -1
                if words < dim:
                    points[row, words] = bits[0]
                words += 1
                at = _next_word(text, at) if at >= 0 else -1
            if at < 0 or words < dim:
                odd[n, 0] = row
                odd[n, 1] = line
                n += 1
            else:
                extra[0] = max(extra[0], words)
                if words == dim and value[0] == first + row:
                    extra[1] = min(extra[1], first + row)
            row += 1
        at = _next_line(text, max(at, begin))
    return row, n
