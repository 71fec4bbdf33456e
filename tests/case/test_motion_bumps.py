"""Bumps on airfoils as motions of a case."""

from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.moving_nodes import displacements
from slideviz.design.sweeps.table import applied, columns_of, numbers_of
from slideviz.errors import CaseError
from slideviz.session.jobs import Job, find_intersection
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from tests.builders import airfoil, cube
from tests.oracles import airfoils

KINDS = {
    "hicks-henne": (
        lambda low, high: sv.HicksHenne("airfoil", 0.02, 0.3, "lower", (low, high)),
        ("HICKS_HENNE", (0, 0.3)),
    ),
    "cst": (
        lambda low, high: sv.Cst("airfoil", 0.02, (2, 4), "upper", (low, high)),
        ("CST", (1, 2, 4)),
    ),
    "bump": (
        lambda low, high: sv.Bump("airfoil", 0.02, 0.4, (low, high)),
        ("SURFACE_BUMP", (0.0, 1.0, 0.4)),
    ),
}


def case(*motions, **values):
    roles = {"airfoil": "moving", "far": "fixed"}
    return sv.Case(roles=roles, motions=motions, **values)


def bent():
    mesh = airfoil(24, 3)
    x, y = mesh.points.T
    near = (np.hypot(x - 0.5, y) < 2.0)[:, None]
    return mesh.with_points(np.where(near, np.stack([x, y + 0.2 * x * (1 - x)], 1), mesh.points))


@pytest.mark.parametrize("kind", KINDS)
def test_bumps_are_those_of_su2_along_any_chord(kind):
    make, (name, numbers) = KINDS[kind]
    mesh = bent()
    expected = airfoils.displaced(mesh, ("airfoil",), name, numbers, 0.02)
    given = displacements(case(make(0.0, 1.0)), mesh)
    table = np.array([expected[node] for node in given.nodes])
    np.testing.assert_allclose(given.vectors, table, atol=1e-15)
    larger = mesh.with_points(3.0 * mesh.points + [2.0, 1.0])
    again = displacements(case(make(2.0, 5.0)), larger)
    np.testing.assert_allclose(again.vectors, table, atol=1e-15)
    beyond = displacements(case(make(0.2, 0.7)), mesh)
    x = mesh.points[beyond.nodes, 0]
    assert not beyond.vectors[(x <= 0.2) | (x >= 0.7)].any()


@pytest.mark.parametrize("kind", KINDS)
def test_bumps_go_by_undeformed_places_and_add_up(kind):
    make, _ = KINDS[kind]
    mesh, bump, shift = bent(), make(0.0, 1.0), sv.Translate("airfoil", (0.3, 0.0))
    one = displacements(case(bump, shift), mesh).vectors
    np.testing.assert_array_equal(displacements(case(shift, bump), mesh).vectors, one)
    twice = displacements(case(bump, bump), mesh).vectors
    np.testing.assert_allclose(twice, 2.0 * (one - [0.3, 0.0]), atol=1e-16)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("chord", "told"),
    [
        ((0.0, 1.0), False),
        ((0.0, 0.5), False),
        ((-0.4, 1.4), False),
        ((0.0, 0.1), True),
        ((0.4, 0.8), True),
        ((-1.0, 1.2), True),
        ((0.0, 100.0), True),
    ],
)
def test_a_chord_that_does_not_fit_is_told_before_a_run_and_after(kind, chord, told):
    mesh = bent()
    moved = case(replace(KINDS[kind][0](*chord), height=1e-6))
    words = f"goes from x = {chord[0]:g} to {chord[1]:g}, but airfoil from 0 to 1; end its MOTION"
    words += " with 0, 1 if all of it is meant: (airfoil, "
    messages = make_setup(prepare(moved, mesh)).warnings
    assert any(words in str(text) for text in messages) == told
    _, said = find_intersection(moved, mesh, Job())
    assert (words in str(said)) == told


def test_a_bump_of_a_side_that_is_not_there_is_refused():
    with pytest.raises(CaseError, match="motion 1: no node of 'airfoil' is on its lower side betw"):
        displacements(case(sv.HicksHenne("airfoil", 0.1, 0.5, "lower", (7.0, 8.0))), bent())
    with pytest.raises(CaseError, match="motion 1: no node of a moving marker is between x = 7"):
        displacements(case(sv.Bump("", 0.1, 0.5, (7.0, 8.0))), bent())
    with pytest.raises(CaseError, match=r"side.*'left'.* '?upper'? "):
        sv.HicksHenne("airfoil", 0.1, 0.5, "left")


def test_bumps_in_3d_go_along_y():
    mesh = cube(4)
    roles = {name: "moving" if name == "y_m" else "fixed" for name in mesh.marker_names}
    given = displacements(sv.Case(roles=roles, motions=(sv.HicksHenne("y_m", 0.1),)), mesh)
    x = mesh.points[given.nodes, 0]
    np.testing.assert_allclose(given.vectors[:, 1], 0.1 * np.sin(np.pi * x) ** 3, atol=1e-15)
    assert not given.vectors[:, [0, 2]].any()


def test_words_and_columns_of_bumps():
    motions = (
        sv.HicksHenne("airfoil", 0.02, 0.3),
        sv.Cst("airfoil", -0.01, (2, 6), "lower"),
        sv.Bump("airfoil", 0.1, 0.5, (0.0, 2.0)),
    )
    assert read_motions(write_motions(motions).replace("\\\n", "")) == motions
    assert [describe(one) for one in motions] == [
        "airfoil: move upper side outwards by 0.02 at 30 % chord",
        "airfoil: raise lower side by -0.01 × CST 2 of 6",
        "airfoil: raise both sides by 0.1 at 50 % chord",
    ]
    labels = motion_labels([case(one) for one in motions])
    assert labels == [
        "upper side +0.02 at 30 % chord",
        "lower side -0.01 × CST 2 of 6",
        "both sides +0.1 at 50 % chord",
    ]
    chords = [case(sv.Bump("airfoil", 0.1, 0.5, (0.0, end))) for end in (1.0, 2.0)]
    assert motion_labels(chords)[1].endswith("+0.1 at 50 % chord, chord (0, 2)")
    start = case(*motions)
    assert list(numbers_of(start)) == [
        "airfoil.hicks-henne.upper.height",
        "airfoil.hicks-henne.upper.peak",
        "airfoil.cst.lower.2.height",
        "airfoil.bump.height",
        "airfoil.bump.peak",
    ]
    name = "airfoil.hicks-henne.upper.height"
    design = applied(start, columns_of(start, [name]), {name: 0.05})
    assert design.motions[0] == sv.HicksHenne("airfoil", 0.05, 0.3)


def test_runs_deform_by_bumps():
    mesh = bent()
    *_, last = sv.deform(case(sv.HicksHenne("airfoil", 0.02)), mesh)
    given = displacements(case(sv.HicksHenne("airfoil", 0.02)), mesh)
    moved = last.mesh.points[given.nodes] - mesh.points[given.nodes]
    np.testing.assert_allclose(moved, given.vectors, atol=1e-15)
    assert sv.quality(last.mesh).inverted == 0
