"""SU2's CONFIG_LIST: ``slideviz def`` and ``slideviz dot`` with a configuration for each zone."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.su2.config import read_config
from slideviz.design.su2.on_mesh import read_mesh
from slideviz.errors import CaseError
from slideviz.mesh.zones import zones_of
from tests.mesh.test_interfaces import zones as square_and_core
from tests.solver.test_zones import stage

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


def test_a_file_for_each_zone_is_written_as_one(here):
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
        assert not np.array_equal(points[mesh.zone_parts[1].points], zones_of(mesh)[1].points)
    write(main, "STEPS= 1\n", "DV_KIND= NO_DEFORMATION\n")
    assert run(["def", "main.cfg", "-q"]) == 0
    assert np.array_equal(sv.read("out.su2").points, mesh.points)


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
