"""Derivatives of the maps of a frame (`slideviz.rbf.frames`): points, coordinates and features."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.axis_frame import axis_basis, in_axis_frame
from slideviz.mesh.model import FloatArray
from slideviz.rbf.axis import ON_AXIS
from slideviz.rbf.frames import Frame, _perpendicular
from slideviz.system.threads import in_parts


def coords_slopes(frame: Frame, points: FloatArray) -> FloatArray:
    """Return the derivative (n, d, d) of ``frame.coords`` at Cartesian points (n, d).

    ``[i, a, b]`` is the derivative of coordinate a with respect to point component b. On the axis,
    where the angle has no meaning, the rows of radius and angle are zero: nodes on the axis may
    move along it only.
    """
    n, d = points.shape
    if frame.axis is None or frame.origin is None:
        return np.broadcast_to(np.eye(d), (n, d, d))
    basis = axis_basis(frame.axis)
    local = in_axis_frame(points, frame.axis, frame.origin)
    r = np.hypot(local[:, 0], local[:, 1])
    off = r > ON_AXIS * frame.radius
    inverse = np.divide(1.0, r, out=np.zeros_like(r), where=off)
    cos, sin = local[:, 0] * inverse, local[:, 1] * inverse
    out = np.empty((n, 3, 3))
    out[:, 0] = cos[:, None] * basis[0] + sin[:, None] * basis[1]
    around = cos[:, None] * basis[1] - sin[:, None] * basis[0]
    out[:, 1] = (frame.radius * inverse)[:, None] * around
    out[:, 2] = basis[2]
    return out[:, :d, :d]


def points_slopes(frame: Frame, coords: FloatArray) -> FloatArray:
    """Return the derivative (n, d, d) of ``frame.points`` at coordinates (n, d)."""
    n, d = coords.shape
    if frame.axis is None:
        return np.broadcast_to(np.eye(d), (n, d, d))
    basis = axis_basis(frame.axis)
    out = np.empty((n, 3, 3))

    def fill(part: slice) -> None:
        angle = coords[part, 1] / frame.radius + frame.theta0
        cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
        out[part, :, 0] = cos * basis[0] + sin * basis[1]
        out[part, :, 1] = coords[part, :1] / frame.radius * (cos * basis[1] - sin * basis[0])
        out[part, :, 2] = basis[2]

    in_parts(fill, n)
    return out[:, :d, :d]


def features_slopes(frame: Frame, coords: FloatArray) -> FloatArray:
    """Return the derivative (n, k, d) of ``frame.features`` at coordinates (n, d)."""
    n, d = coords.shape
    if frame.cylindrical and frame.period:
        rate = np.pi / frame.period / frame.radius
        phase = rate * coords[:, 1]
        out = np.zeros((n, 4, d))
        out[:, 0, 0] = 1.0
        out[:, 1, 1], out[:, 2, 1] = rate * np.cos(phase), -rate * np.sin(phase)
        if d == 3:
            out[:, 3, 2] = 1.0
        return out
    if frame.direction is None:
        return points_slopes(frame, coords)
    angle = 2 * np.pi / frame.period * (coords @ frame.direction)
    out = np.empty((n, d + 1, d))
    out[:, 0] = -np.sin(angle)[:, None] * frame.direction
    out[:, 1] = np.cos(angle)[:, None] * frame.direction
    out[:, 2:] = _perpendicular(frame.direction)
    return out
