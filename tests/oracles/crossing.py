"""Slow judges of crossings: two simplices meet where a linear program has a solution."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog


def meet(a, b):
    """Return whether the convex hulls of points a (k, d) and b (l, d) have a common point."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    k, m = len(a), len(b)
    equal = np.vstack(
        (
            np.hstack((a.T, -b.T)),
            np.concatenate((np.ones(k), np.zeros(m))),
            np.concatenate((np.zeros(k), np.ones(m))),
        )
    )
    right = np.concatenate((np.zeros(a.shape[1]), [1, 1]))
    return linprog(np.zeros(k + m), A_eq=equal, b_eq=right, method="highs").status == 0


def distance(x, a):
    """Distance of a point x (d,) from the convex hull of points a (k, d), by projection."""
    x, a = np.asarray(x, float), np.asarray(a, float)
    if len(a) == 1:
        return float(np.linalg.norm(x - a[0]))
    share = np.linalg.lstsq((a[1:] - a[0]).T, x - a[0], rcond=None)[0]
    if share.min() >= 0 and share.sum() <= 1:
        return float(np.linalg.norm(a[0] + share @ (a[1:] - a[0]) - x))
    return min(distance(x, np.delete(a, i, axis=0)) for i in range(len(a)))
