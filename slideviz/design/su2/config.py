"""Configurations of SU2: their keys about a deformation and its gradients, and their mesh.

Such a file has hundreds of keys; the others are listed, and not read. SU2 reads ``DV_PARAM`` and
``DV_VALUE`` as streams of words (``COptionDVParam``): it has as many variables as ``DV_PARAM`` has
parts between semicolons, and passes over what follows the last one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.check import unknown_markers
from slideviz.case.keys import KEYS, MOTION, Key
from slideviz.case.lines import (
    Entry,
    entries_of,
    first_of_many,
    listed,
    read_text,
    require_no_mesh,
)
from slideviz.case.model import NEW, Case
from slideviz.case.values import MAX_STEPS, YES_NO, integer, real
from slideviz.case.words import Words, counted, first_of, groups_of, list_of, number, words_of
from slideviz.case.zone_cases import renamed, with_marker_names
from slideviz.errors import CaseError, Message, Remark, nearest, not_one_of, note, raise_all, shown
from slideviz.formats.files import read
from slideviz.mesh.model import Assembly, IntArray, Marker, Mesh
from slideviz.mesh.zones import join_zones, names_in, numbered, spellings
from slideviz.rbf.kernels import SHAPE
from slideviz.rbf.reduction import Reduction
from slideviz.system.grouping import grouped
from slideviz.system.tables import table_beside
from slideviz.terms import FILE_FORMATS, ROLES, Role

Group = Literal["nothing", "boxes", "ffd", "file", "grid", "surface", "naca", "parabolic"]
"""What SU2 does with a list of variables; the first kind decides it for all of them."""

MISSPELT = 0.7
"""Similarity (``difflib``, 0 to 1) from which a key may be one that is missing, misspelt."""


@frozen
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


_TABLE = table_beside(__file__)
KINDS = {name: VariableKind(**row) for name, row in _TABLE["kinds"].items()}
"""SU2's kinds (8.3, and those of 7 that it dropped), by their name in DV_KIND."""
WITHOUT_VALUE = ("nothing", "boxes", "file", "naca", "parabolic")
"""Groups whose values mean nothing."""
EXCLUSIVE = ("naca", "parabolic")
"""Groups of which SU2 takes one variable only: it stops, and waits for a key."""


@frozen
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
    close = get_close_matches(key, here, n=1, cutoff=MISSPELT)
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
) -> list[Words]:
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


def _variable(name: str, group: Words) -> DesignVariable:
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


KERNELS = {
    "WENDLAND_C2": ("wendland-c2", 1.0),
    "GAUSSIAN": ("gaussian", 1.0),
    "THIN_PLATE_SPLINE": ("thin-plate", 1.0),
    "MULTI_QUADRIC": ("multiquadric", 1.0 / SHAPE),
    "INV_MULTI_QUADRIC": ("inverse-multiquadric", 1.0 / SHAPE),
}
"""For each function of SU2 ours, and its support radius over SU2's parameter."""
READ_ALWAYS = {
    "RBF_DATA_REDUCTION": YES_NO,
    "RBF_GREEDY_TOLERANCE": real(0.0),
    "RBF_GREEDY_CORRECTION_FACTOR": real(0.0),
}
READ_WITH_RBF = {
    "RADIAL_BASIS_FUNCTION_PARAMETER": real(0.0),
    "DEFORM_NONLINEAR_ITER": integer(1, MAX_STEPS),
}
"""Kinds of values; of keys that mean something else unless DEFORM_KIND is RBF."""
ELASTIC: dict[str, str] = _TABLE["elastic"]
"""Keys that are read with METHOD= elastic, with SU2's defaults (version 8.5)."""
FUNCTION = "KIND_RADIAL_BASIS_FUNCTION"


def radial_keys(rows: Mapping[str, Entry]) -> set[str]:
    """Return the names of the keys that are read, given all of a configuration."""
    with_rbf = {FUNCTION, *READ_WITH_RBF} if _word(rows, "DEFORM_KIND") == "RBF" else set()
    elastic = ELASTIC if _word(rows, "METHOD") == "ELASTIC" else ()
    return {"DEFORM_KIND", *READ_ALWAYS, *with_rbf, *elastic}


