"""The docks: every control can be reached in a small window, and a layout comes back."""

import itertools
import subprocess
import sys

import pytest
from qtpy.QtCore import QPoint, QPointF, QRect, Qt
from qtpy.QtGui import QWheelEvent
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QWidget

from slideviz.gui.docks import LEFT_WIDTH, RIGHT_WIDTH
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import Choice
from slideviz.gui.widgets.fields import NumberField
from slideviz.gui.window import MainWindow
from slideviz.rbf.reduction import Reduction
from slideviz.session import changes
from tests.windows import come_to_rest

pytestmark = pytest.mark.usefixtures("unpainted")

SMALL = 1280, 800


@pytest.fixture
def method(driver, sample_folder, qtbot):
    """The method panel with all its settings open and in use, in a small window."""
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    window = driver.window
    window.resize(*SMALL)
    window.dock_manager.bring_to_front("method")
    driver.window.store.change(changes.set_case, reduction=Reduction(multilevel=True))
    driver.click(window.method.more.button)
    come_to_rest()
    return window.method


def seen_in(panel, widget):
    """Return the part of a widget that is seen in the scroll area of a panel."""
    port = panel.area.viewport()
    place = QRect(widget.mapTo(port, QPoint(0, 0)), widget.size())
    return place.intersected(port.rect())


def is_whole(panel, widget):
    return seen_in(panel, widget).size() == widget.size()


def controls(panel):
    """Return all that can be set in the panel, from the first to the last."""
    inside = panel.area.widget()
    every = [w for w in inside.findChildren(QWidget) if isinstance(w, (Choice, NumberField))]
    every += [panel.steps, panel.reduction, panel.more.button]
    return [w for w in every if w.isVisibleTo(inside) and w.isEnabled()]


def run_is_seen(window):
    button = window.run_panel.run
    place = QRect(button.mapTo(window, QPoint(0, 0)), button.size())
    return button.isVisible() and window.rect().contains(place) and button.height() > 20


def test_every_setting_is_reached_with_the_tab_key_and_seen_whole(method, driver):
    window, wanted, found = driver.window, controls(method), set()
    assert {method.more.kernel, method.more.gamma, method.more.level_end} <= set(wanted)
    assert method.area.verticalScrollBar().maximum() > 0, "not all have room at once"
    driver.activate()
    method.area.verticalScrollBar().setValue(0)
    method.method.setFocus()
    for _ in range(2 * len(wanted)):
        at = QApplication.focusWidget()
        # A spin box has the focus through the line in it.
        at = method.steps if at is method.steps.lineEdit() else at
        if at in wanted:
            assert is_whole(method, at), at.objectName()
            assert run_is_seen(window)
            found.add(at)
        QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
    assert [w.objectName() for w in wanted if w not in found] == []


def turn_wheel(widget, notches):
    where = QPointF(widget.rect().center())
    none = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    angle = QPoint(0, 120 * notches)
    everywhere = QPointF(widget.mapToGlobal(widget.rect().center()))
    event = QWheelEvent(where, everywhere, QPoint(), angle, *none, False)
    QApplication.sendEvent(widget, event)


def test_every_setting_is_reached_with_the_wheel_which_changes_none_and_none_is_cut_off(
    method, driver, qtbot
):
    case, bar = driver.session.case, method.area.verticalScrollBar()
    bar.setValue(0)
    found = set()
    for _ in range(60):
        found |= {w for w in controls(method) if is_whole(method, w)}
        port = method.area.viewport()
        # Over whatever control is in the middle.
        under = port.childAt(port.rect().center()) or port
        before = bar.value()
        turn_wheel(under, -1)
        assert run_is_seen(driver.window)
        if before == bar.value():
            turn_wheel(port, -1)
        if bar.value() == bar.maximum():
            break
    found |= {w for w in controls(method) if is_whole(method, w)}
    assert set(controls(method)) == found
    assert driver.session.case == case
    right = method.area.viewport().width()
    for widget in controls(method):
        edge = widget.mapTo(method.area.widget(), QPoint(widget.width(), 0)).x()
        assert edge <= right, widget.objectName()
    # What was typed after a click on the tab Motion went into the tolerance, which nobody saw.
    docks = driver.window.dock_manager.by_name
    field = method.findChild(NumberField)
    field.setFocus()
    assert docks["method"].isAncestorOf(QApplication.focusWidget())
    docks["motion"].raise_()
    qtbot.waitUntil(
        lambda: not docks["method"].isAncestorOf(QApplication.focusWidget() or driver.window)
    )


