"""Edge lengths of the triangles in the sample ``turbine-row``, and triangulation of its points.

    h(x) = h0 (1 + (m - 1) (1 - exp(-k D / (m - 1))))

h0 is the edge length at the layer of quadrilaterals around the vane, m the ratio of that far away
to it. D is the distance from the layer, or from the wake plus `WAKE` times the way downstream.
Neighbouring vanes count, too, so that both periodic sides get the same nodes. Triangles are
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
"""Number of triangulations in `relax`, and of moves of all points with each."""

SLOPE = 350.0
"""k in the formula, per unit of length: the slope of h / h0 at D = 0."""
WAKE = 0.3
"""D on the wake, divided by the way from the trailing edge."""
SHAPE = (150, 250)
"""Grid points in x and y of the table of edge lengths."""


def triangulate(points: FloatArray, edges: IntArray) -> IntArray:
    """Return the Delaunay triangles (m, 3) of a domain, counter-clockwise.

    Parameters
    ----------
    points : (n, 2)
        Points of the boundary and inside.
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
    """Return the relaxed points (n, 2), of which the first ``fixed`` stay, and their triangles.

    A point moves to the mean of its triangles' centroids, weighted by the square root of the area:
    a compromise between Laplacian smoothing, which ignores the size, and weights by the area,
    which make all areas equal. ``edges`` are the boundary's, as of `triangulate`.
    """
    for _ in range(ROUNDS):
        triangles = triangulate(points, edges)
        for _ in range(SWEEPS):
            points = _sweep(points, triangles, fixed)
    return points, triangulate(points, edges)


def _sweep(points: FloatArray, triangles: IntArray, fixed: int) -> FloatArray:
    """Return the points with all after the first ``fixed`` moved once, as `relax` says."""
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
    """Return a mask (k,) of the places (k, 2) inside the closed edges (e, 2) between points (n, 2).

    Inside is where the edges go round an odd number of times.
    """
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
    """Edge length tabulated over the rectangle around the channel."""

    low: FloatArray
    step: FloatArray
    """`low`, `step` (2,): first grid point, and distances of grid points in x and y."""
    table: FloatArray
    """(nx, ny): edge length at the grid points."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the edge length (k,) at points (k, 2), bilinear between grid points."""
        place = (points - self.low) / self.step
        found: FloatArray = map_coordinates(self.table, place.T, order=1, mode="nearest")
        return found


def find_sizing(rim: FloatArray, triangles: float) -> Sizing:
    """Return edge lengths with which about so many triangles fill the channel, choosing m.

    Parameters
    ----------
    rim : (k, 2)
        The outermost nodes of the layer around the vane, in order.
    triangles : float
        Number of equilateral triangles in the channel outside the layer.
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
    """Return h / h0 at distances D, ``far``, for m = ``most``."""
    span = most - 1
    if abs(span) < 1e-9:
        return np.ones_like(far)
    return 1 + span * -np.expm1(-SLOPE * far / abs(span))


def _distance(points: FloatArray, rim: FloatArray) -> FloatArray:
    """Return D (k,) of points (k, 2), from the nodes of the rim (r, 2) and the wake of any vane.

    Inside the rim it has no meaning.
    """
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
