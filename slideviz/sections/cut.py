"""The cells that a section cuts: as polygons, the cut cells or the sides of the whole cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import CaseError
from slideviz.mesh.elements import ELEMENTS, ElementType
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray, Mesh, offsets_of
from slideviz.mesh.surfaces import padded
from slideviz.mesh.topology import real_corners
from slideviz.sections.polygons import CellsInRange, Polygons
from slideviz.sections.shape import InPlane, Section
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

BESIDE = 10.0  # most times as high as a cell that the next one is, across a section


@record
class _Block:
    """Cells of one type: VTK identifier, numbers (m,) and nodes (m, k)."""

    vtk: int
    ids: IntArray
    nodes: IntArray


class Cutter:
    """Cuts the cells of a mesh at any positions of its nodes; made once for a mesh."""

    def __init__(self, mesh: Mesh) -> None:
        self.dim = mesh.dim
        self._mesh = mesh
        self._blocks = [_Block(vtk, *found) for vtk, found in mesh.cells.by_type.items()]

    @property
    def used(self) -> IntArray:
        """Return the nodes that cells use, sorted, each once."""
        return self._mesh.cells.nodes

    def cut(self, points: FloatArray, section: Section) -> Polygons:
        """Return the polygons in which the section cuts the cells; none where all are missed.

        ``points`` (n, d): the nodes of the mesh. Convex cells give one polygon, folded ones perhaps
        more. Corners lie on the edges of the cells and, up to rounding, on the section, a curved
        one too; or at a node next to it (`Section.near`). A side of a cell that lies in the section
        belongs to the cell where the distance from the section is negative; where no cell is cut
        so, to the other, since the section is at the rim of the mesh. For ``whole_cells`` see
        `show`. Raises CaseError if the mesh is 2D, and the section is neither a plane nor a
        cylinder about z.
        """
        level = self._level(points, section)
        owners, low, high = self._corners(level)
        if section.near:
            level[_nearly_on(level, low, high, section.near)] = 0.0
            owners, low, high = self._corners(level)
        if not len(owners):
            owners, low, high = self._corners(-level)
        keep = _distinct(low, high)
        enough = keep.sum(axis=1) >= self.dim
        owners = owners[enough]
        low = low[enough]
        high = high[enough]
        keep = keep[enough]
        keys, corners = np.unique(low[keep] * len(points) + high[keep], return_inverse=True)
        a, b = np.divmod(keys, len(points))
        at = _crossings(points, a, b, level, section)
        polygons = Polygons(at, offsets_of(keep.sum(axis=1)), corners, owners)
        polygons = polygons.take(np.argsort(owners, kind="stable"))
        return polygons.of_file_cells(self._mesh, sides=False)

    def which_cells(self, points: FloatArray, section: Section) -> IntArray:
        """Return the sorted numbers of the cells that the section cuts (see `cut`).

        They have nodes on both sides of the section, or a side in it. A curved section that enters
        a cell between its nodes, all of which are on one side, does not cut it.
        """
        return self.cut(points, section).cell_ids

    def all_cells(self, points: FloatArray) -> Polygons:
        """Return the surface of the mesh as polygons; in 2D all cells."""
        return self.surface(points, np.concatenate([block.ids for block in self._blocks]))

    def show(
        self, points: FloatArray, section: Section, only: CellsInRange | None = None
    ) -> Polygons:
        """Return the cut cells, whole or cut as the section says; with ``only``, some of them."""
        if not section.whole_cells:
            polygons = self.cut(points, section)
            return polygons if only is None else only.among(polygons)
        ids = self.which_cells(points, section)
        # Sides beside cells that are left out are shown, too.
        return self.surface(points, ids if only is None else ids[only.mask[ids]])

    def surface(self, points: FloatArray, ids: IntArray) -> Polygons:
        """Return the sides that only one of the cells ``ids`` (c,) has; in 2D the cells.

        The sides are oriented outwards of cells that are not inverted. Of a polyhedron, its first
        part stands for all.
        """
        sides = [np.empty((0, 4), np.int64)]
        owners = [NO_NODES]
        for block in self._blocks:
            mine = np.isin(self._mesh.first_parts(block.ids), ids)
            row = ELEMENTS[block.vtk]
            nodes = block.nodes[mine]
            for side in row.facets if self.dim == 3 else (tuple(range(row.n_nodes)),):
                # A triangle repeats its last node.
                sides.append(nodes[:, list(side) + [side[-1]] * (4 - len(side))])
                owners.append(block.ids[mine])
        facets = np.concatenate(sides)
        owner = np.concatenate(owners)
        if self.dim == 3:
            outer = _single(facets)
            facets = facets[outer]
            owner = owner[outer]
        keep = real_corners(facets)
        used, corners = np.unique(facets[keep], return_inverse=True)
        polygons = Polygons(padded(points[used]), offsets_of(keep.sum(axis=1)), corners, owner)
        return polygons.of_file_cells(self._mesh, sides=self.dim == 3)

    def _level(self, points: FloatArray, section: Section) -> FloatArray:
        if not section.can_cut(self.dim):
            why = "its axis is not z, so it" if isinstance(section, InPlane) else "it"
            raise CaseError(
                f"{section.describe()}: {why} needs a 3D mesh; a 2D mesh is cut by a plane, or in "
                "a circle by a cylinder about z"
            )
        return section.distance(points)

    def _corners(self, level: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
        """Return the polygons' cells (q,), and both ends (q, c) of each corner's edge, -1 for none.

        A corner at a node has this node as both ends. ``level`` (n,) are distances of the nodes.
        """
        negative = level < 0
        parts = []
        for block in self._blocks:
            pattern = _patterns(block.nodes, negative)
            cut = np.flatnonzero(pattern)
            loops = cut_cases(block.vtk)[pattern[cut]]
            cell, loop = np.nonzero(loops[:, :, 0] >= 0)
            edges = loops[cell, loop]
            ends = block.nodes[cut[cell][:, None, None], _EDGES[block.vtk][edges]]
            ends[edges < 0] = -1
            a = ends[..., 0]
            b = ends[..., 1]
            first = np.minimum(a, b)
            last = np.maximum(a, b)
            on_first = (level[first] == 0) & (first >= 0)
            on_last = (level[last] == 0) & (last >= 0)
            low = np.where(on_last, last, first)
            high = np.where(on_first, first, last)
            parts.append((block.ids[cut[cell]], low, high))
        width = max((part[1].shape[1] for part in parts), default=0)
        none = np.empty((0, width), np.int64)
        return (
            np.concatenate([NO_NODES, *(part[0] for part in parts)]),
            np.concatenate([none, *(_wide(part[1], width) for part in parts)]),
            np.concatenate([none, *(_wide(part[2], width) for part in parts)]),
        )


def crossed_cells(
    mesh: Mesh, section: Section, matrices: Iterable[FloatArray], near: float = 0.0
) -> BoolArray:
    """Return a mask (m,) of the cells with nodes on both sides of a section, or on it.

    Cells near enough to touch it count, too, where it goes through nodes near it (`Section.near`).
    ``matrices``: transformations of the mesh: cells count that are cut after any of them. ``near``:
    nodes at most so far from the section are on it.
    """
    crossed = np.zeros(len(mesh.cells), bool)
    for matrix in matrices:
        still = np.array_equal(matrix, np.eye(4))
        points = mesh.points if still else transformed(mesh.points, matrix)
        level = np.nan_to_num(section.distance(points), nan=np.inf)
        level[np.abs(level) <= near] = 0.0
        for ids, nodes in mesh.cells.by_type.values():
            low = level[nodes].min(axis=1)
            high = level[nodes].max(axis=1)
            more = BESIDE * section.near * (high - low) if section.near else 0.0
            crossed[ids] |= (low <= more) & (high >= -more)
    return crossed


def transformed(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return points (n, d) after a transformation (4, 4), (n, d)."""
    return (padded(points) @ matrix[:3, :3].T + matrix[:3, 3])[:, : points.shape[1]]


