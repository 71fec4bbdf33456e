"""A section through a mesh as a value, and the table of the shapes of sections."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from slideviz.argument_types import check_fields
from slideviz.errors import CaseError
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.check import LARGEST, within
from slideviz.mesh.model import FloatArray
from slideviz.mesh.surfaces import padded
from slideviz.sections.cone import Cone
from slideviz.sections.cylinder import Cylinder
from slideviz.sections.plane import Plane
from slideviz.sections.shape import InPlane, Shape
from slideviz.sections.span import ConstantSpan, SpanWalls
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

SHAPES: dict[str, Shape] = {
    shape.terms.value: shape for shape in (Plane(), Cylinder(), Cone(), ConstantSpan())
}
"""The shapes by name; their words are in `slideviz.case.section_shapes.SECTION_SHAPES`."""

Triple = tuple[float, float, float]

ON_SECTION = 1e-9
"""Nodes nearer to a section than this part of the largest distance are taken as on it: where a
layer of nodes lies in it up to rounding, one layer of cells is cut, and not some of each side."""


@dataclass(frozen=True)
class Section:
    """A plane, cylinder or other surface that cuts a mesh.

    Raises
    ------
    CaseError
        The shape is unknown, a number is not finite, the direction has length zero, or the shape
        cannot have the size.
    """

    kind: str = field(metadata=SHAPES)
    """Its shape: a key of `SHAPES`."""
    origin: Triple = (0.0, 0.0, 0.0)
    """(3,) tuple of float: a point of the plane or of the cylinder's axis, or the apex of the cone,
    in the mesh's length unit."""
    direction: Triple = (0.0, 0.0, 1.0)
    """(3,) tuple of float: the plane's normal, or the direction of the axis; any length but
    zero."""
    radius: float = 0.0
    """The radius of the cylinder; 0 for others."""
    whole_cells: bool = False
    """Whether the cells it cuts are shown whole, instead of cut."""
    name: str = ""
    """The user's name for it; empty: the words of `describe`."""
    shown: bool = True
    """Whether the view draws it."""
    flat: bool = False
    """Whether it has a flat view beside the 3D view: a plane seen along its normal, others
    unrolled."""
    half_angle_deg: float = 0.0
    """The half angle of the cone; 0 for others."""
    span: float = 0.0
    """The constant span, 0 at the hub to 1 at the shroud; 0 for other shapes."""
    walls: SpanWalls | None = None
    """Hub and shroud of a section of constant span: it cuts nothing without."""

    def __post_init__(self) -> None:
        check_fields(self)
        numbers = (*self.origin, *self.direction, self.size)
        terms = self.shape.terms
        if not np.isfinite(numbers).all():
            raise CaseError(f"{self.kind} section: {numbers} has a number that is not finite")
        if not within(np.array(numbers), LARGEST):
            raise CaseError(
                f"{self.kind} section: {numbers} has a number too large to compute with; expected "
                f"numbers up to {LARGEST:g}"
            )
        if not np.linalg.norm(self.direction) > 0:
            raise CaseError(
                f"{self.kind} section: the {terms.direction} 0, 0, 0 has no direction; write e.g. "
                "0, 0, 1"
            )
        fault = terms.size.fault(self.size) if terms.size is not None else ""
        if fault:
            assert terms.size is not None
            raise CaseError(
                f"{self.kind} section: the {terms.size.word} {self.size:.6g} {fault}; "
                f"{terms.size.remedy}"
            )

    @classmethod
    def of(cls, kind: str, origin: Triple, direction: Triple, size: float) -> Section:
        """Return the section of the shape ``kind`` with these numbers; a plane ignores ``size``."""
        size_term = SHAPES[kind].terms.size
        sizes: dict[str, Any] = {} if size_term is None else {size_term.field: size}
        return cls(kind, origin, direction, **sizes)

    @property
    def shape(self) -> Shape:
        """Return the shape of the section."""
        return SHAPES[self.kind]

    @property
    def in_plane(self) -> InPlane:
        """Return the shape in a 2D mesh, line or circle, which the section's shape must have."""
        seen = self.shape.in_plane
        assert seen is not None
        return seen

    @property
    def size(self) -> float:
        """Return the radius, half angle in degrees, or span; 0 for a plane."""
        size = self.shape.terms.size
        return 0.0 if size is None else float(getattr(self, size.field))

    def sized(self, value: float) -> Section:
        """Return the section with another size.

        Raises CaseError if the shape cannot have it.
        """
        size = self.shape.terms.size
        assert size is not None
        return replace(self, **{size.field: float(value)})  # type: ignore[arg-type]

    @cached_property
    def basis(self) -> FloatArray:
        """Return unit vectors as rows (3, 3), right-handed, the third along the normal or axis.

        If the shape's direction has no sign (a cylinder), its largest component is positive.
        """
        base = axis_basis(self.direction)
        if not self.shape.directed and base[2, np.argmax(np.abs(base[2]))] < 0:
            return axis_basis(-base[2])
        return base

    def frame(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (n, 3) of points (n, 2 or 3) in ``basis``, from ``origin``."""
        return (padded(points) - np.asarray(self.origin)) @ self.basis.T

    def along(self, points: FloatArray, row: int) -> FloatArray:
        """Return the coordinates (n,) of points (n, 2 or 3) along a row of ``basis``: 0, 1 or 2."""
        coordinates = np.empty(len(points))
        _project(
            points, self.basis[row], float(np.asarray(self.origin) @ self.basis[row]), coordinates
        )
        return coordinates

    def distance(self, points: FloatArray) -> FloatArray:
        """Return signed distances (n,) of points (n, 2 or 3), along the normal or outwards.

        Exactly 0 for points that are on the section up to rounding (`ON_SECTION`).
        """
        gap = np.empty(len(points))

        def of_part(part: slice) -> None:
            gap[part] = self.shape.distance(self, lambda row: self.along(points[part], row))

        in_parts(of_part, len(points))
        size = np.abs(gap)
        gap[size <= ON_SECTION * size.max(initial=0.0)] = 0.0
        return gap

    def can_cut(self, dim: int) -> bool:
        """Return whether the section can cut meshes of ``dim`` dimensions at all.

        2D meshes are cut by planes, and by cylinders about z, which are circles there.
        """
        seen = self.shape.in_plane
        if dim == 2:
            return seen is not None and seen.can_cut(self)
        return self.walls is not None or self.kind != "span"

    def needs(self, dim: int) -> str:
        """Return in words what a section needs that cannot cut meshes of ``dim`` dimensions."""
        return "needs a 3D mesh" if dim == 2 else "needs hub and shroud"

    def describe(self, dim: int = 3) -> str:
        """Return the section in words: in 2D as a line or a circle."""
        seen = self.shape.in_plane
        words = seen.describe(self) if dim == 2 and seen is not None else ""
        return words or self.shape.describe(self)

    def brief(self, dim: int = 3) -> str:
        """Return the section in few words, for a list; `describe` has more digits."""
        return self.describe(dim) if dim == 2 else self.shape.brief(self)


@njit
def _project(points, direction, start, found):  # type: ignore[no-untyped-def]
    """Write coordinates of points (n, d) along a direction, less ``start``, to ``found`` (n,)."""
    for i in range(len(points)):
        total = 0.0
        for axis in range(points.shape[1]):
            total += points[i, axis] * direction[axis]
        found[i] = total - start
