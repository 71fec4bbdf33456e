"""The deformations of SU2's own configurations, on small meshes, and their table in the docs.

Each has the lines about the deformation as SU2's test cases and tutorials have them; the mesh is a
small one with the same boundaries. ``python -m tests.design.test_su2_configurations`` writes the
table.
"""

import re
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.su2.config import KINDS, Group, form
from slideviz.ffd.box import plane_corners, regular_box
from slideviz.ffd.section import with_boxes
from tests.builders import airfoil, annulus, grid, sphere_in_box

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "reference" / "su2-configurations.md"
BEGIN = "| configuration | variables | result |\n| --- | --- | --- |\n"


def renamed(mesh, **names):
    """The mesh with other names of markers; those of one name become one marker."""
    found = {}
    for marker in mesh.markers:
        found.setdefault(names.get(marker.name, marker.name), []).append(marker.cells)
    markers = []
    for name, parts in found.items():
        tables = {}
        for cells in parts:
            for vtk, (_, nodes) in cells.by_type.items():
                tables.setdefault(vtk, []).append(nodes)
        blocks = [(vtk, np.concatenate(nodes)) for vtk, nodes in tables.items()]
        markers.append(sv.Marker(name, sv.Cells.from_blocks(blocks)))
    return replace(mesh, markers=tuple(markers))


def wing_section(*names, far="farfield", chord=1.0):
    """An airfoil whose boundary has one name, or those of upper and lower side, and the rear."""
    mesh = airfoil(32, 4).with_points(chord * airfoil(32, 4).points)
    lines = mesh.marker("airfoil").cells.by_type[3][1]
    x, y = mesh.points[lines].mean(axis=1).T
    part = np.where(x > 0.95 * chord, 2, np.where(y > 0.0, 0, 1)) if len(names) == 3 else 0 * x
    markers = [
        sv.Marker(name, sv.Cells.from_blocks([(3, lines[part == k])]))
        for k, name in enumerate(names)
    ]
    return renamed(replace(mesh, markers=(*markers, mesh.marker("far"))), far=far)


def boxed(mesh, name, low, high, degrees):
    (x0, y0), (x1, y1) = low, high
    corners = plane_corners(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))
    return with_boxes(mesh, [regular_box(name, corners, (*degrees, 1), None)])


def slab(shape, low, size, **names):
    """A block of cells with its sides named."""
    place = np.array(low) + grid(shape).points * np.array(size)
    return renamed(grid(shape).with_points(place), **names)


def burner():
    """A channel with a wall from the left that ends in it, between y = 5 and 7 mm."""
    rules = [
        ("wall_inner_bottom", lambda p: bool(np.all((p[:, 1] == 5) & (p[:, 0] <= 18)))),
        ("wall_inner_top", lambda p: bool(np.all((p[:, 1] == 7) & (p[:, 0] <= 18)))),
        ("wall_inner_right", lambda p: bool(np.all((p[:, 0] == 18) & (abs(p[:, 1] - 6) <= 1)))),
        ("inlet", lambda p: bool(np.all(p[:, 0] == 0))),
        ("outlet", lambda p: bool(np.all(p[:, 0] == 24))),
        ("wall_outer", lambda p: True),
    ]
    shape, size = (24, 12), np.array([0.06, 0.012])
    return grid(shape, [(0, 18), (5, 7)], place=lambda p: p / shape * size, rules=rules)


def ball(radius=1.0, **names):
    mesh = sphere_in_box(6, 3)
    sides = dict.fromkeys((name for name in mesh.marker_names if name != "sphere"), "FARFIELD")
    return renamed(mesh.with_points(mesh.points * radius / 0.4), **(sides | names))


SECTION = lambda: wing_section("airfoil")  # noqa: E731
CAPITALS = lambda: wing_section("AIRFOIL", far="FARFIELD")  # noqa: E731
UNSTEADY = lambda: boxed(CAPITALS(), "AIRFOIL_BOX", (-0.1, -0.2), (1.1, 0.2), (10, 10))  # noqa: E731
BRICK = lambda: slab((8, 6, 4), (0, 0, 0), (2, 1, 1))  # noqa: E731
BALL = lambda name: lambda: ball(sphere=name)  # noqa: E731
WING = lambda: ball(0.6, sphere="UPPER_SIDE")  # noqa: E731

