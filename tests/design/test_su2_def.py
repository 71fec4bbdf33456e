"""``slideviz def``: SU2's configurations, design variables and files."""

import json
import lzma
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.su2.config import read_config
from slideviz.design.su2.surface import make_surface
from slideviz.errors import CaseError
from slideviz.ffd.section import boxes_of
from tests.solver.test_interface_motion import stage

DESIGN = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "design"
FILES = """
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
DV_MARKER= ( low )
"""
CORNERS = "(BOX, -0.1, -0.1, 0, 1.1, -0.1, 0, 1.1, 0.2, 0, -0.1, 0.2, 0" + ", 0" * 12 + ")"
BOXED = f"FFD_DEFINITION= {CORNERS}\nFFD_DEGREE= (3, 1, 0)\n"


def square(n=6):
    """A square of n cells a side with the boundaries low, high, left and right."""
    axis = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    number = np.arange(len(points)).reshape(n + 1, n + 1)
    quads = [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]]
    sides = {"low": number[0], "high": number[-1], "left": number[:, 0], "right": number[:, -1]}
    return sv.Mesh(
        points,
        sv.Cells.from_blocks([(9, np.stack(quads, axis=-1).reshape(-1, 4))]),
        tuple(
            sv.Marker(name, sv.Cells.from_blocks([(3, np.stack([side[:-1], side[1:]], axis=1))]))
            for name, side in sides.items()
        ),
    )


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working folder, with a mesh."""
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", square())
    return tmp_path


def config(text):
    Path("a.cfg").write_text(FILES + text)
    return read_config(Path("a.cfg"))


def surface(text):
    read = config(text)
    return make_surface(read, sv.read("mesh.su2"))


def unpacked(name):
    """A file of the design cases in the working folder; skips where they are not here."""
    path = DESIGN / name
    packed = path.with_name(f"{name}.xz")
    if not path.is_file() and not packed.is_file():
        pytest.skip("the design cases are not here")
    data = path.read_bytes() if path.is_file() else lzma.decompress(packed.read_bytes())
    Path(name).write_bytes(data)


def bernstein(u):
    return np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])


def test_kinds_do_what_su2_says_and_add_up(here):
    one = {
        "TRANSLATION": ("(0, 1, 0)", 0.1, lambda x: np.full_like(x, 0.1) * [0, 1]),
        "SCALE": ("(1.0)", 1.2, lambda x: 0.2 * x),
        "ROTATION": (
            "(0.5, 1, 0, 0.5, 1, 1)",
            30.0,
            lambda x: (
                (x - [0.5, 1]) @ np.array([[3**0.5 / 2, 0.5], [-0.5, 3**0.5 / 2]]) - (x - [0.5, 1])
            ),
        ),
    }
    total = 0.0
    for kind, (params, value, formula) in one.items():
        found = surface(f"DV_KIND= {kind}\nDV_PARAM= {params}\nDV_VALUE= {value}\n")
        expected = formula(found.mesh.points[found.nodes])
        np.testing.assert_allclose(found.displacement, expected, atol=1e-15)
        total = total + expected
    kinds, params, values = (", ".join(one), ";".join(p for p, _, _ in one.values()), "")
    values = ", ".join(str(v) for _, v, _ in one.values())
    found = surface(f"DV_KIND= {kinds}\nDV_PARAM= {params}\nDV_VALUE= {values}\n")
    np.testing.assert_allclose(found.displacement, total, atol=1e-15)
    half = surface("DV_KIND= TRANSLATION\nDV_PARAM= (2, 0, 0)\nDV_VALUE= 1\nOPT_RELAX_FACTOR= 0.5")
    np.testing.assert_allclose(half.displacement, [[1.0, 0.0]] * 7, atol=1e-15)


@pytest.mark.parametrize(
    ("kinds", "params", "values", "alone", "said"),
    [
        (
            "TRANSLATION, FFD_CONTROL_POINT_2D",
            "(0, 1, 0); (BOX, 1, 0, 0, 1)",
            "0.1, 0.2",
            "TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.1",
            (
                "variable 2 (FFD_CONTROL_POINT_2D) of DV_KIND will have no effect, as in SU2: "
                "TRANSLATION is first, and decides what can move; make two runs"
            ),
        ),
        (
            "TRANSLATION, SCALE",
            "(0, 1, 0)",
            "0.1, 0.2",
            "TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.1",
            (
                "DV_PARAM has 1 group for 2 variables: as in SU2, the last ones of DV_KIND have no "
                "effect"
            ),
        ),
        (
            "TRANSLATION",
            "(0, 1, 0, 7, 0)",
            "0.1",
            "TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.1",
            "DV_PARAM: 7, 0 after the last variable is ignored",
        ),
        (
            "NO_DEFORMATION, SCALE",
            "(1.0); (1.0)",
            "0.0, 2.0",
            "SCALE\nDV_VALUE= 1.0",
            (
                "variable 2 (SCALE) of DV_KIND will have no effect, as in SU2: NO_DEFORMATION is "
                "first"
            ),
        ),
    ],
)
def test_what_su2_passes_over_does_nothing_and_is_told(kinds, params, values, alone, said, here):
    text = f"{BOXED}DV_KIND= {kinds}\nDV_PARAM= {params}\nDV_VALUE= {values}\n"
    found = surface(text)
    expected = surface(f"DV_KIND= {alone}\n").displacement
    np.testing.assert_array_equal(found.displacement, expected)
    told = [str(one) for one in found.case().warnings]
    assert any(one.startswith(said) for one in told), told


def test_parameters_and_values_are_read_as_su2_reads_them(here):
    text = "DV_KIND= TRANSLATION, TRANSLATION\nDV_PARAM= (1, 0, 0) ; ; (0, 1, 0) ;\nDV_VALUE="
    found = surface(f"{text} 0.1, 0.2, 7\n")
    np.testing.assert_allclose(found.displacement, [[0.1, 0.2]] * 7, atol=1e-16)
    said = "DV_VALUE has 3 values for 2 variables: as in SU2, the last ones mean nothing"
    assert said in found.case().warnings
    for more in ("0.1, 0.2, 7, 8", "1, -1, 2, -2", "0, 0, 0, 0"):  # no decimals with a comma
        assert surface(f"{text} {more}\n").case().warnings
    boxed = (
        f"{BOXED}DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D\nOPT_RELAX_FACTOR= 3\n"
        "DV_PARAM= (BOX, -1, -1, 0, 0); (BOX, 1, 0, 0, 0)\nDV_VALUE= 0.2, 0.1, 0.0, 0.0\n"
    )
    np.testing.assert_allclose(surface(boxed).displacement, [[0.2, 0.1]] * 7, atol=1e-15)


@pytest.mark.parametrize("params", ["(2, 0.5)", "(0.4, 0.5)", "(-1, 0.5)"])
def test_a_side_that_is_neither_upper_nor_lower_is_warned_of(params, here):
    text = f"DV_KIND= HICKS_HENNE\nDV_VALUE= 1\nDV_PARAM= {params}"
    (said,) = config(text).case.warnings
    assert said.startswith("DV_PARAM: variable 1 (HICKS_HENNE): side ")
    assert said.endswith(" is neither 0 (lower) nor 1 (upper): as in SU2, the upper side")
    assert not config(text.replace(params, "(0, 0.5)")).case.warnings


def test_a_missing_mesh_that_is_not_named_is_told(here, capsys):
    Path("mesh.su2").unlink()
    for line, hint in (
        ("", "name the mesh"),
        ("MESH_FILENAM= a.su2\n", "a.cfg:2: MESH_FILENAM is"),
    ):
        Path("a.cfg").write_text(f"DV_KIND= SCALE\n{line}DV_VALUE= 1\nDV_MARKER= (low)\n")
        assert run(["def", "a.cfg", "-q"]) == 1
        said = "a.cfg: MESH_FILENAME is missing, and there is no mesh.su2, SU2's default; " + hint
        assert said in capsys.readouterr().err


@pytest.mark.parametrize("command", ["run", "film", "sweep"])
def test_other_commands_say_that_a_file_is_a_configuration_of_su2(command, here, capsys):
    Path("a.cfg").write_text("SOLVER= RANS\nDV_KIND= SCALE\nDV_VALUE= 1\nDV_MARKER= (low)\n")
    Path("t.csv").write_text("STEPS\n1\n")
    more = {"run": [], "film": ["-o", "a.gif"], "sweep": ["t.csv", "-o", "runs"]}[command]
    assert run([command, "a.cfg", *more]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert said.endswith("deform by it with `slideviz def a.cfg`")


@pytest.mark.parametrize("degree", ["", "FFD_DEGREE= (3, 1, 0)\n"])
def test_boxes_that_move_nothing_are_not_set(degree, here, capsys):
    Path("out.su2").write_text("good")
    boxes = BOXED.replace("FFD_DEGREE= (3, 1, 0)\n", degree)
    boxes = boxes if not degree else boxes.replace("-0.1, 0", "0.1, 0")
    Path("a.cfg").write_text(f"{FILES}{boxes}DV_KIND= FFD_SETTING\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    said = "no node of low is in the FFD box 'BOX'; correct the box or DV_MARKER"
    said = said if degree else "FFD_DEGREE is missing; give a degree (i, j, k) for each box"
    assert capsys.readouterr().err == f"slideviz: a.cfg: {said}\n"
    assert Path("out.su2").read_text() == "good"


def test_rotation_in_3d_turns_about_its_line(here):
    from tests.builders import cube

    sv.write("mesh.su2", cube(3))
    names = ", ".join(sv.read("mesh.su2").marker_names[:1])
    text = f"DV_KIND= ROTATION\nDV_PARAM= (1, 2, 3, 2, 1, 4)\nDV_VALUE= 40\nDV_MARKER= ({names})\n"
    Path("a.cfg").write_text("MESH_FILENAME= mesh.su2\n" + text)
    found = make_surface(read_config(Path("a.cfg")), sv.read("mesh.su2"))
    motion = sv.Rotate("", 40.0, (1.0, 2.0, 3.0), (1.0, -1.0, 1.0))
    from slideviz.case.moving_nodes import displacement_of

    expected = displacement_of([motion], found.mesh.points[found.nodes])
    np.testing.assert_allclose(found.displacement, expected, atol=1e-13)


def test_rotation_in_2d_is_about_a_line_along_z(here):
    text = "DV_KIND= ROTATION\nDV_VALUE= 30\nDV_PARAM="
    expected = surface(f"{text} (0.5, 1, 0, 0.5, 1, 1)\n").displacement
    for same in ("(0.5, 1, 0, 0.5, 1, 0)", "(0.5, 1, 2, 0.5, 1, 9)"):
        np.testing.assert_array_equal(surface(f"{text} {same}\n").displacement, expected)
    message = r"\(ROTATION\): the line from \(0.5, 1, 0\) to \(0.6, 1, 1\) leaves the normal"
    with pytest.raises(CaseError, match=message):
        _ = surface(f"{text} (0.5, 1, 0, 0.6, 1, 1)\n").displacement


def test_control_points_of_a_defined_box_move_the_surface(here):
    text = (
        f"{BOXED}DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT\n"
        "DV_PARAM= (BOX, 1, 0, 0.0, 2.0); (BOX, 2, 1, 0, 0, 1, 0)\nDV_VALUE= 0.05, 0.1\n"
    )
    found = surface(text)
    x = found.mesh.points[found.nodes, 0]
    u, v = bernstein((x + 0.1) / 1.2), 1 / 3
    expected = 0.1 * u[1] * (1 - v) + 0.05 * u[2] * v  # k = 0 alone counts half
    np.testing.assert_allclose(found.displacement[:, 1], expected, atol=1e-14)


def test_whole_command_moves_mesh_and_box_and_reports(here, capsys):
    config(
        f"{BOXED}DV_KIND= FFD_CONTROL_POINT_2D\nDV_PARAM= (BOX, 1, -1, 0.0, 1.0)\n"
        "DV_VALUE= 0.05\nMARKER_SYM= (left, right)\nMACH_NUMBER= 0.5\nSOLVER= RANS\n"
    )
    assert run(["def", "a.cfg", "--json", "a.json"]) == 0
    out = capsys.readouterr()
    assert "note: 2 other keys of SU2 in a.cfg not needed here" in out.err
    report = json.loads(Path("a.json").read_text())
    assert report["design"]["boxes"] == {"BOX": 7}
    assert report["design"]["ignored"] == ["MACH_NUMBER", "SOLVER"]
    assert report["sliding"] == "ps"
    assert report["node_counts"]["sliding_edge"] == 10
    old, new = sv.read("mesh.su2"), sv.read("out.su2")
    low = old.marker("low").nodes
    moved = (new.points - old.points)[low, 1]
    np.testing.assert_allclose(moved, 0.05 * bernstein((old.points[low, 0] + 0.1) / 1.2)[1])
    left = old.marker("left").nodes
    assert np.ptp(new.points[left, 0]) == 0.0
    (box,) = boxes_of(new)
    assert box.points[1, :, :, 1].ravel().tolist() == pytest.approx([-0.05, -0.05, 0.25, 0.25])
    nodes, uvw = box.embedded["low"]
    np.testing.assert_allclose(box.at(uvw)[:, :2], new.points[nodes], atol=1e-14)
    # From there on the box of the mesh counts, whatever the configuration defines.
    Path("b.cfg").write_text(Path("a.cfg").read_text().replace("mesh.su2", "out.su2", 1))
    Path("b.cfg").write_text(Path("b.cfg").read_text().replace("= out.su2\nDV", "= two.su2\nDV"))
    assert run(["def", "b.cfg", "-q"]) == 0
    np.testing.assert_allclose(sv.read("two.su2").points[low, 1], 2 * moved, atol=1e-14)


def test_design_of_zeros_keeps_every_byte(here):
    config("DV_KIND= TRANSLATION\nDV_PARAM= (1, 0, 0)\nDV_VALUE= 0.0\nSLIDING_MODE= none\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    assert Path("out.su2").read_bytes() == Path("mesh.su2").read_bytes()


def test_all_boundaries_moved_as_a_body_move_the_mesh_as_one(here):
    every = "DV_MARKER= (low, high, left, right)\n"
    text = (
        "DV_KIND= ROTATION, TRANSLATION\nDV_PARAM= (0, 0, 0, 0, 0, 1); (1, 0, 0)\nDV_VALUE= 90, 5\n"
    )
    Path("a.cfg").write_text(FILES.replace("DV_MARKER= ( low )\n", every) + text)
    assert run(["def", "a.cfg", "-q"]) == 0
    points = sv.read("mesh.su2").points
    expected = np.column_stack([5 - points[:, 1], points[:, 0]])
    np.testing.assert_allclose(sv.read("out.su2").points, expected, atol=1e-11)


def test_surface_file_gives_positions_in_any_order(here):
    Path("p.dat").write_text("3\t0.5\t0.1\n1, 0.2 0.05\n30 7 7\n")
    found = surface("DV_KIND= SURFACE_FILE\nDV_FILENAME= p.dat\n")
    new = found.mesh.points[found.nodes] + found.displacement
    assert new[3].tolist() == pytest.approx([0.5, 0.1])
    assert new[1].tolist() == pytest.approx([0.2, 0.05])
    assert not found.displacement[[0, 2, 4, 5, 6]].any()
    said = "p.dat: 1 of 3 nodes are not on DV_MARKER= (low); they are ignored"
    assert found.case().warnings == (said,)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, r"surface_positions\.dat: there is no such surface file; check name"),
        ("", r"the file is empty; expected a surface file"),
        ("% nothing\n", r"the file lists no node; expected lines node x y$"),
        ("3 0.5\n", r"dat:1: '3 0.5' has 2 columns; expected 3: node x y \(put"),
        ("3 1 2\n3 1 3\n", r"dat:2: node 3 has another position in line 1; keep one"),
        ("3 1 2 0.0\n4 1 2 1e-9\n", r"dat:2: z is '1e-9', and the mesh has 2 dim"),
        ("3 1 2\n4 1 2 1\n", r"dat:2: z is '1', and the mesh has 2 dim"),
        ("3 1 2 0 0\n", r"dat:1: '3 1 2 0 0' has 5 columns; expected 3"),
        ("99 1 2\n", r"node 99 is not in the mesh; its nodes are 0 to 48"),
        ("30 1 2\n48 1 1\n", r"none of its 2 nodes is on DV_MARKER= \(low\), so nothing"),
    ],
)
def test_mistakes_of_a_surface_file_speak_of_positions(text, message, here):
    if text is not None:
        Path("surface_positions.dat").write_text(text)
    with pytest.raises(CaseError, match=message) as found:
        _ = surface("DV_KIND= SURFACE_FILE\n").displacement
    assert "displacement" not in str(found.value)


@pytest.mark.parametrize("mixed", [False, True])
def test_surface_file_of_a_plane_mesh_may_have_a_third_coordinate_of_zero(mixed, here):
    Path("p.dat").write_text(f"3\t0.5\t0.1\t0.0\n1, 0.2, 0.05{'' if mixed else ', -0e5'}\n")
    found = surface("DV_KIND= SURFACE_FILE\nDV_FILENAME= p.dat\n")
    new = found.mesh.points[found.nodes] + found.displacement
    assert new[[1, 3]].tolist() == [[0.2, 0.05], [0.5, 0.1]]
    assert not found.case().warnings


def test_surface_file_of_another_boundary_is_refused_and_writes_nothing(here, capsys):
    mesh = sv.read("mesh.su2")
    high = mesh.marker("high").nodes
    rows = [f"{k} {x!r} {y!r}" for k, (x, y) in zip(high, mesh.points[high].tolist(), strict=True)]
    Path("p.dat").write_text("\n".join(rows))
    config("DV_KIND= SURFACE_FILE\nDV_FILENAME= p.dat\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    assert "p.dat: none of its 7 nodes is on DV_MARKER= (low)" in capsys.readouterr().err
    assert not Path("out.su2").exists()
    Path("p.dat").write_text("\n".join([*rows, "2 0.3 0.02"]))
    assert run(["def", "a.cfg", "-q", "--json", "a.json"]) == 0
    said = "p.dat: 7 of 8 nodes are not on DV_MARKER= (low); they are ignored"
    assert capsys.readouterr().err.count(said) == 1
    assert said in json.loads(Path("a.json").read_text())["warnings"]


def test_real_surface_file_is_met_to_the_digit(here):
    for name in ("naca0012_inv.su2", "surface_bump.dat"):
        unpacked(name)
    Path("a.cfg").write_text(
        "MESH_FILENAME= naca0012_inv.su2\nMESH_OUT_FILENAME= out\nMESH_OUT_FORMAT= SU2\n"
        "DV_KIND= SURFACE_FILE\nDV_MARKER= (airfoil)\nDV_PARAM= (1.0)\nDV_VALUE= 1.0\n"
        "DV_FILENAME= surface_bump.dat\n"
    )
    assert run(["def", "a.cfg", "-q"]) == 0
    table = np.loadtxt("surface_bump.dat")
    moved = sv.read("out.su2").points[table[:, 0].astype(int)]
    np.testing.assert_allclose(moved, table[:, 1:], rtol=0, atol=1e-15)


def test_control_points_of_two_real_boxes(here):
    unpacked("naca0012_two_ffd_boxes.su2")
    Path("a.cfg").write_text(
        "MESH_FILENAME= naca0012_two_ffd_boxes.su2\nMESH_OUT_FILENAME= out.su2\n"
        "DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D\n"
        "DV_MARKER= ( airfoil_upper, airfoil_lower )\n"
        "DV_PARAM= ( UPPER, 2, 1, 0.0, 1.0 ) ; ( LOWER, 1, 0, 0.0, -1.0)\nDV_VALUE= 0.01, 0.02\n"
    )
    assert run(["def", "a.cfg", "-q"]) == 0
    old, new = sv.read("naca0012_two_ffd_boxes.su2"), sv.read("out.su2")
    before, after = boxes_of(old), boxes_of(new)
    for k, at, by in ((0, (2, 1), 0.01), (1, (1, 0), -0.02)):
        assert np.argwhere(after[k].points != before[k].points).tolist() == [
            [*at, 0, 1],
            [*at, 1, 1],
        ]
        (nodes, uvw), *_ = after[k].embedded.values()
        np.testing.assert_allclose(after[k].at(uvw)[:, :2], new.points[nodes], atol=1e-12)
        assert np.abs(new.points[nodes] - old.points[nodes]).max() > 0.1 * abs(by)
    inside = np.concatenate([nodes for box in before for nodes, _ in box.embedded.values()])
    others = np.setdiff1d(old.marker("airfoil_upper").nodes, inside)
    np.testing.assert_array_equal(new.points[others], old.points[others])


@pytest.mark.parametrize(
    ("name", "markers"),
    [
        ("naca0012_two_ffd_boxes.su2", "airfoil_lower, airfoil_upper"),
        ("burner_hx.su2", "wall_hx"),
    ],
)
def test_ffd_setting_makes_the_boxes_that_su2_made(name, markers, here):
    unpacked(name)
    original = boxes_of(sv.read(name))
    whole = Path(name).read_text()
    Path("bare.su2").write_text(whole[: whole.index("FFD_NBOX")])
    boxes, degrees = [], []
    for box in original:
        corners = np.column_stack([box.corners[:4, :2], np.zeros(4)]).ravel().tolist()
        boxes.append(f"({box.name}, {', '.join(map(repr, corners + [0.0] * 12))})")
        degrees.append(f"({box.degrees[0]}, {box.degrees[1]}, 0)")
    Path("a.cfg").write_text(
        f"MESH_FILENAME= bare.su2\nMESH_OUT_FILENAME= out.su2\nDV_KIND= FFD_SETTING\n"
        f"DV_PARAM= (1.0)\nDV_VALUE= 0.0\nDV_MARKER= ({markers})\n"
        f"FFD_DEFINITION= {'; '.join(boxes)}\nFFD_DEGREE= {'; '.join(degrees)}\n"
    )
    assert run(["def", "a.cfg", "-q"]) == 0
    bare = Path("bare.su2").read_text()
    assert Path("out.su2").read_text().startswith(bare), "nothing else changes"
    made = boxes_of(sv.read("out.su2"))
    for ours, theirs in zip(made, original, strict=True):
        np.testing.assert_allclose(ours.points, theirs.points, rtol=1e-14, atol=1e-18)
        for marker, (nodes, uvw) in theirs.embedded.items():
            assert ours.embedded[marker][0].tolist() == nodes.tolist()
            # SU2 keeps coordinates off 0 and 1 by FFD_TOLERANCE, 1e-10 or so.
            np.testing.assert_allclose(ours.embedded[marker][1], uvw, atol=1e-8)


def test_continuity_holds_planes_where_it_is_asked_for(here):
    text = (
        "FFD_DEFINITION= (BOX, 0.2, -0.1, 0, 0.9, -0.1, 0, 0.9, 0.2, 0, 0.2, 0.2, 0"
        + ", 0" * 12
        + ")\nFFD_DEGREE= (6, 1, 0)\nDV_KIND= "
        + ", ".join(["FFD_CONTROL_POINT_2D"] * 7)
        + "\nDV_PARAM= "
        + "; ".join(f"(BOX, {i}, 0, 0, 1)" for i in range(7))
        + "\nDV_VALUE= 1, 1, 1, 1, 1, 1, 1\n"
    )
    expected = {
        "NO_DERIVATIVE": [0, 6],
        "1ST_DERIVATIVE": [0, 1, 5, 6],
        "2ND_DERIVATIVE": [0, 1, 2, 4, 5, 6],
        "USER_INPUT": [],
        "USER_INPUT\nFFD_FIX_I= (1, 3, 99)": [1, 3],
        "USER_INPUT\nFFD_FIX_J= (1)": [],
    }
    for value, held in expected.items():
        found = surface(f"{text}FFD_CONTINUITY= {value}\n")
        assert np.flatnonzero(found.idle).tolist() == held, value
        assert bool(found.warnings) == bool(held)
    silent = surface(text)
    assert not any(silent.idle)
    assert "SU2 would hold i = 0, 1, 2, 4, 5, 6 of the box BOX" in silent.warnings[0]
    assert "1, 2, 3, 5, 6, 7 of DV_KIND would do nothing; here they move" in silent.warnings[0]


def test_continuity_in_3d_finds_the_sides_that_the_surface_passes(here):
    from slideviz.design.su2.surface import _meets

    side = np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 1, 1]])
    through = np.array([[[-1.0, 0.9, 0.9], [1.0, 0.8, 0.8]], [[-1.0, 0.1, 0.1], [1.0, 0.2, 0.1]]])
    assert all(_meets(one[None], side, 3) for one in through)
    past = np.array([[[-1.0, 1.2, 0.9], [1.0, 1.2, 0.8]], [[0.1, 0.5, 0.5], [1.0, 0.5, 0.5]]])
    assert not _meets(past, side, 3)


def test_continuity_in_2d_continues_the_sides_beyond_the_box_as_su2_does():
    from slideviz.design.su2.surface import _meets

    side = np.array([[0.0, 0, -0.5], [0, 0, 0.5], [0, 1, -0.5], [0, 1, 0.5]])
    edges = np.array([[[-1.0, 5.0, 0.0], [1.0, 6.0, 0.0]], [[0.5, 0.0, 0.0], [0.5, 1.0, 0.0]]])
    assert _meets(edges[:1], side, 2)
    assert not _meets(edges[1:], side, 2)


def test_roles_follow_from_the_lists_of_su2_and_of_ours(here):
    rest = "DV_KIND= TRANSLATION\nDV_PARAM= (1, 0, 0)\nDV_VALUE= 0.1\n"
    case = config(f"{rest}MARKER_SYM= ( high )\nMARKER_FAR= (left)\n").case
    assert dict(case.roles) == {"high": "sliding", "low": "moving"}
    assert (case.sliding, case.periodic) == ("ps", "none")
    case = config(f"{rest}MARKER_PERIODIC= (left, right, 0, 0, 0, 0, 0, 0, 1, 0, 0)\n").case
    assert case.markers_with("periodic") == ("left", "right")
    assert (case.sliding, case.periodic) == ("ps", "moving")
    blade = "MARKER_DEFORM_TANGENTIAL= (high)\nMARKER_DEFORM_NORMAL= (left, right)\n"
    case = config(f"{rest}{blade}SLIDING_MODE= none\nSTEPS= 3\nMARKER_SYM= (NONE)\n").case
    assert case.markers_with("sliding") == ("high",)
    assert (case.sliding, case.periodic, case.steps) == ("none", "fixed", 3)
    case = config(f"{rest}MARKER_SYM= (high, low)\nMARKER_FIXED= (high)\n").case
    assert dict(case.roles) == {"high": "fixed", "low": "moving"}
    assert config(f"{rest}MARKER_MOVING= (high)\n").case.markers_with("moving") == ("low",)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "DV_KIND= HIKS_HENNE\nDV_VALUE= 1",
            r"5: DV_KIND: SU2 has no kind HIKS_HENNE; did you mean",
        ),
        ("DV_KIND= XYZ\nDV_VALUE= 1", "SU2 has no kind XYZ; supported: NO_DEFORMATION, "),
        ("DV_KIND= SCALE, AIRFOIL", "AIRFOIL is not supported, because SU2 asks for its file"),
        (
            "DV_KIND= FFD_TWIST_2D",
            "is not supported: it moved nothing in SU2 7, and SU2 8 lacks it",
        ),
        ("DV_KIND= (NONE)", "DV_KIND: names no design variable; supported: NO_DEFORMATION, "),
        ("DV_VALUE= 1", "DV_KIND is missing: which design variables there are"),
        (
            (
                f"{BOXED}DV_KIND= FFD_CONTROL_POINT_2D, SCALE\nDV_VALUE= 1, 1\n"
                "DV_PARAM= (BOX, 1, 0, 0, 1); (1.0)"
            ),
            "SCALE cannot be in a list that begins with FFD_CONTROL_POINT_2D: it has no FFD box",
        ),
        ("DV_KIND= SCALE", "DV_VALUE is missing: a value for each variable"),
        ("DV_KIND= SCALE, SCALE\nDV_VALUE= 1", "DV_VALUE has 1 value for 2 variables"),
        ("DV_KIND= SCALE\nDV_VALUE= x", "DV_VALUE: 'x' is not a number"),
        (
            "DV_KIND= SCALE, SCALE\nDV_VALUE= 0,01, -0,02",
            "a.cfg:6: DV_VALUE has 4 values for 2 variables; decimals are written with a point",
        ),
        ("DV_KIND= SCALE\nDV_VALUES= 1", "a value for .*; did you mean it by DV_VALUES in line 6"),
        (
            "DV_KIND= TRANSLATION, SCALE\nDV_VALUE= 1\nDV_PARAMS= (1, 0, 0) ; (1.0)",
            r"DV_PARAM is missing: TRANSLATION needs \(x, y, z\), SCALE .* by DV_PARAMS in line 7",
        ),
        (
            "DV_KIND= TRANSLATION\nDV_VALUE= 1\nDV_PARAM= (1, 0)",
            r"a.cfg:7: DV_PARAM: variable 1: 2 numbers are given; TRANSLATION needs \(x, y, z\)",
        ),
        (
            "DV_KIND= TRANSLATION\nDV_VALUE= 1\nDV_PARAM= (1, 0, 0); (0, 1, 0)",
            "DV_PARAM has 2 groups for 1 variable; give one each",
        ),
        (
            (
                "DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D\nDV_VALUE= 1, 1\n"
                "DV_PARAM= (BOX, 1, 0, 0, 0, 1); (BOX, 1, 0, 0, 1)"
            ),
            r"variable 1: 6 parameters are given; FFD_CONTROL_POINT_2D needs \(BOX, i, j, dx, dy\)",
        ),
        (
            "DV_KIND= FFD_CONTROL_POINT_2D\nDV_VALUE= 1\nDV_PARAM= (BOX, 1, 0, 0, 0)",
            "DV_VALUE has 1 value for 1 variable, which need 2; give one each",
        ),
        (
            "DV_KIND= FFD_CONTROL_POINT_2D\nDV_VALUE= 1\nDV_PARAM= (BOX, 1.5, 0, 0, 1)",
            "an index is not a whole number from -1",
        ),
        ("DV_KIND= SCALE\nDV_VALUE= 1\nSLIDING_MODE= sideways", "SLIDING_MODE: 'sideways' is not"),
        (
            "DV_KIND= SCALE\nDV_VALUE= 1\nFFD_COORD_SYSTEM= TORIC",
            "FFD_COORD_SYSTEM: 'TORIC' is",
        ),
        ("DV_KIND= SCALE\nDV_VALUE= 1\nFFD_CONTINUITY= 3RD", "FFD_CONTINUITY: '3RD' is not supp"),
        (
            "DV_KIND= SCALE\nDV_VALUE= 1\nMESH_FORMAT= BOX",
            r"MESH_FORMAT: 'BOX' is not one of SU2 \| ",
        ),
        ("DV_KIND= SCALE\nDV_VALUE= 1\nMOTION= (a, scale, 2)", "MOTION: belongs into a case file"),
        ("DV_KIND= SCALE\nDV_VALUE= 1\nOPT_RELAX_FACTOR= x", "OPT_RELAX_FACTOR: 'x' is not a numb"),
        ("DV_KIND= SCALE\nDV_VALUE= 1\nDV_VALUE= 2", "a.cfg:6: DV_VALUE is given again in line 7"),
        ("NDIME= 2\n0 1", "^a.cfg: is an SU2 mesh, not a case file; name it in MESH_FILENAME=$"),
        (
            "DV_KIND= SCALE\nDV_VALUE= 1\nFFD_FIX_I= (a)",
            r"FFD_FIX_I: '\(a\)' is not a list of whole",
        ),
    ],
)
def test_mistakes_are_told_with_their_line(text, message, here):
    with pytest.raises(CaseError, match=message):
        config(text + "\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("DV_PARAM= (BOXX, 0, 0, 0, 1)", "a.cfg: variable 1: mesh.su2 has no FFD box 'BOXX'; did "),
        ("DV_PARAM= (BOX, 9, 0, 0, 1)", "no control point with i = 9; i goes from 0 to 3"),
        (
            "DV_PARAM= (BOX, 1, 0, 0, 1)\nDV_MARKER= (high)",
            "no node of high is in the FFD box",
        ),
        (
            "DV_PARAM= (BOX, 1, 0, 0, 1)\nDV_MARKER= (hihg)",
            "DV_MARKER: mesh.su2 has no marker",
        ),
        ("DV_PARAM= (BOX, 1, 0, 0, 1)\nDV_MARKER= (NONE)", "DV_MARKER names no boundary; nothing"),
    ],
)
def test_what_the_mesh_does_not_have_is_told(text, message, here):
    text = f"{BOXED}DV_KIND= FFD_CONTROL_POINT_2D\nDV_VALUE= 1\n{text}\n"
    files = FILES if "DV_MARKER" not in text else FILES.replace("DV_MARKER= ( low )\n", "")
    Path("a.cfg").write_text(files + text)
    with pytest.raises(CaseError, match=message):
        make_surface(read_config(Path("a.cfg")), sv.read("mesh.su2"))


def test_all_that_the_mesh_does_not_have_is_told_at_once(here, capsys):
    Path("a.cfg").write_text(
        f"{FILES.replace('low', 'lwo')}MARKER_FIXED= (hihg)\n{BOXED}"
        "DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D\nDV_VALUE= 1, 1\n"
        "DV_PARAM= (BOXX, 0, 0, 0, 1) ; (BOX, 9, 0, 0, 1)\n"
    )
    assert run(["def", "a.cfg", "-q"]) == 1
    lines = capsys.readouterr().err.splitlines()
    said = ["no marker 'hihg'; did", "no marker 'lwo'; did", "no FFD box 'BOXX'", "with i = 9"]
    assert [any(text in line for line in lines) for text in said] == [True] * 4
    assert len(lines) == 4


def test_a_long_list_of_markers_is_cut(here):
    mesh = sv.read("mesh.su2")
    one = mesh.markers[0]
    many = replace(mesh, markers=tuple(replace(one, name=f"m{k}") for k in range(99)))
    with pytest.raises(CaseError, match=r"no marker 'low'; it has m0, .*, m11, \.\.\.$"):
        make_surface(config("DV_KIND= SCALE\nDV_VALUE= 1.1\n"), many)


@pytest.mark.parametrize(
    ("row", "roles", "modes"),
    [
        ("MARKER_SYM= (axis, left, top)", {"left": "sliding"}, ("ps", "none")),
        ("MARKER_SYM= (axis)", {}, ("none", "none")),
        ("MARKER_PERIODIC= (p, q, 0, 0, 0, 0, 0, 0, 1, 0, 0)", {}, ("none", "none")),
        (
            "MARKER_PERIODIC= (p, q, 0, 0, 0, 0, 0, 0, 1, 0, 0)\nMARKER_SYM= (left)",
            {"left": "sliding"},
            ("ps", "none"),
        ),
        ("MARKER_DEFORM_MESH_SYM_PLANE= (axis)", {}, ("none", "none")),
    ],
)
def test_boundaries_of_su2s_keys_that_the_mesh_lacks_are_passed_over(row, roles, modes, here):
    from slideviz.design.su2.config import on_mesh

    found = on_mesh(config(f"DV_KIND= SCALE\nDV_VALUE= 1.1\n{row}\n"), sv.read("mesh.su2"))
    assert dict(found.case.roles) == {"low": "moving", **roles}
    assert (found.case.sliding, found.case.periodic) == modes
    key = row.partition("=")[0]
    (warning,) = found.case.warnings
    assert warning.startswith(f"a.cfg: {key}: mesh.su2 has no marker '")
    assert warning.count("': ignored, as in SU2") == 1


def test_command_passes_over_a_boundary_and_is_that_without_it(here, capsys):
    text = "DV_KIND= TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.05\n"
    config(text + "MARKER_SYM= (left, right)\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    expected = Path("out.su2").read_bytes()
    capsys.readouterr()
    config(text + "MARKER_SYM= (left, axis, right)\n")
    assert run(["def", "a.cfg", "-q", "--json", "a.json"]) == 0
    assert Path("out.su2").read_bytes() == expected
    said = "a.cfg: MARKER_SYM: mesh.su2 has no marker 'axis': ignored, as in SU2"
    assert capsys.readouterr().err.count(said) == 1
    assert said in json.loads(Path("a.json").read_text())["warnings"]
    config("DV_KIND= FFD_SETTING\nMARKER_SYM= (axis)\n" + BOXED)
    assert run(["def", "a.cfg", "-q"]) == 0
    assert said in capsys.readouterr().err


def test_internal_boundaries_of_su2_are_passed_over_where_the_mesh_lacks_them(here):
    from slideviz.design.su2.config import on_mesh

    text = "DV_KIND= SCALE\nDV_VALUE= 1.1\nMARKER_INTERNAL= (left, core)\n"
    found = on_mesh(config(text), sv.read("mesh.su2"))
    assert dict(found.case.roles) == {"low": "moving", "left": "internal"}
    (warning,) = found.case.warnings
    assert warning.startswith("a.cfg: MARKER_INTERNAL: mesh.su2 has no marker 'core': ignored,")
    text = "DV_KIND= SCALE\nDV_VALUE= 1.1\nMARKER_DEFORM_MESH_INTERNAL= (left)\n"
    assert config(text).case.roles["left"] == "internal"


def test_set_replaces_lists_of_boundaries(here, capsys):
    text = "DV_KIND= TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.05\n"
    config(f"{text}MARKER_SLIDING= (lfet, right)\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    assert "no marker 'lfet'" in capsys.readouterr().err
    call = ["def", "a.cfg", "-q", "--json", "a.json", "--set"]
    assert run([*call, "MARKER_SLIDING=(left, right)"]) == 0
    expected = Path("out.su2").read_bytes()
    config(f"{text}MARKER_SYM= (left, right)\n")
    # A second list adds to SU2's, as it would in the file.
    assert run([*call, "MARKER_SLIDING=(left)"]) == 0
    assert Path("out.su2").read_bytes() == expected
    assert json.loads(Path("a.json").read_text())["node_counts"]["sliding_edge"] == 10
    for given, said in (
        ("MARKER_MOVING=(high)", "--set MARKER_MOVING=(high): DV_MARKER says what moves here; se"),
        ("MOTION=(low, scale, 2)", "a.cfg: MOTION: belongs into a case file (slideviz run); here"),
    ):
        assert run([*call, given]) == 1
        assert said in capsys.readouterr().err


def test_zeros_after_the_last_box_are_passed_over_as_in_su2(here):
    more = BOXED.replace(")\nFFD_DEGREE", ", 0.0, 0)\nFFD_DEGREE")
    kind = "DV_KIND= FFD_CONTROL_POINT_2D\nDV_PARAM= (BOX, 1, 0, 0, 1)\nDV_VALUE= 0.1\n"
    np.testing.assert_array_equal(
        surface(more + kind).displacement, surface(BOXED + kind).displacement
    )
    with pytest.raises(CaseError, match="FFD_DEFINITION: box 'BOX' has 25 numbers; expected"):
        config(BOXED.replace(")\nFFD_DEGREE", ", 3)\nFFD_DEGREE") + kind)


def test_a_box_in_2d_has_the_numbers_of_its_four_corners_or_of_eight(here):
    kind = "DV_KIND= FFD_CONTROL_POINT_2D\nDV_PARAM= (BOX, 1, 0, 0, 1)\nDV_VALUE= 0.1\n"
    short = BOXED.replace(", 0" * 12, "")
    assert config(short + kind).case.ffd_boxes == config(BOXED + kind).case.ffd_boxes
    for count in (0, 11, 13, 23):
        numbers = ", ".join(["1"] * count)
        wrong = f"FFD_DEFINITION= (BOX, {numbers})\nFFD_DEGREE= (3, 1, 0)\n"
        with pytest.raises(CaseError, match=f"box 'BOX' has {count} numbers; expected its name"):
            config(wrong + kind)


def test_without_dv_marker_some_of_the_deformed_boundaries_may_be_missing(here, capsys):
    rest = "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nDV_KIND= SCALE\nDV_VALUE= 1.1\n"
    Path("a.cfg").write_text(f"{rest}MARKER_DEFORM_MESH= (low, flap)\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    assert "MARKER_DEFORM_MESH: mesh.su2 has no marker 'flap': ignored" in capsys.readouterr().err
    Path("a.cfg").write_text(f"{rest}MARKER_DEFORM_MESH= (slat, flap)\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    assert "MARKER_DEFORM_MESH: mesh.su2 has no marker 'slat'; it has" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("MARKER_SLIDING= (axis)", "MARKER_SLIDING: mesh.su2 has no marker 'axis'"),
        ("MARKER_FIXED= (axis)", "MARKER_FIXED: mesh.su2 has no marker 'axis'"),
        ("MARKER_SYM= (lo)\nDV_MARKER= (low, lo)", "DV_MARKER: mesh.su2 has no marker 'lo'"),
        (
            "MARKER_PERIODIC= (left, q, 0, 0, 0, 0, 0, 0, 1, 0, 0)",
            "MARKER_PERIODIC: mesh.su2 has no marker 'q'",
        ),
    ],
)
def test_other_boundaries_that_the_mesh_lacks_are_errors(row, message, here, capsys):
    files = FILES.replace("DV_MARKER= ( low )\n", "") if "DV_MARKER" in row else FILES
    Path("a.cfg").write_text(f"{files}DV_KIND= SCALE\nDV_VALUE= 1.1\n{row}\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    assert message in capsys.readouterr().err


def test_paths_are_those_of_the_working_folder(here, capsys):
    Path("deep").mkdir()
    config("DV_KIND= SCALE\nDV_VALUE= 1.1\n")
    Path("a.cfg").rename("deep/a.cfg")
    assert run(["def", "deep/a.cfg", "-q"]) == 0
    assert Path("out.su2").is_file()
    Path("mesh.su2").rename("deep/mesh.su2")
    assert run(["def", "deep/a.cfg"]) == 1
    assert "not in the working folder, but in the folder of deep/a.cfg" in capsys.readouterr().err


def test_input_mesh_is_not_written_over_unasked(here, capsys):
    config("DV_KIND= SCALE\nDV_VALUE= 1.1\n")
    same = Path("a.cfg").read_text().replace("out.su2", "mesh.su2")
    Path("a.cfg").write_text(same)
    before = Path("mesh.su2").read_bytes()
    assert run(["def", "a.cfg"]) == 1
    assert "add --force to write over it" in capsys.readouterr().err
    assert Path("mesh.su2").read_bytes() == before
    assert run(["def", "a.cfg", "--force", "-q"]) == 0
    assert Path("mesh.su2").read_bytes() != before


def test_inverted_cells_are_code_3(here):
    config("DV_KIND= TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.5\n")
    assert run(["def", "a.cfg", "-q"]) == 3
    assert Path("out.su2").is_file()


def test_set_changes_our_keys(here):
    config("DV_KIND= SCALE\nDV_VALUE= 1.1\n")
    assert run(["def", "a.cfg", "--set", "STEPS=2", "--json", "a.json", "-q"]) == 0
    assert json.loads(Path("a.json").read_text())["steps"] == 2


def test_set_changes_su2s_keys(here, capsys):
    text = "DV_KIND= TRANSLATION\nDV_PARAM= (0, 1, 0)\n"
    config(f"{text}DV_VALUE= 0.05\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    expected = Path("out.su2").read_bytes()
    config(f"{text}DV_VALUE= 0.01\n")
    call = ["def", "a.cfg", "-q", "--set"]
    assert run([*call, "dv_value = 0.05"]) == 0
    assert Path("out.su2").read_bytes() == expected
    for given, said in (
        ("DV_VALUE=( )", "a.cfg: DV_VALUE has 0 values for 1 variable; give one each"),
        ("DV_VALU=1", "unknown key 'DV_VALU'; did you mean DV_VALUE?"),
        ("MACH_NUMBER=1", "unknown key 'MACH_NUMBER'; `slideviz keys` lists slideviz's keys"),
        ("DV_VALUE", "--set 'DV_VALUE' is not of the form KEY=VALUE"),
    ):
        assert run([*call, given]) == 1
        assert f"slideviz: {said}" in capsys.readouterr().err.replace(f"--set {given}: unk", "unk")


def test_ffd_setting_without_definition_is_told(here, capsys):
    config("DV_KIND= FFD_SETTING\n")
    assert run(["def", "a.cfg", "-q"]) == 1
    assert "FFD_SETTING needs FFD_DEFINITION, which has no box" in capsys.readouterr().err


def test_binary_mesh_is_written_without_boxes_and_says_so(here, capsys):
    config(f"{BOXED}DV_KIND= FFD_SETTING\nMESH_OUT_FORMAT= SU2B\n".replace("out.su2", "out.su2b"))
    assert run(["def", "a.cfg"]) == 0
    assert sv.read("out.su2", file_format="su2b").points.shape == (49, 2)
    assert "out.su2 lacks the FFD boxes" in capsys.readouterr().err


def test_values_of_other_keys_may_hold_any_signs(here):
    found = config(
        "CUSTOM_OUTPUTS= 'v : Macro{sqrt(pow(VELOCITY_X, 2))};\\\n"
        "    mean : MassFlowAvg{$v}[low]; # and more\\\n    last : $v'\n"
        "OPT_CONSTRAINT= ( LIFT > 0.3 ) * 0.01\nDV_KIND= SCALE % comment\nDV_VALUE= 1.1\n"
    )
    assert found.ignored == ("CUSTOM_OUTPUTS", "OPT_CONSTRAINT")
    assert found.variables[0].value == 1.1


def test_mistyped_keys_of_ours_are_warned_about(here, capsys):
    config("DV_KIND= SCALE\nDV_VALUE= 1.1\nSLIDING_MOD= ds\nDV_VALUE_NEW= 0\nMUSCL_FLOW= YES\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    err = capsys.readouterr().err
    assert "a.cfg:7: SLIDING_MOD is not read; did you mean SLIDING_MODE?" in err
    assert err.count("did you mean") == 1


@pytest.mark.parametrize(
    ("row", "meant"),
    [
        ("STEPZ= 3", "STEPS"),
        ("SLIDING_MODEL= ps", "SLIDING_MODE"),
        ("MULTILEVELS= NO", "MULTILEVEL"),
    ],
)
def test_mistyped_keys_of_our_own_are_told_though_shorter_or_given_besides(row, meant, here):
    key = row.partition("=")[0]
    text = f"DV_KIND= SCALE\nDV_VALUE= 1.1\nSLIDING_MODE= ps\n{row}\n"
    (said,) = config(text).case.warnings
    assert str(said) == f"a.cfg:8: {key} is not read; did you mean {meant}?"


@pytest.mark.parametrize(
    ("key", "meant"),
    [
        ("MARKER_SYMM", "MARKER_SYM"),
        ("DV_VALEU", "DV_VALUE"),
        ("DV_PARM", "DV_PARAM"),
        ("DVMARKER", "DV_MARKER"),
        ("MESH_FILENANE", "MESH_FILENAME"),
    ],
)
def test_keys_with_one_wrong_letter_are_told_beside_the_right_ones(key, meant, here):
    text = f"DV_KIND= SCALE\nDV_PARAM= (1.0)\nDV_VALUE= 1.1\nMARKER_SYM= (left)\n{key}= (high)\n"
    found = config(text)
    (said,) = found.case.warnings
    assert str(said) == f"a.cfg:9: {key} is not read; did you mean {meant}?"
    assert found.ignored == (key,)


def test_keys_that_su2_has_are_not_taken_for_mistyped_ones(here):
    keys = [
        "DEFORM_COEFF",
        "DEFORM_MESH",
        "KIND_RADIAL_BASIS_FUNCTION",
        "FFD_TOLERANCE",
        "CONV_FILENAME",
        "DV_VALUE_NEW",
        "GAMMA_VALUE",
        "MARKER_CUSTOM",
        "MARKER_FAR",
        "MARKER_INTERFACE",
        "MGLEVEL",
        "MARKER_ISOTHERMAL",
        "MARKER_MATCH_DEFORM_MESH",
        "MARKER_NEARFIELD",
        "MARKER_PLOTTING",
        "MESH_BOX_SIZE",
        "MULTIZONE",
        "OBJECTIVE_WEIGHT",
        "SOLUTION_FILENAME",
        "TIME_STEP",
        "VALUE_OBJFUNC_FILENAME",
        "VOLUME_ADJ_FILENAME",
        "WRT_BINARY_RESTART",
    ]
    found = config("DV_KIND= SCALE\nDV_VALUE= 1\n" + "".join(f"{key}= 1\n" for key in keys))
    assert found.ignored == tuple(keys)
    assert not found.case.warnings


def test_setting_boxes_tells_its_warnings_too(here, capsys):
    config(f"{BOXED}DV_KIND= FFD_SETTING\nSTEPZ= 3\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    assert "warning: a.cfg:8: STEPZ is not read; did you mean STEPS?" in capsys.readouterr().err


def test_without_dv_marker_the_markers_of_a_deformed_mesh_move(here):
    Path("a.cfg").write_text("MARKER_DEFORM_MESH= (high)\nDV_KIND= SCALE\nDV_VALUE= 1.1\n")
    assert read_config(Path("a.cfg")).markers == ("high",)


def test_boxes_that_the_surface_leaves_behind_are_told(here, capsys):
    text = f"{BOXED}DV_KIND= FFD_SETTING\n"
    config(text)
    assert run(["def", "a.cfg", "-q"]) == 0
    Path("out.su2").rename("mesh.su2")
    config("DV_KIND= TRANSLATION\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.02\n")
    assert run(["def", "a.cfg"]) == 0
    said = capsys.readouterr().err
    assert "boxes in out.su2 follow their control points only, and not TRANSLATION" in said
    Path("out.su2").rename("mesh.su2")
    config("DV_KIND= FFD_CONTROL_POINT_2D\nDV_PARAM= (BOX, 1, 0, 0, 1)\nDV_VALUE= 0.02\n")
    assert run(["def", "a.cfg", "-q"]) == 0
    assert "'BOX' on low differ from the mesh by up to 0.07" in capsys.readouterr().err


ZONES = """MESH_FILENAME= stage.su2
MESH_OUT_FILENAME= out.su2
DV_MARKER= ( 1:BLOCK, 2:BLOCK )
MARKER_SYM= ( 1:inner, 1:outer, 2:inner )
DV_KIND= TRANSLATION
DV_PARAM= (0, 1, 0)
DV_VALUE= 0.01
"""


def test_boundaries_of_all_zones_are_in_one_configuration(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh = sv.read(stage(tmp_path))
    (tmp_path / "a.cfg").write_text(ZONES)
    assert run(["def", "a.cfg", "-q"]) == 0
    shift = sv.read("out.su2").points - mesh.points
    for name in ("1:BLOCK", "2:BLOCK"):
        assert np.allclose(shift[mesh.marker(name).nodes], [0.0, 0.01], atol=1e-12)
    assert run(["def", "a.cfg", "-q", "--set", "DV_VALUE=0", "--force"]) == 0
    assert np.array_equal(sv.read("out.su2").points, mesh.points)
