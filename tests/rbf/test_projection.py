"""Closest points: against brute force, and the laws of a projection."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.mesh.fans import fan_normals, find_fans
from slideviz.mesh.topology import find_boundary
from slideviz.rbf.classify import classify, fan_roles
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.projection import Tracks, find_tracks, projection_matrices
from tests import builders
from tests.oracles import geometry

SEEDS = st.integers(0, 10_000)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, flat=st.sampled_from([1.0, 1e-3]))
def test_the_closest_point_of_a_triangle(seed, flat):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(3, 3)) * [1, flat, 1]
    x = rng.normal(size=3) * 2
    found = ClosestPoints(corners[None]).query(x[None])[0]
    expected = geometry.closest_on_triangle(x, corners)
    # The oracle, a search, is off by up to 1e-3 in thin triangles; it is never nearer.
    assert np.linalg.norm(found - x) <= np.linalg.norm(expected - x) + 1e-9
    parts = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), np.r_[found, 1.0])[0]
    np.testing.assert_allclose(parts @ corners, found, atol=1e-12)
    assert parts.min() >= -1e-9


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, dim=st.sampled_from([2, 3]))
def test_the_closest_point_of_a_segment(seed, dim):
    rng = np.random.default_rng(seed)
    ends, x = rng.normal(size=(2, dim)), rng.normal(size=dim) * 2
    found = ClosestPoints(ends[None]).query(x[None])[0]
    np.testing.assert_allclose(found, geometry.closest_on_segment(x, ends), atol=1e-6)


@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, count=st.integers(1, 60), c=st.sampled_from([2, 3]))
def test_no_simplex_of_a_track_is_nearer(seed, count, c):
    """Simplices of very different size, so that the nearest centre is often the wrong one."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-3, 0.5, (count, 1, 1))
    corners = rng.normal(size=(count, 1, 3)) + size * rng.normal(size=(count, c, 3))
    x = rng.normal(size=(10, 3)) * 2
    found = ClosestPoints(corners).query(x)
    each = np.stack([ClosestPoints(s[None]).query(x) for s in corners])
    gaps = np.linalg.norm(each - x, axis=2).min(axis=0)
    np.testing.assert_allclose(np.linalg.norm(found - x, axis=1), gaps, atol=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_images_are_those_that_stand_beside_their_simplices(dim):
    rng = np.random.default_rng(dim)
    corners, shift = rng.normal(size=(40, dim, dim)), np.array([0.3, -1.7, 0.0])[:dim]
    every = np.concatenate([corners, corners - shift, corners + shift])
    x = rng.uniform(-1.0, 1.0, size=(200, dim))
    track = ClosestPoints(corners, shift)
    found, which = track.nearest(x)
    expected, there = ClosestPoints(every).nearest(x)
    assert np.array_equal(found, expected)
    assert np.array_equal(which, there)
    assert set(which // 40) == {0, 1, 2}
    assert np.array_equal(track.simplices(which), every[which])


@pytest.mark.parametrize("dim", [2, 3])
def test_simplices_go_on_at_all_periods(dim):
    """Two periods away a point was put onto the end of the last image."""
    rng = np.random.default_rng(dim)
    shift = np.array([1.0, 0.0, 0.2])[:dim]
    ends = np.linspace(0.0, 1.0, 21)[:, None] * shift
    ends[1:-1, 1] += 0.1 * rng.normal(size=19)
    corners = np.stack([ends[:-1], ends[1:], ends[:-1] + np.eye(dim)[-1]][:dim], axis=1)
    x = rng.uniform(-0.5, 0.5, size=(300, dim)) + rng.integers(-9, 9, size=(300, 1)) * shift
    track = ClosestPoints(corners, shift)
    found, which = track.nearest(x)
    every = np.concatenate([corners + k * shift for k in range(-12, 13)])
    np.testing.assert_allclose(found, ClosestPoints(every).query(x), rtol=0, atol=1e-13)
    pairs = zip(track.simplices(which), x, strict=True)
    on = [ClosestPoints(one[None]).query(at[None])[0] for one, at in pairs]
    np.testing.assert_allclose(on, found, rtol=0, atol=1e-13)
    again, _ = track.nearest(x, which)
    np.testing.assert_allclose(again, found, rtol=0, atol=1e-13)
    for gone in (np.inf, np.nan, 1e300):
        assert track.query(np.full((1, dim), gone)).shape == (1, dim)


@pytest.mark.parametrize("scale", [1e-42, 1.0, 1e40])
def test_no_simplex_is_missed_where_boxes_are_rounded(scale):
    """Boxes have four bytes for a number, which go from 1e-45 to 3e38."""
    rng = np.random.default_rng(3)
    corners, x = rng.normal(size=(60, 3, 3)), rng.normal(size=(50, 3))
    corners, x = corners * scale, x * scale
    found, _ = ClosestPoints(corners).nearest(x)
    each = np.stack([ClosestPoints(one[None]).query(x) for one in corners])
    gaps = np.linalg.norm((each - x) / scale, axis=2).min(axis=0)
    np.testing.assert_allclose(np.linalg.norm((found - x) / scale, axis=1), gaps, atol=1e-12)


def test_degenerate_simplices_do_no_harm():
    point = np.tile([1.0, 2.0, 3.0], (1, 3, 1))
    np.testing.assert_allclose(ClosestPoints(point).query(np.zeros((1, 3))), [[1, 2, 3]])
    line = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    np.testing.assert_allclose(ClosestPoints(line).query(np.array([[1.5, 1, 0]])), [[1.5, 0, 0]])
    dot = np.array([[[1.0, 1.0], [1.0, 1.0]]])
    np.testing.assert_allclose(ClosestPoints(dot).query(np.array([[0.0, 0.0]])), [[1, 1]])


@pytest.mark.parametrize("slide", [3e-11, -3e-10, 1e-8, -1e-7])
def test_a_slide_is_seen_however_small_it_is_beside_the_way_to_the_boundary(slide):
    # The end of one piece tied with a point of the next, and came first up to a millionth.
    wall = np.array([[[0.0, 0.0], [0.0, 0.5]], [[0.0, 0.5], [0.0, 1.0]]])
    for pieces in (wall, wall[::-1]):
        found = ClosestPoints(pieces).query(np.array([[1e-3, 0.5 + slide]]))[0]
        np.testing.assert_allclose(found, [0.0, 0.5 + slide], rtol=0, atol=2e-11)


def tracks_of(mesh, roles, method=("ps", "none"), shift=None):
    boundary = find_boundary(mesh)
    fans = find_fans(boundary, mesh.points)
    normals, representative = fan_normals(boundary, fans, mesh.points), np.arange(len(mesh.points))
    classes = classify(
        fans,
        fan_roles(boundary, fans, roles),
        normals,
        representative,
        sliding=method[0],
        periodic=method[1],
        feature_angle_deg=40.0,
    )
    return classes, find_tracks(
        boundary,
        fans,
        classes,
        lambda nodes: mesh.points[nodes],
        roles=roles,
        feature_angle_deg=40.0,
        shift=shift,
        holes=boundary.facets[:0],
    )


CASES = {
    "square": (lambda: builders.square(8), ("x_m", "x_p", "y_m", "y_p"), "BLOCK"),
    "cube": (lambda: builders.cube(6), ("x_m", "x_p", "y_m", "y_p", "z_m", "z_p"), "BLOCK"),
    "tets": (lambda: builders.cube(4, "simplex"), ("x_m", "y_m", "z_m", "z_p"), "BLOCK"),
    "circle": (lambda: builders.annulus(far_parts=2), ("far0", "far1"), "wall"),
    "passage": (builders.passage, ("hub", "shroud", "inflow", "outflow", "per1", "per2"), "blade"),
    "sphere": (lambda: builders.sphere_in_box(5), ("sphere", "x_p", "y_p"), "x_m"),
}


@pytest.fixture(params=CASES, scope="module")
def sliding_case(request):
    build, sliding, moving = CASES[request.param]
    mesh = build()
    roles = dict.fromkeys(sliding, "sliding") | {moving: "moving"}
    return mesh, *tracks_of(mesh, roles)


def test_every_sliding_node_has_a_track_that_goes_through_it(sliding_case):
    mesh, classes, tracks = sliding_case
    assert np.all(tracks.of_node[classes.sliding] >= 0)
    for node in classes.sliding:
        at = tracks.tracks[tracks.of_node[node]].query(mesh.points[node][None])[0]
        np.testing.assert_allclose(at, mesh.points[node], atol=1e-14)


def test_the_tracks_of_edges_are_curves(sliding_case):
    _, classes, tracks = sliding_case
    for node in classes.edge:
        assert tracks.tracks[tracks.of_node[node]].corners.shape[1] == 2
    for node in classes.surface:
        assert tracks.tracks[tracks.of_node[node]].corners.shape[1] == 3


def test_projection_is_idempotent_and_stays_on_the_track(sliding_case):
    mesh, classes, tracks = sliding_case
    rng = np.random.default_rng(0)
    nodes = classes.sliding
    free = rng.normal(size=(len(nodes), mesh.dim)) * 0.3 * mesh.extent
    once = tracks.project(mesh.points, nodes, free)
    twice = tracks.project(mesh.points, nodes, once)
    np.testing.assert_allclose(twice, once, atol=1e-13)
    for index in np.unique(tracks.of_node[nodes]):
        rows = tracks.of_node[nodes] == index
        at = (mesh.points[nodes] + once)[rows]
        back = tracks.tracks[index].query(at)
        np.testing.assert_allclose(back, at, atol=1e-13)
        low, high = (f(tracks.tracks[index].corners, axis=(0, 1)) for f in (np.min, np.max))
        # Beyond a moving boundary tracks go on.
        assert np.all((at >= low - 1e-13) | (low == mesh.points[classes.moving].min(axis=0)))
        assert np.all(at <= high + 1e-13)


def test_beyond_a_rim_simplices_go_on_flat_and_nowhere_else():
    chain = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.0, 1.0]]])
    track = ClosestPoints(chain, None, np.array([[[2.0, 1.0]]]))
    at = track.query(np.array([[3.0, 2.5], [-1.0, 0.2], [0.5, 0.3]]))
    assert at == pytest.approx(np.array([[3.25, 2.25], [0.0, 0.0], [0.5, 0.0]]))
    side = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    square = np.array([[[0.0, 0.0, 0.0], *side], [[0.0, 0.0, 0.0], side[1], [0.0, 1.0, 0.0]]])
    # Not where the surface turns up at once beyond another rim: what is there is nearer.
    wall = np.array([[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.1, 0.5, 1.0]]])
    period = np.array([0.0, 5.0, 0.0])
    track = ClosestPoints(np.concatenate([square, wall]), period, side[None])
    x = [[1.5, 0.5, 0.3], [1.5, 1.2, 0.1], [-0.5, 0.5, -0.3], [0.5, 0.5, 0.2], [1.5, 5.5, 0.3]]
    wanted = [[1.5, 0.5, 0.0], [1.5, 1.2, 0.0], [0.0, 0.5, 0.0], [0.5, 0.5, 0.0], [1.5, 5.5, 0.0]]
    assert track.query(np.array(x)) == pytest.approx(np.array(wanted))


