"""What cylinders, cones and surfaces of constant span have in common: they go around an axis.

They can be laid flat; cylinders and cones without stretching. The seam, at which they are cut open,
lies in the largest gap between the angles of the points.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple, Self

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray, row_norms
from slideviz.sections.polygons import Polygons
from slideviz.sections.shape import Section, round_middle

TURN = 2.0 * np.pi
_HOLE = 0.1
"""The handle is in the middle of a patch where the cut comes as near to that as this part of the
patch's diagonal; else there is a hole, and it is at the nearest place of the cut."""
_MOST = 400
"""About how many places of a cut are kept for its handle: enough for one to be in any close-up."""


class UnrolledPolygons(NamedTuple):
    """Polygons around an axis, cut open at the seam: a point on it is there once for each side."""

    radius: FloatArray
    height: FloatArray  # `radius`, `height` (p,): of the points, about and along the axis
    angle: FloatArray
    """(p,): their angles around the axis in radians, within one turn but for polygons on the seam,
    which stay whole."""
    corners: IntArray  # (k,): the point of each corner of the polygons
    middle: float  # the middle of the range of angles, in radians


def unrolled(section: Section, polygons: Polygons, near: float | None) -> UnrolledPolygons:
    """Return polygons around the axis of a section, at least one, cut open at the seam.

    The seam lies in the middle of the largest range of angles without points. Whole turns are
    added so that the middle of all angles is nearest to ``near``, in radians; None: to 0.
    """
    angle, radius, height = polar(section.frame(polygons.points))
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
    middle_angle = float(centre + shift)
    return UnrolledPolygons(radius[node], height[node], opened, corners, middle_angle)


