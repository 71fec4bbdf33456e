"""Neighbouring passages in the scene: the mesh again, under powers of its period."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.scene.mesh import BoundaryLayer, CellLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.scene.threshold import ThresholdLayer
from slideviz.session.passages import find_period, moved, passages, passages_around
from slideviz.session.state import Session

PALER = 0.45
"""How much of the cells' plain colour is mixed into the colours of a neighbour."""

DIRECTIONS = 200
"""Evenly spread over the sphere; see `outermost`."""

UNENDING = 2
"""Neighbours on each side where all are asked for and a row has no end."""

CELLS, THRESHOLD = "", "\n"
"""What stands for the cells, and for those of the threshold, among the names of boundaries."""


class Period:
    """The period of a session's mesh, found once for each choice of boundaries."""

    def __init__(self) -> None:
        self._found: tuple[object, Pair | None] | None = None

    def of(self, session: Session) -> Pair | None:
        """Return the pair of boundaries whose period repeats the mesh, or None."""
        case, mesh = session.case, session.mesh
        if mesh is None:
            return None
        names = case.markers_with("periodic")
        key = (mesh, session.pairs, names, case.periodic_type, case.axis, case.origin)
        if self._found is None or self._found[0] != key:
            try:
                found = find_period(mesh, case, session.pairs)
            except SlidevizError:
                found = None  # periodic boundaries that do not match: said beside the Run button
            self._found = key, found
        return self._found[1]


def matrices(session: Session, pair: Pair | None) -> dict[int, FloatArray]:
    """Return the transformation (4, 4) of each neighbouring passage shown, by its number."""
    count = session.view.passages
    if pair is None or count == 0:
        return {}
    whole = passages_around(pair) is not None
    if count < 0 and not whole:
        count = UNENDING
    found = passages(pair, "wheel" if count < 0 else count)
    return {number: matrix for number, matrix in found.items() if number != 0}


