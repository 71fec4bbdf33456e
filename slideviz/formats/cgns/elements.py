"""Elements of the zones of a CGNS file: grids of structured zones, sections of unstructured ones.

Nodes of elements are in the order of the SIDS ("Unstructured Grid Element Numbering
Conventions"), which for linear elements is that of SU2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slideviz.formats.cgns.tree import Node
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.mesh.orientation import corner_sums

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
_TYPES = {_NAMES.index(name): vtk for name, vtk in _VTK.items()}
"""VTK identifier by number of the ``ElementType_t``, of the types that slideviz reads."""
_SIZES = np.zeros(256, np.int64)
"""Number of nodes by number of the ``ElementType_t``; 0 for those that slideviz does not read."""
_SIZES[list(_TYPES)] = [ELEMENTS[vtk].n_nodes for vtk in _TYPES.values()]
_MIXED = _NAMES.index("MIXED")


@dataclass(frozen=True, eq=False)
class CgnsElements:
    """Elements of an unstructured zone."""

    cells: Cells
    """The m elements, of any dimension."""
    numbers: IntArray
    """(m,): their numbers in the zone, from 1, ascending."""
    section: NDArray[np.int64]
    """(m,): index of the section that each is in."""

    def where(self, mask: NDArray[np.bool_]) -> CgnsElements:
        """Return the elements where the mask (m,) is true."""
        return CgnsElements(self.cells.take(mask), self.numbers[mask], self.section[mask])


def grid_cells(shape: Sequence[int], points: FloatArray) -> Cells:
    """Return the cells of a structured zone.

    Blocks may be left-handed, which CGNS allows: their cells are numbered the other way round, so
    that their volumes are positive.

    Parameters
    ----------
    shape : sequence of int
        Vertices along i, j (and k).
    points : (n, d)
        Vertices, i running fastest.
    """
    first = grid_nodes([np.arange(size - 1) for size in shape], shape)
    steps = np.cumprod([1, *shape[:-1]])
    corners = [0, steps[0], steps[0] + steps[1], steps[1]]
    vtk = 9
    if len(shape) == 3:
        corners, vtk = corners + [at + steps[2] for at in corners], 12
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
    cells = Cells.from_types(
        np.concatenate([part.types for _, part, _ in parts]),
        np.concatenate([part.connectivity for _, part, _ in parts]),
    )
    numbers = [np.arange(start, start + len(part)) for start, part, _ in parts]
    section = np.repeat(np.arange(len(parts)), [len(part) for _, part, _ in parts])
    return CgnsElements(cells, np.concatenate(numbers), section), [node for *_, node in parts]


def _section(node: Node, n_points: int) -> tuple[int, Cells]:
    """Return the number of the first element of a section, and its elements, or raise MeshError.

    ``n_points`` is the number of the zone's vertices.
    """
    kind = int(node.integers(2)[0])
    name = _NAMES[kind] if 0 <= kind < len(_NAMES) else str(kind)
    if kind not in _TYPES and kind != _MIXED:
        what = "polygons and polyhedra" if name.startswith("N") else "elements of high order"
        raise node.fault(
            f"has {what} ({name}), but slideviz needs linear elements ({', '.join(_VTK)}, MIXED); "
            "export the mesh with these"
        )
    if (rind := node.child("Rind_t")) is not None and rind.integers(-1).any():
        raise rind.fault("the section has rind elements, which are not read; export without them")
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
    vtk[list(_TYPES)] = list(_TYPES.values())
    return start, Cells.from_types(vtk[types], flat - 1)


def _mixed(node: Node, flat: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return the types (m,) and nodes (k,) of the elements of a MIXED section, or raise MeshError.

    In its array ``flat`` each element's type precedes its nodes; ``count`` is m.
    """
    # A damaged range must not ask for more memory than the file has numbers.
    places, at, sizes = np.empty(min(count, len(flat)), np.int64), 0, _SIZES.tolist()
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
