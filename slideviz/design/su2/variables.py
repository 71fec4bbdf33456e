"""The design variables of SU2's configurations: the table of kinds, and how a list is read.

SU2 reads ``DV_PARAM`` and ``DV_VALUE`` as streams of words (``COptionDVParam``): it has as many
variables as ``DV_PARAM`` has parts between semicolons, and passes over what follows the last one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Literal

from slideviz.case.lines import Entry
from slideviz.case.words import Word, counted, groups_of, list_of, number, words_of
from slideviz.errors import CaseError, Message, Remark, nearest, note

Group = Literal["nothing", "boxes", "ffd", "file", "grid", "surface", "naca", "parabolic"]
"""What SU2 does with a list of variables; the first kind decides it for all of them."""

ALIKE = 0.7
"""Similarity (``difflib``, 0 to 1) from which a key may be one that is missing, misspelt."""


@dataclass(frozen=True)
class VariableKind:
    """A kind of design variable."""

    group: Group
    form: str = ""
    """Names of the parameters in DV_PARAM; BOX is the name of an FFD box, i, j, k are indices."""
    order: int = 0  # place among the passes over the variables of the group "surface"
    several: str = ""  # parameters that, where all are 0, are replaced by as many values
    refused: str = ""  # why the kind is not supported; empty where it is

    @property
    def parameters(self) -> list[str]:
        """Return the names of the parameters."""
        return self.form.replace(",", " ").split()


KINDS = {
    "NO_DEFORMATION": VariableKind("nothing"),
    "TRANSLATION": VariableKind("surface", "x, y, z", 1),
    "ROTATION": VariableKind("surface", "x0, y0, z0, x1, y1, z1", 1),
    "SCALE": VariableKind("surface", "", 1),
    "HICKS_HENNE": VariableKind("surface", "side, x", 2),
    "CST": VariableKind("surface", "side, k, n", 3),
    "SURFACE_BUMP": VariableKind("surface", "x0, x1, x", 4),
    "ANGLE_OF_ATTACK": VariableKind("surface", "one", 5),
    "HICKS_HENNE_CAMBER": VariableKind("surface", "x", 6),
    "NACA_4DIGITS": VariableKind("naca", "digit1, digit2, digits34"),
    "PARABOLIC": VariableKind("parabolic", "x, thickness"),
    "AIRFOIL": VariableKind(
        "nothing",
        "one, two",
        refused="is not supported, because SU2 asks for its file at a terminal; use SURFACE_FILE",
    ),
    "SURFACE_FILE": VariableKind("file"),
    "TRANSLATE_GRID": VariableKind("grid", "x, y, z"),
    "ROTATE_GRID": VariableKind("grid", "x0, y0, z0, x1, y1, z1"),
    "SCALE_GRID": VariableKind("grid"),
    "FFD_SETTING": VariableKind("boxes"),
    "FFD_CONTROL_POINT": VariableKind("ffd", "BOX, i, j, k, dx, dy, dz", several="dx, dy, dz"),
    "FFD_CONTROL_POINT_2D": VariableKind("ffd", "BOX, i, j, dx, dy", several="dx, dy"),
    "FFD_CAMBER": VariableKind("ffd", "BOX, i, j"),
    "FFD_CAMBER_2D": VariableKind("ffd", "BOX, i"),
    "FFD_THICKNESS": VariableKind("ffd", "BOX, i, j"),
    "FFD_THICKNESS_2D": VariableKind("ffd", "BOX, i"),
    "FFD_TWIST": VariableKind("ffd", "BOX, j, x0, y0, z0, x1, y1, z1"),
    "FFD_ROTATION": VariableKind("ffd", "BOX, x0, y0, z0, x1, y1, z1"),
    "FFD_CONTROL_SURFACE": VariableKind("ffd", "BOX, x0, y0, z0, x1, y1, z1"),
    "FFD_GULL": VariableKind("ffd", "BOX, j"),
    "FFD_NACELLE": VariableKind("ffd", "BOX, i, j, k, dr, dx"),
    "FFD_ANGLE_OF_ATTACK": VariableKind("ffd", "BOX, one"),
    "FFD_TWIST_2D": VariableKind(
        "ffd",
        "BOX, x, y",
        refused="is not supported: it moved nothing in SU2 7, and SU2 8 lacks it",
    ),
    "ELECTRIC_FIELD": VariableKind("nothing", "one, two"),
    "YOUNG_MODULUS": VariableKind("nothing"),
    "POISSON_RATIO": VariableKind("nothing"),
    "STRUCTURAL_DENSITY": VariableKind("nothing"),
    "DEAD_WEIGHT": VariableKind("nothing"),
}
"""SU2's kinds (8.3, and those of 7 that it dropped), by their name in DV_KIND."""
WITHOUT_VALUE = ("nothing", "boxes", "file", "naca", "parabolic")
"""Groups whose values mean nothing."""
EXCLUSIVE = ("naca", "parabolic")
"""Groups of which SU2 takes one variable only: it stops, and waits for a key."""


