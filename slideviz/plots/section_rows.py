"""The curves along a section of a 2D mesh: of the undeformed mesh, and of the runs shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from slideviz.mesh.quality import INVERTED
from slideviz.plots.curves import UNDEFORMED, series_of
from slideviz.plots.section_curve import Colors, CurveRow, curve_of, position_label
from slideviz.plots.section_paint import Paint
from slideviz.sections.model import Section
from slideviz.session.changes import show_frame
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import Session
from slideviz.terms import QUANTITIES, Quantity, quantity_of


class CurveRows:
    """Makes the curves of sessions, and caches the undeformed mesh's cuts."""

    def __init__(self) -> None:
        self._first = Cuts()

    def of(self, shown: Sequence[tuple[Session, Cuts]], section: Section) -> tuple[CurveRow, ...]:
        """Return the curve of the undeformed mesh, then one per session, the first session's last.

        A mesh that the section misses has no curve; nor has the undeformed one for displacements.

        Parameters
        ----------
        shown : sequence of (Session, Cuts)
            The session of each view, the first view first, with the view's cached cuts.
        section : Section
        """
        line = _line(section)
        states = [(session, cuts) for session, cuts in reversed(shown) if session.view.frame]
        first = shown[0][0]
        if first.first is not None and what_of(first) != "displacement":
            states.insert(0, (show_frame(first, 0), self._first))
        found = (self._row(session, cuts, line) for session, cuts in states)
        return tuple(row for row in found if row is not None)

    def _row(self, session: Session, cuts: Cuts, line: Section) -> CurveRow | None:
        frame, run = session.frame, session.run_shown
        assert frame is not None
        lines = cuts.of(frame.mesh, line)
        if not len(lines):
            return None
        values = frame.values(what_of(session), session.mesh)
        curve = curve_of(lines, line, values, frame.quality.status == INVERTED)
        if run is None or session.view.frame == 0:
            return CurveRow("undeformed", curve, UNDEFORMED)
        return CurveRow(run.label, curve, series_of(run))


def what_of(session: Session) -> Quantity:
    """Return the quantity of the curve: that of the colors, or the quality for roles."""
    return quantity_of(session.view.color_by)


def labels_of(session: Session, section: Section) -> tuple[str, str]:
    """Return the labels of both axes of the curves."""
    return position_label(section).full, QUANTITIES[what_of(session)].axis


def colors_of(session: Session) -> Colors:
    """Return the colors of the areas below a curve: those of the view."""
    limits = session.color_range if session.view.color_by != "role" else (0.0, 1.0)
    return Colors(session.view.color_map, limits)


def facts_of(session: Session, cuts: Cuts, section: Section) -> str:
    """Return a sentence with the number of cut cells, their min, mean and inverted ones."""
    frame = session.frame
    assert frame is not None
    lines = cuts.of(frame.mesh, _line(section))
    if not len(lines):
        return "it cuts no cell"
    what = what_of(session)
    inverted = frame.quality.status == INVERTED
    values = frame.values(what, session.mesh)
    return Paint(what, values, inverted, (0.0, 1.0)).sentence(lines.cell_ids)


def _line(section: Section) -> Section:
    return replace(section, whole=False)
