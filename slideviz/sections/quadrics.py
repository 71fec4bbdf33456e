"""Cylinders and cones about an axis: surfaces of second degree.

Cylinders are laid flat to (z, r θ), cones to the plane; shapes of arrays are in
`slideviz.sections.shape` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Self

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import AboutAxis, UnrolledPolygons, polar
from slideviz.sections.plane import Box
from slideviz.sections.shape import (
    DIGITS,
    FEW,
    Along,
    Edges,
    InPlane,
    Label,
    Labels,
    Level,
    axis_word,
    direction_label,
    round_middle,
    roundest,
    triple,
    triple_words,
)

_CHORDS = 720  # number of chords that a circle is drawn with


class Circle(InPlane):
    """A cylinder in 2D; see `slideviz.sections.shape.InPlane`."""

    @property
    def cuts_plane(self) -> bool:
        return axis_word(self.direction) == "z"

    def words_in_plane(self) -> str:
        at = triple_words(self.origin[:2])
        return f"circle r = {self.radius:.6g} about {at}" if self.cuts_plane else ""

    def trace(self, box: Box) -> list[FloatArray]:
        angle = np.linspace(0.0, 2.0 * np.pi, _CHORDS + 1)
        ring = self.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        ring += self.origin[:2]
        inside = ((ring >= box[0]) & (ring <= box[1])).all(axis=1)
        starts = np.flatnonzero(np.diff(inside.astype(int))) + 1
        parts = zip(np.split(ring, starts), np.split(inside, starts), strict=True)
        return [part for part, kept in parts if kept[0] and len(part) > 1]

    @property
    def middle(self) -> FloatArray:
        return self.point[:2]

    def positions_along(self, corners: FloatArray) -> FloatArray:
        """Return the angles of both ends of lines, in degrees.

        The middle of each line is within -180 to 180, so that curves of several meshes coincide.
        """
        corners = corners - self.point[:2]
        start, end = np.degrees(np.arctan2(corners[..., 1], corners[..., 0])).T
        end = start + (end - start + 180.0) % 360.0 - 180.0
        turn = 360.0 * np.floor(((start + end) / 2.0 + 180.0) / 360.0)
        return np.column_stack([start - turn, end - turn])

    def position_label(self) -> Label:
        return Label("angle [°]", "θ [°]")


class Quadric(AboutAxis):
    """A shape about an axis with a straight line as its profile."""

    @abstractmethod
    def quadric(self) -> tuple[FloatArray, float]:
        """Return w (3,) and c: in the section's frame the surface is w · (x², y², z²) = c."""

    def crossings(self, edges: Edges, level: Level) -> FloatArray:
        """Return where edges cross the surface, as parts of the edge (k,), exactly.

        Along an edge the weighted squares of `quadric` are a parabola with two roots: taken is the
        one at which the distance changes its sign as it does from end to end of the edge.
        """
        weights, total = self.quadric()
        used = weights != 0.0
        rows = self.basis[used]
        weight = weights[used]
        p = (edges[0] - self.point) @ rows.T
        d = edges[1] @ rows.T
        square = np.sum(weight * d * d, axis=1)
        slope = np.sum(weight * p * d, axis=1)
        constant = np.sum(weight * p * p, axis=1) - total
        root = np.sqrt(np.maximum(slope**2 - square * constant, 0.0))
        before, after = level
        sign = np.where(after > before, 1.0, -1.0)
        # Of the two formulas of a root, the one without cancellation.
        stable = sign * slope > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            roots = np.where(
                stable, -constant / (slope + sign * root), (sign * root - slope) / square
            )
        return np.clip(np.nan_to_num(roots), 0.0, 1.0)


class Cylinder(Circle, Quadric):
    """The cylinder; its direction has no sign."""

    terms = SECTION_SHAPES["cylinder"]
    directed = False

    def gap(self, along: Along) -> FloatArray:
        return np.hypot(along(0), along(1)) - self.radius

    def quadric(self) -> tuple[FloatArray, float]:
        """Return w = (1, 1, 0) and the squared radius."""
        return np.array([1.0, 1.0, 0.0]), self.radius**2

    def positions(self, points: FloatArray) -> FloatArray:
        return np.hypot(self.along(points, 0), self.along(points, 1))

    def keeps(self, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the axis moves perpendicular to itself; see `Section.keeps`."""
        return float(np.linalg.norm(np.cross(step, self.basis[2])))

    def words(self) -> str:
        return self._words(axis_word(self.direction), " through", DIGITS)

    def few_words(self) -> str:
        return self._words(axis_word(self.direction, FEW), " at", FEW)

    def _words(self, where: str, point: str, digits: int) -> str:
        off_axis = np.linalg.norm(np.cross(self.point, self.basis[2]))
        at = f"{point} {triple_words(self.origin, digits)}" if off_axis > 0 else ""
        return f"cylinder r = {self.radius:.6g} about {where}{at}"

    def miss(self, points: FloatArray) -> str:
        radii = self.positions(points)
        return (
            f"misses the mesh, which has radii {radii.min():.6g} to {radii.max():.6g} about this "
            "axis"
        )

    def laid(self, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return position along the axis, radius times angle, and distance outwards."""
        along = opened.height + self.point @ self.basis[2]
        outwards = opened.radius - self.radius
        return np.stack([along, self.radius * opened.angle, outwards], axis=1)

    def flat_labels(self) -> Labels:
        """Return the labels of the position along the axis, and of r theta."""
        return direction_label(self.basis[2]), Label("r θ", "r θ")

    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix of a shift: along the axis, and by radius times angle."""
        origin = self.point
        flat = np.eye(4)
        step = matrix[:3, :3] @ origin + matrix[:3, 3] - origin
        flat[0, 3] = step @ self.basis[2]
        flat[1, 3] = self.radius * angle
        return flat

    def places(self, points: FloatArray) -> FloatArray:
        """Return angles in radians, and positions along the axis from the section's point."""
        angle, _, height = polar(self.frame(points))
        return np.column_stack([angle, height])

    def surface(self, places: FloatArray, size: float) -> FloatArray:
        """Return points at places of the cylinder with the radius ``size``."""
        angle = places[:, 0]
        along = places[:, 1]
        local = np.column_stack([size * np.cos(angle), size * np.sin(angle), along])
        return self.point + local @ self.basis

    def lean(self) -> float:
        return 0.0

    def girth(self, along: float) -> float:
        return self.radius


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

    def gap(self, along: Along) -> FloatArray:
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

    def flat_labels(self) -> Labels:
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
