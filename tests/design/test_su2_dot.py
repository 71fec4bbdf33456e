"""``slideviz dot``: gradients against central differences of ``slideviz def``, and SU2's files."""

import json
import lzma
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.su2 import gradients
from slideviz.design.su2.config import on_mesh, read_config
from slideviz.design.su2.surface import make_surface
from tests.builders import cube, passage, square

DESIGN = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "design"
CORNERS = [(-0.1, 0.3), (1.1, 0.3), (1.1, 0.8), (-0.1, 0.8)]
BOX = "(BOX, " + ", ".join(f"{x}, {y}, 0" for x, y in CORNERS) + ", 0" * 12 + ")"
HEAD = f"""
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
SOLUTION_ADJ_FILENAME= adj.dat
OBJECTIVE_FUNCTION= DRAG
FFD_DEFINITION= {BOX}
FFD_DEGREE= (4, 2, 0)
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def unpacked(name):
    """A file of the design cases in the working folder; skips where they are not here."""
    path = DESIGN / name
    packed = path.with_name(f"{name}.xz")
    if not path.is_file() and not packed.is_file():
        pytest.skip("the design cases are not here")
    data = path.read_bytes() if path.is_file() else lzma.decompress(packed.read_bytes())
    Path(name).write_bytes(data)


def write_csv(path, points, weights, *, order=None, quoted=True, extra=""):
    letters = "xyz"[: points.shape[1]]
    names = ["PointID", *letters, "Adj_Density", *(f"Sensitivity_{c}" for c in letters)]
    head = ", ".join(f'"{name}"' if quoted else name for name in names)
    order = range(len(points)) if order is None else order
    rows = [
        ", ".join(map(repr, [int(k), *points[k].tolist(), 7.5, *weights[k].tolist()]))
        for k in order
    ]
    Path(path).write_text("\n".join([head, *rows]) + "\n" + extra)


def written(config):
    """The mesh that ``def`` writes for a configuration."""
    Path("def.cfg").write_text(config)
    assert run(["def", "def.cfg", "-q"]) in (0, 3)
    return sv.read("out.su2").points


def values_text(values):
    return ", ".join(map(repr, values))


def differences(config, values, weights, steps):
    """Central differences of the sum of weights times points, by ``def``."""
    found = []
    for place, step in enumerate(steps):
        ends = []
        for sign in (1, -1):
            moved = list(values)
            moved[place] += sign * step
            ends.append((weights * written(config.replace("VALUES", values_text(moved)))).sum())
        found.append((ends[0] - ends[1]) / (2 * step))
    return np.array(found)


def gradient():
    head, *rows = Path("of_grad.dat").read_text().splitlines()
    assert head.endswith("gradient")
    return np.array([float(row) for row in rows])


RIGID = """\
DV_KIND= TRANSLATION, ROTATION, SCALE
DV_PARAM= (1, 0.5, 0); (0.4, 0.5, 0, 0.4, 0.5, 1); (1.0)
DV_VALUE= VALUES
"""
BOXES = """\
DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT, FFD_CONTROL_POINT_2D
DV_PARAM= (BOX, 2, 1, 0, 1); (BOX, 1, 2, 0, 1, -1, 0); (BOX, -1, 0, 1, 0)
DV_VALUE= VALUES
"""
RELAXED = """\
DV_KIND= ROTATION, SCALE
OPT_RELAX_FACTOR= 0.5
DV_PARAM= (0.4, 0.5, 0, 0.4, 0.5, 1); (1.0)
DV_VALUE= VALUES
"""
SEVERAL = """\
DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D
OPT_RELAX_FACTOR= 0.5
DV_PARAM= (BOX, 2, 1, 0, 0); (BOX, 1, -1, 1, 1); (BOX, 3, 1, 0, 0)
DV_VALUE= VALUES
"""
CASES = {
    "rigid": (RIGID, [0.01, 3.0, 1.02]),
    "boxes": (BOXES, [0.05, 0.02, -0.03]),
    "relaxed": (RELAXED, [5.0, 2.02]),
    "several values": (SEVERAL, [0.02, -0.03, 0.04, 0.01, 0.05]),
}
SETTINGS = {
    "fixed": "",
    "sliding": "MARKER_SYM= (x_m, x_p)\n",
    "two steps": "MARKER_SYM= (y_m, y_p)\nSLIDING_MODE= ds\nSTEPS= 2\n",
}


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("kinds", CASES)
def test_gradient_is_that_of_central_differences(kinds, setting, here):
    mesh = square(8)
    sv.write("mesh.su2", mesh)
    names = [name for name in mesh.marker_names if name.startswith(("x_", "y_"))]
    assert len(names) == 4, mesh.marker_names
    moving = [name for name in mesh.marker_names if name not in names]
    variables, values = CASES[kinds]
    config = HEAD + f"DV_MARKER= ({', '.join(moving)})\n" + variables + SETTINGS[setting]
    weights = np.random.default_rng(1).normal(size=mesh.points.shape)
    expected = differences(config, values, weights, [1e-5 * max(1, abs(v)) for v in values])
    text = config.replace("VALUES", values_text(values))
    write_csv("adj_cd.csv", written(text), weights)
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q", "--json", "dot.json"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=2e-6, atol=1e-8)
    assert json.loads(Path("dot.json").read_text())["at"] == "design"


REPEATED = "MARKER_PERIODIC= (x_m, x_p, 0, 0, 0, 0, 0, 0, 1, 0, 0)\n"
TURNED = "MARKER_PERIODIC= (per1, per2, 0, 0, 0, 0, 0, 30, 0, 0, 0)\nPERIODIC_AXIS= z\n"
SLIDE_AND_REPEAT = {
    "box": (
        lambda: square(8),
        "BLOCK",
        REPEATED + "MARKER_SYM= (y_m, y_p)\n",
    ),
    "layers": (
        lambda: cube(4),
        "BLOCK",
        REPEATED + "MARKER_SYM= (y_m, y_p, z_m, z_p)\nLAYERS= KEEP\nLAYER_THICKNESS= 0.15\n",
    ),
    "curved": (
        lambda: passage((3, 8, 6)),
        "blade",
        TURNED + "MARKER_SYM= (inflow, outflow)\nMARKER_SLIDING= (hub, shroud)\nRIMS= SLIDE\n",
    ),
}


@pytest.mark.parametrize("name", SLIDE_AND_REPEAT)
def test_relaxed_gradient_where_nodes_slide_and_repeat(name, here, capsys):
    make, moving, boundaries = SLIDE_AND_REPEAT[name]
    mesh = make()
    sv.write("mesh.su2", mesh)
    config = (
        f"MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nSOLUTION_ADJ_FILENAME= adj.dat\n"
        f"OBJECTIVE_FUNCTION= DRAG\nDV_MARKER= ({moving})\n{boundaries}"
        "DV_KIND= TRANSLATION, ROTATION\nDV_PARAM= (0.3, 0.7, 0); (0.5, 0.5, 0, 0.5, 0.5, 1)\n"
        "DV_VALUE= VALUES\n"
    )
    values = [0.02, 3.0]
    weights = np.random.default_rng(5).normal(size=mesh.points.shape)
    expected = differences(config, values, weights, [1e-5, 1e-4])
    text = config.replace("VALUES", values_text(values))
    points = written(text)
    assert np.abs(written(text + "RELAX= NO\n") - points).max() > 1e-3
    write_csv("adj_cd.csv", points, weights)
    Path("dot.cfg").write_text(text)
    capsys.readouterr()
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert "differ" not in capsys.readouterr().err
    np.testing.assert_allclose(gradient(), expected, rtol=1e-6, atol=1e-8)
    config = read_config(Path("dot.cfg"))
    surface = make_surface(on_mesh(config, mesh), mesh)
    deformer = gradients._deformer(surface, surface.displacement, None)
    np.testing.assert_allclose(deformer.deform(), points, rtol=0, atol=1e-10)
    for place, value in enumerate(gradient()):
        forward = weights * deformer.jvp(surface.displacement, surface.slope(place))
        assert abs(forward.sum() - value) <= 1e-12 * np.abs(forward).sum()


RIMS = {
    "flat": (
        lambda: cube(4, block=False),
        "z_m",
        "x_m, x_p, y_m, y_p",
        "(0, 1, 0.2)",
        "0.3, 0, 0.1, 0.4, 1, 0",
    ),
    "curved": (
        lambda: passage((3, 8, 6)),
        "blade",
        "hub, shroud",
        "(0.2, 0.1, 1)",
        "0, 0, 0, 1, 0, 0",
    ),
}


@pytest.mark.parametrize("wall", RIMS)
@pytest.mark.parametrize("steps", [1, 3])
def test_gradient_where_rims_stay_on_their_walls(wall, steps, here, capsys):
    make, moving, walls, direction, axis = RIMS[wall]
    mesh = make()
    sv.write("mesh.su2", mesh)
    config = (
        f"MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nSOLUTION_ADJ_FILENAME= adj.dat\n"
        f"OBJECTIVE_FUNCTION= DRAG\nDV_MARKER= ({moving})\nMARKER_SYM= ({walls})\n"
        f"DV_KIND= TRANSLATION, ROTATION\nDV_PARAM= {direction}; ({axis})\nDV_VALUE= VALUES\n"
        f"RIMS= SLIDE\nSTEPS= {steps}\nSLIDING_MODE= ps\n"
    )
    values = [0.02, 1.5]
    weights = np.random.default_rng(3).normal(size=mesh.points.shape)
    expected = differences(config, values, weights, [1e-5, 1e-4])
    text = config.replace("VALUES", values_text(values))
    write_csv("adj_cd.csv", written(text), weights)
    assert "has left" not in capsys.readouterr().err
    free = written(text.replace("RIMS= SLIDE", "RIMS= FREE"))
    assert np.abs(free - written(text)).max() > 1e-3
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=1e-6, atol=1e-8)


def test_gradient_in_3d_with_splines(here):
    mesh = cube(4)
    sv.write("mesh.su2", mesh)
    corners = ", ".join(f"{x}, {y}, {z}" for z in (0.1, 0.9) for x, y in CORNERS)
    config = HEAD.replace(BOX, f"(BOX, {corners})").replace("(4, 2, 0)", "(4, 2, 2)") + (
        "FFD_BLENDING= BSPLINE_UNIFORM\nFFD_BSPLINE_ORDER= 3, 2, 3\nDV_MARKER= (BLOCK)\n"
        "MARKER_SYM= (z_m, z_p)\nDV_KIND= FFD_CONTROL_POINT, FFD_CONTROL_POINT\n"
        "DV_PARAM= (BOX, 2, 1, 1, 0.3, 1, 0.2); (BOX, 3, 1, -1, 0, 0, 0)\n"
        "DV_VALUE= VALUES\n"
    )
    values = [0.02, 0.01, 0.0, -0.02]
    weights = np.random.default_rng(2).normal(size=mesh.points.shape)
    expected = differences(config, values, weights, [1e-5] * 4)
    text = config.replace("VALUES", values_text(values))
    write_csv("adj_cd.csv", written(text), weights)
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=2e-6, atol=1e-8)
    table = np.loadtxt("surface_sensitivity.dat", delimiter=",")
    nodes = mesh.marker("BLOCK").nodes
    np.testing.assert_allclose(table[:, :3], sv.read("out.su2").points[nodes], atol=1e-12)


def simple(values="0.05, 0.02", markers="BLOCK"):
    return HEAD + (
        f"DV_MARKER= ({markers})\nDV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D\n"
        f"DV_PARAM= (BOX, 2, 1, 0, 1); (BOX, -1, -1, 1, 0)\nDV_VALUE= {values}\n"
    )


@pytest.fixture
def case(here):
    """A design written to ``dot.cfg``, its points and sensitivities."""
    sv.write("mesh.su2", square(8))
    points = written(simple())
    weights = np.random.default_rng(3).normal(size=points.shape)
    Path("dot.cfg").write_text(simple())
    return points, weights


def test_every_form_of_the_file_gives_the_same(case):
    points, weights = case

    def found():
        assert run(["dot", "dot.cfg", "-q"]) == 0
        return gradient()

    write_csv("adj_cd.csv", points, weights)
    expected = found()
    back = np.arange(len(points))[::-1]
    write_csv("adj_cd.csv", points, weights, order=back, quoted=False, extra="AOA= 1.25\n")
    np.testing.assert_array_equal(found(), expected)
    text = Path("adj_cd.csv").read_text()
    for head in ("", ","):  # SU2 ends rows with a comma, and no heading
        lines = text.splitlines()
        rows = [f"{row}, " for row in lines[1 : len(points) + 1]]
        Path("adj_cd.csv").write_text("\n".join([lines[0] + head, *rows, *lines[-1:]]) + "\n")
        np.testing.assert_array_equal(found(), expected)
    Path("adj_cd.csv").rename("adj.csv")
    np.testing.assert_array_equal(found(), expected)
    Path("adj.csv").unlink()
    names = ["x", "y", "Sensitivity_x", "Sensitivity_y"]
    head = np.array([535532, 4, len(points), 0, 0], np.int32).tobytes()
    head += b"".join(name.encode().ljust(33, b"\0") for name in names)
    body = np.hstack([points, weights]).tobytes()
    Path("adj_cd.dat").write_bytes(head + body + b"\0" * 100)
    np.testing.assert_array_equal(found(), expected)
    rows = [[*points[k], 0.0, *weights[k], 0.0] for k in back]
    text = "\n".join(", ".join(map(repr, map(float, row))) for row in rows)
    Path("sens.dat").write_text("x, y, z, dJdx, dJdy, dJdz\n" + text + "\n")
    more = "DV_SENSITIVITY_FORMAT= UNORDERED_ASCII\nDV_UNORDERED_SENS_FILENAME= sens.dat\n"
    Path("dot.cfg").write_text(simple() + more)
    np.testing.assert_array_equal(found(), expected)


def outwards(mesh, points, name):
    """Unit normals out of a 2D mesh at all points, zero but at a closed boundary: by its edges."""
    normals = np.zeros(points.shape)
    cells = np.concatenate([table for _, table in mesh.cells.by_type.values()])
    for edge in mesh.marker(name).cells.by_type[3][1]:
        cell = cells[np.isin(cells, edge).sum(axis=1) == 2][0]
        along = points[edge[1]] - points[edge[0]]
        normal = np.array([along[1], -along[0]])
        inside = points[cell].mean(axis=0) - points[edge].mean(axis=0)
        normals[edge] -= np.sign(normal @ inside) * normal
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def write_surface_csv(path, points, along, rows, more=("x", "y")):
    head = ", ".join(f'"{name}"' for name in ("PointID", *more, "Surface_Sensitivity"))
    places = points[:, : len(more)]
    lines = [", ".join(map(repr, [int(k), *places[k].tolist(), float(along[k])])) for k in rows]
    Path(path).write_text("\n".join([head, *(f"{line}, " for line in lines)]) + "\n")


@pytest.mark.parametrize("at", ["design", "mesh"])
def test_surface_sensitivity_alone_is_along_the_normals_as_in_su2(case, at, capsys):
    points, weights = case
    mesh = square(8)
    if at == "mesh":
        Path("mesh.su2").write_bytes(Path("out.su2").read_bytes())
    along = weights[:, 0]
    nodes = mesh.marker("BLOCK").nodes
    vectors = along[:, None] * outwards(mesh, points, "BLOCK")
    write_csv("adj_cd.csv", points, vectors)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    expected = gradient()
    everywhere, surface = range(len(points)), [*nodes, 0, 3]
    for rows, more in ((everywhere, ("x", "y")), (surface, ("x", "y")), (everywhere, ())):
        if not more and at == "mesh":
            continue  # without coordinates they are those of the design
        write_surface_csv("adj_cd.csv", points, along, rows, more)
        assert run(["dot", "dot.cfg", "-q", "--json", "dot.json"]) == 0
        np.testing.assert_allclose(gradient(), expected, rtol=1e-12, atol=1e-15)
        assert json.loads(Path("dot.json").read_text())["at"] == at
    assert "are not in it" not in capsys.readouterr().err
    write_surface_csv("adj_cd.csv", points, along, surface[2:])
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert f"2 of the {len(nodes)} moving nodes among them" in capsys.readouterr().err


def test_surface_sensitivity_does_not_say_what_a_moved_grid_does(case, capsys):
    points, weights = case
    Path("dot.cfg").write_text(
        HEAD + "DV_KIND= TRANSLATE_GRID\nDV_PARAM= (1, 0, 0)\nDV_VALUE= 0.1\n"
    )
    write_surface_csv("adj_cd.csv", points, weights[:, 0], range(len(points)))
    assert run(["dot", "dot.cfg", "-q"]) == 1
    assert "has Surface_Sensitivity only, which covers the surfaces in" in capsys.readouterr().err


def test_surface_sensitivity_of_a_real_restart_is_its_sensitivity_along_the_normals(here):
    from slideviz.case.motions.airfoil import normals_at
    from slideviz.design.su2.gradients import SURFACE, read_restart

    unpacked("solution_adj_custom.csv")
    unpacked("burner_hx.su2")
    mesh = sv.read("burner_hx.su2")
    names, table = read_restart(Path("solution_adj_custom.csv"))
    column = [name.lower() for name in names].index
    nodes = mesh.marker("wall_hx").nodes
    normals = normals_at(mesh, ("wall_hx",), nodes)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vectors = table[nodes][:, [column("sensitivity_x"), column("sensitivity_y")]]
    along = table[nodes, column(SURFACE)]
    np.testing.assert_allclose(-(normals * vectors).sum(axis=1), along, rtol=1e-9, atol=1e-15)


def test_mesh_that_is_deformed_already_is_taken_as_it_is(case):
    """As in SU2's loop: MESH_FILENAME is the deformed mesh, and so are the sensitivities."""
    points, weights = case
    Path("mesh.su2").write_bytes(Path("out.su2").read_bytes())
    write_csv("adj_cd.csv", points, weights)
    Path("dot.cfg").write_text(simple())
    assert run(["dot", "dot.cfg", "-q", "--json", "a.json"]) == 0
    assert json.loads(Path("a.json").read_text())["at"] == "mesh"
    found = gradient()
    expected = differences(simple("VALUES"), [0.0, 0.0], weights, [1e-6] * 2)
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-8)


