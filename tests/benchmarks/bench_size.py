"""How time and memory grow with cells, candidates and control nodes: ``make bench``."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from time import process_time

import pytest

import slideviz as sv
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import write_sample
from tests.benchmarks.measured import call


@pytest.fixture(scope="session")
def stator(tmp_path_factory):
    """Sample stators by number of cells."""
    made = {}

    def of(cells):
        if cells not in made:
            made[cells] = tmp_path_factory.mktemp(f"stator{cells}")
            write_sample("stator", made[cells], cells)
        return made[cells]

    return of


DISK_GB = 5e-7
"""What a streamed cell takes on the disk, three times: the sample, the copy, and kept numbers."""
LARGE = [10_000_000, 100_000_000]


@pytest.mark.parametrize(
    "cells", [240_000, 2_000_000, *(pytest.param(n, marks=pytest.mark.slow) for n in LARGE)]
)
def test_stream(benchmark, tmp_path, cells):
    """Whole command on an SU2 binary mesh that is never in memory as a whole."""
    free = shutil.disk_usage(tmp_path).free / 1e9
    if free < DISK_GB * cells:
        pytest.skip(f"needs {DISK_GB * cells:.0f} GB of the disk, {free:.0f} are free")
    asked = "sample", "stator", "--size", cells, "--format", "su2b", "-o", tmp_path / "stator"
    call(*asked)
    report = tmp_path / "report.json"
    asked = "run", tmp_path / "stator" / "stator.cfg", "--stream", "-q", "--json", report
    asked += "--set", "GENERATE_QUALITY= NO"
    _, memory = benchmark.pedantic(call, asked, rounds=1)
    told = json.loads(report.read_text())
    assert told["quality"]["inverted"] == 0
    benchmark.extra_info.update(cells=told["quality"]["cells"], largest_memory_gb=memory)
    shutil.rmtree(tmp_path)


@pytest.mark.parametrize("cells", [20_000, 60_000, 240_000, 2_000_000])
def test_run_of_the_command(benchmark, stator, cells):
    """Whole command, reading and writing included, in a process of its own."""
    folder = stator(cells)
    report = folder / "report.json"
    asked = "run", folder / "stator.cfg", "-q", "--json", report
    _, memory = benchmark.pedantic(call, asked, rounds=1 if cells > 1e6 else 2)
    told = json.loads(report.read_text())
    seconds = told["seconds"]
    deformation = sum(
        seconds[k] for k in ("classify", "select", "solve", "evaluate", "project", "correct")
    )
    benchmark.extra_info.update(
        cells=told["quality"]["cells"],
        control_nodes=told["control_nodes"][-1],
        deformation_seconds=deformation,
        largest_memory_gb=memory,
    )


@pytest.mark.slow
@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-6, 1e-7])
def test_selection(benchmark, stator, sliding, tolerance):
    """The deformation of 240,000 hexahedra to a tolerance."""
    folder = stator(240_000)
    mesh = sv.read(folder / "mesh.su2")
    case = sv.Case.read(folder / "stator.cfg").change(
        sliding=sliding, reduction=Reduction(tolerance=tolerance)
    )
    start = process_time()
    steps = benchmark.pedantic(lambda: list(sv.deform(case, mesh)), rounds=2)
    spent = process_time() - start
    counts = steps[-1].node_counts
    benchmark.extra_info.update(
        candidates=sum(counts.values()) - counts["internal"],
        control_nodes=steps[-1].control_nodes,
        select_seconds=steps[-1].seconds["select"],
        processor_seconds=spent / 2,
    )


def test_second_start(benchmark, tmp_path):
    """The 25 by 25 square in 20 steps, from the shell: imports, cached code, everything."""
    write_sample("square", tmp_path)
    call = [sys.executable, "-m", "slideviz", "run", str(tmp_path / "square.cfg"), "-q"]
    benchmark.pedantic(subprocess.run, (call,), {"check": True}, rounds=5, warmup_rounds=1)
