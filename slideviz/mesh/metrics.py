"""Metrics: the numbers that solvers' limits are written in, for cells or nodes of a mesh.

`slideviz.terms.METRICS` lists them with unit, range and limit; docs/reference/metrics.md has the
definitions. A cell's value of a metric of nodes is the worst of its nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from threading import Lock
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.errors import CaseError, not_one_of
from slideviz.mesh import dual_loops, face_loops, shape_loops
from slideviz.mesh.adjacency import SIDE_NODES, SIDES, cells_around, sides_of
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.check import check_size
from slideviz.mesh.jacobians import check_cells
from slideviz.mesh.margin import path_margins
from slideviz.mesh.model import (
    BoolArray,
    FloatArray,
    Index,
    IntArray,
    Mesh,
    Signs,
    Skin,
    checked_reference,
    row_norms,
    run_begins,
    sealed,
)
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import Quality, quality
from slideviz.mesh.topology import vertex_normals
from slideviz.mesh.zones import zones_of
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import METRICS, SIZE_SKEW, Metric, MetricTerm, field_of

_CACHE: WeakKeyDictionary[Mesh, dict[object, FloatArray]] = WeakKeyDictionary()
"""Values of metrics computed last, by mesh, metric and signs."""
_LOCK = Lock()  # guards `_CACHE`: the window computes in several threads
_OUTER = WeakCache()
_CACHED = 1 << 26  # most numbers in the cache, besides those of the mesh used last


@record
class MetricValues:
    """The values of one metric for a mesh."""

    metric: Metric
    values: FloatArray
    """(m,) or (n,): of the cells, or of the nodes if ``METRICS[metric].where`` is nodes; NaN for
    nodes of no cell."""
    of_cells: FloatArray
    """(m,): of the cells: the same, or the worst of each cell's nodes."""
    counted: BoolArray | slice
    """An index (slice or mask) into ``values`` that leaves out the halo and unused nodes."""

    @property
    def term(self) -> MetricTerm:
        """Return the facts about the metric: unit, range, limit."""
        return METRICS[self.metric]

    @property
    def min(self) -> float:
        """Return the smallest value."""
        return float(self.values[self.counted].min(initial=np.inf))

    @property
    def mean(self) -> float:
        """Return the arithmetic mean of the values."""
        return float(np.mean(self.values[self.counted]))

    @property
    def max(self) -> float:
        """Return the largest value."""
        return float(self.values[self.counted].max(initial=-np.inf))

    @property
    def worst(self) -> float:
        """Return the worst value: the smallest or the largest."""
        return self.min if self.term.best == "high" else self.max

    def beyond(self, limit: float) -> IntArray:
        """Return the ids (k,), ascending, of cells or nodes whose value is worse than ``limit``."""
        worse = self.values < limit if self.term.best == "high" else self.values > limit
        mask = np.zeros(len(worse), bool)
        mask[self.counted] = worse[self.counted]
        return np.flatnonzero(mask)

    @property
    def worst_at(self) -> int:
        """Return the number of the cell or node with the worst value, the first of several."""
        values = self.values[self.counted]
        at = int(values.argmin() if self.term.best == "high" else values.argmax())
        return at if isinstance(self.counted, slice) else int(np.flatnonzero(self.counted)[at])

    def summary(self) -> dict[str, object]:
        """Return the numbers for a report, as plain Python values; None for an infinite one."""
        limit = self.term.limit
        numbers: dict[str, object] = {
            name: value if np.isfinite(value := getattr(self, name)) else None
            for name in ("min", "mean", "max")
        }
        numbers |= {"unit": self.term.unit.strip("[]"), "of": self.term.where, "limit": limit}
        numbers["worst_at"] = self.worst_at
        if limit is not None:
            numbers["beyond"] = len(self.beyond(limit))
        return numbers


