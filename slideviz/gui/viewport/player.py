"""The step player under the view, and the line with the quality of the step that is shown."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtCore import QElapsedTimer, Qt, QTimer
from qtpy.QtGui import QAction, QActionGroup, QResizeEvent
from qtpy.QtWidgets import QHBoxLayout, QLabel, QMenu, QSlider, QToolButton, QWidget

from slideviz.gui.commands import STEPS
from slideviz.gui.responsiveness.settings import TICK_MS
from slideviz.gui.viewport.step_numbers import Results, result_parts
from slideviz.gui.widgets.icons import icon
from slideviz.session import changes
from slideviz.session.state import Session
from slideviz.session.store import Store

FILM_MS = 3000
"""What all steps take together at the usual speed, where no limit for one step is reached."""
STEP_MS = (50, 500)
"""The shortest and the longest time that a step is seen at the usual speed."""
SPEEDS = (0.5, 1.0, 2.0, 4.0)
NARROW = 540
"""Pixels; a player with less leaves out speed and loop, and words."""


def step_ms(steps: int, speed: float = 1.0) -> float:
    """Return how long each of ``steps`` is seen, in milliseconds."""
    shortest, longest = STEP_MS
    return min(max(FILM_MS / max(steps, 1), shortest), longest) / speed


class Player(QWidget):
    """First, back, play, forward, last, a slider, and the numbers of the step."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        self._narrow = False
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 3, 8, 3)
        row.setSpacing(1)
        self.buttons: dict[str, QToolButton] = {}
        for command in STEPS.commands():
            name = command.name.removeprefix("step_")
            button = QToolButton()
            button.setObjectName(f"player_{name}")
            button.setIcon(icon(name))
            button.setToolTip(command.button)
            button.clicked.connect(lambda _=False, do=command.do: do(self.window()))
            self.buttons[name] = button
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
        self.result = Results()
        row.addWidget(self.result, 4)
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._tick)
        self._clock = QElapsedTimer()
        self._owed = 0.0
        self._colour = "#3b4652"
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def _advance(self, text: str) -> int:
        return self.step_text.fontMetrics().horizontalAdvance(text)

    def _add_speed(self, row: QHBoxLayout) -> None:
        self.loop = QToolButton()
        self.loop.setObjectName("player_loop")
        self.loop.setCheckable(True)
        self.loop.setToolTip("Play again and again")
        self.buttons["loop"] = self.loop
        self.speed = 1.0
        self.speed_button = QToolButton()
        self.speed_button.setObjectName("player_speed")
        self.speed_button.setToolTip("How fast the steps are played")
        self.speed_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.speed_button.setAutoRaise(True)
        menu, group = QMenu(self), QActionGroup(self)
        self.speeds: dict[float, QAction] = {}
        for speed in SPEEDS:
            act = menu.addAction(f"{speed:g}×")
            act.setCheckable(True)
            group.addAction(act)
            act.triggered.connect(lambda _=False, speed=speed: self.set_speed(speed))
            self.speeds[speed] = act
        self.speed_button.setMenu(menu)
        for button in (self.loop, self.speed_button):
            row.addWidget(button)
        self.set_speed(self.speed)
        self.loop.setIcon(icon("loop"))

    def set_speed(self, speed: float) -> None:
        """Play that many times as fast as usual, also what plays already."""
        self.speed = speed
        self.speeds[speed].setChecked(True)
        self.speed_button.setText(f"{speed:g}×")
        if hasattr(self, "_timer"):
            self._timer.setInterval(self._tick_ms())

    def _step_ms(self) -> float:
        return step_ms(len(self.store.session.frames) - 1, self.speed)

    def _tick_ms(self) -> int:
        return max(round(self._step_ms()), TICK_MS)

    def set_icon_colour(self, colour: str) -> None:
        """Redraw the icons in another colour."""
        self._colour = colour
        for name, button in self.buttons.items():
            button.setIcon(icon("pause" if name == "play" and self.playing else name, colour))
        # Words about inverted cells have the theme's red.
        self.sync(self.store.session)

    def sync(self, session: Session) -> None:
        """Show the session."""
        last = max(len(session.frames) - 1, 0)
        at = min(session.view.frame, last)
        self.slider.blockSignals(True)
        self.slider.setRange(0, last)
        self.slider.setValue(at)
        self.slider.blockSignals(False)
        self.slider.setEnabled(last > 0)
        why = "" if last else "There are no steps yet: run the case."
        self.slider.setToolTip(why or "Which step is shown.")
        for name, button in self.buttons.items():
            ahead = name in ("next", "last")
            always = name in ("play", "loop")
            enabled = last > 0 and (always or (at < last if ahead else at > 0))
            button.setEnabled(enabled)
        # The slider keeps its length, whatever the text says.
        widest = max(self._advance(self._step_words(step, last)) for step in (0, last))
        self.step_text.setFixedWidth(widest + 4)
        self.step_text.setText("" if session.mesh is None else self._step_words(at, last))
        self.speed_button.setEnabled(last > 0)
        self.result.show_parts(result_parts(session))
        # Inverted cells are told of in the narrowest window, too.
        self.result.setMinimumWidth(self.result.least)
        if not last:
            self.stop()

    def _step_words(self, step: int, last: int) -> str:
        """Return which step is shown, in as many words as there is room for."""
        if self._narrow and last:
            return f"{step}/{last}"
        return f"Step {step} of {last}" if step else "Undeformed"

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        narrow = self.width() < NARROW
        if narrow != self._narrow:
            self._narrow = narrow
            for button in (self.loop, self.speed_button):
                button.setHidden(narrow)
            self.sync(self.store.session)

    @property
    def playing(self) -> bool:
        """Tell whether the steps are played now."""
        return self._timer.isActive()

    def go(self, index: int) -> None:
        """Show a step; 0 is the undeformed mesh."""
        self.store.change(changes.show_frame, index)

    def step(self, by: int) -> None:
        """Show the step before or after."""
        self.go(self.store.session.view.frame + by)

    def toggle(self) -> None:
        """Play, or stop playing."""
        if self.playing:
            self.stop()
        elif len(self.store.session.frames) > 1:
            if self.store.session.view.frame >= len(self.store.session.frames) - 1:
                self.go(0)
            self._owed = 0.0
            self._timer.start(self._tick_ms())
            self._clock.start()
            self.buttons["play"].setIcon(icon("pause", self._colour))

    def stop(self) -> None:
        """Stop playing."""
        self._timer.stop()
        self.buttons["play"].setIcon(icon("play", self._colour))

    def _tick(self) -> None:
        last = len(self.store.session.frames) - 1
        if self.store.session.view.frame >= last:
            # The last step, too, was seen for its time.
            if self.loop.isChecked():
                self._clock.restart()
                self._owed = 0.0
                self.go(0)
            else:
                self.stop()
            return
        # A timer that comes a little early or late may not change the speed.
        self._owed += self._clock.restart() / self._step_ms()
        by = max(1, round(self._owed))
        self._owed -= by
        self.step(by)
        if self.store.session.view.frame >= last and not self.loop.isChecked():
            self.stop()
