"""Metrics of faces by OpenFOAM's geometry (primitiveMeshTools), and expansion: compiled loops.

Loops work on ``LANES`` cells at a time, cells last, as in `slideviz.mesh.shape_loops`. A 2D mesh is
taken as one layer of prisms and hexahedra, with sides of height 1; front and back have no number.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.jacobians import LANES, OPTIONS, add3, cross3, dot3, edge, half_sum, minus3
from slideviz.mesh.shape_loops import gather3
from slideviz.system.jit_cache import njit


@njit(inline="always", **OPTIONS)
def node(at, k, c):  # type: ignore[no-untyped-def]
    """Return the coordinates, a triple, of local node ``k`` of cell ``c``."""
    return at[0, k, c], at[1, k, c], at[2, k, c]


@njit(**OPTIONS)
def _face(at, row, count, area, centre):  # type: ignore[no-untyped-def]
    """Write area vectors and centres of a face of cells into ``area`` and ``centre`` (3, …).

    ``row`` (4,) are its local nodes. A line is a rectangle of height 1. A quadrilateral is divided
    into triangles at the mean of its nodes, and its centre is the mean of theirs by area.
    """
    a, b, d, e = row
    for c in range(count):
        if d < 0:
            x = edge(at, a, b, c)
            area[0, c], area[1, c], area[2, c] = x[1], -x[0], 0.0
            for axis in range(3):
                centre[axis, c] = 0.5 * (at[axis, a, c] + at[axis, b, c])
        elif e < 0:
            normal = cross3(edge(at, a, b, c), edge(at, a, d, c))
            for axis in range(3):
                area[axis, c] = 0.5 * normal[axis]
                centre[axis, c] = (at[axis, a, c] + at[axis, b, c] + at[axis, d, c]) / 3.0
        else:
            x, y = (
                half_sum(node(at, a, c), node(at, b, c)),
                half_sum(node(at, d, c), node(at, e, c)),
            )
            middle = half_sum(x, y)
            total, sums, moment = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            p = node(at, e, c)
            for q in (node(at, a, c), node(at, b, c), node(at, d, c), p):
                normal = cross3(minus3(p, middle), minus3(q, middle))
                size = np.sqrt(dot3(normal, normal))
                total += size
                sums = add3(sums, normal)
                third = add3(add3(p, q), middle)
                moment = (
                    moment[0] + size * third[0],
                    moment[1] + size * third[1],
                    moment[2] + size * third[2],
                )
                p = q
            for axis in range(3):
                area[axis, c] = 0.5 * sums[axis]
                centre[axis, c] = moment[axis] / (3.0 * total) if total > 0.0 else middle[axis]


@njit(**OPTIONS)
def write_centres(points, nodes, signs, polygons, centres, volumes):  # type: ignore[no-untyped-def]
    """Write centres (m, 3) and volumes (m,) of cells of one type; in 2D, areas.

    A cell is divided into pyramids on its faces, their tops at the mean of the faces' centres.
    """
    at = np.empty((3, nodes.shape[1], LANES))
    areas, middles = np.empty((2, len(polygons), 3, LANES))
    for start in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - start)
        gather3(points, nodes, start, count, at)
        for k in range(len(polygons)):
            _face(at, polygons[k], count, areas[k], middles[k])
        for c in range(count):
            top, total, moment = (0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0)
            for k in range(len(polygons)):
                top = add3(top, (middles[k, 0, c], middles[k, 1, c], middles[k, 2, c]))
            top = top[0] / len(polygons), top[1] / len(polygons), top[2] / len(polygons)
            for k in range(len(polygons)):
                middle = middles[k, 0, c], middles[k, 1, c], middles[k, 2, c]
                area = areas[k, 0, c], areas[k, 1, c], areas[k, 2, c]
                volume = dot3(area, minus3(middle, top))
                total += volume
                moment = (
                    moment[0] + volume * (0.75 * middle[0] + 0.25 * top[0]),
                    moment[1] + volume * (0.75 * middle[1] + 0.25 * top[1]),
                    moment[2] + volume * (0.75 * middle[2] + 0.25 * top[2]),
                )
            for axis in range(3):
                centres[start + c, axis] = moment[axis] / total if total != 0.0 else top[axis]
            volumes[start + c] = total / 3.0 * signs[start + c]
            if points.shape[1] == 2:
                volumes[start + c] = areas[0, 2, c] * signs[start + c]


@njit(**OPTIONS)
def write_faces(points, nodes, ids, signs, sides, adjacent, rated, angle, skewness, expansion):  # type: ignore[no-untyped-def]
    """Write the worst values of the faces of cells of one type.

    Parameters
    ----------
    nodes, ids, signs
        (m, n), (m,), (m,): nodes, numbers and directions of the cells.
    sides : (f, 4)
        Their sides: ``SIDE_NODES`` of the type.
    adjacent
        The arrays ``first`` and ``neighbour`` of `slideviz.mesh.adjacency.Sides`.
    rated
        (M, 3), (M,): centres and volumes of all cells, by `write_centres`.
    angle, skewness, expansion : (M,)
        Written, at ``ids``: non-orthogonality in degrees, skewness, ratio of volumes.
    """
    (first, neighbour), (centres, volumes) = adjacent, rated
    at = np.empty((3, nodes.shape[1], LANES))
    area, middle = np.empty((2, 3, LANES))
    for start in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - start)
        gather3(points, nodes, start, count, at)
        for c in range(count):
            cell = ids[start + c]
            angle[cell], skewness[cell], expansion[cell] = 1.0, 0.0, 1.0
        for k in range(len(sides)):
            _face(at, sides[k], count, area, middle)
            for c in range(count):
                cell = ids[start + c]
                other = neighbour[first[cell] + k]
                s = area[0, c], area[1, c], area[2, c]
                f = middle[0, c], middle[1, c], middle[2, c]
                p = minus3(f, (centres[cell, 0], centres[cell, 1], centres[cell, 2]))
                size = np.sqrt(dot3(s, s))
                if other >= 0:
                    d = (
                        centres[other, 0] - centres[cell, 0],
                        centres[other, 1] - centres[cell, 1],
                        centres[other, 2] - centres[cell, 2],
                    )
                    least = 0.2 * np.sqrt(dot3(d, d))
                    scale = 5.0 * least * size
                    cosine = signs[start + c] * dot3(s, d) / scale if scale > 0.0 else 0.0
                    angle[cell] = min(angle[cell], cosine)
                    here, there = volumes[cell], volumes[other]
                    ratio = max(here / there, there / here) if min(here, there) > 0.0 else np.inf
                    expansion[cell] = max(expansion[cell], ratio)
                else:
                    along = dot3(s, p) / (size * size) if size > 0.0 else 0.0
                    d = along * s[0], along * s[1], along * s[2]
                    least = 0.4 * np.sqrt(dot3(d, d))
                skewness[cell] = max(skewness[cell], _skewness(at, sides[k], c, s, f, p, d, least))
        for c in range(count):
            cell = ids[start + c]
            angle[cell] = np.degrees(np.arccos(min(max(angle[cell], -1.0), 1.0)))


@njit(inline="always", **OPTIONS)
def _skewness(at, row, c, s, f, p, d, least):  # type: ignore[no-untyped-def]
    """Return the skewness of a face with area vector ``s`` and centre ``f``.

    ``p`` leads from the cell's centre to that of the face, ``d`` to the neighbour's centre; the
    scale is at least ``least``.
    """
    through = dot3(s, d)
    if through == 0.0:
        return np.inf if dot3(s, s) > 0.0 else 0.0
    part = dot3(s, p) / through
    v = p[0] - part * d[0], p[1] - part * d[1], p[2] - part * d[2]
    length = np.sqrt(dot3(v, v))
    if length == 0.0:
        return 0.0
    for k in row:
        if k >= 0:
            least = max(least, abs(dot3(v, minus3(node(at, k, c), f))) / length)
    return length / least
