"""A row of the table of keys, and makers of the usual rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from slideviz.case.model import Case
from slideviz.case.values import Kind
from slideviz.terms import METHODS, ROLES, Method, Role

Put = Callable[[Case, Any], Case]
Get = Callable[[Case], Any]
Form = Literal["main", "more"]
NO_DEFAULT = "not set"
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
    default: str = NO_DEFAULT
    rbf_slide: bool = False
    field: str = ""
    label: str = ""
    unit: str = ""
    form: Form | None = None
    tip: str = ""
    said: str | None = None
    method: Method | None = None
    unless: Callable[[Case], str] = lambda _: ""
    no_effect: str = ""

    @property
    def title(self) -> str:
        """Return the label with the unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def idle(self, case: Case) -> str:
        """Return why the key does nothing in a case; empty where it does something."""
        return other_method(case, self.method) or self.unless(case)


def other_method(case: Case, method: Method | None) -> str:
    """Return that the method of a case is another one, which does not use a setting."""
    if method in (None, case.method):
        return ""
    label = METHODS[case.method].label
    return f"{label if label[:2].isupper() else label[0].lower() + label[1:]} does not use it"


def _field(field: str) -> tuple[Put, Get]:
    return lambda case, value: case.change(**{field: value}), lambda case: getattr(case, field)


def setting(name: str, group: str, kind: Kind, field: str, meaning: str, **window: Any) -> Key:
    """Return the row of a plain field of ``Case``; ``window`` has further attributes of the row."""
    value = getattr(Case(), field)
    default = NO_DEFAULT if value is None else kind.write(value)
    return Key(name, group, kind, meaning, *_field(field), default, field=field, **window)


def role(name: str, kind: Kind, wanted: Role, meaning: str) -> Key:
    """Return the row of the list of the markers that have a role."""

    def put(case: Case, names: tuple[str, ...]) -> Case:
        return case.change(roles={**case.roles, **dict.fromkeys(names, wanted)})

    def get(case: Case) -> tuple[str, ...] | None:
        return case.markers_with(wanted) or None

    return Key(name, BOUNDARIES, kind, meaning, put, get, label=f"the role “{ROLES[wanted].label}”")
