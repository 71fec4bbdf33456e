"""Crossing boundaries: found when they pass through each other, not when they touch."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slideviz.errors import MeshError
from slideviz.mesh import crossing
from slideviz.mesh.crossing import TOLERANCE, fanned, first_crossing, swept_crossing
from slideviz.mesh.model import Cells
from slideviz.mesh.planes import LEAF, BoxTree, line_normals, normals
from tests.oracles import crossing as oracle


def segments(nodes):
    return Cells.from_blocks([(3, nodes)])


def quads(nodes):
    return Cells.from_blocks([(9, nodes)])


def triangles(nodes):
    return Cells.from_blocks([(5, nodes)])


class Scene:
    """Points and surfaces, put together one by one; all node numbers are global."""

    def __init__(self, d):
        self.points = np.empty((0, d))

    def add(self, points, cells):
        first = len(self.points)
        self.points = np.vstack((self.points, points))
        return Cells(cells.types, cells.offsets, cells.connectivity + first)


def sheet(x, y, z=0.0):
    """Grid of quads over the coordinates x, y at a height z(x, y)."""
    nx, ny = len(x), len(y)
    at = np.array([(a, b, z(a, b) if callable(z) else z) for a in x for b in y])
    index = np.arange(nx * ny).reshape(nx, ny)
    corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    return at, quads(np.column_stack([c.ravel() for c in corners]))


def box(low, high, n):
    """Closed surface of a box, n quads (lines) along each axis, nodes merged."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    d = len(low)
    grid = np.array(list(itertools.product(range(n + 1), repeat=d)))
    rim = ((grid == 0) | (grid == n)).any(axis=1)
    number = {tuple(g): i for i, g in enumerate(grid[rim])}
    faces = []
    for axis, side in itertools.product(range(d), (0, n)):
        rest = [k for k in range(d) if k != axis]
        for cell in itertools.product(range(n), repeat=d - 1):
            loop = [(0,), (1,)] if d == 2 else [(0, 0), (1, 0), (1, 1), (0, 1)]
            nodes = []
            for step in loop:
                at = [0] * d
                at[axis] = side
                for k, c, s in zip(rest, cell, step, strict=True):
                    at[k] = c + s
                nodes.append(number[tuple(at)])
            faces.append(nodes)
    return low + grid[rim] / n * (high - low), (segments if d == 2 else quads)(faces)


def floor(d, n=10):
    """A wall at height 0, from 0 to 1 in the other directions."""
    x = np.linspace(0, 1, n + 1)
    if d == 3:
        return sheet(x, x)
    nodes = np.column_stack((np.arange(n), np.arange(1, n + 1)))
    return np.column_stack((x, np.zeros(n + 1))), segments(nodes)


def dropped(d, bottom, *, n=2, wall=10, at=0.4):
    """A body of size 0.2 above (or through) the wall: points, body, [(name, wall)]."""
    scene = Scene(d)
    cells = scene.add(*floor(d, wall))
    low = np.array([at] * (d - 1) + [bottom])
    body = scene.add(*box(low, low + 0.2, n))
    return scene.points, body, [("FLOOR", cells)]


def turned(points, seed):
    """The points after a rotation, so that rounding spoils every alignment."""
    d = points.shape[1]
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(d, d)))
    return points @ turn + 3.0


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("d", [2, 3])
def test_random_simplices_agree_with_linear_programs(d, seed):
    rng = np.random.default_rng(seed)
    size = rng.choice([0.1, 0.25, 0.4])
    centres = rng.random((12, 1, d))
    points = (centres + size * rng.normal(size=(12, d, d))).reshape(-1, d)
    nodes = np.arange(len(points)).reshape(12, d)
    make = segments if d == 2 else triangles
    body, wall = make(nodes[:6]), make(nodes[6:])
    meeting = {
        (i, k)
        for i, k in itertools.product(range(6), repeat=2)
        if oracle.meet(points[nodes[i]], points[nodes[6 + k]])
    }
    found = first_crossing(points, body, [("W", wall)])
    assert (found is not None) == bool(meeting)
    if found is not None:
        assert (found.facet, found.other_facet) in meeting
        for facet in (nodes[found.facet], nodes[6 + found.other_facet]):
            assert oracle.distance(found.point, points[facet]) < 1e-12


