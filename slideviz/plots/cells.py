"""Cells drawn with matplotlib, flat: polygons in colors, faint surroundings, color bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.textpath import TextPath
from matplotlib.ticker import FuncFormatter, Locator
from matplotlib.transforms import ScaledTranslation, blended_transform_factory

from slideviz.color_scheme import INVERTED_COLOR, PAPER
from slideviz.mesh.model import FloatArray, row_norms
from slideviz.plots.ticks import bar_ticks
from slideviz.sections.cut import Cutter, transformed
from slideviz.sections.model import Section
from slideviz.sections.plane import Box
from slideviz.sections.polygons import Polygons, joined

MANY = 200_000
"""Number of polygons above which they are pixels in SVG and PDF too, as viewers would fail."""

THICKEST = 0.45
_THINNEST = 0.04
_PART = 0.06
"""Width of mesh lines: largest and smallest in points; relative to the cell's thickness."""
_HAIR = 0.15
"""Width in points of a line in the cell's own color, which hides gaps between neighbours."""

_AMBIENT = 0.7  # brightness of a surface seen edge-on, relative to one seen face-on, with ``lit``


def color_scale(color_map: str, limits: tuple[float, float], at_walls: bool = False) -> Any:
    """Return the ScalarMappable of a color map and its limits; NaN has the inverted color.

    With ``at_walls``, values above the limits are those of cells at no wall, without a color.
    """
    table = colormaps[color_map].with_extremes(
        bad=INVERTED_COLOR, over=PAPER.cell if at_walls else None
    )
    return ScalarMappable(Normalize(*limits), table)


def draw_cells(
    axes: Any,
    cells: Polygons,
    values: FloatArray | None,
    scale: Any = None,
    *,
    edges: float = THICKEST,
    lit: bool = False,
    **options: Any,
) -> Any:
    """Draw polygons onto axes, the last one over the others, and return their PolyCollection.

    ``axes``: laid out already, with their limits, as the widths of edges depend on the scale.
    ``values`` (q,): of each polygon, NaN if inverted; None: all have one color. ``scale``: see
    `color_scale`. ``edges``: largest width of mesh lines in points; they are thinner around thin
    cells, so that boundary layers do not turn black; 0: no lines. ``lit``: polygons are darker, the
    more they are tilted. ``options``: arguments of the PolyCollection.
    """
    widths = np.clip(_PART * _thickness(axes, cells), min(_THINNEST, edges), edges)
    lines = {
        "edgecolors": PAPER.edge if edges else "face",
        "linewidths": widths if edges else _HAIR,
    }
    corners = cells.points[cells.connectivity, :2]
    rings = np.split(corners, cells.offsets[1:-1]) if len(cells) else []
    shapes = PolyCollection(rings, **lines | options)
    if values is not None:
        shapes.set(cmap=scale.cmap, norm=scale.norm, array=values)
        shapes.update_scalarmappable()
    if lit:
        normal = _normals(cells)
        length = row_norms(normal)
        facing = np.abs(normal[:, 2]) / np.where(length > 0, length, 1.0)
        shaded = np.array(shapes.get_facecolor())
        shaded[:, :3] *= (_AMBIENT + (1.0 - _AMBIENT) * facing)[:, None]
        shapes.set_array(None)
        shapes.set_facecolor(shaded)  # type: ignore[arg-type]  # an array is taken, too
    shapes.set_joinstyle("round")
    # Snapped to whole pixels by their own line's width, neighbours would not meet.
    shapes.set_snap(False)
    shapes.set_rasterized(len(cells) > MANY)
    return axes.add_collection(shapes, autolim=False)


def _thickness(axes: Any, cells: Polygons) -> FloatArray:
    """Return the drawn thickness (q,) of each polygon in points: its area by its diagonal."""
    low, high = axes.get_xlim()
    points_per_length = 72.0 * axes.bbox.width / axes.figure.dpi / (high - low)
    box = np.subtract(*reversed(boxes_of(cells)))
    sizes = np.maximum(row_norms(box), 1e-300)
    thickness: FloatArray = np.abs(_normals(cells)[:, 2]) / sizes * points_per_length
    return thickness


def _normals(cells: Polygons) -> FloatArray:
    """Return the vector area of each polygon, (q, 3)."""
    after = np.arange(len(cells.connectivity)) + 1
    after[cells.offsets[1:] - 1] = cells.offsets[:-1]
    centre = np.repeat(cells.points[cells.connectivity[cells.offsets[:-1]]], cells.sizes, axis=0)
    corner = cells.points[cells.connectivity] - centre
    return np.add.reduceat(np.cross(corner, corner[after]), cells.offsets[:-1]) / 2.0


