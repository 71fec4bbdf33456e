"""Greedy selection of control nodes (thesis section 2.5), block-wise and matrix-free.

A cycle takes the candidates of largest error as a pool, forms the pool's Schur complement with
the Cholesky factor grown so far, and runs the exact one-node Newton greedy (Pazouki and
Schaback 2011) inside the pool: pick the largest residual, eliminate it from the pool's matrix
and residuals, and so on, until enough nodes are picked or the pool's largest residual falls far
below the largest of all. The picked rows are appended to the factor, the weights follow from
two triangular solves, and the residual of all candidates is recomputed by the fused sums, which
is also the exact error. So nothing is factorised twice and no candidates-by-controls matrix
exists; picking one or two nodes in a cycle, as the thesis does, is the same with a small pool.

Steps after the first begin with the control nodes of the one before, and have to make up for
what these lacked (``Problem.lag``), so that the tolerance holds for the whole displacement.

Candidates are sorted by position, and every number depends on one candidate and the order of
the control nodes alone: neither numbering nor threads change the selection. Where errors are
equal but for rounding, as on symmetric meshes, the position decides (`selection.favour`), so that
another processor chooses the same nodes.

Every selection ends: a cycle without a new row is the last, and levels, which may choose the
same rows again, are given up when the error no longer falls from one to the next, or when they
have chosen as many rows as there are (`selection.LevelLimit`). Then one last level takes all it
needs. If an error stays above the tolerance, ``short`` says why, and what was found at the lowest
error is kept where that is clearly better.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.evaluate import matrix
from slideviz.rbf.exact import gathered, row_names, saddle_fit
from slideviz.rbf.kernels import KERNELS, PLAIN
from slideviz.rbf.problem import Cycle, Interpolant, Levels, Problem, Watch
from slideviz.rbf.selection import GrowingFactor, LevelLimit, favour, newton, pool
from slideviz.rbf.solve import PIVOT_GUARD, condition, enough_threads, factorise, solve_lower

STALE = 0.3
"""A block ends when the pool's largest error is below this part of the largest of all."""

WORSE = 2.0
"""A selection that fails goes back to its lowest error where the last is this much larger."""


