"""The cylinder, a shape of sections, of infinite length; in 2D it is a circle.

The first line of a function says what it is for a cylinder or circle; shapes of arrays are in
`slideviz.sections.shape` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import Quadric, UnrolledPolygons, polar
from slideviz.sections.shape import (
    DIGITS,
    FEW,
    InPlane,
    Label,
    axis_word,
    direction_label,
    triple_words,
)

if TYPE_CHECKING:
    from slideviz.sections.line import Box

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


class Cylinder(Circle, Quadric):
    """The cylinder; its direction has no sign."""

    terms = SECTION_SHAPES["cylinder"]
    directed = False

    def gap(self, along: Callable[[int], FloatArray]) -> FloatArray:
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

    def flat_labels(self) -> tuple[Label, Label]:
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
