"""Laws that every deformation obeys, whatever the method, the mesh and the numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.mesh.axis_frame import axis_basis
from slideviz.rbf import evaluate as sums
from tests import builders

METHODS = [
    (sliding, periodic)
    for sliding in ("none", "ps", "ds")
    for periodic in ("none", "periodic", "fixed", "moving")
    if (sliding, periodic) != ("none", "moving")
]
# A slide of less than 1e-8 of the distance to the boundary is rounding.
SMALL = st.floats(-0.08, 0.08).map(lambda value: round(value, 6))
QUIET = settings(max_examples=12, deadline=None)


def box(dim, kind="plain"):
    return builders.square(6, kind) if dim == 2 else builders.cube(4, kind)


def box_case(mesh, method, motions, **settings):
    roles = dict.fromkeys(mesh.marker_names, "sliding")
    roles |= {"y_m": "periodic", "y_p": "periodic", "BLOCK": "moving"}
    return Case(
        roles=roles,
        motions=motions,
        sliding=method[0],
        periodic=method[1],
        periodic_type="translational",
        **settings,
    )


def sector(dim):
    return builders.sector(6) if dim == 2 else builders.passage((3, 4, 4))


def sector_case(mesh, method, motions, **settings):
    roles = dict.fromkeys(mesh.marker_names, "sliding")
    moving = "BLOCK" if mesh.dim == 2 else "blade"
    roles |= {"per1": "periodic", "per2": "periodic", moving: "moving"}
    return Case(
        roles=roles,
        motions=motions,
        sliding=method[0],
        periodic=method[1],
        periodic_type="rotational",
        **settings,
    )


def last_points(case, mesh):
    *_, last = sv.deform(case, mesh)
    return last.mesh.points


def shift_of(mesh, numbers, marker="BLOCK"):
    return (Translate(marker, tuple(numbers[: mesh.dim])),)


@QUIET
@given(
    method=st.sampled_from(list(METHODS)),
    shift=st.tuples(SMALL, SMALL, SMALL),
    steps=st.integers(1, 3),
    case=st.sampled_from([(2, "plain"), (2, "mixed"), (3, "plain")]),
)
def test_known_nodes_are_where_they_must_be(method, shift, steps, case):
    mesh = box(*case)
    settings_ = box_case(mesh, method, shift_of(mesh, shift), steps=steps)
    for step in sv.deform(settings_, mesh):
        block = mesh.marker("BLOCK").nodes
        goal = mesh.points[block] + np.array(shift[: mesh.dim]) * (step.index / steps)
        np.testing.assert_allclose(step.mesh.points[block], goal, rtol=0, atol=1e-15)
        assert step.max_error < 1e-10


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("frame", ["translational", "rotational", "cartesian"])
def test_a_zero_displacement_changes_no_bit(frame, dim, method):
    if frame == "rotational":
        mesh, marker = sector(dim), "BLOCK" if dim == 2 else "blade"
        case = sector_case(mesh, method, shift_of(mesh, (0.0,) * 3, marker), steps=2)
    else:
        mesh = box(dim)
        if frame == "cartesian":
            method = (method[0], "none")
        case = box_case(mesh, method, shift_of(mesh, (0.0,) * 3), steps=2)
    mesh = mesh.with_points(np.where(mesh.points == 0, -0.0, mesh.points))
    for step in sv.deform(case, mesh):
        assert step.mesh.points.tobytes() == mesh.points.tobytes()


@QUIET
@given(
    method=st.sampled_from(list(METHODS)),
    dim=st.sampled_from([2, 3]),
    a=st.tuples(SMALL, SMALL, SMALL),
    b=st.tuples(SMALL, SMALL, SMALL),
    k=st.floats(-1.5, 1.5),
)
def test_one_step_is_linear_in_the_displacement_when_boundaries_are_flat(method, dim, a, b, k):
    mesh = box(dim)

    def displacement(v):
        return last_points(box_case(mesh, method, shift_of(mesh, v)), mesh) - mesh.points

    together = displacement(tuple(np.array(a) + k * np.array(b)))
    np.testing.assert_allclose(together, displacement(a) + k * displacement(b), rtol=0, atol=1e-11)


@QUIET
@given(
    method=st.sampled_from(list(METHODS)),
    seed=st.integers(0, 99),
    kind=st.sampled_from(["square", "mixed", "cube", "sector", "passage"]),
)
def test_renumbering_the_nodes_renumbers_the_result(method, seed, kind):
    mesh = {
        "square": lambda: box(2),
        "mixed": lambda: box(2, "mixed"),
        "cube": lambda: box(3),
        "sector": lambda: sector(2),
        "passage": lambda: sector(3),
    }[kind]()
    moving = "blade" if kind == "passage" else "BLOCK"
    build = sector_case if kind in ("sector", "passage") else box_case
    case = build(mesh, method, shift_of(mesh, (0.02, 0.03, 0.01), moving), steps=2)
    order = np.random.default_rng(seed).permutation(len(mesh.points))
    found = last_points(case, builders.permuted(mesh, order))
    np.testing.assert_allclose(found, last_points(case, mesh)[order], rtol=0, atol=2e-11)


@pytest.mark.parametrize("method", METHODS)
def test_chunk_size_changes_no_bit(method, monkeypatch):
    mesh = box(3)
    case = box_case(mesh, method, shift_of(mesh, (0.05, -0.04, 0.03)))
    whole = last_points(case, mesh)
    monkeypatch.setattr(sums, "CHUNK", 997)
    assert last_points(case, mesh).tobytes() == whole.tobytes()


def test_thread_count_changes_nothing():
    import numba

    mesh = box(3)
    case = box_case(mesh, ("ds", "moving"), shift_of(mesh, (0.05, -0.04, 0.03)))
    before = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = last_points(case, mesh)
    finally:
        numba.set_num_threads(before)
    np.testing.assert_allclose(last_points(case, mesh), alone, rtol=0, atol=1e-12)


@QUIET
@given(
    method=st.sampled_from(list(METHODS)),
    dim=st.sampled_from([2, 3]),
    seed=st.integers(0, 99),
    scale=st.sampled_from([1e-3, 1.0, 40.0]),
)
def test_the_result_moves_turns_mirrors_and_scales_with_the_problem(method, dim, seed, scale):
    rng = np.random.default_rng(seed)
    mesh = box(dim)
    q, _ = np.linalg.qr(rng.normal(size=(dim, dim)))
    offset = rng.normal(size=dim) * scale

    def there(x):
        return scale * x @ q.T + offset

    shift = np.array([0.05, -0.04, 0.03])[:dim]
    case = box_case(mesh, method, shift_of(mesh, shift), steps=2)
    # The support radius follows the extent over the axes, which a turn changes: keep R.
    other = mesh.with_points(there(mesh.points))
    factor = 2.5 * scale * mesh.extent / other.extent
    moved = box_case(
        other, method, shift_of(other, scale * q @ shift), steps=2, influence_factor=factor
    )
    np.testing.assert_allclose(
        last_points(moved, other), there(last_points(case, mesh)), rtol=0, atol=2e-10 * scale
    )


@QUIET
@given(method=st.sampled_from(list(METHODS)), seed=st.integers(0, 99))
def test_rotational_periodicity_about_any_axis_through_any_point(method, seed):
    rng = np.random.default_rng(seed)
    axis, origin = rng.normal(size=3), rng.normal(size=3)
    basis = axis_basis(axis)
    mesh = sector(3)
    other = mesh.with_points(mesh.points @ basis + origin)
    shift = np.array([0.02, 0.03, -0.02])
    case = sector_case(mesh, method, (Translate("blade", tuple(shift)),), steps=2)
    moved = sector_case(
        other,
        method,
        (Translate("blade", tuple(shift @ basis)),),
        steps=2,
        axis=tuple(axis),
        origin=tuple(origin),
        influence_factor=2.5 * mesh.extent / other.extent,
    )
    expected = last_points(case, mesh) @ basis + origin
    np.testing.assert_allclose(last_points(moved, other), expected, rtol=0, atol=2e-10)


@QUIET
@given(method=st.sampled_from(list(METHODS)), seed=st.integers(0, 9), angle=st.floats(-170, 170))
def test_a_sector_anywhere_around_its_axis(method, seed, angle):
    """The result does not care where theta is counted from, nor about the cut of arctan2."""
    here, there = builders.sector(6), builders.sector(6, start_deg=angle)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, s], [-s, c]])
    shift = np.array([0.03, 0.02])
    case = sector_case(here, method, shift_of(here, shift), steps=2)
    moved = sector_case(
        there,
        method,
        shift_of(there, shift @ turn),
        steps=2,
        influence_factor=2.5 * here.extent / there.extent,
    )
    np.testing.assert_allclose(
        last_points(moved, there), last_points(case, here) @ turn, rtol=0, atol=2e-10
    )


@QUIET
@given(
    periodic=st.sampled_from(["fixed", "moving"]),
    sliding=st.sampled_from(["ps", "ds"]),
    dim=st.sampled_from([2, 3]),
    shift=st.tuples(SMALL, SMALL, SMALL),
)
def test_periodic_images_stay_images(periodic, sliding, dim, shift):
    mesh = box(dim)
    points = last_points(box_case(mesh, (sliding, periodic), shift_of(mesh, shift), steps=2), mesh)
    low, high = mesh.marker("y_m").nodes, mesh.marker("y_p").nodes
    # Both are in the order of the grid.
    np.testing.assert_allclose(
        points[high] - points[low], np.tile(np.eye(dim)[1], (len(low), 1)), atol=1e-14
    )


@QUIET
@given(
    sliding=st.sampled_from(["ps", "ds"]),
    periodic=st.sampled_from(["none", "periodic"]),
    dim=st.sampled_from([2, 3]),
    shift=st.tuples(SMALL, SMALL, SMALL),
    steps=st.integers(1, 3),
)
def test_sliding_nodes_never_leave_their_plane(sliding, periodic, dim, shift, steps):
    mesh = box(dim)
    case = box_case(mesh, (sliding, periodic), shift_of(mesh, shift), steps=steps)
    points = last_points(case, mesh)
    for axis in range(dim):
        for letter, value in (("m", 0.0), ("p", 1.0)):
            nodes = mesh.marker(f"{'xyz'[axis]}_{letter}").nodes
            np.testing.assert_array_equal(points[nodes, axis], value)
            assert points[nodes].min() >= 0.0
            assert points[nodes].max() <= 1.0


@QUIET
@given(turns=st.sampled_from([1, 2, 4]), method=st.sampled_from(["none", "ps", "ds"]))
def test_more_steps_end_at_the_same_boundary(turns, method):
    mesh = box(2)
    case = box_case(mesh, (method, "none"), (Rotate("BLOCK", 30.0),), steps=turns)
    block = mesh.marker("BLOCK").nodes
    found = last_points(case, mesh)[block]
    np.testing.assert_allclose(found, last_points(case.change(steps=1), mesh)[block], atol=1e-15)
