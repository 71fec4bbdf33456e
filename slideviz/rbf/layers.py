"""The layer zone: near a wall, nodes go with the wall's own displacement and rotation.

Radial functions know neither cells nor the body that they reach through, and change the heights of
boundary layers. So nearer to a wall than its thickness delta, a node at X goes to the place where
the wall nodes i near it (at X_i, displaced by d_i, turned by M_i) would carry it:

    u = sum_i w_i (d_i + (M_i - 1)(X - X_i)),    w_i ~ s_i |X - X_i|^-6,    sum_i w_i = 1
    x <- x + b (X + u - x),                      b = 1 - smooth((distance - h) / delta)

where h is the height of the first layer at the nearest wall node,
smooth(t) = t^3 (10 - 15 t + 6 t^2), and i are the `NEAREST` nodes of the wall that see the node:
s_i rises from 0 to 1 with the cosine of the angle between X - X_i and the normal of a facet at X_i,
of its facets the one nearest to X - X_i, so that the two sides of a thin body do not mix, and both
see their common sharp edge. There each side has its own M_i; those that see X share the weight.
Of several walls k, j whose zones overlap each has the weight b / distance^6, 1 - b is the product
of theirs, and b_k is (1 - b_j smooth(2 d_k / (d_k + d_j)))^2 times as much, so that in a gap
thinner than the zones the nodes between are left to the radial functions.
Where walls come near each other, layers give way: with the height left w of a node (1 where there
is room), and its foot on the wall, p = sum_i w_i (X_i + d_i), it goes to p + w (X + u - p) instead.
All but w is found from the undeformed mesh; u is linear in d and M. M is the rotation nearest to
the map of the directions of the facets at the wall node (lines in 2D, normals and edges in 3D).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import point_words
from slideviz.mesh.model import (
    BoolArray,
    FloatArray,
    IntArray,
    offsets_of,
    ranges,
    row_dots,
    row_norms,
    row_numbers,
    run_begins,
)
from slideviz.mesh.topology import TINY, corner_vectors, distinct_edges, facet_edges, real_corners
from slideviz.mesh.topology import unit as unit_rows
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.frames import Frame
from slideviz.rbf.nearest_rotation import nearest_rotations
from slideviz.rbf.operations import difference_from, points
from slideviz.rbf.projection import as_simplices
from slideviz.rbf.tape import (
    Array,
    cross,
    gather,
    join,
    linear,
    mixed,
    multiply,
    reshape,
    take,
    transform,
    unit,
    value,
)
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

if TYPE_CHECKING:
    from scipy.sparse import csr_array
    from scipy.spatial import cKDTree

NEAREST = 12  # wall nodes that carry a node

ALIKE = 4  # wall nodes that may be nearest, at one distance, as the corners of a facet

CANDIDATES = 2 * NEAREST  # nearest wall nodes among which those that see the node are looked for

POWER = 6
"""Power of the inverse distance in the weights of wall nodes, and of walls. Cells at a small edge
may be as long as high; with 3 their heights would change by up to 2 %."""

GRAZING = 0.3  # cosine from which a wall node sees a node fully; below minus this not at all

CORNER = 0.6
"""Largest distance from a point of a facet to its nearest corner over the diagonal of its box; in
an equilateral triangle it is 1 / sqrt(3) of an edge."""

RIGID = 0.99
"""Nodes that walls carry with a share above this stay where they carry them in relaxation and
repair."""

GIVEN = 0.995  # least part of a height that counts as all of it

EDGES = 0.01  # weight of the edges of the facets at a wall node over that of their normals, in 3D


def smooth(t: FloatArray) -> FloatArray:
    """Return t^3 (10 - 15 t + 6 t^2), for t between 0 and 1: 0 and 1, with flat ends."""
    t = np.clip(t, 0.0, 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t * t)


@record
class Wall:
    """A connected wall with layers."""

    names: tuple[str, ...]  # the boundaries that it consists of
    facets: IntArray  # (f, 2 or 4): its facets, nodes ordered so that normals point out of the mesh
    sides: IntArray
    """(f, 2 or 4): numbers of the smooth sides of the wall at its nodes: at a sharp edge a node has
    several, each of which turns by itself."""
    thickness: FloatArray
    first: FloatArray
    """`thickness`, `first` (w,): at its nodes, ascending, the thickness of its zone in the mesh's
    length unit, and the height of the first layer, which is wholly in the zone."""
    moves: bool  # whether its nodes are moving ones; others stay


Reached = tuple[IntArray, FloatArray, FloatArray, FloatArray]
"""Points (z,) in the zone of a wall, their distances from it, shares and weights."""


@record
class WallNodes:
    """The nodes of all walls, once for each side, and the sources: these and their images."""

    frame: Frame
    known: IntArray
    """(w,): the nodes, by their places among the known nodes; those of two walls, or on a sharp
    edge, are here twice."""
    start: FloatArray  # (w, d): undeformed Cartesian points
    facets: IntArray  # (f, 2 or 4): of moving walls, by places of nodes here
    walls: tuple[tuple[Wall, IntArray, IntArray], ...]
    """Each wall, with the places (u + 1,) where the sources of each of its u nodes and images
    begin, and its facets and their images by places of sources."""
    origin: IntArray  # (s,): the place here of the node that each source is, or is an image of
    turn: FloatArray | None
    """(s, d, d): rotations from it to the source; None: images are only shifted."""
    places: FloatArray  # (s, d): the undeformed Cartesian points of the sources
    normals: FloatArray
    """(k, d): the undeformed Cartesian unit normals of the facets at the sources, into the mesh."""
    offsets: IntArray  # (s + 1,): the normals at source i are offsets[i] to offsets[i + 1]

    @cached_property
    def _trees(self) -> list[tuple[cKDTree, ClosestPoints]]:
        # Late: scipy.spatial takes 0.1 s.
        from scipy.spatial import cKDTree

        return [
            (cKDTree(self.places[begins[:-1]]), ClosestPoints(as_simplices(self.places[facets])))
            for _, begins, facets in self.walls
        ]

    @cached_property
    def _undeformed(self) -> FloatArray:
        """Return the rotations at rest, (w, d d): the identity, to rounding."""
        return value(self._rotations(self.start))

    def motion(self, goal: Array) -> tuple[Array, Array]:
        """Return displacement (..., s, d) and rotation less identity (..., s d, d) of all sources.

        Of the latter row (i, b) has the column b of M_i - 1, Cartesian as all.
        ``goal`` (..., a, d): where the known nodes are, in the frame.
        """
        now = points(self.frame, take(goal, self.known))
        dim = self.start.shape[1]
        moved = now - self.start
        turned = self._rotations(now) - self._undeformed
        moved = take(moved, self.origin)
        turned = take(turned, self.origin)
        if self.turn is not None:
            both = np.einsum("sac,sbd->sabcd", self.turn, self.turn)
            moved = transform(self.turn, moved)
            turned = transform(both.reshape(-1, dim * dim, dim * dim), turned)
        return moved, reshape(turned, len(self.origin) * dim, dim)

    def _rotations(self, now: Array) -> Array:
        """Return the transposed rotations (..., w, d d) of wall nodes ``now`` (..., w, d)."""
        facets = self.facets
        start = self.start
        dim = self.start.shape[1]
        count = len(start)
        once = real_corners(facets).astype(float)
        corner = np.arange(facets.size) // facets.shape[1]
        at = facets.reshape(-1)
        total = np.bincount(at, once.reshape(-1), count)[:, None]
        still = total == 0.0
        spread = _outer(value(_directions(start, facets)), _directions(now, facets))
        spread = gather(multiply(take(spread, corner), once.reshape(-1, 1)), at, count)
        found = multiply(spread, 1.0 / (total + still))
        if dim == 3:
            one, two = self._edges
            along = start[two] - start[one]
            along = along / row_dots(along, along)[:, None]
            spread = _outer(along, take(now, two) - take(now, one))
            ends = np.concatenate([one, two])
            each = EDGES / np.maximum(1, np.bincount(ends, minlength=count))[:, None]
            found = found + multiply(gather(join(spread, spread), ends, count), each)
        return nearest_rotations(found + still * np.eye(dim).reshape(1, -1), dim)

    @cached_property
    def _edges(self) -> IntArray:
        return distinct_edges(facet_edges(self.facets)).T

    def near(self, targets: FloatArray) -> tuple[IntArray, FloatArray, csr_array, csr_array]:
        """Return which points (m, d) are in the zone, (z,), their share b (z, 1), and two matrices.

        The matrices (z, s) and (z, s d) take what `motion` returns to b u, (z, d). The result for a
        point does not depend on the others.
        """
        # Late: scipy.sparse takes 0.1 s.
        from scipy.sparse import csr_array

        outside = np.ones(len(targets))
        weight = np.zeros(len(targets))
        parts = _shared([self._reached(k, targets) for k in range(len(self.walls))])
        for some, _, share, each in parts:
            outside[some] *= 1.0 - share
            weight[some] += each
        hit = np.flatnonzero(outside < 1.0)
        place = np.empty(len(targets), np.int64)
        place[hit] = np.arange(len(hit))
        found = []
        for k, part in enumerate(parts):
            left = outside[part[0]] < 1.0  # where two walls are as near, none may have a share
            some = part[0][left]
            each = part[3][left]
            row, source, carrier = self._carriers(k, targets[some])
            carrier *= (each * (1.0 - outside[some]) / weight[some])[row]
            found.append((place[some[row]], source, carrier))
        rows, columns, values = map(np.concatenate, zip(*found, strict=True))
        arm = values[:, None] * (targets[hit[rows]] - self.places[columns])
        total, dim = self.places.shape
        count = len(hit)
        wide = (columns[:, None] * dim + np.arange(dim)).reshape(-1)
        by_rotation = (arm.reshape(-1), (np.repeat(rows, dim), wide))
        return (
            hit,
            1.0 - outside[hit, None],
            csr_array((values, (rows, columns)), shape=(count, total)),
            csr_array(by_rotation, shape=(count, total * dim)),
        )

    def _reached(self, k: int, targets: FloatArray) -> Reached:
        """Return the points (m, d) in the zone of wall k; weights without shares."""
        wall = self.walls[k][0]
        tree, closest = self._trees[k]
        images = tree.n // len(wall.first)
        count = min(ALIKE, tree.n)
        heights = np.append(np.tile(wall.first, images), 0.0)
        height = np.full(len(targets), -1.0)
        depths = np.append(np.tile(wall.thickness, images), 0.0)
        depth = np.ones(len(targets))
        size = row_norms(np.ptp(closest.corners, axis=1)).max(initial=0.0)
        reach = float(np.hypot(heights.max() + depths.max(), CORNER * size))

        def find(part: slice) -> None:
            gap, index = tree.query(targets[part], k=count, distance_upper_bound=reach)
            gap = np.reshape(gap, (-1, count))
            index = np.reshape(index, (-1, count))
            alike = gap <= (1.0 + 1e-9) * gap[:, :1]
            highest = np.where(alike, heights[index], 0.0).max(axis=1)
            height[part] = np.where(np.isfinite(gap[:, 0]), highest, -1.0)
            near = np.clip(gap, TINY, 1.0 / TINY)
            weight = (near[:, :1] / near) ** POWER
            weight *= _faded(near, np.isfinite(gap), count < tree.n)
            depth[part] = (weight * depths[index]).sum(axis=1) / weight.sum(axis=1)

        in_parts(find, len(targets))
        some = np.flatnonzero(height >= 0.0)
        gap = row_norms(closest.query(targets[some]) - targets[some])
        inside = gap < height[some] + depth[some]
        some = some[inside]
        gap = gap[inside]
        share = 1.0 - smooth((gap - height[some]) / depth[some])
        limit = height[some] + depth[some]
        gap = np.maximum(gap, np.maximum(1e-9 * limit, TINY))
        return some, gap, share, (limit / gap) ** POWER

    def _carriers(self, k: int, targets: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return which points (m, d) which sources of wall k carry, and their weights, all (c,)."""
        tree = self._trees[k][0]
        begins = self.walls[k][1]
        count = min(CANDIDATES, tree.n)
        facets = self.offsets[begins]
        nearest = np.empty((len(targets), count), np.int64)
        weight = np.empty((len(targets), count))

        def find(part: slice) -> None:
            gap, index = tree.query(targets[part], k=count)
            gap = np.reshape(gap, (-1, count))
            index = np.reshape(index, (-1, count))
            seen = self._seen(targets[part], begins[index], (facets[index], facets[index + 1]))
            seen[~(seen > 0.0).any(axis=1)] = 1.0
            gap = np.maximum(gap, TINY)
            w = seen * (gap[:, :1] / gap) ** POWER * _faded(gap, seen > 0.0, count < tree.n)
            nearest[part] = index
            weight[part] = w / w.sum(axis=1, keepdims=True)

        in_parts(find, len(targets))
        point, column = np.nonzero(weight)
        node = nearest[point, column]
        sides = begins[node + 1] - begins[node]
        source = ranges(begins[node], sides)
        carrier = np.repeat(weight[point, column], sides)
        point = np.repeat(point, sides)
        edge = np.flatnonzero(np.repeat(sides > 1, sides))
        # Of the sides of an edge, those that see the point carry it.
        own = source[edge, None]
        seen = self._seen(targets[point[edge]], own, (self.offsets[own], self.offsets[own + 1]))
        group = np.repeat(np.arange(len(node)), sides)[edge]
        total = np.bincount(group, seen[:, 0], len(node))[group]
        alike = 1.0 / sides[group]
        carrier[edge] *= np.where(
            total > 0.0, seen[:, 0] / np.where(total > 0.0, total, 1.0), alike
        )
        return point, source, carrier

    def _seen(
        self, targets: FloatArray, source: IntArray, facets: tuple[IntArray, IntArray]
    ) -> FloatArray:
        """Return how well sources (m, c) see points (m, d): from 0, not at all, to 1.

        ``facets``: begins and ends (m, c) of the normals of each among ``normals``.
        """
        cosine = np.empty(source.shape)
        _largest_cosines(targets, self.places, source, *facets, self.normals, cosine)
        return smooth((cosine + GRAZING) / (2.0 * GRAZING))


