"""Reading and writing CGNS meshes: the zones of a base as one mesh, with its boundaries.

Read with h5py: VTK's reader returns neither one-to-one interfaces nor where each coordinate is in
the file, which writing needs; and meshes need no VTK elsewhere. The standard is the SIDS (CGNS 4),
mapped onto HDF5. A mesh of such a file is written as a copy of it with other coordinates.

Nodes that two zones share by a one-to-one interface are merged. Periodic interfaces and those
that are not one to one (mixing planes, overset grids) are left open: their faces are boundaries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from slideviz.argument_types import record
from slideviz.errors import path_error, printable
from slideviz.formats.cgns.tree import Node, cgns_file
from slideviz.formats.cgns.write import LABELS, write_tree
from slideviz.formats.cgns.zone import (
    CgnsZone,
    conditions,
    faces_by_number,
    facets_of,
    grid_nodes,
    read_zone,
    region_of,
)
from slideviz.formats.hdf5 import free_name, hdf5_write
from slideviz.formats.meshio.bridge import flattened, in_node_sets, require_own_folder
from slideviz.formats.table import WriteOptions
from slideviz.mesh.cached_boundary import outer_facets, smooth_parts
from slideviz.mesh.check import check_mesh
from slideviz.mesh.fans import components
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh, Origin, frozen_array
from slideviz.mesh.nearest import row_groups
from slideviz.terms import Numbers, Role, Texts

JOINED = 1e-6
"""Largest distance of merged nodes, as a fraction of the extent: R4 coordinates are rounded so."""
_ONE_TO_ONE = "Abutting1to1"  # value of GridConnectivityType for interfaces that are joined


@record
class Interface:
    """An interface of a zone with another one, or with itself."""

    node: Node  # its place in the tree
    zone: int
    donor: int  # `zone`, `donor`: numbers of the zones
    pairs: tuple[IntArray, IntArray] | None
    """((m,), (m,)) or None: nodes of the zone and of the donor that are the same point; None if it
    is not to be joined."""
    period: Numbers = ()
    """Centre and angles of the rotation, and translation; empty if it is not periodic."""
    why: str = ""  # reason why it cannot be joined, for a remark; empty if it can, or is periodic


@record
class Joined:
    """Zones joined to one mesh."""

    points: FloatArray  # (n, p): points of the mesh
    numbers: tuple[IntArray, ...]
    """tuple of (n_z,) int64: for each zone, the index in ``points`` of each of its vertices."""
    open: tuple[Interface, ...]  # interfaces that are not joined
    parts: IntArray  # (z,): index of the connected part of the mesh that each zone is in


def join(zones: Sequence[CgnsZone]) -> Joined:
    """Return the zones of a base, joined by their interfaces.

    A node of several zones gets the coordinates of the first of them. Raises MeshError if an
    interface is wrong; the message has its node.
    """
    names = {zone.node.name: number for number, zone in enumerate(zones)}
    points = np.concatenate([zone.points for zone in zones])
    begins = np.cumsum([0, *(len(zone.points) for zone in zones)])
    tolerance = JOINED * float(np.ptp(points, axis=0).max())
    closed: list[Interface] = []
    left: list[Interface] = []
    for zone in range(len(zones)):
        for one in _interfaces(zones, zone, names, tolerance):
            (left if one.period or one.why else closed).append(one)
    here = np.empty(0, np.int64)
    there = np.empty(0, np.int64)
    for one in closed:
        assert one.pairs is not None
        here = np.append(here, one.pairs[0] + begins[one.zone])
        there = np.append(there, one.pairs[1] + begins[one.donor])
    number = components(len(points), here, there)  # in the order of their first nodes
    first = np.unique(number, return_index=True)[1]
    ends = np.array([(one.zone, one.donor) for one in closed], np.int64).reshape(-1, 2)
    parts = components(len(zones), ends[:, 0], ends[:, 1])
    numbers = tuple(number[a:b] for a, b in pairwise(begins))
    return Joined(points[first], numbers, tuple(left), parts)


def _interfaces(
    zones: Sequence[CgnsZone], zone: int, names: dict[str, int], tolerance: float
) -> list[Interface]:
    interfaces = []
    for group in zones[zone].node.children("ZoneGridConnectivity_t"):
        for node in group.children("GridConnectivity1to1_t", "GridConnectivity_t"):
            name = node.text().rpartition("/")[2]
            if name not in names:
                raise node.fault(
                    f"is an interface with the zone {name!r}, which the base does not have (it "
                    f"has {', '.join(names)}); export all zones together"
                )
            interfaces.append(_interface(zones, node, zone, names[name], tolerance))
    return interfaces


def _interface(
    zones: Sequence[CgnsZone], node: Node, zone: int, donor: int, tolerance: float
) -> Interface:
    """Return an interface of a node, open if its nodes are apart; MeshError if it is wrong."""
    period = _period(node)
    if period:
        return Interface(node, zone, donor, None, period)
    if node.label == "GridConnectivity1to1_t":
        pairs = _blocks_meet(zones[zone], zones[donor], node)
    else:
        kind = node.word("GridConnectivityType_t", "Overset", "GridConnectivityType")
        if kind != _ONE_TO_ONE:
            return Interface(node, zone, donor, None, why=f"it is {kind}, not one to one")
        pairs = _lists_meet(zones[zone], zones[donor], node)
    apart = zones[zone].points[pairs[0]] - zones[donor].points[pairs[1]]
    gap = np.sqrt((apart**2).sum(axis=1)).max(initial=0.0)
    if gap <= tolerance:
        return Interface(node, zone, donor, pairs)
    why = (
        f"its nodes lie up to {gap:.3g} from the nodes of {zones[donor].node.name}, more than "
        f"{tolerance:.3g} ({JOINED:g} of the extent)"
    )
    return Interface(node, zone, donor, None, why=why)


def _period(node: Node) -> Numbers:
    holder = node.child("GridConnectivityProperty_t")
    periodic = None if holder is None else holder.child("Periodic_t")
    if periodic is None:
        return ()
    numbers: list[float] = []
    for name in ("RotationCenter", "RotationAngle", "Translation"):
        array = periodic.needed("DataArray_t", name)
        values = array.value()
        if values.dtype.kind != "f":
            raise array.fault(f"is of type {values.dtype}; it must be R4 or R8: export it again")
        numbers += values.ravel().astype(float).tolist()
    moves = numbers[len(numbers) // 3 :]
    return tuple(numbers) if any(moves) else ()


def _blocks_meet(zone: CgnsZone, donor: CgnsZone, node: Node) -> tuple[IntArray, IntArray]:
    """Return the nodes (m,), (m,) of two structured zones that an interface declares the same.

    SIDS, "1-to-1 Interface Connectivity": index2 = T (index1 - begin1) + begin2, where column
    j of T has only one entry: the sign of Transform[j], in row abs(Transform[j]).
    """
    if zone.sides is not None or donor.sides is not None:
        raise node.fault("is for structured zones only; export it as GridConnectivity_t")
    dim = zone.dim
    inside = node.needed("IndexRange_t", "PointRange").integers(2, dim)
    outside = node.needed("IndexRange_t", "PointRangeDonor").integers(2, dim)
    transform = node.child('"int[IndexDimension]"', "Transform")
    turn = np.arange(1, dim + 1) if transform is None else transform.integers(dim)
    if sorted(np.abs(turn).tolist()) != list(range(1, dim + 1)):
        raise node.fault(
            f"its Transform is {turn.tolist()}, but must have 1 to {dim} once, each with a sign; "
            "export the mesh again"
        )
    matrix = np.zeros((dim, dim), np.int64)
    matrix[np.abs(turn) - 1, np.arange(dim)] = np.sign(turn)
    end = matrix @ (inside[1] - inside[0]) + outside[0]
    if (end != outside[1]).any():
        raise node.fault(
            f"its PointRangeDonor ends at {tuple(outside[1].tolist())}, but by its Transform at "
            f"{tuple(end.tolist())}; export the mesh again"
        )
    low, high = np.sort(inside, axis=0)
    zone.nodes_at(node, np.stack((low, high)))
    here = grid_nodes([np.arange(a - 1, b) for a, b in zip(low, high, strict=True)], zone.shape)
    # The same nodes by their indices: the range, moved into the donor.
    indices = np.stack(np.unravel_index(here, zone.shape, order="F"), axis=1) + 1
    there = donor.nodes_at(node, (indices - inside[0]) @ matrix.T + outside[0])
    return here, there


def _lists_meet(zone: CgnsZone, donor: CgnsZone, node: Node) -> tuple[IntArray, IntArray]:
    """Return the nodes (m,), (m,) of two zones that an interface's lists declare the same.

    Lists are of vertices, or of faces, whose nodes are then paired by distance.
    """
    other = node.needed("IndexArray_t", "PointListDonor")
    where = node.word("GridLocation_t", "Vertex", "GridLocation")
    if where != "Vertex":
        return _nearest(
            zone, facets_of(zone, node), donor, faces_by_number(donor, other, other.integers(-1))
        )
    here = _vertices(zone, node)
    there = donor.nodes_at(other, other.integers(-1, len(donor.shape)))
    if len(here) != len(there):
        raise other.fault(
            f"has {len(there)} vertices for {len(here)} of {zone.node.name}; an interface of type "
            f"{_ONE_TO_ONE} has as many: export the mesh again"
        )
    return here, there


def _vertices(zone: CgnsZone, node: Node) -> IntArray:
    """Return the vertices (m,) of an interface in its zone, in the order of its list or range."""
    point_list = node.child("IndexArray_t", "PointList")
    if point_list is not None:
        return zone.nodes_at(point_list, point_list.integers(-1, len(zone.shape)))
    area = node.needed("IndexRange_t", "PointRange")
    low, high = np.sort(area.integers(2, len(zone.shape)), axis=0)
    zone.nodes_at(area, np.stack((low, high)))
    return grid_nodes([np.arange(a - 1, b) for a, b in zip(low, high, strict=True)], zone.shape)


def _nearest(
    zone: CgnsZone, faces: Cells, donor: CgnsZone, others: Cells
) -> tuple[IntArray, IntArray]:
    """Return nodes (m,) of faces, and the nearest node (m,) of the donor's faces ``others``."""
    here = faces.nodes
    there = others.nodes
    closest = KDTree(donor.points[there]).query(zone.points[here])[1]
    return here, there[closest]


