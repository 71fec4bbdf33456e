"""Corner Jacobians and Bernstein coefficients of the Jacobian determinant of cells, compiled.

Arrays here have the cells last, ``(..., m)``, so that every inner loop runs over contiguous memory
and is vectorised. In compiled functions m is ``LANES``, of which ``count`` are in use. ``coords``
(3, n, m) are the coordinates of the n nodes of m cells of one type; cells in a plane have third
coordinates of zero, and (0, 0, 1) as the third edge at a corner. ``table`` is ``CORNERS[vtk]``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Signs
from slideviz.system.jit_cache import njit
from slideviz.terms import CELL_STATES

if TYPE_CHECKING:
    from slideviz.mesh.model import FloatArray, Mesh

LEVELS = 6  # how often a hexahedron is cut before it is called unproven

Status = NDArray[np.uint8]  # codes (m,) VALID, INVERTED or UNPROVEN


def decide_unproven(vtk: int, coords: FloatArray, signs: Signs) -> Status:
    """Return the status (m,) of cells with positive corner Jacobians, but not all coefficients.

    They are prisms or hexahedra with nodes ``coords`` (3, n, m). ``signs`` (m,) are 1, or -1 for a
    cell that is numbered the other way round.
    """
    if vtk == 12:
        return subdivide(coefficients(12, coords).reshape(3, 3, 3, -1) * signs)
    low, middle, top = coefficients(13, coords).reshape(3, 3, -1) * signs
    # A quadratic with these coefficients has minimum zero if middle = -√(low · top).
    product = low * top  # negative by rounding only
    positive = (product >= 0) & (middle + np.sqrt(np.maximum(product, 0.0)) > 0)
    return np.where(positive.all(axis=0), VALID, INVERTED).astype(np.uint8)


def subdivide(coefficients: FloatArray, levels: int = LEVELS) -> Status:
    """Return the status (m,) of triquadratic polynomials with Bézier coefficients (3, 3, 3, m).

    ``VALID`` means positive in the whole unit cube. The cube is cut into eight parts, ``levels``
    times. A polynomial is positive in a part if all its coefficients there are positive. Corner
    coefficients are values of the polynomial: if one is not positive, the status is ``INVERTED``.
    """
    status = np.empty(coefficients.shape[-1], np.uint8)
    _write_status(np.ascontiguousarray(np.moveaxis(coefficients, -1, 0)), levels, status)
    return status


@njit
def _write_status(polynomials, levels, status):  # type: ignore[no-untyped-def]
    left = np.empty((7 * levels + 1, 3, 3, 3))  # parts that are still to be cut
    depth = np.zeros(len(left), np.int64)
    halves = np.empty((5, 5, 5))
    for p in range(len(polynomials)):
        status[p] = VALID
        left[0] = polynomials[p]
        depth[0] = 0
        count = 1
        while count > 0 and status[p] != INVERTED:
            count -= 1
            level = depth[count] + 1
            if level > levels:
                status[p] = UNPROVEN
                continue
            _halve(left[count], halves)
            if not (halves[::2, ::2, ::2] > 0.0).all():
                status[p] = INVERTED
                continue
            for i in range(0, 3, 2):
                for j in range(0, 3, 2):
                    for k in range(0, 3, 2):
                        part = halves[i : i + 3, j : j + 3, k : k + 3]
                        if not (part > 0.0).all():
                            left[count] = part
                            depth[count] = level
                            count += 1


@njit
def _halve(whole, out):  # type: ignore[no-untyped-def]
    """Write the coefficients (5, 5, 5) of a polynomial's eight parts, which share their sides."""
    out[::2, ::2, ::2] = whole
    for j in range(0, 5, 2):
        for k in range(0, 5, 2):
            _halve_line(out[:, j, k])
    for i in range(5):
        for k in range(0, 5, 2):
            _halve_line(out[i, :, k])
        for j in range(5):
            _halve_line(out[i, j])


@njit
def _halve_line(line):  # type: ignore[no-untyped-def]
    line[1] = 0.5 * (line[0] + line[2])
    line[3] = 0.5 * (line[2] + line[4])
    line[2] = 0.5 * (line[1] + line[3])


LANES = 64
"""Cells that a loop works on at a time, so that their arrays stay in the first-level cache."""

VALID, INVERTED, UNPROVEN = range(len(CELL_STATES))
"""Codes of a cell's status: its place in `slideviz.terms.CELL_STATES`."""

