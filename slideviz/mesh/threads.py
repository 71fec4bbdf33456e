"""Work on long arrays in parts, on all cores.

A part is small enough for its temporary arrays to stay in the cache, and NumPy and compiled loops
leave the interpreter to others meanwhile. What a part gives must not depend on where it begins.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

Tick = Callable[[float], object]
"""Is told the fraction that is done; may raise to stop."""

PART = 16384
"""Rows of a part."""
_most = [sys.maxsize]


def cores() -> int:
    """Return the number of threads to work with: as many as Numba uses, unless fewer are left."""
    from numba import get_num_threads

    return min(int(get_num_threads()), _most[-1])


@contextmanager
def at_most(threads: int) -> Iterator[None]:
    """Return a context in which `cores` is not above that, for other processes need theirs."""
    _most.append(threads)
    try:
        yield
    finally:
        _most.pop()


def in_parts(
    work: Callable[[slice], object], count: int, tick: Callable[[float], object] = lambda _: None
) -> None:
    """Call ``work`` with slices that cut ``count`` rows into parts, on all cores.

    Parameters
    ----------
    work : callable
        Each call writes to places of its own.
    tick : callable
        Called by the calling thread, before each of its parts, with the fraction begun. What it
        raises ends the work, as does what ``work`` raises.
    """
    parts = iter([slice(first, min(first + PART, count)) for first in range(0, count, PART)])

    def rest(tell: Callable[[float], object]) -> None:
        try:
            for part in parts:
                tell(part.start / count)
                work(part)
        except BaseException:
            for _ in parts:  # no thread finds another
                pass
            raise

    helpers = min(cores(), -(-count // PART)) - 1 if count > PART else 0
    if helpers <= 0:
        rest(tick)
        return
    with ThreadPoolExecutor(helpers) as pool:
        others = [pool.submit(rest, lambda _: None) for _ in range(helpers)]
        rest(tick)
    for other in others:
        other.result()


def give_back() -> None:
    """Give freed memory back to the system, which the C library of Linux keeps for later."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
