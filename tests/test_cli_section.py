"""``slideviz section``: how sections are written, its pictures, numbers, sentences and codes."""

import json
import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import slideviz as sv
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.cli import run
from slideviz.cli.argument_readers import glued, plane, section_about_axis
from slideviz.cli.parser import parse
from slideviz.plots import section_picture
from slideviz.terms import COLOR_MAPS, QUANTITIES
from tests.builders import cube, passage, square


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A passage, a cube (also folded), a square, and the stator sample."""
    folder = tmp_path_factory.mktemp("section")
    sv.write(folder / "passage.su2", passage())
    block = cube(6, block=False)
    sv.write(folder / "cube.su2", block)
    points = block.points.copy()
    points[np.argmin(np.linalg.norm(points - 0.5, axis=1))] += 0.4
    sv.write(folder / "folded.su2", block.with_points(points))
    sv.write(folder / "square.su2", square(6, block=False))
    return folder


def call(folder, mesh, *options, out="x.png"):
    return run(["section", str(folder / mesh), "-o", str(folder / out), *options])


def report(capsys, folder, mesh, *options):
    """The exit code and the numbers; the picture is left empty, which is quicker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(section_picture, "draw_section", lambda *_: Figure())
        code = call(folder, mesh, "--json", "-", *options)
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("text", "origin", "direction"),
    [
        ("0,0,1,1,2,0.5", (1, 2, 0.5), (0, 0, 1)),
        ("1,2,3,4", (3, 4, 0), (1, 2, 0)),
        ("z=0.5", (0, 0, 0.5), (0, 0, 1)),
        ("y = -1e-3", (0, -1e-3, 0), (0, 1, 0)),
    ],
)
def test_planes(text, origin, direction):
    found = plane(text).section
    assert (found.kind, found.origin, found.direction) == ("plane", origin, direction)


@pytest.mark.parametrize(
    ("text", "origin", "direction", "given"),
    [
        ("0.25", (0, 0, 0), (0, 0, 1), False),
        ("r=0.25", (0, 0, 0), (0, 0, 1), False),
        ("radius = 0.25,x", (0, 0, 0), (1, 0, 0), True),
        ("0.25,0,1,1", (0, 0, 0), (0, 1, 1), True),
        ("0.25,0,1,0,3,4,5", (3, 4, 5), (0, 1, 0), True),
        ("0.25,y,3,4,5", (3, 4, 5), (0, 1, 0), True),
    ],
)
def test_cylinders(text, origin, direction, given):
    found = section_about_axis(SECTION_SHAPES["cylinder"], text)
    section = found.section
    assert (section.kind, section.radius, found.axis) == ("cylinder", 0.25, given)
    assert (section.origin, section.direction) == (origin, direction)


def test_the_command_takes_every_color_and_map_that_there_is():
    words = ["section", "cube.su2", "--plane", "z=0.4", "-o", "out.png"]
    for color in QUANTITIES:
        assert parse([*words, "--color", color]).color == color
    for name in COLOR_MAPS:
        assert parse([*words, "--map", name]).map == name


def test_a_plane_section_tells_the_numbers_of_its_cells(folder, capsys):
    options = ("cube.su2", "--plane", "0,0,1,0,0,0.4")
    code, found = report(capsys, folder, *options)
    assert code == call(folder, *options) == 0
    assert found["section"]["kind"] == "plane"
    assert found["section"]["radius"] is None
    assert (found["cells"], found["inverted"], found["passages"]) == (36, 0, 1)
    assert (found["min"], found["mean"]) == pytest.approx((1.0, 1.0))
    with Image.open(folder / "x.png") as image:
        assert image.size == (1600, 1000)


