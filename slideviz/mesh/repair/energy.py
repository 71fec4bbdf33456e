"""The energy whose minimum has no folded cell, with slopes and curvatures by nodes, compiled.

Foldover-free maps (Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov: Foldover-free maps in
50 lines of code, 2021). With D a determinant over that of the target, and ``p = 2 / d``:

    chi(D) = (D + √(ε² + D²)) / 2      f = tr(JᵀJ) / chi^p      g = (1 + D²) / chi

f is of each corner, J its map from the target's edges to the cell's; g is of every coefficient of
the proof of validity (`slideviz.mesh.jacobians`), so that the minimiser aims at the proof. The
energy is half the mean of f plus half the mean of g, summed over cells. Each cell counts alike:
weighted by volume, thin cells of boundary layers would be given up for large ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.jacobian_slopes import pull_hexahedron, pull_plane, pull_prism, pull_solid
from slideviz.mesh.jacobians import (
    CORNERS,
    LANES,
    OPTIONS,
    corners,
    gather,
    write_hexahedron,
    write_prism,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.system.jit_cache import njit

COEFFICIENTS = {5: 1, 9: 4, 10: 1, 12: 27, 13: 9, 14: 4}
"""Number of coefficients of the proof, by VTK identifier."""

CORNER_AT = {
    **{vtk: np.arange(len(CORNERS[vtk])) for vtk in COEFFICIENTS},
    12: np.array([0, 18, 24, 6, 2, 20, 26, 8]),
    13: np.array([0, 1, 2, 6, 7, 8]),
}
"""Which coefficient is the Jacobian of each corner, by VTK identifier."""

LEAST_SCALE = 0.1
"""Least coefficient of a target, over its mean one."""

LEAST_ANGLE = 0.05
"""Least eigenvalue of the matrix of cosines between the edges of a target's corner."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Cells of one type, and the shapes that the energy compares them with."""

    vtk: int
    nodes: IntArray
    """(m, n)"""
    scale: FloatArray
    """(m, k): factors of the coefficients that make D of them."""
    shape: FloatArray
    """(m, c, 1 + s): of each corner, the factor of its Jacobian, and the matrix G with
    ``tr(JᵀJ) = Σ G_ij e_i·e_j``: diagonal, then 01 (2D) or 01, 12, 20 (3D)."""


