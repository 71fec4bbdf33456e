"""A CGNS file is written as a copy of the one that was read: only coordinates differ."""

import re
import resource
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slideviz import quality
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.formats.cgns.read import read_cgns
from slideviz.formats.files import read, write
from slideviz.formats.losses import left_out
from slideviz.formats.table import formats_for
from tests.builders import cube, grid
from tests.cgns_files import passage_grid, save_passage
from tests.formats.su2_samples import bits
from tests.formats.test_cgns_read import judged, points_of

CASE = """\
MESH_FILENAME= {mesh}
MESH_OUT_FILENAME= {out}
MARKER_MOVING= ( BLADE )
MARKER_FIXED= ( SHROUD, INFLOW, OUTFLOW, HUB )
MARKER_PERIODIC= ( lower, upper )
PERIODIC_MODE= fixed
MOTION= ( BLADE, translate, 0.0, 0.02, 0.05 )
STEPS= 2
"""


def turned(points):
    """Return points that all moved a little."""
    return points + 0.01 * np.sin(points[:, ::-1] * 3)


@pytest.fixture
def passage(tmp_path):
    return save_passage(tmp_path / "passage.cgns", passage_grid())


def coordinates(path):
    """Return the coordinate arrays of a file by name, and all bytes of it but theirs."""
    raw = bytearray(path.read_bytes())
    found = {}
    with h5py.File(path, "r") as file:

        def visit(name, thing):
            if isinstance(thing, h5py.Dataset) and "GridCoordinates" in name:
                found[name] = thing[()]
                begin = thing.id.get_offset()
                raw[begin : begin + thing.nbytes] = bytes(thing.nbytes)

        file.visititems(visit)
    return found, bytes(raw)


def test_only_coordinates_change(passage, tmp_path):
    mesh = read_cgns(passage)
    out = tmp_path / "out.cgns"
    moved = mesh.with_points(turned(mesh.points))
    write(out, moved)
    before, rest = coordinates(passage)
    after, kept = coordinates(out)
    assert kept == rest
    assert before.keys() == after.keys()
    assert len(after) == 6
    assert all((before[name] != after[name]).any() for name in after)
    again = read_cgns(out)
    assert bits(again.points) == bits(moved.points)
    assert again.cells.same_as(mesh.cells)
    assert again.marker_names == mesh.marker_names
    for data, number in zip(judged(out).values(), again.origin.numbers, strict=True):
        assert bits(points_of(data)) == bits(moved.points[number])


def test_a_mesh_at_rest_is_the_same_file(passage, tmp_path):
    write(tmp_path / "out.cgns", read_cgns(passage))
    assert (tmp_path / "out.cgns").read_bytes() == passage.read_bytes()


@pytest.mark.parametrize("apart", [0.0, 1e-7])
def test_nodes_at_rest_keep_their_bits_in_every_zone(tmp_path, apart):
    path = save_passage(tmp_path / "a.cgns", passage_grid())
    name = "Base/blk-2/GridCoordinates/CoordinateX/ data"
    with h5py.File(path, "a") as file:
        file[name][...] += apart
    mesh = read_cgns(path)
    points = mesh.points.copy()
    points[0] += 0.01
    write(tmp_path / "out.cgns", mesh.with_points(points))
    before, after = coordinates(path)[0], coordinates(tmp_path / "out.cgns")[0]
    changed = {one: int((before[one] != after[one]).sum()) for one in before}
    assert sum(changed.values()) == 3
    assert changed[name.removeprefix("/")] == 0


def test_single_precision_stays(tmp_path):
    path = save_passage(tmp_path / "a.cgns", passage_grid(), "f4")
    mesh = read_cgns(path)
    write(tmp_path / "out.cgns", mesh.with_points(turned(mesh.points)))
    found = coordinates(tmp_path / "out.cgns")[0]
    assert {array.dtype for array in found.values()} == {np.dtype("f4")}
    again = read_cgns(tmp_path / "out.cgns")
    assert bits(again.points) == bits(turned(mesh.points).astype("f4").astype("f8"))
    with pytest.raises(MeshError, match="a coordinate is larger than float32 holds, the type of "):
        write(tmp_path / "far.cgns", mesh.with_points(mesh.points * 1e40))
    assert not (tmp_path / "far.cgns").exists()