def test_a_zero_displacement_stays_zero_to_the_bit(sliding_case):
    mesh, classes, tracks = sliding_case
    nodes = classes.sliding
    assert not tracks.project(mesh.points, nodes, np.zeros((len(nodes), mesh.dim))).any()


def test_a_node_that_would_pass_the_corner_stays_at_it():
    mesh = builders.square(8)
    roles = dict.fromkeys(("x_m", "x_p", "y_m", "y_p"), "sliding") | {"BLOCK": "moving"}
    _, tracks = tracks_of(mesh, roles)
    node = int(np.argmin(np.linalg.norm(mesh.points - [0.875, 0.0], axis=1)))
    moved = tracks.project(mesh.points, np.array([node]), np.array([[0.7, 0.4]]))
    np.testing.assert_allclose(mesh.points[node] + moved[0], [1.0, 0.0], atol=1e-15)


def test_flat_and_curved_are_told_apart():
    for name, curved in (("square", False), ("cube", False), ("circle", True), ("passage", True)):
        build, sliding, moving = CASES[name]
        roles = dict.fromkeys(sliding, "sliding") | {moving: "moving"}
        assert tracks_of(build(), roles)[1].curved is curved


def test_a_track_goes_on_beyond_a_periodic_boundary():
    mesh = builders.square(8)
    roles = dict.fromkeys(("x_m", "x_p"), "sliding") | dict.fromkeys(("y_m", "y_p"), "periodic")
    roles |= {"BLOCK": "moving"}
    _, tracks = tracks_of(mesh, roles, ("ds", "moving"), np.array([0.0, 1.0]))
    node = int(np.argmin(np.linalg.norm(mesh.points - [0.0, 1.0], axis=1)))
    moved = tracks.project(mesh.points, np.array([node]), np.array([[0.1, 0.3]]))
    np.testing.assert_allclose(moved, [[0.0, 0.3]], atol=1e-15)


