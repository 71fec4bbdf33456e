"""Circles and spheres of the support radius: how far the moving boundaries reach into the mesh."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from slideviz.mesh.model import FloatArray
from slideviz.mesh.surfaces import lifted
from slideviz.scene.stage import Layer, Stage
from slideviz.session.motions import support_case, support_key, support_of
from slideviz.session.state import Session
from slideviz.terms import ROLES

NAME, HALO = "support:circles", "support:halo"
PIECES = 180
"""Straight pieces of a circle."""


class SupportLayer(Layer):
    """A circle around the middle of each moving body, or in 3D a sphere as three circles."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self._key: tuple[object, ...] = ()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actor."""
        self._key = ()

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        if new.mesh is None:
            return
        shown, case = "support" in new.view.drawn, support_case(new)
        key = (
            (*support_key(case, new.mesh), self.stage.pixel_scale, self.stage.scheme)
            if shown
            else ()
        )
        if key == self._key:
            return
        self._key = key
        for name in (HALO, NAME):
            self.stage.remove(name)
        radius, boxes = support_of(case, new.mesh) if shown else (0.0, ())
        if not radius:
            return
        points = circles(np.mean(boxes, axis=1), radius)
        lines = np.arange(len(points)).reshape(-1, PIECES + 1)
        shape = pv.PolyData(
            lifted(points, 4.0 * self.stage.lift(new.mesh)),
            lines=np.insert(lines, 0, PIECES + 1, axis=1).ravel(),
        )
        # The seam in the background's color keeps the circle apart from the cells.
        for name, color, width in (
            (HALO, self.stage.scheme.background, 7.0),
            (NAME, ROLES["moving"].color, 3.5),
        ):
            actor = self.stage.add(shape, name, lighting=False, pickable=False)
            actor.prop.color = color
            actor.prop.line_width = width * self.stage.pixel_scale


def circles(middles: FloatArray, radius: float) -> FloatArray:
    """Return the points (m, d) of circles about ``middles`` (b, d), each closed and together.

    In 3D there are three about each, in the planes of the axes.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, PIECES + 1)
    dim, found = middles.shape[1], []
    for one in range(dim):
        for other in range(one + 1, dim):
            round_ = np.zeros((PIECES + 1, dim))
            round_[:, one], round_[:, other] = radius * np.cos(angle), radius * np.sin(angle)
            found.append(round_)
    return (middles[:, None, None] + np.array(found)).reshape(-1, dim)
