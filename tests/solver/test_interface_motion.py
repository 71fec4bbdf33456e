"""Several zones of a file deformed together: each as alone, and coincident nodes together."""

import json
import lzma
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.limits import read_limits
from slideviz.case.zone_cases import with_marker_names, zone_cases
from slideviz.cli import run as command
from slideviz.errors import CaseError, MeshError
from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.zones import zones_of
from slideviz.session.large import is_large
from slideviz.session.motions import Ghosts, TableRows
from slideviz.session.opening import guess_roles
from slideviz.solver.prepare import prepare
from tests.builders import nested_zones, sector, zones_in_a_row
from tests.mesh.test_interfaces import zones

SHARED = Path(__file__).parents[3] / "shared" / "meshes" / "su2"
SLIDES = {"sliding": "ps", "periodic": "moving", "steps": 2}


def stage(folder):
    """Write two sectors of different pitch, whose boundaries have the same names, as zones."""
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in (sector(6), sector(5, 20.0, low=0.7))]
    path = folder / "stage.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{texts[0]}IZONE= 2\n{texts[1]}")
    return path


def last(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def roles_of(zone):
    roles = {"BLOCK": "moving", "per1": "periodic", "per2": "periodic", "inner": "sliding"}
    return {f"{zone}{name}": role for name, role in roles.items()}


def turn(zone):
    return sv.Rotate(f"{zone}BLOCK", 1.0, (0.0, 0.0))


def both():
    roles = roles_of("1:") | roles_of("2:")
    return sv.Case(roles=roles, motions=(turn("1:"), turn("2:")), **SLIDES)


@pytest.mark.parametrize("steps", [2, 0])
def test_each_zone_is_deformed_as_alone_to_the_bit(tmp_path, steps):
    path = stage(tmp_path)
    mesh = sv.read(path)
    step = last(both().change(steps=steps), mesh)
    assert "1:BLOCK" in mesh.marker_names
    assert (step.index, step.part) == (step.total, 1.0)
    controls = 0
    for number, points in enumerate((zone.points for zone in zones_of(step.mesh)), 1):
        case = sv.Case(roles=roles_of(""), motions=(turn(""),), **SLIDES | {"steps": steps})
        alone = last(case, sv.read(path, number))
        assert np.array_equal(points, alone.mesh.points)
        controls += alone.control_nodes
    assert step.control_nodes == controls == len(step.control)
    assert step.periodic_misfit < 1e-14


def test_a_zone_without_motion_keeps_every_bit_and_zone_selects_one(tmp_path):
    path = stage(tmp_path)
    case = sv.Case(roles=roles_of("2:"), motions=(turn("2:"),), **SLIDES)
    mesh = sv.read(path)
    one, two = zones_of(last(case, mesh).mesh)
    assert np.array_equal(one.points, zones_of(mesh)[0].points)
    alone = last(case.change(zone=2), sv.read(path, 2))
    assert np.array_equal(two.points, alone.mesh.points)
    with pytest.raises(
        CaseError, match=r"ZONE= 2, but stage\.su2 is all 2; read that zone or chang"
    ):
        last(case.change(zone=2), mesh)


def test_one_zone_of_a_case_that_names_all(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, alone = stage(tmp_path), sv.Case(roles=roles_of(""), motions=(turn(""),), **SLIDES)
    limit, span = read_limits("first-height@1:BLOCK > 1, min > 0.1"), ("1:inner", "1:outer")
    case = both().change(mesh_file=path, limits=limit, span=span, zone=2)
    expected, step = (last(one, sv.read(path, 2)) for one in (alone.change(zone=2), case))
    assert np.array_equal(expected.mesh.points, step.mesh.points)
    note = "zone 2 alone: 5 boundaries of other zones left out (1:BLOCK, 1:inner, 1:outer, ...)"
    assert note in step.warnings
    case.change(zone=None, steps=1).write("case.cfg")
    assert command(["run", "case.cfg", "--zone", "2", "-o", "new.su2"]) == 0
    assert note in capsys.readouterr().err
    assert np.array_equal(sv.read("new.su2", 1).points, sv.read(path, 1).points)
    cut = ["section", "new.su2", "--plane", "y=0.3", "-o", "cut.svg", "--copies", "1"]
    assert command([*cut, "--case", "case.cfg", "--zone", "2"]) == 0
    assert note in capsys.readouterr().err
    sv.convert(path, "single.su2", zone=2)
    assert any("'1:BLOCK'" in text for text in map(str, check_case(case, sv.read("single.su2"))))


def test_a_boundary_without_motion_has_the_number_of_its_zone(tmp_path):
    case = both().change(motions=(turn("3:"), turn("2:")))
    wrong, unmoved = check_case(case, sv.read(stage(tmp_path)))
    assert str(wrong).startswith("MOTION: stage.su2 has no marker '3:BLOCK'; did you mean ")
    assert str(unmoved).startswith("moving marker '1:BLOCK' has no motion")


def test_a_name_of_several_zones_needs_its_number(tmp_path):
    case = sv.Case(roles={"BLOCK": "moving"}, motions=(turn(""),))
    with pytest.raises(CaseError, match="have a marker 'BLOCK'; write 1:BLOCK or 2:BLOCK"):
        last(case, sv.read(stage(tmp_path)))
    case = sv.Case(roles={"1:BLOCK": "moving"}, motions=(turn(""),), limits="growth@BLOCK < 2")
    (said,) = check_case(case, sv.read(stage(tmp_path)))
    assert str(said).endswith("have a marker 'BLOCK'; write 1:BLOCK or 2:BLOCK")
    case = sv.Case(roles={"1:BLOCK": "moving"}, motions=(turn(""),))
    (said,) = check_case(case, sv.read(stage(tmp_path)))
    assert str(said).startswith("MOTION: several zones of ")


BLOCKS = ("1:BLOCK", "2:BLOCK")
SLIDE = sv.Translate("2:BLOCK", (0.01, 0.0))


@pytest.mark.parametrize("motion", [sv.Rotate(BLOCKS, 1.0), sv.Scale("", (1.02,))])
def test_boundaries_of_several_zones_move_about_their_common_centroid(tmp_path, motion):
    """The second motion begins where the first one ends; common nodes would count once."""
    mesh = sv.read(stage(tmp_path))
    case = both().change(motions=(SLIDE, motion))
    nodes = [mesh.marker(name).nodes for name in BLOCKS]
    start = [mesh.points[nodes[0]], mesh.points[nodes[1]] + SLIDE.vector]
    centre = np.concatenate(start).mean(axis=0)
    if isinstance(motion, sv.Rotate):
        c, s = np.cos(np.radians(1.0)), np.sin(np.radians(1.0))
        ends = [centre + (one - centre) @ np.array([[c, s], [-s, c]]) for one in start]
    else:
        ends = [centre + 1.02 * (one - centre) for one in start]
    moved = last(case, mesh).mesh.points
    for mine, end in zip(nodes, ends, strict=True):
        np.testing.assert_allclose(moved[mine], end, atol=1e-14)
    given = case.change(motions=(SLIDE, sv.Rotate(BLOCKS, 1.0, tuple(centre.tolist()))))
    if isinstance(motion, sv.Rotate):
        np.testing.assert_allclose(moved, last(given, mesh).mesh.points, atol=1e-13)
    np.testing.assert_allclose(sv.Deformer(mesh, case).deform(), moved, atol=1e-13)
    ghosts = Ghosts(mesh).moved(case)
    np.testing.assert_allclose(ghosts["2:BLOCK"], ends[1], atol=1e-14)


def test_a_displacement_file_of_several_zones_names_them(tmp_path):
    mesh = sv.read(stage(tmp_path))
    path, vectors = tmp_path / "d.txt", {}
    rows = ["% zone:node dx dy"]
    for number, part in enumerate(mesh.parts, 1):
        for k, node in enumerate(part.mesh.marker("BLOCK").nodes):
            vectors[node + part.points.start] = 0.01 * number, 0.001 * k
            rows.append(f"{number}:{node}, {0.01 * number}, {0.001 * k}")
    path.write_text("\n".join(rows))
    case = both().change(
        motions=(sv.FromFile(path),), periodic="none", roles=dict.fromkeys(BLOCKS, "moving")
    )
    moved = last(case, mesh).mesh.points - mesh.points
    np.testing.assert_allclose(moved[[*vectors]], [*vectors.values()], atol=1e-14)
    deformer = sv.Deformer(mesh, case)
    assert np.array_equal(deformer.displacement, [*vectors.values()])
    np.testing.assert_allclose(deformer.deform() - mesh.points, moved, atol=1e-13)
    path.write_text("\n".join(rows[:-1]))
    assert any("1 of 8 nodes" in text for text in last(case, mesh).warnings)
    for text, message in (
        (
            "1:16 0 0\n17 0 0\n3:1 0 0\n",
            r"d.txt:2: '17 0 0' begins with none of the zones 1 and 2; wr",
        ),
        ("1:16 0 0\n", "lists no node of zone 2"),
        ("1:16 0 0\n2:0 0 0\n", r"d.txt:2: node 0 is not on a moving marker"),
    ):
        path.write_text(text)
        with pytest.raises(CaseError, match=message):
            last(case, mesh)


@pytest.mark.parametrize("zone", [None, 2])
def test_a_displacement_file_of_one_zone_may_name_it(tmp_path, zone):
    mesh, path = sv.read(stage(tmp_path), zone), tmp_path / "d.txt"
    nodes = sv.read(tmp_path / "stage.su2", 2).marker("BLOCK").nodes.tolist()
    case = sv.Case(roles={"2:BLOCK": "moving"}, motions=(sv.FromFile(path, "2:BLOCK"),), relax="no")

    def moved(prefix):
        path.write_text("% zone:node\n" + "".join(f"{prefix}{n} 0.01 0\n" for n in nodes))
        return last(case, mesh).mesh.points

    assert np.array_equal(moved("2:"), moved(""))
    with pytest.raises(CaseError, match=r"txt:2: '1:.* does not begin with zone 2; write zone and"):
        moved("1:")
    table = TableRows.on(mesh, with_marker_names(case, mesh), ())
    rows = "".join(f"2:{n} 0.01 0\n" for n in nodes)
    assert table.check(rows).startswith(f"{len(nodes)} of {len(nodes)} nodes of ")


def test_what_one_motion_cannot_do_in_several_zones(tmp_path):
    mesh = sv.read(stage(tmp_path))
    for motion, parted in (
        (sv.Onto(tmp_path / "d.stl", BLOCKS), False),
        (sv.Rotate("", 1.0), True),
    ):
        case = both().change(motions=(motion,))
        with pytest.raises(CaseError, match="motion 1 is of boundaries of several zones together"):
            zone_cases(case, mesh, parted)


def test_a_displacement_file_numbers_the_nodes_of_its_zone(tmp_path):
    path = stage(tmp_path)
    alone = sv.read(path, 2)
    nodes = alone.marker("BLOCK").nodes
    listed = "\n".join(f"{node} 0.01 {0.001 * k}" for k, node in enumerate(nodes))
    (tmp_path / "d.txt").write_text(listed)

    def case(zone):
        motion = sv.FromFile(tmp_path / "d.txt", f"{zone}BLOCK")
        return sv.Case(roles=roles_of(zone), motions=(motion,), sliding="ps")

    mesh = sv.read(path)
    moved = last(case("2:"), mesh).mesh
    assert np.array_equal(zones_of(moved)[1].points, last(case(""), alone).mesh.points)
    ghost = Ghosts(mesh).moved(case("2:"))["2:BLOCK"]
    np.testing.assert_allclose(ghost, moved.points[mesh.marker("2:BLOCK").nodes], atol=1e-15)


def test_errors_and_warnings_name_the_zone(tmp_path):
    mesh = sv.read(stage(tmp_path))
    case = both().change(motions=(turn("1:"), sv.Translate("2:BLOCK", (5.0, 0.0))))
    with pytest.raises(CaseError, match="zone 2: "):
        last(case, mesh)
    step = last(both().change(reduction=sv.Reduction(tolerance=1.0)), mesh)
    assert {text.partition(":")[0] for text in step.warnings} == {"zone 1", "zone 2"}


def pair(folder):
    """Return the mesh of a square around a core, with the core as its second zone."""
    return sv.read(zones(folder))


def test_progress_and_margin_name_the_zone(tmp_path):
    seen = []
    case = both().change(motions=(turn("1:"), sv.Rotate("2:BLOCK", 90.0)))
    *_, step = sv.deform(case, sv.read(stage(tmp_path)), seen.append, certify=True)
    assert [*dict.fromkeys(now.of_zone for now in seen)] == [" of zone 1", " of zone 2"]
    assert [*dict.fromkeys((now.zone, now.step, now.total) for now in seen)] == [
        *[(1, 1, 4), (1, 2, 4), (2, 3, 4), (2, 4, 4)]
    ]
    assert step.safe.zone == 2
    assert "(quadrilateral of zone 2) at (" in step.safe.words
    assert step.safe.report()["safe_zone"] == 2
    assert "safe_zone" not in type(step.safe)(1.0).report()


MOVE = (0.02, 0.01)


@pytest.mark.parametrize("lead", ["BLOCK", "2:core"])
@pytest.mark.parametrize("steps", [1, 3])
def test_an_interface_follows_the_zone_that_moves_it(tmp_path, lead, steps):
    mesh = pair(tmp_path)
    assert guess_roles(mesh)["core"].role == "fixed"
    case = sv.Case(roles={lead: "moving"}, motions=(sv.Translate(lead, MOVE),), steps=steps)
    step = last(case, mesh)
    for each in mesh.interfaces:
        gap = step.mesh.points[each.nodes] - step.mesh.points[each.partners]
        before = mesh.points[each.nodes] - mesh.points[each.partners]
        assert np.abs(gap - before).max() < 1e-15
    assert not [text for text in step.warnings if "no longer fits" in text]
    shift = zones_of(step.mesh)[1].points - zones_of(mesh)[1].points
    np.testing.assert_allclose(shift, np.tile(MOVE, (9, 1)), atol=0.002)  # the middle overshoots


def test_named_pairs_are_the_interfaces(tmp_path):
    mesh = pair(tmp_path)
    case = sv.Case(roles={"BLOCK": "moving"}, motions=(sv.Translate("BLOCK", MOVE),))
    known = last(case, mesh)
    path = tmp_path / "c.cfg"
    case.change(interfaces=("BLOCK", "2:core")).write(path)
    assert "MARKER_ZONE_INTERFACE= ( BLOCK, 2:core )" in path.read_text()
    named = sv.Case.read(path)
    step = last(named, mesh)
    assert np.array_equal(step.mesh.points, known.mesh.points)
    assert not [text for text in step.warnings if "INTERFACE" in text or "fits" in text]
    step = last(case.change(interfaces=("x_m", "core")), mesh)
    assert np.array_equal(zones_of(step.mesh)[1].points, zones_of(mesh)[1].points)
    said = " ".join(step.warnings)
    assert "MARKER_ZONE_INTERFACE: x_m and core do not coincide (closest nodes 0.3" in said
    assert "zone 2 no longer fits: BLOCK" in said
    told = sv.Deformer(mesh, case.change(interfaces=("x_m", "core"))).warnings
    assert any("do not coincide" in text for text in told)
    with pytest.raises(CaseError, match=r"MARKER_ZONE_INTERFACE: .* has no marker 'cor'; did you"):
        last(case.change(interfaces=("BLOCK", "cor")), mesh)
    with pytest.raises(CaseError, match="MARKER_ZONE_INTERFACE: BLOCK are not pairs of boundaries"):
        last(case.change(interfaces=("BLOCK",)), mesh)
    path.write_text(path.read_text().replace(", 2:core", ""))
    with pytest.raises(
        CaseError, match=r"MARKER_ZONE_INTERFACE: '\( BLOCK \)' has 1 name; expected"
    ):
        sv.Case.read(path)


def test_a_pair_that_is_not_named_is_told_to_be(tmp_path):
    mesh = nested_zones()
    case = sv.Case(
        roles={"1:inner": "moving"},
        motions=(sv.Translate("1:inner", (0.01, 0.0)),),
        interfaces=("2:inner", "3:outer"),
    )
    for told in (last(case, mesh).warnings, sv.Deformer(mesh, case).warnings):
        (said,) = [text for text in told if "no longer fits" in text]
        assert said.endswith("; name both in MARKER_ZONE_INTERFACE, so that they stay together")


def test_steps_of_zones_that_follow_are_told_of_at_the_end_only():
    mesh = zones_in_a_row(2, (4, 5), 0.05)
    case = sv.Case(
        roles={"1:y_m": "moving", "1:x_p": "sliding"},
        motions=(sv.Translate("1:y_m", (0.02, -0.03)),),
        sliding="ps",
        steps=3,
    )
    steps = list(sv.deform(case, mesh))
    assert not [text for step in steps for text in step.warnings if "no longer fits" in text]
    points = steps[-1].mesh.points
    each = mesh.interfaces[0]
    assert np.abs(points[each.nodes] - points[each.partners]).max() < 1e-15


def test_both_moved_apart_is_warned_of(tmp_path):
    mesh = pair(tmp_path)
    roles = dict.fromkeys(("BLOCK", "core"), "moving")
    motions = sv.Translate("BLOCK", MOVE), sv.Translate("core", (0.0, 0.0))
    told = last(sv.Case(roles=roles, motions=motions), mesh).warnings
    (said,) = [text for text in told if "no longer fits" in text]
    assert said.startswith("zone 2 no longer fits: BLOCK")
    assert "move both alike" in said


def test_nodes_that_slide_take_the_other_zone_along(tmp_path):
    """Two squares share the side x = 1, along which the first one's nodes slide."""
    from tests.builders import grid

    left = grid((4, 4), place=lambda p: p / 4.0)
    right = grid((4, 4), place=lambda p: p / 4.0 + [1.0, 0.0])
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in (left, right)]
    path = tmp_path / "m.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{texts[0]}IZONE= 2\n{texts[1]}")
    mesh = sv.read(path)
    roles = {"1:x_m": "moving", "1:x_p": "sliding", "1:y_m": "sliding", "1:y_p": "sliding"}
    roles |= {"2:y_m": "fixed", "2:y_p": "fixed"}
    motions = (sv.Scale("1:x_m", (1.0, 0.9), (0.0, 0.0)),)
    case = sv.Case(roles={"1:x_m": "moving", "1:x_p": "sliding"}, motions=motions, sliding="ps")
    step = last(case, mesh)
    (here,) = [each for each in mesh.interfaces if each.marker == "1:x_p"]
    moved = step.mesh.points - mesh.points
    assert np.abs(moved[here.nodes]).max() > 1e-3
    assert np.array_equal(step.mesh.points[here.nodes], step.mesh.points[here.partners])


