"""The editor of a motion: boundary, kind, and rows for the numbers of all kinds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QFileDialog, QFormLayout, QLabel, QWidget

from slideviz.case.motion_words import target_words
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.motion import (
    Axis,
    Motion,
    MotionStart,
    Target,
    direction_words,
    named,
)
from slideviz.case.motions.span import curve_text, read_curve
from slideviz.ffd.box import MOST_DEGREE
from slideviz.gui.widgets.build import (
    Choice,
    as_widget,
    grow_fields,
    in_row,
    push_button,
    set_policy,
)
from slideviz.gui.widgets.fields import (
    CheckedText,
    NumberField,
    TextField,
    VectorField,
    a_direction,
    control_point_problem,
    unless,
)
from slideviz.gui.widgets.panel import SpanWalls
from slideviz.gui.widgets.span_curve import SpanCurveField
from slideviz.session.motions import radial
from slideviz.terms import (
    AXES,
    SIDES,
    SPAN_KINDS,
    FfdSystem,
    Numbers,
    Texts,
    WholeNumbers,
    labels,
    tips,
)

ABOUT = {
    "centroid": "its centroid (mean of nodes)",
    "line": "a line through its sections",
    "axis": "the machine's axis",
    "radial": "radial through its centroid",
    "point": "a point",
}
"""What a motion leaves in place, by the choice's value."""
MEAN = (
    "The mean of its nodes: it lies towards where these are dense. “A point” takes another place."
)
"""Tip of the centroids among these."""


KIND_LABELS = {kind: kind.kind_term.label for kind in KINDS}


whole_degrees = unless(
    lambda degrees: all(n == int(n) and 1 <= n <= MOST_DEGREE for n in degrees),
    f"degrees are whole numbers from 1 to {MOST_DEGREE}",
)


def _unchanged(value: Any) -> Any:
    return value


def _integers(values: Sequence[float]) -> WholeNumbers:
    return tuple(int(value) for value in values)


class FormRow(NamedTuple):
    """A row of the form: its title, the attribute of a motion in it, and its field."""

    title: str
    attribute: str
    make: Callable[[], QWidget]
    shown: Callable[[Any], Any] = _unchanged
    """Returns what the field shows for a value of the attribute."""
    read: Callable[[Any], Any] = _unchanged
    """Returns the value of the attribute for that of the field."""
    per_axis: bool = False
    """Whether the field has a number for each axis of the mesh."""
    is_length: bool = False
    """Whether numbers are in the mesh's length unit: arrow keys then step by the mesh's size."""


def _row(
    title: str,
    attribute: str,
    field: Callable[..., QWidget],
    tip: str,
    **facts: Any,
) -> FormRow:
    of_row = {name: facts.pop(name) for name in FormRow._fields if name in facts}
    return FormRow(title, attribute, partial(field, tip=tip, **facts), **of_row)


def _factors() -> VectorField:
    tip = "Enlargement along each axis: 1 leaves it, 2 doubles it."
    made = VectorField((1.0, 1.0, 1.0), tip=tip)
    for field in made.fields:
        field._allowed = unless(bool, "0 would flatten the boundary")
    return made