@check_types
def metrics(
    mesh: Mesh, names: Iterable[str] | str | None = None, reference: Mesh | None = None
) -> dict[str, MetricValues]:
    """Return the values of some metrics of a mesh, or of all, by name.

    Parameters
    ----------
    mesh : Mesh
    names : str, or iterable of str, optional
        A name, or names, of `slideviz.terms.METRICS`, with ``-`` or ``_``, in any case; None: all,
        without a reference those that need none.
    reference : Mesh, optional
        The undeformed mesh, as of `slideviz.quality`. Only size-skew and its factors depend on its
        shape. Of the others, cells that are numbered the other way round there have the same
        values as if they were numbered the right way.

    Raises
    ------
    MeshError
        The mesh has no cells or unusable ones, coordinates too large, or the reference is another
        mesh.
    CaseError
        There is no such metric, or it compares neighbouring cells and the mesh is a part, or it
        compares with the undeformed mesh and there is no reference.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [2, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> found = sv.metrics(square, ["smallest-angle", "aspect-ratio"])
    >>> round(found["smallest-angle"].min, 6), found["aspect-ratio"].max
    (45.0, 2.0)
    """
    if names is None:
        names = [name for name, term in METRICS.items() if reference or not term.compares]
    wanted = {name: metric_name(name) for name in ([names] if isinstance(names, str) else names)}
    rated = quality(mesh, reference) if set(wanted.values()) & set(SIZE_SKEW) else None
    return {key: rated_metric(mesh, name, reference, rated) for key, name in wanted.items()}


def metric_name(text: str) -> Metric:
    """Return the metric of a name, which may have ``_`` for ``-`` and capitals.

    Raises CaseError if there is none.
    """
    for name in METRICS:
        if field_of(name) == field_of(text.strip().lower()):
            return name
    raise CaseError(f"metric: {not_one_of(text, METRICS)}")


def is_known(mesh: Mesh, name: Metric) -> bool:
    """Return whether a metric can be measured: not if it compares cells that stay in a file."""
    return METRICS[name].alone or not isinstance(mesh, Skin)


def rated_metric(
    mesh: Mesh, name: Metric, reference: Mesh | None, rated: Quality | None
) -> MetricValues:
    """Return the values of one metric of a mesh whose quality may be known."""
    if rated is None or name not in SIZE_SKEW:
        return metric(mesh, name, reference)
    values = {"size": rated.size, "skew": rated.skew}.get(name, rated.values)
    return MetricValues(name, values, values, rated.counted)


@check_types
def metric(mesh: Mesh, name: Metric, reference: Mesh | None = None) -> MetricValues:
    """Return the values of one metric; parameters and errors are those of `metrics`."""
    name = metric_name(name)
    if name in SIZE_SKEW:
        return rated_metric(mesh, name, reference, quality(mesh, reference))
    if not is_known(mesh, name):
        raise CaseError(f"{name} compares neighbouring cells: expected the whole mesh in memory")
    check_cells(mesh)
    check_size(mesh)
    if METRICS[name].compares:
        if reference is None:
            raise CaseError(f"{name} compares with the undeformed mesh; give a reference")
        base = checked_reference(reference, mesh)
        key = name, None if base is mesh else base  # a key must not keep its own mesh alive
        values = _cached(mesh, key, lambda: {key: path_margins(mesh, base)})
        return _of_cells(mesh, name, values)
    signs = reference_of(mesh if reference is None else reference)[1]
    turned = hash(signs.tobytes()) if (signs < 0).any() else 0
    values = _cached(
        mesh,
        (name, turned),
        lambda: {(each, turned): v for each, v in _FAMILIES[name](mesh, signs).items()},
    )
    if METRICS[name].where == "cells":
        return _of_cells(mesh, name, values)
    place = ("cells", name, turned)
    of_cells = _cached(mesh, place, lambda: {place: _worst_of_nodes(mesh, name, values)})
    used = ~np.isnan(values)
    if mesh.halo is not None:
        used[mesh.halo.outer] = False
    return MetricValues(name, values, of_cells, used)


