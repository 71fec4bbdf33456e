"""Metrics that need one cell only: scaled Jacobian, angles, aspect ratio, in compiled loops.

As in `slideviz.mesh.jacobians`, loops work on ``LANES`` cells at a time, cells last. 2D cells get a
third coordinate of zero.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.elements import ELEMENTS, Nodes
from slideviz.mesh.jacobians import LANES, add3, column3, cross3, dot3, edge, gather
from slideviz.mesh.model import IntArray
from slideviz.system.jit_cache import njit
from slideviz.terms import Metric

SHAPES: tuple[Metric, ...] = (
    "scaled-jacobian",
    "equiangle-skew",
    "smallest-angle",
    "largest-angle",
    "aspect-ratio",
)
"""The metrics that `write_shapes` writes, in that order."""


def _filled(rows: Nodes, width: int) -> IntArray:
    return np.array([[*row, *[-1] * (width - len(row))] for row in rows])


CORNERS = {vtk: _filled(row.corners, 4) for vtk, row in ELEMENTS.items() if row.corners}
"""(k, 4): a corner and its two or three neighbours, by VTK identifier."""
EDGES = {vtk: np.array(row.edges) for vtk, row in ELEMENTS.items() if row.edges}
"""(e, 2): the local nodes of the edges, by VTK identifier."""
POLYGONS = {
    vtk: _filled((tuple(range(row.n_nodes)),) if row.dim == 2 else row.facets, 4)
    for vtk, row in ELEMENTS.items()
    if row.dim > 1
}
"""(f, 4): the local nodes of the faces of a cell, in 2D of the cell itself, by VTK identifier."""


@njit
def write_shapes(vtk, points, nodes, signs, corners, edges, polygons, found):  # type: ignore[no-untyped-def]
    """Write the metrics of `SHAPES` of cells of one type into ``found`` (5, m).

    ``nodes`` are (m, n), ``signs`` (m,) are -1 for cells that are numbered the other way round; the
    tables are those of this module.
    """
    at = np.zeros((3, nodes.shape[1], LANES))
    lengths = np.empty((nodes.shape[1], nodes.shape[1], LANES))
    angles = np.empty((4, LANES))
    ends = np.empty((2, LANES))
    for start in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - start)
        here = slice(start, start + count)
        gather(points, nodes, start, count, at)
        _lengths(at, edges, count, lengths, ends)
        _scaled_jacobians(vtk, at, corners, count, lengths, found[0, here])
        _angles(at, polygons, count, lengths, angles)
        for c in range(count):
            found[0, start + c] *= signs[start + c]
            found[1, start + c] = _equiangle_skew(angles, c)
            found[2, start + c] = _degrees(min(angles[0, c], angles[2, c]))
            found[3, start + c] = _degrees(max(angles[1, c], angles[3, c]))
            found[4, start + c] = ends[1, c] / ends[0, c] if ends[0, c] > 0.0 else np.inf


@njit
def _lengths(at, edges, count, lengths, ends):  # type: ignore[no-untyped-def]
    """Write the lengths of edges, between any two nodes, and their ``ends`` (min, max)."""
    ends[0] = np.inf
    ends[1] = 0.0
    for a, b in edges:
        for c in range(count):
            along = edge(at, a, b, c)
            length = np.sqrt(dot3(along, along))
            lengths[a, b, c] = lengths[b, a, c] = length
            ends[0, c], ends[1, c] = min(ends[0, c], length), max(ends[1, c], length)


@njit
def _scaled_jacobians(vtk, at, corners, count, lengths, found):  # type: ignore[no-untyped-def]
    """Write Verdict's scaled Jacobians (count,); 0 where an edge has no length.

    The least, over the corners, of the Jacobian over the lengths of the edges there; triangles and
    tetrahedra have one Jacobian, over the largest such product. A pyramid is rated by the
    tetrahedra at the corners of its base, a hexahedron at its middle, too.
    """
    found[:] = np.inf
    for row in corners:
        o, i, j, h = row
        for c in range(count):
            x = edge(at, o, i, c)
            y = edge(at, o, j, c)
            normal = cross3(x, y)
            if h < 0:
                jacobian = normal[2]
                scale = lengths[o, i, c] * lengths[o, j, c]
                if vtk == 5:
                    scale = max(scale, lengths[i, j, c] * max(lengths[o, i, c], lengths[o, j, c]))
            else:
                jacobian = dot3(normal, edge(at, o, h, c))
                a = lengths[o, i, c]
                b = lengths[o, j, c]
                d = lengths[o, h, c]
                scale = a * b * d
                if vtk == 10 or vtk == 14:
                    across = edge(at, i, j, c)
                    p = lengths[i, h, c]
                    q = lengths[j, h, c]
                    r = np.sqrt(dot3(across, across))
                    scale = max(scale, a * p * r, b * q * r, d * p * q)
            found[c] = min(found[c], jacobian / scale if scale > 0.0 else 0.0)
    ideal = 1.0
    if vtk == 5 or vtk == 13:
        ideal = np.sqrt(3.0) / 2.0
    elif vtk == 10:
        ideal = np.sqrt(0.5)
    elif vtk == 14:
        ideal = 0.5
    elif vtk == 12:
        _scaled_in_the_middle(at, count, found)
    for c in range(count):
        found[c] = min(found[c] / ideal, 1.0)


@njit
def _scaled_in_the_middle(at, count, found):  # type: ignore[no-untyped-def]
    """Lower ``found`` (count,) to the scaled Jacobian in the middle of hexahedra, if smaller."""
    for c in range(count):
        x = (0.0, 0.0, 0.0)
        y = (0.0, 0.0, 0.0)
        z = (0.0, 0.0, 0.0)
        for k in range(4):
            e = edge(at, (0, 3, 4, 7)[k], (1, 2, 5, 6)[k], c)
            f = edge(at, (0, 1, 4, 5)[k], (3, 2, 7, 6)[k], c)
            g = edge(at, k, k + 4, c)
            x = add3(x, e)
            y = add3(y, f)
            z = add3(z, g)
        scale = np.sqrt(dot3(x, x) * dot3(y, y) * dot3(z, z))
        found[c] = min(found[c], dot3(cross3(x, y), z) / scale if scale > 0.0 else 0.0)


@njit
def _angles(at, polygons, count, lengths, angles):  # type: ignore[no-untyped-def]
    """Write least and largest angle of triangles, then of quadrilaterals, into ``angles`` (4, …).

    An angle is given by a number that rises with it, from 0 for 0° to 4 for 360° (`_degrees`), to
    spare the arc cosines. An edge without length makes angles of 0.
    """
    angles[0] = np.inf
    angles[1] = -np.inf
    angles[2] = np.inf
    angles[3] = -np.inf
    normal = np.empty((3, LANES))
    for row in polygons:
        a, b, d, e = row
        n = 4 if e >= 0 else 3
        if n == 4:
            for c in range(count):
                normal[0, c], normal[1, c], normal[2, c] = cross3(
                    edge(at, a, d, c), edge(at, b, e, c)
                )
        least, largest = (angles[2], angles[3]) if n == 4 else (angles[0], angles[1])
        for k in range(n):
            o = row[k]
            i = row[(k + 1) % n]
            j = row[k - 1 if k else n - 1]
            for c in range(count):
                x = edge(at, o, i, c)
                y = edge(at, o, j, c)
                scale = lengths[o, i, c] * lengths[o, j, c]
                cosine = dot3(x, y) / scale if scale > 0.0 else 1.0
                angle = min(max(1.0 - cosine, 0.0), 2.0)
                if n == 4:
                    turn = dot3(column3(normal, c), cross3(x, y))
                    angle = angle if turn >= 0.0 else 4.0 - angle
                least[c] = min(least[c], angle)
                largest[c] = max(largest[c], angle)


@njit(inline="always")
def _degrees(angle):  # type: ignore[no-untyped-def]
    """Return the angle in degrees that a number of `_angles` stands for."""
    half = np.degrees(np.arccos(1.0 - (angle if angle <= 2.0 else 4.0 - angle)))
    return half if angle <= 2.0 else 360.0 - half


@njit(inline="always")
def _equiangle_skew(angles, c):  # type: ignore[no-untyped-def]
    """Return the equiangle skew, at most 1, of cell ``c`` with angles as of `_angles`."""
    worst = 0.0
    for low, ideal in ((0, 60.0), (2, 90.0)):
        if angles[low, c] <= angles[low + 1, c]:
            least = _degrees(angles[low, c])
            most = _degrees(angles[low + 1, c])
            worst = max(worst, (most - ideal) / (180.0 - ideal), (ideal - least) / ideal)
    return min(worst, 1.0)