def radial_settings(case: Case, reader: _Reader) -> Case:
    """Return the case with SU2's settings of its method, where slideviz's own are not given."""
    rows = reader.rows
    kind = _word(rows, "DEFORM_KIND")
    if kind not in ("", "ELASTIC", "RBF"):
        reader.note(rows["DEFORM_KIND"], not_one_of(kind, ("ELASTIC", "RBF")))
    if kind == "ELASTIC" and "METHOD" not in rows:
        why = "DEFORM_KIND= ELASTIC: radial functions move the mesh nevertheless; write METHOD="
        reader.warnings.append(Message(f"{why} elastic for elasticity", level="note"))
    forms = READ_ALWAYS | (READ_WITH_RBF if kind == "RBF" else {})
    read = {name: reader.read(name, form.read) for name, form in forms.items()}
    fields = {name: value for name, value in read.items() if value is not None}
    if kind == "RBF":
        word = _word(rows, FUNCTION) or "WENDLAND_C2"
        if word not in KERNELS:
            reader.note(rows[FUNCTION], not_one_of(word, KERNELS))
        kernel, factor = KERNELS.get(word, KERNELS["WENDLAND_C2"])
        case = case if "RBF_KERNEL" in rows else case.change(kernel=kernel)
        radius = fields.get("RADIAL_BASIS_FUNCTION_PARAMETER")
        if radius and not {"SUPPORT_RADIUS", "INFLUENCE_FACTOR"} & {*rows}:
            case = case.change(support_radius=factor * radius)
        if "DEFORM_NONLINEAR_ITER" in fields and "STEPS" not in rows:
            case = case.change(steps=fields["DEFORM_NONLINEAR_ITER"])
    if case.method == "elastic":
        for name, default in ELASTIC.items():
            key = KEYS["STEPS" if name == "DEFORM_NONLINEAR_ITER" else name]
            if key.name not in rows or key.name == name:
                usual = key.put(case, key.kind.read(default))
                case = reader.put(case, name, key) if name in rows else usual
    return _reduced(case, rows, fields)


def _reduced(case: Case, rows: Mapping[str, Entry], given: Mapping[str, Any]) -> Case:
    """Return the case with SU2's greedy selection: one node at a time, by the largest error."""
    names = {"RBF_GREEDY_TOLERANCE": "tolerance", "RBF_GREEDY_CORRECTION_FACTOR": "gamma"}
    values = {names[key]: value for key, value in given.items() if key in names}
    wanted = given.get("RBF_DATA_REDUCTION", True if values else None)
    if wanted is None or any(key.startswith("DATA_RED") for key in rows):
        return case
    return case.change(reduction=Reduction(selection="one", **values) if wanted else None)


def _word(rows: Mapping[str, Entry], key: str) -> str:
    return rows[key].value.upper() if key in rows else ""


ROLE_KEYS: dict[str, Role] = _TABLE["roles"]
"""Roles of the markers that keys of SU2, or of ParaBlade's branch of it, list; later keys win."""
FILES: dict[str, str] = _TABLE["files"]
"""Keys that name files, with SU2's defaults."""


def _supported(*words: str) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text.upper() not in words:
            raise CaseError(
                f"{shown(text)} is not supported; supported: {', '.join(filter(None, words))}"
            )
        return text.upper()

    return read


def _yes(text: str) -> bool:
    return _supported("YES", "NO")(text) == "YES"


def _positive(text: str) -> float:
    if (value := number(text)) <= 0.0:
        raise CaseError(f"{shown(text)} is not a number above 0")
    return value


def _count(text: str) -> int:
    if (value := number(text)) <= 0.0 or value != int(value):
        raise CaseError(f"{shown(text)} is not a whole number above 0")
    return int(value)


def _planes(text: str) -> frozenset[int]:
    words = [word.text for word in list_of(text)]
    if not all(map(str.isdecimal, words)):
        raise CaseError(f"{shown(text)} is not a list of whole numbers")
    return frozenset(map(int, words))


