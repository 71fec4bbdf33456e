"""Inverse distance weighting against the literal sums, and the laws it must keep."""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.baselines.idw import weighted_means
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.errors import Cancelled, DeformError
from slideviz.rbf import evaluate
from slideviz.rbf.evaluate import Basis
from slideviz.rbf.frames import make_frame
from tests import builders
from tests.oracles import radial, weighting

SIDES = ("x_m", "x_p", "y_m", "y_p", "z_m", "z_p")


def cloud(n, dim, seed=0):
    return np.random.default_rng(seed).uniform(0.1, 0.9, (n, dim))


def box_case(dim, sliding="ps", periodic=None, **settings):
    sides = SIDES[: 2 * dim]
    roles = dict.fromkeys(sides, "sliding")
    if periodic is not None:
        roles |= dict.fromkeys(("y_m", "y_p"), "periodic")
    shift = (0.06, -0.05, 0.04)[:dim]
    return Case(
        roles=roles | {"BLOCK": "moving"},
        motions=(Rotate("BLOCK", 10.0), Translate("BLOCK", shift)),
        method="idw",
        sliding=sliding,
        periodic=periodic or "none",
        periodic_type="translational",
        **settings,
    )


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


@pytest.mark.parametrize("power", [2.0, 3.0, 2.7])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_compiled_means_are_the_literal_ones(dim, power):
    targets, sources = cloud(30, dim), cloud(20, dim, 1)
    values = np.random.default_rng(2).normal(size=(20, dim))
    weights = np.random.default_rng(3).uniform(0.5, 4.0, 20)
    found = weighted_means(Basis(2.5), targets.T, sources.T, values, weights, power=power)
    wanted = weighting.means(targets, sources, values, power, weights)
    np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kind", ["translational", "rotational"])
def test_periodic_distances_are_those_of_the_frame(dim, kind):
    period = np.radians(40.0)
    where = {"vector": (0.0, 1.3, 0.0)} if kind == "translational" else {"angle": period}
    pair = builders.pair(kind, dim, **where)
    targets, sources = cloud(20, dim), cloud(15, dim, 1)
    frame, _ = make_frame(np.concatenate([targets, sources]), [pair], periodic_distance=True)
    values, ones = np.random.default_rng(2).normal(size=(15, dim)), np.ones(15)
    features = [frame.features(frame.coords(p)) for p in (targets, sources)]
    basis = Basis(2.5, frame.period if frame.cylindrical else 0.0)
    found = weighted_means(basis, *features, values, ones, power=3.0)
    if kind == "translational":
        wanted = weighting.means(
            targets, sources, values, 3.0, distance=radial.translational(1.3, 1)
        )
    else:
        polar = [frame.coords(p) / ([1.0, frame.radius, 1.0][:dim]) for p in (targets, sources)]
        wanted = weighting.means(*polar, values, 3.0, distance=radial.rotational(period))
    np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-13)


def test_a_source_has_its_value_even_beside_a_near_one():
    sources = np.array([[0.5, 0.5], [0.5 + 1e-7, 0.5], [0.9, 0.1]])
    values = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    found = weighted_means(Basis(1.0), sources.T, sources.T, values, np.ones(3), power=2.0)
    np.testing.assert_allclose(found, values, rtol=1e-9)


def test_chunks_and_progress_do_not_change_the_result(monkeypatch):
    targets, sources = cloud(101, 3), cloud(7, 3, 1)
    data = np.random.default_rng(2).normal(size=(7, 3)), np.ones(7)
    heard = []
    whole = weighted_means(Basis(1.0), targets.T, sources.T, *data, power=3.0)
    monkeypatch.setattr(evaluate, "CHUNK", 70)
    parts = weighted_means(Basis(1.0), targets.T, sources.T, *data, power=3.0, tick=heard.append)
    np.testing.assert_array_equal(whole, parts)
    assert heard == sorted(heard)
    assert len(heard) == 11
    assert heard[-1] == 1.0


@pytest.mark.parametrize("kind", ["plain", "simplex", "mixed"])
@pytest.mark.parametrize("dim", [2, 3])
def test_known_nodes_are_exact_and_the_rest_between_the_extremes(dim, kind):
    mesh = builders.square(8, kind) if dim == 2 else builders.cube(6, kind)
    case = Case(
        roles={"BLOCK": "moving"},
        motions=(Translate("BLOCK", (0.05, 0.02, -0.03)[:dim]),),
        method="idw",
    )
    step = last(case, mesh)
    moved = step.mesh.points - mesh.points
    block = mesh.marker("BLOCK").nodes
    np.testing.assert_allclose(moved[block], [(0.05, 0.02, -0.03)[:dim]] * len(block), atol=1e-15)
    outer = np.unique(np.concatenate([mesh.marker(name).nodes for name in SIDES[: 2 * dim]]))
    np.testing.assert_array_equal(step.mesh.points[outer], mesh.points[outer])
    inner = np.setdiff1d(np.arange(len(mesh.points)), np.r_[block, outer])
    assert np.all(moved[inner, 0] > 0)
    assert np.all(moved[inner, 0] < 0.05)
    assert step.control_nodes == len(block) + len(outer)
    assert step.max_error < 1e-12


