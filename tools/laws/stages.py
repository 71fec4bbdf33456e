"""Laws of what follows the interpolation: relaxation, repair, streaming, and the safe fraction.

Each deforms once more, by the case of a run with one thing changed; so each is asked of a part of
the runs (`EVERY`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.rigid import Radial, Rotate, Translate
from slideviz.errors import SlidevizError
from slideviz.mesh.jacobians import INVERTED, VALID
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import Quality, quality
from slideviz.solver.steps import Step
from slideviz.streaming.run import stream
from tools.laws.cases import Run
from tools.laws.sampling import smallest_jacobians

EVERY = 3
"""A law here is asked of one run in so many."""
POINTS = 300
"""Points in each cell at which its Jacobian is sampled."""
SCALE = 4.0
"""A power of two, which rounds nothing."""
Steps = list[Step]
Deform = Callable[[Case, Mesh], tuple[Steps | None, BaseException | None]]
"""Returns the steps of a deformation, or what ended it before."""
Law = Callable[[Run, Steps], Iterator[str]]


def validity_is_that_of_samples(run: Run, steps: Steps) -> Iterator[str]:
    """Yield a cell that is proved valid with a Jacobian below zero, or inverted without one."""
    last = steps[-1].mesh
    status = quality(last, run.mesh).status
    least, mean = smallest_jacobians(last, np.random.default_rng(run.seed), POINTS)
    signs = reference_of(run.mesh)[1]
    lowest = np.where(signs > 0, least, _largest(last, run.seed))
    tiny = 1e-13 * last.extent**last.dim
    wrong = (status == VALID) & (lowest < -tiny)
    wrong |= (status == INVERTED) & (lowest > 0.01 * np.abs(mean) + tiny)
    for cell in np.flatnonzero(wrong)[:1]:
        yield f"cell {cell} has status {status[cell]}, and the least sample {lowest[cell]:.3g}"


def _largest(mesh: Mesh, seed: int) -> FloatArray:
    """Return the least Jacobian of cells that are numbered the other way round."""
    mirrored = mesh.with_points(mesh.points * ([-1.0] + [1.0] * (mesh.dim - 1)))
    return smallest_jacobians(mirrored, np.random.default_rng(seed), POINTS)[0]


def unit_does_not_matter(deform: Deform, same: float) -> Law:
    """Return the law that a mesh in another unit of length has the same result."""

    def law(run: Run, steps: Steps) -> Iterator[str]:
        mesh = run.mesh.with_points(SCALE * run.mesh.points)
        again, problem = deform(scaled(run.case), mesh)
        if again is None:
            yield f"scaled it ends with {problem!r}"
            return
        if any("were solved to" in text for text in steps[-1].warnings):
            return
        gap = np.abs(again[-1].mesh.points / SCALE - steps[-1].mesh.points).max() / run.mesh.extent
        if len(again) != len(steps) or gap > same:
            yield f"differs by {gap:.2g} in another unit, {len(again)} steps for {len(steps)}"

    return law


def scaled(case: Case) -> Case:
    """Return a case for the mesh in another unit of length."""
    reduction = case.reduction
    if reduction is not None:
        reduction = replace(reduction, tolerance=SCALE * reduction.tolerance)
    return case.change(
        motions=tuple(map(_scaled, case.motions)),
        origin=tuple(SCALE * x for x in case.origin),
        layer_thickness=SCALE * case.layer_thickness,
        reduction=reduction,
    )


def _scaled(motion: Motion) -> Motion:
    changed: dict[str, object] = {}
    if isinstance(motion, Translate):
        changed["vector"] = tuple(SCALE * x for x in motion.vector)
    if isinstance(motion, Radial):
        changed["distance"] = SCALE * motion.distance
    if isinstance(motion, Radial | Rotate) and motion.point != "centroid":
        changed["point"] = tuple(SCALE * x for x in motion.point)
    return replace(motion, **changed)  # type: ignore[arg-type]


def relaxed_is_held(deform: Deform, held: tuple[Law, ...]) -> Law:
    """Return the law that relaxation moves no held node and folds no cell."""

    def law(run: Run, steps: Steps) -> Iterator[str]:
        if run.case.method != "rbf":
            return
        case = run.case.change(relax="yes")
        yield from _better(deform, held, run, steps, case)

    return law


def repaired_is_held(deform: Deform, held: tuple[Law, ...]) -> Law:
    """Return the law that repair moves no held node, and makes nothing worse."""

    def law(run: Run, steps: Steps) -> Iterator[str]:
        case = run.case.change(repair="yes", repair_below=0.3)
        before = quality(steps[-1].mesh, run.mesh)
        after = yield from _better(deform, held, run, steps, case)
        if after is not None and after.min < before.min - 1e-9:
            yield f"the least quality falls from {before.min:.6g} to {after.min:.6g}"

    return law


def _better(
    deform: Deform, held: tuple[Law, ...], run: Run, steps: Steps, case: Case
) -> Iterator[str]:
    after, problem = deform(case, run.mesh)
    if after is None:
        if not isinstance(problem, SlidevizError):
            yield f"it ends with {problem!r}"
        return None
    for each in held:
        yield from each(replace(run, case=case), after)
    before, now = (quality(one[-1].mesh, run.mesh) for one in (steps, after))
    if now.inverted > before.inverted:
        yield f"{now.inverted} inverted cells, before {before.inverted}"
    return now


def streamed_is_the_same(deform: Deform) -> Law:
    """Return the law that a mesh in a file has the bits of one in memory."""

    def law(run: Run, _steps: Steps) -> Iterator[str]:
        with TemporaryDirectory() as folder:
            source, target = Path(folder, "a.su2b"), Path(folder, "b.su2b")
            try:
                sv.write(source, run.mesh)
                stream(run.case.change(mesh_file=source), target)
            except SlidevizError:
                return
            mesh = sv.read(source)
            steps, problem = deform(run.case, mesh)
            if steps is None:
                yield f"streamed it is done, in memory it ends with {problem!r}"
                return
            if sv.read(target).points.tobytes() != steps[-1].mesh.points.tobytes():
                gap = np.abs(sv.read(target).points - steps[-1].mesh.points).max()
                yield f"streamed it differs by {gap / mesh.extent:.2g}"

    return law


def safe_fraction_is_safe(run: Run, steps: Steps) -> Iterator[str]:
    """Yield a cell that folds before the safe fraction, or that none does behind it."""
    start, end = run.mesh.points, steps[-1].mesh
    if quality(run.mesh).inverted:
        return
    fraction = sv.safe_fraction(end, run.mesh).fraction

    def at(part: float) -> Quality:
        return quality(end.with_points(start + part * (end.points - start)), run.mesh)

    if at(fraction * (1 - 1e-6)).inverted:
        yield f"a cell folds before {fraction:.6g}"
    if fraction < 9.9 and not np.any(at(fraction * 1.01 + 1e-9).status != VALID):
        yield f"no cell folds behind {fraction:.6g}"


def of_a_part(number: int, law: Law) -> Law:
    """Return a law that is asked of one run in `EVERY`."""

    def asked(run: Run, steps: Steps) -> Iterator[str]:
        if (run.seed + number) % EVERY == 0:
            yield from law(run, steps)

    return asked
