"""The histogram panel: cells by quality, and a brush that sets the threshold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from qtpy.QtCore import QRectF, Qt, Signal
from qtpy.QtGui import QColor, QKeySequence, QMouseEvent, QPainter, QPaintEvent, QPen, QShortcut
from qtpy.QtWidgets import QLabel

from slideviz.color_scheme import SELECTED_COLOR
from slideviz.gui.responsiveness.timers import SELECTING_MS, single_shot
from slideviz.gui.widgets.build import TwoPartRow, check_box, in_column, push_button
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import Draw, PlotArea, PlotCanvas
from slideviz.gui.widgets.theme import alarm
from slideviz.plots.session_plots import (
    draw_histogram,
    first_value,
    shown_measure,
    whole_range,
)
from slideviz.sections.polygons import ONLY_INVERTED, cells_in_range, range_words
from slideviz.session import changes
from slideviz.session.state import Session
from slideviz.terms import RANKED, SIZE_SKEW, WALL_VALUES, Range

END_PX = 6  # distance in pixels up to which a press moves an end of the range


BRUSH = "Drag over values to show only the cells that have them; click to end it."


class BrushCanvas(PlotCanvas):
    """A histogram on which the mouse selects a range of values."""

    brushed = Signal(object)
    """The selected range (low, high); None for a click or double click, which ends it."""
    dragging = Signal(bool)
    """True when the mouse button is pressed, False when it is released."""

    def __init__(self, drawing: Callable[[], Draw]) -> None:
        super().__init__(drawing)
        self.band: Range | None = None
        self._pressed: float | None = None
        self._moved = False
        self.setCursor(Qt.CursorShape.CrossCursor)
        self.setToolTip(BRUSH)
        self.locked = False

    def value_at(self, x_px: float) -> float:
        """Return the value at a horizontal position in the widget, clipped to the axis."""
        return float(np.clip(self.to_value(x_px), *self.figure.axes[0].get_xlim()))

    def pixel_of(self, value: float) -> float:
        """Return the horizontal pixel in the widget of a value, clipped to the axis."""
        return self.to_pixel(float(np.clip(value, *self.figure.axes[0].get_xlim())))

    def show_band(self, band: Range | None) -> None:
        """Show a range of values as selected; None for no range."""
        if band != self.band:
            self.band = band
            self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or not self.figure.axes or self.locked:
            return
        x = event.position().x()
        self._pressed = self.value_at(x)
        self._moved = False
        if self.band is not None:
            ends = [self.pixel_of(value) for value in self.band]
            for near, far in ((0, 1), (1, 0)):
                if abs(x - ends[near]) <= END_PX:
                    self._pressed = self.band[far]
                    self._moved = True
        self.dragging.emit(True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed is None:
            ends = (self.band or ()) if self.figure.axes else ()
            near = any(abs(event.position().x() - self.pixel_of(value)) <= END_PX for value in ends)
            shape = Qt.CursorShape.SizeHorCursor if near else Qt.CursorShape.CrossCursor
            self.setCursor(shape)
            return
        here = self.value_at(event.position().x())
        self._moved = self._moved or abs(self.pixel_of(self._pressed) - event.position().x()) > 3
        if self._moved:
            self.show_band((min(self._pressed, here), max(self._pressed, here)))
            self.brushed.emit(self.band)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton and self._pressed is not None:
            self._pressed = None
            if not self._moved:
                self.brushed.emit(None)
            self.dragging.emit(False)

    def mouseDoubleClickEvent(self, _event: QMouseEvent) -> None:
        self.brushed.emit(None)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self.band is None or not self.figure.axes:
            return
        left, right = map(self.pixel_of, self.band)
        top, height = self.axes_rows()
        painter = QPainter(self)
        color = QColor(SELECTED_COLOR)
        painter.setPen(QPen(color, 2))
        color.setAlpha(60)
        painter.fillRect(QRectF(left, top, right - left, height), color)
        for x in (left, right):
            painter.drawLine(round(x), round(top), round(x), round(top + height))
        painter.end()


class HistogramPanel(Panel):
    """The panel with the histogram of the shown step, the undeformed mesh and other runs."""

    def make(self) -> None:
        self._pending_range: Range | None = None
        self.canvas = BrushCanvas(self.drawing)
        self.area = PlotArea(self.canvas)
        self.canvas.brushed.connect(self._range_dragged)
        self.canvas.dragging.connect(self._dragged)
        self.numbers = QLabel(textFormat=Qt.TextFormat.RichText, wordWrap=True)
        self.range_text = QLabel(wordWrap=True)
        parts = (self.area, self.numbers, self.range_text, self._make_buttons())
        in_column(*parts, wide=[self.area], spacing=3, on=self, margins=4)
        self._timer = single_shot(self, self._apply_range, SELECTING_MS)
        escape = QShortcut(
            QKeySequence(Qt.Key.Key_Escape),
            self,
            context=Qt.ShortcutContext.WidgetWithChildrenShortcut,
        )
        escape.activated.connect(self.clear_range)
        self.follow(_shown, seen=True)

    def _make_buttons(self) -> TwoPartRow:
        self.log = check_box("log", "Counts on a logarithmic axis, which shows a few bad cells.")
        self.log.setChecked(True)
        self.whole = check_box(
            "0–1",
            "Show all possible values instead of the values of the cells.",
            name="whole_range",
        )
        for box in (self.log, self.whole):
            box.toggled.connect(lambda _: self.canvas.request_draw())
        self.show_all = push_button(
            "Show all cells",
            "Show cells of any value again (Esc).",
            self.clear_range,
            "show_all_cells",
        )
        tip = "Save the histogram as PNG, SVG or PDF."
        self.save = push_button("Save…", tip, lambda: self.canvas.save("histogram"))
        return TwoPartRow((self.log, self.whole), (self.show_all, self.save))

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        low, high = whole_range(shown_measure(session))
        both = f"{low:g}–{high:g}" if low >= 0 else f"{low:g} to {high:g}"
        self.whole.setText(both if high < np.inf else f"from {low:g}")
        for widget in (self.numbers, self.log, self.whole, self.save):
            widget.setVisible(session.frame is not None)
        self.whole.setEnabled(shown_measure(session) not in WALL_VALUES)
        self.show_all.setVisible(session.frame is not None)
        self.show_all.setEnabled(session.view.threshold is not None)
        if not self._timer.isActive():
            self.canvas.show_band(session.view.threshold)
        if session.frame is None or session.mesh is None:
            self.range_text.hide()
            self.area.show_text(
                "Open a mesh first. Then this panel shows how many cells have which quality."
            )
            return
        self.canvas.locked = bool(session.lacks_cells)
        self.canvas.setToolTip(session.lacks_cells or BRUSH)
        self.area.plot()
        what = shown_measure(session)
        counted = session.frame.quality.counted
        quality = session.frame.quality
        plain = session.frame.values(what, session.reference)[counted]
        if what in WALL_VALUES:
            plain = plain[~np.isnan(plain)] if not np.isnan(plain).all() else np.array([np.nan])
        bad = quality.inverted
        mean = quality.mean if what == "size-skew" else plain.mean()
        if what == "displacement":  # of a node: values of cells are means over their nodes
            word = "highest"
            ends = session.frame.largest_displacement(session.mesh)
        elif RANKED[what].best == "low":
            word = "max"
            ends = plain.max()
        else:
            word = "min"
            ends = quality.min if what == "size-skew" else plain.min()
        form = ".4f" if what in SIZE_SKEW else ".4g"
        red = f" style='color:{alarm()}'" if bad else ""
        self.numbers.setText(
            f"{word} <b>{float(ends):{form}}</b>&nbsp; mean <b>{mean:{form}}</b>&nbsp; "
            f"<span{red}>inverted <b>{bad:,}</b></span>"
        )
        threshold = session.view.threshold
        self.range_text.setVisible(threshold is not None)
        if threshold is not None:
            values = session.frame.shown_values(what, session.reference)[counted]
            count = len(cells_in_range(values, threshold))
            self.range_text.setText(
                f"Shown: {range_words(threshold)}, {count:,} of {len(values):,} cells"
            )

    # Drawing ---------------------------------------------------------------------------
    def drawing(self) -> Draw:
        log = self.log.isChecked()
        whole = self.whole.isChecked()
        return partial(draw_histogram, self.session, log=log, full_range=whole)

    # What the user does ----------------------------------------------------------------
    def _range_dragged(self, band: Range | None) -> None:
        """Schedule the threshold for a selected range; None ends the threshold."""
        if band is None:
            self.clear_range()
            return
        # The bar of the inverted cells is left of the first value: a range that lies there
        # selects them only, and one that begins there begins at 0.
        low, high = band
        left = first_value(self.canvas.figure.axes[0])
        if low < left:
            low = 0.0
        self._pending_range = ONLY_INVERTED if high < left else (low, high)
        if not self._timer.isActive():
            self._timer.start()

    def _dragged(self, dragging: bool) -> None:
        if not dragging and self._timer.isActive():
            self._timer.stop()
            self._apply_range()
        self.store.set_dragging(dragging)

    def _apply_range(self) -> None:
        if self._pending_range is not None:
            self.change(changes.set_view, threshold=self._pending_range)

    def clear_range(self) -> None:
        """Show cells of any value again."""
        self._timer.stop()
        self._pending_range = None
        if self.session.view.threshold is not None:
            self.change(changes.set_view, threshold=None)
        self.canvas.show_band(None)


def _shown(session: Session) -> object:
    view = session.view
    values = session.frame, session.runs, session.color_range
    return *values, view.color_by, view.color_map, view.threshold, view.beside
