"""Reading SU2 text meshes; with the mesh is kept what is needed to write the file again."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from slideviz.errors import printable
from slideviz.formats.source import Source, open_source
from slideviz.formats.su2.keyword_blocks import boxes_elsewhere, find_blocks, find_bounds
from slideviz.formats.su2.lines import Rows, number_of, scan
from slideviz.formats.su2.numbers import parse_cells, parse_points
from slideviz.formats.su2.send_receive import find_halo
from slideviz.formats.su2.text import boundaries_elsewhere
from slideviz.formats.su2.zone import find_zone
from slideviz.mesh.interfaces import find_interfaces
from slideviz.mesh.model import Cells, FloatArray, Marker, Mesh, Origin
from slideviz.system.threads import Tick

_SCANNED = 0.2
"""Part of the time of reading a file, as told to the progress, that finding its lines takes."""


_SNIFFED_BYTES = 1 << 16
"""Bytes of a file that are searched for ``NDIME=``."""
_NDIME = re.compile(rb"^\s*NDIME\s*=", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True, eq=False)
class Document(Origin):
    """An SU2 file as it was read, with the places of its parts, so that it can be written again."""

    ending = ".su2"
    raw: Source
    """The whole file."""
    rows: Rows
    """The rows of the points in it."""
    points: FloatArray
    """(n, d): the points as read."""
    cells: Cells
    """The cells as read."""
    markers: tuple[Marker, ...]
    """The boundaries as read."""
    zone: tuple[int, int]
    """(int, int): first byte and end of the zone, without its ``IZONE`` line."""
    sends: tuple[tuple[int, int], ...]
    unknown: tuple[tuple[int, int], ...]
    """`sends`, `unknown`: first byte and end of each ``SEND_RECEIVE`` marker, and of each unknown
    section."""


def is_su2(path: Path) -> bool:
    """Return whether a file begins as an SU2 text does, by its ``NDIME=``.

    Raises
    ------
    OSError
        It cannot be read.
    """
    with path.open("rb") as file:
        return _NDIME.search(file.read(_SNIFFED_BYTES)) is not None


def read_su2_file(path: Path, zone: int | None, progress: Tick) -> Mesh:
    """Return one zone of an SU2 file, as `read_su2` does."""
    return read_su2(open_source(path), zone, progress)


def read_su2(raw: Source, zone: int | None, progress: Tick) -> Mesh:
    """Return one zone of an SU2 file.

    Parameters
    ----------
    raw : Source
        The file.
    zone : int or None
        The zone, from 1; None for the first.
    progress : callable
        Called with the fraction done; may raise to stop.

    Raises
    ------
    MeshError
        The file has a mistake; the message has the line.
    """
    lines = scan(raw, lambda done: progress(_SCANNED * done))
    sections = find_blocks(lines)
    found = find_zone(lines, sections, find_bounds(lines, sections, zone))
    n_points = number_of(found.points)
    sizes = [
        rows[-1].end - rows[0].begin if rows else 0
        for rows in (found.elements, found.points, *(m.rows for m in found.markers))
    ]
    first, second, *rest = _shares(sizes, progress)
    cells = parse_cells(lines, found.elements, found.dim, n_points, first)
    points = parse_points(lines, found.points, found.dim, second)
    markers = tuple(
        Marker(part.name, parse_cells(lines, part.rows, found.dim - 1, n_points, share))
        for part, share in zip(found.markers, rest, strict=True)
    )
    raw.require_same()
    progress(1.0)
    document = Document(
        raw=raw,
        rows=found.points,
        points=points,
        cells=cells,
        markers=markers,
        zone=lines.bytes_of((found.bounds.begin, found.bounds.end))[0],
        sends=lines.bytes_of(*((part.begin, part.end) for part in found.sends)),
        unknown=lines.bytes_of(*((part.line, part.stop) for part in found.unknown)),
        ffd_at=found.ffd_at,
        ffd_elsewhere=boxes_elsewhere(sections, found.bounds),
    )
    mesh = Mesh(
        points=points,
        cells=cells,
        markers=markers,
        origin=document,
        name=printable(raw.path.name),
        zone=found.bounds.number,
        zones=found.bounds.zones,
        source=raw.path.resolve(),
    )
    halo, remarks = find_halo(lines, found, mesh)
    others = boundaries_elsewhere(lines, sections, found, progress)
    return replace(
        mesh,
        halo=halo,
        remarks=(*found.remarks, *remarks),
        interfaces=find_interfaces(mesh, others),
    )


def _shares(sizes: list[int], progress: Tick) -> list[Tick]:
    """Return a function for each part that turns its progress (0 to 1) into that of all parts."""
    total = max(sum(sizes), 1)
    edges = [_SCANNED + (1.0 - _SCANNED) * sum(sizes[:k]) / total for k in range(len(sizes) + 1)]

    def share(begin: float, end: float) -> Tick:
        return lambda done: progress(begin + done * (end - begin))

    return [share(begin, end) for begin, end in pairwise(edges)]
