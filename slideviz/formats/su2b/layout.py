"""The layout of an SU2 binary mesh (``.su2b``): at which byte of the file each part begins.

The file begins with two integers of 4 bytes: the width of all further counts and indices (4 or 8
bytes, in either byte order) and the number of zones. Then it has for each zone number, dimension,
elements, points and markers. Elements are an array of offsets, and a list with type, nodes and
(not for markers) index of each. Each count is compared with the size of the file before an array is
made by it, so that a file that is cut off or was changed costs no memory.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from threading import Lock
from typing import BinaryIO, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slideviz.argument_types import frozen
from slideviz.errors import MeshError, Message, printable
from slideviz.formats.su2.lines import chosen_zones

NAME_BYTES = 33  # bytes of the name of a marker, padded with zeros
SEND_RECEIVE = "SEND_RECEIVE"
"""Name of the markers of a halo (in `su2.text`, too), which this format cannot have."""
_INT = 4  # bytes of the integers that are not counts: numbers of zones and markers, dimension
MAGIC = {
    np.array(width, f"{order}i4").tobytes(): (width, order) for width in (4, 8) for order in "<>"
}
"""Width of counts and byte order ("<" or ">"), by the first four bytes of a file."""


@frozen
class ElementTable:
    """Where the elements of a zone or marker are in the file."""

    count: int  # number of elements
    offsets: int
    entries: int  # `offsets`, `entries`: first byte of the offsets, and of the list
    length: int  # how many numbers the list has
    numbered: bool  # whether each element ends with its index


@frozen
class MarkerPlace:
    """A marker: its name, the ``NAME_BYTES`` bytes of the name in the file, its elements."""

    name: str
    raw: bytes
    elements: ElementTable


@frozen
class ZonePlace:
    """Where a zone is in the file."""

    number: int  # number of the zone, from 1
    begin: int
    end: int  # `begin`, `end`: its first byte, and the one after its last
    dim: int  # 2 or 3
    cells: ElementTable  # its cells
    n_points: int
    points: int  # `n_points`, `points`: number of points, and the first byte of the first
    markers: tuple[MarkerPlace, ...]  # its markers


class BinaryFile:
    """An open ``.su2b`` file: reads arrays, from any thread, and makes errors that name the byte.

    Raises MeshError if the file does not begin as an SU2 binary mesh.
    """

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.name = printable(path)  # for messages
        self._file = file
        self._lock = Lock()
        self.size = os.fstat(file.fileno()).st_size
        """Number of bytes."""
        head = file.read(2 * _INT)
        if head[:_INT] not in MAGIC:
            raise self.error(
                0,
                "this is not an SU2 binary mesh, which begins with 4 or 8 in four bytes, not with "
                f"{head[:_INT].hex(' ') or 'nothing'}; give the file the ending of its format",
            )
        self.width, sign = MAGIC[head[:_INT]]
        """Bytes of a count or an index, 4 or 8."""
        self.order: Literal["<", ">"] = "<" if sign == "<" else ">"
        """The byte order."""
        self.zones = self.integer(_INT, "the number of zones")
        """Number of zones by its head."""
        if self.zones < 1:
            raise self.error(_INT, f"the number of zones is {self.zones}, but at least 1 is needed")

    def of(self, file: BinaryIO) -> BinaryFile:
        """Return this object for another open file of the same layout, whose head is not read."""
        other = copy(self)
        other._file = file
        other._lock = Lock()
        return other

    @property
    def conn(self) -> np.dtype:
        """Return the data type of counts and indices."""
        return np.dtype(f"{self.order}u{self.width}")

    def point(self, dim: int) -> np.dtype:
        """Return the data type of a point: coordinates ``x`` (dim,) and its index ``i``."""
        return np.dtype([("x", f"{self.order}f8", (dim,)), ("i", self.conn)])

    def error(self, offset: int, message: str) -> MeshError:
        """Return the error ``file: byte n: message``."""
        return MeshError(Message(message, place=(self.name, f"byte {offset}")))

    def require(self, offset: int, count: int, width: int, what: str) -> int:
        """Return the byte after ``count`` items of ``width`` bytes that begin at byte ``offset``.

        ``what`` names the items in the message. Raises MeshError if the file ends before that byte.
        """
        end = offset + count * width
        if end > self.size:
            raise self.error(
                offset,
                f"{what} ({count} times {width} bytes) should be here, but the file ends at byte "
                f"{self.size}; it is cut off or the count is wrong, so write it again",
            )
        return end

    def array(self, offset: int, count: int, dtype: DTypeLike, what: str) -> NDArray:
        """Return the ``count`` items of type ``dtype`` that begin at byte ``offset``.

        ``what`` names the items in the message. Raises MeshError if the file ends before the last
        item, or cannot be read.
        """
        kind = np.dtype(dtype)
        self.require(offset, count, kind.itemsize, what)
        try:
            with self._lock:
                self._file.seek(offset)
                array = np.fromfile(self._file, kind, count)
        except OSError as problem:
            raise self.error(offset, f"cannot be read: {problem}; check the disk") from problem
        if len(array) != count:
            raise self.error(
                offset, f"{what}: the file became shorter while it was read; read again"
            )
        return array

    def bytes(self, begin: int, end: int) -> bytes:
        """Return the bytes ``begin`` to ``end - 1``."""
        return self.array(begin, end - begin, np.uint8, "the zones").tobytes()

    def integer(self, offset: int, what: str) -> int:
        """Return the integer of four bytes at byte ``offset``."""
        return int(self.array(offset, 1, f"{self.order}i4", what)[0])

    def count(self, offset: int, what: str) -> int:
        """Return the count or index, of ``width`` bytes, at byte ``offset``."""
        return int(self.array(offset, 1, self.conn, what)[0])


def find_zones(source: BinaryFile, number: int | None = None) -> tuple[ZonePlace, ...]:
    """Return where the zones of a file are: all of them, or the one of a number, from 1.

    Raises MeshError if a part goes beyond the end of the file, a number is wrong, bytes follow the
    last zone, or there is no zone of that number.
    """
    zones: list[ZonePlace] = []
    offset = 2 * _INT
    while len(zones) < source.zones:
        zones.append(_zone(source, offset, len(zones) + 1))
        offset = zones[-1].end
    if offset != source.size:
        raise source.error(
            offset,
            f"{source.size - offset} bytes follow the last of the {source.zones} zones, where the "
            "file should end; correct the number of zones (byte 4) or write the mesh again",
        )
    return tuple(zones[k - 1] for k in chosen_zones(source.name, number, len(zones)))


@contextmanager
def open_zones(
    path: Path, number: int | None
) -> Iterator[tuple[BinaryFile, tuple[ZonePlace, ...]]]:
    """Context with an open file, and where its zones are (see `find_zones`)."""
    with path.open("rb") as file:
        source = BinaryFile(path, file)
        yield source, find_zones(source, number)


def _zone(source: BinaryFile, begin: int, number: int) -> ZonePlace:
    """Return where zone ``number`` is, which begins at byte ``begin``; raise as `find_zones`."""
    index = source.integer(begin, f"the number of zone {number}")
    if index != number:
        raise source.error(
            begin, f"zone {number} has the number {index}; zones are numbered from 1, so correct it"
        )
    dim = source.integer(begin + _INT, "the dimension")
    if dim not in (2, 3):
        raise source.error(begin + _INT, f"the dimension is {dim}, but must be 2 or 3; correct it")
    cells = _elements(source, begin + 2 * _INT, "elements", dim + 3, numbered=True)
    offset = cells.entries + cells.length * source.width
    n_points = source.count(offset, "the number of points")
    points = offset + source.width
    offset = source.require(points, n_points, source.point(dim).itemsize, "the points")
    count = source.integer(offset, "the number of markers")
    if count < 0:
        raise source.error(offset, f"the number of markers is {count}, but must not be negative")
    offset += _INT
    source.require(offset, count, NAME_BYTES + 2 * source.width, "the markers")
    markers: dict[str, MarkerPlace] = {}
    for _ in range(count):
        marker = _marker(source, offset, dim)
        if marker.name in markers:
            raise source.error(
                offset, f"marker {marker.name} occurs a second time; rename one of them"
            )
        markers[marker.name] = marker
        offset = marker.elements.entries + marker.elements.length * source.width
    return ZonePlace(number, begin, offset, dim, cells, n_points, points, tuple(markers.values()))


def _marker(source: BinaryFile, offset: int, dim: int) -> MarkerPlace:
    raw = source.array(offset, NAME_BYTES, np.uint8, "the name of a marker").tobytes()
    text, end, _ = raw.partition(b"\0")
    try:
        name = text.decode()
    except UnicodeDecodeError:
        name = ""
    if not name or not end or not name.isprintable():
        what = "is not ended by a zero" if not end else "is empty or not printable UTF-8 text"
        raise source.error(
            offset,
            f"the marker name {text.decode('utf-8', 'backslashreplace')!r} {what}; {NAME_BYTES} "
            "bytes are for it, padded with zeros, so correct it or write the mesh again",
        )
    if name.upper() == SEND_RECEIVE:
        raise source.error(
            offset,
            f"SU2 binary meshes cannot have {name} markers (halos); write the mesh without them",
        )
    what = f"elements of marker {name}"
    elements = _elements(source, offset + NAME_BYTES, what, dim + 1, numbered=False)
    return MarkerPlace(name, raw, elements)


def _elements(
    source: BinaryFile, offset: int, what: str, fewest: int, *, numbered: bool
) -> ElementTable:
    """Return the table of elements that begins at byte ``offset``, or raise MeshError.

    ``what`` names the elements in messages, ``fewest`` is the least count of numbers of an element.
    """
    count = source.count(offset, f"the number of {what}")
    offsets = offset + source.width
    entries = source.require(offsets, count + 1, source.width, f"the offsets of the {what}")
    last = entries - source.width
    length = source.count(last, f"the last offset of the {what}")
    source.require(entries, length, source.width, f"the list of the {what}")
    if length < count * fewest:
        raise source.error(
            last,
            f"{count} {what} have a list of {length} numbers, but each needs at least {fewest}; "
            "the file is damaged, so write the mesh again",
        )
    return ElementTable(count, offsets, entries, length, numbered)
