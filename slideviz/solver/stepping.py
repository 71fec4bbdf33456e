"""Stepping: a deformation in a number of steps, each from the positions that the last one left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.model import Case
from slideviz.case.motions.box import moved_boxes
from slideviz.case.words import wrong_by
from slideviz.errors import DeformError, Message, Remark, UnsoundError, note, point_words
from slideviz.mesh.check import within
from slideviz.mesh.halo import Halo
from slideviz.mesh.interfaces import torn_interfaces
from slideviz.mesh.margin import path_margins, step_safety
from slideviz.mesh.model import FloatArray, IntArray, Mesh, sealed
from slideviz.mesh.quality import Quality, quality
from slideviz.rbf.constraint_rows import AGREE
from slideviz.rbf.frames import Frame
from slideviz.rbf.images import largest_misfit, misfits
from slideviz.rbf.operations import features
from slideviz.rbf.problem import FrozenChoices, PhaseTimer, Problem, Relaxed, StepSolution
from slideviz.rbf.refine import NOTED, TRUSTED
from slideviz.rbf.tape import Array, put, take, value
from slideviz.solver.growth import (
    farthest_node,
    less_smooth,
    listed_or,
    stray_warning,
    unsoundness,
    wall_warnings,
)
from slideviz.solver.layers import Room
from slideviz.solver.setup import Setup, sliding_normals
from slideviz.solver.steps import Report, Step, Trial, step_timer
from slideviz.system.threads import in_parts

THINNINGS = 3
"""How often the heights of layers that give way are found: at first from the room beside them where
they do not, then from that where they do."""

THINNER = 0.25
THICKER = 1.25
"""How much layers may become thinner or thicker each time, so that no cell beside them folds."""

Height = FloatArray | None
Way = tuple[Array, Relaxed | None]  # a displacement (..., n, d) after relaxation, and how it went

HALVINGS = 3  # how often at most a step that folds a cell is halved: into eighths
ENDED = 0.1  # the residual above which relaxation did not come to its end
ALIKE = 1.1  # a shorter step may go farther than the straight paths of a longer one by this factor


@frozen
class _Planned:
    """A step that is still to be made."""

    end: float  # the part of the displacement that is made after it
    halvings: int = 0  # how often it was halved

    def halved(self, begin: float, times: int) -> list[_Planned]:
        """Return two steps from ``begin``, of which the first is halved again; to ``HALVINGS``."""
        if not times or self.halvings == HALVINGS:
            return [self]
        first = _Planned((begin + self.end) / 2, self.halvings + 1)
        return [*first.halved(begin, times - 1), _Planned(self.end, first.halvings)]


@frozen
class _Finding:
    """Warnings and numbers of one step of a run, without its arrays."""

    index: int
    condition: float
    max_error: float
    error_estimate: float
    refined: float
    """`condition`, `max_error`, `error_estimate`, `refined`: as of `StepSolution`."""
    short: list[Remark]  # that its data reduction ended too early, or []
    dropped: list[Remark]  # that singular nodes were left out, or []
    others: list[Remark]  # what is said of every step


@record
class _State:
    """A deformation after some of its steps; the next one begins here."""

    mesh: Mesh
    coords: FloatArray  # (n, d): of all nodes, in the frame
    index: int = 0  # the number of steps so far
    part: float = 0.0  # of the displacement that is made
    solution: StepSolution | None = None  # of the last step
    findings: tuple[_Finding, ...] = ()  # of all steps so far
    inverted: int = 0  # inverted cells, where steps are halved


@record
class Stepping:
    """A deformation that can be made in any number of steps."""

    case: Case
    mesh: Mesh
    setup: Setup
    """`case`, `mesh`, `setup`: what is asked, the undeformed mesh, and the arrays made of both."""
    report: Report
    """Called with each ``Progress``; an exception it raises ends the run."""
    seconds: dict[str, float]
    """Spent before the first step, by phase; added to those of the first step."""
    rate: Callable[[Sequence[Step]], Quality] | None = None
    """Returns the quality of all cells after the last of the steps it is given, where ``mesh`` is
    only the skin of a streamed mesh; the steps then have a ``field``. None: the quality of the last
    step's mesh."""
    certify: bool = False  # whether each step says how far it may go (`Step.safe`)
    mend: Callable[[Step], Step] | None = None
    """Returns a step with its bad cells mended (REPAIR); None: they stay."""

    def steps(self, count: int | Sequence[float], halve: bool = False) -> Iterator[Step]:
        """Yield the steps that divide the displacement into ``count`` equal parts.

        Raises DeformError if a step cannot be solved, or its result cannot be right.
        ``halve``: whether a step that folds more cells or is unsound is replaced by two of half the
        length, and these again, up to ``HALVINGS`` times. ``count`` can also be the part of the
        displacement that is made after each step.
        """
        parts = [k / count for k in range(1, count + 1)] if isinstance(count, int) else count
        ahead = [_Planned(part) for part in parts]
        state = _State(self.mesh, self.setup.coords)
        made: list[Step] = []
        seconds = dict(self.seconds)
        while ahead:
            planned = ahead.pop(0)
            index = state.index + 1
            timer = step_timer(self.report, index, index + len(ahead), seconds)
            try:
                step, after = self._advanced(state, planned.end, len(ahead), timer)
                halvings = 0
                if halve:
                    made.append(step)
                    after = replace(after, inverted=self.quality_of(made).inverted)
                    halvings = self._halvings(state, after)
            except UnsoundError:
                if not halve or planned.halvings == HALVINGS:
                    raise
                halvings = 1
            if halvings and planned.halvings < HALVINGS:
                del made[state.index :]
                ahead = [*planned.halved(state.part, halvings), *ahead]
                continue
            if self.certify:
                with timer.phase("quality"):
                    ends = state.part, after.part
                    safe = step_safety(state.mesh, after.mesh, self.mesh, ends, index)
                step = replace(step, safe=safe)
            state = after
            yield self._checked(step, state.findings)
            seconds = {}

    def _advanced(
        self, state: _State, part: float, later: int, timer: PhaseTimer
    ) -> tuple[Step, _State]:
        """Return the step from a state to a part of the displacement, and the state after it.

        ``later``: the number of steps after it. The step has only those warnings that need its
        coordinates before REPAIR. Raises DeformError and UnsoundError as `steps` does.
        """
        setup = self.setup
        mesh = self.mesh
        index = state.index + 1
        goal = value(setup.goal(setup.target, part))
        solution = one_step(setup.at_step(not later), state.coords, goal, timer, state.solution)
        coords = displaced_coords(setup, state.coords, value(solution.displacement), goal)
        points = cartesian(setup.frame, mesh.points, setup.coords, coords)
        if mesh.halo is not None:
            points, coords = with_halo_copies(setup, mesh, mesh.halo, points, coords)
        if not within(points, np.finfo(float).max):
            raise DeformError(f"step {index}: coordinates became infinite; use more steps")
        farthest = farthest_node(setup.coords, coords)
        unsound = unsoundness(setup, mesh, solution, coords, part=part, farthest=farthest.length)
        if unsound:
            raise UnsoundError(f"step {index}: {unsound}")
        step = self._made(index, index + later, points, solution, timer, part)
        if self.rate is None and self.case.method == "rbf":
            if setup.frame.cylindrical:
                farthest = farthest_node(mesh.points, points)
            step = replace(step, messages=tuple(stray_warning(setup, mesh, points, farthest)))
        if self.mend is not None and self.case.repair_steps:
            step = self.mend(step)
            coords = mended_coords(setup, step, coords)
        findings = (*state.findings, _finding(setup, mesh, step, solution))
        return step, _State(step.mesh, coords, index, part, solution, findings)

    def _checked(self, step: Step, findings: Sequence[_Finding]) -> Step:
        """Return a step with all its warnings; ``findings``: of the steps up to this one."""
        misfit, apart = self.misfit(step)
        points = step.mesh.points
        left: list[Message] = []
        if step.index == step.total:
            left = wall_warnings(self.setup, self.case, self.mesh, points)
        messages = (
            *_run_warnings([*self.case.warnings, *self.setup.warnings], findings, self.setup),
            *apart,
            *torn_interfaces(self.mesh, points),
            *step.messages,
            *left,
        )
        return replace(step, messages=messages, periodic_misfit=misfit)

    def quality_of(self, steps: Sequence[Step]) -> Quality:
        """Return the quality after the last of some steps.

        Raises UnsoundError if a node outside of the skin of a streamed mesh would go far beyond the
        motion.
        """
        if self.rate is not None:
            return self.rate(steps)
        return quality(steps[-1].mesh, self.mesh, self.case.quality_metric)

    def _halvings(self, before: _State, after: _State) -> int:
        """Return how often to halve the step between two states; 0 where it folds no more cells.

        A shorter step nearly takes the same straight paths, so that it folds a cell that folds on
        them before its end: solving it would be in vain.
        """
        if after.inverted <= before.inverted:
            return 0
        if not len(self.mesh.cells):  # the skin of a streamed mesh
            return 1
        margins = path_margins(after.mesh, before.mesh, self.mesh)
        safe = float(margins[margins > 0].min(initial=1.0)) * ALIKE
        return next((k for k in range(1, HALVINGS) if 0.5**k <= safe), HALVINGS)

    def misfit(self, step: Step) -> tuple[float | None, list[str]]:
        """Return the misfit of periodic images, and a warning where cells are inverted as well.

        Inverted cells are what a run then fails by. Raises DeformError where no cell is inverted.
        """
        setup = self.setup
        state = setup.frame, setup.coords, step.mesh.points, setup.images
        try:
            return largest_misfit(*state), []
        except DeformError as problem:
            if self.rate is not None or not self.quality_of([step]).inverted:
                raise
            return float(misfits(*state).max()), [f"step {step.index}: {problem}"]

    def _made(
        self,
        index: int,
        total: int,
        points: FloatArray,
        solution: StepSolution,
        timer: PhaseTimer,
        part: float,
    ) -> Step:
        zone = self.setup.zone
        return Step(
            index=index,
            total=total,
            mesh=moved_boxes(self.case, self.mesh, part).with_points(sealed(points)),
            control_nodes=solution.control_nodes,
            max_error=solution.max_error,
            condition=solution.condition,
            node_counts=self.setup.classes.counts(),
            seconds=timer.seconds,
            messages=(),
            history=solution.history,
            control=solution.control,
            candidates=self.setup.candidates,
            tolerance=self.setup.reduction.tolerance if self.setup.reduction else None,
            layers=self.setup.layers,
            part=part,
            support_radius=self.setup.basis.radius if self.case.method == "rbf" else None,
            field=solution.field if self.rate is not None else None,
            relaxed=solution.relaxed,
            kept_layers=None if zone is None else zone.summary(solution.layer_height, points),
        )


