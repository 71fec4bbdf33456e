"""Walls: the layers of cells at boundaries, in the terms of the drag prediction workshops.

From each facet of a boundary a stack of cells leaves it, from a side to the opposite one, while
cells are quadrilaterals, hexahedra, or prisms entered by a triangle; another cell ends it. The
edges that lead from the corners of the facet through the stack are its *columns*: nodes
p0 (on the boundary), p1, p2 ... A column belongs to all facets whose stacks begin with the edge
p0 p1 (both sides of a sharp trailing edge of an O-mesh; of a C-mesh each side has its own), and
its normal n is the mean of the inward unit normals of these facets, whatever their areas: else a
sharp edge, whose normals nearly cancel, would seem to turn where a facet only becomes longer.

==================  ==============================================================================
first height        (p1 - p0)·n: the distance of the first node from the wall, on which y+ depends.
                    Of a facet without columns (of a triangle, tetrahedron, pyramid, or prism on its
                    side): the distance of its plane from the mean of the cell's other nodes.
                    Negative where the cell is turned over.
growth              largest ratio of the lengths of two successive edges, the longer one over the
                    shorter one, of the first five edges of a column, or of those through the stack
                    of flat cells (undeformed) and the first cell beyond. Workshops ask for below
                    1.25.
equal layers        number of first edges, at most five, whose lengths differ from that of the first
                    by less than 1 %. Workshops ask for two.
wall angle          angle between the first edge and the boundary in degrees: 90 along the normal n,
                    negative where the edge leads out of the mesh; 90 minus the angle to n.
height ratio        first height after over before.
angle change        absolute difference of the wall angles after and before.
==================  ==============================================================================

At a periodic side only the facets of this side count. A halo's cells are not part of a stack.
Sources: AIAA drag prediction workshops 4 to 7, gridding guidelines (growth, equal layers).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.errors import MeshError
from slideviz.mesh.adjacency import cells_around
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import (
    FloatArray,
    IntArray,
    Mesh,
    Skin,
    checked_reference,
    row_dots,
    row_norms,
    run_begins,
    sealed,
)
from slideviz.mesh.topology import Boundary, facet_vectors, real_corners, unit
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import weak_cache

LAYERS = 5  # layers that equal layers are found from, and growth at walls without layers
DEEPEST = 48  # most layers of a stack that growth is found from
EQUAL = 0.01
"""Largest difference of the lengths of edges, as a part of the first one's, that are equal."""
FLAT = 2 / 3  # largest height of a cell of the stack, as a part of its length

_LINKED = np.zeros((15, 8), np.int64)
"""Bits of the nodes at the edges from each local node of an element type, by VTK identifier."""
for _row in ELEMENTS.values():
    for _one, _other in np.reshape(_row.edges, (-1, 2)):
        _LINKED[_row.vtk, _one] |= 1 << _other
        _LINKED[_row.vtk, _other] |= 1 << _one


