"""``slideviz def``: deforms a mesh by a configuration file of SU2, instead of SU2_DEF."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from slideviz import write
from slideviz.case.model import Case
from slideviz.case.words import counted
from slideviz.cli.mesh_source import changed
from slideviz.cli.output_paths import (
    OutputPath,
    add_case_inputs,
    qualities_path,
    require_output_paths,
)
from slideviz.cli.report import (
    CELLS,
    Report,
    print_remarks,
    report_outcome,
    run_report,
    save_report,
    write_qualities,
)
from slideviz.cli.run_command import measured, run_steps, silent_timer
from slideviz.cli.terminal import DONE, say
from slideviz.design.su2.config import Su2Config, on_mesh, own_changes, read_config, read_mesh
from slideviz.design.su2.surface import MovingSurface, at_rest, convex_part, make_surface, set_boxes
from slideviz.errors import CaseError, SlidevizError, messages_of
from slideviz.formats.losses import warning_of_losses
from slideviz.mesh.model import Mesh
from slideviz.solver.prepare import referenced
from slideviz.solver.steps import Step


def read_configuration(arguments: Namespace) -> tuple[Su2Config, Mesh]:
    """Return the configuration, with the changes of ``--set``, and its mesh, which it must fit."""
    own, others = own_changes(arguments.set)
    config = read_config(arguments.case, own)
    zones = (replace(zone, case=changed(zone.case, others)) for zone in config.zones)
    config = replace(config, case=changed(config.case, others), zones=tuple(zones))
    for each in (config, *config.zones):
        add_case_inputs(arguments, each.case)
        if each.variables[0].kind == "SURFACE_FILE":
            arguments.inputs.setdefault(each.files["DV_FILENAME"], "the surface file")
    if not arguments.quiet and config.ignored:
        keys = counted(len(config.ignored), "other key")
        say("note", f"{keys} of SU2 in {arguments.case} not needed here")
    file = config.case.mesh_file
    assert file is not None
    if not file.exists() and (arguments.case.parent / file).exists():
        raise CaseError(
            f"{file}: is not in the working folder, but in the folder of {arguments.case}; paths "
            f"are relative to the working folder, like in SU2: change to {arguments.case.parent} "
            "first"
        )
    if not file.exists() and "MESH_FILENAME" not in config.present:
        said = messages_of(config.case.warnings)
        hint = next((one for one in said if "MESH_FILENAME" in one.keys), "name the mesh to deform")
        raise CaseError(
            f"{arguments.case}: MESH_FILENAME is missing, and there is no {file}, SU2's default; "
            f"{hint}"
        )
    mesh = referenced(config.case, read_mesh(config))
    return on_mesh(config, mesh), mesh


def main(arguments: Namespace) -> int:
    """Deform a mesh by a configuration of SU2, write it with its boxes; return the exit code."""
    begin = time.perf_counter()
    config, mesh = read_configuration(arguments)
    output = config.case.mesh_out
    kind = config.case.mesh_out_format
    assert output is not None
    remedy = "choose another name in MESH_OUT_FILENAME, or add --force to write over it"
    replaces = config.case.mesh_file if arguments.force else None
    place = OutputPath(
        output, "MESH_OUT_FILENAME", False, is_mesh=kind is None, replaces=replaces, remedy=remedy
    )
    rated = qualities_path(output) if config.case.generate_quality else None
    require_output_paths(
        arguments,
        place,
        OutputPath(rated, "GENERATE_QUALITY", False),
        OutputPath(arguments.json, "--json"),
    )
    if config.variables[0].kind == "FFD_SETTING":
        return _set_boxes(arguments, config, mesh, begin)
    timer = silent_timer({"read": time.perf_counter() - begin})
    first = make_surface(config, mesh)

    def attempt(design: Su2Config) -> tuple[MovingSurface, list[Step]]:
        surface = first if design is config else make_surface(design, mesh)
        moves = surface.displacement.any()
        case = surface.case()
        if surface.moves_whole_mesh or not moves:
            return surface, [at_rest(case, surface.moved() if moves else mesh)]
        return surface, run_steps(arguments, case, mesh, converged=True)

    say("warning", warning_of_losses(output, first.boxed(mesh), kind))
    with _relaxation_told(config):
        part, (surface, steps), said = convex_part(
            config, mesh, attempt, lambda each: each[1][-1].mesh
        )
    case = surface.case()
    steps[-1] = replace(steps[-1], messages=(*steps[-1].messages, *said))
    done = measured(case, mesh, steps, timer)
    with timer.phase("write"):
        deformed = surface.boxed(steps[-1].mesh)
        write(output, deformed, overwrite=arguments.force, base=mesh, file_format=kind)
        if rated:
            write_qualities(rated, done.quality)
    timer.seconds["total"] = time.perf_counter() - begin
    report = run_report(case, done, timer.seconds)
    report["design"] = {
        "variables": variable_rows(surface),
        "boxes": surface.displacer.inside,
        "part": part,
        "ignored": list(config.ignored),
    }
    return report_outcome(arguments, case, done, report, {"mesh": output, CELLS: rated})


@contextmanager
def _relaxation_told(config: Su2Config) -> Iterator[None]:
    """Context that adds a line about OPT_RELAX_FACTOR to errors, unless it is 1."""
    try:
        yield
    except SlidevizError as problem:
        if config.relaxation == 1.0:
            raise
        said = f"OPT_RELAX_FACTOR= {config.relaxation:g} multiplies all values of DV_VALUE"
        problem.args = *problem.args, f"{config.source}: {said}"
        raise


def variable_rows(surface: MovingSurface) -> list[Report]:
    """Return the entry of the report for each value of the design variables."""
    variables = surface.config.variables
    idle = surface.idle
    return [
        {"kind": variables[place].kind, "value": variables[place].values[part], "idle": idle[place]}
        for place, part in surface.values
    ]


def _set_boxes(arguments: Namespace, config: Su2Config, mesh: Mesh, begin: float) -> int:
    """Write the undeformed mesh with the boxes that the configuration defines; return the code."""
    case: Case = config.case
    boxed, boxes = set_boxes(config, mesh)
    assert case.mesh_out is not None
    say("warning", warning_of_losses(case.mesh_out, boxed, case.mesh_out_format))
    write(case.mesh_out, boxed, overwrite=arguments.force, file_format=case.mesh_out_format)
    counts = {box.name: sum(len(nodes) for nodes, _ in box.embedded.values()) for box in boxes}
    report = {
        "case": str(config.source),
        "mesh": str(case.mesh_file),
        "design": {
            "variables": [{"kind": "FFD_SETTING", "value": 0.0, "idle": True}],
            "boxes": counts,
            "ignored": list(config.ignored),
        },
        "seconds": {"total": round(time.perf_counter() - begin, 6)},
        "warnings": list(case.warnings),
    }
    if save_report(arguments, report):
        for name, count in counts.items():
            print(f"FFD box {name}: {count} surface nodes")
        print(f"mesh: {case.mesh_out}")
    print_remarks(case.warnings, quiet=arguments.quiet)
    for name, count in counts.items():
        if not count:
            words = f"no node of {', '.join(config.markers)} is in the FFD box {name}"
            say("warning", words)
    return DONE
