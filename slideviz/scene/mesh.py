"""The mesh in the scene: boundaries in full or coarse detail; cells, all or within a threshold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import SELECTED_COLOR
from slideviz.mesh.model import NO_NODES, FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import INVERTED
from slideviz.mesh.surfaces import Surface, enclosing_of, padded
from slideviz.mesh.zones import marker_zones
from slideviz.scene import actors
from slideviz.scene.actors import CELL, POINT, VALUES, Band, DrawnBoundary, part_shape, see_through
from slideviz.scene.stage import KeyedLayer, Layer, Stage
from slideviz.sections.cut import transformed
from slideviz.sections.polygons import Polygons, cells_in_range
from slideviz.session.passages import matrices, period_of, periods_of
from slideviz.session.section_cuts import NO_POLYGONS
from slideviz.session.state import Session, StepFrame
from slideviz.terms import ROLES, WALL_VALUES

if TYPE_CHECKING:
    from slideviz.scene.sections import SectionLayer


FADED = 0.3  # opacity of a 2D mesh while sections show the cells on them
VEIL = 0.65  # opacity of the veil over the halo cells of a 2D mesh: they are not in the domain
GLASS = 0.15  # opacity of boundaries that enclose moving ones, while colors show roles
SEE_THROUGH = 0.25
"""Opacity of boundaries while the marked cell is inside the mesh, beside none of them."""


def recolored(old: Session | None, new: Session) -> bool:
    """Return whether the cells' values may differ between two sessions."""
    return (
        old is None
        or old.frame is not new.frame
        or old.view.color_by != new.view.color_by
        or old.reference is not new.reference
        or (new.view.color_by in WALL_VALUES and old.color_range != new.color_range)
    )


class CellLayer(Layer):
    """The cells of a 2D mesh; of a 3D mesh without boundaries, the outside of its cells."""

    part: IntArray | None = None
    """(k,): indices of the cells of a 3D mesh whose outside is drawn; None for all."""

    def clear(self) -> None:
        self.polygons = NO_POLYGONS  # the cells of a 2D mesh, in the order of the mesh
        self.cells = NO_NODES  # those whose polygons are drawn, in the order of drawing
        self.shape: Any = None
        self.actor: Any = None
        self._veil: tuple[Any, Any] | None = None

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        mesh = session.opened_mesh
        if mesh.dim == 2:
            every = np.arange(len(mesh.cells))
            cells = mesh.cells.offsets, mesh.cells.connectivity, every
            self.polygons = Polygons(padded(mesh.points), *cells).of_file_cells(mesh, sides=False)
            self.cells = self.polygons.cells
            shape = actors.polygon_shape(self.polygons)
        elif not surfaces:
            part = np.arange(len(mesh.cells)) if self.part is None else self.part
            shape = actors.part_shape(mesh, part)
            shape.cell_data[VALUES] = np.zeros(shape.n_cells)
        else:
            return
        self.shape = shape
        self.actor = self.stage.add(shape, "cells", lighting=mesh.dim == 3)
        self.actor.prop.line_width = 1.0
        if mesh.dim == 3:
            # A sum above 1 would give brighter colors than the color bar has.
            self.actor.prop.ambient = 0.6
            self.actor.prop.diffuse = 0.4
        elif mesh.halo is not None:
            veil = actors.part_shape(mesh, np.flatnonzero(mesh.halo.cells))
            self._veil = veil, self.stage.add(veil, "halo", lighting=False, pickable=False)
            self._veil[1].prop.opacity = VEIL

    def _stack(self, frame: StepFrame) -> None:
        """Draw the inverted cells of a 2D mesh last, so that overlapping cells do not hide them."""
        folded = frame.quality.status == INVERTED
        polygons = self.polygons.with_last(folded[self.polygons.cells])
        if not np.array_equal(polygons.cells, self.cells):
            self.cells = polygons.cells
            self.shape.SetPolys(actors.polygon_table(polygons))

    def shapes(self) -> list[Any]:
        return [] if self.shape is None else [self.shape]

    def points(self, mesh: Mesh) -> FloatArray:
        """Return the points (k, d) of the drawn shape in another state of the mesh."""
        if self.shape is None or mesh.dim == 2:
            return mesh.points
        return mesh.points[self.shape.point_data[POINT]]

    def update(self, old: Session | None, new: Session) -> None:
        if self.actor is None or new.mesh is None or new.frame is None:
            return
        by_value = new.view.color_by != "role"
        if old is None or old.frame is not new.frame:
            actors.place(self.shape, self.points(new.frame.mesh))
            if new.mesh.dim == 2:
                self._stack(new.frame)
        if by_value and recolored(old, new):
            if new.mesh.dim == 3:
                values = self.stage.values_of(new, self.shape.cell_data[CELL])
            else:
                values = self.stage.drawn(new, self.stage.values(new))[self.cells]
            self.shape.cell_data[VALUES] = values
        self.actor.mapper.scalar_visibility = by_value
        self.actor.prop.color = self.stage.scheme.cell
        if self._veil is not None:
            veil, actor = self._veil
            points = new.frame.mesh.points
            lift = self.stage.lift(new.mesh)
            actors.place(veil, points[veil.point_data[POINT]], 0.5 * lift)
            actor.prop.color = self.stage.scheme.background
        inside = looks_inside(new)
        if new.mesh.dim == 3:
            see_through(self.actor, 0.12 if inside else 1.0)
        else:
            self.actor.prop.opacity = FADED if is_faded(new) else 1.0
        self.stage.edges(self.actor.prop, "edges" in new.view.drawn and not inside, not by_value)


