"""The plot of a table of designs: a result against a number that varies."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from matplotlib.figure import Figure
from qtpy.QtCore import Qt
from qtpy.QtGui import QMouseEvent
from qtpy.QtWidgets import QWidget

from slideviz.gui.widgets.build import in_column, in_row, push_button
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.plot_canvas import PlotArea, PlotCanvas, ask_and_write_plot
from slideviz.gui.widgets.plot_image import Draw
from slideviz.plots.designs import (
    RESULTS,
    against_designs,
    design_curves,
    failed_designs,
    nearest_design,
)
from slideviz.plots.style import Style
from slideviz.session.design_table import DesignTable

EMPTY = "This plot shows curves of quality: add designs, and run them."
FAILED = "No design has a result yet: those that were run failed."


class DesignCanvas(PlotCanvas):
    """A plot that calls ``picked`` with a click's position, in the figure's pixels from below."""

    def __init__(self, drawing: Callable[[], Draw]) -> None:
        super().__init__(drawing)
        self.picked: Callable[[float, float], None] = lambda *_: None
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self.wiped or not self.figure.axes:
            return
        wide, high = self._scale
        at = event.position()
        self.picked(at.x() * wide, (self.height() - at.y()) * high)


class DesignPlot(QWidget):
    """The plot of a result of the designs against a varied number, with choices of both."""

    def __init__(self) -> None:
        super().__init__()
        self.picked: Callable[[int], None] = lambda _: None
        """Called with the number of the design whose point was clicked."""
        self._table = DesignTable()
        self._shown: int | None = None
        self.across = Choice({}, "The number on the horizontal axis of the plot.", "across")
        words = {name: text.partition(" [")[0].capitalize() for name, text in RESULTS.items()}
        self.what = Choice(words, "The result that the plot shows.", "what")
        self.save = push_button(
            "Save plot…", "Save the plot as PNG, SVG or PDF.", self._save, "save_design_plot"
        )
        self.canvas = DesignCanvas(self.drawing)
        self.canvas.picked = self._picked
        self.area = PlotArea(self.canvas)
        head = in_row(self.what, self.across, wide=[self.what, self.across], spacing=4)
        in_column(head, self.area, wide=[self.area], spacing=4, on=self)
        for choice in (self.across, self.what):
            choice.chosen.connect(lambda _: self._other_plot())

    # The button that saves it is beside those of the table.

    def show_table(self, table: DesignTable, shown: int | None) -> None:
        """Draw the results of a table; the design ``shown`` has a ring."""
        if table.columns != self._table.columns:
            self.across.clear()
            for name in table.columns:
                self.across.addItem(name, name)
        self._table, self._shown = table, shown
        plotted = table.count_done() > 0
        self.save.setEnabled(plotted)
        self.across.setVisible(len(table.columns) > 1)
        if plotted:
            self.area.plot()
        else:
            self.area.show_text(FAILED if table.results else EMPTY)

    def drawing(self) -> Draw:
        """Return a function that draws the plot into a figure; one that draws nothing if empty."""
        column, what = self.across.currentData(), self.what.currentData()
        if column is None or not self._table.count_done():
            return lambda _figure, _style: None
        return partial(_draw, self._table, column, what, self._shown)

    def _other_plot(self) -> None:
        self.canvas.wipe()
        self.show_table(self._table, self._shown)

    def _picked(self, x: float, y: float) -> None:
        column, what = self.across.currentData(), self.what.currentData()
        curves, failed = (
            design_curves(self._table, column, what),
            failed_designs(self._table, column),
        )
        nearest = nearest_design(self.canvas.figure.axes[0], curves, x, y, failed)
        if nearest is not None:
            self.picked(nearest)

    def _save(self) -> None:
        ask_and_write_plot(self, "Save plot", "designs", self.drawing())


def _draw(
    table: DesignTable, column: str, what: str, shown: int | None, figure: Figure, style: Style
) -> None:
    """Draw the result ``what`` of the designs against a column, with a ring at design ``shown``."""
    curves, failed = design_curves(table, column, what), failed_designs(table, column)
    against_designs(figure.add_subplot(), curves, column, what, shown, style, failed=failed)
