"""A level of the greedy selection: the rows it has chosen, and the factor that grows with them.

Shapes: r rows of c candidates, m right-hand sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.evaluate import matrix
from slideviz.rbf.exact import condition_with_terms, gathered, row_keys, saddle_fit
from slideviz.rbf.kernels import KERNELS, PLAIN
from slideviz.rbf.problem import Interpolant, Problem
from slideviz.rbf.selection import newton, tie_breaker
from slideviz.rbf.solve import PIVOT_GUARD, condition, enough_threads, factorise, solve_lower


@dataclass(frozen=True, eq=False)
class Candidates:
    """The nodes that may be chosen, with their constraint rows; rows of one node are neighbours."""

    rows: ConstraintRows
    """Sorted by position, so that the numbering of the mesh changes no choice."""
    block: IntArray
    """(r,): the block of the system that each row is in."""
    candidate: IntArray
    """(r,): the candidate, from 0 to c - 1, that each row belongs to."""
    first: IntArray
    """(c,): the first row of each candidate."""
    tie_breaker: FloatArray
    """(c,): factor of each candidate's error, which decides between equal errors
    (`selection.tie_breaker`)."""

    @classmethod
    def of(cls, problem: Problem, rows: ConstraintRows) -> Candidates:
        """Return the candidates of ``rows``, which must be sorted by position."""
        new = np.r_[True, rows.nodes[1:] != rows.nodes[:-1]] if len(rows.nodes) else []
        first = np.flatnonzero(new)
        ranked = tie_breaker(problem.coords[rows.nodes[first]])
        return cls(rows, blocks(rows), np.cumsum(new, dtype=np.int64) - 1, first, ranked)

    def with_rows(self, problem: Problem, more: ConstraintRows) -> Candidates:
        """Return these candidates followed by those of ``more``; rows keep their numbers."""
        rows = self.rows.followed_by(more) if len(self.rows.nodes) else more
        return self.of(problem, rows)

    def values(self, problem: Problem, sum_: Interpolant) -> FloatArray:
        """Return the left-hand side of each row, (r, m), for the interpolant ``sum_``."""
        rows = self.rows
        s = sum_.at(problem, rows.nodes[self.first])[self.candidate]
        return s if rows.normals is None else np.einsum("rd,rd->r", s, rows.normals)[:, None]

    def errors(self, residual: FloatArray) -> FloatArray:
        """Return the error of each candidate: the length of its residual (r, m), (c,)."""
        squares = np.einsum("rm,rm->r", residual, residual)
        return np.sqrt(np.add.reduceat(squares, self.first)) if len(squares) else squares

    def has_row(self, which: np.ndarray) -> np.ndarray:
        """Return a mask (c,) of the candidates that have a row in the mask ``which`` (r,)."""
        found = np.zeros(len(self.first), bool)
        found[self.candidate[which]] = True
        return found


class GrowingFactor:
    """The Cholesky factor L of one block of the system, L L^T = G, to which rows are appended.

    Attributes
    ----------
    rows : (k,) int64
        The chosen rows, as indices of the candidates' rows.
    turn : (k,) int64
        The place of each in the order of choice over all blocks.
    lower : (k, k) float64
        L.
    """

    def __init__(self, width: int) -> None:
        self.rows = self.turn = np.empty(0, np.int64)
        self.lower = self._store = np.empty((0, 0))
        self.forward = np.empty((0, width))
        """(k, m): L^-1 b; shorter than L between `append` and `follow`."""

    def append(
        self, rows: IntArray, turn: IntArray, *, beside: FloatArray, corner: FloatArray
    ) -> None:
        """Append p rows to the factor: L21 is ``beside`` (p, k), L22 is ``corner`` (p, p)."""
        n, more = len(self.rows), len(rows)
        if n + more > len(self._store):
            # Room for twice as much: copying the factor in every cycle would cost as much as
            # computing it.
            self._store = np.zeros((2 * (n + more), 2 * (n + more)))
            self._store[:n, :n] = self.lower
        self._store[n : n + more, :n] = beside
        self._store[n : n + more, n : n + more] = corner
        self.lower = self._store[: n + more, : n + more]
        self.rows = np.concatenate([self.rows, rows])
        self.turn = np.concatenate([self.turn, turn])

    def follow(self, target: FloatArray) -> None:
        """Bring ``forward`` up to date with the rows appended; ``target`` (r, m) is b."""
        n = len(self.forward)
        rest = target[self.rows[n:]] - self.lower[n:, :n] @ self.forward
        self.forward = np.concatenate([self.forward, solve_lower(self.lower[n:, n:], rest)])

    def weights(self) -> FloatArray:
        """Return the weights (k, m) that solve G w = b."""
        return solve_lower(self.lower, self.forward, transposed=True)


class GreedyLevel:
    """The interpolant of one level, and the rows chosen for it so far.

    Attributes
    ----------
    previous_levels, increment : Interpolant
        The sum of the levels before, and what this level adds to it.
    singular : bool
        The system with a polynomial has no solution.
    """

    def __init__(
        self, problem: Problem, candidates: Candidates, previous_levels: Interpolant
    ) -> None:
        """Begin without rows, after levels whose sum is ``previous_levels``."""
        self._problem, self._among, self.previous_levels = problem, candidates, previous_levels
        # Only positive definite functions have pivots. For the others the default one tells
        # which nodes add most, and the weights come from the system with the polynomial.
        self._tailed, self.singular = KERNELS[problem.basis.kernel].polynomial, False
        self._basis = replace(problem.basis, kernel=PLAIN) if self._tailed else problem.basis
        self.increment = Interpolant(np.empty(0, np.int64), previous_levels.weights[:0])
        self.chosen: IntArray = np.empty(0, np.int64)
        """(k,): the chosen rows, in the order of their choice."""
        self.excluded = np.zeros(len(candidates.rows.nodes), bool)
        """(r,): rows that cannot be chosen any more: they are, or would make the system
        singular."""
        count = int(candidates.block.max(initial=0)) + 1
        self._grown = [GrowingFactor(candidates.rows.right.shape[1]) for _ in range(count)]

    @property
    def found(self) -> Interpolant:
        """The sum of all levels so far."""
        return self.previous_levels.plus(self.increment)

    @property
    def nodes(self) -> int:
        """How many nodes this level has chosen."""
        return len(np.unique(self._among.candidate[self.chosen]))

    @property
    def depth(self) -> float:
        """How many rows each block of the system has, on average."""
        return len(self.chosen) / len(self._grown)

    def extend_candidates(self, candidates: Candidates) -> None:
        """Choose among ``candidates`` from here on, which begin with those there were before."""
        more = np.zeros(len(candidates.rows.nodes) - len(self.excluded), bool)
        self._among, self.excluded = candidates, np.concatenate([self.excluded, more])

    def targets(self) -> FloatArray:
        """Return what this level has to meet: the data less the levels before, (r, m)."""
        right = self._among.rows.right
        if not len(self.previous_levels.nodes):
            return right
        return right - self._among.values(self._problem, self.previous_levels)

    def _rows(self, target: FloatArray) -> ConstraintRows:
        """Return the chosen rows, with their data from the target (r, m)."""
        all_, chosen = self._among.rows, self.chosen
        normals = None if all_.normals is None else all_.normals[chosen]
        return ConstraintRows(all_.nodes[chosen], normals, target[chosen])

    def solve(self, target: FloatArray) -> None:
        """Make ``increment`` meet the target (r, m) in the chosen rows."""
        rows = self._rows(target)
        if self._tailed:
            found, self.singular = saddle_fit(self._problem, rows)
        else:
            weights = np.empty_like(rows.right)
            for factor in self._grown:
                weights[factor.turn] = factor.weights()
            found = gathered(rows, weights)
        self.increment = replace(found, levels=(row_keys(self._among.rows)[self.chosen],))

    def pick(
        self,
        rows: IntArray,
        residual: FloatArray,
        *,
        count: int,
        floor: float,
        target: FloatArray,
    ) -> bool:
        """Run the Newton greedy on a pool's rows and append what it picks to the factors.

        Parameters
        ----------
        rows, residual : (p,), (p, m)
            The rows of the pool, and what the interpolant still lacks in each.
        count, floor
            How many nodes to pick at most, and the error below which to stop (the first is
            always picked).
        target : (r, m)
            What the level has to meet, in all rows of the candidates.

        Returns
        -------
        bool
            Whether any was picked. ``increment`` is not solved for yet: call `solve`.
        """
        among = self._among
        order = np.argsort(among.block[rows], kind="stable")
        rows, residual = rows[order], residual[order]
        parts = [rows[among.block[rows] == b] for b in range(len(self._grown))]
        left, schur = [], []
        for factor, part in zip(self._grown, parts, strict=True):
            beside, rest = self._remaining(factor, part)
            left.append(beside)
            schur.append(rest)
        candidate = among.candidate[rows]
        picked, bases = newton(
            schur,
            residual,
            nodes=candidate,
            factor=among.tie_breaker[candidate],
            count=count,
            floor=floor,
        )
        diagonal = np.concatenate([np.diag(s) for s in schur])
        self.excluded[rows[diagonal <= PIVOT_GUARD]] = True
        turn, start = len(self.chosen) + np.arange(len(picked)), 0
        for k, factor in enumerate(self._grown):
            mine = (picked >= start) & (picked < start + len(parts[k]))
            at = picked[mine] - start
            factor.append(parts[k][at], turn[mine], beside=left[k][:, at].T, corner=bases[k][at])
            factor.follow(target)
            start += len(parts[k])
        self.chosen = np.concatenate([self.chosen, rows[picked]])
        self.excluded[rows[picked]] = True
        return len(picked) > 0

    def append_rows(self, rows: IntArray, target: FloatArray) -> None:
        """Append ``rows``, chosen before (as by the step before), and solve for the target (r, m).

        Rows that the pivot guard leaves out are barred.
        """
        with enough_threads(len(rows) ** 3 / 3.0):
            for k, factor in enumerate(self._grown):
                part = rows[self._among.block[rows] == k]
                left, schur = self._remaining(factor, part)
                made = factorise(schur)
                turn = len(self.chosen) + np.arange(len(made.kept))
                factor.append(part[made.kept], turn, beside=left[:, made.kept].T, corner=made.lower)
                factor.follow(target)
                self.chosen = np.concatenate([self.chosen, part[made.kept]])
            self.excluded[rows] = True
            self.solve(target)

    def _remaining(self, factor: GrowingFactor, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return L^-1 G of p rows of the factor's block, (k, p), and their Schur complement."""
        nodes, normals = self._among.rows.nodes, self._among.rows.normals

        def place(index: IntArray) -> tuple[FloatArray, FloatArray | None]:
            features = self._problem.features[:, nodes[index]]
            return features, None if normals is None else normals[index]

        schur = matrix(self._basis, place(rows))
        if not len(factor.rows):
            return np.empty((0, len(rows))), schur
        left = solve_lower(factor.lower, matrix(self._basis, place(factor.rows), place(rows)))
        return left, schur - left.T @ left

    def condition(self) -> float:
        """Return an estimate of the condition number of the system of all blocks."""
        if self._tailed:
            return condition_with_terms(self._problem, self._rows(self._among.rows.right))
        factors = [factor.lower for factor in self._grown]
        with enough_threads(20.0 * max(len(lower) for lower in factors) ** 2):
            return condition(*factors)
