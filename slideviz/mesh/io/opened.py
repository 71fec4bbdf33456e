"""The one place that asks what kind of file is to be read: ordinary ones only, of sane length.

A pipe may never come to an end, and a device gives bytes without end.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from slideviz.errors import SlidevizError
from slideviz.mesh.check import printable


def require_ordinary(path: Path, error: type[SlidevizError]) -> int:
    """Return how many bytes a file has; before it is opened, for some devices act on that.

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