def _patterns(nodes: IntArray, negative: BoolArray) -> np.ndarray:
    """Return (m,) for cells (m, k) a number with bit k set where node k is negative; 0 if all are.

    ``negative`` is a mask (n,) of nodes.
    """
    patterns = np.empty(len(nodes), np.uint8)
    in_parts(lambda part: _write_patterns(nodes[part], negative, patterns[part]), len(nodes))
    return patterns


@njit
def _write_patterns(nodes, negative, found):  # type: ignore[no-untyped-def]
    whole = 2 ** nodes.shape[1] - 1
    for cell in range(len(nodes)):
        pattern = 0
        for bit in range(nodes.shape[1]):
            if negative[nodes[cell, bit]]:
                pattern |= 1 << bit
        found[cell] = 0 if pattern == whole else pattern


_EDGES = {vtk: np.array(row.edges) for vtk, row in ELEMENTS.items() if row.dim > 1}


def _wide(table: IntArray, width: int) -> IntArray:
    return np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=-1)


def _single(facets: IntArray) -> BoolArray:
    """Return a mask (f,) of the facets (f, 4) whose nodes no other facet has."""
    nodes = np.sort(facets, axis=1)
    above = int(facets.max(initial=0)) + 1
    keys = nodes[:, 0] * above + nodes[:, 1], nodes[:, 2] * above + nodes[:, 3]
    order = np.lexsort(keys)
    differs = np.ones(len(facets) + 1, bool)
    differs[1:-1] = (np.diff(keys[0][order]) != 0) | (np.diff(keys[1][order]) != 0)
    single = np.empty(len(facets), bool)
    single[order] = differs[1:] & differs[:-1]
    return single


