"""Streaming: a mesh larger than memory is deformed from file to file.

The skin (the boundary and the cells at it) is deformed as any mesh in memory. The fields of its
steps then displace all other nodes, block by block, in a copy of the file: by the functions that
displace a mesh in memory, so that no number depends on the blocks. Last, the quality of the cells
is measured block by block.

All ranks write parts of one file with ``pwrite``. MPI-IO would not do: its ``MPI_File_sync``, after
which others see what was written, is a call of all ranks together, while a part is done by one.
Nor is its gathering of small writes needed: parts are long.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from time import monotonic
from typing import BinaryIO, TypeVar

import numpy as np

from slideviz.case.limits import require_streamed
from slideviz.case.model import Case
from slideviz.errors import CaseError, MeshError, NodeError
from slideviz.formats.binary_copy import HEAD
from slideviz.mesh.model import Assembly, Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.zones import zones_of
from slideviz.rbf.problem import PhaseTimer
from slideviz.rbf.projection import Tracks
from slideviz.solver.deform import all_steps, require_memory
from slideviz.solver.growth import stray_warning
from slideviz.solver.interface_motion import InterfaceMotion, joined_steps, zone_runs
from slideviz.solver.prepare import NOT_STREAMED, Prepared, beginning_with, prepare
from slideviz.solver.setup import Setup, make_setup
from slideviz.solver.stepping import Stepping
from slideviz.solver.steps import Progress, Report, RunResult, Step, step_timer
from slideviz.streaming.block_quality import (
    MeasuredBlock,
    QualityCollector,
    RunCollector,
    folded_steps,
    orientations_of,
    require_consistent_orientation,
)
from slideviz.streaming.converting import text_of_binary
from slideviz.streaming.interior import InteriorDisplacer
from slideviz.streaming.skin import without_cells
from slideviz.streaming.source import FileSource, PointTable, ZoneSource
from slideviz.streaming.stream_input import (
    StreamInput,
    open_for_run,
    patched_text,
    require_su2,
    text_size,
)
from slideviz.streaming.streamed_repair import mend_file
from slideviz.system.atomic import atomic_write
from slideviz.system.cleanup import draft, open_temporary
from slideviz.system.platform import copied, give_back, open_unlinked, write_at
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, cuts
from slideviz.terms import FileFormat, SkewMetric

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
        self._metric = metric
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
            size = self._input.texts[0].lines.raw.size
        else:
            blocks = text_of_binary(moved, path.parent)
            size = text_size([zone.place for zone in self.zones])
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
        out = open_unlinked(target, os.O_WRONLY, synced=synced)
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
    write_at(out, rows, table.byte(part[0]))


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
                moved = copied(given.fileno(), file.fileno(), at, end - at)
                if not moved:
                    raise MeshError(f"{given.name}: became shorter while it was read; run it again")
                at += moved
            os.fsync(file.fileno())

        yield copy


SECONDS = {"text": 4.3, "read": 1.0, "solve": 5.0, "evaluate": 3.2, "quality": 2.7, "write": 3.0}
"""Seconds of the stages of a run, measured with two million hexahedra on two cores.

