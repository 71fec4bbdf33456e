"""The polygons of a section as a matplotlib collection: colours, light, and width of the edges."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.color_scheme import INVERTED_COLOUR, PAPER
from slideviz.mesh.model import FloatArray
from slideviz.plots.section_paint import Paint
from slideviz.sections.polygons import Polygons

MANY = 200_000
"""More polygons than these are pixels in SVG and PDF files too, or no viewer could open them."""

_THINNEST, _THICKEST, _PART = 0.04, 0.45, 0.06
"""Mesh lines in points: a part of the thickness of their cell, within limits."""

_AMBIENT = 0.7
"""What is seen along its surface has this much of its colour, in space."""


def colours_of(paint: Paint) -> Any:
    """Return what turns the numbers of a paint into colours, and makes the colour bar."""
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    table = mpl.colormaps[paint.colour_map].with_extremes(bad=INVERTED_COLOUR)
    return ScalarMappable(Normalize(*paint.limits), table)


def shapes_of(
    flat: Polygons, paint: Paint, points_per_length: float, edges: bool, lit: bool
) -> Any:
    """Return polygons as one collection.

    Parameters
    ----------
    flat : Polygons
        As they lie on paper, what is nearest last.
    paint : Paint
    points_per_length : float
        Scale of the paper: typographic points for the mesh's unit of length.
    edges : bool
        Draw mesh lines: thin ones around thin cells, or boundary layers would turn black.
    lit : bool
        Darken what is seen at an angle.
    """
    from matplotlib.collections import PolyCollection

    rings = np.split(flat.points[flat.connectivity, :2], flat.offsets[1:-1])
    faces = colours_of(paint).to_rgba(paint.shown(flat.cells))
    normal, size = _normals(flat), _sizes(flat)
    if lit:
        length = np.linalg.norm(normal, axis=1)
        facing = np.abs(normal[:, 2]) / np.where(length > 0, length, 1.0)
        faces[:, :3] *= (_AMBIENT + (1.0 - _AMBIENT) * facing)[:, None]
    thickness = np.abs(normal[:, 2]) / size * points_per_length
    # Without mesh lines a hair of the own colour hides the gaps between neighbours.
    shapes = PolyCollection(
        rings,
        facecolors=faces,
        edgecolors=PAPER.edge if edges else faces,
        linewidths=np.clip(_PART * thickness, _THINNEST, _THICKEST) if edges else 0.15,
    )
    shapes.set_joinstyle("round")
    # Moved to whole pixels, each by its own line's width, neighbours would not meet.
    shapes.set_snap(False)
    shapes.set_rasterized(len(rings) > MANY)
    return shapes


def _normals(flat: Polygons) -> FloatArray:
    """Return the vector area of each polygon, (q, 3)."""
    after = np.arange(len(flat.connectivity)) + 1
    after[flat.offsets[1:] - 1] = flat.offsets[:-1]
    centre = np.repeat(flat.points[flat.connectivity[flat.offsets[:-1]]], flat.sizes, axis=0)
    corner = flat.points[flat.connectivity] - centre
    return np.add.reduceat(np.cross(corner, corner[after]), flat.offsets[:-1]) / 2.0


def _sizes(flat: Polygons) -> FloatArray:
    """Return the diagonal of the box around each polygon, (q,), greater than 0."""
    corner = flat.points[flat.connectivity, :2]
    low = np.minimum.reduceat(corner, flat.offsets[:-1])
    high = np.maximum.reduceat(corner, flat.offsets[:-1])
    return np.maximum(np.linalg.norm(high - low, axis=1), 1e-300)
