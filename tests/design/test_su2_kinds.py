"""SU2's design variables that are no boxes, against literal formulas and differences."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.motion_text import read_motions
from slideviz.case.moving_nodes import displacements
from slideviz.cli import run
from slideviz.design.su2.config import own_changes, read_config
from slideviz.design.su2.surface import make_surface
from slideviz.errors import CaseError
from slideviz.mesh.topology import find_boundary, vertex_normals
from tests.builders import airfoil, cube, halo_text, sector, sphere_in_box
from tests.design.test_su2_dot import (
    differences,
    gradient,
    unpacked,
    values_text,
    write_csv,
    written,
)
from tests.oracles import airfoils

HEAD = "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nDV_MARKER= (NAMES)\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def bent():
    """An airfoil with camber and incidence; no node has a normal along x."""
    mesh = airfoil(24, 3)
    x, y = mesh.points.T
    points = np.stack([x + 0.02 * y, y + 0.2 * x * (1 - x) - 0.1 * x + 0.013], axis=1)
    return mesh.with_points(np.where(np.hypot(x - 0.5, y)[:, None] > 2, mesh.points, points))


def halves(mesh):
    """The airfoil's marker as two: upper and lower."""
    lines = mesh.marker("airfoil").cells.by_type[3][1]
    upper = mesh.points[lines].mean(axis=1)[:, 1] > mesh.points[lines].mean(axis=1)[:, 0] * -0.1
    parts = [
        sv.Marker(name, sv.Cells.from_blocks([(3, lines[which])]))
        for name, which in (("upper", upper), ("lower", ~upper))
    ]
    return replace(mesh, markers=(*parts, mesh.marker("far")))


def ball():
    mesh = sphere_in_box()
    x, y, z = mesh.points.T
    return mesh.with_points(np.stack([x + 0.1 * y + 0.5, y, z - 0.07 * y], axis=1))


MESHES = {
    "airfoil": (bent, ("airfoil",)),
    "two markers": (lambda: halves(bent()), ("upper", "lower")),
    "3D": (ball, ("sphere",)),
}


def surface(mesh, markers, text):
    sv.write("mesh.su2", mesh, overwrite=True)
    Path("a.cfg").write_text(HEAD.replace("NAMES", ", ".join(markers)) + text)
    return make_surface(read_config(Path("a.cfg")), sv.read("mesh.su2"))


def as_table(found, expected):
    assert set(expected) == set(found.nodes.tolist())
    return np.array([expected[node] for node in found.nodes])


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize(
    ("kind", "numbers"),
    [
        ("HICKS_HENNE", (1, 0.3)),
        ("HICKS_HENNE", (0, 0.7)),
        ("HICKS_HENNE", (2, 0.5)),
        ("CST", (1, 2, 6)),
        ("CST", (0, 5, 5)),
        ("SURFACE_BUMP", (0.2, 0.9, 0.4)),
        ("NACA_4DIGITS", (2, 4, 15)),
        ("PARABOLIC", (0.4, 6)),
    ],
)
def test_kinds_move_nodes_as_su2_does(name, kind, numbers, here):
    make, markers = MESHES[name]
    mesh = make()
    text = f"DV_KIND= {kind}\nDV_PARAM= {numbers}\nDV_VALUE= 0.06\nOPT_RELAX_FACTOR= 0.5\n"
    found = surface(mesh, markers, text)
    expected = airfoils.displaced(mesh, markers, kind, numbers, 0.03)
    np.testing.assert_allclose(found.displacement, as_table(found, expected), atol=1e-15)
    assert found.displacement.any()
    rate = 0.0 if kind in ("NACA_4DIGITS", "PARABOLIC") else found.displacement / 0.06
    np.testing.assert_allclose(found.slope(0), rate, atol=1e-15)


@pytest.mark.parametrize("name", MESHES)
def test_camber_moves_both_sides_normal_to_the_chord(name, here):
    make, markers = MESHES[name]
    text = (
        "DV_KIND= HICKS_HENNE_CAMBER, HICKS_HENNE_CAMBER\nDV_PARAM= (0.3); (0.8)\n"
        "DV_VALUE= 0.02, -0.01\nOPT_RELAX_FACTOR= 7\n"
    )
    found = surface(make(), markers, text)
    expected = airfoils.cambered(found.mesh, markers, (0.3, 0.8), (0.02, -0.01))
    np.testing.assert_allclose(found.displacement, as_table(found, expected), atol=1e-15)
    total = 0.02 * found.slope(0) - 0.01 * found.slope(1)
    np.testing.assert_allclose(found.displacement, total, atol=1e-16)


