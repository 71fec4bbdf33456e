"""The table of designs in the window: a text for each value, and the results so far."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.keys import FILES, KEYS, MOTION, VIEW
from slideviz.case.limits import MET
from slideviz.case.model import Case
from slideviz.case.words import counted, is_number
from slideviz.design.sweeps.table import (
    DesignRow,
    case_values,
    cells_of,
    columns_of,
    failures,
    head_of,
    numbers_of,
    read_designs,
)
from slideviz.errors import CaseError
from slideviz.system.csv_table import write_csv
from slideviz.terms import Texts

MOST = 100_000  # most designs of a table in the window
FINE = 1e-5  # rounding error allowed for the values of a range, over the step between them
_WORDS = ("problem",)
_NAMED = 5  # most designs that are named of those that failed for the same reason
_RANGE = re.compile(r"(\S+)\s*(?:to|\.\.)\s*(\S+)\s*(?:in|:)\s*(\d+)\Z", re.IGNORECASE)


@frozen
class DesignTable:
    """A table of designs and their results."""

    columns: Texts = ()  # their names, as `slideviz.sweep` takes them
    rows: tuple[Texts, ...] = ()  # the values of each design, a text for each column
    results: Mapping[int, DesignRow] = field(default_factory=dict)
    """By the number of the design, from 1."""

    def crossed(self, column: str, values: Iterable[str]) -> DesignTable:
        """Return the table with each design once for each of ``values`` in a column, and no result.

        Where there is a column of that name, its designs stay, and those that are new follow.
        Raises CaseError if there would be too many designs.
        """
        there = column in self.columns
        columns = self.columns if there else (*self.columns, column)
        at = columns.index(column)
        others = dict.fromkeys((row[:at], row[at + 1 :]) for row in self.rows) or [((), ())]
        numbers = list(values)
        count = len(others) * len(numbers) + there * len(self.rows)
        if count > MOST:
            raise CaseError(f"{count:,} designs exceed the limit of {MOST:,}")
        rows = [(*left, value, *right) for left, right in others for value in numbers]
        return DesignTable(columns, tuple(dict.fromkeys((*self.rows, *rows)) if there else rows))

    def with_cell(self, row: int, column: int, text: str) -> DesignTable:
        """Return the table with another value in a cell, and without the result of that design."""
        cells = list(self.rows[row])
        cells[column] = text.strip()
        rows = (*self.rows[:row], tuple(cells), *self.rows[row + 1 :])
        results = {number: one for number, one in self.results.items() if number != row + 1}
        return replace(self, rows=rows, results=results)

    def without(self, rows: Iterable[int]) -> DesignTable:
        """Return the table without some rows; results move with their designs."""
        gone = set(rows)
        left = [at for at in range(len(self.rows)) if at not in gone]
        results = {
            new: replace(self.results[old + 1], design=new)
            for new, old in enumerate(left, start=1)
            if old + 1 in self.results
        }
        kept = tuple(self.rows[at] for at in left)
        return DesignTable(self.columns if kept else (), kept, results)

    def with_results(self, rows: Iterable[DesignRow]) -> DesignTable:
        """Return the table with added results; ``rows`` have the numbers of their designs."""
        more = {row.design: row for row in rows}
        return replace(self, results={**self.results, **more})

    def keeping(self, other: DesignTable) -> DesignTable:
        """Return the table with the results that ``other`` has of designs with the same values."""
        if sorted(self.columns) != sorted(other.columns):
            return self
        at = [other.columns.index(name) for name in self.columns]
        known = {
            tuple(other.rows[number - 1][k] for k in at): row
            for number, row in other.results.items()
        }
        return self.with_results(
            replace(known[values], design=number)
            for number, values in enumerate(self.rows, start=1)
            if values in known
        )

    def count_done(self) -> int:
        """Return the number of designs that have a result and did not fail."""
        return sum(not row.problem for row in self.results.values())

    def filled(self, case: Case | None) -> DesignTable:
        """Return the table with values of ``case``, that of the results, in all empty cells.

        Unchanged where ``case`` is None, or there are no results.
        """
        if case is None or not self.results or all(map(all, self.rows)):
            return self
        values = case_values(case, columns_of(case, self.columns))
        texts = {name: value_text(value) for name, value in values.items()}
        rows = (zip(self.columns, row, strict=True) for row in self.rows)
        return replace(self, rows=tuple(tuple(c or texts[name] for name, c in row) for row in rows))

    def without_results(self) -> DesignTable:
        """Return the table without any result."""
        return replace(self, results={})

    def left(self, case: Case | None, now: Case | None) -> DesignTable:
        """Return the table without the results that are to be computed again.

        Those of failed designs; all where the case ``now`` would give others than ``case``, with
        which they were computed.
        """
        if case is None or now is None or _settings(case) != _settings(now):
            return self.without_results()
        done = (row for row in self.results.values() if not row.problem)
        return self.without_results().with_results(done)

    def unsaved(self, busy: bool, saved: DesignTable | None) -> str:
        """Return a sentence on what would be lost with the table; "" if nothing.

        ``busy`` is whether the designs are being run, ``saved`` the table that was saved last.
        """
        done = len(self.results)
        count = len(self.rows)
        if busy:
            so_far = f"{done:,} of {counted(count, 'design')} done"
            return f"The sweep still runs ({so_far}) and will be stopped."
        if not done or self is saved:
            return ""
        return f"The table of designs, {done:,} with results, is not saved."

    def designs(self) -> list[dict[str, str]]:
        """Return the designs, as `slideviz.sweep` takes them."""
        return [dict(zip(self.columns, row, strict=True)) for row in self.rows]

    def summary(self) -> str:
        """Return the results in words: counts, and a line for each reason why designs failed."""
        done = self.count_done()
        bad = sum(row.inverted > 0 for row in self.results.values())
        reasons = failures([self.results[number] for number in sorted(self.results)])
        failed = len(self.results) - done
        parts = [f"{counted(done, 'design')} done"]
        missing = sum(bool(row.limits.removesuffix(MET)) for row in self.results.values())
        words = ((failed, "failed"), (bad, "with inverted cells"), (missing, "that miss limits"))
        parts += [f"{count:,} {what}" for count, what in words if count]
        lines = [f"{_named(numbers)}: {reason}" for reason, numbers in reasons.items()]
        return "\n".join(["; ".join(parts), *lines])


def _named(numbers: list[int]) -> str:
    """Return words for designs by their numbers, the first ones of many: "Designs 1, 2"."""
    first = ", ".join(map(str, numbers[:_NAMED]))
    more = f" and {len(numbers) - _NAMED:,} more" if len(numbers) > _NAMED else ""
    return f"{'Design' if len(numbers) == 1 else 'Designs'} {first}{more}"


def _settings(case: Case) -> Case:
    return case.change(mesh_out=None, source=None, warnings=(), view={})


def column_choices(case: Case, dim: int) -> dict[str, str]:
    """Return the possible columns, with their values in the case: numbers of motions, then keys.

    In 2D numbers without effect are left out: those of axes, and components along z.
    """
    numbers = {
        name: place
        for name, place in numbers_of(case).items()
        if dim == 3 or not (place.field == "axis" or place.component == 2)
    }
    keys = {
        name: name
        for name, key in KEYS.items()
        if key.group not in (FILES, VIEW, MOTION) and key.get(case) is not None
    }
    values = case_values(case, {**numbers, **keys})
    return {name: value_text(value) for name, value in values.items()}


def values_of(text: str) -> list[str]:
    """Return the values that a text lists: ``-8 to 0 in 9``, or ``1, 2, 5``.

    Raises CaseError if a value is missing, or the range has wrong numbers.
    """
    match = _RANGE.match(text.strip())
    if match is None:
        words = [word.strip() for word in text.split(",")]
        parts = text.split(":")
        if not all(words) or (len(parts) > 1 and all(is_number(part.strip()) for part in parts)):
            raise CaseError(
                f"“{text.strip()}” is neither values, such as 1, 2, 5, nor a range “a to b in n”, "
                f"such as -8 to 0 in 9"
            )
        return list(dict.fromkeys(words))
    first, last, count = match.groups()
    if not (is_number(first) and is_number(last)) or not 2 <= int(count) <= MOST:
        raise CaseError(
            "A range has two numbers and the number of its values, such as -8 to 0 in 9"
        )
    values = np.linspace(float(first), float(last), int(count))
    step = abs(values[1] - values[0])
    for decimals in range(18):  # no more digits than needed: not 0.30000000000000004
        texts = [format(round(value, decimals), ".15g") for value in values.tolist()]
        if max(abs(float(text) - v) for text, v in zip(texts, values, strict=True)) <= FINE * step:
            return texts
    return [repr(value) for value in values.tolist()]


def value_text(value: str | float) -> str:
    """Return a value as text, as short as possible without loss."""
    if isinstance(value, str):
        return value
    short = format(value, ".12g")
    return short if float(short) == value else repr(value)


def read_table(case: Case, path: Path) -> DesignTable:
    """Return the table of designs in a CSV file, whose columns and values must fit the case.

    Raises CaseError if the file cannot be read, has mistakes, or more designs than the window
    allows.
    """
    designs = read_designs(case, path)
    if len(designs.rows) > MOST:
        raise CaseError(f"{path}: has {len(designs.rows):,} designs; use `slideviz sweep` for them")
    columns = tuple(designs.columns)
    rows = tuple(
        tuple(value_text(design.values[name]) for name in columns) for design in designs.rows
    )
    return DesignTable(columns, rows)


def write_results(path: Path, table: DesignTable) -> None:
    """Write designs and results as CSV, a row for each design.

    Raises CaseError if the file cannot be written.
    """
    lines = [
        cells_of(number, values, table.results.get(number), _WORDS)
        for number, values in enumerate(table.rows, start=1)
    ]
    write_csv(path, [head_of(table.columns, _WORDS), *lines], CaseError)
