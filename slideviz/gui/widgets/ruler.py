"""Rulers beside a flat view: ticks, numbers and the name of an axis."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import math

from qtpy.QtCore import QRectF, Qt
from qtpy.QtGui import QPainter, QPaintEvent, QPalette
from qtpy.QtWidgets import QWidget

from slideviz.plots.ticks import ticks


class Ruler(QWidget):
    """The ruler of one axis of a flat view.

    ``upright``: vertical, left of the view; otherwise horizontal, below it.
    """

    def __init__(self, upright: bool) -> None:
        super().__init__()
        self.upright = upright
        self.low, self.high, self.name = 0.0, 1.0, ""
        if upright:
            self.setFixedWidth(58)
        else:
            self.setFixedHeight(34)

    def show_range(self, low: float, high: float, name: str) -> None:
        """Set the ends of the axis and its name."""
        if (low, high, name) != (self.low, self.high, self.name):
            self.low, self.high, self.name = low, high, name
            self.update()

    def ticks(self) -> list[float]:
        """Return the values of the ticks, ascending."""
        length = self.height() if self.upright else self.width()
        room, least = (34, 15) if self.upright else (70, 50)
        most = max(length // room, 2)
        ticks = nice_ticks(self.low, self.high, most)
        for more in range(most + 1, most + 6):
            # One tick does not show the scale: try closer ones, if their numbers do not touch.
            if len(ticks) > 1:
                break
            closer = nice_ticks(self.low, self.high, more)
            apart = closer[1] - closer[0] if len(closer) > 1 else 0.0
            if apart * length >= least * (self.high - self.low):
                ticks = closer
        return ticks

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().color(QPalette.ColorRole.WindowText))
        font = painter.font()
        font.setPointSizeF(max(font.pointSizeF() - 1.0, 7.0))
        painter.setFont(font)
        ticks = self.ticks()
        step = ticks[1] - ticks[0] if len(ticks) > 1 else self.high - self.low
        for value in ticks:
            share = (value - self.low) / (self.high - self.low)
            self._draw_tick(painter, share, tick_text(value, step))
        self._draw_name(painter)
        painter.end()

    def _draw_tick(self, painter: QPainter, share: float, text: str) -> None:
        wide, high = self.width(), self.height()
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        if self.upright:
            y = high * (1.0 - share)
            painter.drawLine(wide - 4, round(y), wide - 1, round(y))
            top = min(max(y - 8.0, 0.0), high - 16.0)
            painter.drawText(QRectF(14, top, wide - 20, 16), right, text)
        else:
            x = wide * share
            painter.drawLine(round(x), 0, round(x), 3)
            # Near an end the number is shifted, so that it is not cut off.
            half = painter.fontMetrics().horizontalAdvance(text) / 2.0 + 1.0
            middle = min(max(x, half), wide - half)
            box = QRectF(middle - 35, 3, 70, 15)
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    def _draw_name(self, painter: QPainter) -> None:
        centre = Qt.AlignmentFlag.AlignCenter
        if not self.upright:
            painter.drawText(QRectF(0, 17, self.width(), 16), centre, self.name)
            return
        painter.translate(8, self.height() / 2.0)
        painter.rotate(-90)
        painter.drawText(QRectF(-self.height() / 2.0, -8, self.height(), 16), centre, self.name)


def nice_ticks(low: float, high: float, most: int) -> list[float]:
    """Return ascending round numbers in a range, at most ``most`` + 1; none if it is invalid."""
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        return []
    return ticks(low, high, most).tolist()


def tick_text(value: float, step: float) -> str:
    """Return a tick's number with as many decimals as the distance of the ticks needs."""
    if abs(value) < 1e-9 * step:
        return "0"
    size = max(abs(value), step)
    if not 1e-4 <= size < 1e5:
        return f"{value:.4g}"
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    # A step of 0.25 needs one decimal more than 0.1.
    exact = abs(round(step, digits) - step) < 1e-6 * step
    return f"{value:.{digits + (not exact)}f}"
