"""Sections: which cells a plane or cylinder cuts, and the polygons that come of it."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.errors import ArgumentError, CaseError
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, Mesh
from slideviz.sections.cut import Cutter, cut_cases
from slideviz.sections.model import Section
from slideviz.sections.polygons import joined
from slideviz.session.section_cuts import position_range
from tests.builders import cube, passage, permuted, square
from tests.oracles.sections import cut_cells, height

KINDS = ("plain", "simplex", "prism", "mixed")


def shaken(mesh, seed=1, part=0.25):
    """The mesh with its nodes moved at random, so that sides are no longer flat."""
    rng = np.random.default_rng(seed)
    spacing = mesh.extent / round(len(mesh.points) ** (1 / mesh.dim))
    return mesh.with_points(mesh.points + rng.uniform(-part, part, mesh.points.shape) * spacing)


def areas(polygons):
    """Area of each polygon, as that of the triangles around its first corner."""
    found = []
    for first, last in zip(polygons.offsets[:-1], polygons.offsets[1:], strict=True):
        x = polygons.points[polygons.connectivity[first:last]]
        total = sum(np.cross(x[i] - x[0], x[i + 1] - x[0]) for i in range(1, len(x) - 1))
        found.append(np.linalg.norm(total) / 2)
    return np.array(found)


def edge_counts(polygons):
    """How often each pair of neighbouring corners occurs."""
    found = {}
    for first, last in zip(polygons.offsets[:-1], polygons.offsets[1:], strict=True):
        ring = polygons.connectivity[first:last]
        for a, b in zip(ring, np.roll(ring, -1), strict=True):
            key = (min(a, b), max(a, b))
            found[key] = found.get(key, 0) + 1
    return found


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(
    direction=st.tuples(*[st.integers(-3, 3)] * 3).filter(any),
    at=st.tuples(*[st.integers(0, 8).map(lambda i: i / 8)] * 3),
    seed=st.integers(0, 3),
)
def test_a_plane_cuts_the_cells_that_it_has_nodes_on_both_sides_of(kind, direction, at, seed):
    mesh = cube(4, kind, block=False)
    if seed:
        mesh = shaken(mesh, seed)
    section = Section("plane", at, direction)
    found = Cutter(mesh).cut(mesh.points, section)
    wanted = cut_cells(mesh, section)
    if not wanted:
        # The section at most touches the mesh from outside: then the cells on its other side.
        turned = Section("plane", at, tuple(-v for v in direction))
        wanted = cut_cells(mesh, turned)
    assert found.cell_ids.tolist() == wanted


@pytest.mark.parametrize("kind", ["plain", "simplex", "prism"])
@settings(max_examples=20, deadline=None)
@given(
    radius=st.floats(0.05, 1.5),
    axis=st.sampled_from([(0, 0, 1), (0, 0, -2), (1, 0, 0), (1, 2, 3)]),
    centre=st.tuples(*[st.floats(-0.2, 0.8)] * 3),
)
def test_a_cylinder_cuts_the_cells_that_it_has_nodes_on_both_sides_of(kind, radius, axis, centre):
    mesh = shaken(cube(4, kind, block=False))
    section = Section("cylinder", centre, axis, radius)
    found = Cutter(mesh).cut(mesh.points, section)
    assert found.cell_ids.tolist() == cut_cells(mesh, section)
    # Not only near it: every corner is on the cylinder.
    assert max((abs(height(section, p)) for p in found.points), default=0.0) < 1e-12


def test_distances_are_those_of_the_literal_formula():
    points = np.random.default_rng(0).normal(size=(40, 3))
    for section in (
        Section("plane", (0.1, 0.2, 0.3), (1.0, -2.0, 0.5)),
        Section("cylinder", (0.1, 0.2, 0.3), (1.0, -2.0, 0.5), 0.7),
    ):
        wanted = [height(section, point) for point in points]
        assert section.distance(points) == pytest.approx(wanted, abs=1e-14)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("normal", "at", "area"),
    [
        ((0, 0, 1), (0, 0, 0.5), 1.0),
        ((0, 1, 0), (0, 0.3, 0), 1.0),
        ((1, 1, 1), (0.5, 0.5, 0.5), 0.75 * np.sqrt(3)),
        ((1, -1, 0), (0.5, 0.5, 0), np.sqrt(2)),
        ((0, 0, 1), (0, 0, 0.0), 1.0),
        ((0, 0, 1), (0, 0, 1.0), 1.0),
    ],
)
def test_the_polygons_of_a_plane_cover_the_cross_section_once(kind, normal, at, area):
    mesh = cube(6, kind, block=False)
    found = Cutter(mesh).cut(mesh.points, Section("plane", at, normal))
    assert areas(found).sum() == pytest.approx(area, abs=1e-12)
    assert areas(found).min() > 1e-12


def test_a_layer_of_nodes_in_the_plane_gives_one_layer_of_cells_whatever_the_rounding():
    mesh = cube(6, block=False)
    noise = np.random.default_rng(3).uniform(-1e-13, 1e-13, mesh.points.shape)
    found = Cutter(mesh).cut(mesh.points + noise, Section("plane", (0, 0, 0.5)))
    assert len(found) == 36
    middle = [mesh.points[mesh.cells.by_type[12][1][i], 2].mean() for i in found.cells]
    assert max(middle) < 0.5


@pytest.mark.parametrize("kind", KINDS)
def test_neighbours_share_the_sides_of_their_polygons(kind):
    mesh = shaken(cube(5, kind, block=False))
    for section in (
        Section("plane", (0.5, 0.5, 0.5), (1, 2, 3)),
        Section("cylinder", (0, 0, 0), (0, 0, 1), 0.8),
    ):
        found = Cutter(mesh).cut(mesh.points, section)
        counts = edge_counts(found)
        assert max(counts.values()) == 2
        # What one polygon only has is the rim: a closed line, so every point has two of it.
        rim = np.array([edge for edge, count in counts.items() if count == 1])
        assert len(rim) < len(counts)
        assert set(np.bincount(rim.ravel())) <= {0, 2}


@pytest.mark.parametrize("vtk", [10, 12, 13, 14])
def test_every_pattern_of_signs_has_closed_loops_over_all_crossed_edges(vtk):
    row = ELEMENTS[vtk]
    table = cut_cases(vtk)
    for pattern in range(2**row.n_nodes):
        crossed = sorted(
            i for i, (a, b) in enumerate(row.edges) if (pattern >> a & 1) != (pattern >> b & 1)
        )
        loops = [loop[loop >= 0] for loop in table[pattern]]
        assert sorted(np.concatenate(loops)) == crossed
        for loop in loops:
            for one, other in zip(loop, np.roll(loop, -1), strict=True):
                nodes = {*row.edges[one], *row.edges[other]}
                assert any(nodes <= set(side) for side in row.facets)


def test_order_of_nodes_does_not_matter():
    mesh = shaken(cube(4, "mixed", block=False))
    order = np.random.default_rng(5).permutation(len(mesh.points))
    section = Section("cylinder", (0, 0, 0), (0, 0, 1), 0.7)
    one, other = (Cutter(m).cut(m.points, section) for m in (mesh, permuted(mesh, order)))
    assert areas(one).sum() == pytest.approx(areas(other).sum(), rel=1e-12)
    assert one.cell_ids.tolist() == other.cell_ids.tolist()


def test_one_cutter_serves_all_positions_of_the_nodes():
    mesh = cube(5, block=False)
    cutter, section = Cutter(mesh), Section("plane", (0, 0, 0.45))
    first = cutter.cut(mesh.points, section)
    later = cutter.cut(mesh.points + np.array([0, 0, 0.2]), section)
    assert not set(first.cells) & set(later.cells)
    assert cutter.which_cells(mesh.points, section).tolist() == first.cells.tolist()


def test_a_plane_cuts_a_2d_mesh_in_lines():
    mesh = square(6, "mixed", block=False)
    section = Section("plane", (0, 0.45, 0), (0, 1, 0))
    found = Cutter(mesh).cut(mesh.points, section)
    assert set(found.sizes) == {2}
    ends = found.points[found.connectivity].reshape(-1, 2, 3)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.0)
    assert found.cell_ids.tolist() == cut_cells(mesh, section)
    whole = Cutter(mesh).show(mesh.points, replace(section, whole_cells=True))
    assert whole.cells.tolist() == cut_cells(mesh, section)
    assert set(whole.sizes) <= {3, 4}


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -3)])
def test_a_cylinder_cuts_a_2d_mesh_in_a_circle(direction):
    mesh = square(12, "mixed", block=False)
    section = Section("cylinder", (0.5, 0.5, 0.0), direction, 0.3)
    found = Cutter(mesh).cut(mesh.points, section)
    assert set(found.sizes) == {2}
    assert np.hypot(*(found.points[:, :2] - 0.5).T) == pytest.approx(0.3)
    ends = found.points[found.connectivity].reshape(-1, 2, 3)
    # Chords, a little shorter than the arcs they stand for.
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert 0.98 * 0.6 * np.pi < length < 0.6 * np.pi
    assert found.cell_ids.tolist() == cut_cells(mesh, section)
    assert Cutter(mesh).show(
        mesh.points, replace(section, whole_cells=True)
    ).cells.tolist() == cut_cells(mesh, section)


def test_in_2d_the_axis_of_a_cylinder_is_z():
    mesh = square(3, block=False)
    with pytest.raises(CaseError, match="its axis is not z, so it needs a 3D mesh"):
        Cutter(mesh).cut(mesh.points, Section("cylinder", direction=(1, 0, 0), radius=0.5))


def test_a_section_beside_the_mesh_cuts_nothing():
    mesh = cube(3, block=False)
    for section in (
        Section("plane", (0, 0, 1.5)),
        Section("cylinder", (0, 0, 0), (0, 0, 1), 2.0),
    ):
        cutter = Cutter(mesh)
        assert len(cutter.cut(mesh.points, section)) == 0
        assert len(cutter.show(mesh.points, replace(section, whole_cells=True))) == 0


@pytest.mark.parametrize("kind", KINDS)
def test_whole_cells_have_a_closed_surface_that_looks_outwards(kind):
    mesh = shaken(cube(5, kind, block=False), part=0.1)
    section = Section("plane", (0.5, 0.5, 0.5), (1, 2, 3), whole_cells=True)
    cutter = Cutter(mesh)
    found = cutter.show(mesh.points, section)
    ids = cutter.which_cells(mesh.points, section)
    assert set(found.cells) <= set(ids)
    assert set(edge_counts(found).values()) <= {2, 4}
    # Green's theorem: the surface holds the volume of the cells.
    volume = 0.0
    for first, last in zip(found.offsets[:-1], found.offsets[1:], strict=True):
        x = found.points[found.connectivity[first:last]]
        centre = x.mean(axis=0)
        for a, b in zip(x, np.roll(x, -1, axis=0), strict=True):
            volume += np.dot(centre, np.cross(a, b)) / 6
    flat = np.insert(mesh.cells.connectivity, mesh.cells.offsets[:-1], np.diff(mesh.cells.offsets))
    cells = pv.UnstructuredGrid(flat, mesh.cells.types, mesh.points)
    sizes = cells.extract_cells(ids).compute_cell_sizes()["Volume"]
    assert volume == pytest.approx(sizes.sum(), rel=0.02)


def test_the_polygons_of_a_plane_fill_it():
    mesh = cube(4, "prism", block=False)
    section = Section("plane", (0, 0, 0.4), (0, 0, 1))
    found = Cutter(mesh).cut(mesh.points, section)
    shape = pv.PolyData(
        found.points, faces=np.insert(found.connectivity, found.offsets[:-1], found.sizes)
    )
    assert shape.n_cells == len(found) == len(found.cells)
    assert shape.area == pytest.approx(1.0)


def test_pieces_are_taken_and_joined():
    mesh = cube(4, block=False)
    found = Cutter(mesh).cut(mesh.points, Section("plane", (0, 0, 0.4)))
    halves = [found.take(np.arange(8)), found.take(np.arange(8, 16))]
    both = joined(halves[::-1])
    assert both.cells.tolist() == [*found.cells[8:], *found.cells[:8]]
    assert areas(both) == pytest.approx(areas(found.take(np.r_[8:16, 0:8])))


def test_cells_of_no_kind_that_a_mesh_has_are_no_trouble():
    cells = Cells.from_blocks([(12, np.arange(8)[None]), (10, np.empty((0, 4)))])
    points = np.array(
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    )
    mesh = Mesh(points, cells)
    found = Cutter(mesh).cut(mesh.points, Section("plane", (0.2, 0.2, 0.2), (1, 1, 1)))
    assert found.sizes.tolist() == [3]


def test_the_reach_tells_where_a_section_meets_the_mesh():
    mesh = passage()
    radii = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    low, high = position_range(Section("cylinder", radius=1.0), mesh.points)
    assert (low, high) == pytest.approx((radii.min(), radii.max()))
    low, high = position_range(Section("plane", (0, 0, 0.25), (0, 0, 2)), mesh.points)
    assert (low, high) == pytest.approx((mesh.points[:, 2].min(), mesh.points[:, 2].max()))


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (Section("plane", (0, 0, 0.5)), "plane z = 0.5"),
        (Section("plane", (0.25, 0, 0), (-2, 0, 0)), "plane x = 0.25"),
        (
            Section("plane", (0.25, 0, 0), (1, 1, 0)),
            "plane with normal (1, 1, 0) through (0.25, 0, 0)",
        ),
        (Section("cylinder", (0, 0, 3), radius=0.2512), "cylinder r = 0.2512 about z"),
        (
            Section("cylinder", (0, 1, 0), (1, 0, 0), 2),
            "cylinder r = 2 about x through (0, 1, 0)",
        ),
    ],
)
def test_a_section_is_described_in_words(section, words):
    assert section.describe() == words


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (Section("plane", (0.25, 7, 0), (-2, 0, 0)), "line x = 0.25"),
        (Section("plane", (0.25, 0.5, 0), (-1, 1, 0)), "line at 45° through (0.25, 0.5)"),
        (Section("plane", (0.25, 0, 0), (1, 1, 0)), "line at -45° through (0.25, 0)"),
        (Section("cylinder", (0, 1, 0), radius=0.2), "circle r = 0.2 about (0, 1)"),
        # These do not cut the plane of the mesh in a line or circle.
        (Section("plane", (0, 0, 0.5)), "plane z = 0.5"),
        (Section("cylinder", (0, 0, 0), (1, 0, 0), 2), "cylinder r = 2 about x"),
    ],
)
def test_in_2d_sections_are_lines_and_circles(section, words):
    assert section.describe(2) == words


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (Section("plane", (0, 0, 0.5)), "plane z = 0.5"),
        (
            Section("plane", (0.00987929, 0.277571194, -0.00384), (-0.3082, 0.3082, 0.9)),
            "plane ⊥ (-0.31, 0.31, 0.9) at 0.079",
        ),
        (Section("cylinder", (0, 0, 3), radius=0.2512), "cylinder r = 0.2512 about z"),
        (
            Section("cylinder", (0.1234, 1, 0), (0.70711, 0.70711, 0), 2),
            "cylinder r = 2 about (0.71, 0.71, 0) at (0.12, 1, 0)",
        ),
    ],
)
def test_in_a_list_words_are_short(section, words):
    assert section.brief() == words
    assert (
        Section("plane", (0.25, 0.5, 0), (-1, 1, 0)).brief(2) == "line at 45° through (0.25, 0.5)"
    )


def test_wrong_sections_are_refused():
    with pytest.raises(CaseError, match="the radius 0 is not positive"):
        Section("cylinder")
    with pytest.raises(CaseError, match="the radius -1 is not positive"):
        Section("cylinder", radius=-1.0)
    with pytest.raises(CaseError, match="the normal 0, 0, 0 has no direction"):
        Section("plane", direction=(0, 0, 0))
    with pytest.raises(CaseError, match="the axis 0, 0, 0 has no direction"):
        Section("cylinder", direction=(0, 0, 0), radius=1)
    with pytest.raises(CaseError, match="not finite"):
        Section("plane", origin=(0, float("nan"), 0))


def test_an_unknown_shape_is_refused_and_lists_become_tuples():
    with pytest.raises(CaseError, match=r"kind: 'plan' is not one of plane .*did you mean plane"):
        Section("plan")
    with pytest.raises(ArgumentError, match=r"Plane: origin is 3; expected 3 numbers"):
        Section("plane", 3)
    made = Section("plane", [0.5, 0.0, 0.0], np.array([1.0, 0.0, 0.0]))
    assert made == Section("plane", (0.5, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert hash(made)


def test_a_section_keeps_its_shape():
    plane = Section("plane", (1.0, 2.0, 3.0))
    with pytest.raises(CaseError, match="cylinder section: a plane cannot become one"):
        replace(plane, kind="cylinder", radius=2.0)
