"""Rings around inverted cells, of the same size at any zoom: slivers are found by them."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import INVERTED_COLOUR
from slideviz.mesh.model import IntArray
from slideviz.mesh.surfaces import lifted
from slideviz.scene.marked_cell import IN_FRONT
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.session.inspect import inverted_cells, middles
from slideviz.session.state import Session, StepFrame

NAME = "points:inverted"
MOST = 1000
"""Rings that are drawn; of more cells some are left out, evenly in the order of their numbers."""
SIZES = ((0, 15.0), (50, 12.0), (300, 9.0))
"""Pixels of a ring from so many on: many large ones would cover the mesh."""

_DISC = "if (len2 > 1.0) { discard; }"
"""How VTK's shader makes a round point of a square one."""
_RING = "if (len2 > 1.0 || len2 < 0.42) { discard; }"


class InvertedLayer(Layer):
    """A ring in front of everything at the middle of each inverted cell.

    Where sections cut a 3D mesh, only those on them have one: others would be thought to be there.

    Parameters
    ----------
    stage : Stage
    sections : SectionLayer
        Updated before this layer.
    """

    def __init__(self, stage: Stage, sections: SectionLayer) -> None:
        self.stage = stage
        self.sections = sections
        self.clear()

    def clear(self) -> None:
        """Forget the mesh."""
        self._key: tuple[object, ...] = ()
        self._cut: list[IntArray] = []
        self._shape: Any = None  # kept here: what only VTK holds may come back without its points
        self.stage.ring_words = ()

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        key, cut = (new.frame, _wanted(new), self.stage.pixel_scale), self._cut_cells(new)
        same = len(cut) == len(self._cut) and all(map(operator.is_, cut, self._cut))
        if key == self._key and same:
            return
        self._key, self._cut = key, cut
        self.stage.remove(NAME)
        self.stage.ring_words = ()
        if _wanted(new):
            assert new.frame is not None
            self._draw(new.frame, cut)

    def _cut_cells(self, session: Session) -> list[IntArray]:
        """Return the cells (k,) of the polygons of each section of a 3D mesh in memory."""
        if session.mesh is None or session.mesh.dim == 2 or self.sections.from_file:
            return []
        return [cells for _, cells in self.sections.pickable()]

    def _draw(self, frame: StepFrame, cut: list[IntArray]) -> None:
        """Draw the rings of a frame, of those cells only that are cut, where some are."""
        own, count = frame.extra or frame, frame.quality.inverted
        cells = inverted_cells(own)
        if cut:
            cells = cells[np.isin(cells, np.concatenate(cut))]
            count = len(cells)
        if count:
            self.stage.ring_words = ((f"{count:,} inv.", INVERTED_COLOUR),)
        if len(cells) > MOST:
            cells = cells[np.linspace(0, len(cells) - 1, MOST).astype(np.int64)]
        if not len(cells):
            return  # of a mesh in its file not all of them are in memory
        self._shape = pv.PolyData(lifted(middles(own.mesh, cells), 4.0 * self.stage.lift(own.mesh)))
        actor = self.stage.add(self._shape, NAME, lighting=False, pickable=False)
        size = next(size for least, size in reversed(SIZES) if len(cells) >= least)
        actor.prop.color = INVERTED_COLOUR
        actor.prop.point_size = size * self.stage.pixel_scale
        actor.prop.render_points_as_spheres = True
        actor.GetShaderProperty().AddFragmentShaderReplacement(_DISC, False, _RING, False)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPointOffsetParameter(IN_FRONT)


def _wanted(session: Session) -> bool:
    """Tell whether inverted cells are marked: also in a threshold that has them."""
    view, frame = session.view, session.frame
    if frame is None or not frame.quality.inverted or "inverted" not in view.drawn:
        return False
    return view.threshold is None or view.threshold[0] <= 0.0
