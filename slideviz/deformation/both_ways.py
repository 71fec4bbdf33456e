"""Whether the cells of a mesh larger than memory are numbered in both directions, or folded.

A cell with a negative volume is either. In memory its neighbours tell (`mesh.orientation`). Here
each facet gets a number, at random but always the same, with the sign of the direction in which
its cell, turned round where its volume is negative, traverses it. Two cells that are turned right
traverse their facet in opposite directions: their numbers cancel. So the sum over all facets that
no marker has is 0 where every cell is right, and of 2**63 other cases in one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.deformation.measuring import PointFiles
from slideviz.errors import MeshError
from slideviz.mesh.io.su2b.elements import element_block
from slideviz.mesh.io.su2b.layout import BinaryFile, find_zone
from slideviz.mesh.io.su2b.read import read_elements
from slideviz.mesh.model import Cells, IntArray
from slideviz.mesh.orientation import corner_sums, facets_of

Numbers = NDArray[np.uint64]


@contextmanager
def facing(path: Path, zone: int | None) -> Iterator[Callable[[tuple[int, int]], int]]:
    """Return what adds up the numbers of the facets of a part of the cells."""
    with path.open("rb") as file:
        source = BinaryFile(path, file)
        place = find_zone(source, zone)
        files = PointFiles(source, source, place)
        tables = (
            read_elements(source, place, m.elements, place.dim - 1, lambda _: None)[0]
            for m in place.markers
        )
        marked = np.unique(np.concatenate([_of_markers(cells) for cells in tables] or [_NONE]))

        def add(part: tuple[int, int]) -> int:
            size = part[1] - part[0]
            block = element_block(source, place, place.cells, place.dim, part[0], size)
            turned = corner_sums(files.cells_of(block)[0]) < 0
            total = 0
            for owner, facet, turn in facets_of(Cells.from_types(block.types, block.nodes)):
                numbers = _numbers(facet)
                inside = ~_in(numbers, marked)
                signed = np.where(turn ^ turned[owner], numbers, np.negative(numbers))
                total += int(signed[inside].sum(dtype=np.uint64))
            return total

        yield add


def require_right(found: Iterable[int], name: str, also: str = "") -> None:
    """Raise where the numbers of all parts do not add up to 0; ``also`` is one more remedy.

    Raises
    ------
    MeshError
        They do not.
    """
    if sum(found) % 2**64:
        raise MeshError(
            f"{name}: some cells are numbered the other way round than others, and others are "
            "folded, or a part of the boundary is in no marker, which only the whole mesh can "
            f"tell; {also}run it without --stream, or mesh again"
        )


_NONE = np.empty(0, np.uint64)


def _of_markers(cells: Cells) -> Numbers:
    """Return the numbers of the elements of a marker."""
    found = [_NONE]
    for _, nodes in cells.by_type.values():
        found.append(_numbers(np.sort(nodes, axis=1)))
    return np.concatenate(found)


def _numbers(facets: IntArray) -> Numbers:
    """Return a number for each facet, by its nodes (k, n), ascending; splitmix64 of each."""
    found = np.zeros(len(facets), np.uint64)
    for column in facets.T:
        found += column.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        found = (found ^ (found >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        found = (found ^ (found >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        found ^= found >> np.uint64(31)
    return found


def _in(numbers: Numbers, some: Numbers) -> NDArray[np.bool_]:
    """Tell which numbers are among some (k,), ascending."""
    if not len(some):
        return np.zeros(len(numbers), bool)
    at = np.minimum(np.searchsorted(some, numbers), len(some) - 1)
    return np.asarray(some[at] == numbers)
