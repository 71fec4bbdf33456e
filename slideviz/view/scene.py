"""What is drawn: boundaries, cells, ghosts and legend in a plotter that it is given.

The plotter may be the window's or an off-screen one. Only here and in `slideviz.view.actors` are
VTK objects made; all of it in the thread that owns the plotter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slideviz.case.model import ROLES
from slideviz.mesh.model import FloatArray
from slideviz.view import actors, pick
from slideviz.view.actors import LIFT, VALUES, Drawn
from slideviz.view.legend import STRIP, add_colour_bar, add_role_legend, clear_legend
from slideviz.view.look import CLASH_COLOUR, LIGHT, ROLE_COLOURS, SELECTED_COLOUR, Look
from slideviz.view.state import COLOUR_BY, Session
from slideviz.view.surfaces import Surface

FILL = 0.92
"""How much of the free height or width a mesh takes."""

SIDES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "+x": ((1, 0, 0), (0, 0, 1)),
    "-x": ((-1, 0, 0), (0, 0, 1)),
    "+y": ((0, 1, 0), (0, 0, 1)),
    "-y": ((0, -1, 0), (0, 0, 1)),
    "+z": ((0, 0, 1), (0, 1, 0)),
    "-z": ((0, 0, -1), (0, 1, 0)),
    "iso": ((1, -1, 0.8), (0, 0, 1)),
}
"""Direction from the mesh to the eye, and what is up."""


class Scene:
    """A mesh and its boundaries in a plotter.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Where to draw.
    look : Look
        Colours of background, text and edges.
    font_scale : float
        Enlarges the letters, for pictures of many pixels.
    """

    def __init__(self, plotter: Any, look: Look = LIGHT, font_scale: float = 1.0) -> None:
        self.plotter = plotter
        self.look = look
        self.font_scale = font_scale
        self.drawn: dict[str, Drawn] = {}
        self._session = Session()
        self._table = actors.lookup_table()
        self._cells: Any = None
        self._cells_actor: Any = None
        self._lift = 0.0
        self._ghosts: dict[str, FloatArray] = {}
        self._legend: tuple[object, ...] = ()
        self.set_look(look)

    # What is in the scene ---------------------------------------------------------------

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh; the camera sees all of it."""
        self.clear()
        mesh = session.mesh
        if mesh is None:
            return
        self._session = session
        self._lift = LIFT * mesh.extent if mesh.dim == 2 else 0.0
        if mesh.dim == 2:
            self._add_cells(actors.cell_shape(mesh))
        elif not surfaces:
            self._add_cells(actors.volume(mesh).extract_surface(algorithm="geometry"))
        for surface in surfaces:
            self.drawn[surface.name] = self._add_boundary(surface, mesh.points)
        self._restyle(session)
        self._place(session)
        self._colour(session)
        self.look_from("+z" if mesh.dim == 2 else "iso")

    def clear(self) -> None:
        """Remove everything."""
        clear_legend(self.plotter)
        self.plotter.clear_actors()
        self.drawn, self._ghosts, self._legend = {}, {}, ()
        self._cells = self._cells_actor = None
        self._session = Session()

    def _add_cells(self, shape: Any) -> None:
        self._cells = shape
        if VALUES not in shape.cell_data:
            shape.cell_data[VALUES] = np.zeros(shape.n_cells)
        flat = self._session.mesh is not None and self._session.mesh.dim == 2
        self._cells_actor = self._add(shape, "cells", lighting=not flat)
        self._cells_actor.prop.line_width = 1.0

    def _add(self, shape: Any, name: str, **options: Any) -> Any:
        actor = self.plotter.add_mesh(
            shape,
            name=name,
            scalars=VALUES if VALUES in shape.cell_data else None,
            cmap=self._table if VALUES in shape.cell_data else None,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
            copy_mesh=False,
            **options,
        )
        actor.mapper.scalar_visibility = False
        return actor

    def _add_boundary(self, surface: Surface, points: FloatArray) -> Drawn:
        flat = surface.facets.shape[1] == 2
        shape = actors.surface_shape(surface, points, 2 * self._lift)
        rim = actors.rim_shape(surface, points, self._lift)
        actor = self._add(shape, f"marker:{surface.name}", lighting=not flat)
        band = self._add(rim, f"selected:{surface.name}", lighting=False)
        band.prop.color = SELECTED_COLOUR
        band.prop.line_width = 11 if flat else 6
        band.prop.opacity = 1.0
        band.visibility = False
        if not flat:
            actor.prop.ambient, actor.prop.diffuse = 0.6, 0.4
            # Lines on a face flicker unless they are drawn a little nearer.
            band.mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-4.0, -4.0)
        return Drawn(surface, shape, rim, actor, band)

    # What changes -----------------------------------------------------------------------

    def update(self, session: Session) -> None:
        """Show another state of the same mesh; only what differs is touched."""
        old, self._session = self._session, session
        if session.mesh is None or not (self.drawn or self._cells):
            return
        moved = old.frame is not session.frame
        if moved:
            self._place(session)
        if moved or old.view.colour_by != session.view.colour_by:
            self._colour(session)
        self._restyle(session)
        if old.view.perspective != session.view.perspective:
            self._project(session)

    def set_look(self, look: Look) -> None:
        """Take other colours for background, letters and edges."""
        self.look = look
        top = None if look.background == look.background_top else look.background_top
        self.plotter.set_background(look.background, top=top)
        if self._session.mesh is not None:
            self._restyle(self._session)

    def _place(self, session: Session) -> None:
        frame = session.frame
        if frame is None:
            return
        points = frame.mesh.points
        if self._cells is not None and session.mesh is not None and session.mesh.dim == 2:
            actors.place(self._cells, points)
        for one in self.drawn.values():
            at = points[one.surface.nodes]
            actors.place(one.shape, at, 2 * self._lift)
            actors.place(one.rim, at, self._lift)

    def _colour(self, session: Session) -> None:
        frame, what = session.frame, session.view.colour_by
        by_value = what != "role" and frame is not None
        flat = session.mesh is not None and session.mesh.dim == 2
        if by_value and frame is not None:
            values = actors.shown_values(frame, what)
            if flat:
                self._cells.cell_data[VALUES] = values
            for one in self.drawn.values():
                one.shape.cell_data[VALUES] = values[one.surface.owner]
        if self._cells_actor is not None:
            self._cells_actor.mapper.scalar_visibility = by_value and flat
        for one in self.drawn.values():
            one.actor.mapper.scalar_visibility = by_value and not flat

    def _restyle(self, session: Session) -> None:
        view, look = session.view, self.look
        flat = session.mesh is not None and session.mesh.dim == 2
        if self._cells_actor is not None:
            self._cells_actor.prop.color = look.cell
            self._edges(self._cells_actor.prop, view.edges)
        for name, one in self.drawn.items():
            shown = name not in view.hidden
            one.actor.visibility = shown
            one.band.visibility = shown and name in view.selected
            one.actor.prop.color = ROLE_COLOURS[session.role(name)]
            if flat:
                one.actor.prop.line_width = 4.5 if view.colour_by == "role" else 3.0
            else:
                self._edges(one.actor.prop, view.edges)
        self._draw_undeformed(session)
        self._draw_ghosts(session)
        self._draw_legend(session)

    def _edges(self, prop: Any, shown: bool) -> None:
        prop.show_edges = shown
        prop.edge_color = self.look.edge
        prop.edge_opacity = 0.55

    def resized(self) -> None:
        """Put the legend where it belongs in a view of another size."""
        width = self.plotter.window_size[0]
        self.plotter.camera.SetWindowCenter(self._strip() / max(width, 1), 0.0)
        self._draw_legend(self._session)

    def _strip(self) -> float:
        """Return how many pixels at the right are the legend's."""
        return min(STRIP * self.font_scale, 0.4 * self.plotter.window_size[0])

    def _draw_legend(self, session: Session) -> None:
        key = self._legend_key(session)
        if key == self._legend:
            return
        self._legend = key
        clear_legend(self.plotter)
        if not session.view.legend or session.mesh is None:
            return
        what = session.view.colour_by
        if what == "role":
            used = {session.role(name) for name in session.mesh.marker_names}
            add_role_legend(
                self.plotter, [r for r in ROLES if r in used], self.look, self.font_scale
            )
            return
        mapper = self._cells_actor.mapper if self._cells_actor is not None else None
        mapper = mapper or next(iter(self.drawn.values())).actor.mapper
        bad = _has_inverted(session)
        add_colour_bar(self.plotter, mapper, COLOUR_BY[what], bad, (self.look, self.font_scale))

    def _legend_key(self, session: Session) -> tuple[object, ...]:
        """Return all that the legend depends on: to make it anew takes longer than the rest."""
        mesh, what = session.mesh, session.view.colour_by
        names = mesh.marker_names if mesh is not None and what == "role" else ()
        said = frozenset(session.role(name) for name in names) or _has_inverted(session)
        place = tuple(self.plotter.window_size)
        return (mesh, session.view.legend, what, said, self.look, place)

    # Ghosts -----------------------------------------------------------------------------

    def set_motion_ghosts(self, ghosts: Mapping[str, FloatArray]) -> None:
        """Draw where boundaries will go: points (u, d) of the nodes of each."""
        for name in set(self._ghosts) - set(ghosts):
            self.plotter.remove_actor(f"motion:{name}", render=False)
        self._ghosts = dict(ghosts)
        self._draw_ghosts(self._session)

    @property
    def motion_ghosts(self) -> dict[str, FloatArray]:
        """Return where boundaries will go, as it was set."""
        return dict(self._ghosts)

    def _draw_ghosts(self, session: Session) -> None:
        shown = session.view.motion_ghost and (session.view.frame == 0 or session.outdated)
        # Once: pyvista makes the dictionary anew each time it is asked for.
        known = self.plotter.actors if self._ghosts else {}
        for name, points in self._ghosts.items():
            one = self.drawn.get(name)
            if one is None:
                continue
            actor = known.get(f"motion:{name}")
            if actor is None:
                actor = self._add_ghost(f"motion:{name}", one.surface, ROLE_COLOURS["moving"], 0.55)
            actors.place(actor.mapper.dataset, points, 3 * self._lift)
            actor.prop.color = CLASH_COLOUR if session.clash else ROLE_COLOURS["moving"]
            actor.prop.line_width = 4.5 if session.clash else 2.5
            actor.visibility = shown and name not in session.view.hidden

    def _draw_undeformed(self, session: Session) -> None:
        shown = session.view.undeformed and session.mesh is not None
        known = self.plotter.actors
        for name, one in self.drawn.items():
            key = f"undeformed:{name}"
            actor = known.get(key)
            if actor is None and shown:
                actor = self._add_ghost(key, one.surface, self.look.ghost, 0.45)
            if actor is not None:
                moves = session.role(name) not in ("fixed",)
                actor.prop.color = self.look.ghost
                actor.visibility = shown and moves and name not in session.view.hidden

    def _add_ghost(self, key: str, surface: Surface, colour: str, opacity: float) -> Any:
        assert self._session.mesh is not None
        flat = surface.facets.shape[1] == 2
        shape = actors.surface_shape(surface, self._session.mesh.points, 3 * self._lift)
        actor = self._add(shape, key, lighting=not flat, pickable=False)
        actor.prop.color = colour
        actor.prop.opacity = opacity + 0.25 if flat else opacity - 0.1
        actor.prop.line_width = 2.5
        return actor

    # Camera and mouse -------------------------------------------------------------------

    def look_from(self, side: str) -> None:
        """Look at all of the mesh from a side: a key of `SIDES`."""
        towards, up = SIDES[side]
        camera = self.plotter.camera
        bounds = np.array(self.plotter.bounds).reshape(3, 2)
        centre = bounds.mean(axis=1)
        camera.focal_point = centre
        camera.position = centre + np.asarray(towards, float) * max(
            np.ptp(bounds, axis=1).max(), 1e-300
        )
        camera.up = up
        self._project(self._session)
        self.fit()

    def _project(self, session: Session) -> None:
        flat = session.mesh is None or session.mesh.dim == 2
        self.plotter.camera.parallel_projection = flat or not session.view.perspective

    def take_camera(self, other: Scene) -> None:
        """Look from where another scene looks."""
        camera, theirs = self.plotter.camera, other.plotter.camera
        camera.position, camera.focal_point = theirs.position, theirs.focal_point
        camera.up, camera.view_angle = theirs.up, theirs.view_angle
        camera.parallel_projection = theirs.parallel_projection
        camera.parallel_scale = theirs.parallel_scale
        camera.SetWindowCenter(*theirs.GetWindowCenter())
        self.plotter.renderer.ResetCameraClippingRange()

    def fit(self) -> None:
        """Make everything fill the view, from the present side, beside the legend's strip."""
        width, height = self.plotter.window_size
        strip = self._strip()
        camera = self.plotter.camera
        # The camera keeps its centre, which the mouse turns about; only the picture shifts.
        camera.SetWindowCenter(strip / width, 0.0)
        shapes = [one.shape for one in self.drawn.values()]
        shapes += [self._cells] if self._cells is not None else []
        if not shapes:
            return
        points = np.concatenate([np.asarray(shape.points) for shape in shapes])
        up = np.array(camera.up)
        right = np.cross(camera.direction, up)
        up = np.cross(right, camera.direction)
        axes = np.array([right / np.linalg.norm(right), up / np.linalg.norm(up), camera.direction])
        low, high = (points @ axes.T).min(axis=0), (points @ axes.T).max(axis=0)
        centre, extent = axes.T @ ((low + high) / 2.0), high - low
        free = max(width - strip, 1.0)
        half = max(extent[1] / height, extent[0] / free, 1e-300) * height / 2.0 / FILL
        away = max(np.linalg.norm(extent), half)
        if not camera.parallel_projection:
            away = half / np.tan(np.radians(camera.view_angle / 2.0)) + extent[2] / 2.0
        camera.focal_point = centre
        camera.position = centre - axes[2] * away
        camera.parallel_scale = half
        self.plotter.renderer.ResetCameraClippingRange()

    def zoom_at(self, x: float, y: float, factor: float) -> None:
        """Enlarge by ``factor``; in parallel projection pixel (x, y) keeps what it shows."""
        camera = self.plotter.camera
        if not camera.parallel_projection:
            camera.Dolly(factor)
            self.plotter.renderer.ResetCameraClippingRange()
            return
        width, height = self.plotter.window_size
        right = np.cross(camera.direction, camera.up)
        middle = width / 2.0 * (1.0 - camera.GetWindowCenter()[0])
        # Pixels from the camera's centre, in the world's length unit at the present scale.
        unit = 2.0 * camera.parallel_scale / height
        offset = ((x - middle) * right + (y - height / 2) * np.asarray(camera.up)) * unit
        shift = offset * (1.0 - 1.0 / factor)
        camera.focal_point = np.asarray(camera.focal_point) + shift
        camera.position = np.asarray(camera.position) + shift
        camera.parallel_scale = camera.parallel_scale / factor
        self.plotter.renderer.ResetCameraClippingRange()

    def pick(self, x: float, y: float) -> str | None:
        """Return the visible boundary at a pixel counted from the lower left, or None."""
        hidden = self._session.view.hidden
        drawn = [one for name, one in self.drawn.items() if name not in hidden]
        if not drawn:
            return None
        if drawn[0].surface.facets.shape[1] == 2:
            return pick.nearest_line(self.plotter, x, y, drawn)
        return pick.front_surface(self.plotter, x, y, drawn)


def _has_inverted(session: Session) -> bool:
    return session.frame is not None and session.frame.quality.inverted > 0
