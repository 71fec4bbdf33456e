"""The table of the shapes that a section can have: names, numbers and words, in a TOML file.

Their geometry is in the classes of `slideviz.sections.model`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

from slideviz.system.tables import table_beside


@dataclass(frozen=True)
class Words:
    """The window's words for a shape, in 3D meshes or in 2D meshes."""

    name: str  # text of the button that adds a section of the shape
    action: str  # text of the menu that does so, with its mnemonic letter after "&"
    add: str
    """`add`, `handle`, `flat`, `look`: tips: of the button that adds one, of its handle, of its
    flat view, and of the button that turns the camera to it."""
    handle: str
    flat: str
    flat_name: str  # the name of the flat view
    look: str = ""


@dataclass(frozen=True)
class Size:
    """A number of a shape besides its point and direction, such as a radius; always above 0."""

    field: str  # its name in `slideviz.sections.shape.Section` and in reports
    label: str
    word: str  # `label`, `word`: what it is called in a form, and in a sentence
    unit: str  # its unit in words, for a tip
    remedy: str  # what to give instead of a wrong value, for messages
    example: str  # an example of the option of the command line, in words
    high: float = inf  # values must be below this
    usual: float = 1.0  # the value where none is given
    picks: Sequence[float] = ()  # values that the window offers as buttons

    def fault(self, value: float) -> str:
        """Return why a value is not allowed, as the end of a sentence; "" where it is."""
        if not value > 0:
            return "is not positive"
        return "" if value < self.high else f"is not below {self.high:g}"


@dataclass(frozen=True)
class ShapeTerms:
    """The names, numbers and words of a shape."""

    value: str  # its name in case files, on the command line and in reports
    direction: str  # what its direction is called: normal or axis
    point: str
    """The label of its point in a form; empty where a position along the direction is given
    instead."""
    about: str  # what its point is, in words
    size: Size | None
    """Its own number, which a slider moves; None: the slider moves its position along the
    direction."""
    flat: str  # the word in a case file for a section that is shown in a flat view, too
    numbers: str
    meaning: str  # `numbers`, `meaning`: its numbers in a case file, as symbols and in words
    option: str  # help text of the option of the command line
    tip_to_add: str  # tip of the action that adds a section of the shape
    words: dict[int, Words]
    """The window's words, by the dimensions of meshes that the shape can cut."""
    one_way: bool = False  # whether the opposite direction gives another section
    key: str = ""  # the shortcut that adds a section of the shape; empty for none
    metavar: str | None = None  # the placeholder for its value in the help of the command line

    @property
    def count(self) -> int:
        """Return the count of a shape's numbers in a case file: size, direction and point."""
        return 6 if self.size is None else 7

    @property
    def letter(self) -> str:
        """Return the symbol of its size in a case file, ``r`` or ``a``; ``nx`` for a plane."""
        return self.numbers.partition(",")[0]

    def point_tip(self, dim: int) -> str:
        """Return the tip of the fields of the point, for meshes of ``dim`` dimensions."""
        name = self.words[dim].name.lower()
        return f"The middle of the {name}" if dim == 2 else self.about.capitalize()

    def tip(self, dim: int) -> str:
        """Return the tip of the number that a slider moves, for meshes of ``dim`` dimensions."""
        if self.size is not None:
            return f"The {self.size.word}, in {self.size.unit}."
        name = self.words[dim].name.lower()
        return f"How far the {name} is from 0 along its normal, in the mesh's length unit."


def _shape(value: str, row: dict[str, Any]) -> ShapeTerms:
    size = Size(**row.pop("size")) if "size" in row else None
    words = {int(dim): Words(**some) for dim, some in row.pop("words").items()}
    return ShapeTerms(value, size=size, words=words, **row)


_ROWS = table_beside(__file__)
SECTION_SHAPES = {value: _shape(value, row) for value, row in _ROWS.items()}


def names(dim: int = 3) -> str:
    """Return the names of the shapes for meshes of ``dim`` dimensions, as in "plane or cone"."""
    every = [row.words[dim].name.lower() for row in SECTION_SHAPES.values() if dim in row.words]
    return f"{', '.join(every[:-1])} or {every[-1]}"
