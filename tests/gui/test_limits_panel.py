"""The panel of limits and walls."""

from dataclasses import replace

import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest

from slideviz.case.limits import read_limits
from slideviz.gui.panels.limits import LimitsPanel
from slideviz.session import changes
from slideviz.session.jobs import Job, check_frame
from tests.session.test_walls_table import sheared_session
from tests.windows import services

pytestmark = pytest.mark.usefixtures("unpainted")


@pytest.fixture
def flown():
    return []


@pytest.fixture
def panel(qtbot, flown):
    made = LimitsPanel(services(flown))
    made.resize(320, 420)
    qtbot.addWidget(made)
    with qtbot.waitExposed(made):
        made.show()
    made.activateWindow()
    return made


def show(panel, limits="", **roles):
    """Show the sheared channel with limits that were checked."""
    panel.store.change(lambda _: sheared_session(roles))
    panel.store.change(changes.set_case, limits=read_limits(limits))
    session = panel.store.session
    checked = check_frame(session.frame, session.mesh, session.case, Job())
    panel.store.change(replace, checked=checked)


def texts(item):
    return [item.text(column) for column in range(item.columnCount())]


def click(tree, item, column=0):
    where = tree.visualItemRect(item).center()
    QTest.mouseClick(tree.viewport(), Qt.MouseButton.LeftButton, pos=where)


def test_limits_are_listed_met_or_not(panel):
    show(panel, "growth < 20, wall_angle > 60, inverted = 0")
    rows = [texts(panel.limits.topLevelItem(k)) for k in range(3)]
    assert rows[0][0] == "✓ growth < 20"
    assert rows[1] == ["✗ wall_angle > 60", "45", "2"]
    assert rows[2] == ["✓ inverted = 0", "0", ""]


def test_a_click_marks_the_failing_cells_and_flies_to_the_worst(panel, flown):
    show(panel, "wall_angle > 60")
    click(panel.limits, panel.limits.topLevelItem(0))
    session = panel.store.session
    assert session.limit_chosen.cells.tolist() == sorted(session.limit_chosen.cells.tolist())
    assert flown == [session.limit_chosen.cells[0]]
    assert session.view.marked_cell == flown[0]
    click(panel.limits, panel.limits.topLevelItem(0))
    assert panel.store.session.limit is None


def test_limits_are_typed(panel, qtbot):
    show(panel)
    assert panel.limits.isHidden()
    QTest.keyClicks(panel.field, "min > 0.2, inverted = 0")
    QTest.keyClick(panel.field, Qt.Key.Key_Return)
    assert panel.store.session.case.limits == read_limits("min > 0.2, inverted = 0")
    assert panel.limits.topLevelItem(0).text(1) == "…"  # until it is checked
    panel.field.selectAll()
    QTest.keyClicks(panel.field, "mni > 0.2")
    QTest.keyClick(panel.field, Qt.Key.Key_Return)
    assert "did you mean min?" in panel.problem.text()
    assert panel.problem.isVisible()
    assert panel.store.session.case.limits == read_limits("min > 0.2, inverted = 0")


def test_walls_before_and_after(panel):
    show(panel, x_m="internal")
    low = panel.walls.topLevelItem(0)
    assert texts(low)[:2] == ["y_m", "0.05"]
    assert texts(low.child(0)) == ["before", "0.1", "1.667", "2", "90.0°"]
    assert texts(low.child(1)) == ["change", "0.500", "", "", "45.0°"]
    assert low.isExpanded()
    assert not panel.walls.topLevelItem(1).isExpanded()
    panel.store.change(changes.show_frame, 0)
    assert texts(panel.walls.topLevelItem(0))[1] == "0.1"
    assert panel.walls.topLevelItem(0).childCount() == 0


def test_the_hint_says_when_there_are_no_walls(panel):
    roles = dict.fromkeys(("x_m", "x_p", "y_m", "y_p"), "internal")
    show(panel, **roles)
    assert panel.hint.text().startswith("No boundary is a wall")
    show(panel)
    assert panel.hint.text().startswith("Walls: ")


def test_a_click_on_a_wall_selects_its_boundary(panel):
    show(panel)
    click(panel.walls, panel.walls.topLevelItem(0).child(1))
    assert panel.store.session.view.selected == ("y_m",)


def test_without_a_mesh_it_says_so(panel):
    assert "Open a mesh first" in panel.words.text()
    assert panel.walls.isHidden()
