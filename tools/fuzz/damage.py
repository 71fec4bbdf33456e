"""Changes of bytes and lines that damage a file, drawn by a random generator."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence

import numpy as np

Rng = np.random.Generator

_EXTREMES = """
0 -1 1 2 3 7 9 14 255 256 65536 2147483647 2147483648 4294967295 -2147483648
9223372036854775807 9223372036854775808 18446744073709551616 1e30 1e308 -1e308 1e309 1e-308 5e-324
-0.0 nan -nan inf -inf 1e999999999 0x10 1_000 1d5 1.5e 1e+ .5 5. +3 --3 \u0663 1,5
"""
NUMBERS = (*_EXTREMES.split(), "9" * 400, "0." + "0" * 400 + "1")
"""Numbers at the ends of what programs can hold, and texts that nearly are numbers."""
_SIGNS = """
NDIME= NELEM= NPOIN= NMARK= MARKER_TAG= MARKER_ELEMS= NZONE= IZONE= SEND_TO= NCHUNK= %
( ) ((( ))) ; , : = = == " ' / ../.. * NONE AUTO yes no NaN none () {} <> & # $ |
%s%n%d /dev/zero /dev/stdin .. . é 叶 ÿ
"""
WORDS = (
    *_SIGNS.split(),
    *("\ufeff", "\u2028", "\x00", "\x1a", "\t", "\r", "\r\n", "\x0b", "\\", ""),
    "A" * 5000,
    "(" * 3000,
)
"""Words that readers give a meaning, or that have none."""
_BITS = (8, 16, 32, 64)
WHOLE = (0, 1, *(2**k - 1 for k in _BITS), *(2 ** (k - 1) for k in _BITS), 0x7FFFFFFF, 2**63 - 1)
"""Whole numbers at the ends of their types."""
_TOKEN = re.compile(rb"[^\s,;()=<>\"]+")


def damaged(rng: Rng, content: bytes, others: Sequence[bytes], text: bool) -> bytes:
    """Return the content of a file with one to four changes.

    ``others``: contents of the same kind, of which parts are taken. ``text``: whether most changes
    are of lines and words.
    """
    for _ in range(int(rng.integers(1, 5)) if rng.random() < 0.4 else 1):
        table = LINES if text and rng.random() < 0.8 else BYTES
        content = table[int(rng.integers(len(table)))](rng, content, others)
    return content[: 1 << 20]


def _place(rng: Rng, content: bytes) -> int:
    return int(rng.integers(len(content) + 1))


def _cut(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    return content[: _place(rng, content)]


def _flip(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    out = bytearray(content or b"\0")
    for _ in range(int(rng.integers(1, 9))):
        out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def _overwrite(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    place = _place(rng, content)
    number = WHOLE[int(rng.integers(len(WHOLE)))]
    size = int(rng.choice([1, 2, 4, 8]))
    order = "little" if rng.random() < 0.7 else "big"
    bits = (number % (1 << 8 * size)).to_bytes(size, order)  # type: ignore[arg-type]
    if rng.random() < 0.2:
        bits = struct.pack("<d", float(rng.choice([np.nan, np.inf, 1e308, -1e308, 5e-324])))
    return content[:place] + bits + content[place + len(bits) :]


def _zeros(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    first, last = sorted((_place(rng, content), _place(rng, content)))
    last = min(last, first + 512)
    return content[:first] + bytes(last - first) + content[last:]


def _remove(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    first = _place(rng, content)
    return content[:first] + content[first + int(rng.integers(1, 64)) :]


def _insert(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    place = _place(rng, content)
    return content[:place] + rng.bytes(int(rng.integers(1, 64))) + content[place:]


def _repeat(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    first, last = sorted((_place(rng, content), _place(rng, content)))
    return content[:last] + content[first:last] + content[last:]


def _splice(rng: Rng, content: bytes, others: Sequence[bytes]) -> bytes:
    other = others[int(rng.integers(len(others)))]
    return content[: _place(rng, content)] + other[_place(rng, other) :]


def _lines(content: bytes) -> list[bytes]:
    return content.splitlines(keepends=True) or [b""]


def _remove_line(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    lines = _lines(content)
    first = int(rng.integers(len(lines)))
    del lines[first : first + (1 if rng.random() < 0.7 else int(rng.integers(1, 20)))]
    return b"".join(lines)


def _repeat_line(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    lines = _lines(content)
    line = lines[int(rng.integers(len(lines)))]
    lines.insert(int(rng.integers(len(lines) + 1)), line)
    return b"".join(lines)


def _swap_lines(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    lines = _lines(content)
    a, b = (int(k) for k in rng.integers(len(lines), size=2))
    lines[a], lines[b] = lines[b], lines[a]
    return b"".join(lines)


def _other_line(rng: Rng, content: bytes, others: Sequence[bytes]) -> bytes:
    lines = _lines(content)
    more = _lines(others[int(rng.integers(len(others)))])
    lines.insert(int(rng.integers(len(lines) + 1)), more[int(rng.integers(len(more)))])
    return b"".join(lines)


def _change_token(rng: Rng, content: bytes, new: bytes) -> bytes:
    tokens = list(_TOKEN.finditer(content))
    if not tokens:
        return new
    token = tokens[int(rng.integers(len(tokens)))]
    return content[: token.start()] + new + content[token.end() :]


def _number(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    return _change_token(rng, content, NUMBERS[int(rng.integers(len(NUMBERS)))].encode())


def _word(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    return _change_token(rng, content, WORDS[int(rng.integers(len(WORDS)))].encode())


def _other_token(rng: Rng, content: bytes, others: Sequence[bytes]) -> bytes:
    tokens = _TOKEN.findall(others[int(rng.integers(len(others)))])
    return _change_token(rng, content, tokens[int(rng.integers(len(tokens)))] if tokens else b"")


def _digit(rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    digits = [match.start() for match in re.finditer(rb"\d", content)]
    if not digits:
        return content
    place = digits[int(rng.integers(len(digits)))]
    return content[:place] + str(int(rng.integers(10))).encode() + content[place + 1 :]


def _windows(_rng: Rng, content: bytes, _others: Sequence[bytes]) -> bytes:
    return content.replace(b"\r\n", b"\n").replace(b"\n", b"\r\n")


Change = Callable[[Rng, bytes, Sequence[bytes]], bytes]
BYTES: tuple[Change, ...] = (
    _cut, _flip, _overwrite, _zeros, _remove, _insert, _repeat, _splice,
)  # fmt: skip
LINES: tuple[Change, ...] = (
    _remove_line, _repeat_line, _swap_lines, _other_line, _number, _number, _word, _other_token,
    _digit, _digit, _windows, _cut,
)  # fmt: skip
"""Changes of bytes, and of lines and words."""
