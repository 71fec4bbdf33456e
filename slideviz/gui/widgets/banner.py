"""The banner above the view: a message or a question that stays until it is closed.

Its colors are in the style sheet of `slideviz.gui.widgets.theme` (``QFrame#banner``).
"""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QFrame,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from slideviz.errors import OUT_OF_MEMORY, SlidevizError
from slideviz.gui.widgets.build import (
    dialog_buttons,
    in_column,
    in_row,
    push_button,
    rich_label,
    set_style,
    tool_button,
)
from slideviz.gui.widgets.error_reporter import details_of

MOST_LINES = 4  # most lines of a message in the banner; all of them are behind “Details”
Answers = Mapping[str, Callable[[], object]]
"""The functions that buttons call, by the buttons' texts."""

NO_ANSWERS: Answers = MappingProxyType({})


class DetailsDialog(QDialog):
    """The dialog with the full text of a message, which can be copied."""

    def __init__(self, parent: QWidget, text: str) -> None:
        super().__init__(parent)
        self.setWindowTitle("Details")
        self.resize(720, 380)
        self.text = QPlainTextEdit(text)
        self.text.setReadOnly(True)
        self.text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        buttons = dialog_buttons(self, QDialogButtonBox.StandardButton.Close)
        self.copy = buttons.addButton("Copy", QDialogButtonBox.ButtonRole.ActionRole)
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(text))
        self.setLayout(in_column(self.text, buttons))


class Banner(QFrame):
    """A message across the top of the view that stays until it is closed."""

    shown = Signal(str)
    """The text of a message, when it is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("banner")
        self._text = self._full = self._brief = ""
        self.text = rich_label("")
        self.text.setWordWrap(True)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.details = push_button("Details…", "", self._show_details)
        self.copy = push_button(
            "Copy details",
            "Copy the message with its trace, versions and platform.",
            lambda: QApplication.clipboard().setText(self._full),
        )
        close = tool_button("Close the message", self._closed, text="✕")
        self._row = in_row(self.text, self.details, self.copy, close, wide=[self.text])
        self._row.setContentsMargins(10, 6, 6, 6)
        self.setLayout(self._row)
        self.answers: dict[str, QPushButton] = {}
        self._later: Callable[[], object] | None = None
        self.hide()

    def show_message(
        self, text: str, full: str = "", calm: bool = True, answers: Answers = NO_ANSWERS
    ) -> None:
        """Show a message, with ``full`` behind “Details”, and a button for each of ``answers``.

        ``calm``: in the colors of a note, otherwise of an alarm.
        """
        self._offer(answers)
        set_style(self, "calm", calm)
        self._text = text
        lines = text.splitlines() or [""]
        brief = "\n".join(lines[:MOST_LINES]) + ("\n…" if len(lines) > MOST_LINES else "")
        self._brief = html.escape(brief, quote=False).replace("\n", "<br>")
        self.text.setText(self._brief)
        self._full = full or (text if len(lines) > MOST_LINES else "")
        self.details.setVisible(bool(self._full))
        self.copy.setVisible(bool(full))
        self.show()
        self.shown.emit(text)

    def show_error(self, error: BaseException) -> None:
        """Show the message of an error; of an unexpected one, the trace is behind “Details”."""
        if isinstance(error, SlidevizError | MemoryError):
            text = OUT_OF_MEMORY if isinstance(error, MemoryError) else str(error)
            self.show_message(text, calm=False)
        else:
            kind = type(error).__name__
            text = f"Something unexpected went wrong ({kind}): {error}"
            self.show_message(text, details_of(error), calm=False)

    @contextmanager
    def showing_errors(self) -> Iterator[None]:
        """Show an error of a file or of slideviz that is raised within, and go on after it."""
        try:
            yield
        except (OSError, SlidevizError) as error:
            self.show_error(error)

    def withdraw(self, text: str) -> None:
        """Hide the banner if it still shows this message."""
        if text and text == self._text:
            self.hide()

    def ask(
        self, text: str, answers: Answers, full: str = "", later: Callable[[], object] | None = None
    ) -> None:
        """Show a question, with a button for each of ``answers``, which calls its function.

        ``later`` is called if the user closes the question instead.
        """
        self._later = later
        self.show_message(text, full, answers=answers)

    def _offer(self, answers: Answers) -> None:
        for button in self.answers.values():
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self.answers = {}
        for name, function in answers.items():
            button = push_button(name, "", lambda _=False, function=function: function())
            self.answers[name] = button
            self._row.insertWidget(self._row.count() - 1, button)

    def _closed(self) -> None:
        later = self._later
        self._later = None
        self.hide()
        if later is not None:
            later()

    def count(self, times: int) -> None:
        """Show behind the message how often its error has occurred."""
        self.text.setText(f"{self._brief} <i>({times:,} times)</i>")

    def _show_details(self) -> None:
        self.dialog = DetailsDialog(self, self._full)
        self.dialog.open()
