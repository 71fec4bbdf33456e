"""Arguments that several commands share, and the values that their texts mean."""

from __future__ import annotations

import argparse
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from slideviz.errors import CaseError, Message, not_one_of, raise_all
from slideviz.terms import NO_REFERENCE, RATED, ROLES, Quantity, field_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from slideviz.case.model import Case
    from slideviz.mesh.model import Mesh
    from slideviz.scene.overview import Zoom
    from slideviz.terms import Role

Read = TypeVar("Read")

REMEDY = "give --reference UNDEFORMED"  # the advice after that remark


def add_reference(call: argparse.ArgumentParser, case_help: str) -> None:
    """Add the options ``--reference`` and ``--case``."""
    call.add_argument(
        "--reference",
        type=Path,
        metavar="UNDEFORMED",
        help="mesh to compare with; without it only the shape of cells is measured",
    )
    call.add_argument("--case", type=Path, metavar="CASE", help=case_help)


def reference_words(reference: Path | None) -> str:
    """Return the line on the undeformed mesh that the quality refers to, or that there is none."""
    return f"{NO_REFERENCE}; {REMEDY}" if reference is None else f"reference: {reference}"


def metric_names(text: str) -> tuple[Quantity, ...]:
    """Return metrics and numbers of walls of a text: "all", or names with commas, with - or _."""
    fields = {field_of(name): name for name in RATED}
    wanted = [field_of(word.strip().lower()) for word in text.split(",")]
    if wanted == ["all"]:
        return tuple(RATED)
    for word in wanted:
        if word not in fields:
            raise argparse.ArgumentTypeError(not_one_of(word, ("all", *fields)))
    return tuple(fields[word] for word in wanted)


SHARED: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "case": (("case",), {"type": Path, "help": "the case file (.cfg)"}),
    "zone": (("--zone",), {"type": int, "metavar": "N", "help": "zone of the mesh file, from 1"}),
    "quiet": (
        ("-q", "--quiet"),
        {"action": "store_true", "help": "print nothing but warnings and errors"},
    ),
    "json": (
        ("--json",),
        {"type": Path, "metavar": "FILE", "help": "report as JSON; - is the terminal"},
    ),
    "metrics": (
        ("--metrics",),
        {
            "type": metric_names,
            "default": (),
            "metavar": "NAMES",
            "help": "other numbers too, also in a .vtu, .vtkhdf or .csv file: all, or names with "
            "commas, e.g. skewness,expansion,growth",
        },
    ),
    "force": (
        ("--force",),
        {"action": "store_true", "help": "allow writing over the input mesh"},
    ),
    "stream": (
        ("--stream",),
        {"action": "store_true", "help": "for meshes larger than memory (SU2)"},
    ),
    "set": (
        ("--set",),
        {
            "action": "append",
            "default": [],
            "metavar": "KEY=VALUE",
            "help": "change a key of the case; may be repeated; paths are relative to the current "
            "folder",
        },
    ),
}
"""Arguments that several commands have, by name: flags and keywords for ``add_argument``."""


def add_shared(call: argparse.ArgumentParser, *names: str, **other: Any) -> None:
    """Add arguments of `SHARED`; ``other`` replaces some of their keywords."""
    for name in names:
        flags, usual = SHARED[name]
        call.add_argument(*flags, **usual | other)


def add_changes(call: argparse.ArgumentParser) -> None:
    """Add the options ``--set`` and ``--steps``, which change the case for one run."""
    add_shared(
        call,
        "set",
        help="change a key of the case for this run; may be repeated; paths "
        "are relative to the current folder",
    )
    call.add_argument(
        "--steps", dest="step_count", metavar="N", help="number of steps, or auto (--set STEPS=N)"
    )


def read_case(arguments: argparse.Namespace) -> Case:
    """Return the case of the arguments, changed by ``--set``, ``--steps`` and ``--zone``."""
    from slideviz import Case
    from slideviz.cli.output_paths import add_case_inputs

    case = changed(Case.read(arguments.case), arguments.set)
    if getattr(arguments, "step_count", None) is not None:
        case = changed(case, [f"STEPS={arguments.step_count}"], "--steps, which is")
    case = case if arguments.zone is None else case.change(zone=arguments.zone)
    add_case_inputs(arguments, case)
    return case


