"""Motions of blades over span: sections are turned, shifted, scaled and bent in their own plane.

A section at a span is laid flat in the plane of (m', theta), as the complex number m' + i theta.
With its stacking point c, the distance w of a node from c, and totals over all motions so far

    w  <-  k exp(i alpha) (w + kappa 4 xi (1 - xi) i (t - l))      chord k, angle alpha, camber
    c  <-  c + i lean / r,  then along the curve of constant span by the length sweep

where l and t are leading and trailing edge, and xi is the place of a node along the chord between
them. Spans never change, so nodes of hub and shroud stay on them. Totals do not depend on the order
of motions. Each quantity is a curve over span: a monotone cubic through points (F. N. Fritsch,
R. E. Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17, 1980, with the
slopes of F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984), constant beyond its ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from slideviz.errors import MeshError
from slideviz.machine.span import Span
from slideviz.mesh.model import FloatArray, IntArray

SECTIONS = 24  # sections of a blade, of which centroids and edges are found
TIED = 1e-6  # distances are equal up to this part of the largest one
STEP = 1e-200  # of derivatives
ROUNDING = 1e-14
"""Part of the largest change up to which one is zero: spans at a wall are 0 but for rounding."""
Complex = NDArray[np.complex128]

TOTALS = 5
ANGLE, LEAN, SWEEP, CHORD, CAMBER = range(TOTALS)
"""Rows of the totals: radians, lengths, the logarithm of a factor, a part of the chord."""


def curve_at(
    spans: Sequence[float], values: Sequence[float], at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the monotone cubic through (spans, values) at spans (n,), and its derivative (n, k).

    The derivative is that by the values (k,), exact where no two slopes in turn change their sign.
    """
    x = np.asarray(spans, float)
    y = np.asarray(values, float)
    count = len(x)
    eye = np.eye(len(x))
    if count == 1:
        return np.full(len(at), y[0]), np.ones((len(at), 1))
    h = np.diff(x)
    # Derivatives by an imaginary step, in which nothing cancels.
    slopes = np.stack([_node_slopes(h, row) for row in y + 1j * STEP * eye], axis=1)
    slope = slopes[:, 0].real
    slope_by = slopes.imag / STEP
    s = np.clip(at, x[0], x[-1])
    left = np.clip(np.searchsorted(x, s, "right") - 1, 0, count - 2)
    t = (s - x[left]) / h[left]
    step = h[left]
    a = (1.0 + 2.0 * t) * (1.0 - t) ** 2
    b = t**2 * (3.0 - 2.0 * t)
    c = step * t * (1.0 - t) ** 2
    d = -step * t**2 * (1.0 - t)
    value = a * y[left] + b * y[left + 1] + c * slope[left] + d * slope[left + 1]
    weights = (
        part[:, None] * table
        for part, table in zip(
            (a, b, c, d),
            (eye[left], eye[left + 1], slope_by[left], slope_by[left + 1]),
            strict=True,
        )
    )
    return value, sum(weights)


def _node_slopes(h: FloatArray, y: Complex) -> Complex:
    """Return the slopes (k,) of the monotone cubic at nodes ``h`` (k - 1,) apart, values y (k,).

    Of values, only the real parts are compared.
    """
    count = len(y)
    secant = np.diff(y) / h
    slope = np.zeros(count, complex)
    if count == 2:
        return slope + secant
    for k in range(1, count - 1):
        one, two = secant[k - 1 : k + 1]
        if one.real * two.real > 0.0:  # else the curve is level there
            w1 = 2.0 * h[k] + h[k - 1]
            w2 = h[k] + 2.0 * h[k - 1]
            slope[k] = (w1 + w2) * one * (two / (w1 * two + w2 * one))
    for k, near, far in ((0, 0, 1), (count - 1, count - 2, count - 3)):
        first = secant[near]
        second = secant[far]
        w0 = (2.0 * h[near] + h[far]) / (h[near] + h[far])
        w1 = -h[near] / (h[near] + h[far])
        end = w0 * first + w1 * second
        if end.real * first.real <= 0.0:
            end = 0.0
        elif first.real * second.real < 0.0 and abs(end.real) > 3.0 * abs(first.real):
            end = 3.0 * first
        slope[k] = end
    return slope


