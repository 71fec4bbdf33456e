"""Derivatives of ln f_ss (size-skew quality) of cells by their nodes, compiled.

The formula is in `slideviz.mesh.quality_derivative`. They differentiate `jacobians.corners`
and `jacobians.spreads`, and must follow their branches by element type. As there, a dimension
``...`` is that of the cells, ``LANES`` at a time.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.jacobians import (
    LANES,
    NODE,
    corner_edges,
    corner_ends,
    corners,
    cross3,
    dot3,
    gather,
    half_sum,
    minus3,
    scaled3,
    scatter,
    spreads,
)
from slideviz.system.jit_cache import njit


@njit
def write_slopes(vtk, points, nodes, table, turn, powers, sums, out):  # type: ignore[no-untyped-def]
    """Write the derivative of ln f_ss by the nodes of each cell into ``out`` (m, n, d).

    ``points``, ``nodes``, ``table``, ``turn``: as of `slideviz.mesh.jacobians.measure`.
    ``powers`` (2,): exponents of spread and Jacobian, ``EXPONENTS`` of the metric and type.
    ``sums`` (m,): sums of the corner Jacobians of the undeformed cells; infinity where there are
    none: then the derivative is that of ln f_skew.
    ``out`` (m, n, d): meaningless (possibly NaN) where a corner Jacobian is not positive.
    """
    coords = np.zeros((3, nodes.shape[1], LANES))
    slope = np.empty_like(coords)
    alpha = np.empty((len(table), LANES))
    spread = np.empty((len(table), LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, coords)
        corners(coords, table, count, alpha)
        spreads(vtk, coords, table, count, spread)
        here = slice(first, first + count)
        _weights(alpha, spread, turn[here], powers, sums[here])
        slope[:] = 0.0
        _pull_corners(vtk, coords, table, count, alpha, spread, slope)
        scatter(slope, first, count, out)


@njit
def _weights(alpha, spread, turn, powers, sums):  # type: ignore[no-untyped-def]
    """Replace Jacobians and spreads (k, ...) by the derivatives of ln f_ss by each of them.

    The others are as in `write_slopes`, for these cells.
    """
    terms = np.empty(len(alpha))
    for c in range(len(turn)):
        total = whole = 0.0
        for k in range(len(alpha)):
            now = alpha[k, c] * turn[c]
            total += now
            terms[k] = _power(spread[k, c], powers[0]) / _power(now, powers[1])
            whole += terms[k]
        size = 0.0
        if sums[c] < np.inf and total != sums[c]:
            size = (0.5 if total < sums[c] else -0.5) / total
        for k in range(len(alpha)):
            share = terms[k] / whole
            alpha[k, c] = powers[1] * share / alpha[k, c] + size * turn[c]
            spread[k, c] = -powers[0] * share / spread[k, c]


@njit(inline="always")
def _power(base, exponent):  # type: ignore[no-untyped-def]
    """Return ``base ** exponent``; exponent 1 is a shortcut."""
    return base if exponent == 1.0 else base**exponent


@njit
def _pull_corners(vtk, coords, table, count, alpha, spread, slope):  # type: ignore[no-untyped-def]
    """Add the derivatives of ln f_ss by the nodes of cells to ``slope`` (3, n, ...).

    ``alpha`` and ``spread`` (k, ...) are its derivatives by Jacobians and spreads (`_weights`).
    """
    for k in range(len(table)):
        ends = corner_ends(table[k])
        o, i, j, h, _ = ends
        for c in range(count):
            x, y, z = corner_edges(coords, ends, ends[4], c)
            yz = cross3(y, z)
            zx = cross3(z, x)
            xy = cross3(x, y)
            by_x, by_y, by_z = _spread_slopes(vtk, x, y, z)
            w = alpha[k, c]
            s = spread[k, c]
            for axis in range(3):
                one = w * yz[axis] + s * by_x[axis]
                two = w * zx[axis] + s * by_y[axis]
                three = w * xy[axis] + s * by_z[axis]
                slope[axis, i, c] += one
                slope[axis, j, c] += two
                slope[axis, h, c] += three
                slope[axis, o, c] -= one + two + three


@njit(inline="always")
def _spread_slopes(vtk, x, y, z):  # type: ignore[no-untyped-def]
    """Return the derivatives of a corner's spread by its three edges, a triple each.

    Their formulas are those of `jacobians.spreads`, differentiated.
    """
    if vtk == 5:
        return minus3(scaled3(2.0, x), y), minus3(scaled3(2.0, y), x), (0.0, 0.0, 0.0)
    if vtk == 10:
        return (
            minus3(minus3(scaled3(3.0, x), y), z),
            minus3(minus3(scaled3(3.0, y), x), z),
            minus3(minus3(scaled3(3.0, z), x), y),
        )
    if vtk == 14:
        axis = minus3(z, half_sum(x, y))
        return scaled3(2.0, minus3(x, axis)), scaled3(2.0, minus3(y, axis)), scaled3(4.0, axis)
    xx = dot3(x, x)
    yy = dot3(y, y)
    zz = dot3(z, z)
    product = np.sqrt(xx * yy * zz)
    return scaled3(product / xx, x), scaled3(product / yy, y), scaled3(product / zz, z)


@njit
def pull_coefficients(vtk, points, nodes, table, weights, out):  # type: ignore[no-untyped-def]
    """Write derivatives by nodes of the weighted sum of each cell's coefficients to ``out``.

    ``points``, ``nodes``, ``table``: as of `slideviz.mesh.jacobians.measure`.
    ``weights`` (k, m): factors of the coefficients, in the order of `jacobians.write_coefficients`.
    ``out`` (m, n, d): written.
    """
    coords = np.zeros((3, nodes.shape[1], LANES))
    slope = np.empty_like(coords)
    part = np.zeros((len(weights), LANES))
    none = np.zeros((len(weights), LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, coords)
        part[:, :count] = weights[:, first : first + count]
        slope[:] = 0.0
        pull_proof(vtk, coords, table, count, part, none, slope)
        scatter(slope, first, count, out)


@njit
def pull_proof(vtk, coords, table, count, weights, none, slope):  # type: ignore[no-untyped-def]
    """Add the slopes (3, n, LANES) of the coefficients times ``weights`` (k, LANES).

    ``none`` (k, LANES) are zeros.
    """
    if vtk == 12:
        _pull_hexahedron(coords, count, weights.reshape(3, 3, 3, LANES), slope)
    elif vtk == 13:
        weights = weights.reshape(3, 3, LANES)
        _pull_heights(coords, count, _PRISM_SIDES, _PRISM_HEIGHTS, weights, slope)
    else:
        _pull_corners(14, coords, table, count, weights, none, slope)


_U = NODE.transpose(1, 0, 2)
_V = NODE
_SIDES = np.array(
    [[[_U[j, :, 0], _V[i, :, 0], _U[j, :, 1], _V[i, :, 1]] for j in range(2)] for i in range(2)]
)
"""Nodes of the edges u0, v0, u1, v1 of a hexahedron at i and j, (2, 2, 4, 2)."""
_PRISM_SIDES = np.array([[0, 1], [0, 2], [3, 4], [3, 5]])
_PRISM_HEIGHTS = np.array([[0, 3], [1, 4], [2, 5]])


@njit
def _pull_hexahedron(coords, count, weights, slope):  # type: ignore[no-untyped-def]
    """Add the derivatives of the coefficients of hexahedra, times ``weights`` (3, 3, 3, ...)."""
    heights = NODE.reshape(4, 2)
    factors = np.empty((3, 4, LANES))
    for i in range(2):
        for j in range(2):
            for p in range(2):
                for q in range(2):
                    # As in `jacobians.write_hexahedron`.
                    weight = (0.5 if i != p else 1.0) * (0.5 if j != q else 1.0)
                    for n in range(3):
                        for c in range(count):
                            factors[n, 2 * p + q, c] = weight * weights[i + p, j + q, n, c]
            _pull_heights(coords, count, _SIDES[i, j], heights, factors, slope)


@njit
def _pull_heights(coords, count, sides, heights, factors, slope):  # type: ignore[no-untyped-def]
    """Add derivatives of ``Σ_h w_h · (f0h u0 x v0 + f1h (u0 x v1 + u1 x v0) / 2 + f2h u1 x v1)``.

    ``sides`` (4, 2) are the nodes of the edges u0, v0, u1, v1 of cells, ``heights`` (h, 2) those
    of w, ``factors`` (3, h, ...).
    """
    edges = np.empty((4, 3, LANES))
    products = np.empty((3, 3, LANES))
    total = np.zeros((3, 3, LANES))
    # Numbers of nodes are read before loops over cells, which are not vectorised else.
    for k in range(4):
        start, stop = sides[k]
        for axis in range(3):
            for c in range(count):
                edges[k, axis, c] = coords[axis, stop, c] - coords[axis, start, c]
    for axis in range(3):
        for c in range(count):
            products[0, axis, c] = _cross(edges[0], edges[1], axis, c)
            middle = _cross(edges[0], edges[3], axis, c) + _cross(edges[2], edges[1], axis, c)
            products[1, axis, c] = 0.5 * middle
            products[2, axis, c] = _cross(edges[2], edges[3], axis, c)
    for h in range(len(heights)):
        one, two = heights[h]
        for axis in range(3):
            for c in range(count):
                w = coords[axis, two, c] - coords[axis, one, c]
                value = factors[0, h, c] * products[0, axis, c]
                value += factors[1, h, c] * products[1, axis, c]
                value += factors[2, h, c] * products[2, axis, c]
                total[0, axis, c] += factors[0, h, c] * w
                total[1, axis, c] += factors[1, h, c] * w
                total[2, axis, c] += factors[2, h, c] * w
                slope[axis, one, c] -= value
                slope[axis, two, c] += value
    for k in range(4):
        # By u0 and u1: v0 x a + v1 x b, v1 x d + v0 x b; by v0 and v1: a x u0 + b x u1, ...
        upper = 2 * (k // 2)
        across = 1 - k % 2
        near = edges[upper + across]
        far = edges[2 - upper + across]
        sign = 2.0 * across - 1.0
        start, stop = sides[k]
        for axis in range(3):
            for c in range(count):
                value = _cross(near, total[upper], axis, c)
                value = sign * (value + 0.5 * _cross(far, total[1], axis, c))
                slope[axis, start, c] -= value
                slope[axis, stop, c] += value


@njit(inline="always")
def _cross(a, b, axis, c):  # type: ignore[no-untyped-def]
    """Return a component of the cross product of vectors (3, ...) of cell ``c``."""
    one = (axis + 1) % 3
    two = (axis + 2) % 3
    return a[one, c] * b[two, c] - a[two, c] * b[one, c]


@njit
def add_to_points(nodes, weights, slopes, lane, lanes, out):  # type: ignore[no-untyped-def]
    """Add ``weights * slopes`` of cells to their points in ``out``, for the points of one lane.

    Lanes are shares of the points, one for each thread. No point is in two lanes, so that threads
    can add at the same time, and each point gets its terms in the order of the cells, whatever
    the number of lanes.
    ``nodes``, ``slopes`` (m, n), (m, n, d): the nodes of cells of one type, and the derivatives of
    a value of each cell by them.
    ``weights`` (w, m): factors of these derivatives, for w sums. A cell whose weights are all zero
    adds nothing, even if its slopes are NaN.
    ``lane``, ``lanes``: number of this lane, from 0, and of all lanes.
    ``out`` (w, N, d): the sums, for all N points.
    """
    for c in range(nodes.shape[0]):
        wanted = False
        for r in range(weights.shape[0]):
            wanted |= weights[r, c] != 0.0
        if not wanted:
            continue
        for j in range(nodes.shape[1]):
            node = nodes[c, j]
            if (node >> 6) % lanes != lane:
                continue
            for r in range(weights.shape[0]):
                for axis in range(out.shape[2]):
                    out[r, node, axis] += weights[r, c] * slopes[c, j, axis]
