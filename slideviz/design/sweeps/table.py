"""The table of a sweep: designs, each of which becomes a case, and their results.

It is given as values, or read from CSV. Its columns are numbers of the case's motions, and keys of
the case. The name of a number is ``BLADE.translate.y``: marker, kind of motion, and number; or, by
the place of the motion in ``MOTION``, ``motion2.y``, which is needed where two motions of one kind
move the same marker. The name of a box's number has the control point, ``BLADE.ffd.BOX.1.0.0.y``,
that of a bump its side, ``WING.hicks-henne.upper.height``, that of a curve over the span the span
of its point, ``BLADE.twist.0.5``. The name of a key is that of ``--set``, ``STEPS``.

The folder of a sweep has ``results.csv``, a row for each design, and ``sweep.json``, its sources. A
row is written as soon as a design is done, so that a stopped sweep can be resumed.
"""

from __future__ import annotations

import errno
import json
import math
import os
import pickle
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from hashlib import blake2b
from itertools import chain
from math import isclose, isfinite, nan
from numbers import Real
from pathlib import Path
from typing import Annotated, Any

from filelock import BaseFileLock, FileLock, SoftFileLock, Timeout

from slideviz import __version__
from slideviz.argument_types import frozen
from slideviz.case.cfg import set_key
from slideviz.case.check import effective
from slideviz.case.keys import FILES, KEYS, VIEW
from slideviz.case.lines import listed, read_text
from slideviz.case.model import Case
from slideviz.case.motions.box import box_motions, system_of
from slideviz.case.motions.kinds import KIND_OF, KINDS
from slideviz.case.motions.motion import Motion
from slideviz.case.words import number
from slideviz.errors import CaseError, Message, nearest, raise_all, shown
from slideviz.ffd.section import boxes_of
from slideviz.mesh.model import Mesh
from slideviz.system.atomic import make_folder, reason_of, write_whole
from slideviz.system.csv_table import csv_rows, csv_text, write_csv
from slideviz.system.file_checks import read_json, require_regular_file
from slideviz.system.grouping import grouped

Value = str | float
"""A number of a motion, or the text of a key's value; an empty text means the case's own value."""

_ALSO = {
    "angle": "angle_deg",
    **{f"d{axis}": axis for axis in "xyz"},
    **{f"p{axis}": f"point_{axis}" for axis in "xyz"},
    **dict(word for kind in KINDS for word in kind.words),
}
"""Names of numbers in the grammar of ``MOTION``, and their names here."""
TIME = "time"
"""The column with the time of a design, which changes nothing but the name of its mesh."""
_WHOLE_MOTION = ("MOTION", "DEFORMATION_FILENAME")
_LISTED = 24


@frozen
class NumberPlace:
    """The place of a number: index of the motion, its field, and component of the field."""

    motion: int
    field: str
    component: int | None = None

    def of(self, case: Case) -> float:
        """Return the number of a case at this place."""
        value = getattr(case.motions[self.motion], self.field)
        return float(value if self.component is None else value[self.component])

    def put(self, motions: list[Motion], value: float) -> None:
        """Replace the number at this place in a list of motions, in place."""
        motion = motions[self.motion]
        new: Any = value
        if self.component is not None:
            several = list(getattr(motion, self.field))
            several[self.component] = value
            new = tuple(several)
        motions[self.motion] = replace(motion, **{self.field: new})


def numbers_of(case: Case) -> dict[str, NumberPlace]:
    """Return the places of all numbers of a case's motions, by their shortest unique name."""
    places: dict[str, NumberPlace] = {}
    heads = [motion.design_name() for motion in case.motions]
    for at, (motion, head) in enumerate(zip(case.motions, heads, strict=True)):
        name = head if heads.count(head) == 1 else f"motion{at + 1}"
        places |= {f"{name}.{part}": place for part, place in _parts(motion, at)}
    return places


