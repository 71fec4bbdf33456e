"""The layout of a section on paper: flat or in space, places of several, numbers along axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.mesh.model import FloatArray
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons, joined
from slideviz.sections.shape import Label

TITLE, LETTERS = 10.0, 9.0
"""Points of the letters of the title, and of all others."""
_LETTER_WIDTH = 0.075
"""Inches that a letter of a label takes."""

SIDES, ENDS, BAR = 0.7, 1.0, 0.7
"""Inches, about, that numbers and labels take beside the axes, these and titles above and below
them, and the colour bar on its side; by them it is decided what stands where."""
HIGHER = {True: 1.4, False: 2.0}
"""The picture of two may be so many times as high as that of one, where they are beside or above
each other."""
_NARROWEST = 2.2
"""Inches that two sections beside each other need for their titles."""
_THIN, _MARGIN = 25.0, 0.02
"""Sections longer than so many times their height get air around them; all get a little, as a part
of their length."""

_ASIDE, _ABOVE = 0.55, 0.4
"""How far the camera is off the straight view, for every length that it is away."""


def camera(piece: Polygons, section: Section) -> FloatArray:
    """Return unit vectors to the right, up, and towards the camera, (3, 3).

    The camera is somewhat to the side of the straight view: the plane's normal, or the
    direction from the axis to the middle of the piece.
    """
    side, up, straight = section.shape.aslant(section, piece.points)
    eye = straight + _ASIDE * side + _ABOVE * up
    eye /= np.linalg.norm(eye)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(eye, right), eye])


def in_space(pieces: Sequence[Polygons], section: Section) -> Polygons:
    """Return the pieces as one, projected: x to the right, y up, z towards the camera."""
    every = joined(pieces)
    seen = every.with_points(every.points @ camera(pieces[0], section).T)
    return seen.by_depth()


def laid_flat(
    pieces: Mapping[int, Polygons], section: Section, space: bool, beside: float | None = None
) -> tuple[Polygons, tuple[Label, Label] | None]:
    """Return the pieces as they lie on paper, the nearest last, and what the axes are called.

    In ``space`` the axes have no names. The mesh itself lies where its middle is nearest to that
    of another, ``beside``.
    """
    if space:
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


def arranged(size: FloatArray, inches: tuple[float, float], count: int) -> tuple[bool, float]:
    """Return whether sections of a size (2,) stand beside each other, and the scale that they have.

    The colour bar of those is at their right; of others, one above the other, it is below. Of one
    section it stands where the section is larger.
    """
    width, height = inches
    high = {upright: height * (HIGHER[upright] if count > 1 else 1.0) for upright in (True, False)}
    rooms = {
        True: ((width - SIDES - BAR) / count, high[True] - ENDS),
        False: (width - SIDES, (high[False] - BAR) / count - ENDS),
    }
    scale = {key: float((np.maximum(room, 0.1) / size).min()) for key, room in rooms.items()}
    fits = count == 1 or rooms[True][0] >= _NARROWEST
    upright = fits and 1.05 * scale[True] >= scale[False]
    return upright, scale[upright]


def aired(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the box with a margin, and not thinner than one part in ``_THIN``."""
    size = high - low
    longest = float(size.max()) or 1.0
    wanted = np.maximum(size + 2 * _MARGIN * longest, longest / _THIN)
    extra = (wanted - size) / 2.0
    return low - extra, high + extra


def number_axes(axes: Any, labels: tuple[Label, Label] | None) -> None:
    """Give axes that are laid out labels and numbers, as there is room for them."""
    from matplotlib.ticker import MaxNLocator

    if labels is None:
        axes.set_axis_off()
        return
    axes.tick_params(labelsize=LETTERS - 1, width=0.6, length=3)
    axes.spines[:].set_linewidth(0.6)
    sizes = axes.bbox.size / axes.figure.dpi
    # One number says nothing of the scale: two, where there is room for them.
    for axis, label, inches, step, two in zip(
        (axes.xaxis, axes.yaxis), labels, sizes, (0.65, 0.4), (1.3, 0.3), strict=True
    ):
        fits = len(label.full) * _LETTER_WIDTH <= inches
        axis.set_label_text(label.full if fits else label.short, fontsize=LETTERS)
        fewer = {"prune": "upper"} if inches < two / 3.0 else {}
        most, least = int(np.clip(inches / step, 1 if fewer else 2, 9)), 2 if inches >= two else 1
        steps = [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(most, steps=steps, min_n_ticks=least, **fewer))
    axes.label_outer()


def draw_triad(figure: Any, piece: Polygons, section: Section) -> None:
    """Draw the directions of x, y and z in the lower left corner."""
    from matplotlib.lines import Line2D

    size, centre = figure.get_size_inches(), np.array([0.55, 0.5])
    for word, towards in zip("xyz", camera(piece, section)[:2].T, strict=True):
        ends = np.stack([centre, centre + 0.3 * towards]) / size
        figure.add_artist(Line2D(*ends.T, color=PAPER.text, linewidth=1.0))
        # An axis that points at the camera has no length, but its letter needs room all the same.
        beside = towards / max(float(np.linalg.norm(towards)), 1e-12)
        at = ends[1] + 0.12 * beside / size
        figure.text(*at, word, fontsize=LETTERS, ha="center", va="center")
