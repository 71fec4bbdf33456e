"""What the kinds of span have in common: the number from 0 at the root to 1 at the tip of a blade.

Coordinates (n, 3) of a kind say where a point is: along the flow, outwards, and across both. About
an axis (`slideviz.machine.span_field`) these are ``(z, r, theta)``; along a direction
(`slideviz.machine.straight_span`) they are the lengths ``(m, h, t)``. Sections of constant span lie
flat in the plane of (m', third coordinate).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.axis_frame import Triple
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.terms import Vector

Distances = tuple[FloatArray, FloatArray, FloatArray]


class Curves(ABC):
    """Curves of constant span, and the maps to (m', third coordinate, span) and back."""

    field: Span

    @abstractmethod
    def plane(self, coords: FloatArray) -> FloatArray:
        """Return (m', third coordinate, span), (n, 3), of coordinates (n, 3)."""

    @abstractmethod
    def length(self, plane: FloatArray) -> FloatArray:
        """Return the arc length m (n,) at (m', third coordinate, span), (n, 3)."""

    @abstractmethod
    def at_length(self, m: FloatArray, span: FloatArray) -> FloatArray:
        """Return m' (n,) at arc lengths m (n,) of the curves at spans (n,)."""

    @abstractmethod
    def growth(self, m_prime: FloatArray, span: FloatArray) -> FloatArray:
        """Return the derivative dm / dm' (n,) at m' of the curves at spans (n,)."""

    @abstractmethod
    def traced(self, plane: FloatArray) -> FloatArray:
        """Return the first two coordinates (n, 2) of (m', third coordinate, span), (n, 3)."""

    @abstractmethod
    def coords_and_slopes(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return coordinates (n, 3), and their derivatives (n, 3, 2) by (m', third coordinate)."""

    def coords(self, plane: FloatArray) -> FloatArray:
        """Return coordinates (n, 3) of (m', third coordinate, span), (n, 3)."""
        return self.coords_and_slopes(plane)[0]


class Span(ABC):
    """The span of points between a root, or hub, and a tip, or shroud."""

    axis: Triple
    origin: Triple
    middle: float
    radius: float
    holes: IntArray
    """The axis or direction and a point on it; the middle of the third coordinate; the length of a
    unit of the third coordinate at the walls; (t, 4): triangles that close holes of the walls."""
    words: ClassVar[tuple[str, str]]  # what the first two coordinates are called
    ends: ClassVar[tuple[str, str]] = ("hub", "shroud")  # what both ends are called

    @property
    def about(self) -> tuple[Vector, Vector] | None:
        """Return the axis about which the span goes, and a point on it; None along a direction."""
        return self.axis, self.origin

    @property
    @abstractmethod
    def curves(self) -> Curves:
        """Return curves of constant span that begin in the middle of the passage."""

    @property
    @abstractmethod
    def revolved(self) -> bool:
        """Return whether the third coordinate does not matter for the span."""

    @property
    @abstractmethod
    def level_scale(self) -> float:
        """Return the inverse of the most that the distances from walls change per length."""

    @property
    @abstractmethod
    def first_coords(self) -> FloatArray:
        """Return the coordinates (1, 3) of the place from which `curves` count."""

    @abstractmethod
    def curves_through(self, start: FloatArray) -> Curves:
        """Return curves with m' = 0 at ``start`` (2,), the first two coordinates of a point."""

    @abstractmethod
    def meridional(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (n, 3) of points (n, 3)."""

    @abstractmethod
    def points(self, coords: FloatArray) -> FloatArray:
        """Return the points (n, 3) of coordinates (n, 3)."""

    @abstractmethod
    def slopes(self, coords: FloatArray) -> FloatArray:
        """Return the derivative (n, 3, 3) of `points` by the coordinates (n, 3)."""

    @abstractmethod
    def girth(self, coords: FloatArray) -> FloatArray:
        """Return the length (n,) of a unit of the third coordinate at coordinates (n, 3)."""

    @abstractmethod
    def branch(self, coords: FloatArray) -> FloatArray:
        """Return the coordinates (n, 3), the third one as near to the middle as it can be."""

    @abstractmethod
    def shift(self, pair: Pair) -> float:
        """Return by how much the third coordinate grows from the first side of a period on."""

    @abstractmethod
    def begin(self, spans: FloatArray) -> FloatArray:
        """Return coordinates (s, 3) at spans (s,), on a line between the first ends of walls."""

    @abstractmethod
    def distances(self, coords: FloatArray) -> list[Distances]:
        """Return for hub and shroud distances (n,), their slopes (n, d), and how oblique they are.

        Distances are negative beyond a wall. Oblique is the sine (n,) of the angle between the way
        to the wall and its normal: it is not small where the wall has ended. d is 2 where the third
        coordinate does not matter; else the slope's third number is that along a length.
        """

    def span(self, coords: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the span (n,) at coordinates (n, 3), and its derivative (n, 3) by them.

        Beyond a wall it is below 0, or above 1.
        """
        return self.span_of(self.distances(coords))

    def span_of(self, ends: Sequence[Distances]) -> tuple[FloatArray, FloatArray]:
        """Return the same as `span`, of `distances`."""
        (hub, to_hub, _), (shroud, to_shroud, _) = ends
        total = hub + shroud
        total = np.where(np.abs(total) > 0.0, total, 1.0)
        slope = (shroud[:, None] * to_hub - hub[:, None] * to_shroud) / total[:, None] ** 2
        out = np.zeros((len(slope), 3))
        out[:, : slope.shape[1]] = slope
        out[:, 2] *= self.radius
        return hub / total, out


def facets_of(mesh: Mesh, name: str) -> IntArray:
    """Return the facets (f, 4) of a boundary; raises MeshError where it is unknown or has none."""
    boundary = boundary_of(mesh)
    mesh.marker(name)  # which knows what to say of an unknown one
    facets = boundary.facets[boundary.marker == boundary.names.index(name)]
    if not len(facets):
        raise MeshError(f"{mesh.name}: boundary {name!r} has no facets, so there is no span")
    return facets
