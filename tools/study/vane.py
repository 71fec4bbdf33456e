"""The vane of the sample ``turbine-row``, its layer of quadrilaterals, and its channel.

A supersonic stator: the camber line is axial at the leading edge, turns early and is nearly
straight towards the trailing edge. The periodic sides of the channel follow it. Lengths are those
of thesis Table 4.7, in its unit.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from slideviz.mesh.model import FloatArray

LENGTH = 0.058275  # extent of the whole mesh in x (thesis Table 4.7)
HEIGHT = 0.097982  # in y
AHEAD = 0.0135  # axial distance from the inflow to the leading edge, which is the origin
CHORD = 0.0465  # length of the camber line in the vane
ANGLES_DEG = (0.0, -68.0, -57.0)
"""Direction of the camber line at the leading edge, at the trailing edge and at the outflow."""
TURNS = (0.56, 0.9)
"""Lengths over which the camber line turns, from the leading and trailing edge on, by ``CHORD``."""
THICKNESS = (0.06, 0.2, 1.3)
"""a, b, c of the half thickness sqrt(u (1 - u)) (a + b (1 - u)^c), with lengths by ``CHORD``.

The root rounds both ends: the radii are (a + b)^2 / 2 in front and a^2 / 2 behind, times CHORD.
"""
GROWTH = 1.2
RATIO = 30.0
"""Largest ratio of heights in the layer, of neighbouring quadrilaterals and of last to first."""
TOP = 0.85
"""Height of the layer's last quadrilaterals, divided by their width: about that of a triangle."""


@cache
def camber_line() -> FloatArray:
    """Return arc length from the leading edge, x, y and angle of the camber line: (4, m)."""
    ahead = -1.5 * AHEAD / CHORD
    behind = 3.0
    u = np.arange(ahead, behind, 2e-4)
    u -= u[np.argmin(np.abs(u))]
    first, last, out = np.radians(ANGLES_DEG)
    angle = first + (last - first) * _ramp(u / TURNS[0]) + (out - last) * _ramp((u - 1) / TURNS[1])
    middle = (angle[1:] + angle[:-1]) / 2
    steps = CHORD * np.diff(u) * [np.cos(middle), np.sin(middle)]
    xy = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
    xy -= xy[:, [int(np.argmin(np.abs(u)))]]
    inside = (xy[0] > -AHEAD - 1e-3) & (xy[0] < LENGTH - AHEAD + 1e-3)
    return np.concatenate([[CHORD * u], xy, [angle]])[:, inside]


def camber(x: FloatArray) -> FloatArray:
    """Return y of the camber line at ``x``, from inflow to outflow."""
    _, xs, ys, _ = camber_line()
    return np.interp(x, xs, ys)


def pitch() -> float:
    """Return the distance of two vanes in y, which makes the mesh ``HEIGHT`` high."""
    first, last = camber(np.array([-AHEAD, LENGTH - AHEAD]))
    return float(HEIGHT - (first - last))


def _ramp(part: FloatArray) -> FloatArray:
    """Return 0 below 0, 1 above 1, and between a step with two continuous derivatives."""
    t = np.clip(part, 0.0, 1.0)
    return t**3 * (10 - 15 * t + 6 * t**2)


@cache
def _profile() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return arc length (m,), points (m, 2), outer normals (m, 2) and curvature (m,) of the vane.

    They go counter-clockwise from the trailing edge and back to it.
    """
    phi = np.linspace(-np.pi, np.pi, 40001)
    u = (1 + np.cos(phi + np.pi)) / 2
    a, b, c = THICKNESS
    half = -CHORD * np.sin(phi) / 2 * (a + b * (1 - u) ** c)
    s, xs, ys, angles = camber_line()
    x = np.interp(CHORD * u, s, xs)
    y = np.interp(CHORD * u, s, ys)
    angle = np.interp(CHORD * u, s, angles)
    curve = np.column_stack([x - half * np.sin(angle), y + half * np.cos(angle)])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    curve[-1] = curve[0]
    even = np.linspace(0.0, arc[-1], 4001)
    coarse = np.column_stack([np.interp(even, arc, column) for column in curve.T])
    return _smooth_curve(coarse, even)


def _smooth_curve(
    points: FloatArray, arc: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the same as `_profile` for a closed curve of ``points`` (m, 2) at ``arc`` (m,).

    Normals and curvature are those of a periodic cubic spline; the last point becomes the first.
    """
    points[-1] = points[0]
    spline = CubicSpline(arc, points, bc_type="periodic")
    tx, ty = spline(arc, 1).T
    cx, cy = spline(arc, 2).T
    speed = np.hypot(tx, ty)
    return arc, points, np.column_stack([ty, -tx]) / speed[:, None], (tx * cy - ty * cx) / speed**3


def vane_layers(around: int, layers: int) -> FloatArray:
    """Return the nodes of vane and layer: (layers + 1, around, 2), counter-clockwise, vane first.

    Nodes are placed on the vane so that those of the outermost ring are equally far apart. The
    last quadrilaterals are about as high as the triangles that follow (``TOP``).
    """
    arc, points, normals, curvature = _profile()
    heights = _heights(layers)
    # The outermost ring is longer than the vane by a full turn of its offset.
    share = TOP * heights.sum() / heights[-1]
    width = arc[-1] / (around - 2 * np.pi * share)
    offsets = np.concatenate([[0.0], np.cumsum(heights)]) / heights.sum() * share * width
    density = 1 + curvature * offsets[-1]
    length = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(arc))])
    at = np.interp(np.arange(around) / around * length[-1], length, arc)
    foot = CubicSpline(arc, points, bc_type="periodic")(at)
    normal = CubicSpline(arc, normals, bc_type="periodic")(at)
    return foot + offsets[:, None, None] * normal


def _heights(layers: int) -> FloatArray:
    """Return the heights (layers,) of the layers, divided by that of the first."""
    growth = min(GROWTH, RATIO ** (1 / max(layers - 1, 1)))
    return growth ** np.arange(layers)
