"""Input fields for numbers, checked as they are typed, and for settings that are on or off."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import math
from collections.abc import Callable

from qtpy.QtCore import QEvent, QLocale, QSignalBlocker, Qt, Signal
from qtpy.QtGui import QFocusEvent, QKeyEvent, QMouseEvent, QWheelEvent
from qtpy.QtWidgets import (
    QApplication,
    QCheckBox,
    QLineEdit,
    QSpinBox,
    QWidget,
)

from slideviz.gui.widgets.arithmetic import typed_number
from slideviz.gui.widgets.build import set_style
from slideviz.gui.widgets.labels import wrapped
from slideviz.gui.widgets.services import main_window


def number_text(value: float) -> str:
    """Return a number as the shortest text that reads back as the same number."""
    text = repr(float(value))
    return text.removesuffix(".0")


SHORT = 8
"""Length of a text up to which a number is shown with all its digits."""

NOTHING = 1e-10
"""Ratio of a number to a scale below which it counts as a rounding error of zero."""


def short_text(value: float, scale: float = 0.0) -> str:
    """Return a number as text: ``0`` if tiny beside ``scale``, all digits if few, else six."""
    if abs(value) < NOTHING * abs(scale) or value == 0:
        return "0"
    exact = number_text(value)
    return exact if len(exact) <= SHORT else f"{float(value):.6g}"


def is_stray(event: QEvent, letters: str = "eE") -> bool:
    """Return whether an event is a key press of a letter not in ``letters``, without Ctrl or Alt.

    A number field leaves it to the window's shortcuts.
    """
    kinds = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress)
    if not isinstance(event, QKeyEvent) or event.type() not in kinds:
        return False
    plain = Qt.KeyboardModifier.ShiftModifier
    return event.text().isalpha() and event.text() not in letters and not event.modifiers() & ~plain


class NumberField(QLineEdit):
    """A field for a number, typed as such or as an expression, which its value then replaces.

    It shows six digits, and all of them while it is edited. An invalid text is marked at once. If
    the text is invalid when the field is left, the number from before the editing comes back (not
    a valid beginning of what was typed), and the status bar says so.

    Parameters
    ----------
    value : float
    allowed : callable, optional
        Returns why a value is not allowed; empty if it is.
    tip : str

    Attributes
    ----------
    fault : str
        Why the field is marked as invalid; empty if it is not.
    together : str
        Why it is invalid together with the fields beside it, set by these.

    Signals
    -------
    changed(float)
        The new number after each valid edit.
    marked()
        ``fault`` has changed.
    """

    changed = Signal(float)
    marked = Signal()

    def __init__(
        self,
        value: float = 0.0,
        allowed: Callable[[float], str] | None = None,
        tip: str = "",
    ) -> None:
        super().__init__(short_text(value))
        self._allowed = allowed or (lambda _: "")
        self._value = self._before = float(value)
        self._scale = 0.0
        self._tip, self.fault, self.together = tip, "", ""
        self.setToolTip(wrapped(tip))
        self._whole = False
        self._twice_ms = float("-inf")
        self.setCursorPosition(0)
        self.setMinimumWidth(46)
        self.setLocale(QLocale.c())
        self.textEdited.connect(self._edited)
        self.editingFinished.connect(self._tidy)

    @property
    def value(self) -> float:
        """Return the last valid number."""
        return self._value

    @property
    def problem(self) -> str:
        """Return why the text is invalid; empty if it is valid."""
        if self.text() in (number_text(self._value), short_text(self._value, self._scale)):
            return self._allowed(self._value)
        if not self.text().strip():
            return "a number is needed"
        try:
            value = typed_number(self.text())
        except ValueError:
            return f"“{self.text()}” is not a number"
        if not math.isfinite(value):
            return "the number must be finite"
        return self._allowed(value)

    def set_tip(self, text: str) -> None:
        """Set the tooltip, which is shown while the value is valid."""
        self._tip = text
        self.mark()

    def set_scale(self, scale: float) -> None:
        """Set the length beside which rounding errors are shown as 0 (see `short_text`)."""
        if scale != self._scale:
            self._scale = scale
            if not (self.hasFocus() or self.isModified()):
                self._write()

    def show_value(self, value: float) -> None:
        """Set the number; nothing is emitted, and a text of the same value stays."""
        if value == self._value and (self.hasFocus() or self.isModified() or not self.problem):
            return
        if not (self.hasFocus() and self.isModified()):
            self._before = float(value)
        self._value = float(value)
        self._write()
        self.mark()

    def _write(self) -> None:
        """Set the text to the value, all digits while it is edited, the first digits in view."""
        exact = self.hasFocus() and not self.isReadOnly()
        text = number_text(self._value) if exact else short_text(self._value, self._scale)
        if text != self.text():
            self.setText(text)
        if not exact:
            self.setCursorPosition(0)

    def event(self, event: QEvent) -> bool:
        if is_stray(event):
            event.ignore()
            return False
        return super().event(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        if not self.problem:
            self._before = self._value
            self._write()
        super().focusInEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        # Qt selects a word, which ends at a decimal point: only half of a number.
        if event.button() == Qt.MouseButton.LeftButton:
            self.selectAll()
            self._whole = True
            self._twice_ms = event.timestamp()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        # A triple click selects the whole number, too.
        soon = event.timestamp() - self._twice_ms < QApplication.doubleClickInterval()
        if event.button() == Qt.MouseButton.LeftButton and soon:
            self.selectAll()
            self._whole = True
            return
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if not self._whole:  # a small movement in a double click must not change the selection
            super().mouseMoveEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._whole = False
        super().mouseReleaseEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.setModified(False)
        if not self.problem:
            self._write()

    def _edited(self) -> None:
        if not self.problem:
            self._value = typed_number(self.text())
            # Before `mark`: who listens to ``marked`` shows the value, and needs the new one.
            self.changed.emit(self._value)
        self.mark()

    def _tidy(self) -> None:
        """Keep a valid number when the editing is finished, or restore the one before."""
        if not self.problem:
            self._before = self._value
            return
        window = main_window(self)
        if window is not None:
            back = short_text(self._before, self._scale)
            window.say(f"Not taken: {self.problem}; {back} is there again.")
        typed, self._value = self._value, self._before
        self._write()
        if typed != self._value:
            self.changed.emit(self._value)
        self.mark()

    def mark(self) -> None:
        """Mark the field as invalid, with the reason as tooltip, or as valid again."""
        problem = self.problem or self.together
        self.setToolTip(wrapped(problem or self._tip))
        set_style(self, "bad", bool(problem))
        if problem != self.fault:
            self.fault = problem
            self.marked.emit()


class NumberBox(QSpinBox):
    """A spin box for a whole number; without digits it is marked as invalid, as `NumberField` is.

    The wheel does not change it. Typing the first letter of the text for the lowest value (such as
    ``automatic``) selects that value. ``letters`` are the other letters its texts may contain.
    """

    marked = Signal()
    letters = ""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.fault = ""
        # No single signal covers each change of the text, by the user or by the program.
        for change in (self.lineEdit().textChanged, self.editingFinished, self.valueChanged):
            change.connect(lambda *_: self._look())

    def event(self, event: QEvent) -> bool:
        if is_stray(event, self.letters + self.specialValueText()):
            event.ignore()
            return False
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.text() and self.specialValueText().startswith(event.text()):
            self.setValue(self.minimum())
            self.selectAll()
        else:
            super().keyPressEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()

    def show_value(self, value: int) -> None:
        """Set the number; nothing is emitted."""
        if self.value() != value:
            with QSignalBlocker(self):
                self.setValue(value)

    def _look(self) -> None:
        fault = "" if self.lineEdit().hasAcceptableInput() else "a number is needed"
        if fault != self.fault:
            self.fault = fault
            set_style(self, "bad", bool(fault))
            self.marked.emit()


class Switch(QCheckBox):
    """A check box for a setting, with the methods that a `KeyForm` needs."""

    def show_value(self, on: bool) -> None:
        """Show whether the setting is on."""
        self.setChecked(on)


def not_zero(value: float) -> str:
    """Return why a factor may not be zero; empty for other values."""
    return "" if value else "0 would flatten the boundary"
