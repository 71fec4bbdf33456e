"""Interfaces between the zones of a CGNS file, by which zones are joined to a single mesh.

Nodes that two zones share by a one-to-one interface are merged. Periodic interfaces and those
that are not one to one (mixing planes, overset grids) are left open: their faces are boundaries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from slideviz.formats.cgns.tree import Node
from slideviz.formats.cgns.zone import CgnsZone, faces_by_number, facets_of, grid_nodes
from slideviz.mesh.fans import components
from slideviz.mesh.model import Cells, FloatArray, IntArray

JOINED = 1e-6
"""Largest distance of merged nodes, as a fraction of the extent: R4 coordinates are rounded so."""
_ONE_TO_ONE = "Abutting1to1"  # value of GridConnectivityType for interfaces that are joined


@dataclass(frozen=True, eq=False)
class Interface:
    """An interface of a zone with another one, or with itself."""

    node: Node  # its place in the tree
    zone: int
    donor: int  # `zone`, `donor`: numbers of the zones
    pairs: tuple[IntArray, IntArray] | None
    """((m,), (m,)) or None: nodes of the zone and of the donor that are the same point; None if it
    is not to be joined."""
    period: tuple[float, ...] = ()
    """Centre and angles of the rotation, and translation; empty if it is not periodic."""
    why: str = ""  # reason why it cannot be joined, for a remark; empty if it can, or is periodic

    def gap(self, zones: Sequence[CgnsZone]) -> float:
        """Return the largest distance between the two nodes of a pair."""
        assert self.pairs is not None
        here, there = self.pairs
        apart = zones[self.zone].points[here] - zones[self.donor].points[there]
        return float(np.sqrt((apart**2).sum(axis=1)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
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
    first, number = _numbered(components(len(points), here, there))
    ends = np.array([(one.zone, one.donor) for one in closed], np.int64).reshape(-1, 2)
    parts = components(len(zones), ends[:, 0], ends[:, 1])
    numbers = tuple(number[a:b] for a, b in pairwise(begins))
    return Joined(points[first], numbers, tuple(left), parts)


def _numbered(labels: IntArray) -> tuple[IntArray, IntArray]:
    """Return the indices (k,) where each label occurs first, ascending, and new labels (n,).

    New labels count the labels (n,) in the order of their first occurrence.
    """
    found, first = np.unique(labels, return_index=True)
    order = np.argsort(first)
    number = np.empty(len(found), np.int64)
    number[order] = np.arange(len(found))
    return first[order], number[labels]


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
    interface = Interface(node, zone, donor, pairs)
    gap = interface.gap(zones)
    if gap <= tolerance:
        return interface
    why = (
        f"its nodes lie up to {gap:.3g} from the nodes of {zones[donor].node.name}, more than "
        f"{tolerance:.3g} ({JOINED:g} of the extent)"
    )
    return Interface(node, zone, donor, None, why=why)


def _period(node: Node) -> tuple[float, ...]:
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
