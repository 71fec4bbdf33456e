"""A new CGNS file of a mesh: one unstructured zone, and a family and condition for each boundary.

The nodes are those of the SIDS (CGNS 4), mapped onto HDF5 as in `slideviz.formats.cgns.tree`.
"""

from __future__ import annotations

from collections.abc import Iterator

import h5py
import numpy as np
from numpy.typing import NDArray

from slideviz.formats.cgns.tree import DATA
from slideviz.formats.cgns.zone import TYPES
from slideviz.formats.hdf5 import free_name
from slideviz.mesh.model import Cells, Mesh

MOST_LETTERS = 32  # of a node's name
VERSION = 4.0
KINDS = {"f4": "R4", "f8": "R8", "i4": "I4", "i8": "I8", "i1": "C1"}
"""CGNS's name of a data type by NumPy's."""


def write_tree(tree: h5py.File, mesh: Mesh) -> None:
    """Write a mesh into an empty HDF5 file."""
    _describe(tree, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
    for key, text in ((" format", "IEEE_LITTLE_32"), (" hdf5version", "HDF5 Version 1.8.0")):
        tree.create_dataset(key, data=np.frombuffer(text.ljust(33, "\0").encode(), "i1"))
    _add(tree, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([VERSION], "f4"))
    base = _add(tree, "Base", "CGNSBase_t", np.array([mesh.dim, mesh.dim], "i4"))
    sizes = np.array([[len(mesh.points)], [len(mesh.cells)], [0]])
    zone = _add(base, "Zone", "Zone_t", sizes)
    _add(zone, "ZoneType", "ZoneType_t", "Unstructured")
    grid = _add(zone, "GridCoordinates", "GridCoordinates_t")
    for axis, values in zip("XYZ", mesh.points.T, strict=False):
        _add(grid, f"Coordinate{axis}", "DataArray_t", np.ascontiguousarray(values))
    first = 1
    for name, vtk, nodes in _sections("Cells", mesh.cells):
        first = _add_section(zone, name, vtk, nodes, first)
    conditions = _add(zone, "ZoneBC", "ZoneBC_t")
    taken = {"Zone", "ZoneBC", "ZoneType", "GridCoordinates", *zone}
    for marker in mesh.markers:
        clean = marker.name.replace("/", "_")[: MOST_LETTERS - 3]
        family = free_name(clean, taken)
        taken.add(family)
        _add(_add(base, family, "Family_t"), "FamilyBC", "FamilyBC_t", "UserDefined")
        start = first
        for name, vtk, nodes in _sections(family, marker.cells):
            taken.add(name)
            first = _add_section(zone, name, vtk, nodes, first)
        if first == start:
            continue
        one = _add(conditions, family, "BC_t", "FamilySpecified")
        _add(one, "PointRange", "IndexRange_t", np.array([[start], [first - 1]]))
        _add(one, "GridLocation", "GridLocation_t", "FaceCenter" if mesh.dim == 3 else "EdgeCenter")
        _add(one, "FamilyName", "FamilyName_t", family)


def _sections(name: str, cells: Cells) -> Iterator[tuple[str, int, NDArray]]:
    """Yield name, type and nodes of the elements of each type."""
    for number, (vtk, (_, nodes)) in enumerate(cells.by_type.items(), 1):
        yield name if number == 1 else f"{name}_{number}", vtk, nodes


def _add_section(zone: h5py.Group, name: str, vtk: int, nodes: NDArray, first: int) -> int:
    """Add elements, numbered from ``first``; return the number of the next."""
    kind = next(number for number, one in TYPES.items() if one == vtk)
    section = _add(zone, name, "Elements_t", np.array([kind, 0], "i4"))
    _add(section, "ElementRange", "IndexRange_t", np.array([first, first + len(nodes) - 1]))
    _add(section, "ElementConnectivity", "DataArray_t", (nodes + 1).ravel())
    return first + len(nodes)


def _add(
    parent: h5py.Group, name: str, label: str, value: NDArray | str | None = None
) -> h5py.Group:
    """Add a node; axes of its value are in C's order, the reverse of the standard's."""
    group = parent.create_group(name, track_order=True)
    if isinstance(value, str):
        value = np.frombuffer(value.encode(), "i1")
    _describe(group, name, label, "MT" if value is None else KINDS[value.dtype.str[1:]])
    if value is not None:
        group.create_dataset(DATA, data=value)
    return group


def _describe(group: h5py.Group, name: str, label: str, kind: str) -> None:
    for key, text, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        group.attrs.create(key, np.bytes_(text), dtype=f"S{size}")
    group.attrs.create("flags", np.array([1], "i4"))
