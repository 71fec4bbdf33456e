"""Samples: the thesis's meshes node for node, and a blade passage worth looking at."""

import shutil
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError
from slideviz.mesh.elements import ELEMENTS
from slideviz.samples.passage import passage_mesh, smooth
from slideviz.samples.table import SAMPLES, Sample, sample, write_sample

ROOT = Path(__file__).parents[2]
THESIS = ROOT / ".." / "shared" / "meshes" / "thesis"
GRIDS = ("square", "polar", "hexahedron", "cylindrical")
FLAT = ("LEFT", "RIGHT", "LOWER", "UPPER", "BLOCK")
SOLID = ("LEFT", "RIGHT", "LOWER", "UPPER", "FRONT", "BACK", "BLOCK")

made = cache(sample)
"""Nothing in a sample can change, so one of each is enough."""


@pytest.fixture
def thesis() -> Path:
    if not THESIS.is_dir():
        pytest.skip("the rebuilt meshes of the thesis are not here")
    return THESIS


@pytest.mark.parametrize(
    ("file", "name", "size"),
    [
        ("square_25", "square", None),
        ("square_200", "square", 200),
        ("polar_25", "polar", None),
        ("hexa_25", "hexahedron", None),
        ("cylindrical_25", "cylindrical", None),
    ],
)
def test_mesh_is_the_thesis_mesh_node_for_node(thesis, file, name, size):
    expected, found = sv.read(thesis / f"{file}.su2"), made(name, size).mesh
    assert found.cells.same_as(expected.cells)
    assert found.marker_names == expected.marker_names
    for one, other in zip(found.markers, expected.markers, strict=True):
        assert one.cells.same_as(other.cells), one.name
    np.testing.assert_allclose(found.points, expected.points, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("file", "name", "size", "variant"),
    [
        ("square_25_severe", "square", None, "file"),
        ("square_25_translate", "square", None, "translate"),
        ("square_200_severe", "square", 200, "file"),
        ("square_200_translate", "square", 200, "translate"),
        ("polar_25_def", "polar", None, "file"),
        ("hexa_25_severe", "hexahedron", None, "file"),
        ("hexa_25_2d", "hexahedron", None, "flat"),
        ("cylindrical_25_def", "cylindrical", None, "file"),
    ],
)
def test_displacement_is_the_thesis_displacement(thesis, file, name, size, variant):
    expected = np.loadtxt(thesis / f"{file}.txt")
    found = made(name, size, variant).displacement
    np.testing.assert_array_equal(found.nodes, expected[:, 0])
    np.testing.assert_allclose(found.vectors, expected[:, 1:], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "size", "cells", "nodes", "block", "markers"),
    [
        ("square", None, 620, 676, (12, 12), FLAT),
        ("square", 200, 39680, 40128, (96, 96), FLAT),
        ("polar", None, 620, 676, (12, 12), FLAT),
        ("hexahedron", None, 15620, 17576, (22, 24), SOLID),
        ("cylindrical", None, 15620, 17576, (22, 24), SOLID),
    ],
)
def test_counts_are_those_of_the_thesis(name, size, cells, nodes, block, markers):
    """Thesis Tables 4.1, 4.3, 4.5, 4.9, 4.11; 4.2, 4.4 and 4.10 for the nodes of the block."""
    mesh = made(name, size).mesh
    assert (len(mesh.cells), len(mesh.points)) == (cells, nodes)
    assert mesh.marker_names == markers
    assert (len(mesh.marker("BLOCK").cells), len(mesh.marker("BLOCK").nodes)) == block


@pytest.mark.parametrize(("name", "size"), [("square", 25), ("square", 200), ("hexahedron", 25)])
def test_block_of_the_thesis_sizes_is_0_2_by_0_04_in_the_middle(name, size):
    mesh = made(name, size).mesh
    block = mesh.points[mesh.marker("BLOCK").nodes]
    half = np.array([0.1, 0.02, 0.02][: mesh.dim])
    np.testing.assert_allclose(block.min(axis=0), 0.5 - half, atol=1e-15)
    np.testing.assert_allclose(block.max(axis=0), 0.5 + half, atol=1e-15)


@pytest.mark.parametrize(
    ("size", "length", "height"),
    [(3, 1, 1), (4, 2, 2), (5, 1, 1), (9, 1, 1), (10, 2, 2), (26, 6, 2), (75, 15, 3), (100, 20, 4)],
)
def test_block_has_the_nearest_whole_number_of_cells_that_stays_in_the_middle(size, length, height):
    mesh = made("square", size).mesh
    block = mesh.points[mesh.marker("BLOCK").nodes]
    np.testing.assert_allclose(np.ptp(block, axis=0) * size, [length, height])
    np.testing.assert_allclose(block.min(axis=0) + block.max(axis=0), 1.0)
    assert len(mesh.cells) == size**2 - length * height


