"""Reads the texts of arguments: each function returns a value, or raises CaseError."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf, isfinite
from typing import TYPE_CHECKING, Literal

from slideviz.case.section_shapes import SECTION_SHAPES, ShapeTerms
from slideviz.errors import CaseError, not_one_of
from slideviz.terms import AXES, RATED, Quantity, Range, Texts, WholeNumbers, field_of

if TYPE_CHECKING:
    from slideviz.case.limits import Limit
    from slideviz.design.deformed_wheel import Count
    from slideviz.scene.overview import Zoom
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
            raise CaseError(f"{text!r}: the axis is x, y or z; write e.g. z=0.5")
        normal = AXES[word.strip()]
        if value.count(",") == 1:
            raise CaseError(_comma(text, value.strip().replace(",", ".")))
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
            raise CaseError(f"{text!r} is not {row.size.example}")
        number = value
    digits, _, more = axis.partition(",")
    if digits.strip().isdecimal() and (not more or more.partition(",")[0].strip() in AXES):
        raise CaseError(_comma(text, f"{number.strip()}.{digits.strip()}"))
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
        raise CaseError(f"{text!r}: expected two boundaries, e.g. BLADE,HUB")
    return first, second


def limits(text: str) -> Range:
    """Return the two numbers of a text like ``0.2,0.9``."""
    low, high = _numbers(text, (2,), "lowest,highest, e.g. 0.2,0.9")
    return low, high


def pixels(text: str) -> tuple[int, int]:
    """Return width and height of a text like ``1600x1000``."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text.strip().lower())
    if not match:
        raise CaseError(f"{text!r} is not a size; write e.g. 1600x1000")
    width = int(match[1])
    height = int(match[2])
    if not (300 <= width <= 20000 and 200 <= height <= 20000):
        raise CaseError(f"{text!r}: expected a size from 300x200 to 20000x20000 pixels")
    return width, height


def neighbours(text: str) -> int | Literal["wheel"]:
    """Return the number of passages on each side, or ``wheel``."""
    if text == "wheel":
        return "wheel"
    if not text.isdecimal() or int(text) > MOST_COPIES:
        raise CaseError(f"{text!r}: expected a number from 0 to {MOST_COPIES}, or the word wheel")
    return int(text)


def _section(
    kind: str, origin: Sequence[float], direction: Sequence[float], size: float = 0.0
) -> Section:
    """Return a section, whose missing numbers are 0."""
    # Late: NumPy and Numba take 0.4 s, and help does not need them.
    from slideviz.sections.model import Section

    x, y, z, *_ = *origin, 0.0, 0.0, 0.0
    a, b, c, *_ = *direction, 0.0, 0.0, 0.0
    return Section.of(kind, (x, y, z), (a, b, c), size)


def _numbers(text: str, counts: WholeNumbers, form: str) -> list[float]:
    """Return the numbers of a list like ``form``, as many as one of ``counts``."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        raise CaseError(f"{text!r} is not {form}") from None
    if not all(map(isfinite, values)):
        raise CaseError(f"{text!r} has a number that is not finite")
    if len(values) not in counts:
        raise CaseError(f"{text!r} has {len(values)} numbers; write {form}")
    return values


def metric_names(text: str) -> tuple[Quantity, ...]:
    """Return metrics and numbers of walls of a text: "all", or names with commas, with - or _."""
    fields = {field_of(name): name for name in RATED}
    wanted = [field_of(word.strip().lower()) for word in text.split(",")]
    if wanted == ["all"]:
        return tuple(RATED)
    for word in wanted:
        if word not in fields:
            raise CaseError(not_one_of(word, ("all", *fields)))
    return tuple(fields[word] for word in wanted)


def zoom(text: str) -> Zoom:
    """Return the detail for ``X,Y,WIDTH`` or ``X,Y,Z,WIDTH``; a word of `Zoom` as it is."""
    if text == "auto":
        return "auto"
    if text == "all":
        return "all"
    if text == "view":
        return "view"
    # Late: NumPy takes 0.1 s, and help does not need it.
    from slideviz.scene.overview import Detail

    try:
        *centre, width = map(float, text.split(","))
    except ValueError:
        centre = []
        width = 0.0
    if len(centre) not in (2, 3) or not (all(map(isfinite, centre)) and 0.0 < width < inf):
        raise CaseError(
            f"{text!r} is neither X,Y,WIDTH (X,Y,Z,WIDTH in 3D; WIDTH > 0) nor all, auto or view"
        )
    return Detail(tuple(centre), width)


def integer(text: str) -> int:
    """Parse a whole number, written like ``20000`` or ``1e8``."""
    try:
        number = float(text)
    except ValueError:
        number = 0.5
    if not number.is_integer():
        raise CaseError(f"{text!r} is not a whole number; write e.g. 20000 or 1e8")
    return int(text) if text.strip().lstrip("+-").isdigit() else int(number)


def size(text: str) -> tuple[int, int]:
    """Return width and height of a text like ``1280x800``."""
    width, sign, height = text.lower().partition("x")
    if not (sign and width.isdecimal() and height.isdecimal()):
        raise CaseError(f"{text!r} is not of the form WIDTHxHEIGHT; write e.g. 1280x800")
    return int(width), int(height)


def quality_limits(text: str) -> tuple[Limit, ...]:
    """Return the limits of a text."""
    # Late: the case takes 0.5 s, and help does not need it.
    from slideviz.case.limits import read_limits

    found = read_limits(text)
    if not found:
        raise CaseError(f"{text!r} has no limit; write e.g. min > 0.3")
    return found


def names_in(text: str) -> Texts:
    """Return the names of a text, separated by commas."""
    return tuple(filter(None, (name.strip() for name in text.split(","))))


def repair_below(text: str) -> float:
    """Return the value of a text as of the key REPAIR_BELOW."""
    # Late: the case takes 0.5 s, and help does not need it.
    from slideviz.case.keys import KEYS

    return float(KEYS["REPAIR_BELOW"].kind.read(text))


def passages(text: str) -> Count | list[Count]:
    """Return a number of passages, or "all"; with commas one for each zone."""
    words = [word.strip() for word in text.split(",")]
    counts: list[Count] = ["all" if word.lower() == "all" else integer(word) for word in words]
    return counts if len(counts) > 1 else counts[0]
