"""Ghosts in the scene: the undeformed boundaries, and those where motions will take them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.model import Case
from slideviz.color_scheme import INTERSECTION_COLOUR
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.surfaces import Surface
from slideviz.scene import actors
from slideviz.scene.stage import Layer, Stage
from slideviz.session.state import Session
from slideviz.terms import ROLES

RIM, WIRE = "\nrim", "\nwire"
"""What stands behind the name of an actor that draws the rim of a ghost, or the edges of its
faces; no boundary has it."""
STILL = 1e-9
"""Part of its extent that rounding may move a boundary that stays where it is."""
DEEPER = 330.0
"""Units of depth that faces of ghosts are drawn behind where they are, and their rims before: of
the 65536 from the nearest to the furthest point. A boundary that slides within its surface would
show through its ghost in patches."""
ON_TOP = 70000.0
"""As many units that the lines of a motion's ghost are before everything: one that goes into the
solid, behind opaque boundaries, would not be seen at all."""
MOST_WIRE = 50_000
"""Faces of a ghost whose edges are drawn: of more they are one colour, and take long."""
ARRIVED = 0.01
"""Part of its displacement by which a boundary may miss its ghost and still cover it."""


class GhostLayer(Layer):
    """Transparent boundaries: undeformed ones, and moved ones before anything is computed."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.moved: dict[str, FloatArray] = {}
        self._surfaces: dict[str, Surface] = {}
        self._actors: dict[str, Any] = {}
        # Kept here: a data set that only VTK holds may come back from a mapper without points.
        self._shapes: dict[str, Any] = {}
        self._session = Session()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh."""
        self._session = session
        self._surfaces = {surface.name: surface for surface in surfaces}

    def clear(self) -> None:
        """Forget the mesh."""
        self.moved, self._surfaces, self._actors, self._shapes = {}, {}, {}, {}
        self._session = Session()

    def set_moved(self, moved: Mapping[str, FloatArray]) -> None:
        """Draw where boundaries will go: points (u, d) of the nodes of each."""
        for name in set(self.moved) - set(moved):
            for part in ("", RIM, WIRE):
                key = f"motion:{name}{part}"
                self._actors.pop(key, None)
                self._shapes.pop(key, None)
                self.stage.remove(key)
        self.moved = dict(moved)
        self._draw_moved(self._session)

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        self._session = new
        self._draw_undeformed(new)
        self._draw_moved(new)

    def _draw_moved(self, session: Session) -> None:
        if session.mesh is None:
            return
        view = session.view
        shown = "motion_ghost" in view.drawn and is_planned(session)
        for name, points in self.moved.items():
            surface = self._surfaces.get(name)
            if surface is None:
                continue
            key = f"motion:{name}"
            # In the same place there is nothing to tell.
            if not shown or name in view.hidden or not is_apart(points, surface, session):
                for part in ("", RIM, WIRE):
                    if f"{key}{part}" in self._actors:
                        self._actors[f"{key}{part}"].visibility = False
                continue
            hits = bool(session.intersection or session.folding)
            colour = INTERSECTION_COLOUR if hits else ROLES["moving"].colour
            for actor, shape in self._parts(key, surface, 0.55, ON_TOP):
                actors.place(shape, points, 3 * self.stage.lift(session.mesh))
                actor.prop.color = self._rim_colour(colour) if actor.name.endswith(RIM) else colour
                actor.prop.line_width = 4.5 if hits else 2.5
                actor.visibility = True
            if not surface.flat:
                self._draw_wire(key, colour, not rim_goes_along(points, surface, session.mesh))

    def _draw_wire(self, key: str, colour: str, wanted: bool) -> None:
        """Draw the edges of a ghost's faces over everything, or end that."""
        shape = self._shapes[key]
        wanted = wanted and shape.n_cells <= MOST_WIRE
        if wanted or f"{key}{WIRE}" in self._actors:
            wire, _ = self._part(f"{key}{WIRE}", lambda *_: shape)
            wire.prop.style, wire.prop.color, wire.prop.opacity = "wireframe", colour, 0.5
            wire.prop.line_width, wire.visibility = 1.0, wanted
            _shift_depth(wire, -ON_TOP)

    def _rim_colour(self, colour: str) -> tuple[float, float, float]:
        """Return a colour that is seen on that of the boundary itself."""
        own, text = (np.array(pv.Color(one).float_rgb) for one in (colour, self.stage.scheme.text))
        red, green, blue = (0.5 * (own + text)).tolist()
        return red, green, blue

    def _draw_undeformed(self, session: Session) -> None:
        view = session.view
        # The undeformed mesh itself needs no ghost.
        shown = "undeformed" in view.drawn and session.mesh is not None and view.frame > 0
        for name, surface in self._surfaces.items():
            key = f"undeformed:{name}"
            if not shown and key not in self._actors:
                continue
            moves = session.role(name) != "fixed"
            for actor, _ in self._parts(key, surface, 0.45):
                actor.prop.color = self.stage.scheme.ghost
                actor.visibility = shown and moves and name not in view.hidden

    def _parts(
        self, key: str, surface: Surface, opacity: float, nearer: float = DEEPER
    ) -> list[tuple[Any, Any]]:
        """Return actor and shape of what a ghost is made of: lines; or faces, and their rim."""
        faces = self._part(key, lambda at, lift: actors.surface_shape(surface, at, lift))
        if surface.flat:
            faces[0].prop.opacity = opacity + 0.25
            return [faces]
        faces[0].prop.opacity = opacity - 0.1
        _shift_depth(faces[0], DEEPER)
        if not len(surface.rim):
            return [faces]
        rim = self._part(f"{key}{RIM}", lambda at, lift: actors.rim_shape(surface, at, lift))
        rim[0].prop.opacity = min(opacity + 0.35, 1.0)
        _shift_depth(rim[0], -nearer)
        return [faces, rim]

    def _part(self, key: str, make: Callable[[FloatArray, float], Any]) -> tuple[Any, Any]:
        """Return the actor and the shape of a name, made at the first call."""
        if key not in self._actors:
            mesh = self._session.mesh
            assert mesh is not None
            shape = make(mesh.points, 3 * self.stage.lift(mesh))
            lit = mesh.dim == 3 and not key.endswith((RIM, WIRE))
            actor = self.stage.add(shape, key, lighting=lit, pickable=False)
            actor.prop.line_width = 2.5
            self._actors[key], self._shapes[key] = actor, shape
        return self._actors[key], self._shapes[key]


