"""Checks of a case: against itself, and against the mesh that it is meant for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from slideviz.case.ffd_keys import ffd_contradictions
from slideviz.case.key import BOUNDARIES, FILES, MOTION, Key
from slideviz.case.keys import KEYS
from slideviz.case.limits import not_walls
from slideviz.case.method_keys import FACTORS, why_no_tolerance
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe
from slideviz.case.motions.box import box_motions
from slideviz.case.motions.motion import Motion, applies_to, named
from slideviz.case.zone_cases import with_marker_names, zone_cases
from slideviz.errors import CaseError, Message, nearest, note
from slideviz.mesh.model import Assembly, Mesh
from slideviz.mesh.zones import without_zone
from slideviz.terms import KERNELS, ROLES, SLIDES

if TYPE_CHECKING:
    from slideviz.case.model import Case

_LISTED = 12


def check_case(case: Case, mesh: Mesh) -> tuple[str, ...]:
    """Return why this mesh cannot be deformed as the case asks; displacement files are not read."""
    case = with_marker_names(case, mesh)
    if isinstance(mesh, Assembly):
        return tuple(_problems_of_zones(case, mesh))
    return (
        *_radius_problems(case, mesh),
        *_method_problems(case),
        *map(str, contradictions(case, exact=True)),
        *marker_problems(case, mesh),
        *motion_problems(case, mesh),
        *_zone_problems(case, mesh),
        *_periodic_problems(case, mesh),
        *_halo_problems(case, mesh),
    )


def _problems_of_zones(case: Case, mesh: Mesh) -> Iterator[str]:
    """Yield why a mesh of all zones cannot be deformed, of the case and of zones that move."""
    if len(case.interfaces) % 2:
        yield f"MARKER_ZONE_INTERFACE: {', '.join(case.interfaces)} are not pairs of boundaries"
        return
    moved = {name: "MOTION" for motion in case.motions for name in named(motion.marker)}
    keys = moved | _keys_of_markers(case) | dict.fromkeys(case.interfaces, "MARKER_ZONE_INTERFACE")
    several = {name: key for name, key in keys.items() if _of_several_zones(mesh, name)}
    if several:  # what else is wrong may be so by these names only
        yield from unknown_markers(mesh, several)
        return
    yield from map(str, contradictions(case, exact=True))
    yield from marker_problems(case, mesh)
    yield from unknown_markers(mesh, dict.fromkeys(case.interfaces, "MARKER_ZONE_INTERFACE"))
    yield from _zone_problems(case, mesh)
    if not case.markers_with("periodic"):
        yield from _periodic_problems(case, mesh)
    if unmoved := _without_motion(case):  # which zones have without the numbers of their names
        yield from unmoved
        return
    try:
        cases = zone_cases(case, mesh, False)
    except CaseError as problem:
        yield str(problem)
        return
    for number, (one, part) in enumerate(zip(cases, mesh.parts, strict=True), 1):
        if one.markers_with("moving"):
            yield from (f"zone {number}: {text}" for text in check_case(one, part.mesh))


def _method_problems(case: Case) -> Iterator[str]:
    """Yield why the method of a case cannot relax or keep layers, as it is asked to."""
    if case.method == "rbf":
        return
    for key, value in (("RELAX", case.relax), ("LAYERS", case.layers)):
        if value in ("yes", "keep"):
            yield (
                f"{key}= {value.upper()} acts after METHOD= rbf only, and METHOD= {case.method} "
                f"is there to be compared with as it is; use {key}= AUTO or NO, or METHOD= rbf"
            )


def contradictions(case: Case, *, exact: bool = False) -> list[Message]:
    """Return a message for keys that contradict each other, whatever the mesh.

    What else a run needs is found by `check_case`: a case without it can be read from a file, and
    put right with ``--set``. Unless ``exact``, 1:blade may be another spelling of blade.
    """
    problems = list[Message]()
    moving = case.markers_with("moving")
    spelt = () if exact else {without_zone(name) for name in moving}
    seen: set[str] = set()
    for place, motion in enumerate(case.motions, start=1):
        for name in named(motion.marker):
            if name in moving or name in seen or without_zone(name) in spelt:
                continue
            seen.add(name)
            remedy = f"one of the two is wrong{nearest(name, moving)}"
            several = name.split("+")
            if set(several) <= set(moving):
                markers = ", ".join(several)
                remedy = f"write several in brackets, e.g. (({markers}), translate, ...)"
            sentence = (
                f"motion {place} names {name!r}, which does not move: MARKER_MOVING= "
                f"({', '.join(moving)}) does not have it; {remedy}"
            )
            problems.append(Message(sentence, keys=("MOTION", "MARKER_MOVING")))
    if case.periodic_type == "rotational" and case.direction in (0, 2):
        name = "r" if case.direction == 0 else "z"
        sentence = (
            f"rotational periodicity repeats in theta, not in {name} (PERIODIC_DIRECTION= "
            f"{case.direction}); write theta, or PERIODIC_TYPE= translational"
        )
        problems.append(Message(sentence, keys=("PERIODIC_DIRECTION", "PERIODIC_TYPE")))
    if case.polynomial == "no" and KERNELS[case.kernel].polynomial:
        sentence = (
            f"RBF_KERNEL= {case.kernel} needs the linear polynomial: without it the system may be "
            "singular; use POLYNOMIAL= AUTO, or another kernel such as wendland-c2"
        )
        problems.append(Message(sentence, keys=("POLYNOMIAL", "RBF_KERNEL")))
    return problems + ffd_contradictions(case)


def marker_problems(case: Case, mesh: Mesh) -> tuple[str, ...]:
    """Return a sentence for each marker of the case that the mesh lacks, and if no marker moves."""
    there = [limit for limit in case.limits if limit.marker in mesh.marker_names]
    unknown = unknown_markers(mesh, _keys_of_markers(case))
    problems = (*unknown, *not_walls(there, case.walls(mesh.marker_names)))
    if case.markers_with("moving"):
        return problems
    return (*problems, "no marker moves; name one in MARKER_MOVING")


def _keys_of_markers(case: Case) -> dict[str, str]:
    """Return the key that names each marker with a role or a limit."""
    roles = {name: ROLES[role].key for name, role in case.roles.items()}
    return roles | {limit.marker: "LIMITS" for limit in case.limits if limit.marker}


def _of_several_zones(mesh: Mesh, marker: str) -> str:
    """Return the spellings of a marker that several zones have, as ``1:blade or 2:blade``."""
    if not isinstance(mesh, Assembly) or marker in mesh.marker_names:
        return ""
    return " or ".join(name for name in mesh.marker_names if without_zone(name) == marker)


def unknown_markers(mesh: Mesh, named: Mapping[str, str]) -> list[str]:
    """Return a sentence for each marker of ``named`` (to the key that names it) the mesh lacks."""
    known = mesh.marker_names
    names = ", ".join(known[:_LISTED]) + (", ..." if len(known) > _LISTED else "")
    has = f"it has {names}" if known else "it has none"
    return [
        f"{key}: several zones of {mesh.name} have a marker {marker!r}; write {joined}"
        if (joined := _of_several_zones(mesh, marker))
        else f"{key}: {mesh.name} has no marker {marker!r}{nearest(marker, known) or f'; {has}'}"
        for marker, key in named.items()
        if marker not in known
    ]


def motion_problems(case: Case, mesh: Mesh) -> tuple[str, ...]:
    """Return a sentence for each moving marker without motion, and each motion that is unfit."""
    found = _without_motion(case)
    for place, motion in enumerate(case.motions):
        wrong = motion.incomplete() or _text_problem(motion)
        problems = [wrong] if wrong else motion.problems(case, mesh, place)
        found += [f"motion {place + 1}: {text}" for text in problems]
    return tuple(found)


def motion_doubts(case: Case, mesh: Mesh) -> Iterator[Message]:
    """Yield a message for each motion that can be made, but hardly does what is meant."""
    moving = case.markers_with("moving")
    for place, motion in enumerate(case.motions, 1):
        names = [name for name in moving if applies_to(motion, name)]
        if names:
            yield from CaseError(*motion.doubts(mesh, names)).within(f"motion {place}")


def _text_problem(motion: Motion) -> str:
    """Return why a motion has values that cannot be read from a case file; "" if it has none."""
    if not motion.checked_as_text:
        return ""
    try:
        read_motions(write_motions((motion,)))
    except CaseError as problem:
        return problem.messages[0].text
    except (TypeError, ValueError) as problem:
        return str(problem)
    return ""


def _without_motion(case: Case) -> list[str]:
    boxed = bool(box_motions(case))
    of_all = ", or move all moving markers in the box with (*, ffd, ...)" if boxed else ""
    return [
        f"moving marker {marker!r} has no motion; add MOTION= ({marker}, translate, ...) or "
        f"DEFORMATION_FILENAME, or name it in MARKER_FIXED instead if it stays{of_all}"
        for marker in case.markers_with("moving")
        if not any(applies_to(motion, marker) for motion in case.motions)
    ]


def key_problems(case: Case) -> Iterator[Message]:
    """Yield a sentence for each value out of range, when a program makes a case."""
    for key in KEYS.values():
        value = key.get(case)
        if key.group in (FILES, BOUNDARIES, MOTION) or value is None:
            continue
        try:
            key.kind.read(key.kind.write(value))
        except CaseError as problem:
            yield from problem.within(key.name)
        except (TypeError, ValueError) as problem:
            yield Message(str(problem), place=(key.name,))


def _radius_problems(case: Case, mesh: Mesh) -> Iterator[str]:
    low = mesh.extent * FACTORS[0]
    high = mesh.extent * FACTORS[1]
    if case.support_radius is not None and not low < case.support_radius < high:
        yield (
            f"SUPPORT_RADIUS: {case.support_radius!r} does not fit {mesh.name}, whose extent is "
            f"{mesh.extent:g}; expected a length above {low:g} and below {high:g}"
        )


def _zone_problems(case: Case, mesh: Mesh) -> Iterator[str]:
    if case.zone is not None and case.zone != mesh.zone:
        is_zone = f"{mesh.name} is {f'zone {mesh.zone} of' if mesh.zone else 'all'} {mesh.zones}"
        yield f"ZONE= {case.zone}, but {is_zone}; read that zone or change ZONE"


def _periodic_problems(case: Case, mesh: Mesh) -> Iterator[str]:
    markers = case.markers_with("periodic")
    if case.periodic != "none" and not markers:
        yield (
            f"PERIODIC_MODE= {case.periodic} needs MARKER_PERIODIC: name the boundaries that "
            "repeat, or choose none"
        )
    if len(markers) % 2:
        yield (
            f"MARKER_PERIODIC has an odd number of markers ({', '.join(markers)}); they come in "
            "pairs: name the partner too"
        )
    if case.periodic == "moving" and case.sliding == "none":
        yield (
            f"PERIODIC_MODE= moving needs a sliding method: set SLIDING_MODE= {SLIDES}, or "
            "choose PERIODIC_MODE= fixed"
        )
    if mesh.dim == 2 and case.periodic != "none":
        if case.direction == 2:
            yield "PERIODIC_DIRECTION= 2 is z, and the mesh has 2 dimensions; choose x or y"
        if case.periodic_type != "translational" and any(case.axis[:2]):
            yield f"PERIODIC_AXIS= {case.axis} leaves the plane; in 2D it is z"


def idle_roles(case: Case) -> tuple[str, ...]:
    """Return a sentence for each role without effect in the case's modes, seldom on purpose."""
    problems = []
    periodic = case.markers_with("periodic")
    sliding = case.markers_with("sliding")
    if periodic and case.periodic == "none":
        problems.append(
            f"PERIODIC_MODE= none: {' and '.join(periodic)} will not stay periodic; with "
            f"PERIODIC_MODE= moving (or fixed) they do"
        )
    if sliding and case.sliding == "none":
        problems.append(
            f"SLIDING_MODE= none: {', '.join(sliding)} will not slide but stay fixed; with "
            f"SLIDING_MODE= {SLIDES} they do"
        )
    return tuple(problems)


