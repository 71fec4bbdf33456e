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
from slideviz.formats.su2b.elements import element_block
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace, find_zone
from slideviz.formats.su2b.partial import Partial, partial_copy, partial_file
from slideviz.rbf.problem import PhaseTimer
from slideviz.streaming.converting import text_of_binary
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.measuring import MeasuredBlock, PointFiles, QualityCollector, measured
from slideviz.streaming.orientation import facet_sums, require_consistent_orientation
from slideviz.streaming.stream_input import StreamInput, text_blocks
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import require_no_input
from slideviz.system.ranks import SerialPool
from slideviz.terms import Metric

CHUNK = 1 << 20
"""Most nodes or cells of a part: one part is in memory at a time."""
FEWEST = 1 << 16
"""Fewest nodes or cells of a part, but for the last."""
PARTS = 1024
"""Parts of a file, within the two limits above: enough for many ranks. It does not depend on the
number of ranks, for a stopped run may go on with another number of them."""
Part = tuple[int, int]
"""A range of nodes or cells: the first, and the one after the last."""


class Output:
    """Writes the deformed mesh of a streamed run, and measures the quality of its cells."""

    def __init__(
        self,
        stack: ExitStack,
        given: StreamInput,
        metric: Metric,
        output: Path,
        timer: PhaseTimer,
        ranks: SerialPool,
        about: str,
        *,
        is_text: bool,
        resume: bool,
        replaces: Path | None,
    ) -> None:
        self._stack, self._given, self._path, self._watch = stack, given, output, timer
        self._metric, self._ranks, self._is_text, self._replaces = metric, ranks, is_text, replaces
        self._mesh_file, self._zone = given.path, given.zone
        source = BinaryFile(given.path, stack.enter_context(given.path.open("rb")))
        self._place = find_zone(source, given.zone)
        self.files = PointFiles(source, source, self._place)
        """The undeformed and the deformed points. Before the first call of a method that writes or
        measures, the deformed ones are the undeformed."""
        about = f"{about} {is_text} {parts(self._place.n_points)[0]}"
        if is_text:
            require_no_input(output, MeshError, replaces)
            made = partial_file(output, given.path.stat().st_size, about, resume=resume)
        else:
            made = partial_copy(
                output,
                given.path,
                about,
                (_byte(source, self._place, 0), _byte(source, self._place, self._place.n_points)),
                resume=resume,
                replaces=replaces,
                ranks=ranks,
            )
        self._partial = stack.enter_context(made)
        self._is_ready = self._is_oriented = False
        self._rating: QualityCollector | None = None

    def _opened(self) -> Partial:
        """Return the file for the deformed points, after waiting until it can be written.

        It is a copy of the mesh file; where the output is a text, it has only points.
        """
        if not self._is_ready:
            with self._watch.phase("write") as tick:
                self._partial.ready(tick)
                self._check(self._partial, tick)
            after = self.files.before.of(self._partial.file)
            self.files = PointFiles(self.files.before, after, self._place)
            self._is_ready = True
        return self._partial

    def _check(self, partial: Partial, tick: Callable[[float], object]) -> None:
        """Take the parts as not done from the first one on whose bytes do not have its checksum."""
        done = parts(self._place.n_points)[: partial.done]
        given = self._mesh_file, self._zone, partial.path
        with self._ranks.sharing(checking, *given) as do:
            for k, found in enumerate(do(done)):
                if found != partial.sums[k]:
                    partial.note(partial.sums[:k])
                    break
                tick((k + 1) / len(done))

    def found(self) -> str:
        """Return a sentence on how much a stopped run has left to go on with."""
        done, total = self._opened().done, len(parts(self._place.n_points))
        if done:
            return f"{self._path.name}: goes on after {done} of {total} parts"
        if self._given.is_reused:
            return (
                f"{self._path.name}: goes on with the text as it was read; no part is written yet"
            )
        return (
            f"{self._path.name}: there is nothing to go on with, of this case, mesh and version; "
            "it is made from the beginning"
        )

    def displace(self, displacer: InteriorDisplacer, *, final: bool) -> None:
        """Write all points after the last step, but for parts that a stopped run has written.

        Points that are not ``final`` are those of a trial number of steps: all are written, and a
        stopped run does not go on with them.
        """
        partial, total = self._opened(), self._place.n_points
        if not final and partial.done:
            partial.note([])
        # Ranks must see what others write, and none write a page back with old bytes of others.
        synced = final or self._ranks.size > 1
        given = self._mesh_file, self._zone, partial.path, displacer.without_cells(), synced
        with self._watch.phase("evaluate") as tick, self._ranks.sharing(moving, *given) as do:
            todo = parts(total, partial.done)
            for (_, end), checksum in zip(todo, do(todo), strict=True):
                if final:
                    partial.note([*partial.sums, checksum])
                tick(end / total)

    def rating(self, listed: int) -> QualityCollector:
        """Return the quality of all cells, before and after, with ``listed`` inverted ones.

        Raises
        ------
        MeshError
            Cells are numbered in both directions, and some are folded.
        """
        partial, count = self._opened(), self._place.cells.count
        metric = self._metric
        if self._rating is None:
            self._rating = QualityCollector(self._stack, self._path.parent, count, metric)
        self._rating.reset()
        given = self._mesh_file, self._zone, partial.path, metric, listed
        with self._watch.phase("quality") as tick, self._ranks.sharing(measuring, *given) as do:
            for (_, end), found in zip(parts(count), do(parts(count)), strict=True):
                self._rating.add(found, listed)
                tick(end / count)
        if self._rating.has_both_orientations and not self._is_oriented:
            with self._ranks.sharing(facet_sums, self._mesh_file, self._zone) as do:
                require_consistent_orientation(do(parts(count)), self.files.before.name)
            self._is_oriented = True
        return self._rating

    def finish(self, ffd: bytes | None) -> None:
        """Write the output where it is a text; ``ffd`` are its boxes, None: those of the mesh.

        A binary output is complete already.
        """
        if not self._is_text:
            return
        partial, written = self._opened(), 0
        before, after = self.files.before, self.files.after
        if self._given.text is None:
            folder = Path(os.path.realpath(self._path)).parent
            blocks = text_of_binary(before, self._place, after, folder)
        else:
            blocks = text_blocks(self._given, before, self._place, partial.path, ffd)
        with self._watch.phase("write") as tick:
            with atomic_write(self._path, replaces=self._replaces) as file:
                for block in blocks:
                    file.write(block)
                    written += len(block)
                    tick(min(1.0, written / self._given.text_size(self._place)))
            tick(1.0)
        partial.remove()


