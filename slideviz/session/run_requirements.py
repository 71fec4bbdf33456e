"""What must be put right before a run."""

from __future__ import annotations

from dataclasses import dataclass

from slideviz.case.model import FromFile, Motion, Radial, Rotate, Scale, Translate, moves
from slideviz.session.state import Place, Session
from slideviz.session.window_words import in_window_words


@dataclass(frozen=True)
class Missing:
    """What must be put right before a run, in words, and which panel does it.

    Attributes
    ----------
    marker : str
        The boundary that wants a motion; empty where that is not what is missing.
    motion : int
        The motion that it is about, from 0.
    """

    text: str
    place: Place
    marker: str = ""
    motion: int = 0


def is_missing(session: Session) -> tuple[Missing, ...]:
    """Return what must be put right before a run, most urgent first; empty when ready."""
    if session.mesh is None:
        return (Missing("Open a mesh first.", "open"),)
    case = session.case
    # What is typed comes first: the rest looks at the case, which still has the number before it.
    found = [Missing(text, place) for place, text in session.invalid]
    moving = case.markers_with("moving")
    if not moving:
        found.append(Missing("No boundary moves: give one the role “moving”.", "boundaries"))
    found += [
        Missing(f"“{name}” has no motion: add one.", "motion", name)
        for name in moving
        if not any(moves(motion, name) for motion in case.motions)
    ]
    if case.motions and all(moves_nothing(motion) for motion in case.motions):
        found.append(Missing("Nothing moves yet: type how far in the motion.", "motion"))
    for place, motion in enumerate(case.motions):
        if isinstance(motion, FromFile) and not motion.path.is_file():
            text = f"The displacement file {motion.path} does not exist."
            found.append(Missing(text, "motion", motion=place))
    if case.periodic == "moving" and case.sliding == "none":
        text = "Moving periodic vertices need sliding: choose pseudo or direct."
        found.append(Missing(text, "method"))
    if not found:
        found = [Missing(text, "boundaries") for text in _problems(session)]
    if not found and session.clash:
        found = [Missing(session.clash, "motion")]
    return tuple(found)


def moves_nothing(motion: Motion) -> bool:
    """Tell whether a motion leaves its boundary where it is; of a file nobody knows."""
    if isinstance(motion, Translate):
        return not any(motion.vector)
    if isinstance(motion, Rotate):
        return motion.angle_deg == 0
    if isinstance(motion, Scale):
        return all(factor == 1 for factor in motion.factors)
    return isinstance(motion, Radial) and motion.factor == 1 and motion.distance == 0


def _problems(session: Session) -> list[str]:
    """Return what the case itself finds wrong with the mesh."""
    from slideviz.case.motion import check_case

    assert session.mesh is not None
    said = (in_window_words(text) for text in check_case(session.case, session.mesh))
    return [text[:1].upper() + text[1:] for text in said]
