"""SU2's CONFIG_LIST: ``slideviz def`` and ``slideviz dot`` with a configuration for each zone."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.su2.config import on_mesh, read_config, read_mesh
from slideviz.design.su2.surface import make_surface
from slideviz.errors import CaseError
from slideviz.ffd.section import boxes_of
from slideviz.mesh.zones import zones_of
from tests.builders import zones_in_a_row
from tests.mesh.test_interfaces import zones as square_and_core
from tests.solver.test_interface_motion import stage

MAIN = """SOLVER= MULTIPHYSICS
CONFIG_LIST= ( first.cfg, second.cfg )
MESH_FILENAME= stage.su2
MESH_OUT_FILENAME= out.su2
MARKER_SYM= ( inner, outer )
DV_MARKER= ( BLOCK )
DV_KIND= TRANSLATION
DV_PARAM= ( 0, 1, 0 )
DV_VALUE= 0.01
"""
OTHER = (
    "DV_KIND= ROTATION\nDV_PARAM= (0, 0, 0, 0, 0, 1)\nDV_VALUE= 2\nSTEPS= 3\nMARKER_SYM= (inner)\n"
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working folder, with a mesh of two zones."""
    monkeypatch.chdir(tmp_path)
    stage(tmp_path)
    return tmp_path


def write(main=MAIN, first="% as in main.cfg\nSTEPS= 1\n", second=OTHER):
    for name, text in (("main", main), ("first", first), ("second", second)):
        Path(f"{name}.cfg").write_text(text)


def alone(number, text):
    """The points of a zone deformed by itself, by one configuration."""
    body = MAIN.replace("CONFIG_LIST= ( first.cfg, second.cfg )\n", f"ZONE= {number}\n")
    own = {line.partition("=")[0] for line in text.splitlines()}
    kept = [line for line in body.splitlines() if line.partition("=")[0] not in own]
    Path("alone.cfg").write_text("\n".join(kept) + f"\n{text}")
    args = ["def", "alone.cfg", "-q", "--set", f"MESH_OUT_FILENAME=alone{number}.su2"]
    assert run(args) == 0
    return sv.read(f"alone{number}.su2", zone=number).points


def test_each_zone_is_deformed_by_its_configuration_as_alone_to_the_bit(here, capsys):
    write()
    assert run(["def", "main.cfg", "-q", "--json", "r.json"]) == 0
    found = zones_of(sv.read("out.su2"))
    assert np.array_equal(found[0].points, alone(1, "STEPS= 1\n"))
    assert np.array_equal(found[1].points, alone(2, OTHER))
    report = json.loads(Path("r.json").read_text())
    kinds = [(one["kind"], one["value"]) for one in report["design"]["variables"]]
    assert kinds == [("TRANSLATION", 0.01), ("ROTATION", 2.0)]
    assert "no marker" not in capsys.readouterr().err


def test_a_file_for_each_zone_is_written_as_one(here, capsys):
    write()
    assert run(["def", "main.cfg", "-q"]) == 0
    together = Path("out.su2").rename("together.su2")
    for number, zone in enumerate(zones_of(sv.read("stage.su2")), 1):
        alone = sv.Mesh(zone.points, zone.cells, zone.markers)
        sv.write(f"{number}.su2", alone)
    main = MAIN.replace("MESH_FILENAME= stage.su2", "MULTIZONE_MESH= NO")
    write(main, "MESH_FILENAME= 1.su2\n", f"MESH_FILENAME= 2.su2\n{OTHER}")
    assert run(["def", "main.cfg", "-q"]) == 0
    assert Path("out.su2").read_text().startswith("NZONE= 2\nIZONE= 1\n")
    assert np.array_equal(sv.read("out.su2").points, sv.read(together).points)
    write(main.replace(", second.cfg", ""), f"MESH_FILENAME= 1.su2\nSTEPZ= 1\n{OTHER}")
    assert run(["def", "main.cfg", "-q", "--force"]) == 0
    assert len(sv.read("out.su2").parts) == 1
    assert "first.cfg:2: STEPZ is not read" in capsys.readouterr().err
    write(main, "MESH_FILENAME= stage.su2\n", f"MESH_FILENAME= 2.su2\n{OTHER}")
    with pytest.raises(CaseError, match=r"first\.cfg: stage\.su2 has 2 zones, and with MULTIZONE"):
        read_mesh(read_config(Path("main.cfg")))
    write(first="MESH_FILENAME= 1.su2\n")
    with pytest.raises(CaseError, match=r"first\.cfg: MESH_FILENAME= 1\.su2, and with MULTIZONE_M"):
        read_mesh(read_config(Path("main.cfg")))


