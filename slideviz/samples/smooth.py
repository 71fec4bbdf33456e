"""Smooth grid lines for a quadrilateral mesh: the discrete harmonic functional.

The mesh that minimises the sum over all cell corners of

    (rho |a|^2 + |b|^2 / rho) / (2 a x b)

where a and b are the edges at the corner, is the discrete counterpart of solving Winslow's
equations (S. A. Ivanenko, A. A. Charakhch'yan, "Curvilinear grids of convex quadrilaterals",
USSR Comput. Maths. Math. Phys. 28, 1988). The denominator is a barrier: a cell can never fold. At
a free boundary the minimum leaves the lines orthogonal to it. The aspect ratio rho, wanted
for |b| / |a|, draws cells to the wall.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from slideviz.mesh.model import FloatArray, IntArray

# Edges (ax, ay, bx, by): a x b = e S e / 2.
_CROSS = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], float)
# Corner, neighbour and neighbour coordinates to edges.
_EDGES = np.array(
    [[-1, 0, 1, 0, 0, 0], [0, -1, 0, 1, 0, 0], [-1, 0, 0, 0, 1, 0], [0, -1, 0, 0, 0, 1]], float
)


def smooth(
    points: FloatArray, quads: IntArray, rho: FloatArray, dof: IntArray, tolerance: float = 1e-7
) -> FloatArray:
    """Return the points at which the functional is smallest, by Newton's method.

    Parameters
    ----------
    points : (n, 2)
        Where to start; no cell may be folded.
    quads : (m, 4)
        Nodes of the cells, counter-clockwise.
    rho : (m,)
        Length of edges 1-2 and 3-0 that is wanted over that of 0-1 and 2-3.
    dof : (n, 2)
        Number of the unknown that moves each coordinate, -1 where it is fixed. Coordinates with
        the same number move alike.
    tolerance : float
        Ends when a step moves no node by more, in the unit of length.
    """
    corners = np.concatenate([np.roll(quads, -k, axis=1)[:, [0, 1, 3]] for k in range(4)])
    ratio = np.concatenate([rho, 1 / rho, rho, 1 / rho])
    unknown = dof[corners].reshape(-1, 6)
    n = int(dof.max()) + 1
    energy = _energy(points[corners], ratio)
    for _ in range(60):
        step = _newton_step(points[corners], ratio, unknown, n)
        shift = np.where(dof >= 0, step[dof], 0.0)
        length = 1.0
        while (lower := _energy((points + length * shift)[corners], ratio)) >= energy:
            length /= 2
            if length < 1e-6:
                return points
        points, energy = points + length * shift, lower
        if length * np.abs(shift).max() < tolerance:
            break
    return points


def _energy(xyz: FloatArray, ratio: FloatArray) -> float:
    """Return the functional, infinite where a corner (k, 3, 2) is folded."""
    edges = xyz.reshape(-1, 6) @ _EDGES.T
    cross = np.einsum("ki,ij,kj->k", edges, _CROSS, edges) / 2
    if cross.min() <= 0:
        return float("inf")
    return float(np.sum(_stretch(edges, ratio) / (2 * cross)))


def _stretch(edges: FloatArray, ratio: FloatArray) -> FloatArray:
    a, b = edges[:, :2], edges[:, 2:]
    return ratio * np.einsum("ki,ki->k", a, a) + np.einsum("ki,ki->k", b, b) / ratio


def _newton_step(xyz: FloatArray, ratio: FloatArray, unknown: IntArray, n: int) -> FloatArray:
    """Return the Newton step (n,), with the Hessian of each corner made positive."""
    edges = xyz.reshape(-1, 6) @ _EDGES.T
    scale = np.column_stack([ratio, ratio, 1 / ratio, 1 / ratio])
    num, num1 = _stretch(edges, ratio), 2 * scale * edges
    det1 = edges @ _CROSS
    det = np.einsum("ki,ki->k", edges, det1) / 2
    gradient = num1 / (2 * det)[:, None] - det1 * (num / (2 * det**2))[:, None]
    mixed = num1[:, :, None] * det1[:, None, :]
    hessian = (
        scale[:, :, None] * np.eye(4) / det[:, None, None]
        - (mixed + mixed.transpose(0, 2, 1)) / (2 * det**2)[:, None, None]
        - _CROSS * (num / (2 * det**2))[:, None, None]
        + det1[:, :, None] * det1[:, None, :] * (num / det**3)[:, None, None]
    )
    values, vectors = np.linalg.eigh(hessian)
    hessian = (vectors * np.maximum(values, 0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return _solve(_EDGES.T @ hessian @ _EDGES, gradient @ _EDGES, unknown, n)


def _solve(hessian: FloatArray, gradient: FloatArray, unknown: IntArray, n: int) -> FloatArray:
    """Return the step from the corners' Hessians (k, 6, 6) and gradients (k, 6)."""
    free = unknown >= 0
    right = np.bincount(unknown[free], gradient[free], minlength=n)
    rows, columns = np.broadcast_arrays(unknown[:, :, None], unknown[:, None, :])
    both = free[:, :, None] & free[:, None, :]
    matrix = coo_array((hessian[both], (rows[both], columns[both])), shape=(n, n)).tocsc()
    return -splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve(right)
