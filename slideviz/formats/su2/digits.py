"""Compiled loops that write rows of SU2 files: elements, points, and new coordinates in old rows.

The digits of coordinates come from orjson, which writes an array as ``[[0.5,-1e-7],[2.0,0.1]]``
with as few digits as identify each float64. Texts are arrays of bytes, (b,) uint8.
"""

from __future__ import annotations

import numpy as np

from slideviz.formats.su2.decimal import OPTIONS, U10, U48, ends
from slideviz.formats.su2.loops import is_numeric
from slideviz.system.jit_cache import njit


@njit(inline="always", **OPTIONS)
def _print_whole(value, out, at):  # type: ignore[no-untyped-def]
    """Write a whole number, not negative, from ``out[at]`` on; return where it ends."""
    stop, quotient = at + 1, value
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

    Parameters
    ----------
    types, offsets, nodes : (m,), (m + 1,), (k,)
        The elements; only differences of the offsets are used.
    first : int
        The index of the first element; if negative, rows get no index.
    out : (b,) uint8
        Receives the text.

    Returns
    -------
    int
        The number of bytes.
    """
    at, k = 0, 0
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
    """Copy the number at ``numbers[j]``, orjson's text, to ``out[at]``.

    Returns where the next number begins in ``numbers``, and where the copy ends in ``out``.
    """
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

    Parameters
    ----------
    numbers : (c,) uint8
        The coordinates, as orjson writes them.
    dim, first : int
        Number of coordinates of a point; index of the first point.
    out : (b,) uint8
        Receives the text.

    Returns
    -------
    int
        The number of bytes.
    """
    j, at, row = 2, 0, first
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

    Parameters
    ----------
    text : (b,) uint8
        Whole lines; those that begin with a number are points.
    numbers : (c,) uint8
        All m x d coordinates of the points, as orjson writes them.
    changed : (m, d) bool
        The coordinates to replace.
    out : (b + c,) uint8
        Receives the text.

    Returns
    -------
    rows, n_bytes : int
        Number of points in the text, -1 if more than m: if it is not m, the file was changed. And
        number of bytes in ``out``.
    """
    i, j, at, row = 0, 2, 0, 0
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
