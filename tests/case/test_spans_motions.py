"""Motions over span in a case: spans kept, sequences, several boundaries, and what is refused."""

import gc
import weakref

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.moving_nodes import displacements
from slideviz.case.spans import span_field
from slideviz.errors import CaseError
from slideviz.machine.blade import ROWS, change_of
from slideviz.mesh.periodic import pair_up
from slideviz.samples.table import sample, sample_case
from slideviz.session.motions import Ghosts
from tests.builders import cut_blade, passage, square
from tests.machine.test_span_field import contoured

TWIST = sv.SpanMotion("blade", "twist", (0.0, 0.5, 1.0), (0.0, 1.0, 5.0))
LEAN = sv.SpanMotion("blade", "lean", (0.0, 1.0), (0.0, 0.02))


def case_of(*motions, **values):
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    return sv.Case(roles=roles, motions=motions, periodic_type="rotational", **values)


@pytest.fixture(scope="module")
def mesh():
    return passage((4, 6, 8))


def vectors(mesh, *motions, **values):
    return displacements(case_of(*motions, **values), mesh).vectors


def test_nodes_keep_their_span_and_the_hub_stays_to_the_bit(mesh):
    moved = displacements(case_of(TWIST, LEAN), mesh)
    before, after = mesh.points[moved.nodes], mesh.points[moved.nodes] + moved.vectors
    radius = np.hypot(*before[:, :2].T)
    assert np.abs(np.hypot(*after[:, :2].T) - radius).max() < 1e-15
    hub = np.abs(radius - 0.5) < 1e-12
    assert hub.any()
    assert not moved.vectors[hub].any()
    assert np.linalg.norm(moved.vectors[~hub], axis=1).max() > 0.02


def test_a_sweep_of_zero_at_the_hub_moves_no_bit_there(mesh):
    swept = sv.SpanMotion("blade", "sweep", (0.0, 1.0), (0.0, 0.02))
    moved = displacements(case_of(swept), mesh)
    hub = np.abs(np.hypot(*mesh.points[moved.nodes][:, :2].T) - 0.5) < 1e-12
    assert not moved.vectors[hub].any()
    assert np.abs(moved.vectors[~hub]).max() > 0.01


@pytest.mark.parametrize("kind", ROWS)
@given(at=st.floats(-1e-15, 1e-15), most=st.floats(1e-3, 3.0))
def test_a_curve_that_begins_without_change_has_none_at_the_wall(kind, at, most):
    # The span of a node on a wall is 0 but for rounding.
    none = 1.0 if kind == "chord" else 0.0
    _, change, _ = change_of(kind, (0.0, 0.5, 1.0), (none, none + most, none), np.array([at, 0.3]))
    assert change[0] == 0.0
    assert change[1] != 0.0


def test_motions_of_one_blade_add_up_in_any_order_and_equal_ones_twice(mesh):
    both = vectors(mesh, TWIST, LEAN)
    assert both == pytest.approx(vectors(mesh, LEAN, TWIST), abs=1e-14)
    assert np.abs(both - vectors(mesh, TWIST) - vectors(mesh, LEAN)).max() > 1e-6
    double = sv.SpanMotion("blade", "twist", TWIST.spans, tuple(2.0 * v for v in TWIST.values))
    assert vectors(mesh, TWIST, TWIST) == pytest.approx(vectors(mesh, double), abs=1e-14)


def test_what_is_computed_for_a_mesh_goes_with_it():
    mesh = passage((4, 6, 8))
    vectors(mesh, TWIST)
    field = weakref.ref(span_field(case_of(TWIST), mesh))
    gc.collect()
    assert field() is not None
    del mesh
    gc.collect()
    assert field() is None


def test_motions_of_other_kinds_come_before_or_after(mesh):
    shift = sv.Translate("blade", (0.0, 0.0, 0.1))
    alone = vectors(mesh, TWIST)
    assert vectors(mesh, shift, TWIST) == pytest.approx(
        alone + np.array([0.0, 0.0, 0.1]), abs=1e-15
    )
    turn = sv.Rotate("blade", 3.0, (0.0, 0.0, 0.0))
    after = vectors(mesh, TWIST, turn)
    assert np.abs(after - alone - vectors(mesh, turn)).max() > 1e-4


def test_ghosts_show_the_same(mesh):
    case = case_of(TWIST, LEAN)
    moved = displacements(case, mesh)
    ghost = Ghosts(mesh).moved(case)["blade"]
    assert np.array_equal(ghost, mesh.points[moved.nodes] + moved.vectors)


def test_a_point_of_the_stacking_line_stays(mesh):
    nodes = mesh.marker("blade").nodes
    place = int(np.argmax(mesh.points[nodes, 2]))
    point = tuple(mesh.points[nodes[place]].tolist())
    twist = sv.SpanMotion("blade", "stagger", (0.0,), (5.0,), point)
    found = vectors(mesh, twist)
    assert np.abs(found[place]).max() < 1e-15
    assert np.linalg.norm(found, axis=1).max() > 0.01
    with pytest.raises(CaseError, match="motion 2 has another stacking point than motion 1"):
        vectors(mesh, twist, LEAN)


