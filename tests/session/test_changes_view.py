from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.mesh.quality import INVERTED, quality
from slideviz.rbf.reduction import AUTO
from slideviz.sections.model import Section
from slideviz.sections.polygons import ONLY_INVERTED
from slideviz.session import changes
from slideviz.session.colors import fit_colors
from slideviz.session.opening import open_mesh
from slideviz.session.run_messages import run_requirements
from slideviz.session.state import Session, StepFrame, result_settings, second_view
from slideviz.session.store import Store


def moved(session, by=0.25):
    points = session.mesh.points.copy()
    points[12] += by
    mesh = session.mesh.with_points(points)
    return StepFrame(mesh, quality(mesh, session.mesh))


def test_a_mesh_opens_with_guessed_roles_for_every_boundary(session):
    assert dict(session.case.roles) == dict.fromkeys(session.mesh.marker_names, "fixed")
    assert not session.unsaved_case
    assert session.frame is session.frames[0]


def test_roles_that_a_case_does_not_have_are_guesses(square):
    case = Case(roles={"left": "sliding"})
    session = open_mesh(StepFrame(square, quality(square)), Path("a.su2"), (), case)
    assert session.role("left") == "sliding"
    assert session.role("top") == "fixed"
    assert set(session.guesses) == {"bottom", "right", "top"}
    assert session.with_chosen_roles(session.case).roles == {"left": "sliding"}
    confirmed = changes.confirm_guesses(session, ("top",))
    chosen = confirmed.with_chosen_roles(confirmed.case)
    assert chosen.roles == {"left": "sliding", "top": "fixed"}
    assert session.case.mesh_file == Path("a.su2")
    assert not session.unsaved_case


def test_a_role_for_several_confirms_their_guesses_and_leaves_the_others(session):
    assert set(session.guesses) == {"bottom", "right", "top", "left"}
    new = changes.set_role(session, ("left", "right"), "moving")
    assert new.case.markers_with("moving") == ("right", "left")
    assert set(new.guesses) == {"bottom", "top"}
    assert new.unsaved_case
    assert session.role("left") == "fixed", "the old state is a value and stays"


def test_confirming_keeps_the_roles(session):
    new = changes.confirm_guesses(session)
    assert not new.guesses
    assert new.case == session.case


def test_motions_of_a_boundary_that_no_longer_moves_go(session):
    session = changes.set_role(session, ("left", "top"), "moving")
    session = changes.add_motion(session, Translate("left", (1.0, 0.0)))
    session = changes.add_motion(session, Translate("top", (0.0, 1.0)))
    session = changes.set_role(session, ("left",), "fixed")
    assert [motion.marker for motion in session.case.motions] == ["top"]


def test_periodicity_ends_with_the_last_periodic_boundary(session):
    session = changes.set_role(session, ("left", "right"), "periodic")
    session = changes.set_case(session, periodic="moving")
    session = changes.set_role(session, ("left",), "fixed")
    assert session.case.periodic == "moving"
    assert changes.set_role(session, ("right",), "fixed").case.periodic == "none"


def test_the_first_sliding_boundary_turns_sliding_on_and_no_later_one(session):
    """Without it the role would do nothing, and a run would repeat the one before."""
    assert session.case.sliding == "none"
    new = changes.set_role(session, ("left", "right"), "sliding")
    assert new.case.sliding == "ps"
    off = changes.set_case(new, sliding="none")
    assert changes.set_role(off, ("top",), "sliding").case.sliding == "none"
    direct = changes.set_case(session, sliding="ds")
    assert changes.set_role(direct, ("left",), "sliding").case.sliding == "ds"


def test_motions_are_added_replaced_moved_and_removed_in_order(session):
    a, b, c = (Translate("left", (float(i), 0.0)) for i in range(3))
    for motion in (a, b):
        session = changes.add_motion(session, motion)
    session = changes.replace_motion(session, 1, c)
    assert session.case.motions == (a, c)
    session = changes.move_motion(session, 1, -1)
    assert session.case.motions == (c, a)
    assert changes.move_motion(session, 0, -1).case.motions == (c, a)
    assert changes.remove_motion(session, 0).case.motions == (a,)


def test_hide_show_isolate(session):
    assert changes.show_boundaries(session, ("left",), False).view.hidden == {"left"}
    only = changes.isolate(session, ("left",))
    assert only.view.hidden == {"bottom", "right", "top"}
    assert changes.show_boundaries(only, session.mesh.marker_names).view.hidden == frozenset()


