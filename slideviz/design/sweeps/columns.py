"""The columns of a table of designs: numbers of the case's motions, and keys of the case.

The name of a number is ``BLADE.translate.y``: marker, kind of motion, and number; or, by the place
of the motion in ``MOTION``, ``motion2.y``, which is needed where two motions of one kind move the
same marker. The name of a box's number has the control point, ``BLADE.ffd.BOX.1.0.0.y``, that of a
bump its side, ``WING.hicks-henne.upper.height``, that of a curve over the span the span of its
point, ``BLADE.twist.0.5``. The name of a key is that of ``--set``, ``STEPS``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

from slideviz.case.cfg import set_key
from slideviz.case.key import FILES, VIEW
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.motions.kinds import KIND_OF, KINDS
from slideviz.case.motions.motion import Motion
from slideviz.case.words import number
from slideviz.errors import CaseError, Message, nearest, raise_all, shown

Value = str | float
"""A number of a motion, or the text of a key's value; an empty text means the case's own value."""

_ALSO = {"angle": "angle_deg"} | {k: v for kind in KINDS for k, v in kind.words.items()}
"""Names of numbers in the grammar of ``MOTION``, and their names here."""
TIME = "time"
"""The column with the time of a design, which changes nothing but the name of its mesh."""
_WHOLE_MOTION = ("MOTION", "DEFORMATION_FILENAME")
_LISTED = 24


@dataclass(frozen=True)
class NumberPlace:
    """The place of a number: index of the motion, its field, and component of the field."""

    motion: int
    field: str
    component: int | None = None

    def of(self, case: Case) -> float:
        """Return the number of a case at this place."""
        value = getattr(case.motions[self.motion], self.field)
        return float(value if self.component is None else value[self.component])

    def put(self, motions: list[Motion], value: float) -> None:
        """Replace the number at this place in a list of motions, in place."""
        motion = motions[self.motion]
        new: Any = value
        if self.component is not None:
            several = list(getattr(motion, self.field))
            several[self.component] = value
            new = tuple(several)
        motions[self.motion] = replace(motion, **{self.field: new})


def numbers_of(case: Case) -> dict[str, NumberPlace]:
    """Return the places of all numbers of a case's motions, by their shortest unique name."""
    places: dict[str, NumberPlace] = {}
    heads = [motion.design_name() for motion in case.motions]
    for at, (motion, head) in enumerate(zip(case.motions, heads, strict=True)):
        name = head if heads.count(head) == 1 else f"motion{at + 1}"
        places |= {f"{name}.{part}": place for part, place in _parts(motion, at)}
    return places


def columns_of(case: Case, names: Iterable[str]) -> dict[str, NumberPlace | str]:
    """Return for each column's name the place of its number, or its key; or raise CaseError."""
    columns: dict[str, NumberPlace | str] = {}
    first: dict[NumberPlace | str, str] = {}
    problems = list[Message]()
    known = _all_names(case)
    for name in names:
        try:
            meant = _column_meaning(case, name, known)
            if first.setdefault(meant, name) != name or name in columns:
                raise CaseError(f"it means the same as column {first[meant]}; keep one of them")
            columns[name] = meant
        except CaseError as problem:
            problems += problem.within(f"column {shown(name)}")
    places = [name for name, what in columns.items() if isinstance(what, NumberPlace)]
    whole = [name for name, what in columns.items() if what in _WHOLE_MOTION]
    if places and whole:
        rule = (
            f"column {shown(whole[0])} replaces motions whose numbers column {shown(places[0])} "
            "changes; keep one of them"
        )
        problems.append(Message(rule))
    raise_all(problems)
    return columns


def applied(
    case: Case, columns: Mapping[str, NumberPlace | str], values: Mapping[str, Value]
) -> Case:
    """Return the case with the values of one design; an empty value leaves the case's own.

    Raises CaseError if some values are wrong: a sentence for each, which names the column.
    """
    problems = list[Message]()
    keys = {what: name for name, what in columns.items() if isinstance(what, str)}
    # In the order of the table, as in a case file: a key may be needed for another.
    for key in (key for key in KEYS if key in keys):
        try:
            text = _text(values.get(keys[key], ""))
            case = set_key(case, key, text) if text else case
        except CaseError as problem:
            column = f"column {shown(keys[key])}"  # instead of the option
            problems += [replace(m, place=(column, *m.place[1:])) for m in problem.messages]
    motions = list(case.motions)
    for name, place in columns.items():
        value = values.get(name, "")
        if isinstance(place, str) or value == "":
            continue
        try:
            place.put(motions, number_of(value))
        except CaseError as problem:
            problems += problem.within(f"column {shown(name)}")
    raise_all(problems)
    return case.change(motions=tuple(motions))


