"""A row of the table of keys, and the ways to put its value into a case and to get it back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from slideviz.case.model import Case, FromFile, Motion, Reduction
from slideviz.case.values import Kind
from slideviz.errors import CaseError
from slideviz.terms import METHODS, PERIODIC_DIRECTIONS, ROLES, Method, Role

Put = Callable[[Case, Any], Case]
Get = Callable[[Case], Any]
Form = Literal["main", "more"]
_NO_DEFAULT = "not set"
FILES, BOUNDARIES, MOTION = "Files", "Boundaries", "Motion"
PERIODICITY, METHOD, REDUCTION, QUALITY = "Periodicity", "Method", "Data reduction", "Quality"
VIEW = "View"
GROUPS = (FILES, BOUNDARIES, MOTION, PERIODICITY, METHOD, REDUCTION, QUALITY, VIEW)


@dataclass(frozen=True)
class Key:
    """A key of the case file.

    Attributes
    ----------
    name, group : str
        The key in upper case, and the heading it stands under.
    kind : Kind
        How its value is read and written.
    meaning : str
        What it does, in a sentence.
    put, get : callable
        Put a value into a case (``CaseError`` where it contradicts what is there), and take it
        out: None where the file need not say anything.
    default : str
        The text of the value that holds when the file does not have the key.
    rbf_slide : bool
        Whether RBF-SliDe has the key too.
    field : str
        The field of ``Case``, or of its ``Reduction``, that has the value; empty where it is in
        several or in a part of one.
    label, unit : str
        What the window calls it, and the unit of its value, if it has one.
    form : "main", "more" or None
        Where the method panel has a field for it: among the first, below "More settings", nowhere.
    tip : str
        What it does, for who looks at that field; the meaning where it is empty.
    rank : int
        Its place in that form, and in the words of a run: small ones first, like ones as listed.
    said : str or None
        What is said of a run of which it differs from others, with ``{}`` for the value; the
        label and the value where it is None, nothing where it is empty.
    method : str or None
        The only method that uses it.
    unless : callable
        Why it does nothing in a case that has that method; empty where it does something.
    no_effect : str
        Why it changes no result of any case, for those that RBF-SliDe's files have.
    """

    name: str
    group: str
    kind: Kind
    meaning: str
    put: Put
    get: Get
    default: str = _NO_DEFAULT
    rbf_slide: bool = False
    field: str = ""
    label: str = ""
    unit: str = ""
    form: Form | None = None
    tip: str = ""
    rank: int = 99
    said: str | None = None
    method: Method | None = None
    unless: Callable[[Case], str] = lambda _: ""
    no_effect: str = ""

    @property
    def title(self) -> str:
        """Return its label with its unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def idle(self, case: Case) -> str:
        """Return why it does nothing in a case; empty where it does something."""
        return _other_method(case, self.method) or self.unless(case)


def _other_method(case: Case, method: Method | None) -> str:
    """Return that the method of a case is another one, which does not use a setting."""
    if method in (None, case.method):
        return ""
    label = METHODS[case.method].label
    return f"{label if label[:2].isupper() else label[0].lower() + label[1:]} does not use it"


def no_pair(case: Case) -> str:
    """Return why settings of periodicity do nothing in a case."""
    return "" if "periodic" in case.roles.values() else "no boundary has the role “periodic”"


def nothing_slides(case: Case) -> str:
    """Return why it does not matter in a case how nodes slide."""
    slides = {"sliding", "periodic", "internal"}.intersection(case.roles.values())
    return "" if slides else "no boundary has the role “sliding” or “periodic”"


def no_reduction(case: Case) -> str:
    """Return why settings of data reduction do nothing in a case."""
    off = "" if case.reduction is not None else "data reduction is off"
    return _other_method(case, "rbf") or off


def no_levels(case: Case) -> str:
    """Return why settings of the levels of data reduction do nothing in a case."""
    levels = case.reduction is not None and case.reduction.multilevel
    return no_reduction(case) or ("" if levels else "there are no levels")


def _field(field: str) -> tuple[Put, Get]:
    return lambda case, value: case.change(**{field: value}), lambda case: getattr(case, field)