@record
class Columns:
    """The columns of nodes that leave boundaries of a mesh, and facets that have none."""

    boundary: Boundary  # the facets of ``markers``, and those that share nodes with them
    markers: tuple[str, ...]  # the boundaries whose columns are all here
    nodes: IntArray
    """(c, k + 1): the nodes of each column, the first one on the boundary; -1 beyond its end."""
    corner: IntArray
    """(f, 2 or 4): the column at each corner of each facet. Of a facet without columns: c + g, if
    it is number g of ``bare``."""
    depth: IntArray  # (f,): number of layers of the stack of each facet, at most k
    bare: IntArray  # (g,): the facets without columns
    off: IntArray  # (g, 2): the nodes of the cells of bare that are not on the facet (one or two)

    def places(self, marker: str) -> IntArray:
        """Return the places of a boundary, ascending: columns, then c + g for facets without."""
        return np.unique(self.corner[self.boundary.marker == self.boundary.names.index(marker)])

    def at(self, points: FloatArray, place: int) -> FloatArray:
        """Return the point (d,) of one of the places on its boundary; ``points`` (n, d): nodes."""
        count = len(self.nodes)
        if place < count:
            return points[self.nodes[place, 0]]
        return _middles(points, self.boundary.facets[self.bare[[place - count]]])[0]

    def stack_thickness(self, points: FloatArray, most: int | None = None) -> FloatArray:
        """Return the thickness (f,) of the stack of flat cells on each facet, at ``points`` (n, d).

        That is the sum of the heights of the first layers whose height (mean length of the edges
        that lead through it) is below two thirds of their length (of the side nearer to the wall:
        the length of a line, else the square root of the area); 0 where there are none.
        ``most``: layers that count at most; all by default.
        """
        facets = self.boundary.facets
        width = facets.shape[1]
        thickness = np.zeros(len(facets))
        flat = self.depth > 0
        for layer in range(self.nodes.shape[1] - 1 if most is None else most):
            some = np.flatnonzero(flat & (self.depth > layer))
            below = self.nodes[self.corner[some], layer]
            above = self.nodes[self.corner[some], layer + 1]
            edges = np.linalg.norm(points[above] - points[below], axis=2)
            if width == 4:  # of a triangle, which repeats its last corner, the first three
                edges[below[:, 2] == below[:, 3], 3] = np.nan
            height = np.nanmean(edges, axis=1)
            size = row_norms(facet_vectors(points, below))
            good = height < FLAT * (size if width == 2 else np.sqrt(size / 2))
            thickness[some[good]] += height[good]
            flat[some[~good]] = False
        return thickness

    def through_stacks(self, mesh: Mesh) -> Columns:
        """Return the same with columns that end at the first cell beyond a stack of flat cells.

        But not before those of the mesh that this was found in, nor beyond `DEEPEST` layers.
        """
        nodes = np.full((len(self.nodes), DEEPEST + 1), -1)
        nodes[:, : self.nodes.shape[1]] = self.nodes
        cells = mesh.cells
        _lengthen(
            self.boundary.facets,
            self.boundary.owner,
            (cells.types, cells.offsets, cells.connectivity),
            _around(mesh),
            _LINKED,
            mesh.points,
            self.corner,
            np.count_nonzero(self.nodes >= 0, axis=1) - 1,
            nodes,
        )
        return replace(self, nodes=sealed(nodes))


@check_types
def find_columns(
    mesh: Mesh, layers: int = LAYERS, markers: tuple[str, ...] | None = None
) -> Columns:
    """Return the columns of at most ``layers`` layers that leave ``markers``; None: all.

    Raises MeshError if a marker element is not a side of any cell.
    """
    boundary = boundary_of(mesh)
    if markers is not None and set(markers) != set(boundary.names):
        boundary = boundary.around(markers)
    cells = mesh.cells
    facets = boundary.facets
    owner = boundary.owner
    chain = np.full((*facets.shape, layers + 1), -1)
    off = np.full((len(facets), 2), -1)
    depth = np.zeros(len(facets), np.int64)
    table = (cells.types, cells.offsets, cells.connectivity)
    around = _around(mesh)

    def climb(part: slice) -> None:
        written = chain[part], depth[part], off[part]
        _climb(facets[part], owner[part], table, around, _LINKED, *written)

    in_parts(climb, len(facets))
    deep = depth > 0
    if facets.shape[1] == 4:
        triangle = facets[:, 2] == facets[:, 3]
        chain[triangle, 3] = chain[triangle, 2]
    chains = chain[deep].reshape(-1, layers + 1)
    length = np.repeat(depth[deep], facets.shape[1])
    # Of the chains with one first edge the longest, and of these the first, is the column.
    order = np.lexsort((-length, chains[:, 1], chains[:, 0]))
    edges = chains[order, :2]
    new = run_begins(edges)
    number = np.empty(len(order), np.int64)
    number[order] = np.cumsum(new) - 1
    nodes = chains[order[new]]
    bare = np.flatnonzero(~deep)
    corner = np.empty(facets.shape, np.int64)
    corner[deep] = number.reshape(-1, facets.shape[1])
    corner[bare] = len(nodes) + np.arange(len(bare))[:, None]
    parts = (sealed(x) for x in (nodes, corner, depth, bare, off[bare]))
    return Columns(boundary, markers or boundary.names, *parts)


