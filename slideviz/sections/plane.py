"""The plane, a shape of sections; in 2D it is a line.

The first line of a function says what it is for a plane; shapes of arrays are in
`slideviz.sections.shape.Section`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from slideviz.argument_types import record
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.polygons import Polygons
from slideviz.sections.shape import (
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
    triple,
    triple_words,
)

MARGIN = 0.03  # margin of the box around a mesh, at which lines end, over the mesh's longest extent
Box = tuple[FloatArray, FloatArray]  # lowest and highest coordinates, (2,) each


def box_around(points: FloatArray) -> Box:
    """Return the box around points (n, 2 or 3) in x and y, with a margin."""
    low = points[:, :2].min(axis=0)
    high = points[:, :2].max(axis=0)
    room = MARGIN * float((high - low).max())
    return low - room, high + room


def union(boxes: Sequence[Box]) -> Box:
    """Return the smallest box that contains all boxes, in 2D or 3D."""
    low = np.min([box[0] for box in boxes], axis=0)
    return low, np.max([box[1] for box in boxes], axis=0)


class Line(InPlane):
    """A plane in 2D; shapes of arrays are in `slideviz.sections.shape.InPlane`."""

    cuts_plane = True  # even where it is parallel to the mesh, and cuts nothing

    @property
    def way(self) -> FloatArray | None:
        """Return the unit direction of the line, (2,), its largest component positive.

        None where the plane is parallel to the mesh, so that there is no line.
        """
        normal = np.asarray(self.direction, float)[:2]
        size = float(np.linalg.norm(normal))
        if not size > 0:
            return None
        way = np.array([-normal[1], normal[0]]) / size + 0.0
        return -way if way[np.argmax(np.abs(way))] < 0 else way

    def ends(self, box: Box) -> FloatArray | None:
        """Return where it enters and leaves a box, (2, 2), in the direction of `way`; or None."""
        way = self.way
        if way is None:
            return None
        start = self.middle
        low = -np.inf
        high = np.inf
        for axis in range(2):
            if way[axis] == 0.0:
                if not box[0][axis] <= start[axis] <= box[1][axis]:
                    return None
                continue
            near, far = sorted((side[axis] - start[axis]) / way[axis] for side in box)
            low = max(low, near)
            high = min(high, far)
        return np.stack([start + low * way, start + high * way]) if low < high else None

    def words_in_plane(self) -> str:
        """Return the line in words: its x or y, or slope and point; "" for a normal along z."""
        where = axis_word(self.direction)
        if where == "z":
            return ""
        if where in "xyz":
            return f"line {where} = {self.origin['xyz'.index(where)]:.6g}"
        slope = float(np.degrees(np.arctan2(-self.direction[0], self.direction[1])))
        at = triple_words(self.origin[:2])
        return f"line at {(slope + 90.0) % 180.0 - 90.0:.4g}° through {at}"

    def trace(self, box: Box) -> list[FloatArray]:
        ends = self.ends(box)
        return [] if ends is None else [ends]

    @property
    def middle(self) -> FloatArray:
        """Return the point (2,) of the line in z = 0 that is nearest to the section's point."""
        origin = self.point
        normal = np.asarray(self.direction)
        flat = normal[:2] @ normal[:2]
        if not flat > 0:
            return origin[:2]
        # A plane oblique to z meets z = 0 beside the projection of its point.
        return origin[:2] + origin[2] * normal[2] / flat * normal[:2]

    def positions_along(self, corners: FloatArray) -> FloatArray:
        way = self.way
        assert way is not None
        return corners @ way

    def position_label(self) -> Label:
        way = self.way
        assert way is not None
        return direction_label(np.append(way, 0.0))


_STEEP = 0.8
"""Planes whose unit normal has a larger z component than this are drawn with y up, not z."""


@record
class Axes:
    """The camera's axes for looking straight at a plane."""

    rows: FloatArray  # (3, 3): unit vectors to the right, up, and towards the camera
    labels: Labels  # (Label, Label): the axis labels for the right and for up


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

    def gap(self, along: Along) -> FloatArray:
        return along(2)

    def crossings(self, edges: Edges, level: Level) -> FloatArray:
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

    def flat_labels(self) -> Labels:
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