CORNERS = {vtk: np.array(row.corners, np.int64) for vtk, row in ELEMENTS.items() if row.corners}
"""``ElementType.corners`` (k, 3) in 2D, (k, 4) in 3D, by VTK identifier."""
CORNER_AT = {
    **{vtk: np.arange(len(table)) for vtk, table in CORNERS.items()},
    12: np.array([0, 18, 24, 6, 2, 20, 26, 8]),
    13: np.array([0, 1, 2, 6, 7, 8]),
}
"""Which coefficient is the Jacobian of each corner, by VTK identifier."""


def check_cells(mesh: Mesh) -> None:
    """Raise MeshError if a mesh has no cells, cells of another dimension, or nodes out of range."""
    if not len(mesh.cells):
        raise MeshError(f"{mesh.name} has no cells; a quality needs at least one")
    for vtk, (ids, _) in mesh.cells.by_type.items():
        row = ELEMENTS[vtk]
        if row.dim != mesh.dim:
            raise MeshError(
                f"cell {ids[0]} of {mesh.name} is a {row.name} (dimension {row.dim}), but the "
                f"mesh has dimension {mesh.dim}; keep only cells of the mesh's dimension"
            )
    flat = mesh.cells.connectivity
    if flat.min() < 0 or flat.max() >= len(mesh.points):
        wrong = (flat < 0) | (flat >= len(mesh.points))
        raise MeshError(
            f"{mesh.name} has {len(mesh.points)} points, but a cell has node "
            f"{flat[wrong.argmax()]} (counted from 0); node indices must be in that range"
        )


@njit
def gather(points, nodes, first, count, coords):  # type: ignore[no-untyped-def]
    """Write the coordinates of ``count`` cells, from number ``first`` on, into ``coords``.

    ``points`` are (N, d), ``nodes`` of the cells (m, n).
    """
    for c in range(count):
        for j in range(nodes.shape[1]):
            node = nodes[first + c, j]
            for axis in range(points.shape[1]):
                coords[axis, j, c] = points[node, axis]


@njit
def scatter(slope, first, count, out):  # type: ignore[no-untyped-def]
    """Write values (3, n, ...) of ``count`` cells, from number ``first`` on, into out (m, n, d)."""
    for c in range(count):
        for j in range(out.shape[1]):
            for axis in range(out.shape[2]):
                out[first + c, j, axis] = slope[axis, j, c]


@njit(inline="always")
def row3(points, k):  # type: ignore[no-untyped-def]
    """Return row ``k`` of points (n, 3), a triple."""
    return points[k, 0], points[k, 1], points[k, 2]


@njit(inline="always")
def edge(coords, start, stop, c):  # type: ignore[no-untyped-def]
    """Return the vector, a triple, from local node ``start`` to ``stop`` of cell ``c``."""
    return (
        coords[0, stop, c] - coords[0, start, c],
        coords[1, stop, c] - coords[1, start, c],
        coords[2, stop, c] - coords[2, start, c],
    )


@njit(inline="always")
def cross3(a, b):  # type: ignore[no-untyped-def]
    """Return the cross product of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def dot3(a, b):  # type: ignore[no-untyped-def]
    """Return the scalar product of two triples, added up in order."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(inline="always")
def half_sum(a, b):  # type: ignore[no-untyped-def]
    """Return the mean of two triples."""
    return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@njit(inline="always")
def add3(a, b):  # type: ignore[no-untyped-def]
    """Return the sum of two triples."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(inline="always")
def minus3(a, b):  # type: ignore[no-untyped-def]
    """Return the difference of two triples."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(inline="always")
def scaled3(s, a):  # type: ignore[no-untyped-def]
    """Return a number times a triple."""
    return s * a[0], s * a[1], s * a[2]


@njit(inline="always")
def column3(x, c):  # type: ignore[no-untyped-def]
    """Return the column of cell ``c`` of x (3, ...), a triple."""
    return x[0, c], x[1, c], x[2, c]


@njit(inline="always")
def corner_ends(corner):  # type: ignore[no-untyped-def]
    """Return the corner's node, those at the ends of its edges, and the third edge in a plane.

    Numbers of nodes are read before loops over cells, which are not vectorised else.
    """
    flat = len(corner) == 3
    return corner[0], corner[1], corner[2], corner[0 if flat else 3], 1.0 if flat else 0.0


@njit(inline="always")
def corner_edges(coords, ends, up, c):  # type: ignore[no-untyped-def]
    """Return the edges that leave a corner of cell ``c``; ``up`` is added to the third."""
    o, i, j, k, _ = ends
    last = edge(coords, o, k, c)
    return edge(coords, o, i, c), edge(coords, o, j, c), (last[0], last[1], last[2] + up)


