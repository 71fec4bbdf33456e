"""Reading and writing the case file: lines ``KEY= value`` as in SU2, with all keys of RBF-SliDe.

All mistakes in a file are reported at once. Paths in it are relative to its folder.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slideviz.case.check import contradictions
from slideviz.case.keys import GROUPS, KEYS, REDUCTION, REDUCTION_ROWS, Key
from slideviz.case.lines import Entry, entries_of, listed, read_text, require_no_mesh
from slideviz.errors import (
    CaseError,
    Message,
    Remark,
    most_similar,
    nearest,
    note,
    raise_all,
    shown,
)
from slideviz.formats.openfoam_paths import mesh_path
from slideviz.system.atomic import write_whole
from slideviz.terms import ROLES

if TYPE_CHECKING:
    from slideviz.case.model import Case

_FEW = 3  # most lines without a key that a file may have and still be a case file
_ROLE_OF = {term.key: role for role, term in ROLES.items()}


def read_case(path: Path, start: Case) -> Case:
    """Return the case that a file describes; CaseError with a line for each mistake.

    ``start``: the case of a file without keys.
    """
    text, warnings = read_text(path, "case file")
    case = case_of_text(path, text, start)
    return case.change(warnings=warnings + case.warnings)


def case_of_text(path: Path, text: str, start: Case) -> Case:
    """Return the case that the text of a file describes, as `read_case`."""
    case, problems, remarks = _parsed(path, text, start)
    raise_all(listed(path, problems))
    case = case.with_paths(lambda file: mesh_path(_from_folder(file, path.parent)))
    if case.mesh_file is not None and case.mesh_file == case.mesh_out:
        remarks += (
            f"{path}: MESH_OUT_FILENAME is MESH_FILENAME: the undeformed mesh would be overwritten",
        )
    return case.change(source=path, warnings=remarks)


def write_case(path: Path, case: Case) -> None:
    """Write a case file that ``read_case`` reads back without loss; CaseError as `case_text`."""
    write_whole(path, case_text(path, case), CaseError, case.source)


def case_text(path: Path, case: Case) -> str:
    """Return the text of a case file at a path.

    Paths in it are relative to its folder, so that both can be moved together; absolute where they
    have nothing but the root in common. Raises CaseError if a value of the case has no form in a
    case file.
    """
    folder = Path(os.path.realpath(path.parent))
    named = case.with_paths(lambda file: _to_folder(file, folder))
    text = _text(named, path)
    # Whatever is saved can be opened again: better no file than one with mistakes.
    again, problems, _ = _parsed(path, text, type(case)())
    if not problems and again.change(source=case.source, warnings=case.warnings) != named:
        problems = [Message("a case file cannot hold some of its values; check points and motions")]
    raise_all(f"{path}: cannot be written: {problem}" for problem in problems)
    return text


def set_key(case: Case, key: str, value: str, option: str = "--set") -> Case:
    """Return the case with another value of a key, as an option such as ``--set`` asks for.

    A list of markers replaces all markers with that role; one that had another role loses it. A
    path is relative to the current folder. Contradictions between keys are not looked for here
    but by ``check_case``, so that several keys can be set one after the other. Raises CaseError if
    there is no such key, or the value is wrong.
    """
    place = f"{option} {key}={value}"
    row = KEYS.get(key.strip().upper())
    try:
        if row is None:
            raise CaseError(_unknown(key))
        if row.group == REDUCTION and row.name != "DATA_REDUCTION" and case.reduction is None:
            raise CaseError("it needs DATA_REDUCTION= YES; set that first")
        wanted = row.kind.read(value.strip())
        if row.name in _ROLE_OF:
            role = _ROLE_OF[row.name]
            roles = case.roles.items()
            case = case.change(roles={k: r for k, r in roles if r != role and k not in wanted})
        changed = row.put(case, mesh_path(wanted) if isinstance(wanted, Path) else wanted)
    except CaseError as problem:
        raise CaseError(*problem.within(place)) from problem
    remark = row.kind.remark(value.strip())
    if remark:
        changed = changed.change(warnings=(*changed.warnings, f"{place}: {remark}"))
    return changed


def _parsed(path: Path, text: str, case: Case) -> tuple[Case, list[Message], tuple[Remark, ...]]:
    """Return the case of a text, its problems, and warnings; ``path`` is for messages only.

    ``case``: that of a text without keys.
    """
    entries, problems = entries_of(text)
    require_no_mesh(path, entries)
    names = {entry.key for entry in entries}
    if names & {"DV_KIND", "DV_PARAM", "DV_VALUE"}:
        raise CaseError(
            f"{path}: is a configuration of SU2 with design variables, not a case file; deform by "
            f"it with `slideviz def {path}`"
        )
    if len(problems) > _FEW and not names & KEYS.keys():
        one = problems[0]
        raise CaseError(
            f"{path}: is not a case file, for it has no line with a key of slideviz (line "
            f"{one.line}: {one}); a mesh is named in MESH_FILENAME="
        )
    rows: dict[str, Entry] = {}
    for entry in entries:
        first = rows.setdefault(entry.key, entry)
        if entry.key not in KEYS:
            problems.append(Message(_unknown(entry.key), line=entry.line))
        elif first is not entry:
            rule = f"{entry.key} is in line {first.line} already; keep one of the two"
            problems.append(Message(rule, line=entry.line))
    if not entries and not problems:
        raise CaseError(f"{path}: has no `KEY= value` line; `slideviz keys` lists the keys")
    values = dict[str, Any]()
    remarks = list[Remark]()
    for name, key in KEYS.items():
        if name not in rows:
            continue
        entry = rows[name]
        try:
            values[name] = _value(key, entry)
            case = key.put(case, values[name])
        except CaseError as problem:
            values.pop(name, None)
            problems += problem.within(name, line=entry.line)
        else:
            remark = key.kind.remark(entry.value)
            remarks += [f"{path}:{entry.line}: {name}: {remark}"] if remark else []
    problems += _second_roles(rows, values)
    if case.reduction is None:
        rows_off = REDUCTION_ROWS[1:]
        idle = [key.name for key in rows_off if not key.is_default(values.get(key.name))]
        if idle:
            remarks.append(note(f"{path}: DATA_REDUCTION= NO does not use {', '.join(idle)}"))
    # A mistyped key makes contradictions that are not reported as well.
    mistyped = {most_similar(key, KEYS) for key in names - KEYS.keys()}
    for message in contradictions(case):
        keys = message.keys
        if mistyped.intersection(keys):
            continue
        # A key that could not be read is reported already; what follows from it need not be.
        if all(key in values for key in keys if key in rows):
            line = next(rows[key].line for key in keys if key in rows)
            problems.append(replace(message, line=line))
    return case, problems, tuple(remarks)


def _value(key: Key, entry: Entry) -> Any:
    if not entry.value:
        raise CaseError(f"it has no value; expected {key.kind.allowed}")
    return key.kind.read(entry.value)


def _second_roles(rows: Mapping[str, Entry], values: Mapping[str, Any]) -> list[Message]:
    """Return a problem for each marker in two lists of roles, at the later one's line."""
    problems: list[Message] = []
    first: dict[str, Entry] = {}
    lists = [entry for key, entry in rows.items() if key in _ROLE_OF and key in values]
    for entry in sorted(lists, key=lambda entry: entry.line):
        for name in values[entry.key]:
            other = first.setdefault(name, entry)
            if other is not entry:
                rule = (
                    f"{entry.key}: marker {name!r} is in {other.key} too, line {other.line}; "
                    "a marker has one role: take it out of one of the lists"
                )
                problems.append(Message(rule, line=entry.line))
    return problems


