"""The boxes of an SU2 mesh file, in its section ``FFD_NBOX=``: read, and written back.

Only rows of control points that changed are written anew; the rest of the section keeps its bytes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from math import isfinite

import numpy as np

from slideviz.errors import CaseError, MeshError
from slideviz.ffd.box import (
    CARTESIAN,
    Box,
    CoordinateSystem,
    Index,
    given_of_polar,
    plane_corners,
    polar_corners,
    regular_box,
)
from slideviz.formats.su2.lines import is_ffd
from slideviz.formats.su2.read import Document
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, Skin, ZonePart
from slideviz.mesh.zones import names_from, names_in, require_one_zone, with_zones, zones_of
from slideviz.system.grouping import grouped
from slideviz.system.weak_cache import WeakCache

_LETTERS = "IJK"
_FARTHEST = 10.0  # largest parametric coordinate of a point in a box, which goes from 0 to 1
Row = tuple[int, list[str]]  # a line of numbers: its place in the section, from 0, and its words


@dataclass
class BoxEntry:
    """A keyword line of a box: its value, its place in the section, and the rows that follow it."""

    value: str
    line: int
    rows: list[Row] = field(default_factory=list)


Entries = dict[str, BoxEntry]  # the keyword lines of a box, by key


def read_boxes(mesh: Mesh, lines: list[str], system: CoordinateSystem) -> tuple[Box, ...]:
    """Return the boxes in the lines of a section, in a coordinate system; or raise MeshError."""
    entries = entries_of(lines)
    readers = [_Reader(mesh, one, system) for one in entries]
    boxes = tuple(reader.box() for reader in readers)
    names = [box.name for box in boxes]
    for k, name in enumerate(names):
        if name in names[:k]:
            line = entries[k]["FFD_TAG"].line
            raise _error(mesh, line, f"the FFD box {name!r} is defined twice; rename one")
    _require_count(mesh, lines, names)
    levels = next((_value(line) for line in lines if key_of(line) == "FFD_NLEVEL"), "1")
    for reader in readers:
        reader.check_tags(names)
    for reader, box in zip(readers, boxes, strict=True):
        reader.check_nesting(box, boxes, int(levels) if levels.isdecimal() else 1)
    return boxes


def _require_count(mesh: Mesh, lines: list[str], names: list[str]) -> None:
    """Raise MeshError where ``FFD_NBOX=`` is missing or is not the number of boxes that follow."""
    entries = [(at, line) for at, line in enumerate(lines) if key_of(line) == "FFD_NBOX"]
    if not entries:
        if names:
            raise _error(
                mesh, 0, f"FFD_NBOX= is missing; write FFD_NBOX= {len(names)} before the FFD boxes"
            )
        return
    at, line = entries[0]
    word = _value(line)
    if not word.isdecimal() or int(word) != len(names):
        has = f"{len(names)} ({', '.join(names)})" if names else "none"
        raise _error(mesh, at, f"FFD_NBOX= {word}, but the file has {has}; correct it")


def _error(mesh: Mesh, line: int, why: str) -> MeshError:
    at = next(islice(chain.from_iterable(mesh.origin.ffd_at), line, None), None)
    place = mesh.name if at is None else f"{mesh.name}:{at + 1}"
    return MeshError(f"{place}: {why}")


def key_of(line: str) -> str:
    """Return the key of a keyword line, in capitals; an empty text for other lines."""
    head, sign, _ = line.partition("%")[0].partition("=")
    return head.strip().upper() if sign else ""


def _value(line: str) -> str:
    return line.partition("%")[0].partition("=")[2].strip()


def entries_of(lines: list[str]) -> list[Entries]:
    """Return the keyword lines of each box, with their rows."""
    entries: list[Entries] = []
    entry = None
    for number, line in enumerate(lines):
        text = line.partition("%")[0]
        if key := key_of(line):
            entry = BoxEntry(_value(line), number)
            if key == "FFD_TAG":
                entries.append({})
            if entries:
                entries[-1][key] = entry
        elif entry is not None and (words := text.replace(",", " ").split()):
            entry.rows.append((number, words))
    return entries


class _Reader:
    """Reads one box from its lines; all methods raise MeshError for a mistake."""

    def __init__(self, mesh: Mesh, entries: Entries, system: CoordinateSystem) -> None:
        self.mesh = mesh
        self.entries = entries
        self.system = system
        self.name = entries["FFD_TAG"].value

    def box(self) -> Box:
        """Return the box."""
        flat = self.mesh.dim == 2
        letters = _LETTERS[: self.mesh.dim]
        i, j, k = (*(self.count(f"FFD_DEGREE_{letter}") for letter in letters), 1)[:3]
        corners = self.numbers("FFD_CORNER_POINTS", 4 if flat else 8, self.mesh.dim)
        orders = self.orders(letters)
        if flat and self.is_polar():
            j, k = k, j
            corners = polar_corners(corners)
            orders = orders and (orders[0], orders[2], orders[1])
        elif flat:
            corners = plane_corners(corners)
        degrees = i, j, k
        try:
            box = regular_box(self.name, corners, degrees, orders, self.system)
        except CaseError as problem:
            raise self.error(str(problem)) from problem
        if self.count("FFD_CONTROL_POINTS"):
            box = replace(box, points=self.control_points(degrees))
        if "FFD_SURFACE_POINTS" in self.entries and self.count("FFD_SURFACE_POINTS"):
            box = replace(box, embedded=self.surface_points())
        level = self.count("FFD_LEVEL") if "FFD_LEVEL" in self.entries else 0
        return replace(box, level=level, parent=(*self.tags("FFD_PARENTS"), "")[0])

    def is_polar(self) -> bool:
        """Return whether a box in 2D is one in polar coordinates: its second direction is k."""
        entry = self.entries.get("FFD_CONTROL_POINTS")
        rows = () if entry is None else entry.rows
        return self.system.kind == "POLAR" or any((*row, "", "0")[2] > "1" for _, row in rows)

    def tags(self, key: str) -> tuple[str, ...]:
        """Return the names of the boxes in the rows after a key; () without it."""
        if key not in self.entries:
            return ()
        return tuple(" ".join(words) for _, words in self.rows(key, self.count(key)))

    def check_tags(self, names: list[str]) -> None:
        """Raise MeshError where a parent or child is not among the names of the boxes."""
        for name in (*self.tags("FFD_PARENTS"), *self.tags("FFD_CHILDREN")):
            if name not in names:
                raise self.error(f"there is no FFD box {name!r}, only {', '.join(names)}")

    def check_nesting(self, box: Box, boxes: tuple[Box, ...], levels: int) -> None:
        """Raise MeshError where SU2 could not deform a nested box with those around it."""
        by_name = {each.name: each for each in boxes}
        parents = self.tags("FFD_PARENTS")
        if len(parents) > 1:
            why = f"FFD_PARENTS is {len(parents)}; supported is one parent"
            raise self.error(why, "FFD_PARENTS")
        if box.level >= levels:
            why = f"FFD_LEVEL is {box.level}; FFD_NLEVEL must be larger, and is {levels}"
            raise self.error(why, "FFD_LEVEL")
        if parents and box.level <= by_name[box.parent].level:
            why = f"FFD_LEVEL is {box.level}, not above the level of its parent {box.parent!r}"
            raise self.error(f"{why}; make it larger", "FFD_LEVEL")
        inner = {each.name for each in boxes if each.parent == box.name}
        if inner != set(self.tags("FFD_CHILDREN")):
            named = ", ".join(sorted(inner)) or "none"
            why = f"FFD_CHILDREN must list the boxes whose parent it is: {named}"
            raise self.error(why)

    def orders(self, letters: str) -> Index | None:
        """Return the orders of the B-splines; None for a Bézier box."""
        entry = self.entries.get("FFD_BLENDING")
        kind = "BEZIER" if entry is None else entry.value.upper()
        if kind == "BEZIER":
            return None
        if kind != "BSPLINE_UNIFORM":
            raise self.error(
                f"FFD_BLENDING is {kind}; expected BEZIER or BSPLINE_UNIFORM", "FFD_BLENDING"
            )
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
        entire = (index == np.floor(index)) & (index >= 0) & (index <= degrees)
        if entire.all():
            points[tuple(index.astype(int).T)] = rows[:, 3:]
        if np.isnan(points).any():
            limits = ", ".join(map(str, degrees))
            raise self.error(
                "FFD_CONTROL_POINTS must have each (i, j, k) from (0, 0, 0) to "
                f"({limits}) once; write the boxes again with DV_KIND= FFD_SETTING",
                "FFD_CONTROL_POINTS",
            )
        return points

    def surface_points(self) -> dict[str, tuple[IntArray, FloatArray]]:
        """Return nodes and parametric coordinates on each marker, sorted by node."""
        key = "FFD_SURFACE_POINTS"
        rows = self.rows(key, self.count(key))
        on = grouped((words[0], (line, words[1:])) for line, words in rows)
        surfaces = {}
        for marker, tails in on.items():
            table = self.table(key, tails, 4)
            number = table[:, 0]
            known = self.mesh.zones == 1 or marker in self.mesh.marker_names
            # SU2 lists nodes of all zones in one section.
            most = self.mesh.file_counts[0] if known else np.inf
            bad = (number != np.floor(number)) | (number < 0) | (number >= most)
            if bad.any():
                line, words = tails[int(np.argmax(bad))]
                raise self.error(f"{key} names node {words[0]}, which does not exist", line)
            far = np.abs(table[:, 1:]).max(axis=1) > _FARTHEST
            if far.any():
                line, words = tails[int(np.argmax(far))]
                raise self.error(
                    f"{key} puts node {words[0]} at ({', '.join(words[1:])}), and the box goes "
                    "from 0 to 1; write the boxes again with DV_KIND= FFD_SETTING",
                    line,
                )
            nodes, first = np.unique(number.astype(np.int64), return_index=True)
            if isinstance(self.mesh, Skin):  # which has all nodes of markers
                numbers = self.mesh.part.points
                inside = np.isin(nodes, numbers)
                nodes = np.searchsorted(numbers, nodes[inside])
                first = first[inside]
            surfaces[marker] = nodes, table[first, 1:]
        return surfaces

    def count(self, key: str) -> int:
        """Return the value of a key, a whole number from 0."""
        word = (self.entry(key).value.split() or [""])[0]
        if not word.isdecimal():
            raise self.error(f"{key}= {word} is not a whole number from 0", key)
        return int(word)

    def numbers(self, key: str, count: int, width: int) -> FloatArray:
        """Return the rows of numbers after a key, (count, width); its value must be ``count``."""
        if self.count(key) != count:
            raise self.error(f"{key} is {self.count(key)}; expected {count}", key)
        return self.table(key, self.rows(key, count), width)

    def rows(self, key: str, count: int) -> list[Row]:
        """Return the rows after a key, which must be ``count``."""
        rows = self.entry(key).rows
        if len(rows) != count:
            raise self.error(f"{len(rows)} rows follow {key}= {count}; correct the count", key)
        return rows

    def table(self, key: str, rows: list[Row], width: int) -> FloatArray:
        """Return rows as numbers, (len(rows), width), which must be finite."""
        table = np.empty((len(rows), width))
        for k, (line, words) in enumerate(rows):
            try:
                numbers = [float(word) for word in words]
            except ValueError:
                numbers = []
            if len(numbers) != width or not all(map(isfinite, numbers)):
                why = f"the row '{' '.join(words)[:60]}' of {key} needs {width} finite numbers"
                raise self.error(why, line)
            table[k] = numbers
        return table

    def entry(self, key: str) -> BoxEntry:
        """Return the keyword line of a key."""
        if key not in self.entries:
            raise self.error(f"{key}= is missing")
        return self.entries[key]

    def error(self, why: str, at: str | int = "FFD_TAG") -> MeshError:
        """Return the error about the box, at the line of a key or at another line."""
        line = self.entries[at].line if isinstance(at, str) else at
        return _error(self.mesh, line, f"FFD box {self.name!r}: {why}")


_BOXES = WeakCache()


def boxes_of(mesh: Mesh, system: CoordinateSystem = CARTESIAN) -> tuple[Box, ...]:
    """Return a mesh's boxes, in the order of its file, in a coordinate system; or MeshError."""

    def boxes() -> tuple[Box, ...]:
        if not isinstance(mesh, Assembly):
            return read_boxes(mesh, _lines(mesh), system)
        return tuple(
            _in_whole(mesh, part, box)
            for part, zone in zip(mesh.parts, zones_of(mesh), strict=True)
            for box in boxes_of(zone, system)
        )

    return _BOXES.of(mesh, system, boxes)


