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

"Exact" and "proof" are meant up to the rounding of double precision. The first three rows, and
cells whose coefficients are all positive, are decided by `slideviz.mesh.jacobians.measure`;
`decide_unproven` decides the others.
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
"""Codes (m,) ``VALID``, ``INVERTED`` or ``UNPROVEN``."""

# Matrices that turn the coefficients of a quadratic into those on each half of its interval.
_HALVES = np.array(
    [
        [[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.25, 0.5, 0.25]],
        [[0.25, 0.5, 0.25], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]],
    ]
)


def decide_unproven(vtk: int, at: FloatArray, signs: NDArray[np.int8]) -> Status:
    """Return the status (m,) of cells with positive corner Jacobians, but not all coefficients.

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
    # A quadratic with these coefficients has minimum zero if middle = -√(low · top).
    product = low * top  # negative by rounding only
    positive = (product >= 0) & (middle + np.sqrt(np.maximum(product, 0.0)) > 0)
    return np.where(positive.all(axis=0), VALID, INVERTED).astype(np.uint8)


def subdivide(coefficients: FloatArray, levels: int = LEVELS) -> Status:
    """Return the status (m,) of triquadratic polynomials with Bézier coefficients (3, 3, 3, m).

    ``VALID`` means positive in the whole unit cube. It is cut into eight parts, ``levels`` times; a
    part with only positive coefficients is positive, and its corner coefficients are values of the
    polynomial, of which one that is not positive decides for ``INVERTED``.
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
