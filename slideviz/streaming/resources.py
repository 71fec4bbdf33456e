"""Memory and disk space that a run needs, estimated before it begins."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from slideviz.case.model import Case
from slideviz.errors import MeshError
from slideviz.formats.source import open_source
from slideviz.formats.su2.text import find_texts
from slideviz.formats.su2b.layout import ZonePlace
from slideviz.formats.table import format_of
from slideviz.solver.deform import free_memory
from slideviz.system.atomic import reason_of
from slideviz.terms import FileFormat

NEEDED: dict[FileFormat, float] = {"su2b": 5.0, "su2": 4.0}
"""Memory of a run that is not streamed, over the size of the mesh file, with some reserve: measured
4.2 and 3.1 on hexahedra."""


def missing_memory(case: Case) -> str:
    """Return the sentence that the mesh of a case needs more memory than is free; "" if it fits.

    Also "" where streaming would not help: it can stream neither this format, nor a mesh with
    a halo, nor linear elasticity. Raises MeshError if the mesh cannot be read.
    """
    path = case.mesh_file
    if path is None or case.method == "elastic":
        return ""
    kind = format_of(path, case.mesh_format).value
    if kind is None:
        return ""
    message = missing_memory_of(path, kind)
    if message and kind == "su2":
        texts = find_texts(open_source(path), case.zone)
        return "" if any(text.zone.sends for text in texts) else message
    return message


def missing_memory_of(path: Path, kind: FileFormat) -> str:
    """Return the sentence that an SU2 mesh needs more memory than is free; "" if it fits."""
    needed = NEEDED[kind] * path.stat().st_size
    free = free_memory()
    if needed <= free:
        return ""
    return f"{path.name} needs about {needed / 1e9:.0f} GB of memory, {free / 1e9:.0f} GB are free"


CELL_BYTES = 18
"""Bytes of disk for each cell during a run: quality and status, before and after, twice 8 + 1."""


def require_disk_space(place: Path, path: Path, size: int) -> None:
    """Raise where the disk of the file ``place`` has no room for ``size`` more bytes.

    Raises MeshError if it has not, or the folder of ``place`` does not exist; the message names
    ``path``.
    """
    folder = Path(os.path.realpath(place)).parent
    try:
        free = shutil.disk_usage(folder).free
    except OSError as problem:
        raise MeshError(f"{path}: cannot be written: {reason_of(problem)}") from problem
    if size > free:
        raise MeshError(
            f"{path}: {size / 1e6:,.0f} MB of disk are needed in {folder} while this lasts, but "
            f"{free / 1e6:,.0f} MB are free; free some space or choose another disk"
        )


def text_size(places: Sequence[ZonePlace]) -> int:
    """Return about how many bytes zones of a binary mesh have as a text."""
    return sum(8 * (one.cells.length + (2 * one.dim + 1) * one.n_points) for one in places)


def bytes_of_run(
    places: Sequence[ZonePlace], width: int, size: int, copy: int, *, is_text: bool, later: int
) -> int:
    """Return the most bytes on the disk at a time in a run.

    ``places`` and ``width``: of the zones in the binary file, and of its indices.
    ``size`` and ``copy``: bytes of the output, and of the binary copy of a text.
    ``is_text``: whether the output is a text. ``later``: bytes for each cell that the caller writes
    afterwards.
    """
    points = sum(is_text * one.n_points * (8 * one.dim + width) for one in places)
    cells = sum(one.cells.count for one in places)
    return size + CELL_BYTES * cells + max(copy + points, later * cells)
