"""Derivatives of sums of radial functions with respect to the positions of their nodes.

    s(x_i) = sum_j w_j phi(|x_i - c_j| / R)

The derivative of phi with respect to the square of the distance is phi'(xi) / (2 xi R^2), which
needs no square root and has no 0/0 for smooth functions. A node that is a control node itself
stays at distance zero from itself, so that pair adds nothing, whatever the function. The distance
is that of ``compiled.squared_distance``.

Both loops run over targets; the gradient with respect to control nodes is the same loop with
targets and controls exchanged, because the square of the distance is symmetric.
"""

from __future__ import annotations

import numpy as np
from numba import prange

from slideviz.mesh.model import FloatArray
from slideviz.rbf import compiled
from slideviz.rbf.compiled import A2, BLOCK, TARGETS_PER_TASK, distances, fast, one_minus_cos
from slideviz.rbf.evaluate import Basis, padded_rows
from slideviz.rbf.kernels import SHAPE

NEAR = 1e-12  # nodes coincide when their distance over R is at most this


@fast()
def _slope(kind, q, count):  # type: ignore[no-untyped-def]
    """Replace xi by phi'(xi) / (2 xi) in the first ``count`` entries of q; ``kind`` is a code."""
    for j in range(count):
        x = q[j]
        u = max(1.0 - x, 0.0)
        if kind == 0:
            q[j] = -10.0 * u * u * u
        elif kind == 2:
            q[j] = -28.0 / 3.0 * u**5 * (5.0 * x + 1.0)
        elif kind == 3:
            q[j] = -11.0 * u**7 * ((16.0 * x + 7.0) * x + 1.0)
        elif kind == 9:
            q[j] = 0.5 / np.sqrt(A2 + x * x)
        elif kind == 10:
            q[j] = -0.5 * SHAPE / ((A2 + x * x) * np.sqrt(A2 + x * x))
        elif kind == 11:
            q[j] = 1.0
        elif kind == 12:
            q[j] = -1.0 / ((1.0 + x * x) * (1.0 + x * x))
        elif kind == 13:
            q[j] = -np.exp(-x * x)
        elif x <= NEAR or (kind != 8 and x >= 1.0):
            q[j] = 0.0
        elif kind == 1:
            q[j] = -u / x
        elif kind == 4:
            q[j] = -2.5 * u**4 / x
        elif kind == 5:
            q[j] = 110.0 / 3.0 + ((-20.0 / 3.0 * x + 30.0) * x - 60.0) * x + 20.0 * np.log(x)
        elif kind == 6:
            q[j] = -30.0 + ((-15.0 * x + 90.0) * x - 45.0) * x - 90.0 * x * np.log(x)
        elif kind == 7:
            q[j] = -20.0 + ((-40.0 * x - 60.0) * x + 120.0) * x + 120.0 * x * x * np.log(x)
        elif kind == 8:
            q[j] = np.log(x) + 0.5
        else:  # a function whose slope nobody has written
            q[j] = np.nan


@fast(inline="always")
def _sine(g):  # type: ignore[no-untyped-def]
    """Return sin g for |g| <= 2, to 1e-15."""
    t = g * g
    term = g
    total = g
    for k in range(1, 12):
        term *= -t / ((2.0 * k) * (2.0 * k + 1.0))
        total += term
    return total


@fast(parallel=True)
def _reverse(x, c, wx, wc, period_over_pi, scale, kind, out):  # type: ignore[no-untyped-def]
    """Write sum_j (wx_i . wc_j) dphi_ij/dx_i to out (4, N).

    Features x (4, N) and c (4, n), vectors wx (3, N) and wc (3, n) at targets and controls.
    """
    tasks = (x.shape[1] + TARGETS_PER_TASK - 1) // TARGETS_PER_TASK
    twice = 2.0 * scale * scale
    for task in prange(tasks):
        q = np.empty(BLOCK)
        first = task * TARGETS_PER_TASK
        for i in range(first, min(first + TARGETS_PER_TASK, x.shape[1])):
            x0 = x[0, i]
            x1 = x[1, i]
            x2 = x[2, i]
            x3 = x[3, i]
            a0 = wx[0, i]
            a1 = wx[1, i]
            a2 = wx[2, i]
            s0 = 0.0
            s1 = 0.0
            s2 = 0.0
            s3 = 0.0
            for start in range(0, c.shape[1], BLOCK):
                count = min(BLOCK, c.shape[1] - start)
                distances(x[:, i], c, start, count, period_over_pi, scale, q)
                _slope(kind, q, count)
                for j in range(start, start + count):
                    p = (a0 * wc[0, j] + a1 * wc[1, j] + a2 * wc[2, j]) * q[j - start]
                    if period_over_pi > 0.0:
                        g = period_over_pi * (x1 * c[2, j] - x2 * c[1, j])
                        turn = x0 * c[0, j] * _sine(g) * period_over_pi
                        s0 += p * (x0 - c[0, j] + c[0, j] * one_minus_cos(g))
                        s1 += p * turn * c[2, j]
                        s2 -= p * turn * c[1, j]
                    else:
                        s0 += p * (x0 - c[0, j])
                        s1 += p * (x1 - c[1, j])
                        s2 += p * (x2 - c[2, j])
                    s3 += p * (x3 - c[3, j])
            out[0, i] = twice * s0
            out[1, i] = twice * s1
            out[2, i] = twice * s2
            out[3, i] = twice * s3


