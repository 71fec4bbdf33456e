"""Rows of a list that does not change: the same list with another row, or with one less."""

from __future__ import annotations

from typing import TypeVar

Row = TypeVar("Row")


def replaced(rows: tuple[Row, ...], index: int, row: Row) -> tuple[Row, ...]:
    """Return the rows with another one at that place."""
    changed = list(rows)
    changed[index] = row
    return tuple(changed)


def without(rows: tuple[Row, ...], index: int) -> tuple[Row, ...]:
    """Return the rows without the one at that place."""
    return rows[:index] + rows[index + 1 :]
