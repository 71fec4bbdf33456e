"""Inverse distance weighting as it is written, one pair at a time."""

from __future__ import annotations

import numpy as np

from tests.oracles.radial import Distance, euclidean


def means(targets, sources, values, power: float, weights=None, distance: Distance = euclidean):
    """The mean of the values, weighted with distance^-power; a source itself has its value."""
    out = np.zeros((len(targets), values.shape[1]))
    for i, x in enumerate(targets):
        total = 0.0
        for j, c in enumerate(sources):
            gap = distance(x, c)
            if gap == 0:
                out[i], total = values[j], 1.0
                break
            share = (1.0 if weights is None else weights[j]) * gap ** (-power)
            out[i] += share * values[j]
            total += share
        out[i] /= total
    return out
