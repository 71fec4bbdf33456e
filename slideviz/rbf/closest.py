"""Closest points on triangles and segments, by a tree of bounding boxes.

Boundary layers make facets a thousand times longer than wide, so the facet with the nearest centre
is often not the nearest facet; a tree of boxes finds it in any case. Segments are triangles with
their last corner repeated, and two dimensions are three with z = 0.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from slideviz.mesh.jacobians import add3, dot3, minus3, row3, scaled3
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray
from slideviz.mesh.nearest import OBLIQUE
from slideviz.mesh.planes import partition
from slideviz.rbf.compiled import one_at_a_time
from slideviz.system.jit_cache import njit

LEAF = 4  # triangles in a leaf of the tree, at most
TIE = 1e-12  # squared distances with a smaller relative difference are equal but for rounding
ON = 1e-30
"""A point is on its guessed triangle when its squared distance from it is at most this part of its
squared distance from the origin."""
MOST = 1e150
TURNS = 2.0**30
"""Largest coordinate with which periods are counted, and the largest number of them."""
EDGE = 1e-9
"""A closest point is on the side of a triangle where the opposite corner has at most this part in
it."""


@njit(inline="always")
def _image(item, count):  # type: ignore[no-untyped-def]
    """Return ``item // count``: 0 for a triangle, 1 or 2 for an image; faster than dividing."""
    if item < count:
        return 0
    return 1 if item < 2 * count else 2


@njit
def _build(corners, shifts, order, bounds):  # type: ignore[no-untyped-def]
    """Build a balanced tree of boxes: reorder ``order`` (q,) and fill ``bounds`` (m, 6).

    Item k, an entry of ``order``, is the triangle k % n of ``corners`` (n, 3, 3), moved by the row
    k // n of ``shifts`` (3, 3). A row of ``bounds`` is the lowest and the highest corner of a
    node's box.

    Node k has the children 2 k + 1 and 2 k + 2. Its items are a range of ``order``: half of its
    parent's range, so no ranges are stored.
    """
    nodes = bounds.shape[0]
    starts = np.zeros(nodes, np.int64)
    stops = np.zeros(nodes, np.int64)
    stops[0] = len(order)
    count = len(corners)
    size = np.empty(3)
    middle = np.empty(len(order))
    low = np.empty((count, 3))
    high = np.empty((count, 3))
    for i in range(count):
        for axis in range(3):
            one = corners[i, 0, axis]
            two = corners[i, 1, axis]
            three = corners[i, 2, axis]
            low[i, axis] = min(one, two, three)
            high[i, axis] = max(one, two, three)
    for k in range(nodes):
        a = starts[k]
        b = stops[k]
        for axis in range(3):
            lowest = np.inf
            highest = -np.inf
            for i in range(a, b):
                image = _image(order[i], count)
                one = order[i] - image * count
                by = shifts[image, axis]
                lowest = min(lowest, low[one, axis] + by)
                highest = max(highest, high[one, axis] + by)
            bounds[k, axis] = lowest
            bounds[k, 3 + axis] = highest
            if bounds[k, axis] > lowest:  # rounded: no box is smaller than what is in it
                bounds[k, axis] = np.nextafter(bounds[k, axis], np.float32(-np.inf))
            if bounds[k, 3 + axis] < highest:
                bounds[k, 3 + axis] = np.nextafter(bounds[k, 3 + axis], np.float32(np.inf))
            size[axis] = highest - lowest
        if 2 * k + 2 >= nodes:
            continue
        longest = np.argmax(size)
        for i in range(a, b):
            image = _image(order[i], count)
            one = order[i] - image * count
            by = shifts[image, longest]
            middle[i] = (low[one, longest] + by) + (high[one, longest] + by)
        half = a + (b - a + 1) // 2
        partition(middle, order, a, half, b)
        starts[2 * k + 1] = a
        stops[2 * k + 1] = half
        starts[2 * k + 2] = half
        stops[2 * k + 2] = b


