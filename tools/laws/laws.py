"""The laws: what holds for every deformation, whatever the mesh, the method and the numbers.

Each is a function of a run and its steps that yields a sentence for what breaks it. Tolerances
are in parts of the mesh: ``ROUND`` of its largest coordinate for what is exact but for rounding,
``SAME`` of its extent for what two orders of one sum may differ by.
"""

from __future__ import annotations

import re
import signal
import traceback
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from types import FrameType

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.mesh.jacobians import INVERTED, VALID
from slideviz.mesh.model import Mesh
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import quality
from slideviz.rbf.reduction import GAMMA
from slideviz.solver.deform import deform
from slideviz.solver.steps import Step
from slideviz.terms import KERNELS
from tests.oracles.gmsh_jacobians import smallest_jacobians
from tools.laws import stages
from tools.laws.cases import Run
from tools.laws.meshes import images, renumbered
from tools.laws.oracle import Frame, carried, goals, nodes_with
from tools.laws.surfaces import off_surface

LIMIT_S = 60.0
"""Seconds that one deformation may take: the meshes are small."""


class TooLong(BaseException):
    """A deformation did not come to an end; no handler of the program may catch it."""


def tried(case: Case, mesh: Mesh) -> tuple[list[Step] | None, BaseException | None]:
    """Return the steps of a deformation, or what ended it before."""
    before = signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            return list(deform(case, mesh)), None
    except (Exception, TooLong) as problem:
        return None, problem
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _ring(_number: int, _frame: FrameType | None) -> None:
    raise TooLong(f"more than {LIMIT_S:.0f} s")


def told(problem: BaseException | None) -> str:
    """Return an error and where it came from, in one line."""
    assert problem is not None
    last = traceback.extract_tb(problem.__traceback__)
    place = next((f for f in reversed(last) if "slideviz" in f.filename), last[-1])
    where = f"{place.filename.rpartition('slideviz/')[2]}:{place.lineno}"
    return f"{type(problem).__name__} at {where}: {str(problem)[:200]}"


ROUND = 500 * np.finfo(float).eps
SAME = {"rbf": 1e-9, "idw": 1e-9, "elastic": 1e-7}
"""Linear elasticity is solved to 1e-9 (``linear_systems.TOLERANCE``) of the displacement, or at
least to 1e-7 (``linear_systems.LIMIT``); where it was not, the run is refused and nothing is
asked."""

WRONG_BY = re.compile(r"may be wrong by (?:up to )?(\S+) % of the largest")
"""Words on the worst step of a run whose system is nearly singular."""

# The like of `slideviz.solver.growth`, written again so that each checks the other.
TINY = 1e-13
"""Jacobian determinants are rounding below this part of the extent, squared or cubed."""

GROWTH = 5.0
"""Times what the motion of boundaries carries over the mesh."""

TAKEN = 1.5
"""Boundaries that go farther than so many times the largest displacement carry nothing."""


def _magnitude(run: Run) -> float:
    """Return the size of the numbers that positions are computed from."""
    far = [run.mesh.extent, float(np.abs(run.mesh.points).max())]
    if run.period is not None and run.period.angle_deg:
        far.append(float(np.abs(run.period.origin).max()))
    return max(far)


