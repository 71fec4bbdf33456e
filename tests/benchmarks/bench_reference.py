"""Beside RBF-SliDe: its own times and qualities on the same meshes, ``make bench``."""

from __future__ import annotations

import json
import math
from time import process_time

import numpy as np
import pytest

import slideviz as sv
from slideviz.rbf.reduction import Reduction
from tests.benchmarks.measured import call
from tests.benchmarks.rbf_slide import GROUP, SHARED, asked, greedy_rows, load, write_whole_boundary

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason=f"needs the meshes of {SHARED}")

THEIRS = {(row.sliding, row.tolerance): row for row in greedy_rows() if row.case == "stator"}

NEARLY_EXACT = Reduction(tolerance=1e-7)
"""The stator has 8,110 candidates; a hundredth of the smallest tolerance stands for all."""


def deformed(case, mesh, spent=None):
    """Return the last step; the processor's seconds are appended to ``spent``."""
    start = process_time()
    *_, last = sv.deform(case, mesh)
    if spent is not None:
        spent.append(process_time() - start)
    return last


def lowest(last, mesh):
    """Return the minimum quality, as RBF-SliDe measures it, and require finite results."""
    assert np.isfinite(last.mesh.points).all()
    found = sv.quality(last.mesh, mesh, "rbf-slide")
    assert np.isfinite(found.values).all()
    return found.min


@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("tolerance", [4.5e-5, 1e-5, 1e-6])
def test_stator(benchmark, sliding, tolerance):
    """237,162 hexahedra; hub and shroud internal, periodic sides that move."""
    mesh, case = load("stator")
    case = case.change(
        sliding=sliding, periodic="moving", steps=1, reduction=Reduction(tolerance=tolerance)
    )
    spent = []
    last = benchmark.pedantic(deformed, (case, mesh, spent), rounds=3)
    benchmark.extra_info.update(
        processor_seconds=min(spent),
        control_nodes=last.control_nodes,
        min_quality=lowest(last, mesh),
    )
    if (sliding, tolerance) in THEIRS:
        row = THEIRS[sliding, tolerance]
        benchmark.extra_info.update(rbf_slide_seconds=row.seconds, rbf_slide_quality=row.quality)


def test_two_thousand_control_nodes_of_the_whole_boundary(benchmark, tmp_path):
    """Regular method; a fifth of the displacement, for in full the blade leaves its passage."""
    case = write_whole_boundary(tmp_path, 0.2, 2000)
    report = tmp_path / "report.json"
    asked = "run", case, "-q", "--json", report
    _, memory = benchmark.pedantic(call, asked, rounds=2)
    told = json.loads(report.read_text())
    counts = told["node_counts"]
    benchmark.extra_info.update(
        candidates=sum(counts.values()) - counts["internal"],
        control_nodes=told["control_nodes"][-1],
        select_seconds=told["seconds"]["select"],
        largest_memory_gb=memory,
    )


@pytest.mark.slow
@pytest.mark.parametrize("row", greedy_rows(), ids=str)
def test_greedy_row(benchmark, row):
    """One row of the table; where ours is lower, the exact method is run too."""
    benchmark.group = GROUP
    mesh, case = asked(row)
    spent = []
    last = benchmark.pedantic(deformed, (case, mesh, spent), rounds=2)
    ours = lowest(last, mesh)
    theirs = row.quality if row.quality > 0 else 0.0  # inverted cells, or no result: 0 as ours
    exact = math.nan
    if ours < theirs:
        all_nodes = NEARLY_EXACT if row.case == "stator" else None
        exact = lowest(deformed(case.change(reduction=all_nodes), mesh), mesh)
    mended = lowest(deformed(case.change(repair="yes", repair_below=max(0.1, theirs)), mesh), mesh)
    assert mended >= ours
    benchmark.extra_info.update(
        repaired_quality=mended,
        processor_seconds=min(spent),
        tolerance=row.tolerance,
        pick=row.pick,
        rbf_slide_seconds=row.seconds,
        quality=ours,
        rbf_slide_quality=theirs,
        exact_quality=exact,
        control_nodes=last.control_nodes,
        rbf_slide_control_nodes=row.control_nodes,
    )
