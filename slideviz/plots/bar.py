"""The numbers beside a colour bar of matplotlib."""

from __future__ import annotations

from typing import Any

from slideviz.plots.ticks import bar_ticks


def number_bar(bar: Any, limits: tuple[float, float], inches: float, letters: float) -> None:
    """Write as many numbers beside a colour bar as there is room for, and those of its ends.

    Parameters
    ----------
    bar : matplotlib.colorbar.Colorbar
    limits : (float, float)
        What its ends stand for.
    inches : float
        Its length.
    letters : float
        Typographic points.
    """
    from matplotlib.textpath import TextPath

    def part(label: str) -> float:
        box = TextPath((0.0, 0.0), label, size=letters).get_extents()
        # A little air, for digits that nearly touch read as one number.
        points = 1.4 * box.height if bar.orientation == "vertical" else box.width + 0.6 * letters
        return float(points / (72.0 * inches))

    at, form = bar_ticks(*limits, part)
    bar.set_ticks(at, labels=[form % value for value in at])
    bar.ax.minorticks_off()
