"""Writing SU2 text meshes: the file that was read with other coordinates, or a new one.

Numbers are written with as few digits as identify the float64, so that nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import orjson
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.formats.source import Source
from slideviz.formats.su2.lines import FirstAndEnd, Piece, Rows, is_ffd
from slideviz.formats.su2.loops import print_cells, print_changed, print_points
from slideviz.formats.su2.read import Document
from slideviz.formats.su2.text import BLOCK_BYTES, SEND_RECEIVE
from slideviz.formats.table import WriteOptions, ZoneContent, write_blocks
from slideviz.mesh.check import check_mesh, check_points
from slideviz.mesh.model import Cells, FloatArray, Marker, Mesh
from slideviz.mesh.zones import zones_of
from slideviz.system.threads import cuts, ordered_map

_BLOCK_ROWS = 20_000  # most elements or points in a block of text
_NUMBER_BYTES = 20  # most bytes of an index, with the blank after it
Edit = tuple[int, int, bytes]
"""A change of a file: first byte and end of the text to replace, and the new text."""


def write_su2(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh as SU2 text; MeshError if `su2_blocks` raises it, or it cannot be written."""
    write_blocks(path, su2_blocks(mesh), options)


def su2_blocks(mesh: Mesh) -> Iterator[bytes]:
    """Yield the SU2 file of a mesh, block by block.

    For a mesh that was read from an SU2 file and has the same cells and markers it is that file, in
    which only the coordinates that changed are replaced. Any other mesh is written anew; sections
    of its file that slideviz does not know follow at the end of its zone. Raises MeshError if the
    mesh cannot be used, or a marker's name cannot be written to an SU2 file.
    """
    zones = zones_of(mesh)
    document = mesh.origin
    of_one_file = len({zone.source for zone in zones}) == 1
    if of_one_file and all(_only_points_differ(zone) for zone in zones):
        for zone in zones:
            check_points(zone)
        yield from _patched(zones)
    elif len(zones) > 1:
        yield f"NZONE= {len(zones)}\n".encode()
        for number, zone in enumerate(zones, 1):
            yield f"IZONE= {number}\n".encode()
            yield from _zone_text(zone)
    elif not isinstance(document, Document):
        yield from _zone_text(mesh)
    else:
        raw = document.raw
        begin, end = document.zone
        raw.require_same()
        yield from (raw[a:b] for a, b in cuts(0, begin, BLOCK_BYTES))
        yield from _zone_text(mesh)
        yield from (raw[a:b] for a, b in cuts(end, raw.size, BLOCK_BYTES))
        raw.require_same()


def _zone_text(mesh: Mesh) -> Iterator[bytes]:
    """Yield the lines of a zone, with the other sections that its file has."""
    check_mesh(mesh)
    require_text_names(mesh.name, mesh.marker_names)
    document = mesh.origin
    boxes = mesh.origin.ffd
    kept: list[bytes] = []
    if isinstance(document, Document):
        places = (*document.sends, *document.unknown)
        texts = (document.raw[a:b] for a, b in places)
        kept = [text if text.endswith(b"\n") else text + b"\n" for text in texts]
    cells = len(mesh.cells), partial(_some, mesh.cells)
    yield from _zone(mesh.dim, cells, (len(mesh.points), lambda i, j: mesh.points[i:j]))
    yield from _markers(mesh.markers, len(document.sends) if isinstance(document, Document) else 0)
    yield from (text for text in kept if boxes is None or not is_ffd(text))
    yield boxes or b""


def _only_points_differ(mesh: Mesh) -> bool:
    """Return whether a mesh has the cells and markers, and as many points, as its SU2 text."""
    document = mesh.origin
    if not isinstance(document, Document) or mesh.points.shape != document.points.shape:
        return False
    if mesh.cells is not document.cells and not mesh.cells.same_as(document.cells):
        return False
    return mesh.marker_names == tuple(m.name for m in document.markers) and all(
        a is b or a.cells.same_as(b.cells)
        for a, b in zip(mesh.markers, document.markers, strict=True)
    )


