"""Labels, tooltips and lists: text as it is written, in lines that can be read, or cut short."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import html
from typing import TypeAlias

from qtpy.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt
from qtpy.QtGui import QFont, QFontDatabase, QFontMetrics, QPainter, QPaintEvent, QResizeEvent
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


def fixed_font() -> QFont:
    """Return the font whose letters are all as wide, for tables and messages."""
    return QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)


def plain_labels(widget: QWidget) -> None:
    """Let the labels in a widget show text as it is written, but for those made for rich text.

    Qt guesses else: a boundary named ``<img src=...>`` would be a picture.
    """
    for label in widget.findChildren(QLabel):
        if label.textFormat() == Qt.TextFormat.AutoText:
            label.setTextFormat(Qt.TextFormat.PlainText)


LETTERS = 60
"""In a line of a tooltip."""


def wrapped(text: str) -> str:
    """Return a tooltip in lines of about 60 letters; Qt shows plain text on one line.

    Short lines stay as they are. What looks like rich text is the name of a boundary or file, and
    is shown as it is written.
    """
    short = all(len(line) <= LETTERS + 10 for line in text.splitlines())
    if short and not Qt.mightBeRichText(text):  # type: ignore[attr-defined]  # not in PySide's stubs
        return text
    width = round(1.05 * LETTERS * QFontMetrics(QToolTip.font()).averageCharWidth())
    lines = html.escape(text, quote=False).replace("\n", "<br>")
    return f"<table width='{width}'><tr><td>{lines}</td></tr></table>"


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


class WideLabel(QScrollArea):
    """A label over the whole width, as high as its text up to some lines; the others are scrolled.

    Parameters
    ----------
    lines : int
        That are seen at once.
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

    def say(self, text: str) -> None:
        """Show a text from its beginning, or hide where there is none."""
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
    """Asks for no width, so that the text of an item ends where the list does."""

    def sizeHint(self, option: QStyleOptionViewItem, index: ModelIndex) -> QSize:
        return QSize(0, super().sizeHint(option, index).height())


def elide_items(items: QAbstractItemView) -> None:
    """Let the items of a list end with an ellipsis, instead of scrolling sideways."""
    items.setItemDelegate(_Narrow(items))
    items.setTextElideMode(Qt.TextElideMode.ElideRight)
    items.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
