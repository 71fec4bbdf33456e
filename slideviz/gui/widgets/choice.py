"""A drop-down of values with words."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QWheelEvent
from qtpy.QtWidgets import QComboBox

from slideviz.gui.widgets.tips import wrapped

Value = TypeVar("Value")


class Choice(QComboBox):
    """A drop-down of values with words; the wheel scrolls the panel instead of changing it.

    Signals
    -------
    chosen(object)
        The value that the user has chosen.
    """

    chosen = Signal(object)

    def __init__(self, words: Mapping[Value, str], tip: str = "", name: str = "") -> None:
        super().__init__()
        self.setToolTip(wrapped(tip))
        self.setObjectName(name)
        for value, text in words.items():
            self.addItem(text, value)
        self.setMinimumContentsLength(8)
        self.activated.connect(lambda _: self.chosen.emit(self.currentData()))

    def show_value(self, value: object) -> None:
        """Show a value; `chosen` is not emitted."""
        index = self.findData(value)
        if index >= 0 and index != self.currentIndex():
            self.setCurrentIndex(index)

    def explain(self, tips: Mapping[str, str]) -> None:
        """Give entries tooltips, by their values."""
        for value, tip in tips.items():
            self.setItemData(self.findData(value), wrapped(tip), Qt.ItemDataRole.ToolTipRole)

    def showPopup(self) -> None:
        # Escape leaves the list at the entry below the mouse; it would open there next time.
        self.view().setCurrentIndex(self.model().index(self.currentIndex(), self.modelColumn()))
        super().showPopup()

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()