def _cached(mesh: Mesh, key: object, compute: Callable[[], dict[object, FloatArray]]) -> FloatArray:
    """Return what the cache has for a mesh, or compute it; for any number of threads.

    Two threads that need the same values at once both compute them. The results of the meshes used
    longest ago are removed if the cache is full.
    """
    with _LOCK:
        found = _CACHE.get(mesh, {}).get(key)
    made = {} if found is not None else {each: sealed(v) for each, v in compute().items()}
    with _LOCK:
        cache = _CACHE.pop(mesh, {})
        while made and sum(len(v) for old in _CACHE.values() for v in old.values()) > _CACHED:
            del _CACHE[next(iter(_CACHE))]
        _CACHE[mesh] = {**made, **cache}  # the last one
    return made[key] if found is None else found


def _worst_of_nodes(mesh: Mesh, name: Metric, values: FloatArray) -> FloatArray:
    """Return the worst value (m,) of the nodes of each cell, of ``values`` (n,) of a metric."""
    found = np.empty(len(mesh.cells))
    cells = mesh.cells
    least = METRICS[name].best == "high"
    in_parts(
        lambda part: _take_worst(
            cells.connectivity, cells.offsets, values, least, part.start, found[part]
        ),
        len(cells),
    )
    return _of_cells(mesh, name, found).values


@njit
def _take_worst(nodes, offsets, values, least, first, found):  # type: ignore[no-untyped-def]
    """Write the smallest (``least``) or largest value of the nodes of cells into ``found``."""
    for i in range(len(found)):
        begin = offsets[first + i]
        end = offsets[first + i + 1]
        worst = values[nodes[begin]]
        for k in range(begin + 1, end):
            value = values[nodes[k]]
            worst = min(worst, value) if least else max(worst, value)
        found[i] = worst


def _of_cells(mesh: Mesh, name: Metric, values: FloatArray) -> MetricValues:
    """Return a metric of cells (m,) in which parts of a polyhedron have the worst of these."""
    if mesh.whole_cells is None:
        counted = slice(None) if mesh.halo is None else ~mesh.halo.cells
        return MetricValues(name, values, values, counted)
    first = run_begins(mesh.whole_cells)
    worst = np.minimum if METRICS[name].best == "high" else np.maximum
    values = sealed(worst.reduceat(values, np.flatnonzero(first))[np.cumsum(first) - 1])
    return MetricValues(name, values, values, first)


Made = Mapping[Metric, FloatArray]  # metrics that are computed together, with their values


def _shapes(mesh: Mesh, signs: Signs) -> Made:
    """Return the metrics of `shape_loops.SHAPES`, which need one cell only."""
    found = np.empty((len(shape_loops.SHAPES), len(mesh.cells)))

    def of_part(vtk: int, rows: Index, nodes: IntArray) -> None:
        values = np.empty((len(found), len(nodes)))
        tables = shape_loops.CORNERS[vtk], shape_loops.EDGES[vtk], shape_loops.POLYGONS[vtk]
        shape_loops.write_shapes(vtk, mesh.points, nodes, signs[rows].copy(), *tables, values)
        found[:, rows] = values

    mesh.cells.in_parts(of_part)
    return dict(zip(shape_loops.SHAPES, found, strict=True))


def _faces(mesh: Mesh, signs: Signs) -> Made:
    """Return the metrics that compare a cell with its neighbours; of polyhedra as such."""
    cells = mesh.cells
    if mesh.whole_cells is not None:
        rated = []
        for zone in zones_of(mesh):
            polyhedra = zone.origin.polyhedra
            assert polyhedra is not None
            rated.append(np.stack(polyhedra.faces.worst_of_faces(zone.points))[:, polyhedra.cell])
        return dict(zip(_OF_FACES, np.concatenate(rated, axis=1), strict=True))
    sides = sides_of(mesh.cells)
    centres = np.empty((len(cells), 3))
    volumes = np.empty(len(cells))
    found = np.empty((3, len(cells)))
    numbers = np.arange(len(cells))

    def find_centres(vtk: int, rows: Index, nodes: IntArray) -> None:
        centre = np.empty((len(nodes), 3))
        volume = np.empty(len(nodes))
        polygons = shape_loops.POLYGONS[vtk]
        face_loops.write_centres(mesh.points, nodes, signs[rows].copy(), polygons, centre, volume)
        centres[rows] = centre
        volumes[rows] = volume

    def rate_faces(vtk: int, rows: Index, nodes: IntArray) -> None:
        around = (sides.first, sides.neighbour), (centres, volumes)
        own = mesh.points, nodes, numbers[rows], signs[rows].copy(), SIDE_NODES[vtk, : SIDES[vtk]]
        face_loops.write_faces(*own, *around, *found)

    cells.in_parts(find_centres)
    cells.in_parts(rate_faces)
    return dict(zip(_OF_FACES, found, strict=True))


