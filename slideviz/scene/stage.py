"""The stage: plotter, color scheme and colors of values, shared by the layers of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import VALUE_EDGE, ColorScheme
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.surfaces import Surface
from slideviz.plots.section_paint import clipped
from slideviz.scene.actors import LIFT, VALUES, draw_fine_edges, lookup_table, remove_actor
from slideviz.sections.polygons import CellsInRange
from slideviz.session.state import Session, StepFrame
from slideviz.terms import WALL_VALUES, Texts

USUAL_DPI = 72.0  # VTK's dots per inch of a screen with a device pixel ratio of 1
STRIP = 104
"""Width in pixels of the strip at the right that is free of the mesh, at normal letter size."""


class Layer:
    """The base of a scene's layers, each of which draws one kind of thing.

    A layer names its actors ``kind:name`` and changes them in place. All methods do nothing by
    default.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.clear()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh; the plotter is empty."""

    def update(self, old: Session | None, new: Session) -> None:
        """Draw another state of the same mesh: change what differs from ``old`` (None: all)."""

    def clear(self) -> None:
        """Set the state without a mesh; the scene removes the actors of the last one afterwards."""

    def shapes(self) -> list[Any]:
        """Return the data sets that `Camera.fit` shows, unless they are inside other layers'."""
        return []


class KeyedLayer(Layer):
    """The base of layers that are drawn anew whenever the key of what they show differs."""

    names: Texts = ()  # the names of its actors, removed before each drawing

    def clear(self) -> None:
        self._key: object = ()

    def update(self, _old: Session | None, new: Session) -> None:
        key = self.key(new)
        if key == self._key:
            return
        self._key = key
        self.wipe()
        if key:
            self.draw(new)

    def wipe(self) -> None:
        """Remove what was drawn."""
        for name in self.names:
            self.stage.remove(name)

    def key(self, session: Session) -> object:
        """Return everything that the drawing depends on; empty if there is nothing to draw."""
        raise NotImplementedError

    def draw(self, session: Session) -> None:
        """Draw a state of the session whose key is not empty."""
        raise NotImplementedError


