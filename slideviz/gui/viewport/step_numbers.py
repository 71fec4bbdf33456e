"""The numbers of the step that is shown, in one line that fits its room."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import math

from qtpy.QtCore import Qt
from qtpy.QtGui import QResizeEvent, QTextDocument
from qtpy.QtWidgets import QLabel, QSizePolicy

from slideviz.gui.widgets.theme import alarm
from slideviz.session.state import Session

SEPARATOR = "&nbsp;· "
"""Between the numbers of a step."""


class Results(QLabel):
    """The numbers of a step, in the order of what matters.

    In little room words and numbers are shorter; where even that is too long, the last are left
    out.
    """

    def __init__(self) -> None:
        super().__init__()
        self._forms: list[list[str]] = []
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        # Numbers that come and go may not take room from the view or the panels.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)

    def show_parts(self, forms: list[list[str]]) -> None:
        """Show other numbers: the same ones, as rich text, in full and in shorter forms."""
        if forms != self._forms:
            self._forms = forms
            self._fit()

    @property
    def least(self) -> int:
        """Return the width of the most important number in its shortest form, in pixels."""
        return math.ceil(self._width_of(self._forms[-1][:1])) + 2 if self._forms else 0

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        if not self._forms:
            self.setText("")
            self.setToolTip("")
            return
        room = self.width() - 2
        shown = next((form for form in self._forms if self._width_of(form) <= room), None)
        if shown is None:
            shown = list(self._forms[-1])
            while shown and self._width_of(shown) > room:
                shown.pop()
        self.setText(SEPARATOR.join(shown))
        full = self._forms[0]
        self.setToolTip("" if shown == full else "<br>".join(full))

    def _width_of(self, parts: list[str]) -> float:
        """Return how wide the parts are in a row, in pixels."""
        document = QTextDocument()
        document.setDefaultFont(self.font())
        document.setDocumentMargin(0.0)
        document.setHtml(SEPARATOR.join(parts))
        return document.idealWidth()


def plain(rich: str) -> str:
    """Return rich text without its marks."""
    document = QTextDocument()
    document.setHtml(rich)
    return document.toPlainText()


def result_parts(session: Session) -> list[list[str]]:
    """Return the numbers of the step that is shown, the most important first, as rich text.

    In full, with a shorter word, and with fewer digits.
    """
    frame = session.frame
    if frame is None:
        return []
    quality = frame.quality
    colour = f" style='color:{alarm()}'" if quality.inverted else ""

    def form(word: str, digits: int) -> list[str]:
        return [
            f"<span{colour}><b>{quality.inverted:,}</b> {word}</span>",
            f"min <b>{quality.min:.{digits}f}</b>",
            f"mean <b>{quality.mean:.{digits}f}</b>",
        ]

    return [form("inverted", 4), form("inv.", 4), form("inv.", 3)]
