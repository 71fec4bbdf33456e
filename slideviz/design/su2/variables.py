"""The design variables of SU2's configurations: kinds, parameters and values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from slideviz.case.lines import Entry, Problem
from slideviz.case.words import Word, counted, groups_of, list_of, number, words_of
from slideviz.errors import CaseError

KINDS = {
    "TRANSLATION": "(x, y, z)",
    "ROTATION": "(x0, y0, z0, x1, y1, z1)",
    "SCALE": "(1.0)",
    "SURFACE_FILE": "(1.0)",
    "FFD_SETTING": "(1.0)",
    "FFD_CONTROL_POINT_2D": "(BOX, i, j, dx, dy)",
    "FFD_CONTROL_POINT": "(BOX, i, j, k, dx, dy, dz)",
}
"""The supported kinds, and the form of their parameters in DV_PARAM."""
BOXED = {"FFD_CONTROL_POINT_2D": 5, "FFD_CONTROL_POINT": 7}
"""Kinds that move a control point, and how many parameters they have."""
NUMBERS = {"TRANSLATION": 3, "ROTATION": 6}
"""Kinds with numbers as parameters, and how many they have."""
ALONE = ("SURFACE_FILE", "FFD_SETTING")
"""Kinds that must be the only variable."""


@dataclass(frozen=True)
class DesignVariable:
    """A design variable.

    Attributes
    ----------
    kind : str
        One of ``KINDS``.
    value : float
    numbers : tuple of float
        Its parameters: a direction, two points, or the shift (dx, dy, dz) of a control point.
    box, index : str, (int, int, int)
        Box and control point, for kinds in ``BOXED``; an index of -1 means all.
    """

    kind: str
    value: float
    numbers: tuple[float, ...] = ()
    box: str = ""
    index: tuple[int, int, int] = (0, 0, 0)


def read_variables(
    rows: Mapping[str, Entry], problems: list[Problem]
) -> tuple[DesignVariable, ...]:
    """Return the design variables of ``DV_KIND``, ``DV_PARAM`` and ``DV_VALUE``.

    Mistakes are appended to ``problems``; none comes back where DV_KIND is missing or wrong.
    """
    kind_row = rows.get("DV_KIND")
    if kind_row is None:
        return ()
    try:
        kinds = [word.text.upper() for word in list_of(kind_row.value)]
    except CaseError as problem:
        problems.append((kind_row.line, f"DV_KIND: {problem}"))
        return ()
    strange = [kind for kind in dict.fromkeys(kinds) if kind not in KINDS]
    if strange or not kinds:
        said = f"{', '.join(strange)} not supported" if strange else "names no design variable"
        problems.append((kind_row.line, f"DV_KIND: {said}; supported: {', '.join(KINDS)}"))
        return ()
    alone = [kind for kind in kinds if kind in ALONE]
    if alone and len(kinds) > 1:
        problems.append((kind_row.line, f"DV_KIND: {alone[0]} must stand alone; make two runs"))
        return ()
    found = []
    values, groups = _values(rows, kinds, problems), _groups(rows, kinds, problems)
    for place, (kind, value, group) in enumerate(zip(kinds, values, groups, strict=False), start=1):
        try:
            found.append(_variable(kind, value, group))
        except CaseError as problem:
            problems.append((rows["DV_PARAM"].line, f"DV_PARAM: variable {place}: {problem}"))
    return tuple(found)


def _values(rows: Mapping[str, Entry], kinds: list[str], problems: list[Problem]) -> list[float]:
    """Return a value for each variable; 0 where it is missing, which kinds in ``ALONE`` may be."""
    entry = rows.get("DV_VALUE")
    if entry is None:
        if kinds[0] not in ALONE:
            problems.append(
                (rows["DV_KIND"].line, "DV_VALUE is missing: a value for each variable")
            )
        return [0.0] * len(kinds)
    try:
        values = [number(word.text) for word in list_of(entry.value)]
    except CaseError as problem:
        problems.append((entry.line, f"DV_VALUE: {problem}"))
        return [0.0] * len(kinds)
    if len(values) != len(kinds) and kinds[0] not in ALONE:
        said = f"DV_VALUE has {_for(len(values), 'value', kinds)}"
        problems.append((entry.line, said))
    return (values + [0.0] * len(kinds))[: len(kinds)]


def _groups(
    rows: Mapping[str, Entry], kinds: list[str], problems: list[Problem]
) -> list[list[Word]]:
    """Return the parameters of each variable; empty where DV_PARAM is wrong."""
    entry = rows.get("DV_PARAM")
    if entry is None:
        if any(kind in BOXED or kind in NUMBERS for kind in kinds):
            problems.append((rows["DV_KIND"].line, "DV_PARAM is missing: ( ... ) ; ( ... )"))
            return []
        return [[] for _ in kinds]
    try:
        groups = groups_of(words_of(entry.value))
    except CaseError as problem:
        problems.append((entry.line, f"DV_PARAM: {problem}"))
        return []
    groups = groups[:-1] if not groups[-1] else groups  # a semicolon after the last
    if len(groups) != len(kinds):
        said = f"DV_PARAM has {_for(len(groups), 'group', kinds)}"
        problems.append((entry.line, said))
    return groups


def _for(number: int, what: str, kinds: list[str]) -> str:
    return f"{counted(number, what)} for {counted(len(kinds), 'variable')}; give one each"


def _variable(kind: str, value: float, group: list[Word]) -> DesignVariable:
    """Return the variable with the parameters ``group``; raises CaseError where they are wrong."""
    needed = f"{kind} needs {KINDS[kind]}"
    if kind in NUMBERS:
        numbers = tuple(number(word.text) for word in group)
        if len(numbers) != NUMBERS[kind]:
            raise CaseError(f"{len(numbers)} numbers are given; {needed}")
        return DesignVariable(kind, value, numbers)
    if kind not in BOXED:
        return DesignVariable(kind, value)
    if len(group) != BOXED[kind]:
        raise CaseError(f"{len(group)} parameters are given; {needed}")
    count = 3 if kind == "FFD_CONTROL_POINT" else 2
    at = [number(word.text) for word in group[1 : 1 + count]]
    if any(place != int(place) or place < -1 for place in at):
        raise CaseError(f"an index is no whole number from -1; {needed}")
    i, j, k = (*(int(place) for place in at), -1)[:3]
    shift = tuple(number(word.text) for word in group[1 + count :])
    return DesignVariable(kind, value, (*shift, 0.0)[:3], group[0].text, (i, j, k))
