"""The job that writes the picture of a section."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slideviz.errors import CaseError
from slideviz.export.titles import pair_names
from slideviz.plots.cells import surroundings
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import (
    SectionInRun,
    SectionStyle,
    require_picture_name,
    section_picture,
)
from slideviz.scene.passages import Period, matrices
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.polygons import CellsInRange
from slideviz.session.jobs import JobProgress, Report, Stopped, raise_if_cancelled
from slideviz.session.panes import shown_views
from slideviz.session.passages import show_passages
from slideviz.session.runs_words import run_words
from slideviz.session.state import Session
from slideviz.terms import quantity_of

_SHOWN = "shown: "
"""Begin of the note about a threshold."""


@dataclass(frozen=True)
class PageFormat:
    """The format of a section's picture."""

    size: tuple[int, int]
    """(int, int): width and maximum height in pixels."""
    dpi: float | None = None
    """Pixels per inch of a picture for paper."""
    title: bool = True
    axes: bool = True
    """`title`, `axes`: whether it has a title, and numbers along its axes."""

    @classmethod
    def of_cm(cls, width: float, height: float, dpi: float = 300.0) -> PageFormat:
        """Return the format of a picture of a width and maximum height in centimetres."""
        return cls((round(width / 2.54 * dpi), round(height / 2.54 * dpi)), dpi)


def save_section(
    path: Path,
    session: Session,
    section: Section,
    paper: PageFormat,
    report: Report,
    stopped: Stopped,
) -> Path:
    """Write the picture of a section as the view shows it: step, colors, neighbouring passages.

    With a comparison, it shows both views. Return the path. Raises CaseError if no mesh is open,
    the section cuts no cell that is shown, the name has a suffix other than a picture's, or the
    file cannot be written.
    """
    if session.frame is None:
        raise CaseError("no mesh is open, so there is no section to draw")
    if session.in_file:
        raise CaseError(
            f"{session.frame.mesh.name} stays in its file; `slideviz section` draws its sections"
        )
    require_picture_name(path)
    report(JobProgress(f"Cutting for {path.name}"))
    views = shown_views(session)
    shown = [_shown(*one, section) for one in zip(views, pair_names(views), strict=True)]
    if not any(one.drawn for one in shown) and shown[0].note:
        words = shown[0].note.removeprefix(_SHOWN)
        raise CaseError(
            f"{section.describe()}: it cuts no cell that is shown ({words}), so there is "
            "nothing to draw; show all cells, or a wider range of them"
        )
    raise_if_cancelled(stopped)
    report(JobProgress(f"Drawing {path.name}"))
    name = session.path.name if session.path is not None else ""
    style = SectionStyle(paper.size, True, "edges" in session.view.drawn, name=name, dpi=paper.dpi)
    style = replace(style, title=paper.title, axes=paper.axes)
    if len(shown) == 1:
        shown = [replace(shown[0], name=frame_words(session), place="")]
    section_picture(shown, section, path, style)
    return path


def _shown(session: Session, name: str, section: Section) -> SectionInRun:
    frame = session.frame
    assert frame is not None
    by = session.view.color_by
    painted = paint(frame.mesh, frame.quality, quantity_of(by), session.mesh)
    painted = replace(painted, color_map=session.view.color_map)
    if by != "role":
        painted = painted.within(*session.color_range)
    around = matrices(session, Period().of(session) if session.view.passages else None)
    every = {0: np.eye(4)} | around
    cutter, points = Cutter.of(frame.mesh), frame.mesh.points
    only = _choice(session, section)
    at = session.view.frame
    return SectionInRun(
        show_passages(cutter, points, section, every, only),
        painted,
        surroundings(cutter, points, every),
        name,
        f"step {min(at, len(session.frames) - 1)}" if at else "",
        "" if only is None else _SHOWN + only.words,
    )


def _choice(session: Session, section: Section) -> CellsInRange | None:
    """Return the cells within the view's threshold; None without one, and for a curve."""
    frame, threshold = session.frame, session.view.threshold
    curve = session.mesh is not None and session.mesh.dim == 2 and not section.whole_cells
    if frame is None or threshold is None or curve:
        return None
    return CellsInRange.of(frame.shown_values(session.view.color_by, session.mesh), threshold)


def frame_words(session: Session) -> str:
    """Return run, step and method of a session in words."""
    run = session.run_shown
    if run is None or session.view.frame == 0:
        return "undeformed"
    step = min(session.view.frame, len(run.frames))
    return f"run {run.number}, {run_words(run)}, step {step}"
