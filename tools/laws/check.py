"""The laws, and runs that are held against them.

Tolerances are in parts of the mesh: ``ROUND`` of its largest coordinate for what is exact but
for rounding, ``SAME`` of its extent for what two orders of one sum may differ by.
"""

from __future__ import annotations

import signal
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import FrameType

import numpy as np

from slideviz.case.model import Case, Translate
from slideviz.climb import Step
from slideviz.errors import SlidevizError
from slideviz.mesh.model import Mesh
from slideviz.staircase import deform
from tools.laws.cases import Run
from tools.laws.meshes import images
from tools.laws.oracle import carried, goals, nodes_with
from tools.laws.refusals import kind_of, unlikely
from tools.laws.renumber import renumbered
from tools.laws.surfaces import off_surface

ROUND = 500 * np.finfo(float).eps
SAME = 1e-9
GROWTH = 5.0
LIMIT_S = 60.0
"""Seconds that one deformation may take: the meshes are small."""


@dataclass(frozen=True)
class Outcome:
    """What became of one seed.

    Attributes
    ----------
    seed : int
    ended : str
        ``done``, or the kind of the refusal.
    broken : tuple of (str, str)
        The laws that do not hold, and by how much or where.
    seconds : float
    """

    seed: int
    ended: str
    broken: tuple[tuple[str, str], ...]
    seconds: float


class TooLong(BaseException):
    """A deformation did not come to an end; no handler of the program may catch it."""


def check(run: Run) -> Outcome:
    """Return whether all laws hold for a run."""
    start = time.perf_counter()
    broken: list[tuple[str, str]] = []
    steps, problem = tried(run.case, run.mesh)
    ended = "done"
    if steps is not None:
        for name, law in LAWS.items():
            broken += [(name, text) for text in law(run, steps)]
    elif isinstance(problem, SlidevizError):
        ended = kind_of(problem)
        broken += [("refusal", text) for text in unlikely(run, problem)]
    else:
        ended = "failed"
        broken.append(("ending", _told(problem)))
    return Outcome(run.seed, ended, tuple(broken), time.perf_counter() - start)


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


def _ring(number: int, frame: FrameType | None) -> None:
    raise TooLong(f"more than {LIMIT_S:.0f} s")


def _told(problem: BaseException | None) -> str:
    """Return an error and where it came from, in one line."""
    assert problem is not None
    last = traceback.extract_tb(problem.__traceback__)
    place = next((f for f in reversed(last) if "slideviz" in f.filename), last[-1])
    where = f"{place.filename.rpartition('slideviz/')[2]}:{place.lineno}"
    return f"{type(problem).__name__} at {where}: {str(problem)[:200]}"


def _magnitude(run: Run) -> float:
    """Return the size of the numbers that positions are computed from."""
    far = [run.mesh.extent, float(np.abs(run.mesh.points).max())]
    if run.period is not None and run.period.angle_deg:
        far.append(float(np.abs(run.period.origin).max()))
    return max(far)


def moving_are_exact(run: Run, steps: list[Step]) -> Iterator[str]:
    """Moving nodes end where the motions put them."""
    where = goals(run.case, run.mesh)
    nodes = np.array(list(where))
    gap = np.abs(steps[-1].mesh.points[nodes] - np.array(list(where.values()))).max(axis=1)
    if gap.max() > ROUND * _magnitude(run):
        yield f"node {nodes[gap.argmax()]} is off by {gap.max() / run.mesh.extent:.2g}"


def fixed_keep_every_bit(run: Run, steps: list[Step]) -> Iterator[str]:
    """Nodes of fixed markers, and of sliding ones without sliding, keep every bit."""
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
    """Nodes that are images of each other stay so, with any periodic distance."""
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
    """Sliding nodes stay on their undeformed surface; see ``surfaces``."""
    yield from off_surface(run, steps[-1].mesh.points, ROUND * _magnitude(run))


def numbering_does_not_matter(run: Run, steps: list[Step]) -> Iterator[str]:
    """Another order of nodes, cells and marker elements gives the same positions."""
    mesh, order = renumbered(run.mesh, np.random.default_rng([run.seed, 5]))
    again, problem = tried(run.case, mesh)
    if again is None:
        yield f"renumbered it ends with {_told(problem)}"
        return
    if len(again) != len(steps):
        yield f"{len(steps)} steps, renumbered {len(again)}"
        return
    gap = np.abs(again[-1].mesh.points - steps[-1].mesh.points[order]).max() / run.mesh.extent
    if gap > SAME:
        yield f"differs by {gap:.2g} (condition {steps[-1].condition:.1g})"


def growth_is_bounded(run: Run, steps: list[Step]) -> Iterator[str]:
    """No node goes much farther than the nodes that are moved."""
    where = goals(run.case, run.mesh)
    nodes = np.array(list(where))
    asked = np.linalg.norm(np.array(list(where.values())) - run.mesh.points[nodes], axis=1).max()
    made = np.linalg.norm(steps[-1].mesh.points - run.mesh.points, axis=1)
    if made.max() > GROWTH * asked + ROUND * _magnitude(run):
        yield f"node {made.argmax()} moves {made.max() / max(asked, 1e-300):.3g} times as far"


def same_run_same_bits(run: Run, steps: list[Step]) -> Iterator[str]:
    """The same case gives the same bits."""
    again, problem = tried(run.case, run.mesh)
    if again is None:
        yield f"the second time it ends with {_told(problem)}"
    elif again[-1].mesh.points.tobytes() != steps[-1].mesh.points.tobytes():
        yield "the second time the bits differ"


def rest_changes_no_bit(run: Run, steps: list[Step]) -> Iterator[str]:
    """A motion of zero changes no bit."""
    zero = (0.0,) * run.mesh.dim
    still = tuple(Translate(name, zero) for name in run.case.markers_with("moving"))
    count = min(2, max(1, run.case.steps))
    at_rest, problem = tried(run.case.change(motions=still, steps=count), run.mesh)
    if at_rest is None:
        yield f"at rest it ends with {_told(problem)}"
    elif any(step.mesh.points.tobytes() != run.mesh.points.tobytes() for step in at_rest):
        yield "a motion of zero moves nodes"


def numbers_make_sense(run: Run, steps: list[Step]) -> Iterator[str]:
    """What a step says of itself is finite, and adds up."""
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


LAWS: dict[str, Callable[[Run, list[Step]], Iterator[str]]] = {
    "moving": moving_are_exact,
    "fixed": fixed_keep_every_bit,
    "images": images_stay_images,
    "sliding": sliding_stay_on_surface,
    "growth": growth_is_bounded,
    "numbers": numbers_make_sense,
    "renumbered": numbering_does_not_matter,
    "bits": same_run_same_bits,
    "rest": rest_changes_no_bit,
}
"""Law by name; those that deform again come last."""
