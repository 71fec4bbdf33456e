"""The session is kept while the program runs, and offered again after a bad end."""

import os
import subprocess
import sys

import pytest
from qtpy.QtWidgets import QMessageBox, QWidget

from slideviz.case.model import Case
from slideviz.design.sweeps.table import DesignRow
from slideviz.gui import autosave
from slideviz.gui.autosave import Autosave, find_sessions
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.widgets import error_reporter, questions
from slideviz.gui.window import MainWindow
from slideviz.session import changes, jobs
from slideviz.session.design_table import DesignTable
from slideviz.session.session_file import read_case_of
from slideviz.session.store import Store

pytestmark = pytest.mark.usefixtures("unpainted")
LEFT = "session-4194399-"  # of a process that is not there


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data of slideviz" / "sessions"


@pytest.fixture
def make(qtbot, settings, monkeypatch, folder):
    def made():
        window = MainWindow(settings, multi_samples=0, kept=folder)

        def close(window):
            monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
            window.close()

        qtbot.addWidget(window, before_close_func=close)
        with qtbot.waitExposed(window):
            window.show()
        return window

    return made


@pytest.fixture
def case_file(sample_folder):
    return next((sample_folder / "hexahedron").glob("*.cfg"))


def open_in(window, path, qtbot):
    window.files.open_path(path)
    qtbot.waitUntil(lambda: window.store.session.mesh is not None and not window.runner.busy)


def kept(window, qtbot):
    """Wait until the session is written as it is, and return what is in the file."""
    keeper = window.autosave
    keeper.begin()
    qtbot.waitUntil(lambda: not keeper._runner.busy and keeper.path.exists())
    return case_in(keeper.path)


def case_in(path):
    """The case in the file of a session."""
    return read_case_of(path, path.parent)[0]


@pytest.fixture
def crashed(qtbot, folder, case_file):
    """The file of a session that did not end properly: with other settings, and a view."""
    session = jobs.open_file(case_file, None, jobs.Job()).session
    store = Store()
    keeper = Autosave(store, folder, lambda: None, lambda: (DesignTable(), None))
    store.put(changes.set_view(changes.set_case(session, steps=7), color_by="skew"))
    keeper.begin()
    qtbot.waitUntil(lambda: not keeper._runner.busy and keeper.path.exists())
    content = keeper.path.read_bytes()
    keeper.close()
    left = folder / f"{LEFT}1.slideviz"
    left.write_bytes(content)
    return left


@pytest.fixture(autouse=True)
def nothing_asked(monkeypatch):
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")


def test_nobody_else_may_read_what_is_kept_its_files_are_found_and_a_proper_end_leaves_nothing(
    make, qtbot, folder, case_file, tmp_path
):
    window = make()
    open_in(window, case_file, qtbot)
    kept(window, qtbot)
    assert folder.stat().st_mode & 0o777 == 0o700
    modes = {path.name: path.stat().st_mode & 0o777 for path in folder.iterdir()}
    assert len(modes) == 2
    assert set(modes.values()) == {0o600}
    crashes = tmp_path / "crashes"
    with error_reporter.crash_log(crashes):
        (log,) = crashes.iterdir()
        assert log.stat().st_mode & 0o777 == 0o600
    assert crashes.stat().st_mode & 0o777 == 0o700
    case = kept(window, qtbot)
    original = Case.read(case_file)
    assert case.mesh_file.samefile(original.mesh_file)
    assert case.motions[0].path.samefile(original.motions[0].path)
    assert case.roles == original.roles
    window.close()
    assert list(folder.iterdir()) == []


def test_a_change_is_written_some_seconds_later(make, qtbot, case_file, monkeypatch):
    monkeypatch.setattr(autosave.Autosave, "wait_ms", 20)
    window = make()
    open_in(window, case_file, qtbot)
    qtbot.waitUntil(window.autosave.path.exists)
    window.store.change(changes.set_case, steps=9)
    qtbot.waitUntil(lambda: case_in(window.autosave.path).steps == 9)
    window.store.change(changes.set_view, edges=False)
    qtbot.waitUntil(lambda: "VIEW_SHOW" in case_in(window.autosave.path).view)


def test_nothing_is_written_before_a_mesh_is_open(make, folder):
    window = make()
    window.autosave.begin()
    assert not window.autosave._runner.busy
    assert not folder.exists()


def test_the_session_of_a_window_that_is_open_is_not_offered(make, qtbot, case_file, folder):
    first = make()
    open_in(first, case_file, qtbot)
    kept(first, qtbot)
    assert find_sessions(folder) == ([], [])
    other = make()
    other.recovery.start()
    assert not other.recovery_banner.isVisible()
    assert other.autosave.path != first.autosave.path