def _in_whole(mesh: Mesh, part: ZonePart, box: Box) -> Box:
    """Return a box of a zone with the names and nodes that boundaries have in the mesh.

    SU2 has the boxes of all zones after the last one, and lists their nodes by boundary: one that
    the zone lacks is that of another zone.
    """
    embedded = {}
    for file, (nodes, uvw) in box.embedded.items():
        name, zone = _holder(mesh, part, file, box)
        if nodes.max(initial=-1) >= len(zone.mesh.points):
            why = f"lists node {nodes.max()} of {name}, which does not exist"
            raise MeshError(f"{mesh.name}: the FFD box {box.name!r} {why}")
        embedded[name] = nodes + zone.points.start, uvw
    return replace(box, embedded=embedded)


def _holder(mesh: Mesh, part: ZonePart, file: str, box: Box) -> tuple[str, ZonePart]:
    """Return the boundary that has a name in the file, from a zone's section, and its zone."""
    each = [(names_from(mesh, zone).get(file), zone) for zone in (part, *mesh.parts)]
    known = [(name, zone) for name, zone in each if name is not None] or [(file, part)]
    if len(known) > 1 and known[0][1] is not part:
        raise MeshError(_ALIKE.format(mesh.name, box.name, file))
    return known[0]


_ALIKE = (
    "{}: the FFD box {!r} has nodes on {}, which several zones have, and a mesh file lists them by "
    "that name alone; rename one of these boundaries"
)