CONTINUITIES: dict[str, int] = _TABLE["continuities"]
"""Values of FFD_CONTINUITY, and how many planes of control points each holds at a side."""
_READERS: dict[str, Callable[[str], Any]] = {
    "text": str,
    "number": number,
    "positive": _positive,
    "count": _count,
    "planes": _planes,
    "yes": _yes,
    "yes, or not": lambda text: text.upper() == "YES",
}
VALUES = {
    name: (_READERS[how] if isinstance(how, str) else _supported(*how), usual)
    for name, (how, usual) in _TABLE["values"].items()
}
"""Other keys of one value or list: how each is read, and SU2's default; except FFD_CONTINUITY,
which is empty: control points are held only if the key is given."""
LISTS = ("DV_KIND", "DV_PARAM", "DV_VALUE", "DV_MARKER", "MARKER_DEFORM_MESH")
NOT_HERE = ("MARKER_MOVING", "MESH_FORMAT", "MESH_OUT_FORMAT", *FILES, *ELASTIC)
"""Keys of case files that mean something else in SU2, or are read in another way."""
OURS = {
    name: key
    for name, key in KEYS.items()
    if name not in NOT_HERE and (key.group != MOTION or name.startswith("FFD_"))
}
ELSEWHERE = ("MOTION", "DEFORMATION_FILENAME")
"""Keys of case files that a configuration cannot have."""
SU2_CONTINUITY = "2ND_DERIVATIVE"  # SU2's default of FFD_CONTINUITY
OWN = {name for name in OURS if not name.startswith(("FFD_", "MARKER_"))}
"""Keys of case files that resemble no key of SU2."""
ALIKE = 0.9
ALIKE_OWN = 0.8
"""Similarity (``difflib``, 0 to 1) from which an unread key may be a mistyped one; the second for
keys in `OWN`. SU2 has keys as similar as MARKER_INTERFACE (0.84 to MARKER_INTERNAL) and
SOLUTION_FILENAME (0.895 to SOLUTION_ADJ_FILENAME)."""
NOT_MISTYPED = {"NZONES"}
"""Keys of SU2 that resemble one of slideviz and are not read."""
ZONE_KEYS = {"CONFIG_LIST", "MULTIZONE", "SOLVER"}
"""Keys that are read where the first of them is there."""


@frozen
class Su2Config:
    """A configuration of SU2: the part about a deformation."""

    case: Case  # roles, settings and the files of the meshes, without motions
    markers: tuple[str, ...]  # the boundaries that the design variables move
    variables: tuple[DesignVariable, ...]
    files: dict[str, Path]
    values: dict[str, Any]  # `files`, `values`: those of the keys in ``FILES`` and ``VALUES``
    ignored: tuple[str, ...]  # the keys that are not read
    named: dict[str, str]  # for each marker with a role, the key that lists it
    present: frozenset[str]  # the keys that it has
    zone: int | None = None  # of a configuration in CONFIG_LIST: the number of its zone, from 1
    zones: tuple[Su2Config, ...] = ()
    """The configurations in CONFIG_LIST; (): it has none, and is that of all zones of the mesh."""
    beside: tuple[Su2Config, ...] = ()
    """Of a configuration in CONFIG_LIST: those of the other zones."""

    def of_zone(self, index: int) -> Su2Config:
        """Return the configuration that holds for a zone, from 0."""
        return self.zones[index] if self.zones else self

    @property
    def source(self) -> Path:
        """Return the path of the configuration."""
        assert self.case.source is not None
        return self.case.source

    @property
    def relaxation(self) -> float:
        """Return OPT_RELAX_FACTOR, which multiplies values."""
        return float(self.values["OPT_RELAX_FACTOR"])


def own_changes(texts: Iterable[str]) -> tuple[dict[str, str], list[str]]:
    """Return the values of keys of a configuration among texts KEY=VALUE, and the other texts.

    The first replace those in the file: they are SU2's keys, and lists of boundaries. Raises
    CaseError if a key is unknown to SU2 and to slideviz, or has no meaning here.
    """
    found = {}
    others = []
    known = _read_keys() | {FUNCTION, *READ_WITH_RBF}
    listed = {term.key for term in ROLES.values()} | {*ELSEWHERE}
    for text in texts:
        name, sign, value = text.partition("=")
        key = name.strip().upper()
        if sign and key == "MARKER_MOVING":
            raise CaseError(f"--set {text}: DV_MARKER says what moves here; set that")
        if sign and key in (known - set(KEYS)) | listed | {"METHOD"}:
            found[key] = value.strip()
            continue
        if sign and key not in {*known, *KEYS}:
            hint = nearest(key, (*known, *KEYS)) or "; `slideviz keys` lists slideviz's keys"
            raise CaseError(f"--set {text}: unknown key {shown(key)}{hint}")
        others.append(text)
    return found, others


