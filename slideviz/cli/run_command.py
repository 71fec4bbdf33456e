"""``slideviz run``: deforms a mesh as a case file says."""

from __future__ import annotations

import argparse
import re
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.options import (
    add_changes,
    add_shared,
    add_zoom,
    read_case,
    require_mesh_file,
    size,
)
from slideviz.terms import SLIDES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from slideviz.case.model import Case
    from slideviz.deformation.solver import Step
    from slideviz.mesh.model import Mesh
    from slideviz.mesh.quality import Quality
    from slideviz.terms import FileFormat

_CELLS, _ROWS = "quality of each cell", 1 << 18
KEPT_BYTES = 1_000_000_000
"""Meshes of steps are kept up to this size, to tell when cells were inverted."""


def add_run(calls: argparse._SubParsersAction) -> None:
    """Add the command ``run`` to the parser."""
    call = calls.add_parser("run", help="deform a mesh as a case file says")
    add_shared(call, "case")
    call.add_argument("-o", "--output", type=Path, metavar="MESH", help="deformed mesh to write")
    add_changes(call)
    add_shared(call, "json", help="report as JSON; - is the terminal")
    call.add_argument(
        "--history", type=Path, metavar="FILE", help="convergence of the data reduction (CSV)"
    )
    call.add_argument("--steps-dir", type=Path, metavar="DIR", help="write the mesh of every step")
    call.add_argument(
        "--steps-file",
        type=Path,
        metavar="FILE",
        help="all steps with their quality in one file for ParaView (.vtkhdf)",
    )
    call.add_argument("--picture", type=Path, metavar="FILE", help="picture of the quality (PNG)")
    call.add_argument("--picture-size", type=size, metavar="WxH", help="pixels (1600x1000)")
    add_zoom(call)
    add_shared(call, "zone")
    call.add_argument(
        "--stream",
        action="store_true",
        help="for meshes larger than memory (.su2b): only the boundary is in memory",
    )
    call.add_argument(
        "--resume", action="store_true", help="go on where a streamed run was stopped"
    )
    add_shared(call, "quiet")
    call.add_argument("--force", action="store_true", help="allow writing over the input mesh")
    call.set_defaults(command=run)


def run(arguments: argparse.Namespace) -> int:
    """Deform a mesh as a case says, and write mesh, report, steps and picture."""
    from slideviz import quality, read, write
    from slideviz.cli.places import tell_lost
    from slideviz.cli.report import cell_data, folded_cells, run_report
    from slideviz.scene.moved import require_detail

    begin = time.perf_counter()
    case = read_case(arguments)
    mesh_file = require_mesh_file(arguments, case)
    output = arguments.output or case.mesh_out or _default_output(case)
    kind = _format_of(output, case)
    qualities = output.with_name(output.stem + "_qual.txt") if case.generate_quality else None
    _require_places(arguments, case, output, qualities)
    if arguments.stream or arguments.resume:
        return _run_streamed(arguments, case, begin, output, qualities)
    seconds = {"read": -time.perf_counter()}
    mesh = read(mesh_file, zone=case.zone, file_format=case.mesh_format)
    tell_lost(output, mesh, kind)
    if arguments.picture:
        require_detail(arguments.zoom, mesh)
    seconds["read"] += time.perf_counter()
    steps = _pull(arguments, case, mesh)
    last = steps[-1]
    seconds["quality"] = -time.perf_counter()
    found = quality(last.mesh, reference=mesh, metric=case.quality_metric)
    before = quality(mesh, metric=case.quality_metric)
    seconds["quality"] += time.perf_counter()
    seconds["write"] = -time.perf_counter()
    data = cell_data(output, found)
    force = arguments.force
    write(output, last.mesh, overwrite=force, cell_data=data, base=mesh, file_format=kind)
    if qualities:
        _write_qualities(qualities, found)
    seconds["write"] += time.perf_counter()
    if arguments.picture:
        from slideviz.export.picture import SIZE, picture
        from slideviz.session.opening import of_runs
        from slideviz.session.state import Frame, Run

        named = Frame(replace(last.mesh, name=output.name), found, last)
        session = of_runs(Frame(mesh, before), [Run(1, case, (named,), "done")])
        picture(session, arguments.picture, arguments.picture_size or SIZE, arguments.zoom)
    seconds["total"] = time.perf_counter() - begin
    folded = folded_cells(steps, mesh, found)
    report = run_report(case, mesh, steps, seconds, quality=found, undeformed=before, folded=folded)
    files = {"mesh": output, _CELLS: qualities}
    return _tell(arguments, report, files, found, before, folded)


