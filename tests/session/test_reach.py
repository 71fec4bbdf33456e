"""How far the motion in the panel may go, by a run; motions that are scaled."""

from __future__ import annotations

import pytest

import slideviz as sv
from slideviz.mesh.margin import reach_words
from slideviz.samples.table import sample
from slideviz.session import changes, jobs
from slideviz.session.opening import open_mesh
from slideviz.session.reach import factor_of, reach_of, reach_run, scaled, typed_words
from slideviz.session.run_messages import end_parts
from slideviz.session.state import StepFrame

MOTIONS = (
    sv.Translate("b", (0.1, -0.2)),
    sv.Rotate("b", 30.0),
    sv.Scale("b", (1.2, 0.8)),
    sv.Radial("b", 1.1, 0.3),
    sv.HicksHenne("b", 0.02),
    sv.Ffd("b", "BOX", (0, 0, -1), (0.0, 0.5, 0.0)),
    sv.FfdTwist("b", "BOX", 0, 5.0),
    sv.FfdCamber("b", "BOX", (0, 0), 0.25),
    sv.SpanMotion("b", "twist", (0.0, 0.5, 1.0), (0.0, 1.5, 4.0)),
    sv.SpanMotion("b", "chord", (0.0, 1.0), (1.2, 0.8)),
)


@pytest.fixture(scope="module", params=[1, 3])
def session(request):
    """A session with a run of the sample square that folds cells."""
    made = sample("square", 25, "motion")
    case = made.case.change(sliding="none", periodic="none", steps=request.param)
    first = StepFrame(made.mesh, sv.quality(made.mesh))
    found = []
    jobs.compute(case, made.mesh, jobs.Job(found.append))
    frames = [one for one in found if isinstance(one, StepFrame)]
    session = changes.start_run(open_mesh(first, None, (), case))
    return changes.end_run(changes.add_frames(session, frames), "done")


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
def test_a_scaled_motion_goes_so_far(motion):
    (half,) = scaled((motion,), 0.5)
    assert factor_of((half,), (motion,)) == pytest.approx(0.5)
    assert scaled((half,), 2.0) == (motion,)
    assert scaled((motion,), 1.0) == (motion,)


def test_values_are_halved_and_ratios_go_half_the_way_from_1():
    assert scaled(MOTIONS[:1], 0.5) == (sv.Translate("b", (0.05, -0.1)),)
    assert scaled(MOTIONS[2:4], 0.5) == (sv.Scale("b", (1.1, 0.9)), sv.Radial("b", 1.05, 0.15))


def test_motions_that_differ_besides_are_not_compared():
    move, turn = MOTIONS[:2]
    assert factor_of((move, sv.Rotate("b", 15.0)), (move, turn)) is None
    assert factor_of((sv.Translate("b", (0.1, -0.1)),), (move,)) is None
    assert factor_of((sv.Translate("c", (0.1, -0.2)),), (move,)) is None
    assert factor_of((sv.Rotate("b", 30.0, (0.0, 0.0)),), (turn,)) is None
    assert factor_of((move,), (move, turn)) is None
    assert factor_of((sv.Translate("b", (0.0, 0.0)),), (move,)) is None
    assert factor_of((sv.FromFile("d.txt"),), (sv.FromFile("d.txt"),)) is None
    assert scaled((move, sv.FromFile("d.txt")), 0.5) is None


def test_the_curve_ends_where_the_first_cell_folds(session):
    found, run = reach_of(session), session.run_shown
    assert reach_run(session) is run
    assert found is reach_of(session)
    assert 0.8 < found.safe.fraction < 1.1
    before, after = found.fractions < found.safe.fraction, found.fractions > found.safe.fraction
    assert found.lowest[before].min() > 0 == found.lowest[after].max()
    assert found.lowest[found.fractions == found.safe.fraction] < 1e-3
    for frame in run.frames:
        assert found.lowest[found.fractions == frame.step.part] == frame.quality.min
    assert f"he motion {reach_words(found.safe.fraction)}." in "".join(end_parts(run))


def test_after_a_repair_the_path_ends_at_the_repaired_mesh(session):
    run, mesh, found = session.run_shown, session.frames[0].mesh, []
    jobs.repair(run.case, mesh, run.frames, jobs.Job(found.append))
    frames = [one for one in found if isinstance(one, StepFrame)]
    (*_, whole) = sv.deform(run.case.change(repair="yes"), mesh, certify=True)
    assert frames[-1].step.safe == whole.safe
    assert frames[-1].step.safe.fraction > 1
    if run.safe.fraction < 1:
        assert run.safe != whole.safe


def test_what_is_typed_is_compared_with_the_run(session):
    safe = session.run_shown.safe.fraction
    assert typed_words(session) == f"By run 1, it {reach_words(safe)}."
    half = changes.scale_motions(session, part=0.5)
    assert factor_of(half.case.motions, session.case.motions) == pytest.approx(0.5)
    assert typed_words(half) == f"By run 1 (50 % of its motion), it {reach_words(2 * safe)}."
    assert typed_words(changes.set_case(half, steps=7)) == ""
    other = changes.replace_motion(session, index=0, motion=sv.Rotate("BLOCK", 10.0))
    assert typed_words(other) == ""
