"""Writing HDF5 files whole or not at all, with errors that say why.

The library below crashes the process when it closes a file that could not be written, as on a full
disk. So it writes through a file whose writing never fails, and that keeps what went wrong.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.mesh.check import path_error
from slideviz.mesh.io.atomic import atomic_write, reason_of

if TYPE_CHECKING:
    import h5py
    from _typeshed import WriteableBuffer


class Hdf5Draft:
    """An HDF5 file that is being written: ``tree`` is its root.

    It is also the file that HDF5 writes to: reading, writing and places as of Python's files.
    """

    tree: h5py.File

    def __init__(self, path: Path, draft: Path) -> None:
        self._path = path
        self._file = draft.open("r+b", buffering=0)
        self._problem: OSError | None = None

    def require(self) -> None:
        """Raise when something could not be written.

        Raises
        ------
        MeshError
            The first that could not, with the remedy.
        """
        if self._problem is not None:
            reason = reason_of(self._problem)
            raise path_error(self._path, f"cannot be written: {reason}") from self._problem

    def close(self) -> None:
        """Close the file; HDF5 must have closed it before."""
        self._file.close()

    def write(self, data: bytes | memoryview) -> int:
        """Write what can be written."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while len(rest) and self._problem is None:
                rest = rest[self._file.write(rest) :]
        except OSError as problem:
            self._problem = problem
        return size

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Read what there is; the rest of the buffer becomes zeros."""
        rest = memoryview(buffer).cast("B")
        size = len(rest)
        while len(rest):
            count = self._file.readinto(rest)
            if not count:
                rest[:] = bytes(len(rest))
                break
            rest = rest[count:]
        return size

    def read(self, size: int) -> bytes:
        """Return so many bytes, as `readinto` gives them."""
        buffer = bytearray(size)
        self.readinto(buffer)
        return bytes(buffer)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place and return it."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def truncate(self, size: int) -> int:
        """Make the file that long, where it can be."""
        try:
            self._file.truncate(size)
        except OSError as problem:
            self._problem = self._problem or problem
        return size

    def flush(self) -> None:
        """Do nothing: nothing is kept back."""


@contextmanager
def hdf5_write(
    path: Path, replaces: Path | None = None, source: Path | None = None
) -> Iterator[Hdf5Draft]:
    """Return an HDF5 file to write; it takes the place of ``path`` when the block ends well.

    Parameters
    ----------
    path : Path
        The file to write.
    replaces : Path, optional
        The input that may be written over.
    source : Path, optional
        The file that it begins as a copy of; it begins empty when left out.

    Raises
    ------
    MeshError
        It cannot be written; what was at ``path`` is as before.
    """
    import h5py

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
