"""Meshes of any size of the sample ``turbine-row``, a linear cascade (thesis section 4.1.3).

``python -m tools.study.vane_mesh`` writes the two that slideviz has as files.

A layer of quadrilaterals lies around the vane, and triangles fill the rest of the channel. At
the default size the numbers of cells are those of thesis Table 4.7, to a few per cent.

The points of the triangles come from an advancing front. Every accepted point proposes the corners
of a hexagon around it, and then those of a second one turned by 30 degrees; a proposal is accepted
when no point is too near. The hexagon has a corner opposite to the point's parent, so that rows of
triangles are parallel to the boundary. The idea is that of J. Slak and G. Kosec, "On generation
of node distributions for meshless PDE discretizations", SIAM J. Sci. Comput. 41, 2019.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import Delaunay, cKDTree

from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.samples import turbine_row
from slideviz.system.jit_cache import njit
from tools.study.vane import AHEAD, CHORD, LENGTH, camber, camber_line, pitch, vane_layers

ROUNDS = 8  # triangulations in `relax`
SWEEPS = 6  # moves of all points with each

SLOPE = 350.0  # k in the formula, per unit of length: the slope of h / h0 at D = 0
WAKE = 0.3  # d on the wake, divided by the way from the trailing edge
SHAPE = (150, 250)  # grid points in x and y of the table of edge lengths


def triangulate(points: FloatArray, edges: IntArray) -> IntArray:
    """Return the Delaunay triangles (m, 3) of a domain, counter-clockwise.

    ``points`` (n, 2): points of the boundary and inside.
    ``edges`` (e, 2): the boundary, closed, with the domain on its left.
    """
    triangles = Delaunay(points).simplices.astype(np.int64)
    at = points[triangles]
    ax, ay = (at[:, 1] - at[:, 0]).T
    bx, by = (at[:, 2] - at[:, 0]).T
    triangles[ax * by < ay * bx] = triangles[ax * by < ay * bx][:, ::-1]
    rim = np.zeros(len(points), bool)
    rim[edges] = True
    # A triangle with a node inside is inside; the others are few.
    doubtful = np.flatnonzero(rim[triangles].all(axis=1))
    outside = ~inside(points[triangles[doubtful]].mean(axis=1), points, edges)
    return np.delete(triangles, doubtful[outside], axis=0)


def relax(points: FloatArray, fixed: int, edges: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the relaxed points (n, 2), of which the first ``fixed`` stay, and their triangles.

    A point moves to the mean of its triangles' centroids, weighted by the square root of the area:
    a compromise between Laplacian smoothing, which ignores the size, and weights by the area,
    which make all areas equal. ``edges`` are the boundary's, as of `triangulate`.
    """
    for _ in range(ROUNDS):
        triangles = triangulate(points, edges)
        for _ in range(SWEEPS):
            points = _sweep(points, triangles, fixed)
    return points, triangulate(points, edges)


def _sweep(points: FloatArray, triangles: IntArray, fixed: int) -> FloatArray:
    """Return the points with all after the first ``fixed`` moved once, as `relax` says."""
    at = points[triangles]
    ax, ay = (at[:, 1] - at[:, 0]).T
    bx, by = (at[:, 2] - at[:, 0]).T
    weight = np.sqrt(np.abs(ax * by - ay * bx))
    total = np.bincount(triangles.ravel(), np.repeat(weight, 3), len(points))
    moved = points.copy()
    for k, centre in enumerate(at.mean(axis=1).T):
        pull = np.bincount(triangles.ravel(), np.repeat(weight * centre, 3), len(points))
        moved[fixed:, k] = pull[fixed:] / total[fixed:]
    return moved


def inside(places: FloatArray, points: FloatArray, edges: IntArray) -> NDArray[np.bool_]:
    """Return which places (k, 2) the edges (e, 2) of points (n, 2) go round oddly often, (k,)."""
    odd = np.zeros(len(places), bool)
    x0, y0 = points[edges[:, 0]].T
    x1, y1 = points[edges[:, 1]].T
    order = np.argsort(places[:, 1], kind="stable")
    heights = places[order, 1]
    first = np.searchsorted(heights, np.minimum(y0, y1), side="left")
    last = np.searchsorted(heights, np.maximum(y0, y1), side="left")
    for e in np.flatnonzero(last > first):
        here = order[first[e] : last[e]]
        cut = x0[e] + (places[here, 1] - y0[e]) / (y1[e] - y0[e]) * (x1[e] - x0[e])
        odd[here] ^= places[here, 0] < cut
    return odd


