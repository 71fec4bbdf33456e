"""What is marked in the scene: nodes as points, a cell by its outline, inverted cells by rings.

If a limit is chosen, the rings are around the cells that fail it instead.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.limits import LimitResult
from slideviz.color_scheme import INVERTED_COLOR, SELECTED_COLOR
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import IntArray, Mesh
from slideviz.mesh.surfaces import Surface, lifted
from slideviz.scene import actors
from slideviz.scene.actors import VALUES, draw_in_front, part_shape
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import KeyedLayer, Layer, Stage
from slideviz.session.inspect import cell_centers, nodes_of
from slideviz.session.node_types import NOTHING, TypedNodes, typed_nodes
from slideviz.session.state import Session, StepFrame
from slideviz.terms import NODE_TYPES

POINT_SIZES = ((0, 9.0), (1500, 7.0), (6000, 5.0))
"""Pairs of a number of points, and their diameter in pixels from that number on."""

_POINT_COLOR = "point_color"  # name of the point data with the colors
_RGB = np.array([pv.Color(term.color).int_rgb for term in NODE_TYPES.values()], np.uint8)
"""Red, green and blue (0 to 255) of each type of node, (t, 3)."""


class PointLayer(Layer):
    """The nodes that the view asks for, drawn as small balls."""

    def clear(self) -> None:
        self._surfaces: tuple[Surface, ...] = ()
        self._drawn: TypedNodes = NOTHING
        self._key: tuple[object, ...] = ()
        self._shape: Any = None
        self._actor: Any = None
        self.stage.point_words = ()

    def open(self, _session: Session, surfaces: Sequence[Surface]) -> None:
        self._surfaces = tuple(surfaces)

    def update(self, old: Session | None, new: Session) -> None:
        if new.mesh is None or new.frame is None:
            return
        typed = typed_nodes(new)
        key = (typed, new.view.hidden)
        if key != self._key and not (typed is NOTHING and self._actor is None):
            self._key = key
            self._fill(self._seen(typed, new), new)
        elif self._actor is not None and (old is None or old.frame is not new.frame):
            self._place(new)

    def _seen(self, typed: TypedNodes, session: Session) -> TypedNodes:
        """Return those of the nodes that are on a visible boundary."""
        if not session.view.hidden or not self._surfaces:
            return typed
        shown = [one.nodes for one in self._surfaces if one.name not in session.view.hidden]
        return typed.only(np.concatenate(shown) if shown else np.empty(0, np.int64))

    def _fill(self, typed: TypedNodes, session: Session) -> None:
        self._drawn = typed
        count = len(typed.nodes)
        present = [NODE_TYPES[kind] for kind in typed.present]
        self.stage.point_words = tuple((term.label, term.color) for term in present)
        if self._actor is None:
            self._shape = pv.PolyData()
            self._actor = self._make()
        self._actor.visibility = count > 0
        if not count:
            return
        shape = pv.PolyData(self._at(session, typed.nodes))
        shape.point_data[_POINT_COLOR] = _RGB[typed.kinds]
        self._shape.copy_from(shape, deep=False)
        size = next(size for least, size in reversed(POINT_SIZES) if count >= least)
        self._actor.prop.point_size = size * self.stage.pixel_scale

    def _place(self, session: Session) -> None:
        if len(self._drawn.nodes):
            self._shape.points[:] = self._at(session, self._drawn.nodes)
            self._shape.GetPoints().Modified()

    def _at(self, session: Session, nodes: IntArray) -> Any:
        assert session.mesh is not None
        assert session.frame is not None
        return lifted(session.frame.mesh.points[nodes], 4.0 * self.stage.lift(session.mesh))

    def _make(self) -> Any:
        mapper = pv.DataSetMapper(dataset=self._shape)
        # A depth offset, so that faces and edges do not cut into the points.
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-10.0)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(_POINT_COLOR)
        mapper.SetColorModeToDirectScalars()
        mapper.scalar_visibility = True
        actor = pv.Actor(mapper=mapper, name="points:nodes")
        prop = actor.prop
        prop.style = "points"
        prop.render_points_as_spheres = True
        # Shading makes a ball visible on a face of the same color.
        prop.ambient = 0.25
        prop.diffuse = 0.85
        self.stage.plotter.add_actor(
            actor, name=actor.name, reset_camera=False, render=False, pickable=False
        )
        return actor


OUTLINE = "mark:outline"  # names of the actors
FACES = "mark:faces"
DOT = "mark:dot"


class MarkLayer(Layer):
    """The marked cell: its edges, its faces in the color of its value (3D), and a dot.

    The dot shows a cell that is smaller than a pixel. If the cell is inside a 3D mesh, the
    boundaries are made transparent (`slideviz.scene.mesh.BoundaryLayer`).
    """

    def clear(self) -> None:
        self.cell: int | None = None  # the index of the cell that is drawn
        self._drawn: dict[str, Any] = {}
        # Kept here: a data set that only VTK holds may come back from a mapper without points.
        self._shapes: dict[str, Any] = {}

    def update(self, old: Session | None, new: Session) -> None:
        cell = new.view.marked_cell
        frame = new.frame
        if cell is None or frame is None or not frame.has(cell):
            for name in self._drawn:
                self.stage.remove(name)
            self.clear()
            return
        containing, at = frame.place_of(cell)
        if cell != self.cell:
            self._add(containing.mesh, at)
        if cell != self.cell or old is None or old.frame is not new.frame:
            self._place(containing.mesh, at)
        self.cell = cell
        if FACES in self._drawn:
            shape = self._shapes[FACES]
            value = self.stage.value_of(new, cell)
            shape.cell_data[VALUES] = np.full(shape.n_cells, value)
            self._drawn[FACES].mapper.scalar_visibility = True

    def _add(self, mesh: Mesh, cell: int) -> None:
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
            actor.prop.line_width = 4.0
            actor.prop.point_size = 9.0
            actor.prop.render_points_as_spheres = name == DOT
            draw_in_front(actor.mapper)

    def _place(self, mesh: Mesh, cell: int) -> None:
        at = mesh.points[nodes_of(mesh, cell)]
        lift = 3.0 * self.stage.lift(mesh)
        actors.place(self._shapes[OUTLINE], at, lift)
        actors.place(self._shapes[DOT], at.mean(axis=0)[None], lift)
        if FACES in self._shapes:
            faces = self._shapes[FACES]
            actors.place(faces, mesh.points[faces.point_data["vtkOriginalPointIds"]])


NAME = "points:inverted"
MOST = 1000  # most rings that are drawn; of more cells, some are left out, evenly by their indices
SIZES = ((0, 15.0), (50, 12.0), (300, 9.0))
"""Pairs of a number of rings, and their diameter in pixels from that number on."""

_DISC = "if (len2 > 1.0) { discard; }"
"""The line of VTK's shader that makes a square point round; `_RING` replaces it."""
_RING = "if (len2 > 1.0 || len2 < 0.42) { discard; }"
"""The replacement of `_DISC`: a ring instead of a disc."""


