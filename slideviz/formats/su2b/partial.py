"""Partial files: large files that are written part by part, and resumed after the program stopped.

A partial file has a hidden name in the folder of the *target*, the file that it is to replace or
that it is needed for. A *note*, a small JSON file beside it, says which parts are done. A mesh is
first a copy of another one, whose parts are changed one by one. Its first bytes are zeros
meanwhile, so that no program reads it; at the end they are written, and it is renamed to the
target.
"""

from __future__ import annotations

import errno
import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import BinaryIO

from slideviz.errors import MeshError
from slideviz.system.atomic import mode_of, reason_of
from slideviz.system.cleanup import keep_partial, open_temporary, removed_at_stop
from slideviz.system.file_checks import read_json, require_no_input
from slideviz.system.ranks import SERIAL, SerialPool, WorkerFactory
from slideviz.system.threads import Tick

_PIECE = 1 << 26  # most bytes that are copied in one task
_BLOCK = 1 << 20  # most bytes of a piece that are in memory at a time
Piece = tuple[int, int]  # first byte of a range, and the one after the last


def copying(
    source: Path, ours: Path, parts: Sequence[Piece], ranks: SerialPool, *, is_left: bool
) -> AbstractContextManager[Callable[[Tick], None]]:
    """Return a context with a function that waits until parts of a file are copied to another one.

    ``source`` and ``ours``: the file to copy from, and the existing one to copy to.
    ``parts``: the ranges of bytes to copy.
    ``ranks``: the processes that copy.
    ``is_left``: whether they were copied before, by a stopped process: then only bytes that differ
    are copied again.
    """
    tasks = [piece for begin, end in parts for piece in _pieces(begin, end)]
    way = _beside if ranks.size == 1 else _together
    return way(_mending if is_left else _copying, (source, ours), tasks, ranks)


def checksums(path: Path, tick: Tick, ranks: SerialPool = SERIAL) -> list[int]:
    """Return the CRC-32 of each piece of a file."""
    sums: list[int] = []
    tasks = _pieces(0, path.stat().st_size)
    with ranks.sharing(_checksums, path) as do:
        for checksum in do(tasks):
            sums.append(checksum)
            tick(len(sums) / len(tasks))
    return sums


