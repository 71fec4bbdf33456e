"""Slow, literal quality of one cell at a time, as judge of `slideviz.mesh.quality`.

Written from the formulas of the thesis (section 2.7), of Knupp and of the shape functions,
with its own tables; it uses nothing of the package.
"""

from __future__ import annotations

import itertools

import numpy as np

R = 1 / np.sqrt(2)
IDEAL = {
    5: [(0, 0), (1, 0), (0.5, np.sqrt(3) / 2)],
    9: [(0, 0), (1, 0), (1, 1), (0, 1)],
    10: [(0, 0, 0), (1, 0, 0), (0.5, np.sqrt(0.75), 0), (0.5, np.sqrt(1 / 12), np.sqrt(2 / 3))],
    12: [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
    13: [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0.5, np.sqrt(0.75)))],
    14: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, R)],
}
"""Coordinates of the ideal cell of each type, right-handed."""

NEIGHBOURS = {
    5: {0: (1, 2)},
    9: {0: (1, 3), 1: (2, 0), 2: (3, 1), 3: (0, 2)},
    10: {0: (1, 2, 3)},
    # Thesis Table 2.3.
    12: {
        0: (1, 3, 4),
        1: (2, 0, 5),
        2: (3, 1, 6),
        3: (0, 2, 7),
        4: (7, 5, 0),
        5: (4, 6, 1),
        6: (5, 7, 2),
        7: (6, 4, 3),
    },
    13: {0: (1, 2, 3), 1: (2, 0, 4), 2: (0, 1, 5), 3: (5, 4, 0), 4: (3, 5, 1), 5: (4, 3, 2)},
    14: {0: (1, 3, 4), 1: (2, 0, 4), 2: (3, 1, 4), 3: (0, 2, 4)},
}

# Corner-preserving renumberings that keep the cell right-handed (they generate the rest).
TURNS = {
    5: [(1, 2, 0)],
    9: [(1, 2, 3, 0)],
    10: [(1, 2, 0, 3), (1, 0, 3, 2)],
    12: [(1, 2, 3, 0, 5, 6, 7, 4), (4, 5, 1, 0, 7, 6, 2, 3), (3, 2, 6, 7, 0, 1, 5, 4)],
    13: [(1, 2, 0, 4, 5, 3), (3, 5, 4, 0, 2, 1)],
    14: [(1, 2, 3, 0, 4)],
}

# Renumberings that make the cell left-handed.
MIRRORS = {
    5: (0, 2, 1),
    9: (0, 3, 2, 1),
    10: (0, 2, 1, 3),
    12: (4, 5, 6, 7, 0, 1, 2, 3),
    13: (3, 4, 5, 0, 1, 2),
    14: (0, 3, 2, 1, 4),
}


def corner_matrices(vtk, points):
    points = np.asarray(points, float)
    return [
        np.column_stack([points[j] - points[k] for j in near])
        for k, near in NEIGHBOURS[vtk].items()
    ]


def jacobians(vtk, points):
    return [np.linalg.det(matrix) for matrix in corner_matrices(vtk, points)]


def skew(vtk, points, metric="knupp"):
    """f_skew of a cell whose corner Jacobians are all positive."""
    parts = []
    for matrix in corner_matrices(vtk, points):
        alpha, lam = np.linalg.det(matrix), matrix.T @ matrix
        lengths = np.sqrt(np.prod(np.diag(lam)))
        if vtk == 5:
            return np.sqrt(3) * alpha / (lam[0, 0] + lam[1, 1] - lam[0, 1])
        if vtk == 10:
            off = lam[0, 1] + lam[1, 2] + lam[0, 2]
            return 3 * (np.sqrt(2) * alpha) ** (2 / 3) / (1.5 * np.trace(lam) - off)
        if vtk == 9 or (vtk == 12 and metric == "rbf-slide"):
            parts.append(lengths / alpha)
        elif vtk == 12:
            parts.append((lengths / alpha) ** (2 / 3))
        elif vtk == 13:
            parts.append((np.sqrt(3) / 2 * lengths / alpha) ** (2 / 3))
        else:
            ideal = np.array([(1, 0, 0), (0, 1, 0), (0.5, 0.5, R)])
            t = np.linalg.inv(ideal) @ matrix.T
            parts.append(np.linalg.norm(t) ** 2 / (3 * np.linalg.det(t) ** (2 / 3)))
    return len(parts) / sum(parts)


