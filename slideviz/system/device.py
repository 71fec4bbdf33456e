"""The graphics card, where there is one and CuPy to compute on it.

CuPy is imported here alone, and only where it is installed. Arrays on a card have the names of
NumPy, so that the same functions work on both: they take `Arrays`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib.util import find_spec
from typing import Any, Literal

import numpy as np
from scipy.linalg import solve_triangular

from slideviz.argument_types import frozen
from slideviz.errors import DeformError, Message
from slideviz.terms import Device

INSTALL = 'pip install "slideviz[gpu]"'

Place = Literal["cpu", "gpu"]
"""Where arrays are."""


@frozen
class Arrays:
    """An array module, with the two functions whose names differ."""

    module: Any = np
    solve_triangular: Callable[..., Any] = solve_triangular
    to_host: Callable[[Any], Any] = np.asarray  # returns an array of NumPy


HOST = Arrays()


@cache
def card_arrays() -> Arrays:
    """Return CuPy's arrays."""
    # Late: CuPy takes 0.5 s, and is optional.
    import cupy
    from cupyx.scipy.linalg import solve_triangular

    return Arrays(cupy, solve_triangular, partial(cupy.asnumpy, order="A"))


def arrays_at(place: Place) -> Arrays:
    """Return the arrays of a place."""
    return card_arrays() if place == "gpu" else HOST


@cache
def why_no_card() -> Message | None:
    """Return why nothing can be computed on a card, with the remedy; None where it can."""
    if find_spec("cupy") is None:
        return Message("CuPy is not installed", INSTALL)
    try:
        count = card_arrays().module.cuda.runtime.getDeviceCount()
    except Exception as problem:  # CuPy's errors, and those of loading it, have no common base
        return Message(f"CuPy finds no card ({problem})", "install NVIDIA's driver")
    return None if count else Message("this machine has no card of NVIDIA", "use another machine")


def choose_place(device: Device) -> Place:
    """Return where to compute; raises DeformError if a card is asked for, and there is none."""
    if device == "cpu":
        return "cpu"
    lacking = why_no_card()
    if lacking is None:
        return "gpu"
    if device == "auto":
        return "cpu"
    remedy = f"{lacking.remedy}, or use DEVICE= CPU"
    raise DeformError(Message(lacking.rule, remedy, ("DEVICE= GPU",), keys=("DEVICE",)))


def free_on_card() -> int:
    """Return the bytes of the card's memory that are free, or that CuPy keeps for itself."""
    module = card_arrays().module
    free, _ = module.cuda.runtime.memGetInfo()
    return int(free) + int(module.get_default_memory_pool().free_bytes())


def card_name() -> str:
    """Return the name of the card and the size of its memory."""
    facts = card_arrays().module.cuda.runtime.getDeviceProperties(0)
    return f"{facts['name'].decode()}, {facts['totalGlobalMem'] / 2**30:.0f} GiB"
