"""SU2's FFD variables by ``def`` and ``dot``: all kinds, coordinates, nesting, limits."""

import json
import lzma
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.motions.box import defined_boxes
from slideviz.cli import run
from slideviz.design.su2.config import read_config
from slideviz.design.su2.surface import held_planes, make_surface
from slideviz.errors import CaseError
from slideviz.ffd.box import CoordinateSystem
from slideviz.ffd.section import boxes_of
from tests.builders import cube, square
from tests.design.test_su2_dot import differences, gradient, values_text, write_csv, written
from tests.oracles.freeform import blended, moved

REAL = Path(__file__).parents[2] / ".." / "shared" / "meshes"


def corners(low, high):
    """The 24 numbers of a box between two points."""
    x, y, z = zip(low, high, strict=True)
    at = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    return ", ".join(f"{x[a]}, {y[b]}, {z[c]}" for a, b, c in at)


HEAD = f"""
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
SOLUTION_ADJ_FILENAME= adj
DATA_REDUCTION= NO
DV_MARKER= (BLOCK)
OPT_RELAX_FACTOR= 0.5
REF_LENGTH= 1.6
FFD_DEFINITION= (BOX, {corners((-0.1, 0.1, 0.1), (1.1, 0.95, 0.9))})
FFD_DEGREE= (3, 4, 2)
"""
LINE = "0.3, 0.1, 0.4, 0.4, 0.9, 0.5"
VARIABLES = {
    "FFD_TWIST": (f"(BOX, 2, {LINE})", 0.2),
    "FFD_CAMBER": ("(BOX, 1, 2)", 0.1),
    "FFD_ROTATION": (f"(BOX, {LINE})", 8.0),
    "FFD_THICKNESS": ("(BOX, 2, 2)", 0.1),
    "FFD_CONTROL_SURFACE": (f"(BOX, {LINE})", 9.0),
    "FFD_GULL": ("(BOX, 2)", -0.05),
    "FFD_NACELLE": ("(BOX, 1, 1, -1, 0.3, 0.2)", 0.2),
    "FFD_CAMBER_2D": ("(BOX, 1)", 0.04),
    "FFD_THICKNESS_2D": ("(BOX, 2)", 0.05),
    "FFD_CONTROL_POINT": ("(BOX, 1, -1, 1, 0.1, 0.4, 0.2)", 0.1),
    "FFD_CONTROL_POINT_2D": ("(BOX, 2, 1, 0.3, 0.1)", 0.1),
    "FFD_ANGLE_OF_ATTACK": ("(BOX, 1.0)", 2.0),
}
VALUES = [value for _, value in VARIABLES.values()]
ALL = (
    f"DV_KIND= {', '.join(VARIABLES)}\nDV_VALUE= VALUES\n"
    f"DV_PARAM= {'; '.join(parameters for parameters, _ in VARIABLES.values())}\n"
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", cube(4))
    return tmp_path


def surface(text, mesh=None):
    Path("a.cfg").write_text(text)
    read = read_config(Path("a.cfg"))
    return make_surface(read, mesh or sv.read("mesh.su2"))


def parsed(kind):
    """Index and other parameters of a variable of the list."""
    words = VARIABLES[kind][0].strip("()").split(", ")[1:]
    count = {"FFD_TWIST": 1, "FFD_GULL": 1, "FFD_CAMBER": 2, "FFD_THICKNESS": 2}.get(kind)
    count = {"FFD_NACELLE": 3, "FFD_CONTROL_POINT": 3, "FFD_CONTROL_POINT_2D": 2}.get(kind, count)
    count = 1 if kind in ("FFD_CAMBER_2D", "FFD_THICKNESS_2D") else count or 0
    return tuple(map(int, words[:count])), tuple(map(float, words[count:]))


def test_all_kinds_of_a_list_act_one_after_the_other(here):
    found = surface(HEAD + ALL.replace("VALUES", values_text(VALUES)))
    box = found.displacer.boxes[0]
    points = box.points
    for kind, (_, value) in VARIABLES.items():
        points = moved(kind, *parsed(kind), (value,), points, relax=0.5, length=1.6)
    low, high = box.points[0, 0, 0], box.points[-1, -1, -1]
    for node, by in zip(found.nodes, found.displacement, strict=True):
        at = found.mesh.points[node]
        right = blended(points, (at - low) / (high - low)) - at
        np.testing.assert_allclose(by, right, rtol=0, atol=1e-14)
    assert found.idle == (False,) * 11 + (True,)
    (angle,) = found.warnings
    assert "FFD_ANGLE_OF_ATTACK moves no node; add 1 degrees, its value times" in angle
    after = boxes_of(found.boxed(found.mesh))[0]
    np.testing.assert_allclose(after.points, points, rtol=0, atol=1e-14)


def check_gradient(text, values, step=1e-5, rtol=2e-6):
    """Compare the gradient of ``dot`` with central differences of ``def``; return it."""
    weights = np.random.default_rng(3).normal(size=sv.read("mesh.su2").points.shape)
    expected = differences(text, values, weights, [step * max(1.0, abs(v)) for v in values])
    text = text.replace("VALUES", values_text(values))
    write_csv("adj_cd.csv", written(text), weights, extra="SENS_AOA= 0\n")
    Path("dot.cfg").write_text(text)
    assert run(["dot", "dot.cfg", "-q"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=rtol, atol=1e-8)
    return expected


def test_gradient_of_all_kinds_is_that_of_central_differences(here):
    assert np.count_nonzero(check_gradient(HEAD + ALL, VALUES)) == 11


def test_gradient_at_the_undeformed_mesh(here):
    zeros, weights = [0.0] * 12, np.random.default_rng(4).normal(size=(len(cube(4).points), 3))
    expected = differences(HEAD + ALL, zeros, weights, [1e-5] * 12)
    Path("dot.cfg").write_text((HEAD + ALL).replace("VALUES", values_text(VALUES)))
    write_csv("adj_cd.csv", sv.read("mesh.su2").points, weights, extra="SENS_AOA= 0\n")
    assert run(["dot", "dot.cfg", "-q"]) == 0
    np.testing.assert_allclose(gradient(), expected, rtol=2e-6, atol=1e-8)


SYSTEMS = {
    "CYLINDRICAL": "(0.2, -1.0, 0.45)",
    "SPHERICAL": "(-0.6, -1.0, 0.45)",
    "POLAR": "(-0.6, -1.0, 0.45)",
}


def curved(kind):
    """A configuration with the box about the block in other coordinates."""
    origin = tuple(float(word) for word in SYSTEMS[kind].strip("()").split(", "))
    system = CoordinateSystem(kind, origin)
    q = system.q_of(cube(4).points[cube(4).marker("BLOCK").nodes])
    low, high = q.min(axis=0) - 0.1, q.max(axis=0) + 0.12
    ends = np.array(corners(low, high).split(", "), float).reshape(8, 3)
    numbers = ", ".join(map(repr, system.points_of(ends).ravel().tolist()))
    head = HEAD.partition("FFD_DEFINITION")[0]
    return (
        system,
        low,
        high,
        head
        + (
            f"FFD_DEFINITION= (BOX, {numbers})\nFFD_DEGREE= (3, 4, 2)\n"
            f"FFD_COORD_SYSTEM= {kind}\nFFD_AXIS= {SYSTEMS[kind]}\n"
        ),
    )


@pytest.mark.parametrize("kind", SYSTEMS)
def test_boxes_in_other_coordinates_are_set_and_deform(kind, here):
    system, low, high, head = curved(kind)
    Path("set.cfg").write_text(head + "DV_KIND= FFD_SETTING\n")
    assert run(["def", "set.cfg", "-q"]) == 0
    Path("out.su2").rename("mesh.su2")
    found = surface(head + ALL.replace("VALUES", values_text(VALUES)))
    box = found.displacer.boxes[0]
    assert box.embedded
    points = box.q
    for name, (_, value) in VARIABLES.items():
        index, numbers = parsed(name)
        points = moved(
            name, index, numbers, (value,), points, relax=0.5, length=1.6, polar=kind == "POLAR"
        )
    for node, by in zip(found.nodes, found.displacement, strict=True):
        at = found.mesh.points[node]
        uvw = (system.q_of(at[None])[0] - low) / (high - low)
        right = system.points_of(blended(points, uvw)) - at
        np.testing.assert_allclose(by, right, rtol=0, atol=1e-12)
    after = boxes_of(found.boxed(found.mesh), system)[0]
    np.testing.assert_allclose(after.q, points, rtol=0, atol=1e-12)


def test_gradient_in_cylindrical_coordinates(here):
    check_gradient(curved("CYLINDRICAL")[-1] + ALL, VALUES)


POLAR = """
MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
SOLUTION_ADJ_FILENAME= adj
DATA_REDUCTION= NO
DV_MARKER= (BLOCK)
FFD_DEFINITION= (BOX, 0.1, 0.2, 0, 0.1, 0.9, 0, 0.9, 0.9, 0, 0.9, 0.2, 0, 0,0,0,0,0,0,0,0,0,0,0,0)
FFD_DEGREE= (3, 2, 0)
FFD_COORD_SYSTEM= POLAR
FFD_AXIS= (0.5, -1.0, 0.0)
DV_KIND= KINDS
DV_PARAM= (BOX, 1, 1, 0.5, 0.2); (BOX, 2, 1, 0, 0)
DV_VALUE= VALUES
"""


def test_polar_boxes_in_2d_are_set_and_deform_as_in_su2(here):
    sv.write("mesh.su2", square(8))
    text = POLAR.replace("KINDS", "FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D")
    values = [0.1, 0.02, -0.03]
    direct = surface(text.replace("VALUES", values_text(values))).displacement
    Path("set.cfg").write_text(
        text.replace("VALUES", "0").replace("KINDS", "").partition("DV_KIND")[0]
        + "DV_KIND= FFD_SETTING\n"
    )
    assert run(["def", "set.cfg", "-q"]) == 0
    said = Path("out.su2").read_text()
    assert "FFD_DEGREE_I= 3\nFFD_DEGREE_J= 2\n" in said
    rows = said.partition("FFD_CORNER_POINTS= 4\n")[2].splitlines()[:4]
    given = [[0.1, 0.2], [0.1, 0.9], [0.9, 0.9], [0.9, 0.2]]
    np.testing.assert_allclose([list(map(float, row.split())) for row in rows], given, atol=1e-15)
    Path("out.su2").rename("mesh.su2")
    found = surface(text.replace("VALUES", values_text(values)))
    np.testing.assert_allclose(found.displacement, direct, rtol=0, atol=1e-12)
    box = found.displacer.boxes[0]
    assert box.degrees == (3, 1, 2)
    points = moved("FFD_CONTROL_POINT_2D", (1, 1), (0.5, 0.2), (0.1,), box.q, polar=1)
    points = moved("FFD_CONTROL_POINT_2D", (2, 1), (0, 0), (0.02, -0.03), points, polar=1)
    inside = found.displacer.embedded["BOX"]
    for node, uvw in zip(inside.nodes, inside.uvw, strict=True):
        right = box.system.points_of(blended(points, uvw))
        np.testing.assert_allclose(right[2], 0.0, atol=1e-15)
        at = found.mesh.points[found.nodes[node]]
        np.testing.assert_allclose(found.displacement[node], right[:2] - at, rtol=0, atol=1e-12)
    (read,) = boxes_of(sv.read("mesh.su2"))
    assert read.degrees == (3, 1, 2)  # by its rows
    assert read.describe(2).startswith("degree 3 x 2, ")
    check_gradient(text, values)


NESTED = HEAD.partition("FFD_DEFINITION")[0] + (
    f"FFD_DEFINITION= (OUT, {corners((-0.1, 0.1, 0.1), (1.1, 0.95, 0.9))}); "
    f"(IN, {corners((0.2, 0.2, 0.2), (0.6, 0.8, 0.8))})\nFFD_DEGREE= (3, 2, 2); (2, 2, 1)\n"
)
FREE = "FFD_CONTINUITY= USER_INPUT\nFFD_FIX_I= (9)\nFFD_FIX_J= (9)\nFFD_FIX_K= (9)\n"
BOTH = """\
DV_KIND= FFD_ROTATION, FFD_CAMBER, FFD_CONTROL_POINT
DV_PARAM= (OUT, 0.3, 0.1, 0.4, 0.4, 0.9, 0.5); (OUT, 1, 1); (IN, 1, 1, 0, 0.2, 0.4, 0.3)
DV_VALUE= VALUES
"""


def nested(changes=()):
    """The mesh with two boxes, of which one is in the other."""
    Path("set.cfg").write_text(NESTED + "DV_KIND= FFD_SETTING\n")
    assert run(["def", "set.cfg", "-q"]) == 0
    first, tag, second = Path("out.su2").read_text().partition("FFD_TAG= IN\n")
    first = first.replace("FFD_NLEVEL= 1", "FFD_NLEVEL= 2")
    first = first.replace("FFD_CHILDREN= 0", "FFD_CHILDREN= 1\nIN")
    second = second.replace("FFD_LEVEL= 0", "FFD_LEVEL= 1")
    second = second.replace("FFD_PARENTS= 0", "FFD_PARENTS= 1\nOUT")
    text = first + tag + second
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    Path("mesh.su2").write_text(text)


def test_nested_boxes_are_read_deformed_and_written(here):
    nested()
    outer, inner = boxes_of(sv.read("mesh.su2"))
    assert (inner.level, inner.parent) == (1, "OUT")
    assert "in OUT" in inner.describe(3)
    values = [20.0, 0.2, 0.4]
    check_gradient(NESTED + BOTH, values)
    after = sv.read("out.su2")
    assert "FFD_PARENTS= 1\nOUT\n" in Path("out.su2").read_text()
    for box, before in zip(boxes_of(after), (outer, inner), strict=True):
        assert (box.points != before.points).any()
        nodes, uvw = box.embedded["BLOCK"]
        np.testing.assert_allclose(box.at(uvw), after.points[nodes], rtol=0, atol=1e-12)
        assert (uvw != before.embedded["BLOCK"][1]).any()
    # A second run goes on from there, without a warning that boxes and surface differ.
    Path("out.su2").rename("mesh.su2")
    assert surface(NESTED + FREE + BOTH.replace("VALUES", "0, 0, 0")).warnings == ()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FFD_NLEVEL= 2", "FFD_NLEVEL= 1", "FFD_LEVEL is 1; FFD_NLEVEL must be larger, and is 1"),
        (
            "FFD_PARENTS= 1\nOUT",
            "FFD_PARENTS= 1\nOTHER",
            "no FFD box 'OTHER', only OUT, IN",
        ),
        ("FFD_PARENTS= 1\nOUT", "FFD_PARENTS= 2\nOUT\nIN", "FFD_PARENTS is 2; supported is one"),
        ("FFD_LEVEL= 1", "FFD_LEVEL= 0", "FFD_LEVEL is 0, not above the level of its parent 'OUT'"),
        ("FFD_CHILDREN= 1\nIN", "FFD_CHILDREN= 0", "FFD_CHILDREN must list the boxes whose parent"),
        ("FFD_PARENTS= 1\nOUT", "FFD_PARENTS= 2\nOUT", "1 rows follow FFD_PARENTS= 2"),
    ],
)
def test_mistakes_of_nested_boxes_are_told(old, new, message, here, capsys):
    nested([(old, new)])
    Path("a.cfg").write_text(NESTED + BOTH.replace("VALUES", "1, 0, 0"))
    assert run(["def", "a.cfg", "-q"]) == 1
    assert message in capsys.readouterr().err


