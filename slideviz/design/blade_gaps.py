"""Throats between blades, tip gaps and other smallest distances of a mesh with its case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import field, replace
from typing import Any

import numpy as np

from slideviz.argument_types import check_types, record
from slideviz.case.model import Case
from slideviz.case.zone_cases import zone_cases
from slideviz.errors import CaseError
from slideviz.machine.smallest_distances import (
    bodies,
    level_lines,
    nearest_on_segments,
    neighbours,
    smallest,
    turned,
)
from slideviz.mesh.halo import without_halo
from slideviz.mesh.interfaces import ROUNDING
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, frozen_array
from slideviz.mesh.periodic import Pair, pair_up
from slideviz.mesh.surfaces import find_surfaces
from slideviz.mesh.zones import names_from, names_in, spellings, zones_of
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.projection import as_simplices
from slideviz.sections.cut import transformed
from slideviz.sections.span import SpanChannel, find_walls

PLACES = frozen_array(np.linspace(0.02, 0.98, 25).round(2))
"""Spans, and parts of the chord, at which distances are measured; 0.1, 0.5, 0.9 among them."""
RIM = 0.1  # the nodes of a blade within this span of its end are its tip
TOUCHING = "they touch (distance 0)"


@record
class Gap:
    """The smallest distance between two boundaries, overall and by place; in the mesh's unit."""

    name: str
    """Throat, tip gap, hub gap; or both boundaries."""
    first: str
    second: str
    """`first`, `second`: the boundaries."""
    distance: float
    """The smallest one; 0 where they touch up to rounding."""
    start: FloatArray
    end: FloatArray
    """`start`, `end` (d,): the points of ``first`` and ``second`` where it is."""
    place: float = np.nan
    """Where that is by ``along``."""
    along: str = ""
    """``span``, or ``chord`` for a gap at a wall; empty where there are no places, as in 2D."""
    places: FloatArray = field(default_factory=lambda: np.empty(0))
    """(k,): spans, or parts of the chord from the leading edge on."""
    distances: FloatArray = field(default_factory=lambda: np.empty(0))
    """(k,): the smallest distance at each place; NaN where ``first`` is not there."""
    zone: int | None = None
    """The number of its zone, where the mesh has several."""

    @property
    def words(self) -> str:
        """Return zone, name and boundaries in words."""
        where = "" if self.zone is None else f"zone {self.zone}: "
        if self.name == f"{self.first} to {self.second}":
            return where + self.name
        if self.first == self.second:
            return f"{where}{self.name} of {self.first}"
        return f"{where}{self.name} between {self.second} and {self.first}"

    def summary(self) -> dict[str, Any]:
        """Return the numbers for a report."""

        def number(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        return {
            "distance": self.distance,
            "place": number(self.place),
            "points": [self.start.tolist(), self.end.tolist()],
            "distances": [number(value) for value in self.distances],
        }


@check_types
def gaps(
    case: Case,
    mesh: Mesh,
    between: Sequence[tuple[str, str]] = (),
    places: Sequence[float] = tuple(PLACES.tolist()),
    reference: Mesh | None = None,
) -> tuple[Gap, ...]:
    """Return the throat between blades, the gaps at their ends, and other smallest distances.

    Blades are the moving boundaries besides hub and shroud. The throat is the smallest distance
    from a blade to the next one, which may be the same blade one period on; at each span between
    their lines of that span. The gaps are those between blades and a wall that they do not meet; at
    each part of the chord from the line of the wall there. Distances are exact for the facets. Of
    several zones each has its own; those without blades have none.

    Parameters
    ----------
    case : Case
        Its roles, periodic boundaries and axis, and hub and shroud.
    mesh : Mesh
        The mesh, deformed or not.
    between : sequence of (str, str)
        Other pairs of boundaries to measure, both of one zone.
    places : sequence of float
        Spans and parts of the chord between 0 and 1.
    reference : Mesh, optional
        The undeformed mesh, whose period counts: periodic sides of a deformed one need not match.

    Raises
    ------
    CaseError, MeshError
        No boundary moves besides hub and shroud, or a boundary is unknown, is of another zone than
        the one it is measured from, or is to be measured from itself.

    Examples
    --------
    >>> import slideviz as sv
    >>> from slideviz.samples.table import write_sample
    >>> files = write_sample("turbine-row", "try", 5000)
    >>> case = sv.Case.read("try/turbine-row.cfg")
    >>> [throat] = sv.gaps(case, sv.read(case.mesh_file))
    >>> round(throat.distance, 3)
    0.008
    """
    written = spellings(mesh)
    for first, second in between:
        if written.get(first, first) == written.get(second, second):
            raise CaseError(f"between: {first!r} is given twice; name two boundaries")
    at = np.asarray(places, float)
    base = reference or mesh
    zones = zip(zone_cases(case, mesh, False), zones_of(mesh), zones_of(base), strict=True)
    names = [names_from(mesh, part) for part in mesh.parts]
    several = isinstance(mesh, Assembly)
    each = zip(zones, names, _by_zone(mesh, between), strict=True)
    out = list[Gap]()
    blades = False
    for number, ((one, zone, start), name, pairs) in enumerate(each, 1):
        if one.markers_with("moving") or pairs or not several:
            measure = _Measure(one, zone, start, at, name)
            blades = blades or bool(measure.blades)
            found = measure.all(pairs)
            out += [replace(gap, zone=number) for gap in found] if several else found
    if not blades and not between:
        raise CaseError(
            f"{mesh.name}: no boundary moves besides hub and shroud, so there is no blade; list "
            "the blades in MARKER_MOVING"
        )
    return tuple(out)


class _Measure:
    """The surfaces of a mesh with their period and span, and the distances between them."""

    def __init__(
        self, case: Case, mesh: Mesh, reference: Mesh, places: FloatArray, labels: Mapping[str, str]
    ) -> None:
        """``labels``: the names of boundaries in results, where the mesh has others."""
        self._labels = labels
        base = without_halo(reference)[0]
        mesh = without_halo(mesh)[0]
        self.mesh = mesh
        self.places = places
        self._surfaces = {one.name: one for one in find_surfaces(mesh)}
        names = [n for n in case.markers_with("periodic") if len(mesh.marker(n).cells)]
        kind = case.periodic_type
        axis = case.axis
        origin = case.origin
        pairs: Sequence[Pair] = pair_up(base, names, kind, axis, origin) if names else ()
        model = pairs[0] if pairs else None
        self.periods = (-1, 0, 1) if model is not None else (0,)
        same = [p.nodes if _same_way(p, pairs[0]) else p.nodes[:, ::-1] for p in pairs]
        self.sides = np.concatenate([np.empty((0, 2), np.int64), *same])
        self.turn = lambda points, k: transformed(points, model.matrix(k)) if model else points
        self.walls: SpanChannel | None = None
        # Without hub and shroud, distances are not by span; a SPAN that is wrong is an error.
        unknown = case.span is None and case.span_axis is None
        with suppress(CaseError) if unknown else nullcontext():
            self.walls = find_walls(mesh, case, pairs).channels[0] if mesh.dim == 3 else None
        ends = () if self.walls is None else (self.walls.hub, self.walls.shroud)
        moving = case.markers_with("moving")
        self.blades = tuple(name for name in moving if name not in ends)
        if self.walls is not None and not self.walls.field.about:
            self.blades = self.blades or moving  # a wing is its own tip

    def all(self, between: Sequence[tuple[str, str]]) -> Iterator[Gap]:
        throat = self.throat() if self.blades else None
        if throat is not None:
            yield throat
        if self.walls is not None and self.blades:
            for name, wall, end in (
                ("tip gap", self.walls.shroud, 1),
                (f"{self.walls.field.ends[0]} gap", self.walls.hub, 0),
            ):
                if not np.isin(self.nodes(self.blades), self.nodes((wall,))).any():
                    yield self.wall_gap(name, wall, end)
        for first, second in between:
            yield self.distance(first, second)

    def nodes(self, names: Sequence[str]) -> IntArray:
        """Return the nodes (t, c) of the triangles of boundaries, in 2D of their lines."""
        for name in names:
            self.mesh.marker(name)
        facets = [self._surfaces[name].nodes[self._surfaces[name].facets] for name in names]
        sides: Any = np.concatenate(facets)[:, :, None]
        return as_simplices(sides)[:, :, 0].astype(np.int64)

    def corners(self, names: Sequence[str]) -> FloatArray:
        return self.mesh.points[self.nodes(names)]

    def images(self, corners: FloatArray) -> FloatArray:
        return np.concatenate([turned(corners, self.turn, by) for by in self.periods])

    def spans(self, points: FloatArray) -> FloatArray:
        assert self.walls is not None
        of = self.walls.field
        return of.span(of.meridional(points))[0]

    def throat(self) -> Gap | None:
        nodes = self.nodes(self.blades)
        corners = self.corners(self.blades)
        made = bodies(nodes, self.sides)
        several: Gap | None = None
        for body, others in zip(
            made, neighbours(made, corners, self.turn, self.periods), strict=True
        ):
            if not len(others):
                continue
            one = self._gap("throat", body.placed(corners, self.turn), others, self.spans, "span")
            several = one if several is None else _nearer(several, one)
        words = self._words(self.blades)
        return None if several is None else replace(several, first=words, second=words)

    def wall_gap(self, name: str, wall: str, end: int) -> Gap:
        assert self.walls is not None
        curves = self.walls.curves
        blades = self.corners(self.blades)
        points = blades.reshape(-1, 3)
        off = np.abs(self.spans(points) - end)
        # Where the tip is along the wall, whatever its distance from it.
        wall_corners = self.corners((wall,))
        tip = ClosestPoints(self.images(wall_corners)).query(points[off <= off.min() + RIM])

        def m_prime(at: FloatArray) -> FloatArray:
            return curves.plane(curves.field.meridional(at))[:, 0]

        low = float(m_prime(tip).min())
        high = float(m_prime(tip).max())

        def chord(at: FloatArray) -> FloatArray:
            return (m_prime(at) - low) / (high - low)

        gap = self._gap(name, wall_corners, self.images(blades), chord, "chord")
        return replace(gap, first=self._words([wall]), second=self._words(self.blades))

    def distance(self, first: str, second: str) -> Gap:
        one = self.corners((first,))
        two = self.images(self.corners((second,)))
        first = self._words([first])
        second = self._words([second])
        gap = self._gap(f"{first} to {second}", one, two, self.spans, "span")
        return replace(gap, first=first, second=second)

    def _words(self, names: Sequence[str]) -> str:
        return ", ".join(self._labels.get(name, name) for name in names)

    def _gap(self, name: str, first: FloatArray, second: FloatArray, level: Any, along: str) -> Gap:
        found = smallest(first, second)
        if found.distance <= ROUNDING * self.mesh.extent:
            found = found._replace(distance=0.0)
        gap = Gap(name, "", "", *found)
        if self.walls is None:
            return gap
        one = _at_corners(first, level)
        two = _at_corners(second, level)
        whole = ClosestPoints(second) if along == "chord" else None
        distances = []
        for place in self.places.tolist():
            lines = level_lines(first, one, place)
            others = whole or ClosestPoints(level_lines(second, two, place))
            distances.append(nearest_on_segments(lines, others).distance)
        return replace(
            gap,
            place=float(level(found.start[None])[0]),
            along=along,
            places=self.places,
            distances=np.where(np.isfinite(distances), distances, np.nan),
        )


def _by_zone(mesh: Mesh, between: Sequence[tuple[str, str]]) -> list[list[tuple[str, str]]]:
    """Return pairs of boundaries for each zone, with the names of its file."""
    written = spellings(mesh)
    out = [list[tuple[str, str]]() for _ in mesh.parts]
    for first, second in between:
        one = mesh.marker(written.get(first, first)).name
        other = mesh.marker(written.get(second, second)).name
        for some, part in zip(out, mesh.parts, strict=True):
            names = names_in(mesh, part)
            if one in names and other in names:
                some.append((names[one], names[other]))
                break
        else:
            raise CaseError(
                f"{one} and {other} belong to zones with different periods, so their distance is "
                "not unique; name two boundaries of one zone"
            )
    return out


def _at_corners(corners: FloatArray, level: Any) -> FloatArray:
    """Return the numbers (t, c) that a function of points has at corners (t, c, d)."""
    points, place = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return np.asarray(level(points)[place.ravel()].reshape(corners.shape[:2]))


def _same_way(pair: Pair, model: Pair) -> bool:
    """Return whether a pair moves as the model does, and not by its inverse."""
    if model.kind == "rotational":
        return pair.angle * model.angle > 0.0
    return float(pair.vector @ model.vector) > 0.0


def _nearer(one: Gap, other: Gap) -> Gap:
    """Return the smaller one of two gaps, and the smaller distance at each place."""
    first = other if other.distance < one.distance else one
    return replace(first, distances=np.fmin(one.distances, other.distances))
