"""The plane, a shape of sections; in 2D it is a line.

The first line of a function says what it is for a plane; shapes of arrays are in
`slideviz.sections.shape.Shape`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.line import LINE
from slideviz.sections.polygons import Polygons
from slideviz.sections.shape import (
    FEW,
    Label,
    Shape,
    axis_word,
    direction_label,
    round_middle,
    triple,
    triple_words,
)

if TYPE_CHECKING:
    from slideviz.sections.model import Section

_STEEP = 0.8
"""Planes whose unit normal has a larger z component than this are drawn with y up, not z."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The camera's axes for looking straight at a plane."""

    rows: FloatArray  # (3, 3): unit vectors to the right, up, and towards the camera
    labels: tuple[Label, Label]  # (Label, Label): the axis labels for the right and for up


def plane_axes(section: Section) -> Axes:
    """Return the camera's axes for a plane: z up, or y where z points to the camera.

    The largest component of the axis to the right is positive.
    """
    normal = section.basis[2]
    up = np.eye(3)[1 if abs(normal[2]) > _STEEP else 2]
    up = up - (up @ normal) * normal
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    if right[np.argmax(np.abs(right))] < 0:
        right = -right
    rows = np.stack([right, up, np.cross(right, up)])
    return Axes(rows, (direction_label(right), direction_label(up)))


class Plane(Shape):
    """The plane; its position is that of its point along its normal."""

    terms = SECTION_SHAPES["plane"]
    in_plane = LINE
    directed = True
    handle = "push"

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        return along(2)

    def crossings(
        self, section: Section, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        before, after = level
        return before / (before - after)

    def position(self, section: Section) -> float:
        """Return the signed distance of the plane from the origin, along its normal."""
        return float(np.asarray(section.origin) @ section.basis[2])

    def at_position(self, section: Section, value: float) -> Section:
        """Return the plane moved along its normal."""
        shift = (value - self.position(section)) * section.basis[2]
        return replace(section, origin=triple(np.asarray(section.origin) + shift))

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        return section.along(points, 2) + self.position(section)

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return a plane across the longest extent of points (n, 3), at a round number."""
        low = points.min(axis=0)
        high = points.max(axis=0)
        axis = int(np.argmax(high - low))
        origin = (low + high) / 2.0
        origin[axis] = round_middle(points[:, axis])
        return replace(section, origin=triple(origin), direction=triple(np.eye(3)[axis]))

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the plane moves along its normal."""
        return float(abs(step @ section.basis[2]))

    def describe(self, section: Section) -> str:
        where = axis_word(section.direction)
        if where in "xyz":
            return f"plane {where} = {section.origin['xyz'.index(where)]:.6g}"
        return f"plane with normal {where} through {triple_words(section.origin)}"

    def brief(self, section: Section) -> str:
        where = axis_word(section.direction, FEW)
        if where in "xyz":
            return self.describe(section)
        return f"plane ⊥ {where} at {self.position(section):.3g}"

    def miss(self, section: Section, points: FloatArray) -> str:
        normal = np.abs(section.basis[2])
        if not normal[: points.shape[1]].any():
            return "does not cut this 2D mesh; give a normal in x and y, e.g. y=0"
        axis = int(np.argmax(normal))
        if normal[axis] > 1.0 - 1e-12:
            ends = points[:, axis].min(), points[:, axis].max()
            return f"misses the mesh, which has {'xyz'[axis]} from {ends[0]:.6g} to {ends[1]:.6g}"
        along = section.frame(points)[:, 2]
        return (
            f"misses the mesh; moved along its normal by {along.min():.6g} to {along.max():.6g} "
            "it would cut it"
        )

    def flatten(
        self, section: Section, polygons: Polygons, near: float | None, ahead: float | None
    ) -> Polygons:
        """Return polygons seen along the normal."""
        axes = plane_axes(section)
        points = polygons.points @ axes.rows.T
        points[:, 2] -= np.asarray(section.origin) @ axes.rows[2]
        return polygons.with_points(points)

    def middle_angle(
        self, section: Section, polygons: Polygons, near: float | None = None
    ) -> float | None:
        """Return None: only shapes about an axis have a middle angle."""
        return None

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return None: only the flat view of a cone depends on an angle."""
        return None

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        return plane_axes(section).labels

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        rows = plane_axes(section).rows
        flat = np.eye(4)
        flat[:3, :3] = rows @ matrix[:3, :3] @ rows.T
        flat[:3, 3] = rows @ matrix[:3, 3]
        flat[2, 3] = 0.0
        return flat

    def facing(self, section: Section, points: FloatArray) -> FloatArray:
        return plane_axes(section).rows

    def aslant(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the axes of `facing`: a plane is looked at straight, in 3D views too."""
        return plane_axes(section).rows