HENNE = "DV_KIND= HICKS_HENNE\nDV_MARKER= ( airfoil )\nDV_PARAM= ( 1, 0.5 )\n"
UNSTEADY_BOX = (
    "MARKER_INTERNAL= ( FWH1 )\nDV_KIND= FFD_CONTROL_POINT_2D\nDV_MARKER= ( AIRFOIL )\n"
    "DV_PARAM= ( AIRFOIL_BOX, 0.0, 0.0, 1.0, 0.0)\nDV_VALUE= 0.01\nDV_FILENAME= mesh_motion.dat\n"
    "OPT_RELAX_FACTOR= 1\n"
)
ONERA = (
    "DV_KIND= FFD_SETTING\nDV_MARKER= ( UPPER_SIDE, LOWER_SIDE, TIP )\n"
    "DV_PARAM= ( WING, 1, 0, 0, 0.0, 0.0, 1.0 )\nDV_VALUE= 0.0\nFFD_DEGREE= (10, 8, 1)\n"
    "FFD_DEFINITION= (WING,-0.0403, 0, -0.04836,0.8463,0, -0.04836,1.209,1.2896, -0.04836,0.6851,"
    "1.2896, -0.04836,-0.0403,0, 0.04836,0.8463,0, 0.04836,1.209,1.2896, 0.04836,0.6851,1.2896, "
    "0.04836)\nFFD_CONTINUITY= 2ND_DERIVATIVE\nFFD_SYMMETRY_PLANE= YES\nOPT_RELAX_FACTOR= 1E3\n"
)
SPHERE = (
    "DV_KIND= FFD_CONTROL_POINT\nDV_MARKER= ( SPHERE )\nDV_VALUE= 0.1\n"
    "DV_PARAM= ( SPHERE_BOX, 0, 3, 2, 1.0, 0.0, 0.0 )\nFFD_TOLERANCE= 1E-10\nFFD_ITERATIONS= 1000\n"
    "FFD_DEFINITION= (SPHERE_BOX, -0.6, -0.1, 1.0, -0.6, -0.1, 0.5, -0.6, 0.1, 0.5, -0.6, 0.1, 1.0,"
    " 0.6, -0.1, 1.0, 0.6, -0.1, 0.5, 0.6, 0.1, 0.5, 0.6, 0.1, 1.0)\nFFD_DEGREE= (1, 9, 4)\n"
    "FFD_CONTINUITY= 1ST_DERIVATIVE\nFFD_COORD_SYSTEM= SPHERICAL\nFFD_AXIS= (0.0, 0.0, 0.0)\n"
)
CYLINDER = (
    "DV_KIND= FFD_CONTROL_POINT\nDV_MARKER= ( CYLINDER )\nDV_VALUE= 1.0\n"
    "DV_PARAM= ( CYLINDER_BOX, 0, 3, 2, 1.0, 0.0, 0.0 )\nFFD_TOLERANCE= 1E-10\n"
    "FFD_DEFINITION= (CYLINDER_BOX, -0.6, -0.1, 1.5, -0.6, -0.1, 0.5, -0.6, 0.1, 0.5, -0.6, 0.1, "
    "1.5, 0.6, -0.1, 1.5, 0.6, -0.1, 0.5, 0.6, 0.1, 0.5, 0.6, 0.1, 1.5)\nFFD_DEGREE= (1, 9, 4)\n"
    "FFD_CONTINUITY= 1ST_DERIVATIVE\nFFD_COORD_SYSTEM= CYLINDRICAL\nFFD_AXIS= (0.0, 0.0, 0.0)\n"
)
NACELLE = (
    "DV_KIND= FFD_CONTROL_POINT\nDV_MARKER= ( Nacelle, Nozzle )\nDV_VALUE= 1.0\n"
    "DV_PARAM= ( NACELLE_BOX, 0, 0, 2, 1.0, 0.0, 0.0 )\n"
    "FFD_DEFINITION= (NACELLE_BOX, -10.0, -0.1, 35.0, -10.0, -0.1, 10.0, -10.0, 0.1, 10.0, -10.0, "
    "0.1, 35.0, 110.0, -0.1, 35.0, 110.0, -0.1, 10.0, 110.0, 0.1, 10.0, 110.0, 0.1, 35.0)\n"
    "FFD_DEGREE= (2, 10, 20)\nFFD_CONTINUITY= 1ST_DERIVATIVE\nFFD_COORD_SYSTEM= CYLINDRICAL\n"
    "FFD_AXIS= (1.0, 0.0, 0.0)\n"
)
BRICKS = (
    "DV_KIND= FFD_CONTROL_POINT\nDV_MARKER= ( z_m )\nDV_VALUE= 3.0\n"
    "DV_PARAM= ( MAIN_BOX, 2, 2, 1, 0.0, 0.0, 1.0 )\nFFD_TOLERANCE= 1E-15\nFFD_ITERATIONS= 1000\n"
    "FFD_DEFINITION= (MAIN_BOX, 0.01, 0.01, -0.25, 1.99, 0.01, -0.25, 1.99, 0.99, -0.25, 0.01, "
    "0.99, -0.25, 0.01, 0.01, 0.25, 1.99, 0.01, 0.25, 1.99, 0.99, 0.25, 0.01, 0.99, 0.25)\n"
    "FFD_DEGREE= (4, 4, 1)\nFFD_CONTINUITY= 1ST_DERIVATIVE\n"
)
FLAT = ", 0.0" * 12 + ")\n"
RAE = (
    "DV_KIND= FFD_CONTROL_POINT_2D\nDV_MARKER= ( AIRFOIL )\nDV_VALUE= 0.1\n"
    "DV_PARAM= ( MAIN_BOX, 7, 1, 0.0, 1.0)\nFFD_TOLERANCE= 1E-15\n"
    "FFD_DEFINITION= (MAIN_BOX, -0.00000001, -0.07, 0.0, 1.00000001, -0.07, 0.0, 1.00000001, 0.07,"
    f" 0.0, -0.00000001, 0.07, 0.0{FLAT}FFD_DEGREE= ( 14, 1, 0)\nFFD_CONTINUITY= 2ND_DERIVATIVE\n"
)
WEDGE = (
    "DV_MARKER= ( lower )\nDV_KIND= FFD_CONTROL_POINT_2D\nDV_PARAM= (MAIN_BOX, 3,0, 0,1.0,0,0 )\n"
    "DV_VALUE= 0.5\nFFD_DEFINITION= (MAIN_BOX, 0.5, -0.25, 0, 1.5, -0.25, 0, 1.5, 0.25,  0, 0.5, "
    f"0.25,  0.0{FLAT}FFD_DEGREE= (10, 1,0)\nFFD_CONTINUITY= 2ND_DERIVATIVE\n"
)
CROSSING = (
    f"DV_KIND= {', '.join(['FFD_CONTROL_POINT_2D'] * 22)}\nMARKER_SYM = (wall_outer)\n"
    "DV_MARKER= (wall_inner_bottom, wall_inner_right, wall_inner_top)\nDV_PARAM= "
    + "; ".join(f"(MAIN_BOX, {i}, {j}, 0.0, 1.0)" for j in (0, 1) for i in range(11))
    + "\nDV_VALUE = 0, 0.0002, 0.0004, 0.0006, 0.0008, 0.001, 0.0012, 0.0014, 0.0016, 0.0018, 0.002"
    ", 0,-0.0002, -0.0004, -0.0006, -0.0008, -0.0010, -0.0012, -0.0014, -0.0016, -0.0018, -0.002\n"
    "FFD_INTPREV = YES\nFFD_INTPREV_ITER = 2\nFFD_INTPREV_DEPTH= 3\nCONVEXITY_CHECK = YES\n"
    "CONVEXITY_CHECK_ITER = 10\nCONVEXITY_CHECK_DEPTH = 3\nFFD_CONTINUITY= USER_INPUT\n"
    "FFD_DEFINITION= (MAIN_BOX, 0.02, 0.005, 0,   0.05, 0.005, 0.0,   0.05, 0.007, 0.0,   0.02, "
    f"0.007, 0.0{FLAT}FFD_DEGREE= ( 10, 1, 0)\nOPT_RELAX_FACTOR= 1.0\nOPT_LINE_SEARCH_BOUND= 1E6\n"
)
VENTURI = (
    f"DV_KIND= {', '.join(['FFD_CONTROL_POINT_2D'] * 10)}\nDV_MARKER= ( wall )\nDV_PARAM= "
    + "; ".join(f"(BOX, {i}, {j}, 0.0, 1.0)" for j in (0, 1) for i in range(2, 7))
    + "\nDV_VALUE= 0.003, 0.003, 0.004, 0.005, 0.005, \\\n  0.003, 0.003, 0.004, 0.005, 0.005\n"
    "MARKER_SYM= ( axis )\nFFD_DEFINITION= (BOX, \\\n0.065, 0.01, 0.0, \\\n0.15, 0.01, 0.0 \\\n"
    f"0.15, 0.02, 0.0, \\\n0.065, 0.02, 0.0{FLAT}FFD_DEGREE= (6, 1, 0)\n"
    "FFD_CONTINUITY= USER_INPUT\nDEFORM_NONLINEAR_ITER= 1\n"
)
BEND = (
    "MARKER_SYM= ( symmetry )\nMARKER_INTERNAL= (internal)\nDV_KIND= FFD_SETTING\n"
    "DV_MARKER= ( wall, symmetry)\nDV_PARAM= (1.0)\nFFD_DEGREE= (5,5,5)\nFFD_DEFINITION= (BOX, \\\n"
    "-0.06, -0.009, -0.001, \\\n 0.209, -0.009, -0.001, \\\n 0.209, 0.060, -0.001, \\\n"
    "-0.06, 0.060, -0.001, \\\n-0.06, -0.009 ,0.27, \\\n 0.209 ,-0.009, 0.27, \\\n"
    " 0.209, 0.060, 0.27, \\\n-0.06, 0.060, 0.27 )\n"
)
RHT = (
    "DV_KIND = FFD_SETTING\nDV_MARKER = ( body )\nDV_PARAM = ( MAIN_BOX, 24, 1, 0.0, 1.0 )\n"
    "FFD_TOLERANCE = 1E-8\nFFD_DEFINITION = (MAIN_BOX, -0.55, -0.55, 0.0, 0.55, -0.55, 0.0, 0.55, "
    f"0.55, 0.0, -0.55, 0.55, 0.0{FLAT}FFD_DEGREE = ( 24, 1, 0)\nFFD_CONTINUITY = 2ND_DERIVATIVE\n"
)
CAMBER = (
    f"DV_KIND= {', '.join(['HICKS_HENNE_CAMBER'] * 14)}\nDV_MARKER= ( airfoil )\nDV_PARAM= "
    + "; ".join(f"( {k / 15!r} )" for k in range(1, 15))
    + f"\nDV_VALUE= {'0.0, ' * 13}0.005\nDEFORM_COEFF = 1E6\n"
)
CST = (
    "DV_KIND= CST,CST\nDV_MARKER= ( upper, lower, te )\nDV_PARAM= (0, 5, 7);(1, 2, 6)\n"
    "DV_VALUE= 0.3, 0.5\n"
)
RBF = (
    "DV_VALUE= 0.1\nDEFORM_KIND= RBF\nRADIAL_BASIS_FUNCTION_PARAMETER= 2\nRBF_DATA_REDUCTION= YES\n"
    "RBF_GREEDY_TOLERANCE= 1E-3\nDEFORM_CONSOLE_OUTPUT= YES\n"
)


