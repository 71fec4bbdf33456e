"""Labels, tooltips and lists with plain text: wrapped, or cut with an ellipsis."""

from __future__ import annotations

import html
from typing import TypeAlias

from qtpy.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt
from qtpy.QtGui import (
    QFocusEvent,
    QFont,
    QFontDatabase,
    QFontMetrics,
    QPainter,
    QPaintEvent,
    QResizeEvent,
)
from qtpy.QtWidgets import (
    QAbstractItemView,
    QFrame,
    QLabel,
    QScrollArea,
    QSizePolicy,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QToolTip,
    QWidget,
)


def rich_label(text: str) -> QLabel:
    """Return a label for rich text; names in it must be escaped."""
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.RichText)
    return label


class LinkLabel(QLabel):
    """A word-wrapped label for rich text, whose links are reached by the tab key too."""

    def __init__(self) -> None:
        super().__init__()
        self.setWordWrap(True)
        self.setTextFormat(Qt.TextFormat.RichText)

    def setText(self, text: str) -> None:
        super().setText(text)
        keyboard = Qt.TextInteractionFlag.LinksAccessibleByKeyboard
        flags = Qt.TextInteractionFlag.LinksAccessibleByMouse
        # Without a link, the tab key passes over the label.
        self.setTextInteractionFlags(flags | keyboard if "<a " in text else flags)

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        # Qt would give the focus to the label first, and to a link by the next Tab.
        if event.reason() in (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason):
            self.focusNextPrevChild(event.reason() == Qt.FocusReason.TabFocusReason)


def fixed_font() -> QFont:
    """Return the system's monospaced font."""
    return QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)


def plain_labels(widget: QWidget) -> None:
    """Set the labels in a widget to plain text, except those made for rich text.

    By default Qt guesses: a boundary named ``<img src=...>`` would be shown as a picture.
    """
    for label in widget.findChildren(QLabel):
        if label.textFormat() == Qt.TextFormat.AutoText:
            label.setTextFormat(Qt.TextFormat.PlainText)


LETTERS = 60  # average number of letters in a line of a tooltip


def wrapped(text: str) -> str:
    """Return a tooltip's text, wrapped at about `LETTERS` letters by means of rich text.

    A text of short lines is returned as it is. Markup in the text, which may be the name of a
    boundary or file, is escaped.
    """
    short = all(len(line) <= LETTERS + 10 for line in text.splitlines())
    if short and not Qt.mightBeRichText(text):  # type: ignore[attr-defined]  # not in PySide's stubs
        return text
    width = round(1.05 * LETTERS * QFontMetrics(QToolTip.font()).averageCharWidth())
    lines = html.escape(text, quote=False).replace("\n", "<br>")
    return f"<table width='{width}'><tr><td>{lines}</td></tr></table>"


ModelIndex: TypeAlias = QModelIndex | QPersistentModelIndex
"""An index into an item model, as Qt passes it to a delegate."""


class ElidedLabel(QLabel):
    """A label whose text is cut with an ellipsis where it is too long; its width is free.

    ``mode``: where the ellipsis is.
    """

    def __init__(
        self, text: str = "", mode: Qt.TextElideMode = Qt.TextElideMode.ElideRight
    ) -> None:
        super().__init__(text)
        self._mode = mode
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        # A long text must not make its container wider.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    @property
    def shown(self) -> str:
        """Return the text as painted: cut with an ellipsis if it is too long."""
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


class WideLabel(QScrollArea):
    """A word-wrapped label as wide as its container, which scrolls a text of too many lines.

    ``lines``: most lines that are visible at once.
    """

    def __init__(self, lines: int) -> None:
        super().__init__()
        self.label = QLabel()
        self.label.setTextFormat(Qt.TextFormat.PlainText)
        self.label.setWordWrap(True)
        self.label.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._most = lines * self.label.fontMetrics().lineSpacing() + 2
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setWidgetResizable(True)
        self.setWidget(self.label)

    def show_text(self, text: str) -> None:
        """Show a text from its beginning; hide the label if it is empty."""
        self.label.setText(text)
        self.setVisible(bool(text))
        self.verticalScrollBar().setValue(0)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        high = self.label.heightForWidth(self.viewport().width())
        self.setFixedHeight(max(min(high, self._most), 0))


class _Narrow(QStyledItemDelegate):
    """A delegate whose size hint has no width, so that items are as wide as the list."""

    def sizeHint(self, option: QStyleOptionViewItem, index: ModelIndex) -> QSize:
        return QSize(0, super().sizeHint(option, index).height())


def elide_items(items: QAbstractItemView) -> None:
    """Make the items of a list end with an ellipsis instead of scrolling sideways."""
    items.setItemDelegate(_Narrow(items))
    items.setTextElideMode(Qt.TextElideMode.ElideRight)
    items.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
