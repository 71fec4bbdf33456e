"""The cylinder, a shape of sections, of infinite length; in 2D it is a circle.

The first line of a function says what it is for a cylinder or circle; shapes of arrays are in
`slideviz.sections.shape` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import Quadric, UnrolledPolygons
from slideviz.sections.handles import HandleParts, Part, rounded, rounded_place, within
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
    from slideviz.sections.model import Section

_CHORDS = 720  # number of chords that a circle is drawn with


class Circle(InPlane):
    """A cylinder in 2D; see `slideviz.sections.shape.InPlane`."""

    def can_cut(self, section: Section) -> bool:
        return axis_word(section.direction) == "z"

    def describe(self, section: Section) -> str:
        at = triple_words(section.origin[:2])
        return f"circle r = {section.radius:.6g} about {at}" if self.can_cut(section) else ""

    def trace(self, section: Section, box: Box) -> list[FloatArray]:
        angle = np.linspace(0.0, 2.0 * np.pi, _CHORDS + 1)
        ring = section.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        ring += section.origin[:2]
        inside = ((ring >= box[0]) & (ring <= box[1])).all(axis=1)
        starts = np.flatnonzero(np.diff(inside.astype(int))) + 1
        parts = zip(np.split(ring, starts), np.split(inside, starts), strict=True)
        return [part for part, kept in parts if kept[0] and len(part) > 1]

    def middle(self, section: Section) -> FloatArray:
        return np.asarray(section.origin)[:2]

    def handle_parts(self, section: Section, parts: list[FloatArray], box: Box) -> HandleParts:
        """Return the handle points of a circle: its centre, and one point on it."""
        longest = max(parts, key=len)
        ends = longest[None, len(longest) // 2 if len(parts) > 1 else len(longest) // 8]
        return HandleParts(within(self.middle(section)[None], box), ends, parts)

    def dragged(
        self, section: Section, part: Part, way: tuple[FloatArray, FloatArray], box: Box
    ) -> Section:
        """Return the circle moved, if dragged by its centre; else with another radius."""
        start, now = way
        size = float((box[1] - box[0]).max())
        if part == "middle":
            return replace(section, origin=rounded_place(self.middle(section) + now - start, size))
        radius = float(np.linalg.norm(now - np.asarray(section.origin[:2])))
        return replace(section, radius=rounded(max(radius, 1e-4 * size), size))

    def positions(self, section: Section, corners: FloatArray) -> FloatArray:
        """Return the angles of both ends of lines, in degrees.

        The middle of each line is within -180 to 180, so that curves of several meshes coincide.
        """
        corners = corners - np.asarray(section.origin[:2])
        start, end = np.degrees(np.arctan2(corners[..., 1], corners[..., 0])).T
        end = start + (end - start + 180.0) % 360.0 - 180.0
        turn = 360.0 * np.floor(((start + end) / 2.0 + 180.0) / 360.0)
        return np.column_stack([start - turn, end - turn])

    def position_label(self, section: Section) -> Label:
        return Label("angle [°]", "θ [°]")


class Cylinder(Quadric):
    """The cylinder; its direction has no sign."""

    terms = SECTION_SHAPES["cylinder"]
    in_plane = Circle()
    directed = False

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        return np.hypot(along(0), along(1)) - section.radius

    def quadric(self, section: Section) -> tuple[FloatArray, float]:
        """Return w = (1, 1, 0) and the squared radius."""
        return np.array([1.0, 1.0, 0.0]), section.radius**2

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        return np.hypot(section.along(points, 0), section.along(points, 1))

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the axis moves perpendicular to itself; see `Shape.keeps`."""
        return float(np.linalg.norm(np.cross(step, section.basis[2])))

    def describe(self, section: Section) -> str:
        return self._words(section, axis_word(section.direction), " through", DIGITS)

    def brief(self, section: Section) -> str:
        return self._words(section, axis_word(section.direction, FEW), " at", FEW)

    def _words(self, section: Section, where: str, point: str, digits: int) -> str:
        off_axis = np.linalg.norm(np.cross(np.asarray(section.origin), section.basis[2]))
        at = f"{point} {triple_words(section.origin, digits)}" if off_axis > 0 else ""
        return f"cylinder r = {section.radius:.6g} about {where}{at}"

    def miss(self, section: Section, points: FloatArray) -> str:
        radii = self.positions(section, points)
        return (
            f"misses the mesh, which has radii {radii.min():.6g} to {radii.max():.6g} about this "
            "axis"
        )

    def laid(self, section: Section, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return position along the axis, radius times angle, and distance outwards."""
        local = opened.local
        along = local[:, 2] + np.asarray(section.origin) @ section.basis[2]
        outwards = np.hypot(local[:, 0], local[:, 1]) - section.radius
        return np.stack([along, section.radius * opened.angle, outwards], axis=1)

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return None: all its lines go to the right in the flat view."""
        return None

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        """Return the labels of the position along the axis, and of r theta."""
        return direction_label(section.basis[2]), Label("r θ", "r θ")

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix of a shift: along the axis, and by radius times angle."""
        origin = np.asarray(section.origin)
        flat = np.eye(4)
        step = matrix[:3, :3] @ origin + matrix[:3, 3] - origin
        flat[0, 3] = step @ section.basis[2]
        flat[1, 3] = section.radius * angle
        return flat

    def places(self, section: Section, points: FloatArray) -> FloatArray:
        """Return angles in radians, and positions along the axis from the section's point."""
        local = section.frame(points)
        return np.column_stack([np.arctan2(local[:, 1], local[:, 0]), local[:, 2]])

    def surface(self, section: Section, places: FloatArray, size: float) -> FloatArray:
        """Return points at places of the cylinder with the radius ``size``."""
        angle = places[:, 0]
        along = places[:, 1]
        local = np.column_stack([size * np.cos(angle), size * np.sin(angle), along])
        return np.asarray(section.origin) + local @ section.basis

    def lean(self, section: Section) -> float:
        return 0.0

    def lever(self, section: Section, along: float) -> float:
        """Return 1: a place moves as far as the radius grows."""
        return 1.0

    def girth(self, section: Section, along: float) -> float:
        return section.radius
