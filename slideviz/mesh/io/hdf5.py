"""Writing HDF5 files whole or not at all, with errors that say why."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.mesh.check import path_error
from slideviz.mesh.io.atomic import atomic_write, reason_of

if TYPE_CHECKING:
    import h5py

_ERRNO = re.compile(r"errno = (\d+)")


@contextmanager
def hdf5_write(
    path: Path, replaces: Path | None = None, source: Path | None = None
) -> Iterator[h5py.File]:
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
    import shutil

    import h5py

    with atomic_write(path, replaces=replaces) as file:
        if source is not None:
            with source.open("rb") as original:
                shutil.copyfileobj(original, file)
            file.flush()
        try:
            # Nobody else knows this file, and some network drives cannot lock.
            with h5py.File(file.name, "w" if source is None else "r+", locking=False) as tree:
                yield tree
        except (OSError, RuntimeError) as problem:
            raise path_error(path, f"cannot be written: {_reason(problem)}") from problem


def _reason(problem: OSError | RuntimeError) -> str:
    """Return why HDF5 could not write: its messages have the error of the system in them."""
    text = " ".join(str(problem).split())
    found = _ERRNO.search(text)
    number = int(found[1]) if found else getattr(problem, "errno", None)
    if number is None:
        return f"HDF5 says {text[:160]!r}; check the disk, or write another format"
    return reason_of(OSError(number, errno.errorcode.get(number, text[:160])))
