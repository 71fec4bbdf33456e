"""The scene: boundaries, cells, sections, ghosts and legend in a given plotter.

The plotter may be the window's or an off-screen one. A scene consists of layers, one for each
kind of thing. Only they and `slideviz.scene.actors` make VTK objects, in the thread that owns the
plotter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import LIGHT, ColorScheme
from slideviz.mesh.model import FloatArray, IntArray, Mesh, row_norms
from slideviz.mesh.surfaces import Surface, padded
from slideviz.scene import pick
from slideviz.scene.actors import CELL, DrawnBoundary
from slideviz.scene.camera import Camera
from slideviz.scene.ghosts import BoxLayer, GhostLayer, SupportLayer
from slideviz.scene.legend import LegendLayer, PreviewLayer, TriadLayer
from slideviz.scene.marked_cells import (
    InvertedLayer,
    MarkLayer,
    MeasureLayer,
    PointLayer,
    RepairLayer,
)
from slideviz.scene.mesh import BoundaryLayer, CellLayer, CoarseLayer, PassageLayer, ThresholdLayer
from slideviz.scene.overview import Overview
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.session.colors import with_drawable_colors
from slideviz.session.inspect import cell_at, nodes_of, surroundings
from slideviz.session.measure import Pick
from slideviz.session.state import Session
from slideviz.session.store import notify

NEAR = 8.0  # height of the view after flying to a cell, in sizes of the cell


class Scene:
    """Draws the state of a session into a plotter.

    ``plotter``: where to draw. ``scheme``: colors of background, text and edges.
    """

    def __init__(self, plotter: Any, scheme: ColorScheme = LIGHT) -> None:
        self.stage = Stage(plotter, scheme)
        self._cells = CellLayer(self.stage)
        self._boundaries = BoundaryLayer(self.stage)
        self._threshold = ThresholdLayer(self.stage, self._cells)
        self._ghosts = GhostLayer(self.stage)
        self.sections = SectionLayer(self.stage)
        self._coarse = CoarseLayer(self.stage, self._boundaries, self.sections)
        self.layers: tuple[Layer, ...] = (
            self._cells,
            self._boundaries,
            self._threshold,
            self.sections,
            MarkLayer(self.stage),
            self._ghosts,
            BoxLayer(self.stage),
            SupportLayer(self.stage),
            PassageLayer(self.stage, self._cells, self._boundaries, self._threshold),
            PointLayer(self.stage),
            InvertedLayer(self.stage, self.sections),
            RepairLayer(self.stage),
            MeasureLayer(self.stage),
            LegendLayer(self.stage),
            TriadLayer(self.stage),
            PreviewLayer(self.stage),
            self._coarse,
        )
        self.camera = Camera(self.stage, self._shapes)
        self.session = Session()
        self.set_scheme(scheme)

    @property
    def plotter(self) -> Any:
        """Return the plotter that the scene draws into."""
        return self.stage.plotter

    @property
    def scheme(self) -> ColorScheme:
        """Return the color scheme."""
        return self.stage.scheme

    @property
    def drawn(self) -> dict[str, DrawnBoundary]:
        """Return the boundaries, by name."""
        return self._boundaries.drawn

    @property
    def polygons(self) -> int:
        """Return the number of polygons of cells drawn; boundaries and sections do not count."""
        return 0 if self._cells.shape is None else int(self._cells.shape.n_cells)

    # What is in the scene ---------------------------------------------------------------
    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh with its boundaries, and fit it to the view."""
        for _ in self.opening(session, surfaces):
            pass

    def opening(
        self, session: Session, surfaces: Sequence[Surface], part: IntArray | None = None
    ) -> Iterator[None]:
        """Draw another mesh as `open` does, yielding after each layer.

        ``part`` are the indices (k,) of the cells of a 3D mesh to draw if ``surfaces`` is empty.
        """
        self.clear()
        self._cells.part = part
        session = with_drawable_colors(session)
        if session.mesh is None:
            return
        self.session = session
        self.stage.set_colors(session)
        for layer in self.layers:
            layer.open(session, surfaces)
            layer.update(None, session)
            yield
        self.look_from("+z" if session.mesh.dim == 2 else "iso")

    def clear(self) -> None:
        """Remove everything from the scene."""
        for layer in self.layers:
            layer.clear()
        self.plotter.clear_actors()
        self.stage.shapes.clear()
        self.session = Session()

    def update(self, session: Session) -> None:
        """Draw another state of the same mesh; layers change only what differs."""
        session = with_drawable_colors(session)
        old = self.session
        self.session = session
        if session.mesh is None or old.mesh is None:
            return
        self.stage.set_colors(session)
        notify((layer.update for layer in self.layers), old, session)
        if "perspective" in old.view.drawn ^ session.view.drawn:
            self.plotter.camera.parallel_projection = self._parallel()

    def set_scheme(self, scheme: ColorScheme) -> None:
        """Take another color scheme for background, letters and edges."""
        self.stage.scheme = scheme
        self.stage.set_background()
        self._redraw()

    def set_legend(self, drawn: bool) -> None:
        """Switch the legend and its strip on or off (off: a view beside this one has it)."""
        self.stage.has_legend = drawn
        self.resized()

    def resized(self) -> None:
        """Place the legend anew after the view's size has changed."""
        self.camera.shift()
        self._redraw()

    def _redraw(self) -> None:
        if self.session.mesh is not None:
            notify((layer.update for layer in self.layers), self.session, self.session)

    # While the camera moves --------------------------------------------------------------
    @property
    def coarse(self) -> bool:
        """Return whether the coarse boundaries are drawn."""
        return self._coarse.on

    def draw_coarse(self, on: bool) -> bool:
        """Switch to coarse boundaries, or back; return whether anything has changed."""
        return self._coarse.switch(on)

    def set_coarse_boundaries(self, surfaces: Sequence[Surface]) -> None:
        """Set the coarse boundaries of the mesh opened next; if empty, it is always in detail."""
        self._coarse.surfaces = {one.name: one for one in surfaces}

    # Ghosts -----------------------------------------------------------------------------
    def set_motion_ghosts(self, ghosts: Mapping[str, FloatArray]) -> None:
        """Draw ghosts of moved boundaries: for each name, points (u, d) of its nodes."""
        self._ghosts.set_moved(ghosts)

    @property
    def motion_ghosts(self) -> dict[str, FloatArray]:
        """Return the points (u, d) of the ghosts of moved boundaries, by name."""
        return dict(self._ghosts.moved)

    # Camera and mouse -------------------------------------------------------------------
    def look_from(self, side: str) -> None:
        """Fit all of the mesh, seen from a side: a key of `slideviz.scene.camera.SIDES`."""
        self.camera.look_from(side, self._parallel())

    def look_along(self, view: Overview, meshes: Iterable[Mesh]) -> None:
        """Set the camera as an overview says: to its detail, or fitted to all ``meshes``.

        ``meshes`` are the states of the mesh that a film shows, for example.
        """
        mesh = self.session.opened_mesh
        self.camera.turn(view.towards, view.up, True)
        if view.detail is None:
            self.camera.fit(self.clouds(meshes))
            return
        width, height = self.plotter.window_size
        free = max(width - self.stage.strip(), 1.0)
        half = view.detail.width / min(free, 1.3 * height) * height / 2.0
        self.camera.shift()
        self.camera.aim(padded(np.array([view.detail.centre]))[0], half, 2.0 * mesh.extent)

    def clouds(self, meshes: Iterable[Mesh]) -> Iterator[FloatArray]:
        """Yield the points (n, 3) of the mesh that are drawn, in states of the mesh."""
        return (padded(self._cells.points(one)) for one in meshes)

    def fit(self, names: Sequence[str] = ()) -> None:
        """Fit everything drawn, or the named boundaries, to the view; the direction stays."""
        shapes = (self.drawn[name].shape for name in names if name in self.drawn)
        if names:
            self.camera.fit_part([np.asarray(shape.points) for shape in shapes])
        else:
            self.camera.fit()

    def _parallel(self) -> bool:
        mesh = self.session.mesh
        return mesh is None or mesh.dim == 2 or "perspective" not in self.session.view.drawn

    def _shapes(self) -> list[Any]:
        return [shape for layer in self.layers for shape in layer.shapes()]

    def pick(self, x: float, y: float) -> str | None:
        """Return the name of the visible boundary at a pixel from the lower left, or None.

        In 3D it is None at a section or at cells within the threshold: the boundaries in front of
        them are transparent then.
        """
        hidden = self.session.view.hidden
        drawn = [one for name, one in self.drawn.items() if name not in hidden]
        if not drawn:
            return None
        if drawn[0].surface.flat:
            return pick.nearest_line(self.plotter, x, y, drawn)
        # A boundary seen through transparent ones is meant, not these.
        solid = [*self.sections.actors(), *(actor for actor, _ in self._threshold.pickable())]
        if pick.meets(self.plotter, x, y, solid):
            return None
        within = [one for one in drawn if one.surface.name not in self._boundaries.glass]
        surface = pick.front_surface(self.plotter, x, y, within) if within else None
        return pick.front_surface(self.plotter, x, y, drawn) if surface is None else surface

    def pick_cell(self, x: float, y: float) -> int | None:
        """Return the index of the cell at a pixel from the lower left, or None.

        In 3D it is that of the foremost face. With a threshold, only cells within it are picked.
        """
        found = self._pick_place(x, y)
        return None if found is None else found[0]

    def pick_point(self, x: float, y: float) -> Pick | None:
        """Return the node near a pixel from the lower left, else the place on the cell there.

        Beside the mesh it is the nearest node of a boundary; None if none is near.
        """
        if self.session.frame is None:
            return None
        mesh = self.session.frame.mesh
        found = self._pick_place(x, y)
        if found is None:
            nodes = mesh.nodes_of(self.drawn.keys() - self.session.view.hidden)
            if not len(nodes):
                return None
        else:
            nodes = nodes_of(mesh, found[0])
        pixels = pick.to_display(self.plotter, padded(mesh.points[nodes]))
        away = row_norms(pixels - (x, y))
        # Of a cell not a node behind the one that is seen.
        far = away if found is None else row_norms(mesh.points[nodes] - found[1])
        near = int(far.argmin())
        if away[near] <= pick.REACH * self.stage.pixel_scale:
            return Pick((int(nodes[near]),))
        return None if found is None else Pick.between(mesh, nodes, found[1])

    def _pick_place(self, x: float, y: float) -> tuple[int, FloatArray] | None:
        """Return the index of the cell at a pixel, and the point (d,) of it that is seen there."""
        session = self.session
        if session.mesh is None or session.frame is None:
            return None
        if session.mesh.dim == 2:
            values = self.stage.values(session)
            # Where cells overlap, an inverted one is picked first.
            rank = np.where(np.isnan(values), -np.inf, values)
            only = self.stage.in_threshold(session)
            if only is not None:
                rank = np.where(only.mask, rank, np.nan)
            at = pick.on_plane(self.plotter, x, y)
            cell = cell_at(session.frame.mesh, *at, rank)
            return None if cell is None else (cell, np.array(at))
        if self.sections.from_file:
            # The sections' cells have no index in memory, and the boundaries are transparent.
            return None
        # Boundaries in front of a section are transparent: the section's cells come first.
        cut = pick.front_cell(self.plotter, x, y, self.sections.pickable())
        return pick.front_cell(self.plotter, x, y, self._pickable()) if cut is None else cut

    def _pickable(self) -> list[tuple[Any, IntArray]]:
        """Return the actors of a 3D mesh that can be picked, with the cell of each polygon."""
        if self._threshold.cells is not None:
            return self._threshold.pickable()
        hidden = self.session.view.hidden
        shown = [
            (one.actor, one.surface.owner) for name, one in self.drawn.items() if name not in hidden
        ]
        if self._cells.actor is not None:
            owner = self._cells.shape.cell_data[CELL]
            shown.append((self._cells.actor, np.asarray(owner)))
        return shown

    def fly_to(self, cell: int) -> None:
        """Move the camera near a cell of the shown frame; the direction stays."""
        frame = self.session.frame
        if frame is None or not frame.has(cell):
            return
        containing, at = frame.place_of(cell)
        middle, size = surroundings(containing.mesh, at)
        mesh = frame.mesh
        low, high = mesh.bounds
        depth = float(np.linalg.norm(high - low))
        self.camera.aim(middle, NEAR / 2.0 * max(size, 1e-9 * depth), 2.0 * depth)
