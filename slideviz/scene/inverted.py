"""Rings around inverted cells, of the same size at any zoom, so that slivers can be found."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import INVERTED_COLOR
from slideviz.mesh.model import IntArray
from slideviz.mesh.surfaces import lifted
from slideviz.scene.marked_cell import IN_FRONT
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.session.inspect import inverted_cells, middles
from slideviz.session.state import Session, StepFrame

NAME = "points:inverted"
MOST = 1000
"""Most rings that are drawn; of more cells, some are left out, evenly by their indices."""
SIZES = ((0, 15.0), (50, 12.0), (300, 9.0))
"""Pairs of a number of rings, and their diameter in pixels from that number on."""

_DISC = "if (len2 > 1.0) { discard; }"
"""The line of VTK's shader that makes a square point round; `_RING` replaces it."""
_RING = "if (len2 > 1.0 || len2 < 0.42) { discard; }"
"""The replacement of `_DISC`: a ring instead of a disc."""


class InvertedLayer(Layer):
    """The rings, in front of everything, at the middle of inverted cells.

    If sections cut a 3D mesh, only the cells they cut have rings: others would seem to be on them.

    Parameters
    ----------
    stage : Stage
    sections : SectionLayer
        Says which cells are cut; updated before this layer.
    """

    def __init__(self, stage: Stage, sections: SectionLayer) -> None:
        self.stage = stage
        self.sections = sections
        self.clear()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actors."""
        self._key: tuple[object, ...] = ()
        self._cut: list[IntArray] = []
        self._shape: Any = None  # a reference in Python: VTK alone may return it without points
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
        """Return, per section of a 3D mesh in memory, the cells (k,) of its polygons."""
        if session.mesh is None or session.mesh.dim == 2 or self.sections.from_file:
            return []
        return [cells for _, cells in self.sections.pickable()]

    def _draw(self, frame: StepFrame, cut: list[IntArray]) -> None:
        """Draw the rings of a frame's inverted cells, only of those in ``cut`` if there is any."""
        own, count = frame.extra or frame, frame.quality.inverted
        cells = inverted_cells(own)
        if cut:
            cells = cells[np.isin(cells, np.concatenate(cut))]
            count = len(cells)
        if count:
            self.stage.ring_words = ((f"{count:,} inv.", INVERTED_COLOR),)
        if len(cells) > MOST:
            cells = cells[np.linspace(0, len(cells) - 1, MOST).astype(np.int64)]
        if not len(cells):
            return  # a mesh in its file has few of them in memory, or none
        self._shape = pv.PolyData(lifted(middles(own.mesh, cells), 4.0 * self.stage.lift(own.mesh)))
        actor = self.stage.add(self._shape, NAME, lighting=False, pickable=False)
        size = next(size for least, size in reversed(SIZES) if len(cells) >= least)
        actor.prop.color = INVERTED_COLOR
        actor.prop.point_size = size * self.stage.pixel_scale
        actor.prop.render_points_as_spheres = True
        actor.GetShaderProperty().AddFragmentShaderReplacement(_DISC, False, _RING, False)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPointOffsetParameter(IN_FRONT)


def _wanted(session: Session) -> bool:
    """Return whether rings are drawn: inverted cells exist, within the threshold, and toggle on."""
    view, frame = session.view, session.frame
    if frame is None or not frame.quality.inverted or "inverted" not in view.drawn:
        return False
    return view.threshold is None or view.threshold[0] <= 0.0
