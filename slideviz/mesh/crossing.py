"""Where the moved boundary passes through others (or one boundary through itself), if it does.

If boundaries cross after their motion, no method can deform the mesh into a valid one. So this is
tested before the deformation, with the moved boundary alone at its new place.

Touching is not crossing: a boundary that goes into another by no more than ``TOLERANCE`` of the
extent counts as lying on it. So boundaries that coincide (the two sides of a thin plate) or
rest on one another are not reported. Where the moved boundary shares nodes with the other one, the
facets of both that have a shared node are not tested: those of the moved one lie only roughly on
the other's surface, and those of the other are distorted until its remaining nodes have followed.
"""

from __future__ import annotations

from functools import reduce
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import Cells, column_bounds, ranges, sorted_nodes
from slideviz.mesh.planes import FacetSimplices, Planes, line_normals, normals
from slideviz.system.threads import ordered_map

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from slideviz.mesh.model import FloatArray, IntArray


TOLERANCE = 1e-8
"""Depth, as a share of the largest extent of both boundaries, up to which they only touch."""

TRIANGLE = 5
QUADRILATERAL = 9
"""VTK identifiers."""

CHUNK = 1024
"""Facets searched at a time, so that memory stays small and an early find ends the search."""

Hit = tuple["FloatArray", int, int]
"""A point (d,), and the indices of the two facets (or line and simplex) that cross there."""


@record
class Crossing:
    """A place where the moved boundary goes through another."""

    marker: str  # name of the other boundary
    point: FloatArray  # (d,): a point of both
    facet: int
    other_facet: int
    """`facet`, `other_facet`: the two elements, counted from 0 in the moved and in the other
    boundary."""


def first_crossing(
    points: FloatArray, moved: Cells, others: Sequence[tuple[str, Cells]]
) -> Crossing | None:
    """Return a place where the moved boundary crosses another, the first that it crosses, or None.

    Raises MeshError if an element has another dimension than a boundary.
    ``points`` (n, d): all points of the mesh, those of the moved boundary at their new place.
    ``moved``: its elements: lines in 2D, triangles and quadrilaterals (as two triangles) in 3D.
    ``others``: the other boundaries by name. Leave out those that will move along,
    such as periodic ones with periodic displacement: their place in ``points`` is the old one.
    """
    points = np.asarray(points, np.float64)
    body = FacetSimplices.of(moved, points.shape[1])
    for name, cells in others:
        wall = FacetSimplices.of(cells, points.shape[1]).without(moved.nodes)
        free = body.without(cells.nodes)
        margin = _margin(points, free, wall)
        hit = pierced(points, free, wall, margin)
        if hit is None and (back := pierced(points, wall, free, margin)) is not None:
            hit = back[0], back[2], back[1]
        if hit is not None:
            return Crossing(name, *hit)
    return None


def swept_crossing(
    before: FloatArray, after: FloatArray, moved: Cells, others: Sequence[tuple[str, Cells]]
) -> Crossing | None:
    """Return where the path of a node of the moved boundary goes through another one, or None.

    Paths are straight. So a body is found that has jumped over a wall. Facets of the others that
    move themselves are not tested. For a curved path, call it for one short piece after the other.
    ``before`` and ``after`` (n, d): all points of the mesh, before and after the motion; others as
    in `first_crossing`. Raises MeshError if an element has another dimension than a boundary.
    """
    before = np.asarray(before, np.float64)
    after = np.asarray(after, np.float64)
    goes = reduce(np.logical_or, (before != after).T)
    going = np.flatnonzero(goes)
    body = FacetSimplices.of(moved, after.shape[1])
    for name, cells in others:
        wall = FacetSimplices.of(cells, after.shape[1]).without(going)
        free = body.without(cells.nodes)
        nodes = sorted_nodes(free.nodes)
        nodes = nodes[goes[nodes]]
        if not (len(nodes) and len(wall)):
            continue
        margin = max(_margin(before, free, wall), _margin(after, free, wall))
        hit = swept(np.stack((before[nodes], after[nodes]), axis=1), Planes.of(after, wall, margin))
        if hit is not None:
            point, k, other = hit
            facet = free.facet[(free.nodes == nodes[k]).any(axis=1).argmax()]
            return Crossing(name, point, int(facet), int(wall.facet[other]))
    return None