class BoundaryLayer(Layer):
    """The boundaries, an actor each, with a band around the selected ones."""

    def clear(self) -> None:
        self.drawn: dict[str, DrawnBoundary] = {}  # the boundaries by name
        self.bands: dict[str, Band] = {}
        """The bands by name of the boundaries that are selected, or have been."""
        self.glass: frozenset[str] = frozenset()
        """Names of the boundaries that are transparent because they enclose moving ones."""
        self._lift = 0.0
        self._closed = self._buried = False
        self._enclosed: frozenset[str] = frozenset()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        self._lift = self.stage.lift(session.opened_mesh)
        for surface in surfaces:
            self.drawn[surface.name] = self._add(surface, session.opened_mesh.points)
        enclosing = enclosing_of(session.opened_mesh, surfaces)
        self._closed = enclosing.closed
        self._enclosed = enclosing.inner

    def shapes(self) -> list[Any]:
        return [boundary.shape for boundary in self.drawn.values()]

    def _add(self, surface: Surface, points: FloatArray) -> DrawnBoundary:
        shape = actors.surface_shape(surface, points, 2 * self._lift)
        actor = self.stage.add(shape, f"marker:{surface.name}", lighting=not surface.flat)
        if not surface.flat:
            actor.prop.ambient = 0.6
            actor.prop.diffuse = 0.4
        return DrawnBoundary(surface, shape, actor)

    def _add_band(self, surface: Surface, points: FloatArray) -> Band:
        rim = actors.rim_shape(surface, points, self._lift)
        band = self.stage.add(rim, f"selected:{surface.name}", lighting=False)
        band.prop.color = SELECTED_COLOR
        band.prop.line_width = 11 if surface.flat else 6
        band.prop.opacity = 1.0
        if not surface.flat:
            # Lines on a face flicker unless they have a depth offset.
            band.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-4.0, -4.0)
        return Band(rim, band)

    def update(self, old: Session | None, new: Session) -> None:
        if new.mesh is None or new.frame is None or not self.drawn:
            return
        if old is None or old.frame is not new.frame:
            self._place(new.frame.mesh.points)
        # In 2D, first layers of cells may be thinner than a pixel.
        by_value = new.view.color_by in WALL_VALUES or (
            new.view.color_by != "role" and new.mesh.dim == 3
        )
        if by_value and recolored(old, new):
            for boundary in self.drawn.values():
                boundary.shape.cell_data[VALUES] = self.stage.values_of(new, boundary.surface.owner)
        self.glass = self._glass(new)
        self._buried = self._hides_mark(new)
        for name, boundary in self.drawn.items():
            self._style(name, boundary, new, by_value)
        # From outside, the back faces are invisible: culled, they cost no drawing time.
        culled = self._closed and not self.glass and seen_from_outside(new)
        for boundary in self.drawn.values():
            boundary.actor.prop.culling = "back" if culled else "none"

    def _glass(self, session: Session) -> frozenset[str]:
        """Return the names of boundaries that enclose moving ones, if colors show roles."""
        view = session.view
        within = (name for name in self._enclosed if name not in view.hidden)
        if view.color_by != "role" or all(session.role(name) != "moving" for name in within):
            return frozenset()
        return frozenset(self.drawn) - self._enclosed

    def _hides_mark(self, session: Session) -> bool:
        """Return whether the marked cell of a 3D mesh is beside none of the boundaries shown."""
        cell = session.view.marked_cell
        mesh = session.mesh
        hidden = session.view.hidden
        if mesh is None or mesh.dim == 2 or session.frame is None or not session.frame.has(cell):
            return False
        shown = (boundary for name, boundary in self.drawn.items() if name not in hidden)
        return not any((boundary.surface.owner == cell).any() for boundary in shown)

    def _place(self, points: FloatArray) -> None:
        for boundary in self.drawn.values():
            positions = points[boundary.surface.nodes]
            actors.place(boundary.shape, positions, 2 * self._lift)
            if boundary.surface.name in self.bands:
                actors.place(self.bands[boundary.surface.name].shape, positions, self._lift)

    def _style(self, name: str, boundary: DrawnBoundary, session: Session, by_value: bool) -> None:
        view = session.view
        shown = name not in view.hidden
        boundary.actor.visibility = shown
        lit = shown and name in view.selected
        if lit and name not in self.bands and session.frame is not None:
            self.bands[name] = self._add_band(boundary.surface, session.frame.mesh.points)
        if name in self.bands:
            self.bands[name].actor.visibility = lit
        boundary.actor.prop.color = ROLES[session.role(name)].color
        boundary.actor.mapper.scalar_visibility = by_value
        if boundary.surface.flat:
            boundary.actor.prop.line_width = 4.5 if view.color_by == "role" or by_value else 3.0
        else:
            self.stage.edges(boundary.actor.prop, "edges" in view.drawn)
            inside = looks_inside(session)
            glass = name in self.glass
            opacity = SEE_THROUGH if self._buried else 1.0
            if inside:
                opacity = 0.12
            elif glass:
                opacity = GLASS
            see_through(boundary.actor, opacity)
            if inside or self._buried:
                boundary.actor.prop.show_edges = False


