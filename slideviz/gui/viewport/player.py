"""The step player under the view, and the numbers of the step that is shown."""

from __future__ import annotations

import math

from qtpy.QtCore import QElapsedTimer, QSignalBlocker, QSize, Qt, QTimer
from qtpy.QtGui import QAction, QActionGroup, QResizeEvent, QTextDocument
from qtpy.QtWidgets import QHBoxLayout, QLabel, QMenu, QSlider, QToolButton, QWidget

from slideviz.gui.commands import BY_NAME
from slideviz.gui.responsiveness.timers import TICK_MS
from slideviz.gui.widgets.build import ALIGN_RIGHT, Fitted, set_policy, tool_button
from slideviz.gui.widgets.theme import alarm, set_icon
from slideviz.session import changes
from slideviz.session.run_messages import stopped_words
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.session.walls_table import heights_words

PLAY_MS = 3000
"""Duration of all steps together at speed 1, in milliseconds, unless `STEP_MS` limits it."""

STEP_MS = (50, 500)
"""The shortest and the longest time that one step is shown at speed 1, in milliseconds."""

SPEEDS = (0.5, 1.0, 2.0, 4.0)  # the speeds in the player's menu, as multiples of the usual one
NARROW = 540  # width in pixels below which the player hides speed and loop and shortens its text
NARROWEST = 330
"""Width in pixels below which the player also hides the slider and the buttons of both ends."""


def step_ms(steps: int, speed: float = 1.0) -> float:
    """Return how long each of ``steps`` steps is shown, in milliseconds."""
    shortest, longest = STEP_MS
    return min(max(PLAY_MS / max(steps, 1), shortest), longest) / speed


class Player(QWidget):
    """The player of the steps: buttons, a slider, and the numbers of the shown step."""

    def __init__(self, store: Store) -> None:
        super().__init__()
        self.store = store
        self._narrow = False
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 3, 8, 3)
        row.setSpacing(1)
        self.buttons: dict[str, QToolButton] = {}
        for command in BY_NAME["steps"].commands():
            name = command.name.removeprefix("step_")
            self.buttons[name] = button = tool_button(
                command.button_tip,
                lambda _=False, do=command.do: do(self.window()),
                image=name,
                name=f"player_{name}",
            )
            row.addWidget(button)
        self._add_speed(row)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setObjectName("steps_slider")
        self.slider.setMinimumWidth(50)
        self.slider.setMaximumWidth(320)
        self.slider.setPageStep(1)
        self.slider.valueChanged.connect(self.go)
        row.addSpacing(6)
        row.addWidget(self.slider, 1)
        self.step_text = QLabel()
        row.addSpacing(6)
        row.addWidget(self.step_text)
        self.result = ResultsLabel()
        row.addWidget(self.result, 4)
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._tick)
        self._clock = QElapsedTimer()
        self._owed = 0.0
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _advance(self, text: str) -> int:
        return self.step_text.fontMetrics().horizontalAdvance(text)

    def _add_speed(self, row: QHBoxLayout) -> None:
        self.loop = tool_button("Play again and again", image="loop", name="player_loop")
        self.loop.setCheckable(True)
        self.buttons["loop"] = self.loop
        self.speed = 1.0
        menu = QMenu()
        group = QActionGroup(self)
        self.speed_button = tool_button(
            "How fast the steps are played", menu=menu, name="player_speed"
        )
        self.speed_button.setAutoRaise(True)
        self.speeds: dict[float, QAction] = {}
        for speed in SPEEDS:
            act = menu.addAction(f"{speed:g}×")
            act.setCheckable(True)
            group.addAction(act)
            act.triggered.connect(lambda _=False, speed=speed: self.set_speed(speed))
            self.speeds[speed] = act
        for button in (self.loop, self.speed_button):
            row.addWidget(button)
        self.set_speed(self.speed)

    def set_speed(self, speed: float) -> None:
        self.speed = speed
        self.speeds[speed].setChecked(True)
        self.speed_button.setText(f"{speed:g}×")
        if hasattr(self, "_timer"):
            self._timer.setInterval(self._tick_ms())

    def _step_ms(self) -> float:
        return step_ms(len(self.store.session.frames) - 1, self.speed)

    def _tick_ms(self) -> int:
        return max(round(self._step_ms()), TICK_MS)

    def sync(self, session: Session) -> None:
        last = max(len(session.frames) - 1, 0)
        at = min(session.view.frame, last)
        with QSignalBlocker(self.slider):
            self.slider.setRange(0, last)
            self.slider.setValue(at)
        self.slider.setEnabled(last > 0)
        why = "" if last else "There are no steps yet: run the case."
        self.slider.setToolTip(why or "Which step is shown.")
        for name, button in self.buttons.items():
            ahead = name in ("next", "last")
            always = name in ("play", "loop")
            enabled = last > 0 and (always or (at < last if ahead else at > 0))
            button.setEnabled(enabled)
        # The slider keeps its length, whatever the text says.
        planned = session.planned
        widest = max(self._advance(self._step_words(step, planned)) for step in (0, planned))
        self.step_text.setFixedWidth(widest + 4)
        self.step_text.setText("" if session.mesh is None else self._step_words(at, planned))
        self.step_text.setToolTip(stopped_words(session.run_shown))
        self.speed_button.setEnabled(last > 0)
        self.result.show_parts(result_parts(session))
        # Inverted cells are shown in the narrowest window, too.
        self.result.setMinimumWidth(self.result.least)
        if not last:
            self.stop()

    def _step_words(self, step: int, planned: int) -> str:
        """Return the text for a step of ``planned``, shortened where the player is narrow."""
        if step and self.store.session.preview:
            return "Preview"
        if self._narrow and planned:
            return f"{step}/{planned}"
        return f"Step {step} of {planned}" if step else "Undeformed"

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        narrow = self.width() < NARROW
        narrowest = self.width() < NARROWEST
        for part in (self.slider, self.buttons["first"], self.buttons["last"]):
            part.setHidden(narrowest)
        if narrow != self._narrow:
            self._narrow = narrow
            for button in (self.loop, self.speed_button):
                button.setHidden(narrow)
            self.sync(self.store.session)

    def minimumSizeHint(self) -> QSize:
        return QSize(0, super().minimumSizeHint().height())

    @property
    def playing(self) -> bool:
        return self._timer.isActive()

    def go(self, index: int) -> None:
        """Show a step; 0 is the undeformed mesh."""
        self.store.change(changes.show_frame, index)

    def step(self, by: int) -> None:
        """Show the step that is ``by`` steps ahead (behind, if negative)."""
        self.go(self.store.session.view.frame + by)

    def toggle(self) -> None:
        if self.playing:
            self.stop()
        elif len(self.store.session.frames) > 1:
            if self.store.session.view.frame >= len(self.store.session.frames) - 1:
                self.go(0)
            self._owed = 0.0
            self._timer.start(self._tick_ms())
            self._clock.start()
            set_icon(self.buttons["play"], "pause")

    def stop(self) -> None:
        self._timer.stop()
        set_icon(self.buttons["play"], "play")

    def _tick(self) -> None:
        """Show the step that is due by now; after the last one, stop or begin again."""
        last = len(self.store.session.frames) - 1
        if self.store.session.view.frame >= last:
            # The last step was shown for its full time.
            if self.loop.isChecked():
                self._clock.restart()
                self._owed = 0.0
                self.go(0)
            else:
                self.stop()
            return
        # Skip steps where the timer is late, so that the speed is right on average.
        self._owed += self._clock.restart() / self._step_ms()
        by = max(1, round(self._owed))
        self._owed -= by
        self.step(by)
        if self.store.session.view.frame >= last and not self.loop.isChecked():
            self.stop()


