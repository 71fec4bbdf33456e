"""The lines of an SU2 file, its keyword lines (``KEY= value``), and the zones these divide it into.

In memory are only entries for each line of text and each block of the file. All else is read from
the file again when it is needed. A *row* is a line that begins with a number; an element or a point
is on each. A section is a keyword line with all lines up to the next one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from difflib import get_close_matches
from itertools import islice

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import MeshError, printable
from slideviz.formats.source import Source
from slideviz.formats.su2 import KEYWORD
from slideviz.mesh.model import IntArray

FirstAndEnd = tuple[int, int]  # of bytes or rows

_KEY = re.compile(rb"[A-Za-z_]\w*")
_COUNT = re.compile(rb"\+?\d{1,18}")  # the value of a key that counts
KNOWN = ("NZONE", "IZONE", "NDIME", "NELEM", "NPOIN", "NMARK", "MARKER_TAG", "MARKER_ELEMS")
"""Keys of the sections that slideviz reads; all others are copied as they are."""
ALIASES = {"MARKERTAG": "MARKER_TAG"}  # other spellings of keys that SU2 reads


def is_ffd(text: bytes) -> bool:
    """Return whether a section (its text or key) is of boxes for free-form deformation."""
    return text.lstrip()[:14].upper().startswith((b"FFD_", b"BSPLINE_ORDER_"))


@frozen
class KeywordBlock:
    """A section: key (in capitals) and value, its keyword line, and the next one ``stop``.

    For the last section ``stop`` is the number of lines of the file. ``spelt`` is the key as the
    file has it (in capitals), which `ALIASES` may have.
    """

    key: str
    value: bytes
    line: int
    stop: int
    spelt: str = ""


@frozen
class Bounds:
    """The lines ``begin:end``, without ``IZONE``, of zone ``number`` (from 1) of ``zones``."""

    number: int
    zones: int
    begin: int
    end: int


def find_blocks(lines: Lines) -> list[KeywordBlock]:
    """Return all sections of the file, in order."""
    heads = []
    for index in lines.firsts[:-1][lines.kinds == KEYWORD].tolist():
        key, _, value = lines.line(index).partition(b"=")
        if _KEY.fullmatch(key.strip()):
            spelt = key.strip().decode().upper()
            heads.append((ALIASES.get(spelt, spelt), value.strip(), index, spelt))
    stops = [line for _, _, line, _ in heads] + [len(lines)]
    return [
        KeywordBlock(key, value, line, stop, spelt)
        for (key, value, line, spelt), stop in zip(heads, stops[1:], strict=True)
    ]


def find_bounds(
    lines: Lines, sections: list[KeywordBlock], number: int | None = None
) -> tuple[Bounds, ...]:
    """Return the lines of the zones of a file: of all, or of the one of a number, from 1.

    Raises MeshError if this is not an SU2 mesh, there is no such zone, or the zones are not
    numbered 1, 2, and so on.
    """
    if not any(section.key in KNOWN for section in sections):
        raise MeshError(
            f"{lines.name}: this is not an SU2 mesh: NDIME=, NELEM= and NPOIN= are missing; choose "
            "the mesh file, or give the file the ending of its format"
        )
    heads = _zone_heads(lines, sections)
    zones = max(len(heads), 1)
    chosen = chosen_zones(lines.name, number, zones)
    if zones == 1:
        return (Bounds(1, 1, 0, len(lines)),)
    ends = [*sorted(head.line for head in heads.values()), len(lines)]
    begins = [(k, heads[k].line) for k in chosen]
    return tuple(Bounds(k, zones, at + 1, ends[ends.index(at) + 1]) for k, at in begins)


def chosen_zones(name: str, number: int | None, zones: int) -> range:
    """Return the numbers of a file's zones, or ``number`` alone; MeshError if there is none.

    ``name`` is that of the file, for the message.
    """
    if number is None:
        return range(1, zones + 1)
    if not 1 <= number <= zones:
        has = "one zone" if zones == 1 else f"the zones 1 to {zones}"
        raise MeshError(
            f"{name}: there is no zone {number}; the file has {has}; choose one of these"
        )
    return range(number, number + 1)


def boxes_elsewhere(sections: list[KeywordBlock], bounds: Bounds) -> dict[str, int]:
    """Return the zone of each FFD box, by name, in other zones than that of ``bounds``."""
    found = {}
    zone = 1
    for section in sections:
        if section.key == "IZONE":
            zone = int(section.value.split()[0])
        elif section.key == "FFD_TAG" and zone != bounds.number and bounds.zones > 1:
            found[section.value.decode("utf-8", "replace")] = zone
    return found


def _zone_heads(lines: Lines, sections: list[KeywordBlock]) -> dict[int, KeywordBlock]:
    """Return the ``IZONE`` section of each zone by number; empty if the file has no zones.

    Raises MeshError if ``NZONE`` and the ``IZONE`` lines contradict each other.
    """
    totals = [s for s in sections if s.key == "NZONE"]
    heads: dict[int, KeywordBlock] = {}
    for section in sections:
        if section.key != "IZONE":
            continue
        number = count_of(lines, section)
        if number in heads:
            raise lines.error(
                section.line,
                f"IZONE= {number} occurs twice (first on line {heads[number].line + 1}); number "
                "the zones one by one",
            )
        heads[number] = section
    if not totals:
        if len(heads) > 1:
            second = list(heads.values())[1]
            raise lines.error(
                second.line,
                f"a second zone begins, but there is no NZONE; put NZONE= {len(heads)} on the "
                "first line",
            )
        return {}
    total = count_of(lines, totals[0])
    if total == 1 and not heads:
        return {}
    if sorted(heads) != list(range(1, len(heads) + 1)) or len(heads) != total:
        present = ", ".join(map(str, list(heads)[:8])) or "none"
        raise lines.error(
            totals[0].line,
            f"NZONE= {total} needs the lines IZONE= 1 to IZONE= {total}, each once, but the file "
            f"has {present}; correct NZONE or restore the missing zone",
        )
    return heads


def misspelt(sections: list[KeywordBlock], key: str) -> str:
    """Return the words for a message that an unknown keyword may mean ``key``; "" if none may."""
    for section in sections:
        if section.key not in KNOWN and get_close_matches(section.key, [key], cutoff=0.8):
            return f"; line {section.line + 1} has {section.key}=, did you mean {key}=?"
    return ""


def count_of(lines: Lines, section: KeywordBlock) -> int:
    """Return the count after the keyword, ignoring further words; MeshError if it is wrong."""
    word = (section.value.split() or [b""])[0]
    if not _COUNT.fullmatch(word):
        raise lines.error(
            section.line,
            f"{section.key}= {show(word)} is not a count; write a whole number from 0",
        )
    return int(word)


_BOM = b"\xef\xbb\xbf"  # the byte order mark of UTF-8
_NUMERIC = tuple(b"%c" % code for code in b"+-.0123456789")  # bytes that a number may begin with
_BLANKS = bytes(range(33))  # bytes before the first word of a line: blanks and control characters
_LINE_BYTES = 256  # bytes that are searched for the end of a line at first


@frozen
class Piece:
    """A piece of the file with consecutive rows of one section."""

    begin: int
    end: int
    """`begin`, `end`: its bytes, whole lines; those that are not rows are blank, comments or
    text."""
    line: int  # number of its first line in the file
    row: int
    rows: int  # `row`, `rows`: number of its first row in the section, and number of rows
    node: int
    nodes: int
    """`node`, `nodes`: if the rows are elements: the number of nodes in the section before it, and
    in it."""


Rows = tuple[Piece, ...]  # all rows of a section, in pieces


def number_of(rows: Rows) -> int:
    """Return the number of rows of a section."""
    return rows[-1].row + rows[-1].rows if rows else 0


@record
class Lines:
    """The lines of a file, numbered from 0 (in messages from 1), as runs.

    A run is a line of text with the rows, blank lines and comments after it. With each block of the
    file a new run begins, which may have no line of text.
    """

    raw: Source  # the file
    begins: IntArray
    firsts: IntArray
    """`begins`, `firsts` (m + 1,): first byte and number of the first line of each run; last the
    size and number of lines of the file."""
    kinds: IntArray  # (m,): ``ROWS``, ``TEXT`` or ``KEYWORD``, by the first line of each run
    rows: IntArray
    nodes: IntArray
    """`rows`, `nodes` (m,): numbers of rows in each run, and of nodes on them if they are
    elements."""

    @property
    def name(self) -> str:
        """Return the path of the file as text for messages."""
        return printable(self.raw.path)

    def __len__(self) -> int:
        return int(self.firsts[-1])

    def byte(self, index: int) -> int:
        """Return the first byte of line ``index``; the size of the file after the last line."""
        run = int(np.searchsorted(self.firsts, index, "right")) - 1
        begin = int(self.begins[run])
        for _ in range(index - int(self.firsts[run])):
            begin = line_end(self.raw, begin)
        return begin

    def bytes_of(self, *ranges: FirstAndEnd) -> tuple[FirstAndEnd, ...]:
        """Return first byte and end of each of ``ranges`` of lines (first, end)."""
        return tuple((self.byte(a), self.byte(b)) for a, b in ranges)

    def line(self, index: int) -> bytes:
        """Return the text of line ``index`` without comment."""
        begin = self.byte(index)
        return text_of(self.raw, begin, line_end(self.raw, begin)).partition(b"%")[0]

    def pieces(self, line: int, stop: int) -> Rows:
        """Return the rows from ``line`` to ``stop``, both lines of text (or ``stop`` the end)."""
        first, last = np.searchsorted(self.firsts, [line, stop])
        ends_of_rows = np.cumsum(self.rows[first:last])
        ends_of_nodes = np.cumsum(self.nodes[first:last])
        return tuple(
            Piece(
                begin=int(self.begins[run]),
                end=int(self.begins[run + 1]),
                line=int(self.firsts[run]),
                row=int(ends_of_rows[run - first] - self.rows[run]),
                rows=int(self.rows[run]),
                node=int(ends_of_nodes[run - first] - self.nodes[run]),
                nodes=int(self.nodes[run]),
            )
            for run in range(first, last)
            if self.rows[run]
        )

    def text(self, piece: Piece) -> bytes:
        """Return the lines of a piece, each with its line break."""
        return text_of(self.raw, piece.begin, piece.end)

    def numeric(self, piece: Piece) -> Iterator[tuple[int, bytes]]:
        """Yield line number and text, without comment, of each row of a piece."""
        for index, line in enumerate(self.text(piece).split(b"\n"), piece.line):
            row = line.partition(b"%")[0].lstrip(_BLANKS)
            if row.startswith(_NUMERIC):
                yield index, row

    def row(self, pieces: Rows, number: int) -> int:
        """Return the line number of row ``number`` of a section."""
        piece = next(piece for piece in pieces if number < piece.row + piece.rows)
        line = next(islice(self.numeric(piece), number - piece.row, None), None)
        if line is None:
            raise self.raw.changed()
        return line[0]

    def error(self, index: int, message: str) -> MeshError:
        """Return the error ``file:line: message`` for line ``index``, shown as counted from 1."""
        return MeshError(f"{self.name}:{index + 1}: {message}")


def show(word: bytes) -> str:
    """Return a word of the file for a message: printable, at most 40 characters."""
    text = word.decode("utf-8", "backslashreplace")
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[:80])
    return text if len(text) <= 40 else text[:37] + "..."


def line_end(raw: Source, at: int) -> int:
    """Return the end, behind its line break, of the line that contains byte ``at``."""
    size = _LINE_BYTES
    while at < raw.size:
        newline = raw[at : at + size].find(b"\n")
        if newline >= 0:
            return at + newline + 1
        at = at + size
        size = 2 * size
    return raw.size


def text_of(raw: Source, begin: int, end: int) -> bytes:
    """Return the bytes ``begin`` to ``end``, whole lines, with a line break at the end.

    A byte order mark at the begin of the file is replaced by blanks.
    """
    text = raw[begin:end]
    if begin == 0 and text.startswith(_BOM):
        text = b" " * len(_BOM) + text[len(_BOM) :]
    return text if text.endswith(b"\n") else text + b"\n"