@njit
def _largest_cosines(targets, places, source, begin, end, normals, out):  # type: ignore[no-untyped-def]
    """Write the cosines (m, c) of the angle from sources (m, c) to points (m, d), and a normal.

    Of the normals ``begin`` to ``end`` (m, c) of each source, the nearest one.
    """
    for m in range(len(source)):
        for c in range(source.shape[1]):
            s = source[m, c]
            largest = -np.inf
            squared = 0.0
            for d in range(targets.shape[1]):
                squared += (targets[m, d] - places[s, d]) ** 2
            for k in range(begin[m, c], end[m, c]):
                along = 0.0
                for d in range(targets.shape[1]):
                    along += (targets[m, d] - places[s, d]) * normals[k, d]
                largest = max(largest, along)
            out[m, c] = largest / max(np.sqrt(squared), TINY)


def _shared(parts: list[Reached]) -> list[Reached]:
    """Return the parts of the walls with less share where another wall is as near, or nearer."""
    size = [len(part[0]) for part in parts]
    point, gap, share, each = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(point, kind="stable")
    left = np.ones(len(point))
    apart = 1
    while len(at := np.flatnonzero(point[order[apart:]] == point[order[: len(order) - apart]])):
        one = order[at]
        two = order[at + apart]
        middle = gap[one] + gap[two]
        left[one] *= 1.0 - share[two] * smooth(2.0 * gap[one] / middle)
        left[two] *= 1.0 - share[one] * smooth(2.0 * gap[two] / middle)
        apart += 1
    share = share * left**2
    cuts = np.cumsum(size)[:-1]
    split = (np.split(x, cuts) for x in (point, gap, share, share * each))
    return list(zip(*split, strict=True))


