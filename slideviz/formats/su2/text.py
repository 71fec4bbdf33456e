"""A zone of an SU2 text file whose parts are located, but not read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.errors import MeshError
from slideviz.formats.source import open_source
from slideviz.formats.su2.keyword_blocks import KeywordBlock, find_blocks, find_bounds, is_ffd
from slideviz.formats.su2.lines import Lines, number_of, scan
from slideviz.formats.su2.numbers import fill_points, parse_cells
from slideviz.formats.su2.zone import TextZone, find_zone
from slideviz.mesh.model import FloatArray
from slideviz.system.threads import Tick


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

    ``zone`` is counted from 1; None: the first.

    Raises
    ------
    MeshError
        The file has a mistake.
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
