"""The strip above the view, and below it the banner: a message that stays until it is closed.

Its colors are in the style sheet of `slideviz.gui.widgets.theme` (``QFrame#banner``).
"""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType

from qtpy.QtCore import Qt
from qtpy.QtWidgets import (
    QApplication,
    QBoxLayout,
    QDialog,
    QDialogButtonBox,
    QFrame,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from slideviz.errors import OUT_OF_MEMORY, SlidevizError
from slideviz.gui.widgets.build import (
    Fitted,
    LinkLabel,
    PanelScroll,
    dialog_buttons,
    drop,
    in_column,
    in_row,
    push_button,
    rich_label,
    set_policy,
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
        self.text = QPlainTextEdit(
            text, readOnly=True, lineWrapMode=QPlainTextEdit.LineWrapMode.NoWrap
        )
        buttons = dialog_buttons(self, QDialogButtonBox.StandardButton.Close)
        self.copy = buttons.addButton("Copy", QDialogButtonBox.ButtonRole.ActionRole)
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(text))
        self.setLayout(in_column(self.text, buttons))


class Banner(Fitted, QFrame):
    """A message across the top of the view that stays until it is closed."""

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
        self.close_button = tool_button("Close the message", self._closed, text="✕")
        row = in_row(self.text, self.details, self.copy, self.close_button, wide=[self.text])
        self._row = in_row(None, spacing=6)
        self._whole = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._whole.setContentsMargins(10, 6, 6, 6)
        self._whole.addLayout(row, 1)
        self._whole.addLayout(self._row)
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
        drop(self._row, self.answers.values())
        self.answers = {}
        for name, function in answers.items():
            button = push_button(name, "", lambda _=False, function=function: function())
            self.answers[name] = button
            self._row.addWidget(button)
        self.fit()

    def fit(self) -> None:
        """Put the buttons below the message where they would take half of its room."""
        below = 2 * self._row.sizeHint().width() > self.width()
        kind = QBoxLayout.Direction
        self._whole.setDirection(kind.TopToBottom if below else kind.LeftToRight)

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


MOST_HEIGHT = 132  # greatest height in pixels of the list of messages, which scrolls beyond


class MessageStrip(Fitted, QFrame):
    """The strip over the view: words on the session; its messages, counted at the end, and listed.

    Each message of the list is a `Banner` in ``rows``, with its buttons.
    """

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("strip")
        self.text = LinkLabel()
        # A long sentence wraps; it must not make the window wider.
        set_policy(self.text, "Ignored", "Preferred")
        self.count = tool_button("Show or hide the messages.", self.toggle, name="messages")
        self.rows: list[Banner] = []
        self._list = QWidget()
        self._column = in_column(on=self._list, spacing=0)
        self._area = PanelScroll(self._list)
        row = in_row(self.text, self.count, wide=[self.text])
        row.setContentsMargins(10, 2, 4, 2)
        in_column(row, self._area, spacing=0, on=self)
        self.show_rows("", ())

    def show_rows(self, words: str, rows: Sequence[tuple[str, bool, Answers]]) -> None:
        """List messages, each with its text, whether it is calm, and its buttons.

        ``words``: how many there are. The list opens by itself for one that is not calm.
        """
        drop(self._column, self.rows)
        self.rows = []
        for text, calm, answers in rows:
            banner = Banner()
            banner.close_button.hide()
            banner.show_message(text, calm=calm, answers=answers)
            self._column.addWidget(banner)
            self.rows.append(banner)
        self._words = words
        self.count.setVisible(bool(words))
        alarm = not all(calm for _, calm, _ in rows)
        set_style(self.count, "bad", alarm)
        self._open(alarm)

    def toggle(self) -> None:
        """Show the list, or hide it."""
        self._open(self._area.isHidden())

    def _open(self, is_open: bool) -> None:
        self._area.setVisible(is_open)
        self.count.setText(f"{self._words} {'▴' if is_open else '▾'}")
        self.fit()

    def fit(self) -> None:
        """Give the list the height of its messages, up to `MOST_HEIGHT`."""
        high = sum(row.heightForWidth(self.width()) for row in self.rows)
        self._area.setFixedHeight(min(high, MOST_HEIGHT))
