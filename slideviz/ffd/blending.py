"""Blending functions of one direction of a box: clamped uniform B-splines.

``n`` control points and the order ``o`` (degree ``o - 1``) have the knots 0 and 1, each ``o``
times, and between them ``n - o`` evenly. With ``o = n`` there are none between, and the functions
are the Bernstein polynomials: Bézier boxes are that case. Piegl and Tiller, *The NURBS Book*,
algorithms A2.2 and A2.3.
"""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray


def knots(count: int, order: int) -> FloatArray:
    """Return the knots of ``count`` functions of an order, (count + order,)."""
    inner = np.arange(1, count - order + 1) / (count - order + 1)
    return np.concatenate([np.zeros(order), inner, np.ones(order)])


def blending(count: int, order: int, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the functions and their derivatives at parametric coordinates.

    Parameters
    ----------
    count, order : int
        Control points, and the order of the functions, from 1 to ``count``.
    at : (m,) float64
        Parametric coordinates; outside of [0, 1] the outermost polynomials are continued.

    Returns
    -------
    values, slopes : (m, count) float64
        The functions, and their derivatives with respect to the coordinate.
    """
    knot, degree = knots(count, order), order - 1
    span = np.clip(np.searchsorted(knot, at, "right") - 1, degree, count - 1)
    lower = np.zeros((len(at), 0))
    found = np.ones((len(at), 1))
    for j in range(1, order):
        lower = found
        # The two knots around each function of degree j - 1 that is not zero in the span.
        left = knot[span[:, None] + np.arange(1 - j, 1)]
        right = knot[span[:, None] + np.arange(1, j + 1)]
        part = lower / (right - left)
        found = np.zeros((len(at), j + 1))
        found[:, :-1] = (right - at[:, None]) * part
        found[:, 1:] += (at[:, None] - left) * part
    slope = np.zeros_like(found)
    if degree:
        left = knot[span[:, None] + np.arange(1 - degree, 1)]
        right = knot[span[:, None] + np.arange(1, degree + 1)]
        part = degree * lower / (right - left)
        slope[:, :-1] -= part
        slope[:, 1:] += part
    return _placed(found, span - degree, count), _placed(slope, span - degree, count)


def _placed(values: FloatArray, first: np.ndarray, count: int) -> FloatArray:
    """Return values (m, k) of the functions from ``first`` (m,) on in (m, count); others are 0."""
    out = np.zeros((len(values), count))
    rows = np.arange(len(values))[:, None]
    out[rows, first[:, None] + np.arange(values.shape[1])] = values
    return out
