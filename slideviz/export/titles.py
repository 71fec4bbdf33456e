"""What stands above a picture or a film: which run and step, and how good it is."""

from __future__ import annotations

from collections.abc import Sequence

from slideviz.mesh.quality import Quality
from slideviz.session.runs_words import apart, differing, method_words, run_words
from slideviz.session.state import Frame, Run, Session
from slideviz.terms import ColourBy

LETTER_WIDTH = 9.6
"""Pixels that a letter of a title takes, at normal size."""
DETAIL = " (whole mesh; detail shown)"
"""Beside the quality of a mesh of which a part is seen."""
_SMALLEST = 0.6
"""Letters of two titles beside each other become so small, as a part of their size."""
LONGEST = "step {0}.00 of {0}, interpolated"
"""The place in a film that needs most room: a title must not change from image to image."""


def caption(name: str, found: Quality, colour_by: ColourBy = "size-skew") -> str:
    """Return what a picture shows, and the quality there, in a line."""
    what = "" if colour_by == "size-skew" else "size-skew "
    text = f"{name}: {what}min {found.min:.4f}, mean {found.mean:.4f}"
    if found.inverted:
        text += f", {found.inverted} of {found.cells} cells inverted"
    return text


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


def pair_names(pair: Sequence[Session]) -> list[str]:
    """Return what the runs of two views are called, in one form, with all that sets them apart."""
    runs = [one.run_shown for one in pair]
    # Beside the undeformed mesh both views have the same run.
    alone = runs[0] is runs[-1]
    both = [run for run in runs if run is not None]
    names = []
    for one, run in zip(pair, runs, strict=True):
        if run is None or (alone and one.view.frame == 0):
            names.append("Undeformed")
            continue
        words = [f"Run {run.number}", run_words(run)]
        words += [method_words(run.case)] if run.name and _methods_differ(both) else []
        names.append(", ".join(filter(None, [*words, "" if alone else differing(run, both)])))
    return names


def _methods_differ(runs: Sequence[Run]) -> bool:
    return len({method_words(run.case) for run in runs}) > 1


def pair_titles(pair: Sequence[Session], quality: bool) -> list[str]:
    """Return the words above two pictures beside each other, in one form.

    Parameters
    ----------
    pair : (Session, Session)
        What they show.
    quality : bool
        With a second line: step, minimum, mean and inverted cells.
    """
    names = pair_names(pair)
    if not quality:
        return names
    several = any(len(one.frames) > 2 for one in pair)
    found = []
    for one, name in zip(pair, names, strict=True):
        frame, steps = one.frame, len(one.frames) - 1
        assert frame is not None
        at = min(one.view.frame, steps)
        place = (f"step {at} of {steps}" if several else "") if at else "undeformed"
        place = "" if name == "Undeformed" else place
        numbers = caption(place, frame.quality, one.view.colour_by).removeprefix(": ")
        found.append(f"{name}\n{numbers}")
    return found


def fitting(titles: Sequence[str], letters: float) -> tuple[list[str], float]:
    """Return titles of a line or two that have room for so many letters, and how large they are.

    All are as much smaller as the longest line asks for, 1 being as they were; where that would
    be too small to be read, lines end with an ellipsis.
    """
    longest = max(len(line) for title in titles for line in title.splitlines())
    part = min(1.0, max(letters / longest, _SMALLEST))
    most = int(letters / part)
    return ["\n".join(_cut(line, most) for line in title.splitlines()) for title in titles], part


def _cut(line: str, most: int) -> str:
    return line if len(line) <= most else line[: max(most - 1, 1)].rstrip(" ,") + "…"
