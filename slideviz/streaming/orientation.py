"""Whether cells of negative volume are numbered the other way round, or folded; block by block.

For a mesh in memory, `mesh.orientation` compares neighbours. A mesh larger than memory is only
proved to have no folded cell: each facet gets a hash of its nodes, with the sign of the direction
in which its cell traverses it, after cells of negative volume were turned round. Two cells that
are numbered alike traverse their common facet in opposite directions, so their hashes cancel. The
sum over all facets that are in no marker is then 0 (modulo 2**64) where no cell is folded; where
one is, it is 0 with a probability of about 2**-63.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.formats.su2b.elements import element_block
from slideviz.formats.su2b.layout import BinaryFile, find_zone
from slideviz.formats.su2b.read import read_elements
from slideviz.mesh.model import Cells, IntArray
from slideviz.mesh.orientation import corner_sums, facets_of
from slideviz.streaming.measuring import PointFiles

Numbers = NDArray[np.uint64]


@contextmanager
def facet_sums(path: Path, zone: int | None) -> Iterator[Callable[[tuple[int, int]], int]]:
    """Context with a function that sums the signed hashes of the inner facets of some cells.

    Its argument is the first of these cells and the one after the last, by place in the file.
    """
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


def require_consistent_orientation(found: Iterable[int], name: str, also: str = "") -> None:
    """Raise where the sums of the hashes of all parts of the cells do not add up to 0.

    Parameters
    ----------
    found : iterable of int
        The sum of each part, of `facet_sums`.
    name : str
        The mesh, for the message.
    also : str
        One more remedy for the message.

    Raises
    ------
    MeshError
        They do not: some cell is folded, or a part of the boundary is in no marker.
    """
    if sum(found) % 2**64:
        raise MeshError(
            f"{name}: some cells are numbered the other way round than others, and others are "
            "folded, or a part of the boundary is in no marker, which only the whole mesh can "
            f"tell; {also}run it without --stream, or mesh again"
        )


_NONE = np.empty(0, np.uint64)


def _of_markers(cells: Cells) -> Numbers:
    """Return the hashes (f,) of the elements of a marker, in no particular order."""
    found = [_NONE]
    for _, nodes in cells.by_type.values():
        found.append(_numbers(np.sort(nodes, axis=1)))
    return np.concatenate(found)


def _numbers(facets: IntArray) -> Numbers:
    """Return a hash (f,) of each facet (f, k) of ascending nodes: splitmix64, node by node."""
    found = np.zeros(len(facets), np.uint64)
    for column in facets.T:
        found += column.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        found = (found ^ (found >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        found = (found ^ (found >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        found ^= found >> np.uint64(31)
    return found


def _in(numbers: Numbers, some: Numbers) -> NDArray[np.bool_]:
    """Return a mask (n,) of the numbers (n,) that are among ``some`` (k,), which is ascending."""
    if not len(some):
        return np.zeros(len(numbers), bool)
    at = np.minimum(np.searchsorted(some, numbers), len(some) - 1)
    return np.asarray(some[at] == numbers)
