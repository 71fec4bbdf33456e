"""Round numbers in the middle of many, clear of layers of nodes: where sections start."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray

_LAYER = 1e-4
"""Part of the span of a mesh within which nodes are on one layer."""
_NEAR = 0.03
"""Where no layer is, a round number may be so far from the middle, as a part of the span."""


def round_middle(values: FloatArray) -> float:
    """Return a round number about in the middle of values (n,), well between layers of nodes.

    On a layer rounding decides which cells are cut: those on one side, on the other, or both.
    """
    low, high = float(values.min()), float(values.max())
    middle, span = (low + high) / 2.0, high - low
    if not span > 0:
        return middle
    below, above = _layers_around(values, middle)
    # Cells are cut in their middle half: those that the middle is in, or beyond a layer there.
    room = (above - below) / 4.0
    first, last = below + room, above - room
    near = max(middle - _NEAR * span, first), min(middle + _NEAR * span, last)
    if near[0] <= near[1] and middle - below > _LAYER * span:
        first, last = near
    return roundest(first, last, min(max(middle, first), last))


def _layers_around(values: FloatArray, middle: float) -> tuple[float, float]:
    """Return the layers of nodes that are next to a number; that above, where it is on one."""
    low, high = float(values.min()), float(values.max())
    near = _LAYER * (high - low)
    # Scattered nodes are that near to each other by chance, but only so many of them.
    chance = 2.0 * _LAYER * len(values)
    least = chance + 6.0 * np.sqrt(chance) + 6.0
    rising = np.sort(values)
    count = np.searchsorted(rising, rising + near, "right") - np.searchsorted(
        rising, rising - near, "left"
    )
    layers = np.concatenate([[low], rising[count > least], [high]])
    return (
        float(layers[layers <= middle + near].max()),
        float(layers[layers > middle + near].min()),
    )


def roundest(first: float, last: float, wanted: float) -> float:
    """Return the number of fewest digits from ``first`` to ``last``; of several, the nearest."""
    digits = -int(np.floor(np.log10(max(abs(first), abs(last), 1e-300)))) - 1
    while True:
        unit = 10.0**-digits
        low, high = np.ceil(first / unit), np.floor(last / unit)
        if low <= high or digits > 300:
            return round(float(np.clip(np.round(wanted / unit), low, high)) * unit, digits) + 0.0
        digits += 1
