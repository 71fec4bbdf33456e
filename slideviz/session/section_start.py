"""Sections to start from, and the one number of each that a slider moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.surfaces import padded
from slideviz.sections.model import Section, Triple
from slideviz.session.state import Session

_LAYER = 1e-4
"""Part of the span of a mesh within which nodes are on one layer."""
_NEAR = 0.03
"""Where no layer is, a round number may be so far from the middle, as a part of the span."""


def cell_points(mesh: Mesh) -> FloatArray:
    """Return the nodes of the cells, (u, 3): what a section can reach."""
    return padded(mesh.points[mesh.cells.nodes])


def first_plane(session: Session) -> Section:
    """Return a plane about through the middle of what is shown, across its longest extent."""
    points = _shown_points(session)
    low, high = points.min(axis=0), points.max(axis=0)
    axis = int(np.argmax(high - low))
    origin = (low + high) / 2.0
    origin[axis] = round_middle(points[:, axis])
    whole = session.mesh is not None and session.mesh.dim == 2
    return Section("plane", _triple(origin), _triple(np.eye(3)[axis]), whole=whole)


def first_cylinder(session: Session, pair: Pair | None) -> Section:
    """Return a cylinder about the axis of the machine, about halfway between the radii shown.

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
    local = section.frame(_shown_points(session))
    return replace(section, radius=round_middle(np.hypot(local[:, 0], local[:, 1])) or 1.0)


def round_middle(values: FloatArray) -> float:
    """Return a round number about in the middle of values (n,), well between layers of nodes.

    On a layer rounding decides which cells are cut: those on one side, on the other, or both.
    """
    low, high = float(values.min()), float(values.max())
    middle, span = (low + high) / 2.0, high - low
    if not span > 0:
        return middle
    below, above = _layers_around(values, middle)
    # Cells are cut in their middle half: those that the middle is in, or beyond a layer there.
    room = (above - below) / 4.0
    first, last = below + room, above - room
    near = max(middle - _NEAR * span, first), min(middle + _NEAR * span, last)
    if near[0] <= near[1] and middle - below > _LAYER * span:
        first, last = near
    return _roundest(first, last, min(max(middle, first), last))


def _layers_around(values: FloatArray, middle: float) -> tuple[float, float]:
    """Return the layers of nodes that are next to a number; that above, where it is on one."""
    low, high = float(values.min()), float(values.max())
    near = _LAYER * (high - low)
    # Scattered nodes are that near to each other by chance, but only so many of them.
    chance = 2.0 * _LAYER * len(values)
    least = chance + 6.0 * np.sqrt(chance) + 6.0
    rising = np.sort(values)
    count = np.searchsorted(rising, rising + near, "right") - np.searchsorted(
        rising, rising - near, "left"
    )
    layers = np.concatenate([[low], rising[count > least], [high]])
    return (
        float(layers[layers <= middle + near].max()),
        float(layers[layers > middle + near].min()),
    )


def _roundest(first: float, last: float, wanted: float) -> float:
    """Return the number of fewest digits from ``first`` to ``last``; of several, the nearest."""
    digits = -int(np.floor(np.log10(max(abs(first), abs(last), 1e-300)))) - 1
    while True:
        unit = 10.0**-digits
        low, high = np.ceil(first / unit), np.floor(last / unit)
        if low <= high or digits > 300:
            return round(float(np.clip(np.round(wanted / unit), low, high)) * unit, digits) + 0.0
        digits += 1


def _shown_points(session: Session) -> FloatArray:
    """Return the nodes (u, 3) of the cells at the step that is shown."""
    shown = session.mesh if session.frame is None else session.frame.mesh
    assert shown is not None
    return cell_points(shown)


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
    return at_position(new, round_middle(_reached(new, points)))


def _reached(section: Section, points: FloatArray) -> FloatArray:
    """Return the positions (n,) of points (n, 3), as `position` counts them."""
    local = section.frame(points)
    if section.kind == "cylinder":
        return np.asarray(np.hypot(local[:, 0], local[:, 1]))
    return np.asarray(local[:, 2] + position(section))


def _unit(section: Section) -> FloatArray:
    return section.basis[2]


def _triple(values: FloatArray) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
