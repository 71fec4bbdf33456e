"""The facet, edge or vertex of a track that a closest point is on, as an affine map.

With the primitive kept, the closest point is ``a + P (x - a)``: P removes the normal of a facet,
keeps the direction of an edge, and is zero at a vertex. P is its own derivative.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray

CLOSE = 2e-6
"""A closest point of the plane of a facet, or the line of an edge, is that of the facet or edge
when it is not farther from it than this part of its distance from the node: so a node that slides
along a line of the mesh on a flat boundary is on a facet, whatever rounding says, and ties that
the search did not tell apart do not matter."""

ROUNDING = 1e-9
"""The same as a part of the size of the facet."""


def projection_matrices(corners: FloatArray, x: FloatArray, closest: FloatArray) -> FloatArray:
    """Return the projections P (m, d, d) of the primitives that closest points are on.

    Parameters
    ----------
    corners : (m, c, d)
        Of the segment (c = 2) or triangle (c = 3) that each closest point is on.
    x, closest : (m, d)
        Nodes, and their closest points on these simplices, which are points of the primitives.
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
    """Return projections on the planes of triangles, and which nodes' closest points are theirs."""
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
