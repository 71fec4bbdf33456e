"""Coordinates along an axis and across it, and sums whose bits renumbering does not change."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.mesh.model import FloatArray

Triple = tuple[float, float, float]
Vector = Sequence[float] | FloatArray  # three numbers

Z_AXIS = (0.0, 0.0, 1.0)


def axis_basis(axis: Vector) -> FloatArray:
    """Return unit vectors e1, e2, e3 as rows (3, 3), right-handed, with e3 along ``axis``.

    Raises MeshError if the axis has length zero.
    """
    return _basis_of(*map(float, axis)).copy()


@lru_cache(16)
def _basis_of(*axis: float) -> FloatArray:
    """Return what `axis_basis` does, cached: not to be written to."""
    direction = np.array(axis)
    length = np.linalg.norm(direction)
    if not length > 0:
        raise MeshError("the axis of rotation has length zero; give a direction such as 0, 0, 1")
    e3 = direction / length
    # The cyclic next axis after the largest component: for z this gives e1 = x, e2 = y exactly.
    start = np.eye(3)[(int(np.argmax(np.abs(e3))) + 1) % 3]
    e1 = start - (start @ e3) * e3
    e1 /= np.linalg.norm(e1)
    return np.stack([e1, np.cross(e3, e1), e3])


def ordered_sum(values: NDArray) -> NDArray:
    """Return the sum (d,) of rows (n, d), the same bits in whatever order they are given."""
    return np.sort(values, axis=0).sum(axis=0)


def along(rows: FloatArray, points: FloatArray) -> FloatArray:
    """Return the scalar products (n, k) of points (n, d) with the vectors ``rows`` (k, d).

    The terms are added up in order: a matrix product rounds a point by its place among the others,
    so that renumbered nodes would have other bits.
    """
    parts = [sum(x * value for x, value in zip(points.T, row, strict=True)) for row in rows]
    return np.stack(parts, axis=1)


def in_axis_frame(
    points: FloatArray, axis: Vector = Z_AXIS, origin: Vector = (0.0, 0.0, 0.0)
) -> FloatArray:
    """Return the coordinates (n, 3) of points (n, d) from ``origin``, along `axis_basis`."""
    padded = np.zeros((len(points), 3))
    padded[:, : points.shape[1]] = points
    return along(axis_basis(axis), padded - np.asarray(origin, float))


def axis_text(axis: Vector) -> str:
    """Return "x", "y" or "z" for a unit vector (3,) along that axis, else the components."""
    for word, unit in zip("xyz", np.eye(3), strict=True):
        if np.allclose(axis, unit):
            return word
    return f"({', '.join(f'{v:.4g}' for v in axis)})"