def test_sensitivities_without_coordinates_are_those_of_the_design(case, capsys):
    points, weights = case
    write_csv("adj_cd.csv", points, weights)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    expected = gradient()
    table = [row.split(", ") for row in Path("adj_cd.csv").read_text().splitlines()]
    Path("adj_cd.csv").write_text("\n".join(", ".join([r[0], *r[4:]]) for r in table) + "\n")
    assert run(["dot", "dot.cfg"]) == 0
    assert (
        "adj_cd.csv has no coordinates; its rows are taken at this design's points"
        in capsys.readouterr().err
    )
    np.testing.assert_array_equal(gradient(), expected)


def test_several_objectives_and_names_of_files(case):
    points, weights = case
    config = simple().replace("DRAG", "DRAG, LIFT") + (
        "GRAD_OBJFUNC_FILENAME= g.dat\nDV_SENS_FILENAME= s.dat\n"
    )
    Path("dot.cfg").write_text(config)
    write_csv("adj_combo.csv", points, weights)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert Path("g.dat").read_text().splitlines()[0] == "DRAG gradient"
    assert len(Path("s.dat").read_text().splitlines()) == len(square(8).marker("BLOCK").nodes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, w: None, "there is no adjoint solution of OBJECTIVE_FUNCTION= DRAG: none of"),
        (lambda p, w: write_csv("adj_cd.csv", p[:-1], w[:-1]), "has 79 points, and mesh.su2 80"),
        (lambda p, w: write_csv("adj_cd.csv", p + 0.3, w), "its points match neither mesh"),
        (lambda p, w: write_csv("adj_cd.csv", p, w * np.nan), "point 0 is not finite; did SU2"),
        (
            lambda p, w: write_csv("adj_cd.csv", p, w, order=[0, *range(len(p) - 1)]),
            "its PointID are not 0 to 79, each once",
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"PointID", "x", "y"\n0, 1, 2\n'),
            "has no column Sensitivity_x, Sensitivity_y, but PointID, x, y",
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"x", "Sensitivity_x"\n0, a\n1, 2\n'),
            "adj_cd.csv:2: expected a number for each of the 2 columns, separated by commas; dec",
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"x", "Sensitivity_x"\n1, 2\n0,5, 2\n'),
            "adj_cd.csv:3: expected a number for each of the 2 columns, separated by commas; dec",
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"x", "Sensitivity_x"\n1,5, 2,5\n'),
            "adj_cd.csv:2: expected a number for each of the 2 columns, separated by commas; dec",
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"x", "Sensitivity_x"\n1, 1_0\n'),
            "adj_cd.csv:2: expected a number for each of the 2 columns, separated by commas; dec",
        ),
        (
            lambda p, w: write_csv("adj_cd.csv", p[on := square(8).marker("BLOCK").nodes], w[on]),
            "points, as many as move of mesh.su2; sensitivities at moving nodes only are read with",
        ),
        (
            lambda p, w: Path("adj_cd.dat").write_bytes(
                np.array([535532, 4, 9, 0, 0], np.int32).tobytes()
            ),
            "is cut off: 4 columns of 9 points do not fit in it",
        ),
        *(
            (
                lambda p, w, n=n: Path("adj_cd.dat").write_bytes(
                    np.array([535532, 4, 9], np.int32).tobytes()[:n]
                ),
                "do not fit in it",
            )
            for n in (4, 6, 8, 11)
        ),
        (
            lambda p, w: Path("adj_cd.csv").write_text('"x", "Sensitivity_x", "Sensitivity_y"\n'),
            "has no row of numbers; expected one for each point",
        ),
        (
            lambda p, w: Path("dot.cfg").write_text(
                Path("dot.cfg").read_text() + "\nSOLUTION_ADJ_FILENAME= .\n"
            ),
            "SOLUTION_ADJ_FILENAME: '.' is a folder; expected the name of a file",
        ),
    ],
)
def test_wrong_sensitivities_are_told(change, message, case, capsys):
    change(*case)
    assert run(["dot", "dot.cfg", "-q"]) == 1
    assert message in capsys.readouterr().err
    assert not Path("of_grad.dat").exists()


