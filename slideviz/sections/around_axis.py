"""The common part of shapes about an axis: straight lines turned about it, so they lie flat.

Such a shape is known by one of its lines: how far it is from the axis, and how it leans. The angle
around the axis is unrolled, and torn where there is most room.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from slideviz.case.section_shapes import Size
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.sections.polygons import Polygons
from slideviz.sections.round_number import round_middle
from slideviz.sections.shape import Shape

if TYPE_CHECKING:
    from slideviz.sections.model import Section

TURN = 2.0 * np.pi
_WHOLE = np.radians(300.0)
"""What is cut over more than this is a whole ring."""
_HOLE = 0.1
"""What is held lies so near to the cut, as a part of its diagonal."""
_MOST = 400
"""Other places to hold it by: enough for one of them to be in any detail that is looked at."""


class Unrolled(NamedTuple):
    """Polygons around an axis, opened at the seam: the points on each side of it.

    Attributes
    ----------
    local : (p, 3) float64
        The points in the section's frame.
    angle : (p,) float64
        Around its axis in radians; none of the polygons is torn.
    corners : (q,) int64
        The point of each corner.
    middle : float
        That of the angles.
    """

    local: FloatArray
    angle: FloatArray
    corners: IntArray
    middle: float


def unrolled(section: Section, polygons: Polygons, near: float | None) -> Unrolled:
    """Return polygons about the axis of a section, of which there are some, opened.

    Their middle is nearest to the angle ``near`` or, left out, within half a turn of 0; the seam
    lies in the middle of the largest angle without points.
    """
    local = section.frame(polygons.points)
    angle = np.arctan2(local[:, 1], local[:, 0])
    # Corners within half a turn of the first corner of their polygon, seam or not.
    corner = angle[polygons.connectivity]
    first = np.repeat(corner[polygons.offsets[:-1]], polygons.sizes)
    corner = first + _wrapped(corner - first)
    middle = np.add.reduceat(corner, polygons.offsets[:-1]) / polygons.sizes
    turns = -np.floor((middle - _seam(angle)) / TURN)
    corner += TURN * np.repeat(turns, polygons.sizes)
    centre = (corner.min() + corner.max()) / 2.0
    shift = TURN * np.round(((near or 0.0) - centre) / TURN)
    corner += shift
    turn = np.round((corner - angle[polygons.connectivity]) / TURN).astype(np.int64)
    span = int(np.ptp(turn)) + 1
    keys, corners = np.unique(polygons.connectivity * span + turn - turn.min(), return_inverse=True)
    node, extra = np.divmod(keys, span)
    opened = angle[node] + TURN * (extra + turn.min())
    return Unrolled(local[node], opened, corners, float(centre + shift))


def _wrapped(angle: FloatArray) -> FloatArray:
    """Return angles in -pi to pi."""
    return angle - TURN * np.round(angle / TURN)


def _seam(angle: FloatArray) -> float:
    """Return the middle of the largest gap between angles on the circle."""
    turned = np.sort(angle)
    gaps = np.diff(turned, append=turned[0] + TURN)
    widest = int(np.argmax(gaps))
    return float(turned[widest] + gaps[widest] / 2.0)


PlaceOnSection = tuple[float, float]
"""A place on a section of any size: its angle in radians, and how far along its lines it is."""


@dataclass(frozen=True, eq=False)
class Patch:
    """The part of a section about an axis in a mesh, or beside the mesh where nothing is cut.

    Attributes
    ----------
    angles, along : (float, float)
        From where to where it reaches, in radians and in the length unit; angles rise.
    middle : (float, float)
        Where it is held: in its middle or, where a hole is there, at the cut nearest to that.
    places : (k, 2) float64
        Places of the cut, with angles as those of the patch.
    """

    angles: tuple[float, float]
    along: tuple[float, float]
    middle: PlaceOnSection
    places: FloatArray

    @property
    def whole(self) -> bool:
        """Tell whether the part goes all the way round."""
        return self.angles[1] - self.angles[0] > _WHOLE


class AboutAxis(Shape):
    """A shape about an axis with a size that its handle drags; see `Shape`."""

    handle = "pull"

    # What differs, beside what `Shape` leaves open ------------------------------------

    @abstractmethod
    def quadric(self, section: Section) -> tuple[FloatArray, float]:
        """Return w (3,) and c: the surface is where w · (x², y², z²) = c in its frame."""

    @abstractmethod
    def laid(self, section: Section, opened: Unrolled, ahead: float | None) -> FloatArray:
        """Return points (p, 3) laid flat (see `slideviz.sections.shape.Shape.flatten`)."""

    @abstractmethod
    def places(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the places of points (n, 3): angle in radians and length, (n, 2)."""

    @abstractmethod
    def surface(self, section: Section, places: FloatArray, size: float) -> FloatArray:
        """Return places (k, 2) of a section with another size, in space (k, 3)."""

    @abstractmethod
    def lean(self, section: Section) -> float:
        """Return the angle in radians between the lines of the surface and its axis."""

    @abstractmethod
    def lever(self, section: Section, along: float) -> float:
        """Return how far a place at a length along the surface moves for one unit of size."""

    @abstractmethod
    def girth(self, section: Section, along: float) -> float:
        """Return the radius at a length along the surface."""

    # What follows ----------------------------------------------------------------------

    @property
    def size(self) -> Size:
        """Return the row of the size: label, unit and range."""
        assert self.terms.size is not None
        return self.terms.size

    def crossings(
        self, section: Section, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return where edges cross the surface, (k,).

        Along an edge the weighted squares are a parabola, so the crossing is known exactly. Of
        its two roots, the distance changes its sign at one as it does from end to end.
        """
        weights, total = self.quadric(section)
        used = weights != 0.0
        rows, weight = section.basis[used], weights[used]
        p, d = (edges[0] - np.asarray(section.origin)) @ rows.T, edges[1] @ rows.T
        square, slope = np.sum(weight * d * d, axis=1), np.sum(weight * p * d, axis=1)
        rest = np.sum(weight * p * p, axis=1) - total
        root = np.sqrt(np.maximum(slope**2 - square * rest, 0.0))
        before, after = level
        sign = np.where(after > before, 1.0, -1.0)
        # Of the two forms of the root, the one that does not subtract like numbers.
        stable = sign * slope > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(stable, -rest / (slope + sign * root), (sign * root - slope) / square)
        return np.asarray(np.clip(np.nan_to_num(found), 0.0, 1.0))

    def position(self, section: Section) -> float:
        """Return the size: a radius, or a half angle."""
        return section.size

    def at_position(self, section: Section, value: float) -> Section:
        """Return the section with another size; CaseError where there is no such size."""
        return section.sized(value)

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return a section of a round size, through about the middle of points (n, 3)."""
        return section.sized(round_middle(self.positions(section, points)) or self.size.usual)

    def flatten(
        self, section: Section, polygons: Polygons, near: float | None, ahead: float | None
    ) -> Polygons:
        """Return polygons laid flat; none is torn apart.

        The same polygons in the same order; a point may occur once on each side of the seam.
        """
        if not len(polygons):
            return polygons
        opened = unrolled(section, polygons, near)
        points = self.laid(section, opened, ahead)
        return Polygons(points, polygons.offsets, opened.corners, polygons.cells)

    def middle(
        self, section: Section, polygons: Polygons, near: float | None = None
    ) -> float | None:
        """Return the middle angle of polygons, in radians."""
        return unrolled(section, polygons, near).middle if len(polygons) else None

    def ways(self, section: Section, angle: float) -> FloatArray:
        """Return unit vectors outwards, around and along the surface at an angle, (3, 3)."""
        cos, sin, lean = np.cos(angle), np.sin(angle), self.lean(section)
        side, high = np.array([cos, sin, 0.0]), np.array([0.0, 0.0, 1.0])
        outwards = np.cos(lean) * side - np.sin(lean) * high
        along = np.sin(lean) * side + np.cos(lean) * high
        return np.asarray(np.stack([outwards, [-sin, cos, 0.0], along]) @ section.basis)

    def facing(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the camera's axes for a look from outside at the middle of points (n, 3).

        Its lines are to the right, as where it lies flat.
        """
        to_eye, _, right = self.ways(section, patch_of(section, points).middle[0])
        return np.stack([right, np.cross(to_eye, right), to_eye])

    def aslant(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the directions to the middle of points (n, 3) from the axis; see `Shape`."""
        axis = section.basis[2]
        middle = points.mean(axis=0) - np.asarray(section.origin)
        middle = middle - (middle @ axis) * axis
        size = np.linalg.norm(middle)
        # Around a whole wheel there is no middle.
        around = self.girth(section, float(self.places(section, points)[:, 1].mean()))
        straight = middle / size if size > 1e-3 * around else section.basis[0]
        lean = self.lean(section)
        straight = np.cos(lean) * straight - np.sin(lean) * axis
        up = np.eye(3)[1 if abs(straight[2]) > 0.9 else 2]
        return np.stack([np.cross(up, straight), up, straight])


def axis_shape(section: Section) -> AboutAxis:
    """Return the shape of a section about an axis."""
    assert isinstance(section.shape, AboutAxis)
    return section.shape


def patch_of(section: Section, points: FloatArray) -> Patch:
    """Return the part of a section that has these points (n, 3): of its cut, or of a mesh."""
    shape = axis_shape(section)
    angle, along = shape.places(section, points).T
    turned = np.sort(angle)
    gaps = np.diff(turned, append=turned[0] + TURN)
    # From the end of the widest gap on, there is no seam.
    start = float(turned[(int(np.argmax(gaps)) + 1) % len(turned)])
    angle = start + (angle - start) % TURN
    low, high = (float(angle.min()), float(angle.max())), (float(along.min()), float(along.max()))
    places = np.column_stack([angle, along])
    middle = np.array([np.mean(low), np.mean(high)])
    flat = (places - middle) * (shape.girth(section, float(middle[1])), 1.0)
    far = np.linalg.norm(flat, axis=1)
    nearest = int(np.argmin(far))
    if far[nearest] > _HOLE * np.linalg.norm(np.ptp(flat, axis=0)):
        middle = places[nearest]
    some = places[:: max(len(places) // _MOST, 1)]
    return Patch(low, high, (float(middle[0]), float(middle[1])), some)
