"""The uncut cells around a section of a 2D mesh, drawn faintly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.mesh.model import FloatArray
from slideviz.plots.cells import boxes_of, draw_cells
from slideviz.sections.cut import Cutter
from slideviz.sections.line import Box, trace
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined
from slideviz.session.passages import moved

MOST = 150_000
"""Number of cells above which they are drawn as pixels without visible edges, which is faster."""
_EDGE, _FACE = "#c9d0d8", "#f3f5f7"
"""Colors of the faint cells' edges and faces."""

_LINE = 0.7
"""Width of the section's line in points."""


def surroundings(
    cutter: Cutter, points: FloatArray, matrices: Mapping[int, FloatArray]
) -> Polygons | None:
    """Return all cells of a 2D mesh under each matrix (4, 4); None in 3D: they would hide the cut.

    ``points`` are those of the mesh, ``matrices`` the transformations of the passages by number.
    """
    if cutter.dim == 3:
        return None
    own = cutter.all_cells(points)
    return joined([own.with_points(moved(own.points, matrix)) for matrix in matrices.values()])


def window(cut: Box, around: Polygons, ratio: float) -> Box:
    """Return the box of a 2D mesh to show around a cut, with the ratio of the room on paper.

    Parameters
    ----------
    cut : (2,), (2,) float64
        Corners of the box around the cut, which the result contains.
    around : Polygons
        All cells; the result is within the box around them.
    ratio : float
        Width by height of the room.
    """
    low, high = cut
    size = high - low
    wanted = np.maximum(size, [size[1] * ratio, size[0] / ratio])
    found = np.stack([(low + high - wanted) / 2.0, (low + high + wanted) / 2.0])
    corners = around.points[around.connectivity, :2]
    ends = np.stack([corners.min(axis=0), corners.max(axis=0)])
    # Where the mesh ends on one side, the box is shifted to show more of the other.
    shift = np.maximum(ends[0] - found[0], 0.0) - np.maximum(found[1] - ends[1], 0.0)
    fits = ends[1] - ends[0] >= wanted
    found = np.where(fits, found + shift, np.stack([ends[0], ends[1]]))
    return found[0], found[1]


def draw_around(axes: Any, around: Polygons, section: Section, box: Box) -> None:
    """Draw the cells within a box faintly, and the line or circle of a section.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    around : Polygons
    section : Section
    box : (2,), (2,) float64
        Lower and upper corner of what the axes show.
    """
    from matplotlib.collections import LineCollection

    low, high = boxes_of(around)
    seen = around.take(np.flatnonzero(((high >= box[0]) & (low <= box[1])).all(axis=1)))
    if len(seen):
        many = len(seen) > MOST
        look: dict[str, Any] = {
            "facecolors": _FACE,
            "edgecolors": _FACE if many else _EDGE,
            "linewidths": 0.3,
        }
        draw_cells(axes, seen, None, **look, zorder=0).set_rasterized(many)
    line = LineCollection(trace(section, box), colors=PAPER.text, linewidths=_LINE, zorder=3)
    axes.add_collection(line, autolim=False)
