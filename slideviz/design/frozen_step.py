"""One step of a deformation with everything discrete kept, for any displacement.

`slideviz.solver.stepping.one_step` with variables of a tape; without a variable it computes values
only. Discrete choices are made when the step runs first, at the reference design, and kept: rows
of the systems, primitives that nodes are projected on, nearest boundary nodes and radius of the
correction.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field as made_by
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from scipy.linalg import lu_factor, lu_solve, solve_triangular
from scipy.sparse import csr_array

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.words import wrong_by
from slideviz.errors import ConditionWarning, DeformError
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.rbf import tape
from slideviz.rbf.constraint_rows import ConstraintRows
from slideviz.rbf.double_double import supports
from slideviz.rbf.evaluate import Rows, matrix
from slideviz.rbf.exact import Fit, gathered, parts, row_keys, row_terms
from slideviz.rbf.field import share
from slideviz.rbf.frames import Frame
from slideviz.rbf.loops import add_correction, keep_undeformed
from slideviz.rbf.methods import IMAGES, ROUNDING, correction_of
from slideviz.rbf.operations import add_displacement, columns, points, radial_sum, terms
from slideviz.rbf.operations import coords as coords_of
from slideviz.rbf.problem import (
    CarriedError,
    Interpolant,
    Levels,
    PhaseTimer,
    Problem,
    StepSolution,
)
from slideviz.rbf.projection import projection_matrices
from slideviz.rbf.refine import TRUSTED, System
from slideviz.rbf.solve import (
    NOTHING,
    Factor,
    enough_threads,
    extend,
    independent,
    is_singular,
    pseudo_inverse,
)
from slideviz.rbf.tape import Array, Variable, recorded, value
from slideviz.solver.deform import all_steps, require_memory
from slideviz.solver.setup import Setup
from slideviz.solver.stepping import (
    Stepping,
    cartesian,
    displaced_coords,
    one_step,
    with_halo_copies,
)
from slideviz.solver.steps import Report, step_timer
from slideviz.system.platform import free_memory

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
        m = right.shape[-1]
        largest = np.abs(right if data is None else data).max(axis=(-1, -2), initial=0.0)
        largest = np.repeat(largest.ravel(), m)
        error_estimate = np.zeros(len(largest))

        def solve(wide: FloatArray) -> FloatArray:
            out = np.empty_like(wide)
            for block, system in zip(self._blocks, self._systems, strict=True):
                data = wide[block]
                with enough_threads(2.0 * len(block) * data.size):
                    solved = system.factor.solve(data)
                    if self._refined:
                        refined = system.refined(data, largest, solved, of_weights=of_weights)
                        solved = refined.weights
                        field_error = refined.error_estimate
                    else:
                        parts = [slice(first, first + m) for first in range(0, len(largest), m)]
                        off = [system.field_error(data[:, at], solved[:, at]) for at in parts]
                        field_error = np.concatenate(off) / np.where(largest > 0.0, largest, 1.0)
                out[block] = solved
                np.maximum(error_estimate, field_error, out=error_estimate)
            return out

        solutions = tape.over_columns(solve, right)
        self.error_estimate = error_estimate.reshape(*right.shape[:-2], m).max(axis=-1)
        return solutions

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


@record
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
            return tape.placed(t[..., self.rows, :], self.rows, t.shape[-2]) - constant(t)

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
        inside = self.vectors.T @ right[..., self.rows, :]
        inside = self.vectors @ (factor[:, None] * inside)
        return tape.placed(inside, self.rows, right.shape[-2])


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
    with enough_threads(2.0 * right.shape[-2] * right.size):
        return tape.over_columns(solve, right)


Keep = Callable[[str, Callable[[], Any]], Any]
"""Returns the object kept under a name; calls the function to make it if there is none yet."""


class FrozenFit(Fit):
    """The interpolant of one step, whose rows were chosen before."""

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
        super().__init__(problem)
        self._to_come = stages
        self.dropped = dropped
        self._basis = basis
        self._features = problem.features
        self._dim = problem.dim
        self._chosen = chosen
        self._fixed = fixed
        self._refined = refined and supports(basis)
        self._checked = checked and not basis.saddle
        self.error_estimate = np.zeros(())
        self._rows: ConstraintRows | None = None
        self._factors: dict[int, tuple[IntArray, Factor]] = {}

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
        weights: Array = solve(tape.placed(value(rows.right), slice(count), count + extra))
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
        place: Rows,
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
            inside = columnwise(lambda b: lu_solve(factor, b), right[..., used, :])
            return tape.placed(inside, used, right.shape[-2])

        return solve, total


def _at(names: IntArray, wanted: IntArray) -> IntArray:
    """Return the places in ``names`` (r, 2) of the rows ``wanted`` (k, 2), (k,)."""
    place = {tuple(name): k for k, name in enumerate(names.tolist())}
    return np.array([place[tuple(name)] for name in wanted.tolist()], np.int64)


@record
class FrozenCorrection:
    """Which nodes take over the errors of which boundary nodes."""

    targets: IntArray  # (h,): the nodes that take over an error
    row: IntArray
    source: IntArray
    weight: FloatArray
    """`row`, `source`, `weight` (k,): one entry for each pair of a target, by its place in
    ``targets``, and a boundary node, by its place in ``nodes`` (b,), with its weight
    in the mean of their errors."""
    radius: float  # distance at which the correction ends, in the mesh's length unit
    nearest: IntArray
    turn: IntArray
    """`nearest`, `turn` (h,): the boundary node nearest to each target, and the number of periods,
    -1, 0 or 1, by which it is shifted."""

    def mixing(self, count: int) -> csr_array:
        """Return the matrix (h, count) from values at boundary nodes to their means at targets."""
        shape = len(self.targets), count
        return csr_array((self.weight, (self.row, self.source)), shape=shape)


def frozen_correction(
    problem: Problem, nodes: IntArray, errors: FloatArray
) -> FrozenCorrection | None:
    """Return the correction of errors (b, d) at boundary nodes (b,); None where they are rounding.

    The radius and the sources are those of `slideviz.rbf.methods.correction_of`.
    """
    correction = correction_of(problem, nodes, errors)
    if correction is None:
        return None
    once = np.unique(problem.same_as[nodes], return_index=True)[1]
    coords = value(problem.coords)
    free = np.ones(len(coords), bool)
    free[nodes] = False
    targets = np.flatnonzero(free)
    hit, nearest, row, source, weight = correction.sources(problem.cartesian(coords[targets]))
    return FrozenCorrection(
        targets=targets[hit],
        row=row,
        source=once[source % len(once)],
        weight=weight,
        radius=correction.radius,
        nearest=nodes[once[nearest % len(once)]],
        turn=np.array(IMAGES)[nearest // len(once)],
    )


def shares(frame: Frame, coords: Array, correction: FrozenCorrection) -> Array:
    """Return the share (h,) of the error that each target takes over, by its distance."""
    here = points(frame, tape.take(coords, correction.targets))
    other = tape.take(coords, correction.nearest) + correction.turn[:, None] * frame.shift()
    gap = tape.length(here - points(frame, other))
    q = np.minimum(value(gap) / correction.radius, 1.0)
    return tape.function(gap, share(q), -20.0 * q * (1.0 - q) ** 3 / correction.radius)


CHECKED = 1e11
"""Above this condition number, the errors of solutions are estimated for each design; with data
reduction only those of derivatives, for points have a tolerance that is larger than rounding."""

_SILENT = PhaseTimer(lambda _phase, _fraction: None)


@record
class StepState:
    """The state of a deformation after some steps."""

    coords: Array  # (..., n, d): positions in the frame
    solution: StepSolution | None = None
    """Of the step; its errors are arrays (...,). None before the first step."""
    points: Array = made_by(default_factory=lambda: np.empty((0, 0)))
    """(..., n, d): Cartesian positions; empty before the first step."""

    def number(self, name: str) -> FloatArray:
        """Return a number of the solution by its name, (...,); 0 before the first step."""
        return np.asarray(getattr(self.solution, name) if self.solution else 0.0)


@record
class ChoiceCache:
    """A store of objects that are made once, by name."""

    items: dict[str, Any] = made_by(default_factory=dict)

    def __call__(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the object of this name; ``make`` makes it the first time."""
        if name not in self.items:
            self.items[name] = make()
        return self.items[name]