def test_a_zone_without_design_variables_stays_or_follows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = square_and_core(tmp_path)
    main = MAIN.replace("stage.su2", path.name)[: MAIN.index("MARKER_SYM")]
    moves = "DV_MARKER= (BLOCK)\nDV_KIND= TRANSLATION\nDV_PARAM= (2, 1, 0)\nDV_VALUE= 0.01\n"
    write(main, moves, "STEPS= 1\n")
    mesh = sv.read(path)
    for second in ("STEPS= 1\n", "DV_KIND= NO_DEFORMATION\nDV_MARKER= ( core )\n"):
        write(main, moves, second)
        assert run(["def", "main.cfg", "-q", "--force"]) == 0
        points = sv.read("out.su2").points
        for each in mesh.interfaces:
            assert np.array_equal(points[each.nodes], points[each.partners])
        assert not np.array_equal(points[mesh.parts[1].points], zones_of(mesh)[1].points)
    write(main, "STEPS= 1\n", "DV_KIND= NO_DEFORMATION\n")
    assert run(["def", "main.cfg", "-q"]) == 0
    assert np.array_equal(sv.read("out.su2").points, mesh.points)


def test_a_configuration_that_is_listed_twice_or_has_a_list_itself_is_told(here, capsys):
    write(MAIN.replace("second", "first"))
    assert run(["def", "main.cfg", "-q"]) == 0
    said = "main.cfg: CONFIG_LIST has first.cfg 2 times, for the zones 1, 2; list a file for each"
    assert capsys.readouterr().err.count(said) == 1
    write(second=f"CONFIG_LIST= ( a.cfg )\n{OTHER}")
    assert run(["def", "main.cfg", "-q", "--force"]) == 0
    said = "second.cfg:1: CONFIG_LIST is ignored in a file that main.cfg lists; take it out"
    assert said in capsys.readouterr().err


def test_a_file_is_read_once_however_often_it_is_listed(here, monkeypatch):
    from slideviz.design.su2 import config

    read = []
    monkeypatch.setattr(
        config, "_rows", lambda path, rows=config._rows: read.append(path) or rows(path)
    )
    write(MAIN.replace("first.cfg, second.cfg", ", ".join(["first.cfg"] * 300)))
    found = read_config(Path("main.cfg"))
    assert read == [Path("main.cfg"), Path("first.cfg")]
    assert [zone.zone for zone in found.zones] == [*range(1, 301)]
    with pytest.raises(CaseError, match=r"CONFIG_LIST has 300 configurations, and stage\.su2 2 z"):
        on_mesh(found, read_mesh(found))


def test_of_very_many_missing_configurations_the_first_are_named(here):
    write(MAIN.replace("first.cfg, second.cfg", ", ".join(f"{k}.cfg" for k in range(5000))))
    with pytest.raises(CaseError, match=r"0\.cfg: there is no such") as problem:
        read_config(Path("main.cfg"))
    lines = str(problem.value).splitlines()
    assert len(lines) < 50
    assert lines[-1] == f"main.cfg: and {5000 - len(lines) + 1} more problems"


