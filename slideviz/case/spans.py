"""The span of a case: its hub and shroud, its axis, and the field between them."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.model import Case
from slideviz.errors import CaseError, nearest
from slideviz.machine.span import SpanField, find_span
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import pair_up
from slideviz.mesh.zones import require_one_zone

HUBS, SHROUDS = ("hub",), ("shroud", "casing")
"""Words in the names of boundaries, by which SPAN= AUTO finds hub and shroud."""

_FIELDS: WeakKeyDictionary[Mesh, dict[object, SpanField]] = WeakKeyDictionary()


def span_ends(case: Case, mesh: Mesh) -> tuple[str, str]:
    """Return the boundaries where the span is 0 and 1: those of SPAN, else by their names.

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
        hubs, shrouds = (", ".join(end) or "none" for end in ends)
        raise CaseError(
            f"{mesh.name}: the names of boundaries do not say between which the span goes (hub: "
            f"{hubs}; shroud or casing: {shrouds}); name two, as in SPAN= ( HUB, SHROUD ), of "
            f"{', '.join(names)}"
        )
    return ends[0][0], ends[1][0]


def span_field(case: Case, mesh: Mesh) -> SpanField:
    """Return the span between hub and shroud of a case, about its axis; cached with the mesh.

    The axis is that of the rotational period; without one that of PERIODIC_AXIS, PERIODIC_ORIGIN.
    Raises CaseError or MeshError where there is none.
    """
    sides = case.markers_with("periodic")
    key = case.span, sides, case.periodic_type, case.axis, case.origin
    cache = _FIELDS.setdefault(mesh, {})
    if key not in cache:
        require_one_zone(mesh, "a span")
        hub, shroud = span_ends(case, mesh)
        axis, origin, period = case.axis, case.origin, 2.0 * np.pi
        if sides and mesh.dim == 3:
            inside = without_halo(mesh)[0]
            pair = pair_up(inside, sides, case.periodic_type, case.axis, case.origin)[0]
            if pair.kind != "rotational":
                raise CaseError(
                    f"{mesh.name} repeats by a translation ({pair.describe()}), so it has no axis "
                    "for a span; move its boundaries otherwise, as with rotate or ffd-twist"
                )
            axis, origin, period = pair.axis, pair.origin, pair.period
        cache[key] = find_span(mesh, hub, shroud, axis, origin, period)
    return cache[key]
