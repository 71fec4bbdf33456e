"""The surface of constant span between two walls, a shape of sections.

The span is 0 at hub or root, 1 at shroud or tip. About an axis it is laid flat to (m', theta),
which keeps angles. The first line of a function says what it is for this shape; shapes of arrays
are in `slideviz.sections.shape` and `slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Self

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.model import Case
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.case.spans import WALLS_KEY, span_between, span_ends
from slideviz.case.zone_cases import each_zone
from slideviz.errors import CaseError
from slideviz.machine.span import Curves, Span
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.zones import names_from
from slideviz.sections.around_axis import AboutAxis, UnrolledPolygons
from slideviz.sections.plane import Plane
from slideviz.sections.polygons import Polygons
from slideviz.sections.shape import Along, Edges, Label, Labels, Level, Section, Triple, triple

_SPANS = np.linspace(0.0, 1.0, 33)  # at which zones are joined to each other
_ROUNDS = 8  # rounds of Ridders' method, each of which about doubles the number of right digits


@frozen
class SpanChannel:
    """The walls of a zone, and the span between them."""

    hub: str  # its boundary, as that of the shroud
    shroud: str
    field: Span
    zone: int  # the number of the zone in the mesh, from 0

    @property
    def curves(self) -> Curves:
        """Return the curves of constant span."""
        return self.field.curves

    def level(self, coords: FloatArray, span: float) -> FloatArray:
        """Return numbers (n,) that are 0 on a span, and below it negative: about the distance."""
        (hub, _, _), (shroud, _, _) = self.field.distances(coords)
        return ((1.0 - span) * hub - span * shroud) * self.field.level_scale

    def outside(self, coords: FloatArray) -> FloatArray:
        """Return numbers (n,): 0 between the walls, and more beyond them or their rims."""
        ends = self.field.distances(coords)
        span = self.field.span_of(ends)[0]
        return np.maximum(np.maximum(-span, span - 1.0), 0.0) + np.maximum(ends[0][2], ends[1][2])


@frozen
class SpanWalls:
    """The walls of all zones of a machine: at each place the span is that of the zone there.

    Lengths m and m' go on from zone to zone, in the order in which the flow passes them.
    """

    channels: tuple[SpanChannel, ...]

    @property
    def field(self) -> Span:
        """Return the span of the first zone, with the axis of all."""
        return self.channels[0].field

    @property
    def words(self) -> str:
        """Return hub and shroud of each zone in words."""
        return ", ".join(f"{one.hub} to {one.shroud}" for one in self.channels)

    @cached_property
    def lean(self) -> float:
        """The angle in radians between the curves and the axis, where m is 0 at mid-span."""
        places = np.array([[-1e-3, 0, 0.5], [1e-3, 0, 0.5]])
        z, r = np.diff(self.field.curves.traced(places), axis=0)[0]
        return float(np.arctan2(r, z))

    @cached_property
    def _begin(self) -> FloatArray:
        """(c, 3, s): by how much m' and m of each zone go on, and m at its begin, at `_SPANS`."""
        out = np.zeros((len(self.channels), 3, len(_SPANS)))
        before = -1
        starts = [one.field.first_coords for one in self.channels]
        order = np.argsort([float(self.field.curves.plane(at)[0, 0]) for at in starts])
        for k in order.tolist():
            one = self.channels[k]
            last = self.channels[before].curves
            begin = one.field.begin(_SPANS)
            start = one.curves.plane(begin)
            length = one.curves.length(start)
            if k != order[0]:
                met = last.plane(begin)
                out[k, 0] = out[before, 0] + met[:, 0] - start[:, 0]
                out[k, 1] = out[before, 1] + last.length(met) - length
            out[k, 2] = out[k, 1] + length
            before = k
        return out

    def _each(
        self, coords: FloatArray, value: Callable[[int, FloatArray], FloatArray]
    ) -> FloatArray:
        """Return values (n, ...) at meridional coordinates (n, 3), of the zone at each place."""
        if len(self.channels) == 1:
            return value(0, self.field.branch(coords))
        outside = [one.outside(one.field.branch(coords)) for one in self.channels]
        return self._chosen(np.argmin(outside, axis=0), coords, value)

    def _chosen(
        self, which: IntArray, rows: FloatArray, value: Callable[[int, FloatArray], FloatArray]
    ) -> FloatArray:
        """Return values (n, ...) of rows (n, 3), each of the zone ``which`` (n,)."""
        parts = [value(k, rows[which == k]) for k in range(len(self.channels))]
        order = np.argsort(np.argsort(which, kind="stable"), kind="stable")
        return np.concatenate(parts)[order]

    def level(self, coords: FloatArray, span: float) -> FloatArray:
        """Return numbers (n,) that are 0 on a span, and below it negative: about the distance."""
        return self._each(coords, lambda k, some: self.channels[k].level(some, span))

    def span(self, coords: FloatArray) -> FloatArray:
        """Return the span (n,) at meridional coordinates (n, 3)."""
        return self._each(coords, lambda k, some: self.channels[k].field.span(some)[0])

    def plane(self, coords: FloatArray) -> FloatArray:
        """Return m', m and span (n, 3) at meridional coordinates (n, 3)."""

        def value(k: int, some: FloatArray) -> FloatArray:
            curves = self.channels[k].curves
            plane = curves.plane(some)
            m_prime = np.interp(plane[:, 2], _SPANS, self._begin[k][0])
            m = np.interp(plane[:, 2], _SPANS, self._begin[k][1])
            return np.column_stack([plane[:, 0] + m_prime, curves.length(plane) + m, plane[:, 2]])

        return self._each(coords, value)

    def coords(self, places: FloatArray) -> FloatArray:
        """Return meridional coordinates (n, 3) at places (n, 3): theta, m and span.

        On the spline, not exactly on the span: so they go on beyond the rims of the walls.
        """

        def value(k: int, some: FloatArray) -> FloatArray:
            curves = self.channels[k].curves
            theta, m, span = some.T
            at = m - np.interp(span, _SPANS, self._begin[k, 1])
            plane = np.stack([curves.at_length(at, span), theta, span], axis=1)
            return np.column_stack([curves.traced(plane), theta])

        starts = np.array([np.interp(places[:, 2], _SPANS, rows[2]) for rows in self._begin])
        past = np.where(starts <= places[:, 1], starts, -np.inf)
        none = np.isinf(past).all(axis=0)
        return self._chosen(
            np.where(none, starts.argmin(axis=0), past.argmax(axis=0)), places, value
        )