def test_frames_are_kept_shown_and_limited(session):
    session = changes.add_frames(changes.start_run(session), [moved(session)])
    session = changes.start_run(session)
    assert len(session.frames) == 1
    session = changes.add_frames(session, [moved(session), moved(session, 0.3)])
    assert session.view.frame == 2
    assert session.deformed is session.frames[2]
    assert session.unsaved_mesh
    assert changes.show_frame(session, 99).view.frame == 2
    assert changes.show_frame(session, -3).view.frame == 0
    assert not changes.saved_mesh(session).unsaved_mesh


def test_other_settings_make_the_steps_outdated_but_file_names_do_not(session):
    session = changes.add_frames(changes.start_run(session), [moved(session)])
    assert not session.outdated
    assert not changes.set_case(session, mesh_out=Path("x.su2")).outdated
    assert changes.set_case(session, steps=7).outdated
    assert changes.set_role(session, ("top",), "sliding").outdated


def test_settings_without_effect_make_no_step_outdated(session):
    session = changes.add_frames(changes.start_run(session), [moved(session)])
    assert not changes.set_case(session, curved=True, direction=1).outdated


def test_essence_takes_unnamed_boundaries_as_fixed():
    assert result_settings(Case(roles={"a": "fixed", "b": "moving"})) == result_settings(
        Case(roles={"b": "moving"})
    )


def test_what_is_missing_is_told_in_the_order_of_work(session, tmp_path):
    def first(state):
        found = run_requirements(state)
        return (found[0].text, found[0].place) if found else None

    assert first(Session()) == ("Open a mesh first.", "open")
    assert first(session) == ("No boundary moves: give one the role “moving”.", "boundaries")
    session = changes.set_role(session, ("left",), "moving")
    assert first(session) == ("“left” has no motion: add one.", "motion")
    for path, words in (
        (Path("/no/such/file.txt"), "The displacement file /no/such/file.txt does not exist."),
        (Path(), "A motion lacks its displacement file: choose it."),
        (tmp_path, f"{tmp_path} is a folder: choose the displacement file in it."),
    ):
        assert first(changes.add_motion(session, FromFile(path)))[0] == words
    session = changes.add_motion(session, Rotate("left", 3.0))
    assert first(session) is None
    session = changes.set_role(session, ("bottom", "top"), "periodic")
    session = changes.set_case(session, periodic="moving")
    assert first(session)[1] == "method"
    assert first(changes.set_case(session, sliding="ps")) is None


@pytest.mark.parametrize(
    ("still", "moves"),
    [
        (Translate("left", (0.0, 0.0)), Translate("left", (0.0, 0.1))),
        (Rotate("left", 0.0), Rotate("left", -0.1)),
        (Scale("left", (1.0, 1.0)), Scale("left", (1.0, 1.1))),
        (Radial("left", point=(0.0, 0.0)), Radial("left", 1.0, 0.01, point=(9.0, 9.0))),
    ],
)
def test_motions_that_move_nothing_are_not_ready(session, still, moves):
    session = changes.set_role(session, ("left",), "moving")
    session = changes.add_motion(session, still)
    (missing,) = run_requirements(session)
    assert missing.place == "motion"
    assert "Nothing moves yet" in missing.text
    # One of several may stay.
    assert run_requirements(changes.add_motion(session, moves)) == ()


def test_what_the_case_finds_wrong_is_passed_on(session):
    session = changes.set_role(session, ("left",), "moving")
    session = changes.add_motion(session, Translate("left", (1.0, 0.0, 0.0)))
    (missing,) = run_requirements(session)
    assert "has 3 components" in missing.text


@pytest.mark.parametrize(
    ("what", "name"), [("size", "size"), ("skew", "skew"), ("size-skew", "values")]
)
def test_frame_values_are_those_asked_for(session, what, name):
    frame = moved(session)
    assert frame.values(what) is getattr(frame.quality, name)


def test_store_tells_everybody_of_one_change_before_the_next():
    store, heard = Store(), []
    one, two = replace(store.session, path=Path("1")), replace(store.session, path=Path("2"))

    def first(old, new):
        heard.append(("first", new.path))
        if new is one:
            store.put(two)

    store.listen(first)
    store.listen(lambda old, new: heard.append(("second", new.path)))
    store.put(one)
    p1, p2 = Path("1"), Path("2")
    assert heard == [("first", p1), ("second", p1), ("first", p2), ("second", p2)]
    assert store.session is two