def columns_of(case: Case, names: Iterable[str]) -> dict[str, NumberPlace | str]:
    """Return for each column's name the place of its number, or its key; or raise CaseError."""
    columns: dict[str, NumberPlace | str] = {}
    first: dict[NumberPlace | str, str] = {}
    problems = list[Message]()
    known = numbers_of(case) | {
        f"motion{at + 1}.{part}": place
        for at, motion in enumerate(case.motions)
        for part, place in _parts(motion, at)
    }
    for name in names:
        try:
            meant = _column_meaning(case, name, known)
            if first.setdefault(meant, name) != name or name in columns:
                raise CaseError(f"it means the same as column {first[meant]}; keep one of them")
            columns[name] = meant
        except CaseError as problem:
            problems += problem.within(f"column {shown(name)}")
    places = [name for name, what in columns.items() if isinstance(what, NumberPlace)]
    whole = [name for name, what in columns.items() if what in _WHOLE_MOTION]
    if places and whole:
        rule = (
            f"column {shown(whole[0])} replaces motions whose numbers column {shown(places[0])} "
            "changes; keep one of them"
        )
        problems.append(Message(rule))
    raise_all(problems)
    return columns


def applied(
    case: Case, columns: Mapping[str, NumberPlace | str], values: Mapping[str, Value]
) -> Case:
    """Return the case with the values of one design; an empty value leaves the case's own.

    Raises CaseError if some values are wrong: a sentence for each, which names the column.
    """
    problems = list[Message]()
    keys = {what: name for name, what in columns.items() if isinstance(what, str)}
    # In the order of the table, as in a case file: a key may be needed for another.
    for key in (key for key in KEYS if key in keys):
        try:
            text = _text(values.get(keys[key], ""))
            case = set_key(case, key, text) if text else case
        except CaseError as problem:
            column = f"column {shown(keys[key])}"  # instead of the option
            problems += [replace(m, place=(column, *m.place[1:])) for m in problem.messages]
    motions = list(case.motions)
    for name, place in columns.items():
        value = values.get(name, "")
        if isinstance(place, str) or value == "":
            continue
        try:
            place.put(motions, number_of(value))
        except CaseError as problem:
            problems += problem.within(f"column {shown(name)}")
    raise_all(problems)
    return case.change(motions=tuple(motions))


def column_name(name: str) -> str:
    """Return the name of a column in results: a key in capitals, else as it was given."""
    plain = name.strip()
    if plain.lower() == TIME:
        return TIME
    return plain.upper() if plain.upper() in KEYS else plain


def case_values(case: Case, columns: Mapping[str, NumberPlace | str]) -> dict[str, Value]:
    """Return the case's own value for each column: a number, or a text."""
    values: dict[str, Value] = {}
    for name, what in columns.items():
        if isinstance(what, NumberPlace):
            values[name] = what.of(case)
        elif what == TIME:
            values[name] = ""
        else:
            value = KEYS[what].get(case)
            values[name] = "" if value is None else KEYS[what].kind.write(value)
    return values


def _column_meaning(case: Case, name: str, known: Mapping[str, NumberPlace]) -> NumberPlace | str:
    """Return the place of a number, or the key, that a name means.

    ``known`` are the numbers by all their names: the shortest, and by the place of the motion.
    Raises CaseError where the name means nothing, several numbers, or a key that cannot vary.
    """
    key = name.strip().upper()
    if name == TIME:
        return TIME
    if key in KEYS:
        if KEYS[key].group in (FILES, VIEW):
            raise CaseError("files and the view come from the case for all designs")
        return key
    head, dot, last = name.strip().rpartition(".")
    wanted = f"{head}{dot}{_ALSO.get(last.lower(), last.lower())}"
    if wanted in known:
        return known[wanted]
    # Markers may differ in capitals alone.
    places = {place for other, place in known.items() if other.lower() == wanted.lower()}
    if len(places) == 1:
        return places.pop()
    shortest = numbers_of(case)
    several = any(
        f"{motion.design_name()}.{part}".lower() == wanted.lower()
        for at, motion in enumerate(case.motions)
        for part, _ in _parts(motion, at)
    )
    if several:
        raise CaseError(f"several motions have it; say which, e.g. {_names_text(shortest)}")
    there = (
        f"the motions have {_names_text(shortest)}" if shortest else "the motions have no numbers"
    )
    if absent := _absent_motion(case, name):
        raise CaseError(f"the case has no motion {absent}; add one to MOTION, for {there}")
    close = nearest(name, [*shortest, *KEYS])
    raise CaseError(
        "there is no such number of a motion and no such key"
        f"{close or f'; {there}; `slideviz keys` lists the keys'}"
    )


