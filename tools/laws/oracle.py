"""Where nodes must be, by the plainest means: motions, periods, and distances from surfaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.case.model import Case
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.model import FloatArray, IntArray, Marker, Mesh
from tools.laws.draw import Period


def carried(period: Period, points: FloatArray) -> FloatArray:
    """Return the images (k, d) of points one period further."""
    if not period.angle_deg:
        return points + period.vector
    arm = _padded(points) - np.array(period.origin)
    turned = arm @ rotation(period.axis, period.angle_deg).T + np.array(period.origin)
    return turned[:, : points.shape[1]]


def rotation(axis: Sequence[float], angle_deg: float) -> FloatArray:
    """Return the matrix (3, 3) of a rotation."""
    basis = axis_basis(axis)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return basis.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ basis


def _padded(points: FloatArray) -> FloatArray:
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def goals(case: Case, mesh: Mesh) -> dict[int, FloatArray]:
    """Return where each moving node must be in the end, motion by motion."""
    found: dict[int, FloatArray] = {}
    for name in case.markers_with("moving"):
        nodes = mesh.marker(name).nodes
        x = mesh.points[nodes]
        for motion in case.motions:
            if motion.marker in ("", name):
                x = _moved(motion, x)
        found |= dict(zip(nodes.tolist(), x, strict=True))
    return found


def _moved(motion: Motion, x: FloatArray) -> FloatArray:
    dim = x.shape[1]
    assert isinstance(motion, Translate | Rotate | Scale | Radial), "a formula is missing here"
    if isinstance(motion, Translate):
        return x + np.array(motion.vector)
    centre = x.mean(axis=0) if motion.point == "centroid" else np.array(motion.point[:dim])
    arm = x - centre
    if isinstance(motion, Scale):
        return centre + arm * np.array(motion.factors)
    if isinstance(motion, Rotate):
        return centre + (_padded(arm) @ rotation(motion.axis, motion.angle_deg).T)[:, :dim]
    unit = np.array(motion.axis) / np.linalg.norm(motion.axis)
    along = (_padded(arm) @ unit)[:, None] * unit if dim == 3 else np.zeros((len(x), 3))
    out = arm - along[:, :dim]
    length = np.linalg.norm(out, axis=1, keepdims=True)
    push = motion.factor * length + motion.distance * (length > 0)
    return x + out * (push / np.where(length > 0, length, 1.0) - (length > 0))


CHUNK = 256
"""Simplices that all points are held against at once."""


class Frame:
    """The coordinates in which surfaces are taken: Cartesian, or (r, rho theta[, z])."""

    def __init__(self, mesh: Mesh, period: Period | None) -> None:
        self._about = period if period is not None and period.angle_deg else None
        self._dim, self.turn = mesh.dim, np.zeros(mesh.dim)
        self._middle, self._rho = 0.0, 1.0
        if self._about is None:
            return
        local = self._local(mesh.points)
        far = np.hypot(local[:, 0], local[:, 1])
        self._rho = float(far.max())
        # All angles lie within half a turn of that of the mean of the nodes.
        mean = (local[:, :2] / np.maximum(far, 1e-12 * self._rho)[:, None]).sum(axis=0)
        self._middle = float(np.arctan2(mean[1], mean[0]))
        self.turn[1] = self._rho * np.radians(self._about.angle_deg)

    def _local(self, points: FloatArray) -> FloatArray:
        assert self._about is not None
        return (_padded(points) - np.array(self._about.origin)) @ axis_basis(self._about.axis).T

    def coords(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (n, d) of points."""
        if self._about is None:
            return points
        local = self._local(points)
        angle = np.arctan2(local[:, 1], local[:, 0]) - self._middle
        angle = np.mod(angle + np.pi, 2 * np.pi) - np.pi
        columns = [np.hypot(local[:, 0], local[:, 1]), self._rho * angle, local[:, 2]]
        return np.stack(columns[: self._dim], axis=1)

    def way(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return how far points (n, d) go in these coordinates, by less than half a turn."""
        step = self.coords(after) - self.coords(before)
        if self._about is not None:
            turn = 2 * np.pi * self._rho
            step[:, 1] -= turn * np.round(step[:, 1] / turn)
        return step

    def on_axis(self, coords: FloatArray) -> np.ndarray:
        """Tell which coordinates (n, d) are on the axis, where the angle means nothing."""
        none = np.zeros(len(coords), bool)
        return none if self._about is None else coords[:, 0] < 1e-9 * self._rho

    def opened(self, sides: FloatArray) -> FloatArray:
        """Return segments (s, 2, 2) with ends on the axis at the angle of their other end."""
        if self._about is None or self._dim == 3:
            return sides
        out = sides.copy()
        for end in (0, 1):
            there = self.on_axis(sides[:, end])
            out[there, end, 1] = sides[there, 1 - end, 1]
        return out


def simplices(mesh: Mesh, markers: Sequence[Marker], coords: FloatArray) -> FloatArray:
    """Return the segments or triangles (s, d, d) of markers.

    A quadrilateral gives those of both its diagonals: which one a surface bends along is free.
    """
    cuts = {3: ((0, 1),), 5: ((0, 1, 2),), 9: ((0, 1, 2), (0, 2, 3), (1, 2, 3), (1, 3, 0))}
    found = [np.empty((0, mesh.dim, mesh.dim))]
    for marker in markers:
        for vtk, (_, nodes) in marker.cells.by_type.items():
            found += [coords[nodes[:, list(cut)]] for cut in cuts[vtk]]
    return np.concatenate(found)


def distance(x: FloatArray, sides: FloatArray) -> FloatArray:
    """Return how far points (m, d) are from the nearest simplex (s, d, d), (m,)."""
    best = np.full(len(x), np.inf)
    for start in range(0, len(sides), CHUNK):
        part = sides[start : start + CHUNK]
        corners = part.shape[1]
        for k in range(corners if corners == 3 else 1):
            gap = _from_segments(x, part[:, k], part[:, (k + 1) % corners])
            best = np.minimum(best, gap.min(axis=1))
        if corners == 3:
            best = np.minimum(best, _above(x, part).min(axis=1))
    return best


def _from_segments(x: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances (m, s) of points from segments."""
    t = b - a
    square = np.maximum((t * t).sum(axis=1), 1e-300)
    arm = x[:, None] - a
    part = np.clip((arm * t).sum(axis=2) / square, 0.0, 1.0)
    return np.linalg.norm(arm - part[:, :, None] * t, axis=2)


def _above(x: FloatArray, sides: FloatArray) -> FloatArray:
    """Return the heights (m, s) of points over triangles, infinite beside them."""
    foot, normal = sides[:, 0], np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.where(length > 0, length, 1.0)
    inside = np.broadcast_to(length[:, 0] > 0, (len(x), len(sides))).copy()
    for k in range(3):
        a, b = sides[:, k], sides[:, (k + 1) % 3]
        inside &= ((x[:, None] - a) * np.cross(normal, b - a)).sum(axis=2) >= 0
    height = np.abs(((x[:, None] - foot) * normal).sum(axis=2))
    return np.where(inside, height, np.inf)


def planes(sides: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a point and the unit normal (s, d) of each simplex."""
    if sides.shape[1] == 2:
        t = sides[:, 1] - sides[:, 0]
        normal = np.stack([t[:, 1], -t[:, 0]], axis=1)
    else:
        normal = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    good = length[:, 0] > 0
    return sides[good, 0], normal[good] / length[good]


def nodes_with(case: Case, mesh: Mesh, *roles: str) -> IntArray:
    """Return the nodes of the markers that have one of these roles; none given is fixed."""
    found = [m.nodes for m in mesh.markers if case.roles.get(m.name, "fixed") in roles]
    return np.unique(np.concatenate([np.empty(0, np.int64), *found]))
