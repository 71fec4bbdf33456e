"""Periodic pairs: two boundaries that are images of each other, matched node by node.

Which markers are periodic comes from the case, never from the mesh file; the transformation is
found by the nodes. `slideviz.rbf.images` has the sets of nodes that are images of each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from operator import itemgetter

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError, Message, point_words
from slideviz.mesh.axis_frame import (
    Z_AXIS,
    Triple,
    axis_basis,
    axis_text,
    in_axis_frame,
    ordered_sum,
)
from slideviz.mesh.check import check_size
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, ZonePart, frozen_array
from slideviz.mesh.nearest import nearest
from slideviz.mesh.zones import names_from, names_in
from slideviz.system.weak_cache import weak_cache
from slideviz.terms import PeriodicKind, PeriodicType

TOLERANCE = 1e-5
"""Largest distance between a node's image and its partner, as a fraction of `Mesh.extent`."""

_KINDS: dict[PeriodicType, tuple[PeriodicKind, ...]] = {
    "auto": ("translational", "rotational"),
    "translational": ("translational",),
    "rotational": ("rotational",),
}
"""Kinds of transformation to try, in that order, by ``PERIODIC_TYPE``."""

WHOLE_NUMBER = 1e-3
"""Largest difference of the number of passages of a wheel from a whole number, over that number."""

