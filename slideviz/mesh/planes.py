"""Boundaries as simplices, their planes, and a tree of bounding boxes to find those near a query.

`FacetSimplices` has the lines (2D) or triangles (3D) of a boundary; `Planes` measures distances
from them and says whether they separate points; `BoxTree` finds near ones for many queries at
once. Facets of one mesh differ in size by factors of a million, so that a search by distance
between their centres finds far too many; boxes adapt to each.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import NO_NODES, BoolArray, column_bounds, mask_of
from slideviz.system.jit_cache import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from slideviz.mesh.model import Cells, FloatArray, IntArray


LEAF = 4  # most boxes in a leaf of `BoxTree`

ANGLE = 1e-6
"""Largest angle, in radians, between a simplex and a direction that counts as lying in it."""


@record
class FacetSimplices:
    """The lines (2D) or triangles (3D) that facets are divided into, in the order of the facets."""

    nodes: IntArray  # (s, d): the mesh nodes of each simplex: two in 2D, three in 3D
    facet: IntArray
    """(s,): index of the facet that each is part of: a quadrilateral is two triangles."""

    @classmethod
    def of(cls, cells: Cells, dim: int) -> FacetSimplices:
        """Return the simplices of the facets ``cells`` of a mesh of dimension ``dim``.

        Raises MeshError if an element has another dimension than a boundary.
        """
        parts = [np.empty((0, dim), np.int64)]
        facets = [NO_NODES]
        for vtk, (ids, nodes) in cells.by_type.items():
            row = ELEMENTS[vtk]
            if row.dim != dim - 1:
                raise MeshError(
                    f"a boundary of a mesh of dimension {dim} has a {row.name} (dimension "
                    f"{row.dim}); its elements must have dimension {dim - 1}"
                )
            for first in range(1, row.n_nodes - dim + 2):
                parts.append(nodes[:, [0, *range(first, first + dim - 1)]])
                facets.append(ids)
        found = np.concatenate(parts)
        facet = np.concatenate(facets)
        order = np.argsort(facet, kind="stable")
        return cls(found[order], facet[order])

    def __len__(self) -> int:
        return len(self.nodes)

    def keep(self, wanted: BoolArray) -> FacetSimplices:
        """Return the simplices where ``wanted`` (s,) is true."""
        return FacetSimplices(self.nodes[wanted], self.facet[wanted])

    def without(self, nodes: IntArray) -> FacetSimplices:
        """Return the simplices without those of facets that have any of ``nodes`` (k,)."""
        marked = mask_of(max(self.nodes.max(initial=0), nodes.max(initial=0)) + 1, nodes)
        held = mask_of(
            int(self.facet.max(initial=0)) + 1, self.facet[marked[self.nodes].any(axis=1)]
        )
        return self.keep(~held[self.facet])

    def within(self, points: FloatArray, other: FacetSimplices, margin: float) -> FacetSimplices:
        """Return the simplices whose bounding boxes touch the bounding box of ``other``.

        ``points`` are (n, d). Boxes count as touching up to a distance of ``margin``.
        """
        if not len(other):
            return other
        low, high = column_bounds(points[other.nodes.ravel()])
        below, above = boxes(points[self.nodes])
        meets = (below <= high + margin) & (above >= low - margin)
        return self.keep(np.asarray(meets.all(axis=1)))

    @property
    def edges(self) -> IntArray:
        """Return the nodes (e, 2) of all edges, in both directions, sorted, each once."""
        size = self.nodes.shape[1]
        pairs = [(i, k) for i in range(size) for k in range(size) if i != k]
        return np.unique(self.nodes[:, pairs].reshape(-1, 2), axis=0)


@record
class BoxTree:
    """A complete binary tree over axis-parallel boxes, the *items*."""

    order: IntArray  # (s,): indices of the items in the order of the leaves, filled up with -1
    low: FloatArray
    high: FloatArray
    """`low`, `high` (k, d): corners of the boxes of the nodes, level by level from the root: node i
    has the children 2 i + 1 and 2 i + 2. After them those of the items, `LEAF` for each leaf."""

    @classmethod
    def of(cls, low: FloatArray, high: FloatArray) -> BoxTree:
        """Return the tree over n ≥ 1 boxes with corners ``low``, ``high`` (n, d)."""
        n, d = low.shape
        depth = max(0, int(np.ceil(np.log2(n / LEAF))))
        order = np.concatenate((np.arange(n), np.full((LEAF << depth) - n, -1)))
        _halve(0.5 * (low + high), order, depth)
        filler = (order < 0)[:, None]
        lows = [np.where(filler, np.inf, low[order])]
        highs = [np.where(filler, -np.inf, high[order])]
        for size in [LEAF] + depth * [2]:
            # One item after the other: the fastest order.
            lows.append(reduce(np.minimum, lows[-1].reshape(-1, size, d).swapaxes(0, 1)))
            highs.append(reduce(np.maximum, highs[-1].reshape(-1, size, d).swapaxes(0, 1)))
        return cls(order, np.concatenate(lows[::-1]), np.concatenate(highs[::-1]))

    def near(
        self,
        corners: FloatArray,
        axes: FloatArray,
        margin: float,
        nodes: tuple[IntArray, IntArray] | None = None,
    ) -> tuple[IntArray, IntArray]:
        """Return indices (p,), (p,) of queries and items: the pairs that may touch.

        Their bounding boxes touch, and the item's box touches the planes that the query lies in.
        They are sorted by query, then item.
        ``corners`` (q, k, d): points whose convex hull is the query.
        ``axes`` (q, c, d): unit normals of the planes that a query lies in, through its first
        corner. A box off such a plane is not near, which shortens the search for large queries that
        are oblique to the coordinate axes.
        ``margin``: length up to which what lies apart counts as touching.
        ``nodes`` (q, k), (s, k): the nodes of queries and items; pairs with a common one are left
        out.
        """
        none = np.empty((0, 0), np.int64)
        low, high = boxes(corners)
        tree = self.order, self.low, self.high
        query = low - margin, high + margin, np.ascontiguousarray(corners[:, 0]), axes
        nodes = nodes or (none, none)
        pairs = np.empty((2, 4 * len(corners) + 64), np.int64)
        count = _find_near(tree, query, margin, *nodes, pairs)
        if count > pairs.shape[1]:
            pairs = np.empty((2, count), np.int64)
            _find_near(tree, query, margin, *nodes, pairs)
        i, j = pairs[:, :count]
        order = np.lexsort((j, i))
        return i[order], j[order]


@njit
def partition(keys, items, start, half, stop):  # type: ignore[no-untyped-def]
    """Reorder keys and items ``start`` to ``stop``, so that the lowest keys are before ``half``.

    Quickselect (C. A. R. Hoare, Algorithm 65: Find, 1961): a sort that stops as soon as that holds.
    """
    left = start
    right = stop - 1
    while left < right:
        pivot = keys[(left + right) // 2]
        i = left
        j = right
        while i <= j:
            while keys[i] < pivot:
                i += 1
            while keys[j] > pivot:
                j -= 1
            if i <= j:
                keys[i], keys[j] = keys[j], keys[i]
                items[i], items[j] = items[j], items[i]
                i = i + 1
                j = j - 1
        if half <= j:
            right = j
        elif half >= i:
            left = i
        else:
            return


@njit
def _halve(centre, order, depth):  # type: ignore[no-untyped-def]
    """Reorder items ``order``, with centres (n, d), for a tree of a depth.

    On each level each block of items is halved at the median along its longest axis.
    """
    along = np.empty(len(order))
    for level in range(depth):
        size = len(order) >> level
        for start in range(0, len(order), size):
            stop = start + size
            longest = 0
            length = -1.0
            for axis in range(centre.shape[1]):
                low = np.inf
                high = -np.inf
                for i in range(start, stop):
                    low = min(low, centre[order[i], axis])
                    high = max(high, centre[order[i], axis])
                if high - low > length:
                    length = high - low
                    longest = axis
            for i in range(start, stop):
                along[i] = centre[order[i], longest]
            partition(along, order, start, start + size // 2, stop)


@njit(inline="always")
def _meets(query, q, below, above, box, margin):  # type: ignore[no-untyped-def]
    """Return whether a box touches that of a query, and its planes; one with a NaN touches all."""
    low, high, start, axes = query
    meets = True
    for axis in range(low.shape[1]):
        meets &= low[q, axis] <= above[box, axis] and high[q, axis] >= below[box, axis]
    for plane in range(axes.shape[1] if meets else 0):
        offset = 0.0
        reach = margin
        for axis in range(low.shape[1]):
            normal = axes[q, plane, axis]
            offset += normal * (0.5 * (above[box, axis] + below[box, axis]) - start[q, axis])
            reach += abs(normal) * (0.5 * (above[box, axis] - below[box, axis]))
        meets &= not abs(offset) > reach
    return meets


@njit
def _find_near(tree, query, margin, nodes, nodes_of_items, pairs):  # type: ignore[no-untyped-def]
    """Write the first pairs of `BoxTree.near` into ``pairs`` (2, p), sorted by query only.

    Return how many there are. (A loop that made room for more would take six times as long.)
    """
    order, below, above = tree
    first = len(below) - len(order)  # the first item's box
    count = 0
    stack = np.empty(128, np.int64)
    for q in range(len(query[0])):
        stack[0] = 0
        top = 1
        while top:
            top -= 1
            k = stack[top]
            if not _meets(query, q, below, above, k, margin):
                continue
            if k < first // 2:
                stack[top] = 2 * k + 1
                stack[top + 1] = 2 * k + 2
                top += 2
                continue
            begin = (k - first // 2) * LEAF
            for place in range(begin, begin + LEAF):
                item = order[place]
                box = first + place
                if not _meets(query, q, below, above, box, margin):
                    continue
                common = False
                for a in range(nodes.shape[1]):
                    for b in range(nodes_of_items.shape[1]):
                        common = common or nodes[q, a] == nodes_of_items[item, b]
                if common:
                    continue
                if count < pairs.shape[1]:
                    pairs[0, count] = q
                    pairs[1, count] = item
                count += 1
    return count


@record
class Planes:
    """The planes of a surface's simplices at given points of its nodes, with a search tree."""

    corners: FloatArray  # (s, d, d): the corners of the simplices
    normals: FloatArray
    """(s, d): unit normals; NaN where a simplex is degenerate, so that all comparisons with it
    fail."""
    inwards: FloatArray
    """(s, d, d): for each corner a unit vector in the plane of the simplex, pointing inward: in 3D
    normal to the side that begins there, in 2D along the line."""
    tree: BoxTree  # the boxes around the simplices
    margin: float  # length up to which a point off the surface counts as lying on it

    @classmethod
    def of(cls, points: FloatArray, surface: FacetSimplices, margin: float) -> Planes:
        """Return the planes of a surface that is not empty, with the mesh's ``points`` (n, d)."""
        corners = points[surface.nodes]
        sides = np.roll(corners, -1, axis=1) - corners
        upright = normals(corners)
        inwards = np.cross(upright[:, None], sides) if corners.shape[2] == 3 else sides
        tree = BoxTree.of(*boxes(corners))
        return cls(corners, upright, _unit(inwards), tree, margin)

    def near(
        self,
        corners: FloatArray,
        axes: FloatArray,
        nodes: tuple[IntArray, IntArray] | None = None,
    ) -> tuple[IntArray, IntArray]:
        """Return the pairs of `BoxTree.near` with this margin."""
        return self.tree.near(corners, axes, self.margin, nodes)

    def heights(self, x: FloatArray, j: IntArray) -> FloatArray:
        """Return signed distances (p, k) of points (p, k, d) from the planes ``j`` (p,)."""
        return np.einsum("pkd,pd->pk", x - self.corners[j, :1], self.normals[j])

    def depths(self, x: FloatArray, j: IntArray) -> FloatArray:
        """Return distances (p, d) of points (p, d) from the sides of simplices ``j`` (p,).

        They are positive inside. Each point lies in the plane of its simplex.
        """
        return np.einsum("pkd,pkd->pk", x[:, None] - self.corners[j], self.inwards[j])

    def separates(self, x: FloatArray, near: IntArray, ends: FloatArray) -> bool:
        """Return whether, close to its point ``x``, the surface lies between any two of ``ends``.

        Close to ``x`` the surface is a cone: each simplex there is a plane, half a plane or a
        wedge. If the cone is closed around ``x``, two directions lie on different sides of it where
        a path between them crosses it an odd number of times. The paths go by way of each
        of several fixed directions. If it is open (``x`` on a border), the paths give different
        answers, and the result is False.
        ``x`` (d,): a point on the surface.
        ``near`` (p,): simplices; all that contain ``x`` must be among them.
        ``ends`` (r, d): other points, of which only the directions from ``x`` count. Those along
        the surface are on neither side, and left out.
        """
        here = np.broadcast_to(x, (len(near), len(x)))
        depth = self.depths(here, near)
        fan = (np.abs(self.heights(here[:, None], near)[:, 0]) <= self.margin) & (
            depth >= -self.margin
        ).all(axis=1)
        inner = (depth > self.margin)[fan]
        normal = self.normals[near[fan]]
        inward = self.inwards[near[fan]]
        way = _unit(ends - x)
        height = way @ normal.T
        side = np.einsum("rd,fkd->rfk", way, inward)
        along = (np.abs(height) <= ANGLE) & (inner | (side >= -ANGLE)).all(axis=2)
        height = height[~along.any(axis=1)]
        side = side[~along.any(axis=1)]
        if len(height) < 2:
            return False
        via = _VIA[len(x)]
        turn = via @ normal.T
        swing = np.einsum("vd,fkd->vfk", via, inward)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = height[:, None] / (height[:, None] - turn)
        at = side[:, None] + share[..., None] * (swing - side[:, None])
        crosses = (height[:, None] * turn < 0) & (inner | (at > 0)).all(axis=3)
        odd = crosses.sum(axis=2) % 2 == 1
        return bool((odd != odd[0]).all(axis=1).any())


