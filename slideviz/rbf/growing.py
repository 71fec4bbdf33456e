"""Cholesky factors that grow by the rows that a greedy picks, one for each block of the system."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.solve import PIVOT_GUARD, solve_lower


class Growing:
    """The factor L of one block, L L^T = G, and ``half`` = L^-1 b.

    Attributes
    ----------
    rows : (k,) int64
        The chosen rows of the problem.
    turn : (k,) int64
        When each was chosen, counted over all blocks.
    lower : (k, k) float64
    half : (k, m) float64
    """

    def __init__(self, width: int) -> None:
        self.rows = self.turn = np.empty(0, np.int64)
        self.lower = self._store = np.empty((0, 0))
        self.half = np.empty((0, width))

    def append(self, rows: IntArray, turn: IntArray, parts: tuple[FloatArray, FloatArray]) -> None:
        """Append the rows (L21, L22) of ``parts`` to the factor."""
        beside, corner = parts
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
        """Bring ``half`` up to date with the rows appended; ``target`` (r, m) is b."""
        n = len(self.half)
        rest = target[self.rows[n:]] - self.lower[n:, :n] @ self.half
        self.half = np.concatenate([self.half, solve_lower(self.lower[n:, n:], rest)])

    def weights(self) -> FloatArray:
        """Return the weights (k, m) that solve G w = b."""
        return solve_lower(self.lower, self.half, transposed=True)


def newton(
    schur: list[FloatArray],
    residual: FloatArray,
    named: tuple[IntArray, FloatArray],
    limits: tuple[int, float],
) -> tuple[IntArray, list[FloatArray]]:
    """Return the rows picked by the one-node Newton greedy, and the Newton basis of each block.

    Parameters
    ----------
    schur : list of (p_k, p_k)
        What remains of the pool's matrix after the nodes chosen before, block after block.
    residual : (p, m)
        Of all rows of the pool, those of a block together, p the sum of all p_k.
    named
        The node of each row, (p,); all rows of a node are picked together. And the factor of
        its error, (p,), that decides between equal ones (``pool.favour``).
    limits
        Number of nodes, and the error below which to stop (the first is always taken).

    Returns
    -------
    picked : (q,) int64
        In the order of choice.
    basis : list of (p_k, p_k)
        A column for each picked row of the block, in that order; the rest is zero.
    """
    count, floor = limits
    stops = np.cumsum([len(s) for s in schur])
    block = np.repeat(np.arange(len(schur)), [len(s) for s in schur])
    pivot = np.concatenate([np.diag(s) for s in schur])
    rest = residual.copy()
    basis = [np.zeros((len(s), min(len(s), count * 3))) for s in schur]
    used = [0] * len(schur)
    open_ = pivot > PIVOT_GUARD
    picked: list[int] = []
    names, first, group = np.unique(named[0], return_index=True, return_inverse=True)
    favoured = named[1][first]
    for turn in range(count):
        squares = np.where(open_, np.einsum("pm,pm->p", rest, rest), 0.0)
        error = np.sqrt(np.bincount(group, squares, len(names)))
        best = int(np.argmax(error * favoured))
        if error[best] <= 0 or (turn and error[best] < floor):
            break
        for row in np.flatnonzero((group == best) & open_):
            if pivot[row] <= PIVOT_GUARD:
                continue
            b = block[row]
            here = slice(stops[b] - len(schur[b]), stops[b])
            k, local = used[b], row - here.start
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
