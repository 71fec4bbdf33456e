"""How a level set cuts one cell, for every element type and every pattern of signs.

The corners of the cut lie on edges whose ends have different signs. Walking round a side of the
cell, an edge that enters the negative nodes is joined with the edge that leaves them; so the
cut of a side depends on the signs of its nodes alone and neighbours agree on it. Every crossed edge
is entered from one side of the cell and left into another: the joints close to loops, which are
the polygons of the cut. (Marching cubes, Lorensen and Cline 1987, without its ambiguity.)
"""

from __future__ import annotations

from functools import cache

import numpy as np

from slideviz.mesh.elements import ELEMENTS, ElementType
from slideviz.mesh.model import IntArray


@cache
def cut_cases(vtk: int) -> IntArray:
    """Return the loops of each pattern of signs: (2 ** nodes, loops, corners), -1 is no corner.

    Bit k of a pattern is set where node k is negative; corners are indices into the edges of
    the element type. A 2D element has loops of two corners: the ends of a line.
    """
    row = ELEMENTS[vtk]
    found = [_loops(row, pattern) for pattern in range(2**row.n_nodes)]
    loops = max(len(one) for one in found)
    corners = max((len(loop) for one in found for loop in one), default=0)
    table = np.full((len(found), loops, corners), -1, np.int64)
    for pattern, one in enumerate(found):
        for index, loop in enumerate(one):
            table[pattern, index, : len(loop)] = loop
    table.flags.writeable = False
    return table


def _loops(row: ElementType, pattern: int) -> list[list[int]]:
    """Return the loops of one pattern, each a list of edges."""
    edge_of = {frozenset(edge): index for index, edge in enumerate(row.edges)}
    sides = row.facets if row.dim == 3 else (tuple(range(row.n_nodes)),)
    joints = [joint for side in sides for joint in _joints(side, pattern, edge_of)]
    if row.dim == 2:
        return [list(joint) for joint in joints]
    follows = dict(joints)
    loops = []
    while follows:
        start, now = follows.popitem()
        loop = [start]
        while now != start:
            loop.append(now)
            now = follows.pop(now)
        loops.append(loop)
    return loops


def _joints(
    side: tuple[int, ...], pattern: int, edge_of: dict[frozenset[int], int]
) -> list[tuple[int, int]]:
    """Return the pairs of edges between which the negative nodes of a side lie."""
    negative = [bool(pattern >> node & 1) for node in side]
    size = len(side)
    joints = []
    for begin in range(size):
        if negative[begin - 1] or not negative[begin]:
            continue
        end = begin
        while negative[(end + 1) % size]:
            end += 1
        entered = edge_of[frozenset((side[begin - 1], side[begin]))]
        left = edge_of[frozenset((side[end % size], side[(end + 1) % size]))]
        joints.append((entered, left))
    return joints
