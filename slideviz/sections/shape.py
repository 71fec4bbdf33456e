"""The protocols of the shapes of sections, in 3D and in 2D, and words that shapes share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple, Protocol

import numpy as np

from slideviz.case.section_shapes import ShapeTerms
from slideviz.mesh.model import FloatArray
from slideviz.sections.polygons import Polygons

if TYPE_CHECKING:
    from slideviz.sections.handles import HandleParts, Part
    from slideviz.sections.line import Box
    from slideviz.sections.model import Section, Triple

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


class Shape(Protocol):
    """A kind of surface that cuts 3D meshes: the functions of its sections.

    A section (`slideviz.sections.model.Section`) has the numbers: point, direction and size. Where
    the length unit is meant, it is that of the mesh.
    """

    terms: ShapeTerms  # its names, numbers and words
    in_plane: InPlane | None  # its functions in 2D meshes; None where it cannot cut these
    directed: bool  # whether the sign of the direction matters, for signed distances at least
    near: float = 0.0
    """Part of an edge of a cell within which, next to a node, the section goes through the node."""

    # What it cuts ----------------------------------------------------------------------
    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return signed distances (n,) of points; their sign changes at the section only.

        ``along(i)`` returns the coordinates (n,) of the points along row i of the section's basis.
        """

    def crossings(
        self, section: Section, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return where edges cross the section exactly, (k,), as parts of the edge from 0 to 1.

        ``edges`` are start points (k, 3) and vectors to the end points (k, 3); ``level`` has the
        signed distances (k,) of start and end.
        """

    # Its numbers -----------------------------------------------------------------------
    def position(self, section: Section) -> float:
        """Return the number that a slider moves: position along the normal, radius, half angle."""

    def at_position(self, section: Section, value: float) -> Section:
        """Return the section at another position; raises CaseError where there is none."""

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the positions (n,) at which the section would go through points (n, 3)."""

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return the initial position of a new section, near the middle of points (n, 3).

        ``section`` has an initial point and direction: the middle of the points, or the axis of the
        machine.
        """

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far a rigid motion moves the section off itself, a length; 0: onto itself.

        ``turned`` (3,) is its unit direction after the motion, the same or the opposite one;
        ``step`` (3,) is the displacement of its point.
        """

    # Words -----------------------------------------------------------------------------
    def describe(self, section: Section) -> str:
        """Return the section in words."""

    def brief(self, section: Section) -> str:
        """Return the section in few words."""

    def miss(self, section: Section, points: FloatArray) -> str:
        """Return the message that a section does not cut points (n, d), with positions that do."""

    # Laid flat, and looked at ----------------------------------------------------------
    def flatten(
        self, section: Section, polygons: Polygons, near: float | None, ahead: float | None
    ) -> Polygons:
        """Return polygons laid flat: x right, y up, z towards the camera; lengths are kept.

        For a shape about an axis, in radians: angles lie around ``near`` (None: 0); the line at the
        angle ``ahead`` is drawn to the right (None: at the middle angle).
        """

    def middle_angle(
        self, section: Section, polygons: Polygons, near: float | None = None
    ) -> float | None:
        """Return the middle of the angles of polygons, in radians, nearest ``near``; or None.

        None for a plane, which has no angles, and without polygons.
        """

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return the angle, in radians, at which a flat view of points (n, 3) is drawn level.

        None where the shape is drawn level at any angle.
        """

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        """Return the axis labels of the section laid flat: to the right, and up."""

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix (4, 4) that moves the flat section as ``matrix`` (4, 4) does in space.

        ``matrix`` takes the section onto itself; ``angle`` is its rotation about the section's
        direction, in radians.
        """

    def facing(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the camera's axes (3, 3) to look straight at a section: right, up, to the camera.

        ``points`` (n, 3) are those of the cut.
        """

    def aslant(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the camera's axes (3, 3) to look at a section in a 3D view, in the same order."""

    handle: Literal["push", "pull"]
    """The kind of 3D handle: a plane to push and turn, or a ball that pulls the size."""


class InPlane(Protocol):
    """A shape in the plane of a 2D mesh: a line or a circle."""

    def can_cut(self, section: Section) -> bool:
        """Return whether a section of the shape can cut 2D meshes."""

    def describe(self, section: Section) -> str:
        """Return the section in words; "" where it is not a line or circle in 2D."""

    def trace(self, section: Section, box: Box) -> list[FloatArray]:
        """Return the parts of the line or circle inside a box, as polylines (k, 2) each."""

    def middle(self, section: Section) -> FloatArray:
        """Return the point (2,) of the handle by which the mouse moves the section."""

    def handle_parts(self, section: Section, parts: list[FloatArray], box: Box) -> HandleParts:
        """Return the drawn parts of the handle; ``parts`` are the section's polylines there."""

    def dragged(
        self, section: Section, part: Part, way: tuple[FloatArray, FloatArray], box: Box
    ) -> Section:
        """Return the section after a part was dragged (see `slideviz.sections.handles.dragged`)."""

    def positions(self, section: Section, corners: FloatArray) -> FloatArray:
        """Return the positions (q, 2) along the section of both ends of its lines (q, 2, 2)."""

    def position_label(self, section: Section) -> Label:
        """Return the axis label of `positions`."""


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
    return f"({', '.join(f'{value + 0.0:.{digits}g}' for value in values)})"


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
    parts = ", ".join(f"{value:.3g}" for value in direction.round(12) + 0.0)
    return Label(f"along ({parts})", word + "′")
