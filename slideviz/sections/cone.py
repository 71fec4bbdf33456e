"""The cone, a shape of sections: it opens along its axis from its apex."""

# ruff: noqa: ARG002  (every shape takes what any of them needs)

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.mesh.model import FloatArray
from slideviz.sections.around_axis import AboutAxis, Unrolled, patch_of
from slideviz.sections.round_number import round_middle, roundest
from slideviz.sections.shape import (
    DIGITS,
    FEW,
    Label,
    axis_word,
    triple,
    triple_words,
)

if TYPE_CHECKING:
    from slideviz.sections.model import Section

_ENDS = 0.01, 89.99
"""Half angles in degrees that a slider reaches."""
_NEAR = 0.03
"""The apex of one to start from may be so far from where it is wanted, as a part of the length."""


def _lines(section: Section) -> tuple[float, float]:
    """Return sine and cosine of the half angle."""
    angle = np.radians(section.half_angle_deg)
    return float(np.sin(angle)), float(np.cos(angle))


class Cone(AboutAxis):
    """The half of a cone along its axis; see `slideviz.sections.shape.Shape`."""

    terms = SECTION_SHAPES["cone"]
    in_plane = None
    directed = True

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return distances of points outwards from the cone, (n,); behind the apex, from it."""
        sin, cos = _lines(section)
        radius, height = np.hypot(along(0), along(1)), along(2)
        gap = radius * cos - height * sin
        return np.where(height * cos + radius * sin < 0.0, np.hypot(radius, height), gap)

    def quadric(self, section: Section) -> tuple[FloatArray, float]:
        """Return the weights w (3,) and c of the cone: radius and height are in one ratio.

        So they are on its other half, behind the apex; but along no line has the distance from
        this half more than one minimum, and its sign says which root is this half's.
        """
        sin, cos = _lines(section)
        return np.array([cos * cos, cos * cos, -sin * sin]), 0.0

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the half angles (n,) in degrees under which the apex sees points."""
        radius = np.hypot(section.along(points, 0), section.along(points, 1))
        angle = np.degrees(np.arctan2(radius, section.along(points, 2)))
        return np.asarray(np.clip(angle, *_ENDS))

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return a cone through the middle of points (n, 3), from one end of them to the other."""
        local = section.frame(points)
        radius, height = np.hypot(local[:, 0], local[:, 1]), local[:, 2]
        length = float(np.ptp(height))
        # Between inner and outer radius all along, where it can be.
        steep = np.degrees(np.arctan2(np.ptp(radius) / 2.0, length)) if length > 0 else 45.0
        angle = roundest(steep / 2.0, min(steep, self.size.usual), self.size.usual)
        middle = round_middle(radius) or float(radius.mean())
        at = float(height.min() + height.max()) / 2.0 - middle / np.tan(np.radians(angle))
        room = _NEAR * max(length, float(np.ptp(radius)))
        at = roundest(at - room, at + room, at)
        apex = np.asarray(section.origin) + at * section.basis[2]
        return replace(section, origin=triple(apex), half_angle_deg=angle)

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the apex is moved; infinity where the cone then opens backwards."""
        return float(np.linalg.norm(step)) if turned @ section.basis[2] > 0 else np.inf

    def describe(self, section: Section) -> str:
        """Return half angle, axis and apex in words."""
        return self._words(section, DIGITS, "from apex")

    def brief(self, section: Section) -> str:
        """Return half angle, axis and apex in few words."""
        return self._words(section, FEW, "from")

    def _words(self, section: Section, digits: int, apex: str) -> str:
        where = axis_word(section.direction, digits)
        if where in "xyz" and section.direction["xyz".index(where)] < 0:
            where = f"-{where}"
        at = triple_words(section.origin, digits)
        return f"cone {section.half_angle_deg:.6g}° about {where} {apex} {at}"

    def miss(self, section: Section, points: FloatArray) -> str:
        """Return between which half angles a cone would cut."""
        angles = self.positions(section, points)
        return (
            f"misses the mesh, which its apex sees at {angles.min():.4g} to {angles.max():.4g} "
            "degrees from its axis"
        )

    def laid(self, section: Section, opened: Unrolled, ahead: float | None) -> FloatArray:
        """Return the developed cone, the apex at 0; and the distance outwards.

        Lengths s from the apex are kept, and angles theta around the axis become theta sin(half
        angle) around the apex; that at ``ahead`` is to the right.
        """
        sin, cos = _lines(section)
        local = opened.local
        radius = np.hypot(local[:, 0], local[:, 1])
        length = local[:, 2] * cos + radius * sin
        angle = (opened.angle - (opened.middle if ahead is None else ahead)) * sin
        outwards = radius * cos - local[:, 2] * sin
        return np.stack([length * np.cos(angle), length * np.sin(angle), outwards], axis=1)

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return the middle angle of points."""
        return float(np.mean(patch_of(section, points).angles))

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        """Return the labels of the developed coordinates, by s (length from the apex) and theta."""
        return Label("s cos(θ sin α)", "s cos"), Label("s sin(θ sin α)", "s sin")

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        """Return a turn about the apex."""
        sin, _ = _lines(section)
        flat = np.eye(4)
        c, s = np.cos(angle * sin), np.sin(angle * sin)
        flat[:2, :2] = [[c, -s], [s, c]]
        return flat

    def places(self, section: Section, points: FloatArray) -> FloatArray:
        """Return angles, and lengths from the apex along the cone."""
        sin, cos = _lines(section)
        local = section.frame(points)
        length = local[:, 2] * cos + np.hypot(local[:, 0], local[:, 1]) * sin
        return np.column_stack([np.arctan2(local[:, 1], local[:, 0]), length])

    def surface(self, section: Section, places: FloatArray, size: float) -> FloatArray:
        """Return places of a cone with another half angle, as far from the apex."""
        turn, length, lean = places[:, 0], np.maximum(places[:, 1], 0.0), np.radians(size)
        radius = length * np.sin(lean)
        local = [radius * np.cos(turn), radius * np.sin(turn), length * np.cos(lean)]
        return np.asarray(np.asarray(section.origin) + np.column_stack(local) @ section.basis)

    def lean(self, section: Section) -> float:
        """Return the half angle."""
        return float(np.radians(section.half_angle_deg))

    def lever(self, section: Section, along: float) -> float:
        """Return the arc for a degree."""
        return float(np.radians(abs(along))) or 1.0

    def girth(self, section: Section, along: float) -> float:
        """Return the radius at a length from the apex."""
        return abs(along) * _lines(section)[0]