@record
class FrozenStep:
    """One step with its choices."""

    setup: Setup
    mesh: Mesh  # undeformed
    part: float  # part of the whole displacement that is made after this step, up to 1
    first: bool  # whether positions are those of the undeformed mesh, the same for all designs
    stages: tuple[Levels, ...]  # rows of the systems
    dropped: IntArray  # (m,): nodes that the pivot guard left out of the systems
    condition: float  # estimated condition number of the last system, at the reference
    refined: float = 0.0
    """Where systems are solved with twice the digits, as at the reference: the estimated error of
    ordinary solutions, as of a ``StepSolution``; else 0."""
    error_estimate: float = 0.0  # as of a ``StepSolution``, at the reference
    reuse: bool = False
    """Whether a later step keeps the factors of the last positions that it began at."""
    choices: ChoiceCache = made_by(default_factory=ChoiceCache)
    constants: ChoiceCache = made_by(default_factory=ChoiceCache)
    """`choices`, `constants`: discrete choices; and, used in the first step only, what depends on
    positions only."""
    last: ChoiceCache = made_by(default_factory=ChoiceCache)
    """The last positions that a later step began at, and its factors there."""

    def factors(self, coords: FloatArray) -> ChoiceCache:
        """Return the store of the factors of systems at positions ``coords`` (n, d).

        An optimiser asks for points, ``jvp`` and ``vjp`` of one design: factors are most of the
        work of each.
        """
        if self.first:
            return self.constants
        at, kept = self.last.items.get("at", (None, ChoiceCache()))
        if at is None or not np.array_equal(at, coords):
            kept = ChoiceCache()
        if self.reuse:
            self.last.items["at"] = coords.copy(), kept
        return kept

    def run(self, before: StepState, target: Array) -> StepState:
        """Return the state after this step.

        ``target`` (..., a, d): the whole displacement of the known nodes, after the last step, in
        the frame.
        """
        state = self.moved(before, target)
        coords, at = self._with_points(state.coords)
        return replace(state, coords=coords, points=at)

    def moved(self, before: StepState, target: Array, out: FloatArray | None = None) -> StepState:
        """Return the state after this step, without points, and with copies in a halo not moved.

        ``out`` (..., n, d): where the coordinates are written, if nothing is a variable.
        """
        setup = self.setup
        goal = setup.goal(target, self.part, partial(self.choices, "rims"))
        run = _Run(self, before.coords, out)
        solution = one_step(setup, before.coords, goal, _SILENT, before.solution, run)
        displacement = solution.displacement
        if out is not None and displacement is not out:
            out[:] = value(displacement)
            displacement = out
        on = np.flatnonzero(setup.axis)
        if len(on):
            held = np.ones(setup.coords.shape[1])
            held[:2] = 0.0
            still = tape.multiply(tape.take(displacement, on), held[None])
            displacement = tape.put(displacement, on, still, overwrite=True)
        moved = add_displacement(before.coords, displacement, overwrite=True)
        moved = tape.put(moved, setup.known, goal, overwrite=True)
        return StepState(moved, replace(solution, displacement=np.empty((0, 0))))

    def _with_points(self, moved: Array) -> tuple[Array, Array]:
        """Return coordinates and Cartesian points, with copies in a halo moved, too."""
        setup = self.setup
        frame = self.setup.frame
        at = _at_rest(points(frame, moved), moved, setup.coords, self.mesh.points)
        halo = self.mesh.halo
        if halo is None:
            return moved, at
        rows = setup.copies
        donors = halo.donors[rows]
        copies = halo.receivers[rows]
        donor = self.mesh.points[donors]
        start = self.mesh.points[copies]
        follow = tape.transform(halo.rotations[rows], tape.take(at, donors) - donor)
        overwrite = at is not moved
        at = tape.put(at, copies, add_displacement(start, follow), overwrite=overwrite)
        return tape.put(
            moved, copies, coords_of(frame, tape.take(at, copies)), overwrite=overwrite
        ), at


