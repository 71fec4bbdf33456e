"""The start page: one click from a deformed mesh, recent files, samples, keyboard."""

import os
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.errors import Cancelled
from slideviz.gui import files, start
from slideviz.gui.start import COLUMNS, RECENT, SIZE, StartPage, card, when_changed
from slideviz.samples import table
from slideviz.samples.table import SAMPLES
from slideviz.session import jobs
from slideviz.terms import ROLES

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def small(monkeypatch, tmp_path):
    """Samples of few cells, in a folder of the test."""
    monkeypatch.setattr(files, "sample_folder", lambda: tmp_path / "samples")
    monkeypatch.setattr(jobs, "SIZES", {"passage": 12, "hexahedron": 6})
    return tmp_path


def test_one_click_deforms_a_blade_passage(driver, small):
    start = driver.window.start
    assert start.attempt.isVisible()
    driver.click(start.attempt)
    driver.qtbot.waitUntil(
        lambda: any(run.end == "done" for run in driver.session.runs), timeout=60_000
    )
    assert not start.isVisible()
    assert driver.session.deformed.quality.inverted == 0
    assert driver.session.view.color_by == "size-skew"
    # A sample is no file of the user's.
    assert driver.window.files.recent() == []


@pytest.mark.parametrize("key", [Qt.Key.Key_Space, Qt.Key.Key_Return])
def test_a_card_opens_its_sample_and_deforms_nothing(driver, small, key):
    button = driver.window.start.sample_buttons["hexahedron"]
    button.setFocus()
    QTest.keyClick(button, key)
    driver.settle()
    assert driver.session.mesh.dim == 3
    assert driver.session.case.source.name == "hexahedron.cfg"
    assert not driver.session.runs


def test_large_samples_open_small_and_the_size_in_their_words_is_what_opens(
    driver, monkeypatch, tmp_path
):
    assert max(jobs.SIZES.values()) <= 50_000
    assert "stator" in jobs.SIZES
    assert table.SAMPLES["turbine-row"].size <= 50_000
    made, window = [], driver.window
    monkeypatch.setattr(
        jobs, "write_sample", lambda name, _folder, size, **_: made.append((name, size)) or []
    )
    for name, words in window.files.samples.items():
        with pytest.raises(StopIteration):  # as nothing was written
            jobs.open_sample(name, tmp_path, jobs.Job())
        size = made[-1][1] or SAMPLES[name].size
        assert words.endswith(f"({size})")
        assert words in window.start.sample_buttons[name].toolTip()
        assert window.files.sizes[name] == size
    assert [name for name, _ in made] == list(SAMPLES)


def test_open_begins_in_the_folder_of_the_mesh(driver, sample_folder, answers, settings, small):
    settings.setValue("folder", str(small))
    asked = answers("ask_open", None)
    driver.window.files.ask_and_open()
    driver.open(sample_folder / "passage" / "passage.cfg")
    settings.setValue("folder", str(small))  # as after an export
    driver.window.files.ask_and_open()
    assert [folder for (folder,) in asked] == [small, sample_folder / "passage"]
    # Those that come with the program are in a cache, which is of no interest.
    driver.window.files.open_sample("hexahedron")
    driver.settle()
    settings.setValue("folder", str(sample_folder))
    driver.window.files.ask_and_open()
    assert asked[-1][0] == sample_folder


def test_a_sample_can_be_cancelled_while_it_is_made(small):
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.open_sample("passage", small, jobs.Job(stopped=lambda: True))


def test_the_page_says_what_is_being_opened(driver, small):
    page = driver.window.start
    before = page.hint.text()
    driver.window.files.open_sample("hexahedron")
    assert page.hint.text() == "Opening the sample hexahedron"
    assert page.bar.isVisible()
    page.show_progress(jobs.JobProgress("Reading", 0.25))
    assert (page.hint.text(), page.bar.value()) == ("Reading", 250)
    driver.settle()
    assert (page.hint.text(), page.bar.isHidden()) == (before, True)


def test_a_sample_that_cannot_be_written_is_told(driver, small):
    (small / "samples").write_text("a file")
    driver.click(driver.window.start.sample_buttons["passage"])
    driver.settle()
    assert str(small / "samples") in driver.window.banner.text.text()
    assert driver.window.start.isVisible()


