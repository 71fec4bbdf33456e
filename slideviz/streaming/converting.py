"""SU2 meshes larger than memory, converted from text to binary and back, piece by piece."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from slideviz.errors import printable
from slideviz.formats.binary_copy import binary_layouts, write_layouts
from slideviz.formats.losses import OTHER_ZONES, lost_of_texts, sentence_of_lost
from slideviz.formats.source import open_source
from slideviz.formats.su2.text import find_texts
from slideviz.formats.su2.write import content_blocks, require_text_names
from slideviz.formats.su2b.read import BLOCK, read_markers
from slideviz.formats.su2b.write import halo_error, require_binary_names
from slideviz.formats.table import ZoneContent, format_of
from slideviz.mesh.model import CellRows, Cells, IntArray
from slideviz.streaming.skin import index_of, read_skin
from slideviz.streaming.source import FileSource, Scratch, ZoneSource
from slideviz.streaming.stream_input import require_disk_space, text_size
from slideviz.system.atomic import atomic_write
from slideviz.system.threads import Tick, progress_share
from slideviz.terms import FileFormat

NEAR = 256  # elements with at most so many others between them are read in one piece


def text_of_binary(zones: Sequence[ZoneSource], folder: Path) -> Iterator[bytes]:
    """Yield zones of an SU2 binary mesh as an SU2 text.

    A scratch file is made in ``folder`` if the cells are not in order in the binary file.
    """
    if len(zones) > 1:
        yield f"NZONE= {len(zones)}\n".encode()
    for number, zone in enumerate(zones, 1):
        yield f"IZONE= {number}\n".encode() if len(zones) > 1 else b""
        yield from _text_of_zone(zone, folder)


def _text_of_zone(source: ZoneSource, folder: Path) -> Iterator[bytes]:

    with ExitStack() as stack:
        where = _places(stack, source, folder)

        def cells(i: int, j: int) -> CellRows:
            if where is None:
                block = source.elements_at(i, j - i)
                return block.types, block.nodes, block.ids
            some = _gathered(source, where[i:j])
            return some.types, some.connectivity, np.arange(i, j)

        content = ZoneContent(
            dim=source.place.dim,
            n_cells=source.n_cells,
            n_points=source.n_points,
            cells=cells,
            types=lambda i, j: cells(i, j)[0],
            points=lambda i, j: source.points.coordinates(slice(i, j)),
            markers=tuple(read_markers(source.file, source.place)),
        )
        yield from content_blocks([content], source.file.name)


def _places(stack: ExitStack, source: ZoneSource, folder: Path) -> IntArray | None:
    """Return the place of each cell among the elements of a file (m,); None where all are in order.

    They are in a scratch file in ``folder``, removed when ``stack`` closes.
    """
    scratch = None
    for block in source.elements(BLOCK):
        here = slice(block.first, block.first + len(block.ids))
        ids = index_of(block.ids)
        if scratch is None and not (isinstance(ids, slice) and ids == here):
            scratch = Scratch(stack, folder, source.n_cells, np.int64)
            scratch.array[: block.first] = np.arange(block.first)
        if scratch is not None:
            scratch.array[ids] = np.arange(here.start, here.stop)
            scratch.release()
    return None if scratch is None else scratch.array


def _gathered(source: ZoneSource, where: IntArray) -> Cells:
    ordered = np.sort(where)
    cuts = np.flatnonzero(np.diff(ordered) > NEAR) + 1
    found = []
    for part in np.split(ordered, cuts):
        block = source.elements_at(int(part[0]), int(part[-1] - part[0]) + 1)
        found.append(Cells.from_types(block.types, block.nodes).take(part - part[0]))
    return Cells.joined(found).take(np.searchsorted(ordered, where))


Warn = Callable[[str], object]
"""Called with a sentence on what of the mesh the new file will lack; with "" if nothing."""
PLACE_BYTES = 8
"""Bytes of disk for each cell: its place in the binary file, should cells not be in order there."""


def streamed_kind(source: Path, target: Path) -> FileFormat | None:
    """Return the format of ``source`` where it can be converted to ``target`` piece by piece.

    That is from SU2 text to SU2 binary or back; None for all others. Raises MeshError if the file
    cannot be read.
    """
    kind = format_of(source).value
    other = target.suffix.lower().removeprefix(".")
    return kind if kind != other and {kind, other} == {"su2", "su2b"} else None


def convert_streamed(
    source: Path, target: Path, zone: int | None, *, warn: Warn, tick: Tick
) -> None:
    """Convert an SU2 mesh from text to binary or back, with the bytes of `slideviz.convert`.

    Raises MeshError if the file has a mistake, the format cannot hold the mesh, or the disk has no
    room. ``source`` and ``target``: one is SU2 text, the other SU2 binary (`streamed_kind`); a file
    at ``target`` is replaced. ``zone``: the zone, from 1; all of them when None.
    """
    if format_of(source).value == "su2":
        _to_binary(source, target, zone, warn, tick)
    else:
        _to_text(source, target, zone, warn, tick)


def _to_binary(source: Path, target: Path, zone: int | None, warn: Warn, tick: Tick) -> None:
    texts = find_texts(open_source(source), zone, progress_share(tick, 0.0, 0.1))
    for number, text in enumerate(texts, 1):
        name = printable(source.name) + (f", zone {number}" if number > 1 else "")
        if text.zone.sends:
            raise halo_error(name)
        require_binary_names(name, (marker.name for marker in text.zone.markers))
    layouts = binary_layouts(texts, is_result=True)
    alone = texts[0].zone.bounds.zones > len(texts)
    warn(sentence_of_lost(target, printable(source.name), lost_of_texts(texts), alone=alone))
    require_disk_space(target, target, layouts[-1].place.end)
    with atomic_write(target) as file:
        write_layouts(layouts, Path(file.name), progress_share(tick, 0.1))
    tick(1.0)


def _to_text(source: Path, target: Path, zone: int | None, warn: Warn, tick: Tick) -> None:
    with ExitStack() as stack:
        zones = FileSource.open(stack, (source, zone)).zones
        binary = zones[0].file
        places = [one.place for one in zones]
        for place in places:
            require_text_names(binary.name, (marker.name for marker in place.markers))
        if len(places) < binary.zones:
            name = printable(source.name)
            warn(sentence_of_lost(target, name, [OTHER_ZONES], alone=True))
        size = text_size(places)
        more = PLACE_BYTES * max(place.cells.count for place in places)
        require_disk_space(target, target, size + more)
        for place in places:  # finds every mistake in the file, as reading it whole would
            read_skin(source, place.number, progress_share(tick, 0.0, 0.3))
        written = 0
        with atomic_write(target) as out:
            for block in text_of_binary(zones, Path(os.path.realpath(target)).parent):
                out.write(block)
                written += len(block)
                tick(min(1.0, 0.3 + 0.7 * written / size))
    tick(1.0)
