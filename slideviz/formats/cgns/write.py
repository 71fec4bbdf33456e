"""A new CGNS file of a mesh: one unstructured zone, boundaries as families, periodic interfaces.

The nodes are those of the SIDS (CGNS 4), mapped onto HDF5 as in `slideviz.formats.cgns.tree`.
"""

from __future__ import annotations

import h5py
import numpy as np
from numpy.typing import NDArray

from slideviz.formats.cgns.tree import DATA
from slideviz.formats.cgns.zone import TYPES
from slideviz.formats.hdf5 import free_name
from slideviz.mesh.model import Cells, IntArray, Mesh
from slideviz.mesh.periodic import Pair, find_pairs

MOST_LETTERS = 32  # of a node's name
VERSION = 4.0
LABELS = """
Zone_t ZoneType_t GridCoordinates_t DataArray_t Elements_t IndexRange_t IndexArray_t ZoneBC_t
BC_t GridLocation_t Family_t FamilyBC_t FamilyName_t ZoneGridConnectivity_t Periodic_t
GridConnectivity_t GridConnectivityType_t GridConnectivityProperty_t DimensionalUnits_t
GridConnectivity1to1_t "int[IndexDimension]"
"""
"""Labels of the nodes below a base that meshes keep."""
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
    first = _add_sections(zone, "Cells", mesh.cells, 1)
    conditions = _add(zone, "ZoneBC", "ZoneBC_t")
    taken = {"Zone", *zone}
    families = dict[str, str]()
    for marker in mesh.markers:
        clean = marker.name.replace("/", "_")[: MOST_LETTERS - 3]
        family = free_name(clean, taken)
        taken.add(family)
        families[marker.name] = family
        _add(_add(base, family, "Family_t"), "FamilyBC", "FamilyBC_t", "UserDefined")
        start = first
        first = _add_sections(zone, family, marker.cells, first)
        if first == start:
            continue
        one = _add(conditions, family, "BC_t", "FamilySpecified")
        _add(one, "PointRange", "IndexRange_t", np.array([[start], [first - 1]]))
        _add(one, "GridLocation", "GridLocation_t", "FaceCenter" if mesh.dim == 3 else "EdgeCenter")
        _add(one, "FamilyName", "FamilyName_t", family)
    names = {name for name, role in mesh.roles.items() if role == "periodic"}
    found = find_pairs(mesh) if names else ()
    pairs = [pair for pair in found if names >= {pair.first, pair.second}]
    if not pairs:
        return
    sides = _add(zone, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
    for pair in pairs:
        _add_interface(sides, families[pair.first], pair, pair.nodes, 1.0)
        _add_interface(sides, families[pair.second], pair, pair.nodes[:, ::-1], -1.0)


def _add_interface(
    sides: h5py.Group, name: str, pair: Pair, nodes: IntArray, direction: float
) -> None:
    """Add a side of a periodic pair: its ``nodes`` (k, 2) and their images, and where these are."""
    one = _add(sides, name, "GridConnectivity_t", "Zone")
    _add(one, "GridConnectivityType", "GridConnectivityType_t", "Abutting1to1")
    for label, column in zip(("PointList", "PointListDonor"), nodes.T, strict=True):
        _add(one, label, "IndexArray_t", column[:, None] + 1)
    holder = _add(one, "GridConnectivityProperty", "GridConnectivityProperty_t")
    period = _add(holder, "Periodic", "Periodic_t")
    dim = len(pair.vector)
    turn = direction * pair.angle * np.array(pair.axis)
    _add(period, "RotationCenter", "DataArray_t", np.array(pair.origin[:dim], "f4"))
    angles = _add(period, "RotationAngle", "DataArray_t", turn[-dim:].astype("f4"))
    units = "".join(word.ljust(32) for word in (*["Null"] * 4, "Radian"))
    _add(angles, "DimensionalUnits", "DimensionalUnits_t", units)
    _add(period, "Translation", "DataArray_t", (direction * pair.vector).astype("f4"))


def _add_sections(zone: h5py.Group, name: str, cells: Cells, first: int) -> int:
    """Add the elements of each type, numbered from ``first``; return the number of the next."""
    for vtk, (_, nodes) in cells.by_type.items():
        kind = next(number for number, one in TYPES.items() if one == vtk)
        section = _add(zone, free_name(name, zone), "Elements_t", np.array([kind, 0], "i4"))
        _add(section, "ElementRange", "IndexRange_t", np.array([first, first + len(nodes) - 1]))
        _add(section, "ElementConnectivity", "DataArray_t", (nodes + 1).ravel())
        first += len(nodes)
    return first


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
