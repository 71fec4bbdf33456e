"""Pictures of sections, drawn with matplotlib: PNG, SVG and PDF alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.errors import CaseError
from slideviz.mesh.io.atomic import atomic_write
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.plots.around import draw_around, window
from slideviz.plots.section_curve import Colours, CurveRow, curve_of, draw_curves, position_label
from slideviz.plots.section_dress import add_bar, dress_axes
from slideviz.plots.section_layout import (
    Layout,
    height_for,
    inches_of,
    lay_out,
    plot_layout,
    room_ratio,
)
from slideviz.plots.section_paint import Paint
from slideviz.plots.section_polygons import shapes_of
from slideviz.plots.section_space import in_space
from slideviz.plots.section_title import LETTERS, write_title
from slideviz.plots.style import PRINT
from slideviz.plots.written import figure_bytes
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined
from slideviz.sections.shape import Label
from slideviz.terms import QUANTITIES

SUFFIXES = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class SectionStyle:
    """How a section is drawn.

    Attributes
    ----------
    size : (int, int)
        Width and height of the picture in pixels; SVG and PDF keep their ratio.
    trimmed : bool
        The height is the most: the picture is only as high as the section needs.
    edges : bool
        Draw the mesh lines.
    in_space : bool
        Show it in space instead of flat.
    name : str
        What was cut: it stands before the section in words, shortened where there is no room.
    state : str
        Which state of it: run, method and step.
    dpi : float, optional
        Pixels per inch; left out, letters can be read when the picture is as wide as a page.
    note : str
        Stands behind the numbers of the title.
    """

    size: tuple[int, int] = (1600, 1000)
    trimmed: bool = False
    edges: bool = True
    in_space: bool = False
    name: str = ""
    state: str = ""
    dpi: float | None = None
    note: str = ""


def require_picture_name(file: Path) -> None:
    """Raise if no picture can have this name.

    Raises
    ------
    CaseError
        The end of the name is none of ``SUFFIXES``.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise CaseError(f"{file}: a section is drawn as {', '.join(SUFFIXES)}; end the name so")


def section_picture(
    pieces: Mapping[int, Polygons],
    section: Section,
    paint: Paint,
    file: str | Path,
    style: SectionStyle | None = None,
    around: Polygons | None = None,
) -> None:
    """Write the picture of a section; of a cut through a 2D mesh, the curve along it.

    Parameters
    ----------
    pieces : mapping of int to Polygons
        What the section shows of each passage; 0 is the mesh itself (see
        `slideviz.session.passages.show_passages`).
    section : Section
    paint : Paint
        Its numbers are those of the cells that the pieces name.
    file : str or Path
        Ends with .png, .svg or .pdf.
    style : SectionStyle, optional
    around : Polygons, optional
        The other cells of a 2D mesh (see `slideviz.plots.around.surroundings`).

    Raises
    ------
    CaseError
        There is nothing to draw, the name has another end, or the file cannot be written.
    """
    target, style = Path(file), style or SectionStyle()
    require_picture_name(target)
    figure, dpi = draw_section(pieces, section, paint, style, around)
    write_figure(figure, dpi, target)


def write_figure(figure: Any, dpi: float, target: Path) -> None:
    """Write a matplotlib figure, whole or not at all.

    Raises
    ------
    CaseError
        The file cannot be written.
    """
    kind = target.suffix.lower()[1:]
    data = figure_bytes(figure, kind, dpi if kind == "png" else 300)
    with atomic_write(target, CaseError) as out:
        out.write(data)


def draw_section(
    pieces: Mapping[int, Polygons],
    section: Section,
    paint: Paint,
    style: SectionStyle,
    around: Polygons | None = None,
) -> tuple[Any, float]:
    """Return the matplotlib figure of a section, and its pixels per inch.

    Raises
    ------
    CaseError
        There is nothing to draw.
    """
    drawn = {number: piece for number, piece in pieces.items() if len(piece)}
    if not drawn:
        raise CaseError(f"{section.describe()}: it cuts no cell, so there is nothing to draw")
    figure, dpi = empty_figure(style)
    lines = all(piece.sizes.max() == 2 for piece in drawn.values())
    if lines:
        layout = _curve(figure, joined(list(drawn.values())), section, paint)
    else:
        layout = _cells(figure, drawn, section, paint, style, around)
    ids = ids_of(drawn)
    in_plane = not any(piece.points[:, 2].any() for piece in drawn.values())
    what = section.describe(2 if in_plane else 3)
    words = ", ".join(part for part in (style.state, what) if part)
    numbers = "; ".join(part for part in (paint.sentence(ids), style.note) if part)
    write_title(figure, layout, (style.name, words), numbers)
    return figure, dpi


