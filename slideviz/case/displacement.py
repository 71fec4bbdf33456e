"""Displacement files: a node and its displacement in each line, as RBF-SliDe writes them.

``322  -0.13  -0.37`` moves node 322 (counted from 0) by (-0.13, -0.37). Columns are separated
by spaces, tabs, commas or semicolons; ``%``, ``#`` and ``$`` start comments.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.lines import listed, read_text
from slideviz.case.words import COMMENT_SIGNS, number
from slideviz.errors import CaseError, Message, Remark, raise_all, shown
from slideviz.mesh.model import FloatArray, IntArray, Mesh, frozen_array
from slideviz.system.grouping import grouped
from slideviz.terms import WholeNumbers

_COMMENT = re.compile(f"[{COMMENT_SIGNS}][^\n]*")
_ZONE = re.compile(r"\s*(\d+):(.*)")
_SEPARATORS = str.maketrans(",;", "  ")


PART = 4000  # lines that are turned into numbers at a time, so that other threads get a turn


@frozen
class Columns:
    """The columns of a file with a line for each node, such as displacements or coordinates."""

    what: str  # what the numbers of a node are together, for messages
    names: tuple[str, str, str]
    """(str, str, str): the names of the columns after that of the node, for messages."""
    flat: bool = False  # whether files for a 2D mesh may have a third number, which is 0

    def heading(self, dim: int) -> str:
        """Return the names of all columns for a mesh of ``dim`` dimensions, with blanks between."""
        return " ".join(("node", *self.names[:dim]))


MOST_APART = 5.0
LITTLE = 1e-4
"""Largest difference of displacements in a file, and a suspiciously small largest one, over the
extent of what moves."""
NodesOn = Mapping[str, IntArray]
"""The nodes (k,) of each moving boundary."""
DISPLACEMENT = Columns("displacement", ("dx", "dy", "dz"))


@record
class Displacements:
    """Prescribed displacements of nodes."""

    nodes: IntArray  # (k,): node indices, sorted, each once
    vectors: FloatArray  # (k, d): Cartesian displacements, in the mesh's length unit
    warnings: tuple[Remark, ...] = ()  # what the user should know about them

    def __post_init__(self) -> None:
        object.__setattr__(self, "nodes", frozen_array(self.nodes, np.int64))
        object.__setattr__(self, "vectors", frozen_array(self.vectors, np.float64))

    def at(self, nodes: IntArray) -> FloatArray:
        """Return the displacements (m, d) of ``nodes`` (m,), which must be among ``self.nodes``."""
        return self.vectors[np.searchsorted(self.nodes, nodes)]


PlacedDisplacements = dict[int, Displacements]
"""Displacements from undeformed places, by the place of their motion in a case."""


def read_displacements(path: Path, mesh: Mesh, nodes: IntArray, of: str) -> Displacements:
    """Return the displacements that a file lists for ``nodes``, zero for those not in it.

    Raises CaseError if the file cannot be read, or has mistakes: a line ``file:line: sentence`` for
    each.
    ``path``: the file, whose nodes have the numbers that `in_zones` tells.
    ``nodes`` (k,) int64: the nodes that the file may list, sorted, each once.
    ``of``: what the nodes lie on, for messages: ``a moving marker``, ``marker 'BLADE'``.
    """
    text, warnings = read_text(path, "displacement file")
    read = parsed_displacements(text, path, mesh, nodes, of)
    size = float(np.ptp(mesh.points[nodes], axis=0).max(initial=0.0))
    apart = float(np.ptp(read.vectors, axis=0).max(initial=0.0))
    if 0.0 < MOST_APART * size < apart:
        raise CaseError(
            f"{path}: displacements differ by {apart / size:,.3g} times the extent of {of}, "
            f"{size:.4g}: are they in another unit, such as millimetres for metres? Multiply them "
            "by 0.001 then"
        )
    remarks = (*warnings, *read.warnings)
    largest = np.abs(read.vectors).max(initial=0.0)
    if 0.0 < largest < LITTLE * size:
        rule = f"displacements are up to {largest:.3g}, and the extent of {of} is {size:.4g}"
        remedy = "multiply them by 1000 if they are in metres, and the mesh in millimetres"
        remarks = (*remarks, Message(rule, remedy, (path,), level="note"))
    return replace(read, warnings=tuple(dict.fromkeys(remarks)))


def parsed_displacements(
    text: str, path: Path, mesh: Mesh, nodes: IntArray, of: str
) -> Displacements:
    """Return the displacements that the text of a file lists; as `read_displacements`."""
    each = []
    for first, here, part, lines in in_zones(text, path, mesh, nodes):
        shape = part.file_counts[0], part.dim
        read = parse_displacements(lines, path, part.numbers(here), shape, of)
        each.append(replace(read, nodes=here + first))
    return Displacements(
        np.concatenate([read.nodes for read in each]),
        np.concatenate([read.vectors for read in each]),
        tuple(dict.fromkeys(text for read in each for text in read.warnings)),
    )


def in_zones(
    text: str, path: Path, mesh: Mesh, nodes: IntArray
) -> Iterator[tuple[int, IntArray, Mesh, str]]:
    """Yield what the text of a file has for each zone of a mesh that has some of ``nodes``.

    First node, ``nodes`` (k,) of the zone in its own numbers, its mesh, and the lines, as many as
    there are. Lines name the zone of a node, too: ``2:15 dx dy``; they need not where all nodes are
    of one zone. Raises CaseError with a line for each that has no zone, or that of no node.
    """
    each = [
        (k, part.points.start, part.mesh, here)
        for k, part in enumerate(mesh.parts, mesh.zone or 1)
        if len(here := nodes[(part.points.start <= nodes) & (nodes < part.points.stop)])
    ] or [(mesh.zone or 1, 0, mesh, nodes)]
    named = mesh.zones > 1 and ":" in text and ":" in _COMMENT.sub("", text)
    if len(each) == 1 and not named:
        _, first, alone, here = each[0]
        yield first, here - first, alone, text
        return
    lines = _COMMENT.sub("", text).splitlines()
    heads = [_ZONE.match(line) for line in lines]
    several = {str(k): None for k, *_ in each}
    rule = "begins with none of the zones" if len(several) > 1 else "does not begin with zone"
    wrong = [
        Message(f"{shown(line.strip())} {rule} {' and '.join(several)}", line=at)
        for at, (line, head) in enumerate(zip(lines, heads, strict=True), 1)
        if line.strip() and (head is None or head[1] not in several)
    ]
    if wrong:
        k, first, _, here = each[0]
        rule = f"{wrong[0].rule}; write zone and node, e.g. {k}:{here[0] - first}"
        raise CaseError(*listed(path, [_with_count(replace(wrong[0], rule=rule), len(wrong))]))
    missing = [k for k in several if not any(head is not None and head[1] == k for head in heads)]
    if missing:
        raise CaseError(
            f"{path}: lists no node of zone {missing[0]}, whose boundaries it is to move"
        )
    for k, first, zone, here in each:
        mine = [head[2] if head is not None and head[1] == str(k) else "" for head in heads]
        yield first, here - first, zone, "\n".join(mine)


def parse_displacements(
    text: str, path: Path, nodes: IntArray, shape: WholeNumbers, of: str
) -> Displacements:
    """Return the displacements that the text of a file lists for ``nodes``, zero for others.

    Parameters as of `read_displacements`; ``path`` is for messages only, ``shape`` (n, d) that of
    the points of the mesh. Raises CaseError if the text has mistakes: a line ``file:line:
    sentence`` for each.
    """
    table = parse_rows(text, path, nodes, shape, of)
    numbers = table[:, 0].astype(np.int64)
    vectors = np.zeros((len(nodes), shape[1]))
    vectors[np.searchsorted(nodes, numbers)] = table[:, 1:]
    if len(numbers) < len(nodes):
        missing = len(nodes) - len(numbers)
        warning = f"{path}: {missing} of {len(nodes)} nodes on {of} are not listed; they stay"
        return Displacements(nodes, vectors, (warning,))
    return Displacements(nodes, vectors)


def parse_rows(
    text: str,
    path: Path,
    nodes: IntArray,
    shape: WholeNumbers,
    of: str,
    columns: Columns = DISPLACEMENT,
) -> FloatArray:
    """Return the table in a text, (k, 1 + d): a node and its d numbers, by ascending node.

    Parameters as of `read_displacements`; ``path`` is for messages only. Each node is there once.
    Raises CaseError if the text has mistakes: a line ``file:line: sentence`` for each.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if any(sign in text for sign in COMMENT_SIGNS):
        text = _COMMENT.sub("", text)
    lines = text.translate(_SEPARATORS).split("\n")
    table = _table(path, lines, shape[1], columns)
    problems = _table_problems(table, lines, nodes, count=shape[0], of=of, what=columns.what)
    raise_all(listed(path, problems))
    return table[np.unique(table[:, 0], return_index=True)[1]]


