"""What the keys do in the panels of boundaries and motions, and where the cursor goes."""

import itertools

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtGui import QContextMenuEvent, QImage
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QAbstractItemView, QApplication, QMenu, QTableView

from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def opened(driver, passage_file):
    driver.open(passage_file)
    driver.role("airfoil", "moving")
    driver.window.store.change(changes.select, ())
    return driver


def menu_key(view):
    """Press the Menu key; Qt tells the focus widget, wherever the mouse is."""
    where = view.rect().center()
    event = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, where, view.mapToGlobal(where))
    QApplication.sendEvent(view, event)


def test_the_menu_key_is_about_the_row_that_is_selected_a_right_click_about_that_below_the_mouse(
    opened,
):
    panel = opened.window.boundaries

    def select(name):
        """Select as a click on the boundary in the view does."""
        opened.window.store.change(changes.select, (name,))

    names = ["inflow", "periodic_1", "periodic_2", "outflow"]
    for choose, name in itertools.product([opened.click_row, select], names):
        choose(name)
        panel.table.setFocus()
        menu_key(panel.table)
        (menu,) = [menu for menu in panel.findChildren(QMenu) if menu.isVisible()]
        assert menu.actions()[0].text() == name
        menu.close()
    panel = opened.window.boundaries
    opened.click_row("inflow")
    table = panel.table
    where = table.visualItemRect(table.item(opened.row("outflow"), 1)).center()
    there = table.viewport().mapToGlobal(where)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, where, there)
    QApplication.sendEvent(table.viewport(), event)
    (menu,) = [menu for menu in panel.findChildren(QMenu) if menu.isVisible()]
    assert menu.actions()[0].text() == "outflow"
    menu.close()


def test_roles_are_chosen_by_keys_alone(opened):
    table = opened.window.boundaries.table
    table.setFocus()
    for name, key, modifier in (
        ("outflow", Qt.Key.Key_F2, Qt.KeyboardModifier.NoModifier),
        ("inflow", Qt.Key.Key_Return, Qt.KeyboardModifier.NoModifier),
        ("periodic_1", Qt.Key.Key_Down, Qt.KeyboardModifier.AltModifier),
    ):
        assert opened.session.role(name) != "moving"
        table.setCurrentCell(opened.row(name), 0)
        QTest.keyClick(table, key, modifier)
        view = table.cellWidget(opened.row(name), 2).view()
        opened.qtbot.waitUntil(view.isVisible)
        QTest.keyClick(view, Qt.Key.Key_Home)
        QTest.keyClick(view, Qt.Key.Key_Return)
        assert opened.session.role(name) == "moving"
        assert table.hasFocus(), "the next one is chosen by keys, too"


def test_the_tab_key_leaves_every_table_and_comes_around(opened):
    window = opened.window
    views = window.findChildren(QAbstractItemView)
    assert not [v.objectName() for v in views if isinstance(v, QTableView) and v.tabKeyNavigation()]
    table = window.boundaries.table
    for key in (Qt.Key.Key_Backtab, Qt.Key.Key_Tab):
        table.setFocus()
        QTest.keyClick(table, key)
        assert not table.hasFocus()
        assert not table.isAncestorOf(window.focusWidget())
    # From anywhere, tabs alone reach the roles, the motions, the method and Run.
    window, seen = opened.window, set()
    window.store.change(changes.add_motion, Translate("airfoil", (0.01, 0.0)))
    window.boundaries.table.setFocus()
    for key in (Qt.Key.Key_Tab, Qt.Key.Key_Backtab):
        for _ in range(120):
            at = window.focusWidget()
            if at in seen:
                break
            assert not at.visibleRegion().isEmpty(), f"{at.objectName()} is behind a tab"
            seen.add(at)
            QTest.keyClick(at, key)
        wanted = {window.boundaries.table, window.motions.list, window.run_panel.run}
        assert wanted <= seen
        assert not [at for at in seen if window.docks["method"].isAncestorOf(at)]
        seen.clear()
    window.dock_manager.bring_to_front("method")
    window.boundaries.table.setFocus()
    for _ in range(9):
        QTest.keyClick(window.focusWidget(), Qt.Key.Key_Tab)
        seen.add(window.focusWidget())
    assert window.method.sliding in seen


def seen_pixels(widget):
    """Return the colors of a widget as it is painted, (height, width, 3)."""
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    pixels = np.frombuffer(image.constBits(), np.uint8)
    return pixels.reshape(image.height(), image.width(), 4)[..., :3].astype(int)


