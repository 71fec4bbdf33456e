"""Sparse linear systems: a factorisation, or conjugate gradients with multigrid cycles.

Cycles are those of smoothed aggregation. pyamg makes the hierarchy of levels from the rigid
motions. The cycles are computed here, because pyamg's own sweeps hold the interpreter lock for
seconds on large meshes, and freeze a window.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from threading import Thread
from typing import Any, TypeVar

import numpy as np
import pyamg
from numba import prange
from scipy.linalg import LinAlgError, cho_factor, cho_solve, eigvalsh_tridiagonal
from scipy.sparse import bsr_array, bsr_matrix
from scipy.sparse.linalg import splu

from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.evaluate import Tick, no_tick
from slideviz.rbf.solve import enough_threads
from slideviz.system.jit_cache import njit

TOLERANCE = 1e-9
"""Error, as a part of the largest unknown, at which the iteration ends."""

LIMIT = 1e-7
"""Largest error of a solution that is accepted, as a part of the largest displacement."""

MAX_ITERATIONS = 300

REFINEMENTS = 6  # most solutions with one factorisation, each of what the last one left

DIRECT = {2: 400_000, 3: 10_000}
"""Largest number of unknowns of a system that is factorised at once, by the size of its blocks: in
2D this is faster than iterations, and exact."""

LAST = 5  # systems larger than that by this factor are factorised where iterations fail

COARSE = 600  # largest number of unknowns of the coarsest level, which has a dense factor

RIDGE = 1e-12
"""Added to the diagonal of the coarsest matrix, relative to it. A mesh that may slide as a whole
makes the matrix singular; its right-hand side is consistent then."""

WAIT_SECONDS = 0.1  # between two calls of tick while the hierarchy is made

MAKING = 0.3  # the part of the progress at which the hierarchy is made

Made = TypeVar("Made")

_OPTIONS: dict[str, Any] = {"fastmath": True, "error_model": "python"}


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """What the solver found."""

    x: FloatArray  # (n,): the solution
    error: float
    """Estimate of the largest error, as a part of the largest displacement; inf or nan where the
    iteration broke down."""
    smallest: float = 1.0
    """Smallest eigenvalue, at most 1, of the preconditioned matrix: how little of an error a cycle
    may see."""


@dataclass(frozen=True, eq=False)
class Level:
    """A level of the hierarchy."""

    matrix: bsr_array
    inverse: FloatArray  # (m, b, b): inverses of its diagonal blocks; empty on the coarsest level
    up: Any = None
    down: Any = None
    """`up`, `down`: prolongation from the next coarser level, and restriction to it; None on the
    coarsest."""
    factor: Any = None  # dense Cholesky factor, on the coarsest level only


Residual = Callable[[FloatArray], FloatArray]
"""Takes unknowns (n,); returns what is left of the right-hand side (n,)."""


def solve(
    matrix: bsr_array,
    like: Callable[[], bsr_array],
    residual: Residual,
    modes: FloatArray,
    start: FloatArray,
    scale: float,
    tick: Tick = no_tick,
) -> LinearSolution:
    """Solve a symmetric system.

    Small ones by a sparse factorisation, others by conjugate gradients, and where these do not
    come to `LIMIT`, by a factorisation again, if they are not too large.
    ``matrix`` (n, n): in blocks; ``residual`` may be more accurate than its products are.
    ``like``: makes a positive definite matrix like it, for the cycles.
    ``modes`` (n, m): vectors of nearly no energy: the rigid motions.
    ``start`` (n,): a guess of the solution.
    ``scale``: the largest displacement that is known.
    """
    right = residual(start)
    if not np.any(right):
        return LinearSolution(start, 0.0)

    def iterated() -> LinearSolution:
        try:
            levels = while_ticking(lambda: hierarchy(like(), modes), tick)
        except LinAlgError:  # the coarsest matrix is not positive definite
            return LinearSolution(start, np.inf)
        found = conjugate_gradients(matrix, levels, right, tick, scale=scale)
        x = start + found.x
        left = _part(_cycle(levels, residual(x)), x, scale) / found.smallest
        return replace(found, x=x, error=max(found.error, left))

    def exact() -> LinearSolution:
        return while_ticking(lambda: factorised(matrix, residual, start, scale), tick)

    size = len(right)
    at_once = DIRECT[matrix.blocksize[0]]
    ways = [exact, iterated] if size <= at_once else [iterated, exact]
    found = ways[0]()
    if found.error <= LIMIT or size > LAST * at_once:
        return found
    return ways[1]()


def factorised(
    matrix: bsr_array, residual: Residual, start: FloatArray, scale: float
) -> LinearSolution:
    """Solve a system by a sparse factorisation, refined until corrections are small.

    The error is the last correction, so that the solution is better than it says; inf where the
    matrix is singular.
    """
    x = start
    before = np.inf
    with enough_threads(0.0):  # the same bits for any number of threads
        try:
            factor = splu(matrix.tocsc())
        except RuntimeError:
            return LinearSolution(x, np.inf)
        for _ in range(REFINEMENTS):
            change = factor.solve(residual(x))
            x = x + change
            error = _part(change, x, scale)
            if not TOLERANCE < error < before:
                break
            before = error
    return LinearSolution(x, error)


def _part(change: FloatArray, x: FloatArray, scale: float) -> float:
    """Return the largest of changes (n,) as a part of the largest displacement."""
    return float(np.abs(change).max() / max(np.abs(x).max(), scale, 1e-300))


def while_ticking(work: Callable[[], Made], tick: Tick) -> Made:
    """Return what ``work`` returns; call ``tick`` while it runs in a thread. ``tick`` may raise.

    pyamg's set-up of a large mesh takes seconds and has no callback. When ``tick`` raises, the
    thread runs to its end, but nobody waits for it.
    """
    future: Future[Made] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as problem:  # handed to the thread that waits
            future.set_exception(problem)

    Thread(target=run, daemon=True, name="multigrid").start()
    done = 0.0
    while True:
        try:
            return future.result(timeout=WAIT_SECONDS)
        except TimeoutError:
            if future.done():
                raise
            done += (1.0 - done) / 50
            tick(MAKING * done)


def hierarchy(matrix: bsr_array, modes: FloatArray) -> list[Level]:
    """Return the levels of a matrix, finest first; parameters as of ``solve``."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyamg tells of conversions that are meant
        made = pyamg.smoothed_aggregation_solver(
            bsr_matrix(matrix),
            B=modes,
            # By row sums: the spectral radius that is the default is found from random numbers,
            # so that the same case gave other bits each time.
            smooth=("jacobi", {"omega": 4.0 / 3.0, "weighting": "local"}),
            improve_candidates=None,
            presmoother=None,
            postsmoother=None,
            max_coarse=COARSE,
        ).levels
    levels = []
    for level in made[:-1]:
        inverse = np.linalg.pinv(_diagonal(level.A), hermitian=True)
        levels.append(Level(level.A, np.ascontiguousarray(inverse), level.P, level.R))
    dense = made[-1].A.toarray()
    diagonal = np.diag(dense).copy()
    # Rows of nothing: motions that the nodes of an aggregate do not have.
    dense[np.diag_indices_from(dense)] += np.where(diagonal > 0, RIDGE * diagonal, 1.0)
    with enough_threads(0.0):
        factor = cho_factor(dense, lower=True, check_finite=False)
    levels.append(Level(made[-1].A, np.empty((0, 1, 1)), factor=factor))
    return levels


