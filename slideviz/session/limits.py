"""The limits of the case, checked on the step that is shown: what a job does."""

from __future__ import annotations

from dataclasses import replace

from slideviz.case.limits import (
    NUMBERS,
    MeasuredMesh,
    check_case_limits,
    check_limits,
    require_streamed,
)
from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.session.jobs import Report, Stopped
from slideviz.session.results import CheckedLimits, StepFrame


def check_frame(
    frame: StepFrame, undeformed: Mesh, case: Case, _report: Report, _stopped: Stopped
) -> CheckedLimits:
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
