"""Pictures of a section, of one run or of two, laid out with matplotlib as PNG, SVG or PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from slideviz.argument_types import frozen, record
from slideviz.color_scheme import PAPER
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.plots.cells import (
    BAR_BELOW,
    BAR_GAP,
    THICKEST,
    bar_below,
    bar_beside,
    color_bar,
    color_scale,
    draw_around,
    draw_cells,
    window,
)
from slideviz.plots.figure_io import empty_figure, fitted, lay_out, trim, write_figure
from slideviz.plots.section_curve import CurveRow, curve_of, draw_curves, labels_of
from slideviz.plots.section_paint import Paint
from slideviz.plots.style import PRINT
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined
from slideviz.sections.shape import Label
from slideviz.terms import WALL_VALUES

TITLE = 10.0  # size of the title's letters in points
LETTERS = 9.0  # of all others
_LETTER_WIDTH = 0.075  # width of a label's letter in inches
SIDES = 0.7
ENDS = 1.0
BAR = 0.7
"""Approximate room in inches for numbers and labels beside the axes; for these and titles above and
below the axes; and for the color bar. They decide the arrangement."""
HIGHER = {True: 1.4, False: 2.0}
"""Largest height of a picture of two runs, relative to one of one run: side by side (True), or one
above the other (False)."""
_NARROWEST = 2.2  # least width in inches of each of two sections side by side, for their titles
_THIN = 25.0
_MARGIN = 0.02
"""Largest ratio of length to height of the box that is shown; margin around all sections, relative
to their length."""

_ASIDE = 0.55
_ABOVE = 0.4
"""Offset of the camera from the straight view, to the side and up, relative to its distance."""


def camera(piece: Polygons, section: Section) -> FloatArray:
    """Return the camera's right and up vectors and the direction towards it, unit rows (3, 3).

    The camera is somewhat aside of the straight view, which is along the plane's normal, or from
    the middle of the piece to the axis.
    """
    side, up, straight = section.aslant(piece.points)
    eye = straight + _ASIDE * side + _ABOVE * up
    eye /= np.linalg.norm(eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def in_space(pieces: Sequence[Polygons], section: Section) -> Polygons:
    """Return all pieces in camera coordinates (x right, y up, z towards it), the nearest last."""
    every = joined(pieces)
    seen = every.with_points(every.points @ camera(pieces[0], section).T)
    return seen.by_depth()


def laid_flat(
    pieces: Mapping[int, Polygons], section: Section, space: bool, beside: float | None = None
) -> tuple[Polygons, tuple[Label, Label] | None]:
    """Return the pieces as drawn on paper, the nearest polygons last, and the axes' labels.

    ``pieces``: the cuts of each passage, by number; 0 is the mesh itself. ``space``: they are shown
    in space, where axes have no labels (None). ``beside``: middle angle, in radians, of another
    run's section, next to which this one is unrolled.
    """
    if space:
        return in_space(list(pieces.values()), section), None
    if not any(piece.points[:, 2].any() for piece in pieces.values()):
        # A 2D mesh, or a plane at z = 0.
        return joined(list(pieces.values())), (Label("x", "x"), Label("y", "y"))
    middle = section.middle_angle(pieces[min(pieces, key=abs)]) if beside is None else beside
    middles: dict[int, float | None] = {}
    laid: dict[int, Polygons] = {}
    for numbers in (
        sorted(number for number in pieces if number >= 0),
        sorted((number for number in pieces if number < 0), reverse=True),
    ):
        # Each passage is unrolled next to the one before, from the mesh itself outwards.
        near = middles[min(laid)] if laid else middle
        for number in numbers:
            laid[number] = section.flatten(pieces[number], near, middle)
            near = middles[number] = section.middle_angle(pieces[number], near)
    flat = joined([laid[number] for number in sorted(laid)])
    return flat.by_depth(), section.flat_labels()


def arrangement(size: FloatArray, inches: tuple[float, float], count: int) -> tuple[bool, float]:
    """Return whether sections are side by side, and their scale in inches per mesh unit.

    If they are, the color bar is upright at their right; else they are one above the other, with
    the bar below. Of one section, only the bar's place is chosen. The larger scale is preferred.
    ``size`` (2,) float64: width and height of a section, in the mesh's length unit. ``inches``
    (float, float): width and height of the picture. ``count``: number of sections, 1 or 2.
    """
    width, height = inches
    high = {upright: height * (HIGHER[upright] if count > 1 else 1.0) for upright in (True, False)}
    areas = {
        True: ((width - SIDES - BAR) / count, high[True] - ENDS),
        False: (width - SIDES, (high[False] - BAR) / count - ENDS),
    }
    scale = {key: float((np.maximum(area, 0.1) / size).min()) for key, area in areas.items()}
    fits = count == 1 or areas[True][0] >= _NARROWEST
    upright = fits and 1.05 * scale[True] >= scale[False]
    return upright, scale[upright]


def with_margin(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners (2,) of a box with a margin, and not thinner than length by `_THIN`."""
    size = high - low
    longest = float(size.max()) or 1.0
    wanted = np.maximum(size + 2 * _MARGIN * longest, longest / _THIN)
    extra = (wanted - size) / 2.0
    return low - extra, high + extra


