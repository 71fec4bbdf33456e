"""The color range: fitted to the values that are shown, and in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slideviz.mesh.metrics import is_known
from slideviz.mesh.quality import INVERTED
from slideviz.session.changes import set_view, undoable
from slideviz.session.state import Session, outwards, second_view
from slideviz.terms import COLOR_BY, DIFFERENCES, METRICS, Range


@undoable("color range")
def fit_colors(session: Session, every: bool = True) -> Session:
    """Return the session with a color range from the lowest to the highest value.

    With ``every``, of all steps, so that a color means the same throughout; else of the step
    shown. Of both runs where there are two views. Inverted cells do not count: they have a color
    of their own. Unchanged where all values are equal.
    """
    limits = _limits(session, every)
    return session if limits is None else set_view(session, color_range=limits)


NO_SECOND = (
    "There is no second run to take the difference from: View > Compare with shows one beside. "
    "Until then the roles are shown."
)
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
    if what in DIFFERENCES and session.reference is None:
        return f"{session.lacks_cells} The roles are shown." if session.lacks_cells else NO_SECOND
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


def _limits(session: Session, every: bool) -> Range | None:
    what = session.view.color_by
    if what == "role" or session.mesh is None:
        return None
    lows = []
    highs = []
    for one in _states(session, every):
        frame = one.frame
        assert frame is not None
        values = frame.values(what, one.reference)
        values = values[(frame.quality.status != INVERTED) & np.isfinite(values)]
        if len(values):
            lows.append(float(values.min()))
            highs.append(float(values.max()))
    if not lows or not min(lows) < max(highs):
        return None
    most = max(-min(lows), *highs)
    return outwards(-most, most) if COLOR_BY[what].color_map else outwards(min(lows), max(highs))


def _states(session: Session, every: bool) -> Iterator[Session]:
    """Yield the sessions of all views, with ``every`` at all their steps."""
    what = session.view.color_by
    # Differences in the second view are those in the first, or their opposites.
    views = {session} if what in DIFFERENCES else {session, second_view(session)}
    for one in views:
        last = len(one.frames) - 1
        steps = range(last + 1)
        # Displacements are largest in the last step, and measuring each step takes time.
        shown = {0, one.view.frame, last} if what == "displacement" else {*steps}
        yield from (set_view(one, frame=k) for k in (shown if every else {one.view.frame}))
