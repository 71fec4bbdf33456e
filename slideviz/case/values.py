"""The kinds of values that a key of a case file can have: how each is read, checked and written.

A kind turns a text into a Python value and back: ``read(write(value)) == value`` for every value
that ``read`` can return. Numbers are written with ``repr``, which loses no bit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Literal

from slideviz.argument_types import frozen
from slideviz.case.words import (
    Word,
    Words,
    check_writable,
    counted,
    is_none,
    list_of,
    name_text,
    number,
    words_of,
)
from slideviz.errors import CaseError, not_one_of, shown
from slideviz.terms import AXES, Term, Vector, labels, tips

Entry = Literal["text", "choice", "switch", "real", "whole", "axis", "point"]
"""The kind of field by which the window lets users enter a value."""

LARGEST_WHOLE = 999_999_999  # the largest whole number: it has 9 digits, which ``_WHOLE`` allows
MAX_STEPS = 9999  # largest number of steps: each is a run of its own, and more change little

_PLAIN_PATH = re.compile(r"[A-Za-z0-9_./~:@=,+-]([A-Za-z0-9_./~:@=,+ -]*[A-Za-z0-9_./~:@=,+-])?\Z")
_WHOLE = re.compile(r"[+-]?[0-9]{1,9}\Z")
# What SU2 writes after each pair of periodic markers: centre, angles, translation.
_SU2_PAIR = 2
_SU2_GROUP = 11


@frozen
class Kind:
    """A kind of value of a key."""

    allowed: str  # the texts that are allowed, in words, for the reference and for messages
    read: Callable[[str], Any]
    """Returns the value of a text; raises ``CaseError`` with one sentence."""
    write: Callable[[Any], str]  # returns the text of a value; raises ``CaseError`` if it has none
    remark: Callable[[str], str] = lambda _: ""
    """Returns a warning about a text, empty if there is none."""
    details: tuple[str, ...] = ()  # further lines for the reference
    entry: Entry = "text"  # the kind of field in the window
    words: Mapping[Any, str] = field(default_factory=dict)
    """The window's words for values, where they differ from those of a case file."""
    tips: Mapping[Any, str] = field(default_factory=dict)  # the window's tips on values
    span: tuple[int, int] = (0, LARGEST_WHOLE)
    """(int, int): the smallest and the largest whole number that the window offers."""

    def problem(self, text: str) -> str:
        """Return why a text cannot be read as a value of the kind; "" where it can."""
        try:
            self.read(text)
        except CaseError as problem:
            return str(problem)
        return ""

    def value_label(self, text: str) -> str:
        """Return the window's word for a value written as text; the text itself if it has none."""
        try:
            return self.words.get(self.read(text), text)
        except CaseError:
            return text


def choice(words: Mapping[str, Any]) -> Kind:
    """Return the kind of the words of a table, in any case; of synonyms the first is written."""
    written: dict[Any, str] = {}
    for word, value in words.items():
        written.setdefault(value, word)

    def read(text: str) -> Any:
        for word, value in words.items():
            if word.lower() == text.lower():
                return value
        raise CaseError(not_one_of(text, written.values()))

    def write(value: Any) -> str:
        if value not in written:
            raise CaseError(not_one_of(value, written.values()))
        return written[value]

    return Kind(" | ".join(written.values()), read, write)


def one_of(terms: Mapping[Any, Term], also: Mapping[str, str] | None = None) -> Kind:
    """Return the kind of the values of an enumeration; ``also`` has further words for some."""
    kind = choice({**{value: value for value in terms}, **(also or {})})
    return replace(kind, entry="choice", words=labels(terms), tips=tips(terms))


def integer(low: int, high: int = LARGEST_WHOLE) -> Kind:
    """Return the kind of whole numbers from ``low`` to ``high``."""
    allowed = f"a whole number from {low}{f' to {high}' if high < LARGEST_WHOLE else ''}"

    def read(text: str) -> int:
        if not _WHOLE.match(text):
            raise CaseError(f"{shown(text)} is not {allowed}")
        if not low <= int(text) <= high:
            size = "small" if int(text) < low else "large"
            raise CaseError(f"{text} is too {size}; expected {allowed}")
        return int(text)

    return Kind(allowed, read, str, entry="whole", span=(low, high))


def real(
    low: float, high: float | None = None, closed: bool = False, with_low: bool = False
) -> Kind:
    """Return the kind of numbers above ``low`` and below ``high`` (or equal to it, if closed).

    ``with_low``: or equal to ``low``.
    """
    allowed = f"a number {'of at least' if with_low else 'above'} {low:g}"
    if high is not None:
        allowed += f" {'up to' if closed else 'and below'} {high:g}"

    def read(text: str) -> float:
        value = number(text)
        too_large = high is not None and (value > high or (value == high and not closed))
        if value < low or (value == low and not with_low) or too_large:
            raise CaseError(f"{text} is out of range; expected {allowed}")
        return value

    return Kind(allowed, read, lambda value: repr(float(value)), entry="real")


def _read_path(text: str) -> Path | None:
    if '"' in text:
        words = words_of(text)
        if len(words) != 1:
            raise CaseError(f'{shown(text)} is not one file name; write it as "name"')
        text = words[0].text
    elif is_none([Word(text)]):
        return None
    if not text:
        raise CaseError("the file name is empty; give one, or NONE")
    path = Path(text.replace("\\", "/"))
    if path.name in ("", ".."):
        raise CaseError(f"{shown(text)} is a folder; expected the name of a file")
    return path


