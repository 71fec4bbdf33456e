"""The style of plots: colors, lines and markers that tell series apart, also in grey."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from slideviz.argument_types import frozen
from slideviz.color_scheme import INVERTED_COLOR, PAPER, ColorScheme
from slideviz.plots.figure_io import SMALLEST
from slideviz.terms import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ON_LIGHT = tuple(
    PALETTE[name]
    for name in ("blue", "vermilion", "green", "purple", "black", "sky blue", "orange")
)
"""The colors of series on a light background."""

_ON_DARK = (
    *(PALETTE["sky blue"], PALETTE["orange"], "#2bc49a", "#e39bc4", "#ffffff"),
    *(PALETTE["yellow"], "#f08040"),
)
"""The colors of series on a dark background; those too dark for it are lighter."""

_DASHES: tuple[Any, ...] = (
    "solid",
    (0, (5, 1.6)),
    (0, (1.2, 1.2)),
    (0, (6, 1.5, 1.2, 1.5)),
    (0, (2.6, 1.2)),
    (0, (6, 1.4, 1.2, 1.4, 1.2, 1.4)),
    (0, (10, 2)),
)
"""The dashes of series, as line styles of matplotlib."""

_MARKERS = ("o", "s", "^", "D", "v", "P", "X")  # the markers of series


@frozen
class Series:
    """The look of a series: color, marker and dash."""

    color: str
    marker: str
    dash: Any  # a line style of matplotlib


@frozen
class Style:
    """Colors, letters and lines of a plot."""

    scheme: ColorScheme = PAPER
    """Colors of background and letters; series have lighter colors on a dark background."""
    size: float = SMALLEST + 0.5  # size of letters in points, 8 or more at the printed size
    width: float = 1.4  # width of lines in points
    legend: bool = True  # whether axes with more than one series get a legend

    @property
    def dark(self) -> bool:
        """Return whether letters are lighter than the background."""
        return _brightness(self.scheme.text) > _brightness(self.scheme.background)

    def series(self, index: int) -> Series:
        """Return the look of series number ``index``, from 0; the first 49 differ."""
        palette = _ON_DARK if self.dark else _ON_LIGHT
        turn = index // len(palette)
        return Series(
            palette[index % len(palette)],
            _MARKERS[(index + turn) % len(_MARKERS)],
            _DASHES[(index + 2 * turn) % len(_DASHES)],
        )

    def line(self, index: int) -> dict[str, Any]:
        """Return the line of a series with markers, as arguments of matplotlib."""
        look = self.series(index)
        return {
            "color": look.color,
            "linestyle": look.dash,
            "linewidth": self.width,
            "marker": look.marker,
            "markersize": 4.5,
            "markerfacecolor": look.color,
            "markeredgewidth": 1.0,
        }

    @property
    def letters(self) -> dict[str, Any]:
        """Return size and color of letters, as arguments of matplotlib."""
        return {"fontsize": self.size, "color": self.scheme.text}

    @property
    def alarm(self) -> str:
        """Return the color of inverted cells."""
        return "#ff5d6c" if self.dark else INVERTED_COLOR


def _brightness(color: str) -> int:
    return sum(bytes.fromhex(color[1:]))


PRINT = Style(PAPER)


def style_axes(axes: Axes, style: Style, x_label: str, y_label: str) -> None:
    """Set labels, colors, letters and a faint grid of axes."""
    text = style.scheme.text
    size = max(style.size, SMALLEST)
    axes.set_facecolor(style.scheme.background)
    figure = axes.get_figure()
    if figure is not None:
        figure.set_facecolor(style.scheme.background)
    axes.set_xlabel(x_label, fontsize=size, color=text)
    axes.set_ylabel(y_label, fontsize=size, color=text)
    axes.tick_params(which="both", colors=text, labelsize=size, color=style.scheme.edge)
    for name, spine in axes.spines.items():
        spine.set_visible(name in ("left", "bottom"))
        spine.set_color(style.scheme.edge)
    axes.grid(True, color=style.scheme.edge, alpha=0.22, linewidth=0.6)
    axes.set_axisbelow(True)
    for letters in (axes.xaxis.get_offset_text(), axes.yaxis.get_offset_text()):
        letters.set_fontsize(size)
        letters.set_color(text)


def add_dots(axes: Axes, style: Style) -> None:
    """Add the signs of minimum and mean to the legend."""
    for word, face in (("minimum", style.scheme.text), ("mean", style.scheme.background)):
        dot: dict[str, Any] = {"markerfacecolor": face, "color": style.scheme.text}
        axes.plot([], [], "o", markersize=5, label=word, **dot)


def add_legend(axes: Axes, style: Style, **options: Any) -> None:
    """Add a legend if the style has one and there are two entries or more."""
    handles = options.get("handles") or axes.get_legend_handles_labels()[0]
    if not style.legend or len(handles) < 2:
        return
    axes.legend(
        fontsize=max(style.size, SMALLEST),
        labelcolor=style.scheme.text,
        facecolor=style.scheme.background,
        edgecolor="none",
        framealpha=0.8,
        borderpad=0.3,
        labelspacing=0.25,
        **({"handlelength": 3.2} | options),
    )