def read_config(path: Path, changes: Mapping[str, str] | None = None) -> Su2Config:
    """Return what of a configuration concerns a deformation. Paths are those of the working folder.

    ``changes`` are values of SU2's keys that stand in place of those in the file. Raises CaseError
    if it cannot be read, or has mistakes: a line ``file:line: sentence`` for each. With
    CONFIG_LIST the fields are those of the first zone, until `on_mesh` joins all.
    """
    rows, problems, warnings = _rows(path)
    given = {key: Entry(key, value, 0) for key, value in (changes or {}).items()}
    rows |= given
    if "CONFIG_LIST" not in rows:
        return _config(path, rows, problems, warnings)
    files = _listed_files(rows, problems)
    raise_all(listed(path, problems))
    each = dict[Path, Su2Config]()
    faults = dict[Message, None]()
    # SU2, ``CConfig::SetDefaultFromConfig``: a key counts for the zones whose files lack it.
    inherited = {key: replace(entry, line=-entry.line) for key, entry in rows.items()}
    zones_of = grouped((file, zone) for zone, file in enumerate(files, 1))
    for file, numbers in zones_of.items():
        try:
            own, problems, said = _rows(file)
            said = (*said, *_list_warnings(path, file, own, numbers))
            each[file] = _config(file, inherited | own | given, problems, said, path, numbers[0])
        except CaseError as problem:
            faults |= dict.fromkeys(problem.messages)
    if not faults and not any("DV_KIND" in config.present for config in each.values()):
        rule = "DV_KIND is missing, in the files of CONFIG_LIST, too"
        faults[Message(rule, place=(path,))] = None
    raise_all(first_of_many(path, [*faults]))
    zones = [replace(each[file], zone=zone) for zone, file in enumerate(files, 1)]
    first = zones[0]
    reader = _Reader(rows, problems)
    mesh = reader.file("MESH_FILENAME", FILES["MESH_FILENAME"])
    out = reader.file("MESH_OUT_FILENAME", FILES["MESH_OUT_FILENAME"])
    strange = [key for key in rows if key not in _read_keys(rows)]
    case = first.case.change(
        source=path,
        mesh_file=mesh if first.values["MULTIZONE_MESH"] else first.case.mesh_file,
        mesh_out=_with_ending(out, first.case),
        warnings=(*warnings, *_perhaps_ours(path, strange, rows), *first.case.warnings),
    )
    ignored = dict.fromkeys(key for config in each.values() for key in config.ignored)
    return replace(first, case=case, zone=None, zones=tuple(zones), ignored=tuple(ignored))


def _list_warnings(
    path: Path, file: Path, rows: Mapping[str, Entry], numbers: list[int]
) -> Iterator[str]:
    """Yield what is strange about a configuration in the CONFIG_LIST of ``path``."""
    if len(numbers) > 1:
        zones = first_of(numbers)
        yield (
            f"{path}: CONFIG_LIST has {file} {len(numbers)} times, for the zones {zones}; list a "
            "file for each zone, unless they shall have the same keys"
        )
    if "CONFIG_LIST" in rows:
        line = rows["CONFIG_LIST"].line
        yield f"{file}:{line}: CONFIG_LIST is ignored in a file that {path} lists; take it out"


def _rows(path: Path) -> tuple[dict[str, Entry], list[Message], tuple[str, ...]]:
    """Return the keys of a configuration, with what is wrong, and warnings of reading the file."""
    text, warnings = read_text(path, "case file")
    entries, problems = entries_of(text, "%")  # other signs have a meaning in some values
    require_no_mesh(path, entries)
    rows = {entry.key: entry for entry in entries}  # of two, SU2 would complain
    for entry in entries:
        if rows[entry.key] is not entry:
            rule = f"{entry.key} is given again in line {rows[entry.key].line}"
            problems.append(Message(rule, "keep one", line=entry.line))
    return rows, problems, warnings


def _listed_files(rows: dict[str, Entry], problems: list[Message]) -> list[Path]:
    """Return the configurations of zones in CONFIG_LIST; appends to ``problems``."""
    entry = rows["CONFIG_LIST"]
    reader = _Reader(rows, problems)
    if _word(rows, "MULTIZONE") != "YES" and _word(rows, "SOLVER") != "MULTIPHYSICS":
        reader.note(entry, "needs MULTIZONE= YES, or SOLVER= MULTIPHYSICS: SU2 takes one zone else")
    if "ZONE" in rows:
        reader.note(entry, "is for all zones, and ZONE= for one; leave out one of the two")
    try:
        return [Path(word.text) for word in list_of(entry.value)]
    except CaseError as problem:
        reader.note(entry, *problem.messages)
        return []


