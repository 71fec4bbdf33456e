"""Metrics of faces by OpenFOAM's geometry (primitiveMeshTools), and expansion: compiled loops.

Loops work on ``LANES`` cells at a time, cells last, as in `slideviz.mesh.shape_loops`. A 2D mesh is
taken as one layer of prisms and hexahedra, with sides of height 1; front and back have no number.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.jacobians import (
    LANES,
    add3,
    column3,
    cross3,
    dot3,
    edge,
    gather,
    half_sum,
    minus3,
    row3,
    scaled3,
)
from slideviz.system.jit_cache import njit


@njit(inline="always")
def node(at, k, c):  # type: ignore[no-untyped-def]
    """Return the coordinates, a triple, of local node ``k`` of cell ``c``."""
    return at[0, k, c], at[1, k, c], at[2, k, c]


@njit
def _face(at, row, count, area, centre):  # type: ignore[no-untyped-def]
    """Write area vectors and centres of a face of cells into ``area`` and ``centre`` (3, …).

    ``row`` (4,) are its local nodes. A line is a rectangle of height 1. A quadrilateral is divided
    into triangles at the mean of its nodes, and its centre is the mean of theirs by area.
    """
    a, b, d, e = row
    for c in range(count):
        if d < 0:
            x = edge(at, a, b, c)
            area[0, c] = x[1]
            area[1, c] = -x[0]
            area[2, c] = 0.0
            for axis in range(3):
                centre[axis, c] = 0.5 * (at[axis, a, c] + at[axis, b, c])
        elif e < 0:
            normal = cross3(edge(at, a, b, c), edge(at, a, d, c))
            for axis in range(3):
                area[axis, c] = 0.5 * normal[axis]
                centre[axis, c] = (at[axis, a, c] + at[axis, b, c] + at[axis, d, c]) / 3.0
        else:
            x = half_sum(node(at, a, c), node(at, b, c))
            y = half_sum(node(at, d, c), node(at, e, c))
            middle = half_sum(x, y)
            total = 0.0
            sums = (0.0, 0.0, 0.0)
            moment = (0.0, 0.0, 0.0)
            p = node(at, e, c)
            for q in (node(at, a, c), node(at, b, c), node(at, d, c), p):
                normal = cross3(minus3(p, middle), minus3(q, middle))
                size = np.sqrt(dot3(normal, normal))
                total += size
                sums = add3(sums, normal)
                third = add3(add3(p, q), middle)
                moment = add3(moment, scaled3(size, third))
                p = q
            for axis in range(3):
                area[axis, c] = 0.5 * sums[axis]
                centre[axis, c] = moment[axis] / (3.0 * total) if total > 0.0 else middle[axis]


@njit
def write_centres(points, nodes, signs, polygons, centres, volumes):  # type: ignore[no-untyped-def]
    """Write centres (m, 3) and volumes (m,) of cells of one type; in 2D, areas.

    A cell is divided into pyramids on its faces, their tops at the mean of the faces' centres.
    """
    at = np.zeros((3, nodes.shape[1], LANES))
    areas, middles = np.empty((2, len(polygons), 3, LANES))
    for start in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - start)
        gather(points, nodes, start, count, at)
        for k in range(len(polygons)):
            _face(at, polygons[k], count, areas[k], middles[k])
        for c in range(count):
            top = (0.0, 0.0, 0.0)
            total = 0.0
            moment = (0.0, 0.0, 0.0)
            for k in range(len(polygons)):
                top = add3(top, column3(middles[k], c))
            top = top[0] / len(polygons), top[1] / len(polygons), top[2] / len(polygons)
            for k in range(len(polygons)):
                middle = column3(middles[k], c)
                area = column3(areas[k], c)
                volume = dot3(area, minus3(middle, top))
                total += volume
                centre = add3(scaled3(0.75, middle), scaled3(0.25, top))
                moment = add3(moment, scaled3(volume, centre))
            for axis in range(3):
                centres[start + c, axis] = moment[axis] / total if total != 0.0 else top[axis]
            volumes[start + c] = total / 3.0 * signs[start + c]
            if points.shape[1] == 2:
                volumes[start + c] = areas[0, 2, c] * signs[start + c]


@njit
def write_faces(points, nodes, ids, signs, sides, adjacent, rated, angle, skewness, expansion):  # type: ignore[no-untyped-def]
    """Write the worst values of the faces of cells of one type.

    ``nodes``, ``ids``, ``signs``: (m, n), (m,), (m,): nodes, numbers and directions of the cells.
    ``sides`` (f, 4): their sides: ``SIDE_NODES`` of the type.
    ``adjacent``: the arrays ``first`` and ``neighbour`` of `slideviz.mesh.adjacency.Sides`.
    ``rated``: (M, 3), (M,): centres and volumes of all cells, by `write_centres`.
    ``angle``, ``skewness``, ``expansion`` (M,): written, at ``ids``: non-orthogonality in degrees,
    skewness, ratio of volumes.
    """
    at = np.zeros((3, nodes.shape[1], LANES))
    area, middle, across = np.empty((3, 3, LANES))
    share = np.empty(LANES)
    ratio = np.empty(LANES)
    worst = np.empty((3, LANES))
    for start in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - start)
        cells = ids[start : start + count]
        gather(points, nodes, start, count, at)
        worst[0] = 1.0
        worst[1] = 0.0
        worst[2] = 1.0
        for k in range(len(sides)):
            _face(at, sides[k], count, area, middle)
            _across(cells, k, adjacent, rated, area, middle, across, share, ratio)
            for c in range(count):
                worst[2, c] = max(worst[2, c], ratio[c])
                s = column3(area, c)
                d = column3(across, c)
                scale = np.sqrt(dot3(d, d) * dot3(s, s))
                cosine = signs[start + c] * dot3(s, d) / scale if scale > 0.0 else 0.0
                worst[0, c] = min(worst[0, c], cosine if share[c] < 0.3 else 1.0)
            _raise_skewness(at, sides[k], cells, rated[0], area, middle, across, share, worst[1])
        for c in range(count):
            cosine = min(max(worst[0, c], -1.0), 1.0)
            angle[cells[c]] = np.degrees(np.arccos(cosine))
            skewness[cells[c]] = worst[1, c]
            expansion[cells[c]] = worst[2, c]


@njit
def _across(cells, k, adjacent, rated, area, middle, across, share, ratio):  # type: ignore[no-untyped-def]
    """Write what is across side ``k`` of ``cells`` (c,).

    The vector ``across`` (3, …) from centre to centre, its least share of the scale of skewness,
    and the ratio of the volumes. At a boundary the vector leads to the plane of the face.
    """
    first, neighbour = adjacent
    centres, volumes = rated
    for c in range(len(cells)):
        cell = cells[c]
        other = neighbour[first[cell] + k]
        if other >= 0:
            share[c] = 0.2
            here = volumes[cell]
            there = volumes[other]
            ratio[c] = max(here / there, there / here) if min(here, there) > 0.0 else np.inf
            for axis in range(3):
                across[axis, c] = centres[other, axis] - centres[cell, axis]
        else:
            share[c] = 0.4
            ratio[c] = 1.0
            through = 0.0
            square = 0.0
            for axis in range(3):
                through += area[axis, c] * (middle[axis, c] - centres[cell, axis])
                square += area[axis, c] * area[axis, c]
            for axis in range(3):
                across[axis, c] = through / square * area[axis, c] if square > 0.0 else 0.0


@njit
def _raise_skewness(at, row, cells, centres, area, middle, across, share, worst):  # type: ignore[no-untyped-def]
    """Raise ``worst`` (…) to the skewness of a face of ``cells`` (c,), local nodes ``row``."""
    v = np.empty((3, LANES))
    reach = np.zeros(LANES)
    for c in range(len(cells)):
        s = column3(area, c)
        d = column3(across, c)
        p = minus3(column3(middle, c), row3(centres, cells[c]))
        part = dot3(s, p) / dot3(s, d)
        v[0, c], v[1, c], v[2, c] = minus3(p, scaled3(part, d))
    for k in row:
        if k >= 0:
            for c in range(len(cells)):
                along = dot3(column3(v, c), minus3(node(at, k, c), column3(middle, c)))
                reach[c] = max(reach[c], abs(along))
    for c in range(len(cells)):
        s = column3(area, c)
        d = column3(across, c)
        square = dot3(column3(v, c), column3(v, c))
        length = np.sqrt(square)
        skewness = square / max(share[c] * length * np.sqrt(dot3(d, d)), reach[c])
        skewness = skewness if length > 0.0 else 0.0
        if dot3(s, d) == 0.0:
            skewness = np.inf if dot3(s, s) > 0.0 else 0.0
        worst[c] = max(worst[c], skewness)