def looks_inside(session: Session) -> bool:
    """Return whether boundaries of a 3D mesh are transparent: with a threshold or sections."""
    view = session.view
    if session.mesh is None or session.mesh.dim == 2:
        return False
    return view.threshold is not None or any(section.shown for section in view.sections)


def is_faded(session: Session) -> bool:
    """Return whether the cells of a 2D mesh are faint: while sections are shown."""
    if session.mesh is None or session.mesh.dim == 3:
        return False
    return any(section.shown and section.can_cut(2) for section in session.view.sections)


def seen_from_outside(session: Session) -> bool:
    """Return whether only the outer side of a 3D mesh's boundaries can be seen."""
    view = session.view
    glass = view.hidden or "perspective" in view.drawn or looks_inside(session)
    # The faces of inverted cells are oriented inwards.
    return not glass and session.frame is not None and session.frame.quality.inverted == 0


NAME = "threshold"


class ThresholdLayer(Layer):
    """The cells within the threshold of the view.

    In 2D the other cells are a faint area without edges; in 3D only the outer faces of the cells
    within the threshold are drawn. ``others`` draws all cells; made faint while there is one.
    """

    def __init__(self, stage: Stage, others: CellLayer) -> None:
        super().__init__(stage)
        self.others = others

    def clear(self) -> None:
        self.cells: IntArray | None = None
        """(k,): the cells within the threshold, in 2D the inverted ones last; None without one."""
        self.shape: Any = None  # the data set of these cells
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
        frame = session.shown_frame
        threshold = session.view.threshold
        assert threshold is not None
        mesh = frame.mesh
        values = self.stage.values(session)
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
            self.actor.prop.ambient = 0.6
            self.actor.prop.diffuse = 0.4


