"""Finding the lines of an SU2 file, and locating the parts of a zone without reading them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.errors import MeshError, printable
from slideviz.formats.source import Source, open_source
from slideviz.formats.su2.keyword_blocks import KeywordBlock, find_blocks, find_bounds, is_ffd
from slideviz.formats.su2.lines import Lines, line_end, number_of, text_of
from slideviz.formats.su2.numbers import fill_points, parse_cells
from slideviz.formats.su2.zone import TextZone, find_zone
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.system.threads import Tick, ordered_map

BLOCK_BYTES = 1 << 20
"""About how many bytes a block has: whole lines that are scanned together."""


@dataclass(frozen=True, eq=False)
class Text:
    """One zone of an SU2 text file, located but not read."""

    lines: Lines
    """The lines of the file."""
    zone: TextZone
    """Where the zone's parts are."""
    sections: list[KeywordBlock]
    """All sections of the file."""

    @property
    def path(self) -> Path:
        """Return the file."""
        return self.lines.raw.path

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return number_of(self.zone.elements)

    @property
    def n_points(self) -> int:
        """Return the number of points."""
        return number_of(self.zone.points)

    @property
    def unknown(self) -> tuple[tuple[int, int], ...]:
        """Return first byte and end of each section that slideviz does not know."""
        return self.lines.bytes_of(*((part.line, part.stop) for part in self.zone.unknown))

    def boxes(self) -> bytes | None:
        """Return the text of the boxes for free-form deformation, or None if there are none."""
        parts = (self.lines.raw[a:b] for a, b in self.unknown)
        return b"".join(part for part in parts if is_ffd(part)) or None


def find_text(path: Path, zone: int | None, progress: Tick = lambda _: None) -> Text:
    """Return a zone of an SU2 text file; its parts are located and counted, but not read.

    ``zone`` is counted from 1; None: the first. Raises MeshError if the file has a mistake.
    """
    lines = scan(open_source(path), progress)
    sections = find_blocks(lines)
    bounds = find_bounds(lines, sections, zone)
    return Text(lines, find_zone(lines, sections, bounds), sections)


def boundaries_elsewhere(
    lines: Lines, sections: list[KeywordBlock], zone: TextZone, progress: Tick
) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield zone, name and nodes (k, d) of each boundary of the other zones, as far as readable.

    ``progress`` is called with 1 while they are read; it may raise to stop.
    """
    for number in range(1, zone.bounds.zones + 1):
        if number == zone.bounds.number:
            continue
        try:
            other = find_zone(lines, sections, find_bounds(lines, sections, number))
            if other.dim == zone.dim:
                yield from _boundaries_of(lines, other, lambda _: progress(1.0))
        except MeshError:  # the zone that is asked for can be right all the same
            continue


def _boundaries_of(
    lines: Lines, zone: TextZone, progress: Tick
) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield number, name and nodes (k, d) of each boundary of a zone."""
    count = number_of(zone.points)
    nodes = {
        part.name: parse_cells(lines, part.rows, zone.dim - 1, count, progress).nodes
        for part in zone.markers
    }
    places = {name: np.empty((len(some), zone.dim)) for name, some in nodes.items()}
    for piece in zone.points:  # not all points of the zone at once
        points = np.empty((piece.rows, zone.dim))
        fill_points(lines, piece, points)
        progress(1.0)
        for name, some in nodes.items():
            here = slice(*np.searchsorted(some, [piece.row, piece.row + piece.rows]))
            places[name][here] = points[some[here] - piece.row]
    for name, points in places.items():
        if len(points):
            yield zone.bounds.number, name, points


def scan(raw: Source, progress: Tick) -> Lines:
    """Return the lines of an SU2 file.

    Raises MeshError if the file is empty or not text.

    Parameters
    ----------
    raw : Source
        The file.
    progress : callable
        Called with the fraction done after each block; may raise to stop.
    """
    from slideviz.formats.su2.loops import RUN_COLUMNS, scan_block

    def scanned(bounds: tuple[int, int]) -> tuple[IntArray, int, bool]:
        text = text_of(raw, *bounds)
        if b"\0" in text:
            raise MeshError(
                f"{printable(raw.path)}: this is not a text file; write the mesh as ASCII, or "
                "name SU2's binary form (ending .su2b, or MESH_FORMAT= SU2B)"
            )
        runs = np.empty((text.count(b"\n"), RUN_COLUMNS), np.int64)
        n_runs, n_lines = scan_block(np.frombuffer(text, np.uint8), runs)
        runs[:n_runs, 0] += bounds[0]
        return runs[:n_runs].copy(), n_lines, text.isspace()

    found, line, blank = [], 0, True
    blocks = _blocks(raw)
    for (_, end), (runs, n_lines, empty) in zip(blocks, ordered_map(scanned, blocks), strict=True):
        runs[:, 1] += line
        found.append(runs)
        line += n_lines
        blank &= empty
        progress(end / raw.size)
    if blank:
        raise MeshError(f"{printable(raw.path)}: the file is empty; write the mesh again")
    begins, firsts, kinds, rows, nodes = np.concatenate(found).T.copy()
    return Lines(raw, np.append(begins, raw.size), np.append(firsts, line), kinds, rows, nodes)


def _blocks(raw: Source) -> list[tuple[int, int]]:
    """Return first byte and end of the blocks of a file, whole lines each."""
    bounds, begin = [], 0
    while begin < raw.size:
        end = line_end(raw, min(begin + BLOCK_BYTES, raw.size) - 1)
        bounds.append((begin, end))
        begin = end
    return bounds