@dataclass(frozen=True)
class DesignVariable:
    """A design variable."""

    kind: str
    values: tuple[float, ...]  # one, or a value for each parameter in `VariableKind.several`
    numbers: tuple[float, ...] = ()  # its parameters without the box, as in `VariableKind.form`
    box: str = ""
    ignored: bool = False  # whether it does nothing, beside the others in the list

    @property
    def value(self) -> float:
        """Return the value, of several the first."""
        return self.values[0]

    @property
    def group(self) -> Group:
        """Return the group of its kind."""
        return KINDS[self.kind].group

    @property
    def is_angle(self) -> bool:
        """Return whether the variable is an angle of attack, which moves no node."""
        return self.kind.endswith("ANGLE_OF_ATTACK") and not self.ignored

    def parameter(self, name: str, default: float = 0.0) -> float:
        """Return the parameter of a name in `VariableKind.form`; ``default`` where it has none."""
        names = [one for one in KINDS[self.kind].parameters if one != "BOX"]
        return dict(zip(names, self.numbers, strict=True)).get(name, default)


NOTHING = (DesignVariable("NO_DEFORMATION", (0.0,)),)


def supported() -> list[str]:
    """Return the names of the kinds that are supported."""
    return [name for name, kind in KINDS.items() if not kind.refused]


def form(name: str) -> str:
    """Return the parameters of a kind in words, as in DV_PARAM."""
    return f"({KINDS[name].form or '1.0'})"


def read_variables(
    rows: Mapping[str, Entry], problems: list[Message], warnings: list[Remark]
) -> tuple[DesignVariable, ...]:
    """Return the design variables of ``DV_KIND``, ``DV_PARAM`` and ``DV_VALUE``.

    Mistakes are appended to ``problems``, sentences about what is ignored to ``warnings``; no
    variable comes back where DV_KIND is missing or wrong.
    """
    row = rows.get("DV_KIND")
    if row is None:
        return ()
    try:
        kinds = [word.text.upper() for word in list_of(row.value)]
    except CaseError as problem:
        problems += problem.within("DV_KIND", line=row.line)
        return ()
    if strange := _strange(kinds):
        problems += CaseError(*strange).within("DV_KIND", line=row.line)
        return ()
    groups = _groups(rows, kinds, problems, warnings)
    variables = []
    for place, (kind, group) in enumerate(zip(kinds, groups, strict=False), start=1):
        try:
            variables.append(_variable(kind, group))
        except CaseError as problem:
            problems += problem.within("DV_PARAM", f"variable {place}", line=rows["DV_PARAM"].line)
            continue
        if (side := variables[-1].parameter("side")) not in (0.0, 1.0):
            said = f"side {side:g} is neither 0 (lower) nor 1 (upper): as in SU2, the upper side"
            warnings.append(f"DV_PARAM: variable {place} ({kind}): {said}")
    if len(variables) < len(groups):
        return ()
    variables = _with_values(rows, variables, problems, warnings)
    problems += CaseError(*_contradictions(variables)).within("DV_KIND", line=row.line)
    return _dispatched(variables, warnings)


