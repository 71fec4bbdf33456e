"""Motions of several boundaries: their ghosts, their words, and what is left of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.case.model import Case
from slideviz.case.motion import by_zone, displacements
from slideviz.case.motion_words import describe, motion_labels
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import applies_to, named
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.case.zones import zone_cases
from slideviz.mesh.zones import zones_of
from slideviz.session import changes
from slideviz.session.motions import Ghosts, TableRows, new_target, targets
from slideviz.session.run_messages import run_requirements
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