@dataclass(frozen=True, eq=False)
class Sizing:
    """Edge length tabulated over the rectangle around the channel."""

    low: FloatArray
    step: FloatArray
    """`low`, `step` (2,): first grid point, and distances of grid points in x and y."""
    table: FloatArray  # (nx, ny): edge length at the grid points

    def at(self, points: FloatArray) -> FloatArray:
        """Return the edge length (k,) at points (k, 2), bilinear between grid points."""
        place = (points - self.low) / self.step
        sizes: FloatArray = map_coordinates(self.table, place.T, order=1, mode="nearest")
        return sizes


def find_sizing(rim: FloatArray, triangles: float) -> Sizing:
    """Return edge lengths with which about so many triangles fill the channel, choosing m.

    ``rim`` (k, 2): the outermost nodes of the layer around the vane, in order.
    ``triangles``: number of equilateral triangles in the channel outside the layer.
    """
    shortest = float(np.mean(np.hypot(*(np.roll(rim, -1, axis=0) - rim).T)))
    x = np.linspace(-AHEAD, LENGTH - AHEAD, SHAPE[0])
    below = camber(x).min() - pitch() / 2
    above = camber(x).max() + pitch() / 2
    y = np.linspace(below, above, SHAPE[1])
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)
    far = _distance(grid.reshape(-1, 2), rim).reshape(SHAPE)
    loop = np.arange(len(rim))
    around = inside(grid.reshape(-1, 2), rim, np.column_stack([loop, np.roll(loop, -1)]))
    channel = np.abs(grid[..., 1] - camber(x)[:, None]) < pitch() / 2
    free = channel & ~around.reshape(SHAPE)
    area = pitch() * LENGTH * np.count_nonzero(free) / np.count_nonzero(channel)
    # The least m has the most triangles, and 0.3 leaves room for coarse meshes with few layers.
    low = 0.3
    high = 60.0
    for _ in range(50):
        middle = (low + high) / 2
        h = shortest * _growth(far[free], middle)
        count = 4 / np.sqrt(3) * area * np.mean(1 / h**2)
        low, high = (middle, high) if count > triangles else (low, middle)
    step = np.array([x[1] - x[0], y[1] - y[0]])
    return Sizing(np.array([x[0], y[0]]), step, shortest * _growth(far, high))


def _growth(far: FloatArray, most: float) -> FloatArray:
    """Return h / h0 at distances D, ``far``, for m = ``most``."""
    span = most - 1
    if abs(span) < 1e-9:
        return np.ones_like(far)
    return 1 + span * -np.expm1(-SLOPE * far / abs(span))


def _distance(points: FloatArray, rim: FloatArray) -> FloatArray:
    """Return D (k,) of outer points (k, 2), from the rim's nodes (r, 2) and any vane's wake."""
    best = np.full(len(points), np.inf)
    s, *line = camber_line()
    wake = s > CHORD
    way = s[wake] - CHORD
    spine = np.column_stack([values[wake] for values in line[:2]])
    tree = cKDTree(rim)
    wake_tree = cKDTree(spine)
    nearest = np.round((points[:, 1] - camber(points[:, 0])) / pitch())
    for k in (-1, 0, 1):
        here = np.column_stack([points[:, 0], points[:, 1] - (nearest + k) * pitch()])
        near, at = wake_tree.query(here)
        best = np.minimum(best, np.minimum(tree.query(here)[0], near + WAKE * way[at]))
    return best


LINE = 3  # VTK identifiers
TRIANGLE = 5
QUADRILATERAL = 9
CELLS = 224_180
AROUND = 1315
LAYERS = 25
"""Cells of the mesh, nodes around the vane, and layers of quadrilaterals at the default size.

The first two are those of thesis Tables 4.7 and 4.8; the third follows by Euler's formula.
"""
SIZES = (5_000, 5_000_000)  # least and largest number of cells
CALIBRATION = 1.035
"""Number of equilateral triangles to ask for, divided by that which the front then makes."""

NEAREST = 0.78  # least distance of two points, divided by the wanted edge length there
# Directions of a point's proposals in the order of trial, from that of its parent to it.
_TURNS = np.radians([0.0, 60.0, -60.0, 120.0, -120.0, 180.0, 30.0, -30.0, 90.0, -90.0, 150.0])


