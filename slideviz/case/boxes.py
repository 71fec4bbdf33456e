"""The FFD boxes that a case can use: of its mesh, or its own; and the nodes in them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from slideviz.errors import CaseError, nearest
from slideviz.ffd.box import (
    CARTESIAN,
    Box,
    CoordinateSystem,
    Embedding,
    plane_corners,
    polar_corners,
    regular_box,
)
from slideviz.ffd.deformation import parametric
from slideviz.ffd.section import boxes_of
from slideviz.mesh.model import Mesh
from slideviz.system.weak_cache import WeakCache, weak_cache

if TYPE_CHECKING:
    from slideviz.case.model import Case

OFF = 1e-6
"""Largest distance between a node and the point that the mesh file's parametric coordinates give
for it, over the size of the box, that gets no warning."""

_DEFINED = WeakCache()


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

    def boxes() -> dict[str, Box]:
        return {
            name: _defined(case, mesh.dim, name, corners, degrees)
            for (name, corners), degrees in zip(case.ffd_boxes, case.ffd_degrees, strict=False)
        }

    return _DEFINED.of(mesh, box_definition(case), boxes)


def _defined(
    case: Case, dim: int, name: str, numbers: tuple[float, ...], degrees: tuple[int, int, int]
) -> Box:
    corners = np.array(numbers).reshape(8, 3)
    system = system_of(case)
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


@weak_cache
def embedding(mesh: Mesh, box: Box, marker: str) -> tuple[Embedding, float]:
    """Return the nodes of a marker in a box, embedded there, and how far off they are at most.

    Their parametric coordinates are read from the mesh file, where it has some for this marker;
    else they are computed. How far off: the distance of a node from the point of its parametric
    coordinates, over the size of the box. Both are found once for each mesh.
    """
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
    return embedded, float(gap.max(initial=0.0))


def off_points(box: Box, mesh: Mesh, marker: str) -> list[str]:
    """Return a warning where the nodes of a marker in a box are off (`embedding`); else []."""
    _, off = embedding(mesh, box, marker)
    sentence = (
        f"{mesh.name}: the surface points of the FFD box {box.name!r} on {marker} differ from the "
        f"mesh by up to {off:.1g} of the box; if the mesh was moved without it, define the box "
        "again; if it is in other coordinates, set FFD_COORD_SYSTEM"
    )
    return [sentence] if off > OFF else []
