from collections import deque
from itertools import chain, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from slideviz.case.model import Case
from slideviz.case.motions import span as span_motions
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.case.moving_nodes import displacements
from slideviz.errors import CaseError, DeformError
from slideviz.machine import span_field
from slideviz.mesh.quality import quality
from slideviz.sections import span as sections
from slideviz.session import changes
from slideviz.session.jobs import (
    Job,
    find_intersection,
    forget_intersection,
    intersection_key,
    set_intersection,
)
from slideviz.session.opening import open_mesh
from slideviz.session.passages import find_periods
from slideviz.session.run_messages import run_requirements
from slideviz.session.state import StepFrame
from slideviz.solver.deform import deform
from tests.builders import cube, nested_zones
from tests.builders import passage as wheel_passage


def look(case, mesh, stopped=False):
    text, folding = find_intersection(case, mesh, Job(stopped=lambda: stopped))
    assert not folding
    return text


@pytest.fixture
def shifted(passage):
    """The passage with its blade moved by so much."""

    def make(by):
        motion = Translate("airfoil", (0.0, by))
        return passage.case.change(motions=(motion,), periodic="none", sliding="none")

    return make


def test_an_intersection_is_a_sentence_with_a_place_and_a_remedy(shifted, passage):
    text = look(shifted(-0.4), passage.mesh)
    assert text.startswith("The motion puts airfoil through periodic_1 near (")
    remedy = "Periodicity “periodic, fixed vertices”, with which periodic_1 moves along."
    assert text.endswith(f"or choose {remedy}")
    assert "; move airfoil less" in text


def test_there_is_none_where_there_is_none(shifted, passage):
    assert look(shifted(0.001), passage.mesh) == ""
    assert look(shifted(-0.4), passage.mesh, stopped=True) == ""
    assert look(shifted(-0.4).change(motions=()), passage.mesh) == ""


def test_other_problems_of_the_case_are_told_elsewhere(passage):
    wrong = Case(roles={"airfoil": "moving"}, motions=(Translate("airfoil", (1.0, 0.0, 0.0)),))
    assert look(wrong, passage.mesh) == ""
    lost = Case(roles={"airfoil": "moving"}, motions=(FromFile(Path("/none"), "airfoil"),))
    assert look(lost, passage.mesh) == ""


def test_mistakes_of_a_displacement_file_are_told_without_its_folder(passage, tmp_path):
    file = tmp_path / "table.txt"
    case = Case(roles={"airfoil": "moving"}, motions=(FromFile(file, "airfoil"),))
    node = int(passage.mesh.marker("airfoil").nodes[0])
    file.write_text(f"{node} 0.001 0.002\n")
    assert look(case, passage.mesh) == ""
    file.write_text(f"{node} 0.001\nx 1 2\n")
    text = look(case, passage.mesh)
    assert text.startswith("table.txt:1: ")
    assert "expected 3" in text
    assert text.endswith("(1 more).")


def test_boundaries_that_disagree_about_a_node_are_told(square):
    roles = {"bottom": "moving", "left": "moving"}
    motions = (Translate("bottom", (0.1, 0.0)), Translate("left", (0.2, 0.0)))
    case = Case(roles=roles, motions=motions)
    assert "bottom" in look(case, square)
    alike = case.change(motions=(motions[0], Translate("left", (0.1, 0.0))))
    text, said = find_intersection(alike, square, Job())
    assert text == ""
    assert "of bottom at (4.1, 0) has left right by 0.1, which is fixed; let that" in str(said)


