"""Handles of sections in 2D meshes: their points, and the section after a drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.mesh.model import FloatArray

if TYPE_CHECKING:
    from slideviz.sections.line import Box
    from slideviz.sections.model import Section, Triple

Part = Literal["middle", "end", "line"]
"""What is held: the middle, an end of a line, or the line or circle itself anywhere."""

_DIGITS = 4
"""More digits of a place, beside the size of the view, than anybody can aim for."""


@dataclass(frozen=True, eq=False)
class HandleParts:
    """The handle points of a section, and its lines that can be seen.

    Attributes
    ----------
    middle : (m, 2) float64
        One point, or none where it is not seen.
    ends : (e, 2) float64
        Two of a line; one of a circle.
    lines : list of (k, 2) float64
        The section itself.
    """

    middle: FloatArray
    ends: FloatArray
    lines: list[FloatArray]


def handle_parts(section: Section, box: Box) -> HandleParts | None:
    """Return the handle of a section within a box that is seen; None where none of it is."""
    parts = section.in_plane.trace(section, box)
    return section.in_plane.handle_parts(section, parts, box) if parts else None


def nearest(shown: list[tuple[Part, FloatArray]], at: FloatArray, reach: float) -> Part | None:
    """Return the part of a handle at a pixel: the first whose points or lines are in reach.

    Parameters
    ----------
    shown : list of (part, (k, 2) float64)
        Points of middle and ends, each by itself, and polylines, in pixels.
    at : (2,) float64
    reach : float
        In pixels; of lines, half as much.
    """
    for part, points in shown:
        if part == "line":
            if _distance(points, at) <= reach / 2.0:
                return part
        elif len(points) and np.linalg.norm(points - at, axis=1).min() <= reach:
            return part
    return None


def dragged(section: Section, part: Part, way: tuple[FloatArray, FloatArray], box: Box) -> Section:
    """Return a section after a part of its handle was dragged.

    Parameters
    ----------
    section : Section
        As it was at the start.
    part : {"middle", "end", "line"}
        A line turns by its ends and moves by the rest; a circle moves by its middle and takes
        another radius by the rest.
    way : (2,), (2,) float64
        From where to where the mouse went, in the mesh's length unit.
    box : (2,), (2,) float64
        What was seen at the start.
    """
    return section.in_plane.dragged(section, part, way, box)


def within(points: FloatArray, box: Box) -> FloatArray:
    """Return the points of (n, 2) that are in a box."""
    return points[((points >= box[0]) & (points <= box[1])).all(axis=1)]


def rounded_place(point: FloatArray, size: float) -> Triple:
    """Return a point (2,) without digits that are nothing beside a size, in z = 0."""
    return rounded(float(point[0]), size), rounded(float(point[1]), size), 0.0


def rounded(value: float, size: float) -> float:
    """Return a number without digits that are nothing beside a size."""
    return round(value, _DIGITS - int(np.floor(np.log10(max(size, 1e-300))))) + 0.0


def _distance(line: FloatArray, at: FloatArray) -> float:
    """Return how far a point (2,) is from a polyline (k, 2)."""
    start, way = line[:-1], np.diff(line, axis=0)
    length2 = np.maximum(np.einsum("ij,ij->i", way, way), 1e-30)
    share = np.clip(np.einsum("ij,ij->i", at - start, way) / length2, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - at, axis=1).min())
