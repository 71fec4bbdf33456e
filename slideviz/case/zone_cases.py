"""Cases for meshes with several zones: the names of boundaries, and the case of each zone alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from slideviz.case.motions.motion import Motion, applies_to, named
from slideviz.case.words import first_of
from slideviz.errors import CaseError, note
from slideviz.mesh.model import Assembly, Mesh, ZonePart
from slideviz.mesh.zones import names_in, spellings, zones_of

if TYPE_CHECKING:
    from slideviz.case.model import Case


def with_marker_names(case: Case, mesh: Mesh) -> Case:
    """Return a case that has the names of the boundaries as the mesh has them.

    A case may name each with the number of its zone, as ``1:blade``; a mesh does so only where
    another zone has a boundary of that name. For a mesh of one zone among several, what the case
    has for boundaries with the numbers of others is left out, with a note.
    """
    return _with_own_roles(renamed(_of_zone(case, mesh), spellings(mesh)), mesh)


def _with_own_roles(case: Case, mesh: Mesh) -> Case:
    """Return a case with the roles that boundaries have by their file, if they have none in it.

    Then boundaries slide, and stay periodic, unless that is asked for otherwise.
    """
    roles = {name: role for name, role in mesh.roles.items() if name not in case.roles}
    if not roles:
        return case
    modes: dict[str, Any] = {}
    if "sliding" in roles.values() and case.sliding == "none" and not case.markers_with("sliding"):
        modes["sliding"] = "ps"
    if "periodic" in roles.values() and case.periodic == "none":
        modes["periodic"] = "moving"
    return case.change(roles={**case.roles, **roles}, **modes)


def _of_zone(case: Case, mesh: Mesh) -> Case:
    """Return a case without the boundaries that are named as ones of zones that a mesh lacks."""
    if mesh.zone is None or mesh.zones == 1:
        return case
    numbers = {str(number) for number in range(1, mesh.zones + 1)} - {str(mesh.zone)}
    moved = {name for motion in case.motions for name in named(motion.marker)}
    names = (moved | _names(case)) - {*mesh.marker_names}
    others = {name for name in names if ":" in name and name.partition(":")[0] in numbers}
    if not others:
        return case
    left = renamed(case, dict.fromkeys(others))
    idle = "periodic" in case.roles.values() and "periodic" not in left.roles.values()
    plural = "boundaries" if len(others) > 1 else "boundary"
    listed = f"{len(others)} {plural} of other zones left out ({first_of(sorted(others))})"
    return left.change(
        periodic="none" if idle else case.periodic,
        warnings=(*case.warnings, note(f"zone {mesh.zone} alone: {listed}")),
    )


def _names(case: Case) -> set[str]:
    """Return the names of boundaries in a case, except those of its motions."""
    limited = (limit.marker for limit in case.limits)
    return {*case.roles, *case.interfaces, *limited, *(case.span or ())}


def renamed(case: Case, names: Mapping[str, str | None]) -> Case:
    """Return a case with other names of boundaries: ``names`` by those that it has.

    What is for boundaries whose new name is None is left out; of interfaces and SPAN all.
    """

    def new(several: Iterable[str]) -> tuple[str, ...]:
        both = ((name, names.get(name, name)) for name in several)
        return tuple(after for _, after in both if after is not None)

    if not names.keys() & (_names(case) | {n for m in case.motions for n in named(m.marker)}):
        return case
    motions = []
    for motion in case.motions:
        kept = new(named(motion.marker))
        if kept or not motion.marker:
            motions.append(motion.with_marker(kept[0] if len(kept) == 1 else kept or ""))
    limits = ((limit, new([limit.marker])) for limit in case.limits)
    interfaces = new(case.interfaces)
    return case.change(
        span=_renamed_span(case, names),
        interfaces=interfaces if len(interfaces) == len(case.interfaces) else (),
        roles={name: role for old, role in case.roles.items() for name in new([old])},
        motions=tuple(motions),
        limits=tuple(replace(limit, marker=name) for limit, each in limits for name in each),
    )


def zone_cases(case: Case, mesh: Mesh, computed: bool = True) -> tuple[Case, ...]:
    """Return the case of each zone of a mesh: its roles and motions, named as in the file.

    Raises CaseError if a motion of several zones together (`of_several_zones`) is to be
    ``computed``: `slideviz.case.moving_nodes.by_zone` makes one for each zone. One that lays
    boundaries of several zones onto one target is always refused.
    """
    case = with_marker_names(case, mesh)
    if not isinstance(mesh, Assembly):
        return (case,)
    for place, motion in enumerate(case.motions, start=1):
        if (computed or motion.one_zone) and of_several_zones(motion, case, mesh):
            raise CaseError(
                f"motion {place} is of boundaries of several zones together, which are deformed "
                "alone; give one for each"
            )
    zones = [names_in(mesh, part) for part in mesh.parts]
    if case.span and all(_zone_span(case, names) is None for names in zones):
        raise CaseError(
            f"SPAN: {' and '.join(case.span)} are not both boundaries of one zone of {mesh.name}, "
            f"which has {', '.join(mesh.marker_names)}"
        )
    settings = case.zone_settings or (case,) * mesh.zones
    each = zip(settings, mesh.parts, strict=True)
    return tuple(_zone_case(case, one, mesh, part) for one, part in each)


def each_zone(case: Case, mesh: Mesh) -> Iterator[tuple[Case, Mesh]]:
    """Return the case of each zone with the zone; errors as `zone_cases` without ``computed``."""
    return zip(zone_cases(case, mesh, False), zones_of(mesh), strict=True)


def of_several_zones(motion: Motion, case: Case, mesh: Mesh) -> bool:
    """Return whether what a motion does in a zone depends on its boundaries in other zones.

    So do those about their common centroid, and displacement files.
    """
    moved = [name for name in case.markers_with("moving") if applies_to(motion, name)]
    zones = [not names_in(mesh, part).keys().isdisjoint(moved) for part in mesh.parts]
    return motion.joins_zones and sum(zones) > 1


def _zone_case(case: Case, settings: Case, mesh: Mesh, part: ZonePart) -> Case:
    names = names_in(mesh, part)
    roles = {names[name]: role for name, role in case.roles.items() if name in names}
    periodic = "periodic" in roles.values()
    zone = settings.change(
        roles=roles,
        motions=(),
        limits=(),
        zone=None,
        span=_zone_span(settings, names),
        warnings=(),
        interfaces=(),
        zone_settings=(),
        periodic=settings.periodic if periodic else "none",
    )
    moved = [zone_motion(case, motion, part, names, zone) for motion in case.motions]
    return zone.change(motions=tuple(motion for motion in moved if motion is not None))


def _renamed_span(case: Case, names: Mapping[str, str | None]) -> tuple[str, str] | None:
    if case.span is None:
        return None
    hub = names.get(case.span[0], case.span[0])
    shroud = names.get(case.span[1], case.span[1])
    return None if hub is None or shroud is None else (hub, shroud)


def _zone_span(case: Case, names: Mapping[str, str | None]) -> tuple[str, str] | None:
    """Return the walls of SPAN with their names in the file of a zone, if it has both.

    A name that several zones have is that of each.
    """
    span = _renamed_span(case, names)
    return span if span is not None and set(span) <= set(names.values()) else None


def zone_motion(
    case: Case, motion: Motion, part: ZonePart, names: Mapping[str, str], zone: Case
) -> Motion | None:
    """Return the motion of those boundaries of a zone that it moves; None if it moves none."""
    moving = case.markers_with("moving")
    moved = [names[name] for name in moving if name in names and applies_to(motion, name)]
    if not moved:
        return None
    here = motion.of_zone(part, zone)
    if here is None:
        return None
    return here.with_marker(moved[0] if len(moved) == 1 else tuple(moved))
