"""Skew metrics: f_skew of each element type, how far its corners are from ideal ones.

Triangle, quadrilateral, tetrahedron and hexahedron are Knupp's (thesis Eq. 2.45 to 2.48). For
the prism and the pyramid no such metric was published that we know of: theirs are our own.

Every function returns the skew (m,) of cells: 1 for the ideal cell, else less (up to rounding).
Given are the *spread* (k, m) of each cell's k corners and their Jacobians ``alpha`` (k, m), all
positive. The spread is found by `slideviz.mesh.jacobians.spreads` from the edges that leave a
corner. For quadrilaterals, prisms and hexahedra it is the product of their lengths; for the other
types their functions state it, where λij is the scalar product of edges i and j.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.terms import SkewMetric

Skew = Callable[[FloatArray, FloatArray], FloatArray]
"""A function of spread and Jacobians (k, m) that returns the skew (m,)."""


def ordered_sum(a: FloatArray) -> FloatArray:
    """Return the sum over the first axis, terms added up in order.

    ``a.sum(axis=0)`` adds pairwise where there is a single cell, so that the last bit of a result
    would depend on the size of the parts.
    """
    return reduce(np.add, a)


KNUPP: dict[int, Skew] = {  # by VTK identifier
    # Knupp's (thesis Eq. 2.45), with the spread λ11 + λ22 - λ12.
    5: lambda spread, alpha: np.sqrt(3) * alpha[0] / spread[0],
    # Knupp's: the harmonic mean of alpha / spread, the sines of the corners.
    9: lambda spread, alpha: 4 / ordered_sum(spread / alpha),
    # Knupp's, with the spread 3/2 (λ11 + λ22 + λ33) - λ12 - λ23 - λ13.
    10: lambda spread, alpha: 3 * np.cbrt(2 * alpha[0] ** 2) / spread[0],
    # Knupp's: the harmonic mean of (alpha / spread)^(2/3) over the corners.
    12: lambda spread, alpha: 8 / ordered_sum(np.cbrt((spread / alpha) ** 2)),
    # Our own: as the hexahedron, scaled to 1 for a right prism on an equilateral triangle.
    13: lambda spread, alpha: 6 / ordered_sum(np.cbrt(0.75 * (spread / alpha) ** 2)),
    # Our own: harmonic mean over the base corners of 3 det(T)^(2/3) / ‖T‖², T = W⁻¹ A. A has the
    # edges e₁, e₂, e₃ at a corner as rows, W those of the pyramid with equal edges, (1, 0, 0),
    # (0, 1, 0) and (1/2, 1/2, 1/√2). So the rows of T are e₁, e₂ and √2 (e₃ - (e₁ + e₂) / 2), and
    # the spread is ‖T‖². Unlike the skew of prisms and hexahedra it depends on the height too: it
    # is below 1 for a tall or a flat pyramid.
    14: lambda spread, alpha: 4 / ordered_sum(spread / (3 * np.cbrt(2 * alpha**2))),
}
SKEW_METRICS: Mapping[SkewMetric, Mapping[int, Skew]] = {
    "knupp": KNUPP,
    # Without the exponent 2/3 of Knupp and of thesis Eq. 2.48.
    "rbf-slide": {**KNUPP, 12: lambda spread, alpha: 8 / ordered_sum(spread / alpha)},
}
"""Function of the skew, by metric and VTK identifier."""

_THIRDS = 2 / 3
_EXPONENTS: dict[int, tuple[float, float]] = {  # of KNUPP
    5: (1, 1),
    9: (1, 1),
    10: (1, _THIRDS),
    12: (_THIRDS, _THIRDS),
    13: (_THIRDS, _THIRDS),
    14: (1, _THIRDS),
}
EXPONENTS: Mapping[SkewMetric, Mapping[int, tuple[float, float]]] = {
    "knupp": _EXPONENTS,
    "rbf-slide": {**_EXPONENTS, 12: (1, 1)},
}
"""Exponents a, b of the functions in ``SKEW_METRICS``, by which the skew is differentiated.

Each function is a constant divided by ``Σ_k spread_kᵃ / alpha_kᵇ``
(`slideviz.mesh.quality_derivative`).
"""