def test_wrong_unordered_files_are_told(case, capsys):
    more = "DV_SENSITIVITY_FORMAT= UNORDERED_ASCII\n"
    Path("dot.cfg").write_text(simple() + more)
    rows = [", ".join(map(repr, map(float, [*p, 0, *w, 0]))) for p, w in zip(*case, strict=True)]
    for text, message in (
        ("1, 2\n", "expected rows x, y, z, dJ/dx, dJ/dy, dJ/dz of numbers"),
        ("1, 2, 3, 4, 5, six\n", "unordered_sensitivity.dat:1: has a value that is not a number"),
        ("\n".join([*rows, rows[0]]), "several rows are at the point 0; one each is needed"),
    ):
        Path("unordered_sensitivity.dat").write_text(text)
        assert run(["dot", "dot.cfg", "-q"]) == 1
        assert message in capsys.readouterr().err
    Path("unordered_sensitivity.dat").write_text("\n".join(rows[:-2]))
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert "2 points of the mesh are not in it; taken as 0" in capsys.readouterr().err
    nodes = square(8).marker("BLOCK").nodes
    for kept, of in ((nodes, ""), (nodes[3:], f", 3 of the {len(nodes)} moving nodes among them")):
        Path("unordered_sensitivity.dat").write_text("\n".join(rows[k] for k in kept))
        assert run(["dot", "dot.cfg"]) == 0
        said = f"{'warning' if of else 'note'}: unordered_sensitivity.dat: {80 - len(kept)} points"
        said = f"{said} of the mesh are not in it{of}; taken as 0"
        found = capsys.readouterr().err
        assert said in found
        assert "there already" not in found


