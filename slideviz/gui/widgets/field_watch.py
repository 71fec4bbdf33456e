"""Invalid fields of a panel are noted in the session, so that no run starts meanwhile."""

from __future__ import annotations

from qtpy.QtCore import QObject
from qtpy.QtWidgets import QFormLayout, QLabel, QWidget

from slideviz.gui.widgets.fields import NumberBox, NumberField
from slideviz.session import changes
from slideviz.session.state import PanelPlace
from slideviz.session.store import Store


class FieldWatch(QObject):
    """The invalid fields of a panel, kept up to date in ``Session.invalid``."""

    def __init__(self, panel: QWidget, store: Store, place: PanelPlace) -> None:
        super().__init__(panel)
        self.panel, self.store, self.place = panel, store, place
        self._fields: list[NumberField | NumberBox] = [
            *panel.findChildren(NumberField),
            *panel.findChildren(NumberBox),
        ]
        for field in self._fields:
            field.marked.connect(self.look)
        # Another motion or method may hide a field or switch it off.
        store.listen(lambda *_: self.look())

    def look(self) -> None:
        """Note the invalid fields in the session."""
        faults = tuple(
            f"{_title(field, self.panel)}: {field.fault}."
            for field in self._fields
            if field.fault and field.isEnabledTo(self.panel) and field.isVisibleTo(self.panel)
        )
        self.store.change(changes.set_invalid, self.place, tuple(dict.fromkeys(faults)))

    def focus(self) -> bool:
        """Put the cursor into the first invalid field; return whether there is one."""
        field = next((field for field in self._fields if field.fault), None)
        if field is not None:
            field.setFocus()
            field.selectAll()
        return field is not None


def _title(field: QWidget, panel: QWidget) -> str:
    """Return what a form calls a field, or the row that it is in, with its own name there."""
    # Numbers that are not valid together are the row's fault.
    own = field.accessibleName() if getattr(field, "problem", "") else ""
    part: QWidget | None = field
    while part is not None and part is not panel:
        for form in panel.findChildren(QFormLayout):
            label = form.labelForField(part)
            if isinstance(label, QLabel):
                return f"{label.text()} {own}".rstrip()
        part = part.parentWidget()
    return field.accessibleName() or field.objectName()