_OF_FACES: tuple[Metric, ...] = ("non-orthogonality", "skewness", "expansion")


def _nodes(mesh: Mesh, signs: Signs) -> Made:
    """Return SU2's three metrics of the median dual mesh."""
    cells = mesh.cells
    found = np.empty((3, len(mesh.points)))
    around = cells_around(cells, len(mesh.points))
    limits = _boundary_areas(mesh)
    arrays = cells.offsets, cells.connectivity
    points = mesh.points if mesh.dim == 3 else np.pad(mesh.points, ((0, 0), (0, 1)))
    middles = np.empty((len(cells), 3))
    in_parts(
        lambda part: dual_loops.write_middles(points, *arrays, part.start, middles[part]),
        len(cells),
    )

    def of_part(part: slice) -> None:
        of_cells = cells.types, *arrays, signs, middles
        tables = dual_loops.AROUND, SIDE_NODES
        of_nodes = around.offsets, around.cells, around.local
        last = limits, part.start, found[:, part]
        dual_loops.write_nodes(points, of_cells, tables, of_nodes, *last)

    in_parts(of_part, len(mesh.points))
    return {"orthogonality": found[0], "area-ratio": found[1], "volume-ratio": found[2]}


def _boundary_areas(mesh: Mesh) -> FloatArray:
    """Return the smallest and the largest area (n, 2) of the markers at each node; inf, 0 for none.

    A marker's area at a node is the length of the sum of its facets' normals there. Facets between
    two cells (internal boundaries) do not bound a control volume, nor do a halo's.
    """
    limits = np.empty((len(mesh.points), 2))
    limits[:] = np.inf, 0.0
    for facets in _OUTER.of(mesh.cells, mesh.markers, lambda: _outer_facets(mesh)):
        nodes, normals = vertex_normals(mesh.points, facets)
        areas = row_norms(normals)
        limits[nodes, 0] = np.minimum(limits[nodes, 0], areas)
        limits[nodes, 1] = np.maximum(limits[nodes, 1], areas)
    return limits


def _outer_facets(mesh: Mesh) -> list[IntArray]:
    """Return the facets (f, 2 or 4) of each marker that only one cell has."""
    boundary = boundary_of(mesh)
    sides = sides_of(mesh.cells)
    inner = np.zeros(len(boundary.facets), bool)
    types = mesh.cells.types[boundary.owner]
    first = sides.first[boundary.owner]
    begin = mesh.cells.offsets[boundary.owner]
    for k in range(SIDE_NODES.shape[1]):
        some = np.flatnonzero(k < SIDES[types])
        local = SIDE_NODES[types[some], k]
        nodes = mesh.cells.connectivity[begin[some, None] + local]
        facets = boundary.facets[some, None, :]
        same = ((nodes[:, :, None] == facets).any(axis=2) | (local < 0)).all(axis=1)
        inner[some] |= same & (sides.neighbour[first[some] + k] >= 0)
    return [boundary.facets[(boundary.marker == at) & ~inner] for at in range(len(boundary.names))]


_FAMILIES: dict[Metric, Callable[[Mesh, Signs], Made]] = {
    **dict.fromkeys(shape_loops.SHAPES, _shapes),
    "non-orthogonality": _faces,
    "skewness": _faces,
    "expansion": _faces,
    "orthogonality": _nodes,
    "area-ratio": _nodes,
    "volume-ratio": _nodes,
}
"""What computes a metric, and others at the same time."""