def test_recent_files_with_folder_and_time_and_missing_ones_are_grey(qtbot, tmp_path):
    there, gone = tmp_path / "there.su2", tmp_path / "gone.cfg"
    there.write_text("x")
    page = StartPage({})
    qtbot.addWidget(page)
    page.show_recent([there, gone])
    page.show()
    first, second = page.recent_buttons
    assert first.isEnabled()
    assert "today" in first.accessibleName()
    assert not second.isEnabled()
    assert "missing" in second.accessibleName()
    with qtbot.waitSignal(page.file_wanted) as wanted:
        QTest.mouseClick(first, Qt.MouseButton.LeftButton)
    assert wanted.args == [there]
    page.show_recent([tmp_path / f"{k}.su2" for k in range(20)])
    assert len(page.recent_buttons) == RECENT
    page.show_recent([])
    assert page.recent_buttons == []


def test_when_a_file_was_changed(tmp_path):
    path, now = tmp_path / "a", datetime(2026, 5, 20, 12, 0)
    assert when_changed(path) == ""
    path.touch()
    for days, word in ((0, "today 09:30"), (1, "yesterday 09:30")):
        then = (now - timedelta(days=days)).replace(hour=9, minute=30).timestamp()
        os.utime(path, (then, then))
        assert when_changed(path, now) == word
    long_ago = datetime(2020, 3, 4).timestamp()
    os.utime(path, (long_ago, long_ago))
    assert "20" in when_changed(path, now)
    assert "today" not in when_changed(path, now)


@pytest.mark.window("own")
def test_everything_can_be_reached_with_tab_and_cards_follow_the_theme(
    window, tmp_path, monkeypatch
):
    start = window.start
    start.attempt.setFocus()
    seen = set()
    for _ in range(40):
        seen.add(QApplication.focusWidget().objectName())
        QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
    assert {"run", "open_page", "sample_square", "sample_stator"} <= seen

    def shown():
        return window.start.sample_buttons["square"].icon().pixmap(SIZE[0], SIZE[1]).toImage()

    window.set_theme("light")
    QApplication.processEvents()
    light = shown()
    window.set_theme("dark")
    QApplication.processEvents()
    assert shown() != light
    monkeypatch.chdir(tmp_path)
    assert window.files.folder() == tmp_path
    monkeypatch.chdir("/")
    assert window.files.folder() == Path.home(), "from a desktop"
    window.files.remember(tmp_path / "mesh.su2")
    assert window.files.folder() == tmp_path


@pytest.mark.window("own")
def test_all_cards_are_seen_without_scrolling(driver, passage_file):
    window = driver.window
    window.start.show_recent([Path(passage_file)] * RECENT)
    for size in ((1280, 800), (1920, 1080)):
        window.resize(*size)
        driver.qtbot.waitUntil(lambda size=size: window.width() == size[0])
        QApplication.processEvents()
        assert window.start.verticalScrollBar().maximum() == 0
        cards = list(window.start.sample_buttons.values())
        assert len({card.y() for card in cards}) == -(-len(cards) // COLUMNS)
        for one in cards:
            assert one.iconSize().width() + 8 <= one.width()


def test_each_sample_has_a_picture_of_its_own(qapp):
    files = list(Path(start.__file__).with_name("cards").glob("*.svg"))
    assert {file.stem for file in files} == {*SAMPLES, "mesh"}
    assert all(ROLES["sliding"].color in file.read_text() for file in files)
    drawn = {name: card(name, "#888888").toImage() for name in SAMPLES}
    assert all(image.width() == 2 * SIZE[0] for image in drawn.values())
    names = list(drawn)
    for k, name in enumerate(names):
        assert all(drawn[name] != drawn[other] for other in names[k + 1 :])
    orange = "#d55e00"
    for image in drawn.values():
        colors = {
            image.pixelColor(x, y).name()
            for x in range(0, image.width(), 2)
            for y in range(0, image.height(), 2)
            if image.pixelColor(x, y).alpha() == 255
        }
        assert orange in colors
