"""Titles of pictures and films: run, step and quality; and the label of the marked cell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Polygon

from slideviz.color_scheme import PAPER, SELECTED_COLOR
from slideviz.errors import printable
from slideviz.mesh.model import FloatArray
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.mesh.surfaces import padded
from slideviz.session.inspect import nodes_of
from slideviz.session.runs_words import (
    differences_from,
    differences_from_all,
    method_words,
    run_words,
)
from slideviz.session.state import Session, StepFrame
from slideviz.terms import WALL_VALUES, ColorBy

if TYPE_CHECKING:
    from slideviz.scene.scene import Scene


LETTER_WIDTH = 9.6  # width of a title's letter in pixels, at normal size
DETAIL = " (whole mesh; detail shown)"
"""Text behind the quality of a mesh of which a detail is shown."""
_SMALLEST = 0.6  # smallest size of the letters of titles, relative to the usual one
LONGEST = "step {0}.00 of {0}, interpolated"
"""The longest text of a place in a film, by which the form of its titles is chosen once."""


def caption(name: str, quality: Quality, color_by: ColorBy = "size-skew") -> str:
    """Return a line with a name and the size-skew quality: min, mean, inverted cells."""
    what = "" if color_by == "size-skew" else "size-skew "
    text = f"{printable(name)}: {what}min {quality.min:.4f}, mean {quality.mean:.4f}"
    if quality.inverted:
        text += f", {quality.inverted} of {quality.cells} cells inverted"
    return text


def place_words(position: float, steps: int) -> str:
    """Return the position in a run in words: a step, or between two; empty for an only step."""
    if position == 0:
        return "undeformed"
    is_step = position == int(position)
    if is_step:
        return f"step {position:.0f} of {steps}" if steps > 1 else ""
    return f"step {position:.2f} of {steps}, interpolated"


def names_of(session: Session) -> list[str]:
    """Return names of the shown run, each shorter than the one before.

    They are its number with its name (or method) and what distinguishes it from other runs, if
    anything; the number with the name; the number only.
    """
    run = session.run_shown
    if run is None:
        return ["Deformed"]
    number = f"Run {run.number}"
    words = run_words(run)
    others = differences_from_all(run, session.runs)
    full = [f"{number}, {words}, {others}"] if others else []
    return [*full, f"{number}, {words}", number]


def title_words(
    session: Session, frame: StepFrame, place: str, letters: float, longest: str
) -> str:
    """Return the longest title of a frame that fits into a number of letters.

    ``place``: its position in the run (`place_words`). ``longest``: the longest place of a film, so
    that all its titles have the same form.
    """
    what = session.view.color_by

    def titled(name: str, place: str) -> str:
        return caption(f"{name}, {place}" if place else name, frame.quality, what)

    if place == "undeformed":
        full, *shorter = ("Undeformed",)
    else:
        full, *shorter = names_of(session)
    shown = "" if place == "undeformed" else place
    for name in (full, *shorter[:-1]):
        if max(len(titled(name, longest)), len(titled(name, shown))) <= letters:
            return titled(name, shown)
    least = f": min {frame.quality.min:.3f}"
    for name in (full, *shorter):
        for where in (f", {shown}" if shown else "", ""):
            text = f"{name}{where}{least}"
            if len(text) <= letters:
                return text
    return text


def pair_names(pair: Sequence[Session]) -> list[str]:
    """Return the names of the runs of two views, in the same form, with all differences."""
    runs = [one.run_shown for one in pair]
    # In a comparison with the undeformed mesh, both sessions have the same run.
    alone = runs[0] is runs[-1]
    both = [run for run in runs if run is not None]
    methods_differ = len({method_words(run.case) for run in both}) > 1
    names = []
    for one, run in zip(pair, runs, strict=True):
        if run is None or (alone and one.view.frame == 0):
            names.append("Undeformed")
            continue
        words = [f"Run {run.number}", run_words(run)]
        words += [method_words(run.case)] if run.name and methods_differ else []
        names.append(
            ", ".join(filter(None, [*words, "" if alone else differences_from(run, both)]))
        )
    return names


def pair_titles(pair: Sequence[Session], quality: bool) -> list[str]:
    """Return the titles of two pictures side by side, in the same form.

    ``pair`` (Session, Session): the sessions that they show. ``quality``: whether there is a second
    line: step, minimum, mean and inverted cells.
    """
    names = pair_names(pair)
    if not quality:
        return names
    several = any(one.planned > 1 for one in pair)
    titles = []
    for one, name in zip(pair, names, strict=True):
        frame = one.frame
        assert frame is not None
        at = min(one.view.frame, len(one.frames) - 1)
        place = ""
        if at and several:
            place = f"step {at} of {one.planned}"
        elif not at and name != "Undeformed":
            place = "undeformed"
        numbers = caption(place, frame.quality, one.view.color_by).removeprefix(": ")
        titles.append(f"{name}\n{numbers}")
    return titles


def fitting(titles: Sequence[str], letters: float) -> tuple[list[str], float]:
    """Return titles fitted to a number of letters per line, and the relative size of the letters.

    The size is at most 1 and the same for all: the longest line fits. It is not below `_SMALLEST`;
    lines too long even then are cut with an ellipsis.
    """
    longest = max(len(line) for title in titles for line in title.splitlines())
    part = min(1.0, max(letters / longest, _SMALLEST))
    most = int(letters / part)
    return ["\n".join(_cut(line, most) for line in title.splitlines()) for title in titles], part


def _cut(line: str, most: int) -> str:
    return line if len(line) <= most else line[: max(most - 1, 1)].rstrip(" ,") + "…"


CELL_LABEL = "mark:words"  # name of the actor of the marked cell's label
_AWAY = 9.0  # distance in pixels between the cell and its label, at normal letter size


def mark_words(session: Session) -> str:
    """Return the label of the marked cell: its number and value; empty if none is marked."""
    cell = session.view.marked_cell
    frame = session.frame
    if cell is None or frame is None or not 0 <= cell < len(frame.mesh.cells):
        return ""
    words = f"cell {frame.mesh.cell_number(cell):,}"
    if frame.quality.status[cell] == INVERTED:
        return f"{words}: inverted"
    if session.view.color_by == "role" or session.mesh is None:
        return words
    value = float(frame.values(session.view.color_by, session.reference)[cell])
    if session.view.color_by in WALL_VALUES and np.isnan(value):
        return f"{words}: at no wall"
    number = ".4g" if session.view.color_by in ("displacement", "run-distance") else ".4f"
    return f"{words}: {value:{number}}"


def label_marked_cell(plotter: Any, scene: Scene, scale: float) -> None:
    """Draw the label beside the marked cell of a scene; none if the cell is out of the picture.

    ``scale`` is the factor of lengths and letters.
    """
    # Late: VTK takes 0.6 s.
    from vtkmodules.vtkRenderingCore import vtkCoordinate

    from slideviz.export.offscreen import text_on_plate

    plotter.remove_actor(CELL_LABEL, reset_camera=False, render=False)
    words = mark_words(scene.session)
    if not words:
        return
    corners = padded(_corners(scene.session))
    place = vtkCoordinate()
    spots = []
    place.SetCoordinateSystemToWorld()
    for corner in (*corners, corners.mean(axis=0)):
        place.SetValue(*corner)
        spots.append(place.GetComputedDoubleViewportValue(plotter.renderer))
    *around, middle = np.array(spots)
    seen = middle / plotter.window_size
    if not ((seen >= 0.0) & (seen <= 1.0)).all():
        return
    text = text_on_plate(words, scene.scheme, 13.0 * scale)
    # On the side towards the picture's middle, where there is room.
    side = 1.0 if seen[0] < 0.6 else -1.0
    if side < 0.0:
        text.prop.SetJustificationToRight()
    at = text.GetPositionCoordinate()
    at.SetReferenceCoordinate(place)
    at.SetCoordinateSystemToViewport()
    # Beside the outline, unless it fills the picture.
    reach = max(side * (spot - middle)[0] for spot in around)
    reach = min(reach, 0.2 * plotter.window_size[0])
    at.SetValue(side * (reach + _AWAY * scale), 0.0)
    plotter.add_actor(text, name=CELL_LABEL, reset_camera=False, render=False, pickable=False)


def draw_marked_cell(axes: Any, session: Session, pixel_pt: float) -> None:
    """Draw the marked cell of a 2D mesh and its label; a pixel is ``pixel_pt`` points wide."""
    words = mark_words(session)
    if not words:
        return
    corners = _corners(session)
    outline = Polygon(corners, fill=False, edgecolor=SELECTED_COLOR, linewidth=2.0 * pixel_pt)
    outline.set(zorder=4, gid="mark")
    axes.add_patch(outline)
    middle = corners.mean(axis=0)
    right = axes.transLimits.transform(middle)[0] < 0.6
    axes.annotate(
        words,
        middle,
        xytext=(_AWAY * pixel_pt if right else -_AWAY * pixel_pt, 0.0),
        textcoords="offset points",
        ha="left" if right else "right",
        va="center",
        fontsize=13.0 * pixel_pt,
        color=PAPER.text,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
        annotation_clip=True,
        zorder=5,
    )


def _corners(session: Session) -> FloatArray:
    """Return the points (k, d) of the marked cell's nodes."""
    assert session.view.marked_cell is not None
    mesh = session.shown_frame.mesh
    return mesh.points[nodes_of(mesh, session.view.marked_cell)]
