"""The legend of the scene: the roles in use, or the color bar; and the axes in a corner."""

from __future__ import annotations

from typing import Any

import pyvista as pv

from slideviz.scene.color_legend import (
    OPACITY,
    LegendPlate,
    add_color_bar,
    add_point_legend,
    add_role_legend,
    clear_legend,
    lines_room,
    place_bar,
    set_letters,
)
from slideviz.scene.stage import KeyedLayer, Stage
from slideviz.session.state import Session
from slideviz.terms import COLOR_BY, ROLES

PLATE = "plate:legend"


class LegendLayer(KeyedLayer):
    """The legend of roles or the color bar, in a strip at the right."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        # A mapper of its own: that of an actor may be removed before the bar.
        self._mapper = pv.DataSetMapper()
        self._mapper.lookup_table = stage.table
        self._end = 0.0
        self._placed: tuple[float, ...] = ()

    def clear(self) -> None:
        clear_legend(self.stage.plotter)
        self._key = ()
        self._bar: tuple[str, float] | None = None
        self._plate: LegendPlate | None = None

    def update(self, old: Session | None, new: Session) -> None:
        super().update(old, new)
        self._place()

    def draw(self, session: Session) -> None:
        clear_legend(self.stage.plotter)
        self._bar = self._plate = None
        stage = self.stage
        mesh = session.mesh
        what = session.view.color_by
        if mesh is None or not ("legend" in session.view.drawn and stage.has_legend):
            return
        self._placed = ()
        # First, as later actors are drawn over it.
        self._plate = LegendPlate(stage.plotter, PLATE, stage.scheme) if stage.has_plate else None
        if what == "role":
            used = {session.role(name) for name in mesh.marker_names}
            roles = [role for role in ROLES if role in used]
            add_role_legend(stage, roles)
            self._end = add_point_legend(stage, 24.0 * len(roles) + 16)
            return
        term = COLOR_BY[what]
        add_color_bar(stage, self._mapper, term, has_inverted(session))
        end = add_point_legend(stage, 4.0)
        self._bar = (term.label, end + (34 if self._has_lines else 0))
        self._end = end

    @property
    def _has_lines(self) -> bool:
        return bool(self.stage.point_words or self.stage.ring_words)

    def _place(self) -> None:
        """Place color bar and plate, if the view's size or pixel scale has changed."""
        plotter = self.stage.plotter
        scale = self.stage.pixel_scale
        size = (*plotter.window_size, scale)
        if size == self._placed or not self._key:
            return
        self._placed = size
        rect = lines_room(plotter, self._end, scale)
        if self._bar is not None:
            bar_rect = place_bar(plotter, *self._bar, scale)
            rect = (*bar_rect[:3], rect[3]) if self._has_lines else bar_rect
        if self._plate is not None:
            self._plate.place(rect)

    def key(self, session: Session) -> tuple[object, ...]:
        mesh = session.mesh
        view = session.view
        names = mesh.marker_names if mesh is not None and view.color_by == "role" else ()
        content = frozenset(session.role(name) for name in names) or has_inverted(session)
        colors = (view.color_by, view.color_map, session.color_range)
        points = self.stage.point_words, self.stage.ring_words
        style = self.stage.scheme, self.stage.font_scale, self.stage.pixel_scale
        shown = "legend" in view.drawn and self.stage.has_legend, self.stage.has_plate
        return (id(mesh), shown, colors, content, points, style)


def has_inverted(session: Session) -> bool:
    """Return whether the shown frame has inverted cells."""
    return session.frame is not None and session.frame.quality.inverted > 0


SIZE = 92  # width and height in pixels of the corner with the axes, at normal letter size
COLORS = ("#c8452f", "#4c9a2a", "#3b7dd8")
"""Colors of the axes x, y and z, visible on light and dark backgrounds."""


class TriadLayer(KeyedLayer):
    """The three axes in the lower left corner, which turn with the camera; two of a 2D mesh."""

    _axes: Any = None

    def clear(self) -> None:
        if self._axes is not None:
            self.stage.plotter.hide_axes()
        self._key = ()

    def key(self, session: Session) -> tuple[object, ...]:
        if "triad" not in session.view.drawn or session.mesh is None:
            return ()
        style = (self.stage.scheme, self.stage.pixel_scale, self.stage.has_plate)
        return session.mesh.dim, style, tuple(self.stage.plotter.window_size)

    def draw(self, session: Session) -> None:
        plotter = self.stage.plotter
        if not self._key or session.mesh is None:
            if self._axes is not None:
                plotter.hide_axes()
            return
        if self._axes is None:
            self._axes = self._make()
        # Of a 2D mesh, z points at the camera: its letter would lie on the others' origin.
        self._axes.SetZAxisLabelText("" if session.mesh.dim == 2 else "z")
        for caption in self._captions(self._axes):
            letters = caption.GetCaptionTextProperty()
            set_letters(letters, self.stage.scheme, 13 * self.stage.font_scale)
            # The mesh of a zoomed view may be behind the letters.
            letters.SetBackgroundColor(*pv.Color(self.stage.scheme.background).float_rgb)
            letters.SetBackgroundOpacity(OPACITY if self.stage.has_plate else 0.0)
        width, height = plotter.window_size
        size = SIZE * self.stage.pixel_scale
        widget = plotter.renderer.axes_widget
        widget.SetViewport(
            0.0, 0.0, min(size / max(width, 1), 0.5), min(size / max(height, 1), 0.5)
        )
        plotter.show_axes()

    def _make(self) -> Any:
        x, y, z = COLORS
        axes = self.stage.plotter.add_axes(
            interactive=False, line_width=3, x_color=x, y_color=y, z_color=z, xlabel="x", ylabel="y"
        )
        for caption in self._captions(axes):
            # The letters do not scale with the corner.
            caption.GetTextActor().SetTextScaleModeToNone()
        self.stage.plotter.renderer.axes_widget.SetZoom(1.3)
        return axes

    @staticmethod
    def _captions(axes: Any) -> tuple[Any, ...]:
        return tuple(getattr(axes, f"Get{axis}AxisCaptionActor2D")() for axis in "XYZ")
