"""Color bars of matplotlib, with numbers at their ends and the color of inverted cells."""

from __future__ import annotations

from typing import Any

from slideviz.color_scheme import INVERTED_COLOR, PAPER
from slideviz.plots.ticks import bar_ticks

_LINE = 0.6
"""Width of a bar's outline in points."""
_THICK, GAP = 0.14, 0.12
"""Thickness of a bar, and its distance from the axes beside it, in inches."""
BELOW = 0.62
"""Distance in inches between axes that have numbers and a label, and a bar below them."""


def beside(axes: Any) -> Any:
    """Return inset axes for a color bar at the right of ``axes``, as high as these."""
    from matplotlib.transforms import ScaledTranslation, blended_transform_factory

    right = axes.figure.dpi_scale_trans + ScaledTranslation(1.0, 0.0, axes.transAxes)
    place = blended_transform_factory(right, axes.transAxes)
    return axes.inset_axes((GAP, 0.0, _THICK, 1.0), transform=place)


def below(axes: Any, length: float, gap: float = BELOW) -> Any:
    """Return inset axes for a color bar below ``axes``; its length and their gap in inches."""
    from matplotlib.transforms import ScaledTranslation

    middle = axes.figure.dpi_scale_trans + ScaledTranslation(0.5, 0.0, axes.transAxes)
    return axes.inset_axes((-length / 2.0, -gap - _THICK, length, _THICK), transform=middle)


def color_bar(
    axes: Any, scale: Any, label: str, letters: float, *, inverted: bool, upright: bool
) -> Any:
    """Draw a color bar, with as many numbers as fit, and return it.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        The axes for the bar; see `beside` and `below`.
    scale : matplotlib.cm.ScalarMappable
        See `slideviz.plots.cells.color_scale`.
    label : str
    letters : float
        Size of the numbers in points; the label's is one point more.
    inverted : bool
        Whether the color of inverted cells is shown at the lower end.
    upright : bool
        Whether the bar is vertical.
    """
    from matplotlib.cm import ScalarMappable

    bar = axes.figure.colorbar(
        ScalarMappable(scale.norm, scale.cmap.with_extremes(under=INVERTED_COLOR)),
        cax=axes,
        orientation="vertical" if upright else "horizontal",
        extend="min" if inverted else "neither",
        extendfrac=0.05,
    )
    bar.set_label(label, fontsize=letters + 1.0)
    axes.tick_params(labelsize=letters, width=_LINE, length=3, labelcolor=PAPER.text)
    bar.outline.set_linewidth(_LINE)
    bar.solids.set_rasterized(False)
    bar.solids.set_edgecolor("face")
    _number(bar, scale.get_clim(), letters)
    if inverted:
        # Beyond the triangle, clear of the numbers.
        at, ha, va = ((0.0, -0.07), "left", "top") if upright else ((-0.07, 0.5), "right", "center")
        style = {"fontsize": letters, "color": PAPER.text, "transform": axes.transAxes}
        axes.text(*at, "inverted", ha=ha, va=va, **style)
    return bar


def _number(bar: Any, limits: tuple[float, float], letters: float) -> None:
    """Set ticks at both ends of a bar and between them; how many depends on its drawn length."""
    from matplotlib.textpath import TextPath
    from matplotlib.ticker import FuncFormatter, Locator

    upright, form = bar.orientation == "vertical", "%g"

    class Ends(Locator):
        def __call__(self) -> Any:
            nonlocal form
            long = bar.ax.bbox.height if upright else bar.ax.bbox.width
            points = max(72.0 * long / bar.ax.figure.dpi, letters)

            def part(text: str) -> float:
                box = TextPath((0.0, 0.0), text, size=letters).get_extents()
                # With a gap: digits that nearly touch read as one number.
                size = 1.4 * box.height if upright else box.width + 0.6 * letters
                return float(size / points)

            at, form = bar_ticks(*limits, part)
            return at

    bar.locator = Ends()
    bar.formatter = FuncFormatter(lambda value, _: form % value)
    bar.minorticks_off()
