"""Pictures of 2D meshes as SVG or PDF: lines and letters that stay sharp at any size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from slideviz.color_scheme import INVERTED_COLOUR, PAPER
from slideviz.errors import SlidevizError
from slideviz.export.mark_words import draw_mark
from slideviz.export.offscreen import CAPTION_AT, TITLE
from slideviz.export.offscreen_renderer import OffscreenRenderer, ordered
from slideviz.export.picture_options import GAP, PictureOptions, panes, title_of, titles_of
from slideviz.export.vector_sections import draw_sections
from slideviz.mesh.io.atomic import atomic_write
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import INVERTED
from slideviz.plots.bar import number_bar
from slideviz.plots.written import figure_bytes
from slideviz.scene.color_legend import STRIP
from slideviz.scene.mesh import FADED, is_faded
from slideviz.scene.plate import OPACITY
from slideviz.sections.threshold import chosen_cells
from slideviz.session.state import Session
from slideviz.terms import COLOUR_BY, ROLES

SUFFIXES = (".svg", ".pdf")
MOST_CELLS = 100_000
"""More cells make files that programs take minutes to show."""
_SCREEN_DPI = 200.0
"""Pixels per inch of a picture that was asked for in pixels."""
_LETTERS, _LINE, _EDGE = 13.0, 1.4, 0.3
"""Pixels of letters, boundaries and edges, at normal size."""


def write_vector(renderer: OffscreenRenderer, figure: PictureOptions, file: Path) -> None:
    """Write the picture of a 2D mesh as SVG or PDF, whole or not at all.

    Parameters
    ----------
    renderer : OffscreenRenderer
        Knows the session and from where to where the view reaches.
    figure : PictureOptions
        What the picture has; its background is white or transparent.
    file : Path
        Ends with .svg or .pdf.

    Raises
    ------
    SlidevizError
        The mesh is 3D or has too many cells, or the file cannot be written.
    """
    require_vector(renderer.session, file)
    drawn = draw_vector(renderer, figure)
    clear = figure.background == "transparent"
    data = figure_bytes(drawn, file.suffix.lower()[1:], drawn.dpi, clear)
    with atomic_write(file) as out:
        out.write(data)


def require_vector(session: Session, file: Path) -> None:
    """Raise SlidevizError when no SVG or PDF of that name can be made of what is shown."""
    if file.suffix.lower() not in SUFFIXES:
        raise SlidevizError(f"{file}: drawn as lines are {', '.join(SUFFIXES)}; end the name so")
    mesh = session.mesh
    if mesh is None or mesh.dim != 2:
        raise SlidevizError(f"{file}: only pictures of 2D meshes can be SVG or PDF; take PNG")
    if len(mesh.cells) > MOST_CELLS:
        raise SlidevizError(
            f"{file}: {len(mesh.cells):,} cells are too many to be drawn one by one "
            f"({MOST_CELLS:,} at most); take PNG"
        )


def draw_vector(renderer: OffscreenRenderer, figure: PictureOptions) -> Any:
    """Return the matplotlib figure of a 2D mesh as the renderer sees it."""
    from matplotlib.figure import Figure as Sheet

    dpi = figure.dpi or _SCREEN_DPI
    width, height = figure.size
    sheet = Sheet(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor="white")
    other = renderer.beside if figure.both else None
    parts = [(renderer.session, figure, 0)]
    titles: tuple[list[str], float] = [""], 1.0
    if figure.headed:
        titles = [title_of(renderer.session, figure)], 1.0
    if other is not None:
        gap = round(GAP * figure.scale)
        left, right = panes(figure, gap)
        pair = ordered(renderer.session, other)
        parts = [(pair[0], left, 0), (pair[1], right, left.size[0] + gap)]
        titles = titles_of(pair, left)
    reach: tuple[tuple[float, float], tuple[float, float]] | None = None
    for (session, part, start), title in zip(parts, titles[0], strict=True):
        axes = sheet.add_axes((start / width, 0.0, part.size[0] / width, 1.0))
        axes.set_axis_off()
        if reach is None:
            reach = renderer.window(part)
        (x, _), y = reach
        # The same length of the mesh for each pixel in both.
        unit = (y[1] - y[0]) / height
        axes.set_xlim(x, x + part.size[0] * unit)
        axes.set_ylim(*y)
        _mesh(axes, session, part, 72.0 / dpi * figure.scale)
        if part.headed:
            at = (start + CAPTION_AT * part.size[0]) / width
            _title(sheet, part, (title, titles[1]), at)
    if figure.legend:
        _legend(sheet, renderer.session, figure)
    return sheet


def _mesh(axes: Any, session: Session, figure: PictureOptions, point: float) -> None:
    """Draw cells and boundaries; ``point`` is the size of a pixel at normal size."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import Normalize

    frame = session.frame
    assert frame is not None
    assert session.mesh is not None
    mesh, view = frame.mesh, session.view
    by_role = view.colour_by == "role"
    values = frame.values(view.colour_by, session.mesh)
    values = np.where(frame.quality.status == INVERTED, np.nan, values)
    colours = colormaps[view.colour_map].with_extremes(bad=INVERTED_COLOUR)
    kept = np.ones(len(mesh.cells), bool)
    if view.threshold is not None and not by_role:
        kept[:] = False
        kept[chosen_cells(values, view.threshold)] = True
    # Without lines, neighbours would show a thin gap between them.
    edge, width = (PAPER.edge, _EDGE * point) if figure.edges else ("face", 0.05)
    lines: dict[str, Any] = {"edgecolors": edge, "linewidths": width}
    paint: dict[str, Any] = {"facecolors": PAPER.cell}
    if not by_role:
        paint = {"cmap": colours, "norm": Normalize(*session.colour_range)}
    faint: dict[str, Any] = {"alpha": FADED} if is_faded(session) else {}
    for ids, nodes in mesh.cells.by_type.values():
        here = kept[ids]
        shown = paint if by_role else {"array": values[ids[here]], **paint}
        axes.add_collection(
            PolyCollection(list(mesh.points[nodes[here]]), **shown, **lines, **faint)
        )
    draw_sections(axes, session, ({} if by_role else {"values": values}) | paint | lines, point)
    if view.undeformed:
        parts = [part for name in mesh.marker_names for part in _lines(session.mesh, name)]
        style: dict[str, Any] = {
            "colors": PAPER.ghost,
            "linestyles": "dashed",
            "linewidths": 0.7 * point,
        }
        axes.add_collection(LineCollection(parts, **style))
    for name in mesh.marker_names:
        if name not in view.hidden:
            colour = ROLES[session.role(name)].colour
            parts = list(_lines(mesh, name))
            axes.add_collection(LineCollection(parts, colors=colour, linewidths=_LINE * point))
    if figure.marked:
        draw_mark(axes, session, point)