class InvertedLayer(Layer):
    """The rings, in front of everything, at the middle of inverted cells.

    If sections cut a 3D mesh, only the cells they cut have rings: others would seem to be on them.
    ``sections``: says which cells are cut; updated before this layer.
    """

    def __init__(self, stage: Stage, sections: SectionLayer) -> None:
        super().__init__(stage)
        self.sections = sections

    def clear(self) -> None:
        self._key: tuple[object, ...] = ()
        self._cut: list[IntArray] = []
        self._shape: Any = None  # a reference in Python: VTK alone may return it without points
        self.stage.ring_words = ()

    def update(self, _old: Session | None, new: Session) -> None:
        key = (new.frame, _wanted(new), new.limit_chosen, self.stage.pixel_scale)
        cut = self._cut_cells(new)
        same = len(cut) == len(self._cut) and all(map(operator.is_, cut, self._cut))
        if key == self._key and same:
            return
        self._key = key
        self._cut = cut
        self.stage.remove(NAME)
        self.stage.ring_words = ()
        if _wanted(new):
            assert new.frame is not None
            self._draw(new.frame, new.limit_chosen, cut)

    def _cut_cells(self, session: Session) -> list[IntArray]:
        """Return, per section of a 3D mesh in memory, the cells (k,) of its polygons."""
        if session.mesh is None or session.mesh.dim == 2 or self.sections.from_file:
            return []
        return [cells for _, cells in self.sections.pickable()]

    def _draw(self, frame: StepFrame, limit: LimitResult | None, cut: list[IntArray]) -> None:
        """Draw the rings of a frame's cells, only of those in ``cut`` if there is any.

        They are the cells that fail a ``limit``, else the inverted ones.
        """
        in_memory = frame.extra or frame
        count = frame.quality.inverted
        cells = in_memory.quality.inverted_cells()
        word = "inv."
        color = INVERTED_COLOR
        if limit is not None:
            first = len(frame.mesh.cells) if frame.extra is not None else 0
            cells = np.sort(limit.cells[limit.cells >= first]) - first
            count = len(limit.cells)
            word = "fail"
            color = SELECTED_COLOR
        if cut:
            cells = cells[np.isin(cells, np.concatenate(cut))]
            count = len(cells)
        if count:
            where = "in section" if len(cut) == 1 else "in sections"
            self.stage.ring_words = ((f"{count:,} {word}", color), *([(where, "")] if cut else []))
        if len(cells) > MOST:
            cells = cells[np.linspace(0, len(cells) - 1, MOST).astype(np.int64)]
        if not len(cells):
            return  # a mesh in its file has few of them in memory, or none
        self._shape = pv.PolyData(
            lifted(cell_centers(in_memory.mesh, cells), 4.0 * self.stage.lift(in_memory.mesh))
        )
        actor = self.stage.add(self._shape, NAME, lighting=False, pickable=False)
        size = next(size for least, size in reversed(SIZES) if len(cells) >= least)
        actor.prop.color = color
        actor.prop.point_size = size * self.stage.pixel_scale
        actor.prop.render_points_as_spheres = True
        actor.GetShaderProperty().AddFragmentShaderReplacement(_DISC, False, _RING, False)
        draw_in_front(actor.mapper)


