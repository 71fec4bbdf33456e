"""The displacement field of one step, at any point: what the nodes that are no boundary do.

Control nodes, weights and what the boundary lacks are all that it needs, so nodes can be displaced
some at a time, and in whatever order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.mesh.threads import in_parts
from slideviz.rbf.evaluate import Basis, Tick, evaluate, no_tick

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

TIE = 1e-4
"""Boundary nodes farther than the nearest one by less than this part of its distance count too:
far above rounding, far below any difference of distances that a mesh could mean."""


class Field(Protocol):
    """The displacement of one step, in the frame."""

    def at(self, features: FloatArray, points: FloatArray, /, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at features (k, m), points (m, d) in the step before."""


def share(q: FloatArray) -> FloatArray:
    """Return which share of an error is taken over at q radii from it: Wendland's C2 function."""
    return (1.0 - q) ** 4 * (4.0 * q + 1.0)


@dataclass(frozen=True, eq=False)
class Correction:
    """Spreads what boundary nodes lack to the nodes near them (section 2.5.1, Eq. 2.30).

    Each node takes over the error of its nearest boundary node, weighted with Wendland's C2
    function of the distance over the radius. The search is bounded by that radius, which is what
    makes it cheap, and goes on beyond periodic boundaries. Where several are equally near, as on
    symmetric meshes, it is the mean of their errors: one of them would be chosen by its number.

    Attributes
    ----------
    tree : cKDTree
        The boundary nodes and their periodic images.
    lacking : (s, d) float64
        What each lacks.
    radius : float
    """

    tree: cKDTree
    lacking: FloatArray
    radius: float

    def near(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return which of points (m, d) take over something, (h,), and what, (h, d)."""
        hit, distance, nearest, tied = self._nearest(points)
        taken = self.lacking[nearest]
        if len(tied):
            taken[tied] = self._means(points[hit[tied]], distance[tied])
        return hit, share(distance / self.radius)[:, None] * taken

    def sources(
        self, points: FloatArray
    ) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
        """Return which sources points (m, d) take over from, in all detail.

        Returns
        -------
        hit : (h,)
            The points that take over something.
        nearest : (h,)
            The source that is nearest to each.
        row, source, weight : (k,)
            For each of them, by its place in ``hit``, all its sources, and their weights in the
            mean of their errors.
        """
        hit, distance, nearest, tied = self._nearest(points)
        single = np.ones(len(hit), bool)
        single[tied] = False
        alone = np.flatnonzero(single)
        row, source, weight = self._ties(points[hit[tied]], distance[tied])
        total = np.bincount(row, weight, len(tied))[row] if len(tied) else weight
        return (
            hit,
            nearest,
            np.concatenate([alone, tied[row]]),
            np.concatenate([nearest[alone], source]),
            np.concatenate([np.ones(len(alone)), weight / total]),
        )

    def _nearest(self, points: FloatArray) -> tuple[IntArray, FloatArray, IntArray, IntArray]:
        """Return points within reach (h,), distance and number of the nearest source, and ties."""
        near = self.tree.query(points, k=2, distance_upper_bound=self.radius)
        distance, index = (np.asarray(found) for found in near)
        hit = np.flatnonzero(np.isfinite(distance[:, 0]))
        distance = distance[hit]
        tied = np.flatnonzero(distance[:, 1] <= (1.0 + TIE) * distance[:, 0])
        return hit, distance[:, 0], index[hit, 0], tied

    def _means(self, points: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the mean (m, d) of the errors of the sources that are nearest to points (m, d)."""
        row, source, weight = self._ties(points, distance)
        total = np.zeros((len(points), self.lacking.shape[1] + 1))
        np.add.at(total, row, weight[:, None] * np.c_[self.lacking[source], np.ones(len(source))])
        return total[:, :-1] / total[:, -1:]

    def _ties(
        self, points: FloatArray, distance: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return rows, sources and weights (k,) of the sources that are nearest to points (m, d).

        The weight of each falls to zero at ``TIE`` beyond the nearest, so that rounding, which
        moves the nodes of a symmetric mesh a little, changes the mean little.
        """
        if not len(points):
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        found = self.tree.query_ball_point(points, (1.0 + TIE) * distance)
        row = np.repeat(np.arange(len(points)), [len(each) for each in found])
        source = np.concatenate([np.array(each, np.int64) for each in found])
        beyond = np.linalg.norm(points[row] - self.tree.data[source], axis=1) - distance[row]
        weight = np.clip(1.0 - beyond / np.maximum(TIE * distance[row], 1e-300), 0.0, 1.0)
        return row, source, weight


@dataclass(frozen=True, eq=False)
class RadialField:
    """A sum of radial functions and, for some kernels, a linear polynomial, with its correction.

    Attributes
    ----------
    basis : Basis
    controls : (k, c) float64
        Features of the control nodes.
    weights : (c, d) float64
    tail : (q, d) float64 or None
        Coefficients of the polynomial's terms.
    correction : Correction or None
    """

    basis: Basis
    controls: FloatArray
    weights: FloatArray
    tail: FloatArray | None = None
    correction: Correction | None = None

    def at(self, features: FloatArray, points: FloatArray, /, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at features (k, m), points (m, d) in the step before."""
        found = self.interpolated(features, tick)
        correction = self.correction
        if correction is not None:

            def correct_part(part: slice) -> None:
                hit, taken = correction.near(points[part])
                found[part.start + hit] += taken

            in_parts(correct_part, len(found))
        return found

    def interpolated(self, features: FloatArray, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at features (k, m), without the correction."""
        if not len(self.weights):
            return np.zeros((features.shape[1], self.weights.shape[1]))
        found = evaluate(self.basis, features, self.controls, self.weights, tick)
        if self.tail is not None:
            found += linear_terms(self.basis, features) @ self.tail
        return found


def linear_terms(basis: Basis, features: FloatArray) -> FloatArray:
    """Return the terms of the linear polynomial at nodes, (n, q), periodic where the case is.

    1 and the features: with a translational period these include the circle's cosine and sine;
    with a rotational one the angle enters by the cosine and sine of its full period.
    """
    rows = [np.ones(features.shape[1])]
    if basis.period > 0:
        r, sine, cosine, z = features
        rows += [r, cosine**2 - sine**2, 2 * sine * cosine, z]
    else:
        rows += list(features)
    return np.stack(rows, axis=1)
