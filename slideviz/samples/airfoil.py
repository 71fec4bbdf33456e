"""The sample ``airfoil``: an airfoil turned in a far field fifty times as wide as its chord.

The airfoil is one of N. E. Joukowski's, a circle mapped by z = zeta + 1 / zeta, with a rounded
trailing edge. The mesh is that of circles and rays around the circle, mapped alike: an O-mesh whose
lines cross at right angles, with square cells but for the layers at the wall.
"""

from __future__ import annotations

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, Marker, Mesh

LEAST = 16  # fewest cells around the airfoil

CENTRE = -0.06
RADIUS = 1.12
"""The circle: the airfoil is 12 % thick. One of radius 1.06 has a cusp for a trailing edge."""

FAR = 50.0  # radius of the far field over the chord

THIN = 1e-3
GROWTH = 1.25
"""Height over length of the first cells of a layer, and the ratio of the heights of neighbours."""


def airfoil_mesh(size: int, variant: str) -> Mesh:
    """Return the mesh with ``size`` cells around the airfoil; its chord is 1.

    Variant ``layers`` has cells of a thousandth of their length at the airfoil. Raises CaseError if
    ``size`` is below `LEAST`.
    """
    if size < LEAST:
        raise CaseError(
            f"size {size} is too coarse for the airfoil; expected {LEAST} cells or more"
        )
    circle = np.exp(1j * np.arange(size) / size * 2.0 * np.pi)
    front = CENTRE - RADIUS + 1.0 / (CENTRE - RADIUS)
    end = CENTRE + RADIUS + 1.0 / (CENTRE + RADIUS)
    out = np.exp(_rings(size, np.log(FAR * (end - front) / RADIUS), variant == "layers"))
    zeta = CENTRE + RADIUS * out[:, None] * circle
    z = (zeta + 1.0 / zeta - front) / (end - front)
    number = np.arange(z.size).reshape(z.shape)
    here = number[:-1]
    next_ = np.roll(number, -1, axis=1)[:-1]
    quads = np.stack([here, number[1:], np.roll(number, -1, axis=1)[1:], next_], axis=-1)
    sides = {"airfoil": number[0], "farfield": number[-1]}
    markers = [
        Marker(name, Cells.from_blocks([(3, np.stack([ring, np.roll(ring, -1)], axis=1))]))
        for name, ring in sides.items()
    ]
    cells = Cells.from_blocks([(9, quads.reshape(-1, 4))])
    points = np.stack([z.real.ravel(), z.imag.ravel()], axis=1)
    return Mesh(points, cells, tuple(markers), name="airfoil")


def _rings(size: int, last: float, layered: bool) -> FloatArray:
    """Return logarithms of the radii of rings, from 0 to ``last``: equal steps for square cells."""
    side = 2.0 * np.pi / size
    steps = side * np.minimum(THIN * GROWTH ** np.arange(60.0), 1.0) if layered else np.empty(0)
    near = np.r_[0.0, np.cumsum(steps[steps < side])]
    count = max(1, round((last - near[-1]) / side))
    return np.r_[near, np.linspace(near[-1], last, count + 1)[1:]]
