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

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.jacobian_slopes import pull_proof
from slideviz.mesh.jacobians import (
    CORNER_AT,
    CORNERS,
    LANES,
    coefficients,
    coords_of,
    gather,
    scatter,
    write_coefficients,
)
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.system.jit_cache import njit

LEAST_SCALE = 0.1  # least coefficient of a target, over its mean one

LEAST_LENGTH = 1e-9  # least length of a target's edge, over its longest one

LEAST_SINE = 0.01
"""Least Jacobian of a target's corner over the product of its edges; flatter ones are opened."""


@record
class Targets:
    """Cells of one type, and the shapes that the energy compares them with."""

    vtk: int
    nodes: IntArray  # (m, n)
    scale: FloatArray  # (b, k, LANES): factors of the coefficients that make D of them, in blocks
    shape: FloatArray
    """(b, c, 1 + d d, LANES): of each corner, the factor of its Jacobian, and the matrix G with
    ``tr(JᵀJ) = Σ G_ij e_i·e_j``, row by row."""


def targets(vtk: int, nodes: IntArray, at: FloatArray, signs: FloatArray) -> Targets:
    """Return the targets of cells of one type, ``nodes`` (m, n).

    ``at`` (m, n, d): corner points of the target of each. ``signs`` (m,): 1, or -1 for a target
    that is numbered the other way round.
    """
    m, _, d = at.shape
    table = CORNERS[vtk]
    found = coefficients(vtk, coords_of(at)) * signs
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
    shape = np.empty((len(table), 1 + d * d, m))
    shape[:, 0] = signs / jacobian.T
    shape[:, 1:] = inverse.reshape(m, -1, d * d).transpose(1, 2, 0)
    mean = np.maximum(found.mean(axis=0), LEAST_SCALE * jacobian.mean(axis=1))
    scale = signs / np.maximum(found, LEAST_SCALE * mean)
    return Targets(vtk, np.ascontiguousarray(nodes), _in_blocks(scale), _in_blocks(shape))


