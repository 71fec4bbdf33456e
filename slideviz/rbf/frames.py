"""Frames: the coordinates the interpolation works in, and the distances between them.

Coordinates are Cartesian, or cylindrical ``(r, rho theta[, z])`` about an axis when periodicity
is rotational, with theta scaled by a constant reference radius rho so that all components are
lengths. Displacements are differences of coordinates.

Distances are computed from *features*, a few numbers for each node:

* Euclidean: the Cartesian position.
* Translational period lambda along u (thesis Eq. 2.13): ``(lambda/pi) sin(pi D/lambda)`` is the
  chord of a circle of circumference lambda, so the component s along u is replaced by
  ``lambda/(2 pi) (cos, sin)(2 pi s/lambda)`` and the distance is Euclidean again.
* Rotational period (Eq. 2.15): ``(r, sin(pi theta/theta_p), cos(pi theta/theta_p), z)``, z = 0 in
  2D. The distance is not Euclidean in these features: its square is
  ``(r - r')^2 + 2 r r' (1 - cos(theta_p/pi sin(pi (theta - theta')/theta_p))) + (z - z')^2``
  (``compiled.squared_distance``, which names the copies of this formula).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.axis_frame import along, axis_basis, in_axis_frame
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray
from slideviz.mesh.periodic import Pair
from slideviz.system.threads import PART, in_parts

ON_AXIS = 1e-9  # nodes nearer to the axis than this part of the reference radius stay on it

TILT = 0.02
"""A surface whose unit normal has a larger component along the axis fixes its nodes on the axis."""


def on_axis(frame: Frame, coords: FloatArray) -> BoolArray:
    """Return a mask (n,) of the nodes on the axis; none in a Cartesian frame."""
    if not frame.cylindrical:
        return np.zeros(len(coords), bool)
    return coords[:, 0] <= ON_AXIS * frame.radius


def corners(coords: FloatArray, facets: IntArray, axis: BoolArray) -> FloatArray:
    """Return the corners (f, k, d) of facets or segments (f, k), with angles for those on the axis.

    In the coordinates a facet with a node on the axis has no corner there, but all angles of its
    other nodes: a corner on the axis takes the angle of the node beside it, and a triangle with
    one corner on the axis is a quadrilateral.
    ``coords`` (n, d): in the frame.
    ``facets`` (f, k): k = 2, or 4, where a triangle repeats its last node.
    ``axis`` (n,) bool: nodes on the axis.
    """
    x = coords[facets]
    touching = axis[facets]
    for row in np.flatnonzero(touching.any(axis=1) & ~touching.all(axis=1)):
        x[row] = _corners_at_axis(x[row], touching[row], facets[row])
    return x


def _corners_at_axis(x: FloatArray, touching: BoolArray, nodes: IntArray) -> FloatArray:
    """Return the corners (k, d) of one facet; those on the axis get the angle of their neighbours.

    A triangle with one corner on the axis becomes a quadrilateral, which begins at the corner
    before and has that corner twice, with the angle of each neighbour; else it gets their mean.
    ``x`` (k, d), ``touching`` (k,) bool, ``nodes`` (k,): the facet's corners, which of them are on
    the axis, and its nodes.
    """
    width = len(nodes)
    size = 3 if width == 4 and nodes[2] == nodes[3] else width
    x = x[:size]
    touching = touching[:size]
    around = [(i - 1) % size for i in range(size)], [(i + 1) % size for i in range(size)]
    if size == 3 and touching.sum() == 1:
        i = touching.tolist().index(True)
        before = x[around[0][i]]
        after = x[around[1][i]]
        ends = np.stack([x[i], x[i]])
        ends[:, 1] = before[1], after[1]
        return np.stack([before, *ends, after])
    out = x.copy()
    for i in np.flatnonzero(touching).tolist():
        beside = [k for k in (around[0][i], around[1][i]) if not touching[k]]
        out[i, 1] = np.mean(x[beside or np.flatnonzero(~touching), 1])
    return out[[0, 1, 2, 2]] if size == 3 else out


def hold_on_axis(
    nodes: IntArray, normals: FloatArray, axis: BoolArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the constraints with those of nodes on the axis replaced, so that they move along it.

    Returns ``nodes, normals`` (p,), (p, d): the constraints; those of nodes on the axis are the
    last rows; ``fixed`` (h,): nodes on the axis that cannot move along it either (`TILT`; in 2D all
    of them).
    ``nodes`` (q,), ``normals`` (q, d): constraints of sliding nodes, rows of one node together.
    """
    there = axis[nodes]
    if not there.any():
        return nodes, normals, NO_NODES
    d = normals.shape[1]
    found = np.unique(nodes[there])
    tilted = np.unique(nodes[there][np.abs(normals[there, -1]) > TILT]) if d == 3 else found
    rows = [np.repeat(found, 2), tilted] if d == 3 else [np.repeat(found, 2)]
    directions = [np.tile(np.eye(d)[:2], (len(found), 1))]
    if d == 3:
        directions.append(np.tile(np.eye(d)[2], (len(tilted), 1)))
    out = np.concatenate([nodes[~there], *rows])
    return out, np.concatenate([normals[~there], *directions]), tilted


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
    cos = local[:, 0] * inverse
    sin = local[:, 1] * inverse
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
        cos = np.cos(angle)[:, None]
        sin = np.sin(angle)[:, None]
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
        out[:, 1, 1] = rate * np.cos(phase)
        out[:, 2, 1] = -rate * np.sin(phase)
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