def test_numbers_are_those_of_the_cut_cells_against_the_undeformed_mesh(folder, capsys):
    code, found = report(
        capsys,
        *(folder, "folded.su2", "--plane", "z=0.55"),
        *("--reference", str(folder / "cube.su2")),
    )
    mesh, base = sv.read(folder / "folded.su2"), sv.read(folder / "cube.su2")
    values = sv.quality(mesh, reference=base).values
    heights = mesh.points[mesh.cells.by_type[12][1], 2] - 0.55
    cut = (heights.min(axis=1) < 0) & (heights.max(axis=1) > 0)
    assert code == 3
    assert found["inverted"] > 0
    assert found["cells"] == cut.sum()
    assert found["min"] == values[cut].min()
    assert found["mean"] == pytest.approx(values[cut].mean())
    assert cut[found["worst_cell"]]
    assert values[found["worst_cell"]] == 0


def title_of(folder, monkeypatch, mesh, *options):
    seen, real = [], section_picture.draw_section
    monkeypatch.setattr(
        section_picture, "draw_section", lambda *given: seen.append(real(*given)) or seen[-1]
    )
    assert call(folder, mesh, "--plane", "z=0.55", "--size", "640x400", *options) in (0, 3)
    (figure,) = seen
    monkeypatch.undo()
    return figure.get_suptitle().replace("\n", " ")


def test_in_2d_a_section_is_a_line_or_a_circle(folder, capsys):
    assert call(folder, "square.su2", "--plane", "y=0.45", "--cut", out="curve.svg") == 0
    assert "line y = 0.45" in capsys.readouterr().out
    code, found = report(capsys, folder, "square.su2", "--cylinder", "0.3,0,0,1,0.5,0.5,0")
    assert code == 0
    assert found["section"]["whole"]
    mesh = sv.read(folder / "square.su2")
    radii = np.hypot(*(mesh.points - 0.5).T)[mesh.cells.by_type[9][1]]
    assert found["cells"] == ((radii.min(axis=1) < 0.3) & (radii.max(axis=1) > 0.3)).sum()


def test_without_a_reference_line_and_picture_say_so(folder, capsys, monkeypatch):
    none = "no reference: relative to itself"
    assert title_of(folder, monkeypatch, "folded.su2").endswith(none)
    assert f"{none}; give --reference UNDEFORMED" in capsys.readouterr().out
    cube = str(folder / "cube.su2")
    assert none not in title_of(folder, monkeypatch, "folded.su2", "--reference", cube)
    out = capsys.readouterr().out
    assert none not in out
    assert f"reference: {cube}" in out
    # The shape of a cell needs no reference.
    assert none not in title_of(folder, monkeypatch, "folded.su2", "--color", "skew")
    assert none not in capsys.readouterr().out


def test_the_mesh_of_the_case_is_the_reference_where_its_cells_are_the_same(folder, capsys):
    options = ("folded.su2", "--plane", "z=0.55")
    _, asked = report(capsys, folder, *options, "--reference", str(folder / "cube.su2"))
    (folder / "cube.cfg").write_text("MESH_FILENAME= cube.su2\nMARKER_MOVING= (x)\n")
    _, found = report(capsys, folder, *options, "--case", str(folder / "cube.cfg"))
    assert found == asked
    for name in ("square.su2", "nowhere.su2"):
        (folder / "cube.cfg").write_text(f"MESH_FILENAME= {name}\nMARKER_MOVING= (x)\n")
        _, found = report(capsys, folder, *options, "--case", str(folder / "cube.cfg"))
        assert found["reference"] is None
        assert found["min"] == asked["min"] == 0
        assert found["mean"] != asked["mean"]


def test_a_list_may_begin_with_a_minus_sign(folder, capsys):
    code, found = report(capsys, folder, "cube.su2", "--plane", "-1,0,0,0.4,0,0")
    assert code == 0
    assert found["section"]["direction"] == [-1, 0, 0]
    assert glued(["run", "-o", "-1,2"]) == ["run", "-o", "-1,2"]


def test_a_cylinder_takes_axis_and_copies_from_the_period(folder, capsys):
    # About x the passage has no period; turn it so that the axis must be found.
    mesh = sv.read(folder / "passage.su2")
    turned = mesh.with_points(np.roll(mesh.points, 1, axis=1))
    sv.write(folder / "about_x.su2", turned)
    code, found = report(capsys, folder, "about_x.su2", "--cylinder", "0.7", "--copies", "2")
    assert code == 0
    assert found["section"]["direction"] == [1, 0, 0]
    assert found["passages"] == 5
    assert call(folder, "about_x.su2", "--cylinder", "0.7", "--copies", "wheel", "--3d") == 0


