"""The sample ``stator``: the annulus of thesis Table 4.13, good cells, a blade that can lean."""

from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.periodic import pair_up
from slideviz.samples.passage import (
    BladeSection,
    Shares,
    blade_nodes,
    counts,
    make_grid,
    smoothed,
    straight_points,
)
from slideviz.samples.stator import refined
from slideviz.samples.table import SAMPLES, Sample, sample, write_sample

made = cache(sample)
KEPT = Path(__file__).parents[2] / "sample_meshes" / "stator"
PERIOD = 2 * np.pi / 41


def stator(size: int) -> Sample:
    return made("stator", size)


def cylindrical(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, y, z = points.T
    return np.hypot(x, y), np.arctan2(y, x), z


@pytest.mark.parametrize("size", [5_000, 7_777, pytest.param(20_000, marks=pytest.mark.slow)])
def test_size_is_the_number_of_cells_and_all_are_good(size):
    mesh = stator(size).mesh
    assert len(mesh.cells) == pytest.approx(size, rel=0.1)
    found = sv.quality(mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert set(found.signs.tolist()) == {1}
    assert found.min > 0.7
    assert found.mean > 0.97


@pytest.mark.slow
def test_default_size_is_near_that_of_the_thesis():
    """Thesis Table 4.13: 240004 cells and 256590 nodes."""
    mesh = sample("stator").mesh
    assert SAMPLES["stator"].size == 240_000
    assert len(mesh.cells) == pytest.approx(240_004, rel=0.03)
    assert len(mesh.points) == pytest.approx(256_590, rel=0.03)
    assert sv.quality(mesh).min > 0.7


@pytest.mark.parametrize("size", [5_000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_extents_are_those_of_the_thesis(size):
    mesh = stator(size).mesh
    radius, _, z = cylindrical(mesh.points)
    assert (z.min(), z.max()) == pytest.approx((0, 0.1143), abs=1e-15)
    for name, r in (("HUB", 0.25), ("SHROUD", 0.3)):
        np.testing.assert_allclose(radius[mesh.marker(name).nodes], r, rtol=1e-14)
    assert radius.min() == pytest.approx(0.25)
    assert radius.max() == pytest.approx(0.3)
    for name, end in (("INFLOW", 0.0), ("OUTFLOW", 0.1143)):
        np.testing.assert_allclose(z[mesh.marker(name).nodes], end, atol=1e-15)
    blade = z[mesh.marker("BLADE").nodes]
    assert (blade.min(), blade.max()) == pytest.approx((0.035, 0.08), abs=1e-3)


def test_markers_are_the_sides_and_every_node_is_used():
    mesh = stator(5_000).mesh
    names = ("BLADE", "HUB", "SHROUD", "INFLOW", "OUTFLOW", "PER1", "PER2")
    assert mesh.marker_names == names
    count: Counter = Counter()
    nodes = mesh.cells.by_type[12][1]
    for local in ELEMENTS[12].facets:
        count.update(map(tuple, np.sort(nodes[:, local], axis=1).tolist()))
    sides = [
        tuple(sorted(side))
        for marker in mesh.markers
        for side in marker.cells.by_type[9][1].tolist()
    ]
    assert len(sides) == len(set(sides))
    assert set(sides) == {side for side, cells in count.items() if cells == 1}
    assert len(mesh.cells.nodes) == len(mesh.points)


@pytest.mark.parametrize("size", [5_000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_second_periodic_side_is_the_first_one_turned_by_a_41st(size):
    mesh = stator(size).mesh
    (pair,) = pair_up(mesh, ("PER1", "PER2"), "rotational", (0, 0, 1), (0, 0, 0))
    assert pair.period == pytest.approx(PERIOD, rel=1e-12)
    assert pair.mismatch < 1e-15
    assert len(pair.nodes) == len(mesh.marker("PER1").nodes)


def test_blade_is_twisted():
    mesh = stator(20_000).mesh
    radius, theta, z = cylindrical(mesh.points[mesh.marker("BLADE").nodes])
    slope = []
    for r in (0.25, 0.3):
        at = np.isclose(radius, r)
        front, back = (np.argmin(z[at]), np.argmax(z[at]))
        arc = r * theta[at]
        slope.append((arc[back] - arc[front]) / (z[at][back] - z[at][front]))
    assert slope[0] > slope[1]
    assert min(slope) > -0.6
    assert max(slope) < -0.4


@pytest.mark.parametrize("size", [4_999, 5_000_001, 0, -3])
def test_size_out_of_range_is_told(size):
    with pytest.raises(CaseError, match=rf"size {size} is out of range; a stator has 5000 to 5000"):
        sample("stator", size)


def test_displacement_moves_the_blade_around_the_axis_only():
    one = stator(20_000)
    nodes, vectors = one.displacement.nodes, one.displacement.vectors
    np.testing.assert_array_equal(nodes, one.mesh.marker("BLADE").nodes)
    before, after = one.mesh.points[nodes], one.mesh.points[nodes] + vectors
    radius, theta, _ = cylindrical(before)
    moved_radius, moved_theta, _ = cylindrical(after)
    np.testing.assert_allclose(moved_radius, radius, rtol=1e-14)
    hub, shroud = np.isclose(radius, 0.25), np.isclose(radius, 0.3)
    length = np.linalg.norm(vectors, axis=1)
    assert 1e-5 < length[hub].max() < 2e-3, "bumps only"
    assert length[shroud].min() > 5e-3
    turned = np.degrees(moved_theta - theta)
    assert -5.5 < turned.min() < -3
    # Bumps: what remains is neither rigid nor rough.
    near = np.abs(radius - 0.275) < 3e-3
    assert np.std(turned[near]) > 0.05


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_blade_leans_out_of_its_passage_without_inverted_cells(tmp_path, method):
    write_sample("stator", tmp_path, 5_000)
    case = sv.Case.read(tmp_path / "stator.cfg").change(sliding=method)
    mesh = sv.read(case.mesh_file)
    *_, last = sv.deform(case, mesh)
    found = sv.quality(last.mesh, reference=mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert found.min > 0.5
    radius, *_ = cylindrical(last.mesh.points)
    assert (radius.min(), radius.max()) == pytest.approx((0.25, 0.3), abs=1e-4)
    assert case.roles["HUB"] == case.roles["SHROUD"] == "internal"
    assert case.reduction.tolerance == 1e-5


def test_plain_interpolation_cannot_follow(tmp_path):
    """As thesis section 4.2.3 says: the new blade is not within the old domain."""
    write_sample("stator", tmp_path, 5_000)
    case = sv.Case.read(tmp_path / "stator.cfg").change(sliding="none", periodic="none")
    with pytest.raises(CaseError, match="puts BLADE through PER1"):
        list(sv.deform(case, sv.read(case.mesh_file)))


def test_refined_grid_keeps_the_places_of_the_coarse_one():
    shares = Shares(nose=0.5, tail=0.15)
    section = BladeSection(pitch=0.9)
    coarse, fine = (make_grid(counts(size, shares)) for size in (18, 36))
    start = smoothed(coarse, straight_points(coarse, section))
    found = refined(coarse, start, fine, section)
    assert np.isfinite(found).all()
    blade = blade_nodes(fine.n.lower, fine.ring.shape[1] - fine.n.lower, section)
    np.testing.assert_allclose(found[fine.ring[0]], blade, atol=1e-14)
    np.testing.assert_allclose(found[fine.number[::2, ::2][0]], start[coarse.number[0]], atol=1e-12)
    shift = found[fine.number[:, -1]] - found[fine.number[:, 0]]
    np.testing.assert_allclose(shift, np.broadcast_to([0, 0.9], shift.shape), atol=1e-12)
    mesh = sv.Mesh(found, sv.Cells.from_blocks([(9, fine.quads)]))
    assert sv.quality(mesh).min > 0.5


def test_sample_meshes_folder_holds_a_small_stator():
    kept, fresh = sv.read(KEPT / "mesh.su2"), stator(5_000)
    np.testing.assert_allclose(kept.points, fresh.mesh.points, rtol=0, atol=1e-8)
    assert kept.cells.same_as(fresh.mesh.cells)
    assert kept.marker_names == fresh.mesh.marker_names
    case = sv.Case.read(KEPT / "stator.cfg")
    found = displacements(case, kept)
    np.testing.assert_array_equal(found.nodes, fresh.displacement.nodes)
    np.testing.assert_allclose(found.vectors, fresh.displacement.vectors, rtol=0, atol=1e-8)
    paths = {"mesh_file": None, "mesh_out": None, "source": None, "motions": ()}
    assert case.change(**paths) == fresh.case.change(**paths)


@pytest.mark.parametrize("block", [1000, pytest.param(1 << 18, marks=pytest.mark.slow)])
def test_a_stream_writes_what_memory_holds(tmp_path, monkeypatch, block):
    from slideviz.formats.su2b import write as su2b_write

    monkeypatch.setattr(su2b_write, "BLOCK", block)
    whole = stator(7_777)
    write_sample("stator", tmp_path, 7_777, file_format="su2b")
    sv.write(tmp_path / "memory.su2b", whole.mesh)
    assert (tmp_path / "mesh.su2b").read_bytes() == (tmp_path / "memory.su2b").read_bytes()
    case = sv.Case.read(tmp_path / "stator.cfg")
    assert case.mesh_file == tmp_path / "mesh.su2b"
    assert case.mesh_out == tmp_path / "stator_deformed.su2b"
    asked = displacements(case, sv.read(case.mesh_file))
    assert np.array_equal(asked.vectors, whole.displacement.vectors)


@pytest.mark.parametrize("name", ["square", "polar", "hexahedron", "cylindrical"])
def test_the_cases_of_the_thesis_are_streamed_too(tmp_path, monkeypatch, name):
    from slideviz.formats.su2b import write as su2b_write

    monkeypatch.setattr(su2b_write, "BLOCK", 100)
    write_sample(name, tmp_path, 30, file_format="su2b")
    sv.write(tmp_path / "memory.su2b", made(name, 30).mesh)
    assert (tmp_path / "mesh.su2b").read_bytes() == (tmp_path / "memory.su2b").read_bytes()


def test_a_passage_is_written_as_binary_from_memory(tmp_path):
    write_sample("passage", tmp_path, 24, file_format="su2b")
    assert sv.read(tmp_path / "mesh.su2b").cells.same_as(made("passage", 24).mesh.cells)


def test_a_grid_finer_than_those_that_are_smoothed_is_as_good(monkeypatch):
    from slideviz.samples import stator as module

    monkeypatch.setattr(module, "FINEST", 20)
    monkeypatch.setattr(module, "SPLINED", 16)
    monkeypatch.setattr(module, "COARSE", 12)
    mesh = sample("stator", 40_000).mesh
    found = sv.quality(mesh)
    assert (found.inverted, found.unproven) == (0, 0)
    assert found.min > 0.4
    pair_up(mesh, ("PER1", "PER2"), "rotational")


def test_sizes_that_are_out_of_range_are_told(tmp_path):
    with pytest.raises(CaseError, match=r"up to 200000000 as an SU2 binary mesh"):
        sample("stator", 6_000_000)
    with pytest.raises(CaseError, match="out of range; a stator has 5000 to 200000000"):
        write_sample("stator", tmp_path, 10**9, file_format="su2b")
    with pytest.raises(CaseError, match=r"728[0-9]+ cells are too many; a sample has 200000000"):
        write_sample("hexahedron", tmp_path, 900, file_format="su2b")
