"""Sweeps: one mesh deformed by many designs, in many processes or on many machines."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from contextlib import closing, nullcontext
from dataclasses import replace
from pathlib import Path

from slideviz.argument_types import check_types
from slideviz.case.model import Case
from slideviz.case.motions.box import box_motions
from slideviz.design.sweeps.processes import (
    Packed,
    Processes,
    Task,
    TaskResult,
    pack_mesh,
    run_task,
    usable_cores,
)
from slideviz.design.sweeps.results import SweepResults, sources_of
from slideviz.design.sweeps.table import Design, DesignRow, Table, iterations, read_designs
from slideviz.errors import CaseError, DeformError
from slideviz.formats.files import read
from slideviz.formats.table import usual_ending
from slideviz.mesh.model import Mesh, Origin
from slideviz.streaming.run import require_stream

LOST = 3  # number of lost workers at which a design is given up, and its row says so
_EVERY = 0.2  # seconds between two calls of ``going_on``


@check_types
def sweep(
    case: Case,
    designs: Table,
    executor: Executor | None = None,
    *,
    mesh: Mesh | None = None,
    workers: int | None = None,
    folder: str | Path | None = None,
    meshes: bool = False,
    time_step: float | None = None,
    stream: bool = False,
    resume: bool = False,
    force: bool = False,
    going_on: Callable[[], object] = lambda: None,
) -> Iterator[DesignRow]:
    """Return an iterator over the results of designs, in the order in which they finish.

    Each design is deformed as by ``slideviz run`` with its values. The bits are the same if that
    run has one thread; several threads round a large system differently.

    Parameters
    ----------
    case : Case
        Motions and settings for what the designs do not change.
    designs : path, sequence of mappings, or mapping of sequences
        A CSV file, the designs one by one, or the columns; or a pattern with * of displacement
        files, each the design at the time that is the last number in its name. A column is a
        number of a motion, e.g. ``BLADE.translate.y`` or ``motion2.angle_deg``, or a key of the
        case, e.g. ``STEPS``; an empty value means the value of the case.
    executor : concurrent.futures.Executor, optional
        Runs the designs: ``ProcessPoolExecutor``, ``mpi4py.futures.MPIPoolExecutor``, Dask's
        ``client.get_executor()``. Without it, processes of this machine, which are replaced when
        they are lost. Each process works on one design at a time, with one thread, and is sent
        the mesh once.
    mesh : Mesh, optional
        The undeformed mesh; that of the case when left out.
    workers : int, optional
        Processes to start without ``executor``; one for each core when left out.
    folder : path, optional
        Where ``results.csv`` is written, a row as soon as it comes.
    meshes : bool
        Whether the deformed meshes are written to ``folder``, by the workers: as ``design_3.su2``,
        or with a column ``time`` as ``mesh_00010.su2``, where 10 is the time iteration.
    time_step : float, optional
        The time between two iterations; without it, times are the numbers of iterations.
    stream : bool
        Whether meshes go from file to file, one design after the other, with only the boundary in
        memory: for ``meshes`` that are larger than memory.
    resume : bool
        Whether designs that have a result in ``folder`` are left out. Their rows come first.
    force : bool
        Whether results that are in ``folder`` may be overwritten.
    going_on : callable
        Called several times a second while waiting for workers; an exception it raises ends the
        sweep.

    Yields
    ------
    DesignRow
        A design that fails is a row with the reason. A worker that is lost (killed, out of memory)
        loses one design, which is done again.

    Raises
    ------
    CaseError
        The table is wrong, or ``folder`` has other designs' results, or another sweep writes there.
    MeshError
        The mesh cannot be read.
    DeformError
        No process can be started, or the executor takes no work any more.

    Examples
    --------
    Two squares side by side; the left side stays, the right side moves by two distances:

    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import slideviz as sv
    >>> mesh = sv.Mesh(
    ...     [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]],
    ...     sv.Cells.from_blocks([(9, [[0, 1, 4, 3], [1, 2, 5, 4]])]),
    ...     (
    ...         sv.Marker("left", sv.Cells.from_blocks([(3, [[0, 3]])])),
    ...         sv.Marker("right", sv.Cells.from_blocks([(3, [[2, 5]])])),
    ...     ),
    ... )
    >>> case = sv.Case(roles={"right": "moving"}, motions=(sv.Translate("right", (0.5, 0.0)),))
    >>> with ThreadPoolExecutor(1) as pool:
    ...     rows = list(sv.sweep(case, {"motion1.dx": [0.0, 0.5]}, executor=pool, mesh=mesh))
    >>> [round(row.min, 2) for row in rows]
    [1.0, 0.88]
    """
    asked = read_designs(case, designs)
    if workers is not None and workers < 1:
        raise CaseError(f"workers is {workers}; expected 1 or more")
    numbers = iterations(asked, time_step) if meshes or time_step is not None else {}
    if (mesh is None or stream) and case.mesh_file is None:
        raise CaseError("the case names no mesh; give MESH_FILENAME, or mesh=")
    if stream:
        if not meshes or mesh is not None or executor is not None:
            raise CaseError(
                "stream reads and writes meshes from file to file; give meshes=True (--meshes), "
                "and neither mesh nor executor"
            )
        for design in asked.rows:
            require_stream(design.case)
        executor = ThreadPoolExecutor(1)
    elif mesh is None:
        assert case.mesh_file is not None
        mesh = read(case.mesh_file, zone=case.zone, file_format=case.mesh_format)
    if folder is None and (meshes or resume):
        raise CaseError("meshes and resume need a folder; give folder=")
    results = None
    earlier = list[DesignRow]()
    if folder is not None:
        results = SweepResults(Path(folder), asked, sources_of(case, mesh))
        earlier = results.start(resume=resume, force=force, meshes=meshes)
    done = {row.design for row in earlier}
    waiting = deque(row for row in asked.rows if row.number not in done)
    tasks = _Tasks(mesh, asked.rows, Path(folder) if folder and meshes else None, numbers)
    if executor is None:
        count = min(workers or usable_cores(), len(waiting))
        executor = Processes(max(count, 1), tasks.packed)
    return _rows(_Loop(executor, tasks, waiting, going_on), earlier, results)


def _rows(
    loop: _Loop, earlier: list[DesignRow], results: SweepResults | None
) -> Iterator[DesignRow]:
    """Yield the rows of a stopped sweep, then new ones as they come; write new ones to results."""
    rows = list(earlier)
    with closing(loop.rows()) as coming, nullcontext() if results is None else closing(results):
        yield from earlier
        for row in coming:
            if results is not None:
                results.add(row)
            rows.append(row)
            yield row
        if results is not None:
            results.sort(rows)


class _Tasks:
    """Makes workers' tasks: cases, the mesh once, and the folder for deformed meshes or None.

    A mesh that is None stays in its file. ``numbers``: time iterations by design.
    """

    def __init__(
        self,
        mesh: Mesh | None,
        designs: Sequence[Design],
        folder: Path | None,
        numbers: Mapping[int, int],
    ) -> None:
        self._folder = None if folder is None else Path(folder).absolute()
        self._mesh = mesh
        self._width = len(str(len(designs)))
        self._numbers = numbers
        self.packed = Packed("", b"")
        if mesh is None:
            return
        boxes = any(box_motions(design.case) for design in designs)
        # The text of the file, which has boxes besides what writing keeps, is much of a mesh.
        lean = replace(mesh, origin=Origin())
        self.packed = pack_mesh(mesh if boxes or folder is not None else lean)

    def of(self, design: Design, with_mesh: bool) -> Task:
        """Return the task of a design; ``with_mesh``: with the mesh, for a worker that lacks it."""
        case = design.case
        output = None
        if self._folder is not None:
            if case.mesh_out_format:
                ending = f".{case.mesh_out_format}"
            elif self._mesh is None:
                assert case.mesh_file is not None
                ending = case.mesh_file.suffix
            else:
                ending = usual_ending(self._mesh)
            name = f"design_{design.number:0{self._width}d}"
            if self._numbers:
                name = f"mesh_{self._numbers[design.number]:05d}"  # as SU2 numbers files in time
            output = self._folder / f"{name}{ending}"
        return Task(
            design.number,
            case.with_paths(Path.absolute).change(view={}, warnings=()),
            self.packed.name,
            packed=self.packed if with_mesh else None,
            output=output,
            file_format=case.mesh_out_format,
            streamed=self._mesh is None,
        )


class _Loop:
    def __init__(
        self,
        executor: Executor,
        tasks: _Tasks,
        waiting: deque[Design],
        going_on: Callable[[], object],
    ) -> None:
        self._executor = executor
        self._tasks = tasks
        self._waiting = waiting
        self._check = going_on
        self._pending: dict[Future[TaskResult], tuple[Design, bool]] = {}
        self._tries: dict[int, int] = {}
        self.holding: set[str] = set()
        """`holding`, `lacking`: workers that have the mesh, and workers that answered that they
        need it."""
        self.lacking: set[str] = set()
        self._refused = False

    def rows(self) -> Generator[DesignRow, None, None]:
        """Yield the rows as they come; when the generator is closed, cancel submitted calls."""
        try:
            while self._waiting or self._pending:
                self._submit()
                self._check()
                done, _ = wait(self._pending, _EVERY, return_when=FIRST_COMPLETED)
                for future in done:
                    row = self._row(future, self._pending.pop(future)[0])
                    if row is not None:
                        yield row
        finally:
            for future in self._pending:
                future.cancel()
            if isinstance(self._executor, Processes):
                # Stopped also where all is done: to end by itself takes a process a second.
                self._executor.shutdown(cancel_futures=True)

    def _submit(self) -> None:
        """Submit designs until there are three for each worker: one in work, and two in reserve.

        One for each worker that is not known to have the mesh.
        """
        unknown = max(_slots(self._executor) - len(self.holding) - len(self.lacking), 1)
        window = 3 * len(self.holding) + len(self.lacking) + unknown
        sent = sum(with_mesh for _, with_mesh in self._pending.values())
        while self._waiting and len(self._pending) < window:
            with_mesh = sent < len(self.lacking)
            if self._refused and not with_mesh:
                return  # else an idle worker that lacks the mesh would be asked again and again
            design = self._waiting.popleft()
            sent += with_mesh
            try:
                future = self._executor.submit(run_task, self._tasks.of(design, with_mesh))
            except (BrokenExecutor, RuntimeError) as problem:
                raise DeformError(
                    f"the executor takes no more work: {problem}; without an executor, processes "
                    "that are lost are replaced, and with resume=True finished designs are not "
                    "run again"
                ) from problem
            self._pending[future] = design, with_mesh

    def _row(self, future: Future[TaskResult], design: Design) -> DesignRow | None:
        """Return the row of a design; None where it is to be done again."""
        try:
            answer = future.result()
        except Exception as problem:  # whatever goes wrong with a design itself is an answer
            return self._lost(design, problem)
        lost = self._tries.get(design.number, 0)
        if answer.row is None:
            self.lacking.add(answer.worker)
            self._refused = True
            self._waiting.appendleft(design)
            return None
        self._refused = False
        self.lacking.discard(answer.worker)
        self.holding.add(answer.worker)
        return replace(answer.row, values=design.values, lost=lost)

    def _lost(self, design: Design, problem: Exception) -> DesignRow | None:
        """Queue a design again whose worker was lost, and return None; its row if lost too often.

        Raises DeformError where processes of this machine cannot be started.
        """
        if isinstance(self._executor, Processes) and (why := self._executor.why_none_starts):
            raise DeformError(why) from problem
        self.lacking.clear()
        self._refused = False
        lost = self._tries[design.number] = self._tries.get(design.number, 0) + 1
        if lost < LOST:
            self._waiting.appendleft(design)
            return None
        reason = " ".join(f"{type(problem).__name__}: {problem}".split())
        return DesignRow(
            design.number,
            design.values,
            lost=lost,
            problem=f"its worker was lost {lost} times: killed, or out of memory ({reason})",
        )


def _slots(executor: Executor) -> int:
    """Return the number of calls that an executor does at once; 1 if unknown."""
    client = getattr(executor, "_client", None)  # of Dask
    if client is not None and hasattr(client, "nthreads"):
        return sum(client.nthreads().values())
    for name in ("num_workers", "_max_workers"):  # of mpi4py, and of the standard library
        attribute = getattr(executor, name, None)
        if isinstance(attribute, int):
            return attribute
    return 1