def fanned(points: FloatArray, surfaces: Sequence[Cells]) -> tuple[FloatArray, list[Cells]]:
    """Return points and surfaces with four triangles around the middle of each quadrilateral.

    They do not depend on the node at which it begins, as its halves along a diagonal do: those of
    a twisted quadrilateral may cross another one close to it where the quadrilaterals do not.
    ``points`` (n, d); those in the middle come after them.
    """
    parts = [points]
    count = len(points)
    found = []
    for cells in surfaces:
        blocks = []
        for vtk, (_, nodes) in cells.by_type.items():
            if vtk != QUADRILATERAL:
                blocks.append((vtk, nodes))
                continue
            middle = np.arange(count, count + len(nodes))
            count += len(nodes)
            parts.append(points[nodes].mean(axis=1))
            corners = zip(nodes.T, np.roll(nodes, -1, axis=1).T, strict=True)
            blocks += [(TRIANGLE, np.column_stack((*pair, middle))) for pair in corners]
        found.append(Cells.from_blocks(blocks))
    return np.concatenate(parts), found


def _margin(points: FloatArray, a: FacetSimplices, b: FacetSimplices) -> float:
    """Return ``TOLERANCE`` times the largest extent of both surfaces together; 0 without any."""
    used = points[np.concatenate((a.nodes, b.nodes)).ravel()]
    if not len(used):
        return 0.0
    low, high = column_bounds(used)
    return TOLERANCE * float((high - low).max())


def pierced(points: FloatArray, a: FacetSimplices, b: FacetSimplices, margin: float) -> Hit | None:
    """Return where an edge or a node of ``a`` passes through ``b`` (point, both facets), or None.

    Two surfaces cross where an edge of one goes through a simplex of the other, so call it with
    both orders. ``margin`` is a length: what is as near as this only touches.
    """
    a, b = a.within(points, b, margin), b.within(points, a, margin)
    if not (len(a) and len(b)):
        return None
    planes = Planes.of(points, b, margin)
    touches = []
    for part in _chunks(len(a)):
        nodes = a.nodes[part]
        corners = points[nodes]
        i, j = planes.near(corners, normals(corners)[:, None])
        ends = nodes[i]
        at = corners[i]
        height = planes.heights(at, j)
        touch = np.abs(height) <= margin
        for k in range(ends.shape[1]):
            touch[:, k] &= (planes.depths(at[:, k], j) >= -margin).all(axis=1)
        row, column = np.nonzero(touch)
        touches.append(np.column_stack((ends[row, column], j[row])))
        pairs = list(combinations(range(ends.shape[1]), 2))
        crossings = [_strike(planes, at[:, pair], height[:, pair], i, j) for pair in pairs]
        hits = [hit for hit in crossings if hit is not None]
        if hits:
            point, first = min(hits, key=lambda hit: hit[1])
            return point, int(a.facet[part[i[first]]]), int(b.facet[j[first]])
    return _node_through(points, a, b, planes, np.concatenate(touches))


