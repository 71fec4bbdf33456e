"""Splits a value of a case file into words: names, numbers, brackets, commas and quoted text.

``MARKER_MOVING= (BLADE, "tip #2")`` has the words ``(``, ``BLADE``, ``,``, ``tip #2``, ``)``.
Text between double quotes is one word, whatever it has; two quotation marks inside are read as
one. So a name may have any character but a line break.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from slideviz.argument_types import frozen
from slideviz.errors import CaseError, Message, shown
from slideviz.mesh.check import LARGEST

LARGEST_ANGLE = 1e9  # in degrees
COMMENT_SIGNS = "%#$"
_WORD = re.compile(r'"(?P<quoted>(?:[^"]|"")*)"|(?P<sign>[(),;])|(?P<plain>[^\s(),;"]+)|(?P<bad>")')
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?\Z")
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_.:/@+-]+\Z")


@frozen
class Word:
    """A word of a value; one in quotes is never taken as a sign, a number or ``NONE``."""

    text: str
    quoted: bool = False

    def is_sign(self, sign: str) -> bool:
        """Return whether the word is the bracket, comma or semicolon ``sign``."""
        return not self.quoted and self.text == sign

    @property
    def is_number(self) -> bool:
        """Return whether the word is a decimal number."""
        return not self.quoted and is_number(self.text)


Words = list[Word]


def words_of(text: str) -> Words:
    """Return the words of a value, brackets and separators among them, or raise CaseError."""
    words = []
    for match in _WORD.finditer(text):
        if match["bad"]:
            raise CaseError(f"the quotation mark in {shown(text)} is not closed; close it")
        if match["quoted"] is not None:
            words.append(Word(match["quoted"].replace('""', '"'), quoted=True))
        else:
            words.append(Word(match[0]))
    return words


def groups_of(words: Iterable[Word]) -> list[Words]:
    """Return the words of each part between semicolons, without brackets and commas."""
    groups: list[Words] = [[]]
    for word in words:
        if word.is_sign(";"):
            groups.append([])
        elif not any(word.is_sign(sign) for sign in "(),"):
            groups[-1].append(word)
    return groups


def without_comment(line: str, signs: str = COMMENT_SIGNS) -> str:
    """Return the line up to the first of the comment ``signs`` that is not in quotes."""
    inside = False
    for place, sign in enumerate(line):
        if sign == '"':
            inside = not inside
        elif sign in signs and not inside:
            return line[:place]
    return line


def list_of(text: str) -> Words:
    """Return the items of ``(A, B)``, ``A, B`` or ``A B``; [] for ``( )``, ``(NONE)``."""
    words = words_of(text)
    opened = bool(words) and words[0].is_sign("(")
    closed = bool(words) and words[-1].is_sign(")")
    if opened != closed:
        raise CaseError(
            f"a bracket of {shown(text)} is missing; a list that continues in the next line needs "
            f"a backslash at the end of its line"
        )
    items = [word for word in words[opened : len(words) - closed] if not word.is_sign(",")]
    for item in items:
        if any(item.is_sign(sign) for sign in "();"):
            raise CaseError(f"{shown(text)} is not one list of names; write ( A, B )")
    return [] if is_none(items) else items


def is_none(words: Sequence[Word]) -> bool:
    """Return whether the only word is ``NONE``, SU2's word for an empty list or value."""
    return len(words) == 1 and not words[0].quoted and words[0].text.upper() == "NONE"


def is_number(text: str) -> bool:
    """Return whether the text is a decimal number; ``nan``, ``inf`` and ``1_000`` are not."""
    return _NUMBER.match(text) is not None


def number(text: str) -> float:
    """Return the number that a text is; CaseError if it is none, or too large to compute with."""
    if not is_number(text):
        remedy = "write decimals with a point" if is_number(text.replace(",", ".")) else ""
        raise CaseError(Message("is not a number", remedy, value=shown(text)))
    value = float(text)
    if abs(value) > LARGEST:
        raise CaseError(
            f"{shown(text)} is too large to compute with; expected a number up to {LARGEST:g}"
        )
    return value


def angle_deg(text: str) -> float:
    """Return the angle in degrees that a text is; CaseError if none of its digits counts."""
    value = number(text)
    if abs(value) > LARGEST_ANGLE:
        raise CaseError(
            f"the angle {text} is too large: expected degrees up to {LARGEST_ANGLE:g}, above which "
            "rounding is more than a ten millionth of a degree"
        )
    return value


def name_text(name: str) -> str:
    """Return a name as in a case file, in quotes where needed; CaseError as `check_writable`."""
    check_writable(name)
    if _PLAIN_NAME.match(name) and not is_number(name) and name.upper() != "NONE":
        return name
    return '"' + name.replace('"', '""') + '"'


def check_writable(text: str) -> None:
    """Raise CaseError if a text is empty, or cannot be written in a line of UTF-8."""
    if not text:
        raise CaseError("an empty name cannot be written to a case file; give it a name")
    if any(sign in text for sign in "\n\r\0"):
        raise CaseError(
            f"{text!r} cannot be written to a case file: it has a line break; rename it"
        )
    try:
        text.encode("utf-8")
    except UnicodeEncodeError as problem:
        raise CaseError(
            f"{text!r} cannot be written to a case file: it is not UTF-8; rename it"
        ) from problem


def counted(number: int, what: str) -> str:
    """Return a number with a noun in singular or plural: 1 step, 2,000 steps."""
    return f"{number} {what}" if number == 1 else f"{number:,} {what}s"


def first_of(items: Sequence[object], most: int = 3) -> str:
    """Return the first items of a list, separated by commas."""
    more = ", ..." if len(items) > most else ""
    return ", ".join(map(str, items[:most])) + more


def wrong_by(part: float, *, bounded: bool) -> str:
    """Return an error, a part of the largest value, in words: ``bounded``, or as measured."""
    digits = float(f"{100.0 * part:.2g}")  # not 1e+02
    percent = f"{digits:g} % of the largest"
    return f"up to {percent}" if bounded else f"{percent} or more; how much more is unknown"
