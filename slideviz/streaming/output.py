"""The deformed mesh of a streamed run: its points are written, the quality of its cells measured.

All ranks write parts of one file with ``pwrite``. MPI-IO would not do: its ``MPI_File_sync``, after
which others see what was written, is a call of all ranks together, while a part is done by one.
Nor is its gathering of small writes needed: parts are long.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from slideviz.errors import MeshError
from slideviz.formats.binary_copy import HEAD
from slideviz.formats.su2b.write import write_at
from slideviz.mesh.quality import Quality
from slideviz.rbf.problem import PhaseTimer
from slideviz.streaming.converting import text_of_binary
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.quality import (
    MeasuredBlock,
    QualityCollector,
    RunCollector,
    orientations_of,
    require_consistent_orientation,
)
from slideviz.streaming.source import FileSource, PointTable, ZoneSource
from slideviz.streaming.stream_input import StreamInput, patched_text
from slideviz.system.cleanup import draft, open_temporary
from slideviz.system.ranks import SerialPool
from slideviz.system.threads import Tick, cuts
from slideviz.terms import SkewMetric

CHUNK = 1 << 20  # most nodes or cells of a part: one part is in memory at a time
FEWEST = 1 << 16  # fewest nodes or cells of a part, but for the last
PARTS = 1024
"""Parts of a file, within the two limits above: enough for many ranks."""
Part = tuple[int, int]  # a range of nodes or cells: the first, and the one after the last
_PIECE = 1 << 26  # most bytes that are copied in one task
T = TypeVar("T")


class Output:
    """Writes the deformed mesh of a streamed run, and measures the quality of its cells.

    Zones are named by their places: 0, 1, ...
    """

    def __init__(
        self,
        stack: ExitStack,
        mesh_input: StreamInput,
        metric: SkewMetric,
        file: BinaryIO,
        timer: PhaseTimer,
        ranks: SerialPool,
        *,
        is_text: bool,
    ) -> None:
        self._stack = stack
        self._input = mesh_input
        self._file = file
        self._timer = timer
        self._ranks = ranks
        self._is_text = is_text
        every = FileSource.open(stack, (mesh_input.path, mesh_input.zone)).zones
        self.zones = tuple(replace(one, first_cell=0, first_point=0) for one in every)
        """The zones of the undeformed mesh, each with numbers of its own."""
        self._cells = [slice(one.first_cell, one.first_cell + one.n_cells) for one in every]
        self._path = Path(file.name)
        """The file for the deformed points: the new one, or a temporary one beside a text."""
        if is_text:
            self._path = stack.enter_context(draft(self._path.parent))
            with self._path.open("xb") as points:
                points.truncate(mesh_input.path.stat().st_size)
            self._ready: Callable[[Tick], None] = lambda _: None
        else:
            self._ready = stack.enter_context(copying(mesh_input.path, self._path, ranks))
        self._is_oriented: set[int] = set()
        self._metric = metric
        self._collectors: list[QualityCollector] = []

    @cached_property
    def _moved(self) -> Path:
        """Return the file for the deformed points when it can be written; of a text only points."""
        with self._timer.phase("write") as tick:
            self._ready(tick)
        return self._path

    def displace(self, zone: int, displacer: InteriorDisplacer | None) -> None:
        """Write all points of a zone after the last step; without ``displacer`` the undeformed."""
        moved = self._moved
        source = self.zones[zone]
        # Ranks must see what others write, and none write a page back with old bytes of others.
        arguments = *source.undeformed, moved, displacer, self._ranks.size > 1
        todo = parts(source.n_points)
        with (
            self._timer.phase("evaluate") as tick,
            self._ranks.sharing(point_writer, *arguments) as do,
        ):
            for (_, end), _ in zip(todo, do(todo), strict=True):
                tick(end / source.n_points)

    def measure(
        self, zone: int, listed: int, displacer: InteriorDisplacer | None = None
    ) -> RunCollector:
        """Return the quality of a zone's cells, before and after, with ``listed`` inverted ones.

        With ``displacer`` it says how far each of its steps may go.
        Raises MeshError if cells are numbered in both directions, and some are folded.
        """
        moved = self._moved
        source = self.zones[zone]
        count = self._cells[-1].stop
        if not self._collectors:
            arguments = self._stack, moved.parent, count, self._metric
            self._collectors = [QualityCollector(*arguments) for _ in range(2)]
        collector = RunCollector(*(one.of_cells(self._cells[zone]) for one in self._collectors))
        todo = parts(source.n_cells)
        workers = *source.undeformed, moved, self._metric, listed, displacer
        with (
            self._timer.phase("quality") as tick,
            self._ranks.sharing(cell_measurer, *workers) as do,
        ):
            for (_, end), found in zip(todo, do(todo), strict=True):
                collector.add(found, listed)
                tick((self._cells[zone].start + end) / count)
        if len(collector.after.signs) > 1 and zone not in self._is_oriented:
            require_consistent_orientation(source, todo, self._ranks)
            self._is_oriented.add(zone)
        return collector

    def qualities(self, measured: Sequence[RunCollector], worst: int) -> tuple[Quality, Quality]:
        """Return the quality of all zones, after and before; ``worst`` as `quality_totals`."""
        signs = orientations_of(np.concatenate([one.after.signs for one in measured]))
        for collector in self._collectors:
            collector.signs = signs
        after, before = self._collectors
        return after.quality(worst), before.quality()

    def change(self, zone: int, phase: str, work: Callable[[ZoneSource, int, Tick], T]) -> T:
        """Return the result of ``work`` on a zone of the deformed mesh, in the file of its points.

        Its arguments are the zone, the descriptor of that file, and a tick.
        """
        moved = self._moved
        with (
            self._timer.phase(phase) as tick,
            ExitStack() as stack,
            open_temporary(moved) as file,
        ):
            source = FileSource.open(stack, self.zones[zone].undeformed, moved=moved)
            return work(source.zones[0], file.fileno(), tick)

    def finish(self, boxes: Sequence[bytes | None]) -> None:
        """Complete the output; a text gets ``boxes`` of each zone, None: as they were."""
        path = self._moved
        if not self._is_text:
            with self._input.path.open("rb") as file:
                self._file.write(file.read(HEAD))
            return
        written = 0
        # One object, whose lock keeps threads from reading the points of two zones at once.
        there = self.zones[0].file.of(self._stack.enter_context(path.open("rb")))
        moved = [replace(z, points=PointTable(there, z.place), base=z.points) for z in self.zones]
        if self._input.texts:
            blocks = patched_text(self._input.texts, moved, boxes)
        else:
            blocks = text_of_binary(moved, path.parent)
        size = self._input.text_size([zone.place for zone in self.zones])
        with self._timer.phase("write") as tick:
            for block in blocks:
                self._file.write(block)
                written += len(block)
                tick(min(1.0, written / size))
            tick(1.0)


def parts(count: int) -> list[Part]:
    """Return the parts of ``count`` nodes or cells."""
    size = min(CHUNK, max(FEWEST, -(-count // PARTS)))
    return cuts(0, count, size)


@contextmanager
def point_writer(
    path: Path, zone: int, target: Path, displacer: InteriorDisplacer | None, synced: bool
) -> Iterator[Callable[[Part], None]]:
    """Context with a function that writes the deformed points of a part, as `write_points` does.

    Undeformed points are read from a zone of ``path``, deformed ones written to ``target``; with
    ``synced`` they are on the disk when the function returns.
    """
    with ExitStack() as stack:
        (source,) = FileSource.open(stack, (path, zone)).zones
        out = os.open(target, os.O_WRONLY | os.O_NOFOLLOW | (os.O_DSYNC if synced else 0))
        try:
            yield lambda part: write_points(source.points, displacer, out, part)
        finally:
            os.close(out)


def write_points(
    table: PointTable, displacer: InteriorDisplacer | None, out: int, part: Part
) -> None:
    """Write the deformed points of a part to a file descriptor."""
    rows = table.rows(part[0], part[1] - part[0])
    points = rows["x"].astype(np.float64)
    for now in displacer.after_steps(np.arange(*part), points) if displacer else ():
        points = now
    rows["x"] = points
    write_at(out, table.byte(part[0]), rows)


@contextmanager
def cell_measurer(
    path: Path,
    zone: int,
    target: Path,
    metric: SkewMetric,
    listed: int,
    displacer: InteriorDisplacer | None,
) -> Iterator[Callable[[Part], MeasuredBlock]]:
    """Context with a function that measures the cells of a part, as `MeasuredBlock.of` does."""
    with ExitStack() as stack:
        (source,) = FileSource.open(stack, (path, zone), moved=target).zones
        yield lambda part: MeasuredBlock.of(
            source.between(part[0], part[1] - part[0]), metric, listed, displacer
        )


def copying(
    source: Path, ours: Path, ranks: SerialPool
) -> AbstractContextManager[Callable[[Tick], None]]:
    """Return a context with a function that waits until a mesh is copied, but for its head.

    ``source`` and ``ours``: the file to copy from, and the existing one to copy to.
    ``ranks``: the processes that copy.
    """
    tasks = cuts(HEAD, source.stat().st_size, _PIECE)
    way = _beside if ranks.size == 1 else _together
    return way((source, ours), tasks, ranks)


@contextmanager
def _together(
    files: tuple[Path, Path], tasks: list[Part], ranks: SerialPool
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function in which all ranks do the ``tasks``, by `_copying`."""

    def ready(tick: Tick) -> None:
        with ranks.sharing(_copying, *files) as do:
            for (_, end), _ in zip(tasks, do(tasks), strict=True):
                tick(end / tasks[-1][1])

    yield ready


@contextmanager
def _beside(
    files: tuple[Path, Path], tasks: list[Part], _: SerialPool
) -> Iterator[Callable[[Tick], None]]:
    """Context with a function that waits for a thread's ``tasks``; its end stops these early."""
    with _copying(*files) as copy, ThreadPoolExecutor(1, "slideviz-copy") as pool:
        futures = [pool.submit(copy, task) for task in tasks]

        def ready(tick: Tick) -> None:
            for done, future in enumerate(futures):
                while not future.done():
                    tick(done / len(futures))
                    wait([future], 0.05)
                future.result()
            tick(1.0)

        try:
            yield ready
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _copying(source: Path, ours: Path) -> Iterator[Callable[[Part], None]]:
    """Context with a function that copies a piece of a file, onto the disk, to the same place."""
    with source.open("rb") as given, open_temporary(ours) as file:

        def copy(task: Part) -> None:
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
