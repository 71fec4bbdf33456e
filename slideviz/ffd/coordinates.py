"""Coordinate systems of boxes: control points and nodes are blended in q instead of x, y, z.

Systems have their axis along x through a point. SU2 8, ``CFreeFormDefBox::SetCart2Cyl_*`` and
``SetCart2Sphe_*``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.terms import FfdSystem

WEDGE = 0.1
"""Half the angle in radians of a box in 2D with polar coordinates, about the axis."""
POLAR_CORNERS = np.array([1, 2, 2, 1, 0, 3, 3, 0])
"""Which of the 4 corners that are given each of the 8 corners of a polar box in 2D is."""
POLAR_SIDES = np.array([-1, -1, 1, 1, -1, -1, 1, 1])
"""Side of the plane on which each of them is."""


@dataclass(frozen=True)
class CoordinateSystem:
    """A coordinate system q with its axis along x through ``origin``.

    Cylindrical: q = (r, theta, x - x0). Spherical and polar: q = (r, theta, phi), phi being the
    angle from the axis. theta is in (-3 pi/2, pi/2], measured from y to z.
    """

    kind: FfdSystem = "CARTESIAN"
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def q_of(self, points: FloatArray) -> FloatArray:
        """Return the coordinates q (..., 3) of points (..., 3)."""
        if self.kind == "CARTESIAN":
            return points
        x, y, z = np.moveaxis(points - np.array(self.origin), -1, 0)
        theta = np.arctan2(z, y)
        theta = np.where(theta > 0.5 * np.pi, theta - 2.0 * np.pi, theta)
        if self.kind == "CYLINDRICAL":
            return np.stack([np.hypot(y, z), theta, x], axis=-1)
        radius = np.sqrt(x * x + y * y + z * z)
        cosine = np.divide(x, radius, out=np.ones_like(x), where=radius > 0.0)
        return np.stack([radius, theta, np.arccos(np.clip(cosine, -1.0, 1.0))], axis=-1)

    def points_of(self, q: FloatArray) -> FloatArray:
        """Return the points (..., 3) of coordinates q (..., 3)."""
        if self.kind == "CARTESIAN":
            return q
        first, theta, last = np.moveaxis(q, -1, 0)
        x, r = (last, first) if self.kind == "CYLINDRICAL" else _spherical(first, last)
        return np.stack([x, r * np.cos(theta), r * np.sin(theta)], -1) + np.array(self.origin)

    def pushed(self, q: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rates (..., 3) of points for rates (..., 3) of their q (..., 3)."""
        if self.kind == "CARTESIAN":
            return rates
        first, theta, last = np.moveaxis(q, -1, 0)
        d_first, d_theta, d_last = np.moveaxis(rates, -1, 0)
        if self.kind == "CYLINDRICAL":
            r, dx, dr = first, d_last, d_first
        else:
            x, r = _spherical(first, last)
            along, across = _spherical(d_first, last)
            dx, dr = along - r * d_last, across + x * d_last
        sine, cosine = np.sin(theta), np.cos(theta)
        turned = r * d_theta
        return np.stack([dx, dr * cosine - turned * sine, dr * sine + turned * cosine], -1)


CARTESIAN = CoordinateSystem()


def _spherical(radius: FloatArray, phi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the part of a radius along the axis, and that across it."""
    return radius * np.cos(phi), radius * np.sin(phi)


def polar_corners(corners: FloatArray) -> FloatArray:
    """Return the corners (8, 3) of a polar box in 2D from its corners (4, 2) in the plane.

    Its directions are i along given 1 to 2, j about the axis and k along given 1 to 0.
    """
    x, y = corners[POLAR_CORNERS].T
    return np.stack([x, y * np.cos(WEDGE), POLAR_SIDES * y * np.sin(WEDGE)], axis=-1)


def given_of_polar(corners: FloatArray) -> FloatArray:
    """Return the corners (4, 2) from which `polar_corners` makes ``corners`` (8, 3)."""
    first: IntArray = np.array([4, 0, 1, 5])
    x, y, z = corners[first].T
    return np.stack([x, np.copysign(np.hypot(y, z), y)], axis=-1)
