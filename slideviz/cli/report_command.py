"""``slideviz report``: deforms a mesh, and writes a report of the run as one HTML file."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from slideviz.cli.mesh_source import read_inputs
from slideviz.cli.report import print_remarks
from slideviz.cli.terminal import DONE, INVERTED, LIMIT_MISSED
from slideviz.export.html_report import write_html_report
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.session import changes, jobs
from slideviz.session.state import StepFrame


def main(arguments: Namespace) -> int:
    """Deform a mesh as a case says, and write a report of the run; return the exit code."""
    arguments.output = arguments.output or Path(f"{arguments.case.stem}_report.html")
    case, mesh = read_inputs(arguments)
    found = list[object]()
    job = jobs.Job(found.append)
    session = changes.start_run(jobs.prepare(mesh, case.mesh_file, case, job).session)
    jobs.compute(session.case, mesh, job)
    frames = [one for one in found if isinstance(one, StepFrame)]
    session = changes.end_run(changes.add_frames(session, frames), "done")
    session = changes.set_view(session, color_by="size-skew")
    with OffscreenRenderer.of_runs(session, arguments.zoom) as renderer:
        write_html_report(arguments.output, renderer)
    last = frames[-1]
    print_remarks(() if last.step is None else last.step.messages, quiet=arguments.quiet)
    if last.quality.inverted:
        return INVERTED
    return DONE if all(result.passed for result in last.limits) else LIMIT_MISSED
