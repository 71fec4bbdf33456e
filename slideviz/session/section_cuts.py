"""The cuts of sections through the frame that is shown: made once, and shared by all views."""

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
"""Most cuts that are cached: dragging a section makes many that are not needed again."""


class Cuts:
    """Cuts sections through a mesh, and caches the last cuts.

    So the flat view of a section need not cut again what the 3D view has cut.
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
        """Return the cut of a section through a mesh, which ``matrix`` (4, 4) moves before.

        ``only`` are the cells that are shown at all; None: all of them. Empty for a mesh in its
        file until the cells of the section were read.
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
        """Return the cut through a mesh in its file; empty until its cells were read."""
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
    """Return the frame in which a section's polygons have their cells.

    That is ``frame`` or, for a mesh in its file, the slab of cells that was read for the section.
    """
    slab = slab_of(frame.mesh, section) if frame.mesh.part is not None else None
    return frame if slab is None else slab


def is_awaited(mesh: Mesh, section: Section) -> bool:
    """Return whether the cells of a section are still to be read from the mesh's file."""
    return mesh.part is not None and slab_of(mesh, section) is None


def can_cut(mesh: Mesh | None, section: Section) -> bool:
    """Return whether a section can cut a mesh at all (see `Section.can_cut`)."""
    return mesh is not None and section.can_cut(mesh.dim)
