"""The fourteen radial functions as printed, which the compiled loops are tested against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slideviz import terms
from slideviz.mesh.model import FloatArray
from slideviz.rbf.kernels import SHAPE


@dataclass(frozen=True)
class Kernel:
    """A radial function."""

    name: str  # the value of RBF_KERNEL
    compact: bool  # whether it has compact support: is 0 from xi = 1 on
    polynomial: bool  # Whether it needs the linear polynomial of Eq. 2.1.
    function: Callable[[FloatArray], FloatArray]
    """phi(xi) on arrays, as printed: the definition that the compiled loops are tested against."""

    def __call__(self, xi: FloatArray) -> FloatArray:
        """Return phi(xi) for an array of xi >= 0; at 0 its limit."""
        xi = np.asarray(xi, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.where(xi > 0, self.function(xi), self.function(np.full_like(xi, 1e-300)))
        return np.where(xi < 1, value, 0.0) if self.compact else value


def _ctps_c1(x: FloatArray) -> FloatArray:
    return 1 + 80 / 3 * x**2 - 40 * x**3 + 15 * x**4 - 8 / 3 * x**5 + 20 * x**2 * np.log(x)


def _ctps_c2a(x: FloatArray) -> FloatArray:
    return 1 - 30 * x**2 - 10 * x**3 + 45 * x**4 - 6 * x**5 - 60 * x**3 * np.log(x)


def _ctps_c2b(x: FloatArray) -> FloatArray:
    return 1 - 20 * x**2 + 80 * x**3 - 45 * x**4 - 16 * x**5 + 60 * x**4 * np.log(x)


_FUNCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "wendland-c2": lambda x: (1 - x) ** 4 * (4 * x + 1),
    "wendland-c0": lambda x: (1 - x) ** 2,
    "wendland-c4": lambda x: (1 - x) ** 6 * (35 / 3 * x**2 + 6 * x + 1),
    "wendland-c6": lambda x: (1 - x) ** 8 * (32 * x**3 + 25 * x**2 + 8 * x + 1),
    "ctps-c0": lambda x: (1 - x) ** 5,
    "ctps-c1": _ctps_c1,
    "ctps-c2a": _ctps_c2a,
    "ctps-c2b": _ctps_c2b,
    "thin-plate": lambda x: x**2 * np.log(x),
    "multiquadric": lambda x: np.sqrt(SHAPE**2 + x**2),
    "inverse-multiquadric": lambda x: SHAPE / np.sqrt(SHAPE**2 + x**2),
    "quadric": lambda x: 1 + x**2,
    "inverse-quadric": lambda x: 1 / (1 + x**2),
    "gaussian": lambda x: np.exp(-(x**2)),
}
"""phi(xi) by the value of RBF_KERNEL."""

KERNELS: dict[str, Kernel] = {
    name: Kernel(name, terms.KERNELS[name].compact, terms.KERNELS[name].polynomial, function)
    for name, function in _FUNCTIONS.items()
}
"""Radial function by the value of RBF_KERNEL."""
