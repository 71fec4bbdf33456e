"""The file that a streamed run writes: hidden beside its target until it is complete.

A mesh is first a copy of another one, whose points are then changed in place. Its first bytes are
zeros meanwhile, so that no program reads it; at the end they are written, and it is renamed to the
target.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import BinaryIO

from slideviz.errors import MeshError
from slideviz.formats.binary_copy import HEAD
from slideviz.system.atomic import mode_of, reason_of
from slideviz.system.cleanup import open_temporary, removed_at_stop
from slideviz.system.file_checks import require_no_input
from slideviz.system.ranks import SerialPool
from slideviz.system.threads import Tick

_PIECE = 1 << 26  # most bytes that are copied in one task
Piece = tuple[int, int]  # first byte of a range, and the one after the last


def copying(
    source: Path, ours: Path, ranks: SerialPool
) -> AbstractContextManager[Callable[[Tick], None]]:
    """Return a context with a function that waits until a mesh is copied, but for its head.

    ``source`` and ``ours``: the file to copy from, and the existing one to copy to.
    ``ranks``: the processes that copy.
    """
    size = source.stat().st_size
    ends = [*range(_PIECE, size, _PIECE), size]
    tasks = list(zip([HEAD, *ends[:-1]], ends, strict=True))
    way = _beside if ranks.size == 1 else _together
    return way((source, ours), tasks, ranks)


@contextmanager
def _together(
    files: tuple[Path, Path], tasks: list[Piece], ranks: SerialPool
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function in which all ranks do the ``tasks``, by `_copying`."""

    def ready(tick: Tick) -> None:
        with ranks.sharing(_copying, *files) as do:
            for (_, end), _ in zip(tasks, do(tasks), strict=True):
                tick(end / tasks[-1][1])

    yield ready


@contextmanager
def _beside(
    files: tuple[Path, Path], tasks: list[Piece], _: SerialPool
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function that waits for a thread's ``tasks``; its end stops these early."""
    stopped = Event()
    done = 0

    def run() -> None:
        nonlocal done
        with _copying(*files) as copy:
            for task in tasks:
                if stopped.is_set():
                    return
                copy(task)
                done += 1

    with ThreadPoolExecutor(1, "slideviz-copy") as pool:
        future = pool.submit(run)

        def ready(tick: Tick) -> None:
            while not future.done():
                tick(done / len(tasks))
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


@dataclass(eq=False)
class TargetFile:
    """A hidden file that takes the place of its target when it is complete."""

    file: BinaryIO  # open for reading and writing
    path: Path  # its hidden name
    _target: Path
    is_placed: bool = False  # whether it has its target's name

    def place(self, head: bytes) -> None:
        """Write the first bytes of a mesh, after all others, and rename the file to its target."""
        self.file.seek(0)
        self.file.write(head)
        self.file.flush()
        os.fsync(self.file.fileno())
        mode = mode_of(self._target)
        os.fchmod(self.file.fileno(), 0o644 & ~_umask() if mode is None else mode)
        self.path.replace(self._target)
        self.is_placed = True


@contextmanager
def target_file(path: Path, replaces: Path | None = None) -> Iterator[TargetFile]:
    """Context with an empty hidden file beside a target; removed at the end, unless it is placed.

    What a killed process has left of it is overwritten. Raises MeshError if it cannot be written,
    another process is writing it, or the target is an input.
    ``path``: the target. ``replaces``: the input that may be written over.
    """
    require_no_input(path, MeshError, replaces)
    real = Path(os.path.realpath(path))
    ours = real.with_name(f".{real.name}.partial")
    try:
        mode_of(real)
        with open_temporary(ours, new=True) as file:
            _lock(file, ours, path)
            target = TargetFile(file, ours, real)
            with removed_at_stop(ours):
                os.ftruncate(file.fileno(), 0)
                try:
                    yield target
                finally:
                    if not target.is_placed:  # else its name may be another's by now
                        ours.unlink(missing_ok=True)
    except OSError as problem:
        if problem.filename is not None and Path(str(problem.filename)) not in (ours, path):
            raise
        raise MeshError(f"{path}: cannot be written: {reason_of(problem)}") from problem


def _lock(file: BinaryIO, ours: Path, path: Path) -> None:
    """Lock the hidden file of a target, unless another process has it, or just had it."""
    # Late: Windows has none.
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # Between opening and locking, the other process may have renamed it to the target.
        if os.path.samestat(os.fstat(file.fileno()), ours.stat()):
            return
    except OSError as problem:
        if problem.errno not in (errno.EAGAIN, errno.EACCES, errno.ENOENT):
            raise
    raise MeshError(f"{path}: another process is writing it; wait for it, or choose another name")


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now
