"""Axes and colour bar of the pictures of sections."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.color_scheme import INVERTED_COLOUR
from slideviz.plots.bar import number_bar
from slideviz.plots.section_layout import Layout
from slideviz.plots.section_paint import Paint
from slideviz.plots.section_polygons import colours_of
from slideviz.plots.section_title import LETTERS
from slideviz.sections.shape import Label

_LETTER_WIDTH = 0.075
"""Inches that a letter of a label takes."""
_TWO_TICKS = (1.3, 0.3)
"""Inches of an axis to the right, and upwards, that have room for two numbers or more."""


def dress_axes(axes: Any, layout: Layout, labels: tuple[Label, Label] | None) -> None:
    """Set limits, ticks and labels of the axes."""
    from matplotlib.ticker import MaxNLocator

    axes.set_xlim(layout.low[0], layout.high[0])
    axes.set_ylim(layout.low[1], layout.high[1])
    if labels is None:
        axes.set_axis_off()
        return
    for put, label, inches in zip(
        (axes.set_xlabel, axes.set_ylabel), labels, layout.inches, strict=True
    ):
        fits = len(label.full) * _LETTER_WIDTH <= inches
        put(label.full if fits else label.short, fontsize=LETTERS)
    axes.tick_params(labelsize=LETTERS - 1, width=0.6, length=3)
    room = np.array(layout.inches) / (0.65, 0.4)
    # One number says nothing of the scale.
    least = np.where(np.array(layout.inches) >= _TWO_TICKS, 2, 1)
    for axis, bins, some in zip((axes.xaxis, axes.yaxis), room, least, strict=True):
        number = int(np.clip(bins, 2, 9))
        steps = [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(number, steps=steps, min_n_ticks=int(some)))
    for spine in axes.spines.values():
        spine.set_linewidth(0.6)


def add_bar(figure: Any, layout: Layout, paint: Paint, inverted: bool) -> None:
    """Draw the colour bar, with the colour of inverted cells where there are some."""
    from matplotlib.patches import Rectangle

    axes = figure.add_axes(layout.bar)
    direction = "vertical" if layout.upright_bar else "horizontal"
    bar = figure.colorbar(colours_of(paint), cax=axes, orientation=direction)
    bar.set_label(paint.label, fontsize=LETTERS)
    bar.ax.tick_params(labelsize=LETTERS - 1, width=0.6, length=3)
    side = 3 if layout.upright_bar else 2
    inches = layout.bar[side] * figure.get_size_inches()[side - 2]
    number_bar(bar, paint.limits, inches, LETTERS - 1)
    bar.outline.set_linewidth(0.6)
    bar.solids.set_rasterized(False)
    bar.solids.set_edgecolor("face")
    if not inverted:
        return
    width, height = figure.get_size_inches()
    x, y, wide, high = layout.bar
    if layout.upright_bar:
        box, at = (x, y - 0.3 / height), (x + wide + 0.06 / width, y - 0.3 / height)
        side = wide * width
    else:
        side = high * height
        box = (x + wide + 0.2 / width, y)
        at = (box[0] + (side + 0.06) / width, y)
    figure.add_artist(
        Rectangle(
            box, side / width, side / height, color=INVERTED_COLOUR, transform=figure.transFigure
        )
    )
    figure.text(
        at[0], at[1] + side / height / 2, "inverted", fontsize=8, ha="left", va="center_baseline"
    )