@record
class CgnsForm(Origin):
    """Where the coordinates of a mesh are in the CGNS file it was read from."""

    ending = ".cgns"
    datasets: tuple[Texts, ...]
    """For each zone the paths of the datasets of its coordinates."""
    numbers: tuple[IntArray, ...]
    """tuple of (n_z,) int64: for each zone the index of each of its vertices among the points of
    the mesh."""
    points: FloatArray  # (n, d): the points as read


def read_cgns(path: Path) -> Mesh:
    """Return the mesh of a CGNS file based on HDF5: all zones of its base.

    Boundaries are the families of boundary conditions, named by the condition where it has no
    family; for a zone without conditions, its sections of boundary elements; if there are none of
    these at all, the outer surface divided at its edges. Open interfaces are boundaries with their
    names, those of the same period together. Raises MeshError if it cannot be read, or has what
    slideviz cannot use: the node, the rule and the remedy.
    """
    with cgns_file(path) as root:
        require_own_folder(path)
        base = _base(root)
        dim, physical = base.integers(2).tolist()
        if dim not in (2, 3) or not dim <= physical <= 3:
            raise base.fault(
                f"has cells of dimension {dim} and {physical} coordinates; expected 2 or 3, and "
                "as many coordinates or more: export the volume mesh"
            )
        zones = [read_zone(node, dim, physical) for node in base.children("Zone_t")]
        joined = join(zones)
        return _mesh(path, base, zones, joined)