def _diagonal(matrix: Any) -> FloatArray:
    """Return the diagonal blocks (m, b, b) of a matrix in blocks; zero where it has none."""
    rows = np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))
    there = rows == matrix.indices
    out = np.zeros((len(matrix.indptr) - 1, *matrix.data.shape[1:]))
    out[rows[there]] = matrix.data[there]
    return out


def _product(matrix: Any, x: FloatArray) -> FloatArray:
    """Return the product of a matrix in blocks (n, n) with a vector (n,)."""
    out = np.empty((len(matrix.indptr) - 1, matrix.data.shape[1]))
    with one_at_a_time(matrix.data.size):
        product(matrix.indptr, matrix.indices, matrix.data, x.reshape(out.shape), out)
    return out.ravel()


def _sweep(level: Level, right: FloatArray, x: FloatArray, backward: bool) -> None:
    """Smooth x (n,) in place by one Gauss-Seidel sweep."""
    matrix = level.matrix
    shape = level.inverse.shape[:2]
    blocks = right.reshape(shape), x.reshape(shape)
    sweep(matrix.indptr, matrix.indices, matrix.data, level.inverse, *blocks, backward)


def _cycle(levels: list[Level], right: FloatArray) -> FloatArray:
    """Return the correction (n,) of one V-cycle for the residual ``right``.

    One sweep on the way down, and one backwards on the way up, so that it is symmetric.
    """
    level = levels[0]
    if level.factor is not None:
        return np.asarray(cho_solve(level.factor, right, check_finite=False))
    x = np.zeros_like(right)
    _sweep(level, right, x, backward=False)
    left = right - _product(level.matrix, x)
    x += level.up @ _cycle(levels[1:], np.ascontiguousarray(level.down @ left))
    _sweep(level, right, x, backward=True)
    return x


