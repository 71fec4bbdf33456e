"""Reads the texts of sections, sizes and limits in the options of ``slideviz section``."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Literal

from slideviz.case.section_shapes import SECTION_SHAPES, ShapeTerms
from slideviz.errors import CaseError
from slideviz.terms import AXES

if TYPE_CHECKING:
    from slideviz.sections.model import Section


MOST_COPIES = 100  # most passages on each side: more could not be seen, and take too long to draw


def glued(argv: Sequence[str]) -> list[str]:
    """Return the words, with a value like ``-1,0,0`` joined by ``=`` to its option for argparse."""
    words: list[str] = []
    for word in argv:
        if (
            words
            and words[-1] in (*(f"--{name}" for name in SECTION_SHAPES), "--range", "--zoom")
            and re.match(r"-[\d.]", word)
        ):
            words[-1] += "=" + word
        else:
            words.append(word)
    return words


@dataclass(frozen=True)
class SectionArgument:
    """The section that an option describes; ``axis``: whether with its axis or normal."""

    section: Section
    axis: bool = True


def section_reader(row: ShapeTerms) -> Callable[[str], SectionArgument]:
    """Return the function that reads the option's text for a shape."""
    return partial(section_about_axis, row) if row.size is not None else plane


def plane(text: str) -> SectionArgument:
    """Return the plane of a text like ``0,0,1,0,0,0.5`` (normal, point) or ``z=0.5``."""
    word, sign, value = text.partition("=")
    if sign:
        if word.strip() not in AXES:
            raise argparse.ArgumentTypeError(f"{text!r}: the axis is x, y or z; write e.g. z=0.5")
        normal = AXES[word.strip()]
        if value.count(",") == 1:
            raise argparse.ArgumentTypeError(_comma(text, value.strip().replace(",", ".")))
        (at,) = _numbers(value, (1,), "a coordinate, e.g. z=0.5")
        return SectionArgument(_section("plane", [at * part for part in normal], normal))
    values = _numbers(text, (4, 6), "nx,ny,nz,x,y,z or an axis and a coordinate, e.g. z=0.5")
    half = len(values) // 2
    return SectionArgument(_section("plane", values[half:], values[:half]))


def section_about_axis(row: ShapeTerms, text: str) -> SectionArgument:
    """Return the cylinder or cone of a text like ``0.25``, ``r=0.25,x`` or ``0.25,0,0,1``.

    That is its size, then its axis, if given, and a point on it; the axis is z where it is not.
    """
    assert row.size is not None
    number, _, axis = text.partition(",")
    word, sign, value = number.partition("=")
    if sign:
        if word.strip() not in (row.letter, row.size.word):
            raise argparse.ArgumentTypeError(f"{text!r} is not {row.size.example}")
        number = value
    digits, _, more = axis.partition(",")
    if digits.strip().isdecimal() and (not more or more.partition(",")[0].strip() in AXES):
        raise argparse.ArgumentTypeError(_comma(text, f"{number.strip()}.{digits.strip()}"))
    (size,) = _numbers(number, (1,), row.size.example)
    if not axis:
        return SectionArgument(_section(row.value, (), AXES["z"], size), False)
    word, _, point = axis.partition(",")
    if word.strip() in AXES:
        at = _numbers(point, (3,), "x, y or z, then cx,cy,cz") if point else ()
        return SectionArgument(_section(row.value, at, AXES[word.strip()], size))
    values = _numbers(axis, (3, 6), "x, y, z, ax,ay,az or ax,ay,az,cx,cy,cz")
    return SectionArgument(_section(row.value, values[3:], values[:3], size))


def _comma(text: str, number: str) -> str:
    """Return the message that a comma stands in ``text`` where ``number`` has a point."""
    return f"{text!r}: a comma separates numbers; write a decimal point, e.g. {number}"


def pair_of_names(text: str) -> tuple[str, str]:
    """Return the two boundaries of a text like ``BLADE,HUB``."""
    first, _, second = map(str.strip, text.partition(","))
    if not first or not second or "," in second:
        raise argparse.ArgumentTypeError(f"{text!r}: expected two boundaries, e.g. BLADE,HUB")
    return first, second


def limits(text: str) -> tuple[float, float]:
    """Return the two numbers of a text like ``0.2,0.9``."""
    low, high = _numbers(text, (2,), "lowest,highest, e.g. 0.2,0.9")
    return low, high


def pixels(text: str) -> tuple[int, int]:
    """Return width and height of a text like ``1600x1000``."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text.strip().lower())
    if not match:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size; write e.g. 1600x1000")
    width = int(match[1])
    height = int(match[2])
    if not (300 <= width <= 20000 and 200 <= height <= 20000):
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected a size from 300x200 to 20000x20000 pixels"
        )
    return width, height


def neighbours(text: str) -> int | Literal["wheel"]:
    """Return the number of passages on each side, or ``wheel``."""
    if text == "wheel":
        return "wheel"
    if not text.isdecimal() or int(text) > MOST_COPIES:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected a number from 0 to {MOST_COPIES}, or the word wheel"
        )
    return int(text)


def _section(
    kind: str, origin: Sequence[float], direction: Sequence[float], size: float = 0.0
) -> Section:
    """Return a section; its CaseError becomes an ArgumentTypeError. Missing numbers are 0."""
    # Late: NumPy and Numba take 0.4 s, and help does not need them.
    from slideviz.sections.model import Section

    x, y, z, *_ = *origin, 0.0, 0.0, 0.0
    a, b, c, *_ = *direction, 0.0, 0.0, 0.0
    try:
        return Section.of(kind, (x, y, z), (a, b, c), size)
    except CaseError as problem:
        raise argparse.ArgumentTypeError(str(problem)) from problem


def _numbers(text: str, counts: tuple[int, ...], form: str) -> list[float]:
    """Return the numbers of a list like ``form``, as many as one of ``counts``."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not {form}") from None
    if not all(map(isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r} has a number that is not finite")
    if len(values) not in counts:
        raise argparse.ArgumentTypeError(f"{text!r} has {len(values)} numbers; write {form}")
    return values
