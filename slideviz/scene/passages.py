"""Neighbouring passages in the scene: copies of the mesh, transformed by powers of its period."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.mesh.zones import marker_zones
from slideviz.scene.mesh import BoundaryLayer, CellLayer, ThresholdLayer
from slideviz.scene.stage import KeyedLayer, Stage
from slideviz.sections.cut import transformed
from slideviz.session.passages import matrices, period_of, periods_of
from slideviz.session.state import Session

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
    return np.asarray(points[np.unique((directions @ points.T).argmax(axis=1))])


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
