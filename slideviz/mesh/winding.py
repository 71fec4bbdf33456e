"""How often closed surfaces wind around points: 1 inside of them, 0 outside."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray


def winding(points: FloatArray, facets: IntArray, at: FloatArray) -> FloatArray:
    """Return how often a surface winds around each point, (m,): 1 inside it, 0 outside.

    Whole numbers for a closed surface, whatever its shape; near them where it has small gaps.

    Parameters
    ----------
    points : (n, d) float64
    facets : (f, k) int64
        The surface, its normals outwards: k = 2 in 2D; 4 in 3D, where a triangle repeats its last
        node. (``Boundary.facets``)
    at : (m, d) float64
        Points that are not on it.

    Notes
    -----
    The sum of the angles that the facets are seen at: in 3D solid ones, by Van Oosterom and
    Strackee (IEEE Trans. Biomed. Eng. 30, 1983), of two triangles for each quadrilateral.
    """
    if facets.shape[1] == 2:
        return np.array([_plane(points[facets] - p) for p in at])
    halves = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    corners = points[halves[halves[:, 1] != halves[:, 2]]]
    return np.array([_space(corners - p) for p in at])


def _plane(arms: FloatArray) -> float:
    """Return the winding of lines with these ends (f, 2, 2) around 0."""
    (a, b), (c, d) = arms[:, 0].T, arms[:, 1].T
    return float(np.arctan2(a * d - b * c, a * c + b * d).sum() / (2.0 * np.pi))


def _space(arms: FloatArray) -> float:
    """Return the winding of triangles with these corners (f, 3, 3) around 0."""
    a, b, c = arms.transpose(1, 0, 2)
    u, v, w = np.sqrt((arms * arms).sum(axis=2)).T
    ab, bc, ca = ((p * q).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    volume = (a * np.cross(b, c)).sum(axis=1)
    half = np.arctan2(volume, u * v * w + ab * w + bc * u + ca * v)
    return float(half.sum() / (2.0 * np.pi))
