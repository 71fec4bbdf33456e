"""Which boundaries a span goes between, and about which axis."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.check import check_case
from slideviz.case.spans import span_ends, span_field
from slideviz.cli import run as command
from slideviz.errors import CaseError, MeshError, SlidevizError
from slideviz.machine.span_field import SpanCurves, find_span
from slideviz.machine.straight_span import StraightSpan
from slideviz.sections.span import find_walls
from slideviz.session.opening import open_mesh
from slideviz.session.run_messages import run_requirements
from slideviz.session.state import StepFrame
from tests.builders import grid, passage, ring

SIDES = {"per1": "periodic", "per2": "periodic"}


def renamed(mesh, **names):
    markers = (sv.Marker(names.get(m.name, m.name), m.cells) for m in mesh.markers)
    return sv.Mesh(mesh.points, mesh.cells, tuple(markers), name=mesh.name)


def test_hub_and_shroud_are_those_of_the_key_or_of_their_names():
    mesh = passage((2, 4, 4))
    assert span_ends(sv.Case(), mesh) == ("hub", "shroud")
    assert span_ends(sv.Case(), renamed(mesh, hub="R1_HUB", shroud="Casing")) == (
        "R1_HUB",
        "Casing",
    )
    assert span_ends(sv.Case(span=("shroud", "hub")), mesh) == ("shroud", "hub")
    with pytest.raises(CaseError, match=r"SPAN: .* has no marker 'hup'; did you mean hub"):
        span_ends(sv.Case(span=("hup", "shroud")), mesh)
    with pytest.raises(
        CaseError, match=r"hub: hub, per1_hub; shroud or casing: none.*SPAN= \( HUB"
    ):
        span_ends(sv.Case(), renamed(mesh, per1="per1_hub", shroud="top"))


def test_the_field_has_the_axis_of_the_period_or_of_the_case():
    mesh = passage((2, 4, 4))
    case = sv.Case(roles=SIDES, periodic_type="rotational")
    field = span_field(case, mesh)
    assert field is span_field(case.change(steps=7), mesh)
    assert field.axis == (0.0, 0.0, 1.0)
    coords = field.meridional(mesh.points)
    assert field.span(coords)[0] == pytest.approx((coords[:, 1] - 0.5) / 0.5, abs=1e-12)
    # Without periodic sides: the axis of the case.
    moved = mesh.with_points(mesh.points + np.array([1.0, 2.0, 3.0]))
    other = span_field(sv.Case(origin=(1.0, 2.0, 3.0)), moved)
    assert np.abs(other.meridional(moved.points) - coords).max() < 1e-12


def wing(turn=None):
    """A square wing from a side of a box to one that is bent, turned."""

    def bent(p):
        at = p / (6.0, 6.0, 4.0)
        at[:, 2] += 0.3 * at[:, 2] * np.sin(6.0 * at[:, 0] + 5.0 * at[:, 1])
        return at

    mesh = grid((6, 6, 4), [(2, 4), (2, 4), (0, 4)], place=bent)
    return mesh if turn is None else mesh.with_points(mesh.points @ turn.T)


TWIST = sv.Case(
    axis=(1.0, 0.0, 0.0),
    roles={"BLOCK": "moving"},
    span=("z_m", "z_p"),
    motions=(sv.SpanMotion("BLOCK", "twist", (0.0, 1.0), (0.0, 3.0)),),
)
NO_AXIS = r"'z_m' and 'z_p' do not turn about the axis .* a straight span by "


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_walls_that_are_neither_flat_nor_turn_have_no_span(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    mesh = wing(turn)
    case = TWIST.change(axis=tuple(turn[:, 0].tolist()))
    with pytest.raises(MeshError, match=NO_AXIS):
        span_field(case, mesh)
    (said,) = check_case(case, mesh)
    assert re.search(NO_AXIS, str(said))


def test_each_way_to_a_span_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    sv.write("wing.su2", wing())
    TWIST.change(mesh_file=Path("wing.su2")).write("wing.cfg")
    ways = (
        lambda: next(sv.deform(TWIST, wing())),
        lambda: sv.Deformer(wing(), TWIST),
        lambda: sv.SpanVariables(wing(), TWIST),
        lambda: find_walls(wing(), TWIST),
        lambda: sv.gaps(TWIST, wing()),
    )
    for way in ways:
        with pytest.raises(SlidevizError, match=NO_AXIS):
            way()
    for arguments in (
        ["run", "wing.cfg", "-o", "out.su2"],
        ["gap", "wing.cfg"],
        ["section", "wing.su2", "--span", "0.5", "--case", "wing.cfg", "-o", "cut.svg"],
        ["section", "wing.su2", "--meridional", "--case", "wing.cfg", "-o", "cut.svg"],
    ):
        assert command(arguments) == 1
        assert re.search(NO_AXIS, capsys.readouterr().err)
    session = open_mesh(StepFrame(wing(), sv.quality(wing())), None, (), TWIST)
    assert any(re.search(NO_AXIS, told.text) for told in run_requirements(session))


def test_flat_walls_that_go_around_an_axis_have_it():
    """A radial diffuser between two discs, as a whole ring, and as a passage that repeats."""
    disc = grid((4, 24, 3), place=ring((4, 24, 3), angle_deg=360.0), wrap=1)
    assert span_field(sv.Case(span=("z_m", "z_p")), disc).curves.m_prime.size > 10
    part = passage((4, 4, 3), blade=False)
    case = sv.Case(span=("inflow", "outflow"))
    assert span_field(case.change(roles=SIDES, periodic_type="rotational"), part).revolved
    assert isinstance(span_field(case, part), StraightSpan)


def test_an_axis_too_near_to_where_curves_start_is_told():
    mesh = grid((6, 4, 3), place=ring((6, 4, 3), low=1e-4))
    field = find_span(mesh, "z_m", "z_p", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), np.pi / 6.0)
    with pytest.raises(MeshError, match=r"cannot be traced from z = 0\.5, r = 0\.0001: the axis"):
        SpanCurves(field, (0.5, 1e-4))
