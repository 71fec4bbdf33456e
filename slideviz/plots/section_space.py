"""Sections seen in space: projected in parallel, the nearest polygon drawn last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined

_ASIDE, _ABOVE = 0.55, 0.4
"""How far the camera is off the straight view, for every length that it is away."""


def camera(piece: Polygons, section: Section) -> FloatArray:
    """Return unit vectors to the right, up, and towards the camera, (3, 3).

    The camera is somewhat to the side of the straight view: the plane's normal, or the
    direction from the axis to the middle of the piece.
    """
    side, up, straight = section.shape.aslant(section, piece.points)
    eye = straight + _ASIDE * side + _ABOVE * up
    eye /= np.linalg.norm(eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def in_space(pieces: Sequence[Polygons], section: Section) -> Polygons:
    """Return the pieces as one, projected: x to the right, y up, z towards the camera."""
    every = joined(pieces)
    seen = every.with_points(every.points @ camera(pieces[0], section).T)
    return seen.by_depth()
