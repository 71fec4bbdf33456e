"""The commands of ``commands.toml``: the arguments of each, added to a parser, and its help.

This module loads neither NumPy nor the commands, so that help is quick.
"""

from __future__ import annotations

from argparse import ArgumentTypeError, _ActionsContainer
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

from slideviz import terms
from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.cli import argument_readers
from slideviz.errors import CaseError
from slideviz.formats.table import own_endings
from slideviz.system.tables import table_beside

Read = TypeVar("Read")


@dataclass(frozen=True)
class Command:
    """A command, which ``main`` in the module ``NAME_command`` does."""

    help: str  # its line in the list of commands
    arguments: tuple[Any, ...] = ()  # their rows in the table
    description: str | None = None
    epilog: str | None = None
    examples: str = ""  # instead of an epilog, its lines as they are
    holds: bool = False
    """Whether notes and warnings wait until nothing can be refused any more."""
    compiles: bool = True  # whether it may compile loops, and says so


_WORDS = {
    "series": own_endings("series"),
    "quality": own_endings("quality"),
    "shapes": names(),
}
"""What the texts of the table have in braces."""
_TYPES: dict[str, Callable[[str], Any]] = {
    "Path": Path,
    "int": int,
    "float": float,
    "lower": str.lower,
}
_TABLE = table_beside(__file__)
_SHARED = _TABLE.pop("shared")
COMMANDS = {
    name: Command(**row | {"help": row["help"].format(**_WORDS)}) for name, row in _TABLE.items()
}


def add_arguments(parser: _ActionsContainer, rows: Iterable[Any]) -> None:
    """Add arguments to a parser, by their rows in the table."""
    for row in rows:
        if row == "shapes":
            _add_shapes(parser)
        elif isinstance(row, str):
            _add(parser, **_SHARED[row])
        elif "one_of" in row:
            group = parser.add_mutually_exclusive_group(required=row.get("required", False))
            add_arguments(group, row["one_of"])
        else:
            _add(parser, **row)


def _add(parser: _ActionsContainer, flags: str, help: str, **facts: Any) -> None:  # noqa: A002
    if read := facts.get("type"):
        facts["type"] = _TYPES.get(read) or _checked(getattr(argument_readers, read))
    if isinstance(facts.get("choices"), str):
        facts["choices"] = tuple(vars(terms)[facts["choices"]])
    if facts.get("action") == "append":
        facts["default"] = []
    elif isinstance(facts.get("default"), list):
        facts["default"] = tuple(facts["default"])
    parser.add_argument(*flags.split(), help=help.format(**_WORDS), **facts)


def _add_shapes(parser: _ActionsContainer) -> None:
    """Add an option for each shape of sections."""
    for name, row in SECTION_SHAPES.items():
        read = _checked(argument_readers.section_reader(row))
        metavar = row.metavar or name.upper()
        parser.add_argument(f"--{name}", type=read, metavar=metavar, help=row.option, dest="asked")


def _checked(read: Callable[[str], Read]) -> Callable[[str], Read]:
    """Return ``read``, whose CaseError means wrong usage."""

    @wraps(read)
    def checked(text: str) -> Read:
        try:
            return read(text)
        except CaseError as problem:
            raise ArgumentTypeError("; ".join(map(str, problem.messages))) from None

    return checked
