"""Room for the view, files that a case needs, and what the window tells of a mesh."""

import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest
from qtpy.QtCore import QSize, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QDialog, QLabel

from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Radial, Rotate
from slideviz.gui import files
from slideviz.gui.panels.worst import info_text
from slideviz.gui.start import StartPage
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import on_screen
from slideviz.gui.window import MainWindow
from slideviz.samples.table import SAMPLES
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

SIZES = """
import sys, tempfile
from qtpy.QtCore import QSettings
from qtpy.QtWidgets import QApplication
from slideviz.gui.window import MainWindow
app = QApplication([])
settings = QSettings(tempfile.mktemp(suffix=".ini"), QSettings.Format.IniFormat)
window = MainWindow(settings, multi_samples=0)
window.show()
app.processEvents()
print(*fits(window))
window.close()
"""


def fits(window):
    room = window.screen().availableGeometry()
    least = window.minimumSizeHint().expandedTo(window.minimumSize())
    seen = window.geometry().adjusted(0, 0, 0, 40)  # below the bar of its title
    return room.contains(seen), least.width() <= room.width(), window.run_panel.isVisible()


def test_the_window_fits_the_screen(window):
    assert fits(window) == (True, True, True)


@pytest.mark.slow
@pytest.mark.parametrize("scale", ["1.25", "1.6", "2.2"])
def test_the_window_fits_a_screen_that_is_small_beside_the_letters(scale):
    """It is 727 pixels wide at the last scale."""
    call = [sys.executable, "-c", inspect.getsource(fits) + SIZES]
    given = dict(os.environ) | {"QT_SCALE_FACTOR": scale}
    done = subprocess.run(call, env=given, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout.split() == ["True"] * 3, done.stderr


def test_a_dialog_that_is_larger_than_the_screen_scrolls(qtbot):
    dialog, room = QDialog(), QApplication.primaryScreen().availableSize()
    qtbot.addWidget(dialog)
    for high in (200, room.height() + 300):
        content = QLabel("options")
        content.setMinimumSize(300, high)
        area = on_screen(content, dialog)
        assert (area is content) == (high == 200)
        qtbot.addWidget(area)
    assert area.widget() is content
    assert area.minimumSizeHint().boundedTo(room) == area.minimumSizeHint()
    assert area.minimumHeight() < room.height() - 80, "buttons below it are seen"


def test_lists_shrink_before_their_panel_scrolls(window, driver, sample_folder):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window.store.change(changes.set_case, sliding="none", periodic="none")
    dock = window.docks["boundaries"]
    window.resizeDocks([dock], [230], Qt.Orientation.Vertical)
    QApplication.processEvents()
    assert dock.height() < 250
    assert dock.widget().verticalScrollBar().maximum() == 0


def test_a_key_hides_every_panel_and_shows_them_again(driver, passage_file):
    driver.open(passage_file)
    window = driver.window
    window.docks["method"].raise_()
    driver.qtbot.waitUntil(lambda: not window.docks["method"].visibleRegion().isEmpty())
    before = {name for name, dock in window.docks.items() if dock.isVisible()}
    room = window.view.width()
    QTest.keyClick(window, Qt.Key.Key_F9)
    driver.qtbot.waitUntil(lambda: window.view.width() > room + 500)
    assert not [name for name, dock in window.docks.items() if dock.isVisible()]
    QTest.keyClick(window, Qt.Key.Key_F9)
    driver.qtbot.waitUntil(lambda: window.docks["method"].isVisible())
    assert {name for name, dock in window.docks.items() if dock.isVisible()} == before
    driver.qtbot.waitUntil(lambda: not window.docks["method"].visibleRegion().isEmpty())


@pytest.mark.window("own")
def test_hidden_panels_are_there_in_the_next_window(driver, settings, qtbot):
    window = driver.window
    window.dock_manager.toggle_all()
    QTest.keyClick(window, Qt.Key.Key_F11)
    assert window.isFullScreen()
    window.close()
    other = MainWindow(settings, multi_samples=0)
    qtbot.addWidget(other)
    with qtbot.waitExposed(other):
        other.show()
    assert not other.isFullScreen()
    assert other.docks["boundaries"].isVisible()
    other.close()


def test_cards_take_the_columns_that_there_is_room_for(qtbot):
    page = StartPage(dict.fromkeys(SAMPLES, "2D: a case"))
    qtbot.addWidget(page)
    for width, columns in ((900, 4), (420, 2)):
        page.resize(QSize(width, 700))
        with qtbot.waitExposed(page):
            page.show()
        qtbot.waitUntil(
            lambda columns=columns: (
                len({card.x() for card in page.sample_buttons.values()}) == columns
            )
        )


# What is told of a mesh -------------------------------------------------------------------


def test_the_size_of_the_mesh_is_told(driver, sample_folder):
    driver.open(sample_folder / "hexahedron" / "mesh.su2")
    label = driver.window.mesh_text
    assert label.text().endswith("342 points   1 × 1 × 1 ")
    assert "z from 0 to 1: 1" in label.toolTip()


def test_a_cell_tells_x_and_y_beside_r_and_theta(driver, tmp_path):
    from slideviz.samples.table import write_sample

    case = next(p for p in write_sample("polar", tmp_path / "polar", 6) if p.suffix == ".cfg")
    driver.open(case)
    text = info_text(driver.session, 3)
    assert "r 0." in text
    assert "x 0." in text


def test_what_turns_is_about_the_axis_for_each_new_motion(driver, tmp_path):
    from slideviz.samples.table import write_sample

    case = next(p for p in write_sample("polar", tmp_path / "polar", 6) if p.suffix == ".cfg")
    driver.open(case)
    editor = driver.window.motions.editor
    for kind in (Rotate, Radial, Rotate):
        driver.add_motion(kind)
        assert editor.about.currentData() == "axis"
        driver.choose(editor.about, "point")
        assert editor.about.currentData() == "point"


def test_a_blade_is_restaggered_about_its_radius(driver, tmp_path):
    from slideviz.samples.table import write_sample

    made = write_sample("cylindrical", tmp_path / "cylindrical", 5)
    driver.open(next(path for path in made if path.suffix == ".cfg"))
    driver.window.store.change(changes.set_case, motions=())
    driver.add_motion(Rotate)
    editor = driver.window.motions.editor
    driver.choose(editor.about, "radial")
    (motion,) = driver.session.case.motions
    mesh = driver.session.mesh
    x, y, _ = mesh.points[mesh.marker("BLOCK").nodes].mean(axis=0)
    assert motion.point == "centroid"
    assert motion.axis == pytest.approx((x / (x * x + y * y) ** 0.5, y / (x * x + y * y) ** 0.5, 0))
    assert editor.about.currentText() == "radial through its centroid"
    assert not editor.axis.isVisible()
    driver.choose(editor.about, "centroid")
    assert driver.session.case.motions[0].axis == (0.0, 0.0, 1.0)


# Files ------------------------------------------------------------------------------------


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "sample_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def test_a_case_of_a_sample_takes_its_files_along(driver, cache, answers, tmp_path):
    driver.window.files.open_sample("hexahedron", size=5)
    driver.settle()
    kept = tmp_path / "mine"
    kept.mkdir()
    driver.window.store.change(changes.set_case, steps=2)
    answers("ask_save", kept / "turned.cfg")
    assert driver.window.files.save_case()
    assert sorted(path.name for path in kept.iterdir()) == [
        "turned.cfg", "turned.su2", "turned_displacement.txt",
    ]  # fmt: skip
    text = (kept / "turned.cfg").read_text()
    assert "MESH_FILENAME= turned.su2" in text
    assert str(cache) not in text
    assert not driver.session.unsaved_case
    again = Case.read(kept / "turned.cfg")
    assert (again.motions, again.mesh_file) == (
        (FromFile(kept / "turned_displacement.txt"),), kept / "turned.su2",
    )  # fmt: skip
    assert driver.session.path == kept / "turned.su2"
    # A second time nothing is copied, and nobody is asked.
    assert driver.window.files.save_case()


def test_a_file_that_is_there_is_not_replaced_without_a_question(driver, cache, answers, tmp_path):
    driver.window.files.open_sample("passage", size=12)
    driver.settle()
    (tmp_path / "a.su2").write_text("mine")
    answers("ask_save", tmp_path / "a.cfg")
    asked = answers("ask_replace", False)
    assert not driver.window.files.save_case()
    assert asked[0][0] == [tmp_path / "a.su2"]
    assert (tmp_path / "a.su2").read_text() == "mine"


def test_a_sample_is_opened_in_another_size(driver, cache, answers):
    asked = answers("ask_sample", ("square", 7))
    driver.window.files.ask_and_open_sample()
    driver.settle()
    assert 30 < len(driver.session.mesh.cells) < 7 * 7
    assert asked[0][1]["stator"] == 20_000


def test_the_dialog_of_the_size_says_what_is_counted(qtbot, driver, monkeypatch):
    monkeypatch.undo()
    from qtpy.QtWidgets import QDialogButtonBox

    from slideviz.gui.widgets.build import Choice
    from slideviz.gui.widgets.fields import NumberBox

    seen = []

    def look(dialog):
        choice, box = dialog.findChild(Choice), dialog.findChild(NumberBox)
        for name in ("square", "stator"):
            choice.setCurrentIndex(choice.findData(name))
            told = " ".join(label.text() for label in dialog.findChildren(QLabel))
            seen.append((box.value(), "cells along a side (25)" in told, "about (20000)" in told))
        (buttons,) = dialog.findChildren(QDialogButtonBox)
        for text, able in (("2.5", False), ("20000", True)):
            box.lineEdit().setText(text)
            assert buttons.button(QDialogButtonBox.StandardButton.Open).isEnabled() == able
        return QDialog.DialogCode.Accepted

    monkeypatch.setattr(QDialog, "exec", look)
    samples = driver.window.files.samples
    sizes = dict.fromkeys(samples, 25) | {"stator": 20_000}
    found = questions.ask_sample(driver.window, samples, sizes)
    assert seen == [(25, True, False), (20_000, False, True)]
    assert found == ("stator", 20_000)


def test_a_case_whose_mesh_is_gone_says_so(driver, passage_file, answers, tmp_path):
    driver.open(passage_file)
    Path(passage_file).unlink()
    answers("ask_save", tmp_path / "a.cfg")
    assert driver.window.files.save_case()
    assert "no longer exists" in driver.window.banner.text.text()
    assert "passage.su2" in driver.window.banner.text.text()
