"""Zones of a CGNS file: own node numbers, grids or sections of elements, facets of boundaries.

Nodes of elements are in the order of the SIDS ("Unstructured Grid Element Numbering
Conventions"), which for linear elements is that of SU2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.formats.cgns.tree import DATA, Node
from slideviz.formats.meshio.bridge import in_node_sets
from slideviz.mesh.cached_boundary import outer_facets
from slideviz.mesh.elements import DIMS, ELEMENTS
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.mesh.orientation import corner_sums
from slideviz.terms import Texts, WholeNumbers

_NAMES = """
Null UserDefined NODE BAR_2 BAR_3 TRI_3 TRI_6 QUAD_4 QUAD_8 QUAD_9 TETRA_4 TETRA_10 PYRA_5
PYRA_14 PENTA_6 PENTA_15 PENTA_18 HEXA_8 HEXA_20 HEXA_27 MIXED PYRA_13 NGON_n NFACE_n BAR_4
TRI_9 TRI_10 QUAD_12 QUAD_16 TETRA_16 TETRA_20 PYRA_21 PYRA_29 PYRA_30 PENTA_24 PENTA_38
PENTA_40 HEXA_32 HEXA_56 HEXA_64 BAR_5 TRI_12 TRI_15 QUAD_P4_16 QUAD_25 TETRA_22 TETRA_34
TETRA_35 PYRA_P4_29 PYRA_50 PYRA_55 PENTA_33 PENTA_66 PENTA_75 HEXA_44 HEXA_98 HEXA_125
""".split()  # noqa: SIM905  (a list of names would be 57 lines)
"""Names of ``ElementType_t`` by number."""
_VTK = {"NODE": 1, "BAR_2": 3, "TRI_3": 5, "QUAD_4": 9, "TETRA_4": 10, "PYRA_5": 14, "PENTA_6": 13}
_VTK["HEXA_8"] = 12
TYPES = {_NAMES.index(name): vtk for name, vtk in _VTK.items()}
"""VTK identifier by number of the ``ElementType_t``, of the types that slideviz reads."""
_SIZES = np.zeros(256, np.int64)
"""Number of nodes by number of the ``ElementType_t``; 0 for those that slideviz does not read."""
_SIZES[list(TYPES)] = [ELEMENTS[vtk].n_nodes for vtk in TYPES.values()]
_MIXED = _NAMES.index("MIXED")


@record
class CgnsElements:
    """Elements of an unstructured zone."""

    cells: Cells  # the m elements, of any dimension
    numbers: IntArray  # (m,): their numbers in the zone, from 1, ascending
    section: NDArray[np.int64]  # (m,): index of the section that each is in

    def where(self, mask: NDArray[np.bool_]) -> CgnsElements:
        """Return the elements where the mask (m,) is true."""
        return CgnsElements(self.cells.take(mask), self.numbers[mask], self.section[mask])


def grid_cells(shape: Sequence[int], points: FloatArray) -> Cells:
    """Return the cells of a structured zone.

    Blocks may be left-handed, which CGNS allows: their cells are numbered the other way round, so
    that their volumes are positive. ``shape``: vertices along i, j (and k). ``points`` (n, d):
    vertices, i running fastest.
    """
    first = grid_nodes([np.arange(size - 1) for size in shape], shape)
    steps = np.cumprod([1, *shape[:-1]])
    corners = [0, steps[0], steps[0] + steps[1], steps[1]]
    vtk = 9
    if len(shape) == 3:
        corners = corners + [at + steps[2] for at in corners]
        vtk = 12
    cells = Cells.from_blocks([(vtk, first[:, None] + np.array(corners))])
    if np.nansum(corner_sums(Mesh(points, cells))) < 0:
        turn = [4, 5, 6, 7, 0, 1, 2, 3] if vtk == 12 else [0, 3, 2, 1]
        cells = Cells.from_blocks([(vtk, first[:, None] + np.array(corners)[turn])])
    return cells


def grid_nodes(along: Sequence[IntArray], shape: Sequence[int]) -> IntArray:
    """Return the numbers (n,) of a grid's nodes at all combinations of indices, i running fastest.

    ``along`` has the indices in each direction, from 0; ``shape`` the grid's number of nodes.
    """
    steps = np.cumprod([1, *shape[:-1]])
    numbers = np.zeros(1, np.int64)
    for indices, step in zip(along, steps, strict=True):
        numbers = (indices[:, None] * step + numbers).ravel()
    return numbers


def read_sections(zone: Node, n_points: int) -> tuple[CgnsElements, list[Node]]:
    """Return the elements of an unstructured zone in the order of their numbers, and its sections.

    Raises MeshError if a section has elements that are not linear, or it contradicts itself or
    another one.
    """
    nodes = zone.children("Elements_t")
    if not nodes:
        raise zone.fault("has no elements (Elements_t); export the mesh with its volume cells")
    parts = [(*_section(node, n_points), node) for node in nodes]
    parts.sort(key=lambda part: part[0])
    ends = [start + len(cells) for start, cells, _ in parts]
    for (start, _, node), end in zip(parts[1:], ends, strict=False):
        if start < end:
            raise node.fault(
                f"its ElementRange begins with {start}, but another section has the elements to "
                f"{end - 1}; the ranges of sections must not overlap: export the mesh again"
            )
    cells = Cells.joined([part for _, part, _ in parts])
    numbers = [np.arange(start, start + len(part)) for start, part, _ in parts]
    section = np.repeat(np.arange(len(parts)), [len(part) for _, part, _ in parts])
    return CgnsElements(cells, np.concatenate(numbers), section), [node for *_, node in parts]


def _section(node: Node, n_points: int) -> tuple[int, Cells]:
    """Return a section's first element number, and its elements, of nodes below ``n_points``."""
    kind = int(node.integers(2)[0])
    name = _NAMES[kind] if 0 <= kind < len(_NAMES) else str(kind)
    if kind not in TYPES and kind != _MIXED:
        what = "polygons and polyhedra" if name.startswith("N") else "elements of high order"
        raise node.fault(
            f"has {what} ({name}), but slideviz needs linear elements ({', '.join(_VTK)}, MIXED); "
            "export the mesh with these"
        )
    _refuse_rind(node, "the section has rind elements, which are not read; export without them")
    start, end = node.needed("IndexRange_t", "ElementRange").integers(2).tolist()
    if not 1 <= start <= end:
        raise node.fault(f"its ElementRange is {start} to {end}; it must rise from 1 or more")
    flat = node.needed("DataArray_t", "ElementConnectivity").integers(-1)
    count = end - start + 1
    if kind == _MIXED:
        types, flat = _mixed(node, flat, count)
    needs = int(_SIZES[types].sum()) if kind == _MIXED else count * int(_SIZES[kind])
    if len(flat) != needs:
        raise node.fault(
            f"its ElementConnectivity has {len(flat)} nodes, but the {count} elements of its "
            f"ElementRange ({name}) need {needs}; export the mesh again"
        )
    types = types if kind == _MIXED else np.full(count, kind)
    if flat.min() < 1 or flat.max() > n_points:
        bad = flat[(flat < 1) | (flat > n_points)][0]
        raise node.fault(
            f"has node {bad}, but the {n_points} vertices of the zone are numbered from 1 to "
            f"{n_points}; export the mesh again"
        )
    vtk = np.zeros(256, np.uint8)
    vtk[list(TYPES)] = list(TYPES.values())
    return start, Cells.from_types(vtk[types], flat - 1)


