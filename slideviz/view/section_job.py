"""The picture of a section as a job beside the window."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.errors import CaseError
from slideviz.view.copies import show_passages
from slideviz.view.jobs import Doing, Report, Stopped, require_going
from slideviz.view.layer_copies import Period, matrices
from slideviz.view.section import Section
from slideviz.view.section_cut import Cutter
from slideviz.view.section_paint import PAINT_BY, PaintBy, paint
from slideviz.view.section_picture import SectionStyle, require_picture_name, section_picture
from slideviz.view.state import COLOUR_BY, Session


def save_section(
    path: Path, session: Session, section: Section, report: Report, stopped: Stopped
) -> Path:
    """Write the picture of a section as the view shows it: step, colours, neighbours.

    Raises
    ------
    CaseError
        No mesh is open, the section cuts no cell, the name has another end than a picture's, or
        the file cannot be written.
    """
    frame = session.frame
    if frame is None:
        raise CaseError("no mesh is open, so there is no section to draw")
    require_picture_name(path)
    report(Doing(f"Cutting for {path.name}"))
    word = COLOUR_BY[session.view.colour_by]
    by: PaintBy = next((one for one in PAINT_BY if one == word), "size-skew")
    painted = paint(frame.mesh, frame.quality, by, session.mesh)
    if by == word:
        painted = painted.within(*session.colour_range)
    around = matrices(session, Period().of(session) if session.view.copies else None)
    pieces = show_passages(
        Cutter.of(frame.mesh), frame.mesh.points, section, {0: np.eye(4)} | around
    )
    require_going(stopped)
    report(Doing(f"Drawing {path.name}"))
    name = session.path.name if session.path is not None else ""
    style = SectionStyle(edges=session.view.edges, name=name)
    section_picture(pieces, section, painted, path, style)
    return path
