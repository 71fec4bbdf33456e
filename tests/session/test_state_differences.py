"""The difference of two runs, of every cell: what both views show of it, and in which colors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slideviz.mesh.quality import quality
from slideviz.plots.section_paint import shown_paint
from slideviz.plots.session_plots import distribution, histogram_limits, shown_measure
from slideviz.session import changes
from slideviz.session.changes import UNDEFORMED
from slideviz.session.colors import NO_SECOND, fit_colors, not_drawable, with_drawable_colors
from slideviz.session.inspect import worst_cells
from slideviz.session.opening import open_mesh
from slideviz.session.state import Run, StepFrame, second_view
from slideviz.terms import DIFFERENCES
from tests.builders import square

MESH = square(4)
FIRST = StepFrame(MESH, quality(MESH))


def frame(seed):
    """The square with its nodes anywhere near their places."""
    shifts = np.random.default_rng(seed).uniform(-0.03, 0.03, MESH.points.shape)
    moved = MESH.with_points(MESH.points + shifts)
    return StepFrame(moved, quality(moved, reference=MESH))


def compared(steps=(2, 4), at=1, color_by="quality-gain", seed=0):
    """A session of two runs of so many steps, side by side."""
    made = open_mesh(FIRST, None)
    runs = tuple(
        Run(number, made.case, tuple(frame(seed + 10 * number + k) for k in range(count)), "done")
        for number, count in enumerate(steps, start=1)
    )
    both = changes.show_beside(changes.show_run(replace(made, runs=runs, newest=2), 1), 2)
    return changes.set_view(changes.show_frame(both, at), color_by=color_by)


def values(session):
    return session.frame.values(session.view.color_by, session.reference)


@given(
    steps=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    at=st.integers(0, 5),
    seed=st.integers(0, 1000),
)
def test_each_view_has_the_difference_from_the_other_one(steps, at, seed):
    session = compared(steps, at, seed=seed)
    second = second_view(session)
    a, b = session.frame, second.frame
    np.testing.assert_array_equal(values(session), a.quality.values - b.quality.values)
    np.testing.assert_array_equal(values(second), -values(session))
    assert second.color_range == session.color_range
    assert session.color_range[0] == -session.color_range[1]
    session = changes.set_view(session, color_by="run-distance")
    far = np.linalg.norm(a.mesh.points - b.mesh.points, axis=1)
    cells = MESH.cells
    wanted = np.add.reduceat(far[cells.connectivity], cells.offsets[:-1]) / np.diff(cells.offsets)
    np.testing.assert_allclose(values(session), wanted, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(values(second_view(session)), values(session))
    assert second_view(session).color_range == session.color_range
    assert session.color_range[0] == 0.0


def test_a_run_differs_from_itself_nowhere_and_from_the_undeformed_mesh_by_its_displacement():
    session = compared()
    same = replace(session, runs=(session.runs[0], replace(session.runs[0], number=2)))
    assert not values(same).any()
    assert same.color_range == (-1.0, 1.0)
    session = changes.show_beside(session, UNDEFORMED)
    np.testing.assert_array_equal(
        values(session), session.frame.quality.values - FIRST.quality.values
    )
    session = changes.set_view(session, color_by="run-distance")
    np.testing.assert_array_equal(values(session), session.frame.values("displacement", MESH))


def test_the_range_is_that_of_the_last_step_and_can_be_fitted():
    session = compared(at=1)
    last = changes.show_frame(session, 2)
    most = np.abs(values(last)).max()
    assert session.color_range == last.color_range
    assert most <= session.color_range[1] < 2.0 * most
    here = fit_colors(session, every=False).color_range
    every = fit_colors(session).color_range
    assert here[0] == -here[1]
    assert np.abs(values(session)).max() <= here[1] * (1 + 1e-3)
    assert here[1] <= every[1]
    assert most <= every[1] * (1 + 1e-3)


def test_gain_has_colors_of_its_own_with_white_in_the_middle():
    session = changes.set_view(compared(), color_map="plasma")
    assert session.color_map == shown_paint(session).color_map == "PuOr"
    assert changes.set_view(session, color_by="run-distance").color_map == "plasma"
    assert changes.set_view(session, color_by="size-skew").color_map == "plasma"


@pytest.mark.parametrize("what", DIFFERENCES)
def test_without_a_second_run_the_view_says_so_and_shows_roles(what):
    session = changes.show_beside(compared(color_by=what), None)
    assert session.reference is None
    assert not_drawable(session) == NO_SECOND
    assert with_drawable_colors(session).view.color_by == "role"
    assert shown_measure(session) == shown_paint(session).label == "size-skew"
    both = changes.show_beside(session, 2)
    assert not not_drawable(both)
    assert with_drawable_colors(both) is both


def test_worst_cells_are_those_that_lost_most_or_are_farthest():
    session = compared()
    worst = worst_cells(session.frames, 1, "quality-gain", 5, reference=session.reference)
    np.testing.assert_array_equal(worst.values, np.sort(values(session))[:5])
    session = changes.set_view(session, color_by="run-distance")
    worst = worst_cells(session.frames, 1, "run-distance", 5, reference=session.reference)
    np.testing.assert_array_equal(worst.values, np.sort(values(session))[:-6:-1])
    assert shown_paint(session).summary(np.arange(len(MESH.cells)))["worst_cell"] == worst.cells[0]


def test_the_histogram_counts_every_cell_once():
    for what in DIFFERENCES:
        session = compared(color_by=what)
        limits = histogram_limits(session, full_range=False)
        assert limits == session.color_range
        counts = distribution(session.frame, what, limits, session.reference).counts
        assert counts.sum() == len(MESH.cells)
    assert histogram_limits(compared(), full_range=True) == (-1.0, 1.0)
