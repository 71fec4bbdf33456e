"""What the curves of a session are made of."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from slideviz.errors import SlidevizError
from slideviz.mesh.quality import quality
from slideviz.plots import session_plots
from slideviz.plots.spanwise import along
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame


def run_of(session, sizes, history=()):
    rng = np.random.default_rng(len(sizes))
    frames = []
    for index, size in enumerate(sizes):
        points = session.mesh.points + size * rng.uniform(-1, 1, session.mesh.points.shape)
        mesh = session.mesh.with_points(points)
        step = SimpleNamespace(index=index + 1, history=history, seconds={}, tolerance=0.02)
        frames.append(StepFrame(mesh, quality(mesh, session.mesh), step))
    session = changes.add_frames(changes.start_run(session), frames)
    return changes.end_run(session, "done")


@pytest.fixture
def two_runs(session):
    return run_of(run_of(session, (0.1, 0.2)), (0.05, 0.1, 0.15))


def test_quality_by_step_begins_with_the_undeformed_mesh(two_runs):
    other, shown = session_plots.step_runs(two_runs)
    assert (shown.label, other.label) == ("run 2", "run 1")
    assert shown.steps.tolist() == [0, 1, 2, 3]
    assert shown.minimum.tolist() == [frame.quality.min for frame in two_runs.frames]
    assert other.mean[2] == two_runs.runs[0].last.quality.mean
    assert other.minimum[0] == two_runs.first.quality.min


def test_a_run_has_one_look_in_every_plot_and_never_that_of_the_undeformed_mesh(two_runs):
    looks = [
        session_plots.series_of(replace(two_runs.runs[0], number=number)) for number in range(1, 9)
    ]
    assert len(set(looks)) == 8
    assert session_plots.UNDEFORMED not in looks
    steps = {run.label: run.series for run in session_plots.step_runs(two_runs)}
    span = {p.label: p.series for p in session_plots.profiles(two_runs, "x")}
    assert span == {**steps, "undeformed": session_plots.UNDEFORMED}


def test_a_run_without_steps_has_no_curve(session):
    assert session_plots.step_runs(changes.start_run(session)) == []


def test_convergence_is_that_of_the_step_that_is_shown(session):
    cycles = tuple(
        SimpleNamespace(control_nodes=2 * k, error=0.1 / k, level=1 + k // 3) for k in range(1, 5)
    )
    session = run_of(session, (0.1, 0.2), cycles)
    found = session_plots.greedy_run(changes.show_frame(session, 1))
    assert found.label == "run 1, step 1"
    assert found.control_nodes.tolist() == [2, 4, 6, 8]
    assert found.error[0] == 0.1
    assert found.level.tolist() == [1, 1, 2, 2]
    assert found.tolerance == 0.02
    assert session_plots.greedy_run(changes.show_frame(session, 0)) is None


def test_without_data_reduction_there_is_no_convergence(two_runs):
    assert session_plots.greedy_run(two_runs) is None


def test_the_span_has_the_shown_step_the_others_last_and_the_undeformed_mesh(two_runs):
    session = changes.show_frame(two_runs, 2)
    found = session_plots.profiles(session, "y")
    assert [profile.label for profile in found] == ["run 2", "run 1", "undeformed"]
    frames = (session.frame, session.runs[0].last, session.first)
    for profile, frame in zip(found, frames, strict=True):
        wanted = along(session.mesh, frame.quality.values, "y")
        assert profile.minimum.tolist() == wanted.minimum.tolist()
        assert profile.coordinate == "y"


def test_the_radius_is_that_about_the_axis_of_the_case(session):
    for origin in ((0.0, 0.0, 0.0), (4.0, 4.0, 0.0)):
        moved = changes.set_case(session, origin=origin)
        (found,) = session_plots.profiles(moved, "r")
        wanted = along(session.mesh, session.first.quality.values, "r", origin=origin)
        assert found.edges.tolist() == wanted.edges.tolist()
        assert found.count.tolist() == wanted.count.tolist()


def test_a_profile_is_made_once_as_long_as_its_frame_is_there(two_runs):
    first, again = (session_plots.profiles(two_runs, "x") for _ in range(2))
    assert all(a is b for a, b in zip(first, again, strict=True))


def test_a_mesh_without_extent_that_way_is_refused(two_runs):
    with pytest.raises(SlidevizError, match="no length"):
        session_plots.profiles(two_runs, "z")


def test_the_span_is_the_radius_where_a_mesh_repeats_about_an_axis(session, cube):
    assert session_plots.usual_coordinate(session) == "y"
    assert "z" not in session_plots.coordinates(session)
    solid = open_mesh(StepFrame(cube, quality(cube)), None)
    assert session_plots.usual_coordinate(solid) in ("x", "y", "z")
    assert list(session_plots.coordinates(solid)) == ["r", "span", "z", "y", "x"]
    turned = replace(solid, pairs=(SimpleNamespace(kind="rotational"),))
    assert session_plots.usual_coordinate(turned) == "r"
