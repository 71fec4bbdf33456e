"""The case and the mesh that the arguments of a command name."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from slideviz import Case, read
from slideviz.case.cfg import set_key
from slideviz.case.check import idle_roles
from slideviz.case.lines import entries_of, read_text
from slideviz.case.motions.motion import named
from slideviz.case.zone_cases import with_marker_names
from slideviz.cli.output_paths import OutputPath, add_case_inputs, require_output_paths
from slideviz.errors import CaseError, Message, raise_all
from slideviz.mesh.model import Mesh
from slideviz.terms import ROLES, Role


def read_case(arguments: Namespace) -> Case:
    """Return the case of the arguments, changed by ``--set``, ``--steps`` and ``--zone``."""
    case = changed(Case.read(arguments.case), arguments.set)
    if arguments.step_count is not None:
        case = changed(case, [f"STEPS={arguments.step_count}"], "--steps, which is")
    case = case if arguments.zone is None else case.change(zone=arguments.zone)
    add_case_inputs(arguments, case)
    return case


def read_mesh(case: Case, path: Path) -> tuple[Case, Mesh]:
    """Return the case with the names of the boundaries as its mesh has them, and the mesh."""
    mesh = read(path, zone=case.zone, file_format=case.mesh_format)
    return with_marker_names(case, mesh), mesh


def require_mesh_file(arguments: Namespace, case: Case) -> Path:
    """Return the mesh file of a case, or raise CaseError."""
    if case.mesh_file is None:
        raise CaseError(f"{arguments.case}: MESH_FILENAME is missing; it names the mesh to deform")
    return case.mesh_file


def read_inputs(arguments: Namespace, *, is_mesh: bool = False) -> tuple[Case, Mesh]:
    """Return the case and its mesh of a command with ``-o`` and ``--json``, which can be written.

    ``is_mesh``: whether ``-o`` is a mesh. Errors as `require_output_paths`.
    """
    case = read_case(arguments)
    mesh_file = require_mesh_file(arguments, case)
    require_output_paths(
        arguments,
        OutputPath(arguments.output, "-o", is_mesh=is_mesh),
        OutputPath(arguments.json, "--json"),
    )
    return read_mesh(case, mesh_file)


def optional_case(arguments: Namespace) -> Case | None:
    """Return the case of the option ``--case``, or None."""
    if arguments.case is None:
        return None
    case = Case.read(arguments.case)
    add_case_inputs(arguments, case)
    return case


def changed(case: Case, texts: Sequence[str], option: str = "--set") -> Case:
    """Return the case with other values of some keys, given as texts KEY=VALUE.

    ``option`` is what messages call the texts. Raises CaseError if texts have another form, there
    is no such key, a value is wrong, or a list of markers takes a marker from the role that it
    needs; with a line for each.
    """
    before = idle_roles(case)
    problems = list[Message]()
    taken: dict[str, tuple[str, Role]] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign:
            rule = f"{option} {text!r} is not of the form KEY=VALUE"
            problems.append(Message(rule))
            continue
        try:
            after = set_key(case, key.strip(), value.strip(), option)
        except CaseError as problem:
            problems += problem.messages
            continue
        for name, role in case.roles.items():
            if after.roles.get(name, role) != role:
                taken[name] = f"{option} {text}", role
        case = after
    raise_all((*problems, *_taken(case, taken)))
    added = [warning for warning in case.warnings if warning not in before]
    return case.change(warnings=(*added, *idle_roles(case)))


def with_lines(messages: Iterable[Message], arguments: Namespace) -> tuple[Message, ...]:
    """Return the messages about keys with the case file of the arguments, and the line there."""
    path = getattr(arguments, "case", None)
    if path is None:
        return tuple(messages)
    lines = {entry.key: entry.line for entry in entries_of(read_text(path, "case file")[0])[0]}
    for text in getattr(arguments, "set", ()):
        lines.pop(text.partition("=")[0].strip().upper(), None)

    def placed(message: Message) -> Message:
        files = [place for place in message.place if isinstance(place, Path)]
        if not message.keys or message.line or files not in ([], [path]):
            return message
        line = next((lines[key] for key in message.keys if key in lines), 0)
        return replace(message, place=(*([] if files else [path]), *message.place), line=line)

    return tuple(map(placed, messages))


def _taken(case: Case, taken: Mapping[str, tuple[str, Role]]) -> Iterator[str]:
    """Yield a sentence for each marker that was taken from a role that it needs.

    ``taken`` has, for markers that came into another role, the option that did it and the role
    before.
    """
    periodic = case.markers_with("periodic")
    for name, (option, role) in taken.items():
        if case.roles.get(name) == role:
            continue
        it = f"{option} takes {name} from {ROLES[role].key}"
        if role == "moving" and any(name in named(motion.marker) for motion in case.motions):
            yield f"{it}, but MOTION still moves it; set MOTION, too, or leave {name} out"
        elif role == "moving" and not case.markers_with("moving"):
            yield f"{it}, and no other marker moves; leave {name} out, or set MARKER_MOVING, too"
        elif role == "periodic" and len(periodic) % 2:
            yield f"{it}, which has {', '.join(periodic)} left; markers repeat in pairs: name both"
