"""The palette finds commands, boundaries, runs, keys and pages by letters, and does them."""

import pytest
from qtpy.QtCore import QSettings, Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QLineEdit

from slideviz.gui.commands import COMMANDS, CommandState
from slideviz.gui.dialogs.help import PaletteDialog
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def find(driver, qtbot):
    """Open the palette by its keys, and type letters."""

    def type_letters(letters):
        driver.activate()
        QTest.keyClick(
            driver.window,
            Qt.Key.Key_P,
            Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier,
        )
        dialog = driver.window.help._shown["palette"]
        assert isinstance(dialog, PaletteDialog)
        assert dialog.isVisible()
        dialog.search.clear()
        QTest.keyClicks(dialog.search, letters)
        return dialog

    return type_letters


def rows(dialog):
    model = [dialog.tree.topLevelItem(k) for k in range(dialog.tree.topLevelItemCount())]
    return {item.text(0): item.text(2) for item in model}


def enter(dialog):
    QTest.keyClick(dialog.search, Qt.Key.Key_Return)


def test_it_has_every_command_with_its_key_or_why_it_is_disabled(find, with_runs):
    driver = with_runs({"steps": 2})
    dialog = find("")
    named = {entry.title: entry for entry in dialog.entries}
    now = CommandState(driver.session)
    titles = {one.called(now).replace("&", "").rstrip("…") for one in COMMANDS.values()}
    assert titles <= set(named)
    assert named["Picture"].keys == "Ctrl+P"
    assert "nothing to redo" in named["Redo"].about
    assert named["Redo"].do is None
    assert all(entry.about for entry in dialog.entries)
    assert named["mark the cell below the mouse"].keys == "Double click, Alt+Click"
    assert named["Motions: duplicate"].keys == "Ctrl+D"
    impossible = [entry.title for entry in dialog.entries if "Not possible" in entry.about]
    assert impossible == ["Cut by a cone", "Cut at constant span"], "in 2D"
    assert {named[name].about for name in driver.session.mesh.marker_names} == {"boundary"}
    assert "steps" in named["STEPS"].about
    assert named["The window"].about == "page of the manual"
    assert [one.title[:6] for one in dialog.entries if one.about == "run"] == ["Run 1:"]
    dialog.close()


def test_without_a_mesh_it_says_what_is_missing(find):
    dialog = find("save case")
    assert rows(dialog)["Save case as"] == "There is no mesh yet: open one first."
    enter(dialog)
    assert dialog.isVisible(), "nothing was done"
    dialog.close()


def test_letters_in_order_are_enough_and_enter_does_it(find, with_runs, monkeypatch, tmp_path):
    driver = with_runs({"steps": 2})
    dialog = find("mshedg")
    assert next(iter(rows(dialog))) == "Mesh edges"
    before = "edges" in driver.session.view.drawn
    enter(dialog)
    assert ("edges" in driver.session.view.drawn) != before
    driver.window.activateWindow()
    again = find("e")
    assert next(iter(rows(again))) == "Mesh edges", "what was done is first"
    again.close()
    window = driver.window
    one = tmp_path / "one.ini"
    one.write_text("[General]\npalette=Mesh edges\n")
    monkeypatch.setattr(window, "settings", QSettings(str(one), QSettings.Format.IniFormat))
    later = find("e")
    assert next(iter(rows(later))) == "Mesh edges", "also when the program is started again"
    later.close()


def test_arrows_move_in_the_list_while_typing(find, with_runs):
    driver = with_runs({"steps": 2})
    dialog = find("step ")
    names = list(rows(dialog))
    assert [name for name in names if name in ("Step back", "Step on")] == ["Step back", "Step on"]
    for _ in range(names.index("Step back")):
        QTest.keyClick(dialog.search, Qt.Key.Key_Down)
    enter(dialog)
    assert driver.session.view.frame == 1


def test_the_name_itself_is_first(find, with_runs):
    with_runs({"steps": 2})
    for name in ("STEPS", "Run", "airfoil", "RELAX"):
        dialog = find(name.lower())
        assert next(iter(rows(dialog))) == name
        dialog.close()


def test_words_of_other_programs_are_found(find, with_runs):
    with_runs({"steps": 1})
    words = {
        "zoom": "Fit to boundary",
        "screenshot": "Picture",
        "cfg": "Save case as",
        "slice": "Cut by a line",
        "clip": "Cut by a circle",
        "box": "Add motion: Free-form box",
        "revert": "Undo",
    }
    for word, name in words.items():
        dialog = find(word)
        assert name in rows(dialog), rows(dialog)
        dialog.close()
    dialog = find("undo")
    assert next(iter(rows(dialog))) == "Undo"
    dialog.close()


def test_motions_are_added_from_the_mesh_on(find, with_runs):
    dialog = find("add motion")
    assert not rows(dialog)
    dialog.close()
    driver = with_runs({"steps": 1})
    count = len(driver.session.case.motions)
    enter(find("add motion: rotate"))
    assert len(driver.session.case.motions) == count + 1
    assert "Add motion: Twist by box" not in rows(find("add motion")), "in 2D"


def test_a_film_of_a_case_without_a_file_asks_for_both(find, with_runs):
    driver = with_runs({"steps": 1})
    driver.window.store.change(changes.set_case, source=None)
    dialog = find("copy film")
    assert set(rows(dialog).values()) == {"Save the case (Ctrl+Shift+S) and run it first."}
    dialog.close()


def test_a_boundary_is_selected(find, with_runs):
    driver = with_runs({"steps": 1})
    dialog = find("airfoil")
    enter(dialog)
    assert driver.session.view.selected == ("airfoil",)


def test_a_run_is_shown(find, with_runs):
    driver = with_runs({"steps": 1}, {"steps": 2})
    assert driver.session.shown == 2
    enter(find("run 1:"))
    assert driver.session.shown == 1


def test_a_key_leads_to_its_field_or_to_its_meaning(find, with_runs):
    window = with_runs({"steps": 1}).window
    enter(find("REPAIR_BELOW"))
    assert window.focusWidget() is not None
    assert window.dock_manager.panels["method"].isAncestorOf(window.focusWidget())
    enter(find("VIEW_MAP"))
    assert window.help._shown["keys"].findChild(QLineEdit).text() == "VIEW_MAP="


def test_a_page_is_opened(find, with_runs):
    window = with_runs({"steps": 1}).window
    enter(find("The window"))
    pages = window.help._shown["manual"].pages
    assert pages.source().toLocalFile().endswith("window.md")
