"""Whether the disk has room for what a mesh larger than memory is made of, before the work."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from slideviz.errors import MeshError
from slideviz.mesh.io.atomic import reason_of
from slideviz.mesh.io.binary_copy import Plan
from slideviz.mesh.io.su2b.layout import BinaryFile, ZonePlace, find_zone
from slideviz.mesh.io.su2b.partial import names_of

RATED = 18
"""Bytes of disk for each cell while a run lasts."""


def require_room(place: Path, path: Path, size: int) -> None:
    """Raise where the disk has no room for so many bytes.

    Raises
    ------
    MeshError
        It has not, or there is no such folder; it is said of ``path``.
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


def text_size(place: ZonePlace) -> int:
    """Return about how many bytes a zone of a binary mesh has as a text."""
    return 8 * (place.cells.length + (2 * place.dim + 1) * place.n_points)


def bytes_of_text(plan: Plan, is_text: bool, later: int) -> int:
    """Return how many bytes the run of a text mesh needs on the disk, at most at a time."""
    result = plan.text.lines.raw.size if is_text else plan.size
    points = plan.markers - plan.points if is_text else 0
    cells = plan.text.n_cells
    return result + RATED * cells + max(plan.size + points, later * cells)


def bytes_of_binary(path: Path, zone: int | None, *, is_text: bool, later: int) -> int:
    """Return how many bytes the run of a binary mesh needs on the disk, at most at a time."""
    with path.open("rb") as file:
        source = BinaryFile(path, file)
        place = find_zone(source, zone)
    result = text_size(place) if is_text else source.size
    points = place.n_points * source.point(place.dim).itemsize if is_text else 0
    cells = place.cells.count
    return result + RATED * cells + max(points, later * cells)


def bytes_left(output: Path) -> int:
    """Return how many bytes a stopped run has left on the disk, which this one replaces."""
    files = (names_of(output, more)[0] for more in ("", ".binary"))
    return sum(file.stat().st_blocks * 512 for file in files if file.exists())
