"""Surfaces: the boundaries of a mesh as arrays to be drawn (2D: lines; 3D: faces)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, Mesh, offsets_of, row_norms
from slideviz.mesh.polyhedra import whole_polygons
from slideviz.mesh.topology import (
    Boundary,
    distinct_edges,
    edge_keys,
    facet_edges,
    real_corners,
    single_edges,
)
from slideviz.system.weak_cache import WeakCache

LEAST = 30_000  # facets of all boundaries together, below which there are no coarse surfaces
CUBES = 120
"""Cubes along the longest side of the box around all boundaries; each is some pixels wide."""


def coarse_surfaces(
    surfaces: Sequence[Surface], points: FloatArray, cubes: int | None = None
) -> tuple[Surface, ...]:
    """Return the boundaries of a 3D mesh with fewer facets, in the order of ``surfaces``.

    A facet has the owner of one of the facets it replaces. Empty for a 2D mesh, and where all have
    fewer than `LEAST` facets together. ``points`` (n, 3) are those of the mesh: the nodes of coarse
    surfaces are nodes of the mesh too, and move with them. ``cubes``: along the longest side;
    None: `CUBES`.
    """
    if sum(len(one.facets) for one in surfaces) < LEAST or any(one.flat for one in surfaces):
        return ()
    nodes = np.unique(np.concatenate([one.nodes for one in surfaces]))
    border = np.zeros(len(nodes), bool)
    for one in surfaces:
        border[np.searchsorted(nodes, one.nodes[np.unique(one.rim)])] = True
    representatives = nodes[_representatives(points[nodes], border, cubes or CUBES)]
    at = (np.searchsorted(nodes, one.nodes) for one in surfaces)
    return tuple(map(_merge_nodes, surfaces, (representatives[each] for each in at)))


def _representatives(points: FloatArray, first: BoolArray, cubes: int) -> IntArray:
    """Return for each of the points (n, 3) the index (n,) of the one that replaces it.

    It is the point nearest to the mean of those in the same cube, among those where the mask
    ``first`` (n,) is true if the cube has any.
    """
    low = points.min(axis=0)
    size = float(np.ptp(points, axis=0).max()) / cubes or 1.0
    at = ((points - low) / size).astype(np.int64)
    key = (at[:, 0] * (cubes + 1) + at[:, 1]) * (cubes + 1) + at[:, 2]
    _, cube, count = np.unique(key, return_inverse=True, return_counts=True)
    middle = np.column_stack([np.bincount(cube, column) / count for column in points.T])
    away = row_norms(points - middle[cube])
    order = np.lexsort((away, ~first, cube))
    chosen = order[np.concatenate([[0], np.cumsum(count)[:-1]])]
    return chosen[cube]


def _merge_nodes(surface: Surface, representatives: IntArray) -> Surface:
    """Return a surface whose nodes (u,) are merged into ``representatives`` (u,), without a rim.

    Collapsed facets are left out. Of facets that become equal, only the first is kept.
    """
    width = surface.facets.shape[1]
    corners = [[0, k, k + 1, min(k + 2, width - 1)] for k in range(1, width - 1, 2)]
    facets = representatives[np.concatenate([surface.facets[:, some] for some in corners])]
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
        owner=surface.owner[keep % len(surface.owner)],
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


_BESIDE = 1e-6
"""Least distance of an inner boundary from the box around all, as a part of its longest side."""


@frozen
class Enclosing:
    """Whether boundaries enclose a volume (`is_closed`), and names of inner ones (`enclosed`)."""

    closed: bool
    inner: frozenset[str]


_ENCLOSING = WeakCache()


def enclosing_of(mesh: Mesh, surfaces: Sequence[Surface]) -> Enclosing:
    """Return what boundaries of a mesh enclose; cached by their names as long as the mesh lives."""
    names = tuple(one.name for one in surfaces)
    return _ENCLOSING.of(
        mesh, names, lambda: Enclosing(is_closed(surfaces), enclosed(surfaces, mesh.points))
    )


def enclosed(surfaces: Sequence[Surface], points: FloatArray) -> frozenset[str]:
    """Return the names of boundaries of a 3D mesh that lie inside the others, as a wing in air.

    Inside are those whose bounding box touches no side of the box around all. ``points`` (n, d) are
    those of the mesh.
    """
    boxes = {
        one.name: (points[one.nodes].min(axis=0), points[one.nodes].max(axis=0))
        for one in surfaces
        if not one.flat
    }
    if not boxes:
        return frozenset()
    low = np.min([box[0] for box in boxes.values()], axis=0)
    high = np.max([box[1] for box in boxes.values()], axis=0)
    beside = _BESIDE * float((high - low).max())
    return frozenset(
        name
        for name, box in boxes.items()
        if (box[0] > low + beside).all() and (box[1] < high - beside).all()
    )


def is_closed(surfaces: Sequence[Surface]) -> bool:
    """Return whether faces (3D) enclose a volume: each edge belongs to exactly two of them."""
    faces = [one.nodes[one.facets] for one in surfaces if not one.flat]
    if len(faces) != len(surfaces) or not faces:
        return False
    keys = edge_keys(facet_edges(np.concatenate(faces)))
    return bool((np.unique(keys, return_counts=True)[1] == 2).all())


@record
class Surface:
    """One boundary, ready to be drawn."""

    name: str  # the marker
    nodes: IntArray  # (u,): the mesh nodes it uses
    facets: IntArray
    """(f, 2 or k): its lines or faces, as indices into ``nodes``; a triangle repeats its last node,
    as does each face with fewer nodes than others."""
    owner: IntArray  # (f,): the cell whose side each facet is
    rim: IntArray  # (r, 2): edges that only one facet has, as indices into nodes; empty in 2D

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
    """Return facets (f, 2 or k) as VTK's flat array: for each its number of nodes, then these."""
    sizes = real_corners(facets).sum(axis=1)
    return np.column_stack([sizes, facets])[np.arange(facets.shape[1] + 1) <= sizes[:, None]]


