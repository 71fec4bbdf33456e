"""Pictures and films of meshes, each by one call: for the library and the commands."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Literal

from slideviz.argument_types import check_types
from slideviz.case.model import Case
from slideviz.errors import CaseError, not_one_of
from slideviz.export import film as films
from slideviz.export import offscreen_renderer
from slideviz.export.offscreen_renderer import PICTURE_SIZE
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality, quality
from slideviz.scene.overview import Zoom
from slideviz.session.changes import show_beside
from slideviz.session.opening import session_of_runs
from slideviz.session.state import UNDEFORMED, Run, StepFrame
from slideviz.solver.deform import Step
from slideviz.terms import QUANTITIES, Quantity


@check_types
def picture(
    path: str | Path,
    mesh: Mesh,
    reference: Mesh | None = None,
    *,
    case: Case | None = None,
    step: Step | None = None,
    rated: Quality | None = None,
    before: Quality | None = None,
    size: tuple[int, int] = PICTURE_SIZE,
    zoom: Zoom = "auto",
    beside: tuple[Case, Step] | Literal["undeformed"] | None = None,
) -> None:
    """Write a picture of a mesh in the colors of its quality, with name and quality as title.

    A 2D mesh is shown whole. Of a 3D mesh, the whole cells behind a plane are shown, which goes
    through the boundary that moved most, along its displacement.

    Parameters
    ----------
    path : str or Path
        The PNG file, or with the ending ``.html`` a web page that can be turned by the mouse; one
        that exists is replaced.
    mesh : Mesh
        What to show.
    reference : Mesh, optional
        The undeformed mesh, with the same cells.
    case : Case, optional
        The case of the run, whose roles of boundaries are used.
    step : Step, optional
        The step of a run that ``mesh`` is of.
    rated, before : Quality, optional
        The quality of the cells, and of those of the reference, if they are known already.
    size : (int, int)
        Width and height in pixels.
    zoom : Detail, "auto", "all" or "view"
        What part of the mesh is seen; "auto" is the whole, unless what moved is tiny in it, "view"
        what the window showed by the keys ``VIEW_...`` of the case, with colors and sections, and
        without a title.
    beside : (Case, Step) or "undeformed", optional
        Another run of the mesh, or the undeformed mesh, drawn beside it.

    Raises
    ------
    SlidevizError
        The size cannot be drawn, there is no OpenGL, or the file cannot be written.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> sv.picture("square.png", square, size=(400, 300))
    """
    case = case or Case()
    metric = case.quality_metric
    measured = quality(mesh, reference=reference, metric=metric) if rated is None else rated
    runs = []
    first = StepFrame(mesh, measured)
    if reference is not None:
        before = quality(reference, metric=metric) if before is None else before
        first = StepFrame(reference, before)
        runs = [Run(1, case, (StepFrame(mesh, measured, step),), "done")]
    if isinstance(beside, tuple):
        other, its = beside
        found = quality(its.mesh, reference=reference, metric=other.quality_metric)
        runs.append(Run(2, other, (StepFrame(its.mesh, found, its),), "done"))
    session = replace(session_of_runs(first, runs), case=case)
    if beside == "undeformed":
        session = show_beside(session, UNDEFORMED)
    offscreen_renderer.picture(session, path, size, zoom)


@check_types
def film(
    path: str | Path,
    mesh: Mesh,
    steps: Iterable[Step],
    *,
    case: Case | None = None,
    color: Quantity = "size-skew",
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    hold: float = 1.5,
    between: int = 0,
    zoom: Zoom = "auto",
    overwrite: bool = False,
) -> None:
    """Write the steps of a run as a film: MP4, GIF or numbered pictures.

    Parameters
    ----------
    path : str or Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    mesh : Mesh
        The undeformed mesh.
    steps : iterable of Step
        The steps, as `slideviz.deform` yields them.
    case : Case, optional
        The case of the run, for its quality metric.
    color : {"size-skew", "size", "skew", "displacement"}
        What the colors say.
    size : (int, int), optional
        Width and height in pixels; by default those of the kind of file.
    fps : float, optional
        Images per second; when left out, ten, or fewer where there are few.
    hold : float
        Seconds that the last image is shown.
    between : int
        Images between two steps: nodes on straight lines, quality of that mesh.
    zoom : Detail, "auto", "all" or "view"
        What part of the mesh is seen, as for `picture`.
    overwrite : bool
        Allow files that exist.

    Raises
    ------
    SlidevizError
        There are no steps, the quantity is unknown, the film cannot be made like that, or the file
        cannot be written.

    Examples
    --------
    >>> import slideviz as sv
    >>> from slideviz.samples.table import write_sample
    >>> files = write_sample("square", "try", 8)
    >>> case, mesh = sv.Case.read("try/square.cfg"), sv.read("try/mesh.su2")
    >>> sv.film("square.gif", mesh, sv.deform(case, mesh), case=case, size=(400, 300))
    """
    if color not in QUANTITIES:
        raise CaseError(f"color: {not_one_of(color, QUANTITIES)}")
    options = films.FilmOptions(size, fps, hold, between)
    films.check_film(Path(path), options, overwrite=overwrite)  # before the work
    case = case or Case()

    def frame(moved: Mesh, step: Step | None = None) -> StepFrame:
        return StepFrame(moved, quality(moved, reference=mesh, metric=case.quality_metric), step)

    run = Run(1, case, tuple(frame(step.mesh, step) for step in steps), "done")
    session = session_of_runs(frame(mesh), [run], color)
    for _ in films.film(session, path, options, zoom=zoom, overwrite=overwrite):
        pass
