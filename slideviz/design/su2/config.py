"""Configuration files of SU2: their keys about a deformation and its gradients.

Such a file has hundreds of keys; the others are listed, and not read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

from slideviz.case.key import MOTION, Key
from slideviz.case.keys import KEYS
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
from slideviz.case.words import first_of, list_of, number
from slideviz.design.su2.variables import (
    NOTHING,
    DesignVariable,
    misspelt,
    read_variables,
    supported,
)
from slideviz.errors import CaseError, Message, Remark, nearest, not_one_of, raise_all, shown
from slideviz.formats.table import FILE_FORMATS
from slideviz.rbf.kernels import SHAPE
from slideviz.rbf.reduction import Reduction
from slideviz.terms import ROLES, Role

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
ELASTIC = {
    "DEFORM_STIFFNESS_TYPE": "SOLID_WALL_DISTANCE",
    "DEFORM_COEFF": "1e6",
    "DEFORM_NONLINEAR_ITER": "1",
}
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


ROLE_KEYS: dict[str, Role] = {
    "MARKER_INTERNAL": "internal",
    "MARKER_DEFORM_MESH_INTERNAL": "internal",
    "MARKER_SYM": "sliding",
    "MARKER_DEFORM_MESH_SYM_PLANE": "sliding",
    "MARKER_DEFORM_TANGENTIAL": "sliding",
    "MARKER_PERIODIC": "periodic",
    "MARKER_DEFORM_NORMAL": "periodic",
}
"""Roles of the markers that keys of SU2, or of ParaBlade's branch of it, list; later keys win."""
FILES = {
    "MESH_FILENAME": "mesh.su2",
    "MESH_OUT_FILENAME": "mesh_out.su2",
    "DV_FILENAME": "surface_positions.dat",
    "DV_SENS_FILENAME": "surface_sensitivity.dat",
    "DV_UNORDERED_SENS_FILENAME": "unordered_sensitivity.dat",
    "SOLUTION_ADJ_FILENAME": "solution_adj",
    "GRAD_OBJFUNC_FILENAME": "of_grad.dat",
}
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


def _above(least: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        if (value := number(text)) <= least:
            raise CaseError(f"{shown(text)} is not a number above {least:g}")
        return value

    return read


def _count(text: str) -> int:
    if (value := number(text)) <= 0.0 or value != int(value):
        raise CaseError(f"{shown(text)} is not a whole number above 0")
    return int(value)


def _planes(text: str) -> frozenset[int]:
    words = [word.text for word in list_of(text)]
    if not all(map(str.isdecimal, words)):
        raise CaseError(f"{shown(text)} is not a list of whole numbers")
    return frozenset(map(int, words))


CONTINUITIES = {"NO_DERIVATIVE": 1, "1ST_DERIVATIVE": 2, "2ND_DERIVATIVE": 3, "USER_INPUT": 0}
"""Values of FFD_CONTINUITY, and how many planes of control points each holds at a side."""
VALUES: dict[str, tuple[Callable[[str], Any], str]] = {
    "DV_SENSITIVITY_FORMAT": (_supported("SU2_NATIVE", "UNORDERED_ASCII"), "SU2_NATIVE"),
    "OBJECTIVE_FUNCTION": (str, "DRAG"),
    "OPT_RELAX_FACTOR": (_above(-inf), "1.0"),
    "READ_BINARY_RESTART": (lambda text: text.upper() == "YES", "YES"),
    "FFD_CONTINUITY": (_supported("", *CONTINUITIES), ""),
    "FFD_SYMMETRY_PLANE": (_yes, "NO"),
    **{f"FFD_FIX_{letter}": (_planes, "NONE") for letter in "IJK"},
    "FFD_INTPREV": (_yes, "NO"),
    "FFD_INTPREV_ITER": (_count, "10"),
    "FFD_INTPREV_DEPTH": (_count, "3"),
    "CONVEXITY_CHECK": (_yes, "NO"),
    "CONVEXITY_CHECK_ITER": (_count, "10"),
    "CONVEXITY_CHECK_DEPTH": (_count, "3"),
    "OPT_LINE_SEARCH_BOUND": (_above(0.0), "1E6"),
    "REF_LENGTH": (_above(0.0), "1.0"),
    "MULTIZONE_MESH": (_yes, "YES"),
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


@dataclass(frozen=True)
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
    for file, numbers in _numbers_of_zones(files).items():
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


def _numbers_of_zones(files: Iterable[Path]) -> dict[Path, list[int]]:
    """Return the numbers of the zones, from 1, that each configuration is listed for."""
    numbers: dict[Path, list[int]] = {}
    for zone, file in enumerate(files, 1):
        numbers.setdefault(file, []).append(zone)
    return numbers


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


def _perhaps_ours(path: Path, ignored: Iterable[str], rows: dict[str, Entry]) -> list[str]:
    """Return a warning for each ignored key that resembles one that is read."""
    messages = []
    for key in (key for key in ignored if rows[key].line >= 0 and key not in NOT_MISTYPED):
        own, similar, one_letter_off = _resembled(key)
        close = own or [other for other in similar if other not in rows] or one_letter_off
        if close:
            messages.append(f"{path}:{rows[key].line}: {key} is not read; did you mean {close[0]}?")
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
        case = Case(generate_quality=False, layers=NEW["layers"])
        roles: dict[str, Role] = {}
        for key, role in ROLE_KEYS.items():
            names = self.names(key)
            roles |= dict.fromkeys(names, role)
            self.named |= dict.fromkeys(names, key)
        for name, row in OURS.items():
            if name not in ROLE_KEYS:
                case = self.put(case, name, row)
        case = radial_settings(case, self)
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
