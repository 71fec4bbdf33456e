"""Limits of the case, checked on the step that is shown."""

from dataclasses import replace

import numpy as np

from slideviz.case.limits import read_limits
from slideviz.case.model import Case
from slideviz.mesh.quality import quality, quality_totals
from slideviz.session.jobs import Job, check_frame
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame, result_settings
from tests.builders import grid


def checked(session):
    found = check_frame(session.frame, session.mesh, session.case, Job(print))
    return replace(session, checked=found)


def test_limits_are_known_for_the_frame_and_the_limits_they_were_checked_with():
    mesh = grid((4, 4))
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, (), None)
    assert session.limit_results == ()
    limited = replace(session, case=session.case.change(limits="largest_angle < 61, inverted = 0"))
    assert limited.limit_results is None
    assert limited.limit_chosen is None
    known = replace(checked(limited), limit=0)
    low, folded = known.limit_results
    assert not low.passed
    assert folded.passed
    assert known.limit_chosen is low
    np.testing.assert_array_equal(low.cells, np.arange(len(mesh.cells)))
    assert replace(known, limit=None).limit_chosen is None
    other = replace(known, case=known.case.change(limits="min > 0.5"))
    assert other.limit_results is None
    assert replace(known, first=StepFrame(mesh, quality(mesh))).limit_results is None


def test_limits_do_not_make_a_result_outdated():
    case = Case(roles={"BLOCK": "moving"})
    assert result_settings(case) == result_settings(case.change(limits="min > 0.5"))


def test_a_mesh_in_its_file_has_the_numbers_of_all_cells_and_the_cells_in_memory():
    mesh = grid((4, 4))
    points = mesh.points.copy()
    points[5] += 0.2
    worst = mesh.with_points(points)
    totals = quality_totals(np.array([0.1, 0.9]), np.zeros(2, np.uint8))
    frame = StepFrame(
        mesh,
        replace(quality(mesh), of_mesh=totals),
        extra=StepFrame(worst, quality(worst, mesh)),
    )
    case = Case(limits="min > 0.95, mean > 0.4, size > 0.5")
    found = check_frame(frame, mesh, case, Job(print))
    low, mean = found.results
    assert low.actual == 0.1
    assert mean.actual == 0.5
    assert "size > 0.5 needs the mesh in memory" in found.problem
    np.testing.assert_array_equal(
        np.sort(low.cells), len(mesh.cells) + np.flatnonzero(quality(worst, mesh).values <= 0.95)
    )
    assert read_limits("min > 0.95")[0] == low.limit
