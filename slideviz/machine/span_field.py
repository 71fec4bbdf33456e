"""Normalised span between two boundaries, and the curves of constant span in the meridional plane.

Coordinates (n, 3) are meridional: ``(z, r, theta)`` about an axis, theta in radians. The span of a
point is ``s = d_H / (d_H + d_S)``, with its distances to hub and shroud: 0 at the hub, 1 at the
shroud. It needs no direction of the flow, so axial, mixed and radial passages are alike. On a
curve of constant span, m is the arc length, and ``dm' = dm / r``: the plane of (m', theta) keeps
angles, and blade sections are designed in it.

    field = find_span(mesh, "HUB", "SHROUD", axis, origin, period)
    coords = field.meridional(points)       # (z, r, theta)
    s, slopes = field.span(coords)          # span, and its derivative by (z, r, theta)
    curves = SpanCurves(field, start)       # start: z and r where m' and m are 0 (at its span)
    plane = curves.plane(coords)            # (m', theta, s): laid flat
    m = curves.length(plane)                # the arc length m
    coords = curves.coords(plane)           # and back, exactly onto the span
    points = field.points(coords)

m grows along the axis where the hub is within the shroud, and outwards at the exit of a radial
compressor. Distances to walls that are surfaces of revolution are those to their profile in the
meridional plane, so the hole that a blade leaves in a wall does not matter. Other walls (contoured
along theta) count as they are, in (z, r, rho theta), with their images one period before and after;
a hole in them is closed by triangles between the nodes of its rim.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.machine.span import Curves, Distances, Span, facets_of
from slideviz.machine.wall import closed_wall, turn_about_axis, wall_profile
from slideviz.mesh.axis_frame import Triple, along, axis_basis, in_axis_frame
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, Mesh, row_norms
from slideviz.mesh.periodic import Pair
from slideviz.mesh.topology import unit
from slideviz.rbf.closest import ClosestPoints
from slideviz.system.weak_cache import weak_cache

NEAR = 1e-7  # part of the distance between the walls, within which a wall's own normal counts
FACING = 0.3  # least cosine between the directions from hub to shroud at both walls
AMID = 0.25  # curves begin at a node whose span is so near to the middle
CUBIC = 3  # the degree of the splines between traced curves, which need one place more
SPANS = 33  # curves that `SpanCurves` traces
STEPS = 64
MOST_STEPS = 512
"""Steps of a curve along the extent of the walls, and most steps in each direction."""
BEND = 0.5  # largest sine of the angle between a wall's normal and the way to it, before its rim
NEWTON = 12
EXACT = 1e-15
OFF = 1e-9
"""Most Newton steps to a span, its error that needs no further one, and its largest error."""
ON_AXIS = 1e-9  # a point nearer to the axis, as a part of the largest radius, has no theta

WHOLE = 2.0 * np.pi  # the period of a mesh that repeats by no rotation


@record
class SpanField(Span):
    """The normalised span between two walls, and meridional coordinates about the axis."""

    axis: Triple
    origin: Triple
    middle: float  # theta that is farthest from where its branch ends
    radius: float  # the largest one of the walls
    walls: tuple[ClosestPoints, ClosestPoints]
    """Hub and shroud: segments in (z, r), or triangles in (z, r, radius theta)."""
    holes: IntArray  # (t, 4): nodes of triangles that close holes of walls contoured along theta
    start: tuple[float, float] = (0.0, 0.0)  # z and r of a node in the middle between the walls

    words = ("z", "r")

    @cached_property
    def curves(self) -> SpanCurves:
        """Return curves of constant span that begin in the middle of the passage.

        Raises MeshError as `SpanCurves` does.
        """
        return SpanCurves(self, self.start)

    @property
    def first_coords(self) -> FloatArray:
        return np.array([[*self.start, self.middle]])

    def curves_through(self, start: FloatArray) -> SpanCurves:
        return SpanCurves(self, start)

    @property
    def revolved(self) -> bool:
        """Return whether both walls are surfaces of revolution, so that theta does not matter."""
        return self.walls[0].corners.shape[2] == 2

    def meridional(self, points: FloatArray) -> FloatArray:
        """Return (z, r, theta), (n, 3), of points (n, 3)."""
        return _meridional(points, self.axis, self.origin, self.middle)

    def points(self, coords: FloatArray) -> FloatArray:
        """Return the points (n, 3) of meridional coordinates (n, 3)."""
        z, r, theta = coords.T
        local = np.stack([r * np.cos(theta), r * np.sin(theta), z], axis=1)
        return along(axis_basis(self.axis).T, local) + np.asarray(self.origin)

    def slopes(self, coords: FloatArray) -> FloatArray:
        """Return the derivative (n, 3, 3) of `points` by the coordinates (n, 3)."""
        _, r, theta = coords.T
        cos = np.cos(theta)
        sin = np.sin(theta)
        e = axis_basis(self.axis)
        out = np.empty((len(coords), 3, 3))
        out[:, :, 0] = e[2]
        out[:, :, 1] = cos[:, None] * e[0] + sin[:, None] * e[1]
        out[:, :, 2] = (r * cos)[:, None] * e[1] - (r * sin)[:, None] * e[0]
        return out

    def girth(self, coords: FloatArray) -> FloatArray:
        return coords[:, 1]

    def branch(self, coords: FloatArray) -> FloatArray:
        turns = np.round((coords[:, 2] - self.middle) / (2.0 * np.pi))
        return coords - np.outer(2.0 * np.pi * turns, (0.0, 0.0, 1.0))

    def shift(self, pair: Pair) -> float:
        return pair.angle

    @cached_property
    def level_scale(self) -> float:
        if self.revolved:
            return 1.0
        least = min(float(wall.corners[..., 1].min()) for wall in self.walls)
        return max(least, 1e-3 * self.radius) / self.radius

    def begin(self, spans: FloatArray) -> FloatArray:
        ends = []
        for wall in self.walls:
            coords = np.unique(wall.corners[..., :2].reshape(-1, 2), axis=0)
            coords = np.column_stack([coords, np.full(len(coords), self.middle)])
            ends.append(coords[np.argmin(self.curves.plane(coords)[:, 0])])
        return np.outer(1.0 - spans, ends[0]) + np.outer(spans, ends[1])

    def distances(self, coords: FloatArray) -> list[Distances]:
        x = coords[:, : self.walls[0].corners.shape[2]].copy()
        x[:, 2:] *= self.radius
        hub, at_hub = self.walls[0].nearest(x)
        shroud, at_shroud = self.walls[1].nearest(x)
        across = shroud - hub
        ends = (hub, at_hub, across), (shroud, at_shroud, -across)
        return [
            _signed(x, place, wall.simplices(which), into)
            for wall, (place, which, into) in zip(self.walls, ends, strict=True)
        ]


def _signed(x: FloatArray, place: FloatArray, corners: FloatArray, into: FloatArray) -> Distances:
    """Return distance, slope and obliqueness of points x (n, d) whose closest ones are ``place``.

    ``corners`` (n, c, d): what they are on; ``into`` (n, d): from there to the other wall.
    """
    edges = corners[:, 1:] - corners[:, :1]
    if x.shape[1] == 2:
        normal = unit(np.stack([-edges[:, 0, 1], edges[:, 0, 0]], axis=1))
    else:
        normal = unit(np.cross(edges[:, 0], edges[:, 1]))
    normal[np.sum(normal * into, axis=1) < 0.0] *= -1.0
    gap = x - place
    size = row_norms(gap)
    inside = np.where(np.sum(gap * into, axis=1) < 0.0, -1.0, 1.0)
    near = size <= NEAR * row_norms(into)
    way = gap * (inside / np.where(size > 0.0, size, 1.0))[:, None]
    cosine = np.abs(np.sum(way * normal, axis=1))
    oblique = np.where(near, 0.0, np.sqrt(np.maximum(1.0 - cosine**2, 0.0)))
    distance = np.where(near, np.sum(gap * normal, axis=1), inside * size)
    return distance, np.where(near[:, None], normal, way), oblique


def _meridional(
    points: FloatArray, axis: Sequence[float], origin: Sequence[float], middle: float
) -> FloatArray:
    x, y, z = in_axis_frame(points, axis, origin).T
    theta = np.arctan2(y, x) - middle
    theta -= 2.0 * np.pi * np.round(theta / (2.0 * np.pi))
    return np.stack([z, np.hypot(x, y), theta + middle], axis=1)


@weak_cache
def find_span(
    mesh: Mesh,
    hub: str,
    shroud: str,
    axis: Triple,
    origin: Triple,
    period: float = WHOLE,
) -> SpanField:
    """Return the span between two boundaries of a 3D mesh, whose passages repeat by ``period``.

    Cached as long as the mesh lives. Raises MeshError if the mesh is 2D, a boundary is unknown or
    empty, both are one, or they do not face each other.
    """
    field = _span_between(mesh, hub, shroud, axis, origin, period)
    coords = field.meridional(mesh.points[mesh.cells.nodes[:: 1 + len(mesh.points) // 20_000]])
    amid = coords[np.abs(field.span(coords)[0] - 0.5) <= AMID]
    coords = amid if len(amid) else coords
    off = row_norms(coords[:, :2] - np.median(coords[:, :2], axis=0))
    z, r, _ = coords[int(np.argmin(off))].tolist()
    return replace(field, start=(z, r))


def _span_between(
    mesh: Mesh,
    hub: str,
    shroud: str,
    axis: Triple,
    origin: Triple,
    period: float,
) -> SpanField:
    if mesh.dim != 3:
        raise MeshError(f"{mesh.name}: the span between two boundaries needs a mesh in 3D")
    facets = [facets_of(mesh, name) for name in (hub, shroud)]
    nodes = np.unique(np.concatenate([table.ravel() for table in facets]))
    local = in_axis_frame(mesh.points[nodes], axis, origin)
    tables = [np.searchsorted(nodes, table) for table in facets]
    if not period < WHOLE and not turn_about_axis(local, tables):
        raise MeshError(
            f"{mesh.name}: {hub!r} and {shroud!r} do not turn about the axis "
            f"{tuple(axis)} through {tuple(origin)}, and a span needs an axis; correct "
            "PERIODIC_AXIS and PERIODIC_ORIGIN, name the periodic sides of a passage, or give the "
            "direction of a straight span by SPAN_AXIS, e.g. SPAN_AXIS= y"
        )
    x, y, _ = local.T
    middle = float(np.arctan2(y.sum(), x.sum()))
    radius = float(np.hypot(x, y).max())
    coords = _meridional(mesh.points, axis, origin, middle) * (1.0, 1.0, radius)
    profiles = [wall_profile(coords, table) for table in facets]
    if all(profile is not None for profile in profiles):
        walls = [ClosestPoints(profile) for profile in profiles if profile is not None]
        holes = facets[0][:0]
    else:
        closed = [closed_wall(coords, table, radius, period) for table in facets]
        walls = [wall for wall, _ in closed]
        holes = np.concatenate([hole for _, hole in closed])
    field = SpanField(axis, origin, middle, radius, (walls[0], walls[1]), holes)
    if hub == shroud or not _face(field, coords[nodes] / (1.0, 1.0, radius)):
        raise MeshError(
            f"{mesh.name}: the boundaries {hub!r} and {shroud!r} do not face each other, so there "
            "is no span between them; name hub and shroud in SPAN"
        )
    return field


def _face(field: SpanField, coords: FloatArray) -> bool:
    """Return whether the walls face each other, judged at their nodes (n, 3)."""
    (hub, to_hub, _), (shroud, to_shroud, _) = field.distances(coords)
    opposite = -np.sum(to_hub * to_shroud, axis=1)
    apart = np.median(np.maximum(hub, shroud)) > 0.0
    return bool(apart and np.median(opposite) > FACING)


class SpanCurves(Curves):
    """Curves of constant span in the meridional plane: the maps to (m', theta, span) and back.

    m' and m are 0 on the line from hub to shroud through ``start`` that is normal to the curves.
    Curves are traced by Runge-Kutta steps of equal m' with Newton steps back onto the span, all
    spans at once; a spline between them has z and r. `coords` corrects these, normal to the curve,
    until the span is exact. Beyond the rims of the walls curves go on straight.
    """

    def __init__(self, field: SpanField, start: Sequence[float] | FloatArray) -> None:
        """Trace the curves; ``start``: z and r of a point between the walls.

        Raises MeshError if it is not between them, or on the axis.
        """
        # Late: scipy.interpolate takes 0.3 s.
        from scipy.interpolate import RectBivariateSpline

        self.field = field
        corners = np.concatenate([wall.corners[..., :2].reshape(-1, 2) for wall in field.walls])
        self._size = float(np.linalg.norm(np.ptp(corners, axis=0)))
        self._theta = field.middle if field.revolved else _clear_angle(field, corners)
        spans = np.linspace(0.0, 1.0, SPANS)
        seeds = self._seeds(np.asarray(start, float), spans)
        step = self._size / (STEPS * float(seeds[:, 1].mean()))
        before = self._trace(seeds, spans, -step)
        after = self._trace(seeds, spans, step)
        table = np.concatenate([before[:0:-1], after])  # (steps, spans, 3): z, r and m
        if len(table) <= CUBIC:
            z, r = np.asarray(start, float)
            raise MeshError(
                f"curves of constant span cannot be traced from z = {z:.6g}, r = {r:.6g}: the axis "
                f"is too near for walls of an extent of {self._size:.6g}; correct PERIODIC_AXIS "
                "and PERIODIC_ORIGIN"
            )
        self.m_prime = step * np.arange(1 - len(before), len(after))
        """(k,): where the curves were traced; they go on straight beyond."""
        self._splines = [
            RectBivariateSpline(spans, self.m_prime, table[..., k].T) for k in range(3)
        ]
        self._places = table[..., :2].reshape(-1, 2)

    def plane(self, coords: FloatArray) -> FloatArray:
        """Return (m', theta, span), (n, 3), of meridional coordinates (n, 3).

        Raises MeshError for a point on the axis.
        """
        # Late: scipy.spatial takes 0.1 s.
        from scipy.spatial import cKDTree

        on_axis = np.flatnonzero(coords[:, 1] <= ON_AXIS * self.field.radius)
        if len(on_axis):
            z = coords[on_axis[0], 0]
            raise MeshError(
                f"a point at z = {z:.6g} is on the axis, where no section can be laid flat"
            )
        span = self.field.span(coords)[0]
        column = cKDTree(self._places).query(coords[:, :2])[1] // SPANS
        m_prime = self.m_prime[column]
        for _ in range(8):  # the foot of the point on its curve
            place = self._at(span, m_prime, 0)
            speed = self._at(span, m_prime, 1)
            bend = self._at(span, m_prime, 2)
            gap = coords[:, :2] - place
            slope = np.sum(gap * bend - speed**2, axis=1)
            ahead = np.sum(gap * speed, axis=1)
            m_prime = m_prime - ahead / np.where(slope < 0.0, slope, -np.sum(speed**2, axis=1))
        return np.stack([m_prime, coords[:, 2], span], axis=1)

    def length(self, plane: FloatArray) -> FloatArray:
        """Return the arc length m (n,) at (m', theta, span), (n, 3)."""
        return self._value(plane[:, 2], plane[:, 0], 2, 0)

    def at_length(self, m: FloatArray, span: FloatArray) -> FloatArray:
        """Return m' (n,) at arc lengths m (n,) of the curves at spans (n,)."""
        m_prime = m / np.maximum(self._at(span, np.zeros(len(m)), 0)[:, 1], ON_AXIS)
        for _ in range(NEWTON):
            gap = m - self._value(span, m_prime, 2, 0)
            m_prime = m_prime + gap / self.growth(m_prime, span)
        return m_prime

    def traced(self, plane: FloatArray) -> FloatArray:
        """Return z and r (n, 2) of (m', theta, span), (n, 3), on the spline: beyond walls, too."""
        return self._at(plane[:, 2], plane[:, 0], 0)

    def growth(self, m_prime: FloatArray, span: FloatArray) -> FloatArray:
        """Return the derivative dm / dm' (n,) at m' of the curves at spans (n,)."""
        return self._value(span, m_prime, 2, 1)

    def coords_and_slopes(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return meridional coordinates (n, 3), and their derivatives (n, 3, 2) by (m', theta).

        Span does not change; the derivatives are exact but where a wall's facets meet.
        """
        m_prime, theta, span = plane.T
        place = self._at(span, m_prime, 0)
        speed = self._at(span, m_prime, 1)
        bend = self._at(span, m_prime, 2)
        size = row_norms(speed)
        normal = np.stack([-speed[:, 1], speed[:, 0]], axis=1) / size[:, None]
        out = np.column_stack([place, theta])
        off = np.zeros(len(plane))
        for _ in range(NEWTON):
            value, slope = self.field.span(out)
            across = np.sum(slope[:, :2] * normal, axis=1)
            # Each point by itself: what others need must not move it by rounding.
            gap = np.where(np.abs(value - span) <= EXACT, 0.0, value - span)
            if not gap.any():
                break
            off -= gap / np.where(np.abs(across) > 0.0, across, 1.0)
            out[:, :2] = place + off[:, None] * normal
        lost = np.flatnonzero(~(np.abs(value - span) <= OFF))
        if len(lost):
            z, r = place[lost[0]]
            raise MeshError(
                f"there is no span of {span[lost[0]]:.6g} at z = {z:.6g}, r = {r:.6g}, "
                f"theta = {np.degrees(theta[lost[0]]):.6g} degrees: the walls end before; move "
                "the blade less"
            )
        # By m': the normal turns against the speed as the curve bends to its side.
        by = np.zeros((len(plane), 3, 2))
        by[:, :2, 0] = speed * (1.0 - off * np.sum(normal * bend, axis=1) / size**2)[:, None]
        by[:, 2, 1] = 1.0
        change = np.einsum("ni,nik->nk", slope, by) / across[:, None]
        by[:, :2] -= normal[:, :, None] * change[:, None, :]
        return out, by

    def _at(self, span: FloatArray, m_prime: Any, order: int) -> FloatArray:
        """Return z and r (n, 2) of the curves, or a derivative of an order by m'."""
        return np.stack([self._value(span, m_prime, k, order) for k in range(2)], axis=1)

    def _value(self, span: FloatArray, m_prime: FloatArray, k: int, order: int) -> FloatArray:
        """Return z, r or m (n,) for k = 0, 1, 2, or a derivative by m'; linear beyond the ends."""
        inside = np.clip(m_prime, self.m_prime[0], self.m_prime[-1])
        spline = self._splines[k]
        s = np.clip(span, 0.0, 1.0)
        value = spline.ev(s, inside, dy=order)
        beyond = m_prime - inside
        if order == 0:
            value = value + beyond * spline.ev(s, inside, dy=1)
        return np.where(beyond != 0.0, 0.0, value) if order > 1 else value

    def _seeds(self, start: FloatArray, spans: FloatArray) -> FloatArray:
        """Return z and r (k, 2) at spans (k,), on a line through ``start`` normal to the curves."""
        here = np.array([[*start, self._theta]])
        first = self.field.span(here)[0]
        if not (-1e-6 < first[0] < 1.0 + 1e-6 and start[1] > ON_AXIS * self.field.radius):
            raise MeshError(
                f"z = {start[0]:.6g}, r = {start[1]:.6g} is not between hub and shroud, so curves "
                "of constant span cannot begin there"
            )
        out = np.empty((len(spans), 2))
        for side in (spans <= first[0], spans > first[0]):
            at = here.copy()
            span = float(first[0])
            order = np.flatnonzero(side)
            for k in order[::-1] if side[0] else order:
                for part in range(1, 5):
                    goal = span + (spans[k] - span) * part / 4
                    at[:, :2] = self._onto(at[:, :2], np.array([goal]))
                span = float(spans[k])
                out[k] = at[0, :2]
        return out

    def _onto(self, places: FloatArray, spans: FloatArray) -> FloatArray:
        """Return places (n, 2), z and r, moved along the slope of the span onto spans (n,)."""
        at = np.column_stack([places, np.full(len(places), self._theta)])
        for _ in range(3):
            value, slope = self.field.span(at)
            square = np.sum(slope[:, :2] ** 2, axis=1)
            factor = (value - spans) / np.where(square > 0.0, square, 1.0)
            at[:, :2] -= factor[:, None] * slope[:, :2]
        return at[:, :2]

    def _direction(self, places: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the unit tangents (n, 2) of the curves, and where a wall has ended, (n,) bool."""
        at = np.column_stack([places, np.full(len(places), self._theta)])
        ends = self.field.distances(at)
        slope = self.field.span_of(ends)[1]
        ended = np.maximum(ends[0][2], ends[1][2]) > BEND
        return unit(np.stack([slope[:, 1], -slope[:, 0]], axis=1)), ended

    def _trace(self, seeds: FloatArray, spans: FloatArray, step: float) -> FloatArray:
        """Return z, r and m (k, n, 3) on the curves from seeds (n, 2), by steps of m'."""
        at = np.column_stack([seeds, np.zeros(len(seeds))])
        straight = np.zeros(len(seeds), bool)
        ahead = self._direction(seeds)[0]
        table = [at]
        while not straight.all() and len(table) <= MOST_STEPS:
            # By m': d(z, r) = r t dm', dm = r dm'.
            rates: list[FloatArray] = []
            for factor in (0.0, 0.5, 0.5, 1.0):
                x = at + factor * step * rates[-1] if rates else at
                tangent, ended = self._direction(x[:, :2])
                straight = straight | ended
                tangent = np.where(straight[:, None], ahead, tangent)
                rates.append(np.column_stack([x[:, 1:2] * tangent, x[:, 1]]))
            new = at + step / 6.0 * (rates[0] + 2.0 * rates[1] + 2.0 * rates[2] + rates[3])
            back = np.where(straight[:, None], new[:, :2], self._onto(new[:, :2], spans))
            moved = row_norms(new[:, :2] - at[:, :2])
            straight = straight | (row_norms(back - new[:, :2]) > 0.2 * moved)
            new[:, :2] = np.where(straight[:, None], new[:, :2], back)
            ahead = np.where(straight[:, None], ahead, self._direction(new[:, :2])[0])
            table.append(new)
            at = new
        return np.array(table)


def _clear_angle(field: SpanField, corners: FloatArray) -> float:
    """Return the theta at which the walls have fewest holes: profiles (n, 2) are nearest there."""
    some: Any = corners[:: max(1, len(corners) // 200)]
    arc = field.walls[0].corners[..., 2]
    angles = np.linspace(arc.min() / field.radius, arc.max() / field.radius, 16)
    far = [
        np.abs([d for d, _, _ in field.distances(np.column_stack([some, np.full(len(some), a)]))])
        .min(axis=0)
        .sum()
        for a in angles
    ]
    return float(angles[int(np.argmin(far))])