def _base(root: Node) -> Node:
    bases = root.children("CGNSBase_t")
    full = [base for base in bases if base.children("Zone_t")]
    if len(full) == 1:
        return full[0]
    if full:
        raise path_error(
            root.file,
            f"has {len(full)} bases ({', '.join(base.name for base in full)}), each a mesh of its "
            "own; export one base to a file",
        )
    raise path_error(
        root.file, "has no zones (CGNSBase_t, Zone_t in it), so there is no mesh; export it again"
    )


def _mesh(path: Path, base: Node, zones: Sequence[CgnsZone], joined: Joined) -> Mesh:
    """Return the mesh of joined zones, with its boundaries; raise MeshError if it is unusable."""
    cells = _renumbered([zone.cells for zone in zones], joined.numbers)
    dim = zones[0].dim
    points = (
        joined.points if joined.points.shape[1] == dim else flattened(path, joined.points, cells)
    )
    form = CgnsForm(
        tuple(zone.datasets[:dim] for zone in zones), joined.numbers, frozen_array(points, float)
    )
    mesh = Mesh(form.points, cells, name=printable(path.name), source=path.resolve(), origin=form)
    check_mesh(mesh)
    markers, remarks = _markers(mesh, base, zones, joined)
    form = replace(form, roles=_periodic(zones, joined, markers), extras=_extras(base, len(zones)))
    mesh = replace(mesh, markers=markers, remarks=remarks, origin=form)
    check_mesh(mesh)
    return mesh


