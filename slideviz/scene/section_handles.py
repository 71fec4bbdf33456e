"""Where sections of a 2D mesh are held by the mouse, and what becomes of them when dragged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.line import Box, line_ends, middle, trace
from slideviz.sections.model import Section, Triple

Part = Literal["middle", "end", "line"]
"""What is held: the middle, an end of a line, or the line or circle itself anywhere."""

_DIGITS = 4
"""More digits of a place, beside the size of the view, than anybody can aim for."""


@dataclass(frozen=True, eq=False)
class Grips:
    """Points where a section is held, and all of it that can be seen.

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


def grips(section: Section, box: Box) -> Grips | None:
    """Return where a section can be held within a box that is seen; None where none of it is."""
    parts = trace(section, box)
    if not parts:
        return None
    if section.kind == "cylinder":
        longest = max(parts, key=len)
        ends = longest[None, len(longest) // 2 if len(parts) > 1 else len(longest) // 8]
        return Grips(_within(middle(section)[None], box), ends, parts)
    ends = parts[0]
    return Grips(pivot(section, box)[None], ends, parts)


def pivot(section: Section, box: Box) -> FloatArray:
    """Return the point (2,) that a line turns about: its origin, or the middle of what is seen."""
    own = _within(middle(section)[None], box)
    if len(own):
        return np.asarray(own[0])
    ends = line_ends(section, box)
    return middle(section) if ends is None else np.asarray(ends.mean(axis=0))


def nearest(shown: list[tuple[Part, FloatArray]], at: FloatArray, reach: float) -> Part | None:
    """Return which part is at a pixel: the first whose points or lines are within reach.

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
    """Return a section after its part was dragged.

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
    start, now = way
    size = float((box[1] - box[0]).max())
    if section.kind == "cylinder" and part != "middle":
        radius = float(np.linalg.norm(now - np.asarray(section.origin[:2])))
        return replace(section, radius=rounded(max(radius, 1e-4 * size), size))
    if part == "end":
        centre = pivot(section, box)
        return _turned(section, centre, now - centre)
    shift = now - start
    if part == "line":
        normal = np.asarray(section.direction[:2]) / np.linalg.norm(section.direction[:2])
        shift = (shift @ normal) * normal
    return replace(section, origin=_place(middle(section) + shift, size))


def _turned(section: Section, centre: FloatArray, way: FloatArray) -> Section:
    """Return a line along ``way`` (2,) through its centre."""
    length = float(np.linalg.norm(way))
    if not length > 0:
        return section
    normal = np.array([-way[1], way[0]]) / length
    if normal @ np.asarray(section.direction[:2]) < 0:
        normal = -normal
    x, y = (float(value) for value in normal.round(_DIGITS) + 0.0)
    return replace(section, origin=(float(centre[0]), float(centre[1]), 0.0), direction=(x, y, 0.0))


def _within(points: FloatArray, box: Box) -> FloatArray:
    return points[((points >= box[0]) & (points <= box[1])).all(axis=1)]


def _place(point: FloatArray, size: float) -> Triple:
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
