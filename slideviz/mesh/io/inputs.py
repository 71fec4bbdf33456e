"""What is read must not be written over unasked: the one place that knows and compares both.

Whoever runs the work (a command, a window) says which files are its inputs; whatever writes asks
here first. The same file may have many names: by links, by ``./``, by another folder.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from slideviz.errors import SlidevizError

Inputs = Mapping[Path, str]
"""What each file is, in words: ``the input mesh``."""
_known: list[Callable[[], Inputs]] = []


@contextmanager
def spared(inputs: Callable[[], Inputs]) -> Iterator[None]:
    """Return a context in which these files are written over only where that was asked for."""
    _known.append(inputs)
    try:
        yield
    finally:
        _known.remove(inputs)


def require_no_input(
    path: Path, error: type[SlidevizError], replaces: Path | None = None, remedy: str = ""
) -> None:
    """Do nothing for a file that is no input.

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
