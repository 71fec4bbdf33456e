"""The mesh of all zones of a file: its parts, names, halos and what is written of it."""

import pickle

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.periodic import find_pairs, pair_up
from slideviz.mesh.zones import join_zones, marker_zones, with_zones, without_zone, zones_of
from tests.builders import cube, sector, square


def text_of(*meshes, order=None):
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in meshes]
    numbers = order or range(1, len(texts) + 1)
    zones = "".join(f"IZONE= {k}\n{text}" for k, text in zip(numbers, texts, strict=True))
    return f"% three\nNZONE= {len(texts)}\n{zones}"


@pytest.mark.parametrize("order", [(1, 2, 3), (2, 3, 1)])
def test_a_file_of_several_zones_is_one_mesh_and_is_written_back(tmp_path, order):
    path = tmp_path / "m.su2"
    path.write_text(text_of(square(4), sector(4), square(6), order=order))
    mesh = sv.read(path)
    assert (mesh.zone, mesh.zones, len(mesh.parts)) == (None, 3, 3)
    for number, zone in enumerate(zones_of(mesh), 1):
        alone = sv.read(path, number)
        assert np.array_equal(zone.points, alone.points)
        assert zone.cells.same_as(alone.cells)
        assert zone.marker_names == alone.marker_names
    assert b"".join(su2_blocks(mesh)) == path.read_bytes()
    moved = mesh.with_points(mesh.points / 3.0)
    sv.write(tmp_path / "out.su2", moved)
    assert (tmp_path / "out.su2").read_text().startswith("% three\n")
    sv.write(tmp_path / "out.su2b", moved)
    for name in ("out.su2", "out.su2b"):
        again = sv.read(tmp_path / name)
        assert np.array_equal(again.points, moved.points)
        assert again.marker_names == mesh.marker_names
        copied = pickle.loads(pickle.dumps(again))
        sv.write(tmp_path / f"again_{name}", copied.with_points(copied.points * 1.0))
        assert (tmp_path / f"again_{name}").read_bytes() == (tmp_path / name).read_bytes()


def test_names_have_the_number_of_their_zone_where_others_have_them_too():
    mesh = join_zones([sector(4), square(4)])
    assert mesh.marker_names[-1] == "2:BLOCK"
    assert mesh.marker_names[:5] == ("inner", "outer", "per1", "per2", "1:BLOCK")
    assert marker_zones(mesh) == [1] * 5 + [2] * 5
    assert marker_zones(square(4)) == [1] * 5
    nodes = mesh.marker("2:BLOCK").nodes
    assert np.array_equal(mesh.points[nodes], square(4).points[square(4).marker("BLOCK").nodes])
    names = ("12:a", "a", ":a", "b:a", "1:")
    assert [without_zone(name) for name in names] == ["a", "a", ":a", "b:a", "1:"]


def test_one_zone_is_itself_and_dimensions_must_be_one():
    mesh = square(4)
    assert join_zones([mesh]) is mesh
    assert zones_of(mesh) == (mesh,)
    with pytest.raises(MeshError, match="its zones are 2D, 3D, which cannot be one mesh; choose o"):
        join_zones([mesh, cube(4)])


def test_each_zone_has_a_period_of_its_own():
    mesh = join_zones([sector(4), sector(5, 20.0)])
    for pairs in (find_pairs(mesh), pair_up(mesh, ["2:per2", "1:per1", "1:per2", "2:per1"])):
        turned = [pair for pair in pairs if "per" in pair.first]
        assert [round(np.degrees(pair.period)) for pair in turned] == [30, 20]
        for pair in turned:
            assert set(pair.nodes[:, 0]) == set(mesh.marker(pair.first).nodes)


def test_points_of_zones_are_put_together():
    mesh = join_zones([square(4), square(6)])
    moved = [zone.with_points(zone.points + k) for k, zone in enumerate(zones_of(mesh), 1)]
    found = with_zones(mesh, moved)
    assert np.array_equal(found.points, np.concatenate([zone.points for zone in moved]))
    assert np.array_equal(zones_of(found)[1].points, moved[1].points)
