"""Motions by a formula of the place: shifts, rotations, scales, and pushes from an axis.

Each begins where the motions before it have taken the boundary.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.displacement import Displacements
from slideviz.case.motions.motion import (
    Motion,
    MotionStart,
    Point,
    Target,
    axis_length,
    direction_words,
    number_texts,
    place_words,
    pronoun,
    require_dimension,
    require_positive,
    vector_words,
    without_brackets,
)
from slideviz.case.values import axis_text, read_axis, read_vector, vector_text
from slideviz.case.words import Word, Words, angle_deg, number
from slideviz.errors import CaseError
from slideviz.mesh.axis_frame import ordered_sum
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.terms import Numbers, Term, Texts, Vector

if TYPE_CHECKING:
    from slideviz.case.model import Case

_Z = (0.0, 0.0, 1.0)


class ByFormula(Motion):
    """A motion by a formula of the place, after the motions before it."""

    def shift(self, points: FloatArray) -> FloatArray:
        """Return the displacement (k, d) of points (k, d)."""
        raise NotImplementedError

    def change(
        self, points: FloatArray, nodes: IntArray, placed: Displacements | None
    ) -> FloatArray:
        return self.shift(points)


@frozen
class Translate(ByFormula):
    """Shift a marker by ``vector`` (d,), in the mesh's length unit."""

    marker: Target
    vector: Numbers

    kind_term = Term("translate")
    affine = True
    verbs = ("translate",)
    grammar = ("(BLADE, translate, dx, dy[, dz])",)
    rows = ("vector",)
    proportional = ("vector",)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        return cls(marker, read_vector(without_brackets(words), "the shift"))

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, (0.0,) * start.dim)

    def arguments(self) -> list[str]:
        return number_texts(*self.vector)

    def described(self, dim: int, extent: float) -> str:
        return f"translate by {place_words(self.vector, extent)}"

    def label(self, form: str, *, exact: bool) -> str:
        moved = [axis for axis, value in enumerate(self.vector) if value]
        if len(moved) == 1 and not exact:
            return f"translate {'xyz'[moved[0]]} {self.vector[moved[0]]:+.4g}"
        return f"translate {vector_words(self.vector, form)}"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        count = len(self.vector)
        yield from require_dimension(count, mesh.dim, f"the shift has {count} components")

    def shift(self, points: FloatArray) -> FloatArray:
        return np.broadcast_to(np.array(self.vector, np.float64), points.shape)


class _AboutPoint(ByFormula):
    """A motion about a point; where that is the centroid, several markers have one in common."""

    point: Point

    depends_on_place = True
    stays_at: ClassVar[Texts] = ("centroid", "point")

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        if self.point != "centroid":
            said = f"the point has {len(self.point)} coordinates"
            yield from require_dimension(len(self.point), mesh.dim, said)

    def as_one(self, points: FloatArray) -> Self:
        if self.point != "centroid":
            return self
        return replace(self, point=tuple(points.mean(axis=0).tolist()))

    @property
    def joins_zones(self) -> bool:
        return self.point == "centroid"


