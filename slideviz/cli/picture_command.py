"""``slideviz picture``: deforms a mesh, and writes a picture of a step."""

from __future__ import annotations

from argparse import Namespace
from typing import Literal

from slideviz import deform, picture
from slideviz.case.model import Case
from slideviz.cli.mesh_source import changed_beside, read_inputs
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks
from slideviz.cli.terminal import DONE
from slideviz.errors import CaseError
from slideviz.export.offscreen import check_drawable, check_picture
from slideviz.mesh.model import Mesh
from slideviz.scene.overview import require_detail
from slideviz.solver.deform import Step


def main(arguments: Namespace) -> int:
    """Deform a mesh as a case says, and write a picture of a step; return the exit code."""
    check_picture(arguments.output)
    check_drawable(arguments.size)
    if arguments.step == 0 and arguments.beside:
        raise CaseError(
            "--step 0 is the undeformed mesh, beside which no second run is shown; leave out "
            "--beside, or name a later step"
        )
    case, mesh = read_inputs(arguments)
    require_detail(arguments.zoom, mesh)
    beside: tuple[Case, Step] | Literal["undeformed"] | None = None
    other = None
    if arguments.beside == ["undeformed"]:
        beside = "undeformed"
    elif arguments.beside:
        other = changed_beside(case, arguments.beside)
    number = arguments.step
    step = None
    if number != 0:
        steps = _steps(arguments, case, mesh)
        number = number or len(steps)
        if not 0 < number <= len(steps):
            raise CaseError(f"--step {number}: the run has the steps 0 to {len(steps)}")
        step = steps[number - 1]
        if other is not None:  # the step that is as far deformed
            others = _steps(arguments, other, mesh)
            beside = other, others[max(round(number * len(others) / len(steps)), 1) - 1]
    picture(
        arguments.output,
        mesh if step is None else step.mesh,
        None if step is None else mesh,
        case=case,
        step=step,
        size=arguments.size,
        zoom=arguments.zoom,
        beside=beside,
    )
    if not arguments.quiet:
        print(arguments.output)
    return DONE


def _steps(arguments: Namespace, case: Case, mesh: Mesh) -> list[Step]:
    with Bar(not arguments.quiet) as bar:
        steps = list(deform(case, mesh, bar))
    print_remarks(steps[-1].messages, quiet=arguments.quiet)
    return steps
