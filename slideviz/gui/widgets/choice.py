"""A drop-down list of values, each shown by a text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QPaintEvent, QStandardItemModel, QWheelEvent
from qtpy.QtWidgets import QComboBox, QStyle, QStyleOptionComboBox, QStylePainter

from slideviz.gui.widgets.labels import wrapped

Value = TypeVar("Value")
MARGIN = 4  # space that the style leaves beside the text, in pixels


class Choice(QComboBox):
    """A drop-down list of values, each shown by a text; the wheel does not change the value."""

    chosen = Signal(object)
    """The value that the user has chosen; not emitted by `show_value`."""

    def __init__(self, words: Mapping[Value, str], tip: str = "", name: str = "") -> None:
        super().__init__()
        self.setToolTip(wrapped(tip))
        self.setObjectName(name)
        self.offer(words)
        self.setMinimumContentsLength(8)
        self.activated.connect(lambda _: self.chosen.emit(self.currentData()))

    def offer(self, words: Mapping[Value, str]) -> None:
        """Offer other values, each shown by a text; none is chosen anew where they are the same."""
        rows = range(self.count())
        if [(self.itemData(row), self.itemText(row)) for row in rows] != list(words.items()):
            self.clear()
            for value, text in words.items():
                self.addItem(text, value)

    def show_value(self, value: object) -> None:
        """Select the entry of a value, if there is one; `chosen` is not emitted."""
        index = self.findData(value)
        if index >= 0 and index != self.currentIndex():
            self.setCurrentIndex(index)

    def set_item_enabled(self, value: object, offered: bool) -> None:
        """Let the entry of a value be chosen, or not."""
        model = self.model()
        assert isinstance(model, QStandardItemModel)
        model.item(self.findData(value)).setEnabled(offered)

    def set_tips(self, tips: Mapping[str, str]) -> None:
        """Set the tooltips of entries, by their values."""
        for value, tip in tips.items():
            self.setItemData(self.findData(value), wrapped(tip), Qt.ItemDataRole.ToolTipRole)

    def showPopup(self) -> None:
        # Make the list as wide as its longest text: the closed box may be narrower.
        frame = self.style().pixelMetric(QStyle.PixelMetric.PM_ScrollBarExtent) + 2 * MARGIN
        self.view().setMinimumWidth(self.view().sizeHintForColumn(0) + frame)
        # After Escape, Qt would open the list at the entry that was under the mouse.
        self.view().setCurrentIndex(self.model().index(self.currentIndex(), self.modelColumn()))
        super().showPopup()

    @property
    def shown(self) -> str:
        """Return the text as painted: cut with an ellipsis if it is too long."""
        return self._option().currentText

    def _option(self) -> QStyleOptionComboBox:
        """Return the style option to paint, its text cut with an ellipsis if it is too long."""
        option = QStyleOptionComboBox()
        self.initStyleOption(option)
        part = QStyle.SubControl.SC_ComboBoxEditField
        kind = QStyle.ComplexControl.CC_ComboBox
        room = self.style().subControlRect(kind, option, part, self).width() - MARGIN
        option.currentText = option.currentText or self.placeholderText()
        if not option.currentIcon.isNull():
            room -= option.iconSize.width() + MARGIN
        elided = Qt.TextElideMode.ElideRight
        option.currentText = self.fontMetrics().elidedText(option.currentText, elided, room)
        return option

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QStylePainter(self)
        option = self._option()
        painter.drawComplexControl(QStyle.ComplexControl.CC_ComboBox, option)
        painter.drawControl(QStyle.ControlElement.CE_ComboBoxLabel, option)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()
