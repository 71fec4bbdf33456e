"""The preview in the session: what is shown while the hand moves, until the run is there."""

from dataclasses import replace

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate
from slideviz.design import live_fields
from slideviz.errors import Cancelled
from slideviz.mesh.quality import quality
from slideviz.session import changes, jobs
from slideviz.session.opening import open_mesh
from slideviz.session.run_messages import preview_words
from slideviz.session.state import StepFrame, second_view
from tests import builders


def opened(**settings):
    mesh = builders.square(8)
    case = Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 0.0),), **settings)
    return open_mesh(StepFrame(mesh, quality(mesh)), None, case=case)


def turned(session, angle):
    return changes.set_case(session, motions=(Rotate("BLOCK", angle),))


def fields_of(session):
    return jobs.make_live_fields(session.case, session.mesh, jobs.Job())


def previewed(session, fields, run=None):
    fields, preview = jobs.make_preview(fields, session.case, run, jobs.Job())
    return fields, changes.show_preview(session, preview)


def ran(session, **values):
    session = changes.start_run(session, **values)
    frames = []
    jobs.compute(session.case, session.mesh, jobs.Job(frames.append))
    frames = [one for one in frames if isinstance(one, StepFrame)]
    return changes.add_frames(session, frames)


def test_a_preview_is_the_frame_that_is_shown():
    session = turned(opened(), 5.0)
    _, session = previewed(session, fields_of(opened()))
    assert session.frame is session.preview.frame is session.frames[1]
    assert session.frame.quality.min < 1.0
    assert session.view.color_by == "size-skew"
    assert session.preview.safe.fraction > 1.0
    assert session.largest_displacement > 0.0


def test_it_stays_until_the_run_ends_which_says_how_far_it_was_off():
    session = turned(opened(steps=3), 5.0)
    _, session = previewed(session, fields_of(session))
    shown = session.frame
    session = ran(session)
    assert session.frame is shown
    session = changes.end_run(session, "done")
    run = session.runs[-1]
    assert session.preview is None
    assert session.frame is run.last
    part, lowest = run.preview_off
    apart = np.linalg.norm(shown.mesh.points - run.last.mesh.points, axis=1).max()
    assert part == apart / run.last.largest_displacement(session.mesh)
    assert 0.0 < part < 0.02
    assert abs(lowest) < 1e-3
    assert "of the motion, its lowest quality by" in preview_words(run)
    assert preview_words(replace(run, preview_off=None)) == ""
    assert "was off by 257 % of" in preview_words(replace(run, preview_off=(2.574, 0.1)))
    relaxed = replace(run, case=run.case.change(relax="yes"))
    assert "no relaxation" in preview_words(relaxed)


def test_a_run_of_other_settings_says_nothing_of_the_preview():
    _, session = previewed(turned(opened(), 5.0), fields_of(opened()))
    session = changes.end_run(ran(turned(session, 6.0)), "done")
    assert session.runs[-1].preview_off is None


def test_any_other_step_ends_the_preview():
    _, session = previewed(turned(opened(), 5.0), fields_of(opened()))
    assert changes.show_frame(session, 0).preview is None
    assert changes.end_preview(session).frame is session.first
    assert changes.end_preview(opened()).preview is None
    done = changes.end_run(ran(session), "done")
    again = changes.show_preview(done, session.preview)
    assert changes.show_run(again, done.shown).frame is done.runs[-1].last
    assert changes.start_run(again, name="design").preview is None
    assert second_view(replace(again, view=replace(again.view, beside=0))).preview is None


def test_a_live_run_replaces_the_one_before():
    session = changes.end_run(ran(opened(), live=True), "done")
    second = changes.end_run(ran(session, live=True), "done")
    assert [run.number for run in second.runs] == [2]
    for kept in (
        changes.rename_run(session, 1, "good"),
        changes.saved_mesh(session),
        changes.set_view(session, beside=1),
    ):
        assert [run.number for run in ran(kept, live=True).runs] == [1, 2]
    assert [run.number for run in ran(session).runs] == [1, 2]


def test_a_cancelled_live_run_leaves_the_preview():
    first = changes.end_run(ran(opened()), "done")
    _, session = previewed(turned(first, 5.0), fields_of(first))
    session = changes.start_run(session, live=True)
    session = changes.end_run(session, "cancelled")
    assert [run.number for run in session.runs] == [1]
    assert session.shown == 1
    assert session.preview is not None


def test_a_preview_begins_at_the_last_run():
    session = turned(opened(relax="yes"), 10.0)
    done = changes.end_run(ran(session), "done")
    fields, session = previewed(turned(done, 10.0), fields_of(done), done.runs[-1])
    assert np.abs(session.frame.mesh.points - done.frame.mesh.points).max() < 1e-12
    assert fields.start is done.frame.mesh.points
    again, _ = previewed(session, fields, done.runs[-1])
    assert again is fields


def test_no_preview_where_there_can_be_none(monkeypatch):
    session = opened()
    other = changes.set_case(session, influence_factor=1.5)
    fields = fields_of(session)
    assert jobs.make_preview(fields, other.case, None, jobs.Job()) == (fields, None)
    monkeypatch.setattr(live_fields, "MOST", 0)
    assert fields_of(session) is None


def test_it_can_be_stopped():
    session = opened()
    with pytest.raises(Cancelled):
        jobs.make_live_fields(session.case, session.mesh, jobs.Job(stopped=lambda: True))
    with pytest.raises(Cancelled):
        jobs.make_preview(fields_of(session), session.case, None, jobs.Job(stopped=lambda: True))
