"""Interpolation with 50 digits, as the thesis writes it."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np

EXACT = np.vectorize(lambda number: Decimal(float(number)), otypes=[object])
ROOT = np.vectorize(lambda number: number.sqrt(), otypes=[object])
FUNCTIONS = {
    "wendland-c2": lambda q: (1 - q) ** 4 * (4 * q + 1),
    "wendland-c0": lambda q: (1 - q) ** 2,
    "wendland-c4": lambda q: (1 - q) ** 6 * (EXACT(35 / 3) * q**2 + 6 * q + 1),
    "wendland-c6": lambda q: (1 - q) ** 8 * (32 * q**3 + 25 * q**2 + 8 * q + 1),
    "ctps-c0": lambda q: (1 - q) ** 5,
}


def matrix(points, controls, radius, kernel="wendland-c2"):
    """The radial functions of points (N, d) and controls (n, d), as Decimals (N, n)."""
    x, c = EXACT(points), EXACT(controls)
    square = ((x[:, None] - c[None]) ** 2).sum(axis=-1)
    return FUNCTIONS[kernel](np.minimum(ROOT(square) / Decimal(float(radius)), Decimal(1)))


def solved(system, right):
    """The solutions (n, m) of a system of Decimals, by elimination."""
    system, right = system.copy(), right.copy()
    for k in range(len(system)):
        part = system[k + 1 :, k] / system[k, k]
        system[k + 1 :, k:] -= part[:, None] * system[k, k:]
        right[k + 1 :] -= part[:, None] * right[k]
    weights = np.empty_like(right)
    for k in reversed(range(len(system))):
        weights[k] = (right[k] - system[k, k + 1 :] @ weights[k + 1 :]) / system[k, k]
    return weights


def interpolated(points, controls, values, radius, kernel="wendland-c2"):
    """The interpolant (N, m) at points of values (n, m) at controls, and its weights, rounded."""
    with localcontext() as context:
        context.prec = 50
        system = matrix(controls, controls, radius, kernel)
        weights = solved(system, EXACT(values))
        field = matrix(points, controls, radius, kernel) @ weights
        return field.astype(float), weights.astype(float)