SEPARATOR = "&nbsp;· "  # between the numbers of a step


class ResultsLabel(Fitted, QLabel):
    """The label with the numbers of the shown step, the most important first.

    It shows the longest form that fits; where none does, it drops numbers from the end of the
    shortest form.
    """

    def __init__(self) -> None:
        super().__init__()
        self._forms: list[list[str]] = []
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setAlignment(ALIGN_RIGHT)
        # Numbers that come and go may not take room from the view or the panels.
        set_policy(self, "Ignored", "Preferred")

    def show_parts(self, forms: list[list[str]]) -> None:
        """Show numbers as rich text, given as a list of forms: each a list, the longest first."""
        if forms != self._forms:
            self._forms = forms
            self.fit()

    @property
    def least(self) -> int:
        """Return the width of the most important number in its shortest form, in pixels."""
        return math.ceil(self._width_of(self._forms[-1][:1])) + 2 if self._forms else 0

    def fit(self) -> None:
        if not self._forms:
            self.setText("")
            self.setToolTip("")
            return
        width = self.width() - 2
        shown = next((form for form in self._forms if self._width_of(form) <= width), None)
        if shown is None:
            shown = list(self._forms[-1])
            while shown and self._width_of(shown) > width:
                shown.pop()
        self.setText(SEPARATOR.join(shown))
        full = self._forms[0]
        self.setToolTip("" if shown == full else "<br>".join(full))

    def _width_of(self, parts: list[str]) -> float:
        document = QTextDocument()
        document.setDefaultFont(self.font())
        document.setDocumentMargin(0.0)
        document.setHtml(SEPARATOR.join(parts))
        return document.idealWidth()


def plain(rich: str) -> str:
    """Return rich text (HTML) as plain text."""
    document = QTextDocument()
    document.setHtml(rich)
    return document.toPlainText()


def result_parts(session: Session) -> list[list[str]]:
    """Return three forms of the shown step's numbers, as rich text, the longest form first.

    Each form is the list of inverted cells, minimum and mean quality, and of a step the ratios of
    first heights where walls have layers: in full, and with shorter words. No number has fewer
    decimals: it would look cut off. Empty if no mesh is open.
    """
    frame = session.frame
    if frame is None:
        return []
    quality = frame.quality
    run = session.run_shown
    deformed = frame.step is not None and run is not None
    heights = heights_words(frame, run.case) if deformed and run is not None else ""
    color = f" style='color:{alarm()}'" if quality.inverted else ""

    def form(word: str, first: str = "first heights") -> list[str]:
        return [
            f"<span{color}><b>{quality.inverted:,}</b> {word}</span>",
            f"min <b>{quality.min:.4f}</b>",
            f"mean <b>{quality.mean:.4f}</b>",
            *([f"{first} <b>{heights}</b>"] if heights else []),
        ]

    return [form("inverted"), form("inv."), form("inv.", "heights")]
