"""A section through a mesh as a value, and the functions and words that all shapes share.

A shape is a class: the functions of `Section` that differ by shape are defined in
`slideviz.sections.plane`, ``quadrics`` and ``span``.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from slideviz.argument_types import check_fields, frozen
from slideviz.case.section_shapes import SECTION_SHAPES, ShapeTerms, Size
from slideviz.errors import CaseError, point_words
from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.check import LARGEST, within
from slideviz.mesh.model import FloatArray
from slideviz.mesh.surfaces import padded
from slideviz.sections.polygons import Polygons
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

if TYPE_CHECKING:
    from slideviz.sections.plane import Box
    from slideviz.sections.span import SpanWalls

Triple = tuple[float, float, float]

_LAYER = 1e-4  # nodes whose values differ by less than this part of the span are on one layer
_NEAR = 0.03
"""Where no layer is at the middle, a round number may be this far from it, over the span."""


def round_middle(values: FloatArray) -> float:
    """Return a round number near the middle of the nodes' ``values`` (n,), between their layers.

    If a section were in a layer of nodes, rounding would decide which cells it cuts.
    """
    low = float(values.min())
    high = float(values.max())
    middle = (low + high) / 2.0
    span = high - low
    if not span > 0:
        return middle
    below, above = _layers_around(values, middle)
    # In the middle half of the cells at the middle (of those above it, where a layer is there).
    room = (above - below) / 4.0
    first = below + room
    last = above - room
    near = max(middle - _NEAR * span, first), min(middle + _NEAR * span, last)
    if near[0] <= near[1] and middle - below > _LAYER * span:
        first, last = near
    return roundest(first, last, min(max(middle, first), last))


def _layers_around(values: FloatArray, middle: float) -> tuple[float, float]:
    """Return the layers of nodes next below and above ``middle``; below includes one at it.

    A layer is a value that many more nodes have than by chance; the ends of the values are two.
    """
    low = float(values.min())
    high = float(values.max())
    near = _LAYER * (high - low)
    # Of scattered nodes, about so many are as near to each other as those of a layer.
    chance = 2.0 * _LAYER * len(values)
    least = chance + 6.0 * np.sqrt(chance) + 6.0
    rising = np.sort(values)
    count = np.searchsorted(rising, rising + near, "right") - np.searchsorted(
        rising, rising - near, "left"
    )
    layers = np.concatenate([[low], rising[count > least], [high]])
    return (
        float(layers[layers <= middle + near].max()),
        float(layers[layers > middle + near].min()),
    )


def roundest(first: float, last: float, wanted: float) -> float:
    """Return the number with fewest digits from ``first`` to ``last``, nearest to ``wanted``."""
    digits = -int(np.floor(np.log10(max(abs(first), abs(last), 1e-300)))) - 1
    while True:
        unit = 10.0**-digits
        low = np.ceil(first / unit)
        high = np.floor(last / unit)
        if low <= high or digits > 300:
            return round(float(np.clip(np.round(wanted / unit), low, high)) * unit, digits) + 0.0
        digits += 1


DIGITS = 4
FEW = 2
"""Significant digits of the numbers of a direction or point: in full words, and in few words."""


class Label(NamedTuple):
    """The label of a plot's axis: in full, and in short where there is little room."""

    full: str
    short: str


Labels = tuple[Label, Label]  # of the axis to the right and of the one upwards
Along = Callable[[int], FloatArray]  # returns coordinates (n,) along a row of the section's basis
Edges = tuple[FloatArray, FloatArray]  # start points (k, 3), and vectors to the end points (k, 3)
Level = tuple[FloatArray, ...]


SHAPES: dict[str, type[Section]] = {}
"""The class of each shape, by its name."""

ON_SECTION = 1e-9
"""Nodes nearer to a section than this part of the largest distance are taken as on it: where a
layer of nodes lies in it up to rounding, one layer of cells is cut, and not some of each side."""