def _patched(zones: Sequence[Mesh]) -> Iterator[bytes]:
    """Yield the file of zones, each with a `Document`, with new points and boxes."""
    documents = [zone.origin for zone in zones if isinstance(zone.origin, Document)]
    changes = [
        PointChange(
            read.rows,
            read.points.__getitem__,
            zone.points.__getitem__,
            read.unknown,
            read.zone[1],
            read.ffd,
        )
        for zone, read in zip(zones, documents, strict=True)
    ]
    yield from patched_blocks(documents[0].raw, changes)


@record
class PointChange:
    """What is new in a zone of a text: its points, and perhaps its boxes."""

    rows: Rows  # of the points
    before: Callable[[slice], FloatArray]
    after: Callable[[slice], FloatArray]
    """`before`, `after`: return the points (m, d) of some rows, as read and as to be written."""
    unknown: Sequence[FirstAndEnd]
    end: int
    """`unknown`, `end`: first byte and end of each unknown section, and the end of the zone."""
    ffd: bytes | None  # the new boxes for free-form deformation; None: those it had


def patched_blocks(raw: Source, changes: Sequence[PointChange]) -> Iterator[bytes]:
    """Yield a file, block by block, with new boxes and those coordinates that differ in any bit.

    Raises MeshError if the file was changed since it was read.
    """
    raw.require_same()
    edits = sorted(
        edit
        for one in changes
        if one.ffd is not None
        for edit in _box_edits(raw, one.unknown, one.end, one.ffd)
    )
    change = {piece: one for one in changes for piece in one.rows}
    done = 0
    tasks: list[FirstAndEnd | Piece | bytes] = []
    for piece in sorted(change, key=lambda piece: piece.begin):
        tasks += [*_around(edits, done, piece.begin), piece]
        done = piece.end

    def text(task: FirstAndEnd | Piece | bytes) -> bytes:
        if isinstance(task, bytes):
            return task
        if isinstance(task, tuple):
            return raw[slice(*task)]
        one = change[task]
        rows = slice(task.row, task.row + task.rows)
        return _moved_rows(raw, task, one.before(rows), one.after(rows))

    yield from ordered_map(text, [*tasks, *_around(edits, done, raw.size + 1)])
    raw.require_same()


def _box_edits(raw: Source, unknown: Sequence[FirstAndEnd], end: int, ffd: bytes) -> list[Edit]:
    """Return the edits that replace the boxes for free-form deformation of a zone by ``ffd``.

    If the zone has none, ``ffd`` is put at its end. ``unknown``: first byte and end of each unknown
    section. ``end``: the byte where the zone ends.
    """
    old = [(a, b) for a, b in unknown if is_ffd(raw[a:b])]
    if old:
        return [(a, b, b"" if at else ffd) for at, (a, b) in enumerate(old)]
    return [(end, end, ffd if raw[end - 1 : end] == b"\n" else b"\n" + ffd)]


def _around(edits: Sequence[Edit], begin: int, end: int) -> Iterator[FirstAndEnd | bytes]:
    """Yield the parts of a range of bytes in order: blocks (first byte, end) and texts of edits."""
    for first, after, text in edits:
        if begin <= first < end:
            yield from cuts(begin, first, BLOCK_BYTES)
            yield text
            begin = after
    yield from cuts(begin, end, BLOCK_BYTES)


def _moved_rows(raw: Source, piece: Piece, before: FloatArray, now: FloatArray) -> bytes:
    """Return the text of a piece of points with the coordinates that changed replaced.

    Raises MeshError if the file was changed. ``before`` and ``now`` (m, d) float64: the points of
    these rows, as read and as they are to be written.
    """
    text = raw[piece.begin : piece.end]
    changed = now.view(np.int64) != before.view(np.int64)
    if not changed.any():
        return text
    broken = text if text.endswith(b"\n") else text + b"\n"
    numbers = _digits(now)
    out = np.empty(len(broken) + len(numbers), np.uint8)
    rows, size = print_changed(np.frombuffer(broken, np.uint8), numbers, changed, out)
    if rows != piece.rows:
        raise raw.changed()
    return out[: size - len(broken) + len(text)].tobytes()


