"""Forms made from the table of case file keys: a row for each key that belongs to the form."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QComboBox, QFormLayout, QLabel

from slideviz.case.key import Form, Key
from slideviz.case.keys import BY_WEIGHT
from slideviz.case.model import Case
from slideviz.case.values import Entry, Kind
from slideviz.gui.widgets.build import grow_fields
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import NumberBox, NumberField, Switch, number_text
from slideviz.gui.widgets.labels import wrapped
from slideviz.gui.widgets.vector_field import VectorField, a_direction


def number_field(kind: Kind) -> NumberField:
    """Return a number field that accepts only numbers valid for a kind of value."""

    def problem(value: float) -> str:
        return "" if value in kind.words else kind.problem(number_text(value))

    return NumberField(0.0, problem, words=kind.words)


def _choice(kind: Kind) -> Choice:
    field = Choice(kind.words)
    field.explain(kind.tips)
    return field


def _number_box(kind: Kind) -> NumberBox:
    field = NumberBox()
    field.setRange(*kind.span)
    field.setSpecialValueText(kind.words.get(kind.span[0], ""))
    field.setMinimumHeight(QComboBox().sizeHint().height())
    return field


Field = Choice | Switch | NumberField | NumberBox | VectorField

FIELDS: dict[Entry, tuple[Callable[[Kind], Field], str]] = {
    "choice": (_choice, "chosen"),
    "switch": (lambda _: Switch(), "clicked"),
    "real": (number_field, "changed"),
    "whole": (_number_box, "valueChanged"),
    "axis": (lambda _: VectorField((0.0, 0.0, 1.0), a_direction), "changed"),
    "point": (lambda _: VectorField(), "changed"),
}
"""For each entry of a kind of value: the function that makes its field, and the name of the
field's signal that carries a new value."""


class KeyForm(QFormLayout):
    """A form with the settings of a case.

    Parameters
    ----------
    place : "main" or "more"
        The form whose keys are shown: that of the method panel, or “More settings” there.
    own : mapping
        Fields that the caller makes, connects and fills, by the name of their key.

    Signals
    -------
    changed(object, object)
        The `Key` whose value changed, and the new value.
    """

    changed = Signal(object, object)

    def __init__(self, place: Form, own: Mapping[str, Field] | None = None) -> None:
        super().__init__()
        grow_fields(self)
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
            tip = key.tip or key.meaning
            _set_tip(field, f"Not available: {why_not}." if why_not else tip)


def _set_tip(field: Field, text: str) -> None:
    """Set the tooltip of a field and of its parts."""
    if hasattr(field, "set_tip"):
        field.set_tip(text)
    # The tooltip of a number may show why its text is invalid.
    if not isinstance(field, NumberField | NumberBox):
        field.setToolTip(wrapped(text))
