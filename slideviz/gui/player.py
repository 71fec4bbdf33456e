"""The step player under the view, and the line with the quality of the step that is shown."""

from __future__ import annotations

from qtpy.QtCore import QElapsedTimer, Qt, QTimer
from qtpy.QtWidgets import QHBoxLayout, QLabel, QSlider, QToolButton, QWidget

from slideviz.gui.icons import icon
from slideviz.view import changes
from slideviz.view.state import Session
from slideviz.view.store import Store

INTERVAL_MS = 100
"""Between two steps; where drawing takes longer, steps are left out."""


class Player(QWidget):
    """First, back, play, forward, last, a slider, and the numbers of the step."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 3, 8, 3)
        row.setSpacing(1)
        self.buttons: dict[str, QToolButton] = {}
        for name, tip, function in (
            ("first", "Undeformed mesh (Home)", lambda: self.go(0)),
            ("previous", "One step back (←)", lambda: self.step(-1)),
            ("play", "Play the steps (Space)", self.toggle),
            ("next", "One step on (→)", lambda: self.step(1)),
            ("last", "Last step (End)", lambda: self.go(10**9)),
        ):
            button = QToolButton()
            button.setObjectName(f"player_{name}")
            button.setIcon(icon(name))
            button.setToolTip(tip)
            button.clicked.connect(function)
            self.buttons[name] = button
            row.addWidget(button)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setObjectName("steps_slider")
        self.slider.setMinimumWidth(60)
        self.slider.setMaximumWidth(320)
        self.slider.setPageStep(1)
        self.slider.valueChanged.connect(self.go)
        row.addSpacing(6)
        row.addWidget(self.slider, 2)
        self.step_text = QLabel()
        self.step_text.setMinimumWidth(82)
        row.addSpacing(6)
        row.addWidget(self.step_text)
        self.result = QLabel()
        self.result.setTextFormat(Qt.TextFormat.RichText)
        self.result.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.result.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        row.addWidget(self.result, 3)
        self._timer = QTimer(self)
        self._timer.setInterval(INTERVAL_MS)
        self._timer.timeout.connect(self._tick)
        self._clock = QElapsedTimer()
        self._mesh: object = None
        self._colour = "#3b4652"
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)

    def set_icon_colour(self, colour: str) -> None:
        """Redraw the icons in another colour."""
        self._colour = colour
        for name, button in self.buttons.items():
            button.setIcon(icon(name, colour))

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
            enabled = last > 0 and (name == "play" or (at < last if ahead else at > 0))
            button.setEnabled(enabled)
        if session.mesh is None:
            self.step_text.setText("")
        else:
            self.step_text.setText(f"Step {at} of {last}" if at else "Undeformed")
        self._tell(session)
        if not last:
            self.stop()

    def _tell(self, session: Session) -> None:
        """Show the numbers; what they need of room they keep, or the view would change its size."""
        if session.mesh is not self._mesh:
            self._mesh = session.mesh
            self.result.setMinimumWidth(0)
        self.result.setText(result_text(session))
        wanted = self.result.minimumSizeHint().width()
        self.result.setMinimumWidth(max(wanted, self.result.minimumWidth()))

    def go(self, index: int) -> None:
        """Show a step; 0 is the undeformed mesh."""
        self.store.change(changes.show_frame, index)

    def step(self, by: int) -> None:
        """Show the step before or after."""
        self.go(self.store.session.view.frame + by)

    def toggle(self) -> None:
        """Play, or stop playing."""
        if self._timer.isActive():
            self.stop()
        elif len(self.store.session.frames) > 1:
            if self.store.session.view.frame >= len(self.store.session.frames) - 1:
                self.go(0)
            self._timer.start()
            self._clock.start()
            self.buttons["play"].setIcon(icon("pause", self._colour))

    def stop(self) -> None:
        """Stop playing."""
        self._timer.stop()
        self.buttons["play"].setIcon(icon("play", self._colour))

    def _tick(self) -> None:
        self.step(max(1, round(self._clock.restart() / self._timer.interval())))
        if self.store.session.view.frame >= len(self.store.session.frames) - 1:
            self.stop()


def result_text(session: Session) -> str:
    """Return the numbers of the step that is shown: quality, inverted cells, seconds."""
    frame = session.frame
    if frame is None:
        return ""
    quality = frame.quality
    parts = []
    if session.ran is not None and not session.ran.steps and session.deformed is not None:
        count = len(session.frames) - 1
        parts.append(f"automatic: <b>{count}</b> step{'s' if count > 1 else ''}")
    parts += [f"min <b>{quality.min:.4f}</b>", f"mean <b>{quality.mean:.4f}</b>"]
    bad = quality.inverted
    colour = " style='color:#e8112d'" if bad else ""
    parts.append(f"<span{colour}><b>{bad:,}</b> inverted</span>")
    if frame.step is not None:
        seconds = sum(sum(f.step.seconds.values()) for f in session.frames if f.step is not None)
        parts.append(f"<b>{seconds:.2f}</b> s")
    return "&nbsp;· ".join(parts)
