"""Margins of cells: how far nodes may go along straight paths before a cell is no longer valid.

Along ``x + s u`` each determinant of the proof of validity (`slideviz.mesh.jacobians`) is a
polynomial in s: quadratic in 2D, cubic in 3D. A cell's margin is the smallest s at which one of
them is not positive: exact for triangles, quadrilaterals, tetrahedra and pyramids, and for cells
whose Jacobian vanishes first in a corner. Inside of prisms and hexahedra it is a lower bound, from
Bézier coefficients: the cell is cut in halves until the bound is at most the part `GAP` below the
margin.

Rounding cannot make a margin too large: from each determinant a bound for the rounding errors of
coordinates and determinants is subtracted (`ROUNDING`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from math import floor
from typing import TYPE_CHECKING

import numpy as np

from slideviz.argument_types import frozen
from slideviz.errors import point_words
from slideviz.mesh.elements import CELL_NAMES
from slideviz.mesh.jacobians import (
    CORNERS,
    LANES,
    LEVELS,
    add3,
    column3,
    cross3,
    dot3,
    gather,
    scaled3,
    write_coefficients,
)
from slideviz.mesh.model import BoolArray, Cells, Signs, largest_coordinate
from slideviz.mesh.orientation import reference_of
from slideviz.system.jit_cache import njit
from slideviz.terms import FARTHEST

if TYPE_CHECKING:
    from slideviz.mesh.model import FloatArray, Index, IntArray, Mesh

GAP = 2.0**-9
"""Largest relative distance from a lower bound to the margin at which a cell is not cut again."""

PARTS = 1000  # most parts that a cell is cut into; those left then count with their lower bounds

ROUNDING = 64 * np.finfo(float).eps
"""Bound for the error of a determinant, divided by the largest coordinate and by the squared (in 2D
simple) size of the cell."""

THIRD = 1 / 3  # a multiplication with it is faster than a division


BOUNDED = np.array([1 / 8, 1 / 4, 1 / 2, 1])
"""Parts of the largest margin that is looked for, up to which margins are bounded from below."""


def _cuts(strides: tuple[int, ...], size: int) -> tuple[IntArray, IntArray, BoolArray]:
    """Return how cells of a type with ``size`` coefficients are cut in halves.

    That is, for the axes in which they can be cut: the distances (a,) of neighbouring coefficients
    and the first one of each line (a, size / 3); and which coefficients are of corners, (size,).
    """
    digit = np.arange(size) // np.array(strides, np.int64).reshape(-1, 1) % 3
    firsts = [np.flatnonzero(row == 0) for row in digit]
    shaped = np.array(firsts, np.int64).reshape(len(strides), -1 if strides else 0)
    return np.array(strides, np.int64), shaped, (digit != 1).all(axis=0)


CUTS = {
    vtk: _cuts({12: (9, 3, 1), 13: (3,)}.get(vtk, ()), {12: 27, 13: 9}.get(vtk, len(table)))
    for vtk, table in CORNERS.items()
}
"""Results of `_cuts` by element type."""


def margins(
    points: FloatArray,
    displacement: FloatArray,
    cells: Cells,
    cap: float,
    signs: Signs | None = None,
) -> FloatArray:
    """Return the margins (m,) of cells along ``points + s * displacement``, from 0 to ``cap``.

    A cell with margin 0 is not valid at s = 0, or not proved to be. The bits do not depend on the
    number of threads, nor on the other cells.
    ``points``, ``displacement`` (n, d), and cells of dimension d.
    ``cap``: largest margin that is looked for; positive, finite.
    ``signs`` (m,): 1, or -1 for a cell that is numbered the other way round; without it all are 1.
    """
    found = np.empty(len(cells))
    turns = np.ones(len(cells), np.int8) if signs is None else signs

    def of_part(vtk: int, rows: Index, nodes: IntArray) -> None:
        values = np.empty(len(nodes))
        arrays = points, displacement, nodes, CORNERS[vtk], turns[rows].copy()
        _write_margins(vtk, *arrays, CUTS[vtk], cap, values)
        found[rows] = values

    cells.in_parts(of_part)
    return found


@frozen
class SafeFraction:
    """How far a motion may go until the first cell is no longer proved valid."""

    fraction: float
    """Of the motion, from 0 to `slideviz.terms.FARTHEST`; 1 is all of it."""
    cell: int | None = None  # the number of the first such cell; None if there is none up to then
    kind: str = ""  # the name of its element type
    where: tuple[float, ...] = ()  # its middle in the undeformed mesh
    step: int = 1
    """The step on whose straight path that is. Beyond a fraction of 1 that is the last, straight
    on."""
    zone: int | None = None  # the number of its zone, where the mesh has several

    @property
    def words(self) -> str:
        """Return a sentence, its number rounded down: ``the motion is safe up to 62 %, ...``."""
        place = point_words(self.where, digits=4)
        zone = "" if self.zone is None else f" of zone {self.zone}"
        who = f"cell {self.cell} ({self.kind}{zone}) at ({place})"
        if self.cell is None:
            return f"the motion could go more than {self.fraction:g} times as far"
        if self.fraction <= 0:
            return f"the undeformed mesh is not valid: {who}"
        until = ": next," if 1 <= self.fraction < 1.01 else ", until"
        return f"the motion {reach_words(self.fraction)}{until} {who} folds"

    def ending(self, inverted: int, mended: bool) -> str:
        """Return the end of a sentence with `words`: that a cell which folds on the way unfolds.

        It is "" where that is not so. ``inverted``: the cells at the end of the run. ``mended``:
        whether cells were repaired.
        """
        if inverted or not 0 < self.fraction < 1:
            return ""
        repair = "after repair " if mended else ""
        return f" in step {self.step}; {repair}no cell is inverted at the end"

    def report(self) -> dict[str, object]:
        """Return the keys of a report: ``safe_fraction``, ``safe_cell`` and so on."""
        known = {f"safe_{name}": value for name, value in asdict(self).items()}
        return known if self.zone else {key: known[key] for key in known if key != "safe_zone"}


def reach_words(fraction: float) -> str:
    """Return in few words how far a motion may go, rounded down."""
    if fraction >= 1.01:
        return f"could go {floor(100 * fraction) / 100:.3g} times as far"
    if fraction >= 1:
        return "is safe, but could hardly go farther"
    return f"is safe up to {floor(1000 * fraction) / 10:g} %"


def path_margins(mesh: Mesh, reference: Mesh, signs_of: Mesh | None = None) -> FloatArray:
    """Return the margins (m,) of all cells along the straight path from ``reference`` to ``mesh``.

    They are at most `slideviz.terms.FARTHEST`. The undeformed mesh ``signs_of``, without it
    ``reference``, tells which cells are numbered the other way round.
    """
    signs = reference_of(signs_of or reference)[1]
    return margins(reference.points, mesh.points - reference.points, mesh.cells, FARTHEST, signs)


def least_margin(before: Mesh, after: Mesh, cap: float, signs: Signs) -> tuple[float, int]:
    """Return the least margin, up to ``cap``, of all cells without the halo's, and its first cell.

    It is that of `margins`, which are found only of cells that may have the least one: of a
    hexahedron a bound costs less (`_write_bounds`).
    """
    cells = after.cells
    ends = cap * BOUNDED
    bounded = np.zeros(len(cells), np.int8)
    nodes_far = largest_coordinate(before.points)
    far = np.array([nodes_far, nodes_far + largest_coordinate(after.points)])

    def of_part(vtk: int, rows: Index, nodes: IntArray) -> None:
        if vtk == 12:
            values = np.empty(len(nodes), np.int8)
            turn = signs[rows].copy()
            _write_bounds(before.points, after.points, nodes, turn, far, ends, values)
            bounded[rows] = values

    cells.in_parts(of_part)
    if after.halo is not None:
        bounded[after.halo.cells] = len(ends)
    least = cap
    cell = 0
    for level, end in enumerate(ends):
        ids = np.flatnonzero(bounded == level)
        some = cells.take(ids)
        nodes = some.nodes
        here = Cells(some.types, some.offsets, np.searchsorted(nodes, some.connectivity))
        start = before.points[nodes]
        found = margins(start, after.points[nodes] - start, here, cap, signs[ids])
        if len(found) and (found.min(), ids[found.argmin()]) < (least, cell):
            least = float(found.min())
            cell = int(ids[found.argmin()])
        if least < end:
            break  # all others have larger ones
    return least, cell


def step_safety(
    before: Mesh,
    after: Mesh,
    undeformed: Mesh,
    part: tuple[float, float] = (0.0, 1.0),
    step: int = 1,
) -> SafeFraction:
    """Return how far one step, straight on, may go, as a fraction of the whole motion.

    ``before``, ``after``: the meshes before and after the step. ``part``: the fractions of the
    motion that they have. The cells of a halo do not count.
    """
    first = part[0]
    length = part[1] - part[0]
    signs = reference_of(undeformed)[1]
    cells = after.cells
    cap = (FARTHEST - first) / length
    margin, cell = least_margin(before, after, cap, signs)
    if margin >= cap:
        return SafeFraction(FARTHEST, step=step)
    nodes = cells.connectivity[cells.offsets[cell] : cells.offsets[cell + 1]]
    where = tuple(undeformed.points[nodes].mean(axis=0).tolist())
    number = after.file_cells(np.array(cell))
    kind = CELL_NAMES[int(after.file_types[number])]
    return SafeFraction(first + margin * length, int(number), kind, where, step)


def chain(steps: Iterable[tuple[float, SafeFraction]]) -> SafeFraction:
    """Return how far a run may go: until the first step that ends beyond its safe fraction.

    ``steps`` have the fraction of the motion after each step, and the step's safe fraction.
    """
    for end, safe in steps:
        if safe.fraction < end:
            break
    return safe


@njit
def _write_bounds(before, after, nodes, turn, far, ends, found):  # type: ignore[no-untyped-def]
    """Write how many of the ascending ``ends`` the margins of hexahedra surely reach, (m,).

    Of the four edges along each direction take the mean, U + s F, and the largest distance from it,
    at most r + s q (`_write_modes`). All coefficients of the proof are means of triple products of
    such edges, so they differ from det(U + s F, V + s G, W + s H) by at most ∏(aᵢ + rᵢ + s qᵢ) -
    ∏aᵢ with a₁ = |U| + s |F|, which is largest at the end of an interval.
    ``far`` (2,): the largest coordinates of all nodes, and of all their displacements.
    """
    start, motion = np.empty((2, 3, 8, LANES))
    modes = np.empty((2, 7, 3, LANES))
    lengths = np.empty((2, 7, LANES))
    spare = np.empty(LANES)
    level = np.empty(LANES, np.int8)
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(before, nodes, first, count, start)
        gather(after, nodes, first, count, motion)
        for axis in range(3):
            for j in range(8):
                for c in range(count):
                    motion[axis, j, c] -= start[axis, j, c]
        _write_modes(start, count, modes[0], lengths[0])
        _write_modes(motion, count, modes[1], lengths[1])
        level[:count] = 0
        for k in range(len(ends) - 1, -1, -1):
            if level[:count].min() > 0:
                break
            _write_spare(modes, lengths, turn[first : first + count], far, ends[k], spare)
            for c in range(count):
                if 0.0 < spare[c] < np.inf:
                    level[c] = max(level[c], k + 1)
        found[first : first + count] = level[:count]


@njit
def _write_modes(at, count, modes, lengths):  # type: ignore[no-untyped-def]
    """Write the modes (7, 3, ...) of hexahedra, and their lengths: what edges are sums of.

    The first three are the mean edges U, V and W along each direction. The edges along the first
    are U ± UV ± UW ± UVW, and so on, with the other modes UV, UW, VW and UVW.
    """
    for axis in range(3):
        for c in range(count):
            a = at[axis, 1, c] - at[axis, 0, c]
            b = at[axis, 2, c] - at[axis, 3, c]
            d = at[axis, 5, c] - at[axis, 4, c]
            e = at[axis, 6, c] - at[axis, 7, c]
            v0 = (at[axis, 3, c] - at[axis, 0, c]) + (at[axis, 2, c] - at[axis, 1, c])
            v1 = (at[axis, 7, c] - at[axis, 4, c]) + (at[axis, 6, c] - at[axis, 5, c])
            w0 = (at[axis, 4, c] - at[axis, 0, c]) + (at[axis, 5, c] - at[axis, 1, c])
            w1 = (at[axis, 7, c] - at[axis, 3, c]) + (at[axis, 6, c] - at[axis, 2, c])
            modes[0, axis, c] = 0.25 * ((a + b) + (d + e))
            modes[1, axis, c] = 0.25 * (v0 + v1)
            modes[2, axis, c] = 0.25 * (w0 + w1)
            modes[3, axis, c] = 0.25 * ((b - a) + (e - d))
            modes[4, axis, c] = 0.25 * ((d + e) - (a + b))
            modes[5, axis, c] = 0.25 * (v1 - v0)
            modes[6, axis, c] = 0.25 * ((e - d) - (b - a))
    for k in range(7):
        for c in range(count):
            mode = column3(modes[k], c)
            lengths[k, c] = np.sqrt(dot3(mode, mode))


@njit
def _write_spare(modes, lengths, turn, far, end, spare):  # type: ignore[no-untyped-def]
    """Write by how much the coefficients of cells, if positive, surely exceed 0 up to ``end``."""
    for c in range(len(turn)):
        u = column3(modes[0, 0], c)
        v = column3(modes[0, 1], c)
        w = column3(modes[0, 2], c)
        f = scaled3(end, column3(modes[1, 0], c))
        g = scaled3(end, column3(modes[1, 1], c))
        h = scaled3(end, column3(modes[1, 2], c))
        uv = cross3(u, v)
        fg = cross3(f, g)
        mixed = add3(cross3(u, g), cross3(f, v))
        one = dot3(uv, h) + dot3(mixed, w)
        two = dot3(fg, w) + dot3(mixed, h)
        # Bernstein coefficients of the cubic on the interval.
        first = turn[c] * dot3(uv, w)
        second = first + turn[c] * one * THIRD
        third = first + turn[c] * (2 * one + two) * THIRD
        last = first + turn[c] * (one + two + dot3(fg, h))
        low = min(first, second, third, last)
        a = lengths[0, 0, c] + end * lengths[1, 0, c]
        b = lengths[0, 1, c] + end * lengths[1, 1, c]
        d = lengths[0, 2, c] + end * lengths[1, 2, c]
        uv_ = lengths[0, 3, c] + end * lengths[1, 3, c]
        uw_ = lengths[0, 4, c] + end * lengths[1, 4, c]
        vw_ = lengths[0, 5, c] + end * lengths[1, 5, c]
        uvw = lengths[0, 6, c] + end * lengths[1, 6, c]
        p = uv_ + uw_ + uvw
        q = uv_ + vw_ + uvw
        r = uw_ + vw_ + uvw
        change = p * (b + q) * (d + r) + a * q * (d + r) + a * b * r
        size = a + p + b + q + d + r  # no nodes are farther apart
        spare[c] = low - change - 2 * ROUNDING * (far[0] + end * far[1]) * size * size


@njit
def _write_margins(vtk, points, displacement, nodes, table, turn, cuts, cap, found):  # type: ignore[no-untyped-def]
    """Write the margins of cells of one type, ``nodes`` (m, n), into ``found`` (m,)."""
    dim = points.shape[1]
    size = len(cuts[2])
    start, motion = np.empty((2, dim, nodes.shape[1], LANES))
    at = np.zeros((3, nodes.shape[1], LANES))
    values = np.empty((4, size, LANES))
    errors = np.empty((4, LANES))
    scale = np.empty(LANES)
    poly = np.empty((size, 4))
    stack = np.empty((len(cuts[0]) * LEVELS + 2, size, 4))
    for first in range(0, len(nodes), LANES):
        count = min(LANES, len(nodes) - first)
        gather(points, nodes, first, count, start)
        gather(displacement, nodes, first, count, motion)
        _normalize(start, motion, count, scale, errors)
        for k in range(4):
            a = (1.0, 1.0, 1.0, 0.0)[k]
            b = (0.0, 1.0, -1.0, 1.0)[k]
            for axis in range(dim):
                for j in range(nodes.shape[1]):
                    for c in range(count):
                        at[axis, j, c] = a * start[axis, j, c] + b * motion[axis, j, c]
            write_coefficients(vtk, at, table, count, values[k])
        safe = _write_polynomials(dim, values, errors, turn[first : first + count], cap / scale)
        for c in range(count):
            found[first + c] = cap
            end = cap / scale[c]
            if not safe[c]:
                poly[:] = values[:, :, c].T
                root = _margin(poly, cuts, end, stack)
                if root < end:
                    found[first + c] = min(cap, scale[c] * root)


@njit
def _normalize(start, motion, count, scale, errors):  # type: ignore[no-untyped-def]
    """Take both relative to the cell's first node, and divide s by ``scale``, (LANES,).

    So both have one size, and the polynomials in s / scale have coefficients of like size.
    ``errors`` (4, LANES) become the polynomial that bounds the rounding errors of determinants.
    """
    for c in range(count):
        far = 0.0
        fast = 0.0
        size = 0.0
        speed = 0.0
        for axis in range(len(start)):
            x = start[axis, 0, c]
            u = motion[axis, 0, c]
            for j in range(start.shape[1]):
                far = max(far, abs(start[axis, j, c]))
                fast = max(fast, abs(motion[axis, j, c]))
                start[axis, j, c] -= x
                motion[axis, j, c] -= u
                size = max(size, abs(start[axis, j, c]))
                speed = max(speed, abs(motion[axis, j, c]))
        scale[c] = size / speed if speed > 1e-100 * size else 1.0
        for axis in range(len(start)):
            for j in range(start.shape[1]):
                motion[axis, j, c] *= scale[c]
        speed = speed * scale[c]
        fast = fast * scale[c]
        if fast == 0.0:
            errors[:, c] = 0.0  # no coordinate changes: the proof decides
            continue
        # (far + fast t) (size + speed t)^(d - 1)
        quadratic = (size * size, 2 * size * speed, speed * speed)
        if len(start) == 2:
            quadratic = (size, speed, 0.0)
        errors[0, c] = ROUNDING * far * quadratic[0]
        errors[1, c] = ROUNDING * (far * quadratic[1] + fast * quadratic[0])
        errors[2, c] = ROUNDING * (far * quadratic[2] + fast * quadratic[1])
        errors[3, c] = ROUNDING * fast * quadratic[2]


@njit
def _write_polynomials(dim, values, errors, turn, ends):  # type: ignore[no-untyped-def]
    """Turn determinants at x, x + v, x - v and v, ``values`` (4, k, ...), into coefficients.

    Return a mask (LANES,) of the cells of which no polynomial has a root up to ``ends``: all of
    its four Bernstein coefficients are positive there.
    """
    safe = np.ones(LANES, np.bool_)
    for k in range(values.shape[1]):
        for c in range(len(turn)):
            sign = turn[c]
            t = ends[c]
            at = values[0, k, c]
            plus = values[1, k, c]
            minus = values[2, k, c]
            last = values[3, k, c]
            cubic = last if dim == 3 else 0.0
            square = 0.5 * (plus + minus) - at if dim == 3 else last
            d0 = sign * at - errors[0, c]
            d1 = sign * (0.5 * (plus - minus) - cubic) - errors[1, c]
            d2 = sign * square - errors[2, c]
            d3 = sign * cubic - errors[3, c]
            values[0, k, c] = d0
            values[1, k, c] = d1
            values[2, k, c] = d2
            values[3, k, c] = d3
            third = t * THIRD
            low = d0 + d1 * third
            high = d0 + (2 * d1 + d2 * t) * third
            end = d0 + (d1 + (d2 + d3 * t) * t) * t
            safe[c] = safe[c] and d0 > 0 and low > 0 and high > 0 and 0 < end < np.inf
    return safe


@njit
def _margin(poly, cuts, end, stack):  # type: ignore[no-untyped-def]
    """Return a lower bound for the first t, up to ``end``, at which a cell is not valid.

    ``poly`` (k, 4): polynomials in t of the corner Jacobians, or of a cell's Bézier coefficients.
    ``cuts``: of `_cuts`.
    ``stack`` (b, k, 4): memory for parts of the cell.
    """
    strides, firsts, corner = cuts
    low, high = _bounds(poly, corner, end)
    if len(strides) == 0 or low >= high * (1 - GAP):
        return min(low, high)
    lows = np.empty(len(stack))
    depths = np.empty(len(stack), np.int64)
    stack[0] = poly
    lows[0] = low
    depths[0] = 0
    least = high
    top = 1
    parts = 1
    while top:
        top -= 1
        low = lows[top]
        depth = depths[top]
        if low >= high * (1 - GAP) or depth == len(strides) * LEVELS or parts >= PARTS:
            least = min(least, low)
            continue
        # The second half takes the place of the part, the first half the next place.
        axis = depth % len(strides)
        _cut(stack[top], strides[axis], firsts[axis], stack[top + 1])
        for k in range(2):
            lows[top + k], upper = _bounds(stack[top + k], corner, high)
            high = min(high, upper)
            depths[top + k] = depth + 1
        if lows[top] < lows[top + 1]:  # the part that limits comes first
            for k in range(poly.shape[0]):
                for j in range(4):
                    swap = stack[top, k, j]
                    stack[top, k, j] = stack[top + 1, k, j]
                    stack[top + 1, k, j] = swap
            lows[top], lows[top + 1] = lows[top + 1], lows[top]
        top = top + 2
        parts = parts + 1
    return min(least, high)


@njit
def _bounds(poly, corner, end):  # type: ignore[no-untyped-def]
    """Return the first roots, up to ``end``, of all coefficients and of the values in corners."""
    high = end
    for k in range(len(poly)):
        if corner[k]:
            high = first_root(poly[k, 0], poly[k, 1], poly[k, 2], poly[k, 3], high)
    low = high
    for k in range(len(poly)):
        if not corner[k]:
            low = first_root(poly[k, 0], poly[k, 1], poly[k, 2], poly[k, 3], low)
    return low, high


@njit
def _cut(poly, stride, firsts, half):  # type: ignore[no-untyped-def]
    """Cut a part in two along an axis: ``poly`` becomes the second half, ``half`` the first."""
    for k in firsts:
        for j in range(4):
            a = poly[k, j]
            b = poly[k + stride, j]
            c = poly[k + 2 * stride, j]
            ab = 0.5 * (a + b)
            bc = 0.5 * (b + c)
            middle = 0.5 * (ab + bc)
            half[k, j] = a
            half[k + stride, j] = ab
            half[k + 2 * stride, j] = middle
            poly[k, j] = middle
            poly[k + stride, j] = bc


@njit
def first_root(a, b, c, d, end):  # type: ignore[no-untyped-def]
    """Return the smallest t at which a + b t + c t² + d t³ is not positive, or ``end``.

    The polynomial is positive at the returned t, and before: a root is returned from below.
    """
    if not 0.0 < a < np.inf:
        return 0.0
    third = end * THIRD
    low = a + b * third
    high = a + (2 * b + c * end) * third
    at_end = a + (b + (c + d * end) * end) * end
    if low > 0 and high > 0 and at_end > 0:
        return end
    # It is monotone between the roots of its derivative b + 2 c t + 3 d t².
    first = second = end
    inner = c * c - 3 * b * d
    if inner > 0:
        q = -(c + np.copysign(np.sqrt(inner), c))
        one = b / q  # q is not 0, for inner is not
        two = q / (3 * d)
        first = min(one, two)
        second = max(one, two)
    left = 0.0
    for right in (first, second, end):
        if left < right <= end:
            if not a + (b + (c + d * right) * right) * right > 0:
                return _root_between(a, b, c, d, left, right)
            left = right
    return end


@njit
def _root_between(a, b, c, d, left, right):  # type: ignore[no-untyped-def]
    """Return the root in an interval from below: positive at ``left``, not at ``right``.

    Newton's method, with bisection where that leaves the interval or is slow; at last steps down
    until the value is positive.
    """
    t = 0.5 * (left + right)
    width = right - left
    for _ in range(200):
        value = a + (b + (c + d * t) * t) * t
        if value > 0:
            left = t
        else:
            right = t
        slope = b + (2 * c + 3 * d * t) * t
        step = -value / slope if slope != 0 else np.inf
        slow = not abs(step) < 0.5 * width
        width = right - left if slow else abs(step)
        before = t
        t = 0.5 * (left + right) if slow or not left < t + step < right else t + step
        if abs(t - before) <= 1e-14 * right or t == before:
            break
    for power in range(6):
        lower = t * (1 - 1e-14 * 10**power)
        if lower <= left:
            return left
        if a + (b + (c + d * lower) * lower) * lower > 0:
            return lower
    return left
