"""A plot on which the mouse paints a range of values."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from qtpy.QtCore import QRectF, Qt, Signal
from qtpy.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen

from slideviz.color_scheme import SELECTED_COLOUR
from slideviz.gui.widgets.plot_canvas import PlotCanvas
from slideviz.gui.widgets.plot_image import Draw

GRIP_PX = 6
"""A press so near to an end of the range moves that end."""

Range = tuple[float, float]


class BrushCanvas(PlotCanvas):
    """A plot on which the mouse paints a range of values.

    Signals
    -------
    brushed(object)
        The range (low, high) that the mouse holds, or None for a click beside it.
    held(bool)
        The button is down, or up again.
    """

    brushed = Signal(object)
    held = Signal(bool)

    def __init__(self, drawing: Callable[[], Draw]) -> None:
        super().__init__(drawing)
        self.band: Range | None = None
        self._held: float | None = None
        self._moved = False
        self.setCursor(Qt.CursorShape.CrossCursor)
        self.setToolTip("Drag over values to show only the cells that have them; click to end it.")

    def value_at(self, x_px: float) -> float:
        """Return the value under a position of the mouse, within the axis."""
        return float(np.clip(self.to_value(x_px), *self.figure.axes[0].get_xlim()))

    def pixel_of(self, value: float) -> float:
        """Return the x of a value in pixels of the widget, within the axis."""
        return self.to_pixel(float(np.clip(value, *self.figure.axes[0].get_xlim())))

    def show_band(self, band: Range | None) -> None:
        """Show a range."""
        if band != self.band:
            self.band = band
            self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or not self.figure.axes:
            return
        x = event.position().x()
        self._held, self._moved = self.value_at(x), False
        if self.band is not None:
            ends = [self.pixel_of(value) for value in self.band]
            for near, far in ((0, 1), (1, 0)):
                if abs(x - ends[near]) <= GRIP_PX:
                    self._held, self._moved = self.band[far], True
        self.held.emit(True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._held is None:
            self._show_grip(event.position().x())
            return
        here = self.value_at(event.position().x())
        self._moved = self._moved or abs(self.pixel_of(self._held) - event.position().x()) > 3
        if self._moved:
            self.show_band((min(self._held, here), max(self._held, here)))
            self.brushed.emit(self.band)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self._held is not None:
            self._held = None
            if not self._moved:
                self.brushed.emit(None)
            self.held.emit(False)

    def mouseDoubleClickEvent(self, _event: QMouseEvent) -> None:
        self.brushed.emit(None)

    def _show_grip(self, x: float) -> None:
        ends = (self.band or ()) if self.figure.axes else ()
        near = any(abs(x - self.pixel_of(value)) <= GRIP_PX for value in ends)
        shape = Qt.CursorShape.SizeHorCursor if near else Qt.CursorShape.CrossCursor
        self.setCursor(shape)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self.band is None or not self.figure.axes:
            return
        left, right = (self.pixel_of(value) for value in self.band)
        top, height = self.axes_rows()
        painter = QPainter(self)
        colour = QColor(SELECTED_COLOUR)
        painter.setPen(QPen(colour, 2))
        colour.setAlpha(60)
        painter.fillRect(QRectF(left, top, right - left, height), colour)
        for x in (left, right):
            painter.drawLine(round(x), round(top), round(x), round(top + height))
        painter.end()
