"""Live fields: the mesh of any motion of a kind, as the run would give it, without solving."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.motions.airfoil import HicksHenne
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.moving_nodes import moving_nodes
from slideviz.design import live_fields
from slideviz.design.live_fields import LiveFields, displacements_of, independent
from slideviz.errors import Cancelled, DeformError
from slideviz.rbf.reduction import Reduction
from slideviz.solver.deform import deform
from tests import builders
from tests.design.test_deformer import made


def run(case, mesh):
    return list(deform(case, mesh))[-1].mesh.points


def fields_of(case, mesh):
    return LiveFields.of(case, mesh, lambda _: None)


def off(points, case, mesh):
    """Largest distance of points from those of the run, over the largest displacement."""
    largest = np.linalg.norm(moving_nodes(case, mesh).vectors, axis=1).max()
    return np.linalg.norm(points - run(case, mesh), axis=1).max() / largest


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    "motions",
    [
        lambda d: (Translate("BLOCK", (0.01, 0.02, -0.01)[:d]),),
        lambda d: (Rotate("BLOCK", 5.0),),
        lambda d: (Scale("BLOCK", (1.1,)), Rotate("BLOCK", -4.0), Translate("BLOCK", (0.02,) * d)),
    ],
)
def test_every_affine_motion_is_that_of_the_run(dim, motions):
    mesh = builders.square(9) if dim == 2 else builders.cube(6)
    case = Case(roles={"BLOCK": "moving"}, motions=motions(dim), steps=1)
    fields = fields_of(case.change(motions=tuple(one_at_rest(one) for one in case.motions)), mesh)
    assert len(fields.fields) == dim * dim + dim
    assert off(fields.moved(case), case, mesh) < 1e-9


def one_at_rest(motion):
    """The motion with numbers that move nothing."""
    still = {}
    for field, value, at_rest in motion.amounts():
        still[field] = (at_rest,) * len(value) if isinstance(value, tuple) else at_rest
    return replace(motion, **still)


@pytest.mark.parametrize("kind", ["flat", "curved", "rotational"])
@pytest.mark.parametrize("reduction", [None, Reduction(tolerance=1e-4)])
def test_near_to_the_run_where_nodes_slide(kind, reduction):
    mesh, case = made(kind, steps=1, reduction=reduction)
    if kind == "curved":
        mesh = builders.annulus(96, 5, 2)  # at the corners of a coarse polygon nothing is linear
    still = case.change(motions=tuple(one_at_rest(one) for one in case.motions))
    assert off(fields_of(still, mesh).moved(case), case, mesh) < 0.06


def test_sliding_nodes_stay_on_a_curved_wall():
    mesh, case = made("curved", steps=1)
    fields = fields_of(case, mesh)
    moved = fields.moved(case)
    far = np.concatenate([mesh.marker(name).nodes for name in ("far0", "far1")])
    [(_, setup, _)] = fields.walls
    on = np.intersect1d(far, setup.classes.sliding)
    assert len(on)
    for index in np.unique(setup.tracks.of_node[on]):
        rows = on[setup.tracks.of_node[on] == index]
        assert (
            np.abs(setup.tracks.tracks[index].nearest(moved[rows])[0] - moved[rows]).max() < 1e-12
        )


def test_each_number_of_another_motion_has_a_field():
    mesh = builders.airfoil()
    bumps = HicksHenne("airfoil", 0.01, 0.3), HicksHenne("airfoil", 0.0, side="lower")
    case = Case(roles={"airfoil": "moving"}, motions=bumps, steps=1)
    fields = fields_of(case, mesh)
    assert len(fields.fields) == 2
    changed = case.change(
        motions=(replace(bumps[0], height=0.005), replace(bumps[1], height=-0.01))
    )
    assert off(fields.moved(changed), changed, mesh) < 1e-7


def test_bodies_have_fields_each():
    mesh = builders.far_field(bodies=2)
    names = [name for name in mesh.marker_names if name != "far"]
    case = Case(
        roles=dict.fromkeys(names, "moving"),
        motions=tuple(Translate(name, (0.0, 0.0)) for name in names),
        steps=1,
    )
    assert len(names) == 2
    nodes = moving_nodes(case, mesh).nodes
    assert len(list(displacements_of(case, mesh, nodes))) == 12
    changed = case.change(motions=tuple(Translate(n, (0.1, k)) for k, n in enumerate(names)))
    assert off(fields_of(case, mesh).moved(changed), changed, mesh) < 1e-8


def test_a_preview_begins_at_the_last_run():
    mesh = builders.square(9)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 20.0),), relax="yes", steps=1)
    fields = fields_of(case, mesh)
    points = run(case, mesh)
    assert off(fields.moved(case), case, mesh) > 1e-3
    after = fields.after(case, points)
    assert off(after.moved(case), case, mesh) < 1e-12
    near = case.change(motions=(Rotate("BLOCK", 22.0),))
    assert off(after.moved(near), near, mesh) < 0.2 * off(fields.moved(near), near, mesh)
    still = case.change(motions=(Rotate("BLOCK", 0.0),))
    assert np.abs(after.moved(still) - mesh.points).max() < 1e-14
    assert after.after(still, mesh.points).base is None


def test_other_settings_and_motions_have_other_fields():
    mesh = builders.square(6)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),))
    fields = fields_of(case, mesh)
    assert fields.moved(case.change(steps=5, relax="yes", layers="keep")) is not None
    assert fields.moved(case.change(influence_factor=1.5)) is None
    assert fields.moved(case.change(motions=(Rotate("BLOCK", 1.0), Rotate("BLOCK", 1.0)))) is None


def test_a_displacement_that_fields_lack_is_refused():
    mesh = builders.square(6)
    push = Radial("BLOCK", 1.1, 0.0, point=(0.5, 0.5))
    case = Case(roles={"BLOCK": "moving"}, motions=(push,))
    other = case.change(motions=(replace(push, point=(0.2, 0.5)),))
    assert fields_of(case, mesh).moved(other) is None


@pytest.mark.parametrize(
    ("name", "value", "match"), [("MOST", 5, "6 numbers"), ("free_memory", lambda: 10.0, "memory")]
)
def test_too_much_is_refused(monkeypatch, name, value, match):
    monkeypatch.setattr(live_fields, name, value)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),))
    with pytest.raises(DeformError, match=match):
        fields_of(case, builders.square(6))


def test_motions_without_numbers_are_refused():
    with pytest.raises(DeformError, match="move nothing"):
        independent(np.zeros((2, 6)))


def test_it_can_be_stopped():
    def stop(_):
        raise Cancelled("stopped")

    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),))
    with pytest.raises(Cancelled):
        LiveFields.of(case, builders.square(6), stop)
