"""The span of a case: hub, shroud and axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slideviz.errors import CaseError, nearest
from slideviz.machine.span_field import WHOLE, SpanField, find_span
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import pair_up

if TYPE_CHECKING:
    from slideviz.case.model import Case

HUBS = ("hub",)
SHROUDS = ("shroud", "casing")
"""Words in the names of boundaries, by which SPAN= AUTO finds hub and shroud."""
WALLS_KEY = "SPAN= ( HUB, SHROUD )"
"""How a case names both."""


def span_ends(case: Case, mesh: Mesh, remedy: str = WALLS_KEY) -> tuple[str, str]:
    """Return the boundaries where the span is 0 and 1: those of SPAN, else by their names.

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
    if [len(end) for end in ends] != [1, 1]:
        hubs = ", ".join(ends[0]) or "none"
        shrouds = ", ".join(ends[1]) or "none"
        raise CaseError(
            f"{mesh.name}: the names of boundaries do not say between which the span goes (hub: "
            f"{hubs}; shroud or casing: {shrouds}); name two, e.g. {remedy}, of "
            f"{', '.join(names)}"
        )
    return ends[0][0], ends[1][0]


def span_field(case: Case, mesh: Mesh) -> SpanField:
    """Return the span between hub and shroud of a case, about its axis, of a mesh of one zone.

    The axis is that of the rotational period; without one that of PERIODIC_AXIS, PERIODIC_ORIGIN.
    Raises CaseError or MeshError where there is none.
    """
    sides = case.markers_with("periodic")
    hub, shroud = span_ends(case, mesh)
    axis = case.axis
    origin = case.origin
    period = WHOLE
    if sides and mesh.dim == 3:
        inside = without_halo(mesh)[0]
        pair = pair_up(inside, sides, case.periodic_type, case.axis, case.origin)[0]
        if pair.kind != "rotational":
            raise CaseError(
                f"{mesh.name} repeats by a translation ({pair.describe()}), so it has no axis "
                "for a span; move its boundaries in another way, e.g. by rotate or ffd-twist"
            )
        axis = pair.axis
        origin = pair.origin
        period = pair.period
    return find_span(mesh, hub, shroud, axis, origin, period)
