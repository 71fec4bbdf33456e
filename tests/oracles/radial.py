"""Radial sums and matrices as the thesis writes them, one pair at a time."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, sqrt

import numpy as np

Distance = Callable[[np.ndarray, np.ndarray], float]
Terms = Callable[[np.ndarray], np.ndarray]
"""The terms of a polynomial at positions (n, d), (n, q)."""


def wendland_c2(xi: float) -> float:
    """Table 2.1, with the support of Eq. 2.8."""
    return (1 - xi) ** 4 * (4 * xi + 1) if xi <= 1 else 0.0


def euclidean(x, c) -> float:
    """Eq. 2.10."""
    return sqrt(sum((a - b) ** 2 for a, b in zip(x, c, strict=True)))


def translational(period: float, axis: int) -> Distance:
    """Eq. 2.13 with the period along one axis."""

    def distance(x, c) -> float:
        total = 0.0
        for k in range(len(x)):
            gap = x[k] - c[k]
            if k == axis:
                gap = period / pi * sin(gap * pi / period)
            total += gap**2
        return sqrt(total)

    return distance


def cylindrical(x, c) -> float:
    """Eq. 2.14; points as (r, theta[, z])."""
    height = x[2] - c[2] if len(x) == 3 else 0.0
    return sqrt(max(0.0, x[0] ** 2 + c[0] ** 2 - 2 * x[0] * c[0] * cos(x[1] - c[1]) + height**2))


def rotational(period: float) -> Distance:
    """Eq. 2.15; points as (r, theta[, z]), the period in radians."""

    def distance(x, c) -> float:
        height = x[2] - c[2] if len(x) == 3 else 0.0
        turn = period / pi * sin((x[1] - c[1]) * pi / period)
        return sqrt(max(0.0, x[0] ** 2 + c[0] ** 2 - 2 * x[0] * c[0] * cos(turn) + height**2))

    return distance


def phi(targets, controls, radius: float, distance: Distance = euclidean) -> np.ndarray:
    """Matrix of Eq. 2.4, entry by entry."""
    out = np.zeros((len(targets), len(controls)))
    for i, x in enumerate(targets):
        for j, c in enumerate(controls):
            out[i, j] = wendland_c2(distance(x, c) / radius)
    return out


def sums(targets, controls, weights, radius: float, distance: Distance = euclidean) -> np.ndarray:
    """Eq. 2.6."""
    out = np.zeros((len(targets), weights.shape[1]))
    for i, x in enumerate(targets):
        for j, c in enumerate(controls):
            out[i] += weights[j] * wendland_c2(distance(x, c) / radius)
    return out


def no_terms(x) -> np.ndarray:
    """No polynomial: (n, 0)."""
    return np.zeros((len(x), 0))


def regular(
    targets,
    controls,
    values,
    radius: float,
    distance: Distance = euclidean,
    terms: Terms = no_terms,
):
    """Eq. 2.4, 2.5 and 2.7; least squares, so that periodic images in one system do not matter."""
    along, d = terms(controls), values.shape[1]
    n, q = along.shape
    system = np.block(
        [[phi(controls, controls, radius, distance), along], [along.T, np.eye(q) * 0]]
    )
    found = np.linalg.lstsq(system, np.r_[values, np.zeros((q, d))], rcond=1e-13)[0]
    return sums(targets, controls, found[:n], radius, distance) + terms(targets) @ found[n:]
