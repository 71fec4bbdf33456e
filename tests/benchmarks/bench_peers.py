"""What a user would take instead, on the same motion of the same boundary: ``make bench``.

Slideviz finds out how the boundary slides. The others cannot, and get the displacement of every
boundary node as slideviz found it, free of charge: they only have to move the nodes inside.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.samples.table import write_sample
from tests.benchmarks import openfoam
from tests.benchmarks.measured import call, call_other
from tests.benchmarks.rbf_slide import asked as asked_of
from tests.benchmarks.rbf_slide import greedy_rows

GROUP = "peers"
pytestmark = [pytest.mark.slow, pytest.mark.benchmark(group=GROUP)]
SIZES = [20_000, 240_000]
THESIS = next((row for row in greedy_rows() if row.case == "stator"), None)
"""The stator that RBF-SliDe was timed on, if it is at hand; its times are those of its table."""

DENSE_GB = 4.0
"""Largest dense matrix that is tried."""

SCIPY = """
import sys
import numpy as np
from scipy.interpolate import RBFInterpolator
data = np.load(sys.argv[1])
near = {"neighbors": 50, "kernel": "linear", "degree": 0} if sys.argv[2] == "near" else {}
found = RBFInterpolator(data["at"], data["by"], **near)(data["inside"])
np.save(sys.argv[3], found)
"""
"""SciPy's interpolator as it comes: thin plate splines and a linear polynomial. With neighbors that
ends where the nearest lie in one plane, so these have the linear kernel and a constant."""


@dataclass(frozen=True, eq=False)
class Asked:
    """A motion, and what slideviz made of it.

    Attributes
    ----------
    displacement : (n, 3)
    boundary, inside, moving : (b,), (i,), (m,) int64
        Nodes on and off the boundary, and those of the moving markers.
    """

    folder: Path
    mesh: sv.Mesh
    metric: str
    displacement: np.ndarray
    boundary: np.ndarray
    inside: np.ndarray
    moving: np.ndarray


@pytest.fixture(scope="module", params=[*SIZES, THESIS], ids=["20,000", "240,000", "thesis"])
def asked(request, tmp_path_factory):
    if request.param is None:
        pytest.skip("the thesis's meshes are not at hand")
    folder = tmp_path_factory.mktemp("peers")
    if request.param is THESIS:
        mesh, case = asked_of(THESIS)
        sv.write(folder / "mesh.su2", mesh)
        case = case.change(mesh_file=folder / "mesh.su2")
        case.write(folder / "stator.cfg")
    else:
        write_sample("stator", folder, request.param)
        mesh, case = sv.read(folder / "mesh.su2"), sv.Case.read(folder / "stator.cfg")
    *_, last = sv.deform(case, mesh)
    boundary = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    moving = [m.nodes for m in mesh.markers if case.roles.get(m.name) == "moving"]
    return Asked(
        folder,
        mesh,
        case.quality_metric,
        last.mesh.points - mesh.points,
        boundary,
        np.setdiff1d(np.arange(len(mesh.points)), boundary),
        np.unique(np.concatenate(moving)),
    )


def tell(benchmark, asked, memory, points):
    """Note what the table of peers has in a row."""
    found = sv.quality(asked.mesh.with_points(points), asked.mesh, asked.metric)
    benchmark.extra_info.update(
        cells=len(asked.mesh.cells),
        memory_gb=memory,
        min_quality=found.min,
        mean_quality=found.mean,
        inverted=found.inverted,
    )


def test_slideviz(benchmark, asked):
    """The whole command: reading, sliding, quality with proof, writing."""
    case, report = asked.folder / "stator.cfg", asked.folder / "report.json"
    command = "run", case, "-q", "--json", report, "-o", asked.folder / "out.su2", "--force"
    _, memory = benchmark.pedantic(call, command, rounds=2)
    assert json.loads(report.read_text())["quality"]["cells"] == len(asked.mesh.cells)
    tell(benchmark, asked, memory, sv.read(asked.folder / "out.su2").points)
    if asked.metric == "rbf-slide":
        theirs = {"rbf_slide_seconds": THESIS.seconds, "rbf_slide_quality": THESIS.quality}
        benchmark.extra_info.update(theirs)


@pytest.mark.parametrize("which", ["near", "all"], ids=["50 neighbors", "all nodes"])
def test_scipy(benchmark, asked, which):
    """Interpolation alone; the arrays are ready."""
    matrix = 8e-9 * len(asked.boundary) ** 2
    if which == "all" and matrix > DENSE_GB:
        pytest.skip(f"its matrix of {len(asked.boundary)} boundary nodes takes {matrix:.0f} GB")
    data, found = asked.folder / "scipy.npz", asked.folder / "scipy.npy"
    points, displacement = asked.mesh.points, asked.displacement
    np.savez(
        data,
        at=points[asked.boundary],
        by=displacement[asked.boundary],
        inside=points[asked.inside],
    )
    command = sys.executable, "-c", SCIPY, data, which, found
    _, memory = benchmark.pedantic(call_other, command, rounds=1)
    moved = points + displacement
    moved[asked.inside] = points[asked.inside] + np.load(found)
    tell(benchmark, asked, memory, moved)


@pytest.mark.skipif(not openfoam.HERE, reason="OpenFOAM is not installed")
def test_openfoam(benchmark, asked):
    """``displacementLaplacian``, with reading and writing; converting the mesh does not count."""
    folder = asked.folder / "foam"
    openfoam.write_case(folder, asked.mesh, asked.displacement, asked.moving)
    command = openfoam.PROGRAM, "-case", folder
    _, memory = benchmark.pedantic(
        call_other, command, {"environment": openfoam.ENVIRONMENT}, rounds=1
    )
    points = openfoam.read_points(folder)
    moved = asked.mesh.points + asked.displacement
    assert np.allclose(points[asked.boundary], moved[asked.boundary], rtol=0, atol=1e-12)
    tell(benchmark, asked, memory, points)