def test_held_variables_have_no_gradient(case, capsys):
    points, weights = case
    config = simple("0.0, 0.02").replace("0.3", "0.45", 1) + "FFD_CONTINUITY= NO_DERIVATIVE\n"
    config = config.replace("-0.1", "0.45").replace("(BOX, 2, 1", "(BOX, 0, 1")
    points = written(config)
    write_csv("adj_cd.csv", points, weights)
    Path("dot.cfg").write_text(config)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    found = gradient()
    assert found[0] == 0.0
    assert found[1] != 0.0
    assert (
        "holds i = 0, j = 0 of the box BOX: variable 1 of DV_KIND will do"
        in capsys.readouterr().err
    )


def test_surface_file_has_a_surface_gradient_only(case, capsys):
    points, weights = case
    config = HEAD + "DV_MARKER= (BLOCK)\nDV_KIND= SURFACE_FILE\nDV_FILENAME= p.dat\n"
    nodes = square(8).marker("BLOCK").nodes
    rows = [f"{k} {x!r} {y!r}" for k, (x, y) in zip(nodes, points[nodes].tolist(), strict=True)]
    Path("p.dat").write_text("\n".join(rows))
    Path("dot.cfg").write_text(config)
    write_csv("adj_cd.csv", written(config), weights)
    assert run(["dot", "dot.cfg"]) == 0
    assert "SURFACE_FILE has no value to differentiate for" in capsys.readouterr().out
    assert not Path("of_grad.dat").exists()
    assert np.loadtxt("surface_sensitivity.dat", delimiter=",").shape == (len(nodes), 6)


