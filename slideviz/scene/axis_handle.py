"""The handle of a section about an axis: the patch where the mouse takes it, and the drag."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.sections.around_axis import TURN, Patch, PlaceOnSection, axis_shape, patch_of
from slideviz.sections.model import Section
from slideviz.session.section_cuts import Cuts

Seen = Callable[[FloatArray], FloatArray]
"""Returns where points (n, 3) are seen, (n, 2) in pixels."""

_ROOM = 0.015
"""The frame is so much larger than what it is around, as a part of its diagonal."""
_CHORD = np.radians(1.0)
_STEEP = 0.3
"""Whoever looks along a radius sees it shortened to less than this: the mouse cannot follow it."""
_LEAST = 1e-3
"""No size is less than this part of the one at the start, nor so near to the largest there is."""


def patch_in(section: Section, mesh: Mesh, cuts: Cuts) -> Patch:
    """Return the part of a section inside a mesh, or the part nearest to the mesh."""
    return patch_of(section, points_near(section, mesh, cuts))


def points_near(section: Section, mesh: Mesh, cuts: Cuts) -> FloatArray:
    """Return the points (n, 3) of a section's cut, or the mesh's where nothing is cut."""
    cut = cuts.of(mesh, section)
    return cut.points if len(cut) else mesh.points[cuts.cutter(mesh).used]


def frame_of(section: Section, patch: Patch) -> list[FloatArray]:
    """Return lines (k, 3) around a patch: arcs at both ends of the axis, and what joins them."""
    shape = axis_shape(section)
    girth = shape.girth(section, (patch.along[0] + patch.along[1]) / 2.0)
    size = (patch.angles[1] - patch.angles[0]) * girth, patch.along[1] - patch.along[0]
    room = _ROOM * float(np.hypot(*size))
    low, high = patch.along[0] - room, patch.along[1] + room
    first, last = patch.angles[0] - room / girth, patch.angles[1] + room / girth
    closed = patch.whole or last - first > TURN
    if closed:
        first, last = patch.angles[0], patch.angles[0] + TURN
    angle = np.linspace(first, last, int(np.ceil((last - first) / _CHORD)) + 2)
    arcs = [np.column_stack([angle, np.full(len(angle), at)]) for at in (low, high)]
    sides = [] if closed else [np.array([[at, low], [at, high]]) for at in (first, last)]
    return [shape.surface(section, line, section.size) for line in (*arcs, *sides)]


def drag(
    seen: Seen, section: Section, place: PlaceOnSection, size: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Return the pixel of a place on a section, and how far the mouse goes for a unit of size.

    Returns
    -------
    at, way : (2,) float64
        In pixels. Who looks along the way that it goes pulls upwards for a larger one.
    steep : bool
        Whether that is so.
    """
    shape, lever = axis_shape(section), axis_shape(section).lever(section, place[1])
    # Outwards, around and along the section: of three, one is seen in full length or nearly.
    ways = shape.ways(section.sized(size), place[0])
    (here,) = shape.surface(section, np.array([place]), size)
    step = 1e-3 * section.size * lever
    at = seen(np.concatenate([here[None], here + step * ways]))
    slopes = (at[1:] - at[0]) / step
    scale = float(np.linalg.norm(slopes, axis=1).max())
    steep = float(np.linalg.norm(slopes[0])) < _STEEP * scale
    return at[0], lever * (np.array([0.0, scale]) if steep else slopes[0]), steep


def dragged_size(
    seen: Seen, section: Section, place: PlaceOnSection, *, start: FloatArray, now: FloatArray
) -> float:
    """Return the size of a section after a drag of one of its places.

    Parameters
    ----------
    seen : callable
    section : Section
        As it was at the start.
    place : (float, float)
        What the mouse holds.
    start, now : (2,) float64
        From where to where the mouse went, in pixels.
    """
    size, ends = (
        section.size,
        (_LEAST * section.size, axis_shape(section).size.high * (1.0 - _LEAST)),
    )
    at, slope, steep = drag(seen, section, place, size)
    target = at + now - start
    if steep:
        return float(np.clip(size + float((now - start)[1] / slope[1]), *ends))
    # In perspective, what is nearer moves further: a few steps to where the mouse is.
    for _ in range(4):
        at, slope, steep = drag(seen, section, place, size)
        if steep:
            break
        size = float(np.clip(size + float((target - at) @ slope / (slope @ slope)), *ends))
    return size