@njit
def corners(coords, table, count, alpha):  # type: ignore[no-untyped-def]
    """Write the corner Jacobians (thesis Eq. 2.39 to 2.42, Table 2.3) into ``alpha`` (k, ...).

    They are the determinants of the edges that leave each corner. `jacobian_slopes` has their
    derivatives.
    """
    for k in range(len(table)):
        ends = corner_ends(table[k])
        for c in range(count):
            x, y, z = corner_edges(coords, ends, ends[4], c)
            alpha[k, c] = dot3(cross3(x, y), z)


@njit
def spreads(vtk, coords, table, count, spread):  # type: ignore[no-untyped-def]
    """Write the spread of each corner into ``spread`` (k, ...).

    The skew compares the corner Jacobian with it; `slideviz.mesh.skew` defines it for each type,
    `jacobian_slopes` has its derivatives.
    """
    for k in range(len(table)):
        ends = corner_ends(table[k])
        for c in range(count):
            x, y, z = corner_edges(coords, ends, ends[4], c)
            xx = dot3(x, x)
            yy = dot3(y, y)
            zz = dot3(z, z)
            if vtk == 5:
                spread[k, c] = xx + yy - dot3(x, y)
            elif vtk == 10:
                squares = 1.5 * (xx + yy + zz)
                spread[k, c] = squares - dot3(x, y) - dot3(y, z) - dot3(z, x)
            elif vtk == 14:
                half = half_sum(x, y)
                axis = minus3(z, half)
                spread[k, c] = xx + yy + 2 * dot3(axis, axis)
            else:
                spread[k, c] = np.sqrt(xx * yy * zz)


@njit
def write_prism(coords, count, out):  # type: ignore[no-untyped-def]
    """Write the Bernstein coefficients of det J of prisms into ``out`` (3, 3, ...).

    The determinant is linear over the triangle and quadratic along the height: the entry
    ``[c, i]`` is coefficient c of the quadratic above corner i. Entries 0 and 2 are the corner
    Jacobians, and the volume is the sum of all, divided by 18.
    """
    for c in range(count):
        a = edge(coords, 0, 1, c)
        b = edge(coords, 0, 2, c)
        p = edge(coords, 3, 4, c)
        q = edge(coords, 3, 5, c)
        low = cross3(a, b)
        top = cross3(p, q)
        middle = half_sum(cross3(a, q), cross3(p, b))
        for i in range(3):
            height = edge(coords, i, i + 3, c)
            out[0, i, c] = dot3(low, height)
            out[1, i, c] = dot3(middle, height)
            out[2, i, c] = dot3(top, height)


NODE = np.array([[[0, 4], [3, 7]], [[1, 5], [2, 6]]])
"""Node of a hexahedron by its parameters (i, j, k), each 0 or 1."""


@njit
def write_hexahedron(coords, count, out):  # type: ignore[no-untyped-def]
    """Write the Bézier coefficients of det J of hexahedra into ``out`` (3, 3, 3, ...).

    The derivatives along u, v and w are bilinear, with the twelve edges as coefficients; so the
    coefficient (a, b, c) of their triple product, which is quadratic in each parameter, is the
    mean of the triple products of edges u[j, k], v[i, k'], w[i', j'] with i + i' = a,
    j + j' = b and k + k' = c. No subtraction is left, hence no cancellation either. The corner
    coefficients are the corner Jacobians, and the mean of all is the volume (A. Johnen,
    J.-F. Remacle, C. Geuzaine, Geometrical validity of curvilinear finite elements, 2013).
    """
    out[:] = 0.0
    for i in range(2):
        for j in range(2):
            for c in range(count):
                u0 = edge(coords, NODE[0, j, 0], NODE[1, j, 0], c)
                u1 = edge(coords, NODE[0, j, 1], NODE[1, j, 1], c)
                v0 = edge(coords, NODE[i, 0, 0], NODE[i, 1, 0], c)
                v1 = edge(coords, NODE[i, 0, 1], NODE[i, 1, 1], c)
                low = cross3(u0, v0)
                top = cross3(u1, v1)
                middle = half_sum(cross3(u0, v1), cross3(u1, v0))
                for p in range(2):
                    for q in range(2):
                        # 1 / binomial(2, a) for the sum of two linear Bernstein factors, each way.
                        weight = (0.5 if i != p else 1.0) * (0.5 if j != q else 1.0)
                        w = edge(coords, NODE[p, q, 0], NODE[p, q, 1], c)
                        out[i + p, j + q, 0, c] += weight * dot3(low, w)
                        out[i + p, j + q, 1, c] += weight * dot3(middle, w)
                        out[i + p, j + q, 2, c] += weight * dot3(top, w)