def test_ffd_setting_has_no_gradient(case, capsys):
    keys = "DV_MARKER= (BLOCK)\nDV_KIND= FFD_SETTING\nCFL_NUMBER= 5\n"
    Path("dot.cfg").write_text(HEAD + keys)
    assert run(["dot", "dot.cfg"]) == 1
    said = capsys.readouterr().err
    assert "FFD_SETTING moves nothing, so it has no gradient" in said
    assert "not needed here" not in said  # a refusal comes alone


BURNER = """\
MARKER_SYM= (symmetry_xm, symmetry_xp)
DV_MARKER= (wall_hx)
DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D
DV_PARAM= (BOX, 3, 1, 0, 1); (BOX, 2, 0, 0, -1); (BOX, 4, -1, 1, 0)
"""
NACA = """\
DV_MARKER= (airfoil_upper, airfoil_lower)
FFD_CONTINUITY= USER_INPUT
RBF_KERNEL= wendland-c0
DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D
DV_PARAM= (UPPER, 2, 1, 0, 1); (LOWER, 1, 0, 0.5, -1)
"""
REAL = {
    "burner": ("burner_hx.su2", BURNER, [0.0, 0.0, 0.0], 1e-7),
    # Its smallest cells are 1e-5 of its size: of wendland-c2 differences keep five digits only.
    "naca": ("naca0012_two_ffd_boxes.su2", NACA, [0.01, 0.02], 1e-4),
}


