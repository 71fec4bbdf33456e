"""The curve of a motion over the span, with points to drag: right is its value, up the span."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from qtpy.QtCore import QPointF, QRectF, QSize, Qt, Signal
from qtpy.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPalette, QPen, QPolygonF
from qtpy.QtWidgets import QWidget

from slideviz.case.motions.span import SpanMotion, curve_text, read_curve
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.widgets.build import set_policy, wrapped
from slideviz.gui.widgets.fields import short_text
from slideviz.machine.blade import curve_at
from slideviz.mesh.model import FloatArray
from slideviz.plots.ticks import round_step, tick_format, ticks
from slideviz.terms import SPAN_KINDS, SpanKind

Points = tuple[tuple[float, float], ...]
"""Points of a curve: pairs of span and value, the span ascending from 0 to 1."""

TIP = (
    "Drag a point: right for a larger value, up towards the shroud. A double click adds a point, "
    "Delete removes it. Keys: Page Up and Page Down choose a point, arrows move it (ten times as "
    "far with Shift), Insert adds one."
)
REACH = 9.0  # greatest distance of a click from the point that it takes, in pixels
LEFT = 42  # room around the axes, in pixels
RIGHT = 12
TOP = 10
BOTTOM = 20
APART = 0.01  # least distance of two points along the span, and the step of a span
MARGIN = 0.15  # room beside the outermost values, relative to their range
RANGES = {"°": 4.0, "length": 0.02, "factor": 0.2, "part": 0.1}
"""Least width of the axis of values, by their unit; of lengths over the mesh's extent."""
SMALLEST = 0.01  # factor of a chord that can be drawn
FINE = 100  # steps of a value within the width of the axes
SPANS = np.linspace(0.0, 1.0, 101)


