"""Tables as comma-separated values (CSV)."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from io import StringIO, TextIOWrapper
from pathlib import Path
from typing import TextIO

from slideviz.errors import SlidevizError
from slideviz.system.atomic import atomic_write


def csv_text(rows: Iterable[Sequence[object]], delimiter: str = ",") -> str:
    """Return rows of cells as CSV: numbers with all digits, None and NaN as empty cells."""
    out = StringIO()
    _write(out, rows, delimiter)
    return out.getvalue()


def write_csv(
    path: Path, rows: Iterable[Sequence[object]], error: type[SlidevizError] = SlidevizError
) -> None:
    """Write rows of cells to a CSV file, whole or not at all, or raise an ``error``."""
    with atomic_write(path, error) as file:
        text = TextIOWrapper(file, "utf-8", newline="", write_through=True)
        _write(text, rows, ",")
        text.detach()


def _write(file: TextIO, rows: Iterable[Sequence[object]], delimiter: str) -> None:
    writer = csv.writer(file, delimiter=delimiter, lineterminator="\n")
    # NaN alone does not equal itself.
    writer.writerows(["" if c is None or c != c else c for c in row] for row in rows)


def csv_rows(text: str, delimiter: str = ",") -> list[list[str]]:
    """Return the cells of each line of CSV; spaces after a separator are left out.

    Raises ValueError if a cell is longer than the 131,072 characters that Python reads.
    """
    try:
        lines = StringIO(text, newline="")
        return list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    except csv.Error as problem:
        raise ValueError(str(problem)) from problem
