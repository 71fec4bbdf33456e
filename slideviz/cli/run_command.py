"""``slideviz run``: deforms a mesh as a case file says."""

from __future__ import annotations

import re
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from numpy.typing import NDArray

from slideviz import deform, quality, walls, write
from slideviz.case.model import Case
from slideviz.case.zone_cases import with_marker_names
from slideviz.cli.mesh_source import read_case, read_mesh, require_mesh_file
from slideviz.cli.output_paths import OutputPath, qualities_path, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import (
    CELLS,
    LISTED,
    QUALITY_BYTES,
    folded_cells,
    metrics_report,
    report_outcome,
    run_report,
    write_qualities,
)
from slideviz.cli.terminal import say
from slideviz.errors import CaseError
from slideviz.formats.files import metric_data, quality_data
from slideviz.formats.losses import warning_of_losses
from slideviz.formats.openfoam_paths import ending_of, mesh_path, shown_name, stem_of
from slideviz.formats.table import FORMATS, endings, format_for, own_endings, usual_ending
from slideviz.mesh.metrics import MetricValues, rated_metric
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.rbf.problem import PhaseTimer
from slideviz.scene.overview import require_detail
from slideviz.solver.deform import Step
from slideviz.solver.steps import RunResult
from slideviz.streaming.stream_input import missing_memory
from slideviz.system.file_checks import same_file
from slideviz.system.ranks import SERIAL
from slideviz.terms import METRICS, WALL_VALUES, FileFormat, Metric

KEPT_BYTES = 1_000_000_000
"""Most bytes of meshes of steps in memory; they are kept to find when cells were inverted."""


def main(arguments: Namespace) -> int:
    """Deform a mesh as a case says, write mesh, report, steps, picture; return the exit code."""
    begin = time.perf_counter()
    case = read_case(arguments)
    require_mesh_file(arguments, case)
    output = mesh_path(arguments.output or case.mesh_out or _default_output(case))
    kind = _format_of(output, case)
    qualities = qualities_path(output) if case.generate_quality else None
    require_streamable(arguments, case, output, kind)
    _require_output_paths(arguments, case, output, qualities)
    streamed = is_to_be_streamed(arguments, case, output, kind)
    if streamed and arguments.metrics:
        raise CaseError("--metrics needs the mesh in memory; leave it out for a streamed run")
    done = (_stream if streamed else _deform)(arguments, case, output, kind)
    case = with_marker_names(case, done.mesh)
    last = done.steps[-1].mesh
    timer = silent_timer(dict(done.seconds))
    if qualities:
        with timer.phase("write"):
            write_qualities(qualities, done.quality)
    if arguments.picture:
        # Late: VTK takes 0.6 s.
        from slideviz.export.offscreen_renderer import PICTURE_SIZE
        from slideviz.export.verbs import picture

        picture(
            arguments.picture,
            replace(last, name=shown_name(output)),
            done.mesh,
            case=case,
            step=done.steps[-1],
            rated=done.quality,
            before=done.undeformed,
            size=arguments.picture_size or PICTURE_SIZE,
            zoom=arguments.zoom,
        )
    timer.seconds["total"] = time.perf_counter() - begin
    report = run_report(case, done, timer.seconds)
    if arguments.metrics:
        before = _metrics_of(arguments, done.mesh, done.undeformed, done.mesh)
        after = _metrics_of(arguments, last, done.quality, done.mesh)
        both = {"before": before, "after": after}
        report["metrics"] = {when: metrics_report(done.mesh, one) for when, one in both.items()}
    return report_outcome(arguments, case, done, report, {"mesh": output, CELLS: qualities})


def _metrics_of(
    arguments: Namespace, mesh: Mesh, found: Quality, base: Mesh
) -> dict[Metric, MetricValues]:
    """Return the metrics that ``--metrics`` asks for, of a mesh with its quality."""
    names = [name for name in METRICS if name in arguments.metrics]
    return {name: rated_metric(mesh, name, base, found) for name in names}


def _fields(
    arguments: Namespace, case: Case, path: Path, mesh: Mesh, found: Quality, base: Mesh
) -> tuple[dict[str, NDArray] | None, dict[str, NDArray]]:
    """Return the quality and the metrics of a mesh as data of the cells and points of a file.

    The first is None, and the second empty, where the format has no place for them.
    """
    data = quality_data(path, found)
    if data is None or not arguments.metrics:
        return data, {}
    asked = set(arguments.metrics) & set(WALL_VALUES)
    layers = walls(mesh, base, case.walls(mesh.marker_names)) if asked else None
    values = _metrics_of(arguments, mesh, found, base)
    cells, points = metric_data(values, layers, arguments.metrics)
    return data | cells, points


