"""Pictures of 2D meshes as SVG or PDF: lines and letters that stay sharp at any size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from slideviz.argument_types import record
from slideviz.color_scheme import PAPER
from slideviz.errors import SlidevizError
from slideviz.export.offscreen import CAPTION_AT, TITLE
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions, headings, line_between, panes
from slideviz.export.titles import draw_marked_cell
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.plots.cells import color_bar, color_scale, draw_cells
from slideviz.plots.figure_io import empty_figure, write_figure
from slideviz.plots.section_paint import clipped
from slideviz.scene.legend import OPACITY
from slideviz.scene.mesh import FADED, is_faded
from slideviz.scene.sections import BAND, NAME, RIM, WIDTHS, shown_sections
from slideviz.scene.stage import STRIP
from slideviz.sections.cut import Cutter
from slideviz.sections.plane import box_around
from slideviz.sections.polygons import CellsInRange, Polygons
from slideviz.session.state import Session
from slideviz.terms import COLOR_BY, ROLES, WALL_VALUES

SUFFIXES = (".svg", ".pdf")  # suffixes of such pictures
MOST_CELLS = 100_000  # most cells of such a picture: viewers take minutes to show more
_SCREEN_DPI = 200.0  # pixels per inch of a picture whose size is given in pixels only
_LETTERS = 13.0
_LINE = 1.4
_CUT = 0.8
_EDGE = 0.3
"""Size of letters, and widths of boundaries, section lines and edges, in pixels at normal size."""
_ORDER = {RIM: 1.3, BAND: 1.4, NAME: 1.5}
"""matplotlib's zorder of sections: above the mesh's cells (1), and below its boundaries (2)."""


def write_vector(renderer: OffscreenRenderer, options: PictureOptions, file: Path) -> None:
    """Write the picture of a 2D mesh as SVG or PDF, whole or not at all.

    Raises SlidevizError if the mesh is 3D or has too many cells, or the file cannot be written.
    ``renderer``: holds the session, and says what part of the mesh is shown. ``options``: the
    options of the picture; its background is white or transparent. ``file``: a name ending with
    .svg or .pdf.
    """
    require_vector(renderer.session, file)
    drawn = draw_vector(renderer, options)
    write_figure(drawn, file, drawn.dpi, SlidevizError, options.background == "transparent")


def require_vector(session: Session, file: Path) -> None:
    """Raise SlidevizError if a session cannot be drawn as SVG or PDF, or not in this file."""
    if file.suffix.lower() not in SUFFIXES:
        raise SlidevizError(
            f"{file}: drawn as lines are {', '.join(SUFFIXES)}; end the name with one of these"
        )
    mesh = session.mesh
    if mesh is None or mesh.dim != 2:
        raise SlidevizError(f"{file}: only pictures of 2D meshes can be SVG or PDF; take PNG")
    if len(mesh.cells) > MOST_CELLS:
        raise SlidevizError(
            f"{file}: {len(mesh.cells):,} cells are too many to be drawn one by one "
            f"({MOST_CELLS:,} at most); take PNG"
        )


def draw_vector(renderer: OffscreenRenderer, options: PictureOptions) -> Any:
    """Return the matplotlib figure of a 2D mesh, showing the same part as the renderer would."""
    dpi = options.dpi or _SCREEN_DPI
    width, height = options.size
    figure = empty_figure((width / dpi, height / dpi), dpi)
    sessions = renderer.shown(renderer.session, options)
    titles, size = headings(sessions, options)
    parts = [(options, 0)]
    if len(sessions) == 2:
        left, right = panes(options, options.gap)
        parts = [(left, 0), (right, left.size[0] + options.gap)]
        _line_between(figure, options, left.size[0])
    # Both have the same scale.
    (x, _), y = renderer.window(parts[0][0])
    unit = (y[1] - y[0]) / height
    for session, (part, start), title in zip(sessions, parts, titles, strict=True):
        axes = figure.add_axes((start / width, 0.0, part.size[0] / width, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(x, x + part.size[0] * unit), ylim=y)
        _draw_mesh(axes, session, part, 72.0 / dpi * options.scale)
        left_end = (start + CAPTION_AT * part.size[0]) / width
        _title(figure, title, part, size=size, left=left_end)
    if options.legend:
        _legend(figure, renderer.session, options)
    return figure


def _line_between(figure: Any, options: PictureOptions, start: int) -> None:
    """Draw the line between two pictures; the left one ends at the pixel ``start``."""
    line = line_between(options)
    x = (start + (line.start + line.stop) / 2.0) / options.size[0]
    wide = (line.stop - line.start) * 72.0 / figure.dpi
    figure.add_artist(Line2D([x, x], [0.0, 1.0], color=PAPER.edge, linewidth=wide, gid="between"))


@record
class _Paint:
    """How cells are drawn: by values (m,) and a ScalarMappable, or in one color (None).

    ``edge`` is the width of their edges in points.
    """

    values: FloatArray | None
    colors: Any
    edge: float

    def draw(self, axes: Any, cells: Polygons, **style: Any) -> None:
        """Draw cells onto axes, inverted ones last."""
        if self.values is None:
            style["facecolors"] = PAPER.cell
        else:  # folded cells overlap: inverted ones are to be seen
            cells = cells.with_last(np.isnan(self.values[cells.cells]))
        values = None if self.values is None else self.values[cells.cells]
        draw_cells(axes, cells, values, self.colors, edges=self.edge, **style)

    def at(self, cells: IntArray) -> dict[str, Any]:
        """Return the color arguments of a LineCollection with a line for each of cells (k,)."""
        if self.values is None:
            return {"colors": PAPER.cell}
        scale = self.colors
        return {"array": self.values[cells], "cmap": scale.cmap, "norm": scale.norm}


def _draw_mesh(axes: Any, session: Session, options: PictureOptions, pixel_pt: float) -> None:
    """Draw cells, sections and boundaries; a pixel at normal size is ``pixel_pt`` points wide."""
    frame = session.shown_frame
    view = session.view
    mesh = frame.mesh
    cutter = Cutter(frame.mesh)
    edge = _EDGE * pixel_pt * options.edges
    only = None
    paint = _Paint(None, None, edge)
    if view.color_by != "role":
        values = frame.shown_values(view.color_by, session.reference)
        at_walls = view.color_by in WALL_VALUES
        colors = color_scale(session.color_map, session.color_range, at_walls)
        shown = clipped(values, session.color_range) if at_walls else values
        paint = _Paint(shown, colors, edge)
        only = None if view.threshold is None else CellsInRange.of(values, view.threshold)
    cells = cutter.all_cells(mesh.points)
    faint = FADED if is_faded(session) else None
    paint.draw(axes, cells if only is None else only.among(cells), alpha=faint)
    box = box_around(mesh.points[cutter.used])
    for _, section in shown_sections(session):
        cut = cutter.show(mesh.points, replace(section, whole_cells=False), only)
        if len(cut):
            ends = list(cut.points[cut.connectivity, :2].reshape(-1, 2, 2))
            style: dict[str, Any]
            for kind, colors in ((RIM, {"colors": PAPER.text}), (BAND, paint.at(cut.cells))):
                style = {"linewidths": WIDTHS[kind] * pixel_pt, "zorder": _ORDER[kind]}
                axes.add_collection(LineCollection(ends, **style, **colors), autolim=False)
            if section.whole_cells:
                paint.draw(axes, cutter.show(mesh.points, section, only), zorder=_ORDER[NAME])
        # The thin line is above whole cells, and below a band.
        order = _ORDER[NAME] + 0.05 if section.whole_cells else _ORDER[RIM] - 0.05
        line: dict[str, Any] = {
            "colors": PAPER.text,
            "linewidths": _CUT * pixel_pt,
            "zorder": order,
        }
        axes.add_collection(LineCollection(section.in_plane.trace(box), **line), autolim=False)
    if "undeformed" in view.drawn:
        parts = [part for name in mesh.marker_names for part in _lines(session.opened_mesh, name)]
        style = {"colors": PAPER.ghost, "linestyles": "dashed", "linewidths": 0.7 * pixel_pt}
        axes.add_collection(LineCollection(parts, **style))
    for name in mesh.marker_names:
        if name not in view.hidden:
            style = {"colors": ROLES[session.role(name)].color}
            if view.color_by in WALL_VALUES:  # layers may be too thin to be seen
                boundary = boundary_of(mesh)
                style = paint.at(boundary.owner[boundary.marker == boundary.names.index(name)])
            style["linewidths"] = _LINE * pixel_pt
            axes.add_collection(LineCollection(list(_lines(mesh, name)), **style))
    if options.marked:
        draw_marked_cell(axes, session, pixel_pt)


def _lines(mesh: Mesh, name: str) -> FloatArray:
    """Return the segments (s, 2, 2) of a 2D mesh's boundary."""
    return mesh.points[mesh.marker(name).cells.connectivity].reshape(-1, 2, 2)


