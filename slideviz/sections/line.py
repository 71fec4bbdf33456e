"""The line that a plane is in a 2D mesh: its trace, its handle, and positions along it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.handles import HandleParts, Part, rounded_place, within
from slideviz.sections.shape import DIGITS, InPlane, Label, axis_word, direction_label, triple_words

if TYPE_CHECKING:
    from slideviz.sections.model import Section

MARGIN = 0.03  # margin of the box around a mesh, at which lines end, over the mesh's longest extent
Box = tuple[FloatArray, FloatArray]  # lowest and highest coordinates, (2,) each


def box_around(points: FloatArray) -> Box:
    """Return the box around points (n, 2 or 3) in x and y, with a margin."""
    low = points[:, :2].min(axis=0)
    high = points[:, :2].max(axis=0)
    room = MARGIN * float((high - low).max())
    return low - room, high + room


def trace(section: Section, box: Box) -> list[FloatArray]:
    """Return the parts of a line or circle in 2D inside a box, as polylines (k, 2) each."""
    return section.in_plane.trace(section, box)


def line_ends(section: Section, box: Box) -> FloatArray | None:
    """Return where a line enters and leaves a box, (2, 2), in the direction of `along`; or None."""
    way = along(section)
    if way is None:
        return None
    start = LINE.middle(section)
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


def along(section: Section) -> FloatArray | None:
    """Return the unit direction of a section's line, (2,), its largest component positive.

    None where the plane is parallel to the mesh, so that there is no line.
    """
    normal = np.asarray(section.direction, float)[:2]
    size = float(np.linalg.norm(normal))
    if not size > 0:
        return None
    way = np.array([-normal[1], normal[0]]) / size + 0.0
    return -way if way[np.argmax(np.abs(way))] < 0 else way


class Line(InPlane):
    """A plane in 2D; shapes of arrays are in `slideviz.sections.shape.InPlane`."""

    def can_cut(self, section: Section) -> bool:
        """Return True, even for a plane parallel to the mesh, which cuts nothing."""
        return True

    def describe(self, section: Section) -> str:
        """Return the line in words: its x or y, or slope and point; "" for a normal along z."""
        where = axis_word(section.direction)
        if where == "z":
            return ""
        if where in "xyz":
            return f"line {where} = {section.origin['xyz'.index(where)]:.6g}"
        slope = float(np.degrees(np.arctan2(-section.direction[0], section.direction[1])))
        at = triple_words(section.origin[:2])
        return f"line at {(slope + 90.0) % 180.0 - 90.0:.4g}° through {at}"

    def trace(self, section: Section, box: Box) -> list[FloatArray]:
        ends = line_ends(section, box)
        return [] if ends is None else [ends]

    def middle(self, section: Section) -> FloatArray:
        """Return the point (2,) of the line in z = 0 that is nearest to the section's point."""
        origin = np.asarray(section.origin)
        normal = np.asarray(section.direction)
        flat = normal[:2] @ normal[:2]
        if not flat > 0:
            return origin[:2]
        # A plane oblique to z meets z = 0 beside the projection of its point.
        return origin[:2] + origin[2] * normal[2] / flat * normal[:2]

    def handle_parts(self, section: Section, parts: list[FloatArray], box: Box) -> HandleParts:
        """Return the handle of a line: its ends, the point about which it turns, and the line."""
        return HandleParts(self._pivot(section, box)[None], parts[0], parts)

    def dragged(
        self, section: Section, part: Part, way: tuple[FloatArray, FloatArray], box: Box
    ) -> Section:
        """Return the line turned, if dragged by an end; else moved."""
        start, now = way
        if part == "end":
            centre = self._pivot(section, box)
            return _turned(section, centre, now - centre)
        shift = now - start
        if part == "line":
            normal = np.asarray(section.direction[:2]) / np.linalg.norm(section.direction[:2])
            shift = (shift @ normal) * normal
        size = float((box[1] - box[0]).max())
        return replace(section, origin=rounded_place(self.middle(section) + shift, size))

    def positions(self, section: Section, corners: FloatArray) -> FloatArray:
        way = along(section)
        assert way is not None
        return corners @ way

    def position_label(self, section: Section) -> Label:
        way = along(section)
        assert way is not None
        return direction_label(np.append(way, 0.0))

    def _pivot(self, section: Section, box: Box) -> FloatArray:
        """Return the point (2,) about which the line turns.

        That is `middle` or, where it is not in the box, the middle of the line in the box.
        """
        middle = within(self.middle(section)[None], box)
        if len(middle):
            return middle[0]
        ends = line_ends(section, box)
        return self.middle(section) if ends is None else ends.mean(axis=0)


LINE = Line()


def _turned(section: Section, centre: FloatArray, way: FloatArray) -> Section:
    """Return the section with its line through ``centre`` (2,) in the direction ``way`` (2,).

    The normal stays on its side; the section is unchanged where ``way`` is zero.
    """
    length = float(np.linalg.norm(way))
    if not length > 0:
        return section
    normal = np.array([-way[1], way[0]]) / length
    if normal @ np.asarray(section.direction[:2]) < 0:
        normal = -normal
    x, y = (normal.round(DIGITS) + 0.0).tolist()
    return replace(section, origin=(float(centre[0]), float(centre[1]), 0.0), direction=(x, y, 0.0))