def test_nested_boxes_need_cartesian_coordinates_and_room(here, capsys):
    nested()
    text = NESTED + BOTH.replace("VALUES", "1, 0, 0")
    with pytest.raises(CaseError, match="'IN' is nested, which needs FFD_COORD_SYSTEM= CARTESIAN"):
        surface(text + "FFD_COORD_SYSTEM= CYLINDRICAL\nFFD_AXIS= (0, -3, 0.5)\n")
    with pytest.raises(CaseError, match=r"a\.cfg: the FFD box 'IN' folds over, or loses nodes"):
        surface(NESTED + BOTH.replace("VALUES", "1, 60, 0"))


def test_box_in_a_box_without_variables_or_nodes_moves_alone(here):
    nested()
    head, _, rest = Path("mesh.su2").read_text().partition("FFD_SURFACE_POINTS= ")
    Path("mesh.su2").write_text(
        head + "FFD_SURFACE_POINTS= 0\n" + "FFD_TAG= IN" + rest.partition("FFD_TAG= IN")[2]
    )
    one = "DV_KIND= FFD_CONTROL_POINT\nDV_PARAM= (IN, 1, 1, 0, 0.2, 0.4, 0.3)\nDV_VALUE= 0.4\n"
    found = surface(NESTED + FREE + one)
    inside = found.displacer.embedded["IN"]
    unit = moved("FFD_CONTROL_POINT", (1, 1, 0), (0.2, 0.4, 0.3), (0.2,), np.zeros((3, 3, 2, 3)))
    for node, uvw in zip(inside.nodes, inside.uvw, strict=True):
        np.testing.assert_allclose(found.displacement[node], blended(unit, uvw), atol=1e-14)
    outer, inner = boxes_of(found.boxed(found.mesh))
    np.testing.assert_array_equal(outer.points, boxes_of(found.mesh)[0].points)
    assert (inner.points != boxes_of(found.mesh)[1].points).any()


