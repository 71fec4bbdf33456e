"""Compiled sweeps over matrices in square blocks; they release the interpreter lock."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import prange

from slideviz.rbf.caching import njit

_OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "fastmath": True}


@njit(**_OPTIONS)
def sweep(indptr, indices, data, inverse, right, x, backward):  # type: ignore[no-untyped-def]
    """Make one Gauss and Seidel sweep by blocks, on x (m, b) in place.

    ``data`` (k, b, b) and ``inverse`` (m, b, b): the blocks, and the inverse of the diagonal ones.
    """
    m, b = x.shape
    left = np.empty(b)
    for step in range(m):
        row = m - 1 - step if backward else step
        for i in range(b):
            left[i] = right[row, i]
        for k in range(indptr[row], indptr[row + 1]):
            column = indices[k]
            if column != row:
                for i in range(b):
                    total = 0.0
                    for j in range(b):
                        total += data[k, i, j] * x[column, j]
                    left[i] -= total
        for i in range(b):
            total = 0.0
            for j in range(b):
                total += inverse[row, i, j] * left[j]
            x[row, i] = total


@njit(parallel=True, **_OPTIONS)
def product(indptr, indices, data, x, out):  # type: ignore[no-untyped-def]
    """Write the product of a matrix in blocks with x (m, b) to out (m, b)."""
    m, b = x.shape
    for row in prange(m):
        for i in range(b):
            out[row, i] = 0.0
        for k in range(indptr[row], indptr[row + 1]):
            column = indices[k]
            for i in range(b):
                total = 0.0
                for j in range(b):
                    total += data[k, i, j] * x[column, j]
                out[row, i] += total