def _absent_motion(case: Case, name: str) -> str:
    """Return the motion of a moving boundary that a column is about, if the case has none such."""
    match = re.match(rf"\s*(.+?)\.({'|'.join(KIND_OF)})(?:\.|\s*\Z)", name, re.IGNORECASE)
    if match is None or match[1].lower() not in {
        "*",
        *(marker.lower() for marker in case.markers_with("moving")),
    }:
        return ""
    begin = f"{match[1]}.{match[2]}.".lower()
    has = any(f"{motion.design_name()}.".lower().startswith(begin) for motion in case.motions)
    return "" if has else f"({match[1]}, {match[2].lower()}, ...)"


def _parts(motion: Motion, place: int) -> Iterator[tuple[str, NumberPlace]]:
    for name, attribute, component in motion.design_numbers():
        yield name, NumberPlace(place, attribute, component)


def _names_text(known: Iterable[str]) -> str:
    names = list(known)
    return ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")


def number_of(value: Value) -> float:
    """Return a value of a table as a finite number; raise CaseError if it is not."""
    if isinstance(value, str):
        return number(value.strip())
    if not isinstance(value, Real) or not math.isfinite(value):
        raise CaseError(f"{value!r} is not a finite number")
    return float(value)


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value.strip()
    if isinstance(value, bool):
        return "YES" if value else "NO"
    # 5.0 is what tables of numbers make of 5.
    return format(value, ".17g") if isinstance(value, float) and value.is_integer() else str(value)


@frozen
class DesignRow:
    """The result of a design, or the reason why there is none."""

    design: int  # its number in the table of designs, from 1
    values: Mapping[str, Value] = field(default_factory=dict)  # its values, by column of that table
    min: float = nan
    mean: float = nan  # `min`, `mean`: quality of the deformed mesh; NaN where there is none
    inverted: int = 0  # inverted cells
    max_error: float = nan
    """Largest error of a boundary node before it is corrected, of all steps, in the mesh's length
    unit."""
    control_nodes: int = 0
    steps: int = 0  # `control_nodes`, `steps`: control nodes in the last step, and steps made
    seconds: float = 0.0  # time that the worker spent on it
    mesh: Path | None = None  # the file of the deformed mesh, where it was written
    warnings: tuple[str, ...] = ()
    limits: str = ""  # whether the limits of its case are met (`slideviz.case.limits.outcome`)
    problem: str = ""  # why there is no result; empty where there is one
    lost: int = 0  # how often its worker was lost, so that it was done again
    earlier: bool = False  # whether it was done before the sweep was stopped and resumed


NUMBERS: Mapping[str, tuple[str, Callable[[str], float]]] = {
    "min": ("lowest quality", float),
    "mean": ("mean quality", float),
    "inverted": ("inverted cells", int),
    "max_error": ("largest error of the boundary before it is corrected", float),
    "control_nodes": ("control nodes in the last step", int),
    "steps": ("steps made", int),
    "seconds": ("seconds that the worker spent", float),
}
"""The numbers of a result, in the order of their columns: meaning, and how a cell is read."""
WORDS = ("mesh", "warnings", "problem")  # the columns of texts after the numbers of a result
_SEPARATORS = (",", ";", "\t")