# fmt: off
# Rounded: 1.03 is not 3 % to the last bit.
ROWS: dict[str, FormRow] = {
    "box": _row("Box", "box", Choice,
        "The box whose control points move: of the mesh, or of the case.", words={}),
    "index": _row("Control point", "index", VectorField,
        "The control point, counted from 0 along each direction of the box; -1 is all.",
        allowed=control_point_problem, names="ijk", read=_integers),
    "plane": _row("Plane j", "plane", NumberField,
        "The plane of control points, counted from 0 along j; -1 is all.",
        allowed=lambda value: control_point_problem((value,)), read=int),
    "vector": _row("By", "vector", VectorField,
        "How far it moves along each axis, in the mesh's length unit.",
        per_axis=True, is_length=True),
    "amount": _row("By", "amount", NumberField,
        "How far control points move, in the mesh's length unit. With the thickness, the last "
        "ones move forwards, and the first ones as far backwards.", is_length=True),
    "angle": _row("Angle (°)", "angle_deg", NumberField,
        "Degrees; positive turns counter-clockwise seen against the axis."),
    "factors": FormRow(
        "Factors", "factors", _factors, lambda one: one if len(one) > 1 else one * 3,
        per_axis=True),
    "percent": _row("Radius by (%)", "factor", NumberField,
        "How much larger the radius becomes, in percent: 3 is 3 % outwards.",
        allowed=unless(lambda value: value > -100.0, "-100 % or less would fold the boundary"),
        shown=lambda factor: round(100.0 * (factor - 1.0), 10),
        read=lambda percent: round(1.0 + percent / 100.0, 14)),
    "distance": _row("and by (length)", "distance", NumberField,
        "How far it also moves outwards, in the mesh's length unit.", is_length=True),
    "change": _row("Changes", "kind", Choice, "What of the blade's sections the curve changes.",
        words={kind: f"{term.label} ({term.unit})" for kind, term in SPAN_KINDS.items()},
        tips=tips(SPAN_KINDS)),
    "curve": _row("Over span", "spans", CheckedText,
        "Values at parts of the span, from 0 at hub or root to 1 at shroud or tip: 0:0, "
        "0.5:1.5, 1:4; or one value for all. A smooth curve goes through them."),
    "about": _row("About", "point", Choice, "What stays in place while it turns or grows.",
        words={what: ABOUT[what] for what in ("centroid", "point")}),
    "point": _row("Point", "point", VectorField, "The point that stays in place.",
        per_axis=True, is_length=True),
    "axis": _row("Axis", "axis", VectorField,
        "Direction of the axis; its length does not matter.",
        values=(0.0, 0.0, 1.0), allowed=a_direction),
    "side": _row("Side", "side", Choice, "Which side moves.", words=labels(SIDES),
        tips=tips(SIDES)),
    "term": _row("Shape", "term", VectorField,
        "The term of the shape function, counted from 1 at the leading edge, and how many.",
        values=(1.0, 1.0), names=("term", "of"), read=_integers,
        allowed=unless(lambda kn: all(n == int(n) for n in kn) and 1 <= kn[0] <= kn[1],
                       "expected whole numbers, and a term from 1 to how many there are")),
    "peak": _row("Peak at (%)", "peak", NumberField,
        "Where the bump is highest, in percent of the chord.", value=50.0,
        allowed=unless(lambda value: 0.0 < value < 100.0,
                       "the peak lies between 0 and 100 % of the chord"),
        shown=lambda peak: round(100.0 * peak, 10),
        read=lambda percent: round(percent / 100.0, 14)),
    "raised": _row("Raised by", "height", NumberField,
        "How far it is raised, in the mesh's length unit.", is_length=True),
    "chord": _row("Chord", "chord", VectorField,
        "x of the leading and of the trailing edge: the airfoil lies along x.",
        values=(0.0, 1.0), names=("x from", "to"), is_length=True,
        allowed=unless(lambda ends: ends[0] < ends[1], "the trailing edge has the larger x")),
    "path": FormRow("File", "path", TextField),
    "limit": _row("At most away", "limit", NumberField,
        "How far a node may stay away, a length; 0 is 1 % of the boundary's size.",
        allowed=unless(lambda value: value >= 0.0, "a distance is not below 0"), is_length=True),
}
# fmt: on
"""The rows of the form; each field is also an attribute of `MotionEditor`, by its name here."""