@pytest.mark.window("own")
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_focus_is_seen_wherever_the_tab_key_leads(opened, theme):
    window, reason, seen = opened.window, Qt.FocusReason.TabFocusReason, []
    window.set_theme(theme)
    for dock in ("runs", "histogram", "designs", "log"):
        window.dock_manager.bring_to_front(dock)
    window.boundaries.table.setFocus(reason)
    opened.qtbot.waitUntil(
        window.boundaries.table.hasFocus
    )  # its window may come to the front later
    while (at := window.focusWidget()) not in seen:
        seen.append(at)
        if at is not window.view:
            focused = seen_pixels(at)
            window.view.setFocus(reason)
            differs = np.abs(focused - seen_pixels(at)).max(axis=2) > 20
            assert differs.sum() > 12, at.objectName()
            at.setFocus(reason)
        QTest.keyClick(at, Qt.Key.Key_Tab)
    assert window.motions.add in seen, "a tool button"
    # The link beside Run is one of them, and Return follows it; without a link it is not.
    assert window.run_panel.text in seen
    while window.focusWidget() is not window.run_panel.text:
        QTest.keyClick(window.focusWidget(), Qt.Key.Key_Tab)
    QTest.keyClick(window.run_panel.text, Qt.Key.Key_Return)
    assert opened.session.case.motions == (Translate("airfoil", (0.0, 0.0)),)
    assert window.motions.editor.vector.fields[0].hasFocus()
    window.store.change(changes.replace_motion, 0, Translate("airfoil", (0.01, 0.0)))
    assert window.run_panel.text.focusPolicy() == Qt.FocusPolicy.NoFocus
    titles = [action.text() for action in window.actions_table.menus["theme"].actions()]
    assert all("&" in title for title in titles)


FIRST = {
    Translate: lambda editor: editor.vector.fields[0],
    Rotate: lambda editor: editor.angle,
    Scale: lambda editor: editor.factors.fields[0],
    Radial: lambda editor: editor.percent,
    HicksHenne: lambda editor: editor.raised,
    Cst: lambda editor: editor.raised,
    Bump: lambda editor: editor.raised,
    Ffd: lambda editor: editor.index.fields[0],
    FfdCamber: lambda editor: editor.index.fields[0],
    FfdThickness: lambda editor: editor.index.fields[0],
    FromFile: lambda editor: editor.path,
    Onto: lambda editor: editor.path,
}


def test_what_is_typed_after_adding_a_motion_goes_into_its_first_field(opened):
    assert {*FIRST} == {kind for kind in KINDS if not kind.only_3d}
    for kind, first in FIRST.items():
        opened.add_motion(kind)
        field = first(opened.window.motions.editor)
        opened.qtbot.waitUntil(field.hasFocus)
        QTest.keyClicks(opened.window.focusWidget(), "7")
        assert field.text() == "7", kind


def link(driver):
    """Click the link beside the button Run."""
    panel = driver.window.run_panel
    panel.text.linkActivated.emit("motion")


def test_links_beside_run_lead_to_the_field_that_does_nothing_or_is_wrong(opened):
    opened.add_motion(Rotate)
    opened.window.boundaries.table.setFocus()
    assert "Nothing moves yet" in opened.window.run_panel.text.text()
    link(opened)
    field = opened.window.motions.editor.angle
    assert field.hasFocus()
    assert field.selectedText() == "0"
    opened.window.store.change(changes.set_case, motions=())
    opened.add_motion(Rotate)
    field = opened.window.motions.editor.angle
    field.selectAll()
    QTest.keyClicks(field, "3..")
    link(opened)
    assert field.hasFocus()
    assert field.selectedText() == "3.."


def test_the_keys_of_the_player_reach_it_after_a_run_that_began_in_a_field(opened):
    opened.window.store.change(changes.add_motion, Rotate("airfoil", 1.0))
    opened.window.store.change(changes.set_case, steps=2)
    field = opened.window.motions.editor.angle
    field.setFocus()
    QTest.keyClicks(field, "1")
    QTest.keyClick(field, Qt.Key.Key_F5)
    opened.settle()
    for key, step in ((Qt.Key.Key_Home, 0), (Qt.Key.Key_End, 2)):
        QTest.keyClick(QApplication.focusWidget(), key)
        assert opened.session.view.frame == step


def test_a_new_motion_is_for_the_boundary_without_one_or_for_all_about_their_centroid(opened):
    opened.role("outflow", "moving")
    opened.window.store.change(changes.add_motion, Translate("airfoil", (0.01, 0.0)))
    # The link is about this boundary, whatever is selected.
    opened.window.store.change(changes.select, ("airfoil", "outflow"))
    assert "“outflow” has no motion: add one." in opened.window.run_panel.text.text()
    link(opened)
    assert opened.session.case.motions[1:] == (Translate("outflow", (0.0, 0.0)),)
    assert opened.window.motions.list.currentRow() == 1
    assert opened.window.motions.editor.vector.fields[0].hasFocus()
    opened.window.store.change(changes.set_case, motions=())
    opened.role("outflow", "moving")
    opened.window.store.change(changes.select, ())
    opened.add_motion(Translate)
    assert opened.session.case.motions[0].marker == ("airfoil", "outflow")
    opened.window.store.change(changes.set_case, motions=(Translate("airfoil", (0.1, 0.0)),))
    opened.add_motion(Translate)
    assert opened.session.case.motions[1].marker == "outflow"
    opened.add_motion(Translate)
    assert opened.session.case.motions[2].marker == ("airfoil", "outflow")
    opened.role("outflow", "moving")
    opened.window.store.change(changes.set_case, motions=(Rotate("", 1.0),))
    opened.choose(opened.window.motions.editor.about, "point")
    mesh = opened.session.mesh
    nodes = [*mesh.marker("airfoil").nodes, *mesh.marker("outflow").nodes]
    assert opened.session.case.motions[0].point == pytest.approx(mesh.points[nodes].mean(axis=0))


