"""Sections of constant span: what they cut, how they lie flat, and where walls come from."""

import json
from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.keys import write_sections
from slideviz.cli import run
from slideviz.errors import CaseError
from slideviz.mesh.quality import quality
from slideviz.mesh.zones import join_zones
from slideviz.samples.impeller import impeller_mesh
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.span import find_walls
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.passages import find_periods, keeps
from slideviz.session.saving import view_to_case, with_walls
from slideviz.session.section_cuts import can_cut, first_section, position_range
from slideviz.session.state import StepFrame
from slideviz.streaming.source import MemorySource, cut_cells
from tests.builders import cube, pair, passage, stage

HALF = Section("span", span=0.5)


def bound(mesh, span=0.5, **others):
    return Section("span", span=span, walls=find_walls(mesh, **others))


def test_between_cylinders_it_is_a_cylinder():
    mesh = passage()
    cut = Cutter(mesh).cut(mesh.points, bound(mesh, 0.3))
    same = Cutter(mesh).cut(mesh.points, Section("cylinder", radius=0.65))
    assert cut.cells.tolist() == same.cells.tolist()
    # The walls are the chords of their facets only across theta, which does not count.
    assert cut.points == pytest.approx(same.points, abs=1e-12)
    # m' is z over the radius there; theta is the angle.
    section = bound(mesh, 0.3)
    flat = section.flatten(cut, None, None)
    at = flat.points[flat.connectivity]
    assert np.ptp(at[:, 0]) == pytest.approx(1.0 / 0.65, rel=1e-5)
    assert np.ptp(at[:, 1]) == pytest.approx(np.radians(30.0), rel=1e-9)
    assert np.abs(at[:, 2]).max() < 1e-12


def test_a_radial_passage_is_cut_exactly_and_keeps_its_angles():
    mesh = impeller_mesh(3000)
    section = bound(mesh, 0.37)
    cut = Cutter(mesh).cut(mesh.points, section)
    spans = section.positions(cut.points)
    assert len(cut) > 100
    assert np.abs(spans - 0.37).max() < 1e-12
    # Angles between the edges of small polygons are as in space.
    flat = section.flatten(cut, None, None)
    assert len(flat.points) == len(cut.points)

    def cosines(polygons):
        first = polygons.points[polygons.connectivity[polygons.offsets[:-1]]]
        ends = [polygons.points[polygons.connectivity[polygons.offsets[:-1] + k]] for k in (1, 2)]
        a, b = ((end - first) / np.linalg.norm(end - first, axis=1)[:, None] for end in ends)
        return np.sum(a * b, axis=1)

    small = flat.with_points(flat.points * [1.0, 1.0, 0.0])
    assert np.median(np.abs(cosines(small) - cosines(cut))) < 0.01
    # Its handle: places of the surface are on the span, and the frame is around them.
    patch = section.patch(cut.points)
    on = section.surface(patch.places[::20], 0.37)
    off = np.abs(section.positions(on) - 0.37)
    assert np.median(off) < 1e-4
    assert off.max() < 0.02  # the facets of the walls have edges, which the spline rounds
    ends = [section.surface(np.array([patch.middle]), span) for span in (0.36, 0.38)]
    assert np.linalg.norm(ends[1] - ends[0]) / 0.02 == pytest.approx(0.3, rel=0.3)


def test_layers_of_nodes_that_are_nearly_on_it_are_not_cut_into_slivers():
    mesh = passage()
    section, rng = bound(mesh, 0.5), np.random.default_rng(3)
    regular = Cutter(mesh).cut(mesh.points, section)
    # As a relaxed mesh has it: nodes a hundredth of a cell above and below the layer.
    shaken = mesh.points * (1.0 + rng.uniform(-1e-3, 1e-3, (len(mesh.points), 1)) * [1, 1, 0])
    cut = Cutter(mesh).cut(shaken, section)
    assert cut.cells.tolist() == regular.cells.tolist()
    assert cut.sizes.tolist() == regular.sizes.tolist()
    assert np.abs(section.positions(cut.points) - 0.5).max() < 2e-3
    # A mesh in its file gets the same cells: those below, which touch it only so, are read too.
    block = next(MemorySource(mesh.with_points(shaken)).blocks())
    part = cut_cells([block], section)
    again = Cutter(part.mesh).cut(part.mesh.points, section)
    assert part.ids[again.cells].tolist() == regular.cells.tolist()
    assert len(part.ids) < len(mesh.cells)


def test_periods_about_its_axis_keep_it():
    mesh = passage()
    section = bound(mesh)
    turn = pair("rotational", 3, angle=np.radians(30.0))
    assert keeps(section, turn.matrix(1))
    assert not keeps(section, pair("translational", 3, vector=(0.0, 0.0, 1.0)).matrix(1))
    case = sv.Case(roles={"inflow": "periodic", "outflow": "periodic"})
    side = replace(pair("translational", 3, vector=(0.0, 0.0, 1.0)), first="inflow")
    with pytest.raises(CaseError, match=r"repeat by .*need an axis about which they turn"):
        find_walls(mesh, case, [side])
    # One that was guessed does not count.
    assert find_walls(mesh, None, [side])


def test_without_walls_it_cuts_nothing():
    assert not can_cut(passage(), HALF)
    assert HALF.needs(3) == "needs hub and shroud, or root and tip"
    assert HALF.needs(2) == "needs a 3D mesh"
    with pytest.raises(CaseError, match="needs hub and shroud, or root and tip: name them in SPAN"):
        HALF.distance(np.zeros((1, 3)))
    with pytest.raises(CaseError, match="the span 1 is not below 1; give a number between 0"):
        replace(HALF, span=1.0)


def session_of(mesh, case=None):
    return open_mesh(StepFrame(mesh, quality(mesh)), None, (), case)


