"""Operations of a deformation on a tape: the maps of the frame, and sums of radial functions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import Basis, Tick, evaluate, no_tick, padded_rows, reached
from slideviz.rbf.field import linear_terms
from slideviz.rbf.frames import Frame, coords_slopes, features_slopes, points_slopes
from slideviz.rbf.loops import place, shift
from slideviz.rbf.slopes import pull_positions, push_positions
from slideviz.rbf.solve import enough_threads
from slideviz.rbf.tape import Array, Linear, Link, Variable, linear, recorded, summed, value
from slideviz.system.threads import in_parts


def flat(rows: FloatArray) -> FloatArray:
    """Return ``rows`` (..., n, c) stacked as (m, c), contiguous."""
    return np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]))


def features(frame: Frame, coords: Array) -> Array:
    """Return the features (k, n) of coordinates (n, d), as ``Frame.features``."""
    x = value(coords)
    out = frame.features(x)
    if not isinstance(coords, Variable):
        return out
    slopes = features_slopes(frame, x)
    return recorded(
        out,
        (
            coords,
            lambda t: np.einsum("nkd,...nd->...kn", slopes, t, optimize=True),
            lambda g: np.einsum("nkd,...kn->...nd", slopes, g, optimize=True),
        ),
    )


def columns(x: Array, nodes: IntArray) -> Array:
    """Return the columns ``nodes`` (m,) of features x (k, n), (k, m)."""
    count = value(x).shape[-1]

    def back(g: FloatArray) -> FloatArray:
        out = np.zeros((*g.shape[:-1], count))
        np.add.at(out, (..., nodes), g)  # type: ignore[arg-type]
        return out

    return linear(x, lambda t: t[..., nodes], back)


def points(frame: Frame, coords: Array) -> Array:
    """Return the Cartesian points of coordinates (..., n, d), as ``Frame.points``."""
    return _converted(frame, coords, frame.points, points_slopes)


def coords(frame: Frame, at: Array) -> Array:
    """Return the coordinates of Cartesian points (..., n, d), as ``Frame.coords``."""
    return _converted(frame, at, frame.coords, coords_slopes)


def _converted(
    frame: Frame,
    x: Array,
    convert: Callable[[FloatArray], FloatArray],
    slopes_of: Callable[[Frame, FloatArray], FloatArray],
) -> Array:
    """Return rows (..., n, d) converted in a cylindrical frame; those of others are themselves."""
    if not frame.cylindrical:
        return x
    rows = value(x)
    return _turned(x, convert(flat(rows)).reshape(rows.shape), lambda: slopes_of(frame, rows))


def add_displacement(start: Array, by: Array, *, overwrite: bool = False) -> Array:
    """Return start + by, written to ``by`` with ``overwrite``; adding zero keeps every bit."""
    x = value(start)
    u = value(by)
    out = shift(x, u if overwrite else u.copy())
    return summed(out, start, by)


def difference_from(frame: Frame, start: Array, vectors: Array) -> Array:
    """Return displacements ``vectors`` of ``start`` (..., n, d) in the frame, (..., n, d)."""
    if not frame.cylindrical:
        return vectors
    x = value(start)
    v = value(vectors)
    out = frame.difference(flat(np.broadcast_to(x, v.shape)), flat(v)).reshape(v.shape)
    if not isinstance(start, Variable):
        return _turned(vectors, out, lambda: coords_slopes(frame, x + v))
    here = coords_slopes(frame, x)
    there = coords_slopes(frame, x + v)
    return recorded(out, _by_rows(start, there - here), _by_rows(vectors, there))


def _by_rows(x: Array, slopes: FloatArray) -> Link:
    """Return the link of a map of each row of x (..., n, d), whose derivatives are (n, e, d)."""
    return (
        x,
        lambda t: np.einsum("ned,...nd->...ne", slopes, t),
        lambda g: np.einsum("ned,...ne->...nd", slopes, g),
    )


def _turned(x: Array, out: FloatArray, slopes_of: Callable[[], FloatArray]) -> Array:
    """Return ``out``, the result of a map of each row of x, recorded with its derivatives."""
    if not isinstance(x, Variable):
        return out
    return recorded(out, _by_rows(x, slopes_of()))


def radial_sum(
    basis: Basis,
    targets: Array,
    controls: Array,
    weights: Array,
    out: FloatArray | None = None,
    tick: Tick = no_tick,
) -> Array:
    """Return the sum of weighted radial functions (..., N, d), at targets (k, N).

    Of controls (k, n); targets and controls are features.
    ``weights`` (..., n, d).
    ``out`` (..., N, d): where the sums of several designs are written.
    """
    x = value(targets)
    c = value(controls)
    w = value(weights)

    def turned(g: FloatArray) -> FloatArray:
        return many(basis, c, x, g)

    return recorded(
        many(basis, x, c, w, out, tick),
        (
            targets,
            lambda t: each_of(lambda each: push_positions(basis, x, c, w, moved=each), t),
            lambda g: each_of(lambda each: pull_positions(basis, x, c, each, w), g),
        ),
        (
            controls,
            lambda t: each_of(lambda each: push_positions(basis, x, c, w, moved_controls=each), t),
            lambda g: each_of(lambda each: pull_positions(basis, c, x, w, each), g),
        ),
        (weights, lambda t: many(basis, x, c, t), turned),
    )


def each_of(work: Linear, stacked: FloatArray) -> FloatArray:
    """Return ``work`` applied to each array (n, c) of ``stacked`` (..., n, c), stacked again."""
    if stacked.ndim == 2:
        return work(stacked)
    return np.stack([each_of(work, each) for each in stacked])


def many(
    basis: Basis,
    targets: FloatArray,
    controls: FloatArray,
    weights: FloatArray,
    out: FloatArray | None = None,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return the values of `radial_sum`; each radial function is computed once for all weights."""
    if weights.ndim == 2:
        return evaluate(basis, targets, controls, weights, tick)
    ahead = weights.shape[:-2]
    n, d = weights.shape[-2:]
    wide = np.ascontiguousarray(np.moveaxis(weights.reshape(-1, n, d), 0, 1).reshape(n, -1))
    total = targets.shape[1]
    out = np.empty((wide.shape[1] // d, total, d)) if out is None else out
    near = reached(basis, targets, controls, weights)
    if near is None:
        near = np.arange(total)
    else:
        out[:] = 0.0
    loops = basis.loops
    size = min(loops.product_rows(n), max(1, total))
    c = padded_rows(controls, 4)

    def fill(part: slice) -> None:
        found = np.empty((size, wide.shape[1]))
        for first in range(part.start, part.stop, size):
            here = near[first : min(part.stop, first + size)]
            products = found[: len(here)]
            x = padded_rows(targets[:, here], 4)
            loops.multiply((x, c, wide), basis.metric, products)
            place(products, here, out)

    with enough_threads(0.0):  # the threads are those of the parts
        in_parts(fill, len(near))
    return out.reshape(*ahead, total, d)


def terms(basis: Basis, x: Array) -> Array:
    """Return the terms (n, q) of the linear polynomial at features (k, n), as ``linear_terms``."""
    v = value(x)
    out = linear_terms(basis, v)
    if not isinstance(x, Variable):
        return out
    k, n = v.shape
    slopes = np.zeros((n, out.shape[1], k))
    if basis.period > 0:
        slopes[:, 1, 0] = slopes[:, 4, 3] = 1.0
        slopes[:, 2, 1] = -2.0 * v[1]
        slopes[:, 2, 2] = 2.0 * v[2]
        slopes[:, 3, 1] = 2.0 * v[2]
        slopes[:, 3, 2] = 2.0 * v[1]
    else:
        slopes[:, range(1, k + 1), range(k)] = 1.0
    return recorded(
        out,
        (
            x,
            lambda t: np.einsum("nqk,...kn->...nq", slopes, t),
            lambda g: np.einsum("nqk,...nq->...kn", slopes, g),
        ),
    )