def _config(
    path: Path,
    rows: dict[str, Entry],
    problems: list[Message],
    warnings: tuple[str, ...],
    main: Path | None = None,
    zone: int | None = None,
) -> Su2Config:
    """Return a configuration; ``main`` has the keys with lines below 0, of a ``zone``."""
    reader = _Reader(rows, problems)
    case, markers = reader.case()
    notes = reader.warnings
    variables = read_variables(rows, problems, notes)
    ignored = tuple(key for key in rows if key not in _read_keys(rows))
    files = {key: reader.file(key, default) for key, default in FILES.items()}
    values = {key: reader.value(key, *how) for key, how in VALUES.items()}
    reader.check()
    if zone is None and "DV_KIND" not in rows:
        if rows.keys() & {*ELSEWHERE}:
            raise CaseError(
                f"{path}: is a case file, not a configuration of SU2; use `slideviz run {path}`"
            )
        sentence = (
            f"DV_KIND is missing: which design variables there are ({', '.join(supported())})"
        )
        last = max((entry.line for entry in rows.values()), default=1)
        problems.append(Message(sentence + misspelt("DV_KIND", rows), line=last))
    inherited = [replace(each, line=-each.line) for each in problems if each.line < 0]
    own = listed(path, [problem for problem in problems if problem.line >= 0])
    raise_all(own if main is None else [*own, *listed(main, inherited)])
    case = case.change(
        source=path,
        mesh_file=files["MESH_FILENAME"],
        mesh_out=_with_ending(files["MESH_OUT_FILENAME"], case),
        warnings=(*warnings, *notes, *_perhaps_ours(path, ignored, rows)),
    )
    variables = variables or NOTHING
    keys = frozenset(rows)
    return Su2Config(case, markers, variables, files, values, ignored, reader.named, keys, zone)


def _perhaps_ours(path: Path, ignored: Iterable[str], rows: dict[str, Entry]) -> list[Message]:
    """Return a warning for each ignored key that resembles one that is read."""
    messages = []
    for key in (key for key in ignored if rows[key].line >= 0 and key not in NOT_MISTYPED):
        own, similar, one_letter_off = _resembled(key)
        close = own or [other for other in similar if other not in rows] or one_letter_off
        if close:
            meant = f"did you mean {close[0]}?"
            line = rows[key].line
            message = Message(f"{key} is not read", meant, (path,), line, keys=(close[0],))
            messages.append(message)
    return messages


@cache
def _resembled(key: str) -> tuple[list[str], list[str], list[str]]:
    """Return the keys that one may be mistyped for: of `OWN`, all similar, one letter apart."""
    known = _read_keys()
    return (
        get_close_matches(key, OWN, n=1, cutoff=ALIKE_OWN),
        get_close_matches(key, known, n=len(known), cutoff=ALIKE),
        sorted(other for other in known if _one_letter_off(key, other)),
    )


def _one_letter_off(one: str, other: str) -> bool:
    short, long = sorted((one, other), key=len)
    apart = (k for k, letters in enumerate(zip(short, long, strict=False)) if len({*letters}) > 1)
    at = next(apart, len(short))
    if len(long) > len(short):
        return short[at:] == long[at + 1 :]
    swapped = long[at : at + 2] == short[at : at + 2][::-1] and long[at + 2 :] == short[at + 2 :]
    return swapped or long[at + 1 :] == short[at + 1 :]


def _read_keys(rows: Mapping[str, Entry] | None = None) -> set[str]:
    """Return the names of all keys that are read, of a configuration if it is given."""
    formats = {"MESH_FORMAT", "MESH_OUT_FORMAT"}
    zones = ZONE_KEYS if rows and "CONFIG_LIST" in rows else ()
    return {*OURS, *ROLE_KEYS, *FILES, *VALUES, *LISTS, *formats, *zones, *radial_keys(rows or {})}


def _with_ending(path: Path, case: Case) -> Path:
    return path if path.suffix else path.with_suffix(f".{case.mesh_out_format or 'su2'}")