@pytest.mark.parametrize("make", [bent, ball, lambda: cube(4), lambda: airfoil(12, 2)])
def test_normals_of_nodes_are_those_of_the_median_dual_mesh(make):
    mesh = make()
    boundary = find_boundary(mesh)
    for index, marker in enumerate(mesh.markers):
        nodes, normals = vertex_normals(mesh.points, boundary.facets[boundary.marker == index])
        expected = airfoils.inward_normals(mesh, marker)
        table = np.array([expected[node][: mesh.dim] for node in nodes])
        np.testing.assert_allclose(-normals, table, atol=1e-15)


def test_normals_of_triangles_are_those_of_the_median_dual_mesh():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 1, 0.1], [0.1, 0.2, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    mesh = sv.Mesh(
        points,
        sv.Cells.from_blocks([(10, [[0, 1, 2, 3]])]),
        (sv.Marker("all", sv.Cells.from_blocks([(5, faces)])),),
    )
    nodes, normals = vertex_normals(mesh.points, find_boundary(mesh).facets)
    expected = airfoils.inward_normals(mesh, mesh.markers[0])
    np.testing.assert_allclose(-normals, [expected[node] for node in nodes], atol=1e-15)


@pytest.mark.parametrize(
    ("kinds", "params", "values", "moving", "said"),
    [
        (
            "HICKS_HENNE, TRANSLATION",
            "(1, 0.5); (0, 1, 0)",
            (0.02, 0.1),
            (True, False),
            (
                "variable 2 (TRANSLATION) of DV_KIND will have no effect, as in SU2: its motion is "
                "lost,"
            ),
        ),
        ("TRANSLATION, HICKS_HENNE", "(0, 1, 0); (1, 0.5)", (0.1, 0.02), (True, True), ""),
        (
            "SURFACE_BUMP, CST, ROTATION, HICKS_HENNE",
            "(0, 1, 0.5); (1, 1, 3); (0, 0, 0, 0, 0, 1); (1, 0.3)",
            (0.02, 0.03, 4.0, 0.01),
            (True, False, False, False),
            (
                "variables 2 (CST), 3 (ROTATION), 4 (HICKS_HENNE) of DV_KIND will have no effect, "
                "as in"
            ),
        ),
        (
            "HICKS_HENNE, SURFACE_BUMP, HICKS_HENNE_CAMBER",
            "(1, 0.3); (0, 1, 0.4); (0.5)",
            (0.02, 0.03, 0.1),
            (True, True, False),
            (
                "variable 3 (HICKS_HENNE_CAMBER) of DV_KIND will have no effect, as in SU2: "
                "HICKS_HENNE_"
            ),
        ),
        (
            "ANGLE_OF_ATTACK, SCALE",
            "(1.0); (1.0)",
            (2.0, 1.1),
            (False, True),
            "ANGLE_OF_ATTACK moves no node; add 2 degrees, its value times OPT_RELAX_FACTOR, to",
        ),
        (
            "SCALE_GRID, TRANSLATE_GRID",
            "(1.0); (1, 0, 0)",
            (1.1, 0.1),
            (True, False),
            (
                "variable 2 (TRANSLATE_GRID) of DV_KIND will have no effect, as in SU2: SCALE_GRID "
                "is"
            ),
        ),
    ],
)
def test_order_of_passes_is_that_of_su2(kinds, params, values, moving, said, here):
    found = surface(
        bent(),
        ("airfoil",),
        f"DV_KIND= {kinds}\nDV_PARAM= {params}\nDV_VALUE= {values_text(values)}\n",
    )
    assert found.idle == tuple(not one for one in moving)
    total = np.zeros_like(found.displacement)
    for kind, group, value, moves in zip(
        kinds.split(", "), params.split("; "), values, moving, strict=True
    ):
        if moves:
            alone = f"DV_KIND= {kind}\nDV_PARAM= {group}\nDV_VALUE= {value}\n"
            total += surface(bent(), ("airfoil",), alone).displacement
    np.testing.assert_allclose(found.displacement, total, atol=1e-15)
    assert any(str(one).startswith(said) for one in found.case().warnings) or not said
    assert bool(found.case().warnings) == bool(said)


GRID = {
    "TRANSLATE_GRID": ("(3, 4, 0)", 0.5, lambda x: x + np.array([0.3, 0.4])),
    "ROTATE_GRID": ("(1, 2, 0, 1, 2, 1)", 90.0, lambda x: np.stack([3 - x[:, 1], 1 + x[:, 0]], 1)),
    "SCALE_GRID": ("(1.0)", 1.5, lambda x: 1.5 * x),
}


@pytest.mark.parametrize("kind", GRID)
def test_grid_kinds_move_every_node(kind, here, capsys):
    params, value, formula = GRID[kind]
    mesh = bent()
    sv.write("mesh.su2", mesh)
    text = "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nSOLUTION_ADJ_FILENAME= adj\n"
    text += f"DV_KIND= {kind}\nDV_PARAM= {params}\nDV_VALUE= VALUES\n"
    points = written(text.replace("VALUES", str(value)))
    np.testing.assert_allclose(points, formula(mesh.points), atol=1e-14)
    weights = np.random.default_rng(5).normal(size=points.shape)
    expected = differences(text, [value], weights, [1e-4])
    write_csv("adj_cd.csv", points, weights)
    Path("dot.cfg").write_text(text.replace("VALUES", str(value)))
    assert run(["dot", "dot.cfg", "-q", "--json", "dot.json"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=1e-7)
    assert json.loads(Path("dot.json").read_text())["at"] == "design"
    write_csv("adj_cd.csv", mesh.points, weights)
    assert run(["dot", "dot.cfg", "-q", "--json", "dot.json"]) == 0
    assert json.loads(Path("dot.json").read_text())["at"] == "mesh"
    table = np.loadtxt("surface_sensitivity.dat", delimiter=",")
    np.testing.assert_allclose(table[:, :2], mesh.points, atol=1e-14)
    np.testing.assert_array_equal(table[:, 3:5], weights)


def test_grid_kinds_move_a_halo_with_the_mesh(here, capsys):
    plain = sector(6, 30.0)
    turn = np.array([[0.0, 0, 0], [0, 0, np.pi / 6], [0, 0, 0]])
    Path("mesh.su2").write_text(halo_text(plain, "per1", "per2", turn))
    text = "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nDV_KIND= ROTATE_GRID\n"
    text += "DV_PARAM= (0.5, 0, 0, 0.5, 0, 1)\nDV_VALUE= 90\n"
    mesh = sv.read("mesh.su2")
    assert mesh.halo is not None
    moved = written(text)
    x, y = mesh.points.T
    np.testing.assert_allclose(moved, np.stack([0.5 - y, x - 0.5], axis=1), atol=1e-14)
    assert (
        "of the halo in mesh.su2 (SEND_RECEIVE) stay as they are; they" in capsys.readouterr().err
    )


SHAPES = """\
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
SOLUTION_ADJ_FILENAME= adj
DV_MARKER= (airfoil)
OPT_RELAX_FACTOR= 0.5
DATA_REDUCTION= NO
DV_KIND= TRANSLATION, HICKS_HENNE, HICKS_HENNE, CST, SURFACE_BUMP, ANGLE_OF_ATTACK
DV_PARAM= (0, 1, 0); (1, 0.3); (0, 0.6); (1, 2, 4); (0.1, 0.8, 0.4); (1.0)
DV_VALUE= VALUES
"""


@pytest.mark.parametrize("kinds", ["shapes", "camber"])
def test_gradients_are_those_of_central_differences(kinds, here, capsys):
    mesh, text, values = bent(), SHAPES, [0.01, 0.02, -0.03, 0.02, 0.01, 0.5]
    if kinds == "camber":
        text = SHAPES.partition("DV_KIND")[0] + (
            "DV_KIND= HICKS_HENNE_CAMBER, HICKS_HENNE_CAMBER\nDV_PARAM= (0.2); (0.5)\n"
            "DV_VALUE= VALUES\n"
        )
        values = [0.02, -0.01]
    sv.write("mesh.su2", mesh)
    weights = np.random.default_rng(6).normal(size=mesh.points.shape)
    expected = differences(text, values, weights, [1e-5] * len(values))
    text = text.replace("VALUES", values_text(values))
    write_csv("adj_cd.csv", written(text), weights, extra="AOA= 1.25\nSENS_AOA= 0.0625\n")
    Path("dot.cfg").write_text(text)
    capsys.readouterr()
    assert run(["dot", "dot.cfg"]) == 0
    assert "no SENS_AOA" not in capsys.readouterr().err
    if kinds == "shapes":
        expected[-1] = 0.0625  # SU2's own, which says what the flow does
    np.testing.assert_allclose(gradient(), expected, rtol=2e-6, atol=1e-8)


def test_gradient_for_the_angle_that_the_restart_lacks_is_told(here, capsys):
    mesh = bent()
    sv.write("mesh.su2", mesh)
    text = SHAPES.partition("DV_KIND")[0] + (
        "DV_KIND= HICKS_HENNE, ANGLE_OF_ATTACK\nDV_PARAM= (1, 0.5); (1.0)\nDV_VALUE= 0.0, 1.0\n"
    )
    Path("dot.cfg").write_text(text)
    write_csv("adj_cd.csv", mesh.points, np.ones_like(mesh.points))
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert "adj_cd.csv has no SENS_AOA= (SU2's text files have it): 0" in capsys.readouterr().err
    assert gradient()[1] == 0.0


@pytest.mark.parametrize(
    ("kind", "numbers", "message"),
    [
        ("HICKS_HENNE", (1, 1.0), r"a\.cfg: variable 1 \(HICKS_HENNE\): the peak is at x = 1; it"),
        ("HICKS_HENNE_CAMBER", "(0.0)", "the peak is at x = 0; it must lie between 0 and 1"),
        ("SURFACE_BUMP", (0.2, 0.5, 0.6), "the peak is at x = 0.6; it must lie between 0.2 and 0"),
        ("CST", (1, 4, 3), "CST term 4 of 3 is out of range; write whole numbers"),
        (
            "NACA_4DIGITS",
            (2, 0, 12),
            r"\(NACA_4DIGITS\): the second digit is 0; the largest camber",
        ),
        ("PARABOLIC", (1.0, 12), r"\(PARABOLIC\): the centre is 1; it must not be 0 or 1"),
        ("PARABOLIC", (1e300, 2), "1e.300. is too large to compute with; expected a number up to"),
        ("PARABOLIC", (1e-320, 2), "a.cfg: the variables move nodes too far for the arithmetic"),
        ("CST", (1, 2, 101), "CST term 2 of 101 is out of range; .* k <= n <= 100"),
        (
            "TRANSLATE_GRID",
            (0, 0, 0),
            r"\(TRANSLATE_GRID\): its direction has no length; give e.g. ",
        ),
    ],
)
def test_parameters_that_make_no_shape_are_refused(kind, numbers, message, here):
    text = f"DV_KIND= {kind}\nDV_PARAM= {numbers}\nDV_VALUE= 0.1\n"
    with pytest.raises(CaseError, match=message):
        _ = surface(bent(), ("airfoil",), text).displacement


def test_a_chord_along_y_has_no_camber(here):
    mesh = bent()
    turned = mesh.with_points(mesh.points[:, ::-1] * [1, -1])
    straight = turned.with_points(
        np.where(np.abs(turned.points) < 1.05, turned.points * [0, 1], turned.points)
    )
    text = "DV_KIND= HICKS_HENNE_CAMBER\nDV_PARAM= (0.5)\nDV_VALUE= 0.1\n"
    with pytest.raises(CaseError, match="HICKS_HENNE_CAMBER: the chord of DV_MARKER is along y"):
        _ = surface(straight, ("airfoil",), text).displacement


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        (
            "NACA_4DIGITS, NACA_4DIGITS",
            "NACA_4DIGITS cannot be combined with others; make two runs",
        ),
        ("HICKS_HENNE_CAMBER, SCALE", "HICKS_HENNE_CAMBER can be combined with its own kind only"),
    ],
)
def test_lists_that_su2_refuses_are_refused(kinds, message, here):
    params = {"NACA_4DIGITS": "(2, 4, 12)", "HICKS_HENNE_CAMBER": "(0.5)", "SCALE": "(1.0)"}
    group = "; ".join(params[kind] for kind in kinds.split(", "))
    with pytest.raises(CaseError, match=message):
        surface(bent(), ("airfoil",), f"DV_KIND= {kinds}\nDV_PARAM= {group}\nDV_VALUE= 1, 1\n")


