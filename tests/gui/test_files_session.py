"""Sessions in the window: saved, opened where they were left, and what is asked before."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from qtpy.QtWidgets import QFileDialog

from slideviz.design.sweeps.table import DesignRow
from slideviz.export.picture_options import PictureOptions
from slideviz.formats.files import write
from slideviz.gui.files import sample_folder
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.widgets import questions
from slideviz.session import changes
from slideviz.session.design_table import DesignTable
from tests.builders import square

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


def save_session(driver, answers, path, with_mesh=False):
    asked = answers("ask_session", (path, with_mesh))
    driver.window.actions_table.by_name["save_session"].trigger()
    driver.settle()
    return asked


@pytest.fixture
def left(with_runs):
    """A window as somebody leaves it: three runs, designs, a camera, two views."""
    driver = with_runs({"steps": 2}, {"sliding": "ds"}, {"steps": 1})
    store = driver.window.store
    store.change(changes.rename_run, 2, "direct")
    store.change(changes.show_run, 1)
    store.change(changes.show_frame, 1)
    store.change(changes.show_beside, 2)
    panel = driver.window.dock_manager.panel(DesignsPanel)
    panel.case = driver.session.case
    panel.mesh = driver.session.mesh
    panel.put(DesignTable(("STEPS",), (("2",), ("3",))).with_results([DesignRow(1, min=0.5)]))
    driver.window.scene.camera.zoom_at(0.5, 0.5, 2.0)
    return driver


def test_a_window_opens_where_it_was_left(left, answers, tmp_path):
    window = left.window
    before = left.session
    camera = window.scene.camera.view
    path = tmp_path / "work.slideviz"
    asked = save_session(left, answers, path)
    assert asked[0][0].name == "passage.slideviz"
    assert window.statusBar().currentMessage() == f"Saved {path}"
    assert window.windowTitle() == "work.slideviz – slideviz"
    assert window.files.recent()[0] == path
    assert not window.dock_manager.panel(DesignsPanel).unsaved
    # Nothing is unsaved, so nothing is asked.
    session = left.open(path)
    assert session is not before
    assert session.view == before.view
    assert session.shown == 1
    assert [(run.number, run.name) for run in session.runs] == [(1, ""), (2, "direct"), (3, "")]
    for now, then in zip(session.runs, before.runs, strict=True):
        for one, other in zip(now.frames, then.frames, strict=True):
            assert np.array_equal(one.mesh.points, other.mesh.points)
            assert np.array_equal(one.quality.values, other.quality.values)
    # Of a flat mesh the distance of the camera has no effect.
    seen = [0, 1, 3, 4, 5, 6, 7, 8, 9]
    assert np.allclose(np.array(window.scene.camera.view)[seen], np.array(camera)[seen])
    panel = window.dock_manager.panel(DesignsPanel)
    assert panel.table.designs() == [{"STEPS": "2"}, {"STEPS": "3"}]
    assert panel.run.text() == "Run 1 design"
    # The next run has a number of its own.
    window.store.change(changes.start_run)
    assert left.session.shown == 4
    window.store.change(changes.end_run, "cancelled")


def test_opening_another_file_asks_for_every_unsaved_run(left, answers, tmp_path):
    window = left.window
    window.store.change(changes.saved_mesh)
    case = left.session.case
    window.store.change(changes.saved_case, case)
    asked = answers("ask_unsaved", "cancel")
    window.dock_manager.panel(DesignsPanel).put(DesignTable())
    window.files.open_path(case.mesh_file)
    assert asked[0][:2] == (
        "\n".join(
            (
                "Save the session before opening another mesh?",
                "The meshes of runs 2, 3 are not saved either.",
            )
        ),
        ["session"],
    )
    path = tmp_path / "work.slideviz"
    answers("ask_unsaved", "session")
    answers("ask_session", (path, False))
    window.files.open_path(case.mesh_file)
    left.qtbot.waitUntil(lambda: left.session.case.source is None and not window.runner.busy)
    assert left.session.runs == ()
    assert len(left.open(path).runs) == 3


def test_without_its_mesh_a_button_asks_for_it(left, answers, tmp_path):
    window = left.window
    folder = tmp_path / "there"
    folder.mkdir()
    mesh = Path(shutil.copy(left.session.path, folder / "mesh.su2"))
    window.store.change(changes.moved_files, {left.session.path: mesh})
    path = tmp_path / "work.slideviz"
    save_session(left, answers, path)
    away = mesh.rename(folder / "renamed.su2")
    left.open(path)
    text = window.banner.text.text()
    assert "work.slideviz: its mesh mesh.su2 is neither beside it nor in" in text
    answers("ask_open", None)
    window.banner.answers["Find the mesh…"].click()
    assert not window.runner.busy
    answers("ask_open", away)
    window.banner.answers["Find the mesh…"].click()
    left.qtbot.waitUntil(lambda: left.session.path == away and not window.runner.busy)
    assert len(left.session.runs) == 3
    assert left.session.case.mesh_file == away
    window.store.change(changes.show_run, 3)
    assert not left.session.outdated


def test_a_session_with_its_mesh_needs_no_other_file(left, answers, tmp_path):
    path = tmp_path / "alone.slideviz"
    before = left.session
    save_session(left, answers, path, with_mesh=True)
    assert path.stat().st_size > before.path.stat().st_size
    session = left.open(path)
    assert sample_folder() in session.path.parents
    assert np.array_equal(session.mesh.points, before.mesh.points)
    # What is saved of it is not in a cache.
    asked = answers("ask_save", None)
    left.window.files.save_case()
    assert asked[0][1] == tmp_path / "alone.cfg"


def test_a_name_with_dots_is_offered_whole(driver, answers, tmp_path):
    write(tmp_path / "wing.v2.su2", square())
    driver.open(tmp_path / "wing.v2.su2")
    asked = answers("ask_save", None)
    driver.window.files.save_case()
    assert asked[0][1] == tmp_path / "wing.v2.cfg"


def test_a_damaged_file_is_told_and_the_window_stays_as_it_is(left, answers, tmp_path):
    path = tmp_path / "work.slideviz"
    save_session(left, answers, path)
    path.write_bytes(path.read_bytes()[:-100])
    before = left.session
    left.open(path)
    assert "is damaged, or not a session file" in left.window.banner.text.text()
    assert left.session is before


@pytest.mark.parametrize("chosen", [0, 1])
def test_the_dialog_offers_a_copy_of_the_mesh(window, monkeypatch, tmp_path, chosen):
    monkeypatch.undo()

    def choose(_parent, _title, default, filters, options):
        return default, filters.split(";;")[chosen]

    monkeypatch.setattr(QFileDialog, "getSaveFileName", choose)
    path = tmp_path / "a.slideviz"
    assert questions.ask_session(window, path) == (path, bool(chosen))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, options: ("", ""))
    assert questions.ask_session(window, path) == (None, False)


@pytest.mark.usefixtures("painted")
def test_a_picture_of_the_view_carries_its_case_and_opens_as_such(left, answers, tmp_path):
    window = left.window
    answers("ask_unsaved", "discard")
    window.store.change(changes.set_view, color_by="skew", edges=False)
    left.window.store.change(changes.show_beside, None)
    seen = [0, 1, 3, 4, 5, 6, 7, 8, 9]
    camera = np.array(window.scene.camera.view)[seen]
    run = left.session.run_shown
    path = tmp_path / "view.png"
    with window.exports._renderer() as renderer:
        window.exports._write_picture(renderer, PictureOptions((320, 200)), path)
        plain = tmp_path / "plain.png"
        window.exports._write_picture(renderer, PictureOptions((320, 200), case=False), plain)
    mesh = left.session.path
    left.open(path)
    assert left.session.path == mesh
    assert left.session.case.steps == run.case.steps, "that of the run that is shown"
    assert left.session.view.color_by == "skew"
    assert "edges" not in left.session.view.drawn
    assert np.allclose(np.array(window.scene.camera.view)[seen], camera)
    left.open(plain)
    assert "has no case in it" in window.banner.text.text()
