"""The legend of the scene: the roles in use, or the color bar; and the axes in a corner."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

from slideviz.color_scheme import ColorScheme
from slideviz.mesh.model import FloatArray
from slideviz.plots.ticks import bar_ticks
from slideviz.scene.actors import add_overlay, remove_actor
from slideviz.scene.stage import STRIP, KeyedLayer, Stage
from slideviz.session.state import Session
from slideviz.terms import COLOR_BY, ROLES, ColorByTerm, Numbers, Role, WholeNumbers

OPACITY = 0.82  # opacity of a plate, which covers the mesh
Rect = tuple[float, float, float, float]
"""Left, bottom, right and top, in pixels from the lower left corner of the view."""


class LegendPlate:
    """A half-transparent rectangle in the background's colors, between legend and mesh.

    ``name``: the name of the actor. 2D actors added later are drawn over it.
    """

    def __init__(self, plotter: Any, name: str, scheme: ColorScheme) -> None:
        self.plotter = plotter
        self._scheme = scheme
        self._shape = pv.PolyData(np.zeros((4, 3)), faces=[4, 0, 1, 2, 3])
        mapper = vtkPolyDataMapper2D()
        actor = vtkActor2D()
        mapper.SetInputData(self._shape)
        mapper.SetScalarModeToUsePointData()
        actor.SetMapper(mapper)
        actor.SetPickable(False)
        # A reference in Python: VTK alone would keep only the C++ object.
        self.actor = actor
        add_overlay(plotter, actor, name)

    def place(self, rect: Rect) -> None:
        """Set the rectangle that the plate covers, and its colors, for the view's present size."""
        left, bottom, right, top = rect
        high = max(self.plotter.window_size[1], 1)
        corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
        self._shape.points = np.array([(*corner, 0.0) for corner in corners])
        colors = [self.color_at(y / high) for _, y in corners]
        self._shape.point_data["color"] = np.array(colors, np.uint8)
        self._shape.set_active_scalars("color", preference="point")

    def color_at(self, height: float) -> WholeNumbers:
        """Return red, green, blue and opacity (0 to 255) at a height from 0 to 1 of the view."""
        below = np.array(pv.Color(self._scheme.background).int_rgb, float)
        above = np.array(pv.Color(self._scheme.background_top).int_rgb, float)
        mixed: FloatArray = below + np.clip(height, 0.0, 1.0) * (above - below)
        return (*(int(part) for part in mixed.round()), round(255 * OPACITY))


_VTK_FONT_FILE = 4
_AIR = 12.0  # margin in pixels between the color bar and the edge of its plate
_BAR = 20.0
_LONG = 11
"""Width of the color bar in pixels; number of letters from which a title needs the whole strip."""
_LABEL = 14.0
_GAP = 4.0
_HEAD = 30.0
"""Height of a number beside the bar, distance between both, height of the title, in pixels."""
_BOTTOM = 0.16
_NAN = 13.0
_INDENT = 4.0
"""Lower end of the bar relative to the view's height; height in pixels of the field of inverted
cells there; distance in pixels from the field to its text."""


@lru_cache(maxsize=1)
def _font_file() -> str:
    """Return the path of a font with Greek letters and signs, which VTK's own font lacks."""
    return str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")


def set_letters(text: Any, scheme: ColorScheme, size: float) -> None:
    """Set font, the color scheme's text color, and a size in points of a vtkTextProperty."""
    text.SetFontFamily(_VTK_FONT_FILE)
    text.SetFontFile(_font_file())
    text.SetFontSize(round(size))
    text.SetColor(*pv.Color(scheme.text).float_rgb)
    text.SetBold(False)
    text.SetItalic(False)
    text.SetShadow(False)


ROLE = "\u25a0"
NODES = "\u25cf"
RING = "\u25cb"
"""The signs at the begin of the legend's lines: of roles, of nodes, of what is marked by rings."""
_SIGNS = {
    ROLE: ("legend:", STRIP - 28, 14),
    NODES: ("legend:nodes:", STRIP - 25, 12),
    RING: ("legend:rings:", STRIP - 25, 12),
}
"""For each sign: prefix of the actors' names; left edge of the text, in pixels from the view's
right edge; size of the letters."""


def add_role_legend(stage: Stage, roles: Sequence[Role]) -> None:
    """Draw the roles in use in the upper right corner, a line each, with its color."""
    for row, role in enumerate(roles, start=1):
        _line(stage, ROLE, ROLES[role].color, ROLES[role].label, down=14 + 24 * row)