def _around(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the cells around each node (`cells_around`), and which cells are of no halo (m,)."""
    near = cells_around(mesh.cells, len(mesh.points))
    use = np.ones(len(mesh.cells), bool) if mesh.halo is None else ~mesh.halo.cells
    return near.offsets, near.cells, use


@njit
def _has(nodes, node):  # type: ignore[no-untyped-def]
    """Return 1 if ``node`` is one of ``nodes`` (w,), else 0."""
    for other in nodes:
        if other == node:
            return 1
    return 0


@njit
def _climb(facets, owner, cells, around, linked, chain, depth, off):  # type: ignore[no-untyped-def]
    """Write the nodes of the columns at the corners (f, w, k + 1) of facets, and the depths (f,).

    Also the nodes ``off`` (f, 2) the facet of cells in which no column begins: one or two.
    """
    types, offsets, connectivity = cells
    stride = np.zeros(chain.shape[2], np.int64)
    for f in range(len(facets)):
        width = _width(facets[f])
        chain[f, :width, 0] = facets[f, :width]
        cell = owner[f]
        while depth[f] < chain.shape[2] - 1:
            layer = depth[f]
            nodes = connectivity[offsets[cell] : offsets[cell + 1]]
            if not _cross(chain[f], width, layer, nodes, linked[types[cell]]):
                break
            depth[f] += 1
            cell = _next(chain[f, :width, layer + 1], cell, cells, around, stride[layer:])
            if cell < 0:
                break
        if depth[f] == 0:
            count = 0
            for k in range(offsets[owner[f]], offsets[owner[f] + 1]):
                if count < 2 and not _has(facets[f], connectivity[k]):
                    off[f, count:] = connectivity[k]
                    count += 1


@njit
def _lengthen(facets, owner, cells, around, linked, points, corner, length, columns):  # type: ignore[no-untyped-def]
    """Lengthen ``columns`` (c, k + 1), of ``length`` (c,) layers, through stacks of flat cells.

    To the first cell beyond. ``corner`` (f, w) are the columns at the corners of facets; of those
    that facets have in common the longest stays.
    """
    types, offsets, connectivity = cells
    deepest = columns.shape[1] - 1
    chain = np.empty((facets.shape[1], deepest + 1), np.int64)
    stride = np.zeros(deepest, np.int64)
    for f in range(len(facets)):
        width = _width(facets[f])
        chain[:width, 0] = facets[f, :width]
        cell = owner[f]
        layer = 0
        flat = True
        while flat and cell >= 0 and layer < deepest:
            nodes = connectivity[offsets[cell] : offsets[cell + 1]]
            if not _cross(chain, width, layer, nodes, linked[types[cell]]):
                break
            flat = _is_flat(points, chain[:width, layer : layer + 2])
            layer += 1
            if flat:
                cell = _next(chain[:width, layer], cell, cells, around, stride[layer - 1 :])
        for k in range(width):
            column = corner[f, k]
            if column < len(columns) and layer > length[column]:
                length[column] = layer
                columns[column, : layer + 1] = chain[k, : layer + 1]


@njit
def _width(facet):  # type: ignore[no-untyped-def]
    """Return the number of nodes of a facet (w,); a triangle may repeat its last one."""
    return 3 if len(facet) == 4 and facet[2] == facet[3] else len(facet)


@njit
def _next(side, cell, cells, around, stride):  # type: ignore[no-untyped-def]
    """Return the cell beyond a side (w,) of ``cell``, -1 if there is none or one of a halo.

    ``stride[0]`` is the difference of the numbers of the last two such cells.
    """
    _, offsets, connectivity = cells
    begin, cells_at, use = around
    beyond = cell + stride[0]  # as of the facet before, where cells are in rows
    if not _is_beyond(side, cell, beyond, offsets, connectivity, use):
        beyond = _neighbour(side, cell, offsets, connectivity, begin, cells_at, use)
        if beyond >= 0:
            stride[0] = beyond - cell
    return beyond


@njit
def _is_flat(points, nodes):  # type: ignore[no-untyped-def]
    """Return whether a cell between nodes (w, 2) is flat: see `Columns.stack_thickness`."""
    width = len(nodes)
    height = 0.0
    for k in range(width):
        height += _distance(points, nodes[k, 0], nodes[k, 1]) / width
    if width == 2:
        return height < FLAT * _distance(points, nodes[0, 0], nodes[1, 0])
    a = nodes[0, 0]
    b = nodes[1 if width == 3 else 2, 0]
    c = nodes[0 if width == 3 else 1, 0]
    d = nodes[width - 1, 0]
    size = 0.0
    for i in range(3):
        j = (i + 1) % 3
        u = (points[b, i] - points[a, i]) * (points[d, j] - points[c, j])
        size += (u - (points[b, j] - points[a, j]) * (points[d, i] - points[c, i])) ** 2
    return height < FLAT * np.sqrt(np.sqrt(size) / 2)


@njit
def _distance(points, one, two):  # type: ignore[no-untyped-def]
    square = 0.0
    for i in range(points.shape[1]):
        square += (points[two, i] - points[one, i]) ** 2
    return np.sqrt(square)


@njit
def _cross(chain, width, layer, nodes, linked):  # type: ignore[no-untyped-def]
    """Write the side opposite to ``chain[:width, layer]`` of a cell; return whether it has one.

    ``linked`` (8,): the bits of the nodes at the edges from each of its ``nodes``.
    """
    if len(nodes) != 2 * width:
        return False
    side = 0
    for a in range(2 * width):
        if _has(chain[:width, layer], nodes[a]):
            side |= 1 << a
    for i in range(width):
        end = -1
        for a in range(2 * width):
            if nodes[a] == chain[i, layer]:
                beyond = linked[a] & ~side
                for b in range(2 * width):
                    if beyond >> b & 1:
                        end = nodes[b]
        chain[i, layer + 1] = end
    if _has(chain[:width, layer + 1], -1):  # a cell that has a node twice
        chain[:width, layer + 1] = -1
        return False
    return True


@njit
def _neighbour(side, cell, offsets, connectivity, begin, cells_at, use):  # type: ignore[no-untyped-def]
    """Return the cell of ``use`` beyond a side (w,) of ``cell``, -1 if there is none."""
    for at in range(begin[side[0]], begin[side[0] + 1]):
        if _is_beyond(side, cell, np.int64(cells_at[at]), offsets, connectivity, use):
            return np.int64(cells_at[at])
    return np.int64(-1)


@njit
def _is_beyond(side, cell, other, offsets, connectivity, use):  # type: ignore[no-untyped-def]
    """Return whether ``other`` is a cell of ``use`` that has a side (w,) of ``cell``, too."""
    if other == cell or not 0 <= other < len(use) or not use[other]:
        return False
    nodes = connectivity[offsets[other] : offsets[other + 1]]
    if not _has(nodes, side[len(side) // 2]):  # few cells have the opposite corner, too
        return False
    shared = 0
    for node in nodes:
        shared += _has(side, node)
    return shared == len(side)


VALUES = ("first_height", "growth", "equal_layers", "wall_angle")
"""The numbers of the walls of one mesh."""
CHANGES = ("height_ratio", "angle_change")  # the numbers that compare the walls of two meshes
_REPORTED = {
    "first_height": ("first_height", "ratio", "height_ratio"),
    "growth": ("growth", "", ""),
    "equal_layers": ("equal_layers", "", ""),
    "angle": ("wall_angle", "change", "angle_change"),
}
"""What a report says of a boundary: a number of `VALUES`, and what of `CHANGES` is said with it."""


def measure_walls(columns: Columns, points: FloatArray) -> dict[str, FloatArray]:
    """Return the `VALUES` (c + g,) at each place, its nodes at ``points`` (n, d).

    Where there is no column only the first height is a number, and growth needs two layers: else
    they are nan.
    """
    facets = columns.boundary.facets
    nodes = columns.nodes
    inward = -unit(facet_vectors(points, facets))
    total = np.zeros((len(nodes) + len(columns.bare), points.shape[1]))
    for k, some in enumerate(real_corners(facets).T):  # a facet counts once in each of its columns
        np.add.at(total, columns.corner[some, k], inward[some])
    normal = unit(total)
    edge = points[nodes[:, 1]] - points[nodes[:, 0]]
    first = row_dots(edge, normal[: len(nodes)])
    along = row_norms(edge - first[:, None] * normal[: len(nodes)])
    angle = np.degrees(np.arctan2(first, along))
    length = row_norms(edge)
    below = length.copy()
    growth = np.full(len(nodes), np.nan)
    equal = (length > 0).astype(float)
    with np.errstate(all="ignore"):
        for k in range(1, nodes.shape[1] - 1):
            there = np.flatnonzero(nodes[:, k + 1] >= 0)
            edge = points[nodes[there, k + 1]] - points[nodes[there, k]]
            above = row_norms(edge)
            step = np.exp(np.abs(np.log(above / below[there])))
            growth[there] = np.fmax(growth[there], step)
            if k < LAYERS:
                equal[there] += (equal[there] == k) & (np.abs(above / length[there] - 1) < EQUAL)
            below[there] = above
    away = points[columns.off].mean(axis=1) - _middles(points, facets[columns.bare])
    height = row_dots(away, normal[len(nodes) :])
    none = np.full(len(columns.bare), np.nan)
    parts = np.r_[first, height], *(np.r_[value, none] for value in (growth, equal, angle))
    return {name: sealed(part) for name, part in zip(VALUES, parts, strict=True)}


def _middles(points: FloatArray, facets: IntArray) -> FloatArray:
    """Return the mean (f, d) of the nodes of facets (f, 2 or 4), each once."""
    real = real_corners(facets)[:, :, None]
    return np.sum(points[facets] * real / real.sum(axis=1, keepdims=True), axis=1)


@record
class Walls:
    """The layers of cells at the boundaries of a mesh, and how they changed."""

    columns: Columns
    values: dict[str, FloatArray]
    """At each place of ``columns``, (c + g,): the `VALUES` of the mesh and, with a reference, the
    `CHANGES`. See `slideviz.mesh.walls` for what they are."""
    before: dict[str, FloatArray] | None
    """The `VALUES` of the reference."""
    layered: frozenset[str]
    """Those of the measured boundaries with layers: most of their facets have a stack of flat
    cells."""
    markers: tuple[str, ...]
    """The boundaries that `summary` reports."""
    file_cells: IntArray
    """Number (m,) of the file's cell that each cell of the mesh is in."""

    def of(self, markers: Sequence[str]) -> Walls:
        """Return the same with some of the boundaries that were measured to be reported.

        Raises MeshError for another one.
        """
        others = [name for name in markers if name not in self.columns.markers]
        if others:
            raise MeshError(
                f"the walls at {', '.join(others)} were not measured, only those at "
                f"{', '.join(self.columns.markers)}; give all of them to walls(mesh, markers=...)"
            )
        return replace(self, markers=tuple(markers))

    def with_layers(self) -> Walls:
        """Return the same with those of ``markers`` that have layers; with all where none has."""
        return self.of([name for name in self.markers if name in self.layered] or self.markers)

    def summary(self) -> dict[str, dict]:
        """Return what the report says, by boundary.

        ``layered`` (bool), ``first_height``, ``growth``, ``equal_layers`` and ``angle``. Each of
        these has ``after``, and with a reference ``before``, the first height also ``ratio`` and
        the angle ``change``: with the smallest, mean and largest over the columns (of the first
        height also over the facets without) as ``{"min": ..., "mean": ..., "max": ...}``, None
        where there is none.
        """
        return {marker: self._summary(marker) for marker in self.markers}

    def _summary(self, marker: str) -> dict:
        at = self.columns.places(marker)
        out = dict[str, object](layered=marker in self.layered)
        for name, (number, comparison, change) in _REPORTED.items():
            each = {"before": self.before[number]} if self.before is not None else {}
            each["after"] = self.values[number]
            if change in self.values:
                each[comparison] = self.values[change]
            out[name] = {key: _statistics(values[at]) for key, values in each.items()}
        return out

    def at_cells(self, name: str, before: bool = False) -> FloatArray:
        """Return one of the values at the cells (m,): nan where a cell has no side in ``markers``.

        Of several values the worst: the lowest height, angle and number of equal layers, the
        highest growth and change, the ratio farthest from 1.
        """
        values = (self.before or {})[name] if before else self.values[name]
        columns = self.columns
        out = np.full(len(self.file_cells), np.nan)
        names = columns.boundary.names
        chosen = np.isin(columns.boundary.marker, [names.index(m) for m in self.markers])
        corner = columns.corner[chosen]
        cell = np.repeat(self.file_cells[columns.boundary.owner[chosen]], corner.shape[1])
        value = values[corner.ravel()]
        some = ~np.isnan(value)
        with np.errstate(all="ignore"):
            order = np.argsort(BADNESS[name](value[some]), kind="stable")
        out[cell[some][order]] = value[some][order]  # of equal cells the last one stays
        return out[self.file_cells]


def _ratio_badness(ratio: FloatArray) -> FloatArray:
    """Return how far ratios (k,) are from 1; those of a height that changed its sign most."""
    grown = ratio > 0
    return np.where(grown, np.abs(np.log(np.where(grown, ratio, 1.0))), np.inf)


BADNESS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "first_height": np.negative,
    "growth": np.positive,
    "equal_layers": np.negative,
    "wall_angle": np.negative,
    "height_ratio": _ratio_badness,
    "angle_change": np.positive,
}
"""A function of each value that is larger where it is worse."""


