"""Cuts of the frame that is shown, made once for all views of them."""

from __future__ import annotations

from dataclasses import replace

from slideviz.mesh.model import Cells, FloatArray, Mesh
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.polygons import Polygons
from slideviz.sections.threshold import CellsInRange
from slideviz.session.passages import moved

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


def can_cut(mesh: Mesh | None, section: Section) -> bool:
    """Tell whether a section can cut a mesh at all (see `Section.can_cut`)."""
    return mesh is not None and section.can_cut(mesh.dim)