class _Run:
    """One run of a step: `slideviz.rbf.problem.FrozenChoices` at some positions."""

    def __init__(self, step: FrozenStep, coords: Array, out: FloatArray | None) -> None:
        self._step = step
        self._setup = step.setup
        self._coords = coords
        self.out = out
        self._kept = step.choices
        self._projections = count()
        self._stages = ((f"stage {k}", levels) for k, levels in enumerate(step.stages))

    def choose(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the choice of this name, made the first time."""
        return self._step.choices(name, partial(self._tried, make))

    def _tried(self, make: Callable[[], Any]) -> Any:
        """Return what ``make`` returns; projections that it tries are not kept."""
        before = self._kept, self._projections
        self._kept = ChoiceCache()
        self._projections = count()
        try:
            return make()
        finally:
            self._kept, self._projections = before

    def fixed(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what depends on positions only: kept in the first step."""
        return self._step.constants(name, make) if self._step.first else make()

    def fit(self, problem: Problem) -> FrozenFit:
        """Return a fit of this step without rows."""
        step = self._step
        return FrozenFit(
            problem,
            self._stages,
            step.dropped,
            chosen=step.choices,
            fixed=step.factors(value(self._coords)),
            refined=step.refined > 0.0,
            checked=step.condition > CHECKED,
        )

    def correct(
        self, problem: Problem, displacement: Array, nodes: IntArray, errors: Array, *, needed: bool
    ) -> Array:
        """Return the displacement with the boundary correction of errors added."""
        correction: FrozenCorrection | None = self.choose(
            "correction",
            lambda: frozen_correction(problem, nodes, value(errors)) if needed else None,
        )
        if correction is None:
            return displacement
        frame = self._setup.frame
        means = correction.mixing(value(errors).shape[-2])
        part = self.fixed("shares", lambda: shares(frame, self._coords, correction))
        if displacement is self.out and not isinstance(part, Variable):
            add_correction(self.out, correction.targets, means, part[:, 0], value(errors))
            return displacement
        more = tape.multiply(tape.mixed(means, errors), part)
        more = tape.take(displacement, correction.targets) + more
        return tape.put(displacement, correction.targets, more, overwrite=True)

    def project(self, nodes: IntArray, free: Array) -> Array:
        """Return the displacements (..., m, d) of sliding nodes projected on their boundary.

        On the plane of the facet, the line of the edge or the vertex that is closest at the
        reference.
        """
        setup = self._setup
        base = tape.take(self._coords, nodes)
        name = f"project {next(self._projections)}"
        anchor, matrix = self._kept(name, partial(self._tracked, nodes, value(base), value(free)))
        away = tape.transform(matrix - np.eye(matrix.shape[-1]), base - anchor)
        slid = _plus_unless_rounding(
            tape.transform(matrix, free), away, ROUNDING * largest_coordinate(setup.coords)
        )
        copy, origin, turn = self._kept(f"ties of {name}", lambda: setup.ties(nodes))
        if len(copy):
            slid = tape.put(slid, copy, tape.transform(turn, tape.take(slid, origin)))
        held = np.ones((len(nodes), matrix.shape[-1]))
        held[setup.axis[nodes], :2] = 0.0
        held[np.isin(nodes, setup.held)] = 0.0
        return slid if held.all() else tape.multiply(slid, held)

    def _tracked(
        self, nodes: IntArray, base: FloatArray, free: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the closest point of each displaced node (m, d), and the projection (m, d, d).

        See `slideviz.rbf.projection.projection_matrices`.
        """
        tracks = self._setup.tracks
        label = tracks.of_node[nodes]
        at = base + free
        anchor = base.copy()
        matrix = np.zeros((*base.shape, base.shape[1]))
        for index in np.unique(label[label >= 0]).tolist():
            rows = np.flatnonzero(label == index)
            found, which = tracks.tracks[index].nearest(at[rows])
            anchor[rows] = found
            matrix[rows] = projection_matrices(
                tracks.tracks[index].simplices(which), at[rows], found
            )
        return anchor, matrix


def _plus_unless_rounding(slid: Array, away: Array, least: float) -> Array:
    """Return ``slid + away``, without rows of ``away`` up to ``least``: rest keeps every bit."""
    off = value(away)
    off = np.where(np.abs(off).max(axis=-1, keepdims=True) <= least, 0.0, off)
    return slid + (replace(away, value=off) if isinstance(away, Variable) else off)


def _at_rest(at: Array, moved: Array, start: FloatArray, before: FloatArray) -> Array:
    """Return points ``at``; those with coordinates ``moved`` as at the start become ``before``."""
    if at is moved:
        return at
    keep_undeformed(value(at), value(moved), start, before)
    return at


BYTES = 64  # free memory for each entry of a factor, above which factors are kept for further calls


def choose_steps(
    case: Case, mesh: Mesh, setup: Setup, targets: Sequence[FloatArray], report: Report
) -> tuple[tuple[FrozenStep, ...], FloatArray]:
    """Return steps with control nodes that suffice for all ``targets``, and the first run's points.

    The points are (n, d), deformed by the first displacement, which also chooses the number of
    steps. The selection for each further displacement begins with the control nodes of all before.
    Raises DeformError if a step cannot be solved, or its result cannot be right. ``targets``:
    displacements of the known nodes, in the frame.
    """
    require_memory(setup, case, lasting=True)
    kept = setup
    # The conditioning is also checked for data other than the reference.
    setup = replace(
        setup, solve=lambda problem, timer: kept.solve(replace(problem, lasting=True), timer)
    )
    parts, solutions, points = _reference(case, mesh, replace(setup, target=targets[0]), report)
    # The other methods choose nothing but the number of steps.
    others = list(targets[1:]) if case.method == "rbf" else []
    if others and setup.reduction is not None and setup.reduction.multilevel:
        others += targets[:-1]  # a further level can raise errors of those before
    for target in others:
        further = _further(mesh, replace(setup, target=target), parts, solutions, report)
        # A system that was solved with more rows and digits for one is so for all.
        solutions = [
            replace(
                new if new.refined >= old.refined else old,
                error_estimate=max(old.error_estimate, new.error_estimate),
            )
            for old, new in zip(solutions, further, strict=True)
        ]
    rows = [len(level) for found in solutions for levels in found.stages for level in levels]
    reuse = BYTES * sum(n**2 for n in rows) < free_memory()
    steps = tuple(
        FrozenStep(
            setup=kept.at_step(k == len(parts) - 1),
            mesh=mesh,
            part=part,
            first=k == 0,
            stages=solution.stages,
            dropped=solution.dropped,
            condition=solution.condition,
            refined=solution.refined,
            error_estimate=solution.error_estimate,
            reuse=reuse,
            choices=ChoiceCache({"flat": len(solution.stages) < 2}),
        )
        for k, (part, solution) in enumerate(zip(parts, solutions, strict=True))
    )
    return steps, points


def _continued(
    setup: Setup, stages: tuple[Levels, ...], problem: Problem, timer: PhaseTimer
) -> StepSolution:
    return setup.solve(replace(problem, stages=stages), timer)


def _reference(
    case: Case, mesh: Mesh, setup: Setup, report: Report
) -> tuple[list[float], list[StepSolution], FloatArray]:
    """Run the solver; return the part of the displacement at each step, solutions, and points."""
    made: list[StepSolution] = []

    def solve(problem: Problem, timer: PhaseTimer) -> StepSolution:
        made.append(setup.solve(problem, timer))
        return made[-1]

    steps = list(all_steps(Stepping(case, mesh, replace(setup, solve=solve), report, {})))
    # Of steps that were tried, those that are in the run: each has the control nodes it found.
    chosen = [next(s for s in made if s.control is step.control) for step in steps]
    return [step.part for step in steps], chosen, steps[-1].mesh.points


def _further(
    mesh: Mesh, setup: Setup, parts: Sequence[float], chosen: Sequence[StepSolution], report: Report
) -> list[StepSolution]:
    """Run the steps for ``setup.target``; return their solutions.

    Each selection begins with the control nodes of ``chosen``, the solution of the same step for
    another displacement, and adds more where these do not suffice.
    """
    coords = setup.coords
    total = len(parts)
    made: list[StepSolution] = []
    carried: CarriedError | None = None
    for k, (part, solution) in enumerate(zip(parts, chosen, strict=True)):
        control = solution.control
        if made:
            more = made[-1].control
            control = np.concatenate([control, more[~np.isin(more, control)]])
        timer = step_timer(report, k + 1, total)
        goal = value(setup.goal(setup.target, part))
        # Relaxation, after the last step, chooses no control nodes.
        begun = replace(setup.at_step(False), solve=partial(_continued, setup, solution.stages))
        made.append(
            one_step(
                begun, coords, goal, timer, replace(solution, control=control, carried=carried)
            )
        )
        carried = made[-1].carried
        coords = displaced_coords(setup, coords, value(made[-1].displacement), goal)
        if mesh.halo is not None:
            points = cartesian(setup.frame, mesh.points, setup.coords, coords)
            coords = with_halo_copies(setup, mesh, mesh.halo, points, coords)[1]
    return made
