"""Radial functions between nodes in a frame: sums at targets, and symmetric matrices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from slideviz.argument_types import frozen
from slideviz.mesh.fans import components
from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf import compiled
from slideviz.rbf.card import CardLoops
from slideviz.rbf.compiled import Inputs, Metric
from slideviz.system.device import Place
from slideviz.terms import KERNELS

CHUNK = 25_000_000  # pairs between two calls of ``tick``: some tens of milliseconds

PAIRS = 1_000_000
"""Pairs whose radial functions are in memory at a time, in each thread, when many columns of
weights share them: the functions and their products stay in the cache."""

ROWS = 256  # largest number of targets that are in memory at a time then

Rows = tuple[FloatArray, FloatArray | None]
"""Features (k, n) of nodes, and their directions (n, d), None for all components."""

Tick = Callable[[float], None]
"""A progress callback: takes the fraction done, and may raise to stop the work."""


def no_tick(fraction: float) -> None:
    """Do nothing: a progress callback that reports nothing."""


@frozen
class Basis:
    """A radial function: kernel, support radius and rule of distance."""

    radius: float  # support radius R, in the mesh's length unit
    period: float = 0.0
    """Angle in radians of a rotational periodic distance (Eq. 2.15); 0: Euclidean features."""
    kernel: str = "wendland-c2"  # a key of ``KERNELS``
    polynomial: bool = False  # whether a kernel that needs no linear polynomial has one
    place: Place = "cpu"  # where sums, matrices and factors are computed

    @property
    def saddle(self) -> bool:
        """Return whether the kernel needs the linear polynomial: its matrix is not definite."""
        return KERNELS[self.kernel].polynomial

    @property
    def tailed(self) -> bool:
        """Return whether sums have a linear polynomial, which acts on all nodes (Eq. 2.1)."""
        return self.polynomial or self.saddle

    @property
    def period_over_pi(self) -> float:
        """Return theta_p / pi, the factor of the inner sine; 0 for Euclidean features."""
        return self.period / np.pi

    @property
    def metric(self) -> Metric:
        """Return what the loops take."""
        return self.period_over_pi, 1.0 / self.radius, list(KERNELS).index(self.kernel)

    @property
    def loops(self) -> HostLoops | CardLoops:
        """Return the loops of the place where this is computed."""
        return LOOPS[self.place]


class HostLoops:
    """The loops of `compiled`, and how many rows they have between two calls of ``tick``."""

    def sum_rows(self, count: int) -> int:
        """Return how many targets to sum up at a time, with ``count`` control nodes."""
        return max(1, CHUNK // max(1, count))

    matrix_rows = sum_rows

    def product_rows(self, count: int) -> int:
        """Return how many rows of a matrix are in memory at a time, when they are multiplied."""
        return min(ROWS, max(64, PAIRS // max(1, count)))

    def add_up(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """Write s to out (3, N), of targets (k, N), controls (k, n) and weights (3, n)."""
        *lengths, kind = metric
        if kind:
            compiled.sum_any(*inputs, *metric, out)
        else:
            compiled.sum_plain(*inputs, *lengths, out)

    def fill_matrix(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """Write G (N, n) to out, of what `compiled.fill_matrix` takes first."""
        compiled.fill_matrix(*inputs, *metric, out)

    def multiply(self, inputs: Inputs, metric: Metric, out: FloatArray) -> None:
        """Write phi(|x_a - c_b|), of x (k, N) and c (k, n), times a matrix (n, m) to out (N, m)."""
        x, c, right = inputs
        values = np.empty((x.shape[1], c.shape[1]))
        with compiled.one_at_a_time(values.size):
            compiled.fill_matrix(x, c, x[:0], c[:0], *metric, values)
        np.matmul(values, right, out=out)


LOOPS: dict[Place, HostLoops | CardLoops] = {"cpu": HostLoops(), "gpu": CardLoops()}
"""The loops, by the place where they run."""


def evaluate(
    basis: Basis,
    targets: FloatArray,
    controls: FloatArray,
    weights: FloatArray,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return s at the targets, (N, d).

    ``basis``: radial function, support radius and distance.
    ``targets`` (k, N), ``controls`` (k, n): features, as ``Frame.features`` gives them; k = 2, 3 or
    4.
    ``weights`` (n, d): coefficients alpha of Eq. 2.6, d = 1 to 3 components.
    ``tick``: called between chunks with the fraction done; may raise to stop.
    """
    near = reached(basis, targets, controls, weights)
    if near is not None:
        out = np.zeros((targets.shape[1], weights.shape[1]))
        if len(near):
            out[near] = evaluate(basis, targets[:, near], controls, weights, tick)
        return out
    metric = basis.metric
    rows = 4 if basis.period > 0 or metric[-1] or len(targets) == 4 else 3
    c = padded_rows(controls, rows)
    w = padded_rows(weights.T, 3)
    loops = basis.loops

    def add_up(x: FloatArray, out: FloatArray) -> None:
        loops.add_up((x, c, w), metric, out)

    return summed(add_up, targets, c, weights.shape[1], tick, loops)


def summed(
    add_up: Callable[[FloatArray, FloatArray], object],
    targets: FloatArray,
    controls: FloatArray,
    width: int,
    tick: Tick = no_tick,
    loops: HostLoops | CardLoops = LOOPS["cpu"],
) -> FloatArray:
    """Return what ``add_up(x, out)`` writes to out (3, N) for targets x (k, N), (N, width).

    Targets are divided, so that ``tick`` is called often; ``controls`` (k, n) are contiguous rows.
    ``loops``: those that ``add_up`` runs.
    """
    rows, count = controls.shape
    total = targets.shape[1]
    found = np.empty((total, width))
    size = loops.sum_rows(count)
    for start in range(0, total, size):
        x = padded_rows(targets[:, start : start + size], rows)
        out = np.empty_like(x[:3])
        with compiled.one_at_a_time(x.shape[1] * count):
            add_up(x, out)
        found[start : start + size] = out[:width].T
        tick(min(1.0, (start + size) / total))
    return found