def _run_streamed(
    arguments: argparse.Namespace, case: Case, begin: float, output: Path, qualities: Path | None
) -> int:
    """Deform a mesh from file to file, with the same report as ``run``."""
    from slideviz.cli.progress import Bar
    from slideviz.cli.report import LISTED, run_report
    from slideviz.deformation.streaming import stream
    from slideviz.errors import CaseError

    for option, value in (("--picture", arguments.picture), ("--steps-dir", arguments.steps_dir)):
        if value:
            raise CaseError(f"{option} needs the mesh in memory; leave it out, or --stream")
    if (_format_of(output, case) or output.suffix.lower().removeprefix(".")) != "su2b":
        raise CaseError(f"{output}: a streamed run writes SU2 binary meshes; end its name in .su2b")
    with Bar(not arguments.quiet) as bar:
        done = stream(
            case,
            output,
            tell=bar,
            resume=arguments.resume,
            replaces=case.mesh_file if arguments.force else None,
            listed=LISTED,
        )
    seconds = dict(done.seconds)
    if qualities:
        seconds["write"] = -time.perf_counter()
        _write_qualities(qualities, done.quality)
        seconds["write"] += time.perf_counter()
    seconds["total"] = time.perf_counter() - begin
    report = run_report(
        case,
        done.skin,
        done.steps,
        seconds,
        quality=done.quality,
        undeformed=done.undeformed,
        folded=done.folded,
    )
    files = {"mesh": output, _CELLS: qualities}
    return _tell(arguments, report, files, done.quality, done.undeformed, done.folded)


def _tell(
    arguments: argparse.Namespace,
    report: dict,
    files: dict[str, Path | None],
    found: Quality,
    before: Quality,
    folded: Mapping[int, tuple[int, int]],
) -> int:
    """Write and print the report of a run, and return the exit code."""
    from slideviz.cli.exit_codes import DONE, INVERTED
    from slideviz.cli.report import save_history, save_json

    if arguments.history:
        save_history(arguments.history, report)
    text = save_json(arguments.json, report) if arguments.json else None
    if text is not None:
        print(text, end="")
    elif not arguments.quiet:
        files |= {"report": arguments.json, "picture": arguments.picture}
        files |= {"convergence": arguments.history, "mesh of every step": arguments.steps_dir}
        files |= {"all steps": arguments.steps_file}
        _print_run(report, found, before, files)
    for warning in report["warnings"]:
        print(f"slideviz: warning: {warning}", file=sys.stderr)
    if found.inverted:
        print(f"slideviz: {_inverted_sentence(found, report, folded)}", file=sys.stderr)
        return INVERTED
    return DONE


def _require_places(
    arguments: argparse.Namespace, case: Case, output: Path, qualities: Path | None
) -> None:
    """Raise where a result could not be written, before the work and not after it."""
    from slideviz.cli.places import Output, require_places
    from slideviz.cli.steps_file import require_series
    from slideviz.mesh.io.file_checks import same_file

    assert case.mesh_file is not None
    may_force = not arguments.force and same_file(output, case.mesh_file)
    mesh = Output(
        output,
        "-o" if arguments.output else "MESH_OUT_FILENAME" if case.mesh_out else "without -o",
        named=bool(arguments.output),
        is_mesh=_format_of(output, case) is None,
        replaces=case.mesh_file if arguments.force else None,
        remedy="choose another name with -o or MESH_OUT_FILENAME"
        + (", or say --force to write over it" if may_force else ""),
    )
    if arguments.steps_file:
        require_series(arguments.steps_file)
    if arguments.picture:
        from slideviz.export.offscreen import check_png, check_size
        from slideviz.export.picture import SIZE

        check_png(arguments.picture)
        check_size(arguments.picture_size or SIZE)
    require_places(
        arguments,
        mesh,
        Output(qualities, "GENERATE_QUALITY", named=False),
        Output(arguments.json, "--json"),
        Output(arguments.picture, "--picture"),
        Output(arguments.history, "--history"),
        Output(arguments.steps_file, "--steps-file"),
        Output(
            arguments.steps_dir,
            "--steps-dir",
            named=False,
            files=rf"{re.escape(case.mesh_file.stem)}_\d+\.(su2b?|cgns)",
        ),
    )


def _default_output(case: Case) -> Path:
    """Return ``name_def.su2`` in the current folder for ``.../name.su2``."""
    assert case.mesh_file is not None
    ending = f".{case.mesh_out_format}" if case.mesh_out_format else case.mesh_file.suffix
    return Path(f"{case.mesh_file.stem}_def{ending}")