@fast(parallel=True)
def _forward(x, c, w, dx, dc, period_over_pi, scale, kind, out):  # type: ignore[no-untyped-def]
    """Write the derivative of s as x (4, N) and c (4, n) change by dx and dc, to out (3, N)."""
    tasks = (x.shape[1] + TARGETS_PER_TASK - 1) // TARGETS_PER_TASK
    twice = 2.0 * scale * scale
    for task in prange(tasks):
        q = np.empty(BLOCK)
        first = task * TARGETS_PER_TASK
        for i in range(first, min(first + TARGETS_PER_TASK, x.shape[1])):
            x0 = x[0, i]
            x1 = x[1, i]
            x2 = x[2, i]
            x3 = x[3, i]
            d0 = dx[0, i]
            d1 = dx[1, i]
            d2 = dx[2, i]
            d3 = dx[3, i]
            s0 = 0.0
            s1 = 0.0
            s2 = 0.0
            for start in range(0, c.shape[1], BLOCK):
                count = min(BLOCK, c.shape[1] - start)
                distances(x[:, i], c, start, count, period_over_pi, scale, q)
                _slope(kind, q, count)
                for j in range(start, start + count):
                    change = (x3 - c[3, j]) * (d3 - dc[3, j]) + (x0 - c[0, j]) * (d0 - dc[0, j])
                    if period_over_pi > 0.0:
                        g = period_over_pi * (x1 * c[2, j] - x2 * c[1, j])
                        change += (d0 * c[0, j] + x0 * dc[0, j]) * one_minus_cos(g)
                        turn = d1 * c[2, j] + x1 * dc[2, j] - d2 * c[1, j] - x2 * dc[1, j]
                        change += x0 * c[0, j] * _sine(g) * period_over_pi * turn
                    else:
                        change += (x1 - c[1, j]) * (d1 - dc[1, j])
                        change += (x2 - c[2, j]) * (d2 - dc[2, j])
                    p = q[j - start] * change
                    s0 += w[0, j] * p
                    s1 += w[1, j] * p
                    s2 += w[2, j] * p
            out[0, i] = twice * s0
            out[1, i] = twice * s1
            out[2, i] = twice * s2


def pull_positions(
    basis: Basis,
    targets: FloatArray,
    controls: FloatArray,
    adjoint: FloatArray,
    weights: FloatArray,
) -> FloatArray:
    """Return the gradient of sum_i adjoint_i . s(x_i) with respect to the targets, (k, N).

    For the gradient with respect to the controls, exchange targets with controls and adjoint with
    weights.
    ``targets`` (k, N), ``controls`` (k, n): features, as ``Frame.features`` gives them.
    ``adjoint`` (N, d), ``weights`` (n, d).
    """
    x = padded_rows(targets, 4)
    c = padded_rows(controls, 4)
    out = np.empty((4, x.shape[1]))
    with compiled.one_at_a_time(x.shape[1] * c.shape[1]):
        wx = padded_rows(adjoint.T, 3)
        wc = padded_rows(weights.T, 3)
        _reverse(x, c, wx, wc, *basis.metric, out)
    return out[: len(targets)]


def push_positions(
    basis: Basis,
    targets: FloatArray,
    controls: FloatArray,
    weights: FloatArray,
    *,
    moved: FloatArray | None = None,
    moved_controls: FloatArray | None = None,
) -> FloatArray:
    """Return the derivative (N, d) of s as the features of targets and controls change.

    ``moved`` and ``moved_controls`` (k, N), (k, n), optional: the changes; None: zero.
    """
    x = padded_rows(targets, 4)
    c = padded_rows(controls, 4)
    dx = np.zeros_like(x) if moved is None else padded_rows(moved, 4)
    dc = np.zeros_like(c) if moved_controls is None else padded_rows(moved_controls, 4)
    out = np.empty((3, x.shape[1]))
    with compiled.one_at_a_time(x.shape[1] * c.shape[1]):
        _forward(x, c, padded_rows(weights.T, 3), dx, dc, *basis.metric, out)
    return np.ascontiguousarray(out[: weights.shape[1]].T)
