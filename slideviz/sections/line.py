"""The line that a plane is in a 2D mesh: its trace, and positions along it."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.shape import InPlane, Label, axis_word, direction_label, triple_words

MARGIN = 0.03  # margin of the box around a mesh, at which lines end, over the mesh's longest extent
Box = tuple[FloatArray, FloatArray]  # lowest and highest coordinates, (2,) each


def box_around(points: FloatArray) -> Box:
    """Return the box around points (n, 2 or 3) in x and y, with a margin."""
    low = points[:, :2].min(axis=0)
    high = points[:, :2].max(axis=0)
    room = MARGIN * float((high - low).max())
    return low - room, high + room


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
