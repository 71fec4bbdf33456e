"""The long jobs of the window as plain functions: open, compute, check, save.

The last argument of a long job is its `Job`: it calls ``job.report(item)``, from any thread, with
progress and results, and raises `slideviz.errors.Cancelled` soon after ``job.stopped()`` returns
True. Nothing here draws.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from slideviz.argument_types import frozen, record
from slideviz.case.check import check_case
from slideviz.case.limits import (
    NUMBERS,
    Limit,
    MeasuredMesh,
    check_case_limits,
    check_limits,
    require_streamed,
)
from slideviz.case.model import Case
from slideviz.case.motions.span import prepare_span
from slideviz.case.words import counted
from slideviz.case.zone_cases import each_zone, with_marker_names
from slideviz.design.deformed_wheel import write_wheel
from slideviz.design.live_fields import LiveFields
from slideviz.design.sweeps.sweep import sweep
from slideviz.errors import Cancelled, CaseError, DeformError, MeshError, Message, SlidevizError
from slideviz.formats.files import read, write
from slideviz.formats.openfoam_paths import shown_name, stem_of
from slideviz.formats.source import unreadable
from slideviz.formats.table import format_for, holds_quality
from slideviz.mesh.elements import CELL_NAMES
from slideviz.mesh.margin import step_safety
from slideviz.mesh.model import FloatArray, Mesh, Skin
from slideviz.mesh.periodic import find_pairs
from slideviz.mesh.quality import Quality, quality
from slideviz.mesh.surfaces import Surface, coarse_surfaces, enclosing_of, find_surfaces
from slideviz.mesh.walls import Walls, walls
from slideviz.samples.table import write_sample
from slideviz.sections.span import find_walls
from slideviz.session.design_table import DesignTable
from slideviz.session.inspect import WORST
from slideviz.session.large import first_frame, frame_of, is_large, read_boundary
from slideviz.session.motions import Ghosts
from slideviz.session.opening import open_mesh
from slideviz.session.passages import find_periods
from slideviz.session.run_messages import with_field_labels
from slideviz.session.saving import Camera
from slideviz.session.session_file import (
    ENDING,
    StoredSession,
    digest,
    read_case_of,
    read_picture,
    read_session,
    stored_session,
    write_session,
)
from slideviz.session.state import CheckedLimits, Preview, Run, Session, StepFrame
from slideviz.solver.deform import deform
from slideviz.solver.interface_motion import check_motions
from slideviz.solver.prepare import referenced
from slideviz.solver.repair_stage import mended_frame
from slideviz.solver.rims import rims_key
from slideviz.system.cleanup import private_folder
from slideviz.system.csv_table import write_csv
from slideviz.system.file_checks import require_regular_file
from slideviz.terms import CELL_STATES, PHASES

if TYPE_CHECKING:
    from slideviz.design.deformed_wheel import WheelQuality
    from slideviz.solver.steps import Progress, Step


@frozen
class JobProgress:
    """Progress of a job: words, and the fraction done, 0 to 1, or None where it is unknown."""

    text: str
    fraction: float | None = None


@frozen
class Job:
    """What a job has of those who wait for it; by default nobody listens, and nobody stops it."""

    report: Callable[[object], None] = lambda _: None
    """Takes `JobProgress` and results, from any thread."""
    stopped: Callable[[], bool] = lambda: False
    """Returns whether it is to stop."""

    def progress(self, text: str, fraction: float | None = None) -> None:
        """Report progress."""
        self.report(JobProgress(text, fraction))

    def going_on(self, *_: object) -> None:
        """Raise Cancelled if the job is to stop, whatever the progress is."""
        if self.stopped():
            raise Cancelled("stopped on request")

    def tick(self, text: str) -> Callable[[float], None]:
        """Return a function that reports the fraction done, or raises Cancelled as `going_on`."""

        def tick(done: float) -> None:
            self.going_on()
            self.progress(text, done)

        return tick


_ROWS = 5_000  # cells that are written before the job looks again whether it is to stop


def save_quality(path: Path, frame: StepFrame, job: Job) -> Path:
    """Write a CSV file with number, type, qualities, status and middle of every cell.

    Raises SlidevizError if the file cannot be written.
    """
    mesh = frame.mesh
    found = frame.quality
    cells = frame.mesh.cells
    middles = cells.means(mesh.points)
    measured = found.size, found.skew, found.values, found.status, middles
    columns = [mesh.file_types, *(column[found.file_rows] for column in measured)]
    tick = job.tick(f"Writing {path.name}")

    def rows() -> Iterator[Sequence[object]]:
        yield "cell", "type", "size", "skew", "size_skew", "status", *"xyz"[: mesh.dim]
        for start in range(0, len(columns[0]), _ROWS):
            tick(start / len(columns[0]))
            part = slice(start, start + _ROWS)
            lists = zip(*(column[part].tolist() for column in columns), strict=True)
            for cell, (kind, *measured, status, middle) in enumerate(lists, start):
                yield cell, CELL_NAMES[kind], *measured, CELL_STATES[status], *middle

    write_csv(path, rows())
    return path


def step_paths(path: Path, count: int) -> list[Path]:
    """Return the files of ``count`` steps: the name of ``path`` with a number before its ending.

    Only ``path`` for VTKHDF and the like, where all steps are in one file.
    """
    if format_for(path).series:
        return [path]
    width = len(str(count))
    stem = stem_of(path)
    ending = path.name[len(stem) :]
    return [path.with_name(f"{stem}_{k:0{width}d}{ending}") for k in range(1, count + 1)]


def save_steps(
    path: Path,
    frames: Sequence[StepFrame],
    job: Job,
    first: StepFrame | None = None,
) -> list[Path]:
    """Write the mesh of every step, whole files only, and return their paths.

    A VTKHDF file has all steps, with quality and displacement, and before them the undeformed mesh
    ``first``. Raises SlidevizError
    if a file cannot be written; those before it stay. ``path``: the name to put numbers into (see
    `step_paths`). ``frames``: the steps, without the undeformed mesh.
    """
    paths = step_paths(path, len(frames))
    if format_for(path).series:
        tick = job.tick(f"Writing {path.name}")
        every = (*filter(None, [first]), *frames)
        start = every[0].mesh
        with format_for(path).function("series")(path, start) as series:
            for k, frame in enumerate(every):
                tick(k / len(every))
                moved = {"displacement": frame.mesh.points - start.points}
                series.add(frame.mesh.points, cell_values(frame), moved)
        return paths
    for k, (target, frame) in enumerate(zip(paths, frames, strict=True)):
        job.tick(f"Writing {target.name}")(k / len(frames))
        save_mesh(target, frame, False, Job(stopped=job.stopped))
    return paths


def intersection_key(session: Session) -> tuple[object, ...]:
    """Return the values on which the check depends: its result holds while they are the same."""
    case = session.case
    around = case.around_span, case.periodic, case.interfaces
    return session.mesh, case.motions, around, case.sliding, case.rims, case.feature_angle_deg


def find_intersection(case: Case, mesh: Mesh, job: Job) -> tuple[str, Message | None]:
    """Return two messages on motions: on boundaries that cross each other, mostly.

    The first keeps a run from starting: a moved boundary crosses another one, or a displacement
    file has mistakes. The second does not: what moves crosses itself, or a motion hardly does what
    is meant. There are none where the case has other problems, which are reported elsewhere.
    """
    files = [path for motion in case.motions for path in motion.files]
    prepare_spans(case, mesh)
    try:
        ready = case.motions and not check_case(case, mesh) and not job.stopped()
        if not ready or not all(path.is_file() for path in files):
            return "", None
        found, folded = check_motions(case, mesh)
    except SlidevizError as error:
        first, *others = error.messages
        said = first.printed(lambda path: path.name)
        return (f"{said} ({len(others)} more)." if others else f"{said}."), None
    message = with_field_labels(found[0].upper() + found[1:] + ".") if found else ""
    return message, folded


def prepare_spans(case: Case, mesh: Mesh) -> None:
    """Compute what the first motion and the first section over the span need: it takes a second."""
    with suppress(SlidevizError):
        for one, zone in each_zone(case, mesh):
            prepare_span(one, zone)
        if mesh.dim == 3 and case.markers_with("periodic"):
            for channel in find_walls(mesh, case, find_periods(mesh, case)).channels:
                _ = channel.curves


def set_intersection(
    session: Session, found: tuple[str, Message | None], key: tuple[object, ...]
) -> Session:
    """Return the session with the result of the check for ``key``, unless it is out of date."""
    case = session.case
    laid: tuple[object, ...] = tuple(one for one in case.motions if one.takes_time)
    if case.rims == "slide":
        laid = *laid, rims_key(case)
    same = (session.intersection, session.folding, session.laid) == (*found, laid)
    if same or intersection_key(session) != key:
        return session
    return replace(session, intersection=found[0], folding=found[1], laid=laid)


def forget_intersection(session: Session, key: tuple[object, ...]) -> Session:
    """Return the session without the result of the check, unless it is of ``key``, the present one.

    A result that is out of date must not keep a run from starting.
    """
    known = session.intersection or session.folding
    if not known or intersection_key(session) == key:
        return session
    return replace(session, intersection="", folding=None)


@record
class Opened:
    """The result of `open_file`: the session, and the boundaries ready to be drawn.

    ``has_view`` is whether the case file has a view, ``camera`` the camera in it. ``ghosts`` are
    the moved boundaries, their displacement files read; ``coarse`` the boundaries of a large mesh
    with fewer facets. ``content`` is what a session file has besides, ``remark`` what the user
    should know of it.
    """

    session: Session
    surfaces: tuple[Surface, ...]
    ghosts: Ghosts
    has_view: bool = False
    camera: Camera | None = None
    coarse: tuple[Surface, ...] = ()
    content: StoredSession | None = None
    remark: str = ""


def require_openable(path: Path) -> None:
    """Raise SlidevizError where a path is not an ordinary file, before any question about it."""
    try:
        require_regular_file(path, MeshError)
    except (OSError, ValueError) as problem:
        raise unreadable(path, problem) from problem


def open_file(
    path: Path,
    zone: int | None,
    job: Job,
    mesh_file: Path | None = None,
    unpacked: Path | None = None,
    case: Case | None = None,
) -> Opened:
    """Return a mesh, or the case or session in a file or picture with its mesh, ready to be shown.

    ``mesh_file``: the mesh of a session, where it is neither beside it nor where it was.
    ``unpacked``: the folder for copies of files that a session has; by default its own.
    ``case``: that of the mesh at ``path``. Raises SlidevizError if the file cannot be used; the
    message says what and where.
    """
    mesh_path = path
    ending = path.suffix.lower()
    moved = dict[Path, Path]()
    if ending in (".cfg", ENDING):
        job.progress(f"Reading {shown_name(path)}")
    if ending == ENDING:
        case, moved = read_case_of(path, unpacked or path.parent, mesh_file)
    elif ending == ".png":
        case = read_picture(path, mesh_file)
    elif ending == ".cfg":
        case = Case.read(path)
    if case is not None:
        if case.mesh_file is None:
            raise CaseError(f"{path}: the case names no mesh; add a line MESH_FILENAME= FILE")
        mesh_path = case.mesh_file
        zone = case.zone if zone is None else zone
    job.progress(f"Reading {shown_name(mesh_path)}")
    reading = job.tick(f"Reading {shown_name(mesh_path)}")
    kind = case.mesh_format if case is not None else None
    if kind != "su2" and is_large(mesh_path, zone):
        mesh = read_boundary(mesh_path, zone, reading)
    else:
        mesh = read(mesh_path, zone=zone, progress=reading, file_format=kind)
    opened = prepare(mesh, mesh_path, case, job)
    if ending != ENDING:
        return opened
    session = opened.session
    mesh = session.opened_mesh  # with the reference of the case
    content = read_session(path, session.first, moved)
    runs = [_restored(run, mesh, job) for run in content.runs]
    remark = ""
    if content.shown is not None and content.mesh != digest(mesh):
        remark = f"{mesh_path} has changed since the session was saved, so its runs are left out."
    return replace(opened, session=content.put_into(session, runs), content=content, remark=remark)


def _restored(run: Run, mesh: Mesh, job: Job) -> Run:
    """Return a run of a session file, with the quality of its steps."""
    tick = job.tick(f"Run {run.number}: {PHASES['quality'].label}")
    frames = []
    for k, one in enumerate(run.frames):
        tick(k / len(run.frames))
        step = one.step
        if step is not None:
            limits = run.case.limits if step.index == step.total else ()
            measured = quality(step.mesh, mesh, run.case.quality_metric)
            frame = _frame_of(step, measured, run.case, mesh, limits)
            frames.append(replace(frame, label=one.label))
    return replace(run, frames=tuple(frames))


def save_session(
    path: Path,
    session: Session,
    designs: tuple[DesignTable, Case | None],
    camera: Camera | None,
    copied: Sequence[Path],
    job: Job,
) -> Path:
    """Write a session file with copies of some files (`session_file`), and return its path.

    ``designs``: their table, and the case of its results.
    """
    job.progress(f"Writing {path.name}")
    runs = () if session.lacks_cells else session.runs
    content = stored_session(session, *designs, runs)
    write_session(path, session, content, camera, copied, job.going_on)
    return path


def prepare(mesh: Mesh, path: Path | None, case: Case | None, job: Job) -> Opened:
    """Return a mesh just read, ready to be shown: its boundaries, periodic pairs and quality."""
    if case is not None:
        mesh = referenced(case, mesh)
        case = with_marker_names(case, mesh)
    job.going_on()
    job.progress("Finding the boundaries")
    surfaces = find_surfaces(mesh)
    job.going_on()
    job.progress("Looking for periodic boundaries")
    pairs = find_pairs(mesh, going_on=job.going_on) if mesh.markers else ()
    job.progress("Measuring the cells")
    metric = case.quality_metric if case is not None else "knupp"
    if not isinstance(mesh, Skin):
        measured = quality(mesh, mesh.reference, metric, job.going_on)
        periodic = {name for pair in pairs for name in (pair.first, pair.second)}
        names = [name for name in mesh.marker_names if name not in periodic]
        first = StepFrame(mesh, measured, walls=_walls(mesh, mesh, names))
    else:
        first = first_frame(mesh, metric, job.tick("Measuring the cells"))
    job.going_on()
    _precompute(first)
    session = open_mesh(first, path, pairs, case)
    enclosing_of(mesh, surfaces)
    with suppress(SlidevizError):  # said beside the Run button
        find_periods(mesh, session.case, pairs)
    ghosts = Ghosts(mesh)
    ghosts.moved(session.case, wait=True)
    coarse = coarse_surfaces(surfaces, mesh.points)
    view = {} if case is None else case.view
    return Opened(session, surfaces, ghosts, bool(view), view.get("VIEW_CAMERA"), coarse)


def _precompute(frame: StepFrame) -> None:
    """Compute cached properties of a frame that drawing needs: in this thread, as it takes time."""
    mesh = frame.mesh
    measured = frame.quality
    _ = mesh.bounds, mesh.extent, mesh.cells.nodes, mesh.cells.by_type
    _ = measured.min, measured.mean, measured.inverted, measured.cells


def _walls(mesh: Mesh, undeformed: Mesh, names: Sequence[str]) -> Walls | None:
    """Return the layers at boundaries; None where a boundary is not a side of the cells."""
    try:
        return walls(mesh, undeformed).of(names)  # of others where roles change
    except MeshError:
        return None


def make_live_fields(case: Case, mesh: Mesh, job: Job) -> LiveFields | None:
    """Return the live fields of a case; None where there can be none."""
    try:
        return LiveFields.of(case, mesh, job.going_on)
    except (CaseError, DeformError, MeshError):
        return None


def make_preview(
    fields: LiveFields, case: Case, run: Run | None, job: Job
) -> tuple[LiveFields, Preview | None]:
    """Return the preview of a case, and its fields, which begin at ``run`` if that is given.

    There is none where the fields are of other settings.
    """
    mesh = fields.mesh
    with suppress(CaseError):
        if run is not None and run.last is not None and run.last.mesh.points is not fields.start:
            fields = fields.after(run.case, run.last.mesh.points)
        points = fields.moved(case)
        if points is not None:
            now = mesh.with_points(points)
            frame = StepFrame(now, quality(now, mesh, case.quality_metric, job.going_on))
            _precompute(frame)
            return fields, Preview(case, frame, step_safety(mesh, now, mesh))
    return fields, None


def compute(case: Case, mesh: Mesh, job: Job) -> None:
    """Deform the mesh; report every step as a `StepFrame`, and the progress as `JobProgress`."""
    furthest = 0.0

    def progress(now: Progress) -> None:
        nonlocal furthest
        job.going_on()
        # Sliding has its phases more than once in a step; a bar must not run back.
        furthest = max(furthest, overall(now))
        phase = PHASES[now.phase].label + now.of_zone
        if case.steps:
            job.progress(f"Step {now.step} of {now.total}: {phase}", furthest)
        elif now.phase == "classify":
            job.progress(f"Automatic steps: {phase}")
        else:
            # It is unknown how many numbers of steps will be tried, and so is the fraction.
            tried = f"{now.total} step{'s' if now.total > 1 else ''}"
            job.progress(f"Trying {tried}: step {now.step}, {phase}")

    unfinished = True

    def going_on() -> None:
        # The last step is not dropped, even if the job is asked to stop.
        if unfinished:
            job.going_on()

    for step in deform(case, mesh, progress=progress, certify=True):
        unfinished = step.index < step.total
        job.progress(f"Step {step.index} of {step.total}: quality", step.index / step.total)
        measured = quality(step.mesh, mesh, case.quality_metric, going_on)
        job.report(_frame_of(step, measured, case, mesh, () if unfinished else case.limits))
        going_on()


def compute_designs(cases: Mapping[int, Case], mesh: Mesh, job: Job) -> None:
    """Deform the mesh for designs, by number; report the last step of each as a `StepFrame`.

    They are numbered like the steps of one run.
    """
    total = len(cases)
    for k, (number, case) in enumerate(cases.items(), start=1):
        job.progress(f"Design {number}, {k} of {total}", (k - 1) / total)
        try:
            *_, step = deform(case, mesh, progress=job.going_on)
        except (CaseError, DeformError) as problem:
            raise SlidevizError(*problem.within(f"design {number}")) from problem
        step = replace(step, index=k, total=total)
        measured = quality(step.mesh, mesh, case.quality_metric)
        frame = _frame_of(step, measured, case, mesh, case.limits)
        job.report(replace(frame, label=f"design {number} of {total}"))


def repair(case: Case, mesh: Mesh, frames: Sequence[StepFrame], job: Job) -> None:
    """Mend the last of some frames; report all of them, that one mended.

    ``mesh`` is the undeformed mesh; with its frame alone, that is mended, and all moving boundaries
    stay.
    """
    *earlier, last = frames
    tick = job.tick(f"Repair: {PHASES['repair'].label}")
    step = mended_frame(case, mesh, last.step, lambda now: tick(now.fraction))
    if step.safe is not None:  # the last straight way now ends at the mended mesh
        before = mesh
        done = 0.0
        if earlier and earlier[-1].step is not None:
            before = earlier[-1].mesh
            done = earlier[-1].step.part
        safe = step_safety(before, step.mesh, mesh, (done, step.part), step.index)
        step = replace(step, safe=safe)
    for frame in earlier:
        job.report(frame)
    measured = quality(step.mesh, None if last.step is None else mesh, case.quality_metric)
    job.report(_frame_of(step, measured, case, mesh, case.limits))


def _frame_of(
    step: Step, measured: Quality, case: Case, mesh: Mesh, limits: tuple[Limit, ...]
) -> StepFrame:
    """Return the frame of a step, with what views ask for computed, and limits checked."""
    layers = _walls(step.mesh, mesh, case.walls(mesh.marker_names))
    frame = StepFrame(step.mesh, measured, step, walls=layers)
    if limits:
        with suppress(SlidevizError):  # the panel of limits says what is wrong
            frame = replace(frame, limits=check_case_limits(case, measured, step.mesh, mesh))
    _precompute(frame)
    return frame


def compute_streamed(case: Case, first: StepFrame, output: Path, job: Job) -> None:
    """Deform a mesh from file to file; report the progress, and the last step as a `StepFrame`.

    ``first`` is the undeformed frame, of the boundary. Raises Cancelled if it was stopped; a file
    that was at ``output`` is as before.
    """
    # Late: streaming takes 0.2 s.
    from slideviz.streaming.run import stream

    def progress(now: Progress) -> None:
        phase = PHASES[now.phase].label + now.of_zone
        job.tick(f"From file to file: {phase}")(overall(now))

    skin = first.mesh
    done = stream(case.change(mesh_file=skin.source), output, report=progress, worst=WORST)
    step = done.steps[-1]
    now = skin.with_points(step.mesh.points)
    frame = frame_of(now, skin, output, done.quality.totals, case.quality_metric)
    limits = check_limits(case.limits, MeasuredMesh(frame.quality))
    job.report(replace(frame, step=replace(step, mesh=now, safe=done.safe), limits=limits))


_STARTS = {"classify": 0.0, "solve": 0.1, "evaluate": 0.5, "project": 0.7}


def overall(now: Progress) -> float:
    """Return roughly the fraction of a run that is done."""
    start = _STARTS.get(now.phase, 0.9)
    end = min((value for value in _STARTS.values() if value > start), default=0.95)
    return float((now.step - 1 + (start + now.fraction * (end - start))) / now.total)


def save_mesh(
    path: Path,
    frame: StepFrame,
    overwrite: bool,
    job: Job,
    base: Mesh | None = None,
) -> Path:
    """Write the mesh of a frame, with its quality where the format has values of cells.

    With the undeformed mesh ``base``, the displacement is written, too. Raises Cancelled if it was
    stopped; what was at ``path`` is as before.
    """
    job.progress(f"Writing {path.name}")
    data = cell_values(frame) if holds_quality(path) else None
    write(path, frame.mesh, overwrite, data, base, job.going_on)
    return path


def save_wheel(
    path: Path,
    case: Case,
    mesh: Mesh,
    frame: StepFrame,
    passages: int | Literal["all"],
    numbered: bool,
    job: Job,
) -> WheelQuality:
    """Write the wheel of the mesh of a frame, and return its quality; ``mesh`` is undeformed.

    Other parameters and errors as of `slideviz.design.deformed_wheel.wheel`.
    """
    tick = job.tick(f"Writing {path.name}")
    moved = [frame.mesh.points]
    return write_wheel(
        path, [case], mesh, moved, passages, numbered, lambda now: tick(now.fraction)
    )


def cell_values(frame: StepFrame) -> dict[str, FloatArray]:
    """Return the quality of the cells of a frame by name, each (m,)."""
    measured = frame.quality
    return {"size_skew": measured.values, "size": measured.size, "skew": measured.skew}


SIZES = {"stator": 20_000}
"""Sizes with which large samples are opened where none is given, to open quickly."""


def open_sample(name: str, folder: Path, job: Job, size: int | None = None) -> Opened:
    """Return a sample case, written into a folder of its own and ready to be shown.

    ``size`` as of ``slideviz.samples.table.sample``; without one, not larger than ``SIZES``. Raises
    SlidevizError if there is no such sample, or it cannot be written.
    """
    job.progress(f"Making the sample {name}")
    with suppress(OSError):  # writing says why
        private_folder(folder)
    place = folder / (name if size is None else f"{name}-{size}")
    written = write_sample(name, place, size or SIZES.get(name), overwrite=True)
    job.going_on()
    case = next(path for path in written if path.suffix == ".cfg")
    return open_file(case, None, job)


def check_frame(frame: StepFrame, undeformed: Mesh, case: Case, _job: Job) -> CheckedLimits:
    """Return the limits of a case, checked on a frame."""
    if frame.extra is None:
        try:
            results = check_case_limits(case, frame.quality, frame.mesh, frame.base or undeformed)
            return CheckedLimits(frame, case.limits, results)
        except SlidevizError as error:
            return CheckedLimits(frame, case.limits, (), str(error))
    joined = Quality.joined([frame.quality, frame.extra.quality])  # numbered as in the frame
    measured = MeasuredMesh(replace(joined, of_mesh=frame.quality.totals))
    known = tuple(limit for limit in case.limits if NUMBERS[limit.name].streamed)
    problem = ""
    try:
        require_streamed(case.limits)
    except SlidevizError as error:
        problem = str(error)
    return CheckedLimits(frame, case.limits, check_limits(known, measured), problem)


def run_designs(case: Case, mesh: Mesh, table: DesignTable, job: Job) -> None:
    """Run designs without a result; report each `DesignRow`, and the progress as `JobProgress`.

    Raises SlidevizError if the table has mistakes, or no process can be started.
    """
    total = len(table.rows)
    left = [at for at in range(1, total + 1) if at not in table.results]
    wanted = [design for at, design in enumerate(table.designs(), start=1) if at in set(left)]
    job.progress(f"Starting with {counted(len(left), 'design')}")
    begin = time.monotonic()
    rows = sweep(case, wanted, mesh=mesh, going_on=job.going_on)
    for done, row in enumerate(rows, start=1):
        job.report(replace(row, design=left[row.design - 1]))
        seconds = (time.monotonic() - begin) / done * (len(left) - done)
        words = f"{total - len(left) + done} of {total}, {seconds:.0f} s left"
        job.progress(words, done / len(left))