@pytest.mark.parametrize("name", ["out.su2", "out.su2b", "out.vtu"])
def test_the_command_writes_all_zones_together(tmp_path, name, capsys):
    path = stage(tmp_path)
    both().change(mesh_file=path).write(tmp_path / "c.cfg")
    words = ["run", str(tmp_path / "c.cfg"), "-o", str(tmp_path / name)]
    assert command([*words, "--json", str(tmp_path / "r.json")]) == 0
    report = json.loads((tmp_path / "r.json").read_text())
    assert (report["zone"], report["zones"]) == (None, 2)
    assert "periodic moving, all 2 zones" in capsys.readouterr().out
    points = last(both(), sv.read(path)).mesh.points
    assert np.array_equal(sv.read(tmp_path / name).points, points)
    assert command(["info", str(path)]) == 0
    out = capsys.readouterr().out
    assert "2:BLOCK" in out
    assert "match: rotational, 30° about z" in out
    assert "match: rotational, 20° about z" in out


def test_a_binary_of_several_zones_is_opened_in_memory(tmp_path):
    path = zones(tmp_path, "zones.su2b")
    assert not is_large(path, None)
    assert not is_large(path, 2)


def test_a_setup_is_of_one_zone(tmp_path):
    from slideviz.solver.setup import make_setup

    with pytest.raises(MeshError, match=r"stage\.su2: has 2 zones, but a setup is of one; choose"):
        make_setup(prepare(both(), sv.read(stage(tmp_path))))


