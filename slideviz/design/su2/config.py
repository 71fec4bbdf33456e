"""Configurations of SU2: what of them concerns a deformation and its gradients.

Such a file has hundreds of keys; those that concern other things are counted and left alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from slideviz.case.key import MOTION
from slideviz.case.keys import KEYS
from slideviz.case.lines import Entry, Problem, entries_of, listed, read_text, require_no_mesh
from slideviz.case.model import Case
from slideviz.case.words import list_of, nearest, not_one_of, shown
from slideviz.design.su2.variables import KINDS, DesignVariable, read_variables
from slideviz.errors import CaseError
from slideviz.terms import FILE_FORMATS, ROLES, Role

ROLE_KEYS: dict[str, Role] = {
    "MARKER_SYM": "sliding",
    "MARKER_DEFORM_MESH_SYM_PLANE": "sliding",
    "MARKER_DEFORM_TANGENTIAL": "sliding",
    "MARKER_PERIODIC": "periodic",
    "MARKER_DEFORM_NORMAL": "periodic",
}
"""What boundaries do that SU2, or ParaBlade's branch of it, lists; the later ones win."""
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
WORDS = {
    "DV_SENSITIVITY_FORMAT": "SU2_NATIVE",
    "OBJECTIVE_FUNCTION": "DRAG",
    "OPT_RELAX_FACTOR": "1.0",
    "READ_BINARY_RESTART": "YES",
    "FFD_CONTINUITY": "",
    "FFD_SYMMETRY_PLANE": "NO",
    "FFD_COORD_SYSTEM": "CARTESIAN",
    "FFD_FIX_I": "NONE",
    "FFD_FIX_J": "NONE",
    "FFD_FIX_K": "NONE",
}
"""Other keys of one value or list, with SU2's defaults; but what moves is held only if asked."""
LISTS = ("DV_KIND", "DV_PARAM", "DV_VALUE", "DV_MARKER", "MARKER_DEFORM_MESH")
NOT_HERE = ("MARKER_MOVING", "MESH_FORMAT", "MESH_OUT_FORMAT", *FILES)
"""Keys of ours that mean something else in SU2, or are read in another way."""
OURS = {
    name: key
    for name, key in KEYS.items()
    if name not in NOT_HERE and (key.group != MOTION or name.startswith("FFD_"))
}
SU2_CONTINUITY = "2ND_DERIVATIVE"
"""SU2's default of FFD_CONTINUITY."""
OWN = {name for name in OURS if not name.startswith(("FFD_", "MARKER_"))}
"""Keys of ours that no key of SU2 is like."""
ALIKE, ALIKE_OWN = 0.9, 0.8
"""From where a key that is not read may be one that is, mistyped. SU2 itself has MARKER_INTERFACE
(0.84 of MARKER_INTERNAL), SOLUTION_FILENAME (0.895 of SOLUTION_ADJ_FILENAME) and more such."""
CONTINUITIES = {"NO_DERIVATIVE": 1, "1ST_DERIVATIVE": 2, "2ND_DERIVATIVE": 3, "USER_INPUT": 0}
"""FFD_CONTINUITY, and how many planes of control points it holds."""


@dataclass(frozen=True)
class Su2Config:
    """A configuration of SU2, as far as it concerns a deformation.

    Attributes
    ----------
    case : Case
        Roles and settings, without motions; the files of the meshes, as SU2 has them.
    markers : tuple of str
        The boundaries that the design variables move.
    variables : tuple of DesignVariable
    files, words : dict
        The values of ``FILES`` and ``WORDS``.
    ignored : tuple of str
        The keys that concern other things.
    named : dict of str to str
        The key that names each boundary with a role.
    """

    case: Case
    markers: tuple[str, ...]
    variables: tuple[DesignVariable, ...]
    files: dict[str, Path]
    words: dict[str, str]
    ignored: tuple[str, ...]
    named: dict[str, str]

    @property
    def source(self) -> Path:
        """Return the file."""
        assert self.case.source is not None
        return self.case.source


def own_changes(texts: Iterable[str]) -> tuple[dict[str, str], list[str]]:
    """Return the values of SU2's keys among texts KEY=VALUE, and the texts of slideviz's keys.

    Raises
    ------
    CaseError
        A key is none of them.
    """
    found, others, known = {}, [], _read_keys()
    for text in texts:
        name, sign, value = text.partition("=")
        key = name.strip().upper()
        if sign and key in known - set(KEYS):
            found[key] = value.strip()
            continue
        if sign and key not in {*known, *KEYS}:
            hint = nearest(key, (*known, *KEYS)) or "; `slideviz keys` lists those of slideviz"
            raise CaseError(f"--set {text}: unknown key {shown(key)}{hint}")
        others.append(text)
    return found, others


def read_config(path: Path, changes: Mapping[str, str] | None = None) -> Su2Config:
    """Return what of a configuration concerns a deformation. Paths are those of the working folder.

    ``changes`` are values of SU2's keys that stand in place of those in the file.

    Raises
    ------
    CaseError
        It cannot be read, or has mistakes: a line ``file:line: sentence`` for each.
    """
    text, warnings = read_text(path, "case file")
    entries, problems = entries_of(text, "%")  # other signs have a meaning in some values
    require_no_mesh(path, entries)
    rows = {entry.key: entry for entry in entries}  # of two, SU2 would complain
    for entry in entries:
        if rows[entry.key] is not entry:
            sentence = f"{entry.key} is given again in line {rows[entry.key].line}; keep one"
            problems.append((entry.line, sentence))
    rows |= {key: Entry(key, value, 0) for key, value in (changes or {}).items()}
    reader = _Reader(rows, problems)
    case, markers = reader.case()
    variables = read_variables(rows, problems)
    ignored = tuple(key for key in rows if key not in _read_keys())
    files = {key: Path(reader.word(key, default)) for key, default in FILES.items()}
    words = {key: reader.word(key, default) for key, default in WORDS.items()}
    reader.check(words)
    if problems:
        raise CaseError(listed(path, problems))
    case = case.change(
        source=path,
        mesh_file=files["MESH_FILENAME"],
        mesh_out=_with_ending(files["MESH_OUT_FILENAME"], case),
        warnings=(*warnings, *_perhaps_ours(path, ignored, rows)),
    )
    return Su2Config(case, markers, variables, files, words, ignored, reader.named)