def read_mesh(case: Case, path: Path) -> tuple[Case, Mesh]:
    """Return the case with the names of the boundaries as its mesh has them, and the mesh."""
    from slideviz import read
    from slideviz.case.zone_cases import with_marker_names

    mesh = read(path, zone=case.zone, file_format=case.mesh_format)
    return with_marker_names(case, mesh), mesh


def require_mesh_file(arguments: argparse.Namespace, case: Case) -> Path:
    """Return the mesh file of a case, or raise CaseError."""
    if case.mesh_file is None:
        raise CaseError(f"{arguments.case}: MESH_FILENAME is missing; it names the mesh to deform")
    return case.mesh_file


def read_inputs(arguments: argparse.Namespace, *, is_mesh: bool = False) -> tuple[Case, Mesh]:
    """Return the case and its mesh of a command with ``-o`` and ``--json``, which can be written.

    ``is_mesh``: whether ``-o`` is a mesh. Errors as `require_output_paths`.
    """
    from slideviz.cli.output_paths import OutputPath, require_output_paths

    case = read_case(arguments)
    mesh_file = require_mesh_file(arguments, case)
    require_output_paths(
        arguments,
        OutputPath(arguments.output, "-o", is_mesh=is_mesh),
        OutputPath(arguments.json, "--json"),
    )
    return read_mesh(case, mesh_file)


def optional_case(arguments: argparse.Namespace) -> Case | None:
    """Return the case of the option ``--case``, or None."""
    from slideviz import Case
    from slideviz.cli.output_paths import add_case_inputs

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
    from slideviz.case.cfg import set_key
    from slideviz.case.check import idle_roles

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


def _taken(case: Case, taken: Mapping[str, tuple[str, Role]]) -> Iterator[str]:
    """Yield a sentence for each marker that was taken from a role that it needs.

    ``taken`` has, for markers that came into another role, the option that did it and the role
    before.
    """
    from slideviz.case.motions.motion import named

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


def add_zoom(call: argparse.ArgumentParser) -> None:
    """Add the option ``--zoom`` of pictures and films."""
    call.add_argument(
        "--zoom",
        type=zoom,
        default="auto",
        metavar="X,Y[,Z],WIDTH",
        help="center and width of the picture; `all` is the whole mesh, as is `auto` (default), "
        "unless the moving body is tiny in it",
    )


def zoom(text: str) -> Zoom:
    """Return the detail for ``X,Y,WIDTH`` or ``X,Y,Z,WIDTH``; ``auto`` and ``all`` as they are."""
    if text == "auto":
        return "auto"
    if text == "all":
        return "all"
    from slideviz.scene.overview import Detail

    try:
        *centre, width = map(float, text.split(","))
    except ValueError:
        centre = []
        width = 0.0
    if len(centre) not in (2, 3) or not (all(map(isfinite, centre)) and 0.0 < width < inf):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither X,Y,WIDTH (X,Y,Z,WIDTH in 3D; WIDTH above 0) nor `all` nor `auto`"
        )
    return Detail(tuple(centre), width)


def checked(read: Callable[[str], Read]) -> Callable[[str], Read]:
    """Return the type of an argument that ``read`` reads: its CaseError means wrong usage."""

    def argument(text: str) -> Read:
        try:
            return read(text)
        except CaseError as problem:
            raise argparse.ArgumentTypeError("; ".join(map(str, problem.messages))) from None

    return argument


def integer(text: str) -> int:
    """Parse a whole number, written like ``20000`` or ``1e8``."""
    try:
        number = float(text)
    except ValueError:
        number = 0.5
    if not number.is_integer():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number; write e.g. 20000 or 1e8")
    return int(text) if text.strip().lstrip("+-").isdigit() else int(number)


def size(text: str) -> tuple[int, int]:
    """Return width and height of a text like ``1280x800``."""
    width, sign, height = text.lower().partition("x")
    if not (sign and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not of the form WIDTHxHEIGHT; write e.g. 1280x800"
        )
    return int(width), int(height)
