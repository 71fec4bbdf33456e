"""``slideviz dot``: gradients for the design variables of SU2, instead of SU2_DOT_AD."""

from __future__ import annotations

import time
from argparse import Namespace
from pathlib import Path

import numpy as np

from slideviz.cli.def_command import read_configuration, variable_rows
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks, save_report
from slideviz.cli.terminal import DONE
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.gradients import Gradients, design_gradients, sensitivity_files
from slideviz.errors import CaseError
from slideviz.system.atomic import write_whole


def main(arguments: Namespace) -> int:
    """Write the gradients for moving nodes and for design variables; return the exit code."""
    begin = time.perf_counter()
    config, mesh = read_configuration(arguments)
    first = config.variables[0]
    if first.group in ("boxes", "nothing"):
        raise CaseError(f"{config.source}: {first.kind} moves nothing, so it has no gradient")
    for path in sensitivity_files(config, mesh):
        arguments.inputs.setdefault(path, "the file of the sensitivities")
    sensitivities = config.files["DV_SENS_FILENAME"]
    gradient = None if first.group == "file" else config.files["GRAD_OBJFUNC_FILENAME"]
    require_output_paths(
        arguments,
        OutputPath(sensitivities, "DV_SENS_FILENAME"),
        OutputPath(gradient, "GRAD_OBJFUNC_FILENAME"),
        OutputPath(arguments.json, "--json"),
    )
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        surface, found = design_gradients(config, mesh, bar)
    _write_surface(sensitivities, found)
    if gradient is not None:
        _write_gradient(gradient, config, found)
    report = {
        "case": str(config.source),
        "mesh": str(config.case.mesh_file),
        "sensitivities": found.source,
        "at": "design" if found.at_design else "mesh",
        "gradient": [] if gradient is None else found.variables.tolist(),
        "variables": variable_rows(surface),
        "ignored": list(config.ignored),
        "seconds": {"total": round(time.perf_counter() - begin, 6)},
        "warnings": list(dict.fromkeys(found.warnings)),
    }
    if save_report(arguments, report):
        _print(report, sensitivities, gradient)
    print_remarks(report["warnings"], quiet=arguments.quiet)
    return DONE


def _print(report: dict, sensitivities: Path, gradient: Path | None) -> None:
    where = "this design" if report["at"] == "design" else "the points of the mesh as it is"
    print(f"{report['case']}: sensitivities {report['sensitivities']}, at {where}")
    for variable, value in zip(report["variables"], report["gradient"], strict=False):
        print(f"  {variable['kind']:<22}{variable['value']:>14.6g}{value:>24.15g}")
    print(f"gradient for each moving node: {sensitivities}")
    if gradient is not None:
        print(f"gradient for each design variable: {gradient}")
    else:
        print("SURFACE_FILE has no value to differentiate for: no gradient for design variables")


def _write_surface(path: Path, found: Gradients) -> None:
    """Write a line ``x, y, z, dJ/dx, dJ/dy, dJ/dz`` for each moving node; in 2D z's are 0."""
    table = np.zeros((len(found.points), 6))
    table[:, : found.points.shape[1]] = found.points
    table[:, 3 : 3 + found.points.shape[1]] = found.surface
    rows = (", ".join(map(repr, row)) + "\n" for row in table.tolist())
    write_whole(path, "".join(rows) or "\n", CaseError)


def _write_gradient(path: Path, config: Su2Config, found: Gradients) -> None:
    """Write a line with the name of the objective, and one with the gradient of each variable."""
    objective = config.values["OBJECTIVE_FUNCTION"].strip("() ").split(",")[0].strip()
    rows = [f"{objective} gradient", *(repr(value) for value in found.variables.tolist())]
    write_whole(path, "\n".join(rows) + "\n", CaseError)
