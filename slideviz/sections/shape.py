"""The protocol of the shapes of sections, and words that shapes share."""

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

DIGITS, FEW = 4, 2
"""Digits of each number of a direction or point in words, and where there is little room."""


class Label(NamedTuple):
    """The label of an axis: in full, and for where there is no room."""

    full: str
    short: str


class Shape(Protocol):
    """A kind of surface that cuts 3D meshes; its sections have point, direction and size.

    Attributes
    ----------
    terms : ShapeTerms
        How it is called and written.
    in_plane : InPlane or None
        What it is in the plane of a 2D mesh.
    directed : bool
        Whether the opposite direction makes another section.
    """

    terms: ShapeTerms
    in_plane: InPlane | None
    directed: bool

    # What it cuts ----------------------------------------------------------------------

    def distance(self, section: Section, along: Callable[[int], FloatArray]) -> FloatArray:
        """Return signed distances (n,); ``along(i)`` has coordinates (n,) in the section's frame.

        The sign changes where the section is, and nowhere else.
        """

    def crossings(
        self, section: Section, edges: tuple[FloatArray, FloatArray], level: tuple[FloatArray, ...]
    ) -> FloatArray:
        """Return the places on edges, (k,) as parts of the edge, where they cross, exactly.

        They start at points (k, 3) and go ways (k, 3); ``level`` has the signed distances (k,) of
        both ends.
        """

    # Its numbers -----------------------------------------------------------------------

    def position(self, section: Section) -> float:
        """Return the number that a slider moves: a distance, a radius, an angle."""

    def at_position(self, section: Section, value: float) -> Section:
        """Return the section at another position; CaseError where there is no such section."""

    def positions(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the positions (n,) at which the section would go through points (n, 3)."""

    def first(self, section: Section, points: FloatArray) -> Section:
        """Return a section to start from, about through the middle of points (n, 3).

        That given goes through the middle, or is about the axis of the machine.
        """

    def keeps(self, section: Section, turned: FloatArray, step: FloatArray) -> float:
        """Return how far a transformation moves the section off itself, in the length unit.

        ``turned`` (3,) is what becomes of its unit direction, which is the same or the opposite;
        ``step`` (3,) how far its point goes.
        """

    # Words -----------------------------------------------------------------------------

    def describe(self, section: Section) -> str:
        """Return the section in words."""

    def brief(self, section: Section) -> str:
        """Return the section in few words."""

    def miss(self, section: Section, points: FloatArray) -> str:
        """Return why a section misses points (n, d), and between which positions it would cut."""

    # Laid flat, and looked at ----------------------------------------------------------

    def flatten(
        self, section: Section, polygons: Polygons, near: float | None, ahead: float | None
    ) -> Polygons:
        """Return polygons laid flat: x right, y up, z towards the camera; lengths are kept.

        What goes around an axis lies about the angle ``near``, and that at the angle ``ahead``
        has its axis to the right, in radians (see `ahead`).
        """

    def middle(
        self, section: Section, polygons: Polygons, near: float | None = None
    ) -> float | None:
        """Return the middle angle of polygons, in radians; None for a shape without a seam."""

    def ahead(self, section: Section, points: FloatArray) -> float | None:
        """Return the angle, in radians, whose line is drawn level; None where any will do."""

    def flat_labels(self, section: Section) -> tuple[Label, Label]:
        """Return the axis labels of the section laid flat: to the right, and up."""

    def flat_matrix(self, section: Section, matrix: FloatArray, angle: float) -> FloatArray:
        """Return the matrix that moves the flat section as ``matrix`` does in space, (4, 4).

        ``angle`` is the turn about the section's direction, in radians; ``matrix`` takes the
        section onto itself.
        """

    def facing(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the camera's axes for a straight look, (3, 3): right, up, to the camera.

        ``points`` (n, 3) are those of the cut.
        """

    def aslant(self, section: Section, points: FloatArray) -> FloatArray:
        """Return the camera's axes for a look from aside, (3, 3), in the same order."""

    handle: Literal["push", "pull"]
    """Whether it is pushed and turned as a plane, or a ball on it pulls its size."""


class InPlane(Protocol):
    """A shape in the plane of a 2D mesh: a line or a circle."""

    def can_cut(self, section: Section) -> bool:
        """Tell whether a section can cut 2D meshes."""

    def describe(self, section: Section) -> str:
        """Return the section in words; empty where it is no line or circle."""

    def trace(self, section: Section, box: Box) -> list[FloatArray]:
        """Return the parts of the line or circle inside a box, as polylines (k, 2) each."""

    def middle(self, section: Section) -> FloatArray:
        """Return the point (2,) by which the mouse moves the section."""

    def handle_parts(self, section: Section, parts: list[FloatArray], box: Box) -> HandleParts:
        """Return the handle points inside a box; ``parts`` are the section's polylines there."""

    def dragged(
        self, section: Section, part: Part, way: tuple[FloatArray, FloatArray], box: Box
    ) -> Section:
        """Return the section after its part was dragged (see `slideviz.sections.handles`)."""

    def positions(self, section: Section, corners: FloatArray) -> FloatArray:
        """Return the positions of both ends of lines (q, 2, 2) along the section, (q, 2)."""

    def position_label(self, section: Section) -> Label:
        """Return the axis label of `positions`."""


# Words that the shapes share -----------------------------------------------------------


def axis_word(direction: Triple, digits: int = DIGITS) -> str:
    """Return x, y or z where the direction is that axis, either way, else its components."""
    unit = np.asarray(direction) / np.linalg.norm(direction)
    for word, axis in zip("xyz", np.eye(3), strict=True):
        if np.abs(unit @ axis) > 1.0 - 1e-12:
            return word
    return triple_words(direction, digits)


def triple_words(values: Sequence[float], digits: int = DIGITS) -> str:
    """Return numbers in brackets, with few digits."""
    return f"({', '.join(f'{value + 0.0:.{digits}g}' for value in values)})"


def triple(values: FloatArray) -> Triple:
    """Return three numbers as a tuple."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def direction_label(direction: FloatArray) -> Label:
    """Return x, y or z, or the direction; in short x′, y′ or z′ by its largest component."""
    word = "xyz"[int(np.argmax(np.abs(direction)))]
    if direction.max() > 1.0 - 1e-12:
        return Label(word, word)
    parts = ", ".join(f"{value:.3g}" for value in direction.round(12) + 0.0)
    return Label(f"along ({parts})", word + "′")
