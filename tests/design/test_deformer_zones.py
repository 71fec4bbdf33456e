"""`Deformer` of a mesh with several zones: a run's points, and exact derivatives."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.mesh.zones import zones_of
from tests.builders import zones_in_a_row
from tests.solver.test_interface_motion import MOVE, both, last, pair, roles_of, stage, turn

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


def gap_of(mesh, points):
    """Return the largest distance of nodes of interfaces, which coincide at first."""
    return max(np.abs(points[i.nodes] - points[i.partners]).max() for i in mesh.interfaces)


@settings(max_examples=15, deadline=None)
@given(
    st.integers(2, 3),
    st.sampled_from([(4, 5), (3, 3, 2)]),
    st.floats(-0.06, 0.06),
    st.integers(1, 3),
    st.sampled_from(["ps", "ds"]),
    st.integers(1, 2),
    st.sampled_from(["free", "slide"]),
    st.integers(0, 2**32 - 1),
)
def test_a_zone_follows_what_slides_in_another(
    count, shape, bend, lead, sliding, steps, rims, seed
):
    mesh, random = zones_in_a_row(count, shape, bend), np.random.default_rng(seed)
    lead, dim = min(lead, count), len(shape)
    inner = [f"{k}:x_p" for k in range(1, count)] + [f"{k}:x_m" for k in range(2, count + 1)]
    moving = f"{lead}:y_m"
    case = sv.Case(
        roles={moving: "moving"} | dict.fromkeys(inner, "sliding"),
        motions=(sv.Translate(moving, tuple(random.uniform(-0.03, 0.03, dim))),),
        sliding=sliding,
        steps=steps,
        rims=rims,
    )
    run, deformer = last(case, mesh).mesh.points, sv.Deformer(mesh, case)
    assert not [text for text in deformer.warnings if "has left" not in text]
    assert np.abs(deformer.as_run() - run).max() < 1e-15
    assert np.abs(deformer.deform() - run).max() < 1e-12
    assert np.abs((run - mesh.points)[mesh.interfaces[0].nodes]).max() > 1e-7
    design = deformer.displacement * random.uniform(0.5, 1.0)
    direction, weights = random.normal(size=design.shape), random.normal(size=mesh.points.shape)
    assert gap_of(mesh, deformer.deform(design)) < 1e-12
    slope, back = deformer.jvp(design, direction), deformer.vjp(design, weights)
    assert (back * direction).sum() == pytest.approx((weights * slope).sum(), abs=1e-11)
    plus, minus = (deformer.deform(design + sign * STEP * direction) for sign in (1, -1))
    assert np.abs((plus - minus) / (2 * STEP) - slope).max() < 1e-6
    assert gap_of(mesh, slope) < 1e-12


@pytest.mark.parametrize("first", [0.0, 1.0])
def test_zones_follow_in_all_designs(first):
    mesh = zones_in_a_row(3, (4, 5))
    inner = {"1:x_p": "sliding", "2:x_p": "sliding"}
    case = sv.Case(
        roles={"1:y_m": "moving"} | inner,
        motions=(sv.Translate("1:y_m", (0.0, 0.02)),),
        sliding="ps",
    )
    asked = sv.Deformer(mesh, case).displacement
    several = np.stack([first * asked, -0.5 * asked])
    deformer = sv.Deformer(mesh, case, several if first else several[0])
    points = deformer.deform(several)
    assert max(gap_of(mesh, each) for each in points) < 1e-12
    assert np.abs((points - mesh.points)[1, mesh.marker("3:x_m").nodes]).max() > 1e-7
    errors = deformer.max_error(several)
    assert errors[1] == pytest.approx(deformer.max_error(several[1]), abs=1e-14)