def add_point_legend(stage: Stage, top: float) -> float:
    """Draw the meanings of points and rings, from ``top`` pixels below the view's upper edge.

    Return the distance of the last line from there, in pixels.
    """
    words = [(NODES, *line) for line in stage.point_words]
    words += [(RING, *line) for line in stage.ring_words]
    for row, (sign, word, color) in enumerate(words, start=1):
        _line(stage, sign, color, word, down=top + 21 * row)
    return top + 21 * len(words)


def _line(stage: Stage, sign: str, color: str, word: str, *, down: float) -> None:
    """Draw a sign in its color and a text, ``down`` pixels below the view's upper edge.

    A line that continues the one above has no color, and no sign.
    """
    # A role and the nodes of a type may have the same word.
    prefix, right, size = _SIGNS[sign]
    signs = [(sign, color, STRIP - 8, 1.4 * size)] if color else []
    for what, shade, edge, letters in (*signs, (word, stage.scheme.text, right, size)):
        text = write(stage, what, f"{prefix}{word}:{what}", (1.0, 1.0), (-edge, -down), letters)
        text.prop.color = shade


def write(
    stage: Stage,
    word: str,
    name: str,
    corner: Sequence[float],
    at: tuple[float, float],
    size: float,
) -> Any:
    """Write a word over the view, centred vertically; return its actor.

    It begins ``at`` pixels (at normal letter size) from a place relative to the view (0 to 1), or
    from a point of the scene.
    """
    text = pv.Text(word)
    reference = vtkCoordinate()
    if len(corner) == 2:
        reference.SetCoordinateSystemToNormalizedViewport()
    else:
        reference.SetCoordinateSystemToWorld()
    reference.SetValue(*corner)
    place = text.GetPositionCoordinate()
    place.SetReferenceCoordinate(reference)
    place.SetCoordinateSystemToViewport()
    place.SetValue(at[0] * stage.pixel_scale, at[1] * stage.pixel_scale)
    set_letters(text.prop, stage.scheme, size * stage.font_scale)
    text.prop.SetVerticalJustificationToCentered()
    add_overlay(stage.plotter, text, name)
    return text


def clear_legend(plotter: Any) -> None:
    """Remove the lines of the legend, the color bar, and the plate."""
    for name in list(plotter.actors):
        if name.startswith(("legend:", "plate:")):
            remove_actor(plotter, name)
    for name in list(plotter.scalar_bars.keys()):
        plotter.remove_scalar_bar(name, render=False)


def add_color_bar(stage: Stage, mapper: Any, what: ColorByTerm, inverted: bool) -> None:
    """Add the color bar of a mapper; `place_bar` places it.

    ``inverted``: with a field for inverted cells at its lower end.
    """
    scheme = stage.scheme
    font_scale = stage.font_scale
    title = what.label
    name, _, program = title.partition(" (")  # beside the name there is no place for the program
    words = (f"({program}" if program else "", what.unit)
    below = " ".join(filter(None, words)) if len(program) < _LONG else "\n".join(words).strip()
    scale = stage.pixel_scale
    bar = stage.plotter.add_scalar_bar(
        title=title,
        mapper=mapper,
        vertical=True,
        interactive=False,
        color=scheme.text,
        render=False,
    )
    bar.SetUnconstrainedFontSize(True)
    bar.SetTitle(f"{name}\n{below}" if below else name)
    # Longer words would be cut off at the edge of the view.
    size = 14 if len(name) < _LONG else 13
    if below:
        size = 12 if len(name) < 15 else 10
    set_letters(bar.GetTitleTextProperty(), scheme, size * font_scale)
    set_letters(bar.GetLabelTextProperty(), scheme, 13 * font_scale)
    set_letters(bar.GetAnnotationTextProperty(), scheme, 12 * font_scale)
    bar.SetVerticalTitleSeparation(round(8 * scale))
    bar.SetTextPad(round(_GAP * scale))
    bar.SetUseCustomLabels(True)
    bar.SetDrawNanAnnotation(inverted)
    bar.SetNanAnnotation("")
    bar.SetDrawAboveRangeSwatch(False)
    if inverted:  # VTK's own annotation would be to the bar's left, over the mesh
        at = _BAR + _GAP + _INDENT + 14 - STRIP, _NAN / 2.0
        write(stage, "inverted", "legend:inverted:", (1.0, _BOTTOM), at, 12)