def number_axes(axes: Any, labels: tuple[Label, Label] | None) -> None:
    """Set labels and numbers of axes already laid out, as many as fit; None hides the axes."""
    if labels is None:
        axes.set_axis_off()
        return
    axes.tick_params(labelsize=LETTERS - 1, width=0.6, length=3)
    axes.spines[:].set_linewidth(0.6)
    sizes = axes.bbox.size / axes.figure.dpi
    # One number does not show the scale: at least two, if they fit.
    for axis, label, inches, step, two in zip(
        (axes.xaxis, axes.yaxis), labels, sizes, (0.65, 0.4), (1.3, 0.3), strict=True
    ):
        fits = len(label.full) * _LETTER_WIDTH <= inches
        axis.set_label_text(label.full if fits else label.short, fontsize=LETTERS)
        fewer = {"prune": "upper"} if inches < two / 3.0 else {}
        most = int(np.clip(inches / step, 1 if fewer else 2, 9))
        least = 2 if inches >= two else 1
        steps = [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(most, steps=steps, min_n_ticks=least, **fewer))
    axes.label_outer()


def draw_triad(figure: Any, piece: Polygons, section: Section) -> None:
    """Draw the directions of x, y and z as seen by `camera`, in the lower left corner."""
    size = figure.get_size_inches()
    centre = np.array([0.55, 0.5])
    for word, towards in zip("xyz", camera(piece, section)[:2].T, strict=True):
        ends = np.stack([centre, centre + 0.3 * towards]) / size
        figure.add_artist(Line2D(*ends.T, color=PAPER.text, linewidth=1.0))
        # The letter of an axis that points at the camera is still put beside the origin.
        beside = towards / max(float(np.linalg.norm(towards)), 1e-12)
        at = ends[1] + 0.12 * beside / size
        figure.text(*at, word, fontsize=LETTERS, ha="center", va="center")


SUFFIXES = (".png", ".svg", ".pdf")

_LONGEST = 36  # most letters of the name that a title begins with


@frozen
class SectionStyle:
    """The size and the parts of a picture of a section."""

    size: tuple[int, int] = (1600, 1000)
    """(int, int): width and height of the picture in pixels; SVG and PDF keep their ratio."""
    trimmed: bool = False
    """Whether the picture is only as high as the section needs, the height of ``size`` at most."""
    edges: bool = True
    """Whether mesh lines are drawn."""
    in_space: bool = False
    """Whether the section is shown in space instead of flat."""
    name: str = ""
    """Name of the mesh, with which the title begins, shortened if it is long."""
    dpi: float | None = None
    """Pixels per inch; by default such that the picture is 5 to 10 inches wide."""
    title: bool = True
    """Whether it has a title: what was cut, where, and its quality."""
    axes: bool = True
    """Whether a flat section has axes with numbers."""

    @classmethod
    def of_cm(cls, width: float, height: float) -> SectionStyle:
        """Return the style of a picture of a width and maximum height in cm, of 300 dpi."""
        return cls((round(width / 2.54 * 300), round(height / 2.54 * 300)), dpi=300.0)

    @property
    def inches(self) -> tuple[float, float]:
        """Return width and height on paper, in inches."""
        return self.size[0] / self.pixels_per_inch, self.size[1] / self.pixels_per_inch

    @property
    def pixels_per_inch(self) -> float:
        """Return ``dpi``, or a resolution by which the picture is 5 to 10 inches wide."""
        return self.dpi or self.size[0] / float(np.clip(self.size[0] / 200.0, 5.0, 10.0))


