"""Moves of the control points of a box by an amount, and their exact derivatives.

A move acts on the control points as those before it left them. ``points`` are the coordinates q
(I, J, K, 3) of all control points then, ``amount`` a number, whose unit the move defines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from slideviz.mesh.model import FloatArray

NEARLY = 1e-6
"""SU2's shift of the plane in which a twist finds its centre (``SegmentIntersectsPlane``)."""
NORMAL = np.array([NEARLY, 1.0 + NEARLY, NEARLY])
"""Normal of that plane."""


class Move(Protocol):
    """What happens to control points by an amount."""

    @property
    def chosen(self) -> np.ndarray:
        """Return which control points it moves, (I, J, K) bool."""

    def change(self, points: FloatArray, amount: float, /) -> FloatArray:
        """Return the change (I, J, K, 3) of points."""

    def slope(self, points: FloatArray, amount: float, /) -> FloatArray:
        """Return the derivative (I, J, K, 3) of the moved points with respect to the amount."""

    def pushed(self, points: FloatArray, amount: float, rates: FloatArray, /) -> FloatArray:
        """Return the rates (I, J, K, 3) of the moved points for rates of the points."""


@dataclass(frozen=True, eq=False)
class Shift:
    """The change ``unit`` (I, J, K, 3) times the amount."""

    unit: FloatArray

    @property
    def chosen(self) -> np.ndarray:
        """Return which control points it moves, (I, J, K) bool."""
        return np.asarray(self.unit.any(axis=-1))

    def change(self, _points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3), whatever the points."""
        return amount * self.unit

    def slope(self, _points: FloatArray, _amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3)."""
        return self.unit

    def pushed(self, _points: FloatArray, _amount: float, rates: FloatArray) -> FloatArray:
        """Return the rates (I, J, K, 3) unchanged."""
        return rates


@dataclass(frozen=True, eq=False)
class Turn:
    """A rotation of the control points ``chosen`` (I, J, K) bool about a line.

    The line goes through ``point`` along ``axis`` (right-hand rule, any length). The angle is
    ``rate`` radians times the amount, or with a ``length`` the arc tangent of amount over length.
    """

    chosen: np.ndarray
    point: FloatArray
    axis: FloatArray
    rate: float = 1.0
    length: float | None = None

    def change(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of points."""
        return self.turned(points - self.point, amount)

    def slope(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3) with respect to the amount."""
        across, twice = self._crossed(points - self.point)
        angle = self._angle(amount)
        turned = np.cos(angle) * across + np.sin(angle) * twice
        if self.length is None:
            return self.rate * turned
        return turned * self.length / (self.length**2 + amount**2)

    def pushed(self, _points: FloatArray, amount: float, rates: FloatArray) -> FloatArray:
        """Return the rates (I, J, K, 3) of the moved points for rates of the points."""
        return rates + self.turned(rates, amount)

    def turned(self, arm: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of vectors: ``sin k x v + (1 - cos) k x (k x v)``."""
        angle = self._angle(amount)
        across, twice = self._crossed(arm)
        return np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * twice

    def _angle(self, amount: float) -> float:
        if self.length is None:
            return self.rate * amount
        return float(np.arctan(amount / self.length))

    def _crossed(self, arm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ``k x v`` and ``k x (k x v)`` of vectors (I, J, K, 3); 0 where not chosen."""
        axis = self.axis / np.linalg.norm(self.axis)
        across = np.cross(axis, np.where(self.chosen[..., None], arm, 0.0))
        return across, np.cross(axis, across)


@dataclass(frozen=True, eq=False)
class Twist:
    """A rotation of control points about y, through the point where a segment meets a plane.

    The segment goes from ``first`` to ``end`` (3,), the plane through the control point
    (0, ``row``, 0) across y. The angle is the arc tangent of the amount over ``length``. Nothing
    moves where segment and plane do not meet.
    """

    chosen: np.ndarray
    first: FloatArray
    end: FloatArray
    row: int
    length: float

    def turn(self, points: FloatArray) -> Turn | None:
        """Return the rotation that it is for these points; None where nothing moves."""
        along = float(NORMAL @ (self.end - self.first))
        if along == 0.0:
            return None
        at = float(NORMAL @ (points[0, self.row, 0] + NEARLY - self.first)) / along
        centre = self.first + at * (self.end - self.first)
        axis = np.array([0.0, 1.0, 0.0])
        return Turn(self.chosen, centre, axis, length=self.length) if 0.0 <= at <= 1.0 else None

    def change(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the change (I, J, K, 3) of points."""
        turn = self.turn(points)
        return turn.change(points, amount) if turn else np.zeros_like(points)

    def slope(self, points: FloatArray, amount: float) -> FloatArray:
        """Return the derivative (I, J, K, 3) with respect to the amount."""
        turn = self.turn(points)
        return turn.slope(points, amount) if turn else np.zeros_like(points)

    def pushed(self, points: FloatArray, amount: float, rates: FloatArray) -> FloatArray:
        """Return the rates (I, J, K, 3) of the moved points for rates of the points."""
        turn = self.turn(points)
        if turn is None:
            return rates
        span = self.end - self.first
        centre = span * float(NORMAL @ rates[0, self.row, 0]) / float(NORMAL @ span)
        return rates + turn.turned(rates - centre, amount)
