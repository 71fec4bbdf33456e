"""Checks of files: only ordinary ones are read, and no input is overwritten unless that was asked.

A pipe may never come to an end, and a device gives bytes without end.

A command or window declares its input files (`protected`), and each writer calls
`require_no_input`. Files are compared and not names: links, ``./`` and other paths give one file
many names.
"""

from __future__ import annotations

import errno
import json
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from slideviz.errors import SlidevizError, printable

Inputs = Mapping[Path, str]  # input files, and what each is in words: ``the input mesh``
_known: list[Callable[[], Inputs]] = []
"""Functions that return input files: those of `protected` contexts that are open."""


@contextmanager
def protected(inputs: Callable[[], Inputs]) -> Iterator[None]:
    """Context in which `require_no_input` refuses to overwrite files that ``inputs`` returns."""
    _known.append(inputs)
    try:
        yield
    finally:
        _known.remove(inputs)


def require_no_input(
    path: Path, error: type[SlidevizError], replaces: Path | None = None, remedy: str = ""
) -> None:
    """Raise if a file that is to be written is an input, declared by `protected`.

    Raises SlidevizError if it is an input other than ``replaces``.
    ``path``: the file that is to be written.
    ``error``: the class of error to raise.
    ``replaces``: the input that may be overwritten.
    ``remedy``: the remedy in the message; to choose another name when left out.
    """
    if replaces is not None and same_file(path, replaces):
        return
    for inputs in _known:
        for other, what in inputs().items():
            if same_file(path, other):
                named = "" if str(path) == str(other) else f" ({other})"
                raise error(f"{path} is {what}{named}; {remedy or 'choose another name'}")


def same_file(path: Path, other: Path) -> bool:
    """Return whether two paths lead to the same file, which need not exist yet."""
    if os.path.realpath(path) == os.path.realpath(other):
        return True
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # one is not there, so they cannot be one by a hard link
        return False


def require_regular_file(path: Path, error: type[SlidevizError]) -> int:
    """Return the size in bytes of an ordinary file, without opening it: some devices react to that.

    Raises SlidevizError if it is a device or a pipe; ``error`` is the class; and OSError or
    ValueError if there is no such file, or it is a folder.
    """
    status = path.stat()
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(status.st_mode):
        raise error(f"{printable(path)}: this is a device or pipe; choose an ordinary file")
    return status.st_size


def read_json(path: Path) -> Any:
    """Return the content of a JSON file, or raise OSError or ValueError."""
    try:
        return json.loads(path.read_bytes())
    except RecursionError as problem:
        raise ValueError("nested too deep") from problem


def require_length(path: Path, error: type[SlidevizError], what: str, most: int) -> None:
    """Raise as `require_regular_file`, or if a ``what`` has more than ``most`` bytes."""
    size = require_regular_file(path, error)
    if size > most:
        raise error(
            f"{printable(path)}: has {size / 1e6:,.0f} MB, and no {what} has more than "
            f"{most / 1e6:,.0f} MB; check the name"
        )
