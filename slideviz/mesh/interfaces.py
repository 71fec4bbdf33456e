"""Interfaces: boundaries of a zone that have nodes in the places of another zone's boundary."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from slideviz.mesh.model import (
    Assembly,
    FloatArray,
    IntArray,
    Mesh,
    ZoneInterface,
    frozen_array,
    row_norms,
)
from slideviz.mesh.nearest import nearest

COINCIDENT = 1e-6  # nodes of two zones nearer than this part of the mesh's extent are in one place
ROUNDING = 1e-12  # part of the mesh's extent by which nodes of an interface may move unseen


def points_of_nodes(
    blocks: Iterable[tuple[int, FloatArray]], nodes: Mapping[str, IntArray]
) -> dict[str, FloatArray]:
    """Return the points (k, d) of the ``nodes`` (k,) of boundaries, by name, all in one pass.

    ``blocks``: all points of a mesh in order: number of the first one, and points (m, d).
    """
    found: dict[str, list[FloatArray]] = {name: [] for name in nodes}
    for first, points in blocks:
        for name, some in nodes.items():
            here = slice(*np.searchsorted(some, [first, first + len(points)]))
            found[name].append(points[some[here] - first])
    return {name: np.concatenate(parts) for name, parts in found.items()}


def find_interfaces(
    mesh: Mesh, others: Iterable[tuple[int, str, FloatArray]]
) -> tuple[ZoneInterface, ...]:
    """Return the interfaces of a mesh with boundaries of other zones of its file.

    Boundaries are one interface where all nodes of any element are in the places of nodes of the
    other one. ``others``: zone, name and nodes (k, d) of each boundary of the other zones.
    """
    others = list(others)
    if not others:
        return ()
    found = []
    near = COINCIDENT * mesh.extent
    nodes_of = {marker.name: marker.nodes for marker in mesh.markers}
    for zone, name, points in others:
        low = points.min(axis=0) - near
        high = points.max(axis=0) + near
        for marker in mesh.markers:
            nodes = nodes_of[marker.name]
            places = mesh.points[nodes]
            if not ((places >= low) & (places <= high)).all(axis=1).any():
                continue
            distance, partner = nearest(points, places, near, near)
            there = np.isfinite(distance)
            shared = np.zeros(len(mesh.points), bool)
            shared[nodes] = there
            if any(shared[table].all(axis=1).any() for _, table in marker.cells.by_type.values()):
                here = frozen_array(nodes[there])
                other = frozen_array(partner[there])
                found.append(ZoneInterface(marker.name, zone, name, here, other))
    return tuple(found)


def named_interfaces(mesh: Mesh, names: Sequence[str]) -> tuple[ZoneInterface, ...]:
    """Return the interfaces of a mesh that are among pairs of ``names``; all without these."""
    pairs = {frozenset(pair) for pair in zip(names[::2], names[1::2], strict=True)}
    each = (one for one in mesh.interfaces if not pairs or {one.marker, one.other} in pairs)
    return tuple(each)


def disjoint_interfaces(mesh: Mesh, names: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence for each pair of ``names`` whose boundaries have no nodes in common."""
    sentences = []
    joined = {frozenset((one.marker, one.other)) for one in mesh.interfaces}
    for pair in zip(names[::2], names[1::2], strict=True):
        if frozenset(pair) not in joined:
            one = mesh.points[mesh.marker(pair[0]).nodes]
            other = mesh.points[mesh.marker(pair[1]).nodes]
            gap = nearest(other, one, np.inf, COINCIDENT * mesh.extent)[0].min(initial=np.inf)
            sentences.append(
                f"MARKER_ZONE_INTERFACE: {pair[0]} and {pair[1]} do not coincide (closest nodes "
                f"{gap:.3g} apart) and are treated as independent"
            )
    return tuple(sentences)


def torn_interfaces(mesh: Mesh, points: FloatArray, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Return a sentence for each interface whose nodes no longer coincide in ``points`` (n, d).

    In a mesh of one zone, those of the other zone stay. ``names``: as of `named_interfaces`.
    """
    sentences = dict[frozenset[object], str]()
    kept = named_interfaces(mesh, names)
    both = isinstance(mesh, Assembly)
    for each in mesh.interfaces:
        apart = points[each.nodes] - mesh.points[each.nodes]
        if both:
            apart -= points[each.partners] - mesh.points[each.partners]
        gap = row_norms(apart).max(initial=0.0)
        if gap > ROUNDING * mesh.extent:
            said = f"{each.marker}, which is an interface with its {each.other}, has moved by up to"
            remedy = "move both alike, or make one of them fixed, so that it follows the other"
            if not both:
                remedy = "keep it fixed, or deform all zones (without ZONE=)"
            elif each not in kept:
                remedy = "name both in MARKER_ZONE_INTERFACE, so that they stay together"
            # A mesh of all zones has each pair twice, once from either side.
            pair = frozenset((each.marker, each.other if both else each))
            text = f"zone {each.zone} no longer fits: {said} {gap:.3g}; {remedy}"
            sentences.setdefault(pair, text)
    return tuple(sentences.values())