def with_boxes(
    mesh: Mesh, boxes: Sequence[Box], *, anew: bool = False, renewed: Collection[str] = ()
) -> Mesh:
    """Return the mesh with boxes in the section that its SU2 file will have.

    ``boxes``: changed boxes, matched by name, and new ones; the mesh's other boxes stay.
    ``anew``: whether all boxes that the mesh had are dropped.
    ``renewed``: names of boxes whose surface points have other parametric coordinates than before.
    Raises MeshError where two zones have boxes of one name, or boundaries of one name with nodes in
    a box.
    """
    if isinstance(mesh, Assembly):
        return _with_boxes_of_zones(mesh, boxes, renewed, anew)
    lines = [] if anew else _lines(mesh)
    entries = entries_of(lines)
    by_name = {box.name: box for box in boxes}
    for one in reversed(entries):  # from below, so that the lines above keep their numbers
        box = by_name.pop(one["FFD_TAG"].value, None)
        if box is not None:
            _update(lines, one, box, box.name in renewed)
    if not entries:
        lines = [f"FFD_NBOX= {len(boxes)}\n", "FFD_NLEVEL= 1\n"]
    elif by_name:
        at = next(at for at, line in enumerate(lines) if key_of(line) == "FFD_NBOX")
        lines[at] = f"FFD_NBOX= {len(entries) + len(by_name)}\n"
    for box in by_name.values():
        lines += _written(box, mesh.dim)
    text = "".join(lines).encode("utf-8", "surrogateescape")
    text = text if text.endswith(b"\n") else text + b"\n"
    return replace(mesh, origin=replace(mesh.origin, ffd=text, ffd_at=()))


