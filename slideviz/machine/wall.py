"""Walls of machines: profiles of surfaces of revolution, and contoured walls with holes closed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from slideviz.mesh.fans import components
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, row_norms
from slideviz.mesh.topology import (
    edge_keys,
    facet_edges,
    facet_vectors,
    single_edges,
    unit,
    vertex_normals,
)
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.projection import as_simplices

REVOLUTION = 0.02
"""A wall is a surface of revolution if its normals at nodes have a smaller component along theta,
as a root of the mean square: facets of a curved profile have some, too."""
APART = 1e-3  # least distance of points of a profile, as a part of its extent
ROUGH = 1e-6  # places count as equal up to this part of a length
STRAIGHT = 0.5  # least cosine of the bend of a profile at a point
FLAT = 1e-7  # a rim that is so narrow, as a part of its length, is of a blade without thickness

TURNED = 0.5
"""Largest component along theta of the normals of a wall about an axis, contoured ones too, as a
root of the mean square."""
PLANE = 1e-6  # part by which the sum of the facets' vectors of a flat wall may be shorter
RING = 0.1
OCTANTS = 8
"""A ring around the axis is in all octants, and its least radii there differ by no more than this
part of the largest of them."""


def turn_about_axis(local: FloatArray, walls: Sequence[IntArray]) -> bool:
    """Return whether walls have the z axis: they turn about it, and if all are flat, as rings.

    Flat walls alone, as those beside a wing, have no axis. ``local`` (n, 3): Cartesian, in the
    frame of the axis. ``walls``: facets (f, 4) of each.
    """
    for facets in walls:
        vectors = facet_vectors(local, facets)
        middles = local[facets].mean(axis=1)
        size = row_norms(vectors)
        across = vectors[:, 1] * middles[:, 0] - vectors[:, 0] * middles[:, 1]
        normal = size * np.hypot(middles[:, 0], middles[:, 1])
        along_theta = across / np.where(normal > 0.0, normal, 1.0)
        if np.sqrt(np.average(along_theta**2, weights=size)) > TURNED:
            return False
    curved = any(plane_normal(local, facets) is None for facets in walls)
    return curved or all(_is_ring(local[np.unique(facets)]) for facets in walls)


def plane_normal(points: FloatArray, facets: IntArray) -> FloatArray | None:
    """Return the unit normal (3,) of a flat wall, of either sign; None if it is not flat."""
    vectors = facet_vectors(points, facets)
    total = vectors.sum(axis=0)
    length = np.linalg.norm(total)
    return total / length if length >= (1.0 - PLANE) * row_norms(vectors).sum() else None


def _is_ring(local: FloatArray) -> bool:
    """Return whether nodes (n, 3) go around the z axis, with a rim inside that is a circle."""
    radius = np.hypot(local[:, 0], local[:, 1])
    theta = np.arctan2(local[:, 1], local[:, 0])
    octant = np.minimum((theta / np.pi + 1.0) * 0.5 * OCTANTS, OCTANTS - 1).astype(np.int64)
    least = np.full(OCTANTS, np.inf)
    np.minimum.at(least, octant, radius)
    return bool(np.isfinite(least).all() and np.ptp(least) <= RING * least.max())


def wall_profile(coords: FloatArray, facets: IntArray) -> FloatArray | None:
    """Return the profile of a surface of revolution, segments (k, 2, 2) in (z, r); else None.

    ``coords`` (n, 3): (z, r, rho theta). The profile goes through nodes at least `APART` from each
    other, in the order in which Prim's algorithm joins them to an end: each time the nearest one.
    """
    nodes, normals = vertex_normals(coords, facets)
    size = row_norms(normals)
    along_theta = normals[:, 2] / np.where(size > 0.0, size, 1.0)
    if np.sqrt(np.average(along_theta**2, weights=size)) > REVOLUTION:
        return None
    places = coords[nodes, :2]
    apart = APART * float(np.linalg.norm(np.ptp(places, axis=0)))
    places = places[_order(places, apart)]
    _, first = np.unique(np.round(places / (0.5 * apart)), axis=0, return_index=True)
    places = places[first]
    last = int(np.argmax(np.sum((places - places[0]) ** 2, axis=1)))
    away = np.full(len(places), np.inf)
    path = [places[last]]
    for _ in range(len(places) - 1):
        away = np.minimum(away, np.sum((places - places[last]) ** 2, axis=1))
        away[last] = np.inf
        places = np.delete(places, last, axis=0)
        away = np.delete(away, last)
        last = int(np.argmin(away))
        if np.sum((places[last] - path[-1]) ** 2) > apart**2:
            path.append(places[last])
    steps = unit(np.diff(path, axis=0))
    if len(path) < 2 or (np.sum(steps[1:] * steps[:-1], axis=1) < STRAIGHT).any():
        return None
    return np.stack([path[:-1], path[1:]], axis=1)


def closed_wall(
    coords: FloatArray, facets: IntArray, radius: float, period: float
) -> tuple[ClosestPoints, IntArray]:
    """Return a wall with the holes of blades closed, and with its images a period before and after.

    Also the triangles (t, 4) that close the holes, by their nodes, the last of which they repeat.
    ``coords`` (n, 3): (z, r, radius theta); ``facets`` (f, 4). The period is an angle in radians.
    """
    turn = 2.0 * np.pi * radius
    holes = np.concatenate([facets[:0], *_patches(coords, facets, turn)])
    corners = coords[np.concatenate([facets, holes])]
    # Facets may go across the end of theta's branch.
    corners[..., 2] -= turn * np.round((corners[..., 2] - corners[:, :1, 2]) / turn)
    shift = np.array([0.0, 0.0, radius * period])
    return ClosestPoints(as_simplices(corners), shift), holes


def _patches(coords: FloatArray, facets: IntArray, turn: float) -> Iterator[IntArray]:
    """Yield triangles (t, 4) of nodes that close each hole of a wall, such as that below a blade.

    They are Delaunay's, of the nodes of the hole's rim in the plane that fits these best, so they
    mostly go from one side of the blade to the other. A whole turn is ``turn`` long. The rims of a
    connected part that go round the axis, or else its longest one, are those of the wall itself.
    """
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import Delaunay

    edges = facet_edges(facets)
    single = edges[single_edges(edges)]
    part = components(len(coords), *edges.T)
    follows = dict(single[np.argsort(edge_keys(single))].tolist())
    rims = dict[int, list[tuple[FloatArray, IntArray]]]()
    around_axis = set[int]()
    while follows:
        start, node = follows.popitem()
        rim = [start]
        while node in follows:
            rim.append(node)
            node = follows.pop(node)
        steps = np.diff(coords[[*rim, start]], axis=0)
        steps[:, 2] -= turn * np.round(steps[:, 2] / turn)
        if node != start:
            continue
        if abs(steps[:, 2].sum()) > 0.5 * turn:
            around_axis.add(int(part[start]))
        else:
            first = _order(coords[rim], APART * turn)[0]
            places = coords[rim[first]] + np.cumsum(np.roll(steps, -first, axis=0), axis=0)
            nodes = np.roll(np.array(rim), -first - 1)
            rims.setdefault(int(part[start]), []).append((places, nodes))
    for number, several in rims.items():
        several.sort(key=lambda each: float(np.linalg.norm(np.ptp(each[0], axis=0))))
        for places, nodes in several if number in around_axis else several[:-1]:
            _, size, axes = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)
            if size[1] > FLAT * size[0]:  # else the blade has no thickness
                flat = places @ axes[:2].T
                triangles = Delaunay(flat).simplices
                inside = _inside(flat, flat[triangles].mean(axis=1))
                yield nodes[triangles[inside][:, [0, 1, 2, 2]]]


def _order(places: FloatArray, length: float) -> IntArray:
    """Return the order (n,) of places (n, k) by coordinates, however their nodes are numbered.

    Differences far below a length, such as those of rounding, count only where others vanish.
    """
    rough = np.round(places / (ROUGH * length))
    return np.lexsort([*places.T[::-1], *rough.T[::-1]])


def _inside(polygon: FloatArray, points: FloatArray) -> BoolArray:
    """Return which points (n, 2) are inside of a polygon (k, 2), by the crossings of a ray."""
    x, y = points.T[:, :, None]
    x0, y0 = polygon.T
    x1, y1 = np.roll(polygon, -1, axis=0).T
    meets = (y0 > y) != (y1 > y)
    at = x0 + (y - y0) * (x1 - x0) / np.where(y1 != y0, y1 - y0, 1.0)
    return (meets & (x < at)).sum(axis=1) % 2 == 1
