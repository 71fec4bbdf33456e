"""Descent to a minimum: L-BFGS with a preconditioner, and a line search of Wolfe's conditions."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray

CORRECTIONS = 15
"""Pairs of steps and changes of the gradient that L-BFGS remembers."""

ARMIJO, WOLFE = 1e-4, 0.9
"""A step must bring this part of the decrease that the slope promises, and leave at most this part
of the slope."""

TRIES = 30
"""Most evaluations of a line search."""

WINDOW = 10
"""Iterations over which the decrease of the value is looked at."""

Pairs = deque[tuple[FloatArray, FloatArray, float, float]]
"""Steps s, changes y of the gradient, their product, and that over the preconditioned y's."""

Function = Callable[[FloatArray], tuple[float, FloatArray]]
"""Returns value and gradient (b, d) at unknowns (b, d)."""


def dot(a: FloatArray, b: FloatArray) -> float:
    """Return the sum of products of (b, d); its bits do not depend on a number of threads."""
    return float(np.einsum("i,i", a.ravel(), b.ravel()))


def descend(
    function: Function,
    start: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    longest: Callable[[FloatArray, FloatArray], float],
    *,
    iterations: int,
    decrease: Callable[[], float],
) -> FloatArray:
    """Return the unknowns (b, d) to which L-BFGS comes from ``start`` (b, d).

    Parameters
    ----------
    function : callable
        May return infinity for the value where a step is too long.
    precondition : callable
        Takes a gradient (b, d), returns about the inverse Hessian times it.
    longest : callable
        The longest step from unknowns along a direction, at most infinity.
    iterations : int
        Most of them.
    decrease : callable
        Called after each iteration: it ends where `WINDOW` of them lowered the value by less than
        this part.
    """
    x = start
    value, gradient = function(x)
    pairs: Pairs = deque(maxlen=CORRECTIONS)
    values = [value]
    for _ in range(iterations):
        direction = -_inverse_times(gradient, pairs, precondition)
        slope = dot(gradient, direction)
        if not slope < 0:  # by rounding only
            pairs.clear()
            direction = -precondition(gradient)
            slope = dot(gradient, direction)
            if not slope < 0:
                break
        most = longest(x, direction)
        step = _search(function, x, value, direction, slope, most)
        if step is None:
            if not pairs:
                break
            pairs.clear()
            continue
        length, new_value, new_gradient = step
        s, y = length * direction, new_gradient - gradient
        curvature = dot(s, y)
        if curvature > 0:
            pairs.append((s, y, curvature, curvature / dot(y, precondition(y))))
        x, value, gradient = x + s, new_value, new_gradient
        values.append(value)
        least = decrease()
        if len(values) > WINDOW and values[-1 - WINDOW] - value <= least * abs(value):
            break
    return x


def _inverse_times(
    gradient: FloatArray,
    pairs: Pairs,
    precondition: Callable[[FloatArray], FloatArray],
) -> FloatArray:
    """Return the inverse Hessian of L-BFGS times the gradient (Nocedal's two loops)."""
    out, factors = gradient.copy(), []
    for s, y, curvature, _ in reversed(pairs):
        factors.append(dot(s, out) / curvature)
        out -= factors[-1] * y
    out = precondition(out)
    if pairs:
        out *= pairs[-1][3]
    for (s, y, curvature, _), factor in zip(pairs, reversed(factors), strict=True):
        out += (factor - dot(y, out) / curvature) * s
    return out


def _search(
    function: Function,
    x: FloatArray,
    value: float,
    direction: FloatArray,
    slope: float,
    most: float,
) -> tuple[float, float, FloatArray] | None:
    """Return a step, the value and the gradient there, or None if no step lowers the value.

    By bisection (A. Lewis, M. Overton, Nonsmooth optimization via quasi-Newton methods, 2013).
    """
    low, high, step = 0.0, most, min(1.0, most)
    best = None
    for _ in range(TRIES):
        new_value, gradient = function(x + step * direction)
        if not new_value <= value + ARMIJO * step * slope:
            high = step
        else:
            best = step, new_value, gradient
            if step >= most or dot(gradient, direction) >= WOLFE * slope:
                break
            low = step
        step = 0.5 * (low + high) if high < np.inf else 2.0 * step
        if best is not None and high - low < 1e-3 * high:
            break
    return best
