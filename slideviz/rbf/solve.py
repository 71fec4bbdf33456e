"""Symmetric positive definite systems: blocked Cholesky with a pivot guard.

Radial functions of nodes that nearly coincide make nearly equal rows: the smallest eigenvalue
falls with the cube of the smallest distance, so boundary layers can make the matrix numerically
singular. A row whose remaining pivot is below the guard is left out, and reported; nothing
falls back silently.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache

import numpy as np
from scipy.linalg import LinAlgError, LinAlgWarning, lstsq, qr, solve
from threadpoolctl import ThreadpoolController

from slideviz.argument_types import record
from slideviz.errors import DeformError
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray
from slideviz.rbf.evaluate import Tick, no_tick
from slideviz.system.device import HOST, Arrays
from slideviz.system.jit_cache import njit

RANK = 1e-10
"""A polynomial term depends on the others at the control nodes when its diagonal entry in a pivoted
QR is at most this part of the largest one."""


@record
class Saddle:
    """Solution of a system with a polynomial (Eq. 2.4)."""

    weights: FloatArray  # (n, m)
    tail: FloatArray  # (q, m): coefficients of the polynomial's terms
    rank_deficient: bool
    """Whether the system was singular, so that this is its least-squares solution."""


def solve_saddle(matrix: FloatArray, terms: FloatArray, right: FloatArray) -> Saddle:
    """Return weights and polynomial of ``[[G, P], [P^T, 0]] [w, c] = [b, 0]``.

    Symmetric indefinite, solved with Bunch and Kaufman's pivoting. Terms that are dependent at
    the given nodes (all in one plane) are left out. Raises DeformError if numbers are not finite.
    ``matrix`` (n, n).
    ``terms`` (n, q): the polynomial's terms in each row.
    ``right`` (n, m).
    """
    require_finite(matrix)
    system, use = saddle_system(matrix, terms)
    n = len(matrix)
    full = np.concatenate([right, np.zeros((len(use), right.shape[1]))])
    found = _regular(system, full)
    deficient = found is None
    if found is None:
        found = lstsq(system, full, cond=PIVOT_GUARD, check_finite=False, lapack_driver="gelsy")[0]
    tail = np.zeros((terms.shape[1], right.shape[1]))
    tail[use] = found[n:]
    return Saddle(found[:n], tail, deficient)


def _regular(system: FloatArray, right: FloatArray) -> FloatArray | None:
    """Return the solution of a symmetric system; None where it is singular."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", LinAlgWarning)
        try:
            return solve(system, right, assume_a="sym", check_finite=False)
        except (LinAlgError, LinAlgWarning):
            return None


def is_singular(system: FloatArray) -> bool:
    """Return whether a symmetric system (n, n) is singular, so that least squares solve it."""
    return _regular(system, np.zeros((len(system), 1))) is None


def pseudo_inverse(system: FloatArray, rank: int | None = None) -> tuple[FloatArray, FloatArray]:
    """Return the k largest eigenvalues (k,), by absolute value, and eigenvectors (n, k).

    Of a singular symmetric system; k is its ``rank``, found with the threshold of the least-squares
    solution if not given.
    """
    values, vectors = np.linalg.eigh(system)
    order = np.argsort(-np.abs(values), kind="stable")
    size = np.abs(values[order])
    if rank is None:
        rank = int(np.count_nonzero(size > PIVOT_GUARD * size[0]))
    return values[order[:rank]], vectors[:, order[:rank]]


def saddle_condition(matrix: FloatArray, terms: FloatArray) -> float:
    """Return the condition number (1-norm) of a system with a polynomial; inf when singular."""
    return float(np.linalg.cond(saddle_system(matrix, terms)[0], 1))


