"""The store: what listeners hear, and what undo brings back."""

from dataclasses import fields, replace
from inspect import isfunction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.mesh.quality import quality
from slideviz.session import changes
from slideviz.session.changes import UNDO_WORDS, undo_words
from slideviz.session.colors import fit_colors
from slideviz.session.opening import open_mesh
from slideviz.session.state import Session, StepFrame, ViewState, second_view
from slideviz.session.store import MERGE_S, Store, UndoState
from slideviz.terms import COLOR_BY, ROLES, SHOWN


class Clock:
    """Seconds that pass only when told."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def store(session, clock):
    return Store(session, clock)


def test_undo_and_redo_bring_back_roles(store, clock):
    before = store.session.case
    store.change(changes.set_role, ("left",), "sliding")
    clock.now += 10
    store.change(changes.set_role, ("top",), "moving")
    after = store.session.case
    assert store.can_undo == "role"
    store.undo()
    assert store.session.role("top") == "fixed"
    assert store.session.role("left") == "sliding"
    store.undo()
    assert store.session.case == before
    assert not store.can_undo
    store.undo()
    store.redo()
    store.redo()
    assert store.session.case == after
    assert not store.can_redo


def test_a_new_change_after_undo_ends_redo(store, clock):
    store.change(changes.set_case, steps=3)
    store.undo()
    assert store.can_redo == "settings"
    store.change(changes.set_case, steps=5)
    assert not store.can_redo


def test_typing_into_one_field_is_undone_at_once_but_another_field_is_not(store, clock):
    for steps in (1, 12, 123):
        store.change(changes.set_case, steps=steps)
        clock.now += MERGE_S / 2
    store.change(changes.set_case, sliding="ps")
    store.undo()
    assert store.session.case.steps == 123
    store.undo()
    assert store.session.case.steps == 1
    assert not store.can_undo


@pytest.mark.parametrize(
    ("motion", "first", "second"),
    [
        (Translate("left", (0.0, 0.0)), {"vector": (0.5, 0.0)}, {"vector": (0.5, 0.25)}),
        (Scale("left", (1.0, 1.0)), {"factors": (1.0, 2.0)}, {"factors": (3.0, 2.0)}),
        (Rotate("left", 1.0, (0.0, 0.0)), {"angle_deg": 2.0}, {"point": (0.0, 1.0)}),
        (Rotate("left", 1.0, (0.0, 0.0)), {"point": (2.0, 0.0)}, {"point": (2.0, 1.0)}),
    ],
)
@pytest.mark.parametrize("digits", [1, 3])
def test_two_numbers_typed_quickly_are_undone_apart(store, motion, first, second, digits):
    store.change(changes.set_role, ("left",), "moving")
    store.change(changes.add_motion, motion)
    one = replace(motion, **first)
    for state in (one, replace(one, **second)):
        for _ in range(digits):  # the digits of a number belong together
            store.change(changes.replace_motion, 0, state)
    assert store.session.case.motions == (replace(one, **second),)
    store.undo()
    assert store.session.case.motions == (one,)
    store.undo()
    assert store.session.case.motions == (motion,)
    store.redo()
    store.redo()
    # A drag changes both, and is undone as one.
    store.set_dragging(True)
    store.change(changes.replace_motion, 0, one)
    store.change(changes.replace_motion, 0, motion)
    store.set_dragging(False)
    store.undo()
    assert store.session.case.motions == (replace(one, **second),)


def test_settings_that_are_directions_are_undone_number_by_number(store):
    for axis in ((1.0, 0.0, 1.0), (1.5, 0.0, 1.0), (1.5, 2.0, 1.0)):
        store.change(changes.set_case, axis=axis)
    store.undo()
    assert store.session.case.axis == (1.5, 0.0, 1.0)
    store.undo()
    assert store.session.case.axis == (0.0, 0.0, 1.0)


def test_there_and_back_within_a_moment_leaves_nothing_to_undo(store):
    store.change(changes.set_view, edges=False)
    store.change(changes.set_view, edges=True)
    assert not store.can_undo


def test_what_passes_is_not_undone(store, clock):
    store.change(changes.set_view, edges=False)
    clock.now += 10
    store.change(changes.select, ("left",))
    store.change(changes.mark_cell, 3)
    assert store.can_undo == "mesh edges"
    store.undo()
    assert "edges" in store.session.view.drawn
    assert store.session.view.selected == ("left",)
    assert store.session.view.marked_cell == 3


def test_saving_is_not_undone(store, clock, tmp_path):
    store.change(changes.set_case, steps=4)
    saved = store.session.case.change(source=tmp_path / "a.cfg")
    store.change(changes.saved_case, saved)
    store.undo()
    assert store.session.case.source == tmp_path / "a.cfg"
    assert store.session.case.steps == 1
    assert store.session.unsaved_case


def test_another_mesh_cannot_be_undone(store, cube):
    store.change(changes.set_case, steps=4)
    store.put(open_mesh(StepFrame(cube, quality(cube)), None))
    assert not store.can_undo


def test_each_change_that_can_be_undone_has_words():
    functions = {**vars(changes), "fit_colors": fit_colors}
    every = {name: undo_words(f, {}) for name, f in functions.items() if isfunction(f)}
    assert {name: words for name, words in every.items() if words} == {
        "add_box": "new box",
        "add_motion": "new motion",
        "add_section": "new section",
        "choose_control": "control point",
        "choose_section": "choice of a section",
        "confirm_guesses": "confirming guesses",
        "fit_colors": "color range",
        "isolate": "hidden boundaries",
        "lay_flat": "flat view",
        "move_motion": "order of motions",
        "place": "drag",
        "remove_motion": "removing a motion",
        "remove_run": "removing a run",
        "remove_section": "removing a section",
        "replace_motion": "motion",
        "replace_section": "section",
        "scale_motions": "scaled motion",
        "set_case": "settings",
        "set_keys": "settings",
        "set_role": "role",
        "set_view": "view",
        "show_boundaries": "hidden boundaries",
        "shape_box": "box",
        "show_handle": "handle shown or hidden",
        "adopt_settings": "settings of a run",
    }


def test_each_field_of_the_view_that_can_be_undone_has_a_word():
    passing = {"selected", "frame", "marked_cell", "marked_in", "beside", "swapped", "ranges"}
    passing |= {"color_by", "motion_index", "picks"}
    other_changes = {"section_index", "handle"}
    those = {field.name for field in fields(ViewState)} - passing - other_changes
    assert set(UNDO_WORDS) == those - {"drawn"} | set(SHOWN)


def test_undo_says_what_of_the_view_it_brings_back(store, clock):
    for values in ({"color_by": "skew"}, {"color_range": (0.5, 1.0)}, {"passages": 1}):
        store.change(changes.set_view, **values)
        clock.now += 10
    said = []
    while store.can_undo:
        said.append(store.can_undo)
        store.undo()
    assert said == ["neighbours", "color range"]


def test_what_the_view_is_colored_by_is_not_undone(store, clock):
    def change(**values):
        store.change(changes.set_view, **values)
        clock.now += 10

    change(color_by="size-skew")
    assert not store.can_undo
    change(color_range=(0.5, 1.0))
    change(color_by="skew")
    change(passages=1)
    store.undo()
    assert (store.session.view.passages, store.session.view.color_by) == (0, "skew")
    # Nor does undoing change it; the range that goes is that of the other quality.
    store.undo()
    assert (store.session.view.color_by, store.session.view.color_range) == ("skew", None)
    change(color_by="size-skew")
    assert store.session.view.color_range is None
    store.redo()
    assert store.session.view.color_range == (0.5, 1.0)


def test_what_the_mouse_holds_is_undone_as_one_however_long_it_takes(store, clock):
    for low in (0.1, 0.5):
        store.set_dragging(True)
        for step in range(4):
            store.change(changes.set_view, threshold=(low + 0.01 * step, 0.9))
            clock.now += 3 * MERGE_S
        store.set_dragging(False)
    assert store.session.view.threshold == (0.53, 0.9)
    store.undo()
    assert store.session.view.threshold == (0.13, 0.9)
    store.undo()
    assert store.session.view.threshold is None
    assert not store.can_undo


def run_once(store):
    perform(store, ("run", 1))
    return store.session.runs[-1]


def numbers(store):
    return [run.number for run in store.session.runs]


def test_a_removed_run_is_brought_back_and_removed_again(store, clock):
    first, second = run_once(store), run_once(store)
    store.change(changes.remove_run, 2)
    assert (numbers(store), store.session.shown) == ([1], 1)
    assert store.can_undo == "removing a run"
    store.undo()
    assert store.session.runs == (first, second)
    assert store.session.shown == 2
    store.redo()
    assert numbers(store) == [1]


def test_undoing_what_was_before_a_run_keeps_the_run(store, clock):
    run_once(store)
    store.change(changes.remove_run, 1)
    clock.now += 10
    store.change(changes.set_case, steps=7)
    later = run_once(store)
    assert later.number == 2, "no two runs of a session have the same number"
    store.undo()
    assert numbers(store) == [2]
    store.undo()
    assert numbers(store) == [1, 2]
    store.redo()
    assert numbers(store) == [2]


def test_only_the_last_two_removed_runs_are_kept(store, clock):
    for _ in range(3):
        run_once(store)
    for number in (3, 2, 1):
        store.change(changes.remove_run, number)
    assert [run.number for run in store.session.removed] == [2, 1]
    assert run_once(store).number == 4
    store.undo()
    store.undo()
    assert numbers(store) == [1, 2, 4]
    assert not store.can_undo, "the oldest cannot come back, so undo does not offer it"


def test_another_mesh_forgets_removed_runs(store, cube):
    run_once(store)
    store.change(changes.remove_run, 1)
    store.put(open_mesh(StepFrame(cube, quality(cube)), None))
    assert not store.session.removed
    assert not store.can_undo


names = st.lists(st.sampled_from(["left", "right", "top", "bottom"]), min_size=1, unique=True)
intents = st.one_of(
    st.tuples(st.just("set_role"), names.map(tuple), st.sampled_from(list(ROLES))),
    st.tuples(st.just("confirm_guesses")),
    st.tuples(st.just("confirm_guesses"), names.map(tuple)),
    st.tuples(st.just("add_motion"), st.sampled_from(["top", "left", ""])),
    st.tuples(st.just("remove_motion"), st.integers(0, 5)),
    st.tuples(st.just("move_motion"), st.integers(0, 5), st.sampled_from([-1, 1])),
    st.tuples(st.just("show_boundaries"), names.map(tuple), st.booleans()),
    st.tuples(st.just("isolate"), names.map(tuple)),
    st.tuples(st.just("select"), names.map(tuple)),
    st.tuples(st.just("mark_cell"), st.none() | st.integers(0, 15)),
    st.tuples(st.just("show_frame"), st.integers(-2, 9)),
    st.tuples(st.just("steps"), st.integers(0, 9)),
    st.tuples(st.just("color"), st.sampled_from(list(COLOR_BY))),
    st.tuples(st.just("run"), st.integers(0, 2)),
    st.tuples(st.just("show_run"), st.integers(0, 4)),
    st.tuples(st.just("show_beside"), st.none() | st.integers(0, 4)),
    st.tuples(st.just("remove_run"), st.integers(0, 4)),
    st.tuples(st.just("adopt_settings"), st.integers(0, 4)),
    st.tuples(st.just("undo")),
    st.tuples(st.just("redo")),
)


def perform(store, intent):
    name, *values = intent
    session = store.session
    if name == "add_motion":
        store.change(changes.add_motion, Translate(values[0], (0.1, 0.0)))
    elif name in ("remove_motion", "move_motion"):
        if values[0] < len(session.case.motions):
            store.change(getattr(changes, name), *values)
    elif name == "steps":
        store.change(changes.set_case, steps=values[0])
    elif name == "color":
        store.change(changes.set_view, color_by=values[0])
    elif name == "run":
        store.change(changes.start_run)
        frame = replace(session.first, mesh=session.mesh.with_points(session.mesh.points + 0.1))
        store.change(changes.add_frames, [frame] * values[0])
        store.change(changes.end_run, "done")
    elif name in ("undo", "redo"):
        getattr(store, name)()
    else:
        store.change(getattr(changes, name), *values)


def require_valid(session: Session):
    case, view = session.case, session.view
    assert set(case.roles) == set(session.mesh.marker_names)
    assert all(case.roles[name] in ROLES for name in case.roles)
    assert set(session.guesses) <= set(case.roles)
    assert view.hidden <= set(case.roles)
    assert 0 <= view.frame < len(session.frames)
    assert session.frame is session.frames[view.frame]
    assert session.shown is None or session.run_shown is not None
    assert view.beside in (None, changes.UNDEFORMED) or (
        session.run(view.beside) is not None and view.beside != session.shown
    )
    numbers = [run.number for run in session.runs]
    assert numbers == sorted(set(numbers))
    assert second_view(session).frame is not None
    assert np.isfinite(session.color_range).all()


@settings(max_examples=150, deadline=None)
@given(st.lists(intents, max_size=25), st.booleans())
def test_any_intents_keep_the_session_valid_and_undoing_all_gives_the_first_back(
    session, some, slowly
):
    clock = Clock()
    store = Store(session, clock)
    for intent in some:
        perform(store, intent)
        require_valid(store.session)
        clock.now += 2 * MERGE_S if slowly else 0.1
    while store.can_undo:
        store.undo()
        require_valid(store.session)
    # But for what the view is colored by.
    back = changes.set_view(store.session, color_by=session.view.color_by)
    assert UndoState.of(back) == UndoState.of(session)
    while store.can_redo:
        store.redo()
        require_valid(store.session)
