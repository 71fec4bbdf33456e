"""Motions of an airfoil's sides: bumps (Hicks and Henne 1978) and CST (Kulfan 2008), along y."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from slideviz import terms
from slideviz.argument_types import frozen
from slideviz.case.displacement import Displacements, NodesOn, PlacedDisplacements
from slideviz.case.motions.motion import (
    Motion,
    MotionStart,
    Target,
    applies_to,
    marker_words,
    nodes_moved,
    number_texts,
    vector_words,
    without_brackets,
)
from slideviz.case.words import Words, counted, number
from slideviz.errors import CaseError, Doubt, Message, not_one_of
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.topology import vertex_normals
from slideviz.terms import SIDES, Range, Term, WholeNumbers

if TYPE_CHECKING:
    from typing import Self

    from slideviz.case.model import Case

EPS = 1e-16  # what SU2 adds to coordinates of `surface_bump`
LEVEL = 1e-12
"""A node is on neither side where y is less than this part of its normal: that is rounding."""
MOST_TERMS = 100  # most terms of an airfoil's shape function
WHOLE_CHORD = (0.0, 1.0)


class OnAirfoil(Motion):
    """A motion of nodes along y, from their undeformed places, whatever motions come before."""

    height: float
    chord: Range
    form: ClassVar[str]
    """The words after the verb, for messages, with the place of the ``side``."""

    proportional = ("height",)
    chosen = ("term", "chord")

    def shape(self, t: FloatArray) -> FloatArray:
        """Return the displacement (m,) by a height of 1 at parts t (m,) of the chord, 0 to 1."""
        raise NotImplementedError

    def direction(self, mesh: Mesh, markers: list[str], nodes: IntArray) -> FloatArray | float:
        """Return the direction along y, -1 to 1, of the ``nodes`` (m,) of some markers."""
        return 1.0

    @property
    def side_words(self) -> str:
        """Return the side that moves, in words."""
        return "both sides"

    def height_words(self, by: str, form: str) -> str:
        """Return what moves, and ``by`` how much, in words."""
        raise NotImplementedError

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, 0.0, chord=start.chord)  # type: ignore[call-arg]

    def described(self, dim: int, extent: float) -> str:
        return f"raise {self.height_words(f'by {self.height:.4g}', '.4g')}"

    def label(self, form: str, *, exact: bool) -> str:
        words = self.height_words(f"{self.height:+{form}}", form)
        if exact and self.chord != WHOLE_CHORD:
            return f"{words}, chord {vector_words(self.chord, form)}"
        return words

    def doubts(self, mesh: Mesh, markers: Sequence[str]) -> Iterator[Doubt]:
        x = mesh.points[mesh.nodes_of(markers), 0]
        low, high = self.chord
        size = np.ptp(x)
        covered = np.ptp(np.clip(self.chord, x.min(), x.max()))
        if covered < 0.5 * size or high - low > 2.0 * size:
            yield Doubt(
                f"the chord goes from x = {low:g} to {high:g}, but {' and '.join(markers)} from "
                f"{x.min():.6g} to {x.max():.6g}",
                f"end its MOTION with {x.min():.6g}, {x.max():.6g} if all of it is meant: "
                f"{self.on_chord(x).text}",
            )

    def on_chord(self, x: FloatArray) -> Self:
        """Return the motion with the chord of nodes at ``x`` (m,), to six digits."""
        return replace(self, chord=(float(f"{x.min():.6g}"), float(f"{x.max():.6g}")))

    @classmethod
    def placed(
        cls, case: Case, mesh: Mesh, on: NodesOn, problems: list[Message]
    ) -> PlacedDisplacements:
        found: PlacedDisplacements = {}
        for place, motion in enumerate(case.motions):
            markers = [name for name in on if applies_to(motion, name)]
            if not markers or not isinstance(motion, OnAirfoil):
                continue
            nodes = nodes_moved(motion, on)
            low, high = motion.chord
            t = (mesh.points[nodes, 0] - low) / (high - low)
            along = (t > 0.0) & (t < 1.0)
            shape = np.where(along, motion.shape(np.where(along, t, 0.0)), 0.0)
            shape = shape * motion.direction(mesh, markers, nodes)
            vectors = np.zeros((len(nodes), mesh.dim))
            vectors[:, 1] = motion.height * shape
            found[place] = Displacements(nodes, vectors)
            if not shape.any():
                side = f" on its {motion.side} side" if isinstance(motion, OneSided) else ""
                rule = (
                    f"motion {place + 1}: no node of {marker_words(motion.marker)} is{side} "
                    f"between x = {low:g} and {high:g}; give x of the leading and of the trailing "
                    "edge"
                )
                problems.append(Message(rule))
        return found

    @classmethod
    def numbers(
        cls, words: Words, before: int, allowed: WholeNumbers, side: str = ""
    ) -> tuple[list[float], Range]:
        """Return ``before`` numbers of shape and height, and the two of the chord, in words.

        Raises CaseError with a sentence where there are not as many as ``allowed``, or the chord is
        empty.
        """
        values = [number(word.text) for word in words]
        if len(values) not in allowed:
            hint = "; decimals are written with a point" if len(values) > 2 else ""
            expected = cls.form.format(side=side or "upper")
            raise CaseError(f"{counted(len(values), 'number')} given; expected {expected}{hint}")
        low, high = (*values[before:], *WHOLE_CHORD)[:2]
        if not low < high:
            raise CaseError(
                f"the chord goes from x = {low:g} to {high:g}; give the lower one first"
            )
        return values[:before], (low, high)


class OneSided(OnAirfoil):
    """A motion of one side of an airfoil; the upper one is where normals point to +y."""

    side: terms.Side

    @property
    def side_words(self) -> str:
        return f"{self.side} side"

    def direction(self, mesh: Mesh, markers: list[str], nodes: IntArray) -> FloatArray | float:
        wanted = 1.0 if self.side == "upper" else -1.0
        on_side = side_of(normals_at(mesh, markers, nodes)) == wanted
        return np.where(on_side, self.along_y(wanted), 0.0)

    def along_y(self, side: float) -> float:
        """Return the direction along y of a positive height on the ``side`` 1 or -1."""
        return 1.0

    @classmethod
    def sided_numbers(cls, words: Words, before: int) -> tuple[terms.Side, list[float], Range]:
        """Return the side, and what `numbers` returns of the words after it."""
        items = without_brackets(words)
        side = next((s for s in SIDES if items[:1] and s == items[0].text.lower()), None)
        values, chord = cls.numbers(items[1:], before, (before, before + 2), side or "")
        if side is None:
            raise CaseError(not_one_of(items[0].text, SIDES))
        return side, values, chord

    def arguments(self) -> list[str]:
        chord = () if self.chord == WHOLE_CHORD else self.chord
        return [self.side, *self.shape_texts(), *number_texts(self.height, *chord)]

    def shape_texts(self) -> list[str]:
        """Return the texts between side and height."""
        raise NotImplementedError

    def design_name(self) -> str:
        return f"{super().design_name()}.{self.side}"


class _WithPeak(OnAirfoil):
    """A motion whose shape is a bump of Hicks and Henne, 1 at its peak."""

    peak: float

    def height_words(self, by: str, form: str) -> str:
        return f"{self.side_words} {by} at {format(100.0 * self.peak, form)} % chord"

    def shape(self, t: FloatArray) -> FloatArray:
        return hicks_henne(t, self.peak)


@frozen
class HicksHenne(_WithPeak, OneSided):
    """Raise one side of an airfoil outwards by a bump (Hicks and Henne 1978).

    It is ``height`` at ``peak``, a part of the ``chord`` between two x, and 0 at its ends. Nodes
    move along y, from their undeformed places, whatever motions come before; the upper side is
    where normals into the flow point to +y.
    """

    marker: Target
    height: float
    peak: float = 0.5
    side: terms.Side = field(default="upper", metadata=SIDES)
    chord: Range = WHOLE_CHORD

    kind_term = Term("Hicks-Henne")
    verbs = ("hicks-henne",)
    grammar = (
        "(WING, hicks-henne, SIDE, peak, h[, x0, x1])  SIDE: upper or lower; peak: part of chord",
    )
    rows = ("raised", "side", "peak", "chord")
    height_row = ("Outwards by", "outwards, the lower side down,")
    form = "hicks-henne, {side}, peak, height, or besides x0, x1 of the chord"

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        side, (peak, height), chord = cls.sided_numbers(words, 2)
        require_peak(peak)
        return cls(marker, height, peak, side, chord)

    def shape_texts(self) -> list[str]:
        return number_texts(self.peak)

    def described(self, dim: int, extent: float) -> str:
        return f"move {self.height_words(f'outwards by {self.height:.4g}', '.4g')}"

    def along_y(self, side: float) -> float:
        return side


@frozen
class Cst(OneSided):
    """Add ``height`` times a class and shape function to y of one side of an airfoil (Kulfan 2008).

    The function is the square root of t times (1 - t), times Bernstein polynomial k of n (from 1)
    of ``term``, with t from 0 to 1 along the ``chord``; otherwise as `HicksHenne`.
    """

    marker: Target
    height: float
    term: tuple[int, int] = (1, 1)
    side: terms.Side = field(default="upper", metadata=SIDES)
    chord: Range = WHOLE_CHORD

    kind_term = Term("airfoil by CST")
    verbs = ("cst",)
    grammar = (
        "(WING, cst, SIDE, k, n, h[, x0, x1])          term k of n; chord x0 to x1, else 0 to 1",
    )
    rows = ("raised", "side", "term", "chord")
    form = "cst, {side}, k, n, height, or besides x0, x1 of the chord"

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        side, (k, n, height), chord = cls.sided_numbers(words, 3)
        return cls(marker, height, term_of(k, n), side, chord)

    def shape_texts(self) -> list[str]:
        return [str(value) for value in self.term]

    def height_words(self, by: str, form: str) -> str:
        k, n = self.term
        return f"{self.side_words} {by} × CST {k} of {n}"

    def shape(self, t: FloatArray) -> FloatArray:
        return kulfan(t, *self.term)

    def design_name(self) -> str:
        return f"{super().design_name()}.{self.term[0]}"


@frozen
class Bump(_WithPeak):
    """Raise all sides of an airfoil towards +y by a bump; otherwise as `HicksHenne`."""

    marker: Target
    height: float
    peak: float = 0.5
    chord: Range = WHOLE_CHORD

    kind_term = Term("bump upwards")
    verbs = ("bump",)
    grammar = ("(WING, bump, peak, h, x0, x1)                 both sides, towards +y",)
    rows = ("raised", "peak", "chord")
    form = "bump, peak, height, x0, x1"

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        (peak, height), chord = cls.numbers(without_brackets(words), 2, (4,))
        require_peak(peak)
        return cls(marker, height, peak, chord)

    def arguments(self) -> list[str]:
        return number_texts(self.peak, self.height, *self.chord)


def hicks_henne(x: FloatArray, peak: float) -> FloatArray:
    """Return ``sin³(π x^e)`` (m,), which is 1 at ``peak``; 0 where x is below 0."""
    x = np.maximum(x, 0.0)
    exponent = math.log10(0.5) / math.log10(peak)
    return np.where(x > 1e-15, np.sin(np.pi * x**exponent) ** 3, 0.0)


def kulfan(x: FloatArray, k: float, n: float) -> FloatArray:
    """Return Bernstein polynomial k of n (from 1), times the class function ``√x (1 - x)``: (m,).

    Where x is below 0, it counts as 0.
    """
    term, count = term_of(k, n)
    i = term - 1
    degree = count - 1
    x = np.maximum(x, 0.0)
    shape = math.comb(degree, i) * x**i * (1.0 - x) ** (degree - i)
    return np.sqrt(x) * (1.0 - x) * shape


def surface_bump(x: FloatArray, start: float, end: float, peak: float) -> FloatArray:
    """Return a Hicks-Henne bump (m,) between two x, 1 at ``peak``; 0 elsewhere."""
    length = end - start
    if not start < peak < end:
        raise CaseError(
            f"the peak is at x = {peak:g}; it must lie between {start:g} and {end:g}, where the "
            "bump begins and ends"
        )
    exponent = math.log10(0.5) / math.log10((peak - start + EPS) / length)
    along = x - start
    inside = (along > 0.0) & (along < length)
    t = np.where(inside, along + EPS, 0.0) / length
    return np.where(inside, np.sin(np.pi * t**exponent) ** 3, 0.0)


def require_peak(peak: float) -> None:
    """Raise CaseError where a bump cannot have its peak at x = ``peak`` of a chord."""
    if not 0.0 < peak < 1.0:
        raise CaseError(f"the peak is at x = {peak:g}; it must lie between 0 and 1")


def term_of(k: float, n: float) -> tuple[int, int]:
    """Return term k of n of an airfoil's shape as integers; raises CaseError if there is none."""
    if k != int(k) or n != int(n) or not 1 <= k <= n <= MOST_TERMS:
        raise CaseError(
            f"CST term {k:g} of {n:g} is out of range; write whole numbers with "
            f"1 <= k <= n <= {MOST_TERMS}"
        )
    return int(k), int(n)


def normals_at(mesh: Mesh, markers: Iterable[str], nodes: IntArray) -> FloatArray:
    """Return normals (m, d) into the mesh at nodes (m,) of some markers; zero at others.

    A node of several of the markers has the normal of the last one in the mesh, as in SU2.
    """
    out = np.zeros((len(nodes), mesh.dim))
    boundary = boundary_of(mesh)
    for index, name in enumerate(boundary.names):
        if name in markers:
            at, normals = vertex_normals(mesh.points, boundary.facets[boundary.marker == index])
            place = np.searchsorted(nodes, at)
            out[place] = -normals
    return out


def side_of(normals: FloatArray) -> FloatArray:
    """Return 1 for an airfoil's upper side, -1 for the lower, 0 if level; normals (m, d): (m,)."""
    upwards = normals[:, 1]
    level = np.abs(upwards) <= LEVEL * np.linalg.norm(normals, axis=1)
    return np.where(level, 0.0, np.sign(upwards))
