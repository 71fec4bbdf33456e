"""The boxes of SU2 mesh files: read, moved, written back."""

import json
from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.ffd.box import CORNERS, plane_corners, regular_box
from slideviz.ffd.deformation import parametric
from slideviz.ffd.section import boxes_of, with_boxes
from tests.ffd.ffd_samples import DESIGN, REAL, square, unpacked

NAMES = ["naca0012_two_ffd_boxes.su2", "burner_hx.su2"]
WITH_BOXES = [
    "deformation_brick_tets_mesh_brick_tets_ffd.su2",
    "deformation_brick_prism_mesh_brick_prism_ffd.su2",
    "disc_adj_euler_naca0012_pitching_mesh_NACA0012_inv_FFD.su2",
    "coupled_cht_disc_adj_unsteadyCHT_cylinder_MeshCHT.su2",
]

SECTION = """\
FFD_NBOX= 1
FFD_NLEVEL= 1
FFD_TAG= MAIN
FFD_LEVEL= 0
FFD_DEGREE_I= 2
FFD_DEGREE_J= 1
FFD_BLENDING= BEZIER
FFD_PARENTS= 0
FFD_CHILDREN= 0
FFD_CORNER_POINTS= 4
-0.1 -0.1
1.1 -0.1
1.1 0.1
-0.1 0.1
FFD_CONTROL_POINTS= 0
FFD_SURFACE_POINTS= 0
"""


def written(tmp_path, section=SECTION):
    path = tmp_path / "square.su2"
    sv.write(path, square())
    path.write_text(path.read_text() + section)
    return path


def check_reproduced(mesh, boxes):
    for box in boxes:
        assert box.embedded
        for marker, (nodes, uvw) in box.embedded.items():
            assert set(nodes) <= set(mesh.marker(marker).nodes)
            size = np.ptp(box.points.reshape(-1, 3), axis=0)[: mesh.dim]
            off = np.abs(box.at(uvw)[:, : mesh.dim] - mesh.points[nodes]) / size
            assert off.max() < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_control_points_of_design_cases_reproduce_their_surface_points(name, tmp_path):
    mesh = sv.read(unpacked(name, tmp_path))
    boxes = boxes_of(mesh)
    assert [box.name for box in boxes] == (["UPPER", "LOWER"] if "naca" in name else ["BOX"])
    check_reproduced(mesh, boxes)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real meshes are not here")
@pytest.mark.parametrize("name", WITH_BOXES)
def test_control_points_of_real_meshes_reproduce_their_surface_points(name):
    mesh = sv.read(REAL / name)
    boxes = boxes_of(mesh)
    assert len(boxes) == 1
    check_reproduced(mesh, boxes)


@pytest.mark.parametrize("name", NAMES)
def test_mesh_whose_boxes_do_not_change_keeps_its_bytes(name, tmp_path):
    path = unpacked(name, tmp_path)
    mesh = sv.read(path)
    sv.write(tmp_path / "again.su2", with_boxes(mesh, boxes_of(mesh)))
    assert (tmp_path / "again.su2").read_bytes() == path.read_bytes()


@pytest.mark.skipif(not DESIGN.is_dir(), reason="the design cases are not here")
def test_moved_control_point_changes_its_rows_only(tmp_path):
    path = unpacked(NAMES[0], tmp_path)
    mesh = sv.read(path)
    upper, lower = boxes_of(mesh)
    moved = lower.moved(lower.change((2, 1, -1), (0.0, 0.25, 0.0)))
    sv.write(tmp_path / "moved.su2", with_boxes(mesh, [moved]))
    old = path.read_text().splitlines()
    new = (tmp_path / "moved.su2").read_text().splitlines()
    changed = [line for line, before in zip(new, old, strict=True) if line != before]
    assert [line.split()[:3] for line in changed] == [["2", "1", "0"], ["2", "1", "1"]]
    again = boxes_of(sv.read(tmp_path / "moved.su2"))
    assert np.array_equal(again[1].points, moved.points)
    assert np.array_equal(again[0].points, upper.points)


def test_counts_of_zero_mean_the_regular_lattice_and_are_filled(tmp_path):
    mesh = sv.read(written(tmp_path))
    (box,) = boxes_of(mesh)
    assert box.degrees == (2, 1, 1)
    assert box.points[1, 0, 0].tolist() == pytest.approx([0.5, -0.1, -0.5])
    assert not box.embedded
    nodes = mesh.marker("y_low").nodes
    uvw = np.column_stack([(mesh.points[nodes] + 0.1) / [1.2, 0.2], np.full(len(nodes), 0.5)])
    filled = type(box)(box.name, box.points, None, box.corners, {"y_low": (nodes, uvw)})
    sv.write(tmp_path / "out.su2", with_boxes(mesh, [filled]))
    again = sv.read(tmp_path / "out.su2")
    (read,) = boxes_of(again)
    assert np.array_equal(read.points, box.points)
    assert np.array_equal(read.embedded["y_low"][1], uvw)
    assert np.array_equal(again.points, mesh.points)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("orders", [None, (3, 2, 2)])