def saddle_system(matrix: FloatArray, terms: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return ``[[G, P], [P^T, 0]]`` with P the independent columns of terms, and their indices."""
    use = independent(terms)
    n = len(matrix)
    q = len(use)
    system = np.zeros((n + q, n + q))
    system[:n, :n] = matrix
    system[:n, n:] = terms[:, use]
    system[n:, :n] = terms[:, use].T
    return system, use


def independent(terms: FloatArray) -> IntArray:
    """Return the columns of the polynomial's terms (n, q) that do not depend on others, (k,)."""
    if not len(terms):
        return NO_NODES
    scale = np.maximum(np.abs(terms).max(axis=0), 1e-300)
    r, order = qr(terms / scale, pivoting=True, mode="r")
    size = np.abs(np.diag(r))
    return np.sort(order[: len(size)][size > RANK * size.max(initial=0.0)])


def polynomial(terms: FloatArray, forward: FloatArray, right: FloatArray) -> FloatArray:
    """Return the coefficients c (q, m) of ``[[G, P], [P^T, 0]] [w, c] = [b, 0]``, G = L L^T.

    With them, w solves ``G w = b - P c``. They are least squares of L^-1 (b - P c): so a definite
    system keeps its factor, pivot guard and blocks.
    ``terms`` and ``forward`` (n, q): P, and L^-1 P of the rows that the factor retains, in any
    order.
    ``right`` (n, m): L^-1 b of the same rows.
    """
    use = independent(terms)
    tail = np.zeros((terms.shape[1], right.shape[1]))
    scale = np.maximum(np.abs(terms[:, use]).max(axis=0, initial=0.0), 1e-300)
    found = np.linalg.lstsq(forward[:, use] / scale, right, rcond=None)[0]
    tail[use] = found / scale[:, None]
    return tail


PIVOT_GUARD = 1e-12
"""A row whose pivot is smaller is left out. Absolute, for the diagonal of every factorised system
is 1: phi(0) = 1 for all kernels that need no polynomial, and directions are unit vectors. `saddle`
has it as a part of the largest eigenvalue; ``refine.SHIFT`` is added to the rows left out."""

BLOCK = 512  # columns of the matrix factorised between two calls of ``tick``

TRIANGLE = 512  # rows of a triangular solve that hold the interpreter lock: some milliseconds

NORM_CYCLES = 5  # most cycles of the estimate of a norm, which is mostly done after two

SMALL_FLOPS = 50_000_000
"""Work below which the threads of the linear algebra library wait longer than they work."""


@cache
def _libraries() -> ThreadpoolController:
    """Return the controller of the threads of loaded libraries; finding these takes long."""
    return ThreadpoolController()


def enough_threads(flops: float) -> AbstractContextManager[object]:
    """Return a context in which BLAS has one thread for work of at most `SMALL_FLOPS`."""
    if flops > SMALL_FLOPS:
        return nullcontext()
    return _libraries().limit(limits=1, user_api="blas")


@record
class Factor:
    """The Cholesky factor L of the ``retained`` rows and columns of a system G (n, n)."""

    lower: FloatArray  # (k, k): L
    retained: IntArray  # (k,): the rows of G that are in the system, in order
    dropped: IntArray  # (n - k,): rows left out because their remaining pivot is below the guard

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the weights (n, m) for right-hand sides (n, m); zero in dropped rows."""
        out = np.zeros_like(right, dtype=float)
        half = solve_lower(self.lower, right[self.retained])
        out[self.retained] = solve_lower(self.lower, half, transposed=True)
        return out


NOTHING = Factor(np.empty((0, 0)), NO_NODES, NO_NODES)
"""The factor of a matrix without rows."""


def solve_lower(
    lower: FloatArray, right: FloatArray, transposed: bool = False, arrays: Arrays = HOST
) -> FloatArray:
    """Return ``L^-1 B`` (or ``L^-T B``) for a lower triangular L (n, n) and B (n, m).

    By blocks, because SciPy's triangular solver keeps the interpreter lock, for seconds on large
    systems, and with it a window still; products of matrices do not.
    ``arrays``: those that L and B are.
    """
    out = arrays.module.array(right, dtype=float)
    starts = range(0, len(lower), TRIANGLE)
    for start in reversed(starts) if transposed else starts:
        here = slice(start, start + TRIANGLE)
        if transposed:
            out[here] -= lower[start + TRIANGLE :, here].T @ out[start + TRIANGLE :]
        else:
            out[here] -= lower[here, :start] @ out[:start]
        corner = lower[here, here]
        out[here] = arrays.solve_triangular(
            corner, out[here], lower=True, trans=1 if transposed else 0, check_finite=False
        )
    return out


def condition(*factors: FloatArray) -> float:
    """Return the condition number, in the 1-norm (`_norm`), of blocks L L^T; 1.0 without rows."""
    sizes = np.array([_norms(lower) for lower in factors if len(lower)])
    return float(np.prod(sizes.max(axis=0))) if len(sizes) else 1.0


def _norms(lower: FloatArray) -> tuple[float, float]:
    """Return the 1-norms of L L^T and of its inverse, the latter estimated."""
    n = len(lower)
    if n < 5:
        full = lower @ lower.T
        return float(np.linalg.norm(full, 1)), float(np.linalg.norm(np.linalg.inv(full), 1))

    def product(x: FloatArray) -> FloatArray:
        return lower @ (lower.T @ x)

    def inverse(x: FloatArray) -> FloatArray:
        return solve_lower(lower, solve_lower(lower, x), transposed=True)

    return _norm(product, n), _norm(inverse, n)


def _norm(apply: Callable[[FloatArray], FloatArray], n: int) -> float:
    """Return a mostly sharp lower bound of the 1-norm of a symmetric operator on columns (n, 1).

    Algorithm 2.4 of N. J. Higham and F. Tisseur, A block algorithm for matrix 1-norm estimation
    (SIAM J. Matrix Anal. Appl. 21, 2000), with one column: further columns would be random, and
    equal runs would report different numbers. The result is that of SciPy's ``onenormest``, which
    takes long to load.
    """
    x = np.full((n, 1), 1.0) / n
    signs = np.zeros((n, 1))
    norm = 0.0
    at = -1
    for cycle in range(NORM_CYCLES + 1):
        y = apply(x)
        found = float(np.abs(y).sum(axis=0)[0])
        if cycle and found <= norm:
            break
        norm = found
        before = signs
        signs = np.where(y == 0, 1.0, np.sign(y))
        if cycle == NORM_CYCLES or signs[:, 0] @ before[:, 0] == n:
            break
        slope = np.abs(apply(signs))[:, 0]
        if cycle and slope.max() == slope[at]:
            break
        at = int(np.argsort(slope)[-1])
        x = np.zeros((n, 1))
        x[at] = 1.0
    return norm


def factorise(matrix: FloatArray, tick: Tick = no_tick) -> Factor:
    """Return the factor of a matrix (n, n) with unit diagonal; DeformError if not finite."""
    return extend(NOTHING, matrix, tick)


def extend(before: Factor, rows: FloatArray, tick: Tick = no_tick, arrays: Arrays = HOST) -> Factor:
    """Return the factor of a matrix whose leading block has the factor ``before``.

    Left-looking by blocks of columns, so that ``tick`` is called, and may stop the work, every
    few tens of milliseconds even for 10,000 unknowns. Raises DeformError if the matrix has numbers
    that are not finite.
    ``rows`` (m, n + m): the last m rows of the symmetric matrix; ``before`` is of the first n.
    ``arrays``: those to compute with. The host has the matrix, and factorises the diagonal blocks.
    """
    module = arrays.module
    require_finite(rows)
    done = len(before.lower)
    more = len(rows)
    old = rows.shape[1] - more
    corner = rows[:, old:]
    dropped = np.zeros(more, bool)
    lower = module.zeros((done + more, done + more), order="F")
    old_lower = module.asarray(before.lower)
    lower[:done, :done] = old_lower
    if done:
        beside = module.asarray(rows[:, before.retained].T)
        lower[done:, :done] = solve_lower(old_lower, beside, arrays=arrays).T
    for start in range(0, more, BLOCK):
        stop = min(more, start + BLOCK)
        here = slice(done + start, done + stop)
        below = slice(done + stop, None)
        panel = module.asarray(corner[start:, start:stop]) - (
            lower[done + start :, : here.start] @ lower[here, : here.start].T
        )
        head = module.asarray(_cholesky(arrays.to_host(panel[: stop - start]), dropped[start:stop]))
        lower[here, here] = head
        if stop < more:
            rest = solve_lower(head, panel[stop - start :].T, arrays=arrays)
            rest[module.asarray(dropped[start:stop])] = 0.0
            lower[below, here] = rest.T
        tick((stop / more) ** 2)
    kept = np.concatenate([before.retained, old + np.flatnonzero(~dropped)])
    lower = arrays.to_host(lower)
    if not dropped.any():
        return Factor(lower, kept, before.dropped)
    stay = np.concatenate([np.arange(done), done + np.flatnonzero(~dropped)])
    left_out = np.concatenate([before.dropped, old + np.flatnonzero(dropped)])
    return Factor(np.asfortranarray(lower[np.ix_(stay, stay)]), kept, left_out)


def _cholesky(block: FloatArray, dropped: BoolArray) -> FloatArray:
    """Return a diagonal block's factor, rows of the identity where the guard sets ``dropped``."""
    try:
        head = np.asarray(np.linalg.cholesky(block), np.float64)
        if np.min(np.diag(head)) ** 2 >= PIVOT_GUARD:
            return head
    except np.linalg.LinAlgError:
        pass
    guarded: FloatArray = np.array(block, np.float64)
    _guarded_cholesky(guarded, PIVOT_GUARD, dropped)
    return guarded


@njit
def _guarded_cholesky(a, guard, dropped):  # type: ignore[no-untyped-def]
    """Factorise in place; pivots below ``guard`` give identity rows, and set ``dropped``."""
    n = len(a)
    for j in range(n):
        for i in range(j):
            a[i, j] = 0.0
        pivot = a[j, j]
        for k in range(j):
            pivot -= a[j, k] * a[j, k]
        if pivot < guard:
            dropped[j] = True
            a[j, :j] = 0.0
            a[j + 1 :, j] = 0.0
            a[j, j] = 1.0
            continue
        root = np.sqrt(pivot)
        a[j, j] = root
        for i in range(j + 1, n):
            value = a[i, j]
            for k in range(j):
                value -= a[i, k] * a[j, k]
            a[i, j] = value / root


def require_finite(matrix: FloatArray) -> None:
    """Raise DeformError if any entry of a matrix is not finite."""
    if not np.all(np.isfinite(matrix)):
        raise DeformError(
            "the interpolation system has numbers that are not finite; check the coordinates "
            "and displacements for NaN and the support radius for zero"
        )