def _renumbered(parts: Sequence[Cells], numbers: Sequence[IntArray]) -> Cells:
    """Return the cells of all zones together, with the node ``numbers`` of `Joined`."""
    each = zip(parts, numbers, strict=True)
    return Cells.joined([Cells.from_types(c.types, n[c.connectivity]) for c, n in each])


def _markers(
    mesh: Mesh, base: Node, zones: Sequence[CgnsZone], joined: Joined
) -> tuple[tuple[Marker, ...], Texts]:
    """Return the boundaries, and remarks (sentences) on those that are empty or not joined."""
    groups: dict[str, list[Cells]] = {}
    remarks: list[str] = []
    inner: Cells | None = None
    for zone, number in zip(zones, joined.numbers, strict=True):
        given = list(conditions(zone))
        for node, facets in _of_conditions(zone, given):
            if not len(facets):
                remarks.append(f"{node.path} covers no face of its zone and is left out.")
                continue
            family = node.word("FamilyName_t", "", "FamilyName").removeprefix(f"{base.path}/")
            groups.setdefault(family or node.name, []).append(_renumbered([facets], [number]))
        if given or zone.sides is None:
            continue
        inner = outer_facets(mesh) if inner is None else inner
        for index, section in enumerate(zone.sections):
            facets = _renumbered([zone.sides.where(zone.sides.section == index).cells], [number])
            facets = facets.take(among(facets, inner))
            if len(facets):
                groups.setdefault(section.name, []).append(facets)
    _add_open(groups, remarks, zones, joined)
    if len(zones) > 1 and joined.parts.max() > 0:
        parts = [
            " and ".join(zones[k].node.name for k in np.flatnonzero(joined.parts == part).tolist())
            for part in range(joined.parts.max() + 1)
        ]
        remarks.append(
            f"The zones are not all joined: {'; '.join(parts)}. Where they touch, nothing keeps "
            "them together; export the mesh with its one-to-one interfaces if they should be."
        )
    if not groups:
        return smooth_parts(mesh, outer_facets(mesh)), tuple(remarks)
    markers = [Marker(name, Cells.joined(parts)) for name, parts in groups.items()]
    return tuple(markers), tuple(remarks)


def _of_conditions(zone: CgnsZone, nodes: Sequence[Node]) -> list[tuple[Node, Cells]]:
    """Return the facets of each boundary condition of a zone.

    A facet of several conditions that are given by vertices goes to the one with fewest.
    """
    regions = {node: region_of(zone, node) for node in nodes}
    by_nodes = {node: at for node, at in regions.items() if not isinstance(at, Cells)}
    sets = in_node_sets(len(zone.points), zone.outer, by_nodes) if by_nodes else {}
    return [
        (node, at if isinstance(at, Cells) else Cells.from_blocks(sets[node]))
        for node, at in regions.items()
    ]


def _add_open(
    groups: dict[str, list[Cells]], remarks: list[str], zones: Sequence[CgnsZone], joined: Joined
) -> None:
    """Add the facets of open interfaces that are in no group yet, and remarks on these."""
    known = Cells.joined([part for parts in groups.values() for part in parts])
    names: dict[object, str] = {}
    taken = list(groups)
    for one in joined.open:
        facets = _renumbered([facets_of(zones[one.zone], one.node)], [joined.numbers[one.zone]])
        facets = facets.take(~among(facets, known))
        key = one.period or (one.node.name,)
        if len(facets):
            names.setdefault(key, free_name(one.node.name, [*taken, *names.values()]))
            groups.setdefault(names[key], []).append(facets)
        if one.why:
            where = f" {names[key]!r}" if len(facets) else ", as the file has it"
            remarks.append(
                f"{one.node.path} is not joined: {one.why}. Its faces are a boundary{where}."
            )


