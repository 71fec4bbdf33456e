"""The color range: fitted to the values that are shown, and in words."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.metrics import is_known
from slideviz.mesh.quality import INVERTED
from slideviz.session.changes import second_view, set_view, undoable
from slideviz.session.state import Session, StepFrame, outwards
from slideviz.terms import METRICS


@undoable("color range")
def fit_colors(session: Session, every: bool = True) -> Session:
    """Return the session with a color range from the lowest to the highest value.

    With ``every``, of all steps, so that a color means the same throughout; else of the step
    shown. Of both runs where there are two views. Inverted cells do not count: they have a color
    of their own. Unchanged where all values are equal.
    """
    limits = _limits(session, every)
    return session if limits is None else set_view(session, color_range=limits)


NO_DISPLACEMENT = "There is no displacement yet: run the case. Until then the roles are shown."


def not_drawable(session: Session) -> str:
    """Return why the view cannot be colored by what is chosen, or ""."""
    what = session.view.color_by
    mesh = session.mesh
    if mesh is not None and what in METRICS and not is_known(mesh, what):
        return (
            f"The {METRICS[what].label} compares neighbouring cells, which stay in the file. The "
            "roles are shown."
        )
    lacking = what == "displacement" and not any(run.frames for run in session.runs)
    return NO_DISPLACEMENT if lacking else ""


def with_drawable_colors(session: Session) -> Session:
    """Return the session to draw: colored by roles where `not_drawable` has a reason."""
    return set_view(session, color_by="role") if not_drawable(session) else session


def usual_range(session: Session) -> str:
    """Return the default color range in words."""
    if session.view.color_by == "displacement":
        return "0 to the largest of all runs"
    low, high = set_view(session, color_range=None).color_range
    return f"{low:g} to {high:g}"


def _limits(session: Session, every: bool) -> tuple[float, float] | None:
    what = session.view.color_by
    if what == "role" or session.mesh is None:
        return None
    lows = []
    highs = []
    for frame in _frames(session, every):
        values = frame.values(what, session.mesh)
        values = values[(frame.quality.status != INVERTED) & np.isfinite(values)]
        if len(values):
            lows.append(float(values.min()))
            highs.append(float(values.max()))
    if not lows or not min(lows) < max(highs):
        return None
    return outwards(min(lows), max(highs))


def _frames(session: Session, every: bool) -> set[StepFrame]:
    """Return the frames that are shown in all views, with ``every`` those of all their steps."""
    shown: set[StepFrame] = set()
    for one in (session, second_view(session)):
        if one.frame is not None:
            shown.add(one.frame)
        if every:
            # Displacements are largest in the last step, and measuring each step takes time.
            far = one.view.color_by == "displacement"
            shown.update((*one.frames[:1], *one.frames[-1:]) if far else one.frames)
    return shown
