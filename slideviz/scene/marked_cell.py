"""The layer that outlines the marked cell, in front of everything else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import SELECTED_COLOR
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Mesh
from slideviz.mesh.surfaces import lifted
from slideviz.scene import actors
from slideviz.scene.actors import VALUES, part_shape
from slideviz.scene.stage import Layer, Stage
from slideviz.session.inspect import nodes_of
from slideviz.session.state import Session

OUTLINE, FACES, DOT = "mark:outline", "mark:faces", "mark:dot"
"""Names of the actors."""

IN_FRONT = -66_000.0
"""Depth offset, in 1/65536 of the depth range, that draws lines and points before everything."""


class MarkLayer(Layer):
    """The marked cell: its edges, its faces in the color of its value (3D), and a dot.

    The dot shows a cell that is smaller than a pixel. If the cell is inside a 3D mesh, the
    boundaries are made transparent (`slideviz.scene.mesh.BoundaryLayer`).

    Attributes
    ----------
    cell : int or None
        The index of the cell that is drawn.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.clear()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actors."""
        self.cell: int | None = None
        self._drawn: dict[str, Any] = {}
        # Kept here: a data set that only VTK holds may come back from a mapper without points.
        self._shapes: dict[str, Any] = {}

    def update(self, old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        cell, frame = new.view.marked_cell, new.frame
        if cell is None or frame is None or not frame.has(cell):
            for name in self._drawn:
                self.stage.remove(name)
            self.clear()
            return
        own, at = frame.place_of(cell)
        if cell != self.cell:
            self._add(own.mesh, at)
        if cell != self.cell or old is None or old.frame is not new.frame:
            self._place(own.mesh, at)
        self.cell = cell
        if FACES in self._drawn:
            shape = self._shapes[FACES]
            value = self.stage.value_of(new, cell)
            shape.cell_data[VALUES] = np.full(shape.n_cells, value)
            self._drawn[FACES].mapper.scalar_visibility = True

    def _add(self, mesh: Mesh, cell: int) -> None:
        """Make the actors of another cell, in place of the present ones."""
        for name in self._drawn:
            self.stage.remove(name)
        self._drawn = {}
        at = lifted(mesh.points[nodes_of(mesh, cell)], 0.0)
        edges = np.array(ELEMENTS[int(mesh.cells.types[cell])].edges)
        lines = np.column_stack([np.full(len(edges), 2), edges]).ravel()
        shapes = {OUTLINE: pv.PolyData(at, lines=lines), DOT: pv.PolyData(at[:1].copy())}
        if mesh.dim == 3:
            shapes[FACES] = part_shape(mesh, np.array([cell]))
            shapes[FACES].cell_data[VALUES] = np.zeros(shapes[FACES].n_cells)
        self._shapes = shapes
        for name, shape in shapes.items():
            actor = self.stage.add(shape, name, lighting=False, pickable=False)
            self._drawn[name] = actor
            if name == FACES:
                continue
            actor.prop.color = SELECTED_COLOR
            actor.prop.line_width, actor.prop.point_size = 4.0, 9.0
            actor.prop.render_points_as_spheres = name == DOT
            actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
            actor.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, IN_FRONT)
            actor.mapper.SetRelativeCoincidentTopologyPointOffsetParameter(IN_FRONT)

    def _place(self, mesh: Mesh, cell: int) -> None:
        """Move the actors to the cell's place in a deformed mesh."""
        at, lift = mesh.points[nodes_of(mesh, cell)], 3.0 * self.stage.lift(mesh)
        actors.place(self._shapes[OUTLINE], at, lift)
        actors.place(self._shapes[DOT], at.mean(axis=0)[None], lift)
        if FACES in self._shapes:
            faces = self._shapes[FACES]
            actors.place(faces, mesh.points[faces.point_data["vtkOriginalPointIds"]])
