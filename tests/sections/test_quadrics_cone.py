"""Cones through 3D meshes: what they cut, how they lie flat, where they start and are pulled to."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import CaseError
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import quality
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import SectionInRun, SectionStyle, laid_flat, section_picture
from slideviz.scene.flat_scene import flat_matrix
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session.opening import open_mesh
from slideviz.session.passages import keeps, passages
from slideviz.session.section_cuts import first_section, position_range, with_direction
from slideviz.session.state import StepFrame
from tests.builders import cube, grid, ring, square
from tests.sections.test_model_section import KINDS, areas, shaken

SHAPE = (4, 6, 5)
APEX, ANGLE = (0.0, 0.0, -1.0), 30.0
CUT = Section("cone", APEX, (0.0, 0.0, 1.0), half_angle_deg=ANGLE)
"""Through a ring from r 0.5 to 1.0 and z 0 to 1 it goes from r 0.577 to 1, at z 0.732."""


def sector(start=0.0, degrees=30.0, shape=SHAPE, kind="plain"):
    return grid(shape, kind=kind, place=ring(shape, 0.5, 1.0, degrees, start))


def pair_of(kind="rotational", vector=None, angle=0.0, axis=(0.0, 0.0, 1.0), origin=(0.0,) * 3):
    """A period, by a turn or a shift."""
    shift = np.zeros(3) if vector is None else vector
    return Pair("a", "b", kind, shift, angle, axis, origin, np.empty((0, 2), np.int64), 0.0)


def away(section, points):
    """Distance of points (n, 3) from a cone, slowly: to the nearest of its lines, or the apex."""
    found = []
    axis = np.asarray(section.direction, float) / np.linalg.norm(section.direction)
    lean = np.radians(section.half_angle_deg)
    for point in points:
        off = point - np.asarray(section.origin)
        height = off @ axis
        radius = np.linalg.norm(off - height * axis)
        line = np.array([np.sin(lean), np.cos(lean)])
        at = max(np.array([radius, height]) @ line, 0.0)
        size = np.linalg.norm(np.array([radius, height]) - at * line)
        outside = at == 0.0 or radius * line[1] > height * line[0]
        found.append(size if outside else -size)
    return np.array(found)


@settings(max_examples=40, deadline=None)
@given(
    apex=st.tuples(*[st.integers(-8, 16).map(lambda i: i / 8)] * 3),
    direction=st.tuples(*[st.integers(-3, 3)] * 3).filter(any),
    angle=st.integers(2, 88),
    kind=st.sampled_from(KINDS),
)
def test_a_cone_cuts_edges_where_it_is_and_only_along_its_axis(apex, direction, angle, kind):
    mesh = shaken(cube(4, kind, block=False))
    section = Section("cone", apex, direction, half_angle_deg=angle)
    wanted = away(section, mesh.points)
    assert section.distance(mesh.points) == pytest.approx(wanted, abs=1e-8)
    found = Cutter(mesh).cut(mesh.points, section)
    assert np.abs(away(section, found.points)).max(initial=0.0) < 1e-9, "not only to second order"
    # Cells with nodes on both sides are cut, the others are not.
    sides = np.sign(section.distance(mesh.points))
    cells = np.split(mesh.cells.connectivity, mesh.cells.offsets[1:-1])
    both = [i for i, nodes in enumerate(cells) if len(set(sides[nodes]) - {0.0}) == 2]
    if not (sides == 0).any():
        assert found.cell_ids.tolist() == both


def test_the_other_half_behind_the_apex_cuts_nothing():
    mesh = sector(degrees=360.0)
    behind = Section("cone", (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), half_angle_deg=ANGLE)
    assert not len(Cutter(mesh).cut(mesh.points, behind))
    opposite = Section("cone", (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), half_angle_deg=ANGLE)
    assert len(Cutter(mesh).cut(mesh.points, opposite))


@pytest.mark.parametrize(
    ("start", "end"),
    [
        # From inside of the other half, past the apex: that half is crossed, too, but not meant.
        ((0.1, 0.0, -1.0), (0.2, 0.0, 1.0)),
        ((0.2, 0.1, 1.0), (-0.1, 0.3, -1.0)),
        # Parallel to a line of the cone: the parabola is a line.
        ((1.5, 0.0, 0.5), (0.5, 0.0, 1.5)),
        ((0.5, 0.0, 1.5), (1.5, 0.0, 0.5)),
        # Across, and to a place outside of both halves.
        ((0.0, 0.0, 1.0), (3.0, 0.5, 1.0)),
        ((0.0, 0.0, 1.0), (3.0, 0.5, -1.0)),
    ],
)
def test_an_edge_is_crossed_where_the_half_along_the_axis_is(start, end):
    section = Section("cone", half_angle_deg=45.0)
    ends = np.array([start]), np.array([end])
    level = [section.distance(np.concatenate([one, [[0.0, 0.0, 5.0]]]))[:1] for one in ends]
    share = section.crossings((ends[0], ends[1] - ends[0]), tuple(level))
    (point,) = ends[0] + share[:, None] * (ends[1] - ends[0])
    assert point[2] > 0.0
    assert np.hypot(*point[:2]) == pytest.approx(point[2], abs=1e-14)


def developed(section, points):
    """Lengths from the apex, and angles around it, of points on a cone."""
    local = section.frame(points)
    return np.linalg.norm(local, axis=1), np.arctan2(local[:, 1], local[:, 0])


@pytest.mark.parametrize("start", [0, 75, 165, 170, 180, 275, 350])
def test_a_sector_lies_flat_with_its_lengths_wherever_it_lies(start):
    mesh = sector(start, kind="simplex")
    cut = Cutter(mesh).cut(mesh.points, CUT)
    flat = CUT.flatten(cut, None, None)
    assert np.abs(flat.points[:, 2]).max() < 1e-12
    # From the apex, and between neighbours: as long as the geodesic, by the law of cosines.
    corner, other = (
        cut.connectivity,
        np.concatenate(
            [np.roll(part, -1) for part in np.split(cut.connectivity, cut.offsets[1:-1])]
        ),
    )
    s, theta = developed(CUT, cut.points)
    turn = (theta[other] - theta[corner] + np.pi) % (2.0 * np.pi) - np.pi
    lean = np.sin(np.radians(ANGLE))
    chord = s[corner] ** 2 + s[other] ** 2 - 2 * s[corner] * s[other] * np.cos(turn * lean)
    laid = flat.points[flat.connectivity]
    after = np.concatenate(
        [np.roll(part, -1, axis=0) for part in np.split(laid, flat.offsets[1:-1])]
    )
    assert np.linalg.norm(laid, axis=1) == pytest.approx(s[corner])
    assert np.sum((after - laid) ** 2, axis=1) == pytest.approx(chord, abs=1e-12)
    # Level, and with what is further along to the right, wherever it was around the axis.
    assert np.ptp(flat.points[:, 1]) == pytest.approx(2 * flat.points[:, 1].max(), rel=1e-9)


@pytest.mark.parametrize("count", [12, 24, 48])
def test_the_area_laid_flat_tends_to_that_of_the_cone(count):
    shape = (6, count, 6)
    mesh = sector(20.0, 60.0, shape)
    cut = Cutter(mesh).cut(mesh.points, CUT)
    flat = CUT.flatten(cut, None, None)
    # From z = 0 to r = 1, that is from s = 1 / cos to s = 1 / sin.
    sin, cos = np.sin(np.radians(ANGLE)), np.cos(np.radians(ANGLE))
    exact = 0.5 * (1.0 / sin**2 - 1.0 / cos**2) * np.radians(60.0) * sin
    # What the chords of a ring's last cells leave out, squared in their angle.
    missing = abs(areas(flat).sum() / exact - 1.0)
    assert missing < 0.2 * np.radians(60.0 / count) ** 2
    assert np.ptp(np.linalg.norm(flat.points, axis=1)) == pytest.approx(
        1.0 / sin - 1.0 / cos, rel=1e-3
    )


def test_a_whole_ring_is_opened_once_to_a_piece_of_a_disc():
    shape = (3, 24, 4)
    mesh = grid(shape, wrap=1, place=ring(shape, 0.5, 1.0, 360.0))
    cut = Cutter(mesh).cut(mesh.points, CUT)
    flat = CUT.flatten(cut, None, None)
    angles = np.degrees(np.arctan2(flat.points[:, 1], flat.points[:, 0]))
    assert np.ptp(angles) == pytest.approx(360.0 * np.sin(np.radians(ANGLE)))
    assert len(flat.points) > len(cut.points)
    assert flat.cells.tolist() == cut.cells.tolist()


@pytest.mark.parametrize("start", [10, 160, 250])
def test_copies_lie_beside_each_other_and_are_turned_about_the_apex(start):
    mesh = sector(start)
    pair = pair_of(angle=np.radians(30.0))
    cutter = Cutter(mesh)
    every = passages(pair, 3)
    assert all(keeps(CUT, matrix) for matrix in every.values())
    pieces = {n: cutter.cut(mesh.points @ m[:3, :3].T, CUT) for n, m in every.items()}
    flat, labels = laid_flat(pieces, CUT, False)
    assert [label.short for label in labels] == ["s cos", "s sin"]
    angles = np.degrees(np.arctan2(flat.points[:, 1], flat.points[:, 0]))
    lean = np.sin(np.radians(ANGLE))
    assert np.ptp(angles) == pytest.approx(7 * 30.0 * lean)
    assert abs(angles.max() + angles.min()) < 1e-9
    # The window draws its one piece again, turned.
    own, beside = (
        CUT.flatten(pieces[n], CUT.middle_angle(pieces[n], near), ahead)
        for ahead in [CUT.middle_angle(pieces[0])]
        for n, near in ((0, ahead), (2, ahead + np.radians(60.0)))
    )
    matrix = flat_matrix(CUT, pair, 2, every[2])
    assert own.points @ matrix[:3, :3].T + matrix[:3, 3] == pytest.approx(beside.points)


def test_only_turns_about_the_axis_keep_it():
    for kind in (
        pair_of(angle=0.3, axis=(0.0, 1.0, 0.0)),
        pair_of(angle=0.3, origin=(0.1, 0.0, 0.0)),
        pair_of("translational", vector=np.array([0.0, 0.0, 1.0])),
    ):
        assert not keeps(CUT, passages(kind, 1)[1])
    half = np.diag([1.0, -1.0, -1.0, 1.0])
    apex = Section("cone", half_angle_deg=20.0)
    assert not keeps(apex, half), "it opens to the other side"


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (CUT, "cone 30° about z from apex (0, 0, -1)"),
        (
            Section("cone", (0, 0, 2), (0, 0, -3), half_angle_deg=12.5),
            "cone 12.5° about -z from apex (0, 0, 2)",
        ),
        (
            Section("cone", (1, 0, 0), (1, 1, 0), half_angle_deg=5),
            "cone 5° about (1, 1, 0) from apex (1, 0, 0)",
        ),
    ],
)
def test_it_is_described(section, words):
    assert section.describe() == words


@pytest.mark.parametrize(
    ("angle", "words"),
    [
        (0.0, "the half angle 0 is not positive; give the angle in degrees"),
        (-3.0, "the half angle -3 is not positive"),
        (90.0, "the half angle 90 is not below 90; give the angle in degrees"),
        (np.nan, "a number that is not finite"),
    ],
)
def test_an_angle_that_makes_no_cone_is_told(angle, words):
    with pytest.raises(CaseError, match=words):
        Section("cone", half_angle_deg=angle)


def session_of(mesh):
    return open_mesh(StepFrame(mesh, quality(mesh)), None)


@pytest.mark.parametrize("extent", [(0.5, 1.0, 1.0), (0.25, 0.325, 0.1), (0.0, 1.0, 1.0)])
def test_it_starts_from_end_to_end_of_the_passage_at_round_numbers(extent):
    inner, outer, length = extent
    mesh = sector() if inner else cube(4, block=False)
    if inner:
        points = grid(SHAPE, place=ring(SHAPE, inner, outer, 30.0, 0.0)).points
        mesh = mesh.with_points(points * (1.0, 1.0, length))
    section = first_section("cone", session_of(mesh))
    assert section.direction == (0.0, 0.0, 1.0)
    assert max(len(f"{v:.10g}") for v in (*section.origin, section.half_angle_deg)) <= 7
    found = Cutter(mesh).cut(mesh.points, section)
    assert np.ptp(found.points[:, 2]) > 0.5 * np.ptp(mesh.points[:, 2])
    low, high = position_range(section, mesh.points)
    assert low < section.half_angle_deg < high


def test_another_axis_or_apex_leaves_it_where_it_cuts():
    points = sector(degrees=360.0).points
    assert with_direction(CUT, (0.0, 0.0, 2.0), points).half_angle_deg == ANGLE
    across = with_direction(
        Section("cone", (-3.0, 0.0, 0.5), (0, 0, 1), half_angle_deg=1.0), (1, 0, 0), points
    )
    low, high = position_range(across, points)
    assert low < across.half_angle_deg < high


def test_the_places_of_its_handle_lie_on_it_where_it_is_cut():
    mesh = sector(75.0)
    cut = Cutter(mesh).cut(mesh.points, CUT)
    patch = CUT.patch(cut.points)
    places = CUT.surface(np.concatenate([[patch.middle], patch.places]), ANGLE)
    assert np.abs(away(CUT, places)).max() < 1e-12
    assert places[:, 2].min() == pytest.approx(cut.points[:, 2].min())
    right, up, to_eye = CUT.facing(cut.points)
    assert np.cross(right, up) == pytest.approx(to_eye)
    assert to_eye[2] == pytest.approx(-np.sin(np.radians(ANGLE)))


def test_in_2d_it_says_what_it_needs():
    mesh = square(3)
    assert not CUT.can_cut(2)
    with pytest.raises(CaseError, match=r"apex \(0, 0, -1\): it needs a 3D mesh; a 2D mesh is cut"):
        Cutter(mesh).cut(mesh.points, CUT)
    assert CUT.describe(2) == CUT.brief(2) == CUT.describe()


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("in_space", [False, True])
def test_it_is_drawn(tmp_path, whole, in_space):
    mesh = sector(200.0)
    section = Section("cone", APEX, half_angle_deg=ANGLE, whole_cells=whole)
    painted = paint(mesh, quality(mesh), "skew")
    pieces = {0: Cutter(mesh).show(mesh.points, section)}
    style = SectionStyle(size=(400, 300), in_space=in_space)
    section_picture([SectionInRun(pieces, painted)], section, tmp_path / "a.svg", style)
    text = (tmp_path / "a.svg").read_text()
    assert len(text) > 10_000


def test_the_command_line_cuts_by_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sv.write("a.su2", sector())
    words = ["section", "a.su2", "--cone", "30,z,0,0,-1", "-o", "a.png", "--size", "400x300"]
    assert run([*words, "--json", "a.json"]) == 0
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["section"] == {
        "kind": "cone",
        "origin": [0.0, 0.0, -1.0],
        "direction": [0.0, 0.0, 1.0],
        "radius": None,
        "half_angle_deg": 30.0,
        "whole": False,
    }
    mesh = sector()
    assert found["cells"] == len(Cutter(mesh).which_cells(mesh.points, CUT))
    assert "cone 30° about z from apex (0, 0, -1)" in capsys.readouterr().out
    words[3] = "5,z,0,0,-1"
    assert run(words) == 1
    assert "misses the mesh, which its apex sees at 14.04 to 45 degrees" in capsys.readouterr().err
