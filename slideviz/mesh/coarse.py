"""Coarse surfaces: boundaries with fewer facets, for pictures that must come quickly.

Nodes in one cube of a lattice become one of them. Boundaries share the choice, so that there are
no gaps between them, and nodes at their borders come first, so that corners stay where they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.surfaces import Surface

LEAST = 30_000
"""Facets of all boundaries together, below which nothing is made coarser."""
CUBES = 120
"""Cubes along the longest side of the box around the boundaries: some pixels each."""


def coarse_surfaces(
    surfaces: Sequence[Surface], points: FloatArray, cubes: int | None = None
) -> tuple[Surface, ...]:
    """Return the boundaries of a 3D mesh with fewer facets; none where there are few already.

    Parameters
    ----------
    surfaces : sequence of Surface
    points : (n, 3) float64
        Of the mesh. The nodes of coarse surfaces are some of its nodes, and move with them.
    cubes : int, optional
        Along the longest side; None: `CUBES`.

    Returns
    -------
    tuple of Surface
        In the order of ``surfaces``; a facet has the owner of one of the facets it stands for.
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
    """Return the point that stands for each of some points (n, 3), (n,): of its cube.

    It is the nearest to the middle of those in the cube, of the ``first`` (n,) where there are.
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
    """Return a surface whose nodes (u,) are replaced by others, mesh nodes (u,)."""
    facets = stands[surface.facets]
    # A side of length zero goes: what is left is a triangle, whose last node stands twice.
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
    """Return the first of facets (f, 4) that go round the same nodes the same way, in order."""
    begin = facets.argmin(axis=1)
    # A triangle goes round three nodes.
    triangle = facets[:, 2] == facets[:, 3]
    turn = np.arange(4)[None, :] + begin[:, None]
    turned = np.take_along_axis(facets, turn % np.where(triangle, 3, 4)[:, None], axis=1)
    turned[triangle, 3] = turned[triangle, 2]
    return np.sort(np.unique(turned, axis=0, return_index=True)[1])
