"""Cuts of the frame that is shown, made once for all views of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from slideviz.mesh.model import Cells, FloatArray, Mesh
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons
from slideviz.sections.threshold import CellsInRange
from slideviz.session.passages import moved
from slideviz.session.results import StepFrame
from slideviz.session.slabs import slab_of

NOTHING = Polygons(np.empty((0, 3)), *(np.zeros(n, np.int64) for n in (1, 0, 0)))
"""No polygons."""
KEPT = 24
"""Cuts of one frame that are remembered: a slider leaves many behind that nobody asks for."""


class Cuts:
    """The cuts of a mesh that is deformed, with a memory of the last ones.

    The 3D view and a flat one show the same section, so that the second need not cut again.
    """

    def __init__(self) -> None:
        self._cells: Cells | None = None
        self._cutter: Cutter | None = None
        self._points: FloatArray | None = None
        self._found: dict[tuple[Section, bytes, CellsInRange | None], Polygons] = {}
        self._slabs: dict[tuple[StepFrame, bool], Polygons] = {}

    def cutter(self, mesh: Mesh) -> Cutter:
        """Return the cutter of a mesh; the steps of a deformation share it."""
        if self._cutter is None or self._cells is not mesh.cells:
            self._cells, self._cutter = mesh.cells, Cutter.of(mesh)
            self._points = None
        return self._cutter

    def of(
        self,
        mesh: Mesh,
        section: Section,
        matrix: FloatArray | None = None,
        only: CellsInRange | None = None,
    ) -> Polygons:
        """Return the cut of a section through a mesh, or its image under a matrix (4, 4).

        ``only`` says which cells are shown at all; left out, every one.
        """
        if mesh.part is not None:
            return self._of_slab(mesh, section, matrix)
        cutter = self.cutter(mesh)
        if self._points is not mesh.points:
            self._points = mesh.points
            self._found.clear()
        one = replace(section, name="", shown=True, flat=False)
        key = one, b"" if matrix is None else matrix.tobytes(), only
        if key not in self._found:
            while len(self._found) >= KEPT:
                self._found.pop(next(iter(self._found)))
            points = mesh.points if matrix is None else moved(mesh.points, matrix)
            self._found[key] = cutter.show(points, section, only)
        return self._found[key]

    def _of_slab(self, mesh: Mesh, section: Section, matrix: FloatArray | None) -> Polygons:
        """Return the cut through a mesh in its file; nothing until its cells were read."""
        slab = slab_of(mesh, section)
        if slab is None or matrix is not None or not len(slab.mesh.cells):
            return NOTHING
        key = slab, section.whole
        if key not in self._slabs:
            while len(self._slabs) >= KEPT:
                self._slabs.pop(next(iter(self._slabs)))
            self._slabs[key] = Cutter.of(slab.mesh).show(slab.mesh.points, section)
        return self._slabs[key]


def cut_frame(frame: StepFrame, section: Section) -> StepFrame:
    """Return the frame that the cells of a section's polygons belong to.

    That is the frame itself, or the cells that were read for the section from the mesh's file.
    """
    slab = slab_of(frame.mesh, section) if frame.mesh.part is not None else None
    return frame if slab is None else slab


def is_awaited(mesh: Mesh, section: Section) -> bool:
    """Tell whether the cells of a section are still to be read from the mesh's file."""
    return mesh.part is not None and slab_of(mesh, section) is None


def can_cut(mesh: Mesh | None, section: Section) -> bool:
    """Tell whether a section can cut a mesh at all (see `Section.can_cut`)."""
    return mesh is not None and section.can_cut(mesh.dim)
