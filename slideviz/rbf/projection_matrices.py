"""Derivatives of projections: a closest point as an affine map of the node.

While the primitive that it is on (facet, edge or vertex) stays the same, the closest point of x is
``a + P (x - a)``: P is I - n n^T on a facet, t t^T on an edge and zero at a vertex, and is the
derivative of the projection. The projection itself is in `slideviz.rbf.projection`.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray

CLOSE = 2e-6
"""A closest point is on a facet (or an edge) when the foot of the node on its plane (or line) is
within this part of the node's distance from it. So a node that slides along a line of the mesh on
a flat boundary is on a facet, whatever rounding says, and the choice of the search among equally
near facets does not matter."""

ROUNDING = 1e-9
"""Part of the facet's size by which that limit is increased."""


def projection_matrices(corners: FloatArray, x: FloatArray, closest: FloatArray) -> FloatArray:
    """Return the derivatives P (m, d, d) of closest points with respect to their nodes.

    Parameters
    ----------
    corners : (m, c, d)
        Of the segment (c = 2) or triangle (c = 3) that each closest point is on.
    x, closest : (m, d)
        Nodes, and their closest points on the simplices.
    """
    m, count, d = corners.shape
    size = np.ptp(corners, axis=1).max(axis=1)
    near = CLOSE * np.linalg.norm(x - closest, axis=1) + ROUNDING * size
    out, done = np.zeros((m, d, d)), np.zeros(m, bool)
    if count == 3:
        out, done = _facets(corners, x, closest, near)
    sides = [(0, 1)] if count == 2 else [(0, 1), (1, 2), (2, 0)]
    for one, two in sides:
        along = corners[:, two] - corners[:, one]
        length = np.linalg.norm(along, axis=1)
        use = ~done & (length > 0)
        t = along / np.where(length > 0, length, 1.0)[:, None]
        reach = np.einsum("md,md->m", x - corners[:, one], t)
        foot = corners[:, one] + reach[:, None] * t
        use &= np.linalg.norm(foot - closest, axis=1) <= near
        out[use] = t[use, :, None] * t[use, None, :]
        done |= use
    return out


def _facets(
    corners: FloatArray, x: FloatArray, closest: FloatArray, near: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return projections on planes of triangles (m, 3, 3), and a mask (m,) where these apply.

    They apply where the foot on the plane is within ``near`` (m,) of the closest point; elsewhere
    the matrix is zero.
    """
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, two)
    area = np.linalg.norm(normal, axis=1)
    flat = area > 0
    normal /= np.where(flat, area, 1.0)[:, None]
    height = np.einsum("md,md->m", x - corners[:, 0], normal)
    foot = x - height[:, None] * normal
    on = flat & (np.linalg.norm(foot - closest, axis=1) <= near)
    out = np.zeros((len(x), 3, 3))
    out[on] = np.eye(3) - normal[on, :, None] * normal[on, None, :]
    return out, on
