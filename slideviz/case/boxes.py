"""The FFD boxes that a case can use (of its mesh, or its own), and the displacements they give."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, Ffd, moves, named
from slideviz.case.words import nearest
from slideviz.errors import CaseError, Note, SlidevizError
from slideviz.ffd.box import Box, Embedding, plane_corners, regular_box
from slideviz.ffd.inverse import parametric
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.model import IntArray, Mesh

OFF = 1e-6
"""Largest distance between a node and the point that the mesh file's parametric coordinates give
for it, over the size of the box, that gets no warning."""

_EMBEDDED: WeakKeyDictionary[Mesh, dict[tuple[Box, str], tuple[Embedding, float]]] = (
    WeakKeyDictionary()
)
_DEFINED: WeakKeyDictionary[Mesh, dict[object, dict[str, Box]]] = WeakKeyDictionary()


def boxes_for(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the boxes of the mesh and of the case, by name; of two with one name the mesh's.

    Raises
    ------
    SlidevizError
        The boxes in the mesh file or in FFD_DEFINITION have mistakes.
    """
    return {**defined_boxes(case, mesh), **{box.name: box for box in boxes_of(mesh)}}


def defined_boxes(case: Case, mesh: Mesh) -> dict[str, Box]:
    """Return the boxes that FFD_DEFINITION of the case defines, undeformed, by name.

    They are found once for each mesh.

    Raises
    ------
    CaseError
        The corners, degrees or orders of a box make none.
    """
    key = case.ffd_boxes, case.ffd_degrees, case.ffd_blending, case.ffd_orders
    kept = _DEFINED.setdefault(mesh, {})
    if key not in kept:
        kept[key] = {
            name: _defined(case, mesh.dim, name, corners, degrees)
            for (name, corners), degrees in zip(case.ffd_boxes, case.ffd_degrees, strict=False)
        }
    return kept[key]


def _defined(
    case: Case, dim: int, name: str, numbers: tuple[float, ...], degrees: tuple[int, int, int]
) -> Box:
    corners = np.array(numbers).reshape(8, 3)
    corners = plane_corners(corners[:4, :2]) if dim == 2 else corners
    i, j, k = (*degrees[:dim], 1)[:3]
    first, second, third = (*case.ffd_orders[:dim], 2)[:3]
    orders = (first, second, third) if case.ffd_blending == "BSPLINE_UNIFORM" else None
    try:
        return regular_box(name, corners, (i, j, k), orders)
    except CaseError as problem:
        raise CaseError(f"FFD_DEFINITION: box {name!r}: {problem}") from problem


def ffd_problems(case: Case, mesh: Mesh, motion: Ffd) -> tuple[str, ...]:
    """Return why a motion of a box is impossible with a mesh, a sentence for each reason."""
    try:
        boxes = boxes_for(case, mesh)
    except SlidevizError as problem:
        return (str(problem),)
    if motion.box not in boxes:
        none = "none is in it, or in FFD_DEFINITION"
        return (missing_box(mesh, motion.box, boxes, none),)
    unknown = boxes[motion.box].problem(motion.index)
    found = [unknown] if unknown else []
    if mesh.dim == 2 and motion.vector[2]:
        found.append(f"dz is {motion.vector[2]:g}, which leaves the plane; in 2D write 0")
    return tuple(found)


