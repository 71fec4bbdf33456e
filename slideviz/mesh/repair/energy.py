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

from slideviz.mesh.jacobian_slopes import pull_proof
from slideviz.mesh.jacobians import (
    CORNER_AT,
    CORNERS,
    LANES,
    coefficients,
    gather,
    write_coefficients,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.system.jit_cache import OPTIONS, njit

LEAST_SCALE = 0.1  # least coefficient of a target, over its mean one

LEAST_LENGTH = 1e-9  # least length of a target's edge, over its longest one

LEAST_SINE = 0.01
"""Least Jacobian of a target's corner over the product of its edges; flatter ones are opened."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Cells of one type, and the shapes that the energy compares them with."""

    vtk: int
    nodes: IntArray  # (m, n)
    scale: FloatArray  # (k, m): factors of the coefficients that make D of them
    shape: FloatArray
    """(c, 1 + s, m): of each corner, the factor of its Jacobian, and the matrix G with
    ``tr(JᵀJ) = Σ G_ij e_i·e_j``: diagonal, then 01 (2D) or 01, 12, 20 (3D)."""


def targets(vtk: int, nodes: IntArray, at: FloatArray, signs: FloatArray) -> Targets:
    """Return the targets of cells of one type, ``nodes`` (m, n).

    ``at`` (m, n, d): corner points of the target of each. ``signs`` (m,): 1, or -1 for a target
    that is numbered the other way round.
    """
    m, _, d = at.shape
    table = CORNERS[vtk]
    found = coefficients(vtk, at.T) * signs
    edges = at[:, table[:, 1:]] - at[:, table[:, :1]]
    gram = edges @ np.swapaxes(edges, 2, 3)
    length = np.sqrt(np.einsum("mcii->mci", gram))
    longest = np.maximum(length.max(axis=(1, 2), keepdims=True), np.finfo(float).tiny ** 0.25)
    length = np.maximum(length, LEAST_LENGTH * longest)
    size = length.prod(axis=2)
    jacobian = found[CORNER_AT[vtk]].T
    flat = ~(jacobian > LEAST_SINE * size)
    edges[flat] = np.eye(d)
    jacobian[flat] = 1.0
    if d == 2:
        dual = np.stack([edges[..., 1, ::-1], edges[..., 0, ::-1]], axis=2) * [[1, -1], [-1, 1]]
    else:
        one, two, three = np.moveaxis(edges, 2, 0)
        dual = np.stack([np.cross(two, three), np.cross(three, one), np.cross(one, two)], axis=2)
    dual /= jacobian[..., None, None]
    inverse = dual @ np.swapaxes(dual, 2, 3)
    inverse[flat], jacobian[flat] = _opened(gram[flat], length[flat])
    shape = np.empty((len(table), 1 + d * (d + 1) // 2, m))
    shape[:, 0] = signs / jacobian.T
    for k, (i, j) in enumerate([(i, i) for i in range(d)] + [(0, 1), (1, 2), (2, 0)][: 2 * d - 3]):
        shape[:, 1 + k] = inverse[..., i, j].T
    mean = np.maximum(found.mean(axis=0), LEAST_SCALE * jacobian.mean(axis=1))
    scale = signs / np.maximum(found, LEAST_SCALE * mean)
    return Targets(vtk, np.ascontiguousarray(nodes), scale, shape)


def _opened(gram: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the inverse of matrices of edges (f, d, d), and the Jacobian, of flat corners.

    Their edges keep their lengths (f, d), but are turned away from each other.
    """
    outer = length[:, None] * length[:, :, None]
    value, vector = np.linalg.eigh(gram / outer)
    value = np.maximum(value, LEAST_SINE)
    inverse = (vector / value[:, None, :]) @ np.swapaxes(vector, 1, 2) / outer
    return inverse, np.sqrt(value.prod(axis=1)) * length.prod(axis=1)


@njit(inline="always", **OPTIONS)
def _chi(depth, epsilon):  # type: ignore[no-untyped-def]
    """Return chi, and the root in it; chi' is chi / root."""
    root = np.sqrt(epsilon * epsilon + depth * depth)
    folded = 0.5 * epsilon * epsilon / (root + abs(depth))
    return 0.5 * (depth + root) if depth > 0.0 else folded, root


@njit(**OPTIONS)
def _squares(at, corner, shape, count, total):  # type: ignore[no-untyped-def]
    """Write ``tr(JᵀJ)`` of a corner of cells into ``total`` (LANES,); ``shape`` (1 + s, LANES)."""
    d = at.shape[0]
    total[:] = 0.0
    for s in range(d * (d + 1) // 2):
        o = corner[0]
        a = corner[1 + s % d]
        b = corner[1 + (s if s < d else (s - d + 1) % d)]
        factor = 1.0 if s < d else 2.0
        for axis in range(d):
            for c in range(count):
                one = at[axis, a, c] - at[axis, o, c]
                two = at[axis, b, c] - at[axis, o, c]
                total[c] += factor * shape[1 + s, c] * (one * two)


@njit(**OPTIONS)
def _pull_squares(at, corner, shape, count, weight, slope):  # type: ignore[no-untyped-def]
    """Add the slopes of ``tr(JᵀJ)`` of a corner, times ``weight`` (LANES,), to (d, n, LANES)."""
    d = at.shape[0]
    for s in range(d * (d + 1) // 2):
        o = corner[0]
        a = corner[1 + s % d]
        b = corner[1 + (s if s < d else (s - d + 1) % d)]
        share = 1.0 if s < d else 2.0
        for axis in range(d):
            for c in range(count):
                factor = share * weight[c] * shape[1 + s, c]
                one = factor * (at[axis, b, c] - at[axis, o, c])
                two = factor * (at[axis, a, c] - at[axis, o, c])
                slope[axis, a, c] += one
                slope[axis, b, c] += two
                slope[axis, o, c] -= one + two


@njit(**OPTIONS)
def write_energy(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, low, high, values, slopes, least
):
    """Write energies (m,) of cells, slopes (m, n, d) by their nodes, and their least D (m,).

    ``low`` and ``high`` are the range of the cells.
    """
    d = points.shape[1]
    n = nodes.shape[1]
    parts = len(scale)
    outer = len(table)
    power = 2.0 / d
    at = np.empty((d, n, LANES))
    slope = np.empty((d, n, LANES))
    found = np.empty((parts, LANES))
    pull = np.empty((parts, LANES))
    none = np.zeros((parts, LANES))
    total = np.empty(LANES)
    weight = np.empty(LANES)
    value = np.empty(LANES)
    lowest = np.empty(LANES)
    factors = np.empty((parts, LANES))
    shapes = np.empty((*shape.shape[:2], LANES))
    for first in range(low, high, LANES):
        count = min(LANES, high - first)
        gather(points, nodes, first, count, at)
        factors[:, :count] = scale[:, first : first + count]
        shapes[:, :, :count] = shape[:, :, first : first + count]
        write_coefficients(vtk, at, table, count, found)
        value[:] = 0.0
        lowest[:] = np.inf
        for k in range(parts):
            for c in range(count):
                depth = factors[k, c] * found[k, c]
                chi, root = _chi(depth, epsilon)
                g = (1.0 + depth * depth) / chi
                value[c] += 0.5 / parts * g
                pull[k, c] = 0.5 / parts * factors[k, c] * (2.0 * depth / chi - g / root)
                lowest[c] = min(lowest[c], depth)
        slope[:] = 0.0
        for k in range(outer):
            _squares(at, table[k], shapes[k], count, total)
            at_corner = corner_at[k]
            for c in range(count):
                chi, root = _chi(shapes[k, 0, c] * found[at_corner, c], epsilon)
                weight[c] = chi if d == 2 else np.cbrt(chi * chi)
            for c in range(count):
                chi, root = _chi(shapes[k, 0, c] * found[at_corner, c], epsilon)
                weight[c] = 0.5 / outer / weight[c]
                value[c] += weight[c] * total[c]
                pull[at_corner, c] -= power * weight[c] * total[c] / root * shapes[k, 0, c]
            _pull_squares(at, table[k], shapes[k], count, weight, slope)
        pull_proof(vtk, at, table, count, pull, none, slope)
        for c in range(count):
            values[first + c] = value[c]
            least[first + c] = lowest[c]
            for j in range(n):
                for axis in range(d):
                    slopes[first + c, j, axis] = slope[axis, j, c]


@njit(**OPTIONS)
def write_curvatures(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, low, high, curvatures
):
    """Write the diagonal blocks (m, n, d, d) by node of the positive part of the Hessian.

    That is the part without second derivatives of chi and D. Else as `write_energy`.
    """
    d = points.shape[1]
    n = nodes.shape[1]
    parts = len(scale)
    outer = len(table)
    power = 2.0 / d
    at = np.empty((d, n, LANES))
    slope = np.empty((d, n, LANES))
    found = np.empty((parts, LANES))
    unit = np.zeros((parts, LANES))
    none = np.zeros((parts, LANES))
    total = np.empty(LANES)
    bend = np.empty((parts, LANES))
    blocks = np.empty((n, d, d, LANES))
    for first in range(low, high, LANES):
        count = min(LANES, high - first)
        gather(points, nodes, first, count, at)
        write_coefficients(vtk, at, table, count, found)
        blocks[:] = 0.0
        for k in range(parts):
            for c in range(count):
                factor = scale[k, first + c]
                chi, root = _chi(factor * found[k, c], epsilon)
                bent = (1.0 - factor * found[k, c] / root) ** 2 + 1.0 / (root * root)
                bend[k, c] = factor * factor / parts * bent / chi
        for k in range(outer):
            here = np.ascontiguousarray(shape[k, :, first : first + count])
            _squares(at, table[k], here, count, total)
            for c in range(count):
                factor = here[0, c]
                chi, root = _chi(factor * found[corner_at[k], c], epsilon)
                part = 0.5 / outer / (chi if d == 2 else np.cbrt(chi * chi))
                bent = power * (power + 1.0) * part * total[c] / (root * root)
                bend[corner_at[k], c] += factor * factor * bent
                for s in range(len(here) - 1):
                    stiff = (2.0 if s < d else 4.0) * part * here[1 + s, c]
                    for a in range(d):
                        blocks[table[k, 0], a, a, c] += stiff
                        if s < d:
                            blocks[table[k, 1 + s], a, a, c] += stiff
        for k in range(parts):
            unit[:] = 0.0
            unit[k] = 1.0
            slope[:] = 0.0
            pull_proof(vtk, at, table, count, unit, none, slope)
            for j in range(n):
                for a in range(d):
                    for b in range(d):
                        for c in range(count):
                            blocks[j, a, b, c] += bend[k, c] * slope[a, j, c] * slope[b, j, c]
        for c in range(count):
            for j in range(n):
                for a in range(d):
                    for b in range(d):
                        curvatures[first + c, j, a, b] = blocks[j, a, b, c]
