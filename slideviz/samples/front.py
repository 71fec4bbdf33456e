"""Points for triangles: an advancing front of nearly equilateral triangles of graded size.

Every accepted point proposes the corners of a hexagon around it, and then those of a second one
turned by 30 degrees; a proposal is accepted when no point is too near. The hexagon is turned to
the point's parent, so that rows of triangles run along the boundary they started from. The
idea is that of J. Slak and G. Kosec, "On generation of node distributions for meshless PDE
discretizations", SIAM J. Sci. Comput. 41, 2019.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.caching import njit
from slideviz.samples.sizing import Sizing

NEAREST = 0.78
"""Least distance of two points over the edge length wanted there."""
_TURNS = np.radians([0.0, 60.0, -60.0, 120.0, -120.0, 180.0, 30.0, -30.0, 90.0, -90.0, 150.0])


def front_points(
    fixed: FloatArray, edges: IntArray, sizing: Sizing, triangles: float
) -> FloatArray:
    """Return points (k, 2) that fill a domain, those of its boundary left out.

    Parameters
    ----------
    fixed : (n, 2)
        Nodes of the boundary, as far apart as ``sizing`` wants.
    edges : (e, 2)
        Its edges, with the domain on their left.
    sizing : Sizing
        The edge length, over a rectangle that the domain does not leave.
    triangles : float
        About how many equilateral ones of that size the domain holds.
    """
    first, second = fixed[edges[:, 0]], fixed[edges[:, 1]]
    along = second - first
    inward = np.column_stack([-along[:, 1], along[:, 0]])
    apexes = (first + second) / 2 + np.sqrt(3) / 2 * inward
    angles = np.arctan2(inward[:, 1], inward[:, 0])
    # Room for as many as fit when all are at the least distance, at two triangles to a point.
    most = int(triangles / (2 * NEAREST**2)) + len(fixed)
    starts = np.column_stack([apexes, angles])
    return _fill(fixed, starts, (sizing.low, sizing.step, sizing.table), most, _TURNS)


@njit(nogil=True, cache=True, error_model="numpy")
def _size_at(x, y, low, step, table):  # type: ignore[no-untyped-def]
    """Return the edge length, or -1 outside the rectangle."""
    px, py = (x - low[0]) / step[0], (y - low[1]) / step[1]
    if px < 0 or py < 0 or px > table.shape[0] - 1 or py > table.shape[1] - 1:
        return -1.0
    i, j = min(int(px), table.shape[0] - 2), min(int(py), table.shape[1] - 2)
    u, v = px - i, py - j
    left = (1 - v) * table[i, j] + v * table[i, j + 1]
    right = (1 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return (1 - u) * left + u * right


@njit(nogil=True, cache=True, error_model="numpy")
def _is_free(x, y, reach, points, buckets):  # type: ignore[no-untyped-def]
    """Tell whether no point is nearer than ``reach``; ``buckets`` are chains of points."""
    heads, following, low, width = buckets
    i0, i1 = int((x - reach - low[0]) / width), int((x + reach - low[0]) / width)
    j0, j1 = int((y - reach - low[1]) / width), int((y + reach - low[1]) / width)
    for i in range(max(i0, 0), min(i1, heads.shape[0] - 1) + 1):
        for j in range(max(j0, 0), min(j1, heads.shape[1] - 1) + 1):
            k = heads[i, j]
            while k >= 0:
                if (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 < reach * reach:
                    return False
                k = following[k]
    return True


@njit(nogil=True, cache=True, error_model="numpy")
def _fill(fixed, starts, sizing, most, turns):  # type: ignore[no-untyped-def]
    """Return the accepted points (k, 2), in the order of acceptance."""
    low, step, table = sizing
    n = len(fixed)
    points, angles = np.empty((n + most, 2)), np.empty(n + most)
    width = np.median(table)
    nx, ny = int(table.shape[0] * step[0] / width) + 1, int(table.shape[1] * step[1] / width) + 1
    heads, following = np.full((nx, ny), -1), np.full(n + most, -1)
    buckets = (heads, following, low, width)
    count = 0
    for k in range(n + len(starts)):
        if k < n:
            x, y = fixed[k]
        else:
            x, y, angles[count] = starts[k - n]
            size = _size_at(x, y, low, step, table)
            if size < 0 or not _is_free(x, y, NEAREST * size, points, buckets):
                continue
        count = _add(x, y, points, count, buckets)
    at = n
    while at < count < n + most:
        reach = _size_at(points[at, 0], points[at, 1], low, step, table)
        for turn in turns:
            angle = angles[at] + turn
            x, y = points[at, 0] + reach * np.cos(angle), points[at, 1] + reach * np.sin(angle)
            size = _size_at(x, y, low, step, table)
            if size > 0 and _is_free(x, y, NEAREST * size, points, buckets) and count < n + most:
                angles[count] = angle
                count = _add(x, y, points, count, buckets)
        at += 1
    return points[n:count].copy()


@njit(nogil=True, cache=True, error_model="numpy")
def _add(x, y, points, count, buckets):  # type: ignore[no-untyped-def]
    """Put a point into its bucket, and return the number of points."""
    heads, following, low, width = buckets
    i = min(max(int((x - low[0]) / width), 0), heads.shape[0] - 1)
    j = min(max(int((y - low[1]) / width), 0), heads.shape[1] - 1)
    points[count, 0], points[count, 1] = x, y
    following[count], heads[i, j] = heads[i, j], count
    return count + 1