def _lines(mesh: Mesh, name: str) -> FloatArray:
    """Return the segments of a boundary, (s, 2, 2)."""
    parts = [mesh.points[nodes] for _, nodes in mesh.marker(name).cells.by_type.values()]
    return np.concatenate([part for part in parts if part.shape[1] == 2] or [np.empty((0, 2, 2))])


def _title(sheet: Any, figure: PictureOptions, title: tuple[str, float], left: float) -> None:
    dpi, height = sheet.dpi, figure.size[1]
    words, part = title
    sheet.text(
        left,
        1.0 - 0.5 * figure.title_room * figure.scale / height,
        words,
        ha="left",
        va="center",
        fontsize=part * TITLE * figure.scale * 72.0 / dpi,
        color=PAPER.text,
    )


def _plate(sheet: Any, session: Session, figure: PictureOptions) -> None:
    """Set the legend off from a mesh that reaches below it."""
    from matplotlib.patches import Rectangle

    if figure.background == "transparent":
        return
    (width, height), scale = figure.size, figure.scale
    low, high = 0.16 - 12 * scale / height, 0.86
    if session.view.colour_by == "role":
        assert session.mesh is not None
        roles = {session.role(name) for name in session.mesh.marker_names}
        low, high = 1.0 - (29 + 24 * len(roles)) * scale / height, 1.0
    side = STRIP * scale / width
    plate = Rectangle((1.0 - side, low), side, high - low, transform=sheet.transFigure)
    plate.set(facecolor=PAPER.background, alpha=OPACITY, linewidth=0, zorder=0.5, gid="plate")
    sheet.add_artist(plate)


def _legend(sheet: Any, session: Session, figure: PictureOptions) -> None:
    """Draw the roles in use, or the colour bar, in the strip at the right."""
    width, height = figure.size
    scale, letters = figure.scale, _LETTERS * figure.scale * 72.0 / sheet.dpi
    left = 1.0 - (STRIP - 14) * scale / width
    _plate(sheet, session, figure)
    if session.view.colour_by == "role":
        assert session.mesh is not None
        used = {session.role(name) for name in session.mesh.marker_names}
        for row, role in enumerate(role for role in ROLES if role in used):
            y = 1.0 - (14 + 24 * (row + 1)) * scale / height
            style = {"va": "center", "fontsize": letters}
            sheet.text(left, y, "\u25a0", color=ROLES[role].colour, **style)
            sheet.text(left + 20 * scale / width, y, role, color=PAPER.text, **style)
        return
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    colours = colormaps[session.view.colour_map].with_extremes(under=INVERTED_COLOUR)
    inverted = session.frame is not None and session.frame.quality.inverted > 0
    # Above the plate, which is above the mesh.
    place = sheet.add_axes((left, 0.16, 20 * scale / width, 0.62), zorder=1)
    scalar = ScalarMappable(Normalize(*session.colour_range), colours)
    bar = sheet.colorbar(scalar, cax=place, extend="min" if inverted else "neither")
    bar.outline.set_visible(False)
    room = 0.3 * letters  # the numbers do not touch the bar
    place.tick_params(labelsize=letters, length=0, pad=room, labelcolor=PAPER.text)
    number_bar(bar, session.colour_range, 0.62 * height / sheet.dpi, letters)
    title = COLOUR_BY[session.view.colour_by].label
    place.set_title(title, fontsize=letters, loc="left", color=PAPER.text)
    if inverted:
        place.set_xlabel("inverted", fontsize=0.9 * letters, loc="left", color=PAPER.text)
