"""Images of plots, drawn beside the window: matplotlib takes 60 to 300 ms for one."""

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
"""Of a screen whose pixels are not scaled."""

THREAD = "slideviz-plot"
_ONE = Lock()  # matplotlib is not made for several threads

Draw = Callable[[Figure, Style], None]
"""Fills a figure; it holds no widget, for it is called, and forgotten, in another thread."""


@dataclass(frozen=True)
class PlotFormat:
    """The size and style of a plot: pixels, pixels per unit of Qt, style."""

    width: int
    height: int
    ratio: float
    style: Style


@dataclass(frozen=True)
class AxesPlace:
    """The place of the axes (left, bottom, width, height), valid while ``key`` is the same."""

    key: tuple[object, ...] = ()
    bounds: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Picture:
    """A drawn figure; nobody draws it again, so that any thread may ask it.

    Attributes
    ----------
    figure : Figure
    pixels : (height, width, 4) uint8
        Red, green, blue, opacity.
    place : AxesPlace
    seconds : float
        How long it took.
    """

    figure: Figure = field(default_factory=Figure)
    pixels: np.ndarray = field(default_factory=lambda: np.zeros((1, 1, 4), np.uint8))
    place: AxesPlace = AxesPlace()
    seconds: float = 0.0


def picture(draw_on: Draw, paper: PlotFormat, place: AxesPlace) -> Picture:
    """Return a plot, its axes at the place of the one before if they need no other."""
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
    """Place the axes where they were, if nothing that takes room has another size.

    To find their place anew takes as long as to draw all of it.
    """
    if not figure.axes:
        return place
    axes = figure.axes[0]
    digits = [len(f"{end:.0f}") for end in axes.get_ylim()]
    labels = axes.get_xlabel(), axes.get_ylabel(), axes.get_title(), axes.get_yscale()
    key = (*figure.bbox.size, figure.dpi, *labels, *digits, *_beside(axes))
    if key != place.key:
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        place = AxesPlace(key, axes.get_position().bounds)
    figure.set_layout_engine("none")
    axes.set_position(place.bounds)
    return place


def _beside(axes: Axes) -> list[str]:
    """Return the texts of a legend that stands beside the axes, and takes room from them."""
    legend = axes.get_legend()
    if legend is None or legend.get_bbox_to_anchor().width > 0:
        return []
    return [text.get_text() for text in (legend.get_title(), *legend.get_texts())]


def draw_in_thread(draw_on: Draw, paper: PlotFormat, place: AxesPlace) -> Future[Picture]:
    """Return the future of a plot that is drawn in a thread."""
    coming: Future[Picture] = Future()

    def work() -> None:
        try:
            with _ONE:
                coming.set_result(picture(draw_on, paper, place))
        except Exception as error:
            # Whatever it is, the window must hear of it: a thread swallows it otherwise.
            coming.set_exception(error)

    # Ended with each plot: a thread that waits for the next would keep what it drew.
    start_thread(work, THREAD, daemon=False)
    return coming
