"""Changes of the runs, as functions from one session to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from slideviz.case.model import Case
from slideviz.session.changes_view import set_view, show_frame
from slideviz.session.state import Run, Session, StepFrame
from slideviz.session.undoable import undoable

UNDEFORMED = 0
"""The number of the undeformed mesh where a run's number is asked for; those begin with 1."""
MOST_REMOVED = 2
"""Removed runs that undo can bring back: each may take hundreds of megabytes."""


def start_run(session: Session, case: Case | None = None, name: str = "") -> Session:
    """Return the session with a new run, which is shown: of ``case``, or of the session's case.

    With a ``name`` it is the run of a design. Earlier runs without any step are removed. No cell is
    marked: one that was bad need not be of interest in another run.
    """
    kept = tuple(run for run in session.runs if run.frames)
    number = 1 + max((session.newest, *(run.number for run in session.runs)))
    panels = session.case if name else None
    runs = (*kept, Run(number, case or session.case, name=name, panels=panels))
    session = replace(session, runs=runs, shown=number, newest=number)
    return show_frame(set_view(session, marked_cell=None), 0)


def add_frames(session: Session, frames: Sequence[StepFrame]) -> Session:
    """Return the session with further steps of the newest run, the last shown if that run is."""
    newest = session.runs[-1]
    grown = replace(newest, frames=(*newest.frames, *frames), saved=False)
    session = replace(session, runs=(*session.runs[:-1], grown))
    if session.shown != grown.number:
        return session  # the user looks at another run meanwhile
    return show_frame(session, len(grown.frames))


def end_run(session: Session, end: Literal["done", "cancelled", "failed"]) -> Session:
    """Return the session with ``end`` as the end of the newest run, if that had none."""
    if not session.runs or session.runs[-1].end:
        return session
    ended = replace(session.runs[-1], end=end)
    return replace(session, runs=(*session.runs[:-1], ended))


def show_run(session: Session, number: int) -> Session:
    """Return the session with the last step of a run shown, if there is the run."""
    run = session.run(number)
    if run is None:
        return session
    beside = None if session.view.beside == number else session.view.beside
    session = set_view(replace(session, shown=number), beside=beside)
    return show_frame(session, len(run.frames))


def show_design(session: Session, number: int) -> Session:
    """Return the session with the last step of a design's run shown, as asked for in this case."""
    asked = (
        replace(one, panels=session.case) if one.number == number else one for one in session.runs
    )
    return show_run(replace(session, runs=tuple(asked)), number)


def show_beside(session: Session, number: int | None) -> Session:
    """Return the session with another run in a second view; None for no second view.

    ``UNDEFORMED`` is the number of the undeformed mesh.
    """
    known = number == UNDEFORMED or session.run(number) is not None
    if number == session.shown or not known:
        number = None
    return set_view(session, beside=number, swapped=False)


@undoable("removing a run")
def remove_run(session: Session, number: int) -> Session:
    """Return the session without a run, which undo can bring back; unchanged while it goes on."""
    run = session.run(number)
    if run is None or not run.end:
        return session
    rest = tuple(other for other in session.runs if other.number != number)
    beside = None if session.view.beside == number else session.view.beside
    removed = (*session.removed, run)[-MOST_REMOVED:]
    newest = max(session.newest, *(other.number for other in session.runs))
    session = replace(session, runs=rest, removed=removed, newest=newest)
    session = set_view(session, beside=beside)
    if session.shown != number:
        return session
    if not rest:
        return show_frame(set_view(replace(session, shown=None), beside=None), 0)
    return show_run(session, rest[-1].number)


def bring_back(session: Session, number: int) -> Session:
    """Return the session with a removed run back at its place, if it is still in ``removed``."""
    back = [run for run in session.removed if run.number == number]
    if not back:
        return session
    runs = tuple(sorted((*session.runs, *back), key=lambda run: run.number))
    return replace(
        session, runs=runs, removed=tuple(run for run in session.removed if run not in back)
    )


def rename_run(session: Session, number: int, name: str) -> Session:
    """Return the session with another name for a run; "" takes its name away."""
    name = " ".join(name.split())
    run = session.run(number)
    if run is None or run.name == name:
        return session
    runs = tuple(replace(one, name=name) if one is run else one for one in session.runs)
    return replace(session, runs=runs)


@undoable("settings of a run")
def take_settings(session: Session, number: int) -> Session:
    """Return the session with the case of a run as its own, and no guesses."""
    run = session.run(number)
    if run is None:
        return session
    return replace(session, case=run.case, guesses={})


def second_view(session: Session) -> Session:
    """Return the session that the second view shows: the other run, at the matching step.

    Unchanged where there is no second view.
    """
    if session.view.beside == UNDEFORMED:
        return show_frame(session, 0)
    run, other = session.run_shown, session.run(session.view.beside)
    if other is None:
        return session
    last = len(run.frames) if run is not None else 0
    at = session.view.frame
    # The step at about the same part of the displacement, where numbers of steps differ.
    frame = round(at * len(other.frames) / last) if last else 0
    if at:
        frame = max(frame, 1)
    return show_frame(replace(session, shown=other.number), frame)


def saved_mesh(session: Session) -> Session:
    """Return the session after the deformed mesh of the run that is shown was written to disk."""
    runs = tuple(
        replace(run, saved=True) if run.number == session.shown else run for run in session.runs
    )
    return replace(session, runs=runs)