class _Reader:
    """Reads the keys of a configuration; appends mistakes to ``problems``, fills ``named``."""

    def __init__(self, rows: dict[str, Entry], problems: list[Message]) -> None:
        self.rows = rows
        self.problems = problems
        self.named: dict[str, str] = {}
        self.warnings: list[Remark] = []

    def word(self, key: str, default: str) -> str:
        """Return the value of a key, without quotes."""
        entry = self.rows.get(key)
        return default if entry is None else entry.value.strip('"') or default

    def file(self, key: str, default: str) -> Path:
        """Return the path that is the value of a key; a value that cannot be a file is noted."""
        path = Path(self.word(key, default))
        if path.name in ("", ".."):
            self.note(
                self.rows[key], f"{shown(str(path))} is a folder; expected the name of a file"
            )
        return path

    def names(self, key: str) -> tuple[str, ...]:
        """Return the markers that a key lists; none if it is missing or wrong, which is noted."""
        kind = KEYS["MARKER_PERIODIC" if key == "MARKER_PERIODIC" else "MARKER_FIXED"].kind
        return tuple(self.read(key, kind.read) or ())

    def value(self, key: str, read: Callable[[str], Any], default: str) -> Any:
        """Return what ``read`` returns of the value of a key, or of its default."""
        return self.read(key, lambda _: read(self.word(key, default)), read(default))

    def put(self, case: Case, name: str, row: Key) -> Case:
        """Return the case with the value of a key put into it, if that is there and right."""
        return self.read(name, lambda text: row.put(case, row.kind.read(text)), case)

    def read(self, key: str, read: Callable[[str], Any], default: Any = None) -> Any:
        """Return what ``read`` returns of a text; ``default`` without it, or where it is noted."""
        entry = self.rows.get(key)
        if entry is None:
            return default
        try:
            return read(entry.value)
        except CaseError as problem:
            self.note(entry, *problem.messages)
            return default

    def note(self, entry: Entry, *messages: str | Message) -> None:
        """Append messages about a key, with its line, to the problems."""
        self.problems += CaseError(*messages).within(entry.key, line=entry.line)

    def case(self) -> tuple[Case, tuple[str, ...]]:
        """Return the case with roles and settings, and the markers that move."""
        case = Case(generate_quality=False, relax=NEW["relax"], layers=NEW["layers"])
        roles: dict[str, Role] = {}
        for key, role in ROLE_KEYS.items():
            names = self.names(key)
            roles |= dict.fromkeys(names, role)
            self.named |= dict.fromkeys(names, key)
        for name, row in OURS.items():
            if name not in ROLE_KEYS:
                case = self.put(case, name, row)
        case = radial_settings(case, self)
        if case.method != "rbf" and "RELAX" not in self.rows:
            case = case.change(relax="no")
        mover = "DV_MARKER" if self.names("DV_MARKER") else "MARKER_DEFORM_MESH"
        moving = self.names(mover)
        self.named |= {name: ROLES[role].key for name, role in case.roles.items()}
        self.named |= dict.fromkeys(moving, mover)
        roles |= {**case.roles, **dict.fromkeys(moving, "moving")}
        case = case.change(roles=roles, **self.formats())
        slides = "sliding" in roles.values() or "periodic" in roles.values()
        if slides and "SLIDING_MODE" not in self.rows:
            case = case.change(sliding="ps")
        if "periodic" in roles.values() and "PERIODIC_MODE" not in self.rows:
            case = case.change(periodic="fixed" if case.sliding == "none" else "moving")
        return case, moving

    def formats(self) -> dict[str, str | None]:
        """Return the fields ``mesh_format`` and ``mesh_out_format`` of the case."""
        formats: dict[str, str | None] = {}
        for key, field in (("MESH_FORMAT", "mesh_format"), ("MESH_OUT_FORMAT", "mesh_out_format")):
            entry = self.rows.get(key)
            value = "SU2" if entry is None else entry.value.upper()
            if value not in ("SU2", "SU2B", "CGNS"):
                assert entry is not None
                self.note(entry, not_one_of(value, ("SU2", "SU2B", "CGNS")))
            # Without the key the ending tells, as it does for CGNS.
            known = entry is not None and value.lower() in FILE_FORMATS
            formats[field] = value.lower() if known else None
        return formats

    def check(self) -> None:
        """Note keys that belong in a case file, and warn of DEFORM_MESH."""
        if self.word("DEFORM_MESH", "NO").upper() == "YES":
            sentence = "DEFORM_MESH= YES: SU2 would ignore the design variables; here they move"
            self.warnings.append(f"{sentence} DV_MARKER")
        for key in ELSEWHERE:
            if key in self.rows:
                sentence = "belongs into a case file (slideviz run); here DV_KIND says what moves"
                self.note(self.rows[key], sentence)