def parts(count: int, done: int = 0) -> list[Part]:
    """Return the parts of ``count`` nodes or cells, without the first ``done`` parts."""
    size = min(CHUNK, max(FEWEST, -(-count // PARTS)))
    return [(first, min(first + size, count)) for first in range(done * size, count, size)]


@contextmanager
def moving(
    path: Path, zone: int | None, partial: Path, displacer: InteriorDisplacer, synced: bool
) -> Iterator[Callable[[Part], int]]:
    """Context with a function that writes the deformed points of a part, as `move` does.

    Undeformed points are read from a zone of ``path``, deformed ones written to ``partial``; with
    ``synced`` they are on the disk when the function returns.
    """
    with path.open("rb") as file:
        source, place = _zone(path, file, zone)
        out = os.open(partial, os.O_WRONLY | os.O_NOFOLLOW | (os.O_DSYNC if synced else 0))
        try:
            yield lambda part: move(source, place, displacer, out, part)
        finally:
            os.close(out)


def move(
    source: BinaryFile, place: ZonePlace, displacer: InteriorDisplacer, out: int, part: Part
) -> int:
    """Write the deformed points of a part to a file descriptor; return the CRC-32 of its bytes."""
    at = _byte(source, place, part[0])
    rows = source.array(at, part[1] - part[0], source.point(place.dim), "the points")
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
def checking(path: Path, zone: int | None, partial: Path) -> Iterator[Callable[[Part], int]]:
    """Context with a function that returns the CRC-32 of a part as it is in the file."""
    with path.open("rb") as file, partial.open("rb") as other:
        source, place = _zone(path, file, zone)
        kind, written = source.point(place.dim), source.of(other)

        def check(part: Part) -> int:
            at = _byte(source, place, part[0])
            rows = written.array(at, part[1] - part[0], kind, "the points")
            return zlib.crc32(rows.view(np.uint8).data)

        yield check


@contextmanager
def measuring(
    path: Path, zone: int | None, partial: Path, metric: Metric, listed: int
) -> Iterator[Callable[[Part], MeasuredBlock]]:
    """Context with a function that measures the quality of the cells of a part."""
    with path.open("rb") as file, partial.open("rb") as other:
        source, place = _zone(path, file, zone)
        files = PointFiles(source, source.of(other), place)

        def measure(part: Part) -> MeasuredBlock:
            size = part[1] - part[0]
            block = element_block(source, place, place.cells, place.dim, part[0], size)
            return measured(block, *files.cells_of(block), metric, listed)

        yield measure


def _zone(path: Path, file: BinaryIO, zone: int | None) -> tuple[BinaryFile, ZonePlace]:
    source = BinaryFile(path, file)
    return source, find_zone(source, zone)


def _byte(source: BinaryFile, place: ZonePlace, point: int) -> int:
    """Return the place of the point with the number ``point`` in the file, in bytes."""
    return place.points + point * source.point(place.dim).itemsize