Only their ratios matter. ``text`` is reading a text mesh, ``read`` a binary one, ``solve`` all that
is done with the boundary alone.
"""
LEAST_PART = 0.1
"""Part of a stage that must be done before its remaining time is estimated from its own pace.
Nothing is estimated before stages worth so many seconds of `SECONDS` are done."""


class RemainingTime:
    """The stages of a streamed run: passes each `Progress` on, with the seconds that are left.

    All stages but ``solve`` pass over all points or cells. Their pace is the time that the finished
    ones took over their `SECONDS`. ``solve`` depends on the boundary alone. ``report``: called with
    each `Progress`, its ``left`` filled in. ``stages``: names of `SECONDS`, in order.
    """

    def __init__(self, report: Report, *stages: str) -> None:
        self._report = report
        self._ahead = [(stage, SECONDS[stage]) for stage in stages]
        """The stage that goes on and those after it, with their usual seconds."""
        self._spent = self._usual = 0.0
        self._begin = monotonic()
        self._part = 0.0

    def divide(self, zones: int) -> None:
        """Let the two stages after this one be done for each zone by itself."""
        now, *later = self._ahead
        of_zone = [(stage, seconds / zones) for stage, seconds in later[:2]]
        self._ahead = [now, *of_zone * zones, *later[2:]]

    def next(self) -> None:
        """Begin the next stage."""
        done, seconds = self._ahead.pop(0)
        if done != "solve":
            self._spent += monotonic() - self._begin
            self._usual += seconds
        self._begin = monotonic()
        self._part = 0.0

    def again(self) -> None:
        """Begin the next stage, and let it be done a second time."""
        self._ahead.insert(1, self._ahead[1])
        self.next()

    def __call__(self, progress: Progress) -> None:
        """Pass a progress on, with the seconds that are left."""
        stage = self._ahead[0][0]
        if stage == "solve":
            self._part = (progress.step - 1) / progress.total
            if progress.phase == "classify":  # which is done once, and not for each step
                self._begin = monotonic()
        elif progress.phase == ("read" if stage == "text" else stage):
            self._part = max(self._part, progress.fraction)
        self._report(replace(progress, left=self._left()))

    def _left(self) -> float | None:
        """Return an estimate of the seconds that are left; None before there is enough evidence."""
        (stage, seconds), *later = self._ahead
        now = monotonic() - self._begin
        spent = self._spent
        usual = self._usual
        if stage != "solve":
            spent = spent + now
            usual = usual + seconds * self._part
        if usual < LEAST_PART:
            return None
        pace = spent / usual
        this_stage = max(pace * seconds - now, 0.0)
        if self._part >= LEAST_PART:
            this_stage = now * (1.0 - self._part) / self._part
        return this_stage + pace * sum(seconds for _, seconds in later)


def stream(
    case: Case,
    output: Path,
    *,
    file_format: FileFormat | None = None,
    report: Report = lambda _: None,
    warn: Callable[[str], object] = lambda _: None,
    replaces: Path | None = None,
    listed: int = 100,
    worst: int = 0,
    later: int = 0,
    ranks: SerialPool = SERIAL,
) -> RunResult:
    """Deform the mesh of a case from file to file, with only its skin in memory; return numbers.

    Raises CaseError or MeshError if the case does not fit the mesh, or the mesh is of no format
    that can be streamed, and DeformError if the system cannot be solved, or the method needs the
    whole mesh.
    ``output``: the file of the deformed mesh, written whole or not at all.
    ``file_format``: the format of ``output``; None: by its ending.
    ``report``: called often with a ``Progress``; an exception it raises ends the run at once.
    ``warn``: called with a sentence on what of the mesh the output will lack; with "" if nothing.
    ``replaces``: an input file that the output may overwrite.
    ``listed``: most inverted cells whose first inverted step is found.
    ``worst``: as for `slideviz.mesh.quality.quality_totals`.
    ``later``: bytes for each cell that the caller writes beside the output afterwards: the disk
    must have room for them, too.
    ``ranks``: the processes that share the work; this one is rank 0.
    """
    assert case.mesh_file is not None
    path = case.mesh_file
    require_stream(case)
    total = max(1, case.steps)
    is_text = (file_format or output.suffix.lower().removeprefix(".")) == "su2"
    first = "text" if require_su2(path, case.mesh_format) == "su2" else "read"
    phases = [first, "solve", "evaluate", "quality"]
    if is_text:
        phases.append("write")
    remaining = RemainingTime(report, *phases)
    timer = step_timer(remaining, total, total)
    with ExitStack() as stack:
        file = stack.enter_context(atomic_write(output, replaces=replaces))
        with timer.phase("read") as tick:
            mesh_input = stack.enter_context(
                open_for_run(
                    output,
                    path,
                    case.zone,
                    file_format=case.mesh_format,
                    is_text=is_text,
                    warn=warn,
                    tick=tick,
                    ranks=ranks,
                    later=later,
                )
            )
        out = Output(
            stack,
            mesh_input,
            case.quality_metric,
            file,
            timer,
            ranks,
            is_text=is_text,
        )

        def read() -> Mesh:
            with timer.phase("read") as tick:
                skin = mesh_input.skin(tick, ranks)
            remaining.divide(len(out.zones))
            remaining.next()
            return skin

        zones = _ZoneRuns(out, remaining, listed)
        zones.deform_all(case, read)
        result = zones.result(worst)
        if is_text:
            remaining.next()
        out.finish(zones.moved_boxes())
    return replace(result, seconds=timer.seconds)


class _ZoneRuns:
    """The zones of a streamed mesh, each deformed by its skin: as those of a mesh in memory.

    They are named by their places: 0, 1, ... ``listed``: as of `stream`.
    """

    def __init__(self, out: Output, remaining: RemainingTime, listed: int) -> None:
        self._out = out
        self._remaining = remaining
        self._listed = listed
        self._displacers: dict[int, InteriorDisplacer] = {}
        self._measured: dict[int, RunCollector] = {}
        self._joined: InterfaceMotion | None = None

    def deform_all(self, case: Case, read: Callable[[], Mesh]) -> None:
        """Deform all zones of the skin that ``read`` returns, and write all their points."""
        prepared = prepare(case, read())
        with beginning_with(prepared.doubts):
            skin = prepared.mesh
            if not isinstance(skin, Assembly):
                steps = self._deform(prepared, self._remaining)
                del skin, prepared  # the cells are let go of on the way
                deque(steps, 0)
                return
            self._joined = motion = InterfaceMotion(prepared, skin)
            zone_runs(motion, self._deform, self._remaining)
            last = {zone: displacer.steps[-1] for zone, displacer in self._displacers.items()}
            for zone, after in enumerate(zones_of(motion.after(last))):
                if zone not in last:
                    self._remaining.next()
                    self._out.displace(zone, None)
                    self._remaining.next()
                else:
                    self._close_gaps(zone, last[zone].mesh, after)

    def _close_gaps(self, zone: int, before: Mesh, after: Mesh) -> None:
        """Write those points of a skin into the file that interfaces have changed by rounding."""
        apart = np.flatnonzero(
            (before.points.view(np.int64) != after.points.view(np.int64)).any(axis=1)
        )
        if len(apart):
            numbers = after.numbers(apart)
            points = after.points[apart]
            self._out.change(
                zone, "evaluate", lambda at, file, _: at.points.write(file, numbers, points)
            )
            self._measured.pop(zone, None)

    def _deform(self, prepared: Prepared, report: Report) -> Iterator[Step]:
        """Yield the steps of a zone, whose points are in the file then, mended if asked for.

        With STEPS= auto, trials write all points of the zone to rate them.
        """
        case = prepared.case
        skin = prepared.mesh
        zone = skin.zone - 1 if skin.zone and len(self._out.zones) > 1 else 0
        timer = step_timer(report, 1, max(1, case.steps))
        give_back()
        numbers = skin.numbering.points
        try:
            with timer.phase("classify"):
                setup = make_setup(prepared)
            require_memory(setup, case)
            # Let go of what is not needed any more: cells and joints, after the steps the tracks.
            whole = skin if case.repair != "no" else None
            full = setup if whole else None
            skin = without_cells(skin)
            del prepared
            pairs = np.empty((0, 2), np.int64)
            boundary = replace(setup.boundary, owner=pairs[:, 0], joints=pairs, joint_nodes=pairs)
            setup = replace(setup, boundary=boundary)
            no_tracks = Tracks((), setup.tracks.of_node[:0], setup.tracks.curved)
            lean = replace(setup, tracks=no_tracks, rims=None)
            give_back()

            def rate(steps: Sequence[Step]) -> Quality:
                self._out.displace(zone, InteriorDisplacer(skin, lean, steps))
                return self._out.measure(zone, 0).after.quality()

            steps = tuple(all_steps(Stepping(case, skin, setup, report, timer.seconds, rate)))
        except NodeError as problem:  # which names nodes of the skin
            nodes = numbers[list(problem.nodes)].tolist()
            raise NodeError(problem.sentence, *nodes) from problem
        del setup
        give_back()
        self._remaining.next()
        displacer = self._displacers[zone] = InteriorDisplacer(skin, lean, steps)
        self._out.displace(zone, displacer)
        if whole is not None and full is not None:
            self._remaining.again()
            self._mend(zone, case, whole, full)
        self._remaining.next()
        yield from self._displacers[zone].steps

    def _mend(self, zone: int, case: Case, skin: Mesh, setup: Setup) -> None:
        displacer = self._displacers[zone]
        found = self._measured[zone] = self._out.measure(zone, self._listed, displacer)
        points = displacer.steps[-1].mesh.points
        numbers = setup, points, found.before.quality(), found.after.quality()
        done = self._out.change(
            zone,
            "repair",
            lambda at, file, tick: mend_file(case, at, file, tick, skin, displacer.rigid, *numbers),
        )
        self._displacers[zone] = displacer.repaired(done)
        if len(done.nodes):
            del self._measured[zone]

    def result(self, worst: int) -> RunResult:
        """Return the result, without seconds, after measuring the cells; ``worst`` as `stream`."""
        for zone in range(len(self._out.zones)):
            if zone not in self._measured:
                found = self._out.measure(zone, self._listed, self._displacers.get(zone))
                self._measured[zone] = found
        runs = {
            zone: _steps_of_whole_mesh(displacer, self._measured[zone])
            for zone, displacer in self._displacers.items()
        }
        if self._joined is None:
            skin = self._displacers[0].skin
            steps = runs[0]
            first = [0]
        else:
            motion = self._joined
            skin = without_cells(motion.mesh)
            steps = list(joined_steps(motion, runs))
            first = [part.first_cell for part in motion.mesh.parts]
        folded = {
            start + cell: when
            for zone, start in enumerate(first)
            for cell, when in self._folded(zone, steps).items()
        }
        measured = [self._measured[zone] for zone in range(len(first))]
        after, before = self._out.qualities(measured, worst)
        listed = dict(list(folded.items())[: self._listed])
        return RunResult(skin, tuple(steps), after, before, listed, {})

    def _folded(self, zone: int, steps: Sequence[Step]) -> dict[int, tuple[int, int]]:
        """Return VTK type and first inverted step, of ``steps``, of inverted cells of a zone."""
        cells = self._measured[zone].inverted
        displacer = self._displacers.get(zone)
        if displacer is None:
            return {cell: (vtk, 1) for cell, (vtk, _) in cells.items()}
        found = folded_steps(displacer, self._out.zones[zone], cells)
        parts = [0.0, *(step.part for step in displacer.steps)]
        ends = np.array([0.0, *(step.part for step in steps)])
        return {
            cell: (vtk, int(np.searchsorted(ends, parts[when])))
            for cell, (vtk, when) in found.items()
        }

    def moved_boxes(self) -> list[bytes | None]:
        """Return the boxes for free-form deformation that each zone gets; None: as they were."""
        boxes: list[bytes | None] = [None] * len(self._out.zones)
        for zone, displacer in self._displacers.items():
            moved = displacer.steps[-1].mesh.origin.ffd
            boxes[zone] = None if moved is displacer.skin.origin.ffd else moved
        return boxes


def require_stream(case: Case) -> None:
    """Raise where a case cannot be streamed.

    Raises CaseError if its reference, linear elasticity, relaxation, repair of each step, or one of
    its limits needs the whole mesh at once, and MeshError if its mesh is of no format that can be
    streamed.
    """
    path = case.mesh_file
    assert path is not None
    if case.repair != "no" and case.repair_steps:
        raise CaseError(
            "REPAIR_STEPS= YES needs the whole mesh after each step and cannot be streamed; use "
            "REPAIR_STEPS= NO, or run it without --stream"
        )
    if case.reference_file is not None:
        raise CaseError(NOT_STREAMED)
    if case.relax == "yes" and case.method == "rbf":
        raise CaseError(
            "RELAX= YES needs the whole mesh at once and cannot be streamed; use RELAX= NO or "
            "AUTO, or run it without --stream"
        )
    if case.method == "elastic":
        raise CaseError(
            "METHOD= elastic needs the whole mesh at once and cannot be streamed; use METHOD= rbf "
            "or idw, or run it without --stream"
        )
    require_streamed(case.limits)
    require_su2(path, case.mesh_format)


def _steps_of_whole_mesh(displacer: InteriorDisplacer, measured: RunCollector) -> list[Step]:
    """Return the steps of the skin, with ``node_counts`` and ``safe`` of the whole mesh.

    The last one warns of the node of the whole mesh that went farthest, if it strays.
    """
    skin = displacer.skin
    last = displacer.steps[-1]
    more = skin.file_counts[0] - len(skin.points)
    stray = stray_warning(displacer.setup, skin, last.mesh.points, measured.farthest)
    steps = (*displacer.steps[:-1], replace(last, messages=(*last.messages, *stray)))
    return [
        replace(
            step,
            node_counts={**step.node_counts, "internal": step.node_counts["internal"] + more},
            safe=safe,
        )
        for step, safe in zip(steps, measured.safe, strict=True)
    ]
