"""The table of a comparison: as CSV, and as lines for a terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from slideviz.errors import CaseError
from slideviz.study.combinations import CombinationRow, Result
from slideviz.system import csv_table
from slideviz.system.atomic import atomic_write

Value = str | int | float


@dataclass(frozen=True)
class StudyColumn:
    """A column of the table."""

    meaning: str
    value: Callable[[Result], Value]
    """Returns the value of a result."""
    head: str = ""
    form: str = ""
    """`head`, `form`: head and format on a terminal; columns with an empty head are not shown
    there."""


COLUMNS: Mapping[str, StudyColumn] = {
    "steps_made": StudyColumn(
        "steps made, which STEPS= auto chooses", lambda r: r.steps, "steps", "d"
    ),
    "min": StudyColumn("lowest quality", lambda r: r.quality.min, "min", ".6f"),
    "mean": StudyColumn("mean quality", lambda r: r.quality.mean, "mean", ".6f"),
    "inverted": StudyColumn("inverted cells", lambda r: r.quality.inverted, "inverted", "d"),
    "unproven": StudyColumn(
        "cells neither proved valid nor inverted", lambda r: r.quality.unproven
    ),
    "control_nodes": StudyColumn(
        "control nodes in the last step", lambda r: r.control_nodes, "control nodes", "d"
    ),
    "max_error": StudyColumn(
        "largest error of a boundary node before it is corrected, of all steps, in the mesh's "
        "length unit",
        lambda r: r.max_error,
        "max error",
        ".1e",
    ),
    "condition": StudyColumn("largest condition number of a system", lambda r: r.condition),
    "seconds": StudyColumn(
        "time of the deformation by the clock, classification included",
        lambda r: r.seconds,
        "seconds",
        ".3f",
    ),
    "processor_seconds": StudyColumn(
        "the same, of all processors together", lambda r: r.processor_seconds
    ),
}
"""The columns of ``compare.csv`` between `KEY_COLUMNS` and the last one, ``problem``."""

KEY_COLUMNS = ("method", "periodic", "steps")


def csv_text(rows: Sequence[CombinationRow]) -> str:
    """Return the table as CSV; numbers with all their digits, empty cells without a result."""
    lines: list[list[object]] = [[*KEY_COLUMNS, *COLUMNS, "problem"]]
    for row in rows:
        tried, result = row.combination, row.result
        values = [None if result is None else c.value(result) for c in COLUMNS.values()]
        lines.append([tried.method, tried.periodic, tried.steps or "auto", *values, row.problem])
    return csv_table.csv_text(lines)


def history_text(rows: Sequence[CombinationRow]) -> str:
    """Return the convergence of the greedy selections as CSV, a line for each cycle."""
    columns = ("step", "cycle", "level", "error", "control_nodes", "seconds")
    lines: list[list[object]] = [[*KEY_COLUMNS, *columns]]
    for row in rows:
        tried = row.combination
        for step, cycle in row.result.history if row.result else ():
            values = [getattr(cycle, name) for name in columns[1:]]
            lines.append([tried.method, tried.periodic, tried.steps or "auto", step, *values])
    return csv_table.csv_text(lines)


def save_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Raises CaseError if the file cannot be written.
    """
    with atomic_write(path, CaseError) as file:
        file.write(text.encode())


def terminal_head() -> str:
    """Return the line above the rows on a terminal."""
    shown = [_cell(column.head, column) for column in COLUMNS.values() if column.head]
    return "  ".join([f"{'method':<7} {'periodic':<8}", *shown])


def terminal_line(row: CombinationRow, given: list[str] | None = None) -> str:
    """Return a row for a terminal; the reason where there is no result.

    ``given`` are the reasons written so far, and a new one is appended: a reason is written once,
    and later as its number.
    """
    tried = row.combination
    begin = f"{tried.method:<7} {tried.periodic:<8}"
    if row.result is None:
        steps = _cell(str(tried.steps or "auto"), COLUMNS["steps_made"])
        return f"{begin}  {steps}  not possible {_reason(row.problem, given)}"
    shown = [
        _cell(format(column.value(row.result), column.form), column)
        for column in COLUMNS.values()
        if column.head
    ]
    return "  ".join([begin, *shown])


def _reason(problem: str, given: list[str] | None) -> str:
    """Return the number of a reason in ``given``, with the reason itself if it is new."""
    given = [] if given is None else given
    if problem in given:
        return f"[{given.index(problem) + 1}]"
    given.append(problem)
    return f"[{len(given)}]: {' '.join(problem.split())}"


def _cell(text: str, column: StudyColumn) -> str:
    return text.rjust(max(len(column.head), 8 if column.form.endswith("f") else 5))
