"""Pictures of sections, by one call or of the window's session, drawn by matplotlib without VTK."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import check_types
from slideviz.case.model import Case
from slideviz.errors import CaseError, not_one_of
from slideviz.export.titles import pair_names
from slideviz.formats.openfoam_paths import shown_name
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import Quality, quality
from slideviz.plots.cells import surroundings
from slideviz.plots.section_paint import paint, shown_paint
from slideviz.plots.section_picture import (
    SectionInRun,
    SectionStyle,
    require_picture_name,
    section_picture,
)
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.polygons import CellsInRange
from slideviz.sections.span import ConstantSpan, between_walls, find_walls
from slideviz.session.jobs import Job
from slideviz.session.panes import shown_views
from slideviz.session.passages import find_periods, matrices, period_of, show_passages
from slideviz.session.runs_words import run_words
from slideviz.session.state import Session
from slideviz.terms import COLOR_MAPS, NO_REFERENCE, ColorMap, Quantity


def save_section(
    path: Path,
    session: Session,
    section: Section,
    paper: SectionStyle,
    job: Job,
) -> Path:
    """Write the picture of a section as the view shows it: step, colors, neighbouring passages.

    With a comparison, it shows both views. ``paper``: its size, and whether it has title and axes.
    Return the path. Raises CaseError if no mesh is open,
    the section cuts no cell that is shown, the name has a suffix other than a picture's, or the
    file cannot be written.
    """
    if session.frame is None:
        raise CaseError("no mesh is open, so there is no section to draw")
    if session.lacks_cells:
        raise CaseError(
            f"{session.frame.mesh.name} stays in its file; `slideviz section` draws its sections"
        )
    require_picture_name(path)
    job.progress(f"Cutting for {path.name}")
    views = shown_views(session)
    shown = [_shown(*one, section) for one in zip(views, pair_names(views), strict=True)]
    only = _choice(views[0], section)
    if only is not None and not any(one.drawn for one in shown):
        raise CaseError(
            f"{section.describe()}: it cuts no cell that is shown ({only.words}), so there is "
            "nothing to draw; show all cells, or a wider range of them"
        )
    job.going_on()
    job.progress(f"Drawing {path.name}")
    name = shown_name(session.path) if session.path is not None else ""
    style = replace(paper, trimmed=True, edges="edges" in session.view.drawn, name=name)
    if len(shown) == 1:
        shown = [replace(shown[0], name=frame_words(session), place="")]
    section_picture(shown, section, path, style)
    return path


def _shown(session: Session, name: str, section: Section) -> SectionInRun:
    frame = session.shown_frame
    around = matrices(session, period_of(session) if session.view.passages else None)
    every = {0: np.eye(4)} | around
    cutter = Cutter(frame.mesh)
    points = frame.mesh.points
    only = _choice(session, section)
    at = session.view.frame
    return SectionInRun(
        show_passages(cutter, points, section, every, only),
        shown_paint(session),
        surroundings(cutter, points, every),
        name,
        f"step {min(at, len(session.frames) - 1)}" if at else "",
        "" if only is None else f"shown: {only.words}",
    )


def _choice(session: Session, section: Section) -> CellsInRange | None:
    """Return the cells within the view's threshold; None without one, and for a curve."""
    frame = session.frame
    threshold = session.view.threshold
    curve = session.mesh is not None and session.mesh.dim == 2 and not section.whole_cells
    if frame is None or threshold is None or curve:
        return None
    return CellsInRange.of(frame.shown_values(session.view.color_by, session.reference), threshold)


def frame_words(session: Session) -> str:
    """Return run, step and method of a session in words."""
    run = session.run_shown
    if run is None or session.view.frame == 0:
        return "undeformed"
    step = min(session.view.frame, len(run.frames))
    return f"run {run.number}, {run_words(run)}, step {step}"