def test_random_scenes_include_both_answers():
    """Else the test above could pass with a constant answer."""
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        size = rng.choice([0.1, 0.25, 0.4])
        points = (rng.random((12, 1, 3)) + size * rng.normal(size=(12, 3, 3))).reshape(-1, 3)
        nodes = np.arange(36).reshape(12, 3)
        found.append(first_crossing(points, triangles(nodes[:6]), [("W", triangles(nodes[6:]))]))
    assert 0 < sum(one is None for one in found) < 12


@pytest.mark.parametrize("spin", [None, 0, 1, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("bottom", "crosses"),
    [(0.3, False), (1e-6, False), (-1e-6, True), (-0.07, True), (-0.199999, True), (-0.21, False)],
)
@pytest.mark.parametrize("at", [0.4, 0.43])
def test_body_through_a_wall(d, bottom, crosses, at, spin):
    """Aligned (0.4) and not, above, through and below."""
    points, body, others = dropped(d, bottom, at=at)
    points = points if spin is None else turned(points, spin)
    assert (first_crossing(points, body, others) is not None) == crosses


@pytest.mark.parametrize("spin", [None, 0, 1, 2])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("n", "wall"), [(2, 10), (4, 10), (2, 20), (3, 7), (1, 1)])
def test_body_that_rests_on_a_wall_touches_only(d, n, wall, spin):
    for bottom in (0.0, -0.2):
        points, body, others = dropped(d, bottom, n=n, wall=wall)
        points = points if spin is None else turned(points, spin)
        assert first_crossing(points, body, others) is None