def _distinct(low: IntArray, high: IntArray) -> BoolArray:
    """Return a mask (q, c) of the corners that differ from the one before in their polygon.

    ``low`` and ``high`` (q, c) are the ends of their edges, -1 where a polygon has no more corners.
    """
    there = low >= 0
    last = np.maximum(there.sum(axis=1) - 1, 0)
    rows = np.arange(len(low))
    before = [np.roll(ends, 1, axis=1) for ends in (low, high)]
    for rolled, ends in zip(before, (low, high), strict=True):
        rolled[:, :1] = ends[rows, last][:, None]
    return there & ((low != before[0]) | (high != before[1]))


def _nearly_on(level: FloatArray, low: IntArray, high: IntArray, near: float) -> IntArray:
    """Return the nodes next to which, within a part of it, an edge from low to high is crossed."""
    a = low[low >= 0]
    b = high[low >= 0]
    reach = near * np.abs(level[a] - level[b])
    return np.concatenate([end[np.abs(level[end]) <= reach] for end in (a, b)])


def _crossings(
    points: FloatArray, a: IntArray, b: IntArray, level: FloatArray, section: Section
) -> FloatArray:
    """Return the points (k, 3) where the section crosses the edges from nodes a (k,) to b (k,)."""
    start = padded(points[a])
    way = padded(points[b]) - start
    share = np.zeros(len(a))
    levels = (level[a], level[b])
    # Mostly no corner is at a node, and a slice copies nothing.
    between = slice(None) if (a != b).all() else np.flatnonzero(a != b)
    edges = start[between], way[between]
    share[between] = section.crossings(edges, tuple(one[between] for one in levels))
    return start + share[:, None] * way


@cache
def cut_cases(vtk: int) -> IntArray:
    """Return the polygons of each pattern of signs: (2 ** nodes, polygons, corners).

    Bit k of a pattern is set where node k is negative. Corners are indices into the edges of the
    element type, -1 where there are no more. A 2D element has lines instead, of two corners.
    """
    row = ELEMENTS[vtk]
    loops_of = [_loops(row, pattern) for pattern in range(2**row.n_nodes)]
    loops = max(len(one) for one in loops_of)
    corners = max((len(loop) for one in loops_of for loop in one), default=0)
    table = np.full((len(loops_of), loops, corners), -1, np.int64)
    for pattern, one in enumerate(loops_of):
        for index, loop in enumerate(one):
            table[pattern, index, : len(loop)] = loop
    table.flags.writeable = False
    return table


def _loops(row: ElementType, pattern: int) -> list[list[int]]:
    """Return the polygons of one sign pattern, each a list of edge numbers."""
    edge_of = {frozenset(edge): index for index, edge in enumerate(row.edges)}
    sides = row.facets if row.dim == 3 else (tuple(range(row.n_nodes)),)
    joints = [joint for side in sides for joint in _joints(side, pattern, edge_of)]
    if row.dim == 2:
        return [list(joint) for joint in joints]
    follows = dict(joints)
    loops = []
    while follows:
        start, now = follows.popitem()
        loop = [start]
        while now != start:
            loop.append(now)
            now = follows.pop(now)
        loops.append(loop)
    return loops


def _joints(
    side: Sequence[int], pattern: int, edge_of: dict[frozenset[int], int]
) -> list[tuple[int, int]]:
    """Return the pairs of cut edges of a side: before and after each run of negative nodes."""
    negative = [bool(pattern >> node & 1) for node in side]
    size = len(side)
    joints = []
    for begin in range(size):
        if negative[begin - 1] or not negative[begin]:
            continue
        end = begin
        while negative[(end + 1) % size]:
            end += 1
        entered = edge_of[frozenset((side[begin - 1], side[begin]))]
        left = edge_of[frozenset((side[end % size], side[(end + 1) % size]))]
        joints.append((entered, left))
    return joints
