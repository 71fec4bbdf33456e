"""The sample ``turbine-row``: a vane that can grow, and twists in 3D."""

from functools import cache

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import CaseError
from slideviz.mesh.periodic import pair_up
from slideviz.mesh.topology import facet_vectors, find_boundary
from slideviz.samples.table import sample, sample_case
from slideviz.samples.turbine_row import SPAN, extruded_row, row_mesh

PITCH = 0.03138143383615058

made = cache(row_mesh)


def test_case_is_that_of_the_thesis():
    """Thesis Figure 4.11: 7 % larger about the leading edge, and 0.001 downward."""
    mesh, case = made(5_000), sample_case("turbine-row")
    *_, last = sv.deform(case, mesh)
    blade = mesh.marker("BLADE").nodes
    expected = 1.07 * mesh.points[blade] + [0.0, -0.001]
    np.testing.assert_allclose(last.mesh.points[blade], expected, rtol=0, atol=1e-12)
    assert np.abs(mesh.points[blade]).min(axis=0).max() < 5e-4, "the leading edge is the origin"
    assert (case.sliding, case.periodic, case.steps) == ("ps", "moving", 2)
    assert case.reduction is None


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_vane_grows_without_inverted_cells(method):
    mesh = made(5_000)
    *_, last = sv.deform(sample_case("turbine-row").change(sliding=method), mesh)
    found = sv.quality(last.mesh, reference=mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert found.min > 0.5
    first, second = (last.mesh.points[mesh.marker(name).nodes] for name in ("PER1", "PER2"))
    (pair,) = pair_up(mesh, ("PER1", "PER2"), "translational", (0, 0, 1), (0, 0, 0))
    shift = last.mesh.points[pair.nodes[:, 1]] - last.mesh.points[pair.nodes[:, 0]]
    np.testing.assert_allclose(shift, np.broadcast_to([0, PITCH], shift.shape), atol=1e-9)
    assert np.abs(first - mesh.points[mesh.marker("PER1").nodes]).max() > 1e-4
    assert len(first) == len(second)


@pytest.mark.parametrize("size", [4_999, 6_000, 0, -3])
def test_size_without_a_file_is_refused(size):
    with pytest.raises(CaseError, match=rf"no turbine row of {size} cells; use 5000 or 20000"):
        row_mesh(size)


def test_usual_mesh_is_good():
    mesh = sample("turbine-row").mesh
    assert len(mesh.cells) == pytest.approx(20_000, rel=0.05)
    found = sv.quality(mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert found.min > 0.6


def test_extruded_row_has_hexahedra_at_the_vane_and_facets_with_outward_normals():
    mesh = extruded_row(10_000)
    assert len(mesh.cells) == pytest.approx(10_000, rel=0.05)
    assert set(mesh.cells.by_type) == {12, 13}
    assert sv.quality(mesh, reference=mesh).inverted == 0
    assert np.ptp(mesh.points[:, 2]) == SPAN
    areas = {
        marker.name: np.concatenate(
            [
                facet_vectors(mesh.points, nodes[:, [0, 1, 2, -1]])
                for _, nodes in marker.cells.by_type.values()
            ]
        )
        for marker in mesh.markers
    }
    for name, z in {"HUB": -1.0, "SHROUD": 1.0}.items():
        assert (z * areas[name][:, 2] > 0).all()
    total = sum(area.sum(axis=0) for area in areas.values())
    np.testing.assert_allclose(total, 0.0, atol=1e-12)
    assert sum(map(len, areas.values())) == len(find_boundary(mesh).facets)


def test_extruded_row_twists_from_hub_to_shroud_which_slide():
    mesh, case = extruded_row(10_000), sample_case("turbine-row-3d")
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, reference=mesh).inverted == 0
    vane = mesh.marker("BLADE").nodes
    z = mesh.points[vane, 2]
    before, after = (
        p[vane, :2] @ [1, 1j] - complex(0.016, -0.012) for p in (mesh.points, last.mesh.points)
    )
    angle = np.degrees(np.angle(after / before))
    part = z / SPAN
    np.testing.assert_allclose(angle, 10.0 * part**2 * (3 - 2 * part), atol=0.01)
    np.testing.assert_allclose(np.abs(after / before), 1.0, atol=0.004)
    for name in ("HUB", "SHROUD"):
        nodes = mesh.marker(name).nodes
        moved = (last.mesh.points - mesh.points)[np.setdiff1d(nodes, vane)]
        assert np.abs(moved[:, 2]).max() == 0.0
        assert name == "HUB" or np.abs(moved[:, :2]).max() > 1e-4
    with pytest.raises(CaseError, match="size 9999 is out of range; a turbine row in 3D has 10000"):
        extruded_row(9_999)