def conjugate_gradients(
    matrix: bsr_array,
    levels: list[Level],
    right: FloatArray,
    tick: Tick = no_tick,
    *,
    tolerance: float = TOLERANCE,
    scale: float = 0.0,
) -> LinearSolution:
    """Solve by conjugate gradients, preconditioned by V-cycles.

    Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1. The error is judged by what a
    V-cycle makes of the residual, divided by the smallest eigenvalue of the preconditioned matrix,
    which the iteration finds (section 6.7.3: Lanczos' tridiagonal matrix): a cycle that does not
    see an error has a small one. The matrix may be indefinite: then the iteration may break down,
    and says so by its error.
    ``matrix`` (n, n): in blocks.
    ``levels``: of the matrix, or of a positive definite one like it, as ``hierarchy`` returns them.
    ``right`` (n,): right-hand side.
    ``tolerance``: error at which the iteration ends, as a part of the largest displacement.
    ``scale``: the largest displacement that is known.
    """
    with enough_threads(0.0):  # the same bits for any number of threads
        return _conjugate_gradients(matrix, levels, right, tick, tolerance, scale)


def _conjugate_gradients(
    matrix: bsr_array,
    levels: list[Level],
    right: FloatArray,
    tick: Tick,
    tolerance: float,
    scale: float,
) -> LinearSolution:
    x = np.zeros_like(right)
    left = right.copy()
    z = _cycle(levels, left)
    energy = float(left @ z)
    along = z
    sizes = [1.0]
    turns = [0.0]
    for _ in range(MAX_ITERATIONS):
        part = _part(z, x, scale)
        if not energy > 0.0 or part <= tolerance * _smallest(sizes, turns):
            break
        done = np.log(min(part, 1.0)) / np.log(tolerance)
        tick(MAKING + (1.0 - MAKING) * min(1.0, done))
        image = _product(matrix, along)
        curvature = float(along @ image)
        if curvature == 0.0:
            return LinearSolution(x, np.inf)
        size = energy / curvature
        x += size * along
        left -= size * image
        z = _cycle(levels, left)
        before = energy
        energy = float(left @ z)
        along = z + (energy / before) * along
        sizes.append(size)
        turns.append(energy / before)
    smallest = _smallest(sizes, turns)
    return LinearSolution(x, _part(z, x, scale) / smallest, smallest)


def _smallest(sizes: list[float], turns: list[float]) -> float:
    """Return the size of the smallest eigenvalue, at most 1, that conjugate gradients found.

    ``sizes``, ``turns``: of each iteration alpha and beta, after a first one of 1 and 0.
    """
    alpha = np.array(sizes[1:])
    beta = np.array(turns)[: len(sizes) - 1]
    if not len(alpha):
        return 1.0
    diagonal = 1.0 / alpha + beta / np.array(sizes[:-1])
    off = np.sqrt(beta[1:]) / np.abs(alpha[:-1])
    return float(min(1.0, np.abs(eigvalsh_tridiagonal(diagonal, off)).min()))


@njit(**_OPTIONS)
def sweep(indptr, indices, data, inverse, right, x, backward):  # type: ignore[no-untyped-def]
    """Make one Gauss-Seidel sweep by blocks on x (m, b), in place.

    ``indptr``, ``indices`` and ``data`` (k, b, b) are those of the block matrix, ``inverse``
    (m, b, b) the inverses of its diagonal blocks.
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


@njit(parallel=True)
def product(indptr, indices, data, x, out):  # type: ignore[no-untyped-def]
    """Write the product of a matrix in blocks with x (m, b) to out (m, b).

    Sums keep their order (no ``fastmath``): Numba optimises this loop differently where it is
    compiled and where it comes from the cache, so that the first run gave other bits than the next.
    """
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
