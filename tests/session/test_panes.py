"""What two views side by side show."""

from dataclasses import replace

import pytest

from slideviz.mesh.quality import quality
from slideviz.session import changes
from slideviz.session.changes import UNDEFORMED
from slideviz.session.opening import open_mesh
from slideviz.session.panes import choices, close_pane, panes, show_in
from slideviz.session.state import Run, StepFrame


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
