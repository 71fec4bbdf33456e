"""Spans along a direction: wings on a symmetry plane, and blades of linear cascades."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.case.spans import span_ends, span_field
from slideviz.cli import run as command
from slideviz.errors import CaseError, MeshError
from slideviz.machine.straight_span import StraightSpan
from slideviz.plots.session_plots import profiles
from slideviz.samples.table import sample
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.sections.span import ConstantSpan, SpanPlane, between_walls, find_walls
from slideviz.session.opening import open_mesh
from slideviz.session.saving import with_walls
from slideviz.session.section_cuts import first_section, position_range
from slideviz.session.state import StepFrame
from tests.builders import box_rules, grid
from tests.design.test_span_variables import checked_gradient, errors_of_derivatives

SHAPE = (6, 6, 6)


def box(hole=((2, 4), (2, 4), (0, 4)), place=None, turn=None):
    """A square wing in a box, from its side z_m on, whose nodes are ``turn``ed at last."""
    mesh = grid(SHAPE, list(hole), place=place)
    return mesh if turn is None else mesh.with_points(mesh.points @ turn.T)


def a_turn(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


def case_of(*motions, roles=None, **values):
    return sv.Case(roles={"BLOCK": "moving", **(roles or {})}, motions=motions, **values)


def curve(kind, *values):
    return sv.SpanMotion("BLOCK", kind, tuple(np.linspace(0, 1, len(values)).tolist()), values)


TWIST = curve("twist", 0.0, 8.0)
ALL = (
    curve("twist", 1.0, 2.0, 4.0),
    curve("lean", 0.01, 0.03, 0.02),
    curve("sweep", 0.01, 0.02),
    curve("chord", 1.1, 0.9),
    curve("camber", 0.001, 0.02),
)


@pytest.fixture(scope="module")
def wing():
    return sample("wing", 2000)


def test_a_tapered_swept_wing_twists_and_its_root_slides_in_its_plane(wing):
    mesh = wing.mesh
    assert sv.quality(mesh).inverted == 0
    *_, last = sv.deform(wing.case, mesh)
    root = mesh.marker("symmetry").nodes
    assert not last.mesh.points[root, 1].any()
    assert np.abs(last.mesh.points[root] - mesh.points[root]).max() > 0.0
    assert sv.quality(last.mesh).inverted == 0
    heights = sv.walls(last.mesh, reference=mesh).summary()["wing"]["first_height"]["ratio"]
    assert heights["min"] > 0.99
    assert heights["max"] < 1.01
    tip = mesh.points[:, 1] == 3.0
    tip &= np.isin(np.arange(len(mesh.points)), mesh.marker("wing").nodes)
    moved = (last.mesh.points - mesh.points)[tip]
    assert not moved[:, 1].any()
    chord = np.ptp(mesh.points[tip, 0])
    edges = [np.argmin(mesh.points[tip, 0]), np.argmax(mesh.points[tip, 0])]
    rise = np.diff((mesh.points[tip] + moved)[edges], axis=0)[0]
    assert np.linalg.norm(rise) == pytest.approx(chord, rel=1e-12)
    assert np.degrees(np.arctan2(rise[2], rise[0])) == pytest.approx(8.0, rel=1e-9)


def test_root_and_tip_are_where_the_wing_meets_flat_walls(wing):
    assert span_ends(wing.case, wing.mesh) == ("symmetry", "wing")
    field = span_field(wing.case, wing.mesh)
    assert (field.axis, field.low, field.high) == ((0.0, 1.0, 0.0), 0.0, 3.0)
    assert field.basis.tolist() == np.eye(3).tolist()
    # The other wing has its root at the same plane.
    mirrored = wing.mesh.with_points(wing.mesh.points * (1.0, -1.0, 1.0))
    assert span_field(wing.case, mirrored).axis == (0.0, -1.0, 0.0)
    # From wall to wall, and free at both ends.
    through = box(((2, 4), (2, 4), (0, 6)))
    assert span_ends(case_of(TWIST), through) == ("z_m", "z_p")
    inside = box(((2, 4), (2, 4), (1, 4)))
    with pytest.raises(CaseError, match=r"do not say between which the span goes.*BLOCK$"):
        span_ends(case_of(TWIST), inside)
    free = case_of(TWIST, span_axis=(0.0, 0.0, -2.0))
    assert span_ends(free, inside) == ("BLOCK", "BLOCK")
    field = span_field(free, inside)
    assert (field.axis, field.low, field.high) == ((0.0, 0.0, -1.0), -4 / 6, -1 / 6)
    # Two walls across each other: neither is known to be the root.
    corner = box(((2, 4), (0, 4), (0, 4)))
    with pytest.raises(CaseError, match="do not say between which the span goes"):
        span_ends(case_of(TWIST), corner)
    assert span_ends(case_of(TWIST, span_axis=(0.0, 0.0, 1.0)), corner) == ("z_m", "BLOCK")
    assert span_ends(case_of(TWIST, roles={"y_m": "periodic"}), corner) == ("z_m", "BLOCK")


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([4, 6]))
def test_turning_the_mesh_turns_span_and_twist(seed, named, high):
    hole = ((2, 4), (2, 4), (0, high))
    turn = a_turn(seed)
    usual, turned = box(hole), box(hole, turn=turn)
    ends = ("z_m", "z_p" if high == 6 else "BLOCK")
    roles = {"z_m": "sliding", "z_p": "sliding"}
    case = case_of(TWIST, curve("chord", 1.0, 1.2), roles=roles, span=ends if named else None)
    fields = [span_field(case, mesh) for mesh in (usual, turned)]
    one, other = (
        field.span(field.meridional(mesh.points))[0]
        for field, mesh in zip(fields, (usual, turned), strict=True)
    )
    if named or turn[:, 2][np.argmax(np.abs(turn[:, 2]))] > 0.0 or high == 4:
        assert np.abs(one - other).max() < 1e-12
        ways = [displacements(case, mesh).vectors for mesh in (usual, turned)]
        assert np.abs(ways[0] @ turn.T - ways[1]).max() < 1e-12
        assert np.abs(ways[1] @ turn[:, 2]).max() < 1e-15
    else:  # from wall to wall, the root is the lower one
        assert np.abs(one + other - 1.0).max() < 1e-12


def test_each_kind_of_motion_moves_along_its_direction(wing):
    mesh = wing.mesh
    nodes = mesh.marker("wing").nodes
    x, y, z = mesh.points[nodes].T

    def moved(kind, *values):
        motion = replace(curve(kind, *values), marker="wing")
        return displacements(wing.case.change(motions=(motion,)), mesh).vectors

    assert np.abs(moved("sweep", 0.0, 0.3) - np.outer(0.1 * y, [1, 0, 0])).max() < 1e-15
    assert np.abs(moved("lean", 0.0, 0.3) - np.outer(0.1 * y, [0, 0, 1])).max() < 1e-15
    # Chord and camber about the line of the sections' middles.
    edge = y * np.tan(np.radians(30.0))
    middle = edge + 0.5 - 0.1 * y
    grown = moved("chord", 1.0, 1.1)
    factor = np.exp(np.log(1.0 + 0.1 * y / 3.0))
    assert grown[:, 0] == pytest.approx((factor - 1.0) * (x - middle), abs=2e-3)
    assert grown[:, 2] == pytest.approx((factor - 1.0) * z, abs=1e-12)
    bent = moved("camber", 0.02, 0.02)
    assert not bent[:, 0].any() or np.abs(bent[:, 0]).max() < 1e-12
    place = (x - edge) / (1.0 - 0.2 * y)
    assert bent[:, 2] == pytest.approx(
        0.02 * 4.0 * place * (1.0 - place) * (1.0 - 0.2 * y), abs=2e-4
    )
    assert not any(moved(*each)[:, 1].any() for each in (("twist", 0, 8), ("stagger", 4)))


def test_derivatives_agree_with_differences_and_each_other():
    mesh = box(turn=a_turn(3))
    roles = dict.fromkeys(("z_m", "z_p"), "sliding")
    case = case_of(*ALL, roles=roles, sliding="ps", reduction=None)
    design = sv.SpanVariables(mesh, case)
    rng = np.random.default_rng(1)
    assert all(wrong.max() < 1e-6 for wrong in errors_of_derivatives(design, rng))
    # And through the mesh, whose root slides.
    deformer = sv.Deformer(mesh, case)
    weights = rng.normal(size=mesh.points.shape)
    step = 1e-3 * rng.normal(size=len(design.values))
    gradient = checked_gradient(design, deformer, weights, step)
    tangent = deformer.jvp(deformer.displacement, design.jvp(design.values, step))
    assert np.vdot(weights, tangent) == pytest.approx(gradient @ step, rel=1e-12)


SIDES = {"y_m": "periodic", "y_p": "periodic"}


def cascade(turn=None):
    """Two halves of blades, cut by the sides of a passage that repeats by 1 along y, or turned."""
    rules = [(name, rule) for name, rule in box_rules(SHAPE) if name != "BLOCK"]

    def place(p):
        along = np.clip((p[:, 0] - 1.0) / 4.0, 0.0, 1.0)
        thick = 0.8 * along * (1.0 - along) * (1.0 - 2.0 * p[:, 1] / 6.0)
        return np.column_stack([p[:, 0], p[:, 1] + thick, p[:, 2]]) / 6.0

    def on_blade(p):
        return bool(np.ptp(p[:, 1]) == 0.0 and p[:, 0].min() >= 1 and p[:, 0].max() <= 5)

    order = [*rules[4:], ("BLOCK", on_blade), *rules[:4]]
    mesh = grid(SHAPE, place=place, rules=order)
    return mesh if turn is None else mesh.with_points(mesh.points @ turn.T)


@pytest.mark.parametrize("turn", [None, a_turn(5)])
def test_a_linear_cascade_moves_as_one_blade_along_its_pitch(turn):
    mesh = cascade(turn)
    pitch = np.array([0.0, 1.0, 0.0]) if turn is None else turn[:, 1]
    case = case_of(*ALL, roles=SIDES, span=("z_m", "z_p"), periodic="moving", sliding="ps")
    field = span_field(case, mesh)
    assert abs(field.basis[2] @ pitch) == pytest.approx(1.0, abs=1e-12)
    nodes = mesh.marker("BLOCK").nodes
    moved = displacements(case, mesh).vectors
    at = mesh.points[nodes]
    high = at @ pitch > 0.5
    back = at[high] - pitch
    # The edges are on both sides, and move alike.
    gaps = np.linalg.norm(back[:, None] - at[~high], axis=2)
    edge = np.flatnonzero(gaps.min(axis=1) < 1e-9)
    assert len(edge) == 2 * 7
    same = moved[~high][gaps[edge].argmin(axis=1)]
    assert np.abs(moved[high][edge] - same).max() < 1e-14
    *_, last = sv.deform(case.change(motions=(TWIST,)), mesh)
    assert sv.quality(last.mesh).inverted == 0
    if turn is None:
        walls = np.unique(np.concatenate([mesh.marker(n).nodes for n in ("z_m", "z_p")]))
        assert np.array_equal(last.mesh.points[walls, 2], mesh.points[walls, 2])


def test_gaps_of_a_linear_cascade():
    mesh = box(((2, 4), (2, 4), (0, 5)))
    roles = SIDES | {"z_m": "sliding", "z_p": "sliding"}
    throat, tip = sv.gaps(case_of(roles=roles, span=("z_m", "z_p")), mesh)
    assert (throat.name, tip.name) == ("throat", "tip gap")
    assert throat.distance == pytest.approx(4 / 6, rel=1e-9)
    inside = throat.places < 5 / 6
    assert throat.distances[inside] == pytest.approx(4 / 6, rel=1e-9)
    assert np.isnan(throat.distances[~inside]).all()
    assert tip.distances == pytest.approx(1 / 6, rel=1e-9)
    lifted = box(((2, 4), (2, 4), (1, 6)))
    throat, gap = sv.gaps(case_of(roles=roles, span=("z_m", "z_p")), lifted)
    assert gap.name == "root gap"
    assert gap.distances == pytest.approx(1 / 6, rel=1e-9)
    # A wing has a tip that is free, so there is no gap.
    assert sv.gaps(case_of(), box()) == ()


def test_a_section_at_a_span_is_a_plane(wing, tmp_path, capsys):
    mesh = wing.mesh
    walls = find_walls(mesh, wing.case)
    section = between_walls(Section("span", span=0.37), walls)
    assert isinstance(section, SpanPlane)
    plane = Section("plane", (0.0, 1.11, 0.0), (0.0, 1.0, 0.0))
    cut, same = (Cutter(mesh).cut(mesh.points, one) for one in (section, plane))
    assert cut.cells.tolist() == same.cells.tolist()
    assert cut.points == pytest.approx(same.points, abs=1e-15)
    assert section.positions(cut.points) == pytest.approx(0.37, abs=1e-15)
    flat = [one.flatten(cut, None, None).points for one in (section, plane)]
    assert flat[0] == pytest.approx(flat[1], abs=1e-15)
    assert section.flat_labels() == plane.flat_labels()
    assert np.array_equal(section.facing(cut.points), plane.facing(cut.points))
    assert np.array_equal(section.aslant(cut.points), plane.aslant(cut.points))
    assert section.words() == "37 % span from symmetry to wing"
    assert section.keeps(np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 2.0])) == 0.0
    assert section.middle_angle(cut) is None
    matrix = np.eye(4)
    matrix[0, 3] = 2.0
    assert np.array_equal(section.flat_matrix(matrix, 0.0), plane.flat_matrix(matrix, 0.0))
    assert position_range(section, mesh.points) == (0.0, 1.0)
    # Its handle moves along the span.
    patch = section.patch(cut.points)
    ends = [section.surface(np.array([patch.middle]), span) for span in (0.3, 0.4)]
    assert ends[1] - ends[0] == pytest.approx(np.array([[0.0, 0.3, 0.0]]), abs=1e-12)
    assert replace(section, span=0.5).walls is walls
    sv.write(tmp_path / "wing.su2", mesh)
    case = tmp_path / "wing.cfg"
    wing.case.change(mesh_file=tmp_path / "wing.su2").write(case)
    picture = tmp_path / "cut.svg"
    file = str(tmp_path / "wing.su2")
    told = tmp_path / "told.json"
    rest = ["--case", str(case), "-o", str(picture)]
    assert command(["section", file, "--span", "0.5", "--json", str(told), *rest]) == 0
    report = json.loads(told.read_text())["section"]
    assert report["between"] == ["symmetry", "wing"]
    assert report["direction"] == [0.0, 1.0, 0.0]
    assert command(["section", file, "--meridional", *rest]) == 0
    assert "<!-- h [mesh units] -->" in picture.read_text()


def test_the_window_keeps_it_with_root_and_tip(wing):
    mesh = wing.mesh
    session = open_mesh(StepFrame(mesh, sv.quality(mesh)), None, (), wing.case)
    section = first_section("span", session)
    assert isinstance(section, SpanPlane)
    assert section.walls.words == "symmetry to wing"
    # Another kind of span makes it a section of another class, and back.
    about = ConstantSpan("span", span=0.5)
    assert isinstance(with_walls(about, mesh, wing.case), SpanPlane)


def test_tables_by_span_end_at_the_tip(wing):
    session = open_mesh(StepFrame(wing.mesh, sv.quality(wing.mesh)), None, (), wing.case)
    [profile] = profiles(session, "span")
    assert (profile.edges[0], profile.edges[-1]) == (0.0, 1.0)
    assert profile.count.sum() == len(wing.mesh.cells)


def test_the_direction_is_a_key(tmp_path):
    path = tmp_path / "wing.cfg"
    for text, axis in (("y", (0.0, 1.0, 0.0)), ("(1, 0, 2)", (1.0, 0.0, 2.0)), ("AUTO", None)):
        path.write_text(f"SPAN_AXIS= {text}\n")
        case = sv.Case.read(path)
        assert case.span_axis == axis
        case.write(path)
        assert sv.Case.read(path).span_axis == axis
    with pytest.raises(CaseError, match="'w' is not an axis; write x, y, z"):
        sv.Case().set(SPAN_AXIS="w")
    for axis, why in (
        ((0.0, 0.0, 0.0), "the axis .* has no direction"),
        ((np.nan, 0.0, 1.0), "'nan' is not a number"),
        ((1e300, 0.0, 0.0), "is too large to compute with"),
    ):
        with pytest.raises(CaseError, match=f"SPAN_AXIS: .*{why}"):
            sv.Case(span_axis=axis)
    assert span_field(case_of(TWIST, span_axis=(0.0, 0.0, 1e-300)), box()).axis == (0.0, 0.0, 1.0)


def test_what_has_no_straight_span_is_refused():
    def bent(p):
        at = p / 6.0
        at[:, 2] += 0.1 * at[:, 2] * np.sin(5.0 * at[:, 0] + 4.0 * at[:, 1])
        return at

    mesh = box(((2, 4), (2, 4), (0, 6)), bent)
    case = case_of(TWIST, span=("z_m", "z_p"), axis=(1.0, 0.0, 0.0))
    with pytest.raises(MeshError, match=r"do not turn about the axis .* by SPAN_AXIS, e.g. SPAN_"):
        span_field(case, mesh)
    periodic = case_of(TWIST, roles={"x_m": "periodic", "x_p": "periodic"}, span=("y_m", "y_p"))
    assert isinstance(span_field(periodic, box()), StraightSpan)
    # With a direction, the root is the lowest node of the one, the tip the highest of the other.
    field = span_field(case.change(span_axis=(0.0, 0.0, 1.0)), mesh)
    assert field.low == 0.0
    assert field.high == pytest.approx(mesh.points[:, 2].max())
    one = grid(
        SHAPE,
        rules=[
            ("low", lambda p: bool(np.all(p[:, 2] == 0) and p[0, 0] < 3.0)),
            ("other", lambda p: bool(np.all(p[:, 2] == 0))),
        ],
    )
    beside = sv.Case(span=("low", "other"), span_axis=(0.0, 0.0, 1.0))
    with pytest.raises(MeshError, match=r"'low' and 'other' have no distance along \(0, 0, 1\)"):
        span_field(beside, one)
    flat = sv.Case(span=("y_m", "y_p"), span_axis=(0.0, 1.0, 0.0))
    with pytest.raises(MeshError, match="needs a mesh in 3D"):
        span_field(flat, grid((3, 3)))

    def bent_alike(p):
        return bent(p * (1.0, 0.0, 1.0)) + p * (0.0, 1.0 / 6.0, 0.0)

    row = case_of(TWIST, roles=SIDES, span=("z_m", "z_p"))
    with pytest.raises(CaseError, match=r"repeat by .* they need an axis about which they turn"):
        span_field(
            row,
            box(((2, 4), (2, 4), (1, 3)), bent_alike),
        )


def test_each_way_to_a_straight_span(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    mesh = box(((2, 4), (2, 4), (0, 6)))
    sv.write("wing.su2", mesh)
    case = case_of(TWIST, span=("z_m", "z_p"), sliding="ps", mesh_file=Path("wing.su2"))
    case.change(roles={**case.roles, "z_m": "sliding", "z_p": "sliding"}).write("wing.cfg")
    for arguments in (
        ["run", "wing.cfg", "-o", "out.su2"],
        ["gap", "wing.cfg", "--between", "BLOCK,x_m"],
        ["section", "wing.su2", "--span", "0.5", "--between", "z_m,z_p", "-o", "cut.svg"],
        ["section", "wing.su2", "--meridional", "--between", "z_m,z_p", "-o", "cut2.svg"],
    ):
        assert command(arguments) == 0, capsys.readouterr().err
    out = sv.read("out.su2")
    for name in ("z_m", "z_p"):
        nodes = mesh.marker(name).nodes
        assert np.array_equal(out.points[nodes, 2], mesh.points[nodes, 2])