def polar(local: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return angle, radius and height (n,) of points (n, 3) in the frame of a section."""
    return np.arctan2(local[:, 1], local[:, 0]), np.hypot(local[:, 0], local[:, 1]), local[:, 2]


def _wrapped(angle: FloatArray) -> FloatArray:
    """Return angles (n,) in radians brought into -pi to pi by whole turns."""
    return angle - TURN * np.round(angle / TURN)


def _seam(angle: FloatArray) -> float:
    """Return the middle of the largest gap between angles (n,) on the circle, in radians."""
    turned = np.sort(angle)
    gaps = np.diff(turned, append=turned[0] + TURN)
    widest = int(np.argmax(gaps))
    return float(turned[widest] + gaps[widest] / 2.0)


PlaceOnSection = tuple[float, float]
"""A place on a section about an axis, whatever its size: the angle in radians, and the length along
the straight line of the surface at that angle."""


@record
class Patch:
    """The part of a section about an axis that lies in a mesh (beside it where nothing is cut)."""

    angles: tuple[float, float]
    along: tuple[float, float]
    """`angles`, `along` (float, float): lowest and highest angle in radians, and length along the
    lines in the mesh's length unit."""
    middle: PlaceOnSection
    """(float, float): the place of the handle: the middle of the patch or, where that is in a hole,
    the place of the cut nearest to it."""
    places: FloatArray  # (k, 2): some places of the cut, with angles in the range of angles


class AboutAxis(Section):
    """A shape about an axis with a size that its handle drags; see `Section`."""

    # What each shape defines, besides the functions of `Section` ------------------------
    @abstractmethod
    def laid(self, opened: UnrolledPolygons, ahead: float | None) -> FloatArray:
        """Return unrolled points (p, 3) laid flat (see `Section.flatten`)."""

    @abstractmethod
    def places(self, points: FloatArray) -> FloatArray:
        """Return the places (n, 2) of points (n, 3): angles, and lengths along the surface."""

    @abstractmethod
    def surface(self, places: FloatArray, size: float) -> FloatArray:
        """Return the points (k, 3) at places (k, 2) of the section with the size ``size``."""

    @abstractmethod
    def lean(self) -> float:
        """Return the angle in radians between the lines of the surface and its axis."""

    @abstractmethod
    def girth(self, along: float) -> float:
        """Return the distance from the axis at a length along the surface."""

    # What follows from these ------------------------------------------------------------
    @property
    def position(self) -> float:
        return self.size

    def at_position(self, value: float) -> Self:
        return self.sized(value)

    def first(self, points: FloatArray) -> Self:
        """Return the section of a round size, about through the middle of points (n, 3)."""
        return self.sized(round_middle(self.positions(points)) or self.size_terms.usual)

    def keeps(self, turned: FloatArray, step: FloatArray) -> float:
        """Return how far the point of the axis moves; infinity where the axis is turned round."""
        return float(np.linalg.norm(step)) if turned @ self.basis[2] > 0 else np.inf

    def flatten(self, polygons: Polygons, near: float | None, ahead: float | None) -> Polygons:
        """Return the polygons laid flat, in the same order and each of them whole.

        A point on the seam may be there twice, once for each side.
        """
        if not len(polygons):
            return polygons
        opened = unrolled(self, polygons, near)
        points = self.laid(opened, ahead)
        return Polygons(points, polygons.offsets, opened.corners, polygons.cells)

    def middle_angle(self, polygons: Polygons, near: float | None = None) -> float | None:
        return unrolled(self, polygons, near).middle if len(polygons) else None

    def ways(self, angle: float) -> FloatArray:
        """Return unit vectors (3, 3) at an angle: outwards, around, and along the surface."""
        cos = np.cos(angle)
        sin = np.sin(angle)
        lean = self.lean()
        side = np.array([cos, sin, 0.0])
        high = np.array([0.0, 0.0, 1.0])
        outwards = np.cos(lean) * side - np.sin(lean) * high
        along = np.sin(lean) * side + np.cos(lean) * high
        return np.stack([outwards, [-sin, cos, 0.0], along]) @ self.basis

    def patch(self, points: FloatArray) -> Patch:
        """Return the part of it at points (n, 3): those of its cut or, if none, of the mesh."""
        places = self.opened(self.places(points))
        angle, along = places.T
        low = (float(angle.min()), float(angle.max()))
        high = (float(along.min()), float(along.max()))
        middle = np.array([np.mean(low), np.mean(high)])
        flat = (places - middle) * (self.girth(float(middle[1])), 1.0)
        far = row_norms(flat)
        nearest = int(np.argmin(far))
        if far[nearest] > _HOLE * np.linalg.norm(np.ptp(flat, axis=0)):
            middle = places[nearest]
        some = places[:: max(len(places) // _MOST, 1)]
        return Patch(low, high, (float(middle[0]), float(middle[1])), some)

    def opened(self, places: FloatArray) -> FloatArray:
        """Return places (n, 2) with no seam: angles count from the end of their widest gap."""
        angle, along = places.T
        turned = np.sort(angle)
        gaps = np.diff(turned, append=turned[0] + TURN)
        start = float(turned[(int(np.argmax(gaps)) + 1) % len(turned)])
        return np.column_stack([start + (angle - start) % TURN, along])

    def facing(self, points: FloatArray) -> FloatArray:
        """Return the camera's axes (3, 3) to look from outside at the middle of points (n, 3).

        The line of the surface there goes to the right, as in the flat view.
        """
        to_eye, _, right = self.ways(self.patch(points).middle[0])
        return np.stack([right, np.cross(to_eye, right), to_eye])

    def aslant(self, points: FloatArray) -> FloatArray:
        axis = self.basis[2]
        middle = points.mean(axis=0) - self.point
        middle = middle - (middle @ axis) * axis
        size = np.linalg.norm(middle)
        # Points all around the axis have no middle: take any direction.
        around = self.girth(float(self.places(points)[:, 1].mean()))
        straight = middle / size if size > 1e-3 * around else self.basis[0]
        lean = self.lean()
        straight = np.cos(lean) * straight - np.sin(lean) * axis
        up = np.eye(3)[1 if abs(straight[2]) > 0.9 else 2]
        return np.stack([np.cross(up, straight), up, straight])
