"""SU2's metrics of the median dual mesh, in compiled loops over nodes.

Source: SU2, CPhysicalGeometry::ComputeMeshQualityStatistics and CDualGrid. The face between the
control volumes of two nodes consists, in each cell at their edge, of triangles (2D: a line) from
the edge's middle to the means of the nodes of a side and of the cell.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobians import add3, cross3, dot3, minus3, row3, scaled3
from slideviz.system.jit_cache import njit


def _around_nodes(vtk: int) -> list[list[tuple[int, int, int]]]:
    """Return for each local node its edges: the other node, and the faces right and left of it.

    The right face of an edge is the left face of the next. In 2D, the second number is 1 or -1: the
    direction of the edge on the way around the cell.
    """
    row = ELEMENTS[vtk]
    if row.dim == 2:
        n = row.n_nodes
        return [[((k + 1) % n, 1, 0), ((k - 1) % n, -1, 0)] for k in range(n)]
    right = {(f[k - 1], f[k]): at for at, f in enumerate(row.facets) for k in range(len(f))}
    edges = []
    for k in range(row.n_nodes):
        face = next(at for (here, _), at in right.items() if here == k)
        ring = []
        for _ in [here for here, _ in right if here == k]:
            other = next(b for (a, b), at in right.items() if a == k and at == face)
            ring.append((other, face, right[other, k]))
            face = right[other, k]
        edges.append(ring)
    return edges


AROUND = np.full((256, 8, 4, 3), -1)
"""Edges at each local node of an element type, by VTK identifier: see `_around_nodes`."""
for _vtk, _row in ELEMENTS.items():
    for _k, _ring in enumerate(_around_nodes(_vtk) if _row.dim > 1 else ()):
        AROUND[_vtk, _k, : len(_ring)] = _ring


@njit
def write_middles(points, offsets, connectivity, begin, middles):  # type: ignore[no-untyped-def]
    """Write the means (m, 3) of the nodes of cells, from number ``begin`` on."""
    for i in range(len(middles)):
        first = offsets[begin + i]
        last = offsets[begin + i + 1]
        for axis in range(points.shape[1]):
            total = 0.0
            for k in range(first, last):
                total += points[connectivity[k], axis]
            middles[i, axis] = total / (last - first)


@njit(inline="always")
def _middle_of(points, connectivity, begin, side_nodes, vtk, side):  # type: ignore[no-untyped-def]
    """Return the mean, a triple, of the nodes of a side of the cell that begins at ``begin``."""
    a = row3(points, connectivity[begin + side_nodes[vtk, side, 0]])
    b = row3(points, connectivity[begin + side_nodes[vtk, side, 1]])
    c = row3(points, connectivity[begin + side_nodes[vtk, side, 2]])
    total = add3(add3(a, b), c)
    if side_nodes[vtk, side, 3] < 0:
        return total[0] / 3.0, total[1] / 3.0, total[2] / 3.0
    total = add3(total, row3(points, connectivity[begin + side_nodes[vtk, side, 3]]))
    return scaled3(0.25, total)


@njit
def write_nodes(points, mesh, tables, nodes, limits, begin, found):  # type: ignore[no-untyped-def]
    """Write SU2's three metrics of nodes from number ``begin`` on into ``found`` (3, k).

    Orthogonality in degrees, area ratio and volume ratio; NaN for nodes of no cell.
    ``points`` (N, 3): in 2D with third coordinates of zero.
    ``mesh``: types, offsets, connectivity, signs, and means of nodes (by `write_middles`) of all
    cells.
    ``tables``: `AROUND` and `slideviz.mesh.adjacency.SIDE_NODES`.
    ``nodes``: the arrays of `slideviz.mesh.adjacency.CellsAround`.
    ``limits`` (N, 2): smallest and largest area of a boundary at each node; inf and 0 without one.
    """
    types, offsets, connectivity, signs, middles = mesh
    around, side_nodes = tables
    starts, cells, local = nodes
    most = 0
    for i in range(found.shape[1]):
        most = max(most, starts[begin + i + 1] - starts[begin + i])
    others = np.empty(4 * most, np.int64)
    normals = np.empty((4 * most, 3))
    for i in range(found.shape[1]):
        k = begin + i
        x = row3(points, k)
        count = 0
        small = np.inf
        large = 0.0
        for entry in range(starts[k], starts[k + 1]):
            cell = cells[entry]
            at = local[entry]
            first = offsets[cell]
            vtk = types[cell]
            flat = vtk < 10
            sign = float(signs[cell])
            to_middle = minus3(row3(middles, cell), x)
            start = x
            if not flat:
                side = around[vtk, at, 0, 1]
                start = minus3(_middle_of(points, connectivity, first, side_nodes, vtk, side), x)
            face = start
            across = cross3(start, to_middle)
            for ray in range(4):
                if around[vtk, at, ray, 0] < 0:
                    break
                other = connectivity[first + around[vtk, at, ray, 0]]
                turn = around[vtk, at, ray, 1]
                half = scaled3(0.5, minus3(row3(points, other), x))
                inward = minus3(to_middle, half)
                if flat:
                    normal = turn * inward[1], -turn * inward[0], 0.0
                    size = 0.5 * abs(half[0] * to_middle[1] - half[1] * to_middle[0])
                    small = min(small, size)
                    large = max(large, size)
                else:
                    side = around[vtk, at, ray, 2]
                    after = start
                    if side != around[vtk, at, 0, 1]:
                        after = _middle_of(points, connectivity, first, side_nodes, vtk, side)
                        after = minus3(after, x)
                    normal = scaled3(0.5, cross3(inward, minus3(face, after)))
                    before = across
                    across = cross3(after, to_middle)
                    for one in (before, across):
                        size = abs(dot3(half, one))  # six times the volume: ratios are wanted
                        small = min(small, size)
                        large = max(large, size)
                    face = after
                place = 0
                while place < count and others[place] != other:
                    place += 1
                if place == count:
                    others[place] = other
                    count = count + 1
                    normals[place, 0] = normals[place, 1] = normals[place, 2] = 0.0
                for axis in range(3):
                    normals[place, axis] += sign * normal[axis]
        found[0, i], found[1, i] = _of_edges(points, x, others[:count], normals, limits[k])
        found[2, i] = large / small if count else np.nan


@njit
def _of_edges(points, x, others, normals, limits):  # type: ignore[no-untyped-def]
    """Return orthogonality and area ratio of a node at ``x`` with edges to ``others``."""
    total = 0.0
    weighted = 0.0
    small = limits[0]
    large = limits[1]
    for place in range(len(others)):
        normal = row3(normals, place)
        along = minus3(row3(points, others[place]), x)
        size = np.sqrt(dot3(normal, normal))
        scale = size * np.sqrt(dot3(along, along))
        cosine = min(max(dot3(normal, along) / scale, -1.0), 1.0) if scale > 0.0 else 0.0
        total += size
        weighted += size * (90.0 - np.degrees(np.arccos(cosine)))
        small = min(small, size)
        large = max(large, size)
    if len(others) == 0:
        return np.nan, np.nan
    return weighted / total if total > 0.0 else 0.0, large / small if small > 0.0 else np.inf