def test_a_chord_that_is_not_that_of_su2_is_warned_about(here):
    henne = "DV_KIND= HICKS_HENNE\nDV_PARAM= (1, 0.5)\nDV_VALUE= 0.1\n"
    camber = "DV_KIND= HICKS_HENNE_CAMBER\nDV_PARAM= (0.5)\nDV_VALUE= 0.1\n"
    assert not surface(bent(), ("airfoil",), henne).warnings
    assert not surface(bent(), ("airfoil",), camber).warnings
    small = bent().with_points(0.3 * bent().points)
    (said,) = surface(small, ("airfoil",), henne).warnings
    assert str(said) == (
        "HICKS_HENNE: the chord is x from 0 to 1, as in SU2, and DV_MARKER goes from 0 to 0.3; "
        "scale the mesh to that, by 1 / 0.3, or write MOTION= (airfoil, hicks-henne, upper, 0.5, "
        "0.1, 0.0, 0.3) into a case file (slideviz run)"
    )
    (said,) = surface(small, ("airfoil",), camber).warnings
    assert str(said).startswith(
        "HICKS_HENNE_CAMBER: the chord is 1 long from the leading edge, as in"
    )
    # Where the marker begins at the nose, SU2 takes that for the trailing edge.
    mesh = bent()
    lines = np.roll(mesh.marker("airfoil").cells.by_type[3][1], 12, axis=0)
    part = sv.Marker("airfoil", sv.Cells.from_blocks([(3, lines)]))
    turned = replace(mesh, markers=(part, mesh.marker("far")))
    (said,) = surface(turned, ("airfoil",), camber).warnings
    assert "it begins its search at the first node of the marker" in str(said)


