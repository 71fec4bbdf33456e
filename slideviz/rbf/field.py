"""The displacement field of one step, at any point: it displaces the nodes inside the mesh.

It needs control nodes, weights and the errors at the boundary only, so nodes can be displaced in
parts, and in any order.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Protocol

import numpy as np

from slideviz.argument_types import record
from slideviz.mesh.model import NO_NODES, BoolArray, FloatArray, IntArray, column_bounds, row_norms
from slideviz.rbf.evaluate import Basis, Tick, evaluate, no_tick
from slideviz.system.jit_cache import njit
from slideviz.system.threads import in_parts

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

BOXES = 128  # most boxes of a `Vicinity` along an axis

TIE = 1e-4
"""Boundary nodes count as equally near when their distances differ by less than this part: far
above rounding, far below any difference of distances that a mesh could mean."""


class Field(Protocol):
    """The displacement of one step, in the frame."""

    def at(self, features: FloatArray, points: FloatArray, /, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at Cartesian ``points`` (m, d) with ``features`` (k, m).

        Points and features are those before the step.
        """


def share(q: FloatArray) -> FloatArray:
    """Return the share of an error that a node takes over, q = distance / radius: Wendland C2."""
    return (1.0 - q) ** 4 * (4.0 * q + 1.0)


@record
class Vicinity:
    """The boxes of a grid that come near to points: in all others no search for these is needed."""

    low: FloatArray  # (d,): the lowest corner of the grid
    size: float  # of a box, along each axis
    marked: BoolArray  # one entry, along d axes, for each box

    @classmethod
    def of(cls, points: FloatArray, reach: float) -> Vicinity:
        """Return the boxes of a grid that may have places within ``reach`` of points (n, d)."""
        low, high = column_bounds(points)
        reach = 1.001 * reach + 1e-12 * float(max(-low.min(), high.max()))  # more than rounding
        low = low - reach
        size = max(4.0 * reach, float((high + reach - low).max()) / BOXES)
        # Within reach of a point are two boxes along each axis, at most.
        ends = [((points + by - low) / size).astype(np.int64) for by in (-reach, reach)]
        marked = np.zeros(ends[1].max(axis=0) + 1, bool)
        for columns in product(*zip(*(end.T for end in ends), strict=True)):
            marked[columns] = True
        return cls(low, size, marked)

    def inside(self, places: FloatArray) -> IntArray:
        """Return which places (m, d) are in one of the boxes, (k,)."""
        found = np.empty(len(places), bool)
        _look_up(places, self.low, self.size, self.marked.shape, self.marked.ravel(), found)
        return np.flatnonzero(found)


@njit
def _look_up(places, low, size, counts, marked, found):  # type: ignore[no-untyped-def]
    """Write which places (m, d) are in marked boxes of a `Vicinity` into ``found`` (m,)."""
    for i in range(len(places)):
        inside = True
        box = 0
        for axis in range(places.shape[1]):
            at = (places[i, axis] - low[axis]) / size
            inside = inside and 0.0 <= at < counts[axis]
            box = box * counts[axis] + (np.int64(at) if inside else 0)
        found[i] = inside and marked[box if inside else 0]


