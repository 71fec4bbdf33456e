"""A row of the table of keys of the case file, and functions that make the usual rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from slideviz.case.fields import CaseFields
from slideviz.case.values import YES_NO, Kind, one_of
from slideviz.terms import METHODS, ROLES, Method, Role

if TYPE_CHECKING:
    from slideviz.case.model import Case

Put = Callable[["Case", Any], "Case"]
Get = Callable[["Case"], Any]
Form = Literal["main", "more"]
NO_DEFAULT = "not set"
FILES = "Files"
BOUNDARIES = "Boundaries"
MOTION = "Motion"
PERIODICITY = "Periodicity"
METHOD = "Method"
REDUCTION = "Data reduction"
QUALITY = "Quality"
VIEW = "View"
GROUPS = (FILES, BOUNDARIES, MOTION, PERIODICITY, METHOD, REDUCTION, QUALITY, VIEW)


@dataclass(frozen=True)
class Key:
    """A key of the case file."""

    name: str
    group: str
    """`name`, `group`: the key in upper case, and the heading above it in files and in the
    reference."""
    kind: Kind  # how its value is read and written
    meaning: str  # what it does, in a sentence
    put: Put
    get: Get
    """`put`, `get`: ``put`` returns a case with a value in it, or raises ``CaseError`` where the
    value contradicts the case; ``get`` returns the value, or None where a file need not have it."""
    default: str = NO_DEFAULT  # the text of the value where the file does not have the key
    rbf_slide: bool = False  # whether RBF-SliDe has the key too
    field: str = ""
    """The field of ``Case``, or of its ``Reduction``, that is the value; empty where the value is
    made of several fields, or is only a part of one."""
    label: str = ""
    unit: str = ""
    """`label`, `unit`: what the window calls it, and the unit of its value, if it has one."""
    form: Form | None = None
    """Whether the method panel has a field for it: among the first ones, below "More settings", or
    not."""
    tip: str = ""  # the tip of that field; empty: ``meaning``
    run_label: str | None = None
    """Words in the label of a run whose value differs from those of other runs, with ``{}`` for the
    value. None: the key's label and the value; empty: no words."""
    method: Method | None = None  # the only method that uses it
    switch: Callable[[Case], str] = lambda _: ""
    """Returns which other setting keeps the key from having an effect; empty where none does."""
    idle_reason: Callable[[Case], str] = lambda _: ""
    """Returns why the key has no effect in a case otherwise; empty where it has one."""
    no_effect: str = ""
    """Why it never changes a result: for keys that are read only because RBF-SliDe has them."""

    @property
    def title(self) -> str:
        """Return the label, with the unit in brackets if there is one."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def is_default(self, value: Any) -> bool:
        """Return whether a value is the default, or None."""
        return value is None or self.kind.write(value) == self.default

    def idle(self, case: Case) -> str:
        """Return why the key has no effect in a case; "" if it has one."""
        return other_method(case, self.method) or self.switch(case) or self.idle_reason(case)


def other_method(case: Case, method: Method | None) -> str:
    """Return the message that the case's method is not ``method``; "" where it is, or for None."""
    if method in (None, case.method):
        return ""
    label = METHODS[case.method].label
    return f"{label if label[:2].isupper() else label[0].lower() + label[1:]} does not use it"


def setting(
    group: str, name: str, meaning: str, kind: Kind | None = None, *, field: str = "", **window: Any
) -> Key:
    """Return the row of a key whose value is a field of ``Case``, as `field_row`."""
    field = field or name.lower()
    return field_row(
        CaseFields(),
        group,
        name,
        meaning,
        kind,
        field=field,
        put=lambda case, value: case.change(**{field: value}),
        get=lambda case: getattr(case, field),
        **window,
    )


def field_row(
    owner: Any, group: str, name: str, meaning: str, kind: Kind | None, field: str, **window: Any
) -> Key:
    """Return the row of a key whose value is a field of a dataclass; ``window`` has more of `Key`.

    Without a ``kind`` its values are those of the field's enumeration, or YES and NO. A field of
    the method panel has by default the key as its label. ``owner``: has the default.
    """
    terms = owner.__dataclass_fields__[field].metadata
    default = getattr(owner, field)
    kind = kind or (one_of(terms) if terms else YES_NO)
    if "form" in window:
        window = {"label": name.replace("_", " ").capitalize(), **window}
    text = NO_DEFAULT if default is None else kind.write(default)
    return Key(name, group, kind, meaning, default=text, field=field, **window)


def role(name: str, kind: Kind, wanted: Role, meaning: str) -> Key:
    """Return the row of a key that lists the markers with the role ``wanted``."""

    def put(case: Case, names: tuple[str, ...]) -> Case:
        return case.change(roles={**case.roles, **dict.fromkeys(names, wanted)})

    def get(case: Case) -> tuple[str, ...] | None:
        return case.markers_with(wanted) or None

    return Key(name, BOUNDARIES, kind, meaning, put, get, label=f"the role “{ROLES[wanted].label}”")