def test_the_case_names_period_and_axis(folder, tmp_path, capsys):
    text = "MESH_FILENAME= passage.su2\nMARKER_MOVING= (blade)\nPERIODIC_MODE= moving\n"
    axis = "PERIODIC_TYPE= rotational\nPERIODIC_AXIS= (0, 0, 1)\n"
    (folder / "p.cfg").write_text(text + "MARKER_PERIODIC= (per1, per2)\n" + axis)
    options = ("--cylinder", "0.7", "--copies", "1", "--case", str(folder / "p.cfg"))
    code, found = report(capsys, folder, "passage.su2", *options)
    assert (code, found["passages"], found["section"]["direction"]) == (0, 3, [0, 0, 1])
    (folder / "p.cfg").write_text(text + "MARKER_PERIODIC= (hub, per2)\n" + axis)
    assert call(folder, "passage.su2", *options) == 1
    assert "do not match" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a.svg", "a.pdf", "a.PNG"])
def test_all_kinds_of_pictures(folder, name):
    assert call(folder, "cube.su2", "--plane", "z=0.4", "--no-edges", out=name) == 0
    assert (folder / name).stat().st_size > 1000


def test_options_of_the_picture(folder, capsys):
    options = ("--cylinder", "0.7,z", "--whole", "--size", "640x400", "--range", "0.2,0.9")
    assert call(folder, "passage.su2", *options, "--color", "skew") == 0
    with Image.open(folder / "x.png") as image:
        assert image.size == (640, 400)
    out = capsys.readouterr().out
    assert "passage.su2: cylinder r = 0.7 about z" in out
    assert re.search(r"skew: min \d\.\d{4}, mean \d\.\d{4}; \d+ cells cut, worst is cell \d+", out)


def test_a_2d_mesh_shows_the_cells_whole_unless_they_are_to_be_cut(folder, capsys):
    _, whole = report(capsys, folder, "square.su2", "--plane", "y=0.4")
    _, cut = report(capsys, folder, "square.su2", "--plane", "0,1,0,0.4", "--cut")
    assert (whole["section"]["whole"], cut["section"]["whole"]) == (True, False)
    assert whole["cells"] == cut["cells"] == 6


