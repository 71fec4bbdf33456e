"""Constraints of sliding nodes on a tape: on curved boundaries normals depend on positions."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from slideviz.mesh.model import IntArray
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
    take,
    transform,
    unit,
    value,
)

if TYPE_CHECKING:
    from slideviz.solver.setup import Setup

TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
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


def _corners(setup: Setup, coords: Array) -> list[Array]:
    """Return the corners of all facets, one array (f, d) for each place in a facet."""
    facets = setup.boundary.facets
    axis = setup.axis
    parts = [take(coords, column) for column in facets.T]
    touching = np.flatnonzero(axis[facets].any(axis=1) & ~axis[facets].all(axis=1))
    if not len(touching):
        return parts
    table = facets[touching]
    nodes = take(coords, table.ravel())
    # At the axis, corners are means of the nodes of their facet, component by component. Their
    # shares are found with ones at a node of each facet, which gets nodes of its own.
    own = np.arange(table.size).reshape(table.shape)
    own[:, 2:] = np.where(table[:, 2:3] == table[:, 3:], own[:, 2:3], own[:, 2:])
    shares = []
    for place in range(table.shape[1]):
        one = np.zeros((table.size, setup.coords.shape[1]))
        one[own[:, place]] = own[:, [place]] != own[:, [place - 1]]
        shares.append(corners_of(one, own, axis[table.ravel()]))
    for k, part in enumerate(parts):
        terms = [
            multiply(take(nodes, own[:, place]), share[:, k]) for place, share in enumerate(shares)
        ]
        parts[k] = put(part, touching, reduce(add, terms))
    return parts


def _fan_normals(setup: Setup, coords: Array) -> Array:
    """Return the unit normal of each fan (m, d), as ``slideviz.mesh.fans.fan_normals``."""
    boundary = setup.boundary
    fans = setup.wall_fans
    corners = _corners(setup, coords)
    if boundary.dim == 2:
        vectors = transform(TURN, corners[1] - corners[0])
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