class MotionEditor(QWidget):
    """The editor of a motion, which emits each valid change.

    ``walls``: the field for hub and shroud, which motions over the span have in common.
    """

    if TYPE_CHECKING:  # the fields of `ROWS`

        def __getattr__(self, name: str) -> Any: ...

    changed = Signal(object)  # Motion
    """The motion as edited, in place of the one that was shown."""
    table_wanted = Signal()
    """The user wants to edit the rows of the motion's displacement file."""
    box_wanted = Signal()
    """The user wants a new box around the motion's boundaries."""
    box_changed = Signal(object, object)
    """Other degrees (int, int, int) of the motion's box, or other coordinates; None: the same."""

    def __init__(self, walls: SpanWalls) -> None:
        super().__init__()
        self.walls = walls
        self.form = QFormLayout(self)
        self.form.setContentsMargins(0, 2, 0, 0)
        grow_fields(self.form)
        self._make_fields()
        self._place_fields()
        self._motion: Any = None  # Motion | None
        self._dim = 3
        self._targets: tuple[Target, ...] = ()
        self.centroid_of: Callable[[Target], Numbers] = lambda _: (0.0,) * self._dim
        """Returns a target's centroid, offered as the first fixed point."""
        self.chord_of: Callable[[Target], tuple[float, float]] = lambda _: (0.0, 1.0)
        """Returns from which x to which x a target goes."""
        self.machine: Axis | None = None
        """The axis about which the mesh repeats; None if it does not."""
        self.boxes: Texts = ()
        """The names of the boxes for free-form deformation that can be chosen."""
        self.degrees: Mapping[str, WholeNumbers] = {}
        """The degrees of those that are of the case, by name."""
        self.system: FfdSystem = "CARTESIAN"
        """The coordinates in which boxes are straight."""
        self._as_point = False
        self._connect()
        self.show_motion(None, (), 3)

    def _make_fields(self) -> None:
        self.marker = Choice(
            {},
            "The boundaries that move. To move some of them as one body, about their common "
            "centroid, select them in the table of boundaries first; then you can choose them "
            "here.",
        )
        self.kind = Choice(KIND_LABELS)
        for name, row in ROWS.items():
            setattr(self, name, row.make())
        self.drawn = SpanCurveField()
        self.curve.read = self.drawn.written
        self.browse = push_button("…", "Choose the file.", self._browse)
        self.browse.setMaximumWidth(30)
        tip = "Make a box of control points around the boundary: they are few, and can be moved."
        self.new_box = push_button("", tip, self.box_wanted, "new_box")
        set_policy(self.new_box, "Ignored", "Fixed")
        self.degree = VectorField((1, 1, 1), whole_degrees, "ijk", "Degree along each direction.")
        tip = "In which coordinates the boxes are straight, about an axis along x."
        self.coordinates = Choice({"CARTESIAN": "x, y, z", "CYLINDRICAL": "r, θ, x"}, tip)
        tip = "Type or paste the rows, or change them, and save them as the file."
        self.table = push_button("Table…", tip, self.table_wanted, "motion_table")

    def _place_fields(self) -> None:
        both = (self.kind, self.marker)
        line = in_row(*both, wide=both, spacing=6)
        line.setStretch(0, 4)  # room for the longest kind, where the window is 1280 pixels wide
        line.setStretch(1, 3)
        self.form.addRow("Motion", as_widget(line))
        file = as_widget(in_row(self.path, self.browse, self.table, wide=[self.path], spacing=4))
        both = (self.box, self.coordinates)
        joined = {"path": file, "box": as_widget(in_row(*both, wide=both, spacing=4))}
        self._rows: dict[str, QWidget] = {}
        self._titles = {name: QLabel(row.title) for name, row in ROWS.items()}
        for name, title in self._titles.items():
            self._rows[name] = joined.get(name, getattr(self, name))
            self.form.addRow(title, self._rows[name])
            if name == "curve":
                self.form.addRow(self.drawn)
            if name == "box":
                self.form.addRow("", self.new_box)
                self.form.addRow("Degrees", self.degree)
        # One width for all labels, so that the fields do not jump from motion to motion.
        widest = max(label.sizeHint().width() for label in self._titles.values())
        for label in self._titles.values():
            label.setMinimumWidth(widest)
        for choice in self.findChildren(Choice):
            set_policy(choice, "Ignored", "Fixed")
        self.form.addRow(self.walls.title, self.walls)

    def _connect(self) -> None:
        self.kind.chosen.connect(self._kind_chosen)
        own = {"about": self._about_chosen, "change": self.drawn.change_kind}
        signals: dict[type[QWidget], str] = {Choice: "chosen", TextField: "textEdited"}
        for name in ("marker", *ROWS):
            field = getattr(self, name)
            signal = getattr(field, signals.get(type(field), "changed"))
            signal.connect(own.get(name, lambda _: self._emit_changed()))
        self.degree.changed.connect(self._degree_typed)
        self.coordinates.chosen.connect(lambda system: self.box_changed.emit(None, system))
        self.drawn.changed.connect(self.changed)

    def show_motion(self, motion: Motion | None, targets: tuple[Target, ...], dim: int) -> None:
        """Show a motion, offering ``targets`` and ``dim`` components; None hides the editor."""
        self._motion = motion
        self._dim = dim
        self.setVisible(motion is not None)
        if motion is None:
            return
        self._targets = targets = tuple(dict.fromkeys((*targets, motion.marker)))
        # The item's data is an index: Qt would turn a tuple of names into a list.
        self.marker.offer({k: target_words(target) for k, target in enumerate(targets)})
        self.marker.show_value(targets.index(motion.marker))
        self.walls.show_for(named(motion.marker))
        for kind in KINDS:
            self.kind.set_item_enabled(kind, dim == 3 or not kind.only_3d)
        self.kind.setCurrentText(motion.kind_term.label)
        for name in motion.rows:
            row = ROWS[name]
            self._show_value(name, row.shown(getattr(motion, row.attribute)))
        self.table.setVisible(motion.has_table)
        self.path.setToolTip(motion.kind_term.tip)
        shown = {*motion.rows}
        if "raised" in shown:
            title, way = motion.height_row
            self._titles["raised"].setText(title)
            self.raised.set_tip(f"How far it moves {way}, in the mesh's length unit.")
        if motion.stays_at:
            shown |= {"about"} | self._show_place(motion, dim)
        for shared in (self.drawn, self.walls):
            self.form.setRowVisible(shared, "curve" in shown)
        box = getattr(motion, ROWS["box"].attribute, "")
        lacks = "box" in shown and self.system == "CARTESIAN" and box not in self.boxes
        self.form.setRowVisible(self.new_box, lacks)
        mine = "box" in shown and box in self.degrees
        self.form.setRowVisible(self.degree, mine)
        self.degree.set_count(dim)
        self.degree.show_value(self.degrees.get(box, (1, 1, 1)))
        self.coordinates.show_value(self.system)
        self.coordinates.setVisible(mine and dim == 3)
        self.new_box.setText(f"New box around {target_words(motion.marker)}")
        if "index" in shown:
            self.index.set_count(len(getattr(motion, ROWS["index"].attribute)) - (3 - dim))
        for name, row in ROWS.items():
            self.form.setRowVisible(self._rows[name], name in shown)
            if row.per_axis:
                getattr(self, name).set_count(dim)

    def _show_value(self, name: str, value: Any) -> None:
        """Show a value in the field of a row."""
        if name == "box":
            self.box.offer({name: name or "(no box)" for name in (*self.boxes, value)})
            self.box.show_value(value)
        elif name == "curve":
            self.drawn.show_motion(self._motion)
            self.curve.show_value(curve_text(self._motion))
        elif name != "path":
            getattr(self, name).show_value(value)
        elif str(value) != self.path.text() and not self.path.hasFocus():
            self.path.setText("" if value == Path() else str(value))

    def _show_place(self, motion: Motion, dim: int) -> set[str]:
        """Fill the fields for a motion's fixed point and axis; return the names of their rows."""
        offered = list(motion.stays_at)
        axis: tuple[float, float, float] | None = getattr(motion, "axis", None)
        if self.machine is not None and axis is not None:
            offered.insert(-1, "axis")
        if self._radial(motion) is not None:
            offered.insert(-1, "radial")
        self.about.offer({what: self._about_words(what) for what in offered})
        centroids = (what for what in offered if what in ("centroid", "radial"))
        self.about.set_tips(dict.fromkeys(centroids, MEAN))
        point = getattr(motion, ROWS["point"].attribute)
        what = {"centroid": "centroid", None: "line"}.get(point, "point")
        if "axis" in offered and self._is_machine(motion) and not self._as_point:
            what = "axis"
        elif "radial" in offered and what == "centroid" and axis == self._radial(motion):
            what = "radial"
        self.about.show_value(what)
        if what == "point":
            self.point.show_value(point)
        if axis is not None:
            self.axis.show_value(axis)
        turns = axis is not None and dim == 3 and what not in ("axis", "radial")
        return ({"point"} if what == "point" else set()) | ({"axis"} if turns else set())

    def _radial(self, motion: Motion) -> tuple[float, float, float] | None:
        """Return the radial direction through the centroid of a rotation's target.

        None if the motion is not a rotation, or the mesh is 2D or does not repeat about an axis.
        """
        turns = "centroid" in motion.stays_at and hasattr(motion, "axis")
        if self.machine is None or self._dim == 2 or not turns:
            return None
        return radial(self.machine, self.centroid_of(motion.marker))

    def _about_words(self, what: str) -> str:
        if what in ("centroid", "radial", "line") and len(named(self._motion.marker)) != 1:
            return ABOUT[what].replace("its", "their")
        if what != "axis" or self._dim == 2 or self.machine is None:
            return ABOUT[what]
        axis, _ = self.machine
        return f"{ABOUT[what]} ({direction_words(axis)})"

    def _is_machine(self, motion: Motion) -> bool:
        if self.machine is None:
            return False
        axis, origin = self.machine
        about = getattr(motion, "axis", None), getattr(motion, "point", None)
        return about == (axis, origin[: self._dim])

    def _kind_chosen(self, kind: type[Motion]) -> None:
        if self._motion is not None and self._motion.kind_term != kind.kind_term:
            marker = self._motion.marker
            chord = self.chord_of(marker)
            start = MotionStart(self._dim, self.machine, self.boxes, chord)
            self.changed.emit(kind.new(marker, start))

    def _about_chosen(self, what: str) -> None:
        """Set the fixed point and axis to a choice, a key of `ABOUT`, and emit the motion."""
        motion = self._motion
        assert motion is not None
        across = self._radial(motion)
        radially = across is not None and getattr(motion, "axis", None) == across
        self._as_point = what == "point"
        if what == "point" and getattr(motion, "point", None) in ("centroid", None):
            self.point.show_value(self.centroid_of(motion.marker))
        elif what == "axis" and self.machine is not None:
            axis, origin = self.machine
            self.axis.show_value(axis)
            self.point.show_value(origin)
        elif what == "radial" and across is not None:
            self.axis.show_value(across)
        elif what == "centroid" and radially and self.machine is not None:
            self.axis.show_value(self.machine[0])
        self._emit_changed()
        # The motion may be the same, but other fields belong to this choice.
        self.show_motion(self._motion, self._targets, self._dim)

    def show_another(self) -> None:
        """Reset what is not of the motion before another is shown: “a point”, invalid texts."""
        self._as_point = False
        for field in self._rows.values():
            if isinstance(field, NumberField | VectorField | CheckedText):
                field.restore()

    def focus(self) -> None:
        """Put the cursor into the first number field of the shown motion, and select its text."""
        if self._motion is None:
            return
        field = getattr(self, self._motion.rows[0])
        first = field.fields[0] if isinstance(field, VectorField) else field
        first.setFocus()
        first.selectAll()

    def set_extent(self, extent: float) -> None:
        """Set the size of the mesh; coordinates that are rounding errors beside it show as 0."""
        self.point.set_scale(extent)
        for name, row in ROWS.items():
            if row.is_length:
                field = getattr(self, name)
                for each in getattr(field, "fields", [field]):
                    each.extent = extent
        self.drawn.set_extent(extent)

    def _emit_changed(self) -> None:
        """Emit the motion that the fields describe, if it differs from the shown one."""
        motion = self._motion
        assert motion is not None
        values = {ROWS[name].attribute: self._typed(name) for name in motion.rows}
        if "curve" in motion.rows:
            values["spans"], values["values"] = read_curve(self.curve.value)
        if motion.stays_at:
            fixed = {"centroid": "centroid", "radial": "centroid", "line": None}
            values["point"] = fixed.get(self.about.currentData(), self.point.value)
            if hasattr(motion, "axis"):
                values["axis"] = self._typed("axis") if self._dim == 3 else AXES["z"]
        edited = replace(motion, marker=self._targets[self.marker.currentData()], **values)
        if edited != motion:
            self.changed.emit(edited)

    def _typed(self, name: str) -> Any:
        """Return the value in a row; while its numbers contradict, that of the shown motion."""
        field = getattr(self, name)
        row = ROWS[name]
        if isinstance(field, Choice):
            return field.currentData()
        if name == "path":
            return Path(field.text().strip())
        before = getattr(self._motion, row.attribute)
        if isinstance(field, CheckedText):
            return before
        if isinstance(field, VectorField) and field.problem:
            return before
        value = row.read(field.value)
        # In 2D, indices and vectors of a box keep what is not shown of them.
        boxed = hasattr(self._motion, "box") and isinstance(value, tuple)
        return (*value, *before[len(value) :]) if boxed else value

    def _degree_typed(self, values: Numbers) -> None:
        before = self.degrees[self._motion.box]
        i, j, k = (*map(int, values), *before[len(values) :])
        self.box_changed.emit((i, j, k), None)

    def _browse(self) -> None:
        title = self._motion.file_words.capitalize()
        name, _ = QFileDialog.getOpenFileName(self, title, self.path.text())
        if name:
            self.path.setText(name)
            self._emit_changed()