class Stage:
    """The plotter of a scene, and what its layers share."""

    def __init__(self, plotter: Any, scheme: ColorScheme) -> None:
        self.plotter = plotter
        self.scheme = scheme  # Colors of background, text and edges
        self.font_scale = 1.0  # factor of the letters' size, for pictures of many pixels
        self.table = lookup_table()
        """The colors of values, and of inverted cells (NaN); changed in place."""
        self.point_words: tuple[tuple[str, str], ...] = ()
        """tuple of (str, str): texts and colors of the legend for the nodes drawn as points."""
        self.ring_words: tuple[tuple[str, str], ...] = ()
        """tuple of (str, str): texts and colors of the legend for the rings."""
        self.shapes: dict[str, Any] = {}  # the data sets of `mark`, by the names of their actors
        self.has_legend = True  # whether this scene may have a legend, and leaves its strip free
        self.has_plate = True
        """Whether the legend has a half-transparent plate; False for a transparent background."""
        self._values: tuple[object, FloatArray] | None = None
        self._in_threshold: tuple[FloatArray, object, CellsInRange] | None = None

    @property
    def pixel_scale(self) -> float:
        """Return the factor for lengths in pixels: ``font_scale`` times the screen's resolution.

        For letters ``font_scale`` is enough, as VTK scales them with the resolution.
        """
        return float(self.font_scale * self.plotter.render_window.GetDPI() / USUAL_DPI)

    def add(self, shape: Any, name: str, **options: Any) -> Any:
        """Add a data set to the plotter and return its actor, not yet colored by values."""
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
            # Use the table's range: pyvista would set that of the actor's data.
            actor.mapper.SetUseLookupTableScalarRange(True)
        actor.mapper.scalar_visibility = False
        return actor

    def mark(self, shape: Any, name: str, color: str, width: float = 1.0, size: float = 1.0) -> Any:
        """Add unlit lines and balls that the mouse cannot pick; return their actor.

        ``width``, ``size``: of lines and balls, in pixels.
        """
        # A data set that only VTK holds may come back from a mapper without points.
        self.shapes[name] = shape
        return self.add(
            shape,
            name,
            lighting=False,
            pickable=False,
            color=color,
            line_width=width,
            point_size=size,
            render_points_as_spheres=True,
        )

    def remove(self, name: str) -> None:
        """Remove an actor, if the plotter has it."""
        self.shapes.pop(name, None)
        remove_actor(self.plotter, name)

    def edges(self, prop: Any, shown: bool, plain: bool = False) -> None:
        """Switch the edges of an actor's cells on or off.

        ``plain``: in the color scheme's edge color, else in that for cells colored by values.
        """
        prop.show_edges = shown
        prop.edge_color = self.scheme.edge if plain else VALUE_EDGE
        prop.edge_opacity = 0.45

    def lift(self, mesh: Mesh) -> float:
        """Return the height of lines above the cells of a 2D mesh, in its length unit; 0 in 3D."""
        return LIFT * mesh.extent if mesh.dim == 2 else 0.0

    def strip(self) -> float:
        """Return the width of the legend's strip in pixels; 0 without a legend."""
        if not self.has_legend:
            return 0.0
        return min(STRIP * self.pixel_scale, 0.4 * self.plotter.window_size[0])

    def values(self, session: Session) -> FloatArray:
        """Return the values (m,) that color the cells of the shown frame, cached.

        As `StepFrame.shown_values` has them: see `drawn` for their colors.
        """
        frame = session.shown_frame
        what = session.view.color_by
        key = (frame, what, session.reference)
        if self._values is None or self._values[0] != key:
            self._values = key, frame.shown_values(what, session.reference)
        return self._values[1]

    @staticmethod
    def drawn(session: Session, values: FloatArray) -> FloatArray:
        """Return `values` as the table of colors takes them: of no wall above its range."""
        by_wall = session.view.color_by in WALL_VALUES
        return clipped(values, session.color_range) if by_wall else values

    def values_of(
        self, session: Session, cells: IntArray, of: StepFrame | None = None
    ) -> FloatArray:
        """Return the values (k,) by which cells (k,) are colored, computed for these only.

        ``of`` is the frame with the cells, by default the shown one.
        """
        frame = of or session.frame
        what = session.view.color_by
        reference = session.reference
        assert frame is not None
        if self._values is not None and self._values[0] == (frame, what, reference):
            return self.drawn(session, self._values[1][cells])
        return self.drawn(session, frame.shown_values(what, reference, cells))

    def value_of(self, session: Session, cell: int) -> float:
        """Return the value of one cell, which may be a worst cell of a mesh in its file."""
        frame, at = session.shown_frame.place_of(cell)
        what = session.view.color_by
        return float(frame.shown_values(what, session.reference, np.array([at]))[0])

    def in_threshold(self, session: Session) -> CellsInRange | None:
        """Return the cells within the view's threshold; None if there is no threshold."""
        threshold = session.view.threshold
        if threshold is None:
            return None
        values = self.values(session)
        known = self._in_threshold
        if known is None or known[0] is not values or known[1] != threshold:
            known = self._in_threshold = values, threshold, CellsInRange.of(values, threshold)
        return known[2]

    def set_colors(self, session: Session) -> None:
        """Set color map and range of the table of colors to those of the session."""
        low, high = session.color_range
        self.table.scalar_range = (low, high)
        at_walls = session.view.color_by in WALL_VALUES
        self.table.above_range_color = self.scheme.cell if at_walls else None
        if session.color_map != self.table.cmap.name:
            self.table.apply_cmap(session.color_map, 256)

    def set_background(self) -> None:
        """Set the plotter's background to that of the color scheme."""
        scheme = self.scheme
        top = None if scheme.background == scheme.background_top else scheme.background_top
        self.plotter.set_background(scheme.background, top=top)