def _text(case: Case, path: Path) -> str:
    lines = ["% A case of slideviz; `slideviz keys` explains the keys"]
    for group in GROUPS:
        values = []
        for key in KEYS.values():
            value = key.get(case) if key.group == group else None
            if value is not None:
                try:
                    values.append(f"{key.name}= {key.kind.write(value)}")
                except CaseError as problem:
                    raise CaseError(
                        f"{path}: cannot be written: {key.name}: {problem}"
                    ) from problem
        lines += ["", f"% ----- {group} -----", *values] if values else []
    return "\n".join(lines) + "\n"


def _unknown(key: str) -> str:
    return f"unknown key {shown(key)}{nearest(key, KEYS) or '; `slideviz keys` lists all'}"


def _from_folder(file: Path, folder: Path) -> Path:
    """Resolve the relative path ``file`` of a case file in ``folder``; drop ``..`` if possible."""
    path = folder / file
    short = Path(os.path.normpath(path))
    # `link/..` is the parent of the link's target, so shorten only if it is the same file then.
    return short if os.path.realpath(short) == os.path.realpath(path) else path


def _to_folder(file: Path, folder: Path) -> Path:
    """Return the path of a file as a case file in ``folder`` (a real path) names it."""
    real = Path(os.path.realpath(file.parent)) / file.name
    if len(os.path.commonpath([real, folder])) > 1:
        return Path(os.path.relpath(real, folder))
    return real


def describe_keys() -> str:
    """Return the reference of all keys, under headings, each with values, default and meaning."""
    lines = [
        "Keys of a case file: KEY= value, one in each line, in any order.",
        "",
        *textwrap.wrap(
            "Comments begin with %, # or $. A line that ends with a backslash continues in the "
            "next line. Paths are relative to the file. Names with other signs than letters, "
            "digits "
            'and _ . - : / @ + stand between double quotes: "tip #2". NONE or ( ) is an empty '
            "list. Keys marked + are slideviz's own, the others are RBF-SliDe's too.",
            width=90,
        ),
    ]
    for group in GROUPS:
        lines += ["", group.upper()]
        for key in KEYS.values():
            if key.group == group:
                mark = " " if key.rbf_slide else "+"
                head = f"{mark} {key.name}= {key.kind.allowed}   [{key.default}]"
                lines += textwrap.wrap(
                    head, 100, subsequent_indent="        ", break_on_hyphens=False
                )
                lines += textwrap.wrap(
                    key.meaning, 90, initial_indent="      ", subsequent_indent="      "
                )
                for line in key.kind.details:
                    lines += textwrap.wrap(
                        line, 100, initial_indent="        ", subsequent_indent="            "
                    )
    return "\n".join(lines)