# The layout -------------------------------------------------------------------------------


def widths(window):
    return {name: window.docks[name].width() for name in ("boundaries", "runs")}


def close(window, monkeypatch):
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
    window.close()


@pytest.fixture
def start(qtbot, settings, monkeypatch):
    """Start a window with the settings of the test, as the program does."""

    def make(size=None):
        window = MainWindow(settings, multi_samples=0)
        qtbot.addWidget(window, before_close_func=lambda w: close(w, monkeypatch))
        if size is not None:
            window.resize(*size)
        with qtbot.waitExposed(window):
            window.show()
        come_to_rest()
        return window

    return make


def share(window, qtbot, left, right):
    """Drag the edges of the view, as with the mouse."""
    docks = [window.docks[name] for name in ("boundaries", "histogram")]
    window.resizeDocks(docks, [left, right], Qt.Orientation.Horizontal)
    come_to_rest()


def test_the_layout_comes_back_after_a_restart(start, qtbot, monkeypatch):
    first = start(SMALL)
    share(first, qtbot, LEFT_WIDTH + 60, RIGHT_WIDTH + 45)
    first.docks["log"].show()
    first.docks["sections"].hide()
    first.docks["worst"].raise_()
    come_to_rest()
    before = widths(first)
    assert before["boundaries"] == pytest.approx(LEFT_WIDTH + 60, abs=3)
    close(first, monkeypatch)
    second = start()
    assert (second.width(), second.height()) == SMALL
    assert widths(second) == before
    assert second.docks["log"].isVisible()
    assert not second.docks["sections"].isVisibleTo(second)
    assert not second.docks["worst"].visibleRegion().isEmpty(), "the tab in front is that again"


def test_the_layout_can_be_put_back(start, qtbot, monkeypatch):
    first = start(SMALL)
    at_first = widths(first)
    share(first, qtbot, LEFT_WIDTH + 60, RIGHT_WIDTH + 45)
    first.docks["sections"].hide()
    first.docks["method"].setFloating(True)
    close(first, monkeypatch)
    second = start()
    assert widths(second) != at_first
    assert second.docks["method"].isFloating()
    second.actions_table.by_name["restore_layout"].trigger()
    come_to_rest()
    assert widths(second) == at_first
    assert not second.docks["method"].isFloating()
    assert second.docks["sections"].isVisibleTo(second)
    assert not second.docks["log"].isVisible()
    assert not second.docks["motion"].visibleRegion().isEmpty()


def overlaps(window):
    """Return what lies over something else, or is cut by the edge of the window."""
    docks = {n: d for n, d in window.docks.items() if not d.visibleRegion().isEmpty()}
    places = {name: dock.geometry() for name, dock in docks.items() if not dock.isFloating()}
    places["view"] = window.centralWidget().geometry()
    cut = {name for name, place in places.items() if not window.rect().contains(place)}
    pairs = itertools.combinations(places, 2)
    return cut | {(one, other) for one, other in pairs if places[one].intersects(places[other])}


