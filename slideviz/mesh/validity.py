"""Validity of cells: a proof that the Jacobian determinant is positive in the whole cell.

======== =============================================================================
triangle one determinant, which is constant: exact; likewise the tetrahedron
quad     four corners; the determinant is linear in each parameter: exact
pyramid  four base corners; the determinant of the collapsed map is (1 - t)² times a
         bilinear function of them: exact
prism    nine Bernstein coefficients; above each corner of the triangle a quadratic
         along the height, whose minimum is known: exact
hexa     27 Bézier coefficients bound the determinant; where they do not decide, the
         cell is cut in eight, up to ``LEVELS`` times, and else it stays *unproven*
======== =============================================================================

"Exact" and "proof" are meant up to the rounding of double precision.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slideviz.mesh.jacobians import (
    INVERTED,
    UNPROVEN,
    VALID,
    hexahedron_coefficients,
    prism_coefficients,
)

if TYPE_CHECKING:
    from slideviz.mesh.model import FloatArray

LEVELS = 6
"""How often a hexahedron is cut before it is called unproven."""

Status = NDArray[np.uint8]

# Coefficients of a quadratic on the first and on the second half of its interval.
_HALVES = np.array(
    [
        [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.25, 0.5, 0.25]],
        [[0.25, 0.5, 0.25], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]],
    ]
)


def decide_unproven(vtk: int, at: FloatArray, signs: NDArray[np.int8]) -> Status:
    """Return the status (m,) of cells whose corners are positive, but not all coefficients.

    Parameters
    ----------
    vtk : int
        Element type: prism or hexahedron.
    at : (3, n, m)
        Node coordinates.
    signs : (m,)
        1, or -1 for a cell that is numbered the other way round.
    """
    if vtk == 12:
        return subdivide(hexahedron_coefficients(at) * signs)
    low, middle, top = prism_coefficients(at) * signs
    # The quadratic with these coefficients touches zero where middle = -√(low · top).
    least = middle + np.sqrt(low * top)
    return np.where((least > 0).all(axis=0), VALID, INVERTED).astype(np.uint8)


def subdivide(coefficients: FloatArray, levels: int = LEVELS) -> Status:
    """Return the status (m,) of triquadratic polynomials, Bézier ``coefficients`` (3, 3, 3, m).

    Each is cut into eight parts, ``levels`` times; a part with only positive coefficients is
    positive, and a part's corner coefficients are values of the polynomial.
    """
    inverted = np.zeros(coefficients.shape[-1], bool)
    owner = np.arange(coefficients.shape[-1])
    parts = coefficients
    for _ in range(levels):
        parts = np.einsum("xai,ijkp->xajkp", _HALVES, parts)
        parts = np.einsum("ybj,xajkp->xyabkp", _HALVES, parts)
        parts = np.einsum("zck,xyabkp->abcxyzp", _HALVES, parts)
        parts = parts.reshape(3, 3, 3, -1)
        owner = np.tile(owner, 8)
        inverted[owner[~(parts[::2, ::2, ::2] > 0).all(axis=(0, 1, 2))]] = True
        open_ = ~(parts > 0).all(axis=(0, 1, 2)) & ~inverted[owner]
        parts, owner = parts[..., open_], owner[open_]
    status = np.where(inverted, INVERTED, VALID).astype(np.uint8)
    status[owner] = UNPROVEN
    return status