@pytest.mark.parametrize("name", REAL)
def test_gradients_on_real_meshes(name, here):
    file, variables, values, step = REAL[name]
    unpacked(file)
    config = (
        f"MESH_FILENAME= {file}\nMESH_OUT_FILENAME= out.su2\nOBJECTIVE_FUNCTION= CUSTOM_OBJFUNC\n"
        f"SOLUTION_ADJ_FILENAME= solution_adj\n{variables}DV_VALUE= VALUES\n"
    )
    text = config.replace("VALUES", values_text(values))
    if name == "burner":
        unpacked("solution_adj_custom.csv")
        names = Path("solution_adj_custom.csv").read_text().partition("\n")[0].split(",")
        at = [names.index(f'"Sensitivity_{c}"') for c in "xy"]
        weights = np.loadtxt("solution_adj_custom.csv", delimiter=",", skiprows=1)[:, at]
    else:
        points = written(text)
        weights = np.exp(-np.square(points - np.array([0.4, 0.2])))  # smooth, as of a flow
        write_csv("solution_adj_custom.csv", points, weights)
    expected = differences(config, values, weights, [step] * len(values))
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=1e-6, atol=1e-8 * abs(expected).max())


def test_no_input_is_written_over(case, capsys):
    write_csv("adj_cd.csv", *case)
    Path("dot.cfg").write_text(simple() + "GRAD_OBJFUNC_FILENAME= adj_cd.csv\n")
    assert run(["dot", "dot.cfg", "-q"]) == 1
    assert "adj_cd.csv is the file of the sensitivities" in capsys.readouterr().err


