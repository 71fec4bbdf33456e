"""The page of a comparison's pictures: every picture, word and number has a place of its own.

All lengths are in inches, from the upper left corner.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slideviz.color_scheme import COLOUR_MAP, INVERTED_COLOUR
from slideviz.plots.style import PRINT, SMALLEST
from slideviz.study.plots import WIDTH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Image = NDArray[np.uint8]
Place = tuple[int, int]

WHITE = 250
"""Pixels as bright as this are background."""
_LINE = 0.15
"""Height of a line of words."""
_LETTER = 0.068
"""Width of a letter, about."""
_GAP = 0.08
_LOWEST = 0.5
"""A row of pictures takes this much at least: its name stands beside it."""
_BAR = 0.66


@dataclass(frozen=True, eq=False)
class Page:
    """What a page shows.

    Attributes
    ----------
    rows, columns : tuple of str
        What they are called; an empty name is not written.
    images : mapping of (int, int) to Image
        Pictures (n, m, 3), all of one size and scale, by row and column.
    numbers : mapping of (int, int) to str
        What stands below a place, in one line or two.
    words : mapping of (int, int) to str
        What stands in a place without a picture.
    notes : tuple of str
        What stands at the foot.
    inverted : bool
        Whether some cells are inverted, so that the colour bar must say what red means.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    images: Mapping[Place, Image]
    numbers: Mapping[Place, str]
    words: Mapping[Place, str]
    notes: tuple[str, ...]
    inverted: bool


def tile_width(rows: int, columns: int) -> float:
    """Return how wide a picture is on a page of so many; those of long pages are smaller."""
    return (WIDTH - _LINE) / max(columns, 2 if rows < 3 else 3) - _GAP


def compose(page: Page) -> Figure:
    """Return the figure of a page."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    across = _drawn(list(page.images.values()), 1)
    tile = tile_width(len(page.rows), len(page.columns))
    scale = tile / (across.stop - across.start)
    down = [_rows_of(page, row) for row in range(len(page.rows))]
    heights = [max(scale * (part.stop - part.start), _LOWEST) for part in down]
    names = [
        textwrap.wrap(name, max(int(height / _LETTER), 8))
        for name, height in zip(page.rows, heights, strict=True)
    ]
    left = _GAP + _LINE * max(map(len, names))
    width = max(left + len(page.columns) * (tile + _GAP), WIDTH / 2.0)
    notes = [line for note in page.notes for line in textwrap.wrap(note, int(width / _LETTER))]
    below = [_LINE * _lines_below(page, row) + 2.0 * _GAP for row in range(len(page.rows))]
    top = _GAP + (_LINE + _GAP if any(page.columns) else 0.0)
    height = top + sum(heights) + sum(below) + _BAR + _LINE * (len(notes) + bool(notes))
    figure = Figure(figsize=(width, height), facecolor="white")
    FigureCanvasAgg(figure)
    draw = _Ruler(figure, (width, height))
    for column, name in enumerate(page.columns):
        draw.say(left + column * (tile + _GAP) + tile / 2.0, top - 1.5 * _GAP, name, va="baseline")
    at = top
    for row, (part, high) in enumerate(zip(down, heights, strict=True)):
        for line, word in enumerate(names[row]):
            draw.say(_GAP + _LINE * (line + 0.5), at + high / 2.0, word, rotation=90)
        for column in range(len(page.columns)):
            box = (left + column * (tile + _GAP), at, tile, high)
            _fill(draw, page, (row, column), box, (part, across))
        at += high + below[row]
    _colour_bar(draw, (width, at), page.inverted)
    at += _BAR
    for line, words in enumerate(notes):
        draw.say(_GAP, at + _LINE * (line + 0.5), words, ha="left", fontsize=SMALLEST)
    return figure


def _rows_of(page: Page, row: int) -> slice:
    """Return which pixels of the pictures of a row are not white in all of them."""
    mine = [image for at, image in page.images.items() if at[0] == row]
    return _drawn(mine or list(page.images.values()), 0)


def _lines_below(page: Page, row: int) -> int:
    counts = [words.count("\n") + 1 for at, words in page.numbers.items() if at[0] == row]
    return max(counts, default=0)


def _drawn(images: Sequence[Image], axis: int) -> slice:
    """Return where any of the images is not white: rows for axis 0, columns for axis 1."""
    some = np.zeros(images[0].shape[axis], bool)
    for image in images:
        some |= (image < WHITE).any(axis=(1 - axis, 2))
    found = np.flatnonzero(some)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, len(some))


class _Ruler:
    """Puts things on a figure by inches from its upper left corner."""

    def __init__(self, figure: Figure, size: tuple[float, float]) -> None:
        self.figure = figure
        self.size = size

    def axes(self, x: float, y: float, width: float, height: float) -> Any:
        whole = self.size
        low = 1.0 - (y + height) / whole[1]
        return self.figure.add_axes((x / whole[0], low, width / whole[0], height / whole[1]))

    def say(self, x: float, y: float, words: str, **options: Any) -> None:
        usual: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontsize": PRINT.size,
            "linespacing": 1.15,
        }
        self.figure.text(x / self.size[0], 1.0 - y / self.size[1], words, **usual | options)


def _fill(
    draw: _Ruler,
    page: Page,
    at: Place,
    box: tuple[float, float, float, float],
    part: tuple[slice, slice],
) -> None:
    """Draw a picture, or say why there is none, and write the numbers below it."""
    x, y, width, height = box
    if at in page.images:
        image = page.images[at][part]
        high = width * image.shape[0] / image.shape[1]
        axes = draw.axes(x, y + (height - high) / 2.0, width, high)
        axes.imshow(image, interpolation="antialiased", aspect="auto")
        axes.set_axis_off()
    elif at in page.words:
        draw.say(x + width / 2.0, y + height / 2.0, page.words[at], fontsize=SMALLEST, color="0.35")
    if at in page.numbers:
        draw.say(x + width / 2.0, y + height + _GAP, page.numbers[at], va="top", fontsize=SMALLEST)


def _colour_bar(draw: _Ruler, at: tuple[float, float], inverted: bool) -> None:
    """Draw one colour bar for all pictures, in the middle of the page's width."""
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = mpl.colormaps[COLOUR_MAP].with_extremes(under=INVERTED_COLOUR)
    width, y = at
    bar = draw.figure.colorbar(
        ScalarMappable(Normalize(0.0, 1.0), colours),
        cax=draw.axes(0.2 * width, y + _GAP, 0.6 * width, 0.12),
        orientation="horizontal",
        extend="min" if inverted else "neither",
        extendfrac=0.05,
    )
    words = "size-skew quality [-]"
    bar.set_label(f"inverted cells: red;  {words}" if inverted else words, fontsize=PRINT.size)
    bar.ax.tick_params(labelsize=SMALLEST)