def test_nodes_of_boundaries_that_a_box_does_not_list_stay(here):
    sv.write("mesh.su2", square(8))
    corners_ = "0.2, 0.2, 0, 1.1, 0.2, 0, 1.1, 0.8, 0, 0.2, 0.8, 0" + ", 0" * 12
    text = HEAD.partition("FFD_DEFINITION")[0] + (
        f"FFD_DEFINITION= (BOX, {corners_})\nFFD_DEGREE= (2, 1, 0)\nFFD_CONTINUITY= USER_INPUT\n"
    )
    Path("set.cfg").write_text(text + "DV_KIND= FFD_SETTING\n")
    assert run(["def", "set.cfg", "-q"]) == 0
    Path("out.su2").rename("mesh.su2")
    text = text.replace("(BLOCK)", "(BLOCK, x_p)")
    found = surface(text + "DV_KIND= FFD_CAMBER_2D\nDV_PARAM= (BOX, 1)\nDV_VALUE= 0.1\n")
    moving = found.nodes[found.displacement.any(axis=1)]
    np.testing.assert_array_equal(moving, np.unique(found.mesh.marker("BLOCK").nodes))
    (said,) = found.warnings
    assert "5 nodes of x_p are inside the FFD box 'BOX', which lists none of that boundary" in said


