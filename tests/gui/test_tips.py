"""Tooltips: short enough lines, entries of lists that explain themselves."""

from dataclasses import replace

import pytest
from qtpy.QtCore import Qt
from qtpy.QtGui import QFontMetrics, QTextDocument
from qtpy.QtWidgets import (
    QComboBox,
    QLabel,
    QListWidget,
    QTableWidget,
    QToolTip,
    QTreeWidget,
    QWidget,
)

from slideviz.gui import running
from slideviz.gui.commands import MOUSE
from slideviz.gui.dialogs.help import palette_entries
from slideviz.gui.widgets.build import LETTERS, wrapped
from slideviz.gui.widgets.fields import NumberField
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

LONG = "the correction of a blade moves nodes of a shroud that is < 0.01 away " * 4


def lines_of(tip):
    """Return the longest line of a plain tooltip, in letters, or the width of a rich one."""
    if not Qt.mightBeRichText(tip):
        return max((len(line) for line in tip.splitlines()), default=0)
    page = QTextDocument()
    page.setDefaultFont(QToolTip.font())
    page.setHtml(tip)
    letter = QFontMetrics(QToolTip.font()).averageCharWidth()
    page.setTextWidth(80 * letter)  # as Qt's tooltips do
    return page.idealWidth() / letter


def tips_of(widget):
    """Yield all tooltips of a widget and of its rows."""
    yield widget.toolTip()
    if isinstance(widget, QComboBox):
        for row in range(widget.count()):
            yield widget.itemData(row, Qt.ItemDataRole.ToolTipRole) or ""
    elif isinstance(widget, QListWidget):
        yield from (widget.item(row).toolTip() for row in range(widget.count()))
    elif isinstance(widget, QTreeWidget):
        columns = range(widget.columnCount())
        items = [widget.topLevelItem(row) for row in range(widget.topLevelItemCount())]
        yield from (item.toolTip(at) for item in (widget.headerItem(), *items) for at in columns)
    elif isinstance(widget, QTableWidget):
        cells = (widget.item(row, 0) for row in range(widget.rowCount()))
        yield from (cell.toolTip() for cell in cells if cell is not None)


def test_long_tooltips_have_lines_of_sixty_letters(qtbot):
    assert lines_of(LONG) > 200
    assert 40 < lines_of(wrapped(LONG)) < 1.3 * LETTERS
    page = QTextDocument()
    page.setHtml(wrapped(LONG))
    assert page.toPlainText().strip() == LONG.strip(), "what looks like a tag is told"
    assert wrapped("short\nlines") == "short\nlines"


def test_a_field_wraps_its_explanation(qtbot):
    field = NumberField(1.0)
    qtbot.addWidget(field)
    field.set_tip(LONG)
    assert lines_of(field.toolTip()) < 1.3 * LETTERS


@pytest.mark.parametrize("warns", ["", LONG])
def test_no_tooltip_of_the_window_is_wider_than_it_can_be_read(driver, sample_folder, warns):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window = driver.window
    window.store.change(changes.set_case, steps=1)
    window.start_run()
    driver.settle()
    (run,) = driver.session.runs
    last = replace(run.last, step=replace(run.last.step, messages=(warns,) * bool(warns)))
    window.store.put(replace(driver.session, runs=(replace(run, frames=(last,)),)))
    found = [tip for widget in window.findChildren(QWidget) for tip in tips_of(widget)]
    assert any(warns[:20] in tip for tip in found)
    wide = {tip for tip in found if lines_of(tip) > 1.5 * LETTERS}
    assert not wide


def test_words_explain_themselves_and_name_the_hovering(driver, passage_file, window):
    driver.open(passage_file)
    for choice in (driver.window.method.sliding, driver.window.method.periodic):
        tips = list(tips_of(choice))[1:]
        assert len(set(tips)) == choice.count()
        assert all(len(tip.split()) > 5 for tip in tips)
    driver.open(passage_file)
    panels = driver.window.dock_manager.panels
    assert panels["display"].reset_range.text() == "Reset"
    labels = {label.text() for label in panels["motion"].findChildren(QLabel)}
    assert "and by (length)" in labels
    commands = window.actions_table.by_name.values()
    names = [entry.title for entry in list(palette_entries(window.help))[: len(commands)]]
    names = names[: names.index("About slideviz") + 1]
    assert len(set(names)) == len(names)
    assert {"Undeformed boundaries", "Undeformed mesh"} <= set(names)
    assert any(keys.startswith("Rest on a cell") for keys in MOUSE)


def test_the_status_bar_follows_a_run_and_the_log_keeps_its_warnings(
    driver, sample_folder, monkeypatch
):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window, said = driver.window, []
    monkeypatch.setattr(running, "remarks_of", lambda _, level: (LONG,) * (level == "warning"))
    window.statusBar().messageChanged.connect(said.append)
    window.store.change(changes.set_case, steps=2)
    window.start_run()
    driver.settle()
    assert said[-1].startswith("Done: ")
    told = [text for text in said if "tep 2" in text]
    assert told, said
    log = window.dock_manager.panels["log"]
    driver.qtbot.waitUntil(lambda: LONG.strip() in log.toPlainText())
    assert log.lineWrapMode() != log.LineWrapMode.NoWrap
