"""The cone, a shape of sections: it opens from its apex in the direction of its axis.

The first line of a function says what it is for a cone; shapes of arrays are in
`slideviz.sections.shape.Shape` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import Quadric, UnrolledPolygons, patch_of
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

if TYPE_CHECKING:
    from slideviz.sections.model import Section

_ENDS = 0.01, 89.99  # smallest and largest half angle of a slider, in degrees
_NEAR = 0.03
"""The apex of a new cone may be moved to a round number by this part of the mesh's extent."""


def _lines(section: Section) -> tuple[float, float]:
    """Return sine and cosine of the half angle of a section."""
    angle = np.radians(section.half_angle_deg)
    return float(np.sin(angle)), float(np.cos(angle))


class Cone(Quadric):
    """The half of a double cone in the direction of its axis."""

    terms = SECTION_SHAPES["cone"]
    in_plane = None
    directed = True

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return signed distances (n,), positive outside; behind the apex those from the apex."""
        sin, cos = _lines(section)
        radius = np.hypot(along(0), along(1))
        height = along(2)
        gap = radius * cos - height * sin
        return np.where(height * cos + radius * sin < 0.0, np.hypot(radius, height), gap)

    def quadric(self, section: Section) -> tuple[FloatArray, float]:
        """Return w (3,) and c of the double cone: radius over height is the tangent of the angle.

        It has the other half, behind the apex, too. But the distance from this half has only one
        minimum along any line, so that its sign tells which root belongs to this half.
        """
        sin, cos = _lines(section)
        return np.array([cos * cos, cos * cos, -sin * sin]), 0.0

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the half angles (n,) in degrees of the cones through points."""
        radius = np.hypot(section.along(points, 0), section.along(points, 1))
        angle = np.degrees(np.arctan2(radius, section.along(points, 2)))
        return np.clip(angle, *_ENDS)

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return a cone through the middle of points.

        Its half angle is the usual one, or smaller if the cone would otherwise leave the range from
        inner to outer radius within the length of the mesh.
        """
        local = section.frame(points)
        radius = np.hypot(local[:, 0], local[:, 1])
        height = local[:, 2]
        length = float(np.ptp(height))
        # Between the inner and the outer radius over the whole length, where possible.
        steep = np.degrees(np.arctan2(np.ptp(radius) / 2.0, length)) if length > 0 else 45.0
        angle = roundest(steep / 2.0, min(steep, self.size.usual), self.size.usual)
        middle = round_middle(radius) or float(radius.mean())
        at = float(height.min() + height.max()) / 2.0 - middle / np.tan(np.radians(angle))
        room = _NEAR * max(length, float(np.ptp(radius)))
        at = roundest(at - room, at + room, at)
        apex = np.asarray(section.origin) + at * section.basis[2]
        return replace(section, origin=triple(apex), half_angle_deg=angle)

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the apex moves; infinity where the cone opens the other way after it."""
        return float(np.linalg.norm(step)) if turned @ section.basis[2] > 0 else np.inf

    def describe(self, section: Section) -> str:
        return self._words(section, DIGITS, "from apex")

    def brief(self, section: Section) -> str:
        return self._words(section, FEW, "from")

    def _words(self, section: Section, digits: int, apex: str) -> str:
        where = axis_word(section.direction, digits)
        if where in "xyz" and section.direction["xyz".index(where)] < 0:
            where = f"-{where}"
        at = triple_words(section.origin, digits)
        return f"cone {section.half_angle_deg:.6g}° about {where} {apex} {at}"

    def miss(self, section: Section, points: FloatArray) -> str:
        angles = self.positions(section, points)
        return (
            f"misses the mesh, which its apex sees at {angles.min():.4g} to {angles.max():.4g} "
            "degrees from its axis"
        )

    def laid(self, section: Section, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return the developed cone with the apex at 0, and as z the distance from it, outwards.

        Lengths s from the apex are kept. An angle theta around the axis becomes theta sin(half
        angle) around the apex, counted from the line at ``ahead``, which goes to the right.
        """
        sin, cos = _lines(section)
        local = opened.local
        radius = np.hypot(local[:, 0], local[:, 1])
        length = local[:, 2] * cos + radius * sin
        angle = (opened.angle - (opened.middle if ahead is None else ahead)) * sin
        outwards = radius * cos - local[:, 2] * sin
        return np.stack([length * np.cos(angle), length * np.sin(angle), outwards], axis=1)

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        return float(np.mean(patch_of(section, points).angles))

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        """Return the labels of the coordinates of the developed cone.

        s is the length from the apex, theta the angle around the axis, alpha the half angle.
        """
        return Label("s cos(θ sin α)", "s cos"), Label("s sin(θ sin α)", "s sin")

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        sin, _ = _lines(section)
        flat = np.eye(4)
        c = np.cos(angle * sin)
        s = np.sin(angle * sin)
        flat[:2, :2] = [[c, -s], [s, c]]
        return flat

    def places(self, section: Section, points: FloatArray) -> FloatArray:
        """Return angles in radians, and lengths from the apex along the cone."""
        sin, cos = _lines(section)
        local = section.frame(points)
        length = local[:, 2] * cos + np.hypot(local[:, 0], local[:, 1]) * sin
        return np.column_stack([np.arctan2(local[:, 1], local[:, 0]), length])

    def surface(self, section: Section, places: FloatArray, size: float) -> FloatArray:
        turn = places[:, 0]
        length = np.maximum(places[:, 1], 0.0)
        lean = np.radians(size)
        radius = length * np.sin(lean)
        local = [radius * np.cos(turn), radius * np.sin(turn), length * np.cos(lean)]
        return np.asarray(section.origin) + np.column_stack(local) @ section.basis

    def lean(self, section: Section) -> float:
        """Return the half angle, in radians."""
        return float(np.radians(section.half_angle_deg))

    def lever(self, section: Section, along: float) -> float:
        """Return the arc of a place about the apex for one degree; 1 at the apex itself."""
        return float(np.radians(abs(along))) or 1.0

    def girth(self, section: Section, along: float) -> float:
        return abs(along) * _lines(section)[0]
