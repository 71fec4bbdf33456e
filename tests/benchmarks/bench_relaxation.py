"""What relaxation and the layer zone take beside one elastic solution: ``make bench``."""

from __future__ import annotations

from time import perf_counter

import pytest

import slideviz as sv
from slideviz.samples.table import sample

CELLS = 40_000
SETTINGS = {
    "rbf": {},
    "layers": {"layers": "auto"},
    "relax": {"relax": "yes"},
    "both": {"layers": "auto", "relax": "yes"},
    "elastic": {"method": "elastic"},
}


def timed(mesh, case):
    """Return the seconds of the phases of a run in one step."""
    begin = perf_counter()
    *_, last = sv.deform(case, mesh)
    return perf_counter() - begin, last.seconds


@pytest.mark.parametrize("name", ["stator", "turbine-row-3d"])
def test_relaxation(benchmark, name):
    """The first run makes the hierarchy, the second one has it; both beside linear elasticity."""
    made = sample(name, CELLS)
    mesh, case = made.mesh, made.case.change(steps=1, relax="no", layers="no")
    if made.displacement is not None:
        moved = made.displacement
        case = case.change(motions=(sv.Prescribed(moved.nodes, moved.vectors),))
    for settings in SETTINGS.values():  # compiles
        timed(mesh, case.change(**settings))
    whole = {
        key: min(timed(mesh, case.change(**settings))[0] for _ in range(3))
        for key, settings in SETTINGS.items()
    }
    first = timed(mesh.with_points(mesh.points), case.change(relax="yes"))[1]["relax"]
    kept = benchmark.pedantic(lambda: timed(mesh, case.change(relax="yes"))[1]["relax"], rounds=3)
    per_cell = 1e6 / len(mesh.cells)
    benchmark.extra_info.update(
        cells=len(mesh.cells),
        relax_us_per_cell=first * per_cell,
        relax_kept_us_per_cell=kept * per_cell,
        layers_us_per_cell=(whole["layers"] - whole["rbf"]) * per_cell,
        rbf_over_elastic=whole["rbf"] / whole["elastic"],
        both_over_elastic=whole["both"] / whole["elastic"],
    )
