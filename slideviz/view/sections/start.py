"""Sections to start from, and the one number of each that a slider moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.view.drawing.surfaces import padded
from slideviz.view.sections.model import Section, Triple
from slideviz.view.session.state import Session

_LAYER = 1e-4
"""Part of the span of a mesh within which nodes are on one layer."""


def cell_points(mesh: Mesh) -> FloatArray:
    """Return the nodes of the cells, (u, 3): what a section can reach."""
    return padded(mesh.points[mesh.cells.nodes])


def first_plane(session: Session) -> Section:
    """Return a plane through the middle of the mesh, across its longest extent."""
    assert session.mesh is not None
    points = cell_points(session.mesh)
    low, high = points.min(axis=0), points.max(axis=0)
    normal = np.eye(3)[int(np.argmax(high - low))]
    return Section(
        "plane", _triple((low + high) / 2.0), _triple(normal), whole=session.mesh.dim == 2
    )


def first_cylinder(session: Session, pair: Pair | None) -> Section:
    """Return a cylinder about the axis of the machine, about halfway between the radii of the mesh.

    The axis is that of the period, where it is a rotation; otherwise that of the case. In 2D it
    is a circle, about the middle of what moves where no rotation has an axis in the mesh's plane.
    """
    mesh, case = session.mesh, session.case
    assert mesh is not None
    if pair is not None and pair.kind == "rotational":
        axis, origin = pair.axis, pair.origin
    elif mesh.dim == 2:
        axis, origin = (0.0, 0.0, 1.0), _triple(_middle_of_moving(session))
    else:
        axis, origin = case.axis, case.origin
    at, way = _triple(np.asarray(origin)), _triple(np.asarray(axis))
    section = Section("cylinder", at, way, 1.0, whole=mesh.dim == 2)
    local = section.frame(cell_points(mesh))
    return replace(section, radius=_beside_layer(np.hypot(local[:, 0], local[:, 1])) or 1.0)


def _beside_layer(radii: FloatArray) -> float:
    """Return the middle of radii (n,); where a layer of nodes lies there, the middle of cells.

    On a layer rounding decides which cells are cut: those on one side, on the other, or both.
    """
    low, high = float(radii.min()), float(radii.max())
    middle, near = (low + high) / 2.0, _LAYER * (high - low)
    # Scattered nodes are that near to it by chance, but only so many of them.
    if np.count_nonzero(np.abs(radii - middle) <= near) <= max(10 * _LAYER * len(radii), 3):
        return middle
    beyond = radii[radii > middle + near]
    return (middle + float(beyond.min())) / 2.0 if len(beyond) else middle


def _middle_of_moving(session: Session) -> FloatArray:
    """Return the middle (3,) of the box around all moving boundaries; of the mesh without them."""
    mesh = session.mesh
    assert mesh is not None
    names = [name for name in mesh.marker_names if session.role(name) == "moving"]
    nodes = [mesh.marker(name).nodes for name in names] or [mesh.cells.nodes]
    points = padded(mesh.points[np.concatenate(nodes)])
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0)


def position(section: Section) -> float:
    """Return what a slider shows: a plane's distance from 0 along its normal, or the radius."""
    if section.kind == "cylinder":
        return section.radius
    return float(np.asarray(section.origin) @ _unit(section))


def at_position(section: Section, value: float) -> Section:
    """Return the section moved along its normal, or with another radius.

    Raises
    ------
    CaseError
        The radius is not positive.
    """
    if section.kind == "cylinder":
        return replace(section, radius=float(value))
    shift = (value - position(section)) * _unit(section)
    return replace(section, origin=_triple(np.asarray(section.origin) + shift))


def span(section: Section, points: FloatArray) -> tuple[float, float]:
    """Return between which positions a section can cut cells with these nodes (n, 3)."""
    low, high = section.reach(points)
    if section.kind == "cylinder":
        return low, high
    # The reach is measured along the basis, whose normal has no other sign than the section's.
    return low + position(section), high + position(section)


def turned(section: Section, direction: Triple, points: FloatArray) -> Section:
    """Return the section with another normal or axis.

    A plane goes through the middle of these nodes (n, 3), unless it cuts them where it is; a
    cylinder keeps its radius where that still cuts, and gets the middle one otherwise.
    """
    new = replace(section, direction=direction)
    low, high = span(new, points)
    if low < position(new) < high:
        return new
    return at_position(new, (low + high) / 2.0)


def _unit(section: Section) -> FloatArray:
    return section.basis[2]


def _triple(values: FloatArray) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
