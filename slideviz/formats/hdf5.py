"""Writing HDF5 files whole or not at all, with errors that say why.

The HDF5 library crashes the process when it closes a file that could not be written, as on a full
disk. So it writes through a Python file object whose methods never fail, but keep the first error
to be raised afterwards.
"""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from io import FileIO
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING

import h5py

from slideviz.errors import path_error
from slideviz.system.atomic import atomic_write, reason_of
from slideviz.system.platform import open_unlinked

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: the given one, or with a number from 2."""
    numbered = (f"{name}_{number}" for number in count(2))
    return next(one for one in chain([name], numbered) if one not in taken)


class Hdf5Draft(FileIO):
    """An HDF5 file that is being written, and the Python file object that h5py writes it through.

    ``tree`` is the root of the HDF5 file. Errors of writing are kept, and raised by `require`.
    ``path``: the file that the draft is to replace, for messages. ``draft``: the existing file that
    is written.
    """

    tree: h5py.File

    def __init__(self, path: Path, draft: Path) -> None:
        super().__init__(draft, "r+", opener=open_unlinked)
        self._path = path
        self._problem: OSError | None = None

    def require(self) -> None:
        """Raise MeshError with the reason of the first failure if anything could not be written."""
        if self._problem is not None:
            reason = reason_of(self._problem)
            raise path_error(self._path, f"cannot be written: {reason}") from self._problem

    def write(self, data: ReadableBuffer) -> int:
        """Write bytes unless a write failed before; return their number, even if this one fails."""
        remaining = memoryview(data).cast("B")
        size = len(remaining)
        try:
            while len(remaining) and self._problem is None:
                remaining = remaining[super().write(remaining) :]
        except OSError as problem:
            self._problem = problem
        return size

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Fill a buffer from the file, beyond its end with zeros; return the buffer's size."""
        remaining = memoryview(buffer).cast("B")
        size = len(remaining)
        while len(remaining):
            count = super().readinto(remaining)
            if not count:
                remaining[:] = bytes(len(remaining))
                break
            remaining = remaining[count:]
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file and return it, even if this fails."""
        try:
            return super().truncate(size)
        except OSError as problem:
            self._problem = self._problem or problem
        return size or 0


@contextmanager
def hdf5_write(
    path: Path, replaces: Path | None, source: Path | None = None
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
        with Hdf5Draft(path, Path(file.name)) as draft:
            with h5py.File(draft, "w" if source is None else "r+") as draft.tree:
                yield draft
            draft.require()
