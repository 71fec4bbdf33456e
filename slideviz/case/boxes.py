"""The FFD boxes that a case can use (of its mesh, or its own), and the displacements they give."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.displacement import Displacements, mean_of
from slideviz.case.model import BoxMotion, Case, Ffd, FfdThickness, FfdTwist, applies_to, named
from slideviz.errors import CaseError, Note, SlidevizError, nearest
from slideviz.ffd.box import (
    CARTESIAN,
    Box,
    CoordinateSystem,
    Embedding,
    Index,
    plane_corners,
    polar_corners,
    regular_box,
)
from slideviz.ffd.deformation import parametric
from slideviz.ffd.kinds import Turn
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.model import FloatArray, IntArray, Mesh

OFF = 1e-6
"""Largest distance between a node and the point that the mesh file's parametric coordinates give
for it, over the size of the box, that gets no warning."""

_EMBEDDED: WeakKeyDictionary[Mesh, dict[tuple[Box, str], tuple[Embedding, float]]] = (
    WeakKeyDictionary()
)
_DEFINED: WeakKeyDictionary[Mesh, dict[object, dict[str, Box]]] = WeakKeyDictionary()


def boxes_for(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the boxes of mesh and case by name; of two with one name that of the mesh."""
    boxes = boxes_of(mesh, system_of(case))
    return {**defined_boxes(case, mesh), **{box.name: box for box in boxes}}


def system_of(case: Case) -> CoordinateSystem:
    """Return the coordinate system of the boxes of a case."""
    plain = case.ffd_system == "CARTESIAN"  # which has no axis
    return CARTESIAN if plain else CoordinateSystem(case.ffd_system, case.ffd_axis)


def box_definition(case: Case) -> tuple[object, ...]:
    """Return the values of a case that its boxes depend on."""
    shape = case.ffd_boxes, case.ffd_degrees, case.ffd_blending, case.ffd_orders
    return *shape, case.ffd_system, case.ffd_axis