def misspelt(key: str, rows: Mapping[str, Entry]) -> str:
    """Return where a key that is missing may stand misspelt; empty if no key resembles it."""
    here = [name for name, row in rows.items() if row.line >= 0]
    close = get_close_matches(key, here, n=1, cutoff=ALIKE)
    return f"; did you mean it by {close[0]} in line {rows[close[0]].line}?" if close else ""


def _strange(kinds: list[str]) -> list[str]:
    """Return a sentence for each kind that is unknown or not supported, or that there is none."""
    if not kinds:
        return [f"names no design variable; supported: {', '.join(supported())}"]
    messages = []
    for kind in dict.fromkeys(kinds):
        if kind not in KINDS:
            hint = nearest(kind, KINDS) or f"; supported: {', '.join(supported())}"
            messages.append(f"SU2 has no kind {kind}{hint}")
        elif KINDS[kind].refused:
            messages.append(f"{kind} {KINDS[kind].refused}; supported: {', '.join(supported())}")
    return messages


def _groups(
    rows: Mapping[str, Entry], kinds: list[str], problems: list[Message], warnings: list[Remark]
) -> list[list[Word]]:
    """Return the words of each variable's parameters; none where DV_PARAM is wrong."""
    entry = rows.get("DV_PARAM")
    if entry is None:
        if any(KINDS[kind].form for kind in kinds):
            needed = ", ".join(f"{kind} needs {form(kind)}" for kind in dict.fromkeys(kinds))
            sentence = f"DV_PARAM is missing: {needed}{misspelt('DV_PARAM', rows)}"
            problems.append(Message(sentence, line=rows["DV_KIND"].line))
            return []
        return [[] for _ in kinds]
    try:
        groups = groups_of(words_of(entry.value))
    except CaseError as problem:
        problems += problem.within("DV_PARAM", line=entry.line)
        return []
    if len(groups) != len(kinds):  # SU2 takes several semicolons for one
        groups = [group for group in groups if group]
    sentence = f"{counted(len(groups), 'group')} for {counted(len(kinds), 'variable')}"
    if len(groups) > len(kinds) or not groups:
        problems.append(Message(f"DV_PARAM has {sentence}; give one each", line=entry.line))
        return []
    if len(groups) < len(kinds):
        warnings.append(
            f"DV_PARAM has {sentence}: as in SU2, the last ones of DV_KIND have no effect"
        )
    last = groups[-1]
    most = len(KINDS[kinds[len(groups) - 1]].parameters)
    if most and len(last) > most:
        extra = ", ".join(word.text for word in last[most:])
        warnings.append(note(f"DV_PARAM: {extra} after the last variable is ignored"))
        groups[-1] = last[:most]
    return groups


def _variable(name: str, group: list[Word]) -> DesignVariable:
    kind = KINDS[name]
    names = KINDS[name].parameters
    if not names:
        return DesignVariable(name, (0.0,))  # what is written there means nothing: mostly (1.0)
    needed = f"{name} needs {form(name)}"
    if len(group) != len(names):
        what = "parameters" if "BOX" in names else "numbers"
        raise CaseError(f"{len(group)} {what} are given; {needed}")
    boxed = names[0] == "BOX"
    numbers = tuple(number(word.text) for word in group[boxed:])
    variable = DesignVariable(name, (0.0,), numbers, group[0].text if boxed else "")
    at = [variable.parameter(letter, -1.0) for letter in "ijk"]
    if boxed and any(place != int(place) or place < -1 for place in at):
        raise CaseError(f"an index is not a whole number from -1; {needed}")
    several = kind.several.split(", ") if kind.several else []
    if several and not any(variable.parameter(each) for each in several):
        variable = replace(variable, values=(0.0,) * len(several))
    return variable


