"""What is marked in the scene: nodes as points, a cell by its outline, inverted cells by rings.

If a limit is chosen, the rings are around the cells that fail it instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.limits import LimitResult
from slideviz.color_scheme import INVERTED_COLOR, SELECTED_COLOR
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import IntArray
from slideviz.mesh.surfaces import Surface, facet_connectivity, lifted
from slideviz.scene.actors import VALUES, draw_in_front, part_shape
from slideviz.scene.legend import OPACITY, write
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import KeyedLayer, Layer, Stage
from slideviz.session.inspect import cell_centers, nodes_of
from slideviz.session.measure import measure
from slideviz.session.node_types import NOTHING, TypedNodes, typed_nodes
from slideviz.session.state import Session, StepFrame
from slideviz.terms import NODE_TYPES

POINT_SIZES = ((0, 9.0), (1500, 7.0), (6000, 5.0))
"""Pairs of a number of points, and their diameter in pixels from that number on."""

NODES = "points:nodes"  # the name of the actor
_POINT_COLOR = "point_color"  # name of the point data with the colors
_RGB = np.array([pv.Color(term.color).int_rgb for term in NODE_TYPES.values()], np.uint8)
"""Red, green and blue (0 to 255) of each type of node, (t, 3)."""


class PointLayer(Layer):
    """The nodes that the view asks for, drawn as small balls."""

    def clear(self) -> None:
        self._surfaces: tuple[Surface, ...] = ()
        self._drawn: TypedNodes = NOTHING
        self._key: object = ()
        self._shape: Any = None
        self.stage.point_words = ()

    def open(self, _session: Session, surfaces: Sequence[Surface]) -> None:
        self._surfaces = tuple(surfaces)

    def update(self, old: Session | None, new: Session) -> None:
        if new.mesh is None or new.frame is None:
            return
        typed = typed_nodes(new)
        key = (typed, new.view.hidden)
        if key != self._key:
            self._key = key
            self._fill(self._seen(typed, new), new)
        elif self._shape is not None and (old is None or old.frame is not new.frame):
            self._shape.points[:] = self._at(new, self._drawn.nodes)
            self._shape.GetPoints().Modified()

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
        self.stage.remove(NODES)
        self._shape = None
        if not count:
            return
        self._shape = pv.PolyData(self._at(session, typed.nodes))
        self._shape.point_data[_POINT_COLOR] = _RGB[typed.kinds]
        size = next(size for least, size in reversed(POINT_SIZES) if count >= least)
        actor = self.stage.plotter.add_mesh(
            self._shape,
            name=NODES,
            scalars=_POINT_COLOR,
            rgb=True,
            style="points",
            render_points_as_spheres=True,
            point_size=size * self.stage.pixel_scale,
            # Shading makes a ball visible on a face of the same color.
            ambient=0.25,
            diffuse=0.85,
            copy_mesh=False,
            reset_camera=False,
            render=False,
            pickable=False,
        )
        # A depth offset, so that faces and edges do not cut into the points.
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-10.0)

    def _at(self, session: Session, nodes: IntArray) -> Any:
        return lifted(
            session.shown_frame.mesh.points[nodes], 4.0 * self.stage.lift(session.opened_mesh)
        )


OUTLINE = "mark:outline"  # names of the actors
FACES = "mark:faces"
DOT = "mark:dot"


class MarkLayer(KeyedLayer):
    """The marked cell: its edges, its faces in the color of its value (3D), and a dot.

    The dot shows a cell that is smaller than a pixel. If the cell is inside a 3D mesh, the
    boundaries are made transparent (`slideviz.scene.mesh.BoundaryLayer`).
    """

    names = (OUTLINE, FACES, DOT)

    def key(self, session: Session) -> object:
        cell = session.view.marked_cell
        frame = session.frame
        return (frame, cell, session.view.color_by) if frame and frame.has(cell) else ()

    def draw(self, session: Session) -> None:
        cell = session.view.marked_cell
        assert cell is not None
        containing, at = session.shown_frame.place_of(cell)
        mesh = containing.mesh
        lift = 3.0 * self.stage.lift(mesh)
        corners = mesh.points[nodes_of(mesh, at)]
        faces = part_shape(mesh, np.array([at]))
        outline = faces.extract_all_edges()
        outline.points[:, 2] += lift
        dot = pv.PolyData(lifted(corners.mean(axis=0)[None], lift))
        for name, shape in ((OUTLINE, outline), (DOT, dot)):
            draw_in_front(self.stage.mark(shape, name, SELECTED_COLOR, 4.0, 9.0).mapper)
        if mesh.dim == 3:
            value = self.stage.value_of(session, cell)
            faces.cell_data[VALUES] = np.full(faces.n_cells, value)
            actor = self.stage.add(faces, FACES, lighting=False, pickable=False)
            actor.mapper.scalar_visibility = True


NAME = "points:inverted"
MOST = 1000  # most rings that are drawn; of more cells, some are left out, evenly by their indices
SIZES = ((0, 15.0), (50, 12.0), (300, 9.0))
"""Pairs of a number of rings, and their diameter in pixels from that number on."""

_DISC = "if (len2 > 1.0) { discard; }"
"""The line of VTK's shader that makes a square point round; `_RING` replaces it."""
_RING = "if (len2 > 1.0 || len2 < 0.42) { discard; }"
"""The replacement of `_DISC`: a ring instead of a disc."""


