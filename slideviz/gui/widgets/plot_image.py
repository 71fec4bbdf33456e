"""Images of plots, drawn in a thread: matplotlib takes 60 to 300 ms for one."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from threading import Lock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from slideviz.gui.responsiveness.threads import start_thread
from slideviz.plots.style import Style

DPI = 100
"""Resolution of a figure on a screen with a device pixel ratio of 1."""


THREAD = "slideviz-plot"
"""Name of the threads that draw plots."""

_DRAWING_LOCK = Lock()  # matplotlib is not made for several threads

Draw = Callable[[Figure, Style], None]
"""A function that fills a figure in a style; it is called in another thread: without widgets."""


@dataclass(frozen=True)
class PlotFormat:
    """The size of a plot in pixels, its device pixel ratio, and its style."""

    width: int
    height: int
    ratio: float
    style: Style


@dataclass(frozen=True)
class AxesPlace:
    """The bounds of the axes in the figure, valid while ``key`` is the same.

    ``bounds`` are left, bottom, width, height, relative to the figure.
    """

    key: tuple[object, ...] = ()
    bounds: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
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
        assert engine is not None
        engine.execute(figure)
        place = AxesPlace(key, axes.get_position().bounds)
    figure.set_layout_engine("none")
    axes.set_position(place.bounds)
    return place


def _last_tick(axes: Axes) -> tuple[int, bool]:
    """Return the length of the last number along x, and whether it juts out at the axes' end."""
    low, high = axes.get_xlim()
    inside = [at for at in axes.get_xticks() if low <= at <= high]
    texts = axes.xaxis.get_major_formatter().format_ticks(inside)
    return (len(texts[-1]), inside[-1] > low + 0.9 * (high - low)) if texts else (0, False)


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
