"""The directions of the axes, in the lower left corner of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pyvista as pv

from slideviz.mesh.surfaces import Surface
from slideviz.scene.color_legend import set_letters
from slideviz.scene.plate import OPACITY
from slideviz.scene.stage import Stage
from slideviz.session.state import Session

SIZE = 92
"""Pixels of the corner, at normal letter size."""

COLOURS = ("#c8452f", "#4c9a2a", "#3b7dd8")
"""Those of x, y and z, seen on light and dark alike."""


class TriadLayer:
    """Three arrows that turn with the camera, with the letters x, y and z."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self._axes: Any = None
        self._drawn: tuple[object, ...] = ()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh."""

    def clear(self) -> None:
        """Forget the mesh; the arrows are no actor of the scene and only hidden."""
        if self._axes is not None:
            self.stage.plotter.hide_axes()
        self._drawn = ()

    def shapes(self) -> list[Any]:
        """Return nothing: the corner is the same wherever one looks from."""
        return []

    def update(self, _old: Session | None, new: Session) -> None:
        """Show another state."""
        plotter = self.stage.plotter
        shown = new.view.triad and new.mesh is not None
        flat = new.mesh is not None and new.mesh.dim == 2
        style = (self.stage.look, self.stage.font_scale, self.stage.has_plate)
        key = (shown, flat, style, tuple(plotter.window_size))
        if key == self._drawn or not (shown or self._axes):
            return
        self._drawn = key
        if self._axes is None:
            self._axes = self._make()
        # Of a 2D mesh, z points at the eye: its letter would lie on the others' origin.
        self._axes.SetZAxisLabelText("" if flat else "z")
        for caption in self._captions(self._axes):
            letters = caption.GetCaptionTextProperty()
            set_letters(letters, self.stage.look, 13 * self.stage.font_scale)
            # The mesh of a view that was zoomed into may lie behind.
            letters.SetBackgroundColor(*pv.Color(self.stage.look.background).float_rgb)
            letters.SetBackgroundOpacity(OPACITY if self.stage.has_plate else 0.0)
        width, height = plotter.window_size
        size = SIZE * self.stage.font_scale
        widget = plotter.renderer.axes_widget
        widget.SetViewport(
            0.0, 0.0, min(size / max(width, 1), 0.5), min(size / max(height, 1), 0.5)
        )
        if shown:
            plotter.show_axes()
        else:
            plotter.hide_axes()

    def _make(self) -> Any:
        x, y, z = COLOURS
        axes = self.stage.plotter.add_axes(
            interactive=False, line_width=3, x_color=x, y_color=y, z_color=z, xlabel="x", ylabel="y"
        )
        for caption in self._captions(axes):
            # A size of its own, whatever the corner's.
            caption.GetTextActor().SetTextScaleModeToNone()
        self.stage.plotter.renderer.axes_widget.SetZoom(1.3)
        return axes

    @staticmethod
    def _captions(axes: Any) -> tuple[Any, ...]:
        return tuple(getattr(axes, f"Get{axis}AxisCaptionActor2D")() for axis in "XYZ")