@dataclass
class Configuration:
    """A configuration: the mesh that takes the place of its own, and the lines it has."""

    mesh: object
    text: str


DEF, OPT, RANS = "deformation/", "optimization_euler/", "optimization_rans/"
CONFIGURATIONS = {
    DEF + "naca0012/def_NACA0012": Configuration(SECTION, HENNE + "DV_VALUE= 0.1\n"),
    DEF + "naca0012/def_NACA0012_camber": Configuration(SECTION, CAMBER),
    DEF + "naca0012/def_NACA0012_rbf": Configuration(SECTION, HENNE + RBF),
    DEF + "naca0012/surface_file_NACA0012": Configuration(
        SECTION,
        HENNE.replace("HICKS_HENNE", "SURFACE_FILE")
        + "DV_VALUE= 0.1\nDV_FILENAME= surface_bump.dat\n",
    ),
    DEF + "cst/naca0012": Configuration(lambda: wing_section("upper", "lower", "te"), CST),
    DEF + "naca4412/def_NACA4412": Configuration(
        lambda: wing_section("suction", "pressure", "TE"),
        HENNE.replace("airfoil", "pressure, suction, TE") + "DV_VALUE= 0.1\n",
    ),
    DEF + "rae2822/def_RAE2822": Configuration(CAPITALS, RAE),
    DEF + "brick_hex/def_brick_hex": Configuration(BRICK, BRICKS),
    DEF + "intersection_prevention/def_intersect": Configuration(
        burner,
        CROSSING,
    ),
    DEF + "cylindrical_ffd/def_cylindrical": Configuration(BALL("CYLINDER"), CYLINDER),
    DEF + "spherical_ffd/def_spherical": Configuration(BALL("SPHERE"), SPHERE),
    DEF + "spherical_ffd/def_spherical_bspline": Configuration(
        BALL("SPHERE"), SPHERE + "FFD_BLENDING= BSPLINE_UNIFORM\nFFD_BSPLINE_ORDER= 2, 2, 2\n"
    ),
    DEF + "spherical_ffd/def_nacelle": Configuration(
        lambda: ball(30.0, sphere="Nacelle"), NACELLE.replace(", Nozzle", "")
    ),
    OPT + "steady_naca0012/inv_NACA0012_basic": Configuration(SECTION, HENNE + "DV_VALUE= 1.0\n"),
    OPT + "pitching_naca64a010/pitching_NACA64A010": Configuration(
        SECTION, HENNE + "DV_VALUE= 0.0\n"
    ),
    OPT + "multiobjective_wedge/inv_wedge_ROE_multiobj": Configuration(
        lambda: slab(
            (16, 8), (0, 0), (2, 1), y_m="lower", y_p="upper", x_m="inlet", x_p="outlet"
        ),
        WEDGE,
    ),
    OPT + "steady_oneram6/inv_ONERAM6_adv": Configuration(
        WING, ONERA.replace("UPPER_SIDE, LOWER_SIDE, TIP", "UPPER_SIDE")
    ),
    RANS + "steady_rae2822/def_SA_RAE2822": Configuration(
        CAPITALS, HENNE.replace("airfoil", "AIRFOIL") + "DV_VALUE= 0.05\n"
    ),
    RANS + "naca0012/naca0012": Configuration(UNSTEADY, UNSTEADY_BOX),
    "Tutorials/design/Inviscid_2D_Unconstrained_NACA0012/inv_NACA0012_basic": Configuration(
        SECTION, HENNE + "DV_VALUE= 1.0\nOPT_RELAX_FACTOR= 1E3\n"
    ),
    "Tutorials/design/Inc_Turbulent_Bend_Wallfunctions/sudo_0_add_FFD_box": Configuration(
        lambda: slab(
            (6, 4, 4), (0, 0, 0), (0.2, 0.05, 0.25), y_m="symmetry", x_m="inlet", x_p="outlet",
            y_p="wall", z_m="wall", z_p="wall",
        ),
        BEND,
    ),
    "Tutorials/design/Inc_Turbulent_Bend_Wallfunctions/sudo": Configuration(
        BRICK, "DV_KIND= __FFD_CTRL_PTS__\nDV_PARAM= __FFD_PARAM__\nDV_VALUE= __FFD_PTS__\n"
    ),
    "Tutorials/incompressible_flow/Inc_Species_Transport/2__mesh-deform-test": Configuration(
        lambda: slab(
            (24, 8), (0, 0), (0.16, 0.015), y_m="axis", y_p="wall", x_m="gas_inlet", x_p="outlet"
        ),
        VENTURI,
    ),
    "Tutorials/multiphysics/adjoint_rht/config_rht_ffd": Configuration(
        lambda: renamed(annulus(24, 5), wall="body", far0="farfield"), RHT
    ),
}  # fmt: skip


