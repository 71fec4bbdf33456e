"""Motions of several boundaries: their ghosts, their words, and what is left of them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.case.check import check_case
from slideviz.case.model import Case
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import MotionStart, applies_to, named
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.case.moving_nodes import by_zone, displacements
from slideviz.case.zone_cases import zone_cases
from slideviz.mesh.quality import quality
from slideviz.mesh.zones import zones_of
from slideviz.session import changes
from slideviz.session.motions import Ghosts, TableRows, box_names, new_target, targets
from slideviz.session.opening import open_mesh
from slideviz.session.run_messages import run_requirements
from slideviz.session.state import Guess, StepFrame
from tests.builders import stage

PAIR = ("bottom", "left")


def roles(*names):
    return dict.fromkeys(names, "moving")


@pytest.mark.parametrize("target", [PAIR, PAIR[::-1], ""])
def test_the_ghost_goes_where_the_run_takes_the_nodes(square, target, tmp_path):
    (tmp_path / "d.txt").write_text("".join(f"{k} 0.1 0\n" for k in (0, 1)))
    file = FromFile(tmp_path / "d.txt", PAIR)
    turn, grow, go = Rotate(target, 30.0), Scale(target, (1.5,)), Translate(target, (1.0, 2.0))
    case = Case(roles=roles(*PAIR), motions=(file, turn, go, grow))
    found = displacements(case, square)
    ghosts = Ghosts(square).moved(case)
    assert set(ghosts) == set(case.markers_with("moving"))
    for name, points in ghosts.items():
        nodes = square.marker(name).nodes
        assert (points == square.points[nodes] + found.at(nodes)).all()


def test_the_ghost_of_each_zone_goes_where_the_run_takes_it():
    mesh = stage()
    names = [f"{zone}:{side}" for zone in (1, 2) for side in ("per1", "per2")]
    roles = dict.fromkeys(names, "periodic") | {"1:blade": "moving", "2:blade": "moving"}
    twist = SpanMotion("1:blade", "twist", (0.0, 1.0), (0.0, 3.0))
    lean = SpanMotion("", "lean", (0.0, 1.0), (0.0, 0.02))
    turn = Rotate("", 2.0)
    case = Case(roles=roles, motions=(twist, lean, turn), periodic_type="rotational")
    ghosts = Ghosts(mesh).moved(case)
    cases = zone_cases(by_zone(case, mesh), mesh)
    for number, (one, zone) in enumerate(zip(cases, zones_of(mesh), strict=True), 1):
        nodes = zone.marker("blade").nodes
        change = displacements(one, zone).at(nodes)
        assert np.allclose(ghosts[f"{number}:blade"], zone.points[nodes] + change, atol=1e-14)
        assert np.abs(change).max() > 0.01


@settings(max_examples=40)
@given(
    first=st.sets(st.sampled_from(["bottom", "left", "right", "top"]), min_size=1, max_size=3),
    data=st.data(),
)
def test_a_boundary_that_moves_later_does_not_join_a_motion(session, first, data):
    before = changes.set_role(session, tuple(first), "moving")
    selected = data.draw(st.sets(st.sampled_from(sorted(first))))
    before = changes.select(before, tuple(selected))
    offered = {new_target(before), *targets(before)}
    later = data.draw(st.sampled_from(sorted({*session.mesh.marker_names} - first)))
    for target in offered:
        asked = changes.add_motion(before, Translate(target, (1.0, 0.0)))
        after = changes.set_role(asked, (later,), "moving")
        (motion,) = after.case.motions
        assert not applies_to(motion, later)
        assert set(named(motion.marker)) <= first
        assert any(missing.marker == later for missing in run_requirements(after))
    # All that move now are offered together.
    assert any(set(named(target)) == first for target in offered)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("kind", [Ffd, FfdCamber, FfdThickness])
def test_a_new_box_has_all_nodes_of_its_motion_inside(square, cube, dim, count, kind):
    mesh = square if dim == 2 else cube
    names = mesh.marker_names[:count]
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_role(session, names, "moving")
    target = names if count > 1 else names[0]
    for number in (1, 2):  # the second has a name of its own
        session = changes.add_motion(session, kind.new(target, MotionStart(dim)))
        session = changes.add_box(session, number - 1)
    case = session.case
    assert [motion.box for motion in case.motions] == ["BOX", "BOX_2"] == list(box_names(session))
    moved = [replace(motion, index=(-1,) * len(motion.index)) for motion in case.motions]
    values = {"vector": (0.1, 0.2, 0.0)} if kind is Ffd else {"amount": 0.1}
    case = case.change(motions=(replace(moved[0], **values),))
    assert not check_case(case, mesh)
    found = displacements(case, mesh)
    wanted = np.unique(np.concatenate([mesh.marker(name).nodes for name in names]))
    assert found.nodes.tolist() == wanted.tolist()
    if kind is not FfdThickness:  # which leaves the middle
        assert (np.abs(found.vectors).max(axis=1) > 0.09).all()


def test_words_of_many_boundaries_are_short():
    names = tuple(f"wall{k}" for k in range(1, 21))
    assert describe(Translate(names, (1.0, 0.0))) == (
        "wall1 + wall2 + wall3 + 17 more: translate by (1, 0)"
    )
    assert describe(Translate(names[:4], (1.0, 0.0))).startswith("wall1 + wall2 + wall3 + wall4:")


def test_words():
    assert describe(Rotate(PAIR, 5.0)) == "bottom + left: rotate by 5° about their centroid"
    assert describe(Rotate("", 5.0)) == "all moving: rotate by 5° about their centroid"
    assert describe(Scale(PAIR, (2.0,))) == "bottom + left: scale by 2 about their centroid"
    assert describe(Rotate("left", 5.0)) == "left: rotate by 5° about its centroid"
    one, other = Case(motions=(Rotate(PAIR, 5.0),)), Case(motions=(Rotate("top", 5.0),))
    assert motion_labels([one, other]) == ["bottom + left: rotate +5°", "top: rotate +5°"]


def test_a_boundary_that_no_longer_moves_leaves_the_motion(session):
    session = changes.set_role(session, ("bottom", "left", "top"), "moving")
    session = changes.add_motion(session, Translate(("bottom", "left", "top"), (1.0, 0.0)))
    session = changes.add_motion(session, Translate("", (1.0, 0.0)))
    session = changes.set_role(session, ("left",), "fixed")
    assert [m.marker for m in session.case.motions] == [("bottom", "top"), ""]
    session = changes.set_role(session, ("top",), "fixed")
    assert [m.marker for m in session.case.motions] == ["bottom", ""]
    session = changes.set_role(session, ("bottom",), "fixed")
    assert [m.marker for m in session.case.motions] == [""]


def test_who_has_a_motion_is_not_asked_for_one(session):
    session = changes.set_role(session, PAIR, "moving")
    assert sum("has no motion" in m.text for m in run_requirements(session)) == 2
    one = changes.add_motion(session, Translate("left", (0.0, 0.1)))
    assert [m.text for m in run_requirements(one)] == ["“bottom” has no motion: add one."]
    assert not run_requirements(changes.add_motion(session, Translate(PAIR, (0.0, 0.1))))
    assert not run_requirements(changes.add_motion(session, Translate("", (0.0, 0.1))))


def test_the_table_lists_the_nodes_of_all_of_them(square):
    case = Case(roles=roles("bottom", "left", "top"))
    rows = TableRows.on(square, case, PAIR)
    assert rows.of == "bottom, left"
    every = np.concatenate([square.marker(name).nodes for name in PAIR])
    assert rows.nodes.tolist() == np.unique(every).tolist()


@pytest.mark.parametrize("selected", [(), ("left",)])
def test_a_new_motion_is_of_what_the_user_chose_to_move_not_of_a_guess(session, selected):
    guesses = {name: Guess("moving", "its name") for name in ("left", "right")}
    moving = dict.fromkeys((*guesses, "top"), "moving")
    guessed = replace(session, case=session.case.change(roles=moving), guesses=guesses)
    guessed = changes.select(guessed, selected)
    assert new_target(guessed) == (selected or ("top",))[0]
    alone = changes.add_motion(guessed, Translate("top", (1.0, 0.0)))
    assert new_target(alone) == (selected[0] if selected else ("left", "right"))
    assert set(alone.guesses) == {"left", "right"}  # the window still marks them with "?"