def _with_values(
    rows: Mapping[str, Entry],
    variables: list[DesignVariable],
    problems: list[Message],
    warnings: list[Remark],
) -> list[DesignVariable]:
    entry = rows.get("DV_VALUE")
    needless = not variables or variables[0].group in WITHOUT_VALUE
    if entry is None:
        if not needless:
            sentence = f"DV_VALUE is missing: a value for each variable{misspelt('DV_VALUE', rows)}"
            problems.append(Message(sentence, line=rows["DV_KIND"].line))
        return variables
    try:
        words = [word.text for word in list_of(entry.value)]
        values = [number(word) for word in words]
    except CaseError as problem:
        problems += problem.within("DV_VALUE", line=entry.line)
        return variables
    needed = sum(len(each.values) for each in variables)
    sentence = f"{counted(len(values), 'value')} for {counted(len(variables), 'variable')}"
    if len(variables) < needed:
        sentence += f", which need {needed}"
    if len(values) < needed and not needless:
        problems.append(Message(f"DV_VALUE has {sentence}; give one each", line=entry.line))
    numbers = (*(word.lstrip("+-") for word in words[::2]), *words[1::2])  # as in 0,01 -0,02
    comma = len(values) == 2 * needed and any(values) and all(map(str.isdecimal, numbers))
    if comma and not needless:
        rule = f"DV_VALUE has {sentence}; decimals are written with a point"
        problems.append(Message(rule, line=entry.line))
    elif len(values) > needed:
        warnings.append(f"DV_VALUE has {sentence}: as in SU2, the last ones mean nothing")
    left = iter(values + [0.0] * needed)
    return [replace(each, values=tuple(next(left) for _ in each.values)) for each in variables]


def _contradictions(variables: list[DesignVariable]) -> list[str]:
    first = variables[0] if variables else None
    if first is None or len(variables) == 1:
        return []
    if first.group in EXCLUSIVE:
        return [f"{first.kind} cannot be combined with others; make two runs"]
    others = {each.kind: None for each in variables if each.group != first.group}
    if first.group == "ffd" and others:
        sentence = f"{', '.join(others)} cannot be in a list that begins with {first.kind}"
        return [f"{sentence}: it has no FFD box; make two runs"]
    alike = all(each.kind == first.kind for each in variables)
    if first.kind == "HICKS_HENNE_CAMBER" and not alike:
        return ["HICKS_HENNE_CAMBER can be combined with its own kind only; make two runs"]
    return []


def _dispatched(
    variables: list[DesignVariable], warnings: list[Remark]
) -> tuple[DesignVariable, ...]:
    """Return the variables, those marked that do nothing in SU2 beside the first one."""
    reasons: dict[str, list[str]] = {}
    marked = []
    for place, each in enumerate(variables, start=1):
        reason = _why_ignored(each, variables[0]) if place > 1 else ""
        marked.append(replace(each, ignored=bool(reason)))
        if reason:
            reasons.setdefault(reason, []).append(f"{place} ({each.kind})")
    for reason, places in reasons.items():
        sentence = f"{places_words(places)} will have no effect, as in SU2: {reason}"
        warnings.append(f"{sentence}; make two runs")
    return tuple(marked)


def places_words(places: Sequence[object]) -> str:
    """Return places of variables, from 1, in words, six at most."""
    noun = "variable" if len(places) == 1 else "variables"
    more = f" and {len(places) - 6} more" if len(places) > 6 else ""
    return f"{noun} {', '.join(map(str, places[:6]))}{more} of DV_KIND"


def _why_ignored(variable: DesignVariable, first: DesignVariable) -> str:
    if first.group == "grid":
        return f"{first.kind} is first, and alone moves the mesh"
    if variable.group != first.group:
        return f"{first.kind} is first, and decides what can move"
    order = KINDS[variable.kind].order
    leading = KINDS[first.kind].order
    if variable.kind == "HICKS_HENNE_CAMBER" != first.kind:
        return f"HICKS_HENNE_CAMBER moves only where it stands first, and {first.kind} does"
    if order < leading and first.kind != "ANGLE_OF_ATTACK":
        return f"its motion is lost, since {first.kind}, which is first, starts again after it"
    return ""


def angle_notes(variables: Sequence[DesignVariable], relaxation: float) -> list[str]:
    """Return what an angle of attack among variables does to the flow; or none."""
    angles = [each for each in variables if each.is_angle]
    if not angles:
        return []
    offset = relaxation * angles[-1].value  # the last one wins in SU2
    what = f"{angles[-1].kind} moves no node"
    return [
        f"{what}; add {offset:.10g} degrees, its value times OPT_RELAX_FACTOR, to AOA of the flow"
    ]
