"""Radial functions between nodes in a frame: sums at targets, and symmetric matrices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.rbf import compiled

CHUNK = 25_000_000
"""Pairs between two calls of ``tick``: some tens of milliseconds."""

Tick = Callable[[float], None]


def no_tick(fraction: float) -> None:
    """Do nothing: the progress callback of those who want none."""


@dataclass(frozen=True)
class Basis:
    """The radial function with its support and its distance rule.

    Attributes
    ----------
    radius : float
        Support radius R, in the mesh's length unit.
    period : float
        Angle in radians of a rotational periodic distance (Eq. 2.15); 0: Euclidean features.
    """

    radius: float
    period: float = 0.0

    @property
    def half(self) -> float:
        """Return theta_p / pi, the factor of the inner sine; 0 for Euclidean features."""
        return self.period / np.pi


def evaluate(
    basis: Basis,
    targets: FloatArray,
    controls: FloatArray,
    weights: FloatArray,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return s at the targets, (N, d).

    Parameters
    ----------
    basis
        Radial function, support radius and distance.
    targets, controls : (k, N), (k, n)
        Features, as ``Frame.features`` gives them; k = 2, 3 or 4.
    weights : (n, d)
        Coefficients alpha of Eq. 2.6, d = 1 to 3 components.
    tick
        Called between chunks with the fraction done; may raise to stop.
    """
    rotational = basis.period > 0
    rows = 4 if rotational or len(targets) == 4 else 3
    x, c = _rows(targets, rows), _rows(controls, rows)
    w = _rows(weights.T, 3)
    total, scale = x.shape[1], 1.0 / basis.radius
    out = np.empty((3, total))
    size = max(1, CHUNK // max(1, c.shape[1]))
    for start in range(0, total, size):
        part = np.ascontiguousarray(x[:, start : start + size])
        result = np.empty_like(part[:3])
        with compiled.LOCK:
            if rotational:
                compiled.sum_rotational(part, c, w, basis.half, scale, result)
            elif rows == 4:
                compiled.sum_four(part, c, w, scale, result)
            else:
                compiled.sum_three(part, c, w, scale, result)
        out[:, start : start + size] = result
        tick(min(1.0, (start + size) / total))
    return np.ascontiguousarray(out[: weights.shape[1]].T)


def matrix(
    basis: Basis,
    features: FloatArray,
    directions: FloatArray | None = None,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return G_ab = phi(|x_a - x_b|) (n_a . n_b), (n, n), symmetric.

    Parameters
    ----------
    features : (k, n)
        Of the node of each constraint.
    directions : (n, d) or None
        Unit direction of each constraint; None leaves the dot product out.
    """
    c = _rows(features, 4)
    n = c.shape[1]
    normals = np.zeros((0, n)) if directions is None else np.ascontiguousarray(directions.T)
    out = np.empty((n, n))
    size = max(1, CHUNK // max(1, n))
    for start in range(0, n, size):
        stop = min(n, start + size)
        with compiled.LOCK:
            compiled.fill_matrix(
                c, normals, basis.half, 1.0 / basis.radius, (start, stop), out[start:stop]
            )
        tick(stop / n)
    return out


def _rows(values: FloatArray, rows: int) -> FloatArray:
    """Return the array (k, n) with zero rows added up to ``rows``, contiguous."""
    out = np.zeros((rows, values.shape[1]))
    out[: len(values)] = values
    return out
