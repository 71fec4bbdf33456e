"""A level of the greedy selection: the rows it has chosen, and the factor that grows with them.

Shapes: r rows of c candidates, m right-hand sides.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import (
    NO_NODES,
    BoolArray,
    FloatArray,
    IntArray,
    mask_of,
    row_dots,
    row_norms,
    run_begins,
)
from slideviz.mesh.nearest import OBLIQUE
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.evaluate import Rows, matrix
from slideviz.rbf.exact import (
    condition_with_terms,
    gathered,
    row_keys,
    row_terms,
    saddle_fit,
    with_components,
)
from slideviz.rbf.kernels import PLAIN
from slideviz.rbf.problem import Interpolant, Problem
from slideviz.rbf.reduction import Reduction
from slideviz.rbf.solve import (
    PIVOT_GUARD,
    condition,
    enough_threads,
    factorise,
    polynomial,
    solve_lower,
)
from slideviz.rbf.tape import value

POOL = 768  # largest number of rows in the pool of a block

POOL_START = 192  # number of candidates in the first pools, at least

POOL_SHARE = 6
"""Candidates in the pool for each node to pick: as good, measured by the number of control nodes,
as the largest pool from the start, and cheaper."""

BLOCK_LIMIT = 128  # largest number of nodes picked in a cycle

TIE = 1e-4
"""Errors with a smaller relative difference may count as equal: far above their rounding, far
below what matters for the choice. `tie_breaker` decides between them."""

FALL = 0.9  # an error has fallen when it is below this part of the lowest one before

LOSSES = 8  # number of levels in a row without a fall of the error that end a selection in levels


def newton(
    schur: list[FloatArray],
    residual: FloatArray,
    *,
    nodes: IntArray,
    factor: FloatArray,
    count: int,
    floor: float,
) -> tuple[IntArray, list[FloatArray]]:
    """Return the rows picked by the one-node Newton greedy, and the Newton basis of each block.

    Returns ``picked`` (q,) int64: places of rows among the p, in the order of choice; ``basis``
    list of (p_k, q_k): a column for each picked row of the block, in the same order.
    ``schur``: what remains of the pool's matrix after the nodes chosen before, block after block.
    ``residual`` (p, m): of all rows of the pool, those of a block together, p the sum of all p_k.
    ``nodes`` (p,), ``factor`` (p,): the node of each row (all rows of a node are picked together),
    and the node's factor (`tie_breaker`), with which its error is multiplied to decide between
    equal errors.
    ``count`` and ``floor``: number of nodes, and the error below which to stop (the first is always
    taken).
    """
    stops = np.cumsum([len(s) for s in schur])
    block = np.repeat(np.arange(len(schur)), [len(s) for s in schur])
    pivot = np.concatenate([np.diag(s) for s in schur])
    rest = residual.copy()
    basis = [np.zeros((len(s), min(len(s), count * 3))) for s in schur]
    used = [0] * len(schur)
    open_ = pivot > PIVOT_GUARD
    picked: list[int] = []
    names, first, group = np.unique(nodes, return_index=True, return_inverse=True)
    favoured = factor[first]
    for turn in range(count):
        squares = np.where(open_, row_dots(rest, rest), 0.0)
        error = np.sqrt(np.bincount(group, squares, len(names)))
        best = int(np.argmax(error * favoured))
        if error[best] <= 0 or (turn and error[best] < floor):
            break
        for row in np.flatnonzero((group == best) & open_):
            if pivot[row] <= PIVOT_GUARD:
                continue
            b = block[row]
            here = slice(stops[b] - len(schur[b]), stops[b])
            k = used[b]
            local = row - here.start
            # The matrix is symmetric, and a row of it lies together.
            v = schur[b][local] - basis[b][:, :k] @ basis[b][local, :k]
            v /= np.sqrt(pivot[row])
            rest[here] -= np.outer(v, rest[row] / np.sqrt(pivot[row]))
            pivot[here] -= v * v
            basis[b][:, k] = v
            used[b] += 1
            picked.append(int(row))
        open_ &= (group != best) & (pivot > PIVOT_GUARD)
    return np.array(picked, np.int64), [f[:, :k] for f, k in zip(basis, used, strict=True)]


def tie_breaker(coords: FloatArray) -> FloatArray:
    """Return a factor for the error of each candidate, (c,), that decides between equal errors.

    It grows from 1 to 1 + TIE along `OBLIQUE`: no sum of whole multiples of its components is zero,
    so no two points of a grid get the same.
    ``coords`` (c, d): positions of the candidates in the frame.
    """
    if not len(coords):
        return np.empty(0)
    along = coords @ OBLIQUE[: coords.shape[1]]
    low = along.min()
    high = along.max()
    return 1.0 + TIE * (along - low) / max(high - low, 1e-300)


def pool(
    errors: FloatArray,
    vectors: FloatArray,
    settings: Reduction,
    *,
    chosen: int,
    chosen_in_level: int,
    per_node: int,
) -> tuple[int, IntArray]:
    """Return how many nodes to pick, and the candidates (k,) to pick them from.

    0 and none where no error is above the tolerance.
    ``errors`` (c,): of each candidate, times its ``tie_breaker``; negative where it cannot be
    picked.
    ``vectors`` (c, d): the errors as vectors in the frame.
    ``chosen`` and ``chosen_in_level``: nodes picked so far: in all levels, and in this one.
    ``per_node``: rows of a candidate, on average.
    """
    eligible = np.count_nonzero(errors > settings.tolerance)
    if not eligible:
        return 0, NO_NODES
    worst = int(np.argmax(errors))
    if settings.selection == "one":
        return 1, np.array([worst])
    if settings.selection == "double":
        return _double(errors, vectors, worst, settings.tolerance)
    count = int(np.clip(chosen // 4, 4, BLOCK_LIMIT))
    size = min(eligible, POOL // per_node, max(POOL_START, POOL_SHARE * count))
    order = np.argsort(-errors, kind="stable")[:size]
    if settings.multilevel and settings.criterion == "size":
        count = min(count, max(1, settings.level_size - chosen_in_level))
    if settings.max_nodes is not None:
        count = min(count, max(1, settings.max_nodes - chosen))
    return count, np.sort(order)


def _double(
    errors: FloatArray, vectors: FloatArray, worst: int, tolerance: float
) -> tuple[int, IntArray]:
    """Return a count and as many candidates: ``worst``, and the worst of opposite error, if any.

    An error is opposite when it is at more than 90° to that of ``worst``.
    """
    lengths = row_norms(vectors)
    cosine = vectors @ vectors[worst] / np.maximum(lengths * lengths[worst], 1e-300)
    # Errors along different axes are perpendicular but for rounding.
    opposite = np.where(cosine < -TIE, errors, -1.0)
    second = int(np.argmax(opposite))
    if opposite[second] <= tolerance:
        return 1, np.array([worst])
    return 2, np.sort([worst, second])


class LevelLimit:
    """Decides when a selection in levels gives up: no falling error, or too many rows chosen.

    The other ends of a selection (tolerance, number of nodes, a singular system) are in
    `slideviz.rbf.greedy.GreedyFit`.
    """

    def __init__(self, error: float, budget: float) -> None:
        self.budget = budget  # how many rows all levels together may choose
        self._lowest = error
        self._losses = 0
        self._spent = 0.0

    def ends(self, error: float, cost: float) -> bool:
        """Tell, after one more level, whether the next one should be the last.

        It should where the error did not fall `LOSSES` times in a row, or where more rows were
        chosen than ``budget``.
        ``error``: the largest error after this level, in the mesh's length unit.
        ``cost``: how many rows it chose.
        """
        fell = error < FALL * self._lowest
        self._lowest = error if fell else self._lowest
        self._losses = 0 if fell else self._losses + 1
        self._spent += cost
        return self._losses >= LOSSES or self._spent > self.budget


@record
class Candidates:
    """The nodes that may be chosen, with their constraint rows; rows of one node are neighbours."""

    rows: ConstraintRows  # sorted by position, so that the numbering of the mesh changes no choice
    block: IntArray  # (r,): the block of the system that each row is in
    candidate: IntArray  # (r,): the candidate, from 0 to c - 1, that each row belongs to
    first: IntArray  # (c,): the first row of each candidate
    tie_breaker: FloatArray
    """(c,): factor of each candidate's error, which decides between equal errors
    (`level.tie_breaker`)."""

    @classmethod
    def of(cls, problem: Problem, rows: ConstraintRows) -> Candidates:
        """Return the candidates of ``rows``, which must be sorted by position."""
        new = run_begins(rows.nodes)
        first = np.flatnonzero(new)
        ranked = tie_breaker(value(problem.coords)[rows.nodes[first]])
        return cls(rows, blocks(rows), np.cumsum(new) - 1, first, ranked)

    def with_rows(self, problem: Problem, more: ConstraintRows) -> Candidates:
        """Return these candidates followed by those of ``more``; rows keep their numbers."""
        rows = self.rows.followed_by(more) if len(self.rows.nodes) else more
        return self.of(problem, rows)

    def values(self, problem: Problem, sum_: Interpolant) -> FloatArray:
        """Return the left-hand side of each row, (r, m), for the interpolant ``sum_``."""
        rows = self.rows
        s = value(sum_.at(problem, rows.nodes[self.first]))[self.candidate]
        return s if rows.directions is None else row_dots(s, rows.directions)[:, None]

    def errors(self, residual: FloatArray) -> FloatArray:
        """Return the error of each candidate: the length of its residual (r, m), (c,)."""
        squares = row_dots(residual, residual)
        return np.sqrt(np.add.reduceat(squares, self.first)) if len(squares) else squares

    def has_row(self, which: BoolArray) -> BoolArray:
        """Return a mask (c,) of the candidates that have a row in the mask ``which`` (r,)."""
        return mask_of(len(self.first), self.candidate[which])


class GrowingFactor:
    """The Cholesky factor L of one block of the system, L L^T = G, to which rows are appended.

    ``rows``, ``turn`` (k,): the chosen rows, as indices of the candidates' rows, and the place of
    each in the order of choice over all blocks. ``lower`` (k, k): L.
    """

    def __init__(self, width: int) -> None:
        self.rows = self.turn = NO_NODES
        self.lower = self._store = np.empty((0, 0))
        self.forward = np.empty((0, width))
        """(k, m): L^-1 b; shorter than L between `append` and `follow`."""

    def append(
        self, rows: IntArray, turn: IntArray, *, beside: FloatArray, corner: FloatArray
    ) -> None:
        """Append p rows to the factor: L21 is ``beside`` (p, k), L22 is ``corner`` (p, p)."""
        n = len(self.rows)
        more = len(rows)
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

    def weights(self, tail: FloatArray | None = None) -> FloatArray:
        """Return the weights (k, m) that solve G w = b, or b - P c for a polynomial's c (q, m).

        The target that ``forward`` follows is then b beside P.
        """
        forward = self.forward
        if tail is not None:
            forward = forward[:, : -len(tail)] - forward[:, -len(tail) :] @ tail
        return solve_lower(self.lower, forward, transposed=True)


class GreedyLevel:
    """The interpolant of one level, and the rows chosen for it so far.

    ``previous_levels`` and ``increment``: the sum of the levels before, and what this level adds to
    it. ``singular``: the system with a polynomial has no solution.
    """

    def __init__(
        self, problem: Problem, candidates: Candidates, previous_levels: Interpolant
    ) -> None:
        """Begin without rows, after levels whose sum is ``previous_levels``."""
        self._problem = problem
        self._among = candidates
        self.previous_levels = previous_levels
        # Only positive definite functions have pivots. For the others the default one tells
        # which nodes add most, and the weights come from the system with the polynomial.
        self._saddle = problem.basis.saddle
        self.singular = False
        self._basis = replace(problem.basis, kernel=PLAIN) if self._saddle else problem.basis
        self._terms = self._terms_of(candidates)
        self.increment = Interpolant(NO_NODES, np.empty((0, problem.dim)))
        self.chosen: IntArray = NO_NODES
        """(k,): the chosen rows, in the order of their choice."""
        self.excluded = np.zeros(len(candidates.rows.nodes), bool)
        """(r,): rows that cannot be chosen any more: they are, or would make the system
        singular."""
        count = int(candidates.block.max(initial=0)) + 1
        width = candidates.rows.data.shape[1] + self._terms.shape[1]
        self._grown = [GrowingFactor(width) for _ in range(count)]

    @property
    def interpolant(self) -> Interpolant:
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
        self.excluded = np.concatenate([self.excluded, more])
        self._among = candidates
        self._terms = self._terms_of(candidates)

    def targets(self) -> FloatArray:
        """Return the residual that this level interpolates, (r, m): data less former levels."""
        right = self._among.rows.data
        if not len(self.previous_levels.nodes):
            return right
        return right - self._among.values(self._problem, self.previous_levels)

    def _terms_of(self, candidates: Candidates) -> FloatArray:
        """Return the polynomial's terms in each row, (r, q); q = 0 where `solve` needs none."""
        if self._problem.basis.polynomial:
            return row_terms(self._problem, candidates.rows)
        return np.empty((len(candidates.rows.nodes), 0))

    def _followed(self, factor: GrowingFactor, target: FloatArray) -> None:
        """Bring ``factor.forward`` up to date, for the target (r, m) and the polynomial's terms."""
        factor.follow(np.c_[target, self._terms] if self._terms.size else target)

    def _rows(self, target: FloatArray) -> ConstraintRows:
        """Return the chosen rows, with their data from the target (r, m)."""
        all_ = self._among.rows
        chosen = self.chosen
        normals = None if all_.directions is None else all_.directions[chosen]
        return ConstraintRows(all_.nodes[chosen], normals, target[chosen])

    def solve(self, target: FloatArray) -> None:
        """Make ``increment`` meet the target (r, m) in the chosen rows."""
        rows = self._rows(target)
        if self._saddle:
            found, self.singular = saddle_fit(self._problem, rows)
        else:
            weights = np.empty_like(rows.data)
            tail = None
            if self._terms.size:
                forward = np.concatenate([factor.forward for factor in self._grown])
                chosen = np.concatenate([factor.rows for factor in self._grown])
                across, along = np.hsplit(forward, [rows.data.shape[1]])
                tail = polynomial(self._terms[chosen], along, across)
            for factor in self._grown:
                weights[factor.turn] = factor.weights(tail)
            found = gathered(rows, weights, with_components(tail, self._problem))
        self.increment = replace(found, levels=(row_keys(self._among.rows)[self.chosen],))

    def pick(
        self, rows: IntArray, residual: FloatArray, *, count: int, floor: float, target: FloatArray
    ) -> bool:
        """Run the Newton greedy on a pool's rows and append what it picks to the factors.

        Returns whether any was picked. ``increment`` is not solved for yet: call `solve`.
        ``rows`` (p,), ``residual`` (p, m): the rows of the pool, and what the interpolant still
        lacks in each.
        ``count`` and ``floor``: how many nodes to pick at most, and the error below which to stop
        (the first is always picked).
        ``target`` (r, m): what the level has to meet, in all rows of the candidates.
        """
        among = self._among
        order = np.argsort(among.block[rows], kind="stable")
        rows = rows[order]
        residual = residual[order]
        parts = [rows[among.block[rows] == b] for b in range(len(self._grown))]
        left = []
        schur = []
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
        turn = len(self.chosen) + np.arange(len(picked))
        start = 0
        for k, factor in enumerate(self._grown):
            mine = (picked >= start) & (picked < start + len(parts[k]))
            at = picked[mine] - start
            factor.append(parts[k][at], turn[mine], beside=left[k][:, at].T, corner=bases[k][at])
            self._followed(factor, target)
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
                turn = len(self.chosen) + np.arange(len(made.retained))
                factor.append(
                    part[made.retained], turn, beside=left[:, made.retained].T, corner=made.lower
                )
                self._followed(factor, target)
                self.chosen = np.concatenate([self.chosen, part[made.retained]])
            self.excluded[rows] = True
            self.solve(target)

    def _remaining(self, factor: GrowingFactor, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return L^-1 G of p rows of the factor's block, (k, p), and their Schur complement."""
        nodes = self._among.rows.nodes
        normals = self._among.rows.directions

        def place(index: IntArray) -> Rows:
            features = self._problem.place(nodes[index])
            return features, None if normals is None else normals[index]

        schur = matrix(self._basis, place(rows))
        if not len(factor.rows):
            return np.empty((0, len(rows))), schur
        left = solve_lower(factor.lower, matrix(self._basis, place(factor.rows), place(rows)))
        return left, schur - left.T @ left

    def condition(self) -> float:
        """Return an estimate of the condition number of the system of all blocks."""
        if self._saddle:
            return condition_with_terms(self._problem, self._rows(self._among.rows.data))
        factors = [factor.lower for factor in self._grown]
        with enough_threads(20.0 * max(len(lower) for lower in factors) ** 2):
            return condition(*factors)
