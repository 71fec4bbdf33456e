"""Keys of a case file about boxes for free-form deformation, as SU2 has them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from slideviz.case.fields import CaseFields
from slideviz.case.key import MOTION, NO_DEFAULT, Key, setting
from slideviz.case.values import POINT, Kind
from slideviz.case.words import Word, groups_of, is_none, list_of, name_text, number, words_of
from slideviz.errors import CaseError, Message, shown

if TYPE_CHECKING:
    from slideviz.case.model import Case

Definition = tuple[str, tuple[float, ...]]
Degrees = tuple[int, int, int]
NUMBERS = 24  # coordinates of the 8 corners of a box
IN_2D = 12  # those of the 4 corners that 2D uses


def _groups(text: str) -> list[list[Word]]:
    """Return the words of each box in a value, without brackets; none for ``NONE``."""
    words = words_of(text)
    return [] if is_none(words) else [group for group in groups_of(words) if group]


def _read_definition(text: str) -> tuple[Definition, ...]:
    problems = []
    groups = _groups(text)
    for group in groups:
        name, *corners = group
        extra = corners[NUMBERS:] if group is groups[-1] else []
        if all(word.is_number and not number(word.text) for word in extra):
            corners = corners[: len(corners) - len(extra)]  # SU2 passes over zeros at the end
        if len(corners) not in (IN_2D, NUMBERS) or name.is_number:
            raise CaseError(
                f"box {shown(name.text)} has {len(corners)} numbers; expected its name and "
                f"{NUMBERS}: 8 corners x, y, z (in 2D 4 with z = 0)"
            )
        values = [number(word.text) for word in corners] + [0.0] * (NUMBERS - len(corners))
        problems.append((name.text, tuple(values)))
    names = [box for box, _ in problems]
    for box in names:
        if names.count(box) > 1:
            raise CaseError(f"box {box!r} is defined twice; rename one")
    return tuple(problems)


def _write_definition(boxes: tuple[Definition, ...]) -> str:
    return " ; \\\n    ".join(
        f"({name_text(name)}, {', '.join(repr(float(value)) for value in corners)})"
        for name, corners in boxes
    )


def _integers(words: list[Word], least: int) -> Degrees:
    values = [number(word.text) for word in words]
    if len(values) != 3 or any(value != int(value) or value < least for value in values):
        listed = ", ".join(word.text for word in words)
        raise CaseError(f"({listed}) is not three whole numbers from {least}")
    i, j, k = map(int, values)
    return i, j, k


def _said_where_needed(row: Key) -> Key:
    """Return the row of a key, changed so that a file has the key only where it has an effect."""
    usual = getattr(CaseFields(), row.field)
    needs_boxes = row.switch is _without_definition

    def get(case: Case) -> Any:
        value = getattr(case, row.field)
        return value if value != usual or (needs_boxes and case.ffd_boxes and usual) else None

    return replace(row, get=get, default=row.default or NO_DEFAULT)


def _without_definition(case: Case) -> str:
    return "" if case.ffd_boxes else "FFD_DEFINITION defines no box"


def _without_axis(case: Case) -> str:
    return "FFD_COORD_SYSTEM= CARTESIAN has no axis" if case.ffd_system == "CARTESIAN" else ""


def ffd_contradictions(case: Case) -> list[Message]:
    """Return a message for FFD keys that contradict each other."""
    boxes = len(case.ffd_boxes)
    degrees = len(case.ffd_degrees)
    if boxes == degrees or not boxes:
        return []
    sentence = f"FFD_DEFINITION has {boxes} and FFD_DEGREE {degrees}" if degrees else ""
    sentence = f"{sentence or 'FFD_DEGREE is missing'}; give a degree (i, j, k) for each box"
    return [Message(sentence, keys=("FFD_DEFINITION", "FFD_DEGREE"))]


DEFINITION = Kind("(NAME, 8 corners x, y, z) ; ...", _read_definition, _write_definition)
DEGREES = Kind(
    "(i, j, k) ; ...",
    lambda text: tuple(_integers(group, 0) for group in _groups(text)),
    lambda degrees: " ; ".join(f"({i}, {j}, {k})" for i, j, k in degrees),
)
ORDERS = Kind(
    "i, j, k", lambda text: _integers(list_of(text), 1), lambda orders: ", ".join(map(str, orders))
)

_setting = partial(setting, MOTION)
_ROWS = (
    _setting(
        "FFD_DEFINITION",
        "Boxes for free-form deformation, in SU2's order of corners; boxes of the mesh override "
        "them.",
        DEFINITION,
        field="ffd_boxes",
        label="FFD boxes",
    ),
    _setting(
        "FFD_DEGREE",
        "The degrees of each box of FFD_DEFINITION: control points of each direction, minus one.",
        DEGREES,
        field="ffd_degrees",
        label="FFD degrees",
        switch=_without_definition,
    ),
    _setting(
        "FFD_BLENDING",
        "How control points of these boxes move the nodes inside.",
        label="FFD blending",
        switch=_without_definition,
    ),
    _setting(
        "FFD_BSPLINE_ORDER",
        "With FFD_BLENDING= BSPLINE_UNIFORM, the orders of the splines, 2 or more.",
        ORDERS,
        field="ffd_orders",
        label="FFD orders",
        switch=_without_definition,
    ),
    _setting(
        "FFD_COORD_SYSTEM",
        "The coordinates in which boxes are straight, also the boxes of the mesh; their axis is "
        "along x: r, θ, x (CYLINDRICAL), or r, θ, φ with φ from the axis (SPHERICAL, POLAR).",
        field="ffd_system",
        label="FFD coordinates",
    ),
    _setting("FFD_AXIS", "A point on that axis.", POINT, label="FFD axis", switch=_without_axis),
)
FFD_ROWS = tuple(_said_where_needed(row) for row in _ROWS)
