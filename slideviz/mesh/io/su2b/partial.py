"""A large file that is made in place over some time, and can be gone on with after a stop.

It has a hidden name beside what it is to become, or helps to make. A mesh is a copy of another one,
which is changed part by part; until the end its first bytes are zeros, so that nothing reads it.
Then they are put back, and it takes the place of the target in one step of the file system.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from slideviz.errors import MeshError
from slideviz.mesh.io.atomic import mode_of, reason_of
from slideviz.mesh.io.cleanup import keep, removed_at_stop
from slideviz.mesh.io.file_checks import require_no_input
from slideviz.mesh.io.su2b.copying import Piece, copying
from slideviz.mesh.ranks import ALONE, Alone
from slideviz.mesh.threads import Tick

HEAD = 8
"""Bytes that are zeros until the end."""


@dataclass(eq=False)
class Partial:
    """A file that is being made.

    Attributes
    ----------
    file : BinaryIO
        Open for reading and writing.
    path : Path
        Its name meanwhile.
    sums : list of int
        The checksums of the parts that are made, of those that the caller counts.
    mode : int or None
        The permissions of the file that is there already.
    ready : callable
        Waits until the copy is made, and is to be called before anything is written to it.
    """

    file: BinaryIO
    path: Path
    sums: list[int]
    mode: int | None
    _note: Path
    _about: str
    ready: Callable[[Tick], None] = lambda _: None

    @property
    def done(self) -> int:
        """Return how many parts are made."""
        return len(self.sums)

    def remove(self) -> None:
        """Remove it and its note, at the end of its use."""
        _removed(self.path, self._note)

    def note(self, sums: Iterable[int]) -> None:
        """Keep that parts with these checksums are made, after they are on the disk."""
        os.fsync(self.file.fileno())
        self.sums = list(sums)
        fresh = self._note.with_suffix(".new")
        fresh.write_text(json.dumps({"about": self._about, "sums": self.sums}))
        fresh.replace(self._note)
        if self.sums:
            keep(self.path, _kept_words(self.path))


def names_of(path: Path, more: str = "") -> tuple[Path, Path]:
    """Return what a file in the making is called, and the note of how far it is."""
    real = Path(os.path.realpath(path))
    name = f".{real.name}.partial{more}"
    return real.with_name(name), real.with_name(f"{name}.json")


@contextmanager
def partial_file(
    path: Path, size: int, about: str, *, resume: bool, more: str = ""
) -> Iterator[Partial]:
    """Return a file of some size, which has zeros or what a stopped process has put there.

    After an error nothing is left; after the end of the process it stays once a part of it is
    noted as done, so that ``resume`` can go on with it. Else it is the caller who removes it.

    Parameters
    ----------
    path : Path
        What it is to become, or for which it is made.
    about : str
        What is made of what: another text begins anew.
    more : str
        What its name ends with, where several files are made for one.

    Raises
    ------
    MeshError
        It cannot be written, or another process is making it.
    """
    ours, note = names_of(path, more)
    try:
        mode = mode_of(Path(os.path.realpath(path)))
        sums = _noted(note, about) if resume else []
        with open(os.open(ours, os.O_RDWR | os.O_CREAT, 0o600), "r+b") as file:  # noqa: PTH123
            _lock(file, path)
            with removed_at_stop(ours):
                try:
                    if sums and os.fstat(file.fileno()).st_size == size:
                        keep(ours, _kept_words(ours))
                    else:
                        sums = []
                        note.unlink(missing_ok=True)
                        os.ftruncate(file.fileno(), 0)
                        os.ftruncate(file.fileno(), size)
                    yield Partial(file, ours, sums, mode, note, about)
                except Exception:
                    _removed(ours, note)
                    raise
    except OSError as problem:
        if problem.filename is not None and Path(str(problem.filename)) not in (ours, note, path):
            raise
        raise MeshError(f"{path}: cannot be written: {reason_of(problem)}") from problem


@contextmanager
def partial_copy(
    path: Path,
    source: Path,
    about: str,
    changed: Piece,
    *,
    resume: bool,
    replaces: Path | None,
    ranks: Alone = ALONE,
) -> Iterator[Partial]:
    """Return a copy of ``source`` to be changed; it takes the place of ``path`` at the end.

    Of a copy that a stopped process has left, all that is not ``changed`` is made equal again.

    Parameters
    ----------
    about, resume
        As of `partial_file`.
    changed : tuple of int
        The first of the bytes that the caller changes, and the one after the last.
    ranks : Alone or Ranks
        Those that copy.

    Raises
    ------
    MeshError
        It cannot be written, or another process is making it.
    """
    require_no_input(path, MeshError, replaces)
    size = source.stat().st_size
    with partial_file(path, size, about, resume=resume) as partial:
        with source.open("rb") as given:
            head = given.read(HEAD)
        is_left = partial.done > 0
        copied = [(HEAD, changed[0]), (changed[1], size)] if is_left else [(HEAD, size)]
        with copying(source, partial.path, copied, ranks, is_left=is_left) as partial.ready:
            yield partial
        finish_head(partial.file, head)
        partial.path.chmod(0o644 & ~_umask() if partial.mode is None else partial.mode)
        partial.path.replace(os.path.realpath(path))
        _removed(partial._note)  # not its name, which may be another's by now


def finish_head(file: BinaryIO, head: bytes) -> None:
    """Write what a mesh begins with, when all else of it is there."""
    file.seek(0)
    file.write(head)
    file.flush()
    os.fsync(file.fileno())


def _kept_words(ours: Path) -> str:
    return f"what is done is kept in {ours}; go on with --resume"


def _noted(note: Path, about: str) -> list[int]:
    """Return the checksums of the parts of the same work that a stopped process has made."""
    try:
        kept = json.loads(note.read_text())
        return [int(one) for one in kept["sums"]] if kept["about"] == about else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _lock(file: BinaryIO, path: Path) -> None:
    import fcntl  # POSIX only

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as problem:
        if problem.errno not in (errno.EAGAIN, errno.EACCES):
            raise
        raise MeshError(
            f"{path}: another process is writing it; wait for it, or choose another name"
        ) from problem


def _removed(*paths: Path) -> None:
    for path in paths:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now
