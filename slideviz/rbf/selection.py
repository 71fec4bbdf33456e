"""Parts of the greedy selection: its pool of candidates, and picking in the pool.

`pool` says which candidates a cycle looks at and how many of them it picks, `newton` picks them,
and `LevelLimit` ends levels that lower no error.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.problem import GreedySettings
from slideviz.rbf.solve import PIVOT_GUARD

POOL = 768
"""Largest number of rows in the pool of a block."""

POOL_START = 192
"""Number of candidates in the first pools, at least."""

POOL_SHARE = 6
"""Candidates in the pool for each node to pick: as good, measured by the number of control nodes,
as the largest pool from the start, and cheaper."""

BLOCK_LIMIT = 128
"""Largest number of nodes picked in a cycle."""

TIE = 1e-4
"""Errors with a smaller relative difference may count as equal: far above their rounding, far
below what matters for the choice. `tie_breaker` decides between them."""

FALL = 0.9
"""An error has fallen when it is below this part of the lowest one before."""

LOSSES = 8
"""Number of levels in a row without a fall of the error that end a selection in levels."""


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

    Parameters
    ----------
    schur : list of (p_k, p_k)
        What remains of the pool's matrix after the nodes chosen before, block after block.
    residual : (p, m)
        Of all rows of the pool, those of a block together, p the sum of all p_k.
    nodes, factor : (p,), (p,)
        The node of each row (all rows of a node are picked together), and the node's factor
        (`tie_breaker`), with which its error is multiplied to decide between equal errors.
    count, floor
        Number of nodes, and the error below which to stop (the first is always taken).

    Returns
    -------
    picked : (q,) int64
        Places of rows among the p, in the order of choice.
    basis : list of (p_k, q_k)
        A column for each picked row of the block, in the same order.
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


def tie_breaker(coords: FloatArray) -> FloatArray:
    """Return a factor for the error of each candidate, (c,), that decides between equal errors.

    It grows from 1 to 1 + TIE along a direction that no symmetry of a mesh is likely to have: no
    sum of whole multiples of its components is zero, so no two points of a grid get the same.

    Parameters
    ----------
    coords : (c, d)
        Positions of the candidates in the frame.
    """
    if not len(coords):
        return np.empty(0)
    along = coords @ np.array([1.0, 0.6180339887, 0.4142135624])[: coords.shape[1]]
    low, high = along.min(), along.max()
    return 1.0 + TIE * (along - low) / max(high - low, 1e-300)


def pool(
    errors: FloatArray,
    vectors: FloatArray,
    settings: GreedySettings,
    *,
    chosen: int,
    chosen_in_level: int,
    per_node: int,
) -> tuple[int, IntArray]:
    """Return how many nodes to pick, and the candidates (k,) to pick them from.

    0 and none where no error is above the tolerance.

    Parameters
    ----------
    errors : (c,)
        Of each candidate, times its ``tie_breaker``; negative where it cannot be picked.
    vectors : (c, d)
        The errors as vectors in the frame.
    chosen, chosen_in_level
        Nodes picked so far: in all levels, and in this one.
    per_node
        Rows of a candidate, on average.
    """
    eligible = np.count_nonzero(errors > settings.tolerance)
    if not eligible:
        return 0, np.empty(0, np.int64)
    worst = int(np.argmax(errors))
    if settings.pick == "one":
        return 1, np.array([worst])
    if settings.pick == "double":
        return _double(errors, vectors, worst, settings.tolerance)
    count = int(np.clip(chosen // 4, 4, BLOCK_LIMIT))
    size = min(eligible, POOL // per_node, max(POOL_START, POOL_SHARE * count))
    order = np.argsort(-errors, kind="stable")[:size]
    if settings.level == "size":
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
    lengths = np.linalg.norm(vectors, axis=1)
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
        self.budget = budget
        """How many rows all levels together may choose."""
        self._lowest, self._losses, self._spent = error, 0, 0.0

    def ends(self, error: float, cost: float) -> bool:
        """Tell, after one more level, whether the next one should be the last.

        It should where the error did not fall `LOSSES` times in a row, or where more rows were
        chosen than ``budget``.

        Parameters
        ----------
        error : float
            The largest error after this level, in the mesh's length unit.
        cost : float
            How many rows it chose.
        """
        fell = error < FALL * self._lowest
        self._lowest = error if fell else self._lowest
        self._losses = 0 if fell else self._losses + 1
        self._spent += cost
        return self._losses >= LOSSES or self._spent > self.budget
