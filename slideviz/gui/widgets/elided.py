"""Labels and lists whose words end with an ellipsis where there is no room for all of them."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from typing import TypeAlias

from qtpy.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt
from qtpy.QtGui import QPainter, QPaintEvent
from qtpy.QtWidgets import (
    QAbstractItemView,
    QLabel,
    QSizePolicy,
    QStyledItemDelegate,
    QStyleOptionViewItem,
)

ModelIndex: TypeAlias = QModelIndex | QPersistentModelIndex
"""A place in a list, as Qt hands it to who draws it."""


class ElidedLabel(QLabel):
    """A label of any width, whose text ends with an ellipsis where there is no room for all of it.

    Parameters
    ----------
    text : str
    mode : Qt.TextElideMode
        Where the ellipsis stands.
    """

    def __init__(
        self, text: str = "", mode: Qt.TextElideMode = Qt.TextElideMode.ElideRight
    ) -> None:
        super().__init__(text)
        self._mode = mode
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        # A long text may not make what it stands in wider.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    @property
    def shown(self) -> str:
        """Return the text for which there is room."""
        room = self.contentsRect().width()
        return self.fontMetrics().elidedText(self.text(), self._mode, room)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        self.style().drawItemText(
            painter,
            self.contentsRect(),
            self.alignment().value,
            self.palette(),
            self.isEnabled(),
            self.shown,
            self.foregroundRole(),
        )


class _Narrow(QStyledItemDelegate):
    """Asks for no width, so that the text of an item ends where the list does."""

    def sizeHint(self, option: QStyleOptionViewItem, index: ModelIndex) -> QSize:
        return QSize(0, super().sizeHint(option, index).height())


def elide_items(items: QAbstractItemView) -> None:
    """Let the items of a list end with an ellipsis, instead of scrolling sideways."""
    items.setItemDelegate(_Narrow(items))
    items.setTextElideMode(Qt.TextElideMode.ElideRight)
    items.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