@frozen
class Rotate(_AboutPoint):
    """Rotate a marker by ``angle_deg`` about an axis through ``point`` (right-handed; any length).

    In 2D the axis is z: positive angles turn counter-clockwise. Several markers have one common
    centroid.
    """

    marker: Target
    angle_deg: float
    point: Point = "centroid"
    axis: Vector = (0.0, 0.0, 1.0)

    kind_term = Term("rotate")
    affine = True
    verbs = ("rotate",)
    grammar = (
        "(BLADE, rotate, degrees, centroid)            counter-clockwise; in 3D about z",
        "(BLADE, rotate, degrees, px, py)              about a point, in 2D",
        "(BLADE, rotate, degrees, AXIS, centroid)      AXIS: x, y, z or three numbers",
        "(BLADE, rotate, degrees, AXIS, px, py, pz)",
    )
    rows = ("angle",)
    proportional = ("angle_deg",)
    words = (("degrees", "angle_deg"),)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        if not items:
            raise CaseError("the angle is missing; write rotate, angle in degrees, centroid")
        angle = angle_deg(items[0].text)
        items = items[1:]
        at_centroid = bool(items) and _is_centroid(items[-1])
        # An axis is there if more follows than a point in the plane.
        n_axis = axis_length(items, 0, 3)
        place = items[n_axis:]
        in_space = (2, 3) if n_axis else (2,)
        if len(place) not in ((1,) if at_centroid else in_space):
            raise CaseError(
                "expected after the angle: the axis (x, y, z or three numbers; not in 2D) and then "
                "centroid or the point"
            )
        axis = read_axis(items[:n_axis]) if n_axis else _Z
        point: Point = "centroid" if at_centroid else read_vector(place, "the point")
        return cls(marker, angle, point, axis)

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        if start.machine is None:
            return cls(marker, 0.0)
        axis, origin = start.machine
        return cls(marker, 0.0, origin[: start.dim], axis)

    def arguments(self) -> list[str]:
        axis = [axis_text(self.axis)]
        if axis == ["z"] and (self.point == "centroid" or len(self.point) == 2):
            axis = []
        return [*number_texts(self.angle_deg), *axis, _point_text(self.point)]

    def described(self, dim: int, extent: float) -> str:
        through = f"{direction_words(self.axis)} through " if dim == 3 else ""
        place = place_words(self.point, extent, its=pronoun(self.marker))
        return f"rotate by {self.angle_deg:.5g}° about {through}{place}"

    def label(self, form: str, *, exact: bool) -> str:
        return f"rotate {self.angle_deg:+{form}}°"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        yield from super().problems(case, mesh, place)
        yield from _axis_problems(self.axis, mesh.dim)

    def shift(self, points: FloatArray) -> FloatArray:
        return rotated(points - _centre(self.point, points), self.angle_deg, self.axis)

    def turned(self, part: float) -> Motion:
        return replace(self, angle_deg=part * self.angle_deg)


@frozen
class Scale(_AboutPoint):
    """Scale a marker about ``point`` by ``factors``: one for all axes, or one for each."""

    marker: Target
    factors: Numbers
    point: Point = "centroid"

    kind_term = Term("scale")
    affine = True
    verbs = ("scale",)
    grammar = (
        "(BLADE, scale, FACTORS, centroid)             FACTORS: one, or one for each axis",
        "(BLADE, scale, FACTORS, (px, py[, pz]))",
    )
    rows = ("factors",)
    ratios = ("factors",)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        if items and _is_centroid(items[-1]):
            factors = items[:-1]
            place: Words = []
        else:
            opened = [i for i, word in enumerate(words) if word.is_sign("(")]
            if opened and words[-1].is_sign(")"):
                n_factors = len(without_brackets(words[: opened[-1]]))
            else:
                n_factors = {3: 1, 6: 3}.get(len(items), 0)
            factors = items[:n_factors]
            place = items[n_factors:]
            if len(place) not in (2, 3):
                raise CaseError(
                    "expected one factor or one for each axis, then centroid or the point; put the "
                    "point in brackets: scale, 1.1, (0, 0, 0)"
                )
        if len(factors) not in (1, 2, 3):
            raise CaseError(f"{len(factors)} factors are given; expected one, or one for each axis")
        values = tuple(number(word.text) for word in factors)
        require_positive(min(values))
        return cls(marker, values, read_vector(place, "the point") if place else "centroid")

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        return cls(marker, (1.0,) * start.dim)

    def arguments(self) -> list[str]:
        return [*number_texts(*self.factors), _point_text(self.point)]

    def described(self, dim: int, extent: float) -> str:
        place = place_words(self.point, extent, its=pronoun(self.marker))
        return f"scale by {_factor_words(self.factors)} about {place}"

    def label(self, form: str, *, exact: bool) -> str:
        same = len(set(self.factors)) == 1 and not exact
        return f"scale {_factor_words(self.factors[:1] if same else self.factors, form)}"

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        yield from super().problems(case, mesh, place)
        count = len(self.factors)
        if count not in (1, mesh.dim):
            yield (
                f"{count} factors are given, and the mesh has {mesh.dim} dimensions; give 1 or "
                f"{mesh.dim}"
            )

    def shift(self, points: FloatArray) -> FloatArray:
        arm = points - _centre(self.point, points)
        return arm * (np.array(self.factors, np.float64) - 1.0)


