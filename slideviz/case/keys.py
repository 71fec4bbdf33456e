"""The table of all keys of a case file, by which they are read, checked, written and explained.

Values are put into a case in the order of the table, whatever their order in the file. Those of the
view are in ``Case.view``, by key; `slideviz.session.saving` makes a view of them and back; runs
without a window ignore them. The numbers of DATA_REDUCTION= AUTO in the text are EXACT_NODES and
AUTO_TOLERANCE of `slideviz.solver.setup`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from slideviz import terms
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
from slideviz.case.words import Word, groups_of, is_none, list_of, name_text, number, words_of
from slideviz.errors import CaseError, Message, shown
from slideviz.formats.table import FILE_FORMATS
from slideviz.rbf.reduction import Reduction
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
    Role,
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


HIDDEN = "hidden"  # the last word of a section that is not drawn

SectionText = tuple[str, tuple[float, ...], bool, bool, bool]
"""A section: shape, numbers, whether whole cells are shown, has a flat view, and is drawn."""


def numbers(count: int, allowed: str, rising: bool = False, more: int = 0) -> Kind:
    """Return the kind of ``count`` to ``count + more`` numbers; with ``rising`` each larger."""

    def read(text: str) -> tuple[float, ...]:
        values = tuple(number(item.text) for item in list_of(text))
        if not count <= len(values) <= count + more:
            raise CaseError(f"{shown(text)} has {len(values)} numbers; expected {allowed}")
        if rising and any(a >= b for a, b in pairwise(values)):
            raise CaseError(f"{shown(text)} does not rise; expected {allowed}")
        return values

    return Kind(allowed, read, vector_text)


def words(known: tuple[str, ...]) -> Kind:
    """Return the kind of a list of words out of ``known``; it is read in the order of these."""
    allowed = f"a list of {', '.join(known)}"

    def read(text: str) -> tuple[str, ...]:
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


def _row(name: str, kind: Kind, meaning: str) -> Key:
    def put(case: Case, value: Any) -> Case:
        return case.change(view={**case.view, name: value})

    return Key(name, VIEW, kind, meaning, put, lambda case: case.view.get(name))


VIEW_ROWS = (
    _row("VIEW_COLOR", choice({w: w for w in COLOR_BY}), "What the colors show."),
    _row("VIEW_RANGE", numbers(2, "two rising numbers", True), "Ends of the color bar."),
    _row("VIEW_MAP", choice({w: w for w in COLOR_MAPS}), "The color map."),
    _row("VIEW_THRESHOLD", numbers(2, "two rising numbers", True), "Only cells between them."),
    _row("VIEW_POINTS", choice({w: w for w in POINTS_SHOWN}), "Nodes drawn as points."),
    _row("VIEW_SHOW", words(tuple(map(hyphened, SHOWN))), "What is drawn beside the boundaries."),
    _row("VIEW_COPIES", integer(-1), "Passages drawn on each side; -1 draws all."),
    _row("VIEW_HIDDEN", NAMES, "Boundaries that are not drawn."),
    _row("VIEW_SECTIONS", SECTIONS, f"Sections of the mesh, each by a {names()}."),
    _row(
        "VIEW_CAMERA",
        numbers(10, "ten or eleven numbers", more=1),
        "Position of the camera, the point that it looks at, its upward direction, and half the "
        "height of the view; then width over height of the view, for a narrower one.",
    ),
)


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

_motion_setting = partial(setting, MOTION)
_FFD = (
    _motion_setting(
        "FFD_DEFINITION",
        "Boxes for free-form deformation, in SU2's order of corners; boxes of the mesh override "
        "them.",
        DEFINITION,
        field="ffd_boxes",
        label="FFD boxes",
    ),
    _motion_setting(
        "FFD_DEGREE",
        "The degrees of each box of FFD_DEFINITION: control points of each direction, minus one.",
        DEGREES,
        field="ffd_degrees",
        label="FFD degrees",
        switch=_without_definition,
    ),
    _motion_setting(
        "FFD_BLENDING",
        "How control points of these boxes move the nodes inside.",
        label="FFD blending",
        switch=_without_definition,
    ),
    _motion_setting(
        "FFD_BSPLINE_ORDER",
        "With FFD_BLENDING= BSPLINE_UNIFORM, the orders of the splines, 2 or more.",
        ORDERS,
        field="ffd_orders",
        label="FFD orders",
        switch=_without_definition,
    ),
    _motion_setting(
        "FFD_COORD_SYSTEM",
        "The coordinates in which boxes are straight, also the boxes of the mesh; their axis is "
        "along x: r, θ, x (CYLINDRICAL), or r, θ, φ with φ from the axis (SPHERICAL, POLAR).",
        field="ffd_system",
        label="FFD coordinates",
    ),
    _motion_setting(
        "FFD_AXIS", "A point on that axis.", POINT, label="FFD axis", switch=_without_axis
    ),
)
FFD_ROWS = tuple(_said_where_needed(row) for row in _FFD)


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


def _why_no_layers(case: Case) -> str:
    return "layers are off" if case.layers == "no" else ""


def _why_no_minimum_gap(case: Case) -> str:
    """Return why layers do not give way; "" if they do."""
    return _why_no_layers(case) or ("relaxation is off" if case.relax == "no" else "")


def _why_no_repair(case: Case) -> str:
    return "repair is off" if case.repair == "no" else ""


def greedy(
    name: str, meaning: str, kind: Kind | None = None, *, field: str = "", **window: Any
) -> Key:
    """Return the row of a key whose value is a field of ``Reduction``, as `field_row`.

    Where a case has no data reduction, the value is checked and not kept.
    """
    field = field or name.lower()
    usual = getattr(Reduction(), field)
    window = {"switch": _why_no_reduction, **window}

    def put(case: Case, value: Any) -> Case:
        if case.reduction is None:
            return case
        return case.change(reduction=replace(case.reduction, **{field: value}))

    def get(case: Case) -> Any:
        reduction = case.reduction
        if reduction is None:
            return None
        value = getattr(reduction, field)
        # A tolerance without effect is written to a file only where it is not the default.
        idle = reduction.auto and window["switch"] is why_no_tolerance and value == usual
        return None if idle else value

    return field_row(
        Reduction(), REDUCTION, name, meaning, kind, field=field, put=put, get=get, **window
    )


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


REDUCTION_ROWS = (
    Key(
        "DATA_REDUCTION",
        REDUCTION,
        one_of(terms.DATA_REDUCTIONS, {"TRUE": "YES", "FALSE": "NO"}),
        "Interpolate with only some of the boundary nodes; with NO the keys below have no effect. "
        "AUTO does so if there are more than 2000. Its tolerance is a thousandth of the largest "
        "displacement, or half of the height of the first layer at sliding boundaries.",
        put_reduction,
        get_reduction,
        "AUTO",
        field="reduction",
        label="Data reduction",
        form="main",
        tip="Interpolate with only as many boundary nodes as the tolerance needs, and correct the "
        "remaining error: for meshes with more than a few thousand boundary nodes. Automatic: "
        "only for these.",
        method="rbf",
    ),
    greedy(
        "DATA_RED_TOLERANCE",
        "Largest error left before the boundary is corrected, over all steps, in the mesh's unit.",
        real(0.0),
        field="tolerance",
        label="Tolerance",
        form="main",
        tip="The largest error at the boundary that the control nodes may leave to the "
        "correction, in the mesh's length unit.",
        run_label="",
        switch=why_no_tolerance,
    ),
    greedy(
        "DATA_RED_RELATIVE",
        "The tolerance as a part of the mesh's largest extent, instead of DATA_RED_TOLERANCE.",
        real(0.0),
        field="relative",
        label="a relative tolerance of a case file,",
        run_label="",
        switch=why_no_tolerance,
    ),
    greedy(
        "MULTILEVEL",
        "Select the control nodes in levels.",
        label="Levels",
        form="more",
        tip="Whether data reduction selects in levels, each on the error that the previous ones "
        "left, and what ends a level.",
        run_label="",
    ),
    greedy(
        "MULTI_CRIT",
        "What ends a level: its number of nodes, or the decrease of its error.",
        field="criterion",
        run_label="levels by {}",
        switch=_why_no_levels,
    ),
    greedy(
        "LVL_TOL_CRIT",
        "Decrease of the error that ends a level.",
        real(0.0, 1.0),
        field="level_tolerance",
        run_label="a level ends at {}",
        switch=_why_no_levels,
    ),
    greedy(
        "LVL_SIZE",
        "Number of control nodes of a level.",
        integer(1),
        field="level_size",
        label="A level ends at",
        form="more",
        tip="Number of control nodes of a level, or the part of its error at which it ends.",
        switch=_why_no_levels,
    ),
    Key(
        "DOUBLE_EDGE",
        REDUCTION,
        YES_NO,
        "Select two nodes at a time, with opposite errors (YES), or one (NO); prefer the key "
        "SELECTION.",
        _put_double_edge,
        lambda _: None,
    ),
    greedy(
        "SELECTION",
        "Nodes added in a cycle: a growing block (fastest), two with opposite errors, or one.",
        form="more",
        tip="How many control nodes data reduction adds in a cycle: a growing block (fastest), "
        "two with opposite errors, or the one with the largest error.",
    ),
    greedy(
        "MAX_CONTROL_NODES",
        "Stop at this number of control nodes in any case.",
        integer(1),
        field="max_nodes",
        run_label="",
    ),
    greedy(
        "GAMMA",
        "Radius of the correction, divided by the largest error.",
        real(0.0),
        label="Correction radius ×",
        form="more",
        tip="How far the last correction of the boundary reaches, as a multiple of the largest "
        "error that the control nodes leave.",
    ),
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


_method_setting = partial(setting, METHOD)

METHOD_ROWS = (
    _method_setting(
        "METHOD",
        "Radial basis functions, or for comparison inverse distance weighting, or linear "
        "elasticity (as in SU2; DEFORM_STIFFNESS_TYPE, DEFORM_COEFF). With these two, ps and ds do "
        "the same, kernel, radius and data reduction have no effect, and nothing is relaxed.",
        form="main",
        tip="How the inner nodes follow: by radial basis functions, or for comparison by inverse "
        "distance weighting, or as an elastic body whose small cells are stiffer (a choice of "
        "SU2's, not its default).",
        run_label="",
    ),
    _method_setting(
        "SLIDING_MODE",
        f"How nodes slide: not at all, {_WAYS}.",
        field="sliding",
        label="Sliding",
        form="main",
        tip="Whether the nodes of sliding boundaries stay (none), slide and are projected to the "
        "boundary in stages (pseudo), or slide as part of the system itself (direct).",
        run_label="",
        idle_reason=nothing_slides,
    ),
    _method_setting(
        "RIMS",
        "What a motion does with nodes of moving boundaries that are also on sliding or internal "
        "ones: FREE takes them off these walls, with a warning; SLIDE keeps them there, at the "
        "closest point, and the nodes beside them follow smoothly.",
        label="Nodes on walls",
        form="main",
        tip="Whether nodes that a moving boundary shares with a sliding or internal boundary, such "
        "as nodes of a blade on its hub, stay on that wall whatever the motion is; the nodes "
        "beside them follow smoothly.",
        run_label="rims {}",
        idle_reason=_no_walls,
    ),
    _method_setting(
        "RELAX",
        "Relax the mesh after the last step, to the least distortion of all cells: they go back "
        "to their undeformed shapes, turned as they are, and none folds. Cells are better in the "
        "mean, and boundary layers nearly keep their heights and angles. AUTO does so up to a "
        "million cells in memory.",
        label="Relaxation",
        form="main",
        tip="Whether cells then go back towards their undeformed shapes, turned as they are: "
        "better in the mean, boundary layers nearly keep their heights, and no cell folds.",
        run_label="relaxation {}",
        idle_reason=lambda case: "" if case.relax == "yes" else other_method(case, "rbf"),
    ),
    _method_setting(
        "STEPS",
        "Steps in which the deformation is applied; auto tries 1, 2, 3, 5, 8, 13, 21 and 34, "
        "halves steps that fold a cell, and takes the fewest that are enough.",
        or_auto(integer(1, MAX_STEPS), "auto"),
        form="main",
        tip="Into how many equal parts the motion is divided: more keep large motions valid and "
        "take longer; automatic (0) takes as few as give no inverted cell.",
        run_label="",
    ),
    _method_setting(
        "STEPS_GAIN",
        "With STEPS= auto, steps are enough if more of them raise the minimum quality by less "
        "than this part.",
        real(0.0, 1.0),
        run_label="gain {}",
        switch=lambda case: "STEPS is a number" if case.steps else "",
    ),
    replace(
        _method_setting(
            "INFLUENCE_FACTOR",
            "Support radius of the radial function, divided by the largest extent of the mesh. "
            "AUTO: 15 "
            "times the largest extent of a connected moving body, or 20 times the largest "
            "displacement if that is more, and at most 2.5 extents of the mesh.",
            or_auto(real(*FACTORS), "AUTO"),
            label="Radius × extent",
            form="more",
            tip="Support radius: how far a boundary node reaches into the mesh, as a multiple of "
            "the mesh's largest extent. Automatic: as far as the motion needs.",
            run_label="radius × {}",
            method="rbf",
        ),
        put=lambda case, factor: case.change(influence_factor=factor, support_radius=None),
    ),
    _method_setting(
        "SUPPORT_RADIUS",
        "Support radius in the mesh's length unit, instead of INFLUENCE_FACTOR.",
        real(0.0),
        label="Support radius as a length",
        run_label="radius {}",
        method="rbf",
    ),
    _method_setting(
        "RBF_KERNEL",
        "The radial function; those without compact support need a smaller INFLUENCE_FACTOR.",
        replace(
            one_of(terms.KERNELS),
            allowed="one of the names below",
            details=tuple(f"{name:<22}{kernel.label}" for name, kernel in terms.KERNELS.items()),
            words=terms.names(terms.KERNELS),
        ),
        field="kernel",
        label="Kernel",
        form="more",
        tip="The radial function; a global one reaches through the whole mesh whatever the "
        "radius, and needs a smaller support radius.",
        run_label="{}",
        method="rbf",
    ),
    _method_setting(
        "POLYNOMIAL",
        "Add a linear polynomial to the radial functions: motions that are linear in the "
        "coordinates are exact then, with any kernel, and nodes beyond all supports move too. "
        "AUTO: only where the kernel needs it (thin-plate, multiquadric, quadric).",
        form="more",
        tip="Whether a linear polynomial is added to the radial functions: a motion that is linear "
        "in the coordinates is then exact with any kernel, and nodes far from the motion move too.",
        run_label="polynomial {}",
        method="rbf",
    ),
    _method_setting(
        "LAYERS",
        "Keep boundary layers: nodes near walls go with the displacement and rotation of the wall, "
        "so that first heights and angles stay. Walls are moving and fixed boundaries: AUTO takes "
        "those with flat quadrilaterals, hexahedra or prisms, KEEP all of them.",
        form="main",
        tip="Whether nodes near walls go with the wall's own displacement and rotation: this keeps "
        "the heights of boundary layers.",
        run_label="layers {}",
        idle_reason=lambda case: "" if case.layers == "keep" else other_method(case, "rbf"),
    ),
    _method_setting(
        "LAYER_THICKNESS",
        "How far from walls LAYERS acts, in the mesh's length unit. AUTO: a fiftieth of the wall's "
        "largest extent, or the thickness of its boundary layer if that is less.",
        or_auto(real(0.0), "AUTO"),
        form="more",
        tip="How far from walls nodes go with them, in the mesh's length unit. Automatic: a "
        "fiftieth of the wall's extent, or the thickness of its boundary layer if that is less.",
        run_label="to {}",
        switch=_why_no_layers,
        method="rbf",
    ),
    _method_setting(
        "LAYER_MINIMUM_GAP",
        "The part of their height that cells beside the layers keep before these give way, where "
        "walls come near each other. With 0 they never do. Only a relaxed mesh has it.",
        real(0.0, 1.0, with_low=True),
        label="Minimum gap",
        form="more",
        tip="Layers become thinner where the cells beside them would keep less than this part of "
        "their height, as walls come near each other. With 0 they never do.",
        run_label="minimum gap {}",
        switch=_why_no_minimum_gap,
    ),
    _method_setting(
        "REPAIR",
        "Mend cells that are inverted, not proved valid, or of a quality below REPAIR_BELOW (and "
        "lower than before): nodes near them move, never nodes of moving and fixed boundaries. The "
        "mesh is never worse after it. AUTO is the same as YES.",
        form="main",
        tip="Whether inverted and poor cells are then mended, by moving the nodes near them: never "
        "nodes of moving and fixed boundaries.",
        run_label="repair {}",
    ),
    _method_setting(
        "REPAIR_BELOW",
        "The quality below which REPAIR mends valid cells, too; with 0 it mends only those that "
        "are not proved valid.",
        real(0.0, 1.0, with_low=True),
        form="more",
        tip="The quality below which valid cells are mended, too.",
        run_label="repair below {}",
        switch=_why_no_repair,
    ),
    _method_setting(
        "REPAIR_STEPS",
        "Whether REPAIR acts after each step (YES, not of a streamed mesh), or after the last one "
        "(NO).",
        label="Repair each step",
        form="more",
        tip="Whether cells are mended after each step, so that the next one starts from a better "
        "mesh, or only after the last.",
        run_label="repair of each step",
        switch=_why_no_repair,
    ),
    _method_setting(
        "IDW_POWER",
        "With METHOD= idw, the power of the inverse distance; by default the number of dimensions.",
        real(0.0, 20.0, closed=True),
        run_label="power {}",
        method="idw",
    ),
    _method_setting(
        "IDW_FIXED_WEIGHT",
        "With METHOD= idw, the weight of a boundary node that stays, relative to one that moves.",
        real(1e-12, 1e12),
        run_label="fixed weight {}",
        method="idw",
    ),
    _method_setting(
        "DEFORM_STIFFNESS_TYPE",
        "With METHOD= elastic, which cells are stiff, like SU2: Young's modulus is one over the "
        "mean distance of the cell's nodes to the nearest node of a wall (SU2's default), one over "
        "the cell's volume, or the same everywhere. Walls are moving boundaries, and fixed ones "
        f"whose names have none of {', '.join(terms.NOT_WALLS)}.",
        one_of(terms.STIFFNESS_TYPES, {"WALL_DISTANCE": "SOLID_WALL_DISTANCE"}),
        run_label="stiffness {}",
        method="elastic",
    ),
    _method_setting(
        "DEFORM_COEFF",
        "With METHOD= elastic, Poisson's ratio. With SU2's default of 1e6 cells may grow and "
        "shrink freely, and keep their angles instead.",
        Kind(_RATIOS, _read_ratio, lambda value: repr(float(value)), entry="real"),
        run_label="Poisson's ratio {}",
        method="elastic",
    ),
    _method_setting(
        "CURVED",
        "No effect: RBF-SliDe's switch for curved boundaries, which are always found and followed.",
        run_label="",
        no_effect="curved boundaries are always found and followed",
    ),
    _method_setting(
        "FEATURE_ANGLE",
        "Angle in degrees from which a bend within a boundary is an edge.",
        real(0.0, 180.0, closed=True),
        field="feature_angle_deg",
        unit="°",
        form="more",
        tip="A boundary that turns by more than this angle has an edge there, which sliding nodes "
        "do not cross.",
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


_periodic_setting = partial(setting, PERIODICITY)
PERIODIC_ROWS = (
    _periodic_setting(
        "PERIODIC_MODE",
        "How boundaries are periodic: not at all, in the distance only, or also in the "
        "displacement with fixed or moving vertices.",
        field="periodic",
        label="Periodicity",
        form="main",
        tip="What the periodic boundaries do: nothing special (none), only the distance is "
        "periodic (periodic), or both sides deform in the same way, with the corners of the "
        "domain fixed (fixed vertices) or sliding (moving vertices).",
        run_label="",
        idle_reason=no_pair,
    ),
    _periodic_setting(
        "PERIODIC_TYPE",
        "Shift (0) or rotation (1); auto finds out by matching the markers.",
        one_of(PERIODIC_TYPES, {"0": "translational", "1": "rotational"}),
        label="Type",
        form="main",
        tip="Whether one side is the other one shifted or rotated; automatic takes the one that "
        "matches.",
        run_label="{} type",
        idle_reason=no_pair,
    ),
    Key(
        "PERIODIC_DIRECTION",
        PERIODICITY,
        choice({word: word for word in PERIODIC_DIRECTIONS}),
        "No effect, except that x, y, r and theta imply PERIODIC_TYPE: the direction (0, 1, 2 "
        "for x, y, z or r, theta, z) is found by matching the markers.",
        _put_direction,
        lambda case: None if case.direction is None else str(case.direction),
        field="direction",
        run_label="",
        no_effect="matching the periodic markers finds the direction",
    ),
    _periodic_setting(
        "PERIODIC_AXIS",
        "Axis of rotational periodicity.",
        AXIS,
        field="axis",
        label="Axis",
        form="main",
        tip="The axis that the mesh repeats about, for rotational periodicity.",
        idle_reason=no_pair,
    ),
    _periodic_setting(
        "PERIODIC_ORIGIN",
        "A point on that axis.",
        POINT,
        field="origin",
        label="Through",
        form="main",
        run_label="axis through {}",
        idle_reason=no_pair,
    ),
    _periodic_setting(
        "SPAN",
        "Hub and shroud, between which the span of a machine goes from 0 to 1. AUTO takes the "
        "boundaries whose names contain hub, and shroud or casing.",
        ENDS,
        label="Hub and shroud",
        run_label="span {}",
    ),
)


def _leading_file(case: Case) -> tuple[Motion, ...]:
    """Return the displacement file of all moving markers, if motions begin with one."""
    return tuple(motion for motion in case.motions[:1] if motion.is_case_file)


def _put_file(case: Case, path: Path | None) -> Case:
    files = () if path is None else (FromFile(path),)
    return case.change(motions=(*files, *case.motions[len(_leading_file(case)) :]))


_FORMAT = choice({term.label: value for value, term in FILE_FORMATS.items()})

_ROWS = (
    setting(FILES, "MESH_FILENAME", "The mesh to deform.", PATH, field="mesh_file"),
    setting(
        FILES,
        "REFERENCE_FILENAME",
        "The undeformed mesh, of the same cells, if MESH_FILENAME was deformed from it: cells are "
        "relaxed to its shapes, layers keep its heights, walls are those of it that nodes slid "
        "along, and qualities compare with it. So a motion and then its reverse lead back.",
        PATH,
        field="reference_file",
    ),
    setting(
        FILES, "MESH_OUT_FILENAME", "Where the deformed mesh is written.", PATH, field="mesh_out"
    ),
    setting(
        FILES,
        "MESH_FORMAT",
        "SU2's text or binary format; without this key, ending and content of the file decide.",
        _FORMAT,
    ),
    setting(
        FILES, "MESH_OUT_FORMAT", "SU2's text or binary, whatever the ending of the file.", _FORMAT
    ),
    setting(
        FILES,
        "ZONE",
        "The zone to deform alone, from 1, of a mesh with several; without it all.",
        integer(1),
    ),
    role("MARKER_MOVING", NAMES, "moving", "Boundaries whose displacement is prescribed."),
    role("MARKER_FIXED", NAMES, "fixed", "Boundaries that stay. Boundaries in no list stay, too."),
    role("MARKER_SLIDING", NAMES, "sliding", "Boundaries along which their nodes may slide."),
    role("MARKER_PERIODIC", PAIRS, "periodic", "Periodic boundaries, in pairs of any order."),
    role(
        "MARKER_INTERNAL",
        NAMES,
        "internal",
        "Boundaries treated as inner nodes: they move freely, only their rim is kept in place.",
    ),
    Key(
        "MARKER_ZONE_INTERFACE",
        BOUNDARIES,
        COUPLES,
        "Pairs of boundaries of two zones whose nodes stay together where they coincide. Without "
        "it all that coincide do.",
        lambda case, names: case.change(interfaces=names),
        lambda case: case.interfaces or None,
        field="interfaces",
        run_label="",
    ),
    Key(
        "MARKER_BDRY",
        BOUNDARIES,
        NAMES,
        "All boundaries; those in no other list slide (with SLIDING_MODE= none they stay).",
        lambda case, names: case.change(roles={**dict.fromkeys(names, "sliding"), **case.roles}),
        lambda _: None,
    ),
    Key(
        "DEFORMATION_FILENAME",
        MOTION,
        PATH,
        "Displacements of the moving nodes: node, dx, dy[, dz] in each line; the others stay.",
        _put_file,
        lambda case: next((motion.files[0] for motion in _leading_file(case)), None),
        label="a displacement file",
    ),
    Key(
        "MOTION",
        MOTION,
        MOTIONS,
        "Motions of the moving boundaries, one after the other, after DEFORMATION_FILENAME.",
        lambda case, motions: case.change(motions=(*_leading_file(case), *motions)),
        lambda case: case.motions[len(_leading_file(case)) :] or None,
        label="Motion",
    ),
    *FFD_ROWS,
    *PERIODIC_ROWS,
    *METHOD_ROWS,
    *REDUCTION_ROWS,
    setting(
        QUALITY, "GENERATE_QUALITY", "Write the quality of the deformed mesh too.", run_label=""
    ),
    setting(
        QUALITY,
        "QUALITY_METRIC",
        "Size-skew as published, or as RBF-SliDe computes it (differs for hexahedra).",
        label="Quality",
        form="more",
        tip="How the quality of cells is measured: Knupp's published size-skew, or as the program "
        "RBF-SliDe computes it for hexahedra.",
    ),
    Key(
        "LIMITS",
        QUALITY,
        LIMITS,
        "What the deformed mesh must meet; if it does not, `run` ends with exit code 4. A number "
        "that each cell or wall has must be within its limit everywhere. Numbers of walls cover "
        "all boundaries with layers, or one, e.g. growth@blade < 1.5.",
        lambda case, limits: case.change(limits=limits),
        lambda case: case.limits or None,
        field="limits",
        label="Limits",
        run_label="",
    ),
    *VIEW_ROWS,
)
_RBF_SLIDE = {
    *("MESH_FILENAME", "MESH_OUT_FILENAME", "DEFORMATION_FILENAME", "GENERATE_QUALITY"),
    *("MARKER_BDRY", "MARKER_MOVING", "MARKER_INTERNAL", "MARKER_PERIODIC"),
    *("PERIODIC_MODE", "PERIODIC_TYPE", "PERIODIC_DIRECTION"),
    *("SLIDING_MODE", "STEPS", "INFLUENCE_FACTOR", "CURVED"),
    *("DATA_REDUCTION", "DATA_RED_TOLERANCE", "DOUBLE_EDGE", "GAMMA"),
    *("MULTILEVEL", "MULTI_CRIT", "LVL_TOL_CRIT", "LVL_SIZE"),
}

KEYS: dict[str, Key] = {row.name: replace(row, rbf_slide=row.name in _RBF_SLIDE) for row in _ROWS}

_FIRST = (
    *("METHOD", "SLIDING_MODE", *(row.name for row in PERIODIC_ROWS), "STEPS"),
    *("RBF_KERNEL", "INFLUENCE_FACTOR", "DATA_REDUCTION", "DATA_RED_TOLERANCE", "FEATURE_ANGLE"),
    *("STEPS_GAIN", "IDW_POWER", "IDW_FIXED_WEIGHT", "QUALITY_METRIC"),
    *("DEFORM_STIFFNESS_TYPE", "DEFORM_COEFF"),
    *("SELECTION", "MULTILEVEL", "LVL_SIZE", "GAMMA"),
)
BY_WEIGHT = tuple(KEYS[name] for name in dict.fromkeys((*_FIRST, *KEYS)))
"""All rows, the most important first: the order of fields in the window and of words on a run."""