def row_mesh(size: int) -> Mesh:
    """Return a mesh of about ``size`` cells; raise CaseError if it is not within ``SIZES``."""
    if not SIZES[0] <= size <= SIZES[1]:
        raise CaseError(f"size {size} is out of range; a turbine row has {SIZES[0]} to {SIZES[1]}")
    scale = float(np.sqrt(size / CELLS))
    around = round(AROUND * scale)
    layers = round(LAYERS * scale)
    rings = vane_layers(around, layers)
    wanted = CALIBRATION * (size - around * layers)
    sizing = find_sizing(rings[-1], wanted)
    sides, outline = _channel(sizing)
    ring = len(outline) + np.arange(around)
    rim = np.concatenate([*sides.values(), _loop(ring)[:, ::-1]])
    fixed = np.concatenate([outline, rings[-1]])
    points = np.concatenate([fixed, front_points(fixed, rim, sizing, wanted)])
    points, triangles = relax(points, len(fixed), rim)
    inner = len(points) + np.arange(around * layers).reshape(layers, around)
    points = np.concatenate([points, rings[:-1].reshape(-1, 2)])
    numbers = np.concatenate([inner, ring[None]])
    after = np.roll(numbers, -1, axis=1)
    quads = np.stack([numbers[:-1], numbers[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    cells = Cells.from_blocks([(QUADRILATERAL, quads), (TRIANGLE, triangles)])
    named = {"BLADE": _loop(numbers[0]), **sides}
    markers = [Marker(name, Cells.from_blocks([(LINE, side)])) for name, side in named.items()]
    return Mesh(points, cells, tuple(markers), name="turbine-row")


def _channel(sizing: Sizing) -> tuple[dict[str, IntArray], FloatArray]:
    """Return the edges (e, 2) of the channel's sides, by marker, and the nodes (n, 2) of all.

    The domain is on the left of the edges. PER2 has the nodes of PER1, shifted by the pitch.
    """
    _, xs, ys, _ = camber_line()
    ends = np.array([-AHEAD, LENGTH - AHEAD])
    x = np.concatenate([ends[:1], xs[(xs > ends[0]) & (xs < ends[1])], ends[1:]])
    line = np.column_stack([x, np.interp(x, xs, ys)])
    half = np.array([0.0, pitch() / 2])
    below = _spread(line - half, sizing)
    inflow = _spread(np.linspace(line[0] - half, line[0] + half, 501), sizing)
    outflow = _spread(np.linspace(line[-1] - half, line[-1] + half, 501), sizing)
    sides = [below, outflow, (below + 2 * half)[::-1], inflow[::-1]]
    outline = np.concatenate([side[:-1] for side in sides])
    loop = _loop(np.arange(len(outline)))
    parts = np.split(loop, np.cumsum([len(side) - 1 for side in sides])[:-1])
    order = {"INFLOW": 3, "OUTFLOW": 1, "PER1": 0, "PER2": 2}
    return {name: parts[k] for name, k in order.items()}, outline


def _spread(curve: FloatArray, sizing: Sizing) -> FloatArray:
    """Return points (k, 2) on a fine curve (m, 2), with its ends, at distances by ``sizing``."""
    steps = np.hypot(*np.diff(curve, axis=0).T)
    density = 1 / sizing.at((curve[1:] + curve[:-1]) / 2)
    place = np.concatenate([[0.0], np.cumsum(steps * density)])
    at = np.linspace(0.0, place[-1], max(round(place[-1]), 2) + 1)
    points = np.column_stack([np.interp(at, place, column) for column in curve.T])
    points[[0, -1]] = curve[[0, -1]]
    return points


def _loop(nodes: IntArray) -> IntArray:
    return np.column_stack([nodes, np.roll(nodes, -1)])


def front_points(
    fixed: FloatArray, edges: IntArray, sizing: Sizing, triangles: float
) -> FloatArray:
    """Return points (k, 2) that fill the inside of a domain, by an advancing front.

    ``fixed`` (n, 2): nodes of the boundary, at distances by ``sizing``.
    ``edges`` (e, 2): edges of the boundary, with the domain on their left.
    ``sizing``: the edge length, tabulated over a rectangle that contains the domain.
    ``triangles``: about how many equilateral triangles of these edge lengths fill the domain.
    """
    first = fixed[edges[:, 0]]
    second = fixed[edges[:, 1]]
    along = second - first
    inward = np.column_stack([-along[:, 1], along[:, 0]])
    apexes = (first + second) / 2 + np.sqrt(3) / 2 * inward
    angles = np.arctan2(inward[:, 1], inward[:, 0])
    # Room for as many as fit when all are at the least distance, at two triangles to a point.
    most = int(triangles / (2 * NEAREST**2)) + len(fixed)
    starts = np.column_stack([apexes, angles])
    given = sizing.low, sizing.step, sizing.table, float(np.median(sizing.table))
    return _fill(fixed, starts, given, most, _TURNS)


@njit(nogil=True, cache=True, error_model="numpy")
def _size_at(x, y, low, step, table):  # type: ignore[no-untyped-def]
    """Return the edge length at (x, y), bilinear in the table of a `Sizing`; -1 outside of it."""
    px = (x - low[0]) / step[0]
    py = (y - low[1]) / step[1]
    if px < 0 or py < 0 or px > table.shape[0] - 1 or py > table.shape[1] - 1:
        return -1.0
    i = min(int(px), table.shape[0] - 2)
    j = min(int(py), table.shape[1] - 2)
    u = px - i
    v = py - j
    left = (1 - v) * table[i, j] + v * table[i, j + 1]
    right = (1 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
    return (1 - u) * left + u * right


@njit(nogil=True, cache=True, error_model="numpy")
def _is_free(x, y, reach, points, buckets):  # type: ignore[no-untyped-def]
    """Return whether no point is nearer to (x, y) than ``reach``.

    Buckets are squares of a grid: the first point of each, the next point after each point (-1: no
    more), the grid's lowest corner, and the width of a square.
    """
    heads, following, low, width = buckets
    i0 = int((x - reach - low[0]) / width)
    i1 = int((x + reach - low[0]) / width)
    j0 = int((y - reach - low[1]) / width)
    j1 = int((y + reach - low[1]) / width)
    for i in range(max(i0, 0), min(i1, heads.shape[0] - 1) + 1):
        for j in range(max(j0, 0), min(j1, heads.shape[1] - 1) + 1):
            k = heads[i, j]
            while k >= 0:
                if (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 < reach * reach:
                    return False
                k = following[k]
    return True


@njit(nogil=True, cache=True, error_model="numpy")
def _fill(fixed, starts, sizing, most, turns):  # type: ignore[no-untyped-def]
    """Return the accepted points (k, 2), in the order of acceptance."""
    low, step, table, width = sizing
    n = len(fixed)
    points = np.empty((n + most, 2))
    angles = np.empty(n + most)
    nx = int(table.shape[0] * step[0] / width) + 1
    ny = int(table.shape[1] * step[1] / width) + 1
    heads = np.full((nx, ny), -1)
    following = np.full(n + most, -1)
    buckets = (heads, following, low, width)
    count = 0
    for k in range(n + len(starts)):
        if k < n:
            x, y = fixed[k]
        else:
            x, y, angles[count] = starts[k - n]
            size = _size_at(x, y, low, step, table)
            if size < 0 or not _is_free(x, y, NEAREST * size, points, buckets):
                continue
        count = _add(x, y, points, count, buckets)
    at = n
    while at < count < n + most:
        reach = _size_at(points[at, 0], points[at, 1], low, step, table)
        for turn in turns:
            angle = angles[at] + turn
            x = points[at, 0] + reach * np.cos(angle)
            y = points[at, 1] + reach * np.sin(angle)
            size = _size_at(x, y, low, step, table)
            if size > 0 and _is_free(x, y, NEAREST * size, points, buckets) and count < n + most:
                angles[count] = angle
                count = _add(x, y, points, count, buckets)
        at += 1
    return points[n:count].copy()


@njit(nogil=True, cache=True, error_model="numpy")
def _add(x, y, points, count, buckets):  # type: ignore[no-untyped-def]
    heads, following, low, width = buckets
    i = min(max(int((x - low[0]) / width), 0), heads.shape[0] - 1)
    j = min(max(int((y - low[1]) / width), 0), heads.shape[1] - 1)
    points[count, 0] = x
    points[count, 1] = y
    following[count] = heads[i, j]
    heads[i, j] = count
    return count + 1


def write_files() -> None:
    """Write the files of the sample, compressed."""
    for size in turbine_row.SIZES:
        mesh = row_mesh(size)
        tables = {"points": mesh.points}
        for name, vtk in (("quads", QUADRILATERAL), ("triangles", TRIANGLE)):
            tables[name] = mesh.cells.by_type[vtk][1].astype(np.int32)
        for marker in mesh.markers:
            tables[marker.name] = marker.cells.by_type[LINE][1].astype(np.int32)
        path = Path(turbine_row.__file__).with_name(f"turbine_row_{size}.npz")
        np.savez_compressed(path, **tables)


if __name__ == "__main__":
    write_files()