def _wanted(session: Session) -> bool:
    """Return whether rings are drawn: inverted cells exist, within the threshold, and toggle on.

    Or a limit is chosen that cells fail.
    """
    view = session.view
    frame = session.frame
    if frame is not None and session.limit_chosen is not None:
        return len(session.limit_chosen.cells) > 0
    if frame is None or not frame.quality.inverted or "inverted" not in view.drawn:
        return False
    return view.threshold is None or view.threshold[0] <= 0.0


CELLS_BEFORE = "repair:cells"
MOVED_NODES = "repair:nodes"


class RepairLayer(KeyedLayer):
    """The edges of the cells that repair mended, where they were, and the nodes that it moved."""

    names = (CELLS_BEFORE, MOVED_NODES)

    def key(self, session: Session) -> tuple[object, ...]:
        """Return the repaired step and the style, if it is shown."""
        step = session.frame.step if session.frame is not None else None
        if step is None or step.repaired is None or "repaired" not in session.view.drawn:
            return ()
        return step.repaired, self.stage.pixel_scale, self.stage.scheme

    def draw(self, session: Session) -> None:
        """Draw the cells and the nodes."""
        if not self._key:
            return
        assert session.frame is not None
        assert session.frame.step is not None
        done = session.frame.step.repaired
        assert done is not None
        if not len(done.nodes):
            return
        mesh = done.mesh
        before = np.array(done.mesh.points)
        nodes = np.searchsorted(mesh.numbering.points, done.nodes)
        cells = np.searchsorted(mesh.numbering.cells, done.cells)
        before[nodes] = done.points
        lift = 4.0 * self.stage.lift(mesh)
        edges = np.concatenate(
            [
                table[:, np.array(ELEMENTS[vtk].edges)].reshape(-1, 2)
                for vtk, (_, table) in mesh.cells.take(cells).by_type.items()
            ]
        )
        used, ends = np.unique(edges, return_inverse=True)
        lines = np.insert(ends.reshape(-1, 2), 0, 2, axis=1).ravel()
        ghost = pv.PolyData(lifted(before[used], lift), lines=lines)
        dots = pv.PolyData(lifted(mesh.points[nodes], lift))
        self._shapes = ghost, dots  # a data set that only VTK holds may come back without points
        for name, shape, color in (
            (CELLS_BEFORE, ghost, INVERTED_COLOR),
            (MOVED_NODES, dots, SELECTED_COLOR),
        ):
            actor = self.stage.add(shape, name, lighting=False, pickable=False)
            actor.prop.color = color
            actor.prop.line_width = 1.5 * self.stage.pixel_scale
            actor.prop.point_size = 4.0 * self.stage.pixel_scale
            draw_in_front(actor.mapper)