def test_a_step_is_the_literal_mean_with_the_published_power():
    for mesh, power in ((builders.square(6), 2.0), (builders.cube(4), 3.0)):
        dim = mesh.dim
        case = Case(
            roles={"BLOCK": "moving"},
            motions=(Rotate("BLOCK", 10.0),),
            method="idw",
            idw_fixed_weight=2.5,
        )
        moved = last(case, mesh).mesh.points - mesh.points
        known = np.unique(np.concatenate([m.nodes for m in mesh.markers]))
        still = np.all(moved[known] == 0, axis=1)
        wanted = weighting.means(
            mesh.points, mesh.points[known], moved[known], power, np.where(still, 2.5, 1.0)
        )
        np.testing.assert_allclose(moved, wanted, atol=1e-13)
        other = last(case.change(idw_power=4.5), mesh).mesh.points - mesh.points
        wanted = weighting.means(
            mesh.points, mesh.points[known], moved[known], 4.5, np.where(still, 2.5, 1.0)
        )
        np.testing.assert_allclose(other, wanted, atol=1e-13)
        assert other.shape[1] == dim


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_sliding_nodes_stay_in_their_planes_and_do_slide(sliding):
    mesh = builders.cube(4)
    step = last(box_case(3, sliding), mesh)
    for axis, (low, high) in enumerate((SIDES[:2], SIDES[2:4], SIDES[4:])):
        for name, place in ((low, 0.0), (high, 1.0)):
            nodes = mesh.marker(name).nodes
            assert np.all(step.mesh.points[nodes, axis] == place)
            assert np.abs(step.mesh.points[nodes] - mesh.points[nodes]).max() > 1e-3
    assert any("acts like pseudo sliding" in text for text in step.warnings) == (sliding == "ds")


def test_nodes_slide_around_a_curved_far_field_and_keep_their_radius():
    mesh = builders.annulus()
    case = Case(
        roles={"wall": "moving", "far0": "sliding"},
        motions=(Rotate("wall", 20.0),),
        method="idw",
        sliding="ps",
        feature_angle_deg=60.0,
    )
    moved = last(case, mesh).mesh.points
    far = mesh.marker("far0").nodes
    # The far field is a polygon of 24 sides: nodes stay on its sides.
    assert np.all(np.hypot(*moved[far].T) <= 2.0 + 1e-12)
    assert np.all(np.hypot(*moved[far].T) >= 2.0 * np.cos(np.pi / 24) - 1e-12)
    assert np.abs(moved[far] - mesh.points[far]).max() > 1e-2


@pytest.mark.parametrize("periodic", ["periodic", "fixed", "moving"])
@pytest.mark.parametrize("dim", [2, 3])
def test_images_of_a_translation_move_alike(dim, periodic):
    mesh = builders.square(8) if dim == 2 else builders.cube(4)
    moved = last(box_case(dim, "ps", periodic), mesh).mesh.points - mesh.points
    low = mesh.marker("y_m").nodes
    high = [
        int(np.argmin(np.abs(mesh.points - p - np.eye(dim)[1]).sum(axis=1)))
        for p in mesh.points[low]
    ]
    np.testing.assert_allclose(moved[low], moved[high], atol=1e-13)
    assert np.abs(moved[low]).max() > 1e-3


def test_images_of_a_rotation_move_alike():
    mesh = builders.sector()
    roles = dict.fromkeys(mesh.marker_names, "sliding")
    roles |= {"BLOCK": "moving", "per1": "periodic", "per2": "periodic"}
    case = Case(
        roles=roles,
        motions=(Rotate("BLOCK", 15.0),),
        method="idw",
        sliding="ps",
        periodic="moving",
        periodic_type="rotational",
    )
    moved = last(case, mesh).mesh.points
    first, second = mesh.marker("per1").nodes, mesh.marker("per2").nodes
    order = [np.argsort(np.hypot(*mesh.points[nodes].T)) for nodes in (first, second)]
    first, second = first[order[0]], second[order[1]]
    angle = np.radians(30.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    np.testing.assert_allclose(moved[second], moved[first] @ turn.T, atol=1e-12)
    assert np.abs(moved[first] - mesh.points[first]).max() > 1e-3


def test_images_that_are_asked_to_move_differently_are_an_error():
    mesh = builders.grid(
        (4, 4), rules=[("all", lambda p: bool(np.all(p[:, 1] == 0))), *builders.box_rules((4, 4))]
    )
    case = Case(
        roles={"all": "periodic", "y_p": "periodic", "x_m": "moving", "x_p": "fixed"},
        motions=(Rotate("x_m", 5.0, (0.0, 0.0)),),
        method="idw",
        periodic="fixed",
        periodic_type="translational",
    )
    with pytest.raises(DeformError, match="asked to move differently"):
        last(case, mesh)


def test_a_callback_that_raises_ends_the_run():
    mesh = builders.cube(4)
    heard = []

    def cancel(progress):
        heard.append(progress)
        if progress.phase == "evaluate":
            raise Cancelled("enough")

    with pytest.raises(Cancelled, match="enough"):
        list(sv.deform(box_case(3), mesh, cancel))
    assert heard[-1].phase == "evaluate"
    assert last(box_case(3), mesh).index == 1