def _with_boxes_of_zones(
    mesh: Assembly, boxes: Sequence[Box], renewed: Collection[str], anew: bool
) -> Mesh:
    """Return the mesh of several zones with changed boxes in the zone that has them, and new ones.

    New ones are in the zone that has others; else in the only one whose nodes are in them, or, as
    in SU2, in the last one.
    """
    alone = zones_of(mesh)
    names = [[] if anew else [box.name for box in boxes_of(zone)] for zone in alone]
    count = len(alone)
    uses = {box.name: [k for k in range(count) if box.name in names[k]] for box in boxes}
    if twice := [name for name, zones in uses.items() if len(zones) > 1]:
        require_one_zone(mesh, f"an FFD box {twice[0]!r}, of which two have one,")
    within = {
        k
        for box in boxes
        if not uses[box.name]
        for k, part in enumerate(mesh.parts)
        if not box.embedded.keys().isdisjoint(names_in(mesh, part))
    }
    last = max((k for k in range(count) if names[k]), default=count - 1)
    home = within.pop() if len(within) == 1 and not any(names) else last
    zones = []
    for k, (part, zone) in enumerate(zip(mesh.parts, alone, strict=True)):
        mine = [_in_zone(mesh, part, box) for box in boxes if (uses[box.name] or [home])[0] == k]
        without = replace(zone.origin, ffd=b"", ffd_at=()) if anew and _lines(zone) else zone.origin
        boxed = with_boxes(zone, mine, anew=anew, renewed=renewed) if mine else None
        zones.append(boxed or replace(zone, origin=without))
    return with_zones(mesh, zones)