def test_overlapping_boxes_give_nodes_to_the_last_one(here):
    # As two boxes of one level, IN takes its nodes from OUT.
    values = "20, 0.2, 0.4"
    found = surface(NESTED + FREE + BOTH.replace("VALUES", values))
    alone = surface(NESTED + BOTH.replace("VALUES", "0, 0, 0.4"))
    inside = found.displacer.embedded["IN"].nodes
    np.testing.assert_array_equal(found.displacement[inside], alone.displacement[inside])
    (said,) = found.warnings
    assert f"{len(inside)} nodes in the FFD box 'IN' are also in an earlier box; as in SU2" in said


def test_limits_of_su2_hold_and_have_exact_gradients(here, capsys):
    text = (
        HEAD
        + "DV_KIND= FFD_CAMBER, FFD_ROTATION\nDV_VALUE= VALUES\n"
        + (f"DV_PARAM= (BOX, 1, 2); (BOX, {LINE})\n")
    )
    bounded = text + "OPT_LINE_SEARCH_BOUND= 0.02\n"
    check_gradient(bounded, [0.2, 5.0])
    assert (
        "OPT_LINE_SEARCH_BOUND: the FFD box 'BOX' would move a node by" in capsys.readouterr().err
    )
    fold = (
        HEAD + "DV_KIND= FFD_CONTROL_POINT\nDV_PARAM= (BOX, 1, -1, -1, 1, 0, 0)\n"
        "FFD_INTPREV= YES\nFFD_INTPREV_ITER= 5\nFFD_INTPREV_DEPTH= 2\nDV_VALUE= VALUES\n"
    )
    check_gradient(fold, [5.0])
    assert "FFD_INTPREV: the FFD box 'BOX' is deformed by" in capsys.readouterr().err


