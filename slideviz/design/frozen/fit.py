"""The interpolation systems of one step with given control nodes, solved for any displacement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from slideviz.design.frozen.operations import columns, radial_sum, terms
from slideviz.design.frozen.solve import (
    LeastSquares,
    MeasuredSystem,
    columnwise,
    full_factor,
    solved,
)
from slideviz.design.frozen.tape import (
    Array,
    Variable,
    dot,
    gather,
    join,
    multiply,
    product,
    reshape,
    solution,
    take,
    transpose,
    value,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.constraint_rows import ConstraintRows
from slideviz.rbf.double_double import supports
from slideviz.rbf.evaluate import Basis, matrix
from slideviz.rbf.exact import parts, row_keys
from slideviz.rbf.field import linear_terms
from slideviz.rbf.kernels import KERNELS
from slideviz.rbf.problem import Levels
from slideviz.rbf.refine import System
from slideviz.rbf.solve import (
    NOTHING,
    Factor,
    enough_threads,
    extend,
    is_singular,
    pseudo_inverse,
    saddle_system,
)

Keep = Callable[[str, Callable[[], Any]], Any]
"""Returns the object kept under a name; calls the function to make it if there is none yet."""


@dataclass(frozen=True, eq=False)
class Sum:
    """A sum of radial functions, as `slideviz.rbf.problem.Interpolant`, on a tape."""

    nodes: IntArray
    """(c,): the control nodes."""
    weights: Array
    """(..., c, d)."""
    tail: Array | None = None
    """(..., q, d) or None: coefficients of the polynomial's terms."""


@dataclass(eq=False)
class TapedRows:
    """Constraint rows whose data are on a tape: as ``ConstraintRows``, ``right`` (..., r, m)."""

    nodes: IntArray
    normals: Array | None
    right: Array


