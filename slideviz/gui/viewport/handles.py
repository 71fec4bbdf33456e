"""The handles of the selected section, one in each view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slideviz.color_scheme import ColorScheme
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.line_handle import Handle2D
from slideviz.gui.viewport.plane_handle import Bounds, PlaneHandle
from slideviz.gui.viewport.round_handle import RoundHandle
from slideviz.mesh.model import Mesh
from slideviz.scene.axis_handle import patch_in
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section, Triple

Handle = PlaneHandle | Handle2D | RoundHandle

_ROOM = 0.03
"""Margin between the mesh and the frame of a plane handle, relative to the mesh's length."""


class Handles:
    """The handles of a section, one in each view, by which it is dragged.

    Parameters
    ----------
    moved : callable
        Called with the new section while it is dragged.
    dragging : callable
        Called with True when a drag begins and with False when it ends.
    """

    def __init__(self, moved: Callable[[Section], None], dragging: Callable[[bool], None]) -> None:
        self._moved, self._dragging = moved, dragging
        self._section: Section | None = None
        self._of: dict[View3D, Handle] = {}

    def of(self, view: View3D) -> Handle | None:
        """Return the handle in a view; None if it has none."""
        return self._of.get(view)

    def __bool__(self) -> bool:
        return bool(self._of)

    def show(
        self,
        views: list[tuple[View3D, Scene, Mesh]],
        section: Section,
        mesh: Mesh,
        scheme: ColorScheme,
    ) -> None:
        """Show a handle of a section in every view.

        Parameters
        ----------
        views : list of (View3D, Scene, Mesh)
            Each view, its scene, and the mesh as deformed in the step it shows.
        section : Section
        mesh : Mesh
            The undeformed mesh.
        scheme : ColorScheme
        """
        self._section = section
        for view, scene, shown in views:
            handle = self._of.get(view)
            wanted = kind_of(section, mesh)
            if handle is not None and not isinstance(handle, wanted):
                self.drop(view)
                handle = None
            if handle is None:
                handle = self._of[view] = self._make(wanted, view, scene)
            if isinstance(handle, Handle2D):
                handle.show(section, scene.stage.lift(mesh), scheme)
            elif isinstance(handle, RoundHandle):
                handle.show(section, patch_in(section, shown, scene.sections.cuts), scheme)
            else:
                handle.show(section, _around(mesh), scheme)
            view.render_soon()

    def _make(self, kind: type[Handle], view: View3D, scene: Scene) -> Handle:
        if kind is PlaneHandle:
            return PlaneHandle(view, self._dragged, self._dragging)
        made = Handle2D if kind is Handle2D else RoundHandle
        return made(view, scene.stage.strip, self._moved, self._dragging)

    def drop(self, view: View3D) -> None:
        """Remove the handle from a view."""
        handle = self._of.pop(view, None)
        if handle is not None:
            handle.close()
            view.render_soon()

    def clear(self) -> None:
        """Remove the handles from all views."""
        for view in list(self._of):
            self.drop(view)

    def _dragged(self, origin: Triple, normal: Triple) -> None:
        section = self._section
        if section is None:
            return
        moved = replace(section, origin=origin, direction=normal)
        if not np.allclose(moved.origin, section.origin) or not np.allclose(
            moved.basis[2], section.basis[2]
        ):
            self._moved(moved)


def kind_of(section: Section, mesh: Mesh) -> type[Handle]:
    """Return the class of the handle for a section: by the mesh's dimension, then by its shape."""
    if mesh.dim == 2:
        return Handle2D
    return {"push": PlaneHandle, "pull": RoundHandle}[section.shape.handle]


def _around(mesh: Mesh) -> Bounds:
    """Return the bounding box of a 3D mesh, with a margin."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    room = _ROOM * (high - low).max()
    x, y, z = np.stack([low - room, high + room], axis=1).tolist()
    return (*x, *y, *z)