def test_after_a_crash_it_is_offered_and_restored(make, qtbot, crashed, case_file, folder):
    window = make()
    window.recovery.start()
    assert window.recovery_banner.isVisible()
    text = window.recovery_banner.text.text()
    assert "did not end properly" in text
    assert f"with {case_file.name} in {case_file.parent}?" in text, (
        "it is known by the case that was open"
    )
    window.recovery_banner.answers["Restore"].click()
    qtbot.waitUntil(lambda: window.store.session.mesh is not None and not window.runner.busy)
    session = window.store.session
    assert session.case.steps == 7
    assert session.view.color_by == "skew"
    assert session.case.source == case_file
    assert session.unsaved_case
    assert not window.recovery_banner.isVisible()
    qtbot.waitUntil(lambda: not crashed.exists())
    assert case_in(window.autosave.path).steps == 7, "it is safe under its new name"
    assert find_sessions(folder) == ([], [])


@pytest.mark.parametrize("changed", [False, True], ids=["as they ran", "changed since"])
def test_the_designs_and_their_results_come_back(make, qtbot, folder, case_file, changed):
    window = make()
    open_in(window, case_file, qtbot)
    panel = window.dock_manager.panel(DesignsPanel)
    panel.put(DesignTable().crossed("STEPS", ["1", "2", "3"]))
    panel.case = window.store.session.case
    results = [
        DesignRow(1, min=0.25, mean=0.5, max_error=0.0, steps=1),
        DesignRow(3, problem="too\nfar"),
    ]
    panel.put(panel.table.with_results(results))
    if changed:
        window.store.change(changes.set_case, sliding="ds")
    kept(window, qtbot)
    content = window.autosave.path.read_bytes()
    modes = {path.stat().st_mode & 0o777 for path in folder.iterdir()}
    assert modes == {0o600}
    window.close()
    assert list(folder.iterdir()) == []
    folder.joinpath(f"{LEFT}1.slideviz").write_bytes(content)
    window = make()
    window.recovery.start()
    window.recovery_banner.answers["Restore"].click()
    panel = window.dock_manager.panel(DesignsPanel)
    qtbot.waitUntil(lambda: bool(panel.table.rows))
    assert panel.table.designs() == [{"STEPS": "1"}, {"STEPS": "2"}, {"STEPS": "3"}]
    assert repr(panel.table.results[1]) == repr(results[0])
    assert panel.table.results[3].problem == "too\nfar"
    assert panel.run.text() == ("Run 3 designs" if changed else "Run 2 designs")
    assert panel.unsaved
    qtbot.waitUntil(lambda: not any(folder.glob(f"{LEFT}*")))


def test_discard_throws_it_away(make, crashed, folder):
    window = make()
    window.recovery.start()
    window.recovery_banner.answers["Discard"].click()
    assert not window.recovery_banner.isVisible()
    assert list(folder.iterdir()) == []


def test_a_closed_offer_comes_again_at_the_next_start_only(make, crashed, qtbot):
    window = make()
    window.recovery.start()
    window.recovery_banner._closed()
    assert not window.recovery_banner.isVisible()
    assert crashed.exists()
    second = make()
    second.recovery.start()
    assert not second.recovery_banner.isVisible(), "the first window holds it"
    window.close()
    window.recovery._later.clear()
    second.recovery.start()
    assert second.recovery_banner.isVisible()


def test_several_are_offered_one_after_the_other_newest_first(make, crashed):
    older = crashed.with_name("session-4194398-1.slideviz")
    older.write_bytes(crashed.read_bytes())
    os.utime(older, (1e9, 1e9))
    window = make()
    window.recovery.start()
    assert [found.path for found in window.recovery.waiting] == [crashed, older]
    assert "1 more" in window.recovery_banner.text.text()
    window.recovery_banner.answers["Discard"].click()
    assert older.exists()
    assert "2001" in window.recovery_banner.text.text()
    window.recovery_banner.answers["Discard"].click()
    assert not older.exists()


def test_a_session_whose_mesh_is_gone_is_told_and_kept(
    make, crashed, qtbot, case_file, monkeypatch
):
    mesh = Case.read(case_file).mesh_file
    away = mesh.rename(mesh.with_name("away.su2"))
    try:
        window = make()
        window.recovery.start()
        window.recovery_banner.answers["Restore"].click()
        qtbot.waitUntil(lambda: window.banner.isVisible())
        assert "is neither beside it nor in" in window.banner.text.text()
        assert crashed.exists()
        # Where the user says where it is, the session is restored.
        monkeypatch.setattr(questions, "ask_open", lambda *_: away)
        window.banner.answers["Find the mesh…"].click()
        qtbot.waitUntil(lambda: window.store.session.mesh is not None and not window.runner.busy)
        assert window.store.session.path == away
        assert window.store.session.case.source == case_file
        qtbot.waitUntil(lambda: not crashed.exists())
    finally:
        away.rename(mesh)