class BladeSections:
    """The nodes of a blade, laid flat, and where totals of motions over span take them."""

    def __init__(
        self,
        field: Span,
        points: FloatArray,
        triangles: IntArray,
        stack: FloatArray | None = None,
        turns: FloatArray | None = None,
    ) -> None:
        """Lay the nodes flat, and find stacking points and chords.

        ``points`` (n, 3), ``triangles`` (t, 3): of the blade. ``stack`` (3,): a point through which
        the stacking line goes, normal to the curves of constant span; None: a straight line fitted
        to the centroids of the sections' outlines, in (m', theta) over span. ``turns`` (n,): angles
        in radians by which parts of a blade that periodic sides cut are turned to be together.

        Raises MeshError if the blade has no span, or reaches the axis.
        """
        coords = field.meridional(points)
        self._turns = np.zeros(len(points)) if turns is None else turns
        middle = coords.mean(axis=0) if stack is None else field.meridional(stack[None])[0]
        period = np.abs(self._turns).max(initial=0.0)
        if period > 0.0:  # the point may be at the other side
            away = (coords[:, 2] + self._turns).mean() - middle[2]
            middle[2] += period * np.round(away / period)
        self.field = field
        self.curves = field.curves_through(middle[:2])
        plane = self.curves.plane(coords)
        plane[:, 1] += self._turns
        self.spans = plane[:, 2]
        self._radius = field.girth(coords)
        self._start = plane[:, 0] + 1j * plane[:, 1]
        self._length = self.curves.length(plane)
        low = self.spans.min()
        high = self.spans.max()
        if not high - low > 1e-6:
            raise MeshError("the boundary has one span everywhere, so nothing can vary over it")
        levels = low + (high - low) * np.linspace(0.01, 0.99, SECTIONS)
        cuts = [_cut(self._start, self.spans, triangles, level) for level in levels]
        some = [len(cut) > 0 for cut in cuts]
        levels = levels[some]
        cuts = [cut for cut in cuts if len(cut)]
        edges = np.array([_edges(cut.ravel()) for cut in cuts])
        if stack is None:
            centres = np.array([_centroid(cut) for cut in cuts])
            line = np.polyfit(levels, centres, min(1, len(levels) - 1))
            centre = np.polyval(line, self.spans)
        else:
            centre = np.full(len(plane), 1j * middle[2])
        left = np.clip(np.searchsorted(levels, self.spans) - 1, 0, max(len(levels) - 2, 0))
        right = np.minimum(left + 1, len(levels) - 1)
        gap = np.where(right > left, levels[right] - levels[left], 1.0)
        part = ((self.spans - levels[left]) / gap)[:, None]
        leading, trailing = ((1.0 - part) * edges[left] + part * edges[right]).T
        self._centre = centre
        self._away = self._start - centre
        chord = trailing - leading
        place = ((self._start - leading) * np.conj(chord)).real / np.abs(chord) ** 2
        self._camber = 4.0 * place * (1.0 - place) * 1j * chord

    def moved(self, totals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points (n, 3) for totals (5, n) of motions, and derivatives (n, 3, 5) by them.

        Raises MeshError if a node would leave the walls' extent.
        """
        turn = np.exp(totals[CHORD] + 1j * totals[ANGLE])
        shape = turn * (self._away + totals[CAMBER] * self._camber)
        swept = start = self._start.real
        far = totals[SWEEP]
        if far.any():
            # Rounding would move the nodes that are not swept.
            swept = np.where(far, self.curves.at_length(self._length + far, self.spans), start)
        flat = self._centre + (swept - start) + 1j * totals[LEAN] / self._radius + shape
        plane = np.stack([flat.real, flat.imag - self._turns, self.spans], axis=1)
        coords, by_plane = self.curves.coords_and_slopes(plane)
        by = np.empty((5, len(flat)), complex)
        by[ANGLE] = 1j * shape
        by[CHORD] = shape
        by[CAMBER] = turn * self._camber
        by[LEAN] = 1j / self._radius
        by[SWEEP] = 1.0 / self.curves.growth(swept, self.spans)
        by_totals = np.stack([by.real, by.imag])  # (2, 5, n)
        slopes = np.einsum("nij,njk,ktn->nit", self.field.slopes(coords), by_plane, by_totals)
        return self.field.points(coords), slopes


def change_of(
    kind: str, spans: Sequence[float], values: Sequence[float], at: FloatArray
) -> tuple[int, FloatArray, FloatArray]:
    """Return which total a motion changes, by how much at spans (n,), and the derivative (n, k).

    The derivative is that by the values of the curve (k,); angles of it are in degrees.
    """
    value, slope = curve_at(spans, values, at)
    row = ROWS[kind]
    if row == ANGLE:
        value = np.radians(value)
        slope = np.radians(slope)
    if row == CHORD:
        slope = slope / value[:, None]
        value = np.log(value)
    rounding = np.abs(value) <= ROUNDING * np.abs(value).max(initial=0.0)
    return row, np.where(rounding, 0.0, value), slope


ROWS: Mapping[str, int] = {
    "twist": ANGLE,
    "stagger": ANGLE,
    "lean": LEAN,
    "sweep": SWEEP,
    "chord": CHORD,
    "camber": CAMBER,
}
"""The row of the totals that a kind of motion adds to."""


def _cut(flat: Complex, spans: FloatArray, triangles: IntArray, level: float) -> Complex:
    """Return the ends (k, 2) of the segments in which triangles (t, 3) have a span."""
    above = spans[triangles] > level
    some = triangles[above.any(axis=1) & ~above.all(axis=1)]
    above = spans[some] > level
    # First the corner that is alone on its side.
    odd = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
    rows = np.arange(len(some))
    alone = some[rows, odd]
    ends = []
    for k in (1, 2):
        other = some[rows, (odd + k) % 3]
        part = (level - spans[alone]) / (spans[other] - spans[alone])
        ends.append(flat[alone] + part * (flat[other] - flat[alone]))
    return np.stack(ends, axis=1)


def _centroid(cut: Complex) -> complex:
    length = np.abs(cut[:, 1] - cut[:, 0])
    return complex(np.average(cut.mean(axis=1), weights=length + 1e-300))


def _edges(outline: Complex) -> tuple[complex, complex]:
    """Return the two points that are farthest apart, the one with the smaller m' first.

    Of several pairs, such as the diagonals of a blunt section, it is one in the middle of them, so
    that rounding does not decide.
    """
    ends = np.unique(np.concatenate([_extreme(outline, a) for a in np.linspace(0, np.pi, 181)]))
    far = np.abs(ends[:, None] - ends)
    size = far.max()
    one, two = np.nonzero(far >= (1.0 - TIED) * size)
    chord = ends[two] - ends[one]
    middle = 0.5 * (ends[one] + ends[two])
    steep = np.abs(chord.real) <= TIED * size
    ahead = np.where(steep, chord.imag >= 0.0, chord.real > 0.0)
    centre = _mid_range(middle[ahead].real) + 1j * _mid_range(middle[ahead].imag)
    half = 0.5 * size * np.exp(1j * _mid_range(np.angle(chord[ahead])))
    return complex(centre - half), complex(centre + half)


def _mid_range(values: FloatArray) -> float:
    return 0.5 * float(values.min() + values.max())


def _extreme(outline: Complex, angle: float) -> Complex:
    """Return the points that are farthest in a direction, and against it."""
    height = (outline * np.exp(-1j * angle)).real
    return outline[[int(np.argmin(height)), int(np.argmax(height))]]