def boxes_of(cells: Polygons) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corners (q, 2) of the box around each polygon in the plane."""
    corner = cells.points[cells.connectivity, :2]
    low = np.minimum.reduceat(corner, cells.offsets[:-1])
    return low, np.maximum.reduceat(corner, cells.offsets[:-1])


MOST_EDGED = 150_000
"""Number of cells above which they are drawn as pixels without visible edges, which is faster."""
_EDGE = "#c9d0d8"  # of faint cells
_FACE = "#f3f5f7"
_SECTION_LINE = 0.7  # width of the section's line in points


def surroundings(
    cutter: Cutter, points: FloatArray, matrices: Mapping[int, FloatArray]
) -> Polygons | None:
    """Return all cells of a 2D mesh under each matrix (4, 4); None in 3D: they would hide the cut.

    ``points`` are those of the mesh, ``matrices`` the transformations of the passages by number.
    """
    if cutter.dim == 3:
        return None
    cells = cutter.all_cells(points)
    return joined(
        [cells.with_points(transformed(cells.points, matrix)) for matrix in matrices.values()]
    )


def window(cut: Box, around: Polygons, ratio: float) -> Box:
    """Return the box of a 2D mesh to show around a cut, with the ratio of the room on paper.

    ``cut`` (2,), (2,) float64: corners of the box around the cut, which the result contains.
    ``around``: all cells; the result is within the box around them. ``ratio``: width by height of
    the room.
    """
    low, high = cut
    size = high - low
    wanted = np.maximum(size, [size[1] * ratio, size[0] / ratio])
    box = np.stack([(low + high - wanted) / 2.0, (low + high + wanted) / 2.0])
    corners = around.points[around.connectivity, :2]
    ends = np.stack([corners.min(axis=0), corners.max(axis=0)])
    # Where the mesh ends on one side, the box is shifted to show more of the other.
    shift = np.maximum(ends[0] - box[0], 0.0) - np.maximum(box[1] - ends[1], 0.0)
    fits = ends[1] - ends[0] >= wanted
    box = np.where(fits, box + shift, ends)
    return box[0], box[1]


def draw_around(axes: Any, around: Polygons, section: Section, box: Box) -> None:
    """Draw the cells within a box faintly, and the line or circle of a section.

    ``box`` (2,): lower and upper corner of what the axes show.
    """
    low, high = boxes_of(around)
    seen = around.take(np.flatnonzero(((high >= box[0]) & (low <= box[1])).all(axis=1)))
    if len(seen):
        many = len(seen) > MOST_EDGED
        look: dict[str, Any] = {
            "facecolors": _FACE,
            "edgecolors": _FACE if many else _EDGE,
            "linewidths": 0.3,
        }
        draw_cells(axes, seen, None, **look, zorder=0).set_rasterized(many)
    line = LineCollection(
        section.in_plane.trace(box), colors=PAPER.text, linewidths=_SECTION_LINE, zorder=3
    )
    axes.add_collection(line, autolim=False)


_OUTLINE = 0.6  # width of a bar's outline in points
_THICK = 0.14
BAR_GAP = 0.12
"""Thickness of a bar, and its distance from the axes beside it, in inches."""
BAR_BELOW = 0.62
"""Distance in inches between axes that have numbers and a label, and a bar below them."""


def bar_beside(axes: Any) -> Any:
    """Return inset axes for a color bar at the right of ``axes``, as high as these."""
    right = axes.figure.dpi_scale_trans + ScaledTranslation(1.0, 0.0, axes.transAxes)
    place = blended_transform_factory(right, axes.transAxes)
    return axes.inset_axes((BAR_GAP, 0.0, _THICK, 1.0), transform=place)


def bar_below(axes: Any, length: float, gap: float) -> Any:
    """Return inset axes for a color bar below ``axes``; its length and their gap in inches."""
    middle = axes.figure.dpi_scale_trans + ScaledTranslation(0.5, 0.0, axes.transAxes)
    return axes.inset_axes((-length / 2.0, -gap - _THICK, length, _THICK), transform=middle)


def color_bar(
    axes: Any, scale: Any, label: str, letters: float, *, inverted: bool, upright: bool
) -> Any:
    """Draw a color bar of a `color_scale`, with as many numbers as fit, and return it.

    ``axes``: see `bar_beside` and `bar_below`. ``letters``: size of the numbers in points; the
    label's is one more. ``inverted``: the lower end has the color of inverted cells.
    """
    bar = axes.figure.colorbar(
        ScalarMappable(scale.norm, scale.cmap.with_extremes(under=INVERTED_COLOR)),
        cax=axes,
        orientation="vertical" if upright else "horizontal",
        extend="min" if inverted else "neither",
        extendfrac=0.05,
    )
    bar.set_label(label, fontsize=letters + 1.0)
    axes.tick_params(labelsize=letters, width=_OUTLINE, length=3, labelcolor=PAPER.text)
    bar.outline.set_linewidth(_OUTLINE)
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
    upright = bar.orientation == "vertical"
    form = "%g"

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