@pytest.mark.parametrize(
    ("name", "size"),
    [
        *((n, s) for n in GRIDS for s in (3, 8, 9)),
        pytest.param("hexahedron", 50, marks=pytest.mark.slow),
        ("passage", 12),
    ],
)
def test_markers_are_the_sides_of_the_mesh_and_every_node_is_used(name, size):
    mesh = made(name, size).mesh
    count = Counter()
    for nodes in mesh.cells.by_type.values():
        for local in ELEMENTS[{2: 9, 3: 12}[mesh.dim]].facets:
            count.update(map(tuple, np.sort(nodes[1][:, local], axis=1).tolist()))
    outside = {side for side, cells in count.items() if cells == 1}
    named = [
        tuple(sorted(side))
        for marker in mesh.markers
        for _, nodes in marker.cells.by_type.values()
        for side in nodes.tolist()
    ]
    assert len(named) == len(set(named)), "a side is in two markers"
    assert set(named) == outside
    assert len(mesh.cells.nodes) == len(mesh.points)


@pytest.mark.parametrize(("name", "quality"), [("square", 1.0), ("hexahedron", 1.0)])
def test_undeformed_cells_are_perfect(name, quality):
    mesh = made(name, 9).mesh
    assert sv.quality(mesh, reference=mesh).min == pytest.approx(quality, abs=1e-14)


@pytest.mark.parametrize("name", ["polar", "cylindrical"])
def test_undeformed_sector_has_the_quality_of_the_thesis(name):
    """Thesis Tables 4.5 and 4.11 (3D: of its program, which has the exponent 1)."""
    mesh = made(name).mesh
    found = sv.quality(mesh, reference=mesh, metric="rbf-slide")
    assert (round(found.min, 5), round(found.mean, 5)) == (0.99995, 0.99995)


@pytest.mark.parametrize("name", ["square", "hexahedron"])
@pytest.mark.parametrize("size", [25, 10])
def test_motion_keys_and_displacement_file_say_the_same(name, size):
    told, filed = made(name, size, "motion"), made(name, size, "file")
    assert told.displacement is None
    found = displacements(told.case, told.mesh)
    np.testing.assert_array_equal(found.nodes, filed.displacement.nodes)
    np.testing.assert_allclose(found.vectors, filed.displacement.vectors, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", ["polar", "cylindrical"])
def test_sector_block_moves_in_r_and_theta(name):
    made_one = made(name)
    before = made_one.mesh.points[made_one.displacement.nodes]
    after = before + made_one.displacement.vectors
    radius = [np.hypot(p[:, 0], p[:, 1]) for p in (before, after)]
    angle = [np.arctan2(p[:, 1], p[:, 0]) for p in (before, after)]
    np.testing.assert_allclose(radius[1] - radius[0], 0.2, atol=1e-14)
    np.testing.assert_allclose(np.degrees(angle[1] - angle[0]), -10.0, atol=1e-12)
    np.testing.assert_allclose(made_one.displacement.vectors[:, 2:], 0.2)


def test_roles_are_those_of_sliding_with_moving_vertices():
    """Thesis Figures 4.6 and 4.17."""
    case = made("hexahedron", 9).case
    assert set(case.markers_with("sliding")) == {"LEFT", "RIGHT", "FRONT", "BACK"}
    assert set(case.markers_with("periodic")) == {"LOWER", "UPPER"}
    assert case.markers_with("moving") == ("BLOCK",)
    assert (case.sliding, case.periodic, case.steps) == ("ps", "moving", 20)
    assert made("square", None, "translate").case.steps == 5


def same_mesh(one: sv.Mesh, other: sv.Mesh) -> bool:
    return (
        np.array_equal(one.points, other.points)
        and one.cells.same_as(other.cells)
        and one.marker_names == other.marker_names
        and all(a.cells.same_as(b.cells) for a, b in zip(one.markers, other.markers, strict=True))
    )


@pytest.mark.parametrize(
    ("name", "variant"), [(n, v) for n in SAMPLES for v in SAMPLES[n].variants]
)
def test_written_sample_reads_back_bit_for_bit_wherever_it_is_moved(tmp_path, name, variant):
    size = {
        "passage": 12,
        "turbine-row": 5_000,
        "turbine-row-3d": 10_000,
        "stator": 5_000,
        "impeller": 3_000,
        "wing": 2_000,
    }
    size = (size | {"airfoil": 16}).get(name, 5)
    paths = write_sample(name, tmp_path / "a" / "b", size, variant)
    assert all(path.is_file() for path in paths)
    assert {path.name for path in paths} == {path.name for path in (tmp_path / "a/b").iterdir()}
    shutil.move(tmp_path / "a" / "b", tmp_path / "moved")
    expected: Sample = made(name, size, variant)
    case = sv.Case.read(tmp_path / "moved" / f"{name}.cfg")
    assert case.mesh_file == tmp_path / "moved" / "mesh.su2"
    mesh = sv.read(case.mesh_file)
    assert same_mesh(mesh, expected.mesh)
    assert case.roles == expected.case.roles
    assert not case.warnings
    found = displacements(case, mesh)
    assert not found.warnings
    assert np.abs(found.vectors).max() > 0.03 * np.ptp(mesh.points[found.nodes], axis=0).max()
    if expected.displacement is not None:
        np.testing.assert_array_equal(found.nodes, expected.displacement.nodes)
        np.testing.assert_array_equal(found.vectors, expected.displacement.vectors)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("sqare",), r"no sample 'sqare'; the samples are square, .*did you mean square\?"),
        (("polar", None, "motion"), "no variant 'motion' of polar; it has file"),
        (("square", 2), "size 2 leaves no room for the block; expected 3 cells or more"),
        (("hexahedron", -1), "size -1 leaves no room"),
        (("airfoil", 15), "size 15 is too coarse for the airfoil; expected 16 cells or more"),
        (("passage", 11), "size 11 is too coarse for the blade; expected 12 cells or more"),
    ],
)
def test_wrong_request_is_told(arguments, sentence):
    with pytest.raises(CaseError, match=sentence):
        sample(*arguments)


