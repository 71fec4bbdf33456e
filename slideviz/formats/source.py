"""Sources: the bytes of files that are read piece by piece, and again when a copy is written.

A small file is kept in memory, a large one is kept open. Removing an open file, or replacing it by
another of the same name as `atomic_write` does, leaves its bytes readable. Writing into it changes
them, which `Source` notices. It is not memory-mapped: if a mapped file is cut off, the program
crashes.
"""

from __future__ import annotations

import os
import weakref
from pathlib import Path
from typing import Any, BinaryIO

from slideviz.errors import MeshError, path_error
from slideviz.formats.openfoam_paths import lacks_mesh
from slideviz.system.platform import read_at

KEPT_BYTES = 1 << 26
"""Files up to this size are kept in memory, so that they may change while the mesh is in use."""


class Source:
    """The bytes of a file; a slice of it returns some of them."""

    def __init__(self, path: Path, content: bytes | BinaryIO) -> None:
        self.path = path  # the file, for messages
        self._content = content if isinstance(content, bytes) else None
        self._file = None if isinstance(content, bytes) else content
        self._stamp = self._now()
        self.size = len(content) if isinstance(content, bytes) else self._stamp[0]
        """Number of bytes."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what pickle makes a copy from: the bytes, or how to open a large file again."""
        if self._content is not None:
            return Source, (self.path, self._content)
        return _reopened, (self.path.absolute(), self._stamp)

    def __getitem__(self, part: slice) -> bytes:
        """Return a range of the bytes; may be called from several threads at once.

        Raises MeshError if they cannot be read, or the file has become shorter since it was opened.
        """
        if self._file is None:
            assert self._content is not None
            return self._content[part]
        begin, end, _ = part.indices(self.size)
        pieces = []
        try:
            while begin < end:  # the system gives at most 2 GiB at once
                pieces.append(read_at(self._file.fileno(), end - begin, begin))
                if not pieces[-1]:
                    raise self.changed()
                begin += len(pieces[-1])
        except OSError as problem:
            raise unreadable(self.path, problem) from problem
        return pieces[0] if len(pieces) == 1 else b"".join(pieces)

    def require_same(self) -> None:
        """Raise MeshError if the size or time stamp of an open file changed since it was opened."""
        if self._now() != self._stamp:
            raise self.changed()

    def _now(self) -> tuple[int, int]:
        """Return size and time stamp (ns) of an open file; 0, 0 for one that is kept in memory."""
        if self._file is None:
            return 0, 0
        status = os.fstat(self._file.fileno())
        return status.st_size, status.st_mtime_ns

    def changed(self) -> MeshError:
        """Return the error for a file that was changed since it was opened."""
        return path_error(self.path, "was changed while it was in use; read it again")


def open_source(path: Path) -> Source:
    """Return the source of a file: its bytes, or if larger than ``KEPT_BYTES`` the open file."""
    try:
        if path.stat().st_size <= KEPT_BYTES:
            return Source(path, path.read_bytes())
        file = path.open("rb")
        source = Source(path, file)
    except OSError as problem:
        raise unreadable(path, problem) from problem
    weakref.finalize(source, file.close)
    return source


def _reopened(path: Path, stamp: tuple[int, int]) -> Source:
    """Return the source of a file that another process opened; MeshError unless ``stamp`` fits."""
    source = open_source(path)
    if source._now() != stamp:
        raise source.changed()
    return source


def unreadable(path: Path, problem: OSError | ValueError) -> MeshError:
    """Return the error, with its remedy, for a file that cannot be opened or read."""
    if isinstance(problem, FileNotFoundError) and lacks_mesh(path):
        remedy = "make one first, e.g. with blockMesh, and open the case again"
        return path_error(path.parent, f"this case of OpenFOAM has no mesh; {remedy}")
    if isinstance(problem, FileNotFoundError | NotADirectoryError | ValueError):
        return path_error(path, "there is no such file; check the name and the folder")
    if isinstance(problem, IsADirectoryError):
        return path_error(path, "this is a folder; choose a mesh file in it")
    if isinstance(problem, PermissionError):
        remedy = "no permission; change its permissions or copy it to another folder"
    else:
        remedy = f"{problem.strerror or problem}; check the disk, or copy the file elsewhere"
    return path_error(path, f"cannot be read: {remedy}")
