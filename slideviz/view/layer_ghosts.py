"""Ghosts in the scene: where boundaries were, and where motions will take them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.view import actors
from slideviz.view.look import CLASH_COLOUR, ROLE_COLOURS
from slideviz.view.stage import Stage
from slideviz.view.state import Session
from slideviz.view.surfaces import Surface

STILL = 1e-9
"""Part of its extent that rounding may move a boundary that stays where it is."""


class GhostLayer:
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

    def shapes(self) -> list[Any]:
        """Return nothing: ghosts need not be seen whole."""
        return []

    def set_moved(self, moved: Mapping[str, FloatArray]) -> None:
        """Draw where boundaries will go: points (u, d) of the nodes of each."""
        for name in set(self.moved) - set(moved):
            self._actors.pop(f"motion:{name}", None)
            self._shapes.pop(f"motion:{name}", None)
            self.stage.remove(f"motion:{name}")
        self.moved = dict(moved)
        self._draw_moved(self._session)

    def update(self, _old: Session | None, new: Session) -> None:
        """Show another state."""
        self._session = new
        self._draw_undeformed(new)
        self._draw_moved(new)

    def _draw_moved(self, session: Session) -> None:
        if session.mesh is None:
            return
        view, lift = session.view, self.stage.lift(session.mesh)
        shown = view.motion_ghost and (view.frame == 0 or session.outdated)
        for name, points in self.moved.items():
            surface = self._surfaces.get(name)
            if surface is None:
                continue
            actor = self._actor(f"motion:{name}", surface, 0.55)
            actors.place(self._shapes[f"motion:{name}"], points, 3 * lift)
            actor.prop.color = CLASH_COLOUR if session.clash else ROLE_COLOURS["moving"]
            actor.prop.line_width = 4.5 if session.clash else 2.5
            # In the same place it would be drawn through the boundary, in patches.
            at = session.mesh.points[surface.nodes]
            moves = np.abs(points - at).max() > STILL * np.ptp(at, axis=0).max()
            actor.visibility = bool(shown and moves and name not in view.hidden)

    def _draw_undeformed(self, session: Session) -> None:
        shown = session.view.undeformed and session.mesh is not None
        for name, surface in self._surfaces.items():
            key = f"undeformed:{name}"
            if not shown and key not in self._actors:
                continue
            actor = self._actor(key, surface, 0.45)
            moves = session.role(name) != "fixed"
            actor.prop.color = self.stage.look.ghost
            actor.visibility = shown and moves and name not in session.view.hidden

    def _actor(self, key: str, surface: Surface, opacity: float) -> Any:
        """Return the actor of that name, made where it is not there yet."""
        if key not in self._actors:
            mesh = self._session.mesh
            assert mesh is not None
            flat = surface.facets.shape[1] == 2
            shape = actors.surface_shape(surface, mesh.points, 3 * self.stage.lift(mesh))
            actor = self.stage.add(shape, key, lighting=not flat, pickable=False)
            actor.prop.opacity = opacity + 0.25 if flat else opacity - 0.1
            actor.prop.line_width = 2.5
            self._actors[key], self._shapes[key] = actor, shape
        return self._actors[key]
