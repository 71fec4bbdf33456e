"""A plot in a panel: drawn in a thread, as matplotlib takes 60 to 300 ms; and files of plots."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import field, replace
from pathlib import Path
from threading import Lock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from qtpy.QtCore import Qt, QTimer, Signal
from qtpy.QtGui import QColor, QImage, QPainter, QPaintEvent, QResizeEvent
from qtpy.QtWidgets import QLabel, QStackedWidget, QWidget

from slideviz.argument_types import frozen, record
from slideviz.color_scheme import LIGHT, ColorScheme
from slideviz.errors import SlidevizError
from slideviz.gui.responsiveness.threads import start_thread
from slideviz.gui.responsiveness.timers import LOOK_MS, MOST_REST, REST_MS, REST_TIMES, single_shot
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import hint_label, set_policy
from slideviz.gui.widgets.services import main_window
from slideviz.plots.figure_io import figure_bytes
from slideviz.plots.style import PRINT, Style
from slideviz.system.atomic import write_whole

DPI = 100  # resolution of a figure on a screen with a device pixel ratio of 1


THREAD = "slideviz-plot"  # name of the threads that draw plots
_DRAWING_LOCK = Lock()  # matplotlib is not made for several threads
Draw = Callable[[Figure, Style], None]
"""A function that fills a figure in a style; it is called in another thread: without widgets."""


@frozen
class PlotFormat:
    """The size of a plot in pixels, its device pixel ratio, and its style."""

    width: int
    height: int
    ratio: float
    style: Style


@frozen
class AxesPlace:
    """The bounds of the axes in the figure, valid while ``key`` is the same.

    ``bounds`` are left, bottom, width, height, relative to the figure.
    """

    key: tuple[object, ...] = ()
    bounds: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


@record
class Picture:
    """A drawn figure; it is never drawn again, so any thread may read it."""

    figure: Figure = field(default_factory=Figure)
    pixels: np.ndarray = field(default_factory=lambda: np.zeros((1, 1, 4), np.uint8))
    """(height, width, 4): red, green, blue, opacity."""
    place: AxesPlace = AxesPlace()
    seconds: float = 0.0
    """How long it took to draw."""


def picture(draw_on: Draw, paper: PlotFormat, place: AxesPlace) -> Picture:
    """Return a drawn plot; the axes keep their place from the plot before, if it still fits."""
    began = time.monotonic()
    dpi = DPI * paper.ratio
    figure = Figure((paper.width / dpi, paper.height / dpi), dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained", w_pad=0.03, h_pad=0.03)
    figure.set_facecolor(paper.style.scheme.background)
    draw_on(figure, paper.style)
    place = _arrange(figure, place)
    canvas.draw()
    return Picture(figure, np.asarray(canvas.buffer_rgba()), place, time.monotonic() - began)


def _arrange(figure: Figure, place: AxesPlace) -> AxesPlace:
    """Place the axes as before if all texts around them have the same size; return their place.

    Otherwise matplotlib's layout engine places them, which takes as long as drawing the plot.
    """
    if not figure.axes:
        return place
    axes = figure.axes[0]
    digits = [len(f"{end:.0f}") for end in axes.get_ylim()]
    labels = axes.get_xlabel(), axes.get_ylabel(), axes.get_title(), axes.get_yscale()
    key = (*figure.bbox.size, figure.dpi, *labels, *digits, *_last_tick(axes), *_legend_texts(axes))
    if key != place.key:
        engine = figure.get_layout_engine()
        engine.execute(figure)
        place = AxesPlace(key, axes.get_position().bounds)
    figure.set_layout_engine("none")
    axes.set_position(place.bounds)
    return place


def _last_tick(axes: Axes) -> tuple[int, float]:
    """Return the length of the last number along x, and its place from 0 to 1 near the end."""
    low, high = axes.get_xlim()
    inside = [at for at in axes.get_xticks() if low <= at <= high]
    texts = axes.xaxis.get_major_formatter().format_ticks(inside)
    if not texts:
        return 0, 0.0
    return len(texts[-1]), max(round((inside[-1] - low) / (high - low), 2), 0.9)


def _legend_texts(axes: Axes) -> list[str]:
    """Return the texts of a legend beside the axes, which makes them narrower; else none."""
    legend = axes.get_legend()
    if legend is None or legend.get_bbox_to_anchor().width > 0:
        return []
    return [text.get_text() for text in (legend.get_title(), *legend.get_texts())]


def draw_in_thread(draw_on: Draw, paper: PlotFormat, place: AxesPlace) -> Future[Picture]:
    """Return the future picture of a plot, drawn in a thread of its own."""
    coming: Future[Picture] = Future()

    def work() -> None:
        try:
            with _DRAWING_LOCK:
                coming.set_result(picture(draw_on, paper, place))
        except Exception as error:
            # Any error: the future passes it on to the GUI thread.
            coming.set_exception(error)

    # One thread per plot: one that waited for the next plot would keep the last one's data alive.
    start_thread(work, THREAD, daemon=False)
    return coming


FIGURE_INCHES = (4.2, 3.1)  # width and height of a saved figure, in inches
PLOT_FILTERS = "PNG picture (*.png);;SVG drawing (*.svg);;PDF drawing (*.pdf)"


class PlotCanvas(QWidget):
    """A widget with a plot that is drawn in a thread; it shows the newest image of it.

    ``drawing``, called in the GUI thread, returns a function that fills a figure with the present
    data; this function is called in another thread, and must not use widgets.
    """

    drawn = Signal()
    """Another image is shown."""

    def __init__(self, drawing: Callable[[], Draw]) -> None:
        super().__init__()
        self.drawing = drawing
        self.scheme = LIGHT
        self._stale = True
        self.wiped = False
        self._last = 0.0
        self._picture = Picture()
        self._coming: Future[Picture] | None = None
        self._before: Future[Picture] | None = None
        self._timer = single_shot(self, self.fill)
        # The image is polled, not signalled: the thread must not refer to a widget that may be
        # deleted.
        self._look_after = QTimer(self, interval=LOOK_MS)
        self._look_after.timeout.connect(self._show_image)
        self.setMinimumSize(120, 100)
        set_policy(self, "Expanding", "Expanding")
        self.setFocusPolicy(Qt.FocusPolicy.ClickFocus)

    @property
    def style_(self) -> Style:
        """Return the style of the plot in the window."""
        return Style(self.scheme, size=8.0, width=1.3)

    @property
    def figure(self) -> Figure:
        """Return the figure that is shown; its axes convert between data and pixels."""
        return self._picture.figure

    @property
    def busy(self) -> bool:
        return self._coming is not None or self._timer.isActive()

    # Drawing ---------------------------------------------------------------------------
    def request_draw(self) -> None:
        """Schedule a drawing; a hidden plot is drawn when it is shown."""
        self._stale = True
        if is_seen(self) and not self.busy:
            since = (time.monotonic() - self._last) * 1000.0
            # The longer one takes, the longer is the time between two.
            rest = max(REST_MS, REST_TIMES * 1000.0 * self._picture.seconds)
            self._timer.start(max(0, round(min(rest, MOST_REST * REST_MS) - since)))

    def wipe(self) -> None:
        """Show “Drawing…” instead of the image until the next one, as it is of another plot."""
        self.wiped = True
        self._before = self._coming
        self.update()

    def fill(self) -> None:
        """Start a drawing; later, if one is going on or the widget has been hidden meanwhile."""
        self._stale = self._coming is not None or not is_seen(self)
        if self._stale:
            return
        ratio = self.devicePixelRatioF()
        wide = max(1, round(ratio * self.width()))
        high = max(1, round(ratio * self.height()))
        paper = PlotFormat(wide, high, ratio, self.style_)
        self._coming = draw_in_thread(self.drawing(), paper, self._picture.place)
        self._look_after.start()

    def _show_image(self) -> None:
        if self._coming is None or not self._coming.done():
            return
        coming = self._coming
        self._coming = None
        self._look_after.stop()
        self._last = time.monotonic()
        self._picture = coming.result()
        # An image that was begun before `wipe` is of the other plot.
        self.wiped = self.wiped and coming is self._before
        self.update()
        self.drawn.emit()
        if self._stale:
            self.request_draw()

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.scheme = scheme
        self.request_draw()

    def save(self, name: str, title: str = "Save plot") -> None:
        """Ask for a file, by default of a name, and draw the plot into it."""
        draw_on = self.drawing()
        ask_and_write(
            self, title, f"{name}.png", PLOT_FILTERS, lambda path: write_plot(path, draw_on)
        )

    # Places ----------------------------------------------------------------------------
    @property
    def _scale(self) -> tuple[float, float]:
        """Return the image's pixels per pixel of the widget, which may have been resized since."""
        high, wide = self._picture.pixels.shape[:2]
        return wide / max(self.width(), 1), high / max(self.height(), 1)

    def to_value(self, x_px: float) -> float:
        """Return the value of the horizontal axis at a horizontal position in the widget."""
        place = x_px * self._scale[0], 0.0
        return float(self.figure.axes[0].transData.inverted().transform(place)[0])

    def to_pixel(self, value: float) -> float:
        """Return the horizontal pixel in the widget of a value of the horizontal axis."""
        place = self.figure.axes[0].transData.transform((value, 1.0))
        return float(place[0] / self._scale[0])

    def axes_rows(self) -> tuple[float, float]:
        """Return top and height of the axes in pixels of the widget."""
        box = self.figure.axes[0].get_window_extent()
        scale = self._scale[1]
        return self.height() - box.y1 / scale, box.height / scale

    # Qt --------------------------------------------------------------------------------
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._last = 0.0  # without delay: the present image is shown stretched
        self.request_draw()

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self)
        pixels = self._picture.pixels
        high, wide = pixels.shape[:2]
        if self.wiped:
            painter.fillRect(self.rect(), QColor(self.scheme.background))
            painter.setPen(QColor(self.scheme.text))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, "Drawing…")
        elif wide > 1:
            image = QImage(pixels.data, wide, high, 4 * wide, QImage.Format.Format_RGBA8888)
            painter.drawImage(self.rect(), image)
        else:
            painter.fillRect(self.rect(), QColor(self.scheme.background))
        painter.end()
        if self._stale:
            self.request_draw()


