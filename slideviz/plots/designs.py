"""Plots of a table of designs: quality, or another result, against a number that varies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.argument_types import record
from slideviz.case.words import is_number
from slideviz.color_scheme import SELECTED_COLOR
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.plots.style import PRINT, Style, add_dots, add_legend, style_axes
from slideviz.session.design_table import DesignTable
from slideviz.system.grouping import grouped

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RESULTS = {
    "quality": "quality [-]",
    "inverted": "inverted cells [-]",
    "max_error": "largest error [mesh units]",
    "control_nodes": "control nodes [-]",
    "seconds": "time of a design [s]",
}
"""The results that can be drawn, and the labels of their axes."""
_MOST_LINES = 12
"""Most curves drawn as lines in different colors; if there are more, only points are drawn."""
_MOST_WORDS = 12  # most texts along an axis whose column has no numbers
_SIGN = 7
_AXIS = 0.6
_HIGHEST = 0.35
"""Width of a legend's sign and the gap beside it, in letters; width of the labels left of the axes,
in inches; largest height of a legend above the axes, relative to the figure."""


@record
class DesignCurve:
    """A result of the designs that differ in one column only, against that column."""

    label: str  # the values in the other columns
    design: IntArray  # (k,): numbers of the designs, from 1
    places: FloatArray
    """(k,): ascending horizontal coordinates: values of the column, or indices into ``words``."""
    values: FloatArray
    mean: FloatArray
    """`values`, `mean` (k,): the result (of the quality the minimum), and the mean quality."""
    inverted: np.ndarray  # (k,): whether the design has inverted cells
    words: tuple[str, ...] = ()
    """The column's different texts if they are not all numbers, else empty."""
    others: str = ""  # the names of the other columns


def design_curves(table: DesignTable, column: str, what: str) -> list[DesignCurve]:
    """Return the result ``what`` against a column: a curve per combination of the other columns.

    Failed designs are left out. Texts that are not numbers are in the order of the table.
    """
    at = table.columns.index(column)
    place_of, words = _places(table, column)
    done = [(table.rows[k - 1], row) for k, row in sorted(table.results.items()) if not row.problem]
    groups = grouped((values[:at] + values[at + 1 :], row) for values, row in done)
    others = [name for name in table.columns if name != column]
    curves = []
    for fixed, rows in groups.items():
        places = np.array([place_of[table.rows[row.design - 1][at]] for row in rows])
        order = np.argsort(places, kind="stable")
        name = "min" if what == "quality" else what
        curves.append(
            DesignCurve(
                ", ".join(fixed),
                np.array([row.design for row in rows])[order],
                places[order],
                np.array([float(getattr(row, name)) for row in rows])[order],
                np.array([row.mean for row in rows])[order],
                np.array([row.inverted > 0 for row in rows])[order],
                words,
                ",\n".join(others),
            )
        )
    return curves


def failed_designs(table: DesignTable, column: str) -> dict[int, float]:
    """Return the horizontal coordinate of each failed design, by its number."""
    at = table.columns.index(column)
    place_of, _ = _places(table, column)
    failed = (number for number, row in sorted(table.results.items()) if row.problem)
    return {number: place_of[table.rows[number - 1][at]] for number in failed}


