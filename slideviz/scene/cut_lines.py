"""The lines and circles that cut a 2D mesh, drawn thin through the cells they cut."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.mesh.model import FloatArray
from slideviz.scene.stage import Stage
from slideviz.sections.line import Box, trace
from slideviz.sections.model import Section

NAME = "line:"
WIDTH = 1.2
"""Pixels."""
ABOVE, BELOW = 0.9, 0.4
"""How far lines are above the cells of the mesh, as parts of `Stage.lift`: above cells that are
shown whole, and below a band in the colours of the cells."""


class CutLines:
    """Draws where sections are, also where they cut no cell: in holes, and beside the mesh.

    Parameters
    ----------
    stage : Stage
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.clear()

    def clear(self) -> None:
        """Forget the mesh."""
        self._actors: dict[str, Any] = {}
        # Kept here: a data set that only VTK holds may come back from a mapper without points.
        self._shapes: dict[str, Any] = {}

    def show(self, sections: Mapping[int, Section], box: Box, lift: float) -> None:
        """Draw these, by their places in the list, across a box; ``lift`` is that of the stage."""
        wanted = {f"{NAME}{index}": section for index, section in sections.items()}
        for name in [name for name in self._actors if name not in wanted]:
            self.stage.remove(name)
            del self._actors[name], self._shapes[name]
        for name, section in wanted.items():
            self._draw(name, trace(section, box), lift * (ABOVE if section.whole else BELOW))

    def _draw(self, name: str, parts: list[FloatArray], lift: float) -> None:
        actor = self._actors.get(name)
        if parts:
            shape = self._shapes[name] = polylines(parts, lift)
            if actor is None:
                actor = self.stage.add(shape, name, lighting=False, pickable=False)
                actor.prop.line_width = WIDTH
                self._actors[name] = actor
            actor.mapper.dataset = shape
        if actor is not None:
            actor.visibility = bool(parts)
            actor.prop.color = self.stage.look.text


def polylines(parts: list[FloatArray], lift: float = 0.0) -> Any:
    """Return lines through points (k, 2) each, as one data set at z = ``lift``."""
    points = np.concatenate(parts)
    sizes = [len(part) for part in parts]
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    shape = pv.PolyData()
    shape.points = np.column_stack([points, np.full(len(points), lift)])
    shape.SetLines(pv.CellArray.from_arrays(offsets, np.arange(len(points))))
    return shape
