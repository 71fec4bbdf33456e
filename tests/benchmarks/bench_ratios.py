"""Processor time over that of a fixed kernel, beside what is stored: ``make bench``.

Ratios depend little on the machine and on other work, so that a loss of a quarter shows in any run.
``make bench ARGS="-k ratio --store-ratios"`` stores those of this run in ``ratios.json``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.margin import step_safety
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import write_sample
from tests.benchmarks.measured import call

STORED = Path(__file__).with_name("ratios.json")
ALLOWED = 1.25  # largest ratio, and largest memory, over the stored one
ROUNDS = 3
CELLS = 240_000


@numba.njit
def kernel(x: np.ndarray, centres: np.ndarray) -> float:
    """Return the sum of Wendland's C2 function over all pairs of points (n, 3) and (m, 3).

    It must stay as it is: all stored ratios are to its time.
    """
    total = 0.0
    for i in range(len(x)):
        for j in range(len(centres)):
            a, b, c = x[i, 0] - centres[j, 0], x[i, 1] - centres[j, 1], x[i, 2] - centres[j, 2]
            q = min(np.sqrt(a * a + b * b + c * c), 1.0)
            total += (1 - q) ** 4 * (4 * q + 1)
    return total


def processor_seconds(work: Callable[[], object]) -> float:
    """Return the processor time of a call, with that of the programs that it runs."""
    begin = sum(os.times()[:4])
    work()
    return sum(os.times()[:4]) - begin


def kernel_seconds() -> float:
    """Return the shortest time of the kernel."""
    points = np.random.default_rng(0).random((12_000, 3))
    kernel(points[:1], points[:1])  # compiles it
    return min(processor_seconds(lambda: kernel(points, points)) for _ in range(ROUNDS))


@pytest.fixture
def compare(request, benchmark):
    """Return a function that measures some work, and requires that it costs what is stored."""

    def measured(name: str, work: Callable, prepare: Callable[[], tuple], rounds: int = ROUNDS):
        seconds = [kernel_seconds()]
        spent, memory = [], []

        def timed(*arguments):
            spent.append(processor_seconds(lambda: memory.append(work(*arguments))))

        benchmark.pedantic(timed, setup=lambda: (prepare(), {}), rounds=rounds)
        seconds.append(kernel_seconds())
        found = {name: min(spent) / min(seconds)}
        if isinstance(memory[0], tuple):  # of a command
            found[f"{name}, GB"] = memory[0][1]
        benchmark.extra_info.update(found)
        stored = json.loads(STORED.read_text()) if STORED.exists() else {}
        if request.config.getoption("store_ratios"):
            stored |= {key: round(value, 3) for key, value in found.items()}
            STORED.write_text(json.dumps(stored, indent=2, sort_keys=True) + "\n")
        lost = [
            f"{key}: {value:.3g}, stored is {stored[key]:g}"
            for key, value in found.items()
            if value > ALLOWED * stored[key]
        ]
        assert not lost, f"slower or larger than before by more than a quarter: {lost}"

    return measured


@pytest.fixture(scope="module")
def stator(tmp_path_factory):
    """Folders of sample stators by number of cells."""
    made = {}

    def of(cells):
        if cells not in made:
            made[cells] = tmp_path_factory.mktemp(f"ratio{cells}")
            write_sample("stator", made[cells], cells)
        return made[cells]

    return of


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_ratio_of_deforming(compare, stator, sliding):
    """Choice of control nodes, checks of the motion, and all nodes; no reading, no quality."""
    folder = stator(CELLS)
    case = sv.Case.read(folder / "stator.cfg").change(
        sliding=sliding, reduction=Reduction(tolerance=1e-5)
    )
    compare(
        f"deforming, {sliding}",
        lambda mesh: list(sv.deform(case, mesh)) and None,
        lambda: (sv.read(folder / "mesh.su2"),),
    )


def test_ratio_of_checking_the_result(compare, stator):
    """Quality of both meshes with proofs, the layers at walls, and the safe fraction."""
    folder = stator(CELLS)
    case = sv.Case.read(folder / "stator.cfg")
    mesh = sv.read(folder / "mesh.su2")
    *_, last = sv.deform(case, mesh)

    def anew():
        before = sv.read(folder / "mesh.su2")
        return before, before.with_points(last.mesh.points)

    def check(before, after):
        sv.quality(after, before)
        sv.quality(before)
        sv.walls(after, before)
        step_safety(before, after, before)

    compare("checking the result", check, anew)


@pytest.mark.parametrize("cells", [CELLS, 2_000_000])
def test_ratio_of_the_command(compare, stator, cells):
    """From start to end, with reading and writing."""
    case = stator(cells) / "stator.cfg"
    compare(f"run of {cells:,} cells", call, lambda: ("run", case, "-q", "--force"), rounds=2)