@njit
def add_corners(points, nodes, table, sums):  # type: ignore[no-untyped-def]
    """Write the sums of the corner Jacobians of cells, ``nodes`` (m, n), into ``sums`` (m,)."""
    coords = np.zeros((3, nodes.shape[1], LANES))
    alpha = np.empty((len(table), LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, coords)
        corners(coords, table, count, alpha)
        sums[first : first + count] = alpha[0, :count]
        for k in range(1, len(table)):
            for c in range(count):
                sums[first + c] += alpha[k, c]


@njit
def measure(vtk, points, nodes, table, turn, alpha, spread, status):  # type: ignore[no-untyped-def]
    """Write corner Jacobians, spreads and a first status of cells of one type, in one pass.

    ``points``, ``nodes``, ``table``: (N, d), (m, n), and ``CORNERS[vtk]``.
    ``turn`` (m,): 1, or -1 for a cell that is numbered the other way round: a factor of its
    Jacobians.
    ``alpha``, ``spread`` (k, m): written: corner Jacobians times ``turn``, and spreads.
    ``status`` (m,): written: ``INVERTED`` where a corner Jacobian is not a positive number;
    ``UNPROVEN`` where another coefficient of a prism or a hexahedron is not, which
    `slideviz.mesh.jacobians.decide_unproven` is still to decide; else ``VALID``.
    """
    coords = np.zeros((3, nodes.shape[1], LANES))
    coefficients = np.empty((3, 3, 3, LANES))
    jacobians = np.empty((len(table), LANES))
    products = np.empty((len(table), LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        here = slice(first, first + count)
        gather(points, nodes, first, count, coords)
        corners(coords, table, count, jacobians)
        spreads(vtk, coords, table, count, products)
        sides = turn[here]
        states = status[here]
        states[:] = VALID
        if vtk == 12:
            write_hexahedron(coords, count, coefficients)
            _mark(coefficients.reshape(27, LANES), sides, states, UNPROVEN)
        elif vtk == 13:
            write_prism(coords, count, coefficients[0])
            _mark(coefficients[0, 1], sides, states, UNPROVEN)
        # After the coefficients, for a corner that is negative or NaN decides.
        _mark(jacobians, sides, states, INVERTED)
        for k in range(len(table)):
            for c in range(count):
                alpha[k, first + c] = jacobians[k, c] * sides[c]
                spread[k, first + c] = products[k, c]


@njit
def _mark(values, sides, states, as_):  # type: ignore[no-untyped-def]
    """Set ``states`` (m,) to ``as_`` where not all ``values * sides`` (k, m) are in 0 < v < inf."""
    least = np.full(len(states), np.inf)
    total = np.zeros(len(states))  # not finite where a value is not
    for k in range(len(values)):
        for c in range(len(states)):
            value = values[k, c] * sides[c]
            least[c] = min(least[c], value)
            total[c] += value
    for c in range(len(states)):
        states[c] = states[c] if least[c] > 0.0 and total[c] < np.inf else as_


@njit
def write_coefficients(vtk, coords, table, count, out):  # type: ignore[no-untyped-def]
    """Write the coefficients of the proof of validity of cells of one type into ``out`` (k, m).

    They are the 27 of a hexahedron, the 9 of a prism, else the corner Jacobians.
    """
    if vtk == 12:
        write_hexahedron(coords, count, out.reshape(3, 3, 3, out.shape[1]))
    elif vtk == 13:
        write_prism(coords, count, out.reshape(3, 3, out.shape[1]))
    else:
        corners(coords, table, count, out)


def coords_of(at: FloatArray) -> FloatArray:
    """Return the coordinates (3, n, m) of cells whose nodes are at (m, n, d)."""
    coords = np.zeros((3, *at.shape[1::-1]))
    coords[: at.shape[2]] = at.T
    return coords


def coefficients(vtk: int, coords: FloatArray) -> FloatArray:
    """Return the coefficients (k, m) of the proof of validity of cells, ``coords`` (3, n, m)."""
    out = np.empty(({12: 27, 13: 9}.get(vtk, len(CORNERS[vtk])), coords.shape[2]))
    write_coefficients(vtk, np.ascontiguousarray(coords), CORNERS[vtk], coords.shape[2], out)
    return out
