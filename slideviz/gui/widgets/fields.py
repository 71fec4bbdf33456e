"""Input fields for texts and numbers, alone or in twos and threes, checked as they are typed."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from itertools import chain
from typing import Any

from qtpy.QtCore import QEvent, QLocale, QSignalBlocker, Qt, Signal, SignalInstance
from qtpy.QtGui import QFocusEvent, QKeyEvent, QKeySequence, QMouseEvent, QValidator, QWheelEvent
from qtpy.QtWidgets import QApplication, QLabel, QLineEdit, QSpinBox, QWidget

from slideviz.errors import ROUNDING, SlidevizError
from slideviz.gui.widgets.build import in_row, set_policy, set_style, wrapped
from slideviz.gui.widgets.services import main_window

_ALLOWED = re.compile(r"[\d.eE+\-*/() ]+\Z")  # the letters that an expression may have
_OPERATIONS: dict[type[ast.AST], Callable[..., float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def typed_number(text: str) -> float:
    """Return the value of a text such as ``2.5``, ``2,5`` or ``360/7 + 1``.

    Raises ValueError if the text is not a number or an expression of ``+ - * / ( )``.
    """
    plain = text.strip().replace(",", ".")
    try:
        return float(plain)
    except ValueError:
        if not _ALLOWED.match(plain):
            raise
    try:
        return _value(ast.parse(plain, mode="eval").body)
    except (SyntaxError, ArithmeticError, RecursionError, MemoryError) as problem:
        raise ValueError(f"{text!r} is not a number") from problem


def _value(node: ast.expr) -> float:
    """Return the value of a node of the parsed expression; raise ValueError for other nodes."""
    match node:
        case ast.Constant(value):
            return float(value)  # type: ignore[arg-type]  # only digits came here
        case ast.UnaryOp(op, value) if type(op) in _OPERATIONS:
            return _OPERATIONS[type(op)](_value(value))
        case ast.BinOp(left, op, right) if type(op) in _OPERATIONS:
            return _OPERATIONS[type(op)](_value(left), _value(right))
    raise ValueError("is not a number")


def number_text(value: float) -> str:
    """Return a number as the shortest text that reads back as the same number."""
    text = repr(float(value))
    return text.removesuffix(".0")


SHORT = 8  # length of a text up to which a number is shown with all its digits


def short_text(value: float, scale: float = 0.0) -> str:
    """Return a number as text: ``0`` if tiny beside ``scale``, all digits if few, else six."""
    if abs(value) < ROUNDING * abs(scale) or value == 0:
        return "0"
    exact = number_text(value)
    return exact if len(exact) <= SHORT else f"{float(value):.6g}"


INVALID = "Invalid: "  # start of the status bar's message on an invalid text


def _report_restored(field: QWidget, problem: str, value: str) -> None:
    """Say in the status bar that a field was left with an invalid text."""
    window = main_window(field)
    if window is not None:
        window.show_status(f"{INVALID}{problem}; the value is still {value}.")


def _clear_report(field: QWidget) -> None:
    """Take away the message of `_report_restored`, as the text is no longer invalid."""
    window = main_window(field)
    if window is not None and window.statusBar().currentMessage().startswith(INVALID):
        window.show_status("")


def _undo_in_field(field: QLineEdit, event: QEvent) -> bool | None:
    """Undo or redo in a field on Ctrl+Z or Ctrl+Y, while there is something of its own.

    Returns whether there was; None for other events. What is not its own is left to the window. On
    Linux Qt does again by Ctrl+Shift+Z only, and the window would take Ctrl+Y.
    """
    kinds = (QEvent.Type.ShortcutOverride, QEvent.Type.KeyPress)
    if event.type() not in kinds or not isinstance(event, QKeyEvent):
        return None
    undoes = event.matches(QKeySequence.StandardKey.Undo)
    ctrl_y = (Qt.Key.Key_Y, Qt.KeyboardModifier.ControlModifier)
    redoes = event.matches(QKeySequence.StandardKey.Redo)
    if not (undoes or redoes or (event.key(), event.modifiers()) == ctrl_y):
        return None
    available = field.isUndoAvailable() if undoes else field.isRedoAvailable()
    event.setAccepted(available)
    if not available:
        _clear_undo(field)  # what was typed here before is older than what the window does now
    elif event.type() == QEvent.Type.KeyPress:
        with _as_undo(field):
            (field.undo if undoes else field.redo)()
    return available


def _clear_undo(field: QLineEdit) -> None:
    if field.isUndoAvailable() or field.isRedoAvailable():
        field.setText(field.text())


def _as_undo(field: QWidget) -> AbstractContextManager[None]:
    """Let the session take a value that it had before as its own undo, not as a new change."""
    window = main_window(field)
    return nullcontext() if window is None else window.store.reverting()


class TextField(QLineEdit):
    """A field for a text, in which Ctrl+Z and Ctrl+Y act first on what is typed."""

    def event(self, event: QEvent) -> bool:
        handled = _undo_in_field(self, event)
        return super().event(event) if handled is None else handled


class CheckedField(TextField):
    """The base of fields whose text may be invalid: it is marked then, and Escape replaces it.

    The value is then the one from before the editing, not a valid beginning of what was typed.
    """

    changed: SignalInstance
    """The new value after each valid edit."""
    marked = Signal()
    """``fault`` has changed."""

    def __init__(self, text: str, value: Any, tip: str) -> None:
        super().__init__(text)
        self._tip = tip
        self._value = self._before = value
        self.fault = ""  # why the field is marked as invalid; empty if it is not
        self.together = ""  # why it is invalid together with the fields beside it, set by these
        self.setToolTip(wrapped(tip))
        self.textEdited.connect(self._edited)
        self.editingFinished.connect(self._finish)

    @property
    def value(self) -> Any:
        """Return the last valid value."""
        return self._value

    @property
    def problem(self) -> str:
        """Return why the text is invalid; empty if it is valid."""
        raise NotImplementedError

    def restore(self) -> None:
        """Replace an invalid text by the last valid one; nothing is emitted."""
        if self.fault:
            self._write()
            self.mark()

    def _write(self) -> None:
        self.setText(self._text())
        self.setCursorPosition(0)

    def _typed(self) -> Any:
        """Return the value of a valid text."""
        raise NotImplementedError

    def _text(self) -> str:
        """Return the text of the value."""
        return str(self._value)

    def _edited(self) -> None:
        if self.problem:
            self._revert_text()
        else:
            self._value = self._typed()
            # Before `mark`: who listens to ``marked`` shows the value, and needs the new one.
            self.changed.emit(self._value)
        self.mark()

    def _finish(self) -> None:
        """Keep a valid text when the editing ends; of an invalid one, the value before it."""
        if not self.problem:
            self._before = self._value
            return
        self._revert_text()
        _report_restored(self, self.problem, self._text())
        self.mark()

    def _revert_text(self) -> None:
        """Take back a valid beginning of a text that is not valid."""
        if self._value != self._before:
            self._value = self._before
            with _as_undo(self):
                self.changed.emit(self._value)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self.problem:
            self._finish()
            self.restore()
        else:
            super().keyPressEvent(event)

    def mark(self) -> None:
        """Mark the field as invalid, with the reason as tooltip, or as valid again."""
        _mark(self)


class CheckedText(CheckedField):
    """A field for a text that may be wrong.

    ``read`` returns a text as it is written, or raises a SlidevizError that says what is wrong.
    """

    changed = Signal(str)

    def __init__(self, tip: str = "") -> None:
        super().__init__("", "", tip)
        self.read: Callable[[str], str] = str

    @property
    def problem(self) -> str:
        try:
            self.read(self.text())
        except SlidevizError as problem:
            return str(problem)
        return ""

    def show_value(self, text: str) -> None:
        """Set the text; nothing is emitted, and what is typed of the same value stays."""
        same = text == self._value and self.isModified()
        self._value = text
        if not same:
            self._before = text
            self._write()
            self.mark()

    def _typed(self) -> str:
        return self.read(self.text())


class NumberField(CheckedField):
    """A field for a number, typed as such or as an expression, which its value then replaces.

    It shows six digits, and all of them while it is edited. An invalid text is marked at once, and
    stays when the field is left. ``allowed``: returns why a value is not allowed; empty if it is.
    ``words``: texts for some values; the first letters of one are enough to type it.
    """

    changed = Signal(float)

    def __init__(
        self,
        value: float = 0.0,
        allowed: Callable[[float], str] | None = None,
        tip: str = "",
        words: Mapping[float, str] | None = None,
    ) -> None:
        self._words = words or {}
        super().__init__(self._words.get(value, short_text(value)), float(value), tip)
        self._allowed = allowed or (lambda _: "")
        self._scale = 0.0
        self.extent = 10.0  # beside which a step from 0 is a hundredth
        self._whole = False
        self._twice_ms = float("-inf")
        self.setCursorPosition(0)
        self.setMinimumWidth(46)
        self.setLocale(QLocale.c())

    @property
    def _shows_value(self) -> bool:
        return self.text() in (self._text(exact=True), self._text())

    @property
    def problem(self) -> str:
        if self._shows_value:
            return self._allowed(self._value)
        if not self.text().strip():
            return "a number is needed"
        try:
            value = self._typed()
        except ValueError:
            return f"“{self.text()}” is not a number"
        if not math.isfinite(value):
            return "the number must be finite"
        return self._allowed(value)

    def _typed(self) -> float:
        start = self.text().strip().lower()
        for value, word in self._words.items():
            if start and word.startswith(start):
                return value
        return typed_number(self.text())

    def _text(self, *, exact: bool = False) -> str:
        """Return the text of the value: its word, or its first digits, or all with ``exact``."""
        digits = number_text(self._value) if exact else short_text(self._value, self._scale)
        return self._words.get(self._value, digits)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        way = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1}.get(Qt.Key(event.key()), 0)
        if not way or self.problem or self._words or self.isReadOnly():
            super().keyPressEvent(event)
            return
        fine = 10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
        # By the value before the editing: steps that shrink with the value would not reach 0.
        size = abs(self._before) or 0.1 * self.extent
        unit = 10.0 ** (math.floor(math.log10(size)) - 1) / fine
        self.setText(number_text(float(f"{round(self._value / unit + way) * unit:.12g}")))
        self.setModified(True)
        self._edited()

    def set_tip(self, text: str) -> None:
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
        text = self._text(exact=exact)
        if text != self.text():
            self.setText(text)
        if not exact:
            self.setCursorPosition(0)

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
        if not self.problem:
            self.setModified(False)
            _clear_undo(self)
            self._write()


class NumberBox(QSpinBox):
    """A spin box for a whole number, which keeps and marks an invalid text as `NumberField` does.

    The wheel does not change it. The text for the lowest value (such as ``automatic``) is completed
    as it is typed.
    """

    marked = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._tip = self.fault = self.together = ""
        self._before = self.value()
        # No single signal covers each change of the text, by the user or by the program.
        for change in (self.lineEdit().textChanged, self.editingFinished, self.valueChanged):
            change.connect(lambda *_: _mark(self))

    def validate(self, text: str, at: int) -> tuple[QValidator.State, str, int]:
        """Accept every character, so that 2.5 is not typed as 25."""
        state = super().validate(text, at)[0]
        good = state == QValidator.State.Acceptable
        return (state if good else QValidator.State.Intermediate), text, at

    @property
    def problem(self) -> str:
        """Return why the text is invalid; empty if it is valid."""
        if self.hasAcceptableInput():
            return ""
        text = self.cleanText().strip()
        low = self.minimum() + bool(self.specialValueText())
        span = f"a whole number from {low:,} to {self.maximum():,}"
        return f"“{text}” is not {span}" if text else "a number is needed"

    def restore(self) -> None:
        """Replace an invalid text by the value; nothing is emitted."""
        if self.fault:
            with QSignalBlocker(self):
                self.setValue(self.value())
            _mark(self)

    def event(self, event: QEvent) -> bool:
        handled = _undo_in_field(self.lineEdit(), event)
        return super().event(event) if handled is None else handled

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if self.fault and event.key() == Qt.Key.Key_Escape:
            self.setValue(self._before)
            _mark(self)
        # Return would replace an invalid text by a number that nobody typed.
        elif not self.fault or event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            super().keyPressEvent(event)
        typed = self.text()
        word = self.specialValueText()
        if event.text().isalpha() and typed and word.startswith(typed):
            # The beginning of the text for the lowest value; what is added is selected.
            self.setValue(self.minimum())
            self.lineEdit().setSelection(len(typed), len(word))
            _mark(self)

    def focusInEvent(self, event: QFocusEvent) -> None:
        if not self.fault:
            self._before = self.value()
        super().focusInEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        typed = self.text()
        bad = self.fault
        super().focusOutEvent(event)
        _clear_undo(self.lineEdit())
        if bad:
            self.setValue(self._before)
            _report_restored(self, bad, self.text())
            self.lineEdit().setText(typed)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()

    def show_value(self, value: int) -> None:
        """Set the number; nothing is emitted."""
        if self.value() != value:
            with QSignalBlocker(self):
                self.setValue(value)
            _mark(self)

    def set_tip(self, text: str) -> None:
        self._tip = text
        _mark(self)


def _mark(field: CheckedField | NumberBox) -> None:
    """Mark a field as invalid, with the reason as tooltip, or as valid again."""
    problem = field.problem or field.together
    field.setToolTip(wrapped(problem or field._tip))
    set_style(field, "bad", bool(problem))
    if problem != field.fault:
        field.fault = problem
        if not problem:
            _clear_report(field)
        field.marked.emit()


def unless(holds: Callable[[Any], object], why: str) -> Callable[[Any], str]:
    """Return a check of a value, which returns ``why``, or an empty text where it holds."""
    return lambda value: "" if holds(value) else why


class VectorField(QWidget):
    """A row of fields for two or three numbers.

    ``allowed`` returns why the numbers are not valid together, or an empty text. While they are
    not, they are marked and ``changed`` is not emitted.
    """

    changed = Signal(tuple)

    def __init__(
        self,
        values: Sequence[float] = (0.0, 0.0, 0.0),
        allowed: Callable[[Sequence[float]], str] | None = None,
        names: Sequence[str] = "xyz",
        tip: str = "",
    ) -> None:
        super().__init__()
        self._allowed = allowed or (lambda _: "")
        self.fields = [NumberField(value, tip=tip) for value in values]
        self._labels = [QLabel(name) for name in names]
        for label, field in zip(self._labels, self.fields, strict=True):
            field.setAccessibleName(label.text())
            field.changed.connect(lambda _: self._emit_changed())
        pairs = chain(*zip(self._labels, self.fields, strict=True))
        line = in_row(*pairs, wide=self.fields, spacing=4)
        line.setContentsMargins(0, 0, 0, 0)
        self.setLayout(line)
        self.count = len(self.fields)
        self._good = self.value
        self._scale = 0.0
        self._compare()
        set_policy(self, "Expanding", "Fixed")

    @property
    def value(self) -> tuple[float, ...]:
        """Return the numbers, as many as the mesh has dimensions."""
        return tuple(field.value for field in self.fields[: self.count])

    @property
    def problem(self) -> str:
        """Return why the numbers are not valid together; empty if they are."""
        return self._allowed(self.value)

    def _emit_changed(self) -> None:
        if not self.problem:
            self._good = self.value
            self.changed.emit(self.value)
        self._mark()

    def restore(self) -> None:
        """Replace invalid texts by the last valid numbers, without emitting a signal."""
        for field in self.fields:
            field.restore()
        self._write(self._good)

    def _mark(self) -> None:
        for field in self.fields:
            field.together = self.problem
            field.mark()

    def set_count(self, count: int) -> None:
        """Show only the first ``count`` numbers."""
        self.count = count
        for index, (label, field) in enumerate(zip(self._labels, self.fields, strict=True)):
            label.setVisible(index < count)
            field.setVisible(index < count)

    def set_scale(self, scale: float) -> None:
        """Set the length beside which rounding errors are shown as 0."""
        self._scale = scale
        self._compare()

    def show_value(self, values: Sequence[float]) -> None:
        """Set the numbers; nothing is emitted, and invalid numbers being typed stay."""
        if not (self.problem and tuple(values) == self._good):
            self._write(values)

    def _write(self, values: Sequence[float]) -> None:
        self._good = tuple(values)
        for field, value in zip(self.fields, values, strict=False):
            field.show_value(value)
        self._compare()
        self._mark()

    def _compare(self) -> None:
        """Make each field show 0 for a rounding error, compared with the largest number."""
        scale = max(self._scale, *(abs(field.value) for field in self.fields))
        for field in self.fields:
            field.set_scale(scale)

    def set_tip(self, text: str) -> None:
        for field in self.fields:
            field.set_tip(text)
        self._mark()


a_direction = unless(any, "an axis needs a direction: not all may be 0")
"""The check of an axis."""
control_point_problem = unless(
    lambda values: all(value == int(value) and value >= -1 for value in values),
    "expected whole numbers from 0, or -1 for all",
)
"""The check of the index of a control point."""
