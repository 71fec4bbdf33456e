"""Outer surface of a mesh, with or without markers, and its `Boundary`, cached while it lives."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.adjacency import NONE, sides_of
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.fans import find_pieces
from slideviz.mesh.model import DEFAULT_FEATURE_ANGLE_DEG, Cells, IntArray, Marker, Mesh
from slideviz.mesh.topology import find_boundary
from slideviz.system.weak_cache import weak_cache

_MOST_PARTS = 64
"""Most parts that `smooth_parts` returns; a surface with more is rough, its edges no borders."""
_VTK = {2: 3, 3: 5, 4: 9}  # VTK identifier of a facet by its number of nodes


def outer_facets(mesh: Mesh) -> Cells:
    """Return the sides that only one cell has, as lines (2D) or triangles and quadrilaterals."""
    sides = sides_of(mesh.cells)
    tables = dict[int, list[IntArray]]()
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        for k, local in enumerate(ELEMENTS[vtk].facets):
            alone = sides.neighbour[sides.first[ids] + k] == NONE
            tables.setdefault(len(local), []).append(nodes[alone][:, local])
    blocks = ((_VTK[size], np.concatenate(found)) for size, found in sorted(tables.items()))
    return Cells.from_blocks([block for block in blocks if len(block[1])])


def smooth_parts(mesh: Mesh, facets: Cells) -> tuple[Marker, ...]:
    """Return the outer surface as markers, divided at its feature edges, most facets first.

    With more than ``_MOST_PARTS`` parts it is divided into its connected parts only, with more of
    these or a single one not at all. No markers if there are no facets. ``facets``: the sides to
    divide, each of one cell of the mesh, which has points and cells.
    """
    if not len(facets):
        return ()
    whole = Mesh(mesh.points, mesh.cells, (Marker("boundary", facets),), name=mesh.name)
    boundary = find_boundary(whole)
    piece = find_pieces(boundary, mesh.points, DEFAULT_FEATURE_ANGLE_DEG)
    if piece.max() >= _MOST_PARTS:
        piece = find_pieces(boundary, mesh.points, 180.0)
    if piece.max() >= _MOST_PARTS or piece.max() == 0:
        return whole.markers
    order = np.argsort(-np.bincount(piece), kind="stable")
    return tuple(
        Marker(f"boundary_{number}", _as_cells(boundary.facets[piece == k]))
        for number, k in enumerate(order.tolist(), 1)
    )


def _as_cells(facets: IntArray) -> Cells:
    """Return facets (f, 2), or (f, 4) where a triangle repeats its last node, as cells."""
    if facets.shape[1] == 2:
        return Cells.from_blocks([(3, facets)])
    triangle = facets[:, 2] == facets[:, 3]
    return Cells.from_blocks([(5, facets[triangle][:, :3]), (9, facets[~triangle])])


boundary_of = weak_cache(find_boundary)
"""Returns the `Boundary` of a mesh, cached as long as the mesh lives."""


@weak_cache
def shell_of(mesh: Mesh) -> IntArray:
    """Return the sides that only one cell has, oriented outward: nodes (f, 2) or (f, 4); cached.

    They count in a marker or not, so that they enclose the mesh even where markers do not: where a
    boundary has no marker, or where a halo continues the cells beyond the periodic sides.
    """
    marker = Marker("shell", outer_facets(mesh))
    return find_boundary(Mesh(mesh.points, mesh.cells, (marker,), name=mesh.name)).facets