def failures(rows: Iterable[DesignRow]) -> dict[str, list[int]]:
    """Return the numbers of the designs that failed, by the reason."""
    return grouped((row.problem, row.design) for row in rows if row.problem)


@frozen
class Design:
    """A row of the table: its number (from 1), its values by column, and its case."""

    number: int
    values: Mapping[str, Value]
    case: Case


@frozen
class Designs:
    """The designs of a table; ``columns`` has the place of a number, or a key, for each column."""

    columns: Mapping[str, NumberPlace | str]
    rows: tuple[Design, ...]


Table = Annotated[
    str | Path | Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]] | Designs,
    "the name of a CSV file, a sequence of designs, or a mapping of names to sequences of values",
]
"""The path of a CSV file; a sequence of designs, each by column names; a mapping of columns; or
what `read_designs` returned."""


def read_designs(case: Case, table: Table) -> Designs:
    """Return the designs of a table, or of the displacement files that a pattern with * matches.

    Raises CaseError if the file cannot be read, a column is unknown, or values are wrong; all
    mistakes are listed, each with its line.
    """
    if isinstance(table, Designs):
        return table
    if isinstance(table, str | Path) and "*" in Path(table).name:
        table = _files_in_time(Path(table))
    elif isinstance(table, str | Path):
        return _read_csv(case, Path(table))
    rows = [{column_name(name): row[name] for name in row} for row in _rows_of(table)]
    names = dict.fromkeys(name for row in rows for name in row)
    columns = columns_of(case, names)
    if not columns or not rows:
        raise CaseError("the table of designs is empty; give at least one column and one row")
    designs = []
    problems = list[Message]()
    for at, row in enumerate(rows, start=1):
        values = {name: _value(row.get(name, "")) for name in names}
        try:
            designs.append(_design(case, columns, at, values))
        except CaseError as problem:
            problems += problem.within(f"design {at}")
    raise_all(problems)
    return Designs(columns, tuple(designs))


def iterations(designs: Designs, time_step: float | None = None) -> dict[int, int]:
    """Return the time iteration of each design, by its number; {} where the table has no times.

    It is the time over the time step, or without one the time itself. Raises CaseError where it is
    no whole number, or two designs have the same.
    """
    if time_step is not None and not time_step > 0.0:
        raise CaseError(f"the time step is {time_step:g}; it must be above 0")
    if TIME not in designs.columns:
        if time_step is not None:
            raise CaseError(f"a time step needs a column {TIME} in the table of designs")
        return {}
    numbers: dict[int, int] = {}
    designs_at: dict[int, int] = {}
    for design in designs.rows:
        time = float(design.values[TIME])
        ratio = time / (time_step or 1.0)
        whole = round(ratio) if isfinite(ratio) else -1
        if whole < 0 or not isclose(ratio, whole, rel_tol=1e-6, abs_tol=1e-6):
            of = f"time steps of {time_step:g}" if time_step else "time steps"
            raise CaseError(
                f"design {design.number}: the time {time:g} is not a whole number of {of}, from 0 "
                "on; give the length of a time step (--time-step, time_step=), or times that fit it"
            )
        if whole in designs_at:
            raise CaseError(
                f"designs {designs_at[whole]} and {design.number} are at time iteration {whole} "
                "both; keep one of them, or give a smaller time step"
            )
        numbers[design.number] = whole
        designs_at[whole] = design.number
    return numbers


def require_distinct_times(designs: Designs) -> None:
    """Raise CaseError where two designs have the same time."""
    designs_at: dict[float, int] = {}
    for design in designs.rows if TIME in designs.columns else ():
        time = float(design.values[TIME])
        if time in designs_at:
            raise CaseError(
                f"designs {designs_at[time]} and {design.number} are at time {time:g} both; keep "
                "one of them"
            )
        designs_at[time] = design.number


