"""Two views side by side: the run that each shows, and those that it could show."""

from __future__ import annotations

from collections.abc import Sequence

from slideviz.session.changes import (
    UNDEFORMED,
    seen_beside,
    set_view,
    show_beside,
    show_frame,
    show_run,
)
from slideviz.session.runs_words import brief, run_words
from slideviz.session.state import Run, Session


def run_title(run: Run, among: Sequence[Run] = ()) -> str:
    """Return the number of a run and the words that set it apart from those of a list."""
    return f"Run {run.number}: {run_words(run)} · {brief(run, among)}"


def choices(session: Session) -> dict[int, str]:
    """Return the names of the runs that a view can show, by number."""
    runs = {run.number: run_title(run, session.runs) for run in session.runs if run.frames}
    return {UNDEFORMED: "Undeformed mesh"} | runs


def panes(session: Session) -> tuple[int | None, int | None]:
    """Return the numbers of the runs to the left and to the right; None: no view."""
    first, second = session.shown, session.view.beside
    return (second, first) if session.view.swapped and second is not None else (first, second)


def shown_views(session: Session) -> tuple[Session, ...]:
    """Return the sessions of the views, the left one first."""
    other = session.view.beside
    if other is None or (other != UNDEFORMED and session.run(other) is None):
        return (session,)
    second = seen_beside(session)
    return (second, session) if session.view.swapped else (session, second)


def show_in(session: Session, pane: int, number: int) -> Session:
    """Return the session with a run (its number, or ``UNDEFORMED``) shown in one view.

    What the other view shows already changes places with what this one showed. The step stays,
    as a part of the displacement.

    Parameters
    ----------
    pane : {0, 1}
        The left or the right view.
    number : int
        That of a run, or ``UNDEFORMED``.
    """
    pair = list(panes(session))
    if number not in choices(session) or number == pair[pane]:
        return session
    if number == pair[1 - pane]:
        pair[1 - pane] = pair[pane]
    pair[pane] = number
    left, right = pair
    # The steps are those of a run: where one is the undeformed mesh, of the other.
    swapped = left == UNDEFORMED
    first, second = (right, left) if swapped else (left, right)
    return set_view(show_beside(_lead(session, first), second), swapped=swapped)


def close_pane(session: Session, pane: int) -> Session:
    """Return the session with only the other view."""
    kept = panes(session)[1 - pane]
    alone = show_beside(session, None)
    if kept == UNDEFORMED:
        return show_frame(alone, 0)
    return _lead(alone, kept)


def _lead(session: Session, number: int | None) -> Session:
    """Return the session with another run in the first view, as far deformed as the one before."""
    if number is None or number == session.shown:
        return session
    steps, at = len(session.frames) - 1, session.view.frame
    session = show_run(session, number)
    frame = round(at * (len(session.frames) - 1) / steps) if steps > 0 else 0
    return show_frame(session, max(frame, 1) if at else frame)
