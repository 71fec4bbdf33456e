"""Compiled loops over elements: volumes, and stiffness added to a matrix in blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.rbf.caching import njit

POISSON = 0.3
"""Poisson's ratio, SU2's default."""

OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}


@njit(**OPTIONS)
def _jacobian(x, gradients, q, inverse):  # type: ignore[no-untyped-def]
    """Return det J of one element at an integration point; writes J^-1 to ``inverse``."""
    d = x.shape[1]
    J = np.zeros((3, 3))
    J[2, 2] = 1.0
    for i in range(d):
        for j in range(d):
            total = 0.0
            for a in range(x.shape[0]):
                total += gradients[q, a, i] * x[a, j]
            J[i, j] = total
    c00 = J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1]
    c01 = J[1, 2] * J[2, 0] - J[1, 0] * J[2, 2]
    c02 = J[1, 0] * J[2, 1] - J[1, 1] * J[2, 0]
    det = J[0, 0] * c00 + J[0, 1] * c01 + J[0, 2] * c02
    inverse[0, 0], inverse[1, 0], inverse[2, 0] = c00 / det, c01 / det, c02 / det
    inverse[0, 1] = (J[0, 2] * J[2, 1] - J[0, 1] * J[2, 2]) / det
    inverse[1, 1] = (J[0, 0] * J[2, 2] - J[0, 2] * J[2, 0]) / det
    inverse[2, 1] = (J[0, 1] * J[2, 0] - J[0, 0] * J[2, 1]) / det
    inverse[0, 2] = (J[0, 1] * J[1, 2] - J[0, 2] * J[1, 1]) / det
    inverse[1, 2] = (J[0, 2] * J[1, 0] - J[0, 0] * J[1, 2]) / det
    inverse[2, 2] = (J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]) / det
    return det


@njit(**OPTIONS)
def volumes(points, nodes, gradients, weights, out):  # type: ignore[no-untyped-def]
    """Write the volumes (areas) of elements, without regard to orientation."""
    inverse = np.empty((3, 3))
    x = np.empty((nodes.shape[1], points.shape[1]))
    for e in range(len(nodes)):
        for a in range(nodes.shape[1]):
            x[a] = points[nodes[e, a]]
        out[e] = 0.0
        for q in range(len(weights)):
            out[e] += weights[q] * abs(_jacobian(x, gradients, q, inverse))


@njit(**OPTIONS)
def _products(x, gradients, weights, inverse, g, m):  # type: ignore[no-untyped-def]
    """Write the integrals of grad_i N_a grad_j N_b to m (a d, a d); False without volume."""
    n, d = x.shape
    m[:] = 0.0
    for q in range(len(weights)):
        size = abs(_jacobian(x, gradients, q, inverse)) * weights[q]
        if not size > 0.0:
            return False
        for a in range(n):
            for i in range(d):
                total = 0.0
                for j in range(d):
                    total += inverse[i, j] * gradients[q, a, j]
                g[a * d + i] = total
        for row in range(n * d):
            scaled = size * g[row]
            for column in range(n * d):
                m[row, column] += scaled * g[column]
    return True


@njit(**OPTIONS)
def add(elements, modulus, conditions, pattern, data, right):  # type: ignore[no-untyped-def]
    """Add elements to the matrix and the right-hand side; the first without volume, or -1.

    ``elements``: points, nodes, gradients and weights; ``conditions``: place, turn, plain and
    known; ``pattern``: indptr and indices.
    """
    points, nodes, gradients, weights = elements
    place, turn, plain, known = conditions
    indptr, indices = pattern
    n, d = nodes.shape[1], points.shape[1]
    inverse, x = np.empty((3, 3)), np.empty((n, d))
    g, m = np.empty(n * d), np.empty((n * d, n * d))
    block, half = np.empty((d, d)), np.empty((d, d))
    for e in range(len(nodes)):
        for a in range(n):
            x[a] = points[nodes[e, a]]
        if not (modulus[e] < np.inf and _products(x, gradients, weights, inverse, g, m)):
            return e
        mu = modulus[e] / (2.0 * (1.0 + POISSON))
        lam = modulus[e] * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
        for a in range(n):
            first = nodes[e, a]
            row = place[first]
            if row < 0:
                continue
            for b in range(n):
                trace = 0.0
                for i in range(d):
                    trace += m[a * d + i, b * d + i]
                for i in range(d):
                    for j in range(d):
                        block[i, j] = lam * m[a * d + i, b * d + j] + mu * m[a * d + j, b * d + i]
                    block[i, i] += mu * trace
                if not plain[first]:
                    _into(turn[first], block, half, True)
                second = nodes[e, b]
                for i in range(d):
                    for j in range(d):
                        right[row, i] -= block[i, j] * known[second, j]
                column = place[second]
                if column < 0:
                    continue
                if not plain[second]:
                    _into(turn[second], block, half, False)
                low, high = indptr[row], indptr[row + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < column:
                        low = middle + 1
                    else:
                        high = middle
                data[low] += block
    return -1


@njit(**OPTIONS)
def _into(turn, block, half, left):  # type: ignore[no-untyped-def]
    """Replace a block by T^T block (``left``) or block T, in place."""
    d = len(block)
    for i in range(d):
        for j in range(d):
            total = 0.0
            for k in range(d):
                total += turn[k, i] * block[k, j] if left else block[i, k] * turn[k, j]
            half[i, j] = total
    block[:] = half
