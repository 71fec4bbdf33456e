"""Motions of markers: from the motions of a case to the displacement of every moving node.

Sums are made in a fixed order, so that the same case gives the same bits on every machine.
Displacements are added up rather than positions: the difference of two large positions would have
lost the last digits of a small displacement.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from slideviz.case.check import marker_problems, motion_problems
from slideviz.case.displacement import Displacements, NodesOn, PlacedDisplacements
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.motions.kinds import FAMILIES
from slideviz.case.motions.motion import Motion, applies_to
from slideviz.case.zone_cases import each_zone, of_several_zones, zone_motion
from slideviz.errors import CaseError, Message, point_words, raise_all
from slideviz.mesh.check import LARGEST, within
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.mesh.zones import names_in


def placed_displacements(
    case: Case,
    mesh: Mesh,
    on: NodesOn,
    problems: list[Message],
    families: Iterable[type[Motion]] = FAMILIES,
) -> PlacedDisplacements:
    """Return the displacements from undeformed places, by the place of their motion in a case.

    ``on`` has the nodes (k,) of each moving marker. Sentences on files that cannot be read or have
    mistakes, boxes without nodes and the like are added to ``problems``.
    """
    found: PlacedDisplacements = {}
    for family in families:
        if isinstance(mesh, Assembly) and family.in_zones:
            found |= _of_zones(case, mesh, on, problems, family)
        else:
            found |= family.placed(case, mesh, on, problems)
    return found


def _of_zones(
    case: Case,
    mesh: Mesh,
    on: NodesOn,
    problems: list[Message],
    family: type[Motion],
) -> PlacedDisplacements:
    """Return what the displacements of each zone are together, by the place in the case."""
    parts: dict[int, list[Displacements]] = {}
    for part, (zone_case, zone) in zip(mesh.parts, each_zone(case, mesh), strict=True):
        names = names_in(mesh, part)
        start = part.points.start
        mine = {names[name]: nodes - start for name, nodes in on.items() if name in names}
        moved = family.placed(zone_case, zone, mine, problems)
        places = [
            place
            for place, motion in enumerate(case.motions)
            if zone_motion(case, motion, part, names, zone_case) is not None
        ]
        for place, here in moved.items():
            shifted = replace(here, nodes=here.nodes + start)
            parts.setdefault(places[place], []).append(shifted)
    return {
        place: Displacements(
            np.concatenate([moved.nodes for moved in several]),
            np.concatenate([moved.vectors for moved in several]),
            tuple(dict.fromkeys(text for moved in several for text in moved.warnings)),
        )
        for place, several in parts.items()
    }


def required_displacements(case: Case, mesh: Mesh, on: NodesOn) -> PlacedDisplacements:
    """Return what `placed_displacements` does; CaseError with all problems, if there are any."""
    problems = list[Message]()
    try:
        found = placed_displacements(case, mesh, on, problems)
    except CaseError as problem:
        problems += problem.messages
    raise_all(problems)
    return found


AGREE = 1e-9  # largest allowed difference of two displacements of one node, over the mesh's extent

ALIKE = 1e-6
"""Largest allowed difference of two displacements of one node, over the largest displacement. The
smaller of both holds (`same`)."""

ROUNDING = 1e-13
"""Rounding error that displacements may have, over the largest coordinate of the mesh."""


def displacements(case: Case, mesh: Mesh) -> Displacements:
    """Return the displacement of every node of the moving markers, sorted by node.

    A node on two moving markers has the displacement that the first of them gives it. Raises
    CaseError if a marker is unknown or has no motion, a motion does not fit the dimension of the
    mesh, a displacement file has mistakes, two markers displace one node differently, or a node
    goes too far to compute with.
    """
    # Motions of markers that do not move are ignored here; `check_case` reports them.
    raise_all((*marker_problems(case, mesh), *motion_problems(case, mesh)))
    return moving_nodes(case, mesh)


def moving_nodes(case: Case, mesh: Mesh) -> Displacements:
    """Return the `displacements` of a case that fits the mesh; only files are still read."""
    names = case.markers_with("moving")
    on = {name: mesh.marker(name).nodes for name in names}
    placed = required_displacements(case, mesh, on)
    vectors = list(moved_together(case.motions, mesh.points, on, placed).values())
    nodes = np.concatenate(list(on.values()))
    order = np.argsort(nodes, kind="stable")
    stacked = np.concatenate(vectors)[order]
    owner = np.repeat(np.arange(len(names)), [len(on[name]) for name in names])[order]
    nodes = nodes[order]
    _require_size(mesh, nodes, stacked)
    first = np.searchsorted(nodes, nodes)
    apart = np.abs(stacked - stacked[first]).max(axis=1, initial=0.0) > same(stacked, mesh)
    if apart.any():
        rows = np.flatnonzero(apart)
        pairs = np.stack([owner[first[rows]], owner[rows]], axis=1)
        raise_all(_disagreements(mesh, names, nodes[rows], pairs))
    keep = np.flatnonzero(first == np.arange(len(nodes)))
    warnings = [text for moved in placed.values() for text in moved.warnings]
    return Displacements(nodes[keep], stacked[keep], tuple(dict.fromkeys(warnings)))


def _require_size(mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> None:
    """Raise CaseError where a coordinate would become larger than can be computed with."""
    there = mesh.points[nodes] + vectors
    if not within(there, LARGEST) and within(mesh.points, LARGEST):
        k = int(np.argmax(~(np.abs(there) <= LARGEST).all(axis=1)))
        where = point_words(there[k])
        raise CaseError(
            f"{mesh.name}: the motion takes node {nodes[k]} to ({where}); nothing can be computed "
            f"with coordinates larger than {LARGEST:g}, so move it less"
        )


def moved_together(
    motions: Iterable[Motion],
    points: FloatArray,
    on: NodesOn,
    placed: PlacedDisplacements,
) -> dict[str, FloatArray]:
    """Return the displacement (k, d) of the nodes of each marker after all motions, in sequence.

    Markers that one motion moves are moved as one body: about their common centroid. ``points`` (n,
    d) float64: undeformed positions of all nodes. ``on``: the nodes of each moving marker.
    ``placed``: the displacements from undeformed places; a motion that is not among them, and is no
    formula of the place, displaces nothing.
    """
    return _together(motions, points, on, placed)[1]


def _together(
    motions: Iterable[Motion],
    points: FloatArray,
    on: NodesOn,
    placed: PlacedDisplacements,
) -> tuple[list[Motion], dict[str, FloatArray]]:
    """Return the motions as one body each (`Motion.as_one`), and the displacements by them."""
    total = {name: np.zeros_like(points[nodes]) for name, nodes in on.items()}
    joined: list[Motion] = []
    for place, motion in enumerate(motions):
        here = {name: points[on[name]] + total[name] for name in on if applies_to(motion, name)}
        if len(here) > 1 and motion.joins_zones:
            # Common nodes of two markers count once, and sums do not depend on the markers' order.
            nodes = np.concatenate([on[name] for name in here])
            once = np.unique(nodes, return_index=True)[1]
            joined.append(motion.as_one(np.concatenate(list(here.values()))[once]))
        else:
            joined.append(motion)
        for name, now in here.items():
            total[name] += joined[-1].change(now, on[name], placed.get(place))
    return joined, total


def by_zone(case: Case, mesh: Mesh) -> Case:
    """Split the motions that join several zones of a mesh into motions of each zone alone.

    A common centroid becomes a point, a file what it displaces. Raises CaseError as
    `displacements`.
    """
    shared = [of_several_zones(motion, case, mesh) for motion in case.motions]
    if not any(shared):
        return case
    on = {name: mesh.marker(name).nodes for name in case.markers_with("moving")}
    placed = required_displacements(case, mesh, on)
    motions, _ = _together(case.motions, mesh.points, on, placed)
    warnings = case.warnings
    for place, listed in placed.items():
        if shared[place]:
            marker = case.motions[place].marker
            motions[place] = Prescribed(listed.nodes, listed.vectors, marker)
            warnings = (*warnings, *listed.warnings)
    return case.change(motions=tuple(motions), warnings=tuple(dict.fromkeys(warnings)))


def same(vectors: FloatArray, mesh: Mesh) -> float:
    """Return the length by which displacements of one node may differ, given all (k, d)."""
    largest = float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
    rounding = ROUNDING * largest_coordinate(mesh.points)
    return min(AGREE * mesh.extent, ALIKE * largest) + rounding


def displacement_of(motions: Iterable[Motion], points: FloatArray) -> FloatArray:
    """Return the displacement (k, d) of the points of one marker by its motions, in sequence.

    Files, and motions that depend on undeformed places, displace nothing here.
    """
    total = np.zeros_like(points)
    nodes = np.arange(len(points))
    for motion in motions:
        total += motion.change(points + total, nodes, None)
    return total


def _disagreements(
    mesh: Mesh, names: tuple[str, ...], nodes: IntArray, pairs: IntArray
) -> list[str]:
    """Return a sentence for each pair of markers that displace common nodes differently.

    ``nodes`` (m,): nodes that two markers displace differently. ``pairs`` (m, 2): these two
    markers, as places in ``names``.
    """
    found, where = np.unique(pairs, axis=0, return_inverse=True)
    lines = []
    for place, (one, other) in enumerate(found):
        shared = nodes[where.ravel() == place]
        more = f" (and {len(shared) - 1} more)" if len(shared) > 1 else ""
        lines.append(
            f"node {mesh.number(int(shared[0]))}{more} is on the moving markers {names[one]!r} and "
            f"{names[other]!r}, which displace it differently; give both the same motion"
        )
    return lines
