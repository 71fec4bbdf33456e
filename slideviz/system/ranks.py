"""Ranks: MPI processes, also on several machines, that share the work on the parts of large files.

Rank 0 runs the program; it alone decides, prints and names files. Where it works part by part, all
ranks open the files, and get the next part whenever they are free. Their results come back in
the order of the parts, so that no result depends on the number of ranks: a single process runs the
same code. Between such work the other ranks sleep.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from numba import config, set_num_threads
from threadpoolctl import threadpool_limits

from slideviz.errors import MeshError, SlidevizError
from slideviz.system.platform import cores_of_all, machine_name
from slideviz.system.threads import Result, Task, core_limit, cores, submit_ahead

if TYPE_CHECKING:
    from mpi4py.MPI import Comm, Intracomm

WorkerFactory = Callable[..., AbstractContextManager[Callable[[Task], Result]]]
"""What makes a worker: a context manager with the function that does one task."""
RunTasks = Callable[[Sequence[Task]], Iterator[Result]]
"""A function that does tasks, in parallel, and yields their results in order."""

AHEAD = 4  # results for each rank, at most, that wait for the result of an earlier part
PIECE = 1 << 30  # most bytes of one message: MPI counts them in 32 bits


class SerialPool:
    """A single process without MPI, which does as many parts at a time as it has cores."""

    size = 1

    @contextmanager
    def sharing(
        self, make: WorkerFactory[Task, Result], *arguments: Any
    ) -> Iterator[RunTasks[Task, Result]]:
        """Context with a function that does tasks and yields their results in order.

        ``make``: a function at the top level of a module. Each rank calls it with ``arguments``; it
        returns a context manager with the function that does one task, in any thread, and opens the
        files it needs by itself.
        ``arguments``: arguments of ``make``; they, tasks and results are pickled if there are
        several ranks.
        """
        threads = cores()
        with make(*arguments) as work, core_limit(1), ThreadPoolExecutor(threads) as pool:
            try:
                yield lambda tasks: submit_ahead(pool, threads, work, tasks)
            finally:
                pool.shutdown(cancel_futures=True)


SERIAL = SerialPool()  # the default where no ranks are given


@dataclass(eq=False)
class Ranks(SerialPool):
    """Processes that MPI connects. Rank 0 works in ``with ranks:``; the others call `serve`."""

    comm: Intracomm  # a communicator that only slideviz uses
    threads: int
    """Threads of each rank, while all work: the cores of its machine, divided by the ranks
    there."""
    _owing: set[int] = field(default_factory=set)
    """Ranks with a task whose result rank 0 has not received."""

    @classmethod
    def joined(cls, launched: int) -> Ranks:
        """Return the ranks of the ``launched`` processes; all of them have to call it.

        Raises SlidevizError if mpi4py or an MPI library is missing, or is of another MPI than the
        launcher.
        """
        try:
            # Late: MPI starts with it.
            from mpi4py import MPI
        except ModuleNotFoundError as problem:
            raise SlidevizError(
                f"{launched} processes were started, which needs mpi4py; install it with `pip "
                "install 'slideviz[mpi]'`, and MPI, or start one process"
            ) from problem
        except (ImportError, RuntimeError) as problem:
            raise SlidevizError(
                f"{launched} processes were started, but mpi4py finds no MPI library: "
                f"{' '.join(str(problem).split())}; install one (Debian: openmpi-bin), or build "
                "mpi4py for the one there is"
            ) from problem
        comm = MPI.COMM_WORLD.Dup()
        if comm.size != launched:
            library = MPI.Get_library_version().partition(",")[0].strip("\0 \n")
            raise SlidevizError(
                f"{launched} processes were started, but mpi4py, with {library}, sees {comm.size}; "
                "start them with the mpirun of that MPI, or build mpi4py for yours"
            )
        return cls(comm, _threads_of(comm.Split_type(MPI.COMM_TYPE_SHARED)))

    @property
    def size(self) -> int:  # type: ignore[override]
        """Return the number of processes."""
        return int(self.comm.size)

    @property
    def rank(self) -> int:
        """Return the number of this process, from 0."""
        return int(self.comm.rank)

    def __enter__(self) -> Ranks:
        return self

    def __exit__(self, *_: object) -> None:
        self._send_all(None)

    @contextmanager
    def sharing(
        self, make: WorkerFactory[Task, Result], *arguments: Any
    ) -> Iterator[RunTasks[Task, Result]]:
        """Context with a function that does tasks on all ranks and yields their results in order.

        Only rank 0 calls it; `SerialPool.sharing` has the parameters.
        """
        content = pickle.dumps((make, arguments), 5)
        self._send_all(True)
        self._broadcast(content)
        try:
            with (
                thread_limit(self.threads) as limit,
                make(*arguments) as work,
                # The other threads of this one wait for messages, which must not wait for it.
                ThreadPoolExecutor(1, "slideviz-rank", limit) as pool,
            ):
                yield lambda tasks: self._results(pool, work, tasks)
        finally:
            while self._owing:
                self._received(0.001)
            self._send_all(None)

    def serve(self) -> None:
        """Do tasks for rank 0 in each of its `sharing` contexts, until its ``with ranks:`` ends."""
        with thread_limit(self.threads) as limit:
            limit()
            while self._received(0.01)[1] is not None:
                make, arguments = pickle.loads(self._broadcast(b""))
                with ExitStack() as stack:
                    self._serve(stack, make, arguments)

    def _serve(
        self, stack: ExitStack, make: WorkerFactory[Any, Any], arguments: tuple[Any, ...]
    ) -> None:
        """Do the tasks of one `sharing` context, and send each result or error to rank 0.

        If ``make`` fails, its error is the answer to each task.
        """
        fault = None
        work = None
        try:
            work = stack.enter_context(make(*arguments))
        except Exception as problem:
            fault = self._portable(problem)
        while (order := self._received(0.001)[1]) is not None:
            index, task = order
            result = None
            if work is not None:
                try:
                    fault = None
                    result = work(task)
                except Exception as problem:
                    fault = self._portable(problem)
            self.comm.send((index, result, fault), 0)

    def _results(
        self, pool: ThreadPoolExecutor, work: Callable[[Task], Result], tasks: Sequence[Task]
    ) -> Iterator[Result]:
        """Yield the results of tasks in order, or raise their error; rank 0 works in ``pool``."""
        idle = list(range(1, self.size))
        local: Future[None] | None = None
        results: dict[int, tuple[Any, BaseException | None]] = {}
        begun = done = 0

        def do(index: int) -> None:
            try:
                results[index] = work(tasks[index]), None
            except BaseException as problem:
                results[index] = None, problem

        while done < len(tasks):
            while begun < min(len(tasks), done + AHEAD * self.size) and (idle or local is None):
                if local is None:
                    local = pool.submit(do, begun)
                else:
                    rank = idle.pop()
                    self._owing.add(rank)
                    self.comm.send((begun, tasks[begun]), rank)
                begun += 1
            rank, answer = self._received(0.001, local)
            if local is not None and local.done():
                local = None
            if answer is not None:
                idle.append(rank)
                results[answer[0]] = answer[1:]
            while done in results:
                result, fault = results.pop(done)
                if fault is not None:
                    raise fault
                done += 1
                yield result

    def _received(self, pause: float, other: Future[None] | None = None) -> tuple[int, Any]:
        """Wait for a message and return its sender and content, or (0, None) if ``other`` is done.

        Between looks it sleeps, at most ``pause`` seconds: MPI's own wait would keep a core busy.
        """
        # Late: MPI starts with it.
        from mpi4py import MPI

        status = MPI.Status()
        wait = 1e-5
        while not self.comm.iprobe(status=status):
            if other is not None and other.done():
                return 0, None
            time.sleep(wait)
            wait = min(2 * wait, pause)
        self._owing.discard(status.source)
        return status.source, self.comm.recv(source=status.source)

    def _send_all(self, what: object) -> None:
        for rank in range(1, self.size):
            self.comm.send(what, rank)

    def _broadcast(self, content: bytes) -> bytearray:
        """Return on all ranks the ``content`` of rank 0; the others call it with empty content."""
        size = self.comm.bcast(len(content))
        message = bytearray(content) if content else bytearray(size)
        for at in range(0, size, PIECE):
            self.comm.Bcast(memoryview(message)[at : at + PIECE])
        return message

    def _portable(self, problem: Exception) -> Exception:
        """Return an error that can be pickled; if a file is missing, it names the rank."""
        if isinstance(problem, FileNotFoundError):
            return MeshError(
                f"{problem.filename}: not there for rank {self.rank} on {machine_name()}; put "
                "mesh and results into a folder that all machines see under the same name"
            )
        try:
            pickle.loads(pickle.dumps(problem))
        except Exception:
            return RuntimeError(f"{type(problem).__name__}: {problem}")
        return problem


def _threads_of(near: Comm) -> int:
    """Return the number of threads for each of the ranks ``near``, which are on one machine."""
    return max(1, cores_of_all(near) // near.size)


@contextmanager
def thread_limit(threads: int) -> Iterator[Callable[[], None]]:
    """Context that limits BLAS and `cores` to ``threads``, with a function that limits Numba.

    Numba's limit holds for the thread that calls that function.
    """
    with threadpool_limits(threads, user_api="blas"), core_limit(threads):
        yield lambda: set_num_threads(min(threads, config.NUMBA_NUM_THREADS))
