"""The words beside a marked cell in pictures and films: which cell it is, and its value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.color_scheme import PAPER, SELECTED_COLOUR
from slideviz.mesh.model import FloatArray
from slideviz.mesh.quality import INVERTED
from slideviz.mesh.surfaces import padded
from slideviz.scene.color_legend import set_letters
from slideviz.session.inspect import nodes_of
from slideviz.session.state import Session

if TYPE_CHECKING:
    from slideviz.scene.scene import Scene

NAME = "mark:words"
_AWAY = 9.0
"""Pixels between the cell and its words, at normal size."""


def mark_words(session: Session) -> str:
    """Return the number of the marked cell, and its value in what is shown; nothing if none is."""
    cell, frame = session.view.marked, session.frame
    if cell is None or frame is None or not 0 <= cell < len(frame.mesh.cells):
        return ""
    words = f"cell {cell:,}"
    if frame.quality.status[cell] == INVERTED:
        return f"{words}: inverted"
    if session.view.colour_by == "role" or session.mesh is None:
        return words
    value = float(frame.values(session.view.colour_by, session.mesh)[cell])
    number = ".4g" if session.view.colour_by == "displacement" else ".4f"
    return f"{words}: {value:{number}}"


def name_mark(plotter: Any, scene: Scene, scale: float) -> None:
    """Write the words beside the marked cell of a scene as its camera sees it, in place of others.

    Not where the cell is out of the picture.
    """
    import pyvista as pv
    from vtkmodules.vtkRenderingCore import vtkCoordinate

    plotter.remove_actor(NAME, reset_camera=False, render=False)
    words = mark_words(scene.session)
    if not words:
        return
    corners = padded(_corners(scene.session))
    place, spots = vtkCoordinate(), []
    place.SetCoordinateSystemToWorld()
    for corner in (*corners, corners.mean(axis=0)):
        place.SetValue(*corner)
        spots.append(place.GetComputedDoubleViewportValue(plotter.renderer))
    *around, middle = np.array(spots)
    seen = middle / plotter.window_size
    if not ((seen >= 0.0) & (seen <= 1.0)).all():
        return
    text = pv.Text(words)
    set_letters(text.prop, scene.look, 13.0 * scale)
    text.prop.SetBackgroundColor(*pv.Color(scene.look.background_top).float_rgb)
    text.prop.SetBackgroundOpacity(0.7)
    text.prop.SetVerticalJustificationToCentered()
    # Towards the middle, where there is room for it.
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
    plotter.add_actor(text, name=NAME, reset_camera=False, render=False, pickable=False)


def draw_mark(axes: Any, session: Session, point: float) -> None:
    """Draw the marked cell of a 2D mesh and its words; ``point`` as for the cells of a figure."""
    from matplotlib.patches import Polygon

    words = mark_words(session)
    if not words:
        return
    corners = _corners(session)
    outline = Polygon(corners, fill=False, edgecolor=SELECTED_COLOUR, linewidth=2.0 * point)
    outline.set(zorder=4, gid="mark")
    axes.add_patch(outline)
    middle = corners.mean(axis=0)
    right = axes.transLimits.transform(middle)[0] < 0.6
    axes.annotate(
        words,
        middle,
        xytext=(_AWAY * point if right else -_AWAY * point, 0.0),
        textcoords="offset points",
        ha="left" if right else "right",
        va="center",
        fontsize=13.0 * point,
        color=PAPER.text,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
        annotation_clip=True,
        zorder=5,
    )


def _corners(session: Session) -> FloatArray:
    """Return the nodes of the marked cell, (k, d)."""
    assert session.frame is not None
    assert session.view.marked is not None
    mesh = session.frame.mesh
    return np.asarray(mesh.points[nodes_of(mesh, session.view.marked)])