def test_sensitivities_of_a_slightly_other_design_are_warned_about(case, capsys):
    points, weights = case
    write_csv("adj_cd.csv", points + 1e-7, weights)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert (
        "its points differ from this design by 1e-07: is the file older?" in capsys.readouterr().err
    )


def heard(extra, values, points, weights, capsys):
    """What ``dot`` tells, which must be whole sentences of its own, in the report as well."""
    Path("dot.cfg").write_text(simple(values) + extra)
    write_csv("adj_cd.csv", points, weights)
    capsys.readouterr()
    code = run(["dot", "dot.cfg", "-q", "--json", "dot.json"])
    lines = capsys.readouterr().err.splitlines()
    if code == 0:
        told = json.loads(Path("dot.json").read_text())["warnings"]
        assert lines == [f"slideviz: warning: {one}" for one in told]
    return code, lines


def test_a_badly_conditioned_system_is_told_by_the_command_itself(case, capsys, monkeypatch):
    points, weights = case
    extra = "RBF_KERNEL= gaussian\nINFLUENCE_FACTOR= 20\nDATA_REDUCTION= NO\n"
    code, lines = heard(extra, "0.0, 0.0", sv.read("mesh.su2").points, weights, capsys)
    assert code == 0
    assert any("the condition number of the system is" in line for line in lines)
    points = written(simple() + extra)
    # By how much the two differ, if at all, is rounding times a condition number of 2e18.
    monkeypatch.setattr(gradients, "CLOSE", -1.0)
    code, lines = heard(extra, "0.05, 0.02", points, weights, capsys)
    assert code == 0
    assert any("to a deformation whose points differ by up to" in line for line in lines)


def test_points_that_differ_from_those_written_are_told():
    points = np.array([[2.0, 0.0], [0.0, 1.0]])
    assert gradients._difference(points + 0.4 * gradients.CLOSE, points) == []
    (said,) = gradients._difference(points + 3.0 * gradients.CLOSE, points)
    assert "whose points differ by up to 3e-08 from the points that `slideviz def` writes" in said


def test_control_nodes_that_do_not_suffice_are_told(case, capsys):
    extra = "DATA_REDUCTION= YES\nDATA_RED_TOLERANCE= 1e-6\nMAX_CONTROL_NODES= 5\n"
    points = written(simple() + extra)
    code, lines = heard(extra, "0.05, 0.02", points, case[1], capsys)
    assert code == 0
    assert "with control nodes and facets chosen for this displacement; boundary" in lines[-1]


def test_other_warnings_of_python_go_on(recwarn):
    import warnings

    from slideviz.design.su2.gradients import _heard

    said = []
    warnings.simplefilter("always")
    with _heard(said):
        warnings.warn("another", UserWarning, stacklevel=1)
        warnings.warn("mine", sv.ConditionWarning, stacklevel=1)
    assert said == ["mine"]
    assert [str(one.message) for one in recwarn] == ["another"]