@njit(inline="always")
def _box_gap(bounds, k, x):  # type: ignore[no-untyped-def]
    """Return the squared distance from x (3,) to box k; 0 inside."""
    total = 0.0
    for axis in range(3):
        gap = max(bounds[k, axis] - x[axis], x[axis] - bounds[k, 3 + axis], 0.0)
        total += gap * gap
    return total


@njit(inline="always")
def _on_segment(x, a, b):  # type: ignore[no-untyped-def]
    """Return the squared distance of x from segment a, b, and the closest point; all triples."""
    along = minus3(b, a)
    length = dot3(along, along)
    t = 0.0 if length <= 0.0 else min(max(dot3(minus3(x, a), along) / length, 0.0), 1.0)
    point = add3(a, scaled3(t, along))
    away = minus3(x, point)
    return dot3(away, away), point


@njit
def _on_triangle(x, corners):  # type: ignore[no-untyped-def]
    """Return the squared distance of x from a triangle of three triples, and the closest point."""
    a, b, c = corners
    u = minus3(b, a)
    v = minus3(c, a)
    w = minus3(x, a)
    uu = dot3(u, u)
    uv = dot3(u, v)
    vv = dot3(v, v)
    wu = dot3(w, u)
    wv = dot3(w, v)
    area = uu * vv - uv * uv
    if area > 0.0:
        s = (vv * wu - uv * wv) / area
        t = (uu * wv - uv * wu) / area
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            point = add3(add3(a, scaled3(s, u)), scaled3(t, v))
            away = minus3(x, point)
            return dot3(away, away), point
    best = _on_segment(x, a, b)
    for start, stop in ((b, c), (c, a)):
        side = _on_segment(x, start, stop)
        if side[0] < best[0]:
            best = side
    return best


@njit(inline="always")
def _before(a, b):  # type: ignore[no-untyped-def]
    """Return whether point a comes before b along `OBLIQUE`."""
    return dot3(minus3(a, b), OBLIQUE) < 0.0


@njit(inline="always")
def _is_beside(a, b, gap):  # type: ignore[no-untyped-def]
    """Return whether a and b, both at squared distance ``gap`` from a node, are one place.

    Where facets meet, the end of one facet ties with a point of the next facet that is 1e-6 of the
    distance away: there the nearer point is taken, however little it is nearer.
    """
    apart = minus3(a, b)
    return dot3(apart, apart) <= 4.0 * TIE * gap


@njit(inline="always")
def _load(item, corners, shifts):  # type: ignore[no-untyped-def]
    """Return the corners of an item, numbered as for ``_build``: three triples."""
    image = _image(item, len(corners))
    triangle = corners[item - image * len(corners)]
    a = row3(triangle, 0)
    b = row3(triangle, 1)
    c = row3(triangle, 2)
    if image > 0:  # adding zero would turn -0.0 into 0.0
        by = row3(shifts, image)
        a = add3(a, by)
        b = add3(b, by)
        c = add3(c, by)
    return a, b, c


