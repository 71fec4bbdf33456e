"""Orientation of cells: which way round the nodes of each are numbered, found from its neighbours.

A cell that is numbered the other way round (in 2D clockwise) has a negative volume, and so has a
folded cell. They differ at the facet shared with a neighbour: two cells that are numbered the same
way traverse it in opposite directions, whatever their shape.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.adjacency import sides_of
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.fans import components
from slideviz.mesh.jacobians import CORNERS, add_corners
from slideviz.mesh.model import BoolArray, Mesh, Signs, sealed
from slideviz.system.weak_cache import weak_cache

if TYPE_CHECKING:
    from collections.abc import Iterator

    from slideviz.mesh.model import Cells, FloatArray, Index, IntArray


NAMING = np.array([1, 1_000_003, 998_244_353, 1_000_000_007])
"""Factors of a facet's nodes, whose sum tells facets of two cells apart."""


@weak_cache
def reference_of(mesh: Mesh) -> tuple[FloatArray, Signs]:
    """Return what deformed cells are compared with: sums of corner Jacobians (m,), and signs (m,).

    The signs are those of `orientation`; the sums are multiplied by them, so that they are positive
    but for folded cells. Both are cached as long as the mesh lives.
    """
    sums = corner_sums(mesh)
    signs = orientation(mesh.cells, sums)
    sums *= signs
    return sealed(sums), sealed(signs)


def corner_sums(mesh: Mesh) -> FloatArray:
    """Return the sum (m,) of each cell's corner Jacobians, without `orientation`'s sign."""
    sums = np.empty(len(mesh.cells))

    def add(vtk: int, rows: Index, nodes: IntArray) -> None:
        of_part = np.empty(len(nodes))
        add_corners(mesh.points, nodes, CORNERS[vtk], of_part)
        sums[rows] = of_part

    mesh.cells.in_parts(add)
    return sums


def orientation(cells: Cells, sums: FloatArray) -> Signs:
    """Return a sign (m,) of each cell: 1, or -1 if it is numbered the other way round.

    Where all ``sums`` have one sign, all cells are taken to be numbered alike, without a look
    at their neighbours (which takes a second for 250,000 cells). Otherwise the cells of each
    connected part are made consistent over their common facets, and the part gets the sign
    that makes its sum positive. So a folded cell keeps its negative Jacobian. The cells have one
    dimension; ``sums`` (m,) are those of `corner_sums`.
    """
    if not (sums < 0).any():
        return np.ones(len(cells), np.int8)
    if not (sums > 0).any():
        return np.full(len(cells), -1, np.int8)
    signs, part = _consistent(cells)
    total = np.bincount(part, weights=np.nan_to_num(signs * sums))
    return np.where(total[part] < 0, -signs, signs).astype(np.int8)


def _consistent(cells: Cells) -> tuple[Signs, IntArray]:
    """Return signs (m,) that make all cells of a connected part agree, and the part (m,) of each.

    The graph has each cell twice, as numbered and reversed. Neighbours that agree are linked as
    numbered to as numbered, reversed to reversed; others as numbered to reversed. So each part of
    the mesh becomes two components that are mirror images. Where it becomes one (as for a Möbius
    strip), no signs agree, and all are 1.
    """
    m = len(cells)
    first, second, agree = _neighbours(cells)
    shift = np.where(agree, 0, m)
    rows = np.concatenate((first, first + m))
    columns = np.concatenate((second + shift, second + m - shift))
    labels = components(2 * m, rows, columns)
    plain = labels[:m]
    mirrored = labels[m:]
    signs = np.where(plain <= mirrored, 1, -1).astype(np.int8)
    return signs, np.minimum(plain, mirrored)


def _neighbours(cells: Cells) -> tuple[IntArray, IntArray, BoolArray]:
    """Return pairs of cells with a common facet (p,), (p,), and a mask (p,) of those that agree.

    Two cells agree if they traverse the facet in opposite directions.
    """
    sides = sides_of(cells)
    owner = np.repeat(np.arange(len(cells)), np.diff(sides.first))
    turn = np.empty(len(owner), bool)
    name = np.empty(len(owner), np.int64)  # of the facet: two cells may share several
    place = sides.first[:-1].copy()  # of the next side of each cell
    for ids, facet, direction in facets_of(cells):
        turn[place[ids]] = direction
        name[place[ids]] = facet @ NAMING[: facet.shape[1]]
        place[ids] += 1
    # Only facets of exactly two cells are used: both of their sides, one after the other.
    pairs = np.flatnonzero(sides.neighbour >= 0)
    both = np.sort(np.stack([owner[pairs], sides.neighbour[pairs]]), axis=0)
    pairs = pairs[np.lexsort((name[pairs], *both))]
    one, two = pairs.reshape(-1, 2).T
    return owner[one], owner[two], turn[one] != turn[two]


def facets_of(cells: Cells) -> Iterator[tuple[IntArray, IntArray, BoolArray]]:
    """Yield facets of cells, in tables: cell (k,), sorted nodes (k, n) and direction (k,) of each.

    The direction is a boolean that differs for the two ways to traverse the same nodes.
    """
    for vtk, (ids, nodes) in cells.by_type.items():
        for local in ELEMENTS[vtk].facets:
            facet = nodes[:, local]
            least = facet.argmin(axis=1)
            rows = np.arange(len(facet))
            size = len(local)
            after = facet[rows, (least + 1) % size]
            before = facet[rows, (least - 1) % size]
            # With two nodes after and before are the same; the direction is which comes first.
            turn = after < before if size > 2 else least == 0
            yield ids, np.sort(facet, axis=1), turn
