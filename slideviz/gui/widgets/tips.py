"""Tooltips in lines that can be read, and labels that show text as it is written."""

from __future__ import annotations

import html

from qtpy.QtCore import Qt
from qtpy.QtGui import QFont, QFontDatabase, QFontMetrics
from qtpy.QtWidgets import QLabel, QToolTip, QWidget


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
