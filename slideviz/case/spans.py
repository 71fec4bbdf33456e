"""The span of a case: hub, shroud and axis; and the displacements by motions over it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.displacement import Displacements, mean_of
from slideviz.case.model import Case, SpanMotion, applies_to
from slideviz.errors import CaseError, MeshError, SlidevizError, nearest
from slideviz.machine.blade import TOTALS, BladeSections, change_of
from slideviz.machine.gap import bodies
from slideviz.machine.span import WHOLE, SpanField, find_span
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import pair_up

HUBS, SHROUDS = ("hub",), ("shroud", "casing")
"""Words in the names of boundaries, by which SPAN= AUTO finds hub and shroud."""
WALLS_KEY = "SPAN= ( HUB, SHROUD )"
"""How a case names both."""

_SECTIONS: WeakKeyDictionary[Mesh, dict[object, BladeSections]] = WeakKeyDictionary()


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
        hubs, shrouds = (", ".join(end) or "none" for end in ends)
        raise CaseError(
            f"{mesh.name}: the names of boundaries do not say between which the span goes (hub: "
            f"{hubs}; shroud or casing: {shrouds}); name two, as in {remedy}, of "
            f"{', '.join(names)}"
        )
    return ends[0][0], ends[1][0]


def span_field(case: Case, mesh: Mesh) -> SpanField:
    """Return the span between hub and shroud of a case, about its axis, of a mesh of one zone.

    The axis is that of the rotational period; without one that of PERIODIC_AXIS, PERIODIC_ORIGIN.
    Raises CaseError or MeshError where there is none.
    """
    sides, (hub, shroud) = case.markers_with("periodic"), span_ends(case, mesh)
    axis, origin, period = case.axis, case.origin, WHOLE
    if sides and mesh.dim == 3:
        inside = without_halo(mesh)[0]
        pair = pair_up(inside, sides, case.periodic_type, case.axis, case.origin)[0]
        if pair.kind != "rotational":
            raise CaseError(
                f"{mesh.name} repeats by a translation ({pair.describe()}), so it has no axis "
                "for a span; move its boundaries otherwise, as with rotate or ffd-twist"
            )
        axis, origin, period = pair.axis, pair.origin, pair.period
    return find_span(mesh, hub, shroud, axis, origin, period)


def span_problems(case: Case, mesh: Mesh) -> tuple[str, ...]:
    """Return why motions over the span are impossible with a 3D mesh, a sentence each."""
    try:
        span_field(case, mesh)
    except SlidevizError as problem:
        return (str(problem),)
    return ()


def moves_over_span(case: Case) -> bool:
    """Return whether a moving boundary has a motion over the span."""
    over = [motion for motion in case.motions if isinstance(motion, SpanMotion)]
    return any(applies_to(motion, name) for motion in over for name in case.markers_with("moving"))


@dataclass(frozen=True, eq=False)
class Blade:
    """Boundaries that motions over the span move, with all of these motions."""

    nodes: IntArray  # (n,): of the mesh, ascending
    sections: BladeSections  # of these nodes
    places: tuple[int, ...]  # of the motions in the case
    motions: tuple[SpanMotion, ...]
    reached: tuple[np.ndarray, ...]  # (n,) bool for each motion: the nodes that it moves

    def totals(self) -> tuple[FloatArray, list[tuple[int, FloatArray]]]:
        """Return totals (motions + 1, `TOTALS`, n): at first none, then after each motion.

        Also for each motion the row of the total that it changes, and the derivative (n, k) of that
        by its values.
        """
        totals, slopes = [np.zeros((TOTALS, len(self.nodes)))], list[tuple[int, FloatArray]]()
        for motion, reached in zip(self.motions, self.reached, strict=True):
            row, change, slope = change_of(
                motion.kind, motion.spans, motion.values, self.sections.spans
            )
            totals.append(totals[-1].copy())
            totals[-1][row] += np.where(reached, change, 0.0)
            slopes.append((row, slope * reached[:, None]))
        return np.array(totals), slopes


def blades_of(case: Case, mesh: Mesh, on: Mapping[str, IntArray]) -> list[Blade]:
    """Return the blades that motions over the span move; ``on``: nodes (k,) of moving markers.

    Motions that share a boundary move one blade. Raises CaseError where they have different
    stacking points, or the blade has no sections.
    """
    motions = {
        place: motion
        for place, motion in enumerate(case.motions)
        if isinstance(motion, SpanMotion) and any(applies_to(motion, name) for name in on)
    }
    groups: list[tuple[set[str], list[int]]] = []
    for place, motion in motions.items():
        names, places = {name for name in on if applies_to(motion, name)}, [place]
        for other in [group for group in groups if group[0] & names]:
            groups.remove(other)
            names, places = names | other[0], sorted(places + other[1])
        groups.append((names, places))
    return [_blade(case, mesh, on, sorted(names), places) for names, places in groups]


def _blade(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray], names: list[str], places: list[int]
) -> Blade:
    motions = [one for one in (case.motions[k] for k in places) if isinstance(one, SpanMotion)]
    point = motions[0].point
    points = zip(places, motions, strict=True)
    other = next((place for place, motion in points if motion.point != point), None)
    if other is not None:
        raise CaseError(
            f"motion {other + 1} has another stacking point than motion {places[0] + 1} of the "
            "same boundary; give both one, or none"
        )
    field = span_field(case, mesh)
    nodes = np.unique(np.concatenate([on[name] for name in names]))
    cache = _SECTIONS.setdefault(mesh, {})  # not by the field, which sections keep alive
    key = field, tuple(names), point
    if key not in cache:
        boundary = boundary_of(mesh)
        some = boundary.facets[np.isin(boundary.marker, [boundary.names.index(n) for n in names])]
        quads = some[some[:, 2] != some[:, 3]]
        triangles = np.searchsorted(nodes, np.concatenate([some[:, :3], quads[:, [0, 2, 3]]]))
        stack = None if point is None else np.array(point)
        try:
            turns = _turns(case, mesh, nodes[triangles])[nodes]
            cache[key] = BladeSections(field, mesh.points[nodes], triangles, stack, turns)
        except MeshError as problem:
            raise CaseError(f"motion {places[0] + 1}: {', '.join(names)}: {problem}") from problem
    reached = [
        np.isin(nodes, np.concatenate([on[name] for name in names if applies_to(motion, name)]))
        for motion in motions
    ]
    return Blade(nodes, cache[key], tuple(places), tuple(motions), tuple(reached))


def _turns(case: Case, mesh: Mesh, triangles: IntArray) -> FloatArray:
    """Return the angles (n,) of all nodes by which parts of a blade are turned to be together.

    ``triangles`` (t, 3): its facets, which periodic sides may cut.
    """
    out, sides = np.zeros(len(mesh.points)), case.markers_with("periodic")
    if sides:
        inside = without_halo(mesh)[0]
        pairs = pair_up(inside, sides, case.periodic_type, case.axis, case.origin)
        images = [pair.nodes if pair.angle > 0.0 else pair.nodes[:, ::-1] for pair in pairs]
        for body in bodies(triangles, np.unique(np.concatenate(images), axis=0)):
            out[triangles[body.facets]] = pairs[0].period * body.turns[:, None]
    return out


def prepare_span(case: Case, mesh: Mesh) -> None:
    """Compute and cache what motions over the span need of a mesh, if it has hub and shroud."""
    names = mesh.marker_names
    on = {name: mesh.marker(name).nodes for name in case.markers_with("moving") if name in names}
    motions = tuple(motion for motion in case.motions if isinstance(motion, SpanMotion))
    at_rest = SpanMotion("", "twist", (0.0,), (0.0,))
    with suppress(SlidevizError):
        span_field(case, mesh)
        blades_of(case.change(motions=motions or (at_rest,)), mesh, on)


def span_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements of the nodes ``on`` moving markers, by motion over the span.

    Equal motions have one entry, with the mean of their displacements. Raises CaseError where a
    motion is impossible.
    """
    changes: dict[object, list[Displacements]] = {}
    for blade in blades_of(case, mesh, on):
        totals, _ = blade.totals()
        before = blade.sections.moved(totals[0])[0]
        for place, motion, total in zip(blade.places, blade.motions, totals[1:], strict=True):
            try:
                after = blade.sections.moved(total)[0]
            except MeshError as problem:
                raise CaseError(f"motion {place + 1}: {problem}") from problem
            changes.setdefault(motion, []).append(Displacements(blade.nodes, after - before))
            before = after
    return {motion: mean_of(several) for motion, several in changes.items()}
