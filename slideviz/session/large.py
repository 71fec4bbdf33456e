"""Meshes too large for memory: only their boundary is read, and their cells measured in blocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from slideviz.formats.su2b.layout import BinaryFile, find_zone
from slideviz.formats.su2b.read import is_su2b
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality
from slideviz.session.results import StepFrame
from slideviz.session.whole import PartQuality, QualityTotals, measure_all, worst_frame
from slideviz.solver.deform import free_memory
from slideviz.streaming.resources import NEEDED
from slideviz.streaming.skin import read_skin
from slideviz.terms import Metric

LARGE_CELLS = 5_000_000
"""Of a mesh with more cells, only the boundary is opened, if its file can be read in parts."""


def is_large(path: Path, zone: int | None) -> bool:
    """Return whether only the boundary of a mesh is to be opened.

    That is for a 3D mesh in a ``.su2b`` file, with many cells or more than free memory allows.

    Raises
    ------
    MeshError
        The file has a mistake.
    OSError
        It cannot be read.
    """
    if path.suffix.lower() != ".su2b" or not is_su2b(path):
        return False
    with path.open("rb") as file:
        place = find_zone(BinaryFile(path, file), zone)
    if place.dim == 2:  # all of its cells are what is drawn
        return False
    cells = place.cells.count
    return cells > LARGE_CELLS or NEEDED["su2b"] * path.stat().st_size > free_memory()


def read_boundary(path: Path, zone: int | None, tick: Callable[[float], object]) -> Mesh:
    """Return the boundary of a mesh, with a remark that its cells stay in the file.

    Raises
    ------
    MeshError
        The file has a mistake.
    OSError
        It cannot be read.
    """
    skin = read_skin(path, zone, tick)
    assert skin.part is not None
    remark = (
        f"{skin.part.n_cells:,} cells stay in the file. The window shows the boundary, sections "
        f"and the worst cells; a run deforms the mesh from file to file"
    )
    return replace(skin, remarks=(*skin.remarks, remark))


def first_frame(skin: Mesh, metric: Metric, tick: Callable[[float], object]) -> StepFrame:
    """Return the undeformed frame of a mesh by its ``skin``, with the quality of all its cells."""
    assert skin.source is not None
    totals = measure_all(skin.source, skin.zone, metric, tick)
    return frame_of(skin, skin, skin.source, totals, metric)


def frame_of(now: Mesh, skin: Mesh, file: Path, totals: QualityTotals, metric: Metric) -> StepFrame:
    """Return the frame of a large mesh: its boundary in memory, its cells in a file.

    Parameters
    ----------
    now, skin : Mesh
        The boundary, deformed and undeformed.
    file : Path
        The deformed mesh.
    totals : QualityTotals
        The qualities of all its cells.
    """
    assert skin.source is not None
    extra = worst_frame(skin.source, skin.zone, file, totals.worst, metric)
    found = PartQuality.of(quality(now, skin, metric), totals)
    return StepFrame(now, found, extra=extra, file=file)
