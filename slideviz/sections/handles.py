"""Handles of sections in 2D meshes: their points, and the section after a drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.mesh.model import FloatArray, row_dots, row_norms

if TYPE_CHECKING:
    from slideviz.sections.line import Box
    from slideviz.sections.shape import Section, Triple

Part = Literal["middle", "end", "line"]
"""The part of a handle that is dragged: the middle, an end of a line (or the point on a circle), or
the line or circle itself anywhere."""

_DIGITS = 4  # digits of a place relative to the size of the view: more than a mouse can aim for


@dataclass(frozen=True, eq=False)
class HandleParts:
    """The visible parts of the handle of a section in a 2D mesh, which can be dragged."""

    middle: FloatArray  # (m, 2): one point; none where it is out of view
    ends: FloatArray  # (e, 2): the two ends of a line, or one point on a circle
    lines: list[FloatArray]  # list of (k, 2) float64: the section itself, as polylines


def handle_parts(section: Section, box: Box) -> HandleParts | None:
    """Return the handle of a section in the visible ``box``; None where none of it is in there."""
    flat = section.in_plane
    parts = flat.trace(box)
    return flat.handle_parts(parts, box) if parts else None


def part_at(shown: list[tuple[Part, FloatArray]], at: FloatArray, reach: float) -> Part | None:
    """Return the first part of a handle within reach of a pixel, or None.

    ``shown``: the parts, the preferred one first: points of the middle or the ends, or one
    polyline, in pixels. ``at`` (2,) float64: the pixel. ``reach``: in pixels; for lines it is half
    of that.
    """
    for part, points in shown:
        if part == "line":
            if _distance(points, at) <= reach / 2.0:
                return part
        elif len(points) and row_norms(points - at).min() <= reach:
            return part
    return None


def within(points: FloatArray, box: Box) -> FloatArray:
    """Return the points of (n, 2) that are in a box."""
    return points[((points >= box[0]) & (points <= box[1])).all(axis=1)]


def rounded_place(point: FloatArray, size: float) -> Triple:
    """Return a point (2,) rounded as by `rounded`, with z = 0."""
    return rounded(float(point[0]), size), rounded(float(point[1]), size), 0.0


def rounded(value: float, size: float) -> float:
    """Return a number rounded to `_DIGITS` digits of the view's ``size``."""
    return round(value, _DIGITS - int(np.floor(np.log10(max(size, 1e-300))))) + 0.0


def _distance(line: FloatArray, at: FloatArray) -> float:
    """Return the distance of a point (2,) from a polyline (k, 2)."""
    start = line[:-1]
    way = np.diff(line, axis=0)
    length2 = np.maximum(row_dots(way, way), 1e-30)
    share = np.clip(row_dots(at - start, way) / length2, 0.0, 1.0)
    return float(row_norms(start + share[:, None] * way - at).min())