def test_keys_of_su2_that_resemble_ours_are_no_mistakes(here, capsys):
    write(MAIN + "NZONES= 2\n")
    assert run(["def", "main.cfg", "-q"]) == 0
    assert "NZONES" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ({"main": MAIN.replace("SOLVER= MULTIPHYSICS", "SOLVER= RANS")}, r"main.cfg:2: CONFIG_LI"),
        ({"main": MAIN + "ZONE= 1\n"}, r"main.cfg:2: CONFIG_LIST: is for all zones, and ZONE= for"),
        ({"main": MAIN.replace(", second.cfg", "")}, "CONFIG_LIST has 1 configurations, and stage"),
        ({"main": MAIN.replace(", second.cfg )", "")}, "main.cfg:2: CONFIG_LIST: a bracket of"),
        ({"main": MAIN.replace("0.01", "a")}, r"^main.cfg:9: DV_VALUE: .*'a'"),
        ({"second": "DV_VALUE= a\n"}, r"^second.cfg:1: DV_VALUE: .*'a'"),
        (
            {"main": MAIN.replace("DV_KIND", "DV_KINDS"), "second": "STEPS= 1\n"},
            "^main.cfg: DV_KIND is missing, in the files of CONFIG_LIST, too",
        ),
        ({"main": MAIN.replace("( BLOCK )", "NONE")}, "main.cfg: DV_MARKER names no boundary; no"),
        ({"main": MAIN.replace("BLOCK", "BLOC")}, "DV_MARKER: stage.su2 has no marker 'BLOC'"),
        ({"second": "DV_KIND= SCALE_GRID\nDV_VALUE= 2\n"}, "zones have TRANSLATION and SCALE_GRID"),
    ],
)
def test_mistakes_are_told_with_their_file(here, texts, message, capsys):
    write(**texts)
    assert run(["def", "main.cfg", "-q"]) != 0
    assert re.search(message, capsys.readouterr().err.removeprefix("slideviz: "))


def adjoint(points, weights, name):
    table = np.column_stack([np.arange(len(points)), points, weights])
    head = '"PointID", "x", "y", "Sensitivity_x", "Sensitivity_y"'
    np.savetxt(name, table, delimiter=", ", header=head, comments="", fmt="%.17g")


def restarts(mesh, weights, stem="solution_adj_cd"):
    """Write the sensitivities of each zone, as SU2 names them."""
    for k, part in enumerate(mesh.parts):
        adjoint(mesh.points[part.points], weights[part.points], f"{stem}_{k}.csv")


def gradient(args=()):
    assert run(["dot", "main.cfg", "-q", *args]) == 0
    return np.array([float(row) for row in Path("of_grad.dat").read_text().splitlines()[1:]])


def deformed():
    assert run(["def", "main.cfg", "-q", "--force"]) == 0
    return sv.read("out.su2").points


SHARED = MAIN.replace("0.01", "VALUE_0")
LISTED = "OBJECTIVE_FUNCTION= DRAG\n"
ONE = """MESH_FILENAME= stage.su2
MESH_OUT_FILENAME= out.su2
MARKER_SYM= ( 1:inner, 1:outer, 2:inner )
DV_MARKER= ( 1:BLOCK, 2:BLOCK )
DV_KIND= TRANSLATION, ROTATION
DV_PARAM= (0, 1, 0); (0, 0, 0, 0, 0, 1)
DV_VALUE= VALUE_0, VALUE_1
"""
LOOPS = {
    "a list each": (SHARED, "STEPS= 2\n", OTHER.replace("= 2", "= VALUE_1"), (0.01, 2.0)),
    "a shared list": (SHARED, "STEPS= 2\n", "STEPS= 1\n", (0.01,)),
    "one configuration": (ONE, "", "", (0.01, 2.0)),
    "one zone stays": (SHARED, "DV_KIND= NO_DEFORMATION\n", "STEPS= 1\n", (0.01,)),
}