def mended_coords(setup: Setup, step: Step, moved: FloatArray) -> FloatArray:
    """Return the coordinates (n, d) of a step after its repair; ``moved`` are those before."""
    if step.repaired is None or not len(step.repaired.nodes):
        return moved
    nodes = step.repaired.nodes
    now = moved.copy()
    now[nodes] = setup.frame.coords(step.mesh.points[nodes])
    return now


def renumbered(steps: list[Step], tried: tuple[Trial, ...]) -> Iterator[Step]:
    """Yield the steps with their final ``total``, the last one with the trials as ``tried``."""
    for step in steps:
        last = step is steps[-1]
        yield replace(step, total=len(steps), tried=tried if last else ())


def one_step(
    setup: Setup,
    coords: Array,
    goal: Array,
    timer: PhaseTimer,
    before: StepSolution | None,
    frozen: FrozenChoices | None = None,
) -> StepSolution:
    """Return the solution of one step from ``coords`` (n, d), with the displacement of all nodes.

    Of periodic images only the representative is in the problem; its displacement is copied to the
    others.
    ``goal`` (..., a, d): coordinates of the known nodes after the step.
    ``before``: the solution of the step before.
    ``frozen``: the choices of a step whose derivatives are wanted; None in a run.
    """
    problem = problem_at(setup, coords, goal, before, frozen)
    solution = setup.solve(problem, timer)
    first, second = setup.images.T

    def tie(displacement: Array) -> Array:
        return put(displacement, second, take(displacement, first), overwrite=True)

    relaxation = setup.relaxation
    if relaxation is None:
        keep = keep_layers(setup, problem, goal, timer)
        return replace(solution, displacement=tie(keep(solution.displacement)))

    def relax(problem: Problem, field: Array, goal: Array, height: Height, start: Height) -> Way:
        """Free nodes begin at the displacement ``start`` (n, d); None: at that of the field."""
        kept = tie(keep_layers(setup, problem, goal, timer, height)(field))
        if start is not None:
            held = np.concatenate([setup.known, setup.rigid])
            free = np.flatnonzero(~np.isin(setup.same_as, setup.same_as[held]))
            kept = put(kept, free, start[free])
        return relaxation.relaxed(
            problem, kept, setup.rigid, setup.constraints, setup.project, tie, timer
        )

    field = value(solution.displacement).copy()
    plain = problem if frozen is None else problem_at(setup, value(coords), value(goal))

    def run(height: Height, start: Height) -> Way:
        return relax(plain, field.copy(), value(goal), height, start)

    find = partial(_heights_left, setup, plain, run)
    if frozen is None:
        moved, relaxed, height = find()
    else:
        height = None if setup.zone is None else frozen.choose("layers", lambda: find()[2])
        start = None if height is None else value(run(None, None)[0])
        moved, relaxed = relax(problem, solution.displacement, goal, height, start)
    return replace(solution, displacement=moved, relaxed=relaxed, layer_height=height)


