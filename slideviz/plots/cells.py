"""Cells drawn with matplotlib: polygons in the colors of their values, edges, light."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.color_scheme import INVERTED_COLOR, PAPER
from slideviz.mesh.model import FloatArray
from slideviz.sections.polygons import Polygons

MANY = 200_000
"""Number of polygons above which they are pixels in SVG and PDF too, as viewers would fail."""

THICKEST, _THINNEST, _PART = 0.45, 0.04, 0.06
"""Width of mesh lines: largest and smallest in points; relative to the cell's thickness."""
_HAIR = 0.15
"""Width in points of a line in the cell's own color, which hides gaps between neighbours."""

_AMBIENT = 0.7
"""Brightness of a surface seen edge-on, relative to one seen face-on, with ``lit``."""


def color_scale(color_map: str, limits: tuple[float, float]) -> Any:
    """Return the ScalarMappable of a color map and its limits; NaN has the inverted color."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    table = colormaps[color_map].with_extremes(bad=INVERTED_COLOR)
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
    """Draw polygons onto axes, and return their PolyCollection.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Laid out already, with their limits, as the widths of edges depend on the scale.
    cells : Polygons
        x and y are drawn; the last polygon is drawn over the others.
    values : (q,) float64 or None
        The value of each polygon, NaN if inverted; None: all have one color.
    scale : matplotlib.cm.ScalarMappable
        The colors of the values; see `color_scale`.
    edges : float
        Largest width of mesh lines in points; they are thinner around thin cells, so that boundary
        layers do not turn black. 0: no lines.
    lit : bool
        Whether polygons are darker, the more they are tilted.
    **options
        Arguments of the PolyCollection.
    """
    from matplotlib.collections import PolyCollection

    widths = np.clip(_PART * _thickness(axes, cells), min(_THINNEST, edges), edges)
    lines = {
        "edgecolors": PAPER.edge if edges else "face",
        "linewidths": widths if edges else _HAIR,
    }
    shapes = PolyCollection(rings_of(cells), **lines | options)
    if values is not None:
        shapes.set(cmap=scale.cmap, norm=scale.norm, array=values)
        shapes.update_scalarmappable()
    if lit:
        normal = _normals(cells)
        length = np.linalg.norm(normal, axis=1)
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


def rings_of(cells: Polygons) -> list[FloatArray]:
    """Return the corners (k, 2) of each polygon in the plane, as a list."""
    corners = cells.points[cells.connectivity, :2]
    return np.split(corners, cells.offsets[1:-1]) if len(cells) else []


def _thickness(axes: Any, cells: Polygons) -> FloatArray:
    """Return the drawn thickness (q,) of each polygon in points: its area by its diagonal."""
    low, high = axes.get_xlim()
    points_per_length = 72.0 * axes.bbox.width / axes.figure.dpi / (high - low)
    found: FloatArray = np.abs(_normals(cells)[:, 2]) / _sizes(cells) * points_per_length
    return found


def _normals(cells: Polygons) -> FloatArray:
    """Return the vector area of each polygon, (q, 3)."""
    after = np.arange(len(cells.connectivity)) + 1
    after[cells.offsets[1:] - 1] = cells.offsets[:-1]
    centre = np.repeat(cells.points[cells.connectivity[cells.offsets[:-1]]], cells.sizes, axis=0)
    corner = cells.points[cells.connectivity] - centre
    return np.add.reduceat(np.cross(corner, corner[after]), cells.offsets[:-1]) / 2.0


def _sizes(cells: Polygons) -> FloatArray:
    """Return the diagonal (q,) of the box around each polygon in the plane, greater than 0."""
    low, high = boxes_of(cells)
    return np.maximum(np.linalg.norm(high - low, axis=1), 1e-300)


def boxes_of(cells: Polygons) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper corners (q, 2) of the box around each polygon in the plane."""
    corner = cells.points[cells.connectivity, :2]
    low = np.minimum.reduceat(corner, cells.offsets[:-1])
    return low, np.maximum.reduceat(corner, cells.offsets[:-1])
