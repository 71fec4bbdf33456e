"""Boundaries that coincide with boundaries of another zone: found, guessed fixed, and warned of."""

import json

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run as command
from slideviz.formats.su2.write import su2_blocks
from slideviz.session.opening import guess_roles, open_mesh
from slideviz.session.state import StepFrame
from tests.builders import grid, square


def zones(folder, name="zones.su2", spoil=""):
    """Write a square with a hole as zone 1, and what fills the hole as zone 2."""
    inside = grid((2, 2), place=lambda p: (2.0 + p) / 6.0, rules=[("core", lambda p: True)])
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in (square(6), inside)]
    texts[1] = texts[1].replace("NPOIN= 9", spoil or "NPOIN= 9")
    path = folder / "zones.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{texts[0]}IZONE= 2\n{texts[1]}")
    if name.endswith("b"):
        sv.convert(path, folder / name)
    return folder / name


def moved(mesh_file, **values):
    return sv.Case(
        mesh_file=mesh_file,
        zone=1,
        roles={"BLOCK": "moving"},
        motions=(sv.Translate("BLOCK", (0.0, 0.01)),),
        **values,
    )


@pytest.mark.parametrize("name", ["zones.su2", "zones.su2b"])
def test_interfaces_are_found_from_both_sides(tmp_path, name):
    path = zones(tmp_path, name)
    one, two = sv.read(path, zone=1), sv.read(path, zone=2)
    ((block,), (core,)) = one.interfaces, two.interfaces
    assert (block.marker, block.zone, block.other) == ("BLOCK", 2, "core")
    assert (core.marker, core.zone, core.other) == ("core", 1, "BLOCK")
    assert np.array_equal(block.nodes, one.marker("BLOCK").nodes)
    there = two.points[two.marker("core").nodes[block.partners]]
    assert np.allclose(one.points[block.nodes], there, atol=1e-12)
    assert block.describe() == "an interface with core of zone 2 (8 nodes in common)"
    assert one.with_points(one.points + 1.0).interfaces == one.interfaces


def test_boundaries_that_only_touch_are_none(tmp_path):
    beside = grid((2, 2), place=lambda p: 1.0 + p / 6.0, rules=[("core", lambda p: True)])
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in (square(6), beside)]
    path = tmp_path / "m.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{texts[0]}IZONE= 2\n{texts[1]}")
    assert sv.read(path).interfaces == ()


def test_a_zone_that_cannot_be_read_is_no_reason_to_refuse_another(tmp_path):
    assert sv.read(zones(tmp_path, spoil="NPOIN= 8"), 1).interfaces == ()


def test_interfaces_are_guessed_fixed(tmp_path):
    mesh = sv.read(zones(tmp_path), 1)
    guess = guess_roles(mesh)["BLOCK"]
    assert (guess.role, guess.reason) == ("fixed", f"it is {mesh.interfaces[0].describe()}")
    frame = StepFrame(mesh, sv.quality(mesh))
    assert open_mesh(frame, None).case.roles["BLOCK"] == "fixed"
    assert open_mesh(frame, None, (), moved(None)).case.roles["BLOCK"] == "moving"


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize("name", ["zones.su2", "zones.su2b"])
def test_a_run_that_moves_one_says_which_zone_no_longer_fits(tmp_path, name, stream, capsys):
    moved(zones(tmp_path, name)).write(tmp_path / "c.cfg")
    words = ["run", str(tmp_path / "c.cfg"), "-o", str(tmp_path / f"out{name[5:]}")]
    words += ["--json", str(tmp_path / "r.json"), *["--stream"] * stream]
    assert command(words) == 0
    told = json.loads((tmp_path / "r.json").read_text())["warnings"]
    assert (
        "zone 2 no longer fits: BLOCK, which is an interface with its core, has moved by up to "
        "0.01; keep it fixed, or deform all zones (without ZONE=)" in told
    )
    capsys.readouterr()
    assert command(["info", str(tmp_path / name), "--zone", "1", *["--stream"] * stream]) == 0
    assert "BLOCK is an interface with core of zone 2" in capsys.readouterr().out


def test_a_design_that_moves_all_of_a_zone_says_which_other_no_longer_fits(tmp_path, capsys):
    text = f"MESH_FILENAME= {zones(tmp_path)}\nMESH_OUT_FILENAME= {tmp_path / 'out.su2'}\n"
    text += "ZONE= 1\nDV_KIND= TRANSLATE_GRID\nDV_PARAM= (0, 1, 0)\nDV_VALUE= 0.01\n"
    (tmp_path / "a.cfg").write_text(text)
    assert command(["def", str(tmp_path / "a.cfg"), "-q"]) == 0
    assert "zone 2 no longer fits: BLOCK, which is an interface" in capsys.readouterr().err


def test_a_deformer_that_moves_one_says_which_zone_no_longer_fits(tmp_path):
    mesh, case = sv.read(zones(tmp_path), 1), moved(tmp_path)
    (said,) = sv.Deformer(mesh, case).warnings
    assert said.startswith("zone 2 no longer fits: BLOCK, which is an interface with its core")
    assert sv.Deformer(mesh, case, np.zeros((8, 2))).warnings == ()


def test_a_run_that_leaves_it_in_place_says_nothing(tmp_path):
    mesh = sv.read(zones(tmp_path))
    case = sv.Case(roles={"x_p": "moving"}, motions=(sv.Translate("x_p", (0.01, 0.0)),))
    *_, step = sv.deform(case, mesh)
    assert not [text for text in step.warnings if "no longer fits" in text]
