"""Finding the lines of an SU2 file, and locating the parts of a zone without reading them.

Sections that slideviz does not know (FFD boxes, periodic data, offsets) and the halo markers are
only located, so that writing can keep them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import MeshError, printable
from slideviz.formats.source import Source
from slideviz.formats.su2 import ROWS
from slideviz.formats.su2.lines import (
    ALIASES,
    KNOWN,
    Bounds,
    FirstAndEnd,
    KeywordBlock,
    Lines,
    Rows,
    count_of,
    find_blocks,
    find_bounds,
    is_ffd,
    line_end,
    misspelt,
    number_of,
    show,
    text_of,
)
from slideviz.formats.su2.loops import RUN_COLUMNS, scan_block
from slideviz.formats.su2.numbers import fill_points, parse_cells
from slideviz.mesh.interfaces import points_of_nodes
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.system.threads import Tick, ordered_map

SEND_RECEIVE = "SEND_RECEIVE"  # name of the markers of a halo (in `su2b.layout`, too)
# Remedies in messages.
_NAME_IT = "; name the marker"
_COUNT_THEM = "; add it with the number of elements"


@record
class MarkerRows:
    """A boundary: its name, the line of its MARKER_TAG, and the rows of its elements."""

    name: str
    line: int
    rows: Rows


@record
class SendRows:
    """A ``SEND_RECEIVE`` marker: its lines ``begin:end``, value of ``SEND_TO``, and its rows."""

    begin: int
    end: int
    domain: bytes
    rows: Rows


@record
class TextZone:
    """Where the parts of one zone are in the file."""

    bounds: Bounds  # which zone, and its lines
    dim: int  # 2 or 3
    elements: Rows
    points: Rows  # `elements`, `points`: the rows of the elements and of the points
    markers: tuple[MarkerRows, ...]  # the boundaries
    sends: tuple[SendRows, ...]
    """The ``SEND_RECEIVE`` markers, which list donors and receivers of a halo."""
    unknown: tuple[KeywordBlock, ...]  # the unknown sections
    remarks: tuple[str, ...] = ()  # sentences on what is unusual

    @property
    def ffd_at(self) -> tuple[range, ...]:
        """Return the ranges of lines of the boxes for free-form deformation."""
        boxes = (part for part in self.unknown if is_ffd(part.key.encode()))
        return tuple(range(part.line, part.stop) for part in boxes)


def find_zone(lines: Lines, sections: list[KeywordBlock], bounds: Bounds) -> TextZone:
    """Return where the parts of a zone are.

    Raises MeshError if a section is missing or occurs twice, a count is wrong, or the name of a
    marker is empty, not printable or used twice.
    """
    inside = [
        section
        for section in sections
        if bounds.begin <= section.line < bounds.end and section.key not in ("NZONE", "IZONE")
    ]
    return _Walk(lines, inside, bounds).zone()


class _Walk:
    """Goes through the sections of one zone, finds its parts and raises for mistakes."""

    def __init__(self, lines: Lines, sections: list[KeywordBlock], bounds: Bounds) -> None:
        self.lines = lines
        self.sections = sections
        self.bounds = bounds
        self.text_lines = lines.firsts[:-1][lines.kinds != ROWS]

    def zone(self) -> TextZone:
        """Return where the parts are; raise MeshError for a mistake."""
        heads = {key: self._only(key) for key in ("NDIME", "NELEM", "NPOIN", "NMARK")}
        dim = count_of(self.lines, heads["NDIME"])
        if dim not in (2, 3):
            raise self.lines.error(
                heads["NDIME"].line, f"NDIME= {dim} is not possible; write 2 or 3"
            )
        self._require_no_rows(heads["NDIME"])
        elements = self._counted(heads["NELEM"], "elements")
        points = self._counted(heads["NPOIN"], "points")
        for key, rows in (("NELEM", elements), ("NPOIN", points)):
            if not rows:
                raise self.lines.error(
                    heads[key].line, f"{key}= 0 leaves nothing to work on; export the volume mesh"
                )
        self._require_no_rows(heads["NMARK"])
        markers, sends, unknown = self._walk()
        self._check_markers(heads["NMARK"], markers, len(sends))
        return TextZone(
            bounds=self.bounds,
            dim=dim,
            elements=elements,
            points=points,
            markers=markers,
            sends=sends,
            unknown=unknown,
            remarks=tuple(
                f"line {part.line + 1} has {part.spelt}=, which is read as {part.key}="
                for part in self.sections
                if part.spelt in ALIASES
            ),
        )

    def _require_no_rows(self, section: KeywordBlock) -> None:
        """Raise MeshError if a section that should have no rows of numbers has any."""
        rows = self.lines.pieces(section.line, section.stop)
        if rows:
            raise self.lines.error(
                self.lines.row(rows, 0),
                f"numbers follow {section.key}= {show(section.value)}, where none belong; remove "
                "the line or restore the keyword before it",
            )

    def _counted(self, section: KeywordBlock, what: str) -> Rows:
        """Return the rows of numbers of a section, as many as its keyword line says.

        Raises MeshError if there are more or fewer rows, or other text among them.
        ``what``: what is on the rows, for messages: ``points``.
        """
        count = count_of(self.lines, section)
        rows = self.lines.pieces(section.line, section.stop)
        found = number_of(rows)
        at = int(np.searchsorted(self.text_lines, section.line, "right"))
        text = int(self.text_lines[at]) if at < len(self.text_lines) else section.stop
        before = number_of(self.lines.pieces(section.line, text))
        if text < section.stop and before < count:
            word = (self.lines.line(text).split() or [b""])[0]
            raise self.lines.error(
                text,
                f"expected one of the {count} {what}, found '{show(word)}' ({section.key} on line "
                f"{section.line + 1}); correct it",
            )
        if found < count:
            raise self.lines.error(
                min(section.stop, len(self.lines) - 1),
                f"only {found} {what} precede this line, but {section.key}= {count} (line "
                f"{section.line + 1}) says {count}; restore the missing lines or correct the count",
            )
        if found > count:
            raise self.lines.error(
                self.lines.row(rows, count),
                f"{found} {what} are here, but {section.key}= {count} (line {section.line + 1}) "
                f"says {count}; correct the count",
            )
        return rows

    def _only(self, key: str) -> KeywordBlock:
        """Return the section of a key; raise MeshError if there is none or a second one."""
        matches = [section for section in self.sections if section.key == key]
        if not matches:
            remedy = "; write NMARK= 0 if it has no boundaries" if key == "NMARK" else ""
            meant = misspelt(self.sections, key)
            why = "" if meant else "; perhaps the file is cut off, so write it again" + remedy
            raise self.lines.error(
                self.bounds.end - 1, f"the mesh ends here, but has no line {key}={meant}{why}"
            )
        if len(matches) > 1:
            raise self.lines.error(
                matches[1].line,
                f"{key}= occurs twice (first on line {matches[0].line + 1}); remove one, or number "
                "the zones with NZONE= and IZONE=",
            )
        return matches[0]

    def _walk(
        self,
    ) -> tuple[tuple[MarkerRows, ...], tuple[SendRows, ...], tuple[KeywordBlock, ...]]:
        markers = []
        sends = []
        unknown = []
        at = 0
        while at < len(self.sections):
            section = self.sections[at]
            at += 1
            if section.key == "MARKER_TAG":
                name = self._name(section)
                head, domain, at = self._marker_head(section, at, name == SEND_RECEIVE)
                rows = self._counted(head, f"elements of marker {name}")
                if name == SEND_RECEIVE:
                    sends.append(SendRows(section.line, head.stop, domain, rows))
                else:
                    markers.append(MarkerRows(name, section.line, rows))
            elif section.key == "MARKER_ELEMS":
                raise self.lines.error(
                    section.line,
                    "MARKER_ELEMS= has no MARKER_TAG= before it"
                    + (misspelt(self.sections[at - 2 : at - 1], "MARKER_TAG") or _NAME_IT),
                )
            elif section.key not in KNOWN:
                unknown.append(section)
        return tuple(markers), tuple(sends), tuple(unknown)

    def _marker_head(
        self, tag: KeywordBlock, at: int, sends: bool
    ) -> tuple[KeywordBlock, bytes, int]:
        """Return the section with the elements of a marker, its SEND_TO, and the next section.

        ``tag`` is its MARKER_TAG, ``at`` the index of the section after that; ``sends`` tells
        whether it is a SEND_RECEIVE marker. SEND_TO is empty where there is none; the next section
        is an index. Raises MeshError if MARKER_ELEMS does not follow.
        """
        self._require_no_rows(tag)
        following = self.sections[at] if at < len(self.sections) else None
        if following is None or following.key != "MARKER_ELEMS":
            raise self.lines.error(
                tag.line,
                f"marker {show(tag.value)} is not followed by MARKER_ELEMS="
                + (misspelt(self.sections[at : at + 1], "MARKER_ELEMS") or _COUNT_THEM),
            )
        at = at + 1
        domain = b""
        if sends and at < len(self.sections) and self.sections[at].key == "SEND_TO":
            # The elements follow the SEND_TO line.
            self._require_no_rows(following)
            head = self.sections[at]
            following = KeywordBlock(following.key, following.value, head.line, head.stop)
            at = at + 1
            domain = head.value
        return following, domain, at

    def _name(self, section: KeywordBlock) -> str:
        try:
            name = section.value.decode()
        except UnicodeDecodeError:
            name = ""
        if not name or not name.isprintable():
            what = "has control characters" if name else "is empty or not UTF-8 text"
            remedy = "" if name else ", or save the file as UTF-8"
            raise self.lines.error(
                section.line,
                f"the marker name '{show(section.value)}' {what}; rename the marker{remedy}",
            )
        return SEND_RECEIVE if name.upper() == SEND_RECEIVE else name

    def _check_markers(
        self, head: KeywordBlock, markers: tuple[MarkerRows, ...], sends: int
    ) -> None:
        """Raise MeshError if two boundaries have one name, or NMARK (``head``) is wrong."""
        seen: dict[str, int] = {}
        for marker in markers:
            if marker.name in seen:
                raise self.lines.error(
                    marker.line,
                    f"marker {marker.name} occurs twice (first on line {seen[marker.name] + 1}); "
                    "rename or merge them",
                )
            seen[marker.name] = marker.line
        count = count_of(self.lines, head)
        if count != len(markers) + sends:
            raise self.lines.error(
                head.line,
                f"NMARK= {count} says {count} markers, but {len(markers) + sends} follow; correct "
                "the count or restore the missing markers",
            )


BLOCK_BYTES = 1 << 20  # about how many bytes a block has: whole lines that are scanned together


@record
class Text:
    """One zone of an SU2 text file, located but not read."""

    lines: Lines  # the lines of the file
    zone: TextZone  # where the zone's parts are
    sections: list[KeywordBlock]  # all sections of the file

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
    def unknown(self) -> tuple[FirstAndEnd, ...]:
        """Return first byte and end of each section that slideviz does not know."""
        return self.lines.bytes_of(*((part.line, part.stop) for part in self.zone.unknown))

    def boxes(self) -> bytes | None:
        """Return the text of the boxes for free-form deformation, or None if there are none."""
        parts = (self.lines.raw[a:b] for a, b in self.unknown)
        return b"".join(part for part in parts if is_ffd(part)) or None


def find_texts(raw: Source, zone: int | None, progress: Tick = lambda _: None) -> tuple[Text, ...]:
    """Return the zones of an SU2 text file; their parts are located and counted, but not read.

    ``zone``: the only one to return, from 1; None: all. Raises MeshError if the file has a mistake.
    """
    lines = scan(raw, progress)
    sections = find_blocks(lines)
    zones = find_bounds(lines, sections, zone)
    return tuple(Text(lines, find_zone(lines, sections, bounds), sections) for bounds in zones)


def boundaries_elsewhere(text: Text, progress: Tick) -> Iterator[tuple[int, str, FloatArray]]:
    """Yield zone, name and nodes (k, d) of each boundary of the other zones, as far as readable.

    ``progress`` is called with 1 while they are read; it may raise to stop.
    """
    lines = text.lines
    sections = text.sections
    zone = text.zone
    for bounds in find_bounds(lines, sections):
        if bounds.number == zone.bounds.number:
            continue
        try:
            other = find_zone(lines, sections, bounds)
            if other.dim == zone.dim:
                yield from _boundaries_of(lines, other, lambda _: progress(1.0))
        except MeshError:  # the zone that is asked for can be right all the same
            continue


def _boundaries_of(
    lines: Lines, zone: TextZone, progress: Tick
) -> Iterator[tuple[int, str, FloatArray]]:
    count = number_of(zone.points)
    nodes = {
        part.name: parse_cells(lines, part.rows, zone.dim - 1, count, progress).nodes
        for part in zone.markers
    }

    def blocks() -> Iterator[tuple[int, FloatArray]]:  # not all points of the zone at once
        for piece in zone.points:
            points = np.empty((piece.rows, zone.dim))
            fill_points(lines, piece, points)
            progress(1.0)
            yield piece.row, points

    for name, points in points_of_nodes(blocks(), nodes).items():
        if len(points):
            yield zone.bounds.number, name, points


def scan(raw: Source, progress: Tick) -> Lines:
    """Return the lines of an SU2 file.

    Raises MeshError if the file is empty or not text. ``raw``: the file. ``progress``: called with
    the fraction done after each block; may raise to stop.
    """

    def scanned(bounds: FirstAndEnd) -> tuple[IntArray, int, bool]:
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

    found = []
    line = 0
    blank = True
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


def _blocks(raw: Source) -> list[FirstAndEnd]:
    bounds = []
    begin = 0
    while begin < raw.size:
        end = line_end(raw, min(begin + BLOCK_BYTES, raw.size) - 1)
        bounds.append((begin, end))
        begin = end
    return bounds
