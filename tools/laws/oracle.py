"""Where nodes must be, by the plainest means: motions, periods, and distances from surfaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.case.model import Case, FromFile, Motion, Radial, Rotate, Scale
from slideviz.mesh.model import FloatArray, IntArray, Marker, Mesh
from slideviz.mesh.periodic import axis_basis
from tools.laws.meshes import Period


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
    assert not isinstance(motion, FromFile)
    if not isinstance(motion, Rotate | Scale | Radial):
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
    for side in sides:
        ends = [(0, 1)] if len(side) == 2 else [(0, 1), (1, 2), (2, 0)]
        for a, b in ends:
            best = np.minimum(best, _from_segment(x, side[a], side[b]))
        if len(side) == 3:
            best = np.minimum(best, _above(x, side))
    return best


def _from_segment(x: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    t = b - a
    square = float(t @ t)
    part = np.clip((x - a) @ t / square, 0.0, 1.0) if square > 0 else np.zeros(len(x))
    return np.linalg.norm(x - a - part[:, None] * t, axis=1)


def _above(x: FloatArray, side: FloatArray) -> FloatArray:
    """Return the height over a triangle, infinite beside it."""
    a, b, c = side
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal)
    if length == 0:
        return np.full(len(x), np.inf)
    normal = normal / length
    inside = np.ones(len(x), bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (x - p) @ np.cross(normal, q - p) >= 0
    return np.where(inside, np.abs((x - a) @ normal), np.inf)


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
