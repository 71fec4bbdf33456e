"""The table of a sweep: designs, each of which becomes a case, and their results.

It is given as values, or read from CSV; with results it is written as CSV.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import isclose, isfinite, nan
from pathlib import Path
from typing import Annotated, Any

from slideviz.case.lines import listed, read_text
from slideviz.case.model import Case
from slideviz.design.sweeps.columns import (
    TIME,
    NumberPlace,
    Value,
    applied,
    column_name,
    columns_of,
    number_of,
)
from slideviz.errors import CaseError, Message, raise_all
from slideviz.system.csv_table import csv_rows


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Design:
    """A row of the table: its number (from 1), its values by column, and its case."""

    number: int
    values: Mapping[str, Value]
    case: Case


@dataclass(frozen=True)
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
    lines = _filled_lines(text)
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
        columns = _known_columns(case, names)
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


def head_of(columns: Iterable[str], words: Sequence[str] = WORDS) -> list[str]:
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


def result_of(head: Sequence[str], cells: Sequence[str], folder: Path = Path()) -> DesignRow:
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


def _known_columns(case: Case, names: Iterable[str]) -> dict[str, NumberPlace | str]:
    """Return the columns with known names, so that mistakes in their values are found, too."""
    columns: dict[str, NumberPlace | str] = {}
    for name in names:
        with suppress(CaseError):
            columns |= columns_of(case, [name])
    return columns


def _design(
    case: Case, columns: Mapping[str, NumberPlace | str], number: int, values: Mapping[str, Value]
) -> Design:
    """Return a design, with motions' numbers as float; CaseError where values are wrong."""
    made = applied(case, columns, values)
    if TIME in columns:
        values = {**values, TIME: _time(values[TIME])}
    plain = {
        name: float(value) if isinstance(columns[name], NumberPlace) and value != "" else value
        for name, value in values.items()
    }
    return Design(number, plain, made)


def _time(value: Value) -> float:
    try:
        return number_of(value)
    except CaseError as problem:
        raise CaseError(f"column {TIME!r}: {problem}") from problem


def _filled_lines(text: str) -> list[tuple[int, str]]:
    return [
        (at, line)
        for at, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _split(line: str, separator: str) -> list[str]:
    """Return the cells of a line of CSV; raise CaseError if it cannot be one."""
    try:
        return csv_rows(line, separator)[0]
    except ValueError as problem:
        raise CaseError(
            f"is not a line of values ({problem}); check its quotation marks"
        ) from problem