SLOW = ("one configuration", "one zone stays")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in LOOPS],
)
def test_gradients_are_those_of_all_zones(here, name):
    *texts, values = LOOPS[name]
    mesh = sv.read("stage.su2")
    weights = np.random.default_rng(5).normal(size=mesh.points.shape)

    def prepare(values):
        filled = list(texts)
        for k, value in enumerate(values):
            filled = [text.replace(f"VALUE_{k}", repr(value)) for text in filled]
        write(filled[0] + LISTED, *filled[1:])

    expected = []
    for k in range(len(values)):
        ends = []
        for sign in (1.0, -1.0):
            prepare([v + sign * 1e-4 * (k == j) for j, v in enumerate(values)])
            ends.append((weights * deformed()).sum())
        expected.append((ends[0] - ends[1]) / 2e-4)
    prepare(values)
    points = deformed()
    restarts(mesh.with_points(points), weights)
    found = gradient(["--json", "dot.json"])
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    report = json.loads(Path("dot.json").read_text())
    assert report["at"] == "design"
    assert report["gradient"] == found.tolist()
    table = np.loadtxt("surface_sensitivity.dat", delimiter=",")
    config = on_mesh(read_config(Path("main.cfg")), mesh)
    surface = make_surface(config, mesh)
    slopes = [surface.slope(*at) for at in surface.values]
    dots = [(table[:, 3:5] * slope).sum() for slope in slopes]
    np.testing.assert_allclose(dots, found, rtol=1e-12)
    deformer = sv.Deformer(mesh, surface.case(), surface.displacement)
    pushed = [(weights * deformer.jvp(surface.displacement, slope)).sum() for slope in slopes]
    np.testing.assert_allclose(pushed, found, rtol=1e-11)
    # The mesh is deformed already, as in SU2's own loop.
    restarts(mesh, weights)
    assert json.loads(Path("dot.json").read_text())["at"] == "design"
    assert not np.allclose(gradient(), found, rtol=1e-4)
    order = np.random.default_rng(6).permutation(len(points))
    rows = np.column_stack([points, weights])[order]
    np.savetxt("unordered_sensitivity.dat", rows, delimiter=", ", fmt="%.17g")
    format_ = "DV_SENSITIVITY_FORMAT=UNORDERED_ASCII"
    np.testing.assert_allclose(gradient(["--set", format_]), found, rtol=1e-9)


def test_a_zone_without_adjoint_solution_is_told(here, capsys):
    write()
    mesh = sv.read("stage.su2")
    restarts(mesh, np.ones(mesh.points.shape))
    Path("solution_adj_cd_1.csv").unlink()
    assert run(["dot", "main.cfg", "-q"]) != 0
    said = capsys.readouterr().err
    assert "second.cfg: there is no adjoint solution of OBJECTIVE_FUNCTION= DRAG: none of" in said
    assert "solution_adj_cd_1.dat, solution_adj_cd_1.csv, solution_adj_1.dat" in said


def test_coincident_nodes_of_zones_share_the_rows_of_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = square_and_core(tmp_path)
    main = MAIN.replace("stage.su2", path.name)[: MAIN.index("MARKER_SYM")]
    moves = "DV_MARKER= (BLOCK)\nDV_KIND= TRANSLATION\nDV_PARAM= (2, 1, 0)\nDV_VALUE= 0.01\n"
    write(main + "DV_SENSITIVITY_FORMAT= UNORDERED_ASCII\n", moves, "STEPS= 1\n")
    mesh = sv.read(path)
    points = mesh.with_points(deformed()).points
    weights = np.random.default_rng(5).normal(size=points.shape)

    def rows(which):
        table = np.column_stack([points, weights])[which]
        np.savetxt("unordered_sensitivity.dat", table, delimiter=", ", fmt="%.17g")

    rows(slice(None))
    every = gradient()
    write(main, moves, "STEPS= 1\n")
    restarts(mesh.with_points(points), weights)
    np.testing.assert_allclose(gradient(), every, rtol=1e-9)
    # A row for each place only: that of the node that moves.
    write(main + "DV_SENSITIVITY_FORMAT= UNORDERED_ASCII\n", moves, "STEPS= 1\n")
    nodes = mesh.marker("BLOCK").nodes
    rows(nodes)
    assert gradient() == pytest.approx((weights[nodes] @ [2.0, 1.0]).sum(), rel=1e-9)


