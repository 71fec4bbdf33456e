"""The method panel: sliding, periodicity, steps, data reduction, and more."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, cast

from qtpy.QtCore import Qt, QTimer, Signal
from qtpy.QtWidgets import QCheckBox, QComboBox, QFormLayout, QLabel, QWidget

from slideviz.case.keys import (
    BY_WEIGHT,
    KEYS,
    Form,
    Key,
    get_reduction,
    no_pair,
    nothing_slides,
    put_reduction,
)
from slideviz.case.model import Case
from slideviz.case.values import Entry, Kind
from slideviz.gui.widgets.build import (
    Choice,
    PanelScroll,
    as_widget,
    grow_fields,
    hint_label,
    in_column,
    in_row,
    set_style,
    tool_button,
    wrapped,
)
from slideviz.gui.widgets.fields import (
    NumberBox,
    NumberField,
    VectorField,
    a_direction,
    number_text,
)
from slideviz.gui.widgets.panel import FieldWatch, Panel
from slideviz.rbf.reduction import AUTO, Reduction
from slideviz.session import changes
from slideviz.session.motions import (
    largest_prescribed,
    machine_pair,
    pair_text,
    support_key,
    support_of,
)
from slideviz.session.opening import suggested_reduction
from slideviz.session.run_messages import Requirement, tolerance_warning, with_field_labels
from slideviz.session.state import Session
from slideviz.terms import LEVEL_CRITERIA, DataReduction, labels


def number_field(kind: Kind) -> NumberField:
    """Return a number field that accepts only numbers valid for a kind of value."""

    def problem(value: float) -> str:
        return "" if value in kind.words else kind.problem(number_text(value))

    return NumberField(0.0, problem, words=kind.words)


def _number_box(kind: Kind) -> NumberBox:
    field = NumberBox()
    field.setRange(*kind.span)
    field.setSpecialValueText(kind.words.get(kind.span[0], ""))
    field.setMinimumHeight(QComboBox().sizeHint().height())
    return field


class Switch(QCheckBox):
    """A check box for a setting, with the methods that a `KeyForm` needs."""

    def show_value(self, on: bool) -> None:
        """Show whether the setting is on."""
        self.setChecked(on)


Field = Choice | Switch | NumberField | NumberBox | VectorField

FIELDS: dict[Entry, tuple[Callable[[Kind], Field], str]] = {
    "choice": (lambda kind: Choice(kind.words, tips=kind.tips), "chosen"),
    "switch": (lambda _: Switch(), "clicked"),
    "real": (number_field, "changed"),
    "whole": (_number_box, "valueChanged"),
    "axis": (lambda _: VectorField((0.0, 0.0, 1.0), a_direction), "changed"),
    "point": (lambda _: VectorField(), "changed"),
}
"""For each entry of a kind of value: the function that makes its field, and the name of the
field's signal that carries a new value."""


class KeyForm(QFormLayout):
    """A form with the settings of a case whose keys have the form ``place``: main or more.

    ``own``: fields that the caller makes, connects and fills, by the name of their key.
    """

    changed = Signal(object, object)  # the `Key` whose value changed, and the new value

    def __init__(self, place: Form, own: Mapping[str, Field] | None = None) -> None:
        super().__init__()
        grow_fields(self)
        self.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        self.fields: dict[str, Field] = {}
        self._rows: list[tuple[Key, Field]] = []
        self._own = own or {}
        for key in BY_WEIGHT:
            if key.form == place:
                self._add(key)

    def _add(self, key: Key) -> None:
        field = self._own.get(key.name)
        if field is None:
            make, signal = FIELDS[key.kind.entry]
            field = make(key.kind)
            field.setObjectName(key.field)
            getattr(field, signal).connect(lambda value: self.changed.emit(key, value))
        label = QLabel(key.title)
        label.setToolTip(wrapped(key.tip or key.meaning))
        self.fields[field.objectName()] = field
        self._rows.append((key, field))
        self.addRow(label, field)

    @property
    def words(self) -> str:
        """Return the labels of the form's settings, as a sentence."""
        return ", ".join(key.label.rstrip(" ×") for key, _ in self._rows).capitalize() + "."

    def sync(self, case: Case, spare: Case, reasons: Mapping[str, str]) -> None:
        """Fill the fields from ``case``, or from ``spare`` where a setting of ``case`` is None.

        ``reasons`` says, by the name of a field, why it is not available, in addition to what the
        key itself says.
        """
        for key, field in self._rows:
            if key.name not in self._own:
                value = key.get(case)
                field.show_value(key.get(spare) if value is None else value)
            why_not = key.idle(case) or reasons.get(key.field, "")
            field.setEnabled(not why_not)
            why_not = with_field_labels(f"Not available: {why_not}.") if why_not else ""
            _set_tip(field, why_not or key.tip or key.meaning)


