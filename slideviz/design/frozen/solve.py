"""Solvers of the systems of a frozen step, with kept factors, for several designs at once."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve_triangular

from slideviz.case.words import wrong_by
from slideviz.errors import ConditionWarning, DeformError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.refine import TRUSTED, System
from slideviz.rbf.solve import Factor, enough_threads
from slideviz.rbf.tape import Array, recorded, value

REMEDY = (
    "use DATA_REDUCTION= YES with a larger tolerance, a less smooth RBF_KERNEL such as "
    "wendland-c0, or a smaller INFLUENCE_FACTOR"
)
"""What to do about a badly conditioned system, in warnings."""


class MeasuredSystem:
    """Solves a system in blocks, and estimates the errors of the fields of its solutions."""

    def __init__(self, blocks: list[IntArray], systems: list[System], *, refined: bool) -> None:
        self._blocks = blocks
        self._systems = systems
        self._refined = refined
        self.error_estimate: FloatArray = np.zeros(())
        """(...,): estimated error of each of the last solutions, as a part of its largest datum."""

    def __call__(
        self, right: FloatArray, data: FloatArray | None = None, *, of_weights: bool = False
    ) -> FloatArray:
        """Return the solutions (..., n, m) for right-hand sides, and set ``error_estimate``.

        Errors are parts of the largest of ``data`` (..., n, m), if not of the right-hand sides;
        ``of_weights``: as of ``System.refined``.
        """
        n, m = right.shape[-2:]
        wide = np.ascontiguousarray(np.moveaxis(right.reshape(-1, n, m), 0, 1).reshape(n, -1))
        largest = np.abs(right if data is None else data).max(axis=(-1, -2), initial=0.0)
        largest = np.repeat(largest.ravel(), m)
        out = np.empty_like(wide)
        error_estimate = np.zeros(len(largest))
        for block, system in zip(self._blocks, self._systems, strict=True):
            with enough_threads(2.0 * len(block) * wide[block].size):
                solved = system.factor.solve(wide[block])
                if self._refined:
                    refined = system.refined(wide[block], largest, solved, of_weights=of_weights)
                    solved = refined.weights
                    field_error = refined.error_estimate
                else:
                    parts = [slice(first, first + m) for first in range(0, wide.shape[1], m)]
                    off = [system.field_error(wide[block, at], solved[:, at]) for at in parts]
                    field_error = np.concatenate(off) / np.where(largest > 0.0, largest, 1.0)
            out[block] = solved
            error_estimate = np.maximum(error_estimate, field_error)
        self.error_estimate = error_estimate.reshape(*right.shape[:-2], m).max(axis=-1)
        shaped = np.moveaxis(out.reshape(n, -1, m), 1, 0)
        return np.ascontiguousarray(shaped).reshape(right.shape)

    def tangent(self, right: FloatArray, data: FloatArray | None = None) -> FloatArray:
        """Return the solutions (..., n, m) of the forward pass: changes of weights.

        Warns with ConditionWarning if the field of a solution is not accurate to `TRUSTED`.
        """
        weights = self(right, data)
        worst = float(self.error_estimate.max(initial=0.0))
        if worst > TRUSTED:
            warnings.warn(
                "the system of the derivative is nearly singular: between the boundary nodes it "
                f"may be wrong by {wrong_by(worst, bounded=self._refined)}; {REMEDY}",
                ConditionWarning,
                stacklevel=2,
            )
        return weights

    def adjoint(self, right: FloatArray, data: FloatArray | None = None) -> FloatArray:
        """Return the solutions (..., n, m) of the reverse pass, which are gradients themselves.

        Warns with ConditionWarning if the solution is not accurate to `TRUSTED`.
        """
        if not self._refined:  # the error of a field is not a measure for a gradient
            return solved(self._blocks, [system.factor for system in self._systems], right)
        weights = self(right, data, of_weights=True)
        worst = float(self.error_estimate.max(initial=0.0))
        if worst > TRUSTED:
            warnings.warn(
                "the system of the gradient is nearly singular: gradients with respect to nodes "
                f"that nearly coincide may be wrong by {wrong_by(min(worst, 1.0), bounded=True)}; "
                f"{REMEDY}",
                ConditionWarning,
                stacklevel=2,
            )
        return weights


class WithPolynomial:
    """Solves ``[[G, P], [P^T, 0]] [w, c] = [b, g]`` by a solver of G w = b, as `solve.polynomial`.

    Both blocks of the solution follow from w = G^-1 (b - P c): so a linear motion is exact however
    nearly singular G is.
    """

    def __init__(self, inner: Callable[..., FloatArray], terms: FloatArray, use: IntArray) -> None:
        """Prepare the solver for P, ``terms`` (n, q), of which the columns ``use`` (k,) count."""
        self._inner = inner
        self._n = len(terms)
        self._rows = len(terms) + use
        self._q, self._r = np.linalg.qr(terms[:, use])
        self._inverse = inner(self._q)
        self._schur = lu_factor(self._q.T @ self._inverse)

    def __call__(self, right: FloatArray) -> FloatArray:
        """Return the solutions (..., n + q, m) for right-hand sides."""
        return self._solved(self._inner, right)

    def tangent(self, right: FloatArray) -> FloatArray:
        """Return the solutions of the forward pass (``MeasuredSystem.tangent``)."""
        return self._solved(getattr(self._inner, "tangent", self._inner), right)

    def adjoint(self, right: FloatArray) -> FloatArray:
        """Return the solutions of the reverse pass (``MeasuredSystem.adjoint``)."""
        return self._solved(getattr(self._inner, "adjoint", self._inner), right)

    @property
    def error_estimate(self) -> FloatArray:
        """The estimate of ``MeasuredSystem``; 0 of a solver without."""
        return np.asarray(getattr(self._inner, "error_estimate", 0.0))

    def _solved(self, solve: Callable[..., FloatArray], right: FloatArray) -> FloatArray:
        data = np.ascontiguousarray(right[..., : self._n, :])
        out = np.zeros_like(right)
        free = columnwise(
            partial(solve_triangular, self._r, trans=1, check_finite=False),
            right[..., self._rows, :],
        )
        along = columnwise(partial(lu_solve, self._schur), self._inverse.T @ data - free)
        rest = data - self._q @ along
        measured = isinstance(self._inner, MeasuredSystem)
        out[..., : self._n, :] = solve(rest, data) if measured else solve(rest)
        out[..., self._rows, :] = columnwise(
            partial(solve_triangular, self._r, check_finite=False), along
        )
        return out


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Solves a singular symmetric system of constant rank: least squares, least norm."""

    values: FloatArray
    vectors: FloatArray
    """`values`, `vectors` (k,), (q, k): eigenvalues that are not zero, and their eigenvectors."""
    rows: IntArray  # (q,): the rows that are in the system; the others of a solution are zero

    def __call__(self, right: FloatArray) -> FloatArray:
        """Return the solutions (..., n, m) for right-hand sides (..., n, m)."""
        return self._along(right, 1.0 / self.values)

    def solution(self, met: Callable[[FloatArray], Array], data: Array, found: FloatArray) -> Array:
        """Return a solution (n, m) on a tape.

        With P the pseudo-inverse of A, x = P b and r = b - A x,

            dx = -P (dA x - db) + P P dA r + (I - P A) dA P x

        (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973, for a symmetric A). ``met``: returns A v
        on the tape, for a constant v (n, m). ``data`` and ``found`` (n, m): b and x.
        """
        rest = value(data) - self._along(found, self.values)
        again = self(found)
        constant = partial(self._along, factor=np.ones(len(self.values)))

        def outside(t: FloatArray) -> FloatArray:
            inside = np.zeros_like(t)
            inside[..., self.rows, :] = t[..., self.rows, :]
            return inside - constant(t)

        def twice(t: FloatArray) -> FloatArray:
            return self(self(t))

        def minus(t: FloatArray) -> FloatArray:
            return -self(t)

        return recorded(
            found,
            (met(found) - data, minus, minus),
            (met(rest), twice, twice),
            (met(again), outside, outside),
        )

    def _along(self, right: FloatArray, factor: FloatArray) -> FloatArray:
        """Return ``right`` (..., n, m) with its parts along eigenvectors times ``factor`` (k,)."""
        out = np.zeros_like(right)
        inside = self.vectors.T @ right[..., self.rows, :]
        out[..., self.rows, :] = self.vectors @ (factor[:, None] * inside)
        return out