def test_sessions_keep_it_with_the_walls_of_their_case():
    mesh = passage()
    session = session_of(mesh)
    section = first_section("span", session)
    assert (section.span, section.walls.words) == (0.5, "hub to shroud")
    assert position_range(section, mesh.points) == pytest.approx((0.0, 1.0))
    session = changes.add_section(session, replace(section, flat=True))
    case = view_to_case(session)
    assert "(span, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, cut, unrolled)" in write_sections(
        case.view["VIEW_SECTIONS"]
    )
    [again] = session_of(mesh, case).view.sections
    assert again == replace(section, flat=True)  # the walls are cached with the mesh
    swapped = changes.set_case(session, span=("shroud", "hub"))
    assert swapped.view.section.walls.channels[0].hub == "shroud"
    gone = changes.set_case(session, span=("inflow", "hub"))
    assert gone.view.section.walls is None
    [lost] = session_of(cube(), case).view.sections
    assert lost.walls is None
    new = first_section("span", session_of(cube()))
    assert (new.span, new.walls) == (0.5, None)
    with pytest.raises(CaseError, match="do not say between which the span goes"):
        with_walls(new, cube(), sv.Case())


def test_command_and_library_draw_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh = passage()
    sv.write("mesh.su2", mesh)
    assert run(["section", "mesh.su2", "--span", "0.9", "-o", "a.png", "--json", "a.json"]) == 0
    report = json.loads((tmp_path / "a.json").read_text())["section"]
    assert (report["span"], report["between"]) == (0.9, ["hub", "shroud"])
    words = ["section", "mesh.su2", "--span", "0.9", "--between", "shroud,hub", "-o", "b.svg"]
    assert run([*words, "--stream", "--copies", "1"]) == 0
    assert "90 % span from shroud to hub" in capsys.readouterr().out
    assert run(["section", "mesh.su2", "--plane", "z=0.5", *words[4:]]) == 2
    assert (
        "--between names the walls of --span and --meridional; give one" in capsys.readouterr().err
    )
    shown = sv.section("c.svg", mesh, span=0.9)
    swapped = sv.section("d.svg", mesh, span=0.1, between=("shroud", "hub"))
    assert shown.ids.tolist() == swapped.ids.tolist()
    with pytest.raises(CaseError, match="give either a section or a span"):
        sv.section("e.svg", mesh)


@pytest.mark.parametrize("span", [0.1, 0.3, 0.9])
def test_each_zone_is_cut_by_the_span_between_its_own_walls(span):
    mesh = stage()
    section = bound(mesh, span, periods=find_periods(mesh))
    assert section.describe() == f"{100 * span:g} % span from 1:hub to 1:shroud, 2:hub to 2:shroud"
    cut = Cutter(mesh).cut(mesh.points, section)
    alone = [
        Cutter(part.mesh).cut(part.mesh.points, bound(part.mesh, span)).cells + part.cells.start
        for part in mesh.parts
    ]
    assert cut.cells.tolist() == np.concatenate(alone).tolist()
    radius = 0.5 + 0.5 * span
    assert np.hypot(*cut.points[:, :2].T) == pytest.approx(radius, rel=0.02)
    # Laid flat, the second zone goes on where the first one ends: m' is z / r there.
    flat = section.flatten(cut, None, None)
    low, high = flat.points[:, 0].min(), flat.points[:, 0].max()
    assert high - low == pytest.approx(1.75 / radius, rel=0.02)
    along, z = section.places(cut.points)[:, 1], cut.points[:, 2]
    assert along - along[0] == pytest.approx(z - z[0], abs=1e-3)
    # The handle's surface goes through both.
    places = np.column_stack([np.full(5, 0.3), along.min() + np.linspace(0.1, 1.7, 5)])
    surface = section.surface(places, span)
    assert surface[:, 2] == pytest.approx(np.linspace(0.1, 1.7, 5), abs=0.01)
    higher = section.surface(places, span + 0.01)
    assert np.linalg.norm(higher - surface, axis=1) / 0.01 == pytest.approx(0.5, rel=0.02)


def test_zones_without_walls_are_left_out_and_others_are_named():
    mesh = stage()
    behind = mesh.parts[1].mesh
    names = [replace(one, name=one.name.replace("hub", "inner")) for one in behind.markers]
    other = join_zones([mesh.parts[0].mesh, replace(behind, markers=tuple(names))])
    assert find_walls(other).words == "hub to 1:shroud"
    named = sv.Case(span=("inner", "2:shroud"))
    assert find_walls(other, named).words == "hub to 1:shroud, inner to 2:shroud"
    assert find_walls(mesh, None, between=("shroud", "hub")).words == (
        "1:shroud to 1:hub, 2:shroud to 2:hub"
    )
    with pytest.raises(CaseError, match="SPAN: hub and inner are not both boundaries of one zone"):
        find_walls(other, sv.Case(span=("hub", "inner")))


def test_the_commands_show_all_zones(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sv.write("stage.su2", stage())
    assert run(["section", "stage.su2", "--span", "0.5", "-o", "a.png", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["section"]["between"] == [["1:hub", "1:shroud"], ["2:hub", "2:shroud"]]
    assert run(["section", "stage.su2", "--meridional", "-o", "a.png", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert [np.shape(zone["means"]) for zone in report["zones"]] == [(4, 8), (4, 8)]
    assert report["zones"][1]["between"] == ["2:hub", "2:shroud"]
    front, behind = (np.array(zone["places"])[..., 0] for zone in report["zones"])
    assert front.max() == pytest.approx(behind.min(), abs=1e-3)
    assert run(["section", "stage.su2", "--span", "0.5", "--copies", "1", "-o", "a.png"]) == 1
    assert "its zones have different periods" in capsys.readouterr().err
