"""Motions of markers: from the motions of a case to the displacement of every moving node.

Sums are made in a fixed order, so that the same case gives the same bits on every machine.
Displacements are added up rather than positions: the difference of two large positions would have
lost the last digits of a small displacement.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from slideviz.case import model
from slideviz.case.boxes import ffd_displacements
from slideviz.case.check import marker_problems, motion_problems, raise_all
from slideviz.case.displacement import Displacements, read_displacements
from slideviz.case.model import Case, Motion, applies_to, named
from slideviz.case.motion_text import term_of
from slideviz.case.onto import laid_displacements
from slideviz.case.spans import span_displacements
from slideviz.case.zones import each_zone, of_several_zones, zone_motion
from slideviz.errors import CaseError
from slideviz.mesh.axis_frame import ordered_sum
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.check import LARGEST, within
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_coordinate
from slideviz.mesh.topology import vertex_normals
from slideviz.mesh.zones import names_in

EPS = 1e-16  # what SU2 adds to coordinates of `surface_bump`
LEVEL = 1e-12
"""A node is on neither side where y is less than this part of its normal: that is rounding."""


def hicks_henne(x: FloatArray, peak: float) -> FloatArray:
    """Return ``sin³(π x^e)`` (m,), which is 1 at ``peak``; 0 where x is below 0."""
    x = np.maximum(x, 0.0)
    exponent = math.log10(0.5) / math.log10(peak)
    return np.where(x > 1e-15, np.sin(np.pi * x**exponent) ** 3, 0.0)


def kulfan(x: FloatArray, k: float, n: float) -> FloatArray:
    """Return Bernstein polynomial k of n (from 1), times the class function ``√x (1 - x)``: (m,).

    Where x is below 0, it counts as 0.
    """
    i, degree = (value - 1 for value in term_of(k, n))
    x = np.maximum(x, 0.0)
    shape = math.comb(degree, i) * x**i * (1.0 - x) ** (degree - i)
    return np.sqrt(x) * (1.0 - x) * shape


def surface_bump(x: FloatArray, start: float, end: float, peak: float) -> FloatArray:
    """Return a Hicks-Henne bump (m,) between two x, 1 at ``peak``; 0 elsewhere."""
    length = end - start
    if not start < peak < end:
        raise CaseError(
            f"the peak is at x = {peak:g}; it must lie between {start:g} and {end:g}, where the "
            "bump begins and ends"
        )
    exponent = math.log10(0.5) / math.log10((peak - start + EPS) / length)
    along = x - start
    inside = (along > 0.0) & (along < length)
    t = np.where(inside, along + EPS, 0.0) / length
    return np.where(inside, np.sin(np.pi * t**exponent) ** 3, 0.0)


def normals_at(mesh: Mesh, markers: Iterable[str], nodes: IntArray) -> FloatArray:
    """Return normals (m, d) into the mesh at nodes (m,) of some markers; zero at others.

    A node of several of the markers has the normal of the last one in the mesh, as in SU2.
    """
    out = np.zeros((len(nodes), mesh.dim))
    boundary = boundary_of(mesh)
    for index, name in enumerate(boundary.names):
        if name in markers:
            at, normals = vertex_normals(mesh.points, boundary.facets[boundary.marker == index])
            place = np.searchsorted(nodes, at)
            out[place] = -normals
    return out


def bump_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements of the nodes ``on`` moving markers, by airfoil motion.

    Raises CaseError if a motion with a height moves no node: none is on its side, along its chord.
    """
    displacements: dict[object, Displacements] = {}
    problems = []
    for place, motion in enumerate(case.motions, start=1):
        markers = [
            name for name in on if isinstance(motion, model.OnAirfoil) and applies_to(motion, name)
        ]
        if not markers or not isinstance(motion, model.OnAirfoil):
            continue
        nodes = np.unique(np.concatenate([on[name] for name in markers]))
        shape = _shape(motion, mesh, markers, nodes)
        vectors = np.zeros((len(nodes), mesh.dim))
        vectors[:, 1] = motion.height * shape
        displacements[motion] = Displacements(nodes, vectors)
        if not shape.any():
            of = " or ".join(repr(name) for name in named(motion.marker)) or "a moving marker"
            side = "" if not hasattr(motion, "side") else f" on its {motion.side} side"
            low, high = motion.chord
            problems.append(
                f"motion {place}: no node of {of} is{side} between x = {low:g} and {high:g}; "
                "give x of the leading and of the trailing edge"
            )
    if problems:
        raise CaseError("\n".join(problems))
    return displacements