def size_skew(vtk, points, reference, metric="knupp"):
    """(value, size, skew) of a right-handed cell; zeros where a corner is not positive."""
    now, before = jacobians(vtk, points), jacobians(vtk, reference)
    if min(now) <= 0:
        return 0.0, 0.0, 0.0
    tau = sum(now) / sum(before)
    size = min(tau, 1 / tau) if tau > 0 else 0.0
    f_skew = skew(vtk, points, metric)
    return np.sqrt(size) * f_skew, size, f_skew


def derivatives(vtk, r, s, t=0.0):
    """(n, d) derivatives of the shape functions at a point of the parameter cell.

    The pyramid is the collapsed hexahedron, so its determinant vanishes at t = 1.
    """
    if vtk == 9:
        return derivatives(12, r, s, 0.0)[:4, :2]
    if vtk == 13:
        tri, flat = np.array([1 - r - s, r, s]), np.array([(-1, -1), (1, 0), (0, 1)])
        low = np.column_stack([flat * (1 - t), -tri])
        return np.vstack([low, np.column_stack([flat * t, tri])])
    at = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    rows = []
    for corner in at:
        value = [x if c else 1 - x for x, c in zip((r, s, t), corner, strict=True)]
        slope = [1 if c else -1 for c in corner]
        rows.append(
            [
                np.prod([slope[j] if i == j else value[j] for j in range(3)], dtype=float)
                for i in range(3)
            ]
        )
    rows = np.array(rows)
    return np.vstack([rows[:4], rows[4:].sum(axis=0)]) if vtk == 14 else rows


def determinant_at(vtk, points, r, s, t=0.0):
    return np.linalg.det(np.asarray(points, float).T @ derivatives(vtk, r, s, t))


def least_determinant(vtk, points, n=15):
    """Least det J over a grid of n points in each direction (the pyramid's without its tip)."""
    grid = np.linspace(0, 1, n)
    found = []
    for r, s, t in itertools.product(grid, grid, grid if vtk != 9 else [0.0]):
        if (vtk == 13 and r + s > 1 + 1e-12) or (vtk == 14 and t == 1):
            continue
        scale = (1 - t) ** 2 if vtk == 14 else 1
        found.append(determinant_at(vtk, points, r, s, t) / scale)
    return min(found)


def volume(vtk, points):
    """Integral of det J by Gauss quadrature with 3 points in each direction (exact)."""
    x, w = np.polynomial.legendre.leggauss(3)
    x, w = (x + 1) / 2, w / 2
    total = 0.0
    for i, j, k in itertools.product(range(3), repeat=3):
        r, s, t, weight = x[i], x[j], x[k], w[i] * w[j] * w[k]
        if vtk == 13:
            r, weight = r * (1 - s), weight * (1 - s)
        total += weight * determinant_at(vtk, points, r, s, t)
    return total


def hexahedron_bezier(points):
    """(3, 3, 3) Bézier coefficients: 27 samples, then the Lagrange-to-Bernstein matrix."""
    nodes = (0.0, 0.5, 1.0)
    basis = np.array([[(1 - x) ** 2, 2 * x * (1 - x), x * x] for x in nodes])
    samples = [determinant_at(12, points, *rst) for rst in itertools.product(nodes, repeat=3)]
    whole = np.kron(np.kron(basis, basis), basis)
    return np.linalg.solve(whole, samples).reshape(3, 3, 3)
