"""The scene: boundaries, cells, sections, ghosts and legend in a given plotter.

The plotter may be the window's or an off-screen one. A scene is made of layers, one for each
kind of thing; only they, and `slideviz.scene.actors`, make VTK objects, all of it in the
thread that owns the plotter.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import LIGHT, ColorScheme
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.surfaces import Surface, padded
from slideviz.scene import pick
from slideviz.scene.actors import CELL, DrawnBoundary
from slideviz.scene.boxes import BoxLayer
from slideviz.scene.camera import Camera
from slideviz.scene.coarse import CoarseLayer
from slideviz.scene.ghosts import GhostLayer
from slideviz.scene.inverted import InvertedLayer
from slideviz.scene.legend import LegendLayer, TriadLayer
from slideviz.scene.marked_cell import MarkLayer
from slideviz.scene.mesh import BoundaryLayer, CellLayer
from slideviz.scene.moved import Overview
from slideviz.scene.passages import PassageLayer
from slideviz.scene.points import PointLayer
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.scene.threshold import ThresholdLayer
from slideviz.session.colors import as_drawn
from slideviz.session.inspect import cell_at, surroundings
from slideviz.session.state import Session
from slideviz.session.store import tell_all

NEAR = 8.0
"""Sizes of a cell that the height of the view shows after flying to it."""


class Scene:
    """A mesh and its boundaries in a plotter.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Where to draw.
    scheme : ColorScheme
        Colours of background, text and edges.
    font_scale : float
        Enlarges the letters, for pictures of many pixels.
    """

    def __init__(self, plotter: Any, scheme: ColorScheme = LIGHT, font_scale: float = 1.0) -> None:
        self.stage = Stage(plotter, scheme, font_scale)
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
            PassageLayer(self.stage, self._cells, self._boundaries, self._threshold),
            PointLayer(self.stage),
            InvertedLayer(self.stage, self.sections),
            LegendLayer(self.stage),
            TriadLayer(self.stage),
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
        """Return how many polygons of cells are drawn: of a 2D mesh, all its cells."""
        return 0 if self._cells.shape is None else int(self._cells.shape.n_cells)

    # What is in the scene ---------------------------------------------------------------

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh; the camera sees all of it."""
        for _ in self.opening(session, surfaces):
            pass

    def opening(
        self, session: Session, surfaces: Sequence[Surface], part: IntArray | None = None
    ) -> Iterator[None]:
        """Draw another mesh, and yield between the pieces of this work.

        Of a 3D mesh ``part`` are the cells (k,) to draw where no boundaries are.
        """
        self.clear()
        self._cells.part = part
        session = as_drawn(session)
        if session.mesh is None:
            return
        self.session = session
        self.stage.set_colours(session)
        for layer in self.layers:
            layer.open(session, surfaces)
            layer.update(None, session)
            yield
        self.look_from("+z" if session.mesh.dim == 2 else "iso")

    def clear(self) -> None:
        """Remove everything."""
        for layer in self.layers:
            layer.clear()
        self.plotter.clear_actors()
        self.session = Session()

    def update(self, session: Session) -> None:
        """Draw another state of the same mesh; only differences are touched."""
        session = as_drawn(session)
        old, self.session = self.session, session
        if session.mesh is None or old.mesh is None:
            return
        self.stage.set_colours(session)
        tell_all((layer.update for layer in self.layers), old, session)
        if "perspective" in old.view.drawn ^ session.view.drawn:
            self.plotter.camera.parallel_projection = self._parallel()

    def set_scheme(self, scheme: ColorScheme) -> None:
        """Take another color scheme for background, letters and edges."""
        self.stage.scheme = scheme
        self.stage.set_background()
        self._again()

    def set_legend(self, drawn: bool) -> None:
        """Draw the legend here, or leave it to a view beside this one."""
        self.stage.has_legend = drawn
        self.resized()

    def resized(self) -> None:
        """Put the legend at its place in a view of another size."""
        self.camera.shift()
        self._again()

    def _again(self) -> None:
        if self.session.mesh is not None:
            tell_all((layer.update for layer in self.layers), self.session, self.session)

    # While the camera moves --------------------------------------------------------------

    @property
    def coarse(self) -> bool:
        """Tell whether boundaries are drawn with fewer facets."""
        return self._coarse.on

    def draw_coarse(self, on: bool) -> bool:
        """Draw boundaries with fewer facets, or all again; tell whether that was a change."""
        return self._coarse.switch(on)

    def set_coarse_boundaries(self, surfaces: Sequence[Surface]) -> None:
        """Set the coarse boundaries of the mesh that is opened next; none is a choice."""
        self._coarse.surfaces = {one.name: one for one in surfaces}

    # Ghosts -----------------------------------------------------------------------------

    def set_motion_ghosts(self, ghosts: Mapping[str, FloatArray]) -> None:
        """Draw ghosts of moved boundaries: points (u, d) of the nodes of each."""
        self._ghosts.set_moved(ghosts)

    @property
    def motion_ghosts(self) -> dict[str, FloatArray]:
        """Return the points of the ghosts of moved boundaries."""
        return dict(self._ghosts.moved)

    # Camera and mouse -------------------------------------------------------------------

    def look_from(self, side: str) -> None:
        """Show all of the mesh from a side: a key of `slideviz.scene.camera.SIDES`."""
        self.camera.look_from(side, self._parallel())

    def look_along(self, view: Overview, meshes: Iterable[Mesh]) -> None:
        """Show all that is drawn of some states of the mesh, or the detail of an overview."""
        mesh = self.session.mesh
        assert mesh is not None
        self.camera.turn(view.towards, view.up, True)
        if view.detail is None:
            self.camera.fit(padded(self._cells.points(one)) for one in meshes)
            return
        width, height = self.plotter.window_size
        free = max(width - self.stage.strip(), 1.0)
        half = view.detail.width / min(free, 1.3 * height) * height / 2.0
        self.camera.shift()
        self.camera.aim(padded(np.array([view.detail.centre]))[0], half, 2.0 * mesh.extent)

    def fit(self, names: Sequence[str] = ()) -> None:
        """Make all that is drawn fill the view, or some boundaries, from the present side."""
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
        """Return the visible boundary at a pixel counted from the lower left, or None.

        In 3D sections and cells of the threshold are none, and what is in front of them is glass.
        """
        hidden = self.session.view.hidden
        drawn = [one for name, one in self.drawn.items() if name not in hidden]
        if not drawn:
            return None
        if drawn[0].surface.flat:
            return pick.nearest_line(self.plotter, x, y, drawn)
        # What is seen through glass is meant, not the glass.
        solid = [*self.sections.actors(), *(actor for actor, _ in self._threshold.pickable())]
        if pick.meets(self.plotter, x, y, solid):
            return None
        within = [one for one in drawn if one.surface.name not in self._boundaries.glass]
        found = pick.front_surface(self.plotter, x, y, within) if within else None
        return pick.front_surface(self.plotter, x, y, drawn) if found is None else found

    def pick_cell(self, x: float, y: float) -> int | None:
        """Return the cell at a pixel counted from the lower left, or None.

        In 3D it is the one whose side is in front. While a range chooses cells, only these.
        """
        session = self.session
        if session.mesh is None or session.frame is None:
            return None
        if session.mesh.dim == 2:
            values = self.stage.values(session)
            # Where cells overlap, an inverted one comes before the others.
            rank = np.where(np.isnan(values), -np.inf, values)
            only = self.stage.in_threshold(session)
            if only is not None:
                rank = np.where(only.mask, rank, np.nan)
            at = pick.on_plane(self.plotter, x, y)
            return cell_at(session.frame.mesh, *at, rank)
        if self.sections.from_file:
            # Their cells have no place among those in memory, and boundaries are glass.
            return None
        # Boundaries in front of a section are glass.
        cut = pick.front_cell(self.plotter, x, y, self.sections.pickable())
        return pick.front_cell(self.plotter, x, y, self._pickable()) if cut is None else cut

    def _pickable(self) -> list[tuple[Any, IntArray]]:
        """Return the actors of a 3D mesh whose cells can be picked, and whose sides they show."""
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
        """Aim at a cell of the frame that is shown, from the present side and near."""
        frame = self.session.frame
        if frame is None or not frame.has(cell):
            return
        own, at = frame.place_of(cell)
        middle, size = surroundings(own.mesh, at)
        mesh = frame.mesh
        low, high = mesh.bounds
        depth = float(np.linalg.norm(high - low))
        self.camera.aim(middle, NEAR / 2.0 * max(size, 1e-9 * depth), 2.0 * depth)