def test_store_works_again_after_a_listener_failed():
    store, heard = Store(), []

    def bad(old, new):
        if not heard:
            raise ValueError("once")

    store.listen(bad)
    with pytest.raises(ValueError, match="once"):
        store.put(replace(store.session, path=Path("1")))
    store.listen(lambda old, new: heard.append(new))
    heard.append(None)
    store.put(replace(store.session, path=Path("2")))
    assert heard[-1].path == Path("2")


def test_fresh_view_keeps_the_taste_but_not_the_boundaries(session):
    gone = {"hidden": frozenset({"gone"}), "selected": ("gone",)}
    old = replace(session.view, drawn=frozenset({"triad"}), **gone)
    new = changes.inherit_view(session, old)
    assert new.view.drawn == {"triad"}
    assert new.view.hidden == frozenset()
    assert new.view.selected == ()
    assert np.array_equal(new.mesh.points, session.mesh.points)


def test_a_mesh_opens_with_automatic_data_reduction_unless_its_case_says_otherwise(square):
    first = StepFrame(square, quality(square))
    session = open_mesh(first, None)
    assert session.case.reduction == AUTO
    assert not session.unsaved_case
    exact = Case(reduction=None)
    assert open_mesh(first, None, case=exact).case.reduction is None


def test_store_tells_nobody_when_nothing_changed(session):
    store, told = Store(session), []
    store.listen(lambda old, new: told.append(new))
    store.change(lambda same: same)
    assert not told
    store.change(changes.set_case, steps=3)
    assert [new.case.steps for new in told] == [3]


def test_the_undeformed_mesh_can_be_shown_beside_a_run(session):
    frame = StepFrame(session.mesh.with_points(session.mesh.points * 2.0), session.first.quality)
    ran = changes.add_frames(changes.start_run(session), [frame, frame])
    both = changes.show_beside(ran, changes.UNDEFORMED)
    assert both.view.beside == changes.UNDEFORMED
    assert second_view(both).frame is session.first
    assert both.frame is frame
    gone = changes.remove_run(changes.end_run(both, "done"), 1)
    assert gone.view.beside is None


def test_the_range_of_the_displacement_ends_at_a_round_number():
    from slideviz.session.state import round_up

    for value, wanted in ((0.0202, 0.025), (1.0, 1.0), (9.1, 10.0), (3e-7, 3e-7), (0.0, 0.0)):
        assert round_up(value) == pytest.approx(wanted, rel=1e-12)


def test_each_quantity_has_a_color_range_of_its_own(session):
    session = changes.set_view(session, color_by="size-skew", color_range=(0.949, 0.967))
    moved = changes.set_view(session, color_by="displacement")
    assert moved.view.color_range is None
    assert moved.color_range == (0.0, 1.0)
    moved = changes.set_view(moved, color_range=(0.0, 0.02))
    assert changes.set_view(moved, color_by="skew").view.color_range is None
    back = changes.set_view(changes.set_view(moved, color_by="role"), color_by="size-skew")
    assert back.view.color_range == (0.949, 0.967)
    assert changes.set_view(back, color_by="displacement").view.color_range == (0.0, 0.02)


def test_cells_chosen_by_quality_are_not_chosen_by_displacement(session):
    session = changes.set_view(session, color_by="skew", threshold=(0.2, 0.4))
    assert changes.set_view(session, color_by="size").view.threshold == (0.2, 0.4)
    assert changes.set_view(session, color_by="displacement").view.threshold is None
    assert changes.set_view(session, color_by="orthogonality").view.threshold is None
    session = changes.set_view(session, threshold=ONLY_INVERTED)
    assert changes.set_view(session, color_by="displacement").view.threshold == ONLY_INVERTED


def test_one_section_is_laid_flat(session):
    for _ in range(2):
        session = changes.add_section(session, Section("plane"))
    for index, wanted in ((0, [True, False]), (1, [False, True]), (None, [False, False])):
        session = changes.lay_flat(session, index)
        assert [section.flat for section in session.view.sections] == wanted


