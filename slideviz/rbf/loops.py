"""Compiled loops over all nodes of one or several designs."""

from __future__ import annotations

from math import factorial
from typing import TYPE_CHECKING

import numpy as np
from numba import prange

from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.frames import Frame
from slideviz.system.jit_cache import njit

if TYPE_CHECKING:
    from scipy.sparse import csr_array


BLOCK = 256  # nodes of a task; it does all designs, so that what they share stays in the cache


@njit(parallel=True)
def _shift(start, by):  # type: ignore[no-untyped-def]
    n = by.shape[1]
    for task in prange((n + BLOCK - 1) // BLOCK):
        for k in range(by.shape[0]):
            for i in range(task * BLOCK, min(n, (task + 1) * BLOCK)):
                for j in range(by.shape[2]):
                    u = by[k, i, j]
                    x = start[i, j]
                    # Adding zero would turn -0.0 into 0.0.
                    by[k, i, j] = x if u == 0.0 else x + u


@njit(parallel=True)
def _keep_undeformed(at, moved, start, before):  # type: ignore[no-untyped-def]
    n = at.shape[1]
    for task in prange((n + BLOCK - 1) // BLOCK):
        for k in range(at.shape[0]):
            for i in range(task * BLOCK, min(n, (task + 1) * BLOCK)):
                rests = True
                for j in range(at.shape[2]):
                    rests = rests and moved[k, i, j] == start[i, j]
                if rests:
                    for j in range(at.shape[2]):
                        at[k, i, j] = before[i, j]


@njit
def place(found, nodes, out):  # type: ignore[no-untyped-def]
    """Write values (b, k d) at ``nodes`` (b,) of k designs to ``out`` (k, n, d), in one thread."""
    d = out.shape[2]
    for k in range(out.shape[0]):
        for i in range(found.shape[0]):
            for j in range(d):
                out[k, nodes[i], j] = found[i, k * d + j]


@njit(parallel=True)
def _add_correction(out, targets, starts, source, weight, part, lacking):  # type: ignore[no-untyped-def]
    """Do what ``add_correction`` does, with the rows of the sparse matrix."""
    for k in prange(out.shape[0]):
        for row in range(len(targets)):
            i = targets[row]
            for j in range(out.shape[2]):
                total = 0.0
                for at in range(starts[row], starts[row + 1]):
                    total += weight[at] * lacking[k, source[at], j]
                out[k, i, j] += part[row] * total


@njit(parallel=True)
def _farthest(moved, start, squares):  # type: ignore[no-untyped-def]
    """Write the largest squared distance in each of p parts of the nodes to ``squares`` (p, k)."""
    for part in prange(squares.shape[0]):
        first = part * start.shape[0] // squares.shape[0]
        last = (part + 1) * start.shape[0] // squares.shape[0]
        for k in range(moved.shape[0]):
            most = 0.0
            for i in range(first, last):
                square = 0.0
                for j in range(start.shape[1]):
                    off = moved[k, i, j] - start[i, j]
                    square += off * off
                # NaN counts as infinite.
                if not square <= most:
                    most = square if square == square else np.inf
            squares[part, k] = most


_S = tuple((-1.0) ** k / float(factorial(2 * k + 1)) for k in range(1, 7))
_C = tuple((-1.0) ** k / float(factorial(2 * k)) for k in range(1, 8))


@njit(inline="always")
def _sine(x):  # type: ignore[no-untyped-def]
    """Return sin x for |x| <= NEAR, to the last bits."""
    t = x * x
    p = t * (_S[2] + t * (_S[3] + t * (_S[4] + t * _S[5])))
    return x + x * (t * (_S[0] + t * (_S[1] + p)))


@njit(inline="always")
def _cosine(x):  # type: ignore[no-untyped-def]
    t = x * x
    p = t * (_C[2] + t * (_C[3] + t * (_C[4] + t * (_C[5] + t * _C[6]))))
    return 1.0 + t * (_C[0] + t * (_C[1] + p))


NEAR = 0.25  # largest angle, in radians, for which _sine and _cosine are exact but for rounding


@njit(parallel=True)
def _turn(coords, start, before, basis, origin, rate, theta0):  # type: ignore[no-untyped-def]
    """Do what ``to_points`` does, for k designs; ``rate`` is 1 / ``frame.radius``."""
    n, d = coords.shape[1:]
    for task in prange((n + BLOCK - 1) // BLOCK):
        first = task * BLOCK
        last = min(n, (task + 1) * BLOCK)
        cos = np.empty(BLOCK)
        sin = np.empty(BLOCK)
        for i in range(first, last):
            angle = start[i, 1] * rate + theta0
            cos[i - first] = np.cos(angle)
            sin[i - first] = np.sin(angle)
        for k in range(coords.shape[0]):
            for i in range(first, last):
                x0 = coords[k, i, 0]
                x1 = coords[k, i, 1]
                x2 = 0.0
                if d == 3:
                    x2 = coords[k, i, 2]
                if x0 == start[i, 0] and x1 == start[i, 1] and (d == 2 or x2 == start[i, 2]):
                    coords[k, i] = before[i]
                    continue
                by = (x1 - start[i, 1]) * rate
                c = cos[i - first]
                s = sin[i - first]
                if abs(by) <= NEAR:
                    c, s = c * _cosine(by) - s * _sine(by), s * _cosine(by) + c * _sine(by)
                else:
                    c = np.cos(x1 * rate + theta0)
                    s = np.sin(x1 * rate + theta0)
                a = x0 * c
                b = x0 * s
                for j in range(d):
                    coords[k, i, j] = (
                        a * basis[0, j] + b * basis[1, j] + x2 * basis[2, j] + origin[j]
                    )


PARTS = 64  # parts of the nodes in ``farthest``, which run in parallel


def shift(start: FloatArray, by: FloatArray) -> FloatArray:
    """Return ``start`` (n, d) + ``by`` (..., n, d), written to ``by``; zeros keep every bit."""
    with one_at_a_time(by.size):
        _shift(start, by.reshape(-1, *start.shape))
    return by


def add_correction(
    out: FloatArray, targets: IntArray, means: csr_array, part: FloatArray, lacking: FloatArray
) -> None:
    """Add the boundary correction to ``out`` (k, n, d), k designs, at the targets (h,).

    ``means`` (h, b): the weights of boundary nodes in the mean that each target takes over.
    ``part`` (h,): the share of that mean that it takes over.
    ``lacking`` (k, b, d): the errors at the boundary nodes.
    """
    with one_at_a_time(len(out) * means.nnz * out.shape[-1]):
        lacking = np.ascontiguousarray(lacking)
        _add_correction(out, targets, means.indptr, means.indices, means.data, part, lacking)


def keep_undeformed(
    at: FloatArray, moved: FloatArray, start: FloatArray, before: FloatArray
) -> FloatArray:
    """Return points ``at`` (..., n, d), with those of nodes at rest overwritten by ``before``.

    ``moved`` and ``start`` (..., n, d), (n, d): coordinates now, and those of the undeformed points
    ``before`` (n, d).
    """
    before = before.view()
    before.flags.writeable = False  # as those of a mesh are: the loop is compiled once
    with one_at_a_time(at.size):
        _keep_undeformed(
            at.reshape(-1, *start.shape), moved.reshape(-1, *start.shape), start, before
        )
    return at


def to_points(frame: Frame, coords: FloatArray, start: FloatArray, before: FloatArray) -> None:
    """Turn frame coordinates (..., n, d) into points, in place; nodes at rest become ``before``.

    As ``frame.points`` does, but for rounding. Parameters as of ``keep_undeformed``.
    """
    if frame.axis is None or frame.origin is None:
        return
    basis = axis_basis(frame.axis)
    with one_at_a_time(8 * coords.size):
        _turn(
            coords.reshape(-1, *start.shape),
            start,
            before,
            basis,
            frame.origin,
            1.0 / frame.radius,
            frame.theta0,
        )


def farthest(moved: FloatArray, start: FloatArray) -> FloatArray:
    """Return the largest distance of a node from ``start`` (n, d), (...,); inf if any is NaN."""
    stacked = moved.reshape(-1, *start.shape)
    squares = np.empty((PARTS, len(stacked)))
    with one_at_a_time(moved.size):
        _farthest(stacked, start, squares)
    return np.sqrt(squares.max(axis=0)).reshape(moved.shape[:-2])
