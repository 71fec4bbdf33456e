"""Surfaces: the boundaries of a mesh as arrays to be drawn (2D: lines; 3D: faces)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.nearest import row_groups


@dataclass(frozen=True, eq=False)
class Surface:
    """One boundary, ready to be drawn."""

    name: str
    """The marker."""
    nodes: IntArray
    """(u,): the mesh nodes it uses."""
    facets: IntArray
    """(f, 2 or 4): its lines or faces, as indices into ``nodes``; a triangle repeats its last
    node."""
    owner: IntArray
    """(f,): the cell whose side each facet is."""
    rim: IntArray
    """(r, 2): edges that only one facet has, as indices into ``nodes``; empty in 2D."""

    @property
    def flat(self) -> bool:
        """Return whether it is the boundary of a 2D mesh, made of lines."""
        return self.facets.shape[1] == 2


def padded(points: FloatArray) -> FloatArray:
    """Return points (n, d) as (n, 3), with z = 0 if d = 2."""
    if points.shape[1] == 3:
        return points
    return np.column_stack([points, np.zeros(len(points))])


def lifted(points: FloatArray, by: float) -> FloatArray:
    """Return points (n, d) as (n, 3), moved along z by the length ``by``."""
    return padded(points) + np.array([0.0, 0.0, by])


def facet_connectivity(facets: IntArray) -> IntArray:
    """Return facets (f, 2 or 4) as VTK's flat array: for each its number of nodes, then these."""
    if facets.shape[1] == 2:
        return np.column_stack([np.full(len(facets), 2), facets]).ravel()
    triangle = facets[:, 2] == facets[:, 3]
    table = np.column_stack([np.where(triangle, 3, 4), facets])
    keep = np.ones(table.shape, bool)
    keep[triangle, 4] = False
    return table[keep]


def find_surfaces(mesh: Mesh) -> tuple[Surface, ...]:
    """Return a surface for each marker of the mesh, in their order.

    Raises
    ------
    MeshError
        A marker element is no side of any cell.
    """
    if not mesh.markers:
        return ()
    boundary = boundary_of(mesh)
    found = []
    for index, name in enumerate(boundary.names):
        mine = boundary.marker == index
        nodes, local = np.unique(boundary.facets[mine], return_inverse=True)
        facets = local.reshape(-1, boundary.facets.shape[1])
        found.append(Surface(name, nodes, facets, boundary.owner[mine], _rim(facets)))
    return tuple(found)


def _rim(facets: IntArray) -> IntArray:
    """Return the edges (r, 2), nodes sorted, that only one of the faces (f, 4) has; none in 2D."""
    if facets.shape[1] == 2:
        return np.empty((0, 2), np.int64)
    edges = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    group = row_groups(edges)
    once = np.bincount(group) == 1
    rim = np.empty((len(once), 2), np.int64)
    rim[group] = edges
    return rim[once]