def test_no_sliding_no_tracks():
    mesh = builders.square(6)
    _, tracks = tracks_of(mesh, {"BLOCK": "moving"})
    assert tracks.tracks == ()
    assert not tracks.curved
    assert np.all(tracks.of_node == -1)


@pytest.mark.parametrize("second", ["sliding", "internal"])
def test_a_node_between_two_roles_in_one_plane_slides_on_both(second):
    mesh = builders.grid(
        (8, 8),
        rules=[
            ("low1", lambda p: bool(np.all(p[:, 1] == 0) and p[:, 0].max() <= 4)),
            ("low2", lambda p: bool(np.all(p[:, 1] == 0))),
            ("top", lambda p: bool(np.all(p[:, 1] == 8))),
        ],
    )
    _, tracks = tracks_of(mesh, {"low1": "sliding", "low2": second, "top": "moving"})
    node = int(np.argmin(np.linalg.norm(mesh.points - [0.5, 0.0], axis=1)))
    for shift in (-0.2, 0.2):
        moved = tracks.project(mesh.points, np.array([node]), np.array([[shift, 0.1]]))
        np.testing.assert_allclose(moved, [[shift, 0.0]], atol=1e-15)


def test_a_node_without_a_track_stays():
    track = ClosestPoints(np.array([[[0.0, 0.0], [1.0, 0.0]]]))
    tracks = Tracks((track,), np.array([0, -1]), False)
    found = tracks.project(np.zeros((2, 2)), np.array([0, 1]), np.full((2, 2), 0.3))
    np.testing.assert_array_equal(found, [[0.3, 0.0], [0.0, 0.0]])