def _in_zone(mesh: Mesh, part: ZonePart, box: Box) -> Box:
    """Return a box as in the section of a zone: the reverse of `_in_whole`."""
    files = {n: (f, zone) for zone in mesh.parts for n, f in names_in(mesh, zone).items()}
    embedded = {}
    for name, (nodes, uvw) in box.embedded.items():
        file, zone = files.get(name, (name, part))
        if _holder(mesh, part, file, box)[1] is not zone:
            raise MeshError(_ALIKE.format(mesh.name, box.name, file))
        embedded[file] = nodes - zone.points.start, uvw
    return replace(box, embedded=embedded)


def _lines(mesh: Mesh) -> list[str]:
    origin = mesh.origin
    if origin.ffd is not None:
        text = origin.ffd
    elif isinstance(origin, Document):
        parts = (origin.raw[a:b] for a, b in origin.unknown)
        text = b"".join(part for part in parts if is_ffd(part))
    else:
        text = b""
    return [line.decode("utf-8", "surrogateescape") for line in text.splitlines(keepends=True)]


def _update(lines: list[str], entries: Entries, box: Box, renewed: bool) -> None:
    """Write the changed control points of a box into ``lines``, in place.

    Control points and surface points that the file does not list are written as a whole, and so
    are surface points that are ``renewed``.
    """
    surface = entries.get("FFD_SURFACE_POINTS")
    if surface is not None and box.embedded and (not surface.rows or renewed):
        last = surface.rows[-1][0] if surface.rows else surface.line
        lines[surface.line : last + 1] = _surface_lines(box)
    control = entries["FFD_CONTROL_POINTS"]
    if not control.rows:
        lines[control.line : control.line + 1] = _control_lines(box.points)
    for number, words in control.rows:
        i, j, k = map(int, words[:3])
        if [float(word) for word in words[3:]] != box.points[i, j, k].tolist():
            ending = lines[number][len(lines[number].rstrip("\r\n")) :]
            lines[number] = _control_row(box.points, i, j, k) + ending


def _written(box: Box, dim: int) -> Iterator[str]:
    letters = _LETTERS[:dim]
    axes = box.axes(dim)
    yield f"FFD_TAG= {box.name}\nFFD_LEVEL= 0\n"
    for letter, degree in zip(letters, (box.degrees[axis] for axis in axes), strict=True):
        yield f"FFD_DEGREE_{letter}= {degree}\n"
    yield f"FFD_BLENDING= {'BSPLINE_UNIFORM' if box.orders else 'BEZIER'}\n"
    orders = (box.orders[axis] for axis in axes) if box.orders else ()
    for letter, order in zip(letters, orders, strict=False):
        yield f"BSPLINE_ORDER_{letter}= {order}\n"
    given = 4 if dim == 2 else 8
    corners = given_of_polar(box.corners) if axes == (0, 2) else box.corners[:given, :dim]
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
