"""Atomic writing: files are written whole or not at all.

The bytes go to a temporary file in the same folder, which then takes the place of the target in
one step of the file system. So a full disk, a cancel or a crash never leaves half a mesh, and an
old file stays as it was until the new one is complete.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from slideviz.errors import CaseError, MeshError, SlidevizError
from slideviz.system.cleanup import draft
from slideviz.system.file_checks import require_no_input
from slideviz.system.platform import is_in_use, set_mode
from slideviz.system.tables import table_beside

_TABLE = table_beside(__file__)
_REMEDIES: dict[int, str] = {getattr(errno, name): words for name, words in _TABLE.items()}


@contextmanager
def atomic_write(
    path: str | Path, error: type[SlidevizError] = MeshError, replaces: Path | None = None
) -> Iterator[BinaryIO]:
    """Context with a binary file to write, which replaces ``path`` at the end.

    When the block raises, whatever was at ``path`` stays as it was and the temporary file is
    removed. A symbolic link stays a link, and an existing file keeps its permissions. Raises
    SlidevizError if it cannot be written: missing folder, no permission, full disk; or it is an
    input. The message has the path, the reason and the remedy. ``path``: the file to write.
    ``error``: the class of error to raise: ``MeshError`` unless another is given. ``replaces``: the
    input that may be written over; see `slideviz.system.file_checks`.
    """
    target = Path(path)
    require_no_input(target, error, replaces)
    temporary: Path | None = None
    real = Path(os.path.realpath(target))
    try:
        mode = mode_of(real)
        with draft(real.parent) as temporary:
            with temporary.open("xb") as file:
                yield file
                file.flush()
                # Some file systems report a full disk only now; and without it a power cut
                # after the renaming could leave an empty file.
                os.fsync(file.fileno())
                if mode is not None:
                    set_mode(file.fileno(), temporary, mode)
            temporary.replace(real)
    except OSError as problem:
        # The block may have failed to read some other file, which is not ours to explain.
        if problem.filename is not None and not _is_ours(problem.filename, target, temporary):
            raise
        reason = reason_of(problem, real.parent)
        raise error(f"{target}: cannot be written: {reason}") from problem


def write_whole(
    path: str | Path,
    content: str | bytes,
    error: type[SlidevizError] = MeshError,
    replaces: Path | None = None,
) -> None:
    """Write a file, text as UTF-8, by `atomic_write`."""
    with atomic_write(path, error, replaces) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def require_writable(
    path: str | Path, error: type[SlidevizError] = MeshError, replaces: Path | None = None
) -> None:
    """Raise if a file cannot be written now; called before the work whose result it is to hold.

    A temporary file is made beside it and removed. Parameters are those of `atomic_write`. Raises
    SlidevizError if the file cannot be written, as for `atomic_write`.
    """
    require_no_input(Path(path), error, replaces)
    real = Path(os.path.realpath(path))
    try:
        mode_of(real)
        with draft(real.parent) as temporary:
            temporary.touch(exist_ok=False)
    except OSError as problem:
        reason = reason_of(problem, real.parent)
        raise error(f"{path}: cannot be written: {reason}") from problem


def make_folder(folder: Path) -> None:
    """Make a folder and its parents where they are missing, or raise CaseError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        there = next(parent for parent in folder.absolute().parents if parent.exists())
        reason = reason_of(problem, there)
        raise CaseError(f"{folder}: cannot create this folder: {reason}") from problem


def mode_of(path: Path) -> int | None:
    """Return the permission bits of an existing file, or None if there is none.

    Raises OSError if it may not be replaced: it is a folder, a device, a pipe or write-protected.
    """
    if not path.exists():
        return None
    if path.is_dir():
        raise OSError(errno.EISDIR, "is a folder")
    if not path.is_file():
        raise OSError(errno.EINVAL, "it is a device or pipe; give the name of an ordinary file")
    # Renaming would get round the write protection of the file, so ask for it.
    if not os.access(path, os.W_OK):
        raise OSError(errno.EACCES, "write-protected")
    return path.stat().st_mode & 0o777


def _is_ours(name: object, target: Path, temporary: Path | None) -> bool:
    """Return whether the file name of an error is that of the target or its temporary file."""
    return str(name) in {str(target), str(temporary), os.path.realpath(target)}


def reason_of(problem: OSError, folder: Path | None = None) -> str:
    """Return in words why a file cannot be written, with the remedy for the usual reasons.

    ``folder``: where it was to be.
    """
    if problem.errno == errno.ENOENT and folder is not None and folder.is_dir():
        return "nothing can be made there; choose another folder"
    if is_in_use(problem):
        return "it is open, here or in another program; close it, or choose another name"
    text = problem.strerror or str(problem)
    return _REMEDIES.get(problem.errno or 0, text)
