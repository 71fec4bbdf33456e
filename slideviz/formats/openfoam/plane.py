"""Meshes of one layer of cells, between empty patches or two wedges, as plane ones.

Of empty patches the plane is that of two coordinates; of wedges it is the front one, with the
coordinates along the axis and away from it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import record
from slideviz.formats.openfoam.cells import Built, ordered_cells, sound_quadrilaterals
from slideviz.formats.openfoam.foam_file import Patch
from slideviz.mesh.model import (
    Cells,
    FloatArray,
    IntArray,
    Marker,
    offsets_of,
    ranges,
    row_dots,
)
from slideviz.mesh.polyhedra import Faces

WEDGE = "wedge"
_FLAT_TYPES = ("empty", WEDGE)
STRAIGHT = 1e-9  # an axis is a coordinate's where its cosine is this near to 1
AXIS = "axis"  # name of the boundary on the axis of a wedge, which has no patch


@record
class Layer:
    """Where the points of a layer are in its plane."""

    node: (
        IntArray  # (n,): the node of the plane that each point goes with; -1: it belongs to no cell
    )
    ways: FloatArray  # (n, 2, 3): the directions in which the point goes with its coordinates
    flat: FloatArray  # (p, 2): the coordinates in the plane, undeformed

    def displaced(self, points: FloatArray, flat: FloatArray) -> FloatArray:
        """Return ``points`` (n, 3) of a layer whose plane has the coordinates ``flat`` (p, 2)."""
        moved = np.where(
            self.node[:, None] < 0, 0.0, (flat[: len(self.flat)] - self.flat)[self.node]
        )
        return points + np.einsum("nk,nkd->nd", moved, self.ways)


@record
class Plane:
    """The plane mesh of a layer."""

    layer: Layer
    built: Built
    faces: Faces
    markers: tuple[Marker, ...]
    axis: str  # name of the boundary on the axis of a wedge


def plane_of(faces: Faces, points: FloatArray, patches: Sequence[Patch]) -> Plane | None:
    """Return the plane mesh of a layer of cells, or None if the cells are not one."""
    flats = [one for one in patches if one.kind in _FLAT_TYPES and one.count]
    if not flats:
        return None
    areas = faces.geometry(points)[1]
    covers = np.concatenate([np.arange(one.start, one.start + one.count) for one in flats])
    ahead = areas[covers] @ areas[covers[0]] > 0
    front = covers[ahead][np.argsort(faces.owner[covers[ahead]])]
    back = covers[~ahead][np.argsort(faces.owner[covers[~ahead]])]
    cells = np.arange(faces.n_cells)
    if not all(np.array_equal(faces.owner[ids], cells) for ids in (front, back)):
        return None
    on_front, on_back = np.zeros((2, len(points)), bool)
    for ids, mask in ((front, on_front), (back, on_back)):
        mask[_entries(faces, ids, faces.nodes)] = True
    used = np.flatnonzero(on_front)
    node = np.full(len(points), -1)
    node[used] = np.arange(len(used))
    here = faces.nodes
    there = faces.next_nodes()
    for one, other in ((here, there), (there, here)):
        across = on_front[one] & ~on_back[one] & on_back[other] & ~on_front[other]
        node[other[across]] = node[one[across]]
    sides = np.delete(np.arange(len(areas)), covers)
    of_face = np.repeat(np.arange(len(areas)), np.diff(faces.offsets))
    rows = np.flatnonzero(on_front[here] & on_front[there] & ~np.isin(of_face, covers))
    if (node[on_back] < 0).any() or not np.array_equal(of_face[rows], sides):
        return None
    normals = [areas[ids].sum(axis=0) for ids in (front, back)]
    bases, origin = (
        _wedge((points[on_front], points[on_back]), normals)
        if flats[0].kind == WEDGE
        else _empty(normals[0])
    )
    ways = np.where((on_back & ~on_front)[:, None, None], bases[1], bases[0])
    coords = np.stack([(points[used] - origin) @ way for way in bases[0]], axis=1)
    sizes = np.diff(faces.offsets)[front]
    outline = Faces(offsets_of(sizes), node[_entries(faces, front, here)], cells, cells[:0])
    # A face traverses an edge the other way round than the front of its owner.
    edges = np.stack([node[there[rows]], node[here[rows]]], axis=1)
    on_axis = (on_front & on_back)[used]
    around = np.stack([outline.nodes, outline.next_nodes()], axis=1)
    lone = on_axis[around].all(axis=1)
    coords[on_axis, 1] = 0.0
    edges = np.concatenate([edges, around[lone]])
    owner = np.concatenate([faces.owner[sides], np.repeat(cells, sizes)[lone]])
    built, turned = _triangulated(outline, coords)
    if turned:
        edges = edges[:, ::-1]
    taken = [one.name for one in patches if one.count]
    axis = next(name for name in (AXIS, *(f"{AXIS}_{k}" for k in range(9))) if name not in taken)
    lines = {one.name: (sides >= one.start) & (sides < one.start + one.count) for one in patches}
    lines = {name: np.append(some, np.zeros(lone.sum(), bool)) for name, some in lines.items()}
    lines[axis] = np.arange(len(edges)) >= len(sides)
    markers = tuple(
        Marker(name, Cells.from_blocks([(3, edges[some])]))
        for name, some in lines.items()
        if some.any()
    )
    sides_of_cells = Faces(
        np.arange(0, 2 * len(edges) + 1, 2), edges.ravel(), owner, faces.neighbour
    )
    return Plane(Layer(node, ways, coords), built, sides_of_cells, markers, axis)


def _entries(faces: Faces, ids: IntArray, values: IntArray) -> IntArray:
    """Return those of ``values`` (k,), one for each node of faces, of the faces ``ids``."""
    return values[ranges(faces.offsets[ids], np.diff(faces.offsets)[ids])]


def _empty(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the directions (2, 2, 3) of a layer between empty patches, and the point 0 (3,)."""
    ways = np.delete(np.eye(3), np.argmax(np.abs(normal)), axis=0)
    return np.stack([ways, ways]), np.zeros(3)