@pytest.mark.parametrize(
    ("kind", "parameters"), [("HICKS_HENNE", "0, 0.3"), ("CST", "1, 2, 4"), ("CST", "0, 1, 3")]
)
def test_the_motion_that_a_doubt_names_is_that_of_the_variable_on_a_longer_chord(
    kind, parameters, here
):
    text = f"DV_KIND= {kind}\nDV_PARAM= ({parameters})\nDV_VALUE= 0.01\n"
    unit = surface(bent(), ("airfoil",), text + "OPT_RELAX_FACTOR= 0.5\n")
    mesh = bent().with_points(120.0 * bent().points)
    large = text.replace("0.01", "1.2") + "OPT_RELAX_FACTOR= 0.5\n"
    (doubt,) = surface(mesh, ("airfoil",), large).warnings
    (motion,) = read_motions(doubt.remedy.partition("MOTION= ")[2].partition(" into")[0])
    roles = {"airfoil": "moving"}
    found = displacements(sv.Case(roles=roles, motions=(motion,)), mesh)
    np.testing.assert_allclose(found.vectors, 120.0 * unit.displacement, atol=1e-9)


def test_an_error_begins_with_the_doubt_that_may_be_its_cause(here):
    mesh = bent().with_points(120.0 * bent().points)
    moved = surface(mesh, ("airfoil",), "DV_KIND= CST\nDV_PARAM= (1, 1, 2)\nDV_VALUE= 50\n")
    with pytest.raises(CaseError, match=r"\ACST: the chord is x from 0 (.|\n)*through far near"):
        list(sv.deform(moved.case(), mesh))
    roles = {"airfoil": "moving"}
    case = sv.Case(roles=roles, motions=(sv.Cst("airfoil", 1e5, chord=(0.0, 60.0)),))
    with pytest.raises(CaseError) as caught:
        list(sv.deform(case, mesh))
    assert len(caught.value.messages) == 1  # half of the airfoil may be meant
    case = sv.Case(roles=roles, motions=(sv.Cst("airfoil", 1e5, chord=(0.0, 6.0)),))
    with pytest.raises(CaseError, match=r"\Amotion 1: the chord goes (.|\n)*through far near"):
        list(sv.deform(case, mesh))