@record
class Correction:
    """The boundary correction: spreads errors at boundary nodes to the nodes near them (Eq. 2.30).

    Each node takes over the error of its nearest boundary node, weighted with Wendland's C2
    function of the distance over the radius. The search is bounded by the radius, which makes it
    cheap, and continues beyond periodic boundaries. Where several boundary nodes are equally near,
    as on symmetric meshes, the node takes over the mean of their errors, for the nearest one would
    be chosen by its number.
    """

    tree: cKDTree
    """The sources: Cartesian positions of the boundary nodes and of their periodic images."""
    lacking: FloatArray
    """(s, d): the error of each source: prescribed less interpolated displacement, in the frame."""
    radius: float  # Distance at which the correction ends, in the mesh's length unit (Eq. 2.31).

    @cached_property
    def _vicinity(self) -> Vicinity:
        """Return the boxes of a grid outside of which no place is within the radius."""
        return Vicinity.of(np.asarray(self.tree.data), self.radius)

    def near(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return which points (m, d) are within reach of a source, (h,), and their part, (h, d).

        ``points[hit]`` take over the returned parts; the correction of the others is zero.
        """
        hit, distance, nearest, tied = self._nearest(points)
        taken = self.lacking[nearest]
        if len(tied):
            taken[tied] = self._means(points[hit[tied]], distance[tied])
        return hit, share(distance / self.radius)[:, None] * taken

    def sources(
        self, points: FloatArray
    ) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]:
        """Return which points (m, d) are within reach, and the sources and weights of each.

        ``hit`` (h,): the points within reach of a source.
        ``nearest`` (h,): the source that is nearest to each.
        ``row``, ``source``, ``weight`` (k,): one entry, k >= h, for each pair of a point, by its
        place in ``hit``, and a source, with its weight in the mean of the sources' errors. Weights
        of a point add up to 1.
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
        """Return points within reach (h,), distance and number of their nearest source, and ties.

        Ties (t,) are places among the h points where the second source is equally near (`TIE`).
        """
        some = self._vicinity.inside(points)
        near = self.tree.query(points[some], k=2, distance_upper_bound=self.radius)
        distance, index = map(np.asarray, near)
        hit = np.flatnonzero(np.isfinite(distance[:, 0]))
        distance = distance[hit]
        tied = np.flatnonzero(distance[:, 1] <= (1.0 + TIE) * distance[:, 0])
        return some[hit], distance[:, 0], index[hit, 0], tied

    def _means(self, points: FloatArray, distance: FloatArray) -> FloatArray:
        """Return the mean (m, d) of the errors of all sources equally near to points (m, d)."""
        row, source, weight = self._ties(points, distance)
        total = np.zeros((len(points), self.lacking.shape[1] + 1))
        np.add.at(total, row, weight[:, None] * np.c_[self.lacking[source], np.ones(len(source))])
        return total[:, :-1] / total[:, -1:]

    def _ties(
        self, points: FloatArray, distance: FloatArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Return row of the point, source and weight, (k,) each, of sources equally near to points.

        The weight of a source falls linearly, from 1 at ``distance`` (m,), that of the nearest one,
        to 0 where it is farther by the part ``TIE``: so rounding, which moves the nodes of a
        symmetric mesh a little, changes the mean little.
        """
        if not len(points):
            return NO_NODES, NO_NODES, np.empty(0)
        found = self.tree.query_ball_point(points, (1.0 + TIE) * distance)
        row = np.repeat(np.arange(len(points)), [len(each) for each in found])
        source = np.concatenate([np.array(each, np.int64) for each in found])
        beyond = row_norms(points[row] - self.tree.data[source]) - distance[row]
        weight = np.clip(1.0 - beyond / np.maximum(TIE * distance[row], 1e-300), 0.0, 1.0)
        return row, source, weight


@record
class RadialField:
    """A sum of radial functions and, for some kernels, a linear polynomial, with its correction."""

    basis: Basis
    controls: FloatArray  # (k, c): features of the control nodes
    weights: FloatArray  # (c, d)
    tail: FloatArray | None = None
    """(q, d): coefficients of the polynomial's terms (`linear_terms`)."""
    correction: Correction | None = None  # none: errors at the boundary are not spread

    def at(self, features: FloatArray, points: FloatArray, /, tick: Tick = no_tick) -> FloatArray:
        """Return the displacement (m, d) at Cartesian points (m, d) with features (k, m)."""
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
    """Return the terms of the linear polynomial at features (k, n), (n, q).

    1 and the features: with a translational period these include the cosine and sine of the
    coordinate along it. With a rotational period 1, r, cos and sin(2 pi theta / theta_p), and z.
    """
    rows = [np.ones(features.shape[1])]
    if basis.period > 0:
        r, sine, cosine, z = features
        rows += [r, cosine**2 - sine**2, 2 * sine * cosine, z]
    else:
        rows += list(features)
    return np.stack(rows, axis=1)