class InvertedLayer(KeyedLayer):
    """The rings, in front of everything, at the middle of inverted cells.

    If sections cut a 3D mesh, only the cells they cut have rings: others would seem to be on them.
    ``sections``: says which cells are cut; updated before this layer.
    """

    names = (NAME,)

    def __init__(self, stage: Stage, sections: SectionLayer) -> None:
        super().__init__(stage)
        self.sections = sections

    def clear(self) -> None:
        super().clear()
        self._cut: list[IntArray] = []
        self.stage.ring_words = ()

    def key(self, session: Session) -> object:
        self._cut = self._cut_cells(session)
        shown = session.frame, _wanted(session), session.limit_chosen
        return *shown, self.stage.pixel_scale, *map(id, self._cut)

    def draw(self, session: Session) -> None:
        self.stage.ring_words = ()
        if _wanted(session):
            self._draw(session.shown_frame, session.limit_chosen, self._cut)

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
        rings = pv.PolyData(
            lifted(cell_centers(in_memory.mesh, cells), 4.0 * self.stage.lift(in_memory.mesh))
        )
        size = next(size for least, size in reversed(SIZES) if len(cells) >= least)
        actor = self.stage.mark(rings, NAME, color, size=size * self.stage.pixel_scale)
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


class MeasureLayer(KeyedLayer):
    """The picked points, the line through them, and the number that they measure."""

    names = ("measure:rim", "measure:line", "measure:points", "measure:label")

    def key(self, session: Session) -> object:
        """Return the points and the style, if there are points."""
        if not session.view.picks:
            return ()
        stage = self.stage
        return session.frame, session.view.picks, stage.scheme, stage.pixel_scale, stage.has_plate

    def draw(self, session: Session) -> None:
        """Draw them in front of everything, in the colors of letters and background."""
        found = measure(session)
        assert found is not None
        assert session.view.picks is not None
        stage = self.stage
        rim, line, dots, label = self.names
        points = lifted(found.points, 5.0 * stage.lift(session.shown_frame.mesh))
        ends = np.arange(len(points) - 1)
        lines = facet_connectivity(np.column_stack([ends, ends + 1]))
        through = pv.PolyData(points, lines=lines)
        picked = pv.PolyData(points[: len(session.view.picks)])
        text = stage.scheme.text
        for name, shape, color, width in (
            (rim, through, stage.scheme.background, 5.0),
            (line, through, text, 2.0),
            (dots, picked, SELECTED_COLOR, 11.0),
        ):
            size = width * stage.pixel_scale
            draw_in_front(stage.mark(shape, name, color, size, size).mapper)
        middle = len(session.view.picks) == 2
        place = points[:2].mean(axis=0) if middle else points[:2][-1]
        words = write(stage, found.label, label, place, (0.0, 18.0), 14)
        words.prop.SetJustificationToCentered()
        words.prop.SetBackgroundColor(*pv.Color(stage.scheme.background).float_rgb)
        words.prop.SetBackgroundOpacity(OPACITY)


CELLS_BEFORE = "repair:cells"
MOVED_NODES = "repair:nodes"


class RepairLayer(KeyedLayer):
    """The edges of the cells that repair mended, where they were, and the nodes that it moved."""

    names = (CELLS_BEFORE, MOVED_NODES)

    def key(self, session: Session) -> object:
        """Return the repaired step and the style, if it is shown."""
        step = session.frame.step if session.frame is not None else None
        if step is None or step.repaired is None or "repaired" not in session.view.drawn:
            return ()
        return step.repaired, self.stage.pixel_scale, self.stage.scheme

    def draw(self, session: Session) -> None:
        """Draw the cells and the nodes."""
        assert session.shown_frame.step is not None
        done = session.shown_frame.step.repaired
        assert done is not None
        if not len(done.nodes):
            return
        mesh = done.mesh
        before = np.array(done.mesh.points)
        nodes = np.searchsorted(mesh.numbering.points, done.nodes)
        cells = np.isin(mesh.numbering.cells, done.cells)
        before[nodes] = done.points
        lift = 4.0 * self.stage.lift(mesh)
        edges = np.concatenate(
            [
                table[:, np.array(ELEMENTS[vtk].edges)].reshape(-1, 2)
                for vtk, (_, table) in mesh.cells.take(cells).by_type.items()
            ]
        )
        used, ends = np.unique(edges, return_inverse=True)
        lines = facet_connectivity(ends.reshape(-1, 2))
        ghost = pv.PolyData(lifted(before[used], lift), lines=lines)
        dots = pv.PolyData(lifted(mesh.points[nodes], lift))
        scale = self.stage.pixel_scale
        for name, shape, color in (
            (CELLS_BEFORE, ghost, INVERTED_COLOR),
            (MOVED_NODES, dots, SELECTED_COLOR),
        ):
            actor = self.stage.mark(shape, name, color, 1.5 * scale, 4.0 * scale)
            actor.prop.render_points_as_spheres = False
            draw_in_front(actor.mapper)
