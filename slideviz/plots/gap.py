"""Throats and tip gaps as curves: by span, or along the chord."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from slideviz.design.gap import TOUCHING, Gap
from slideviz.plots.style import PRINT, Style, add_legend, style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Measured = tuple[str, int, Sequence[Gap]]
"""A mesh whose distances were measured: its label, its series number, and its gaps."""


def draw_gaps(
    figure: Figure, measured: Sequence[Measured], style: Style = PRINT, unit: str = "mesh units"
) -> None:
    """Draw the smallest distances by place, in a plot for each; without places as points.

    Span is the vertical axis, and the chord is the horizontal one. All meshes have the same gaps.
    """
    names = [gap.name for gap in measured[0][2]]
    for number, name in enumerate(names):
        axes: Any = figure.add_subplot(1, len(names), number + 1)
        by_span = measured[0][2][number].along != "chord"
        labels = f"{name} [{unit}]", "span [-]" if by_span else "part of the chord [-]"
        style_axes(axes, style, *(labels if by_span else labels[::-1]))
        ends = []
        for label, series, gaps in measured:
            gap, look = gaps[number], style.series(series)
            values = gap.distances, gap.places
            looks = {"color": look.color, "linestyle": look.dash, "linewidth": style.width}
            axes.plot(*(values if by_span else values[::-1]), label=label, gid=label, **looks)
            place = gap.distance, gap.place if gap.along else 0.5
            axes.plot(
                *[[at] for at in (place if by_span else place[::-1])], "o", ms=4, color=look.color
            )
            ends.append(gap.distance)
        if not any(gaps[number].distance for _, _, gaps in measured):
            axes.set_title(TOUCHING, fontsize=style.size, color=style.scheme.text)
        axes.locator_params(axis="x", nbins=4)
        add_legend(axes, style, loc="best")
