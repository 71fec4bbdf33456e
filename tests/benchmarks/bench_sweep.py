"""Sweeps: overhead of a design and how busy the cores are, ``make bench``.

Where other programs want the cores, too, ``overhead_ms`` has the time that these take; the
processor time of the process that gives out the work, ``parent_ms``, has not.
"""

from __future__ import annotations

import time

import pytest

import slideviz as sv
from slideviz.samples.table import sample
from slideviz.system.platform import usable_cores

DESIGNS = 200


@pytest.mark.parametrize("cells", [20_000])
def test_sweep_of_designs(benchmark, cells):
    """Rotation and shift of the passage's blade; processes start before the clock does."""
    made = sample("passage", 72)
    assert len(made.mesh.cells) == cells
    parts = [k / DESIGNS for k in range(DESIGNS)]
    designs = {
        "airfoil.rotate.angle_deg": [-8.0 * part for part in parts],
        "airfoil.translate.y": [0.12 * part for part in parts],
    }
    cores = usable_cores()
    told: list[tuple[float, float, float]] = []

    def swept() -> None:
        rows = []
        begin = before = 0.0
        for row in sv.sweep(made.case, designs, mesh=made.mesh):
            rows.append(row)
            if len(rows) == 2 * cores:  # all processes have begun
                begin, before = time.perf_counter(), time.process_time()
        assert not any(row.problem for row in rows)
        clock = time.perf_counter() - begin
        spent = time.process_time() - before
        told.append((clock, sum(row.seconds for row in rows[2 * cores :]), spent))

    benchmark.pedantic(swept, rounds=2)
    clock, worked, spent = min(told)
    done = DESIGNS - 2 * cores
    benchmark.extra_info.update(
        designs=DESIGNS,
        cores=cores,
        busy=worked / (cores * clock),
        overhead_ms=1e3 * (cores * clock - worked) / done,
        parent_ms=1e3 * spent / done,
        design_ms=1e3 * worked / done,
        designs_a_second=done / clock,
    )
