"""Round numbers near the middle of a mesh, between layers of nodes: positions of new sections."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray

_LAYER = 1e-4
"""Nodes whose values differ by less than this part of the span are on one layer."""
_NEAR = 0.03
"""Where no layer is at the middle, a round number may be this far from it, over the span."""


def round_middle(values: FloatArray) -> float:
    """Return a round number near the middle of the nodes' ``values`` (n,), between their layers.

    A section in a layer of nodes would cut the cells of one side or the other, by rounding.
    """
    low, high = float(values.min()), float(values.max())
    middle, span = (low + high) / 2.0, high - low
    if not span > 0:
        return middle
    below, above = _layers_around(values, middle)
    # In the middle half of the cells at the middle (of those above it, where a layer is there).
    room = (above - below) / 4.0
    first, last = below + room, above - room
    near = max(middle - _NEAR * span, first), min(middle + _NEAR * span, last)
    if near[0] <= near[1] and middle - below > _LAYER * span:
        first, last = near
    return roundest(first, last, min(max(middle, first), last))


def _layers_around(values: FloatArray, middle: float) -> tuple[float, float]:
    """Return the layers of nodes next below and above ``middle``; below includes one at it.

    A layer is a value that many more nodes have than by chance; the ends of the values are two.
    """
    low, high = float(values.min()), float(values.max())
    near = _LAYER * (high - low)
    # Of scattered nodes, about so many are as near to each other as those of a layer.
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
    """Return the number with fewest digits from ``first`` to ``last``, nearest to ``wanted``."""
    digits = -int(np.floor(np.log10(max(abs(first), abs(last), 1e-300)))) - 1
    while True:
        unit = 10.0**-digits
        low, high = np.ceil(first / unit), np.floor(last / unit)
        if low <= high or digits > 300:
            return round(float(np.clip(np.round(wanted / unit), low, high)) * unit, digits) + 0.0
        digits += 1
