"""The lock of a sweep's folder: two sweeps at once would write over each other's results."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from slideviz.errors import CaseError
from slideviz.system.atomic import reason_of
from slideviz.system.cleanup import open_temporary

NAME = "sweep.lock"
_TAKEN = (errno.EAGAIN, errno.EACCES)
"""Errors where another process has the lock."""
_UNKNOWN = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
"""Errors of file systems without locks."""


class FolderLock:
    """The right to write results into a folder, until `release` or the end of the process.

    The system frees the lock however the process ends; a lock file that is left does not lock.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    CaseError
        Another sweep has the lock, or the file cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        try:
            self._file = self._taken()
        except OSError as problem:
            raise CaseError(f"{self._path}: cannot be written: {reason_of(problem)}") from problem

    def _taken(self) -> BinaryIO:
        """Return the file, locked, with the number of this process in it."""
        import fcntl  # POSIX only

        while True:
            file = open_temporary(self._path, new=True, buffering=0)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as problem:
                if problem.errno in _TAKEN:
                    raise self._refusal(file) from problem
                if problem.errno not in _UNKNOWN:
                    raise
            # Who had it may have removed it since it was opened here.
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(file.fileno()), self._path.stat()):
                    file.truncate(0)
                    file.write(b"%d\n" % os.getpid())
                    return file
            file.close()

    def _refusal(self, file: BinaryIO) -> CaseError:
        """Return the error that another sweep has the lock; closes the file."""
        with file:
            file.seek(0)
            number = file.read(20).decode("ascii", "replace").strip()
        who = f"process {number}" if number else "another process"
        return CaseError(
            f"{self._path.parent}: another sweep writes its results here ({who}); wait for its "
            "end, or choose another folder"
        )

    def release(self) -> None:
        """Free the lock and remove its file."""
        if not self._file.closed:
            with self._file, suppress(OSError):
                self._path.unlink()
