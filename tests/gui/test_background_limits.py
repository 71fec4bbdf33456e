"""The limits of the case are checked in the background, on the step that is shown."""

import pytest

from slideviz.color_scheme import SELECTED_COLOR
from slideviz.session import changes
from slideviz.session.limits import choose_limit

pytestmark = pytest.mark.usefixtures("unpainted")


def test_limits_are_checked_on_what_is_shown_and_rings_are_at_cells_that_fail(with_runs):
    shown = with_runs({"steps": 2})
    store, scene = shown.window.store, shown.window.scene

    def results():
        shown.qtbot.waitUntil(lambda: store.session.limit_results is not None, timeout=60_000)
        return store.session.limit_results

    assert results() == ()
    values = store.session.frame.quality.values
    bound = float(sorted(values)[5])
    store.change(changes.set_case, limits=f"min >= {bound!r}, inverted = 0, growth < 1")
    low, folded, growth = results()
    assert (low.passed, folded.passed, growth.passed) == (False, True, False)
    assert low.actual == values.min()
    assert len(low.cells) == 5
    assert "points:inverted" not in scene.plotter.actors
    store.change(choose_limit, 0)
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
