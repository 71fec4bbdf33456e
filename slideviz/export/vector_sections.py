"""Sections of a 2D mesh in pictures of the view as SVG or PDF."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.mesh.model import FloatArray
from slideviz.scene.sections import BAND, NAME, RIM, WIDTHS, shown_sections
from slideviz.sections.cut import Cutter
from slideviz.sections.line import box_around, trace
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons
from slideviz.sections.threshold import Choice
from slideviz.session.state import Session

_LINE = 0.8
"""Pixels of the cutting line, at normal size."""
_ORDER = {RIM: 1.3, BAND: 1.4, NAME: 1.5}
"""Above the cells of the mesh, which are at 1, and below its boundaries, which are at 2."""


def draw_sections(axes: Any, session: Session, style: dict[str, Any], point: float) -> None:
    """Draw the cells on each line and circle of a view, and the line itself.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    session : Session
        Of a 2D mesh.
    style : dict
        Of the cells: ``values`` (m,) with ``cmap`` and ``norm``, or ``facecolors``; and
        ``edgecolors`` and ``linewidths``.
    point : float
        Size of a pixel at normal size, in typographic points.
    """
    assert session.frame is not None
    mesh = session.frame.mesh
    cutter = Cutter.of(mesh)
    box = box_around(mesh.points[cutter.used])
    threshold = session.view.threshold if "values" in style else None
    only = None if threshold is None else Choice.of(style["values"], threshold)
    for _, section in shown_sections(session):
        cut = cutter.show(mesh.points, replace(section, whole=False), only)
        if len(cut):
            _band(axes, cut, style, point)
            if section.whole:
                _whole(axes, cutter.show(mesh.points, section, only), style)
        _line(axes, section, box, point)


def _band(axes: Any, cut: Polygons, style: dict[str, Any], point: float) -> None:
    """Draw what a section cuts as a line in the colours of its cells, and what sets it off."""
    from matplotlib.collections import LineCollection

    ends = list(cut.points[cut.connectivity, :2].reshape(-1, 2, 2))
    below, colours = {"colors": PAPER.text}, _colours(style, cut, "colors")
    for kind, how in ((RIM, below), (BAND, colours)):
        width, order = WIDTHS[kind] * point, _ORDER[kind]
        axes.add_collection(LineCollection(ends, linewidths=width, zorder=order, **how))


def _whole(axes: Any, cells: Polygons, style: dict[str, Any]) -> None:
    from matplotlib.collections import PolyCollection

    rings = np.split(cells.points[cells.connectivity, :2], cells.offsets[1:-1])
    how = {name: style[name] for name in ("edgecolors", "linewidths")}
    how |= _colours(style, cells, "facecolors")
    axes.add_collection(PolyCollection(rings, zorder=_ORDER[NAME], **how))


def _line(axes: Any, section: Section, box: tuple[FloatArray, FloatArray], point: float) -> None:
    from matplotlib.collections import LineCollection

    # Above whole cells, below a band.
    order = _ORDER[NAME] + 0.05 if section.whole else _ORDER[RIM] - 0.05
    lines = LineCollection(
        trace(section, box), colors=PAPER.text, linewidths=_LINE * point, zorder=order
    )
    axes.add_collection(lines, autolim=False)


def _colours(style: dict[str, Any], shown: Polygons, plain: str) -> dict[str, Any]:
    """Return the colours of polygons or lines: those of their cells' values, or a plain one."""
    if "values" not in style:
        return {plain: style["facecolors"]}
    return {"array": style["values"][shown.cells], "cmap": style["cmap"], "norm": style["norm"]}