SECTORS = 1 << 12
"""Number of sectors into which the circle is divided to find the largest one without nodes."""


@record
class Frame:
    """The coordinates and the distance of the interpolation, and the maps from and to points."""

    dim: int  # 2 or 3
    direction: FloatArray | None = None
    """(d,): unit vector of a translational period; None: there is none."""
    period: float = 0.0  # Translational: length. Rotational: angle in radians. 0: not periodic.
    axis: FloatArray | None = None
    origin: FloatArray | None = None  # `axis`, `origin` (3,): set for a cylindrical frame
    theta0: float = 0.0  # angle from which theta is counted, opposite the largest empty sector
    radius: float = 1.0  # the reference radius rho, which turns angles into lengths

    @property
    def cylindrical(self) -> bool:
        """Return whether the coordinates are (r, rho theta[, z])."""
        return self.axis is not None

    def coords(self, points: FloatArray) -> FloatArray:
        """Return coordinates (n, d) of Cartesian points (n, d)."""
        if self.axis is None or self.origin is None:
            return np.array(points, float)
        return self.of_polar(polar(points, self.axis, self.origin))

    def of_polar(self, polar: FloatArray) -> FloatArray:
        """Turn `polar` coordinates (n, d) into those of a cylindrical frame, in place."""

        def turn(part: slice) -> None:
            angle = polar[part, 1] - self.theta0
            angle = np.mod(angle + np.pi, 2 * np.pi) - np.pi
            # Theta means nothing on the axis: take the middle.
            angle[polar[part, 0] <= 1e-9 * self.radius] = 0.0
            polar[part, 1] = self.radius * angle

        in_parts(turn, len(polar))
        return polar

    def points(self, coords: FloatArray) -> FloatArray:
        """Return Cartesian points (n, d) of coordinates (n, d)."""
        if self.axis is None or self.origin is None:
            return np.array(coords, float)
        out = np.empty((len(coords), self.dim))

        def fill(part: slice) -> None:
            out[part] = self._cartesian(coords[part])

        in_parts(fill, len(coords))
        return out

    def _cartesian(self, coords: FloatArray) -> FloatArray:
        assert self.axis is not None
        assert self.origin is not None
        angle = coords[:, 1] / self.radius + self.theta0
        local = np.zeros((len(coords), 3))
        local[:, 0] = coords[:, 0] * np.cos(angle)
        local[:, 1] = coords[:, 0] * np.sin(angle)
        if self.dim == 3:
            local[:, 2] = coords[:, 2]
        return (along(axis_basis(self.axis).T, local) + self.origin)[:, : self.dim]

    def difference(self, points: FloatArray, vectors: FloatArray) -> FloatArray:
        """Return Cartesian displacements (n, d) of points (n, d) as frame components (n, d)."""
        if not self.cylindrical:
            return np.array(vectors, float)
        step = self.coords(points + vectors) - self.coords(points)
        turn = 2 * np.pi * self.radius
        step[:, 1] -= turn * np.round(step[:, 1] / turn)
        step[np.all(vectors == 0, axis=1)] = 0.0
        return step

    def turned_back(self, coords: FloatArray, vectors: FloatArray) -> FloatArray:
        """Return Cartesian vectors (n, d) of nodes turned about the axis to one angle.

        Equal vectors of periodic images, one period apart, become equal. Lengths, and angles
        between vectors of one node, are kept.
        """
        if self.axis is None:
            return np.array(vectors, float)
        local = in_axis_frame(vectors, self.axis)
        angle = coords[:, 1] / self.radius + self.theta0
        cos = np.cos(angle)
        sin = np.sin(angle)
        radial = cos * local[:, 0] + sin * local[:, 1]
        local[:, 1] = cos * local[:, 1] - sin * local[:, 0]
        local[:, 0] = radial
        return local[:, : self.dim]

    def features(self, coords: FloatArray) -> FloatArray:
        """Return the features (k, n) of nodes at ``coords`` (n, d), rows contiguous."""
        out = np.empty((len(self._features(coords[:1])), len(coords)))

        def fill(part: slice) -> None:
            out[:, part] = self._features(coords[part])

        in_parts(fill, len(coords))
        return out

    def _features(self, coords: FloatArray) -> FloatArray:
        if self.cylindrical and self.period:
            phase = np.pi / self.period * coords[:, 1] / self.radius
            rows = [coords[:, 0], np.sin(phase), np.cos(phase)]
            rows.append(coords[:, 2] if self.dim == 3 else np.zeros(len(coords)))
            return np.stack(rows)
        x = self.points(coords)
        if self.direction is None:
            return x.T
        angle = 2 * np.pi / self.period * along(self.direction[None], x)[:, 0]
        size = self.period / (2 * np.pi)
        rows = [size * np.cos(angle), size * np.sin(angle)]
        rows.extend(along(_perpendicular(self.direction), x).T)
        return np.stack(rows)

    def turns(self, periods: IntArray | FloatArray) -> FloatArray:
        """Return the rotations (m, d, d) of Cartesian vectors about the axis by periods (m,)."""
        out = np.tile(np.eye(3), (len(periods), 1, 1))
        some = np.flatnonzero(periods)
        if self.axis is not None and len(some):
            angle = periods[some] * self.period
            out[some, 0, 0] = out[some, 1, 1] = np.cos(angle)
            out[some, 1, 0] = np.sin(angle)
            out[some, 0, 1] = -out[some, 1, 0]
            basis = axis_basis(self.axis)
            out[some] = basis.T @ out[some] @ basis
        return out[:, : self.dim, : self.dim]

    def shift(self) -> FloatArray:
        """Return one period as a difference of coordinates, (d,); zero when not periodic."""
        if self.direction is not None:
            return self.period * self.direction
        step = np.zeros(self.dim)
        if self.cylindrical:
            step[1] = self.period * self.radius
        return step