_SLIDES = {
    ("idw", "ds"): "direct sliding acts like pseudo sliding here: inverse distance weighting "
    "solves no system that nodes could slide in (edges first, then surfaces, each put back on its "
    "boundary)",
    ("elastic", "ps"): "pseudo sliding acts like direct sliding here: in linear elasticity nodes "
    "slide by the equations themselves",
}


def _halo_problems(case: Case, mesh: Mesh) -> tuple[str, ...]:
    """Return a sentence for each moving halo copy of a boundary that does not move."""
    return tuple(
        f"{mesh.name}: {copy} is a halo copy of {origin} (SEND_RECEIVE) and cannot move by itself; "
        f"make {origin} moving"
        for copy, origin in (mesh.halo.sides if mesh.halo is not None else ())
        if case.roles.get(copy) == "moving" != case.roles.get(origin)
    )


def idle_settings(case: Case) -> tuple[Message, ...]:
    """Return a note for each setting of the case without effect: with its method, or with any."""
    usual = type(case)()
    idle = [
        _with_switch(key, case)
        for key in KEYS.values()
        if key.method not in (None, case.method)
        and key.get(case) not in (key.get(usual), "NO", "auto")
    ]
    notes = [_SLIDES[case.method, case.sliding]] if (case.method, case.sliding) in _SLIDES else []
    if idle:
        notes.append(f"METHOD= {case.method} does not use {', '.join(idle)}")
    notes += [
        f"{_with_switch(key, case)} has no effect: {key.no_effect}"
        for key in KEYS.values()
        if key.no_effect and key.get(case) != key.get(usual)
    ]
    notes += [
        f"{key.name} has no effect: DATA_REDUCTION= AUTO finds the tolerance; YES uses this one"
        for key in KEYS.values()
        if key.idle_reason is why_no_tolerance
        and case.reduction is not None
        and case.reduction.auto
        and key.get(case) != key.get(usual)
    ]
    return tuple(map(note, notes))


def file_before_motions(case: Case) -> tuple[Message, ...]:
    """Return a note for each sequence of motions that begins with a file for all boundaries."""
    sequences: dict[tuple[Motion, ...], list[str]] = {}
    for marker in case.markers_with("moving"):
        sequence = tuple(motion for motion in case.motions if applies_to(motion, marker))
        if len(sequence) > 1:
            sequences.setdefault(sequence, []).append(marker)
    return tuple(
        note(
            f"{first.files[0].name} moves {' and '.join(markers)} first (DEFORMATION_FILENAME), "
            f"and then MOTION does so: {'; '.join(map(describe, others))}; "
            "DEFORMATION_FILENAME= NONE leaves the file out"
        )
        for (first, *others), markers in sequences.items()
        if first.is_case_file
    )


def _with_switch(key: Key, case: Case) -> str:
    """Return the key of a setting for a message, with ``= YES`` if that is its value."""
    value = key.get(case)
    return f"{key.name}= YES" if value is True or value == "YES" else key.name


def effective(case: Case) -> Case:
    """Return the case with those settings at their defaults that never change a result."""
    usual = type(case)()
    fields = (key.field for key in KEYS.values() if key.no_effect)
    return case.change(**{field: getattr(usual, field) for field in fields})