def test_a_guess_changes_no_distance():
    rng = np.random.default_rng(5)
    corners = rng.normal(size=(40, 3, 3))
    tree = ClosestPoints(corners)
    x = np.concatenate([rng.normal(size=(60, 3)), corners.mean(axis=1)])
    plain = np.linalg.norm(tree.query(x) - x, axis=1)
    for guess in (rng.integers(0, 40, size=100), tree.nearest(x)[1]):
        found = np.linalg.norm(tree.nearest(x, guess)[0] - x, axis=1)
        np.testing.assert_allclose(found, plain, rtol=1e-12, atol=1e-14)


TRIANGLE = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
SEGMENT = np.array([[[0.0, 0], [2, 0]]])


def derivative(corners, x):
    x = np.array([x], float)
    closest, which = ClosestPoints(corners).nearest(x)
    return projection_matrices(corners[which], x, closest)[0]


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        ((0.2, 0.3, 0.4), np.diag([1.0, 1, 0])),
        ((0.2, -0.3, 0.4), np.diag([1.0, 0, 0])),
        ((-0.2, -0.3, 0.4), np.zeros((3, 3))),
        ((0.2, 0.0, 0.4), np.diag([1.0, 1, 0])),
        ((0.2, -1e-9, 0.4), np.diag([1.0, 1, 0])),
    ],
    ids=["facet", "edge", "vertex", "border", "rounding"],
)
def test_a_triangle(x, expected):
    np.testing.assert_allclose(derivative(TRIANGLE, x), expected, atol=1e-15)


@pytest.mark.parametrize(
    ("x", "expected"),
    [((0.5, 0.2), np.diag([1.0, 0])), ((2.5, 0.2), np.zeros((2, 2)))],
    ids=["inside", "end"],
)
def test_a_segment(x, expected):
    np.testing.assert_array_equal(derivative(SEGMENT, x), expected)


def test_a_node_that_slides_along_a_line_of_the_mesh_is_on_a_facet():
    """Two triangles in one plane: on their common edge the boundary is as smooth as elsewhere."""
    quad = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]])
    for s in np.linspace(0.1, 0.9, 7):
        np.testing.assert_allclose(derivative(quad, (s, s, 1e-3)), np.diag([1.0, 1, 0]), atol=1e-15)


def test_near_a_closest_point_the_map_is_affine():
    rng = np.random.default_rng(0)
    corners = rng.random((40, 3, 3))
    track = ClosestPoints(corners)
    x = rng.random((200, 3)) * 2 - 0.5
    closest, which = track.nearest(x)
    matrix = projection_matrices(corners[which], x, closest)
    t = 1e-7 * rng.standard_normal(x.shape)
    moved = track.query(x + t)
    np.testing.assert_allclose(moved - closest, np.einsum("mij,mj->mi", matrix, t), atol=1e-13)
