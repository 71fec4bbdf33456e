"""The parts of one zone of an SU2 file, by their lines, counted and checked.

Sections that slideviz does not know (FFD boxes, periodic data, offsets) and the halo markers are
only located, so that writing can keep them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slideviz.mesh.io.su2.keyword_blocks import (
    KNOWN,
    Bounds,
    KeywordBlock,
    count_of,
    is_ffd,
    misspelt,
)
from slideviz.mesh.io.su2.lines import ROWS, Lines, Rows, number_of, show

SEND_RECEIVE = "SEND_RECEIVE"
_NAME_IT = "; name the marker"
_COUNT_THEM = "; add it with the number of elements"


class SectionRows:
    """The rows of numbers, and the lines of other text, of each section of a file."""

    def __init__(self, lines: Lines) -> None:
        self.lines = lines
        self.text_lines = lines.firsts[:-1][lines.kinds != ROWS]

    def none(self, section: KeywordBlock) -> None:
        """Raise when a section that should have no numbers has some.

        Raises
        ------
        MeshError
            It has some.
        """
        rows = self.lines.pieces(section.line, section.stop)
        if rows:
            raise self.lines.error(
                self.lines.row(rows, 0),
                f"numbers stand here after {section.key}= {show(section.value)}, where none "
                "belong; remove the line or restore the keyword before it",
            )

    def counted(self, section: KeywordBlock, what: str) -> Rows:
        """Return the rows of numbers of a section.

        Parameters
        ----------
        what : str
            What stands on each line, for messages.

        Raises
        ------
        MeshError
            They are not as many as the number after the keyword says.
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
                f"'{show(word)}' stands where one of the {count} {what} should be ({section.key} "
                f"on line {section.line + 1}); correct it",
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
                f"more {what} stand here than {section.key}= {count} (line {section.line + 1}) "
                f"says: {found}; correct the count",
            )
        return rows


@dataclass(frozen=True, eq=False)
class MarkerRows:
    """A boundary: its name, the line of the name, and the rows of its elements."""

    name: str
    line: int
    rows: Rows


@dataclass(frozen=True, eq=False)
class SendRows:
    """A ``SEND_RECEIVE`` marker: its lines ``begin:end``, ``SEND_TO`` and its rows."""

    begin: int
    end: int
    domain: bytes
    rows: Rows


@dataclass(frozen=True, eq=False)
class TextZone:
    """Where the parts of one zone stand.

    Attributes
    ----------
    bounds : Bounds
        Which zone, and its lines.
    dim : int
        2 or 3.
    elements, points : tuple of Piece
        The rows of the elements and of the points.
    markers : tuple of MarkerRows
        The boundaries.
    sends : tuple of SendRows
        The ``SEND_RECEIVE`` markers, which tie the nodes of a halo.
    kept : tuple of KeywordBlock
        The unknown sections.
    """

    bounds: Bounds
    dim: int
    elements: Rows
    points: Rows
    markers: tuple[MarkerRows, ...]
    sends: tuple[SendRows, ...]
    kept: tuple[KeywordBlock, ...]

    @property
    def ffd_at(self) -> tuple[range, ...]:
        """Return the lines of the boxes for free-form deformation."""
        boxes = (part for part in self.kept if is_ffd(part.key.encode()))
        return tuple(range(part.line, part.stop) for part in boxes)


def find_zone(lines: Lines, sections: list[KeywordBlock], bounds: Bounds) -> TextZone:
    """Return where the parts of a zone stand.

    Raises
    ------
    MeshError
        A section is missing or stands twice, a count is wrong, or a marker has no good name.
    """
    inside = [
        section
        for section in sections
        if bounds.begin <= section.line < bounds.end and section.key not in ("NZONE", "IZONE")
    ]
    return _Walk(lines, inside, bounds).zone()


