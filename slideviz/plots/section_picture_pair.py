"""The picture of one section of two runs, or of a run and the undeformed mesh: one colour bar."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slideviz.errors import CaseError
from slideviz.plots.around import draw_around, window
from slideviz.plots.section_curve import CurveRow, curve_of
from slideviz.plots.section_dress import add_bar, dress_axes
from slideviz.plots.section_layout_pair import PairLayout, lay_out_pair
from slideviz.plots.section_paint import Paint
from slideviz.plots.section_picture import (
    SectionStyle,
    empty_figure,
    folded_last,
    ids_of,
    laid_flat,
    plot_curves,
    require_picture_name,
    write_figure,
)
from slideviz.plots.section_polygons import shapes_of
from slideviz.plots.section_title import TITLE, write_line, write_title
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined

_RATIO = 1.6
"""Of width to height of what a 2D mesh is shown around whole cells."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What a section shows of one run.

    Attributes
    ----------
    pieces, paint, around
        As of `slideviz.plots.section_picture.section_picture`.
    name, place : str
        Which run it is, and which step of it.
    note : str
        Stands behind the numbers of the title.
    """

    pieces: Mapping[int, Polygons]
    paint: Paint
    around: Polygons | None
    name: str
    place: str = ""
    note: str = ""

    @property
    def drawn(self) -> dict[int, Polygons]:
        """Return the pieces in which something is cut."""
        return {number: piece for number, piece in self.pieces.items() if len(piece)}

    @property
    def numbers(self) -> str:
        """Return step, minimum and mean in words."""
        found = self.paint.sentence(ids_of(self.drawn)) if self.drawn else "no cell is cut"
        label = f"{self.paint.label}: "
        found = found if not self.place else f"{self.place}: {found.removeprefix(label)}"
        return "; ".join(part for part in (found, self.note) if part)


def pair_picture(
    both: tuple[Shown, Shown], section: Section, file: Path, style: SectionStyle
) -> None:
    """Write the picture of a section of two runs; of a cut through a 2D mesh, both curves.

    Parameters
    ----------
    both : (Shown, Shown)
        What is left or above, and what is right or below.
    section : Section
    file : Path
        Ends with .png, .svg or .pdf.
    style : SectionStyle

    Raises
    ------
    CaseError
        There is nothing to draw, the name has another end, or the file cannot be written.
    """
    require_picture_name(file)
    figure, dpi = draw_pair(both, section, style)
    write_figure(figure, dpi, file)


def draw_pair(
    both: tuple[Shown, Shown], section: Section, style: SectionStyle
) -> tuple[Any, float]:
    """Return the matplotlib figure of a section of two runs, and its pixels per inch.

    Raises
    ------
    CaseError
        There is nothing to draw.
    """
    if not any(one.drawn for one in both):
        raise CaseError(f"{section.describe()}: it cuts no cell, so there is nothing to draw")
    figure, dpi = empty_figure(style)
    every = [piece for one in both for piece in one.drawn.values()]
    in_plane = not any(piece.points[:, 2].any() for piece in every)
    head = style.name, section.describe(2 if in_plane else 3)
    if all(piece.sizes.max() == 2 for piece in every):
        _curves(figure, both, section, head)
    else:
        layout = _cells(figure, both, section, style)
        across = (0.0, 1.0) if layout.beside else _across(layout, 0)
        write_line(figure, head, 1.0 - 0.24 / layout.height, TITLE, across)
    return figure, dpi


def _cells(
    figure: Any, both: tuple[Shown, Shown], section: Section, style: SectionStyle
) -> PairLayout:
    """Draw polygons, with a colour bar for both."""
    flats: list[Polygons | None] = []
    labels, near = None, None
    for one in both:
        if not one.drawn:
            flats.append(None)
            continue
        flat, labels = laid_flat(one.drawn, section, style, near)
        if near is None:
            near = section.shape.middle(section, one.drawn[min(one.drawn, key=abs)])
        flats.append(folded_last(flat, section, one.paint))
    there = [flat for flat in flats if flat is not None]
    corners = np.concatenate([flat.points[flat.connectivity, :2] for flat in there])
    box = corners.min(axis=0), corners.max(axis=0)
    for one in both:
        box = window(box, one.around, _RATIO) if one.around is not None else box
    found = lay_out_pair(box, figure.get_size_inches())
    figure.set_size_inches(figure.get_size_inches()[0], found.height)
    for index, (one, layout) in enumerate(zip(both, found.panes, strict=True)):
        lying = flats[index]
        axes = figure.add_axes(layout.axes)
        if one.around is not None:
            draw_around(axes, one.around, section, (layout.low, layout.high))
        if lying is not None:
            scale = layout.points_per_length
            axes.add_collection(shapes_of(lying, one.paint, scale, style.edges, lit=False))
        dress_axes(axes, layout, labels)
        # The axes are the same: between both they need no numbers.
        between = axes.yaxis if found.beside else axes.xaxis
        if index == (1 if found.beside else 0):
            between.set_tick_params(labelleft=False, labelbottom=False)
            between.label.set_visible(False)
        write_title(figure, layout, ("", one.name), one.numbers, _across(found, index))
    inverted = any(
        one.paint.inverted[piece.cells].any() for one in both for piece in one.drawn.values()
    )
    add_bar(figure, found.bar, both[0].paint, inverted)
    return found


def _across(layout: PairLayout, index: int) -> tuple[float, float]:
    """Return from where to where in the width the title of one may reach, about its middle."""
    middles = [left + wide / 2.0 for left, _, wide, _ in (pane.axes for pane in layout.panes)]
    middle = middles[index]
    half = min(middle, 1.0 - middle)
    if layout.beside:
        half = min(half, (middles[1] - middles[0]) / 2.0)
    return middle - half, middle + half


def _curves(
    figure: Any, both: tuple[Shown, Shown], section: Section, head: tuple[str, str]
) -> None:
    """Draw the numbers along a line or circle of both into one plot."""
    rows = []
    for one in reversed(both):  # the last one has its colours below
        if one.drawn:
            lines = joined(list(one.drawn.values()))
            curve = curve_of(lines, section, one.paint.values, one.paint.inverted)
            rows.append(CurveRow(one.name, curve))
    layout = plot_curves(figure, rows, section, both[0].paint)
    numbers = " · ".join(f"{one.name}, {one.numbers}" for one in both)
    write_title(figure, layout, head, numbers)
