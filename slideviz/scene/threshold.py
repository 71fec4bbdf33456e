"""The threshold: the whole cells whose value is in a range; the others are faint (2D) or hidden."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.mesh.model import IntArray
from slideviz.scene import actors
from slideviz.scene.actors import CELL, POINT, VALUES, part_shape, see_through
from slideviz.scene.mesh import CellLayer, looks_inside, recolored
from slideviz.scene.stage import Layer, Stage
from slideviz.sections.threshold import cells_in_range
from slideviz.session.state import Session

NAME = "threshold"


class ThresholdLayer(Layer):
    """The cells within the threshold of the view.

    In 2D the other cells are a faint area without edges; in 3D only the outer faces of the cells
    within the threshold are drawn.

    Parameters
    ----------
    stage : Stage
    others : CellLayer
        Draws all cells; made faint while there is a threshold.

    Attributes
    ----------
    cells : (k,) int64 or None
        Indices of the cells within the threshold, in 2D the inverted ones last; None without one.
    shape : pyvista.PolyData or None
        The data set of these cells.
    """

    def __init__(self, stage: Stage, others: CellLayer) -> None:
        self.stage = stage
        self.others = others
        self.clear()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actors."""
        self.cells: IntArray | None = None
        self.shape: Any = None
        self.actor: Any = None
        self._faded = False

    @property
    def owner(self) -> IntArray:
        """Return the index (f,) of the cell that each polygon of ``shape`` belongs to."""
        return np.asarray(self.shape.cell_data[CELL])

    def pickable(self) -> list[tuple[Any, IntArray]]:
        """Return the actor of the cells with the cell of each polygon; empty if there are none."""
        if self.cells is None or not len(self.cells):
            return []
        return [(self.actor, self.owner)]

    def update(self, old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        on = new.view.threshold is not None and new.frame is not None
        self._fade(new, on)
        if not on:
            if self.actor is not None:
                self.actor.visibility = False
            self.cells = None
            return
        moved = old is None or old.frame is not new.frame or self.cells is None
        if moved or recolored(old, new) or old.view.threshold != new.view.threshold:  # type: ignore[union-attr]
            self._draw(new)
        if self.actor is not None:
            self.actor.visibility = self.shape.n_cells > 0
            self.actor.mapper.scalar_visibility = True
            self.stage.edges(self.actor.prop, "edges" in new.view.drawn)

    def _fade(self, session: Session, on: bool) -> None:
        """Make all cells, drawn below those within the threshold, faint or as usual again."""
        actor = self.others.actor
        if actor is None or session.mesh is None or not (on or self._faded):
            return
        self._faded = on
        if session.mesh.dim == 3:
            see_through(actor, 0.12 if looks_inside(session) else 1.0)
        if on:
            actor.mapper.scalar_visibility = False
            actor.prop.show_edges = False

    def _draw(self, session: Session) -> None:
        """Draw the cells within the threshold; in place if they are the same as before."""
        frame, threshold = session.frame, session.view.threshold
        assert frame is not None
        assert threshold is not None
        mesh, values = frame.mesh, self.stage.values(session)
        cells = cells_in_range(values, threshold)
        if mesh.dim == 2:
            cells = cells[np.argsort(np.isnan(values[cells]), kind="stable")]  # see `CellLayer`
        if self.cells is None or self.shape is None or not np.array_equal(cells, self.cells):
            self.shape = part_shape(mesh, cells)
            self.cells = cells
        points = mesh.points[self.shape.point_data[POINT]]
        actors.place(self.shape, points, 0.5 * self.stage.lift(mesh))
        self.shape.cell_data[VALUES] = values[self.owner]
        if self.actor is not None:
            self.actor.mapper.dataset = self.shape
        elif len(cells):  # an empty shape cannot be added
            self.actor = self.stage.add(self.shape, NAME, lighting=mesh.dim == 3)
            self.actor.prop.line_width = 1.0
            self.actor.prop.ambient, self.actor.prop.diffuse = 0.6, 0.4