PASSED_OVER = {*ROLE_KEYS, "MARKER_DEFORM_MESH"}
"""Keys whose markers are ignored if the mesh does not have them."""
_NO_MARKER = "{}: DV_MARKER names no boundary; nothing would move"
UNMIXED = {"boxes", "grid"}  # groups of variables that all zones have, or none


def read_mesh(config: Su2Config) -> Mesh:
    """Return the mesh of a configuration: of all zones, those of several files, too.

    With MULTIZONE_MESH= NO each zone is the mesh that its configuration names.
    """
    file = config.case.mesh_file
    form = config.case.mesh_format
    assert file is not None
    if config.values["MULTIZONE_MESH"] or not config.zones:
        raise_all(
            f"{zone_config.source}: MESH_FILENAME= {zone_config.case.mesh_file}, and with "
            f"MULTIZONE_MESH= YES all zones are in one file, {file}; leave the key out there, or "
            "write NO"
            for zone_config in config.zones
            if zone_config.case.mesh_file != file
        )
        return read(file, zone=config.case.zone, file_format=form)
    meshes = []
    for zone_config in config.zones:
        assert zone_config.case.mesh_file is not None
        mesh = read(zone_config.case.mesh_file, file_format=zone_config.case.mesh_format)
        if mesh.zones > 1:
            raise CaseError(
                f"{zone_config.source}: {mesh.name} has {mesh.zones} zones, and with "
                "MULTIZONE_MESH= NO it is one; write YES, or name a file for each zone"
            )
        meshes.append(replace(mesh, zone=zone_config.zone, zones=len(config.zones)))
    return join_zones(meshes)


def on_mesh(config: Su2Config, mesh: Mesh) -> Su2Config:
    """Return the configuration without markers that the mesh lacks, with a warning for each key.

    A periodic pair of which one is missing stays, and so does all that would move where all of it
    is missing: `problems_of_markers` tells them. Boundaries get the names that they have in the
    mesh, where they are written as ``1:blade``; those in CONFIG_LIST, which are of one zone,
    always. Raises CaseError if CONFIG_LIST is not one for each zone.
    """
    if not config.zones:
        return _without_missing(_renamed(config, spellings(mesh)), mesh)
    if len(config.zones) != mesh.zones:
        raise CaseError(
            f"{config.source}: CONFIG_LIST has {len(config.zones)} configurations, and {mesh.name} "
            f"{mesh.zones} zones; give one for each"
        )
    if not isinstance(mesh, Assembly):
        return on_mesh(replace(config, zones=()), mesh)
    zones = tuple(
        _without_missing(_in_zone(zone_config, mesh), mesh) for zone_config in config.zones
    )
    still = tuple(map(_as_still, zones))
    asked = {zone_config.variables[0].group for zone_config in zones}
    moves = {zone_config.variables[0].group for zone_config in still}
    if moves == {"nothing"} != asked:
        raise CaseError(_NO_MARKER.format(config.source))
    return joined(replace(config, case=with_marker_names(config.case, mesh)), still)


def _renamed(config: Su2Config, names: Mapping[str, str | None]) -> Su2Config:
    """Return a configuration with other names of boundaries, and without those that have none."""
    new = {name: after for name in config.named if (after := names.get(name, name)) is not None}
    return replace(
        config,
        case=renamed(config.case, names),
        markers=tuple(new[name] for name in config.markers if name in new),
        named={after: config.named[name] for name, after in new.items()},
    )


def _in_zone(config: Su2Config, mesh: Mesh) -> Su2Config:
    """Return the configuration of a zone without boundaries of others, named as in the mesh."""
    assert config.zone is not None
    part = mesh.parts[config.zone - 1]
    ours = {file: name for name, file in names_in(mesh, part).items()}
    ours |= {numbered(config.zone, file): name for file, name in ours.items()}
    files = {name for other in mesh.parts for name in other.mesh.marker_names}
    return _renamed(config, dict.fromkeys((*files, *spellings(mesh))) | ours)


def _as_still(config: Su2Config) -> Su2Config:
    """Return a configuration as one that moves nothing, if it does not, as in SU2."""
    group = config.variables[0].group
    if group != "nothing" and (config.markers or group == "grid"):
        return config
    roles = {name: role for name, role in config.case.roles.items() if role != "moving"}
    case = config.case.change(roles=roles)
    return replace(config, case=case, markers=(), variables=NOTHING)