class _Walk:
    """A walk through the sections of one zone, which notes where its parts stand."""

    def __init__(self, lines: Lines, sections: list[KeywordBlock], bounds: Bounds) -> None:
        self.lines = lines
        self.sections = sections
        self.bounds = bounds
        self.rows = SectionRows(lines)

    def zone(self) -> TextZone:
        """Return where the parts stand."""
        heads = {key: self._only(key) for key in ("NDIME", "NELEM", "NPOIN", "NMARK")}
        dim = count_of(self.lines, heads["NDIME"])
        if dim not in (2, 3):
            raise self.lines.error(
                heads["NDIME"].line, f"NDIME= {dim} is not possible; write 2 or 3"
            )
        self.rows.none(heads["NDIME"])
        elements = self.rows.counted(heads["NELEM"], "elements")
        points = self.rows.counted(heads["NPOIN"], "points")
        for key, rows in (("NELEM", elements), ("NPOIN", points)):
            if not rows:
                raise self.lines.error(
                    heads[key].line, f"{key}= 0 leaves nothing to work on; export the volume mesh"
                )
        self.rows.none(heads["NMARK"])
        markers, sends, kept = self._walk()
        self._check_markers(heads["NMARK"], markers, len(sends))
        return TextZone(
            bounds=self.bounds,
            dim=dim,
            elements=elements,
            points=points,
            markers=markers,
            sends=sends,
            kept=kept,
        )

    def _only(self, key: str) -> KeywordBlock:
        """Return the section of that key, which must stand once."""
        found = [section for section in self.sections if section.key == key]
        if not found:
            remedy = "; write NMARK= 0 if it has no boundaries" if key == "NMARK" else ""
            meant = misspelt(self.sections, key)
            why = "" if meant else "; perhaps the file is cut off, so write it again" + remedy
            raise self.lines.error(
                self.bounds.end - 1,
                f"the mesh ends here, but has no line {key}={meant}{why}",
            )
        if len(found) > 1:
            raise self.lines.error(
                found[1].line,
                f"{key}= stands a second time (first on line {found[0].line + 1}); remove one, "
                "or number the zones with NZONE= and IZONE=",
            )
        return found[0]

    def _walk(
        self,
    ) -> tuple[tuple[MarkerRows, ...], tuple[SendRows, ...], tuple[KeywordBlock, ...]]:
        """Return the boundaries, the SEND_RECEIVE markers and the unknown sections."""
        markers, sends, kept = [], [], []
        at = 0
        while at < len(self.sections):
            section = self.sections[at]
            at += 1
            if section.key == "MARKER_TAG":
                name = self._name(section)
                head, domain, at = self._marker_head(section, at, name == SEND_RECEIVE)
                rows = self.rows.counted(head, f"elements of marker {name}")
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
                kept.append(section)
        return tuple(markers), tuple(sends), tuple(kept)

    def _marker_head(
        self, tag: KeywordBlock, at: int, sends: bool
    ) -> tuple[KeywordBlock, bytes, int]:
        """Return the MARKER_ELEMS section of a marker, SEND_TO, and the place after them."""
        self.rows.none(tag)
        following = self.sections[at] if at < len(self.sections) else None
        if following is None or following.key != "MARKER_ELEMS":
            raise self.lines.error(
                tag.line,
                f"marker {show(tag.value)} is not followed by MARKER_ELEMS="
                + (misspelt(self.sections[at : at + 1], "MARKER_ELEMS") or _COUNT_THEM),
            )
        at, domain = at + 1, b""
        if sends and at < len(self.sections) and self.sections[at].key == "SEND_TO":
            # The elements stand after this line, which belongs to the marker.
            self.rows.none(following)
            head = self.sections[at]
            following = KeywordBlock(following.key, following.value, head.line, head.stop)
            at, domain = at + 1, head.value
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
        """Raise when names repeat or the count is wrong."""
        seen: dict[str, int] = {}
        for marker in markers:
            if marker.name in seen:
                raise self.lines.error(
                    marker.line,
                    f"marker {marker.name} stands a second time (first on line "
                    f"{seen[marker.name] + 1}); rename or merge them",
                )
            seen[marker.name] = marker.line
        count = count_of(self.lines, head)
        if count != len(markers) + sends:
            raise self.lines.error(
                head.line,
                f"NMARK= {count} says {count} markers, but {len(markers) + sends} follow; correct "
                "the count or restore the missing markers",
            )
