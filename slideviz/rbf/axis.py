"""Nodes on the axis of a cylindrical frame, where the angle is not defined.

A facet with a node on the axis has, in (r, rho theta[, z]), no corner there but all angles of
its other nodes: a corner on the axis takes the angle of the node beside it, and a triangle with
one corner on the axis is a quadrilateral in the frame. Nodes on the axis may move along it only.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.frames import Frame

ON_AXIS = 1e-9
"""Nodes nearer to the axis than this part of the reference radius stay on it."""

TILT = 0.02
"""A surface whose unit normal has a larger component along the axis fixes its nodes on the axis."""


def on_axis(frame: Frame, coords: FloatArray) -> np.ndarray:
    """Return a mask (n,) of the nodes on the axis; none in a Cartesian frame."""
    if not frame.cylindrical:
        return np.zeros(len(coords), bool)
    return coords[:, 0] <= ON_AXIS * frame.radius


def corners(coords: FloatArray, facets: IntArray, axis: np.ndarray) -> FloatArray:
    """Return the corners (f, k, d) of facets or segments (f, k), with angles for those on the axis.

    Parameters
    ----------
    coords : (n, d)
        In the frame.
    facets : (f, k)
        k = 2, or 4, where a triangle repeats its last node.
    axis : (n,) bool
        Nodes on the axis.
    """
    x = coords[facets]
    touching = axis[facets]
    for row in np.flatnonzero(touching.any(axis=1) & ~touching.all(axis=1)):
        x[row] = _corners_at_axis(x[row], touching[row], facets[row])
    return x


def _corners_at_axis(x: FloatArray, touching: np.ndarray, nodes: IntArray) -> FloatArray:
    """Return the corners (k, d) of one facet; those on the axis get the angle of their neighbours.

    A triangle with one corner on the axis becomes a quadrilateral, which begins at the corner
    before and has that corner twice, with the angle of each neighbour; else it gets their mean.

    Parameters
    ----------
    x, touching, nodes : (k, d), (k,) bool, (k,)
        The facet's corners, which of them are on the axis, and its nodes.
    """
    width = len(nodes)
    size = 3 if width == 4 and nodes[2] == nodes[3] else width
    x, touching = x[:size], touching[:size]
    around = [(i - 1) % size for i in range(size)], [(i + 1) % size for i in range(size)]
    if size == 3 and touching.sum() == 1:
        i = touching.tolist().index(True)
        before, after = x[around[0][i]], x[around[1][i]]
        ends = np.stack([x[i], x[i]])
        ends[:, 1] = before[1], after[1]
        return np.stack([before, *ends, after])
    out = x.copy()
    for i in np.flatnonzero(touching).tolist():
        beside = [k for k in (around[0][i], around[1][i]) if not touching[k]]
        out[i, 1] = np.mean(x[beside or np.flatnonzero(~touching), 1])
    return out[[0, 1, 2, 2]] if size == 3 else out


def hold_on_axis(
    nodes: IntArray, normals: FloatArray, axis: np.ndarray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the constraints with those of nodes on the axis replaced, so that they move along it.

    Parameters
    ----------
    nodes, normals : (q,), (q, d)
        Constraints of sliding nodes, rows of one node together.

    Returns
    -------
    nodes, normals : (p,), (p, d)
        The constraints; those of nodes on the axis are the last rows.
    fixed : (h,)
        Nodes on the axis that cannot move along it either (`TILT`; in 2D all of them).
    """
    there = axis[nodes]
    if not there.any():
        return nodes, normals, np.empty(0, np.int64)
    d = normals.shape[1]
    found = np.unique(nodes[there])
    tilted = np.unique(nodes[there][np.abs(normals[there, -1]) > TILT]) if d == 3 else found
    rows = [np.repeat(found, 2), tilted] if d == 3 else [np.repeat(found, 2)]
    directions = [np.tile(np.eye(d)[:2], (len(found), 1))]
    if d == 3:
        directions.append(np.tile(np.eye(d)[2], (len(tilted), 1)))
    out = np.concatenate([nodes[~there], *rows])
    return out, np.concatenate([normals[~there], *directions]), tilted
