"""Throats and tip gaps as curves: by span, or along the chord."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from slideviz.design.blade_gaps import TOUCHING, Gap
from slideviz.plots.style import PRINT, Style, add_legend, style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Measured = tuple[str, int, Sequence[Gap]]
"""A mesh whose distances were measured: its label, its series number, and its gaps."""
ZONE_DASHES = ("-", "--", ":", "-.")


def draw_gaps(figure: Figure, measured: Sequence[Measured], style: Style = PRINT) -> None:
    """Draw the smallest distances by place, in a plot for each; without places as points.

    Span is the vertical axis, and the chord is the horizontal one. All meshes have the same gaps.
    Zones share the plots of throat, tip gap and hub gap, and differ by the dashes of their curves.
    The first mesh of several has wide pale ones, which are seen beneath others at the same places.
    """
    names = list(dict.fromkeys(gap.name for gap in measured[0][2]))
    for number, name in enumerate(names):
        axes: Any = figure.add_subplot(1, len(names), number + 1)
        shown = [
            (label, series, gap)
            for label, series, gaps in measured
            for gap in gaps
            if gap.name == name
        ]
        by_span = not any(gap.along == "chord" for _, _, gap in shown)
        labels = f"{name} [mesh units]", "span [-]" if by_span else "part of the chord [-]"
        style_axes(axes, style, *(labels if by_span else labels[::-1]))
        for label, series, gap in shown:
            look = style.series(series)
            values = (gap.distances, gap.places)
            dash = look.dash if gap.zone is None else ZONE_DASHES[(gap.zone - 1) % 4]
            words = label if gap.zone is None else f"{label}, zone {gap.zone}"
            looks = {"color": look.color, "linestyle": dash, "linewidth": style.width}
            if len(measured) > 1 and label == measured[0][0]:
                looks |= {"linewidth": 2.4 * style.width, "alpha": 0.35}
            axes.plot(*(values if by_span else values[::-1]), label=words, gid=words, **looks)
            place = gap.distance, gap.place if gap.along else 0.5
            axes.plot(
                *[[at] for at in (place if by_span else place[::-1])], "o", ms=4, color=look.color
            )
        if not any(gap.distance for _, _, gap in shown):
            axes.set_title(TOUCHING, y=0.9, **style.letters)
        axes.locator_params(axis="x", nbins=4)
        above = {"loc": "lower center", "bbox_to_anchor": (0.45, 1.0), "ncols": 2}
        add_legend(axes, style, **above, handlelength=2.2, columnspacing=1.0)