def _digits(points: FloatArray) -> NDArray[np.uint8]:
    """Return the bytes of ``[[x,y],[x,y]]``, with as few digits as identify each float64."""
    return np.frombuffer(orjson.dumps(points, option=orjson.OPT_SERIALIZE_NUMPY), np.uint8)


def require_text_names(mesh: str, names: Iterable[str]) -> None:
    """Raise if the name of a marker cannot be written to an SU2 text file and read again.

    ``mesh`` is the name of the mesh, for the message. Raises MeshError if a name is empty, has a
    percent sign, blanks around it or control characters, or is ``SEND_RECEIVE``.
    """
    for name in names:
        if not name or name != name.strip() or not name.isprintable() or "%" in name:
            raise MeshError(
                f"{mesh}: the marker name {name!r} cannot be written to an SU2 file; rename it "
                "without percent sign, line break or blanks around it"
            )
        if name.upper() == SEND_RECEIVE:
            raise MeshError(
                f"{mesh}: a boundary cannot be named {name}, which SU2 uses for halos; rename it"
            )


CellsOf = Callable[[int, int], tuple[NDArray, ...]]
"""A function that returns types and nodes of the cells ``i`` to ``j - 1``, and perhaps more."""
PointsOf = Callable[[int, int], FloatArray]
"""A function that returns the points ``i`` to ``j - 1``, (j - i, d)."""


def content_blocks(contents: Sequence[ZoneContent], name: str) -> Iterator[bytes]:
    """Yield the SU2 file of zones whose parts are made by functions, called from several threads.

    Raises MeshError if a boundary has a name that cannot be written to an SU2 file.
    """
    require_text_names(name, (marker.name for content in contents for marker in content.markers))

    several = len(contents) > 1
    yield f"NZONE= {len(contents)}\n".encode() if several else b""
    for number, content in enumerate(contents, 1):
        yield f"IZONE= {number}\n".encode() if several else b""
        made = content.n_cells, content.cells
        yield from _zone(content.dim, made, (content.n_points, content.points))
        yield from _markers(content.markers, 0)


def _zone(dim: int, cells: tuple[int, CellsOf], points: tuple[int, PointsOf]) -> Iterator[bytes]:
    yield f"NDIME= {dim}\nNELEM= {cells[0]}\n".encode()
    yield from _elements(*cells, numbered=True)
    yield f"NPOIN= {points[0]}\n".encode()
    yield from ordered_map(partial(_point_rows, points[1]), cuts(0, points[0], _BLOCK_ROWS))


def _some(cells: Cells, i: int, j: int) -> tuple[NDArray, ...]:
    return cells.types[i:j], cells.connectivity[slice(*cells.offsets[[i, j]])]


def _point_rows(points: PointsOf, block: FirstAndEnd) -> bytes:
    mine = points(*block)
    numbers = _digits(mine)
    out = np.empty(len(numbers) + _NUMBER_BYTES * len(mine), np.uint8)
    return out[: print_points(numbers, mine.shape[1], block[0], out)].tobytes()


def _markers(markers: Sequence[Marker], sends: int) -> Iterator[bytes]:
    """Yield NMARK, which includes ``sends`` markers of a halo that follow, and the boundaries."""
    yield f"NMARK= {len(markers) + sends}\n".encode()
    for marker in markers:
        yield f"MARKER_TAG= {marker.name}\nMARKER_ELEMS= {len(marker.cells)}\n".encode()
        yield from _elements(len(marker.cells), partial(_some, marker.cells), numbered=False)


def _elements(count: int, cells: CellsOf, *, numbered: bool) -> Iterator[bytes]:
    yield from ordered_map(partial(_cell_rows, cells, numbered), cuts(0, count, _BLOCK_ROWS))


def _cell_rows(cells: CellsOf, numbered: bool, block: FirstAndEnd) -> bytes:
    types, nodes = cells(*block)[:2]
    out = np.empty(_NUMBER_BYTES * (len(nodes) + 2 * len(types)), np.uint8)
    return out[: print_cells(types, nodes, block[0] if numbered else -1, out)].tobytes()
