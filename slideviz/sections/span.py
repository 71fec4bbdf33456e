"""The surface of constant span between two walls, a shape of sections: hub 0, shroud 1.

It is laid flat to (m', theta), which keeps angles. The first line of a function says what it is for
this shape; shapes of arrays are in `slideviz.sections.shape` and
`slideviz.sections.around_axis.AboutAxis`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.case.model import Case
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.case.spans import WALLS_KEY, span_ends
from slideviz.errors import CaseError
from slideviz.machine.span import SpanCurves, find_span
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.zones import require_one_zone
from slideviz.sections.around_axis import AboutAxis, UnrolledPolygons
from slideviz.sections.shape import Label

if TYPE_CHECKING:
    from slideviz.sections.model import Section, Triple

_ROUNDS = 8  # rounds of Ridders' method, each of which about doubles the number of right digits
_AMID = 0.25  # curves begin at a node whose span is so near to the middle


@dataclass(frozen=True, eq=False)
class SpanWalls:
    """Two walls of a mesh, and the curves of constant span between them."""

    hub: str
    shroud: str
    """`hub`, `shroud`: their boundaries."""
    curves: SpanCurves

    @cached_property
    def lean(self) -> float:
        """The angle in radians between the curves and the axis, where m is 0 at mid-span."""
        (z, r) = np.diff(self.curves.traced(np.array([[-1e-3, 0, 0.5], [1e-3, 0, 0.5]])), axis=0)[0]
        return float(np.arctan2(r, z))

    @cached_property
    def scale(self) -> float:
        """The most that `level` may change per length, over its usual rate of 1: its inverse."""
        field = self.curves.field
        if field.revolved:
            return 1.0
        least = min(float(wall.corners[..., 1].min()) for wall in field.walls)
        return max(least, 1e-3 * field.radius) / field.radius

    def level(self, coords: FloatArray, span: float) -> FloatArray:
        """Return numbers (n,) that are 0 on a span, and below it negative: about the distance."""
        (hub, _, _), (shroud, _, _) = self.curves.field.distances(coords)
        return np.asarray(((1.0 - span) * hub - span * shroud) * self.scale)


_WALLS: WeakKeyDictionary[Mesh, dict[tuple[object, ...], SpanWalls]] = WeakKeyDictionary()
"""Results of `span_walls`."""


def span_walls(
    mesh: Mesh,
    hub: str,
    shroud: str,
    axis: tuple[float, float, float],
    origin: tuple[float, float, float],
    period: float = 2.0 * np.pi,
) -> SpanWalls:
    """Return two walls with their curves; cached as long as the mesh lives.

    Raises MeshError as `find_span` does.
    """
    key = hub, shroud, axis, origin, period
    cache = _WALLS.setdefault(mesh, {})
    if key not in cache:
        field = find_span(mesh, hub, shroud, axis, origin, period)
        coords = field.meridional(mesh.points[mesh.cells.nodes[:: 1 + len(mesh.points) // 20_000]])
        amid = coords[np.abs(field.span(coords)[0] - 0.5) <= _AMID]
        coords = amid if len(amid) else coords
        off = np.linalg.norm(coords[:, :2] - np.median(coords[:, :2], axis=0), axis=1)
        cache[key] = SpanWalls(
            hub, shroud, SpanCurves(field, coords[int(np.argmin(off)), :2].tolist())
        )
    return cache[key]


def walls_of(section: Section) -> SpanWalls:
    """Return the walls of a section of constant span; CaseError where none are known."""
    if section.walls is None:
        raise CaseError(
            "a section of constant span needs hub and shroud: name them in SPAN, or by --between"
        )
    return section.walls


class ConstantSpan(AboutAxis):
    """A surface of constant span, whose size is the span."""

    terms = SECTION_SHAPES["span"]
    in_plane = None
    directed = True
    near = 0.02  # layers of nodes, relaxed ones too, are not cut into slivers on either side

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return signed numbers (n,), positive towards the shroud, that grow as distances do."""
        x, y = along(0), along(1)
        coords = np.stack([along(2), np.hypot(x, y), np.arctan2(y, x)], axis=1)
        return walls_of(section).level(self._branch(section, coords), section.span)

    def crossings(
        self, section: Section, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return where edges cross, by Ridders' method (IEEE Trans. Circuits Syst. 26, 1979)."""
        (start, way), (low, high) = edges, level
        a, b = np.zeros(len(start)), np.ones(len(start))
        root = low / np.where(low != high, low - high, 1.0)

        def value(share: FloatArray) -> FloatArray:
            points = start + share[:, None] * way
            coords = walls_of(section).curves.field.meridional(points)
            return walls_of(section).level(coords, section.span)

        for _ in range(_ROUNDS):
            middle = (a + b) / 2.0
            there = value(middle)
            size = np.sqrt(np.maximum(there**2 - low * high, 0.0))
            step = (middle - a) * np.sign(low - high) * there / np.where(size > 0.0, size, 1.0)
            root = np.clip(middle + step, 0.0, 1.0)
            at_root = value(root)
            ends = np.stack([a, middle, root, b]), np.stack([low, there, at_root, high])
            order = np.argsort(ends[0], axis=0)
            places, values = (np.take_along_axis(each, order, axis=0) for each in ends)
            # The first interval in which the sign changes.
            first = np.argmax(np.sign(values[1:]) != np.sign(values[:1]), axis=0)[None]
            a, b = (np.take_along_axis(places, first + k, axis=0)[0] for k in (0, 1))
            low, high = (np.take_along_axis(values, first + k, axis=0)[0] for k in (0, 1))
        return root

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        field = walls_of(section).curves.field
        return field.span(field.meridional(points))[0]

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return the section at mid-span."""
        return section.sized(self.size.usual)

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the point of the axis moves; infinity where the axis is turned round."""
        return float(np.linalg.norm(step)) if turned @ section.basis[2] > 0 else np.inf

    def describe(self, section: Section) -> str:
        walls = section.walls
        between = "hub to shroud" if walls is None else f"{walls.hub} to {walls.shroud}"
        return f"{self.brief(section)} from {between}"

    def brief(self, section: Section) -> str:
        return f"{100.0 * section.span:.6g} % span"

    def miss(self, section: Section, points: FloatArray) -> str:
        spans = self.positions(section, points)
        return f"misses the mesh, which has spans {spans.min():.4g} to {spans.max():.4g}"

    def laid(self, section: Section, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return m', theta, and the span above that of the section."""
        local = opened.local
        coords = np.stack([local[:, 2], np.hypot(local[:, 0], local[:, 1]), opened.angle], axis=1)
        plane = walls_of(section).curves.plane(self._branch(section, coords))
        return np.stack([plane[:, 0], opened.angle, plane[:, 2] - section.span], axis=1)

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return None: all its curves go to the right in the flat view."""
        return None

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        return Label("m′ [-]", "m′"), Label("θ [rad]", "θ")

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix of a shift by the angle."""
        flat = np.eye(4)
        flat[1, 3] = angle
        return flat

    def places(self, section: Section, points: FloatArray) -> FloatArray:
        """Return angles in radians, and arc lengths m along the curve."""
        curves = walls_of(section).curves
        coords = curves.field.meridional(points)
        return np.column_stack([coords[:, 2], curves.length(curves.plane(coords))])

    def surface(self, section: Section, places: FloatArray, size: float) -> FloatArray:
        curves = walls_of(section).curves
        span = np.full(len(places), size)
        plane = np.column_stack([curves.at_length(places[:, 1], span), places[:, 0], span])
        # The spline, not `SpanCurves.coords`: a frame goes beyond the rims of the walls.
        return curves.field.points(np.column_stack([curves.traced(plane), plane[:, 1]]))

    def lean(self, section: Section) -> float:
        return walls_of(section).lean

    def lever(self, section: Section, along: float) -> float:
        """Return the height of the passage there."""
        coords = self._coords(section, along)
        (hub, _, _), (shroud, _, _) = walls_of(section).curves.field.distances(coords)
        return float(hub[0] + shroud[0])

    def girth(self, section: Section, along: float) -> float:
        return float(self._coords(section, along)[0, 1])

    def _coords(self, section: Section, along: float) -> FloatArray:
        field = walls_of(section).curves.field
        return field.meridional(
            self.surface(section, np.array([[field.middle, along]]), section.span)
        )

    def _branch(self, section: Section, coords: FloatArray) -> FloatArray:
        """Return meridional coordinates (n, 3), theta within half a turn of the walls' middle."""
        middle = walls_of(section).curves.field.middle
        coords[:, 2] -= 2.0 * np.pi * np.round((coords[:, 2] - middle) / (2.0 * np.pi))
        return coords


def find_walls(
    mesh: Mesh,
    case: Case | None = None,
    pair: Pair | None = None,
    between: tuple[str, str] | None = None,
    about: tuple[Triple, Triple] | None = None,
    remedy: str = WALLS_KEY,
) -> SpanWalls:
    """Return hub and shroud of a mesh: ``between``, or those of the case, or by their names.

    ``pair``: the period. ``about``: the axis of the span, and a point on it; without that it is the
    axis of the period, and without a period that of the case. ``remedy``: see `span_ends`.
    Raises CaseError where none are known, or passages are not turned about an axis; and MeshError
    as `find_span` does.
    """
    case = case or Case()
    require_one_zone(mesh, "a span")
    hub, shroud = between or span_ends(case, mesh, remedy)
    if pair is not None and pair.kind != "rotational":
        if mesh.dim == 3 and case.markers_with("periodic"):
            raise CaseError(
                f"{mesh.name}: passages repeat by {pair.describe()}, but sections of constant span "
                "need an axis about which they turn: set PERIODIC_TYPE= rotational"
            )
        pair = None  # it was guessed: inflow and outflow match, too
    axis, origin = about or ((case.axis, case.origin) if pair is None else (pair.axis, pair.origin))
    period = 2.0 * np.pi if pair is None else pair.period
    return span_walls(mesh, hub, shroud, axis, origin, period)
