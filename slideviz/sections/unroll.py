"""Sections laid flat: a cylinder unrolled to (z, r theta), a plane seen along its normal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons

_TURN = 2.0 * np.pi

_STEEP = 0.8
"""Planes whose normal has this component along z are seen from above."""


def unroll(polygons: Polygons, section: Section, near: float | None = None) -> Polygons:
    """Return polygons around a cylinder laid flat; none is torn apart.

    Parameters
    ----------
    polygons : Polygons
        In space: cut by the cylinder, or the surface of whole cells at it.
    section : Section
        The cylinder, of radius R.
    near : float, optional
        The middle angle that is wanted, in radians; copies of a passage are laid side by side
        with it. Otherwise the middle lies within half a turn of 0.

    Returns
    -------
    Polygons
        Points (p, 3): position along the axis; R times the angle; and distance outwards from
        the cylinder. The same polygons in the same order; a point may occur once on each side of
        the seam, which lies in the middle of the largest angle without points.
    """
    local = section.frame(polygons.points)
    angle = np.arctan2(local[:, 1], local[:, 0])
    if not len(polygons):
        return polygons
    # Corners within half a turn of the first corner of their polygon, seam or not.
    corner = angle[polygons.connectivity]
    first = np.repeat(corner[polygons.offsets[:-1]], polygons.sizes)
    corner = first + _wrapped(corner - first)
    middle = np.add.reduceat(corner, polygons.offsets[:-1]) / polygons.sizes
    seam = _seam(angle)
    turns = -np.floor((middle - seam) / _TURN)
    corner += _TURN * np.repeat(turns, polygons.sizes)
    centre = (corner.min() + corner.max()) / 2.0
    corner += _TURN * np.round(((near or 0.0) - centre) / _TURN)
    turn = np.round((corner - angle[polygons.connectivity]) / _TURN).astype(np.int64)
    span = int(np.ptp(turn)) + 1
    keys, corners = np.unique(polygons.connectivity * span + turn - turn.min(), return_inverse=True)
    node, extra = np.divmod(keys, span)
    along = local[node, 2] + np.asarray(section.origin) @ section.basis[2]
    around = section.radius * (angle[node] + _TURN * (extra + turn.min()))
    outwards = np.hypot(local[node, 0], local[node, 1]) - section.radius
    points = np.stack([along, around, outwards], axis=1)
    return Polygons(points, polygons.offsets, corners, polygons.cells)


def middle_angle(flat: Polygons, section: Section) -> float:
    """Return the angle in radians of the middle of what `unroll` gave."""
    around = flat.points[:, 1]
    return float(around.min() + around.max()) / 2.0 / section.radius


def _wrapped(angle: FloatArray) -> FloatArray:
    """Return angles in -pi to pi."""
    return angle - _TURN * np.round(angle / _TURN)


def _seam(angle: FloatArray) -> float:
    """Return the middle of the largest gap between angles on the circle."""
    turned = np.sort(angle)
    gaps = np.diff(turned, append=turned[0] + _TURN)
    widest = int(np.argmax(gaps))
    return float(turned[widest] + gaps[widest] / 2.0)


class Label(NamedTuple):
    """What an axis is called: in full, and where there is no room."""

    full: str
    short: str


@dataclass(frozen=True, eq=False)
class Axes:
    """How a plane is looked at.

    Attributes
    ----------
    rows : (3, 3) float64
        Unit vectors to the right, up, and towards the eye.
    labels : (Label, Label)
        Of the first two.
    """

    rows: FloatArray
    labels: tuple[Label, Label]


def plane_axes(section: Section) -> Axes:
    """Return how a plane section is looked at: z up, or y where z points to the eye; x right."""
    normal = section.basis[2]
    up = np.eye(3)[1 if abs(normal[2]) > _STEEP else 2]
    up = up - (up @ normal) * normal
    up /= np.linalg.norm(up)
    right = np.cross(up, normal)
    if right[np.argmax(np.abs(right))] < 0:
        right = -right
    rows = np.stack([right, up, np.cross(right, up)])
    return Axes(rows, (direction_label(right), direction_label(up)))


def flatten(polygons: Polygons, section: Section, near: float | None = None) -> Polygons:
    """Return polygons laid flat: x to the right, y up, z towards the eye, (p, 3).

    A cylinder is unrolled (see `unroll`); a plane is seen along its normal.
    """
    if section.kind == "cylinder":
        return unroll(polygons, section, near)
    axes = plane_axes(section)
    points = polygons.points @ axes.rows.T
    points[:, 2] -= np.asarray(section.origin) @ axes.rows[2]
    return polygons.with_points(points)


def flat_labels(section: Section) -> tuple[Label, Label]:
    """Return what the first two coordinates of `flatten` are."""
    if section.kind == "cylinder":
        return direction_label(section.basis[2]), Label("r θ", "r θ")
    return plane_axes(section).labels


def direction_label(direction: FloatArray) -> Label:
    """Return x, y or z, or the direction; in short x′, y′ or z′ by its largest component."""
    word = "xyz"[int(np.argmax(np.abs(direction)))]
    if direction.max() > 1.0 - 1e-12:
        return Label(word, word)
    parts = ", ".join(f"{value:.3g}" for value in direction.round(12) + 0.0)
    return Label(f"along ({parts})", word + "′")
