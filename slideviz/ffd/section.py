"""The boxes of an SU2 mesh file, in its section ``FFD_NBOX=``: read, and written back.

Of a box that moved only the rows that changed are written anew: the rest of the file keeps its
bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.errors import CaseError, MeshError
from slideviz.ffd.box import Box, Index, plane_corners, regular_box
from slideviz.mesh.io.su2.read import Document
from slideviz.mesh.io.su2.sections import is_ffd
from slideviz.mesh.model import FloatArray, IntArray, Mesh

_LETTERS = "IJK"
_BOXES: WeakKeyDictionary[Mesh, tuple[Box, ...]] = WeakKeyDictionary()


@dataclass
class _Entry:
    """A keyword line, and the rows that follow it, as words."""

    value: str
    line: int
    rows: list[tuple[int, list[str]]] = field(default_factory=list)


_Entries = dict[str, _Entry]


def boxes_of(mesh: Mesh) -> tuple[Box, ...]:
    """Return the boxes of a mesh, in the order of its file.

    Raises
    ------
    MeshError
        The section has a mistake, or nested boxes, which are not supported.
    """
    if mesh not in _BOXES:
        entries = _boxes(_lines(mesh))
        boxes = tuple(_Reader(mesh, one).box() for one in entries)
        names = [box.name for box in boxes]
        for name in names:
            if names.count(name) > 1:
                raise MeshError(f"{mesh.name}: the FFD box {name!r} stands twice; rename one")
        _BOXES[mesh] = boxes
    return _BOXES[mesh]


def with_boxes(mesh: Mesh, boxes: Sequence[Box], *, anew: bool = False) -> Mesh:
    """Return the mesh whose SU2 file has these boxes, as SU2 writes them.

    Parameters
    ----------
    mesh : Mesh
    boxes : sequence of Box
        Those that changed, and new ones; others stay.
    anew : bool
        Whether the boxes that it had, if any, are dropped.
    """
    lines = [] if anew else _lines(mesh)
    entries = _boxes(lines)
    by_name = {box.name: box for box in boxes}
    for one in reversed(entries):  # from below, so that the lines above keep their numbers
        box = by_name.pop(one["FFD_TAG"].value, None)
        if box is not None:
            _update(lines, one, box)
    if not entries:
        lines = [f"FFD_NBOX= {len(boxes)}\n", "FFD_NLEVEL= 1\n"]
    elif by_name:
        at = next(at for at, line in enumerate(lines) if _key(line) == "FFD_NBOX")
        lines[at] = f"FFD_NBOX= {len(entries) + len(by_name)}\n"
    for box in by_name.values():
        lines += _written(box, mesh.dim)
    text = "".join(lines).encode("utf-8", "surrogateescape")
    text = text if text.endswith(b"\n") else text + b"\n"
    return replace(mesh, origin=replace(mesh.origin, ffd=text))


def _lines(mesh: Mesh) -> list[str]:
    """Return the lines of the section, with their ends."""
    origin = mesh.origin
    if origin.ffd is not None:
        text = origin.ffd
    elif isinstance(origin, Document):
        parts = (origin.raw[a:b] for a, b in origin.kept)
        text = b"".join(part for part in parts if is_ffd(part))
    else:
        text = b""
    return [line.decode("utf-8", "surrogateescape") for line in text.splitlines(keepends=True)]


def _key(line: str) -> str:
    head, sign, _ = line.partition("%")[0].partition("=")
    return head.strip().upper() if sign else ""


def _boxes(lines: list[str]) -> list[_Entries]:
    """Return the keyword lines of each box, with their rows."""
    found: list[_Entries] = []
    entry = None
    for number, line in enumerate(lines):
        text = line.partition("%")[0]
        if key := _key(line):
            entry = _Entry(text.partition("=")[2].strip(), number)
            if key == "FFD_TAG":
                found.append({})
            if found:
                found[-1][key] = entry
        elif entry is not None and (words := text.replace(",", " ").split()):
            entry.rows.append((number, words))
    return found


class _Reader:
    """Reads one box, and tells what is wrong with it."""

    def __init__(self, mesh: Mesh, entries: _Entries) -> None:
        self.mesh, self.entries = mesh, entries
        self.name = entries["FFD_TAG"].value

    def box(self) -> Box:
        """Return the box."""
        for key in ("FFD_LEVEL", "FFD_PARENTS", "FFD_CHILDREN"):
            if key in self.entries and self.count(key):
                raise self.error(f"{key} is {self.count(key)}: nested boxes are not supported")
        flat = self.mesh.dim == 2
        letters = _LETTERS[: self.mesh.dim]
        i, j, k = (*(self.count(f"FFD_DEGREE_{letter}") for letter in letters), 1)[:3]
        degrees = i, j, k
        corners = self.numbers("FFD_CORNER_POINTS", 4 if flat else 8, self.mesh.dim)
        corners = plane_corners(corners) if flat else corners
        try:
            box = regular_box(self.name, corners, degrees, self.orders(letters))
        except CaseError as problem:
            raise self.error(str(problem)) from problem
        if self.count("FFD_CONTROL_POINTS"):
            box = replace(box, points=self.control_points(degrees))
        if "FFD_SURFACE_POINTS" in self.entries and self.count("FFD_SURFACE_POINTS"):
            box = replace(box, embedded=self.surface_points())
        return box

    def orders(self, letters: str) -> Index | None:
        """Return the orders of the B-splines, or None."""
        entry = self.entries.get("FFD_BLENDING")
        kind = "BEZIER" if entry is None else entry.value.upper()
        if kind == "BEZIER":
            return None
        if kind != "BSPLINE_UNIFORM":
            raise self.error(f"FFD_BLENDING is {kind}; needed is BEZIER or BSPLINE_UNIFORM")
        keys = [f"BSPLINE_ORDER_{letter}" for letter in letters]
        keys = [key if key in self.entries else f"FFD_{key}" for key in keys]
        i, j, k = (*(self.count(key) for key in keys), 2)[:3]
        return i, j, k

    def control_points(self, degrees: tuple[int, ...]) -> FloatArray:
        """Return the control points (I, J, K, 3), each of which must be there once."""
        shape = tuple(degree + 1 for degree in degrees)
        rows = self.numbers("FFD_CONTROL_POINTS", int(np.prod(shape)), 6)
        index = rows[:, :3]
        points = np.full((*shape, 3), np.nan)
        whole = (index == np.floor(index)) & (index >= 0) & (index <= degrees)
        if whole.all():
            points[tuple(index.astype(int).T)] = rows[:, 3:]
        if np.isnan(points).any():
            limits = ", ".join(map(str, degrees))
            raise self.error(
                "FFD_CONTROL_POINTS must have each (i, j, k) from (0, 0, 0) to "
                f"({limits}) once; write the boxes again with DV_KIND= FFD_SETTING"
            )
        return points

    def surface_points(self) -> dict[str, tuple[IntArray, FloatArray]]:
        """Return nodes and parametric coordinates on each marker, sorted by node."""
        key, part = "FFD_SURFACE_POINTS", self.mesh.part
        n_points = len(self.mesh.points) if part is None else part.n_points
        rows = self.rows(key, self.count(key))
        on: dict[str, list[list[str]]] = {}
        for words in rows:
            on.setdefault(words[0], []).append(words[1:])
        found = {}
        for marker, tails in on.items():
            table = self.table(key, tails, 4)
            nodes = table[:, 0].astype(np.int64)
            bad = (nodes != table[:, 0]) | (nodes < 0) | (nodes >= n_points)
            if bad.any():
                raise self.error(f"{key} names node {tails[int(np.argmax(bad))][0]}, which is none")
            nodes, first = np.unique(nodes, return_index=True)
            if part is not None:  # which has all nodes of markers
                inside = np.isin(nodes, part.points)
                nodes, first = np.searchsorted(part.points, nodes[inside]), first[inside]
            found[marker] = nodes, table[first, 1:]
        return found

    def count(self, key: str) -> int:
        """Return the whole number after a key."""
        word = (self.entry(key).value.split() or [""])[0]
        if not word.isdecimal():
            raise self.error(f"{key}= {word} is no whole number from 0")
        return int(word)

    def numbers(self, key: str, count: int, width: int) -> FloatArray:
        """Return the rows of numbers (count, width) after a key."""
        if self.count(key) != count:
            raise self.error(f"{key} is {self.count(key)}; needed is {count}")
        return self.table(key, self.rows(key, count), width)

    def rows(self, key: str, count: int) -> list[list[str]]:
        """Return the words of the rows after a key, which must be so many."""
        rows = [words for _, words in self.entry(key).rows]
        if len(rows) != count:
            raise self.error(f"{len(rows)} rows follow {key}= {count}; correct the count")
        return rows

    def table(self, key: str, rows: list[list[str]], width: int) -> FloatArray:
        """Return rows of words as numbers, (rows, width)."""
        try:
            table = np.array([[float(word) for word in words] for words in rows])
        except ValueError:
            table = np.empty(0)
        if table.shape != (len(rows), width) or not np.isfinite(table).all():
            raise self.error(f"a row of {key} has not the numbers that it needs")
        return table

    def entry(self, key: str) -> _Entry:
        """Return the line of a key."""
        if key not in self.entries:
            raise self.error(f"{key}= is missing")
        return self.entries[key]

    def error(self, sentence: str) -> MeshError:
        """Return the error about the box."""
        return MeshError(f"{self.mesh.name}: FFD box {self.name!r}: {sentence}")


def _update(lines: list[str], entries: _Entries, box: Box) -> None:
    """Write the control points of a box into its lines, and where there are none, all of it."""
    surface = entries.get("FFD_SURFACE_POINTS")
    if surface is not None and not surface.rows and box.embedded:
        lines[surface.line : surface.line + 1] = _surface_lines(box)
    control = entries["FFD_CONTROL_POINTS"]
    if not control.rows:
        lines[control.line : control.line + 1] = _control_lines(box.points)
    for number, words in control.rows:
        i, j, k = (int(word) for word in words[:3])
        if [float(word) for word in words[3:]] != box.points[i, j, k].tolist():
            ending = lines[number][len(lines[number].rstrip("\r\n")) :]
            lines[number] = _control_row(box.points, i, j, k) + ending


def _written(box: Box, dim: int) -> Iterator[str]:
    """Yield all lines of a box."""
    letters = _LETTERS[:dim]
    yield f"FFD_TAG= {box.name}\nFFD_LEVEL= 0\n"
    for letter, degree in zip(letters, box.degrees, strict=False):
        yield f"FFD_DEGREE_{letter}= {degree}\n"
    yield f"FFD_BLENDING= {'BSPLINE_UNIFORM' if box.orders else 'BEZIER'}\n"
    for letter, order in zip(letters, box.orders or (), strict=False):
        yield f"BSPLINE_ORDER_{letter}= {order}\n"
    corners = box.corners[: 4 if dim == 2 else 8, :dim]
    yield f"FFD_PARENTS= 0\nFFD_CHILDREN= 0\nFFD_CORNER_POINTS= {len(corners)}\n"
    yield from (_tabbed(corner) + "\n" for corner in corners.tolist())
    yield from _control_lines(box.points)
    yield from _surface_lines(box)


def _control_lines(points: FloatArray) -> Iterator[str]:
    yield f"FFD_CONTROL_POINTS= {points[..., 0].size}\n"
    for index in np.ndindex(points.shape[:3]):
        yield _control_row(points, *index) + "\n"


def _control_row(points: FloatArray, i: int, j: int, k: int) -> str:
    return f"{i}\t{j}\t{k}\t" + _tabbed(points[i, j, k].tolist())


def _surface_lines(box: Box) -> Iterator[str]:
    yield f"FFD_SURFACE_POINTS= {sum(len(nodes) for nodes, _ in box.embedded.values())}\n"
    for marker, (nodes, uvw) in box.embedded.items():
        for node, at in zip(nodes.tolist(), uvw.tolist(), strict=True):
            yield f"{marker}\t{node}\t{_tabbed(at)}\n"


def _tabbed(values: Sequence[float]) -> str:
    return "\t".join(repr(value) for value in values)