def _title(figure: Any, words: str, options: PictureOptions, *, size: float, left: float) -> None:
    """Draw a title; ``left`` is its left end, relative to the width; ``size`` 1 is usual."""
    high = 1.0 - 0.5 * options.title_room * options.scale / options.size[1]
    points = size * TITLE * options.scale * 72.0 / figure.dpi
    figure.text(left, high, words, ha="left", va="center", fontsize=points, color=PAPER.text)


def _legend(figure: Any, session: Session, options: PictureOptions) -> None:
    """Draw the legend at the right, on a half-transparent plate: the roles, or the color bar."""
    width = options.size[0]
    scale = options.scale
    letters = _LETTERS * scale * 72.0 / figure.dpi
    clear = options.background == "transparent"
    if session.view.color_by == "role":
        used = {session.role(name) for name in session.opened_mesh.marker_names}
        roles = [
            Patch(color=term.color, label=term.label)
            for role, term in ROLES.items()
            if role in used
        ]
        look = {"frameon": not clear, "framealpha": OPACITY, "edgecolor": "none"}
        look |= {"handlelength": 0.8, "handleheight": 0.8, "handletextpad": 0.5}
        figure.legend(handles=roles, loc="upper right", fontsize=letters, **look)
        return
    inverted = session.frame is not None and session.frame.quality.inverted > 0
    # The bar is above the plate, which is above the mesh.
    left = 1.0 - (STRIP - 14) * scale / width
    wide = 20 * scale / width
    place = figure.add_axes((left, 0.16, wide, 0.62), zorder=1)
    colors = color_scale(session.color_map, session.color_range)
    bar = color_bar(place, colors, "", letters, inverted=inverted, upright=True)
    bar.outline.set_visible(False)
    place.tick_params(length=0, pad=0.3 * letters)  # the numbers do not touch the bar
    name = COLOR_BY[session.view.color_by].label
    place.set_title(name, fontsize=letters, loc="left", color=PAPER.text)
    if not clear:
        box = place.get_tightbbox().padded(6.0 * scale)
        box = box.transformed(figure.transFigure.inverted())
        plate = Rectangle((box.x0, box.y0), 1.0 - box.x0, box.height, transform=figure.transFigure)
        plate.set(facecolor=PAPER.background, alpha=OPACITY, linewidth=0, zorder=0.5, gid="plate")
        figure.add_artist(plate)