@frozen
class Section:
    """A plane, cylinder or other surface that cuts a mesh.

    Raises
    ------
    CaseError
        The shape is unknown, a number is not finite, the direction has length zero, or the shape
        cannot have the size.
    """

    kind: str = field(metadata=SECTION_SHAPES)
    """Its shape: plane, cylinder, cone or span."""
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
    """The constant span, 0 at hub or root to 1 at shroud or tip; 0 for other shapes."""
    walls: SpanWalls | None = None
    """The ends of the span, for a section of constant span: it cuts nothing without."""

    terms: ClassVar[ShapeTerms]  # names, numbers and words of the shape
    directed: ClassVar[bool] = True
    """Whether the sign of the direction matters, for signed distances at least."""
    near: ClassVar[float] = 0.0
    """Part of an edge of a cell within which, next to a node, the section goes through the node."""

    def __new__(cls, kind: str = "", *_: object, **__: object) -> Self:
        """Return a section of the class of the shape ``kind``; raises CaseError if of another."""
        shape = SHAPES.get(kind, cls)
        if issubclass(cls, shape):  # a kind of that shape
            shape = cls
        if not issubclass(shape, cls):  # it would have the default numbers
            raise CaseError(
                f"{kind} section: a {cls.terms.value} cannot become one; make a new one"
            )
        return object.__new__(shape)

    def __init_subclass__(cls) -> None:
        if "terms" in vars(cls):
            SHAPES[cls.terms.value] = cls

    def __post_init__(self) -> None:
        check_fields(self)
        numbers = (*self.origin, *self.direction, self.size)
        terms = self.terms
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
        size_term = SECTION_SHAPES[kind].size
        sizes: dict[str, Any] = {} if size_term is None else {size_term.field: size}
        return cls(kind, origin, direction, **sizes)

    @property
    def in_plane(self) -> InPlane:
        """Return the section as one of a 2D mesh, a line or a circle, which its shape must be."""
        assert isinstance(self, InPlane)
        return self

    @property
    def size(self) -> float:
        """Return the radius, half angle in degrees, or span; 0 for a plane."""
        size = self.terms.size
        return 0.0 if size is None else float(getattr(self, size.field))

    @property
    def size_terms(self) -> Size:
        """Return the words and limits of the size, which the shape must have."""
        assert self.terms.size is not None
        return self.terms.size

    def sized(self, value: float) -> Self:
        """Return the section with another size.

        Raises CaseError if the shape cannot have it.
        """
        return replace(self, **{self.size_terms.field: float(value)})  # type: ignore[arg-type]

    @property
    def point(self) -> FloatArray:
        """Return the point (3,) as an array."""
        return np.asarray(self.origin)

    @cached_property
    def basis(self) -> FloatArray:
        """Return unit vectors as rows (3, 3), right-handed, the third along the normal or axis.

        If the shape's direction has no sign (a cylinder), its largest component is positive.
        """
        base = axis_basis(self.direction)
        if not self.directed and base[2, np.argmax(np.abs(base[2]))] < 0:
            return axis_basis(-base[2])
        return base

    def frame(self, points: FloatArray) -> FloatArray:
        """Return the coordinates (n, 3) of points (n, 2 or 3) in ``basis``, from ``origin``."""
        return (padded(points) - self.point) @ self.basis.T

    def along(self, points: FloatArray, row: int) -> FloatArray:
        """Return the coordinates (n,) of points (n, 2 or 3) along a row of ``basis``: 0, 1 or 2."""
        coordinates = np.empty(len(points))
        _project(points, self.basis[row], float(self.point @ self.basis[row]), coordinates)
        return coordinates

    def distance(self, points: FloatArray) -> FloatArray:
        """Return signed distances (n,) of points (n, 2 or 3), along the normal or outwards.

        Exactly 0 for points that are on the section up to rounding (`ON_SECTION`).
        """
        gap = np.empty(len(points))

        def of_part(part: slice) -> None:
            gap[part] = self.gap(lambda row: self.along(points[part], row))

        in_parts(of_part, len(points))
        size = np.abs(gap)
        gap[size <= ON_SECTION * size.max(initial=0.0)] = 0.0
        return gap

    def can_cut(self, dim: int) -> bool:
        """Return whether the section can cut meshes of ``dim`` dimensions at all.

        2D meshes are cut by planes, and by cylinders about z, which are circles there.
        """
        if dim == 2:
            return isinstance(self, InPlane) and self.cuts_plane
        return self.walls is not None or self.kind != "span"

    def needs(self, dim: int) -> str:
        """Return in words what a section needs that cannot cut meshes of ``dim`` dimensions."""
        return "needs a 3D mesh" if dim == 2 else "needs hub and shroud, or root and tip"

    def describe(self, dim: int = 3) -> str:
        """Return the section in words: in 2D as a line or a circle."""
        words = self.words_in_plane() if dim == 2 and isinstance(self, InPlane) else ""
        return words or self.words()

    def brief(self, dim: int = 3) -> str:
        """Return the section in few words, for a list; `describe` has more digits."""
        return self.describe(dim) if dim == 2 else self.few_words()

    # What it cuts ----------------------------------------------------------------------
    @abstractmethod
    def gap(self, along: Along) -> FloatArray:
        """Return signed distances (n,) of points; their sign changes at the section only.

        ``along(i)`` returns the coordinates (n,) of the points along row i of the section's basis.
        """

    @abstractmethod
    def crossings(self, edges: Edges, level: Level) -> FloatArray:
        """Return where edges cross the section exactly, (k,), as parts of the edge from 0 to 1.

        ``edges`` are start points (k, 3) and vectors to the end points (k, 3); ``level`` has the
        signed distances (k,) of start and end.
        """

    # Its numbers -----------------------------------------------------------------------
    @property
    @abstractmethod
    def position(self) -> float:
        """Return the number that a slider moves: position along the normal, radius, half angle."""

    @abstractmethod
    def at_position(self, value: float) -> Self:
        """Return the section at another position; raises CaseError where there is none."""

    @abstractmethod
    def positions(self, points: FloatArray) -> FloatArray:
        """Return the positions (n,) at which the section would go through points (n, 3)."""

    @abstractmethod
    def first(self, points: FloatArray) -> Self:
        """Return the initial position of a new section, near the middle of points (n, 3).

        This one has an initial point and direction: the middle of the points, or the axis of the
        machine.
        """

    @abstractmethod
    def keeps(self, turned: FloatArray, step: FloatArray) -> float:
        """Return how far a rigid motion moves the section off itself, a length; 0: onto itself.

        ``turned`` (3,) is its unit direction after the motion, the same or the opposite one;
        ``step`` (3,) is the displacement of its point.
        """

    # Words -----------------------------------------------------------------------------
    @abstractmethod
    def words(self) -> str:
        """Return the section in words."""

    @abstractmethod
    def few_words(self) -> str:
        """Return the section in few words."""

    @abstractmethod
    def miss(self, points: FloatArray) -> str:
        """Return the message that a section does not cut points (n, d), with positions that do."""

    # Laid flat, and looked at ----------------------------------------------------------
    @abstractmethod
    def flatten(self, polygons: Polygons, near: float | None, ahead: float | None) -> Polygons:
        """Return polygons laid flat: x right, y up, z towards the camera; lengths are kept.

        For a shape about an axis, in radians: angles lie around ``near`` (None: 0); the line at the
        angle ``ahead`` is drawn to the right (None: at the middle angle).
        """

    def middle_angle(self, polygons: Polygons, near: float | None = None) -> float | None:
        """Return the middle of the angles of polygons, in radians, nearest ``near``; or None.

        None for a plane, which has no angles, and without polygons.
        """
        return None

    def ahead(self, points: FloatArray) -> float | None:
        """Return the angle, in radians, at which a flat view of points (n, 3) is drawn level.

        None where the shape is drawn level at any angle.
        """
        return None

    @abstractmethod
    def flat_labels(self) -> Labels:
        """Return the axis labels of the section laid flat: to the right, and up."""

    @abstractmethod
    def flat_matrix(self, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix (4, 4) that moves the flat section as ``matrix`` (4, 4) does in space.

        ``matrix`` takes the section onto itself; ``angle`` is its rotation about the section's
        direction, in radians.
        """

    @abstractmethod
    def facing(self, points: FloatArray) -> FloatArray:
        """Return the camera's axes (3, 3) to look straight at a section: right, up, to the camera.

        ``points`` (n, 3) are those of the cut.
        """

    @abstractmethod
    def aslant(self, points: FloatArray) -> FloatArray:
        """Return the camera's axes (3, 3) to look at a section in a 3D view, in the same order."""


class InPlane(Section):
    """A shape with sections in the plane of a 2D mesh: a line or a circle."""

    @property
    @abstractmethod
    def cuts_plane(self) -> bool:
        """Return whether a section of the shape can cut 2D meshes."""

    @abstractmethod
    def words_in_plane(self) -> str:
        """Return the section in words; "" where it is not a line or circle in 2D."""

    @abstractmethod
    def trace(self, box: Box) -> list[FloatArray]:
        """Return the parts of the line or circle inside a box, as polylines (k, 2) each."""

    @property
    @abstractmethod
    def middle(self) -> FloatArray:
        """Return the point (2,) of the handle by which the mouse moves the section."""

    @abstractmethod
    def positions_along(self, corners: FloatArray) -> FloatArray:
        """Return the positions (q, 2) along the section of both ends of its lines (q, 2, 2)."""

    @abstractmethod
    def position_label(self) -> Label:
        """Return the axis label of `positions_along`."""


@njit
def _project(points, direction, start, found):  # type: ignore[no-untyped-def]
    """Write coordinates of points (n, d) along a direction, less ``start``, to ``found`` (n,)."""
    for i in range(len(points)):
        total = 0.0
        for axis in range(points.shape[1]):
            total += points[i, axis] * direction[axis]
        found[i] = total - start


# Words that the shapes share -----------------------------------------------------------
def axis_word(direction: Triple, digits: int = DIGITS) -> str:
    """Return x, y or z for a direction along that axis, either way, else its components."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    for word, axis in zip("xyz", np.eye(3), strict=True):
        if np.abs(unit @ axis) > 1.0 - 1e-12:
            return word
    return triple_words(direction, digits)


def triple_words(values: Sequence[float], digits: int = DIGITS) -> str:
    """Return numbers in brackets, with ``digits`` significant digits."""
    return f"({point_words(values, digits=digits)})"


def triple(values: FloatArray) -> Triple:
    """Return three numbers as a tuple."""
    x, y, z = map(float, values)
    return x, y, z


def direction_label(direction: FloatArray) -> Label:
    """Return the axis label of a unit direction (3,): x, y or z, or its components.

    The short form of the latter is x′, y′ or z′, by its largest component.
    """
    word = "xyz"[int(np.argmax(np.abs(direction)))]
    if direction.max() > 1.0 - 1e-12:
        return Label(word, word)
    return Label(f"along ({point_words(direction, digits=3)})", word + "′")