def wall_words(row: dict) -> str:
    """Return the layers at a boundary in words; ``row`` is its entry of `Walls.summary`."""
    if "before" not in row["angle"]:
        height = row["first_height"]["after"]
        growth = row["growth"]["after"]
        equal = row["equal_layers"]["after"]
        angle = row["angle"]["after"]
        turned = f"edges at {angle['min']:.3g}° or more"
        growing = f", growth up to {growth['max']:.3g}" if growth["max"] is not None else ""
        layers = f", {equal['min']:.0f} equal"
        return (
            f"first heights {height['min']:.4g} to {height['max']:.4g}{growing}{layers}, {turned}"
        )
    ratio = row["first_height"]["ratio"]
    change = row["angle"]["change"]
    heights = f"first heights {ratio['min']:.3f} to {ratio['max']:.3f} times those before"
    turned = f"by up to {turn:.2g}°" if (turn := change["max"]) >= 0.01 else "by less than 0.01°"
    before = row["growth"]["before"]["max"]
    after = row["growth"]["after"]["max"]
    growing = f", growth up to {after:.3g} ({before:.3g} before)" if before and after else ""
    return f"{heights}{growing}, first edges turned {turned}"


def statistics_of(row: Mapping[str, Any], number: str) -> tuple[dict | None, dict | None]:
    """Return smallest, mean and largest of one of `VALUES` or `CHANGES`, after and before.

    ``row`` is an entry of `Walls.summary`. None for what it does not have.
    """
    for name, (value, comparison, change) in _REPORTED.items():
        if number == value:
            return row[name]["after"], row[name].get("before")
        if number == change:
            return row[name].get(comparison), None
    raise KeyError(number)