def _shape(motion: model.OnAirfoil, mesh: Mesh, markers: list[str], nodes: IntArray) -> FloatArray:
    """Return the displacement (m,) of nodes along y by a height of 1."""
    low, high = motion.chord
    t = (mesh.points[nodes, 0] - low) / (high - low)
    along = (t > 0.0) & (t < 1.0)
    if isinstance(motion, model.Cst):
        shape = np.where(along, kulfan(np.where(along, t, 0.0), *motion.term), 0.0)
    else:
        shape = np.where(along, hicks_henne(np.where(along, t, 0.0), motion.peak), 0.0)
    if not isinstance(motion, model.HicksHenne | model.Cst):
        return shape
    sign = side_of(normals_at(mesh, markers, nodes))
    there = sign > 0.0 if motion.side == "upper" else sign < 0.0
    outwards = sign if isinstance(motion, model.HicksHenne) else 1.0
    return np.where(there, outwards * shape, 0.0)


def side_of(normals: FloatArray) -> FloatArray:
    """Return 1 for an airfoil's upper side, -1 for the lower, 0 if level; normals (m, d): (m,)."""
    upwards = normals[:, 1]
    level = np.abs(upwards) <= LEVEL * np.linalg.norm(normals, axis=1)
    return np.where(level, 0.0, np.sign(upwards))


ReferenceDisplacements = Mapping[object, Displacements]
"""Displacements by the key (`key_of`) of their motion."""


def key_of(motion: model.FromFile | model.PlacedMotion) -> object:
    """Return the key of a motion; those with the same displacements share it."""
    return (motion.path, motion.marker) if type(motion) is model.FromFile else motion


def placed_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements by motions that depend on undeformed places, by their motion.

    ``on`` has the nodes (k,) of each moving marker. Raises CaseError where such a motion moves no
    node.
    """
    if mesh.zone_parts:
        return _of_zones(case, mesh, on)
    return (
        ffd_displacements(case, mesh, on)
        | bump_displacements(case, mesh, on)
        | span_displacements(case, mesh, on)
    )


def _of_zones(case: Case, mesh: Mesh, on: Mapping[str, IntArray]) -> dict[object, Displacements]:
    """Return what `placed_displacements` of each zone are together, by the motion of the case."""
    parts: dict[object, list[Displacements]] = {}
    for part, (one, zone) in zip(mesh.zone_parts, each_zone(case, mesh), strict=True):
        names, start = names_in(mesh, part), part.points.start
        mine = {names[name]: nodes - start for name, nodes in on.items() if name in names}
        placed = placed_displacements(one, zone, mine)
        for motion in dict.fromkeys(case.motions):
            if isinstance(motion, model.PlacedMotion):
                here = placed.get(zone_motion(case, motion, part, names, one))
                if here is not None:
                    moved = replace(here, nodes=here.nodes + start)
                    parts.setdefault(motion, []).append(moved)
    return {
        motion: Displacements(
            np.concatenate([one.nodes for one in several]),
            np.concatenate([one.vectors for one in several]),
            tuple(dict.fromkeys(text for one in several for text in one.warnings)),
        )
        for motion, several in parts.items()
    }


def reference_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements by files and placed motions of a case, by `key_of` their motion.

    ``on`` has the nodes (k,) of each moving marker. Raises CaseError if a file cannot be read or
    has mistakes, or a box has none of the nodes that it should move; the message has all of these.
    """
    files: dict[object, Displacements] = {}
    problems: list[str] = []
    try:
        files |= placed_displacements(case, mesh, on)
    except CaseError as problem:
        problems.append(str(problem))
    for motion in case.motions:
        moved = [nodes for name, nodes in on.items() if applies_to(motion, name)]
        if isinstance(motion, model.Onto) and moved:
            try:
                files[key_of(motion)] = laid_displacements(motion, case, mesh, on)
            except CaseError as problem:
                problems.append(str(problem))
        elif isinstance(motion, model.FromFile) and (moved or not motion.marker):
            nodes = np.unique(np.concatenate([*moved, np.empty(0, np.int64)]))
            names = " or ".join(repr(name) for name in named(motion.marker))
            of = f"marker {names}" if names else "a moving marker"
            try:
                read = read_displacements(motion.path, mesh, nodes, of)
            except CaseError as problem:
                problems.append(str(problem))
            else:
                files[key_of(motion)] = read
    if problems:
        raise CaseError("\n".join(dict.fromkeys(problems)))
    return files


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
    names = case.markers_with("moving")
    on = {name: mesh.marker(name).nodes for name in names}
    files = reference_displacements(case, mesh, on)
    vectors = list(moved_together(case.motions, mesh.points, on, files).values())
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
        raise CaseError("\n".join(_disagreements(mesh, names, nodes[rows], pairs)))
    keep = np.flatnonzero(first == np.arange(len(nodes)))
    warnings = [text for file in files.values() for text in file.warnings]
    return Displacements(nodes[keep], stacked[keep], tuple(dict.fromkeys(warnings)))