def test_an_error_of_a_deformer_begins_with_the_doubt_that_may_be_its_cause(here):
    mesh = bent().with_points(120.0 * bent().points)
    motion = sv.Cst("airfoil", 0.05, chord=(0.0, 0.001))
    with pytest.raises(CaseError, match=r"\Amotion 1: the chord goes .*\n.* no node of 'airfoil'"):
        sv.Deformer(mesh, sv.Case(roles={"airfoil": "moving"}, motions=(motion,)))


def test_an_angle_of_attack_alone_moves_nothing_and_has_its_gradient(here, capsys):
    sv.write("mesh.su2", bent())
    text = SHAPES.partition("DATA_REDUCTION")[0] + (
        "DATA_REDUCTION= YES\nDV_KIND= ANGLE_OF_ATTACK\nDV_PARAM= (1.0)\nDV_VALUE= 2.0\n"
    )
    points = written(text)
    np.testing.assert_array_equal(points, bent().points)
    write_csv("adj_cd.csv", points, np.ones_like(points), extra="SENS_AOA= 0.25\n")
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert gradient().tolist() == [0.25]
    assert np.loadtxt("surface_sensitivity.dat", delimiter=",")[:, 3:5].any()


def test_ignored_variables_have_no_gradient(here, capsys):
    sv.write("mesh.su2", bent())
    text = SHAPES.partition("DATA_REDUCTION")[0] + (
        "DV_KIND= SCALE_GRID, ANGLE_OF_ATTACK, SURFACE_FILE\nDV_PARAM= (); (1.0); ()\n"
        "DV_VALUE= 1.0, 2.0, 0.0\n"
    )
    points = written(text)
    assert "to AOA of the flow" not in capsys.readouterr().err
    write_csv("adj_cd.csv", points, np.ones_like(points), extra="SENS_AOA= 0.25\n")
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    assert gradient()[0] != 0.0
    assert gradient()[1:].tolist() == [0.0, 0.0]


