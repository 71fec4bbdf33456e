"""Sparse linear systems: a factorisation, or preconditioned conjugate gradients."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from threading import Thread
from typing import Any, TypeVar

import numpy as np
from numba import prange
from scipy.linalg import eigvalsh_tridiagonal
from scipy.sparse import bsr_array
from scipy.sparse.linalg import splu

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray
from slideviz.rbf.compiled import one_at_a_time
from slideviz.rbf.evaluate import Tick, no_tick
from slideviz.rbf.solve import enough_threads
from slideviz.rbf.tape import Linear
from slideviz.system.jit_cache import njit

TOLERANCE = 1e-9
"""Error, as a part of the largest unknown, at which the iteration ends."""

LIMIT = 1e-7
"""Largest error of a solution that is accepted, as a part of the largest displacement."""

MAX_ITERATIONS = 1000

REFINEMENTS = 6  # most solutions with one factorisation, each of what the last one left

DIRECT = {2: 400_000, 3: 10_000}
"""Largest number of unknowns of a system that is factorised at once, by the size of its blocks: in
2D this is faster than iterations, and exact."""

LAST = 5  # systems larger than that by this factor are factorised where iterations fail

WAIT_SECONDS = 0.1  # between two calls of tick while the hierarchy is made

MAKING = 0.3  # the part of the progress at which the hierarchy is made

Made = TypeVar("Made")


@record
class LinearSolution:
    """What the solver found."""

    x: FloatArray  # (n,): the solution
    error: float
    """Estimate of the largest error, as a part of the largest displacement; inf or nan where the
    iteration broke down."""
    smallest: float = 1.0
    """Smallest eigenvalue, at most 1, of the preconditioned matrix: how little of an error the
    preconditioner may see."""


Residual = Callable[[FloatArray], FloatArray]
"""Takes unknowns (n,); returns what is left of the right-hand side (n,)."""


def solve(
    matrix: bsr_array,
    preconditioner: Callable[[], Linear],
    residual: Residual,
    start: FloatArray,
    scale: float,
    tick: Tick = no_tick,
) -> LinearSolution:
    """Solve a symmetric system.

    Small ones by a sparse factorisation, others by conjugate gradients, and where these do not
    come to `LIMIT`, by a factorisation again, if they are not too large.
    ``matrix`` (n, n): in blocks; ``residual`` may be more accurate than its products are.
    ``preconditioner``: makes a symmetric, positive definite map (n,) to (n,), about the inverse of
    the matrix.
    ``start`` (n,): a guess of the solution.
    ``scale``: the largest displacement that is known.
    """
    right = residual(start)
    if not np.any(right):
        return LinearSolution(start, 0.0)

    def iterated() -> LinearSolution:
        precondition = while_ticking(preconditioner, tick)
        with enough_threads(0.0):  # the same bits for any number of threads
            found = conjugate_gradients(matrix, precondition, right, tick, scale)
        x = start + found.x
        left = _part(precondition(residual(x)), x, scale) / found.smallest
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

    What makes a preconditioner of a large mesh takes seconds and has no callback. When ``tick``
    raises, the thread runs to its end, but nobody waits for it.
    """
    future: Future[Made] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as problem:  # handed to the thread that waits
            future.set_exception(problem)

    Thread(target=run, daemon=True, name="preconditioner").start()
    done = 0.0
    while True:
        try:
            return future.result(timeout=WAIT_SECONDS)
        except TimeoutError:
            if future.done():
                raise
            done += (1.0 - done) / 50
            tick(MAKING * done)


def _product(matrix: Any, x: FloatArray) -> FloatArray:
    """Return the product of a matrix in blocks (n, n) with a vector (n,)."""
    out = np.empty((len(matrix.indptr) - 1, matrix.data.shape[1]))
    with one_at_a_time(matrix.data.size):
        product(matrix.indptr, matrix.indices, matrix.data, x.reshape(out.shape), out)
    return out.ravel()


def conjugate_gradients(
    matrix: bsr_array,
    precondition: Linear,
    right: FloatArray,
    tick: Tick = no_tick,
    scale: float = 0.0,
) -> LinearSolution:
    """Solve by preconditioned conjugate gradients.

    Saad, Iterative Methods for Sparse Linear Systems, algorithm 9.1. The error is judged by what
    the preconditioner makes of the residual, divided by the smallest eigenvalue of the
    preconditioned matrix, which the iteration finds (section 6.7.3: Lanczos' tridiagonal matrix): a
    preconditioner that does not see an error has a small one. The matrix may be indefinite: then
    the iteration may break down, and says so by its error.
    ``matrix`` (n, n): in blocks.
    ``precondition``: as ``preconditioner`` of `solve` makes it.
    ``right`` (n,): right-hand side.
    ``scale``: the largest displacement that is known.
    """
    x = np.zeros_like(right)
    left = right.copy()
    z = precondition(left)
    energy = float(left @ z)
    along = z
    done = 0.0
    sizes = [1.0]
    turns = [0.0]
    for _ in range(MAX_ITERATIONS):
        part = _part(z, x, scale)
        if not energy > 0.0 or part <= TOLERANCE * _smallest(sizes, turns):
            break
        done = max(done, np.log(min(part, 1.0)) / np.log(TOLERANCE))
        tick(MAKING + (1.0 - MAKING) * min(1.0, done))
        image = _product(matrix, along)
        curvature = float(along @ image)
        if curvature == 0.0:
            return LinearSolution(x, np.inf)
        size = energy / curvature
        x += size * along
        left -= size * image
        z = precondition(left)
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