def _wedge(
    sheets: Sequence[FloatArray], normals: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Return the directions (2, 2, 3) along the axis and away from it, and a point (3,) on it.

    ``sheets``: the points (k, 3) of both wedges; ``normals``: vectors (3,) normal to these.
    """
    units = np.stack([normal / np.linalg.norm(normal) for normal in normals])
    axis = np.cross(*units)
    axis /= np.linalg.norm(axis) * np.sign(axis[np.argmax(np.abs(axis))])
    if np.abs(axis).max() > 1 - STRAIGHT:
        axis = np.round(axis)
    middles = np.stack([sheet.mean(axis=0) for sheet in sheets])
    origin = np.linalg.lstsq(units, row_dots(units, middles), rcond=None)[0]
    away = np.cross(axis, units)
    away *= np.sign(row_dots(away, middles - origin))[:, None]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    return np.stack([np.broadcast_to(axis, away.shape), away], axis=1), origin


def _triangulated(outline: Faces, coords: FloatArray) -> tuple[Built, bool]:
    """Return plane cells from polygons, one for each cell, and whether these are clockwise.

    Those of more than four edges are triangles around their centre.
    """
    sizes = np.diff(outline.offsets)
    first = coords[outline.nodes]
    second = coords[outline.next_nodes()]
    areas = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    turned = bool(areas.sum() < 0)
    tables = []
    several = np.ones(len(sizes), bool)
    for size, vtk in ((3, 5), (4, 9)):
        ids = np.flatnonzero(sizes == size)
        nodes = outline.nodes[outline.offsets[ids][:, None] + np.arange(size)]
        sound = np.full(len(ids), size == 3)
        if size == 4:
            sound = sound_quadrilaterals(np.pad(coords[nodes], ((0, 0), (0, 0), (0, 1))))
        several[ids[sound]] = False
        tables.append((ids[sound], ids[sound], vtk, nodes[sound]))
    cells = np.repeat(np.arange(len(sizes)), sizes)
    rows = np.flatnonzero(several[cells])
    moments = np.stack([np.bincount(cells, areas * x) for x in (first + second).T], axis=1)
    with np.errstate(all="ignore"):
        middles = (moments / (3 * np.bincount(cells, areas))[:, None])[several]
    apex = len(coords) + (np.cumsum(several) - 1)[cells[rows]]
    sides = outline.nodes[rows], outline.next_nodes()[rows], apex
    tables.append((cells[rows], rows, 5, np.stack(sides, axis=1)))
    if turned:
        tables = [(*ids, vtk, nodes[:, ::-1]) for *ids, vtk, nodes in tables]
    return ordered_cells(tables, np.concatenate([coords, middles])), turned
