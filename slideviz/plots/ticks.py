"""Round numbers along an axis, with as many digits as tell them apart."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_LARGE, _SMALL = 1e5, 1e-5
"""Numbers from here on, and differences below, are written with powers of ten."""
_BETWEEN = 1.2
"""Sizes of a label from one to the next, at least."""
_OFF = 0.005
"""The number written at an end may be so wrong, as a part of the range."""


def round_step(width: float, most: int = 6) -> float:
    """Return the smallest round step that goes at most ``most`` times into a width above 0."""
    least = width / most
    power = 10.0 ** math.floor(math.log10(least))
    factor = next((step for step in _STEPS if step * power >= least * (1.0 - 1e-9)), 10.0)
    return factor * power


def ticks(low: float, high: float, most: int = 6) -> FloatArray:
    """Return round numbers, (k,), at equal steps from ``low`` to ``high``, in the range."""
    step = round_step(high - low, most)
    first, last = math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6)
    return np.arange(first, last + 1, dtype=np.float64) * step


def tick_format(at: FloatArray) -> str:
    """Return the printf format of ticks (k,), k > 1, at equal steps: none looks like another."""
    step, largest = float(at[1] - at[0]), float(np.abs(at).max())
    if largest >= _LARGE or step < _SMALL:
        digits = math.ceil(math.log10(largest / step) - 1e-9) if largest > step else 0
        # 2.5e-5 needs a digit that the ratio of both does not tell.
        return f"%.{digits + (not _is_power(step))}e"
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"%.{digits + (round(step * 10.0**digits, 6) % 1 != 0)}f"


def bar_ticks(
    low: float, high: float, part: Callable[[str], float], most: int = 6
) -> tuple[FloatArray, str]:
    """Return the numbers of a colour bar, (k,), and their printf format: ends, and round ones.

    Parameters
    ----------
    low, high : float
        The ends of the bar, which have their numbers always.
    part : callable
        How much of the length of the bar a label takes.
    most : int
        Steps between round numbers; fewer where labels would run together.
    """
    width, ends = high - low, np.array([low, high])
    for count in range(most, 0, -1):
        step = round_step(width, count)
        form = _fine_enough(ends, step)
        room = _BETWEEN * width * max(part(form % end) for end in (low, high))
        if step >= room:
            inner = ticks(low, high, count)
            kept = inner[(inner >= low + room) & (inner <= high - room)]
            return np.concatenate([ends[:1], kept, ends[1:]]), form
    return ends, form


def _fine_enough(ends: FloatArray, step: float) -> str:
    """Return the format of numbers a step apart that also tells the ends (2,) of their range."""
    largest = float(np.abs(ends).max())
    form = tick_format(np.array([largest - step, largest]))
    digits, kind = int(form[2:-1]), form[-1]
    for more in range(4):
        form = f"%.{digits + more}{kind}"
        if all(abs(float(form % end) - end) <= _OFF * (ends[1] - ends[0]) for end in ends):
            break
    return form


def _is_power(step: float) -> bool:
    """Tell whether a step is a whole number of units of its first digit."""
    lead = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    return abs(lead - round(lead)) < 1e-6


def rounded_out(low: float, high: float, most: int = 12) -> tuple[float, float]:
    """Return the range of round numbers that a range of numbers, low <= high, lies in."""
    if not high > low:
        room = max(abs(low), 1e-12) * 0.01
        low, high = low - room, high + room
    step = round_step(high - low, most)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    digits = max(0, 1 - math.floor(math.log10(step)))
    return round(first * step, digits), round(last * step, digits)