def _set_tip(field: Field, text: str) -> None:
    if hasattr(field, "set_tip"):
        field.set_tip(text)
    # The tooltip of a number may show why its text is invalid.
    if not isinstance(field, NumberField | NumberBox):
        field.setToolTip(wrapped(text))


LEVEL_ENDS = {"size": KEYS["LVL_SIZE"], "tol": KEYS["LVL_TOL_CRIT"]}
"""The key that says at what size or tolerance a level ends, by the level criterion."""


class MoreSettings(QWidget):
    """The button “More settings”, and the form that it opens and closes."""

    changed = Signal(object, object)  # as that of `KeyForm`

    def __init__(self) -> None:
        super().__init__()
        self._criterion = Reduction().criterion
        self.levels = Choice({"none": "none", **labels(LEVEL_CRITERIA)}, name="levels")
        self.levels.chosen.connect(self._levels_chosen)
        self.level_end = NumberField(16, lambda value: self._level.kind.problem(number_text(value)))
        self.level_end.setObjectName("level_end")
        self.level_end.changed.connect(self._level_end_changed)
        self.form = KeyForm("more", {"MULTILEVEL": self.levels, "LVL_SIZE": self.level_end})
        self.form.changed.connect(self.changed)
        self.radius = hint_label()
        row, _ = _position(self.form, self.form.fields["influence_factor"])
        self.form.insertRow(row + 1, "", self.radius)
        self.button = tool_button(self.form.words, text="More settings", name="more")
        self.button.setCheckable(True)
        self.button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.button.toggled.connect(self._show_form)
        self.body = as_widget(self.form)
        in_column(self.button, self.body, spacing=4, on=self)
        self._show_form(False)

    @property
    def _level(self) -> Key:
        return LEVEL_ENDS[self._criterion]

    def _levels_chosen(self, value: str) -> None:
        self.changed.emit(KEYS["MULTILEVEL"], value != "none")
        if value != "none":
            self.changed.emit(KEYS["MULTI_CRIT"], value)

    def _level_end_changed(self, value: float) -> None:
        self.changed.emit(self._level, self._level.kind.read(number_text(value)))

    def _show_form(self, shown: bool) -> None:
        self.button.setArrowType(Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow)
        self.body.setVisible(shown)

    def sync(self, case: Case, spare: Case) -> None:
        """Fill the form from ``case``, or from ``spare`` where ``case`` has no data reduction."""
        reduction = case.reduction or spare.reduction
        self._criterion = reduction.criterion
        self.levels.show_value(reduction.criterion if reduction.multilevel else "none")
        self.level_end.show_value(self._level.get(case.change(reduction=reduction)))
        self.form.sync(case, spare, {})