def _heights_left(
    setup: Setup, problem: Problem, relax: Callable[[Height, Height], Way]
) -> tuple[Array, Relaxed | None, Height]:
    """Return a displacement (n, d) after relaxation, how it went, and the heights that are left.

    The latter (z,) are parts of the heights of layers; None where no layer gave way.
    ``relax``: with such heights, and from a displacement (n, d).
    """
    moved, relaxed = relax(None, None)
    zone = setup.zone
    if zone is None or setup.relaxation is None or not setup.minimum_gap:
        return moved, relaxed, None
    domain = setup.relaxation.domain
    room = Room.beside(zone, domain.cells, domain.points)
    height = np.ones(len(zone.nodes))
    for k in range(THINNINGS):
        there = setup.frame.points(value(problem.coords) + value(moved))
        found = room.heights(there, setup.minimum_gap)
        if k == 0 and (found == 1.0).all():
            return moved, relaxed, None
        height = np.clip(found, THINNER * height, THICKER * height)
        before = relaxed
        moved, relaxed = relax(height, value(moved))
        if relaxed is not None and before is not None:
            relaxed = replace(relaxed, rounds=before.rounds + relaxed.rounds)
    return moved, relaxed, height


def keep_layers(
    setup: Setup,
    problem: Problem,
    goal: Array,
    timer: PhaseTimer,
    height: FloatArray | None = None,
) -> Callable[[Array], Array]:
    """Return a function of displacements (..., n, d) that lets walls carry the nodes near them.

    Those that slide are then projected. ``goal`` as of `one_step`.
    ``height`` (z,): the part of their height that is left of the layers; None: all of it.
    """
    zone = setup.zone
    if zone is None:
        return lambda displacement: displacement
    with timer.phase("layers"):
        motion = zone.walls.motion(goal)
        carried = zone.carried(motion)
        if height is not None:
            carried = zone.thinned(carried, zone.feet(motion[0]), height)
        coords = take(problem.coords, zone.nodes)

    def keep(displacement: Array) -> Array:
        with timer.phase("layers"):
            moved = zone.displacement(coords, take(displacement, zone.nodes), carried)
            if len(zone.sliding):
                slid = problem.project(zone.nodes[zone.sliding], take(moved, zone.sliding))
                moved = put(moved, zone.sliding, slid, overwrite=True)
            return put(displacement, zone.nodes, moved, overwrite=True)

    return keep


