"""Writing HDF5 files whole or not at all, with errors that say why.

The HDF5 library crashes the process when it closes a file that could not be written, as on a full
disk. So it writes through a Python file object whose methods never fail, but keep the first error
to be raised afterwards.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, cast

import h5py

from slideviz.errors import path_error
from slideviz.system.atomic import atomic_write, reason_of
from slideviz.system.cleanup import open_temporary

if TYPE_CHECKING:
    from io import FileIO

    import h5py
    from _typeshed import WriteableBuffer


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: the given one, or with a number from 2."""
    numbered = (f"{name}_{number}" for number in count(2))
    return next(one for one in chain([name], numbered) if one not in taken)


class Hdf5Draft:
    """An HDF5 file that is being written, and the Python file object that h5py writes it through.

    ``tree`` is the root of the HDF5 file. Errors of writing are kept, and raised by `require`. The
    other methods are those of a Python file that h5py calls. ``path``: the file that the draft is
    to replace, for messages. ``draft``: the existing file that is written.
    """

    tree: h5py.File

    def __init__(self, path: Path, draft: Path) -> None:
        self._path = path
        self._file = cast("FileIO", open_temporary(draft, buffering=0))
        self._problem: OSError | None = None

    def require(self) -> None:
        """Raise MeshError with the reason of the first failure if anything could not be written."""
        if self._problem is not None:
            reason = reason_of(self._problem)
            raise path_error(self._path, f"cannot be written: {reason}") from self._problem

    def close(self) -> None:
        """Close the file; HDF5 must have closed it before."""
        self._file.close()

    def write(self, data: bytes | memoryview) -> int:
        """Write bytes unless a write failed before; return their number, even if this one fails."""
        remaining = memoryview(data).cast("B")
        size = len(remaining)
        try:
            while len(remaining) and self._problem is None:
                remaining = remaining[self._file.write(remaining) :]
        except OSError as problem:
            self._problem = problem
        return size

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Fill a buffer from the file, beyond its end with zeros; return the buffer's size."""
        remaining = memoryview(buffer).cast("B")
        size = len(remaining)
        while len(remaining):
            count = self._file.readinto(remaining)
            if not count:
                remaining[:] = bytes(len(remaining))
                break
            remaining = remaining[count:]
        return size

    def read(self, size: int) -> bytes:
        """Return ``size`` bytes from the file, beyond its end zeros."""
        buffer = bytearray(size)
        self.readinto(buffer)
        return bytes(buffer)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a position in the file and return it."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the position in the file."""
        return self._file.tell()

    def truncate(self, size: int) -> int:
        """Set the length of the file and return it, even if this fails."""
        try:
            self._file.truncate(size)
        except OSError as problem:
            self._problem = self._problem or problem
        return size

    def flush(self) -> None:
        """Do nothing: the file has no buffer."""


@contextmanager
def hdf5_write(
    path: Path, replaces: Path | None = None, source: Path | None = None
) -> Iterator[Hdf5Draft]:
    """Context with an HDF5 file to write, which replaces ``path`` at the end if nothing was raised.

    Raises MeshError if it cannot be written; what was at ``path`` is as before. ``path``: the file
    to write. ``replaces``: the input that may be overwritten. ``source``: a file whose copy the new
    one is at first; when left out it is empty.
    """
    with atomic_write(path, replaces=replaces) as file:
        if source is not None:
            with source.open("rb") as original:
                shutil.copyfileobj(original, file)
            file.flush()
        draft = Hdf5Draft(path, Path(file.name))
        try:
            with h5py.File(draft, "w" if source is None else "r+") as draft.tree:
                yield draft
            draft.require()
        finally:
            draft.close()