def _statistics(values: FloatArray) -> dict[str, float | None]:
    """Return smallest, mean and largest of the numbers among values (k,); None without any."""
    values = values[np.isfinite(values)]
    if not len(values):
        return {"min": None, "mean": None, "max": None}
    low = values.min()
    mean = values.mean()
    high = values.max()
    return {"min": float(low), "mean": float(mean), "max": float(high)}


@weak_cache
def _columns_of(mesh: Mesh, markers: tuple[str, ...]) -> tuple[Columns, frozenset[str]]:
    """Return the columns at boundaries of a mesh, and those of the boundaries with layers."""
    columns = find_columns(mesh, LAYERS, markers)
    boundary = columns.boundary
    flat = columns.stack_thickness(mesh.points, 1) > 0
    layered = set()
    for name in markers:
        member = boundary.marker == boundary.names.index(name)
        if 2 * np.count_nonzero(flat[member]) > np.count_nonzero(member):
            layered.add(name)
    return columns.through_stacks(mesh), frozenset(layered)


@check_types
def walls(mesh: Mesh, reference: Mesh | None = None, markers: Sequence[str] | None = None) -> Walls:
    """Return the layers of cells at the boundaries of a mesh: see `slideviz.mesh.walls`.

    Parameters
    ----------
    mesh : Mesh
        The deformed mesh.
    reference : Mesh, optional
        The undeformed mesh, with the same cells, to compare with.
    markers : sequence of str, optional
        The boundaries that are measured; all by default.

    Raises
    ------
    MeshError
        A boundary is not there, an element of one is not a side of a cell, the reference is another
        mesh, or the cells of the mesh stay in its file.

    Examples
    --------
    A channel of three layers, the first two of height 0.1, and the same with its lower nodes moved:

    >>> import slideviz as sv
    >>> y = [0, 0.1, 0.2, 0.35]
    >>> points = [[x, height] for height in y for x in (0, 1)]
    >>> cells = sv.Cells.from_blocks([(9, [[2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2]
    ...     for k in range(3)])])
    >>> lower = sv.Marker("lower", sv.Cells.from_blocks([(3, [[0, 1]])]))
    >>> mesh = sv.Mesh(points, cells, (lower,))
    >>> sv.walls(mesh).summary()["lower"]["equal_layers"]["after"]["min"]
    2.0
    >>> moved = mesh.with_points([[0, 0.05], [1, 0.05], *points[2:]])
    >>> sv.walls(moved, reference=mesh).summary()["lower"]["first_height"]["ratio"]["mean"]
    0.5
    """
    if isinstance(mesh, Skin):
        raise MeshError(f"{mesh.name}: its walls need all cells in memory; read the whole mesh")
    base = mesh if reference is None else checked_reference(reference, mesh).undeformed
    chosen = mesh.marker_names if markers is None else tuple(markers)
    for name in chosen:
        mesh.marker(name)
    columns, layered = _columns_of(base, chosen)
    after = measure_walls(columns, mesh.points)
    before = None
    if reference is not None:
        before = measure_walls(columns, base.points)
        with np.errstate(all="ignore"):
            after["height_ratio"] = sealed(after["first_height"] / before["first_height"])
        after["angle_change"] = sealed(np.abs(after["wall_angle"] - before["wall_angle"]))
    cells = mesh.file_cells(np.arange(len(mesh.cells)))
    return Walls(columns, after, before, layered, chosen, cells)
