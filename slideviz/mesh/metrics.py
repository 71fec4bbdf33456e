"""Skew metrics: f_skew of each element type, how far its corners are from ideal ones.

Triangle, quadrilateral, tetrahedron and hexahedron are Knupp's (thesis Eq. 2.45 to 2.48). For
the prism and the pyramid no such metric was published that we know of: theirs are our own.

Every function returns (m,), at most 1 up to rounding and 1 for the ideal cell, from the edges
(e, d, k, m) that leave the k corners and the corner Jacobians ``alpha`` (k, m), all positive.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce

import numpy as np

from slideviz.mesh.jacobians import dot, total
from slideviz.mesh.model import FloatArray
from slideviz.terms import Metric

Skew = Callable[[FloatArray, FloatArray], FloatArray]


def _triangle(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    a, b = edges[:, :, 0]
    return np.sqrt(3) * alpha[0] / (dot(a, a) + dot(b, b) - dot(a, b))


def _tetrahedron(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    a, b, c = edges[:, :, 0]
    squares = 1.5 * (dot(a, a) + dot(b, b) + dot(c, c))
    return 3 * np.cbrt(2 * alpha[0] ** 2) / (squares - dot(a, b) - dot(b, c) - dot(c, a))


def _corner_ratio(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    """Return (k, m): the product of the edge lengths over the Jacobian, 1 at a right corner."""
    return np.sqrt(reduce(np.multiply, [dot(edge, edge) for edge in edges])) / alpha


def _quadrilateral(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    return 4 / total(_corner_ratio(edges, alpha))


def _hexahedron(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    return 8 / total(np.cbrt(_corner_ratio(edges, alpha) ** 2))


def _hexahedron_rbf_slide(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    """As `_hexahedron`, but without the exponent 2/3 of Knupp and of thesis Eq. 2.48."""
    return 8 / total(_corner_ratio(edges, alpha))


def _prism(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    """Ours: as the hexahedron, but 1 for a right prism of any height on equal sides."""
    return 6 / total(np.cbrt(0.75 * _corner_ratio(edges, alpha) ** 2))


def _pyramid(edges: FloatArray, alpha: FloatArray) -> FloatArray:
    """Ours: harmonic mean over the base corners of ``3 det(T)^(2/3) / ‖T‖²``, T = W⁻¹ A.

    W has the edges of the pyramid with equal sides, rows (1, 0, 0), (0, 1, 0) and
    (1/2, 1/2, 1/√2); so the rows of T are e₁, e₂ and √2 (e₃ - (e₁ + e₂) / 2). Unlike the other
    types this is a *shape*: it is lower for a tall or a flat pyramid as well.
    """
    a, b, c = edges
    axis = c - 0.5 * (a + b)
    norm = dot(a, a) + dot(b, b) + 2 * dot(axis, axis)
    return 4 / total(norm / (3 * np.cbrt(2 * alpha**2)))


KNUPP: dict[int, Skew] = {
    5: _triangle,
    9: _quadrilateral,
    10: _tetrahedron,
    12: _hexahedron,
    13: _prism,
    14: _pyramid,
}
METRICS: Mapping[Metric, Mapping[int, Skew]] = {
    "knupp": KNUPP,
    "rbf-slide": {**KNUPP, 12: _hexahedron_rbf_slide},
}
"""Formula by metric and VTK identifier."""