@record
class SectionInRun:
    """The cut of a section in one run."""

    pieces: Mapping[int, Polygons]
    """The polygons that the section shows of each passage, by number; 0 is the mesh itself (see
    `slideviz.session.passages.show_passages`)."""
    paint: Paint
    """The values of the mesh's cells, to which the pieces' cell indices refer."""
    around: Polygons | None = None
    """The other cells of a 2D mesh (see `slideviz.plots.cells.surroundings`)."""
    name: str = ""
    place: str = ""
    """`name`, `place`: the run and the step in words."""
    note: str = ""
    """A text behind the numbers of the title."""

    @property
    def drawn(self) -> dict[int, Polygons]:
        """Return the pieces of the section that are not empty."""
        return {number: piece for number, piece in self.pieces.items() if len(piece)}

    @property
    def ids(self) -> IntArray:
        """Return the indices of the cut cells: of the mesh itself; if none, of all passages."""
        drawn = self.drawn
        return drawn[0].cell_ids if 0 in drawn else joined(list(drawn.values())).cell_ids

    @property
    def numbers(self) -> str:
        """Return step, minimum and mean of the cut cells in words, with the note."""
        text = self.paint.numbers(self.ids) if self.drawn else "no cell is cut"
        of = self.place or (self.paint.label if self.drawn else "")
        text = f"{of}: {text}" if of else text
        return f"{text}; {self.note}" if self.note else text


def require_picture_name(file: Path) -> None:
    """Raise CaseError unless a file's suffix is one of `SUFFIXES`."""
    if file.suffix.lower() not in SUFFIXES:
        raise CaseError(
            f"{file}: a section is drawn as {', '.join(SUFFIXES)}; end the name with one of these"
        )


def section_picture(
    shown: Sequence[SectionInRun],
    section: Section,
    file: str | Path,
    style: SectionStyle | None = None,
) -> None:
    """Write the picture of a section; of a cut through a 2D mesh, the curve along it.

    Raises CaseError if there is nothing to draw, the name has another suffix, or the file cannot be
    written. ``shown``: one run, or two: the first is left or above, the second right or below.
    ``file``: a name ending with .png, .svg or .pdf.
    """
    target = Path(file)
    require_picture_name(target)
    figure = draw_section(shown, section, style or SectionStyle())
    write_figure(figure, target, figure.dpi if target.suffix.lower() == ".png" else 300.0)


def draw_section(shown: Sequence[SectionInRun], section: Section, style: SectionStyle) -> Any:
    """Return the matplotlib figure of a section of one run, or of two.

    Raises CaseError if there is nothing to draw.
    """
    every = [piece for one in shown for piece in one.drawn.values()]
    if not every:
        raise CaseError(f"{section.describe()}: it cuts no cell, so there is nothing to draw")
    alone = len(shown) == 1
    figure = empty_figure(style.inches, style.pixels_per_inch, "compressed")
    is_curve = all(piece.sizes.max() == 2 for piece in every)
    if style.title:
        in_plane = not any(piece.points[:, 2].any() for piece in every)
        what = section.describe(2 if in_plane else 3)
        words = ", ".join(part for part in (shown[0].name * alone, what) if part)
        named = [f"{one.name}, {one.numbers}" for one in shown] if is_curve else []
        _head(figure, style.name, words, lines=[shown[0].numbers] if alone else named)
    if is_curve:
        _curves(figure, shown, section)
    else:
        _cells(figure, shown, section, style)
    return figure


def _head(figure: Any, name: str, words: str, *, lines: Sequence[str]) -> None:
    """Set the title of a figure; a long name at its begin is shortened."""
    if len(name) > _LONGEST:
        name = f"{name[: _LONGEST // 2]}…{name[-_LONGEST // 2 :]}"
    text = "\n".join([f"{name}: {words}" if name else words, *lines])
    fits, size = fitted(text, figure.get_size_inches()[0] - 0.2, TITLE)
    figure.suptitle(fits, fontsize=size)