def _shift_depth(actor: Any, units: float) -> None:
    """Draw an actor deeper than its place by so much; a negative number is nearer."""
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, units)
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, units)


def is_apart(points: FloatArray, surface: Surface, session: Session) -> bool:
    """Tell whether the ghost of a boundary, at points (u, d), is apart from the boundary shown.

    A run takes its boundary there but for the tolerance of the data reduction; the two would
    flicker in the same place.
    """
    mesh = session.mesh
    assert mesh is not None
    at = mesh.points[surface.nodes]
    way = float(np.abs(points - at).max())
    still = STILL * float(np.ptp(at, axis=0).max())
    if session.view.frame == 0 or session.frame is None:
        return way > still
    left = float(np.abs(points - session.frame.mesh.points[surface.nodes]).max())
    return left > max(still, ARRIVED * way)


def rim_goes_along(points: FloatArray, surface: Surface, mesh: Mesh) -> bool:
    """Tell whether the rim of a ghost, at points (u, d), goes where its faces go, and shows it.

    That of a wall that a free-form box dents stays where it is, and a closed surface has none.
    """
    way = np.abs(points - mesh.points[surface.nodes]).max(axis=1)
    return bool(way[surface.rim].max(initial=0.0) > 0.5 * way.max())


def is_planned(session: Session) -> bool:
    """Tell whether a view shows where motions will take boundaries.

    Of the undeformed mesh it should; of the steps of a run, where settings have changed since;
    of a design, which is not what the panels have, where motions have changed since.
    Two views beside each other say the same, or a ghost would look like a difference between
    runs: they say it of motions that no run has shown yet.
    """
    if session.view.beside is not None:
        now = _motion(session.case)
        return all(_motion(run.case) != now for run in session.runs)
    run = session.run_shown
    if run is not None and run.panels is not None:
        return _motion(run.panels) != _motion(session.case)
    return session.view.frame == 0 or session.outdated


def _motion(case: Case) -> tuple[object, ...]:
    """Return what moves in a case, and how."""
    return frozenset(case.markers_with("moving")), tuple(case.motions)