def _table(path: Path, lines: list[str], dim: int, columns: Columns) -> FloatArray:
    """Return the numbers in the lines, (m, 1 + d); CaseError if a line is not a row of numbers."""
    if not any(line.strip() for line in lines):
        raise CaseError(f"{path}: the file lists no node; expected lines {columns.heading(dim)}")
    try:
        table = _numbers([line for line in lines if line.strip()])
    except ValueError:
        table = np.empty((0, 0))
    if table.shape[1] == 1 + dim and np.isfinite(table).all():
        return table
    flat = columns.flat and dim == 2 and table.shape[1] == 4
    if flat and np.isfinite(table).all() and not table[:, 3].any():
        return table[:, :3]
    # Slower, but finds every line that is wrong.
    rows: list[list[float]] = []
    problems = list[Message]()
    for line, content in enumerate(lines, start=1):
        try:
            rows += _row(content, dim, columns)
        except CaseError as problem:
            problems += problem.within(line=line)
    kinds = grouped((mistake.rule, mistake) for mistake in problems)
    raise_all(listed(path, [_with_count(kind[0], len(kind)) for kind in kinds.values()]))
    return np.array(rows, np.float64)


def _numbers(lines: list[str]) -> FloatArray:
    """Return the numbers (m, c) in lines of which none is empty."""
    parts = (lines[first : first + PART] for first in range(0, len(lines), PART))
    return np.concatenate(
        [np.loadtxt(part, dtype=np.float64, comments=None, ndmin=2) for part in parts]
    )


