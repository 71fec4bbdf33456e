"""Compiled loops over all nodes of one or several designs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from slideviz.mesh.caching import njit
from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import one_at_a_time

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


def farthest(moved: FloatArray, start: FloatArray) -> FloatArray:
    """Return how far nodes moved at most, (...,); infinite where a coordinate is no number."""
    stacked = moved.reshape(-1, *start.shape)
    squares = np.empty((PARTS, len(stacked)))
    with one_at_a_time(moved.size):
        _farthest(stacked, start, squares)
    return np.sqrt(squares.max(axis=0)).reshape(moved.shape[:-2])