def column_name(name: str) -> str:
    """Return the name of a column in results: a key in capitals, else as it was given."""
    plain = name.strip()
    if plain.lower() == TIME:
        return TIME
    return plain.upper() if plain.upper() in KEYS else plain


def case_values(case: Case, columns: Mapping[str, NumberPlace | str]) -> dict[str, Value]:
    """Return the case's own value for each column: a number, or a text."""
    values: dict[str, Value] = {}
    for name, what in columns.items():
        if isinstance(what, NumberPlace):
            values[name] = what.of(case)
        elif what == TIME:
            values[name] = ""
        else:
            value = KEYS[what].get(case)
            values[name] = "" if value is None else KEYS[what].kind.write(value)
    return values


def _column_meaning(case: Case, name: str, known: Mapping[str, NumberPlace]) -> NumberPlace | str:
    """Return the place of a number, or the key, that a name means.

    ``known`` are the numbers by all their names: the shortest, and by the place of the motion.
    Raises CaseError where the name means nothing, several numbers, or a key that cannot vary.
    """
    key = name.strip().upper()
    if name == TIME:
        return TIME
    if key in KEYS:
        if KEYS[key].group in (FILES, VIEW):
            raise CaseError("files and the view come from the case for all designs")
        return key
    wanted = _normalized_name(name)
    if wanted in known:
        return known[wanted]
    # Markers may differ in capitals alone.
    places = {place for other, place in known.items() if other.lower() == wanted.lower()}
    if len(places) == 1:
        return places.pop()
    shortest = numbers_of(case)
    several = any(
        f"{motion.design_name()}.{part}".lower() == wanted.lower()
        for at, motion in enumerate(case.motions)
        for part, _ in _parts(motion, at)
    )
    if several:
        raise CaseError(f"several motions have it; say which, e.g. {_names_text(shortest)}")
    there = (
        f"the motions have {_names_text(shortest)}" if shortest else "the motions have no numbers"
    )
    if absent := _absent_motion(case, name):
        raise CaseError(f"the case has no motion {absent}; add one to MOTION, for {there}")
    close = nearest(name, [*shortest, *KEYS])
    raise CaseError(
        "there is no such number of a motion and no such key"
        f"{close or f'; {there}; `slideviz keys` lists the keys'}"
    )


def _absent_motion(case: Case, name: str) -> str:
    """Return the motion of a moving boundary that a column is about, if the case has none such."""
    match = re.match(rf"\s*(.+?)\.({'|'.join(KIND_OF)})(?:\.|\s*\Z)", name, re.IGNORECASE)
    if match is None or match[1].lower() not in {
        "*",
        *(marker.lower() for marker in case.markers_with("moving")),
    }:
        return ""
    begin = f"{match[1]}.{match[2]}.".lower()
    has = any(f"{motion.design_name()}.".lower().startswith(begin) for motion in case.motions)
    return "" if has else f"({match[1]}, {match[2].lower()}, ...)"


def _all_names(case: Case) -> dict[str, NumberPlace]:
    return numbers_of(case) | {
        f"motion{at + 1}.{part}": place
        for at, motion in enumerate(case.motions)
        for part, place in _parts(motion, at)
    }


def _normalized_name(name: str) -> str:
    """Return the name of a number with its last part in lower case, as here (`_ALSO`)."""
    head, dot, part = name.strip().rpartition(".")
    return f"{head}{dot}{_ALSO.get(part.lower(), part.lower())}"


def _parts(motion: Motion, place: int) -> Iterator[tuple[str, NumberPlace]]:
    for name, field, component in motion.design_numbers():
        yield name, NumberPlace(place, field, component)


def _names_text(known: Iterable[str]) -> str:
    names = list(known)
    return ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")


def number_of(value: Value) -> float:
    """Return a value of a table as a finite number; raise CaseError if it is not."""
    if isinstance(value, str):
        return number(value.strip())
    if not isinstance(value, Real) or not math.isfinite(value):
        raise CaseError(f"{value!r} is not a finite number")
    return float(value)


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value.strip()
    if isinstance(value, bool):
        return "YES" if value else "NO"
    # 5.0 is what tables of numbers make of 5.
    return format(value, ".17g") if isinstance(value, float) and value.is_integer() else str(value)
