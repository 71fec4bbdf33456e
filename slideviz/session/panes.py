"""Two views side by side: which run each shows, and which runs it could show."""

from __future__ import annotations

from collections.abc import Sequence

from slideviz.session.changes import set_view, show_beside, show_frame, show_run
from slideviz.session.runs_words import summary
from slideviz.session.state import UNDEFORMED, Run, Session, second_view


def run_title(run: Run, among: Sequence[Run] = ()) -> str:
    """Return number and name of a run, and words that distinguish it from the runs ``among``."""
    name = f"{run.name} · " if run.name else ""
    return f"Run {run.number}: {name}{summary(run, among, method=True)}"


def choices(session: Session) -> dict[int, str]:
    """Return the titles of the runs that a view can show, by number, and of the undeformed mesh."""
    runs = {run.number: run_title(run, session.runs) for run in session.runs if run.frames}
    return {UNDEFORMED: "Undeformed mesh"} | runs


def panes(session: Session) -> tuple[int | None, int | None]:
    """Return the numbers of the runs in the left and the right view; None: no run, or no view."""
    first = session.shown
    second = session.view.beside
    return (second, first) if session.view.swapped and second is not None else (first, second)


def second_session(session: Session) -> Session | None:
    """Return the session as the second view shows it; None while there is only one view."""
    other = session.view.beside
    if other is None or (other != UNDEFORMED and session.run(other) is None):
        return None
    return second_view(session)


def shown_views(session: Session) -> tuple[Session, ...]:
    """Return a session for each view, the left one first: with the view's run and frame shown."""
    second = second_session(session)
    if second is None:
        return (session,)
    return (second, session) if session.view.swapped else (session, second)


def show_in(session: Session, pane: int, number: int) -> Session:
    """Return the session with a run (its number, or ``UNDEFORMED``) shown in one view.

    If the other view shows it already, the two change places. The step shown stays about the same
    part of the displacement. ``pane``: the left or the right view. ``number``: the number of the
    run, or ``UNDEFORMED``.
    """
    pair = list(panes(session))
    if number not in choices(session) or number == pair[pane]:
        return session
    if number == pair[1 - pane]:
        pair[1 - pane] = pair[pane]
    pair[pane] = number
    left, right = pair
    # The first view has the steps, so it is not the one with the undeformed mesh.
    swapped = left == UNDEFORMED
    first, second = (right, left) if swapped else (left, right)
    return set_view(show_beside(_lead(session, first), second), swapped=swapped)


def close_pane(session: Session, pane: int) -> Session:
    """Return the session with only one view, the one beside ``pane``."""
    number = panes(session)[1 - pane]
    alone = show_beside(session, None)
    if number == UNDEFORMED:
        return show_frame(alone, 0)
    return _lead(alone, number)


def _lead(session: Session, number: int | None) -> Session:
    """Return the session with another run in the first view, at the step that matches best."""
    if number is None or number == session.shown:
        return session
    planned = session.planned
    at = session.view.frame
    session = show_run(session, number)
    frame = round(at * session.planned / planned) if planned else 0
    return show_frame(session, max(frame, 1) if at else frame)