@frozen
class Radial(_AboutPoint):
    """Push a marker away from an axis: each radius r becomes ``factor`` r + ``distance``.

    ``factor`` 1.03 is 3 % outwards. The axis goes through ``point`` (d,) along ``axis``; in 2D it
    is z. ``distance`` is in the mesh's length unit. Nodes on the axis stay on it.
    """

    marker: Target
    factor: float = 1.0
    distance: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)
    point: Numbers = (0.0, 0.0, 0.0)

    kind_term = Term("push radially")
    verbs = ("radial",)
    grammar = (
        "(HUB, radial, FACTOR, dr, AXIS, (px, py, pz))  r becomes FACTOR r + dr; 2D: no AXIS",
    )
    rows = ("percent", "distance")
    stays_at = ("point",)
    proportional = ("distance",)
    ratios = ("factor",)
    words = (("dr", "distance"),)

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        items = without_brackets(words)
        n_axis = axis_length(items, 2, 5)
        place = items[2 + n_axis :]
        if len(items) < 4 or len(place) != (3 if n_axis else 2):
            raise CaseError(
                "expected the factor of the radius, the distance, the axis (x, y, z or three "
                "numbers) and a point on it; in 2D no axis: radial, 1.03, 0, z, (0, 0, 0)"
            )
        factor = number(items[0].text)
        require_positive(factor)
        axis = read_axis(items[2 : 2 + n_axis]) if n_axis else _Z
        point = read_vector(place, "the point")
        return cls(marker, factor, number(items[1].text), axis, point)

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        axis, origin = start.machine or (_Z, (0.0, 0.0, 0.0))
        return cls(marker, 1.0, 0.0, axis, origin[: start.dim])

    def arguments(self) -> list[str]:
        axis = [axis_text(self.axis)] if len(self.point) == 3 else []
        return [*number_texts(self.factor, self.distance), *axis, _point_text(self.point)]

    def described(self, dim: int, extent: float) -> str:
        return f"push radially by {self._push()}"

    def label(self, form: str, *, exact: bool) -> str:
        by = f"× {self.factor:.15g} {self.distance:+.15g}" if exact else self._push()
        return f"radially {by}"

    def _push(self) -> str:
        parts = [f"{100.0 * (self.factor - 1.0):+.4g} %"] if self.factor != 1.0 else []
        parts += [f"{self.distance:+.4g}"] if self.distance or not parts else []
        return " and ".join(parts)

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        yield from super().problems(case, mesh, place)
        yield from _axis_problems(self.axis, mesh.dim)

    def shift(self, points: FloatArray) -> FloatArray:
        arm = points - np.array(self.point, np.float64)
        if arm.shape[1] == 3:
            unit = np.array(self.axis, np.float64) / math.hypot(*self.axis)
            # Component by component: the same bits whatever the number of points.
            along = arm[:, 0] * unit[0] + arm[:, 1] * unit[1] + arm[:, 2] * unit[2]
            arm = arm - along[:, None] * unit
        radius = np.sqrt((arm * arm).sum(axis=1))
        # On the axis there is no direction to be pushed into.
        outwards = np.divide(self.distance, radius, out=np.zeros_like(radius), where=radius > 0)
        return arm * ((self.factor - 1.0) + outwards)[:, None]


def rotated(arm: FloatArray, angle_deg: float, axis: Vector) -> FloatArray:
    """Return the change of vectors (k, d) by a rotation (Rodrigues).

    ``sin(a) k x v + (1 - cos(a)) k x (k x v)``, with ``1 - cos(a) = 2 sin(a/2)^2``, which keeps
    all digits of a small angle; exactly zero for a zero angle.
    """
    angle = math.radians(angle_deg)
    sine = math.sin(angle)
    versine = 2.0 * math.sin(0.5 * angle) ** 2
    length = math.hypot(*axis)
    a, b, c = np.divide(axis, length).tolist()
    if arm.shape[1] == 2:
        x, y = arm.T
        return np.stack([-sine * c * y - versine * x, sine * c * x - versine * y], axis=1)
    x, y, z = arm.T
    across = (b * z - c * y, c * x - a * z, a * y - b * x)
    u, v, w = across
    twice = (b * w - c * v, c * u - a * w, a * v - b * u)
    return np.stack([sine * p + versine * q for p, q in zip(across, twice, strict=True)], axis=1)


def _centre(point: Point, points: FloatArray) -> FloatArray:
    if point == "centroid":
        return ordered_sum(points) / max(1, len(points))
    return np.array(point)


def _is_centroid(word: Word) -> bool:
    return not word.quoted and word.text.lower() == "centroid"


def _point_text(point: Point) -> str:
    return point if isinstance(point, str) else vector_text(point)


def _factor_words(values: Numbers, form: str = ".4g") -> str:
    return " × ".join(format(value, form) for value in values)


def _axis_problems(axis: Vector, dim: int) -> Iterator[str]:
    if dim == 2 and any(axis[:2]):
        yield f"the axis {axis} leaves the plane; in 2D leave the axis out"
