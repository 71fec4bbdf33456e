"""Small CGNS files, written node by node as the manuals "SIDS" and "CGNS/HDF5" say."""

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

TYPES = {"f4": "R4", "f8": "R8", "i4": "I4", "i8": "I8", "i1": "C1"}


def node(parent: h5py.Group, name: str, label: str, value=None) -> h5py.Group:
    """Return a new node; arrays are in C's order of indices, the reverse of the standard's."""
    group = parent.create_group(name, track_order=True)
    if isinstance(value, str):
        value = np.frombuffer(value.encode(), "i1")
    kind = "MT" if value is None else TYPES[value.dtype.str[1:]]
    _attributes(group, name, label, kind)
    if value is not None:
        group.create_dataset(" data", data=value)
    return group


def _attributes(group: h5py.Group, name: str, label: str, kind: str) -> None:
    for key, text, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        group.attrs.create(key, np.bytes_(text), dtype=f"S{size}")
    group.attrs.create("flags", np.array([1], "i4"))


def cgns_root(path: Path) -> h5py.File:
    """Return a new file with nothing but what each has."""
    file = h5py.File(path, "w", track_order=True)
    _attributes(file, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
    for key, text in ((" format", "IEEE_LITTLE_32"), (" hdf5version", "HDF5 Version 1.14.6")):
        file.create_dataset(key, data=np.frombuffer(text.ljust(33, "\0").encode(), "i1"))
    node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([4.2], "f4"))
    return file


def base(file: h5py.File, dim: int, physical: int | None = None, name: str = "Base") -> h5py.Group:
    return node(file, name, "CGNSBase_t", np.array([dim, physical or dim], "i4"))


def zone(parent, name: str, sizes, columns: Sequence[np.ndarray], kind="Structured", whole="i4"):
    """Return a zone; ``sizes`` is (vertices, cells) along each index, columns are coordinates."""
    table = np.array([*sizes, [0] * len(sizes[0])], whole)
    group = node(parent, name, "Zone_t", table)
    node(group, "ZoneType", "ZoneType_t", kind)
    grid = node(group, "GridCoordinates", "GridCoordinates_t")
    for axis, column in zip("XYZ", columns, strict=False):
        node(grid, f"Coordinate{axis}", "DataArray_t", column)
    return group


def block(parent, name: str, grid: np.ndarray, real: str = "f8", whole: str = "i4") -> h5py.Group:
    """Return a structured zone with the vertices grid[i, j, k] (ni, nj, nk, p)."""
    shape = grid.shape[:-1]
    columns = [np.ascontiguousarray(grid[..., k].T, real) for k in range(grid.shape[-1])]
    return zone(parent, name, (shape, [n - 1 for n in shape]), columns, whole=whole)


def section(parent, name: str, kind: int, begin: int, count: int, flat, whole: str = "i4"):
    """Return a section of elements whose numbers begin with ``begin``; nodes from 1."""
    group = node(parent, name, "Elements_t", np.array([kind, 0], "i4"))
    node(group, "ElementRange", "IndexRange_t", np.array([begin, begin + count - 1], whole))
    node(group, "ElementConnectivity", "DataArray_t", np.ravel(np.array(flat, whole)))
    return group


def condition(
    zone_group, name: str, points, family="", where="", label="IndexRange_t", child="PointRange"
):
    """Return a boundary condition on a range, or a list, of indices from 1."""
    group = zone_group.get("ZoneBC") or node(zone_group, "ZoneBC", "ZoneBC_t")
    one = node(group, name, "BC_t", "FamilySpecified" if family else "BCWall")
    node(one, child, label, np.array(points, "i4"))
    if family:
        node(one, "FamilyName", "FamilyName_t", family)
    if where:
        node(one, "GridLocation", "GridLocation_t", where)
    return one


def interface(zone_group, name: str, donor: str, here, there, turn, periodic=None):
    """Return a one-to-one interface of structured zones; periodic are centre, angles, shift."""
    one = node(_connectivity(zone_group), name, "GridConnectivity1to1_t", donor)
    node(one, "PointRange", "IndexRange_t", np.array(here, "i4"))
    node(one, "PointRangeDonor", "IndexRange_t", np.array(there, "i4"))
    node(one, "Transform", '"int[IndexDimension]"', np.array(turn, "i4"))
    if periodic is not None:
        add_period(one, *periodic)
    return one