WIDER = 4
"""Targets are looked at one by one where they are so many times as many as the control nodes."""

BOX = 0.5  # edge of a box over the support radius: a box of four dimensions has no diagonal above R

SLACK = 1.0 + 1e-9
"""Factor of the support radius beyond which a sum is zero, whatever rounding does to distances."""


def reached(
    basis: Basis, targets: FloatArray, controls: FloatArray, weights: FloatArray
) -> IntArray | None:
    """Return the targets (m,) that a support with a weight reaches; None: all, or not looked at.

    The sums at all others are exactly zero. Parameters as of `evaluate`, weights (..., n, d).
    """
    heavy = np.any(weights != 0.0, axis=(*range(weights.ndim - 2), weights.ndim - 1))
    x = _plain(basis, targets)
    c = _plain(basis, controls)
    wide = x.shape[1] >= WIDER * c.shape[1]
    if not (KERNELS[basis.kernel].compact and wide and heavy.any()):
        return None
    ends = [(each.min(axis=1), each.max(axis=1)) for each in (x, c)]
    widest = np.max([ends[0][1] - ends[1][0], ends[1][1] - ends[0][0]], axis=0)
    if np.linalg.norm(widest) < basis.radius:
        return None
    low, high, _ = boxes(basis, controls[:, heavy])
    near = np.empty(x.shape[1], np.bool_)
    with compiled.one_at_a_time(near.size * low.shape[1]):
        compiled.near_boxes(np.ascontiguousarray(x), low, high, SLACK * basis.radius, near)
    return None if near.all() else np.flatnonzero(near)


def _plain(basis: Basis, features: FloatArray) -> FloatArray:
    """Return the rows of features whose Euclidean distance is at most that of the basis."""
    return features[[0, 3]] if basis.period > 0 else features


def boxes(basis: Basis, features: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return boxes of at most `BOX` radii with nodes, low and high (k, b), and each node's (n,)."""
    x = _plain(basis, features)
    start = x.min(axis=1, keepdims=True)
    if np.linalg.norm(x.max(axis=1) - start[:, 0]) < basis.radius:
        return start, x.max(axis=1, keepdims=True), np.zeros(x.shape[1], np.int64)
    cells = np.floor((x - start) / (BOX / SLACK * basis.radius)).T
    box = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
    low = np.full((len(x), int(box.max()) + 1), np.inf)
    high = -low
    for row, values in enumerate(x):
        np.minimum.at(low[row], box, values)
        np.maximum.at(high[row], box, values)
    return low, high, box


def connected(basis: Basis, features: FloatArray) -> IntArray:
    """Return labels (n,) of nodes: equal where supports connect them, also by other nodes."""
    if not (features.shape[1] and KERNELS[basis.kernel].compact):
        return np.zeros(features.shape[1], np.int64)
    low, high, box = boxes(basis, features)
    if low.shape[1] == 1:
        return box
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    middle = ((low + high) / 2).T
    reach = SLACK * basis.radius
    a, b = cKDTree(middle).query_pairs(2.0 * reach, output_type="ndarray").T
    gap = np.maximum(np.maximum(low[:, a] - high[:, b], low[:, b] - high[:, a]), 0.0)
    near = np.linalg.norm(gap, axis=0) <= reach
    return components(len(middle), a[near], b[near])[box]


def matrix(
    basis: Basis,
    rows: Rows,
    columns: Rows | None = None,
    tick: Tick = no_tick,
) -> FloatArray:
    """Return G_ab = phi(|x_a - c_b|) (m_a . n_b), (N, n).

    ``rows`` and ``columns``: features (k, N) of the node of each constraint, and its unit direction
    (N, d), or None to leave the dot product out. ``columns`` None: the same as the rows.
    """
    x = padded_rows(rows[0], 4)
    across = _directions(*rows)
    c, along = (
        (x, across) if columns is None else (padded_rows(columns[0], 4), _directions(*columns))
    )
    total = x.shape[1]
    n = c.shape[1]
    out = np.empty((total, n))
    size = basis.loops.matrix_rows(n)
    for start in range(0, total, size):
        part = slice(start, min(total, start + size))
        with compiled.one_at_a_time((part.stop - part.start) * n):
            here = np.ascontiguousarray(x[:, part])
            inputs = here, c, np.ascontiguousarray(across[:, part]), along
            basis.loops.fill_matrix(inputs, basis.metric, out[part])
        tick(part.stop / total)
    return out


def _directions(features: FloatArray, directions: FloatArray | None) -> FloatArray:
    """Return unit directions as contiguous rows (d, n); d = 0 without directions."""
    if directions is None:
        return np.zeros((0, features.shape[1]))
    return np.ascontiguousarray(directions.T)


def padded_rows(values: FloatArray, rows: int) -> FloatArray:
    """Return ``values`` (k, n) as a contiguous, writeable array (rows, n), with zero rows added.

    ``values`` itself, where it is one already: the compiled loops only read it, but they are
    compiled for writeable arrays.
    """
    flags = values.flags
    if values.shape[0] == rows and flags.c_contiguous and flags.writeable and values.dtype == float:
        return values
    out = np.empty((rows, values.shape[1]))
    out[: len(values)] = values
    out[len(values) :] = 0.0
    return out