def defined_boxes(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the undeformed boxes of FFD_DEFINITION by name; CaseError if values make no box."""
    key = box_definition(case)
    cache = _DEFINED.setdefault(mesh, {})
    if key not in cache:
        cache[key] = {
            name: _defined(case, mesh.dim, name, corners, degrees)
            for (name, corners), degrees in zip(case.ffd_boxes, case.ffd_degrees, strict=False)
        }
    return cache[key]


def _defined(
    case: Case, dim: int, name: str, numbers: tuple[float, ...], degrees: tuple[int, int, int]
) -> Box:
    corners, system = np.array(numbers).reshape(8, 3), system_of(case)
    i, j, k = (*degrees[:dim], 1)[:3]
    first, second, third = (*case.ffd_orders[:dim], 2)[:3]
    if dim == 2 and system.kind == "POLAR":  # j goes about the axis
        corners = polar_corners(corners[:4, :2])
        j, k, second, third = k, j, third, second
    elif dim == 2:
        corners = plane_corners(corners[:4, :2])
    orders = (first, second, third) if case.ffd_blending == "BSPLINE_UNIFORM" else None
    try:
        return regular_box(name, corners, (i, j, k), orders, system)
    except CaseError as problem:
        raise CaseError(f"FFD_DEFINITION: box {name!r}: {problem}") from problem


def box_motions(case: Case) -> tuple[BoxMotion, ...]:
    """Return the motions of a case that move control points of boxes."""
    return tuple(motion for motion in case.motions if isinstance(motion, BoxMotion))


def ffd_problems(case: Case, mesh: Mesh, motion: BoxMotion) -> tuple[str, ...]:
    """Return why a motion of a box is impossible with a mesh, a sentence for each reason."""
    try:
        boxes = boxes_for(case, mesh)
    except SlidevizError as problem:
        return (str(problem),)
    if motion.box not in boxes:
        none = "none is in it, or in FFD_DEFINITION"
        return (missing_box(mesh, motion.box, boxes, none),)
    box = boxes[motion.box]
    unknown = box.problem(_lattice_index(motion, mesh.dim))
    problems = [unknown] if unknown else []
    name, across = ("dz", 2) if box.system.kind == "CARTESIAN" else ("dθ", 1)
    if isinstance(motion, Ffd) and mesh.dim == 2 and (shift := motion.vector[across]):
        problems.append(f"{name} is {shift:g}, which leaves the plane; in 2D write 0")
    if isinstance(motion, FfdTwist) and mesh.dim == 2:
        problems.append("a box in 2D has no span to twist along; write rotate")
    if isinstance(motion, FfdTwist) and case.ffd_system != "CARTESIAN":
        problems.append(
            f"ffd-twist turns control points in x, y and z, and FFD_COORD_SYSTEM is "
            f"{case.ffd_system}; move them along θ with ffd"
        )
    if not isinstance(motion, Ffd | FfdTwist) and mesh.dim == 2 and case.ffd_system != "CARTESIAN":
        problems.append(f"in 2D it needs FFD_COORD_SYSTEM= CARTESIAN, which is {case.ffd_system}")
    return tuple(problems)


def _lattice_index(motion: BoxMotion, dim: int) -> Index:
    """Return the index (i, j, k) of the control points that a motion moves; -1 means all."""
    if isinstance(motion, Ffd):
        return motion.index
    if isinstance(motion, FfdTwist):
        return -1, motion.plane, -1
    i, j = motion.index
    return i, (j if dim == 3 else -1), -1


def _change_of(motion: BoxMotion, box: Box, q: FloatArray, dim: int) -> FloatArray:
    """Return the change (I, J, K, 3) of control points, now at ``q``, by a motion."""
    index = _lattice_index(motion, dim)
    if isinstance(motion, Ffd):
        return box.change(index, motion.vector)
    if isinstance(motion, FfdTwist):
        chosen = box.change(index, (1.0, 1.0, 1.0))[..., 0] > 0.0
        point = (*motion.point, 0.0)[:3]
        turn = Turn(chosen, np.array(point), np.array(motion.axis), math.pi / 180.0)
        return turn.change(q, motion.angle_deg)
    across = 2 if dim == 3 else 1
    change = box.change(index, tuple(float(axis == across) * motion.amount for axis in range(3)))
    if isinstance(motion, FfdThickness):  # from the lowest layer to the highest one
        sides = np.linspace(-1.0, 1.0, box.points.shape[across])
        change *= np.expand_dims(sides, [axis for axis in range(4) if axis != across])
    return change


def box_changes(
    case: Case, mesh: Mesh, boxes: Mapping[str, Box]
) -> dict[str, list[tuple[int, FloatArray, FloatArray]]]:
    """Return how motions change control points, for each box that some move, in their order.

    Place of the motion, the control points (I, J, K, 3) before it, in the box's coordinates, and
    their change by it. Motions that do not fit their box change nothing.
    """
    changes: dict[str, list[tuple[int, FloatArray, FloatArray]]] = {}
    for place, motion in enumerate(case.motions):
        if not isinstance(motion, BoxMotion) or motion.box not in boxes:
            continue
        box = boxes[motion.box]
        if box.problem(_lattice_index(motion, mesh.dim)):
            continue
        mine = changes.setdefault(motion.box, [])
        q = mine[-1][1] + mine[-1][2] if mine else box.q
        mine.append((place, q, _change_of(motion, box, q, mesh.dim)))
    return changes


def missing_box(mesh: Mesh, name: str, boxes: Iterable[str], none: str) -> str:
    """Return the message that there is no box of a name, with those there are.

    ``boxes``: the names of the boxes there are. ``none``: the end of the message where there are
    none.
    """
    zone = mesh.origin.ffd_elsewhere.get(name)
    if zone is not None:
        return (
            f"{mesh.name}: the FFD box {name!r} is in zone {zone}, and this is zone {mesh.zone}; "
            f"choose that zone (ZONE= {zone} in a case, or --zone {zone}), or a box of this one"
        )
    known = ", ".join(boxes)
    why = nearest(name, boxes) or f"; {f'it has {known}' if known else none}"
    return f"{mesh.name} has no FFD box {name!r}{why}"


def embedding(box: Box, mesh: Mesh, marker: str) -> tuple[Embedding, float]:
    """Return the nodes of a marker in a box, embedded there, and how far off they are at most.

    Their parametric coordinates are read from the mesh file, where it has some for this marker;
    else they are computed. How far off: the distance of a node from the point of its parametric
    coordinates, over the size of the box. Both are found once for each mesh.
    """
    cache = _EMBEDDED.setdefault(mesh, {})
    if (box, marker) not in cache:
        on = mesh.marker(marker).nodes
        if marker in box.embedded:
            nodes, uvw = box.embedded[marker]
            inside = np.isin(nodes, on)
        else:
            nodes = on
            uvw, inside = parametric(box, mesh.points[on])
        embedded = box.embed(nodes[inside], uvw[inside])
        size = np.ptp(box.points.reshape(-1, 3), axis=0)[: mesh.dim]
        there = box.system.points_of(embedded.sums(box.q))[:, : mesh.dim]
        gap = np.abs(there - mesh.points[embedded.nodes]) / size
        cache[box, marker] = embedded, float(gap.max(initial=0.0))
    return cache[box, marker]


def off_points(box: Box, mesh: Mesh, marker: str) -> list[str]:
    """Return a warning where the nodes of a marker in a box are off (`embedding`); else []."""
    _, off = embedding(box, mesh, marker)
    sentence = (
        f"{mesh.name}: the surface points of the FFD box {box.name!r} on {marker} are not those of "
        f"the mesh, by up to {off:.1g} of the box; if the mesh was moved without it, define the "
        f"box again; if it is in other coordinates, set FFD_COORD_SYSTEM"
    )
    return [sentence] if off > OFF else []


def ffd_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements of the nodes ``on`` moving markers, by motion of a box.

    Equal motions have one entry, with the mean of their displacements. Raises CaseError if none of
    the nodes that a motion should move is in its box; a line for each such motion.
    """
    motions = box_motions(case)
    boxes = boxes_for(case, mesh) if motions else {}
    displacements: dict[object, list[Displacements]] = {}
    problems = {}
    alone = len(motions) == len(case.motions) and not any(box.level for box in boxes.values())
    for name, changes in box_changes(case, mesh, boxes).items():
        for place, q, change in changes:
            motion = case.motions[place]
            mine = {name: nodes for name, nodes in on.items() if applies_to(motion, name)}
            moved = _moved(boxes[name], mesh, q, change, mine)
            if moved is not None:
                if not alone and any(b.name == name for b in boxes_of(mesh, system_of(case))):
                    stays = Note(_STAYS.format(repr(name)))
                    moved = replace(moved, warnings=(*moved.warnings, stays))
                displacements.setdefault(motion, []).append(moved)
            elif mine:
                of = " or ".join(repr(one) for one in named(motion.marker)) or "a moving marker"
                problems[place] = (
                    f"motion {place + 1}: no node of {of} is in the FFD box {name!r}; move the "
                    "box, or take another boundary"
                )
    if problems:
        raise CaseError("\n".join(problems[place] for place in sorted(problems)))
    return {motion: mean_of(several) for motion, several in displacements.items()}


_STAYS = (
    "the FFD box {} in the deformed mesh stays where it was, because boxes are nested or other "
    "motions move boundaries, too; define it again to use it with that mesh"
)


def _moved(
    box: Box, mesh: Mesh, q: FloatArray, change: FloatArray, on: Mapping[str, IntArray]
) -> Displacements | None:
    """Return the displacements that a change of control points gives all nodes of some markers.

    None where no node is in the box. ``q`` (I, J, K, 3) are the control points before, ``on`` has
    the nodes (k,) of each marker.
    """
    nodes = np.unique(np.concatenate([*on.values(), np.empty(0, np.int64)]))
    vectors = np.zeros((len(nodes), mesh.dim))
    warnings, any_inside = [], False
    for name in on:
        inside, _ = embedding(box, mesh, name)
        any_inside |= bool(len(inside.nodes))
        shift = inside.sums(change)
        if box.system.kind != "CARTESIAN":
            before = inside.sums(q)
            shift = box.system.points_of(before + shift) - box.system.points_of(before)
        vectors[np.searchsorted(nodes, inside.nodes)] = shift[:, : mesh.dim]
        warnings += off_points(box, mesh, name)
    return Displacements(nodes, vectors, tuple(warnings)) if any_inside else None


def moved_boxes(case: Case, mesh: Mesh, part: float = 1.0) -> Mesh:
    """Return the mesh with its boxes deformed by the motions of the case times ``part``, 0 to 1.

    Where the case has motions of other kinds too, or boxes are nested, they are left as they are:
    no control points could follow these.
    """
    motions = box_motions(case)
    if not motions or len(motions) < len(case.motions):
        return mesh
    boxes = {box.name: box for box in boxes_of(mesh, system_of(case))}
    if any(box.level for box in boxes.values()):
        return mesh
    moved = []
    for name, changes in box_changes(case, mesh, boxes).items():
        total = np.sum([change for _, _, change in changes], axis=0)
        moved.append(boxes[name].moved(part * total))
    return with_boxes(mesh, moved) if moved else mesh
