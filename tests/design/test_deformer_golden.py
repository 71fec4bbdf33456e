"""Points and derivatives of every method stay what they were when they were recorded.

`tests/design/gradients.csv` has, for each case, the points of a run, the points of a design, `jvp`
and `vjp`: their length, and their products with two random arrays. Record them again, where they
are to change, with ``PYTHONPATH=tests python -m tests.design.test_deformer_golden``.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.rbf.reduction import Reduction
from tests import builders
from tests.design.test_deformer_derivatives import REDUCED, SHAPES, alike, motions, wave
from tests.test_laws import METHODS, box, box_case, sector, sector_case

RECORD = Path(__file__).with_name("gradients.csv")
ACCURACY = 1e-11
"""Allowed change of a number, as a part of the array's length; badly conditioned systems: more."""
LOOSE = {
    "thin-plate": 1e-9,
    "multiquadric": 1e-9,
    "quadric": 1e-7,
    # The condition is 3.7e6: gradients differ by up to 1.2e-11 with the instructions of other
    # processors (AVX2, SSE3, none), points by 2e-13.
    "annulus-ds-1-exact-vjp": 3e-11,
    "annulus-ds-3-exact-vjp": 3e-11,
}
EXACT, LEVELS = None, Reduction(tolerance=1e-4, multilevel=True, criterion="size", level_size=8)

Made = tuple[Mesh, Case]


def _flat(frame: str, sliding: str, periodic: str, dim: int, settings: dict) -> Made:
    settings = dict(settings)
    method = settings.pop("way", "rbf")
    if frame == "rotational":
        mesh, marker = sector(dim), "BLOCK" if dim == 2 else "blade"
        case = sector_case(mesh, (sliding, periodic), motions(mesh, marker), **settings)
    else:
        mesh = box(dim)
        case = box_case(mesh, (sliding, periodic), motions(mesh, "BLOCK"), **settings)
    return mesh, case.change(method=method)


def _shaped(shape: str, settings: dict) -> Made:
    mesh, roles, motion = SHAPES[shape]()
    case = Case(roles=roles, motions=motion, **settings)
    if shape == "on_axis":
        case = case.change(periodic="moving", periodic_type="rotational")
    return mesh, case


def _square(settings: dict) -> Made:
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    return mesh, Case(roles=roles, motions=motions(mesh, "BLOCK"), **settings)


def _all_cases() -> Iterator[tuple[str, Callable[[], Made]]]:
    """Yield the name of each case, and what makes its mesh and case."""
    for frame in ("translational", "rotational"):
        for sliding, periodic in METHODS:
            for dim in (2, 3):
                for steps, reduction in ((1, EXACT), (3, EXACT), (1, REDUCED), (3, REDUCED)):
                    kind = "reduced" if reduction else "exact"
                    name = f"{frame}-{sliding}-{periodic}-{dim}d-{steps}-{kind}"
                    settings = {"steps": steps, "reduction": reduction}
                    yield name, lambda a=(frame, sliding, periodic, dim, settings): _flat(*a)
    for shape in SHAPES:
        for sliding in ("ps", "ds"):
            for steps, reduction in ((1, EXACT), (3, EXACT), (2, REDUCED)):
                settings = {"steps": steps, "reduction": reduction, "sliding": sliding}
                name = f"{shape}-{sliding}-{steps}-{'reduced' if reduction else 'exact'}"
                yield name, lambda a=(shape, settings): _shaped(*a)
    for kernel in ("thin-plate", "multiquadric", "wendland-c0", "ctps-c1", "quadric"):
        for sliding in ("ps", "ds"):
            for reduction in (EXACT, REDUCED):
                settings = {"kernel": kernel, "sliding": sliding, "steps": 2}
                settings |= {"reduction": reduction}
                name = f"{kernel}-{sliding}-{'reduced' if reduction else 'exact'}"
                yield name, lambda a=settings: _square(a)
    for sliding in ("none", "ps", "ds"):
        for steps in (1, 3):
            settings = {"sliding": sliding, "steps": steps, "reduction": LEVELS}
            yield f"levels-{sliding}-{steps}", lambda a=settings: _square(a)


CASES = dict(_all_cases())
FAST = [name for k, name in enumerate(CASES) if k % 7 == 0]


def measured(name: str) -> dict[str, FloatArray]:
    """Return length and two products of each array of a case."""
    mesh, case = CASES[name]()
    *_, last = sv.deform(case, mesh)
    deformer = sv.Deformer(mesh, case)
    design = alike(deformer, 1.1 * deformer.displacement)
    direction = alike(deformer, wave(mesh.points[deformer.nodes]))
    weights = np.random.default_rng(1).standard_normal(mesh.points.shape)
    arrays = {
        "run": last.mesh.points - mesh.points,
        "reference": deformer.deform() - mesh.points,
        "design": deformer.deform(design) - mesh.points,
        "designs": deformer.deform(np.stack([design, 0.9 * design]))[1] - mesh.points,
        "jvp": deformer.jvp(design, direction),
        "vjp": deformer.vjp(design, weights),
    }
    return {kind: _numbers(array) for kind, array in arrays.items()}


def _numbers(array: FloatArray) -> FloatArray:
    random = np.random.default_rng(2).standard_normal((2, array.size)) / np.sqrt(array.size)
    return np.r_[np.linalg.norm(array), random @ array.ravel()]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "name", [n if n in FAST else pytest.param(n, marks=pytest.mark.slow) for n in CASES]
)
def test_points_and_derivatives_are_those_recorded(name):
    with RECORD.open() as lines:
        rows = {row[1]: np.array(row[2:], float) for row in csv.reader(lines) if row[0] == name}
    for kind, found in measured(name).items():
        accuracy = next((v for key, v in LOOSE.items() if key in f"{name}-{kind}"), ACCURACY)
        allowed = accuracy * rows[kind][0]
        np.testing.assert_allclose(found, rows[kind], rtol=0, atol=allowed, err_msg=kind)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    with RECORD.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        for name in CASES:
            for kind, numbers in measured(name).items():
                table.writerow([name, kind, *(f"{number:.13g}" for number in numbers)])
