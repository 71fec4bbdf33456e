"""Compiled loops: sums and matrices of radial functions, fused so that nothing else is stored.

    s(x_i) = sum_j w_j phi(|x_i - c_j| / R)

The loops run over targets in parallel and over control nodes inside, with every coordinate and
weight in a contiguous row of its own, which lets the compiler vectorise the inner loop. All of
them release the interpreter lock, so a window stays alive meanwhile. ``LOCK`` lets one run at
a time, because Numba's fallback thread pool must not be entered from two threads.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from math import factorial

import numpy as np
from numba import get_num_threads, prange, set_num_threads

from slideviz.mesh.model import FloatArray
from slideviz.rbf.kernels import SHAPE
from slideviz.system.jit_cache import njit

Inputs = Sequence[FloatArray]
"""What a loop takes first: features of targets (k, N) and of controls (k, n), and other arrays."""

Metric = tuple[float, float, int]
"""theta_p / pi, 1 / R and the kernel's code."""

LOCK = threading.Lock()  # held by `one_at_a_time` while a compiled loop runs

SMALL = 2_000_000  # pairs below which waking other threads costs more than it saves


@contextmanager
def one_at_a_time(pairs: int) -> Iterator[None]:
    """Context that holds ``LOCK``, with one thread for work of fewer than ``SMALL`` pairs."""
    with LOCK:
        threads = get_num_threads()
        if pairs < SMALL:
            set_num_threads(1)
        try:
            yield
        finally:
            set_num_threads(threads)


fast = partial(njit, fastmath=True)
"""Decorator `njit` for loops whose sums the compiler may reorder."""

# (1 - cos g) / g^2 as a polynomial in t = g^2. The arguments of Eq. 2.15 stay below 2 (a full
# turn), where nine terms are right to 4e-13; below 1 (half a turn) to the last bit.
_K = tuple((-1.0) ** k / float(factorial(2 * k + 2)) for k in range(9))
_K0, _K1, _K2, _K3, _K4, _K5, _K6, _K7, _K8 = _K


@fast(inline="always")
def _wendland_c2(squared, scale):  # type: ignore[no-untyped-def]
    """Return (1 - q)^4 (4 q + 1) with q = sqrt(squared) * scale, and 0 from q = 1 on."""
    q = np.sqrt(squared) * scale
    u = max(1.0 - q, 0.0)
    u = u * u
    return u * u * (4.0 * q + 1.0)


@fast(inline="always")
def one_minus_cos(g):  # type: ignore[no-untyped-def]
    """Return 1 - cos g without cancellation, for |g| <= 2."""
    t = g * g
    p = _K8 * t + _K7
    p = ((((((p * t + _K6) * t + _K5) * t + _K4) * t + _K3) * t + _K2) * t + _K1) * t + _K0
    return t * p


@fast(inline="always")
def squared_distance(x0, x1, x2, x3, c0, c1, c2, c3, period_over_pi, fourth):  # type: ignore[no-untyped-def]
    """Return the squared distance of features x and c; without ``fourth`` they are three.

    With a rotational period it is (r - r')^2 + (z - z')^2 + 2 r r' (1 - cos g), g = theta_p / pi
    sin(pi (theta - theta') / theta_p) (Eq. 2.15), the sine by the addition theorem. The same
    formula is in ``double_double._distances``, its slope in ``slopes``. What decides is the same
    for all pairs, so that the compiler divides a loop over them.
    """
    d0 = x0 - c0
    if period_over_pi > 0.0:
        d3 = x3 - c3
        return (
            d0 * d0 + 2.0 * x0 * c0 * one_minus_cos(period_over_pi * (x1 * c2 - x2 * c1)) + d3 * d3
        )
    d1 = x1 - c1
    d2 = x2 - c2
    total = d0 * d0 + d1 * d1 + d2 * d2
    if fourth:
        d3 = x3 - c3
        total += d3 * d3
    return total


@fast(parallel=True)
def sum_plain(x, c, w, period_over_pi, scale, out):  # type: ignore[no-untyped-def]
    """Write s at targets x (k, N) to out (3, N), for Wendland C2 and three or four features.

    From controls c (k, n) and weights w (3, n); ``scale`` is 1 / R, here and below.
    ``period_over_pi`` is theta_p / pi, and 0 for Euclidean features.
    """
    last = len(c) - 1
    fourth = last == 3
    c0 = c[0]
    c1 = c[1]
    c2 = c[2]
    c3 = c[last]
    w0 = w[0]
    w1 = w[1]
    w2 = w[2]
    for i in prange(x.shape[1]):
        x0 = x[0, i]
        x1 = x[1, i]
        x2 = x[2, i]
        x3 = x[last, i]
        s0 = 0.0
        s1 = 0.0
        s2 = 0.0
        for j in range(c.shape[1]):
            p = _wendland_c2(
                squared_distance(
                    x0, x1, x2, x3, c0[j], c1[j], c2[j], c3[j], period_over_pi, fourth
                ),
                scale,
            )
            s0 += w0[j] * p
            s1 += w1[j] * p
            s2 += w2[j] * p
        out[0, i] = s0
        out[1, i] = s1
        out[2, i] = s2


@fast(parallel=True)
def near_boxes(x, low, high, reach, out):  # type: ignore[no-untyped-def]
    """Write to out (N,) whether targets x (k, N) are at most ``reach`` from a box.

    Boxes have the lowest and highest coordinates ``low`` and ``high`` (k, b).
    """
    for i in prange(x.shape[1]):
        out[i] = False
        for b in range(low.shape[1]):
            square = 0.0
            for k in range(x.shape[0]):
                off = max(low[k, b] - x[k, i], x[k, i] - high[k, b], 0.0)
                square += off * off
            if square <= reach * reach:
                out[i] = True
                break


