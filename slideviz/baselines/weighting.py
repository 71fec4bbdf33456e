"""Compiled loops of inverse distance weighting, fused so that nothing else is stored."""

from __future__ import annotations

import numpy as np
from numba import prange

from slideviz.rbf.caching import njit
from slideviz.rbf.compiled import BLOCK, OPTIONS, TARGETS_PER_TASK, half_chord

TINY = 1e-24
"""Square of the distance, over the reference length, below which nodes coincide: there the
weight is so large that no other node counts."""


@njit(inline="always", **OPTIONS)
def _weight(squared, power):  # type: ignore[no-untyped-def]
    """Return distance^-power for the square of a distance."""
    if power == 2.0:
        return 1.0 / squared
    if power == 3.0:
        return 1.0 / (squared * np.sqrt(squared))
    return squared ** (-0.5 * power)


@njit(parallel=True, **OPTIONS)
def weigh(x, c, w, g, power, out):  # type: ignore[no-untyped-def]
    """Write the weighted means to out (3, N).

    Targets x (4, N), sources c (4, n) with values w (3, n) and weights g (n,) of their own.
    """
    c0, c1, c2, c3 = c[0], c[1], c[2], c[3]
    w0, w1, w2 = w[0], w[1], w[2]
    for i in prange(x.shape[1]):
        x0, x1, x2, x3 = x[0, i], x[1, i], x[2, i], x[3, i]
        s0, s1, s2, total = 0.0, 0.0, 0.0, 0.0
        for j in range(c.shape[1]):
            d0, d1, d2, d3 = x0 - c0[j], x1 - c1[j], x2 - c2[j], x3 - c3[j]
            squared = max(d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3, TINY)
            p = g[j] * _weight(squared, power)
            s0 += w0[j] * p
            s1 += w1[j] * p
            s2 += w2[j] * p
            total += p
        out[0, i], out[1, i], out[2, i] = s0 / total, s1 / total, s2 / total


@njit(**OPTIONS)
def _squares(x, c, start, count, half, q):  # type: ignore[no-untyped-def]
    """Write the squares of Eq. 2.15 from one target x (4,) to ``count`` sources from ``start``."""
    c0, c1 = c[0, start : start + count], c[1, start : start + count]
    c2, c3 = c[2, start : start + count], c[3, start : start + count]
    r, sine, cosine, z = x[0], x[1], x[2], x[3]
    for j in range(count):
        dr, dz = r - c0[j], z - c3[j]
        chord = 2.0 * r * c0[j] * half_chord(half * (sine * c2[j] - cosine * c1[j]))
        q[j] = max(dr * dr + chord + dz * dz, TINY)


@njit(**OPTIONS)
def _weigh(q, count, power):  # type: ignore[no-untyped-def]
    """Replace squared distances by distance^-power."""
    if power == 2.0:
        for j in range(count):
            q[j] = 1.0 / q[j]
    elif power == 3.0:
        for j in range(count):
            q[j] = 1.0 / (q[j] * np.sqrt(q[j]))
    else:
        for j in range(count):
            q[j] = q[j] ** (-0.5 * power)


@njit(parallel=True, **OPTIONS)
def weigh_rotational(x, c, w, g, power, half, out):  # type: ignore[no-untyped-def]
    """Write the means as ``weigh`` does, for features (r, sin, cos, z) and Eq. 2.15's distance.

    ``half`` is theta_p / pi. Sources are walked in blocks that stay in the first-level cache:
    with the longer distance the choice of the power would keep one loop from being vectorised.
    """
    tasks = (x.shape[1] + TARGETS_PER_TASK - 1) // TARGETS_PER_TASK
    for task in prange(tasks):
        q = np.empty(BLOCK)
        first = task * TARGETS_PER_TASK
        for i in range(first, min(first + TARGETS_PER_TASK, x.shape[1])):
            s0, s1, s2, total = 0.0, 0.0, 0.0, 0.0
            for start in range(0, c.shape[1], BLOCK):
                count = min(BLOCK, c.shape[1] - start)
                _squares(x[:, i], c, start, count, half, q)
                _weigh(q, count, power)
                for j in range(count):
                    p = g[start + j] * q[j]
                    s0 += w[0, start + j] * p
                    s1 += w[1, start + j] * p
                    s2 += w[2, start + j] * p
                    total += p
            out[0, i], out[1, i], out[2, i] = s0 / total, s1 / total, s2 / total
