"""Coarse boundaries, drawn while the mouse moves something and full detail takes too long."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from slideviz.mesh.surfaces import Surface
from slideviz.scene import actors
from slideviz.scene.actors import VALUES, DrawnBoundary, see_through
from slideviz.scene.mesh import BoundaryLayer
from slideviz.scene.sections import SectionLayer
from slideviz.scene.stage import Layer, Stage
from slideviz.session.state import Session


class CoarseLayer(Layer):
    """The coarse boundaries, drawn in place of those in full detail while ``on``.

    Parameters
    ----------
    stage : Stage
    boundaries : BoundaryLayer
        Draws the boundaries in full detail; their properties are copied.
    sections : SectionLayer
        Draws sections, whose edges are switched off meanwhile.

    Attributes
    ----------
    on : bool
        Whether they are drawn.
    """

    def __init__(self, stage: Stage, boundaries: BoundaryLayer, sections: SectionLayer) -> None:
        self.stage = stage
        self._sections = sections
        self.surfaces: Mapping[str, Surface] = {}
        """The coarse boundaries by name, set before a mesh is opened; empty for small meshes."""
        self._boundaries = boundaries
        self.clear()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actors."""
        self.on = False
        self.drawn: dict[str, DrawnBoundary] = {}
        self._made_of: tuple[object, ...] = ()
        self._session = Session()
        self._edged: list[Any] = []

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session, after the boundaries in full detail were updated."""
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
        for name, one in self.drawn.items():
            self._boundaries.drawn[name].actor.visibility = one.actor.visibility
            one.actor.visibility = False
        for prop in self._edged:
            prop.show_edges = True
        self._edged = []
        return True

    def _draw(self) -> None:
        session = self._session
        assert session.mesh is not None
        assert session.frame is not None
        if not self.drawn:
            self.drawn = {name: self._add(one) for name, one in self.surfaces.items()}
        made_of = session.frame, session.view.color_by
        again, self._made_of = made_of != self._made_of, made_of
        for name, one in self.drawn.items():
            whole = self._boundaries.drawn[name].actor
            if again:
                actors.place(one.shape, session.frame.mesh.points[one.surface.nodes])
            if again and session.view.color_by != "role":
                one.shape.cell_data[VALUES] = self.stage.values_of(session, one.surface.owner)
            one.actor.prop.DeepCopy(whole.prop)
            one.actor.prop.show_edges = False
            see_through(one.actor, whole.prop.opacity)
            one.actor.mapper.scalar_visibility = whole.mapper.scalar_visibility
            one.actor.visibility, whole.visibility = whole.visibility, False
        props = [one.actor.prop for one in self._sections.drawn.values()]
        self._edged = [prop for prop in props if prop.show_edges or prop in self._edged]
        for prop in self._edged:
            prop.show_edges = False

    def _add(self, surface: Surface) -> DrawnBoundary:
        assert self._session.mesh is not None
        shape: Any = actors.surface_shape(surface, self._session.mesh.points)
        return DrawnBoundary(
            surface, shape, self.stage.add(shape, f"coarse:{surface.name}", pickable=False)
        )