def joined(config: Su2Config, zones: tuple[Su2Config, ...]) -> Su2Config:
    """Return the configuration of all zones.

    Zones that have the same design variables share them, as in SU2.
    """
    moving = [
        zone_config for zone_config in zones if zone_config.variables[0].group != "nothing"
    ] or [*zones[:1]]
    groups = {zone_config.variables[0].group: zone_config for zone_config in moving}
    if len(groups) > 1 and groups.keys() & UNMIXED:
        kinds = " and ".join(zone_config.variables[0].kind for zone_config in groups.values())
        raise CaseError(f"{config.source}: zones have {kinds}, which need a run each; make two")
    checked = [zone_config for zone_config in moving if zone_config.values["CONVEXITY_CHECK"]]
    boxes = {
        box: degrees
        for zone_config in zones
        for box, degrees in zip(
            zone_config.case.ffd_boxes, zone_config.case.ffd_degrees, strict=False
        )
    }
    case = moving[0].case.change(
        source=config.source,
        mesh_file=config.case.mesh_file,
        mesh_out=config.case.mesh_out,
        interfaces=config.case.interfaces,
        roles={
            name: role for zone_config in zones for name, role in zone_config.case.roles.items()
        },
        limits=tuple(
            dict.fromkeys(limit for zone_config in zones for limit in zone_config.case.limits)
        ),
        ffd_boxes=tuple(boxes),
        ffd_degrees=tuple(boxes.values()),
        warnings=tuple(
            dict.fromkeys(
                (
                    *config.case.warnings,
                    *(text for zone_config in zones for text in zone_config.case.warnings),
                )
            )
        ),
    )
    return replace(
        config,
        case=case,
        markers=tuple(name for zone_config in moving for name in zone_config.markers),
        variables=tuple(chain(*dict.fromkeys(zone_config.variables for zone_config in moving))),
        values=(checked or moving)[0].values,
        named={name: key for zone_config in zones for name, key in zone_config.named.items()},
        zones=tuple(
            replace(zone_config, beside=tuple(other for other in zones if other is not zone_config))
            for zone_config in zones
        ),
    )


def _without_missing(config: Su2Config, mesh: Mesh) -> Su2Config:
    lacking = [name for name in config.named if name not in mesh.marker_names]
    passed = {name: key for name in lacking if (key := config.named[name]) in PASSED_OVER}
    roles = config.case.roles
    if sum(roles[name] == "periodic" for name in passed) % 2:
        # Without its partner, the other one could not repeat.
        passed = {name: key for name, key in passed.items() if roles[name] != "periodic"}
    markers = tuple(name for name in config.markers if name not in passed)
    if not markers:
        passed = {name: key for name, key in passed.items() if name not in config.markers}
        markers = config.markers
    named = {name: key for name, key in config.named.items() if name not in passed}
    left = {name: role for name, role in roles.items() if name not in passed}
    case = config.case.change(
        roles=left, warnings=(*config.case.warnings, *_warnings(config, mesh, passed))
    )
    if passed and "periodic" not in left.values():
        case = case.change(periodic="none")
        if "sliding" not in left.values():
            case = case.change(sliding="none")
    return replace(config, case=case, named=named, markers=markers)


def zone_of(config: Su2Config, mesh: Mesh) -> tuple[IntArray, tuple[Marker, ...]]:
    """Return the nodes and the boundaries of the zone that a configuration is of, or all."""
    points = slice(0, len(mesh.points))
    markers = slice(None)
    if config.zone is not None:
        part = mesh.parts[config.zone - 1]
        points = part.points
        markers = part.markers
    return np.arange(points.start, points.stop), mesh.markers[markers]


def problems_of_markers(config: Su2Config, mesh: Mesh, needed: bool = True) -> Sequence[Remark]:
    """Return that nothing would move, if some are ``needed``, or each that the mesh lacks."""
    if needed and not config.markers:
        return [_NO_MARKER.format(config.source)]
    return CaseError(*unknown_markers(mesh, config.named)).within(config.source)


def _warnings(config: Su2Config, mesh: Mesh, passed: dict[str, str]) -> list[str]:
    """Return a warning for each key with ignored markers; ``passed`` maps these to keys."""
    messages = []
    for key in dict.fromkeys(passed.values()):
        names = [name for name in passed if passed[name] == key]
        close = nearest(names[0], mesh.marker_names) if len(names) == 1 else ""
        messages.append(
            f"{config.source}: {key}: {mesh.name} has no marker {' or '.join(map(repr, names))}: "
            f"ignored, as in SU2{close}"
        )
    return messages