def test_sample_does_not_replace_files_unasked(tmp_path):
    (tmp_path / "mesh.su2").write_text("mine")
    with pytest.raises(
        CaseError,
        match=r"mesh\.su2: exists already; .* replace it with --force",
    ):
        write_sample("square", tmp_path, 5)
    assert (tmp_path / "mesh.su2").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["mesh.su2"]
    write_sample("square", tmp_path, 5, overwrite=True)
    assert same_mesh(sv.read(tmp_path / "mesh.su2"), made("square", 5).mesh)


def test_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(CaseError, match=r"file/x: cannot create this folder: .*; choose another"):
        write_sample("square", tmp_path / "file" / "x", 5)


KEPT = [("square", 25), ("polar", 25), ("hexahedron", 9), ("airfoil", 48), ("turbine-row", 5_000)]


@pytest.mark.parametrize(("name", "size"), KEPT)
def test_sample_meshes_folder_holds_what_the_command_writes(tmp_path, name, size):
    folders = ROOT / "sample_meshes" / name, tmp_path
    write_sample(name, tmp_path, size)
    kept, fresh = (sv.Case.read(folder / f"{name}.cfg") for folder in folders)
    paths = {"mesh_file": None, "mesh_out": None, "source": None, "motions": ()}
    assert kept.change(**paths) == fresh.change(**paths)
    kept, fresh = (displacements(one, sv.read(one.mesh_file)) for one in (kept, fresh))
    np.testing.assert_array_equal(kept.nodes, fresh.nodes)
    np.testing.assert_allclose(kept.vectors, fresh.vectors, rtol=0, atol=1e-15)
    kept, fresh = (sv.read(folder / "mesh.su2") for folder in folders)
    # Not bit for bit: sine and cosine differ in the last digit between processors.
    np.testing.assert_allclose(kept.points, fresh.points, rtol=0, atol=1e-15)
    assert same_mesh(kept.with_points(fresh.points), fresh)


@pytest.mark.parametrize("variant", ["motion", "layers"])
def test_the_airfoil_has_square_cells_in_a_wide_far_field(variant):
    mesh = made("airfoil", 48, variant).mesh
    found = sv.quality(mesh, reference=mesh)
    assert found.skew.min() > 0.75
    body, far = (mesh.points[mesh.marker(name).nodes] for name in ("airfoil", "farfield"))
    np.testing.assert_allclose(np.ptp(body, axis=0), [1.0, 0.122], atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(far - [0.5, 0.0], axis=1), 50.0, rtol=0.01)
    ring = len(body)
    heights = np.linalg.norm(mesh.points[ring : 2 * ring] - body, axis=1)
    lengths = np.linalg.norm(np.roll(body, -1, axis=0) - body, axis=1)
    thin = 1e-3 if variant == "layers" else 1.0
    np.testing.assert_allclose(np.median(heights / lengths), thin, rtol=0.1)


