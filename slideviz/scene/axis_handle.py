"""The geometry of the handle of a section about an axis: its frame, and the size after a drag.

The handle's widget is `slideviz.gui.viewport.point_handle.AxisHandle`; handles of 2D sections are
in `slideviz.sections.handles`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.sections.around_axis import TURN, Patch, PlaceOnSection, Quadric, axis_section
from slideviz.sections.model import Section
from slideviz.session.section_cuts import Cuts

PixelsOf = Callable[[FloatArray], FloatArray]
"""A function that returns the display coordinates (n, 2), in pixels, of points (n, 3)."""

_MARGIN = 0.015  # margin between a patch and the frame around it, relative to the patch's diagonal
_CHORD = np.radians(1.0)  # angle between the points of an arc, in radians
_SIDE = 33  # points of a side that is not a straight line
_STEEP = 0.3  # foreshortening of the size's direction below which the mouse cannot drag along it
_LEAST = 1e-3
"""Least size after a drag, relative to that before; and distance from the largest size there is,
relative to the latter."""


def patch_in(section: Section, mesh: Mesh, cuts: Cuts) -> Patch:
    """Return the patch of a section that cuts a mesh, or the patch nearest to the mesh."""
    return axis_section(section).patch(points_near(section, mesh, cuts))


def points_near(section: Section, mesh: Mesh, cuts: Cuts) -> FloatArray:
    """Return the points (n, 3) of a section's cut; the mesh's nodes if it cuts no cell."""
    cut = cuts.of(mesh, section)
    return cut.points if len(cut) else mesh.points[cuts.cutter(mesh).used]


def frame_of(section: Section, patch: Patch) -> list[FloatArray]:
    """Return polylines (k, 3) around a patch: arcs at both ends along the axis, and two sides.

    A patch all around the axis has no sides.
    """
    shape = axis_section(section)
    girth = shape.girth((patch.along[0] + patch.along[1]) / 2.0)
    size = (patch.angles[1] - patch.angles[0]) * girth, patch.along[1] - patch.along[0]
    margin = _MARGIN * float(np.hypot(*size))
    low = patch.along[0] - margin
    high = patch.along[1] + margin
    first = patch.angles[0] - margin / girth
    last = patch.angles[1] + margin / girth
    closed = patch.is_full_ring or last - first > TURN
    if closed:
        first = patch.angles[0]
        last = patch.angles[0] + TURN
    angle = np.linspace(first, last, int(np.ceil((last - first) / _CHORD)) + 2)
    arcs = [np.column_stack([angle, np.full(len(angle), at)]) for at in (low, high)]
    along = np.linspace(low, high, 2 if isinstance(shape, Quadric) else _SIDE)
    sides = [np.column_stack([np.full(len(along), at), along]) for at in (first, last)]
    sides = [] if closed else sides
    return [shape.surface(line, section.size) for line in (*arcs, *sides)]


def pixel_and_slope(
    pixels_of: PixelsOf, section: Section, place: PlaceOnSection, size: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Return the pixel (2,) of a place on a section, and its derivative (2,) by the section's size.

    Then whether it is steep: nearly along the line of sight, so that the place would hardly move on
    the screen. The derivative points upwards then, as a replacement.
    """
    shape = axis_section(section)
    lever = shape.lever(place[1])
    # Outwards, around and along the section: one of the three is hardly foreshortened.
    directions = shape.sized(size).ways(place[0])
    (here,) = shape.surface(np.array([place]), size)
    step = 1e-3 * section.size * lever
    at = pixels_of(np.concatenate([here[None], here + step * directions]))
    slopes = (at[1:] - at[0]) / step
    scale = float(np.linalg.norm(slopes, axis=1).max())
    steep = float(np.linalg.norm(slopes[0])) < _STEEP * scale
    return at[0], lever * (np.array([0.0, scale]) if steep else slopes[0]), steep


def dragged_size(
    pixels_of: PixelsOf,
    section: Section,
    place: PlaceOnSection,
    *,
    start: FloatArray,
    now: FloatArray,
) -> float:
    """Return the size of a section after one of its places was dragged.

    ``section``: as it was when the drag began. ``start`` and ``now`` (2,): where the drag began,
    and where the mouse is now, in pixels.
    """
    size = section.size
    ends = _LEAST * size, section.size_terms.high * (1.0 - _LEAST)
    at, slope, steep = pixel_and_slope(pixels_of, section, place, size)
    target = at + now - start
    if steep:
        return float(np.clip(size + float((now - start)[1] / slope[1]), *ends))
    # Newton's method: in perspective, the pixel is not linear in the size.
    for _ in range(4):
        at, slope, steep = pixel_and_slope(pixels_of, section, place, size)
        if steep:
            break
        size = float(np.clip(size + float((target - at) @ slope / (slope @ slope)), *ends))
    return size