def _require_size(mesh: Mesh, nodes: IntArray, vectors: FloatArray) -> None:
    """Raise CaseError where a coordinate would become larger than can be computed with."""
    there = mesh.points[nodes] + vectors
    if not within(there, LARGEST) and within(mesh.points, LARGEST):
        k = int(np.argmax(~(np.abs(there) <= LARGEST).all(axis=1)))
        where = ", ".join(f"{value:.6g}" for value in there[k])
        raise CaseError(
            f"{mesh.name}: the motion takes node {nodes[k]} to ({where}); nothing can be computed "
            f"with coordinates larger than {LARGEST:g}, so move it less"
        )


def moved_together(
    motions: Iterable[Motion],
    points: FloatArray,
    on: Mapping[str, IntArray],
    files: ReferenceDisplacements,
) -> dict[str, FloatArray]:
    """Return the displacement (k, d) of the nodes of each marker after all motions, in sequence.

    Markers that one motion moves are moved as one body: about their common centroid. ``points`` (n,
    d) float64: undeformed positions of all nodes. ``on``: the nodes of each moving marker.
    ``files``: the displacements of files and of `PlacedMotion`, by `key_of` their motion; a motion
    that is not among them displaces nothing.
    """
    return _together(motions, points, on, files)[1]


def _together(
    motions: Iterable[Motion],
    points: FloatArray,
    on: Mapping[str, IntArray],
    files: ReferenceDisplacements,
) -> tuple[list[Motion], dict[str, FloatArray]]:
    """Return the motions as one body each (`_as_one`), and the displacements by them."""
    total, each = {name: np.zeros_like(points[nodes]) for name, nodes in on.items()}, []
    for motion in motions:
        here = {name: points[on[name]] + total[name] for name in on if applies_to(motion, name)}
        each.append(motion if len(here) < 2 else _as_one(motion, here, on))
        for name, at in here.items():
            total[name] += _change(each[-1], at, on[name], files)
    return each, total


def by_zone(case: Case, mesh: Mesh) -> Case:
    """Return a case each of whose motions is of every zone alone, for `zone_cases`.

    A common centroid becomes a point, a file what it displaces. Raises CaseError as
    `displacements`.
    """
    shared = [motion for motion in case.motions if of_several_zones(motion, case, mesh)]
    if not shared:
        return case
    on = {name: mesh.marker(name).nodes for name in case.markers_with("moving")}
    files = reference_displacements(case, mesh, on)
    motions, _ = _together(case.motions, mesh.points, on, files)
    warnings = case.warnings
    for place, motion in enumerate(motions):
        if motion in shared and isinstance(motion, model.FromFile):
            listed = files[key_of(motion)]
            motions[place] = model.Prescribed(listed.nodes, listed.vectors, motion.marker)
            warnings = *warnings, *listed.warnings
    return case.change(motions=tuple(motions), warnings=tuple(dict.fromkeys(warnings)))


def _as_one(motion: Motion, points: Mapping[str, FloatArray], on: Mapping[str, IntArray]) -> Motion:
    """Return a motion about a centroid with the common centroid of its markers; others unchanged.

    ``points`` (k, d) are where the nodes ``on`` (k,) of each marker are before the motion.
    """
    if not isinstance(motion, model.Rotate | model.Scale) or motion.point != "centroid":
        return motion
    # Common nodes of two markers count once; sums in the order of nodes, not in that of markers.
    _, first = np.unique(np.concatenate([on[name] for name in points]), return_index=True)
    centre = np.concatenate(list(points.values()))[first].mean(axis=0)
    return replace(motion, point=tuple(centre.tolist()))


