"""Cells from faces: tetrahedra, pyramids, prisms and hexahedra, and all others by their parts.

A face of more than four nodes, or with a node on the line between two others, is divided into
triangles, for both of its cells alike. What is not such an element has a tetrahedron or pyramid on
each of these pieces, with its top at a node added in the middle of the cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.mesh.check import check_mesh
from slideviz.mesh.elements import ELEMENTS, SIZES
from slideviz.mesh.jacobians import INVERTED
from slideviz.mesh.model import (
    BoolArray,
    Cells,
    FloatArray,
    IntArray,
    Mesh,
    offsets_of,
    ranges,
    row_dots,
    row_norms,
    run_begins,
    sealed,
)
from slideviz.mesh.orientation import corner_sums
from slideviz.mesh.polyhedra import Faces
from slideviz.mesh.quality import quality

FLAT = 1e-3
"""A quadrilateral is divided where the triangle at a corner is less than this part of its area."""
_SIDES = {10: (4, 0), 14: (4, 1), 13: (2, 3), 12: (0, 6)}
"""Numbers of triangles and quadrilaterals of an element type."""
_ROUNDS = 6  # in which faces of wrong elements are divided, at most
_STEPS = 100  # in which the top of parts is looked for


@record
class Pieces:
    """The faces, divided into triangles and quadrilaterals."""

    offsets: IntArray  # (f + 1,): face i has the pieces ``offsets[i]`` to ``offsets[i + 1]``
    nodes: IntArray  # (p, 4): a triangle has its first node again as the last one

    def cells(self, faces: slice) -> Cells:
        """Return the pieces of some faces as elements."""
        nodes = self.nodes[self.offsets[faces.start] : self.offsets[faces.stop]]
        triangle = nodes[:, 0] == nodes[:, 3]
        keep = np.ones(nodes.shape, bool)
        keep[triangle, 3] = False
        return Cells.from_types(np.where(triangle, 5, 9), nodes[keep])


def pieces_of(faces: Faces, points: FloatArray, warped: BoolArray) -> Pieces:
    """Return the faces of cells, divided where needed, and where they are ``warped`` (f,)."""
    sizes = np.diff(faces.offsets)
    nodes = faces.nodes[faces.offsets[:-1, None] + [0, 1, 2, 0]]
    quads = np.flatnonzero((sizes == 4) & ~warped)
    nodes[quads, 3] = faces.nodes[faces.offsets[quads] + 3]
    whole = sizes == 3
    whole[quads] = sound_quadrilaterals(points[nodes[quads]])
    found = [(np.flatnonzero(whole), nodes[whole])]
    hinges = _hinges(faces, ~whole)
    for size in np.unique(sizes[~whole]).tolist():
        ids = np.flatnonzero(~whole & (sizes == size))
        entries = faces.offsets[ids][:, None] + np.arange(size)
        nodes = faces.nodes[entries]
        parts = divided(points[nodes], hinges[entries])
        triangles = nodes[np.arange(len(ids))[:, None, None], parts].reshape(-1, 3)
        found.append((np.repeat(ids, size - 2), triangles[:, [0, 1, 2, 0]]))
    owner = np.concatenate([ids for ids, _ in found])
    order = np.argsort(owner, kind="stable")
    offsets = offsets_of(np.where(whole, 1, sizes - 2))
    return Pieces(offsets, np.concatenate([nodes for _, nodes in found])[order])


def _hinges(faces: Faces, some: BoolArray) -> BoolArray:
    """Return where nodes (k,) of ``some`` faces (f,) are in only two faces of one of its cells.

    If both were divided so that they had a triangle at such a node, it would be the same one.
    """
    inner = len(faces.neighbour)
    marked = np.zeros(faces.n_cells, bool)
    marked[faces.owner[some]] = True
    marked[faces.neighbour[some[:inner]]] = True
    sizes = np.diff(faces.offsets)
    hinges = np.zeros(len(faces.nodes), bool)
    entries = []
    keys = []
    for cells in (faces.owner, faces.neighbour):
        ids = np.flatnonzero(marked[cells])
        at = ranges(faces.offsets[ids], sizes[ids])
        entries.append(at)
        keys.append(
            np.repeat(cells[ids], sizes[ids]) * (int(faces.nodes.max()) + 1) + faces.nodes[at]
        )
    _, group, counts = np.unique(np.concatenate(keys), return_inverse=True, return_counts=True)
    hinges[np.concatenate(entries)[counts[group] == 2]] = True
    return hinges


def sound_quadrilaterals(corners: FloatArray) -> BoolArray:
    """Return whether quadrilaterals (m, 4, 3) are convex, and no three corners on a line: (m,)."""
    ahead = np.roll(corners, -1, axis=1) - corners
    areas = np.cross(np.roll(ahead, 1, axis=1), ahead)
    whole = areas.sum(axis=1, keepdims=True)
    sound: BoolArray = ((areas * whole).sum(axis=2) > FLAT * (whole**2).sum(axis=2)).all(axis=1)
    return sound


def divided(corners: FloatArray, hinges: BoolArray) -> IntArray:
    """Return triangles (m, n - 2, 3) that polygons (m, n, 3) are divided into.

    The worst of them, by area over the squares of its sides, is as good as it can be: dynamic
    programming over chains of corners (G. Klincsek, Minimal triangulations of polygonal domains,
    1980). No triangle cuts off a corner that is among ``hinges`` (m, n), if that is possible.
    """
    count, size = corners.shape[:2]
    ahead = np.roll(corners, -1, axis=1)
    normal = np.cross(corners - corners[:, :1], ahead - corners[:, :1]).sum(axis=1)
    normal /= np.fmax(row_norms(normal), np.finfo(float).tiny)[:, None]
    best = np.full((size, size, count), np.inf)
    split = np.zeros((size, size, count), np.int64)

    def shapes(first: int, last: int) -> FloatArray:
        """Return the shapes (count, k) of the triangles on a chord, with each corner between."""
        b = corners[:, first + 1 : last]
        a = np.broadcast_to(corners[:, [first]], b.shape)
        c = np.broadcast_to(corners[:, [last]], b.shape)
        squares = row_norms(b - a) ** 2 + row_norms(c - b) ** 2 + row_norms(a - c) ** 2
        areas = np.cross(b - a, c - a).reshape(-1, 3)
        found = row_dots(areas, np.repeat(normal, b.shape[1], axis=0)).reshape(squares.shape)
        found /= np.fmax(squares, np.finfo(float).tiny)
        cut = np.zeros(found.shape, bool)
        if last - first == 2:
            cut[:, 0] |= hinges[:, first + 1]
        if last - first == size - 1:
            cut[:, 0] |= hinges[:, first]
            cut[:, -1] |= hinges[:, last]
        return np.where(cut, found - 1.0, found)

    for length in range(2, size):
        for first in range(size - length):
            last = first + length
            sides = np.minimum(best[first, first + 1 : last], best[first + 1 : last, last])
            worst = np.minimum(sides, shapes(first, last).T)
            split[first, last] = worst.argmax(axis=0) + first + 1
            best[first, last] = worst.max(axis=0)
    rows = np.arange(count)
    chains = [(rows, np.zeros_like(rows), np.full_like(rows, size - 1))]
    triangles = [(rows[:0], np.empty((0, 3), np.int64))]
    while chains:
        ids, begin, end = chains.pop()
        far = end - begin > 1
        ids = ids[far]
        begin = begin[far]
        end = end[far]
        if len(ids):
            middle = split[begin, end, ids]
            triangles.append((ids, np.stack([begin, middle, end], 1)))
            chains += [(ids, begin, middle), (ids, middle, end)]
    order = np.argsort(np.concatenate([rows for rows, _ in triangles]), kind="stable")
    table = np.concatenate([table for _, table in triangles])[order]
    return table.reshape(count, size - 2, 3)


@record
class Built:
    """Cells built from faces."""

    cells: Cells
    cell: IntArray
    face: IntArray  # `cell`, `face` (m,): see `Polyhedra`
    points: FloatArray  # (n, d): those of the file, and added ones


def cells_of(faces: Faces, points: FloatArray, name: str) -> tuple[Built, Pieces, int]:
    """Return the cells that some faces bound, the pieces of these, and how many are not proved.

    The quadrilaterals of elements that are not valid are divided, too. A part that is hidden from
    its top all the same is numbered the other way round: then it must stay as it is.
    """
    warped = np.zeros(len(faces.owner), bool)
    for _ in range(_ROUNDS):
        pieces = pieces_of(faces, points, warped)
        built = _built(faces, pieces, points)
        # Only its cells are needed, but the size must be fit for computing.
        mesh = Mesh(built.points, built.cells, name=name)
        check_mesh(mesh)
        wrong = np.zeros(faces.n_cells, bool)
        wrong[built.cell[quality(mesh).status == INVERTED]] = True
        before = warped.copy()
        warped |= wrong[faces.owner]
        warped[: len(faces.neighbour)] |= wrong[faces.neighbour]
        if (warped == before).all():
            break
    nodes = built.cells.connectivity.copy()
    hidden = np.flatnonzero((corner_sums(mesh) < 0) & (built.cells.types == 10))
    first = built.cells.offsets[hidden]
    nodes[first], nodes[first + 1] = nodes[first + 1], nodes[first]
    cells = Cells.from_types(built.cells.types, sealed(nodes))
    return replace(built, cells=cells), pieces, len(np.unique(built.cell[hidden]))


def _built(faces: Faces, pieces: Pieces, points: FloatArray) -> Built:
    inner = len(faces.neighbour)
    of_cell = np.concatenate([faces.owner, faces.neighbour])
    sides = np.concatenate([np.arange(len(faces.owner)), np.arange(inner)])
    turned = np.arange(len(sides)) >= len(faces.owner)
    sizes = np.diff(faces.offsets)[sides]
    order = np.lexsort((sizes, of_cell))
    of_cell = of_cell[order]
    sides = sides[order]
    turned = turned[order]
    sizes = sizes[order]
    n_cells = faces.n_cells
    first = offsets_of(np.bincount(of_cell, minlength=n_cells))
    whole = np.diff(pieces.offsets)[sides] == 1

    def number(mask: BoolArray) -> IntArray:
        return np.bincount(of_cell[mask], minlength=n_cells)

    def oriented(rows: IntArray, piece: IntArray) -> IntArray:
        nodes = pieces.nodes[piece]
        return np.where(turned[rows][..., None], nodes[..., ::-1], nodes)

    triangles = number(whole & (sizes == 3))
    quads = number(whole & (sizes == 4))
    kinds = np.zeros(n_cells, np.uint8)
    tables = []
    for vtk, (three, four) in _SIDES.items():
        some = (triangles == three) & (quads == four) & (np.diff(first) == three + four)
        ids = np.flatnonzero(some)
        rows = first[ids][:, None] + np.arange(three + four)
        table, fits = _elements(vtk, oriented(rows, pieces.offsets[sides[rows]]))
        kinds[ids[fits]] = vtk
        tables.append((ids[fits], np.full(fits.sum(), -1), vtk, table[fits]))
    # All others by their parts.
    rows = np.flatnonzero(kinds[of_cell] == 0)
    several = np.diff(pieces.offsets)[sides[rows]]
    piece = ranges(pieces.offsets[sides[rows]], several)
    rows = np.repeat(rows, several)
    nodes = oriented(rows, piece)
    others = np.flatnonzero(kinds == 0)
    rank = np.searchsorted(others, of_cell[rows])
    centres = faces.cell_geometry(points, *faces.geometry(points))[0][others]
    tops = _tops(centres, points[nodes], rank) if len(others) else centres
    apex = len(points) + rank
    flat = nodes[:, 0] == nodes[:, 3]
    for some, vtk, base in ((flat, 10, [0, 2, 1]), (~flat, 14, [0, 3, 2, 1])):
        table = np.append(nodes[some][:, base], apex[some, None], axis=1)
        tables.append((of_cell[rows[some]], sides[rows[some]], vtk, table))
    return ordered_cells(tables, np.concatenate([points, tops]))


def ordered_cells(
    tables: Sequence[tuple[IntArray, IntArray, int, IntArray]], points: FloatArray
) -> Built:
    """Return cells in the order of the file's cells.

    Each table has the numbers of file's cells and faces (k,) (see `Polyhedra`), an element type,
    and nodes (k, n).
    """
    cell = np.concatenate([ids for ids, _, _, _ in tables])
    face = np.concatenate([ids for _, ids, _, _ in tables])
    order = np.argsort(cell, kind="stable")
    types = np.repeat([vtk for _, _, vtk, _ in tables], [len(table[0]) for table in tables])
    nodes = np.concatenate([nodes.ravel() for _, _, _, nodes in tables])
    begin = offsets_of(SIZES[types])[:-1]
    connectivity = nodes[ranges(begin[order], SIZES[types[order]])]
    cells = Cells.from_types(types[order].astype(np.uint8), sealed(connectivity))
    return Built(cells, cell[order], face[order], points)


def _elements(vtk: int, sides: IntArray) -> tuple[IntArray, BoolArray]:
    """Return nodes (m, n) of elements from their sides (m, s, 4), and whether these are its own.

    The base is the first side, of a pyramid the last; the other nodes are those above its nodes.
    """
    row = ELEMENTS[vtk]
    base = sides[:, -1 if vtk == 14 else 0]
    base = base[:, [0, 3, 2, 1] if vtk in (12, 14) else [0, 2, 1]]
    after = np.roll(sides, -1, axis=2)
    outside = ~(after[..., None] == base[:, None, None]).any(axis=3)
    above = [
        np.where((sides == base[:, k, None, None]) & outside, after, -1).max(axis=(1, 2))
        for k in range(row.n_nodes - base.shape[1])
    ]
    nodes = np.concatenate([base, np.stack(above, 1)], axis=1)
    facets = [nodes[:, [*facet, facet[0]][:4]] for facet in row.facets]
    same = _marks(np.stack(facets, 1)) == _marks(sides)
    return nodes, same.all(axis=1) & (nodes >= 0).all(axis=1)


def _marks(facets: IntArray) -> NDArray[np.uint64]:
    """Return numbers (m, s), sorted, that facets (m, s, 4) of the same nodes have in common."""
    nodes = facets.astype(np.uint64) + np.uint64(1)
    mixed = nodes * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed ^= mixed >> np.uint64(32)
    mixed[..., 3] *= facets[..., 3] != facets[..., 0]
    return np.sort(mixed.sum(axis=2), axis=1)


def _tops(centres: FloatArray, corners: FloatArray, rank: IntArray) -> FloatArray:
    """Return the node (o, 3) to add in each cell: its centre (o, 3).

    Where that does not see the inside of a piece (``corners`` (p, 4, 3), in the cell ``rank`` (p,),
    ascending), it is the best of some places, each a step off the plane that it is least inside of.
    """
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    flat = (corners[:, 0] == corners[:, 3]).all(axis=1)
    normals[flat] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[flat]
    normals /= np.fmax(row_norms(normals), np.finfo(float).tiny)[:, None]
    hidden = np.unique(rank[row_dots(normals, centres[rank] - corners[:, 0]) >= 0])
    some = np.isin(rank, hidden)
    normals = normals[some]
    places = corners[some, 0]
    rank = np.searchsorted(hidden, rank[some])
    first = np.flatnonzero(run_begins(rank))
    tops = centres[hidden]
    reach = np.zeros((len(tops), 1))
    least = np.full(len(tops), np.inf)
    for step in range(1, _STEPS):
        beyond = row_dots(normals, tops[rank] - places)
        worst = np.lexsort((-beyond, rank))[first]
        better = beyond[worst] < least
        least[better] = beyond[worst][better]
        centres[hidden[better]] = tops[better]
        if step == 1:
            reach = -np.minimum.reduceat(beyond, first)[:, None] if len(first) else reach
        tops = tops - reach / (2 * step) * normals[worst]
    return centres
