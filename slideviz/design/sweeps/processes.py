"""Worker processes of this machine for a sweep; one that is lost loses one design only.

``ProcessPoolExecutor`` ends all its processes when one is lost, and all their work is lost. Here
each process has a pool of its own, which is made anew.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context, parent_process, resource_tracker
from typing import Any, NamedTuple, NoReturn

from slideviz.design.sweeps.worker import Packed, cache_mesh
from slideviz.system.cleanup import clean_up

_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"
"""Hides a warning of ``resource_tracker`` when the command is ended by a signal."""
_environment = threading.Lock()
_STARTS = 2
"""Number of processes in a row that end before their first call, at which no more are started."""


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Call(NamedTuple):
    """A call that was submitted."""

    future: Future
    fn: Callable
    args: tuple
    kwargs: dict


class Processes(Executor):
    """An executor with ``count`` processes of this machine, each with one thread.

    While there are enough calls for idle processes, a busy process is given its next call, too, so
    that it need not wait. When the process is lost, that next call goes to another.

    Parameters
    ----------
    count : int
        Number of processes.
    mesh : Packed
        Sent to each process when it starts.
    """

    def __init__(self, count: int, mesh: Packed) -> None:
        self._max_workers = count
        self._mesh = mesh
        self._lock = threading.RLock()
        self._asked: deque[_Call] = deque()
        self._all = tuple(_Process(self) for _ in range(count))
        self._failed_starts = 0
        self._given_up = False
        self.lost = 0
        """Number of processes that ended during a call."""
        self.exit_codes: list[int] = []
        """Exit codes of processes that ended before their first call; negative for a signal."""

    @property
    def why_none_starts(self) -> str:
        """Return why no process starts, after `_STARTS` failures in a row; else an empty text."""
        if self._failed_starts < _STARTS:
            return ""
        if any(code < 0 for code in self.exit_codes):
            return (
                "processes are killed before they begin, perhaps for want of memory; let fewer "
                "work at a time (workers)"
            )
        main = sys.modules["__main__"]
        if main.__package__ == "slideviz" or not str(getattr(main, "__file__", "")).endswith(".py"):
            return "processes end before they begin; what they have printed says why"
        return (
            "processes end before they begin; in a script, the sweep must stand under "
            '`if __name__ == "__main__":`, for each process imports the script'
        )

    @property
    def pids(self) -> list[int]:
        """Return the process ids of the processes that run."""
        return [pid for one in self._all for pid in one.pids]

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Queue a call for the first process that is free; return its future."""
        future: Future = Future()
        with self._lock:
            self._asked.append(_Call(future, fn, args, kwargs))
        self._dispatch()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; with ``cancel_futures`` drop queued calls and kill busy processes."""
        with self._lock:
            asked = list(self._asked) if cancel_futures else []
            if cancel_futures:
                self._asked.clear()
                self._given_up = True
        for call in asked:
            call.future.cancel()
        for one in self._all:
            one.end(wait, kill=cancel_futures)

    def _dispatch(self) -> None:
        """Give queued calls to processes, as many as these take."""
        while True:
            with self._lock:
                one = self._next()
                if one is None:
                    return
                call = self._asked.popleft()
                future = call.future
                if not (future.running() or future.set_running_or_notify_cancel()):
                    continue
                one.load += 1
            one.run(call)

    def _next(self) -> _Process | None:
        """Return the process for the next call: an idle one, else a busy one; None without one."""
        if self._given_up or not self._asked:
            return None
        free = (one for one in self._all if not one.load)
        more = len(self._asked) > self._max_workers
        return next(free, next((one for one in self._all if more and one.takes_more), None))

    def _done(self, one: _Process, call: _Call, inner: Future, *, lost: bool, began: bool) -> None:
        """Pass the result of a call on, or queue the call again, and give out the next ones.

        Parameters
        ----------
        inner
            The future of the call in the process's pool.
        lost
            Whether the process ended during this call, and not during one before it.
        began
            Whether the process had the mesh, and so could do calls.
        """
        problem = BrokenProcessPool() if inner.cancelled() else inner.exception()
        broken = isinstance(problem, BrokenProcessPool)
        again = broken and not lost
        with self._lock:
            one.load -= 1
            if lost:
                self.lost += began
                self._failed_starts = 0 if began else self._failed_starts + 1
            elif began and not broken:
                self._failed_starts = 0
            if again:
                self._asked.appendleft(call)
        if problem is None:
            call.future.set_result(inner.result())
        elif not again:
            call.future.set_exception(problem)
        self._dispatch()


class _Process:
    """A process that is started at its first call, and again when it was lost."""

    def __init__(self, owner: Processes) -> None:
        self._owner = owner
        self.load = 0
        """Number of calls it was given: the one it does, and perhaps the next."""
        self._pool: ProcessPoolExecutor | None = None
        self._begun: Future | None = None
        # Kept, for a pool must not be deleted by its own callback, which holds its lock.
        self._broken: list[ProcessPoolExecutor] = []

    @property
    def pids(self) -> list[int]:
        """Return the process id, or an empty list if it does not run."""
        found = getattr(self._pool, "_processes", None) or {}
        return list(found)

    @property
    def takes_more(self) -> bool:
        """Return whether it has the mesh and does one call, so that it can be given the next."""
        return self.load == 1 and self._begun is not None and _succeeded(self._begun)

    def run(self, call: _Call) -> None:
        """Give the process a call; start it if it does not run."""
        try:
            if self._pool is None:
                self._start()
            assert self._pool is not None
            inner = self._pool.submit(call.fn, *call.args, **call.kwargs)
        except Exception as problem:  # it was lost while it was idle, or cannot be started
            inner = Future()
            inner.set_exception(BrokenProcessPool(str(problem)))
        pool, begun = self._pool, self._begun

        def done(inner: Future) -> None:
            broken = inner.cancelled() or isinstance(inner.exception(), BrokenProcessPool)
            # It does its calls in their order, and they are told so.
            lost = broken and self._discard(pool)
            began = begun is not None and _succeeded(begun)
            if lost and not began:
                ended = (getattr(pool, "_processes", None) or {}).values()
                for one in ended:
                    one.join(1.0)  # its pipe closes a moment before it has an exit code
                self._owner.exit_codes += [one.exitcode or 0 for one in ended]
            self._owner._done(self, call, inner, lost=lost, began=began)

        inner.add_done_callback(done)

    def _start(self) -> None:
        """Start the process and send it the mesh."""
        with _settings_of_workers():
            self._pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_begin)
            self._begun = self._pool.submit(cache_mesh, self._owner._mesh)

    def _discard(self, pool: ProcessPoolExecutor | None) -> bool:
        """Drop a broken pool, so that the next call starts another; False if dropped before."""
        with self._owner._lock:
            if pool is None:
                return True
            if pool in self._broken:
                return False
            self._broken.append(pool)
            self._pool, self._begun = None, None
            return True

    def end(self, wait: bool, kill: bool) -> None:
        """End the process, after its calls or, with ``kill``, at once; ``wait`` for its end."""
        for pool in (*self._broken, *([self._pool] if self._pool is not None else [])):
            if kill:
                for process in list((getattr(pool, "_processes", None) or {}).values()):
                    with suppress(OSError, ValueError, AttributeError):
                        process.terminate()
            pool.shutdown(wait=wait, cancel_futures=kill)


def _succeeded(future: Future) -> bool:
    """Return whether a future is done and has a result."""
    return future.done() and not future.cancelled() and future.exception() is None


@contextmanager
def _settings_of_workers() -> Iterator[None]:
    """Context in which processes are started with one thread, and without a reaction to Ctrl+C.

    A process inherits the signal mask, so that no signal reaches it before it can set its own.
    """
    with _environment:
        before = {name: os.environ.get(name) for name in (*_THREADS, "PYTHONWARNINGS")}
        os.environ.update(dict.fromkeys(_THREADS, "1"))
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, [before["PYTHONWARNINGS"], _QUIET]))
        resource_tracker.ensure_running()  # which would unblock the signal where it starts later
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value


def _begin() -> None:
    """Prepare a worker: at SIGTERM or at its parent's end it removes its drafts and ends.

    Threads wait for both, for Python's signal handlers run only after a compiled loop.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    for wait in (lambda: signal.sigwait({signal.SIGTERM}), _wait_for_parent):
        threading.Thread(target=lambda wait=wait: (wait(), _leave()), daemon=True).start()


def _wait_for_parent() -> None:
    """Wait for the end of the parent process."""
    parent = parent_process()
    assert parent is not None
    parent.join()


def _leave() -> NoReturn:
    """Remove drafts and end this process at once."""
    clean_up()
    os._exit(128 + signal.SIGTERM)
