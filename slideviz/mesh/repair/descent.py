"""Descent to a minimum: L-BFGS with a preconditioner, and a line search of Wolfe's conditions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.jacobians import LANES
from slideviz.mesh.model import FloatArray
from slideviz.system.jit_cache import njit

CORRECTIONS = 15  # pairs of steps and changes of the gradient that L-BFGS remembers

ARMIJO = 1e-4
WOLFE = 0.9
"""A step must bring this part of the decrease that the slope promises, and leave at most this part
of the slope."""

SHORTER = 0.25  # part of the interval that is tried after a step to where the value is infinite

TRIES = 30  # most evaluations of a line search

WINDOW = 10  # iterations over which the decrease of the value is looked at

Function = Callable[[FloatArray], tuple[float, FloatArray]]
"""Returns value and gradient (b, d) at unknowns (b, d)."""


@njit
def dot(a, b):  # type: ignore[no-untyped-def]
    """Return the sum of products of (n,); its bits do not depend on a number of threads."""
    part = np.zeros(LANES)
    whole = len(a) // LANES * LANES
    for first in range(0, whole, LANES):
        for c in range(LANES):
            part[c] += a[first + c] * b[first + c]
    total = part.sum()
    for k in range(whole, len(a)):
        total += a[k] * b[k]
    return total


@njit
def _add(factor, a, out):  # type: ignore[no-untyped-def]
    for k in range(len(out)):
        out[k] += factor * a[k]


@njit
def _first_loop(steps, changes, smoothed, products, order, left, out, factors):  # type: ignore[no-untyped-def]
    """Take the newest pairs first from ``left`` (n,), with ``factors`` (c,): Nocedal's first loop.

    And from ``out`` (n,), the preconditioned gradient. ``steps``, ``changes`` and ``smoothed`` are
    (c, n), ``products`` (c,); ``order`` (k,) has the oldest first.
    """
    for i in range(len(order) - 1, -1, -1):
        k = order[i]
        factors[k] = dot(steps[k], left) / products[k]
        _add(-factors[k], changes[k], left)
        _add(-factors[k], smoothed[k], out)


@njit
def _second_loop(steps, changes, products, order, out, factors):  # type: ignore[no-untyped-def]
    for k in order:
        _add(factors[k] - dot(changes[k], out) / products[k], steps[k], out)


class Memory:
    """The last pairs of steps and changes of the gradient, and the inverse Hessian by them.

    The preconditioner is linear: what it makes of a change is the difference of what it made of two
    gradients, so that it is called once a gradient.
    """

    def __init__(
        self,
        count: int,
        precondition: Callable[[FloatArray], FloatArray],
        pairs: int = CORRECTIONS,
        store: type[np.floating] = np.float64,
    ) -> None:
        """``pairs``: most of them, kept in numbers of the type ``store``."""
        self._precondition = precondition
        self._steps, self._changes, self._smoothed = np.empty((3, pairs, count), store)
        self._products, self._factors = np.empty((2, pairs))
        self._order = np.empty(0, np.int64)
        self._scale = 1.0
        self._before: FloatArray | None = None  # the last preconditioned gradient

    def __len__(self) -> int:
        return len(self._order)

    def clear(self) -> None:
        """Forget all pairs."""
        self._order = self._order[:0]
        self._scale = 1.0
        self._before = None

    def add(self, step: FloatArray, change: FloatArray, gradient: FloatArray) -> None:
        """Take a pair (b, d), (b, d), in place of the oldest; none without positive curvature.

        ``gradient`` (b, d): after the step.
        """
        before = self._before
        smooth = self._before = self._precondition(gradient)
        product = dot(step.ravel(), change.ravel())
        if product > 0 and before is not None:
            full = len(self) == len(self._products)
            k = self._order[0] if full else len(self)
            self._order = np.append(self._order[1:] if full else self._order, k)
            self._steps[k] = step.ravel()
            self._changes[k] = change.ravel()
            self._smoothed[k] = (smooth - before).ravel()
            self._products[k] = product
            self._scale = product / dot(change.ravel(), (smooth - before).ravel())

    def inverse_times(self, gradient: FloatArray) -> FloatArray:
        """Return the inverse Hessian times a gradient (b, d), that of the last pair."""
        if self._before is None:
            self._before = self._precondition(gradient)
        left = gradient.ravel().copy()
        out = self._before.copy()
        smoothed = out.ravel()
        pairs = self._steps, self._changes
        last = self._products, self._order
        _first_loop(*pairs, self._smoothed, *last, left, smoothed, self._factors)
        smoothed *= self._scale
        _second_loop(*pairs, *last, smoothed, self._factors)
        return out


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

    ``function``: may return infinity for the value where a step is too long.
    ``precondition``: takes a gradient (b, d), returns about the inverse Hessian times it.
    ``longest``: the longest step from unknowns along a direction, at most infinity.
    ``iterations``: most of them.
    ``decrease``: called after each iteration: it ends where `WINDOW` of them lowered the value by
    less than this part.
    """
    x = start
    value, gradient = function(x)
    memory = Memory(x.size, precondition)
    values = [value]
    for _ in range(iterations):
        direction = -memory.inverse_times(gradient)
        slope = dot(gradient.ravel(), direction.ravel())
        if not slope < 0:  # by rounding only
            memory.clear()
            direction = -memory.inverse_times(gradient)
            slope = dot(gradient.ravel(), direction.ravel())
            if not slope < 0:
                break
        most = longest(x, direction)
        step = line_search(function, x, value, direction, slope, most)
        if step is None:
            if not len(memory):
                break
            memory.clear()
            continue
        length, new_value, new_gradient = step
        s = length * direction
        memory.add(s, new_gradient - gradient, new_gradient)
        x = x + s
        value = new_value
        gradient = new_gradient
        values.append(value)
        least = decrease()
        if len(values) > WINDOW and values[-1 - WINDOW] - value <= least * abs(value):
            break
    return x


def line_search(
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
    low = 0.0
    high = most
    step = min(1.0, most)
    best = None
    for _ in range(TRIES):
        new_value, gradient = function(x + step * direction)
        if not new_value <= value + ARMIJO * step * slope:
            high = step
        else:
            best = step, new_value, gradient
            if step >= most or dot(gradient.ravel(), direction.ravel()) >= WOLFE * slope:
                break
            low = step
        part = 0.5 if new_value < np.inf else SHORTER
        step = low + part * (high - low) if high < np.inf else 2.0 * step
        if best is not None and high - low < 1e-3 * high:
            break
    return best
