"""Edge lengths of the triangles in the sample ``turbine-row``, and triangles of such points.

    h(x) = h0 (1 + (m - 1) (1 - exp(-k D / (m - 1))))

D is the distance from the layer around the vane or from the wake, whose own D grows slowly
downstream; m is what far triangles measure over those at the layer. The neighbouring vanes count
alike, so that the periodic sides get the same nodes. The triangles between given points are
Delaunay's, relaxed towards equilateral ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import Delaunay, cKDTree

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.samples.vane import AHEAD, CHORD, LENGTH, camber, camber_line, pitch

ROUNDS, SWEEPS = 8, 6
"""Triangulations anew while relaxing, and moves of all points within each."""

SLOPE = 350.0
"""k, per unit of length."""
WAKE = 0.3
"""D on the wake over the way from the trailing edge."""
SHAPE = (150, 250)
"""Grid points in x and y of a tabulated size."""


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


@dataclass(frozen=True, eq=False)
class Sizing:
    """Edge length tabulated over the rectangle around the channel.

    Attributes
    ----------
    low, step : (2,)
        First grid point, and distance of grid points in x and y.
    table : (nx, ny)
        Edge length at the grid points.
    """

    low: FloatArray
    step: FloatArray
    table: FloatArray

    def at(self, points: FloatArray) -> FloatArray:
        """Return the edge length at points (k, 2), bilinear between grid points: (k,)."""
        place = (points - self.low) / self.step
        found: FloatArray = map_coordinates(self.table, place.T, order=1, mode="nearest")
        return found


def find_sizing(rim: FloatArray, triangles: float) -> Sizing:
    """Return the edge lengths that need about so many triangles.

    Parameters
    ----------
    rim : (k, 2)
        The outermost nodes of the layer, in order.
    triangles : float
        How many equilateral ones are to fill the channel outside the layer.
    """
    shortest = float(np.mean(np.hypot(*(np.roll(rim, -1, axis=0) - rim).T)))
    x = np.linspace(-AHEAD, LENGTH - AHEAD, SHAPE[0])
    below, above = camber(x).min() - pitch() / 2, camber(x).max() + pitch() / 2
    y = np.linspace(below, above, SHAPE[1])
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)
    far = _distance(grid.reshape(-1, 2), rim).reshape(SHAPE)
    loop = np.arange(len(rim))
    around = inside(grid.reshape(-1, 2), rim, np.column_stack([loop, np.roll(loop, -1)]))
    channel = np.abs(grid[..., 1] - camber(x)[:, None]) < pitch() / 2
    free = channel & ~around.reshape(SHAPE)
    area = pitch() * LENGTH * np.count_nonzero(free) / np.count_nonzero(channel)
    # The least m has the most triangles, and 0.3 leaves room for coarse meshes with few layers.
    low, high = 0.3, 60.0
    for _ in range(50):
        middle = (low + high) / 2
        h = shortest * _growth(far[free], middle)
        count = 4 / np.sqrt(3) * area * np.mean(1 / h**2)
        low, high = (middle, high) if count > triangles else (low, middle)
    step = np.array([x[1] - x[0], y[1] - y[0]])
    return Sizing(np.array([x[0], y[0]]), step, shortest * _growth(far, high))


def _growth(far: FloatArray, most: float) -> FloatArray:
    """Return h / h0 at the distances ``far``."""
    span = most - 1
    if abs(span) < 1e-9:
        return np.ones_like(far)
    return 1 + span * -np.expm1(-SLOPE * far / abs(span))


def _distance(points: FloatArray, rim: FloatArray) -> FloatArray:
    """Return D of points (k, 2): 0 on the rim and inside of it (k,)."""
    best = np.full(len(points), np.inf)
    s, *line = camber_line()
    wake = s > CHORD
    way = s[wake] - CHORD
    spine = np.column_stack([values[wake] for values in line[:2]])
    tree, wake_tree = cKDTree(rim), cKDTree(spine)
    nearest = np.round((points[:, 1] - camber(points[:, 0])) / pitch())
    for k in (-1, 0, 1):
        here = np.column_stack([points[:, 0], points[:, 1] - (nearest + k) * pitch()])
        near, at = wake_tree.query(here)
        best = np.minimum(best, np.minimum(tree.query(here)[0], near + WAKE * way[at]))
    return best
