"""Operations of a deformation on a tape: the maps of the frame, and sums of radial functions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.design.tape import Array, Linear, Variable, apply, value
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.field import linear_terms
from slideviz.rbf.frame_slopes import coords_slopes, features_slopes, points_slopes
from slideviz.rbf.frames import Frame
from slideviz.rbf.slopes import pull_positions, push_positions

PAIRS = 8_000_000
"""Pairs whose radial functions are in memory at a time when many columns share them."""


def flat(rows: FloatArray) -> FloatArray:
    """Return rows (..., n, c) one under the other, (m, c)."""
    return np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]))


def features(frame: Frame, coords: Array) -> Array:
    """Return the features (k, n) of coordinates (n, d)."""
    x = value(coords)
    out = frame.features(x)
    if not isinstance(coords, Variable):
        return out
    slopes = features_slopes(frame, x)
    return apply(
        out,
        (
            coords,
            lambda t: np.einsum("nkd,...nd->...kn", slopes, t, optimize=True),
            lambda g: np.einsum("nkd,...kn->...nd", slopes, g, optimize=True),
        ),
    )


def columns(x: Array, nodes: IntArray) -> Array:
    """Return some columns of features (k, n)."""
    v = value(x)

    def back(g: FloatArray) -> FloatArray:
        out = np.zeros((*g.shape[:-1], v.shape[-1]))
        np.add.at(out, (..., nodes), g)  # type: ignore[arg-type]
        return out

    return apply(v[..., nodes], (x, lambda t: t[..., nodes], back))


def points(frame: Frame, coords: Array) -> Array:
    """Return the Cartesian points of coordinates (..., n, d)."""
    x = value(coords)
    if not frame.cylindrical:
        return coords
    out = frame.points(flat(x)).reshape(x.shape)
    return _turned(coords, out, lambda: points_slopes(frame, x))


def coords(frame: Frame, at: Array) -> Array:
    """Return the coordinates of Cartesian points (..., n, d)."""
    x = value(at)
    if not frame.cylindrical:
        return at
    out = frame.coords(flat(x)).reshape(x.shape)
    return _turned(at, out, lambda: coords_slopes(frame, x))


def difference(frame: Frame, start: FloatArray, vectors: Array) -> Array:
    """Return Cartesian displacements (..., n, d) of points (n, d) as components of the frame."""
    v = value(vectors)
    full = np.broadcast_to(start, v.shape)
    out = frame.difference(flat(full), flat(v)).reshape(v.shape)
    if not frame.cylindrical:
        return apply(out, (vectors, lambda t: t, lambda g: g))
    return _turned(vectors, out, lambda: coords_slopes(frame, start + v))


def _turned(x: Array, out: FloatArray, slopes_of: Callable[[], FloatArray]) -> Array:
    """Return the outcome of a map of rows with derivatives (n, e, d)."""
    if not isinstance(x, Variable):
        return out
    slopes = slopes_of()
    return apply(
        out,
        (
            x,
            lambda t: np.einsum("ned,...nd->...ne", slopes, t),
            lambda g: np.einsum("ned,...ne->...nd", slopes, g),
        ),
    )


def radial_sum(basis: Basis, targets: Array, controls: Array, weights: Array) -> Array:
    """Return s (..., N, d) at features (k, N), from features (k, n) and weights (..., n, d)."""
    x, c, w = value(targets), value(controls), value(weights)

    def pushed(**moved: FloatArray) -> FloatArray:
        ((name, change),) = moved.items()
        return _each(lambda t: push_positions(basis, x, c, w, **{name: t}), change)

    def turned(g: FloatArray) -> FloatArray:
        return many(basis, c, x, g)

    return apply(
        many(basis, x, c, w),
        (
            targets,
            lambda t: pushed(moved=t),
            lambda g: _each(lambda each: pull_positions(basis, x, c, each, w), g),
        ),
        (
            controls,
            lambda t: pushed(moved_controls=t),
            lambda g: _each(lambda each: pull_positions(basis, c, x, w, each), g),
        ),
        (weights, lambda t: many(basis, x, c, t), turned),
    )


def _each(work: Linear, stacked: FloatArray) -> FloatArray:
    """Return what ``work`` makes of each of the arrays (..., n, c)."""
    if stacked.ndim == 2:
        return work(stacked)
    return np.stack([_each(work, each) for each in stacked])


def many(
    basis: Basis, targets: FloatArray, controls: FloatArray, weights: FloatArray
) -> FloatArray:
    """Return s (..., N, d) with the radial functions of each pair computed once for all weights."""
    if weights.ndim == 2:
        return evaluate(basis, targets, controls, weights)
    ahead, (n, d) = weights.shape[:-2], weights.shape[-2:]
    wide = np.ascontiguousarray(np.moveaxis(weights.reshape(-1, n, d), 0, 1).reshape(n, -1))
    total = targets.shape[1]
    out = np.empty((wide.shape[1] // d, total, d))
    size = max(1, PAIRS // max(1, n))
    for start in range(0, total, size):
        part = slice(start, min(total, start + size))
        values = matrix(basis, (targets[:, part], None), (controls, None)) @ wide
        out[:, part] = np.moveaxis(values.reshape(-1, len(out), d), 1, 0)
    return out.reshape(*ahead, total, d)


def terms(basis: Basis, x: Array) -> Array:
    """Return the terms (n, q) of the linear polynomial at features (k, n)."""
    v = value(x)
    out = linear_terms(basis, v)
    if not isinstance(x, Variable):
        return out
    k, n = v.shape
    slopes = np.zeros((n, out.shape[1], k))
    if basis.period > 0:
        slopes[:, 1, 0] = slopes[:, 4, 3] = 1.0
        slopes[:, 2, 1], slopes[:, 2, 2] = -2.0 * v[1], 2.0 * v[2]
        slopes[:, 3, 1], slopes[:, 3, 2] = 2.0 * v[2], 2.0 * v[1]
    else:
        slopes[:, range(1, k + 1), range(k)] = 1.0
    return apply(
        out,
        (
            x,
            lambda t: np.einsum("nqk,...kn->...nq", slopes, t),
            lambda g: np.einsum("nqk,...nq->...kn", slopes, g),
        ),
    )
