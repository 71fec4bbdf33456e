"""The histogram of a session: which runs it compares, and what it says of the others."""

from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.color_scheme import LIGHT
from slideviz.mesh.quality import quality
from slideviz.plots.session_plots import MOST_COMPARED, compared, draw_histogram
from slideviz.plots.style import Style
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import Run, StepFrame


@pytest.fixture(scope="module")
def many(square):
    """Seven runs of two motions by turns, the last of which is shown."""
    session = open_mesh(StepFrame(square, quality(square)), None)
    roles = {"bottom": "moving"}
    motions = (Rotate("bottom", 1.0), Translate("bottom", (0.1, 0.0)))
    runs = tuple(
        Run(
            number,
            Case(roles=roles, motions=(motions[number % 2],)),
            (StepFrame(square, quality(square)),),
            "done",
        )
        for number in range(1, 8)
    )
    return changes.show_run(replace(session, runs=runs), 7)


def numbers(session):
    runs, left_out = compared(session)
    return [run.number for run in runs], left_out


def test_runs_of_the_same_motion_and_newer_ones_are_compared_first(many):
    assert numbers(many) == ([1, 3, 5, 6], 2)
    assert numbers(changes.show_run(many, 2)) == ([4, 5, 6, 7], 2)
    assert len(numbers(many)[0]) == MOST_COMPARED


def test_the_run_beside_is_always_compared(many):
    assert numbers(changes.show_beside(many, 2)) == ([1, 2, 3, 5], 2)


def test_few_runs_are_all_compared_and_unfinished_ones_not(many):
    few = replace(many, runs=many.runs[3:])
    assert numbers(few) == ([4, 5, 6], 0)
    bare = replace(few, runs=(*few.runs, Run(8, Case())))
    assert numbers(bare) == ([4, 5, 6], 0)


def legend(session, **view):
    figure = Figure()
    session = changes.set_view(session, **view)
    draw_histogram(session, figure, Style(LIGHT), log=True, full_range=False)
    return figure.axes[0].get_legend()


def test_the_legend_says_how_many_runs_are_left_out(many):
    words = [text.get_text() for text in legend(many).get_texts()]
    assert words == ["run 7", "run 1", "run 3", "run 5", "run 6", "undeformed"]
    assert legend(many).get_title().get_text() == "without 2 other runs"
    assert legend(replace(many, runs=many.runs[1:])).get_title().get_text() == "without 1 other run"
    assert not legend(replace(many, runs=many.runs[3:])).get_title().get_text()


def test_runs_are_called_by_their_names_and_nothing_is_compared_with_where_nothing_moved(many):
    named = changes.rename_run(changes.rename_run(many, 7, "stiff"), 3, "soft")
    words = [text.get_text() for text in legend(named, color_by="displacement").get_texts()]
    assert words == ["run 7: stiff", "run 1", "run 3: soft", "run 5", "run 6"]
    words = [text.get_text() for text in legend(named, frame=0).get_texts()]
    assert words == ["undeformed", "run 1", "run 3: soft", "run 5", "run 6"]