def problem_at(
    setup: Setup,
    coords: Array,
    goal: Array,
    before: StepSolution | None = None,
    frozen: FrozenChoices | None = None,
) -> Problem:
    """Return the problem of the step from ``coords`` (n, d) with known nodes at ``goal`` (a, d)."""
    once = np.flatnonzero(setup.once(setup.known))
    known = setup.known[once]
    classes = setup.classes

    def fixed(name: str, make: Callable[[], Any]) -> Any:
        return make() if frozen is None else frozen.fixed(name, make)

    def project(nodes: IntArray, free: Array) -> Array:
        if frozen is not None:
            return frozen.project(nodes, free)
        return setup.project(value(coords), nodes, value(free))

    normal_nodes, normals = fixed("normals", lambda: sliding_normals(setup, coords))
    return Problem(
        basis=setup.basis,
        features=fixed("features", lambda: features(setup.frame, coords)),
        known=known,
        values=take(goal, once) - take(coords, known),
        edge=classes.edge[setup.once(classes.edge)],
        surface=classes.surface[setup.once(classes.surface)],
        normal_nodes=normal_nodes,
        normals=normals,
        same_as=setup.same_as,
        project=project,
        curved=setup.tracks.curved,
        cartesian=setup.frame.points,
        coords=coords,
        shift=setup.frame.shift(),
        reduction=setup.reduction,
        before=before,
        frozen=frozen,
    )


