"""Which candidates a cycle of the selection looks at, and how many of them it picks."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.problem import Reduction

POOL = 768
"""Largest number of rows in the pool of a block."""

POOL_START = 192
POOL_SHARE = 6
"""The pool begins small and has this many candidates for each node to pick: as good, measured
by the number of control nodes, and cheaper than the largest one from the start."""

BLOCK_LIMIT = 128
"""Largest number of nodes picked in a cycle."""

TIE = 1e-4
"""Errors that differ by less than this part may count as equal: far above their rounding, far
below what matters for the choice."""


def favour(coords: FloatArray) -> FloatArray:
    """Return a factor for the error of each candidate, (c,), that decides between equal ones.

    From 1 to 1 + TIE, along a direction that no symmetry of a mesh is likely to have: no sum of
    whole multiples of its components is zero, so no two points of a grid are alike.

    Parameters
    ----------
    coords : (c, d)
    """
    if not len(coords):
        return np.empty(0)
    along = coords @ np.array([1.0, 0.6180339887, 0.4142135624])[: coords.shape[1]]
    low, high = along.min(), along.max()
    return 1.0 + TIE * (along - low) / max(high - low, 1e-300)


def pool(
    errors: FloatArray,
    vectors: FloatArray,
    settings: Reduction,
    chosen: tuple[int, int],
    per_node: int,
) -> tuple[int, IntArray]:
    """Return how many nodes to pick, and the candidates to pick them from.

    Parameters
    ----------
    errors : (c,)
        Of each candidate, times its ``favour``; negative where it cannot be picked.
    vectors : (c, d)
        The errors as vectors in the frame.
    chosen
        Nodes picked so far: in all levels, and in this one.
    per_node
        Rows of a candidate.
    """
    eligible = np.count_nonzero(errors > settings.tolerance)
    if not eligible:
        return 0, np.empty(0, np.int64)
    worst = int(np.argmax(errors))
    if settings.pick == "one":
        return 1, np.array([worst])
    if settings.pick == "double":
        return _double(errors, vectors, worst, settings.tolerance)
    count = int(np.clip(chosen[0] // 4, 4, BLOCK_LIMIT))
    size = min(eligible, POOL // per_node, max(POOL_START, POOL_SHARE * count))
    order = np.argsort(-errors, kind="stable")[:size]
    if settings.level == "size":
        count = min(count, max(1, settings.level_size - chosen[1]))
    if settings.max_nodes is not None:
        count = min(count, max(1, settings.max_nodes - chosen[0]))
    return count, np.sort(order)


def _double(
    errors: FloatArray, vectors: FloatArray, worst: int, tolerance: float
) -> tuple[int, IntArray]:
    """Return the worst candidate and the worst one whose error is more than 90° from its."""
    lengths = np.linalg.norm(vectors, axis=1)
    cosine = vectors @ vectors[worst] / np.maximum(lengths * lengths[worst], 1e-300)
    # Errors along different axes are perpendicular but for rounding.
    opposite = np.where(cosine < -TIE, errors, -1.0)
    second = int(np.argmax(opposite))
    if opposite[second] <= tolerance:
        return 1, np.array([worst])
    return 2, np.sort([worst, second])
