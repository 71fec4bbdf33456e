"""Changes of a list given as a tuple: the list with another row, or with one less."""

from __future__ import annotations

from typing import TypeVar

Row = TypeVar("Row")


def replaced(rows: tuple[Row, ...], index: int, row: Row) -> tuple[Row, ...]:
    """Return the rows with another one at the place ``index``."""
    changed = list(rows)
    changed[index] = row
    return tuple(changed)


def without(rows: tuple[Row, ...], index: int) -> tuple[Row, ...]:
    """Return the rows without the one at the place ``index``."""
    return rows[:index] + rows[index + 1 :]
