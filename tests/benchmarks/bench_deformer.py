"""Speed of prepared deformations: ``make bench``. Ratios are taken within one run."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest

import slideviz as sv
from slideviz.samples.table import write_sample

DESIGNS = 100


@pytest.fixture(scope="module")
def stator(tmp_path_factory):
    """The sample stator, 238,504 cells, ready to be deformed."""
    folder = tmp_path_factory.mktemp("stator")
    write_sample("stator", folder)
    case = sv.Case.read(folder / "stator.cfg")
    deformer = sv.Deformer(sv.read(case.mesh_file), case)
    deformer.deform()
    return deformer


def shortest(work, rounds=5):
    """Return the shortest time of some calls, in seconds."""
    times = []
    for _ in range(rounds):
        start = perf_counter()
        work()
        times.append(perf_counter() - start)
    return min(times)


def test_deform(benchmark, stator):
    benchmark(stator.deform)


def test_vjp_is_at_most_twice_a_deformation(benchmark, stator):
    weights = np.random.default_rng(0).standard_normal(stator.mesh.points.shape)
    one = shortest(stator.deform)
    benchmark(stator.vjp, stator.displacement, weights)
    benchmark.extra_info["times_deform"] = benchmark.stats["min"] / one


@pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")
def test_a_hundred_designs_together(benchmark, stator):
    designs = stator.displacement * np.linspace(0.9, 1.0, DESIGNS)[:, None, None]
    one = shortest(stator.deform)
    benchmark.pedantic(stator.deform, (designs,), rounds=3)
    benchmark.extra_info["times_deform"] = benchmark.stats["min"] / one
