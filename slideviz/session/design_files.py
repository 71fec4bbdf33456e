"""Reading and writing tables of designs as CSV files, without and with results."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

from slideviz.case.model import Case
from slideviz.design.sweeps.designs import own_columns, read_designs
from slideviz.design.sweeps.row import NUMBERS, DesignRow
from slideviz.errors import CaseError
from slideviz.session.design_table import MOST, DesignTable, shown
from slideviz.system.atomic import atomic_write


def read_table(case: Case, path: Path) -> DesignTable:
    """Return the table of designs in a CSV file, whose columns and values must fit the case.

    Raises
    ------
    CaseError
        The file cannot be read, has mistakes, or more designs than the window allows.
    """
    found = read_designs(case, path)
    if len(found.rows) > MOST:
        raise CaseError(f"{path}: has {len(found.rows):,} designs; use `slideviz sweep` for them")
    columns = tuple(found.columns)
    rows = tuple(tuple(shown(design.values[name]) for name in columns) for design in found.rows)
    return DesignTable(columns, rows)


def write_results(path: Path, table: DesignTable) -> None:
    """Write designs and results as CSV, a row for each design.

    Raises
    ------
    CaseError
        The file cannot be written.
    """
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["design", *table.columns, *NUMBERS, "problem"])
    for number, values in enumerate(table.rows, start=1):
        row = table.results.get(number)
        done = row is not None and not row.problem
        numbers = [getattr(row, name) if done else "" for name in NUMBERS]
        writer.writerow([number, *values, *numbers, row.problem if row is not None else ""])
    with atomic_write(path, CaseError) as file:
        file.write(out.getvalue().encode())


def read_results(path: Path) -> DesignTable:
    """Return the table that `write_results` wrote, with its results.

    Raises
    ------
    CaseError
        The file cannot be read, or is no table of results.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            head, *lines = csv.reader(file)
        own, found = own_columns(head), list[DesignRow]()
        for number, cells in enumerate(lines, start=1):
            row = dict(zip(head, cells, strict=True))
            numbers = {name: read(row[name]) for name, (_, read) in NUMBERS.items() if row[name]}
            if numbers or row["problem"]:
                found.append(DesignRow(number, **numbers, problem=row["problem"]))  # type: ignore[arg-type]
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as problem:
        raise CaseError(f"{path}: is no table of results ({problem})") from problem
    return DesignTable(tuple(head[own]), tuple(tuple(c[own]) for c in lines)).with_results(found)