def test_two_boundaries_of_one_blade_move_as_one(mesh):
    """A blade of two markers moves as that of one: each facet is on one of them."""
    boundary = mesh.marker("blade").cells
    types, nodes = boundary.types, boundary.connectivity.reshape(-1, 4)
    halves = np.arange(len(nodes)) % 2 == 0
    parts = [
        sv.Marker(name, sv.Cells.from_types(types[some], nodes[some].ravel()))
        for name, some in (("front", halves), ("back", ~halves))
    ]
    others = [marker for marker in mesh.markers if marker.name != "blade"]
    split = sv.Mesh(mesh.points, mesh.cells, (*others, *parts), name="split")
    motion = sv.SpanMotion(("front", "back"), "twist", TWIST.spans, TWIST.values)
    case = case_of(motion)
    roles = {"front": "moving", "back": "moving", "per1": "periodic", "per2": "periodic"}
    moved = displacements(case.change(roles=roles), split).vectors
    assert moved == pytest.approx(vectors(mesh, TWIST), abs=1e-14)
    every = case.change(
        roles=roles, motions=(sv.SpanMotion("", "twist", TWIST.spans, TWIST.values),)
    )
    assert np.array_equal(displacements(every, split).vectors, moved)


def test_what_cannot_be_is_said_before_the_run(mesh):
    flat = square(4)
    case = sv.Case(
        roles={"BLOCK": "moving"}, motions=(sv.SpanMotion("BLOCK", "lean", (0.0,), (1.0,)),)
    )
    assert any("the mesh has none: it is 2D" in text for text in map(str, check_case(case, flat)))
    case = case_of(TWIST, span=("hub", "top"))
    assert any(
        "SPAN: plain 3D has no marker 'top'" in text for text in map(str, check_case(case, mesh))
    )
    case = case_of(TWIST, span=("hub", "per1"))
    assert any("do not face each other" in text for text in map(str, check_case(case, mesh)))


@pytest.mark.parametrize("angle", [5.0, pytest.param(12.0, marks=pytest.mark.slow)])
def test_a_stator_twisted_in_five_steps_folds_no_cell(angle):
    mesh = sample("stator", 5_000).mesh
    roles = {**sample_case("stator").roles, "HUB": "sliding", "SHROUD": "sliding"}
    twist = sv.SpanMotion("BLADE", "twist", (0.0, 1.0), (0.0, angle))
    case = sample_case("stator").change(roles=roles, motions=(twist,), steps=5)
    *_, last = sv.deform(case, mesh)
    found = sv.quality(last.mesh, mesh)
    assert found.inverted == 0
    assert found.min > 0.79
    for name, radius in (("HUB", 0.25), ("SHROUD", 0.3)):
        nodes = mesh.marker(name).nodes
        assert np.abs(np.hypot(*last.mesh.points[nodes, :2].T) - radius).max() < 1e-14


def test_a_blade_of_an_impeller_is_exact_at_each_span_and_folds_no_cell():
    row = sample("impeller", 3000)
    *_, last = sv.deform(row.case, row.mesh)
    field, nodes = span_field(row.case, row.mesh), row.mesh.marker("BLADE").nodes
    before, after = (
        field.span(field.meridional(m.points[nodes]))[0] for m in (row.mesh, last.mesh)
    )
    assert np.abs(after - before).max() < 1e-12
    assert sv.quality(last.mesh, row.mesh).inverted == 0


@pytest.mark.parametrize(("kind", "value"), [("twist", 6.0), ("lean", 0.02), ("chord", 1.2)])
def test_a_blade_that_periodic_sides_cut_moves_as_one(kind, value):
    mesh = cut_blade()
    case = case_of(sv.SpanMotion("blade", kind, (0.0,), (value,)), periodic="moving", sliding="ps")
    moved = displacements(case, mesh)
    shift = np.zeros_like(mesh.points)
    shift[moved.nodes] = moved.vectors
    # What is one node of the blade stays so: leading and trailing edges are at both sides.
    [pair] = pair_up(mesh, ("per1", "per2"), "rotational")
    first, second = pair.nodes[np.isin(pair.nodes, moved.nodes).all(axis=1)].T
    assert len(first) == 10
    turned = (mesh.points + shift)[first] @ pair.matrix(1)[:3, :3].T
    assert turned == pytest.approx((mesh.points + shift)[second], abs=1e-14)
    if kind == "twist":  # of both edges about the middle of the chord, in the plane of m' and theta
        mid = np.isclose(np.hypot(*mesh.points[first][:, :2].T), 0.75)
        z, y = (mesh.points + shift)[first][mid][:, 2], (mesh.points + shift)[first][mid][:, :2]
        theta = np.arctan2(y[:, 1], y[:, 0])
        angle = np.degrees(np.arctan2(np.ptp(theta), np.ptp(z) / 0.75))
        assert angle == pytest.approx(6.0, abs=1e-6)
        assert theta.mean() == pytest.approx(0.0, abs=1e-3)
    *_, last = sv.deform(case.change(steps=2), mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0
    assert last.periodic_misfit < 1e-10


@pytest.mark.parametrize(("kind", "value"), [("twist", 5.0), ("lean", 0.08), ("sweep", 0.03)])
def test_on_contoured_walls_a_blade_moves_over_where_it_stood(kind, value):
    mesh = contoured(passage((6, 12, 8)))
    motion = sv.SpanMotion("blade", kind, (0.0, 1.0), (value, 1.5 * value))
    case = case_of(motion, periodic="moving", sliding="ps", steps=2)
    case = case.change(roles=case.roles | {"hub": "sliding", "shroud": "sliding"})
    field, moved = span_field(case, mesh), displacements(case, mesh)
    assert not field.revolved
    before, after = (
        field.span(field.meridional(points))[0]
        for points in (mesh.points[moved.nodes], mesh.points[moved.nodes] + moved.vectors)
    )
    assert after == pytest.approx(before, abs=1e-12)
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, mesh).min > 0.75
    assert not last.warnings
    hub = field.meridional(last.mesh.points[mesh.marker("hub").nodes])
    assert np.abs(field.span(hub)[0]).max() < 1e-12
