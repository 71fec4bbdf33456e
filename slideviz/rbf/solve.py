"""Symmetric positive definite systems: blocked Cholesky with a pivot guard.

Radial functions of nodes that nearly coincide make nearly equal rows: the smallest eigenvalue
falls with the cube of the smallest distance, so boundary layers can make the matrix numerically
singular. Then constraints are taken in the order of their remaining pivots and those below the
guard are left out, and reported; nothing falls back silently.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf, dpstrf

from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Tick, no_tick

PIVOT_GUARD = 1e-12
BLOCK = 768


@dataclass(frozen=True, eq=False)
class Factor:
    """A Cholesky factor L L^T = G[kept][:, kept].

    Attributes
    ----------
    lower : (k, k) float64
    kept : (k,) int64
        The rows of G that are in the system, in the order of the factor.
    dropped : (n - k,) int64
        Rows left out because their remaining pivot is below the guard.
    """

    lower: FloatArray
    kept: IntArray
    dropped: IntArray

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the weights (n, m) for right-hand sides (n, m); zero in dropped rows."""
        out = np.zeros_like(right, dtype=float)
        half = solve_triangular(self.lower, right[self.kept], lower=True, check_finite=False)
        out[self.kept] = solve_triangular(self.lower, half, lower=True, trans=1, check_finite=False)
        return out


def factorise(matrix: FloatArray, tick: Tick = no_tick) -> Factor:
    """Return the factor of a symmetric matrix (n, n) with unit diagonal.

    The matrix is kept unchanged only if it is needed for the pivoted second try.

    Raises
    ------
    DeformError
        The matrix has numbers that are not finite.
    """
    n = len(matrix)
    if not np.all(np.isfinite(matrix)):
        raise DeformError(
            "the interpolation system has numbers that are not finite; check the coordinates "
            "and displacements for NaN and the support radius for zero"
        )
    lower = _blocked_cholesky(matrix, tick)
    if lower is not None:
        return Factor(lower, np.arange(n), np.empty(0, np.int64))
    packed, order, rank, _ = dpstrf(matrix, tol=PIVOT_GUARD, lower=1)
    order = order.astype(np.int64) - 1
    kept = order[:rank]
    return Factor(np.tril(packed[:rank, :rank]), kept, np.sort(order[rank:]))


def _blocked_cholesky(matrix: FloatArray, tick: Tick) -> FloatArray | None:
    """Return the lower factor, or None when a pivot falls below the guard.

    Left-looking by columns of blocks, so that ``tick`` is called, and may stop the work, every
    few tens of milliseconds even for 10,000 unknowns.
    """
    n = len(matrix)
    lower = np.zeros((n, n), order="F")
    for start in range(0, n, BLOCK):
        stop = min(n, start + BLOCK)
        panel = matrix[start:, start:stop] - lower[start:, :start] @ lower[start:stop, :start].T
        head, info = dpotrf(panel[: stop - start], lower=1, clean=1)
        if info != 0 or np.min(np.diag(head)) ** 2 < PIVOT_GUARD:
            return None
        lower[start:stop, start:stop] = head
        if stop < n:
            lower[stop:, start:stop] = solve_triangular(
                head, panel[stop - start :].T, lower=True, check_finite=False
            ).T
        tick((stop / n) ** 2)
    return lower