class FrozenFit:
    """The interpolant of one step, whose rows were chosen before."""

    def __init__(
        self,
        basis: Basis,
        features: Array,
        dim: int,
        *,
        chosen: Keep,
        fixed: Keep,
        refined: bool = False,
        checked: bool = False,
    ) -> None:
        """Begin without rows.

        Parameters
        ----------
        features : (k, n)
            Of all nodes, at their current positions.
        chosen, fixed
            Keep discrete choices, and what depends on positions only (in the first step, where
            positions are always the same).
        refined
            Whether systems are solved with twice the digits.
        checked
            Whether the error of solutions is estimated (``error_estimate``).
        """
        self._basis, self._features, self._dim = basis, features, dim
        self._chosen, self._fixed = chosen, fixed
        tailed = KERNELS[basis.kernel].polynomial
        self._refined, self._checked = refined and supports(basis), checked and not tailed
        self.error_estimate: FloatArray = np.zeros(())
        """(...,): as of a ``Solution``."""
        self._rows: TapedRows | None = None
        self._factors: dict[int, tuple[IntArray, Factor]] = {}
        self.found: Sum | None = None
        """Of all rows added so far; None before any."""

    def add(self, rows: TapedRows, levels: Levels, stage: str) -> None:
        """Add rows, solve with those in ``levels`` of all rows added so far, and set ``found``.

        ``stage`` begins the names of what is kept.
        """
        if self._rows is not None:
            nodes = np.concatenate([self._rows.nodes, rows.nodes])
            rows = TapedRows(nodes, None, join(self._rows.right, rows.right))
        self._rows = rows
        names = row_keys(ConstraintRows(rows.nodes, None, np.empty((0, 0))))
        sums: list[Sum] = []
        for level, wanted in enumerate(levels):
            index = self._chosen(f"{stage} rows {level}", partial(_at, names, wanted))
            normals = None if rows.normals is None else take(rows.normals, index)
            right = take(rows.right, index)
            if sums:
                settled = self.at(rows.nodes[index], self._plus(sums))
                right = right - (settled if normals is None else dot(settled, normals))
            part = TapedRows(rows.nodes[index], normals, right)
            sums.append(self._solved(part, index, level, stage))
        self.found = self._plus(sums) if sums else None

    def at(
        self,
        nodes: IntArray | slice,
        found: Sum | None = None,
        *,
        out: FloatArray | None = None,
    ) -> Array:
        """Return the displacements (..., m, d) of nodes in the frame.

        Of ``found``, or of the fit's. ``out`` (..., m, d) is where they may be written.
        """
        found = found or self.found
        x = self._features
        here = x if isinstance(nodes, slice) else columns(x, nodes)
        if found is None:
            return np.zeros((value(here).shape[1], self._dim))
        s = radial_sum(self._basis, here, columns(x, found.nodes), found.weights, out)
        if found.tail is not None:
            s = s + product(terms(self._basis, here), found.tail)
        return s

    def _plus(self, sums: list[Sum]) -> Sum:
        """Return the sum of all levels, each node once, in the order of first occurrence."""
        if len(sums) == 1:
            return sums[0]
        nodes, place = _firsts(np.concatenate([each.nodes for each in sums]))
        weights = gather(join(*(each.weights for each in sums)), place, len(nodes))
        tails = [each.tail for each in sums if each.tail is not None]
        tail = None
        for each in tails:
            tail = each if tail is None else tail + each
        return Sum(nodes, weights, tail)

    def _solved(self, rows: TapedRows, index: IntArray, level: int, stage: str) -> Sum:
        """Return the interpolant of ``rows``, those with the numbers ``index`` among all rows."""
        count, m = len(rows.nodes), value(rows.right).shape[-1]
        solve, extra = self._solver(rows, index, level, stage)
        right = np.zeros((*value(rows.right).shape[:-2], count + extra, m))
        right[..., :count, :] = value(rows.right)
        found: Array = solve(right)
        if isinstance(solve, MeasuredSystem):
            self.error_estimate = np.maximum(self.error_estimate, solve.error_estimate)
        if any(isinstance(x, Variable) for x in (rows.right, rows.normals, self._features)):
            data = join(rows.right, np.zeros((extra, m))) if extra else rows.right
            met = partial(self._system_times, rows, extra=extra)
            if isinstance(solve, LeastSquares):
                found = solve.solution(met, data, value(found))
            else:
                forward, back = solve, None
                if isinstance(solve, MeasuredSystem):
                    forward, back = solve.tangent, solve.adjoint
                found = solution(met(value(found)) - data, value(found), forward, back)
        weights = take(found, np.arange(count))
        tail = None
        if extra:
            tail = take(found, count + np.arange(extra))
            tail = reshape(tail, extra * m // self._dim, self._dim)
        if rows.normals is None:
            return Sum(rows.nodes, weights, tail)
        nodes, place = _firsts(rows.nodes)
        return Sum(nodes, gather(multiply(rows.normals, weights), place, len(nodes)), tail)

    def _system_times(self, rows: TapedRows, found: FloatArray, *, extra: int) -> Array:
        """Return the system times ``found`` (n, m), a constant, for the derivative of the system.

        Zeros where the system is constant. ``extra`` of the n unknowns are the polynomial's.
        """
        count, m = len(rows.nodes), found.shape[-1]
        if not (isinstance(self._features, Variable) or isinstance(rows.normals, Variable)):
            return np.zeros_like(found)
        weights: Array = found[:count]
        if rows.normals is not None:
            weights = multiply(rows.normals, weights)
        place = columns(self._features, rows.nodes)
        s = radial_sum(self._basis, place, place, weights)
        below: list[Array] = []
        if extra:
            t = terms(self._basis, place)
            tail = found[count:].reshape(-1, self._dim)
            s = s + product(t, tail)
            free = product(transpose(t), weights)
            below = [reshape(free, extra, m)]
        if rows.normals is not None:
            s = dot(s, rows.normals)
        return join(s, *below)

    def _solver(
        self, rows: TapedRows, index: IntArray, level: int, stage: str
    ) -> tuple[Callable[[FloatArray], FloatArray], int]:
        """Return the solver of the system of ``rows``, and how many unknowns a polynomial adds."""
        place = value(self._features)[:, rows.nodes]
        normals = None if rows.normals is None else value(rows.normals)
        if KERNELS[self._basis.kernel].polynomial:
            return self._saddle(place, normals, f"{stage} factor {level}")
        if normals is None:
            factor = self._fixed(
                f"{stage} factor {level}", lambda: self._extended(place, index, level)
            )
            self._factors[level] = index, factor
            every = np.arange(len(index))
            return self._measured([every], [factor], (place, None), f"{stage} system {level}"), 0
        blocks = self._fixed(
            f"{stage} blocks {level}",
            lambda: parts(ConstraintRows(rows.nodes, normals, np.empty((0, 1)))),
        )
        factors = self._fixed(
            f"{stage} factor {level}",
            lambda: [self._factor(place[:, b], normals[b]) for b in blocks],
        )
        return self._measured(blocks, factors, (place, normals), f"{stage} system {level}"), 0

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
        """Return the factor of rows without directions, extended from that of the stage before."""
        before, factor = self._factors.get(level, (index[:0], NOTHING))
        if not np.array_equal(index[: len(before)], before):
            before, factor = index[:0], NOTHING
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
        self, place: FloatArray, normals: FloatArray | None, name: str
    ) -> tuple[Callable[[FloatArray], FloatArray], int]:
        """Return the solver of a system with polynomial, and how many unknowns it adds."""
        count = place.shape[1]
        along = linear_terms(self._basis, place)
        if normals is not None:
            along = np.einsum("rq,rd->rqd", along, normals).reshape(count, -1)
        total = along.shape[1]

        def make() -> tuple[Any, IntArray]:
            use = self._chosen(
                f"{name} terms",
                lambda: saddle_system(matrix(self._basis, (place, normals)), along)[1],
            )
            system = np.zeros((count + len(use),) * 2)
            system[:count, :count] = matrix(self._basis, (place, normals))
            system[:count, count:] = along[:, use]
            system[count:, :count] = along[:, use].T
            rows = np.concatenate([np.arange(count), count + use])
            if self._chosen(f"{name} singular", lambda: is_singular(system)):
                rank = self._chosen(f"{name} rank", lambda: len(pseudo_inverse(system)[0]))
                return LeastSquares(*pseudo_inverse(system, rank), rows), rows
            return lu_factor(system), rows

        factor, rows = self._fixed(name, make)
        if isinstance(factor, LeastSquares):
            return factor, total

        def solve(right: FloatArray) -> FloatArray:
            out = np.zeros_like(right)
            out[..., rows, :] = columnwise(lambda b: lu_solve(factor, b), right[..., rows, :])
            return out

        return solve, total


def _firsts(nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Return each of nodes (r,) once, in the order of first occurrence, and its place, (r,)."""
    unique, first, group = np.unique(nodes, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return unique[order], rank[group]


def _at(names: IntArray, wanted: IntArray) -> IntArray:
    """Return the places in ``names`` (r, 2) of the rows ``wanted`` (k, 2), (k,)."""
    place = {tuple(name): k for k, name in enumerate(names.tolist())}
    return np.array([place[tuple(name)] for name in wanted.tolist()], np.int64)
