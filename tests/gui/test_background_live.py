"""The mesh follows the hand: typed, stepped with keys, dragged; then the run takes its place."""

import logging
from dataclasses import replace

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest

from slideviz.case.motions.rigid import Rotate
from slideviz.gui import background
from slideviz.session import changes

pytestmark = pytest.mark.usefixtures("unpainted")


@pytest.fixture
def live(driver, sample_folder, monkeypatch):
    """A driver of a window whose mesh follows the hand, with the passage and its fields."""
    driver.open(sample_folder / "passage" / "passage.cfg")
    window = driver.window
    window.store.change(changes.set_case, motions=())
    driver.add_motion(Rotate)
    window.toggle_live()
    driver.qtbot.waitUntil(lambda: window.live.fields is not None)
    yield driver
    window.live.switch(False)
    driver.qtbot.waitUntil(lambda: not window.live.busy)


def turn(driver, text):
    driver.type(driver.window.motions.editor.angle, text)


def settled(driver):
    driver.qtbot.waitUntil(lambda: bool(driver.session.runs) and bool(driver.session.runs[-1].end))
    driver.settle()


def test_a_typed_number_moves_the_mesh_and_its_run_follows(live):
    window = live.window
    turn(live, "3")
    live.qtbot.waitUntil(lambda: live.session.preview is not None)
    live.qtbot.waitUntil(lambda: live.session.preview.case is live.session.case)
    points = live.session.preview.frame.mesh.points
    for name, boundary in window.scene.drawn.items():
        at = np.asarray(boundary.shape.points)[:, : points.shape[1]]
        assert np.allclose(at, points[boundary.surface.nodes]), name
    assert not any(
        actor.visibility
        for name, actor in window.scene.plotter.actors.items()
        if name.startswith("motion:")
    )
    assert "preview" in window.scene.plotter.actors
    assert window.player.step_text.text() == "Preview"
    assert window.run_panel.text.text().startswith("Preview: the motion")
    assert 0 < window.run_panel.bar.value() < 1000
    settled(live)
    [run] = live.session.runs
    assert run.live
    assert live.session.frame is run.last
    assert "preview" not in window.scene.plotter.actors
    assert window.player.step_text.text().startswith("Step")
    assert "the preview" in window.statusBar().currentMessage()
    assert "was off by" in window.statusBar().currentMessage()
    assert not np.array_equal(run.last.mesh.points, live.session.mesh.points)


def test_arrow_keys_step_and_one_run_is_left(live):
    field = live.window.motions.editor.angle
    turn(live, "2")
    settled(live)
    field.setFocus()
    for _ in range(3):
        QTest.keyClick(field, Qt.Key.Key_Up)
    assert live.session.case.motions[0].angle_deg == 2.3
    QTest.keyClick(field, Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert live.session.case.motions[0].angle_deg == 2.29
    live.qtbot.waitUntil(lambda: live.session.preview is not None)
    live.qtbot.waitUntil(lambda: live.session.runs[-1].number > 1)
    settled(live)
    assert [run.number for run in live.session.runs] == [live.session.shown]
    assert live.session.runs[-1].case.motions[0].angle_deg == 2.29


def test_a_run_is_cancelled_when_the_hand_moves_on(live, monkeypatch):
    window = live.window
    turn(live, "3")
    live.qtbot.waitUntil(lambda: window.runner.busy)
    turn(live, "4")
    live.qtbot.waitUntil(
        lambda: (
            bool(live.session.runs)
            and bool(live.session.runs[-1].end)
            and live.session.runs[-1].case.motions[0].angle_deg == 4.0
        )
    )
    assert len(live.session.runs) == 1


def test_a_motion_that_a_pull_adds_is_followed_too(live):
    window = live.window
    motions = live.session.case.motions
    window.store.set_dragging(True)
    window.store.change(changes.set_case, motions=(*motions, replace(motions[0], angle_deg=3.0)))
    window.store.set_dragging(False)
    live.qtbot.waitUntil(lambda: live.session.preview is not None)
    settled(live)
    assert live.session.runs[-1].live
    assert live.session.runs[-1].case.motions == live.session.case.motions


def test_a_motion_of_the_menu_runs_nothing(live):
    fields = live.window.live.fields
    live.add_motion(Rotate)
    live.qtbot.waitUntil(lambda: live.window.live.fields not in (fields, None))
    QTest.qWait(700)
    assert not live.session.runs
    assert live.session.preview is None


def test_while_the_mouse_drags_nothing_runs(live):
    window = live.window
    window.store.set_dragging(True)
    turn(live, "3")
    live.qtbot.waitUntil(lambda: live.session.preview is not None)
    live.qtbot.waitUntil(
        lambda: not window.live._hand.isActive() or window.live._hand.remainingTime() > 400
    )
    QTest.qWait(700)
    assert not live.session.runs
    window.store.set_dragging(False)
    settled(live)


def test_undo_to_the_case_of_the_run_shows_that_run(live):
    turn(live, "3")
    settled(live)
    window = live.window
    window.live._hand.setInterval(100_000)
    window.store.change(changes.set_case, motions=(live.session.case.motions[0].turned(0.5),))
    live.qtbot.waitUntil(lambda: live.session.preview is not None)
    window.store.undo()
    live.qtbot.waitUntil(lambda: not window.live._runner.busy)
    assert live.session.preview is None
    assert live.session.frame is live.session.runs[-1].last


def test_other_settings_have_other_fields(live):
    fields = live.window.live.fields
    live.window.store.change(changes.set_case, influence_factor=1.5)
    live.qtbot.waitUntil(lambda: live.window.live.fields is not fields)
    assert live.window.live.fields is not None


def test_fields_go_where_memory_is_short(live, monkeypatch):
    monkeypatch.setattr(background, "free_memory", lambda: 10.0)
    turn(live, "3")
    assert live.window.live.fields is None
    assert live.session.preview is None


def test_switched_off_nothing_follows(live):
    window = live.window
    act = window.actions_table.by_name["live"]
    assert act.isChecked()
    act.trigger()
    assert not act.isChecked()
    assert window.settings.value("live", type=bool) is False
    turn(live, "3")
    QTest.qWait(300)
    assert live.session.preview is None
    assert window.live.fields is None


@pytest.mark.parametrize("off", [True, False])
def test_fields_that_come_too_late_are_dropped(live, off):
    window = live.window
    window.live.switch(True)
    window.live._make_fields()
    assert window.live.busy
    if off:
        window.live.switch(False)
    else:
        window.store.change(lambda session: replace(session, mesh=replace(session.mesh)))
    live.qtbot.waitUntil(lambda: not window.live._runner.busy)
    assert window.live.fields is None


def test_another_mesh_drops_the_fields(live, sample_folder, answers):
    answers("ask_unsaved", "discard")
    live.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    assert live.window.live.fields is None or live.window.live.fields.mesh is live.session.mesh


def test_a_failed_preview_is_in_the_log(live, monkeypatch, caplog):
    def fail(*_):
        raise RuntimeError("no such field")

    monkeypatch.setattr(background.jobs, "make_preview", fail)
    with caplog.at_level(logging.ERROR, "slideviz"):
        turn(live, "3")
        live.qtbot.waitUntil(lambda: live.window.live.fields is None)
    assert "the preview failed: no such field" in caplog.text