def test_a_surface_file_numbers_the_nodes_of_its_zone(here, capsys):
    mesh = sv.read("stage.su2")
    rows = []
    for number, part in enumerate(mesh.parts, 1):
        nodes = part.mesh.marker("BLOCK").nodes
        new = part.mesh.points[nodes] + [0.0, 0.01 * number]
        lines = [f"{node} {x!r} {y!r}" for node, (x, y) in zip(nodes, new.tolist(), strict=True)]
        Path(f"{number}.dat").write_text("\n".join(lines))
        rows += [f"{number}:{line}" for line in lines]
    Path("all.dat").write_text("\n".join(rows))
    kind = "DV_KIND= SURFACE_FILE\nDV_FILENAME= "
    main = MAIN[: MAIN.index("DV_KIND")]
    write(main, f"{kind}1.dat\n", f"{kind}2.dat\n")
    points = deformed()
    for number in (1, 2):
        nodes = mesh.marker(f"{number}:BLOCK").nodes
        shift = points[nodes] - mesh.points[nodes]
        np.testing.assert_allclose(shift, [[0.0, 0.01 * number]] * len(nodes), atol=1e-15)
    single = ONE[: ONE.index("DV_KIND")].replace("2:inner", "2:inner, 2:outer") + kind
    write(f"{single}all.dat\n")
    assert np.array_equal(deformed(), points)
    write(f"{single}1.dat\n")
    assert run(["def", "main.cfg", "-q"]) != 0
    assert "1.dat:1: '16 " in capsys.readouterr().err


BOXED = """FFD_DEFINITION= (BOX, 0.4, -0.2, 0, 1.3, -0.2, 0, 1.3, 0.6, 0, 0.4, 0.6, 0, \\
  0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
FFD_DEGREE= (3, 2, 0)
"""
MOVES = """DV_KIND= FFD_CONTROL_POINT_2D, FFD_CONTROL_POINT_2D
DV_PARAM= (BOX, 1, 1, 0, 1); (BOX, 2, 1, 1, 0)
DV_VALUE= 0.02, GIVEN
"""


def test_one_box_moves_boundaries_of_two_zones(tmp_path, monkeypatch, capsys):
    """As in SU2, one section after the last zone has the boxes, and lists nodes of all zones."""
    monkeypatch.chdir(tmp_path)
    path = stage(tmp_path)
    first, _, second = path.read_text().partition("IZONE= 2")
    path.write_text(f"{first}IZONE= 2{second.replace('MARKER_TAG= ', 'MARKER_TAG= rotor_')}")
    mesh = sv.read(path)
    main = MAIN[: MAIN.index("MARKER_SYM")] + BOXED + "DV_MARKER= ( BLOCK, rotor_BLOCK )\n"
    write(f"{main}DV_KIND= FFD_SETTING\n", "STEPS= 1\n", "STEPS= 1\n")
    assert run(["def", "main.cfg"]) == 0
    assert "FFD box BOX: 16 surface nodes" in capsys.readouterr().out
    text = Path("out.su2").read_text()
    assert text.count("FFD_NBOX") == 1
    assert text.index("FFD_NBOX") > text.index("IZONE= 2")
    boxed = Path("out.su2").rename("stage.su2")
    weights = np.random.default_rng(5).normal(size=mesh.points.shape)

    def prepare(value):
        write(main + MOVES.replace("GIVEN", repr(value)) + LISTED, "STEPS= 1\n", "STEPS= 1\n")

    ends = []
    for value in (0.03 + 1e-4, 0.03 - 1e-4, 0.03):
        prepare(value)
        points = deformed()
        ends.append((weights * points).sum())
    (before,), (after,) = boxes_of(sv.read(boxed)), boxes_of(sv.read("out.su2"))
    assert not np.array_equal(before.points, after.points)
    for marker, (nodes, uvw) in after.embedded.items():
        assert np.array_equal(mesh.marker(marker).nodes, nodes)
        np.testing.assert_allclose(after.at(uvw)[:, :2], points[nodes], atol=1e-12)
    restarts(mesh.with_points(points), weights)
    slope = (ends[0] - ends[1]) / 2e-4
    assert gradient()[1] == pytest.approx(slope, rel=1e-6)
    # The same box from the configuration, which is written with all its nodes.
    path.write_text(text.partition("FFD_NBOX")[0])
    assert np.array_equal(deformed(), points)
    (new,) = boxes_of(sv.read("out.su2"))
    assert np.array_equal(new.points, after.points)
    assert new.embedded.keys() == after.embedded.keys()


