"""Where a cylinder through a 3D mesh is held by the mouse, and to which radius it is dragged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from slideviz.sections.model import Section
from slideviz.session.section_cuts import Cuts

Place = tuple[float, float]
"""A place on a cylinder of any radius: its angle in radians, and how far along the axis it is."""
Seen = Callable[[FloatArray], FloatArray]
"""Returns where points (n, 3) are seen, (n, 2) in pixels."""

_TURN = 2.0 * np.pi
_WHOLE = np.radians(300.0)
"""What is cut over more than this is a whole ring."""
_ROOM = 0.015
"""The frame is so much larger than what it is around, as a part of its diagonal."""
_HOLE = 0.1
"""What is held lies so near to the cut, as a part of its diagonal."""
_CHORD = np.radians(1.0)
_MOST = 400
"""Other places to hold it by: enough for one of them to be in any detail that is looked at."""
_STEEP = 0.3
"""Whoever looks along a radius sees it shortened to less than this: the mouse cannot follow it."""
_LEAST = 1e-3
"""No radius is less than this part of the one at the start."""


@dataclass(frozen=True, eq=False)
class Patch:
    """The part of a cylinder that lies in a mesh, or beside it where it cuts nothing.

    Attributes
    ----------
    angles, along : (float, float)
        From where to where it reaches, in radians and in the length unit; angles rise.
    middle : (float, float)
        Where it is held: in its middle or, where a hole is there, at the cut nearest to that.
    places : (k, 2) float64
        Places of the cut, with angles as those of the patch.
    """

    angles: tuple[float, float]
    along: tuple[float, float]
    middle: Place
    places: FloatArray

    @property
    def whole(self) -> bool:
        """Tell whether it goes all the way round."""
        return self.angles[1] - self.angles[0] > _WHOLE


def patch_of(section: Section, points: FloatArray) -> Patch:
    """Return the part of a cylinder that has these points (n, 3): of its cut, or of a mesh."""
    local = section.frame(points)
    angle, along = np.arctan2(local[:, 1], local[:, 0]), local[:, 2]
    turned = np.sort(angle)
    gaps = np.diff(turned, append=turned[0] + _TURN)
    # From the end of the widest gap on, there is no seam.
    start = float(turned[(int(np.argmax(gaps)) + 1) % len(turned)])
    angle = start + (angle - start) % _TURN
    low, high = (float(angle.min()), float(angle.max())), (float(along.min()), float(along.max()))
    places = np.column_stack([angle, along])
    middle = np.array([np.mean(low), np.mean(high)])
    flat = (places - middle) * (section.radius, 1.0)
    far = np.linalg.norm(flat, axis=1)
    nearest = int(np.argmin(far))
    if far[nearest] > _HOLE * np.linalg.norm(np.ptp(flat, axis=0)):
        middle = places[nearest]
    some = places[:: max(len(places) // _MOST, 1)]
    return Patch(low, high, (float(middle[0]), float(middle[1])), some)


def patch_in(section: Section, mesh: Mesh, cuts: Cuts) -> Patch:
    """Return the part of a cylinder that is in a mesh; beside it, that which is nearest."""
    cut = cuts.of(mesh, section)
    return patch_of(section, cut.points if len(cut) else mesh.points[cuts.cutter(mesh).used])


def outside(section: Section, patch: Patch) -> FloatArray:
    """Return how the middle of a patch is looked at from outside: right, up and to the eye.

    The axis is to the right, as in the flat view.
    """
    angle = patch.middle[0]
    to_eye = np.array([np.cos(angle), np.sin(angle), 0.0]) @ section.basis
    right = section.basis[2]
    return np.stack([right, np.cross(to_eye, right), to_eye])


def on_cylinder(section: Section, places: FloatArray, radius: float) -> FloatArray:
    """Return places (k, 2) about the axis of a section, at a radius, in space (k, 3)."""
    angle, along = places[:, 0], places[:, 1]
    local = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), along])
    return np.asarray(section.origin) + local @ section.basis


def frame_of(section: Section, patch: Patch) -> list[FloatArray]:
    """Return lines (k, 3) around a patch: arcs at both ends of the axis, and what joins them."""
    radius = section.radius
    size = (patch.angles[1] - patch.angles[0]) * radius, patch.along[1] - patch.along[0]
    room = _ROOM * float(np.hypot(*size))
    low, high = patch.along[0] - room, patch.along[1] + room
    first, last = patch.angles[0] - room / radius, patch.angles[1] + room / radius
    closed = patch.whole or last - first > _TURN
    if closed:
        first, last = patch.angles[0], patch.angles[0] + _TURN
    angle = np.linspace(first, last, int(np.ceil((last - first) / _CHORD)) + 2)
    arcs = [np.column_stack([angle, np.full(len(angle), at)]) for at in (low, high)]
    sides = [] if closed else [np.array([[at, low], [at, high]]) for at in (first, last)]
    return [on_cylinder(section, line, radius) for line in (*arcs, *sides)]


def pull(
    seen: Seen, section: Section, place: Place, radius: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Return where a place is seen, and how far the mouse goes for a unit of radius.

    Returns
    -------
    at, way : (2,) float64
        In pixels. Who looks along the radius pulls upwards for a larger one.
    steep : bool
        Whether that is so.
    """
    cos, sin = np.cos(place[0]), np.sin(place[0])
    # Outwards, around and along the axis: of three, one is seen in full length or nearly.
    ways = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ section.basis
    (here,) = on_cylinder(section, np.array([place]), radius)
    step = 1e-3 * section.radius
    at = seen(np.concatenate([here[None], here + step * ways]))
    slopes = (at[1:] - at[0]) / step
    scale = float(np.linalg.norm(slopes, axis=1).max())
    steep = float(np.linalg.norm(slopes[0])) < _STEEP * scale
    return at[0], np.array([0.0, scale]) if steep else slopes[0], steep


def radius_at(
    seen: Seen, section: Section, place: Place, way: tuple[FloatArray, FloatArray]
) -> float:
    """Return the radius to which a place of a section is dragged.

    Parameters
    ----------
    seen : callable
    section : Section
        As it was at the start.
    place : (float, float)
        What the mouse holds.
    way : (2,), (2,) float64
        From where to where the mouse went, in pixels.
    """
    start, now = way
    radius, least = section.radius, _LEAST * section.radius
    at, slope, steep = pull(seen, section, place, radius)
    target = at + now - start
    if steep:
        return max(radius + float((now - start)[1] / slope[1]), least)
    # In perspective, what is nearer moves further: a few steps to where the mouse is.
    for _ in range(4):
        at, slope, steep = pull(seen, section, place, radius)
        if steep:
            break
        radius = max(radius + float((target - at) @ slope / (slope @ slope)), least)
    return radius
