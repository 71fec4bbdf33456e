"""Wheels: copies of a passage turned about the axis and merged at the periodic sides."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.formats.table import write_content
from slideviz.machine.wheel import Wheel
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.periodic import pair_up
from tests.builders import passage, sector, shuffled, wedge

MESHES = {
    "2D": sector(6, 45.0),
    "from -40 degrees": sector(6, 30.0, start_deg=-40.0),
    "with its axis": wedge(4, 60.0),
    "hexahedra": passage((2, 4, 4), 40.0),
    "prisms": passage((2, 4, 4), 40.0, "prisms"),
    "mixed": passage((2, 4, 4), 40.0, "mixed"),
    "numbered otherwise": shuffled(passage((2, 4, 4), 40.0, "mixed"), 3)[1],
}
COUNT = {"2D": 8, "from -40 degrees": 12, "with its axis": 6}


def pairs_of(mesh, swapped=False):
    return pair_up(mesh, ("per2", "per1") if swapped else ("per1", "per2"), "rotational")


def in_memory(wheel: Wheel) -> sv.Mesh:
    content = wheel.content()
    types, nodes, numbers = content.cells(0, content.n_cells)
    assert np.array_equal(numbers, np.arange(content.n_cells))
    assert np.array_equal(types, content.types(0, content.n_cells))
    points = content.points(0, content.n_points)
    return sv.Mesh(points, sv.Cells.from_types(types, nodes), content.markers)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("name", MESHES)
def test_a_whole_turn_has_each_node_once_and_all_its_boundaries(name, swapped):
    mesh = MESHES[name]
    count = COUNT.get(name, 9)
    wheel = Wheel([mesh] * count, pairs_of(mesh, swapped))
    assert wheel.is_closed
    whole = in_memory(wheel)
    assert len(whole.cells) == count * len(mesh.cells)
    assert not cKDTree(whole.points).query_pairs(1e-9)
    assert np.array_equal(np.unique(whole.cells.connectivity), np.arange(len(whole.points)))
    assert set(whole.marker_names) == set(mesh.marker_names) - {"per1", "per2"}
    # Every facet that one cell has alone is on a boundary: passages are closed to each other.
    facets = boundary_of(whole)
    assert (facets.marker >= 0).all()
    assert len(facets.facets) == sum(len(marker.cells) for marker in whole.markers)
    before, after = sv.quality(mesh), sv.quality(whole)
    assert after.inverted == 0
    assert after.mean == pytest.approx(before.mean, rel=1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_a_part_keeps_its_two_outer_sides(name):
    mesh = MESHES[name]
    part = in_memory(Wheel([mesh] * 3, pairs_of(mesh)))
    assert set(part.marker_names) == set(mesh.marker_names)
    assert not cKDTree(part.points).query_pairs(1e-9)
    (pair,) = pairs_of(part)
    assert pair.period == pytest.approx(3 * pairs_of(mesh)[0].period, rel=1e-12)
    assert (boundary_of(part).marker >= 0).all()


def test_each_passage_has_boundaries_of_its_own_if_they_are_numbered():
    mesh = MESHES["hexahedra"]
    part = in_memory(Wheel([mesh] * 2, pairs_of(mesh), numbered=True))
    blades = [name for name in part.marker_names if name.startswith("blade")]
    assert blades == ["blade_1", "blade_2"]
    angles = [
        np.degrees(np.arctan2(*part.points[part.marker(name).nodes].mean(0)[1::-1]))
        for name in blades
    ]
    assert angles[1] - angles[0] == pytest.approx(40.0, abs=1e-9)
    assert {"per1", "per2"} <= set(part.marker_names)
    side = [replace(one, name="blade_1") if one.name == "per1" else one for one in mesh.markers]
    named = replace(mesh, markers=tuple(side))
    pairs = pair_up(named, ("blade_1", "per2"), "rotational")
    with pytest.raises(MeshError, match="would be named 'blade_1'; rename one"):
        Wheel([named] * 2, pairs, numbered=True).markers()


def test_copies_are_turned_at_once_and_the_first_keeps_its_bits():
    mesh = MESHES["hexahedra"]
    wheel = Wheel([mesh] * 9, pairs_of(mesh))
    nodes = np.arange(len(mesh.points))
    assert np.array_equal(wheel.turned(0, nodes), mesh.points)
    angle = np.radians(7 * 40.0)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert np.abs(wheel.turned(7, nodes) - mesh.points @ turn.T).max() < 1e-15


@pytest.mark.parametrize("ending", [".su2", ".su2b"])
@pytest.mark.parametrize("name", ["2D", "mixed"])
def test_files_have_the_wheel(tmp_path, ending, name):
    mesh = MESHES[name]
    wheel = Wheel([mesh] * COUNT.get(name, 9), pairs_of(mesh))
    whole, path = in_memory(wheel), tmp_path / f"wheel{ending}"
    write_content(path, [wheel.content()])
    back = sv.read(path)
    assert np.array_equal(back.points, whole.points)
    assert back.cells.same_as(whole.cells)
    for marker in whole.markers:
        assert back.marker(marker.name).cells.same_as(marker.cells)


def test_parts_are_those_of_the_whole():
    mesh = MESHES["mixed"]
    content = Wheel([mesh] * 9, pairs_of(mesh)).content()
    points = [
        content.points(i, min(i + 37, content.n_points)) for i in range(0, content.n_points, 37)
    ]
    assert np.array_equal(np.concatenate(points), content.points(0, content.n_points))
    flat = [
        content.cells(i, min(i + 11, content.n_cells))[1] for i in range(0, content.n_cells, 11)
    ]
    assert np.array_equal(np.concatenate(flat), content.cells(0, content.n_cells)[1])


def test_wrong_wheels_are_refused(tmp_path):
    mesh = MESHES["hexahedra"]
    pairs = pairs_of(mesh)
    bent = mesh.with_points(mesh.points * [1.0, 1.0, 1.01])
    with pytest.raises(MeshError, match=r"passages 1 and 2 do not meet: .* need sides that stay"):
        Wheel([mesh, bent, mesh], pairs).require_meeting()
    with pytest.raises(MeshError, match="passages 2 and 3 do not meet"):
        Wheel([mesh, mesh, bent], pairs).require_meeting()
    assert Wheel([mesh] * 9, pairs).require_meeting() < 1e-15
    with pytest.raises(MeshError, match=r"end its name in \.su2 or \.su2b, and convert"):
        write_content(tmp_path / "wheel.vtu", [Wheel([mesh] * 9, pairs).content()])