def same(vectors: FloatArray, mesh: Mesh) -> float:
    """Return the length by which displacements of one node may differ, given all (k, d)."""
    largest = float(np.linalg.norm(vectors, axis=1).max(initial=0.0))
    rounding = ROUNDING * largest_coordinate(mesh.points)
    return min(AGREE * mesh.extent, ALIKE * largest) + rounding


def displacement_of(motions: Iterable[Motion], points: FloatArray) -> FloatArray:
    """Return the displacement (k, d) of the points of one marker by its motions, in sequence.

    Files, and motions that depend on undeformed places, displace nothing here.
    """
    total, nodes = np.zeros_like(points), np.arange(len(points))
    for motion in motions:
        total += _change(motion, points + total, nodes, {})
    return total


def _change(
    motion: Motion, points: FloatArray, nodes: IntArray, files: ReferenceDisplacements
) -> FloatArray:
    """Return the displacement (k, d) by one motion of the nodes of a marker, now at ``points``."""
    if isinstance(motion, model.Prescribed):
        out = np.zeros_like(points)
        _, here, given = np.intersect1d(nodes, motion.nodes, return_indices=True)
        out[here] = motion.vectors[given]
        return out
    if not isinstance(motion, model.FromFile | model.PlacedMotion):
        return _increment(motion, points)
    found = files.get(key_of(motion))
    return np.zeros_like(points) if found is None else found.at(nodes)


def _increment(
    motion: model.Translate | model.Rotate | model.Scale | model.Radial, points: FloatArray
) -> FloatArray:
    if isinstance(motion, model.Translate):
        return np.broadcast_to(np.array(motion.vector, np.float64), points.shape)
    if isinstance(motion, model.Radial):
        return _pushed(motion, points)
    at_centroid = motion.point == "centroid"
    centre = ordered_sum(points) / max(1, len(points)) if at_centroid else np.array(motion.point)
    arm = points - centre
    if isinstance(motion, model.Scale):
        return arm * (np.array(motion.factors, np.float64) - 1.0)
    return _turned(arm, math.radians(motion.angle_deg), motion.axis)


def _turned(arm: FloatArray, angle: float, axis: tuple[float, float, float]) -> FloatArray:
    """Return the change of vectors (k, d) by a rotation, ``angle`` in radians (Rodrigues).

    ``sin(a) k x v + (1 - cos(a)) k x (k x v)``, with ``1 - cos(a) = 2 sin(a/2)^2``, which keeps
    all digits of a small angle; exactly zero for a zero angle.
    """
    sine, versine = math.sin(angle), 2.0 * math.sin(0.5 * angle) ** 2
    length = math.hypot(*axis)
    a, b, c = (value / length for value in axis)
    if arm.shape[1] == 2:
        x, y = arm.T
        return np.stack([-sine * c * y - versine * x, sine * c * x - versine * y], axis=1)
    x, y, z = arm.T
    across = (b * z - c * y, c * x - a * z, a * y - b * x)
    u, v, w = across
    twice = (b * w - c * v, c * u - a * w, a * v - b * u)
    return np.stack([sine * p + versine * q for p, q in zip(across, twice, strict=True)], axis=1)


def _pushed(motion: model.Radial, points: FloatArray) -> FloatArray:
    arm = points - np.array(motion.point, np.float64)
    if arm.shape[1] == 3:
        unit = np.array(motion.axis, np.float64) / math.hypot(*motion.axis)
        # Component by component: the same bits whatever the number of points.
        along = arm[:, 0] * unit[0] + arm[:, 1] * unit[1] + arm[:, 2] * unit[2]
        arm = arm - along[:, None] * unit
    radius = np.sqrt((arm * arm).sum(axis=1))
    # On the axis there is no direction to be pushed into.
    outwards = np.divide(motion.distance, radius, out=np.zeros_like(radius), where=radius > 0)
    return arm * ((motion.factor - 1.0) + outwards)[:, None]


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
