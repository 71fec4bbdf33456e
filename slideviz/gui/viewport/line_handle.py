"""The handle of a section of a 2D mesh: points to drag on a line or a circle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pyvista as pv
from qtpy.QtCore import QPoint
from vtkmodules.vtkCommonCore import vtkObject

from slideviz.color_scheme import SELECTED_COLOR, ColorScheme
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.mouse_handle import (
    EDGE_PX,
    HANDLE_COLOR,
    POINT_PX,
    REACH_PX,
    RIM_PX,
    MouseHandle,
)
from slideviz.mesh.model import FloatArray
from slideviz.scene.pick import on_plane, to_display
from slideviz.sections.handles import HandleParts, Part, dragged, handle_parts, part_at
from slideviz.sections.line import Box
from slideviz.sections.model import Section

NAMES = ("handle:rim", "handle:points", "handle:held")
"""Names of the actors: rims of the points, the points, and those under the mouse."""


class Handle2D(MouseHandle[tuple[Section, Box]]):
    """The handle of a line or circle: points to drag; its curve itself can be dragged too.

    Parameters
    ----------
    view, *others
        As for `slideviz.gui.viewport.mouse_handle.MouseHandle`.
    """

    def __init__(self, view: View3D, *others: Callable[..., Any]) -> None:
        super().__init__(view, *others)
        self._scheme: ColorScheme | None = None
        self._lift = 0.0
        self._handle_parts: HandleParts | None = None
        self._placed: tuple[object, ...] = ()

    def watched(self) -> tuple[vtkObject, str]:
        """Return the camera and its event: the handle stays in the visible part of the plane."""
        return self.view.camera, "ModifiedEvent"

    def show(self, section: Section, lift: float, scheme: ColorScheme) -> None:
        """Show the handle of a section, lifted above the mesh by a length in mesh units."""
        self.section, self._lift, self._scheme = section, lift, scheme
        self.put()

    def close(self) -> None:
        """Remove the handle from the view for good."""
        for name in NAMES:
            self.view.remove_actor(name, reset_camera=False, render=False)  # type: ignore[arg-type]
        super().close()

    # Drawing ---------------------------------------------------------------------------

    def seen_box(self) -> Box:
        """Return the lower and upper corner of the part of the mesh's plane that the view shows.

        A margin at the edges, and the strip of the legend, are not part of it.
        """
        wide, high = self.view.window_size
        corners = (
            on_plane(self.view, EDGE_PX, EDGE_PX),
            on_plane(self.view, wide - self._strip() - EDGE_PX, high - EDGE_PX),
        )
        return np.min(corners, axis=0), np.max(corners, axis=0)

    def put(self) -> None:
        """Draw the handle's points in the visible part of the plane, where the mouse can reach."""
        if self.section is None:
            return
        seen = self.seen_box()
        # The camera's event comes after each drawing too, which sets the clipping planes.
        key = (self.section, self._lift, self._scheme, self._part, *seen[0], *seen[1])
        if key == self._placed:
            return
        self._placed = key
        parts = self._handle_parts = handle_parts(self.section, seen)
        points = held = np.empty((0, 2))
        if parts is not None:
            points = np.concatenate([parts.middle, parts.ends])
            held = {"middle": parts.middle, "end": parts.ends}.get(self._part or "", held)
        scheme = self._scheme
        assert scheme is not None
        # VTK draws points as balls: to cover another, one must be higher by more than its radius.
        ball = RIM_PX * float((seen[1] - seen[0]).max()) / max(self.view.window_size)
        self._draw(NAMES[0], points, ball, color=scheme.text, size=RIM_PX)
        self._draw(NAMES[1], points, 2.0 * ball, color=HANDLE_COLOR, size=POINT_PX)
        self._draw(NAMES[2], held, 3.0 * ball, color=SELECTED_COLOR, size=POINT_PX)

    def _draw(
        self, name: str, points: FloatArray, above: float, *, color: str, size: float
    ) -> None:
        actor = self.view.actors.get(name)
        if not len(points):
            if actor is not None:
                actor.visibility = False
            return
        height = np.full(len(points), self._lift + above)
        shape = pv.PolyData(np.column_stack([points, height]))
        if actor is None:
            actor = self.view.add_mesh(
                shape,
                name=name,
                point_size=size * self.view.devicePixelRatioF(),
                render_points_as_spheres=True,
                lighting=False,
                reset_camera=False,
                render=False,
                pickable=False,
            )
        actor.mapper.dataset = shape
        actor.prop.color = color
        actor.visibility = True

    # Mouse -----------------------------------------------------------------------------

    def part_at(self, where: QPoint) -> str | None:
        """Return the part of the handle at a position in the widget; None if none is in reach."""
        if self._handle_parts is None or self.section is None:
            return None
        shown: list[tuple[Part, FloatArray]] = [
            ("end", self._pixels(self._handle_parts.ends)),
            ("middle", self._pixels(self._handle_parts.middle)),
            *(("line", self._pixels(line)) for line in self._handle_parts.lines),
        ]
        reach = REACH_PX * self.view.devicePixelRatioF()
        return part_at(shown, np.array(self.view.to_pixels(where)), reach)

    def _pixels(self, points: FloatArray) -> FloatArray:
        if not len(points):
            return points
        return to_display(self.view, np.column_stack([points, np.zeros(len(points))]))

    def place_of(self, where: QPoint) -> FloatArray:
        """Return the point (2,) in the mesh's plane at a position in the widget."""
        return np.array(on_plane(self.view, *self.view.to_pixels(where)))

    def grasp(self) -> tuple[Section, Box]:
        """Return the section and the visible box, as they are when a drag begins."""
        assert self.section is not None
        return self.section, self.seen_box()

    def dragged(self, grasp: tuple[Section, Box], start: FloatArray, end: FloatArray) -> Section:
        """Return the line or circle moved, turned, or with another radius, after a drag."""
        section, box = grasp
        return dragged(section, cast("Part", self._part), (start, end), box)
