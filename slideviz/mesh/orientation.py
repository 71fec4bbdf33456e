"""Orientation of cells: which way round each is numbered, found from its neighbours.

A cell that is numbered clockwise has a negative volume as a folded cell has. What tells them
apart is the facet it shares with a neighbour: two cells numbered alike traverse it in opposite
directions, whatever their shape.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.jacobians import CORNERS, write_corners
from slideviz.mesh.metrics import total
from slideviz.mesh.model import Mesh, sealed
from slideviz.mesh.threads import in_parts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from slideviz.mesh.model import Cells, FloatArray, IntArray

_REFERENCES: WeakKeyDictionary[Mesh, tuple[FloatArray, NDArray[np.int8]]] = WeakKeyDictionary()


def reference_of(mesh: Mesh) -> tuple[FloatArray, NDArray[np.int8]]:
    """Return what cells are compared with: sums of corner Jacobians (m,), and their signs (m,).

    The sums have the signs that `orientation` gives. Both are found once, and kept as long as the
    mesh lives.
    """
    found = _REFERENCES.get(mesh)
    if found is None:
        sums = corner_sums(mesh)
        signs = orientation(mesh.cells, sums)
        sums *= signs
        found = _REFERENCES[mesh] = sealed(sums), sealed(signs)
    return found


def corner_sums(mesh: Mesh) -> FloatArray:
    """Return (m,) sums of each cell's corner Jacobians, in the numbering of the file."""
    sums = np.empty(len(mesh.cells))
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        sums[ids] = _sums_of(mesh.points, vtk, nodes)
    return sums


def _sums_of(points: FloatArray, vtk: int, nodes: IntArray) -> FloatArray:
    """Return (m,) what `corner_sums` does, of cells (m, n) of one type."""
    sums, table = np.empty(len(nodes)), CORNERS[vtk]

    def add(part: slice) -> None:
        alpha = np.empty((len(table), part.stop - part.start))
        write_corners(points, nodes[part], table, alpha)
        sums[part] = total(alpha)

    in_parts(add, len(nodes))
    return sums


def orientation(cells: Cells, sums: FloatArray) -> NDArray[np.int8]:
    """Return (m,) 1, or -1 where a cell is numbered the other way round.

    Where all ``sums`` have one sign, all cells are taken to be numbered alike, without a look
    at their neighbours (which takes a second for 250,000 cells). Otherwise the cells of each
    connected part are made consistent over their common facets, and the part gets the sign
    that makes its sum positive. So a folded cell keeps its negative Jacobian.

    Parameters
    ----------
    cells : Cells
        Cells of one dimension.
    sums : (m,)
        Sum of the corner Jacobians of each cell, as from `corner_sums`.
    """
    if not (sums < 0).any():
        return np.ones(len(cells), np.int8)
    if not (sums > 0).any():
        return np.full(len(cells), -1, np.int8)
    signs, part = _consistent(cells)
    total = np.bincount(part, weights=np.nan_to_num(signs * sums))
    return np.where(total[part] < 0, -signs, signs).astype(np.int8)


def _consistent(cells: Cells) -> tuple[NDArray[np.int8], IntArray]:
    """Return signs (m,) that agree within each connected part, and the part (m,) of each cell.

    The graph has every cell twice, as numbered and reversed; neighbours that agree link equal
    copies, others link unequal ones. A part then falls apart into two mirror images. Where it
    does not (a cell is its own mirror image), no numbering agrees and the file's is kept.
    """
    from slideviz.mesh.fans import components

    m = len(cells)
    first, second, agree = _neighbours(cells)
    shift = np.where(agree, 0, m)
    rows = np.concatenate((first, first + m))
    columns = np.concatenate((second + shift, second + m - shift))
    labels = components(2 * m, rows, columns)
    plain, mirrored = labels[:m], labels[m:]
    signs = np.where(plain <= mirrored, 1, -1).astype(np.int8)
    return signs, np.minimum(plain, mirrored)


def _neighbours(cells: Cells) -> tuple[IntArray, IntArray, NDArray[np.bool_]]:
    """Return pairs of cells with a common facet (p,), (p,), and whether they agree (p,)."""
    owners, facets, turns = [], [], []
    for ids, nodes, turn in facets_of(cells):
        padded = np.full((len(nodes), 4), -1, np.int64)
        padded[:, : nodes.shape[1]] = nodes
        owners.append(ids)
        facets.append(padded)
        turns.append(turn)
    owner, facet, turn = np.concatenate(owners), np.concatenate(facets), np.concatenate(turns)
    order = np.lexsort(facet.T)
    owner, facet, turn = owner[order], facet[order], turn[order]
    same = np.concatenate(([False], (facet[1:] == facet[:-1]).all(axis=1), [False]))
    # A facet of three cells or more tells nothing: only pairs that stand alone are used.
    start = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])
    return owner[start], owner[start + 1], turn[start] != turn[start + 1]


def facets_of(cells: Cells) -> Iterator[tuple[IntArray, IntArray, NDArray[np.bool_]]]:
    """Yield facets of cells: cell (k,), nodes (k, n), ascending, and direction (k,) of each."""
    for vtk, (ids, nodes) in cells.by_type.items():
        for local in ELEMENTS[vtk].facets:
            facet = nodes[:, local]
            least = facet.argmin(axis=1)
            rows, size = np.arange(len(facet)), len(local)
            after = facet[rows, (least + 1) % size]
            before = facet[rows, (least - 1) % size]
            # Two nodes: after and before are one, and which comes first is the direction.
            turn = after < before if size > 2 else least == 0
            yield ids, np.sort(facet, axis=1), turn
