"""The sample ``wing``: a swept, tapered wing on a symmetry plane, in an H-grid of hexahedra.

Its sections are lenses, of two arcs, whose thickness goes to zero at the tip; beyond the edges and
the tip, the grid continues over the wing's plane. The case twists it and bends it up.
"""

from __future__ import annotations

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh

SIZES = (2_000, 2_000_000)  # least and largest number of cells
COUNTS = np.array([10, 20, 12, 18, 8, 12])
"""Cells ahead of the wing, along its chord and behind; along its span and beyond; above it."""
CELLS = 42 * 26 * 24
TAPER = 0.4  # chord of the tip over that of the root, which is 1
HALF_SPAN = 3.0
SWEEP_DEG = 30.0  # of the leading edge
THICKNESS = 0.12  # over the chord, but near the tip
TIP = 12.0  # power of the span by which the thickness falls there
FAR = 6.0  # distance of the far field, in root chords
FIRST = 2e-3  # height of the first cells, in root chords
HEXAHEDRON = 12
QUADRILATERAL = 9


def _growing(first: float, length: float, count: int) -> FloatArray:
    """Return ``count`` + 1 numbers from 0 to a length, whose steps grow alike from about ``first``.

    With one ratio, found by bisection.
    """
    low = 1.0
    high = 10.0
    for _ in range(60):
        ratio = 0.5 * (low + high)
        steps = ratio ** np.arange(count)
        if first * steps.sum() < length:
            low = ratio
        else:
            high = ratio
    return np.concatenate([[0.0], np.cumsum(steps)]) * length / steps.sum()


def wing_mesh(size: int) -> Mesh:
    """Return the mesh of ``wing``, about ``size`` hexahedra; CaseError if not in ``SIZES``."""
    if not SIZES[0] <= size <= SIZES[1]:
        raise CaseError(f"size {size} is out of range; a wing has {SIZES[0]} to {SIZES[1]}")
    scale = (size / CELLS) ** (1.0 / 3.0)
    counts = np.maximum(np.rint(COUNTS * scale), 1.0).astype(int).tolist()
    ahead, chord, behind, along, beyond, above = counts
    on = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, chord + 1))
    before = _growing(float(on[1]), FAR, ahead)
    after = _growing(float(on[1]), FAR, behind)
    place = np.concatenate([-before[:0:-1], on, 1.0 + after[1:]])  # 0 to 1 on the wing
    eta = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, along + 1))
    eta = np.concatenate([eta, 1.0 + _growing(float(eta[-1] - eta[-2]), 1.0, beyond)[1:]])
    place, eta = np.meshgrid(place, eta, indexing="ij")
    span = np.minimum(eta, 1.0)
    length = 1.0 + span * (TAPER - 1.0)
    x = HALF_SPAN * eta * np.tan(np.radians(SWEEP_DEG)) + length * place
    inside = np.clip(place, 0.0, 1.0)
    thick = 2.0 * THICKNESS * length * inside * (1.0 - inside) * (1.0 - span**TIP)
    height = _growing(FIRST, FAR, above)
    z = thick[..., None] + height * (1.0 - thick[..., None] / FAR)
    z = np.concatenate([-z[..., ::-1], z], axis=-1)
    each = np.broadcast_arrays(x[..., None], HALF_SPAN * eta[..., None], z)
    nodes = np.arange(z.size).reshape(z.shape)
    nodes[..., above] += thick == 0.0  # above and below are one beside the wing
    used, flat = np.unique(nodes, return_inverse=True)
    nodes = flat.reshape(z.shape)
    layers = np.delete(np.arange(2 * above + 1), above)
    low = _quads(nodes[..., :-1])
    high = _quads(nodes[..., 1:])
    wing = _quads(nodes[ahead : ahead + chord + 1, : along + 1, above : above + 2])
    ends = (nodes[[0, -1]].transpose(1, 2, 0), nodes[:, -1:].transpose(0, 2, 1))
    far = [_quads(sheet)[:, layers] for sheet in ends]
    sides = {
        "wing": [wing],
        "symmetry": [_quads(nodes[:, :1].transpose(0, 2, 1))[:, layers]],
        "farfield": [*far, _quads(nodes[..., [0, -1]])],
    }
    markers = []
    for name, sheets in sides.items():
        rows = np.concatenate([sheet.reshape(-1, 4) for sheet in sheets])
        markers.append(Marker(name, Cells.from_blocks([(QUADRILATERAL, rows)])))
    cells = np.concatenate([low, high], axis=-1)[:, :, layers].reshape(-1, 8)
    points = np.stack(each, axis=-1).reshape(-1, 3)[used]
    return Mesh(points, Cells.from_blocks([(HEXAHEDRON, cells)]), tuple(markers), name="wing")


def _quads(nodes: IntArray) -> IntArray:
    """Return the quadrilaterals (a, b, c, 4) of c sheets of nodes, (a + 1, b + 1, c)."""
    corners = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    return np.stack(corners, axis=-1)