def test_a_refused_design_names_the_factor_of_its_values(here, capsys):
    sv.write("mesh.su2", bent())
    text = SHAPES.partition("OPT_RELAX")[0] + "DV_KIND= HICKS_HENNE\nDV_PARAM= (1, 0.5)\n"
    for factor, value in (("1E3", "1.0"), ("1", "1E3")):
        Path("a.cfg").write_text(f"{text}DV_VALUE= {value}\nOPT_RELAX_FACTOR= {factor}\n")
        assert run(["def", "a.cfg", "-q"]) == 1
        lines = capsys.readouterr().err.splitlines()
        assert "the motion puts airfoil through far near" in lines[0]
        said = "a.cfg: OPT_RELAX_FACTOR= 1000 multiplies all values of DV_VALUE"
        assert lines[1:] == ([said] if factor == "1E3" else [])


def test_deform_mesh_is_warned_about(here):
    text = f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\nDEFORM_MESH= YES\n"
    Path("a.cfg").write_text(text)
    (said,) = read_config(Path("a.cfg")).case.warnings
    assert said.startswith("DEFORM_MESH= YES: SU2 would ignore the design variables; here they")


def test_no_deformation_writes_the_mesh_back(here):
    sv.write("mesh.su2", bent())
    Path("a.cfg").write_text(
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nDV_KIND= NO_DEFORMATION\n"
        "DV_PARAM= (1.0)\nDV_VALUE= 0.0\n"
    )
    assert run(["def", "a.cfg", "-q"]) == 0
    assert Path("out.su2").read_bytes() == Path("mesh.su2").read_bytes()


def test_lines_of_rotations_in_3d_are_their_own_though_su2_mixes_them(here):
    text = (
        "DV_KIND= ROTATION, ROTATION\nDV_PARAM= (0, 0, 0, 1, 0, 0); (0, 0, 0.5, 0, 1, 0.5)\n"
        "DV_VALUE= 5, 0\n"
    )
    found = surface(ball(), ("sphere",), text)
    said = "SU2 turns all ROTATION about lines through the z0 of the first variable; here each"
    assert any(str(one).startswith(said) for one in found.warnings)


