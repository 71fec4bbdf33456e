"""The meridional view of a passage: the mean of a quantity by place, in the plane of z and r.

A place is a bin of span and of length along the passage, in which all cells around the axis count.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.zones import zones_of
from slideviz.plots.section_paint import Paint
from slideviz.plots.style import PRINT, Style, style_axes
from slideviz.sections.span import SpanChannel, SpanWalls
from slideviz.system.weak_cache import WeakCache
from slideviz.terms import COLOR_BY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LARGE = 95.0  # bins are as large as this percentage of the cells, so that most bins have some
MOST_BINS = 120  # most bins in each direction


@record
class MeridionalBins:
    """Cells of a zone by meridional place: k bins from hub to shroud, and l along the passage."""

    places: FloatArray
    """(k + 1, l + 1, 2): z and r of the corners of bins, in the mesh's length unit."""
    bin_of: IntArray  # (m,): the bin of each cell, row by row
    walls: tuple[str, str]
    cells: slice  # those of the zone in the mesh
    words: tuple[str, str]  # what both coordinates of places are called

    @property
    def shape(self) -> tuple[int, int]:
        """Return the numbers of bins, k and l."""
        return self.places.shape[0] - 1, self.places.shape[1] - 1

    def means(self, values: FloatArray) -> FloatArray:
        """Return the mean (k, l) of values of all cells; NaN where no cell has a finite one."""
        values = values[self.cells]
        there = np.isfinite(values)
        bins = int(np.prod(self.shape))
        total = np.bincount(self.bin_of[there], values[there], bins)
        count = np.bincount(self.bin_of[there], None, bins)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(self.shape)


_BINS = WeakCache()


def meridional_bins(mesh: Mesh, walls: SpanWalls) -> tuple[MeridionalBins, ...]:
    """Return the bins of the cells of each zone; a cell is in that of the mean of its nodes.

    Along the passage bins are equal parts of the length from first to last node at each span.
    Cached as long as the span lives.
    """
    return tuple(
        _BINS.of(one.field, None, partial(_zone_bins, mesh, one)) for one in walls.channels
    )


def _zone_bins(whole: Mesh, walls: SpanChannel) -> MeridionalBins:
    part = whole.parts[walls.zone].cells
    mesh = zones_of(whole)[walls.zone]
    curves = walls.curves
    cells = mesh.cells
    plane = curves.plane(curves.field.meridional(mesh.points[cells.nodes]))
    used = np.stack([np.clip(plane[:, 2], 0.0, 1.0), curves.length(plane)], axis=1)
    k = _bins_of(mesh, used[:, 0])
    row = np.rint(used[:, 0] * k)  # 0 and k: the walls
    ends = []
    for order in (np.argsort(used[:, 1]), np.argsort(-used[:, 1])):
        first = order[np.unique(row[order], return_index=True)[1]]  # the extreme of each row
        ends.append(np.polyfit(used[first, 0], used[first, 1], min(2, len(first) - 1)))

    low = np.polyval(ends[0], used[:, 0])
    high = np.polyval(ends[1], used[:, 0])
    used[:, 1] = np.clip((used[:, 1] - low) / np.maximum(high - low, 1e-300), 0.0, 1.0)
    n = _bins_of(mesh, used[:, 1])
    at = np.full((len(mesh.points), 2), np.nan)
    at[cells.nodes] = used
    middle = cells.means(at)
    at_row, at_column = np.minimum(middle * (k, n), (k - 1, n - 1)).astype(np.int64).T
    span, share = np.meshgrid(np.linspace(0, 1, k + 1), np.linspace(0, 1, n + 1), indexing="ij")
    low = np.polyval(ends[0], span)
    high = np.polyval(ends[1], span)
    m_prime = curves.at_length((low + share * (high - low)).ravel(), span.ravel())
    plane = np.stack([m_prime, 0.0 * m_prime, span.ravel()], axis=1)
    places = curves.traced(plane).reshape(k + 1, n + 1, 2)
    named = walls.hub, walls.shroud
    bin_of = at_row * n + at_column
    return MeridionalBins(places, bin_of, named, part, walls.field.words)


def _bins_of(mesh: Mesh, used: FloatArray) -> int:
    """Return the number of bins along a coordinate (u,) from 0 to 1 of the nodes of cells."""
    at = np.empty(len(mesh.points))
    at[mesh.cells.nodes] = used
    corners = at[mesh.cells.connectivity]
    first = mesh.cells.offsets[:-1]
    size = np.maximum.reduceat(corners, first) - np.minimum.reduceat(corners, first)
    usual = float(np.percentile(size, LARGE))
    return int(np.clip(1.0 / max(usual, 1e-9) + 0.05, 1, MOST_BINS))


def draw_meridional(
    figure: Figure,
    zones: Sequence[MeridionalBins],
    paint: Paint,
    style: Style = PRINT,
) -> None:
    """Draw the means of values of all cells by z and r, with a color bar."""
    axes: Any = figure.add_subplot()
    style_axes(axes, style, *(f"{word} [mesh units]" for word in zones[0].words))
    axes.grid(False)
    for bins in zones:
        z, r = np.moveaxis(bins.places, -1, 0)
        means = bins.means(paint.values)
        mesh = axes.pcolormesh(z, r, means, cmap=paint.color_map, clim=paint.limits)
        mesh.set_rasterized(True)
        for row, name in zip((0, -1), bins.walls, strict=True):
            axes.plot(z[row], r[row], color=style.scheme.text, linewidth=style.width)
            at, other = bins.places[[row, -1 - row], z.shape[1] // 2]
            outwards = (at - other) / np.linalg.norm(at - other)
            axes.annotate(
                name, at, xytext=tuple(4.0 * outwards), textcoords="offset points",
                ha=("right", "center", "left")[1 + int(np.sign(outwards[0].round(1)))],
                va=("top", "center", "bottom")[1 + int(np.sign(outwards[1].round(1)))],
                **style.letters,
            )  # fmt: skip
    axes.locator_params(axis="x", nbins=4)
    axes.set_aspect("equal", adjustable="datalim")
    bar = figure.colorbar(mesh, ax=axes)
    label = f"mean {COLOR_BY[paint.label].axis}"
    bar.set_label(label, **style.letters)
    bar.ax.tick_params(colors=style.scheme.text, labelsize=style.size)
    bar.outline.set_edgecolor(style.scheme.edge)