def _files_in_time(pattern: Path) -> list[dict[str, Any]]:
    """Return a design for each displacement file that matches, its time the number in its name."""
    rows = []
    for path in sorted(pattern.parent.glob(pattern.name)):
        digits = re.findall(r"\d+", path.stem)
        if not digits:
            raise CaseError(f"{path}: its name has no number, which is its time; rename it")
        row = {TIME: int(digits[-1]), "DEFORMATION_FILENAME": str(path.absolute())}
        rows.append(row)
    if not rows:
        raise CaseError(
            f"{pattern}: there is no such file; give a pattern, e.g. displacement_*.txt"
        )
    return sorted(rows, key=lambda row: row[TIME])


def _rows_of(table: Sequence[Mapping[str, Any]] | Mapping[str, Sequence[Any]]) -> list[Mapping]:
    if not isinstance(table, Mapping):
        return list(table)
    lengths = {name: len(values) for name, values in table.items()}
    if len(set(lengths.values())) > 1:
        message = ", ".join(f"{name} {count}" for name, count in lengths.items())
        raise CaseError(f"the columns have different numbers of values ({message}); give as many")
    return [dict(zip(table, row, strict=True)) for row in zip(*table.values(), strict=True)]


def _value(value: Any) -> Value:
    if isinstance(value, str):
        return value.strip()
    if value is None or value != value:  # what tables of numbers have where there is nothing
        return "" if value is None else float(value)
    return value.item() if hasattr(value, "item") else value


