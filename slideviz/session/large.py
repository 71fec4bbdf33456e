"""Meshes too large for the memory: their boundary is opened, and their cells are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from slideviz.deformation.memory import NEEDED
from slideviz.deformation.solver import free_memory
from slideviz.mesh.io.su2b.layout import BinaryFile, find_zone
from slideviz.mesh.io.su2b.read import is_su2b
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality
from slideviz.mesh.skin import read_skin
from slideviz.session.results import StepFrame
from slideviz.session.whole import PartQuality, Tally, measure_all, worst_frame
from slideviz.terms import Metric

LARGE_CELLS = 5_000_000
"""A mesh with more cells is opened as its boundary, if its file can be read in parts."""


def is_large(path: Path, zone: int | None) -> bool:
    """Tell whether a mesh is opened as its boundary: a ``.su2b`` of many cells, or little memory.

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
    """Return the boundary of a mesh, with a remark on what of it is in memory.

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
        f"{skin.part.n_cells:,} cells stay in the file: shown are the boundary, sections, and the "
        "worst cells; a run deforms the mesh from file to file"
    )
    return replace(skin, remarks=(*skin.remarks, remark))


def first_frame(skin: Mesh, metric: Metric, tick: Callable[[float], object]) -> StepFrame:
    """Return the undeformed frame of a mesh that is in its file; all of its cells are measured."""
    assert skin.source is not None
    tally = measure_all(skin.source, skin.zone, metric, tick)
    return frame_of(skin, skin, skin.source, tally, metric)


def frame_of(now: Mesh, skin: Mesh, file: Path, tally: Tally, metric: Metric) -> StepFrame:
    """Return the frame of a boundary, ``skin`` undeformed, with its cells in a file."""
    assert skin.source is not None
    extra = worst_frame(skin.source, skin.zone, file, tally.worst, metric)
    found = PartQuality.of(quality(now, skin, metric), tally)
    return StepFrame(now, found, extra=extra, file=file)