def _mixed(node: Node, flat: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return the types (m,) and nodes (k,) of the elements of a MIXED section, or raise MeshError.

    In its array ``flat`` each element's type precedes its nodes; ``count`` is m.
    """
    # A damaged range must not ask for more memory than the file has numbers.
    places = np.empty(min(count, len(flat)), np.int64)
    at = 0
    sizes = _SIZES.tolist()
    kinds = memoryview(np.ascontiguousarray(flat).data)
    for element in range(count):
        kind = kinds[at] if at < len(kinds) else None
        if kind is None or not 0 <= kind < len(sizes) or not sizes[kind]:
            if kind is None:
                told = f"it ends after {element} elements"
            else:
                name = _NAMES[kind] if 0 <= kind < len(_NAMES) else kind
                told = f"its element {element + 1} is of type {name}"
            raise node.fault(
                f"{told}, but its ElementRange has {count}, and those in MIXED must be "
                f"{', '.join(_VTK)}; export the mesh again, with linear elements"
            )
        places[element] = at
        at += sizes[kind] + 1
    return flat[places], np.delete(flat, places)


_AXES = ("CoordinateX", "CoordinateY", "CoordinateZ")
# Values of GridLocation: vertices; facets, by the dimension of the cells; those across i, j, k.
_BY_NODES = "Vertex"
_BY_FACETS = {2: ("EdgeCenter", "FaceCenter"), 3: ("FaceCenter",)}
_BY_DIRECTION = ("IFaceCenter", "JFaceCenter", "KFaceCenter")
_LABELS = ("IndexRange_t", "IndexArray_t")


@record
class CgnsZone:
    """A zone: its vertices, its cells, and where its coordinates are in the file."""

    node: Node  # its place in the tree
    dim: int  # the dimension of its cells
    shape: WholeNumbers
    """Vertices along i, j (and k) of a structured zone; their number in an unstructured one."""
    points: FloatArray  # (n, p): vertices, i running fastest; p is the number of coordinates
    cells: Cells  # its cells
    sides: CgnsElements | None
    """Elements of an unstructured zone with one dimension less; None for a structured zone."""
    sections: tuple[Node, ...]  # its sections of elements; empty for a structured zone
    datasets: Texts  # paths of the datasets of the p coordinates

    @cached_property
    def outer(self) -> Cells:
        """Return the facets that only one cell of the zone has."""
        return outer_facets(Mesh(self.points[:, : self.dim], self.cells))

    def nodes_at(self, node: Node, indices: IntArray) -> IntArray:
        """Return the numbers (m,), from 0, of vertices at ``indices`` (m, len(shape)), from 1.

        Raises MeshError, which names ``node``, if an index is out of range.
        """
        bad = ((indices < 1) | (indices > self.shape)).any(axis=1)
        if bad.any():
            raise node.fault(
                f"names the vertex {tuple(indices[bad][0].tolist())}, but the vertices of "
                f"{self.node.name} are numbered from 1 to {' x '.join(map(str, self.shape))}; "
                "export the mesh again"
            )
        return np.asarray((indices - 1) @ np.cumprod([1, *self.shape[:-1]]), np.int64)


def read_zone(node: Node, dim: int, physical: int) -> CgnsZone:
    """Return a zone of a base whose cells have dimension ``dim``, with ``physical`` coordinates.

    Raises MeshError if it is wrong, or has what slideviz cannot use; the message has the node.
    """
    kind = node.needed("ZoneType_t", "ZoneType").text()
    if kind not in ("Structured", "Unstructured"):
        raise node.fault(
            f"its ZoneType is {kind!r}; it must be Structured or Unstructured: export it again"
        )
    sizes = node.integers(3, -1)[0]
    shape = tuple(sizes.tolist())
    if len(shape) != (dim if kind == "Structured" else 1) or min(shape) < 2:
        raise node.fault(
            f"it is {kind.lower()} with {' x '.join(map(str, shape)) or 'no'} vertices, but has "
            f"cells of dimension {dim}; export the mesh again"
        )
    points, datasets = _points(node, shape, physical)
    if kind == "Structured":
        flat = points[:, :dim]
        return CgnsZone(node, dim, shape, points, grid_cells(shape, flat), None, (), datasets)
    elements, sections = read_sections(node, len(points))
    dims = DIMS[elements.cells.types]
    if not (dims == dim).any():
        raise node.fault(f"has no cells of dimension {dim}; export the mesh with its volume cells")
    cells = elements.cells.take(dims == dim)
    sides = elements.where(dims == dim - 1)
    return CgnsZone(node, dim, shape, points, cells, sides, tuple(sections), datasets)


def _refuse_rind(node: Node, words: str) -> None:
    if (rind := node.child("Rind_t")) is not None and rind.integers(-1).any():
        raise rind.fault(words)


def _points(zone: Node, shape: WholeNumbers, count: int) -> tuple[FloatArray, Texts]:
    """Return the vertices (n, count) of a zone, and the paths of their datasets; or MeshError."""
    grid = zone.needed("GridCoordinates_t", "GridCoordinates")
    _refuse_rind(
        grid,
        "the coordinates have rind planes (copies of neighbours), which are not read; export the "
        "mesh without them",
    )
    nodes = {node.name: node for node in grid.children("DataArray_t")}
    columns = []
    datasets = []
    for axis in _AXES[:count]:
        if axis not in nodes:
            raise grid.fault(
                f"has no {axis}, but {', '.join(nodes) or 'nothing'}; export the mesh with "
                f"Cartesian coordinates ({', '.join(_AXES[:count])})"
            )
        values = nodes[axis].value()
        if values.dtype.kind != "f" or values.dtype.itemsize not in (4, 8):
            raise nodes[axis].fault(
                f"is of type {values.dtype}; expected R4 or R8: export it again"
            )
        if values.shape != shape[::-1]:
            raise nodes[axis].fault(
                f"has {' x '.join(map(str, values.shape[::-1]))} values, but the zone has "
                f"{' x '.join(map(str, shape))} vertices; export the mesh again"
            )
        if not np.isfinite(values).all():
            at = int(np.argmin(np.isfinite(values.ravel())))
            raise nodes[axis].fault(
                f"is {values.ravel()[at]} at vertex {at + 1}, which is not finite; correct the file"
            )
        columns.append(values.ravel().astype(np.float64))
        datasets.append(f"{nodes[axis].group.name}/{DATA}")
    return np.stack(columns, axis=1), tuple(datasets)


def region_of(zone: CgnsZone, node: Node) -> Cells | IntArray:
    """Return the facets, or the vertices (k,), that a boundary condition or interface is on.

    Raises MeshError if the node is wrong. ``node``: one with ``PointRange``, ``PointList``,
    ``ElementRange`` or ``ElementList``, and perhaps a ``GridLocation``: vertices (as without one)
    or faces (edges in 2D).
    """
    where = node.word("GridLocation_t", _BY_NODES, "GridLocation")
    children = node.children(*_LABELS)
    named = {one.name: one for one in children}
    elements = named.get("ElementRange", named.get("ElementList"))
    if elements is not None:
        return faces_by_number(zone, elements, elements.integers(-1))
    points = named.get("PointRange", named.get("PointList"))
    if points is None:
        raise node.fault(
            "has no PointRange, PointList, ElementRange or ElementList, so it is nowhere; export "
            "the mesh again"
        )
    allowed = (_BY_NODES, *_BY_FACETS[zone.dim])
    if zone.sides is None:
        allowed += _BY_DIRECTION[: zone.dim]
    if where not in allowed:
        raise node.fault(
            f"its GridLocation is {where}; boundaries are read at {', '.join(allowed)}: export "
            "the mesh with one of them"
        )
    if zone.sides is not None and where != _BY_NODES:
        return faces_by_number(zone, points, points.integers(-1))
    indices = points.integers(-1, len(zone.shape))
    if points.name == "PointList":
        if where == _BY_NODES:
            return np.unique(zone.nodes_at(points, indices))
        return _listed_faces(zone, points, where, indices)
    if len(indices) != 2:
        raise points.fault(f"has {len(indices)} corners; a range has two: export the mesh again")
    if zone.sides is not None:
        low, high = np.sort(zone.nodes_at(points, indices)).tolist()
        return np.arange(low, high + 1)
    return _range_faces(zone, points, where, np.sort(indices, axis=0))


def facets_of(zone: CgnsZone, node: Node) -> Cells:
    """Return the facets of a boundary condition or interface, with the zone's node numbers.

    If it is given by vertices, they are the outer facets that have no other vertices.
    """
    region = region_of(zone, node)
    if isinstance(region, Cells):
        return region
    return Cells.from_blocks(in_node_sets(len(zone.points), zone.outer, {0: region})[0])


def faces_by_number(zone: CgnsZone, node: Node, numbers: IntArray) -> Cells:
    """Return the facets whose element numbers are ``numbers`` or, of a range node, in its range.

    Raises MeshError if the zone has no such elements of one dimension less than its cells.
    """
    if zone.sides is None:
        raise node.fault(
            "names elements, which a structured zone does not have; export it with PointRange"
        )
    if node.name.endswith("Range"):
        low, high = np.sort(node.integers(2)).tolist()
        have = zone.sides.numbers
        numbers = have[(have >= low) & (have <= high)]
        missing = [] if len(numbers) == high - low + 1 else [f"all of {low} to {high}"]
    else:
        missing = np.setdiff1d(numbers, zone.sides.numbers)[:1].tolist()
    if missing:
        raise node.fault(
            f"names element {missing[0]}, but the sections of {zone.node.name} do not have it as a "
            f"{'face' if zone.dim == 3 else 'edge'}; export the mesh with its boundary elements"
        )
    return zone.sides.cells.take(np.isin(zone.sides.numbers, numbers))


def _range_faces(zone: CgnsZone, node: Node, where: str, corners: IntArray) -> Cells:
    """Return the faces of a structured zone in the range of indices ``corners`` (2, d), from 1.

    ``where`` is the GridLocation of the indices. Empty for a range of vertices that is a line or a
    point; MeshError if it is not a face.
    """
    low, high = corners
    flat = np.flatnonzero(low == high)
    if where in _BY_DIRECTION:
        flat = np.array([_BY_DIRECTION.index(where)])
        if low[flat[0]] != high[flat[0]]:
            flat = flat[:0]
    elif where != _BY_NODES and len(flat) > 1:
        # One cell in some direction: the face is where the boundary of the zone is.
        flat = flat[(low[flat] == 1) | (low[flat] == np.array(zone.shape)[flat])]
    if where == _BY_NODES and len(flat) > 1:
        return Cells.from_blocks([])  # a line or a point, as of a degenerate boundary
    if len(flat) != 1:
        raise node.fault(
            f"goes from {tuple(low.tolist())} to {tuple(high.tolist())}, which is not "
            f"{'a face' if zone.dim == 3 else 'an edge'} of the zone; export the mesh again"
        )
    axis = int(flat[0])
    zone.nodes_at(node, corners)
    ends = high if where == _BY_NODES else high + 1
    along = [np.arange(a - 1, b - 1) for a, b in zip(low, ends, strict=True)]
    along[axis] = np.array([low[axis] - 1])
    if where != _BY_NODES:
        last = np.array(zone.shape) - 1
        beyond = [k for k in range(zone.dim) if k != axis and high[k] > last[k]]
        if beyond:
            raise node.fault(
                f"ends at {tuple(high.tolist())}, but the zone has {' x '.join(map(str, last))} "
                "cells; export the mesh again"
            )
    return _faces(zone, axis, grid_nodes(along, zone.shape))


def _listed_faces(zone: CgnsZone, node: Node, where: str, indices: IntArray) -> Cells:
    """Return the faces of a structured zone at ``indices`` (m, d), from 1, across one direction.

    It is that of the GridLocation ``where``. Raises MeshError if ``where`` is another one.
    """
    if where not in _BY_DIRECTION:
        raise node.fault(
            f"lists faces of a structured zone at {where}, which does not tell their direction; "
            f"export the mesh with {', '.join(_BY_DIRECTION[: zone.dim])} or PointRange"
        )
    axis = _BY_DIRECTION.index(where)
    across = indices + (np.arange(zone.dim) != axis)
    zone.nodes_at(node, across)
    return _faces(zone, axis, zone.nodes_at(node, indices))


def _faces(zone: CgnsZone, axis: int, first: IntArray) -> Cells:
    """Return structured faces across ``axis`` (0 to 2) whose lowest vertices are ``first`` (m,)."""
    steps = np.delete(np.cumprod([1, *zone.shape[:-1]]), axis)
    corners = [0, steps[0]] if zone.dim == 2 else [0, steps[0], steps.sum(), steps[1]]
    return Cells.from_blocks([(3 if zone.dim == 2 else 9, first[:, None] + np.array(corners))])


def conditions(zone: CgnsZone) -> Iterator[Node]:
    """Yield the boundary conditions of a zone."""
    for group in zone.node.children("ZoneBC_t"):
        yield from group.children("BC_t")
