"""What every motion of boundaries can do: be read and written, checked, named, and applied."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np

from slideviz.argument_types import CheckedFields, frozen
from slideviz.case.displacement import Displacements, NodesOn, PlacedDisplacements
from slideviz.case.words import Words, name_text
from slideviz.errors import ROUNDING, CaseError, Doubt, Message
from slideviz.mesh.model import FloatArray, IntArray, Mesh, ZonePart
from slideviz.terms import AXES, Numbers, Term, Texts, Vector

if TYPE_CHECKING:
    from typing import Self

    from slideviz.case.model import Case

Point = Numbers | Literal["centroid"]
Target = str | Texts
"""The markers a motion moves: one, several as one body, or, where it is empty, all moving ones."""
Axis = tuple[Vector, Vector]
"""An axis: its direction, and a point on it."""

DesignNumbers = Iterator[tuple[str, str, int | None]]
"""What `Motion.design_numbers` returns: a name, the field, and the place in it."""
ALL_MOVING = "*"  # what stands for the markers of an empty target

ALONG = 1e-12
"""A direction is along an axis where the cosine of their angle differs from 1 by less than this."""
_PREFIXES = {"vector": "", "point": "point_", "axis": "axis_", "factors": "factor_"}
"""Prefixes of the names of components, by field, where they are not the field's name."""


def named(target: Target) -> Texts:
    """Return the names of the markers in a target; () where it is all moving markers."""
    if isinstance(target, str):
        return (target,) if target else ()
    return target


def applies_to(motion: Motion, marker: str) -> bool:
    """Return whether a motion moves the moving marker ``marker``."""
    return not motion.marker or marker in named(motion.marker)


def nodes_moved(motion: Motion, on: NodesOn) -> IntArray:
    """Return the nodes (m,) that a motion moves, of those of each moving marker; ascending."""
    moved = (nodes for name, nodes in on.items() if applies_to(motion, name))
    return np.unique(np.concatenate([np.empty(0, np.int64), *moved]))


@frozen
class MotionStart:
    """What a motion begins with that the user adds."""

    dim: int  # of the mesh
    machine: Axis | None = None  # the axis about which the mesh repeats
    boxes: Texts = ()  # names of the boxes for free-form deformation
    chord: tuple[float, float] = (0.0, 1.0)  # x of the leading and the trailing edge


class Amount(NamedTuple):
    """A field of a motion that says how far it goes."""

    field: str
    value: Any  # a number, or a tuple of numbers
    at_rest: float  # the number with which nothing moves


