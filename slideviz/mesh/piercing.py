"""Where the edges and nodes of one surface pass through the simplices of another."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.planes import Planes, line_normals, normals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from slideviz.mesh.model import FloatArray, IntArray
    from slideviz.mesh.simplices import Surface

CHUNK = 1024
"""Facets searched at a time, so that memory stays small and an early find ends the search."""

Hit = tuple["FloatArray", int, int]
"""A point (d,) and the two that meet there, by their numbers."""


def pierced(points: FloatArray, a: Surface, b: Surface, margin: float) -> Hit | None:
    """Return where an edge or a node of ``a`` passes through ``b``, and the facets of both.

    Two surfaces cross where an edge of one goes through a simplex of the other, so this has to
    be asked both ways.
    """
    a, b = a.within(points, b, margin), b.within(points, a, margin)
    if not (len(a) and len(b)):
        return None
    planes, touches = Planes.of(points, b, margin), []
    for part in _chunks(len(a)):
        nodes = a.nodes[part]
        corners = points[nodes]
        i, j = planes.near(corners, normals(corners)[:, None])
        ends, at = nodes[i], corners[i]
        height = planes.heights(at, j)
        touch = np.abs(height) <= margin
        for k in range(ends.shape[1]):
            touch[:, k] &= (planes.depths(at[:, k], j) >= -margin).all(axis=1)
        row, column = np.nonzero(touch)
        touches.append(np.column_stack((ends[row, column], j[row])))
        pairs = list(combinations(range(ends.shape[1]), 2))
        found = [_strike(planes, at[:, pair], height[:, pair], i, j) for pair in pairs]
        hits = [hit for hit in found if hit is not None]
        if hits:
            point, first = min(hits, key=lambda hit: hit[1])
            return point, int(a.facet[part[i[first]]]), int(b.facet[j[first]])
    return _node_through(points, a, b, planes, np.concatenate(touches))


def swept(ways: FloatArray, planes: Planes) -> Hit | None:
    """Return where the first of some lines (w, 2, d) goes through a surface, line and simplex."""
    for part in _chunks(len(ways)):
        lines = ways[part]
        i, j = planes.near(lines, line_normals(lines))
        hit = _strike(planes, lines[i], planes.heights(lines[i], j), i, j)
        if hit is not None:
            return hit[0], int(part[i[hit[1]]]), int(j[hit[1]])
    return None


def _strike(
    planes: Planes, lines: FloatArray, height: FloatArray, i: IntArray, j: IntArray
) -> tuple[FloatArray, int] | None:
    """Return a point and its row, the first where a line (p, 2, d) goes through a plane ``j``.

    ``height`` (p, 2) are the signed distances of the ends, which must lie clearly on both sides.
    ``i`` is sorted: rows with the same number are all that may touch the same line. Where the
    line hits a border of simplices, all that meet there decide together.
    """
    start, end = height.T
    apart = (height.min(axis=1) < -planes.margin) & (height.max(axis=1) > planes.margin)
    rows = np.flatnonzero(apart)
    share = (start[rows] / (start[rows] - end[rows]))[:, None]
    points = lines[rows, 0] + share * (lines[rows, 1] - lines[rows, 0])
    depth = planes.depths(points, j[rows]).min(axis=1)
    for k in np.flatnonzero(depth >= -planes.margin):
        row = int(rows[k])
        begin, stop = np.searchsorted(i, i[row], "left"), np.searchsorted(i, i[row], "right")
        if depth[k] > planes.margin or planes.part(points[k], j[begin:stop], lines[row]):
            return points[k], row
    return None


def _node_through(
    points: FloatArray, a: Surface, b: Surface, planes: Planes, touches: IntArray
) -> Hit | None:
    """Return a node of ``a`` that lies on ``b``, where ``a`` goes on on both sides.

    In structured meshes nodes often come to lie on each other exactly; then no edge crosses
    anything. ``touches`` (t, 2): a node of ``a`` and the simplex of ``b`` that it lies on.
    """
    touches = np.unique(touches, axis=0)
    edges = a.edges
    begin = np.searchsorted(edges[:, 0], touches[:, 0], "left")
    count = np.searchsorted(edges[:, 0], touches[:, 0], "right") - begin
    row = np.repeat(np.arange(len(touches)), count)
    ends = edges[np.arange(len(row)) + np.repeat(begin - np.cumsum(count) + count, count), 1]
    height = planes.heights(points[ends][:, None], touches[row, 1])[:, 0]
    above = np.bincount(row[height > planes.margin], minlength=len(touches)) > 0
    below = np.bincount(row[height < -planes.margin], minlength=len(touches)) > 0
    # Only a node with neighbours on both sides of some plane is worth the closer look.
    for node in np.unique(touches[above & below, 0]):
        others = touches[touches[:, 0] == node, 1]
        if planes.part(points[node], others, points[edges[edges[:, 0] == node, 1]]):
            facet = a.facet[(a.nodes == node).any(axis=1).argmax()]
            return points[node], int(facet), int(b.facet[others[0]])
    return None


def _chunks(n: int) -> Iterator[IntArray]:
    """Yield the numbers from 0 to n - 1 in parts of at most ``CHUNK``."""
    for first in range(0, n, CHUNK):
        yield np.arange(first, min(n, first + CHUNK))