BROKEN = ["", "PK", "PK\5\6" + 18 * "\0", "STEPS= 3\n"]


@pytest.mark.parametrize("text", BROKEN)
def test_a_session_that_cannot_be_read_is_kept(folder, text):
    folder.mkdir(parents=True)
    bad = folder / f"{LEFT}1.slideviz"
    bad.write_text(text)
    (folder / f"{LEFT}1.slideviz.broken").write_text("an earlier one")
    found, (problem,) = find_sessions(folder)
    assert found == []
    assert "cannot be read" in problem
    assert not bad.exists()
    assert (folder / f"{LEFT}1.slideviz.2.broken").read_text() == text
    assert (folder / f"{LEFT}1.slideviz.broken").read_text() == "an earlier one"


def test_the_name_of_the_case_need_not_be_utf_8(make, qtbot, folder, case_file):
    path = case_file.with_name("c\udce9.cfg")
    path.write_bytes(case_file.read_bytes())
    window = make()
    open_in(window, path, qtbot)
    window.autosave.begin()
    qtbot.waitUntil(window.autosave.path.exists)
    qtbot.waitUntil(lambda: not window.autosave._runner.busy)
    left = folder / f"{LEFT}1.slideviz"
    left.write_bytes(window.autosave.path.read_bytes())
    path.unlink()
    (found,) = (one for one in find_sessions(folder)[0] if one.path == left)
    assert found.content.source == path


def test_sessions_that_cannot_be_read_are_told_once(make, folder):
    folder.mkdir(parents=True)
    window = make()
    for text in BROKEN:
        (folder / f"{LEFT}1.slideviz").write_text(text)
        window.recovery.start()
        assert "cannot be read" in window.banner.text.text()
        assert not window.recovery_banner.isVisible()
        window.banner.hide()
        window.recovery.start()
        assert not window.banner.isVisible()


def test_a_half_written_file_is_told_and_kept_unless_it_is_being_written(make, folder):
    folder.mkdir(parents=True)
    old, new = folder / ".slideviz-01.tmp", folder / ".slideviz-02.tmp"
    for path in (old, new):
        path.write_text("MESH_FILEN")
    os.utime(old, (1e9, 1e9))
    _, problems = find_sessions(folder)
    assert len(problems) == 1
    assert "being written" in problems[0]
    assert (folder / "slideviz-01.tmp.broken").read_text() == "MESH_FILEN"
    assert new.exists()


def test_a_folder_that_cannot_be_written_is_logged_and_the_window_goes_on(
    make, qtbot, case_file, folder, caplog
):
    folder.parent.mkdir()
    folder.write_text("no folder")
    window = make()
    open_in(window, case_file, qtbot)
    window.autosave.begin()
    qtbot.waitUntil(lambda: "could not be saved" in caplog.text)
    assert window.error_reporter.count == 0


KILLED = """
import os, sys, time
from pathlib import Path
from qtpy.QtCore import QSettings
from qtpy.QtWidgets import QApplication
from slideviz.gui.window import MainWindow
from slideviz.session import changes

import slideviz.solver.deform  # as `launch` does, before any thread

app = QApplication([])
folder = Path(sys.argv[1])
settings = QSettings(str(folder.parent / "s.ini"), QSettings.Format.IniFormat)
window = MainWindow(settings, 0, kept=folder)
window.show()
window.files.open_path(Path(sys.argv[2]))
while window.store.session.mesh is None:
    app.processEvents()
    time.sleep(0.002)
window.store.change(changes.set_case, steps=11)
window.autosave.begin()
while not window.autosave.path.exists():
    app.processEvents()
    time.sleep(0.002)
os.kill(os.getpid(), 9)
"""


@pytest.mark.slow
def test_a_program_that_was_killed_leaves_its_session(tmp_path, folder, case_file):
    folder.mkdir(parents=True)
    call = [sys.executable, "-c", KILLED, str(folder), str(case_file)]
    subprocess.run(call, timeout=120, check=False)
    found, problems = find_sessions(folder)
    assert problems == []
    assert case_in(found[0].path).steps == 11
    assert found[0].content.source == case_file
    assert found[0].content.mesh_file.is_file()


# Unsaved changes --------------------------------------------------------------------------


