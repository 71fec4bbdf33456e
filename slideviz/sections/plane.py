"""The plane, a shape of sections; in 2D it is a line.

The first line of a function says what it is for a plane; shapes of arrays are in
`slideviz.sections.shape.Section`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.line import Line
from slideviz.sections.polygons import Polygons
from slideviz.sections.shape import (
    FEW,
    Label,
    axis_word,
    direction_label,
    round_middle,
    triple,
    triple_words,
)

_STEEP = 0.8
"""Planes whose unit normal has a larger z component than this are drawn with y up, not z."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The camera's axes for looking straight at a plane."""

    rows: FloatArray  # (3, 3): unit vectors to the right, up, and towards the camera
    labels: tuple[Label, Label]  # (Label, Label): the axis labels for the right and for up


class Plane(Line):
    """The plane; its position is that of its point along its normal."""

    terms = SECTION_SHAPES["plane"]

    @property
    def axes(self) -> Axes:
        """Return the camera's axes for a plane: z up, or y where z points to the camera.

        The largest component of the axis to the right is positive.
        """
        normal = self.basis[2]
        up = np.eye(3)[1 if abs(normal[2]) > _STEEP else 2]
        up = up - (up @ normal) * normal
        up /= np.linalg.norm(up)
        right = np.cross(up, normal)
        if right[np.argmax(np.abs(right))] < 0:
            right = -right
        rows = np.stack([right, up, np.cross(right, up)])
        return Axes(rows, (direction_label(right), direction_label(up)))

    def gap(self, along: Callable[[int], FloatArray]) -> FloatArray:
        return along(2)

    def crossings(
        self, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        before, after = level
        return before / (before - after)

    @property
    def position(self) -> float:
        """Return the signed distance of the plane from the origin, along its normal."""
        return float(self.point @ self.basis[2])

    def at_position(self, value: float) -> Self:
        """Return the plane moved along its normal."""
        shift = (value - self.position) * self.basis[2]
        return replace(self, origin=triple(self.point + shift))

    def positions(self, points: FloatArray) -> FloatArray:
        return self.along(points, 2) + self.position

    def first(self, points: FloatArray) -> Self:
        """Return a plane across the longest extent of points (n, 3), at a round number."""
        low = points.min(axis=0)
        high = points.max(axis=0)
        axis = int(np.argmax(high - low))
        origin = (low + high) / 2.0
        origin[axis] = round_middle(points[:, axis])
        return replace(self, origin=triple(origin), direction=triple(np.eye(3)[axis]))

    def keeps(self, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the plane moves along its normal."""
        return float(abs(step @ self.basis[2]))

    def words(self) -> str:
        where = axis_word(self.direction)
        if where in "xyz":
            return f"plane {where} = {self.origin['xyz'.index(where)]:.6g}"
        return f"plane with normal {where} through {triple_words(self.origin)}"

    def few_words(self) -> str:
        where = axis_word(self.direction, FEW)
        if where in "xyz":
            return self.words()
        return f"plane ⊥ {where} at {self.position:.3g}"

    def miss(self, points: FloatArray) -> str:
        normal = np.abs(self.basis[2])
        if not normal[: points.shape[1]].any():
            return "does not cut this 2D mesh; give a normal in x and y, e.g. y=0"
        axis = int(np.argmax(normal))
        if normal[axis] > 1.0 - 1e-12:
            ends = points[:, axis].min(), points[:, axis].max()
            return f"misses the mesh, which has {'xyz'[axis]} from {ends[0]:.6g} to {ends[1]:.6g}"
        along = self.frame(points)[:, 2]
        return (
            f"misses the mesh; moved along its normal by {along.min():.6g} to {along.max():.6g} "
            "it would cut it"
        )

    def flatten(self, polygons: Polygons, near: float | None, ahead: float | None) -> Polygons:
        """Return polygons seen along the normal."""
        axes = self.axes
        points = polygons.points @ axes.rows.T
        points[:, 2] -= self.point @ axes.rows[2]
        return polygons.with_points(points)

    def flat_labels(self) -> tuple[Label, Label]:
        return self.axes.labels

    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        rows = self.axes.rows
        flat = np.eye(4)
        flat[:3, :3] = rows @ matrix[:3, :3] @ rows.T
        flat[:3, 3] = rows @ matrix[:3, 3]
        flat[2, 3] = 0.0
        return flat

    def facing(self, points: FloatArray) -> FloatArray:
        return self.axes.rows

    def aslant(self, points: FloatArray) -> FloatArray:
        """Return the axes of `facing`: a plane is looked at straight, in 3D views too."""
        return self.axes.rows
