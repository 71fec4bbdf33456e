"""Constraints of sliding nodes on a tape: on curved boundaries normals depend on positions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.topology import TINY
from slideviz.rbf.classify import directions
from slideviz.rbf.frames import corners as corners_of
from slideviz.rbf.tape import (
    Array,
    Variable,
    add,
    cross,
    function,
    gather,
    inverse,
    join,
    length,
    multiply,
    put,
    recorded,
    take,
    transform,
    unit,
    value,
)

if TYPE_CHECKING:
    from slideviz.solver.setup import Setup

TURN = {2: np.array([[0.0, 1.0], [-1.0, 0.0]])}
"""Rotates the direction of a segment (2D) into its normal."""


def sliding_normals(setup: Setup, coords: Array) -> tuple[IntArray, Array]:
    """Return nodes (q,) and unit normals (q, d) like ``Setup.constraints``, on a tape."""
    nodes, at = setup.constraints(value(coords))
    if not (setup.tracks.curved and isinstance(coords, Variable)) or not len(nodes):
        return nodes, at
    owner, along = directions(setup.classes, _fan_normals(setup, coords))
    # Nodes on the axis have directions of their own, which do not turn.
    turning = setup.once(owner) & ~setup.axis[owner]
    found = take(along, np.flatnonzero(turning))
    count = len(value(found))
    return nodes, join(found, at[count:]) if count < len(at) else found


@dataclass(frozen=True, eq=False)
class _Corners:
    """Computes corners of facets from the coordinates of nodes, a linear map, also on the axis."""

    setup: Setup

    def of(self, coords: Array) -> list[Array]:
        """Return the corners of all facets, one array (f, d) for each place in a facet."""
        facets = self.setup.boundary.facets
        axis = self.setup.axis
        v = value(coords)
        touching = np.flatnonzero(axis[facets].any(axis=1) & ~axis[facets].all(axis=1))
        parts = [take(coords, facets[:, k]) for k in range(facets.shape[1])]
        if not len(touching):
            return parts
        table = facets[touching]
        nodes, local = np.unique(table, return_inverse=True)
        maps = self._maps(nodes, local.reshape(table.shape), table)
        near = take(coords, nodes)
        return [
            put(part, touching, _mapped(maps[k], near, v.shape[1])) for k, part in enumerate(parts)
        ]

    def _maps(self, nodes: IntArray, local: IntArray, table: IntArray) -> FloatArray:
        """Return matrices (k, f d, m d) from coordinates of nodes to corners of facets at the axis.

        Of m nodes and f facets ``local`` (f, k), renumbered; found by probing
        `slideviz.rbf.frames.corners` with unit vectors.
        """
        d = self.setup.coords.shape[1]
        width = table.shape[1]
        out = np.empty((width, len(table) * d, len(nodes) * d))
        here = self.setup.axis[nodes]
        for column in range(len(nodes) * d):
            probe = np.zeros(len(nodes) * d)
            probe[column] = 1.0
            # Renumbered nodes: which are on the axis is all that counts.
            found = corners_of(probe.reshape(-1, d), local, here)
            out[:, :, column] = np.moveaxis(found, 1, 0).reshape(width, -1)
        return out


def _mapped(matrix: FloatArray, x: Array, d: int) -> Array:
    """Return a matrix (f d, m d) times the entries of x (m, d), row by row, as (f, d)."""
    v = value(x)
    rows = len(matrix) // d

    def there(t: FloatArray) -> FloatArray:
        return (t.reshape(*t.shape[:-2], -1) @ matrix.T).reshape(*t.shape[:-2], rows, d)

    def back(g: FloatArray) -> FloatArray:
        return (g.reshape(*g.shape[:-2], -1) @ matrix).reshape(*g.shape[:-2], len(v), d)

    return recorded(there(v), (x, there, back))


def _fan_normals(setup: Setup, coords: Array) -> Array:
    """Return the unit normal of each fan (m, d), as ``slideviz.mesh.fans.fan_normals``."""
    boundary = setup.boundary
    fans = setup.wall_fans
    corners = _Corners(setup).of(coords)
    if boundary.dim == 2:
        vectors = transform(TURN[2], corners[1] - corners[0])
    else:
        vectors = cross(corners[2] - corners[0], corners[3] - corners[1])
    width = boundary.facets.shape[1]
    share = np.full((len(boundary.facets), width), 1.0 / width)
    if width == 4:
        share[boundary.facets[:, 2] == boundary.facets[:, 3]] = [1 / 3, 1 / 3, 1 / 6, 1 / 6]
    centre = multiply(corners[0], share[:, :1])
    for k in range(1, width):
        centre = add(centre, multiply(corners[k], share[:, k : k + 1]))
    gap = length(take(coords, fans.node) - take(centre, fans.facet))
    size = value(gap)
    near = inverse(function(gap, np.maximum(size, TINY), (size > TINY).astype(float)))
    weighted = multiply(take(unit(vectors), fans.facet), near)
    return unit(gather(weighted, fans.fan, len(fans.fan_node)))