class Motion(CheckedFields):
    """A motion of one or several moving boundaries.

    A kind of motion is a frozen dataclass that derives from this one, and a row of ``KINDS``. What
    is here holds for a motion whose displacement depends on undeformed places alone; one that
    depends on the places before it has another `change`.
    """

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Any]]

    marker: Target
    kind_term: ClassVar[Term]
    """The words for the kind."""
    verbs: ClassVar[Texts] = ()
    """What stands for it in ``MOTION``; () where it cannot stand there."""
    grammar: ClassVar[Texts] = ()
    """Its forms in ``MOTION``, for the reference."""
    height_row: ClassVar[tuple[str, str]] = ("Raised by", "towards +y")
    """Title and direction of the row ``raised``."""
    stays_at: ClassVar[Texts] = ()
    """What can stay in place: centroid or line, and point; () where the user does not choose.

    Else its fields ``point`` and ``axis``, if it has one, are the rows About, Point and Axis of the
    form, beside ``rows``; in 2D the window sets the axis to z.
    """
    rows: ClassVar[Texts] = ()
    """The rows of its form in the window; the first one has the cursor at the beginning."""
    proportional: ClassVar[Texts] = ()
    """Fields to which the displacement is proportional: exactly, or nearly (angles)."""
    ratios: ClassVar[Texts] = ()
    """Fields that are 1 where nothing moves."""
    chosen: ClassVar[Texts] = ()
    """Fields with numbers that say what moves, not how far; they are no design numbers."""
    file_words: ClassVar[str] = ""
    """What its file is."""
    has_table: ClassVar[bool] = False
    """Whether its file is a table that the user can edit in the window."""
    words: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Each (word in ``grammar``, name in `design_numbers`), where these differ.

    Known for all kinds: dx, dy, dz; px, py, pz; angle.
    """
    in_zones: ClassVar[bool] = True
    """Whether what `placed` returns is found in each zone of a mesh alone."""
    one_zone: ClassVar[bool] = False
    """Whether it cannot move boundaries of several zones together."""
    has_derivatives: ClassVar[bool] = False
    """Whether `derivatives` has those of its displacement by its numbers.

    `SpanVariables` then takes all its `design_numbers`. Not with ``depends_on_place``.
    """
    lists_nodes: ClassVar[bool] = False
    """Whether it lists displacements of nodes; they cannot be scaled, and may be rounded."""
    only_3d: ClassVar[bool] = False
    """Whether a 2D mesh cannot have it."""
    keeps_span: ClassVar[bool] = False
    """Whether nodes keep their span, so that those on hub and shroud stay there."""
    takes_time: ClassVar[bool] = False
    """Whether its displacement takes seconds to compute; the window computes it in a thread."""
    depends_on_place: ClassVar[bool] = False
    """Whether the displacement of a node depends on where motions before have taken it."""
    affine: ClassVar[bool] = False
    """Whether it maps the points of a body by an affine map."""
    checked_as_text: ClassVar[bool] = True
    """Whether its values must be such as `read` returns."""

    @property
    def verb(self) -> str:
        """Return what stands for the motion in ``MOTION``; "" if it cannot stand there."""
        return self.verbs[0] if self.verbs else ""

    @classmethod
    def read(cls, marker: Target, verb: str, words: Words) -> Motion:
        """Return the motion of the words after its verb; raise CaseError with a sentence."""
        raise NotImplementedError

    @classmethod
    def new(cls, marker: Target, start: MotionStart) -> Motion:
        """Return a motion that moves nothing yet."""
        raise NotImplementedError

    def arguments(self) -> list[str]:
        """Return the texts that follow the verb; raise CaseError if there is no such form."""
        raise NotImplementedError

    @property
    def text(self) -> str:
        """Return the motion as it stands in ``MOTION``; CaseError if it has no such form."""
        return f"({', '.join([_target_text(self.marker), self.verb, *self.arguments()])})"

    def described(self, dim: int, extent: float) -> str:
        """Return the motion in words, without what it moves.

        ``dim``: of the mesh. ``extent``: coordinates that are only rounding beside it are 0.
        """
        raise NotImplementedError

    def label(self, form: str, *, exact: bool) -> str:
        """Return the motion in few words, with numbers in the format ``form``.

        ``exact``: whether two motions with equal words must be equal, but for what `about` says.
        """
        raise NotImplementedError

    def about(self) -> str:
        """Return words for the point and the axis of the motion, if it has them."""
        point = getattr(self, "point", None)
        axis = getattr(self, "axis", AXES["z"])
        words = "" if point is None else f" about {place_words(point, form='.15g')}"
        return words if tuple(axis) == AXES["z"] else f"{words}, axis {vector_words(axis, '.15g')}"

    def incomplete(self) -> str:
        """Return what must be chosen before anything else of the motion can be checked; or ""."""
        return ""

    def problems(self, case: Case, mesh: Mesh, place: int) -> Iterator[str]:
        """Yield why the motion, number ``place`` (from 0) of a case, does not fit case or mesh."""
        yield from ()

    def doubts(self, mesh: Mesh, markers: Sequence[str]) -> Iterator[Doubt]:
        """Yield why the motion hardly does what is meant, of the moving ``markers`` it moves."""
        yield from ()

    @classmethod
    def placed(
        cls, case: Case, mesh: Mesh, on: NodesOn, problems: list[Message]
    ) -> PlacedDisplacements:
        """Return the displacements by all motions of this family, by their place in the case.

        ``on`` has the nodes (k,) of each moving marker. Sentences on motions that are impossible
        are added to ``problems``.
        """
        return {}

    @classmethod
    def derivatives(
        cls, case: Case, mesh: Mesh, on: NodesOn
    ) -> Iterator[tuple[int, IntArray, FloatArray, FloatArray]]:
        """Yield the derivative of the displacement by each motion of this family, in two factors.

        Place of the motion in the case; nodes (n,); the derivative (n, d) of their displacement by
        a number of each node; and the derivative (n, k) of that by the k numbers of the motion, in
        the order of `design_numbers`. A motion whose numbers move nodes along several directions is
        yielded once for each. ``on`` has the nodes (k,) of each moving marker.
        """
        yield from ()

    def change(
        self, points: FloatArray, nodes: IntArray, placed: Displacements | None
    ) -> FloatArray:
        """Return the displacement (k, d) of the ``nodes`` (k,) of a marker, now at ``points``.

        ``placed``: what the motion displaces, from undeformed places; None: nothing.
        """
        return np.zeros_like(points) if placed is None else placed.at(nodes)

    def as_one(self, points: FloatArray) -> Self:
        """Return the motion of several markers as one body, with all its nodes at ``points``."""
        return self

    @property
    def content(self) -> tuple[FloatArray | IntArray, ...]:
        """Return the arrays of a motion that no file has; ()."""
        return ()

    @property
    def is_case_file(self) -> bool:
        """Return whether it stands for DEFORMATION_FILENAME, a file for all moving markers."""
        return False

    @property
    def joins_zones(self) -> bool:
        """Return whether what it does in a zone depends on its markers in other zones."""
        return False

    def of_zone(self, part: ZonePart, zone: Case) -> Motion | None:
        """Return the motion for a zone, whose case is ``zone``; None if it is of another one."""
        return self

    def turned(self, part: float) -> Motion:
        """Return the motion with a part, 0 to 1, of its rotation; itself if it has none."""
        return self

    @property
    def files(self) -> tuple[Path, ...]:
        """Return the files that the motion reads."""
        return ()

    def with_files(self, change: Callable[[Path], Path]) -> Motion:
        """Return the motion with changed paths of its `files`."""
        return self

    def amounts(self) -> list[Amount]:
        """Return the fields that say how far the motion goes."""
        names = [*((name, 0.0) for name in self.proportional), *((k, 1.0) for k in self.ratios)]
        return [Amount(name, getattr(self, name), at_rest) for name, at_rest in names]

    def design_name(self) -> str:
        """Return the name of the motion in the columns of a table of designs."""
        return f"{'+'.join(named(self.marker)) or '*'}.{self.verb}"

    def design_numbers(self) -> DesignNumbers:
        """Yield the name of each number in a table of designs, its field, and its component."""
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in self.chosen:
                continue
            if _is_number(value):
                yield field.name, field.name, None
            elif isinstance(value, tuple) and value and all(map(_is_number, value)):
                if field.name == "factors" and len(value) == 1:
                    yield "factor", field.name, 0
                    continue
                head = _PREFIXES.get(field.name, f"{field.name}_")
                for component, axis in zip(range(len(value)), "xyz", strict=False):
                    yield f"{head}{axis}", field.name, component

    def with_marker(self, marker: Target) -> Self:
        """Return the same motion of other markers."""
        return replace(self, marker=marker)


def _target_text(target: Target) -> str:
    names = [name_text(name) for name in named(target)]
    if isinstance(target, str):
        return names[0] if names else ALL_MOVING
    if len(names) < 2 or len(set(names)) < len(names):
        raise CaseError(f"{target} are not several markers; give a name, or two different ones")
    return f"({', '.join(names)})"


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def without_brackets(words: Words) -> Words:
    """Return the words that are not brackets."""
    return [word for word in words if not (word.is_sign("(") or word.is_sign(")"))]


def axis_length(words: Words, place: int, room: int) -> int:
    """Return how many words from ``place`` on name an axis: a letter, three numbers, or none.

    Numbers name one where more than ``room`` words are there.
    """
    letter = len(words) > place and words[place].text.lower() in ("x", "y", "z")
    if letter:
        return 1
    return 3 if len(words) > room else 0


def number_texts(*values: float) -> list[str]:
    """Return numbers as texts that lose no bit."""
    return [repr(float(value)) for value in values]


def vector_words(values: Sequence[float], form: str = ".4g") -> str:
    """Return a vector as text, its numbers in the format ``form``: by default four digits."""
    return f"({', '.join(format(value, form) for value in values)})"


def direction_words(direction: Sequence[float]) -> str:
    """Return ``x``, ``-x`` and so on for a direction along an axis, else the vector as text."""
    spatial = (*direction, 0.0)[:3]
    least = (1.0 - ALONG) * math.hypot(*spatial)
    for name, value in zip(AXES, spatial, strict=True):
        if abs(value) > least > 0.0:
            return name if value > 0.0 else f"-{name}"
    return vector_words(direction)


def place_words(point: Point, extent: float = 0.0, form: str = ".4g", its: str = "its") -> str:
    """Return a point as text, or ``its centroid``."""
    if isinstance(point, str):
        return f"{its} {point}"
    return vector_words([v if abs(v) >= ROUNDING * extent else 0.0 for v in point], form)


def pronoun(target: Target) -> str:
    """Return ``its`` for one marker, else ``their``."""
    return "its" if len(named(target)) == 1 else "their"


def marker_words(target: Target) -> str:
    """Return the markers that a motion moves for a message: ``'BLADE' or 'TIP'``."""
    return " or ".join(repr(name) for name in named(target)) or "a moving marker"


def require_dimension(count: int, dim: int, what: str) -> Iterator[str]:
    """Yield a sentence if a vector or a point has not ``dim`` numbers; ``what`` begins it."""
    if count != dim:
        yield f"{what}, and the mesh has {dim} dimensions; give {dim}"


def require_positive(factor: float) -> None:
    """Raise CaseError where a factor of sizes is not above 0."""
    if factor <= 0.0:
        raise CaseError(f"the factor {factor:g} is not above 0: it would fold the marker")
