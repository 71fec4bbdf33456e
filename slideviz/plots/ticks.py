"""Round numbers along an axis, and number formats with as many digits as tell them apart."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # the round steps, up to a power of ten
_LARGE = 1e5
_SMALL = 1e-5
"""Numbers from `_LARGE` on, or with steps below `_SMALL`, are written with powers of ten."""
_BETWEEN = 1.2  # least distance of two labels, relative to the size of a label
_OFF = 0.005  # largest rounding error of the number at an end, relative to the range


def round_step(width: float, most: int) -> float:
    """Return the smallest round step by which a width above 0 has at most ``most`` steps."""
    least = width / most
    power = 10.0 ** math.floor(math.log10(least))
    factor = next((step for step in _STEPS if step * power >= least * (1.0 - 1e-9)), 10.0)
    return factor * power


def ticks(low: float, high: float, most: int = 6) -> FloatArray:
    """Return ascending round numbers (k,) at equal steps within ``low`` to ``high``."""
    step = round_step(high - low, most)
    first = math.ceil(low / step - 1e-6)
    last = math.floor(high / step + 1e-6)
    return np.arange(first, last + 1, dtype=np.float64) * step


def tick_format(at: FloatArray) -> str:
    """Return the printf format by which ticks (k,), k > 1, at equal steps look different."""
    step = float(at[1] - at[0])
    largest = float(np.abs(at).max())
    if largest >= _LARGE or step < _SMALL:
        digits = math.ceil(math.log10(largest / step) - 1e-9) if largest > step else 0
        # A step such as 2.5e-5 needs one digit more than 1e-5.
        return f"%.{digits + (not _is_power(step))}e"
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"%.{digits + (round(step * 10.0**digits, 6) % 1 != 0)}f"


def bar_ticks(
    low: float, high: float, part: Callable[[str], float], most: int = 6
) -> tuple[FloatArray, str]:
    """Return the numbers (k,) beside a color bar, those of its ends among them, and their format.

    ``part`` returns the size of a label, relative to the length of the bar. ``most``: most steps
    between the round numbers within; fewer if labels would overlap.
    """
    width = high - low
    ends = np.array([low, high])
    for count in range(most, 0, -1):
        step = round_step(width, count)
        form = _fine_enough(ends, step)
        gap = _BETWEEN * width * max(part(form % end) for end in (low, high))
        if step >= gap:
            inner = ticks(low, high, count)
            inside = inner[(inner >= low + gap) & (inner <= high - gap)]
            return np.concatenate([ends[:1], inside, ends[1:]]), form
    return ends, form


def _fine_enough(ends: FloatArray, step: float) -> str:
    """Return the format of numbers a step apart that also shows the ends (2,) nearly exactly."""
    largest = float(np.abs(ends).max())
    form = tick_format(np.array([largest - step, largest]))
    digits = int(form[2:-1])
    kind = form[-1]
    for more in range(4):
        form = f"%.{digits + more}{kind}"
        if all(abs(float(form % end) - end) <= _OFF * (ends[1] - ends[0]) for end in ends):
            break
    return form


def _is_power(step: float) -> bool:
    """Return whether a step has one significant digit only."""
    lead = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    return abs(lead - round(lead)) < 1e-6


def rounded_out(low: float, high: float, most: int = 12) -> tuple[float, float]:
    """Return the smallest range of round numbers that contains ``low`` to ``high``."""
    if not high > low:
        margin = max(abs(low), 1e-12) * 0.01
        low = low - margin
        high = high + margin
    step = round_step(high - low, most)
    first = math.floor(low / step + 1e-9)
    last = math.ceil(high / step - 1e-9)
    digits = max(0, 1 - math.floor(math.log10(step)))
    return round(first * step, digits), round(last * step, digits)
