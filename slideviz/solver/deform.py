"""The solver: ``deform(case, mesh)`` yields one deformed mesh for each step.

Whoever pulls the generator owns progress and cancel; the command line, a test and the window's
worker run the same code.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from slideviz.argument_types import check_types
from slideviz.case.limits import rated_limits
from slideviz.case.model import Case
from slideviz.errors import DeformError, UnsoundError
from slideviz.mesh.margin import step_safety
from slideviz.mesh.model import Assembly, IntArray, Mesh, Skin
from slideviz.mesh.quality import INVERTED, quality
from slideviz.rbf.constraint_rows import ConstraintRows, blocks
from slideviz.rbf.tape import value
from slideviz.solver.interface_motion import InterfaceMotion, joined_steps, zone_runs
from slideviz.solver.prepare import Prepared, beginning_with, prepare
from slideviz.solver.setup import Setup, make_setup
from slideviz.solver.stepping import Stepping, problem_at, renumbered
from slideviz.solver.steps import Progress, Report, Step, Trial, step_timer
from slideviz.system.platform import free_memory

__all__ = ["Progress", "Step", "Trial", "deform", "folded_at"]

COUNTS = (1, 2, 3, 5, 8, 13, 21, 34)  # numbers of steps that STEPS= auto tries, in this order

ELASTIC_BYTES = 8_000
"""Bytes of memory that linear elasticity takes for each node: measured on quadrilaterals, whose
factor takes most of it, and on hexahedra, whose matrix has the most entries."""

RELAX_BYTES = 1_700  # bytes of memory that relaxation takes for each node: measured on hexahedra


@check_types
def deform(
    case: Case,
    mesh: Mesh,
    progress: Report | None = None,
    setup: Setup | None = None,
    certify: bool = False,
    converged: bool = False,
    reference: Mesh | None = None,
) -> Iterator[Step]:
    """Yield the deformed mesh of each step, with numbers on how it was made.

    Parameters
    ----------
    case
        Roles, motions and settings. Its ``mesh_file`` is not read.
    mesh
        The undeformed mesh. Each of several zones is deformed alone, with a period of its own;
        where their boundaries coincide, nodes follow those of the zone that moves them.
    progress
        Called often with a ``Progress``; an exception it raises ends the run at once.
    setup
        What ``make_setup`` returned for this mesh and a case that differs in the number of steps
        alone; it is made when there is none.
    certify
        Whether each step says how far it may go until the first cell folds (``Step.safe``).
    converged
        Whether relaxation goes on until only rounding is left, as that of a `Deformer`; it takes
        longer, and differences of runs then are those that a derivative predicts.
    reference
        The undeformed mesh of the same cells, if ``mesh`` was deformed from it: cells are relaxed
        to its shapes, layers keep its heights, and the quality of a step's mesh compares with it.
        So a motion and its reverse, in two runs, lead back.

    Raises
    ------
    CaseError, MeshError
        The case does not fit the mesh.
    DeformError
        The system cannot be solved, or needs more memory than there is.

    Notes
    -----
    Thesis chapters 2 and 3: the displacement is divided by the number of steps, in the working
    frame, and every step solves at the positions the one before it left. With ``steps`` 0
    (STEPS= auto) no step is yielded before their number is found.

    Examples
    --------
    Two squares side by side; the left side stays, the right side moves by 0.5:

    >>> import slideviz as sv
    >>> mesh = sv.Mesh(
    ...     [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]],
    ...     sv.Cells.from_blocks([(9, [[0, 1, 4, 3], [1, 2, 5, 4]])]),
    ...     (
    ...         sv.Marker("left", sv.Cells.from_blocks([(3, [[0, 3]])])),
    ...         sv.Marker("right", sv.Cells.from_blocks([(3, [[2, 5]])])),
    ...     ),
    ... )
    >>> case = sv.Case(roles={"right": "moving"}, motions=(sv.Translate("right", (0.5, 0.0)),))
    >>> for step in sv.deform(case, mesh):
    ...     print(step.index, step.mesh.points[:3, 0].round(2))
    1 [0.   1.28 2.5 ]
    """
    report = progress or (lambda _: None)
    prepared = prepare(case, mesh if reference is None else mesh.with_reference(reference))
    mesh = prepared.mesh
    check_limits = partial(rated_limits, prepared.case, mesh)
    with beginning_with(prepared.doubts):
        if isinstance(mesh, Assembly):
            motion = InterfaceMotion(prepared, mesh)
            run = partial(_steps_of_zone, certify=certify, converged=converged)
            runs = zone_runs(motion, run, report)
            steps = joined_steps(motion, runs)
        else:
            steps = _steps_of_zone(prepared, report, setup, certify=certify, converged=converged)
        for step in steps:
            yield replace(step, check_limits=check_limits)


def _steps_of_zone(
    prepared: Prepared,
    report: Report,
    setup: Setup | None = None,
    *,
    certify: bool,
    converged: bool,
) -> Iterator[Step]:
    case = prepared.case
    mesh = prepared.mesh
    timer = step_timer(report, 1, max(1, case.steps))
    if setup is None:
        with timer.phase("classify"):
            setup = make_setup(prepared)
    if converged:
        setup = setup.converging()
    require_memory(setup, case)
    mend = None
    if case.repair != "no" and not isinstance(mesh, Skin):
        # Late: scipy.sparse takes 0.1 s.
        from slideviz.solver.repair_stage import mended_step

        mend = partial(mended_step, case, mesh, setup, report)
    stepping = Stepping(case, mesh, setup, report, timer.seconds, certify=certify, mend=mend)
    before = mesh
    done = 0.0
    for step in all_steps(stepping):
        ends = mend is not None and step.index == step.total and step.repaired is None
        yield _mended(stepping, step, before, done) if ends else step
        before = step.mesh
        done = step.part


def _mended(stepping: Stepping, step: Step, before: Mesh, done: float) -> Step:
    """Return the last step with its bad cells mended, and checked again.

    ``before``, ``done``: the mesh before this step, and the part of the motion that it has.
    """
    assert stepping.mend is not None
    plain = step.mesh
    step = stepping.mend(step)
    if stepping.certify and step.mesh is not plain:
        part = done, step.part
        step = replace(step, safe=step_safety(before, step.mesh, stepping.mesh, part, step.index))
    assert step.repaired is not None
    misfit, apart = stepping.misfit(step)
    messages = dict.fromkeys((*step.messages, *step.repaired.warnings, *apart))
    return replace(step, periodic_misfit=misfit, messages=tuple(messages))


def all_steps(stepping: Stepping) -> Iterator[Step]:
    """Yield the steps of a case: as many as it asks for, or as STEPS= auto finds best.

    Their number is found without relaxation, and only the result is relaxed.
    """
    if stepping.case.steps:
        yield from stepping.steps(stepping.case.steps)
    elif stepping.setup.relaxation is None:
        yield from _automatic(stepping)
    else:
        plain = replace(stepping, setup=stepping.setup.at_step(False), certify=False)
        *_, last = found = list(_automatic(plain))
        yield from renumbered(list(stepping.steps([step.part for step in found])), last.tried)


def _automatic(stepping: Stepping) -> Iterator[Step]:
    """Yield the steps of the best number of steps (STEPS= auto).

    Numbers are tried in the order of ``COUNTS``, without those up to the number that the trial
    before came to by halving steps that fold cells. Better means fewer inverted cells, then a
    higher minimum quality. The search ends

    * when the best trial has no inverted cell and no halved step, and the next one has none either,
      and raises the minimum quality by at most the part ``steps_gain`` of it;
    * after two trials in a row that are no better or have no sound result. Two, because halved
      steps are small just where it matters: equal steps catch up only with a larger number, and
      because cells that fold with some number of steps need not fold with the next.

    Raises DeformError if a step cannot be solved, or no trial before the end of the search has a
    sound result.
    """
    tried: list[Trial] = []
    best: tuple[Trial, list[Step]] | None = None
    worse = 0
    failure = None
    for count in COUNTS:
        if tried and count <= tried[-1].steps:
            continue  # halving made so many already
        try:
            steps = list(stepping.steps(count, halve=True))
        except UnsoundError as problem:
            worse = worse + 1
            failure = problem
            if worse == 2:
                break
            continue
        found = stepping.quality_of(steps)
        trial = Trial(count, len(steps), found.min, found.mean, found.inverted)
        tried.append(trial)
        if best is not None and best[0].inverted == 0 and best[0].steps == best[0].planned:
            gain = stepping.case.steps_gain * best[0].min
            if not trial.inverted and trial.min - best[0].min <= gain:
                break
        if best is None or (-trial.inverted, trial.min) > (-best[0].inverted, best[0].min):
            best = (trial, steps)
            worse = 0
        else:
            worse += 1
        if worse == 2:
            break  # more steps do not help: two numbers in a row were no better
    if best is None:
        assert failure is not None
        raise failure
    yield from renumbered(best[1], tuple(tried))


def folded_at(steps: Sequence[Step], mesh: Mesh, cells: IntArray) -> IntArray:
    """Return the number of the step after which each cell is first inverted, (k,); 0 where never.

    ``steps``: all steps of a run, with their meshes.
    ``mesh``: the undeformed mesh.
    ``cells`` (k,): cells to follow, such as those inverted in the end.
    """
    first = np.zeros(len(cells), np.int64)
    if not len(cells):
        return first
    part = Mesh(mesh.points, mesh.cells.take(cells))
    rows: IntArray | slice = slice(None)
    if mesh.whole_cells is not None:
        part = mesh
        rows = cells
    for step in steps:
        status = quality(part.with_points(step.mesh.points), part).status[rows]
        first[(first == 0) & (status == INVERTED)] = step.index
    return first


def require_memory(setup: Setup, case: Case, *, lasting: bool = False) -> None:
    """Raise DeformError when a step's systems would not fit into memory; ``lasting``: `Problem`."""
    if case.method == "elastic":
        _require_free(
            ELASTIC_BYTES * len(setup.coords),
            f"linear elasticity of {len(setup.coords)} nodes needs",
            "use METHOD= rbf with DATA_REDUCTION= YES, METHOD= idw, or a coarser mesh",
        )
    if setup.relaxation is not None:
        _require_free(
            RELAX_BYTES * len(setup.coords),
            f"relaxation of {len(setup.coords)} nodes needs",
            "use RELAX= NO, or a coarser mesh",
        )
    if case.method != "rbf" or setup.reduction is not None:
        return  # nothing is dense; the selection keeps no matrix of all candidates
    sizes = _systems(setup, case, lasting=lasting)
    _require_free(
        8.0 * (sum(n**2 for n in sizes) + 1.6 * max(sizes) ** 2),
        f"{sum(sizes)} unknowns need",
        "give large boundaries far from the motion the role internal, use "
        f"{'SLIDING_MODE= ps, ' if case.sliding == 'ds' else ''}DATA_REDUCTION= YES, or a coarser "
        "mesh",
    )


