"""The limits of the case are checked in the background, on the step that is shown."""

from dataclasses import replace

import pytest

from slideviz.case.limits import outcome
from slideviz.color_scheme import SELECTED_COLOR
from slideviz.session import changes
from slideviz.session.runs_words import COLUMNS

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


def test_limits_are_checked_on_what_is_shown_and_rings_are_at_cells_that_fail(with_runs):
    shown = with_runs({"steps": 2})
    store, scene = shown.window.store, shown.window.scene

    def results():
        shown.qtbot.waitUntil(lambda: store.session.limit_results is not None)
        return store.session.limit_results

    assert results() == ()
    values = store.session.frame.quality.values
    bound = float(sorted(values)[5])
    store.change(changes.set_case, limits=f"min >= {bound!r}, inverted = 0, growth < 1.01")
    low, folded, growth = results()
    assert (low.passed, folded.passed, growth.passed) == (False, True, False)
    assert low.actual == values.min()
    assert len(low.cells) == 5
    assert "points:inverted" not in scene.plotter.actors
    store.change(replace, limit=0)
    assert scene.plotter.actors["points:inverted"].mapper.dataset.n_points == 5
    assert scene.stage.ring_words == (("5 fail", SELECTED_COLOR),)
    store.change(changes.show_frame, 0)
    assert "points:inverted" not in scene.plotter.actors
    (first, _, _) = results()
    assert first.actual == store.session.frame.quality.min
    assert first.passed
    store.change(changes.show_frame, 2)
    assert results()[0].actual == low.actual
    assert not store.session.outdated, "limits change no mesh"


def test_the_end_of_a_run_says_which_limits_are_missed(with_runs):
    shown = with_runs({"steps": 1, "limits": "min >= 0.999, inverted = 0"})
    window, run = shown.window, shown.window.store.session.runs[-1]
    low, folded = run.last.limits
    assert (low.passed, folded.passed) == (False, True)
    assert low.actual == run.last.quality.min
    assert "1 limit is not met" in window.run_panel.text.text()
    column = next(one for one in COLUMNS if one.title == "limits")
    assert column.value(run) == outcome(run.last.limits) == f"min >= 0.999: {low.actual:.6g}"
    window.running._run_done(None)
    assert shown.told == f"1 limit is not met: {column.value(run)}."
    assert window.run_panel.strip.count.text() == "1 error ▴"
    shown.answer("Show the limits")
    assert window.dock_manager.by_name["limits"].isVisible()