class ConstantSpan(AboutAxis):
    """A surface of constant span, whose size is the span."""

    terms = SECTION_SHAPES["span"]
    near = 0.02  # layers of nodes, relaxed ones too, are not cut into slivers on either side

    @property
    def known_walls(self) -> SpanWalls:
        """Return the walls; CaseError where none are known."""
        if self.walls is None:
            raise CaseError(
                "a section of constant span needs hub and shroud, or root and tip: name them in "
                "SPAN or --between"
            )
        return self.walls

    def gap(self, along: Along) -> FloatArray:
        """Return signed numbers (n,), positive towards the shroud, that grow as distances do."""
        x = along(0)
        y = along(1)
        coords = np.stack([along(2), np.hypot(x, y), np.arctan2(y, x)], axis=1)
        return self.known_walls.level(coords, self.span)

    def crossings(self, edges: Edges, level: Level) -> FloatArray:
        """Return where edges cross, by Ridders' method (IEEE Trans. Circuits Syst. 26, 1979)."""
        start, way = edges
        low, high = level
        a = np.zeros(len(start))
        b = np.ones(len(start))
        root = low / np.where(low != high, low - high, 1.0)

        def value(share: FloatArray) -> FloatArray:
            points = start + share[:, None] * way
            coords = self.known_walls.field.meridional(points)
            return self.known_walls.level(coords, self.span)

        for _ in range(_ROUNDS):
            middle = (a + b) / 2.0
            there = value(middle)
            size = np.sqrt(np.maximum(there**2 - low * high, 0.0))
            step = (middle - a) * np.sign(low - high) * there / np.where(size > 0.0, size, 1.0)
            root = np.clip(middle + step, 0.0, 1.0)
            at_root = value(root)
            places = np.stack([a, middle, root, b])
            order = np.argsort(places, axis=0)
            places = np.take_along_axis(places, order, axis=0)
            values = np.take_along_axis(np.stack([low, there, at_root, high]), order, axis=0)
            # The first interval in which the sign changes.
            first = np.argmax(np.sign(values[1:]) != np.sign(values[:1]), axis=0)[None]
            interval = np.concatenate([first, first + 1])
            a, b = np.take_along_axis(places, interval, axis=0)
            low, high = np.take_along_axis(values, interval, axis=0)
        return root

    def positions(self, points: FloatArray) -> FloatArray:
        walls = self.known_walls
        return walls.span(walls.field.meridional(points))

    def first(self, points: FloatArray) -> Self:
        """Return the section at mid-span."""
        return self.sized(self.size_terms.usual)

    def words(self) -> str:
        between = "" if self.walls is None else f" from {self.walls.words}"
        return f"{self.few_words()}{between}"

    def few_words(self) -> str:
        return f"{100.0 * self.span:.6g} % span"

    def miss(self, points: FloatArray) -> str:
        spans = self.positions(points)
        return f"misses the mesh, which has spans {spans.min():.4g} to {spans.max():.4g}"

    def laid(self, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return m', theta, and the span above that of the section."""
        coords = np.stack([opened.height, opened.radius, opened.angle], axis=1)
        plane = self.known_walls.plane(coords)
        return np.stack([plane[:, 0], opened.angle, plane[:, 2] - self.span], axis=1)

    def flat_labels(self) -> Labels:
        return Label("m′ [-]", "m′"), Label("θ [rad]", "θ")

    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix of a shift by the angle."""
        flat = np.eye(4)
        flat[1, 3] = angle
        return flat

    def places(self, points: FloatArray) -> FloatArray:
        """Return angles in radians, and arc lengths m along the curve."""
        walls = self.known_walls
        coords = walls.field.meridional(points)
        return np.column_stack([coords[:, 2], walls.plane(coords)[:, 1]])

    def surface(self, places: FloatArray, size: float) -> FloatArray:
        walls = self.known_walls
        return walls.field.points(
            walls.coords(np.column_stack([places, np.full(len(places), size)]))
        )

    def lean(self) -> float:
        return self.known_walls.lean

    def girth(self, along: float) -> float:
        return float(self._coords(along)[0, 1])

    def _coords(self, along: float) -> FloatArray:
        walls = self.known_walls
        return walls.coords(np.array([[walls.field.middle, along, self.span]]))


class SpanPlane(ConstantSpan):
    """A section of a span along a direction: a plane normal to that, looked at as any plane.

    Its direction is that of the span, and its point one where the span is 0.
    """

    @cached_property
    def plane(self) -> Plane:
        """Return the section as a plane."""
        field = self.known_walls.field
        (point,) = field.points(field.begin(np.array([self.span])))
        return Plane("plane", triple(point), self.direction)

    def gap(self, along: Along) -> FloatArray:
        return along(2) - float((self.plane.point - self.point) @ self.basis[2])

    def crossings(self, edges: Edges, level: Level) -> FloatArray:
        return self.plane.crossings(edges, level)

    def positions(self, points: FloatArray) -> FloatArray:
        """Return spans (n,); what is beyond root or tip counts as at it."""
        return np.clip(super().positions(points), 0.0, 1.0)

    def keeps(self, turned: FloatArray, step: FloatArray) -> float:
        return self.plane.keeps(turned, step)

    def flatten(self, polygons: Polygons, near: float | None, ahead: float | None) -> Polygons:
        return self.plane.flatten(polygons, near, ahead)

    def middle_angle(self, polygons: Polygons, near: float | None = None) -> float | None:
        return None

    def flat_labels(self) -> Labels:
        return self.plane.flat_labels()

    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        return self.plane.flat_matrix(matrix, angle)

    def opened(self, places: FloatArray) -> FloatArray:
        return places

    def girth(self, along: float) -> float:
        return 1.0

    def facing(self, points: FloatArray) -> FloatArray:
        return self.plane.facing(points)

    def aslant(self, points: FloatArray) -> FloatArray:
        return self.plane.aslant(points)


def between_walls(section: Section, walls: SpanWalls) -> Section:
    """Return a section of constant span between walls, of the class of their kind of span."""
    values = {each.name: getattr(section, each.name) for each in fields(section)}
    values["walls"] = walls
    if walls.field.about:
        return ConstantSpan(**values)
    return SpanPlane(**values | {"direction": walls.field.axis, "origin": walls.field.origin})


def find_walls(
    mesh: Mesh,
    case: Case | None = None,
    periods: Sequence[Pair] = (),
    between: tuple[str, str] | None = None,
    about: tuple[Triple, Triple] | None = None,
    remedy: str = WALLS_KEY,
) -> SpanWalls:
    """Return hub and shroud of each zone: ``between``, or those of the case, or by their names.

    ``periods``: that of each zone. ``about``: the axis of the span, and a point on it; without that
    it is the axis of the period, and without a period that of the case. ``remedy``: see
    `span_ends`. Zones without walls are left out, unless they all are.
    Raises CaseError where none are known, and MeshError as `span_between` does.
    """
    case = case or Case()
    case = case if between is None else case.change(span=between)
    channels = list[SpanChannel]()
    missing = list[CaseError]()
    for number, (one, zone) in enumerate(each_zone(case, mesh)):
        try:
            hub, shroud = span_ends(one, zone, remedy)
        except CaseError as problem:
            missing.append(problem)
            continue
        label = names_from(mesh, mesh.parts[number])
        pair = next((each for each in periods if each.first in label.values()), None)
        if pair is not None and pair.kind != "rotational" and not one.markers_with("periodic"):
            pair = None  # it was guessed: inflow and outflow match, too
        field = span_between(one, zone, (hub, shroud), pair, about)
        about = field.about or about
        channels.append(SpanChannel(label[hub], label[shroud], field, number))
    if not channels:
        raise missing[0]
    return SpanWalls(tuple(channels))
