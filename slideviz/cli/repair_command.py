"""``slideviz repair``: mends inverted and poor cells of a mesh, without a motion."""

from __future__ import annotations

import sys
import time
from argparse import Namespace

from slideviz import quality, read, repair, write
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import Report, print_remarks, quality_lines, save_report
from slideviz.cli.terminal import DONE, INVERTED, say
from slideviz.formats.files import quality_data
from slideviz.formats.losses import warning_of_losses
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality


def main(arguments: Namespace) -> int:
    """Mend a mesh, write it, and print or write a report; return the exit code."""
    begin = time.perf_counter()
    output = arguments.output
    path = arguments.mesh
    replaces = path if arguments.force else None
    require_output_paths(
        arguments,
        OutputPath(
            output,
            "-o",
            is_mesh=True,
            replaces=replaces,
            remedy="choose another name, or add --force to write over it",
        ),
        OutputPath(arguments.json, "--json"),
    )
    mesh = read(path, zone=arguments.zone)
    reference = None
    if arguments.reference is not None:
        reference = read(arguments.reference, zone=arguments.zone)
    say("warning", warning_of_losses(output, mesh, None))
    roles = {role: getattr(arguments, role) for role in ("fixed", "sliding", "periodic")}
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        done = repair(
            mesh,
            reference,
            **roles,
            below=arguments.below,
            target=arguments.target,
            metric=arguments.metric,
            progress=bar.phase,
        )
    before = quality(mesh, reference, arguments.metric)
    found = quality(done.mesh, reference, arguments.metric)
    data = quality_data(output, found)
    write(output, done.mesh, overwrite=arguments.force, cell_data=data, base=mesh)
    report: Report = {
        "mesh": str(path),
        "output": str(output),
        "reference": str(arguments.reference) if arguments.reference else None,
        **{role: list(names) for role, names in roles.items()},
        "below": arguments.below,
        "target": arguments.target or ("ideal" if reference is None else "reference"),
        "repair": done.report(),
        "quality": {
            **found.summary(),
            "metric": found.metric,
            "before": {"min": before.min, "mean": before.mean, "inverted": before.inverted},
        },
        "seconds": {"total": round(time.perf_counter() - begin, 6)},
        "warnings": list(done.warnings),
    }
    if save_report(arguments, report):
        _print(report, f"{done.words()}, {done.moves}", found, before)
    print_remarks(done.warnings, quiet=arguments.quiet)
    if found.inverted:
        print(f"slideviz: {_inverted(found, mesh)}", file=sys.stderr)
        return INVERTED
    return DONE


def _print(report: Report, words: str, found: Quality, before: Quality) -> None:
    print(f"{report['mesh']}: {words}")
    print(quality_lines(found, before, "before"))
    print(f"  {report['seconds']['total']:.2f} s")
    print(f"mesh: {report['output']}")


def _inverted(found: Quality, mesh: Mesh) -> str:
    """Return a sentence with the number of inverted cells that are left, and remedies."""
    cells = found.inverted_cells(5)
    named = ", ".join(map(str, mesh.file_cells(cells)))
    more = " ..." if found.inverted > len(cells) else ""
    return (
        f"{found.inverted} of {found.cells} cells are still inverted ({named}{more}); what may "
        "help: --sliding for adjacent boundaries that did not move, or remesh there"
    )