def _deform(arguments: Namespace, case: Case, output: Path, kind: FileFormat | None) -> RunResult:
    assert case.mesh_file is not None
    timer = silent_timer({})
    with timer.phase("read"):
        case, mesh = read_mesh(case, case.mesh_file)
        say("warning", warning_of_losses(output, mesh, kind))
        if arguments.picture:
            require_detail(arguments.zoom, mesh)
    done = measured(case, mesh, run_steps(arguments, case, mesh), timer)
    last = done.steps[-1].mesh
    with timer.phase("write"):
        cells, points = _fields(arguments, case, output, last, done.quality, mesh)
        write(
            output,
            last,
            overwrite=arguments.force,
            cell_data=cells,
            base=mesh,
            file_format=kind,
            point_data=points,
        )
    return done


def _stream(arguments: Namespace, case: Case, output: Path, kind: FileFormat | None) -> RunResult:
    # Late: streaming takes 0.2 s.
    from slideviz.streaming.run import stream

    if not arguments.quiet:
        say("note", "a streamed run does not measure how it changes the first heights of layers")
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        return stream(
            case,
            output,
            file_format=kind,
            report=bar.phase,
            warn=partial(say, "warning"),
            replaces=case.mesh_file if arguments.force else None,
            listed=LISTED,
            later=QUALITY_BYTES if case.generate_quality else 0,
            ranks=arguments.ranks or SERIAL,
        )


def require_streamable(
    arguments: Namespace, case: Case, output: Path, kind: FileFormat | None
) -> None:
    """Raise where ``--stream`` is given for a run that cannot be streamed.

    Raises CaseError or MeshError if an option or the method needs the mesh in memory, or mesh or
    output is not an SU2 mesh.
    """
    if not arguments.stream:
        return
    # Late: streaming takes 0.2 s.
    from slideviz.streaming.run import require_stream

    for name in _needing_memory(arguments):
        option = f"--{name.replace('_', '-')}"
        raise CaseError(f"{option} needs the mesh in memory; leave it out, or --stream")
    if not (arguments.output or case.mesh_out or case.mesh_out_format):
        require_stream(case)  # the name of the result is that of the mesh then
    if not _is_su2(output, kind):
        raise CaseError(
            f"{output}: a streamed run writes SU2 meshes; end its name in .su2, or .su2b for the "
            "binary form"
        )
    require_stream(case)


def is_to_be_streamed(
    arguments: Namespace, case: Case, output: Path, kind: FileFormat | None
) -> bool:
    """Return whether to stream a run: on request, or if it is possible and memory is too small."""
    if arguments.stream:
        return True
    able = _is_su2(output, kind) and not _needing_memory(arguments)
    why = missing_memory(case) if able else ""
    if why and not arguments.quiet:
        say("note", f"{why}; it is streamed")
    return bool(why)


def _needing_memory(arguments: Namespace) -> list[str]:
    return [name for name in ("picture", "steps_dir", "steps_file") if getattr(arguments, name)]


def _is_su2(output: Path, kind: FileFormat | None) -> bool:
    return format_for(output, kind).value is not None


def _require_output_paths(
    arguments: Namespace, case: Case, output: Path, qualities: Path | None
) -> None:
    assert case.mesh_file is not None
    ours = "|".join(map(re.escape, endings(lambda row: row.solver)))
    may_force = not arguments.force and same_file(output, case.mesh_file)
    asked = "MESH_OUT_FILENAME" if case.mesh_out else "without -o"
    mesh = OutputPath(
        output,
        "-o" if arguments.output else asked,
        named=bool(arguments.output),
        is_mesh=_format_of(output, case) is None,
        replaces=case.mesh_file if arguments.force else None,
        remedy="choose another name with -o or MESH_OUT_FILENAME"
        + (", or add --force to write over it" if may_force else ""),
    )
    if arguments.steps_file and not format_for(arguments.steps_file).series:
        raise CaseError(
            f"{arguments.steps_file}: only {own_endings('series')} files hold all steps; end the "
            "name of --steps-file with it, or use --steps-dir"
        )
    if arguments.picture:
        # Late: VTK takes 0.6 s.
        from slideviz.export.offscreen import check_drawable, check_picture
        from slideviz.export.offscreen_renderer import PICTURE_SIZE

        check_picture(arguments.picture)
        check_drawable(arguments.picture_size or PICTURE_SIZE)
    require_output_paths(
        arguments,
        mesh,
        OutputPath(qualities, "GENERATE_QUALITY", named=False),
        OutputPath(arguments.json, "--json"),
        OutputPath(arguments.picture, "--picture"),
        OutputPath(arguments.history, "--history"),
        OutputPath(arguments.steps_file, "--steps-file"),
        OutputPath(
            arguments.steps_dir,
            "--steps-dir",
            named=False,
            files=rf"{re.escape(stem_of(case.mesh_file))}_\d+({ours})",
        ),
    )