def find_surfaces(mesh: Mesh) -> tuple[Surface, ...]:
    """Return a surface for each marker of the mesh, in their order.

    Raises MeshError if a marker element is not a side of any cell.
    """
    if not mesh.markers:
        return ()
    boundary = boundary_of(mesh)
    table, kept = _whole_faces(mesh, boundary)
    owner = mesh.first_parts(boundary.owner[kept])
    surfaces = []
    for index, name in enumerate(boundary.names):
        mine = boundary.marker[kept] == index
        nodes, local = np.unique(table[mine], return_inverse=True)
        facets = local.reshape(-1, table.shape[1])
        surfaces.append(Surface(name, nodes, facets, owner[mine], _rim(facets)))
    return tuple(surfaces)


def _whole_faces(mesh: Mesh, boundary: Boundary) -> tuple[IntArray, IntArray | slice]:
    """Return the faces (f, k) of the mesh's file on the boundary, and a facet of each."""
    facets = boundary.facets
    if mesh.whole_cells is None or mesh.dim == 2:
        return facets, slice(None)
    keep = real_corners(facets)
    offsets = offsets_of(keep.sum(axis=1))
    offsets, nodes, kept = whole_polygons(mesh, offsets, facets[keep], boundary.owner, sides=True)
    sizes = np.diff(offsets)[:, None]
    corners = np.minimum(np.arange(max(4, sizes.max())), sizes - 1)
    return nodes[offsets[:-1, None] + corners], kept


def _rim(facets: IntArray) -> IntArray:
    """Return the edges (r, 2), nodes sorted, that only one of the faces (f, k) has; none in 2D."""
    if facets.shape[1] == 2:
        return np.empty((0, 2), np.int64)
    edges = facet_edges(facets)
    return distinct_edges(edges[single_edges(edges)])
