"""What two views side by side show."""

from dataclasses import replace
from pathlib import Path

import pytest

from slideviz.mesh.quality import quality
from slideviz.session import changes
from slideviz.session.changes import UNDEFORMED
from slideviz.session.opening import open_mesh
from slideviz.session.panes import choices, close_pane, panes, show_in
from slideviz.session.run_messages import stopped_words
from slideviz.session.runs_words import steps_words
from slideviz.session.saving import Unsaved, title_of
from slideviz.session.state import Run, StepFrame, second_view
from slideviz.solver.deform import deform


@pytest.fixture(scope="module")
def session(passage):
    """Run 1 of two steps, run 2 of four, which is shown at its second."""
    frame = StepFrame(passage.mesh, quality(passage.mesh))
    made = open_mesh(frame, None, (), passage.case)
    runs = tuple(
        Run(number, passage.case, (frame,) * steps, "done") for number, steps in ((1, 2), (2, 4))
    )
    return changes.show_frame(replace(made, runs=runs, shown=2), 2)


def test_the_undeformed_mesh_and_every_run_with_steps_can_be_chosen(session):
    begun = changes.start_run(session)
    assert list(choices(begun)) == [UNDEFORMED, 1, 2]
    assert choices(begun)[1].startswith("Run 1: ")


@pytest.mark.parametrize(
    ("before", "pane", "number", "after"),
    [
        ((2, 1), 0, 1, (1, 2)),
        ((2, 1), 1, 2, (1, 2)),
        ((2, 1), 1, UNDEFORMED, (2, UNDEFORMED)),
        ((2, 1), 0, UNDEFORMED, (UNDEFORMED, 1)),
        ((2, UNDEFORMED), 0, UNDEFORMED, (UNDEFORMED, 2)),
        ((UNDEFORMED, 2), 0, 1, (1, 2)),
        ((UNDEFORMED, 2), 1, 1, (UNDEFORMED, 1)),
        ((2, 1), 0, 2, (2, 1)),
        ((2, 1), 0, 7, (2, 1)),
    ],
)
def test_a_pane_shows_what_was_chosen_and_never_the_same_as_the_other(
    session, before, pane, number, after
):
    first, second = before[::-1] if before[0] == UNDEFORMED else before
    session = changes.show_beside(changes.show_run(session, first), second)
    session = changes.set_view(session, swapped=before[0] == UNDEFORMED)
    assert panes(session) == before
    assert panes(show_in(session, pane, number)) == after


@pytest.fixture(scope="module")
def computed(passage):
    """A step of the passage."""
    return next(deform(passage.case, passage.mesh))


@pytest.mark.parametrize("end", ["cancelled", "failed"])
@pytest.mark.parametrize(("made", "planned"), [(1, 1), (1, 2), (3, 5), (31, 100), (8, 8), (1, 9)])
def test_a_run_that_ended_early_says_how_far_it_came(session, computed, made, planned, end):
    frame = session.frames[-1]
    frames = [
        replace(frame, step=replace(computed, index=k, total=planned, part=k / planned))
        for k in range(1, made + 1)
    ]
    run = Run(3, session.case, tuple(frames), end)
    opened = replace(session, path=Path("mesh.su2"), runs=(*session.runs, run))
    both = changes.show_run(opened, 3)
    assert run.planned == planned
    assert run.incomplete == (made < planned)
    assert not replace(run, end="").incomplete
    early = made < planned
    words = f"step {made} of {planned}"
    assert (words in title_of(both)) == early
    assert (words in stopped_words(run)) == early
    assert (f"({words})" in Unsaved.of(both, busy=False).question("closing")) == early
    assert (f"{made} of {planned} steps" in steps_words(run)) == early
    # Beside it is the step of another run that is as far, not that run's last one.
    beside = second_view(changes.show_beside(both, 2))
    assert beside.view.frame == max(round(made * 4 / planned), 1)
    assert show_in(changes.show_beside(both, 1), 0, 2).view.frame == max(
        round(made * 4 / planned), 1
    )


def test_the_step_stays_as_a_part_of_the_displacement(session):
    session = show_in(changes.show_beside(session, UNDEFORMED), 0, 1)
    assert (session.shown, session.view.frame) == (1, 1)
    session = show_in(changes.show_frame(session, 0), 0, 2)
    assert (session.shown, session.view.frame) == (2, 0)


def test_closing_one_pane_keeps_the_other(session):
    both = changes.show_beside(session, 1)
    assert panes(close_pane(both, 1)) == (2, None)
    alone = close_pane(both, 0)
    assert panes(alone) == (1, None)
    assert alone.view.frame == 1
    first = close_pane(changes.show_beside(session, UNDEFORMED), 0)
    assert (panes(first), first.view.frame) == ((2, None), 0)