def test_design_is_scaled_back_until_cells_are_convex(here, capsys):
    sv.write("mesh.su2", square(8))
    text = (
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nSOLUTION_ADJ_FILENAME= adj\n"
        "DV_MARKER= (BLOCK)\nRELAX= NO\nDATA_REDUCTION= NO\nDV_KIND= ROTATION, SCALE\n"
        "DV_PARAM= (0.5, 0.5, 0, 0.5, 0.5, 1); (1.0)\nDV_VALUE= VALUES\n"
    )
    Path("a.cfg").write_text(text.replace("VALUES", "120, 1.1"))
    assert run(["def", "a.cfg", "-q"]) == 3  # cells are inverted
    checked = text + "CONVEXITY_CHECK= YES\nCONVEXITY_CHECK_ITER= 6\n"
    Path("a.cfg").write_text(checked.replace("VALUES", "120, 1.1"))
    capsys.readouterr()
    assert run(["def", "a.cfg", "-q", "--json", "a.json"]) == 0
    assert "CONVEXITY_CHECK: all of the design would invert" in capsys.readouterr().err
    design = json.loads(Path("a.json").read_text())["design"]
    part = design["part"]
    assert 0.0 < part < 1.0
    assert [row["value"] for row in design["variables"]] == [120 * part, 1.0 + part * (1.1 - 1.0)]
    Path("b.cfg").write_text(
        text.replace("VALUES", f"{120 * part!r}, {1.0 + (1.1 - 1.0) * part!r}")
    )
    kept = Path("out.su2").read_bytes()
    assert run(["def", "b.cfg", "-q"]) == 0
    assert Path("out.su2").read_bytes() == kept
    check_gradient(checked, [120, 1.1])


