"""What stands above a picture or a film: which run and step, and how good it is."""

from __future__ import annotations

from slideviz.view.pictures.portrait import caption
from slideviz.view.session.runs_words import apart, run_words
from slideviz.view.session.state import Frame, Session

LETTER_WIDTH = 9.6
"""Pixels that a letter of a title takes, at normal size."""
LONGEST = "step {0}.00 of {0}, interpolated"
"""The place in a film that needs most room: a title must not change from image to image."""


def place_words(position: float, steps: int) -> str:
    """Return where in a run a mesh is: a step, or between two; nothing if there is but one."""
    if position == 0:
        return "undeformed"
    whole = position == int(position)
    if whole:
        return f"step {position:.0f} of {steps}" if steps > 1 else ""
    return f"step {position:.2f} of {steps}, interpolated"


def names_of(session: Session) -> list[str]:
    """Return what the run that is shown is called, each shorter than the one before.

    With what sets it apart from the other runs; with its name or method; its number only.
    """
    run = session.run_shown
    if run is None:
        return ["Deformed"]
    number, words = f"Run {run.number}", run_words(run)
    others = apart(run, session.runs)
    found = [f"{number}, {words}, {others}"] if others else []
    return [*found, f"{number}, {words}", number]


def title_words(
    session: Session, frame: Frame, place: str, letters: float, longest: str = ""
) -> str:
    """Return a title that has room for so many letters.

    Parameters
    ----------
    session : Session
        With the runs there are.
    frame : Frame
        What is shown.
    place : str
        Where in the run that is (`place_words`).
    letters : float
    longest : str
        The place that needs most room, where several titles are to be alike.
    """
    what = session.view.colour_by

    def told(name: str, place: str) -> str:
        return caption(f"{name}, {place}" if place else name, frame.quality, what)

    if place == "undeformed":
        full, *rest = ("Undeformed",)
    else:
        full, *rest = names_of(session)
    shown = "" if place == "undeformed" else place
    for name in (full, *rest[:-1]):
        if max(len(told(name, longest)), len(told(name, shown))) <= letters:
            return told(name, shown)
    least = f": min {frame.quality.min:.3f}"
    for name in (full, *rest):
        for where in (f", {shown}" if shown else "", ""):
            text = f"{name}{where}{least}"
            if len(text) <= letters:
                return text
    return text


def name_words(session: Session, letters: float) -> str:
    """Return which run or mesh is shown, without its quality, in so many letters."""
    names = ["Undeformed"] if session.view.frame == 0 else names_of(session)
    return next((name for name in names if len(name) <= letters), names[-1])