@check_types
def section(
    path: str | Path,
    mesh: Mesh,
    at: Section | None = None,
    reference: Mesh | None = None,
    *,
    span: float | None = None,
    between: tuple[str, str] | None = None,
    case: Case | None = None,
    rated: Quality | None = None,
    color: Quantity = "size-skew",
    color_range: tuple[float, float] | None = None,
    color_map: ColorMap = "viridis",
    passages: Mapping[int, FloatArray] | None = None,
    outer: FloatArray | None = None,
    style: SectionStyle | None = None,
) -> SectionInRun:
    """Write a picture of a section of a mesh; return what it shows.

    Parameters
    ----------
    path : str or Path
        The picture: .png, .svg or .pdf; one that exists is replaced.
    mesh : Mesh
        What to cut.
    at : Section, optional
        Where: a plane, cylinder or cone.
    reference : Mesh, optional
        The undeformed mesh, with the same cells; needed for displacements.
    span : float, optional
        Instead of ``at``: the surface of constant span, between hub (0) and shroud (1) of the
        undeformed mesh.
    between : (str, str), optional
        Hub and shroud; by default SPAN of the case, or what their names say.
    case : Case, optional
        The case with the axis of the span, and the periodic boundaries.
    rated : Quality, optional
        The quality of the cells, if it is known already.
    color : {"size-skew", "size", "skew", "displacement"}
        What the colors say.
    color_range : (float, float), optional
        Ends of the color bar.
    color_map : {"viridis", "cividis", "plasma", "inferno", "gray"}
        The color map, which color-blind people can read.
    passages : mapping of int to (4, 4), optional
        The transformation of each passage to draw, by number; only the mesh itself (0) when left
        out.
    outer : (n, d), optional
        Points with the extent of the mesh, for messages, where ``mesh`` is only a part of it.
    style : SectionStyle, optional
        Size and parts of the picture.

    Returns
    -------
    SectionInRun
        Its ``ids`` (k,) are the numbers of the cells that are cut, ``paint`` has their values.

    Raises
    ------
    CaseError
        The section misses the mesh, the file has another ending, or a quantity or color map is
        unknown.
    SlidevizError
        The file cannot be written.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> line = sv.Section("plane", (0.5, 0.0, 0.0), (1.0, 0.0, 0.0))
    >>> sv.section("middle.svg", square, line).ids
    array([0])
    """
    require_picture_name(Path(path))
    if (at is None) == (span is None):
        raise CaseError("give either a section or a span, e.g. section(path, mesh, span=0.5)")
    if at is None:
        base = reference or mesh
        walls = find_walls(base, case, find_periods(base, case), between)
        of = walls.field
        at = between_walls(ConstantSpan("span", of.origin, of.axis, span=span or 0.0), walls)
    if color_map not in COLOR_MAPS:
        raise CaseError(f"color_map: {not_one_of(color_map, COLOR_MAPS)}")
    measured = quality(mesh, reference=reference) if rated is None else rated
    matrices = {0: np.eye(4)} if passages is None else passages
    painted = replace(paint(mesh, measured, color, reference), color_map=color_map)
    cutter = Cutter(mesh)
    pieces = show_passages(cutter, mesh.points, at, matrices)
    note = (
        "" if reference is not None or painted.label not in ("size-skew", "size") else NO_REFERENCE
    )
    around = surroundings(cutter, mesh.points, matrices)
    shown = SectionInRun(pieces, painted, around, note=note)
    if not shown.drawn:
        why = at.miss(mesh.points[mesh.cells.nodes] if outer is None else outer)
        raise CaseError(f"{mesh.name}: the {at.describe(mesh.dim)} {why}")
    if color_range:
        shown = replace(shown, paint=painted.within(*color_range))
    elif painted.unbounded:
        shown = replace(shown, paint=painted.up_to(shown.ids))
    style = style or SectionStyle(trimmed=True, name=Path(mesh.name).name)
    section_picture([shown], at, path, style)
    return shown