def _faded(gap: FloatArray, seen: BoolArray, more: bool) -> FloatArray:
    """Return factors (m, c) that fall to 0 where the `NEAREST` nodes of those seen (m, c) end.

    So a node that enters or leaves them, or is one of several at one distance, changes nothing.
    ``gap`` (m, c) are ascending distances; ``more``: whether there are farther nodes.
    """
    beyond = np.where(np.cumsum(seen, axis=1) > NEAREST, gap, np.inf).min(axis=1)
    end = np.minimum(beyond, gap[:, -1] if more else np.inf)[:, None]
    out = np.clip(1.0 - gap / end, 0.0, 1.0) ** 2
    alike = ~(seen & (out > 0.0)).any(axis=1)  # all are equally far
    out[alike] = 1.0
    return out


def _directions(now: Array, facets: IntArray) -> Array:
    """Return a unit vector of each facet, (..., f, d): along it in 2D, its normal in 3D."""
    x = [take(now, facets[:, k]) for k in range(facets.shape[1])]
    return unit(x[1] - x[0] if len(x) == 2 else cross(x[2] - x[0], x[3] - x[1]))


def _outer(fixed: FloatArray, x: Array) -> Array:
    """Return the products (..., n, d d) of ``fixed`` (n, d), a constant, and x (..., n, d)."""

    def times(t: FloatArray) -> FloatArray:
        out = fixed[:, :, None] * t[..., None, :]
        return out.reshape(*out.shape[:-2], out.shape[-2] * out.shape[-1])

    def back(g: FloatArray) -> FloatArray:
        d = fixed.shape[1]
        return np.einsum("nb,...nba->...na", fixed, g.reshape(*g.shape[:-1], d, g.shape[-1] // d))

    return linear(x, times, back)


def wall_nodes(
    frame: Frame, coords: FloatArray, known: IntArray, walls: Sequence[Wall]
) -> WallNodes:
    """Return the nodes of walls.

    ``coords`` (n, d): undeformed, in the frame.
    ``known`` (a,): the nodes whose displacement is known: all of the walls' among them.
    """
    place = row_numbers(len(coords), known)
    shifts = [0, -1, 1] if np.any(frame.shift()) else [0]
    nodes = []
    facets = []
    rows = []
    parts = []
    corners = []
    first = begin = 0
    for wall in walls:
        most = int(wall.sides.max()) + 1
        keys, local = np.unique(wall.facets * most + wall.sides, return_inverse=True)
        some = keys // most
        local = local.reshape(wall.facets.shape)
        heads = np.flatnonzero(run_begins(some))
        if wall.moves:
            facets.append(first + local)
        images = np.concatenate([begin + k * len(some) + local for k in range(len(shifts))])
        size = len(shifts) * len(some)
        begins = [begin + k * len(some) + heads for k in range(len(shifts))]
        parts.append((wall, np.r_[(*begins, begin + size)], images))
        rows.append(np.tile(first + np.arange(len(some)), len(shifts)))
        corners.append(np.repeat(shifts, len(some)))
        nodes.append(some)
        first = first + len(some)
        begin = begin + size
    which = np.concatenate(nodes)
    by = np.concatenate(corners)
    origin = np.concatenate(rows)
    at = coords[which[origin]] + by[:, None] * frame.shift()
    sources = frame.points(at)
    images = np.concatenate([images for _, _, images in parts])
    at_corners = np.repeat(-corner_vectors(sources[images]), images.shape[1], axis=0)
    order = np.argsort(images, axis=None, kind="stable")
    none = np.empty((0, 2 if frame.dim == 2 else 4), np.int64)
    return WallNodes(
        frame=frame,
        known=place[which],
        start=frame.points(coords[which]),
        facets=np.concatenate([none, *facets]),
        walls=tuple(parts),
        origin=origin,
        turn=frame.turns(by) if frame.cylindrical and len(shifts) > 1 else None,
        places=sources,
        normals=unit_rows(at_corners[order]),
        offsets=offsets_of(np.bincount(images.reshape(-1), minlength=len(sources))),
    )


@frozen
class GaveWay:
    """A wall whose layers gave way."""

    names: tuple[str, ...]  # the boundaries that it consists of
    height: float  # the least height that is left, as a part of that before
    point: tuple[float, ...]  # the node of the layers that has it, Cartesian

    def __str__(self) -> str:
        """Return the same as a sentence."""
        names = " and ".join(self.names)
        where = point_words(self.point)
        return (
            f"the layers at {names} gave way, to {self.height:.3g} times their height at "
            f"({where}), since there is not enough room for them; leave more room, or write a "
            "smaller LAYER_MINIMUM_GAP to keep them longer"
        )


@frozen
class KeptLayers:
    """The layer zone of a run, for its report."""

    walls: tuple[tuple[tuple[str, ...], float], ...]
    """The boundaries of each connected wall, and the thickness of its zone, in the mesh's unit."""
    nodes: int  # nodes of the zone; of a streamed mesh those of its skin
    gave_way: tuple[GaveWay, ...] = ()

    def report(self) -> dict[str, Any]:
        """Return the same as values of JSON."""
        less = {one.names: {"height": one.height, "at": one.point} for one in self.gave_way}
        walls = [
            {"boundaries": names, "thickness": delta, "gave_way": less.get(names)}
            for names, delta in self.walls
        ]
        return {"walls": walls, "nodes": self.nodes}


@record
class LayerZone:
    """Nodes that go with walls, and how."""

    walls: WallNodes
    nodes: IntArray  # (z,): nodes in the zone
    start: FloatArray  # (z, d): their undeformed Cartesian points
    sliding: IntArray  # (k,): places of those that slide
    share: FloatArray
    by_displacement: csr_array
    by_rotation: csr_array
    """`share`, `by_displacement`, `by_rotation`: as `WallNodes.near` returns them."""

    def carried(self, motion: tuple[Array, Array]) -> Array:
        """Return b u, (..., z, d), by the ``motion`` of the walls (`WallNodes.motion`)."""
        moved, turned = motion
        return mixed(self.by_displacement, moved) + mixed(self.by_rotation, turned)

    def feet(self, moved: Array) -> Array:
        """Return b p, (..., z, d); ``moved``: displacement of the sources (`WallNodes.motion`)."""
        return mixed(self.by_displacement, self.walls.places + moved)

    def thinned(self, carried: Array, feet: Array, height: FloatArray) -> Array:
        """Return `carried` with a part ``height`` (z,) of the heights left; ``feet``: b p."""
        beside = multiply(self.share, self.start) - feet
        return multiply(carried + beside, height[:, None]) - beside

    @cached_property
    def strongest(self) -> IntArray:
        """Return the source (z,) that carries each node most."""
        carriers = self.by_displacement
        row = np.repeat(np.arange(len(self.nodes)), np.diff(carriers.indptr))
        last = np.lexsort((carriers.data, row))[carriers.indptr[1:] - 1]
        return carriers.indices[last].astype(np.int64)

    def lowered(self, height: FloatArray) -> FloatArray:
        """Return heights (z,) that are alike in a stack, and change gradually along the wall.

        Each wall node has the least of the ``height`` (z,) of the nodes that it carries most, and
        each node the mean of its wall nodes.
        """
        origin = self.walls.origin
        least = np.ones(len(self.walls.start))
        np.minimum.at(least, origin[self.strongest], height)
        out: FloatArray = self.by_displacement @ least[origin] / self.share[:, 0]
        return out

    def displacement(self, coords: Array, by: Array, carried: Array) -> Array:
        """Return the displacement (..., z, d) of the nodes of the zone in a step, in the frame.

        ``coords`` and ``by`` (..., z, d): their coordinates before the step, and their displacement
        in the step so far.
        ``carried`` (..., z, d): as `carried` returns it.
        """
        frame = self.walls.frame
        here = points(frame, coords + by)
        return by + difference_from(frame, here, multiply(self.start - here, self.share) + carried)

    @property
    def rigid(self) -> IntArray:
        """Return the nodes (r,) that walls carry nearly alone."""
        return self.nodes[self.share[:, 0] > RIGID]

    def summary(self, height: FloatArray | None, points: FloatArray) -> KeptLayers:
        """Return what a report says of the zone.

        ``height`` (z,): parts of the heights that are left; None: all of them are.
        ``points`` (n, d): where the nodes are.
        """
        walls = tuple((wall.names, float(wall.thickness.max())) for wall, *_ in self.walls.walls)
        gave_way = []
        if height is not None:
            low = (height < GIVEN) & (self.share[:, 0] > RIGID)
            for wall, begins, _ in self.walls.walls:
                mine = (begins[0] <= self.strongest) & (self.strongest < begins[-1])
                rows = np.flatnonzero(mine & low)
                if len(rows):
                    k = rows[np.argmin(height[rows])]
                    at = tuple(points[self.nodes[k]].tolist())
                    gave_way.append(GaveWay(wall.names, float(height[k]), at))
        return KeptLayers(walls, len(self.nodes), tuple(gave_way))


def find_zone(
    walls: WallNodes, nodes: IntArray, targets: FloatArray, slides: BoolArray
) -> LayerZone:
    """Return the zone of walls among ``nodes`` (m,) at ``targets`` (m, d); ``slides`` (m,) bool."""
    hit, share, by_displacement, by_rotation = walls.near(targets)
    sliding = np.flatnonzero(slides[hit])
    return LayerZone(walls, nodes[hit], targets[hit], sliding, share, by_displacement, by_rotation)
