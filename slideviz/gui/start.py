"""The start page, over the view while no mesh is open."""

from __future__ import annotations

import html
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from qtpy.QtCore import QDate, QEvent, QLocale, QSize, Qt, Signal
from qtpy.QtGui import QKeyEvent, QPixmap, QResizeEvent
from qtpy.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QToolButton,
    QWidget,
)

from slideviz.formats.openfoam_paths import shown_name
from slideviz.gui.commands import COMMANDS
from slideviz.gui.widgets.build import (
    ALIGN_LEFT,
    ElidedLabel,
    QuietBar,
    TwoPartRow,
    as_widget,
    hint_label,
    in_column,
    in_row,
    push_button,
    rich_label,
    set_policy,
    wrapped,
)
from slideviz.gui.widgets.theme import icon, logo, svg_pixmap
from slideviz.session.jobs import JobProgress

WIDEST = 860  # largest width of the page in pixels: longer lines would be hard to read
RECENT = 5  # number of recent files that are listed
COLUMNS = 4  # most cards of samples in a row
NARROWEST = 126  # least width of a card in pixels, for its name
SIZE = (152, 96)  # width and height of a card's picture in pixels, at a device pixel ratio of 1
TRIED = "passage"  # the sample that is deformed by one click
HINT = "Files can also be dropped anywhere on this window."
TRY = "Try it: deform a blade passage"
"""The text of the button for that; only its beginning where the page is narrow."""


