"""SU2's text read by the plainest means, word by word, to compare with the reader of slideviz."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

NODES = {3: 2, 5: 3, 9: 4, 10: 4, 12: 8, 13: 6, 14: 5}
"""Number of nodes by the number of a cell's type in VTK."""
_KEY = re.compile(r"\s*([A-Za-z_]+)\s*=\s*(.*?)\s*\Z", re.DOTALL)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)


class WrongError(ValueError):
    """The text is not an SU2 mesh."""


@dataclass
class PlainMesh:
    """A zone of a file, as lists."""

    dim: int = 0
    points: list[tuple[float, ...]] = field(default_factory=list)
    cells: list[tuple[int, ...]] = field(default_factory=list)
    markers: list[tuple[str, list[tuple[int, ...]]]] = field(default_factory=list)


class _Lines:
    """The lines of a text without comments and blank lines."""

    def __init__(self, text: str) -> None:
        lines = (line.partition("%")[0] for line in re.split(r"\r\n|\n|\r", text))
        self.lines = [line for line in lines if line.strip()]
        self.place = 0

    def rows(self, count: int) -> list[list[str]]:
        """Return the words of the next lines; WrongError where a key comes before."""
        rows = [line.split() for line in self.lines[self.place : self.place + count]]
        if len(rows) < count or any("=" in word for row in rows for word in row):
            raise WrongError("a section is too short")
        self.place += count
        return rows


def plain_mesh(text: str) -> PlainMesh:
    """Return the only zone of a file; WrongError where it has a mistake, or several zones."""
    lines = _Lines(text)
    mesh = PlainMesh()
    while lines.place < len(lines.lines):
        match = _KEY.match(lines.lines[lines.place])
        lines.place += 1
        if match is None:
            continue
        key = match[1].upper()
        if key == "NDIME":
            mesh.dim = _whole(match[2].split()[0])
        elif key == "NELEM":
            mesh.cells = [_cell(row) for row in lines.rows(_count(match[2]))]
        elif key == "NPOIN":
            mesh.points = [_point(row, mesh.dim) for row in lines.rows(_count(match[2]))]
        elif key == "MARKER_TAG":
            _marker(lines, match[2], mesh)
        elif key in ("NZONE", "IZONE"):
            raise WrongError("several zones")
    nodes = [node for cell in mesh.cells for node in cell[1:]]
    nodes += [node for _, facets in mesh.markers for facet in facets for node in facet[1:]]
    if nodes and not 0 <= min(nodes) <= max(nodes) < len(mesh.points):
        raise WrongError("a node does not exist")
    return mesh


def _marker(lines: _Lines, name: str, mesh: PlainMesh) -> None:
    match = _KEY.match(lines.lines[lines.place]) if lines.place < len(lines.lines) else None
    if match is None or match[1].upper() != "MARKER_ELEMS":
        raise WrongError(f"{name} has no MARKER_ELEMS")
    lines.place += 1
    if name.upper() == "SEND_RECEIVE":
        lines.place += 1 + _count(match[2])
        return
    mesh.markers.append((name, [_cell(row) for row in lines.rows(_count(match[2]))]))


def _count(text: str) -> int:
    count = _whole(text.split(maxsplit=1)[0]) if text.split() else -1
    if count < 0:
        raise WrongError(f"{text!r} is not a count")
    return count


def _whole(text: str) -> int:
    if not re.fullmatch(r"\+?\d+", text, re.ASCII):
        raise WrongError(f"{text!r} is not a whole number")
    return int(text)


def _cell(row: list[str]) -> tuple[int, ...]:
    kind = _whole(row[0])
    if kind not in NODES or len(row) < NODES[kind] + 1:
        raise WrongError(f"{row} is not a cell")
    return kind, *(_whole(word) for word in row[1 : NODES[kind] + 1])


def _point(row: list[str], dim: int) -> tuple[float, ...]:
    if len(row) < dim or not all(_NUMBER.match(word) for word in row[:dim]):
        raise WrongError(f"{row} is not a point")
    return tuple(float(word) for word in row[:dim])