def test_radial_functions_of_su2_are_used(here, capsys):
    """SU2's own test case, which needs 26 control nodes there."""
    unpacked("naca0012_inv.su2")
    Path("a.cfg").write_text(
        "MARKER_EULER= ( airfoil )\nMARKER_FAR= ( farfield )\nDV_KIND= HICKS_HENNE\n"
        "DV_MARKER= ( airfoil )\nDV_PARAM= ( 1, 0.5 )\nDV_VALUE= 0.1\nDEFORM_KIND= RBF\n"
        "RADIAL_BASIS_FUNCTION_PARAMETER= 2\nRBF_DATA_REDUCTION= YES\nRBF_GREEDY_TOLERANCE= 1E-3\n"
        "MESH_FILENAME= naca0012_inv.su2\nMESH_OUT_FILENAME= out.su2\n"
    )
    assert run(["def", "a.cfg", "-q", "--json", "a.json"]) == 0
    report = json.loads(Path("a.json").read_text())
    assert report["control_nodes"][-1] <= 26
    assert report["design"]["ignored"] == ["MARKER_EULER", "MARKER_FAR"]
    mesh, moved = sv.read("naca0012_inv.su2"), sv.read("out.su2")
    for node, shift in airfoils.displaced(mesh, ("airfoil",), "HICKS_HENNE", (1, 0.5), 0.1).items():
        np.testing.assert_allclose(moved.points[node], mesh.points[node] + shift, atol=1e-15)


RADIAL = {
    "DEFORM_KIND= RBF\nRADIAL_BASIS_FUNCTION_PARAMETER= 2": {"support_radius": 2.0},
    "RADIAL_BASIS_FUNCTION_PARAMETER= 2": {"support_radius": None},
    "DEFORM_KIND= RBF\nRADIAL_BASIS_FUNCTION_PARAMETER= 2\nSUPPORT_RADIUS= 3": {
        "support_radius": 3.0
    },
    "DEFORM_KIND= RBF\nKIND_RADIAL_BASIS_FUNCTION= MULTI_QUADRIC\n"
    "RADIAL_BASIS_FUNCTION_PARAMETER= 0.5": {"kernel": "multiquadric", "support_radius": 10.0},
    "DEFORM_KIND= RBF\nKIND_RADIAL_BASIS_FUNCTION= GAUSSIAN\nRBF_KERNEL= wendland-c4": {
        "kernel": "wendland-c4"
    },
    "DEFORM_KIND= RBF\nDEFORM_NONLINEAR_ITER= 4": {"steps": 4},
    "DEFORM_NONLINEAR_ITER= 4": {"steps": 1},
    "RBF_DATA_REDUCTION= NO": {"reduction": None},
    "RBF_DATA_REDUCTION= YES\nRBF_GREEDY_TOLERANCE= 1e-5\nRBF_GREEDY_CORRECTION_FACTOR= 30": {
        "reduction": sv.Reduction(tolerance=1e-5, gamma=30.0, selection="one")
    },
    "RBF_GREEDY_TOLERANCE= 1e-5\nDATA_REDUCTION= NO": {"reduction": None},
}


