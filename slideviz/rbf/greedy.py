"""Greedy selection of control nodes (thesis section 2.5), block-wise and matrix-free.

A cycle takes the candidates of largest error as a pool, forms the pool's Schur complement with
the Cholesky factor grown so far, and runs the exact one-node Newton greedy (Pazouki and
Schaback 2011) inside the pool: pick the largest residual, eliminate it from the pool's matrix
and residuals, and so on, until enough nodes are picked or the pool's largest residual falls far
below the largest of all. The picked rows are appended to the factor, the weights follow from
two triangular solves, and the residual of all candidates is recomputed by the fused sums, which
is also the exact error. So nothing is factorised twice and no candidates-by-controls matrix
exists; picking one or two nodes in a cycle, as the thesis does, is the same with a small pool.

Steps after the first begin with the control nodes of the step before, and have to make up for
the errors that it left (``Problem.carried_error``), so that the tolerance holds for the whole
displacement.

Candidates are sorted by position, and the error of each depends on nothing but the candidate and
the order of the control nodes: neither numbering nor threads change the selection. Where errors are
equal but for rounding, as on symmetric meshes, the position decides (`level.tie_breaker`), so
that another processor chooses the same nodes.

Every selection ends: a cycle without a new row is the last, and levels, which may choose the
same rows again, are given up when the error no longer falls from one to the next, or when they
have chosen as many rows as there are (`level.LevelLimit`). Then one last level goes on without
a limit. If an error stays above the tolerance, ``short`` says why, and the interpolant of lowest
error is taken where it is clearly better than the last one (`WORSE`).
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from slideviz.mesh.model import NO_NODES, FloatArray, IntArray, mask_of
from slideviz.rbf.constraint_rows import ConstraintRows
from slideviz.rbf.exact import Fit, row_keys
from slideviz.rbf.kernels import PLAIN
from slideviz.rbf.level import Candidates, GreedyLevel, LevelLimit, pool
from slideviz.rbf.problem import Cycle, PhaseTimer, Problem
from slideviz.rbf.solve import enough_threads

STALE = 0.3
"""Picking from a pool ends when its largest error is below this part of that of all candidates."""

WORSE = 2.0
"""A selection that fails returns its interpolant of lowest error where the last error is more than
this many times as large."""


class GreedyFit(Fit):
    """An interpolant that meets its constraints to a tolerance with few control nodes.

    ``dropped``: nodes that the guard left out although their error is above the tolerance.
    """

    def __init__(
        self, problem: Problem, timer: PhaseTimer, history: tuple[Cycle, ...] = (), *, done: int = 0
    ) -> None:
        """Begin without rows; ``problem`` must have a reduction.

        ``history`` and ``done``: cycles, and number of calls of ``add``, of an earlier fit in the
        same step (the first of the two of direct sliding).
        """
        assert problem.reduction is not None
        super().__init__(problem)
        self._timer = timer
        self._settings = problem.reduction
        self.history = history
        self._start = perf_counter() - (history[-1].seconds if history else 0.0)
        self._number = history[-1].level if history else 1
        rows = ConstraintRows(NO_NODES, None, np.empty((0, problem.dim)))
        self._among = Candidates(rows, NO_NODES, NO_NODES, NO_NODES, np.empty(0))
        self._level = GreedyLevel(problem, self._among, self.interpolant)
        self._known = problem.initial_control_nodes()
        self._given = problem.stages[done:]
        self._used = list[int]()
        self._one_level = not self._settings.multilevel

    def _new_level(self) -> None:
        """Begin a level, which has to meet what the levels before it lack."""
        self._level = GreedyLevel(self._problem, self._among, self.interpolant)

    def add(self, rows: ConstraintRows) -> None:
        """Meet these constraints too, and select until all errors are below the tolerance."""
        first = not len(self._among.rows.nodes)
        self._among = self._among.with_rows(self._problem, rows.by_position(self._problem.coords))
        if first:
            self._new_level()
        else:
            self._level.extend_candidates(self._among)
        with self._timer.phase("select"):
            self._select()
        self.stages += (self.interpolant.levels,)

    def _select(self) -> None:
        """Run cycles until the error is below the tolerance, or nothing is left to choose."""
        settings = self._settings
        target = self._level.targets()
        residual, errors = self._misfit(target)
        goal = self._level_goal(errors)
        known = np.isin(self._among.rows.nodes, self._known)
        again = np.flatnonzero(known & ~self._level.excluded)
        if len(again) and (errors.max(initial=0.0) > settings.tolerance or self._given):
            self._record(errors)
            self._append(again, target)
            residual, errors = self._misfit(target)
        if self._append_given_levels():
            target = self._level.targets()
            residual, errors = self._misfit(target)
            goal = self._level_goal(errors)
        rule = LevelLimit(errors.max(initial=0.0), len(self._among.rows.nodes))
        given_up = False
        best = (errors, self.interpolant)
        while True:
            self._record(errors)
            enough = errors.max(initial=0.0) <= settings.tolerance
            if enough or self._full() or self._level.singular:
                break
            if not given_up and self._level_done(errors, goal):
                given_up = rule.ends(float(errors.max()), len(self._level.chosen))
                self._new_level()
                self._number += 1
                target = self._level.targets()
                goal = self._level_goal(errors)
                residual = target
            if not self._grow(target, residual, errors):
                break
            residual, errors = self._misfit(target)
            if errors.max() < best[0].max():
                best = errors, self.interpolant
            self._timer.report("select", self._fraction(errors))
        self._note_dropped(errors)
        self.short = self._shortfall(errors)
        if self.short and not self._full() and errors.max() > WORSE * best[0].max():
            self.interpolant = best[1]
            self._new_level()
            self._record(best[0])

    def _misfit(self, target: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the level lacks of its target (r, m), and the error of each node, (c,)."""
        residual = target - self._among.values(self._problem, self._level.increment)
        return residual, self._among.errors(residual)

    def _shortfall(self, errors: FloatArray) -> str:
        """Return why the selection ended above its tolerance, and a remedy; empty if it did not."""
        if errors.max(initial=0.0) <= self._settings.tolerance:
            return ""
        if self._full():
            return (
                f"MAX_CONTROL_NODES= {self._settings.max_nodes} are chosen; allow more, or a "
                "larger tolerance"
            )
        basis = self._problem.basis
        other = "" if basis.kernel == PLAIN else f"RBF_KERNEL= {PLAIN}, "
        return (
            "the remaining nodes add nothing but rounding to the chosen ones (RBF_KERNEL= "
            f"{basis.kernel} with a support radius of {basis.radius:.3g}); use a smaller "
            f"INFLUENCE_FACTOR, {other}or a larger tolerance"
        )

    def _level_goal(self, errors: FloatArray) -> float:
        """Return the error at which a level is complete that begins with ``errors`` (c,)."""
        return float(errors.max(initial=0.0)) * self._settings.level_tolerance

    def _level_done(self, errors: FloatArray, goal: float) -> bool:
        """Return whether the level is complete (section 2.5.2, 5.3.2); never for a single level."""
        if not self._settings.multilevel:
            return False
        if self._settings.criterion == "size":
            return self._level.nodes >= self._settings.level_size
        some = len(self._level.chosen) > 0
        return some and bool(errors.max() < goal)

    def _full(self) -> bool:
        limit = self._settings.max_nodes
        return limit is not None and len(self.interpolant.nodes) >= limit

    def _fraction(self, errors: FloatArray) -> float:
        """Return the logarithmic progress, 0 to 1, of the error from the first to the tolerance."""
        first = self.history[0].error
        now = float(errors.max(initial=0.0))
        span = np.log(max(first, 1e-300) / max(self._settings.tolerance, 1e-300))
        return float(np.clip(np.log(max(first, 1e-300) / max(now, 1e-300)) / max(span, 1e-9), 0, 1))

    def _record(self, errors: FloatArray) -> None:
        cycle = Cycle(
            len(self.history) + 1,
            self._number,
            float(errors.max(initial=0.0)),
            len(self.interpolant.nodes),
            perf_counter() - self._start,
        )
        self.history = (*self.history, cycle)

    def _note_dropped(self, errors: FloatArray) -> None:
        """Set ``dropped``: nodes the guard left out although their error is above the tolerance."""
        level = self._level
        among = self._among
        chosen = mask_of(len(level.excluded), level.chosen)
        excluded = (among.has_row(level.excluded) & ~among.has_row(chosen)) | level.singular
        over = errors > self._settings.tolerance
        self.dropped = np.unique(among.rows.nodes[among.first[over & excluded]])

    def _grow(self, target: FloatArray, residual: FloatArray, errors: FloatArray) -> bool:
        """Pick nodes and solve with them, which sets ``interpolant``; return whether any could be.

        ``target`` and ``residual`` (r, m): what the level has to meet, and what it still lacks.
        ``errors`` (c,): error of each candidate.
        """
        level = self._level
        among = self._among
        open_ = among.has_row(~level.excluded)
        weighted = errors * among.tie_breaker
        largest = float(errors.max())
        floor = 0.0 if self._settings.selection != "block" else STALE * largest
        floor = max(floor, self._settings.tolerance)
        while True:
            count, pooled = self._pool(np.where(open_, weighted, -1.0), residual)
            if not len(pooled):
                return False
            rows = np.flatnonzero(np.isin(among.candidate, pooled) & ~level.excluded)
            done = level.depth
            with enough_threads(4.0 * (done + count) * len(rows) * done):
                if level.pick(rows, residual[rows], count=count, floor=floor, target=target):
                    level.solve(target)
                    self.interpolant = level.interpolant
                    return True
            # All of the pool fell to the pivot guard: try the next ones.
            open_[pooled] = False

    def _pool(self, errors: FloatArray, residual: FloatArray) -> tuple[int, IntArray]:
        """Return how many nodes to pick, and the candidates to pick them from (`level.pool`).

        ``errors`` (c,) are multiplied with the candidates' ``tie_breaker``, and negative where one
        cannot be picked; ``residual`` (r, m).
        """
        among = self._among
        d = self._problem.dim
        normals = among.rows.directions
        vectors = residual
        if normals is not None:
            vectors = np.zeros((len(errors), d))
            np.add.at(vectors, among.candidate, residual * normals)
        return pool(
            errors,
            vectors,
            self._settings,
            chosen=len(self.interpolant.nodes),
            chosen_in_level=self._level.nodes,
            per_node=max(1, len(among.candidate) // max(1, len(errors))),
        )

    def _append(self, rows: IntArray, target: FloatArray) -> None:
        """Add rows that were chosen in the step before, or for other data, to the level."""
        self._level.append_rows(rows, target)
        self.interpolant = self._level.interpolant

    def _append_given_levels(self) -> bool:
        """Add the levels that were chosen for other data (``Problem.stages``) to the fit.

        Returns whether any row was added; never for a single level.
        """
        stage = len(self.stages)
        if self._one_level or stage >= len(self._given):
            return False
        place = {tuple(name): k for k, name in enumerate(row_keys(self._among.rows).tolist())}
        taken = False
        for level, names in enumerate(self._given[stage]):
            used = self._used[level] if level < len(self._used) else 0
            rows = np.array([place[tuple(name)] for name in names[used:].tolist()], np.int64)
            if not len(rows):
                continue
            if level >= len(self._used):
                if len(self._level.chosen):
                    self._new_level()
                    self._number += 1
                self._used.append(0)
            self._used[level] = len(names)
            rows = rows[~self._level.excluded[rows]]
            if len(rows):
                self._append(rows, self._level.targets())
                taken = True
        return taken

    def condition(self) -> float:
        """Return an estimate of the condition number of the last level's system."""
        return self._level.condition()