def displaced_coords(
    setup: Setup, coords: FloatArray, displacement: FloatArray, goal: FloatArray
) -> FloatArray:
    """Return displaced coordinates (n, d), over the displacement; known nodes at ``goal``."""
    moved = shifted(coords, displacement, setup.axis)
    moved[setup.known] = np.where(
        goal == setup.coords[setup.known], setup.coords[setup.known], goal
    )
    return moved


def shifted(coords: FloatArray, displacement: FloatArray, axis: np.ndarray) -> FloatArray:
    """Return coordinates (n, d) after a displacement, written over it; ``axis`` (n,) stays."""
    displacement[axis, :2] = 0.0

    def add(part: slice) -> None:
        # Adding zero would turn -0.0 into 0.0: nodes at rest keep every bit.
        by = displacement[part]
        before = coords[part]
        displacement[part] = np.where(by == 0, before, before + by)

    in_parts(add, len(coords))
    return displacement


def cartesian(
    frame: Frame, points: FloatArray, start: FloatArray, coords: FloatArray
) -> FloatArray:
    """Return the Cartesian points (n, d) of coordinates ``coords`` (n, d) in the frame.

    Nodes whose coordinates still are their undeformed ones, ``start`` (n, d), get their undeformed
    ``points`` (n, d), to the bit.
    """
    if not frame.cylindrical:
        return coords
    out = np.empty_like(points)

    def fill(part: slice) -> None:
        unmoved = np.all(coords[part] == start[part], axis=1, keepdims=True)
        out[part] = np.where(unmoved, points[part], frame.points(coords[part]))

    in_parts(fill, len(points))
    return out


