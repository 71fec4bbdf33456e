"""How the blade of the sample ``stator`` moves, as an optimiser might: twist, lean and bumps."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray

TWIST_DEG = -8.0
"""Rotation about the stacking line at the shroud; 0 at the hub."""
LEAN_DEG = -3.0
"""Shift in theta at the shroud, which moves the blade out of its old passage; 0 at the hub."""
BUMPS, SEED = 40, 41
"""Number of bumps, and seed of their random places, widths and heights."""
HEIGHT, WIDTH = 6e-4, (3e-3, 9e-3)
"""Greatest height of a bump, and its least and greatest radius, in the mesh's length unit."""


def reshaped(points: FloatArray, radii: tuple[float, float], stack_z: float) -> FloatArray:
    """Return the displacement (k, 3) of blade nodes, which keeps their distance from the axis.

    Parameters
    ----------
    points : (k, 3)
        Nodes of the blade; the axis is z.
    radii : (float, float)
        Radii of hub and shroud.
    stack_z : float
        z of the stacking line, which has theta = 0.
    """
    r, theta = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    z, arc = points[:, 2], r * theta
    span = (r - radii[0]) / (radii[1] - radii[0])
    twist = np.radians(TWIST_DEG) * span**2
    away = z - stack_z
    moved_z = stack_z + np.cos(twist) * away - np.sin(twist) * arc
    moved_arc = np.sin(twist) * away + np.cos(twist) * arc
    moved_arc += r * np.radians(LEAN_DEG) * np.sin(np.pi / 2 * span) + _bumps(points)
    angle = moved_arc / r
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), moved_z]) - points


def _bumps(points: FloatArray) -> FloatArray:
    """Return the sum (k,) of Gaussian bumps at points (k, 3), a length along theta.

    Their centres are random in the bounding box of the points.
    """
    random = np.random.default_rng(SEED)
    low, high = points.min(axis=0), points.max(axis=0)
    total = np.zeros(len(points))
    for _ in range(BUMPS):
        centre = random.uniform(low, high)
        width, height = random.uniform(*WIDTH), random.uniform(-HEIGHT, HEIGHT)
        near = np.sum((points - centre) ** 2, axis=1) / width**2
        total += height * np.exp(-near)
    return total