def test_new_boxes_are_written_and_read(dim, orders, tmp_path):
    mesh = square(3, dim)
    corners = plane_corners(CORNERS[:4, :2] * 2.0 - 0.5) if dim == 2 else CORNERS * 2.0 - 0.5
    boxes = [regular_box(name, corners, (4, 2, 1), orders) for name in ("A", "B")]
    for target in (mesh, sv.read(_kept(mesh, tmp_path))):
        sv.write(tmp_path / "out.su2", with_boxes(target, boxes))
        again = boxes_of(sv.read(tmp_path / "out.su2"))
        assert [box.name for box in again] == ["A", "B"]
        assert all(box.orders == orders for box in again)
        assert all(np.array_equal(a.points, b.points) for a, b in zip(again, boxes, strict=True))


def _kept(mesh, tmp_path):
    sv.write(tmp_path / "in.su2", mesh)
    # A last line without its end.
    (tmp_path / "in.su2").write_text((tmp_path / "in.su2").read_text().rstrip("\n"))
    return tmp_path / "in.su2"


def test_box_is_added_to_others_or_takes_their_place(tmp_path):
    mesh = sv.read(written(tmp_path))
    new = regular_box("NEW", plane_corners(CORNERS[:4, :2] * 1.0), (1, 1, 1), None)
    both, alone = with_boxes(mesh, [new]), with_boxes(mesh, [new], anew=True)
    assert [box.name for box in boxes_of(both)] == ["MAIN", "NEW"]
    assert [box.name for box in boxes_of(alone)] == ["NEW"]
    sv.write(tmp_path / "both.su2", both)
    assert "FFD_NBOX= 2\n" in (tmp_path / "both.su2").read_text()
    sv.write(tmp_path / "alone.su2", alone)
    assert "MAIN" not in (tmp_path / "alone.su2").read_text()


def test_boxes_of_other_cells_and_of_one_zone_stay_in_place(tmp_path):
    mesh = sv.read(written(tmp_path))
    new = regular_box("NEW", plane_corners(CORNERS[:4, :2] * 1.0), (1, 1, 1), None)
    fewer = sv.Mesh(mesh.points, mesh.cells, mesh.markers[:2], origin=mesh.origin)
    sv.write(tmp_path / "fewer.su2", with_boxes(fewer, [new], anew=True))
    text = (tmp_path / "fewer.su2").read_text()
    assert text.count("FFD_NBOX") == 1
    assert boxes_of(sv.read(tmp_path / "fewer.su2"))[0].name == "NEW"
    body = written(tmp_path).read_text()
    zones = tmp_path / "zones.su2"
    zones.write_text(f"NZONE= 2\nIZONE= 1\n{body}IZONE= 2\n{body}")
    first = sv.read(zones, zone=1)
    sv.write(tmp_path / "zones_out.su2", with_boxes(first, [new], anew=True))
    for zone, name in ((1, "NEW"), (2, "MAIN")):
        assert boxes_of(sv.read(tmp_path / "zones_out.su2", zone=zone))[0].name == name


def test_boxes_of_several_zones_change_where_they_are(tmp_path):
    body = written(tmp_path).read_text()
    text = f"NZONE= 2\nIZONE= 1\n{body}\nIZONE= 2\n{body.replace('MAIN', 'SECOND')}\n"
    (tmp_path / "zones.su2").write_text(text)
    mesh = sv.read(tmp_path / "zones.su2")
    main, second = boxes_of(mesh)
    change = np.zeros_like(second.points)
    change[1, 1, 0, 1] = 0.01
    sv.write(tmp_path / "out.su2", with_boxes(mesh, [second.moved(change)]))
    first, moved = (boxes_of(sv.read(tmp_path / "out.su2", zone=k))[0] for k in (1, 2))
    assert np.array_equal(first.points, main.points)
    assert np.array_equal(moved.points, second.points + change)
    (tmp_path / "zones.su2").write_text(f"NZONE= 2\nIZONE= 1\n{body}IZONE= 2\n{body}")
    mesh = sv.read(tmp_path / "zones.su2")
    with pytest.raises(
        MeshError, match=r"has 2 zones, but an FFD box 'MAIN', of which two have on"
    ):
        with_boxes(mesh, boxes_of(mesh)[:1])