def empty_figure(style: SectionStyle) -> tuple[Any, float]:
    """Return an empty figure of the size that is asked for, and its pixels per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height, dpi = inches_of(style.size, style.dpi)
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure, dpi


def ids_of(drawn: Mapping[int, Polygons]) -> IntArray:
    """Return the cells that are cut: of the mesh itself, or, where it is not cut, of all."""
    every = np.unique(np.concatenate([piece.cell_ids for piece in drawn.values()]))
    return drawn[0].cell_ids if 0 in drawn else every


def _cells(
    figure: Any,
    drawn: Mapping[int, Polygons],
    section: Section,
    paint: Paint,
    style: SectionStyle,
    around: Polygons | None,
) -> Layout:
    """Draw polygons, with a colour bar."""
    flat, labels = laid_flat(drawn, section, style)
    flat = folded_last(flat, section, paint)
    corners = flat.points[flat.connectivity, :2]
    box, inches = (corners.min(axis=0), corners.max(axis=0)), figure.get_size_inches()
    if around is not None:
        box = window(box, around, room_ratio(inches))
    if style.trimmed:
        inches = inches[0], height_for(box, inches, bare=style.in_space)
        figure.set_size_inches(inches)
    layout = lay_out(box, inches, bare=style.in_space)
    axes = figure.add_axes(layout.axes)
    if around is not None:
        draw_around(axes, around, section, (layout.low, layout.high))
    shapes = shapes_of(flat, paint, layout.points_per_length, style.edges, lit=style.in_space)
    axes.add_collection(shapes)
    dress_axes(axes, layout, labels)
    if style.in_space:
        _triad(figure, drawn, section)
    inverted = any(paint.inverted[piece.cells].any() for piece in drawn.values())
    add_bar(figure, layout, paint, inverted)
    return layout


def _curve(figure: Any, lines: Polygons, section: Section, paint: Paint) -> Layout:
    """Draw the numbers along a line or circle."""
    curve = curve_of(lines, section, paint.values, paint.inverted)
    return plot_curves(figure, [CurveRow("", curve)], section, paint)


def plot_curves(figure: Any, rows: list[CurveRow], section: Section, paint: Paint) -> Layout:
    """Draw curves along a section into one plot, the last one with its colours below."""
    layout = plot_layout(figure.get_size_inches())
    labels = position_label(section).full, QUANTITIES[paint.label].axis
    colours = Colours(paint.colour_map, paint.limits)
    style = replace(PRINT, size=LETTERS)
    draw_curves(figure.add_axes(layout.axes), rows, labels, style, colours)
    return layout


def folded_last(flat: Polygons, section: Section, paint: Paint) -> Polygons:
    """Return what lies on paper in the order in which it is drawn."""
    if section.whole:
        return flat
    # Nothing is in front of another, but folded cells overlap: show them.
    return flat.take(np.argsort(paint.inverted[flat.cells], kind="stable"))


def laid_flat(
    pieces: Mapping[int, Polygons],
    section: Section,
    style: SectionStyle,
    beside: float | None = None,
) -> tuple[Polygons, tuple[Label, Label] | None]:
    """Return the pieces as they lie on paper, the nearest last, and what the axes are called.

    The mesh itself lies where its middle is nearest to that of another, ``beside``.
    """
    if style.in_space:
        return in_space(list(pieces.values()), section), None
    if not any(piece.points[:, 2].any() for piece in pieces.values()):
        # A 2D mesh, or a plane that lies flat already.
        return joined(list(pieces.values())), (Label("x", "x"), Label("y", "y"))
    shape = section.shape
    own = shape.middle(section, pieces[min(pieces, key=abs)]) if beside is None else beside
    middles: dict[int, float | None] = {}
    found: dict[int, Polygons] = {}
    for numbers in (
        sorted(number for number in pieces if number >= 0),
        sorted((number for number in pieces if number < 0), reverse=True),
    ):
        # Each passage beside the one before, from the mesh itself outwards.
        near = middles[min(found)] if found else own
        for number in numbers:
            found[number] = shape.flatten(section, pieces[number], near, own)
            near = middles[number] = shape.middle(section, pieces[number], near)
    flat = joined([found[number] for number in sorted(found)])
    return flat.by_depth(), shape.flat_labels(section)


def _triad(figure: Any, pieces: Mapping[int, Polygons], section: Section) -> None:
    """Draw the directions of x, y and z in the lower left corner."""
    from slideviz.plots.section_space import camera

    rows = camera(next(iter(pieces.values())), section)
    size = figure.get_size_inches()
    centre = np.array([0.55, 0.5])
    for word, towards in zip("xyz", rows[:2].T, strict=True):
        tip = centre + 0.3 * towards
        figure.add_artist(_line(np.stack([centre, tip]) / size))
        # An axis that points at the eye has no length, but its letter needs room all the same.
        beside = towards / max(float(np.linalg.norm(towards)), 1e-12)
        at = (tip + 0.12 * beside) / size
        figure.text(at[0], at[1], word, fontsize=LETTERS, ha="center", va="center")


def _line(ends: FloatArray) -> Any:
    from matplotlib.lines import Line2D

    return Line2D(ends[:, 0], ends[:, 1], color=PAPER.text, linewidth=1.0)