def _perpendicular(direction: FloatArray) -> FloatArray:
    if len(direction) == 2:
        return np.array([[-direction[1], direction[0]]])
    return axis_basis(direction)[:2]


def polar(points: FloatArray, axis: FloatArray, origin: FloatArray) -> FloatArray:
    """Return (r, theta[, z]) about an axis, (n, d), of Cartesian points (n, d)."""
    out = np.empty(points.shape)

    def fill(part: slice) -> None:
        local = in_axis_frame(points[part], axis, origin)
        out[part, 0] = np.hypot(local[:, 0], local[:, 1])
        out[part, 1] = np.arctan2(local[:, 1], local[:, 0])
        if points.shape[1] == 3:
            out[part, 2] = local[:, 2]

    in_parts(fill, len(points))
    return out


def make_frame(
    points: FloatArray, pairs: Sequence[Pair], *, periodic_distance: bool
) -> tuple[Frame, FloatArray]:
    """Return the frame that periodic pairs ask for, and the coordinates (n, d) in it.

    ``points`` (n, d): the undeformed mesh.
    ``pairs``: the periodic pairs; all have one period. Empty: not periodic.
    ``periodic_distance``: false keeps the frame of the pairs but with the plain distance
    (PERIODIC_MODE= none).
    """
    dim = points.shape[1]
    if pairs and pairs[0].kind == "translational":
        length = pairs[0].period
        direction = pairs[0].vector / length
        frame = Frame(dim, direction, length) if periodic_distance else Frame(dim)
        return frame, frame.coords(points)
    if not pairs:
        return Frame(dim), Frame(dim).coords(points)
    axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.asarray(pairs[0].axis, float)
    origin = np.asarray(pairs[0].origin, float)
    found = polar(points, axis, origin)
    frame = Frame(
        dim,
        period=pairs[0].period if periodic_distance else 0.0,
        axis=axis,
        origin=origin,
        theta0=_middle_angle(*found[:, :2].T),
        # The largest radius, so that no error of an angle is longer than its frame component.
        radius=float(found[:, 0].max()),
    )
    return frame, frame.of_polar(found)


def _middle_angle(radii: FloatArray, angles: FloatArray) -> float:
    """Return the angle, in radians, opposite the middle of the largest sector without nodes.

    Nodes on the axis do not count. The lowest and highest angle in each of `SECTORS` narrow
    sectors suffice, for the largest gap is between two of these unless it is narrower than two
    sectors.
    """
    least = 1e-9 * radii.max()
    parts = -(-len(radii) // PART)
    lows = np.full((parts, SECTORS), np.inf)
    highs = np.full((parts, SECTORS), -np.inf)

    def look(part: slice) -> None:
        some = angles[part][radii[part] > least]
        row = part.start // PART
        sector = np.clip((some + np.pi) * (SECTORS / (2 * np.pi)), 0, SECTORS - 1).astype(np.intp)
        np.minimum.at(lows[row], sector, some)
        np.maximum.at(highs[row], sector, some)

    in_parts(look, len(radii))
    low = lows.min(axis=0)
    high = highs.max(axis=0)
    ordered = np.stack([low, high], axis=1)[low <= high].ravel()
    gaps = _gaps(ordered)
    if gaps.max() <= 4 * np.pi / SECTORS:
        ordered = np.sort(angles[radii > least])
        gaps = _gaps(ordered)
    widest = int(np.argmax(gaps))
    return float(ordered[widest] + gaps[widest] / 2 + np.pi)


def _gaps(ordered: FloatArray) -> FloatArray:
    """Return the gap (k,) from each of ascending angles (k,) to the next around the circle."""
    return np.diff(np.r_[ordered, ordered[0] + 2 * np.pi])
