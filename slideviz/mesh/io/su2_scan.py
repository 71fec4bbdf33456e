"""The lines of an SU2 file: where each begins, how many words it has, which hold a keyword.

All of it is found with array operations on blocks of a few megabytes, so that a large file takes
a fraction of a second, and another thread gets its turn between two blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.mesh.model import IntArray

BLOCK_BYTES = 1 << 20
Progress = Callable[[float], object]

_BOM = b"\xef\xbb\xbf"
_NUMERIC = np.zeros(256, bool)
_NUMERIC[list(b"+-.0123456789")] = True


@dataclass(frozen=True, eq=False)
class Lines:
    """The lines of a file, numbered from 0 (messages count from 1).

    Attributes
    ----------
    name : str
        The file, for messages.
    clean : bytes
        The content with comments blanked out, byte for byte as long as the file.
    starts : (m + 1,) int64
        Line ``i`` is ``clean[starts[i]:starts[i + 1]]``.
    words : (m,) int64
        Number of words on each line; 0 on a blank line or a comment.
    numeric : (m,) bool
        Whether the first word begins as a number does.
    equals : (e,) int64
        The lines that have an equals sign and are not numeric, in order.
    """

    name: str
    clean: bytes
    starts: IntArray
    words: IntArray
    numeric: NDArray[np.bool_]
    equals: IntArray

    def __len__(self) -> int:
        return len(self.words)

    def line(self, index: int) -> bytes:
        """Return the bytes of a line, comments blanked."""
        return self.clean[self.starts[index] : self.starts[index + 1]]

    def error(self, index: int, message: str) -> MeshError:
        """Return the error ``file:line: message`` for a line."""
        return MeshError(f"{self.name}:{index + 1}: {message}")


def show(word: bytes) -> str:
    """Return a word of the file as it can stand in a message: short and printable."""
    text = word.decode("utf-8", "backslashreplace")
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text[:80])
    return text if len(text) <= 40 else text[:37] + "..."


def scan(data: bytes, name: str, progress: Progress) -> Lines:
    """Return the lines of an SU2 file.

    Parameters
    ----------
    data : bytes
        The content of the file.
    name : str
        The file, for messages.
    progress : callable
        Called with the fraction done after each block; may raise to stop.

    Raises
    ------
    MeshError
        The file is empty or not text.
    """
    if not data.strip():
        raise MeshError(f"{name}: the file is empty; write the mesh again")
    if b"\0" in data:
        raise MeshError(
            f"{name}: this is not a text file; slideviz reads the ASCII form of SU2 meshes, "
            "so write the mesh as ASCII"
        )
    cleaned, found = [], []
    for begin, end in _blocks(data):
        block = _without_comments(data[begin:end])
        if begin == 0 and block.startswith(_BOM):
            block = b"   " + block[len(_BOM) :]
        cleaned.append(block)
        found.append(_scan_block(block, begin))
        progress(end / len(data))
    starts, words, numeric, has_equals = (np.concatenate(part) for part in zip(*found, strict=True))
    return Lines(
        name,
        b"".join(cleaned),
        np.append(starts, len(data)),
        words,
        numeric,
        np.flatnonzero(has_equals & ~numeric & (words > 0)),
    )


def _blocks(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the bounds of blocks of whole lines."""
    begin = 0
    while begin < len(data):
        newline = data.find(b"\n", min(begin + BLOCK_BYTES, len(data)) - 1)
        end = newline + 1 if newline >= 0 else len(data)
        yield begin, end
        begin = end


def _without_comments(block: bytes) -> bytes:
    """Return the block with every comment (from ``%`` to the end of the line) as blanks."""
    at = block.find(b"%")
    if at < 0:
        return block
    parts, done = [], 0
    while at >= 0:
        stop = block.find(b"\n", at)
        stop = len(block) if stop < 0 else stop
        parts += [block[done:at], b" " * (stop - at)]
        done = stop
        at = block.find(b"%", stop)
    return b"".join([*parts, block[done:]])


def _scan_block(
    block: bytes, begin: int
) -> tuple[IntArray, IntArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return start, number of words, numeric and has-equals of each line of a block."""
    codes = np.frombuffer(block, np.uint8)
    firsts = word_bounds(codes)[0]
    starts = np.concatenate(([0], np.flatnonzero(codes == ord("\n")) + 1))
    if starts[-1] == len(codes):
        starts = starts[:-1]
    before = np.searchsorted(firsts, starts)
    words = np.diff(np.append(before, len(firsts)))
    numeric = np.zeros(len(starts), bool)
    used = words > 0
    numeric[used] = _NUMERIC[codes[firsts[before[used]]]]
    has_equals = np.zeros(len(starts), bool)
    has_equals[np.searchsorted(starts, np.flatnonzero(codes == ord("=")), "right") - 1] = True
    return starts + begin, words, numeric, has_equals


def word_bounds(codes: NDArray[np.uint8]) -> tuple[IntArray, IntArray]:
    """Return the first byte (w,) and the byte after the last (w,) of every word."""
    edge = np.diff((codes > ord(" ")).view(np.int8), prepend=np.int8(0), append=np.int8(0))
    return np.flatnonzero(edge == 1), np.flatnonzero(edge == -1)