def _format_of(output: Path, case: Case) -> FileFormat | None:
    """Return the format that MESH_OUT_FORMAT asks for; an ending given on the command line wins."""
    named = output.suffix.lower() in (".su2", ".su2b") and output != case.mesh_out
    return None if named else case.mesh_out_format


def _pull(arguments: argparse.Namespace, case: Case, mesh: Mesh) -> list[Step]:
    """Return all steps; of very many only the last keeps its mesh."""
    from slideviz import deform, write
    from slideviz.cli.progress import Bar
    from slideviz.cli.steps_file import steps_file
    from slideviz.session.formats import usual_ending

    steps: list[Step] = []
    folder = arguments.steps_dir
    series = steps_file(arguments.steps_file, mesh, case.quality_metric)
    with series as add, Bar(not arguments.quiet) as bar:
        for step in deform(case, mesh, bar):
            if folder:
                assert case.mesh_file is not None
                width = len(str(step.total))
                name = f"{case.mesh_file.stem}_{step.index:0{width}d}{usual_ending(mesh)}"
                write(folder / name, step.mesh)
            add(step.mesh)
            steps.append(step)
            if len(steps) * mesh.points.nbytes > KEPT_BYTES and len(steps) > 1:
                steps[-2] = replace(steps[-2], mesh=mesh)
    return steps


def _write_qualities(path: Path, found: Quality) -> None:
    """Write one size-skew value for each cell, as RBF-SliDe's GENERATE_QUALITY does."""
    import orjson

    from slideviz.errors import CaseError
    from slideviz.mesh.io.atomic import atomic_write

    with atomic_write(path, CaseError) as file:
        for first in range(0, len(found), _ROWS):
            part = found.values[first : first + _ROWS]
            text = orjson.dumps(part, option=orjson.OPT_SERIALIZE_NUMPY)
            file.write(text[1:-1].replace(b",", b"\n") + b"\n")


def _print_run(
    report: dict, found: Quality, before: Quality, files: dict[str, Path | None]
) -> None:
    """Print the summary of a run; ``found`` and ``before`` are the quality after it and before."""
    from slideviz.cli.report import counted, quality_lines, table

    counts, spent = report["node_counts"], report["seconds"]
    method = "" if report["method"] == "rbf" else f"method {report['method']}, "
    print(f"{report['case']}: {counted(report['steps'], 'step')}, {method}", end="")
    zone = f", zone {report['zone']}" if report["zones"] > 1 else ""
    print(f"sliding {report['sliding']}, periodic {report['periodic']}{zone}")
    print(quality_lines(found, before))
    rows = [(name.replace("_", " ") + " nodes", count) for name, count in counts.items()]
    rows.append(("control nodes", report["control_nodes"][-1]))
    if report["periodic_misfit"] is not None:
        rows.append(("periodic misfit", report["periodic_misfit"]))
    print(table(rows))
    parts = {k: v for k, v in spent.items() if k != "total"}
    parts["start and others"] = spent["total"] - sum(parts.values())
    phases = ", ".join(f"{k} {v:.2f}" for k, v in parts.items() if v >= 0.005)
    print(f"  {spent['total']:.2f} s ({phases or 'all phases below 0.01'})")
    for name, path in files.items():
        if path:
            print(f"{name}: {path}")


def _inverted_sentence(found: Quality, report: dict, folded: Mapping[int, tuple[int, int]]) -> str:
    """Return which cells are inverted, and what helps."""
    from slideviz.mesh.elements import ELEMENTS

    named = ", ".join(
        f"{cell} ({ELEMENTS[vtk].name}, step {step})"
        for cell, (vtk, step) in list(folded.items())[:5]
    )
    more = f" and {found.inverted - 5} more" if found.inverted > 5 else ""
    return (
        f"{found.inverted} of {found.cells} cells are inverted: {named}{more}; more STEPS, "
        f"{_advice(report)} may help"
    )


def _advice(report: dict) -> str:
    """Return what this case has not tried yet."""
    ideas = ["STEPS= auto" if report["steps"] < 20 else "a smaller motion"]
    if report["method"] != "rbf":
        ideas.append("METHOD= rbf")
    if report["sliding"] == "none":
        ideas.append(f"SLIDING_MODE= {SLIDES}")
    if report["periodic"] in ("none", "periodic") and report["sliding"] != "none":
        ideas.append("PERIODIC_MODE= moving for a repeating mesh")
    ideas.append("another role for the boundaries near these cells")
    return ", ".join(ideas[:-1]) + " or " + ideas[-1]