class StartPage(QScrollArea):
    """The start page: buttons to try a sample and to open a file, recent files, sample cases."""

    try_wanted = Signal(str)
    file_wanted = Signal(object)  # Path
    """The user wants to open a recent file."""
    sample_wanted = Signal(str)
    """`try_wanted`, `sample_wanted`: the user wants to open and deform a sample; only to open
    it."""

    def __init__(self, samples: dict[str, str], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("start")
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        self.page = QWidget(maximumWidth=WIDEST)
        self._outer = in_row(None, self.page, None)
        self._outer.setStretchFactor(self.page, 100)
        self.setWidget(as_widget(self._outer))
        self.hint = hint_label(HINT)
        self.bar = QuietBar(textVisible=False)
        self.bar.setFixedHeight(6)
        self.bar.hide()
        self._recent = in_column(spacing=0)
        self.recent_buttons: list[QPushButton] = []
        self.sample_buttons: dict[str, QToolButton] = {}
        buttons = self._make_buttons(TRIED in samples)
        head = (self._make_head(), 10, buttons, self.hint, self.bar, self._recent)
        cards = (8, _heading("Sample cases"), self._make_cards(samples)) if samples else ()
        column = in_column(None, *head, *cards, None, spacing=6, on=self.page)
        column.setStretch(0, 2)
        column.setStretch(column.count() - 1, 3)

    # Parts -----------------------------------------------------------------------------
    def _make_head(self) -> QHBoxLayout:
        picture = QLabel(pixmap=logo().pixmap(QSize(64, 64)))
        title = rich_label(
            "<span style='font-size:22pt; font-weight:600'>slideviz</span><br>"
            "Deform CFD meshes, and see at once where and why their quality falls"
        )
        title.setWordWrap(True)
        return in_row(picture, 10, title, wide=[title])

    def _make_buttons(self, can_try: bool) -> TwoPartRow:
        self.attempt = push_button(
            TRY,
            "Open the sample “passage” and deform it at once.",
            lambda: self.try_wanted.emit(TRIED),
            "run",
        )
        self.attempt.setIcon(icon("run", "#ffffff"))
        self.attempt.setVisible(can_try)
        self.open = push_button(
            "Open a mesh or case…",
            COMMANDS["open"].tip,
            lambda: COMMANDS["open"].do(self.window()),
            "open_page",
        )
        for button in (self.attempt, self.open):
            button.setAutoDefault(True)  # the Enter key, too
            set_policy(button, "Fixed", "Fixed")
        return TwoPartRow([self.attempt], [self.open], spacing=10, apart=False)

    def _make_cards(self, samples: dict[str, str]) -> QGridLayout:
        self._cards = QGridLayout()
        self._cards.setSpacing(8)
        for name, text in samples.items():
            button = Card()
            button.setObjectName(f"sample_{name}")
            button.setProperty("card", True)
            dim = text[:2]
            button.setText(name if name.endswith(dim.lower()) else f"{name} · {dim}")
            button.setToolTip(wrapped(text))
            button.setAccessibleDescription(text)
            button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
            button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
            button.setCursor(Qt.CursorShape.PointingHandCursor)
            set_policy(button, "Expanding", "Fixed")
            button.clicked.connect(lambda _=False, name=name: self.sample_wanted.emit(name))
            self.sample_buttons[name] = button
        self._place_cards()
        self._draw_cards()
        return self._cards

    def _place_cards(self) -> None:
        """Size the cards and set their columns by the page's width, so that no row is cut off."""
        whole = min(self.viewport().width() - 48, WIDEST)
        columns = max(1, min(COLUMNS, whole // NARROWEST))
        width = min(max(whole // columns - 20, SIZE[0] // 2), SIZE[0])
        for k, button in enumerate(self.sample_buttons.values()):
            button.setIconSize(QSize(width, width * SIZE[1] // SIZE[0]))
            self._cards.addWidget(button, k // columns, k % columns)
        for column in range(COLUMNS):
            self._cards.setColumnStretch(column, int(column < columns))

    def _draw_cards(self) -> None:
        letters = self.palette().color(self.palette().ColorRole.WindowText)
        line = "#aab4c0" if letters.lightness() > 128 else "#76828f"
        for name, button in self.sample_buttons.items():
            button.setIcon(card(name, line))

    def set_busy(self, what: str) -> None:
        """Show the name of the running job, which opens a mesh; an empty text: none runs."""
        self.hint.setText(what or HINT)
        self.bar.setVisible(bool(what))
        self.bar.setRange(0, 0)

    def show_progress(self, progress: JobProgress) -> None:
        if not self.bar.isHidden():
            self.hint.setText(progress.text)
            part = progress.fraction
            self.bar.setRange(0, 0 if part is None else 1000)
            self.bar.setValue(round(1000 * (part or 0.0)))

    # Recent files ----------------------------------------------------------------------
    def show_recent(self, paths: list[Path]) -> None:
        """List the files used last, with folder and time; missing files are disabled."""
        while self._recent.count():
            widget = self._recent.takeAt(0).widget()
            if widget is not None:
                widget.deleteLater()
        self.recent_buttons = []
        if not paths:
            return
        self._recent.addSpacing(8)
        self._recent.addWidget(_heading("Recent files"))
        for path in paths[:RECENT]:
            button = RecentButton(path)
            button.clicked.connect(lambda _=False, path=path: self.file_wanted.emit(path))
            self._recent.addWidget(button)
            self.recent_buttons.append(button)

    # Qt --------------------------------------------------------------------------------
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        narrow = self.width() < 3 * NARROWEST
        self._outer.setContentsMargins(8 if narrow else 24, 12, 8 if narrow else 24, 12)
        self.attempt.setText(TRY.partition(":")[0] if narrow else TRY)
        if self.sample_buttons:
            self._place_cards()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and getattr(self, "sample_buttons", None):
            self._draw_cards()


class Card(QToolButton):
    """The button of a sample, which the Enter key presses too."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.click()
        else:
            super().keyPressEvent(event)


class RecentButton(QPushButton):
    """The button of a recent file, with its name, its folder, and when it was changed."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.setProperty("recent", True)
        self.setAutoDefault(True)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        set_policy(self, "Ignored", "Fixed")
        when = when_changed(path)
        self.setEnabled(bool(when))
        self.setToolTip(wrapped(str(path) if when else f"{path} no longer exists."))
        self.setAccessibleName(f"{shown_name(path)} in {path.parent}, {when or 'missing'}")
        name = rich_label(f"<b>{html.escape(shown_name(path))}</b>")
        time = QLabel(when or "missing")
        folder = str(path.parent).replace(str(Path.home()), "~", 1)
        self.folder = ElidedLabel(folder, Qt.TextElideMode.ElideMiddle)
        self.folder.setAlignment(ALIGN_LEFT)
        for label in (name, self.folder, time):
            label.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
            label.setProperty("hint", label is not name)
        parts = in_row(name, self.folder, time, wide=[self.folder])
        parts.setContentsMargins(8, 4, 8, 4)
        self.setLayout(parts)
        self.setFixedHeight(self.fontMetrics().height() + 12)


def when_changed(path: Path, now: datetime | None = None) -> str:
    """Return when a file was changed, as text such as ``today 14:05``; empty if it is missing."""
    try:
        then = datetime.fromtimestamp(path.stat().st_mtime)
    except OSError:
        return ""
    days = ((now or datetime.now()).date() - then.date()).days
    clock = f"{then:%H:%M}"
    if days in (0, 1):
        return f"{'today' if days == 0 else 'yesterday'} {clock}"
    locale = QLocale()
    return locale.toString(QDate(then.year, then.month, then.day), locale.FormatType.ShortFormat)


def _heading(text: str) -> QLabel:
    label = rich_label(f"<b>{text}</b>")
    label.setContentsMargins(0, 2, 0, 4)
    return label


@lru_cache(maxsize=32)
def card(name: str, line: str) -> QPixmap:
    """Return the picture of a sample by its name, with mesh lines in the color ``line``."""
    folder = Path(__file__).with_name("cards")
    file = folder / f"{name}.svg"
    svg = (file if file.exists() else folder / "mesh.svg").read_text(encoding="utf-8")
    pixmap = svg_pixmap(svg.replace("currentColor", line), 2 * SIZE[0], 2 * SIZE[1])
    pixmap.setDevicePixelRatio(2.0)
    return pixmap
