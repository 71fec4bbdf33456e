"""The turbine blade of ``passage`` and ``stator``: a parabolic camber line with rounded ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray

NOSE = (0.05, 0.04)
TAIL = (0.07, 0.012)
"""Part of the nodes drawn to the end, as a length, and the distance over which it fades."""


@dataclass(frozen=True)
class Section:
    """A blade and the channel it stands in. The axial chord is 1, from x = 0.

    Attributes
    ----------
    angles_deg : (float, float)
        Of the camber line against the x axis, at the leading and at the trailing edge.
    thickness : (float, float, float)
        a, b, c of the half thickness sqrt(x (1 - x)) (a + b (1 - x)^c). The root rounds both
        ends: the radii are (a + b)^2 / 2 in front and a^2 / 2 behind.
    pitch : float
        Distance of the periodic sides in y.
    ends : (float, float)
        x of inflow and outflow.
    hole : (float, float, float)
        First and last x of the hole that the O-grid fills, before smoothing, and its half
        height about the camber line.
    """

    angles_deg: tuple[float, float] = (30.0, -50.0)
    thickness: tuple[float, float, float] = (0.1, 0.2, 1.4)
    pitch: float = 0.75
    ends: tuple[float, float] = (-0.5, 1.6)
    hole: tuple[float, float, float] = (-0.1, 1.12, 0.14)


PASSAGE = Section()
"""Of the sample ``passage``."""


def camber(x: FloatArray, section: Section = PASSAGE) -> FloatArray:
    """Return y of the camber line, with its tangents before x = 0 and behind x = 1."""
    first, last = np.tan(np.radians(section.angles_deg))
    inside = np.clip(x, 0.0, 1.0)
    ahead, behind = np.minimum(x, 0.0), np.maximum(x - 1.0, 0.0)
    return first * (inside + ahead) + (last - first) / 2 * inside**2 + last * behind


def blade_nodes(lower: int, upper: int, section: Section = PASSAGE) -> FloatArray:
    """Return the nodes counter-clockwise from the leading edge: (lower + upper, 2).

    ``lower`` edges lead along the pressure side to the trailing edge, ``upper`` back along the
    suction side.
    """
    phi = np.linspace(0.0, np.pi, 20001)
    there = _spread(_surface(phi, -1.0, section), lower)
    back = _spread(_surface(phi, 1.0, section), upper)
    return np.concatenate([there[:-1], back[:0:-1]])


def _surface(phi: FloatArray, side: float, section: Section) -> FloatArray:
    """Return the points of one side at x = (1 - cos phi) / 2: (m, 2)."""
    x = (1 - np.cos(phi)) / 2
    a, b, c = section.thickness
    half = side * np.sin(phi) / 2 * (a + b * (1 - x) ** c)
    first, last = np.tan(np.radians(section.angles_deg))
    slope = first + (last - first) * x
    normal = np.column_stack([-slope, np.ones_like(x)]) / np.hypot(1.0, slope)[:, None]
    return np.column_stack([x, camber(x, section)]) + half[:, None] * normal


def _spread(curve: FloatArray, edges: int) -> FloatArray:
    """Return ``edges`` + 1 points of a fine curve (m, 2), denser at its ends."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    weight = arc + NOSE[0] * np.arctan(arc / NOSE[1])
    weight -= TAIL[0] * np.arctan((arc[-1] - arc) / TAIL[1])
    at = np.interp(np.linspace(weight[0], weight[-1], edges + 1), weight, arc)
    return np.column_stack([np.interp(at, arc, curve[:, 0]), np.interp(at, arc, curve[:, 1])])
