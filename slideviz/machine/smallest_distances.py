"""Smallest distances between boundaries: the throats between blades, and the gaps at their tips.

Distances are measured between facets, not nodes. The distance from a surface changes at most as
much as a point moves. So a segment whose ends are at distances a and b has no point nearer than
(a + b - length) / 2. It is halved while that is nearer than the nearest point known (S. A.
Piyavskii, 1972; B. O. Shubert, 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.mesh.fans import components
from slideviz.mesh.model import FloatArray, IntArray, row_norms
from slideviz.mesh.topology import facet_edges
from slideviz.rbf.closest import ClosestPoints

RELATIVE = 1e-7  # a distance is found up to this part of it
MOST_ROUNDS = 40  # most halvings of a segment
MOST_SEGMENTS = 1_000
"""Most segments that are halved at a time: those that may have the nearest points. Where more could
have them, the surfaces are nearly parallel, and the distances of these hardly differ."""

Turn = Callable[[FloatArray, int], FloatArray]
"""A function that moves points (n, d) by a number of periods."""


class Nearest(NamedTuple):
    """The smallest distance between two surfaces: infinite, without points, if one is empty."""

    distance: float
    start: FloatArray
    end: FloatArray
    """`start`, `end` (d,): the points of the first and of the second surface."""


def nearest_on_segments(segments: FloatArray, surface: ClosestPoints) -> Nearest:
    """Return the smallest distance of segments (k, 2, d) from a surface."""
    dim = segments.shape[2]
    best = Nearest(np.inf, *np.full((2, dim), np.nan))

    def measured(at: FloatArray) -> FloatArray:
        nonlocal best
        near = surface.query(at)
        distance = row_norms(at - near)
        k = int(np.argmin(distance))
        if distance[k] < best.distance:
            best = Nearest(float(distance[k]), at[k], near[k])
        return distance

    if not len(segments) or not len(surface.corners):
        return best
    ends = measured(segments.reshape(-1, dim)).reshape(-1, 2)
    for _ in range(MOST_ROUNDS):
        length = row_norms(segments[:, 1] - segments[:, 0])
        bound = np.maximum((ends.sum(axis=1) - length) / 2.0, 0.0)
        keep = np.flatnonzero(bound < best.distance * (1.0 - RELATIVE))
        if not len(keep):
            break
        keep = keep[np.argsort(bound[keep], kind="stable")][:MOST_SEGMENTS]
        segments = segments[keep]
        ends = ends[keep]
        middle = segments.mean(axis=1)
        there = measured(middle)
        halves = np.stack([segments[:, 0], middle, middle, segments[:, 1]], axis=1)
        segments = halves.reshape(-1, 2, dim)
        ends = np.stack([ends[:, 0], there, there, ends[:, 1]], axis=1).reshape(-1, 2)
    return best


def smallest(first: FloatArray, second: FloatArray) -> Nearest:
    """Return the smallest distance between two surfaces that do not cross.

    ``first`` and ``second`` (t, c, d): corners of triangles (c = 3), or of lines (c = 2). Of two
    triangles it is between two edges, or between a corner and a triangle.
    """
    count = first.shape[1]
    sides = [first[:, [k, (k + 1) % count]] for k in range(count if count > 2 else 1)]
    found = nearest_on_segments(np.concatenate(sides), ClosestPoints(second))
    corners = np.repeat(second.reshape(-1, 1, second.shape[2]), 2, axis=1)
    back = nearest_on_segments(corners, ClosestPoints(first))
    return found if found.distance <= back.distance else Nearest(back[0], back.end, back.start)


def level_lines(corners: FloatArray, level: FloatArray, value: float) -> FloatArray:
    """Return the segments (k, 2, 3) in which triangles have a value.

    ``corners`` (t, 3, 3) and the numbers ``level`` (t, 3) at them, linear in between.
    """
    above = level >= value
    count = above.sum(axis=1)
    cut = np.flatnonzero((count > 0) & (count < 3))
    alone = np.where(count[cut, None] == 1, above[cut], ~above[cut]).argmax(axis=1)
    ends = []
    for other in (alone + 1) % 3, (alone + 2) % 3:
        low = level[cut, alone]
        high = level[cut, other]
        share = ((value - low) / (high - low))[:, None]
        ends.append((1.0 - share) * corners[cut, alone] + share * corners[cut, other])
    return np.stack(ends, axis=1)


def turned(corners: FloatArray, turn: Turn, by: int) -> FloatArray:
    """Return corners (t, c, d) moved by a number of periods."""
    return turn(corners.reshape(-1, corners.shape[2]), by).reshape(corners.shape)


@record
class Body:
    """A blade: connected facets, put together over the periodic sides where these cut it."""

    facets: IntArray
    """(t,): their indices."""
    turns: IntArray
    """(t,): by how many periods each is moved to be beside the others."""

    def placed(self, corners: FloatArray, turn: Turn, by: int = 0) -> FloatArray:
        """Return the body's corners (t, c, d) out of those of all facets, turned by periods."""
        out = corners[self.facets]
        for k in np.unique(self.turns[self.turns != -by]).tolist():
            out[self.turns == k] = turned(out[self.turns == k], turn, k + by)
        return out


def bodies(nodes: IntArray, sides: IntArray) -> list[Body]:
    """Return the bodies that facets make.

    Parameters
    ----------
    nodes : (t, c) int64
        The nodes of each facet.
    sides : (s, 2) int64
        Nodes at the first periodic side and their images one period on.

    Raises
    ------
    MeshError
        Facets meet their own image: they go around the machine, as a hub does.
    """
    used, local = np.unique(nodes, return_inverse=True)
    local = local.reshape(nodes.shape)
    part = components(len(used), *facet_edges(local).T)
    of_facet = part[local[:, 0]]
    # A part one period on meets another one where a node's image is a node of that.
    both = sides[np.isin(sides, used).all(axis=1) & (sides[:, 0] != sides[:, 1])]
    links = np.unique(part[np.searchsorted(used, both)].reshape(-1, 2), axis=0).tolist()
    turns: dict[int, int] = {}
    made = []
    for start in range(part.max(initial=-1) + 1):
        if start in turns:
            continue
        turns[start] = 0
        members = [start]
        waiting = [start]
        while waiting:
            now = waiting.pop()
            for low, high in links:
                for a, b, way in ((low, high, -1), (high, low, 1)):
                    if a == now and turns.setdefault(b, turns[a] + way) != turns[a] + way:
                        raise MeshError(
                            "the boundary continues through the periodic side, so it is not a "
                            "blade; name blades only"
                        )
                    if a == now and b not in members:
                        members.append(b)
                        waiting.append(b)
        facets = np.flatnonzero(np.isin(of_facet, members))
        made.append(Body(facets, np.array([turns[k] for k in of_facet[facets].tolist()])))
    return made


def neighbours(
    made: Sequence[Body], corners: FloatArray, turn: Turn, periods: Sequence[int]
) -> Iterator[FloatArray]:
    """Yield for each body the corners (u, c, d) of all others; empty without any.

    Others are the other bodies, and the images of all by ``periods``: 0, and one before and after
    where passages repeat.
    """
    for body in made:
        others = [
            other.placed(corners, turn, by)
            for other in made
            for by in periods
            if other is not body or by
        ]
        yield np.concatenate([corners[:0], *others])