class MethodPanel(Panel):
    """The panel of the case's settings: a field for each key that is shown there.

    Each field is also an attribute, by the name of its setting in the case: ``panel.sliding``.
    """

    def make(self) -> None:
        self._extent = 0.0
        self._reduction: Reduction | None = None
        self.area = PanelScroll(QWidget())
        in_column(self.area, on=self)
        self.form = KeyForm("main")
        self.more = MoreSettings()
        for part in (self, self.more):
            for name, field in part.form.fields.items():
                setattr(part, name, field)
        self.period_hint = hint_label()
        self.tolerance_hint = hint_label()
        self.idle_reasons = hint_label()
        self.tolerance_warning = hint_label()
        set_style(self.tolerance_warning, "bad", True)
        self.tolerance_hint.setWordWrap(False)
        # The largest prescribed displacement, and the mesh, roles and motions that it is of.
        self._largest: tuple[tuple[object, ...], float] = ((), 0.0)
        self._support: tuple[tuple[object, ...], float] = ((), 0.0)
        form = self.form
        fields = self.form.fields
        row, _ = _position(form, fields["origin"])
        form.insertRow(row + 1, "", self.period_hint)
        row, role = _position(form, fields["tolerance"])
        form.removeWidget(fields["tolerance"])
        wide = fields["tolerance"]
        self._tolerance_row = as_widget(in_row(wide, self.tolerance_hint, wide=[wide]))
        form.setWidget(row, role, self._tolerance_row)
        form.insertRow(row + 1, "", self.tolerance_warning)
        parts = (self.form, self.idle_reasons, self.more, None)
        in_column(*parts, on=self.area.widget(), margins=(6, 6, 6, 4))
        self.form.changed.connect(self._set)
        self.more.changed.connect(self._set)
        self.more.button.toggled.connect(
            # In the next turn of the event loop the form is laid out.
            lambda on: on and QTimer.singleShot(0, self, self._show_more)
        )
        self.watch = FieldWatch(self, self.store, "method")
        self.follow(lambda session: session.mesh, self._set_mesh)
        self.follow()

    def _show_more(self) -> None:
        self.area.widget().adjustSize()
        bar = self.area.verticalScrollBar()
        bar.setValue(min(self.more.y(), bar.maximum()))

    def focus_requirement(self, _missing: Requirement) -> None:
        if not self.watch.focus():
            self.form.fields["sliding"].setFocus()

    # Widgets to state ------------------------------------------------------------------
    def _set(self, key: Key, value: object) -> None:
        """Change the case by the new value of a key; data reduction is handled by this panel."""
        special: dict[str, Callable[[Case, Any], Case]] = {
            "DATA_REDUCTION": self._reduce,
            "DATA_RED_TOLERANCE": self._put_tolerance,
        }
        case = self.session.case
        new = special.get(key.name, key.put)(case, value)
        values = {field.name: getattr(new, field.name) for field in fields(Case)}
        changed = {name: now for name, now in values.items() if now != getattr(case, name)}
        if changed:
            self.change(changes.set_case, **changed)

    def _reduce(self, case: Case, wanted: DataReduction) -> Case:
        # The settings from before it was switched off come back; else those for this mesh.
        mesh = self.session.mesh
        first = self._reduction or AUTO
        if wanted == "YES" and first == AUTO and mesh is not None:
            first = suggested_reduction(mesh)
        return put_reduction(case.change(reduction=first), wanted)

    def _put_tolerance(self, case: Case, value: float) -> Case:
        reduction = case.reduction or Reduction()
        return case.change(reduction=replace(reduction, tolerance=value, relative=None))

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        """Fill the panel from the session's case."""
        self._reduction = session.case.reduction or self._reduction
        case = session.case
        given = self._reduction or Reduction()
        # The tolerance as a length, to six significant digits.
        absolute = given.relative * self._extent if given.relative else given.tolerance
        reduction = replace(given, tolerance=float(f"{absolute:.6g}"), auto=False)
        spare = Case(reduction=reduction)
        if case.reduction is not None:
            case = case.change(reduction=replace(reduction, auto=case.reduction.auto))
        fields = self.form.fields
        fields["origin"].set_scale(self._extent)
        turned = case.periodic_type != "translational" and machine_pair(session)
        rotational = turned or case.periodic_type == "rotational"
        no_axis = "" if rotational else "only rotational periodicity has an axis"
        self.form.sync(case, spare, {"axis": no_axis, "origin": no_axis})
        self.more.sync(case, spare)
        for name in ("axis", "origin"):
            self.form.setRowVisible(fields[name], not (no_pair(case) or no_axis))
        self._sync_hints(session)

    def _set_mesh(self, session: Session) -> None:
        self._reduction = None
        self._largest = ((), 0.0)
        self.watch.restore()
        # Once for each mesh: it takes 10 ms where there are 250,000 cells.
        self._extent = session.mesh.extent if session.mesh is not None else 0.0

    def _sync_hints(self, session: Session) -> None:
        case = session.case
        extent = self._extent
        tolerance = self.form.fields["tolerance"]
        assert isinstance(tolerance, NumberField)
        part = f"{tolerance.value / extent:.3g} of the extent" if extent else ""
        self.tolerance_hint.setText(part)
        typed = get_reduction(case) == "YES"
        self.form.setRowVisible(self._tolerance_row, typed)
        largest = self._largest_of(session) if typed else 0.0
        self.tolerance_warning.setText(tolerance_warning(case, extent, largest))
        self.form.setRowVisible(self.tolerance_warning, bool(self.tolerance_warning.text()))
        self.more.radius.setText(self._radius_words(session))
        self.more.form.setRowVisible(self.more.radius, bool(self.more.radius.text()))
        reasons = (("Sliding", nothing_slides(case)), ("Periodicity", no_pair(case)))
        why = "\n".join(f"{title}: {why}." for title, why in reasons if why)
        self.idle_reasons.setText(why if session.mesh is not None else "Open a mesh first.")
        self.idle_reasons.setVisible(bool(self.idle_reasons.text()))
        self.period_hint.setText(pair_text(session))
        self.form.setRowVisible(self.period_hint, bool(self.period_hint.text()))

    def _radius_words(self, session: Session) -> str:
        """Return the support radius in words; "" where there is none."""
        case = session.case
        mesh = session.mesh
        if mesh is None:
            return ""
        key = support_key(case, mesh)
        if key != self._support[0]:
            self._support = key, support_of(case, mesh)[0]
        radius = self._support[1]
        origin = "" if case.support_radius is None else ", a length of the case file"
        return f"a radius of {radius:.4g}{origin}" if radius else ""

    def _largest_of(self, session: Session) -> float:
        """Return the largest prescribed displacement, computed once for each set of motions."""
        mesh = session.mesh
        key = (mesh, session.case.roles, session.case.motions)
        if key != self._largest[0]:
            largest = 0.0 if mesh is None else largest_prescribed(session.case, mesh)
            self._largest = key, largest
        return self._largest[1]


def _position(form: QFormLayout, field: QWidget) -> tuple[int, QFormLayout.ItemRole]:
    return cast("tuple[int, QFormLayout.ItemRole]", form.getWidgetPosition(field))
