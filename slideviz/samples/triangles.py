"""Triangles between given points, and their relaxation towards equilateral ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from slideviz.mesh.model import FloatArray, IntArray

ROUNDS, SWEEPS = 8, 6
"""Triangulations anew while relaxing, and moves of all points within each."""


def triangulate(points: FloatArray, edges: IntArray) -> IntArray:
    """Return the Delaunay triangles (m, 3), counter-clockwise, left of the boundary's edges.

    Parameters
    ----------
    points : (n, 2)
        Those of the boundary and those inside.
    edges : (e, 2)
        The boundary, closed, with the domain on its left.
    """
    found = Delaunay(points).simplices.astype(np.int64)
    at = points[found]
    (ax, ay), (bx, by) = (at[:, 1] - at[:, 0]).T, (at[:, 2] - at[:, 0]).T
    found[ax * by < ay * bx] = found[ax * by < ay * bx][:, ::-1]
    rim = np.zeros(len(points), bool)
    rim[edges] = True
    # A triangle with a node inside is inside; the others are few.
    doubtful = np.flatnonzero(rim[found].all(axis=1))
    outside = ~inside(points[found[doubtful]].mean(axis=1), points, edges)
    return np.delete(found, doubtful[outside], axis=0)


def relax(points: FloatArray, fixed: int, edges: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the points with all after the first ``fixed`` moved, and their triangles.

    A point moves to the mean of its triangles' centroids, weighted by the square root of the area:
    between Laplacian smoothing, which ignores the size, and centroidal patches, which
    make all areas alike.
    """
    for _ in range(ROUNDS):
        triangles = triangulate(points, edges)
        for _ in range(SWEEPS):
            points = _sweep(points, triangles, fixed)
    return points, triangulate(points, edges)


def _sweep(points: FloatArray, triangles: IntArray, fixed: int) -> FloatArray:
    at = points[triangles]
    (ax, ay), (bx, by) = (at[:, 1] - at[:, 0]).T, (at[:, 2] - at[:, 0]).T
    weight = np.sqrt(np.abs(ax * by - ay * bx))
    total = np.bincount(triangles.ravel(), np.repeat(weight, 3), len(points))
    moved = points.copy()
    for k, centre in enumerate(at.mean(axis=1).T):
        pull = np.bincount(triangles.ravel(), np.repeat(weight * centre, 3), len(points))
        moved[fixed:, k] = pull[fixed:] / total[fixed:]
    return moved


def inside(places: FloatArray, points: FloatArray, edges: IntArray) -> NDArray[np.bool_]:
    """Tell which places (k, 2) the edges go round an odd number of times: (k,)."""
    odd = np.zeros(len(places), bool)
    (x0, y0), (x1, y1) = points[edges[:, 0]].T, points[edges[:, 1]].T
    order = np.argsort(places[:, 1], kind="stable")
    heights = places[order, 1]
    first = np.searchsorted(heights, np.minimum(y0, y1), side="left")
    last = np.searchsorted(heights, np.maximum(y0, y1), side="left")
    for e in np.flatnonzero(last > first):
        here = order[first[e] : last[e]]
        cut = x0[e] + (places[here, 1] - y0[e]) / (y1[e] - y0[e]) * (x1[e] - x0[e])
        odd[here] ^= places[here, 0] < cut
    return odd