def _extras(base: Node, zones: int) -> str:
    """Return in words what a file has that no mesh keeps; "" for nothing."""
    labels = set[str]()
    base.group.visititems(lambda name, thing: labels.add(Node(base.file, thing, name).label))
    others = sorted(labels - {"", *LABELS.split()})
    what = [f"{zones} zones"] if zones > 1 else []
    return f"other contents of the CGNS file ({', '.join(what + others)})" if what + others else ""


def _periodic(
    zones: Sequence[CgnsZone], joined: Joined, markers: Sequence[Marker]
) -> dict[str, Role]:
    """Return the role of the boundaries whose faces are of periodic interfaces, of both sides."""
    periods = {one.period for one in joined.open}
    facets = [Cells.joined([])]
    for one in joined.open:
        third = len(one.period) // 3
        back = *one.period[:third], *(-move for move in one.period[third:])
        if one.period and back in periods:
            faces = facets_of(zones[one.zone], one.node)
            facets.append(_renumbered([faces], [joined.numbers[one.zone]]))
    every = Cells.joined(facets)
    return {
        one.name: "periodic" for one in markers if len(one.cells) and among(one.cells, every).all()
    }


def among(facets: Cells, others: Cells) -> NDArray[np.bool_]:
    """Return a mask (m,) of the facets that have the same nodes as any of the others."""
    tables = []
    for cells in (facets, others):
        table = np.zeros((len(cells), 4), np.int64)
        for ids, nodes in cells.by_type.values():
            table[ids, : nodes.shape[1]] = np.sort(nodes, axis=1) + 1
        tables.append(table)
    groups = row_groups(np.concatenate(tables))
    return np.isin(groups[: len(facets)], groups[len(facets) :])


def write_cgns(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as a new file, or if it was read from CGNS as a copy of that with its points.

    In a copy, coordinates that did not change keep the bits of the file; others are rounded to the
    file's type, R4 or R8. Raises MeshError if that file was changed, or the new one cannot be
    written.
    """
    form = mesh.origin
    source = mesh.source
    if not (isinstance(form, CgnsForm) and source and len(mesh.points) == len(form.points)):
        with hdf5_write(path, options.replaces) as draft:
            write_tree(draft.tree, mesh)
        return
    try:
        with hdf5_write(path, options.replaces, source) as draft:
            _replace(path, source, draft.tree, form, mesh.points)
    except OSError as problem:
        raise path_error(
            path,
            f"cannot be written: {printable(source)}, of which it is a copy, cannot be read: "
            f"{problem.strerror or problem}; put that file back, or write .su2",
        ) from problem


def _replace(path: Path, source: Path, tree: h5py.File, form: CgnsForm, points: FloatArray) -> None:
    """Write ``points`` (n, d) into the copy of the file, whose root is ``tree``.

    Raises MeshError if the coordinates there are not those that were read, or if the new ones are
    too large for their type. ``path`` is the new file, ``source`` the one it is a copy of.
    """
    tolerance = JOINED * float(np.ptp(form.points, axis=0).max())
    for names, numbers in zip(form.datasets, form.numbers, strict=True):
        for axis, name in enumerate(names):
            dataset = tree.get(name)
            before = form.points[numbers, axis]
            after = points[numbers, axis]
            if not isinstance(dataset, h5py.Dataset) or dataset.size != len(numbers):
                raise _changed(path, source, name)
            values = np.asarray(dataset[()])
            if not (np.abs(values.ravel() - before) <= tolerance).all():
                raise _changed(path, source, name)
            with np.errstate(over="ignore"):
                rounded = after.astype(values.dtype)
            if not np.isfinite(rounded).all():
                raise path_error(
                    path,
                    f"cannot be written: a coordinate is larger than {values.dtype} holds, the "
                    f"type of {printable(name)}; write .su2, or scale the mesh",
                )
            moved = before != after
            dataset[...] = np.where(moved, rounded, values.ravel()).reshape(values.shape)


def _changed(path: Path, source: Path, name: str) -> Exception:
    return path_error(
        path,
        f"cannot be written: {printable(source)}, of which it is a copy, was changed after the "
        f"mesh was read ({printable(name)}); read that file again",
    )
