"""Distances, angles and radii between picked points, which move with the mesh."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality
from slideviz.session import changes
from slideviz.session.inspect import nodes_of, triangles
from slideviz.session.measure import (
    HINT,
    Pick,
    add_pick,
    drop_pick,
    measure,
    measure_words,
    toggle_measure,
)
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from slideviz.session.store import Store
from tests.builders import cube, pair, square


def opened(mesh: Mesh):
    return open_mesh(StepFrame(mesh, quality(mesh)), None)


def picked(session, points):
    """A session whose first nodes are at points, which are picked."""
    places = session.mesh.points.copy()
    places[: len(points)] = points
    moved = session.mesh.with_points(places)
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(moved, session.first.quality)]
    )
    for node in range(len(points)):
        session = add_pick(session, Pick((node,)))
    return session


PLANE = opened(square(4))
SPACE = opened(cube(3))


@given(seed=st.integers(0, 1000), session=st.sampled_from([PLANE, SPACE]))
def test_a_place_in_a_cell_is_that_place_and_goes_with_every_linear_motion(seed, session):
    rng = np.random.default_rng(seed)
    mesh = session.mesh
    nodes = nodes_of(mesh, int(rng.integers(len(mesh.cells))))
    share = rng.dirichlet(np.ones(len(nodes)))
    place = share @ mesh.points[nodes]
    picked_place = Pick.between(mesh, nodes, place)
    np.testing.assert_allclose(picked_place.place(mesh), place, atol=1e-12 * mesh.extent)
    matrix, shift = rng.normal(size=(mesh.dim, mesh.dim)), rng.normal(size=mesh.dim)
    moved = mesh.with_points(mesh.points @ matrix.T + shift)
    np.testing.assert_allclose(
        picked_place.place(moved), matrix @ place + shift, atol=1e-10 * moved.extent
    )


@given(st.lists(st.tuples(*3 * [st.floats(-10, 10)]), min_size=3, max_size=3, unique=True))
def test_numbers_are_those_of_plane_geometry(points):
    a, b, c = np.array(points)
    found = measure(picked(SPACE, [a, b]))
    assert float(found.label) == pytest.approx(np.linalg.norm(b - a), rel=1e-5, abs=1e-8)
    found = measure(picked(SPACE, [a, b, c]))
    angle, radius = found.label.replace("r =", "").split("°,")
    cosine = (a - b) @ (c - b) / np.linalg.norm(a - b) / np.linalg.norm(c - b)
    exact = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    assert float(angle) == pytest.approx(exact, rel=1e-3, abs=1e-3)
    if 1.0 < exact < 179.0:  # the law of sines
        wanted = np.linalg.norm(c - a) / (2.0 * np.sin(np.radians(exact)))
        assert float(radius) == pytest.approx(wanted, rel=1e-2)


def test_three_points_on_a_line_have_no_circle():
    found = measure(picked(PLANE, [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)]))
    assert found.label == "180°, r = inf"
    found = measure(picked(PLANE, [(3.0, 0.0), (0.0, 0.0), (0.0, 4.0)]))
    assert found.words == "Angle 90°, radius 2.5, sides 3, 4, 5"
    assert measure(picked(PLANE, [(1.0, 1.0)] * 3)).label.endswith("°, r = inf")


def test_in_a_machine_two_points_differ_by_radius_and_angle_too():
    session = picked(SPACE, [(-1.0, 0.1, 0.0), (-2.0, -0.2, 0.5)])
    assert measure_words(session).endswith(": Δx -1, Δy -0.3, Δz 0.5")
    first, second, *_ = session.mesh.marker_names
    turn = replace(pair("rotational", 3, angle=0.5), first=first, second=second)
    roles = dict.fromkeys((first, second), "periodic")
    session = replace(session, pairs=(turn,), case=session.case.change(roles=roles))
    # The angle is across the cut at 180 degrees, and the shorter way round.
    a, b = np.degrees(np.arctan2((0.1, -0.2), (-1.0, -2.0)))
    wanted = (b - a) % 360.0
    outwards = np.hypot(2.0, 0.2) - np.hypot(1.0, 0.1)
    assert measure_words(session).endswith(f", Δr {outwards:.6g}, Δθ {wanted:.6g}°")


def test_a_point_alone_is_measured_from_the_nearest_other_boundary():
    session = PLANE
    mesh = session.mesh
    corner = int(np.argmin(mesh.points.sum(axis=1)))
    low = mesh.points[corner]
    near = np.flatnonzero(np.isclose(mesh.points, low).any(axis=1))
    side = next(int(n) for n in near if n != corner and mesh.points[n, 0] == low[0])
    found = measure(add_pick(session, Pick((side,))))
    far = mesh.points[side, 1] - low[1]
    assert found.words.startswith(f"Node {side} at (")
    assert f"{far:.6g} from " in found.words
    assert found.words.endswith(", the nearest other boundary")
    np.testing.assert_allclose(np.linalg.norm(np.diff(found.points, axis=0)), far)
    on = {marker.name for marker in mesh.markers if side in marker.nodes}
    assert not any(f"from {name}," in found.words for name in on)


def test_of_two_boundaries_the_nearest_points_are_picked():
    for made in (PLANE, SPACE):
        rng = np.random.default_rng(3)
        mesh = made.mesh
        shake = 0.05 * mesh.extent * rng.uniform(-1, 1, mesh.points.shape)
        moved = mesh.with_points(mesh.points + shake)
        session = opened(moved)
        names = moved.marker_names
        middle = [moved.points[marker.nodes].mean(axis=0) for marker in moved.markers]
        opposite = int(np.argmax([np.linalg.norm(each - middle[0]) for each in middle]))
        session = changes.select(session, (names[0], names[opposite]))
        session = toggle_measure(session)
        found = measure(session)
        one, other = moved.markers[0], moved.markers[opposite]
        wanted = np.inf  # of fine points on both
        for ends, beside in ((one, other), (other, one)):
            corners = moved.points[triangles(beside.cells)]
            grid = [(a, b) for a in np.linspace(0, 1, 41) for b in np.linspace(0, 1 - a, 41)]
            for a, b in grid:
                place = corners[:, 0] + a * (corners[:, 1] - corners[:, 0])
                place = place + b * (corners[:, 2] - corners[:, 0])
                gaps = place[:, None] - moved.points[ends.nodes]
                wanted = min(wanted, float(np.linalg.norm(gaps, axis=2).min()))
        assert float(found.label) == pytest.approx(wanted, rel=5e-3)
        assert session.view.handle == ""


def test_points_are_added_taken_back_and_left_alone_by_undo():
    store = Store(PLANE)
    assert measure_words(store.session) == ""
    store.change(toggle_measure)
    assert store.session.view.picks == ()
    assert measure_words(store.session) == HINT
    for node in (5, 6, 7):
        store.change(add_pick, Pick((node,)))
    store.change(changes.set_view, passages=0, edges=False)
    store.undo()
    assert "edges" in store.session.view.drawn
    assert [pick.nodes for pick in store.session.view.picks] == [(5,), (6,), (7,)]
    store.change(add_pick, Pick((8,)))
    assert [pick.nodes for pick in store.session.view.picks] == [(8,)]
    for wanted in ((), None):
        store.change(drop_pick)
        assert store.session.view.picks == wanted
    store.change(add_pick, Pick((8,)))
    store.change(toggle_measure)
    assert store.session.view.picks is None


def test_the_numbers_are_those_of_the_step_that_is_shown_and_of_the_other_view():
    session = picked(PLANE, [(0.0, 0.0), (3.0, 4.0)])
    assert measure(session).label == "5"
    first, second = PLANE.mesh.points[:2]
    before = measure(changes.show_frame(session, 0))
    assert float(before.label) == pytest.approx(np.linalg.norm(second - first), rel=1e-5)
    both = changes.show_beside(session, changes.UNDEFORMED)
    assert measure_words(both).endswith(f"; in the other view {before.label}")