def test_an_intersection_keeps_a_run_from_starting_and_an_old_answer_is_dropped(session):
    session = changes.set_role(session, ["bottom"], "moving")
    session = changes.add_motion(session, Translate("bottom", (0.0, 9.0)))
    assert not run_requirements(session)
    key = intersection_key(session)
    told = set_intersection(session, ("It clashes.", None), key)
    assert [(m.text, m.place) for m in run_requirements(told)] == [("It clashes.", "motion")]
    assert not run_requirements(set_intersection(told, ("", None), key))
    later = changes.replace_motion(session, 0, Translate("bottom", (0.0, 0.1)))
    assert set_intersection(later, ("It clashes.", None), key) is later
    # What is known of other motions is forgotten at once: it would keep a run from starting.
    assert forget_intersection(told, key) is told
    changed = changes.set_case(told, motions=later.case.motions)
    assert not run_requirements(forget_intersection(changed, key))
    assert forget_intersection(later, key) is later
    assert intersection_key(changes.set_case(session, steps=7)) == key
    assert intersection_key(changes.set_role(session, ["top"], "internal")) != key


def test_what_the_first_motion_and_section_over_the_span_need_is_computed_before(monkeypatch):
    mesh = wheel_passage()
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    case = Case(roles=roles, periodic="moving", sliding="ps")
    twist = case.change(motions=(SpanMotion("blade", "twist", (0.0, 1.0), (0.0, 3.0)),))
    find_intersection(case, mesh, Job())
    monkeypatch.setattr(span_field, "_span_between", None)
    monkeypatch.setattr(span_field, "SpanCurves", None)
    monkeypatch.setattr(span_motions, "BladeSections", None)
    assert np.abs(displacements(twist, mesh).vectors).max() > 1e-3
    walls = sections.find_walls(mesh, twist, find_periods(mesh, twist))
    assert len(walls.channels[0].curves.m_prime)
    # Where names do not say which, nothing is said here, either.
    assert look(Case(), cube()) == ""


def test_what_goes_through_itself_is_told_and_may_run(passage, tmp_path):
    mesh, file = passage.mesh, tmp_path / "table.txt"
    nodes = mesh.marker("airfoil").nodes
    x, y = mesh.points[nodes].T
    inside = (x > 0.3) & (x < 0.7)
    upper = inside & (y > np.interp(x, [0.3, 0.7], [y[inside].mean()] * 2))
    file.write_text(
        "".join(f"{n} 0 {-0.3 if up else 0}\n" for n, up in zip(nodes, upper, strict=True))
    )
    case = Case(roles={"airfoil": "moving"}, motions=(FromFile(file, "airfoil"),))
    text, folding = find_intersection(case, mesh, Job())
    assert text == ""
    assert str(folding).startswith("airfoil goes through itself near (")
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, (), case)
    told = set_intersection(session, (text, folding), intersection_key(session))
    assert told.folding == folding
    assert not run_requirements(told)


ANY = "moving", "fixed", "sliding", "internal"
PAIRS = [*product(("moving",), ANY), *product(ANY, ("moving",)), ("fixed", "fixed")]
"""Roles of an interface of which nothing moves that depends on the result of a run."""


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.sampled_from(PAIRS), min_size=2, max_size=2),
    st.lists(st.tuples(*[st.integers(-5, 5)] * 2), min_size=4, max_size=4),
    st.sampled_from([(), ("1:inner", "2:outer")]),
    st.booleans(),
)
def test_the_verdict_is_that_of_the_run(kinds, steps, interfaces, alike):
    """A square in a frame in a frame: what moves one boundary takes along that of the next zone."""
    mesh = nested_zones()
    names = ("1:inner", "2:outer", "2:inner", "3:outer")
    roles = dict(zip(names, chain(*kinds), strict=True))
    assume("moving" in roles.values())
    shifts = [steps[0]] * 4 if alike else steps
    motions = tuple(
        Translate(name, (0.06 * x, 0.05 * y))
        for name, (x, y) in zip(names, shifts, strict=True)
        if roles[name] == "moving"
    )
    case = Case(roles=roles, motions=motions, interfaces=interfaces, relax="no", layers="no")
    text, _ = find_intersection(case, mesh, Job())
    refusal = ""
    try:
        deque(deform(case, mesh), 0)
    except CaseError as problem:
        refusal = str(problem)
    except DeformError:  # of what can only be seen in a result
        pass
    assert bool(text) == bool(refusal)
    assert text.casefold().removesuffix(".") in refusal.casefold()
