"""The run of a mesh too large for memory, from file to file, as a job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from slideviz.case.model import Case
from slideviz.session.jobs import PHASES, JobProgress, Report, Stopped, overall, raise_if_cancelled
from slideviz.session.large import frame_of
from slideviz.session.results import StepFrame
from slideviz.session.whole import totals_of
from slideviz.solver.deform import Progress
from slideviz.streaming.run import stream


def compute_in_file(
    case: Case, first: StepFrame, output: Path, report: Report, stopped: Stopped
) -> None:
    """Deform a mesh from file to file; report the progress, and the last step as a `StepFrame`.

    ``first`` is the undeformed frame, of the boundary.

    Raises
    ------
    Cancelled
        It was stopped; a file that was at ``output`` is as before.
    """
    phases = {**PHASES, "read": "reading the boundary", "write": "copying the file"}

    def tell(now: Progress) -> None:
        raise_if_cancelled(stopped)
        report(JobProgress(f"From file to file: {phases.get(now.phase, now.phase)}", overall(now)))

    skin = first.mesh
    assert skin.source is not None
    done = stream(case.change(mesh_file=skin.source), output, tell=tell)
    step = done.steps[-1]
    now = skin.with_points(step.mesh.points)
    frame = frame_of(now, skin, output, totals_of(done.quality), case.quality_metric)
    report(replace(frame, step=replace(step, mesh=now)))
