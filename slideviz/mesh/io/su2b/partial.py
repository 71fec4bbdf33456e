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
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import BinaryIO

from slideviz.errors import MeshError
from slideviz.mesh.io.atomic import mode_of, reason_of
from slideviz.mesh.io.cleanup import keep, removed_at_stop
from slideviz.mesh.io.file_checks import require_no_input
from slideviz.mesh.ranks import ALONE, Alone
from slideviz.mesh.threads import Tick

HEAD = 8
"""Bytes that are zeros until the end."""
_PIECE = 1 << 26


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
    *,
    resume: bool,
    replaces: Path | None,
    ranks: Alone = ALONE,
) -> Iterator[Partial]:
    """Return a copy of ``source`` to be changed; it takes the place of ``path`` at the end.

    One process makes the copy beside its other work, ranks make it when it has to be ready.

    Parameters
    ----------
    about, resume
        As of `partial_file`.
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
        copying = _beside if ranks.size == 1 else _together
        tasks = [] if partial.done else _pieces(size)
        with copying(source, partial.path, tasks, ranks) as partial.ready:
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


Piece = tuple[int, int]
"""The first of some bytes, and the one after the last."""


def _pieces(size: int) -> list[Piece]:
    """Return the pieces of a file without its head; each ends where a page does."""
    ends = [*range(_PIECE, size, _PIECE), size]
    return list(zip([HEAD, *ends[:-1]], ends, strict=True))


@contextmanager
def _together(
    source: Path, ours: Path, tasks: list[Piece], ranks: Alone
) -> Iterator[Callable[[Tick], None]]:
    """Return what copies the pieces of a file, all ranks some."""

    def ready(tick: Tick) -> None:
        with ranks.sharing(_copying, source, ours) as do:
            for (_, end), _ in zip(tasks, do(tasks), strict=True):
                tick(end / tasks[-1][1])

    yield ready


@contextmanager
def _beside(
    source: Path, ours: Path, tasks: list[Piece], _: Alone
) -> Iterator[Callable[[Tick], None]]:
    """Return what waits until the pieces of a file are copied, as they are from now on."""
    stopped, done = Event(), 0

    def run() -> None:
        nonlocal done
        with _copying(source, ours) as copy:
            for task in tasks:
                if stopped.is_set():
                    return
                copy(task)
                done += 1

    with ThreadPoolExecutor(1, "slideviz-copy") as pool:
        found = pool.submit(run)

        def ready(tick: Tick) -> None:
            while not found.done():
                tick(done / max(len(tasks), 1))
                wait([found], 0.05)
            found.result()
            tick(1.0)

        try:
            yield ready
        finally:
            stopped.set()


@contextmanager
def _copying(source: Path, ours: Path) -> Iterator[Callable[[Piece], None]]:
    """Return what copies some bytes of a file to the same place of another, and to the disk."""
    with source.open("rb") as given, ours.open("r+b") as file:

        def copy(task: Piece) -> None:
            at, end = task
            while at < end:
                at += _copied(given, file, at, end - at)
            os.fsync(file.fileno())

        yield copy


def _copied(given: BinaryIO, file: BinaryIO, at: int, count: int) -> int:
    """Copy some bytes within the kernel where that is possible, and return how many."""
    with suppress(OSError, AttributeError):
        moved = os.copy_file_range(given.fileno(), file.fileno(), count, at, at)
        if moved:
            return moved
    block = os.pread(given.fileno(), count, at)
    if not block:
        raise MeshError(f"{given.name}: became shorter while it was read; run it again")
    return os.pwrite(file.fileno(), block, at)


def _removed(*paths: Path) -> None:
    for path in paths:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now
