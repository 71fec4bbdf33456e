"""Sections of a 2D mesh as the lines and circles they are: where to draw and to hold them."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.model import Section

MARGIN = 0.03
"""A line ends this part of the longest extent of a mesh outside of it."""
_CHORDS = 720
"""Of a circle."""

Box = tuple[FloatArray, FloatArray]
"""Lowest and highest coordinates, (2,) each."""


def box_around(points: FloatArray) -> Box:
    """Return the box around points (n, 2 or 3), with a margin."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    room = MARGIN * float((high - low).max())
    return low - room, high + room


def trace(section: Section, box: Box) -> list[FloatArray]:
    """Return the parts of a line or circle that are in a box, as polylines (k, 2) each.

    Parameters
    ----------
    section : Section
        One that cuts 2D meshes.
    box : (2,), (2,) float64
    """
    if section.kind == "plane":
        ends = line_ends(section, box)
        return [] if ends is None else [ends]
    angle = np.linspace(0.0, 2.0 * np.pi, _CHORDS + 1)
    ring = section.radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ring += section.origin[:2]
    inside = ((ring >= box[0]) & (ring <= box[1])).all(axis=1)
    starts = np.flatnonzero(np.diff(inside.astype(int))) + 1
    parts = zip(np.split(ring, starts), np.split(inside, starts), strict=True)
    return [part for part, kept in parts if kept[0] and len(part) > 1]


def line_ends(section: Section, box: Box) -> FloatArray | None:
    """Return where a line enters and leaves a box, (2, 2), along `along`; None beside it."""
    way = along(section)
    if way is None:
        return None
    start = middle(section)
    low, high = -np.inf, np.inf
    for axis in range(2):
        if way[axis] == 0.0:
            if not box[0][axis] <= start[axis] <= box[1][axis]:
                return None
            continue
        near, far = sorted((side[axis] - start[axis]) / way[axis] for side in box)
        low, high = max(low, near), min(high, far)
    return np.stack([start + low * way, start + high * way]) if low < high else None


def along(section: Section) -> FloatArray | None:
    """Return the direction of a line, (2,), its largest component positive; None: no line."""
    normal = np.asarray(section.direction, float)[:2]
    size = float(np.linalg.norm(normal))
    if not size > 0:
        return None
    way = np.array([-normal[1], normal[0]]) / size + 0.0
    return -way if way[np.argmax(np.abs(way))] < 0 else way


def middle(section: Section) -> FloatArray:
    """Return the point (2,) of a line in z = 0 that is nearest to its origin; that of a circle."""
    origin, normal = np.asarray(section.origin), np.asarray(section.direction)
    flat = normal[:2] @ normal[:2]
    if section.kind == "cylinder" or not flat > 0:
        return origin[:2]
    # A plane that leans in z meets the mesh beside the foot of its origin.
    return np.asarray(origin[:2] + origin[2] * normal[2] / flat * normal[:2])