def moving_are_exact(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield which moving nodes do not end where the motions put them."""
    where = goals(run.case, run.mesh)
    nodes = np.array(list(where))
    gap = np.abs(steps[-1].mesh.points[nodes] - np.array(list(where.values()))).max(axis=1)
    if gap.max() > ROUND * _magnitude(run):
        yield f"node {nodes[gap.argmax()]} is off by {gap.max() / run.mesh.extent:.2g}"


def fixed_keep_every_bit(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield what moved of fixed markers, and of sliding ones without a sliding method."""
    roles = ["fixed"]
    if run.case.sliding == "none":
        roles.append("sliding")
        if run.case.periodic in ("none", "periodic"):
            roles.append("periodic")
    still = np.setdiff1d(
        nodes_with(run.case, run.mesh, *roles), nodes_with(run.case, run.mesh, "moving")
    )
    for step in steps:
        same = (step.mesh.points[still] == run.mesh.points[still]).all(axis=1)
        if step.mesh.points[still].tobytes() != run.mesh.points[still].tobytes():
            yield f"step {step.index}: {np.count_nonzero(~same)} moved, first {still[~same][:1]}"
            return


def images_stay_images(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield which images are none any more; with any periodic distance they must stay so."""
    if run.period is None or run.case.periodic == "none":
        return
    a, b = images(run.made, run.period).T
    first = np.abs(carried(run.period, run.mesh.points[a]) - run.mesh.points[b]).max()
    for step in steps:
        x = step.mesh.points
        gap = np.abs(carried(run.period, x[a]) - x[b]).max(axis=1)
        if gap.max() > first + ROUND * _magnitude(run):
            row = gap.argmax()
            part = gap[row] / run.mesh.extent
            yield f"step {step.index}: nodes {a[row]} and {b[row]} are off by {part:.2g}"
            return


def sliding_stay_on_surface(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield which sliding nodes left their undeformed surface."""
    yield from off_surface(run, steps[-1].mesh.points, ROUND * _magnitude(run))


def doubt(mesh: Mesh, steps: list[Step]) -> float:
    """Return by which part of the mesh a run says that it may be wrong: its system is singular."""
    parts = [float(part) for text in steps[-1].warnings for part in WRONG_BY.findall(text)]
    largest = np.linalg.norm(steps[-1].mesh.points - mesh.points, axis=1).max()
    return float(len(steps) * max(parts, default=0.0) / 100 * largest / mesh.extent)


def numbering_does_not_matter(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield what another order of nodes, cells and marker elements changes."""
    mesh, order = renumbered(run.mesh, np.random.default_rng([run.seed, 5]))
    again, problem = tried(run.case, mesh)
    if again is None:
        yield f"renumbered it ends with {told(problem)}"
        return
    if len(again) != len(steps):
        yield f"{len(steps)} steps, renumbered {len(again)}"
        return
    if any("were solved to" in text for text in steps[-1].warnings):
        return
    gap = np.abs(again[-1].mesh.points - steps[-1].mesh.points[order]).max() / run.mesh.extent
    if gap > SAME[run.case.method] + doubt(run.mesh, steps) + doubt(mesh, again):
        yield f"differs by {gap:.2g} (condition {steps[-1].condition:.1g})"


def growth_is_bounded(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield which node goes much farther than the boundaries that move and slide carry it.

    One that turns or stretches by some part of its own size carries what is far away by that part
    of the whole mesh. What sliding boundaries do is bounded by the moving ones alone.
    """
    mesh, frame = run.mesh, Frame(run.mesh, run.period)
    at = frame.coords(mesh.points)
    made = frame.way(mesh.points, steps[-1].mesh.points)
    length = np.linalg.norm(made, axis=1)
    moving = nodes_with(run.case, mesh, "moving")
    reach = [float(length[moving].max())]
    remaining = np.setdiff1d(np.arange(len(at)), moving)
    slid = np.intersect1d(remaining, nodes_with(run.case, mesh, "sliding"))
    for nodes in (slid, remaining):
        for marker in mesh.markers:
            mine = np.setdiff1d(marker.nodes, remaining if nodes is slid else [])
            if len(mine) > 1 and length[mine].max() <= TAKEN * reach[0]:
                size = np.linalg.norm(at[mine] - at[mine].mean(axis=0), axis=1).max()
                unlike = np.linalg.norm(made[mine] - made[mine].mean(axis=0), axis=1).max()
                reach.append(float(unlike / size * np.ptp(at, axis=0).max()))
        far = length[nodes] > GROWTH * max(reach) + ROUND * _magnitude(run)
        if far.any():
            node = nodes[np.argmax(length[nodes])]
            yield f"node {node} moves {length[node] / max(reach[0], 1e-300):.3g} times as far"
            return


def out_of_reach_keep_every_bit(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield which node moved though no support can reach it.

    Moving nodes reach others of the boundary by the support radius, these again others, and so on;
    the correction reaches as far as its factor times the largest error, walls with layers as far as
    these are thick.
    """
    case, mesh, radius = run.case, run.mesh, steps[-1].support_radius
    if radius is None or run.period is not None or not KERNELS[case.kernel].compact:
        return
    if case.polynomial == "yes":
        return
    gamma = GAMMA if case.reduction is None else case.reduction.gamma
    way = np.abs([step.mesh.points - mesh.points for step in steps]).max(axis=0)
    reach = max(radius, gamma * max(step.max_error for step in steps), case.layer_thickness)
    reach = 1.001 * reach + 4.0 * float(way.max())
    if reach > np.linalg.norm(np.ptp(mesh.points, axis=0)):
        return
    boundary = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    tree = cKDTree(mesh.points[boundary])
    pairs = tree.query_pairs(reach, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(boundary),) * 2)
    part = connected_components(graph, directed=False)[1]
    moving = np.isin(boundary, nodes_with(case, mesh, "moving"))
    reached = np.isin(part, part[moving & way[boundary].any(axis=1)])
    if not reached.any():
        return
    far = cKDTree(mesh.points[boundary[reached]]).query(mesh.points)[0] > reach
    for step in steps:
        moved = far & (step.mesh.points != mesh.points).any(axis=1)
        if moved.any():
            yield f"step {step.index}: node {np.argmax(moved)} moved, out of reach"
            return


def same_run_same_bits(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield whether the same case gives other bits the second time."""
    again, problem = tried(run.case, run.mesh)
    if again is None:
        yield f"the second time it ends with {told(problem)}"
    elif again[-1].mesh.points.tobytes() != steps[-1].mesh.points.tobytes():
        yield "the second time the bits differ"


def rest_changes_no_bit(run: Run, _steps: list[Step]) -> Iterator[str]:
    """Yield whether a motion of zero changes a bit."""
    zero = (0.0,) * run.mesh.dim
    still = tuple(Translate(name, zero) for name in run.case.markers_with("moving"))
    count = min(2, max(1, run.case.steps))
    at_rest, problem = tried(run.case.change(motions=still, steps=count), run.mesh)
    if at_rest is None:
        yield f"at rest it ends with {told(problem)}"
    elif any(step.mesh.points.tobytes() != run.mesh.points.tobytes() for step in at_rest):
        yield "a motion of zero moves nodes"


def validity_is_that_of_gmsh(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield a cell that is valid for us and not for Gmsh, or inverted; nothing where it is not."""
    try:
        gmsh = import_module("gmsh")
    except (ImportError, OSError):
        return
    last, signs = steps[-1].mesh, reference_of(run.mesh)[1]
    status, smallest = quality(last, run.mesh).status, signs * smallest_jacobians(gmsh, last)
    tiny = TINY * last.extent**last.dim
    wrong = ((status == VALID) & (smallest < -tiny)) | ((status == INVERTED) & (smallest > tiny))
    for cell in np.flatnonzero(wrong)[:1]:
        yield f"cell {cell} has status {status[cell]}, and Gmsh's Jacobian {smallest[cell]:.3g}"


def numbers_make_sense(run: Run, steps: list[Step]) -> Iterator[str]:
    """Yield what a step says of itself that is not finite, or does not add up."""
    for step in steps:
        numbers = {"max_error": step.max_error, "points": float(step.mesh.points.sum())}
        numbers |= {f"error of cycle {c.cycle}": c.error for c in step.history}
        numbers |= {f"seconds of {name}": spent for name, spent in step.seconds.items()}
        if run.case.method == "rbf" and not step.warnings:
            numbers["condition"] = step.condition
        for name, value in numbers.items():
            if not np.isfinite(value) or (name != "points" and value < 0):
                yield f"step {step.index}: {name} is {value}"
        if sum(step.node_counts.values()) != len(run.mesh.points):
            yield f"step {step.index}: node counts {dict(step.node_counts)} do not add up"
        if not 0 <= step.control_nodes <= len(run.mesh.points):
            yield f"step {step.index}: {step.control_nodes} control nodes"
    if [step.index for step in steps] != list(range(1, steps[-1].total + 1)):
        yield f"steps are numbered {[step.index for step in steps]} of {steps[-1].total}"
    if run.case.steps and len(steps) != run.case.steps:
        yield f"{run.case.steps} steps are asked for, {len(steps)} made"


def again(case: Case, mesh: Mesh) -> tuple[list[Step] | None, BaseException | None]:
    """Return what `tried` does, as it is at the moment."""
    return tried(case, mesh)


HELD = (moving_are_exact, fixed_keep_every_bit, images_stay_images, sliding_stay_on_surface)
"""Laws that hold for every stage of a run."""
LAWS: dict[str, Callable[[Run, list[Step]], Iterator[str]]] = {
    "moving": moving_are_exact,
    "fixed": fixed_keep_every_bit,
    "images": images_stay_images,
    "sliding": sliding_stay_on_surface,
    "growth": growth_is_bounded,
    "reach": out_of_reach_keep_every_bit,
    "gmsh": validity_is_that_of_gmsh,
    "numbers": numbers_make_sense,
    "renumbered": numbering_does_not_matter,
    "bits": same_run_same_bits,
    "rest": rest_changes_no_bit,
    "samples": stages.validity_is_that_of_samples,
    "safe": stages.of_a_part(0, stages.safe_fraction_is_safe),
    "unit": stages.of_a_part(1, stages.unit_does_not_matter(again, 1e-7)),
    "relaxed": stages.of_a_part(2, stages.relaxed_is_held(again, HELD)),
    "repaired": stages.of_a_part(0, stages.repaired_is_held(again, HELD)),
    "streamed": stages.of_a_part(1, stages.streamed_is_the_same(again)),
}
"""Law by name; those that deform again come last."""
