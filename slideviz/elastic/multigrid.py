"""Conjugate gradients, preconditioned by multigrid cycles (smoothed aggregation).

pyamg makes the hierarchy of levels from the rigid motions. The cycles are computed here, because
pyamg's own sweeps hold the interpreter lock for seconds on large meshes, and freeze a window.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from threading import Thread
from typing import Any, TypeVar

import numpy as np
from numba import prange
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import bsr_array, bsr_matrix

from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.evaluate import Tick, no_tick
from slideviz.rbf.solve import enough_threads
from slideviz.system.jit_cache import njit

TOLERANCE = 1e-8
"""Residual ratio, in the energy norm of the preconditioner, at which the iteration ends."""

MAX_ITERATIONS = 300

COARSE = 600  # largest number of unknowns of the coarsest level, which has a dense factor

RIDGE = 1e-12
"""Added to the diagonal of the coarsest matrix, relative to it. A mesh that may slide as a whole
makes the matrix singular; its right-hand side is consistent then."""

WAIT_SECONDS = 0.1  # between two calls of tick while the hierarchy is made

MAKING = 0.3  # the part of the progress at which the hierarchy is made

Made = TypeVar("Made")

_OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "fastmath": True}


@dataclass(frozen=True, eq=False)
class LinearSolution:
    """What the iteration found."""

    x: FloatArray  # (n,): the solution
    iterations: int
    residual_ratio: float
    """Last residual over that of x = 0, in the energy norm of the preconditioner: small is good."""

    @property
    def converged(self) -> bool:
        """Return whether the residual ratio is at most `TOLERANCE`."""
        return self.residual_ratio <= TOLERANCE


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


def solve(
    matrix: bsr_array, right: FloatArray, modes: FloatArray, start: FloatArray, tick: Tick = no_tick
) -> LinearSolution:
    """Solve a symmetric positive definite system; x = 0 where the right-hand side is zero.

    ``matrix`` (n, n): in blocks.
    ``right``, ``start`` (n,): right-hand side, and a guess of the solution.
    ``modes`` (n, m): vectors of nearly no energy: the rigid motions.
    """
    if not np.any(right):
        return LinearSolution(np.zeros_like(right), 0, 0.0)
    levels = while_ticking(lambda: hierarchy(matrix, modes), tick)
    return conjugate_gradients(levels, right, start, tick)


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
    import pyamg

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
    matrix, shape = level.matrix, level.inverse.shape[:2]
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
    levels: list[Level],
    right: FloatArray,
    start: FloatArray,
    tick: Tick = no_tick,
    *,
    tolerance: float = TOLERANCE,
) -> LinearSolution:
    """Solve by conjugate gradients, preconditioned by V-cycles.

    Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1.
    ``levels``: of the matrix, as ``hierarchy`` returns them.
    ``right``, ``start`` (n,): right-hand side, and a guess of the solution.
    ``tolerance``: residual ratio at which the iteration ends.
    """
    with enough_threads(0.0):  # the same bits for any number of threads
        return _conjugate_gradients(levels, right, start, tick, tolerance)


def _conjugate_gradients(
    levels: list[Level], right: FloatArray, start: FloatArray, tick: Tick, tolerance: float
) -> LinearSolution:
    matrix = levels[0].matrix
    first = float(right @ _cycle(levels, right))
    x = np.array(start, float)
    left = right - _product(matrix, x) if np.any(start) else right.copy()
    z = _cycle(levels, left)
    energy, along, ratio = float(left @ z), z, np.inf
    for count in range(MAX_ITERATIONS + 1):
        ratio = float(np.sqrt(max(energy, 0.0) / first)) if first > 0 else np.nan
        if not ratio > tolerance or count == MAX_ITERATIONS:
            return LinearSolution(x, count, ratio)
        tick(MAKING + (1.0 - MAKING) * min(1.0, np.log(min(ratio, 1.0)) / np.log(tolerance)))
        image = _product(matrix, along)
        size = energy / float(along @ image)
        x += size * along
        left -= size * image
        z = _cycle(levels, left)
        before, energy = energy, float(left @ z)
        along = z + (energy / before) * along
    raise AssertionError


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


@njit(parallel=True, nogil=True, cache=True)
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