def _systems(setup: Setup, case: Case, *, lasting: bool) -> list[int]:
    """Return the number of unknowns of each dense system whose factors are in memory together.

    These are upper bounds: parts of the boundary that supports do not connect have separate
    systems.

    Direct sliding has one system for each axis if normals are along axes. Where boundaries are
    curved, it solves a further one, for all boundary nodes.
    """
    goal = setup.goal(setup.target, 1.0)
    problem = problem_at(setup, setup.coords, goal)
    label, moves = problem.reach
    moves = moves | lasting
    moving = moves[label[setup.same_as]]
    known = int(moving[problem.known].sum())
    nodes = known + int(moving[problem.edge].sum() + moving[problem.surface].sum())
    normals = value(problem.normals)[moving[problem.normal_nodes]]
    if case.sliding != "ds" or not len(normals):
        return [nodes]
    dim = setup.coords.shape[1]
    along = np.concatenate([np.eye(dim), normals])
    block = blocks(ConstraintRows(np.arange(len(along)), along, np.zeros((len(along), 1))))
    each = np.bincount(block, np.r_[np.full(dim, known), np.ones(len(normals))])
    systems = [int(n) for n in each if n]
    if setup.tracks.curved:
        systems.append(nodes)
    return systems


def _require_free(needed: float, what: str, remedy: str) -> None:
    free = free_memory()
    if needed > free:
        raise DeformError(
            f"{what} {needed / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are free; {remedy}"
        )