@njit(parallel=True)
def _query(x, corners, shifts, order, bounds, guess, out, which):  # type: ignore[no-untyped-def]
    """Write the points of the triangles ``corners`` (n, 3, 3) closest to x (m, 3) into out (m, 3).

    Into ``which`` (m,) goes the item that each is on, numbered as for ``_build``. The search for
    each begins with its item in ``guess``, (m,) or empty.

    Of several equally near points the position decides, not the order of the triangles.
    """
    nodes = bounds.shape[0]
    inner = nodes // 2
    for i in prange(len(x)):
        stack = np.empty(64, np.int64)
        first = np.empty(64, np.int64)
        last = np.empty(64, np.int64)
        here = row3(x, i)
        chosen = here
        best = np.inf
        held = np.inf
        top = 1
        stack[0] = 0
        first[0] = 0
        last[0] = len(order)
        if len(guess):
            best, chosen = _on_triangle(here, _load(guess[i], corners, shifts))
            held = best
            which[i] = guess[i]
            if best <= ON * dot3(here, here):
                top = 0
        while top > 0:
            top -= 1
            k = stack[top]
            a = first[top]
            b = last[top]
            if best == 0.0 or _box_gap(bounds, k, here) > best * (1.0 + TIE):
                continue
            if k >= inner:
                for j in range(a, b):
                    gap, point = _on_triangle(here, _load(order[j], corners, shifts))
                    nearer = gap < best * (1.0 - TIE)
                    if not nearer and gap <= best * (1.0 + TIE):
                        if gap != held and _is_beside(point, chosen, best):
                            nearer = gap < held
                        else:
                            nearer = _before(point, chosen)
                    if nearer:
                        held = gap
                        which[i] = order[j]
                        chosen = point
                    best = min(best, gap)
                continue
            half = a + (b - a + 1) // 2
            left = 2 * k + 1
            right = 2 * k + 2
            # The nearer child is put on top, to be looked at first.
            if _box_gap(bounds, left, here) < _box_gap(bounds, right, here):
                stack[top] = right
                first[top] = half
                last[top] = b
                stack[top + 1] = left
                first[top + 1] = a
                last[top + 1] = half
            else:
                stack[top] = left
                first[top] = a
                last[top] = half
                stack[top + 1] = right
                first[top + 1] = half
                last[top + 1] = b
            top += 2
        out[i, 0], out[i, 1], out[i, 2] = chosen