class PlotArea(QStackedWidget):
    """A plot, or a text that says why there is none."""

    def __init__(self, canvas: PlotCanvas) -> None:
        super().__init__()
        self.words = words_label()
        self.canvas = canvas
        self.addWidget(self.words)
        self.addWidget(self.canvas)
        self.setMinimumHeight(100)

    @property
    def shows_text(self) -> bool:
        return self.currentWidget() is self.words

    def show_text(self, text: str) -> None:
        """Show a text instead of the plot."""
        self.words.setText(text)
        self.setCurrentWidget(self.words)

    def plot(self) -> None:
        self.setCurrentWidget(self.canvas)
        self.canvas.request_draw()


def is_seen(widget: QWidget) -> bool:
    """Return whether any part of a widget is on screen: Qt calls a dock behind a tab visible."""
    return widget.isVisible() and not widget.visibleRegion().isEmpty()


def words_label() -> QLabel:
    """Return a centred label for the text of a panel that has nothing else to show."""
    label = hint_label(align=Qt.AlignmentFlag.AlignCenter)
    label.setMargin(12)
    return label


def write_plot(path: Path, draw_on: Draw) -> None:
    """Write a plot as a figure for paper: PNG, SVG or PDF by the file's suffix.

    Raises SlidevizError if the suffix is another one, or the file cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in ("png", "svg", "pdf"):
        raise SlidevizError(f"{path}: a plot is a .png, .svg or .pdf file; choose one of these")
    figure = Figure(FIGURE_INCHES, layout="constrained")
    draw_on(figure, replace(PRINT, size=8.5))
    write_whole(path, figure_bytes(figure, kind), SlidevizError)


def ask_and_write(
    parent: QWidget, title: str, name: str, filters: str, write: Callable[[Path], None]
) -> None:
    """Ask for a file, by default of a name, and call ``write``; the window shows success or error.

    Without a window around ``parent``, errors are raised.
    """
    window = main_window(parent)
    folder = window.files.folder() if window is not None else Path.home()
    path = questions.ask_save(parent, title, folder / name, filters)
    if path is None:
        return
    if window is None:
        write(path)
        return
    with window.banner.showing_errors():
        write(path)
        window.settings.setValue("folder", str(path.parent))
        window.show_status(f"Saved {path}")