def missing_box(mesh: Mesh, name: str, boxes: Iterable[str], none: str) -> str:
    """Return the message that there is no box of a name, with those there are.

    Parameters
    ----------
    boxes
        The names of the boxes there are.
    none : str
        The end of the message where there are none.
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
    kept = _EMBEDDED.setdefault(mesh, {})
    if (box, marker) not in kept:
        on = mesh.marker(marker).nodes
        if marker in box.embedded:
            nodes, uvw = box.embedded[marker]
            inside = np.isin(nodes, on)
        else:
            nodes = on
            uvw, inside = parametric(box, mesh.points[on])
        found = box.embed(nodes[inside], uvw[inside])
        size = np.ptp(box.points.reshape(-1, 3), axis=0)[: mesh.dim]
        gap = np.abs(found.sums(box.points)[:, : mesh.dim] - mesh.points[found.nodes]) / size
        kept[box, marker] = found, float(gap.max(initial=0.0))
    return kept[box, marker]


def off_points(box: Box, mesh: Mesh, marker: str) -> list[str]:
    """Return a warning where the nodes of a marker in a box are off (`embedding`); else []."""
    _, off = embedding(box, mesh, marker)
    said = (
        f"{mesh.name}: the surface points of the FFD box {box.name!r} on {marker} are not those of "
        f"the mesh, by up to {off:.1g} of the box; was the mesh moved without it? Then define the "
        "box anew"
    )
    return [said] if off > OFF else []


def ffd_displacements(case: Case, mesh: Mesh, names: Iterable[str]) -> dict[object, Displacements]:
    """Return the displacements of the nodes of the moving markers ``names``, by motion of a box.

    Raises
    ------
    CaseError
        None of the nodes that a motion should move is in its box; a line for each such motion.
    """
    motions = [motion for motion in case.motions if isinstance(motion, Ffd)]
    boxes = boxes_for(case, mesh) if motions else {}
    on = {name: mesh.marker(name).nodes for name in names}
    found: dict[object, Displacements] = {}
    problems = []
    for place, motion in enumerate(case.motions, start=1):
        if not isinstance(motion, Ffd) or motion.box not in boxes:
            continue
        mine = {name: nodes for name, nodes in on.items() if moves(motion, name)}
        moved = _moved(boxes[motion.box], mesh, motion, mine)
        if moved is not None and len(motions) < len(case.motions) and _is_in(motion.box, mesh):
            stays = Note(
                f"the FFD box {motion.box!r} in the deformed mesh stays where it was, since other "
                "motions move boundaries, too; define it anew to use it with that mesh"
            )
            moved = replace(moved, warnings=(*moved.warnings, stays))
        if moved is None and mine:
            of = " or ".join(repr(name) for name in named(motion.marker)) or "a moving marker"
            problems.append(
                f"motion {place}: no node of {of} is in the FFD box {motion.box!r}; move the box, "
                "or take another boundary"
            )
        elif moved is not None:
            found[motion] = moved
    if problems:
        raise CaseError("\n".join(problems))
    return found


def _is_in(name: str, mesh: Mesh) -> bool:
    return any(box.name == name for box in boxes_of(mesh))


def _moved(box: Box, mesh: Mesh, motion: Ffd, on: Mapping[str, IntArray]) -> Displacements | None:
    """Return the displacements that a motion of a box gives all nodes of some markers.

    None where no node is in the box. ``on`` has the nodes (k,) of each marker.
    """
    nodes = np.unique(np.concatenate([*on.values(), np.empty(0, np.int64)]))
    vectors = np.zeros((len(nodes), mesh.dim))
    change = box.change(motion.index, motion.vector)
    warnings, any_inside = [], False
    for name in on:
        inside, _ = embedding(box, mesh, name)
        any_inside |= bool(len(inside.nodes))
        vectors[np.searchsorted(nodes, inside.nodes)] = inside.sums(change)[:, : mesh.dim]
        warnings += off_points(box, mesh, name)
    return Displacements(nodes, vectors, tuple(warnings)) if any_inside else None


def moved_boxes(case: Case, mesh: Mesh, part: float = 1.0) -> Mesh:
    """Return the mesh with its boxes deformed by the motions of the case times ``part``, 0 to 1.

    Where the case has motions of other kinds too, the boxes are left as they are: no control
    points could follow these.
    """
    motions = [motion for motion in case.motions if isinstance(motion, Ffd)]
    if not motions or len(motions) < len(case.motions):
        return mesh
    moved = []
    for box in boxes_of(mesh):
        changes = [box.change(each.index, each.vector) for each in motions if each.box == box.name]
        moved += [box.moved(part * np.sum(changes, axis=0))] if changes else []
    return with_boxes(mesh, moved) if moved else mesh