def self_crossing(points: FloatArray, cells: Cells) -> Hit | None:
    """Return where a boundary intersects itself (point, both facets), or None.

    Facets that share a node are not compared. ``cells`` are as ``moved`` in `first_crossing`.
    Raises MeshError if an element has another dimension than a boundary.
    """
    surface = FacetSimplices.of(cells, points.shape[1])
    if not len(surface):
        return None
    planes = Planes.of(points, surface, _margin(points, surface, surface))
    pairs = list(combinations(range(points.shape[1]), 2))

    def near(part: IntArray) -> tuple[IntArray, IntArray]:
        corners = points[surface.nodes[part]]
        away = surface.nodes[part], surface.nodes
        return planes.near(corners, normals(corners)[:, None], away)

    parts = list(_chunks(len(surface)))
    for part, (i, j) in zip(parts, ordered_map(near, parts), strict=True):
        at = points[surface.nodes[part[i]]]
        height = planes.heights(at, j)
        for pair in pairs:
            hit = _strike(planes, at[:, pair], height[:, pair], i, j)
            if hit is not None:
                return hit[0], int(surface.facet[part[i[hit[1]]]]), int(surface.facet[j[hit[1]]])
    return None


def swept(ways: FloatArray, planes: Planes) -> Hit | None:
    """Return where the first of lines (w, 2, d) that does so goes through a surface, or None.

    The indices of the hit are those of the line and of the simplex.
    """
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
    """Return the first point where a line passes through its simplex, and the row, or None.

    Each row is one pair of a line and a simplex near it.
    ``lines`` (p, 2, d): the ends of each line.
    ``height`` (p, 2): signed distances of the ends from the plane of the simplex. Only rows count
    whose ends lie on different sides, each by more than the margin.
    ``i``, ``j`` (p,): line and simplex of each row. ``i`` is sorted, and has all simplices that may
    touch a line: where the line hits the border of one, `Planes.separates` decides by all of them.
    """
    start, end = height.T
    apart = (height.min(axis=1) < -planes.margin) & (height.max(axis=1) > planes.margin)
    rows = np.flatnonzero(apart)
    share = (start[rows] / (start[rows] - end[rows]))[:, None]
    points = lines[rows, 0] + share * (lines[rows, 1] - lines[rows, 0])
    depth = planes.depths(points, j[rows]).min(axis=1)
    for k in np.flatnonzero(depth >= -planes.margin):
        row = int(rows[k])
        begin = np.searchsorted(i, i[row], "left")
        stop = np.searchsorted(i, i[row], "right")
        if depth[k] > planes.margin or planes.separates(points[k], j[begin:stop], lines[row]):
            return points[k], row
    return None


def _node_through(
    points: FloatArray, a: FacetSimplices, b: FacetSimplices, planes: Planes, touches: IntArray
) -> Hit | None:
    """Return a node of ``a`` that lies on ``b`` and has edges to both sides of it, or None.

    In structured meshes nodes often come to lie on each other exactly; then no edge crosses a
    simplex. ``touches`` (t, 2) has a node of ``a`` and a simplex of ``b`` that it lies on.
    """
    touches = np.unique(touches, axis=0)
    edges = a.edges
    begin = np.searchsorted(edges[:, 0], touches[:, 0], "left")
    count = np.searchsorted(edges[:, 0], touches[:, 0], "right") - begin
    row = np.repeat(np.arange(len(touches)), count)
    ends = edges[ranges(begin, count), 1]
    height = planes.heights(points[ends][:, None], touches[row, 1])[:, 0]
    above = np.bincount(row[height > planes.margin], minlength=len(touches)) > 0
    below = np.bincount(row[height < -planes.margin], minlength=len(touches)) > 0
    # Only a node with neighbours on both sides of some plane is worth the closer look.
    for node in np.unique(touches[above & below, 0]):
        others = touches[touches[:, 0] == node, 1]
        if planes.separates(points[node], others, points[edges[edges[:, 0] == node, 1]]):
            facet = a.facet[(a.nodes == node).any(axis=1).argmax()]
            return points[node], int(facet), int(b.facet[others[0]])
    return None


def _chunks(n: int) -> Iterator[IntArray]:
    """Yield the numbers from 0 to n - 1 in parts of at most ``CHUNK``."""
    for first in range(0, n, CHUNK):
        yield np.arange(first, min(n, first + CHUNK))
