"""The histogram of qualities, drawn onto axes that are given, with inverted cells apart."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from slideviz.view.plots_series import QualityRun
from slideviz.view.plots_style import PRINT, Style, add_legend, dress, place

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

_BAND, _STEMS = 0.13, 0.07
"""Width of the strip left of 0 where inverted cells are counted, and of the part for counts."""


def histogram(
    axes: Axes,
    runs: Sequence[QualityRun],
    metric: str = "size-skew",
    bins: int = 50,
    log: bool = False,
    style: Style = PRINT,
) -> None:
    """Draw outlines of how many cells have which quality; inverted cells are left of 0.

    Parameters
    ----------
    axes : Axes
    runs : sequence of QualityRun
    metric : str
        Name of the value, for the axis.
    bins : int
        Equal intervals of 0 to 1.
    log : bool
        Whether the count is on a logarithmic axis, which shows a few bad cells among many.
    style : Style
    """
    dress(axes, style, f"{metric} quality [-]", "cells [-]")
    folded = [_inverted(run) for run in runs]
    for index, (run, bad) in enumerate(zip(runs, folded, strict=True)):
        look = style.series(place(run.series, index))
        counts, edges = np.histogram(run.values[~bad], bins, range=(0.0, 1.0))
        number = int(bad.sum())
        # A legend elsewhere serves several axes, with other numbers of inverted cells.
        told = number > 0 and style.legend
        label = f"{run.label} ({number} inverted)" if told else run.label
        axes.stairs(
            counts,
            edges,
            color=look.colour,
            linestyle=look.dash,
            linewidth=style.width,
            label=label,
            baseline=None if len(runs) > 1 else 0,
            fill=False,
        )
        if number:
            at = -_STEMS * (index + 1) / (len(runs) + 1)
            axes.plot(
                [at, at],
                [0.5 if log else 0.0, number],
                color=look.colour,
                linestyle=look.dash,
                linewidth=style.width,
                marker=look.marker,
                markevery=[1],
                markersize=4,
            )
    if log:
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5)
    else:
        axes.set_ylim(bottom=0.0)
    axes.set_xlim(0.0, 1.0)
    left = 0.0
    if any(bad.any() for bad in folded):
        _inverted_band(axes, style)
        left = _BAND / (1.0 + _BAND)
    add_legend(axes, style, loc="best", bbox_to_anchor=(left, 0.0, 1.0 - left, 1.0))


def _inverted(run: QualityRun) -> NDArray[np.bool_]:
    if run.inverted is None:
        return np.zeros(len(run.values), bool)
    return np.asarray(run.inverted, bool)


def _inverted_band(axes: Axes, style: Style) -> None:
    """Mark the strip left of 0 where inverted cells are counted."""
    axes.set_xlim(-_BAND, 1.0)
    axes.axvspan(-_BAND, 0.0, color=style.alarm, alpha=0.13, linewidth=0)
    axes.text(
        -(_BAND + _STEMS) / 2,
        0.97,
        "inverted",
        transform=axes.get_xaxis_transform(),
        rotation="vertical",
        ha="center",
        va="top",
        fontsize=style.size,
        color=style.alarm,
    )
    axes.set_xticks(np.linspace(0.0, 1.0, 6))