def test_names_are_whole_in_a_window_of_1024_pixels(driver, sample_folder, tmp_path):
    window = driver.window
    folder = sample_folder / "passage"
    text = (folder / "passage.cfg").read_text().replace("mesh.su2", str(tmp_path / "mesh.su2"))
    names = {"periodic_1": "the_periodic_side_below", "airfoil": "blade_of_the_stator"}
    mesh = (folder / "mesh.su2").read_text()
    for old, new in names.items():
        text, mesh = text.replace(old, new), mesh.replace(old, new)
    (tmp_path / "mesh.su2").write_text(mesh)
    (tmp_path / "long.cfg").write_text(text)
    driver.open(tmp_path / "long.cfg")
    table, walls = window.boundaries.table, window.dock_manager.panels["limits"].walls
    window.dock_manager.bring_to_front("limits")
    for width, height in ((1024, 700), (1280, 800), (1024, 700)):
        window.resize(width, height)
        come_to_rest()
        assert table.columnWidth(0) >= table.sizeHintForColumn(0)
        longest = max(map(table.fontMetrics().horizontalAdvance, names.values()))
        assert table.columnWidth(0) > longest
        driver.qtbot.waitUntil(lambda: walls.topLevelItemCount() > 0)
        shown = [walls.topLevelItem(row) for row in range(walls.topLevelItemCount())]
        for item in shown:
            room = walls.columnWidth(0) - walls.indentation()
            assert room > walls.fontMetrics().horizontalAdvance(item.text(0)), item.text(0)
        for bar in window.dock_manager.tabs.bars():
            texts = [bar.tabText(k) for k in range(bar.count())]
            if bar.isVisible() and "Limits" in texts:
                assert sum(map(bar.fontMetrics().horizontalAdvance, texts)) < bar.width()
                assert bar.sizeHint().width() <= bar.width()
    # It begins at its top, also where the mesh has the boundaries of the one before.
    table.verticalScrollBar().setValue(table.verticalScrollBar().maximum())
    driver.open(tmp_path / "long.cfg")
    assert table.verticalScrollBar().value() == 0


def test_nothing_overlaps_in_a_small_window_where_boundaries_are_a_tab(start, qtbot, sample_folder):
    window = start()
    window.setMinimumSize(1, 1)
    docks = window.docks
    for size in ((720, 450), (720, 410), (1280, 800), (900, 620), (720, 410)):
        window.resize(*size)
        come_to_rest()
        assert (window.width(), window.height()) == size
        low = size[1] < 600
        beside = window.tabifiedDockWidgets(docks["boundaries"])
        assert set(beside) == ({docks["motion"], docks["method"]} if low else set())
        assert is_titled(docks["boundaries"]) != low
        assert overlaps(window) == set()
        assert run_is_seen(window)
    window.files.open_path(sample_folder / "passage" / "passage.cfg")
    qtbot.waitUntil(lambda: not window.runner.busy)
    for dock in ("motion", "method", "worst", "limits", "curves", "sections", "display", "designs"):
        window.dock_manager.bring_to_front(dock)
        come_to_rest()
        assert overlaps(window) == set(), dock
        assert run_is_seen(window)
    port = window.motions.parentWidget()
    assert window.motions.width() <= port.width(), "no field is beyond the edge"
    # The panel in front stays that; where the user has moved a panel, the height changes nothing.
    docks["designs"].hide()
    window.dock_manager.bring_to_front("method")
    window.resize(1280, 800)
    come_to_rest()
    assert not docks["method"].visibleRegion().isEmpty()
    assert not docks["boundaries"].visibleRegion().isEmpty()
    window.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, docks["method"])
    window.resize(720, 410)
    come_to_rest()
    assert window.tabifiedDockWidgets(docks["boundaries"]) == []
    assert run_is_seen(window)


def test_sides_follow_the_window_until_they_are_moved_also_after_a_restart(
    start, qtbot, monkeypatch
):
    first = start(SMALL)
    close(first, monkeypatch)
    second = start()
    narrow = widths(second)
    second.resize(1800, 900)
    come_to_rest()
    wide = widths(second)
    assert all(wide[name] > narrow[name] + 20 for name in wide)
    share(second, qtbot, LEFT_WIDTH + 30, RIGHT_WIDTH + 40)
    moved = widths(second)
    second.resize(1900, 900)
    come_to_rest()
    assert widths(second) == pytest.approx(moved, abs=3)
    close(second, monkeypatch)
    third = start()
    third.resize(1700, 900)
    come_to_rest()
    assert widths(third) == pytest.approx(moved, abs=3)


def tab_of(window, title):
    """Return the tab bar that has a panel, and where its tab is."""
    for bar in window.dock_manager.tabs.bars():
        for index in range(bar.count()):
            if bar.tabText(index) == title:
                return bar, bar.tabRect(index).center()
    raise AssertionError(title)


