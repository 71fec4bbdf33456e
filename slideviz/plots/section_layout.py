"""The layout of a section's picture: flat or in space, the arrangement of two, axes, triad."""

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
"""Size in points of the title's letters, and of all others."""
_LETTER_WIDTH = 0.075
"""Width of a label's letter in inches."""

SIDES, ENDS, BAR = 0.7, 1.0, 0.7
"""Approximate room in inches for numbers and labels beside the axes; for these and titles above and
below the axes; and for the color bar. They decide the arrangement."""
HIGHER = {True: 1.4, False: 2.0}
"""Largest height of a picture of two runs, relative to one of one run: side by side (True), or one
above the other (False)."""
_NARROWEST = 2.2
"""Least width in inches of each of two sections side by side, for their titles."""
_THIN, _MARGIN = 25.0, 0.02
"""Largest ratio of length to height of the box that is shown; margin around all sections, relative
to their length."""

_ASIDE, _ABOVE = 0.55, 0.4
"""Offset of the camera from the straight view, to the side and up, relative to its distance."""


def camera(piece: Polygons, section: Section) -> FloatArray:
    """Return the camera's right and up vectors and the direction towards it, unit rows (3, 3).

    The camera is somewhat aside of the straight view, which is along the plane's normal, or from
    the middle of the piece to the axis.
    """
    side, up, straight = section.shape.aslant(section, piece.points)
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

    Parameters
    ----------
    pieces : mapping of int to Polygons
        The cuts of each passage, by number; 0 is the mesh itself.
    section : Section
    space : bool
        Whether they are shown in space, where the axes have no labels (None).
    beside : float, optional
        Middle angle, in radians, of another run's section: this one is unrolled next to it.
    """
    if space:
        return in_space(list(pieces.values()), section), None
    if not any(piece.points[:, 2].any() for piece in pieces.values()):
        # A 2D mesh, or a plane at z = 0.
        return joined(list(pieces.values())), (Label("x", "x"), Label("y", "y"))
    shape = section.shape
    own = shape.middle_angle(section, pieces[min(pieces, key=abs)]) if beside is None else beside
    middles: dict[int, float | None] = {}
    found: dict[int, Polygons] = {}
    for numbers in (
        sorted(number for number in pieces if number >= 0),
        sorted((number for number in pieces if number < 0), reverse=True),
    ):
        # Each passage is unrolled next to the one before, from the mesh itself outwards.
        near = middles[min(found)] if found else own
        for number in numbers:
            found[number] = shape.flatten(section, pieces[number], near, own)
            near = middles[number] = shape.middle_angle(section, pieces[number], near)
    flat = joined([found[number] for number in sorted(found)])
    return flat.by_depth(), shape.flat_labels(section)


def arranged(size: FloatArray, inches: tuple[float, float], count: int) -> tuple[bool, float]:
    """Return whether sections are side by side, and their scale in inches per mesh unit.

    If they are, the color bar is upright at their right; else they are one above the other, with
    the bar below. Of one section, only the bar's place is chosen. The larger scale is preferred.

    Parameters
    ----------
    size : (2,) float64
        Width and height of a section, in the mesh's length unit.
    inches : (float, float)
        Width and height of the picture.
    count : int
        Number of sections, 1 or 2.
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
    """Return the corners (2,) of a box with a margin, and not thinner than length by `_THIN`."""
    size = high - low
    longest = float(size.max()) or 1.0
    wanted = np.maximum(size + 2 * _MARGIN * longest, longest / _THIN)
    extra = (wanted - size) / 2.0
    return low - extra, high + extra


def number_axes(axes: Any, labels: tuple[Label, Label] | None) -> None:
    """Set labels and numbers of axes already laid out, as many as fit; None hides the axes."""
    from matplotlib.ticker import MaxNLocator

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
        most, least = int(np.clip(inches / step, 1 if fewer else 2, 9)), 2 if inches >= two else 1
        steps = [1, 2, 2.5, 5, 10]
        axis.set_major_locator(MaxNLocator(most, steps=steps, min_n_ticks=least, **fewer))
    axes.label_outer()


def draw_triad(figure: Any, piece: Polygons, section: Section) -> None:
    """Draw the directions of x, y and z as seen by `camera`, in the lower left corner."""
    from matplotlib.lines import Line2D

    size, centre = figure.get_size_inches(), np.array([0.55, 0.5])
    for word, towards in zip("xyz", camera(piece, section)[:2].T, strict=True):
        ends = np.stack([centre, centre + 0.3 * towards]) / size
        figure.add_artist(Line2D(*ends.T, color=PAPER.text, linewidth=1.0))
        # The letter of an axis that points at the camera is still put beside the origin.
        beside = towards / max(float(np.linalg.norm(towards)), 1e-12)
        at = ends[1] + 0.12 * beside / size
        figure.text(*at, word, fontsize=LETTERS, ha="center", va="center")