def targets(vtk: int, nodes: IntArray, at: FloatArray, signs: FloatArray) -> Targets:
    """Return the targets of cells of one type.

    Parameters
    ----------
    nodes : (m, n)
        Nodes of the cells.
    at : (m, n, d)
        Corner points of the target of each.
    signs : (m,)
        1, or -1 for a target that is numbered the other way round.
    """
    m, n, d = at.shape
    found = np.empty((m, COEFFICIENTS[vtk]))
    all_nodes = np.arange(m * n).reshape(m, n)
    write_coefficients(vtk, np.ascontiguousarray(at.reshape(-1, d)), all_nodes, CORNERS[vtk], found)
    found *= signs[:, None]
    mean = np.maximum(found.mean(axis=1, keepdims=True), np.finfo(float).tiny)
    table = CORNERS[vtk]
    edges = at[:, table[:, 1:]] - at[:, table[:, :1]]
    gram = edges @ np.swapaxes(edges, 2, 3)
    length = np.sqrt(np.maximum(np.einsum("mcii->mci", gram), np.finfo(float).tiny))
    cosines = gram / (length[..., None] * length[:, :, None])
    value, vector = np.linalg.eigh(cosines)
    value = np.maximum(value, LEAST_ANGLE)
    inverse = (vector / value[..., None, :]) @ np.swapaxes(vector, 2, 3)
    inverse /= length[..., None] * length[:, :, None]
    shape = np.empty((m, len(table), 1 + d * (d + 1) // 2))
    shape[..., 0] = signs[:, None] / (np.sqrt(value.prod(axis=2)) * length.prod(axis=2))
    for k, (i, j) in enumerate([(i, i) for i in range(d)] + [(0, 1), (1, 2), (2, 0)][: 2 * d - 3]):
        shape[..., 1 + k] = inverse[..., i, j]
    scale = signs[:, None] / np.maximum(found, LEAST_SCALE * mean)
    return Targets(vtk, np.ascontiguousarray(nodes), scale, shape)


@njit(**OPTIONS)
def _coefficients(vtk, at, table, count, found):  # type: ignore[no-untyped-def]
    """Write the coefficients of the proof of cells of one type into ``found`` (k, LANES)."""
    if vtk == 12:
        write_hexahedron(at, count, found.reshape(3, 3, 3, LANES))
    elif vtk == 13:
        write_prism(at, count, found.reshape(3, 3, LANES))
    else:
        corners(at, table, count, found)


@njit(**OPTIONS)
def _pull(vtk, at, table, count, weights, none, slope):  # type: ignore[no-untyped-def]
    """Add the slopes (d, n, LANES) of the coefficients times ``weights`` (k, LANES)."""
    if vtk == 12:
        pull_hexahedron(at, count, weights.reshape(3, 3, 3, LANES), slope)
    elif vtk == 13:
        pull_prism(at, count, weights.reshape(3, 3, LANES), slope)
    elif at.shape[0] == 2:
        pull_plane(5, at, table, count, weights, none, slope)
    else:
        pull_solid(14, at, table, count, weights, none, slope)


@njit(**OPTIONS)
def write_coefficients(vtk, points, nodes, table, out):  # type: ignore[no-untyped-def]
    """Write the coefficients of the proof of cells into ``out`` (m, k)."""
    at = np.empty((points.shape[1], nodes.shape[1], LANES))
    found = np.empty((out.shape[1], LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, at)
        _coefficients(vtk, at, table, count, found)
        for c in range(count):
            for k in range(out.shape[1]):
                out[first + c, k] = found[k, c]


@njit(inline="always", **OPTIONS)
def _chi(depth, epsilon):  # type: ignore[no-untyped-def]
    """Return chi, and the root in it; chi' is chi / root."""
    root = np.sqrt(epsilon * epsilon + depth * depth)
    if depth > 0.0:
        return 0.5 * (depth + root), root
    return 0.5 * epsilon * epsilon / (root - depth), root


@njit(**OPTIONS)
def _square(at, corner, shape, first, k, count, total):  # type: ignore[no-untyped-def]
    """Write ``tr(JᵀJ)`` of corner k of cells into ``total`` (LANES,)."""
    d = at.shape[0]
    pairs = d * (d + 1) // 2
    for c in range(count):
        total[c] = 0.0
    for s in range(pairs):
        i = s if s < d else s - d
        j = s if s < d else (s - d + 1) % d
        o, a, b = corner[0], corner[1 + i], corner[1 + j]
        factor = 1.0 if s < d else 2.0
        for c in range(count):
            product = 0.0
            for axis in range(d):
                product += (at[axis, a, c] - at[axis, o, c]) * (at[axis, b, c] - at[axis, o, c])
            total[c] += factor * shape[first + c, k, 1 + s] * product


@njit(**OPTIONS)
def _pull_square(at, corner, shape, first, k, count, weight, slope):  # type: ignore[no-untyped-def]
    """Add the slopes of ``tr(JᵀJ)`` of corner k, times ``weight`` (LANES,), to (d, n, LANES)."""
    d = at.shape[0]
    for s in range(d * (d + 1) // 2):
        i = s if s < d else s - d
        j = s if s < d else (s - d + 1) % d
        o, a, b = corner[0], corner[1 + i], corner[1 + j]
        for axis in range(d):
            for c in range(count):
                factor = 2.0 * weight[c] * shape[first + c, k, 1 + s]
                one = factor * (at[axis, b, c] - at[axis, o, c])
                slope[axis, a, c] += one
                slope[axis, o, c] -= one
                if s >= d:
                    two = factor * (at[axis, a, c] - at[axis, o, c])
                    slope[axis, b, c] += two
                    slope[axis, o, c] -= two


@njit(**OPTIONS)
def write_energy(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, values, slopes, least
):
    """Write energies (m,) of cells, slopes (m, n, d) by their nodes, and their least D (m,)."""
    d, n, parts, outer = points.shape[1], nodes.shape[1], scale.shape[1], len(table)
    power = 2.0 / d
    at, slope = np.empty((d, n, LANES)), np.empty((d, n, LANES))
    found, pull = np.empty((parts, LANES)), np.empty((parts, LANES))
    none, total, weight = np.zeros((parts, LANES)), np.empty(LANES), np.empty(LANES)
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, at)
        _coefficients(vtk, at, table, count, found)
        for c in range(count):
            values[first + c] = 0.0
            least[first + c] = np.inf
        for k in range(parts):
            for c in range(count):
                factor = scale[first + c, k]
                depth = factor * found[k, c]
                chi, root = _chi(depth, epsilon)
                g = (1.0 + depth * depth) / chi
                values[first + c] += 0.5 / parts * g
                pull[k, c] = 0.5 / parts * factor * (2.0 * depth / chi - g / root)
                least[first + c] = min(least[first + c], depth)
        slope[:] = 0.0
        for k in range(outer):
            _square(at, table[k], shape, first, k, count, total)
            for c in range(count):
                factor = shape[first + c, k, 0]
                chi, root = _chi(factor * found[corner_at[k], c], epsilon)
                part = 0.5 / outer / (chi if d == 2 else np.cbrt(chi * chi))
                values[first + c] += part * total[c]
                pull[corner_at[k], c] -= power * part * total[c] / root * factor
                weight[c] = part
            _pull_square(at, table[k], shape, first, k, count, weight, slope)
        _pull(vtk, at, table, count, pull, none, slope)
        for c in range(count):
            for j in range(n):
                for axis in range(d):
                    slopes[first + c, j, axis] = slope[axis, j, c]


@njit(**OPTIONS)
def write_curvatures(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, curvatures
):
    """Write the diagonal blocks (m, n, d, d) by node of the positive part of the Hessian.

    That is the one in which chi has no second derivative, and D neither.
    """
    d, n, parts, outer = points.shape[1], nodes.shape[1], scale.shape[1], len(table)
    power = 2.0 / d
    at, slope = np.empty((d, n, LANES)), np.empty((d, n, LANES))
    found, unit = np.empty((parts, LANES)), np.zeros((parts, LANES))
    none, total, bend = np.zeros((parts, LANES)), np.empty(LANES), np.empty((parts, LANES))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, at)
        _coefficients(vtk, at, table, count, found)
        curvatures[first : first + count] = 0.0
        for k in range(parts):
            for c in range(count):
                factor = scale[first + c, k]
                depth = factor * found[k, c]
                chi, root = _chi(depth, epsilon)
                bent = ((1.0 - depth / root) ** 2 + 1.0 / (root * root)) / chi
                bend[k, c] = factor * factor / parts * bent
        for k in range(outer):
            _square(at, table[k], shape, first, k, count, total)
            for c in range(count):
                factor = shape[first + c, k, 0]
                chi, root = _chi(factor * found[corner_at[k], c], epsilon)
                part = 0.5 / outer / (chi if d == 2 else np.cbrt(chi * chi))
                bent = power * (power + 1.0) * part * total[c] / (root * root)
                bend[corner_at[k], c] += bent * factor * factor
                own = 0.0
                for s in range(d * (d + 1) // 2):
                    stiff = 2.0 * part * shape[first + c, k, 1 + s]
                    own += stiff if s < d else 2.0 * stiff
                    if s < d:
                        for axis in range(d):
                            curvatures[first + c, table[k, 1 + s], axis, axis] += stiff
                for axis in range(d):
                    curvatures[first + c, table[k, 0], axis, axis] += own
        for k in range(parts):
            unit[:] = 0.0
            unit[k] = 1.0
            slope[:] = 0.0
            _pull(vtk, at, table, count, unit, none, slope)
            for c in range(count):
                for j in range(n):
                    for a in range(d):
                        for b in range(d):
                            part = slope[a, j, c] * slope[b, j, c]
                            curvatures[first + c, j, a, b] += bend[k, c] * part
