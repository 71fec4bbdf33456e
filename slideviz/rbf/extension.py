"""The continuation of a sliding boundary beyond the rim of a moving boundary that stands on it.

A blade that moves along its hub leaves the place where it stood, and nodes of the hub slide into
that place; but the hub has no facets there. So at the rim of a moving boundary a sliding surface
is extended flat, in the plane of its last facet, as far as the moving boundary moves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import Boundary, unit

Place = Callable[[IntArray], FloatArray]
"""Returns the corners (m, k, d) of facets or segments (m, k), undeformed and in the frame."""


def surface_extension(
    boundary: Boundary, member: np.ndarray, moving: np.ndarray, place: Place, reach: float
) -> FloatArray:
    """Return simplices (s, d, d) that continue a surface (3D) or curve (2D) beyond its moving rim.

    Parameters
    ----------
    member : (f,) bool
        Facets of the surface (3D) or curve (2D).
    moving : (n,) bool
        Nodes of the moving boundaries.
    reach : float
        Length of the extension, in the mesh's length unit.
    """
    one, two = boundary.joints.T
    rim = np.flatnonzero(member[one] != member[two])
    rim = rim[moving[boundary.joint_nodes[rim]].all(axis=1)]
    facet = np.where(member[one[rim]], one[rim], two[rim])
    ends = place(boundary.joint_nodes[rim])
    sides = place(boundary.facets[facet])
    if not len(facet):
        return np.empty((0, boundary.dim, boundary.dim))
    out = ends.mean(axis=1) - sides.mean(axis=1)
    if boundary.dim == 2:
        return np.concatenate([ends, ends + reach * unit(out)[:, None]], axis=1)
    along = unit(ends[:, 1] - ends[:, 0])
    out -= np.einsum("ed,ed->e", out, along)[:, None] * along
    far = ends + reach * unit(out)[:, None]
    first = np.stack([ends[:, 0], ends[:, 1], far[:, 1]], axis=1)
    second = np.stack([ends[:, 0], far[:, 1], far[:, 0]], axis=1)
    return np.concatenate([first, second])


def edge_extension(
    segments: IntArray, moving: np.ndarray, place: Place, reach: float
) -> FloatArray:
    """Return segments (s, 2, d) that continue a chain of segments (m, 2) beyond its moving ends.

    Parameters
    ----------
    moving : (n,) bool
        Nodes of the moving boundaries.
    reach : float
        Length of each segment, in the mesh's length unit.
    """
    node, count = np.unique(segments, return_counts=True)
    last = node[(count == 1) & moving[node]]
    corners = place(segments)
    found = []
    for column in (0, 1):
        rows = np.isin(segments[:, column], last)
        end, before = corners[rows, column], corners[rows, 1 - column]
        found.append(np.stack([end, end + reach * unit(end - before)], axis=1))
    return np.concatenate(found)
