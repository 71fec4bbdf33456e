"""The stage: plotter, color scheme and colours of values, shared by the layers of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import LIGHT, VALUE_EDGE, ColorScheme
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.surfaces import Surface
from slideviz.scene.actors import LIFT, VALUES, draw_fine_edges, lookup_table
from slideviz.scene.color_legend import STRIP
from slideviz.sections.threshold import CellsInRange
from slideviz.session.state import Session, StepFrame

USUAL_DPI = 72.0
"""Dots per inch of a screen whose pixels are those of Qt."""


class Layer:
    """A part of the scene that draws one kind of thing.

    Its actors have names of their own, ``kind:name``, and are changed in place. A layer has those
    of these methods in which it differs from what they do here.
    """

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh; nothing of the one before is left in the plotter."""

    def update(self, old: Session | None, new: Session) -> None:
        """Draw another state of the same mesh, touching only differences; None: set all."""

    def clear(self) -> None:
        """Forget the mesh, whose actors are gone already."""

    def shapes(self) -> list[Any]:
        """Return the data sets that `Camera.fit` shows; none where others are around them."""
        return []


class Stage:
    """The plotter of a scene and what is common to its layers.

    Attributes
    ----------
    plotter : pyvista.BasePlotter
    scheme : ColorScheme
        Colours of background, text and edges.
    font_scale : float
        Enlarges the letters, for pictures of many pixels.
    table : pyvista.LookupTable
        The colours of values, and of inverted cells; changed in place.
    point_words : tuple of (str, str)
        Words and colours of the nodes drawn as points, for the legend.
    ring_words : tuple of (str, str)
        The same of what is marked by rings.
    has_legend : bool
        Whether the legend is drawn, if it is wanted, and its strip kept free.
    has_plate : bool
        Whether the legend has a half-transparent plate; not where the background is left out.
    """

    def __init__(self, plotter: Any, scheme: ColorScheme = LIGHT, font_scale: float = 1.0) -> None:
        self.plotter = plotter
        self.scheme = scheme
        self.font_scale = font_scale
        self.table = lookup_table()
        self.point_words: tuple[tuple[str, str], ...] = ()
        self.ring_words: tuple[tuple[str, str], ...] = ()
        self.has_legend = True
        self.has_plate = True
        self._values: tuple[object, FloatArray] | None = None
        self._in_threshold: tuple[FloatArray, object, CellsInRange] | None = None

    @property
    def pixel_scale(self) -> float:
        """Return how many pixels one is at normal letter size on a usual screen.

        Letters need no more than ``font_scale``: VTK enlarges them where pixels are small.
        """
        return float(self.font_scale * self.plotter.render_window.GetDPI() / USUAL_DPI)

    def add(self, shape: Any, name: str, **options: Any) -> Any:
        """Return the actor of a new data set, whose cells have no colour of their values yet."""
        valued = VALUES in shape.cell_data
        actor = self.plotter.add_mesh(
            shape,
            name=name,
            scalars=VALUES if valued else None,
            cmap=self.table if valued else None,
            clim=tuple(self.table.scalar_range) if valued else None,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
            copy_mesh=False,
            **options,
        )
        draw_fine_edges(actor)
        if valued:
            # The table's own range: pyvista gives each actor that of its data.
            actor.mapper.SetUseLookupTableScalarRange(True)
        actor.mapper.scalar_visibility = False
        return actor

    def remove(self, name: str) -> None:
        """Remove an actor, if the plotter has it."""
        self.plotter.remove_actor(name, reset_camera=False, render=False)

    def edges(self, prop: Any, shown: bool, plain: bool = False) -> None:
        """Draw the edges of an actor's cells, or not; plain ones in the color scheme's colour."""
        prop.show_edges = shown
        prop.edge_color = self.scheme.edge if plain else VALUE_EDGE
        prop.edge_opacity = 0.45

    def lift(self, mesh: Mesh) -> float:
        """Return how far lines of a mesh are drawn above its cells, in its length unit."""
        return LIFT * mesh.extent if mesh.dim == 2 else 0.0

    def strip(self) -> float:
        """Return the width of the legend's strip, in pixels."""
        if not self.has_legend:
            return 0.0
        return min(STRIP * self.pixel_scale, 0.4 * self.plotter.window_size[0])

    def values(self, session: Session) -> FloatArray:
        """Return the value of every cell of the frame that is shown, (m,), for the colours.

        Not a number for inverted cells. Made once for a frame, whatever layers ask for it.
        """
        frame, what = session.frame, session.view.colour_by
        assert frame is not None
        key = (frame, what)
        if self._values is None or self._values[0] != key:
            self._values = key, frame.shown_values(what, session.mesh)
        return self._values[1]

    def values_of(
        self, session: Session, cells: IntArray, of: StepFrame | None = None
    ) -> FloatArray:
        """Return the values of some cells (k,) only, (k,): what nobody sees is not computed.

        ``of`` is the frame that has them, if it is not the one that is shown.
        """
        frame, what = of or session.frame, session.view.colour_by
        assert frame is not None
        if self._values is not None and self._values[0] == (frame, what):
            return self._values[1][cells]
        return frame.shown_values(what, session.mesh, cells)

    def value_of(self, session: Session, cell: int) -> float:
        """Return the value of one cell, also of a worst one that is not among those drawn."""
        assert session.frame is not None
        frame, at = session.frame.place_of(cell)
        what = session.view.colour_by
        return float(frame.shown_values(what, session.mesh, np.array([at]))[0])

    def in_threshold(self, session: Session) -> CellsInRange | None:
        """Return the cells within the threshold of the view, None where there is no threshold."""
        threshold = session.view.threshold
        if threshold is None:
            return None
        values = self.values(session)
        known = self._in_threshold
        if known is None or known[0] is not values or known[1] != threshold:
            known = self._in_threshold = values, threshold, CellsInRange.of(values, threshold)
        return known[2]

    def set_colours(self, session: Session) -> None:
        """Give the table of colours the map and the range of the session."""
        low, high = session.colour_range
        self.table.scalar_range = (low, high)
        if session.view.colour_map != self.table.cmap.name:
            self.table.apply_cmap(session.view.colour_map, 256)

    def set_background(self) -> None:
        """Give the plotter the background of the color scheme."""
        scheme = self.scheme
        top = None if scheme.background == scheme.background_top else scheme.background_top
        self.plotter.set_background(scheme.background, top=top)
