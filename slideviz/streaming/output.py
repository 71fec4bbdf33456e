"""The deformed mesh of a streamed run: its points are written, the quality of its cells measured.

All ranks write parts of one file with ``pwrite``. MPI-IO would not do: its ``MPI_File_sync``, after
which others see what was written, is a call of all ranks together, while a part is done by one.
Nor is its gathering of small writes needed: parts are long.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

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
from slideviz.streaming.target_file import TargetFile, copying
from slideviz.system.atomic import atomic_write
from slideviz.system.ranks import SerialPool
from slideviz.system.threads import Tick
from slideviz.terms import SkewMetric

CHUNK = 1 << 20  # most nodes or cells of a part: one part is in memory at a time
FEWEST = 1 << 16  # fewest nodes or cells of a part, but for the last
PARTS = 1024
"""Parts of a file, within the two limits above: enough for many ranks."""
Part = tuple[int, int]  # a range of nodes or cells: the first, and the one after the last
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
        output: Path,
        target: TargetFile,
        timer: PhaseTimer,
        ranks: SerialPool,
        *,
        is_text: bool,
        replaces: Path | None,
    ) -> None:
        self._stack = stack
        self._input = mesh_input
        self._path = output
        self._timer = timer
        self._ranks = ranks
        self._is_text = is_text
        self._replaces = replaces
        every = FileSource.open(stack, (mesh_input.path, mesh_input.zone)).zones
        self.zones = tuple(replace(one, first_cell=0, first_point=0) for one in every)
        """The zones of the undeformed mesh, each with numbers of its own."""
        self._cells = [slice(one.first_cell, one.first_cell + one.n_cells) for one in every]
        self._target = target
        if is_text:
            os.ftruncate(target.file.fileno(), mesh_input.path.stat().st_size)
            self._ready: Callable[[Tick], None] = lambda _: None
        else:
            self._ready = stack.enter_context(copying(mesh_input.path, target.path, ranks))
        self._is_ready = False
        self._is_oriented: set[int] = set()
        self._metric = metric
        self._collectors: list[QualityCollector] = []

    def _opened(self) -> TargetFile:
        """Return the file for the deformed points when it can be written; of a text only points."""
        if not self._is_ready:
            with self._timer.phase("write") as tick:
                self._ready(tick)
            self._is_ready = True
        return self._target

    def displace(self, zone: int, displacer: InteriorDisplacer | None) -> None:
        """Write all points of a zone after the last step; without ``displacer`` the undeformed."""
        target = self._opened()
        source = self.zones[zone]
        # Ranks must see what others write, and none write a page back with old bytes of others.
        arguments = *source.undeformed, target.path, displacer, self._ranks.size > 1
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
        target = self._opened()
        source = self.zones[zone]
        count = self._cells[-1].stop
        if not self._collectors:
            arguments = self._stack, self._path.parent, count, self._metric
            self._collectors = [QualityCollector(*arguments) for _ in range(2)]
        collector = RunCollector(*(one.of_cells(self._cells[zone]) for one in self._collectors))
        todo = parts(source.n_cells)
        workers = *source.undeformed, target.path, self._metric, listed, displacer
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
        target = self._opened()
        with self._timer.phase(phase) as tick, ExitStack() as stack:
            source = FileSource.open(stack, self.zones[zone].undeformed, moved=target.path)
            return work(source.zones[0], target.file.fileno(), tick)

    def finish(self, boxes: Sequence[bytes | None]) -> None:
        """Complete the output; a text gets ``boxes`` of each zone, None: as they were."""
        target = self._opened()
        if not self._is_text:
            with self._input.path.open("rb") as file:
                target.place(file.read(HEAD))
            return
        written = 0
        # One object, whose lock keeps threads from reading the points of two zones at once.
        there = self.zones[0].file.of(target.file)
        moved = [replace(z, points=PointTable(there, z.place), base=z.points) for z in self.zones]
        if self._input.texts:
            blocks = patched_text(self._input.texts, moved, boxes)
        else:
            blocks = text_of_binary(moved, Path(os.path.realpath(self._path)).parent)
        size = self._input.text_size([zone.place for zone in self.zones])
        with self._timer.phase("write") as tick:
            with atomic_write(self._path, replaces=self._replaces) as file:
                for block in blocks:
                    file.write(block)
                    written += len(block)
                    tick(min(1.0, written / size))
            tick(1.0)


def parts(count: int) -> list[Part]:
    """Return the parts of ``count`` nodes or cells."""
    size = min(CHUNK, max(FEWEST, -(-count // PARTS)))
    return [(first, min(first + size, count)) for first in range(0, count, size)]


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