def is_titled(dock):
    return dock.titleBarWidget() is None


def test_a_panel_is_taken_out_of_its_tab_and_put_back(start, qtbot, monkeypatch):
    window = start(SMALL)
    docks = window.docks
    assert not is_titled(docks["curves"])
    bar, at = tab_of(window, "Curves")
    QTest.mouseDClick(bar, Qt.MouseButton.LeftButton, pos=at)
    come_to_rest()
    assert docks["curves"].isFloating()
    assert is_titled(docks["curves"])
    assert docks["curves"].isVisible()
    assert docks["histogram"].isVisible(), "both are seen together"
    assert docks["curves"].height() > 200
    close(window, monkeypatch)
    again = start()
    assert again.docks["curves"].isFloating()
    again.actions_table.by_name["restore_layout"].trigger()
    come_to_rest()
    assert not again.docks["curves"].isFloating()
    assert not is_titled(again.docks["curves"])
    tab_of(again, "Curves")


def test_a_panel_without_a_tab_has_a_title_and_the_menu_of_a_tab_closes_it(start, qtbot):
    window = start(SMALL)
    for name in ("worst", "limits", "curves"):
        window.docks[name].close()
    come_to_rest()
    assert is_titled(window.docks["histogram"])
    assert not is_titled(window.docks["run"]), "its button names it"
    window.docks["worst"].show()
    come_to_rest()
    assert not is_titled(window.docks["histogram"])
    assert run_is_seen(window)
    window = start(SMALL)
    menu = window.dock_manager.tabs.menu_of(window.docks["runs"])
    texts = {action.text(): action for action in menu.actions()}
    texts["Own window"].trigger()
    assert window.docks["runs"].isFloating()
    texts["Close"].trigger()
    come_to_rest()
    assert not window.docks["runs"].isVisible()


TWICE = """
import sys, time
from qtpy.QtCore import QSettings
from qtpy.QtWidgets import QApplication
from slideviz.gui.window import MainWindow

app = QApplication([])
settings = QSettings(sys.argv[1], QSettings.Format.IniFormat)

def tabs(window):
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        app.processEvents()
        time.sleep(0.01)
    bars = window.dock_manager.tabs.bars()
    inside = [bar for bar in bars if window.rect().intersects(bar.geometry())]
    return sorted([bar.tabText(index) for index in range(bar.count())] for bar in inside)

for _ in range(2):
    window = MainWindow(settings, multi_samples=0)
    window.show()
    print(tabs(window))
    window.docks["curves"].setFloating(True)
    tabs(window)
    window.dock_manager.restore_layout()
    print(tabs(window))
    window.close()
    window.deleteLater()
    app.processEvents()
"""


@pytest.mark.slow
def test_no_tab_is_left_over_the_panels(tmp_path):
    call = [sys.executable, "-c", TWICE, str(tmp_path / "settings.ini")]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120, check=True)
    every = [["Histogram", "Worst cells", "Limits", "Curves"], ["Motion", "Method"]]
    every.append(["Runs", "Sections", "Display"])
    said = done.stdout.strip().splitlines()
    assert said == [str(every)] * 4, "twice at the start, and after the layout was put back"


def test_keys_go_from_panel_to_panel_behind_tabs_too(driver, sample_folder, qtbot):
    driver.open(sample_folder / "hexahedron" / "hexahedron.cfg")
    window, docks = driver.window, driver.window.dock_manager
    driver.activate()
    docks.bring_to_front("motion")
    for key, name in ((Qt.Key.Key_PageDown, "method"), (Qt.Key.Key_PageUp, "motion")):
        QTest.keyClick(window.focusWidget(), key, Qt.KeyboardModifier.ControlModifier)
        come_to_rest()
        assert window.docks[name].isAncestorOf(window.focusWidget())
        assert not window.docks[name].visibleRegion().isEmpty()
    seen = []
    for _ in range(12):
        docks.bring_next()
        come_to_rest()
        seen += [k for k, one in window.docks.items() if one.isAncestorOf(window.focusWidget())]
    assert set(seen) == {k for k, one in window.docks.items() if not one.isHidden()}