def _places(table: DesignTable, column: str) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the coordinate of each text of a column, and the texts if not all are numbers."""
    at = table.columns.index(column)
    words = tuple(dict.fromkeys(row[at] for row in table.rows))
    if all(is_number(word) for word in words):
        return {word: float(word) for word in words}, ()
    return {word: float(place) for place, word in enumerate(words)}, words


def against_designs(
    axes: Axes,
    curves: Sequence[DesignCurve],
    column: str,
    what: str = "quality",
    shown: int | None = None,
    style: Style = PRINT,
    *,
    failed: Mapping[int, float] = MappingProxyType({}),
) -> None:
    """Draw a result of designs against a column: points, joined where only the column varies.

    Of the quality both the minimum (filled) and the mean (hollow) are drawn. Designs with inverted
    cells are crosses, those that ``failed`` (see `failed_designs`) bold ones on the axis. The
    design ``shown`` has a ring.
    """
    style_axes(axes, style, column, RESULTS[what])
    several = len(curves) <= _MOST_LINES
    for index, curve in enumerate(curves):
        _draw_curve(axes, curve, style, index if several else None, mean=what == "quality")
        if shown is not None and shown in curve.design:
            k = int(np.flatnonzero(curve.design == shown)[0])
            ring: dict[str, Any] = {"markersize": 11, "markeredgewidth": 2.2, "zorder": 5}
            ring |= {"markerfacecolor": "none", "markeredgecolor": SELECTED_COLOR}
            axes.plot(curve.places[k], curve.values[k], "o", gid="shown", clip_on=False, **ring)
    if failed:
        bold: dict[str, Any] = {"color": style.alarm, "markersize": 8, "linestyle": ""}
        bold |= {"transform": axes.get_xaxis_transform(), "clip_on": False, "zorder": 4}
        places = list(failed.values())
        axes.plot(
            places, [0.0] * len(places), marker="X", gid="failed", label="failed", mew=0.4, **bold
        )
    if any(curve.inverted.any() for curve in curves):
        axes.plot([], [], "x", color=style.alarm, label="inverted")
    if what == "quality" and curves:
        add_dots(axes, style)
    words = curves[0].words if curves else ()
    if words:
        every = -(-len(words) // _MOST_WORDS)
        axes.set_xticks(range(0, len(words), every), words[::every])
    else:
        axes.locator_params(axis="x", nbins=4)  # there is little room
    if several:
        title = curves[0].others if curves and len(curves) > 1 else ""
        where = _legend_place(axes, style)
        add_legend(axes, style, title=title, title_fontsize=style.size, handlelength=2.0, **where)
        legend = axes.get_legend()
        if legend is not None:
            legend.get_title().set_color(style.scheme.text)


def _legend_place(axes: Axes, style: Style) -> dict[str, Any]:
    """Return the legend's arguments of its place: above the axes, or beside them if too high."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    words = axes.get_legend_handles_labels()[1]
    letter = 0.62 * style.size / 72.0  # inches
    wide = max((len(word) for word in words), default=0) + _SIGN
    columns = max(min(int((figure.get_figwidth() - _AXIS) / letter / wide), len(words)), 1)
    rows = -(-len(words) // columns)
    if rows * 1.3 * style.size / 72.0 > _HIGHEST * figure.get_figheight():
        return {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.0}
    above = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "columnspacing": 1.2}
    return {**above, "ncols": columns}


def _draw_curve(
    axes: Axes, curve: DesignCurve, style: Style, series: int | None, *, mean: bool
) -> None:
    """Draw a curve in the look of a series; ``series`` None: points only, all in one look."""
    line = style.line(series or 0)
    if series is None or len(curve.places) < 2:
        line["linestyle"] = ""
    label = curve.label if series is not None and curve.label else None
    sound: dict[str, Any] = {"markevery": np.flatnonzero(~curve.inverted).tolist()}
    curve_id = f"curve:{curve.label}"
    axes.plot(curve.places, curve.values, label=label, gid=curve_id, **line, **sound)
    if mean:
        hollow = line | {"markerfacecolor": style.scheme.background}
        axes.plot(curve.places, curve.mean, gid=f"mean:{curve.label}", **hollow)
    if curve.inverted.any():
        places = curve.places[curve.inverted]
        values = curve.values[curve.inverted]
        cross: dict[str, Any] = {"color": style.alarm, "markersize": 6, "linestyle": ""}
        axes.plot(places, values, marker="x", clip_on=False, gid="inverted", **cross)


def nearest_design(
    axes: Axes,
    curves: Sequence[DesignCurve],
    x: float,
    y: float,
    failed: Mapping[int, float] = MappingProxyType({}),
) -> int | None:
    """Return the number of the design whose point is nearest to (x, y); None without points.

    x and y are pixels of the figure, y upwards; ``failed`` is that of `failed_designs`.
    """
    best: tuple[float, int] | None = None
    for curve in curves:
        for values in (curve.values, curve.mean):
            spots = axes.transData.transform(np.stack([curve.places, values], axis=1))
            away = np.hypot(*(spots - (x, y)).T)
            if len(away) and np.isfinite(away).any():
                k = int(np.nanargmin(away))
                if best is None or away[k] < best[0]:
                    best = float(away[k]), int(curve.design[k])
    for design, place in failed.items():
        spot = axes.get_xaxis_transform().transform((place, 0.0))
        far = float(np.hypot(*(spot - (x, y))))
        if best is None or far < best[0]:
            best = far, design
    return None if best is None else best[1]