def test_sample_meshes_folder_holds_the_passage():
    kept, fresh = sv.read(ROOT / "sample_meshes" / "passage" / "mesh.su2"), made("passage").mesh
    np.testing.assert_allclose(kept.points, fresh.points, rtol=0, atol=1e-7)
    assert same_mesh(kept.with_points(fresh.points), fresh)
    case = sv.Case.read(ROOT / "sample_meshes" / "passage" / "passage.cfg")
    assert (case.roles, case.motions) == (made("passage").case.roles, made("passage").case.motions)


def test_passage_has_about_5000_good_cells_and_paired_sides():
    mesh = made("passage").mesh
    assert 4500 < len(mesh.cells) < 5500
    assert mesh.marker_names == ("airfoil", "inflow", "outflow", "periodic_1", "periodic_2")
    found = sv.quality(mesh, reference=mesh)
    assert found.inverted == 0
    assert found.skew.min() > 0.8
    assert found.skew.mean() > 0.98
    below, above = (mesh.points[mesh.marker(f"periodic_{k}").nodes] for k in (1, 2))
    np.testing.assert_allclose(above - below, np.broadcast_to([0, 0.75], below.shape), atol=1e-14)
    for name, x in (("inflow", -0.5), ("outflow", 1.6)):
        assert set(mesh.points[mesh.marker(name).nodes, 0]) == {x}


@pytest.mark.parametrize("size", [13, 24])
def test_passage_of_other_sizes_is_good(size):
    mesh = passage_mesh(size)
    assert len(mesh.marker("inflow").cells) == size
    assert sv.quality(mesh, reference=mesh).skew.min() > 0.7


def test_passage_has_thin_cells_at_the_wall_that_grow_smoothly():
    mesh = made("passage").mesh
    wall = mesh.marker("airfoil").nodes
    around, layers = len(wall), 18
    rings = mesh.points[wall.min() : wall.min() + around * layers].reshape(layers, around, 2)
    height = np.linalg.norm(np.diff(rings, axis=0), axis=2)
    growth = height[1:] / height[:-1]
    assert height[0].max() < 2e-3
    assert growth.min() > 1.0
    assert np.median(growth) < 1.25
    # Behind the round trailing edge the lines fan out.
    assert growth.max() < 1.6
    width = np.linalg.norm(rings[0] - np.roll(rings[0], 1, axis=0), axis=1)
    assert max((width / np.roll(width, k)).max() for k in (1, -1)) < 1.5


def test_passage_deforms_well_only_with_moving_periodic_sides():
    mesh, case = made("passage").mesh, made("passage").case
    *_, last = sv.deform(case, mesh)
    *_, plain = sv.deform(case.change(sliding="none", periodic="none"), mesh)
    found, other = (sv.quality(step.mesh, reference=mesh) for step in (last, plain))
    assert found.inverted == 0
    assert found.min > 0.7 > other.min


def grid(nx: int, ny: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit-spaced points, quads, and unknowns with all of the outside fixed."""
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    parts = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    free = np.zeros((*x.shape, 2), bool)
    free[1:-1, 1:-1] = True
    unknown = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
    quads = np.column_stack([part.ravel() for part in parts])
    return np.column_stack([x.ravel(), y.ravel()]), quads, unknown.reshape(-1, 2)


def test_smoothing_finds_the_uniform_grid_again():
    points, quads, unknown = grid(6, 5)
    noise = np.random.default_rng(1).uniform(-0.4, 0.4, points.shape)
    start = np.where(unknown >= 0, points + noise, points)
    assert np.abs(start - points).max() > 0.3
    found = smooth(start, quads, np.ones(len(quads)), unknown)
    np.testing.assert_allclose(found, points, atol=1e-9)


def test_smoothing_gives_the_layers_the_heights_asked_for():
    height = np.array([0.2, 0.5, 1.0, 1.3])
    points, quads, unknown = grid(5, 4)
    wanted = np.column_stack(
        [points[:, 0], np.append(0, np.cumsum(height))[points[:, 1].astype(int)]]
    )
    start = np.where(unknown >= 0, points * [1, 3 / 4], wanted)
    found = smooth(start, quads, np.tile(height, 5), unknown)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_smoothing_moves_coordinates_of_one_number_alike():
    points, quads, unknown = grid(4, 4)
    low, high = points[:, 1] == 0, points[:, 1] == 4
    inner = (points[:, 0] > 0) & (points[:, 0] < 4)
    ties = unknown.max() + 1 + np.arange(3)
    unknown[low & inner, 1] = unknown[high & inner, 1] = ties
    start = points.copy()
    for side in (low, high):
        start[side & inner, 1] += [-0.2, 0.1, 0.3]
    found = smooth(start, quads, np.ones(len(quads)), unknown)
    np.testing.assert_allclose(
        found[high] - found[low], np.broadcast_to([0, 4.0], (5, 2)), atol=1e-12
    )
    np.testing.assert_allclose(found, points, atol=1e-9)