@pytest.mark.parametrize("text", RADIAL)
def test_settings_of_radial_functions_are_those_of_su2(text, here):
    Path("a.cfg").write_text(f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\n{text}\n")
    found = read_config(Path("a.cfg"))
    assert {name: getattr(found.case, name) for name in RADIAL[text]} == RADIAL[text]
    used = "DEFORM_KIND" in text or "RBF_" in text
    assert found.ignored == (() if used else (text.partition("=")[0],))


def test_multiquadrics_of_su2_and_ours_are_proportional(here):
    from tests.oracles.kernels import KERNELS

    Path("a.cfg").write_text(
        f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1\nDEFORM_KIND= RBF\nRADIAL_BASIS_FUNCTION_PARAMETER= 3\n"
        "KIND_RADIAL_BASIS_FUNCTION= INV_MULTI_QUADRIC\n"
    )
    case = read_config(Path("a.cfg")).case
    distance = np.linspace(0.0, 9.0, 7)
    expected = 1.0 / np.sqrt(1.0 + (distance / 3.0) ** 2)
    np.testing.assert_allclose(KERNELS[case.kernel](distance / case.support_radius), expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("DEFORM_KIND= SPRING", r"a.cfg:6: DEFORM_KIND: 'SPRING' is not one of ELASTIC \| RBF"),
        ("DEFORM_KIND= RBF\nRADIAL_BASIS_FUNCTION_PARAMETER= -1", "FUNCTION_PARAMETER: -1 is out"),
        ("RBF_GREEDY_TOLERANCE= x", "RBF_GREEDY_TOLERANCE: 'x' is not a number"),
        (
            "DEFORM_KIND= RBF\nKIND_RADIAL_BASIS_FUNCTION= CUBIC",
            r"KIND_RADIAL_BASIS_FUNCTION: 'CUBIC' is not one of WENDLAND_C2 \| ",
        ),
    ],
)
def test_wrong_settings_of_radial_functions_are_told(text, message, here):
    Path("a.cfg").write_text(f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\n{text}\n")
    with pytest.raises(CaseError, match=message):
        read_config(Path("a.cfg"))


def test_elasticity_that_su2_is_asked_for_is_noted(here):
    Path("a.cfg").write_text(f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\nDEFORM_KIND= ELASTIC\n")
    (said,) = read_config(Path("a.cfg")).case.warnings
    assert str(said).startswith(
        "DEFORM_KIND= ELASTIC: radial functions move the mesh nevertheless; wr"
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ("SOLID_WALL_DISTANCE", 1e6, 1)),
        (
            "DEFORM_STIFFNESS_TYPE= INVERSE_VOLUME\nDEFORM_COEFF= 0.3\nDEFORM_NONLINEAR_ITER= 4\n",
            ("INVERSE_VOLUME", 0.3, 4),
        ),
        ("DEFORM_STIFFNESS_TYPE= WALL_DISTANCE\nSTEPS= 2\n", ("SOLID_WALL_DISTANCE", 1e6, 2)),
    ],
)
def test_elasticity_of_a_configuration_is_that_of_su2(text, expected, here):
    Path("a.cfg").write_text(f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\n{text}")
    own, others = own_changes(["METHOD=elastic", "LAYERS=NO"])
    assert (own, others) == ({"METHOD": "elastic"}, ["LAYERS=NO"])
    found = read_config(Path("a.cfg"), own)
    case = found.case
    assert (case.deform_stiffness_type, case.deform_coeff, case.steps) == expected
    assert found.ignored == ()
    plain = read_config(Path("a.cfg"))  # SU2's keys are not for radial functions
    assert (plain.case.deform_coeff, plain.case.steps) == (0.3, 2 if "STEPS" in text else 1)
    assert set(plain.ignored) == {line.split("=")[0] for line in text.split() if "DEFORM" in line}


def test_wrong_elasticity_of_a_configuration_is_told(here):
    Path("a.cfg").write_text(f"{HEAD}DV_KIND= SCALE\nDV_VALUE= 1.1\nDEFORM_COEFF= 0.6\n")
    assert read_config(Path("a.cfg")).ignored == ("DEFORM_COEFF",)
    with pytest.raises(CaseError, match=r"a.cfg:6: DEFORM_COEFF: 0.6 is out of range; expected"):
        read_config(Path("a.cfg"), {"METHOD": "elastic"})


def turned(points, numbers, degrees):
    """Points turned about the line through two points; the angle may be complex."""
    first, second = np.array(numbers).reshape(2, 3)
    unit = (second - first) / np.linalg.norm(second - first)
    angle, arm = np.pi / 180.0 * degrees, points - first
    along = (arm @ unit)[:, None] * unit
    across = np.cross(unit, arm)
    return first + np.cos(angle) * arm + (1.0 - np.cos(angle)) * along + np.sin(angle) * across


@pytest.mark.parametrize("kind", ["ROTATION", "ROTATE_GRID"])
def test_rotations_and_their_rates_are_those_of_a_complex_step(kind, here):
    numbers, value = (0.1, -0.2, 0.3, 1.0, 0.5, -0.4), 25.0
    text = f"DV_KIND= {kind}\nDV_PARAM= {numbers}\nDV_VALUE= {value}\nOPT_RELAX_FACTOR= 0.8\n"
    found = surface(ball(), ("sphere",), text)
    points = found.mesh.points[found.nodes]
    expected = turned(points, numbers, 0.8 * value)
    np.testing.assert_allclose(points + found.displacement, expected, atol=1e-15)
    rate = turned(points, numbers, 0.8 * (value + 1e-30j)).imag / 1e-30
    np.testing.assert_allclose(found.slope(0), rate, atol=1e-16)
    still = turned(points, numbers, 0.8e-30j).imag / 1e-30
    np.testing.assert_allclose(found.slope(0, undeformed=True), still, atol=1e-16)