def place_bar(plotter: Any, title: str, below: float, scale: float) -> Rect:
    """Place the color bar at the right edge of the view, for the view's present size.

    It begins ``below`` pixels (at normal letter size) under the view's upper edge, where lines
    about points may be. Return the rectangle of the bar and its letters, with a margin.
    """
    width, height = np.maximum(plotter.window_size, 1).tolist()
    bar = plotter.scalar_bars[title]
    bottom = _BOTTOM
    bar.SetPosition(1.0 - (STRIP - 14) * scale / width, bottom)
    # The title is centred on this width: a short one keeps away from the edge of the view.
    wide = STRIP - 20 if len(title) >= _LONG else 66
    bar.SetWidth(wide * scale / width)
    bar.SetBarRatio(_BAR / wide)
    free = 1.0 - below * scale / height
    part = max(min(0.68, free - bottom), 0.2)
    bar.SetHeight(part)
    _number(bar, max(part * height - _HEAD * scale, 1.0) / scale)
    margin = _AIR * scale
    return _rect(plotter, bottom * height - margin, (bottom + part) * height + margin, scale)


def _number(bar: Any, length: float) -> None:
    """Set the numbers beside a bar, as many as fit in its length (pixels at normal letter size)."""
    low, high = bar.GetLookupTable().GetRange()
    at, form = bar_ticks(low, high, lambda _: _LABEL / length)
    bar.SetLabelFormat(form)
    bar.SetCustomLabels(numpy_to_vtk(at, deep=True))


def _rect(plotter: Any, bottom: float, top: float, scale: float) -> Rect:
    """Return the rectangle of the legend's strip between two heights, in pixels."""
    width, height = plotter.window_size
    return width - STRIP * scale, bottom, float(width), min(top, float(height))


PLATE = "plate:legend"


class LegendLayer(KeyedLayer):
    """The legend of roles or the color bar, in a strip at the right."""

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        # A mapper of its own: that of an actor may be removed before the bar.
        self._mapper = pv.DataSetMapper()
        self._mapper.lookup_table = stage.table
        self._end = 0.0
        self._placed: Numbers = ()

    def clear(self) -> None:
        super().clear()
        self.wipe()

    def wipe(self) -> None:
        clear_legend(self.stage.plotter)
        self._bar: tuple[str, float] | None = None
        self._plate: LegendPlate | None = None

    def update(self, old: Session | None, new: Session) -> None:
        super().update(old, new)
        self._place()

    def draw(self, session: Session) -> None:
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
        high = plotter.window_size[1]
        rect = _rect(plotter, high - (self._end + 13) * scale, high, scale)
        if self._bar is not None:
            bar_rect = place_bar(plotter, *self._bar, scale)
            rect = (*bar_rect[:3], rect[3]) if self._has_lines else bar_rect
        if self._plate is not None:
            self._plate.place(rect)

    def key(self, session: Session) -> object:
        mesh = session.mesh
        view = session.view
        names = mesh.marker_names if mesh is not None and view.color_by == "role" else ()
        content = frozenset(session.role(name) for name in names) or has_inverted(session)
        colors = (view.color_by, view.color_map, session.color_range)
        points = self.stage.point_words, self.stage.ring_words
        style = self.stage.scheme, self.stage.font_scale, self.stage.pixel_scale
        shown = "legend" in view.drawn and self.stage.has_legend, self.stage.has_plate
        return id(mesh), shown, colors, content, points, style


def has_inverted(session: Session) -> bool:
    """Return whether the shown frame has inverted cells."""
    return session.frame is not None and session.frame.quality.inverted > 0


class PreviewLayer(KeyedLayer):
    """The word Preview in the upper left corner, while the mesh is one."""

    names = ("preview",)

    def key(self, session: Session) -> object:
        if session.preview is None:
            return ()
        return self.stage.scheme, self.stage.pixel_scale, self.stage.font_scale

    def draw(self, _session: Session) -> None:
        word = write(self.stage, "Preview", "preview", (0.0, 1.0), (14, -14), 15)
        word.prop.SetVerticalJustificationToTop()


SIZE = 92  # width and height in pixels of the corner with the axes, at normal letter size
COLORS = ("#c8452f", "#4c9a2a", "#3b7dd8")
"""Colors of the axes x, y and z, visible on light and dark backgrounds."""


class TriadLayer(KeyedLayer):
    """The three axes in the lower left corner, which turn with the camera; two of a 2D mesh."""

    _axes: Any = None

    def clear(self) -> None:
        super().clear()
        self.wipe()

    def wipe(self) -> None:
        if self._axes is not None and not self._key:
            self.stage.plotter.hide_axes()

    def key(self, session: Session) -> object:
        if "triad" not in session.view.drawn or session.mesh is None:
            return ()
        style = (self.stage.scheme, self.stage.pixel_scale, self.stage.has_plate)
        return session.mesh.dim, style, tuple(self.stage.plotter.window_size)

    def draw(self, session: Session) -> None:
        plotter = self.stage.plotter
        if self._axes is None:
            self._axes = self._make()
        # Of a 2D mesh, z points at the camera: its letter would lie on the others' origin.
        self._axes.SetZAxisLabelText("" if session.opened_mesh.dim == 2 else "z")
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
