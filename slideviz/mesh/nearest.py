"""Nearest points, found by a sort along one direction where that is enough, else by a tree.

All points are projected onto the direction ``OBLIQUE``. Points near each other have projections
near each other; so where few projections are, few distances need be computed.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray, largest_size, ranges
from slideviz.system.threads import cores


def sorted_in_rows(table: IntArray) -> IntArray:
    """Return a table (r, k) with sorted rows; ten times as fast as `numpy.sort` for few columns."""
    columns = list(table.T)
    for last in range(len(columns) - 1, 0, -1):
        for k in range(last):
            one, two = columns[k : k + 2]
            columns[k : k + 2] = np.minimum(one, two), np.maximum(one, two)
    return np.stack(columns, axis=1)


def row_groups(table: IntArray) -> IntArray:
    """Return a number for each row, (r,), that equal rows share.

    It is 0 for the lowest row in lexicographic order, 1 for the next other one, and so on: the
    inverse of ``numpy.unique(table, axis=0)``. ``table`` (r, k): indices, not negative, below 3e9.
    """
    table = np.asarray(table, np.int64)
    if not table.size:
        return np.zeros(len(table), np.int64)
    above = int(table.max()) + 1
    # Two columns in one number halve the work.
    keys = [
        table[:, at] * above + table[:, at + 1] if at + 1 < table.shape[1] else table[:, at]
        for at in range(0, table.shape[1], 2)
    ]
    order = np.lexsort(keys[::-1])
    new = np.zeros(len(table), bool)
    for key in keys:
        in_order = key[order]
        new[1:] |= in_order[1:] != in_order[:-1]
    groups = np.empty(len(table), np.int64)
    groups[order] = np.cumsum(new)
    return groups


OBLIQUE = np.array([1.0, 0.6180339887, 0.4142135624])
"""A direction of no symmetry: points of a mesh seldom have the same projection onto it."""
CROWDED = 16  # candidates for each point, on average, above which a tree is faster


def nearest(
    points: FloatArray, at: FloatArray, bound: float, likely: float
) -> tuple[FloatArray, IntArray]:
    """Return distance (m,) and index (m,) of the point nearest to each place, as SciPy's cKDTree.

    ``points``, ``at`` (n, d), (m, d): the points, and the places that a point is looked for at.
    ``bound``: largest distance that is looked for. Where no point is nearer, the distance is
    infinite and the index n.
    ``likely``: a distance within which each place probably has exactly one point: then no tree is
    built. The result does not depend on it.
    """
    match = _alone(points, at, min(bound, likely))
    if match is not None and (bound <= likely or np.isfinite(match[0]).all()):
        return match
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    distance, number = cKDTree(points).query(at, distance_upper_bound=bound, workers=cores())
    return np.asarray(distance), np.asarray(number)


def near_duplicates(points: FloatArray, apart: float) -> IntArray:
    """Return ascending indices (k,) of points that may have another within ``apart``.

    No other point has one. They are candidates for an exact search; most meshes have none.
    """
    seen = points @ OBLIQUE[: points.shape[1]]
    order = np.argsort(seen)
    near = np.diff(seen[order]) <= _margin(seen, apart)
    return np.unique(np.concatenate([order[:-1][near], order[1:][near]]))


def _margin(seen: FloatArray, apart: float) -> float:
    """Return the largest difference of the projections ``seen`` of points within ``apart``.

    The length of ``OBLIQUE`` and rounding are included.
    """
    return 2.0 * apart + 1e-14 * largest_size(seen)


def _alone(points: FloatArray, at: FloatArray, reach: float) -> tuple[FloatArray, IntArray] | None:
    """Return the result of `nearest` with ``bound=reach``, or None if it needs a search tree.

    It needs one if a query has two points within reach, or if there are too many candidates.
    """
    seen = points @ OBLIQUE[: points.shape[1]]
    from_here = at @ OBLIQUE[: at.shape[1]]
    margin = max(_margin(seen, reach), _margin(from_here, reach))
    order = np.argsort(seen)
    first = np.searchsorted(seen[order], from_here - margin, "left")
    last = np.searchsorted(seen[order], from_here + margin, "right")
    count = last - first
    if count.sum() > CROWDED * (len(points) + len(at)):
        return None
    row = np.repeat(np.arange(len(at)), count)
    number = order[ranges(first, count)]
    gap = (at[row] - points[number]) ** 2
    square = sum(gap.T[1:], gap.T[0])
    within = square < reach * reach
    row = row[within]
    if (row[1:] == row[:-1]).any():
        return None
    distance = np.full(len(at), np.inf)
    which = np.full(len(at), len(points))
    distance[row] = np.sqrt(square[within])
    which[row] = number[within]
    return distance, which
