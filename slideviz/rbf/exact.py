"""The exact fit: every constraint is in the system (thesis sections 2.1 and 2.4)."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from slideviz.mesh.model import NO_NODES, FloatArray, IntArray, largest_size, row_dots, run_begins
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.double_double import supports
from slideviz.rbf.evaluate import Rows, Tick, matrix
from slideviz.rbf.field import linear_terms
from slideviz.rbf.problem import Cycle, Interpolant, Levels, PhaseTimer, Problem, first_occurrences
from slideviz.rbf.refine import TRUSTED, System, check_points
from slideviz.rbf.solve import (
    NOTHING,
    Factor,
    condition,
    enough_threads,
    extend,
    polynomial,
    saddle_condition,
    solve_lower,
    solve_saddle,
)
from slideviz.rbf.tape import Array, gather, multiply, value
from slideviz.system.device import arrays_at


class Fit:
    """An interpolant to which constraints are added."""

    history: tuple[Cycle, ...] = ()
    dropped: IntArray = NO_NODES
    """(m,): nodes of which the pivot guard left out a constraint."""
    stages: tuple[Levels, ...] = ()  # the rows in the system after each call of `add`
    short = ""  # why it is above its tolerance, and a remedy; empty where it is not
    error_estimate: Any = 0.0
    refined = 0.0
    """`error_estimate`, `refined`: as of a ``StepSolution``."""

    def __init__(self, problem: Problem) -> None:
        """Begin without rows."""
        self._problem = problem
        self.interpolant = Interpolant(NO_NODES, np.empty((0, problem.dim)))
        """Of all rows added so far."""

    @abstractmethod
    def add(self, rows: ConstraintRows) -> None:
        """Add constraints, and meet all of them, exactly or to the tolerance."""

    @abstractmethod
    def condition(self) -> float:
        """Return an estimate of the condition number of the system."""


class ExactFit(Fit):
    """The interpolant that meets all rows: solves ``G w = b``, G_ab = phi_ab (n_a . n_b).

    With a polynomial G w = b - P c (`solve.polynomial`), or one system for both if G is not
    definite.

    Rows are sorted by position, so that the pivot guard leaves out the same rows however nodes
    are numbered. Each system of pseudo sliding is the leading block of the next: one factor grows.
    Nodes that no support connects with one that moves have no weight, and are left out
    (`Problem.reach`).
    """

    def __init__(self, problem: Problem, timer: PhaseTimer) -> None:
        super().__init__(problem)
        self._timer = timer
        self._rows: ConstraintRows | None = None
        self._factors: dict[int, Factor] = {}

    def add(self, rows: ConstraintRows) -> None:
        """Add rows, solve with all rows added so far, and set ``interpolant``."""
        problem = self._problem
        rows = rows.by_position(self._problem.coords)
        if self._rows is not None:
            rows = self._rows.followed_by(rows)
        self._rows = rows
        with self._timer.phase("solve") as tick:
            if problem.basis.saddle:
                self.interpolant, deficient = saddle_fit(problem, rows)
                self.dropped = np.unique(rows.nodes) if deficient else NO_NODES
                self.error_estimate = max(
                    self.error_estimate, saddle_error_estimate(problem, rows, self.interpolant)
                )
                self.stages += ((row_keys(rows),),)
                return
            weights = np.zeros_like(rows.data)
            label, moves = problem.reach
            active = moves[label[rows.nodes]]
            names = row_keys(rows)
            solved = [
                part[label[rows.nodes[part]] == each]
                for part in parts(rows)
                for each in np.unique(label[rows.nodes[part]])
                # What never moves counts where the system is kept for other data.
                if moves[each] or problem.lasting
            ]
            work = [self._extend(rows, part, tick) for part in solved]
            tail = None
            rest = rows.data
            if problem.basis.polynomial:
                terms = row_terms(problem, rows)
                tail = self._polynomial(terms, rest, solved)
                rest = rest - terms @ tail
            dropped = []
            for part, flops in zip(solved, work, strict=True):
                with enough_threads(flops):
                    found = self._factors[int(part[0])].solve(rest[part])
                weights[part], left = self._checked(rows, part, rest[part], found, tick)
                dropped.append(left)
        left_out = np.concatenate(dropped)
        self.dropped = np.unique(rows.nodes[left_out])
        some = np.flatnonzero(active)
        self.interpolant = gathered(rows.only(some), weights[some], with_components(tail, problem))
        known = np.setdiff1d(np.arange(len(names)) if problem.lasting else some, left_out)
        self.stages += ((names[known],),)

    def _place(self, rows: ConstraintRows) -> Rows:
        """Return the features (k, r) and directions of rows."""
        return self._problem.place(rows.nodes), rows.directions

    def _extend(self, rows: ConstraintRows, part: IntArray, tick: Tick) -> float:
        """Extend the factor of the rows ``part``, one block, by those that are new.

        Returns the number of operations that this takes.
        """
        before = self._factors.get(int(part[0]), NOTHING)
        new = part[len(before.retained) + len(before.dropped) :]
        ends = self._place(rows.only(new)), self._place(rows.only(part))
        system = matrix(self._problem.basis, *ends, tick)
        with enough_threads(flops := len(system) * len(part) ** 2 / 3):
            arrays = arrays_at(self._problem.basis.place)
            self._factors[int(part[0])] = extend(before, system, tick, arrays)
        return flops

    def _polynomial(
        self, terms: FloatArray, right: FloatArray, solved: list[IntArray]
    ) -> FloatArray:
        """Return the polynomial's coefficients (q, m) for terms (r, q) and data (r, m) of rows."""
        kept = [NO_NODES]
        forward = [np.empty((0, terms.shape[1] + right.shape[1]))]
        for part in solved:
            factor = self._factors[int(part[0])]
            kept.append(part[factor.retained])
            forward.append(solve_lower(factor.lower, np.c_[terms, right][kept[-1]]))
        along, across = np.hsplit(np.concatenate(forward), [terms.shape[1]])
        return polynomial(terms[np.concatenate(kept)], along, across)

    def _checked(
        self, rows: ConstraintRows, part: IntArray, right: FloatArray, found: FloatArray, tick: Tick
    ) -> tuple[FloatArray, IntArray]:
        """Return the weights of the rows ``part``, one block, and the rows that they do not meet.

        The weights are ``found``, or refined ones where these are much better: they meet all rows,
        also those that the pivot guard left out. Sets ``error_estimate`` and ``refined``.
        ``right`` and ``found`` (n, m): right-hand sides, and the weights that the factor gives.
        Errors are judged by the largest component of the data of all blocks.
        """
        system = System(
            self._problem.basis, self._place(rows.only(part)), self._factors[int(part[0])]
        )
        largest = largest_size(rows.data)
        trials = [(right, found, largest)]
        if self._problem.lasting:
            rough = system.rough_data()
            trials.append((rough, system.factor.solve(rough), 1.0))
        field_error = [
            float(system.field_error(data, first).max(initial=0.0)) / (size or 1.0)
            for data, first, size in trials
        ]
        if max(field_error) > TRUSTED and supports(system.basis):
            refined = [
                system.refined(data, np.full(data.shape[1], size), first, lambda _: tick(1.0))
                for data, first, size in trials
            ]
            error_estimate = max(float(each.error_estimate.max(initial=0.0)) for each in refined)
            if refined[0].exact or error_estimate < max(field_error):
                first = max(float(each.before.max(initial=0.0)) for each in refined)
                self.refined = max(self.refined, *field_error, first)
                noise = min(system.noise(lambda _: tick(1.0)) / (largest or 1.0), 1.0)
                self.error_estimate = max(self.error_estimate, error_estimate, noise)
                return refined[0].weights, part[:0]
        self.error_estimate = max(self.error_estimate, *field_error)
        return found, part[system.factor.dropped]

    def condition(self) -> float:
        """Return an estimate of the condition number of the last system; 1.0 before any."""
        if self._factors:
            factors = [factor.lower for factor in self._factors.values()]
            with enough_threads(20.0 * max(len(lower) for lower in factors) ** 2):
                return condition(*factors)
        return 1.0 if self._rows is None else condition_with_terms(self._problem, self._rows)


