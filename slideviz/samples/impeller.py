"""The sample ``impeller``: a passage of a centrifugal compressor, which turns from axial to radial.

The grid of ``passage``, an O-grid in a channel, is smoothed in the plane of m' and theta of the
middle of the span (dm' = dm / r, with the arc length m in the meridional plane), which keeps
angles. Hub and shroud are quarters of ellipses in the meridional plane, continued straight; the
grid is the same at all spans between them. The case twists and leans the blade over its span.
"""

from __future__ import annotations

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.samples.passage import (
    BladeSection,
    Shares,
    counts,
    make_grid,
    smoothed,
    straight_points,
)
from slideviz.samples.stator import Stack
from slideviz.samples.thesis import mesh_of

SIZES = (3_000, 1_000_000)  # least and largest number of cells
BLADES = 13
HUB = (0.80, 0.30, 1.0)
SHROUD = (0.64, 0.60, 1.0)
"""Length along the axis, and radius at inflow and exit, in exit radii."""
EDGES = (0.35, 1.35)  # place of leading and trailing edge, as `_meridional` counts, in radians
ENDS = (-0.5, 1.35)  # as of `BladeSection`, in chords
HOLE = (-0.12, 1.1, 0.11)  # as well
ANGLES_DEG = (-45.0, -30.0)  # in the plane of m' and theta
THICKNESS = (0.06, 0.05, 1.4)
SHARES = Shares(ahead=16, along=56, behind=18, beside=16, layers=12, nose=0.5, tail=0.5)
FINE = 4001  # points with which m' is integrated


def _meridional(place: FloatArray, span: FloatArray) -> FloatArray:
    """Return z and r (n, 2) at places (n,) along the walls, 0 to π/2 on the ellipses, and spans."""
    turn = np.clip(place, 0.0, np.pi / 2)
    walls = [
        np.stack(
            [
                length * (np.sin(turn) + np.minimum(place, 0.0)),
                first + (last - first) * (1.0 - np.cos(turn) + np.maximum(place - np.pi / 2, 0.0)),
            ],
            axis=-1,
        )
        for length, first, last in (HUB, SHROUD)
    ]
    return walls[0] + span[:, None] * (walls[1] - walls[0])


@record
class Impeller(Stack):
    """A `Stack` of one plane (1, m, 2), of place and theta, between hub and shroud."""

    def points(self, nodes: IntArray) -> FloatArray:
        """Return the coordinates (k, 3) of nodes (k,), which are numbered from hub to shroud."""
        layer, column, span = self.places(nodes)
        place, theta = self.planes[0, column].T
        z, r = _meridional(place, span[layer]).T
        return np.stack([r * np.cos(theta), r * np.sin(theta), z], axis=1)


def impeller_mesh(size: int) -> Mesh:
    """Return the mesh of ``impeller``, about ``size`` hexahedra; CaseError if not in ``SIZES``."""
    if not SIZES[0] <= size <= SIZES[1]:
        raise CaseError(f"size {size} is out of range; an impeller has {SIZES[0]} to {SIZES[1]}")
    along = next(
        n for n in range(12, 1000) if len(make_grid(counts(n, SHARES)).quads) * n / 2 > size
    )
    grid = make_grid(counts(along, SHARES))
    place = np.linspace(-1.0, np.pi, FINE)
    z, r = _meridional(place, np.full(FINE, 0.5)).T
    steps = np.hypot(np.diff(z), np.diff(r)) / (0.5 * (r[1:] + r[:-1]))
    m_prime = np.concatenate([[0.0], np.cumsum(steps)])
    first, last = np.interp(EDGES, place, m_prime)
    chord = last - first
    section = BladeSection(ANGLES_DEG, THICKNESS, 2 * np.pi / BLADES / chord, ENDS, HOLE)
    points = smoothed(grid, straight_points(grid, section))
    at = np.interp(first + chord * points[:, 0], m_prime, place)
    plane = np.column_stack([at, chord * points[:, 1]])
    return mesh_of(Impeller(grid, plane[None], max(round(size / len(grid.quads)), 1)), "impeller")
