"""The deformed mesh of a streamed run: its points are written, the quality of its cells measured.

All ranks write parts of one file with ``pwrite``. Each part is on the disk before it is noted as
done, so that a stopped run can go on from there. MPI-IO would not do: its ``MPI_File_sync``, after
which others see what was written, is a call of all ranks together, while a part is done by one.
Nor is its gathering of small writes needed: parts are long.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from slideviz.errors import MeshError
from slideviz.formats.su2b.partial import Partial, partial_copy, partial_file
from slideviz.rbf.problem import PhaseTimer
from slideviz.solver.steps import MeshRepair
from slideviz.streaming.converting import text_of_binary
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.quality import (
    MeasuredBlock,
    RunCollector,
    facet_sums,
    require_consistent_orientation,
)
from slideviz.streaming.source import FileSource, PointTable
from slideviz.streaming.stream_input import StreamInput, text_blocks
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import require_no_input
from slideviz.system.ranks import SerialPool
from slideviz.system.threads import Tick
from slideviz.terms import SkewMetric

CHUNK = 1 << 20  # most nodes or cells of a part: one part is in memory at a time
FEWEST = 1 << 16  # fewest nodes or cells of a part, but for the last
PARTS = 1024
"""Parts of a file, within the two limits above: enough for many ranks. It does not depend on the
number of ranks, for a stopped run may go on with another number of them."""
Part = tuple[int, int]  # a range of nodes or cells: the first, and the one after the last


class Output:
    """Writes the deformed mesh of a streamed run, and measures the quality of its cells."""

    def __init__(
        self,
        stack: ExitStack,
        mesh_input: StreamInput,
        metric: SkewMetric,
        output: Path,
        timer: PhaseTimer,
        ranks: SerialPool,
        about: str,
        *,
        is_text: bool,
        resume: bool,
        replaces: Path | None,
    ) -> None:
        self._stack, self._input, self._path, self._timer = stack, mesh_input, output, timer
        self._metric, self._ranks, self._is_text, self._replaces = metric, ranks, is_text, replaces
        self._mesh_file, self._zone = mesh_input.path, mesh_input.zone
        self.source = FileSource.open(stack, (mesh_input.path, mesh_input.zone))
        """The undeformed mesh."""
        points, n_points = self.source.points, self.source.n_points
        about = f"{about} {is_text} {parts(n_points)[0]}"
        if is_text:
            require_no_input(output, MeshError, replaces)
            partial = partial_file(output, mesh_input.path.stat().st_size, about, resume=resume)
        else:
            partial = partial_copy(
                output,
                mesh_input.path,
                about,
                (points.byte(0), points.byte(n_points)),
                resume=resume,
                replaces=replaces,
                ranks=ranks,
            )
        self._partial = stack.enter_context(partial)
        self._is_ready = self._is_oriented = False
        self._collector: RunCollector | None = None

    def _opened(self) -> Partial:
        """Return the file for the deformed points when it can be written; of a text only points."""
        if not self._is_ready:
            with self._timer.phase("write") as tick:
                self._partial.ready(tick)
                self._check(self._partial, tick)
            self._is_ready = True
        return self._partial

    def _check(self, partial: Partial, tick: Callable[[float], object]) -> None:
        """Take the parts as not done from the first one on whose bytes do not have its checksum."""
        done = parts(self.source.n_points)[: partial.done]
        arguments = self._mesh_file, self._zone, partial.path
        with self._ranks.sharing(checksum_reader, *arguments) as do:
            for k, found in enumerate(do(done)):
                if found != partial.sums[k]:
                    partial.note(partial.sums[:k])
                    break
                tick((k + 1) / len(done))

    def resume_message(self) -> str:
        """Return a sentence on how much of a stopped run can be used."""
        done, total = self._opened().done, len(parts(self.source.n_points))
        if done:
            return f"{self._path.name}: continues after {done} of {total} parts"
        if self._input.is_reused:
            return (
                f"{self._path.name}: continues with the text that was read; no part is written yet"
            )
        return (
            f"{self._path.name}: there is nothing to resume of this case, mesh and version; the "
            f"run starts from the beginning"
        )

    def displace(self, displacer: InteriorDisplacer, *, final: bool) -> None:
        """Write all points after the last step, but for parts that a stopped run has written.

        Points that are not ``final`` are those of a trial number of steps: all are written, and a
        stopped run does not go on with them.
        """
        partial, total = self._opened(), self.source.n_points
        if not final and partial.done:
            partial.note([])
        # Ranks must see what others write, and none write a page back with old bytes of others.
        synced = final or self._ranks.size > 1
        arguments = self._mesh_file, self._zone, partial.path, displacer.without_cells(), synced
        with (
            self._timer.phase("evaluate") as tick,
            self._ranks.sharing(point_writer, *arguments) as do,
        ):
            todo = parts(total, partial.done)
            for (_, end), checksum in zip(todo, do(todo), strict=True):
                if final:
                    partial.note([*partial.sums, checksum])
                tick(end / total)

    def measure(self, listed: int, displacer: InteriorDisplacer | None = None) -> RunCollector:
        """Return the quality of all cells, before and after, with ``listed`` inverted ones.

        With ``displacer`` it says how far each of its steps may go.
        Raises MeshError if cells are numbered in both directions, and some are folded.
        """
        partial, count = self._opened(), self.source.n_cells
        metric, folder = self._metric, self._path.parent
        if self._collector is None:
            self._collector = RunCollector(self._stack, folder, count, metric)
        self._collector.reset()
        steps = displacer and displacer.without_cells()
        arguments = self._mesh_file, self._zone, partial.path, metric, listed, steps
        with (
            self._timer.phase("quality") as tick,
            self._ranks.sharing(cell_measurer, *arguments) as do,
        ):
            for (_, end), found in zip(parts(count), do(parts(count)), strict=True):
                self._collector.add(found, listed)
                tick(end / count)
        if len(self._collector.after.signs) > 1 and not self._is_oriented:
            with self._ranks.sharing(facet_sums, self._mesh_file, self._zone) as do:
                require_consistent_orientation(do(parts(count)), self.source.file.name)
            self._is_oriented = True
        return self._collector

    def mend(self, repair: Callable[[FileSource, BinaryIO, Tick], MeshRepair]) -> MeshRepair:
        """Return what ``repair`` did to the deformed mesh, in the file of its points."""
        partial = self._opened()
        zone = self._mesh_file, self._zone
        with self._timer.phase("repair") as tick, ExitStack() as stack:
            return repair(FileSource.open(stack, zone, moved=partial.path), partial.file, tick)

    def finish(self, ffd: bytes | None) -> None:
        """Write the output where it is a text, with the boxes ``ffd``, None: those of the mesh."""
        if not self._is_text:
            return
        partial, written = self._opened(), 0
        source, place = self.source.file, self.source.place
        if self._input.text is None:
            folder = Path(os.path.realpath(self._path)).parent
            moved = FileSource.of(source, place, source.of(partial.file))
            blocks = text_of_binary(moved, folder)
        else:
            blocks = text_blocks(self._input, source, place, partial.path, ffd)
        with self._timer.phase("write") as tick:
            with atomic_write(self._path, replaces=self._replaces) as file:
                for block in blocks:
                    file.write(block)
                    written += len(block)
                    tick(min(1.0, written / self._input.text_size(place)))
            tick(1.0)
        partial.remove()


def parts(count: int, done: int = 0) -> list[Part]:
    """Return the parts of ``count`` nodes or cells, without the first ``done`` parts."""
    size = min(CHUNK, max(FEWEST, -(-count // PARTS)))
    return [(first, min(first + size, count)) for first in range(done * size, count, size)]


@contextmanager
def point_writer(
    path: Path, zone: int | None, partial: Path, displacer: InteriorDisplacer, synced: bool
) -> Iterator[Callable[[Part], int]]:
    """Context with a function that writes the deformed points of a part, as `write_points` does.

    Undeformed points are read from a zone of ``path``, deformed ones written to ``partial``; with
    ``synced`` they are on the disk when the function returns.
    """
    with ExitStack() as stack:
        points = FileSource.open(stack, (path, zone)).points
        out = os.open(partial, os.O_WRONLY | os.O_NOFOLLOW | (os.O_DSYNC if synced else 0))
        try:
            yield lambda part: write_points(points, displacer, out, part)
        finally:
            os.close(out)


def write_points(table: PointTable, displacer: InteriorDisplacer, out: int, part: Part) -> int:
    """Write the deformed points of a part to a file descriptor; return the CRC-32 of its bytes."""
    at, rows = table.byte(part[0]), table.rows(part[0], part[1] - part[0])
    points = rows["x"].astype(np.float64)
    for now in displacer.after_steps(np.arange(*part), points):
        points = now
    rows["x"] = points
    left = rows.view(np.uint8).data
    found = zlib.crc32(left)
    while left:
        written = os.pwrite(out, left, at)
        at, left = at + written, left[written:]
    return found


@contextmanager
def checksum_reader(path: Path, zone: int | None, partial: Path) -> Iterator[Callable[[Part], int]]:
    """Context with a function that returns the CRC-32 of a part as it is in the file."""
    with ExitStack() as stack:
        points = FileSource.open(stack, (path, zone), moved=partial).points
        yield lambda part: zlib.crc32(points.rows(part[0], part[1] - part[0]).view(np.uint8).data)


@contextmanager
def cell_measurer(
    path: Path,
    zone: int | None,
    partial: Path,
    metric: SkewMetric,
    listed: int,
    displacer: InteriorDisplacer | None,
) -> Iterator[Callable[[Part], MeasuredBlock]]:
    """Context with a function that measures the cells of a part, as `MeasuredBlock.of` does."""
    with ExitStack() as stack:
        source = FileSource.open(stack, (path, zone), moved=partial)
        yield lambda part: MeasuredBlock.of(
            source.between(part[0], part[1] - part[0]), metric, listed, displacer
        )