def test_bad_cells_of_all_zones_are_mended(tmp_path):
    mesh = sv.read(stage(tmp_path))
    points = mesh.points.copy()
    centre = np.flatnonzero(np.isin(np.arange(len(points)), mesh.cells.nodes))
    inner = np.setdiff1d(centre, np.concatenate([m.nodes for m in mesh.markers]))
    first, second = inner[0], inner[-1]
    points[[first, second]] += 0.15
    folded = mesh.with_points(points)
    assert sv.quality(folded).inverted > 1
    mended = sv.repair(folded, mesh, fixed=("1:inner",))
    assert len(mended.left) == 0
    assert sv.quality(mended.mesh).inverted == 0
    assert {first, second} <= set(mended.nodes.tolist())


# Real meshes ----------------------------------------------------------------------------


def real(folder, name):
    packed = SHARED / f"{name}.su2.xz"
    if not packed.exists():
        return SHARED / f"{name}.su2"
    path = folder / f"{name}.su2"
    path.write_bytes(lzma.decompress(packed.read_bytes()))
    return path


MIXER = {
    "sliding_interface_channel_2D_channel_2D": ("wall", "internal_interface", "inner_interface"),
    "turbomachinery_centrifugal_stage_su2mesh_periodic": ("wall1", "wall3"),
    "coupled_cht_disc_adj_unsteadyCHT_cylinder_MeshCHT": ("farfield", "inner_pin"),
}


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.exists(), reason="the real meshes are not here")
@pytest.mark.parametrize("name", MIXER)
def test_zones_of_real_meshes_move_as_alone(tmp_path, name):
    path = real(tmp_path, name)
    mesh = sv.read(path)
    far = 1e-3 * mesh.extent
    motions = [sv.Translate(marker, (far, far)) for marker in MIXER[name]]
    case = sv.Case(roles=dict.fromkeys(MIXER[name], "moving"), motions=tuple(motions))
    found = zones_of(last(case, mesh).mesh)
    for number, (marker, motion) in enumerate(zip(MIXER[name], motions, strict=True), 1):
        one = case.change(roles={marker: "moving"}, motions=(motion,))
        alone = last(one, sv.read(path, number))
        assert np.array_equal(found[number - 1].points, alone.mesh.points)


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.exists(), reason="the real meshes are not here")
@pytest.mark.parametrize("name", ["2d_two_zones", "3d_coarse"])
def test_pins_of_a_real_mesh_take_the_solid_along(tmp_path, name):
    mesh = sv.read(real(tmp_path, f"incomp_chtPinArray_{name}"))
    pin = next(marker for marker in mesh.marker_names if marker.startswith("fluid_pin2"))
    sides = [m for m in mesh.marker_names if "sym" in m or "inner" in m or "walls" in m]
    roles = {pin: "moving"} | dict.fromkeys(sides, "sliding")
    shift = (1e-3 * mesh.extent, *[0.0] * (mesh.dim - 1))
    if mesh.dim == 3:
        free = "fluid_bottom_interface", "fluid_top", "solid_pins_top"
        roles |= dict.fromkeys(free, "sliding")
    case = sv.Case(roles=roles, motions=(sv.Translate(pin, shift),), sliding="ps", steps=2)
    step = last(case, mesh)
    for each in mesh.interfaces:
        here, there = (step.mesh.points[nodes] for nodes in (each.nodes, each.partners))
        assert np.array_equal(here, there)
    assert sv.quality(step.mesh, mesh).inverted == 0