def solved(blocks: list[IntArray], factors: list[Factor], right: FloatArray) -> FloatArray:
    """Return the solutions (..., n, m) of a system in blocks (b,) of rows, each with its factor."""
    out = np.empty_like(right)
    for block, factor in zip(blocks, factors, strict=True):
        out[..., block, :] = columnwise(factor.solve, right[..., block, :])
    return out


def full_factor(system: FloatArray) -> Factor:
    """Return a factor of a system (n, n) without pivot guard; DeformError if it is singular."""
    try:
        lower = np.linalg.cholesky(system)
    except np.linalg.LinAlgError as problem:
        raise DeformError(
            f"the system of the {len(system)} control rows is singular at this design; {REMEDY}, "
            "or choose the rows at this design with `refresh(displacement)`"
        ) from problem
    every = np.arange(len(system))
    return Factor(np.asfortranarray(lower), every, every[:0])


def columnwise(solve: Callable[[FloatArray], FloatArray], right: FloatArray) -> FloatArray:
    """Return solutions for right-hand sides (..., n, m), by one call of ``solve`` for all."""
    n, m = right.shape[-2:]
    wide = np.moveaxis(right.reshape(-1, n, m), 0, 1).reshape(n, -1)
    with enough_threads(2.0 * n * wide.size):
        solved = solve(np.ascontiguousarray(wide)).reshape(n, -1, m)
    return np.ascontiguousarray(np.moveaxis(solved, 1, 0)).reshape(right.shape)
