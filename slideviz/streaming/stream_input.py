"""The mesh file that a streamed run reads: the SU2 binary file itself, or a binary copy of a text.

The copy is made first, and removed after the run.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.errors import MeshError, printable
from slideviz.formats.binary_copy import binary_layouts, write_layouts
from slideviz.formats.losses import OTHER_ZONES, lost_of_texts, sentence_of_lost
from slideviz.formats.openfoam_paths import stem_of
from slideviz.formats.source import open_source
from slideviz.formats.su2.text import Text, find_texts
from slideviz.formats.su2.write import PointChange, patched_blocks, require_text_names
from slideviz.formats.su2b.layout import ZonePlace, open_zones
from slideviz.formats.su2b.write import require_binary_names
from slideviz.formats.table import format_of
from slideviz.mesh.model import Mesh
from slideviz.streaming.skin import naming_text, read_skin
from slideviz.streaming.source import ZoneSource
from slideviz.system.atomic import reason_of
from slideviz.system.cleanup import draft, open_temporary
from slideviz.system.platform import free_memory
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, progress_share
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


SCANNED = 0.15
COPIED = 0.8
"""Parts of the time for reading a text after which its lines are found, and its copy is made."""


@record
class StreamInput:
    """A mesh to be streamed, in an SU2 binary file."""

    path: Path  # the binary file: the user's, or a copy of a text
    zone: int | None  # the zone in it, from 1; all where it is None
    texts: tuple[Text, ...] = ()  # the zones of the text that ``path`` is a copy of

    def skin(self, tick: Tick, ranks: SerialPool = SERIAL) -> Mesh:
        """Return the boundary and the cells at it, reading and checking the mesh; or MeshError."""
        share = progress_share(tick, COPIED) if self.texts else tick
        return read_skin(self.path, self.zone, share, ranks, self.texts)


def require_su2(path: Path, file_format: FileFormat | None) -> FileFormat:
    """Return the format of a mesh file; MeshError if it is neither SU2 text nor binary."""
    kind = format_of(path, file_format).value
    if kind is None:
        raise MeshError(
            f"{path}: only SU2 meshes, text or binary, can be streamed; make one with `slideviz "
            f"convert {path} {stem_of(path)}.su2b`, or leave out --stream"
        )
    return kind


def _streamable(path: Path, zone: int | None, tick: Tick) -> tuple[Text, ...]:
    """Return the places of points, cells and markers of the zones of an SU2 text.

    Raises MeshError if it has a mistake, or a halo: nodes that follow others are not all on the
    boundary.
    """
    texts = find_texts(open_source(path), zone, progress_share(tick, 0.0, SCANNED))
    for text in texts:
        if text.zone.sends:
            raise text.lines.error(
                text.zone.sends[0].begin,
                "a mesh with SEND_RECEIVE markers (a halo) cannot be streamed; make it without its "
                "halo, or run it without --stream",
            )
    return texts


@contextmanager
def open_read_only(
    path: Path, zone: int | None, tick: Tick, folder: Path, file_format: FileFormat | None = None
) -> Iterator[StreamInput]:
    """Context with a mesh that is only read; the binary copy of a text is in ``folder``.

    The copy is removed at the end. Raises MeshError if it is of no format that can be streamed, or
    has a mistake.
    """
    if require_su2(path, file_format) == "su2b":
        yield StreamInput(path, zone)
        return
    texts = _streamable(path, zone, tick)
    layouts = binary_layouts(texts, is_result=False)
    with draft(folder) as copy:
        try:
            open_temporary(copy, new=True).close()
            require_disk_space(copy, path, layouts[-1].place.end)
            write_layouts(layouts, copy, progress_share(tick, SCANNED, COPIED))
        except OSError as problem:
            raise MeshError(
                f"{path}: its binary copy cannot be written in {folder}: {reason_of(problem)} "
                "(TMPDIR names another folder)"
            ) from problem
        with naming_text(texts[0], copy):
            yield StreamInput(copy, None, texts)


@contextmanager
def open_for_run(
    output: Path,
    path: Path,
    zone: int | None,
    *,
    file_format: FileFormat | None,
    is_text: bool,
    warn: Callable[[str], object],
    tick: Tick,
    ranks: SerialPool,
    later: int,
) -> Iterator[StreamInput]:
    """Context with a mesh to be deformed; the binary copy of a text is beside the output.

    The copy is removed at the end. Raises MeshError if it is of no format that can be streamed, or
    has a mistake; the disk has no room.
    ``is_text``: whether the output is a text.
    ``warn``: called with a sentence on what of the mesh the output will lack; with "" if nothing.
    ``later``: bytes for each cell that the caller writes beside the output afterwards.
    """
    if require_su2(path, file_format) == "su2b":
        with open_zones(path, zone) as (source, places):
            size = text_size(places) if is_text else source.size
        if is_text:
            name = printable(path.name)
            for place in places:
                require_text_names(name, (marker.name for marker in place.markers))
            lost = [OTHER_ZONES] if source.zones > len(places) else []
            warn(sentence_of_lost(output, name, lost, ".su2b"))
        size = bytes_of_run(places, source.width, size, 0, is_text=is_text, later=later)
        require_disk_space(output, output, size)
        yield StreamInput(path, zone)
        return
    texts = _streamable(path, zone, tick)
    if not is_text:
        name = printable(path.name)
        for text in texts:
            require_binary_names(name, (m.name for m in text.zone.markers))
        warn(sentence_of_lost(output, name, lost_of_texts(texts)))
    layouts = binary_layouts(texts, is_result=not is_text)
    size = layouts[-1].place.end
    places = tuple(one.place for one in layouts)
    result = path.stat().st_size if is_text else size
    width = layouts[0].conn.itemsize
    needed = bytes_of_run(places, width, result, size, is_text=is_text, later=later)
    require_disk_space(output, output, needed)
    with draft(Path(os.path.realpath(output)).parent) as copy:
        write_layouts(layouts, copy, progress_share(tick, SCANNED, COPIED), ranks)
        with naming_text(texts[0], copy):
            yield StreamInput(copy, None, texts)


def patched_text(
    texts: Sequence[Text], moved: Sequence[ZoneSource], boxes: Sequence[bytes | None]
) -> Iterator[bytes]:
    """Yield a text, block by block, with the points of its zones ``moved`` in its binary copy.

    ``boxes``: of each zone, boxes for free-form deformation that replace those in the text; None
    keeps the latter.
    """
    changes = []
    for text, zone, ffd in zip(texts, moved, boxes, strict=True):
        assert zone.base is not None
        tables = zone.base.coordinates, zone.points.coordinates
        end = text.lines.byte(text.zone.bounds.end)
        changes.append(PointChange(text.zone.points, *tables, text.unknown, end, ffd))
    yield from patched_blocks(texts[0].lines.raw, changes)