def _in_blocks(values: FloatArray) -> FloatArray:
    """Return values (..., m) of cells as (b, ..., LANES), filled up with zeros."""
    count = -(-values.shape[-1] // LANES)
    out = np.zeros((*values.shape[:-1], count * LANES))
    out[..., : values.shape[-1]] = values
    blocks = out.reshape(*values.shape[:-1], count, LANES)
    return np.ascontiguousarray(np.moveaxis(blocks, -2, 0))


def _opened(gram: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the inverse of matrices of edges (f, d, d), and the Jacobian, of flat corners.

    Their edges keep their lengths (f, d), but are turned away from each other.
    """
    outer = length[:, None] * length[:, :, None]
    value, vector = np.linalg.eigh(gram / outer)
    value = np.maximum(value, LEAST_SINE)
    inverse = (vector / value[:, None, :]) @ np.swapaxes(vector, 1, 2) / outer
    return inverse, np.sqrt(value.prod(axis=1)) * length.prod(axis=1)


@njit(inline="always")
def _chi(depth, epsilon):  # type: ignore[no-untyped-def]
    """Return chi, and the root in it; chi' is chi / root."""
    root = np.sqrt(epsilon * epsilon + depth * depth)
    folded = 0.5 * epsilon * epsilon / (root + abs(depth))
    return 0.5 * (depth + root) if depth > 0.0 else folded, root


@njit
def _write_pulls(at, corner, shape, count, pulls, total):  # type: ignore[no-untyped-def]
    """Write ``tr(JᵀJ)`` of a corner of cells, and half its slopes by the edges of the corner.

    ``shape`` (1 + d d, LANES): of the corner, as of `Targets`.
    ``pulls``, ``total`` (d, d, LANES), (LANES,): the slopes by each edge, and the values.
    """
    d = len(pulls)
    pulls[:] = 0.0
    total[:] = 0.0
    # Numbers of nodes are read before loops over cells, which are not vectorised else.
    start = corner[0]
    for j in range(d):
        stop = corner[1 + j]
        for i in range(d):
            for axis in range(d):
                for c in range(count):
                    edge = at[axis, stop, c] - at[axis, start, c]
                    pulls[i, axis, c] += shape[1 + d * i + j, c] * edge
    for i in range(d):
        stop = corner[1 + i]
        for axis in range(d):
            for c in range(count):
                total[c] += pulls[i, axis, c] * (at[axis, stop, c] - at[axis, start, c])


@njit
def write_energy(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, low, high, values, slopes, least
):
    """Write energies (m,) of cells, slopes (m, n, d) by their nodes, and their least D (m,).

    ``low`` and ``high`` are the range of the cells.
    """
    d = points.shape[1]
    n = nodes.shape[1]
    parts = scale.shape[1]
    outer = len(table)
    power = 2.0 / d
    at = np.zeros((3, n, LANES))
    slope = np.empty((3, n, LANES))
    found = np.empty((parts, LANES))
    pull = np.empty((parts, LANES))
    none = np.zeros((parts, LANES))
    total = np.empty(LANES)
    weight = np.empty(LANES)
    value = np.empty(LANES)
    lowest = np.empty(LANES)
    pulls = np.empty((d, d, LANES))
    for first in range(low, high, LANES):
        count = min(LANES, high - first)
        factors = scale[first // LANES]
        shapes = shape[first // LANES]
        gather(points, nodes, first, count, at)
        write_coefficients(vtk, at, table, count, found)
        value[:] = 0.0
        lowest[:] = np.inf
        for k in range(parts):
            for c in range(count):
                factor = factors[k, c]
                depth = factor * found[k, c]
                chi, root = _chi(depth, epsilon)
                g = (1.0 + depth * depth) / chi
                value[c] += 0.5 / parts * g
                pull[k, c] = 0.5 / parts * factor * (2.0 * depth / chi - g / root)
                lowest[c] = min(lowest[c], depth)
        slope[:] = 0.0
        for k in range(outer):
            _write_pulls(at, table[k], shapes[k], count, pulls, total)
            at_corner = corner_at[k]
            for c in range(count):
                chi, root = _chi(shapes[k, 0, c] * found[at_corner, c], epsilon)
                weight[c] = chi if d == 2 else np.cbrt(chi * chi)
            for c in range(count):
                chi, root = _chi(shapes[k, 0, c] * found[at_corner, c], epsilon)
                weight[c] = 0.5 / outer / weight[c]
                value[c] += weight[c] * total[c]
                pull[at_corner, c] -= power * weight[c] * total[c] / root * shapes[k, 0, c]
            start = table[k, 0]
            for i in range(d):
                stop = table[k, 1 + i]
                for axis in range(d):
                    for c in range(count):
                        share = 2.0 * weight[c] * pulls[i, axis, c]
                        slope[axis, stop, c] += share
                        slope[axis, start, c] -= share
        pull_proof(vtk, at, table, count, pull, none, slope)
        for c in range(count):
            values[first + c] = value[c]
            least[first + c] = lowest[c]
        scatter(slope, first, count, slopes)


@njit
def write_curvatures(  # type: ignore[no-untyped-def]
    vtk, points, nodes, table, corner_at, scale, shape, epsilon, low, high, curvatures
):
    """Write the diagonal blocks (m, n, d, d) by node of the positive part of the Hessian.

    That is the part without second derivatives of chi and D. Else as `write_energy`.
    """
    d = points.shape[1]
    n = nodes.shape[1]
    parts = scale.shape[1]
    outer = len(table)
    power = 2.0 / d
    at = np.zeros((3, n, LANES))
    slope = np.empty((3, n, LANES))
    found = np.empty((parts, LANES))
    unit = np.zeros((parts, LANES))
    none = np.zeros((parts, LANES))
    total = np.empty(LANES)
    bend = np.empty((parts, LANES))
    pulls = np.empty((d, d, LANES))
    blocks = np.empty((n, d, d, LANES))
    for first in range(low, high, LANES):
        count = min(LANES, high - first)
        factors = scale[first // LANES]
        shapes = shape[first // LANES]
        gather(points, nodes, first, count, at)
        write_coefficients(vtk, at, table, count, found)
        blocks[:] = 0.0
        for k in range(parts):
            for c in range(count):
                factor = factors[k, c]
                chi, root = _chi(factor * found[k, c], epsilon)
                bent = (1.0 - factor * found[k, c] / root) ** 2 + 1.0 / (root * root)
                bend[k, c] = factor * factor / parts * bent / chi
        for k in range(outer):
            _write_pulls(at, table[k], shapes[k], count, pulls, total)
            for c in range(count):
                factor = shapes[k, 0, c]
                chi, root = _chi(factor * found[corner_at[k], c], epsilon)
                part = 0.5 / outer / (chi if d == 2 else np.cbrt(chi * chi))
                bent = power * (power + 1.0) * part * total[c] / (root * root)
                bend[corner_at[k], c] += factor * factor * bent
                for s in range(d * d):
                    stiff = 2.0 * part * shapes[k, 1 + s, c]
                    for a in range(d):
                        blocks[table[k, 0], a, a, c] += stiff
                        if s // d == s % d:
                            blocks[table[k, 1 + s % d], a, a, c] += stiff
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
