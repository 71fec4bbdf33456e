"""A plot in a panel: drawn when it is seen, in the colours of the theme, saved as a figure."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from matplotlib.backends.backend_qtagg import FigureCanvasQTAgg
from matplotlib.figure import Figure
from qtpy.QtCore import Qt, QTimer, Signal
from qtpy.QtWidgets import QLabel, QSizePolicy, QStackedWidget, QWidget

from slideviz.errors import SlidevizError
from slideviz.gui import dialogs
from slideviz.mesh.atomic import atomic_write
from slideviz.view.look import LIGHT, Look
from slideviz.view.plots import PRINT, Style

REST_MS = 200
"""Between two drawings while steps are played: a plot takes 30 to 60 ms."""

FIGURE_INCHES = (4.2, 3.1)
PLOT_FILTERS = "PNG picture (*.png);;SVG drawing (*.svg);;PDF drawing (*.pdf)"

Draw = Callable[[Figure, Style], None]


class PlotCanvas(FigureCanvasQTAgg):
    """A figure that ``draw_on(figure, style)`` fills, drawn at most every `REST_MS`.

    Signals
    -------
    drawn()
        The figure has another content.
    """

    drawn = Signal()

    def __init__(self, draw_on: Draw) -> None:
        super().__init__(Figure(layout="constrained"))
        self.draw_on = draw_on
        self.look = LIGHT
        self._stale = True
        self._last = 0.0
        self._place: tuple[tuple, tuple[float, ...]] = ((), ())
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.fill)
        self.setMinimumSize(120, 100)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)

    @property
    def style_(self) -> Style:
        """Return how it is drawn in the window."""
        return Style(self.look, size=8.0, width=1.3)

    def ask(self) -> None:
        """Draw what there is now, soon; hidden plots wait until they are seen."""
        self._stale = True
        if is_seen(self) and not self._timer.isActive():
            since = (time.monotonic() - self._last) * 1000.0
            self._timer.start(max(0, round(REST_MS - since)))

    def fill(self) -> None:
        """Draw what there is now."""
        self._stale = False
        figure = self.figure
        figure.clear()
        figure.set_layout_engine("constrained", w_pad=0.03, h_pad=0.03)
        figure.set_facecolor(self.look.background)
        self.draw_on(figure, self.style_)
        self._arrange()
        self.draw()
        self._last = time.monotonic()
        self.drawn.emit()

    def _arrange(self) -> None:
        """Place the axes where they were, if nothing that takes room has another size.

        To find their place anew takes as long as to draw all of it.
        """
        figure = self.figure
        if not figure.axes:
            return
        axes = figure.axes[0]
        digits = [len(f"{end:.0f}") for end in axes.get_ylim()]
        labels = axes.get_xlabel(), axes.get_ylabel(), axes.get_title(), axes.get_yscale()
        key = (self.width(), self.height(), figure.dpi, *labels, *digits)
        if key != self._place[0]:
            figure.get_layout_engine().execute(figure)
            self._place = key, axes.get_position().bounds
        figure.set_layout_engine("none")
        axes.set_position(self._place[1])

    def set_look(self, look: Look) -> None:
        """Take other colours."""
        self.look = look
        self.ask()

    def resizeEvent(self, event) -> None:
        super().resizeEvent(event)
        self.ask()

    def paintEvent(self, event) -> None:
        super().paintEvent(event)
        if self._stale:
            self.ask()


class PlotArea(QStackedWidget):
    """A plot, or words that say why there is none."""

    def __init__(self, draw_on: Draw, canvas: type[PlotCanvas] = PlotCanvas) -> None:
        super().__init__()
        self.words = words_label()
        self.canvas = canvas(draw_on)
        self.addWidget(self.words)
        self.addWidget(self.canvas)
        self.setMinimumHeight(100)

    @property
    def empty(self) -> bool:
        """Tell whether words are shown."""
        return self.currentWidget() is self.words

    def say(self, text: str) -> None:
        """Show words instead of the plot."""
        self.words.setText(text)
        self.setCurrentWidget(self.words)

    def plot(self) -> None:
        """Show the plot as it is now."""
        self.setCurrentWidget(self.canvas)
        self.canvas.ask()


def is_seen(widget: QWidget) -> bool:
    """Tell whether any of a widget is seen; a dock behind another tab counts as visible."""
    return widget.isVisible() and not widget.visibleRegion().isEmpty()


def words_label() -> QLabel:
    """Return a label for what a panel says while it has nothing to show."""
    label = QLabel()
    label.setWordWrap(True)
    label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    label.setProperty("hint", True)
    label.setMargin(12)
    return label


def write_plot(path: Path, draw_on: Draw) -> None:
    """Write a plot as a figure for paper: PNG, SVG or PDF by the ending of the name.

    Raises
    ------
    SlidevizError
        Another ending, or the file cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in ("png", "svg", "pdf"):
        raise SlidevizError(f"{path}: a plot is a .png, .svg or .pdf file; choose one of these")
    figure = Figure(FIGURE_INCHES, layout="constrained")
    draw_on(figure, replace(PRINT, size=8.5))
    data = io.BytesIO()
    figure.savefig(data, format=kind, dpi=300)
    with atomic_write(path, SlidevizError) as file:
        file.write(data.getvalue())


def ask_and_write(
    parent: QWidget, title: str, default: Path, filters: str, write: Callable[[Path], None]
) -> None:
    """Ask for a name and write a file; tell how it went in the window, if there is one."""
    path = dialogs.ask_save(parent, title, default, filters)
    if path is None:
        return
    window = main_window(parent)
    try:
        write(path)
    except (OSError, SlidevizError) as error:
        if window is None:
            raise
        window.banner.tell_error(error)
        return
    if window is not None:
        window.settings.setValue("folder", str(path.parent))
        window.say(f"Saved {path}")


def main_window(widget: QWidget | None):
    """Return slideviz's window around a widget, also where its dock floats."""
    while widget is not None and not hasattr(widget, "banner"):
        widget = widget.parentWidget()
    return widget


def folder_of(widget: QWidget) -> Path:
    """Return where file dialogs start."""
    window = main_window(widget)
    return window.files.folder() if window is not None else Path.home()
