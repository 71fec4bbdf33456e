"""Record the invalid fields of a panel in the session, which keeps a run from starting."""

from __future__ import annotations

from qtpy.QtCore import QObject
from qtpy.QtWidgets import QFormLayout, QLabel, QWidget

from slideviz.gui.widgets.fields import NumberBox, NumberField
from slideviz.session import changes
from slideviz.session.state import PanelPlace
from slideviz.session.store import Store


class FieldWatch(QObject):
    """Watches the number fields of a panel and writes the invalid ones to ``Session.invalid``."""

    def __init__(self, panel: QWidget, store: Store, place: PanelPlace) -> None:
        super().__init__(panel)
        self.panel, self.store, self.place = panel, store, place
        self._fields: list[NumberField | NumberBox] = [
            *panel.findChildren(NumberField),
            *panel.findChildren(NumberBox),
        ]
        for field in self._fields:
            field.marked.connect(self.look)
        # Another motion or method may hide or disable a field.
        store.listen(lambda *_: self.look())

    def look(self) -> None:
        """Write the faults of the visible, enabled fields to the session."""
        faults = tuple(
            f"{_title(field, self.panel)}: {field.fault}."
            for field in self._fields
            if field.fault and field.isEnabledTo(self.panel) and field.isVisibleTo(self.panel)
        )
        self.store.change(changes.set_invalid, self.place, tuple(dict.fromkeys(faults)))

    def restore(self) -> None:
        """Replace invalid texts by the values, as another mesh is shown."""
        for field in self._fields:
            field.restore()

    def focus(self) -> bool:
        """Put the cursor into the first invalid field; return whether there is one."""
        field = next((field for field in self._fields if field.fault), None)
        if field is not None:
            field.setFocus()
            field.selectAll()
        return field is not None


def _title(field: QWidget, panel: QWidget) -> str:
    """Return the name of a field: the label of its form's row, with its own name in the row.

    The own name is left out if the row's numbers are only invalid together.
    """
    own = field.accessibleName() if getattr(field, "problem", "") else ""
    part: QWidget | None = field
    while part is not None and part is not panel:
        for form in panel.findChildren(QFormLayout):
            label = form.labelForField(part)
            if isinstance(label, QLabel):
                return f"{label.text()} {own}".rstrip()
        part = part.parentWidget()
    return field.accessibleName() or field.objectName()