def test_chunked_and_compressed_coordinates(passage, tmp_path):
    name = "Base/blk-1/GridCoordinates/CoordinateX/ data"
    with h5py.File(passage, "a") as file:
        values = file[name][()]
        del file[name]
        file.create_dataset(name, data=values, chunks=(2, 2, 2), compression="gzip")
    mesh = read_cgns(passage)
    write(tmp_path / "out.cgns", mesh.with_points(turned(mesh.points)))
    assert bits(read_cgns(tmp_path / "out.cgns").points) == bits(turned(mesh.points))


def test_a_mesh_from_another_format_becomes_a_new_file(tmp_path):
    write(tmp_path / "out.cgns", cube(4))
    again = read_cgns(tmp_path / "out.cgns")
    assert bits(again.points) == bits(cube(4).points)
    assert again.marker_names == cube(4).marker_names


def test_cell_data_are_refused(passage, tmp_path):
    mesh = read_cgns(passage)
    with pytest.raises(
        MeshError, match=r"a .cgns file has no place for cell data \(quality\); write a .vtu"
    ):
        write(tmp_path / "out.cgns", mesh, cell_data={"quality": quality(mesh).values})


def test_a_source_that_was_changed_or_is_gone(passage, tmp_path):
    mesh = read_cgns(passage)
    with h5py.File(passage, "a") as file:
        file["Base/blk-1/GridCoordinates/CoordinateX/ data"][0, 0, 0] = 9.0
    told = r"passage.cgns, of which it is a copy, was changed after the mesh was read \(/Base/blk-1"
    with pytest.raises(MeshError, match=told):
        write(tmp_path / "out.cgns", mesh)
    with h5py.File(passage, "a") as file:
        del file["Base/blk-1/GridCoordinates"]
    with pytest.raises(MeshError, match="was changed after the mesh was read"):
        write(tmp_path / "out.cgns", mesh)
    passage.unlink()
    told = r"passage.cgns, of which it is a copy, cannot be read: No such file .*; put that file ba"
    with pytest.raises(MeshError, match=told):
        write(tmp_path / "out.cgns", mesh)
    assert not (tmp_path / "out.cgns").exists()


def test_the_source_itself_is_written_over_only_when_asked(passage):
    mesh = read_cgns(passage)
    moved = mesh.with_points(turned(mesh.points))
    with pytest.raises(MeshError, match="this is the file that the mesh was read from"):
        write(passage, moved)
    write(passage, moved, overwrite=True)
    assert bits(read_cgns(passage).points) == bits(moved.points)


def test_a_disk_that_is_full(passage, tmp_path):
    mesh = read_cgns(passage)
    (tmp_path / "out.cgns").write_bytes(b"old")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
    try:
        with pytest.raises(MeshError, match="the file is larger than the file system or the lim"):
            write(tmp_path / "out.cgns", mesh)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (tmp_path / "out.cgns").read_bytes() == b"old"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["out.cgns", "passage.cgns"]


