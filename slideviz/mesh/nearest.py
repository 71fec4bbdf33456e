"""The nearest of some points, found without a search tree where no two are in question."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.threads import cores

OBLIQUE = np.array([1.0, 0.6180339887, 0.4142135624])
"""A direction of no symmetry: points of a mesh seldom look in one place along it."""
CROWDED = 16
"""Points that look near each, on average, from which a tree is faster."""


def nearest(
    points: FloatArray, at: FloatArray, bound: float, likely: float
) -> tuple[FloatArray, IntArray]:
    """Return the distance (m,) of the nearest point and its number (m,), as SciPy's cKDTree does.

    Parameters
    ----------
    points, at : (n, d), (m, d)
        The points, and where they are looked for.
    bound : float
        Only nearer ones are found; for others the distance is infinite and the number n.
    likely : float
        Where one is probably nearer than this, and alone. Otherwise it takes longer.
    """
    found = _alone(points, at, min(bound, likely))
    if found is not None and (bound <= likely or np.isfinite(found[0]).all()):
        return found
    from scipy.spatial import cKDTree  # takes long to load

    distance, number = cKDTree(points).query(at, distance_upper_bound=bound, workers=cores())
    return np.asarray(distance), np.asarray(number)


def crowded(points: FloatArray, apart: float) -> IntArray:
    """Return the points, by numbers (k,), that may have another nearer than ``apart``; few others.

    Of most meshes none is left for a slower search.
    """
    seen = points @ OBLIQUE[: points.shape[1]]
    order = np.argsort(seen)
    near = np.diff(seen[order]) <= _margin(seen, apart)
    return np.unique(np.concatenate([order[:-1][near], order[1:][near]]))


def _margin(seen: FloatArray, apart: float) -> float:
    """Return how far apart points look at most that are so near, rounding included."""
    return 2.0 * apart + 1e-14 * float(np.abs(seen).max(initial=0.0))


def _alone(points: FloatArray, at: FloatArray, reach: float) -> tuple[FloatArray, IntArray] | None:
    """Return what `nearest` does where no place has two points within reach, else None."""
    seen, from_here = (x @ OBLIQUE[: x.shape[1]] for x in (points, at))
    margin = max(_margin(seen, reach), _margin(from_here, reach))
    order = np.argsort(seen)
    first = np.searchsorted(seen[order], from_here - margin, "left")
    last = np.searchsorted(seen[order], from_here + margin, "right")
    count = last - first
    if count.sum() > CROWDED * (len(points) + len(at)):
        return None
    row = np.repeat(np.arange(len(at)), count)
    number = order[np.arange(len(row)) + np.repeat(first - np.cumsum(count) + count, count)]
    gap = (at[row] - points[number]) ** 2
    square = sum(gap.T[1:], gap.T[0])
    row, number, square = (x[square < reach * reach] for x in (row, number, square))
    if (row[1:] == row[:-1]).any():
        return None
    distance, which = np.full(len(at), np.inf), np.full(len(at), len(points))
    distance[row], which[row] = np.sqrt(square), number
    return distance, which