class SpanCurveField(QWidget):
    """A field for the points of a curve over the span, changed by mouse or keys."""

    changed = Signal(object)  # SpanMotion
    """The motion with other points, at most once in a turn of the event loop."""
    dragging = Signal(bool)
    """A point is taken (True) or let go (False) by the mouse."""

    def __init__(self) -> None:
        super().__init__()
        self._motion: SpanMotion | None = None
        self._points: Points = ((0.0, 0.0), (1.0, 0.0))
        self._neutral = 0.0
        self._least = 1.0
        self._unit = ""
        self._extent = 1.0
        self._at = len(self._points) - 1  # the chosen point
        self._before: Points | None = None  # the points before a drag
        self._range = self._fit()
        self._soon = single_shot(self, self._emit)
        self.setMinimumSize(120, 96)
        set_policy(self, "Expanding", "Expanding")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setToolTip(wrapped(TIP))
        self.setAccessibleName("Curve over the span")

    def sizeHint(self) -> QSize:
        return QSize(240, 170)

    @property
    def value(self) -> Points:
        """Return the points, from hub to shroud."""
        return self._points

    def set_extent(self, extent: float) -> None:
        """Set the size of the mesh, beside which lengths are small."""
        self._extent = extent or 1.0

    def show_motion(self, motion: SpanMotion) -> None:
        """Show the curve of a motion; nothing is emitted, and a point that is dragged stays."""
        if self._before is not None or self._soon.isActive():
            return
        points = tuple(zip(motion.spans, motion.values, strict=True))
        if self._motion is None or len(points) != len(self._points):
            self._at = len(points) - 1
        self._motion = motion
        self._points = points
        term = SPAN_KINDS[motion.kind]
        self._neutral = term.neutral
        self._unit = term.unit if term.unit == "°" else ""
        self._least = RANGES[term.unit] * (self._extent if term.unit == "length" else 1.0)
        self._refit()

    def written(self, text: str) -> str:
        """Return the text of a curve as the motion would have it; CaseError if it is wrong."""
        assert self._motion is not None
        spans, values = read_curve(text)
        return curve_text(replace(self._motion, spans=spans, values=values))

    def change_kind(self, kind: SpanKind) -> None:
        """Emit a motion that changes something else, at rest: its values have another unit."""
        if self._motion is not None and kind != self._motion.kind:
            spans = (0.0,) if kind == "stagger" else (0.0, 1.0)
            values = (SPAN_KINDS[kind].neutral,) * len(spans)
            self.changed.emit(replace(self._motion, kind=kind, spans=spans, values=values))

    def _emit(self) -> None:
        assert self._motion is not None
        spans, values = zip(*self._points, strict=True)
        if self._motion.kind == "chord":
            values = tuple(max(value, SMALLEST) for value in values)
        self._motion = replace(self._motion, spans=spans, values=values)
        self.changed.emit(self._motion)

    # Places ----------------------------------------------------------------------------
    def _fit(self) -> tuple[float, float]:
        """Return the values at the ends of the axis: all points, the neutral one, and a margin."""
        shown = [value for _, value in self._points] + [self._neutral]
        room = max(MARGIN * (max(shown) - min(shown)), 0.5 * self._least)
        return min(shown) - room, max(shown) + room

    def _refit(self) -> None:
        self._range = self._fit()
        self._describe()

    def _describe(self) -> None:
        """Draw the points, and say where the chosen one is."""
        self.setAccessibleDescription(self._words())
        self.update()

    def _axes(self) -> QRectF:
        return QRectF(self.rect()).adjusted(LEFT, TOP, -RIGHT, -BOTTOM)

    def place(self, span: float, value: float) -> QPointF:
        """Return where in the widget a span and a value are."""
        axes = self._axes()
        low, high = self._range
        right = axes.left() + axes.width() * (value - low) / (high - low)
        return QPointF(right, axes.bottom() - axes.height() * span)

    def _under(self, at: QPointF) -> tuple[float, float]:
        """Return span and value at a place, the value in round steps."""
        axes = self._axes()
        low, high = self._range
        value = low + (high - low) * (at.x() - axes.left()) / max(axes.width(), 1.0)
        span = (axes.bottom() - at.y()) / max(axes.height(), 1.0)
        return min(max(round(span, 2), 0.0), 1.0), self._rounded(value)

    @property
    def _step(self) -> float:
        return round_step(self._range[1] - self._range[0], FINE)

    def _rounded(self, value: float) -> float:
        """Return a value in whole steps, without what rounding adds to its digits."""
        return float(f"{round(value / self._step) * self._step:.10g}") + 0.0

    # Changes ---------------------------------------------------------------------------
    def _set(self, points: Points, at: int) -> None:
        self._points = points
        self._at = at
        self._soon.start()
        self._describe()

    def _move(self, span: float, value: float) -> None:
        """Move the chosen point; along the span it stays between its neighbours."""
        points = list(self._points)
        at = self._at
        low = points[at - 1][0] + APART if at else 0.0
        high = points[at + 1][0] - APART if at + 1 < len(points) else 1.0
        if low <= high:
            points[at] = round(min(max(span, low), high), 10), value
            self._set(tuple(points), at)

    def _add(self, span: float, value: float) -> None:
        """Add a point, and choose it, unless one is there."""
        apart = all(abs(span - there) >= APART for there, _ in self._points)
        single = self._motion is not None and self._motion.kind == "stagger"
        if apart and not single:
            points = tuple(sorted((*self._points, (span, value))))
            self._set(points, points.index((span, value)))

    def _remove(self) -> None:
        if len(self._points) > 1:
            points = self._points[: self._at] + self._points[self._at + 1 :]
            self._set(points, min(self._at, len(points) - 1))

    def _insert(self) -> None:
        """Add a point on the curve, halfway from the chosen one to the next, or to the wall."""
        spans = [0.0, *(span for span, _ in self._points), 1.0]
        here = spans[self._at + 1]
        after = spans[self._at + 2]
        if after - here < 2.0 * APART and self._at:  # none above: below
            after = spans[self._at]
        span = round(0.5 * (here + after), 2)
        self._add(span, self._rounded(float(self._values(np.array([span]))[0])))

    def _values(self, spans: FloatArray) -> FloatArray:
        at, values = zip(*self._points, strict=True)
        return curve_at(at, values, spans)[0]

    # Mouse and keys --------------------------------------------------------------------
    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        gaps = [self.place(*point) - event.position() for point in self._points]
        away = [np.hypot(gap.x(), gap.y()) for gap in gaps]
        if min(away) <= REACH:
            self._at = int(np.argmin(away))
            self._before = self._points
            self.dragging.emit(True)
            self._describe()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._before is not None:
            self._move(*self._under(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._let_go()

    def _let_go(self) -> None:
        if self._before is None:
            return
        if self._soon.isActive():
            self._soon.stop()
            self._emit()
        self._before = None
        self._refit()
        self.dragging.emit(False)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._add(*self._under(event.position()))
            self.mousePressEvent(event)  # so that it can be dragged at once

    def keyPressEvent(self, event: QKeyEvent) -> None:
        span, value = self._points[self._at]
        far = 10.0 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1.0
        last = len(self._points) - 1
        keys = Qt.Key
        key = event.key()
        if key in (keys.Key_Left, keys.Key_Right):
            step = far * self._step * (1 if key == keys.Key_Right else -1)
            self._move(span, self._rounded(value + step))
        elif key in (keys.Key_Up, keys.Key_Down):
            self._move(span + far * APART * (1 if key == keys.Key_Up else -1), value)
        elif key in (keys.Key_PageUp, keys.Key_PageDown):
            self._at = min(max(self._at + (1 if key == keys.Key_PageUp else -1), 0), last)
        elif key in (keys.Key_Delete, keys.Key_Backspace):
            self._remove()
        elif key == keys.Key_Insert:
            self._insert()
        elif key == keys.Key_Escape and self._before is not None:
            self._set(self._before, min(self._at, len(self._before) - 1))
            self._let_go()
        else:
            super().keyPressEvent(event)
            return
        if self._before is None:
            self._refit()

    # Drawing ---------------------------------------------------------------------------
    def _words(self) -> str:
        """Return span and value of the chosen point in words."""
        span, value = self._points[self._at]
        return f"{100.0 * span:g} %: {short_text(value)}{self._unit}"

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        colors = self.palette()
        axes = self._axes()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(axes, colors.base())
        self._paint_ticks(painter, axes)
        values = self._values(SPANS)
        line = [self.place(*pair) for pair in zip(SPANS.tolist(), values.tolist(), strict=True)]
        painter.setPen(QPen(colors.highlight(), 2.0))
        painter.drawPolyline(QPolygonF(line))
        for at, point in enumerate(self._points):
            chosen = at == self._at
            painter.setBrush(colors.highlight() if chosen else colors.base())
            size = 5.0 if chosen and self.hasFocus() else 4.0
            painter.drawEllipse(self.place(*point), size, size)
        self._paint_words(painter, axes)
        painter.end()

    def _paint_ticks(self, painter: QPainter, axes: QRectF) -> None:
        colors = self.palette()
        flags = Qt.AlignmentFlag
        thin = QPen(colors.color(QPalette.ColorRole.Mid), 1.0)
        letters = QPen(colors.color(QPalette.ColorRole.Text))
        at = ticks(*self._range, max(2, int(axes.width() // 50)))
        form = tick_format(at) if len(at) > 1 else "%g"
        for value in at.tolist():
            x = self.place(0.0, value).x()
            painter.setPen(thin)
            painter.drawLine(QPointF(x, axes.top()), QPointF(x, axes.bottom()))
            painter.setPen(letters)
            room = QRectF(x - 30.0, axes.bottom() + 3.0, 60.0, BOTTOM - 3.0)
            painter.drawText(room, flags.AlignHCenter | flags.AlignTop, form % value)
        for span in (0.0, 0.5, 1.0):
            y = self.place(span, 0.0).y()
            painter.setPen(thin)
            painter.drawLine(QPointF(axes.left(), y), QPointF(axes.right(), y))
            painter.setPen(letters)
            room = QRectF(0.0, y - 8.0, LEFT - 4.0, 16.0)
            painter.drawText(room, flags.AlignRight | flags.AlignVCenter, f"{100 * span:.0f}%")
        frame = colors.color(
            QPalette.ColorRole.Highlight if self.hasFocus() else QPalette.ColorRole.Mid
        )
        painter.setPen(QPen(frame, 1.0))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(axes)
        painter.setPen(QPen(letters.color(), 1.0, Qt.PenStyle.DashLine))
        painter.drawLine(self.place(0.0, self._neutral), self.place(1.0, self._neutral))

    def _paint_words(self, painter: QPainter, axes: QRectF) -> None:
        """Write span and value beside the chosen point, on the side with more room."""
        place = self.place(*self._points[self._at])
        words = self._words()
        wide = painter.fontMetrics().horizontalAdvance(words)
        high = painter.fontMetrics().ascent()
        left = place.x() > axes.center().x()
        x = place.x() - wide - 9.0 if left else place.x() + 9.0
        y = min(max(place.y() + 0.4 * high, axes.top() + high), axes.bottom() - 3.0)
        back = QRectF(x - 2.0, y - high, wide + 4.0, high + 3.0)
        painter.fillRect(back, self.palette().base())
        painter.setPen(self.palette().color(QPalette.ColorRole.Text))
        painter.drawText(QPointF(x, y), words)
