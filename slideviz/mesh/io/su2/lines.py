"""The lines of an SU2 file: where its keywords are, and how many rows of numbers follow each.

What is kept is small: an entry for each line of text and each block of the file. Everything else
is read again where it is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from slideviz.errors import MeshError
from slideviz.mesh.check import printable
from slideviz.mesh.io.source import Source
from slideviz.mesh.model import IntArray

ROWS, TEXT, KEYWORD = 0, 1, 2
"""What a run begins with: rows of numbers or nothing, other text, text with an equals sign."""
_BOM = b"\xef\xbb\xbf"
_NUMERIC = tuple(b"%c" % code for code in b"+-.0123456789")
_BLANKS = bytes(range(33))
_LINE_BYTES = 256


@dataclass(frozen=True)
class Piece:
    """Some of the rows of a section, and where they are.

    Attributes
    ----------
    begin, end : int
        The bytes of the file in which they are, whole lines; other lines there have no numbers.
    line : int
        The number of the first line.
    row, rows : int
        The number of the first row in the section, and how many there are.
    node, nodes : int
        The number of the first node in the section, and how many there are, if these are cells.
    """

    begin: int
    end: int
    line: int
    row: int
    rows: int
    node: int
    nodes: int


Rows = tuple[Piece, ...]
"""The rows of numbers of a section."""


def number_of(rows: Rows) -> int:
    """Return how many rows these are."""
    return rows[-1].row + rows[-1].rows if rows else 0


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of a file, numbered from 0 (messages count from 1), as runs.

    A run is a line of text and the rows of numbers, blank lines and comments after it. Another
    run begins with each block of the file.

    Attributes
    ----------
    raw : Source
        The file.
    begins, firsts : (m + 1,) int64
        First byte and number of the first line of each run, and those after the last.
    kinds : (m,) int64
        What a run begins with: ``ROWS``, ``TEXT`` or ``KEYWORD``.
    rows, nodes : (m,) int64
        Rows of numbers in each run, and nodes on them, if they are elements.
    """

    raw: Source
    begins: IntArray
    firsts: IntArray
    kinds: IntArray
    rows: IntArray
    nodes: IntArray

    @property
    def name(self) -> str:
        """Return the file, for messages."""
        return printable(self.raw.path)

    def __len__(self) -> int:
        return int(self.firsts[-1])

    def byte(self, index: int) -> int:
        """Return the first byte of a line; for the number of lines, the size of the file."""
        run = int(np.searchsorted(self.firsts, index, "right")) - 1
        begin = int(self.begins[run])
        for _ in range(index - int(self.firsts[run])):
            begin = line_end(self.raw, begin)
        return begin

    def bytes_of(self, *ranges: tuple[int, int]) -> tuple[tuple[int, int], ...]:
        """Return the bounds in bytes of ranges of lines."""
        return tuple((self.byte(a), self.byte(b)) for a, b in ranges)

    def line(self, index: int) -> bytes:
        """Return the text of a line without comment."""
        begin = self.byte(index)
        return text_of(self.raw, begin, line_end(self.raw, begin)).partition(b"%")[0]

    def pieces(self, line: int, stop: int) -> Rows:
        """Return where the rows of numbers from one text or keyword line to another are."""
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
        """Yield number and text of each row of numbers, without comment."""
        for index, line in enumerate(self.text(piece).split(b"\n"), piece.line):
            row = line.partition(b"%")[0].lstrip(_BLANKS)
            if row.startswith(_NUMERIC):
                yield index, row

    def row(self, pieces: Rows, number: int) -> int:
        """Return the number of the line of a row of numbers."""
        piece = next(piece for piece in pieces if number < piece.row + piece.rows)
        found = next(islice(self.numeric(piece), number - piece.row, None), None)
        if found is None:
            raise self.raw.changed()
        return found[0]

    def error(self, index: int, message: str) -> MeshError:
        """Return the error ``file:line: message`` for a line."""
        return MeshError(f"{self.name}:{index + 1}: {message}")


def show(word: bytes) -> str:
    """Return a word of the file as it can stand in a message: short and printable."""
    text = word.decode("utf-8", "backslashreplace")
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[:80])
    return text if len(text) <= 40 else text[:37] + "..."


def line_end(raw: Source, at: int) -> int:
    """Return the byte after the line that has this byte."""
    size = _LINE_BYTES
    while at < raw.size:
        newline = raw[at : at + size].find(b"\n")
        if newline >= 0:
            return at + newline + 1
        at, size = at + size, 2 * size
    return raw.size


def text_of(raw: Source, begin: int, end: int) -> bytes:
    """Return whole lines, the last with a line break, the byte order mark as blanks."""
    text = raw[begin:end]
    if begin == 0 and text.startswith(_BOM):
        text = b" " * len(_BOM) + text[len(_BOM) :]
    return text if text.endswith(b"\n") else text + b"\n"