class ClosestPoints:
    """Finds the closest points on simplices and on their images at all periods.

    The tree has the images one period before and after. A point more than one period from the
    middle of the simplices is taken back by whole periods, and its closest point forth by as many.

    Beyond a rim simplices go on flat: where the closest point would be on the rim, it is the foot
    on the line or plane of the simplex there.
    """

    def __init__(
        self, corners: FloatArray, shift: FloatArray | None = None, rim: FloatArray | None = None
    ) -> None:
        """Build the tree.

        ``corners`` (n, c, d): segments (c = 2) or triangles (c = 3) in d = 2 or 3 dimensions.
        ``shift`` (d,): one period; None: there are no images.
        ``rim`` (e, c - 1, d): ends of segments, or sides of triangles, with the same coordinates.
        """
        self.corners = corners
        """(n, c, d): the simplices. Their images are not stored, to save memory."""
        n, count, dim = corners.shape
        self._corners: FloatArray = corners
        if (count, dim) != (3, 3) or not corners.flags.c_contiguous:
            self._corners = np.zeros((n, 3, 3))
            self._corners[:, :count, :dim] = corners
            self._corners[:, count:] = self._corners[:, count - 1 : count]
        self._shifts: FloatArray = np.zeros((3, 3))
        items = n
        self._along: FloatArray | None = None
        if shift is not None:
            items = 3 * n
            self._shifts[1, :dim] = -shift
            self._shifts[2, :dim] = shift
            self._along = shift / (shift @ shift)
            places = corners.reshape(-1, dim) @ self._along
            self._middle = (places.min() + places.max()) / 2.0
        self._rim = None if rim is None or not len(rim) else _on_rim(corners, rim)
        depth = max(0, int(np.ceil(np.log2(max(1, items / LEAF)))))
        self._bounds = np.empty((2 ** (depth + 1) - 1, 6), np.float32)
        self._order = np.arange(items, dtype=np.int32)
        _build(self._corners, self._shifts, self._order, self._bounds)

    def simplices(self, which: IntArray) -> FloatArray:
        """Return the corners (k, c, d) of simplices (k,), numbered as `nearest` returns them."""
        image, one = np.divmod(which, len(self.corners))
        turn, image = np.divmod(image, 3)
        moved = self.corners[one]
        there = image > 0
        moved[there] += self._shifts[image[there], None, : moved.shape[2]]
        far = turn != 0
        moved[far] += turn[far, None, None] * self._shifts[2, : moved.shape[2]]
        return moved

    def _periods(self, x: FloatArray) -> IntArray:
        """Return the whole periods (m,) by which x (m, d) are taken back; 0 up to one period."""
        if self._along is None:
            return np.zeros(len(x), np.int64)
        # What has become infinite, or no number, is not taken back.
        place = np.clip(np.nan_to_num(x), -MOST, MOST) @ self._along - self._middle
        place[np.abs(place) > TURNS] = 0.0
        return (np.sign(place) * np.maximum(np.ceil(np.abs(place) - 1.0), 0.0)).astype(np.int64)

    def query(self, x: FloatArray) -> FloatArray:
        """Return the closest point on the simplices for each x, (m, d)."""
        return self.nearest(x)[0]

    def nearest(self, x: FloatArray, guess: IntArray | None = None) -> tuple[FloatArray, IntArray]:
        """Return the closest point for each x (m, d), (m, d), and the number of its simplex, (m,).

        Numbers below 0 and from n on are images; `simplices` returns the corners.
        ``guess`` (m,): numbers of simplices that are probably the closest, for speed. Where x is on
        its guessed simplex, that one is taken, even if x is on others too.
        """
        begin = NO_NODES if guess is None else guess % len(self._order)
        dim = x.shape[1]
        turns = self._periods(x)
        targets = np.zeros((len(x), 3))
        targets[:, :dim] = x
        far = np.flatnonzero(turns)
        by = turns[far, None] * self._shifts[2]
        targets[far] -= by
        out = np.empty_like(targets)
        which = np.zeros(len(x), np.int64)
        with one_at_a_time(50 * len(x)):
            _query(
                targets, self._corners, self._shifts, self._order, self._bounds, begin, out, which
            )
        out[far] += by
        at = out[:, :dim]
        which = which + turns * len(self._order)
        if self._rim is not None:
            self._go_on(x, at, which)
        return at, which

    def _go_on(self, x: FloatArray, at: FloatArray, which: IntArray) -> None:
        """Move closest points ``at`` (m, d) of x (m, d) that are on the rim to the feet of x."""
        assert self._rim is not None
        on_rim = self._rim[which % len(self.corners)]
        rows = np.flatnonzero(on_rim.any(axis=1))
        corners = self.simplices(which[rows])
        on_rim = on_rim[rows]
        sides = corners[:, 1:] - corners[:, :1]
        to_parts = np.linalg.pinv(sides).transpose(0, 2, 1)  # of corners 1 and 2 in a point

        def parts(points: FloatArray) -> FloatArray:
            return np.einsum("mcd,md->mc", to_parts, points[rows] - corners[:, 0])

        there = parts(at)
        absent = np.column_stack([1.0 - there.sum(axis=1), there]) <= EDGE
        lacks = absent.sum(axis=1)
        count = corners.shape[1]
        beyond = (lacks == count - 1) & (on_rim[:, :count] & ~absent).any(axis=1)
        if count == 3:
            beyond |= (lacks == 1) & (on_rim[:, count:] & absent).any(axis=1)
        foot = corners[:, 0] + np.einsum("mc,mcd->md", parts(x), sides)
        at[rows[beyond]] = foot[beyond]


def _on_rim(corners: FloatArray, rim: FloatArray) -> BoolArray:
    """Return which corners of simplices (n, c, d) are on the rim, and which opposite sides.

    (n, c) bool for segments, (n, 2 c) for triangles.
    """

    def keys(points: FloatArray) -> FloatArray:
        return np.asarray(sum(points[..., k] * OBLIQUE[k] for k in range(points.shape[-1])))

    def among(points: FloatArray, others: FloatArray) -> BoolArray:
        return np.isin(keys(points), keys(others))

    found = among(corners, rim)
    if corners.shape[1] == 2:
        return found
    middles = corners[:, [1, 2, 0]] + corners[:, [2, 0, 1]]
    return np.concatenate([found, among(middles, rim.sum(axis=1))], axis=1)
