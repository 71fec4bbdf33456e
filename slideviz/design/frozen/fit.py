"""The interpolation systems of one step with given control nodes, solved for any displacement."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from slideviz.design.frozen.solve import (
    LeastSquares,
    MeasuredSystem,
    WithPolynomial,
    columnwise,
    full_factor,
    solved,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf import tape
from slideviz.rbf.constraint_rows import ConstraintRows
from slideviz.rbf.double_double import supports
from slideviz.rbf.evaluate import matrix
from slideviz.rbf.exact import gathered, parts, row_keys, row_terms
from slideviz.rbf.operations import columns, radial_sum, terms
from slideviz.rbf.problem import Cycle, Interpolant, Levels, Problem
from slideviz.rbf.refine import System
from slideviz.rbf.solve import (
    NOTHING,
    Factor,
    enough_threads,
    extend,
    independent,
    is_singular,
    pseudo_inverse,
)
from slideviz.rbf.tape import Array, Variable, value

Keep = Callable[[str, Callable[[], Any]], Any]
"""Returns the object kept under a name; calls the function to make it if there is none yet."""


class FrozenFit:
    """The interpolant of one step, whose rows were chosen before (`slideviz.rbf.methods.Fit`)."""

    short = ""
    history: tuple[Cycle, ...] = ()
    refined = 0.0

    def __init__(
        self,
        problem: Problem,
        stages: Iterator[tuple[str, Levels]],
        dropped: IntArray,
        *,
        chosen: Keep,
        fixed: Keep,
        refined: bool = False,
        checked: bool = False,
    ) -> None:
        """Begin without rows.

        ``stages``: name and rows of each system that is to come in this step.
        ``dropped`` (m,): nodes that the pivot guard left out of the systems.
        ``chosen`` and ``fixed`` keep discrete choices, and what depends on positions only (in the
        first step, where positions are always the same).
        ``refined``: whether systems are solved with twice the digits.
        ``checked``: whether the error of solutions is estimated: for ``error_estimate``, which
        stays 0 with data reduction, as that of `GreedyFit`, and for warnings of derivatives.
        """
        basis = problem.basis
        self._problem = problem
        self._to_come = stages
        self.dropped = dropped
        self._basis = basis
        self._features = problem.features
        self._dim = problem.dim
        self._chosen = chosen
        self._fixed = fixed
        self._refined = refined and supports(basis)
        self._checked = checked and not basis.saddle
        self.error_estimate: Any = np.zeros(())
        self.stages: tuple[Levels, ...] = ()
        self._rows: ConstraintRows | None = None
        self._factors: dict[int, tuple[IntArray, Factor]] = {}
        self.interpolant = Interpolant(np.empty(0, np.int64), np.empty((0, self._dim)))

    def condition(self) -> float:
        """Return NaN: the condition number is that of the reference."""
        return float("nan")

    def add(self, rows: ConstraintRows) -> None:
        """Add rows, solve with those chosen of all rows added so far, and set ``interpolant``."""
        stage, levels = next(self._to_come)
        if self._rows is not None:
            rows = self._rows.followed_by(rows)
        self._rows = rows
        keys = row_keys(rows)
        self.interpolant = Interpolant(np.empty(0, np.int64), np.empty((0, self._dim)))
        for level, wanted in enumerate(levels):
            index = self._chosen(f"{stage} rows {level}", partial(_at, keys, wanted))
            part = rows.only(index)
            if level:
                before = self.interpolant.at(self._problem, part.nodes)
                met = before if part.normals is None else tape.dot(before, part.normals)
                part = replace(part, right=part.right - met)
            solved = self._solved(part, index, level, stage)
            self.interpolant = self.interpolant.plus(solved) if level else solved

    def _solved(self, rows: ConstraintRows, index: IntArray, level: int, stage: str) -> Interpolant:
        """Return the interpolant of ``rows``, those with the numbers ``index`` among all rows."""
        count = len(rows.nodes)
        m = value(rows.right).shape[-1]
        solve, extra = self._solver(rows, index, level, stage)
        right = np.zeros((*value(rows.right).shape[:-2], count + extra, m))
        right[..., :count, :] = value(rows.right)
        weights: Array = solve(right)
        forward = solve
        back = None
        if isinstance(solve, MeasuredSystem | WithPolynomial):
            forward = solve.tangent
            back = solve.adjoint
        if isinstance(solve, MeasuredSystem | WithPolynomial) and self._problem.reduction is None:
            self.error_estimate = np.maximum(self.error_estimate, solve.error_estimate)
        if any(isinstance(x, Variable) for x in (rows.right, rows.normals, self._features)):
            data = tape.join(rows.right, np.zeros((extra, m))) if extra else rows.right
            met = partial(self._system_times, rows, extra=extra)
            if isinstance(solve, LeastSquares):
                weights = solve.solution(met, data, value(weights))
            else:
                weights = tape.solution(met(value(weights)) - data, value(weights), forward, back)
        tail = None
        if extra:
            tail = tape.take(weights, count + np.arange(extra))
            tail = tape.reshape(tail, extra * m // self._dim, self._dim)
        return gathered(rows, tape.take(weights, np.arange(count)), tail)

    def _system_times(self, rows: ConstraintRows, found: FloatArray, *, extra: int) -> Array:
        """Return the system times ``found`` (n, m), a constant, for the derivative of the system.

        Zeros where the system is constant. ``extra`` of the n unknowns are the polynomial's.
        """
        count = len(rows.nodes)
        m = found.shape[-1]
        if not (isinstance(self._features, Variable) or isinstance(rows.normals, Variable)):
            return np.zeros_like(found)
        weights: Array = found[:count]
        if rows.normals is not None:
            weights = tape.multiply(rows.normals, weights)
        place = columns(self._features, rows.nodes)
        s = radial_sum(self._basis, place, place, weights)
        below: list[Array] = []
        if extra:
            t = terms(self._basis, place)
            tail = found[count:].reshape(-1, self._dim)
            s = s + tape.product(t, tail)
            free = tape.product(tape.transpose(t), weights)
            below = [tape.reshape(free, extra, m)]
        if rows.normals is not None:
            s = tape.dot(s, rows.normals)
        return tape.join(s, *below)

    def _solver(
        self, rows: ConstraintRows, index: IntArray, level: int, stage: str
    ) -> tuple[Callable[[FloatArray], FloatArray], int]:
        """Return the solver of the system of ``rows``, and how many unknowns a polynomial adds."""
        if self._basis.saddle:
            return self._saddle(rows, f"{stage} factor {level}")
        solve = self._definite(rows, index, level, stage)
        if not self._basis.polynomial:
            return solve, 0
        along = row_terms(self._problem, rows)
        name = f"{stage} terms {level}"
        use = self._chosen(name, lambda: independent(along))
        made = self._fixed(f"{name} solver", lambda: WithPolynomial(solve, along, use))
        return made, along.shape[1]

    def _definite(
        self, rows: ConstraintRows, index: IntArray, level: int, stage: str
    ) -> Callable[..., FloatArray]:
        """Return the solver of the positive definite system of ``rows``, without a polynomial."""
        place = self._problem.place(rows.nodes)
        normals = rows.directions
        if normals is None:
            factor = self._fixed(
                f"{stage} factor {level}", lambda: self._extended(place, index, level)
            )
            self._factors[level] = index, factor
            every = np.arange(len(index))
            return self._measured([every], [factor], (place, None), f"{stage} system {level}")
        blocks = self._fixed(
            f"{stage} blocks {level}",
            lambda: parts(ConstraintRows(rows.nodes, normals, np.empty((0, 1)))),
        )
        factors = self._fixed(
            f"{stage} factor {level}",
            lambda: [self._factor(place[:, b], normals[b]) for b in blocks],
        )
        return self._measured(blocks, factors, (place, normals), f"{stage} system {level}")

    def _measured(
        self,
        blocks: list[IntArray],
        factors: list[Factor],
        place: tuple[FloatArray, FloatArray | None],
        name: str,
    ) -> Callable[[FloatArray], FloatArray]:
        """Return the solver of a system in blocks; a `MeasuredSystem` if refined or checked."""
        if not (self._refined or self._checked):
            return partial(solved, blocks, factors)
        features, normals = place

        def make() -> list[System]:
            places = [(features[:, b], None if normals is None else normals[b]) for b in blocks]
            return [System(self._basis, *both) for both in zip(places, factors, strict=True)]

        return MeasuredSystem(blocks, self._fixed(name, make), refined=self._refined)

    def _factor(self, place: FloatArray, normals: FloatArray) -> Factor:
        """Return the factor of rows with features (k, r) and directions (r, d).

        Of all rows, unless refinement meets the rows that the pivot guard leaves out. Raises
        DeformError where the system is singular (`full_factor`).
        """
        system = matrix(self._basis, (place, normals))
        with enough_threads(len(system) ** 3 / 3):
            factor = extend(NOTHING, system)
            return factor if self._refined or not len(factor.dropped) else full_factor(system)

    def _extended(self, place: FloatArray, index: IntArray, level: int) -> Factor:
        """Extend the factor of the previous stage by the new rows, which have no directions."""
        before, factor = self._factors.get(level, (index[:0], NOTHING))
        if not np.array_equal(index[: len(before)], before):
            before = index[:0]
            factor = NOTHING
        new = place[:, len(before) :]
        if not new.shape[1]:
            return factor
        system = matrix(self._basis, (new, None), (place, None))
        with enough_threads(len(system) * len(index) ** 2 / 3):
            grown = extend(factor, system)
            if self._refined or not len(grown.dropped):
                return grown
            return full_factor(matrix(self._basis, (place, None)))

    def _saddle(
        self, rows: ConstraintRows, name: str
    ) -> tuple[Callable[[FloatArray], FloatArray], int]:
        """Return the solver of a system with polynomial, and how many unknowns it adds."""
        count = len(rows.nodes)
        place = (self._problem.place(rows.nodes), rows.directions)
        along = row_terms(self._problem, rows)
        total = along.shape[1]

        def make() -> tuple[Any, IntArray]:
            use = self._chosen(f"{name} terms", lambda: independent(along))
            system = np.zeros((count + len(use),) * 2)
            system[:count, :count] = matrix(self._basis, place)
            system[:count, count:] = along[:, use]
            system[count:, :count] = along[:, use].T
            used = np.concatenate([np.arange(count), count + use])
            if self._chosen(f"{name} singular", lambda: is_singular(system)):
                rank = self._chosen(f"{name} rank", lambda: len(pseudo_inverse(system)[0]))
                return LeastSquares(*pseudo_inverse(system, rank), used), used
            return lu_factor(system), used

        factor, used = self._fixed(name, make)
        if isinstance(factor, LeastSquares):
            return factor, total

        def solve(right: FloatArray) -> FloatArray:
            out = np.zeros_like(right)
            out[..., used, :] = columnwise(lambda b: lu_solve(factor, b), right[..., used, :])
            return out

        return solve, total


def _at(names: IntArray, wanted: IntArray) -> IntArray:
    """Return the places in ``names`` (r, 2) of the rows ``wanted`` (k, 2), (k,)."""
    place = {tuple(name): k for k, name in enumerate(names.tolist())}
    return np.array([place[tuple(name)] for name in wanted.tolist()], np.int64)
