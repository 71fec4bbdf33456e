"""Speed: ``make bench``. Ratios are taken within one run, on one machine.

pytest-benchmark prints the times; ``extra_info`` (in ``--benchmark-json``) has what they mean:
pairs of nodes a second, cells a second, and the ratio to a plain NumPy evaluation.
"""

from __future__ import annotations

from timeit import timeit

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.fans import find_fans
from slideviz.mesh.margin import path_margins
from slideviz.mesh.topology import find_boundary
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.evaluate import Basis, evaluate, matrix
from slideviz.rbf.solve import factorise
from slideviz.samples.table import sample, write_sample
from slideviz.terms import FARTHEST

TARGETS, CONTROLS = 200_000, 1_000
RULES = {"euclidean": (3, 0.0), "translational": (4, 0.0), "rotational": (4, 0.5)}


def features(rule: str, count: int, seed: int) -> np.ndarray:
    """Return random features of a rule, (k, count)."""
    rng = np.random.default_rng(seed)
    rows, period = RULES[rule]
    x = rng.random((rows, count))
    if period:
        half = np.pi / period * (x[1] - 0.5) * period
        x[1], x[2] = np.sin(half), np.cos(half)
    return np.ascontiguousarray(x)


def numpy_sums(x: np.ndarray, c: np.ndarray, w: np.ndarray, radius: float) -> np.ndarray:
    """Return the same sums by chunks of NumPy arrays, the usual way."""
    parts = []
    for start in range(0, x.shape[1], 2000):
        part = x[:, start : start + 2000]
        squared = sum((a[:, None] - b[None]) ** 2 for a, b in zip(part, c, strict=True))
        q = np.sqrt(squared) / radius
        parts.append((np.clip(1 - q, 0, None) ** 4 * (4 * q + 1)) @ w)
    return np.concatenate(parts)


@pytest.mark.parametrize("rule", list(RULES))
def test_evaluation(benchmark, rule):
    basis = Basis(2.5, RULES[rule][1])
    x, c = features(rule, TARGETS, 0), features(rule, CONTROLS, 1)
    w = np.random.default_rng(2).standard_normal((CONTROLS, 3))
    evaluate(basis, x[:, :10], c, w)
    benchmark(evaluate, basis, x, c, w)
    benchmark.extra_info["pairs_per_second"] = TARGETS * CONTROLS / benchmark.stats["min"]


def test_evaluation_with_numpy(benchmark):
    x, c = features("euclidean", TARGETS // 10, 0), features("euclidean", CONTROLS, 1)
    w = np.random.default_rng(2).standard_normal((CONTROLS, 3))
    benchmark.pedantic(numpy_sums, (x, c, w, 2.5), rounds=3)
    benchmark.extra_info["pairs_per_second"] = TARGETS // 10 * CONTROLS / benchmark.stats["min"]


@pytest.mark.parametrize("count", [1_000, 4_000])
def test_factorisation(benchmark, count):
    x = features("euclidean", count, 3)
    system = matrix(Basis(2.5), (x, None))
    benchmark.pedantic(factorise, (system,), rounds=3, warmup_rounds=1)
    benchmark.extra_info["flops_per_second"] = count**3 / 3 / benchmark.stats["min"]


def test_closest_points(benchmark):
    rng = np.random.default_rng(4)
    corners = rng.random((50_000, 1, 3)) + 0.01 * rng.standard_normal((50_000, 3, 3))
    tree = ClosestPoints(corners)
    x = rng.random((10_000, 3))
    benchmark.pedantic(tree.query, (x,), rounds=3, warmup_rounds=1)
    benchmark.extra_info["points_per_second"] = 10_000 / benchmark.stats["min"]


@pytest.fixture(scope="module")
def cube():
    """64,000 hexahedra."""
    return sample("hexahedron", 40).mesh


def test_topology(benchmark, cube):
    benchmark.pedantic(lambda: find_fans(find_boundary(cube), cube.points), rounds=3)


def test_quality(benchmark, cube):
    benchmark.pedantic(sv.quality, (cube, cube), rounds=3, warmup_rounds=1)
    benchmark.extra_info["cells_per_second"] = len(cube.cells) / benchmark.stats["min"]


def test_metrics(benchmark, cube):
    """All metrics of a mesh whose neighbours are known, as of every mesh after the first one."""
    anew = lambda: ((cube.with_points(cube.points),), {})  # noqa: E731
    benchmark.pedantic(sv.metrics, setup=anew, rounds=3, warmup_rounds=1)
    benchmark.extra_info["cells_per_second"] = len(cube.cells) / benchmark.stats["min"]


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0], ids=lambda share: f"{share:.0%}-limited")
def test_margins_beside_the_proof(benchmark, cube, share):
    """Margins up to 10 times a motion that shakes a part of the cells, beside their quality."""
    shaken = np.random.default_rng(5).uniform(-1, 1, cube.points.shape) / 250
    moved = cube.with_points(cube.points + shaken * (cube.points[:, :1] < share))
    proof = min(timeit(lambda: sv.quality(moved, cube), number=1) for _ in range(5))
    found = benchmark.pedantic(path_margins, (moved, cube), rounds=5, warmup_rounds=1)
    benchmark.extra_info.update(
        limited=float((found < FARTHEST).mean()), over_proof=benchmark.stats["min"] / proof
    )


def test_quality_with_derivative(benchmark, cube):
    moved = cube.with_points(cube.points + 1e-3 * np.sin(9 * cube.points[:, ::-1]))
    found = benchmark.pedantic(
        sv.quality, (moved, cube), {"derivative": True}, rounds=3, warmup_rounds=1
    )
    assert found.inverted == 0
    benchmark.extra_info["cells_per_second"] = len(cube.cells) / benchmark.stats["min"]


def test_reading(benchmark, cube, tmp_path):
    path = tmp_path / "cube.su2"
    sv.write(path, cube)
    benchmark.pedantic(sv.read, (path,), rounds=3, warmup_rounds=1)
    benchmark.extra_info["cells_per_second"] = len(cube.cells) / benchmark.stats["min"]
    benchmark.extra_info["bytes_per_second"] = path.stat().st_size / benchmark.stats["min"]


@pytest.mark.parametrize("anew", [False, True], ids=["deformed", "anew"])
def test_writing(benchmark, cube, tmp_path, anew):
    path = tmp_path / "cube.su2"
    sv.write(path, cube)
    mesh = cube if anew else sv.read(path)
    moved = mesh.with_points(mesh.points * 1.0000001)
    out = (tmp_path / "out.su2", moved)
    benchmark.pedantic(sv.write, out, rounds=3, warmup_rounds=1)
    benchmark.extra_info["bytes_per_second"] = out[0].stat().st_size / benchmark.stats["min"]


@pytest.mark.parametrize("name", ["square", "polar", "passage", "hexahedron", "cylindrical"])
def test_whole_run(benchmark, name, tmp_path):
    write_sample(name, tmp_path)
    case = sv.Case.read(tmp_path / f"{name}.cfg").change(steps=5)
    mesh = sv.read(tmp_path / "mesh.su2")
    benchmark.pedantic(lambda: list(sv.deform(case, mesh)), rounds=2, warmup_rounds=1)
    benchmark.extra_info["seconds_per_step"] = benchmark.stats["min"] / 5
