"""Copying parts of a large file to the same place of another, piece by piece, and checking them.

A single process copies in a thread beside its other work; several ranks copy when the copy has to
be ready.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from threading import Event
from typing import BinaryIO

from slideviz.errors import MeshError
from slideviz.system.cleanup import open_temporary
from slideviz.system.ranks import SERIAL, SerialPool, WorkerFactory
from slideviz.system.threads import Tick

_PIECE = 1 << 26
"""Most bytes that are copied in one task."""
_BLOCK = 1 << 20
"""Most bytes of a piece that are in memory at a time."""
Piece = tuple[int, int]
"""First byte of a range, and the one after the last."""


def copying(
    source: Path, ours: Path, parts: Sequence[Piece], ranks: SerialPool, *, is_left: bool
) -> AbstractContextManager[Callable[[Tick], None]]:
    """Return a context with a function that waits until parts of a file are copied to another one.

    Parameters
    ----------
    source, ours : Path
        The file to copy from, and the existing one to copy to.
    parts : sequence of Piece
        The ranges of bytes to copy.
    ranks : SerialPool or Ranks
        The processes that copy.
    is_left : bool
        Whether they were copied before, by a stopped process: then only bytes that differ are
        copied again.
    """
    tasks = [piece for begin, end in parts for piece in _pieces(begin, end)]
    way = _beside if ranks.size == 1 else _together
    return way(_mending if is_left else _copying, (source, ours), tasks, ranks)


def checksums(path: Path, tick: Tick, ranks: SerialPool = SERIAL) -> list[int]:
    """Return the CRC-32 of each piece of a file."""
    found: list[int] = []
    tasks = _pieces(0, path.stat().st_size)
    with ranks.sharing(_summing, path) as do:
        for checksum in do(tasks):
            found.append(checksum)
            tick(len(found) / len(tasks))
    return found


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
    """Context in which a thread does the ``tasks``, with a function that waits for it.

    At the end of the context it stops after the current task.
    """
    stopped, done = Event(), 0

    def run() -> None:
        nonlocal done
        with make(*files) as copy:
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
    """Context with a function that copies a piece of a file to the same place of another.

    When it returns, the bytes are on the disk.
    """
    with source.open("rb") as given, open_temporary(ours) as file:

        def copy(task: Piece) -> None:
            at, end = task
            while at < end:
                at += _copied(given, file, at, end - at)
            os.fsync(file.fileno())

        yield copy


def _copied(given: BinaryIO, file: BinaryIO, at: int, count: int) -> int:
    """Copy at most ``count`` bytes at ``at``, inside the kernel if possible; return how many.

    Raises MeshError if the file ends there.
    """
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
def _summing(path: Path) -> Iterator[Callable[[Piece], int]]:
    """Context with a function that returns the CRC-32 of a piece of a file."""
    with path.open("rb") as file:

        def add_up(task: Piece) -> int:
            found = 0
            for at, count in _blocks(task):
                found = zlib.crc32(os.pread(file.fileno(), count, at), found)
            return found

        yield add_up


def _blocks(task: Piece) -> Iterator[tuple[int, int]]:
    """Yield first byte and number of bytes of the blocks of a piece."""
    for at in range(*task, _BLOCK):
        yield at, min(_BLOCK, task[1] - at)
