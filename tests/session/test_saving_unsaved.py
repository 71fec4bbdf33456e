"""Unsaved work: the question before it would be lost, and the star in the title."""

from dataclasses import replace
from pathlib import Path

import pytest

from slideviz.mesh.quality import quality
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.saving import Unsaved, title_of, view_to_case
from slideviz.session.state import Run, StepFrame


@pytest.fixture(scope="module")
def session(passage):
    """Runs 1 and 2 of the case as it was opened; the second is shown."""
    frame = StepFrame(passage.mesh, quality(passage.mesh))
    opened = open_mesh(frame, None, (), passage.case)
    runs = tuple(Run(number, opened.case, (frame,), "done") for number in (1, 2))
    return replace(opened, runs=runs, shown=2, saved=opened.case)


def saved(session, *numbers):
    runs = (replace(run, saved=run.number in numbers) for run in session.runs)
    return replace(session, runs=tuple(runs))


def test_where_all_is_saved_nothing_is_asked(session):
    assert not Unsaved.of(saved(session, 1, 2), busy=False).lost


def test_a_mesh_is_asked_about_with_the_runs_that_are_not_shown(session):
    unsaved = Unsaved.of(session, busy=False)
    assert unsaved.can_save == ["session", "mesh"]
    assert unsaved.question("closing") == (
        "Save the deformed mesh of run 2 before closing?\nThe mesh of run 1 is not saved either."
    )
    assert "\n" not in Unsaved.of(saved(session, 1), busy=False).question("closing")


def test_other_runs_are_asked_about_where_the_mesh_of_the_one_that_is_shown_is_saved(session):
    unsaved = Unsaved.of(saved(session, 2), busy=False)
    assert unsaved.can_save == ["session"]
    assert unsaved.question("opening another mesh").splitlines() == [
        "Save the session before opening another mesh?",
        "The mesh of run 1 is not saved either.",
    ]
    written = changes.saved_session(session, session, Path("a.slideviz"))
    assert not Unsaved.of(written, busy=False).lost
    assert title_of(written) == "a.slideviz – slideviz"
    later = changes.set_case(written, steps=9)
    assert title_of(later) == "*a.slideviz – slideviz"
    # What was changed while it was written is not saved.
    meanwhile = changes.saved_session(changes.set_case(session, steps=9), session, Path("b"))
    assert meanwhile.unsaved_case


@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("shown", [1, 2, 3])
def test_a_run_that_goes_on_is_to_be_stopped_first_and_the_others_are_named(session, count, shown):
    goes_on = Run(3, session.case, session.runs[0].frames * count)
    session = replace(session, runs=(*session.runs, goes_on), shown=shown)
    asked = {
        0: "Run 3 is still running, and has no finished step yet. Stop it?",
        1: "Run 3 is still running. Stop it and keep its finished step?",
        3: "Run 3 is still running. Stop it and keep its 3 finished steps?",
    }[count]
    for done, others in (
        ((1, 2), []),
        ((2,), ["The mesh of run 1 is not saved either."]),
        ((), ["The meshes of runs 1, 2 are not saved either."]),
    ):
        unsaved = Unsaved.of(saved(session, *done), busy=True)
        assert unsaved.can_save == ["run"]
        assert unsaved.question("closing").splitlines() == [asked, *others]
    changed = Unsaved.of(saved(changes.set_case(session, steps=7), 1, 2), busy=True)
    assert changed.can_save == ["run"]
    assert changed.question("closing").splitlines() == [
        asked, "Not saved either: roles, motions and method.",
    ]  # fmt: skip
    # Another job is none of these, and a design's run is computed again at a click.
    ended = replace(session, runs=(*session.runs, replace(goes_on, end="done")))
    assert "run" not in Unsaved.of(ended, busy=True).lost
    looked_at = replace(session, runs=(*session.runs, replace(goes_on, panels=session.case)))
    assert "run" not in Unsaved.of(looked_at, busy=True).lost


def test_a_case_is_asked_about_by_the_name_of_its_file(session):
    changed = changes.set_case(saved(session, 1, 2), steps=7)
    named = replace(changed, case=replace(changed.case, source=Path("a.cfg")))
    unsaved = Unsaved.of(named, busy=False)
    assert unsaved.question("opening another mesh") == (
        "Save the changes to a.cfg before opening another mesh?"
    )
    assert title_of(named) == "*a.cfg – slideviz"
    assert title_of(replace(named, saved=named.case)) == "a.cfg – slideviz"


def test_a_design_that_is_looked_at_makes_no_star(session):
    named = replace(session.case, source=Path("a.cfg"))
    opened = replace(session, case=named, saved=named)
    frame = session.runs[0].frames[0]
    design = replace(named, steps=7)
    assert title_of(replace(opened, runs=(Run(1, design, (frame,), "done"),), shown=1))[0] == "*"
    looked_at = Run(1, design, (frame,), "done", name="design 1", panels=named)
    assert title_of(replace(opened, runs=(looked_at,), shown=1)) == "a.cfg – slideviz"


def test_the_mesh_of_a_design_that_is_looked_at_is_not_asked_about(session):
    design = replace(session.runs[0], name="design 1", panels=session.case)
    looked_at = replace(session, runs=(design,), shown=1)
    assert not Unsaved.of(looked_at, busy=False).lost
    assert not Unsaved.of(looked_at, busy=True).lost
    # Nor is it among the others, beside the mesh of a run.
    beside = replace(session, runs=(design, session.runs[1]))
    assert "either" not in Unsaved.of(beside, busy=False).question("closing")


def test_designs_with_results_can_be_saved(session):
    words = "The table of designs, 2 with results, is not saved."
    alone = Unsaved.of(saved(session, 1, 2), busy=False, designs=words)
    assert alone.can_save == ["session", "table"]
    assert alone.question("closing") == f"Save the table of designs before closing?\n{words}"
    both = Unsaved.of(saved(session, 1), busy=False, designs=words)
    assert both.can_save == ["session", "mesh", "table"]
    assert both.question("closing").splitlines() == [
        "Save the deformed mesh of run 2 before closing?",
        words,
    ]


def test_sections_are_part_of_what_a_case_keeps(session):
    opened = saved(session, 1, 2)
    cut = changes.add_section(opened, Section("plane", origin=(0.5, 0.0, 0.0)))
    # Who only looks at a mesh is not asked.
    assert not Unsaved.of(cut, busy=False).lost
    assert not title_of(cut).startswith("*")
    both = changes.set_case(cut, steps=7)
    assert (
        Unsaved.of(both, busy=False)
        .question("closing")
        .startswith("Save roles, motions, method and sections as a case")
    )
    named = replace(cut, case=replace(cut.case, source=Path("a.cfg")))
    assert title_of(named).startswith("*")
    assert "the changes to a.cfg" in Unsaved.of(named, busy=False).question("closing")
    written = changes.saved_case(named, named.case)
    assert not Unsaved.of(written, busy=False).lost
    # How they are shown is not asked about; that they are gone is.
    hidden = changes.set_view(written, sections=(replace(written.view.section, shown=False),))
    assert not Unsaved.of(hidden, busy=False).lost
    assert Unsaved.of(changes.set_view(written, sections=()), busy=False).can_save == [
        "session",
        "case",
    ]
    # A case that is opened with sections has them.
    kept = view_to_case(written)
    again = open_mesh(session.first, None, (), kept)
    assert len(again.view.sections) == 1
    assert not Unsaved.of(again, busy=False).lost
