"""Meshes too large for memory: only their boundary is read, and their cells measured in blocks."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from slideviz.formats.su2b.layout import open_zones
from slideviz.formats.su2b.read import is_su2b
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import QualityTotals, quality
from slideviz.session.inspect import WORST
from slideviz.session.state import StepFrame
from slideviz.streaming.block_quality import measure_mesh
from slideviz.streaming.skin import read_skin
from slideviz.streaming.source import CellBlock, FileSource
from slideviz.streaming.stream_input import NEEDED
from slideviz.system.platform import free_memory
from slideviz.terms import SkewMetric

LARGE_CELLS = 5_000_000
"""Of a mesh with more cells, only the boundary is opened, if its file can be read in parts."""


def is_large(path: Path, zone: int | None) -> bool:
    """Return whether only the boundary of a mesh is to be opened.

    That is for a 3D mesh in a ``.su2b`` file, with many cells or more than free memory allows.
    Raises MeshError if the file has a mistake, and OSError if it cannot be read.
    """
    if path.suffix.lower() != ".su2b" or not is_su2b(path):
        return False
    with open_zones(path, zone) as (_, places):
        cells = sum(place.cells.count for place in places)
    if places[0].dim == 2:  # all of its cells are what is drawn
        return False
    return cells > LARGE_CELLS or NEEDED["su2b"] * path.stat().st_size > free_memory()


def read_boundary(path: Path, zone: int | None, tick: Callable[[float], object]) -> Mesh:
    """Return the boundary of a mesh, with a remark that its cells stay in the file.

    Raises MeshError if the file has a mistake, and OSError if it cannot be read.
    """
    skin = read_skin(path, zone, tick)
    remark = (
        f"{skin.file_counts[1]:,} cells stay in the file. The window shows the boundary, "
        "sections and the worst cells; a run deforms the mesh from file to file"
    )
    return replace(skin, remarks=(*skin.remarks, remark))


def first_frame(skin: Mesh, metric: SkewMetric, tick: Callable[[float], object]) -> StepFrame:
    """Return the undeformed frame of a mesh by its ``skin``, with the quality of all its cells.

    Raises MeshError if the file has a mistake, or there is no disk space for 9 bytes for each cell,
    and OSError if it cannot be read.
    """
    assert skin.source is not None
    folder = Path(tempfile.gettempdir())
    with ExitStack() as stack:
        source = FileSource.open(stack, (skin.source, skin.zone))
        measured = measure_mesh(
            stack, folder, source, metric=metric, worst=WORST, may_fold=True, tick=tick
        )
    return frame_of(skin, skin, skin.source, measured.totals, metric)


def frame_of(
    now: Mesh, skin: Mesh, file: Path, totals: QualityTotals, metric: SkewMetric
) -> StepFrame:
    """Return the frame of a large mesh: its boundary in memory, its cells in a file.

    ``now`` and ``skin``: the boundary, deformed and undeformed. ``file``: the deformed mesh.
    ``totals``: the qualities of all its cells.
    """
    assert skin.source is not None
    with ExitStack() as stack:
        source = FileSource.open(stack, (skin.source, skin.zone), moved=file)
        worst = source.cells(totals.worst)
    measured = replace(quality(now, skin, metric), of_mesh=totals)
    return StepFrame(now, measured, extra=block_frame(worst, skin, metric), file=file)


def block_frame(block: CellBlock, skin: Mesh, metric: SkewMetric) -> StepFrame:
    """Return some cells of a mesh as a frame, with their quality; ``skin`` is the mesh's."""
    block = block.part_of(skin)
    return StepFrame(block.mesh, quality(block.mesh, block.base, metric), base=block.base)