def test_new_boxes_of_several_zones_are_read_where_su2_has_them(tmp_path):
    """SU2 has one section for all zones; it lists nodes by the names of boundaries alone."""
    bare = written(tmp_path).read_text().partition("FFD_NBOX")[0]
    others = bare.replace("MARKER_TAG= ", "MARKER_TAG= second_")
    path = tmp_path / "zones.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{bare}IZONE= 2\n{others}")
    mesh = sv.read(path)

    def box(name, *markers):
        new = regular_box(name, plane_corners(CORNERS[:4, :2] * 1.2 - 0.1), (1, 1, 1), None)
        on = {}
        for marker in markers:
            nodes = mesh.marker(marker).nodes
            on[marker] = nodes, parametric(new, mesh.points[nodes])[0]
        return replace(new, embedded=on)

    def again(boxes, **how):
        sv.write(tmp_path / "out.su2", with_boxes(mesh, boxes, **how))
        text = (tmp_path / "out.su2").read_text()
        assert text.count("FFD_NBOX") == 1
        found = boxes_of(sv.read(tmp_path / "out.su2"))
        for one, other in zip(found, boxes, strict=True):
            assert one.name == other.name
            assert one.embedded.keys() == other.embedded.keys()
            for marker, (nodes, uvw) in other.embedded.items():
                assert np.array_equal(one.embedded[marker][0], nodes)
                assert np.array_equal(one.embedded[marker][1], uvw)
        return text.index("FFD_NBOX") < text.index("IZONE= 2")

    first, second = box("A", "y_low"), box("B", "second_x_low", "second_y_low")
    assert again([first])
    assert not again([second])
    assert not again([first, second])
    both = box("C", "x_high", "second_x_high")
    assert not again([both])
    sv.write(path, with_boxes(mesh, [first]), overwrite=True)
    mesh = sv.read(path)
    assert again([second], anew=True) is False
    assert again([*boxes_of(mesh), both])
    path.write_text(path.read_text().replace("y_low\t0\t", "second_y_low\t99\t", 1))
    with pytest.raises(MeshError, match="'A' lists node 99 of second_y_low, which does not exist"):
        boxes_of(sv.read(path))


def test_boundaries_of_one_name_have_no_nodes_in_one_box(tmp_path):
    bare = written(tmp_path).read_text().partition("FFD_NBOX")[0]
    path = tmp_path / "zones.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{bare}IZONE= 2\n{bare}")
    mesh = sv.read(path)
    new = regular_box("NEW", plane_corners(CORNERS[:4, :2] * 1.2 - 0.1), (1, 1, 1), None)
    on = {name: (mesh.marker(name).nodes[:1], np.zeros((1, 3))) for name in ("1:y_low", "2:y_low")}
    with pytest.raises(MeshError, match="'NEW' has nodes on y_low, which several zones have, and"):
        with_boxes(mesh, [replace(new, embedded=on)])
    alone = {"1:y_low": on["1:y_low"]}
    sv.write(tmp_path / "out.su2", with_boxes(mesh, [replace(new, embedded=alone)]))
    assert boxes_of(sv.read(tmp_path / "out.su2"))[0].embedded.keys() == alone.keys()
    three = f"NZONE= 3\nIZONE= 1\n{bare}IZONE= 2\n{bare}IZONE= 3\n"
    listed = SECTION.replace("SURFACE_POINTS= 0", "SURFACE_POINTS= 1\ny_low 0 0 0 0")
    path.write_text(three + bare.replace("MARKER_TAG= ", "MARKER_TAG= third_") + listed)
    with pytest.raises(MeshError, match="'MAIN' has nodes on y_low, which several zones have"):
        boxes_of(sv.read(path))