def parts(rows: ConstraintRows) -> list[IntArray]:
    """Return the indices (p,) of the rows of each block of the system."""
    block = blocks(rows)
    return [np.flatnonzero(block == k) for k in np.unique(block)]


def row_keys(rows: ConstraintRows) -> IntArray:
    """Return a name for each row, (r, 2), that no reordering of nodes changes.

    The row's node, and its place among the rows of that node, from 0.
    """
    place = np.arange(len(rows.nodes))
    first = np.maximum.accumulate(np.where(run_begins(rows.nodes), place, 0))
    return np.stack([rows.nodes, place - first], axis=1)


def with_components(tail: FloatArray | None, problem: Problem) -> FloatArray | None:
    """Return coefficients (q, d), also those (q d, 1) of rows with directions; None without."""
    return None if tail is None else tail.reshape(-1, problem.dim)


def gathered(rows: ConstraintRows, weights: Array, tail: Array | None = None) -> Interpolant:
    """Return the interpolant with a weight for each row, (r, m), summed up for each node.

    ``tail`` (q, d) are the coefficients of the polynomial's terms.
    """
    if rows.normals is None:
        return Interpolant(rows.nodes, weights, tail)
    nodes, place = first_occurrences(rows.nodes)
    return Interpolant(nodes, gather(multiply(rows.normals, weights), place, len(nodes)), tail)


def row_terms(problem: Problem, rows: ConstraintRows) -> FloatArray:
    """Return the values of the polynomial's terms in each row, (r, q), or (r, q d) with normals."""
    terms = linear_terms(problem.basis, problem.place(rows.nodes))
    if rows.directions is None:
        return terms
    return np.einsum("rq,rd->rqd", terms, rows.directions).reshape(len(terms), -1)


def saddle_fit(problem: Problem, rows: ConstraintRows) -> tuple[Interpolant, bool]:
    """Return the interpolant with polynomial, and whether the system was singular."""
    place = problem.place(rows.nodes), rows.directions
    solved = solve_saddle(matrix(problem.basis, place), row_terms(problem, rows), rows.data)
    tail = with_components(solved.tail, problem)
    return gathered(rows, solved.weights, tail), solved.rank_deficient


def condition_with_terms(problem: Problem, rows: ConstraintRows) -> float:
    """Return the condition number of the system of ``rows`` with the polynomial."""
    if not len(rows.nodes):
        return 1.0
    place = problem.place(rows.nodes), rows.directions
    return saddle_condition(matrix(problem.basis, place), row_terms(problem, rows))


def saddle_error_estimate(problem: Problem, rows: ConstraintRows, found: Interpolant) -> float:
    """Return the error of the field of a system with polynomial between control nodes (`refine`).

    As a part of the largest displacement; 0 where it is below `TRUSTED`.
    """
    largest = largest_size(rows.data)
    met = value(found.at(problem, rows.nodes))
    if rows.directions is not None:
        met = row_dots(met, rows.directions)[:, None]
    lacking = ConstraintRows(rows.nodes, rows.directions, rows.data - met)
    field = saddle_fit(problem, lacking)[0].field(problem)
    field_error = np.abs(field.interpolated(check_points(problem.place(rows.nodes)))).max(
        initial=0.0
    )
    return float(field_error / largest) if field_error > TRUSTED * largest else 0.0