def lists(zone_group, name: str, donor: str, here, there, kind="Abutting1to1", where="Vertex"):
    """Return an interface by lists of vertices or of faces."""
    one = node(_connectivity(zone_group), name, "GridConnectivity_t", donor)
    node(one, "GridConnectivityType", "GridConnectivityType_t", kind)
    node(one, "GridLocation", "GridLocation_t", where)
    node(one, "PointList", "IndexArray_t", np.array(here, "i4"))
    node(one, "PointListDonor", "IndexArray_t", np.array(there, "i4"))
    return one


def _connectivity(zone_group):
    name = "ZoneGridConnectivity"
    return zone_group.get(name) or node(zone_group, name, f"{name}_t")


def add_period(one, centre, angles, shift):
    holder = node(one, "GridConnectivityProperty", "GridConnectivityProperty_t")
    period = node(holder, "Periodic", "Periodic_t")
    for name, values in (
        ("RotationCenter", centre),
        ("RotationAngle", angles),
        ("Translation", shift),
    ):
        node(period, name, "DataArray_t", np.array(values, "f4"))


PITCH = 0.7


def wavy(points: np.ndarray) -> np.ndarray:
    """Return points of a box, turned into a passage that repeats by PITCH in y."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack(
        (x + 0.05 * np.sin(2 * x), PITCH * y + 0.2 * np.sin(x), z * (1 + 0.1 * x)), axis=-1
    )


def passage_grid(cells: Sequence[int] = (6, 4, 3), length: float = 2.0) -> np.ndarray:
    """Return the vertices of the passage, (ni, nj, nk, 3)."""
    along = [np.linspace(0, end, n + 1) for n, end in zip(cells, (length, 1, 1), strict=True)]
    return wavy(np.stack(np.meshgrid(*along, indexing="ij"), axis=-1))


def save_passage(path: Path, grid: np.ndarray, real: str = "f8", whole: str = "i4") -> Path:
    """Write the passage as two blocks that meet in the middle of i.

    The second block has its indices exchanged and turned round: its i is -k of the first, its
    j is i and its k is j. The blade is the hub of the first block.
    """
    with cgns_root(path) as file:
        top = base(file, 3)
        for family in ("INFLOW", "OUTFLOW", "BLADE", "HUB", "SHROUD"):
            node(node(top, family, "Family_t"), "FamilyBC", "FamilyBC_t", "BCWall")
        _first_block(top, grid[: len(grid) // 2 + 1], real, whole)
        _second_block(top, grid[: len(grid) // 2 + 1], grid[len(grid) // 2 :], real, whole)
    return path


def _first_block(top, grid, real, whole) -> None:
    a, b, c = grid.shape[:3]
    d, f = c, b
    first = block(top, "blk-1", grid, real, whole)
    solution = node(first, "FlowSolution", "FlowSolution_t")
    node(solution, "Pressure", "DataArray_t", np.arange(a * b * c, dtype="f8").reshape(c, b, a))
    condition(first, "in", [[1, 1, 1], [1, b, c]], "INFLOW")
    condition(first, "blade", [[1, 1, 1], [a, b, 1]], "BLADE")
    condition(first, "tip", [[1, 1, c], [a - 1, b - 1, c]], "SHROUD", "KFaceCenter")
    interface(first, "mid", "blk-2", [[a, 1, 1], [a, b, c]], [[d, 1, 1], [1, 1, f]], [2, 3, -1])
    low, high = [[1, 1, 1], [a, 1, c]], [[1, b, 1], [a, b, c]]
    plain = [1, 2, 3]
    interface(first, "lower", "blk-1", low, high, plain, ([0] * 3, [0] * 3, [0, PITCH, 0]))
    interface(first, "upper", "blk-1", high, low, plain, ([0] * 3, [0] * 3, [0, -PITCH, 0]))


def _second_block(top, before, grid, real, whole) -> None:
    turned = np.moveaxis(grid, 2, 0)[::-1]
    d, e, f = turned.shape[:3]
    a, b, c = before.shape[:3]
    second = block(top, "blk-2", turned, real, whole)
    condition(second, "out", [[1, e, 1], [d, e, f]], "OUTFLOW")
    condition(second, "hub", [[d, 1, 1], [d, e, f]], "HUB")
    condition(second, "tip", [[1, 1, 1], [1, e, f]], "SHROUD")
    interface(second, "mid", "blk-1", [[1, 1, 1], [d, 1, f]], [[a, 1, c], [a, b, 1]], [-3, 1, 2])
    low, high = [[1, 1, 1], [d, e, 1]], [[1, 1, f], [d, e, f]]
    plain = [1, 2, 3]
    interface(second, "lower-2", "blk-2", low, high, plain, ([0] * 3, [0] * 3, [0, PITCH, 0]))
    interface(second, "upper-2", "blk-2", high, low, plain, ([0] * 3, [0] * 3, [0, -PITCH, 0]))
