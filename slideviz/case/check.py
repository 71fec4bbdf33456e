"""Checks of a case: against itself, and against the mesh that it is meant for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from slideviz.case.keys import (
    BOUNDARIES,
    FACTORS,
    FILES,
    KEYS,
    MOTION,
    Key,
    ffd_contradictions,
)
from slideviz.case.limits import not_walls
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe
from slideviz.case.motions.box import box_motions
from slideviz.case.motions.motion import Motion, applies_to, named
from slideviz.case.zone_cases import with_marker_names, zone_cases
from slideviz.errors import CaseError, Doubt, Message, most_similar, note
from slideviz.mesh.model import Assembly, Mesh
from slideviz.mesh.zones import without_zone
from slideviz.system.grouping import grouped
from slideviz.terms import KERNELS, ROLES, SLIDES, Texts

if TYPE_CHECKING:
    from slideviz.case.model import Case

Messages = tuple[Message, ...]
_LISTED = 12
_INTERFACES = "MARKER_ZONE_INTERFACE"


def check_case(case: Case, mesh: Mesh) -> Messages:
    """Return why this mesh cannot be deformed as the case asks; displacement files are not read."""
    case = with_marker_names(case, mesh)
    if isinstance(mesh, Assembly):
        return tuple(_problems_of_zones(case, mesh))
    return (
        *_radius_problems(case, mesh),
        *_method_problems(case),
        *contradictions(case),
        *marker_problems(case, mesh),
        *_motions_of_others(case, mesh),
        *motion_problems(case, mesh),
        *_zone_problems(case, mesh),
        *_periodic_problems(case, mesh),
        *_halo_problems(case, mesh),
    )


def _problems_of_zones(case: Case, mesh: Mesh) -> Iterator[Message]:
    """Yield why a mesh of all zones cannot be deformed, of the case and of zones that move."""
    if len(case.interfaces) % 2:
        rule = f"{', '.join(case.interfaces)} are not pairs of boundaries"
        yield Message(rule, place=(_INTERFACES,), keys=(_INTERFACES,))
        return
    interfaces = dict.fromkeys(case.interfaces, _INTERFACES)
    keys = _moved(case) | _keys_of_markers(case) | interfaces
    several = {name: key for name, key in keys.items() if _of_several_zones(mesh, name)}
    if several:  # what else is wrong may be so by these names only
        yield from unknown_markers(mesh, several)
        return
    yield from contradictions(case)
    yield from marker_problems(case, mesh)
    yield from _motions_of_others(case, mesh)
    yield from unknown_markers(mesh, interfaces)
    yield from _zone_problems(case, mesh)
    if not case.markers_with("periodic"):
        yield from _periodic_problems(case, mesh)
    # Each zone would say this too, of names without the zone's number.
    if unmoved := _without_motion(case, mesh):
        yield from unmoved
        return
    try:
        cases = zone_cases(case, mesh, False)
    except CaseError as problem:
        yield from problem.messages
        return
    for number, (one, part) in enumerate(zip(cases, mesh.parts, strict=True), 1):
        if one.markers_with("moving"):
            yield from CaseError(*check_case(one, part.mesh)).within(f"zone {number}")


def _method_problems(case: Case) -> Iterator[Message]:
    """Yield why the method of a case cannot relax or keep layers, as it is asked to."""
    if case.method == "rbf":
        return
    for key, value in (("RELAX", case.relax), ("LAYERS", case.layers)):
        if value in ("yes", "keep"):
            yield Message(
                f"{key}= {value.upper()} acts after METHOD= rbf only, and METHOD= {case.method} "
                "is there to be compared with as it is",
                f"use {key}= AUTO or NO, or METHOD= rbf",
                keys=(key,),
            )


def contradictions(case: Case) -> list[Message]:
    """Return a message for keys that contradict each other, whatever the mesh.

    What else a run needs is found by `check_case`: a case without it can be read from a file, and
    put right with ``--set``.
    """
    problems = list[Message]()
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


def marker_problems(case: Case, mesh: Mesh) -> Messages:
    """Return a message for each marker of the case that the mesh lacks, and if no marker moves."""
    there = [limit for limit in case.limits if limit.marker in mesh.marker_names]
    unknown = unknown_markers(mesh, _keys_of_markers(case))
    unfit = not_walls(there, case.walls(mesh.marker_names))
    problems = (*unknown, *(replace(limit, keys=("LIMITS",)) for limit in unfit))
    if case.markers_with("moving"):
        return problems
    names = ", ".join(name for name in _moved(case) if name in mesh.marker_names)
    return (
        *problems,
        Message(
            "no marker moves: MARKER_MOVING is missing",
            f"write MARKER_MOVING= ({names or '...'})",
            keys=("MARKER_MOVING",),
        ),
    )


def _keys_of_markers(case: Case) -> dict[str, str]:
    """Return the key that names each marker with a role or a limit."""
    roles = {name: ROLES[role].key for name, role in case.roles.items()}
    return roles | {limit.marker: "LIMITS" for limit in case.limits if limit.marker}


def _moved(case: Case) -> dict[str, str]:
    """Return ``MOTION`` for each marker that a motion names."""
    return {name: "MOTION" for motion in case.motions for name in named(motion.marker)}


def _of_several_zones(mesh: Mesh, marker: str) -> str:
    """Return the spellings of a marker that several zones have, as ``1:blade or 2:blade``."""
    if not isinstance(mesh, Assembly) or marker in mesh.marker_names:
        return ""
    return " or ".join(name for name in mesh.marker_names if without_zone(name) == marker)


def unknown_markers(mesh: Mesh, named: Mapping[str, str]) -> list[Message]:
    """Return a message for each marker of ``named`` (to the key that names it) the mesh lacks."""
    return [
        Message(*_unknown_marker(mesh, marker), place=(key,), keys=(key,))
        for marker, key in named.items()
        if marker not in mesh.marker_names
    ]


def _unknown_marker(mesh: Mesh, marker: str) -> tuple[str, str]:
    """Return that a mesh has no such marker, and the remedy."""
    if joined := _of_several_zones(mesh, marker):
        return f"several zones of {mesh.name} have a marker {marker!r}", f"write {joined}"
    known = mesh.marker_names
    several = marker.split("+")
    if set(several) <= {*known}:
        remedy = f"write several in brackets, e.g. (({', '.join(several)}), translate, ...)"
    elif close := most_similar(marker, known):
        remedy = f"did you mean {close}?"
    else:
        names = ", ".join(known[:_LISTED]) + (", ..." if len(known) > _LISTED else "")
        remedy = f"it has {names or 'none'}"
    return f"{mesh.name} has no marker {marker!r}", remedy


def motion_problems(case: Case, mesh: Mesh) -> Messages:
    """Return a message for each motion that is unfit, and each marker that lacks its motion.

    Markers that the mesh does not have are told by `marker_problems`.
    """
    found = _without_motion(case, mesh)
    for place, motion in enumerate(case.motions):
        wrong = motion.incomplete() or _text_problem(motion)
        problems = [wrong] if wrong else [*motion.problems(case, mesh, place)]
        if motion.only_3d and mesh.dim == 2 and not problems:
            problems = [f"{motion.verb} is for 3D meshes, and the mesh has 2 dimensions"]
        found += [
            Message(text, place=(f"motion {place + 1}",), keys=("MOTION",)) for text in problems
        ]
    return tuple(found)


def _motions_of_others(case: Case, mesh: Mesh) -> list[Message]:
    """Return a message for each marker that a motion names, but that does not move."""
    moving = case.markers_with("moving")
    others = {name: key for name, key in _moved(case).items() if name not in moving}
    unknown = {name: key for name, key in others.items() if name not in case.roles}
    problems = unknown_markers(mesh, unknown)
    if problems or not moving or not {*moving} <= {*mesh.marker_names}:
        return problems  # the others may be right then
    return [
        Message(
            f"motion {place} names {name!r}, which does not move: MARKER_MOVING= "
            f"({', '.join(moving)}) does not have it",
            "one of the two is wrong",
            keys=("MOTION",),
        )
        for place, motion in enumerate(case.motions, start=1)
        for name in named(motion.marker)
        if name in others
    ]


def motion_doubts(case: Case, mesh: Mesh) -> tuple[Doubt, ...]:
    """Return a doubt about each motion that can be made, but hardly does what is meant."""
    moving = case.markers_with("moving")
    return tuple(
        replace(doubt, place=(f"motion {place}",))
        for place, motion in enumerate(case.motions, 1)
        if (names := [name for name in moving if applies_to(motion, name)])
        for doubt in motion.doubts(mesh, names)
    )


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


def _without_motion(case: Case, mesh: Mesh) -> list[Message]:
    boxed = bool(box_motions(case))
    of_all = ", or move all moving markers in the box with (*, ffd, ...)" if boxed else ""
    return [
        Message(
            f"moving marker {marker!r} has no motion",
            f"add MOTION= ({marker}, translate, ...) or DEFORMATION_FILENAME, or name it in "
            f"MARKER_FIXED instead if it stays{of_all}",
            keys=("MARKER_MOVING",),
        )
        for marker in case.markers_with("moving")
        if marker in mesh.marker_names
        and not any(applies_to(motion, marker) for motion in case.motions)
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


def _radius_problems(case: Case, mesh: Mesh) -> Iterator[Message]:
    low = mesh.extent * FACTORS[0]
    high = mesh.extent * FACTORS[1]
    if case.support_radius is not None and not low < case.support_radius < high:
        yield Message(
            f"SUPPORT_RADIUS: {case.support_radius!r} does not fit {mesh.name}, whose extent is "
            f"{mesh.extent:g}",
            f"expected a length above {low:g} and below {high:g}",
            keys=("SUPPORT_RADIUS",),
        )


def _zone_problems(case: Case, mesh: Mesh) -> Iterator[Message]:
    if case.zone is not None and case.zone != mesh.zone:
        is_zone = f"{mesh.name} is {f'zone {mesh.zone} of' if mesh.zone else 'all'} {mesh.zones}"
        rule = f"ZONE= {case.zone}, but {is_zone}"
        yield Message(rule, "read that zone or change ZONE", keys=("ZONE",))


def _periodic_problems(case: Case, mesh: Mesh) -> Iterator[Message]:
    markers = case.markers_with("periodic")
    if case.periodic != "none" and not markers:
        yield Message(
            f"PERIODIC_MODE= {case.periodic} needs MARKER_PERIODIC: name the boundaries that "
            "repeat, or choose none",
            keys=("PERIODIC_MODE",),
        )
    if len(markers) % 2:
        yield Message(
            f"MARKER_PERIODIC has an odd number of markers ({', '.join(markers)})",
            "they come in pairs: name the partner too",
            keys=("MARKER_PERIODIC",),
        )
    if case.periodic == "moving" and case.sliding == "none":
        yield Message(
            f"PERIODIC_MODE= moving needs a sliding method: set SLIDING_MODE= {SLIDES}, or "
            "choose PERIODIC_MODE= fixed",
            keys=("PERIODIC_MODE",),
        )
    if mesh.dim == 2 and case.periodic != "none":
        if case.direction == 2:
            rule = "PERIODIC_DIRECTION= 2 is z, and the mesh has 2 dimensions"
            yield Message(rule, "choose x or y", keys=("PERIODIC_DIRECTION",))
        if case.periodic_type != "translational" and any(case.axis[:2]):
            rule = f"PERIODIC_AXIS= {case.axis} leaves the plane"
            yield Message(rule, "in 2D it is z", keys=("PERIODIC_AXIS",))


def idle_roles(case: Case) -> Texts:
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


def _halo_problems(case: Case, mesh: Mesh) -> Messages:
    """Return a message for each moving halo copy of a boundary that does not move."""
    return tuple(
        Message(
            f"{mesh.name}: {copy} is a halo copy of {origin} (SEND_RECEIVE) and cannot move by "
            "itself",
            f"make {origin} moving",
            keys=("MARKER_MOVING",),
        )
        for copy, origin in (mesh.halo.sides if mesh.halo is not None else ())
        if case.roles.get(copy) == "moving" != case.roles.get(origin)
    )


def idle_settings(case: Case) -> Messages:
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
        f"{_with_switch(key, case)} has no effect: {reason}"
        for key in KEYS.values()
        if (reason := key.no_effect or key.switch(case)) and not key.is_default(key.get(case))
    ]
    return tuple(map(note, notes))


def file_before_motions(case: Case) -> Messages:
    """Return a note for each sequence of motions that begins with a file for all boundaries."""
    sequences = grouped(
        (tuple(motion for motion in case.motions if applies_to(motion, marker)), marker)
        for marker in case.markers_with("moving")
    )
    return tuple(
        note(
            f"{sequence[0].files[0].name} moves {' and '.join(markers)} first "
            "(DEFORMATION_FILENAME), and then MOTION does so: "
            f"{'; '.join(map(describe, sequence[1:]))}; "
            "DEFORMATION_FILENAME= NONE leaves the file out"
        )
        for sequence, markers in sequences.items()
        if len(sequence) > 1 and sequence[0].is_case_file
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