@pytest.mark.parametrize("spin", [None, 0, 1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_nodes_that_lie_on_nodes_do_not_hide_a_crossing(d, spin):
    """Half way in, every edge of either surface ends on the other one."""
    points, body, others = dropped(d, -0.1)
    found = first_crossing(points if spin is None else turned(points, spin), body, others)
    assert found is not None
    assert found.marker == "FLOOR"


@pytest.mark.parametrize("d", [2, 3])
def test_depth_that_counts_as_touching_is_relative(d):
    for scale in (1e-3, 1.0, 1e5):
        for depth, crosses in ((0.5 * TOLERANCE, False), (4 * TOLERANCE, True)):
            points, body, others = dropped(d, -depth, at=0.43)
            assert (first_crossing(scale * points, body, others) is not None) == crosses


@pytest.mark.parametrize("d", [2, 3])
def test_first_of_the_others_that_is_crossed_is_named(d):
    points, body, others = dropped(d, -0.07)
    far = np.zeros((d, d)) + 5 + np.eye(d)
    simplex = (segments if d == 2 else triangles)([np.arange(d) + len(points)])
    points = np.vstack((points, far))
    named = [("FAR", simplex), ("ONE", others[0][1]), ("TWO", others[0][1])]
    assert first_crossing(points, body, named).marker == "ONE"
    assert first_crossing(points, body, named[:1]) is None
    assert first_crossing(points, body, []) is None


def test_facets_are_numbered_as_in_the_file():
    """Triangles and quads in turn: a quad is two triangles, but one facet."""
    at, cells = sheet(range(5), range(2))
    nodes = cells.by_type[9][1]
    flat, types = [], []
    for k, quad in enumerate(nodes):
        if k % 2:
            types += [9]
            flat += [*quad]
        else:
            types += [5, 5]
            flat += [*quad[[0, 1, 2]], *quad[[0, 2, 3]]]
    scene = Scene(3)
    wall = scene.add(at, Cells.from_types(types, flat))
    low = triangles([[0, 1, 2]])
    for x, y, facet in ((0.8, 0.3, 0), (0.2, 0.7, 1), (1.8, 0.3, 2), (1.2, 0.7, 2), (2.8, 0.2, 3)):
        needle = [(x, y, -1), (x, y, 1), (x + 0.01, y, 1)]
        points = np.vstack((scene.points, needle))
        body = Cells(low.types, low.offsets, low.connectivity + len(scene.points))
        found = first_crossing(points, body, [("W", wall)])
        assert (found.facet, found.other_facet) == (0, facet)
        np.testing.assert_allclose(found.point[2], 0, atol=1e-15)


def test_large_facet_pierced_by_a_small_body():
    """No edge of the large one meets the small one: it is the small one's edges that tell."""
    points = np.array([(0, 0, 0), (9, 0, 0), (0, 9, 0), (1, 1, -1), (1.1, 1, 1), (1, 1.1, 1.0)])
    big, small = triangles([[0, 1, 2]]), triangles([[3, 4, 5]])
    assert first_crossing(points, big, [("S", small)]).other_facet == 0
    assert first_crossing(points, small, [("B", big)]).marker == "B"


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("other", range(4))
@pytest.mark.parametrize(("gap", "crosses"), [(0.05, False), (0.0, False), (-0.05, True)])
def test_twisted_surfaces_cross_by_their_shape_not_their_numbering(first, other, gap, crosses):
    scene = Scene(3)
    x = np.linspace(-1, 1, 5)

    def twisted(z):
        at, cells = sheet(x, x, lambda a, b: z + 2.0 * a * b)
        return at, cells

    wall = scene.add(*twisted(0.0))
    body = scene.add(*twisted(gap))
    if crosses:
        scene.points[body.nodes, 2] += 2.0 * scene.points[body.nodes, 0]

    def begins_at(cells, node):
        return quads(np.roll(cells.by_type[9][1], node, axis=1))

    points, (body, wall) = fanned(scene.points, (begins_at(body, first), begins_at(wall, other)))
    assert (first_crossing(points, body, [("wall", wall)]) is not None) == crosses
    assert len(body) == len(wall) == 64
    assert len(points) == len(scene.points) + 32


@pytest.mark.parametrize(
    "z",
    [lambda x, y: 0.0, lambda x, y: x * x + y * y, lambda x, y: x * y, lambda x, y: x * x - y * y],
)
def test_two_sides_of_a_thin_plate_do_not_cross(z):
    """Coincident surfaces with nodes of their own, whichever way their quads are cut."""
    x = np.linspace(-1, 1, 7)
    at, cells = sheet(x, x, z)
    nodes = cells.by_type[9][1]
    for other in (nodes, np.roll(nodes, 1, axis=1), nodes[:, ::-1]):
        scene = Scene(3)
        top, low = scene.add(at, cells), scene.add(at, quads(other))
        assert first_crossing(scene.points, top, [("LOW", low)]) is None
        shifted = scene.points.copy()
        shifted[top.nodes] += [0.01, 0.02, 0.0]
        crosses = z(1, 0.5) != 0
        assert (first_crossing(shifted, top, [("LOW", low)]) is not None) == crosses


@pytest.mark.parametrize("spin", [None, 0, 1])
@pytest.mark.parametrize("d", [2, 3])
def test_bodies_side_by_side_touch_only(d, spin):
    """Flush sides of different length: the corner of one lies inside the side of the other."""
    for n, m in ((2, 2), (2, 3), (1, 4)):
        scene = Scene(d)
        one = scene.add(*box([0] * d, [1] * d, n))
        two = scene.add(*box([1] + [-0.5] * (d - 1), [2] + [0.5] * (d - 1), m))
        points = scene.points if spin is None else turned(scene.points, spin)
        assert first_crossing(points, one, [("TWO", two)]) is None
        assert first_crossing(points, two, [("ONE", one)]) is None


@pytest.mark.parametrize("d", [2, 3])
def test_body_in_a_corner_of_the_room_touches_only(d):
    scene = Scene(d)
    room = scene.add(*box([0] * d, [1] * d, 4))
    body = scene.add(*box([0] * d, [0.5] * d, 2))
    assert first_crossing(scene.points, body, [("ROOM", room)]) is None
    points = scene.points.copy()
    points[body.nodes] -= 0.1
    assert first_crossing(points, body, [("ROOM", room)]) is not None


@pytest.mark.parametrize("spin", [None, 0, 1])
def test_edge_that_grazes_a_ridge_touches_only(spin):
    roof = np.array([(-1, 0, 0), (0, 0, 1), (1, 0, 0), (-1, 1, 0), (0, 1, 1), (1, 1, 0.0)])
    blade = np.array([(-1, 0.5, 1), (1, 0.5, 1), (0, 0.5, 2)])
    points = np.vstack((roof, blade))
    wall, body = quads([[0, 1, 4, 3], [1, 2, 5, 4]]), triangles([[6, 7, 8]])
    for drop, crosses in ((0.0, False), (0.1, True)):
        moved = points.copy()
        moved[6:, 2] -= drop
        moved = moved if spin is None else turned(moved, spin)
        assert (first_crossing(moved, body, [("ROOF", wall)]) is not None) == crosses
        assert (first_crossing(moved, wall, [("BLADE", body)]) is not None) == crosses


def channel(d, height=0.0):
    """A floor, and a fence that stands on it and shares its foot nodes with it."""
    scene = Scene(d)
    wall = scene.add(*floor(d))
    feet = np.flatnonzero(np.isclose(scene.points[:, 0], 0.5))
    columns = [feet]
    for z in (0.1, 0.2, 0.3):
        columns.append(np.arange(len(feet)) + len(scene.points))
        shift = np.zeros(d)
        shift[-1] = z
        scene.points = np.vstack((scene.points, scene.points[feet] + shift))
    index = np.array(columns)
    if d == 2:
        fence = segments(np.column_stack((index[:-1, 0], index[1:, 0])))
    else:
        corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        fence = quads(np.column_stack([c.ravel() for c in corners]))
    return scene.points, fence, wall


@pytest.mark.parametrize("d", [2, 3])
def test_boundary_that_hangs_on_another_may_slide_along_it(d):
    points, fence, wall = channel(d)
    for shift, dip in ((0.0, 0.0), (0.13, 0.0), (0.3, 0.0), (0.13, -0.02)):
        moved = points.copy()
        moved[fence.nodes, 0] += shift
        moved[fence.nodes, -1] += dip
        assert first_crossing(moved, fence, [("FLOOR", wall)]) is None
        assert swept_crossing(points, moved, fence, [("FLOOR", wall)]) is None


@pytest.mark.parametrize("d", [2, 3])
def test_facets_that_hang_on_moved_nodes_are_not_judged(d):
    """The floor beside a lifted foot is stretched across the fence until it has followed."""
    points, fence, wall = channel(d)
    moved = points.copy()
    for z, (x, height) in {0: (0.8, 0.15), 1: (0.55, 0.02), 2: (0.55, 0.2), 3: (0.55, 0.3)}.items():
        row = fence.nodes[np.isclose(points[fence.nodes, -1], z / 10)]
        moved[row, 0], moved[row, -1] = x, height
    assert first_crossing(moved, fence, [("FLOOR", wall)]) is None


@pytest.mark.parametrize("d", [2, 3])
def test_boundary_that_hangs_on_another_may_not_bend_through_it(d):
    points, fence, wall = channel(d)
    moved = points.copy()
    top = fence.nodes[points[fence.nodes, -1] > 0.25]
    moved[top, 0] += 0.23
    moved[top, -1] = -0.05
    assert first_crossing(moved, fence, [("FLOOR", wall)]).marker == "FLOOR"
    assert swept_crossing(points, moved, fence, [("FLOOR", wall)]).marker == "FLOOR"


@pytest.mark.parametrize("spin", [None, 0, 1])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("at", [0.4, 0.43])
def test_body_that_jumped_over_a_wall_is_found_on_its_way(d, at, spin):
    points, body, others = dropped(d, 0.1, at=at)
    for drop, sweeps in ((0.0, False), (0.05, False), (0.1, False), (0.6, True)):
        moved = points.copy()
        moved[body.nodes, -1] -= drop
        start, end = (
            (points, moved) if spin is None else (turned(points, spin), turned(moved, spin))
        )
        assert first_crossing(end, body, others) is None
        found = swept_crossing(start, end, body, others)
        assert (found is not None) == sweeps
    cells = others[0][1]
    wall = end[cells.connectivity.reshape(-1, cells.offsets[1])[found.other_facet]]
    assert found.marker == "FLOOR"
    assert min(oracle.distance(found.point, wall[k]) for k in cut(d)) < 1e-12
    assert 0 <= found.facet < len(body)


def cut(d):
    return [[0, 1]] if d == 2 else [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("d", [2, 3])
def test_walls_that_move_along_are_not_in_the_way(d):
    points, body, others = dropped(d, 0.1, at=0.43)
    moved = points.copy()
    moved[:, -1] -= 5.0
    moved[body.nodes, -1] -= 1.0
    assert swept_crossing(points, moved, body, others) is None
    moved[: len(points) - len(body.nodes)] = points[: len(points) - len(body.nodes)]
    assert swept_crossing(points, moved, body, others) is not None


@pytest.mark.parametrize("d", [2, 3])
def test_chunk_size_does_not_matter(d, monkeypatch):
    for bottom in (-0.07, -0.1, 0.0):
        points, body, others = dropped(d, bottom)
        higher = points.copy()
        higher[body.nodes, -1] += 0.6
        whole = first_crossing(points, body, others), swept_crossing(higher, points, body, others)
        for chunk in (1, 3, 1000):
            monkeypatch.setattr(crossing, "CHUNK", chunk)
            parts = (
                first_crossing(points, body, others),
                swept_crossing(higher, points, body, others),
            )
            for one, part in zip(whole, parts, strict=True):
                assert (one is None) == (part is None)
                if one is not None:
                    assert (one.facet, one.other_facet) == (part.facet, part.other_facet)
                    np.testing.assert_array_equal(one.point, part.point)


@pytest.mark.parametrize("d", [2, 3])
def test_nothing_crosses_nothing(d):
    points, body, others = dropped(d, -0.07)
    none = Cells.from_blocks([])
    for moved, rest in ((none, others), (body, [("EMPTY", none)]), (none, [("EMPTY", none)])):
        assert first_crossing(points, moved, rest) is None
        assert swept_crossing(points, points + 1, moved, rest) is None


def test_flat_facets_and_points_that_are_no_numbers_are_passed_over():
    points, body, others = dropped(3, -0.07, at=0.43)
    points = np.vstack((points, [(0.5, 0.5, 0.0)] * 3, [(np.nan, 0, 0), (0, 1, 0), (1, 0, 0)]))
    n = len(points)
    flat = triangles([[n - 6, n - 5, n - 4]])
    assert first_crossing(points[:-3], body, [("POINT", flat), *others]).marker == "FLOOR"
    torn = triangles([[n - 3, n - 2, n - 1]])
    with np.errstate(invalid="ignore"):
        assert first_crossing(points, body, [("TORN", torn), *others]).marker == "FLOOR"


@pytest.mark.parametrize(
    ("d", "vtk", "message"),
    [
        (2, 5, r"dimension 2 has a triangle \(dimension 2\); its elements must have dimension 1"),
        (3, 3, r"dimension 3 has a line \(dimension 1\); its elements must have dimension 2"),
        (3, 10, r"has a tetrahedron \(dimension 3\)"),
    ],
)
def test_elements_must_be_those_of_a_boundary(d, vtk, message):
    points, body, others = dropped(d, 0.1)
    wrong = Cells.from_blocks([(vtk, [np.arange({3: 2, 5: 3, 10: 4}[vtk])])])
    for ask in (first_crossing, lambda p, m, o: swept_crossing(p, p, m, o)):
        with pytest.raises(MeshError, match=message):
            ask(points, wrong, others)
        with pytest.raises(MeshError, match=message):
            ask(points, body, [("W", wrong)])


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("n", [1, LEAF, LEAF + 1, 37, 64])
def test_tree_finds_all_that_overlap(d, n):
    rng = np.random.default_rng(n)
    corners = rng.random((n, 1, d)) + rng.choice([0.01, 0.1, 1.0], (n, 1, 1)) * rng.random(
        (n, d, d)
    )
    queries = rng.random((20, 1, d)) + 0.2 * rng.random((20, d, d))
    low, high = corners.min(axis=1), corners.max(axis=1)
    tree = BoxTree.of(low, high)
    everything = set(itertools.product(range(20), range(n)))
    overlap = {
        (q, i)
        for q, i in everything
        if (queries[q].min(axis=0) <= high[i]).all() and (queries[q].max(axis=0) >= low[i]).all()
    }
    none = np.zeros((20, 1, d))
    assert set(zip(*map(list, tree.near(queries, none, 0.0)), strict=True)) == overlap
    nodes = rng.integers(0, 3 * n, (20, d)), rng.integers(0, 3 * n, (n, d))
    apart = {(q, i) for q, i in overlap if not set(nodes[0][q]) & set(nodes[1][i])}
    assert list(zip(*tree.near(queries, none, 0.0, nodes), strict=True)) == sorted(apart)
    near = set(zip(*map(list, tree.near(queries, normals(queries)[:, None], 0.0)), strict=True))
    assert near <= overlap
    corner_ids = list(itertools.product((0, 1), repeat=d))
    for q, i in overlap - near:
        hull = [[(low, high)[s][i][k] for k, s in enumerate(c)] for c in corner_ids]
        assert not oracle.meet(queries[q], hull)


def test_line_normals_are_normal():
    rng = np.random.default_rng(0)
    for d in (2, 3):
        ways = rng.random((5, 2, d))
        along = np.einsum("wcd,wd->wc", line_normals(ways), ways[:, 1] - ways[:, 0])
        np.testing.assert_allclose(along, 0, atol=1e-15)
