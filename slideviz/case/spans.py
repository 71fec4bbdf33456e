"""The span of a case: hub and shroud or root and tip, and its axis or direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.errors import CaseError, nearest
from slideviz.machine.span import Span
from slideviz.machine.span_field import WHOLE, find_span
from slideviz.machine.straight_span import (
    are_parallel,
    find_straight_span,
    flat_normal,
    straight_direction,
)
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import TOLERANCE, Pair, pair_up
from slideviz.system.weak_cache import weak_cache
from slideviz.terms import Vector

if TYPE_CHECKING:
    from slideviz.case.model import Case

HUBS = ("hub",)
SHROUDS = ("shroud", "casing")
"""Words in the names of boundaries, by which SPAN= AUTO finds hub and shroud."""
WALLS_KEY = "SPAN= ( HUB, SHROUD )"
"""How a case names both."""


def span_ends(case: Case, mesh: Mesh, remedy: str = WALLS_KEY) -> tuple[str, str]:
    """Return the boundaries where the span is 0 and 1: of SPAN, by their names, or of a wing.

    ``remedy``: how the user names them, for the message.
    Raises CaseError if the mesh lacks one of SPAN, or names are ambiguous.
    """
    names = mesh.marker_names
    if case.span is not None:
        for name in case.span:
            if name not in names:
                hint = nearest(name, names) or f"; it has {', '.join(names)}"
                raise CaseError(f"SPAN: {mesh.name} has no marker {name!r}{hint}")
        return case.span
    ends = [
        [name for name in names if any(word in name.lower() for word in words)]
        for words in (HUBS, SHROUDS)
    ]
    if [len(end) for end in ends] == [1, 1]:
        return ends[0][0], ends[1][0]
    moving = tuple(name for name in case.markers_with("moving") if name in names)
    periodic = case.markers_with("periodic")
    wing = _ends_of_wing(mesh, moving, periodic, case.span_axis) if moving else None
    if wing is None:
        hubs = ", ".join(ends[0]) or "none"
        shrouds = ", ".join(ends[1]) or "none"
        raise CaseError(
            f"{mesh.name}: the names of boundaries do not say between which the span goes (hub: "
            f"{hubs}; shroud or casing: {shrouds}); name two, e.g. {remedy}, of "
            f"{', '.join(names)}"
            + ("" if moving else "; to find those of a wing, give a case in which it moves")
        )
    return wing


@weak_cache
def _ends_of_wing(
    mesh: Mesh, moving: tuple[str, ...], periodic: tuple[str, ...], direction: Vector | None
) -> tuple[str, str] | None:
    """Return root and tip of a wing, of boundaries ``moving``; None where none can be known.

    The root is a flat boundary that the wing meets; the tip another one parallel to it, or the
    boundary of the wing that reaches farthest. Where ``direction`` is given, both may be of the
    wing.
    """
    if mesh.dim != 3:
        return None
    points = mesh.points
    wing = mesh.nodes_of(moving)
    flat = dict[str, FloatArray]()
    for name in mesh.marker_names:
        if name in (*moving, *periodic) or not np.isin(mesh.marker(name).nodes, wing).any():
            continue
        normal = flat_normal(mesh, name)
        if normal is not None and (direction is None or are_parallel(normal, np.array(direction))):
            flat[name] = normal
    if not flat and direction is None:
        return None
    way = np.array(direction) if direction is not None else next(iter(flat.values()))
    if not all(are_parallel(normal, way) for normal in flat.values()):
        return None
    reach = {name: points[mesh.marker(name).nodes] @ way for name in flat or moving}
    low = min(reach, key=lambda name: float(reach[name].min()))
    high = max(reach, key=lambda name: float(reach[name].max()))
    at = float(reach[low].min())
    if flat and float(reach[high].max()) - at <= TOLERANCE * mesh.extent:
        away = {name: np.abs(points[mesh.marker(name).nodes] @ way - at) for name in moving}
        high = max(away, key=lambda name: float(away[name].max()))
    return low, high


def span_between(
    case: Case,
    mesh: Mesh,
    ends: tuple[str, str],
    pair: Pair | None,
    about: tuple[Vector, Vector] | None = None,
) -> Span:
    """Return the span between two boundaries, about an axis or along a direction.

    ``pair``: the period of the case. ``about``: the axis of the span and a point on it; None: that
    of the rotational period; without one that of PERIODIC_AXIS, PERIODIC_ORIGIN. The span is along
    SPAN_AXIS; AUTO is the normal of flat walls that do not turn about the axis. Raises MeshError
    where there is no span.
    """
    rotational = pair is not None and pair.kind == "rotational"
    if about is None:
        about = (pair.axis, pair.origin) if pair and rotational else (case.axis, case.origin)
    direction = case.span_axis
    if direction is None and not rotational:
        free = case.roles.get(ends[1]) == "moving"
        direction = straight_direction(mesh, *ends, free, *about)
    if direction is None and pair is not None and not rotational:
        raise CaseError(
            f"{mesh.name}: passages repeat by {pair.describe()}, but {ends[0]} and {ends[1]} are "
            "not flat, so they need an axis about which they turn: set PERIODIC_TYPE= rotational, "
            "or give the direction of the span by SPAN_AXIS"
        )
    if direction is None:
        return find_span(mesh, *ends, *about, WHOLE if pair is None else pair.period)
    pitch: Any = None if pair is None or rotational else tuple(pair.vector.tolist())
    return find_straight_span(mesh, *ends, direction, pitch)


def periodic_pairs(case: Case, mesh: Mesh) -> tuple[Pair, ...]:
    """Return the pairs that the periodic boundaries of a case form; MeshError if they do not."""
    names = case.markers_with("periodic")
    inside = without_halo(mesh)[0]
    return pair_up(inside, names, case.periodic_type, case.axis, case.origin) if names else ()


def span_field(case: Case, mesh: Mesh) -> Span:
    """Return the span between hub and shroud, or root and tip, of a mesh of one zone; cached.

    Raises CaseError or MeshError where there is none.
    """
    ends = span_ends(case, mesh)
    pairs = periodic_pairs(case, mesh) if mesh.dim == 3 else ()
    return span_between(case, mesh, ends, pairs[0] if pairs else None)