class CoarseLayer(Layer):
    """The coarse boundaries, drawn in place of those in full detail while ``on``.

    They copy the properties of ``boundaries``; the edges of ``sections`` are off meanwhile.
    """

    surfaces: Mapping[str, Surface] = MappingProxyType({})
    """The coarse boundaries by name, set before a mesh is opened; empty for small meshes."""

    def __init__(self, stage: Stage, boundaries: BoundaryLayer, sections: SectionLayer) -> None:
        super().__init__(stage)
        self._sections = sections
        self._boundaries = boundaries

    def clear(self) -> None:
        self.on = False  # whether they are drawn
        self.drawn: dict[str, DrawnBoundary] = {}
        self._made_of: object = ()
        self._session = Session()
        self._edged: list[Any] = []

    def update(self, _old: Session | None, new: Session) -> None:
        self._session = new
        if self.on:
            self._draw()

    def switch(self, on: bool) -> bool:
        """Switch to coarse boundaries, or back; return whether anything has changed."""
        if on == self.on or (on and not self.surfaces):
            return False
        self.on = on
        if on:
            self._draw()
            return True
        for name, boundary in self.drawn.items():
            self._boundaries.drawn[name].actor.visibility = boundary.actor.visibility
            boundary.actor.visibility = False
        for prop in self._edged:
            prop.show_edges = True
        self._edged = []
        return True

    def _draw(self) -> None:
        session = self._session
        if not self.drawn:
            self.drawn = {name: self._add(surface) for name, surface in self.surfaces.items()}
        made_of = session.shown_frame, session.view.color_by, session.color_range
        again = made_of != self._made_of
        self._made_of = made_of
        for name, boundary in self.drawn.items():
            full = self._boundaries.drawn[name].actor
            if again:
                actors.place(
                    boundary.shape, session.shown_frame.mesh.points[boundary.surface.nodes]
                )
            if again and session.view.color_by != "role":
                boundary.shape.cell_data[VALUES] = self.stage.values_of(
                    session, boundary.surface.owner
                )
            boundary.actor.prop.DeepCopy(full.prop)
            boundary.actor.prop.show_edges = False
            see_through(boundary.actor, full.prop.opacity)
            boundary.actor.mapper.scalar_visibility = full.mapper.scalar_visibility
            boundary.actor.visibility = full.visibility
            full.visibility = False
        props = [boundary.actor.prop for boundary in self._sections.drawn.values()]
        self._edged = [prop for prop in props if prop.show_edges or prop in self._edged]
        for prop in self._edged:
            prop.show_edges = False

    def _add(self, surface: Surface) -> DrawnBoundary:
        shape: Any = actors.surface_shape(surface, self._session.opened_mesh.points)
        return DrawnBoundary(
            surface, shape, self.stage.add(shape, f"coarse:{surface.name}", pickable=False)
        )


PALER = 0.45
"""Part of the cells' plain color that is mixed into the colors of a neighbouring passage."""

DIRECTIONS = 200  # number of directions, evenly spread over the sphere, in `outermost`

CELLS = ""
THRESHOLD = "\n"
"""Keys, among names of boundaries, of the cells and of those within the threshold."""


def outermost(points: FloatArray) -> FloatArray:
    """Return those points of (n, 3) that are furthest in at least one of `DIRECTIONS` directions.

    From any side their extent is that of all points, except for a few hundredths.
    """
    rank = np.arange(DIRECTIONS) + 0.5
    height = 1.0 - 2.0 * rank / DIRECTIONS
    turn = np.pi * (1.0 + 5.0**0.5) * rank
    across = np.sqrt(1.0 - height**2)
    directions = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    # Scaled by the extents, so that they are evenly spread for a long or flat mesh too.
    directions /= np.maximum(np.ptp(points, axis=0), 1e-300)
    return points[np.unique((directions @ points.T).argmax(axis=1))]


