"""A zone of an SU2 text file whose parts are located, but not read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from slideviz.mesh.io.source import open_source
from slideviz.mesh.io.su2.keyword_blocks import boxes_elsewhere, find_blocks, find_bounds, is_ffd
from slideviz.mesh.io.su2.lines import Lines, number_of
from slideviz.mesh.io.su2.scan import Progress, scan
from slideviz.mesh.io.su2.zone import TextZone, find_zone


@dataclass(frozen=True, eq=False)
class Text:
    """One zone of an SU2 text file, located but not read.

    Attributes
    ----------
    lines : Lines
        The lines of the file.
    zone : TextZone
        Where the zone's parts are.
    boxes_elsewhere : dict of str to int
        Boxes for free-form deformation in other zones, and the numbers of these.
    """

    lines: Lines
    zone: TextZone
    boxes_elsewhere: dict[str, int]

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


def find_text(path: Path, zone: int | None, progress: Progress = lambda _: None) -> Text:
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
    return Text(lines, find_zone(lines, sections, bounds), boxes_elsewhere(sections, bounds))
