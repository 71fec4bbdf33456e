"""Stepping: a deformation in a number of steps, each from the positions that the last one left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slideviz.case.model import Case
from slideviz.case.motions.box import moved_boxes
from slideviz.case.words import wrong_by
from slideviz.errors import DeformError, Note, UnsoundError
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
from slideviz.rbf.problem import FrozenChoices, PhaseTimer, Problem, Solution
from slideviz.rbf.refine import NOTED, TRUSTED
from slideviz.rbf.tape import Array, put, take, value
from slideviz.solver.growth import farthest_node, stray_warning, unsoundness, wall_warnings
from slideviz.solver.normals import sliding_normals
from slideviz.solver.setup import Setup
from slideviz.solver.steps import Progress, Step, Trial
from slideviz.system.threads import in_parts

RIGID = 0.99
"""Nodes that walls carry with a share above this stay where they carry them in relaxation."""

HALVINGS = 3  # how often at most a step that folds a cell is halved: into eighths
ALIKE = 1.1  # a shorter step may go farther than the straight paths of a longer one by this factor


@dataclass(frozen=True, eq=False)
class Stepping:
    """A deformation that can be made in any number of steps."""

    case: Case
    mesh: Mesh
    setup: Setup
    """`case`, `mesh`, `setup`: what is asked, the undeformed mesh, and the arrays made of both."""
    report: Callable[[Progress], None]
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
        setup = self.setup
        mesh = self.mesh
        parts = [k / count for k in range(1, count + 1)] if isinstance(count, int) else count
        ahead = [(part, 0) for part in parts]
        coords = setup.coords
        done = 0.0
        index = 0
        folded = 0
        warnings = [*self.case.warnings, *setup.warnings]
        remarks: list[str] = []
        worst = 0.0
        least = (0.0, 0.0, 0, 0.0)
        seconds = dict(self.seconds)
        before: Solution | None = None
        made: list[Step] = []
        last = mesh
        while ahead:
            part, halvings = ahead[0]
            total = index + len(ahead)
            at = index + 1, total
            timer = PhaseTimer(lambda *now, at=at: self.report(Progress(*at, *now)), seconds)
            goal = value(setup.goal(setup.target, part))
            solution = one_step(setup.at_step(len(ahead) == 1), coords, goal, timer, before)
            moved = displaced_coords(setup, coords, value(solution.displacement), goal)
            points = cartesian(setup.frame, mesh.points, setup.coords, moved)
            if mesh.halo is not None:
                points, moved = with_halo_copies(setup, mesh, mesh.halo, points, moved)
            if not within(points, np.finfo(float).max):
                raise DeformError(f"step {index + 1}: coordinates became infinite; use more steps")
            step = self._made(index + 1, total, points, solution, timer, part)
            farthest = farthest_node(setup.coords, moved)
            unsound = unsoundness(setup, mesh, solution, moved, part=part, farthest=farthest.length)
            failure = UnsoundError(f"step {index + 1}: {unsound}") if unsound else None
            if self.mend is not None and self.case.repair_steps and not failure:
                step = self.mend(step)
                points = step.mesh.points
                moved = mended_coords(setup, step, moved)
            if halve:
                try:
                    now = self.quality_of([*made, step]).inverted
                except UnsoundError as problem:
                    now = folded
                    failure = failure or problem
                if (now > folded or failure) and halvings < HALVINGS:
                    needed = 1 if failure else self._halvings(last, step.mesh)
                    for k in range(halvings + 1, min(halvings + needed, HALVINGS) + 1):
                        ahead[0] = part, k
                        part = (done + part) / 2
                        ahead.insert(0, (part, k))
                    continue
                folded = now
                made.append(step)
            if failure:
                raise failure
            if self.certify:
                with timer.phase("quality"):
                    safe = step_safety(last, step.mesh, mesh, (done, part), index + 1)
                step = replace(step, safe=safe)
            coords = moved
            done = part
            index = index + 1
            last = step.mesh
            before = solution
            ahead.pop(0)
            if solution.short and solution.max_error > worst:
                remarks = [_short_warning(setup, solution, index)]
                worst = solution.max_error
            elif not remarks:
                remarks = _dropped_warning(setup, solution, index, total, mesh)
            warnings += [f"step {index}: {text}" for text in solution.warnings]
            if step.repaired is not None:
                warnings += [text for text in step.repaired.warnings if text not in warnings]
            if solution.relaxed is not None and solution.relaxed.limited:
                warnings.append(_limited_note(solution.relaxed.limited, len(coords), index))
            stray = []
            if self.rate is None and self.case.method == "rbf":
                if setup.frame.cylindrical:
                    farthest = farthest_node(mesh.points, points)
                stray = stray_warning(setup, mesh, points, farthest)
            left = [] if ahead else wall_warnings(setup, self.case, mesh, points)
            least = max(
                least, (solution.error_estimate, solution.refined, index, solution.condition)
            )
            misfit, apart = self.misfit(step)
            yield replace(
                step,
                warnings=(
                    *warnings,
                    *remarks,
                    *_doubt_warning(*least),
                    *apart,
                    *torn_interfaces(mesh, points),
                    *stray,
                    *left,
                ),
                periodic_misfit=misfit,
            )
            seconds = {}

    def quality_of(self, steps: Sequence[Step]) -> Quality:
        """Return the quality after the last of some steps.

        Raises UnsoundError if a node outside of the skin of a streamed mesh would go far beyond the
        motion.
        """
        if self.rate is not None:
            return self.rate(steps)
        return quality(steps[-1].mesh, self.mesh, self.case.quality_metric)

    def _halvings(self, before: Mesh, after: Mesh) -> int:
        """Return how often to halve a step that folds cells, at least once.

        A shorter step nearly takes the same straight paths, so that it folds a cell that folds on
        them before its end: solving it would be in vain.
        """
        if not len(self.mesh.cells):  # the skin of a streamed mesh
            return 1
        found = path_margins(after, before, self.mesh)
        safe = float(found[found > 0].min(initial=1.0)) * ALIKE
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
        solution: Solution,
        timer: PhaseTimer,
        part: float,
    ) -> Step:
        return Step(
            index=index,
            total=total,
            mesh=moved_boxes(self.case, self.mesh, part).with_points(sealed(points)),
            control_nodes=solution.control_nodes,
            max_error=solution.max_error,
            condition=solution.condition,
            node_counts=self.setup.classes.counts(),
            seconds=timer.seconds,
            warnings=(),
            history=solution.history,
            control=solution.control,
            candidates=self.setup.candidates,
            tolerance=self.setup.reduction.tolerance if self.setup.reduction else None,
            layers=self.setup.layers,
            part=part,
            support_radius=self.setup.basis.radius if self.case.method == "rbf" else None,
            field=solution.field if self.rate is not None else None,
            relaxed=solution.relaxed,
            kept_layers=self.setup.zone.summary() if self.setup.zone is not None else None,
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
    before: Solution | None,
    frozen: FrozenChoices | None = None,
) -> Solution:
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

    keep = keep_layers(setup, problem, goal, timer)
    displacement = tie(keep(solution.displacement))
    relaxed = None
    if setup.relaxation is not None:
        displacement, relaxed = setup.relaxation.relaxed(
            problem, displacement, _rigid(setup), setup.constraints, tie, timer
        )
    return replace(solution, displacement=displacement, relaxed=relaxed)


def _rigid(setup: Setup) -> IntArray:
    """Return the nodes (r,) that walls carry nearly alone."""
    zone = setup.zone
    if zone is None:
        return setup.known[:0]
    return zone.nodes[zone.share[:, 0] > RIGID]


def keep_layers(
    setup: Setup, problem: Problem, goal: Array, timer: PhaseTimer
) -> Callable[[Array], Array]:
    """Return a function of displacements (..., n, d) that lets walls carry the nodes near them.

    Those that slide are then projected. ``goal`` as of `one_step`.
    """
    zone = setup.zone
    if zone is None:
        return lambda displacement: displacement
    with timer.phase("layers"):
        carried = zone.carried(zone.walls.motion(goal))
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
    before: Solution | None = None,
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


def _short_warning(setup: Setup, solution: Solution, index: int) -> str:
    assert setup.reduction is not None
    return (
        f"step {index}: the data reduction ended with {solution.control_nodes} control nodes at an "
        f"error of {solution.max_error:.3g}, above its tolerance of "
        f"{setup.reduction.tolerance:.3g}: {solution.short}. Boundary nodes still get exactly "
        "their displacement, but the mesh near them follows only through the correction"
    )


def _limited_note(limited: int, nodes: int, index: int) -> Note:
    return Note(
        f"step {index}: the relaxation was held back at {limited} of {nodes} nodes, where it would "
        f"have made the worst cells worse{'; more STEPS may help' if index == 1 else ''}"
    )


def _doubt_warning(
    error_estimate: float, refined: float, index: int, condition: float
) -> list[str]:
    """Return the warning that a solution cannot be trusted, the note that it was refined, or []."""
    nearly = f"the system is nearly singular (condition number {condition:.0e})"
    if error_estimate > TRUSTED:
        sentence = (
            f"step {index}: {nearly}, so that between the boundary nodes the displacement may be "
            f"wrong by {wrong_by(error_estimate, bounded=refined > 0.0)}; use "
            "DATA_REDUCTION= YES, a less smooth RBF_KERNEL such as wendland-c0, or a smaller "
            "INFLUENCE_FACTOR"
        )
        return [sentence if error_estimate > NOTED else Note(sentence)]
    if refined:
        return [
            Note(
                f"step {index}: {nearly}; between the boundary nodes its solution would be wrong "
                f"by {100 * refined:.2g} % of the largest displacement, so it was refined with "
                f"twice the digits, to {100 * error_estimate:.2g} %"
            )
        ]
    return []


def _dropped_warning(
    setup: Setup, solution: Solution, index: int, total: int, mesh: Mesh
) -> list[str]:
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
    where = ", ".join(f"{v:.6g}" for v in mesh.points[node])
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
    return [Note(sentence) if harmless else sentence]
