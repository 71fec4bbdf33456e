"""Work on long arrays in parts, on all cores.

A part is small enough for its temporary arrays to stay in the cache, and NumPy and compiled loops
leave the interpreter to others meanwhile. What a part gives must not depend on where it begins.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

PART = 8192
"""Rows of a part."""


def in_parts(
    work: Callable[[slice], object], count: int, going_on: Callable[[], object] = lambda: None
) -> None:
    """Call ``work`` with slices that cut ``count`` rows into parts, on all cores.

    Parameters
    ----------
    work : callable
        Each call writes to places of its own.
    going_on : callable
        Called by the calling thread before each of its parts; what it raises ends the work, as
        does what ``work`` raises.
    """
    parts = iter([slice(first, min(first + PART, count)) for first in range(0, count, PART)])

    def rest(tell: Callable[[], object]) -> None:
        try:
            for part in parts:
                tell()
                work(part)
        except BaseException:
            for _ in parts:  # no thread finds another
                pass
            raise

    helpers = min(len(os.sched_getaffinity(0)), -(-count // PART)) - 1
    if helpers <= 0:
        rest(going_on)
        return
    with ThreadPoolExecutor(helpers) as pool:
        others = [pool.submit(rest, lambda: None) for _ in range(helpers)]
        rest(going_on)
    for other in others:
        other.result()
