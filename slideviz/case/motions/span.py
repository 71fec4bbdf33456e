"""Motions of a blade over its span: twist, lean, sweep, chord and camber by curves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.displacement import Displacements, NodesOn, PlacedDisplacements
from slideviz.case.motions.motion import (
    Amount,
    DesignNumbers,
    Motion,
    MotionStart,
    Target,
    applies_to,
    place_words,
    without_brackets,
)
from slideviz.case.spans import periodic_pairs, span_field
from slideviz.case.values import read_vector, vector_text
from slideviz.case.words import Words, angle_deg, number
from slideviz.errors import CaseError, MeshError, Message, SlidevizError, shown
from slideviz.machine.blade import TOTALS, BladeSections, change_of
from slideviz.machine.smallest_distances import bodies
from slideviz.machine.span import Span
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import SPAN_KINDS, Numbers, SpanKind, Term, Vector, WholeNumbers

if TYPE_CHECKING:
    from slideviz.case.model import Case

_SECTIONS = WeakCache()


@frozen
class SpanMotion(Motion):
    """Change the sections of a blade, each at its span, by a curve over the span.

    The curve is the monotone cubic through ``values`` at ``spans``, from 0 at hub or root to 1
    at shroud or tip, and constant beyond them; a single one holds for the whole span. By ``kind``:

    * ``twist``, ``stagger``: turned about the stacking line, in degrees, from the direction of m
      towards that of growing theta; ``stagger`` has a single value.
    * ``lean``, ``sweep``: shifted along theta, or along the meridional direction, by a length.
    * ``chord``: scaled about the stacking line by a factor.
    * ``camber``: bent towards growing theta, by a part of the chord.

    Where the span is straight, as of a wing, m is along x and theta is the length across m and the
    span. Nodes keep their span, so those of hub and shroud stay on them. ``point``: a point of the
    stacking line, which then follows the line from hub to shroud through it; None: a straight line
    fitted to the sections' centroids. Displacements depend on the undeformed blade, whatever
    motions come before; several of one blade add up in any order.
    """

    marker: Target
    kind: SpanKind = field(metadata=SPAN_KINDS)
    spans: Numbers
    values: Numbers
    point: Vector | None = None

    kind_term = Term("blade over span")
    verbs = tuple(SPAN_KINDS)
    grammar = (
        "(BLADE, twist, 0:0, 0.5:1.5, 1:4)             span:degrees, about the stacking line",
        "(BLADE, stagger, degrees)                     one angle for all spans",
        "(BLADE, lean, 0:0, 1:0.01)                    span:length, along theta; sweep: along m",
        "(BLADE, chord, 0:1, 1:1.1)                    span:factor; camber: span:part of the chord",
        "(BLADE, twist, 0:0, 1:4, (px, py, pz))        with a point of the stacking line",
    )
    rows = ("curve", "change")
    stays_at = ("line", "point")
    only_3d = True
    keeps_span = True
    has_derivatives = True

    def __post_init__(self) -> None:
        super().__post_init__()
        spans = self.spans
        if not spans or len(spans) != len(self.values):
            raise CaseError(
                f"{len(spans)} spans and {len(self.values)} values are given; a curve needs a "
                "value for each span, and one or more"
            )
        if not (spans[0] >= 0.0 and spans[-1] <= 1.0) or (np.diff(spans) <= 0.0).any():
            raise CaseError(
                f"the spans {', '.join(f'{span:g}' for span in spans)} do not ascend from 0 to "
                "1; sort them, each once"
            )
        if self.kind == "stagger" and len(spans) > 1:
            raise CaseError("stagger has one angle for the whole span; a curve of them is a twist")
        if self.kind == "chord" and min(self.values) <= 0.0:
            raise CaseError(
                f"the chord's factor {min(self.values):g} is not above 0: it would fold the blade"
            )

    @property
    def verb(self) -> str:
        return self.kind

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        start = next((place for place, word in enumerate(words) if word.is_sign("(")), len(words))
        point = without_brackets(words[start:])
        if point and len(point) != 3:
            raise CaseError("the point of the stacking line needs three coordinates: (x, y, z)")
        stack = read_vector(point, "the stacking point") if point else None
        spans, values = read_curve(" ".join(word.text for word in words[:start]))
        if SPAN_KINDS[verb].unit == "°":  # type: ignore[index]
            for value in values:
                angle_deg(repr(value))
        return cls(marker, verb, spans, values, stack)  # type: ignore[arg-type]

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, "twist", (0.0, 1.0), (0.0, 0.0))

    def arguments(self) -> list[str]:
        return [curve_text(self), *([] if self.point is None else [vector_text(self.point)])]

    def described(self, dim: int, extent: float) -> str:
        words = self.label(".4g", exact=False)
        if self.point is None:
            return words
        return f"{words} about {place_words(self.point, extent)}"

    def label(self, form: str, *, exact: bool) -> str:
        unit = "°" if SPAN_KINDS[self.kind].unit == "°" else ""
        values = [f"{format(value, form)}{unit}" for value in self.values]
        if len(values) == 1:
            return f"{self.kind} {values[0]}"
        spans = [format(100.0 * span, form) for span in self.spans]
        pairs = (f"{value} at {span} %" for value, span in zip(values, spans, strict=True))
        return f"{self.kind} {', '.join(pairs)} span"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        if mesh.dim == 2:
            yield f"{self.kind} changes a blade over its span, and the mesh has none: it is 2D"
            return
        try:
            span_field(case, mesh)
        except SlidevizError as problem:
            yield str(problem)

    @classmethod
    def placed(
        cls, case: Case, mesh: Mesh, on: NodesOn, problems: list[Message]
    ) -> PlacedDisplacements:
        found: PlacedDisplacements = {}
        try:
            blades = blades_of(case, mesh, on)
        except CaseError as problem:
            problems += problem.messages
            return found
        for blade in blades:
            totals, _ = blade.totals()
            before = blade.sections.moved(totals[0])[0]
            for place, total in zip(blade.places, totals[1:], strict=True):
                try:
                    after = blade.sections.moved(total)[0]
                except MeshError as problem:
                    problems += problem.within(f"motion {place + 1}")
                    return found
                found[place] = Displacements(blade.nodes, after - before)
                before = after
        return found

    @classmethod
    def derivatives(
        cls, case: Case, mesh: Mesh, on: NodesOn
    ) -> Iterator[tuple[int, IntArray, FloatArray, FloatArray]]:
        for blade in blades_of(case, mesh, on):
            totals, slopes = blade.totals()
            by_totals = blade.sections.moved(totals[-1])[1]
            for place, (row, slope) in zip(blade.places, slopes, strict=True):
                yield place, blade.nodes, by_totals[:, :, row], slope

    def amounts(self) -> list[Amount]:
        return [Amount("values", self.values, SPAN_KINDS[self.kind].neutral)]

    def design_numbers(self) -> DesignNumbers:
        for k, span in enumerate(self.spans):
            yield ("value" if len(self.spans) == 1 else f"{span:.15g}"), "values", k


def read_curve(text: str) -> tuple[Numbers, Numbers]:
    """Return spans and values of a curve as ``0:0, 0.5:1.5, 1:4``, or of a single value.

    Raises CaseError with a sentence.
    """
    words = text.replace(",", " ").split()
    if len(words) == 1 and ":" not in text:
        return (0.0,), (number(words[0]),)
    if not words or any(word.count(":") != 1 for word in words):
        raise CaseError(
            f"{shown(text)} is not a curve over the span; write span:value, e.g. 0:0, 0.5:1.5, "
            "1:4, or a single value"
        )
    spans, values = zip(*(word.split(":") for word in words), strict=True)
    return tuple(map(number, spans)), tuple(map(number, values))


def curve_text(motion: SpanMotion) -> str:
    """Return the curve of a motion over the span as text, as `read_curve` reads it."""
    values = [repr(float(value)).removesuffix(".0") for value in motion.values]
    if motion.spans == (0.0,):
        return values[0]
    spans = [repr(float(span)).removesuffix(".0") for span in motion.spans]
    return ", ".join(f"{span}:{value}" for span, value in zip(spans, values, strict=True))


def moves_over_span(case: Case) -> bool:
    """Return whether a moving boundary has a motion over the span."""
    over = [motion for motion in case.motions if isinstance(motion, SpanMotion)]
    return any(applies_to(motion, name) for motion in over for name in case.markers_with("moving"))


@record
class Blade:
    """Boundaries that motions over the span move, with all of these motions."""

    nodes: IntArray  # (n,): of the mesh, ascending
    sections: BladeSections  # of these nodes
    places: WholeNumbers  # of the motions in the case
    motions: tuple[SpanMotion, ...]
    reached: tuple[np.ndarray, ...]  # (n,) bool for each motion: the nodes that it moves

    def totals(self) -> tuple[FloatArray, list[tuple[int, FloatArray]]]:
        """Return totals (motions + 1, `TOTALS`, n): at first none, then after each motion.

        Also for each motion the row of the total that it changes, and the derivative (n, k) of that
        by its values.
        """
        totals = [np.zeros((TOTALS, len(self.nodes)))]
        slopes = list[tuple[int, FloatArray]]()
        for motion, reached in zip(self.motions, self.reached, strict=True):
            row, change, slope = change_of(
                motion.kind, motion.spans, motion.values, self.sections.spans
            )
            totals.append(totals[-1].copy())
            totals[-1][row] += np.where(reached, change, 0.0)
            slopes.append((row, slope * reached[:, None]))
        return np.array(totals), slopes


def blades_of(case: Case, mesh: Mesh, on: NodesOn) -> list[Blade]:
    """Return the blades that motions over the span move; ``on``: nodes (k,) of moving markers.

    Motions that share a boundary move one blade. Raises CaseError where they have different
    stacking points, or the blade has no sections.
    """
    motions = {
        place: motion
        for place, motion in enumerate(case.motions)
        if isinstance(motion, SpanMotion) and any(applies_to(motion, name) for name in on)
    }
    groups: list[tuple[set[str], list[int]]] = []
    for place, motion in motions.items():
        names = {name for name in on if applies_to(motion, name)}
        places = [place]
        for other in [group for group in groups if group[0] & names]:
            groups.remove(other)
            names = names | other[0]
            places = sorted(places + other[1])
        groups.append((names, places))
    return [_blade(case, mesh, on, sorted(names), places) for names, places in groups]


def _blade(case: Case, mesh: Mesh, on: NodesOn, names: list[str], places: list[int]) -> Blade:
    motions = [one for one in (case.motions[k] for k in places) if isinstance(one, SpanMotion)]
    point = motions[0].point
    points = zip(places, motions, strict=True)
    other = next((place for place, motion in points if motion.point != point), None)
    if other is not None:
        raise CaseError(
            f"motion {other + 1} has another stacking point than motion {places[0] + 1} of the "
            "same boundary; give both one, or none"
        )
    field = span_field(case, mesh)
    nodes = mesh.nodes_of(names)

    def sections() -> BladeSections:
        boundary = boundary_of(mesh)
        some = boundary.facets[np.isin(boundary.marker, [boundary.names.index(n) for n in names])]
        quads = some[some[:, 2] != some[:, 3]]
        triangles = np.searchsorted(nodes, np.concatenate([some[:, :3], quads[:, [0, 2, 3]]]))
        stack = None if point is None else np.array(point)
        try:
            turns = _turns(case, mesh, field, nodes[triangles])[nodes]
            return BladeSections(field, mesh.points[nodes], triangles, stack, turns)
        except MeshError as problem:
            raise CaseError(f"motion {places[0] + 1}: {', '.join(names)}: {problem}") from problem

    # Not by the field, which sections keep alive.
    made = _SECTIONS.of(mesh, (field, tuple(names), point), sections)
    reached = [
        np.isin(nodes, np.concatenate([on[name] for name in names if applies_to(motion, name)]))
        for motion in motions
    ]
    return Blade(nodes, made, tuple(places), tuple(motions), tuple(reached))


def _turns(case: Case, mesh: Mesh, field: Span, triangles: IntArray) -> FloatArray:
    """Return by how much (n,) parts of a blade are moved to be together, in the third coordinate.

    ``triangles`` (t, 3): its facets, which periodic sides may cut.
    """
    out = np.zeros(len(mesh.points))
    pairs = periodic_pairs(case, mesh)
    period = abs(field.shift(pairs[0])) if pairs else 0.0
    if period != 0.0:  # 0 where passages repeat along the span
        images = [p.nodes if field.shift(p) > 0.0 else p.nodes[:, ::-1] for p in pairs]
        for body in bodies(triangles, np.unique(np.concatenate(images), axis=0)):
            out[triangles[body.facets]] = period * body.turns[:, None]
    return out


def prepare_span(case: Case, mesh: Mesh) -> None:
    """Compute and cache what motions over the span need of a mesh, if it has hub and shroud."""
    names = mesh.marker_names
    on = {name: mesh.marker(name).nodes for name in case.markers_with("moving") if name in names}
    motions = tuple(motion for motion in case.motions if isinstance(motion, SpanMotion))
    at_rest = SpanMotion("", "twist", (0.0,), (0.0,))
    with suppress(SlidevizError):
        span_field(case, mesh)
        blades_of(case.change(motions=motions or (at_rest,)), mesh, on)