def _read_csv(case: Case, path: Path) -> Designs:
    """Return the designs of a file: a head with the names of the columns, then a row for each.

    Empty lines and lines that begin with ``#`` are ignored; commas, semicolons or tabs separate.
    In a table of results (``results.csv``) the columns of results are ignored.
    """
    text, _ = read_text(path, "table of designs")
    lines = [
        (at, line)
        for at, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise CaseError(
            f"{path}: has no designs; expected a line with the names of the columns, e.g. "
            "BLADE.translate.y, and a line of values for each design"
        )
    (first, head), *rest = lines
    separator = max(_SEPARATORS, key=head.count) if "," not in head else ","
    try:
        words = _split(head, separator)
    except CaseError as problem:
        raise CaseError(f"{path}:{first}: {problem}") from None
    own = design_columns(words)
    names = [column_name(name) for name in words[own]]
    problems = list[Message]()
    try:
        columns = columns_of(case, names)
    except CaseError as problem:
        problems += problem.within(line=first)
        columns = {}  # those with known names, so that mistakes in their values are found, too
        for name in names:
            with suppress(CaseError):
                columns |= columns_of(case, [name])
    designs: list[Design] = []
    for at, (line, content) in enumerate(rest, start=1):
        try:
            cells = [cell.strip() for cell in _split(content, separator)[own]]
            if len(cells) != len(names):
                raise CaseError(
                    f"has {len(cells)} values, and the head {len(names)} columns; give as many"
                )
            row = zip(names, cells, strict=True)
            values: dict[str, Value] = {name: cell for name, cell in row if name in columns}
            designs.append(_design(case, columns, at, values))
        except CaseError as problem:
            problems += problem.within(line=line)
    raise_all(listed(path, problems))
    return Designs(columns, tuple(designs))


def head_of(columns: Iterable[str], words: Sequence[str]) -> list[str]:
    """Return the column titles of a table of results: number, design variables, results."""
    return ["design", *columns, *NUMBERS, *words]


def cells_of(
    number: int,
    values: Iterable[Value],
    row: DesignRow | None,
    words: Sequence[str] = WORDS,
    folder: Path = Path(),
) -> list[object]:
    """Return the cells of a design's row as `head_of`; results are empty if ``row`` is None."""
    result = row or DesignRow(number)
    texts = {
        "mesh": result.mesh and os.path.relpath(result.mesh, folder),
        "limits": result.limits,
        "warnings": "; ".join(result.warnings),
        "problem": result.problem,
    }
    done = row is not None and not row.problem
    numbers = [getattr(result, name) if done else None for name in NUMBERS]
    return [number, *values, *numbers, *(texts[name] for name in words)]


def result_of(head: Sequence[str], cells: Sequence[str], folder: Path) -> DesignRow:
    """Return the result in a line of a table; ValueError if its columns are not ``head``."""
    fields = dict(zip(head, cells, strict=True))  # columns and results differ in name
    numbers: dict[str, Any] = {
        name: read(fields[name]) for name, (_, read) in NUMBERS.items() if fields[name]
    }
    return DesignRow(
        int(fields["design"]),
        **numbers,
        mesh=folder / fields["mesh"] if fields.get("mesh") else None,
        warnings=tuple(fields["warnings"].split("; ")) if fields.get("warnings") else (),
        limits=fields.get("limits", ""),
        problem=fields["problem"],
    )


def design_columns(head: Sequence[str]) -> slice:
    """Return the slice of the design columns; result tables have further columns."""
    at = len(head) - 1
    while at > 0 and list(head[at : at + len(NUMBERS)]) != list(NUMBERS):
        at -= 1
    return slice(1, at) if at > 1 and head[0] == "design" else slice(None)


def _design(
    case: Case, columns: Mapping[str, NumberPlace | str], number: int, values: Mapping[str, Value]
) -> Design:
    """Return a design, with motions' numbers as float; CaseError where values are wrong."""
    made = applied(case, columns, values)
    if TIME in columns:
        try:
            values = {**values, TIME: number_of(values[TIME])}
        except CaseError as problem:
            raise CaseError(f"column {TIME!r}: {problem}") from problem
    plain = {
        name: float(value) if isinstance(columns[name], NumberPlace) and value != "" else value
        for name, value in values.items()
    }
    return Design(number, plain, made)


def _split(line: str, separator: str) -> list[str]:
    """Return the cells of a line of CSV; raise CaseError if it cannot be one."""
    try:
        return csv_rows(line, separator)[0]
    except ValueError as problem:
        raise CaseError(
            f"is not a line of values ({problem}); check its quotation marks"
        ) from problem


RESULTS = "results.csv"
SOURCES = "sweep.json"
LOCK = "sweep.lock"
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # errors of file systems without locks


class SweepResults:
    """The results of a sweep in a folder, which no other sweep writes to until `close`.

    ``sources``: what the results depend on, as `sources_of` returns it.
    """

    def __init__(self, folder: Path, designs: Designs, sources: Mapping[str, str]) -> None:
        self._folder = folder
        self._designs = designs
        self._sources = sources
        self._lock: BaseFileLock | None = None
        limited = any(design.case.limits for design in designs.rows)
        self._words = ("limits", *WORDS) if limited else WORDS
        self._head = head_of(designs.columns, self._words)

    @property
    def path(self) -> Path:
        """Return the path of the table."""
        return self._folder / RESULTS

    def start(self, *, resume: bool, force: bool, meshes: bool) -> list[DesignRow]:
        """Lock the folder; begin the table, or with ``resume`` return the rows that are done.

        Not among them are designs that failed, and with ``meshes`` those whose mesh is missing.
        Raises CaseError if there are results, with neither ``resume`` nor ``force``; or, to be
        resumed, they are of another case, mesh or table; or the table cannot be written; or another
        sweep writes it.
        """
        make_folder(self._folder)
        self._lock = lock_folder(self._folder)
        try:
            return self._started(resume, force, meshes)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Unlock the folder, and remove the file of the lock."""
        if self._lock is not None and self._lock.is_locked:
            if isinstance(self._lock, FileLock):  # the other one removes its file by itself
                with suppress(OSError):
                    Path(self._lock.lock_file).unlink()
            self._lock.release()

    def _started(self, resume: bool, force: bool, meshes: bool) -> list[DesignRow]:
        """Do what `start` does, in the locked folder."""
        if resume and self.path.exists():
            earlier = {row.design: row for row in self._earlier_rows()}
            done = (row for row in earlier.values() if not row.problem)
            return [r for r in done if not meshes or (r.mesh is not None and r.mesh.is_file())]
        if self.path.exists() and not force:
            raise CaseError(
                f"{self.path}: there are results already; continue with --resume (resume=True), "
                f"start again with --force (force=True), or choose another folder"
            )
        text = json.dumps({"slideviz": __version__, **self._sources}, indent=2) + "\n"
        write_whole(self._folder / SOURCES, text, CaseError)
        write_csv(self.path, [self._head], CaseError)
        return []

    def _earlier_rows(self) -> list[DesignRow]:
        """Return the rows of the table; CaseError where they are of another sweep.

        A last line that was cut off when the sweep was stopped is removed from the file.
        """
        self._require_same_sources()
        try:
            data = self.path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
            if len(whole) < len(data):
                os.truncate(self.path, len(whole))
        except OSError as problem:
            raise CaseError(f"{self.path}: cannot be read: {reason_of(problem)}") from problem
        try:
            head, *lines = csv_rows(whole.decode("utf-8", "replace")) or [[]]
        except ValueError as problem:
            raise CaseError(
                f"{self.path}: is not a table of a sweep ({problem}); {_REMEDY}"
            ) from None
        if head != self._head:
            names = ", ".join(head[design_columns(head)])
            raise CaseError(
                f"{self.path}: has other columns ({names}) than the table of designs "
                f"({', '.join(self._designs.columns)}); {_REMEDY}"
            )
        return [self._row(at, line) for at, line in enumerate(lines, start=2)]

    def add(self, row: DesignRow) -> None:
        """Append a row to the table, by one write.

        Raises CaseError if the table cannot be written.
        """
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(csv_text([self._cells(row)]).encode())
        except OSError as problem:
            raise CaseError(f"{self.path}: cannot be written: {reason_of(problem)}") from problem

    def sort(self, rows: Iterable[DesignRow]) -> None:
        """Write the table anew, in the order of the designs, each once."""
        last = {row.design: row for row in rows}
        rows_in_order = (self._cells(last[number]) for number in sorted(last))
        write_csv(self.path, [self._head, *rows_in_order], CaseError)

    def _cells(self, row: DesignRow) -> list[object]:
        """Return the cells of a row, each in one line, so that a line cut off is known as such."""
        warnings = tuple(" ".join(text.split()) for text in row.warnings)
        plain = replace(row, problem=" ".join(row.problem.split()), warnings=warnings)
        values = [row.values[name] for name in self._designs.columns]
        return cells_of(row.design, values, plain, self._words, self._folder)

    def _row(self, line: int, cells: Sequence[str]) -> DesignRow:
        """Return the row of a line; CaseError where the design of that number is another."""
        try:
            row = result_of(self._head, cells, self._folder)
        except ValueError:
            raise CaseError(
                f"{self.path}:{line}: is not a row of a sweep; remove the line, or {_REMEDY}"
            ) from None
        rows = self._designs.rows
        values = dict(zip(self._designs.columns, cells[1:], strict=False))
        if not 1 <= row.design <= len(rows):
            raise CaseError(
                f"{self.path}:{line}: has design {row.design}, and the table of designs has "
                f"{len(rows)}; {_REMEDY}"
            )
        for name, value in values.items():
            now = rows[row.design - 1].values[name]
            if not _means_same(value, now):
                raise CaseError(
                    f"{self.path}:{line}: design {row.design} was made with {name}= "
                    f"{value or '(the value of the case)'}, and the table of designs has "
                    f"{now or '(the value of the case)'} now; {_REMEDY}"
                )
        return replace(row, values=rows[row.design - 1].values, earlier=True)

    def _require_same_sources(self) -> None:
        """Raise CaseError where the results in the folder depend on something else."""
        path = self._folder / SOURCES
        try:
            before = read_json(path)
            if not isinstance(before, dict) or not all(isinstance(x, str) for x in before.values()):
                raise ValueError
        except (OSError, ValueError):
            raise CaseError(
                f"{path}: is missing or not readable, so that it is unknown what {self.path} was "
                f"made of; {_REMEDY}"
            ) from None
        before.pop("slideviz", None)
        now = self._sources
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        if not changed:
            return
        message = "; ".join(
            f"{key}= {_short(before.get(key))} before, {_short(now.get(key))} now"
            if key in KEYS
            else f"the {key} changed"
            for key in changed
        )
        raise CaseError(f"{self.path}: was made from other input: {message}; {_REMEDY}")


_REMEDY = "choose another folder, or start again with --force (force=True)"


def lock_folder(folder: Path) -> BaseFileLock:
    """Return the lock of a folder, held: two sweeps would write over each other's results.

    The system frees it however the process ends; where a network's file system has no locks, the
    file itself is the lock, and counts for nothing once its process has ended. Raises CaseError if
    another sweep has the lock, or its file cannot be written.
    """
    path = folder / LOCK
    try:
        with suppress(FileNotFoundError):
            require_regular_file(path, CaseError)
        try:
            lock: BaseFileLock = FileLock(path, thread_local=False, fallback_to_soft=False)
            lock.acquire(blocking=False)
            with suppress(PermissionError):  # of Windows, where nobody writes a locked file
                path.write_text(f"{os.getpid()}\n")
        except OSError as problem:
            if problem.errno not in _NO_LOCKS:
                raise
            if not path.stat().st_size:  # made just now, by the attempt
                path.unlink()
            lock = SoftFileLock(path, thread_local=False)
            lock.acquire(blocking=False)
    except Timeout:
        number = ""
        with suppress(OSError):
            number = path.read_text(errors="replace").partition("\n")[0]
        who = f"process {number}" if number else "another process"
        raise CaseError(
            f"{folder}: another sweep writes its results here ({who}); wait for its end, or "
            "choose another folder"
        ) from None
    except OSError as problem:
        raise CaseError(f"{path}: cannot be written: {reason_of(problem)}") from problem
    return lock


def sources_of(case: Case, mesh: Mesh | None) -> dict[str, str]:
    """Return the digests by name, and keys as text, that the results of a case depend on.

    A mesh that is None stays in its file, which counts by its size and its time of change.
    """
    written = tuple(motion for motion in case.motions if motion.verb)
    plain = effective(case.change(motions=written))
    if mesh is None:
        assert case.mesh_file is not None
        state = case.mesh_file.stat()
        found = {"mesh": f"{state.st_size} bytes, {state.st_mtime_ns}"}
    else:
        parts = [(marker.name.encode(), marker.cells.connectivity) for marker in mesh.markers]
        cells = mesh.cells
        found = {"mesh": _digest(mesh.points, cells.types, cells.connectivity, *chain(*parts))}
    if mesh is not None and box_motions(case):
        boxes = boxes_of(mesh, system_of(case))
        found["FFD_TAG section of the mesh"] = _digest(pickle.dumps(boxes))
    arrays = (motion.content for motion in case.motions if motion.content)
    for at, content in enumerate(arrays, start=1):
        found[f"displacement {at}"] = _digest(*content)
    for path in (path for motion in written for path in motion.files):
        try:
            found[f"file {path.name}"] = _digest(path.read_bytes())
        except OSError:
            found[f"file {path.name}"] = "not readable"
    for key in KEYS.values():
        value = key.get(plain) if key.group not in (FILES, VIEW) else None
        if value is not None and key.name != "DEFORMATION_FILENAME":
            found[key.name] = " ".join(key.kind.write(value).split())
    return found


def _digest(*parts: Any) -> str:
    digest = blake2b(digest_size=16)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _means_same(text: str, value: Value) -> bool:
    """Return whether a cell's text means a value: the same text, or the same number."""
    if text == str(value):
        return True
    try:
        return float(text) == float(value)
    except ValueError:
        return False


def _short(text: str | None) -> str:
    if text is None:
        return "nothing"
    return text if len(text) <= 60 else f"{text[:57]}..."
