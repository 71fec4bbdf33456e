"""Chooses the steps and the control nodes that a deformer keeps, by running the solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from slideviz.case.model import Case
from slideviz.design.frozen.step import ChoiceCache, FrozenStep
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.rbf.problem import CarriedError, Levels, PhaseTimer, Problem, Solution
from slideviz.rbf.tape import value
from slideviz.solver.deform import Progress, all_steps, free_memory, require_memory
from slideviz.solver.setup import Setup
from slideviz.solver.stepping import (
    Stepping,
    cartesian,
    displaced_coords,
    one_step,
    with_halo_copies,
)
from slideviz.solver.steps import step_timer

Report = Callable[[Progress], None]

BYTES = 64  # free memory for each entry of a factor, above which factors are kept for further calls


def choose_steps(
    case: Case, mesh: Mesh, setup: Setup, targets: Sequence[FloatArray], report: Report
) -> tuple[tuple[FrozenStep, ...], FloatArray]:
    """Return steps with control nodes that suffice for all ``targets``, and the first run's points.

    The points are (n, d), deformed by the first displacement, which also chooses the number of
    steps. The selection for each further displacement begins with the control nodes of all before.
    Raises DeformError if a step cannot be solved, or its result cannot be right. ``targets``:
    displacements of the known nodes, in the frame.
    """
    require_memory(setup, case, lasting=True)
    kept = setup
    # The conditioning is also checked for data other than the reference.
    setup = replace(
        setup, solve=lambda problem, timer: kept.solve(replace(problem, lasting=True), timer)
    )
    parts, solutions, points = _reference(case, mesh, replace(setup, target=targets[0]), report)
    # The other methods choose nothing but the number of steps.
    others = list(targets[1:]) if case.method == "rbf" else []
    if others and setup.reduction is not None and setup.reduction.multilevel:
        others += targets[:-1]  # a further level can raise errors of those before
    for target in others:
        further = _further(mesh, replace(setup, target=target), parts, solutions, report)
        # A system that was solved with more rows and digits for one is so for all.
        solutions = [
            replace(
                new if new.refined >= old.refined else old,
                error_estimate=max(old.error_estimate, new.error_estimate),
            )
            for old, new in zip(solutions, further, strict=True)
        ]
    rows = [len(level) for found in solutions for levels in found.stages for level in levels]
    reuse = BYTES * sum(n**2 for n in rows) < free_memory()
    steps = tuple(
        FrozenStep(
            setup=kept.at_step(k == len(parts) - 1),
            mesh=mesh,
            part=part,
            first=k == 0,
            stages=solution.stages,
            dropped=solution.dropped,
            condition=solution.condition,
            refined=solution.refined,
            error_estimate=solution.error_estimate,
            reuse=reuse,
            choices=ChoiceCache({"flat": len(solution.stages) < 2}),
        )
        for k, (part, solution) in enumerate(zip(parts, solutions, strict=True))
    )
    return steps, points


def _continued(
    setup: Setup, stages: tuple[Levels, ...], problem: Problem, timer: PhaseTimer
) -> Solution:
    return setup.solve(replace(problem, stages=stages), timer)


def _reference(
    case: Case, mesh: Mesh, setup: Setup, report: Report
) -> tuple[list[float], list[Solution], FloatArray]:
    """Run the solver; return the part of the displacement at each step, solutions, and points."""
    made: list[Solution] = []

    def solve(problem: Problem, timer: PhaseTimer) -> Solution:
        made.append(setup.solve(problem, timer))
        return made[-1]

    steps = list(all_steps(Stepping(case, mesh, replace(setup, solve=solve), report, {})))
    # Of steps that were tried, those that are in the run: each has the control nodes it found.
    chosen = [next(s for s in made if s.control is step.control) for step in steps]
    return [step.part for step in steps], chosen, steps[-1].mesh.points


def _further(
    mesh: Mesh, setup: Setup, parts: Sequence[float], chosen: Sequence[Solution], report: Report
) -> list[Solution]:
    """Run the steps for ``setup.target``; return their solutions.

    Each selection begins with the control nodes of ``chosen``, the solution of the same step for
    another displacement, and adds more where these do not suffice.
    """
    coords = setup.coords
    total = len(parts)
    made: list[Solution] = []
    carried: CarriedError | None = None
    for k, (part, solution) in enumerate(zip(parts, chosen, strict=True)):
        control = solution.control
        if made:
            more = made[-1].control
            control = np.concatenate([control, more[~np.isin(more, control)]])
        timer = step_timer(report, k + 1, total)
        goal = value(setup.goal(setup.target, part))
        # Relaxation, after the last step, chooses no control nodes.
        begun = replace(setup.at_step(False), solve=partial(_continued, setup, solution.stages))
        made.append(
            one_step(
                begun, coords, goal, timer, replace(solution, control=control, carried=carried)
            )
        )
        carried = made[-1].carried
        coords = displaced_coords(setup, coords, value(made[-1].displacement), goal)
        if mesh.halo is not None:
            points = cartesian(setup.frame, mesh.points, setup.coords, coords)
            coords = with_halo_copies(setup, mesh, mesh.halo, points, coords)[1]
    return made