class PassageLayer(KeyedLayer):
    """The neighbouring passages: boundaries, cells of a 2D mesh, cells within the threshold.

    The actors of all neighbours share the data sets of the scene, and per data set one mapper and
    one property: a whole wheel takes the memory of one passage. ``cells``, ``boundaries``,
    ``threshold``: the layers whose data sets are drawn again.
    """

    def __init__(
        self, stage: Stage, cells: CellLayer, boundaries: BoundaryLayer, threshold: ThresholdLayer
    ) -> None:
        self._cells = cells
        self._boundaries = boundaries
        self._threshold = threshold
        self._table = pv.LookupTable()
        self._table_key: object = ()
        self._actors: dict[str, list[Any]] = {}
        super().__init__(stage)

    def clear(self) -> None:
        super().clear()
        self.wipe()
        self._mappers: dict[str, Any] = {}
        self._props: dict[str, Any] = {}

    def wipe(self) -> None:
        # Not through the plotter, which goes through all its actors for each one.
        for copy in chain.from_iterable(self._actors.values()):
            self.stage.plotter.renderer.RemoveActor(copy)
        self._actors = {}
        self._matrices: list[FloatArray] = []

    def shapes(self) -> list[Any]:
        if not self._matrices:
            return []
        # The cells within the threshold are inside the boundaries.
        drawn = [*self._cells.shapes(), *self._boundaries.shapes()]
        every = [np.asarray(shape.points) for shape in drawn]
        ends = outermost(np.concatenate(every))
        return [pv.PolyData(transformed(ends, matrix)) for matrix in self._matrices]

    def update(self, old: Session | None, new: Session) -> None:
        super().update(old, new)
        if self._matrices:
            self._style()

    def _repeats(self, session: Session, pair: Pair, name: str) -> bool:
        """Return whether a pair repeats a boundary, or what is shown of the cells of all zones."""
        mesh = session.mesh
        if mesh is None or period_of(session) is not None:
            return True
        zones = dict(zip(mesh.marker_names, marker_zones(mesh), strict=True))
        return zones[pair.first] == zones.get(name)

    def key(self, session: Session) -> object:
        # The threshold's actor is made when it first has cells.
        pairs = periods_of(session) if session.view.passages else ()
        return pairs, session.view.passages, self._threshold.actor

    def _sources(self) -> dict[str, tuple[Any, Any]]:
        """Return data set and actor of everything that the passages repeat, by name."""
        sources = {name: (one.shape, one.actor) for name, one in self._boundaries.drawn.items()}
        if self._cells.shape is not None:
            sources[CELLS] = self._cells.shape, self._cells.actor
        if self._threshold.actor is not None:
            sources[THRESHOLD] = self._threshold.shape, self._threshold.actor
        return sources

    def draw(self, session: Session) -> None:
        wanted = [(pair, matrices(session, pair)) for pair in periods_of(session)]
        self._matrices = [matrix for _, turns in wanted for matrix in turns.values()]
        if not self._matrices:
            self._mappers = {}
            self._props = {}
            return
        for name, (shape, actor) in self._sources().items():
            mapper = self._mappers.get(name) or self._mapper(shape, actor)
            self._mappers[name] = mapper
            prop = self._props.setdefault(name, pv.Property())
            made = []
            turns = [some for pair, some in wanted if self._repeats(session, pair, name)]
            for number, matrix in chain.from_iterable(some.items() for some in turns):
                copy = pv.Actor(mapper=mapper, prop=prop, name=f"copy:{number}:{name}")
                copy.user_matrix = matrix
                copy.SetShaderProperty(actor.GetShaderProperty())
                copy.SetPickable(False)
                self.stage.plotter.renderer.AddActor(copy)
                made.append(copy)
            self._actors[name] = made

    def _mapper(self, shape: Any, actor: Any) -> Any:
        mapper = pv.DataSetMapper(dataset=shape)
        mapper.SetScalarModeToUseCellFieldData()
        mapper.SelectColorArray(actor.mapper.GetArrayName())
        mapper.SetLookupTable(self._table)
        # Set before: otherwise pyvista sets the shared table to the range of each new data set.
        mapper.scalar_range = self._table.scalar_range
        mapper.SetUseLookupTableScalarRange(True)
        return mapper

    def _style(self) -> None:
        """Set the colors of the passages: those of the mesh itself, paler."""
        self._pale_table()
        plain = np.array(pv.Color(self.stage.scheme.cell).float_rgb)
        for name, (shape, actor) in self._sources().items():
            mapper = self._mappers[name]
            prop = self._props[name]
            if mapper.dataset is not shape:  # the threshold has other cells
                mapper.dataset = shape
            mapper.scalar_visibility = actor.mapper.scalar_visibility
            prop.DeepCopy(actor.prop)
            color = np.array(actor.prop.color.float_rgb)
            prop.color = tuple(color + PALER * (plain - color))
            prop.edge_opacity = 0.5 * actor.prop.edge_opacity
            for copy in self._actors[name]:
                copy.visibility = actor.visibility
                copy.SetForceOpaque(actor.GetForceOpaque())

    def _pale_table(self) -> None:
        """Set the passages' table of colors: the stage's, paler, over the same range."""
        table = self.stage.table
        key = (table.cmap.name, tuple(table.scalar_range), self.stage.scheme)
        if key == self._table_key:
            return
        self._table_key = key
        plain = 255.0 * np.array(pv.Color(self.stage.scheme.cell).float_rgb)
        values = np.asarray(table.values, float).copy()
        values[:, :3] += PALER * (plain - values[:, :3])
        self._table.values = values.round().astype(np.uint8)
        self._table.scalar_range = table.scalar_range
        self._table.nan_color = table.nan_color
