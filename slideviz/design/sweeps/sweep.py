"""Sweeps: one mesh deformed by many designs, in many processes or on many machines.

A process of this machine that is lost loses one design only. ``ProcessPoolExecutor`` ends all its
processes when one is lost, and all their work is lost; a pool of Pebble does so where one ends
between two designs, or before its first. Here a thread for each process hands it one call at a
time, and starts another process when it was lost.

The mesh is sent to a process once and kept there, with what is computed once for it (boundary,
undeformed quality); a task is then the case only. A process without the mesh answers so, and is
sent the mesh with its next task.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import time
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
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import cache
from hashlib import blake2b
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock
from typing import Any, NamedTuple, NoReturn

from numba import get_num_threads, set_num_threads
from threadpoolctl import ThreadpoolController

from slideviz import __version__
from slideviz.argument_types import check_types, frozen
from slideviz.case.limits import check_case_limits, outcome
from slideviz.case.model import Case
from slideviz.case.motions.box import box_motions
from slideviz.design.sweeps.table import (
    Design,
    DesignRow,
    SweepResults,
    Table,
    iterations,
    read_designs,
    sources_of,
)
from slideviz.errors import CaseError, DeformError, messages_of, why_failed
from slideviz.formats.files import read, write
from slideviz.formats.table import usual_ending
from slideviz.mesh.model import Mesh, Origin
from slideviz.mesh.quality import quality
from slideviz.solver.deform import deform
from slideviz.solver.prepare import referenced
from slideviz.solver.steps import Step
from slideviz.streaming.run import require_stream, stream
from slideviz.system.cleanup import clean_up, starting
from slideviz.system.platform import (
    interrupt_blocked,
    machine_name,
    termination_waits,
    usable_cores,
)
from slideviz.terms import FileFormat

_KEPT = 2  # number of meshes that a process keeps: that of the sweep, and one of another sweep
_meshes: dict[str, Mesh] = {}  # the meshes of this process, by name
_one_at_a_time = Lock()
"""Held during a task: Numba ends the process if loops of two threads run at once."""


@frozen
class Packed:
    """A mesh as bytes, and a name that is unique to them."""

    name: str
    content: bytes


@frozen
class Task:
    """A design as it is sent to a worker."""

    design: int  # its number, from 1
    case: Case
    mesh: str  # name of the packed mesh
    version: str = __version__  # of the slideviz that sends it
    packed: Packed | None = None  # the mesh, for a worker that lacks it
    output: Path | None = None  # where the deformed mesh is written; None: it is not
    file_format: FileFormat | None = None  # of ``output``; None: as its ending says
    streamed: bool = False  # whether the mesh goes from file to file; no worker needs it then


@frozen
class TaskResult:
    """The result of a task, and the name of the worker; no row where the worker lacks the mesh."""

    worker: str
    row: DesignRow | None = None


def pack_mesh(mesh: Mesh) -> Packed:
    """Return a mesh as bytes, named by their digest."""
    content = pickle.dumps(mesh, protocol=pickle.HIGHEST_PROTOCOL)
    return Packed(blake2b(content, digest_size=16).hexdigest(), content)


def cache_mesh(mesh: Packed) -> str:
    """Keep a mesh in this process; return the name of the process."""
    if mesh.name not in _meshes:
        while len(_meshes) >= _KEPT:
            _meshes.pop(next(iter(_meshes)))
        _meshes[mesh.name] = pickle.loads(mesh.content)
    return _worker_name()


def run_task(task: Task) -> TaskResult:
    """Deform the mesh by a design; return its row. An exception becomes a row with the reason."""
    if task.version != __version__:
        reason = f"the worker {_worker_name()} has slideviz {__version__}, this is {task.version}"
        return TaskResult(
            _worker_name(), DesignRow(task.design, problem=f"{reason}; install the same version")
        )
    with _one_at_a_time:
        if task.packed is not None:
            cache_mesh(task.packed)
        mesh = _meshes.get(task.mesh)
        if mesh is None and not task.streamed:
            return TaskResult(_worker_name())
        begin = time.perf_counter()
        try:
            with nullcontext() if task.streamed else _one_thread():
                row = _result(task, mesh, begin)
        except Exception as problem:
            row = DesignRow(task.design, problem=why_failed(problem, "fewer workers"))
        return TaskResult(_worker_name(), row)


def _result(task: Task, mesh: Mesh | None, begin: float) -> DesignRow:
    """Deform the mesh as ``slideviz run`` does, and return the row."""
    last = None
    errors = []
    if mesh is None:
        assert task.output is not None
        done = stream(task.case, task.output, file_format=task.file_format)
        mesh = done.mesh
        last = done.steps[-1]
        measured = done.quality
        errors = [step.max_error for step in done.steps]
    else:
        for step in deform(task.case, mesh):
            last = step
            errors.append(step.max_error)
        assert last is not None
        measured = quality(last.mesh, reference=mesh, metric=task.case.quality_metric)
    if task.output is not None and not task.streamed:
        write(task.output, last.mesh, base=mesh, file_format=task.file_format)
    return DesignRow(
        design=task.design,
        min=measured.min,
        mean=measured.mean,
        inverted=measured.inverted,
        max_error=max(errors),
        control_nodes=last.control_nodes,
        steps=last.total,
        seconds=time.perf_counter() - begin,
        mesh=task.output,
        warnings=_warnings(last),
        limits=outcome(check_case_limits(task.case, measured, last.mesh, mesh)),
    )


def _warnings(last: Step) -> tuple[str, ...]:
    return tuple(str(one) for one in messages_of(last.messages) if one.level != "note")


def _worker_name() -> str:
    return f"{machine_name()}, process {os.getpid()}"


@contextmanager
def _one_thread() -> Iterator[None]:
    """Context in which loops and linear algebra use one thread: designs run in parallel."""
    before = get_num_threads()
    set_num_threads(1)
    try:
        with _libraries().limit(limits=1):
            yield
    finally:
        set_num_threads(before)


@cache
def _libraries() -> Any:
    """Return the libraries of linear algebra of this process; finding them takes milliseconds."""
    return ThreadpoolController()


_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_STARTS = 2
"""Number of processes in a row that end before their first call, at which no more are started."""


class _Call(NamedTuple):
    future: Future
    work: tuple[Callable, tuple, dict]


class Processes(Executor):
    """An executor with ``count`` processes of this machine, each with one thread.

    A call that was given to no process yet is never lost with one. ``count``: number of processes.
    ``mesh``: sent to each process when it starts.
    """

    def __init__(self, count: int, mesh: Packed) -> None:
        self._max_workers = count
        self._mesh = mesh
        self._lock = threading.Lock()
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._processes: dict[int, SpawnProcess] = {}
        self._threads: list[threading.Thread] = []
        self._failed_starts = 0
        self._cancelled = False
        self.lost = 0
        """Number of processes that ended during a call."""
        self.exit_codes: list[int] = []
        """Exit codes of processes that ended before their first call; negative for a signal."""

    @property
    def why_none_starts(self) -> str:
        """Return why no process starts, after `_STARTS` failures in a row; "" before."""
        if self._failed_starts < _STARTS:
            return ""
        if any(code < 0 for code in self.exit_codes):
            return (
                "processes are killed before they begin, perhaps because memory is short; use "
                "fewer at a time (workers)"
            )
        main = sys.modules["__main__"]
        if main.__package__ == "slideviz" or not str(getattr(main, "__file__", "")).endswith(".py"):
            return "processes end before they begin; their output says why"
        return (
            "processes end before they begin; in a script, the sweep must be under "
            '`if __name__ == "__main__":`, because each process imports the script'
        )

    @property
    def pids(self) -> list[int]:
        """Return the process ids of the processes that run."""
        return list(self._processes)

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Queue a call for the first process that is free; return its future."""
        future: Future = Future()
        self._calls.put(_Call(future, (fn, args, kwargs)))
        if len(self._threads) < self._max_workers:
            thread = threading.Thread(target=self._serve, name="slideviz-sweep", daemon=True)
            self._threads.append(thread)
            thread.start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; with ``cancel_futures`` drop queued calls and kill busy processes."""
        with self._lock:
            self._cancelled = self._cancelled or cancel_futures
            busy = list(self._processes.values()) if cancel_futures else []
        with suppress(Empty):
            while cancel_futures:
                call = self._calls.get_nowait()
                if call is not None:
                    call.future.cancel()
        for process in busy:
            with suppress(OSError, ValueError):
                process.terminate()
        for _ in self._threads:
            self._calls.put(None)
        for thread in self._threads if wait else ():
            thread.join()

    def _serve(self) -> None:
        """Give calls to a process, and to another one when it was lost, until there are no more."""
        process: SpawnProcess | None = None
        connection: Connection | None = None
        while (call := self._calls.get()) is not None:
            if not call.future.set_running_or_notify_cancel():
                continue
            problem: BaseException | None
            try:
                if process is None or connection is None or connection.poll():  # its pipe ended
                    process = None
                    process, connection = self._start()
                connection.send(call.work)
                result, problem = connection.recv()
            except (EOFError, OSError) as ended:
                problem = BrokenProcessPool(str(ended))
                if process is not None:
                    self._discard(process)
                    with self._lock:
                        self.lost += 1
                process = None
            except Exception as unsendable:
                problem = unsendable
            if problem is None:
                call.future.set_result(result)
            else:
                call.future.set_exception(problem)
        if process is not None and connection is not None:
            connection.close()  # which ends it
            self._discard(process)

    def _start(self) -> tuple[SpawnProcess, Connection]:
        """Return a new process that has the mesh, and the pipe to it; EOFError if it ended."""
        context = get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_serve_calls, args=(there, _begin), daemon=True)
        try:
            with _settings_of_workers():
                process.start()
            there.close()
            with self._lock:
                self._processes[process.pid or 0] = process
                if self._cancelled:
                    process.terminate()
            here.send(self._mesh)
            here.recv()
        except (EOFError, OSError, RuntimeError) as problem:  # the last: in a script's import
            exit_code = self._discard(process)
            with self._lock:
                self._failed_starts += 1
                self.exit_codes.append(exit_code)
            raise EOFError(str(problem)) from problem
        self._failed_starts = 0
        return process, here

    def _discard(self, process: SpawnProcess) -> int:
        """Wait for the end of a process, and return its exit code; 0 if it was never started."""
        if process.pid is None:
            return 0
        process.join()
        self._processes.pop(process.pid, None)
        return process.exitcode or 0


@contextmanager
def _settings_of_workers() -> Iterator[None]:
    """Context in which processes are started with one thread, and without a reaction to Ctrl+C.

    A process inherits the signal mask, so that no signal reaches it before it can set its own.
    """
    with starting:
        before = {name: os.environ.get(name) for name in _THREADS}
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        resource_tracker.ensure_running()  # which would unblock the signal where it starts later
        try:
            with interrupt_blocked():
                yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value


def _serve_calls(connection: Connection, begin: Callable[[], None]) -> None:
    """Do the calls that come through a pipe, and send back each result or exception."""
    begin()
    try:
        cache_mesh(connection.recv())
        connection.send(None)
    except (EOFError, OSError):  # the parent has ended meanwhile
        return
    while True:
        try:
            function, arguments, named = connection.recv()
        except (EOFError, OSError):
            return
        answer: tuple[Any, BaseException | None]
        try:
            answer = function(*arguments, **named), None
        except BaseException as problem:
            answer = None, problem
        try:
            connection.send(answer)
        except (pickle.PicklingError, TypeError, AttributeError) as problem:
            connection.send((None, RuntimeError(f"cannot be sent back: {problem}")))
        except OSError:
            return


def _begin() -> None:
    """Prepare a worker: at SIGTERM or at its parent's end it removes its drafts and ends.

    Threads wait for both, for Python's signal handlers run only after a compiled loop.
    """
    for ending in (*termination_waits(), _wait_for_parent):
        threading.Thread(target=_leave_after, args=(ending,), daemon=True).start()


def _wait_for_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()


def _leave_after(ending: Callable[[], object]) -> NoReturn:
    ending()
    _leave()


def _leave() -> NoReturn:
    """Remove drafts and end this process at once."""
    clean_up()
    os._exit(128 + signal.SIGTERM)


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
    mesh = None if mesh is None else referenced(case, mesh)
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
