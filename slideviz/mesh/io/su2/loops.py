"""Compiled loops over the text of SU2 files: where lines are, and the numbers on them.

They do what is plain. A row with anything else on it (a sign before a node, a wrong type, a number
that is none, or not finite) is only listed: `su2.numbers` looks at it with all of Python.

Every text ends with a line break.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.caching import njit
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.io.su2.decimal import OPTIONS, U10, U48, decimal
from slideviz.mesh.io.su2.lines import KEYWORD, ROWS, TEXT

SIZES = np.zeros(257, np.int64)
"""Number of nodes by element type; the last row is for all types that are none."""
DIMS = np.full(257, -1)
for _row in ELEMENTS.values():
    SIZES[_row.vtk], DIMS[_row.vtk] = _row.n_nodes, _row.dim

RUN_COLUMNS = 5
"""First byte, number of the line, what it begins with, rows of numbers, nodes if they are cells."""


@njit(inline="always", **OPTIONS)
def _is_blank(code):  # type: ignore[no-untyped-def]
    """Tell whether a byte is a blank within a line."""
    return code == 32 or code == 9 or 11 <= code <= 13


@njit(inline="always", **OPTIONS)
def is_numeric(code):  # type: ignore[no-untyped-def]
    """Tell whether a number may begin with this byte."""
    return 48 <= code <= 57 or code == 43 or code == 45 or code == 46


@njit(inline="always", **OPTIONS)
def _next_line(text, at):  # type: ignore[no-untyped-def]
    """Return where the next line begins."""
    while text[at] != 10:
        at += 1
    return at + 1


@njit(inline="always", **OPTIONS)
def _first_word(text, at):  # type: ignore[no-untyped-def]
    """Return where the first word of a line begins, or where the line or its text ends."""
    # Control characters stand before words like blanks, but not between numbers.
    while text[at] <= 32 and text[at] != 10:
        at += 1
    return at


@njit(inline="always", **OPTIONS)
def _next_word(text, at):  # type: ignore[no-untyped-def]
    """Return where the next word begins, or the line or its text ends."""
    while _is_blank(text[at]):
        at += 1
    return at


@njit(inline="always", **OPTIONS)
def _type_of(text, at):  # type: ignore[no-untyped-def]
    """Return the element type that a row begins with; 256 where it is none."""
    at += text[at] == 43
    value = np.int64(0)
    while 48 <= text[at] <= 57:
        value = value * 10 + np.int64(text[at]) - 48
        value = np.int64(256) if value > 256 else value
        at += 1
    return value


@njit(**OPTIONS)
def scan_block(text, runs):  # type: ignore[no-untyped-def]
    """Find the runs of a block of lines: a line of text, and the rows of numbers after it.

    Parameters
    ----------
    text : (b,) uint8
        The lines.
    runs : (l, 5) int64
        As many rows as there are lines. Receives the runs, with bytes and lines counted from the
        start of the block; the first may begin without text.

    Returns
    -------
    n_runs, n_lines : int
        Runs and lines found.
    """
    at, line, n = 0, 0, 0
    while at < len(text):
        begin, at = at, _first_word(text, at)
        code = text[at]
        empty = code == 10 or code == 37
        if not empty and not is_numeric(code):
            runs[n, 0], runs[n, 1], runs[n, 2], runs[n, 3], runs[n, 4] = begin, line, TEXT, 0, 0
            n += 1
            while text[at] != 10 and text[at] != 37:
                if text[at] == 61:
                    runs[n - 1, 2] = KEYWORD
                at += 1
        else:
            if n == 0:
                runs[n, 0], runs[n, 1], runs[n, 2], runs[n, 3], runs[n, 4] = 0, 0, ROWS, 0, 0
                n += 1
            if not empty:
                runs[n - 1, 3] += 1
                runs[n - 1, 4] += SIZES[_type_of(text, at)]
        at = _next_line(text, at)
        line += 1
    return n, line


@njit(**OPTIONS)
def count_types(text, counts):  # type: ignore[no-untyped-def]
    """Count the rows of a text by the element type (257,) that they begin with.

    The last is for all types that are none.
    """
    at = 0
    while at < len(text):
        at = _first_word(text, at)
        if is_numeric(text[at]):
            counts[_type_of(text, at)] += 1
        at = _next_line(text, at)


@njit(inline="always", **OPTIONS)
def _whole_number(text, at):  # type: ignore[no-untyped-def]
    """Return a whole number of plain digits and where they end; -1 where there is none.

    What follows the digits need not be looked at: no other number begins with it.
    """
    first, value = at, np.int64(0)
    digit = np.uint64(text[at]) - U48
    while digit < U10:
        value = value * 10 + np.int64(digit)
        at += 1
        digit = np.uint64(text[at]) - U48
    return -1 if at == first or at > first + 18 else value, at


@njit(inline="always", **OPTIONS)
def _nodes(text, at, size, n_points, nodes, k):  # type: ignore[no-untyped-def]
    """Put the nodes of an element into place k, and return where they end, or -1."""
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
    """Read rows of elements: type, nodes, and perhaps an index that is ignored.

    Parameters
    ----------
    text : (b,) uint8
        Lines; those without numbers are passed over.
    dim, n_points : int
        The dimension of the elements; the nodes are below this number.
    types : (m,) uint8
        Receives the types.
    nodes : (k,) int64
        Receives the nodes.
    odd : (m, 3) int64
        Receives row, first byte of its line, and place of its first node, of each row left.

    Returns
    -------
    rows, left : int
        The number of rows, m if the text is what it was, and of those left.
    """
    at, row, k, n = 0, 0, 0, 0
    while at < len(text):
        line, begin = at, _first_word(text, at)
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
                odd[n, 0], odd[n, 1], odd[n, 2] = row, line, k
                n += 1
            row += 1
            k += size
        at = _next_line(text, max(at, begin))
    return row, n


@njit(inline="always", **OPTIONS)
def _ends_row(text, at):  # type: ignore[no-untyped-def]
    """Tell whether a row of whole numbers ends here, or after one more number."""
    at = _next_word(text, at)
    if text[at] == 10 or text[at] == 37:
        return True
    index, at = _whole_number(text, at)
    at = _next_word(text, at)
    return index >= 0 and (text[at] == 10 or text[at] == 37)


@njit(**OPTIONS)
def point_block(text, first, points, extra, odd):  # type: ignore[no-untyped-def]
    """Read rows of points: coordinates, and perhaps one or two indices.

    Parameters
    ----------
    text : (b,) uint8
        Lines; those without numbers are passed over.
    first : int
        The number of the first row among all points.
    points : (m, d) uint64
        Receives the bits of the coordinates.
    extra : (2,) int64
        Of rows that are not left: receives the most numbers on one, if more than is there, and
        the first whose last coordinate is its own number with nothing after it, if before that.
    odd : (m, 2) int64
        Receives row and first byte of its line of each row that is left.

    Returns
    -------
    rows, left : int
        The number of rows, m if the text is what it was, and of those left.
    """
    at, row, n, dim = 0, 0, 0, points.shape[1]
    bits = np.zeros(1, np.uint64)
    value = bits.view(np.float64)
    while at < len(text):
        line, begin = at, _first_word(text, at)
        if is_numeric(text[begin]):
            if row == len(points):
                return -1, n
            at, words = (begin if _next_word(text, line) == begin else -1), 0
            while at >= 0 and text[at] != 10 and text[at] != 37:
                at = decimal(text, at, bits, 0) if words < dim + 2 else -1
                if words < dim:
                    points[row, words] = bits[0]
                words += 1
                at = _next_word(text, at) if at >= 0 else -1
            if at < 0 or words < dim:
                odd[n, 0], odd[n, 1] = row, line
                n += 1
            else:
                extra[0] = max(extra[0], words)
                if words == dim and value[0] == first + row:
                    extra[1] = min(extra[1], first + row)
            row += 1
        at = _next_line(text, max(at, begin))
    return row, n
