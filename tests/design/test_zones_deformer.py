"""`Deformer` of a mesh with several zones: a run's points, and exact derivatives."""

import pickle

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.zones import zones_of
from tests.solver.test_zones import MOVE, both, last, pair, roles_of, stage, turn

STEP = 1e-6


def test_each_zone_is_that_of_its_deformer(tmp_path):
    path = stage(tmp_path)
    mesh = sv.read(path)
    deformer = sv.Deformer(mesh, both())
    found = zones_of(mesh.with_points(deformer.deform()))
    assert np.allclose(deformer.deform(), deformer.as_run(), atol=1e-14)
    assert np.array_equal(deformer.as_run(), last(both(), mesh).mesh.points)
    for number in (1, 2):
        case = both().change(roles=roles_of(""), motions=(turn(""),))
        alone = sv.Deformer(sv.read(path, number), case)
        assert np.array_equal(found[number - 1].points, alone.deform())
    several = np.stack([deformer.displacement, 0.5 * deformer.displacement])
    assert np.allclose(deformer.deform(several)[0], deformer.deform(), atol=1e-14)
    assert deformer.max_error(several).shape == (2,)


@pytest.mark.parametrize("name", ["stage", "pair"])
def test_derivatives_are_exact(tmp_path, name):
    if name == "stage":
        mesh, case = sv.read(stage(tmp_path)), both()
    else:
        mesh = pair(tmp_path)
        case = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Translate("BLOCK", MOVE),))
    deformer = pickle.loads(pickle.dumps(sv.Deformer(mesh, case)))
    assert deformer.warnings == ()
    random = np.random.default_rng(3)
    design, weights = deformer.displacement, random.normal(size=mesh.points.shape)
    # Periodic images must move alike, so the direction is that of a motion.
    direction = design * 0.7
    slope = deformer.jvp(design, direction)
    plus, minus = (deformer.deform(design + sign * STEP * direction) for sign in (1, -1))
    assert np.abs((plus - minus) / (2 * STEP) - slope).max() < 1e-7
    back = deformer.vjp(design, weights)
    assert abs((back * direction).sum() - (weights * slope).sum()) < 1e-12
    least = deformer.constraint("margin")
    ahead, behind = (
        deformer.constraint("margin", design + sign * STEP * direction).value for sign in (1, -1)
    )
    assert least.jvp(direction) == pytest.approx((ahead - behind) / (2 * STEP), rel=1e-4)


def test_what_follows_moves_by_the_rows_of_the_other_zone(tmp_path):
    mesh = pair(tmp_path)
    case = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Translate("BLOCK", MOVE),))
    deformer = sv.Deformer(mesh, case)
    assert np.array_equal(deformer.nodes, mesh.marker("BLOCK").nodes)
    points = deformer.deform()
    moved = points[mesh.marker("core").nodes] - mesh.points[mesh.marker("core").nodes]
    np.testing.assert_allclose(moved, np.tile(MOVE, (8, 1)), atol=1e-14)
