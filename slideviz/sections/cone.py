"""The cone, a shape of sections: it opens from its apex in the direction of its axis.

The first line of a function says what it is for a cone; shapes of arrays are in
`slideviz.sections.shape.Section` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import Quadric, UnrolledPolygons, polar
from slideviz.sections.shape import (
    DIGITS,
    FEW,
    Label,
    axis_word,
    round_middle,
    roundest,
    triple,
    triple_words,
)

_ENDS = 0.01, 89.99  # smallest and largest half angle of a slider, in degrees
_NEAR = 0.03
"""The apex of a new cone may be moved to a round number by this part of the mesh's extent."""


class Cone(Quadric):
    """The half of a double cone in the direction of its axis."""

    terms = SECTION_SHAPES["cone"]

    @property
    def _lines(self) -> tuple[float, float]:
        """Return sine and cosine of the half angle."""
        angle = np.radians(self.half_angle_deg)
        return float(np.sin(angle)), float(np.cos(angle))

    def gap(self, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return signed distances (n,), positive outside; behind the apex those from the apex."""
        sin, cos = self._lines
        radius = np.hypot(along(0), along(1))
        height = along(2)
        gap = radius * cos - height * sin
        return np.where(height * cos + radius * sin < 0.0, np.hypot(radius, height), gap)

    def quadric(self) -> tuple[FloatArray, float]:
        """Return w (3,) and c of the double cone: radius over height is the tangent of the angle.

        It has the other half, behind the apex, too. But the distance from this half has only one
        minimum along any line, so that its sign tells which root belongs to this half.
        """
        sin, cos = self._lines
        return np.array([cos * cos, cos * cos, -sin * sin]), 0.0

    def positions(self, points: FloatArray) -> FloatArray:
        """Return the half angles (n,) in degrees of the cones through points."""
        radius = np.hypot(self.along(points, 0), self.along(points, 1))
        angle = np.degrees(np.arctan2(radius, self.along(points, 2)))
        return np.clip(angle, *_ENDS)

    def first(self, points: FloatArray) -> Self:
        """Return a cone through the middle of points.

        Its half angle is the usual one, or smaller if the cone would otherwise leave the range from
        inner to outer radius within the length of the mesh.
        """
        _, radius, height = polar(self.frame(points))
        length = float(np.ptp(height))
        # Between the inner and the outer radius over the whole length, where possible.
        steep = np.degrees(np.arctan2(np.ptp(radius) / 2.0, length)) if length > 0 else 45.0
        angle = roundest(steep / 2.0, min(steep, self.size_terms.usual), self.size_terms.usual)
        middle = round_middle(radius) or float(radius.mean())
        at = float(height.min() + height.max()) / 2.0 - middle / np.tan(np.radians(angle))
        room = _NEAR * max(length, float(np.ptp(radius)))
        at = roundest(at - room, at + room, at)
        apex = self.point + at * self.basis[2]
        return replace(self, origin=triple(apex), half_angle_deg=angle)

    def words(self) -> str:
        return self._words(DIGITS, "from apex")

    def few_words(self) -> str:
        return self._words(FEW, "from")

    def _words(self, digits: int, apex: str) -> str:
        where = axis_word(self.direction, digits)
        if where in "xyz" and self.direction["xyz".index(where)] < 0:
            where = f"-{where}"
        at = triple_words(self.origin, digits)
        return f"cone {self.half_angle_deg:.6g}° about {where} {apex} {at}"

    def miss(self, points: FloatArray) -> str:
        angles = self.positions(points)
        return (
            f"misses the mesh, which its apex sees at {angles.min():.4g} to {angles.max():.4g} "
            "degrees from its axis"
        )

    def laid(self, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return the developed cone with the apex at 0, and as z the distance from it, outwards.

        Lengths s from the apex are kept. An angle theta around the axis becomes theta sin(half
        angle) around the apex, counted from the line at ``ahead``, which goes to the right.
        """
        sin, cos = self._lines
        length = opened.height * cos + opened.radius * sin
        angle = (opened.angle - (opened.middle if ahead is None else ahead)) * sin
        outwards = opened.radius * cos - opened.height * sin
        return np.stack([length * np.cos(angle), length * np.sin(angle), outwards], axis=1)

    def ahead(self, points: FloatArray) -> float | None:
        return float(np.mean(self.patch(points).angles))

    def flat_labels(self) -> tuple[Label, Label]:
        """Return the labels of the coordinates of the developed cone.

        s is the length from the apex, theta the angle around the axis, alpha the half angle.
        """
        return Label("s cos(θ sin α)", "s cos"), Label("s sin(θ sin α)", "s sin")

    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        sin, _ = self._lines
        flat = np.eye(4)
        c = np.cos(angle * sin)
        s = np.sin(angle * sin)
        flat[:2, :2] = [[c, -s], [s, c]]
        return flat

    def places(self, points: FloatArray) -> FloatArray:
        """Return angles in radians, and lengths from the apex along the cone."""
        sin, cos = self._lines
        angle, radius, height = polar(self.frame(points))
        return np.column_stack([angle, height * cos + radius * sin])

    def surface(self, places: FloatArray, size: float) -> FloatArray:
        turn = places[:, 0]
        length = np.maximum(places[:, 1], 0.0)
        lean = np.radians(size)
        radius = length * np.sin(lean)
        local = [radius * np.cos(turn), radius * np.sin(turn), length * np.cos(lean)]
        return self.point + np.column_stack(local) @ self.basis

    def lean(self) -> float:
        """Return the half angle, in radians."""
        return float(np.radians(self.half_angle_deg))

    def girth(self, along: float) -> float:
        return abs(along) * self._lines[0]