def test_the_section_that_is_chosen_and_its_handle_are_undone_with_the_rest(session):
    at_s = iter(range(0, 1000, 10))
    store = Store(session, lambda: next(at_s))
    store.change(changes.add_section, Section("plane"))
    store.change(changes.add_section, Section("cylinder", radius=0.5))
    assert store.session.view.section.kind == "cylinder"
    store.change(changes.choose_section, 0)
    store.change(changes.show_handle, "section")
    store.change(changes.remove_section, 0)
    assert (store.session.view.section_index, store.session.view.handle) == (0, "section")
    assert store.session.view.section.kind == "cylinder"
    told = []
    while store.can_undo:
        told.append(store.can_undo)
        store.undo()
        view = store.session.view
        told.append((view.section and view.section.kind, view.handle))
    assert told == [
        *("removing a section", ("plane", "section")),
        *("handle shown or hidden", ("plane", "")),
        *("choice of a section", ("cylinder", "")),
        *("new section", ("plane", "")),
        *("new section", (None, "")),
    ]
    for _ in range(4):
        store.redo()
    assert (store.session.view.section_index, store.session.view.handle) == (0, "section")


def test_a_mesh_opens_with_the_section_chosen_that_lies_flat(square):
    sections = (("plane", (1.0, 0, 0, 0.5, 0, 0), False, flat, True) for flat in (False, True))
    case = Case(view={"VIEW_SECTIONS": tuple(sections)})
    session = open_mesh(StepFrame(square, quality(square)), None, (), case)
    assert (session.view.section_index, session.view.handle) == (1, "")
    case = Case(view={"VIEW_SECTIONS": (("plane", (1.0, 0, 0, 0.5, 0, 0), False, False, True),)})
    assert open_mesh(StepFrame(square, quality(square)), None, (), case).view.section_index == 0


@pytest.fixture
def ran(session):
    """Two steps, the second worse."""
    started = changes.start_run(session)
    return changes.add_frames(started, [moved(session, 0.1), moved(session, 0.3)])


def test_the_colors_fit_all_steps_whichever_is_shown(ran):
    session = changes.set_view(ran, color_by="size-skew", frame=0)
    values = [frame.quality.values for frame in session.frames]
    lowest, highest = (pick(values) for pick in (np.min, np.max))
    fitted = fit_colors(session)
    low, high = fitted.view.color_range
    assert low <= lowest < highest <= high
    assert high - low < 1.03 * (highest - lowest)
    assert high <= 1.0
    for frame in range(len(session.frames)):
        again = fit_colors(changes.set_view(fitted, frame=frame))
        assert again.view.color_range == (low, high)


def test_the_colors_fit_the_step_that_is_shown(ran):
    session = changes.set_view(ran, color_by="size-skew", frame=1)
    low, high = fit_colors(session, every=False).view.color_range
    values = session.frames[1].quality.values
    assert low <= values.min() < low + 0.02
    assert high - 0.02 < values.max() <= high
    assert low > session.frames[2].quality.min + 0.02


def test_inverted_cells_do_not_widen_the_colors(ran):
    session = changes.set_view(ran, color_by="size-skew")
    last = session.run_shown.last
    status = last.quality.status.copy()
    worst = np.argmin(last.quality.values)
    status[worst] = INVERTED
    folded = replace(last, quality=replace(last.quality, status=status))
    runs = (replace(session.run_shown, frames=(folded,)),)
    left = np.delete(last.quality.values, worst).min()
    low, _ = fit_colors(replace(session, runs=runs)).view.color_range
    assert last.quality.values[worst] < low <= left


def test_roles_and_equal_values_have_no_range(ran, session):
    assert fit_colors(ran) is ran, "roles"
    equal = changes.set_view(session, color_by="size")
    assert fit_colors(equal) is equal


def test_invalid_fields_of_two_panels_do_not_change_in_turns(session):
    both = changes.set_invalid(changes.set_invalid(session, "motion", ("a",)), "method", ("b",))
    assert changes.set_invalid(both, "motion", ("a",)) is both
    assert changes.set_invalid(both, "method", ("b",)) is both
    assert changes.set_invalid(both, "motion", ()).invalid == (("method", "b"),)


def test_the_color_range_of_a_metric_is_that_of_its_values(square):
    session = open_mesh(StepFrame(square, quality(square)), None)
    for what, expected in (("skew", (0, 1)), ("orthogonality", (0, 90)), ("skewness", (0, 4))):
        assert changes.set_view(session, color_by=what).color_range == expected
    low, high = changes.set_view(session, color_by="expansion").color_range
    assert low == 1
    stretched = square.with_points(np.exp(3 * square.points))
    frame = StepFrame(stretched, quality(stretched, square))
    session = changes.add_frames(changes.start_run(session), [frame])
    assert changes.set_view(session, color_by="expansion").color_range[1] > high