# Several boundaries -----------------------------------------------------------------------


def words(choice):
    return [choice.itemText(row) for row in range(choice.count())]


def test_a_motion_is_for_all_that_are_selected(opened):
    opened.role("outflow", "moving")
    opened.role("inflow", "moving")
    opened.click_row("airfoil")
    opened.click_row("outflow", Qt.KeyboardModifier.ControlModifier)
    opened.add_motion(Rotate)
    assert opened.session.case.motions == (Rotate(("airfoil", "outflow"), 0.0),)
    editor = opened.window.motions.editor
    assert words(editor.marker) == [
        "airfoil", "inflow", "outflow", "airfoil + outflow",
        "airfoil + inflow + outflow",
    ]  # fmt: skip
    assert editor.marker.currentText() == "airfoil + outflow"
    assert editor.about.currentText() == "their centroid (mean of nodes)"
    opened.choose(editor.marker, words(editor.marker).index("airfoil + inflow + outflow"))
    assert opened.session.case.motions[0].marker == ("airfoil", "inflow", "outflow")
    opened.choose(editor.marker, words(editor.marker).index("inflow"))
    assert opened.session.case.motions[0].marker == "inflow"


# The menu of the motions ------------------------------------------------------------------


def press(driver, keys):
    """Press keys in the list of motions."""
    motions = driver.window.motions.list
    motions.setFocus()
    QTest.keySequence(motions, keys)


def test_motions_are_duplicated_copied_and_pasted(opened):
    one, other = Translate("airfoil", (0.1, 0.0)), Rotate("airfoil", 1 / 3, (0.0, 0.1))
    opened.window.store.change(changes.set_case, motions=(one, other))
    listed = opened.window.motions.list
    listed.setCurrentRow(0)
    press(opened, "Ctrl+D")
    assert opened.session.case.motions == (one, one, other)
    assert listed.currentRow() == 1
    listed.setCurrentRow(2)
    press(opened, "Ctrl+C")
    assert QApplication.clipboard().text() == "(airfoil, rotate, 0.3333333333333333, (0.0, 0.1))"
    listed.setCurrentRow(0)
    press(opened, "Ctrl+V")
    assert opened.session.case.motions == (one, other, one, other)
    assert listed.currentRow() == 1
    press(opened, "Ctrl+Down")
    assert opened.session.case.motions == (one, one, other, other)
    press(opened, "Del")
    assert opened.session.case.motions == (one, one, other)
    opened.window.store.undo()
    assert opened.session.case.motions == (one, one, other, other)


def test_the_menu_of_the_motions_offers_what_can_be_done_as_to_paste_from_a_case_file(opened):
    panel = opened.window.motions
    able = {name: act.isEnabled() for name, act in panel.actions_table.items()}
    assert able == dict.fromkeys(able, False) | {"paste": True}
    opened.window.store.change(changes.set_case, motions=(Translate("airfoil", (0.1, 0.0)),) * 2)
    panel.list.setCurrentRow(0)
    able = {name for name, act in panel.actions_table.items() if act.isEnabled()}
    assert able == {"duplicate", "copy", "paste", "later", "remove"}
    assert [act.text() for act in panel.list.actions()][:3] == ["Duplicate", "Copy", "Paste"]
    opened.window.store.change(changes.set_case, motions=())
    text = "(HUB, translate, 0.1, 0.0) ; \\\n    (*, rotate, 5.0, centroid)"
    QApplication.clipboard().setText(text)
    press(opened, "Ctrl+V")
    assert opened.session.case.motions == (Translate("airfoil", (0.1, 0.0)), Rotate("", 5.0))
    QApplication.clipboard().setText("half a sentence")
    press(opened, "Ctrl+V")
    assert "The clipboard has no motion" in opened.window.banner.text.text()
    assert len(opened.session.case.motions) == 2


def test_arrows_change_no_role_after_a_click_on_one(driver, passage_file, qtbot):
    window = driver.window
    driver.open(passage_file)
    table, roles = window.boundaries.table, dict(driver.session.case.roles)
    choice = table.cellWidget(driver.row("inflow"), 2)
    QTest.mouseClick(choice, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: choice.view().isVisible())
    QTest.keyClick(choice.view(), Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not choice.view().isVisible())
    assert QApplication.focusWidget() is table
    driver.click_row("inflow")
    QTest.mouseClick(choice, Qt.MouseButton.LeftButton)
    QTest.keyClick(choice.view(), Qt.Key.Key_Escape)
    QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Down)
    assert driver.session.case.roles == roles
    assert driver.session.view.selected == ("outflow",)
    driver.role("outflow", "moving")
    QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Up)
    assert driver.session.view.selected == ("inflow",)
    assert driver.session.case.roles == {**roles, "outflow": "moving"}