def _perhaps_ours(path: Path, ignored: tuple[str, ...], rows: dict[str, Entry]) -> list[str]:
    """Return warnings about keys that nearly are those that are read here."""
    found = []
    for key in ignored:
        close = get_close_matches(key, OWN, n=1, cutoff=ALIKE_OWN) or get_close_matches(
            key, _read_keys() - set(rows), n=1, cutoff=ALIKE
        )
        if close:
            found.append(f"{path}:{rows[key].line}: {key} is not read; did you mean {close[0]}?")
    return found


def _read_keys() -> set[str]:
    formats = {"MESH_FORMAT", "MESH_OUT_FORMAT"}
    return {*OURS, *ROLE_KEYS, *FILES, *WORDS, *LISTS, *formats}


def _with_ending(path: Path, case: Case) -> Path:
    return path if path.suffix else path.with_suffix(f".{case.mesh_out_format or 'su2'}")


class _Reader:
    """Reads the keys of a configuration, and notes what is wrong with them."""

    def __init__(self, rows: dict[str, Entry], problems: list[Problem]) -> None:
        self.rows, self.problems = rows, problems
        self.named: dict[str, str] = {}

    def word(self, key: str, default: str) -> str:
        """Return the value of a key, without quotes."""
        entry = self.rows.get(key)
        return default if entry is None else entry.value.strip('"') or default

    def names(self, key: str) -> tuple[str, ...]:
        """Return the list of markers after a key."""
        entry = self.rows.get(key)
        if entry is None:
            return ()
        try:
            kind = KEYS["MARKER_PERIODIC" if key == "MARKER_PERIODIC" else "MARKER_FIXED"].kind
            return tuple(kind.read(entry.value))
        except CaseError as problem:
            self.note(entry, str(problem))
            return ()

    def note(self, entry: Entry, sentence: str) -> None:
        """Note what is wrong with a key."""
        self.problems += [(entry.line, f"{entry.key}: {line}") for line in sentence.splitlines()]

    def case(self) -> tuple[Case, tuple[str, ...]]:
        """Return roles and settings, and the boundaries that move."""
        case = Case(generate_quality=False)
        roles: dict[str, Role] = {}
        for key, role in ROLE_KEYS.items():
            names = self.names(key)
            roles |= dict.fromkeys(names, role)
            self.named |= dict.fromkeys(names, key)
        for name, row in OURS.items():
            entry = self.rows.get(name)
            if entry is None or name in ROLE_KEYS:
                continue
            try:
                case = row.put(case, row.kind.read(entry.value))
            except CaseError as problem:
                self.note(entry, str(problem))
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
        """Return the formats of the meshes as a case has them."""
        found: dict[str, str | None] = {}
        for key, field in (("MESH_FORMAT", "mesh_format"), ("MESH_OUT_FORMAT", "mesh_out_format")):
            entry = self.rows.get(key)
            value = "SU2" if entry is None else entry.value.upper()
            if value not in ("SU2", "SU2B", "CGNS"):
                assert entry is not None
                self.note(entry, not_one_of(value, ("SU2", "SU2B", "CGNS")))
            # Without the key the ending tells, as it does for CGNS.
            known = entry is not None and value.lower() in FILE_FORMATS
            found[field] = value.lower() if known else None
        return found

    def check(self, words: dict[str, str]) -> None:
        """Note values that are none, and keys of ours that do not belong here."""
        for key, allowed in (
            ("FFD_CONTINUITY", ("", *CONTINUITIES)),
            ("FFD_COORD_SYSTEM", ("CARTESIAN",)),
            ("FFD_SYMMETRY_PLANE", ("YES", "NO")),
            ("DV_SENSITIVITY_FORMAT", ("SU2_NATIVE", "UNORDERED_ASCII")),
        ):
            if words[key].upper() not in allowed:
                listed = ", ".join(filter(None, allowed))
                said = f"{shown(words[key])} is not supported; supported: {listed}"
                self.note(self.rows[key], said)
        for key in ("MOTION", "DEFORMATION_FILENAME"):
            if key in self.rows:
                said = "belongs into a case file (slideviz run); here DV_KIND says what moves"
                self.note(self.rows[key], said)
        for key in ("FFD_FIX_I", "FFD_FIX_J", "FFD_FIX_K"):
            if any(not word.text.isdecimal() for word in list_of(words[key])):
                self.note(self.rows[key], f"{shown(words[key])} is no list of whole numbers")
        try:
            float(words["OPT_RELAX_FACTOR"])
        except ValueError:
            entry = self.rows["OPT_RELAX_FACTOR"]
            self.note(entry, f"{shown(entry.value)} is not a number")
        if "DV_KIND" not in self.rows:
            said = f"DV_KIND is missing: which design variables there are ({', '.join(KINDS)})"
            close = nearest("DV_KIND", self.rows)
            self.problems.append(
                (max((e.line for e in self.rows.values()), default=1), said + close)
            )