A2 = SHAPE * SHAPE
BLOCK = 256  # control nodes in a block of sum_any, whose distances stay in the first-level cache
TARGETS_PER_TASK = 64


@fast()
def _apply(kind, q, count):  # type: ignore[no-untyped-def]
    """Replace xi by phi(xi) in the first ``count`` entries of q; ``kind`` is the kernel's code."""
    if kind == 0:
        for j in range(count):
            u = max(1.0 - q[j], 0.0)
            u = u * u
            q[j] = u * u * (4.0 * q[j] + 1.0)
    elif kind == 1:
        for j in range(count):
            u = max(1.0 - q[j], 0.0)
            q[j] = u * u
    elif kind == 2:
        for j in range(count):
            u = max(1.0 - q[j], 0.0)
            q[j] = u**6 * ((35.0 / 3.0 * q[j] + 6.0) * q[j] + 1.0)
    elif kind == 3:
        for j in range(count):
            u = max(1.0 - q[j], 0.0)
            q[j] = u**8 * (((32.0 * q[j] + 25.0) * q[j] + 8.0) * q[j] + 1.0)
    elif kind == 4:
        for j in range(count):
            q[j] = max(1.0 - q[j], 0.0) ** 5
    elif kind <= 7:
        for j in range(count):
            x = min(max(q[j], 1e-300), 1.0)
            a = x * x
            b = x * x * x
            log = np.log(x)
            if x >= 1.0:
                q[j] = 0.0  # exactly, where the formulas leave rounding
            elif kind == 5:
                q[j] = 1.0 + 80.0 / 3.0 * a - 40.0 * b + 15.0 * a * a - 8.0 / 3.0 * a * b
                q[j] += 20.0 * a * log
            elif kind == 6:
                q[j] = 1.0 - 30.0 * a - 10.0 * b + 45.0 * a * a - 6.0 * a * b - 60.0 * b * log
            else:
                q[j] = 1.0 - 20.0 * a + 80.0 * b - 45.0 * a * a - 16.0 * a * b + 60.0 * a * a * log
    elif kind == 8:
        for j in range(count):
            q[j] = q[j] * q[j] * np.log(max(q[j], 1e-300))
    elif kind == 9:
        for j in range(count):
            q[j] = np.sqrt(A2 + q[j] * q[j])
    elif kind == 10:
        for j in range(count):
            q[j] = SHAPE / np.sqrt(A2 + q[j] * q[j])
    elif kind == 11:
        for j in range(count):
            q[j] = 1.0 + q[j] * q[j]
    elif kind == 12:
        for j in range(count):
            q[j] = 1.0 / (1.0 + q[j] * q[j])
    else:
        for j in range(count):
            q[j] = np.exp(-q[j] * q[j])


@fast()
def distances(x, c, start, count, period_over_pi, scale, q):  # type: ignore[no-untyped-def]
    """Write xi, distance over R, from one target x (4,) to ``count`` controls from ``start`` on."""
    c0 = c[0, start : start + count]
    c1 = c[1, start : start + count]
    c2 = c[2, start : start + count]
    c3 = c[3, start : start + count]
    x0 = x[0]
    x1 = x[1]
    x2 = x[2]
    x3 = x[3]
    for j in range(count):
        squared = squared_distance(x0, x1, x2, x3, c0[j], c1[j], c2[j], c3[j], period_over_pi, True)
        q[j] = np.sqrt(squared) * scale


@fast(parallel=True)
def sum_any(x, c, w, period_over_pi, scale, kind, out):  # type: ignore[no-untyped-def]
    """Write s at targets x (4, N) to out (3, N), for any kernel and four features.

    Control nodes are walked in blocks that stay in the first-level cache: distances go to a
    small buffer, the function is applied to the buffer, and it is summed up. So the choice of
    distance and function costs one branch for each block, not for each pair.
    """
    tasks = (x.shape[1] + TARGETS_PER_TASK - 1) // TARGETS_PER_TASK
    for task in prange(tasks):
        q = np.empty(BLOCK)
        first = task * TARGETS_PER_TASK
        for i in range(first, min(first + TARGETS_PER_TASK, x.shape[1])):
            s0 = 0.0
            s1 = 0.0
            s2 = 0.0
            for start in range(0, c.shape[1], BLOCK):
                count = min(BLOCK, c.shape[1] - start)
                distances(x[:, i], c, start, count, period_over_pi, scale, q)
                _apply(kind, q, count)
                w0 = w[0, start : start + count]
                w1 = w[1, start : start + count]
                w2 = w[2, start : start + count]
                for j in range(count):
                    s0 += w0[j] * q[j]
                    s1 += w1[j] * q[j]
                    s2 += w2[j] * q[j]
            out[0, i] = s0
            out[1, i] = s1
            out[2, i] = s2


@fast(parallel=True)
def fill_matrix(x, c, across, along, period_over_pi, scale, kind, out):  # type: ignore[no-untyped-def]
    """Write G_ab = phi(|x_a - c_b|) (m_a . n_b) to out (N, n).

    ``x`` (4, N) and ``c`` (4, n) have the features of each constraint's node, ``across`` (d, N)
    and ``along`` (d, n) its unit direction; d = 0 leaves the dot product out. ``kind`` is the
    kernel's code; ``period_over_pi`` is 0 for Euclidean features.
    """
    d = across.shape[0]
    n = c.shape[1]
    for a in prange(x.shape[1]):
        row = out[a]
        distances(x[:, a], c, 0, n, period_over_pi, scale, row)
        _apply(kind, row, n)
        if d > 0:
            for b in range(n):
                dot = 0.0
                for k in range(d):
                    dot += across[k, a] * along[k, b]
                row[b] *= dot