def test_design_through_a_wall_is_scaled_back_too(here, capsys):
    sv.write("mesh.su2", square(8))
    text = (
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nCONVEXITY_CHECK= YES\nRELAX= NO\n"
        "DV_MARKER= (BLOCK)\nDV_KIND= TRANSLATION\nDV_PARAM= (1, 0, 0)\nDV_VALUE= 0.5\n"
    )
    Path("a.cfg").write_text(text)
    assert run(["def", "a.cfg", "-q", "--json", "a.json"]) == 0
    assert "CONVEXITY_CHECK: mesh.su2: the motion " in capsys.readouterr().err
    assert json.loads(Path("a.json").read_text())["design"]["part"] == 0.59375
    assert (
        run(["def", "a.cfg", "-q", "--set", "DV_VALUE=99", "--set", "CONVEXITY_CHECK_ITER=2"]) == 1
    )
    assert "the motion takes BLOCK out of the mesh" in capsys.readouterr().err


def test_convexity_that_cannot_be_had_is_told(here, capsys):
    sv.write("mesh.su2", square(8))
    text = (
        "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nCONVEXITY_CHECK= YES\nRELAX= NO\n"
        "DV_MARKER= (BLOCK)\nCONVEXITY_CHECK_ITER= 1\n"
    )
    turn = "DV_KIND= ROTATION\nDV_PARAM= (0.5, 0.5, 0, 0.5, 0.5, 1)\nDV_VALUE= 240\n"
    Path("a.cfg").write_text(text + turn)
    assert run(["def", "a.cfg", "-q"]) == 3
    assert "and so does the smallest part that was tried, 0.5" in capsys.readouterr().err
    mesh = sv.read("mesh.su2")
    nodes = mesh.marker("BLOCK").nodes
    turned = 0.5 + (mesh.points[nodes] - 0.5) @ np.array([[-0.5, 0.75**0.5], [-(0.75**0.5), -0.5]])
    rows = [f"{k} {x} {y}" for k, (x, y) in zip(nodes, turned, strict=True)]
    Path("surface_positions.dat").write_text("\n".join(rows))
    Path("a.cfg").write_text(text + "DV_KIND= SURFACE_FILE\n")
    assert run(["def", "a.cfg", "-q"]) == 3
    assert (
        "values, but SURFACE_FILE has no values: it is applied in full" in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("FFD_CAMBER", "(BOX, -1, 0)", "variable 1: FFD_CAMBER has no index -1; write one from 0"),
        ("FFD_GULL", "(BOX, 9)", "has no control point with j = 9"),
        ("FFD_ROTATION", "(BOX, 0, 0, 0, 0, 0, 0)", "its two points coincide, so the line between"),
        ("FFD_TWIST", "(BOX, 1, 0, 0)", "3 parameters are given|needs .BOX, j, x0"),
        ("FFD_CAMBER", "(NONE, 1, 1)", "has no FFD box 'NONE'"),
    ],
)
def test_impossible_variables_are_told(kind, parameters, message, here):
    text = HEAD + f"DV_KIND= {kind}\nDV_PARAM= {parameters}\nDV_VALUE= 0.1\n"
    with pytest.raises(CaseError, match=message):
        surface(text)


