"""The wheel of a turbomachine: passages turned about the axis, merged at their periodic sides.

Copy k of a passage is turned by k periods at once, not by k turns of one period, so that rounding
does not grow. A node of the second side in copy k is the node of the first side in copy k + 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.errors import MeshError
from slideviz.formats.table import ZoneContent
from slideviz.mesh.axis_frame import along, axis_basis, in_axis_frame
from slideviz.mesh.model import (
    NO_NODES,
    CellRows,
    Cells,
    FloatArray,
    IntArray,
    Marker,
    Mesh,
    row_norms,
)
from slideviz.mesh.periodic import TOLERANCE, Pair


@record
class Wheel:
    """Passages of a wheel, whose nodes, cells and boundaries are made when they are asked for."""

    passages: Sequence[Mesh]
    """The mesh of each, all with the same cells; they may differ by their motion."""
    pairs: Sequence[Pair]
    """The periodic sides of the passage, turned by one period."""
    numbered: bool = False
    """Whether the boundaries of each passage have names of their own: ``blade_1``, ``blade_2``."""

    @cached_property
    def period(self) -> float:
        """Return the angle between passages in radians: a whole part of a turn where it is one."""
        angle = self.pairs[0].period
        count = round(2.0 * np.pi / angle)
        return 2.0 * np.pi / count if abs(2.0 * np.pi / count - angle) <= TOLERANCE else angle

    @cached_property
    def is_closed(self) -> bool:
        """Return whether the passages make a whole turn."""
        return len(self.passages) * self.period > 2.0 * np.pi * (1.0 - 1e-9)

    @cached_property
    def _sides(self) -> IntArray:
        """Nodes (s, 2) of the first sides, and their images one positive period on."""
        rows = [pair.nodes if pair.angle > 0 else pair.nodes[:, ::-1] for pair in self.pairs]
        return np.unique(np.concatenate(rows), axis=0)

    @cached_property
    def _numbering(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Nodes that each copy has for itself, then those of the second side, and on the axis.

        Besides, the place (n,) of each node among those of its own kind, for the second side that
        of its image.
        """
        mesh = self.passages[0]
        first, second = self._sides.T
        axis = first[first == second]
        kind = np.full(len(mesh.points), -1)
        kind[mesh.cells.nodes] = 0
        kind[second] = 1
        kind[axis] = 2
        own = np.flatnonzero(kind == 0)
        place = np.zeros(len(mesh.points), np.int64)
        place[own] = np.arange(len(own))
        place[axis] = np.arange(len(axis))
        last = second[first != second]
        place[last] = place[first[first != second]]
        return own, last, axis, place

    @property
    def n_points(self) -> int:
        """Return the number of nodes."""
        own, last, axis, _ = self._numbering
        return len(self.passages) * len(own) + (0 if self.is_closed else len(last)) + len(axis)

    @property
    def n_cells(self) -> int:
        """Return the number of cells."""
        return len(self.passages) * len(self.passages[0].cells)

    def nodes(self, copy: int, nodes: IntArray) -> IntArray:
        """Return the numbers in the wheel of the nodes (k,) of a copy of the passage."""
        own, last, axis, place = self._numbering
        count = len(own)
        many = len(self.passages)
        at = np.full(len(place), copy * count)
        following = copy + 1 if copy + 1 < many else 0
        at[last] = following * count
        numbers = place + at
        if copy + 1 == many and not self.is_closed:
            numbers[last] = many * count + np.arange(len(last))
        numbers[axis] = self.n_points - len(axis) + np.arange(len(axis))
        return numbers[nodes]

    def turned(self, copy: int, nodes: IntArray) -> FloatArray:
        """Return the points (k, d) of the nodes (k,) of a copy."""
        points = self.passages[copy].points[nodes]
        if not copy:
            return points
        pair = self.pairs[0]
        angle = copy * self.period
        local = in_axis_frame(points, pair.axis, pair.origin)
        cos = np.cos(angle)
        sin = np.sin(angle)
        x = local[:, 0].copy()
        y = local[:, 1].copy()
        local[:, 0] = cos * x - sin * y
        local[:, 1] = sin * x + cos * y
        back = along(axis_basis(pair.axis).T, local) + np.asarray(pair.origin)
        return back[:, : points.shape[1]]

    def points(self, i: int, j: int) -> FloatArray:
        """Return the points i to j - 1 of the wheel, (j - i, d)."""
        own, last, axis, _ = self._numbering
        tail = [] if self.is_closed else [(len(self.passages) - 1, last)]
        groups = [*((k, own) for k in range(len(self.passages))), *tail, (0, axis)]
        starts = np.cumsum([0, *(len(nodes) for _, nodes in groups)])
        parts = [
            self.turned(copy, nodes[max(i - start, 0) : j - start])
            for (copy, nodes), start in zip(groups, starts[:-1].tolist(), strict=True)
            if start < j and i < start + len(nodes)
        ]
        return np.concatenate(parts)

    def cells(self, i: int, j: int) -> CellRows:
        """Return the cells i to j - 1: types (k,), all nodes in turn, and numbers (k,).

        Cells of one type follow each other, copy after copy.
        """
        types = [np.empty(0, np.uint8)]
        flats = [NO_NODES]
        for vtk, copy, nodes in self._rows(i, j):
            types.append(np.full(len(nodes), vtk, np.uint8))
            flats.append(self.nodes(copy, nodes.ravel()))
        return np.concatenate(types), np.concatenate(flats), np.arange(i, j)

    def types(self, i: int, j: int) -> NDArray[np.uint8]:
        """Return the types (j - i,) of the cells i to j - 1."""
        rows = [np.full(len(nodes), vtk, np.uint8) for vtk, _, nodes in self._rows(i, j)]
        return np.concatenate(rows)

    def _rows(self, i: int, j: int) -> Iterator[tuple[int, int, IntArray]]:
        """Yield type, copy and nodes in the passage of the cells i to j - 1, in blocks."""
        start = 0
        for vtk, (_, nodes) in self.passages[0].cells.by_type.items():
            for copy in range(len(self.passages)):
                if start < j and i < start + len(nodes):
                    yield vtk, copy, nodes[max(i - start, 0) : j - start]
                start += len(nodes)

    def markers(self) -> tuple[Marker, ...]:
        """Return the boundaries: those of all passages in one, or `numbered`; sides only if open.

        Raises MeshError if two would have one name.
        """
        many = len(self.passages)
        mesh = self.passages[0]
        positive = [(p.first, p.second) if p.angle > 0 else (p.second, p.first) for p in self.pairs]
        copies = {name: range(many) for name in mesh.marker_names}
        for first, second in positive:
            copies[first] = range(0 if self.is_closed else 1)
            copies[second] = range(many if self.is_closed else many - 1, many)
        out: list[Marker] = []
        for marker in mesh.markers:
            here = [(k, marker.cells, marker.name) for k in copies[marker.name]]
            sides = any(marker.name in names for names in positive)
            if self.numbered and not sides:
                out += [
                    Marker(f"{name}_{k + 1}", self._facets(cells, [k])) for k, cells, name in here
                ]
            elif here:
                out.append(Marker(marker.name, self._facets(marker.cells, copies[marker.name])))
        names = [marker.name for marker in out]
        double = next((name for name in names if names.count(name) > 1), None)
        if double is not None:
            raise MeshError(
                f"{mesh.name}: two boundaries of the wheel would be named {double!r}; rename one "
                "of the mesh, or do not number them"
            )
        return tuple(out)

    def _facets(self, cells: Cells, copies: Sequence[int]) -> Cells:
        flats = [self.nodes(k, cells.connectivity) for k in copies]
        return Cells.from_types(np.tile(cells.types, len(copies)), np.concatenate(flats))

    def content(self) -> ZoneContent:
        """Return the wheel as the content of a mesh file."""
        return ZoneContent(
            dim=self.passages[0].dim,
            n_cells=self.n_cells,
            n_points=self.n_points,
            cells=self.cells,
            types=self.types,
            points=self.points,
            markers=self.markers(),
        )

    def require_meeting(self) -> float:
        """Return the largest distance of nodes that become one; MeshError where it is too large."""
        first, second = self._sides.T
        many = len(self.passages)
        worst = 0.0
        allowed = TOLERANCE * self.passages[0].extent
        checked: set[tuple[int, int]] = set()
        for copy in range(many if self.is_closed else many - 1):
            following = (copy + 1) % many
            both = id(self.passages[copy]), id(self.passages[following])
            if both in checked:
                continue
            checked.add(both)
            # Turned back by one period, so that both are as in one copy.
            one = Wheel([self.passages[following]] * 2, self.pairs)
            gap = one.turned(1, first) - self.passages[copy].points[second]
            worst = max(worst, float(row_norms(gap).max()))
            if worst > allowed:
                raise MeshError(
                    f"{self.passages[0].name}: passages {copy + 1} and {following + 1} do not "
                    f"meet: nodes that should be one are {worst:.3g} apart, allowed is "
                    f"{allowed:.3g}; passages that move differently need sides "
                    "that stay: PERIODIC_MODE= none and SLIDING_MODE= none"
                )
        return worst
