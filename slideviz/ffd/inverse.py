"""Parametric coordinates of points: the inverse of a box, by Newton's method."""

from __future__ import annotations

from itertools import product

import numpy as np

from slideviz.ffd.box import Box
from slideviz.mesh.model import FloatArray

INSIDE = 1e-8
"""By how much a parametric coordinate may be outside of [0, 1]: a point of a side is inside."""
MET = 1e-13
"""What may be left of a point, as a part of the size of the box along each axis."""
CLOSE = 1e-9
"""The same for a point that Newton's method gets no closer to."""
ROUNDING = 1e-14
"""The same as a part of the largest coordinate."""
STEPS, HALVINGS, STARTS = 40, 12, 4
SAMPLES = 3
"""Starts for each control point and direction, among which the nearest are taken."""
REACH = 0.5
"""How far outside of [0, 1] points are looked for."""
CHUNK = 20_000


def parametric(box: Box, points: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the parametric coordinates of points, and which points are in the box.

    Parameters
    ----------
    box : Box
    points : (m, 3) or (m, 2) float64
        In 2D those of the plane z = 0.

    Returns
    -------
    uvw : (m, 3) float64
        In [0, 1]; NaN outside of the box.
    inside : (m,) bool
    """
    whole = np.zeros((len(points), 3))
    whole[:, : points.shape[1]] = points
    control = box.points.reshape(-1, 3)
    low, high = control.min(axis=0), control.max(axis=0)
    # A point of the box is a mean of control points, with weights that are not negative.
    size = high - low
    slack = INSIDE * size
    near = ((whole >= low - slack) & (whole <= high + slack)).all(axis=1)
    uvw = np.full(whole.shape, np.nan)
    chosen = np.flatnonzero(near)
    for first in range(0, len(chosen), CHUNK):
        rows = chosen[first : first + CHUNK]
        uvw[rows] = _solved(box, whole[rows], size)
    inside = np.asarray(((uvw >= -INSIDE) & (uvw <= 1.0 + INSIDE)).all(axis=1))
    uvw[~inside] = np.nan
    return np.clip(uvw, 0.0, 1.0), inside


def _solved(box: Box, points: FloatArray, size: FloatArray) -> FloatArray:
    """Return the parametric coordinates (m, 3) of points, NaN where none are found."""
    from scipy.spatial import cKDTree  # takes long to load

    steps = [np.linspace(0.0, 1.0, SAMPLES * (degree + 1)) for degree in box.degrees]
    seeds = np.array(list(product(*steps)))
    _, nearest = cKDTree(box.at(seeds)).query(points, k=min(STARTS, len(seeds)))
    found = np.full(points.shape, np.nan)
    left = np.arange(len(points))
    close = CLOSE + ROUNDING * float((np.abs(points).max(initial=0.0) / size).max())
    for start in np.atleast_2d(nearest.T):
        uvw, gap = _newton(box, points[left], seeds[start[left]], size)
        met = gap <= close
        found[left[met]] = uvw[met]
        # Outside of the box there may be a second solution within it, where it is bent.
        within = ((uvw >= -INSIDE) & (uvw <= 1.0 + INSIDE)).all(axis=1)
        left = left[~(met & within)]
        if not len(left):
            break
    return found


def _newton(
    box: Box, points: FloatArray, uvw: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where Newton's method gets from coordinates (m, 3), and the distance left (m,).

    Distances are those of a box of size 1, since boxes can be thin.
    """
    uvw = uvw.copy()
    rest = points - box.at(uvw)
    gap = np.linalg.norm(rest / size, axis=1)
    going = np.flatnonzero(gap > MET)
    for _ in range(STEPS):
        if not len(going):
            break
        step = _step(box.slopes(uvw[going]), rest[going])
        scale = np.ones(len(going))
        better = np.zeros(len(going), bool)
        for _ in range(HALVINGS):
            rows = going[~better]
            trial = np.clip(uvw[rows] + scale[~better, None] * step[~better], -REACH, 1.0 + REACH)
            there = points[rows] - box.at(trial)
            left = np.linalg.norm(there / size, axis=1)
            good = left < gap[rows]
            uvw[rows[good]], rest[rows[good]] = trial[good], there[good]
            gap[rows[good]] = left[good]
            better[np.flatnonzero(~better)[good]] = True
            if better.all():
                break
            scale[~better] *= 0.5
        going = going[better & (gap[going] > MET)]
    return uvw, gap


def _step(slopes: FloatArray, rest: FloatArray) -> FloatArray:
    """Return Newton's step (m, 3); where the derivative is singular, the shortest that helps."""
    try:
        step = np.linalg.solve(slopes, rest[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = np.einsum("mij,mj->mi", np.linalg.pinv(slopes), rest)
    return np.asarray(step)
