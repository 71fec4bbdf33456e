"""The staircase: ``deform(case, mesh)`` yields one deformed mesh for each step.

Whoever pulls the generator owns progress and cancel; the command line, a test and the window's
worker run the same code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from slideviz.case.model import Case
from slideviz.case.plan import Plan, make_plan
from slideviz.errors import DeformError
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.rbf.methods import METHODS
from slideviz.rbf.problem import Cycle, Problem, Solution, Watch

@dataclass(frozen=True)
class Progress:
    """How far the work is.

    Attributes
    ----------
    step, total : int
        The step in work (from 1), and all steps.
    phase : str
        ``classify``, ``solve``, ``evaluate`` or ``project``.
    fraction : float
        Of the phase, 0 to 1.
    """

    step: int
    total: int
    phase: str
    fraction: float


@dataclass(frozen=True, eq=False)
class Step:
    """The mesh after one step.

    Attributes
    ----------
    index, total : int
        Number of the step, from 1, and of all steps.
    mesh : Mesh
        The deformed mesh.
    control_nodes : int
        Nodes in the interpolation system of this step.
    max_error : float
        Largest misfit at nodes of known displacement before they are set exactly, in the mesh's
        length unit.
    condition : float
        Estimated condition number of the interpolation system.
    node_counts : Mapping of str to int
        ``moving``, ``fixed``, ``sliding_edge``, ``sliding_surface``, ``internal``.
    seconds : Mapping of str to float
        Spent in this step, by phase; ``classify`` only in the first.
    warnings : tuple of str
        What the user should know; those of all steps so far.
    history : tuple of Cycle
        Convergence of the greedy selection in this step; empty without data reduction.
    """

    index: int
    total: int
    mesh: Mesh
    control_nodes: int
    max_error: float
    condition: float
    node_counts: Mapping[str, int]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]
    history: tuple[Cycle, ...] = ()


def deform(
    case: Case, mesh: Mesh, progress: Callable[[Progress], None] | None = None
) -> Iterator[Step]:
    """Yield the deformed mesh of each step, 1 to ``case.steps``.

    Parameters
    ----------
    case
        Roles, motions and settings. Its ``mesh_file`` is not read.
    mesh
        The undeformed mesh.
    progress
        Called often with a ``Progress``; an exception it raises ends the run at once.

    Raises
    ------
    CaseError, MeshError
        The case does not fit the mesh.
    DeformError
        The system cannot be solved, or needs more memory than there is.

    Notes
    -----
    Thesis chapters 2 and 3: the displacement is divided by the number of steps, in the working
    frame, and every step solves at the positions the one before it left.
    """
    tell = progress or (lambda _: None)
    watch = Watch(lambda phase, fraction: tell(Progress(1, case.steps, phase, fraction)))
    with watch.phase("classify"):
        plan = make_plan(case, mesh)
    _require_memory(plan, case.sliding)
    warnings = [*case.warnings, *plan.warnings]
    coords = plan.coords
    for index in range(1, case.steps + 1):

        def report(phase: str, fraction: float, index: int = index) -> None:
            tell(Progress(index, case.steps, phase, fraction))

        watch = Watch(report, watch.seconds if index == 1 else {})
        goal = plan.coords[plan.known] + plan.target * (index / case.steps)
        solution = _step(plan, case.sliding, coords, goal, watch)
        coords = _moved(plan, coords, solution.displacement, goal)
        points = _cartesian(plan, mesh.points, coords)
        if not np.all(np.isfinite(points)):
            raise DeformError(f"step {index}: coordinates became infinite; use more steps")
        warnings += _dropped_warning(solution, index, mesh)
        yield Step(
            index,
            case.steps,
            mesh.with_points(points),
            solution.control_nodes,
            solution.max_error,
            solution.condition,
            plan.classes.counts(),
            watch.seconds,
            tuple(warnings),
            solution.history,
        )


def _step(plan: Plan, sliding: str, coords: FloatArray, goal: FloatArray, watch: Watch) -> Solution:
    """Return the displacement of all nodes from ``coords`` to the next step."""
    normal_nodes, normals = plan.constraints(coords)
    problem = Problem(
        basis=plan.basis,
        features=plan.frame.features(coords),
        known=plan.known,
        values=goal - coords[plan.known],
        edge=plan.classes.edge,
        surface=plan.classes.surface,
        normal_nodes=normal_nodes,
        normals=normals,
        same_as=plan.same_as,
        project=lambda nodes, free: plan.project(coords, nodes, free),
        curved=plan.tracks.curved,
        cartesian=plan.frame.points,
        coords=coords,
        shift=plan.frame.shift(),
        reduction=plan.reduction,
    )
    return METHODS[sliding](problem, watch)


def _moved(
    plan: Plan, coords: FloatArray, displacement: FloatArray, goal: FloatArray
) -> FloatArray:
    """Return the new coordinates; images move alike, and known nodes are where they must be."""
    if plan.periodic_displacement and len(plan.images):
        first, second = plan.images.T
        displacement[second] = displacement[first]
    displacement[plan.axis, :2] = 0.0
    # Adding zero would turn -0.0 into 0.0: nodes at rest keep every bit.
    moved = np.where(displacement == 0, coords, coords + displacement)
    moved[plan.known] = np.where(goal == plan.coords[plan.known], plan.coords[plan.known], goal)
    return moved


def _cartesian(plan: Plan, points: FloatArray, coords: FloatArray) -> FloatArray:
    """Return the Cartesian points; nodes whose coordinates did not change keep every bit."""
    if not plan.frame.cylindrical:
        return coords
    rest = np.all(coords == plan.coords, axis=1, keepdims=True)
    return np.where(rest, points, plan.frame.points(coords))


def _dropped_warning(solution: Solution, index: int, mesh: Mesh) -> list[str]:
    """Return the sentence about nodes that the pivot guard left out."""
    if not len(solution.dropped):
        return []
    node = int(solution.dropped[0])
    where = ", ".join(f"{v:.6g}" for v in mesh.points[node])
    sentence = (
        f"step {index}: {len(solution.dropped)} boundary nodes nearly coincide with others and "
        f"were left out as control nodes (first: node {node} at {where}); they are set exactly"
    )
    return [sentence]


def _require_memory(plan: Plan, sliding: str) -> None:
    """Raise DeformError when the dense system would not fit into memory."""
    counts, dim = plan.classes.counts(), plan.coords.shape[1]
    known = counts["moving"] + counts["fixed"]
    unknowns = known + counts["sliding_edge"] + counts["sliding_surface"]
    if sliding == "ds":
        unknowns = dim * known + (dim - 1) * counts["sliding_edge"] + counts["sliding_surface"]
    needed = 2.6 * 8 * unknowns**2
    free = _free_memory()
    if needed > free:
        raise DeformError(
            f"{unknowns} unknowns need {needed / 1e9:.1f} GB of memory, {free / 1e9:.1f} GB are "
            "free; give large boundaries far from the motion the role internal, use "
            "SLIDING_MODE= ps, or a coarser mesh"
        )


def _free_memory() -> float:
    """Return the bytes a process may still take; infinite where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:  # noqa: PTH123
            for line in lines:
                if line.startswith("MemAvailable:"):
                    return float(line.split()[1]) * 1024
    except OSError:
        pass
    return float("inf")
