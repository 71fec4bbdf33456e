"""The table of all keys of a case file, by which they are read, checked, written and explained.

Its words and facts are in ``keys.toml``; rows here are of the keys that need a function. Values are
put into a case in the order of the table, whatever their order in the file. Those of the view are
in ``Case.view``, by key; `slideviz.session.saving` makes a view of them and back; runs without a
window ignore them. The numbers of DATA_REDUCTION= AUTO in the text are EXACT_NODES and
AUTO_TOLERANCE of `slideviz.solver.setup`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from slideviz import terms
from slideviz.argument_types import frozen
from slideviz.case.fields import CaseFields
from slideviz.case.limits import LIMITS
from slideviz.case.motion_text import MOTIONS
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import Motion
from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.case.values import (
    AXIS,
    COUPLES,
    ENDS,
    MAX_STEPS,
    NAMES,
    PAIRS,
    PATH,
    POINT,
    YES_NO,
    Kind,
    choice,
    integer,
    one_of,
    real,
    vector_text,
)
from slideviz.case.words import (
    Words,
    groups_of,
    is_none,
    list_of,
    name_text,
    number,
    words_of,
)
from slideviz.errors import CaseError, Message, shown
from slideviz.rbf.reduction import Reduction
from slideviz.system.tables import table_beside
from slideviz.terms import (
    COLOR_BY,
    COLOR_MAPS,
    METHODS,
    PERIODIC_DIRECTIONS,
    PERIODIC_TYPES,
    POINTS_SHOWN,
    ROLES,
    SHOWN,
    Method,
    Numbers,
    Role,
    Texts,
)

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


@frozen
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


_TABLE = table_beside(__file__)
_FIRST = _TABLE.pop("first")


def _facts(group: str, words: dict[str, Any]) -> dict[str, Any]:
    """Return the facts of `Key` that a row of ``keys.toml`` has."""
    facts = {"group": group, **words}
    if "kind" in facts:
        how, *numbers = facts["kind"]
        facts["kind"] = (integer if how == "whole" else real)(*numbers)
    if "off" in facts:
        facts["switch"] = partial(_why_off, facts.pop("off"))
    return facts


def _why_off(ways: list[tuple[str, str, str]], case: Case) -> str:
    return next((why for field, value, why in ways if getattr(case, field) == value), "")


_WORDS: dict[str, dict[str, Any]] = {
    name: _facts(group, words) for group, rows in _TABLE.items() for name, words in rows.items()
}


def row(name: str, kind: Kind, put: Put, get: Get, **facts: Any) -> Key:
    """Return the row of a key, with its words in ``keys.toml`` and further ``facts`` of `Key`."""
    return Key(**_WORDS[name] | {"name": name, "kind": kind, "put": put, "get": get} | facts)


def setting(name: str, kind: Kind | None = None, **facts: Any) -> Key:
    """Return the row of a key whose value is a field of ``Case``, as `field_row`."""
    field = _WORDS[name]["field"]
    return field_row(
        CaseFields(),
        name,
        kind,
        put=lambda case, value: case.change(**{field: value}),
        get=lambda case: getattr(case, field),
        **facts,
    )


def field_row(owner: Any, name: str, kind: Kind | None, **facts: Any) -> Key:
    """Return the row of a key whose value is a field of a dataclass; ``facts`` as of `row`.

    Without a ``kind``, here or in ``keys.toml``, its values are those of the field's enumeration,
    or YES and NO. ``owner``: has the default.
    """
    field = _WORDS[name]["field"]
    terms = owner.__dataclass_fields__[field].metadata
    default = getattr(owner, field)
    kind = kind or _WORDS[name].get("kind") or (one_of(terms) if terms else YES_NO)
    text = NO_DEFAULT if default is None else kind.write(default)
    return row(name, kind, default=text, **facts)


def role(wanted: Role) -> Key:
    """Return the row of the key that lists the markers with the role ``wanted``."""

    def put(case: Case, names: Texts) -> Case:
        return case.change(roles={**case.roles, **dict.fromkeys(names, wanted)})

    def get(case: Case) -> Texts | None:
        return case.markers_with(wanted) or None

    term = ROLES[wanted]
    kind = PAIRS if wanted == "periodic" else NAMES
    return row(term.key, kind, put, get, label=f"the role “{term.label}”")


HIDDEN = "hidden"  # the last word of a section that is not drawn

SectionText = tuple[str, Numbers, bool, bool, bool]
"""A section: shape, numbers, whether whole cells are shown, has a flat view, and is drawn."""


def numbers(count: int, allowed: str, rising: bool = False, more: int = 0) -> Kind:
    """Return the kind of ``count`` to ``count + more`` numbers; with ``rising`` each larger."""

    def read(text: str) -> Numbers:
        values = tuple(number(item.text) for item in list_of(text))
        if not count <= len(values) <= count + more:
            raise CaseError(f"{shown(text)} has {len(values)} numbers; expected {allowed}")
        if rising and any(a >= b for a, b in pairwise(values)):
            raise CaseError(f"{shown(text)} does not rise; expected {allowed}")
        return values

    return Kind(allowed, read, vector_text)


def words(known: Texts) -> Kind:
    """Return the kind of a list of words out of ``known``; it is read in the order of these."""
    allowed = f"a list of {', '.join(known)}"

    def read(text: str) -> Texts:
        words = [item.text.lower() for item in list_of(text)]
        for word in words:
            if word not in known:
                raise CaseError(f"{shown(word)} is not one of {', '.join(known)}")
        return tuple(word for word in known if word in words)

    return Kind(allowed, read, lambda value: f"( {', '.join(value)} )")


def read_sections(text: str) -> tuple[SectionText, ...]:
    """Return the sections of the value of ``VIEW_SECTIONS``; CaseError if one has another form."""
    sections = []
    for place, part in enumerate((p for p in text.split(";") if p.strip(" ()")), start=1):
        items = [item.text for item in list_of(part.strip())]
        form = items[0].lower() if items else ""
        drawn = items[-1].lower() != HIDDEN if items else True
        if not drawn:
            items.pop()
        shape = SECTION_SHAPES.get(form)
        word = "flat" if shape is None else shape.flat
        flat = bool(items) and items[-1].lower() == word and shape is not None
        if flat:
            items.pop()
        how = items[-1].lower() if items else ""
        if shape is None or how not in ("whole", "cut"):
            raise CaseError(
                f"section {place}: {shown(part.strip())} does not begin with {names()} and end "
                f"with whole or cut, and after that {word}, {HIDDEN} or nothing"
            )
        values = tuple(number(item) for item in items[1:-1])
        if len(values) != shape.count:
            raise CaseError(
                f"section {place}: a {form} has {shape.count} numbers, {len(values)} are given"
            )
        if not np.linalg.norm(values[-6:-3]) > 0:
            raise CaseError(f"section {place}: its direction has no length")
        fault = shape.size.fault(values[0]) if shape.size is not None else ""
        if fault and shape.size is not None:
            raise CaseError(f"section {place}: the {shape.size.word} {values[0]:g} {fault}")
        sections.append((form, values, how == "whole", flat, drawn))
    return tuple(sections)


def write_sections(sections: tuple[SectionText, ...]) -> str:
    """Return the value of ``VIEW_SECTIONS`` that ``read_sections`` reads back, without loss."""
    texts = []
    for form, values, whole_cells, flat, drawn in sections:
        words = [form, *(repr(float(v)) for v in values), "whole" if whole_cells else "cut"]
        if flat:
            words.append(SECTION_SHAPES[form].flat)
        if not drawn:
            words.append(HIDDEN)
        texts.append(f"({', '.join(words)})")
    return " ; ".join(texts) or "( )"


SECTIONS = Kind(
    "(form, numbers, whole | cut) ; ...",
    read_sections,
    write_sections,
    details=(
        *(
            f"({shape.value}, {shape.numbers}, whole | cut): {shape.meaning}"
            for shape in SECTION_SHAPES.values()
        ),
        "after that flat (plane) or unrolled (others): laid flat beside the view",
        "at the very end hidden: kept, but not drawn",
    ),
)


def hyphened(shown: str) -> str:
    """Return the word of VIEW_SHOW for a value of ``Shown``: hyphens instead of underscores."""
    return shown.replace("_", "-")


def _view(name: str, kind: Kind, **facts: Any) -> Key:
    """Return the row of a key whose value is in ``Case.view``."""

    def put(case: Case, value: Any) -> Case:
        return case.change(view={**case.view, name: value})

    return row(name, kind, put, lambda case: case.view.get(name), **facts)


_VIEW = (
    _view("VIEW_COLOR", one_of(COLOR_BY)),
    _view("VIEW_RANGE", numbers(2, "two rising numbers", True)),
    _view("VIEW_MAP", one_of(COLOR_MAPS)),
    _view("VIEW_THRESHOLD", numbers(2, "two rising numbers", True)),
    _view("VIEW_POINTS", one_of(POINTS_SHOWN)),
    _view("VIEW_SHOW", words(tuple(map(hyphened, SHOWN)))),
    _view("VIEW_COPIES", integer(-1)),
    _view("VIEW_HIDDEN", NAMES),
    _view("VIEW_SECTIONS", SECTIONS, meaning=f"Sections of the mesh, each by a {names()}."),
    _view("VIEW_CAMERA", numbers(10, "ten or eleven numbers", more=1)),
)


Definition = tuple[str, Numbers]
Degrees = tuple[int, int, int]
NUMBERS = 24  # coordinates of the 8 corners of a box
IN_2D = 12  # those of the 4 corners that 2D uses


def _groups(text: str) -> list[Words]:
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


def _integers(words: Words, least: int) -> Degrees:
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

_FFD = (
    setting("FFD_DEFINITION", DEFINITION),
    setting("FFD_DEGREE", DEGREES, switch=_without_definition),
    setting("FFD_BLENDING", switch=_without_definition),
    setting("FFD_BSPLINE_ORDER", ORDERS, switch=_without_definition),
    setting("FFD_COORD_SYSTEM"),
    setting("FFD_AXIS", POINT),
)
_FFD_ROWS = tuple(_said_where_needed(row) for row in _FFD)


def _why_no_reduction(case: Case) -> str:
    off = "" if case.reduction is not None else "data reduction is off"
    return other_method(case, "rbf") or off


_AUTO = "DATA_REDUCTION= AUTO finds the tolerance; YES uses this one"


def why_no_tolerance(case: Case) -> str:
    """Return why a tolerance of data reduction has no effect in a case; "" where it has one."""
    auto = case.reduction is not None and case.reduction.auto
    return _why_no_reduction(case) or (_AUTO if auto else "")


def _why_no_levels(case: Case) -> str:
    levels = case.reduction is not None and case.reduction.multilevel
    return _why_no_reduction(case) or ("" if levels else "there are no levels")


def greedy(name: str, kind: Kind | None = None, **facts: Any) -> Key:
    """Return the row of a key whose value is a field of ``Reduction``, as `field_row`."""
    field = _WORDS[name]["field"]
    usual = getattr(Reduction(), field)
    facts = {"switch": _why_no_reduction, **facts}

    def put(case: Case, value: Any) -> Case:
        if case.reduction is None:
            return case
        return case.change(reduction=replace(case.reduction, **{field: value}))

    def get(case: Case) -> Any:
        reduction = case.reduction
        if reduction is None:
            return None
        value = getattr(reduction, field)
        idle = reduction.auto and facts["switch"] is why_no_tolerance and value == usual
        return None if idle else value

    return field_row(Reduction(), name, kind, put=put, get=get, **facts)


def _put_double_edge(case: Case, wanted: bool) -> Case:
    if case.reduction is None:
        return case
    return case.change(reduction=replace(case.reduction, selection="double" if wanted else "one"))


def put_reduction(case: Case, wanted: terms.DataReduction) -> Case:
    """Return the case with data reduction (with the settings it has), automatic, or without."""
    reduction = replace(case.reduction or Reduction(), auto=wanted == "AUTO")
    return case.change(reduction=None if wanted == "NO" else reduction)


def get_reduction(case: Case) -> terms.DataReduction:
    """Return whether a case asks for data reduction: "YES", "NO" or "AUTO"."""
    if case.reduction is None:
        return "NO"
    return "AUTO" if case.reduction.auto else "YES"


_REDUCTION = (
    row(
        "DATA_REDUCTION",
        one_of(terms.DATA_REDUCTIONS, {"TRUE": "YES", "FALSE": "NO"}),
        put_reduction,
        get_reduction,
        default="AUTO",
    ),
    greedy("DATA_RED_TOLERANCE", switch=why_no_tolerance),
    greedy("DATA_RED_RELATIVE", switch=why_no_tolerance),
    *(greedy(name, switch=_why_no_levels) for name in ("MULTI_CRIT", "LVL_TOL_CRIT", "LVL_SIZE")),
    row("DOUBLE_EDGE", YES_NO, _put_double_edge, lambda _: None),
)


_WAYS = " or ".join(
    f"{name} ({way})" for way, name in terms.names(terms.SLIDING).items() if way != "none"
)
FACTORS = 1e-6, 1e6  # limits of the support radius over the extent of the mesh


def nothing_slides(case: Case) -> str:
    """Return why SLIDING_MODE has no effect in a case; "" where some boundary may slide."""
    slides = {"sliding", "periodic", "internal"}.intersection(case.roles.values())
    return "" if slides else "no boundary has the role “sliding” or “periodic”"


def _no_walls(case: Case) -> str:
    walls = {"sliding", "internal"}.intersection(case.roles.values())
    return "" if walls else "no boundary has the role “sliding” or “internal”"


def or_auto(kind: Kind, word: str) -> Kind:
    """Return the kind of the values of ``kind``, which are numbers, or ``word``: 0 in the case."""
    nothing = 0 if kind.entry == "whole" else 0.0

    def read(text: str) -> Any:
        if text.lower() == word.lower():
            return nothing
        try:
            return kind.read(text)
        except CaseError as problem:
            raise CaseError(f"{problem}, or {word}") from None

    return replace(
        kind,
        allowed=f"{kind.allowed}, or {word}",
        read=read,
        write=lambda value: kind.write(value) if value else word,
        words={nothing: "automatic"},
        span=(0, kind.span[1]),
    )


def automatic_radius(case: Case) -> bool:
    """Return whether the support radius of a case is found from its motion."""
    return case.method == "rbf" and case.support_radius is None and not case.influence_factor


_RATIOS = "a number of at least 0 and below 0.5, or above 1 up to 1e12"


def _read_ratio(text: str) -> float:
    value = number(text)
    if not (0.0 <= value < 0.5 or 1.0 < value <= 1e12):
        raise CaseError(f"{text} is out of range; expected {_RATIOS}")
    return value


_METHOD = (
    setting(
        "SLIDING_MODE", idle_reason=nothing_slides, meaning=f"How nodes slide: not at all, {_WAYS}."
    ),
    setting("RIMS", idle_reason=_no_walls),
    setting(
        "RELAX", idle_reason=lambda case: "" if case.relax == "yes" else other_method(case, "rbf")
    ),
    setting("STEPS", or_auto(integer(1, MAX_STEPS), "auto")),
    setting("STEPS_GAIN", switch=lambda case: "STEPS is a number" if case.steps else ""),
    replace(
        setting("INFLUENCE_FACTOR", or_auto(real(*FACTORS), "AUTO")),
        put=lambda case, factor: case.change(influence_factor=factor, support_radius=None),
    ),
    setting(
        "RBF_KERNEL",
        replace(
            one_of(terms.KERNELS),
            allowed="one of the names below",
            details=tuple(f"{name:<22}{kernel.label}" for name, kernel in terms.KERNELS.items()),
            words=terms.names(terms.KERNELS),
        ),
    ),
    setting(
        "LAYERS",
        idle_reason=lambda case: "" if case.layers == "keep" else other_method(case, "rbf"),
    ),
    setting("LAYER_THICKNESS", or_auto(real(0.0), "AUTO")),
    setting(
        "DEFORM_STIFFNESS_TYPE",
        one_of(terms.STIFFNESS_TYPES, {"WALL_DISTANCE": "SOLID_WALL_DISTANCE"}),
        meaning="With METHOD= elastic, which cells are stiff, like SU2: Young's modulus is one "
        "over the mean distance of the cell's nodes to the nearest node of a wall (SU2's "
        "default), one over the cell's volume, or the same everywhere. Walls are moving "
        f"boundaries, and fixed ones whose names have none of {', '.join(terms.NOT_WALLS)}.",
    ),
    setting(
        "DEFORM_COEFF", Kind(_RATIOS, _read_ratio, lambda value: repr(float(value)), entry="real")
    ),
)


def no_pair(case: Case) -> str:
    """Return why settings of periodicity have no effect in a case; "" where they have one."""
    return "" if "periodic" in case.roles.values() else "no boundary has the role “periodic”"


def _put_direction(case: Case, word: str) -> Case:
    direction, implied = PERIODIC_DIRECTIONS[word]
    if implied is not None and case.periodic_type not in ("auto", implied):
        raise CaseError(
            f"{word} is a direction of {implied} periodicity, and PERIODIC_TYPE= "
            f"{case.periodic_type}; change one of the two"
        )
    return case.change(direction=direction, periodic_type=implied or case.periodic_type)


_PERIODIC = (
    setting("PERIODIC_MODE", idle_reason=no_pair),
    setting(
        "PERIODIC_TYPE",
        one_of(PERIODIC_TYPES, {"0": "translational", "1": "rotational"}),
        idle_reason=no_pair,
    ),
    row(
        "PERIODIC_DIRECTION",
        choice({word: word for word in PERIODIC_DIRECTIONS}),
        _put_direction,
        lambda case: None if case.direction is None else str(case.direction),
    ),
    setting("PERIODIC_AXIS", AXIS, idle_reason=no_pair),
    setting("PERIODIC_ORIGIN", POINT, idle_reason=no_pair),
    setting("SPAN", ENDS),
    setting(
        "SPAN_AXIS",
        replace(
            AXIS,
            allowed=f"AUTO | {AXIS.allowed}",
            read=lambda text: None if text.upper() == "AUTO" else AXIS.read(text),
            write=lambda axis: "AUTO" if axis is None else AXIS.write(axis),
            entry="text",
        ),
    ),
)


def _leading_file(case: Case) -> tuple[Motion, ...]:
    """Return the displacement file of all moving markers, if motions begin with one."""
    return tuple(motion for motion in case.motions[:1] if motion.is_case_file)


def _put_file(case: Case, path: Path | None) -> Case:
    files = () if path is None else (FromFile(path),)
    return case.change(motions=(*files, *case.motions[len(_leading_file(case)) :]))


_FORMAT = choice({term.label: value for value, term in terms.FILE_FORMATS.items()})

_ROWS = (
    setting("MESH_FILENAME", PATH),
    setting("REFERENCE_FILENAME", PATH),
    setting("MESH_OUT_FILENAME", PATH),
    setting("MESH_FORMAT", _FORMAT),
    setting("MESH_OUT_FORMAT", _FORMAT),
    *map(role, ROLES),
    row(
        "MARKER_ZONE_INTERFACE",
        COUPLES,
        lambda case, names: case.change(interfaces=names),
        lambda case: case.interfaces or None,
    ),
    row(
        "MARKER_BDRY",
        NAMES,
        lambda case, names: case.change(roles={**dict.fromkeys(names, "sliding"), **case.roles}),
        lambda _: None,
    ),
    row(
        "DEFORMATION_FILENAME",
        PATH,
        _put_file,
        lambda case: next((motion.files[0] for motion in _leading_file(case)), None),
    ),
    row(
        "MOTION",
        MOTIONS,
        lambda case, motions: case.change(motions=(*_leading_file(case), *motions)),
        lambda case: case.motions[len(_leading_file(case)) :] or None,
    ),
    *_FFD_ROWS,
    *_PERIODIC,
    *_METHOD,
    *_REDUCTION,
    row(
        "LIMITS",
        LIMITS,
        lambda case, limits: case.change(limits=limits),
        lambda case: case.limits or None,
    ),
    *_VIEW,
)


def _usual(name: str) -> Key:
    return greedy(name) if _WORDS[name]["group"] == REDUCTION else setting(name)


_NAMED = {key.name: key for key in _ROWS}
KEYS: dict[str, Key] = {name: _NAMED.get(name) or _usual(name) for name in _WORDS}
"""All rows by name, in the order of ``keys.toml``, which is that of files."""
REDUCTION_ROWS = tuple(key for key in KEYS.values() if key.group == REDUCTION)
BY_WEIGHT = tuple(KEYS[name] for name in dict.fromkeys((*_FIRST, *KEYS)))
"""All rows, the most important first: the order of fields in the window and of words on a run."""