def run_in(window, qtbot):
    window.start_run()
    qtbot.waitUntil(lambda: not window.runner.busy)
    assert window.store.session.unsaved_mesh


def test_all_is_saved_with_one_answer_before_the_window_closes_and_comes_back(
    make, qtbot, case_file, monkeypatch, tmp_path
):
    window = make()
    open_in(window, case_file, qtbot)
    window.store.change(changes.set_case, steps=2)
    run_in(window, qtbot)
    asked = []
    file = tmp_path / "out.slideviz"

    def ask(_parent, what, can_save, _now):
        asked.append((what, tuple(can_save)))
        return "session"

    monkeypatch.setattr(questions, "ask_unsaved", ask)
    monkeypatch.setattr(questions, "ask_session", lambda *_: (file, False))
    window.store.change(changes.show_frame, 1)
    assert not window.close(), "first the session is written"
    qtbot.waitUntil(lambda: not window.isVisible())
    assert [can for _, can in asked] == [("session", "case", "mesh")]
    assert "the deformed mesh of run 1" in asked[0][0]
    left = window.store.session
    window = make()
    open_in(window, file, qtbot)
    session = window.store.session
    assert session.view.frame == 1
    assert window.windowTitle() == "out.slideviz – slideviz"
    for one, other in zip(session.frames, left.frames, strict=True):
        assert (one.mesh.points == other.mesh.points).all()
    assert window.close(), "nothing is unsaved"


@pytest.mark.parametrize("answer", ["case", "mesh"])
def test_nobody_is_asked_twice(make, qtbot, case_file, monkeypatch, tmp_path, answer):
    window = make()
    open_in(window, case_file, qtbot)
    window.store.change(changes.set_case, steps=2)
    run_in(window, qtbot)
    answers = iter([answer])
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: next(answers))
    file = tmp_path / {"case": "out.cfg", "mesh": "out.su2"}[answer]
    monkeypatch.setattr(questions, "ask_save", lambda *_: file)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible())
    assert file.is_file()


@pytest.mark.parametrize(
    ("can_save", "words"),
    [
        (
            ("session", "case", "mesh"),
            ["Save &session…", "Save &case…", "Save &mesh…", "&Don’t save", "C&ancel"],
        ),
        (("session", "table"), ["Save &session…", "Save &table…", "&Don’t save", "C&ancel"]),
        (("table",), ["Save &table…", "&Don’t save", "C&ancel"]),
        (("session",), ["Save &session…", "&Don’t save", "C&ancel"]),
    ],
)
def test_the_question_offers_what_can_be_saved(qtbot, monkeypatch, can_save, words):
    window = QWidget()
    qtbot.addWidget(window)
    monkeypatch.undo()
    seen = []

    def look(box):
        seen.append([button.text() for button in box.buttons()])
        assert (box.text(), box.informativeText()) == ("Save it?", "It is worth it.")
        next(b for b in box.buttons() if b.text() == words[0]).click()

    monkeypatch.setattr(QMessageBox, "exec", look)
    answer = questions.ask_unsaved(window, "Save it?\nIt is worth it.", can_save)
    assert sorted(seen[0]) == sorted(words)
    assert answer == can_save[0]


def test_the_question_about_a_run_is_asked_again_when_it_has_ended(make, qtbot, monkeypatch):
    window = make()
    monkeypatch.undo()
    said = iter(["Stop it and keep its 2 finished steps?"] * 2 + [""] * 100)
    seen = []

    def look(box):
        seen.append([button.text() for button in box.buttons()])
        qtbot.waitUntil(lambda: box.text().startswith("Stop it and keep its 2"))
        qtbot.waitUntil(lambda: not box.text())

    monkeypatch.setattr(QMessageBox, "exec", look)
    words = "Stop it and keep its finished step?"
    assert questions.ask_unsaved(window, words, ["run"], lambda: next(said)) == "again"
    assert sorted(seen[0]) == sorted(["&Stop it", "&Don’t save", "Let it &run"])


def test_the_question_tells_how_far_a_sweep_is_meanwhile(make, qtbot, monkeypatch):
    window = make()
    monkeypatch.undo()
    counts = iter(range(1, 100))

    def look(box):
        qtbot.waitUntil(lambda: box.informativeText() == "2 are done.")
        box.buttons()[0].click()

    monkeypatch.setattr(QMessageBox, "exec", look)
    words = "Save it?\n0 are done."
    questions.ask_unsaved(window, words, ["table"], lambda: f"Save it?\n{next(counts)} are done.")
    # Nothing of it is left that goes on counting.
    qtbot.waitUntil(lambda: not window.findChildren(QMessageBox))