def setting(name: str, group: str, kind: Kind, field: str, meaning: str, **window: Any) -> Key:
    """Return the row of a plain field of ``Case``; ``window`` has further attributes of the row."""
    value = getattr(Case(), field)
    default = _NO_DEFAULT if value is None else kind.write(value)
    return Key(name, group, kind, meaning, *_field(field), default, field=field, **window)


def greedy(name: str, kind: Kind, field: str, meaning: str, **window: Any) -> Key:
    """Return the row of a field of ``Reduction``; without data reduction it is checked only."""

    def put(case: Case, value: Any) -> Case:
        if case.reduction is None:
            return case
        return case.change(reduction=replace(case.reduction, **{field: value}))

    def get(case: Case) -> Any:
        return None if case.reduction is None else getattr(case.reduction, field)

    value = getattr(Reduction(), field)
    default = _NO_DEFAULT if value is None else kind.write(value)
    window = {"unless": no_reduction, **window}
    return Key(name, REDUCTION, kind, meaning, put, get, default, field=field, **window)


def put_double_edge(case: Case, wanted: bool) -> Case:
    """Return the case that selects two nodes at a time, or one: RBF-SliDe's DOUBLE_EDGE."""
    if case.reduction is None:
        return case
    return case.change(reduction=replace(case.reduction, selection="double" if wanted else "one"))


def put_reduction(case: Case, wanted: bool) -> Case:
    """Return the case with data reduction (its settings kept) or without."""
    return case.change(reduction=(case.reduction or Reduction()) if wanted else None)


def role(name: str, kind: Kind, wanted: Role, meaning: str) -> Key:
    """Return the row of the list of the markers that have a role."""

    def put(case: Case, names: tuple[str, ...]) -> Case:
        return case.change(roles={**case.roles, **dict.fromkeys(names, wanted)})

    def get(case: Case) -> tuple[str, ...] | None:
        return case.markers_with(wanted) or None

    return Key(name, BOUNDARIES, kind, meaning, put, get, label=f"the role “{ROLES[wanted].label}”")


def put_boundaries(case: Case, names: tuple[str, ...]) -> Case:
    """Let markers slide that no other list has: RBF-SliDe's meaning of MARKER_BDRY."""
    return case.change(roles={**dict.fromkeys(names, "sliding"), **case.roles})


def _leading_file(case: Case) -> tuple[Motion, ...]:
    """Return the displacement file of all moving markers, if the motions begin with one."""
    return tuple(m for m in case.motions[:1] if isinstance(m, FromFile) and not m.marker)


def put_file(case: Case, path: Path | None) -> Case:
    """Return the case whose motions begin with this displacement file, or with none."""
    rest = case.motions[len(_leading_file(case)) :]
    return case.change(motions=rest if path is None else (FromFile(path), *rest))


def get_file(case: Case) -> Path | None:
    """Return the displacement file of all moving markers that the motions begin with."""
    files = [motion.path for motion in _leading_file(case) if isinstance(motion, FromFile)]
    return files[0] if files else None


def put_motions(case: Case, motions: tuple[Motion, ...]) -> Case:
    """Return the case with these motions after its displacement file."""
    return case.change(motions=(*_leading_file(case), *motions))


def get_motions(case: Case) -> tuple[Motion, ...] | None:
    """Return the motions after the displacement file, None if there are none."""
    return case.motions[len(_leading_file(case)) :] or None


def put_direction(case: Case, word: str) -> Case:
    """Return the case with that direction, and the type of periodicity that it implies."""
    direction, implied = PERIODIC_DIRECTIONS[word]
    if implied is not None and case.periodic_type not in ("auto", implied):
        raise CaseError(
            f"{word} is a direction of {implied} periodicity, and PERIODIC_TYPE= "
            f"{case.periodic_type}; change one of the two"
        )
    return case.change(direction=direction, periodic_type=implied or case.periodic_type)


def get_direction(case: Case) -> str | None:
    """Return the number of the direction as text, None if it is left to the matching."""
    return None if case.direction is None else str(case.direction)
