"""A tree of bounding boxes, searched for many queries at once with array operations.

Facets of one mesh differ in size by factors of a million, so that a search by distance between
their centres finds far too many; boxes adapt to each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from slideviz.mesh.model import FloatArray, IntArray

LEAF = 4
"""Most items under the last boxes of the tree."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A complete binary tree over boxes.

    Attributes
    ----------
    order : (s,) int64
        The items as the leaves hold them, filled up with -1.
    levels : tuple of ((k, d), (k, d))
        Low and high corners of the boxes, from the root (k = 1) to the items (k = s).
    """

    order: IntArray
    levels: tuple[tuple[FloatArray, FloatArray], ...]

    @classmethod
    def of(cls, low: FloatArray, high: FloatArray) -> BoxTree:
        """Return the tree over n ≥ 1 boxes with corners ``low``, ``high`` (n, d)."""
        n, d = low.shape
        depth = max(0, int(np.ceil(np.log2(n / LEAF))))
        order = np.concatenate((np.arange(n), np.full((LEAF << depth) - n, -1)))
        centre = 0.5 * (low + high)
        for level in range(depth):
            # Each block is cut in two at the median of its longest axis.
            block = order.reshape(1 << level, -1)
            at = centre[block]
            axis = np.ptp(at, axis=1).argmax(axis=1)
            along = np.take_along_axis(at, axis[:, None, None], axis=2)[..., 0]
            order = np.take_along_axis(block, along.argsort(axis=1, kind="stable"), axis=1).ravel()
        filler = (order < 0)[:, None]
        levels = [(np.where(filler, np.inf, low[order]), np.where(filler, -np.inf, high[order]))]
        for size in [LEAF] + depth * [2]:
            below, above = levels[0]
            levels.insert(
                0, (below.reshape(-1, size, d).min(axis=1), above.reshape(-1, size, d).max(axis=1))
            )
        return cls(order, tuple(levels))

    def near(
        self, corners: FloatArray, axes: FloatArray, margin: float
    ) -> tuple[IntArray, IntArray]:
        """Return pairs (p,), (p,) of a query and an item that its box, and it, may touch.

        Parameters
        ----------
        corners : (q, k, d)
            Points whose convex hull is the query.
        axes : (q, c, d)
            Unit vectors in whose direction a query has no width: a box off the plane through
            its first corner is not near. This spares large queries that are oblique to the
            coordinate axes most of the search.
        margin : float
            What is as far off as this is near.
        """
        low, high = corners.min(axis=1) - margin, corners.max(axis=1) + margin
        query, node = np.arange(len(low)), np.zeros(len(low), np.int64)
        for depth, (below, above) in enumerate(self.levels):
            if depth:
                size = len(below) // len(self.levels[depth - 1][0])
                query = np.repeat(query, size)
                node = (node[:, None] * size + np.arange(size)).ravel()
            meets = (low[query] <= above[node]) & (high[query] >= below[node])
            query, node = query[meets.all(axis=1)], node[meets.all(axis=1)]
            middle = 0.5 * (above[node] + below[node])
            half = 0.5 * (above[node] - below[node])
            offset = np.einsum("pcd,pd->pc", axes[query], middle - corners[query, 0])
            reach = np.einsum("pcd,pd->pc", np.abs(axes[query]), half) + margin
            meets = ~(np.abs(offset) > reach)
            query, node = query[meets.all(axis=1)], node[meets.all(axis=1)]
        return query, self.order[node]