_CHECK = "check the markers, PERIODIC_TYPE, PERIODIC_AXIS and PERIODIC_ORIGIN"
"""What to do about markers that do not match, in a case."""
_AXES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Axes of rotation that `find_pairs` tries, in that order."""


@record
class Pair:
    """Two markers that are images of each other."""

    first: str
    second: str  # `first`, `second`: marker names; second is the image of first
    kind: PeriodicKind
    vector: FloatArray  # (d,): translation from first to second; zero when rotational
    angle: float  # rotation in radians about axis through origin; zero when translational
    axis: Triple
    origin: Triple
    """`axis`, `origin` (3,) tuple of float: direction of the axis of rotation, and a point on it;
    without effect when translational."""
    nodes: IntArray  # (k, 2): each node of first and its image
    mismatch: float  # largest distance between an image and its partner, in the mesh's length unit

    @property
    def period(self) -> float:
        """Return the period, positive: a length (translational) or an angle in radians."""
        if self.kind == "rotational":
            return abs(self.angle)
        return float(np.linalg.norm(self.vector))

    @property
    def around(self) -> int | None:
        """Return the number of passages of the whole wheel; None if not whole, or no wheel."""
        if self.kind != "rotational":
            return None
        number = 2.0 * np.pi / self.period
        whole = round(number)
        return whole if abs(number - whole) <= WHOLE_NUMBER * number else None

    def matrix(self, periods: int) -> FloatArray:
        """Return the transformation (4, 4) by a number of periods."""
        matrix = np.eye(4)
        if self.kind == "translational":
            matrix[: len(self.vector), 3] = periods * self.vector
            return matrix
        # A full turn over the number of passages, where it is whole, so that a wheel closes.
        around = self.around
        angle = self.angle if around is None else np.copysign(2.0 * np.pi / around, self.angle)
        cos = np.cos(periods * angle)
        sin = np.sin(periods * angle)
        basis = axis_basis(self.axis)
        origin = np.asarray(self.origin)
        turn = basis.T @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ basis
        matrix[:3, :3] = turn
        matrix[:3, 3] = origin - turn @ origin
        return matrix

    def describe(self) -> str:
        """Return the transformation in words, for people."""
        if self.kind == "rotational":
            return f"{np.degrees(abs(self.angle)):.6g}° about {axis_text(self.axis)}"
        return f"{self.period:.6g} along ({point_words(self.vector, self.period, 4)})"


def match(
    mesh: Mesh,
    first: str,
    second: str,
    kind: PeriodicType = "auto",
    axis: Sequence[float] = Z_AXIS,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
) -> Pair:
    """Return the pair of two markers, ``second`` being the image of ``first``.

    ``auto`` tries a translation, then a rotation about the given axis. Raises MeshError if they
    have different numbers of nodes, or do not match to ``TOLERANCE``: then the message has the best
    transformation tried and its largest mismatch.
    """
    a = mesh.marker(first).nodes
    b = mesh.marker(second).nodes
    where = mesh.name, f"periodic markers {first!r} and {second!r} do not match"
    if len(a) != len(b):
        rule = (
            f"{len(a)} and {len(b)} nodes; periodic boundaries need the same nodes, so choose "
            "other markers or remesh one of them"
        )
        raise MeshError(Message(rule, place=where))
    allowed = TOLERANCE * mesh.extent
    tried = []
    for one in _KINDS[kind]:
        pair, worst = _match_kind(mesh, first, second, one, axis=axis, origin=origin)
        assert pair is not None
        if worst <= allowed:
            return pair
        tried.append((worst, pair))
    worst, best = min(tried, key=itemgetter(0))
    rule = (
        f"with the best {best.kind} transformation ({best.describe()}) a node is {worst:.3g} from "
        f"its image, allowed is {allowed:.3g}"
    )
    raise MeshError(Message(rule, _CHECK, where))


def _match_kind(
    mesh: Mesh,
    first: str,
    second: str,
    kind: PeriodicKind,
    *,
    axis: Sequence[float],
    origin: Sequence[float],
    bound: float = np.inf,
) -> tuple[Pair | None, float]:
    """Return the best pair of one kind, whether it matches or not, and its largest mismatch.

    The mismatch is infinite if the nodes are not one to one, the transformation is (nearly) none,
    or a translation has nodes in common. Nodes are looked for within ``bound`` of the images only:
    where there is none, the result is (None, inf). That is a hundred times faster for boundaries
    that are far from matching.
    """
    a = mesh.marker(first).nodes
    b = mesh.marker(second).nodes
    xa = mesh.points[a]
    xb = mesh.points[b]
    axis = Z_AXIS if mesh.dim == 2 else axis
    vector = np.zeros(mesh.dim)
    angle = 0.0
    if kind == "translational":
        vector = ordered_sum(xb) / len(b) - ordered_sum(xa) / len(a)
        image = xa + vector
        target = xb
    else:
        ya = in_axis_frame(xa, axis, origin)
        yb = in_axis_frame(xb, axis, origin)
        za = ya[:, 0] + 1j * ya[:, 1]
        zb = yb[:, 0] + 1j * yb[:, 1]
        # A rotation turns the sum of all complex positions by its own angle.
        angle = float(np.angle(ordered_sum(zb) * np.conj(ordered_sum(za))))
        turned = za * np.exp(1j * angle)
        image = np.stack([turned.real, turned.imag, ya[:, 2]], axis=1)
        target = yb
    distance, partner = nearest(target, image, bound, TOLERANCE * mesh.extent)
    if not np.isfinite(distance).all():
        return None, np.inf
    one_to_one = len(np.unique(partner)) == len(partner)
    # Two parts of one straight side are shifts of each other, but share a node: no images.
    one_to_one &= kind == "rotational" or not len(np.intersect1d(a, b))
    trivial = max(float(np.linalg.norm(vector)) / mesh.extent, abs(angle)) <= 10 * TOLERANCE
    pair = Pair(
        first=first,
        second=second,
        kind=kind,
        vector=frozen_array(vector),
        angle=angle,
        axis=tuple(float(v) for v in axis),  # type: ignore[arg-type]
        origin=tuple(float(v) for v in origin),  # type: ignore[arg-type]
        nodes=frozen_array(np.stack([a, b[partner]], axis=1)),
        mismatch=float(distance.max()),
    )
    return pair, float(distance.max()) if one_to_one and not trivial else np.inf


def turned_too(
    mesh: Mesh, pairs: Sequence[Pair], axis: Sequence[float], origin: Sequence[float]
) -> Pair | None:
    """Return a pair of the rotation by which translated sides match as well; None if they do not.

    So do the sides of half a wheel, whose passages are turned by 180°.
    """
    allowed = TOLERANCE * mesh.extent
    turned = None
    for each in pairs:
        turned, worst = _match_kind(
            mesh, each.first, each.second, "rotational", axis=axis, origin=origin, bound=2 * allowed
        )
        if each.kind == "rotational" or not worst <= allowed:
            return None
    return turned


def pair_up(
    mesh: Mesh,
    names: Sequence[str],
    kind: PeriodicType = "auto",
    axis: Sequence[float] = Z_AXIS,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
) -> tuple[Pair, ...]:
    """Return the pairs that the named markers form, whatever their order.

    All pairs of a zone have the same transformation or its inverse. If a marker matches several
    others (two halves of a straight side), the partner with this transformation is chosen. Raises
    MeshError if a marker has no partner, or the pairs have different transformations.
    """
    return _paired(mesh, tuple(names), kind, tuple(axis), tuple(origin))


@weak_cache
def _paired(
    mesh: Mesh,
    names: tuple[str, ...],
    kind: PeriodicType,
    axis: tuple[float, ...],
    origin: tuple[float, ...],
) -> tuple[Pair, ...]:
    if isinstance(mesh, Assembly):
        of_zones = [(part, names_in(mesh, part)) for part in mesh.parts]
        here = [(part, [own[n] for n in names if n in own]) for part, own in of_zones]
        return tuple(
            _in_whole(mesh, part, pair)
            for part, some in here
            if some
            for pair in pair_up(without_halo(part.mesh)[0], some, kind, axis, origin)
        )
    if len(names) % 2 or not names:
        raise MeshError(
            f"{mesh.name}: {len(names)} periodic markers ({', '.join(names) or 'none'}); "
            "they come in pairs"
        )

    def pairs_of(rest: Sequence[str], model: Pair | None) -> tuple[Pair, ...] | None:
        """Return pairs of all of ``rest`` that agree with ``model``, or None if there are none."""
        if not rest:
            return ()
        for second in rest[1:]:
            try:
                pair = match(mesh, rest[0], second, kind, axis, origin)
            except MeshError as problem:
                unmatched.append(problem)
                continue
            if model is not None and not agree(model, pair):
                names = (f"{p.first!r}, {p.second!r} ({p.describe()})" for p in (model, pair))
                several_periods.append(
                    MeshError(
                        f"{mesh.name}: the periodic pairs {' and '.join(names)} differ; only one "
                        "period is possible, so give the others another role"
                    )
                )
                continue
            others = pairs_of([name for name in rest[1:] if name != second], model or pair)
            if others is not None:
                return (pair, *others)
        return None

    unmatched: list[MeshError] = []
    several_periods: list[MeshError] = []
    pairs = pairs_of(list(names), None)
    if pairs is None:
        if several_periods:
            raise several_periods[0]
        raise _left_over(mesh, names, unmatched[0], kind=kind, axis=axis, origin=origin)
    return pairs


def _in_whole(mesh: Mesh, part: ZonePart, pair: Pair) -> Pair:
    """Return a pair of a zone with the names and nodes that its boundaries have in the mesh."""
    name = names_from(mesh, part)
    nodes = frozen_array(pair.nodes + part.points.start)
    return replace(pair, first=name[pair.first], second=name[pair.second], nodes=nodes)


def _left_over(
    mesh: Mesh,
    names: Sequence[str],
    first: MeshError,
    *,
    kind: PeriodicType,
    axis: Sequence[float],
    origin: Sequence[float],
) -> MeshError:
    """Return the error for markers without a partner; it names the pairs that do match, too.

    If no pair matches, it is the error ``first``.
    """
    good: list[Pair] = []
    alone = list(names)
    why = Message("they are not images of each other", "choose other markers")
    for each in _KINDS[kind]:
        for one, other in combinations(names, 2):
            if one in alone and other in alone:
                try:
                    good.append(match(mesh, one, other, each, axis, origin))
                except MeshError:
                    continue
                alone = [name for name in alone if name not in (one, other)]
    if not good or len(alone) < 2:
        return first
    if len(alone) == 2:
        try:
            match(mesh, alone[0], alone[1], kind, axis, origin)
        except MeshError as problem:
            (why,) = problem.messages
            if not why.place:  # a marker is not there, or is empty
                return problem
    pairs = ", ".join(f"{p.first!r} and {p.second!r} match ({p.describe()})" for p in good)
    left = " and ".join(repr(name) for name in alone)
    rule = f"the periodic markers {pairs}, but {left} do not: {why.rule}"
    return MeshError(Message(rule, why.remedy, (mesh.name,)))


def agree(one: Pair, other: Pair) -> bool:
    """Return whether two pairs have the same transformation or its inverse.

    The axes of two rotations are not compared.
    """
    if one.kind != other.kind:
        return False
    if one.kind == "rotational":
        return abs(one.period - other.period) <= TOLERANCE * one.period
    gaps = [np.linalg.norm(one.vector - sign * other.vector) for sign in (1, -1)]
    return bool(min(gaps) <= TOLERANCE * one.period)


def find_pairs(mesh: Mesh, going_on: Callable[[], object] = lambda: None) -> tuple[Pair, ...]:
    """Return pairs of markers that match, each marker in one pair at most.

    Translations are tried first, then rotations about z, x and y through 0. The pairs are a guess,
    to be confirmed by the user: the opposite sides of every box match. ``going_on`` is called
    before each try; what it raises ends the search. Raises MeshError if coordinates are too large
    to be computed with.
    """
    check_size(mesh)
    return tuple(
        _in_whole(mesh, part, pair) for part in mesh.parts for pair in _pairs(part.mesh, going_on)
    )


def _pairs(mesh: Mesh, going_on: Callable[[], object]) -> list[Pair]:
    """Return the pairs of a zone, as `find_pairs` does."""
    count = {name: len(mesh.marker(name).nodes) for name in mesh.marker_names}
    tries: list[tuple[PeriodicKind, Triple]] = [("translational", Z_AXIS)]
    tries += [("rotational", axis) for axis in (_AXES[:1] if mesh.dim == 2 else _AXES)]
    found: list[Pair] = []
    allowed = TOLERANCE * mesh.extent
    for kind, axis in tries:
        for first, second in combinations(mesh.marker_names, 2):
            taken = {name for pair in found for name in (pair.first, pair.second)}
            if count[first] != count[second] or taken & {first, second}:
                continue
            going_on()
            pair, worst = _match_kind(
                mesh, first, second, kind, axis=axis, origin=(0.0, 0.0, 0.0), bound=2.0 * allowed
            )
            if pair is not None and worst <= allowed:
                found.append(pair)
    return found
