"""Parametric coordinates of points: the inverse of a box, by Newton's method."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from slideviz.errors import CaseError
from slideviz.ffd.box import CARTESIAN, Box
from slideviz.mesh.model import FloatArray

INSIDE = 1e-8
"""A parametric coordinate may be so far outside of [0, 1]: a point on a side is inside."""
MET = 1e-13
"""Distance from a point at which Newton's method ends, in parts of the box's size on each axis."""
CLOSE = 1e-9
"""Largest distance at which a point counts as found, in the same measure."""
ROUNDING = 1e-14
"""Part of the largest coordinate that is added to `CLOSE`."""
STEPS, HALVINGS, STARTS = 40, 12, 4
"""Most steps of Newton's method, most halvings of a step, and number of starts of a point."""
SAMPLES = 3
"""Sampled points for each control point and direction; the nearest ones are the starts."""
REACH = 0.5
"""Newton's method stays so near to [0, 1] in each parametric coordinate."""
CHUNK = 20_000
"""Points solved for together."""


def parametric(box: Box, points: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the parametric coordinates of points, and which points are in the box.

    Parameters
    ----------
    points : (m, 3) or (m, 2) float64
        In 2D, points of the plane z = 0.

    Returns
    -------
    uvw : (m, 3) float64
        In [0, 1]; NaN outside of the box.
    inside : (m,) bool
    """
    spatial = np.zeros((len(points), 3))
    spatial[:, : points.shape[1]] = points
    if box.system.kind != "CARTESIAN":
        straight = replace(box, points=box.q, system=CARTESIAN)
        return parametric(straight, box.system.q_of(spatial))
    control = box.points.reshape(-1, 3)
    low, high = control.min(axis=0), control.max(axis=0)
    # A point of the box is a mean of control points, with weights that are not negative.
    size = high - low
    slack = INSIDE * size
    near = ((spatial >= low - slack) & (spatial <= high + slack)).all(axis=1)
    uvw = np.full(spatial.shape, np.nan)
    chosen = np.flatnonzero(near)
    for first in range(0, len(chosen), CHUNK):
        rows = chosen[first : first + CHUNK]
        uvw[rows] = _solved(box, spatial[rows], size)
    inside = np.asarray(((uvw >= -INSIDE) & (uvw <= 1.0 + INSIDE)).all(axis=1))
    uvw[~inside] = np.nan
    return np.clip(uvw, 0.0, 1.0), inside


def placed_again(box: Box, points: FloatArray, uvw: FloatArray) -> FloatArray:
    """Return the parametric coordinates (m, 3) of points (m, 3) near known ones, uvw (m, 3).

    They may be outside of [0, 1]. Raises CaseError if the box has no such point there.
    """
    size = np.ptp(box.points.reshape(-1, 3), axis=0)
    found, gap = _newton(box, points, uvw, size)
    close = CLOSE + ROUNDING * float((np.abs(points).max(initial=0.0) / size).max())
    if (gap > close).any():
        raise CaseError(
            f"the FFD box {box.name!r} folds over, or loses nodes, where its parent or one inside "
            "it moves these; move control points less"
        )
    return found


def _solved(box: Box, points: FloatArray, size: FloatArray) -> FloatArray:
    """Return the parametric coordinates (m, 3) of points (m, 3), NaN where none are found.

    They may be outside of [0, 1]. ``size`` (3,) is that of the box along each axis.
    """
    from scipy.spatial import cKDTree  # takes long to load

    steps = [np.linspace(0.0, 1.0, SAMPLES * (degree + 1)) for degree in box.degrees]
    seeds = np.array(list(product(*steps)))
    _, nearest = cKDTree(box.at(seeds)).query(points, k=min(STARTS, len(seeds)))
    coordinates = np.full(points.shape, np.nan)
    left = np.arange(len(points))
    close = CLOSE + ROUNDING * float((np.abs(points).max(initial=0.0) / size).max())
    for start in np.atleast_2d(nearest.T):
        uvw, gap = _newton(box, points[left], seeds[start[left]], size)
        met = gap <= close
        coordinates[left[met]] = uvw[met]
        # Outside of the box there may be a second solution within it, where it is bent.
        within = ((uvw >= -INSIDE) & (uvw <= 1.0 + INSIDE)).all(axis=1)
        left = left[~(met & within)]
        if not len(left):
            break
    return coordinates


def _newton(
    box: Box, points: FloatArray, uvw: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the end of Newton's method from ``uvw`` (m, 3), and its distance from points, (m,).

    Distances are scaled to a box of size 1 along each axis, since boxes can be thin.
    """
    uvw = uvw.copy()
    remaining = points - box.at(uvw)
    gap = np.linalg.norm(remaining / size, axis=1)
    going = np.flatnonzero(gap > MET)
    for _ in range(STEPS):
        if not len(going):
            break
        step = uvw_step(box.slopes(uvw[going]), remaining[going])
        scale = np.ones(len(going))
        better = np.zeros(len(going), bool)
        for _ in range(HALVINGS):
            rows = going[~better]
            trial = np.clip(uvw[rows] + scale[~better, None] * step[~better], -REACH, 1.0 + REACH)
            there = points[rows] - box.at(trial)
            left = np.linalg.norm(there / size, axis=1)
            good = left < gap[rows]
            uvw[rows[good]], remaining[rows[good]] = trial[good], there[good]
            gap[rows[good]] = left[good]
            better[np.flatnonzero(~better)[good]] = True
            if better.all():
                break
            scale[~better] *= 0.5
        going = going[better & (gap[going] > MET)]
    return uvw, gap


def uvw_step(slopes: FloatArray, rest: FloatArray) -> FloatArray:
    """Return the changes (m, 3) of uvw that shift points by ``rest`` (m, 3), to first order.

    They are least-squares ones if any derivative, ``slopes`` (m, 3, 3), is singular.
    """
    try:
        step = np.linalg.solve(slopes, rest[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = np.einsum("mij,mj->mi", np.linalg.pinv(slopes), rest)
    return np.asarray(step)