def boxes(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bounding boxes of s sets of corners (s, k, d): low, high, each (s, d)."""
    each = corners.swapaxes(0, 1)  # one corner after the other is four times as fast
    return reduce(np.minimum, each), reduce(np.maximum, each)


def normals(corners: FloatArray) -> FloatArray:
    """Return unit normals (s, d) of simplices (s, d, d); NaN where one is degenerate."""
    side = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        return _unit(np.stack((-side[:, 0, 1], side[:, 0, 0]), axis=1))
    return _unit(np.cross(side[:, 0], side[:, 1]))


def line_normals(ways: FloatArray) -> FloatArray:
    """Return unit vectors (w, c, d) normal to lines (w, 2, d): c is 1 in 2D, 3 in 3D.

    In 3D they are normal to a coordinate axis each as well; NaN where the line is along it.
    """
    if ways.shape[2] == 2:
        return normals(ways)[:, None]
    return _unit(np.cross((ways[:, 1] - ways[:, 0])[:, None], np.eye(3)))


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (..., d) at length 1; NaN for those whose squared length is 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0.0, length, np.nan)


# Random directions (8, d), with no relation to any mesh, that paths in `Planes.separates` go by.
_VIA: dict[int, NDArray[np.float64]] = {
    d: _unit(np.random.default_rng(7).normal(size=(8, d))) for d in (2, 3)
}