@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize(
    ("first", "second", "held"),
    [
        ("FFD_CONTINUITY= NO_DERIVATIVE\n", "FFD_CONTINUITY= NO_DERIVATIVE\n", 3),
        ("FFD_CONTINUITY= NO_DERIVATIVE\n", "", 3),
        ("", "FFD_CONTINUITY= USER_INPUT\nFFD_FIX_J= (0, 1)\n", 6),
        ("", "", 0),
    ],
)
def test_what_continuity_holds_in_one_zone_is_held_in_all(
    tmp_path, monkeypatch, capsys, first, second, held, degree
):
    """Here y_m of zone 1 leaves the box that the interface of both zones lies in."""
    monkeypatch.chdir(tmp_path)
    sv.write("stage.su2", zones_in_a_row(2, (4, 4)))
    one, _, two = Path("stage.su2").read_text().partition("IZONE= 2")
    Path("stage.su2").write_text(f"{one}IZONE= 2{two.replace('_TAG= ', '_TAG= b_')}")
    mesh = sv.read("stage.su2")
    main = MAIN[: MAIN.index("MARKER_SYM")]
    box = f"""FFD_DEFINITION= (BOX, 0.6, -0.5, 0, 1.4, -0.5, 0, 1.4, 1.5, 0, 0.6, 1.5, 0, \\
  0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
FFD_DEGREE= ({degree}, 2, 0)
"""
    points = [(i, j) for i in range(degree + 1) for j in range(3)]
    kinds = f"DV_KIND= {', '.join(['FFD_CONTROL_POINT_2D'] * len(points))}\n"
    places = "; ".join(f"(BOX, {i}, {j}, 0.5, 1)" for i, j in points)
    values = ", ".join(["0.01"] * len(points))
    main += f"{box}{kinds}DV_PARAM= {places}\nDV_VALUE= {values}\n"
    write(main, f"DV_MARKER= (x_p, y_m)\n{first}", f"DV_MARKER= (b_x_m)\n{second}")
    assert run(["def", "main.cfg", "--force", "--json", "r.json", "-q"]) == 0
    said = capsys.readouterr().err
    assert "no longer fits" not in said
    assert ("will do nothing" in said) == (held > 0)
    assert ("SU2 would hold" in said) == (held == 0)
    moved = sv.read("out.su2").points
    for each in mesh.interfaces:
        assert np.abs(moved[each.nodes] - moved[each.partners]).max() < 1e-12
    assert np.abs(moved - mesh.points)[mesh.interfaces[0].nodes].max() > 1e-4
    surface = make_surface(on_mesh(read_config(Path("main.cfg")), mesh), mesh)
    assert sum(surface.idle) == (held if held < 6 else 2 * (degree + 1))
