"""Bytes of a large file copied to the same place of another, piece by piece, and held against it.

One process copies beside its other work, ranks copy when the copy has to be ready.
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
from slideviz.mesh.ranks import ALONE, Alone, Make
from slideviz.mesh.threads import Tick

_PIECE = 1 << 26
_BLOCK = 1 << 20
"""Bytes of a piece that are in memory at a time."""
Piece = tuple[int, int]
"""The first of some bytes, and the one after the last."""


def copying(
    source: Path, ours: Path, parts: Sequence[Piece], ranks: Alone, *, is_left: bool
) -> AbstractContextManager[Callable[[Tick], None]]:
    """Return what waits until parts of a file stand in another one, too.

    Parameters
    ----------
    is_left : bool
        Whether they have been copied before: then only what is another by now is copied.
    """
    tasks = [piece for begin, end in parts for piece in _pieces(begin, end)]
    way = _beside if ranks.size == 1 else _together
    return way(_mending if is_left else _copying, (source, ours), tasks, ranks)


def checksums(path: Path, tick: Tick, ranks: Alone = ALONE) -> list[int]:
    """Return the CRC-32 of each piece of a file."""
    found: list[int] = []
    tasks = _pieces(0, path.stat().st_size)
    with ranks.sharing(_summing, path) as do:
        for checksum in do(tasks):
            found.append(checksum)
            tick(len(found) / len(tasks))
    return found


def _pieces(begin: int, end: int) -> list[Piece]:
    """Return the pieces of some bytes; each but the last ends where a page does."""
    ends = [*range((begin // _PIECE + 1) * _PIECE, end, _PIECE), end]
    return list(zip([begin, *ends[:-1]], ends, strict=True)) if begin < end else []


@contextmanager
def _together(
    make: Make[Piece, None], files: tuple[Path, Path], tasks: list[Piece], ranks: Alone
) -> Iterator[Callable[[Tick], None]]:
    """Return what copies the pieces of a file, all ranks some."""

    def ready(tick: Tick) -> None:
        with ranks.sharing(make, *files) as do:
            for (_, end), _ in zip(tasks, do(tasks), strict=True):
                tick(end / tasks[-1][1])

    yield ready


@contextmanager
def _beside(
    make: Make[Piece, None], files: tuple[Path, Path], tasks: list[Piece], _: Alone
) -> Iterator[Callable[[Tick], None]]:
    """Return what waits until the pieces of a file are copied, as they are from now on."""
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


@contextmanager
def _mending(source: Path, ours: Path) -> Iterator[Callable[[Piece], None]]:
    """Return what copies some bytes of a file again where they are others in its copy."""
    with _copying(source, ours) as copy, source.open("rb") as given, ours.open("rb") as file:

        def mend(task: Piece) -> None:
            for at, count in _blocks(task):
                if os.pread(given.fileno(), count, at) != os.pread(file.fileno(), count, at):
                    copy((at, at + count))

        yield mend


@contextmanager
def _summing(path: Path) -> Iterator[Callable[[Piece], int]]:
    """Return what finds the CRC-32 of some bytes of a file."""
    with path.open("rb") as file:

        def add_up(task: Piece) -> int:
            found = 0
            for at, count in _blocks(task):
                found = zlib.crc32(os.pread(file.fileno(), count, at), found)
            return found

        yield add_up


def _blocks(task: Piece) -> Iterator[tuple[int, int]]:
    """Yield where the blocks of a piece begin, and their bytes."""
    for at in range(*task, _BLOCK):
        yield at, min(_BLOCK, task[1] - at)
