"""Compiled loops over all nodes of one or several designs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from slideviz.mesh.caching import njit
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import axis_basis
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.frames import Frame

_OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}


@njit(parallel=True, **_OPTIONS)
def _shift(start, by):  # type: ignore[no-untyped-def]
    for i in prange(by.shape[1]):
        for k in range(by.shape[0]):
            for j in range(by.shape[2]):
                u, x = by[k, i, j], start[i, j]
                # Adding zero would turn -0.0 into 0.0.
                by[k, i, j] = x if u == 0.0 else x + u


@njit(parallel=True, **_OPTIONS)
def _rest(at, moved, start, before):  # type: ignore[no-untyped-def]
    for i in prange(at.shape[1]):
        for k in range(at.shape[0]):
            rests = True
            for j in range(at.shape[2]):
                rests = rests and moved[k, i, j] == start[i, j]
            if rests:
                at[k, i] = before[i]


@njit(parallel=True, **_OPTIONS)
def _farthest(moved, start, squares):  # type: ignore[no-untyped-def]
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
                # What is not a number is larger than anything.
                if not square <= most:
                    most = square if square == square else np.inf
            squares[part, k] = most


@njit(parallel=True, **_OPTIONS)
def _turn(coords, start, before, basis, origin, rate, theta0):  # type: ignore[no-untyped-def]
    d = coords.shape[2]
    for i in prange(coords.shape[1]):
        for k in range(coords.shape[0]):
            x = coords[k, i]
            if x[0] == start[i, 0] and x[1] == start[i, 1] and x[d - 1] == start[i, d - 1]:
                coords[k, i] = before[i]
                continue
            angle = x[1] * rate + theta0
            a, b, c = x[0] * np.cos(angle), x[0] * np.sin(angle), 0.0
            if d == 3:
                c = x[2]
            for j in range(d):
                x[j] = a * basis[0, j] + b * basis[1, j] + c * basis[2, j] + origin[j]


PARTS = 64


def shift(start: FloatArray, by: FloatArray) -> FloatArray:
    """Return ``start`` (n, d) + ``by`` (..., n, d), in its place; what rests keeps every bit."""
    with one_at_a_time(by.size):
        _shift(start, by.reshape(-1, *start.shape))
    return by


def keep_rest(
    at: FloatArray, moved: FloatArray, start: FloatArray, before: FloatArray
) -> FloatArray:
    """Return points (..., n, d), in place; those with coordinates as at the start are ``before``.

    Parameters
    ----------
    moved, start : (..., n, d), (n, d)
        Coordinates now, and those of the undeformed points ``before`` (n, d).
    """
    with one_at_a_time(at.size):
        _rest(at.reshape(-1, *start.shape), moved.reshape(-1, *start.shape), start, before)
    return at


def to_points(frame: Frame, coords: FloatArray, start: FloatArray, before: FloatArray) -> None:
    """Turn coordinates (..., n, d) into points, in place; what rests is as ``before``.

    As ``frame.points`` does, but for rounding. Parameters as of ``keep_rest``.
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
    """Return how far nodes moved at most, (...,); infinite where a coordinate is no number."""
    stacked = moved.reshape(-1, *start.shape)
    squares = np.empty((PARTS, len(stacked)))
    with one_at_a_time(moved.size):
        _farthest(stacked, start, squares)
    return np.sqrt(squares.max(axis=0)).reshape(moved.shape[:-2])