def _default_output(case: Case) -> Path:
    """Return ``name_def.su2`` for ``.../name.su2``, in the current folder (or MESH_OUT_FORMAT)."""
    assert case.mesh_file is not None
    ending = f".{case.mesh_out_format}" if case.mesh_out_format else ending_of(case.mesh_file)
    return Path(f"{stem_of(case.mesh_file)}_def{ending}")


def _format_of(output: Path, case: Case) -> FileFormat | None:
    """Return the format of MESH_OUT_FORMAT, or None; raise CaseError if ``-o`` contradicts it."""
    kind = case.mesh_out_format
    ending = ending_of(output)
    if kind and output != case.mesh_out and ending in FORMATS and ending != f".{kind}":
        raise CaseError(
            f"{output}: its ending is {ending}, but MESH_OUT_FORMAT says {kind.upper()}; change "
            "one of them"
        )
    return kind


def silent_timer(seconds: dict[str, float]) -> PhaseTimer:
    """Return a timer of phases that adds to ``seconds``, and shows no progress."""
    return PhaseTimer(lambda *_: None, seconds)


def measured(case: Case, mesh: Mesh, steps: Sequence[Step], timer: PhaseTimer) -> RunResult:
    """Return the outcome of a run in memory, with the qualities of its meshes."""
    last = steps[-1].mesh
    mesh = mesh.undeformed
    with timer.phase("quality"):
        layers = walls(last, mesh, case.walls(mesh.marker_names))  # takes most memory: first
        found = quality(last, reference=mesh, metric=case.quality_metric)
        before = quality(mesh, metric=case.quality_metric)
    folded = folded_cells(steps, mesh, found)
    return RunResult(mesh, tuple(steps), found, before, folded, timer.seconds, layers)


def run_steps(
    arguments: Namespace, case: Case, mesh: Mesh, *, converged: bool = False
) -> list[Step]:
    """Deform a mesh, and return all steps; write each step's mesh where asked for.

    Once meshes take more than `KEPT_BYTES`, only the last step keeps its own; earlier steps have
    the undeformed mesh instead.
    """
    steps: list[Step] = []
    folder = arguments.steps_dir
    series = _series(arguments, case, mesh)
    with series as add, Bar(not arguments.quiet, begun=arguments.begun) as bar:
        for step in deform(case, mesh, bar, certify=True, converged=converged):
            if folder:
                assert case.mesh_file is not None
                width = len(str(step.total))
                name = f"{stem_of(case.mesh_file)}_{step.index:0{width}d}{usual_ending(mesh)}"
                write(folder / name, step.mesh)
            add(step.mesh)
            steps.append(step)
            if len(steps) * mesh.points.nbytes > KEPT_BYTES and len(steps) > 1:
                steps[-2] = replace(steps[-2], mesh=mesh)
    return steps


@contextmanager
def _series(arguments: Namespace, case: Case, mesh: Mesh) -> Iterator[Callable[[Mesh], object]]:
    """Context with a function that adds the mesh of a step to the file of all steps.

    The undeformed mesh is in it already. Each mesh has the quality of its cells, the
    displacement of its points, and metrics. Without ``--steps-file`` the function does nothing.
    Raises MeshError if the file cannot be written; none is left.
    """
    path = arguments.steps_file
    if path is None:
        yield lambda _: None
        return

    with format_for(path).function("series")(path, mesh) as series:

        def add(now: Mesh) -> None:
            found = quality(now, reference=mesh, metric=case.quality_metric)
            cells, points = _fields(arguments, case, path, now, found, mesh)
            series.add(
                now.points, cells or {}, {"displacement": now.points - mesh.points, **points}
            )

        add(mesh)
        yield add
