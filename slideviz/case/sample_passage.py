"""The mesh of the sample ``passage``: one blade of a linear turbine cascade.

An O-grid lies around the blade, in a rectangular hole of a channel of quadrilaterals (H-grid).
Both are drawn with straight lines first and then smoothed as one, with the
nodes of the periodic sides free and moving in pairs.
"""

from __future__ import annotations

import numpy as np

from slideviz.case.model import Case, Rotate, Translate
from slideviz.case.sample_blade import blade_nodes
from slideviz.case.sample_channel import Counts, channel_numbers, channel_points, counts
from slideviz.case.sample_smooth import smooth
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh

WALL = 0.05
"""Height of the cells at the blade over that of the O-grid's outermost ones."""
LINE, QUADRILATERAL = 3, 9


def passage_mesh(size: int) -> Mesh:
    """Return the smoothed mesh, with ``size`` cells along the inflow.

    Raises
    ------
    CaseError
        ``size`` is below 12.
    """
    n = counts(size)
    number = channel_numbers(n)
    channel = channel_points(n)[number.ravel() >= 0]
    ring = _ring(n, number)
    quads, rho = _quads(n, number, ring)
    points = np.concatenate([channel, _ring_points(n, channel[ring[-1]])])
    points = smooth(points, quads, rho, _unknowns(len(points), number, ring))
    loop = np.column_stack([ring[0], np.roll(ring[0], -1)])
    sides = {"airfoil": loop, "inflow": _line(number[0]), "outflow": _line(number[-1])}
    sides |= {"periodic_1": _line(number[:, 0]), "periodic_2": _line(number[:, -1])}
    markers = [Marker(name, Cells.from_blocks([(LINE, side)])) for name, side in sides.items()]
    return Mesh(points, Cells.from_blocks([(QUADRILATERAL, quads)]), tuple(markers), name="passage")


def passage_case() -> Case:
    """Return the case that turns and lifts the blade, the periodic sides following."""
    return Case(
        roles={
            "airfoil": "moving",
            "inflow": "sliding",
            "outflow": "sliding",
            "periodic_1": "periodic",
            "periodic_2": "periodic",
        },
        motions=(Rotate("airfoil", -8.0), Translate("airfoil", (0.0, 0.12))),
        sliding="ps",
        periodic="moving",
        periodic_type="translational",
        steps=5,
    )


def _ring(n: Counts, number: IntArray) -> IntArray:
    """Return the nodes of the O-grid, from the blade out, counter-clockwise: (layers + 1, k).

    Column 0 starts at the leading edge, a quarter up the hole's first side. The trailing edge
    goes to the corner of pressure side and outflow. That is how the blade is turned against the
    hole, and what leaves the cells nearly orthogonal.
    """
    hole = number[n.ahead : n.ahead + n.along + 1, n.below : n.below + n.beside + 1]
    rim = np.concatenate([hole[:-1, 0], hole[-1, :-1], hole[:0:-1, -1], hole[0, :0:-1]])
    rim = np.roll(rim, _nose(n))
    inner = number.max() + 1 + np.arange(n.layers * len(rim)).reshape(n.layers, -1)
    return np.concatenate([inner, rim[None]])


def _nose(n: Counts) -> int:
    """Return the number of edges from the leading edge to the corner below it."""
    return round(n.beside / 4)


def _thickness(n: Counts) -> FloatArray:
    """Return the heights of the O-grid's layers, from the blade out, the last being 1."""
    return WALL ** (np.arange(n.layers)[::-1] / (n.layers - 1))


def _ring_points(n: Counts, rim: FloatArray) -> FloatArray:
    """Return the O-grid's nodes on straight lines from the blade to the rim, without it."""
    lower = _nose(n) + n.along
    blade = blade_nodes(lower, len(rim) - lower)
    height = _thickness(n)
    part = (np.concatenate([[0.0], np.cumsum(height)[:-1]]) / height.sum())[:, None, None]
    return (blade + part * (rim - blade)).reshape(-1, 2)


def _quads(n: Counts, number: IntArray, ring: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the cells (m, 4), counter-clockwise, and their height over width (m,)."""
    around = np.roll(ring, -1, axis=1)
    channel = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    o_grid = [ring[1:], around[1:], around[:-1], ring[:-1]]
    h_quads = np.column_stack([part.ravel() for part in channel])
    inside = np.zeros([size - 1 for size in number.shape], bool)
    inside[n.ahead : n.ahead + n.along, n.below : n.below + n.beside] = True
    h_quads = h_quads[~inside.ravel()]
    o_quads = np.column_stack([part.ravel() for part in o_grid])
    rho = np.concatenate([np.ones(len(h_quads)), np.repeat(_thickness(n), ring.shape[1])])
    return np.concatenate([h_quads, o_quads]), rho


def _unknowns(n_points: int, number: IntArray, ring: IntArray) -> IntArray:
    """Return which coordinates are free, as ``smooth`` wants it: (n, 2).

    The blade is fixed, inflow and outflow slide along their line, and the second periodic side
    moves as the first.
    """
    free = np.ones((n_points, 2), bool)
    free[ring[0]] = False
    free[[number[0], number[-1]], 0] = False
    free[number[:, -1]] = False
    unknown = np.where(free, np.cumsum(free).reshape(-1, 2) - 1, -1)
    unknown[number[:, -1]] = unknown[number[:, 0]]
    return unknown


def _line(nodes: IntArray) -> IntArray:
    """Return the edges of a row of nodes: (k, 2)."""
    return np.column_stack([nodes[:-1], nodes[1:]])
