"""The lines of an SU2 file: where its keywords are, and how many rows of numbers follow each.

In memory are only entries for each line of text and each block of the file. All else is read from
the file again when it is needed. A *row* is a line that begins with a number; an element or a point
is on each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from slideviz.errors import MeshError, printable
from slideviz.formats.source import Source
from slideviz.mesh.model import IntArray

_BOM = b"\xef\xbb\xbf"
"""The byte order mark of UTF-8."""
_NUMERIC = tuple(b"%c" % code for code in b"+-.0123456789")
"""Bytes that a number may begin with."""
_BLANKS = bytes(range(33))
"""Bytes before the first word of a line: blanks and control characters."""
_LINE_BYTES = 256
"""Bytes that are searched for the end of a line at first."""


@dataclass(frozen=True)
class Piece:
    """A piece of the file with consecutive rows of one section."""

    begin: int
    end: int
    """`begin`, `end`: its bytes, whole lines; those that are no rows are blank, comments or
    text."""
    line: int
    """Number of its first line in the file."""
    row: int
    rows: int
    """`row`, `rows`: number of its first row in the section, and number of rows."""
    node: int
    nodes: int
    """`node`, `nodes`: if the rows are elements: the number of nodes in the section before it, and
    in it."""


Rows = tuple[Piece, ...]
"""All rows of a section, in pieces."""


def number_of(rows: Rows) -> int:
    """Return the number of rows of a section."""
    return rows[-1].row + rows[-1].rows if rows else 0


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of a file, numbered from 0 (in messages from 1), as runs.

    A run is a line of text with the rows, blank lines and comments after it. With each block of the
    file a new run begins, which may have no line of text.
    """

    raw: Source
    """The file."""
    begins: IntArray
    firsts: IntArray
    """`begins`, `firsts` (m + 1,): first byte and number of the first line of each run; last the
    size and number of lines of the file."""
    kinds: IntArray
    """(m,): ``ROWS``, ``TEXT`` or ``KEYWORD``, by the first line of each run."""
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

    def bytes_of(self, *ranges: tuple[int, int]) -> tuple[tuple[int, int], ...]:
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
        at, size = at + size, 2 * size
    return raw.size


def text_of(raw: Source, begin: int, end: int) -> bytes:
    """Return the bytes ``begin`` to ``end``, whole lines, with a line break at the end.

    A byte order mark at the begin of the file is replaced by blanks.
    """
    text = raw[begin:end]
    if begin == 0 and text.startswith(_BOM):
        text = b" " * len(_BOM) + text[len(_BOM) :]
    return text if text.endswith(b"\n") else text + b"\n"