def test_lines_of_windows_keep_their_ends(tmp_path):
    path = written(tmp_path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    mesh = sv.read(path)
    sv.write(tmp_path / "again.su2", with_boxes(mesh, boxes_of(mesh)[:0]))
    assert (tmp_path / "again.su2").read_bytes() == path.read_bytes()


def test_mesh_without_boxes_has_none():
    assert boxes_of(square()) == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FFD_LEVEL= 0", "FFD_LEVEL= 1", "FFD_LEVEL is 1; FFD_NLEVEL must be larger, and is 1"),
        ("FFD_DEGREE_J= 1", "FFD_DEGREE_J= x", "FFD_DEGREE_J= x is not a whole number from 0"),
        ("FFD_DEGREE_J= 1\n", "", "FFD_DEGREE_J= is missing"),
        ("FFD_DEGREE_J= 1", "FFD_DEGREE_J= 0", "the degree of j is 0; expected 1 to 50"),
        ("BEZIER", "NURBS", "FFD_BLENDING is NURBS; expected BEZIER or BSPLINE_UNIFORM"),
        ("POINTS= 4", "POINTS= 8", "FFD_CORNER_POINTS is 8; expected 4"),
        ("1.1 0.1\n", "", "3 rows follow FFD_CORNER_POINTS= 4; correct the count"),
        ("1.1 0.1\n", "1.1 wide\n", "the row '1.1 wide' of FFD_CORNER_POINTS needs 2 finite numb"),
        (
            "NBOX= 1",
            "NBOX= 3",
            r"FFD_NBOX= 3, but the file has 1 \(MAIN\); correct",
        ),
        ("NBOX= 1", "NBOX= one", "FFD_NBOX= one, but the file has 1"),
        ("FFD_NBOX= 1\n", "", "FFD_NBOX= is missing; write FFD_NBOX= 1 before the FFD boxes"),
        (SECTION[12:], "", "FFD_NBOX= 1, but the file has none"),
        ("CONTROL_POINTS= 0", "CONTROL_POINTS= 2", "FFD_CONTROL_POINTS is 2; expected 12"),
        ("SURFACE_POINTS= 0", "SURFACE_POINTS= 1\nlow 999 0 0 0", "names node 999, which does not"),
        ("SURFACE_POINTS= 0", "SURFACE_POINTS= 1\nlow 9223372036854775808 0 0 0", "which does not"),
        (
            "SURFACE_POINTS= 0",
            "SURFACE_POINTS= 1\nlow 0 0 1e308 0",
            r"puts node 0 at \(0, 1e308, 0\), and the box goes from 0 to 1; write",
        ),
    ],
)
def test_mistakes_are_told_with_box_and_remedy(old, new, message, tmp_path):
    assert old in SECTION
    mesh = sv.read(written(tmp_path, SECTION.replace(old, new)))
    with pytest.raises(MeshError, match=message):
        boxes_of(mesh)


@pytest.mark.parametrize(
    ("old", "new", "row"),
    [
        ("NBOX= 1", "NBOX= 3", 0),
        ("FFD_LEVEL= 0", "FFD_LEVEL= 1", 3),
        ("FFD_DEGREE_J= 1\n", "", 2),
        ("1.1 0.1\n", "1.1 wide\n", 12),
        ("SURFACE_POINTS= 0", "SURFACE_POINTS= 1\nlow 999 0 0 0", 16),
    ],
)
def test_mistakes_are_told_with_their_line_streamed_or_not(old, new, row, tmp_path, capsys):
    before = len(written(tmp_path, "").read_text().splitlines())
    path = written(tmp_path, SECTION.replace(old, new))
    for more in ([], ["--stream"]):
        assert run(["info", str(path), "--json", "-", *more]) == 0
        fault = json.loads(capsys.readouterr().out)["ffd_fault"]
        assert fault.startswith(f"square.su2:{before + row + 1}: ")
        assert run(["info", str(path), *more]) == 0
        assert f"FFD boxes: {fault}\n" in capsys.readouterr().out


def test_box_of_another_zone_is_told_with_its_zone(tmp_path, capsys):
    path = written(tmp_path)
    body, bare = path.read_text(), path.read_text().partition("FFD_NBOX")[0]
    path.write_text(f"NZONE= 2\nIZONE= 1\n{bare}IZONE= 2\n{body}")
    case = tmp_path / "a.cfg"
    case.write_text(
        "MESH_FILENAME= square.su2\nMARKER_MOVING= (y_low)\n"
        "MOTION= (y_low, ffd, MAIN, 1, 0, 0, 0, 0.01, 0)\n"
    )
    for more in (["--zone", "1"], ["--zone", "1", "--stream"]):
        assert run(["run", str(case), "-o", str(tmp_path / "out.su2"), *more]) == 1
        said = "square.su2: the FFD box 'MAIN' is in zone 2, and this is zone 1; choose that zone"
        assert said in capsys.readouterr().err
    call = ["run", str(case), "-q", "--zone", "2", "-o", str(tmp_path / "out.su2")]
    assert run(call) == 0


def test_double_control_points_and_boxes_are_told(tmp_path):
    rows = "".join(f"{i} {j} 0 0 0 0\n" for i in range(3) for j in (0, 1)) * 2
    twice = SECTION.replace("CONTROL_POINTS= 0", "CONTROL_POINTS= 12\n" + rows.rstrip())
    mesh = sv.read(written(tmp_path, twice))
    with pytest.raises(MeshError, match=r"must have each \(i, j, k\) from \(0, 0, 0\) to \(2, 1"):
        boxes_of(mesh)
    mesh = sv.read(written(tmp_path, SECTION + SECTION))
    with pytest.raises(MeshError, match="the FFD box 'MAIN' is defined twice; rename one"):
        boxes_of(mesh)


def test_binary_mesh_loses_its_boxes_and_says_so():
    from slideviz.formats.losses import lost_in
    from slideviz.formats.table import FORMATS

    box = regular_box("B", plane_corners(CORNERS[:4, :2] * 1.0), (1, 1, 1), None)
    assert lost_in(FORMATS[".su2b"], with_boxes(square(), [box])) == ["the FFD boxes"]
