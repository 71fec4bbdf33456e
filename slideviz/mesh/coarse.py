"""Coarse surfaces: boundaries with fewer facets, for pictures that must come quickly.

All nodes in one cube of a lattice are replaced by one of them. It is the same for all boundaries,
so that there are no gaps between them, and a node at a boundary's rim where the cube has one, so
that corners stay in place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.surfaces import Surface

LEAST = 30_000
"""Facets of all boundaries together, below which there are no coarse surfaces."""
CUBES = 120
"""Cubes along the longest side of the box around all boundaries; each is some pixels wide."""


def coarse_surfaces(
    surfaces: Sequence[Surface], points: FloatArray, cubes: int | None = None
) -> tuple[Surface, ...]:
    """Return the boundaries of a 3D mesh with fewer facets.

    Parameters
    ----------
    surfaces : sequence of Surface
    points : (n, 3) float64
        Of the mesh. The nodes of coarse surfaces are nodes of the mesh too, and move with them.
    cubes : int, optional
        Cubes along the longest side; None: `CUBES`.

    Returns
    -------
    tuple of Surface
        In the order of ``surfaces``; a facet has the owner of one of the facets it replaces. Empty
        for a 2D mesh, and where all have fewer than `LEAST` facets together.
    """
    if sum(len(one.facets) for one in surfaces) < LEAST or any(one.flat for one in surfaces):
        return ()
    nodes = np.unique(np.concatenate([one.nodes for one in surfaces]))
    border = np.zeros(len(nodes), bool)
    for one in surfaces:
        border[np.searchsorted(nodes, one.nodes[np.unique(one.rim)])] = True
    stands = nodes[_representatives(points[nodes], border, cubes or CUBES)]
    return tuple(_coarse(one, stands[np.searchsorted(nodes, one.nodes)]) for one in surfaces)


def _representatives(points: FloatArray, first: np.ndarray, cubes: int) -> IntArray:
    """Return for each of the points (n, 3) the index (n,) of the one that replaces it.

    It is the point nearest to the mean of those in the same cube, among those where the mask
    ``first`` (n,) is true if the cube has any.
    """
    low, size = points.min(axis=0), float(np.ptp(points, axis=0).max()) / cubes or 1.0
    at = ((points - low) / size).astype(np.int64)
    key = (at[:, 0] * (cubes + 1) + at[:, 1]) * (cubes + 1) + at[:, 2]
    _, cube, count = np.unique(key, return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(cube, column) / count for column in points.T])
    away = np.linalg.norm(points - middle[cube], axis=1)
    order = np.lexsort((away, ~first, cube))
    chosen = order[np.concatenate([[0], np.cumsum(count)[:-1]])]
    return np.asarray(chosen[cube])


def _coarse(surface: Surface, stands: IntArray) -> Surface:
    """Return a surface with mesh nodes ``stands`` (u,) in place of its nodes (u,), without a rim.

    Facets that collapse, and all but one of those that become equal, are left out.
    """
    facets = stands[surface.facets]
    # A side whose nodes became one is removed: a triangle is left, with its last node twice.
    for side in range(3):
        gone = facets[:, side] == facets[:, side + 1]
        facets[gone, side + 1 : 3] = facets[gone, side + 2 : 4]
    gone = facets[:, 3] == facets[:, 0]
    facets[gone, 3] = facets[gone, 2]
    a, b, c, d = facets.T
    keep = np.flatnonzero((a != b) & (b != c) & (a != c) & (b != d) & (a != d))
    keep = keep[_first_of_each(facets[keep])]
    used, local = np.unique(facets[keep], return_inverse=True)
    return replace(
        surface,
        nodes=used,
        facets=local.reshape(-1, 4),
        owner=surface.owner[keep],
        rim=np.empty((0, 2), np.int64),
    )


def _first_of_each(facets: IntArray) -> IntArray:
    """Return ascending indices (k,) of facets (f, 4), the first of those equal as cycles of nodes.

    Facets are equal if they have the same nodes in the same cyclic order.
    """
    begin = facets.argmin(axis=1)
    # A triangle is a cycle of three nodes; its fourth repeats the third.
    triangle = facets[:, 2] == facets[:, 3]
    turn = np.arange(4)[None, :] + begin[:, None]
    turned = np.take_along_axis(facets, turn % np.where(triangle, 3, 4)[:, None], axis=1)
    turned[triangle, 3] = turned[triangle, 2]
    return np.sort(np.unique(turned, axis=0, return_index=True)[1])