def path_text(path: Path) -> str:
    """Return a path as it is written in a case file: with slashes, in quotes where needed.

    Raises CaseError if a case file cannot have it: it is empty, or has a line break or a backslash.
    """
    text = path.as_posix()
    check_writable(text)
    if "\\" in text:
        raise CaseError(f"{text!r} cannot be written to a case file: it has a backslash; rename it")
    if _PLAIN_PATH.match(text) and text.upper() != "NONE":
        return text
    return '"' + text.replace('"', '""') + '"'


def _names(items: Words) -> tuple[str, ...]:
    names = [item.text for item in items]
    if "" in names:
        raise CaseError("a marker has an empty name; give one")
    for name in names:
        if names.count(name) > 1:
            raise CaseError(f"marker {name!r} is listed twice; list it once")
    return tuple(names)


def _write_names(names: tuple[str, ...]) -> str:
    return f"( {', '.join(name_text(name) for name in names)} )"


def _read_ends(text: str) -> tuple[str, str] | None:
    names = _names(list_of(text))
    if len(names) == 1 and names[0].upper() == "AUTO":
        return None
    if len(names) != 2:
        raise CaseError(
            f"{shown(text)} has {counted(len(names), 'name')}; expected AUTO, or two boundaries: "
            "( HUB, SHROUD ), of a wing ( ROOT, TIP )"
        )
    return names[0], names[1]


def _is_su2_form(items: Words) -> bool:
    if not items or len(items) % _SU2_GROUP:
        return False
    groups = [items[i : i + _SU2_GROUP] for i in range(0, len(items), _SU2_GROUP)]
    return all(word.is_number for group in groups for word in group[_SU2_PAIR:])


def _read_pairs(text: str) -> tuple[str, ...]:
    items = list_of(text)
    if _is_su2_form(items):
        items = [item for i, item in enumerate(items) if i % _SU2_GROUP < _SU2_PAIR]
    elif any(item.is_number for item in items) and not all(item.is_number for item in items):
        raise CaseError(
            "there are numbers among the names; write ( A, B ), or nine numbers after each pair "
            "as SU2 does; a name that looks like a number needs quotes"
        )
    return _names(items)


def _read_couples(text: str) -> tuple[str, ...]:
    names = tuple(item.text for item in list_of(text))
    if len(names) % 2:
        raise CaseError(
            f"{shown(text)} has {counted(len(names), 'name')}; expected pairs of boundaries, one "
            "of each zone: ( out_1, in_2, out_2, in_3 )"
        )
    return names


def _remark_pairs(text: str) -> str:
    if not _is_su2_form(list_of(text)):
        return ""
    return (
        "the numbers after the names are not used; the shift or angle is found by matching "
        "the markers node by node"
    )


def read_vector(items: Words, what: str) -> tuple[float, ...]:
    """Return the 2 or 3 numbers of a vector, called ``what`` in messages; or raise CaseError."""
    if len(items) not in (2, 3):
        raise CaseError(f"{what} has {len(items)} values; expected 2 or 3 numbers")
    return tuple(number(item.text) for item in items)


def read_axis(items: Words) -> Vector:
    """Return the direction ``x``, ``y``, ``z`` or of three numbers, of any length; or CaseError."""
    if len(items) == 1 and items[0].text.lower() in AXES:
        return AXES[items[0].text.lower()]
    if len(items) != 3:
        text = " ".join(item.text for item in items)
        raise CaseError(f"{shown(text)} is not an axis; write x, y, z or three numbers")
    x, y, z = map(number, [item.text for item in items])
    if x == y == z == 0.0:
        raise CaseError("the axis (0, 0, 0) has no direction; write x, y, z or another vector")
    return x, y, z


def vector_text(values: tuple[float, ...]) -> str:
    """Return the numbers of a vector in brackets, without loss."""
    return f"({', '.join(repr(float(value)) for value in values)})"


def axis_text(axis: Vector) -> str:
    """Return ``x``, ``y`` or ``z`` for a direction that is just this, else its three numbers."""
    for name, unit in AXES.items():
        # By text, since -0.0 == 0.0 and the two do not give the same bits.
        if repr(tuple(map(float, axis))) == repr(unit):
            return name
    return vector_text(axis)


def _read_origin(text: str) -> Vector:
    values = read_vector(list_of(text), "the point")
    return (*values, 0.0)[:3] if len(values) == 2 else values  # type: ignore[return-value]


YES_NO = replace(
    choice({"YES": True, "NO": False, "TRUE": True, "FALSE": False}),
    entry="switch",
    words={True: "on", False: "off"},
)
PATH = Kind("a file name", _read_path, path_text)
NAMES = Kind("( A, B, ... )", lambda text: _names(list_of(text)), _write_names)
ENDS = Kind(
    "AUTO | ( HUB, SHROUD ) | ( ROOT, TIP )",
    _read_ends,
    lambda names: "AUTO" if names is None else _write_names(names),
)
PAIRS = Kind("( A, B, ... ), also with SU2's numbers", _read_pairs, _write_names, _remark_pairs)
COUPLES = Kind("( A, B, ... )", _read_couples, _write_names)
AXIS = Kind("x | y | z | (x, y, z)", lambda text: read_axis(list_of(text)), axis_text, entry="axis")
POINT = Kind("(x, y) | (x, y, z)", _read_origin, vector_text, entry="point")
