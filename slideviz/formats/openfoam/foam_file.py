"""Files of OpenFOAM: header, lists of numbers (ASCII, binary, compressed), and the boundary.

A list is ``N(...)``, or ``N{value}`` if all values are equal. Each face is ``4(0 1 2 3)`` in ASCII;
in binary, faces are a list of offsets and one of nodes (``faceCompactList``).
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from functools import partial
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slideviz.argument_types import frozen, record
from slideviz.errors import MeshError, path_error, shown
from slideviz.formats.source import unreadable
from slideviz.mesh.model import IntArray, offsets_of
from slideviz.system.file_checks import require_regular_file

UNPACKED = 200
"""Most bytes that a byte of a compressed file is unpacked to, besides `_SPARE`."""
_SPARE = 1 << 20
LARGEST_FACE = 100
"""Most nodes of a face: the time to divide one is in proportion to the third power of them."""
# Every repetition is possessive, and what is not closed goes on to the end: so no file makes them
# try again and again.
_REMARK = rb"//[^\n]*+|/\*(?>.*?(?:\*/|\Z))"
_GAP = rb"(?>\s++|" + _REMARK + rb")*+"
_HEADER = re.compile(_GAP + rb"FoamFile\s*+\{([^}]*+)\}", re.DOTALL)
_LIST = re.compile(_GAP + rb"(\d{1,18})\s*+([({])", re.DOTALL)
_WORDS = re.compile(r"\"[^\"]*+\"|[{}();]|[^\s{}();\"]++|\"")
_COMMENT = re.compile(_REMARK, re.DOTALL)
_BARE = bytes.maketrans(b"()", b"  ")


@frozen
class Patch:
    """An entry of the file ``boundary``: the faces ``start`` to ``start + count``."""

    name: str
    kind: str  # its ``type``
    start: int
    count: int


@record
class FoamFile:
    """The bytes of a file of OpenFOAM, and what its header says of them."""

    path: Path
    data: bytes  # unpacked
    begin: int  # where its content begins
    binary: bool
    kind: str  # its ``class``
    label: np.dtype
    scalar: np.dtype  # `label`, `scalar`: the types of numbers in a binary file

    def fault(self, rule: str) -> MeshError:
        """Return the error ``path: rule`` with a remedy."""
        return path_error(self.path, f"{rule}; write the mesh again with OpenFOAM")

    def _list(self, begin: int) -> tuple[int, bool, int]:
        """Return the length of the list at ``begin``, whether it is uniform, where it starts."""
        found = _LIST.match(self.data, begin)
        if found is None:
            text = _COMMENT.sub(b"", self.data[begin : begin + 999]).strip().decode("latin-1")
            raise self.fault(f"expected a list, N(...), found {shown(text)}")
        return int(found[1]), found[2] == b"{", found.end()

    def _parsed(self, text: bytes, dtype: DTypeLike) -> NDArray:
        """Return the numbers (n,) of a text."""
        if b"/" in text:
            text = _COMMENT.sub(b" ", text)
        try:
            return np.fromstring(text, dtype, sep=" ") if text.strip() else np.empty(0, dtype)
        except ValueError as problem:
            raise self.fault("its list has something else than numbers") from problem

    def numbers(self, dtype: np.dtype, width: int = 1, begin: int = -1) -> tuple[NDArray, slice]:
        """Return a list of numbers (n, width), and the bytes of the file that hold them.

        Raises MeshError if there is no list at ``begin``, or its length is wrong.
        """
        items, uniform, first = self._list(self.begin if begin < 0 else begin)
        count = items * width
        if self.binary and not uniform:
            last = first + count * dtype.itemsize
            if self.data[last : last + 1] != b")":
                raise self.fault(
                    f"its list of {items} does not end after {count} numbers of "
                    f"{8 * dtype.itemsize} bits"
                )
            return np.frombuffer(self.data, dtype, count, first).reshape(-1, width), slice(
                first, last
            )
        ends = b"}" if uniform else b")"
        last = self.data.rfind(ends) if width > 1 else self.data.find(ends, first)
        values = self._parsed(self.data[first : max(last, first)].translate(_BARE), dtype)
        if uniform and len(values) == width and count <= _SPARE:
            values = np.tile(values, items)
        if len(values) != count or last < first:
            raise self.fault(f"its list says {items}, but has {len(values) // width}")
        return values.reshape(-1, width), slice(first, last)

    def labels(self, begin: int = -1) -> tuple[IntArray, int]:
        """Return a list of labels (n,), and where it ends; MeshError as `numbers`."""
        values, place = self.numbers(self.label, 1, begin)
        return values[:, 0].astype(np.int64), place.stop + 1

    def faces(self) -> tuple[IntArray, IntArray]:
        """Return the offsets (f + 1,) and nodes (k,) of the faces; MeshError as `numbers`."""
        if self.kind == "faceCompactList":
            offsets, end = self.labels()
            nodes, _ = self.labels(end)
            if not len(offsets) or offsets[0] or offsets[-1] != len(nodes):
                raise self.fault(f"its offsets do not lead from 0 to the {len(nodes)} nodes")
        elif self.binary:
            raise self.fault(f"is a binary {self.kind}; expected a faceCompactList")
        else:
            count, _, first = self._list(self.begin)
            text = self.data[first : self.data.rfind(b")")]
            # A mark that no label can be, before the nodes of each face.
            text = text.replace(b"(", b" -1 ").replace(b")", b" ")
            values = self._parsed(text, np.int64)
            marks = np.flatnonzero(values == -1)
            if len(marks) != count or (count and marks[0] != 1):
                raise self.fault(f"its list says {count} faces, but has {len(marks)}")
            sizes = np.append(marks[1:] - 1, len(values)) - marks - 1
            if (sizes != values[marks - 1]).any():
                wrong = int(np.argmax(sizes != values[marks - 1]))
                raise self.fault(f"face {wrong} has another number of nodes than it says")
            offsets = offsets_of(sizes)
            nodes = np.delete(values, np.concatenate([marks, marks - 1]))
        sizes = np.diff(offsets)
        if (sizes < 3).any():
            raise self.fault(f"face {np.argmax(sizes < 3)} has fewer than 3 nodes")
        if (sizes > LARGEST_FACE).any():
            raise self.fault(
                f"face {np.argmax(sizes)} has {sizes.max():,} nodes, more than {LARGEST_FACE}"
            )
        return offsets, nodes

    def patches(self) -> list[Patch]:
        """Return the patches of a file ``boundary``; raises MeshError if it is wrong."""
        text = _COMMENT.sub(b" ", self.data[self.begin :]).decode("utf-8", "backslashreplace")
        count, _, body = text.partition("(")
        patches = []
        words = (word[0] for word in _WORDS.finditer(body))
        for name in iter(partial(next, words, ")"), ")"):
            entries = _entries(takewhile(lambda word: word != "}", words))
            try:
                start = int(entries["startFace"])
                faces = int(entries["nFaces"])
                patches.append(Patch(name.strip('"'), entries["type"], start, faces))
            except (KeyError, ValueError) as problem:
                raise self.fault(
                    f"patch {shown(name)} has no type, nFaces, or startFace"
                ) from problem
        if count.strip() != str(len(patches)):
            raise self.fault(
                f"its list says {shown(count.strip())}, but has {len(patches)} patches"
            )
        return patches


def read_foam_file(path: Path) -> FoamFile:
    """Return a file of OpenFOAM, unpacked; a ``.gz`` file in its place if there is none.

    Raises MeshError if it cannot be read, has no header, or is unpacked to far more than it has.
    """
    packed = path.with_name(f"{path.name}.gz")
    path = packed if packed.exists() and not path.exists() else path
    try:
        require_regular_file(path, MeshError)
        data = path.read_bytes()
    except (OSError, ValueError) as problem:
        raise unreadable(path, problem) from problem
    if data[:2] == b"\x1f\x8b":
        data = _unpacked(path, data)
    header = _HEADER.match(data)
    if header is None:
        raise path_error(path, "has no header FoamFile { ... }; expected a file of OpenFOAM")
    entries = _entries(word[0] for word in _WORDS.finditer(header[1].decode("latin-1")))
    arch = entries.get("arch", "")
    order = ">" if "MSB" in arch else "<"
    label = 8 if "label=64" in arch else 4
    scalar = 4 if "scalar=32" in arch else 8
    return FoamFile(
        path,
        data,
        header.end(),
        entries.get("format") == "binary",
        entries.get("class", ""),
        np.dtype(f"{order}i{label}"),
        np.dtype(f"{order}f{scalar}"),
    )


def _entries(words: Iterable[str]) -> dict[str, str]:
    """Return the entries ``key value;`` of a dictionary by their keys: the first word of each."""
    entries = {}
    entry: list[str] = []
    for word in words:
        if word not in ";{":
            entry.append(word)
            continue
        if word == ";" and len(entry) > 1:
            entries[entry[0]] = entry[1]
        entry = []
    return entries


def _unpacked(path: Path, data: bytes) -> bytes:
    """Return the content of a compressed file."""
    most = UNPACKED * len(data) + _SPARE
    unpacker = zlib.decompressobj(wbits=31)
    try:
        content = unpacker.decompress(data, most)
    except zlib.error as problem:
        raise path_error(path, f"cannot be unpacked ({problem}); write it again") from problem
    if not unpacker.eof:
        raise path_error(
            path,
            f"is cut off, or unpacks to more than {UNPACKED} times its size; write it again",
        )
    return content