def test_third_value_in_2d_must_be_zero(here):
    sv.write("mesh.su2", square(8))
    text = POLAR.replace("KINDS", "FFD_CONTROL_POINT").partition("FFD_COORD")[0] + (
        "DV_KIND= FFD_CONTROL_POINT\nDV_PARAM= (BOX, 1, 1, -1, 0, 0, 0)\nDV_VALUE= 0.1, 0.1, 0.2\n"
    )
    with pytest.raises(
        CaseError, match="variable 1: FFD_CONTROL_POINT moves points out of the plane"
    ):
        surface(text)


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("FFD_CONTROL_POINT", "(BOX, -1, -1, -1, 0, 0, 1)", "three indices of -1 move nothing"),
        ("FFD_TWIST", "(BOX, 4, 0.3, 0.1, 0.4, 0.4, 0.5, 0.5)", "segment does not meet its plane"),
    ],
)
def test_variables_without_effect_are_told(kind, parameters, message, here):
    text = HEAD + f"DV_KIND= {kind}\nDV_PARAM= {parameters}\nDV_VALUE= 0.1\n"
    found = surface(text)
    assert not found.displacement.any()
    (said,) = found.warnings
    assert "as in SU2, variable 1 of DV_KIND will have no effect; " in said
    assert message in said
    text = text.replace("(3, 4, 2)", "(1, 3, 1)").replace(kind, "FFD_CONTROL_SURFACE")
    (said,) = surface(text.replace(parameters, f"(BOX, {LINE})")).warnings
    assert "the box has no control points with i two before the last one" in said


@pytest.mark.parametrize("fixed", ["FFD_FIX_I= (1)", "FFD_FIX_J= (2)", "FFD_FIX_K= (0)"])
def test_held_planes_act_on_each_kind_in_its_way(fixed, here):
    text = f"{HEAD}FFD_CONTINUITY= USER_INPUT\n{fixed}\n{ALL}"
    found = surface(text.replace("VALUES", values_text(VALUES)))
    direction = "IJK".index(fixed[8])
    held = [(), (), ()]
    held[direction] = (int(fixed[12]),)
    box = found.displacer.boxes[0]
    points, still, partly = box.points, [], []
    for place, (kind, (_, value)) in enumerate(VARIABLES.items(), 1):
        both = [
            moved(kind, *parsed(kind), (value,), points, to, relax=0.5, length=1.6)
            for to in (((), (), ()), held)
        ]
        reach = [int((new != points).any(axis=-1).sum()) for new in both]
        still += [place] * (reach[1] == 0 < reach[0])
        partly += [place] * (0 < reach[1] < reach[0])
        points = both[1]
    after = boxes_of(found.boxed(found.mesh))[0]
    np.testing.assert_allclose(after.points, points, rtol=0, atol=1e-14)
    said = " ".join(map(str, found.warnings))
    for places, effect in ((still, "do nothing"), (partly, "leave the control points there")):
        if places:
            assert f"{', '.join(map(str, places))} of DV_KIND will {effect}" in said
    assert still
    idle = [place for place, is_idle in enumerate(found.idle, 1) if is_idle]
    assert idle == sorted([*still, 12])