def _pieces(begin: int, end: int) -> list[Piece]:
    """Return the pieces of a range of bytes; all but the last end at a page boundary."""
    ends = [*range((begin // _PIECE + 1) * _PIECE, end, _PIECE), end]
    return list(zip([begin, *ends[:-1]], ends, strict=True)) if begin < end else []


@contextmanager
def _together(
    make: WorkerFactory[Piece, None],
    files: tuple[Path, Path],
    tasks: list[Piece],
    ranks: SerialPool,
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function in which all ranks do the ``tasks``, by ``make(*files)``."""

    def ready(tick: Tick) -> None:
        with ranks.sharing(make, *files) as do:
            for (_, end), _ in zip(tasks, do(tasks), strict=True):
                tick(end / tasks[-1][1])

    yield ready


@contextmanager
def _beside(
    make: WorkerFactory[Piece, None], files: tuple[Path, Path], tasks: list[Piece], _: SerialPool
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function that waits for a thread's ``tasks``; its end stops these early."""
    stopped = Event()
    done = 0

    def run() -> None:
        nonlocal done
        with make(*files) as copy:
            for task in tasks:
                if stopped.is_set():
                    return
                copy(task)
                done += 1

    with ThreadPoolExecutor(1, "slideviz-copy") as pool:
        future = pool.submit(run)

        def ready(tick: Tick) -> None:
            while not future.done():
                tick(done / max(len(tasks), 1))
                wait([future], 0.05)
            future.result()
            tick(1.0)

        try:
            yield ready
        finally:
            stopped.set()


@contextmanager
def _copying(source: Path, ours: Path) -> Iterator[Callable[[Piece], None]]:
    """Context with a function that copies a piece of a file, onto the disk, to the same place."""
    with source.open("rb") as given, open_temporary(ours) as file:

        def copy(task: Piece) -> None:
            at, end = task
            while at < end:
                at += _copied(given, file, at, end - at)
            os.fsync(file.fileno())

        yield copy


def _copied(given: BinaryIO, file: BinaryIO, at: int, count: int) -> int:
    """Copy up to ``count`` bytes at ``at``, in the kernel if possible; return how many."""
    with suppress(OSError, AttributeError):
        moved = os.copy_file_range(given.fileno(), file.fileno(), count, at, at)
        if moved:
            return moved
    block = os.pread(given.fileno(), count, at)
    if not block:
        raise MeshError(f"{given.name}: became shorter while it was read; run it again")
    return os.pwrite(file.fileno(), block, at)


@contextmanager
def _mending(source: Path, ours: Path) -> Iterator[Callable[[Piece], None]]:
    """Context with a function that copies the blocks of a piece that differ in the copy again."""
    with _copying(source, ours) as copy, source.open("rb") as given, ours.open("rb") as file:

        def mend(task: Piece) -> None:
            for at, count in _blocks(task):
                if os.pread(given.fileno(), count, at) != os.pread(file.fileno(), count, at):
                    copy((at, at + count))

        yield mend


@contextmanager
def _checksums(path: Path) -> Iterator[Callable[[Piece], int]]:
    with path.open("rb") as file:

        def add_up(task: Piece) -> int:
            checksum = 0
            for at, count in _blocks(task):
                checksum = zlib.crc32(os.pread(file.fileno(), count, at), checksum)
            return checksum

        yield add_up


def _blocks(task: Piece) -> Iterator[tuple[int, int]]:
    for at in range(*task, _BLOCK):
        yield at, min(_BLOCK, task[1] - at)


BINARY = ".binary"  # end of the name of the partial file that is a binary copy of a text
HEAD = 8  # bytes that are zeros until the end


@dataclass(eq=False)
class Partial:
    """A partial file."""

    file: BinaryIO  # open for reading and writing
    path: Path  # its hidden name
    sums: list[int | None]
    """Checksum of each part, None where it is not done; what a part is, the caller decides."""
    mode: int | None  # permissions of the target, None if it does not exist
    _note: Path
    _about: str
    ready: Callable[[Tick], None] = lambda _: None
    """Waits until the file is a complete copy; call it before the first writing."""

    @property
    def done(self) -> int:
        """Return how many parts are done."""
        return len(self.sums) - self.sums.count(None)

    def remove(self) -> None:
        """Remove the file and its note."""
        _removed(self.path, self._note)

    def note(self, sums: Iterable[int | None]) -> None:
        """Sync the file to the disk, then note that parts with these checksums are done."""
        os.fsync(self.file.fileno())
        self.sums = list(sums)
        fresh = self._note.with_suffix(".new")
        fresh.unlink(missing_ok=True)  # it might be a link to another file
        with fresh.open("x") as file:
            json.dump({"about": self._about, "sums": self.sums}, file)
        fresh.replace(self._note)
        if self.done:
            keep_partial(self.path, _kept_words(self.path))


def names_of(path: Path, more: str = "") -> tuple[Path, Path]:
    """Return the paths of the partial file of a target, and of its note."""
    real = Path(os.path.realpath(path))
    name = f".{real.name}.partial{more}"
    return real.with_name(name), real.with_name(f"{name}.json")


def keep_earlier(path: Path) -> None:
    """Let it be said at an early end that partial files of an earlier run are there, if any are."""
    for ours, note in (names_of(path), names_of(path, BINARY)):
        if ours.exists() and note.exists():
            keep_partial(
                ours, f"the partial result of an earlier run is in {ours}; continue with --resume"
            )


@contextmanager
def partial_file(
    path: Path, size: int, about: str, *, resume: bool, more: str = ""
) -> Iterator[Partial]:
    """Context with a partial file of ``size`` bytes: zeros, or the content that a process left.

    An error in the block removes the file. If the program is stopped, the file stays if a part is
    recorded as done, so that ``resume`` can continue. Otherwise the caller removes or renames it.
    Raises MeshError if it cannot be written, or another process is writing it.
    ``path``: the target.
    ``size``: number of bytes.
    ``about``: a text that identifies the work: if that in the note differs, the file is made anew.
    ``resume``: whether to continue with the file of a stopped process, if there is one.
    ``more``: end of its name, where a target has several partial files.
    """
    ours, note = names_of(path, more)
    try:
        mode = mode_of(Path(os.path.realpath(path)))
        sums = _noted(note, about) if resume else []
        with open_temporary(ours, new=True) as file:
            _lock(file, path)
            with removed_at_stop(ours):
                try:
                    if sums and os.fstat(file.fileno()).st_size == size:
                        keep_partial(ours, _kept_words(ours))
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
    changed: Sequence[Piece],
    *,
    resume: bool,
    replaces: Path | None,
    ranks: SerialPool = SERIAL,
) -> Iterator[Partial]:
    """Context with a partial file that is a copy of ``source``, which replaces ``path`` at the end.

    Of a copy that a stopped process has left, all that is not ``changed`` is made equal again.
    Raises MeshError if it cannot be written, or another process is writing it.
    ``path``: the target.
    ``source``: the mesh to copy.
    ``about`` and ``resume``: as of `partial_file`.
    ``changed``: the ranges of bytes that the caller changes, in order.
    ``ranks``: the processes that copy.
    """
    require_no_input(path, MeshError, replaces)
    size = source.stat().st_size
    with partial_file(path, size, about, resume=resume) as partial:
        with source.open("rb") as given:
            head = given.read(HEAD)
        is_left = partial.done > 0
        ends = HEAD, *(byte for piece in changed for byte in piece if is_left), size
        copied = list(zip(ends[::2], ends[1::2], strict=True))
        with copying(source, partial.path, copied, ranks, is_left=is_left) as partial.ready:
            yield partial
        finish_head(partial.file, head)
        mode = 0o644 & ~_umask() if partial.mode is None else partial.mode
        os.fchmod(partial.file.fileno(), mode)
        partial.path.replace(os.path.realpath(path))
        _removed(partial._note)  # not its name, which may be another's by now


def finish_head(file: BinaryIO, head: bytes) -> None:
    """Write the first bytes of a mesh, after all others, and sync the file to the disk."""
    file.seek(0)
    file.write(head)
    file.flush()
    os.fsync(file.fileno())


def _kept_words(ours: Path) -> str:
    return f"the partial result is in {ours}; continue with --resume"


def _noted(note: Path, about: str) -> list[int | None]:
    """Return the checksums in a note on the same work ``about``; empty if there is no such note."""
    try:
        record = read_json(note)
        sums = record["sums"] if record["about"] == about else []
        return [None if one is None else int(one) for one in sums]
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
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
