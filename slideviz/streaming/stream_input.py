"""The mesh file that a streamed run reads: the SU2 binary file itself, or a binary copy of a text.

The copy is made first, and removed after the run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.errors import MeshError, printable
from slideviz.formats.binary_copy import binary_layout, write_layout
from slideviz.formats.losses import OTHER_ZONES, lost_of_text, sentence_of_lost
from slideviz.formats.su2.lines import Piece
from slideviz.formats.su2.text import Text, find_text
from slideviz.formats.su2.write import box_edits, moved_rows, patched_blocks, require_text_names
from slideviz.formats.su2b.layout import BinaryFile, ZonePlace, open_zone
from slideviz.formats.su2b.partial import BINARY, checksums, finish_head, partial_file
from slideviz.formats.su2b.write import require_binary_names
from slideviz.formats.table import format_of
from slideviz.mesh.model import Mesh
from slideviz.streaming.resources import (
    bytes_of_binary,
    bytes_of_text,
    require_disk_space,
    reusable_bytes,
    text_size,
)
from slideviz.streaming.skin import naming_text, read_skin, skin_of_text
from slideviz.system.atomic import reason_of
from slideviz.system.cleanup import draft, open_temporary
from slideviz.system.ranks import SERIAL, SerialPool
from slideviz.system.threads import Tick, progress_share
from slideviz.terms import FileFormat

SCANNED, FILLED, COPIED = 0.15, 0.75, 0.8
"""Parts of the time for reading a text after which its lines are found, its copy is made, and the
checksums of the copy are computed."""


@dataclass(frozen=True, eq=False)
class StreamInput:
    """A mesh to be streamed, in an SU2 binary file."""

    path: Path  # the binary file: the user's, or a copy of a text
    zone: int | None  # the zone in it, from 1; the first where it is None
    text: Text | None = None  # the text that ``path`` is a copy of
    is_reused: bool = False  # whether the copy was made by an earlier run that was stopped

    def text_size(self, place: ZonePlace) -> int:
        """Return about how many bytes the zone at ``place`` has as a text."""
        if self.text is not None:
            return self.text.lines.raw.size
        return text_size(place)

    def skin(self, tick: Tick, ranks: SerialPool = SERIAL) -> Mesh:
        """Return the boundary and the cells at it, reading and checking the mesh; or MeshError."""
        if self.text is None:
            return read_skin(self.path, self.zone, tick, ranks)
        return skin_of_text(self.text, self.path, progress_share(tick, COPIED), ranks)


def require_su2(path: Path, file_format: FileFormat | None = None) -> FileFormat:
    """Return the format of a mesh file; MeshError if it is neither SU2 text nor binary."""
    kind = format_of(path, file_format).value
    if kind is None:
        raise MeshError(
            f"{path}: only SU2 meshes, text or binary, can be streamed; make one with `slideviz "
            f"convert {path.name} {path.stem}.su2b`"
        )
    return kind


def _streamable(path: Path, zone: int | None, tick: Tick) -> Text:
    """Return the places of points, cells and markers in an SU2 text.

    Raises MeshError if it has a mistake, or a halo: nodes that follow others are not all on the
    boundary.
    """
    text = find_text(path, zone, progress_share(tick, 0.0, SCANNED))
    if text.zone.sends:
        raise text.lines.error(
            text.zone.sends[0].begin,
            "a mesh with SEND_RECEIVE markers (a halo) cannot be streamed; make it without its "
            "halo, or run it without --stream",
        )
    return text


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
    layout = binary_layout(_streamable(path, zone, tick), is_result=False)
    with draft(folder) as copy:
        try:
            open_temporary(copy, new=True).close()
            require_disk_space(copy, path, layout.size)
            os.truncate(copy, layout.size)
            head = write_layout(layout, copy, progress_share(tick, SCANNED, COPIED))
            with open_temporary(copy) as file:
                file.write(head)
        except OSError as problem:
            raise MeshError(
                f"{path}: its binary copy cannot be written in {folder}: {reason_of(problem)} "
                "(TMPDIR names another folder)"
            ) from problem
        with naming_text(layout.text, copy):
            yield StreamInput(copy, None, layout.text)


@contextmanager
def open_for_run(
    output: Path,
    path: Path,
    zone: int | None,
    *,
    file_format: FileFormat | None,
    is_text: bool,
    version: str,
    resume: bool,
    warn: Callable[[str], object],
    tick: Tick,
    ranks: SerialPool,
    later: int = 0,
) -> Iterator[StreamInput]:
    """Context with a mesh to be deformed; the binary copy of a text is beside the output.

    The copy is removed at the end, but kept where the run is stopped, to go on with. Raises
    MeshError if it is of no format that can be streamed, or has a mistake; the disk has no room.
    ``is_text``: whether the output is a text.
    ``version``: the program's version: a copy made by another version is not used again.
    ``resume``: whether to use the copy that a stopped run has left.
    ``warn``: called with a sentence on what of the mesh the output will lack; with "" if nothing.
    ``later``: bytes for each cell that the caller writes beside the output afterwards.
    """
    if require_su2(path, file_format) == "su2b":
        if is_text:
            warn(_lost_in_text(output, path, zone))
        size = bytes_of_binary(path, zone, is_text=is_text, later=later)
        require_disk_space(output, output, size - reusable_bytes(output))
        yield StreamInput(path, zone)
        return
    text = _streamable(path, zone, tick)
    if not is_text:
        require_binary_names(printable(path.name), (m.name for m in text.zone.markers))
        lost = lost_of_text((part.key for part in text.zone.unknown), text.zone.bounds.zones)
        warn(sentence_of_lost(output, printable(path.name), lost))
    layout, left = binary_layout(text, is_result=not is_text), reusable_bytes(output)
    state = path.stat()
    about = f"{version} {path.resolve()} {state.st_size} {state.st_mtime_ns} {zone} {layout.size}"
    with partial_file(output, layout.size, about, resume=resume, more=BINARY) as copy:
        is_reused = (
            copy.done > 0
            and checksums(copy.path, progress_share(tick, SCANNED, COPIED), ranks) == copy.sums
        )
        require_disk_space(output, output, bytes_of_text(layout, is_text, later) - left)
        if not is_reused:
            head = write_layout(layout, copy.path, progress_share(tick, SCANNED, FILLED), ranks)
            finish_head(copy.file, head)
            copy.note(checksums(copy.path, progress_share(tick, FILLED, COPIED), ranks))
        with naming_text(text, copy.path):
            yield StreamInput(copy.path, None, text, is_reused)
        copy.remove()


def _lost_in_text(output: Path, path: Path, zone: int | None) -> str:
    """Return a sentence on the other zones of a binary mesh, which a text lacks; "" if none.

    Raises MeshError if the name of a boundary cannot be written in a text.
    """
    with open_zone(path, zone) as (source, place):
        name = printable(path.name)
    require_text_names(name, (marker.name for marker in place.markers))
    return sentence_of_lost(output, name, [OTHER_ZONES] * (source.zones > 1), ".su2b")


def text_blocks(
    mesh_input: StreamInput, source: BinaryFile, place: ZonePlace, after: Path, ffd: bytes | None
) -> Iterator[bytes]:
    """Yield the text of ``mesh_input`` block by block, with the coordinates in the file ``after``.

    ``source`` and ``place``: the binary copy of the text, and its zone.
    ``after``: a file with the new points where the binary copy has the old ones.
    ``ffd``: boxes for free-form deformation that replace those in the text; None keeps the latter.
    """
    text = mesh_input.text
    assert text is not None
    raw, kind = text.lines.raw, source.point(place.dim)
    edits: Sequence[tuple[int, int, bytes]] = ()
    if ffd is not None:
        bounds = text.zone.bounds
        edits = box_edits(raw, text.unknown, text.lines.byte(bounds.end), ffd)
    with mesh_input.path.open("rb") as old, after.open("rb") as new:

        def rows(piece: Piece) -> bytes:
            at, size = place.points + piece.row * kind.itemsize, piece.rows * kind.itemsize
            before, now = (
                np.frombuffer(os.pread(file.fileno(), size, at), kind)["x"].astype(np.float64)
                for file in (old, new)
            )
            return moved_rows(raw, piece, before, now)

        yield from patched_blocks(raw, text.zone.points, rows, edits)