@pytest.mark.parametrize("system", ["CARTESIAN", "CYLINDRICAL"])
def test_symmetry_planes_are_not_held(system, here):
    # The block goes through both sides j of the box; in other coordinates only j = 0 is left out.
    mesh = sv.read("mesh.su2")
    made = CoordinateSystem(system, (0.0, -1.0, 0.5))
    q = made.q_of(mesh.points[mesh.marker("BLOCK").nodes])
    middle, half = 0.5 * (q.min(axis=0) + q.max(axis=0)), np.ptp(q, axis=0)
    ends = np.array(
        corners(middle - half * (0.7, 0.3, 0.7), middle + half * (0.7, 0.3, 0.7)).split(", "), float
    ).reshape(8, 3)
    numbers = ", ".join(map(repr, made.points_of(ends).ravel().tolist()))
    text = HEAD.partition("FFD_DEFINITION")[0] + (
        f"FFD_DEFINITION= (BOX, {numbers})\nFFD_DEGREE= (2, 2, 2)\nFFD_COORD_SYSTEM= {system}\n"
        "FFD_AXIS= (0, -1, 0.5)\nFFD_CONTINUITY= NO_DERIVATIVE\nFFD_SYMMETRY_PLANE= YES\n"
        "DV_KIND= FFD_GULL\nDV_PARAM= (BOX, 1)\nDV_VALUE= 0\n"
    )
    Path("a.cfg").write_text(text)
    config = read_config(Path("a.cfg"))
    box = defined_boxes(config.case, mesh)["BOX"]
    i, j, k = held_planes(config, mesh, box, "NO_DERIVATIVE")
    assert (i, sorted(j), k) == (set(), [] if system == "CARTESIAN" else [2], set())
    free = replace(config, values={**config.values, "FFD_SYMMETRY_PLANE": False})
    assert held_planes(free, mesh, box, "NO_DERIVATIVE") == (set(), {0, 2}, set())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("REF_LENGTH= 0", "REF_LENGTH: '0' is not a number above 0"),
        ("FFD_INTPREV_ITER= 2.5", "FFD_INTPREV_ITER: '2.5' is not a whole number above 0"),
        ("OPT_LINE_SEARCH_BOUND= -1", "OPT_LINE_SEARCH_BOUND: '-1' is not a number above 0"),
        ("CONVEXITY_CHECK= MAYBE", "CONVEXITY_CHECK: 'MAYBE' is not supported; supported: YES, NO"),
        ("FFD_INTPREV= x", "FFD_INTPREV: 'x' is not supported"),
    ],
)
def test_wrong_settings_are_told(text, message, here):
    with pytest.raises(CaseError, match=message):
        surface(HEAD + ALL.replace("VALUES", values_text(VALUES)) + text)


def real(name):
    """A real mesh in the working folder; skips where it is not here."""
    path = REAL / name
    packed = path.with_name(f"{path.name}.xz")
    if not path.is_file() and not packed.is_file():
        pytest.skip("the real meshes are not here")
    data = path.read_bytes() if path.is_file() else lzma.decompress(packed.read_bytes())
    Path("mesh.su2").write_bytes(data)
    return sv.read("mesh.su2")


@pytest.mark.parametrize(
    "name",
    [
        "design/naca0012_two_ffd_boxes.su2",
        "su2/deformation_brick_prism_mesh_brick_prism_ffd.su2",
        "su2/disc_adj_euler_naca0012_pitching_mesh_NACA0012_inv_FFD.su2",
    ],
)
def test_real_boxes_move_by_kinds_of_their_dimension(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = real(name)
    box = boxes_of(mesh)[0]
    markers = ", ".join(box.embedded)
    kinds = ["FFD_CAMBER_2D", "FFD_THICKNESS_2D"]
    parameters = f"({box.name}, 1); ({box.name}, 1)"
    if mesh.dim == 3:
        kinds = ["FFD_CAMBER", "FFD_THICKNESS"]
        parameters = f"({box.name}, 1, 1); ({box.name}, 1, 1)"
    found = surface(
        f"MESH_FILENAME= mesh.su2\nDV_MARKER= ({markers})\nDV_KIND= {', '.join(kinds)}\n"
        f"DV_PARAM= {parameters}\nDV_VALUE= 0.01, 0.02\n",
        mesh,
    )
    points = box.points
    for kind, value in zip(kinds, (0.01, 0.02), strict=True):
        points = moved(kind, (1, 1)[: 1 + (mesh.dim == 3)], (), (value,), points)
    inside = found.displacer.embedded[box.name]
    for node, uvw in list(zip(inside.nodes, inside.uvw, strict=True))[::17]:
        right = (blended(points, uvw) - blended(box.points, uvw))[: mesh.dim]
        np.testing.assert_allclose(found.displacement[node], right, rtol=0, atol=1e-15)
    assert found.displacement.any()