def _curves(figure: Any, shown: Sequence[SectionInRun], section: Section) -> None:
    rows: list[CurveRow] = []
    for one in reversed(shown):
        if one.drawn:
            lines = joined(list(one.drawn.values()))
            curve = curve_of(lines, section, one.paint)
            rows.append(CurveRow(one.name if len(shown) > 1 else "", curve, len(rows)))
    paint = shown[0].paint
    style = replace(PRINT, size=LETTERS)
    draw_curves(figure.add_subplot(), rows, labels_of(section, paint), style, paint)


def _cells(
    figure: Any, shown: Sequence[SectionInRun], section: Section, style: SectionStyle
) -> None:
    """Draw the sections' polygons, each run into axes of its own, with one color bar."""
    flats, labels = _laid_beside(shown, section, style)
    labels = labels if style.axes else None
    corners = np.concatenate([flat.points[flat.connectivity, :2] for flat in flats if len(flat)])
    box = corners.min(axis=0), corners.max(axis=0)
    width, height = figure.get_size_inches()
    for one in shown:
        if one.around is not None:
            box = window(box, one.around, (width - SIDES - BAR) / max(height - ENDS, 0.1))
    low, high = with_margin(*box)
    upright, scale = arrangement(high - low, (width, height), len(shown))
    if len(shown) > 1:
        figure.set_size_inches(width, HIGHER[upright] * height)
        lay_out(figure, "constrained" if upright else "compressed")
    grid = (1, len(shown)) if upright else (len(shown), 1)
    every = figure.subplots(*grid, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, one in zip(every, shown, strict=True):
        axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        if len(shown) > 1:
            text = f"{one.name}\n{one.numbers}" if style.title else one.name
            available = (width - SIDES - BAR) / 2.0 if upright else width - SIDES
            words, size = fitted(text, available, LETTERS)
            axes.set_title(words, fontsize=size)
    paint = shown[0].paint
    colors = color_scale(paint.color_map, paint.limits, paint.label in WALL_VALUES)
    folded = [
        one.paint.inverted[piece.cells].any() for one in shown for piece in one.drawn.values()
    ]
    if upright:
        place = bar_beside(every[-1])
    else:  # at least 2 inches long, for its numbers, even if the axes are narrow
        long = max(0.6 * scale * (high - low)[0], min(2.0, width - 1.5))
        place = bar_below(every[-1], long, BAR_BELOW if labels else BAR_GAP)
    of = paint.label, LETTERS - 1.0
    color_bar(place, colors, *of, inverted=any(folded), upright=upright)
    figure.draw_without_rendering()
    for axes in every:
        number_axes(axes, labels)
    if style.trimmed:
        trim(figure, [every] if upright else [[axes] for axes in every])
    figure.draw_without_rendering()
    for axes, one, flat in zip(every, shown, flats, strict=True):
        if one.around is not None:
            draw_around(axes, one.around, section, (low, high))
        if len(flat):
            values = one.paint.shown(flat.cells)
            draw_cells(axes, flat, values, colors, edges=THICKEST * style.edges, lit=style.in_space)
    if style.in_space:
        draw_triad(figure, next(iter(shown[0].drawn.values())), section)


def _laid_beside(
    shown: Sequence[SectionInRun], section: Section, style: SectionStyle
) -> tuple[list[Polygons], tuple[Label, Label] | None]:
    """Return the polygons of each run as laid on paper, in order of drawing, and axes' labels."""
    flats: list[Polygons] = []
    labels = None
    near = None
    for one in shown:
        if not one.drawn:
            flats.append(next(iter(one.pieces.values())))
            continue
        flat, labels = laid_flat(one.drawn, section, style.in_space, near)
        if near is None:
            near = section.middle_angle(one.drawn[min(one.drawn, key=abs)])
        if not section.whole_cells or not flat.points[:, 2].any():
            # All is in one plane, where folded cells overlap others: draw them last.
            flat = flat.with_last(one.paint.inverted[flat.cells])
        flats.append(flat)
    return flats, labels