def outermost(points: FloatArray) -> FloatArray:
    """Return the points of (n, 3) that are furthest in some of `DIRECTIONS` directions.

    Seen from any side they fill the room of all, but for a few hundredths.
    """
    rank = np.arange(DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * rank / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * rank
    across = np.sqrt(1.0 - height**2)
    ways = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    # Even as seen from a mesh that is long in one direction and short in another.
    ways /= np.maximum(np.ptp(points, axis=0), 1e-300)
    return np.asarray(points[np.unique((ways @ points.T).argmax(axis=1))])


class PassageLayer(Layer):
    """The neighbouring passages: boundaries, cells of a 2D mesh, and cells of the threshold.

    The actors of all neighbours share the data of the scene's own shapes, one mapper and one
    property for each shape: a wheel takes the memory of one passage.

    Parameters
    ----------
    stage : Stage
    cells, boundaries, threshold
        The layers whose shapes are drawn again.
    """

    def __init__(
        self, stage: Stage, cells: CellLayer, boundaries: BoundaryLayer, threshold: ThresholdLayer
    ) -> None:
        self.stage = stage
        self._cells, self._boundaries, self._threshold = cells, boundaries, threshold
        self._period = Period()
        self._table = pv.LookupTable()
        self._key: tuple[object, ...] = ()
        self._table_key: tuple[object, ...] = ()
        self._matrices: dict[int, FloatArray] = {}
        self._mappers: dict[str, Any] = {}
        self._props: dict[str, Any] = {}
        self._actors: dict[str, list[Any]] = {}

    def clear(self) -> None:
        """Forget the mesh."""
        self._period = Period()
        self._key, self._matrices = (), {}
        for copy in chain.from_iterable(self._actors.values()):
            self.stage.plotter.renderer.RemoveActor(copy)
        self._mappers, self._props, self._actors = {}, {}, {}

    def shapes(self) -> list[Any]:
        """Return the outermost points of every passage."""
        if not self._matrices:
            return []
        # Those of the threshold are within these.
        drawn = [*self._cells.shapes(), *self._boundaries.shapes()]
        every = [np.asarray(shape.points) for shape in drawn]
        ends = outermost(np.concatenate(every))
        return [pv.PolyData(moved(ends, matrix)) for matrix in self._matrices.values()]

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session; points and values are those of the mesh itself."""
        pair = self._period.of(new) if new.view.passages else None
        # The threshold has no actor before it has cells for the first time.
        key = (pair, new.view.passages, self._threshold.actor)
        if key != self._key:
            self._key = key
            self._redraw(matrices(new, pair))
        if self._matrices:
            self._style()

    def _sources(self) -> dict[str, tuple[Any, Any]]:
        """Return shape and actor of all that every passage repeats, by name."""
        found = {name: (one.shape, one.actor) for name, one in self._boundaries.drawn.items()}
        if self._cells.shape is not None:
            found[CELLS] = self._cells.shape, self._cells.actor
        if self._threshold.actor is not None:
            found[THRESHOLD] = self._threshold.shape, self._threshold.actor
        return found

    def _redraw(self, wanted: dict[int, FloatArray]) -> None:
        # Not by name through the plotter: it looks at all actors each time, and these are many.
        renderer = self.stage.plotter.renderer
        for copy in chain.from_iterable(self._actors.values()):
            renderer.RemoveActor(copy)
        self._actors, self._matrices = {}, wanted
        if not wanted:
            self._mappers, self._props = {}, {}
            return
        for name, (shape, actor) in self._sources().items():
            mapper = self._mappers.get(name) or self._mapper(shape, actor)
            self._mappers[name] = mapper
            prop = self._props.setdefault(name, pv.Property())
            made = []
            for number, matrix in wanted.items():
                copy = pv.Actor(mapper=mapper, prop=prop, name=f"copy:{number}:{name}")
                copy.user_matrix = matrix
                copy.SetShaderProperty(actor.GetShaderProperty())
                copy.SetPickable(False)
                renderer.AddActor(copy)
                made.append(copy)
            self._actors[name] = made

    def _mapper(self, shape: Any, actor: Any) -> Any:
        mapper = pv.DataSetMapper(dataset=shape)
        mapper.SetScalarModeToUseCellFieldData()
        mapper.SelectColorArray(actor.mapper.GetArrayName())
        mapper.SetLookupTable(self._table)
        # Set once, or pyvista gives the table, which all share, the range of each new data set.
        mapper.scalar_range = self._table.scalar_range
        mapper.SetUseLookupTableScalarRange(True)
        return mapper

    def _style(self) -> None:
        """Give the passages the colours of the mesh itself, paler."""
        self._pale_table()
        plain = np.array(pv.Color(self.stage.scheme.cell).float_rgb)
        for name, (shape, actor) in self._sources().items():
            mapper, prop = self._mappers[name], self._props[name]
            if mapper.dataset is not shape:  # the threshold has other cells
                mapper.dataset = shape
            mapper.scalar_visibility = actor.mapper.scalar_visibility
            prop.DeepCopy(actor.prop)
            own = np.array(actor.prop.color.float_rgb)
            prop.color = tuple(own + PALER * (plain - own))
            prop.edge_opacity = 0.5 * actor.prop.edge_opacity
            for copy in self._actors[name]:
                copy.visibility = actor.visibility
                copy.SetForceOpaque(actor.GetForceOpaque())

    def _pale_table(self) -> None:
        """Give the passages the colours of the values, paler, over the same range."""
        own = self.stage.table
        key = (own.cmap.name, tuple(own.scalar_range), self.stage.scheme)
        if key == self._table_key:
            return
        self._table_key = key
        plain = 255.0 * np.array(pv.Color(self.stage.scheme.cell).float_rgb)
        values = np.asarray(own.values, float).copy()
        values[:, :3] += PALER * (plain - values[:, :3])
        self._table.values = values.round().astype(np.uint8)
        self._table.scalar_range = own.scalar_range
        self._table.nan_color = own.nan_color