def with_halo_copies(
    setup: Setup, mesh: Mesh, halo: Halo, points: FloatArray, moved: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Cartesian ``points`` and coordinates ``moved`` (n, d), with halo copies moved, too."""
    rows = setup.copies
    points = halo.move_receivers(mesh.points, points, rows)
    out = moved.copy()
    out[halo.receivers[rows]] = setup.frame.coords(points[halo.receivers[rows]])
    return points, out


def _finding(setup: Setup, mesh: Mesh, step: Step, solution: StepSolution) -> _Finding:
    others: list[Remark] = [f"step {step.index}: {text}" for text in solution.warnings]
    if step.repaired is not None:
        others += step.repaired.warnings
    if step.kept_layers is not None:
        others += map(str, step.kept_layers.gave_way)
    if solution.relaxed is not None and solution.relaxed.residual > ENDED:
        others.append(
            f"step {step.index}: relaxation ended before the energy of the cells was least (after "
            f"{solution.relaxed.rounds} iterations, to {solution.relaxed.residual:.1g}); more "
            "STEPS or a smaller motion may help"
        )
    return _Finding(
        index=step.index,
        condition=solution.condition,
        max_error=solution.max_error,
        error_estimate=solution.error_estimate,
        refined=solution.refined,
        short=[_short_warning(setup, solution, step.index)] if solution.short else [],
        dropped=_dropped_warning(setup, solution, step.index, step.total, mesh),
        others=others,
    )


def _run_warnings(
    before: Sequence[Remark], findings: Sequence[_Finding], setup: Setup
) -> list[Remark]:
    """Return the warnings of a run after some steps, each once.

    Of the reductions that ended too early the one with the largest error is told, else the first
    step that left out nodes; and the step whose solution is worst.
    ``before``: warnings from before the first step.
    """
    others = [text for finding in findings for text in finding.others]
    ended = [finding for finding in findings if finding.short]
    if ended:
        of_nodes = max(ended, key=lambda finding: finding.max_error).short
    else:
        of_nodes = next((finding.dropped for finding in findings if finding.dropped), [])
    worst = max(
        findings, key=lambda finding: (finding.error_estimate, finding.refined, finding.index)
    )
    remedy = f"use {listed_or(less_smooth(setup))}"
    numbers = worst.error_estimate, worst.refined, worst.index, worst.condition
    doubt = _doubt_warning(*numbers, remedy)
    return [*dict.fromkeys([*before, *others]), *of_nodes, *doubt]


def _short_warning(setup: Setup, solution: StepSolution, index: int) -> str:
    assert setup.reduction is not None
    return (
        f"step {index}: the data reduction ended with {solution.control_nodes} control nodes at an "
        f"error of {solution.max_error:.3g}, above its tolerance of "
        f"{setup.reduction.tolerance:.3g}: {solution.short}. Boundary nodes still get exactly "
        "their displacement, but the mesh near them follows only through the correction"
    )


def _doubt_warning(
    error_estimate: float, refined: float, index: int, condition: float, remedy: str
) -> list[Remark]:
    """Return the warning that a solution cannot be trusted, the note that it was refined, or []."""
    nearly = f"the system is nearly singular (condition number {condition:.0e})"
    if error_estimate > TRUSTED:
        sentence = (
            f"step {index}: {nearly}, so that between the boundary nodes the displacement may be "
            f"wrong by {wrong_by(error_estimate, bounded=refined > 0.0)}; {remedy}"
        )
        return [sentence if error_estimate > NOTED else note(sentence)]
    if refined:
        return [
            note(
                f"step {index}: nothing is wrong: {nearly}, so it was refined with twice the "
                f"digits, and displacements are off by {100 * error_estimate:.2g} % of the "
                f"largest instead of {100 * refined:.2g} %"
            )
        ]
    return []


def _dropped_warning(
    setup: Setup, solution: StepSolution, index: int, total: int, mesh: Mesh
) -> list[Remark]:
    """Return the warning, or the note if negligible, that singular nodes were left out; or []."""
    if not len(solution.dropped):
        return []
    since = f"from step {index} on, " if total > 1 else ""
    if setup.basis.saddle:
        sentence = (
            f"{since}the system is singular for RBF_KERNEL= {setup.basis.kernel}, so the "
            f"{solution.control_nodes} control nodes are fitted by least squares (residual "
            f"{solution.dropped_error:.2g}). They still get exactly their displacement; "
            "neighbouring cells absorb the residual; use RBF_KERNEL= wendland-c2"
        )
        return [sentence]
    node = int(solution.dropped[0])
    where = point_words(mesh.points[node], mesh.extent)
    which = f"node {mesh.number(node)} at {where}"
    if len(solution.dropped) == 1:
        said = (
            f"boundary {which} is left out of the control nodes because it nearly coincides with "
            "another; it still gets exactly its displacement"
        )
    else:
        said = (
            f"{len(solution.dropped)} boundary nodes are left out of the control nodes because "
            f"they nearly coincide with others (first: {which}); they still get exactly their "
            "displacement"
        )
    sentence = (
        f"{since}{said}. The interpolation error there is at most {solution.dropped_error:.2g}; "
        "neighbouring cells absorb it"
    )
    harmless = solution.dropped_error <= AGREE * mesh.extent
    return [note(sentence) if harmless else sentence]