def test_displacement_is_colored_up_to_its_largest(folder, capsys):
    mesh = passage()
    sv.write(folder / "moved.su2", mesh.with_points(mesh.points + np.array([0.0, 0.0, 0.002])))
    options = ("--color", "displacement", "--reference", str(folder / "passage.su2"))
    code, found = report(capsys, folder, "moved.su2", "--cylinder", "0.7,z", *options)
    assert code == 0
    assert found["max"] == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("mesh", "options", "words"),
    [
        (
            "cube.su2",
            ["--plane", "z=3"],
            "the plane z = 3 misses the mesh, which has z from 0 to 1",
        ),
        ("cube.su2", ["--plane", "0,0,-1,7,8,3"], "which has z from 0 to 1"),
        ("cube.su2", ["--plane", "1,1,0,3,0,0"], "by -2.12132 to -0.707107 it would cut it"),
        ("passage.su2", ["--cylinder", "2"], "misses the mesh, which has radii 0.5 to 1 about"),
        ("square.su2", ["--plane", "z=0"], "does not cut this 2D mesh; give a normal in x and y"),
        ("square.su2", ["--cylinder", "0.5,x"], "its axis is not z, so it needs a 3D mesh"),
        ("cube.su2", ["--plane", "z=0.4", "--range", "1,0"], "the first number must be"),
        ("cube.su2", ["--plane", "z=0.4", "--copies", "wheel"], "do not close a wheel"),
        ("none.su2", ["--plane", "z=0.4"], "none.su2"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(folder, mesh, options, words, capsys):
    assert call(folder, mesh, *options, out="never.png") == 1
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (folder / "never.png").exists()


def test_copies_need_boundaries_that_match(folder, capsys):
    mesh = sv.read(folder / "cube.su2")
    sv.write(folder / "bare.su2", sv.Mesh(mesh.points, mesh.cells, mesh.markers[:1]))
    assert call(folder, "bare.su2", "--plane", "z=0.4", "--copies", "1") == 1
    assert "no boundaries match each other, so there is no period" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], f"one of the arguments --{' --'.join(SECTION_SHAPES)} --meridional is required"),
        (["--plane", "z=0.4", "--cylinder", "1"], "not allowed with"),
        (["--plane", "0,0,1,2,3"], "has 5 numbers; write nx,ny,nz,x,y,z"),
        (["--plane", "0,0,one,0,0,0"], "is not nx,ny,nz,x,y,z"),
        (["--plane", "w=1"], "the axis is x, y or z; write e.g. z=0.5"),
        (["--plane", "z=up"], "is not a coordinate"),
        (["--plane", "0,0,0,1,1,1"], "the normal 0, 0, 0 has no direction"),
        (["--plane", "0,0,1,0,0,nan"], "not finite"),
        (["--cylinder", "0"], "the radius 0 is not positive"),
        (["--cylinder", "-1"], "the radius -1 is not positive"),
        (["--cylinder", "wide"], "is not a radius"),
        (["--cylinder", "z=1"], "'z=1' is not a radius, e.g. 0.25, r=0.25 or 0.25,x"),
        (["--cylinder", "r=wide"], "'wide' is not a radius"),
        (["--cone", "r=1"], "'r=1' is not a half angle in degrees, e.g. 15, a=15"),
        (["--cylinder", "1,0,1"], "has 2 numbers; write x, y, z"),
        (["--cylinder", "1", "--size", "big"], "is not a size; write e.g. 1600x1000"),
        (["--cylinder", "1", "--size", "10x10"], "300x200 to 20000x20000"),
        (["--cylinder", "1", "--copies", "-1"], "expected one argument|a number from 0 to 100"),
        (["--cylinder", "1", "--copies", "many"], "a number from 0 to 100, or the word wheel"),
        (["--cylinder", "1", "--copies", "101"], "a number from 0 to 100, or the word wheel"),
        (["--cylinder", "nan"], "'nan' has a number that is not finite"),
        (["--cylinder", "1", "--range", "0,inf"], "'0,inf' has a number that is not finite"),
        (["--cylinder", "1", "--range", "1"], "has 1 numbers; write lowest,highest"),
        (["--cylinder", "1", "--color", "red"], "invalid choice"),
        (["--cylinder", "1", "--color", "displacement"], "needs --reference UNDEFORMED"),
        (["--plane", "z=0", "--unrolled"], "--unrolled is for a --cylinder"),
    ],
)
def test_wrong_usage_is_code_2(folder, options, words, capsys):
    assert call(folder, "cube.su2", *options) == 2
    assert re.search(words, capsys.readouterr().err)


def test_pictures_that_cannot_be_written(folder, capsys):
    assert call(folder, "cube.su2", "--plane", "z=0.4", out="x.jpg") == 1
    assert "a section is drawn as .png, .svg, .pdf" in capsys.readouterr().err
    assert call(folder, "cube.su2", "--plane", "z=0.4", out="no/x.png") == 1
    assert "the folder does not exist" in capsys.readouterr().err


def test_the_help_has_an_example(capsys):
    assert run(["section", "--help"]) == 0
    assert "slideviz section stator.su2 --cylinder 0.275 --copies 2 -o mid_span.png" in (
        capsys.readouterr().out
    )


def test_another_color_map(folder):
    for name in ("viridis", "gray"):
        options = ("--plane", "z=0.4", "--map", name, "--size", "400x300")
        assert call(folder, "cube.su2", *options, out=f"{name}.png") == 0
    viridis, gray = (
        np.asarray(Image.open(folder / f"{name}.png").convert("RGB")).astype(int)
        for name in ("viridis", "gray")
    )
    assert np.ptp(viridis, axis=2).max() > 100
    assert np.ptp(gray, axis=2).max() < 5