def test_a_case_deforms_it_as_it_does_the_same_mesh_in_su2(passage, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = read_cgns(passage)
    write(tmp_path / "same.su2", mesh)
    for stem, end in (("passage", "cgns"), ("same", "su2")):
        case = CASE.format(mesh=f"{stem}.{end}", out=f"{stem}_def.{end}")
        (tmp_path / f"{stem}.cfg").write_text(case)
        assert run(["run", f"{stem}.cfg", "-q", "--steps-dir", "steps"]) == 0
    ours, theirs = read(tmp_path / "passage_def.cgns"), read(tmp_path / "same_def.su2")
    assert bits(ours.points) == bits(theirs.points)
    assert ours.cells.same_as(theirs.cells)
    assert ours.marker_names == theirs.marker_names
    for one, other in zip(ours.markers, theirs.markers, strict=True):
        assert one.cells.same_as(other.cells)
    assert sorted(one.name for one in (tmp_path / "steps").iterdir()) == [
        *("passage_1.cgns", "passage_2.cgns", "same_1.su2", "same_2.su2")
    ]
    assert bits(read_cgns(tmp_path / "steps" / "passage_2.cgns").points) == bits(ours.points)
    moved = np.abs(ours.points - mesh.points).max(axis=0)
    assert np.allclose(moved, [0, 0.02, 0.05], atol=1e-12)
    capsys.readouterr()
    assert run(["quality", "passage_def.cgns", "--reference", "passage.cgns"]) == 0
    text = capsys.readouterr().out
    assert run(["quality", "same_def.su2", "--reference", "same.su2"]) == 0
    plain = re.sub("same(_def)?.su2", r"passage\1.cgns", capsys.readouterr().out)
    assert plain.splitlines()[1:] == text.splitlines()[1:]


def test_the_window_offers_it_and_says_what_other_files_lose(passage, tmp_path):
    mesh = read_cgns(passage)
    assert ".cgns" in formats_for(mesh)
    assert left_out(tmp_path / "a.cgns", mesh) == ""
    assert left_out(tmp_path / "a.su2", mesh) == (
        "a.su2 does not hold other contents of the CGNS file (2 zones, FlowSolution_t)."
    )
    assert ".cgns" in formats_for(cube(4))


def sector(turn):
    """A block between two planes of constant y, or of constant angle about x; and these sides."""
    mesh = grid((3, 4, 2), kind="mixed")
    if turn:
        x, y, z = mesh.points.T
        r = 1.0 + z
        mesh = mesh.with_points(np.stack([x, r * np.sin(y / 2), r * np.cos(y / 2)], axis=1))
    roles = {"y_m": "periodic", "y_p": "periodic"}
    return replace(mesh, origin=replace(mesh.origin, roles=roles))


@pytest.mark.parametrize("turn", [False, True])
def test_periodic_interfaces_are_written_and_read_back(tmp_path, turn):
    mesh = sector(turn)
    write(tmp_path / "new.cgns", mesh)
    back = read(tmp_path / "new.cgns")
    assert back.roles == mesh.roles
    assert back.marker_names == mesh.marker_names
    assert np.array_equal(back.points, mesh.points)
    assert not back.remarks
    with h5py.File(tmp_path / "new.cgns") as file:
        sides = file["Base/Zone/ZoneGridConnectivity"]
        assert sorted(sides) == ["y_m", "y_p"]
        for name, other in (("y_m", "y_p"), ("y_p", "y_m")):
            here, there = (
                sides[name][label][" data"][()].ravel() - 1
                for label in ("PointList", "PointListDonor")
            )
            assert {*here.tolist()} == {*mesh.marker(name).nodes.tolist()}
            assert {*there.tolist()} == {*mesh.marker(other).nodes.tolist()}
            period = sides[name]["GridConnectivityProperty/Periodic"]
            centre, angle, shift = (
                period[label][" data"][()].astype(float)
                for label in ("RotationCenter", "RotationAngle", "Translation")
            )
            moved = Rotation.from_rotvec(angle).apply(mesh.points[here] - centre) + centre + shift
            assert np.abs(moved - mesh.points[there]).max() < 1e-6


def test_without_roles_of_the_file_there_are_no_interfaces(tmp_path):
    write(tmp_path / "new.cgns", grid((2, 2, 2)))
    back = read(tmp_path / "new.cgns")
    assert back.roles == {}
    with h5py.File(tmp_path / "new.cgns") as file:
        assert "ZoneGridConnectivity" not in file["Base/Zone"]


def test_a_side_without_its_other_one_is_not_periodic(tmp_path):
    write(tmp_path / "new.cgns", sector(False))
    with h5py.File(tmp_path / "new.cgns", "r+") as file:
        del file["Base/Zone/ZoneGridConnectivity/y_p"]
    assert read(tmp_path / "new.cgns").roles == {}


def test_a_warning_names_what_the_cgns_file_has_besides(tmp_path):
    path = tmp_path / "new.cgns"
    write(path, sector(True))
    assert left_out(tmp_path / "a.su2", read(path)) == ""
    with h5py.File(path, "r+") as file:
        solution = file["Base/Zone"].create_group("Solution")
        solution.attrs["label"] = np.bytes_("FlowSolution_t")
    assert left_out(tmp_path / "a.su2", read(path)) == (
        "a.su2 does not hold other contents of the CGNS file (FlowSolution_t)."
    )