def _row(content: str, dim: int, columns: Columns) -> list[list[float]]:
    """Return the numbers of a line as one row, of an empty line none; or raise CaseError."""
    words = content.split()
    if columns.flat and dim == 2 and len(words) == 4:
        if number(words[3]) != 0.0:
            raise CaseError(
                f"z is {shown(words[3])}, and the mesh has 2 dimensions; write 0 or leave it out"
            )
        words.pop()
    if words and len(words) != 1 + dim:
        rule = f"has {len(words)} columns; expected {1 + dim}: {columns.heading(dim)}"
        value = shown(content.strip())
        raise CaseError(Message(f"{rule} (put % before a heading)", value=value))
    return [[number(word) for word in words]] if words else []


def _table_problems(
    table: FloatArray, lines: list[str], nodes: IntArray, *, count: int, of: str, what: str
) -> list[Message]:
    """Return a problem for each line whose node is not in ``nodes``, or was given otherwise."""
    index = table[:, 0]
    broken = index != np.floor(index)
    outside = ~broken & ((index < 0) | (index >= count))
    strange = ~broken & ~outside & ~np.isin(index, nodes)
    order = np.argsort(index, kind="stable")
    same = index[order[1:]] == index[order[:-1]]
    differ = same & (table[order[1:]] != table[order[:-1]]).any(axis=1)
    if not (broken.any() or outside.any() or strange.any() or differ.any()):
        return []
    row_line = [line for line, content in enumerate(lines, start=1) if content.strip()]
    last = f"its nodes are 0 to {count - 1}"
    problems = list[Message]()
    for wrong, begin, end in (
        (broken, "", "is not a node number"),
        (outside, "node ", f"is not in the mesh; {last}"),
        (strange, "node ", f"is not on {of}; remove the line or change the roles"),
    ):
        if wrong.any():
            k = int(np.argmax(wrong))
            found = Message(f"{begin}{index[k]:.15g} {end}", line=row_line[k])
            problems.append(_with_count(found, int(np.count_nonzero(wrong))))
    if differ.any():
        k = int(np.argmax(differ))
        before = row_line[order[k]]
        after = row_line[order[k + 1]]
        rule = f"node {int(index[order[k]])} has another {what} in line {before}"
        found = Message(f"{rule}; keep one of the two", line=after)
        problems.append(_with_count(found, int(np.count_nonzero(differ))))
    return problems


def _with_count(first: Message, count: int) -> Message:
    """Return the message on the first of ``count`` wrong lines, with the number of the others."""
    if count == 1:
        return first
    more = "line" if count == 2 else "lines"
    return replace(first, rule=f"{first.rule} (and {count - 1} more {more} like it)")
