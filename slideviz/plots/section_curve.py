"""The curve of a 2D mesh's section: the cells' values along its line or circle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import PolyCollection

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.plots.section_paint import Paint
from slideviz.plots.style import PRINT, Style, add_legend, style_axes
from slideviz.plots.ticks import rounded_out
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons
from slideviz.terms import COLOR_BY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP = 1e-6
"""Gap between two cells, relative to the whole length, above which the curve is interrupted."""
_FILLED = 0.85
_FOLDED = 0.3
"""Opacity of the areas below a curve, and of the marks of inverted cells."""


@record
class Curve:
    """The values of the cells along a section of a 2D mesh, sorted by position."""

    ends: FloatArray
    """(q, 2): the positions between which each cell is cut, the smaller one first: along a line in
    the mesh's length unit, along a circle in degrees."""
    values: FloatArray  # (q,): the value of each cell
    inverted: np.ndarray  # (q,): whether each cell is inverted
    cells: IntArray  # (q,): the index of each cell in the mesh

    def cell_at(self, position: float) -> int | None:
        """Return the index of the cell at a position, or None; an inverted one before others."""
        here = np.flatnonzero((self.ends[:, 0] <= position) & (position <= self.ends[:, 1]))
        if not len(here):
            return None
        return int(self.cells[here[np.argmax(self.inverted[here])]])


def curve_of(lines: Polygons, section: Section, paint: Paint) -> Curve:
    """Return the curve of a section's cut through a 2D mesh.

    ``lines``: the cut: lines of two corners each (see `slideviz.sections.cut.Cutter.cut`).
    """
    corners = lines.points[lines.connectivity, :2].reshape(-1, 2, 2)
    ends = np.sort(section.in_plane.positions_along(corners), axis=1)
    order = np.lexsort(ends.T)
    cells = lines.cells[order]
    return Curve(ends[order], paint.values[cells], paint.inverted[cells], cells)


def labels_of(section: Section, paint: Paint) -> tuple[str, str]:
    """Return the labels of both axes of curves: the positions along a section, and the values."""
    return section.in_plane.position_label().full, COLOR_BY[paint.label].axis


@record
class CurveRow:
    """A curve of a plot with its name and series number."""

    label: str
    curve: Curve
    series: int = 0


def draw_curves(
    axes: Axes,
    rows: Sequence[CurveRow],
    labels: tuple[str, str],
    style: Style = PRINT,
    colors: Paint | None = None,
) -> None:
    """Draw curves as steps onto empty axes; they are interrupted where there is no cell.

    ``rows``: the last one is the main one: its inverted cells are marked, and areas are below it.
    ``labels`` (str, str): labels of the positions and of the values. ``colors``: has the colors of
    the areas; without it no areas are drawn.
    """
    style_axes(axes, style, *labels)
    good = np.concatenate([row.curve.values for row in rows])
    good = good[np.isfinite(good)]  # a cell at no wall has none of the numbers of walls
    low, high = rounded_out(float(good.min()), float(good.max())) if len(good) else (0.0, 1.0)
    margin = 0.06 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    ends = np.concatenate([row.curve.ends for row in rows])
    side = 0.02 * float(np.ptp(ends)) or 1.0
    axes.set_xlim(ends.min() - side, ends.max() + side)
    last = rows[-1].curve
    if colors is not None:
        _areas(axes, last, colors, low - margin)
    if last.inverted.any():
        _folded(axes, last, style)
    for index, row in enumerate(rows):
        look = style.series(row.series)
        axes.plot(
            *steps(row.curve),
            color=look.color,
            linestyle=look.dash if index < len(rows) - 1 else "solid",
            linewidth=style.width,
            label=row.label,
            gid=f"along:{row.label}",
        )
    add_legend(axes, style, loc="best")


def steps(curve: Curve) -> tuple[FloatArray, FloatArray]:
    """Return positions and values, (n,) each, of a polyline of steps; NaN where it breaks."""
    length = float(np.ptp(curve.ends)) if len(curve.ends) else 0.0
    breaks = np.flatnonzero(curve.ends[1:, 0] - curve.ends[:-1, 1] > GAP * length) + 1
    x = curve.ends.ravel()
    y = np.repeat(curve.values, 2)
    return np.insert(x, 2 * breaks, np.nan), np.insert(y, 2 * breaks, np.nan)


def _areas(axes: Any, curve: Curve, colors: Paint, bottom: float) -> None:
    shown = PolyCollection(
        list(_columns(curve.ends, np.full(len(curve.values), bottom), curve.values)),
        array=np.clip(curve.values, *colors.limits),
        cmap=colors.color_map,
        clim=colors.limits,
        alpha=_FILLED,
        edgecolors="face",
        linewidths=0.2,
        gid="areas",
    )
    axes.add_collection(shown, autolim=False)


def _folded(axes: Any, curve: Curve, style: Style) -> None:
    low, high = axes.get_ylim()
    ends = curve.ends[curve.inverted]
    columns = _columns(ends, np.full(len(ends), low), np.full(len(ends), high))
    shown = PolyCollection(
        list(columns), facecolors=style.alarm, alpha=_FOLDED, linewidths=0, gid="inverted"
    )
    shown.set_label("inverted")
    axes.add_collection(shown, autolim=False)


def _columns(ends: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return rectangles (q, 4, 2) from ``low`` to ``high`` (q,) over ``ends`` (q, 2)."""
    left, right = ends.T
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return np.stack([np.column_stack(corner) for corner in corners], axis=1)