class GreedyFit:
    """An interpolant that meets its constraints to a tolerance with few control nodes.

    Attributes
    ----------
    found : Interpolant
        The chosen nodes, in the order of their choice, and their coefficients, summed over the
        levels (Eq. 2.38).
    dropped : (m,) int64
        Nodes left out by the pivot guard although their error is above the tolerance.
    short : str
        Why the last selection ended above the tolerance, and a remedy; empty where it did not.
    history : tuple of Cycle
    stages : tuple of Levels
        The rows chosen after each call of ``add``.
    """

    def __init__(
        self, problem: Problem, watch: Watch, history: tuple[Cycle, ...] = (), *, done: int = 0
    ) -> None:
        """Begin without rows.

        Parameters
        ----------
        history, done
            Cycles and calls of ``add`` of another fit of the same step, before this one.
        """
        assert problem.reduction is not None
        self._problem, self._watch, self._settings = problem, watch, problem.reduction
        d = problem.values.shape[1]
        self.history, self.short = history, ""
        self.found = Interpolant(np.empty(0, np.int64), np.empty((0, d)))
        kernel = KERNELS[problem.basis.kernel]
        self._tailed, self._singular = kernel.polynomial, False
        # Only positive definite functions have pivots. For the others the default one tells
        # which nodes add most, and the weights come from the system with the polynomial.
        self._basis = replace(problem.basis, kernel=PLAIN) if self._tailed else problem.basis
        self.dropped: IntArray = np.empty(0, np.int64)
        self.stages: tuple[Levels, ...] = ()
        self.doubt = self.refined = 0.0
        self._start = perf_counter() - (history[-1].seconds if history else 0.0)
        self._level = history[-1].level if history else 1
        self._rows = ConstraintRows(np.empty(0, np.int64), None, np.empty((0, d)))
        self._candidate = self._block = np.empty(0, np.int64)
        self._known = problem.beginning()
        self._given, self._used = problem.stages[done:], list[int]()
        self._one_level = self._settings.level == "none"
        self._new_level()

    def _new_level(self) -> None:
        """Begin a level: an empty factor for what the levels before left."""
        self._settled = self.found
        self._now = Interpolant(np.empty(0, np.int64), self.found.weights[:0])
        self._grown = self._empty()
        self._chosen = np.empty(0, np.int64)
        self._barred = np.zeros(len(self._rows.nodes), bool)

    def _empty(self) -> list[GrowingFactor]:
        """Return a factor without rows for each block."""
        count = int(self._block.max(initial=0)) + 1
        return [GrowingFactor(self._rows.right.shape[1]) for _ in range(count)]

    def add(self, rows: ConstraintRows) -> None:
        """Meet these constraints too, and select until all errors are below the tolerance."""
        rows = rows.by_position(self._problem.coords)
        first = not len(self._rows.nodes)
        self._rows = rows if first else self._rows.followed_by(rows)
        rows = self._rows
        self._block = blocks(rows)
        if first:
            self._grown = self._empty()
        new = np.r_[True, rows.nodes[1:] != rows.nodes[:-1]] if len(rows.nodes) else []
        self._candidate = np.cumsum(new) - 1
        self._first = np.flatnonzero(new)
        self._favour = favour(self._problem.coords[rows.nodes[self._first]])
        more = len(rows.nodes) - len(self._barred)
        self._barred = np.concatenate([self._barred, np.zeros(more, bool)])
        with self._watch.phase("select"):
            self._select()
        self.stages += (self.found.levels,)

    def _select(self) -> None:
        """Run cycles until the error is below the tolerance, or nothing is left to choose."""
        settings = self._settings
        target = self._targets()
        residual = target - self._values(self._now)
        errors = self._errors(residual)
        goal = self._level_goal(errors)
        again = np.flatnonzero(np.isin(self._rows.nodes, self._known) & ~self._barred)
        if len(again) and (errors.max(initial=0.0) > settings.tolerance or self._given):
            self._record(errors)
            self._take(again, target)
            residual = target - self._values(self._now)
            errors = self._errors(residual)
        if self._take_given():
            target = self._targets()
            residual = target - self._values(self._now)
            errors = self._errors(residual)
            goal = self._level_goal(errors)
        rule, given_up = LevelLimit(errors.max(initial=0.0), len(self._rows.nodes)), False
        best = errors, self.found
        while True:
            self._record(errors)
            if errors.max(initial=0.0) <= settings.tolerance or self._full() or self._singular:
                break
            if not given_up and self._level_done(errors, goal):
                given_up = rule.ends(float(errors.max()), len(self._chosen))
                self._new_level()
                self._level += 1
                target, goal = self._targets(), self._level_goal(errors)
                residual = target
            if not self._grow(target, residual, errors):
                break
            residual = target - self._values(self._now)
            errors = self._errors(residual)
            if errors.max() < best[0].max():
                best = errors, self.found
            self._watch.report("select", self._fraction(errors))
        self._note_dropped(errors)
        self.short = self._shortfall(errors)
        if self.short and not self._full() and errors.max() > WORSE * best[0].max():
            self.found = best[1]
            self._new_level()
            self._record(best[0])

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
            "the nodes that are left add nothing but rounding to those chosen (RBF_KERNEL= "
            f"{basis.kernel} with a support radius of {basis.radius:.3g}); use a smaller "
            f"INFLUENCE_FACTOR, {other}or a larger tolerance"
        )

    def _level_goal(self, errors: FloatArray) -> float:
        return float(errors.max(initial=0.0)) * self._settings.level_ratio

    def _level_done(self, errors: FloatArray, goal: float) -> bool:
        """Tell whether the level is complete (section 2.5.2, 5.3.2)."""
        if self._settings.level == "size":
            count = len(np.unique(self._candidate[self._chosen]))
            return count >= self._settings.level_size
        return self._settings.level == "ratio" and len(self._chosen) > 0 and errors.max() < goal

    def _full(self) -> bool:
        limit = self._settings.max_nodes
        return limit is not None and len(self.found.nodes) >= limit

    def _fraction(self, errors: FloatArray) -> float:
        """Return how far the error has fallen from its first value, on a logarithmic scale."""
        first, now = self.history[0].error, float(errors.max(initial=0.0))
        span = np.log(max(first, 1e-300) / max(self._settings.tolerance, 1e-300))
        return float(np.clip(np.log(max(first, 1e-300) / max(now, 1e-300)) / max(span, 1e-9), 0, 1))

    def _record(self, errors: FloatArray) -> None:
        cycle = Cycle(
            len(self.history) + 1,
            self._level,
            float(errors.max(initial=0.0)),
            len(self.found.nodes),
            perf_counter() - self._start,
        )
        self.history = (*self.history, cycle)

    def _note_dropped(self, errors: FloatArray) -> None:
        """Remember the candidates that are barred although their error is too large."""
        over = errors > self._settings.tolerance
        barred = np.zeros(len(errors), bool)
        barred[self._candidate[self._barred]] = True
        barred[self._candidate[self._chosen]] = False
        barred |= self._singular
        self.dropped = np.unique(self._rows.nodes[self._first[over & barred]])

    def _targets(self) -> FloatArray:
        """Return what this level has to meet: the data less the levels before, (r, m)."""
        if not len(self._settled.nodes):
            return self._rows.right
        return self._rows.right - self._values(self._settled)

    def _own(self, target: FloatArray) -> Interpolant:
        """Return the interpolant of this level."""
        chosen, normals = self._chosen, self._rows.normals
        rows = ConstraintRows(
            self._rows.nodes[chosen], None if normals is None else normals[chosen], target[chosen]
        )
        if self._tailed:
            found, self._singular = saddle_fit(self._problem, rows)
        else:
            weights = np.empty_like(rows.right)
            for factor in self._grown:
                weights[factor.turn] = factor.weights()
            found = gathered(rows, weights)
        return replace(found, levels=(row_names(self._rows)[chosen],))

    def _values(self, sum_: Interpolant) -> FloatArray:
        """Return an interpolant in each row, (r, m)."""
        rows = self._rows
        s = sum_.at(self._problem, rows.nodes[self._first])[self._candidate]
        return s if rows.normals is None else np.einsum("rd,rd->r", s, rows.normals)[:, None]

    def _errors(self, residual: FloatArray) -> FloatArray:
        """Return the error of each candidate node: the length of its residual, (c,)."""
        squares = np.einsum("rm,rm->r", residual, residual)
        return np.sqrt(np.add.reduceat(squares, self._first)) if len(squares) else squares

    def _grow(self, target: FloatArray, residual: FloatArray, errors: FloatArray) -> bool:
        """Pick nodes, extend the factor and the weights; tell whether any could be picked."""
        open_ = np.zeros(len(errors), bool)
        open_[self._candidate[~self._barred]] = True
        favoured = errors * self._favour
        count, among = self._pool(np.where(open_, favoured, -1.0), residual)
        while len(among):
            rows = np.flatnonzero(np.isin(self._candidate, among) & ~self._barred)
            done = len(self._chosen) / len(self._grown)
            flops = 4.0 * (done + count) * len(rows) * done
            with enough_threads(flops):
                picked = self._pick(rows, residual[rows], count, float(errors.max()), target)
                if picked:
                    self._now = self._own(target)
            if picked:
                self.found = self._settled.plus(self._now)
                return True
            # All of the pool fell to the pivot guard: try the next ones.
            open_[among] = False
            count, among = self._pool(np.where(open_, favoured, -1.0), residual)
        return False

    def _pool(self, errors: FloatArray, residual: FloatArray) -> tuple[int, IntArray]:
        """Return how many nodes to pick, and the candidates to pick them from."""
        normals, d = self._rows.normals, self._problem.values.shape[1]
        vectors = residual
        if normals is not None:
            vectors = np.zeros((len(errors), d))
            np.add.at(vectors, self._candidate, residual * normals)
        per_node = max(1, len(self._candidate) // max(1, len(errors)))
        return pool(
            errors,
            vectors,
            self._settings,
            chosen=len(self.found.nodes),
            chosen_in_level=len(np.unique(self._candidate[self._chosen])),
            per_node=per_node,
        )

    def _pick(
        self,
        rows: IntArray,
        residual: FloatArray,
        count: int,
        largest: float,
        target: FloatArray,
    ) -> bool:
        """Run the Newton greedy on the pool's rows and append what it picks to the factors."""
        order = np.argsort(self._block[rows], kind="stable")
        rows, residual = rows[order], residual[order]
        parts = [rows[self._block[rows] == b] for b in range(len(self._grown))]
        left, schur = [], []
        for factor, part in zip(self._grown, parts, strict=True):
            beside, rest = self._remaining(factor, part)
            left.append(beside)
            schur.append(rest)
        floor = 0.0 if self._settings.pick != "block" else STALE * largest
        floor = max(floor, self._settings.tolerance)
        candidate = self._candidate[rows]
        picked, bases = newton(
            schur,
            residual,
            nodes=candidate,
            factor=self._favour[candidate],
            count=count,
            floor=floor,
        )
        diagonal = np.concatenate([np.diag(s) for s in schur])
        self._barred[rows[diagonal <= PIVOT_GUARD]] = True
        turn, start = len(self._chosen) + np.arange(len(picked)), 0
        for k, factor in enumerate(self._grown):
            mine = (picked >= start) & (picked < start + len(parts[k]))
            at = picked[mine] - start
            factor.append(parts[k][at], turn[mine], beside=left[k][:, at].T, corner=bases[k][at])
            factor.follow(target)
            start += len(parts[k])
        self._chosen = np.concatenate([self._chosen, rows[picked]])
        self._barred[rows[picked]] = True
        return len(picked) > 0

    def _take(self, rows: IntArray, target: FloatArray) -> None:
        """Append rows chosen in the step before to the factors."""
        with enough_threads(len(rows) ** 3 / 3.0):
            for k, factor in enumerate(self._grown):
                part = rows[self._block[rows] == k]
                left, schur = self._remaining(factor, part)
                made = factorise(schur)
                turn = len(self._chosen) + np.arange(len(made.kept))
                factor.append(part[made.kept], turn, beside=left[:, made.kept].T, corner=made.lower)
                factor.follow(target)
                self._chosen = np.concatenate([self._chosen, part[made.kept]])
            self._barred[rows] = True
            self._now = self._own(target)
        self.found = self._settled.plus(self._now)

    def _take_given(self) -> bool:
        """Take the levels that were chosen for other data; tell whether there were any."""
        stage = len(self.stages)
        if self._one_level or stage >= len(self._given):
            return False
        place = {tuple(name): k for k, name in enumerate(row_names(self._rows).tolist())}
        taken = False
        for level, names in enumerate(self._given[stage]):
            used = self._used[level] if level < len(self._used) else 0
            rows = np.array([place[tuple(name)] for name in names[used:].tolist()], np.int64)
            if not len(rows):
                continue
            if level >= len(self._used):
                if len(self._chosen):
                    self._new_level()
                    self._level += 1
                self._used.append(0)
            self._used[level] = len(names)
            rows = rows[~self._barred[rows]]
            if len(rows):
                self._take(rows, self._targets())
                taken = True
        return taken

    def _remaining(self, factor: GrowingFactor, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return L^-1 G of rows of a block, (k, p), and their Schur complement, (p, p)."""

        def place(index: IntArray) -> tuple[FloatArray, FloatArray | None]:
            nodes, normals = self._rows.nodes[index], self._rows.normals
            return self._problem.features[:, nodes], None if normals is None else normals[index]

        schur = matrix(self._basis, place(rows))
        if not len(factor.rows):
            return np.empty((0, len(rows))), schur
        left = solve_lower(factor.lower, matrix(self._basis, place(factor.rows), place(rows)))
        return left, schur - left.T @ left

    def condition(self) -> float:
        """Return an estimate of the condition number of the last level's system."""
        factors = [factor.lower for factor in self._grown]
        with enough_threads(20.0 * max(len(lower) for lower in factors) ** 2):
            return condition(*factors)
