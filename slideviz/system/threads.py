"""Work on long arrays in parts, on all cores.

A part is small enough for its temporary arrays to stay in the cache. NumPy and compiled loops
release the interpreter's lock, so that threads run in parallel. The result for a row must not
depend on where its part begins.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from numba import get_num_threads

Task = TypeVar("Task")
Result = TypeVar("Result")

Tick = Callable[[float], object]
"""A callback for progress, called with the fraction done; what it raises ends the work."""

PART = 16384  # rows of a part
_most = [sys.maxsize]  # limits of `core_limit` contexts that are open, the innermost last


def cores() -> int:
    """Return the number of threads to work with: Numba's, or the limit of `core_limit` if lower."""
    return min(int(get_num_threads()), _most[-1])


@contextmanager
def core_limit(threads: int) -> Iterator[None]:
    """Context that limits `cores` to ``threads``, to leave the other cores to other processes."""
    _most.append(threads)
    try:
        yield
    finally:
        _most.pop()


def cuts(begin: int, end: int, size: int) -> list[tuple[int, int]]:
    """Return the ends of the parts of a range, in order: at most ``size`` numbers in each."""
    return [(first, min(first + size, end)) for first in range(begin, end, size)]


def in_parts(work: Callable[[slice], object], count: int, tick: Tick = lambda _: None) -> None:
    """Call ``work`` with slices that cut ``count`` rows into parts, on all cores.

    ``work``: each call writes to places of its own.
    ``tick``: called by the calling thread, before each of its parts, with the fraction begun. What
    it raises ends the work, as does what ``work`` raises.
    """
    parts = iter([slice(*ends) for ends in cuts(0, count, PART)])

    def run_remaining(report: Tick) -> None:
        try:
            for part in parts:
                report(part.start / count)
                work(part)
        except BaseException:
            for _ in parts:  # no thread finds another
                pass
            raise

    helpers = min(cores(), -(-count // PART)) - 1 if count > PART else 0
    if helpers <= 0:
        run_remaining(tick)
        return
    with ThreadPoolExecutor(helpers) as pool:
        others = [pool.submit(run_remaining, lambda _: None) for _ in range(helpers)]
        run_remaining(tick)
    for other in others:
        other.result()


def ordered_map(work: Callable[[Task], Result], tasks: Sequence[Task]) -> Iterator[Result]:
    """Yield the result (or raise the error) of ``work`` for each task, in order; on all `cores`."""
    threads = min(cores(), len(tasks))
    if threads < 2:
        yield from map(work, tasks)
        return
    with ThreadPoolExecutor(threads, "slideviz-blocks") as pool:
        yield from submit_ahead(pool, threads, work, tasks)


def submit_ahead(
    pool: ThreadPoolExecutor, threads: int, work: Callable[[Task], Result], tasks: Sequence[Task]
) -> Iterator[Result]:
    """Yield results in order, tasks at most twice the pool's threads ahead: memory is bounded."""
    waiting: deque[Future[Result]] = deque()
    try:
        for task in tasks:
            waiting.append(pool.submit(work, task))
            if len(waiting) > 2 * threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for future in waiting:
            future.cancel()


def progress_share(tick: Tick, begin: float, end: float = 1.0) -> Tick:
    """Return a tick for a part of the work: its 0 to 1 becomes ``begin`` to ``end`` of ``tick``."""
    return lambda done: tick(begin + (end - begin) * done)


def equal_shares(tick: Tick, count: int) -> list[Tick]:
    """Return a tick for each of ``count`` equal parts of the work, in order."""
    return [progress_share(tick, k / count, (k + 1) / count) for k in range(count)]
