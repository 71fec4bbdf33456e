"""Checks of files: only ordinary ones are read, and no input is written over unasked.

A pipe may never come to an end, and a device gives bytes without end.

Whoever runs the work (a command, a window) says which files are its inputs; whatever writes asks
here first. The same file may have many names: by links, by ``./``, by another folder.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from slideviz.errors import SlidevizError
from slideviz.mesh.check import printable

Inputs = Mapping[Path, str]
"""What each file is, in words: ``the input mesh``."""
_known: list[Callable[[], Inputs]] = []


@contextmanager
def protected(inputs: Callable[[], Inputs]) -> Iterator[None]:
    """Return a context in which these files are written over only where that was asked for."""
    _known.append(inputs)
    try:
        yield
    finally:
        _known.remove(inputs)


def require_no_input(
    path: Path, error: type[SlidevizError], replaces: Path | None = None, remedy: str = ""
) -> None:
    """Raise when a file that is to be written is an input.

    Parameters
    ----------
    path : Path
        The file that is to be written.
    error : type of SlidevizError
        The class of error to raise.
    replaces : Path, optional
        The input that may be written over.
    remedy : str
        What helps; to choose another name when left out.

    Raises
    ------
    SlidevizError
        It is an input.
    """
    if replaces is not None and same_file(path, replaces):
        return
    for inputs in _known:
        for other, what in inputs().items():
            if same_file(path, other):
                named = "" if str(path) == str(other) else f" ({other})"
                raise error(f"{path} is {what}{named}; {remedy or 'choose another name'}")


def same_file(path: Path, other: Path) -> bool:
    """Tell whether two names are of one file, which need not exist yet."""
    if os.path.realpath(path) == os.path.realpath(other):
        return True
    try:
        return path.samefile(other)
    except (OSError, ValueError):  # one is not there, so they cannot be one by a hard link
        return False


def require_ordinary(path: Path, error: type[SlidevizError]) -> int:
    """Return how many bytes an ordinary file has, without opening it: some devices act on that.

    Raises
    ------
    SlidevizError
        It is a device or a pipe; ``error`` is the class.
    OSError, ValueError
        There is none, or it is a folder.
    """
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(found.st_mode):
        raise error(f"{printable(path)}: this is a device or pipe; choose an ordinary file")
    return found.st_size


def require_length(path: Path, error: type[SlidevizError], what: str, most: int) -> None:
    """Check a file as `require_ordinary`, and that it has so many bytes at most.

    ``what`` is the kind of file, for the message: ``case file``.
    """
    size = require_ordinary(path, error)
    if size > most:
        raise error(
            f"{printable(path)}: has {size / 1e6:,.0f} MB, and no {what} has more than "
            f"{most / 1e6:,.0f} MB; check the name"
        )