def result(name):
    """Run ``def`` in the working folder: the exit code and what it says."""
    one = CONFIGURATIONS[name]
    mesh = one.mesh()
    sv.write("mesh.su2", mesh, overwrite=True)
    if "surface_bump" in one.text:
        nodes = mesh.marker("airfoil").nodes
        rows = np.column_stack([nodes, mesh.points[nodes] * [1.0, 1.1]])
        np.savetxt("surface_bump.dat", rows, fmt="%d\t%.17g\t%.17g")
    files = "MESH_FILENAME= mesh.su2\nMESH_OUT_FILENAME= out.su2\nSOLVER= EULER\n"
    Path("a.cfg").write_text(files + one.text)
    said = StringIO()
    with redirect_stderr(said), redirect_stdout(said):
        code = run(["def", "a.cfg", "-q"])
    return code, said.getvalue()


def row(name, code, said):
    """The row of a configuration in the table of the docs."""
    kinds = re.search(r"DV_KIND *= *(.*)", CONFIGURATIONS[name].text)[1].replace(" ", "")
    first, count = kinds.split(",")[0], kinds.count(",") + 1
    variables = f"`{first}`" + f" × {count}" * (count > 1)
    outcome = "runs"
    if code not in (0, 3):
        lines = [re.sub(r"^(slideviz: )?(a.cfg|mesh.su2)(:4)?: ", "", x) for x in said.splitlines()]
        why = [re.sub("( near|; ).*", "", line) for line in lines if " note: " not in line]
        outcome = f"refused: {'; '.join(why)}"
    return f"| `{name}` | {variables} | {outcome} |"


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_configurations_of_su2_do_what_the_table_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, said = result(name)
    rows = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].splitlines()
    assert row(name, code, said) in rows, "python -m tests.design.test_su2_configurations writes it"
    if code in (0, 3) and "FFD_SETTING" not in CONFIGURATIONS[name].text:
        moved = sv.read("out.su2").points - sv.read("mesh.su2").points
        assert moved.any() == ("DV_VALUE= 0.0\n" not in CONFIGURATIONS[name].text), said


def test_table_has_a_row_for_each_configuration_and_no_other():
    rows = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].splitlines()
    assert [line.split("`")[1] for line in rows] == list(CONFIGURATIONS)


def test_each_kind_is_of_a_group():
    assert {kind.group for kind in KINDS.values()} == set(get_args(Group))


def test_table_of_kinds_in_the_docs_has_all_of_them():
    page = (DOCS / "how-to" / "su2-design-loop.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| `")]
    shown = {names.strip(" `"): parameters.strip() for names, parameters in rows}
    for name, kind in KINDS.items():
        assert f"`{name}`" in page, name
        if name in shown and not kind.refused:
            assert len(form(name).split(",")) == len(shown[name].split(",")), name
    assert {"FFD_TWIST", "HICKS_HENNE", "NACA_4DIGITS"} <= set(shown)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        page = PAGE.resolve()
        with chdir(place):
            made = "".join(row(name, *result(name)) + "\n" for name in CONFIGURATIONS)
        head, begin, _ = page.read_text(encoding="utf-8").partition(BEGIN)
        page.write_text(head + begin + made, encoding="utf-8")
