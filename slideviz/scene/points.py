"""Nodes drawn as points: the boundaries' nodes by their type, or the control nodes of a step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.mesh.model import IntArray
from slideviz.mesh.surfaces import Surface, lifted
from slideviz.scene.stage import Layer
from slideviz.session.node_types import NOTHING, NodeTypes, TypedNodes
from slideviz.session.state import Session
from slideviz.terms import NODE_TYPES

SIZES = ((0, 9.0), (1500, 7.0), (6000, 5.0))
"""Pairs of a number of points, and their diameter in pixels from that number on."""

_COLOR = "point_color"  # name of the point data with the colors
_RGB = np.array([pv.Color(term.color).int_rgb for term in NODE_TYPES.values()], np.uint8)
"""Red, green and blue (0 to 255) of each type of node, (t, 3)."""


class PointLayer(Layer):
    """The nodes that the view asks for, drawn as small balls."""

    def clear(self) -> None:
        self._types = NodeTypes()
        self._surfaces: tuple[Surface, ...] = ()
        self._drawn: TypedNodes = NOTHING
        self._key: tuple[object, ...] = ()
        self._shape: Any = None
        self._actor: Any = None
        self.stage.point_words = ()

    def open(self, _session: Session, surfaces: Sequence[Surface]) -> None:
        self._surfaces = tuple(surfaces)

    def update(self, old: Session | None, new: Session) -> None:
        if new.mesh is None or new.frame is None:
            return
        typed = self._types.of(new)
        key = (typed, new.view.hidden)
        if key != self._key and not (typed is NOTHING and self._actor is None):
            self._key = key
            self._fill(self._seen(typed, new), new)
        elif self._actor is not None and (old is None or old.frame is not new.frame):
            self._place(new)

    def _seen(self, typed: TypedNodes, session: Session) -> TypedNodes:
        """Return those of the nodes that are on a visible boundary."""
        if not session.view.hidden or not self._surfaces:
            return typed
        shown = [one.nodes for one in self._surfaces if one.name not in session.view.hidden]
        return typed.only(np.concatenate(shown) if shown else np.empty(0, np.int64))

    def _fill(self, typed: TypedNodes, session: Session) -> None:
        self._drawn = typed
        count = len(typed.nodes)
        present = [NODE_TYPES[kind] for kind in typed.present]
        self.stage.point_words = tuple((term.label, term.color) for term in present)
        if self._actor is None:
            self._shape = pv.PolyData()
            self._actor = self._make()
        self._actor.visibility = count > 0
        if not count:
            return
        shape = pv.PolyData(self._at(session, typed.nodes))
        shape.point_data[_COLOR] = _RGB[typed.kinds]
        self._shape.copy_from(shape, deep=False)
        size = next(size for least, size in reversed(SIZES) if count >= least)
        self._actor.prop.point_size = size * self.stage.pixel_scale

    def _place(self, session: Session) -> None:
        if len(self._drawn.nodes):
            self._shape.points[:] = self._at(session, self._drawn.nodes)
            self._shape.GetPoints().Modified()

    def _at(self, session: Session, nodes: IntArray) -> Any:
        assert session.mesh is not None
        assert session.frame is not None
        return lifted(session.frame.mesh.points[nodes], 4.0 * self.stage.lift(session.mesh))

    def _make(self) -> Any:
        mapper = pv.DataSetMapper(dataset=self._shape)
        # A depth offset, so that faces and edges do not cut into the points.
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPointOffsetParameter(-10.0)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(_COLOR)
        mapper.SetColorModeToDirectScalars()
        mapper.scalar_visibility = True
        actor = pv.Actor(mapper=mapper, name="points:nodes")
        prop = actor.prop
        prop.style = "points"
        prop.render_points_as_spheres = True
        # Shading makes a ball visible on a face of the same color.
        prop.ambient = 0.25
        prop.diffuse = 0.85
        self.stage.plotter.add_actor(
            actor, name=actor.name, reset_camera=False, render=False, pickable=False
        )
        return actor
